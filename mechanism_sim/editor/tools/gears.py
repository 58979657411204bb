"""Tools for couplings of rotating links: gears, belts, ratios, bevel and worm gears."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from mechanism_sim.editor.rounding import exactly
from mechanism_sim.editor.sketch import Edit, Shaft, Sketch, Spot, point
from mechanism_sim.editor.tool import Draw, draws, refits
from mechanism_sim.errors import InputError
from mechanism_sim.planar.points import GROUND, rotate
from mechanism_sim.scene.schema import JointPart


@draws(
    'mesh',
    'gears',
    'E',
    'M4 3l.5-1h1L6 3h1l1 1v1l1 .5v1L8 7v1L7 9H6l-.5 1h-1L4 9H3L2 8V7l-1-.5v-1L2 5V4l1-1z'
    'm6 5l.5-1h2l.5 1 1 .5v1l1 1-1 1.5v1l-1 1h-1l-1 1-1-1h-1l-1-1v-1l-1-1.5 1-1v-1z',
    'Press on a link that turns, or where a gear is to be; drag to another, or to a link that '
    'slides',
    'band',
)
def _gears(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A pair as 1 to 2, or what fits a gear that is there; on a link that slides a rack."""
    if rail := sketch.sliding(end):
        one = sketch.turning(start, 'wheel')
        way = rotate((rail.at[0] - one.at[0], rail.at[1] - one.at[1]), -rail.axis)
        return _with_rack(sketch, one, rail.link, abs(way[1]))
    one, two = sketch.shafts(start, end, 'wheel', 'a pair of gears')
    apart = math.dist(one.at, two.at)
    (a, z, m), (b, n, k) = (_fixed(sketch, shaft) for shaft in (one, two))
    if a or b:  # the distance of the centres gives the teeth of the other
        module = m or k
        more = 2.0 * apart / module - (z or n)
        if (a and b) or more < 3.0 or abs(more - round(more)) > 1e-7 * apart / module:
            a, b, z, n, module = '', '', 20, 40, apart / 30.0
        z, n = z or round(more), n or round(more)
    else:
        z, n, module = 20, 40, apart / 30.0
    gears = []
    for name, shaft, teeth in ((a, one, z), (b, two, n)):
        values = {'at': shaft.own, 'teeth': teeth, 'module': exactly(module, sketch.grid.unit)}
        gears.append(Edit(('gears', name or sketch.name('gear')), values))
    joint = {'mesh': [gear.path[1] for gear in gears]}
    return [
        Edit(sketch.named(one.link, two.link), joint),
        *one.edits,
        *two.edits,
        *(gear for gear in gears if gear.path[1] not in (a, b)),
        *(sketch.driven(one.link) if one.edits else []),
    ]


def _fixed(sketch: Sketch, shaft: Shaft) -> tuple[str, int, float]:
    """A gear about a shaft: name, teeth and module [m]; nothing if there is none."""
    for name, gear in sketch.scene.gears.items():
        if not gear.teeth or gear.internal or gear.shift or gear.helix_angle:
            continue
        if point(sketch.scene, gear.at) == point(sketch.scene, shaft.own):
            return name, gear.teeth, gear.module
    return '', 0, 0.0


@refits('mesh')
def _refit(sketch: Sketch, _name: str, joint: JointPart) -> list[Edit]:
    """The module that fits the distance of the centres, unless that is to leave backlash."""
    scene = sketch.scene
    one, two = (scene.gears.get(gear) for gear in joint.points)
    if one is None or two is None or (joint.backlash and joint.backlash.width is None):
        return []
    ends = [point(scene, gear.at) for gear in (one, two)]
    if None in ends or one.shift or two.shift or one.helix_angle:
        return []
    a, b = (sketch.poses[end[0]].place(end[2]) for end in ends if end)
    apart, teeth = math.dist(a, b), (one.teeth or 0) * (-1 if one.internal else 1)
    teeth += (two.teeth or 0) * (-1 if two.internal else 1)
    if two.rack:
        rail = sketch.sliding(Spot(b, link=ends[1][0] if ends[1] else ''))
        apart = abs(rotate((b[0] - a[0], b[1] - a[1]), -rail.axis)[1]) if rail else 0.0
    if not teeth or not apart or abs(2.0 * apart / abs(teeth) / one.module - 1.0) < 1e-9:
        return []
    module = exactly(2.0 * apart / abs(teeth), sketch.grid.unit)
    return [Edit(('gears', gear, 'module'), module) for gear in joint.points]


