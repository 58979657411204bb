"""DOP853 on the equations of Andrews' squeezer mechanism, compiled as one function by numba."""

from __future__ import annotations

import numpy as np
from numba import njit

from benchmarks.kernels.dop853 import ROWS, STAGES, resize, stepper
from benchmarks.squeezer import rates

_rate = njit(error_model='numpy')(rates)
_step, _, _ = stepper(_rate, 14)


@njit(error_model='numpy')
def integrate(p, start, end, rtol):
    """State (14,) at `end` [s], and the number of steps."""
    y, new, K = start.copy(), np.empty(14), np.empty((ROWS, 14))
    atol = np.full(14, 0.1 * rtol)
    t, h, steps = 0.0, 1e-6, 0
    _rate(t, y, p, K[0])
    while t < end:
        h = min(h, end - t)
        error, _, _, _ = _step(t, y, h, K, p, rtol, atol, new)
        if error <= 1.0:
            t = end if h == end - t else t + h
            y[:], K[0], steps = new, K[STAGES], steps + 1
        h = resize(h, error)
    return y, steps
