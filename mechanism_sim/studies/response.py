"""Steady response of a scene to harmonic forces and base motions.

Linear about the static equilibrium, as in `mechanism_sim.studies.modes`.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.errors import InputError, check_known, nearest
from mechanism_sim.keys.names import scene_errors
from mechanism_sim.planar.linearisation import Excitation
from mechanism_sim.planar.points import GROUND
from mechanism_sim.results.quantities.motion import DERIVATIVES, RATES
from mechanism_sim.scene import Machine
from mechanism_sim.studies import frames
from mechanism_sim.studies.modes import (
    LinearMachine,
    derivatives,
    kept,
    linearised,
    turning,
    warn_over_turn,
)
from mechanism_sim.vibration.systems import impedance

_AXES = ('x', 'y')


@dataclass(frozen=True)
class HarmonicSource:
    """Harmonic excitation of the machine, with an amplitude of one in SI units."""

    name: str  #: requested name
    unit: str  #: unit of its amplitude
    excitation: Excitation | None = None  #: a force or a moment, or
    base: str | None = None  #: a driven coordinate that moves about its place, or
    frame: tuple[str, Array] | None = None  #: a frame on springs and the load (3,) on it


@dataclass(frozen=True)
class FrequencyResponse:
    """Complex amplitudes by quantity, per unit of the source."""

    source: HarmonicSource  #: source of the excitation
    frequency: Array  #: (N,) [Hz]
    #: (N,) by quantity; the angle is how far it leads the source
    amplitudes: dict[str, ComplexArray]
    units: dict[str, str]  #: units of the quantities

    @property
    def unresolved(self) -> dict[str, list[float]]:
        """Frequencies [Hz] of peaks narrower than the steps, whose heights are not known.

        At the frequency beside such a peak there is less than half of its power.
        """
        found = {}
        for name, z in self.amplitudes.items():
            y = np.abs(z)
            before, here, after = y[:-2], y[1:-1], y[2:]
            top = (here > before) & (here >= after)
            narrow = top & (np.minimum(before, after) < math.sqrt(0.5) * here)
            if narrow.any():
                found[name] = self.frequency[1:-1][narrow].tolist()
        return found


def read_source(
    machine: Machine,
    force: str | None = None,
    direction: float | None = None,
    torque: str | None = None,
    base: str | None = None,
) -> HarmonicSource:
    """A source from names of the scene.

    Parameters
    ----------
    force : ``LINK.POINT`` at which a force acts, in a `direction` of the world [rad]
    torque : link on which a moment acts
    base : driven coordinate that moves
    """
    if sum(x is not None for x in (force, torque, base)) != 1:
        raise InputError('give one of --force LINK.POINT, --torque LINK and --base COORDINATE')
    if (force is None) != (direction is None):
        raise InputError("--force and --direction belong together, as in --direction '90 deg'")
    if base is not None:
        prescribed = machine.plan.prescribed
        wrong = f"{machine.name}: --base '{base}' is not a coordinate that a drive prescribes"
        check_known(base, prescribed, wrong, 'such are:')
        straight = base in machine.plan.ideal.displacements
        return HarmonicSource(f'base {base}', 'm' if straight else 'rad', base=base)
    option, reference = ('--force', force) if force is not None else ('--torque', torque)
    if str(reference).partition('.')[0] in machine.scene.oscillators:
        own = frames.load_on(machine, option, str(reference), direction)
        name = f'{option.strip("-")} {reference}'
        unit = 'N m' if direction is None else 'N'
        return HarmonicSource(name, unit, frame=(str(reference).partition('.')[0], own))
    with scene_errors(machine.name):
        point = machine.plan.find(option, str(reference))
    if point[0] == GROUND:
        raise InputError(f'{machine.name}: {option} {reference}: the ground does not move')
    if direction is None:
        return HarmonicSource(f'torque {torque}', 'N m', Excitation(point, None))
    way = (math.cos(direction), math.sin(direction))
    return HarmonicSource(f'force {force}', 'N', Excitation(point, way))


def response(
    machine: Machine,
    source: HarmonicSource,
    quantities: Sequence[str],
    frequency: Array,
    speed: float = 0.0,
) -> FrequencyResponse:
    """The frequency response of quantities to a source.

    Parameters
    ----------
    quantities : ``position.COORDINATE``, ``velocity.``, ``acceleration.``, ``reaction.JOINT.x``,
        ``reaction.JOINT.y``; the first of every free coordinate if empty
    frequency : (N,) [Hz]
    speed : constant speed of the main drive [rad/s]
    """
    if not (np.isfinite(frequency).all() and (frequency >= 0.0).all()):
        raise InputError('frequencies must be finite and not negative')
    if source.frame:
        return _frame_response(machine, source, quantities, np.asarray(frequency, float))
    for quantity in quantities:
        if quantity.partition('.')[2] in frames.coordinates_of(machine):
            raise InputError(
                f"{machine.name}: '{quantity}': a frame answers to a force on itself, as --force "
                'FRAME, and to its machine by --harmonics'
            )
    known = None
    if speed:
        turning(machine, '--speed')
        known = derivatives(machine, source.excitation, kept(machine))
    one = linearised(machine, source.excitation, speed=speed, known=known)
    warn_over_turn(one, speed)
    units = units_of(one, quantities)
    w = 2.0 * np.pi * np.asarray(frequency, float)
    reactions = any(name.startswith('reaction.') for name in units)
    if source.excitation and not reactions and not (one.B.T @ one.linear.input).any():
        raise InputError(
            f'{machine.name}: a {source.name} moves nothing: drives or guides hold the link '
            'against it; choose another link or direction'
        )
    moved, forces = _steady(one, source, w)
    found = {name: _amplitudes(one, name, w, moved, forces, source) for name in units}
    return FrequencyResponse(source, np.asarray(frequency, float), found, units)


def _frame_response(
    machine: Machine, source: HarmonicSource, quantities: Sequence[str], frequency: Array
) -> FrequencyResponse:
    """Frequency response of a frame on springs to a load on itself."""
    assert source.frame  # noqa: S101 - the caller looked
    name, load = source.frame
    known = {c: k for c, (frame, k) in frames.coordinates_of(machine).items() if frame == name}
    units = frame_units(machine, quantities or [f'position.{c}' for c in known], known)
    w = 2.0 * np.pi * frequency
    u = np.linalg.inv(frames.system(machine, name).impedance(w)) @ load[: len(known)]
    found = {}
    for quantity in units:
        kind, _, c = quantity.partition('.')
        found[quantity] = differentiated(u[:, known[c]], w, kind)
    return FrequencyResponse(source, frequency, found, units)


def frame_units(
    machine: Machine, quantities: Sequence[str], known: Collection[str]
) -> dict[str, str]:
    """Units of quantities of frames; refuses others."""
    units = {}
    for quantity in quantities:
        kind, _, c = quantity.partition('.')
        if kind not in DERIVATIVES or c not in known:
            raise InputError(
                f"{machine.name}: '{quantity}' is not a quantity of this "
                f'frame{nearest(c, known)}; allowed: position., velocity. and acceleration. of '
                f'{", ".join(known)}'
            )
        unit = 'rad' if c.endswith('.angle') else 'm'
        units[quantity] = unit + RATES[kind]
    return units


def _steady(
    one: LinearMachine, source: HarmonicSource, w: Array
) -> tuple[ComplexArray, ComplexArray]:
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
    Z = impedance(linear.M, linear.C, linear.K, w)
    push = linear.input - Z @ D
    z = np.linalg.solve(one.system.impedance(w), (push @ B)[:, :, None])[:, :, 0]
    moved = np.asarray(z @ B.T + D, complex)
    left = (np.einsum('kij,kj->ki', Z, moved) - linear.input)[:, free]
    if not len(linear.J):
        return moved, np.zeros((len(w), 0), complex)
    forces = np.linalg.lstsq(linear.J[:, free].T.astype(complex), left.T)[0].T
    return moved, np.asarray(forces, complex)


def differentiated(amplitude: ComplexArray, w: Array, kind: str) -> ComplexArray:
    """Amplitudes (N,) of a position, velocity or acceleration by those of the position."""
    return np.asarray((1j * w) ** DERIVATIVES[kind] * amplitude)


def units_of(one: LinearMachine, quantities: Sequence[str]) -> dict[str, str]:
    """Units of quantities; of the positions of the independent coordinates if empty."""
    coordinates = one.derivatives.coordinates
    names = quantities or [f'position.{coordinates[i]}' for i in one.independent]
    return {name: _unit_of(one, name) for name in names}


def _unit_of(one: LinearMachine, name: str) -> str:
    """Unit of a quantity; refuses those that are not known."""
    kind, _, rest = name.partition('.')
    machine, coordinates = one.machine, one.derivatives.coordinates
    if kind in DERIVATIVES:
        wrong = f"{machine.name}: '{name}': there is no coordinate '{rest}'"
        check_known(rest, coordinates, wrong, 'coordinates:')
        unit = 'm' if rest in machine.plan.ideal.displacements else 'rad'
        return unit + RATES[kind]
    joint, _, axis = rest.rpartition('.')
    joints = [j.name for j in machine.plan.joints]
    if kind != 'reaction':
        raise InputError(
            f"{machine.name}: '{name}' is not a quantity of a response; allowed: "
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
    source: HarmonicSource,
) -> ComplexArray:
    kind, _, rest = name.partition('.')
    if kind in DERIVATIVES:
        k = one.derivatives.coordinates.index(rest)
        return differentiated(moved[:, k], w, kind)
    joint, _, axis = rest.rpartition('.')
    q, v, a, f, size = (x[_AXES.index(axis)] for x in one.derivatives.reaction(joint, one.at))
    found = moved @ q + 1j * w * (moved @ v) - w**2 * (moved @ a) + forces @ f
    return np.asarray(found + (size[0] if source.excitation else 0.0))
