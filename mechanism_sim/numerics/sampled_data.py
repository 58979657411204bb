"""How well samples determine a derivative of what they are samples of.

Two causes: between samples nothing is known, which shows where splines of neighbouring degrees
differ; and samples are rounded, which a second derivative multiplies by the square of their rate.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.curves import Interpolation, spline

_FINEST = 13
"""Decimals beyond which numbers are taken as not rounded."""
_SAME = 1e-6
"""Of a step of rounding: how far values may be from its multiples, by the rounding of floats."""
_FEW = 16
"""Samples, of which fewer are chosen rather than rounded."""
_WINDOW = 25
"""Samples around a place, beyond which others hardly reach it."""
_BETWEEN = 8
"""Places in each interval at which derivatives are looked at."""


class SampledDerivative(NamedTuple):
    """A derivative by a spline through samples, and how far it may be off."""

    largest: float  #: with its sign
    at: float  #: where that is
    between: float  #: what it may be off there or elsewhere by what lies between samples
    rounding: float  #: by their rounding
    step: float  #: of the rounding, 0 if they are not rounded

    @property
    def off(self) -> float:
        """How far it may be off in all."""
        return self.between + self.rounding

    @property
    def determined(self) -> bool:
        """True if the samples give the derivative to a quarter of its size."""
        return self.off <= 0.25 * abs(self.largest)


def rounding_step(values: Array, units: tuple[float, ...] = (1.0,)) -> float:
    """The coarsest decimal step of which all values are multiples, in one of some units.

    Parameters
    ----------
    units : sizes of the units in which they may have been rounded
    """
    size = float(np.abs(values).max(initial=0.0))
    found = 0.0
    if len(values) < _FEW:
        return found
    for unit in units:
        for decimals in range(_FINEST):
            step = unit * 10.0**-decimals
            multiples = values / step
            if step < 1e-11 * size:
                break
            if size and np.abs(multiples - np.round(multiples)).max() <= max(
                _SAME, 4e-16 * size / step
            ):
                found = max(found, step)
                break
    return found


def sampled_derivative(
    x: Array,
    y: Array,
    order: int,
    interpolation: Interpolation,
    periodic: bool = False,
    units: tuple[float, ...] = (1.0,),
) -> SampledDerivative:
    """A derivative by a spline through samples, and how far it may be off.

    Parameters
    ----------
    x, y : (m,) samples with rising x
    order : of the derivative
    units : of `rounding_step`
    """
    fractions = (np.arange(_BETWEEN) + 0.5) / _BETWEEN
    at = (x[:-1, None] + np.diff(x)[:, None] * fractions).ravel()
    at = np.concatenate([at, x])
    values = _derivative(*spline(x, y, interpolation, periodic), at, order)
    neighbour: Interpolation = 'cubic' if interpolation == 'quintic' else 'quintic'
    between = 0.0
    if len(x) >= 7:
        other = _derivative(*spline(x, y, neighbour, periodic), at, order)
        between = float(np.abs(values - other).max())
    else:
        between = math.inf
    step = rounding_step(y, units)
    k = int(np.abs(values).argmax())
    return SampledDerivative(
        float(values[k]), float(at[k]), between, 0.5 * step * _gain(x, interpolation, order), step
    )


def _derivative(breaks: Array, rows: Array, at: Array, order: int) -> Array:
    n = rows.shape[1]
    row = np.clip(np.searchsorted(breaks, at, 'right') - 1, 0, len(rows) - 1)
    falling = np.array([float(math.perm(k, order)) for k in range(n)])[order:]
    powers = (at - breaks[row])[:, None] ** np.arange(n - order)
    return np.asarray((rows[row][:, order:] * falling * powers).sum(axis=1))


def _gain(x: Array, interpolation: Interpolation, order: int) -> float:
    """Most that a derivative changes if every sample changes by one at most, either way."""
    steps = np.diff(x)
    middle = int(steps.argmin())
    first = max(0, min(middle - _WINDOW // 2, len(x) - _WINDOW))
    own = x[first : first + _WINDOW]
    place = min(max(middle - first, 0), len(own) - 2)
    at = own[place] + (own[place + 1] - own[place]) * np.linspace(0.0, 1.0, 5)
    total = np.zeros(len(at))
    for unit in np.eye(len(own)):
        total += np.abs(_derivative(*spline(own, unit, interpolation), at, order))
    return float(total.max())
