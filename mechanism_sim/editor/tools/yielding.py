"""Tools for compliant parts: elastic links, and a frame on springs under the machine."""

from __future__ import annotations

from mechanism_sim.editor.rounding import place
from mechanism_sim.editor.sketch import Edit, Sketch, Spot
from mechanism_sim.editor.tool import draws
from mechanism_sim.errors import InputError


@draws(
    'elastic',
    'elastic',
    'Shift+O',
    'M1 11C4 4 12 4 15 11l-1.8.8C10.6 6.6 5.4 6.6 2.8 11.8z',
    'Click on a bar: it is of steel and bends; its section is in the panel',
)
def _elastic(sketch: Sketch, start: Spot, _end: Spot) -> list[Edit]:
    """A bar of steel, a thirtieth as high as it is long, two thirds of that wide."""
    link = start.moving
    given = sketch.scene.links.get(link)
    if given is None or given.length is None:
        raise InputError('a link bends between its ends: press on a bar with a length')
    if given.elastic:
        raise InputError(f'{link} is elastic already')
    high = given.length / 30.0
    section = {'width': sketch.size(high / 1.5), 'height': sketch.size(high)}
    elastic = {'section': section, 'material': 'steel', 'damping': 0.01}
    return [Edit(('links', link, 'elastic'), elastic), *sketch.masses()]


@draws(
    'oscillators',
    'frame',
    'Shift+M',
    'M1 4h14v4H1zM3 9h2l1 1-3 1 3 1-3 1 2 1H3v1h3v-1l-2-.5 3-1-3-1 3-1-1-1.5zM10 9h2l1 1-3 1 '
    '3 1-3 1 2 1h-2v1h3v-1l-2-.5 3-1-3-1 3-1-1-1.5z',
    'Click below the machine: it stands on a frame on two mounts, which its bearings shake',
)
def _frame(sketch: Sketch, start: Spot, _end: Spot) -> list[Edit]:
    """A frame that carries the machine, on two mounts below; it is shaken by the bearings."""
    if sketch.scene.oscillators:
        raise InputError('the machine stands on a frame already: its keys are in the panel')
    middle = sketch.where(start)
    wide = max([0.1, *(abs(pose.x - middle[0]) for pose in sketch.poses.values())])
    step, unit = sketch.grid.step, sketch.grid.unit
    mount = {'stiffness': ['300 N/mm', '400 N/mm'], 'damping': ['150 N s/m', '200 N s/m']}
    mounts = {
        name: {'at': place((middle[0] + x, middle[1]), step, unit), **mount}
        for name, x in (('left', -wide), ('right', wide))
    }
    inertia = f'{20.0 * wide**2 / 3.0:.3g} kg m^2'
    values = {'mass': '20 kg', 'inertia': inertia, 'cog': place(middle, step, unit)}
    made = Edit(('oscillators', sketch.name('frame', plain=True)), {**values, 'mounts': mounts})
    return [made, *sketch.masses()]
