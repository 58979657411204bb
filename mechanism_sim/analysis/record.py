"""A recorded run as a whole: its machine, motion, events, sensors, and revolutions as its clock.

The summary of a bag needs one pass and little memory. What is asked for here needs the machine,
rebuilt from the recorded scene, and all of the motion: then everything that can be asked of a
simulation is available of a bag: scene and polynomials are all that a solution consists of, so
forces and signals need not be recorded.
"""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from mechanism_sim.analysis.collectors import Signal, SignalCollectors, measured
from mechanism_sim.analysis.published import PARTS
from mechanism_sim.arrays import Array
from mechanism_sim.engine.audit import Audit
from mechanism_sim.engine.dense_output import GrowingMotion, Motion
from mechanism_sim.engine.energy_terms import EnergyTerms
from mechanism_sim.engine.events import Impact, Impacts, Mode, ModeChange
from mechanism_sim.engine.plotting import Rich
from mechanism_sim.errors import InputError, RunWarning, check_known, nearest
from mechanism_sim.messages.events import parse_description
from mechanism_sim.messages.segments import motion_of, row_names
from mechanism_sim.numerics.polynomials import TWO_PI, PiecewisePolynomial
from mechanism_sim.planar.gaps import gaps_of
from mechanism_sim.recording.inventory import prefix_of, scene_text
from mechanism_sim.recording.reader import Bag, read_bag
from mechanism_sim.results.catalogue import flat
from mechanism_sim.results.quantity import Quantity
from mechanism_sim.results.run import Piece, part_of, signal_table
from mechanism_sim.results.turns import turns_at
from mechanism_sim.scene import Machine
from mechanism_sim.scene.sensors import SENSORS
from mechanism_sim.sensing.spectra import TurnSegments
from mechanism_sim.tables import Table
from mechanism_sim.units import counted, instant

#: Last part of the name, and type, of the analysed topics.
KINDS = {
    'drive': 'mechanism_sim/msg/DriveLaw',
    'motion': 'mechanism_sim/msg/Motion',
    'impacts': 'mechanism_sim/msg/Impact',
    'mode_changes': 'mechanism_sim/msg/ModeChange',
    'joint_reactions': 'mechanism_sim/msg/JointReactions',
    'linkage_state': 'mechanism_sim/msg/LinkageState',
    'cam_state': 'mechanism_sim/msg/CamState',
    'gear_state': 'mechanism_sim/msg/GearState',
    'geneva_state': 'mechanism_sim/msg/GenevaState',
    'oscillator_state': 'mechanism_sim/msg/OscillatorState',
    'sensors': 'mechanism_sim/msg/SensorBlock',
    'progress': 'mechanism_sim/msg/Progress',
}
#: Kinds known by type alone: every sensor or node may have a topic of its own, of any name.
SHARED = ('sensors', 'progress')
#: Topics that are no longer read, with the version of bags that ended them.
_RETIRED = {'mechanism_sim/msg/AccelerometerBlock': 2}
_LEVELS = {'sensors': 2}  # KIND/NAME
_RUN = 'motion', 'impacts', 'mode_changes'
_PART = {kind: part.part for kind, part in PARTS.items()}
_PART |= {'mode_changes': 'joint', 'sensors': 'sensor'}
"""Fields with the names of parts whose messages share a topic."""
_ZEROS = np.zeros((0, 0))
NOTHING = Motion(
    PiecewisePolynomial(
        np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 0), np.int64), np.zeros((0, 0, 1))
    ),
    np.zeros((0, 0), np.uint8), _ZEROS, np.zeros((0, 0, 3)),
)  # fmt: skip
"""Motion of no segments."""

_IMPACT = attrgetter(*('time' if name == 't' else name for name in Impact._fields
                       if name != 'drive_work'))  # fmt: skip
_WORK = Impact._fields.index('drive_work')
_END = 1e-9  # turns beyond those of a run that are rounding
_NEWTON = 50
_BLOCK = 8192  # instants at once


