"""Work and losses of a motion, segment by segment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.engine.audit import Work, work_in
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.events import Impact, Impacts
from mechanism_sim.engine.physics import Physics
from mechanism_sim.numerics.quadrature import Parts


class EnergyTerms(NamedTuple):
    """Work and losses of a motion of m segments [J]."""

    work: Work  #: work in each segment, without impulses
    impacts: Sequence[Impact]  #: impacts within the motion
    drive_work: float = 0.0  #: work of the drives before the motion [J]
    dissipated: float = 0.0  #: losses before the motion [J]

    @property
    def after(self) -> tuple[float, float]:
        """Work of the drives and losses [J] since the start of the run, at the end."""
        drive, lost = Impacts.of(self.impacts).exchange.sum(axis=0).tolist()
        drive += float(self.work.drive.sum())
        lost += float(self.work.friction.sum())
        return self.drive_work + drive, self.dissipated + lost


def energy_so_far(
    physics: Physics, motion: Motion, balance: EnergyTerms, k: IndexArray, dt: Array
) -> tuple[Array, Array]:
    """Work of the drives and losses (N,) [J] since the start of the run.

    Impacts count from the segment on that begins with them.

    Parameters
    ----------
    k, dt : (N,) segments, and the time since their start [s]
    """
    work, lost = np.full(len(k), balance.drive_work), np.full(len(k), balance.dissipated)
    if physics.has_forces:
        since = work_since_start(physics, motion, k, dt)
        work += np.concatenate([[0.0], np.cumsum(balance.work.drive)])[k] + since.drive
        lost += np.concatenate([[0.0], np.cumsum(balance.work.friction)])[k] + since.friction
        impacts = Impacts.of(balance.impacts)
        began = motion.curve.begun_by(impacts.column('t'))
        passed = np.searchsorted(began, k, side='right')
        work += np.cumsum([0.0, *impacts.column('drive_work')])[passed]
        lost += np.cumsum([0.0, *impacts.sudden_loss])[passed]
    return work, lost


def work_since_start(physics: Physics, motion: Motion, k: IndexArray, dt: Array) -> Work:
    """Work and losses (N,) from the start of segments k to `dt` (N,) later, by quadrature.

    There is none before: where steps meet `dt` is what the time rounds, to either side.
    """
    found, later = np.zeros((len(Work._fields), len(k))), np.flatnonzero(dt > 0.0)
    parts = Parts(k[later], np.zeros(len(later)), dt[later], np.zeros(len(later), bool))
    found[:, later] = work_in(physics, motion, parts, in_order=False)[0]
    return Work(*found)
