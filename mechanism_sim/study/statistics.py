"""What a machine is like in the mean: figures per revolution, with confidence intervals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.scene import Machine

Array = NDArray[np.float64]

NAMES = ('impacts', 'impulse', 'losses of contact', 'share of flight', 'dissipated')
UNITS = ('', 'N s', '', '', 'J')
_BATCHES = 20


@dataclass(frozen=True)
class Mean:
    """A figure per revolution: its mean, and half the width of its 95 % confidence interval."""

    name: str
    unit: str
    mean: float
    half_width: float


@dataclass(frozen=True)
class Statistics:
    """Means over the revolutions after those skipped; `I_n` is impulse per impact ([SB] 7.3)."""

    revolutions: int
    skipped: int
    means: tuple[Mean, ...]
    I_n: float


def statistics(
    machine: Machine,
    revolutions: int = 200,
    skip: int = 20,
    progress: Callable[[float, int], None] | None = None,
) -> Statistics:
    """Figures per revolution of all loose joints together.

    The confidence intervals are those of 20 batch means: right if a batch is much longer than the
    memory of the motion. Flight counts each loose joint by itself.

    Raises
    ------
    InputError
        If the crank has no constant speed, there is no clearance, or too few revolutions.
    """
    if machine.torque_driven or not machine.clearances or not np.isfinite(machine.period):
        raise InputError(
            f'{machine.name}: statistics need clearance and a crank at constant speed'
        )
    if skip < 0 or revolutions < skip + _BATCHES:
        raise InputError(
            f'statistics need at least {_BATCHES} revolutions more than the {skip} skipped'
        )
    table = np.zeros((revolutions, len(NAMES)))
    run, T = machine.start(), machine.period
    impacts = 0
    for n in range(revolutions):
        run.advance((n + 1) * T)
        motion, struck, changes = run.drain()
        impacts += len(struck)
        for i in struck:
            row = table[min(int(i.t / T), revolutions - 1)]
            row[:2] += 1.0, i.normal_impulse
            row[4] += i.energy_loss
        for change in changes:
            if change.mode == Mode.FREE_FLIGHT and change.previous > Mode.FREE_FLIGHT:
                table[min(int(change.t / T), revolutions - 1), 2] += 1.0
        flying = (~motion.closed).mean(axis=1) * motion.curve.duration
        rows = np.minimum((motion.curve.start / T).astype(int), revolutions - 1)
        np.add.at(table[:, 3], rows, flying / T)
        if progress:
            progress(run.time, impacts)
    kept = table[skip:]
    size = len(kept) // _BATCHES
    batches = kept[len(kept) - size * _BATCHES :].reshape(_BATCHES, size, -1).mean(axis=1)
    width = student.ppf(0.975, _BATCHES - 1) * batches.std(axis=0, ddof=1) / np.sqrt(_BATCHES)
    mean = batches.mean(axis=0)
    means = tuple(
        Mean(name, unit, float(m), float(w))
        for name, unit, m, w in zip(NAMES, UNITS, mean, width, strict=True)
    )
    return Statistics(revolutions, skip, means, float(mean[1] / mean[0]) if mean[0] else 0.0)