@dataclass(frozen=True, eq=False)
class Revolutions(Rich):
    """A run, and the angle of its main drive over time.

    Turns are counted from angle zero on, in the direction in which the drive ends up.
    """

    machine: Machine
    piece: Piece  #: its motion and events

    @property
    def start(self) -> float:
        """Start of the motion [s]."""
        return float(self.piece.motion.curve.start[0])

    @property
    def end(self) -> float:
        """End of the motion [s]."""
        return self.piece.motion.curve.end

    @property
    def slides(self) -> bool:
        """True if the main drive moves straight, so that it makes no turns."""
        return self.machine.plan.main in self.machine.physics.displacements

    @cached_property
    def _drive(self) -> int:
        return self.machine.physics.coordinates.index(self.machine.plan.main)

    @cached_property
    def sense(self) -> float:
        """1 if the main drive turns counterclockwise, -1 if clockwise."""
        first, last = self._angle(np.array([self.start, self.end]))
        return -1.0 if last < first else 1.0

    def _angle(self, t: Array) -> Array:
        return self.piece.motion.curve(t)[:, self._drive]

    def turned(self, t: Array) -> Array:
        """Angle of the main drive in turns at times (N,) [s]: (N,), rising.

        Not a number outside of the motion, and of a drive that slides.
        """
        turned, curve = np.full(len(t), np.nan), self.piece.motion.curve
        for first in range(0, len(t), _BLOCK):
            some, into = t[first : first + _BLOCK], turned[first : first + _BLOCK]
            inside = (some >= self.start) & (some <= self.end) & (not self.slides)
            into[inside] = self.sense * turns_at(curve, self._drive, *curve.find(some[inside]))
        return turned

    def degrees(self, t: Array) -> Array:
        """Angle of the main drive at times (N,) [s] with its turns [deg], as `turned` knows it."""
        return 360.0 * self.sense * self.turned(t)

    def angle(self, t: Array) -> Array:
        """Angle of the main drive at times (N,) [s] in [0, 2 pi); nan of a drive that slides."""
        if self.slides:
            return np.full(len(t), np.nan)
        return np.asarray(np.mod(self._angle(t), TWO_PI))

    @property
    def turns(self) -> tuple[int, int]:
        """The whole turns from angle zero to angle zero within the motion: from, and up to."""
        first, last = self.turned(np.array([self.start, self.end]))
        slack = _END + 4.0 * float(np.spacing(self.end)) * abs(self.rate)  # for a distant start
        return math.ceil(first - slack), math.floor(last + slack)

    def whole_turns(self, skip: int = 0) -> tuple[int, int]:
        """The whole turns without the first `skip` of them."""
        if self.slides:
            raise InputError(
                f'{self.machine.name}: {self.machine.plan.main} slides: it makes no turns'
            )
        first, last = self.turns
        if first + skip >= last:
            raise InputError(
                f'{self.machine.name}: the run has {max(0, last - first)} whole turns of '
                f'{self.machine.plan.main} from angle zero to angle zero; {skip + 1} are needed'
            )
        return first + skip, last

    @property
    def has_turns(self) -> bool:
        """True if the run has a whole turn of a drive that turns one way only."""
        if self.slides:
            return False
        first, last = self.turns
        return first < last and bool(np.all(np.diff(self._marks[1]) >= 0.0))

    @property
    def rate(self) -> float:
        """Turns of the main drive a second, in the mean [Hz]."""
        first, last = self.turned(np.array([self.start, self.end]))
        return float((last - first) / (self.end - self.start))

    def begin(self, skip: int) -> float:
        """Time at which `skip` whole turns of the main drive are complete [s]; the start for 0."""
        if not skip:
            return self.start
        return float(self.times_at(np.array([self.whole_turns(skip)[0]]))[0])

    @cached_property
    def _marks(self) -> tuple[Array, Array]:
        """Times [s] at which pieces of the motion meet, and the turns of the drive then."""
        marks = np.append(self.piece.motion.curve.start, self.end)
        return marks, self.turned(marks)

    def times_at(self, turns: Array) -> Array:
        """Times at which the main drive has made `turns` (N,), counted as by `turned` [s]."""
        marks, passed = self._marks
        if np.any(np.diff(passed) < 0.0):
            raise InputError(f'{self.machine.name}: {self.machine.plan.main} turns back')
        curve, per_turn = self.piece.motion.curve, self.sense / TWO_PI
        t = np.interp(turns, passed, marks)
        for _ in range(_NEWTON):
            k, dt = curve.find(t)
            off = per_turn * curve.at(k, dt)[:, self._drive] - turns
            rate = per_turn * curve.at(k, dt, 1)[:, self._drive]
            # where it starts from rest, its angle of the start is reached at rate zero
            step = np.divide(off, rate, out=np.zeros_like(off), where=(off != 0.0) & (rate != 0.0))
            t = np.clip(t - step, self.start, self.end)
            if np.abs(step).max(initial=0.0) <= 4.0 * np.spacing(self.end):
                break
        return np.asarray(t)


