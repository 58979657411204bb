"""Springs and dampers between two points, two links, along a guide; bushings at one point."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.linkages.formulas import FormulaScope
from mechanism_sim.numerics.curves import Curve
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg, polynomial
from mechanism_sim.planar.frames import Frames, Jet, JetPair
from mechanism_sim.planar.mechanism import Mechanism, Prismatic
from mechanism_sim.planar.points import GROUND, LinkPoint
from mechanism_sim.planar.protocols import Load, moment_of
from mechanism_sim.planar.virtual_work import located

_AXES = 'x', 'y'
_TURN = {'axis.x': math.cos, 'axis.y': math.sin}


@dataclass(frozen=True)
class SceneElement:
    """A force element of a scene, ``springs.NAME`` or ``loads.NAME``."""

    name: str

    @property
    def key(self) -> str:
        """Prefix of the keys of its parameters: no joint has such a name."""
        return self.name.replace('.', ':', 1)


@dataclass(frozen=True)
class GasColumn:
    """Gas behind a piston: it pushes with ``F (h/(h + x))^n`` at the elongation x."""

    force: float  #: F [N] at the free length
    column: float  #: h [m] height of the gas at the free length
    exponent: float  #: n, 1 for slow changes, that of the adiabat for fast ones

    def pull(self, frames: Frames, key: str, x: Term) -> Term:
        """The force, negative as it pushes [N]."""
        return neg(self._force(frames, key) * self._share(frames, key, x) ** self.exponent)

    def energy(self, frames: Frames, key: str, x: Term) -> Term:
        """The integral of the pull from the free length on [J]."""
        size = self._force(frames, key) * self._column(frames, key)
        share = self._share(frames, key, x)
        if self.exponent == 1.0:
            return size * hy.log(share)
        return size * (share ** (self.exponent - 1.0) - 1.0) / (self.exponent - 1.0)

    def _force(self, frames: Frames, key: str) -> hy.expression:
        return frames.parameters.reserve(f'{key}.gas.force', self.force)

    def _column(self, frames: Frames, key: str) -> hy.expression:
        return frames.parameters.reserve(f'{key}.gas.column', self.column)

    def _share(self, frames: Frames, key: str, x: Term) -> hy.expression:
        column = self._column(frames, key)
        return column / (column + dense(x))


def never_against(
    frames: Frames, key: str, side: int, total: Term, size: Term | float = 1.0
) -> Term:
    """A force of one sign, `side`, or none: no damper turns that of what only touches around.

    Its switch sees the force over `size` [N, N m], as `total` has it, so that roundings of stiff
    parts are none of it.
    """
    part = dense(total) / size
    away = side * part / hy.sqrt(1.0 + part * part)
    return mul(frames.switch(f'{key}.flag.presses', away), total)


@dataclass(frozen=True)
class SpringLaw:
    """Force over the elongation x from the free length or angle, and its rate; positive pulls.

    ``k x + c x' + preload``, with numbers or tables for ``k x`` and ``c x'``, less the push of a
    gas, and more by a formula. On one `side` it acts only where x has that sign, and never against
    it: a bump stop never pulls.
    """

    stiffness: float | Curve = 0.0
    damping: float | Curve = 0.0
    preload: float = 0.0
    gas: GasColumn | None = None
    side: int = 0  #: 1 only above the free length, -1 only below it, 0 both
    formula: str = ''
    scope: FormulaScope | None = field(default=None, compare=False)

    @property
    def numbers(self) -> tuple[float, float] | None:
        """Stiffness and damping, where there is nothing else."""
        k, c = self.stiffness, self.damping
        if isinstance(k, Curve) or isinstance(c, Curve):
            return None
        return None if self.preload or self.gas or self.side or self.formula else (k, c)

    def pull(self, frames: Frames, key: str, x: Term, rate: Term, own: Mapping[str, Term]) -> Term:
        """The force [N, N m].

        Parameters
        ----------
        key : with which the names of its parameters begin
        x, rate : elongation and its rate
        own : their names in formulas
        """
        total = add(self._stored(frames, key, x), self._taken(frames, key, rate, own))
        if not self.side or total is None:
            return total
        if self._holds_back:
            # the force at an elongation of 1, of a table that of its steepest part; 1 without
            steepest: Term | float = 1.0
            if isinstance(k := self.stiffness, Curve):
                steepest = float(np.abs(k.rows[:, 1:2]).max(initial=0.0)) or 1.0
            else:
                steepest = frames.parameters(f'{key}.stiffness', k) or 1.0
            total = never_against(frames, key, self.side, total, steepest)
        return mul(self._beyond(frames, key, x), total)

    def power_lost(
        self, frames: Frames, key: str, x: Term, rate: Term, own: Mapping[str, Term]
    ) -> Term:
        """The power that is not stored [W]."""
        if self.numbers:
            c = frames.parameters(f'{key}.damping', self.numbers[1])
            return None if c is None else mul(c, mul(rate, rate))
        if not self._holds_back:
            return None
        stored = self._stored(frames, key, x)
        if self.side:
            stored = mul(self._beyond(frames, key, x), stored)
        return mul(add(self.pull(frames, key, x, rate, own), neg(stored)), rate)

    def energy(self, frames: Frames, key: str, x: Term) -> Term:
        """The energy stored from the free length on [J]."""
        k = self.stiffness
        if isinstance(k, Curve):
            stored = self._tabulated(frames, key, k, x)[1]
        else:
            k = frames.parameters(f'{key}.stiffness', k)
            stored = mul(hy.expression(0.5), mul(k, mul(x, x)))
        preload = mul(frames.parameters(f'{key}.preload', self.preload), x)
        stored = add(stored, preload, self.gas and self.gas.energy(frames, key, x))
        return mul(self._beyond(frames, key, x), stored) if self.side else stored

    @property
    def _holds_back(self) -> bool:
        c = self.damping
        return bool(isinstance(c, Curve) or c or self.formula)

    def _stored(self, frames: Frames, key: str, x: Term) -> Term:
        k = self.stiffness
        if isinstance(k, Curve):
            elastic = self._tabulated(frames, key, k, x)[0]
        else:
            elastic = mul(frames.parameters(f'{key}.stiffness', k), x)
        preload = frames.parameters(f'{key}.preload', self.preload)
        return add(elastic, preload, self.gas and self.gas.pull(frames, key, x))

    def _taken(self, frames: Frames, key: str, rate: Term, own: Mapping[str, Term]) -> Term:
        c, given = self.damping, None
        if isinstance(c, Curve):
            table = f'{key}.table.damping'
            damped = frames.lookup(table, dense(rate), c.breaks, c.rows, c.cyclic)
        else:
            damped = mul(frames.parameters(f'{key}.damping', c), rate)
        if self.scope and self.formula:
            given = self.scope.term(frames, f'{key}.formula', self.formula, own)
        return add(damped, given)

    def _tabulated(self, frames: Frames, key: str, curve: Curve, x: Term) -> list[Term]:
        """Force of a table, and its integral: both in one, whose rows the engine knows."""
        n, rows = curve.rows.shape[1], np.hstack([curve.rows, curve.integral().rows])
        place = Jet(dense(x), {}, None, None)
        numbers, local = frames.table(f'{key}.table.force', place, curve.breaks, rows, False)
        return [polynomial(part, dense(local.value), 1)[0] for part in (numbers[:n], numbers[n:])]

    def _beyond(self, frames: Frames, key: str, x: Term) -> hy.expression:
        return frames.switch(f'{key}.flag.beyond', self.side * dense(x))


@dataclass(frozen=True)
class Elongation(SceneElement):
    """A force by a measure of how far two links are apart, and by its rate."""

    mechanism: Mechanism
    law: SpringLaw

    def loads(self, frames: Frames) -> list[Load]:
        """Loads on both links."""
        raise NotImplementedError

    def _measure(self, frames: Frames) -> tuple[Term, Term, Mapping[str, Term]]:
        """Elongation from the free length or angle, its rate, and what formulas call them."""
        raise NotImplementedError

    def pull(self, frames: Frames) -> Term:
        """Force [N] or moment [N m] by which it draws both ends together."""
        if not self.law.numbers:
            frames.formulas.add(self.name)
        return self.law.pull(frames, self.key, *self._measure(frames))

    def measured(self, frames: Frames) -> tuple[Term, Term]:
        """Length [m], or angle [rad] of the second link against the first, and its rate."""
        raise NotImplementedError

    def power_lost(self, frames: Frames) -> Term:
        """``c x'^2`` of a damper; of formulas and tables less what they feed in."""
        return self.law.power_lost(frames, self.key, *self._measure(frames))

    def energy(self, frames: Frames) -> Term:
        """``k x^2/2`` of a spring, or the integral of its force."""
        return self.law.energy(frames, self.key, self._measure(frames)[0])


