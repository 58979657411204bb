"""Taylor steps of low order, for those that an event ends soon after the last.

While contacts chatter, events follow each other within microseconds: a polynomial of full order
costs several times as much and is used near its start only.
"""

from __future__ import annotations

import ctypes
from functools import cached_property

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import floats
from mechanism_sim.engine.system import System
from mechanism_sim.tolerances import TOLERANCES

_STEPS = TOLERANCES.steps


class ShortSteps:
    """Takes steps in the place of an integrator where they are short enough for a low order.

    Parameters
    ----------
    full : the integrator of full order, whose state, series and parameters are set
    compact : as that is compiled
    place, rate : what the last terms of coordinates [rad, m] and rates may be at the end of a step
    """

    def __init__(
        self,
        system: System,
        full: hy.taylor_adaptive_dbl,
        compact: bool,
        place: float,
        rate: float,
    ) -> None:
        self._system, self._full, self._compact = system, full, compact
        f = len(system.free)
        self._allowed = np.repeat([place, rate], [f, system.width - f])
        self._fired = system.parameters.fired
        self._state, self._pars = floats(full.state), floats(full.pars)
        # NumPy's view of the series is read-only, for a step writes it anew; so does this one
        data = ctypes.cast(full.tc.ctypes.data, ctypes.POINTER(ctypes.c_double))
        self._series = np.ctypeslib.as_array(data, full.tc.shape)

    @cached_property
    def _low(self) -> tuple[hy.taylor_adaptive_dbl, Array, memoryview[float], memoryview[float]]:
        low = self._system.integrator(0.0, 0.0, self._compact, self, _STEPS.low_order)
        return low, low.tc, floats(low.state), floats(low.pars)

    def step(self, tau: float, longest: float) -> float | None:
        """Length of a step from `tau`, up to the first event; None if the order is too low."""
        low, series, state, pars = self._low
        width, order = self._system.width, _STEPS.low_order
        constant = self._state[width]
        low.time = tau
        state[:], pars[:] = self._state, self._pars
        state[width] = 0.0
        low.reset_cooldowns()
        h = low.step(longest, True)[1]
        last = np.abs(series[:width, order]) * h**order
        if not (last <= self._allowed).all():
            return None
        self._series[:, : order + 1], self._series[:, order + 1 :] = series, 0.0
        self._series[width, 0] = state[width] = constant
        self._state[:], self._pars[self._fired] = state, pars[self._fired]
        self._full.time = tau + h
        return float(h)
