"""Elastic links at the start: bent as the forces there bend them, without the vibration.

Links at rest in their frames are bent so that the forces of the machine leave their elastic
coordinates no acceleration; that place moves on with the machine. A motion that begins there, with
the rate of that place, is free of vibration but for about ``(W/w)^2`` of the deflection, at the
speed W of the machine and the frequency w of the first mode.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.observer import Instants
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.scene.assembly import Assembly
from mechanism_sim.scene.dynamic_model import DynamicModel

Array = NDArray[np.float64]

_STEPS = 30
_SHIFT = 1e-6  # of the lengths of links: of coordinates, and of their way in a turn
_MOMENT = 1e-4  # of a turn of the drive, or [s]: before and after the start
_SETTLED = 1e-11  # of the size of the machine


def smooth_start(machine: DynamicModel) -> Assembly:
    """The machine without clearance at the start, elastic links bent by its forces."""
    start, ideal = machine.assembly, machine.plan.ideal
    names = ideal.deformations
    given = [c for part in machine.plan.given for c in part if c in names]
    if given:
        raise InputError(
            f'{machine.name}: initial.elastic = smooth says how elastic links start, and so does '
            f'initial for {given[0]}: leave one of them out'
        )
    if not names:
        return start
    m, moment = len(names), _MOMENT * min(machine.period, 1.0)
    shifts = _SHIFT * ideal.size * np.array([1.0] * m + [1.0 / min(machine.period, 1.0)] * m)
    x = np.zeros(2 * m)
    for _ in range(_STEPS):
        columns = x[:, None] + np.diag(shifts) @ np.eye(2 * m, 2 * m + 1, 1)
        found = _left(machine, columns, moment)
        slopes = (found[:, 1:] - found[:, :1]) / shifts
        step = np.linalg.lstsq(slopes, -found[:, 0])[0]
        x += step
        if not np.isfinite(x).all() or np.abs(x[:m]).max() > ideal.size:
            break
        if (np.abs(step) <= _SETTLED / _SHIFT * shifts).all():
            q, v = _states(machine, x[:, None], 0.0)
            return start._replace(q=q[:, 0], v=v[:, 0])
    raise InputError(
        f'{machine.name}: initial.elastic = smooth: at the start the forces bend its elastic '
        'links without an end; start them straight'
    )


def _left(machine: DynamicModel, x: Array, moment: float) -> Array:
    """Accelerations of elastic coordinates, and their rates: (2 m, N) for their values x."""
    before, now, after = (
        _accelerations(machine, *_states(machine, x, t), t) for t in (-moment, 0.0, moment)
    )
    return np.concatenate([now, (after - before) / (2.0 * moment)])


def _states(machine: DynamicModel, x: Array, t: float) -> tuple[Array, Array]:
    """Coordinates and rates (n, N) a time [s] after the start; x (2 m, N) of the elastic ones."""
    plan, start = machine.plan, machine.assembly
    m, count = x.shape[0] // 2, x.shape[1]
    known: dict[str, tuple[Array, Array]] = {}
    for c in plan.prescribed:
        q, v, _ = _law(machine, c, t)
        known[c] = np.full(count, q), np.full(count, v)
    for c, (q, v) in machine.held.items():
        known.setdefault(c, (np.full(count, q + t * v), np.full(count, v)))
    for k, c in enumerate(plan.ideal.deformations):
        known[c] = x[k] + t * x[m + k], x[m + k]
    order = [c for c in plan.ideal.coordinates if c in known]
    kinematics = machine.kinematics(order)
    guess = np.repeat((start.q + t * start.v)[:, None], count, axis=1)
    guess[kinematics.held] = [known[c][0] for c in order]
    places, _ = kinematics.positions(guess)
    return places, kinematics.rates(places, np.array([known[c][1] for c in order]))


def _accelerations(machine: DynamicModel, q: Array, v: Array, t: float) -> Array:
    """Of the elastic coordinates (m, N)."""
    observer = machine.ideal_observer if machine.clearances else machine.observer
    system, count = observer.system, q.shape[1]
    pushed = [np.full(count, _law(machine, c, t)[2]) for c in machine.plan.prescribed]
    outside = np.repeat(machine.outside_at_start(system.outside, t), count, axis=1)
    seen = observer.observe(Instants(
        q, v, np.reshape(pushed, (-1, count)), np.zeros((0, count), np.uint8),
        machine.torques(q, v), outside=outside,
    ))  # fmt: skip
    elastic = [system.coordinates.index(c) for c in machine.plan.ideal.deformations]
    return seen.acceleration[elastic]


def _law(machine: DynamicModel, c: str, t: float) -> tuple[float, float, float]:
    """Value, rate and acceleration that the first law of a drive goes on with."""
    law = machine.plan.laws[c][0]
    assert isinstance(law, DriveLaw)  # noqa: S101 - it is prescribed
    _, (value, *rest) = law.about(Fraction(0))
    rate, half, *more = *rest, 0.0, 0.0
    third = more[0] if len(rest) > 2 else 0.0
    return (
        value + t * (rate + t * (half + t * third)),
        rate + t * (2.0 * half + 3.0 * t * third),
        2.0 * half + 6.0 * third * t,
    )
