"""Springs, dampers, forces and torques on links: the force elements of a linkage."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics import formula
from mechanism_sim.numerics.curves import Curve
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.jet import Jet
from mechanism_sim.planar.loads import Load
from mechanism_sim.planar.mechanism import Mechanism, Prismatic
from mechanism_sim.planar.points import Vector2
from mechanism_sim.planar.virtual_work import located

_WIDE = 0.25 * math.pi  # parts of a turn that no piece of a motion steps over

_NARROW = 0.01  # parts of a turn at whose ends cosines hardly differ

LinkPoint = tuple[str, Vector2]
"""A link, and a point in its frame [m]."""


@dataclass(frozen=True)
class _Element:
    """A force element of a scene, ``springs.NAME`` or ``loads.NAME``."""

    name: str

    @property
    def key(self) -> str:
        """With which the keys of its parameters begin: no joint has such a name."""
        return self.name.replace('.', ':', 1)


@dataclass(frozen=True)
class Spring(_Element):
    """A spring and a damper between points of two links.

    With the length l of the line from the first to the second point, it pulls with
    ``k (l - l0) + c l'``. The points may meet only if it has neither free length nor damping: else
    the force has no direction there.
    """

    mechanism: Mechanism
    first: LinkPoint
    second: LinkPoint
    stiffness: float  #: [N/m]
    free_length: float = 0.0  #: [m]
    damping: float = 0.0  #: [N s/m]

    @property
    def directed(self) -> bool:
        """True if its force needs a direction where its ends meet."""
        return bool(self.free_length or self.damping)

    def length(self, q: Array) -> Array:
        """From end to end (N,) [m] at coordinates q (n, N)."""
        (a, at_a), (b, at_b) = self.first, self.second
        place = self.mechanism.locate_all
        return np.asarray(np.hypot(*(place(b, q, at_b) - place(a, q, at_a))))

    def _between(self, frames: Frames) -> tuple[Jet, Jet]:
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

    def _ends(self, force: tuple[Term, Term]) -> list[Load]:
        return [
            Load(f'{self.key}.first', *self.first, force),
            Load(f'{self.key}.second', *self.second, (neg(force[0]), neg(force[1]))),
        ]

    def loads(self, frames: Frames) -> list[Load]:
        """It pulls its ends towards each other."""
        p = frames.parameters
        k, c = p(f'{self.key}.stiffness', self.stiffness), p(f'{self.key}.damping', self.damping)
        if not self.directed:
            x, y = self._between(frames)
            return self._ends((mul(k, x.value), mul(k, y.value)))
        unit, length, rate = self._line(frames)
        longer = add(length, neg(p(f'{self.key}.free_length', self.free_length)))
        pull = add(mul(k, longer), mul(c, rate))
        return self._ends((mul(pull, unit[0]), mul(pull, unit[1])))

    def power_lost(self, frames: Frames) -> Term:
        """``c l'^2``."""
        c = frames.parameters(f'{self.key}.damping', self.damping)
        if c is None:
            return None
        rate = self._line(frames)[2]
        return mul(c, mul(rate, rate))

    def energy(self, frames: Frames) -> Term:
        """``k (l - l0)^2/2``."""
        p = frames.parameters
        k = p(f'{self.key}.stiffness', self.stiffness)
        if not self.directed:
            x, y = self._between(frames)
            return mul(k, (x.half_square() + y.half_square()).value)
        longer = add(self._line(frames)[1], neg(p(f'{self.key}.free_length', self.free_length)))
        return mul(hy.expression(0.5), mul(k, mul(longer, longer)))


@dataclass(frozen=True)
class TorsionSpring(_Element):
    """A spring and a damper that turn two links against each other.

    With the angle of the second less that of the first, all turns counted, the second link is
    turned back by ``k (angle - angle0) + c rate``.
    """

    mechanism: Mechanism
    first: str
    second: str
    stiffness: float  #: [N m/rad]
    free_angle: float = 0.0  #: [rad]
    damping: float = 0.0  #: [N m s/rad]

    def _twist(self, frames: Frames) -> tuple[Term, Term]:
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
        return add(angle, bent.value), add(rate, bent.rate)

    def _bent(self, frames: Frames, which: str) -> Jet:
        return self.mechanism.bent(frames, getattr(self, which), (0.0, 0.0), f'{self.key}.{which}')

    def loads(self, frames: Frames) -> list[Load]:
        """Opposite moments on both links."""
        angle, rate = self._twist(frames)
        p = frames.parameters
        k, c = p(f'{self.key}.stiffness', self.stiffness), p(f'{self.key}.damping', self.damping)
        moment = add(mul(k, angle), mul(c, rate))
        origin = (0.0, 0.0)
        return [
            Load(f'{self.key}.first', self.first, origin, moment=moment),
            Load(f'{self.key}.second', self.second, origin, moment=neg(moment)),
        ]

    def power_lost(self, frames: Frames) -> Term:
        """``c rate^2``."""
        _, rate = self._twist(frames)
        return mul(frames.parameters(f'{self.key}.damping', self.damping), mul(rate, rate))

    def energy(self, frames: Frames) -> Term:
        """``k (angle - angle0)^2/2``."""
        angle, _ = self._twist(frames)
        k = frames.parameters(f'{self.key}.stiffness', self.stiffness)
        return mul(hy.expression(0.5), mul(k, mul(angle, angle)))