@draws(
    'mesh',
    'rack',
    'Q',
    'M8 1a4 4 0 1 1 0 8 4 4 0 0 1 0-8zM0 14v-3h2v-1h2v1h2v-1h2v1h2v-1h2v1h2v-1h2v4z',
    'Press on a link that turns, or where a pinion is to be; drag to its rack',
    'band',
)
def _rack(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A pinion and a rack that slides across the line from its centre to the place."""
    _, _, apart = sketch.ends(start, end, 'rack')
    one, at = sketch.turning(start, 'wheel'), sketch.where(end)
    axis = math.atan2(at[1] - one.at[1], at[0] - one.at[0]) + 0.5 * math.pi
    base, edits = sketch.point(GROUND, at)
    rack = sketch.name('rack')
    made = [sketch.link(rack), *edits, *sketch.guide(base, rack, axis)]
    return [*_with_rack(sketch, one, rack, apart), *made]


def _with_rack(sketch: Sketch, one: Shaft, rack: str, radius: float) -> list[Edit]:
    if radius < sketch.grid.step:
        raise InputError('a rack runs beside the centre of its pinion: take it further away')
    names = sketch.name('gear'), sketch.name('gear')
    module = exactly(0.1 * radius, sketch.grid.unit)
    return [
        Edit(sketch.named(one.link, rack), {'mesh': list(names)}),
        *one.edits,
        Edit(('gears', names[0]), {'at': one.own, 'teeth': 20, 'module': module}),
        Edit(('gears', names[1]), {'at': rack, 'module': module, 'rack': True}),
        *(sketch.driven(one.link) if one.edits else []),
    ]


def _between(kind: str, stem: str, keys: Callable[[Sketch, Shaft, Shaft], dict[str, Any]]) -> Draw:
    """Tool that draws a joint of a kind between two links that turn: found, or made.

    Parameters
    ----------
    kind : kind of the joint
    stem : stem of the names of new links
    keys : further keys of the joint, from both links
    """

    def draw(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
        one, two = sketch.shafts(start, end, stem, f'a {kind}')
        path = sketch.named(one.link, two.link)
        joint = {kind: [one.own, two.own], **keys(sketch, one, two)}
        if one.on == two.on != GROUND:
            joint['carrier'] = one.on
        driven = sketch.driven(one.link) if one.edits else []
        return [Edit(path, joint), *one.edits, *two.edits, *driven]

    return draw


def _belt_keys(sketch: Sketch, one: Shaft, two: Shaft) -> dict[str, list[str]]:
    """Pulleys as 3 to 5, which leave a fifth of the distance of their centres to both sides."""
    apart = math.dist(one.at, two.at)
    return {'radii': [sketch.size(share * apart) for share in (0.15, 0.25)]}


draws(
    'belt',
    'belt',
    'B',
    'M3.5 6a2 2 0 0 0 0 4L11 13a5 5 0 0 0 0-10zm0 1.3L11 4.3a3.7 3.7 0 0 1 0 7.4L3.5 8.7z',
    'Press on a link that turns, or where a pulley is to be; drag to the other',
    'band',
)(_between('belt', 'pulley', _belt_keys))


draws(
    'transmission',
    'ratio',
    'I',
    'M1 4h6v8H1zm8 0h6v8H9zM7 7h2v2H7z',
    'Press on a link that turns, or where it is to be; drag to another: their angles keep a ratio',
    'band',
)(_between('transmission', 'shaft', lambda *_: {'ratio': '1/2'}))


def _bevel_keys(sketch: Sketch, one: Shaft, two: Shaft) -> dict[str, Any]:
    """Teeth as 1 to 2 that fill the distance of the shafts as they are drawn."""
    module = math.dist(one.at, two.at) / 30.0
    return {
        'teeth': [20, 40],
        'module': sketch.size(module),
        'face_width': sketch.size(6.0 * module),
    }


draws(
    'bevel',
    'bevel',
    'H',
    'M1 6l5 2-5 2zm6-5l8 4H7zm0 6h8l-8 8z',
    'Press on a link that turns, or where it is to be; drag to another: bevel gears',
    'band',
)(_between('bevel', 'shaft', _bevel_keys))


def _worm_keys(sketch: Sketch, one: Shaft, two: Shaft) -> dict[str, Any]:
    """A worm of a third of the distance of the shafts."""
    wide = math.dist(one.at, two.at) / 3.0
    return {'teeth': [2, 30], 'diameter': sketch.size(wide), 'lead_angle': '10 deg'}


draws(
    'worm',
    'worm',
    'Y',
    'M1 5h14v1.5l-14 3zm0 7.5V11l14-3v1.5zM1 14h14v1H1zM1 1h14v1H1z',
    'Press on a link that turns, or where it is to be; drag to another: a worm and its wheel',
    'band',
)(_between('worm', 'shaft', _worm_keys))
