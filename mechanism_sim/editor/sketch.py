"""A scene to which parts are drawn: poses of its links, and parts that tools find and make.

Tools make edits of the scene's keys, as the panel does, so that undo, checks and the
text of the file do not depend on tools; the first edit is that of the selected part.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from mechanism_sim.editor.rounding import degrees, place, rounded
from mechanism_sim.errors import InputError
from mechanism_sim.planar.points import GROUND, Vector2, rotate
from mechanism_sim.scene.schema import DrivePart, Scene

GONE: Final = object()
"""Instead of a value: the key is removed."""

BAR = 1.0
"""[kg/m] of links that are given a mass by their length."""

PLAY: Final = {'radial': '0.1 mm', 'restitution': 0.5}
"""A clearance that is drawn."""


class Edit(NamedTuple):
    """A value at a path of a scene, or `GONE`."""

    path: tuple[str, ...]
    value: Any


class Pose(NamedTuple):
    """Pose of the frame of a link in the world."""

    x: float  #: [m]
    y: float  #: [m]
    angle: float  #: [rad]

    def place(self, at: Vector2) -> Vector2:
        """A point of the link in the world [m]."""
        x, y = rotate(at, self.angle)
        return self.x + x, self.y + y

    def within(self, at: Vector2) -> Vector2:
        """A point of the world in the frame of the link [m]."""
        return rotate((at[0] - self.x, at[1] - self.y), -self.angle)


Poses = dict[str, Pose]
ORIGIN = Pose(0.0, 0.0, 0.0)


def points_of(link: Any) -> dict[str, Vector2]:
    """The points of a link by name, in its frame [m]."""
    found: dict[str, Vector2] = {'start': (0.0, 0.0)}
    if link is not None and link.length is not None:
        found['end'] = (link.length, 0.0)
    return found | (dict(link.points) if link is not None else {})


def point(scene: Scene, reference: str) -> tuple[str, str, Vector2] | None:
    """Link, name and position in the link's frame [m] of ``LINK.POINT`` or ``LINK``."""
    link, _, name = reference.partition('.')
    name = name or 'start'
    at = points_of(scene.links.get(link)).get(name)
    known = link == GROUND or link in scene.links
    return None if at is None or not known else (link, name, at)


def drives_of(scene: Scene) -> dict[str, tuple[tuple[str, ...], DrivePart]]:
    """Paths and keys of the drives of a scene, by the coordinates that they drive."""
    found: dict[str, tuple[tuple[str, ...], DrivePart]] = {
        c: (('drives', c), drive) for c, drive in scene.drives.items()
    }
    if scene.drive:
        found[scene.drive.coordinate or 'crank'] = ('drive',), scene.drive
    return found


@dataclass(frozen=True)
class Handle:
    """Handle for dragging: a joint, or a point without one."""

    key: str  #: name of the joint, or LINK.POINT
    members: tuple[tuple[str, str], ...]  #: connected links, each with the name of its point
    at: Vector2  #: position in the world [m]
    joint: bool  #: True for a joint, False for a free point

    @property
    def path(self) -> list[str]:
        """Keys of the joint in the scene, or of the link of a point without a joint."""
        return ['joints', self.key] if self.joint else ['links', self.members[0][0]]

    def to_json(self) -> dict[str, Any]:
        """Handle for the page."""
        return {
            'key': self.key,
            'members': ['.'.join(x) for x in self.members],
            'at': self.at,
            'joint': self.joint,
            'ground': any(link == GROUND for link, _ in self.members),
            'path': self.path,
        }


class Grid(NamedTuple):
    """Grid of the drawing: its step [m], and the unit in which lengths are written."""

    step: float
    unit: str

    def snapped(self, at: Vector2) -> Vector2:
        """The nearest point of the grid."""
        x, y = (round(v / self.step) * self.step for v in at)
        return x, y


class Spot(NamedTuple):
    """Start or end of a gesture: its position in the world, and the part under it."""

    at: Vector2
    handle: Handle | None = None
    link: str = ''  #: link under the pointer, if there is no handle

    @property
    def moving(self) -> str:
        """Name of the moving link at the position; else empty."""
        members = self.handle.members if self.handle else ()
        links = [self.link] if self.link else [link for link, _ in members]
        return next((link for link in links if link != GROUND), '')


class Shaft(NamedTuple):
    """A rotating link, found or made."""

    link: str
    at: Vector2  #: position of the axis in the world [m]
    on: str  #: carrying link
    own: str  #: LINK.POINT of the axis on the link itself
    base: str  #: LINK.POINT of the axis on its carrier
    edits: list[Edit]


class Way(NamedTuple):
    """A link that slides on the ground."""

    link: str
    own: str  #: LINK.POINT on the sliding link
    at: Vector2  #: position of this point in the world [m]
    axis: float  #: direction of the guide in the world [rad]
    joint: str  #: name of the guide
    along: float  #: displacement along the guide [m]


