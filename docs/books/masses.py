"""Masses on springs and dampers: starts, forces, frequency response ([V] 6.13).

Where the modes of the undamped system diagonalise C too (proportional damping), each modal
coordinate is an `Oscillator`; otherwise the state-space solution is taken.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
import state_space
from numpy.typing import ArrayLike, NDArray
from oscillator import FreeResponse, Oscillator

from mechanism_sim.errors import InputError
from mechanism_sim.vibration.systems import LinearSystem, state_matrix

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: condition number of damped modes beyond which sums over them lose more than six digits
DEPENDENT = 1e6


class DampedModes(NamedTuple):
    """Roots and amplitudes of free vibrations under any damping, [V] eqs. 6.185 to 6.198."""

    roots: ComplexArray  #: (2n,) [1/s], by imaginary part
    shapes: ComplexArray  #: (n, 2n), an amplitude vector in each column

    def free(self, t: ArrayLike, displacement: ArrayLike, velocity: ArrayLike) -> FreeResponse:
        """Free vibration as a sum of exponentials, [V] eqs. 6.197, 6.198."""
        whole = np.concatenate([self.shapes, self.shapes * self.roots])
        if np.linalg.cond(whole / np.linalg.norm(whole, axis=0)) > DEPENDENT:
            raise InputError(
                'damped modes with repeated roots cannot be summed: take MassSystem.free'
            )
        share = np.linalg.solve(whole, np.concatenate([displacement, velocity]).astype(complex))
        states = whole @ (share[:, None] * np.exp(np.outer(self.roots, np.atleast_1d(t))))
        return FreeResponse(*np.split(states.real, 2))


class MassSystem(LinearSystem):
    """A linear system with its free and forced vibrations."""

    @property
    def state_matrix(self) -> Array:
        """A (2n, 2n) of x' = A x, x = (y, y')."""
        return state_matrix(self.mass, self.damping, self.stiffness)

    @property
    def damped_modes(self) -> DampedModes:
        """Roots of the characteristic equation and their amplitude vectors, largest entry 1."""
        roots, vectors = scipy.linalg.eig(self.state_matrix)
        order = np.lexsort((roots.real, roots.imag))
        shapes = vectors[: len(self.mass), order]
        largest = shapes[np.abs(shapes).argmax(axis=0), range(shapes.shape[1])]
        return DampedModes(roots[order], shapes / largest)

    def impedance(self, frequency: ArrayLike) -> ComplexArray:
        """Force amplitudes per displacement (..., n, n) [N/m] at frequencies (...) [rad/s].

        The dynamic stiffness K - w^2 M + i w C, [V] eqs. 6.205 to 6.209.
        """
        w = np.asarray(frequency, np.float64)[..., None, None]
        return np.asarray(self.stiffness - w**2 * self.mass + 1j * w * self.damping)

    def receptance(self, frequency: ArrayLike) -> ComplexArray:
        """Displacement amplitudes per force (..., n, n) [m/N], the inverse of the impedance.

        Raises
        ------
        numpy.linalg.LinAlgError
            At a resonance without damping.
        """
        return np.asarray(np.linalg.inv(self.impedance(frequency)))

    def steady(self, force: ArrayLike, frequency: ArrayLike) -> ComplexArray:
        """Complex amplitudes (..., n) [m] under the force amplitudes (..., n) [N]."""
        F = np.asarray(force, complex)[..., None]
        return np.asarray(np.linalg.solve(self.impedance(frequency), F)[..., 0])

    def free(self, t: ArrayLike, displacement: ArrayLike, velocity: ArrayLike) -> FreeResponse:
        """Free vibration (n, N) at times t (N,) [s] from displacement and velocity (n,)."""
        modes = self.modes
        if modes.decay_rates is None:
            start = np.concatenate([displacement, velocity])
            return FreeResponse(*np.split(state_space.free(self.state_matrix, t, start), 2))
        q0, v0 = (modes.shapes.T @ self.mass @ np.asarray(x) for x in (displacement, velocity))
        coordinates = Oscillator(modes.frequencies[:, None], modes.decay_rates[:, None])
        q = coordinates.free(np.atleast_1d(t), q0[:, None], v0[:, None])
        return FreeResponse(modes.shapes @ q.displacement, modes.shapes @ q.velocity)

    def forced(
        self,
        t: ArrayLike,
        force: ArrayLike,
        frequency: float,
        displacement: ArrayLike,
        velocity: ArrayLike,
    ) -> FreeResponse:
        """Response (n, N) to harmonic forces that begin at t = 0, at any frequency.

        Parameters
        ----------
        t : times (N,) [s]
        force : complex amplitudes (n,) [N]
        frequency : of the force [rad/s]
        displacement, velocity : at t = 0, (n,)
        """
        modes = self.modes
        if modes.decay_rates is None:
            start = np.concatenate([displacement, velocity])
            b = state_space.input_vector(self.mass, force)
            states = state_space.forced(self.state_matrix, t, b, [frequency], start)
            return FreeResponse(*np.split(states, 2))
        push = (modes.shapes.T @ np.asarray(force))[:, None]
        coordinates = Oscillator(modes.frequencies[:, None], modes.decay_rates[:, None])
        q = coordinates.forced(np.atleast_1d(t), push, frequency)
        free = self.free(t, displacement, velocity)
        return FreeResponse(
            free.displacement + modes.shapes @ q.displacement,
            free.velocity + modes.shapes @ q.velocity,
        )


def chain(masses: ArrayLike, stiffnesses: ArrayLike, dampings: ArrayLike = 0.0) -> MassSystem:
    """Masses in a row between springs and dampers, [V] eqs. 6.138 to 6.142.

    Parameters
    ----------
    masses : (n,) [kg]
    stiffnesses : (n,) or (n + 1,) [N/m]: of the spring before each mass, the first one from the
        ground (0 for a free end), and of one behind the last
    dampings : as many [N s/m], or one for all
    """
    m = np.atleast_1d(np.asarray(masses, np.float64))
    k = np.atleast_1d(np.asarray(stiffnesses, np.float64))
    if len(k) not in {len(m), len(m) + 1}:
        raise InputError(f'{len(m)} masses in a row take {len(m)} springs, or one more')
    try:
        c = np.broadcast_to(np.asarray(dampings, np.float64), k.shape)
    except ValueError:
        raise InputError(f'{len(k)} springs take {len(k)} dampers') from None
    if (k < 0.0).any() or (c < 0.0).any():
        raise InputError('springs and dampers of a row are not negative')
    return MassSystem(np.diag(m), _row(c, len(m)), _row(k, len(m)))


def _row(values: Array, n: int) -> Array:
    """Matrix (n, n) of elements between neighbours."""
    across = np.diff(np.eye(n + 2, n, -1), axis=0)[: len(values)]  # elongations per displacement
    return np.asarray(across.T @ (values[:, None] * across))
