"""Everything about a machine at any instant of its motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.hybrid.audit import Work, work_in
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.events import Impact, Mode
from mechanism_sim.hybrid.physics import Physics
from mechanism_sim.hybrid.system import Array
from mechanism_sim.numerics.quadrature import Parts
from mechanism_sim.planar.inverse_dynamics import Observation


class EnergyTerms(NamedTuple):
    """Work and losses of a motion of m segments [J]."""

    work: Work  #: in each segment, without impulses
    impacts: Sequence[Impact]  #: those within the motion
    drive_work: float = 0.0  #: before the motion
    dissipated: float = 0.0  #: before the motion


class Samples(NamedTuple):
    """A machine at N instants."""

    t: Array  #: (N,) [s]
    modes: NDArray[np.uint8]  #: (m, N)
    observed: Observation
    drive_work: Array  #: (N,) [J] since the start of the run
    dissipated: Array  #: (N,) [J] since the start of the run


def sample(physics: Physics, motion: Motion, balance: EnergyTerms, t: Array) -> Samples:
    """The machine at times `t` (N,) [s].

    All that is said of an instant belongs to one segment of the motion: where something changes,
    to that which begins there, and at the end of the motion to the last. Impacts count from the
    segment on that begins with them.

    Raises
    ------
    ValueError
        For a time outside of the motion.
    """
    curve = motion.curve
    k, dt = curve.find(t)
    observed = physics.observe(motion, k, dt)
    work, lost = np.full(len(t), balance.drive_work), np.full(len(t), balance.dissipated)
    if physics.has_forces:
        since = work_since_start(physics, motion, k, dt)
        work += np.concatenate([[0.0], np.cumsum(balance.work.drive)])[k] + since.drive
        lost += np.concatenate([[0.0], np.cumsum(balance.work.friction)])[k] + since.friction
        passed = np.searchsorted(curve.begun_by([i.t for i in balance.impacts]), k, side='right')
        work += np.cumsum([0.0, *(i.drive_work for i in balance.impacts)])[passed]
        lost += np.cumsum([0.0, *(i.sudden_loss for i in balance.impacts)])[passed]
    return Samples(t, motion.modes[k].T, observed, work, lost)


def work_since_start(physics: Physics, motion: Motion, k: NDArray[np.intp], dt: Array) -> Work:
    """Work and losses (N,) from the start of segments k to `dt` (N,) later, by quadrature."""
    parts = Parts(k, np.zeros(len(k)), dt, np.zeros(len(k), bool))
    return work_in(physics, motion, parts, in_order=False)[0]


def table(physics: Physics, s: Samples) -> dict[str, Array]:
    """Samples as columns (N,) by name; the names are those of `Solution.sample`."""
    o = s.observed
    columns: dict[str, Array] = {'t': s.t}
    for name, rows in (
        ('position', o.position),
        ('velocity', o.velocity),
        ('acceleration', o.acceleration),
    ):
        columns |= {f'{name}.{c}': row for c, row in zip(physics.coordinates, rows, strict=True)}
    columns |= physics.columns(o)
    for i, joint in enumerate(physics.clearances):
        columns[f'gap.{joint}'] = o.gap[i]
        columns[f'normal_force.{joint}'] = o.normal_force[i]
        columns[f'friction_force.{joint}'] = o.friction_force[i]
        columns[f'closed.{joint}'] = (s.modes[i] > Mode.FREE_FLIGHT).astype(float)
        columns[f'mode.{joint}'] = s.modes[i].astype(float)
    if physics.has_forces:
        for i, joint in enumerate(physics.joints):
            columns[f'reaction.{joint}.x'] = o.reaction[i, 0]
            columns[f'reaction.{joint}.y'] = o.reaction[i, 1]
            if o.reaction_moment[i].any():
                columns[f'reaction.{joint}.moment'] = o.reaction_moment[i]
        columns['drive_torque'] = o.drive_torque[0]
        for coordinate, row in zip(physics.driven[1:], o.drive_torque[1:], strict=True):
            columns[f'drive_torque.{coordinate}'] = row
        columns |= {f'load.{x}': row for x, row in zip(physics.unknowns, o.load, strict=True)}
        columns['energy.kinetic'] = o.kinetic_energy
        columns['energy.potential'] = o.potential_energy
        columns['energy.drive_work'] = s.drive_work
        columns['energy.dissipated'] = s.dissipated
    return columns
