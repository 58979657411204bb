"""Formulas of a machine in motion: efforts of loads, springs and drives, rates of states."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import heyoka as hy

from mechanism_sim.numerics import formula
from mechanism_sim.numerics.curves import Curve
from mechanism_sim.numerics.symbolic import Term, add, dense
from mechanism_sim.planar.closures import slid
from mechanism_sim.planar.frames import Frames, Jet
from mechanism_sim.planar.mechanism import Mechanism, Prismatic
from mechanism_sim.planar.protocols import Load


class MeasuredSpring(Protocol):
    """Something between two links with a length or an angle."""

    def measured(self, frames: Frames) -> tuple[Term, Term]:
        """Length [m] or angle [rad], and its rate."""


@dataclass(frozen=True)
class FormulaScope:
    """Meanings of the names in formulas of one machine.

    They know the time ``t``, states of first order by their names, of every link its angle, all
    turns counted, or its displacement, and its rate (``LINK``, ``LINK_rate``), of every spring its
    length or angle, and its rate (``SPRING.length``, ``SPRING.angle``, ``SPRING.rate``).
    """

    mechanism: Mechanism
    guided: Mapping[str, str] = field(default_factory=dict)
    """The prismatic joints along which displacements count, by link: also if they are cut here."""
    tables: Mapping[str, Curve] = field(default_factory=dict)
    """Functions that formulas may call."""
    states: Sequence[str] = ()
    """Names of the states of first order, in the order of their numbers."""
    springs: Mapping[str, Callable[[Mechanism], MeasuredSpring]] = field(default_factory=dict)
    """Whose lengths and rates they know, by name."""

    def term(
        self,
        frames: Frames,
        key: str,
        text: str,
        own: Mapping[str, Term] | None = None,
        size: float = 0.0,
    ) -> hy.expression:
        """A formula as an expression.

        Parameters
        ----------
        key : with which the names of its parameters begin
        own : expressions of further names
        size : of the state whose rate it is
        """
        known, angles = {**(own or {})}, {}
        names = formula.read(text, self.tables).names
        for name in [n for n in names if n not in known and n != 't']:
            spring, _, what = name.partition('.')
            if name in self.states:
                known[name] = frames.state(self.states.index(name))
            elif what:
                length, rate = self.springs[spring](self.mechanism).measured(frames)
                known[name] = rate if what == 'rate' else length
            elif all(name != body.name for body in self.mechanism.bodies):
                known[name] = self.motion(frames, name.removesuffix('_rate')).rate
            elif name in self.guided:
                known[name] = self.motion(frames, name).value
            else:
                angles[name] = self._turned(frames, name)
        if 't' in names:
            known['t'] = frames.time
        count = itertools.count()

        def number(value: float) -> hy.expression:
            return frames.parameters.reserve(f'{key}.number.{next(count)}', value)

        def flag(guard: hy.expression) -> hy.expression:
            return frames.switch(f'{key}.flag.{next(count)}', guard)

        def table(curve: Curve) -> Callable[[hy.expression], hy.expression]:
            return lambda place: frames.lookup(
                f'{key}.table.{next(count)}',
                place if curve.scale == 1.0 else curve.scale * place,
                curve.breaks,
                curve.rows,
                curve.cyclic,
            )

        words = formula.Words(
            {k: dense(term) for k, term in known.items()},
            number,
            flag,
            {name: table(curve) for name, curve in self.tables.items()},
            angles,
            {name: curve.scale for name, curve in self.tables.items() if curve.cyclic},
            size,
        )
        frames.texts[key] = text, (found := formula.expression(text, words))
        return found

    def _turned(
        self, frames: Frames, link: str
    ) -> tuple[hy.expression, Callable[[], hy.expression]]:
        """Angle of a link without whole turns [rad], and with all of them."""
        frame, offset = self.mechanism.frame(link)
        given = frames.parameters(f'links:{link}.offset', offset)
        local = dense(add(frames.angle(frame).value, given))
        return local, lambda: dense(add(frames.unwound(frame), given))

    def motion(self, frames: Frames, link: str) -> Jet:
        """Angle without whole turns [rad], or displacement [m], of a link."""
        m = self.mechanism
        if link not in self.guided:
            return frames.angle(m.frame(link)[0])
        joint = m.joint(self.guided[link])
        assert isinstance(joint, Prismatic)  # noqa: S101 - it guides
        return slid(m, frames, joint)


@dataclass(frozen=True)
class FormulaTorque:
    """The torque of a drive by a formula, as the characteristic of a motor."""

    formula: str
    scope: FormulaScope = field(compare=False)

    name = 'a torque by a formula'
    starting = 1.0
    """[N m] of which only the sign counts, for a drawing."""

    def on(self, mechanism: Mechanism) -> FormulaTorque:
        """Itself in another tree of the mechanism."""
        return replace(self, scope=replace(self.scope, mechanism=mechanism))

    def torque(self, frames: Frames, key: str, _: hy.expression) -> hy.expression:
        """Torque [N m], or force [N]; `key` begins the names of its parameters."""
        frames.formulas.add(key.replace(':', '.', 1))
        return self.scope.term(frames, key, self.formula)


@dataclass(frozen=True)
class FormulaState:
    """A state of first order whose rate is a formula; see `FirstOrderState`."""

    name: str  #: ``states.NAME``
    unit: str  #: SI, empty of a plain number
    start: float  #: [unit]
    scale: float  #: [unit] a power of two
    formula: str  #: of its rate [unit/s]
    scope: FormulaScope = field(compare=False)

    @property
    def label(self) -> str:
        """Name in formulas, columns and messages."""
        return self.name.partition('.')[2]

    def rate(self, frames: Frames) -> hy.expression:
        """Rate of the state [unit/s]."""
        frames.formulas.add(self.name)
        key = self.name.replace('.', ':', 1)
        return self.scope.term(frames, key, self.formula, size=self.scale)

    def loads(self, _: Frames) -> list[Load]:
        """Loads on links: none."""
        return []

    def power_lost(self, _: Frames) -> Term:
        """Dissipated power: none."""
        return None

    def energy(self, _: Frames) -> Term:
        """Stored energy: none."""
        return None
