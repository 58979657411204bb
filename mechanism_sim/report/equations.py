"""Equations of a machine before they are set as text or LaTeX."""

from __future__ import annotations

from dataclasses import dataclass

from mechanism_sim.report.symbols import Expression, Symbol


@dataclass(frozen=True)
class Equation:
    """``left = right``, each the sum of its terms in their order."""

    name: str
    left: tuple[Expression, ...]
    right: tuple[Expression, ...]
    note: str = ''


@dataclass(frozen=True)
class EquationGroup:
    """Equations of one kind."""

    name: str
    heading: str
    equations: tuple[Equation, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class MachineEquations:
    """All equations of a machine, and the symbols in them."""

    scene: str
    title: str
    level: str
    coordinates: tuple[tuple[Symbol, Symbol, Symbol], ...]  #: with rate and acceleration
    parameters: tuple[Symbol, ...]  #: constants of the scene
    variables: tuple[Symbol, ...]  #: forces, gaps and what else follows from the motion
    parts: tuple[EquationGroup, ...]
