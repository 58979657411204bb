"""The vibration of a scene under what shakes it by itself: turning drives, loads over time.

Linear about the static equilibrium, as in `mechanism_sim.study.response`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.scene import Machine
from mechanism_sim.study import frames
from mechanism_sim.study.modes import (
    LinearMachine,
    derivatives,
    kept,
    linearised,
    steady_rates,
    turning,
)
from mechanism_sim.study.response import (
    DERIVATIVES,
    ComplexArray,
    FrequencyResponse,
    Source,
    frame_units,
    refuse_resonance,
    unit_of,
)
from mechanism_sim.vibration.excitation import FourierSeries


@dataclass(frozen=True)
class Harmonics:
    """The steady vibration under what repeats itself: a turning drive, loads over time.

    Attributes
    ----------
    period : [s]
    series : by quantity, its mean counted from the equilibrium at rest
    units : of the quantities
    """

    period: float
    series: dict[str, FourierSeries]
    units: dict[str, str]


def harmonics(
    machine: Machine, quantities: Sequence[str], count: int, period: float | None = None
) -> Harmonics:
    """The steady vibration under the machine's own excitation, as a Fourier series.

    The excitation is what the equations leave open if the drives turn at the speed they start
    with, loads act at their times, and the independent coordinates stay at their equilibrium.
    Mass, damping and stiffness are those of the equilibrium, with gyroscopic terms and those of
    shafts at these speeds: exact where they do not change over the turn, as with rotors out of
    balance and slider-cranks on frames.

    Parameters
    ----------
    quantities : ``position.COORDINATE``, ``velocity.`` or ``acceleration.`` of coordinates that
        are not driven, of which this is the vibration alone; positions of all if empty
    count : of harmonics
    period : [s]; a turn of the first drive that turns if not given

    Raises
    ------
    InputError
        If a quantity is not known, nothing gives the period, the forces do not repeat after it, a
        harmonic meets a resonance without damping, or as `mechanism_sim.study.modes.linearised`.
    """
    if count < 1:
        raise InputError(f'--harmonics {count}: expected 1 or more')
    rates = np.array([machine.held[c][1] for c in machine.plan.prescribed])
    known = frames.coordinates_of(machine)
    asked = [x for x in quantities if x.partition('.')[2] in known]
    if not quantities and not machine.torque_driven:
        asked = [f'position.{c}' for c in known]
    own = [x for x in quantities if x not in asked]
    found: dict[str, FourierSeries] = {}
    units: dict[str, str] = {}
    length = _period(machine, rates, period)
    if asked:
        found, units = _frame_harmonics(machine, asked, count, length)
    if asked and not own:
        return Harmonics(length, found, units)
    one = linearised(machine)
    units |= _own_units(one, own)
    constant, z = _harmonics(one, machine.plan.prescribed, rates, length, count)
    w = 2.0 * np.pi / length * np.arange(1.0, count + 1.0)
    for name in (x for x in units if x not in found):
        kind, _, rest = name.partition('.')
        k, order = one.derivatives.coordinates.index(rest), DERIVATIVES[kind]
        mean = float(constant[k]) if order == 0 else 0.0
        found[name] = FourierSeries(2.0 * np.pi / length, mean, (1j * w) ** order * z[:, k])
    return Harmonics(length, found, units)


def _frame_harmonics(
    machine: Machine, quantities: Sequence[str], count: int, period: float
) -> tuple[dict[str, FourierSeries], dict[str, str]]:
    """Harmonics of frames on springs, and their units."""
    known = frames.coordinates_of(machine)
    units = frame_units(machine, quantities, known)
    places = {quantity: known[quantity.partition('.')[2]] for quantity in units}
    names = list(dict.fromkeys(name for name, _ in places.values()))
    series, found = frames.harmonics_of(machine, names, count, period), {}
    for quantity, (name, k) in places.items():
        order, one = DERIVATIVES[quantity.partition('.')[0]], series[name][k]
        mean = one.mean if order == 0 else 0.0
        rates = (1j * one.frequencies) ** order * one.amplitudes
        found[quantity] = FourierSeries(one.frequency, mean, rates)
    return found, units


def unbalance_response(
    machine: Machine, quantities: Sequence[str], speeds: Array
) -> FrequencyResponse:
    """The vibration at the frequency of rotation over steady speeds (N,) [rad/s] of the drive.

    Parameters
    ----------
    quantities : as those of `harmonics`

    Raises
    ------
    InputError
        As `harmonics`; or if there is no drive that turns.
    """
    main = turning(machine, '--speeds')
    one = linearised(machine, known=derivatives(machine, held=kept(machine)))
    units = _own_units(one, quantities)
    driven = [*machine.plan.prescribed, *kept(machine)]
    w = np.abs(np.asarray(speeds, float))
    if not w.all():
        raise InputError('--speeds: without rotation there is no vibration: begin above 0')
    z = np.array([
        _harmonics(
            one, driven, np.array([x if c == main else 0.0 for c in driven]), 2.0 * np.pi / abs(x),
            1,
        )[1][0]
        for x in speeds
    ])  # fmt: skip
    found = {}
    for name in units:
        kind, _, rest = name.partition('.')
        amplitude = z[:, one.derivatives.coordinates.index(rest)]
        found[name] = (1j * w) ** DERIVATIVES[kind] * amplitude
    source = Source(f'rotation of {main}', '')
    return FrequencyResponse(source, w / (2.0 * np.pi), found, units)


def _own_units(one: LinearMachine, quantities: Sequence[str]) -> dict[str, str]:
    """Units of quantities of coordinates; of the positions of the independent ones if empty."""
    coordinates = one.derivatives.coordinates
    names = quantities or [f'position.{coordinates[i]}' for i in one.independent]
    units = {name: unit_of(one, name) for name in names}
    for name in names:
        if name.partition('.')[0] not in DERIVATIVES:
            raise InputError(f"{one.machine.name}: '{name}': harmonics are of coordinates only")
    return units


def _harmonics(
    one: LinearMachine, drives: Sequence[str], rates: Array, length: float, count: int
) -> tuple[Array, ComplexArray]:
    """Means (n,) and amplitudes (count, n) of all coordinates over a period [s].

    Parameters
    ----------
    rates : of the driven coordinates, in the order of `drives`
    """
    machine = one.machine
    driven = [one.derivatives.coordinates.index(c) for c in drives]
    samples = max(64, 8 * count)
    t = length * np.arange(samples + 1) / samples
    *forces, last = _excitation(one, driven, rates, t)
    scale = np.abs(forces).max() + np.abs(one.linear.K @ np.diag(one.at.q)).max(initial=0.0)
    if np.abs(last - forces[0]).max() > 1e-9 * scale:
        raise InputError(
            f'{machine.name}: after {length:.6g} s the forces on the free coordinates are not '
            'what they were: the period is another, or a spring couples links to the drive that '
            'turn with it; take --torque or --base with --frequencies'
        )
    w = 2.0 * np.pi / length * np.arange(1.0, count + 1.0)
    # what is rounding of the forces that balance at rest would look like a response
    rounding = 1e-13 * scale
    spectrum = [FourierSeries.of_samples(f, length) for f in np.transpose(forces)]
    F = np.array([s.amplitudes[:count] for s in spectrum]).T
    M, C, K = _at_speed(one, driven, rates).matrices
    each = w[:, None, None]
    Z = np.asarray(K + 1j * each * C - each**2 * M, complex)
    F[np.abs(F) <= rounding] = 0.0
    excited = F.any(axis=1)
    refuse_resonance(one, Z[excited], w[excited])
    z = np.zeros((count, len(K)), complex)
    z[excited] = np.linalg.solve(Z[excited], F[excited][:, :, None])[:, :, 0]
    still = np.array([s.mean for s in spectrum])
    mean = np.linalg.lstsq(K, np.where(np.abs(still) > rounding, still, 0.0))[0]
    return one.B @ mean, np.asarray(z @ one.B.T)


def _at_speed(one: LinearMachine, driven: list[int], rates: Array) -> LinearMachine:
    """The same with its drives turning, if all that they carry can turn along with them."""
    main = one.derivatives.coordinates.index(one.machine.main)
    if main not in driven:
        return one
    v = steady_rates(one.machine, float(rates[driven.index(main)]))
    v[driven] = rates
    linear = one.derivatives(one.at._replace(v=v))
    apart = np.abs(linear.J @ v).max(initial=0.0)
    carried = apart <= 1e-9 * np.abs(v).max(initial=0.0) * one.derivatives.scale.max()
    return replace(one, linear=linear) if carried else one


def _period(machine: Machine, rates: Array, period: float | None) -> float:
    if period is not None:
        if not (period > 0.0 and math.isfinite(period)):
            raise InputError(f'--period {period:g} s: must be positive and finite')
        return period
    straight = machine.plan.ideal.displacements
    turning = [
        abs(float(rate))
        for c, rate in zip(machine.plan.prescribed, rates, strict=True)
        if rate and c not in straight
    ]
    if not turning:
        raise InputError(
            f'{machine.name}: no drive turns at a speed: give the period of the excitation by '
            "--period, as '0.1 s'"
        )
    return 2.0 * math.pi / turning[0]


def _excitation(one: LinearMachine, driven: list[int], rates: Array, t: Array) -> Array:
    """Forces (N, f) on the independent coordinates at times (N,) [s], beyond those at rest."""
    held = [*driven, *one.independent]
    names = one.derivatives.coordinates
    kinematics = one.machine.kinematics([names[i] for i in held])
    q, found = one.at.q.copy(), []
    for k, time in enumerate(t):
        # steps small enough for loops to stay on their branch
        before = t[k - 1] if k else 0.0
        for part in np.linspace(before, time, 9 if len(one.linear.J) else 2)[1:]:
            q[driven] = one.at.q[driven] + rates * part
            moved, left = kinematics.positions(q[:, None])
            if left.any():
                raise InputError(
                    f'{one.machine.name}: the loops do not close over the turn of the drive with '
                    'the free coordinates at their equilibrium'
                )
            q = moved[:, 0]
        speeds = np.concatenate([rates, np.zeros(len(one.independent))])[:, None]
        v = kinematics.rates(q[:, None], speeds)
        a = kinematics.accelerations(q[:, None], v, np.zeros_like(speeds))[:, 0]
        outside = one.at.outside.copy()
        if 'time' in one.derivatives.outside:
            outside[one.derivatives.outside.index('time')] = time
        at = one.at._replace(q=q, v=v[:, 0], forces=np.zeros_like(one.at.forces), outside=outside)
        linear = one.derivatives(at, a)
        B = np.zeros_like(one.B)
        B[one.independent] = np.eye(len(one.independent))
        others = [i for i in one.derivatives.free if i not in one.independent]
        if others:
            B[others] = -np.linalg.lstsq(linear.J[:, others], linear.J[:, one.independent])[0]
        found.append(-B.T @ linear.F)
    return np.array(found)
