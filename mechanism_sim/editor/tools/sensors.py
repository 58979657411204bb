"""Tools that put sensors on links and into joints."""

from __future__ import annotations

from typing import Any, Literal

from mechanism_sim.editor.sketch import PLAY, Edit, Sketch, Spot
from mechanism_sim.editor.tool import draws
from mechanism_sim.errors import InputError


def _on_link(
    name: str, key: str, icon: str, seat: Literal['point', 'along', ''] = 'point'
) -> None:
    """Tool that puts a sensor of the kind `name` on a link.

    Parameters
    ----------
    seat : ``point`` of a link, or ``along`` an elastic link; else the whole link
    """
    hint = f'Click on a link{", or on a point of it" * bool(seat)}'
    values = {'kind': name} if name != 'accelerometer' else {}  # which is one if none is said

    @draws(name, name, key, icon, hint)
    def draw(sketch: Sketch, start: Spot, _: Spot) -> list[Edit]:
        at, edits = sketch.on_link(start, f'a sensor ({name}) is')
        link, _dot, named = at.partition('.')
        where: dict[str, Any] = {'link': link}
        if seat == 'point' and named:
            where['at'] = at
        elif seat == 'along' and not sketch.scene.links[link].elastic:
            raise InputError(f"a sensor ({name}) needs a link with 'elastic', not {link}")
        elif seat == 'along':
            where['at'] = sketch.long(sketch.poses[link].within(sketch.where(start))[0])
        sensor = Edit(('sensors', sketch.name(name)), {**values, **where})
        return [sensor, *(edits if seat == 'point' else [])]


def _in_joint(kind: str, name: str, key: str, icon: str, loose: bool = False) -> None:
    """Tool that puts a sensor into a joint; `loose`: with clearance, if the pin has none."""

    @draws(kind, name, key, icon, 'Click on a pin')
    def draw(sketch: Sketch, start: Spot, _: Spot) -> list[Edit]:
        if start.handle is None or not start.handle.joint:
            raise InputError(f'a sensor ({name}) is in a joint: press on a pin')
        joint = start.handle.key
        edits = [Edit(('sensors', sketch.name(name)), {'kind': kind, 'joint': joint})]
        if loose and not sketch.scene.joints[joint].clearance:
            edits.append(Edit(('joints', joint, 'clearance'), dict(PLAY)))
        return [*edits, *sketch.masses()]


_on_link('accelerometer', 'Shift+A', 'M2 4h12v8H2zm2 2v4h2V6zm4 0v1h5V6zm0 2.5v1h4v-1z')
_in_joint('displacement_probe', 'probe', 'Shift+P', 'M0 6h7v4H0zm10-3h2v10h-2z', loose=True)
_on_link(
    'encoder',
    'Shift+E',
    'M8 1a7 7 0 1 1 0 14A7 7 0 0 1 8 1zm0 1.5v3a2.5 2.5 0 0 0-2.5 2.5h-3A5.5 '
    '5.5 0 0 0 8 13.5v-3A2.5 2.5 0 0 0 10.5 8h3A5.5 5.5 0 0 0 8 2.5z',
    '',
)
_on_link(
    'gyroscope',
    'Shift+G',
    'M8 1a7 7 0 1 1 0 14A7 7 0 0 1 8 1zm0 1.5a5.5 5.5 0 1 0 0 11 5.5 5.5 0 0 0 0-11zM7 4h2v8H7z',
)
_in_joint('load_cell', 'load_cell', 'Shift+L', 'M3 2h10v3H9v6h4v3H3v-3h4V5H3z')


@draws(
    'draw_wire',
    'draw_wire',
    'Shift+W',
    'M1 5h5v6H1zm6 2.5h7v1H7zm7-1.5h1v4h-1z',
    'Press on one point, drag to another',
    'band',
)
def _draw_wire(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A wire between two points, its case at the first."""
    (one, new), (two, newer) = sketch.reference(start), sketch.reference(end)
    values = {'kind': 'draw_wire', 'between': [one, two]}
    return [Edit(('sensors', sketch.name('draw_wire')), values), *new, *newer]


_on_link(
    'strain_gauge',
    'Shift+S',
    'M0 12h16v2H0zM3 11V3h2v6h1V3h2v6h1V3h2v6h1V3h1v8h-3V5h0v6H7V5h0v6z',
    'along',
)
_on_link(
    'tachometer',
    'Shift+N',
    'M8 1a7 7 0 1 1 0 14A7 7 0 0 1 8 1zm0 1.5a5.5 5.5 0 1 0 0 11 5.5 5.5 0 0 0 '
    '0-11zm3.5 2-2.5 5a1.2 1.2 0 1 1-1.7-1.3z',
    '',
)
