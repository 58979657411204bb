"""Tools for drives at constant speed, motors and cylinders."""

from __future__ import annotations

import math

from mechanism_sim.editor.rounding import degrees, rounded
from mechanism_sim.editor.sketch import GONE, Edit, Sketch, Spot, drives_of, point
from mechanism_sim.editor.tool import draws
from mechanism_sim.errors import InputError

_MOTOR = {
    'induction': {
        'synchronous_speed': '1500 rpm', 'rated_speed': '1440 rpm',
        'rated_torque': '10 N m', 'breakdown_torque': '25 N m',
    },
    'ratio': 25, 'inertia': '0.005 kg m^2',
}  # fmt: skip
"""Four poles on a line of 50 Hz, 1.5 kW, and a gear to 58 rpm: to be replaced by a data sheet.

Without its own inertia it would turn links of grams, and slip within microseconds."""


def _driven(sketch: Sketch, start: Spot) -> tuple[str, bool]:
    """The link on which a drive is put, and True if that slides."""
    link = start.moving
    if not link:
        raise InputError('a drive is put on a link that turns or slides: press on it')
    slides = any(
        j.kind == 'prismatic' and (x := point(sketch.scene, j.points[1])) and x[0] == link
        for j in sketch.scene.joints.values()
    )
    return link, slides


@draws(
    'drive',
    'drive',
    'D',
    'M8 2a6 6 0 0 1 6 6h2l-3 4-3-4h2a4 4 0 1 0-4 4v2A6 6 0 0 1 8 2z',
    'Click on a link: it is driven at a constant speed',
)
def _drive(sketch: Sketch, start: Spot, _: Spot) -> list[Edit]:
    """Constant speed of the link on which it is put."""
    scene = sketch.scene
    link, slides = _driven(sketch, start)
    if link in drives_of(scene):
        raise InputError(f'{link} is driven already')
    drive = {'speed': '100 mm/s' if slides else '60 rpm'}
    rough = scene.rough.get(link)
    if not slides:
        drive['start_angle'] = degrees(rough.value if rough else sketch.poses[link].angle)
    more = [Edit(('guess', link), GONE)] if rough and not slides else []
    if scene.drive or scene.drives:
        return [Edit(('drives', link), drive), *more]
    return [Edit(('drive',), {'coordinate': link, **drive}), *more]


@draws(
    'drive',
    'motor',
    'Shift+D',
    'M1 5h2V3h7v2h2v2h3v2h-3v2h-2v2H3v-2H1zm4 0v6h3V5z',
    'Click on a link that turns: an induction motor with a gear drives it; its data sheet is '
    'in the panel',
)
def _motor(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """An induction motor with its gear, instead of a constant speed if the link has one."""
    link, slides = _driven(sketch, start)
    if slides:
        raise InputError(f'{link} slides, and a motor turns: put it on a link that turns')
    keys = ('speed', 'acceleration', 'position', 'moves', 'swing', 'profile', 'torque')
    path, given = drives_of(sketch.scene).get(link, ((), None))
    if given is None:
        made, *edits = _drive(sketch, start, end)
        value = {k: v for k, v in made.value.items() if k != 'speed'}
        edits.insert(0, Edit(made.path, {**value, 'motor': dict(_MOTOR)}))
    else:
        old = [k for k in keys if k in given.model_fields_set]
        edits = [Edit((*path, 'motor'), dict(_MOTOR)), *(Edit((*path, k), GONE) for k in old)]
    lasts = [Edit(('duration',), '2 s')] if sketch.scene.duration is None else []
    return [*edits, *sketch.masses(), *lasts]


@draws(
    'drive',
    'cylinder',
    'C',
    'M1 5h8v2h6v2H9v2H1z',
    'Press on one point, drag to another: a cylinder with a driven rod',
    'band',
)
def _cylinder(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A cylinder with its rod, pinned at both ends; the rod is driven."""
    a, b, long = sketch.ends(start, end, 'cylinder')
    k = 1
    while f'cylinder_{k}' in sketch.scene.links or f'rod_{k}' in sketch.scene.links:
        k += 1
    body, rod = f'cylinder_{k}', f'rod_{k}'
    edits = [sketch.link(body), sketch.link(rod)]
    for spot, link in ((start, body), (end, rod)):
        reference, more = sketch.reference(spot)
        edits += [*more, *sketch.joint(reference, link)]
    edits.insert(-1, Edit(('joints', f'{body}_{rod}', 'prismatic'), [body, rod]))
    drive = {
        'speed': rounded(0.1 * long, 10.0 ** math.floor(math.log10(0.1 * long)), 'mm/s', 'm/s'),
        'start_position': sketch.long(long),
    }
    edits.append(Edit(('guess', body), degrees(math.atan2(b[1] - a[1], b[0] - a[0]))))
    edits.append(Edit(('drives', rod), drive))
    if sketch.scene.duration is None:
        edits.append(Edit(('duration',), '1 s'))
    return edits
