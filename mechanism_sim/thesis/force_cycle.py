"""The force in a joint over a turn of the crank as a periodic function: minima, rotation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.linkages.four_bar import FourBarLoop
from mechanism_sim.planar.inverse_dynamics import InverseDynamics

Curve = Callable[[Array, int], Array]
"""Derivative of given order by the crank angle, (k, N), at crank angles (N,) [rad]."""

TURN = 2.0 * np.pi
_EPS = float(np.finfo(float).eps)
_MOST_SAMPLES = 1 << 13


@dataclass(frozen=True)
class Fourier:
    """A Fourier series of k functions."""

    order: Array  #: (M,) orders 0, 1, 2, ...
    coefficient: NDArray[np.complex128]  #: (k, M) coefficients

    def __call__(self, angle: Array, derivative: int = 0) -> Array:
        """Derivative (k, N) at angles (N,) [rad]."""
        wave = np.exp(1j * np.outer(self.order, angle))
        return np.asarray(((self.coefficient * (1j * self.order) ** derivative) @ wave).real)


def resolve(function: Callable[[Array], Array], what: str) -> Fourier:
    """Fourier series of a periodic function (N,) -> (k, N), with all terms above rounding.

    Parameters
    ----------
    what : name of the function in the message if it is not smooth and periodic
    """
    n = 512  # resolves pulses of such width
    check = TURN * np.array([0.0123, 0.2718, 0.5772, 0.9159])  # not at fractions of the turn
    while n <= _MOST_SAMPLES:
        values = np.asarray(function(TURN * np.arange(n, dtype=np.float64) / n), dtype=np.float64)
        if not np.isfinite(values).all():
            raise InputError(f'{what} is not finite at all angles of the crank')
        size = float(np.abs(values).max())
        terms = np.fft.rfft(values) / n
        height = np.abs(terms).max(axis=0)
        if height[n // 3 :].max() <= 1e-13 * size:
            terms[:, 1:] *= 2.0
            count = 1 + max(np.flatnonzero(height > 4.0 * _EPS * size), default=0)
            series = Fourier(np.arange(count, dtype=float), terms[:, :count])
            if np.abs(series(check) - function(check)).max() <= 1e-10 * size:
                return series
        n *= 2
    raise InputError(
        f'{what} is not a smooth function of the crank angle that repeats with every turn'
    )


def root(function: Callable[[Array], Array], a: float, b: float) -> float:
    """The root in a bracket; one of its ends if rounding hides the change of sign."""

    def value(x: float) -> float:
        return float(function(np.array([x]))[0])

    ends = value(a), value(b)
    if ends[0] * ends[1] >= 0.0 or not all(map(math.isfinite, ends)):
        return float(a) if abs(ends[0]) < abs(ends[1]) else float(b)
    return float(scipy.optimize.brentq(value, a, b, xtol=1e-300, rtol=4.0 * _EPS))


def tip(function: Callable[[Array], Array], a: float, b: float) -> tuple[float, float]:
    """Position and value of the maximum in an interval."""
    found = scipy.optimize.minimize_scalar(
        lambda x: -float(function(np.array([x]))[0]),
        bounds=(a, b),
        method='bounded',
        options={'xatol': 1e-9 * (b - a)},
    )
    return float(found.x), -float(found.fun)


def with_tips(
    function: Callable[[Array], Array], x: Array, closed: bool = True
) -> tuple[Array, Array]:
    """Positions and values, with added extremes that pass zero between two positions."""
    values = function(x)
    if closed:
        values[-1] = values[0]
    places, heights = [x], [values]
    for sign in (1.0, -1.0):
        for i in peaks(sign * values, 0.0):
            if sign * values[i] > 0.0:
                continue
            place, height = tip(_scaled(function, sign), x[i - 1], x[i + 1])
            if height > 0.0:
                places.append(np.array([place]))
                heights.append(np.array([sign * height]))
    x, values = np.concatenate(places), np.concatenate(heights)
    order = np.argsort(x)
    return x[order], values[order]


def peaks(values: Array, level: float) -> list[int]:
    """Indices of local maxima that may exceed a level between samples."""
    left, here, right = values[:-2], values[1:-1], values[2:]
    with np.errstate(invalid='ignore'):
        reach = here + (here - np.minimum(left, right))
    return (1 + np.flatnonzero((here >= left) & (here >= right) & (reach >= level))).tolist()


def _scaled(function: Callable[[Array], Array], factor: float) -> Callable[[Array], Array]:
    return lambda x: factor * function(x)


@dataclass(frozen=True)
class ForceMinimum:
    """A local minimum of the magnitude of the force."""

    angle: float  #: crank angle [rad], in [0, 2 pi)
    force: float  #: magnitude [N]
    index: float  #: rate of the force's direction over its magnitude [rad/(N s)]


class ForceRates(NamedTuple):
    """Force and its derivatives in time at N crank angles, each (2, N)."""

    force: Array  #: force [N]
    first: Array  #: first derivative [N/s]
    second: Array  #: second derivative [N/s^2]

    @property
    def magnitude(self) -> Array:
        """R (N,) [N]."""
        return length(self.force)

    @property
    def swept(self) -> Array:
        """F x F' = R^2 gamma' (N,) [N^2/s]."""
        return cross(self.force, self.first)

    def turn(self) -> tuple[Array, Array]:
        """Rates gamma' [rad/s] and gamma'' [rad/s^2], each (N,); not finite at zero force."""
        with np.errstate(divide='ignore', invalid='ignore'):
            square = (self.force**2).sum(axis=0)
            rate = self.swept / square
            pull = (self.force * self.first).sum(axis=0) / square
            return rate, cross(self.force, self.second) / square - 2.0 * rate * pull


