"""Summary of a run from its bag, in one pass."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.analysis.collectors import (
    FieldRange,
    JointModes,
    MessageAccounts,
    MessageAccountsCollector,
    ModeShares,
    SensorSummary,
    VibrationCollector,
    field_ranges,
)
from mechanism_sim.analysis.published import (
    PARTS,
    EnergySummary,
    PartSummary,
    PublishedEnergies,
    PublishedParts,
    PublishedRanges,
    loads_of,
    names_of_parts,
)
from mechanism_sim.analysis.record import (
    KINDS,
    RecordedPiece,
    RunOrder,
    check_motion,
    find_topics,
    gaps,
    pieces,
    refuse_empty,
)
from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.engine.events import Impact, Impacts
from mechanism_sim.engine.peak_shapes import PeakShape
from mechanism_sim.errors import InputError
from mechanism_sim.messages.events import parse_description
from mechanism_sim.numerics.polynomials import TWO_PI, PiecewisePolynomial
from mechanism_sim.recording.inventory import displacements, scene_name, scene_text
from mechanism_sim.recording.reader import Bag, read_bag
from mechanism_sim.results import ranges
from mechanism_sim.results.ranges import LoadPeaks, largest
from mechanism_sim.results.turns import (
    Mean,
    Place,
    beginning,
    impact_means,
    impacts_by_turn,
    turns_at,
)
from mechanism_sim.scene import Machine
from mechanism_sim.strict_json import plain

_SLACK = 1e-9  # a revolution that is full but for rounding is full


@dataclass(frozen=True)
class DominantImpact:
    """An impact of a large normal impulse; the first of them if there are several."""

    time: float  #: [s]
    joint: str
    crank_angle: float | None
    """[rad] of the coordinate `MotionSummary.crank`, in [0, 2 pi); None where not recorded."""
    normal_impulse: float  #: [N s]
    approach_speed: float  #: [m/s]
    normal_angle: float  #: [rad]


@dataclass(frozen=True)
class JointImpacts:
    """The impacts of one joint over the whole run; `dominant` are the three largest of them."""

    joint: str
    count: int
    normal_impulse: float  #: [N s] sum
    energy_loss: float  #: [J] sum
    largest_approach_speed: float  #: [m/s]
    I_n: float  #: [N s] normal impulse per impact ([SB] 7.3)
    I_n_half_width: float  #: half its 95 % confidence interval; NaN below two whole revolutions
    dominant: tuple[DominantImpact, ...]


@dataclass(frozen=True)
class RevolutionTable:
    """Impacts by revolution of the crank (rows, from 0) and joint (columns).

    The last revolution may be a part of one. `elsewhere` counts the impacts at times of which the
    motion is not recorded; they are in no row.
    """

    joints: tuple[str, ...]
    count: NDArray[np.int64]  #: (revolutions, joints)
    normal_impulse: Array  #: (revolutions, joints) [N s]
    elsewhere: int


@dataclass(frozen=True)
class ImpactSummary:
    """All impacts of a run; what is per revolution is None without the crank's motion.

    `means` are those over the whole revolutions, from the first one on, with their 95 % confidence
    intervals (`impact_means`); None if there are less than two.
    """

    count: int
    normal_impulse: float  #: [N s] sum
    energy_loss: float  #: [J] sum
    joints: tuple[JointImpacts, ...]
    dominant: DominantImpact | None
    count_per_revolution: float | None
    normal_impulse_per_revolution: float | None  #: [N s]
    table: RevolutionTable | None
    means: tuple[Mean, ...] | None = None


class ImpactCollector:
    """Gathers impacts."""

    def __init__(self) -> None:
        self._parts: list[Impacts] = []

    def add(self, impacts: Iterable[Impact]) -> None:
        """Enter the impacts that follow."""
        self._parts.append(Impacts.of(impacts))

    def summary(self, crank: Crank) -> ImpactSummary:
        """All that was gathered, by joint and by revolutions of the crank."""
        found = crank.summary()
        revolutions = found.revolutions if found else None
        struck = Impacts.joined(self._parts)
        time, impulse, loss, speed, angle = map(struck.column, (
            't', 'normal_impulse', 'energy_loss', 'approach_speed', 'normal_angle'
        ))  # fmt: skip
        names = tuple(sorted(struck.joints[k] for k in np.unique(struck.gaps)))
        known = {name: k for k, name in enumerate(names)}
        columns = np.array([known.get(name, -1) for name in struck.joints], int)[struck.gaps]

        def dominant(chosen: NDArray[np.intp], count: int) -> tuple[DominantImpact, ...]:
            hardest = chosen[np.argsort(-impulse[chosen], kind='stable')[:count]]
            return tuple(
                DominantImpact(
                    float(time[k]), names[columns[k]], crank.angle(float(time[k])),
                    float(impulse[k]), float(speed[k]), float(angle[k]),
                )
                for k in hardest
            )  # fmt: skip

        table, whole = None, 0
        if revolutions is not None:
            table = _table(names, columns, impulse, crank.turned(time), revolutions)
            whole = int(np.floor(revolutions + _SLACK))
        by_joint = []
        for i, name in enumerate(names):
            own = np.flatnonzero(columns == i)
            by_joint.append(
                JointImpacts(
                    name, len(own), float(np.sum(impulse[own])), float(np.sum(loss[own])),
                    float(np.max(speed[own])), float(np.mean(impulse[own])),
                    _means(table, whole, [i])[2].half_width if table and whole > 1 else np.nan,
                    dominant(own, 3),
                )
            )  # fmt: skip
        total = float(np.sum(impulse))
        return ImpactSummary(
            count=len(time),
            normal_impulse=total,
            energy_loss=float(np.sum(loss)),
            joints=tuple(by_joint),
            dominant=next(iter(dominant(np.arange(len(time)), 1)), None),
            count_per_revolution=len(time) / revolutions if revolutions else None,
            normal_impulse_per_revolution=total / revolutions if revolutions else None,
            table=table,
            means=_means(table, whole, slice(None)) if table and whole > 1 else None,
        )


def _means(table: RevolutionTable, whole: int, joints: list[int] | slice) -> tuple[Mean, ...]:
    """Figures per whole revolution of some joints together."""
    count, impulse = (x[:whole, joints].sum(axis=1) for x in (table.count, table.normal_impulse))
    return impact_means(count, impulse)


def _table(
    names: tuple[str, ...],
    columns: NDArray[np.int64],
    impulse: Array,
    turned: Array,
    revolutions: float,
) -> RevolutionTable:
    """The table of impacts after `turned` revolutions, in given columns."""
    rows = max(1, int(np.ceil(revolutions - _SLACK)))
    known = np.isfinite(turned)
    row = np.clip(np.floor(turned[known] + _SLACK), 0, rows - 1).astype(np.int64)
    count, sums = impacts_by_turn(row, impulse[known], rows, columns[known], len(names))
    return RevolutionTable(names, count, sums, int(np.sum(~known)))


@dataclass(frozen=True)
class MotionSummary:
    """The recorded motion. `gaps` are spans [s] inside it that are missing."""

    coordinates: tuple[str, ...]
    segments: int
    start: float  #: start of the motion [s]
    end: float  #: [s]
    crank: str  #: coordinate whose revolutions are counted
    revolutions: float | None  #: its revolutions, positive in the net direction; None if sliding
    mean_speed: float  #: its mean speed [rad/s or m/s], with sign
    gaps: tuple[tuple[float, float], ...]


class Crank:
    """Motion of the crank at given times, as far as it is recorded.

    Of all the motion only the crank's is kept: a long run has millions of segments.

    Parameters
    ----------
    driven : the coordinate that is driven, if that is known; else that of the name ``crank``, or
        the first
    displacements : sliding coordinates, which have neither angles nor revolutions
    """

    def __init__(self, driven: str | None, displacements: Collection[str]) -> None:
        self._preferred, self._displacements = (driven, 'crank'), displacements
        self._names: tuple[tuple[str, ...], tuple[str, ...]] | None = None
        self._index = 0
        self._parts: list[PiecewisePolynomial] = []

    def add(self, piece: RecordedPiece) -> None:
        """Enter the piece that follows."""
        if not len(piece.motion):
            return
        names = piece.coordinates, piece.joints
        if self._names is None:
            self._names = names
            known = [n for n in (*self._preferred, *names[0]) if n in names[0]]
            self._index = names[0].index(known[0])
        if names != self._names:
            raise InputError('coordinates or joints change during the recording.')
        curve, own = piece.motion.curve, slice(self._index, self._index + 1)
        # a motion of low degree, as of a crank at constant speed, should not cost the memory of
        # the others
        used = np.flatnonzero(np.any(curve.coefficients[:, own] != 0, axis=(0, 1)))
        powers = curve.coefficients[:, own, : int(used.max(initial=0)) + 1]
        self._parts.append(
            PiecewisePolynomial(  # copies, as views keep their whole messages in memory
                curve.start.copy(), curve.start_low.copy(), curve.duration.copy(),
                curve.turns[:, own].copy(), powers.copy(),
            )
        )  # fmt: skip

    @cached_property
    def curve(self) -> PiecewisePolynomial | None:
        """Motion of the crank, once all pieces are entered; None if no motion is recorded."""
        return PiecewisePolynomial.joined(self._parts) if self._parts else None

    def turned(self, t: Array) -> Array:
        """Revolutions (N,) since the start by times (N,) [s]; nan where not recorded."""
        turned = np.full(len(t), np.nan)
        if self.curve is not None and not self.slides:
            k, dt, known = self._find(self.curve, t)
            turned[known] = turns_at(self.curve, 0, k[known], dt[known], self._start)
        return -turned if self._net < 0 else turned

    def angle(self, t: float) -> float | None:
        """The angle at time t [s], in [0, 2 pi); None where not recorded."""
        if self.curve is None or self.slides:
            return None
        k, dt, known = self._find(self.curve, np.array([t]))
        return float(np.mod(self.curve.at(k, dt)[0, 0], TWO_PI)) if known[0] else None

    def summary(self) -> MotionSummary | None:
        """Summary of the recorded motion; None without any."""
        c = self.curve
        if c is None or self._names is None:
            return None
        lasted = c.end - float(c.start[0])
        return MotionSummary(
            coordinates=self._names[0],
            segments=len(c),
            start=float(c.start[0]),
            end=c.end,
            crank=self._names[0][self._index],
            revolutions=None if self.slides else abs(self._net),
            mean_speed=TWO_PI * self._net / lasted if lasted > 0 else 0.0,
            gaps=tuple(gaps(c)),
        )

    @property
    def slides(self) -> bool:
        """True if it moves straight, without angles."""
        return self._names is not None and self._names[0][self._index] in self._displacements

    @cached_property
    def _net(self) -> float:
        """Revolutions over the run, with their sign."""
        c = self.curve
        if c is None:
            return 0.0
        return float(turns_at(c, 0, np.array([len(c) - 1]), c.duration[-1:], self._start)[0])

    @cached_property
    def _start(self) -> Place:
        return beginning(self.curve, 0) if self.curve is not None else (0, 0.0)

    @staticmethod
    def _find(
        c: PiecewisePolynomial, t: Array
    ) -> tuple[NDArray[np.intp], Array, NDArray[np.bool_]]:
        """The segment of each time, the time since its start [s], and whether it is recorded."""
        k = np.clip(np.searchsorted(c.start, t, side='right') - 1, 0, len(c) - 1)
        dt = (t - c.start[k]) - c.start_low[k]
        slack = 4 * np.spacing(abs(c.end))
        return k, dt, (dt >= -slack) & (dt <= c.duration[k] + slack)


@dataclass(frozen=True)
class LoadPeak:
    """The largest magnitude of something."""

    name: str
    value: float  #: [N] magnitude of a force; [N m] torque, with its sign
    time: float  #: [s]
    #: [rad] of the coordinate `MotionSummary.crank`, in [0, 2 pi); None where not recorded
    crank_angle: float | None
    #: duration [s] of the load above half of the peak, as far as the motion is known
    duration: float | None = None
    impulse: float | None = None  #: integral of the magnitude over that time [N s, N m s]
    whole: bool = True  #: True if the load was below half of the peak before and after
    unit: str = 'N'


@dataclass(frozen=True)
class LoadSummary:
    """The largest force in each joint and the largest torque of each drive, between impacts.

    Forces of bearings of shafts are by ``SHAFT.BEARING``; those along an axis, which have a sign,
    end in ``.axial``, moments of tilting bearings in ``.moment``.
    """

    samples: int | None  #: number of published instants, without a motion; else None
    joints: tuple[LoadPeak, ...]
    drive_torque: LoadPeak
    moments: tuple[LoadPeak, ...] = ()  #: moments [N m] of tilting bearings
    drive_unit: str = 'N m'  #: unit of the drive's effort: N if it slides
    other_drives: tuple[LoadPeak, ...] = ()  #: drives beside the main one

    @property
    def peaks(self) -> tuple[LoadPeak, ...]:
        """All peaks, in the order of tables."""
        return *self.joints, self.drive_torque, *self.other_drives, *self.moments


_LOADS = {'axial_force': '.axial', 'bearing_moment': '.moment'}
"""Loads of a joint beside its force in the plane: endings of their names."""


def load_name(quantity: str) -> tuple[str, str]:
    """Kind of a load, and its name in summaries, of a quantity of the catalogue."""
    kind, _, of = quantity.removesuffix('.size').partition('.')
    return kind, of + _LOADS.get(kind, '')


def load_summary(
    peaks: Mapping[str, ranges.Peak],
    shapes: Mapping[str, PeakShape],
    crank_angle: Callable[[float], float | None],
    samples: int | None = None,
    sliding: Collection[str] = (),
) -> LoadSummary | None:
    """The loads among the peaks of quantities; None if there are no forces.

    Parameters
    ----------
    peaks, shapes : peaks and their shapes by the names of the catalogue
    crank_angle : angle [rad] of the crank at a time [s]
    sliding : coordinates that slide, by forces of their drives
    """
    found: dict[str, list[LoadPeak]] = {'drive_torque': [], 'bearing_moment': [], '': []}
    for name, (value, time) in peaks.items():
        kind, of = load_name(name)
        turns = kind == 'bearing_moment' or (kind == 'drive_torque' and of not in sliding)
        peak = LoadPeak(of, value, time, crank_angle(time), unit='N m' if turns else 'N')
        if shape := shapes.get(name):
            peak = replace(peak, duration=shape.duration, impulse=shape.impulse, whole=shape.whole)
        found[kind if kind in found else ''].append(peak)
    forces, efforts = found[''], found['drive_torque']
    if not (forces or samples):
        return None
    none = replace(forces[0], value=0.0) if forces else LoadPeak('', 0.0, 0.0, None)
    drive, *others = efforts or [replace(none, unit='N m')]
    return LoadSummary(
        samples, tuple(forces), replace(drive, name='drive'), tuple(found['bearing_moment']),
        drive.unit, tuple(replace(x, name=f'drive of {x.name}') for x in others),
    )  # fmt: skip


@dataclass(frozen=True)
class Summary:
    """Summary of the run in a bag; a part is None where `absent` says why.

    complete: False if the file was cut short; start, end: span of the run [s]; planned_end: where
    the law of its drive was to end [s], None of an endless one; digest: that of `MotionDigest`.
    """

    bag: str
    scene: str | None
    complete: bool
    start: float
    end: float
    planned_end: float | None
    motion: MotionSummary | None
    impacts: ImpactSummary | None
    modes: tuple[JointModes, ...] | None
    loads: LoadSummary | None
    energy: EnergySummary | None
    parts: dict[str, tuple[PartSummary, ...]]  #: summaries of parts by the topic of their states
    vibration: tuple[SensorSummary, ...] | None
    ledger: MessageAccounts | None
    digest: str | None
    absent: tuple[str, ...]
    fields: tuple[FieldRange, ...] = ()  #: ranges of fields of a bag of another program

    @property
    def ended_early(self) -> bool:
        """True if the run ended before its planned end, by more than a nanosecond."""
        return self.planned_end is not None and self.end < self.planned_end - 1e-9

    def to_json(self) -> dict[str, Any]:
        """The summary as dictionaries, lists, texts and numbers; fields of other programs only."""
        result: dict[str, Any] = plain(self)
        return result if self.fields else {k: v for k, v in result.items() if k != 'fields'}


def analyze(bag: Bag | Path | str, *, namespace: str | None = None) -> Summary:
    """The summary of a bag.

    Parameters
    ----------
    namespace : namespace of the machine, if the bag has several, as '/left'
    """
    bag = bag if isinstance(bag, Bag) else read_bag(bag)
    refuse_empty(bag)
    topics = find_topics(bag, namespace)
    present = {kind: bool(topics[kind]) for kind in KINDS}
    driven, planned_end = _planned(bag, topics['drive'])
    crank = Crank(driven, displacements(bag, namespace) or ())
    impacts, modes, digest = ImpactCollector(), ModeShares(), MotionDigest()
    energy, vibration = PublishedEnergies(), VibrationCollector()
    accounts = MessageAccountsCollector()
    parts = {topic: PublishedParts(topic) for topic in PARTS}
    peaks, unknown = _peaks(bag, namespace) if present['motion'] else (None, '')
    channels = _Channels(peaks.machine if peaks and not present['sensors'] else None, vibration)
    order = RunOrder()
    for piece in pieces(bag, namespace, {
        'linkage_state': energy.add, 'sensors': vibration.add, 'progress': accounts.add,
        **{topic: part.add for topic, part in parts.items()},
    }, order):  # fmt: skip
        crank.add(piece)
        if peaks and len(piece.motion):
            try:
                check_motion(bag, peaks.machine, piece)
            except InputError as error:
                peaks, unknown = None, str(error)
            else:
                peaks.add(piece.motion)
                channels.add(piece.motion)
        impacts.add(piece.impacts)
        modes.add(piece.modes)
        digest.add(piece.motion, piece.impacts)

    channels.end()
    moved = crank.summary()
    start, end = bag.start / 1e9, bag.end / 1e9
    if moved is not None:
        start, end = moved.start, moved.end
    elif accounts.end is not None:
        end = max(end, accounts.end)
    loads = None
    if peaks:
        loads = load_summary(
            peaks.peaks(), peaks.shapes(), crank.angle, sliding=peaks.machine.physics.displacements
        )
    if loads is None and present['joint_reactions']:
        loads = _published_loads(bag, topics['joint_reactions'], crank)
    of_motion = peaks.ends() if peaks else {}
    found = Summary(
        bag=str(bag.path),
        scene=scene_name(bag, namespace),
        complete=bag.complete,
        start=start,
        end=end,
        planned_end=planned_end,
        motion=moved,
        impacts=impacts.summary(crank) if present['impacts'] else None,
        modes=modes.summary(start, end) if present['mode_changes'] else None,
        loads=loads,
        energy=energy.summary(),
        parts={k: part.summary(of_motion) for k, part in parts.items() if present[k]},
        vibration=vibration.summary(crank.turned) if present['sensors'] or channels.any else None,
        ledger=accounts.summary(
            {name: topic.count - order.left_out[name] for name, topic in bag.topics.items()}
        ),
        digest=digest.hexdigest() if moved is not None else None,
        absent=(),
    )
    if scene_text(bag, namespace) is None and not any(present.values()):
        return replace(found, fields=field_ranges(bag))
    missing = filter(None, [unknown, channels.lost])
    return replace(found, absent=(*_absent(present, found, energy), *missing))


class _Channels:
    """Sensors of a machine, read from its motion where their samples are not in the bag.

    Parameters
    ----------
    machine : machine of the bag; None if there is none, or it is not readable
    vibration : gathers the samples
    """

    def __init__(self, machine: Machine | None, vibration: VibrationCollector) -> None:
        self.lost = ''  #: why they were read no further
        self._machine, self._vibration = machine, vibration
        names = machine.scene.sensors if machine else ()
        self._channels = [machine.channel(name) for name in names] if machine else []
        self.any = bool(self._channels)
        self._end: float | None = None

    def add(self, motion: Motion) -> None:
        """Read the piece that follows, unless one before it is missing: filters remember."""
        start, end = float(motion.curve.start[0]), self._end
        apart = end is not None and start - end > 8.0 * np.spacing(abs(start))
        if apart and self.any and not self.lost:
            self.lost = (
                f'the motion from {end:g} s to {start:g} s is missing: no vibration after it'
            )
        self._end = motion.curve.end
        if not self.lost:
            for channel in self._channels:
                channel.take(motion)
            self._enter(final=False)

    def end(self) -> None:
        """Enter what is left when all is read."""
        self._enter(final=True)
        for channel in self._channels:
            channel.warn()

    def _enter(self, final: bool) -> None:
        if self._machine:
            for channel in self._channels:
                self._vibration.add_blocks(self._machine, channel, final)


def _peaks(bag: Bag, namespace: str | None) -> tuple[LoadPeaks | None, str]:
    """Collector of the loads of the motion; without a scene that makes a machine, why not."""
    text = scene_text(bag, namespace)
    if text is None:
        return None, ''
    try:
        machine = parse_description(text, str(bag.path))
    except InputError as error:
        return None, str(error)
    others = names_of_parts(machine)
    return LoadPeaks(machine, shapes=True, bearings=True, others=others), ''


def _published_loads(bag: Bag, topics: tuple[str, ...], crank: Crank) -> LoadSummary | None:
    """The loads at the instants that were published, where the motion has none."""
    ranges, order = PublishedRanges(), RunOrder()
    for topic, message, _ in bag.messages(topics):
        if order.keeps(topic, 'joint_reactions', message):
            ranges.add(float(message.time), loads_of(message))
    order.warn(bag)
    return load_summary(
        largest(ranges.ends), {}, crank.angle, ranges.samples, ('',) * crank.slides
    )


def _planned(bag: Bag, topics: tuple[str, ...]) -> tuple[str | None, float | None]:
    """The driven coordinate, and the end [s] of its last law if that is final."""
    driven, end, run = None, None, None
    for _, law, _ in bag.messages(topics) if topics else ():
        run = law.run if run is None else run
        if law.run > run:
            break
        driven = driven or str(law.coordinate)
        end = float(law.valid_until) if law.final and math.isfinite(law.valid_until) else None
    return driven, end


def _absent(present: dict[str, bool], found: Summary, energy: PublishedEnergies) -> Iterator[str]:
    """Parts that are missing in the bag and therefore here, in sentences."""
    follows = {'joint_reactions': found.loads, 'sensors': found.vibration}  # from the motion
    lost = {
        'motion': 'revolutions, angles of the drive and digest',
        'impacts': 'impacts',
        'mode_changes': 'shares of the modes',
        'joint_reactions': 'forces and torque',
        'linkage_state': 'balance of energy',
        'sensors': 'vibration',
        'progress': 'comparison of what was sent with what was recorded',
    }
    yield from (
        f'no topic {kind}: no {what}'
        for kind, what in lost.items()
        if not present[kind] and follows.get(kind) is None
    )
    if present['motion'] and found.motion is None:
        yield 'topic motion is empty: no revolutions, angles of the drive and digest'
    if present['joint_reactions'] and found.loads is None:
        yield 'topic joint_reactions is empty: no forces and torque'
    if energy.samples == 1:
        yield (
            'topic linkage_state has too few published instants, 1: no energy balance (raise '
            "outputs.linkage_state, as by --set 'outputs.linkage_state=100 kHz')"
        )
    elif present['linkage_state'] and found.energy is None:
        yield 'topic linkage_state has no energies: no energy balance'