@dataclass(frozen=True)
class Spring(Elongation):
    """A spring and a damper between points of two links.

    Its elongation is that of the line from the first to the second point. The points may meet only
    if it has neither free length nor damping: else the force has no direction there.
    """

    first: LinkPoint
    second: LinkPoint
    free_length: float = 0.0  #: [m]

    @property
    def directed(self) -> bool:
        """True if its force needs a direction where its ends meet."""
        return self.jumps or bool(self.law.numbers and self.law.numbers[1])

    @property
    def jumps(self) -> bool:
        """True but of a linear law without free length: force and way turn round together."""
        return bool(self.free_length or not self.law.numbers)

    def between(self, q: Array) -> Array:
        """Vector from end to end (2, N) [m] at coordinates q (n, N)."""
        (a, at_a), (b, at_b) = self.first, self.second
        place = self.mechanism.locate_all
        return np.asarray(place(b, q, at_b) - place(a, q, at_a))

    def _between(self, frames: Frames) -> JetPair:
        x, y = (
            b - a
            for a, b in zip(
                *(located(load, frames, self.mechanism) for load in self._ends((None, None))),
                strict=True,
            )
        )
        return x, y

    def _line(self, frames: Frames) -> tuple[tuple[Term, Term], Term, Term]:
        """Unit vector from the first to the second point, length [m], its rate [m/s]."""
        x, y = self._between(frames)
        square = add(mul(x.value, x.value), mul(y.value, y.value))
        length = hy.sqrt(dense(square))
        unit = dense(x.value) / length, dense(y.value) / length
        return unit, length, add(mul(unit[0], x.rate), mul(unit[1], y.rate))

    def _measure(self, frames: Frames) -> tuple[Term, Term, Mapping[str, Term]]:
        _, length, rate = self._line(frames)
        longer = add(length, neg(frames.parameters(f'{self.key}.free_length', self.free_length)))
        return longer, rate, {'length': length, 'rate': rate}

    def measured(self, frames: Frames) -> tuple[Term, Term]:
        """The length, or the displacement of a guide [m], and its rate."""
        return self._line(frames)[1:]

    def _ends(self, force: tuple[Term, Term]) -> list[Load]:
        return [
            Load(f'{self.key}.first', *self.first, force),
            Load(f'{self.key}.second', *self.second, (neg(force[0]), neg(force[1]))),
        ]

    def loads(self, frames: Frames) -> list[Load]:
        """Loads on both ends, directed towards each other for a positive pull."""
        p = frames.parameters
        if not self.directed and self.law.numbers:
            x, y = self._between(frames)
            k = p(f'{self.key}.stiffness', self.law.numbers[0])
            return self._ends((mul(k, x.value), mul(k, y.value)))
        unit, pull = self._line(frames)[0], self.pull(frames)
        return self._ends((mul(pull, unit[0]), mul(pull, unit[1])))

    def energy(self, frames: Frames) -> Term:
        """Stored energy; by squares, without the length, whose root has no series at zero."""
        if self.directed or not self.law.numbers:
            return super().energy(frames)
        x, y = self._between(frames)
        k = frames.parameters(f'{self.key}.stiffness', self.law.numbers[0])
        return mul(k, (x.half_square() + y.half_square()).value)


