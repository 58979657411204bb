"""Newest motion of a machine that runs, at as many instants as a page needs."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mechanism_sim.analysis.preview import preview
from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.export.stage import StageFrames, Swaying, packed
from mechanism_sim.messages.events import parse_description
from mechanism_sim.messages.segments import foreign, motion_of
from mechanism_sim.pages.recorded import PER_TURN

MOST, FEWEST = 120, 12
"""Instants of a batch: however much time it spans, and however little."""
_KEPT = 256  # messages kept until they are requested; older ones are dropped
_ROUNDING = 1e-12  # of times: tolerance between successive messages
_SLOWEST = 0.01  # [s] between instants where nothing turns
_SEEN = 5.0  # [s] of a motion that does not repeat, by which sizes are chosen


_Sway = Callable[[Array], Array]
"""Sway of frames on springs on a piece of motion, see `Swaying.take`."""


class Live:
    """A running machine, by the messages of its topics, from any time on.

    Attributes
    ----------
    epoch : number of restarts of time
    time : [s] up to which the motion is known here
    impacts : number of impacts so far in the run
    missed : [s] of motion that did not come, since this was last set to zero
    swaying : frames on springs; None where the motion is not known from its start on, by which
        theirs is: they are shown at rest
    """

    def __init__(self, text: str) -> None:
        """`text`: the data of a message on ``scene``. InputError, RunError: no such machine."""
        self.text, self.machine = text, parse_description(text, 'the topic scene')
        self.stage = preview(self.machine, _SEEN)
        self.step = min(self.machine.drive.period / PER_TURN, _SLOWEST)
        self.epoch, self.run = 0, 0
        self._forget()

    def _forget(self) -> None:
        self.time, self.impacts, self.missed = 0.0, 0, 0.0
        self._sent: float | None = None
        self._at_start = False  # to be shown before any motion
        self.swaying: Swaying | None = Swaying(self.machine)
        self._pieces: deque[tuple[Motion, _Sway | None]] = deque(maxlen=_KEPT)
        self._struck: list[dict[str, Any]] = []

    def take(self, message: Any) -> None:
        """Take a Motion message; time restarts with another run."""
        if foreign(message, self.machine):
            return  # of a run whose scene is not yet received
        if message.run != self.run:
            self.epoch, self.run = self.epoch + 1, message.run
            self._forget()
        if not message.segments:
            if not message.known_until:
                self.show_start()
            return
        motion = motion_of(message)
        if motion.curve.end <= self.time:  # the graph has been restarted
            self.epoch += 1
            self._forget()
        begin = float(motion.curve.start[0])
        if begin - self.time > _ROUNDING * max(begin, 1.0):
            self.swaying = None
            if self._sent == 0.0:  # its start was shown
                self.epoch += 1
                self._sent = None
            if self._pieces:
                self.missed += begin - self.time  # earlier parts have no preceding motion
                self._pieces.clear()
        sway = self.swaying.take(motion) if self.swaying else None
        self._pieces.append((motion, sway))
        self.time = motion.curve.end

    def add_impact(self, message: Any) -> None:
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

    @property
    def unknown(self) -> bool:
        """True if nothing can be shown of the run."""
        return self._sent is None and not self._pieces

    def show_start(self) -> None:
        """The run stands at its start."""
        self._at_start = self.unknown

    def batch(self) -> dict[str, Any] | None:
        """Motion since the last call; None if nothing has come.

        The first instant is the last of the batch before, unless what followed it is missing. The
        faster the run, the farther apart the instants are.
        """
        if not self._pieces and self._at_start:
            self._at_start, self._sent = False, 0.0
            start = self.stage.found.solution.motion, None
            frames = self._packed([start], np.zeros(1))
            return {'type': 'frames', 'epoch': self.epoch, 'frames': frames, 'impacts': []}
        if not self._pieces or (self._sent is not None and self._sent >= self.time):
            return None
        first = max(
            float(self._pieces[0][0].curve.start[0]),
            self.time - MOST * self.step if self._sent is None else self._sent,
        )
        count = math.ceil((self.time - first) / self.step - 1e-6)
        t = np.linspace(first, self.time, min(max(count, FEWEST), MOST) + 1)
        frames, struck = self.frames(t), self._struck
        self._sent, self._struck = self.time, []
        while self._pieces[0][0].curve.end < self.time:
            self._pieces.popleft()
        return {'type': 'frames', 'epoch': self.epoch, 'frames': frames, 'impacts': struck}

    def frames(self, t: np.ndarray[Any, np.dtype[np.float64]]) -> dict[str, Any]:
        """Frames at times `t` (N,) [s], which are known here, packed."""
        return self._packed(self._pieces, t)

    def _packed(self, pieces: Sequence[tuple[Motion, _Sway | None]], t: Array) -> dict[str, Any]:
        physics, parts = self.machine.physics, []
        speed, torque = [], []
        starts = [motion.curve.start[0] for motion, _ in pieces]
        of = np.maximum(np.searchsorted(starts, t, side='right') - 1, 0)
        main, row = physics.coordinates.index(self.machine.plan.main), self.machine.drive.row
        for number in np.unique(of).tolist():
            (motion, sway), now = pieces[number], t[of == number]
            k, dt = motion.curve.find(now)
            seen = physics.observe(motion, k, dt)
            moved = sway(now) if sway else None
            parts.append(self.stage.frames(now, seen, motion.modes[k].T, moved))
            speed.append(seen.velocity[main])
            torque.append(seen.drive_torque[row] if len(seen.drive_torque) else np.zeros(len(now)))
        rates = {'speed': np.concatenate(speed), 'torque': np.concatenate(torque)}
        frames = StageFrames.joined(parts)
        return frames.packed() | {name: packed(x.astype('<f4')) for name, x in rates.items()}
