"""Forces and torques on links: constant, by formulas, in a part of the cycle."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import heyoka as hy

from mechanism_sim.linkages.formulas import FormulaScope
from mechanism_sim.linkages.springs import SceneElement
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.frames import Frames, Jet, Parameters
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import LinkPoint
from mechanism_sim.planar.protocols import Load
from mechanism_sim.planar.virtual_work import located

_WIDE = 0.25 * math.pi  # parts of a turn that no piece of a motion steps over

_NARROW = 0.01  # parts of a turn at whose ends cosines hardly differ


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
class AppliedForce(SceneElement):
    """A force or a torque on a link, constant or by a formula, always or in a part of the cycle.

    No number of a force shapes the equations, so that another one compiles nothing. Formulas know
    the place ``x, y`` and the velocity ``vx, vy`` of the point beside what `FormulaScope` has.
    """

    scope: FormulaScope
    point: LinkPoint
    force: tuple[float | str, float | str] = (0.0, 0.0)  #: [N]
    torque: float | str = 0.0  #: [N m]
    turns: bool = False  #: whether the force is given in the link's frame
    during: CycleRange | None = None
    reaction: LinkPoint | None = None
    """Where the opposite force and torque act, if not outside of the machine."""

    @property
    def mechanism(self) -> Mechanism:
        """The tree of its links."""
        return self.scope.mechanism

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
            along = self.scope.motion(frames, self.during.coordinate)
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
        own = {'x': x.value, 'y': y.value, 'vx': x.rate, 'vy': y.rate}
        return self.scope.term(frames, f'{self.key}.{part}', given, own)

    def power_lost(self, frames: Frames) -> Term:
        """Dissipated power, negative where the force supplies it: ``-(F.v + torque rate)``."""
        fed: Term = None
        for load in self.loads(frames):
            x, y = located(load, frames, self.mechanism)
            turn = self.mechanism.turning(frames, load.link, load.at, load.name)
            spin = mul(load.moment, turn.rate)
            fed = add(fed, mul(load.force[0], x.rate), mul(load.force[1], y.rate), spin)
        return neg(fed)

    def energy(self, _: Frames) -> Term:
        """Stored energy: none."""
        return None


@dataclass(frozen=True)
class UnknownForce(AppliedForce):
    """A force of size one along a direction, or a torque of size one: how large it is follows."""

    @property
    def key(self) -> str:
        """Prefix of the keys of its parameters."""
        return f'unknown:{self.label}'

    @property
    def label(self) -> str:
        """Name in columns and messages."""
        return self.name.partition('.')[2]

    @property
    def unit(self) -> str:
        """Unit of the force's or torque's size."""
        return 'N' if any(self.force) else 'N m'


@dataclass(frozen=True)
class DriveEffort(AppliedForce):
    """Effort of a drive, a number or a formula, while its motion is prescribed."""

    def effort(self, frames: Frames) -> Term:
        """Torque of the drive [N m], or the force [N] of a sliding one."""
        return self.loads(frames)[0].moment
