"""The state-space solution: x' = A x + b(t) with x = (y, y'), by the matrix exponential.

It holds for any damping, repeated roots included, and checks all closed forms of this room. A
harmonic force is made by further states, so that the exponential is the exact solution too.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def input_vector(mass: Array, force: ArrayLike) -> ComplexArray:
    """Input b (2n,) of a force (n,) [N] on the coordinates, complex as its amplitude."""
    acceleration = np.linalg.solve(mass, np.asarray(force, complex))
    return np.concatenate([np.zeros_like(acceleration), acceleration])


def free(A: Array, t: ArrayLike, start: ArrayLike) -> Array:
    """States (2n, N) at times t (N,) [s] from the state `start` (2n,) at t = 0."""
    balanced, (scale, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True)
    times = np.atleast_1d(np.asarray(t, np.float64))
    x0 = np.asarray(start, np.float64) / scale
    return np.asarray(scale[:, None] * (scipy.linalg.expm(balanced * times[:, None, None]) @ x0).T)


def forced(
    A: Array, t: ArrayLike, inputs: ArrayLike, frequencies: ArrayLike, start: ArrayLike
) -> Array:
    """States (2n, N) under harmonic inputs that begin at t = 0.

    Parameters
    ----------
    A : (2n, 2n)
    t : times (N,) [s]
    inputs : complex amplitudes b, (k, 2n)
    frequencies : (k,) [rad/s]; 0 for a constant
    start : state at t = 0, (2n,)
    """
    b, w = np.atleast_2d(np.asarray(inputs, complex)), np.atleast_1d(frequencies)
    n = len(A)
    generators = [np.array([[0.0, -f], [f, 0.0]]) for f in w]  # of (cos, sin)
    whole = scipy.linalg.block_diag(A, *generators)
    whole[:n, n::2], whole[:n, n + 1 :: 2] = b.real.T, -b.imag.T
    x0 = np.concatenate([np.asarray(start, np.float64), np.tile([1.0, 0.0], len(w))])
    return free(whole, t, x0)[:n]


def steady(A: Array, b: ArrayLike, frequency: float) -> ComplexArray:
    """Complex amplitudes (2n,) of the steady state under the input b e^(i w t), b (2n,).

    Raises
    ------
    numpy.linalg.LinAlgError
        At a resonance without damping.
    """
    return np.asarray(np.linalg.solve(1j * frequency * np.eye(len(A)) - A, np.asarray(b)))
