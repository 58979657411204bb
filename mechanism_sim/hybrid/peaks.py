"""The largest force in each joint and the largest torque of each drive, between impacts."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.peak_shapes import PeakShape, peak_shape
from mechanism_sim.hybrid.physics import Physics
from mechanism_sim.numerics.extremes import ExtremeSearch
from mechanism_sim.numerics.polynomials import Nodes

_KEPT = 512  # segments of the motion before a batch, for peaks that begin there


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
    shapes : whether to look how long peaks last; of one that is longer than the segments that are
        kept to either side only that much is known
    """

    def __init__(self, physics: Physics, since: float = -math.inf, shapes: bool = False) -> None:
        self._physics, self._since = physics, since
        self._joints = len(physics.joints) if physics.has_forces else 0
        groups = ['force'] * self._joints + list(physics.driven) * physics.has_forces
        positive = [i < self._joints for i in range(len(groups))]
        self._search = ExtremeSearch(groups, positive=positive)
        self._unbounded: dict[str, float] = {}  # joints, and when their forces have no limit [s]
        self._shaped = shapes
        self._batches: list[Motion] = []  # the last ones
        self._tops: list[tuple[float, PeakShape] | None] = [None] * len(groups)
        self._seen = [-math.inf] * len(groups)  # [s] up to which the motion was known then

    def add(self, motion: Motion) -> None:
        """Enter the segments that follow."""
        if self._joints and len(motion):
            self._search.add_motion(
                partial(self._physics.loads, motion), motion.curve, self._since
            )
            if self._shaped:
                self._batches.append(motion)
                while sum(map(len, self._batches[1:])) >= _KEPT:
                    del self._batches[0]
                self._outline()
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
        self._outline(anyway=True)
        names, found = [*self._physics.joints, *self._physics.driven], []
        for name, peak, known in zip(names, self._peaks(), self._tops, strict=False):
            found.append((name, known[1]) if known and known[0] == peak.time else None)
        forces, torques = found[: self._joints], found[self._joints :]
        return dict(x for x in forces if x), dict(x for x in torques if x)

    def _outline(self, anyway: bool = False) -> None:
        """Look how long the peaks last that are new, or were not over before.

        Those that go on are looked at again when a quarter more is known of them, or `anyway`.
        """
        if not self._batches:
            return
        whole = Motion.joined(self._batches) if len(self._batches) > 1 else self._batches[0]
        curve = whole.curve
        for i, peak in enumerate(self._peaks()):
            known, seen = self._tops[i], self._seen[i]
            if not (curve.start[0] <= peak.time <= curve.end and peak.value):
                continue
            if known and known[0] == peak.time:
                shape = known[1]
                if shape.whole or shape.begin < curve.start[0] or seen == curve.end:
                    continue
                if not anyway and curve.end - seen < 0.25 * shape.duration:
                    continue

            def size(k: NDArray[np.intp], dt: Array | Nodes, i: int = i) -> Array:
                return np.asarray(np.abs(self._physics.loads(whole, k, dt)[i]))

            shape = peak_shape(size, curve, peak.time, abs(peak.value))
            self._tops[i], self._seen[i] = (peak.time, shape), curve.end

    def _peaks(self) -> list[Peak]:
        s = self._search
        ends = zip(s.least, s.least_time, s.greatest, s.greatest_time, strict=True)
        found = [
            Peak(float(low), float(at_low)) if -low > high else Peak(float(high), float(at_high))
            for low, at_low, high, at_high in ends
        ]
        return found if not any(math.isnan(peak.time) for peak in found) else []
