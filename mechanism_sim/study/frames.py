"""Steady response of frames on springs (`oscillators` of a scene).

A frame does not move the machine that shakes it. So its response to a force on itself is its
receptance, and that to the machine follows from the forces of the steady motion, joints ideal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.scene import Machine
from mechanism_sim.scene.oscillators import forces_on, read_frame
from mechanism_sim.scene.simulate import simulate
from mechanism_sim.vibration.excitation import FourierSeries
from mechanism_sim.vibration.frame import Frame
from mechanism_sim.vibration.shaking import Shaking

ComplexArray = NDArray[np.complex128]

PARTS = 'x', 'y', 'angle'
_PLAYS = 'clearance', 'lift_off', 'groove', 'backlash'


def coordinates_of(machine: Machine) -> dict[str, tuple[str, int]]:
    """The coordinates of all frames, ``FRAME.x``, each with its frame and number."""
    return {
        f'{name}.{part}': (name, k)
        for name in machine.scene.oscillators
        for k, part in enumerate(PARTS[: read_frame(machine, name).freedom])
    }


def load_on(machine: Machine, option: str, place: str, direction: float | None) -> Array:
    """A force in a direction [rad], or a moment, on a frame (3,): FRAME, or FRAME.MOUNT.

    Raises
    ------
    InputError
        If there is no such mount, or a frame that cannot turn gets a moment.
    """
    name, _, mount = place.partition('.')
    frame, mounts = read_frame(machine, name), machine.scene.oscillators[name].mounts
    if mount and mount not in mounts:
        raise InputError(
            f"{machine.name}: {option} {place}: the frame {name} has no mount '{mount}'"
            f'{nearest(mount, mounts)}; mounts: {", ".join(mounts)}'
        )
    if direction is None:
        if frame.freedom < 3:
            raise InputError(f"{machine.name}: {option} {place}: without 'inertia' it cannot turn")
        return np.array([0.0, 0.0, 1.0])
    push = np.array([np.cos(direction), np.sin(direction)])
    at = mounts[mount].at if mount else frame.cog
    return np.concatenate([frame.motion_of(at).T @ push, np.zeros(3 - frame.freedom)])


def receptance(machine: Machine, name: str, w: Array) -> ComplexArray:
    """Displacements per force (N, n, n) of a frame at angular frequencies w (N,) [rad/s].

    Raises
    ------
    InputError
        At a resonance without damping.
    """
    frame: Frame = read_frame(machine, name)
    each = np.asarray(w, float)[:, None, None]
    Z = np.asarray(frame.K + 1j * each * frame.C - each**2 * frame.M, complex)
    size = np.sqrt(np.diag(frame.M))
    scaled = np.abs(np.linalg.eigvals(Z / np.outer(size, size))).min(axis=1)
    singular = scaled <= 1e-13 * np.abs(frame.K / np.outer(size, size)).max()
    if singular.any():
        f = w[singular][0] / (2.0 * np.pi)
        raise InputError(
            f'{machine.name}: at {f:.9g} Hz is a resonance of the frame {name} without damping, '
            "where no steady response exists: give its mounts 'damping'"
        )
    return np.linalg.inv(Z)


def harmonics_of(
    machine: Machine, names: Sequence[str], count: int, period: float
) -> dict[str, list[FourierSeries]]:
    """Positions [m, rad] of frames in the steady motion of their machine over a period [s].

    Places count from where the mounts carry the frame alone.

    Raises
    ------
    InputError
        If the machine's ideal motion does not follow from its drives, or does not repeat itself.
    """
    ideal = without_play(machine)
    if ideal.torque_driven:
        raise InputError(
            f'{machine.name}: the vibration of the frame {names[0]} is known where drives '
            'prescribe the whole motion; with free coordinates look at oscillator_state of a run'
        )
    samples = max(512, 16 * count)
    motion = simulate(ideal, duration=1.01 * period).motion
    t = period * np.arange(samples + 1) / samples
    found = {}
    for name in names:
        frame = read_frame(machine, name)
        shaking = Shaking(frame, forces_on(ideal, name))
        forces = shaking.read(motion, *motion.curve.find(t))
        size = np.abs(forces).max()
        if np.abs(forces[:, -1] - forces[:, 0]).max() > 1e-9 * size:
            raise InputError(
                f'{machine.name}: after {period:.6g} s the forces on the frame {name} are not '
                'what they were: give the --period after which they repeat'
            )
        series = [FourierSeries.of_samples(f, period) for f in forces[:, :-1]]
        w = series[0].frequencies[:count]
        amplitudes = np.array([s.amplitudes[:count] for s in series]).T
        amplitudes[np.abs(amplitudes) <= 1e-13 * size] = 0.0
        shaken = amplitudes.any(axis=1)
        u = np.zeros_like(amplitudes)
        if shaken.any():
            at = receptance(machine, name, w[shaken])
            u[shaken] = np.einsum('kij,kj->ki', at, amplitudes[shaken])
        mean = np.linalg.solve(frame.K, [s.mean for s in series])
        found[name] = [
            FourierSeries(2.0 * np.pi / period, float(x), z)
            for x, z in zip(mean, u.T, strict=True)
        ]
    return found


def without_play(machine: Machine) -> Machine:
    """The same machine without play."""
    if not machine.clearances:
        return machine
    joints = {
        name: joint.model_copy(update=dict.fromkeys(_PLAYS))
        if name in machine.clearances
        else joint
        for name, joint in machine.scene.joints.items()
    }
    return replace(machine, scene=machine.scene.model_copy(update={'joints': joints}))
