"""Quantities of a machine over a turn of its drive, quick enough to follow a hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.editor.motion import Turn
from mechanism_sim.planar.points import GROUND

_ORDERS = {
    'angle': ('°', 0), 'angular velocity': ('rad/s', 1), 'angular acceleration': ('rad/s²', 2),
    'displacement': ('', 0), 'velocity': ('m/s', 1), 'acceleration': ('m/s²', 2),
}  # fmt: skip
"""Units of quantities of coordinates, '' for a length, and their orders of derivative."""


def names(turn: Turn | None) -> list[str]:
    """Quantities for a chart, as ``PART: QUANTITY``; empty if the machine does not move."""
    if turn is None or not turn.moves:
        return []
    tree, found = turn.mechanism, []
    for c in tree.coordinates:
        words = [*_ORDERS][3:] if c in tree.displacements else [*_ORDERS][:3]
        found += [f'{c}: {word}' for word in (words if turn.timed else words[:1])]
    points = turn.machine.plan.points
    found += [f'{link}.{point}: {axis}' for link, named in points.items() if link != GROUND
              for point in named for axis in 'xy']  # fmt: skip
    joints = turn.machine.plan.joints if turn.weighed else ()
    return [*found, *(f'{joint.name}: force' for joint in joints)]


def chart(turn: Turn | None, name: str) -> dict[str, Any] | None:
    """A quantity over the drive, as `Curves` draws it; None if there is none of that name."""
    if turn is None or name not in names(turn):
        return None
    part, _, word = name.partition(': ')
    along, at = turn.along
    values, unit = _values(turn, part, word)
    return {
        'name': name, 'label': name, 'unit': unit, 'along': along,
        'at': at.tolist(), 'values': np.nan_to_num(values).tolist(),
    }  # fmt: skip


def _values(turn: Turn, part: str, word: str) -> tuple[Array, str]:
    """Values (N,) of a quantity, and their unit."""
    if word == 'force':
        found = turn.forces()
        assert found  # noqa: S101 - it has a name
        number = [joint['name'] for joint in found.joints].index(part)
        return np.hypot(*found.forces[:, number].T), 'N'
    if word in ('x', 'y'):
        link, _, point = part.partition('.')
        at = turn.machine.plan.points[link][point]
        unit, scale = turn.length
        return scale * turn.mechanism.locate_all(link, turn.q, at)['xy'.index(word)], unit
    unit, order = _ORDERS[word]
    unit, scale = turn.length if not unit else (unit, 180.0 / np.pi if unit == '°' else 1.0)
    return scale * turn.motion(order)[turn.mechanism.coordinates.index(part)], unit
