"""Symbols of a mechanism's poses, their constants as runtime parameters; jets.

A `Jet` is an expression of the coordinates that carries its own derivatives (forward
differentiation). Written out by the chain rule, they share their factors and keep differences of
nearly equal terms together: fewer operations and less rounding than differentiating formulas.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import reduce
from typing import TypeAlias

import heyoka as hy

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import Term, add, dense, div, mul, neg
from mechanism_sim.planar.points import GROUND, Point, factors
from mechanism_sim.planar.switches import Switch, SwitchTable, ToothTable

JetPair: TypeAlias = 'tuple[Jet, Jet]'
Number: TypeAlias = 'Jet | hy.expression | float | None'
STATE = 'state:'
"""Prefix of the names of states of first order in `Frames.outside`."""


@dataclass
class Parameters:
    """Numbers of a scene that compiled code reads at run time, so that a sweep never recompiles.

    Zeros and ones stay out: they shape the expressions.

    A key begins with what it belongs to: a joint, or `links:`, `loads:`, `springs:`, `drives:`,
    `now:` and `inertia:` and its like with a name. What follows a dot is the engine's word, what
    follows a colon or an @ is a name of the scene's; names hold none of these characters, so that
    no two keys are alike.
    """

    names: dict[str, int] = field(default_factory=dict)
    values: list[float] = field(default_factory=list)

    def __call__(self, name: str, value: float) -> Term:
        """Expression of the parameter `name`; None for zero, ValueError for a second value."""
        if value == 0.0:
            return None
        symbol = self.reserve(name, value)
        if self.values[self.names[name]] != value:
            raise ValueError(f'{name} is {self.values[self.names[name]]} and {value}')
        return symbol

    def reserve(self, name: str, value: float = 0.0) -> hy.expression:
        """Expression of a parameter that changes during a run and may be zero."""
        if name not in self.names:
            self.names[name] = len(self.values)
            self.values.append(float(value))
        return hy.par[self.names[name]]


class Frames:
    """Coordinates as symbols, and vectors that turn with the links.

    Attributes
    ----------
    q, v, a : dict
        Symbols of each coordinate, angle [rad] or displacement [m], its rate and acceleration.
        They are numbered: the names of a scene are no part of its expressions.
    outside : dict
        Symbols of further inputs of loads: ``time`` [s] since the start of the run,
        ``COORDINATE.turns``, the whole turns that its symbol leaves out, and ``state:NUMBER``.
    switches : dict
        Switches between parts of the cycle, by name.
    wide : set
        Names of the switches whose parts each last a good share of a turn.
    formulas : set
        Names of the loads by formulas, which may be steep anywhere.
    texts : dict
        Texts of formulas, with their expressions, by the keys of their parameters.
    """

    def __init__(
        self,
        coordinates: tuple[str, ...],
        parameters: Parameters,
    ) -> None:
        self.parameters = parameters
        self.coordinates = coordinates
        self.q, self.v, self.a = (
            {n: hy.make_vars(f'{letter}{i}') for i, n in enumerate(coordinates)}
            for letter in 'qva'
        )
        self.outside: dict[str, hy.expression] = {}
        self.switches: dict[str, Switch | SwitchTable] = {}
        self.slips: set[str] = set()
        self.wide: set[str] = set()
        self.formulas: set[str] = set()
        self.texts: dict[str, tuple[str, hy.expression]] = {}

    @property
    def time(self) -> hy.expression:
        """The time since the start of the run [s]."""
        return self.outside.setdefault('time', hy.make_vars('time'))

    def state(self, number: int) -> hy.expression:
        """A state of first order, by its number, in its own unit."""
        return self.outside.setdefault(f'{STATE}{number}', hy.make_vars(f'state{number}'))

    def turns(self, frame: str) -> Term:
        """The whole turns that the symbol of a frame's angle leaves out."""
        if frame == GROUND:
            return None
        symbol = hy.make_vars(f'turns{self.coordinates.index(frame)}')
        return self.outside.setdefault(f'{frame}.turns', symbol)

    def unwound(self, frame: str) -> Term:
        """The angle of a frame with all its turns [rad]; not smooth where turns are taken off."""
        if frame == GROUND:
            return None
        return self.q[frame] + 2.0 * math.pi * self.turns(frame)

    def switch(self, name: str, guard: hy.expression) -> hy.expression:
        """A flag that is 1 where `guard` is positive and 0 elsewhere."""
        for other, known in self.switches.items():
            alike = isinstance(known, Switch) and known.inside == guard
            if alike and other not in self.slips:
                return known.symbols[0]
        return self._switch(name, guard).flag

    def slip(self, name: str, rate: hy.expression) -> Switch:
        """Switch of a friction, on its slip rate; not shared with any load."""
        self.slips.add(name)
        return self._switch(name, rate)

    def _switch(self, name: str, guard: hy.expression) -> Switch:
        known = self.switches.get(name)
        if not isinstance(known, Switch):
            number = len(self.switches)
            rated = {str(v) for v in self.v.values()}.intersection(hy.get_variables(guard))
            holds = hy.make_vars(f'holds{number}') if rated else None
            known = self.switches[name] = Switch(hy.make_vars(f'on{number}'), guard, holds)
        return known

    def table(
        self, name: str, along: Jet, breaks: Array, rows: Array, periodic: bool
    ) -> tuple[tuple[hy.expression, ...], Jet]:
        """Numbers that change from row to row along a coordinate, such as pieces of a cam's law.

        Parameters
        ----------
        along : coordinate [rad, m], of any number of turns if it is periodic
        breaks : (k + 1,) [rad, m] between which the rows hold; of a turn if it is periodic, each
            then not longer than a right angle
        rows : (k, n)
        periodic : True if the first row follows the last; else a run ends beyond the breaks

        Returns
        -------
        The n symbols of the present row; the coordinate from the middle of the row.
        """
        known = self._table(name, dense(along.value), breaks, rows, periodic)
        local = Jet(known.local, along.gradient, along.rate, along.curvature)
        return known.numbers, local

    def past_tooth(self, name: str, along: Jet, count: int) -> Jet:
        """Angle [rad] since the last tooth passed while rising, of a number of teeth on a turn."""
        known = self.switches.get(name)
        if not isinstance(known, ToothTable):
            own = f'row{len(self.switches)}'
            known = self.switches[name] = ToothTable(name, own, dense(along.value), count)
        return Jet(known.local, along.gradient, along.rate, along.curvature)

    def lookup(
        self, name: str, place: hy.expression, breaks: Array, rows: Array, periodic: bool
    ) -> hy.expression:
        """Piecewise polynomial of a position, which may be any function of motion and time.

        Parameters
        ----------
        breaks : (k + 1,) as in `table`, or infinite at both ends
        rows : (k, n) coefficients of rising powers of the position from its interval's middle,
            or from the finite end of an infinite one
        """
        known = self._table(name, place, breaks, rows, periodic)
        value = known.numbers[-1]
        for number in reversed(known.numbers[:-1]):
            value = number + known.local * value
        return value

    def _table(
        self, name: str, place: hy.expression, breaks: Array, rows: Array, periodic: bool
    ) -> SwitchTable:
        known = self.switches.get(name)
        if not isinstance(known, SwitchTable):
            own = f'row{len(self.switches)}'
            known = self.switches[name] = SwitchTable(name, own, place, breaks, rows, periodic)
        return known

    def world(self, frame: str, x: Term, y: Term) -> tuple[Term, Term]:
        """Components in the ground's frame of a vector given in a link's frame."""
        if frame == GROUND:
            return x, y
        return _turned(hy.cos(self.q[frame]), hy.sin(self.q[frame]), x, y)

    def position(self, point: Point, label: str) -> JetPair:
        """World components [m] of a point; `label` names its parameters."""
        x: list[Jet] = []
        y: list[Jet] = []
        for (frame, slide), d in point.items():
            name = '@'.join((label, frame, *factors(slide)))
            given = (f'{name}.x', d[0]), (f'{name}.y', d[1])
            if slide is None:
                arm = tuple(self.parameters(*each) for each in given)
                turned = self.turned(frame, *arm)
            else:
                arm = tuple(  # of a unit vector: ones need no parameter
                    hy.expression(x) if abs(x) == 1.0 else self.parameters(axis, x)
                    for axis, x in given
                )
                way = self.turned(frame, *arm)
                scale = reduce(operator.mul, map(self.displacement, factors(slide)))
                turned = scale * way[0], scale * way[1]
            x.append(turned[0])
            y.append(turned[1])
        zero = Jet(None, {}, None, None)
        return sum(x, zero), sum(y, zero)

    def turned(self, frame: str, x: Term, y: Term) -> JetPair:
        """World components of a vector that is fixed in a frame."""
        if frame == GROUND:
            return Jet(x, {}, None, None), Jet(y, {}, None, None)
        wx, wy = self.world(frame, x, y)
        # arms come last in rates: all points share the products of rate and direction
        c, s, v = hy.cos(self.q[frame]), hy.sin(self.q[frame]), self.v[frame]
        vx, vy = _turned(v * c, v * s, x, y)
        ax, ay = mul(v, vx), mul(v, vy)
        return (
            Jet(wx, {frame: neg(wy)}, neg(vy), neg(ax)),
            Jet(wy, {frame: wx}, vx, neg(ay)),
        )

    def displacement(self, name: str) -> Jet:
        """A displacement as a function of the coordinates."""
        return Jet(self.q[name], {name: hy.expression(1.0)}, self.v[name], None)

    def angle(self, frame: str) -> Jet:
        """The angle of a frame, without whole turns [rad]."""
        return lift(0.0) if frame == GROUND else self.displacement(frame)

    def turn(self, turns: Mapping[str, float], label: str) -> Jet:
        """Rotation [rad] of a link at a point, as a sum over coordinates."""
        found = Jet(None, {}, None, None)
        for c, slope in turns.items():
            turn = self.displacement(c)
            if slope != 1.0:
                turn = turn * dense(self.parameters(f'{label}.turn@{c}', slope))
            found += turn
        return found

    def product(self, f: str, g: str, inner: Term, outer: Term) -> Term:
        """Scalar product of a in frame f and b in frame g.

        Given ``inner = a.b`` and ``outer = ax by - ay bx`` as if both frames were the same, it is
        ``inner cos(theta_g - theta_f) - outer sin(theta_g - theta_f)``.
        """
        if f == g:
            return inner
        if f == GROUND:
            c, s = hy.cos(self.q[g]), hy.sin(self.q[g])
        elif g == GROUND:
            c, s = hy.cos(self.q[f]), -hy.sin(self.q[f])
        else:
            cf, sf = hy.cos(self.q[f]), hy.sin(self.q[f])
            cg, sg = hy.cos(self.q[g]), hy.sin(self.q[g])
            c, s = cf * cg + sf * sg, sg * cf - cg * sf
        return add(mul(inner, c), neg(mul(outer, s)))


