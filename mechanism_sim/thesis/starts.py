"""Trial and error over the start angle ([SB] 6.1): how long a seated pin follows."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.strict_json import plain


@dataclass(frozen=True)
class StartAngle:
    """A seated start at one crank angle.

    Attributes
    ----------
    angle : of the crank [rad]
    followed : revolutions until contact was first lost in any joint; infinite if it was kept
    impacts : in all revolutions
    sense : 1 if the crank turns counterclockwise, -1 if clockwise
    """

    angle: float
    followed: float
    impacts: int
    sense: int = 1

    @property
    def lost_at(self) -> float:
        """Where the crank is when contact is first lost [rad], in [0, 2 pi); nan if it is kept."""
        if math.isinf(self.followed):
            return math.nan
        return (self.angle + self.sense * 2.0 * math.pi * self.followed) % (2.0 * math.pi)


def starts(
    machine: Machine,
    angles: int = 24,
    revolutions: float = 3.0,
    progress: Callable[[int], None] | None = None,
) -> list[StartAngle]:
    """Seated starts at so many crank angles around the turn, in the order of the angles."""
    if machine.torque_driven or len(machine.laws) > 1 or not machine.clearances:
        raise InputError(f'{machine.name}: this needs clearance and a crank at constant speed')
    if angles < 1:
        raise InputError('at least one start angle is needed')
    found = []
    for k in range(angles):
        angle = 2.0 * math.pi * k / angles
        scene = machine.started_at(angle).scene.model_copy(update={'start': 'seated'})
        solution = simulate(type(machine)(machine.name, scene), revolutions=revolutions)
        lost = [m.t for m in solution.modes if m.mode == Mode.FREE_FLIGHT]
        followed = min(lost) / machine.period if lost else math.inf
        sense = 1 if machine.start_of_crank[1] > 0.0 else -1
        found.append(StartAngle(angle, followed, len(solution.impacts), sense))
        if progress:
            progress(k + 1)
    return found


def render(found: Sequence[StartAngle]) -> str:
    """Start angles for people, the best one named."""
    lines = ['start angle   follows for     loses it at   impacts']
    for s in found:
        followed = f'{s.followed:.4f} rev' if math.isfinite(s.followed) else 'all of it'
        lost = f'{math.degrees(s.lost_at):.1f} deg' if math.isfinite(s.followed) else ''
        lines.append(
            f'{math.degrees(s.angle):8.1f} deg  {followed:>12}  {lost:>14}  {s.impacts:8d}'
        )
    best = max(found, key=lambda s: s.followed)
    lines.append(f'of these, contact lasts longest from {math.degrees(best.angle):.1f} deg')
    return '\n'.join(lines)


def to_json(found: Sequence[StartAngle]) -> list[dict[str, object]]:
    """Table as JSON; ``followed`` and ``lost_at`` are null where contact was kept."""
    keys = 'angle', 'followed', 'lost_at', 'impacts'
    return [{key: plain(getattr(s, key)) for key in keys} for s in found]
