"""Events at instants: impacts, changes of mode, and why a run stopped."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from enum import Enum, IntEnum
from itertools import groupby
from typing import Any, NamedTuple, Self, overload

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, IndexArray, Mask
from mechanism_sim.engine.contact.problem import (
    FLIES,
    FOLLOWS,
    RECOVERS,
    SLIDES_BACKWARD,
    SLIDES_FORWARD,
    STICKS,
)
from mechanism_sim.errors import RunError, check_known
from mechanism_sim.tolerances import TOLERANCES


class Mode(IntEnum):
    """Mode of contact of a joint with clearance; the numbers are those of ModeChange.msg."""

    UNKNOWN = 0
    FREE_FLIGHT = FLIES  # 1
    FOLLOWING = FOLLOWS  # closed, without friction, or left without it by others that stick
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

    t: float  #: time [s]; of a touch, its end
    joint: str
    normal_angle: float  #: [rad] of the direction from bushing centre to pin centre
    approach_speed: float  #: [m/s]
    rebound_speed: float  #: [m/s]
    normal_impulse: float  #: [N s]
    tangential_impulse: float  #: [N s]
    energy_loss: float  #: [J]
    drive_impulse: float  #: [N m s] of the drives that hold their law
    drive_work: float  #: [J] work of these impulses
    ends_chatter: bool  #: whether the rest of a chatter sequence is contained in this impact
    chatter_time: float = 0.0  #: [s] duration of that rest, which is left out
    duration: float = 0.0  #: [s] duration of a touch
    peak_force: float = 0.0  #: [N] largest normal force of a touch

    @property
    def sudden_loss(self) -> float:
        """Energy [J] lost at the instant `t`: 0 for a touch, whose loss is in the motion's."""
        return 0.0 if self.duration else self.energy_loss


_FIELDS = {name: k for k, name in enumerate(Impact._fields)}
_JOINT, _ENDS = _FIELDS['joint'], _FIELDS['ends_chatter']
_NUMBERS = {name: k for name, k in _FIELDS.items() if k != _JOINT}