def machine_of(bag: Bag | Path | str, namespace: str | None = None) -> Machine:
    """The machine whose run a bag holds, from the recorded scene."""
    bag = bag if isinstance(bag, Bag) else read_bag(bag)
    refuse_empty(bag)
    return parse_description(scene_text(bag, namespace) or '', str(bag.path))


def refuse_empty(bag: Bag) -> None:
    """Refuse a bag without messages."""
    if not any(topic.count for topic in bag.topics.values()):
        raise InputError(
            f'{bag.path} holds no message: nothing was recorded, or it was cut short.'
        )


@dataclass(frozen=True, eq=False)
class Record(Revolutions):
    """A run to be analysed, recorded or just simulated.

    Attributes
    ----------
    piece : motion and events of the run, sampled like a solution
    signals : signals of the sensors by name, if recorded or requested
    audit : energy balance of motion and impacts, if the record was read from a bag
    wall_time : wall-clock duration of the recording [s], where known
    complete : False if the bag was cut short
    whole : motion from the start of the run, if `piece` begins or ends elsewhere
    """

    signals: dict[str, Signal]
    audit: Audit | None = None
    wall_time: float | None = None
    complete: bool = True
    whole: Motion | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), 'audit': None}  # `audited` makes it again

    def __repr__(self) -> str:
        return f'<Record of {self.machine.name}: {self.piece!r}>'

    @property
    def history(self) -> Motion:
        """The motion from the start of the run on: what sensors and frames on springs went by."""
        return self.piece.motion if self.whole is None else self.whole

    def part(self, start: float | None, end: float | None) -> tuple[float, float]:
        """Start and end [s] of a part of the run; those of the run where they are None."""
        return part_of(self.start, self.end, start, end)

    def columns(
        self, names: str | Sequence[str], t: Array | None = None, *, turns: Array | None = None
    ) -> Table:
        """Quantities by name (see `Piece.sample`) at times (N,) [s], or by turns of the drive."""
        if (t is None) == (turns is None):
            raise InputError('columns need either times or turns of the drive')
        if turns is not None:
            turns = np.asarray(turns, dtype=float)
            first, last = self.turned(np.array([self.start, self.end])).tolist()
            if not ((turns >= first - _END) & (turns <= last + _END)).all():
                raise InputError(
                    f'turns must be from {first:.9g} to {last:.9g}, as the run has them'
                )
            t = self.times_at(turns)
        assert t is not None  # noqa: S101 - one of both is given
        return self.piece.sample(t, 't', *flat(names))

    def sample(self, t: Array | float, *names: str | Sequence[str]) -> Table:
        """Quantities at times (N,) [s], see `Piece.sample`."""
        return self.piece.sample(t, *names)

    def to_frame(
        self,
        *names: str | Sequence[str],
        rate: float | str | None = None,
        library: str | None = None,
    ) -> Any:
        """A data frame, see `Piece.to_frame`; samples of sensors are those that were recorded."""

        def recorded(sensor: str) -> Table:
            signal = self.signal(sensor)
            t, samples = np.concatenate(signal.times), np.concatenate(signal.runs)
            return signal_table(t, sensor, samples, signal.unit)

        return self.piece.framed(names, rate, recorded).to_frame(library)

    def plot(self, *names: str | Sequence[str], **how: Any) -> Any:
        """Plot quantities, see `Piece.plot`."""
        return self.piece.plot(*names, **how)

    @cached_property
    def audited(self) -> Audit:
        """The audit of its motion and impacts."""
        if self.audit:
            return self.audit
        audit = Audit(self.machine.physics)
        audit.add(self.piece.motion, self.piece.impacts)
        return audit

    def over_turns(self, quantity: str, samples: int | None = None, skip: int = 0) -> TurnSegments:
        """A quantity at equal angles of the main drive, in whole turns from angle zero on.

        What the catalogue names is taken from the motion's polynomials at exactly these angles.
        The signal of a sensor is interpolated (`mechanism_sim.sensing.spectra.at_equal_angles`).

        Parameters
        ----------
        quantity : a name of `Piece.sample`, such as ``acceleration.coupler``, or of a sensor
        samples : number of angles in a turn; default: 360, for a sensor its samples in a turn
        skip : whole turns at the start that are left out
        """
        first, end = self.whole_turns(skip)
        if quantity in self.sensors:
            found = self.signal(quantity).over_turns(self.turned, samples)
            if found is None or not (kept := found.first >= first).any():
                raise InputError(f'the signal of {quantity} covers no whole turn')
            return TurnSegments(found.values[kept], found.first[kept], self.sense < 0.0)
        n, turns, name = samples or 360, np.arange(first, end), self._found(quantity).name
        t = self.times_at((turns[:, None] + np.arange(n) / n).ravel())
        blocks = (t[k : k + _BLOCK] for k in range(0, len(t), _BLOCK))
        values = np.concatenate([self.piece.sample(block, name)[name] for block in blocks])
        return TurnSegments(values.reshape(-1, n), turns, self.sense < 0.0)

    def unit(self, quantity: str) -> str:
        """SI unit of a quantity of `Piece.sample` or of a sensor; empty for a number."""
        if quantity in self.sensors:
            return self.signal(quantity).unit
        return self._found(quantity).unit

    def _found(self, quantity: str) -> Quantity:
        try:
            return self.piece.catalogue.find(quantity)
        except InputError as error:
            sensors = f'; its sensors: {", ".join(self.sensors)}' if self.sensors else ''
            raise InputError(f'{error}{sensors}') from None

    def between(self, start: float | None = None, end: float | None = None) -> Record:
        """The run from one time [s] to another; without them the whole."""
        a, b = self.part(start, end)
        if (a, b) == (self.start, self.end):
            return self
        motion = self.piece.motion.between(a, b)
        before = self.piece.view(a)
        t = self.piece.impacts.column('t')
        impacts = self.piece.impacts.where((a < t) & (t <= b))
        known = zip(self.piece.physics.clearances, motion.modes[0].tolist(), strict=True)
        changes = [ModeChange(a, name, Mode(mode), Mode.UNKNOWN) for name, mode in known]
        changes += [change for change in self.piece.modes if a < change.t <= b]
        audit = Audit(self.piece.physics)
        work = audit.add(motion, impacts)
        balance = EnergyTerms(
            work, impacts, float(before.drive_work[0]), float(before.dissipated[0])
        )
        signals = {name: s for name, x in self.signals.items() if (s := x.between(a, b))}
        piece = Piece(self.machine, motion, balance, impacts, changes)
        return Record(
            self.machine, piece, signals, audit, complete=self.complete, whole=self.history
        )

    def digest(self) -> str:
        """SHA-256 of motion and impacts: equal for runs that are equal bit by bit."""
        return self.piece.digest()

    def signal(self, sensor: str) -> Signal:
        """Samples of a sensor, as recorded; computed from the motion if that is all there is."""
        check_known(sensor, self.sensors, f"there is no sensor '{sensor}'", 'there are:')
        if sensor not in self.signals:
            signal = measured(self.machine, self.history, sensor)
            found = signal if self.whole is None else signal.between(self.start, self.end)
            if found is None:
                raise InputError(
                    f'sensor {sensor} takes no sample from {self.start:g} s to {self.end:g} s'
                )
            self.signals[sensor] = found
        return self.signals[sensor]

    @property
    def sensors(self) -> list[str]:
        """Names of the recorded sensors and of those of the scene, sorted."""
        return sorted({*self.signals, *self.machine.scene.sensors})

    @property
    def sampled_sensors(self) -> list[str]:
        """The sensors that took samples: one that waits for a shock may have none."""

        def took_any(sensor: str) -> bool:
            try:
                self.signal(sensor)
            except InputError:
                return False
            return True

        return [sensor for sensor in self.sensors if took_any(sensor)]

    @property
    def loose_joints(self) -> list[str]:
        """Joints with a pin loose in a bushing; ``JOINT_front`` and the like for ends out of line.

        On an oil film it never touches: not these.
        """
        known, mechanism = self.machine.physics.clearances, self.machine.mechanism
        return [gap for j in self.machine.bearings for gap in gaps_of(mechanism, j.name, known)]


