"""The scenes `valve_train` and `gear_rattle` written by hand, for any solver.

Each has one free coordinate: its *way* z from a wall, [m], which it cannot pass. In contact the
motion is known, so only flights are integrated; contact ends where the pull away from the wall
rises through zero. Plain functions of floats, which numba compiles as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, cos, pi, sin
from typing import Any, NamedTuple

import numpy as np

from benchmarks.four_bar import reference
from benchmarks.problem import Answer

HARD = 0.01
"""Impacts count whose approach is faster than this part of the fastest."""


class Valve(NamedTuple):
    """Cycloidal rise and return, one right after the other, from cam angle 0 on."""

    mass: float = 0.15  #: [kg]
    stiffness: float = 20e3  #: [N/m]
    preload: float = 201.4715  #: [N] with the weight, on the base circle
    lift: float = 8e-3  #: [m]
    span: float = 0.5 * pi  #: [rad]
    speed: float = 120.0 * pi  #: [rad/s]
    start: float = 10.0 / 9.0 * pi  #: [rad]


def leave_cam(t: float, z: float, _: float, p: Valve) -> float:
    """Acceleration of a valve's way z from its cam [m/s^2]."""
    x = (p.speed * t + p.start) % (2.0 * pi)
    rate = p.speed / p.span
    height = curve = 0.0
    if x < 2.0 * p.span:
        s = min(x, 2.0 * p.span - x) / p.span
        sine = sin(2.0 * pi * s)
        height = p.lift * (s - sine / (2.0 * pi))
        curve = rate * rate * p.lift * 2.0 * pi * sine
    return -(p.preload + p.stiffness * (z + height)) / p.mass - curve


class Wheel(NamedTuple):
    """A wheel with a shaken and braked shaft, against a pinion of constant speed."""

    pinion: float = 20e-3 * cos(pi / 9.0)  #: [m] base radius
    wheel: float = 40e-3 * cos(pi / 9.0)  #: [m]
    inertia: float = 1.5e-3  #: [kg m^2]
    swing: float = 3.0  #: [N m]
    frequency: float = 40.0 * pi  #: [rad/s]
    drag: float = 0.02  #: [N m s/rad]
    speed: float = 20.0 * pi  #: [rad/s] of the pinion


def cross_backlash(t: float, _: float, v: float, p: Wheel) -> float:
    """Acceleration of the pinion's lead along the line of action [m/s^2]."""
    rate = (v - p.pinion * p.speed) / p.wheel
    return p.wheel * (p.swing * sin(p.frequency * t) - p.drag * rate) / p.inertia


@dataclass(frozen=True)
class Rattling:
    """One free coordinate between walls.

    Attributes
    ----------
    pull : its acceleration in flight of time, way, rate and constants
    constants : of `pull`
    walls : [m] the lower and the upper; infinity where there is none
    restitution : of Newton
    seated : whether it begins in contact with the lower wall, or in the middle
    breaks : [s] instants within a period at which `pull` is not smooth
    period : [s]
    """

    name: str
    pull: Callable[[float, float, float, Any], float]
    constants: Any
    walls: tuple[float, float]
    restitution: float
    seated: bool
    period: float
    breaks: tuple[float, ...] = ()

    @property
    def duration(self) -> float:
        """[s] of the reference."""
        return float(reference(self.name)['duration'])

    @property
    def size(self) -> float:
        """[m] that tolerances are relative to: of the walls' distance, or a millimetre."""
        return min(self.walls[1] - self.walls[0], 1e-3)

    @property
    def longest(self) -> float:
        """Least time to look ahead for an event [s]."""
        return 0.01 * self.period

    def stops(self) -> Answer:
        """Instants at which `pull` is not smooth, and the end (n,) [s]."""
        turns = ceil(self.duration / self.period) + 1
        times = np.add.outer(self.period * np.arange(turns), self.breaks or (-1.0,)).ravel()
        inside = times[(times > 0.0) & (times < self.duration)]
        return np.sort(np.append(inside, self.duration))

    def hard(self, times: Answer, speeds: Answer) -> Answer:
        """Times of the impacts that count [s]."""
        return times[speeds > self._slowest]

    @property
    def _slowest(self) -> float:
        return HARD * max(map(float, reference(self.name)['impacts']['approach_speed']))

    def error(self, answer: Answer) -> float:
        """Largest error of the times of impacts [s]; not a number if there are more or fewer."""
        right = np.array(reference(self.name)['impacts']['t'], float)
        if answer.shape != right.shape:
            return float('nan')
        return float(np.abs(answer - right).max())


VALVE = Rattling(
    'valve_train',
    leave_cam,
    Valve(),
    (0.0, np.inf),
    0.3,
    seated=True,
    period=1.0 / 60.0,
    breaks=tuple((k * 90.0 + 160.0) % 360.0 / 21600.0 for k in range(3)),
)
_PLAY = 0.1e-3 * cos(pi / 9.0)
GEARS = Rattling(
    'gear_rattle',
    cross_backlash,
    Wheel(),
    (-0.5 * _PLAY, 0.5 * _PLAY),
    0.6,
    seated=False,
    period=0.1,
)
