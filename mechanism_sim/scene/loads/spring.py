"""Springs and dampers between two points, or, by their angles, between two links."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.linkages.forces import Spring, TorsionSpring
from mechanism_sim.planar.mechanism import GROUND, Mechanism
from mechanism_sim.planar.protocols import ForceElement
from mechanism_sim.scene.joint_keys import Names, Reference
from mechanism_sim.scene.load_keys import Elements, LoadKind, register
from mechanism_sim.scene.quantities import Angle, Part, si, si_of
from mechanism_sim.scene.rounding import degrees
from mechanism_sim.scene.sketch import ORIGIN, Edit, Sketch, Spot, Tool
from mechanism_sim.units import Measure

Stiffness = Annotated[Measure, si_of('N/m', 'N m/rad')]
Damping = Annotated[Measure, si_of('N s/m', 'N m s/rad')]


class SpringPart(Part):
    """Between two points, or, with an angular stiffness, between two links."""

    between: Reference
    """Two points; two links for a torsion spring."""
    stiffness: Stiffness = Measure(0.0, '')
    """Per length or per angle, which says what kind of spring it is."""
    damping: Damping = Measure(0.0, '')
    """Per speed of the same kind."""
    free_length: Annotated[float, si('m')] | None = None
    """Where it pulls nothing; else 0."""
    free_angle: Angle | None = None
    """Where a torsion spring turns nothing; else 0."""


class Springs(Part):
    """The springs of a scene."""

    springs: dict[str, SpringPart] = Field({})
    """With their dampers, by name."""


def _read(places: Names, name: str, spring: SpringPart, _: Mechanism) -> Elements:
    where = f'{places.name}: springs.{name}'
    (a, on_a), (b, on_b) = (places.find(f'springs.{name}.between', p) for p in spring.between)
    stiffness, damping = spring.stiffness, spring.damping
    if a == b:
        raise InputError(f'{where}.between names one link twice')
    kinds = {m.unit.endswith('rad') for m in (stiffness, damping) if m.unit}
    if len(kinds) != 1:
        raise InputError(
            f'{where}: give stiffness and damping both per length '
            "('200 N/m', '5 N s/m') or both per angle ('3 N m/rad', '0.1 N m s/rad')"
        )
    (torsional,) = kinds
    if torsional and spring.free_length is not None:
        raise InputError(f'{where}: a torsion spring has a free_angle')
    if not torsional and spring.free_angle is not None:
        raise InputError(f'{where}: a straight spring has a free_length')
    if min(stiffness.value, damping.value) < 0.0:
        raise InputError(f'{where}: stiffness and damping cannot be negative')

    def made(mechanism: Mechanism) -> list[ForceElement]:
        key, k, c = f'springs.{name}', stiffness.value, damping.value
        if torsional:
            return [TorsionSpring(key, mechanism, a, b, k, spring.free_angle or 0.0, c)]
        free = spring.free_length or 0.0
        return [Spring(key, mechanism, (a, on_a), (b, on_b), k, free, c)]

    return made


def _draw(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A spring between two points, relaxed where it is drawn."""
    (one, new), (two, newer) = sketch.reference(start), sketch.reference(end)
    _two_links(one, two)
    free = sketch.long(math.dist(sketch.where(start), sketch.where(end)))
    values = {'between': [one, two], 'stiffness': '1000 N/m', 'free_length': free}
    return [Edit(('springs', sketch.name('spring')), values), *new, *newer]


def _draw_torsion(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A torsion spring between two links, or the ground, relaxed as they lie."""
    one, two = (
        spot.link or (spot.handle.members[-1][0] if spot.handle else GROUND)
        for spot in (start, end)
    )
    _two_links(one, two)
    a, b = (sketch.poses.get(link, ORIGIN).angle for link in (one, two))
    values = {'between': [one, two], 'stiffness': '10 N m/rad', 'free_angle': degrees(b - a)}
    return [Edit(('springs', sketch.name('spring')), values)]


def _two_links(one: str, two: str) -> None:
    if one.partition('.')[0] == two.partition('.')[0]:
        raise InputError('a spring is between points of two links, or of a link and the ground')


_TOOLS = (
    Tool(
        'spring', 'R',
        'M1 7.3h2l1-3 2 7 2-7 2 7 2-7 1 3h2v1.4h-3l-.3-.9-1.7 6-2-7-2 7-2-7-.3 1.9H1z',
        'Press on one point, drag to another', _draw, 'band',
    ),
    Tool(
        'torsion', 'Shift+R',
        'M8 7a1 1 0 1 1-1 1 3 3 0 1 1 4 2.8V15H9.5v-5.5A1.5 1.5 0 1 0 6.5 8 1.5 1.5 0 0 0 8 '
        '9.5 3 3 0 0 1 5 7a5 5 0 1 1 8 4l-1-1a3.6 3.6 0 1 0-5.6-2.5z',
        'Press on a link, drag to another or to the frame: a torsion spring', _draw_torsion,
        'band',
    ),
)  # fmt: skip

register(LoadKind(Springs, _read, _TOOLS))
