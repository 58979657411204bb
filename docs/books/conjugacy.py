"""Test of two drawn flanks for conjugacy, by Kennedy's theorem ([V] ch. 5).

Gears that touch turn about the point K in which the common normal meets the line of centres, so
that w2/w3 = (K - C)/K, counted from the first centre. The ratio is constant if K stays. The flanks
may have any shape; nothing of involutes is known here.

Seen along its own tangent T, a unit vector, a point of contact P is where its flank z, t says:
P/T = z/t about the first centre, and (P - C)/T = -z/t about the second one, whose material lies on
the other side. So two points can touch where

    |z1/t1 + z2/t2| = C,    and then    T = C/(z1/t1 + z2/t2),

which is one equation for one unknown, the point of the second flank.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq

from mechanism_sim.errors import InputError

Array = NDArray[np.float64]
_Complex = NDArray[np.complex128]

#: number of points of the second flank between which contacts are sought
SAMPLES = 400


@dataclass(frozen=True)
class Contacts:
    """Contacts of two flanks, in the order of the angle of the first gear.

    The first centre is the origin, the second one lies on the x axis.

    Parameters
    ----------
    path : points of contact, (n, 2) [m]
    first, second : angles of the gears against their drawings, (n,) [rad]
    pitch_point : K, from the first centre along the line of centres, (n,) [m]
    ratio : speed of the first gear over that of the second, (n,); negative if K lies between the
        centres
    """

    path: Array
    first: Array
    second: Array
    pitch_point: Array
    ratio: Array

    @property
    def mean_ratio(self) -> float:
        """Mean of the greatest and the least ratio."""
        return 0.5 * float(self.ratio.max() + self.ratio.min())

    @property
    def deviation(self) -> float:
        """Largest relative deviation of the ratio from the mean; zero for conjugate flanks."""
        return 0.5 * float(np.ptp(self.ratio)) / abs(self.mean_ratio)


class _Place(NamedTuple):
    """Positions on a flank: points, unit tangents and curvatures [1/m]."""

    z: _Complex
    t: _Complex
    curvature: Array

    def at(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> _Place:
        """Some of the positions."""
        return _Place(self.z[chosen], self.t[chosen], self.curvature[chosen])


class _Flank:
    """The smooth curve through drawn points, over 0 to 1.

    From 1 to 2 the tip is an edge: the tangent turns by a right angle while the point stays.
    """

    def __init__(self, points: ArrayLike, edge: bool) -> None:
        xy = np.asarray(points, dtype=float)
        if xy.ndim != 2 or xy.shape[1] != 2 or len(xy) < 4 or not np.isfinite(xy).all():
            raise InputError('a flank is drawn by four points or more, each of finite x and y')
        if not (np.hypot(*np.diff(xy, axis=0).T) > 0.0).all():
            raise InputError('points of a flank lie on each other')
        degree = min(7, (len(xy) - 2) // 2 * 2 + 1)
        self.curve = make_interp_spline(np.linspace(0.0, 1.0, len(xy)), xy, k=degree)
        self.slopes = self.curve.derivative(), self.curve.derivative(2)
        self.end = 2.0 if edge else 1.0

    def __call__(self, u: ArrayLike) -> _Place:
        u = np.asarray(u, dtype=float)
        on_flank = np.minimum(u, 1.0)
        z, along, bend = (f(on_flank) @ (1.0, 1.0j) for f in (self.curve, *self.slopes))
        size = np.abs(along)
        t = along / size
        # the material is on the right, where an outward bulge turns to
        curvature = np.where(u > 1.0, math.inf, -(t.conj() * bend).imag / size**2)
        return _Place(z, t * np.exp(-0.5j * math.pi * (u - on_flank)), curvature)


def find_contacts(
    first: ArrayLike,
    second: ArrayLike,
    centre_distance: float,
    points: int = 200,
    edges: bool = False,
) -> Contacts:
    """All positions in which two flanks touch, and the ratio of speeds in each.

    One pair of flanks is followed by itself, without the teeth before and after it. Positions in
    which the flanks would cut into each other at the point of contact do not count.

    Parameters
    ----------
    first, second : points of either flank about its own centre, (n, 2), (m, 2) [m], from root to
        tip, with the material to the right of this way: the upper flank of a tooth about the x
        axis as `involute.Gear.flank` draws it, or the lower one of an internal tooth. A spline of
        degree 7 over the number of the point goes through them: no corners, and an even spacing
        or one that changes gradually
    centre_distance : C [m]
    points : number of tried positions on the first flank, evenly over its points
    edges : the tips as edges too, which touch where flanks do not, or have let go

    Raises
    ------
    InputError
        If there are too few points, or the flanks never touch.
    """
    if not 0.0 < centre_distance < math.inf:
        raise InputError('a centre distance is positive')
    one, two = _Flank(first, edges), _Flank(second, edges)
    u = np.linspace(0.0, one.end, points)
    v = np.linspace(0.0, two.end, SAMPLES)
    seen, other = one(u), two(v)

    def excess(a: _Complex, b: _Complex) -> Array:
        return np.asarray(np.abs(a + b) - centre_distance)

    from_first = seen.z / seen.t
    grid = excess(from_first[:, None], other.z / other.t)
    rows, columns = np.nonzero(np.signbit(grid[:, 1:]) != np.signbit(grid[:, :-1]))

    def miss(a: _Complex) -> Callable[[float], float]:
        def at(x: float) -> float:
            place = two(x)
            return float(excess(a, place.z / place.t))

        return at

    found = [
        brentq(miss(from_first[i]), v[k], v[k + 1], xtol=1e-15)
        for i, k in zip(rows, columns, strict=True)
    ]
    here, there = seen.at(rows), two(np.array(found))
    bulge = here.curvature + there.curvature
    # two edges have no normal; two straight lines touch all along, at one instant
    apart = (bulge > 1e-9 / centre_distance) & ((u[rows] <= 1.0) | (np.array(found) <= 1.0))
    if not apart.any():
        raise InputError(
            f'the flanks never touch{"" if edges else " but with their edges"} at a centre '
            f'distance of {1e3 * centre_distance:g} mm'
        )
    here, there = here.at(apart), there.at(apart)
    from_first = here.z / here.t
    tangent = centre_distance / (from_first + there.z / there.t)
    p = from_first * tangent
    pitch_point = from_first.real / tangent.real
    angle, partner = _angles(p / here.z), _angles((p - centre_distance) / there.z)
    order = np.argsort(angle)
    return Contacts(
        np.stack([p.real, p.imag], axis=1)[order],
        angle[order],
        partner[order],
        pitch_point[order],
        ((pitch_point - centre_distance) / pitch_point)[order],
    )


def _angles(turned: _Complex) -> Array:
    """Angles of vectors (n,), less than half a turn from the middle one [rad]."""
    middle = turned[len(turned) // 2]
    return np.asarray(np.angle(middle) + np.angle(turned / middle))
