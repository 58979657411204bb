"""What a page shows of a machine that runs: its newest motion, at as many instants as it needs."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np

from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.messages.events import described
from mechanism_sim.messages.segments import motion_of
from mechanism_sim.nodes.force_markers import preview
from mechanism_sim.pages.recorded import PER_TURN
from mechanism_sim.pages.stage import Frames, packed, stage_of

MOST = 120
"""Instants of a batch; what is older than they reach is not shown."""
_SLOWEST = 0.01  # [s] between instants where nothing turns
_SEEN = 5.0  # [s] of a motion that does not repeat, by which sizes are chosen


class Live:
    """A machine that runs, by the messages of its topics; it may be heard from any time on.

    Attributes
    ----------
    epoch : counts how often time began anew
    time : [s] up to which the motion is known here
    impacts : so far in the run
    """

    def __init__(self, text: str) -> None:
        """`text`: the data of a message on ``scene``. InputError, RunError: no such machine."""
        self.text, self.machine = text, described(text, 'the topic scene')
        seen = preview(self.machine, _SEEN)
        t = seen.found.t
        self.stage = stage_of(self.machine, seen.found.solution.samples(t).observed)
        self.step = min(self.machine.period / PER_TURN, _SLOWEST)
        self.epoch, self.run = 0, 0
        self._names = tuple(self.machine.physics.coordinates)
        self._forget()

    def _forget(self) -> None:
        self.time, self.impacts = 0.0, 0
        self._sent: float | None = None
        self._pieces: deque[Motion] = deque()
        self._struck: list[dict[str, Any]] = []

    def take(self, message: Any) -> None:
        """A Motion message; of another run, time begins anew."""
        if tuple(message.coordinates) != self._names:
            return  # of a run whose scene is not here yet
        if message.run != self.run:
            self.epoch, self.run = self.epoch + 1, message.run
            self._forget()
        if not message.segments:
            return
        motion = motion_of(message)
        if motion.curve.end <= self.time:  # the graph has been started anew
            self.epoch += 1
            self._forget()
        self._pieces.append(motion)
        self.time = motion.curve.end
        while self._pieces[0].curve.end < self.time - MOST * self.step:
            self._pieces.popleft()

    def strike(self, message: Any) -> None:
        """An Impact message."""
        self.impacts = int(message.index) + 1
        if len(self._struck) < MOST:
            bearing, joint = self.stage.struck(message.joint)
            self._struck.append(
                {
                    't': message.time,
                    'bearing': bearing,
                    'joint': joint,
                    'angle': message.normal_angle,
                    'impulse': message.normal_impulse,
                    'approach': message.approach_speed,
                    'rebound': message.rebound_speed,
                }
            )

    def batch(self) -> dict[str, Any] | None:
        """What has come since the last call; None if nothing has.

        The first instant is the last of the batch before, unless too much came meanwhile.
        """
        if not self._pieces or (self._sent is not None and self._sent >= self.time):
            return None
        first = max(
            float(self._pieces[0].curve.start[0]),
            self.time - MOST * self.step,
            self._sent if self._sent is not None else -math.inf,
        )
        t = np.linspace(first, self.time, math.ceil((self.time - first) / self.step - 1e-6) + 1)
        self._sent, struck = self.time, self._struck
        self._struck = []
        return {
            'type': 'frames',
            'epoch': self.epoch,
            'frames': self.frames(t),
            'impacts': struck,
        }

    def frames(self, t: np.ndarray[Any, np.dtype[np.float64]]) -> dict[str, Any]:
        """What is shown at times `t` (N,) [s], which are known here, packed."""
        physics, parts = self.machine.physics, []
        speed, torque = [], []
        starts = [motion.curve.start[0] for motion in self._pieces]
        of = np.maximum(np.searchsorted(starts, t, side='right') - 1, 0)
        main = physics.coordinates.index(self.machine.main)
        for number in np.unique(of).tolist():
            motion, now = self._pieces[number], t[of == number]
            k, dt = motion.curve.find(now)
            seen = physics.observe(motion, k, dt)
            parts.append(self.stage.frames(now, seen, motion.modes[k].T))
            speed.append(seen.velocity[main])
            torque.append(seen.drive_torque[0] if len(seen.drive_torque) else np.zeros(len(now)))
        rates = {'speed': np.concatenate(speed), 'torque': np.concatenate(torque)}
        frames = Frames.joined(parts)
        return frames.packed() | {name: packed(x.astype('<f4')) for name, x in rates.items()}
