"""Motions given by samples: interpolating or smoothing splines, and their peaks.

The second derivative of samples is what they know least about: it depends on how the gaps between
them are filled, and on the last digit of each. `acceleration_peaks` says by how much.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError

_DEGREES = (3, 5, 7)  # of splines that are compared
#: share of the largest peak: with a larger error, the samples do not determine it
_DETERMINED = 0.1
_TRIALS = 8  # of other last digits; three times their standard deviation counts
_DIGITS = 13  # decimals after which a number is not rounded but computed
_SMOOTHEST = 1e9  # weight of the penalty, over that of the distances: no spline is smoother


class SampledPeak(NamedTuple):
    """An extreme second derivative of a spline through samples.

    Parameters
    ----------
    value : second derivative of the spline
    off : deviation of splines of other degrees, second differences and rounding from it
    """

    value: float
    off: float


def determined(peaks: Sequence[SampledPeak]) -> bool:
    """True if no error exceeds a tenth of the largest."""
    largest = max(abs(p.value) for p in peaks)
    return all(p.off <= _DETERMINED * largest for p in peaks)


def describe_peaks(peaks: tuple[SampledPeak, SampledPeak], unit: str, scale: float = 1.0) -> str:
    """Describe both peaks in a unit after a multiplication by `scale`, with advice."""
    shown = ' and '.join(f'{scale * p.value:.6g} (+-{scale * p.off:.3g})' for p in peaks)
    text = f'largest accelerations by its points {shown} {unit}'
    if determined(peaks):
        return text
    return (
        f'{text}: other degrees of the spline and the rounding of the points change them so much '
        'that the points do not determine them; give closer or more exact ones, or the law itself'
    )


def spline_through(
    x: Array, y: Array, degree: int, periodic: bool, error: float = 0.0, rest: bool = False
) -> scipy.interpolate.PPoly:
    """The spline through samples (n,), or near them if they have an error of measurement.

    Parameters
    ----------
    x : rising arguments; the last one is the first of the next period if it is periodic
    degree : odd degree
    error : standard deviation of y; the spline of this degree that minimises the square of its
        derivative of order (degree + 1)/2 at this root mean square distance (Reinsch 1967)
    rest : True if the first (degree - 1)/2 derivatives are zero at the ends
    """
    if error > 0.0:
        spline = _smoothing(x, y, degree, periodic, error)
    else:
        still = [(order, 0.0) for order in range(1, (degree + 1) // 2)]
        ends = 'periodic' if periodic else (still, still) if rest else None
        spline = scipy.interpolate.make_interp_spline(x, y, k=degree, bc_type=ends)
    whole = scipy.interpolate.PPoly.from_spline(spline)
    inside = slice(degree, -degree)
    return scipy.interpolate.PPoly(whole.c[:, inside], whole.x[inside])


def acceleration_peaks(
    x: ArrayLike,
    y: ArrayLike,
    degree: int,
    periodic: bool,
    error: float = 0.0,
    rest: bool = False,
    order: int = 2,
) -> tuple[SampledPeak, SampledPeak]:
    """The least and the greatest second derivative of the spline through samples, as above.

    Or the first one, of samples of a rate.

    Second differences count, which no spline through the points falls short of, but not for
    samples with an error of measurement, of which they mostly consist.
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)

    def of(values: Array, k: int = degree) -> Array:
        return _ends(spline_through(x, values, k, periodic, error, rest).derivative(order))

    own = of(y)
    others = [of(y, k) for k in _DEGREES if k != degree and k < len(x) - periodic]
    if not error:
        slopes = np.diff(y) / np.diff(x)
        if order == 2:
            x2 = x
            if periodic:
                x2, slopes = np.append(x, x[1] + x[-1] - x[0]), np.append(slopes, slopes[0])
            slopes = 2.0 * np.diff(slopes) / (x2[2:] - x2[:-2])
        if slopes.size:  # from rest to rest there may be two points
            others.append(np.array([slopes.min(), slopes.max()]))
    off = np.abs(np.array(others) - own).max(axis=0) if others else np.zeros(2)
    random, half = np.random.default_rng(0), 0.5 * _last_digit(y)
    if error or half:
        middle, tried = spline_through(x, y, degree, periodic, error)(x) if error else y, []
        for _ in range(_TRIALS):
            if error:
                beside = random.normal(0.0, error, len(y))
            else:
                beside = random.uniform(-half, half, len(y))
            if periodic:
                beside[-1] = beside[0]
            tried.append(of(middle + beside) - own)
        off += 3.0 * np.sqrt(np.mean(np.square(tried), axis=0))
    low, high = (SampledPeak(float(v), float(o)) for v, o in zip(own, off, strict=True))
    return low, high


