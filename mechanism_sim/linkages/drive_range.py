"""Limits of the drive of a linkage that cannot turn round: the two ends of its motion.

All coordinates, that of the drive among them, are followed along the curve on which the loops
are closed, by its arc length (Keller's pseudo-arclength continuation). At a limit the curve
turns back: the drive stands still while the other coordinates go on. The curve itself is smooth
there, so that a limit is found to rounding, and so is the position of every link at it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.planar.kinematics import Kinematics

_STEP, _SHORTEST = 0.05, 1e-9  # of the arc: radians, or sizes of the mechanism
_TURNS = 0.2  # [rad] by which the direction of the curve may change in a step
_NEWTON, _FITS = 12, 1e-13
_ROUNDED = 4.0 * 2.0**-52  # no other derivatives after a correction as small
_MOST = 20_000  # steps to one side
_STILL = 1e-9  # rate of the drive along the arc: less is none


@dataclass(frozen=True)
class DriveRange:
    """The positions of a drive between which a mechanism moves, on the branch on which it starts.

    Attributes
    ----------
    low, high : the limits [rad, m]; infinite where none was found within reach
    at_low, at_high : all coordinates (n,) there, or where the search ended
    """

    low: float
    high: float
    at_low: Array
    at_high: Array

    @property
    def limited(self) -> bool:
        """True if there is a limit on either side."""
        return math.isfinite(self.low) or math.isfinite(self.high)


def drive_range(kinematics: Kinematics, q: Array, reach: float) -> DriveRange:
    """Limits of a mechanism's drive, from an assembled position.

    Parameters
    ----------
    kinematics : its closures, with the coordinate of its single drive held
    q : (n,) the position
    reach : how far from there limits are looked for [rad, m]
    """
    drive = kinematics.held[0]
    low, at_low = _limit(kinematics, q, -reach)
    high, at_high = _limit(kinematics, q, reach)
    # a start at a limit itself leaves it the same way in both directions
    if math.isfinite(low) and low > q[drive]:
        low, at_low = float(q[drive]), q
    if math.isfinite(high) and high < q[drive]:
        high, at_high = float(q[drive]), q
    return DriveRange(low, high, at_low, at_high)


def placed_at(kinematics: Kinematics, q: Array, value: float) -> Array | None:
    """Coordinates (n,) with the drive at a value, on the branch on which q (n,) is.

    None where a limit is in between.
    """
    drive = kinematics.held[0]
    reach = value - float(q[drive])
    if not reach:
        return q
    place, slope, step = _walked(kinematics, q, reach)
    if not step:
        return None
    if _rate(kinematics, place, slope, step)[drive] * reach <= 0.0:
        step = _turning_way(kinematics, place, slope, step)

    def beyond(way: float) -> float:
        return float(_ahead(kinematics, place, slope, way)[drive]) - value

    if beyond(step) * reach < 0.0:
        return None
    return _ahead(
        kinematics, place, slope, float(scipy.optimize.brentq(beyond, 0.0, step, xtol=1e-15))
    )


def _limit(kinematics: Kinematics, q: Array, reach: float) -> tuple[float, Array]:
    """Limit in one direction, infinite if none is within reach; and the coordinates (n,) there."""
    drive = kinematics.held[0]
    place, slope, step = _walked(kinematics, q, reach)
    if step and _rate(kinematics, place, slope, step)[drive] * reach > 0.0:
        return math.copysign(math.inf, reach), place
    way = _turning_way(kinematics, place, slope, step) if step else 0.0
    found = _ahead(kinematics, place, slope, way)
    return float(found[drive]), found


def _walked(kinematics: Kinematics, q: Array, reach: float) -> tuple[Array, Array, float]:
    """Place (n,) before the drive has gone so far or turns back, direction, and step beyond that.

    The step is zero where the curve goes no farther.
    """
    drive, way, step = kinematics.held[0], math.copysign(1.0, reach), _STEP
    place, start = q, float(q[drive])
    slope = _tangent(kinematics, kinematics.closure(q[:, None])[1])
    if abs(slope[drive]) < _STILL:
        return q, slope, 0.0
    slope *= way * math.copysign(1.0, slope[drive])
    for _ in range(_MOST):
        found = _corrected(kinematics, place, slope, step)
        if found is None or float(found[1] @ slope) < math.cos(_TURNS):
            if step > _SHORTEST:
                step *= 0.5
                continue
            if found is None:
                return place, slope, 0.0  # no loop can be closed farther on
        ahead, turned = found
        if way * turned[drive] <= 0.0 or way * (ahead[drive] - start) > abs(reach):
            break
        place, slope, step = ahead, turned, min(_STEP, 1.5 * step)
    return place, slope, step


def _turning_way(kinematics: Kinematics, q: Array, slope: Array, step: float) -> float:
    """Arc length within a step at which the drive's direction reverses."""
    drive = kinematics.held[0]

    def rate(way: float) -> float:
        return float(_rate(kinematics, q, slope, way)[drive])

    return float(scipy.optimize.brentq(rate, 0.0, step, xtol=1e-15))


def _ahead(kinematics: Kinematics, q: Array, slope: Array, way: float) -> Array:
    """Coordinates (n,) some distance along the arc, which is known to go on there."""
    found = _corrected(kinematics, q, slope, way) if way else (q,)
    return q + way * slope * kinematics.scale if found is None else found[0]


def _rate(kinematics: Kinematics, q: Array, slope: Array, way: float) -> Array:
    """Direction (n,) of the curve there."""
    place = _ahead(kinematics, q, slope, way)
    here = _tangent(kinematics, kinematics.closure(place[:, None])[1])
    return here * math.copysign(1.0, float(here @ slope))


def _tangent(kinematics: Kinematics, J: Array) -> Array:
    """Direction (n,), of length one and free of units, of the curve of closed loops.

    J (1, r, n) are the derivatives of the closures [m].
    """
    if not J.shape[1]:
        return np.ones(1)
    return np.asarray(np.linalg.svd(J[0] * kinematics.scale / kinematics.mechanism.size)[2][-1])


def _corrected(
    kinematics: Kinematics, q: Array, slope: Array, step: float
) -> tuple[Array, Array] | None:
    """Coordinates (n,) with closed loops, a step along the tangent, and the direction there.

    None where there are none. The direction (n,) is the one that goes on as `slope`.
    """
    scale, size = kinematics.scale, kinematics.mechanism.size
    place = q + step * slope * scale
    closure = kinematics.closure(place[:, None])
    for _ in range(_NEWTON):
        off, J = closure[0][0] / size, closure[1][0] * scale / size
        if not (np.isfinite(off).all() and np.isfinite(J).all()):
            return None
        along = float(slope @ ((place - q) / scale)) - step
        change = np.linalg.lstsq(np.vstack([J, slope]), -np.append(off, along), rcond=1e-13)[0]
        place = place + change * scale
        most, size_here = np.abs(change).max(), 1.0 + np.abs(place / scale).max()
        if most > 0.5:
            return None
        if most > _ROUNDED * size_here:  # less is rounding, as on a straight curve
            closure = kinematics.closure(place[:, None])
        if most <= _FITS * size_here:
            break
    if kinematics.open_beyond_rounding(place[:, None], 8.0, closure=closure)[0]:
        return None
    turned = _tangent(kinematics, closure[1])
    return place, turned * math.copysign(1.0, float(turned @ slope))
