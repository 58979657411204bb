"""Markers for viewers: constant shapes of a machine, and parts that change with time.

Shapes of links are constant in their frames. Forces, contacts, clearances, springs, elastic
links and frames on springs are drawn again at each instant, as in figures.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.analysis.preview import Preview
from mechanism_sim.arrays import Array
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import InputError
from mechanism_sim.export.ideal import frame_of
from mechanism_sim.export.palette import ACCENT, INK, PAPER, colour, rgb, tint
from mechanism_sim.export.shapes import OPEN, Shape, Style, coil
from mechanism_sim.export.skeleton import Skeleton, strung
from mechanism_sim.export.stage import StageFrames
from mechanism_sim.export.triangles import triangles
from mechanism_sim.messages import ColorRGBA, Marker, MarkerArray, Point, message_class, stamp
from mechanism_sim.planar.gaps import gaps_of
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.mechanism import Joint
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.planar.view import Kind

_Colour = tuple[float, float, float, float]  # red, green, blue, and how opaque, 0 to 1 each

STEEL: _Colour = (0.55, 0.60, 0.66, 1.0)

_NAMESPACES: dict[Kind, str] = {
    'frame': 'frames',
    'belt': 'belts',
    'wheel': 'wheels',
    'cam': 'cams',
    'rail': 'guides',
    'support': 'supports',
    'link': 'links',
    'slot': 'slots',
    'slider': 'sliders',
    'bushing': 'bushings',
    'pin': 'pins',
    'cog': 'centres_of_gravity',
    'point': 'points',
    'drive': 'drives',
}
"""Namespaces of the kinds of shapes."""

_LAYER = 0.5  # distance of layers of kinds of shapes, in symbols
_EDGE = 0.12  # width of lines, in symbols
FORCE: _Colour = (0.80, 0.10, 0.10, 1.0)
TOUCHING: _Colour = (0.90, 0.45, 0.05, 1.0)
_FLYING: _Colour = (0.20, 0.55, 0.85, 1.0)
_GLASS: _Colour = (0.93, 0.93, 0.88, 0.9)
_STRUCK: _Colour = (1.00, 0.80, 0.10, 0.9)

SHORTEST = 1e-3
"""Arrows shorter than this part of the machine's size are left out."""

_LENS = 0.12  # radius of a lens, as a share of the machine's size
_PLAY = 1.0 / 3.0  # drawn clearance, as a share of that radius
_FLASH = 100_000_000  # [ns] duration of the mark of an impact
_HEIGHT = 5.0  # height of forces and lenses above the plane of motion, in symbols


def marker(
    namespace: str,
    number: int,
    frame: str,
    kind: int,
    colour: _Colour,
    scale: tuple[float, float, float],
    points: Iterable[Vector2] | Array = (),
    height: float = 0.0,
) -> Any:
    """A Marker that remains until replaced by another of its namespace and number.

    Parameters
    ----------
    kind : one of the constants of Marker
    scale : dimensions [m], with meanings depending on the kind
    points : points in its frame [m]
    height : height of the points above the plane of motion [m]
    """  # fmt: skip
    message = Marker(ns=namespace, id=number, type=kind, action=Marker.ADD)
    message.header.frame_id = frame
    message.pose.orientation.w = 1.0
    message.scale.x, message.scale.y, message.scale.z = map(float, scale)
    message.color = ColorRGBA(r=colour[0], g=colour[1], b=colour[2], a=colour[3])
    message.points = [Point(x=float(x), y=float(y), z=float(height)) for x, y in points]
    return message


def shapes(skeleton: Skeleton, prefix: str) -> Any:
    """MarkerArray of all shapes that are constant in the frames of links."""
    made = [
        each
        for shape, each, _ in painted(skeleton, prefix)
        if not (shape.link in skeleton.bendings or sways(skeleton, shape))
    ]
    return MarkerArray(markers=made)


def sways(skeleton: Skeleton, shape: Shape) -> bool:
    """True if a shape is a frame on springs with a motion."""
    return shape.kind == 'frame' and shape.label in skeleton.sways


