"""Vectors that gaps, closures and forces are made of, and symbols that stand for them."""

from __future__ import annotations

from typing import Any

import heyoka as hy

from mechanism_sim.numerics.symbolic import Term, dense
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.jet import Jet
from mechanism_sim.report.equations import Equation
from mechanism_sim.report.symbols import Expression, Symbols

_SHORT = 5
"""Nodes of an expression up to which a position needs no symbol of its own."""


class _Recorder:
    """Frames that remember the vectors they were asked for, by label."""

    def __init__(self, frames: Any) -> None:
        self._frames = frames
        self._made: dict[str, tuple[Jet, Jet]] = {}
        self.seen: dict[str, tuple[Jet, Jet]] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._frames, name)

    def position(self, point: Any, label: str) -> tuple[Jet, Jet]:
        if label not in self._made:
            self._made[label] = self._frames.position(point, label)
        self.seen[label] = self._made[label]
        return self._made[label]


class Vectors:
    """Terms in symbols, some of which stand for vectors.

    Attributes
    ----------
    frames : those of the equations; they remember the vectors they are asked for
    equations : what every symbol of a vector stands for
    """

    def __init__(self, equations: Equations, symbols: Symbols) -> None:
        self.frames: Any = _Recorder(equations.frames)
        self.equations: list[Equation] = []
        self._mechanism, self._symbols = equations.mechanism, symbols
        self._abbreviations: dict[str | hy.expression, hy.expression] = {}
        self._named: dict[str, dict[str | hy.expression, hy.expression]] = {}

    def in_symbols(self, term: Term) -> Expression:
        """A term in symbols, with those of the vectors in it."""
        expression = dense(term)
        if self._abbreviations:
            [expression] = hy.subs([expression], self._abbreviations)
        return self._symbols.translate(expression)

    def terms(self, term: Term) -> tuple[Expression, ...]:
        """Terms of its sum, in symbols."""
        return () if term is None else self._symbols.terms(self.in_symbols(term))

    def use_seen(self) -> None:
        """Let symbols stand for the vectors asked for since the last time, and no others."""
        self._abbreviations = {}
        for label, pair in self.frames.seen.items():
            if label not in self._named:
                self._named[label] = self._named_vector(label, pair)
            self._abbreviations |= self._named[label]
        self.frames.seen.clear()

    def _named_vector(
        self, label: str, pair: tuple[Jet, Jet]
    ) -> dict[str | hy.expression, hy.expression]:
        """Symbols for a vector and its rate, if it is not as short as a symbol."""
        if all(jet.value is None or len(jet.value) <= _SHORT for jet in pair):
            return {}
        symbols, found = self._symbols, {}
        joints = {joint.name for joint in self._mechanism.joints}
        where = 'from the second to the first link at' if label in joints else 'of'
        for axis, jet in zip('xy', pair, strict=True):
            for stem, term, what, unit in (
                (f'Q{axis}', jet.value, '', 'm'),
                (f'Qdot{axis}', jet.rate, 'rate of ', 'm/s'),
            ):
                if term is None:
                    continue
                meaning = f'{what}{axis} {where} {label}'
                symbol = symbols.make(stem, (label,), label, meaning, unit)
                line = Equation(label, (symbol,), symbols.terms(symbols.translate(term)))
                self.equations.append(line)
                found[term] = hy.make_vars(str(symbol))
        return found

    def use(self, label: str) -> None:
        """Let symbols stand for one vector, if it has any, and no others."""
        self._abbreviations = self._named.get(label, {})
