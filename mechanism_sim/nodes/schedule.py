"""When samples are due."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class Schedule:
    """Multiples of a period, handed out once each; `rate` [Hz]."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._next = 0

    def due(self, end: float) -> NDArray[np.float64]:
        """Times [s] before `end` that were not handed out yet."""
        last = max(self._next, int(np.ceil(end * self._rate)))
        t = np.arange(self._next, last + 1) / self._rate
        t = t[t < end]
        self._next += len(t)
        return t
