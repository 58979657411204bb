"""Simulated time relative to wall time."""

from __future__ import annotations

import time

AHEAD = 0.1
"""[s] of wall time by which a law is announced before it is due, and partners may be late."""

BEHIND = 0.95
"""Share of the real-time factor asked for below which it is said."""


class Pace:
    """Pacing: simulated time as a multiple of wall time since the last restart."""

    def __init__(self) -> None:
        self._wall, self._sim, self._factor = time.monotonic(), 0.0, 0.0
        self._seen = self._wall, 0.0

    def restart(self, now: float) -> None:
        """Restart at the simulated time `now` [s]."""
        self._wall, self._sim = time.monotonic(), now
        self._seen = self._wall, now

    def due(self, factor: float, announced: float) -> float:
        """Due time [s] of a law that is announced to `announced` [s].

        With slow partners the law has not come so far: of such a delay `AHEAD` is caught up
        and the rest is not, so that a stall is followed by time at the set factor, not faster.
        """
        wall = time.monotonic()
        if factor != self._factor:
            self._wall, self._sim, self._factor = wall, announced, factor
        due = self._sim + (wall - self._wall) * factor
        late = due - announced - AHEAD * factor
        if late > 0.0:
            self._sim -= late
            due -= late
        return due

    def measure_factor(self, now: float) -> float:
        """Simulated seconds per second since the last call; `now` is simulated time [s]."""
        wall, (before, then) = time.monotonic(), self._seen
        self._seen = wall, now
        return max(0.0, now - then) / (wall - before) if wall > before else 0.0