def loose_bearing(record: Record, joint: str) -> str:
    """Check that a joint has a pin loose in a bushing, and return it."""
    known, machine = record.loose_joints, record.machine
    wrong = f"'{joint}' is not a joint with a pin loose in a bushing"
    check_known(joint, known, wrong, f'such joints of {machine.name}:')
    return joint


def read_record(bag: Bag | Path | str, namespace: str | None = None) -> Record:
    """A bag as a record: one pass, all of the motion in memory."""
    bag = bag if isinstance(bag, Bag) else read_bag(bag)
    find_topics(bag, namespace)  # checks for a single machine before reading its scene
    machine = machine_of(bag, namespace)
    sensors, growing = SignalCollectors(), None
    parts, changes = list[Impacts](), list[ModeChange]()
    for piece in pieces(bag, namespace, {'sensors': sensors.add}):
        if piece.coordinates:
            check_motion(bag, machine, piece)
        if len(piece.motion):
            growing = growing or GrowingMotion()
            growing.add(piece.motion)
        parts.append(piece.impacts)
        changes += piece.modes
    if growing is None:
        raise InputError(f'{bag.path} has no recorded motion.')
    motion = growing.whole()
    for a, b in gaps(motion.curve):
        raise InputError(
            f'{bag.path}: the motion from {instant(a)} s to {instant(b)} s is missing.'
        )
    impacts = _with_work(machine, motion, _covered(bag, motion, Impacts.joined(parts)))
    audit = Audit(machine.physics)
    balance = EnergyTerms(audit.add(motion, impacts), impacts)
    run = Piece(machine, motion, balance, impacts, changes)
    return Record(machine, run, sensors.signals(), audit, bag.wall_time, bag.complete)


