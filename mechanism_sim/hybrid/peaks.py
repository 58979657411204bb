"""The largest force in each joint and the largest torque of each drive, between impacts."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.peak_shapes import PeakOutlines, PeakShape
from mechanism_sim.hybrid.physics import Physics
from mechanism_sim.numerics.extremes import ExtremeSearch


class Peak(NamedTuple):
    """The largest magnitude of something."""

    value: float  #: [N] of a force; [N m] or [N] of a drive, with its sign
    time: float  #: [s]


class LoadPeaks:
    """Collects the peaks of a motion that comes in batches; impulses of impacts are no forces.

    Parameters
    ----------
    physics : of the machine; without forces there are no peaks
    since : [s] what is earlier does not count
    shapes : whether to look how long peaks last, as `PeakOutlines` do
    """

    def __init__(self, physics: Physics, since: float = -math.inf, shapes: bool = False) -> None:
        self._physics, self._since = physics, since
        self._joints = len(physics.joints) if physics.has_forces else 0
        groups = ['force'] * self._joints + list(physics.driven) * physics.has_forces
        positive = [i < self._joints for i in range(len(groups))]
        self._search = ExtremeSearch(groups, positive=positive)
        self._unbounded: dict[str, float] = {}  # joints, and when their forces have no limit [s]
        self._outlines = PeakOutlines(physics.loads, len(groups)) if shapes else None

    def add(self, motion: Motion) -> None:
        """Enter the segments that follow."""
        if self._joints and len(motion):
            self._search.add_motion(
                partial(self._physics.loads, motion), motion.curve, self._since
            )
            if self._outlines:
                self._outlines.add(motion, self._peaks())
            for found in self._physics.no_limits(motion):
                if found.t >= self._since:
                    self._unbounded |= dict.fromkeys(found.joints, found.t)

    @property
    def forces(self) -> dict[str, Peak]:
        """By joint, infinite where it has no limit; empty without motion or forces."""
        found = self._peaks()[: self._joints]
        unbounded = {joint: Peak(math.inf, t) for joint, t in self._unbounded.items()}
        return dict(zip(self._physics.joints, found, strict=False)) | unbounded

    @property
    def torques(self) -> dict[str, Peak]:
        """By driven coordinate; empty without motion or forces."""
        return dict(zip(self._physics.driven, self._peaks()[self._joints :], strict=False))

    @property
    def shapes(self) -> tuple[dict[str, PeakShape], dict[str, PeakShape]]:
        """Of the forces by joint and of the torques by coordinate, as far as they are known."""
        peaks = self._peaks()
        found = self._outlines.shapes(peaks) if self._outlines else []
        named = list(zip([*self._physics.joints, *self._physics.driven], found, strict=False))
        forces, torques = (
            {name: shape for name, shape in part if shape}
            for part in (named[: self._joints], named[self._joints :])
        )
        return forces, torques

    def _peaks(self) -> list[Peak]:
        s = self._search
        ends = zip(s.least, s.least_time, s.greatest, s.greatest_time, strict=True)
        found = [
            Peak(float(low), float(at_low)) if -low > high else Peak(float(high), float(at_high))
            for low, at_low, high, at_high in ends
        ]
        return found if not any(math.isnan(peak.time) for peak in found) else []