def _ends(known: scipy.interpolate.PPoly) -> Array:
    """Least and greatest value (2,)."""
    with np.errstate(all='ignore'):
        inside = known.derivative().roots(discontinuity=False, extrapolate=False)
    places = np.concatenate([known.x, inside[np.isfinite(inside)]])
    found = known(places)
    return np.array([found.min(), found.max()])


def _last_digit(y: Array) -> float:
    """Power of ten of which all values are multiples, in SI units or in degrees; or 0."""
    steps = [0.0]
    for unit in (1.0, math.pi / 180.0):
        for k in range(_DIGITS):
            digits = y / unit * 10.0**k
            if (np.abs(digits - np.round(digits)) <= 1e-9 * np.maximum(np.abs(digits), 1.0)).all():
                steps.append(unit * 10.0**-k)
                break
    return max(steps)


def _smoothing(
    x: Array, y: Array, degree: int, periodic: bool, error: float
) -> scipy.interpolate.BSpline:
    """Smoothing spline of `spline_through`: knots at the samples, by normal equations."""
    sparse, k, order = scipy.sparse, degree, (degree + 1) // 2
    span = x[-1] - x[0]
    u, count = (x - x[0]) / span, len(x) - periodic
    if periodic:
        knots = np.concatenate([u[-k - 1 : -1] - 1.0, u, u[1 : k + 1] + 1.0])
        fold = sparse.csr_array(
            (np.ones(count + k), (np.arange(count + k), np.arange(count + k) % count))
        )
    else:
        knots = scipy.interpolate.make_interp_spline(u, y, k=k).t
        fold = sparse.eye_array(count, format='csr')
    design = sparse.csr_array(scipy.interpolate.BSpline.design_matrix(u[:count], knots, k)) @ fold
    # the derivative that is penalised, at Gauss's nodes in all intervals
    slope, t = fold, knots
    for j in range(k, k - order, -1):
        width = j / (t[j + 1 : -1] - t[1 : -j - 1])
        t, size = t[1:-1], slope.shape[0]
        slope = sparse.diags_array(width) @ (slope[1:size] - slope[: size - 1])
    nodes, weights = np.polynomial.legendre.leggauss(order)
    low, wide = u[:-1, None], 0.5 * np.diff(u)[:, None]
    places, shares = (low + wide * (1.0 + nodes)).ravel(), (wide * weights).ravel()
    bend = scipy.interpolate.BSpline.design_matrix(places, t, k - order) @ slope
    penalty = bend.T @ sparse.diags_array(shares) @ bend
    normal, right = design.T @ design, design.T @ y[:count]

    def fitted(weight: float) -> Array:
        solved = sparse.linalg.spsolve((normal + weight * penalty).tocsc(), right)
        return np.asarray(fold @ solved)

    def excess(logarithm: float) -> float:
        rest = design @ fitted(10.0**logarithm)[:count] - y[:count]
        return float(np.sqrt(np.mean(rest**2)) / error - 1.0)

    least, most = -30.0, math.log10(_SMOOTHEST)
    if excess(most) <= 0.0:
        raise InputError(
            f'an error of {error:g} of the points is as large as their variation: no spline is '
            'smoother than their mean'
        )
    weight = (
        scipy.optimize.brentq(excess, least, most, xtol=1e-9) if excess(least) < 0.0 else least
    )
    scaled = x[0] + span * knots
    return scipy.interpolate.BSpline(scaled, fitted(10.0**weight), k)
