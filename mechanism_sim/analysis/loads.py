"""Forces, torque and the balance of energy over a run.

The largest force and torque are those of the recorded motion. Where that or the scene is not in a
bag, they are those of the instants that were published.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mechanism_sim.hybrid.peak_shapes import PeakShape
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.ranges import LoadPeaks, Ranges
from mechanism_sim.scene import Machine


@dataclass(frozen=True)
class Peak:
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
    """The largest force in each joint and the largest torque of the drive, between impacts."""

    samples: int | None  #: instants that were published, if that is all there is; None: the motion
    joints: tuple[Peak, ...]
    drive_torque: Peak
    moments: tuple[Peak, ...] = ()  #: [N m] of bearings that tilt


@dataclass(frozen=True)
class EnergySummary:
    """Where the energy went: kinetic + potential - initial - drive work + dissipated = residual.

    All in [J]; the residual would be 0 without errors of integration.
    """

    samples: int
    initial: float
    final: float
    drive_work: float
    dissipated: float
    residual_at_end: float
    largest_residual: float  #: magnitude
    largest_residual_time: float  #: [s]
    largest_energy: float  #: the largest term of the balance
    exchanged: float  #: sum of the changes of all terms from instant to instant, which no height
    #: that is called zero is part of: to measure the residual by


class LoadCollector:
    """Keeps the peaks of JointReactions messages."""

    def __init__(self) -> None:
        self.samples = 0
        self._force: dict[str, tuple[float, float]] = {}
        self._moment: dict[str, tuple[float, float]] = {}
        self._torque = (0.0, 0.0)

    def add(self, message: Any) -> None:
        """Take in one instant."""
        time = float(message.time)
        if not self.samples or abs(message.drive_torque) > abs(self._torque[0]):
            self._torque = (float(message.drive_torque), time)
        self.samples += 1
        m = message
        for largest, rows in (
            (self._force, zip(m.joints, m.force_x, m.force_y, strict=True)),
            (self._moment, zip(m.joints, m.moment_x, m.moment_y, strict=False)),
        ):
            for joint, x, y in rows:
                size = math.hypot(x, y)
                if math.isnan(size):  # it has no limit at this instant
                    continue
                if joint not in largest or size > largest[joint][0]:
                    largest[joint] = (size, time)

    def summary(self, crank_angle: Callable[[float], float | None]) -> LoadSummary | None:
        """Return the peaks; None without a message.

        Args:
            crank_angle: Angle [rad] of the crank at a time [s].

        """
        if not self.samples:
            return None
        peaks, moments = (
            tuple(Peak(joint, x, time, crank_angle(time)) for joint, (x, time) in found.items())
            for found in (self._force, self._moment)
        )
        torque, time = self._torque
        return LoadSummary(
            self.samples,
            peaks,
            Peak('drive', torque, time, crank_angle(time)),
            tuple(peak for peak in moments if peak.value),
        )


def of_motion(
    peaks: LoadPeaks, bearings: BearingPeaks, crank_angle: Callable[[float], float | None]
) -> LoadSummary | None:
    """The peaks of a motion; None if it has no forces.

    Args:
        peaks: Of all of its segments.
        bearings: Of shafts, likewise.
        crank_angle: Angle [rad] of the crank at a time [s].

    """
    if not peaks.forces:
        return None

    def peak(name: str, value: float, time: float) -> Peak:
        return Peak(name, value, time, crank_angle(time))

    of_forces, of_torques = peaks.shapes
    joints = tuple(
        _shaped(peak(joint, *found), of_forces.get(joint)) for joint, found in peaks.forces.items()
    )
    torque = next(iter(peaks.torques.values()), (0.0, joints[0].time))
    drive = _shaped(peak('drive', *torque), next(iter(of_torques.values()), None))
    forces, moments = bearings.peaks(crank_angle)
    return LoadSummary(None, (*joints, *forces), drive, moments)


def _shaped(peak: Peak, shape: PeakShape | None) -> Peak:
    """A peak with how long it lasts, if that is known."""
    if shape is None:
        return peak
    return replace(peak, duration=shape.duration, impulse=shape.impulse, whole=shape.whole)


_OF_BEARINGS = ('bearing_force', 'size'), ('bearing_force', 'axial'), ('bearing_moment', 'size')


class BearingPeaks:
    """The largest loads of bearings of shafts, and of bearings that tilt."""

    def __init__(self, machine: Machine) -> None:
        chosen = [
            quantity
            for quantity in catalogue(machine).values()
            if (quantity.kind, quantity.part) in _OF_BEARINGS
            or (quantity.kind == 'axial_force' and quantity.of in machine.physics.tilting)
        ]
        of = [*dict.fromkeys(quantity.of for quantity in chosen)]
        chosen.sort(key=lambda q: (of.index(q.of), q.part == 'axial'))
        self._ranges = Ranges(machine, [quantity.name for quantity in chosen], shapes=True)
        self.add = self._ranges.add

    def peaks(
        self, crank_angle: Callable[[float], float | None]
    ) -> tuple[tuple[Peak, ...], tuple[Peak, ...]]:
        """Forces by ``SHAFT.BEARING``, and ``.axial`` with their sign; moments by joint."""
        forces: list[Peak] = []
        moments: list[Peak] = []
        shapes = self._ranges.shapes()
        for name, (value, time) in self._ranges.peaks().items():
            kind, _, of = name.removesuffix('.size').partition('.')
            of += '.axial' if kind == 'axial_force' else ''
            peak = _shaped(Peak(of, value, time, crank_angle(time)), shapes.get(name))
            (moments if kind == 'bearing_moment' else forces).append(peak)
        return tuple(forces), tuple(moments)


class EnergyCollector:
    """Follows the balance through LinkageState messages, from the first of them on."""

    def __init__(self) -> None:
        self.samples = 0
        self._first = self._last = np.zeros(4)
        self._residual, self._worst, self._worst_time, self._scale = 0.0, 0.0, 0.0, 0.0
        self._exchanged = 0.0

    def add(self, message: Any) -> None:
        """Take in one instant; without masses in the scene there are no energies to balance."""
        if np.isnan(message.kinetic_energy):
            return
        terms = np.array(
            [
                message.kinetic_energy,
                message.potential_energy,
                message.drive_work,
                message.dissipated,
            ]
        )
        if not self.samples:
            self._first = terms
            self._worst_time = float(message.time)
        self.samples += 1
        self._exchanged += float(np.abs(terms - self._last).sum()) if self.samples > 1 else 0.0
        self._last = terms
        # Term by term against the first instant: large energies do not hide small changes.
        kinetic, potential, work, dissipated = terms - self._first
        self._residual = kinetic + potential - work + dissipated
        self._scale = max(self._scale, float(np.max(np.abs(terms))))
        if abs(self._residual) > self._worst:
            self._worst, self._worst_time = abs(self._residual), float(message.time)

    def summary(self) -> EnergySummary | None:
        """Return the balance; None without a message."""
        if not self.samples:
            return None
        return EnergySummary(
            samples=self.samples,
            initial=float(self._first[:2].sum()),
            final=float(self._last[:2].sum()),
            drive_work=float(self._last[2] - self._first[2]),
            dissipated=float(self._last[3] - self._first[3]),
            residual_at_end=float(self._residual),
            largest_residual=float(self._worst),
            largest_residual_time=self._worst_time,
            largest_energy=self._scale,
            exchanged=self._exchanged,
        )
