"""Links and joints of a planar mechanism, and the tree that is left when loops are cut."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.planar.bodies import Arms, Body, LinkExtension
from mechanism_sim.planar.frames import Frames, Jet
from mechanism_sim.planar.points import (
    GROUND,
    LinkPoint,
    Point,
    Spread,
    Vector2,
    factors,
    rotate,
    trace,
)
from mechanism_sim.planar.protocols import ForceElement, Relation, Rubbing
from mechanism_sim.planar.view import Draft, PairView, Side, ToothLoad


class StraightLine(NamedTuple):
    """A straight line of a link."""

    link: str
    on: Vector2  #: [m] a point of the line, in the link's frame
    axis: float  #: [rad] its direction in the link's frame


@dataclass(frozen=True)
class Connection:
    """Two links connected at a point of each."""

    #: number of components of the closure if it closes a loop
    equations: ClassVar[int] = 2

    name: str
    first: str
    second: str
    on_first: Vector2  #: [m] point in the frame of `first`
    on_second: Vector2  #: [m] point in the frame of `second`

    @property
    def points(self) -> tuple[LinkPoint, LinkPoint]:
        """Links of the connection, each with its point."""
        return (self.first, self.on_first), (self.second, self.on_second)

    @property
    def links(self) -> tuple[str, ...]:
        """All links of the connection."""
        return self.first, self.second

    def across(self, link: str) -> tuple[LinkPoint, LinkPoint]:
        """Points of the connection: that of a given link, then that of the other."""
        here, there = self.points
        return (here, there) if link == self.first else (there, here)

    def on(self, link: str) -> Vector2:
        """Point of the connection on one of its links [m]."""
        return self.across(link)[0][1]

    @property
    def line(self) -> StraightLine | None:
        """The straight line along which one of the links slides."""
        return None


@dataclass(frozen=True)
class Revolute(Connection):
    """A revolute joint between two links."""


@dataclass(frozen=True)
class Prismatic(Connection):
    """A prismatic joint: a point of `second` slides on a line of `first`, without rotation.

    The displacement is zero at the point on `first`.
    """

    axis: float = 0.0  #: [rad] direction of the line in the frame of `first`
    angle: float = 0.0  #: [rad] of the frame of `second` in that of `first`

    @property
    def line(self) -> StraightLine:
        """Line of the joint on `first`."""
        return StraightLine(self.first, self.on_first, self.axis)


@dataclass(frozen=True)
class Weld(Connection):
    """A weld: points of two links coincide, without relative rotation."""

    equations: ClassVar[int] = 3

    angle: float = 0.0  #: [rad] of the frame of `second` in that of `first`

    def draw(self, draft: Draft) -> None:
        """Extend the outlines of both links to the joint."""
        for place in self.points:
            draft.reach(place)


@dataclass(frozen=True)
class HigherPair(Connection, ABC):
    """A joint that takes one degree of freedom: links touch at a point or along a line.

    No tree has it. Every kind is a subclass in the room of its own domain.
    """

    equations: ClassVar[int] = 1
    #: sides of its closure with walls, at which it can open
    sides: ClassVar[tuple[Side, ...]] = ('left', 'right')
    #: description of the motion between them
    parts: ClassVar[str] = 'pin between the walls of a slot'

    @property
    def angular_clearance(self) -> bool:
        """True if its clearance is an angle [rad]."""
        return False

    @property
    def bearings(self) -> tuple[str, ...]:
        """Lower pairs on which the row depends: they belong in the tree.

        If such a joint is cut, its force is not that of its own rows alone.
        """
        return ()

    @property
    def without_forces(self) -> str:
        """Reason why the motion needs infinite forces, as a sentence; empty if it does not."""
        return ''

    @property
    def coupling(self) -> Coupling | None:
        """Constant sum over its links, for other simulators; None if there is none."""
        return None

    @property
    def alike(self) -> tuple[str, ...]:
        """Links whose constraint does not depend on their angle, such as wheels."""
        return ()

    @property
    def pitches(self) -> Mapping[str, float]:
        """Periods of the displacements of its links [m]."""
        return {}

    @property
    def elastic(self) -> bool:
        """True if force `elements` replace its closure and walls."""
        return False

    @property
    def preloaded(self) -> bool:
        """True if it is elastic without slack or clearance, and so has a stiffness at rest."""
        return False

    @property
    def slips(self) -> bool:
        """True if friction alone transmits its force."""
        return False

    @property
    def extent(self) -> float:
        """Greatest distance of a contact from a joint of its links [m]."""
        return 0.0

    @abstractmethod
    def closure(self, mechanism: Mechanism) -> PairClosure:
        """The relation of the closed pair."""

    def bears(self, link: str) -> bool:
        """True if one of its links may be elastic: its points and cross-sections then count."""
        return False

    def touch(self, mechanism: Mechanism, radius: float = 0.0) -> Rubbing:
        """Sliding contact of the pair, with a pin of a radius [m]; TypeError without friction."""
        raise TypeError(f'{self.name} has no friction')

    @property
    def rubbing_wall(self) -> type | None:
        """Special class of walls with friction, see `planar.gaps`; None: the usual one."""
        return None

    def elements(self, _: Mechanism) -> Sequence[ForceElement]:
        """The forces of an elastic pair."""
        return ()

    #: the node that publishes its readings; none if empty
    node: ClassVar[str] = ''
    #: the named tuple of its readings, each field annotated by `Told`
    reads: ClassVar[type | None] = None
    #: fields of the readings without a value in this kind
    untold: ClassVar[tuple[str, ...]] = ()
    #: fields shown in charts, by the chart's title
    charts: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})

    def reading(self, view: PairView) -> Any:
        """Readings of a pair with a node: named (N,) arrays, the fields of a message."""
        raise NotImplementedError(f'{self.name} has no readings')

    def slides(self, link: str, mechanism: Mechanism) -> bool:
        """True if readings of one of its links are displacements, not angles."""
        return link in mechanism.sliding

    @property
    def toothed(self) -> tuple[str, ...]:
        """The links on whose shafts `tooth_loads` acts, in their order."""
        return ()

    def tooth_loads(self, view: PairView) -> Sequence[ToothLoad]:
        """Forces of its teeth on shafts, where forces are known."""
        return ()

    def draw(self, draft: Draft) -> None:
        """Add the shapes of the pair to a drawing."""

    def covered(self) -> Sequence[LinkPoint]:
        """Further points that a picture must contain."""
        return ()

    def discs(self) -> Sequence[tuple[LinkPoint, float]]:
        """Discs of the pair: centre, and radius [m]."""
        return ()

    def bars(self) -> Sequence[Bar]:
        """Straight bars of the pair."""
        return ()


class Coupling(NamedTuple):
    """Constant weighted sum of the coordinates of two links."""

    joint: HigherPair  #: name of the pair
    carrier: str  #: link from which angles are counted
    #: factors of the angles [rad] of first and second, or of a rack's displacement [m]
    factors: tuple[float, float]
    #: guides of the racks among them
    racks: tuple[Prismatic | None, Prismatic | None] = (None, None)
    exact: bool = True  #: True if the sum is constant, not only on the mean


class Bar(NamedTuple):
    """A straight bar on a link."""

    end: LinkPoint  #: middle of one of its long sides
    length: float  #: [m]
    axis: float  #: [rad] direction of the bar in the link's frame
    back: float  #: [rad] direction from that side across the bar


class PairClosure(Relation, Protocol):
    """The closure of a higher pair: one row, its offset [m] from the closed position."""

    @property
    def joint(self) -> HigherPair:
        """The pair."""

    @property
    def mechanism(self) -> Mechanism:
        """Mechanism to which the closure belongs."""


Joint: TypeAlias = Revolute | Prismatic | Weld | HigherPair


Extension = TypeVar('Extension', bound=LinkExtension)


@dataclass(frozen=True)
class Tree:
    """Links, joints, which joints are cut so that the rest is a tree, and its coordinates.

    Coordinates are named after their links, in the order of `bodies`: the absolute angle [rad] of
    a link, or the displacement [m] of a link that a prismatic joint of the tree carries; a link
    that a weld carries has none. A link
    that no uncut joint ties to the ground, not even by way of others, floats: its angle is
    followed, after those of all links, by two displacements of its centre of gravity. Last come
    the coordinates of links' extensions.
    """

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    cut: tuple[str, ...]
    gravity: Vector2 = (0.0, 0.0)  #: [m/s^2]
    axial_gravity: float = 0.0  #: [m/s^2] along the axes, towards the reader

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """Names: of the links, then ``LINK.x`` and ``LINK.y`` of the floating ones.

        Then those of the elastic ones as ``LINK.bend1``.
        """
        placed = (f'{link}.{axis}' for link in self.floating for axis in 'xy')
        own = (body.name for body in self.bodies if body.name not in self.welded)
        return (*own, *placed, *self.deformations)

    @cached_property
    def extensions(self) -> dict[str, LinkExtension]:
        """Extensions of links with coordinates of their own, by link."""
        return {body.name: body.extension for body in self.bodies if body.extension}

    def having(self, kind: type[Extension]) -> dict[str, Extension]:
        """Extensions of one kind, by link."""
        return {link: x for link, x in self.extensions.items() if isinstance(x, kind)}

    @cached_property
    def deformations(self) -> tuple[str, ...]:
        """The coordinates of extensions."""
        return tuple(f'{link}.{name}' for link, x in self.extensions.items() for name in x.names)

    def amplitudes(self, link: str) -> list[int]:
        """Numbers of the coordinates of a link's extension."""
        names = self.extensions[link].names if link in self.extensions else ()
        return [self.coordinates.index(f'{link}.{name}') for name in names]

    @cached_property
    def displacements(self) -> tuple[str, ...]:
        """The coordinates that are displacements."""
        turning = [b.name for b in self.bodies if b.name not in self.sliding]
        turning += [f'{link}.{c}' for link, x in self.extensions.items() for c in x.angles]
        return tuple(c for c in self.coordinates if c not in turning)

    @cached_property
    def sliding(self) -> tuple[str, ...]:
        """The links that a prismatic joint of the tree carries."""
        return tuple(link for link, j in self.tree_joints.items() if isinstance(j, Prismatic))

    @cached_property
    def welded(self) -> tuple[str, ...]:
        """The links that a weld of the tree carries."""
        return tuple(link for link, j in self.tree_joints.items() if isinstance(j, Weld))

    def joint(self, name: str) -> Joint:
        """The joint of that name."""
        return next(j for j in self.joints if j.name == name)

    def body(self, name: str) -> Body:
        """The link of that name."""
        return next(b for b in self.bodies if b.name == name)

    @property
    def size(self) -> float:
        """The longest distance of a link [m], see `longest`; 1 m if all points coincide."""
        return self.longest or 1.0

    @cached_property
    def lifting_energy(self) -> float:
        """Weight of all links times the reach [J], a scale of rounding for any zero of height."""
        return sum(b.mass for b in self.bodies) * math.hypot(*self.gravity) * self.reach

    @property
    def lifting_power(self) -> float:
        """Lifting energy over the time of a fall by the reach [W], of which rest is a rounding."""
        energy = self.lifting_energy
        return energy and energy * math.sqrt(math.hypot(*self.gravity) / self.reach)

    @cached_property
    def total_mass(self) -> float:
        """Mass of all links [kg], with their moments of inertia at the distance of the size."""
        return sum(b.mass + b.inertia / self.size**2 for b in self.bodies)

    @cached_property
    def longest(self) -> float:
        """Longest distance between two points of one link, or extent of a higher pair [m].

        The points are its joints, its origin and its centre of gravity; a higher pair may reach
        farther, and so may a link's extension. 0 if all coincide.
        """
        ends: dict[str, list[Vector2]] = {b.name: [(0.0, 0.0), b.cog] for b in self.bodies}
        for link, at in (point for j in self.joints for point in j.points):
            ends.setdefault(link, []).append(at)
        longest = max(
            math.hypot(a[0] - b[0], a[1] - b[1])
            for points in ends.values()
            for a in points
            for b in points
        )
        extents = (j.extent for j in self.joints if isinstance(j, HigherPair))
        own = (body.extension.extent(body) for body in self.bodies if body.extension)
        return max(longest, *extents, *own, 0.0)

    @cached_property
    def reach(self) -> float:
        """Scale of the rounding of positions [m]: the size, or the distance from the origin."""
        points = (point for j in self.joints for point in j.points)
        away = (math.hypot(*at) for link, at in points if link == GROUND)
        return max(self.size, *away, 0.0)

    @cached_property
    def _tree(self) -> tuple[dict[str, Joint], tuple[str, ...]]:
        """The joint that carries each link, in an order from the ground outwards; and floaters."""
        carried: dict[str, Joint] = {}
        floating: list[str] = []
        left = [body.name for body in self.bodies]
        usable = [
            j for j in self.joints if j.name not in self.cut and not isinstance(j, HigherPair)
        ]
        while left:
            reached = {GROUND, *carried, *floating}
            for link, j in ((link, j) for link in left for j in usable):
                ends = (j.first, j.second)
                if link in ends and reached & {*ends}:
                    carried[link] = j
                    break
            else:
                link = left[0]
                floating.append(link)
            left.remove(link)
        return carried, tuple(floating)

    @property
    def tree_joints(self) -> dict[str, Joint]:
        """The joint that carries each link but the floating ones, from the ground outwards."""
        return self._tree[0]

    @property
    def floating(self) -> tuple[str, ...]:
        """Floating links, carried by no joint."""
        return self._tree[1]

    def parent(self, link: str) -> str:
        """The link that carries `link` in the tree."""
        return self.tree_joints[link].across(link)[1][0]

    def frame(self, link: str) -> tuple[str, float]:
        """Angle, or ground, that a link rotates with, and the link's offset from it [rad]."""
        if link == GROUND:
            return GROUND, 0.0
        j = self.tree_joints.get(link)
        if not isinstance(j, Prismatic | Weld):
            return link, 0.0
        frame, offset = self.frame(self.parent(link))
        return frame, offset + (j.angle if j.second == link else -j.angle)


