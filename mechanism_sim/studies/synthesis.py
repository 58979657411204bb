"""Four-bars whose coupler point takes a path: from an atlas of coupler curves to least squares.

The atlas is made anew each time, by a sequence of Sobol: proportions of four-bars whose crank
turns, with a point of the coupler. Translation, rotation and scale of a curve are those that fit a
path best; they are complex numbers in ``z = a P + b``, and follow from a linear regression. Closed
paths are compared by their Fourier descriptors, the coefficients of ``P`` over the length of the
curve, where another start is a factor of each (Ullah and Kota, J. Mech. Des. 119 (1997) 504-510);
open ones with arcs of the curves; those with angles of the crank at these angles. From the best of
them least squares go on, over the proportions and the crank angle of each point.

A solution is on one branch and circuit, since its crank turns, and takes the points in order.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.grashof import full_turns, transmission_range
from mechanism_sim.results.path_distance import TargetPath

_CURVES, _PLACES = 1 << 16, 96
"""Number of four-bars of the atlas, before a crank check, and of points on each curve."""
_LOW, _HIGH = np.array([0.3, 0.3, 0.3, -1.0, -1.5]), np.array([8.0, 8.0, 8.0, 2.0, 1.5])
"""Ranges of ground, coupler, rocker in cranks; of the point along and across, in couplers."""
_TURN = 2.0 * math.pi
_HARMONICS = np.array([k for k in range(-10, 11) if k])
_ARCS = np.linspace(0.08, 0.88, 9)  # shares of curves with which open paths are compared
_TRIED, KEPT = 60, 5
"""Number of curves from which least squares start, and of solutions kept."""
_POLISHED = 20
_EXACT = 1e-6  # share of the size of a path: deviations below those of any machine
_PHASES = 48
_COMPARED = 12  # number of points of an open path that are compared with arcs
_LARGEST = 30.0
"""Greatest lengths, and distance of the point from the crank pin, in sizes of the path."""
_MARGIN, _WEIGHT = 0.01, 10.0
"""Margin of the transmission angle [rad]; weight of violated limits beside distances."""
_LONGEST, _FARTHEST = 12.0, 3.0
"""Greatest ratio of lengths to the crank, either way; of the point to the coupler."""
_LEAST_TURN = 0.3
"""Least rotation of the crank along a path [rad]; arcs start with half a radian or more."""
_NEAR = 1e-6
"""Weight of unknowns, less those where least squares begin: it moves exact points by 1e-12."""
_STEP = 1e-6  # step of central differences: the third root of the rounding


@dataclass(frozen=True)
class PathFourBar:
    """A four-bar whose coupler point takes a path, in SI units.

    Attributes
    ----------
    lengths : lengths of ground, crank, coupler and rocker [m]
    branch : branch, see `FourBar`
    pivot : position of the crank's pivot [m]
    angle : direction from the pivot of the crank to that of the rocker [rad]
    point : coupler point, along and across the coupler from the crank pin [m]
    start : absolute angle of the crank at the beginning of the path [rad]
    forward : True if the crank turns counterclockwise
    rms, largest : distances of the points from the path [m]
    transmission : least and greatest transmission angle [rad]
    orientation : orientation of a body to be guided less the angle of the coupler [rad]
    turned : largest error of orientations [rad]
    """

    lengths: tuple[float, float, float, float]
    branch: str
    pivot: tuple[float, float]
    angle: float
    point: tuple[float, float]
    start: float
    forward: bool
    rms: float
    largest: float
    transmission: tuple[float, float]
    orientation: float = 0.0
    turned: float = 0.0

    ASSUMED: ClassVar[str] = (
        'masses, and forces by them, are assumed: uniform bars of 1 kg per metre'  #: in a scene
    )

    def worth(self, size: float) -> tuple[float, float]:
        """Sort key of four-bars for a path of a size [m], the best first.

        Of those that are exact the one with the best transmission is first.
        """
        return max(self.rms, _EXACT * size), -worst_transmission(self.transmission)

    def scene(self, file: str) -> dict[str, Any]:
        """A scene of uniform bars of 1 kg/m, with the distance from a file as a measure."""
        ground, crank, coupler, rocker = self.lengths
        four = FourBar(ground, crank, coupler, rocker, self.branch)  # type: ignore[arg-type]
        th3, th4 = four.positions(np.array([self.start - self.angle]))
        end = complex(*self.pivot) + ground * np.exp(1j * self.angle)
        links: dict[str, Any] = {
            name: {'length': x, 'mass': x, 'inertia': x**3 / 12.0, 'cog': 0.5 * x}
            for name, x in (('crank', crank), ('coupler', coupler), ('rocker', rocker))
        }
        links['coupler']['points'] = {'E': [*self.point]}
        pivots = {'points': {'O': [*self.pivot], 'B': [float(end.real), float(end.imag)]}}
        return {
            'title': f'Four-bar for the path {file}', 'mechanism': 'linkage',
            'links': {'ground': pivots, **links},
            'joints': {
                'ground_crank': {'revolute': ['ground.O', 'crank']},
                'crank_coupler': {'revolute': ['crank.end', 'coupler']},
                'coupler_rocker': {'revolute': ['coupler.end', 'rocker.end']},
                'rocker_ground': {'revolute': ['rocker', 'ground.B']},
            },
            'drive': {'coordinate': 'crank', 'speed': f'{60 if self.forward else -60} rpm',
                      'start_angle': self.start},
            'guess': {'coupler': float(th3[0] + self.angle), 'rocker': float(th4[0] + self.angle)},
            'measures': {'path_error': f'distance(position.coupler.E, {file})'},
        }  # fmt: skip


def _curve(shapes: Array, angles: Array) -> Array:
    """Coupler points, complex, of four-bars (5, ...) in cranks, at angles from the ground."""
    ground, coupler, rocker, along, across = shapes
    th3, _ = FourBar(ground, 1.0, coupler, rocker).positions(angles)
    return np.asarray(np.exp(1j * angles) + (along + 1j * across) * coupler * np.exp(1j * th3))


def _lengths(shapes: Array) -> Array:
    return np.array([shapes[0], np.ones_like(shapes[0]), shapes[1], shapes[2]])


def worst_transmission(transmission: tuple[float, float]) -> float:
    """Least distance of the transmission angle from 0 and from pi [rad]."""
    return min(transmission[0], math.pi - transmission[1])


def unlike(found: Iterable[PathFourBar]) -> list[PathFourBar]:
    """Four-bars whose lengths differ from those of all before."""
    kept: list[PathFourBar] = []
    for one in found:
        if all(not np.allclose(one.lengths, k.lengths, rtol=1e-3) for k in kept):
            kept.append(one)
    return kept


def _misfit(z: Array, curves: Array) -> Array:
    """Sum of squares (...) of points (n,) after the best translation, rotation and scale."""
    z = z - z.mean()
    curves = curves - curves.mean(axis=-1, keepdims=True)
    common = np.abs((curves.conj() * z).sum(axis=-1)) ** 2
    size = (np.abs(curves) ** 2).sum(axis=-1)
    return np.asarray((np.abs(z) ** 2).sum() - common / np.maximum(size, 1e-300))


def _even(curves: Array) -> tuple[Array, Array]:
    """Closed curves (N, points) at even arc lengths, and their crank angles in turns."""
    closed = np.concatenate([curves, curves[:, :1]], axis=1)
    way = np.abs(np.diff(closed, axis=1)).cumsum(axis=1)
    way = np.concatenate([np.zeros((len(way), 1)), way / way[:, -1:]], axis=1)
    at = np.arange(_PLACES) / _PLACES
    share = np.linspace(0.0, 1.0, _PLACES + 1)
    turns = np.array([np.interp(at, row, share) for row in way])
    k = np.minimum((turns * _PLACES).astype(int), _PLACES - 1)
    part = turns * _PLACES - k
    rows = np.arange(len(curves))[:, None]
    return (1.0 - part) * closed[rows, k] + part * closed[rows, k + 1], turns


def _way(z: Array) -> Array:
    """Share of the arc length (n,) at each point of a path, 0 to 1."""
    way = np.append(0.0, np.abs(np.diff(z)).cumsum())
    return np.asarray(way / way[-1])


def _between(curves: Array, places: Array) -> Array:
    """Values (N, n) of closed curves at fractional indices along the second axis."""
    k = np.floor(places).astype(int)
    part = places - k
    return np.asarray((1.0 - part) * curves[:, k % _PLACES] + part * curves[:, (k + 1) % _PLACES])


def _alike(z: Array, way: Array, even: Array) -> NDArray[np.intp]:
    """Indices of the curves whose Fourier descriptors are most like those of a closed path."""
    at = np.arange(_PLACES) / _PLACES
    path = np.interp(at, np.append(way, 1.0), np.append(z, z[0]))
    own, theirs = (np.fft.fft(x)[..., _HARMONICS] for x in (path, even))
    own, theirs = (x / np.linalg.norm(x, axis=-1, keepdims=True) for x in (own, theirs))
    shifts = np.exp(1j * np.outer(_HARMONICS, _TURN * at))
    both = [np.abs((theirs.conj() * x) @ shifts).max(axis=1) for x in (own, own[::-1])]
    return np.argsort(-np.maximum(*both))[: 20 * _TRIED]  # either way round


class _Atlas:
    """Four-bars whose cranks turn, and the curves of their coupler points."""

    def __init__(self) -> None:
        cube = scipy.stats.qmc.Sobol(5, rng=np.random.default_rng(1)).random(_CURVES).T
        low, high = _LOW[:, None], _HIGH[:, None]
        shapes = low + cube * (high - low)
        shapes[:3] = low[:3] * (high[:3] / low[:3]) ** cube[:3]
        self.shapes = shapes[:, full_turns(_lengths(shapes))[0]]  #: (5, N) proportions
        angles = np.linspace(0.0, _TURN, _PLACES, endpoint=False)
        #: (N, points) coupler points at even angles of the crank
        self.curves = _curve(self.shapes[:, :, None], angles)
        #: (N, points) coupler points at even arc lengths, and crank angles in turns
        self.even, self.turned = _even(self.curves)

    def starts(self, z: Array, at: Array | None, closed: bool) -> list[tuple[Array, Array]]:
        """Proportions, and crank angles (n,) of the points, of the curves most like a path."""
        kept = np.arange(len(self.curves))
        if at is not None:  # places of the points on each curve, counted with parts
            phases, curves, some = np.arange(_PHASES) / _PHASES, self.curves, np.arange(len(z))
            tried = [x * _PLACES for p in phases for x in (p + at / _TURN, p - at / _TURN)]
        else:
            way = _way(np.append(z, z[0]))[:-1] if closed else _way(z)
            kept = _alike(z, way, self.even) if closed else kept
            curves, spans = self.even[kept], [1.0] if closed else _ARCS
            tried = [k + side * span * way * _PLACES for k in range(0, _PLACES, 2 if closed else 4)
                     for span in spans for side in (1.0, -1.0)]  # fmt: skip
            few = len(z) if closed else _COMPARED
            some = np.unique(np.linspace(0, len(z) - 1, few).round().astype(int))
        misfits = np.array([_misfit(z[some], _between(curves, x[some])) for x in tried])
        best = misfits.argmin(axis=0)
        order = np.argsort(misfits.min(axis=0))[:_TRIED]
        found = []
        for i in order:
            places = tried[best[i]]
            turns = places / _PLACES
            if at is None:
                whole = np.floor(turns)
                turns = whole + _between(self.turned[kept[i]][None], places - whole * _PLACES)[0]
            found.append((self.shapes[:, kept[i]], _TURN * turns))
        return found


class _Fit:
    """Least squares over proportions and crank angles, for points (n,) of unit size."""

    def __init__(self, z: Array, at: Array | None, transmission: float) -> None:
        self.z, self.at, self.transmission, self.sign = z, at, transmission, 1.0

    def pack(self, shape: Array, angles: Array) -> Array:
        """Unknowns: logarithms of lengths, the point, and angles or their common phase."""
        if self.at is None:
            return np.concatenate([np.log(shape[:3]), shape[3:], angles])
        self.sign = math.copysign(1.0, (angles[-1] - angles[0]) * (self.at[-1] - self.at[0]))
        return np.concatenate([np.log(shape[:3]), shape[3:], angles[:1] - self.sign * self.at[0]])

    def unpack(self, x: Array) -> tuple[Array, Array]:
        """Proportions and angles."""
        angles = x[5:] if self.at is None else x[5] + self.sign * self.at
        return np.concatenate([np.exp(x[:3]), x[3:5]]), angles

    def linear(self, x: Array) -> tuple[complex, complex, Array]:
        """Factor and shift of the curve, and deviations (n,) of the points."""
        p = _curve(*self.unpack(x))
        centred = p - p.mean()
        with np.errstate(all='ignore'):
            a = complex((centred.conj() * self.z).sum() / (np.abs(centred) ** 2).sum())
        b = complex(self.z.mean() - a * p.mean())
        return a, b, self.z - (a * p + b)

    def rest(self, x: Array) -> Array:
        """Residuals: components of deviations, then violated limits; large if not assembled."""
        off, (shape, angles) = self.linear(x)[2], self.unpack(x)
        both = np.concatenate([off.real, off.imag, self.beyond(shape), [self.short(angles)]])
        return np.asarray(np.nan_to_num(both, nan=10.0))

    def beyond(self, shapes: Array) -> Array:
        """Excess of transmission angles and proportions (7, ...) over their limits."""
        ground, coupler, rocker = shapes[:3]
        ends = np.array([(ground - 1.0) ** 2, (ground + 1.0) ** 2])
        cosines = (coupler**2 + rocker**2 - ends) / (2.0 * coupler * rocker)
        far = _WEIGHT * (np.abs(cosines) - math.cos(self.transmission + _MARGIN))
        long = np.abs(np.log(shapes[:3])) - math.log(_LONGEST)
        every = np.concatenate([far, long, np.abs(shapes[3:]) - _FARTHEST])
        return np.asarray(np.maximum(every, 0.0))

    def short(self, angles: Array) -> float:
        """Shortfall of the crank's rotation: a small piece of a huge curve is any arc."""
        return float(max(0.0, _WEIGHT * (_LEAST_TURN - abs(angles[-1] - angles[0]))))

    def slopes(self, x: Array) -> Array:
        """Derivatives of `rest`, without those of the factor (Kaufman, BIT 15 (1975) 49-57)."""
        shape, angles = self.unpack(x)
        steps = _STEP * np.eye(5)[:, :, None] * np.append(shape[:3], [1.0, 1.0])[:, None, None]
        near = [_curve(shape[:, None, None] + side * steps, angles) for side in (1.0, -1.0)]
        columns = (near[0] - near[1]) / (2.0 * _STEP)
        swept = (_curve(shape, angles + _STEP) - _curve(shape, angles - _STEP)) / (2.0 * _STEP)
        columns = np.vstack([columns, np.diag(swept) if self.at is None else swept[None]])
        p = _curve(shape, angles)
        p = p - p.mean()
        columns = columns - columns.mean(axis=1, keepdims=True)
        columns -= np.outer(columns @ p.conj(), p) / (np.abs(p) ** 2).sum()
        columns *= -self.linear(x)[0]
        ends = [self.beyond(shape[:, None] + side * steps[..., 0]) for side in (1.0, -1.0)]
        beyond = np.zeros((len(x), 8))
        beyond[:5, :7] = (ends[0] - ends[1]).T / (2.0 * _STEP)
        if self.at is None and self.short(angles):
            way = math.copysign(_WEIGHT, angles[-1] - angles[0])
            beyond[5, 7], beyond[-1, 7] = way, -way
        return np.asarray(np.nan_to_num(np.hstack([columns.real, columns.imag, beyond]).T))

    def solve(self, x: Array, most: int) -> Array:
        """Unknowns after at most `most` evaluations; of equal fits the nearest."""
        # few points leave unknowns open; without full rank MINPACK steps otherwise at every call
        near = _NEAR * np.eye(len(x))
        with np.errstate(all='ignore'):
            found = scipy.optimize.least_squares(
                lambda y: np.append(self.rest(y), _NEAR * (y - x)),
                x,
                lambda y: np.vstack([self.slopes(y), near]),
                method='lm',
                max_nfev=most,
                xtol=1e-13,
                ftol=1e-13,
            )
        return np.asarray(found.x)

    def polished(self, x: Array) -> Array:
        """Unknowns after many more evaluations, if they are valid."""
        exact = self.solve(x, 400)
        return exact if self.is_right(exact) else x

    def is_right(self, x: Array) -> bool:
        """True if the crank turns, and the points come in order within one turn."""
        with np.errstate(all='ignore'):
            shape, angles = self.unpack(x)
            longest = max(*_lengths(shape), math.hypot(*shape[3:]) * shape[1])
            reach = abs(self.linear(x)[0]) * longest
            worst = worst_transmission(transmission_range(FourBar(*_lengths(shape).tolist())))
        steps = np.diff(angles)
        ordered = bool((steps > 0.0).all() or (steps < 0.0).all())
        turned = abs(angles[-1] - angles[0]) < _TURN and full_turns(_lengths(shape))[0]
        return bool(ordered and turned and reach < _LARGEST and worst >= self.transmission)


