"""Everything that a bag tells about a run, in one pass over it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mechanism_sim.analysis.crank import Crank, MotionSummary
from mechanism_sim.analysis.delivery_audit import Ledger, LedgerCollector
from mechanism_sim.analysis.impacts import ImpactCollector, ImpactSummary
from mechanism_sim.analysis.loads import (
    BearingPeaks,
    EnergyCollector,
    EnergySummary,
    LoadCollector,
    LoadSummary,
    of_motion,
)
from mechanism_sim.analysis.modes import JointModes, ModeCollector
from mechanism_sim.analysis.motion import MotionCollector
from mechanism_sim.analysis.parts import PARTS, PartCollector, PartRanges, PartSummary
from mechanism_sim.analysis.topics import KINDS, find_topics
from mechanism_sim.analysis.vibration import SensorSummary, VibrationCollector
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.digest import MotionDigest
from mechanism_sim.messages.events import parse_description
from mechanism_sim.messages.segments import motion_of, unpack
from mechanism_sim.recording import Bag, displacements, read_bag, scene_name, scene_text
from mechanism_sim.results.ranges import LoadPeaks
from mechanism_sim.scene import Machine
from mechanism_sim.strict_json import plain


@dataclass(frozen=True)
class Summary:
    """What a bag tells about a run; a part is None where `absent` says why.

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

    def to_json(self) -> dict[str, Any]:
        """Return the same as dictionaries, lists, texts and numbers."""
        result: dict[str, Any] = plain(self)
        return result


def analyze(bag: Bag | Path | str, *, namespace: str | None = None) -> Summary:
    """Return the summary of a bag.

    Args:
        bag: The bag, or its path.
        namespace: Which machine, where a bag holds several, as '/left'.

    Raises:
        InputError: Not a bag, or its messages contradict each other, or it holds several machines
            and none was chosen.

    """
    if not isinstance(bag, Bag):
        bag = read_bag(bag)
    topics = find_topics(bag, namespace)
    machine: Machine | None = None
    unknown: tuple[str, ...] = ()
    if topics['motion'] and (text := scene_text(bag, namespace)) is not None:
        try:
            machine = parse_description(text, str(bag.path))
        except InputError as error:
            unknown = (str(error),)
    run = _Run(_driven_coordinate(bag, topics['drive']), machine)
    handlers: dict[str, Callable[[Any], None]] = {
        'motion': run.add_motion,
        'impacts': run.add_impact,
        'mode_changes': run.modes.add,
        'joint_reactions': run.loads.add,
        'linkage_state': run.energy.add,
        'sensors': run.vibration.add,
        **{topic: collector.add for topic, collector in run.parts.items()},
        'progress': run.ledger.add,
    }
    by_topic = {name: handlers[kind] for kind in handlers for name in topics[kind]}
    for topic, message, _ in bag.messages(by_topic):
        by_topic[topic](message)

    motion = run.track.motion() if run.track else None
    start, end = bag.start / 1e9, bag.end / 1e9
    if motion is not None:
        start, end = motion.start, motion.end
    elif run.ledger.end is not None:
        end = max(end, run.ledger.end)
    crank = Crank(motion, motion is not None and motion.coordinates[0] in displacements(bag))
    moved = crank.summary(run.coordinates)
    present = {kind: bool(topics[kind]) for kind in KINDS}
    impacts = None
    if present['impacts']:
        turns = moved.revolutions if moved else None
        impacts = run.impacts.summary(turns, crank.turned, crank.angle)
    return Summary(
        bag=str(bag.path),
        scene=scene_name(bag),
        complete=bag.complete,
        start=start,
        end=end,
        motion=moved,
        impacts=impacts,
        modes=run.modes.summary(start, end) if present['mode_changes'] else None,
        loads=run.motion_loads(crank) or run.loads.summary(crank.angle),
        energy=run.energy.summary(),
        parts={
            k: c.summary(run.ranges.by_joint(k) if run.ranges else {})
            for k, c in run.parts.items()
            if present[k]
        },
        vibration=run.vibration.summary(crank.turned) if present['sensors'] else None,
        ledger=run.ledger.summary({topic.name: topic.count for topic in bag.topics.values()}),
        digest=run.digest.hexdigest() if motion is not None else None,
        absent=(*_absent(present, run, moved), *unknown),
    )


class _Run:
    """What is gathered during the pass."""

    def __init__(self, driven: str | None, machine: Machine | None) -> None:
        self.peaks = LoadPeaks(machine, shapes=True) if machine else None
        self.ranges = PartRanges(machine) if machine else None
        self.bearings = BearingPeaks(machine) if machine else None
        self._driven = driven
        self.coordinates: tuple[str, ...] = ()
        self.track: MotionCollector | None = None
        self.digest = MotionDigest()
        self.impacts, self.modes, self.loads = ImpactCollector(), ModeCollector(), LoadCollector()
        self.energy, self.vibration = EnergyCollector(), VibrationCollector()
        self.parts = {topic: PartCollector(kind) for topic, kind in PARTS.items()}
        self.ledger = LedgerCollector()

    def add_motion(self, message: Any) -> None:
        s = unpack(message)
        if self.track is None:
            # Of all the motion only the crank's is kept: a long run has millions of segments.
            self.coordinates = s.coordinates
            names = [n for n in (self._driven, 'crank', *s.coordinates) if n in s.coordinates]
            self.track = MotionCollector(names[:1])
        self.track.add(s)
        for collector in (self.peaks, self.ranges, self.bearings):
            if collector:
                collector.add(motion_of(message))
        self.digest.add_segments(
            s.start, s.start_low, s.duration, s.turns, s.coefficients, s.modes
        )

    def motion_loads(self, crank: Crank) -> LoadSummary | None:
        """The loads of the recorded motion, if there is one with a scene."""
        if self.peaks is None or self.bearings is None:
            return None
        return of_motion(self.peaks, self.bearings, crank.angle)

    def add_impact(self, message: Any) -> None:
        self.impacts.add(message)
        self.digest.add_impact(
            message.time,
            message.joint,
            message.normal_angle,
            message.approach_speed,
            message.rebound_speed,
            message.normal_impulse,
            message.tangential_impulse,
            message.energy_loss,
            message.drive_impulse,
        )


def _driven_coordinate(bag: Bag, topics: tuple[str, ...]) -> str | None:
    for _, law, _ in bag.messages(topics) if topics else ():
        return str(law.coordinate)
    return None


def _absent(present: dict[str, bool], run: _Run, motion: MotionSummary | None) -> tuple[str, ...]:
    """Return what is missing in the bag and what therefore is missing here, in sentences."""
    lost = {
        'motion': 'revolutions, angles of the drive and digest',
        'impacts': 'impacts',
        'mode_changes': 'shares of the modes',
        'joint_reactions': 'forces and torque',
        'linkage_state': 'balance of energy',
        'sensors': 'vibration',
        'progress': 'comparison of what was sent with what was recorded',
    }
    sentences = [f'no topic {kind}: no {what}' for kind, what in lost.items() if not present[kind]]
    if present['motion'] and motion is None:
        sentences.append('topic motion is empty: no revolutions, angles of the drive and digest')
    if present['joint_reactions'] and not run.loads.samples:
        sentences.append('topic joint_reactions is empty: no forces and torque')
    if present['linkage_state'] and not run.energy.samples:
        sentences.append('topic linkage_state has no energies: no balance of energy')
    return tuple(sentences)
