"""Picture of a document: the machine or its parts as they are placed, handles, paths of points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.editor import drawing
from mechanism_sim.editor.layout import placed
from mechanism_sim.editor.motion import Turn
from mechanism_sim.editor.sketch import ORIGIN, Handle, Poses, points_of
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene import Machine
from mechanism_sim.scene.schema import Scene

Traced = Mapping[str, bool]
"""Points whose paths somebody wants drawn, or not."""


class DocumentPicture(NamedTuple):
    """Picture of a document.

    Attributes
    ----------
    turn : of the machine, if it can be assembled
    poses : of all links
    problem : why it is no machine yet; empty if it is one
    """

    scene: Scene
    turn: Turn | None
    poses: Poses
    problem: str

    def handle(self, key: Any) -> Handle:
        """The handle of a key; it may have gone since a page was drawn."""
        for handle in drawing.handles(self.scene, self.poses):
            if handle.key == key:
                return handle
        raise InputError('there is nothing there any more')

    def tracks(self, path: tuple[str, ...], traced: Traced) -> list[tuple[str, bool]]:
        """The points of the link at a path, and whether their paths are drawn."""
        link = path[1] if path[:1] == ('links',) and len(path) == 2 else ''
        if link in ('', GROUND) or link not in self.scene.links:
            return []
        points = (f'{link}.{name}' for name in points_of(self.scene.links[link]))
        return [(point, has_path(point, traced)) for point in points]

    def to_json(self, name: str, traced: Traced, symbol: float) -> dict[str, Any]:
        """All of it for a page; `symbol` [m] is kept through a drag, else 0."""
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
        return {
            'stage': {'scene': name, **stage},
            'poses': [self.poses[link] for link in stage['links']],
            'handles': [h.to_json() for h in drawing.handles(self.scene, self.poses)],
            'curves': curves,
            'traced': {} if curves else paths,
            'marks': drawing.marks(self.scene),
            'assembled': self.turn is not None,
        }


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
    old : the one before, whose places are kept where nothing else is known
    loops, machine : of the scene, if they are made already
    """
    try:
        turn = Turn(machine or Machine(name, scene), near, old.turn, loops)
    except (InputError, RunError, ArithmeticError, np.linalg.LinAlgError) as error:
        poses = placed(scene, near or old.poses)
        return DocumentPicture(scene, None, {**poses, **(near or {})}, str(error))
    return DocumentPicture(scene, turn, turn.start, '')


def has_path(point: str, traced: Traced) -> bool:
    """True if the path of a point is drawn: of named ones, if nobody says otherwise."""
    link, _, name = point.partition('.')
    return traced.get(point, name not in ('start', 'end') and link != GROUND)