@dataclass(frozen=True)
class CycleRange:
    """A part of the cycle: between two places of a coordinate, or in one direction of motion."""

    coordinate: str
    begin: float | None  #: [rad, m]
    end: float | None  #: [rad] counterclockwise from there; [m]
    straight: bool = False  #: whether the coordinate is a displacement
    way: int = 0  #: 1 only while it increases, -1 only while it decreases, 0 both

    def guards(
        self, frames: Frames, mechanism: Mechanism, name: str, along: Jet
    ) -> Iterator[tuple[str, hy.expression]]:
        """Names and functions that are all positive within.

        Of an angle ``cos(angle - middle) - cos(half the width)``, of a displacement the distance
        from each end, of the direction the rate.

        Parameters
        ----------
        along : the coordinate
        """
        if self.straight:
            ends = (('begin', self.begin, 1.0), ('end', self.end, -1.0))
            for key, end, sign in ends:
                if end is not None:
                    place = frames.parameters.reserve(f'{name}.{key}', end)
                    yield f'{name}.{key}', sign * (dense(along.value) - place)
        elif self.begin is not None and self.end is not None:
            yield name, self._inside(frames, mechanism, name, self.begin, self.end)
        if self.way:
            yield f'{name}.way', self.way * dense(along.rate)

    def _inside(
        self, frames: Frames, mechanism: Mechanism, name: str, begin: float, end: float
    ) -> hy.expression:
        frame, offset = mechanism.frame(self.coordinate)
        width = (end - begin) % (2.0 * math.pi)
        middle = begin + 0.5 * width - offset
        if _WIDE < width < 2.0 * math.pi - _WIDE:
            frames.wide.add(name)
        p, q = frames.parameters, frames.q[frame]
        if width < _NARROW or width > 2.0 * math.pi - _NARROW:
            return _beside(p, name, q, middle, width)
        c, s = p(f'{name}.middle.x', math.cos(middle)), p(f'{name}.middle.y', math.sin(middle))
        along = add(mul(c, hy.cos(q)), mul(s, hy.sin(q)))
        return dense(add(along, neg(p(f'{name}.half', math.cos(0.5 * width)))))


def _beside(
    parameters: Parameters, name: str, q: hy.expression, middle: float, width: float
) -> hy.expression:
    """Positive within a narrow part of a turn, or outside of one, whose cosines would round alike.

    ``1 - (sin((q - middle)/2)/sin(width/4))^2``, as of the rows of a table.
    """
    within = width < math.pi
    if not within:
        middle, width = middle + math.pi, 2.0 * math.pi - width
    c = parameters.reserve(f'{name}.halfway.x', math.cos(0.5 * middle))
    s = parameters.reserve(f'{name}.halfway.y', math.sin(0.5 * middle))
    steep = parameters.reserve(f'{name}.narrow', 1.0 / math.sin(0.25 * width))
    share = steep * (hy.sin(0.5 * q) * c - hy.cos(0.5 * q) * s)
    return 1.0 - share * share if within else share * share - 1.0