@dataclass(frozen=True)
class Mechanism(Tree):
    """A tree of links, with the positions of their points by coordinates."""

    def turn(self, link: str, v: Vector2) -> Vector2:
        """A vector of a link's frame in the frame with which the link turns."""
        return rotate(v, self.frame(link)[1])

    def direction(self, link: str, angle: float, at: Vector2 | None = None) -> Point:
        """The unit vector at an angle [rad] in a link's frame, as a sum over arms.

        With the point `at` it turns with the cross-section there, to the second order in the
        coordinates of an extension, as points do.
        """
        frame, offset = self.frame(link)
        found: Point = {(frame, None): rotate((1.0, 0.0), angle + offset)}
        if at is None or link not in self.extensions:
            return found
        turned = self.extensions[link].turned(at, rotate((1.0, 0.0), angle))
        return _plus(found, self._arms(link, turned))

    def turning(self, frames: Frames, link: str, at: Vector2, label: str) -> Jet:
        """The angle of a link's cross-section at a point [rad], less the offset of `frame`.

        Parameters
        ----------
        label : name of the parameters
        """
        return frames.angle(self.frame(link)[0]) + self.bent(frames, link, at, label)

    def bent(self, frames: Frames, link: str, at: Vector2, label: str) -> Jet:
        """Rotation of the cross-section at a point of a link in the link's frame [rad]."""
        return frames.turn(self._slopes(link, at), label)

    def _slopes(self, link: str, at: Vector2) -> dict[str, float]:
        """Rotation of a cross-section per coordinate of its link's extension [rad/m]."""
        own = self.extensions.get(link)
        return {f'{link}.{name}': x for name, x in own.slopes(at).items()} if own else {}

    def point(self, link: str, at: Vector2 = (0.0, 0.0), deformed: bool = True) -> Point:
        """The point `at` (in the link's frame, [m]) as a sum over arms.

        On an elastic link it moves with the deformation, or with the frame if not `deformed`.
        """
        if link == GROUND:
            return {(GROUND, None): at}
        frame, offset = self.frame(link)
        if link in self.floating:
            cog = self.body(link).cog
            slides: Point = {
                (GROUND, f'{link}.x'): (1.0, 0.0),
                (GROUND, f'{link}.y'): (0.0, 1.0),
            }
            placed = _plus(slides, {(frame, None): (at[0] - cog[0], at[1] - cog[1])})
            return _plus(placed, self._deformed(link, at)) if deformed else placed
        j = self.tree_joints[link]
        (_, here), (parent, there) = j.across(link)
        result = self.point(parent, there)
        if isinstance(j, Prismatic):
            way = rotate((1.0, 0.0), self.frame(j.first)[1] + j.axis)
            if j.first == link:  # the line, not the point on it, is carried
                way = (-way[0], -way[1])
            result = _plus(result, {(frame, link): way})
        moved = _minus(self._deformed(link, here))
        if deformed:
            moved = _plus(self._deformed(link, at), moved)
        if deformed and link in self.extensions:
            moved = _plus(moved, self.extensions[link].moved(link))
        rigid: Point = {(frame, None): rotate((at[0] - here[0], at[1] - here[1]), offset)}
        return _plus(_plus(result, rigid), moved)

    def _deformed(self, link: str, at: Vector2) -> Point:
        """Displacement of a point of a link in its frame by the link's deformation."""
        own = self.extensions.get(link)
        return self._arms(link, own.arms(at)) if own else {}

    def _arms(self, link: str, arms: Arms) -> Point:
        """Vectors of a link's frame by products of its elastic coordinates, as a sum over arms."""
        return {
            (link, names[0] if len(names) == 1 else names): d
            for own, d in arms.items()
            for names in [tuple(f'{link}.{name}' for name in own)]
        }

    def particles(self, link: str) -> list[tuple[float, Point]]:
        """Masses [kg] of a link and their points, whose motion is that of all of it.

        A rigid link has one, at its centre of gravity, beside its moment of inertia.
        """
        body = self.body(link)
        if body.extension is None:
            return [(body.mass, self.point(link, body.cog))]

        def place(at: Vector2, height: float = 0.0) -> Point:
            return _plus(self.point(link, at), self.lean(link, height))

        return [*body.extension.masses(body, place)]

    def lean(self, link: str, height: float = 0.0) -> Point:
        """Displacement in the plane of a point above a link's plane [m] by the link's tilt."""
        own = self.extensions.get(link)
        return self._arms(link, own.lean(height)) if own and height else {}

    def rise(self, link: str, at: Vector2) -> dict[str, float]:
        """Displacement along the axes of a point of a link's plane, per coordinate."""
        own = self.extensions.get(link)
        return {f'{link}.{name}': x for name, x in own.rise(at).items()} if own else {}

    def spread(self, link: str) -> tuple[Any, Spread]:
        """All masses (K,) of a link in one array, and the arms of all points: (2, K) each.

        For a link with one particle, numbers instead.
        """
        found = self.particles(link)
        if len(found) == 1:
            return found[0]
        arms = dict.fromkeys(arm for _, point in found for arm in point)
        none = (0.0, 0.0)
        return np.array([mass for mass, _ in found]), {
            arm: np.array([point.get(arm, none) for _, point in found]).T for arm in arms
        }

    def centre(self, link: str) -> Point:
        """The centre of gravity of a link."""
        body = self.body(link)
        if not (body.extension and body.extension.scattered):
            return self.point(link, body.cog)
        found: Point = {}
        for mass, point in self.particles(link):
            share = mass / body.mass
            found = _plus(found, {arm: (share * x, share * y) for arm, (x, y) in point.items()})
        return found

    def turns(self, link: str, at: Vector2) -> dict[str, float]:
        """Rotation of a link at a point per coordinate: 1, or [rad/m]."""
        frame = self.frame(link)[0]
        found = {} if frame == GROUND else {frame: 1.0}
        return found | self._slopes(link, at)

    def locate(self, link: str, q: Mapping[str, float], at: Vector2 = (0.0, 0.0)) -> Vector2:
        """World coordinates [m] of a point of a link; the default is its origin."""
        x = y = 0.0
        for (frame, slide), d in self.point(link, at).items():
            dx, dy = rotate(d, 0.0 if frame == GROUND else q[frame])
            s = math.prod(q[c] for c in factors(slide))
            x += s * dx
            y += s * dy
        return x, y

    def locate_all(
        self, link: str, q: NDArray[np.float64], at: Vector2 = (0.0, 0.0)
    ) -> NDArray[np.float64]:
        """World coordinates (2, N) [m] at N instants, with coordinates (n, N) in their order."""
        place: NDArray[np.float64] = self.trace((link, at), q)[0]
        return place

    def trace(self, place: LinkPoint | Point, *motion: NDArray[np.float64]) -> NDArray[np.float64]:
        """A point of a link, or a sum over arms, at N instants: (k, 2, N) [m, s].

        Parameters
        ----------
        motion : coordinates (n, N) in their order, then their rates and accelerations; as many
            of these come out, see `mechanism_sim.planar.points.trace`
        """
        point = place if isinstance(place, dict) else self.point(*place)
        index = {c: i for i, c in enumerate(self.coordinates)}

        def trajectory(name: str) -> list[NDArray[np.float64]]:
            return [u[index[name]] for u in motion]

        return trace(point, trajectory, motion[0].shape[1], len(motion))

    def angle_all(self, link: str, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angle (N,) [rad] of a link's frame in the world at N instants."""
        frame, offset = self.frame(link)
        if frame == GROUND:
            return np.full(q.shape[1], offset)
        return np.asarray(offset + q[self.coordinates.index(frame)])

    def angle(self, link: str, q: Mapping[str, float]) -> float:
        """Angle [rad] of a link's frame in the world."""
        frame, offset = self.frame(link)
        return offset + (0.0 if frame == GROUND else q[frame])

    def separation(
        self,
        joint: str,
        pin: Vector2 = (0.0, 0.0),
        bushing: Vector2 = (0.0, 0.0),
        height: float = 0.0,
    ) -> Point:
        """Point of the first link minus point of the second link at a cut joint.

        Parameters
        ----------
        pin, bushing : offsets of both from the joint's points, in the links' frames [m]
        height : height above the plane of the links [m]
        """
        j = self.joint(joint)
        first = _plus(self.point(j.first, j.on_first), self.offset(j.first, pin, height))
        second = _plus(self.point(j.second, j.on_second), self.offset(j.second, bushing, height))
        return _plus(first, _minus(second))

    def inclination(self, joint: str, pin: Vector2, bushing: Vector2) -> Point:
        """Inclination of the first link's axis at a joint against the second's [rad].

        Parameters
        ----------
        pin, bushing : inclinations by manufacture, in the links' frames
        """
        j = self.joint(joint)
        return _plus(self.offset(j.first, pin, 1.0), _minus(self.offset(j.second, bushing, 1.0)))

    def offset(self, link: str, off: Vector2, height: float) -> Point:
        """Vector of a link's frame [m], with the displacement of a height above by the tilt."""
        fixed: Point = {(self.frame(link)[0], None): self.turn(link, off)}
        return _plus(fixed, self.lean(link, height))


def closing_joints(
    links: Sequence[str], joints: Sequence[Joint], loose: Sequence[str], driven: Sequence[str] = ()
) -> tuple[str, ...]:
    """The joints to cut so that the rest is a tree: of every loop one, and all that are loose.

    Displacements are coordinates of the tree: so a slider-crank has three coordinates and two
    closures instead of six and six.

    Links are reached breadth first from the ground. Welds come first, which cost no coordinate,
    and one prismatic joint of each `driven` link, which may stand first in it, since a drive needs
    its coordinate, and the bearings of higher pairs; then revolute joints and guides fixed to the
    ground; guides on moving links last, because their displacements cost more.
    """
    usable = [j for j in joints if j.name not in loose and not isinstance(j, HigherPair)]
    kept: list[str] = []
    group = {link: link for link in (GROUND, *links)}

    def join(j: Joint) -> bool:
        a, b = group[j.first], group[j.second]
        if a == b:
            return False
        group.update({link: a for link, g in group.items() if g == b})
        kept.append(j.name)
        return True

    guides = [j for j in usable if isinstance(j, Prismatic)]
    carrying = [j for j in guides if j.second in driven]
    carried = {j.second for j in carrying}
    first = {j.first: j for j in sorted(guides, key=lambda j: j.second == GROUND)}
    bearings = {n for j in joints if isinstance(j, HigherPair) for n in j.bearings}
    for j in (
        *(j for j in usable if isinstance(j, Weld) or j in carrying),
        *(j for link, j in first.items() if link in driven and link not in carried),
        *(j for j in usable if j.name in bearings),
    ):
        if j.name not in kept:
            join(j)
    for movable in (False, True):
        reached, grown = {GROUND}, True
        while grown:
            grown = False
            level = set(reached)
            for j in usable:
                ends = {j.first, j.second}
                moving = isinstance(j, Prismatic) and GROUND not in ends
                if j.name in kept:
                    if ends & level and not ends <= reached:
                        reached |= ends
                        grown = True
                elif ends & level and (movable or not moving) and join(j):
                    reached |= ends
                    grown = True
    for j in usable:  # what floats apart from the ground
        join(j)
    return tuple(j.name for j in joints if j.name not in kept)


def bending_guides(bodies: Sequence[Body], joints: Sequence[Joint]) -> list[str]:
    """Guides and welds at cross-sections of bending links, which cannot be in the tree."""
    bent = {b.name for b in bodies if b.extension and b.extension.bends}
    usable = [j for j in joints if isinstance(j, Prismatic | Weld)]
    return [j.name for j in usable if bent & {j.first, j.second}]


def _minus(a: Point) -> Point:
    return {arm: (-x, -y) for arm, (x, y) in a.items()}


def _plus(a: Point, b: Point) -> Point:
    """The sum of two points as vectors, without arms of no length."""
    result = dict(a)
    for arm, (x, y) in b.items():
        ax, ay = result.get(arm, (0.0, 0.0))
        result[arm] = (ax + x, ay + y)
    return {arm: xy for arm, xy in result.items() if xy != (0.0, 0.0)}
