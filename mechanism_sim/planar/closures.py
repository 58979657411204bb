"""Loop closures by ideal joints: components that vanish, and wrenches that they transmit."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.frames import Frames, Jet, JetPair
from mechanism_sim.planar.mechanism import HigherPair, Mechanism, Prismatic, Weld
from mechanism_sim.planar.protocols import Load, Relation, Wrench, moment_of
from mechanism_sim.planar.rails import Foot, along, rail_of

_RANK = 1e-9  # share of the largest pivot below which a row depends on those before


@dataclass(frozen=True)
class Closure:
    """A revolute joint: its points on both links coincide."""

    name: str
    mechanism: Mechanism

    def values(self, frames: Frames) -> list[Jet]:
        """Components of the vector from the second link's point to the first's [m]."""
        return list(frames.position(self.mechanism.separation(self.name), self.name))

    def facing(self, _: Frames) -> list[Term]:
        """Points coincide or they do not."""
        return []

    def wrench(self, _: Frames, forces: Sequence[Term]) -> Wrench:
        """The rows push on the first link."""
        return Wrench(neg(forces[0]), neg(forces[1]))


@dataclass(frozen=True)
class _TurnlessClosure(ABC):
    """A joint without rotation of its links on each other."""

    name: str
    mechanism: Mechanism

    @abstractmethod
    def _directions(self, frames: Frames) -> tuple[JetPair, JetPair]:
        """Directions of the second link's x axis: as the first link holds it, and as it is."""

    def facing(self, frames: Frames) -> list[Term]:
        """The cosine of their angle: half a turn has the same sine as none."""
        (ux, uy), (vx, vy) = self._directions(frames)
        return [(ux * vx + uy * vy).value]


@dataclass(frozen=True)
class PrismaticClosure(_TurnlessClosure):
    """A prismatic joint: the second link's point stays on the line, without rotation."""

    def _normal(self, frames: Frames) -> JetPair:
        """Normal of the line, 90 degrees counterclockwise from its axis."""
        if foot := self._foot(frames):
            return foot.normal
        line = self._joint.line
        return along(self.mechanism, frames, line, 0.5 * math.pi, f'{self.name}.normal')

    def _foot(self, frames: Frames) -> Foot | None:
        """Foot of the second link's point on an elastic rail; None on a rigid one."""
        j, m = self._joint, self.mechanism
        rail = rail_of(m, self.name, j.line)
        if rail is None:
            return None
        label = f'{self.name}.second'
        return rail.foot(frames, frames.position(m.point(j.second, j.on_second), label), self.name)

    @property
    def _joint(self) -> Prismatic:
        joint = self.mechanism.joint(self.name)
        if not isinstance(joint, Prismatic):
            raise TypeError(f'{self.name} is not a prismatic joint')
        return joint

    def values(self, frames: Frames) -> list[Jet]:
        """Distance from the line [m]; sine of the relative rotation, times the size [m]."""
        foot, ((ux, uy), (vx, vy)) = self._foot(frames), self._directions(frames)
        if foot:
            away = foot.away
        else:
            x, y = frames.position(self.mechanism.separation(self.name), self.name)
            nx, ny = self._normal(frames)
            away = -(nx * x + ny * y)
        turned: Jet = ux * vy - uy * vx
        return [away, turned * dense(frames.parameters(f'{self.name}.size', self.mechanism.size))]

    def _directions(self, frames: Frames) -> tuple[JetPair, JetPair]:
        joint, foot = self._joint, self._foot(frames)
        at = None if foot else joint.on_first
        first = self.mechanism.direction(joint.first, joint.angle, at)
        second = self.mechanism.direction(joint.second, 0.0, joint.on_second)
        ux, uy = frames.position(first, f'{self.name}.first.x')
        held = frames.position(second, f'{self.name}.second.x')
        if foot:
            c, s = foot.cosine, foot.sine
            ux, uy = ux * c - uy * s, uy * c + ux * s
        return (ux, uy), held

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """Force along the normal, and a moment; the rows push on the second link."""
        nx, ny = self._normal(frames)
        moment = mul(forces[1], frames.parameters(f'{self.name}.size', self.mechanism.size))
        return Wrench(mul(forces[0], nx.value), mul(forces[0], ny.value), moment)


def slid(mechanism: Mechanism, frames: Frames, guide: Prismatic) -> Jet:
    """The displacement of a guide [m]: that of the second link's point along its line."""
    carried = mechanism.tree_joints
    for link in (guide.second, guide.first):
        if carried.get(link) == guide:
            return frames.displacement(link)
    x, y = frames.position(mechanism.separation(guide.name), guide.name)
    ux, uy = frames.position(mechanism.direction(guide.first, guide.axis), f'{guide.name}.way')
    return -(x * ux + y * uy)


