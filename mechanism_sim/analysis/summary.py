"""Everything that a bag tells about a run, in one pass over it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mechanism_sim.analysis.collectors import (
    FieldRange,
    JointModes,
    Ledger,
    LedgerCollector,
    ModeShares,
    SensorSummary,
    VibrationCollector,
    field_ranges,
)
from mechanism_sim.analysis.impacts import Crank, ImpactCollector, ImpactSummary, MotionSummary
from mechanism_sim.analysis.pieces import KINDS, find_topics, pieces
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
from mechanism_sim.analysis.record import check_motion
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.digest import MotionDigest
from mechanism_sim.hybrid.peak_shapes import PeakShape
from mechanism_sim.messages.events import parse_description
from mechanism_sim.recording.inventory import displacements, scene_name, scene_text
from mechanism_sim.recording.reader import Bag, read_bag
from mechanism_sim.recording.writer import LIBRARY
from mechanism_sim.results import ranges
from mechanism_sim.results.ranges import LoadPeaks, largest
from mechanism_sim.strict_json import plain


@dataclass(frozen=True)
class LoadPeak:
    """The largest magnitude of something."""

    name: str
    value: float  #: [N] magnitude of a force; [N m] torque, with its sign
    time: float  #: [s]
    #: [rad] of the coordinate `MotionSummary.crank`, in [0, 2 pi); None where not recorded
    crank_angle: float | None
    #: [s] for which the load is above half of the peak, as far as that is known of the motion
    duration: float | None = None
    impulse: float | None = None  #: of the magnitude in that time [N s, N m s]
    whole: bool = True  #: whether the load was below half of the peak before and after


@dataclass(frozen=True)
class LoadSummary:
    """The largest force in each joint and the largest torque of the drive, between impacts.

    Forces of bearings of shafts are by ``SHAFT.BEARING``; those along an axis, which have a sign,
    end in ``.axial``.
    """

    samples: int | None  #: instants that were published, if that is all there is; None: the motion
    joints: tuple[LoadPeak, ...]
    drive_torque: LoadPeak
    moments: tuple[LoadPeak, ...] = ()  #: [N m] of bearings that tilt


def load_summary(
    peaks: Mapping[str, ranges.Peak],
    shapes: Mapping[str, PeakShape],
    crank_angle: Callable[[float], float | None],
    samples: int | None = None,
) -> LoadSummary | None:
    """The loads among the peaks of quantities; None if there are no forces.

    Parameters
    ----------
    peaks, shapes : by the names of the catalogue
    crank_angle : angle [rad] of the crank at a time [s]
    """
    found: dict[str, list[LoadPeak]] = {'drive_torque': [], 'bearing_moment': [], '': []}
    for name, (value, time) in peaks.items():
        kind, _, of = name.removesuffix('.size').partition('.')
        of += '.axial' if kind == 'axial_force' else ''
        peak = LoadPeak(of, value, time, crank_angle(time))
        if shape := shapes.get(name):
            peak = replace(peak, duration=shape.duration, impulse=shape.impulse, whole=shape.whole)
        found[kind if kind in found else ''].append(peak)
    forces, efforts = found[''], found['drive_torque']
    if not (forces or samples):
        return None
    none = replace(forces[0], value=0.0) if forces else LoadPeak('', 0.0, 0.0, None)
    drive = efforts[0] if efforts else none
    moments = tuple(found['bearing_moment'])
    return LoadSummary(samples, tuple(forces), replace(drive, name='drive'), moments)


@dataclass(frozen=True)
class Summary:
    """Summary of the run in a bag; a part is None where `absent` says why.

    start, end: span of the run [s]; digest: that of `MotionDigest`.
    """

    bag: str
    scene: str | None
    complete: bool
    start: float
    end: float
    motion: MotionSummary | None
    impacts: ImpactSummary | None
    modes: tuple[JointModes, ...] | None
    loads: LoadSummary | None
    energy: EnergySummary | None
    parts: dict[str, tuple[PartSummary, ...]]  #: by the topic of their states
    vibration: tuple[SensorSummary, ...] | None
    ledger: Ledger | None
    digest: str | None
    absent: tuple[str, ...]
    fields: tuple[FieldRange, ...] = ()  #: of a bag of another program

    def to_json(self) -> dict[str, Any]:
        """The summary as dictionaries, lists, texts and numbers; fields of other programs only."""
        result: dict[str, Any] = plain(self)
        return result if self.fields else {k: v for k, v in result.items() if k != 'fields'}


def analyze(bag: Bag | Path | str, *, namespace: str | None = None) -> Summary:
    """The summary of a bag.

    Parameters
    ----------
    namespace : of the machine, where a bag holds several, as '/left'

    Raises
    ------
    InputError
        If it is no bag, its messages contradict each other, or it holds several machines and none
        was chosen.
    """
    bag = bag if isinstance(bag, Bag) else read_bag(bag)
    topics = find_topics(bag, namespace)
    present = {kind: bool(topics[kind]) for kind in KINDS}
    crank = Crank(_driven_coordinate(bag, topics['drive']), displacements(bag))
    impacts, modes, digest = ImpactCollector(), ModeShares(), MotionDigest()
    energy, vibration, ledger = PublishedEnergies(), VibrationCollector(), LedgerCollector()
    parts = {topic: PublishedParts(topic) for topic in PARTS}
    peaks, unknown = _peaks(bag, namespace) if present['motion'] else (None, '')
    for piece in pieces(bag, namespace, {
        'linkage_state': energy.add, 'sensors': vibration.add, 'progress': ledger.add,
        **{topic: part.add for topic, part in parts.items()},
    }):  # fmt: skip
        crank.add(piece)
        if peaks and len(piece.motion):
            try:
                check_motion(bag, peaks.machine, piece)
            except InputError as error:
                peaks, unknown = None, str(error)
            else:
                peaks.add(piece.motion)
        impacts.add(piece.impacts)
        modes.add(piece.modes)
        digest.add(piece.motion, piece.impacts)

    moved = crank.summary()
    start, end = bag.start / 1e9, bag.end / 1e9
    if moved is not None:
        start, end = moved.start, moved.end
    elif ledger.end is not None:
        end = max(end, ledger.end)
    loads = load_summary(peaks.peaks(), peaks.shapes(), crank.angle) if peaks else None
    if loads is None and present['joint_reactions']:
        loads = _published_loads(bag, topics['joint_reactions'], crank)
    of_motion = peaks.ends() if peaks else {}
    found = Summary(
        bag=str(bag.path),
        scene=scene_name(bag),
        complete=bag.complete,
        start=start,
        end=end,
        motion=moved,
        impacts=impacts.summary(crank) if present['impacts'] else None,
        modes=modes.summary(start, end) if present['mode_changes'] else None,
        loads=loads,
        energy=energy.summary(),
        parts={k: part.summary(of_motion) for k, part in parts.items() if present[k]},
        vibration=vibration.summary(crank.turned) if present['sensors'] else None,
        ledger=ledger.summary({topic.name: topic.count for topic in bag.topics.values()}),
        digest=digest.hexdigest() if moved is not None else None,
        absent=(),
    )
    held = any(topic.count for topic in bag.topics.values())
    if bag.library != LIBRARY and held and not any(present.values()):
        return replace(found, fields=field_ranges(bag))
    return replace(found, absent=(*_absent(present, found), *filter(None, [unknown])))


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
    ranges = PublishedRanges()
    for _, message, _ in bag.messages(topics):
        ranges.add(float(message.time), loads_of(message))
    return load_summary(largest(ranges.ends), {}, crank.angle, ranges.samples)


def _driven_coordinate(bag: Bag, topics: tuple[str, ...]) -> str | None:
    for _, law, _ in bag.messages(topics) if topics else ():
        return str(law.coordinate)
    return None


def _absent(present: dict[str, bool], found: Summary) -> Iterator[str]:
    """Parts that are missing in the bag and therefore here, in sentences."""
    lost = {
        'motion': 'revolutions, angles of the drive and digest',
        'impacts': 'impacts',
        'mode_changes': 'shares of the modes',
        'joint_reactions': 'forces and torque',
        'linkage_state': 'balance of energy',
        'sensors': 'vibration',
        'progress': 'comparison of what was sent with what was recorded',
    }
    yield from (f'no topic {kind}: no {what}' for kind, what in lost.items() if not present[kind])
    if present['motion'] and found.motion is None:
        yield 'topic motion is empty: no revolutions, angles of the drive and digest'
    if present['joint_reactions'] and found.loads is None:
        yield 'topic joint_reactions is empty: no forces and torque'
    if present['linkage_state'] and found.energy is None:
        yield 'topic linkage_state has no energies: no balance of energy'