def check_motion(bag: Bag, machine: Machine, piece: RecordedPiece) -> None:
    """Refuse a motion of other coordinates or joints than the machine that its scene makes."""
    rows, clearances = row_names(machine), machine.physics.clearances
    for names, here in ((piece.coordinates, rows), (piece.joints, clearances)):
        if names != tuple(here):
            raise InputError(
                f'{bag.path}: its motion is of {", ".join(names)}, but its scene makes a machine '
                f'of {", ".join(here)}: it was recorded by another version.'
            )


def _covered(bag: Bag, motion: Motion, impacts: Impacts) -> Impacts:
    """The impacts at times of which the motion is recorded; a warning of others."""
    start, end = float(motion.curve.start[0]), motion.curve.end
    slack = 4.0 * float(np.spacing(max(abs(start), abs(end))))
    t = impacts.column('t')
    kept = impacts.where((start - slack <= t) & (t <= end + slack))
    if left := len(impacts) - len(kept):
        lost = counted(left, 'impact') + (' is' if left == 1 else ' are')
        warnings.warn(
            f'{bag.path}: the motion is recorded from {instant(start)} s to {instant(end)} s; '
            f'{lost} left out, before or after it',
            RunWarning,
            stacklevel=3,
        )
    return kept


def _with_work(machine: Machine, motion: Motion, impacts: Impacts) -> Impacts:
    """The impacts with the work of the drive, whose impulse is recorded; nan if it has several."""
    names = machine.plan.prescribed
    if not names or not impacts:
        speeds = np.zeros(len(impacts))
    elif len(names) > 1:
        speeds = np.full(len(impacts), np.nan)
    else:
        i = machine.physics.coordinates.index(names[0])
        speeds = motion.curve(impacts.column('t'), 1)[:, i]
    impulse = impacts.column('drive_impulse')
    return impacts.with_column('drive_work', np.where(impulse != 0.0, impulse * speeds, 0.0))


