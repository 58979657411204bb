"""The columns of samples of a machine, and their units."""

from __future__ import annotations

from mechanism_sim.scene import Machine

_UNITS = {
    'position': ('rad', 'm'),
    'velocity': ('rad/s', 'm/s'),
    'acceleration': ('rad/s^2', 'm/s^2'),
    'gap': ('m', 'm'),
    'energy': ('J', 'J'),
    'drive_power': ('W', 'W'),
    'drive_torque': ('N m', 'N'),
    'shaking_moment': ('N m', 'N m'),
    't': ('s', 's'),
    'closed': ('', ''),
    'mode': ('', ''),
}
"""Units of columns by the first part of their name: of what turns, and of what slides."""


def unit_of(machine: Machine, column: str) -> str:
    """The SI unit of a column of `Piece.sample` or `Cycle`; empty for a number."""
    kind, _, rest = column.partition('.')
    if column.endswith('.direction'):
        return 'rad'
    if column.endswith('.moment'):
        return 'N m'
    mechanism = machine.mechanism
    turns = kind == 'drive_torque' and not rest and machine.main not in mechanism.displacements
    turning = rest in mechanism.coordinates and rest not in mechanism.displacements
    return _UNITS.get(kind, ('N', 'N'))[0 if turns or turning else 1]
