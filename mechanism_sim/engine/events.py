"""Events at instants: impacts, changes of mode, and why a run stopped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import Enum, IntEnum
from itertools import groupby
from typing import NamedTuple

import numpy as np

from mechanism_sim.engine.contact.problem import (
    FLIES,
    FOLLOWS,
    RECOVERS,
    SLIDES_BACKWARD,
    SLIDES_FORWARD,
    STICKS,
)
from mechanism_sim.errors import RunError


class Mode(IntEnum):
    """Mode of contact of a joint with clearance; the numbers are those of ModeChange.msg."""

    UNKNOWN = 0
    FREE_FLIGHT = FLIES  # 1
    FOLLOWING = FOLLOWS  # closed, without friction
    STICKING = STICKS  # closed, held by friction: the pin rolls
    SLIDING_FORWARD = SLIDES_FORWARD  # closed, with friction; the tangential velocity is positive
    SLIDING_BACKWARD = SLIDES_BACKWARD
    RECOVERING = RECOVERS  # compliant: the links overlap still, but part faster than they press


class StopReason(Enum):
    """Reason for the end of a run, with its text for the user."""

    COMPLETE = 'the requested duration was reached'
    GAP_VIOLATED = 'a gap was violated between events: the result cannot be trusted'
    TENSILE_CONTACT = 'a contact force became tensile: the result cannot be trusted'
    ENERGY_UNBALANCED = 'the energy balance is violated: the result cannot be trusted'
    NO_PROGRESS = 'events follow each other without progress in time'


def ends_meet(name: str, t: float) -> RunError:
    """The error of a force along a line that has no length at a time [s]."""
    return RunError(
        f'the ends of {name} meet at t = {t:.9g} s, where its '
        'force has no direction; one without free_length and damping may pass there'
    )


def drawn_in(rope: str, t: float) -> RunError:
    """The error of a rope of which a stretch has no length at a time [s]."""
    return RunError(
        f'{rope} has a stretch without length at t = {t:.9g} s, where points or pulleys of it '
        'meet: end the run before, or stop what draws them together'
    )


def leaves_pulley(rope: str, pulley: str, t: float) -> RunError:
    """The error of a rope that is straight where a pulley turns it, at a time [s]."""
    return RunError(
        f'{rope} leaves {pulley}, after t = {t:.6g} s: from there on it is straight; end the run '
        'before, hold the pulley back, or lead the rope through a point without a radius'
    )


class Impact(NamedTuple):
    """One impact in one joint, or one touch of a compliant contact, which takes its time.

    A touch lasts as long as the links overlap. Its loss is part of the motion's, and the drive
    works on it by its torque, not by an impulse. What touches from the start on is no impact.
    """

    t: float  #: [s] of a touch, its end
    joint: str
    normal_angle: float  #: [rad] of the direction from bushing centre to pin centre
    approach_speed: float  #: [m/s]
    rebound_speed: float  #: [m/s]
    normal_impulse: float  #: [N s]
    tangential_impulse: float  #: [N s]
    energy_loss: float  #: [J]
    drive_impulse: float  #: [N m s] of the drives that hold their law
    drive_work: float  #: [J] of these impulses
    ends_chatter: bool  #: the rest of a chatter sequence is contained in this impact
    chatter_time: float = 0.0  #: [s] how long that rest would have lasted
    duration: float = 0.0  #: [s] of a touch
    peak_force: float = 0.0  #: [N] largest normal force of a touch

    @property
    def sudden_loss(self) -> float:
        """Energy [J] that is lost at `t`, beside what the motion loses: none of a touch."""
        return 0.0 if self.duration else self.energy_loss


class ModeChange(NamedTuple):
    """A joint enters a mode of contact."""

    t: float  #: [s]
    joint: str
    mode: Mode
    previous: Mode


class EventLog:
    """Events in the order in which they happen, as rows of numbers.

    Attributes
    ----------
    rows : (n, width); the first `count` are filled
    """

    def __init__(self, joints: Sequence[str], width: int) -> None:
        self._joints = joints
        self.rows = np.empty((64, width))
        self.count = 0

    def reserve(self, more: int) -> None:
        """Make room for some more rows."""
        if self.count + more > len(self.rows):
            more += len(self.rows)
            self.rows = np.concatenate([self.rows, np.empty((more, self.rows.shape[1]))])

    def _taken(self) -> tuple[list[float], list[str], Iterable[list[float]]]:
        """Times, names of joints and other columns of the events since the last call."""
        t, gaps, *others = self.rows[: self.count].T.tolist()
        self.count = 0
        return t, [self._joints[int(gap)] for gap in gaps], others


class ImpactLog(EventLog):
    """Impacts; columns as `contact.problem` names them."""

    def __init__(self, joints: Sequence[str]) -> None:
        super().__init__(joints, 12)

    def drain(self) -> list[Impact]:
        """The impacts since the last call."""
        t, names, (*others, ends, left) = self._taken()
        none = [0.0] * len(t)
        columns = zip(t, names, *others, map(bool, ends), left, none, none, strict=True)
        return [*map(Impact._make, columns)]


class ModeLog(EventLog):
    """Changes of mode: time, index of the gap, mode, and that before."""

    def __init__(self, joints: Sequence[str]) -> None:
        super().__init__(joints, 4)

    def enter(self, t: float, gap: int, mode: int, previous: int) -> None:
        """Enter a change."""
        self.reserve(1)
        self.rows[self.count] = t, gap, mode, previous
        self.count += 1

    def drain(self) -> list[ModeChange]:
        """The changes since the last call."""
        t, names, (modes, previous) = self._taken()
        new, old = ([Mode(int(x)) for x in row] for row in (modes, previous))
        return [*map(ModeChange._make, zip(t, names, new, old, strict=True))]


def gains(impacts: Iterable[Impact]) -> list[float]:
    """Energy made [J] at every instant of impacts, negative where it was lost.

    Contacts in one impact pass energy to each other; only their sum says what was made.
    """
    return [-sum(i.energy_loss for i in group) for _, group in groupby(impacts, lambda i: i.t)]