def painted(skeleton: Skeleton, prefix: str) -> list[tuple[Shape, Any, Array]]:
    """Markers of the shapes, locked to the frames of links: shape, marker, its points (k, 2) [m].

    A namespace is a kind of shapes, see `_NAMESPACES`: fills as triangles, then edges.
    """
    made: list[tuple[Shape, Any, Array]] = []
    count: Counter[str] = Counter()
    kinds, s = get_args(Kind), skeleton.symbol
    for shape in skeleton.shapes:
        name, frame = _NAMESPACES[shape.kind], frame_of(shape.link, prefix)
        for path in shape.paths:
            # links overlap
            height = _LAYER * s * (kinds.index(shape.kind) + 0.02 * count[name])
            fill, edge = _colours(path.style, shape.number)
            if fill is not None:
                corners = triangles(path.curves).reshape(-1, 2)
                filled = marker(
                    name, count[name], frame, Marker.TRIANGLE_LIST, fill, (1.0, 1.0, 1.0),
                    corners, height,
                )  # fmt: skip
                made.append((shape, filled, corners))
                count[name] += 1
            if edge is not None:
                lines = (np.stack([c, np.roll(c, -1, axis=0)], axis=1) for c in path.curves)
                if path.style in OPEN:
                    lines = (np.stack([c[:-1], c[1:]], axis=1) for c in path.curves)
                ends = np.concatenate(list(lines)).reshape(-1, 2)
                drawn = marker(
                    name, count[name], frame, Marker.LINE_LIST, edge,
                    (_EDGE * s, 0.0, 0.0), ends, height + 0.1 * _LAYER * s,
                )  # fmt: skip
                made.append((shape, drawn, ends))
                count[name] += 1
    for _, each, _ in made:
        each.frame_locked = True
    return made


def _colours(style: Style, number: int) -> tuple[_Colour | None, _Colour | None]:
    """Colours of the fill and of the edge."""
    own, ink = (*rgb(colour(number)), 1.0), (*rgb(INK), 1.0)
    if style in OPEN:
        return None, ink
    if style in ('body', 'plate'):
        return (*rgb(tint(colour(number))), 1.0 if style == 'body' else 0.75), own
    if style == 'paper':
        return (*rgb(PAPER), 1.0), ink
    return (*rgb(INK if style == 'ink' else ACCENT), 1.0), None


@dataclass(frozen=True)
class _Lens:
    """The clearance of a joint, magnified, beside it."""

    joint: Joint
    away: Array  #: (2,) vector from the joint's point to the lens [m]
    radius: float  #: drawn radius of the bushing, or half the distance of walls [m]
    magnification: float
    play: float  #: true clearance of the inner part on each side [m]

    @property
    def inner(self) -> float:
        """Drawn radius of the pin [m], or half the width of the part between walls."""
        return self.radius - self.magnification * self.play