def path_four_bars(path: TargetPath, transmission: float = 0.0) -> list[PathFourBar]:
    """Four-bars with a turning crank whose coupler point takes a path, the best first.

    Parameters
    ----------
    transmission : how far [rad] the angle between coupler and rocker keeps from 0 and from pi
    """
    points = np.array(path.points)
    if points.shape[1:] != (2,) or len(points) < 5 or path.by == 't':
        raise InputError('a path has at least 5 points x, y, and a column angle or none besides')
    z = points[:, 0] + 1j * points[:, 1]
    steps = np.abs(np.diff(z))
    closed = bool(abs(z[-1] - z[0]) <= 1.5 * steps.max())
    if closed and abs(z[-1] - z[0]) < 1e-9 * steps.max() and not path.by:
        z = z[:-1]
    centre = z.mean()
    size = math.sqrt(float((np.abs(z - centre) ** 2).mean()))
    if not size:
        raise InputError('a path has points at different places')
    at, atlas = np.array(path.at) if path.by else None, _Atlas()
    found: list[tuple[float, _Fit, Array, bool]] = []
    unit = (z - centre) / size
    for mirrored in (False, True):
        z = unit.conj() if mirrored else unit
        for shape, angles in atlas.starts(z, at, closed):
            fit = _Fit(z, at, transmission)
            x = fit.solve(fit.pack(shape, angles), 40)
            if fit.is_right(x):
                found.append((float((fit.rest(x) ** 2).sum()), fit, x, mirrored))
    found.sort(key=lambda one: one[0])
    kept = unlike(
        _placed(fit, fit.polished(x), centre, size, mirrored)
        for _, fit, x, mirrored in found[:_POLISHED]
    )
    if not kept:
        raise InputError(
            'no four-bar with a turning crank and a transmission angle of at least '
            f'{math.degrees(transmission):g} deg passes these points in their order'
        )
    return sorted(kept, key=lambda one: one.worth(size))[:KEPT]


def _placed(fit: _Fit, x: Array, centre: complex, size: float, mirrored: bool) -> PathFourBar:
    """A solution in the plane of the path."""
    (a, b, off), (shape, angles) = fit.linear(x), fit.unpack(x)
    side = -1.0 if mirrored else 1.0
    scale, turned = abs(a) * size, side * math.atan2(a.imag, a.real)
    pivot = complex(centre + size * (b.conjugate() if mirrored else b))
    lengths = tuple((_lengths(shape) * scale).tolist())
    first = angles[0] if fit.at is None else angles[0] - fit.sign * fit.at[0]
    distance = size * np.abs(off)
    low, high = transmission_range(FourBar(*lengths))
    return PathFourBar(
        lengths, 'crossed' if mirrored else 'open', (pivot.real, pivot.imag), turned,
        (float(shape[3] * lengths[2]), float(side * shape[4] * lengths[2])),
        math.remainder(side * first + turned, _TURN),
        bool(side * (angles[-1] - angles[0]) > 0.0),
        float(np.sqrt((distance**2).mean())), float(distance.max()), (low, high),
    )  # fmt: skip
