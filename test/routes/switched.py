"""Equations that switch, integrated from event to event: by SciPy, in pieces that are smooth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]

_BEYOND = 1e-9
"""[s] over which a guard is looked at to know its sign behind an event."""


def switched(
    rates: Callable[[float, Array, Sequence[bool]], ArrayLike],
    guards: Callable[[float, Array], Sequence[float]],
    start: ArrayLike,
    end: float,
    scale: ArrayLike = 1.0,
) -> Array:
    """The state (n,) at the time `end` [s].

    Parameters
    ----------
    rates : of time, state, and which of the guards are positive
    guards : functions of time and state between whose zeros the rates are smooth
    scale : sizes of the variables, to which errors are relative
    """
    t, size = 0.0, np.broadcast_to(np.asarray(scale, float), np.shape(start))
    y = np.asarray(start, float) / size

    def rate(positive: Sequence[bool], t: float, y: Array) -> Array:
        return np.asarray(rates(t, y * size, positive) / size, float)

    def guard(k: int, t: float, y: Array) -> float:
        return float(guards(t, y * size)[k])

    positive = _signs(guards, rate, t, y, size, [g > 0.0 for g in guards(t, y * size)])
    while t < end:
        events = [partial(guard, k) for k in range(len(positive))]
        for event, high in zip(events, positive, strict=True):
            event.terminal, event.direction = True, -1.0 if high else 1.0  # type: ignore[attr-defined]
        found = solve_ivp(
            partial(rate, positive), (t, end), y, 'DOP853', rtol=1e-13, atol=1e-14, events=events
        )
        t, y = float(found.t[-1]), found.y[:, -1]
        if found.status == 1:
            positive = [
                high != bool(len(times))
                for high, times in zip(positive, found.t_events, strict=True)
            ]
    return np.asarray(y * size)


def _signs(
    guards: Callable[[float, Array], Sequence[float]],
    rate: Callable[[Sequence[bool], float, Array], Array],
    t: float,
    y: Array,
    size: Array,
    positive: Sequence[bool],
) -> list[bool]:
    """The signs right behind the start, also of what is zero there."""
    ahead = (y + _BEYOND * rate(positive, t, y)) * size
    return [g > 0.0 for g in guards(t + _BEYOND, ahead)]