class Sketch:
    """A scene to which parts are added."""

    def __init__(self, scene: Scene, poses: Mapping[str, Pose], grid: Grid) -> None:
        self.scene, self.poses, self.grid = scene, dict(poses), grid
        sections = 'links', 'joints', 'springs', 'loads', 'sensors', 'gears'
        self._taken = {name for key in sections for name in getattr(scene, key, {})}
        self._points: dict[str, set[str]] = {}
        masses = [x.mass for name, x in scene.links.items() if name != GROUND]
        self._weighed = bool(masses) and None not in masses

    def name(self, stem: str, plain: bool = False) -> str:
        """A free name: the stem, or the stem with the lowest free number."""
        k = 0 if plain else 1
        while (found := f'{stem}_{k}' if k else stem) in self._taken:
            k += 1
        self._taken.add(found)
        return found

    def long(self, length: float) -> str:
        """Text of a length [m], rounded to the grid."""
        return rounded(length, self.grid.step, self.grid.unit)

    def size(self, length: float) -> str:
        """Text of a length [m] with two significant digits."""
        return rounded(length, 10.0 ** (math.floor(math.log10(length)) - 1), self.grid.unit)

    def where(self, spot: Spot) -> Vector2:
        """Position of a spot: that of its handle, or the nearest point of the grid."""
        return spot.handle.at if spot.handle else self.grid.snapped(spot.at)

    def ends(self, start: Spot, end: Spot, what: str) -> tuple[Vector2, Vector2, float]:
        """Start and end of a gesture, and the distance between them [m]."""
        a, b = self.where(start), self.where(end)
        if math.dist(a, b) < self.grid.step:
            raise InputError(f'a {what} is drawn from one point to another: press, and drag')
        return a, b, math.dist(a, b)

    # --- links and their points -------------------------------------------------------------

    def link(self, name: str, length: float | None = None) -> Edit:
        """A new link: as heavy as a bar if all others have masses."""
        values = {} if length is None else {'length': self.long(length)}
        more = self.heavy(length or 0.0) if self._weighed else {}
        return Edit(('links', name), {**values, **more})

    def heavy(self, length: float) -> dict[str, str]:
        """Mass properties of a slender bar of 1 kg/m; 1 kg if it has no length [m]."""
        mass = BAR * length if length else 1.0
        values = {'mass': f'{mass:.3g} kg'}
        values['inertia'] = f'{mass * length**2 / 12.0 or 0.001:.3g} kg m^2'
        if length:
            values['cog'] = rounded(0.5 * length, 0.1 * self.grid.step, self.grid.unit)
        return values

    def masses(self) -> list[Edit]:
        """Edits that give masses to all links that have none, as forces need them."""
        return [
            Edit(('links', link, key), value)
            for link, given in self.scene.links.items()
            if link != GROUND and given.mass is None and not given.elastic
            for key, value in self.heavy(given.length or 0.0).items()
        ]

    def reference(self, spot: Spot) -> tuple[str, list[Edit]]:
        """LINK.POINT at a spot on a link or on the ground, and the edits if it is new."""
        if spot.handle:
            return referred(*spot.handle.members[-1]), []
        return self.point(spot.link or GROUND, self.where(spot))

    def point(self, link: str, at: Vector2) -> tuple[str, list[Edit]]:
        """LINK.POINT of a new point of a link, at a world position [m], and its edits."""
        known = points_of(self.scene.links.get(link)).keys() | self._points.setdefault(link, set())
        k = 1
        while (name := f'p{k}') in known:
            k += 1
        self._points[link].add(name)
        local = place(self.poses[link].within(at), self.grid.step, self.grid.unit)
        return f'{link}.{name}', [Edit(('links', link, 'points', name), local)]

    def on_link(self, spot: Spot, what: str) -> tuple[str, list[Edit]]:
        """LINK.POINT at a spot on a moving link, and the edits if it is new."""
        if spot.handle:
            for link, name in reversed(spot.handle.members):
                if link != GROUND:
                    return referred(link, name), []
        if spot.handle or not spot.link:
            raise InputError(f'{what} on a link: press on one of its points, or on the link')
        if way := self.sliding(spot):  # a block is small
            return way.own, []
        return self.reference(spot)

    def joint(self, reference: str, link: str) -> list[Edit]:
        """A pin between a point and the link drawn to it."""
        return [Edit(self.named(reference, link), {'revolute': [reference, link]})]

    def named(self, one: str, two: str) -> tuple[str, str]:
        """The path of a joint between points of two links."""
        stem = f'{one.partition(".")[0]}_{two.partition(".")[0]}'
        return 'joints', self.name(stem, plain=True)

    # --- supports of links ------------------------------------------------------------------

    def turning(self, spot: Spot, stem: str) -> Shaft:
        """The link that rotates about a spot, or a rotating link at it; else a new one.

        Parameters
        ----------
        stem : stem of the name of a new link, with its pivot on the ground or on the link
            of this point
        """
        handle = spot.handle
        found = []
        if (handle and handle.joint) or spot.link:
            joints = (handle.key,) if handle else self.scene.joints
            found = self._pivots(joints, spot.link)
        if found:
            return found[0]
        base, edits = self.reference(spot)
        return self._shaft(stem, base, self.where(spot), edits)

    def shafts(self, start: Spot, end: Spot, stem: str, what: str) -> tuple[Shaft, Shaft]:
        """Two rotating links, found or made as by `turning`.

        If one carries the other, it is replaced by a new link about its own axis, which is held
        at rest if the machine has a drive.
        """
        one, two = (self.turning(spot, stem) for spot in (start, end))
        if two.on == one.link:
            one = self._coaxial(stem, one)
        elif one.on == two.link:
            two = self._coaxial(stem, two)
        if one.link == two.link or math.dist(one.at, two.at) < 1e-9:
            raise InputError(
                f'{what} is drawn from one link that turns to another: press on the first or '
                'where its pivot is to be, and drag'
            )
        return one, two

    def _coaxial(self, stem: str, shaft: Shaft) -> Shaft:
        made = self._shaft(stem, shaft.base, shaft.at, [])
        if self.scene.drive or self.scene.drives:
            made.edits.append(Edit(('drives', made.link), {'speed': '0 rpm'}))
        return made

    def _shaft(self, stem: str, base: str, at: Vector2, edits: list[Edit]) -> Shaft:
        link = self.name(stem)
        made = [self.link(link), *edits, *self.joint(base, link)]
        return Shaft(link, at, base.partition('.')[0], link, base, made)

    def pivot(self, link: str) -> Shaft | None:
        """Pivot of a link on the ground; None if it has none."""
        return next((x for x in self._pivots(self.scene.joints, link) if x.on == GROUND), None)

    def _pivots(self, joints: Iterable[str], link: str = '') -> list[Shaft]:
        """Pivots of links on others by some joints, those on the ground first."""
        found = []
        for name in joints:
            joint = self.scene.joints[name]
            ends = [point(self.scene, reference) for reference in joint.points]
            if joint.kind != 'revolute' or None in ends:
                continue
            pairs = [ends, ends[::-1]] if ends[1] and ends[1][0] == GROUND else [ends]
            if link:
                pairs = [x for x in (ends, ends[::-1]) if x[1] and x[1][0] == link]
            for one, two in pairs[-1:]:
                if one is None or two is None:
                    continue
                at = self.poses[one[0]].place(one[2])
                found.append(Shaft(two[0], at, one[0], referred(*two[:2]), referred(*one[:2]), []))
        return sorted(found, key=lambda x: x.on != GROUND)

    def sliding(self, spot: Spot) -> Way | None:
        """The link at a spot, if it slides on the ground."""
        links = [x for x, _ in spot.handle.members] if spot.handle else [spot.link]
        for name, joint in self.scene.joints.items():
            one, two = (point(self.scene, reference) for reference in joint.points)
            if joint.kind == 'prismatic' and one and two and one[0] == GROUND and two[0] in links:
                own, at = referred(*two[:2]), self.poses[two[0]].place(two[2])
                along = rotate((at[0] - one[2][0], at[1] - one[2][1]), -joint.axis)[0]
                return Way(two[0], own, at, joint.axis, name, along)
        return None

    def slider(self, stem: str, base: Vector2, axis: float) -> tuple[str, float, list[Edit]]:
        """A new link that slides on the ground along a line [m, rad].

        Returns
        -------
        its name, its displacement along the line [m] at `base`, and the edits that make its guide
        but not the link and its pose
        """
        name, way = self.name(stem), rotate((1.0, 0.0), axis)
        # the line passes through the origin if that lies on it
        if abs(way[0] * base[1] - way[1] * base[0]) < 0.5 * self.grid.step:
            return name, base[0] * way[0] + base[1] * way[1], self.guide(GROUND, name, axis)
        reference, edits = self.point(GROUND, base)
        return name, 0.0, [*edits, *self.guide(reference, name, axis)]

    def guide(self, base: str, runner: str, axis: float) -> list[Edit]:
        """A joint along which a link slides on another."""
        turned = {'axis': degrees(axis, 6)} if axis else {}
        return [Edit(self.named(base, runner), {'prismatic': [base, runner], **turned})]

    def driven(self, link: str) -> list[Edit]:
        """A drive of a link that turns, if the machine has none."""
        if self.scene.drive or self.scene.drives:
            return []
        return [Edit(('drive',), {'coordinate': link, 'speed': '60 rpm'})]


def referred(link: str, name: str) -> str:
    """LINK.POINT, or LINK of the point at its origin."""
    return f'{link}.{name}' if name != 'start' or link == GROUND else link