@dataclass(frozen=True)
class WeldClosure(_TurnlessClosure):
    """A weld: points coincide, and cross-sections there keep their angle."""

    def _directions(self, frames: Frames) -> tuple[JetPair, JetPair]:
        m, j = self.mechanism, self.mechanism.joint(self.name)
        held = m.direction(j.first, j.angle if isinstance(j, Weld) else 0.0, j.on_first)
        own = m.direction(j.second, 0.0, j.on_second)
        return (
            frames.position(held, f'{self.name}.first.x'),
            frames.position(own, f'{self.name}.second.x'),
        )

    def values(self, frames: Frames) -> list[Jet]:
        """Vector from the second's point to the first's [m]; sine of the angle, times size [m]."""
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        (ux, uy), (vx, vy) = self._directions(frames)
        size = dense(frames.parameters(f'{self.name}.size', self.mechanism.size))
        return [x, y, (ux * vy - uy * vx) * size]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """The rows push on the first link, and turn the second."""
        moment = mul(forces[2], frames.parameters(f'{self.name}.size', self.mechanism.size))
        return Wrench(neg(forces[0]), neg(forces[1]), moment)


def gathered(
    joint: HigherPair, mechanism: Mechanism, frames: Frames, loads: Sequence[Load]
) -> Wrench:
    """The wrench of a joint that loads many links: those on the second about its point."""
    own = [load for load in loads if load.link == joint.second]
    at = mechanism.point(joint.second, joint.on_second)
    ox, oy = frames.position(at, f'{joint.name}.second')
    moments = [load.moment for load in own]
    for load in (load for load in own if load.at != joint.on_second):
        x, y = frames.position(mechanism.point(load.link, load.at), load.name)
        moments.append(moment_of(((x - ox).value, (y - oy).value), load.force))
    fx, fy = (add(*(load.force[axis] for load in own)) for axis in (0, 1))
    return Wrench(fx, fy, add(*moments), tuple(x for x in loads if x.link != joint.second))


J = TypeVar('J', bound=HigherPair)


@dataclass(frozen=True)
class HigherClosure(Generic[J]):
    """Closure of a higher pair in a tree of links."""

    joint: J
    mechanism: Mechanism

    @property
    def name(self) -> str:
        """The joint's."""
        return self.joint.name

    def facing(self, _: Frames) -> list[Term]:
        """Terms for `Relation.facing`: none of most kinds, closed wherever the row vanishes."""
        return []


@dataclass(frozen=True)
class IndependentRows:
    """A closure without the rows that follow from those of others; these transmit no force."""

    relation: Relation
    kept: tuple[int, ...]

    @property
    def name(self) -> str:
        """The joint's."""
        return self.relation.name

    def values(self, frames: Frames) -> list[Jet]:
        """The rows that are kept."""
        every = self.relation.values(frames)
        return [every[i] for i in self.kept]

    def left_out(self, frames: Frames) -> list[Jet]:
        """The rows that follow: they must vanish with the others."""
        every = enumerate(self.relation.values(frames))
        return [jet for i, jet in every if i not in self.kept]

    def facing(self, frames: Frames) -> list[Term]:
        """Terms of the whole closure."""
        return self.relation.facing(frames)

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """Wrench of the forces along the rows that are kept."""
        count = len(self.relation.values(frames))
        known = dict(zip(self.kept, forces, strict=True))
        return self.relation.wrench(frames, [known.get(i) for i in range(count)])


def independent(relations: Sequence[Relation], rows: Sequence[str], J: Array) -> list[Relation]:
    """Relations without the rows that follow from the others.

    Parameters
    ----------
    rows : joint of every row
    J : (r, u) dimensionless rows at a position where their rank is that of the motion
    """
    _, triangle, order = scipy.linalg.qr(J.T, mode='economic', pivoting=True)
    sizes = np.abs(np.diagonal(triangle))
    kept = {int(i) for i in order[: int((sizes > _RANK * sizes.max(initial=0.0)).sum())]}
    found: list[Relation] = []
    for relation in relations:
        own = [i for i, row in enumerate(rows) if row == relation.name]
        of_it = tuple(k for k, i in enumerate(own) if i in kept)
        whole = len(of_it) == len(own)
        found.append(relation if whole else IndependentRows(relation, of_it))
    return found


def closures(mechanism: Mechanism, joints: Sequence[str]) -> list[Relation]:
    """The relations of joints that close loops."""
    found: list[Relation] = []
    for name in joints:
        joint = mechanism.joint(name)
        if isinstance(joint, HigherPair):
            found += [joint.closure(mechanism)] if joint.equations else []
        elif isinstance(joint, Prismatic):
            found.append(PrismaticClosure(name, mechanism))
        elif isinstance(joint, Weld):
            found.append(WeldClosure(name, mechanism))
        else:
            found.append(Closure(name, mechanism))
    return found