def _turned(c: Term, s: Term, x: Term, y: Term) -> tuple[Term, Term]:
    """``(c x - s y, s x + c y)``."""
    return add(mul(c, x), neg(mul(s, y))), add(mul(s, x), mul(c, y))


@dataclass(frozen=True)
class Jet:
    """A function f of the coordinates q along a motion with rates v."""

    value: Term  #: f
    gradient: dict[str, Term]  #: derivatives by coordinate name; missing ones vanish
    rate: Term  #: time derivative, ``gradient . v``
    curvature: Term  #: second time derivative less ``gradient . a``

    def _names(self, other: Jet) -> list[str]:
        return list(dict.fromkeys((*self.gradient, *other.gradient)))

    def row(self, coordinates: tuple[str, ...]) -> list[Term]:
        """The gradient as a row (n,)."""
        return [self.gradient.get(name) for name in coordinates]

    def __add__(self, other: Number) -> Jet:
        o = lift(other)
        return Jet(
            add(self.value, o.value),
            {n: add(self.gradient.get(n), o.gradient.get(n)) for n in self._names(o)},
            add(self.rate, o.rate),
            add(self.curvature, o.curvature),
        )

    def __neg__(self) -> Jet:
        gradient = {n: neg(g) for n, g in self.gradient.items()}
        return Jet(neg(self.value), gradient, neg(self.rate), neg(self.curvature))

    def __sub__(self, other: Number) -> Jet:
        return self + -lift(other)

    def __mul__(self, other: Number) -> Jet:
        o = lift(other)
        cross = mul(self.rate, o.rate)
        return Jet(
            mul(self.value, o.value),
            {
                n: add(mul(self.gradient.get(n), o.value), mul(self.value, o.gradient.get(n)))
                for n in self._names(o)
            },
            add(mul(self.rate, o.value), mul(self.value, o.rate)),
            add(
                mul(self.curvature, o.value),
                mul(self.value, o.curvature),
                None if cross is None else 2.0 * cross,
            ),
        )

    def __truediv__(self, other: hy.expression | float) -> Jet:
        """Quotient by a constant."""
        o = dense(lift(other).value)
        gradient = {n: div(g, o) for n, g in self.gradient.items()}
        return Jet(div(self.value, o), gradient, div(self.rate, o), div(self.curvature, o))

    def chain(self, value: hy.expression, slope: Term, bend: Term) -> Jet:
        """``F(f)``, given its value and its first two derivatives there."""
        return Jet(
            value,
            {n: mul(slope, g) for n, g in self.gradient.items()},
            mul(slope, self.rate),
            add(mul(slope, self.curvature), mul(mul(bend, self.rate), self.rate)),
        )

    def across(self, other: Jet) -> Jet:
        """``f g' - g f'`` as a rate that belongs to no value: gradient, rate and curvature."""
        return Jet(
            None,
            {
                n: add(
                    mul(self.value, other.gradient.get(n)),
                    neg(mul(other.value, self.gradient.get(n))),
                )
                for n in self._names(other)
            },
            add(mul(self.value, other.rate), neg(mul(other.value, self.rate))),
            add(mul(self.value, other.curvature), neg(mul(other.value, self.curvature))),
        )

    @property
    def as_rate(self) -> Jet:
        """Rate of this function alone, which belongs to no value."""
        return Jet(None, self.gradient, self.rate, self.curvature)

    def times_rate(self, other: Jet) -> Jet:
        """``f g'`` as a rate that belongs to no value."""
        return Jet(
            None,
            {n: mul(self.value, g) for n, g in other.gradient.items()},
            mul(self.value, other.rate),
            add(mul(self.value, other.curvature), mul(self.rate, other.rate)),
        )

    def half_square(self) -> Jet:
        """f^2/2."""
        return Jet(
            mul(hy.expression(0.5), mul(self.value, self.value)),
            {n: mul(self.value, g) for n, g in self.gradient.items()},
            mul(self.value, self.rate),
            add(mul(self.value, self.curvature), mul(self.rate, self.rate)),
        )


def wrapped(angle: Jet, per: hy.expression) -> Jet:
    """An angle [rad] without whole turns, times a constant."""
    u = dense(angle.value)
    return angle.chain(per * hy.atan2(hy.sin(u), hy.cos(u)), per, None)


def lift(x: Number) -> Jet:
    """A number or a parameter as a jet that does not move."""
    if isinstance(x, Jet):
        return x
    return Jet(hy.expression(float(x)) if isinstance(x, int | float) else x, {}, None, None)
