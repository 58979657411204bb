"""DOP853 with its dense output, compiled for right-hand sides of fixed size.

Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.5 and II.6; the coefficients
are those of SciPy.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.integrate import DOP853

STAGES = 12
ROWS = 16  #: rows of K: stages, rate at the end, and three more for the dense output

_A = np.zeros((ROWS, ROWS))
_A[:STAGES, :STAGES], _A[STAGES, :STAGES], _A[STAGES + 1 :] = DOP853.A, DOP853.B, DOP853.A_EXTRA
_C = np.concatenate([DOP853.C, [1.0], DOP853.C_EXTRA])
_E3, _E5, _D = DOP853.E3, DOP853.E5, DOP853.D


@njit(error_model='numpy')
def resize(h, error):
    """Next step size, as SciPy's."""
    if error == 0.0:
        return 10.0 * h
    return h * min(10.0, max(0.2, 0.9 * error**-0.125))


def stepper(rate, size):
    """Compiled functions ``(step, densify, dense)`` for ``rate(t, y, p, out)``.

    `rate` writes the rates (size,) to `out` and returns a guard. With K (16, size), whose row 0
    holds the rates at the start,

    * ``step(t, y, h, K, p, rtol, atol, new)`` writes the state after h to `new`, fills 13 rows and
      returns error/tolerance, and the least, greatest and last guard among the stages;
    * ``densify(t, y, h, K, p, new, F)`` fills the rest of K and the polynomial F (7, size);
    * ``dense(y, F, x, out)`` writes the state at the fraction x of the step.
    """

    @njit(fastmath=True, error_model='numpy')
    def stage(i, t, y, h, K, p, z):
        for k in range(size):
            z[k] = 0.0
        for j in range(i):
            a = _A[i, j]
            if a != 0.0:
                for k in range(size):
                    z[k] += a * K[j, k]
        for k in range(size):
            z[k] = y[k] + h * z[k]
        return rate(t + _C[i] * h, z, p, K[i])

    @njit(fastmath=True, error_model='numpy')
    def step(t, y, h, K, p, rtol, atol, new):
        low, high, last = np.inf, -np.inf, 0.0
        for i in range(1, STAGES + 1):
            last = stage(i, t, y, h, K, p, new)
            low, high = min(low, last), max(high, last)
        fifth = third = 0.0
        for k in range(size):
            e5 = e3 = 0.0
            for j in range(STAGES + 1):
                e5 += _E5[j] * K[j, k]
                e3 += _E3[j] * K[j, k]
            scale = atol[k] + rtol * max(abs(y[k]), abs(new[k]))
            fifth += (e5 / scale) ** 2
            third += (e3 / scale) ** 2
        if fifth == 0.0:
            return 0.0, low, high, last
        error = abs(h) * fifth / np.sqrt((fifth + 0.01 * third) * size)
        return error, low, high, last

    @njit(fastmath=True, error_model='numpy')
    def densify(t, y, h, K, p, new, F):
        for i in range(STAGES + 1, ROWS):
            stage(i, t, y, h, K, p, F[0])
        for k in range(size):
            delta = new[k] - y[k]
            F[0, k] = delta
            F[1, k] = h * K[0, k] - delta
            F[2, k] = 2.0 * delta - h * (K[STAGES, k] + K[0, k])
            for i in range(4):
                total = 0.0
                for j in range(ROWS):
                    total += _D[i, j] * K[j, k]
                F[3 + i, k] = h * total

    @njit(fastmath=True, error_model='numpy')
    def dense(y, F, x, out):
        for k in range(size):
            value = 0.0
            for i in range(6, -1, -1):
                value = (value + F[i, k]) * (x if i % 2 == 0 else 1.0 - x)
            out[k] = y[k] + value

    return step, densify, dense
