"""A bag of a run of a sweep: its scene, laws, motion and events, written without middleware.

The motion is polynomials, so samples are not recorded: they follow at any rate.
"""

from __future__ import annotations

import math
from itertools import zip_longest
from pathlib import Path
from typing import Any, Self

from mechanism_sim.messages import events, message_class, serialize
from mechanism_sim.messages.segments import pack, row_names
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
from mechanism_sim.results.run import Piece
from mechanism_sim.scene import Machine
from mechanism_sim.studies.runs import file_errors

_RESULTS = Qos('reliable', 'volatile', 'keep_all', 1000)
_LATCHED = Qos('reliable', 'transient_local', 'keep_last', 1)
_TOPICS = {
    '/scene': ('std_msgs/msg/String', _LATCHED),
    '/drive': ('mechanism_sim/msg/DriveLaw', _RESULTS),
    '/motion': ('mechanism_sim/msg/Motion', _RESULTS),
    '/impacts': ('mechanism_sim/msg/Impact', _RESULTS),
    '/mode_changes': ('mechanism_sim/msg/ModeChange', _RESULTS),
}


class RunBag:
    """The bag of one run; one that is there already is replaced.

    Parameters
    ----------
    end : end of the run [s]

    Raises
    ------
    FileError
        From any method: nothing can be written there.
    """

    def __init__(self, file: Path, machine: Machine, end: float) -> None:
        with file_errors():
            self._writer = BagWriter(file, overwrite=True)
        self._names = (row_names(machine), machine.physics.clearances)
        self._impacts = 0
        for topic, (kind, qos) in _TOPICS.items():
            self._writer.add_topic(topic, kind, qos)
        scene = message_class('std_msgs/msg/String')(data=events.describe(machine))
        self._write('/scene', scene, 0.0)
        laws = machine.drive.laws_until(end)
        for n, (law, later) in enumerate(zip_longest(laws, laws[1:]), 1):
            until = min(later.valid_from if later else math.inf, end)
            self._write('/drive', events.drive_law(law, n, until, until >= end, 0.0), 0.0)

    def add(self, piece: Piece) -> None:
        """Append the piece that follows."""
        motion = piece.motion
        for change in piece.modes:
            self._write('/mode_changes', events.mode_change(change), change.t)
        if len(motion):
            message = pack(motion, *self._names, motion.curve.end)
            self._write('/motion', message, float(motion.curve.start[0]))
        for impact in piece.impacts:
            self._write('/impacts', events.impact(impact, self._impacts), impact.t)
            self._impacts += 1

    def _write(self, topic: str, message: Any, t: float) -> None:
        with file_errors():
            self._writer.write(topic, serialize(message), round(1e9 * t))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_failure: object) -> None:
        with file_errors():
            self._writer.close()
