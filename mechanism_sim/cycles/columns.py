"""The columns of samples of a machine, and their units."""

from __future__ import annotations

import numpy as np

from mechanism_sim.cycles.shafts import shaft_columns
from mechanism_sim.hybrid.column_units import WORK, has_extremes, part_of, unit_of
from mechanism_sim.hybrid.sampling import Samples, table
from mechanism_sim.hybrid.solution import Piece
from mechanism_sim.hybrid.system import Array
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.joint_view import JointView

__all__ = [
    'WORK', 'columns_of', 'columns_of_parts', 'has_extremes', 'observed', 'part_of', 'unit_of',
]  # fmt: skip


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
    found = _deformed(machine, samples.observed.local)
    for joint in machine.mechanism.joints:
        if isinstance(joint, HigherPair):
            view = JointView(
                machine.mechanism, joint, machine.physics, samples.observed, samples.modes
            )
            own = joint.columns(view)
            if unknown := {name.partition('.')[0] for name in own} - joint.units.keys():
                raise TypeError(f'{type(joint).__name__}.units lacks {", ".join(sorted(unknown))}')
            found |= own
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
                strain = beam.strain(x, float(beam.outer_fibre(x))) @ own
                found[f'stress.{link}.{point}'] = beam.youngs_modulus * strain
    return found