@dataclass(frozen=True)
class GuidedSpring(Spring):
    """A spring and a damper along a guide; its length is the displacement, which has a sign."""

    joint: str = ''  #: the prismatic joint, whose points it connects

    directed = True  # by its guide: what it connects may meet

    def between(self, q: Array) -> Array:
        """Infinite distances of the ends: where its points meet nothing happens."""
        return np.full((2, q.shape[1]), np.inf)

    def _line(self, frames: Frames) -> tuple[tuple[Term, Term], Term, Term]:
        joint = self.mechanism.joint(self.joint)
        assert isinstance(joint, Prismatic)  # noqa: S101 - it guides
        axis = self.mechanism.direction(joint.first, joint.axis)
        (x, y), (ux, uy) = self._between(frames), frames.position(axis, f'{self.key}.way')
        along = x * ux + y * uy
        return (ux.value, uy.value), along.value, along.rate


@dataclass(frozen=True)
class TorsionSpring(Elongation):
    """A spring and a damper that turn two links against each other.

    With the angle of the second less that of the first, all turns counted, the second link is
    turned back by ``k (angle - angle0) + c rate``.
    """

    first: str
    second: str
    free_angle: float = 0.0  #: [rad]

    def _measure(self, frames: Frames) -> tuple[Term, Term, Mapping[str, Term]]:
        """Angle less the free one [rad], and its rate [rad/s]."""
        (a, before), (b, after) = (self.mechanism.frame(x) for x in (self.first, self.second))
        free = frames.parameters(f'{self.key}.free_angle', self.free_angle - (after - before))
        angle, rate = neg(free), None
        if a != b:  # whole turns are subtracted from whole turns, which is exact
            one, two = frames.angle(a), frames.angle(b)
            turns = add(frames.turns(b), neg(frames.turns(a)))
            angle = add(two.value, neg(one.value), 2.0 * math.pi * turns, angle)
            rate = add(two.rate, neg(one.rate))
        bent = self._bent(frames, 'second') - self._bent(frames, 'first')
        angle, rate = add(angle, bent.value), add(rate, bent.rate)
        own = {'angle': self._whole(frames, angle), 'rate': rate} if self.law.formula else {}
        return angle, rate, own

    def _whole(self, frames: Frames, less: Term) -> Term:
        """The angle by what it is less the free one."""
        if not self.free_angle:
            return less
        return add(less, frames.parameters.reserve(f'{self.key}.free_angle.own', self.free_angle))

    def measured(self, frames: Frames) -> tuple[Term, Term]:
        """The angle of the second link less that of the first [rad], and its rate."""
        less, rate, _ = self._measure(frames)
        return self._whole(frames, less), rate

    def _bent(self, frames: Frames, which: str) -> Jet:
        return self.mechanism.bent(frames, getattr(self, which), (0.0, 0.0), f'{self.key}.{which}')

    def loads(self, frames: Frames) -> list[Load]:
        """Opposite moments on both links."""
        moment, origin = self.pull(frames), (0.0, 0.0)
        return [
            Load(f'{self.key}.first', self.first, origin, moment=moment),
            Load(f'{self.key}.second', self.second, origin, moment=neg(moment)),
        ]