@dataclass(frozen=True)
class AppliedForce(_Element):
    """A force or a torque on a link, constant or by a formula, always or in a part of the cycle.

    No number of a force shapes the equations, so that another one compiles nothing. Formulas know
    the time ``t``, place ``x, y`` and velocity ``vx, vy`` of the point, and of every
    link its angle, all turns counted, and its rate (``LINK``, ``LINK_rate``); of those in `guided`
    the displacement.
    """

    mechanism: Mechanism
    point: LinkPoint
    force: tuple[float | str, float | str] = (0.0, 0.0)  #: [N]
    torque: float | str = 0.0  #: [N m]
    turns: bool = False  #: whether the force is given in the link's frame
    during: CycleRange | None = None
    guided: Mapping[str, str] = field(default_factory=dict)
    """The prismatic joints along which displacements count, by link: also if they are cut here."""
    tables: Mapping[str, Curve] = field(default_factory=dict)
    """Functions that formulas may call."""
    reaction: LinkPoint | None = None
    """Where the opposite force and torque act, if not outside of the machine."""

    def loads(self, frames: Frames) -> list[Load]:
        """The force at its point, the torque, and what is opposite."""
        bare = Load(self.key, *self.point)
        x, y = located(bare, frames, self.mechanism)
        force = (
            self._term(frames, 'x', self.force[0], x, y),
            self._term(frames, 'y', self.force[1], x, y),
        )
        torque = self._term(frames, 'torque', self.torque, x, y)
        frame, offset = self.mechanism.frame(self.point[0])
        if self.turns:
            c, s = math.cos(offset), math.sin(offset)
            p = frames.parameters
            cx, sx = p(f'{self.key}.offset.x', c), p(f'{self.key}.offset.y', s)
            force = (
                add(mul(cx, force[0]), neg(mul(sx, force[1]))),
                add(mul(sx, force[0]), mul(cx, force[1])),
            )
            force = frames.world(frame, *force)
        if self.during:
            along = self._motion(frames, self.during.coordinate)
            for name, guard in self.during.guards(frames, self.mechanism, self.key, along):
                flag = frames.switch(name, guard)
                force, torque = (mul(flag, force[0]), mul(flag, force[1])), mul(flag, torque)
        found = [Load(self.key, *self.point, force, torque)]
        if self.reaction:
            opposite = neg(force[0]), neg(force[1])
            found.append(Load(f'{self.key}.reaction', *self.reaction, opposite, neg(torque)))
        return found

    def _term(self, frames: Frames, part: str, given: float | str, x: Jet, y: Jet) -> Term:
        if not isinstance(given, str):
            present = given or (part != 'torque' and any(self.force))
            return frames.parameters.reserve(f'{self.key}.{part}', given) if present else None
        frames.formulas.add(self.name)
        known = {'x': x.value, 'y': y.value, 'vx': x.rate, 'vy': y.rate}
        angles = {}
        names = formula.read(given, self.tables).names
        for name in [n for n in names if n not in known and n != 't']:
            if all(name != body.name for body in self.mechanism.bodies):
                known[name] = self._motion(frames, name.removesuffix('_rate')).rate
            elif name in self.guided:
                known[name] = self._motion(frames, name).value
            else:
                angles[name] = self._turned(frames, name)
        if 't' in names:
            known['t'] = frames.time
        count = itertools.count()

        def number(value: float) -> hy.expression:
            return frames.parameters.reserve(f'{self.key}.{part}.number.{next(count)}', value)

        def flag(guard: hy.expression) -> hy.expression:
            return frames.switch(f'{self.key}.{part}.flag.{next(count)}', guard)

        def table(curve: Curve) -> Callable[[hy.expression], hy.expression]:
            return lambda place: frames.lookup(
                f'{self.key}.{part}.table.{next(count)}', place, curve.breaks, curve.rows,
                curve.cyclic,
            )  # fmt: skip

        words = formula.Words(
            {k: dense(term) for k, term in known.items()},
            number,
            flag,
            {name: table(curve) for name, curve in self.tables.items()},
            angles,
            [name for name, curve in self.tables.items() if curve.cyclic],
        )
        return formula.expression(given, words)

    def _turned(
        self, frames: Frames, link: str
    ) -> tuple[hy.expression, Callable[[], hy.expression]]:
        """Angle of a link without whole turns [rad], and with all of them."""
        frame, offset = self.mechanism.frame(link)
        given = frames.parameters(f'links:{link}.offset', offset)
        local = dense(add(frames.angle(frame).value, given))
        return local, lambda: dense(add(frames.unwound(frame), given))

    def _motion(self, frames: Frames, link: str) -> Jet:
        """Angle without whole turns [rad], or displacement [m], of a link."""
        m = self.mechanism
        if link not in self.guided:
            return frames.angle(m.frame(link)[0])
        joint = m.joint(self.guided[link])
        if m.tree_joints.get(link) is joint:
            return frames.displacement(link)
        assert isinstance(joint, Prismatic)  # noqa: S101 - it guides
        x, y = frames.position(m.separation(joint.name), joint.name)
        ux, uy = frames.position(m.direction(joint.first, joint.axis), f'{joint.name}.way')
        return -(x * ux + y * uy)

    def power_lost(self, frames: Frames) -> Term:
        """Less what it feeds in: ``-(F.v + torque rate)``."""
        fed: Term = None
        for load in self.loads(frames):
            x, y = located(load, frames, self.mechanism)
            turn = self.mechanism.turning(frames, load.link, load.at, load.name)
            spin = mul(load.moment, turn.rate)
            fed = add(fed, mul(load.force[0], x.rate), mul(load.force[1], y.rate), spin)
        return neg(fed)

    def energy(self, _: Frames) -> Term:
        """It stores none."""
        return None


@dataclass(frozen=True)
class UnknownForce(AppliedForce):
    """A force of size one along a direction, or a torque of size one: how large it is follows."""

    @property
    def key(self) -> str:
        """With which the keys of its parameters begin."""
        return f'unknown:{self.label}'

    @property
    def label(self) -> str:
        """Its name in columns and messages."""
        return self.name.partition('.')[2]

    @property
    def unit(self) -> str:
        """Of its size."""
        return 'N' if any(self.force) else 'N m'


@dataclass(frozen=True)
class DriveEffort(AppliedForce):
    """Effort of a drive, a number or a formula, while its motion is prescribed."""

    def effort(self, frames: Frames) -> Term:
        """Its torque [N m], or the force [N] of one that slides."""
        return self.loads(frames)[0].moment