class Impacts(Sequence[Impact]):
    """Impacts in the order of their events, as columns; an `Impact` is made when it is read.

    Parameters
    ----------
    joints : names of joints
    rows : (n, fields) of the impacts, as `Impact` has them; of the joint its index in `joints`
    """

    __hash__ = None  # type: ignore[assignment]

    def __init__(self, joints: Sequence[str] = (), rows: Array | None = None) -> None:
        self.joints = tuple(joints)
        self.rows = np.zeros((0, len(_FIELDS))) if rows is None else rows

    @classmethod
    def of(cls, impacts: Iterable[Impact]) -> Self:
        """The impacts of a list, or these themselves."""
        if isinstance(impacts, cls):
            return impacts
        columns: list[Any] = [*zip(*impacts, strict=True)]
        if not columns:
            return cls()
        index = {name: k for k, name in enumerate(dict.fromkeys(columns[_JOINT]))}
        columns[_JOINT] = [index[name] for name in columns[_JOINT]]
        return cls([*index], np.array(columns, float).T)

    @classmethod
    def joined(cls, parts: Iterable[Iterable[Impact]]) -> Self:
        """All impacts of several parts."""
        known = [x for x in map(cls.of, parts) if len(x)]
        if len(known) < 2:
            return known[0] if known else cls()
        joints = [*dict.fromkeys(name for x in known for name in x.joints)]
        rows = np.concatenate([x.rows for x in known])
        rows[:, _JOINT] = np.concatenate([
            np.array([joints.index(name) for name in x.joints])[x.gaps] for x in known
        ])  # fmt: skip
        return cls(joints, rows)

    @property
    def gaps(self) -> IndexArray:
        """Index (n,) of the joint of each impact in `joints`."""
        return self.rows[:, _JOINT].astype(np.intp)

    @property
    def names(self) -> NDArray[np.str_]:
        """Name (n,) of the joint of each impact."""
        return np.array(self.joints or [''], str)[self.gaps]

    def column(self, field: str) -> Array:
        """A field (n,) of all impacts, in the unit that `Impact` has: its own array.

        Raises
        ------
        InputError
            If it is no field of numbers; joints are `joints` at `gaps`.
        """
        check_known(field, _NUMBERS, f"impacts have no column of numbers '{field}'", 'they have')
        return self.rows[:, _NUMBERS[field]].copy()

    def with_column(self, field: str, values: Array) -> Self:
        """The impacts with another field (n,)."""
        rows = self.rows.copy()
        rows[:, _FIELDS[field]] = values
        return type(self)(self.joints, rows)

    @property
    def sudden_loss(self) -> Array:
        """Energies (n,) [J] lost at the instants, as of `Impact.sudden_loss`."""
        return np.where(self.column('duration') != 0.0, 0.0, self.column('energy_loss'))

    @property
    def exchange(self) -> Array:
        """Work of the drives and energy lost at the instants (n, 2) [J]."""
        return np.stack([self.column('drive_work'), self.sudden_loss], axis=1)

    def where(self, chosen: Mask) -> Self:
        """Impacts of a mask (n,)."""
        return type(self)(self.joints, self.rows[chosen])

    def of_joint(self, joint: str) -> Self:
        """Impacts in a joint."""
        return self.where(self.gaps == (*self.joints, joint).index(joint))

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Impact]:
        columns: list[Iterable[object]] = self.rows.T.tolist()
        columns[_JOINT] = [self.joints[k] for k in self.gaps.tolist()]
        columns[_ENDS] = map(bool, columns[_ENDS])
        return map(Impact._make, zip(*columns, strict=True))

    @overload
    def __getitem__(self, k: int) -> Impact: ...
    @overload
    def __getitem__(self, k: slice) -> Self: ...
    def __getitem__(self, k: int | slice) -> Impact | Self:
        if isinstance(k, slice):
            return type(self)(self.joints, self.rows[k])
        [found] = type(self)(self.joints, self.rows[k][None])
        return found

    def __add__(self, other: Iterable[Impact]) -> Self:
        return self.joined([self, other])

    def __radd__(self, other: Iterable[Impact]) -> Self:
        return self.joined([other, self])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and [*self] == [*other]

    def __repr__(self) -> str:
        return repr([*self])


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
        # rows of steps have room for an event in each of them, from the first on
        self.rows = np.empty((4 * TOLERANCES.steps.row * max(1, len(joints)), width))
        self.count = 0

    def reserve(self, more: int) -> None:
        """Make room for some more rows."""
        if self.count + more > len(self.rows):
            more += len(self.rows)
            self.rows = np.concatenate([self.rows, np.empty((more, self.rows.shape[1]))])

    def _taken(self) -> Array:
        """Rows of the events since the last call."""
        count, self.count = self.count, 0
        return self.rows[:count]


class ImpactLog(EventLog):
    """Impacts; columns as `contact.problem` names them."""

    def __init__(self, joints: Sequence[str]) -> None:
        super().__init__(joints, 12)

    def drain(self) -> Impacts:
        """The impacts since the last call."""
        rows = self._taken()
        found = np.zeros((len(rows), len(_FIELDS)))
        found[:, : rows.shape[1]] = rows
        return Impacts(self._joints, found)


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
        t, gaps, modes, previous = self._taken().T.tolist()
        names = [self._joints[int(gap)] for gap in gaps]
        new, old = ([Mode(int(x)) for x in row] for row in (modes, previous))
        return [*map(ModeChange._make, zip(t, names, new, old, strict=True))]


def gains(impacts: Iterable[Impact]) -> list[float]:
    """Energy made [J] at every instant of impacts, negative where it was lost.

    Contacts in one impact pass energy to each other; only their sum says what was made.
    """
    return [-sum(i.energy_loss for i in group) for _, group in groupby(impacts, lambda i: i.t)]