@dataclass(frozen=True)
class RecordedPiece:
    """A message of the motion, and the events that were published since the one before."""

    #: names of the columns of the motion; empty where it is not recorded
    coordinates: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    motion: Motion = NOTHING
    impacts: Impacts = field(default_factory=Impacts)
    modes: list[ModeChange] = field(default_factory=list)


class RunOrder:
    """Filter of the messages of one run: numbers of impacts and times of each part rise.

    What does not rise is recorded twice, as in a bag that was merged of two, or comes from outside
    the run.
    """

    def __init__(self) -> None:
        self.left_out: Counter[str] = Counter()  #: messages by topic
        self._last: dict[tuple[str, str], tuple[float, int]] = {}  # place, mode by topic and part

    def keeps(self, topic: str, kind: str, message: Any) -> bool:
        """Enter the message that follows; False if it is to be left out."""
        if kind in {'drive', 'progress'} or (kind == 'sensors' and not len(message.samples)):
            return True  # what they say holds from the last one on
        part = str(getattr(message, _PART.get(kind, ''), ''))
        place = message.index if kind == 'impacts' else message.time
        last, mode = self._last.get((topic, part), (-math.inf, 0))
        if kind == 'mode_changes':  # several of one instant follow one from the other
            follows = place == last and message.previous_mode == mode
            mode = message.mode
        else:
            follows = False
        if kept := bool(place > last or follows):
            self._last[topic, part] = place, mode
        else:
            self.left_out[topic] += 1
        return kept

    def warn(self, bag: Bag) -> None:
        """Warn of what was left out."""
        if self.left_out:
            each = ', '.join(f'{count} of {topic}' for topic, count in self.left_out.items())
            warnings.warn(
                f'{bag.path}: messages that do not follow those before them are left out, as if '
                f'recorded twice or sent from outside the run: {each}',
                RunWarning,
                stacklevel=3,
            )


def pieces(
    bag: Bag,
    namespace: str | None = None,
    others: Mapping[str, Callable[[Any], object]] | None = None,
    order: RunOrder | None = None,
) -> Iterator[RecordedPiece]:
    """The pieces of a run, in one pass over its bag; at the end, events without a motion.

    Of several runs in a bag it is the first, that of the scene that is read.

    Parameters
    ----------
    namespace : namespace of the machine, if the bag holds several
    others : callbacks for messages of further kinds of topics (see `KINDS`)
    order : filter of the messages, which knows then what was left out
    """
    others, topics, order = others or {}, find_topics(bag, namespace), order or RunOrder()
    kinds = {name: kind for kind in (*_RUN, *others) for name in topics[kind]}
    impacts: list[Any] = []  # their messages
    modes: list[ModeChange] = []
    last = -1, -math.inf, 0.0
    for topic, message, _ in bag.messages(kinds):
        kind = kinds[topic]
        if kind == 'motion':
            names, motion = (tuple(message.coordinates), tuple(message.joints)), motion_of(message)
            begins = message.run, math.inf, 0.0
            if curve := motion.curve if len(motion) else None:  # far off a start needs both
                begins = message.run, float(curve.start[0]), float(curve.start_low[0])
            if message.run > last[0] >= 0:  # one recorder of several runs, as that of ros2 bag
                warnings.warn(
                    f'{bag.path}: the machine was reset: what follows the first run is left out',
                    RunWarning,
                    stacklevel=2,
                )
                break
            if begins <= last:
                order.left_out[topic] += 1
                continue
            last = begins if len(motion) else last
            yield RecordedPiece(*names, motion, _impacts(impacts), modes)
            impacts, modes = [], []
        elif not order.keeps(topic, kind, message):
            continue
        elif kind == 'impacts':
            impacts.append(message)
        elif kind == 'mode_changes':
            try:
                pair = Mode(message.mode), Mode(message.previous_mode)
            except ValueError as error:
                raise InputError(f'{bag.path}, topic mode_changes: {error}.') from error
            modes.append(ModeChange(message.time, message.joint, *pair))
        else:
            others[kind](message)
    order.warn(bag)
    if impacts or modes:
        yield RecordedPiece(impacts=_impacts(impacts), modes=modes)


