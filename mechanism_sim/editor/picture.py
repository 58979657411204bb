"""Picture of a document: the machine or its parts as they are placed, handles, paths of points."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.editor import drawing
from mechanism_sim.editor.layout import placed
from mechanism_sim.editor.motion import UNSOLVED, Turn
from mechanism_sim.editor.sketch import ORIGIN, Handle, Poses, points_of
from mechanism_sim.errors import InputError
from mechanism_sim.export.palette import index
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.scene import Machine
from mechanism_sim.scene.schema import Scene

_Traced = Mapping[str, bool]  # points whose paths somebody wants drawn, or not


class DocumentPicture(NamedTuple):
    """Picture of a document."""

    scene: Scene
    turn: Turn | None  #: motion of the machine; None if it cannot be assembled
    poses: Poses  #: poses of all links
    problem: str  #: reason why it cannot be assembled; else empty

    @property
    def handles(self) -> list[Handle]:
        """Handles of all joints and free points."""
        return drawing.handles(self.scene, self.poses)

    def handle(self, key: Any) -> Handle:
        """The handle of a key; InputError if it does not exist any more."""
        for handle in self.handles:
            if handle.key == key:
                return handle
        raise InputError('this element does not exist any more')

    def caught(self, at: Vector2, near: float) -> Handle | None:
        """The handle nearest to a position, if closer than `near` [m]."""
        handle = min(self.handles, key=lambda h: math.dist(h.at, at), default=None)
        return handle if handle and math.dist(handle.at, at) < near else None

    def met(self, at: Vector2, near: float) -> str:
        """Name of the link nearest to a position, if closer than `near` [m]; else empty."""
        far = {link: self._far(link, at) for link in self.scene.links if link != GROUND}
        link = min(far, key=far.__getitem__, default='')
        return link if link and far[link] < near else ''

    def _far(self, link: str, at: Vector2) -> float:
        """Distance of a point from a link [m]: from the lines between the link's points."""
        points = [*points_of(self.scene.links[link]).values()]
        place = self.poses[link].within(at)
        pairs = combinations_with_replacement(points, 2)
        return min(_distance(place, *pair) for pair in pairs)

    @property
    def hint(self) -> str:
        """Next step of a machine whose links are not joined yet; empty of others."""
        moving = [link for link in self.scene.links if link != GROUND]
        if not self.problem:
            return ''
        if not moving:
            return 'Draw a link: press where it begins, and drag (L)'
        joined, before = {GROUND}, set[str]()
        while joined != before:
            before = {*joined}
            for joint in self.scene.joints.values():
                ends = {reference.partition('.')[0] for reference in joint.points}
                joined |= ends if ends & joined else set()
        free = [link for link in moving if link not in joined]
        if not free or self.scene.bushings:
            return ''
        return f'{free[0]} is not joined to the frame yet: put a pivot on one of its points (G)'

    def tracks(self, path: tuple[str, ...], traced: _Traced) -> list[tuple[str, bool]]:
        """The points of the link at a path, and whether their paths are drawn."""
        link = path[1] if path[:1] == ('links',) and len(path) == 2 else ''
        if link in ('', GROUND) or link not in self.scene.links:
            return []
        points = (f'{link}.{name}' for name in points_of(self.scene.links[link]))
        return [(point, has_path(point, traced)) for point in points]

    def to_json(
        self, name: str, traced: _Traced, symbol: float, colours: Mapping[str, int]
    ) -> dict[str, Any]:
        """Picture for a page; `symbol` [m] is constant during a drag, else 0.

        Parameters
        ----------
        colours : colour numbers by link, in any order
        """
        curves: dict[str, Any] = {}
        paths: dict[str, Any] = {}
        if self.turn:
            points = self.turn.machine.plan.points
            every = (
                (f'{link}.{x}', link, at) for link, own in points.items() for x, at in own.items()
            )
            paths = {key: [link, at] for key, link, at in every if has_path(key, traced)}
            stage, curves = drawing.of_machine(self.turn, paths, symbol)
        else:
            stage = drawing.of_parts(self.scene, self.poses)
        own = {link: index(colours[link]) for link in stage['links']}
        shapes = [shape | {'colour': own.get(shape['link'], -1)} for shape in stage['shapes']]
        return {
            'stage': {'scene': name, **stage, 'shapes': shapes, 'colours': own},
            'poses': [self.poses[link] for link in stage['links']],
            'handles': [h.to_json() for h in self.handles],
            'curves': curves,
            'traced': {} if curves else paths,
            'marks': drawing.marks(self.scene),
            'assembled': self.turn is not None,
        }


def _distance(at: Vector2, start: Vector2, end: Vector2) -> float:
    """Distance of a point from a straight line between two others [m]."""
    way, to = np.subtract(end, start), np.subtract(at, start)
    part = np.clip(way @ to / (way @ way or 1.0), 0.0, 1.0)
    return float(np.hypot(*(to - part * way)))


def nothing(scene: Scene) -> DocumentPicture:
    """The picture of an empty document."""
    return DocumentPicture(scene, None, {GROUND: ORIGIN}, '')


def pictured(
    name: str,
    scene: Scene,
    old: DocumentPicture,
    near: Poses | None = None,
    loops: Kinematics | None = None,
    machine: Machine | None = None,
) -> DocumentPicture:
    """The picture of a scene, assembled nearest to `near`; of its parts if it is no machine.

    Parameters
    ----------
    old : previous picture, whose poses are used where `near` has none
    loops, machine : loop closures and machine of the scene, if already made
    """
    try:
        turn = Turn(machine or Machine(name, scene), near, old.turn, loops)
    except UNSOLVED as error:
        poses = placed(scene, near or old.poses)
        return DocumentPicture(scene, None, {**poses, **(near or {})}, str(error))
    return DocumentPicture(scene, turn, turn.start, '')


def has_path(point: str, traced: _Traced) -> bool:
    """True if the path of a point is drawn; by default that of named points of moving links."""
    link, _, name = point.partition('.')
    return traced.get(point, name not in ('start', 'end') and link != GROUND)
