"""Search over the start angle ([SB] 6.1) for the longest contact after a seated start."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mechanism_sim.engine.events import Mode, ModeChange
from mechanism_sim.errors import InputError
from mechanism_sim.planar.protocols import MotionBound
from mechanism_sim.report.sections import Section, text
from mechanism_sim.results.run import is_loss
from mechanism_sim.results.simulate import stream
from mechanism_sim.scene import Machine
from mechanism_sim.scene.load import started_at
from mechanism_sim.scene.schema import Scene
from mechanism_sim.scene.validation import validate_loose
from mechanism_sim.strict_json import plain
from mechanism_sim.studies.runs import Call, Row, Show, Workers

_SAME = 1e-9  # tolerance of times until contact is lost: symmetrical starts differ by rounding


@dataclass(frozen=True)
class StartAngle:
    """A seated start at one crank angle."""

    angle: float  #: crank angle at the start [rad]
    #: revolutions until the first loss of contact in any joint; infinite without loss
    followed: float
    impacts: int  #: number of impacts in all revolutions
    sense: int = 1  #: 1 if the crank turns counterclockwise, -1 if clockwise

    @property
    def lost_at(self) -> float:
        """Crank angle at the first loss of contact [rad], in [0, 2 pi); nan if contact is kept."""
        if math.isinf(self.followed):
            return math.nan
        return (self.angle + self.sense * 2.0 * math.pi * self.followed) % (2.0 * math.pi)


def starts(
    machine: Machine,
    angles: int = 24,
    revolutions: float = 3.0,
    workers: Workers | None = None,
    show: Show | None = None,
) -> list[StartAngle]:
    """Seated starts at equidistant crank angles over the turn, in the order of the angles."""
    validate_loose(machine, 'start angles need')
    if angles < 1:
        raise InputError('at least one start angle is needed')
    places = [2.0 * math.pi * k / angles for k in range(angles)]
    tasks = []
    for angle in places:
        scene = started_at(machine, angle).scene.model_copy(update={'start': 'seated'})
        tasks.append(Call(str(angle), _follow, (machine.name, scene, revolutions)))
    with workers or Workers(1) as pool:
        rows = pool.do_all(tasks, show)
    sense = 1 if machine.drive.start[1] > 0.0 else -1
    return [
        StartAngle(angle, math.inf if row['lost'] is None else row['lost'] / machine.drive.period,
              row['impacts'], sense)
        for angle, row in zip(places, rows, strict=True)
    ]  # fmt: skip


def _follow(name: str, scene: Scene, revolutions: float) -> Row:
    """Time of the first loss of contact in any joint [s], and number of impacts of the run."""
    machine, changes = Machine(name, scene), list[ModeChange]()
    run = stream(machine, revolutions=revolutions)
    run.finish([lambda piece: changes.extend(piece.modes)])
    lost = [x.t for x in changes if is_loss(x)]
    if _begins_apart(machine, changes):
        lost.append(0.0)
    return {'lost': min(lost, default=None), 'impacts': run.totals.impacts}


def _begins_apart(machine: Machine, changes: Sequence[ModeChange]) -> bool:
    """True if a joint other than a stop has no contact under the forces at the start."""
    gaps = machine.equations.system.gaps
    joints = {gap.name: gap.joint for gap in gaps if not isinstance(gap, MotionBound)}
    begun = [x for x in changes if x.previous == Mode.UNKNOWN and x.joint in joints]
    closed = {joints[x.joint] for x in begun if x.mode != Mode.FREE_FLIGHT}
    return any(joints[x.joint] not in closed for x in begun)


def render(found: Sequence[StartAngle]) -> str:
    """Start angles as text, with the best ones."""
    rows = []
    for s in found:
        kept = math.isinf(s.followed)
        followed = 'all of it' if kept else f'{s.followed:.4f} rev'
        lost = '' if kept else f'{math.degrees(s.lost_at):.1f} deg'
        rows.append((f'{math.degrees(s.angle):.1f} deg', followed, lost, s.impacts))
    longest = max(s.followed for s in found)
    best = [s for s in found if math.isclose(s.followed, longest, rel_tol=_SAME)]
    head = 'start angle', 'follows for', 'loses it at', 'impacts'
    if len(best) < len(found):
        angles = ', '.join(f'{math.degrees(s.angle):.1f}' for s in best)
        note = f'of these, contact lasts longest from {angles} deg'
    else:
        how = 'is kept' if math.isinf(longest) else 'lasts equally long'
        note = f'contact {how} from all of these'
    return text([Section(table=[head, *rows], notes=[note], left=0)])


def to_json(found: Sequence[StartAngle]) -> list[dict[str, object]]:
    """Table as JSON; ``followed`` and ``lost_at`` are null where contact was kept."""
    keys = 'angle', 'followed', 'lost_at', 'impacts'
    return [{key: plain(getattr(s, key)) for key in keys} for s in found]
