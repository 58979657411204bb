"""Steady response of a scene to harmonic forces and base motions, and to its own excitation.

Linear about the static equilibrium, as in `mechanism_sim.study.modes`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.planar.linearisation import Excitation
from mechanism_sim.planar.mechanism import GROUND
from mechanism_sim.scene import Machine
from mechanism_sim.scene.places import Places
from mechanism_sim.study.modes import (
    LinearMachine,
    derivatives,
    kept,
    linearised,
    steady_rates,
    turning,
)
from mechanism_sim.vibration.excitation import FourierSeries

ComplexArray = NDArray[np.complex128]

_DERIVATIVES = {'position': 0, 'velocity': 1, 'acceleration': 2}
_AXES = ('x', 'y')


@dataclass(frozen=True)
class Source:
    """What shakes the machine harmonically, with an amplitude of one in SI units.

    Attributes
    ----------
    name : as it was asked for
    unit : of its amplitude
    excitation : a force or a moment, or
    base : a driven coordinate that moves about its place
    """

    name: str
    unit: str
    excitation: Excitation | None = None
    base: str | None = None


@dataclass(frozen=True)
class FrequencyResponse:
    """Complex amplitudes by quantity, per unit of the source.

    Attributes
    ----------
    source : what shakes
    frequency : (N,) [Hz]
    amplitudes : (N,) by quantity; the angle is how far it leads the source
    units : of the quantities
    """

    source: Source
    frequency: Array
    amplitudes: dict[str, ComplexArray]
    units: dict[str, str]


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


def read_source(
    machine: Machine,
    force: str | None = None,
    direction: float | None = None,
    torque: str | None = None,
    base: str | None = None,
) -> Source:
    """A source from names of the scene.

    Parameters
    ----------
    force : ``LINK.POINT`` at which a force acts, in a `direction` of the world [rad]
    torque : link on which a moment acts
    base : driven coordinate that moves

    Raises
    ------
    InputError
        If there is not one source, or no such thing.
    """
    if sum(x is not None for x in (force, torque, base)) != 1:
        raise InputError('give one of --force LINK.POINT, --torque LINK and --base COORDINATE')
    if (force is None) != (direction is None):
        raise InputError("--force and --direction belong together, as in --direction '90 deg'")
    if base is not None:
        prescribed = machine.plan.prescribed
        if base not in prescribed:
            known = ', '.join(prescribed) or 'none'
            raise InputError(
                f"{machine.name}: --base '{base}' is no coordinate that a drive prescribes"
                f'{nearest(base, prescribed)}; such are: {known}'
            )
        straight = base in machine.plan.ideal.displacements
        return Source(f'base {base}', 'm' if straight else 'rad', base=base)
    option, reference = ('--force', force) if force is not None else ('--torque', torque)
    point = Places(machine.name, machine.scene).find(option, str(reference))
    if point[0] == GROUND:
        raise InputError(f'{machine.name}: {option} {reference}: the ground does not move')
    if direction is None:
        return Source(f'torque {torque}', 'N m', Excitation(point, None))
    unit = (math.cos(direction), math.sin(direction))
    return Source(f'force {force}', 'N', Excitation(point, unit))


def response(
    machine: Machine, source: Source, quantities: Sequence[str], frequency: Array
) -> FrequencyResponse:
    """The frequency response of quantities to a source.

    Parameters
    ----------
    quantities : ``position.COORDINATE``, ``velocity.``, ``acceleration.``, ``reaction.JOINT.x``,
        ``reaction.JOINT.y``; the first of every free coordinate if empty
    frequency : (N,) [Hz]

    Raises
    ------
    InputError
        If a quantity is not known, the source moves nothing, a frequency is negative or meets a
        resonance without damping, or as `mechanism_sim.study.modes.linearised`.
    """
    if not (np.isfinite(frequency).all() and (frequency >= 0.0).all()):
        raise InputError('frequencies must be finite and not negative')
    one = linearised(machine, source.excitation)
    names = quantities or [f'position.{one.derivatives.coordinates[i]}' for i in one.independent]
    units = {name: _unit(one, name) for name in names}
    w = 2.0 * np.pi * np.asarray(frequency, float)
    reactions = any(name.startswith('reaction.') for name in names)
    if source.excitation and not reactions and not (one.B.T @ one.linear.input).any():
        raise InputError(
            f'{machine.name}: a {source.name} moves nothing: drives or guides hold the link '
            'against it; choose another link or direction'
        )
    moved, forces = _steady(one, source, w)
    found = {name: _amplitudes(one, name, w, moved, forces, source) for name in names}
    return FrequencyResponse(source, np.asarray(frequency, float), found, units)


def _steady(one: LinearMachine, source: Source, w: Array) -> tuple[ComplexArray, ComplexArray]:
    """Amplitudes of all coordinates (N, n), and of the forces of closures (N, c)."""
    linear, B, free = one.linear, one.B, one.derivatives.free
    n = len(one.derivatives.coordinates)
    D = np.zeros(n)
    if source.base is not None:
        k = one.derivatives.coordinates.index(source.base)
        D[k] = 1.0
        others = [i for i in free if i not in one.independent]
        if others:
            D[others] = -np.linalg.lstsq(linear.J[:, others], linear.J[:, k])[0]
    each = w[:, None, None]
    Z = np.asarray(linear.K + 1j * each * linear.C - each**2 * linear.M, complex)
    push = linear.input - Z @ D
    reduced = np.asarray(B.T @ Z @ B, complex)
    _refuse_resonance(one, reduced, w)
    z = np.linalg.solve(reduced, (push @ B)[:, :, None])[:, :, 0]
    moved = np.asarray(z @ B.T + D, complex)
    left = (np.einsum('kij,kj->ki', Z, moved) - linear.input)[:, free]
    if not len(linear.J):
        return moved, np.zeros((len(w), 0), complex)
    forces = np.linalg.lstsq(linear.J[:, free].T.astype(complex), left.T)[0].T
    return moved, np.asarray(forces, complex)


def _refuse_resonance(one: LinearMachine, Z: ComplexArray, w: Array) -> None:
    """Refuse frequencies at which the impedance is singular."""
    size = np.sqrt(np.abs(np.diag(one.matrices[0])))
    size = size if size.all() else np.ones(len(size))
    scaled = Z / np.outer(size, size)
    values = np.linalg.svd(scaled, compute_uv=False)
    M, C, K = (np.abs(x / np.outer(size, size)).max(initial=0.0) for x in one.matrices)
    scale = K + w * C + w**2 * M
    singular = values.min(axis=1, initial=np.inf) <= 1e-14 * scale
    if singular.any():
        f = w[singular][0] / (2.0 * np.pi)
        raise InputError(
            f'{one.machine.name}: at {f:.9g} Hz is a resonance without damping, where no steady '
            "response exists: leave the frequency out, or give a spring 'damping'"
        )


def _unit(one: LinearMachine, name: str) -> str:
    """Unit of a quantity; refuses those that are not known."""
    kind, _, rest = name.partition('.')
    machine, coordinates = one.machine, one.derivatives.coordinates
    if kind in _DERIVATIVES:
        if rest not in coordinates:
            raise InputError(
                f"{machine.name}: '{name}': there is no coordinate '{rest}'"
                f'{nearest(rest, coordinates)}; coordinates: {", ".join(coordinates)}'
            )
        unit = 'm' if rest in machine.plan.ideal.displacements else 'rad'
        return unit + ('', '/s', '/s^2')[_DERIVATIVES[kind]]
    joint, _, axis = rest.rpartition('.')
    joints = [j.name for j in machine.plan.joints]
    if kind != 'reaction':
        raise InputError(
            f"{machine.name}: '{name}' is no quantity of a response; allowed: "
            'position.COORDINATE, velocity.COORDINATE, acceleration.COORDINATE, '
            'reaction.JOINT.x, reaction.JOINT.y'
        )
    if joint not in joints or axis not in _AXES:
        raise InputError(
            f"{machine.name}: '{name}': expected reaction.JOINT.x or reaction.JOINT.y"
            f'{nearest(joint, joints)}; joints: {", ".join(joints)}'
        )
    return 'N'


def _amplitudes(
    one: LinearMachine,
    name: str,
    w: Array,
    moved: ComplexArray,
    forces: ComplexArray,
    source: Source,
) -> ComplexArray:
    kind, _, rest = name.partition('.')
    if kind in _DERIVATIVES:
        k = one.derivatives.coordinates.index(rest)
        return np.asarray((1j * w) ** _DERIVATIVES[kind] * moved[:, k])
    joint, _, axis = rest.rpartition('.')
    q, v, a, f, size = (x[_AXES.index(axis)] for x in one.derivatives.reaction(joint, one.at))
    found = moved @ q + 1j * w * (moved @ v) - w**2 * (moved @ a) + forces @ f
    return np.asarray(found + (size[0] if source.excitation else 0.0))


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
    one = linearised(machine)
    units = _own_units(one, quantities)
    rates = np.array([machine.held[c][1] for c in machine.plan.prescribed])
    length = _period(machine, rates, period)
    constant, z = _harmonics(one, machine.plan.prescribed, rates, length, count)
    w = 2.0 * np.pi / length * np.arange(1.0, count + 1.0)
    found = {}
    for name in units:
        kind, _, rest = name.partition('.')
        k, order = one.derivatives.coordinates.index(rest), _DERIVATIVES[kind]
        mean = float(constant[k]) if order == 0 else 0.0
        found[name] = FourierSeries(2.0 * np.pi / length, mean, (1j * w) ** order * z[:, k])
    return Harmonics(length, found, units)


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
        found[name] = (1j * w) ** _DERIVATIVES[kind] * amplitude
    source = Source(f'rotation of {main}', '')
    return FrequencyResponse(source, w / (2.0 * np.pi), found, units)


def _own_units(one: LinearMachine, quantities: Sequence[str]) -> dict[str, str]:
    """Units of quantities of coordinates; of the positions of the independent ones if empty."""
    coordinates = one.derivatives.coordinates
    names = quantities or [f'position.{coordinates[i]}' for i in one.independent]
    units = {name: _unit(one, name) for name in names}
    for name in names:
        if name.partition('.')[0] not in _DERIVATIVES:
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
    _refuse_resonance(one, Z[excited], w[excited])
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
