"""Units of the columns of samples, by their names."""

from __future__ import annotations

from typing import Protocol

from mechanism_sim.hybrid.physics import Physics
from mechanism_sim.planar.mechanism import COLUMN_UNITS

_UNITS = {
    'position': ('rad', 'm'),
    'velocity': ('rad/s', 'm/s'),
    'acceleration': ('rad/s^2', 'm/s^2'),
    'gap': ('m', 'm'),
    'energy': ('J', 'J'),
    'drive_power': ('W', 'W'),
    'friction_loss': ('W', 'W'),
    'drive_torque': ('N m', 'N'),
    'shaking_moment': ('N m', 'N m'),
    'bearing_moment': ('N m', 'N m'),
    'axial_force': ('N', 'N'),
    't': ('s', 's'),
    'deflection': ('m', 'm'),
    'stress': ('Pa', 'Pa'),
    'closed': ('', ''),
    'mode': ('', ''),
}
"""Units of columns by the first part of their name: of what turns, and of what slides.

Kinds of joints have those of their own columns, see `HigherPair.units`; the rest are forces.
"""

WORK = 'energy.drive_work', 'energy.dissipated'
"""Columns of what was done so far, which cost eight times the rest."""


def has_extremes(column: str) -> bool:
    """Whether extremes of a column make sense."""
    counted = column.startswith(('closed.', 'mode.'))
    return column != 't' and not counted and part_of(column) != 'direction'


class HasPhysics(Protocol):
    """A machine, or a part of a run of one."""

    @property
    def physics(self) -> Physics:
        """What it moves by."""


def unit_of(run: HasPhysics, column: str) -> str:
    """The SI unit of a column of `Piece.sample` or `Cycle`; empty for a number."""
    kind, _, rest = column.partition('.')
    if part_of(column) in ('direction', 'moment'):
        return 'rad' if part_of(column) == 'direction' else 'N m'
    if kind in COLUMN_UNITS:
        return COLUMN_UNITS[kind]
    physics = run.physics
    if kind == 'load':
        return physics.unknowns[rest]
    first = physics.driven[:1] if kind == 'drive_torque' and not rest else (rest,)
    turning = all(c in physics.coordinates and c not in physics.displacements for c in first)
    return _UNITS.get(kind, ('N', 'N'))[0 if turning else 1]


def part_of(column: str) -> str:
    """What of a force a column is: ``x``, ``y``, ``direction``, ``moment``, or none of these."""
    kind, *rest = column.split('.')
    named = {'reaction': 1, 'shaking_force': 0}.get(kind)  # a joint may be called x
    return rest[-1] if named is not None and len(rest) > named else ''


IMPACT_UNITS = {
    't': 's', 'normal_impulse': 'N s', 'tangential_impulse': 'N s', 'approach_speed': 'm/s',
    'rebound_speed': 'm/s', 'normal_angle': 'rad', 'energy_loss': 'J', 'drive_impulse': 'N m s',
    'drive_work': 'J', 'chatter_time': 's', 'duration': 's', 'peak_force': 'N',
}  # fmt: skip
"""Units of what is known of an impact."""
