"""The tool for cams with their followers."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from mechanism_sim.editor.rounding import degrees, rounded
from mechanism_sim.editor.sketch import Edit, Sketch, Spot, Way
from mechanism_sim.editor.tool import draws
from mechanism_sim.errors import InputError
from mechanism_sim.planar.points import GROUND, rotate


@draws(
    'cam',
    'cam',
    'A',
    'M8 4a5 5 0 0 1 5 5 5 5 0 0 1-10 0c0-3 3-3 5-5zm0 3.5a1.5 1.5 0 1 0 0 3 1.5 1.5 0 0 0 '
    '0-3zM8 0a1.6 1.6 0 1 1 0 3.2A1.6 1.6 0 0 1 8 0z',
    'Press on a link that turns, or where a cam is to be; drag to a link that swings or '
    'slides, or to where its follower is to be',
    'band',
)
def _cam(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A roller on a link that swings or slides, or on a new one that slides away from the cam.

    It rises and returns by a quarter of its distance, and starts in a dwell where it is. A block
    that slides becomes a cam that slides.
    """
    a, b, apart = sketch.ends(start, end, 'cam')
    if way := sketch.sliding(start):
        return _sliding_cam(sketch, way, end)
    cam = sketch.turning(start, 'cam')
    if cam.on != GROUND:
        raise InputError(
            'a cam turns on the ground: press on a link that does, or where it is to be'
        )
    links = [x for x, _ in end.handle.members] if end.handle else [end.link]
    rail, rise = sketch.sliding(end), sketch.size(0.25 * apart)
    swings = next((x for x in map(sketch.pivot, links) if x and x.link != cam.link), None)
    joint: dict[str, Any] = {'follower': 'roller', 'roller': sketch.size(0.25 * apart)}
    edits: list[Edit] = []
    if rail:
        follower = rail.own
        apart = math.dist(cam.at, rail.at)
    elif swings:
        follower, edits = sketch.on_link(end, 'a follower is')
        arm = math.dist(swings.at, b)
        if arm < sketch.grid.step:
            raise InputError('a cam touches a link beside its pivot: drag to its end')
        (x, y), (u, v) = ((p[0] - a[0], p[1] - a[1]) for p in (swings.at, b))
        joint['side'] = 'left' if x * v - y * u > 0.0 else 'right'
        rise = rounded(min(0.25 * apart / arm, 0.4), math.radians(1.0), 'deg', 'rad')
    else:
        follower, axis = sketch.name('follower'), math.atan2(b[1] - a[1], b[0] - a[0])
        guide = sketch.guide(cam.base, follower, axis)
        edits = [sketch.link(follower), *guide, Edit(('guess', follower), sketch.long(apart))]
    angle = sketch.poses[cam.link].angle if cam.link in sketch.poses else 0.0
    if abs(angle) > 1e-9:
        joint['phase'] = degrees(-angle, 4)
    joint['base_radius'] = sketch.size(0.75 * apart)
    joint['law'] = {
        'segments': [
            {'from': f'{first} deg', 'to': f'{first + 100} deg', 'rise': sign + rise}
            for first, sign in ((40, ''), (220, '-'))
        ]
    }
    joint = {'cam': [cam.own, follower], **joint}
    path = sketch.named(cam.link, follower)
    driven = sketch.driven(cam.link) if cam.edits else []
    return [Edit(path, joint), *cam.edits, *edits, *driven]


def _sliding_cam(sketch: Sketch, cam: Way, end: Spot) -> list[Edit]:
    """A valley between two slopes, and a roller in it that slides across the cam's motion."""
    (u, v), (x, y) = cam.at, sketch.where(end)
    x, y = rotate((x - u, y - v), -cam.axis)
    apart = abs(y)
    if apart < sketch.grid.step:
        raise InputError('the follower of a cam that slides is beside its way: drag across it')
    edits: list[Edit] = []
    if rail := sketch.sliding(end):
        follower = rail.own
    else:
        follower = sketch.name('follower')
        foot = rotate((x, 0.0), cam.axis)
        base, edits = sketch.point(GROUND, (u + foot[0], v + foot[1]))
        across = cam.axis + math.copysign(0.5 * math.pi, y)
        guess = Edit(('guess', follower), sketch.long(apart))
        edits += [sketch.link(follower), *sketch.guide(base, follower, across), guess]
    places = [cam.along + k * apart for k in (-10.0, -2.25, -0.25, 0.25, 2.25, 10.0)]
    rise = sketch.size(0.4 * apart)
    rises = '0 mm', f'-{rise}', '0 mm', rise, '0 mm'
    joint = {
        'cam': [cam.own, follower],
        'follower': 'roller',
        'roller': sketch.size(0.4 * apart),
        'base_radius': sketch.size(0.6 * apart),
        'law': {
            'segments': [
                {'from': sketch.long(u), 'to': sketch.long(v), 'rise': rise}
                for (u, v), rise in zip(pairwise(places), rises, strict=True)
            ]
        },
    }
    return [Edit(sketch.named(cam.link, follower.partition('.')[0]), joint), *edits]