def _impacts(messages: Iterable[Any]) -> Impacts:
    """The impacts that messages tell, but for the work of the drive."""
    told = map(_IMPACT, messages)
    return Impacts.of(Impact._make((*x[:_WORK], np.nan, *x[_WORK:])) for x in told)


def gaps(curve: PiecewisePolynomial) -> list[tuple[float, float]]:
    """The spans [s] between segments that should meet and do not: lost messages."""
    end = curve.start[:-1] + (curve.start_low[:-1] + curve.duration[:-1])
    slack = 8 * np.spacing(np.abs(curve.start[1:])) + 1e-15
    apart = np.flatnonzero(curve.start[1:] - end > slack)
    return [(float(end[k]), float(curve.start[k + 1])) for k in apart]


def find_topics(bag: Bag, namespace: str | None = None) -> dict[str, tuple[str, ...]]:
    """The names of the topics of one machine by kind; at most one but for shared kinds.

    Parameters
    ----------
    namespace : namespace of the machine, as '/left'; needed if a bag holds several
    """
    for topic in bag.topics.values():
        if topic.type in _RETIRED:
            raise InputError(
                f'{bag.path}: {topic.name} holds {topic.type.rpartition("/")[2]}, as bags before '
                f'version {_RETIRED[topic.type]} did; {bag.writer} reads it.'
            )
    prefix, homes = prefix_of(namespace), _homes(bag)
    # A machine may have others in namespaces below its own.
    chosen = namespace is not None and prefix[:-1] in homes
    below = tuple(f'{home}/' for home in homes if chosen and home.startswith(prefix))
    own = [t for t in bag.topics.values() if t.name.startswith(prefix)
           and not t.name.startswith(below)]  # fmt: skip
    found: dict[str, tuple[str, ...]] = {}
    for kind, type_name in KINDS.items():
        names = tuple(topic.name for topic in own if topic.type == type_name)
        if len(names) > 1 and kind not in SHARED:  # else it may be remapped to any name
            names = tuple(n for n in names if n.rpartition('/')[2] == kind) or names
        # Sensors have a topic each: two of one name are of two machines.
        ends = [name.rsplit('/', _LEVELS.get(kind, 1)) for name in names]
        alike = [end for _, *end in ends] if kind == 'sensors' else []
        same = [e for e in ends if kind not in SHARED or alike.count(e[1:]) > 1]
        if len(same) > 1:
            held = ', '.join(home or '/' for home, *_ in same)
            raise InputError(f'{bag.path} holds several machines ({held}): choose a namespace.')
        found[kind] = names
    if namespace and not any(found.values()):
        known = [home or '/' for home in homes]
        raise InputError(
            f'{bag.path} has no machine in namespace {namespace}{nearest(namespace, known)}; '
            f'it has {", ".join(known) or "none"}'
        )
    return found


def _homes(bag: Bag) -> list[str]:
    """Namespaces with topics of a machine under their own names, as '/left'; empty for '/'."""
    kinds = {type_name: kind for kind, type_name in KINDS.items()}
    own = set()
    for topic in bag.topics.values():
        kind = kinds.get(topic.type, '')
        home, *last = topic.name.rsplit('/', _LEVELS.get(kind, 1))
        if last == [kind] or (kind == 'sensors' and last[0] in SENSORS):
            own.add(home)
    return sorted(own)
