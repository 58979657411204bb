"""Drawing of a document on a page: the machine, or its links as far as they are joined."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from mechanism_sim.editor.motion import Turn
from mechanism_sim.editor.sketch import Handle, Pose, Poses, point, points_of
from mechanism_sim.editor.tools import TOOLS
from mechanism_sim.export.shapes import COIL, Shape, around
from mechanism_sim.export.skeleton import bounds, skeleton_of
from mechanism_sim.export.stage import written
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.view import Kind
from mechanism_sim.scene.schema import Scene

SMALLEST = 0.25
"""[m] a machine that is begun is not drawn as if it were smaller."""

_ORDER = 'rail', 'support', 'link', 'slider', 'pin', 'point'


def handles(scene: Scene, poses: Mapping[str, Pose]) -> list[Handle]:
    """Handles of all joints and free points, joints first."""
    found, met = [], set()
    for name, joint in scene.joints.items():
        ends = [point(scene, reference) for reference in joint.points]
        if joint.kind != 'revolute' or None in ends:
            continue
        members = tuple((end[0], end[1]) for end in ends if end)
        on = next((end for end in ends if end and end[0] == GROUND), ends[0])
        assert on is not None  # noqa: S101 - looked at above
        found.append(Handle(name, members, poses[on[0]].place(on[2]), True))
        met |= set(members)
    for link in [*(x for x in scene.links if x != GROUND), GROUND]:  # moving links on top
        given = scene.links.get(link)
        for name, at in points_of(given).items():
            bare = link == GROUND and name in ('start', 'end')
            if (link, name) not in met and not bare:
                key = f'{link}.{name}'
                found.append(Handle(key, ((link, name),), poses[link].place(at), False))
    return found


def marks(scene: Scene) -> list[dict[str, Any]]:
    """Signs of loads and sensors at points of links; of a force an arrow [m]."""
    force, torque = (tool.icon for tool in TOOLS['loads'])
    found = []
    for name, load in scene.loads.items():
        along = [1e-3 * x if isinstance(x, float) else 0.0 for x in load.force]
        turns = bool(load.torque) and not any(load.force)
        sign = {'arrow': along, 'turned': load.frame == 'link'} if any(along) else {}
        found.append(_mark(scene, ['loads', name], load.at, torque if turns else force) | sign)
    for name, sensor in scene.sensors.items():
        tools = TOOLS.get(sensor.kind)
        at: Any = getattr(sensor, 'link', None) or ''
        if (joint := scene.joints.get(sensor.joint or '')) and joint.kind not in ('mesh', 'belt'):
            at = joint.points[1]
        mark = _mark(scene, ['sensors', name], at, tools[0].icon if tools else '')
        if (own := getattr(sensor, 'at', None)) and mark['link']:
            mark['at'] = list(own) if isinstance(own, tuple) else [own, 0.0]
        found.append(mark)
    return [mark for mark in found if mark['link']]


def _mark(scene: Scene, path: list[str], reference: str, icon: str) -> dict[str, Any]:
    link, _, at = point(scene, reference) or ('', '', (0.0, 0.0))
    return {'path': path, 'link': link, 'at': list(at), 'icon': icon}


def of_machine(
    turn: Turn, traced: Collection[str], symbol: float = 0.0
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Stage of an assembled machine, as `Stage.to_json` has it but without forces; and curves.

    Parameters
    ----------
    traced : LINK.POINT whose paths are drawn
    symbol : size of a joint [m] during a drag, when bounds are not needed; else 0
    """
    skeleton = skeleton_of(turn.machine, turn.q, mechanism=turn.mechanism, size=60.0 * symbol)
    poses = skeleton.poses(turn.q)
    curves: dict[str, Any] = {}
    if poses.shape[0] > 1:
        points = turn.machine.plan.points
        for link in skeleton.links:
            names = [name for name in points.get(link, {}) if f'{link}.{name}' in traced]
            if not names:
                continue
            at = np.array([points[link][name] for name in names])
            placed = skeleton.placed(link, at, poses)
            for k, name in enumerate(names):
                curves[f'{link}.{name}'] = np.round(placed[:, k], 7).tolist()
    stage = _stage(turn.machine.scene, skeleton.links, skeleton.symbol, skeleton.shapes)
    springs = [[[link, list(at)] for link, at in ends] for ends in skeleton.springs]
    if symbol:
        return stage | {'springs': springs}, curves
    low, high = bounds(skeleton, poses[:: max(1, len(poses) // 6)])
    return stage | {'springs': springs, 'bounds': [*low.tolist(), *high.tolist()]}, curves


def of_parts(scene: Scene, poses: Poses) -> dict[str, Any]:
    """Stage of links that are no machine yet."""
    links = [link for link in scene.links if link != GROUND]
    number = {link: k for k, link in enumerate(links)}
    ends = {link: np.array([*points_of(scene.links[link]).values()]) for link in links}
    everything = [poses[link].place(tuple(at)) for link in links for at in ends[link]]
    everything += list(points_of(scene.links.get(GROUND)).values())
    spread = np.array(everything or [(0.0, 0.0)])
    symbol = max(float(np.ptp(spread, axis=0).max()), SMALLEST) / 60.0
    shapes: list[Shape] = []

    def add(kind: Kind, link: str, at: Any, label: str = '') -> None:
        shapes.append(Shape(kind, link, (np.array(at),), symbol, label, 0.0, number.get(link, -1)))

    for link in links:
        add('link', link, around(ends[link]), link)
    for name, joint in scene.joints.items():
        one, two = (point(scene, reference) for reference in joint.points)
        if one is None or two is None:
            continue
        if joint.kind == 'revolute':
            for end in (one, two):
                if end[0] == GROUND:
                    add('support', GROUND, [end[2]])
            add('pin', two[0], [two[2]], name)
        elif joint.kind == 'prismatic':
            c, s = np.cos(joint.axis), np.sin(joint.axis)
            way = np.array([[-6.0 * symbol], [6.0 * symbol]]) * np.array([[c, s]])
            add('rail', one[0], np.array(one[2]) + way)
            box = symbol * np.array([[-1.7, -1.1], [1.7, -1.1], [1.7, 1.1], [-1.7, 1.1]])
            c, s = np.cos(joint.axis - joint.angle), np.sin(joint.axis - joint.angle)
            add('slider', two[0], np.array(two[2]) + box @ np.array([[c, s], [-s, c]]), name)
    for link, at in points_of(scene.links.get(GROUND)).items():
        if link not in ('start', 'end'):
            add('point', GROUND, [at], link)
    for link in links:
        for at in scene.links[link].points.values():
            add('point', link, [at])
    shapes.sort(key=lambda shape: _ORDER.index(shape.kind))
    between = [spring.between for spring in scene.springs.values() if spring.between]
    pairs = [[point(scene, r) for r in pair] for pair in between]
    springs = [[[x[0], list(x[2])] for x in pair if x] for pair in pairs if None not in pair]
    low, high = spread.min(axis=0), spread.max(axis=0)
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), 0.25 * SMALLEST)
    corners = [*(middle - half).tolist(), *(middle + half).tolist()]
    return _stage(scene, links, symbol, shapes) | {'springs': springs, 'bounds': corners}


class _Alike:
    """A shape that equals another if it looks the same."""

    def __init__(self, shape: Shape) -> None:
        self.shape = shape
        self._key = (
            shape.kind, shape.link, shape.label, shape.size, shape.number, shape.symbol,
            *(curve.tobytes() for curve in shape.curves),
        )  # fmt: skip

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Alike) and self._key == other._key


@lru_cache(maxsize=256)
def _written(alike: _Alike) -> dict[str, Any]:
    """A shape for JSON; of those dragged along most are as before."""
    return written(alike.shape)


def _stage(scene: Scene, links: list[str], symbol: float, shapes: list[Shape]) -> dict[str, Any]:
    return {
        'title': scene.title,
        'symbol': symbol,
        'links': links,
        'shapes': [_written(_Alike(shape)) for shape in shapes],
        'coil': COIL.tolist(),
        'joints': [],
        'bearings': [],
        'plays': [],
        'force_scale': 0.0,
        'bendings': {},
    }
