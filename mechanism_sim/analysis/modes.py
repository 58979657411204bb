"""How long each joint with clearance follows, and how long it flies."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from mechanism_sim.hybrid.events import Mode, ModeChange


@dataclass(frozen=True)
class JointModes:
    """The modes of one joint over a run: `share` by name of the mode sums to 1."""

    joint: str
    changes: int
    share: dict[str, float]


class ModeShares:
    """Adds up the time between changes of mode: exact, since every change is recorded."""

    def __init__(self) -> None:
        self._first: dict[str, ModeChange] = {}
        self._last: dict[str, ModeChange] = {}
        self._changes: dict[str, int] = defaultdict(int)
        self._time: dict[str, dict[Mode, float]] = defaultdict(lambda: defaultdict(float))

    def add(self, changes: Iterable[ModeChange]) -> None:
        """Enter the changes that follow."""
        for change in changes:
            joint = change.joint
            if joint in self._last:
                last = self._last[joint]
                self._time[joint][last.mode] += change.t - last.t
            else:
                self._first[joint] = change
            self._last[joint] = change
            # the first mode of a run is announced, not changed to
            self._changes[joint] += change.previous != Mode.UNKNOWN

    def summary(self, start: float, end: float) -> tuple[JointModes, ...]:
        """The shares over the span of the run from `start` to `end` [s]."""
        joints = []
        for joint in sorted(self._first):
            time = dict(self._time[joint])
            first, last = self._first[joint], self._last[joint]
            for lasted, mode in ((first.t - start, first.previous), (end - last.t, last.mode)):
                time[mode] = time.get(mode, 0.0) + max(0.0, lasted)
            span = sum(time.values())
            share = {
                mode.name.lower(): lasted / span
                for mode, lasted in sorted(time.items())
                if lasted > 0
            }
            joints.append(JointModes(joint, self._changes[joint], share))
        return tuple(joints)