class ForceMarkers:
    """Markers of a machine for `force_markers`.

    Parameters
    ----------
    prefix : prefix of the frames of links
    force_scale : length of arrows per force [m/N]; 0: the largest is half the machine's size
    magnification : magnification of clearances; 0: to a third of the bushing's radius
    """

    def __init__(
        self, seen: Preview, prefix: str = '', force_scale: float = 0.0, magnification: float = 0.0
    ) -> None:
        for name, value in (
            ('force_scale', force_scale),
            ('clearance_magnification', magnification),
        ):
            if not 0.0 <= value < math.inf:
                raise InputError(f'display: {name} must be finite and not negative; 0 chooses it')
        machine = self._machine = seen.machine
        self._prefix, self._symbol = prefix, seen.skeleton.symbol
        self._world = frame_of(GROUND, prefix)
        self._size, self._stage = seen.skeleton.size, seen
        default = 0.5 * self._size / seen.largest if seen.largest else 0.0
        self.force_scale = force_scale or default
        radial = {j.name: machine.plan.clearances[j.name].radial for j in machine.bearings}
        half = {name: 0.5 * width for name, width in self._stage.widths.items()}
        self._bearings, self._plays = (
            [self._lens(seen, machine.mechanism.joint(j), x, magnification) for j, x in of.items()]
            for of in (radial, half)
        )
        skeleton = seen.skeleton
        parts = painted(skeleton, prefix)
        self._elastic = [part for part in parts if part[0].link in skeleton.bendings]
        self._swaying = [part[:2] for part in parts if sways(skeleton, part[0])]
        gaps = machine.equations.system.gaps if machine.level.dynamic else []
        self._joint_of = {gap.name: machine.mechanism.joint(gap.joint) for gap in gaps}
        self._hardest = max((i.normal_impulse for i in seen.found.solution.impacts), default=0.0)

    def _lens(self, seen: Preview, joint: Joint, play: float, magnification: float) -> _Lens:
        magnified = magnification or _PLAY * _LENS * self._size / play
        radius = max(_LENS * self._size, magnified * play / _PLAY * 0.5)
        q = seen.found.solution.view(seen.found.t).observed.local
        place = self._machine.mechanism.locate_all(joint.second, q, joint.on_second)
        out = place.mean(axis=1) - seen.centre
        far = float(np.hypot(*out))
        out = out / far if far > 1e-6 * self._size else np.array([0.0, 1.0])
        return _Lens(joint, 2.0 * radius * out, radius, magnified, play)

    def at(
        self, t: Array, o: Observation, modes: NDArray[np.uint8], sway: Array | None = None
    ) -> Iterator[Any]:
        """MarkerArrays at times t (N,) [s] of an observed machine, arguments as `Stage.frames`.

        Their markers are the same objects every time: publish each before the next.
        """
        frames = self._stage.frames(t, o, modes, sway)
        writers = [
            *self._arrows(frames), *self._pins(frames), *self._walls(frames),
            *self._lines(frames), *self._bent(frames), *self._sway(frames),
        ]  # fmt: skip
        markers = [made for made, _ in writers]
        for i, time in enumerate(t.tolist()):
            now = stamp(time)
            for made, write in writers:
                made.header.stamp = now
                write(i)
            yield MarkerArray(markers=markers)

    @property
    def empty(self) -> bool:
        """True if there is nothing to show."""
        known = self._stage.joints or self._bearings or self._plays or self._elastic
        skeleton = self._stage.skeleton
        return not (known or skeleton.springs or skeleton.strings)

    def flash(self, impact: Any) -> Any:
        """A flash at the joint of an Impact message, with a volume proportional to the impulse.

        None if the machine has no such joint.
        """
        joint = self._joint_of.get(impact.joint)
        if joint is None:
            return None
        self._hardest = max(self._hardest, impact.normal_impulse)
        share = impact.normal_impulse / self._hardest if self._hardest else 1.0
        size = 4.0 * self._symbol * max(share, 1e-3) ** (1.0 / 3.0)
        frame, number = frame_of(joint.second, self._prefix), int(impact.index % 2**31)
        flash = marker('impacts', number, frame, Marker.SPHERE, _STRUCK, (size, size, size))
        flash.header.stamp = impact.header.stamp
        flash.frame_locked = True
        flash.pose.position.x, flash.pose.position.y = joint.on_second
        flash.pose.position.z = _HEIGHT * self._symbol
        flash.lifetime = message_class('builtin_interfaces/msg/Duration')(nanosec=_FLASH)
        return MarkerArray(markers=[flash])

    def _arrows(self, frames: StageFrames) -> Iterator[Any]:
        """Arrows of the force of the first on the second link, from its point of action."""
        s = self._symbol
        acting = frames.acting(self._stage)
        for k, foot in enumerate(acting):
            force = frames.forces[:, k].T
            tip = foot + self.force_scale * force
            shown = np.hypot(*force) * self.force_scale > SHORTEST * self._size
            arrow = marker(
                'reactions', k, self._world, Marker.ARROW, FORCE, (0.5 * s, 1.2 * s, 1.8 * s),
                [(0.0, 0.0), (0.0, 0.0)], _HEIGHT * s,
            )  # fmt: skip

            def write(
                i: int, arrow: Any = arrow, ends: Any = (foot, tip), shown: Any = shown
            ) -> None:
                arrow.action = Marker.ADD if shown[i] else Marker.DELETE
                for point, end in zip(arrow.points, ends, strict=True):
                    point.x, point.y = end[:, i].tolist()

            yield arrow, write

    def _pins(self, frames: StageFrames) -> Iterator[Any]:
        """Markers of the lens of each loose revolute joint: bushing, pin and contact."""
        s, physics = self._symbol, self._machine.physics
        for k, lens in enumerate(self._bearings):
            bushing, middle = self._beside(lens, frames)
            out = frames.pins[:, k].T
            film = not gaps_of(self._machine.mechanism, lens.joint.name, physics.clearances)
            closed = (frames.modes[:, k] > Mode.FREE_FLIGHT) | film
            size = 2.0 * lens.radius
            yield self._moving(self._lying(2 * k, Marker.CYLINDER, _GLASS, (size, size)), middle)
            size = 2.0 * lens.inner
            pin = self._lying(2 * k + 1, Marker.CYLINDER, STEEL, (size, size), 0.5)
            yield self._moving(pin, middle + lens.magnification * out, closed)
            if film:
                continue
            far, play = np.hypot(*out), self._machine.plan.clearances[lens.joint.name]
            along = np.divide(out, far, out=np.zeros_like(out), where=far > 0)
            dot = marker('contacts', k, self._world, Marker.SPHERE, TOUCHING, (s, s, s))
            dot.pose.position.z = (_HEIGHT + 0.5) * s
            touch = bushing + (play.pin_radius + play.radial) * along
            yield self._moving(dot, touch, shown=closed)

    def _walls(self, frames: StageFrames) -> Iterator[Any]:
        """Markers of the lens of every other clearance: its walls and the part between."""
        number = 2 * len(self._bearings)
        for w, lens in enumerate(self._plays):
            _, middle = self._beside(lens, frames)
            left, right = frames.walls[:, w].T
            thick = 0.25 * lens.radius
            for side, gap in ((-1.0, left), (1.0, right)):
                if not np.isnan(gap).all():
                    wall = self._lying(number, Marker.CUBE, _GLASS, (thick, 2.0 * lens.radius))
                    aside = side * (lens.radius + 0.5 * thick)
                    yield self._moving(wall, middle + np.array([[aside], [0.0]]))
                    number += 1
            body = self._lying(number, Marker.TRIANGLE_LIST, STEEL, (1.0, 1.0), 0.5)
            body.scale.z = 1.0
            off, tilt = lens.magnification * frames.off[:, w].T
            moved = np.stack([off, np.zeros_like(off)])
            yield self._leaning(body, lens, 0.5 * tilt, middle + moved, frames.touching[:, w] > 0)
            number += 1

    def _beside(self, lens: _Lens, frames: StageFrames) -> tuple[Array, Array]:
        """The point of a joint and the centre of its lens (2, N) [m]."""
        place = np.array([lens.joint.on_second])
        at = self._stage.skeleton.placed(lens.joint.second, place, frames.poses)[:, 0].T
        return at, at + lens.away[:, None]

    def _lying(
        self, number: int, kind: int, shade: _Colour, size: tuple[float, float], above: float = 0.0
    ) -> Any:
        """A flat part of a lens, `above` its walls [symbols]."""
        s = self._symbol
        made = marker('lenses', number, self._world, kind, shade, (*size, 0.1 * s))
        made.pose.position.z = (_HEIGHT + above) * s
        return made

    def _leaning(
        self, body: Any, lens: _Lens, lean: Array, place: Array, touching: Any
    ) -> tuple[Any, Any]:
        """The body between walls, with offsets (N,) [m] of its ends from its centre by tilt."""
        put, half = self._moving(body, place, touching)[1], 0.5 * lens.radius

        def write(i: int) -> None:
            put(i)
            corners = [
                Point(x=float(x * lens.inner - y * lean[i]), y=float(y * half))
                for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
            ]
            body.points = [corners[k] for k in (0, 1, 2, 0, 2, 3)]

        return body, write

    @staticmethod
    def _moving(
        made: Any, place: Array, touching: Any = None, shown: Any = None
    ) -> tuple[Any, Any]:
        """A marker, and the function that moves it to its position (2, N) [m] at instant i.

        touching : (N,) True for contact, shown by colour; shown : (N,) True if visible
        """

        def write(i: int) -> None:
            position = made.pose.position
            position.x, position.y = place[:, i].tolist()
            if touching is not None:
                shade = TOUCHING if touching[i] else _FLYING
                made.color.r, made.color.g, made.color.b, made.color.a = shade
            if shown is not None:
                made.action = Marker.ADD if shown[i] else Marker.DELETE

        return made, write

    def _lines(self, frames: StageFrames) -> Iterator[Any]:
        """Springs as zigzags, and ropes as straight lines."""
        s, skeleton = self._symbol, self._stage.skeleton
        springs, ropes = skeleton.coiled(frames.poses, frames.sway), strung(skeleton, frames.poses)
        for name, lines in (('springs', springs), ('ropes', ropes)):
            for k, ends in enumerate(lines):
                made = marker(name, k, self._world, Marker.LINE_STRIP, STEEL, (0.2 * s, 0.0, 0.0))

                def write(i: int, made: Any = made, ends: Any = ends, name: str = name) -> None:
                    line = coil(ends[i, 0], ends[i, 1], s) if name == 'springs' else ends[i]
                    made.points = [Point(x=x, y=y) for x, y in line.tolist()]

                yield made, write

    def _bent(self, frames: StageFrames) -> Iterator[Any]:
        """Elastic links, in their frames."""
        for shape, made, points in self._elastic:
            placed = self._stage.skeleton.bent(shape.link, points, frames.poses)

            def write(i: int, made: Any = made, placed: Array = placed) -> None:
                for point, (x, y) in zip(made.points, placed[i].tolist(), strict=True):
                    point.x, point.y = x, y

            yield made, write

    def _sway(self, frames: StageFrames) -> Iterator[Any]:
        """Frames on springs that sway: rotated about the displaced origin of the world."""
        skeleton = self._stage.skeleton
        for shape, made in self._swaying:
            origin = skeleton.swayed(np.zeros((1, 2)), shape.label, frames.sway)[:, 0].T
            half = 0.5 * frames.sway[:, list(skeleton.mounts).index(shape.label), 2]
            place = self._moving(made, origin)[1]

            def write(i: int, made: Any = made, half: Array = half, place: Any = place) -> None:
                place(i)
                turned = made.pose.orientation
                turned.z, turned.w = math.sin(half[i]), math.cos(half[i])

            yield made, write
