"""The palette: tools for links, and those of drives and of the kinds of joints, loads, sensors."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from mechanism_sim.editor.rounding import degrees
from mechanism_sim.editor.sketch import PLAY, Edit, Pose, Sketch, Spot
from mechanism_sim.editor.tool import Draw, Tool, draws
from mechanism_sim.editor.tools import TOOLS
from mechanism_sim.errors import InputError
from mechanism_sim.joints.kinds import KINDS
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.loads import LOADS
from mechanism_sim.scene.sensors import SENSORS


@draws(
    'links',
    'link',
    'L',
    'M3.5 10a2.5 2.5 0 1 0 2.4 3.2l6-6A2.5 2.5 0 1 0 9.8 5l-6 6z',
    'Press where a link begins, drag to where it ends; it is pinned to links that it meets',
    'band',
)
def _link(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A bar, with a pin at each end that is on another link or on a point of the ground."""
    a, b, length = sketch.ends(start, end, 'link')
    name, angle = sketch.name('link'), math.atan2(b[1] - a[1], b[0] - a[0])
    sketch.poses[name] = Pose(*a, angle)  # its pose until a joint holds it
    edits = [sketch.link(name, length), Edit(('guess', name), degrees(angle))]
    for spot, own in ((start, name), (end, f'{name}.end')):
        if spot.handle or spot.link:
            reference, more = sketch.reference(spot)
            edits += [*more, *sketch.joint(reference, own)]
    return edits


@draws(
    'links',
    'ground',
    'G',
    'M8 3a1.8 1.8 0 0 1 1 3.3L12 12H4l3-5.7A1.8 1.8 0 0 1 8 3zM2 13h12v1.5H2z',
    'Click: a pivot of the frame, there or under the end of a link',
)
def _ground(sketch: Sketch, start: Spot, _end: Spot) -> list[Edit]:
    """A point of the frame, with a pin if there is a point of a link."""
    if start.handle and any(link == GROUND for link, _ in start.handle.members):
        raise InputError(f'{start.handle.key} is on the ground already')
    reference, edits = sketch.point(GROUND, sketch.where(start))
    if start.handle:
        own = sketch.on_link(start, 'a pivot is')[0]
        edits += sketch.joint(reference, own)
    return edits


@draws(
    'links',
    'point',
    'P',
    'M8 5a3 3 0 1 1 0 6 3 3 0 0 1 0-6z',
    'Click on a link: a point whose path is drawn',
)
def _point(sketch: Sketch, start: Spot, _end: Spot) -> list[Edit]:
    """A point of a link, whose path is drawn."""
    if start.handle or not start.link:
        raise InputError('a point is put on a link: press on a bar')
    return sketch.reference(start)[1]


@draws(
    'links',
    'masses',
    'M',
    'M5 4a3 3 0 0 1 6 0h2l2 11H1L3 4zm2 0h2a1 1 0 0 0-2 0z',
    'Masses of bars of 1 kg/m for all links without mass; 1 kg for links without length',
    'now',
)
def _masses(sketch: Sketch, _start: Spot, _end: Spot) -> list[Edit]:
    if not (found := sketch.masses()):
        raise InputError('every link has a mass already')
    return found


@draws(
    'clearance',
    'clearance',
    'K',
    'M8 1a7 7 0 1 1 0 14A7 7 0 0 1 8 1zm0 2a5 5 0 1 0 0 10A5 5 0 0 0 8 3zm1 1.5a3 3 0 1 1 0 6 '
    '3 3 0 0 1 0-6z',
    'Click on a pin: it gets a clearance',
)
def _clearance(sketch: Sketch, start: Spot, _: Spot) -> list[Edit]:
    """Clearance in a pin, and masses of links without one, as needed in free flight."""
    if start.handle is None or not start.handle.joint:
        raise InputError('clearance is put on a joint: press on a pin')
    if sketch.scene.joints[start.handle.key].clearance:
        raise InputError(f'{start.handle.key} has a clearance already')
    play = Edit(('joints', start.handle.key, 'clearance'), dict(PLAY))
    return [play, *sketch.masses()]


_FIRST = 'revolute', 'prismatic', 'slot', 'mesh', 'cam', 'belt'
"""The kinds of joints that are most common."""


def _of_kinds(kinds: Iterable[str]) -> tuple[Tool, ...]:
    return tuple(tool for name in dict.fromkeys(kinds) for tool in TOOLS.get(name, ()))


GROUPS: dict[str, tuple[Tool, ...]] = {
    'links': _of_kinds(('links', 'elastic')),
    'drives': _of_kinds(['drive']),
    'joints': _of_kinds((*_FIRST, *KINDS, 'clearance', 'stops')),
    'loads': _of_kinds(LOADS),
    'sensors': _of_kinds((*SENSORS, 'oscillators')),
}
"""All tools that draw, in the order of the palette."""

_DRAWS: dict[str, Draw] = {tool.name: tool.draw for tools in GROUPS.values() for tool in tools}


def to_json() -> list[dict[str, Any]]:
    """Palette for the page: groups of tools by name."""
    return [
        {'name': name, 'tools': [tool.to_json() for tool in tools]}
        for name, tools in GROUPS.items()
    ]


def draw(sketch: Sketch, what: str, start: Spot, end: Spot) -> list[Edit]:
    """A part drawn from one place to another."""
    if what not in _DRAWS:
        raise InputError(f"there is no '{what}' to be drawn")
    return _DRAWS[what](sketch, start, end)
