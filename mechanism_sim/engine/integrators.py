"""Integrators of a run: steps by the cheapest sufficient equations.

Contacts slide most of the time. Equations in which they may stick hold always, but have twice as
many contact forces. And while contacts chatter, events follow each other within microseconds: a
polynomial of full order costs several times as much and is used near its start only.
"""

from __future__ import annotations

import ctypes
import sys

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import floats
from mechanism_sim.engine.system import System
from mechanism_sim.tolerances import TOLERANCES

_STEPS = TOLERANCES.steps


class Integrators:
    """Takes the steps of a run.

    Parameters
    ----------
    rtol, scale, compact : as for `System.integrator`

    Attributes
    ----------
    main : integrator with state, series, time and parameters of the run after every step
    apart : True if another one takes the steps in which a contact sticks
    short : True if steps of low order are allowed
    """

    def __init__(self, system: System, rtol: float, scale: float, compact: bool) -> None:
        self._system, self._tolerance, self._compact = system, (rtol, scale), compact
        f, rate = len(system.free), _STEPS.low_error * rtol * scale
        #: bound of the last terms of coordinates and rates at the end of a step of low order
        self._allowed = np.repeat([system.rounding, rate], [f, system.width - f])
        # what is small takes its steps in rows, and is compiled once
        self.apart = compact and system.slides
        # few contacts chatter too little for a further integrator to be worth its compilation
        rigid = not (system.compliant or system.steep)
        self._chatters = compact and len(system.gaps) > 3 and rigid
        self._sticks = system.parameters.sticks if self.apart else []
        self.main = system.integrator(rtol, scale, compact, self, sticks=not self.apart)
        self._pars = floats(self.main.pars)
        self._others: dict[tuple[bool, int | None], _Substitute] = {}
        self.short = False

    def compile(self) -> None:
        """Compile all code that a run may need."""
        for order in (None, _STEPS.low_order) if self._chatters else (None,):
            for sticks in (True, False) if self.apart else (True,):
                if order or sticks == self.apart:  # else the main one
                    self._other(sticks, order)

    @property
    def short_from(self) -> int:
        """Number of events from which steps of low order pay."""
        return _STEPS.short_from if self._chatters else sys.maxsize

    @property
    def main_holds(self) -> bool:
        """True if the main integrator takes the next step, unless it is one of low order."""
        return not (self.apart and self._stuck)

    def expect(self, events: int) -> None:
        """Choose steps of low order if so many `events` are expected that they pay."""
        self.short = events >= self.short_from

    def step(self, longest: float) -> float:
        """Take a step, up to the first event; returns its length [s]."""
        if self.main_holds:
            return float(self.main.step(longest, True)[1])
        own = self._other(True, None)
        h = own.take(longest)
        own.hand_over(h)
        return h

    def short_step(self, longest: float) -> float | None:
        """Take a step of low order; returns None if its error is too large."""
        low = self._other(not self.apart or self._stuck, _STEPS.low_order)
        h = low.take(longest)
        if not low.leaves(h, self._allowed):
            return None
        low.hand_over(h)
        return h

    @property
    def _stuck(self) -> bool:
        """True if a contact sticks."""
        pars = self._pars
        return any(pars[i] for i in self._sticks)

    def _other(self, sticks: bool, order: int | None) -> _Substitute:
        """Substitute for the main integrator, compiled when it is first needed."""
        key = sticks, order
        if key not in self._others:
            rtol, scale = self._tolerance if order is None else (0.0, 0.0)
            own = self._system.integrator(rtol, scale, self._compact, self, order, sticks)
            self._others[key] = _Substitute(self._system, self.main, own)
        return self._others[key]


class _Substitute:
    """Takes steps instead of another integrator, and updates the other's arrays."""

    def __init__(
        self, system: System, main: hy.taylor_adaptive_dbl, own: hy.taylor_adaptive_dbl
    ) -> None:
        self._main, self._own = main, own
        self._width, self._fired = system.width, system.parameters.fired
        self._state, self._pars = floats(main.state), floats(main.pars)
        self._own_state, self._own_pars = floats(own.state), floats(own.pars)
        # NumPy's view of the series is read-only, for a step writes it anew; so does this one
        data = ctypes.cast(main.tc.ctypes.data, ctypes.POINTER(ctypes.c_double))
        self._series = np.ctypeslib.as_array(data, main.tc.shape)
        self._own_series: Array = own.tc

    def take(self, longest: float) -> float:
        """Take a step from the main one's state, up to the first event; returns its length [s]."""
        own = self._own
        own.time = self._main.time
        self._own_state[:], self._own_pars[:] = self._state, self._pars
        if own.order < self._main.order:  # its length is not set by its error, see `leaves`
            self._own_state[self._width] = 0.0
        own.reset_cooldowns()
        return float(own.step(longest, True)[1])

    def leaves(self, h: float, allowed: Array) -> bool:
        """True if the last terms of a step are at most `allowed` (width,)."""
        order = self._own.order
        last = np.abs(self._own_series[: self._width, order]) * h**order
        return bool((last <= allowed).all())

    def hand_over(self, h: float) -> None:
        """Copy the step just taken, of length `h` [s], to the arrays of the main integrator."""
        width, terms, constant = self._width, self._own.order + 1, self._state[self._width]
        self._series[:, :terms], self._series[:, terms:] = self._own_series, 0.0
        self._state[:], self._pars[self._fired] = self._own_state, self._own_pars[self._fired]
        self._series[width, 0] = self._state[width] = constant
        self._main.time += h
