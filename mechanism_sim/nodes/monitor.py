"""Watches a run from outside, by its progress alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.recording.runs import realtime_factor

Show = Callable[[float, float, int], None]
"""Called with simulated time [s], real-time factor and number of impacts so far."""


class Monitor(SimulationNode):
    """Follows the progress of all partners; no node waits for it.

    Attributes
    ----------
    time : [s] up to which every partner has come
    impacts : published so far
    run_time : [s] since the first progress of the run
    """

    def __init__(self, parameters: Sequence[Parameter] = (), show: Show | None = None) -> None:
        super().__init__('monitor', parameters)
        self.time = 0.0
        self.impacts = 0
        self.run_time = 0.0
        self._show = show
        self._shown = 0.0
        self._heard = time.monotonic()
        self.join()

    def on_progress(self, message: Any) -> None:
        """Show the progress of a partner."""
        if message.run > self.run:
            self.begin_run(message.run)
        self._heard = now = time.monotonic()
        self.run_time = now - (self.first_heard or now)
        self.time = min(self.partners.time, self.duration)
        counts = dict(zip(message.topics, message.counts, strict=True))
        impacts = self.resolve_topic_name('impacts')
        self.impacts = int(counts.get(impacts, self.impacts))
        self.done = self.partners.finished and not self.partners.another_follows
        if self._show and (self.done or now - self._shown > 0.1):
            self._shown = now
            factor = realtime_factor(self.time, self.run_time) or 0.0
            self._show(self.time, factor, self.impacts)

    def idle(self) -> bool:
        """True if nothing more is to be expected: all reports are in, or none came for 1 s."""
        return self.done or time.monotonic() - self._heard > 1.0
