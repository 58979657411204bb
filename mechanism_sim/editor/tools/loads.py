"""Tools for springs, forces and torques."""

from __future__ import annotations

import math
from typing import Any

from mechanism_sim.editor.rounding import degrees, rounded
from mechanism_sim.editor.sketch import ORIGIN, Edit, Sketch, Spot
from mechanism_sim.editor.tool import draws
from mechanism_sim.errors import InputError
from mechanism_sim.planar.points import GROUND


@draws(
    'springs',
    'spring',
    'R',
    'M1 7.3h2l1-3 2 7 2-7 2 7 2-7 1 3h2v1.4h-3l-.3-.9-1.7 6-2-7-2 7-2-7-.3 1.9H1z',
    'Press on one point, drag to another',
    'band',
)
def _spring(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A spring between two points, relaxed where it is drawn."""
    values, edits = _straight(sketch, start, end)
    return [Edit(('springs', sketch.name('spring')), {**values, 'stiffness': '1000 N/m'}), *edits]


@draws(
    'springs',
    'torsion',
    'Shift+R',
    'M8 7a1 1 0 1 1-1 1 3 3 0 1 1 4 2.8V15H9.5v-5.5A1.5 1.5 0 1 0 6.5 8 1.5 1.5 0 0 0 8 '
    '9.5 3 3 0 0 1 5 7a5 5 0 1 1 8 4l-1-1a3.6 3.6 0 1 0-5.6-2.5z',
    'Press on a link, drag to another or to the frame: a torsion spring',
    'band',
)
def _torsion(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A torsion spring between two links, or the ground, relaxed as they lie."""
    one, two = (
        spot.link or (spot.handle.members[-1][0] if spot.handle else GROUND)
        for spot in (start, end)
    )
    _two_links(one, two)
    a, b = (sketch.poses.get(link, ORIGIN).angle for link in (one, two))
    values = {'between': [one, two], 'stiffness': '10 N m/rad', 'free_angle': degrees(b - a)}
    return [Edit(('springs', sketch.name('spring')), values)]


@draws(
    'springs',
    'gas_spring',
    'Shift+H',
    'M1 6h9v1.3h5v1.4h-5V10H1zm1.4 1.3v1.4h4V7.3z',
    'Press on one point, drag to another: a gas spring, which pushes them apart',
    'band',
)
def _gas_spring(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A gas spring between two points: 100 N where it is drawn, more as it gives."""
    values, edits = _straight(sketch, start, end)
    column = sketch.long(0.8 * math.dist(sketch.where(start), sketch.where(end)))
    values['gas'] = {'force': '100 N', 'column': column, 'exponent': 1.4}
    return [Edit(('springs', sketch.name('gas_spring')), values), *edits]


@draws(
    'springs',
    'bump_stop',
    'Shift+B',
    'M1 3h2v10H1zm3 3 3-2 3 2v4l-3 2-3-2zm8-3h2v10h-2z',
    'Press on one point, drag to another: a buffer that pushes when they come near',
    'band',
)
def _bump_stop(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A spring that pushes below four fifths of the distance that is drawn, and not above."""
    values, edits = _straight(sketch, start, end, 0.8)
    values |= {'stiffness': '10 N/mm', 'damping': '20 N s/m', 'acts': 'below'}
    return [Edit(('springs', sketch.name('bump_stop')), values), *edits]


def _straight(
    sketch: Sketch, start: Spot, end: Spot, free: float = 1.0
) -> tuple[dict[str, Any], list[Edit]]:
    """Ends and free length of a spring between two points, and points that are new."""
    (one, new), (two, newer) = sketch.reference(start), sketch.reference(end)
    _two_links(one, two)
    long = sketch.long(free * math.dist(sketch.where(start), sketch.where(end)))
    return {'between': [one, two], 'free_length': long}, [*new, *newer, *sketch.masses()]


def _two_links(one: str, two: str) -> None:
    if one.partition('.')[0] == two.partition('.')[0]:
        raise InputError('a spring is between points of two links, or of a link and the ground')


@draws(
    'loads',
    'force',
    'Shift+F',
    'M2 15L1 14 11 4H6V2h8v8h-2V5z',
    'Press on a link, drag: an arrow of 1 N a millimetre',
    'band',
)
def _force(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A force of a newton per millimetre of its arrow."""
    (x, y), (u, v), long = sketch.ends(start, end, 'force')
    at, edits = sketch.on_link(start, 'a force acts')
    step = 10.0 ** (math.floor(math.log10(1e3 * long)) - 1)
    force = [rounded(1e3 * part, step, 'N', 'N') for part in (u - x, v - y)]
    load = Edit(('loads', sketch.name('force')), {'at': at, 'force': force})
    return [load, *edits, *sketch.masses()]


@draws(
    'loads',
    'torque',
    'Shift+T',
    'M13 13.5A7 7 0 1 1 14.5 5l1.5-.5-1.5 4L11 6l1.7-.4A5 5 0 1 0 11.6 12z',
    'Press on a link, drag up or down: a torque of 1 N m for 100 mm, down it is clockwise',
    'band',
)
def _torque(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A torque of a newton metre per 100 mm, counterclockwise if it is drawn upwards."""
    (x, y), (u, v) = sketch.where(start), sketch.where(end)
    at, edits = sketch.on_link(start, 'a torque acts')
    size = float(f'{math.copysign(10.0 * math.hypot(u - x, v - y), v - y):.2g}') or 1.0
    load = Edit(('loads', sketch.name('torque')), {'at': at, 'torque': f'{size:g} N m'})
    return [load, *edits, *sketch.masses()]
