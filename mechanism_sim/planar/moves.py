"""Moves from rest to rest in the least time under limits of speed, acceleration and jerk."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from mechanism_sim.planar.drive import DriveLaw


@dataclass(frozen=True)
class MoveLimits:
    """Largest sizes of the derivatives of a motion, all positive."""

    speed: float  #: [rad/s, m/s]
    acceleration: float  #: [rad/s^2, m/s^2]
    jerk: float = math.inf  #: [rad/s^3, m/s^3]


def phases(distance: float, limits: MoveLimits) -> list[tuple[float, float, float]]:
    """Duration [s], acceleration at its start and jerk of each phase of a move.

    Up to seven: acceleration rises, stays and falls; steady speed; the same to come to rest.
    (L. Biagiotti, C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, 3.4.)

    Parameters
    ----------
    distance : [rad, m], with its sign
    """
    v, a, j = limits.speed, limits.acceleration, limits.jerk
    way, sign = abs(distance), math.copysign(1.0, distance)
    rise = 0.0 if math.isinf(j) else min(a / j, math.sqrt(v / j))  # [s] of the jerk
    ramp = v / a + rise if math.isinf(j) or v * j >= a * a else 2.0 * rise  # [s] up to full speed
    steady = way / v - ramp
    if steady < 0.0:  # full speed is not reached
        steady = 0.0
        if math.isinf(j) or way * j * j >= 2.0 * a**3:
            rise = 0.0 if math.isinf(j) else a / j
            ramp = 0.5 * rise + math.sqrt(0.25 * rise * rise + way / a)
        else:
            rise = math.cbrt(0.5 * way / j)
            ramp = 2.0 * rise
    peak = (way / (steady + ramp)) / (ramp - rise) * sign  # acceleration that goes all the way
    jerk = peak / rise if rise else 0.0
    hold = max(0.0, ramp - 2.0 * rise)
    found = [(rise, 0.0, jerk), (hold, peak, 0.0), (rise, peak, -jerk), (steady, 0.0, 0.0)]
    found += [(rise, 0.0, -jerk), (hold, -peak, 0.0), (rise, -peak, jerk)]
    return [phase for phase in found if phase[0] > 0.0]


def move_laws(
    start: DriveLaw, steps: Sequence[tuple[float, float | MoveLimits]]
) -> list[DriveLaw]:
    """The laws of moves one after the other, the first from rest at time zero.

    Parameters
    ----------
    start : where the coordinate is at first
    steps : goal [rad, m] and limits of each move; or nothing and how long it rests [s]
    """
    laws = [replace(start, coefficients=(start.coefficients[0], 0.0))]
    goal, time = start.about(Fraction(0))[1][0] + start.turns * 2.0 * math.pi, 0.0
    for place, how in steps:
        if not isinstance(how, MoveLimits):
            time += how
            continue
        for duration, acceleration, jerk in phases(place - goal, how) if place != goal else ():
            turns, (angle, rate, *_) = laws[-1].about(Fraction(time))
            row = angle, rate, 0.5 * acceleration, jerk / 6.0
            laws.append(DriveLaw(start.coordinate, row, time, time, start.straight, turns))
            time += duration
        goal = place
        laws.append(DriveLaw(start.coordinate, (goal, 0.0), time, time, start.straight))
    if time > laws[-1].valid_from:  # it rests at the end
        laws.append(DriveLaw(start.coordinate, (goal, 0.0), time, time, start.straight))
    later = [*laws[1:], None]  # where a move follows at once, nothing rests
    return [
        law
        for law, after in zip(laws, later, strict=True)
        if after is None or after.valid_from > law.valid_from
    ]
