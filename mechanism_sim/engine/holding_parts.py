"""Parts of switches that hold a motion, 0 to 1 of their steps, at given instants."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.tolerances import TOLERANCES

_JOINT_FRICTION = TOLERANCES.joint_friction


def with_holding_parts(
    rates: SwitchedFunction,
    inputs: Array,
    rows: Array,
    flags: Sequence[int],
    holds: Sequence[int],
) -> Array:
    """The values (r, N) of the switches, with its part for each that holds.

    Several that hold at once have those that leave no rates of what they hold; where these do
    not lie between 0 and 1, those of 0 to 1 that leave least, by projected Gauss-Seidel
    iteration.

    Parameters
    ----------
    rates : rates of the functions of the switches, by `inputs` (n, N) and rows
    flags, holds : indices in `rows` of flag and holding mark of each switch that may hold
    """
    held = rows[holds] > 0.0
    columns = np.flatnonzero(held.any(axis=0))
    held, now, inputs = held[:, columns], rows[:, columns], inputs[:, columns]
    now[flags] = np.where(held, 0.0, now[flags])
    (free,) = rates(inputs, now)
    slopes = []
    for flag, own in zip(flags, held, strict=True):
        now[flag] += own
        slopes.append(rates(inputs, now)[0] - free)
        now[flag] -= own
    parts, jump = np.zeros(held.shape), np.array(slopes)
    exact, alone = _together(free, jump, held)
    for _ in range(0 if alone.all() else _JOINT_FRICTION.sweeps):
        change = np.zeros(())
        for k, own in enumerate(held):
            acts = own & (jump[k, k] < 0.0)
            slope = np.where(acts, jump[k, k], -1.0)
            left = free[k] + (jump[:, k] * parts).sum(axis=0)
            part = np.where(acts, np.clip(parts[k] - left / slope, 0.0, 1.0), 0.0)
            change = np.maximum(change, np.abs(part - parts[k])[~alone].max())
            parts[k] = part
        if change < _JOINT_FRICTION.settled:
            break
    parts = np.where(alone, exact, parts)
    now[flags] = np.where(held, parts, now[flags])
    found = rows.copy()
    found[:, columns] = now
    return found


def _together(free: Array, jump: Array, held: Mask) -> tuple[Array, Mask]:
    """Parts (h, N) of holding switches that make their rates zero; mask (N,) of 0 to 1.

    They are solved for at once, since iteration may oscillate where switches are coupled.

    Parameters
    ----------
    free : (h, N) rates of the functions with all parts at zero
    jump : (h, h, N) change of the second function's rate by part one of the first switch
    held : (h, N) whether a switch holds
    """
    several = held.sum(axis=0) > 1
    both = held[:, None] & held[None]
    A = np.where(both, jump.transpose(1, 0, 2), np.eye(len(held))[..., None]).transpose(2, 0, 1)
    size = np.maximum(np.abs(A).max(axis=2, keepdims=True), TOLERANCES.rounding.least)
    A, b = A / size, -np.where(held, free, 0.0).T[..., None] / size
    several &= np.abs(np.linalg.det(A)) > _JOINT_FRICTION.dependent
    found = np.zeros(held.shape)
    found[:, several] = np.linalg.solve(A[several], b[several])[..., 0].T
    inside = (found >= 0.0) & (found <= 1.0)
    return found, several & inside.all(axis=0)
