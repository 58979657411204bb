"""Simulated time relative to wall time."""

from __future__ import annotations

import time

AHEAD = 0.1
"""[s] of wall time by which a law is announced before it is due, and partners may be late."""

BEHIND = 0.95
"""Share of the real-time factor asked for below which it is said."""

_LEAST = 2.0
"""[s] of wall time over which a factor is measured at least: it is late by `AHEAD` and early."""


class Pace:
    """Pacing: simulated time as a multiple of wall time since the last restart."""

    def __init__(self) -> None:
        self._wall, self._sim, self._factor = time.monotonic(), 0.0, 0.0
        self._seen = self._wall, 0.0
        self._measured: float | None = None

    def restart(self, now: float) -> None:
        """Restart at the simulated time `now` [s]."""
        self._wall, self._sim = time.monotonic(), now
        self._seen, self._measured = (self._wall, now), None

    def due(self, factor: float, announced: float) -> float:
        """Due time [s] of a law that is announced to `announced` [s].

        With slow partners the law has not come so far: of such a delay `AHEAD` is caught up
        and the rest is not, so that a stall is followed by time at the set factor, not faster.
        """
        if factor != self._factor:
            self.restart(announced)
            self._factor = factor
        wall = time.monotonic()
        due = self._sim + (wall - self._wall) * factor
        late = due - announced - AHEAD * factor
        if late > 0.0:
            self._sim -= late
            due -= late
        return due

    def measure_factor(self, now: float) -> float | None:
        """Simulated seconds per second of late; None soon after a restart.

        Parameters
        ----------
        now : simulated time [s]
        """
        wall, (before, then) = time.monotonic(), self._seen
        if wall - before >= _LEAST:
            self._seen, self._measured = (wall, now), max(0.0, now - then) / (wall - before)
        return self._measured
