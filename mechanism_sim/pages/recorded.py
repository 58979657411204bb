"""The frames of a run: as many instants of it as a page can hold, and its impacts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from mechanism_sim.analysis.record import Record
from mechanism_sim.arrays import Array
from mechanism_sim.engine.events import Impacts
from mechanism_sim.export.stage import Stage, StageFrames, Swaying, packed, stage_of
from mechanism_sim.results.run import instants
from mechanism_sim.scene import Machine

PER_TURN = 120
"""Instants in a turn of the main drive."""
NEAR = 1e-3
"""Share of the clearance by which a pin may be off its place between two instants."""
AWAY = 0.05
"""Share of the clearance by which a pin is visibly off its place."""
MOST = 20_000
"""Instants of a run at most, beside those at events; and impacts."""

_OTHERS = 40  # instants in a turn of any other link
_LEAST = 300  # least number of instants of a run
_BYTES = 2_000_000  # bytes of all instants; events may add a quarter
_BLOCK = 4096  # instants observed at a time
_SEEN = 1500  # instants by which sizes are chosen


@dataclass(frozen=True, eq=False)
class Recorded:
    """A run as a page shows it."""

    record: Record
    stage: Stage
    frames: StageFrames
    impacts: Impacts  #: the hardest of them, in the order of time
    hardest: float  #: impulse [N s] of the hardest; 0 if there is none
    left_out: int  #: number of impacts not among them
    away: float  #: share of the time in which a pin is shown more than `AWAY` from its place

    def to_json(self) -> dict[str, Any]:
        """Plain data of the run; see `Stage.to_json`, `StageFrames.packed`."""
        column, names = self.impacts.column, self.impacts.names
        struck = {gap: self.stage.struck(gap) for gap in np.unique(names)}
        return {
            'stage': self.stage.to_json(),
            'frames': self.frames.packed(),
            'impacts': {
                't': packed(column('t')),
                'bearing': packed(np.array([struck[gap][0] for gap in names], np.int16)),
                'joint': packed(np.array([struck[gap][1] for gap in names], np.int16)),
                'angle': packed(column('normal_angle').astype(np.float32)),
                'impulse': packed(column('normal_impulse').astype(np.float32)),
                'hardest': self.hardest,
            },
        }


def recorded(record: Record, show: Callable[[float, int], None] | None = None) -> Recorded:
    """The frames of a run.

    Parameters
    ----------
    show : called now and then with the time [s] up to which frames are made, and impacts so far
    """
    many = np.linspace(record.start, record.end, _SEEN)
    sway = Swaying(record.machine).take(record.history)
    stage = stage_of(record.machine, record.piece.view(many).observed, sway(many))
    # bytes of an instant on the page
    numbers = 3 * len(stage.links) + 4 * len(stage.bearings) + 2 * len(stage.joints)
    numbers += 3 * len(stage.plays) + 3 * len(stage.skeleton.mounts)
    size = 16 + 4 * numbers + len(stage.bearings) + len(stage.plays)
    most = min(MOST, _BYTES // size)
    struck = record.piece.impacts
    impulse, among = struck.column('normal_impulse'), np.zeros(len(struck), bool)
    among[np.argsort(-impulse, kind='stable')[:MOST]] = True
    kept = struck.where(among)
    t = times_of(record, most, most // 8)
    parts = []

    def framed(t: Array) -> StageFrames:
        view = record.piece.view(t)
        return stage.frames(t, view.observed, view.modes, sway(t))

    for first in range(0, len(t), _BLOCK):
        some = t[first : first + _BLOCK]
        parts.append(framed(some))
        if show:
            show(float(some[-1]), int(np.searchsorted(kept.column('t'), some[-1])))
    hardest = float(impulse.max(initial=0.0))
    left_out = len(struck) - len(kept)
    frames = StageFrames.joined(parts)
    away = _away(record.machine, frames, framed(0.5 * (many[1:] + many[:-1])))
    return Recorded(record, stage, frames, kept, hardest, left_out, away)


def _away(machine: Machine, frames: StageFrames, true: StageFrames) -> float:
    """Share of instants at which a pin is not where the cubics of a page have it."""
    cubics = scipy.interpolate.CubicHermiteSpline(frames.t, frames.pins, frames.pin_rates)
    off = cubics(true.t) - true.pins
    radial = np.array([machine.plan.clearances[joint.name].radial for joint in machine.bearings])
    return float((AWAY * radial < np.hypot(*off.T).T).any(axis=1).mean())


def together(*runs: Recorded) -> tuple[Recorded, ...]:
    """Several runs on stages that hold all of them."""
    low = np.min([run.stage.low for run in runs], axis=0)
    high = np.max([run.stage.high for run in runs], axis=0)
    return tuple(replace(run, stage=replace(run.stage, low=low, high=high)) for run in runs)


def times_of(record: Record, most: int, events: int = 0) -> Array:
    """The instants of a page (N,) [s]: limited in number, and both sides of events."""
    # Instants [1/s] where steps meet: more where the machine is faster. There are `PER_TURN` in
    # a turn of the main drive, and as many as it takes for pins to stay in their places between
    # them, see `NEAR`.
    machine, curve = record.machine, record.piece.motion.curve
    t = np.append(curve.start, curve.end)
    k = np.append(np.arange(len(curve)), len(curve) - 1)
    slides = np.isin(machine.physics.coordinates, machine.physics.displacements)
    main = np.array(machine.physics.coordinates) == machine.plan.main
    weight = np.where(main, PER_TURN, _OTHERS) / (2.0 * np.pi)
    weight /= np.where(slides, machine.mechanism.size, 1.0)
    dense = (np.abs(curve.at(k, t - curve.start[k], 1)) * weight).max(axis=1)
    dense += _LEAST / (record.end - record.start)
    if record.loose_joints:
        # a cubic through places and rates is off by h^4 / 384 of the fourth derivative
        fourth = np.abs(curve.at(k, t - curve.start[k], 4))
        fourth = (fourth * np.where(slides, 1.0, machine.mechanism.size)).max(axis=1)
        radial = min(machine.plan.clearances[joint.name].radial for joint in machine.bearings)
        dense = np.maximum(dense, (fourth / (384.0 * NEAR * radial)) ** 0.25)
    return instants(record.piece, record.start, record.end, dense, 1, most, events)
