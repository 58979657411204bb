"""The largest forces and efforts of a run: of its motion, else of the instants published."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from mechanism_sim.hybrid.peak_shapes import PeakShape
from mechanism_sim.results import ranges


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
