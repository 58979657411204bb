"""The drive of the crank: publishes the law of the crank's motion, and paces the run."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

from mechanism_sim.messages import Clock, DriveLaw, stamp
from mechanism_sim.messages.events import drive_law
from mechanism_sim.middleware import Parameter
from mechanism_sim.nodes.process import main_of
from mechanism_sim.nodes.qos import CLOCK, RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode


class CrankDrive(SimulationNode):
    """Announces the law of the crank ahead of the slowest partner, by credit.

    Parameters of the node, besides those of every node: ``lead`` [s], how far the law is announced
    ahead of the slowest partner; ``realtime_factor``, simulated seconds per second, 0 for as fast
    as possible.
    """

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('crank_drive', parameters)
        self.declare_parameter('lead', 3.0)
        self.declare_parameter('realtime_factor', 0.0)
        self._announced = 0.0
        self._final = False
        self._laws = self.machine.laws
        self._law = 0
        self._drive = self.create_publisher(DriveLaw, 'drive', RESULTS)
        self._clock_publisher = self.create_publisher(Clock, '/clock', CLOCK)
        self.join()

    def on_ready(self) -> None:
        """Start the clock and give the first credit."""
        self._began = time.monotonic()
        self.create_timer(0.01, self._tick)
        self._extend()

    def on_progress(self, message: Any) -> None:
        """Somebody has moved on: perhaps there is credit to give."""
        self._extend()
        self.done = self._final and self.partners_finished()

    def _tick(self) -> None:
        if not self._final:
            self._clock_publisher.publish(Clock(clock=stamp(min(self.partners_time(), 1e9))))
            self._extend()
        elif not self.partners:
            self.done = True

    def _extend(self) -> None:
        """Announce the law for as long as the slowest partner and the pace allow."""
        if self._final:
            return
        lead, factor, end = self.value('lead'), self.value('realtime_factor'), self.duration
        horizon = self.partners_time() + lead
        if factor > 0.0:
            horizon = min(horizon, (time.monotonic() - self._began + 0.1) * factor)
        horizon = min(horizon, end)
        if horizon < min(end, self._announced + 0.1 * (lead if factor <= 0.0 else 0.05 * factor)):
            return
        self._final = horizon >= end
        while True:
            later = self._laws[self._law + 1 :]
            change = later[0].valid_from if later else math.inf
            self._announce(min(horizon, change), self._final and horizon <= change)
            if horizon <= change:
                break
            self._law += 1
        self._announced = horizon
        self.report(horizon, finished=self._final)
        if self._final and math.isfinite(self.partners_time()):
            self.done = self.partners_finished()

    def _announce(self, until: float, final: bool) -> None:
        """The present law holds until then."""
        law = self._laws[self._law]
        message = drive_law(law, self._law + 1, float(until), final, self._announced)
        self.send(self._drive, message)


def main(args: list[str] | None = None) -> None:
    """Run this node by itself."""
    main_of(CrankDrive, args)


if __name__ == '__main__':
    main()
