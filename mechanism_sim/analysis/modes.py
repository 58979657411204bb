"""How long each joint with clearance follows, and how long it flies."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import Any

from mechanism_sim.hybrid.events import Mode

#: Modes by number, as in the message ModeChange.
MODES = {mode.value: mode.name.lower() for mode in Mode}


@dataclass(frozen=True)
class JointModes:
    """The modes of one joint over a run: `share` by name of the mode sums to 1."""

    joint: str
    changes: int
    share: dict[str, float]


class ModeCollector:
    """Adds up the time between ModeChange messages: exact, since every change is one."""

    def __init__(self) -> None:
        self._first: dict[str, tuple[float, int]] = {}
        self._last: dict[str, tuple[float, int]] = {}
        self._changes: dict[str, int] = defaultdict(int)
        self._time: dict[str, dict[int, float]] = defaultdict(lambda: defaultdict(float))

    def add(self, message: Any) -> None:
        """Add the change that follows."""
        joint, time, mode = message.joint, float(message.time), int(message.mode)
        if joint in self._last:
            since, before = self._last[joint]
            self._time[joint][before] += time - since
        else:
            self._first[joint] = (time, int(message.previous_mode))
        self._last[joint] = (time, mode)
        # The first mode of a run is announced, not changed to.
        self._changes[joint] += message.previous_mode != 0

    def summary(self, start: float, end: float) -> tuple[JointModes, ...]:
        """Return the shares over the span of the run from `start` to `end` [s]."""
        joints = []
        for joint in sorted(self._first):
            time = dict(self._time[joint])
            (first, before), (last, mode) = self._first[joint], self._last[joint]
            for lasted, of in ((first - start, before), (end - last, mode)):
                time[of] = time.get(of, 0.0) + max(0.0, lasted)
            span = sum(time.values())
            share = {
                MODES.get(of, f'mode_{of}'): lasted / span
                for of, lasted in sorted(time.items())
                if lasted > 0
            }
            joints.append(JointModes(joint, self._changes[joint], share))
        return tuple(joints)
