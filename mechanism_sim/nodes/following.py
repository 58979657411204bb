"""Following a motion that another node publishes; schedules of its samples."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.engine.dense_output import Motion as MotionBatch
from mechanism_sim.messages import Motion
from mechanism_sim.messages.segments import foreign, motion_of
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.numerics.polynomials import first_due

ROUNDING = 1e-9
"""Relative rounding of times at which consecutive pieces of motion meet."""


class MotionFollower:
    """Follower of all motion of a run, which ends with the run.

    Its first run is the one that is heard first: others may have been before it was started.

    Parameters
    ----------
    take : callback with every piece of motion
    end : callback after the last piece
    reset : callback at the start of another run
    """

    def __init__(
        self,
        node: SimulationNode,
        take: Callable[[MotionBatch], None],
        end: Callable[[], None] = lambda: None,
        reset: Callable[[], None] = lambda: None,
    ) -> None:
        self._node, self._take, self._end, self._reset = node, take, end, reset
        self._time, self._ended = 0.0, False
        self._heard_run = False  # until then the number of the run is not known
        node.create_subscription(Motion, 'motion', node.once_ready(self._on_motion), RESULTS)
        self._topic = node.resolve_topic_name('motion')
        node.before_report, node.after_report = self._hear_first, self.look

    def begin(self) -> None:
        """Start of a run: nothing to do, the motion will be received."""

    def _hear_first(self, number: int) -> None:
        """Begin the run that is heard first."""
        heard, self._heard_run = self._heard_run, True
        if not heard and number != self._node.run:
            self._begin_run(number)

    def _begin_run(self, number: int) -> None:
        self._node.begin_run(number)
        self._time, self._ended = 0.0, False
        self._reset()

    def _on_motion(self, message: Any) -> None:
        self._hear_first(message.run)
        if not self._node.partners.goes_on(message.run):
            return
        if message.run != self._node.run:
            self._begin_run(message.run)
        if message.segments:
            motion = motion_of(message)
            if reason := self._foreign(message, motion):
                self._node.ignore(self._topic, reason)
                return
            self._time = motion.curve.end
            self._take(motion)
        if message.known_until > self._time or not message.segments:
            self._node.report(message.known_until)  # the drive may be waiting for this
        else:
            self._node.report_soon(self._time)
        self.look()

    def _foreign(self, message: Any, motion: MotionBatch) -> str:
        """Reason why a piece of motion is not the next one of this run; else empty."""
        if reason := foreign(message, self._node.machine):
            return reason
        begin = float(motion.curve.start[0])
        if abs(begin - self._time) > ROUNDING * max(1.0, begin):
            return f'it begins at {begin:.9g} s, but the motion is known up to {self._time:.9g} s'
        return ''

    def look(self) -> None:
        """End if all motion announced by its publisher's last report has been received."""
        node = self._node
        known = [p for p in node.partners.reports.values() if p.run == node.run]
        sources = [p for p in known if self._topic in p.topics]
        if self._ended or not sources or not all(p.finished for p in sources):
            return
        # The end of a piece is a sum that may round to the float before the reported one.
        end = max(p.time for p in sources)
        if self._time < math.nextafter(end, 0.0):
            return
        self._end()
        self._ended, again = True, node.partners.another_follows
        node.report(end, finished=True, again=again)
        node.done = not again


class Schedule:
    """Multiples of a period, each returned once; `rate` [Hz]."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._next = 0

    def due(self, end: float) -> NDArray[np.float64]:
        """Times [s] before `end` not yet returned."""
        first, self._next = self._next, max(self._next, first_due(end, self._rate))
        return np.arange(first, self._next) / self._rate