@dataclass(frozen=True)
class ForceCycle:
    """Force of the pin on its bushing over one turn of the crank, periodic and smooth.

    Made by `resolved` or `nominal`.
    """

    curve: Curve  #: Fourier series of the two components [N]
    speed: float  #: speed of the crank [rad/s], with its sign
    resolution: int  #: number of points in a turn that show every swing of the force

    @classmethod
    def resolved(
        cls, force: Callable[[Array], Array], speed: float, what: str = 'the force'
    ) -> ForceCycle:
        """A force as a function of the crank angle: a Fourier series resolved to rounding.

        Parameters
        ----------
        force : components (2, N) [N] at crank angles (N,) [rad], of period 2 pi
        speed : speed of the crank [rad/s], with its sign
        what : name of the function, as for `resolve`
        """
        series = resolve(force, what)
        points = max(360, 16 * series.order.size)
        if speed == 0.0 or not math.isfinite(speed):
            raise InputError(f'the crank must turn: its speed cannot be {speed:g} rad/s')
        return cls(series, speed, points)

    @classmethod
    def nominal(
        cls, loop: FourBarLoop, dynamics: InverseDynamics, joint: str, speed: float
    ) -> ForceCycle:
        """The force in a joint of an ideal four-bar at constant speed of the crank [rad/s].

        It is the force of the first on the second link of the joint.
        """
        index = [j.name for j in dynamics.mechanism.joints].index(joint)
        order = [loop.links.index(c) for c in dynamics.mechanism.coordinates]

        def force(angle: Array) -> Array:
            rate = np.full_like(angle, speed)
            motion = loop.motion(angle, rate, np.zeros_like(angle))
            return np.asarray(dynamics(*(x[order] for x in motion)).reaction[index])

        return cls.resolved(force, speed, f'the force in {joint}')

    def rates(self, angle: Array) -> ForceRates:
        """Force and derivatives in time at crank angles (N,) [rad]."""
        f, f1, f2 = (self.curve(angle, d) for d in range(3))
        w = self.speed
        return ForceRates(f, w * f1, w * w * f2)

    def magnitude(self, angle: Array) -> Array:
        """R (N,) [N]."""
        return length(self.curve(angle, 0))

    def index(self, angle: Array) -> Array:
        """Rate of the force's direction over its magnitude, |gamma'|/R (N,) [rad/(N s)]."""
        rates = self.rates(angle)
        force = rates.magnitude
        with np.errstate(divide='ignore', invalid='ignore'):
            return np.where(force > 0.0, np.abs(rates.swept) / force**3, np.inf)

    @cached_property
    def minima(self) -> tuple[ForceMinimum, ...]:
        """Local minima of the magnitude in the order of the crank angle.

        For a constant magnitude, the angle at which the force rotates fastest.
        """
        places = self._stationary(rising=True)
        if not places:
            i = int(self.index(self.grid[:-1]).argmax())
            step = TURN / self.resolution
            places = [tip(self.index, self.grid[i] - step, self.grid[i] + step)[0]]
        x = np.array(sorted(angle % TURN for angle in places))
        rates = self.rates(x)
        # Force and its derivative are orthogonal here, so that gamma' = |F'|/R.
        with np.errstate(divide='ignore'):
            index = length(rates.first) / rates.magnitude**2
        rows = np.array([x, rates.magnitude, index]).T.tolist()
        return tuple(ForceMinimum(*row) for row in rows)

    @cached_property
    def maximum(self) -> tuple[float, float]:
        """Crank angle [rad] and magnitude [N] of the largest force."""
        places = self._stationary(rising=False) or [self.minima[0].angle]
        forces = self.magnitude(np.array(places))
        return float(places[int(forces.argmax())] % TURN), float(forces.max())

    @cached_property
    def mean(self) -> float:
        """Mean of the magnitude over time [N]."""
        node, weight = np.polynomial.legendre.leggauss(6)
        half = 0.5 * np.diff(self._mesh)[:, None]
        x = (self._mesh[:-1, None] + half * (1.0 + node)).ravel()
        dt = (half * weight).ravel()
        return float((self.magnitude(x) * dt).sum() / dt.sum())

    @property
    def grid(self) -> Array:
        """Crank angles [rad] over a turn, its end included, that resolve every oscillation."""
        # Off symmetric angles, where roots are frequent.
        n = self.resolution
        return np.asarray((np.arange(n + 1) + 0.382) * (TURN / n), dtype=np.float64)

    @cached_property
    def _mesh(self) -> Array:
        """The grid, refined towards the minima, where the direction may change fast."""
        grid = self.grid
        near = (TURN / self.resolution) * 0.5 ** np.arange(36)
        close = np.concatenate([near, -near, [0.0]])
        places = np.concatenate([m.angle + close for m in self.minima])
        inner = grid[0] + np.mod(places - grid[0], TURN)
        return np.unique(np.concatenate([grid, inner[inner < grid[-1]]]))

    def _stationary(self, *, rising: bool) -> list[float]:
        """Angles of rising or falling zeros of the magnitude's slope."""
        sign = 1.0 if rising else -1.0

        def slope(angle: Array) -> Array:
            return np.asarray(sign * (self.curve(angle, 0) * self.curve(angle, 1)).sum(axis=0))

        x = self.grid
        forces = self.magnitude(x)
        largest = float(forces.max())
        if largest == 0.0:
            raise InputError('there is no force in this bearing')
        if largest - float(forces.min()) <= 1e-12 * largest:
            return []
        values = slope(x)
        values[-1] = values[0]
        passed = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
        return [root(slope, x[i], x[i + 1]) for i in passed]

    def spans(self, function: Callable[[Array], Array]) -> list[tuple[float, float]]:
        """Spans of crank angle [rad], begin and end in [0, 2 pi), with positive values."""
        x, values = with_tips(function, self._mesh)
        above = values > 0.0
        begins = [root(function, x[i], x[i + 1]) for i in np.flatnonzero(~above[:-1] & above[1:])]
        ends = [root(function, x[i], x[i + 1]) for i in np.flatnonzero(above[:-1] & ~above[1:])]
        if begins and ends[0] < begins[0]:
            ends = [*ends[1:], ends[0]]
        return [(b % TURN, e % TURN) for b, e in zip(begins, ends, strict=True)]

    def largest(self, function: Callable[[Array], Array]) -> tuple[float, float]:
        """Crank angle [rad] and value of the maximum of a function."""
        x, values = self._mesh, function(self._mesh)
        i = int(values.argmax())
        best = float(x[i]), float(values[i])
        if math.isfinite(best[1]):
            # With one more angle at both ends every maximum on the circle is an inner one.
            x = np.concatenate([[x[-2] - TURN], x, [x[1] + TURN]])
            values = np.concatenate([values[-2:-1], values, values[1:2]])
            for i in peaks(values, best[1]):
                best = max(best, tip(function, x[i - 1], x[i + 1]), key=lambda tip: tip[1])
        return best[0] % TURN, best[1]


def length(a: Array) -> Array:
    """Lengths (N,) of vectors (2, N)."""
    return np.asarray(np.hypot(a[0], a[1]))


def cross(a: Array, b: Array) -> Array:
    """Products (N,) of N pairs of vectors (2, N)."""
    return np.asarray(a[0] * b[1] - a[1] * b[0])
