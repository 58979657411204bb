"""Simulated against wall time."""

from __future__ import annotations

import time

AHEAD = 0.1
"""[s] of wall time by which a law is announced before it is due."""


class Pace:
    """Keeps simulated time at a factor of wall time since it last began to go."""

    def __init__(self) -> None:
        self._wall, self._sim, self._factor = time.monotonic(), 0.0, 0.0
        self._seen = self._wall, 0.0

    def restart(self, now: float) -> None:
        """Simulated time is `now` [s] and goes on from here."""
        self._wall, self._sim = time.monotonic(), now
        self._seen = self._wall, now

    def limit(self, factor: float, now: float, lead: float) -> float:
        """Time [s] up to which a law may be announced that is announced to `now` [s].

        It is at most `lead` [s] ahead. A delay is not caught up, unless the factor
        changes.
        """
        if factor != self._factor:
            self._factor = factor
            self.restart(now)
        elapsed = time.monotonic() - self._wall
        return self._sim + elapsed * factor + min(AHEAD * factor, lead)

    def measure_factor(self, now: float) -> float:
        """Simulated seconds per second since this was last asked; `now` is [s] simulated."""
        wall, (before, then) = time.monotonic(), self._seen
        self._seen = wall, now
        return max(0.0, now - then) / (wall - before) if wall > before else 0.0
