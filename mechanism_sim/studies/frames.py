"""Steady response of frames on springs (`oscillators` of a scene).

A frame does not move the machine that shakes it. So its response to a force on itself is its
receptance, and that to the machine follows from the forces of the steady motion, joints ideal.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.errors import InputError, check_known
from mechanism_sim.numerics.fourier import PeriodicSpectrum, spectrum
from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.scene.frame_forces import forces_on
from mechanism_sim.scene.load import without_clearance
from mechanism_sim.vibration.periodic_forces import SteadyVibration, known_harmonics
from mechanism_sim.vibration.shaken_frame import Shaking
from mechanism_sim.vibration.systems import impedance

_LONGER = 1.95  # periods that are run, to compare the forces in them
LOOKS = np.array([0.0, 0.1373, 0.2914, 0.4435, 0.6181, 0.7772, 0.9103])  # in periods
_PLAIN, _LOADED = 32, 512
"""Parts of a period, without and with loads, in each of which forces are looked at 16 times."""

PARTS = 'x', 'y', 'angle'


def coordinates_of(machine: Machine) -> dict[str, tuple[str, int]]:
    """The coordinates of all frames, ``FRAME.x``, each with its frame and number."""
    return {
        f'{name}.{part}': (name, k)
        for name in machine.scene.oscillators
        for k, part in enumerate(PARTS[: machine.frame(name).freedom])
    }


def load_on(machine: Machine, option: str, place: str, direction: float | None) -> Array:
    """A force in a direction [rad], or a moment, on a frame (3,): FRAME, or FRAME.MOUNT."""
    name, _, mount = place.partition('.')
    frame, mounts = machine.frame(name), machine.scene.oscillators[name].mounts
    if mount:
        wrong = f"{machine.name}: {option} {place}: the frame {name} has no mount '{mount}'"
        check_known(mount, mounts, wrong, 'mounts:')
    if direction is None:
        if frame.freedom < 3:
            raise InputError(f"{machine.name}: {option} {place}: without 'inertia' it cannot turn")
        return np.array([0.0, 0.0, 1.0])
    push = np.array([np.cos(direction), np.sin(direction)])
    at = mounts[mount].at if mount else frame.cog
    return np.concatenate([frame.motion_of(at).T @ push, np.zeros(3 - frame.freedom)])


class Vibrating(NamedTuple):
    """A linear system: ``M z'' + C z' + K z = F``, all (n, n)."""

    M: Array
    C: Array
    K: Array
    machine: str  #: name of the machine
    what: str  #: of it, behind "a resonance", where it is a part
    advice: str  #: advice on a resonance

    def impedance(self, w: Array) -> ComplexArray:
        """Forces per displacement (N, n, n) at frequencies w (N,) [rad/s]; refuses resonances."""
        Z, size = impedance(self.M, self.C, self.K, w), np.sqrt(np.abs(np.diag(self.M)))
        scale = np.outer(size, size) if size.all() else np.ones_like(self.M)
        values = np.linalg.svd(Z / scale, compute_uv=False)
        M, C, K = (np.abs(x / scale).max(initial=0.0) for x in self[:3])
        singular = values.min(axis=1, initial=np.inf) <= 1e-14 * (K + w * C + w**2 * M)
        if singular.any():
            raise InputError(
                f'{self.machine}: at {w[singular][0] / (2.0 * np.pi):.9g} Hz is a resonance'
                f'{self.what} without damping, where no steady response exists: {self.advice}'
            )
        return Z

    def under(
        self, forces: PeriodicSpectrum, period: float, count: int, B: Array, rounding: float = 0.0,
        impulses: Array | None = None,
    ) -> SteadyVibration:  # fmt: skip
        """The vibration ``B z`` in `count` harmonics under forces that repeat after a period [s].

        Parameters
        ----------
        rounding : size of a mean that is none
        impulses : see `SteadyVibration`
        """
        F = forces.amplitudes[:, :count].T
        w = 2.0 * np.pi / period * np.arange(1.0, count + 1.0)
        excited, z = F.any(axis=1), np.zeros((count, len(self.M)), complex)
        Z = self.impedance(w[excited])
        z[excited] = np.linalg.solve(Z, F[excited][:, :, None])[:, :, 0]
        push = np.where(np.abs(forces.mean) > rounding, forces.mean, 0.0)
        mean = B @ np.linalg.lstsq(self.K, push)[0]
        frequency, moved = 2.0 * np.pi / period, np.asarray(z @ B.T, complex)
        return SteadyVibration(forces, frequency, self[:3], B, mean, moved, impulses)


def system(machine: Machine, name: str) -> Vibrating:
    """A frame by itself."""
    frame, advice = machine.frame(name), "give its mounts 'damping'"
    return Vibrating(frame.M, frame.C, frame.K, machine.name, f' of the frame {name}', advice)


def harmonics_of(
    machine: Machine, names: Sequence[str], count: int, period: float
) -> dict[str, SteadyVibration]:
    """Positions [m, rad] of frames in the steady motion of their machine over a period [s].

    Places count from where the mounts carry the frame alone.
    """
    ideal = without_clearance(machine)
    if ideal.torque_driven:
        raise InputError(
            f'{machine.name}: the vibration of the frame {names[0]} is known where drives '
            'prescribe the whole motion; with free coordinates look at oscillator_state of a run'
        )
    motion = simulate(ideal, duration=_LONGER * period).motion
    found = {}
    for name in names:
        frame = machine.frame(name)
        shaking = Shaking(frame, forces_on(ideal, name))

        def forces(t: Array, shaking: Shaking = shaking) -> Array:
            return shaking.read(motion, *motion.curve.find(t))

        looks = period * LOOKS
        size = float(np.abs(seen := forces(looks)).max())
        if np.abs(forces(period + looks) - seen).max() > 1e-9 * size:
            raise InputError(
                f'{machine.name}: after {period:.6g} s the forces on the frame {name} are not '
                'what they were: give the --period after which they repeat'
            )
        more = known_harmonics(count)
        edges = _edges(motion.curve, period, bool(ideal.scene.loads), more)
        one = spectrum(forces, edges, more, np.full(frame.freedom, 1e-12 * size))
        steps = shaking.steps(motion)
        sudden = steps.any(axis=1) & (motion.curve.start < period * (1.0 - 1e-12))
        w = 2.0 * np.pi / period * np.arange(1.0, more + 1.0)
        turned = np.exp(-1j * np.outer(motion.curve.start[sudden], w))
        one = one._replace(
            mean=one.mean + steps[sudden].sum(axis=0) / period,
            amplitudes=one.amplitudes + 2.0 / period * (steps[sudden].T @ turned),
        ).without(1e-13 * size)
        impulses = np.abs(steps[sudden]).sum(axis=0)
        own = np.eye(frame.freedom)
        found[name] = system(machine, name).under(one, period, count, own, impulses=impulses)
    return found


def _edges(curve: PiecewisePolynomial, period: float, loaded: bool, count: int) -> Array:
    """Ends of the pieces of a motion in its period [s], and between these if they are few."""
    ends = np.append(curve.start[curve.start < period], period)
    parts = max(_LOADED if loaded else _PLAIN, 2 * count)
    return np.union1d(ends, period * np.arange(parts + 1) / parts)
