"""The columns of samples of a machine, and their units."""

from __future__ import annotations

import numpy as np

from mechanism_sim.cycles.shafts import shaft_columns
from mechanism_sim.hybrid.sampling import Samples, table
from mechanism_sim.hybrid.solution import Piece
from mechanism_sim.hybrid.system import Array
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.joint_view import JointView

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
    't': ('s', 's'),
    'pressure_angle': ('rad', 'rad'),
    'contact': ('m', 'm'),
    'contact_speed': ('m/s', 'm/s'),
    'sliding_speed': ('m/s', 'm/s'),
    'deflection': ('m', 'm'),
    'stress': ('Pa', 'Pa'),
    'closed': ('', ''),
    'mode': ('', ''),
}
"""Units of columns by the first part of their name: of what turns, and of what slides."""

WORK = 'energy.drive_work', 'energy.dissipated'
"""Columns of what was done so far, which cost eight times the rest."""


def has_extremes(column: str) -> bool:
    """Whether extremes of a column make sense."""
    counted = column.startswith(('closed.', 'mode.'))
    return column != 't' and not counted and part_of(column) != 'direction'


def unit_of(run: Machine | Piece, column: str) -> str:
    """The SI unit of a column of `Piece.sample` or `Cycle`; empty for a number."""
    kind, _, rest = column.partition('.')
    if part_of(column) in ('direction', 'moment'):
        return 'rad' if part_of(column) == 'direction' else 'N m'
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


def observed(piece: Piece, t: Array) -> Samples:
    """What `Piece.samples` gives, without the work so far, which costs eight times the rest."""
    k, dt = piece.motion.curve.find(t)
    seen = piece.physics.observe(piece.motion, k, dt)
    unknown = np.full(len(t), np.nan)
    return Samples(t, piece.motion.modes[k].T, seen, unknown, unknown)


def columns_of(
    piece: Piece, t: Array, with_work: bool, machine: Machine | None = None
) -> dict[str, Array]:
    """The columns of `Piece.sample`; without the work so far they are not a number.

    Parameters
    ----------
    machine : that moves: for the columns of its cams, gears and shafts too
    """
    samples = piece.samples(t) if with_work else observed(piece, t)
    parts = columns_of_parts(machine, samples) if machine else {}
    return table(piece.physics, samples) | parts


def columns_of_parts(machine: Machine, samples: Samples) -> dict[str, Array]:
    """Columns of elastic links, cams, gears and shafts.

    Deflection and stress at points, contact, forces of teeth, forces of bearings.
    """
    found = _deformed(machine, samples.observed.position)
    for joint in machine.mechanism.joints:
        if isinstance(joint, HigherPair):
            view = JointView(
                machine.mechanism, joint, machine.physics, samples.observed, samples.modes
            )
            found |= joint.columns(view)
    return found | shaft_columns(machine, samples)


def _deformed(machine: Machine, q: Array) -> dict[str, Array]:
    """Columns (N,) of named points of elastic links, at coordinates (n, N).

    ``deflection.LINK.POINT`` across the link [m], and ``stress.LINK.POINT`` of the fibre on its
    left side [Pa], positive where that is drawn.
    """
    found: dict[str, Array] = {}
    for link, beam in machine.mechanism.beams.items():
        own = q[[machine.mechanism.coordinates.index(f'{link}.{name}') for name in beam.names]]
        for point in machine.scene.links[link].points:
            x = min(max(machine.plan.points[link][point][0], 0.0), beam.length)
            found[f'deflection.{link}.{point}'] = beam.deflection(x) @ own[: beam.modes]
            if beam.fibre is not None:
                strain = beam.strain(x, beam.fibre) @ own
                found[f'stress.{link}.{point}'] = beam.youngs_modulus * strain
    return found