@dataclass(frozen=True)
class Bushing(SceneElement):
    """Forces on a point of the second link by its place beside one of the first, in its frame.

    Both forces act where the second point is, so that they are opposite also while it is away.
    """

    mechanism: Mechanism
    laws: tuple[SpringLaw, SpringLaw]  #: along x and y of the first link's frame
    first: LinkPoint
    second: LinkPoint

    def _away(self, frames: Frames) -> tuple[list[Term], list[Term]]:
        """Place of the second point beside the first in the first's frame [m], and its rate."""
        ends = [Load(f'{self.key}.{n}', *getattr(self, n)) for n in ('first', 'second')]
        first, second = (located(load, frames, self.mechanism) for load in ends)
        x, y = (b - a for a, b in zip(first, second, strict=True))
        frame, _ = self.mechanism.frame(self.first[0])
        turning = None if frame == GROUND else frames.v[frame]
        place, rate = [], []
        for ux, uy in self._axes(frames):
            place.append(add(mul(ux, x.value), mul(uy, y.value)))
            rate.append(add(mul(ux, x.rate), mul(uy, y.rate)))
        return place, [
            add(rate[0], mul(turning, place[1])),
            add(rate[1], neg(mul(turning, place[0]))),
        ]

    def _axes(self, frames: Frames) -> list[tuple[Term, Term]]:
        frame, offset = self.mechanism.frame(self.first[0])
        one = hy.expression(1.0)
        axes = [(one, None), (None, one)]
        if offset:
            c, s = (frames.parameters(f'{self.key}.{n}', f(offset)) for n, f in _TURN.items())
            axes = [(c, s), (neg(s), c)]
        return [frames.world(frame, *axis) for axis in axes]

    def _each(self, frames: Frames) -> list[tuple[SpringLaw, str, Term, Term, Mapping[str, Term]]]:
        """Law, key of its parameters, place and rate along each axis."""
        if not all(law.numbers for law in self.laws):
            frames.formulas.add(self.name)
        keys = (f'{self.key}.{axis}' for axis in _AXES)
        return [(*x, {}) for x in zip(self.laws, keys, *self._away(frames), strict=True)]

    def loads(self, frames: Frames) -> list[Load]:
        """The forces at both points, and the moment of the first's about its point."""
        pulls = [law.pull(frames, *known) for law, *known in self._each(frames)]
        (ux, uy), (vx, vy) = self._axes(frames)
        x, y = (add(mul(pulls[0], u), mul(pulls[1], v)) for u, v in ((ux, vx), (uy, vy)))
        place = self._away(frames)[0]
        moment = moment_of((place[0], place[1]), (pulls[0], pulls[1]))
        return [
            Load(f'{self.key}.first', *self.first, (x, y), moment),
            Load(f'{self.key}.second', *self.second, (neg(x), neg(y))),
        ]

    def power_lost(self, frames: Frames) -> Term:
        """Dissipated power of both directions [W]."""
        return add(*(law.power_lost(frames, *known) for law, *known in self._each(frames)))

    def energy(self, frames: Frames) -> Term:
        """Stored energy of both directions [J]."""
        return add(*(law.energy(frames, *known[:2]) for law, *known in self._each(frames)))
