"""When an instrument samples, and what its converter makes of it."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import scipy
from numpy.polynomial import Chebyshev, Polynomial
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.sensing.chain import Instrument

_TOUCH = 1e-12
"""[turns] nearer than this to an angle is on it: a drive may rest there."""
_FARTHEST = 0.49
"""Of a sampling period: so far at most jitter moves a sample, that none overtakes another."""


class Span(NamedTuple):
    """Consecutive samples of a record; a record begins at a trigger, or with the run."""

    start: float  #: [s] of the record
    times: Array  #: [s] of the samples
    complete: bool  #: no sample of this record will follow


class Sampler:
    """The sampling instants of an instrument, as far as the motion is known.

    Parameters
    ----------
    instrument : its rate, trigger and jitter
    name : of the sensor; with the seed of the noise it decides about the jitter
    drive : index of the coordinate that triggers
    """

    def __init__(self, instrument: Instrument, name: str, drive: int = 0) -> None:
        self._rate, self._trigger = instrument.sample_rate, instrument.trigger
        self._passage = LevelPassage(self._trigger.angle, {drive: 1.0}) if self._trigger else None
        self._start: float | None = None if self._trigger else 0.0
        self._count = 0
        self._jitter = instrument.adc.jitter
        self._random = generator(instrument, name, 'jitter')
        self._offsets = np.zeros(0)  # drawn, and not yet used

    def due(self, motion: Motion) -> list[Span]:
        """The samples that fall into a motion, which follows that of the last call."""
        spans: list[Span] = []
        triggers = self._passage.times(motion) if self._passage else []
        for trigger in triggers:
            self._sample(spans, trigger, ends=self._most is None)
            if self._start is None:
                self._start, self._count = trigger, 0
        self._sample(spans, motion.curve.end, ends=False)
        return spans

    @property
    def _most(self) -> int | None:
        return self._trigger.samples if self._trigger else None

    def _sample(self, spans: list[Span], until: float, ends: bool) -> None:
        """Sample the present record up to a time [s], which may be its end."""
        if self._start is None:
            return
        count = max(0, math.ceil((until - self._start) * self._rate) + 1 - self._count)
        if self._most is not None:
            count = min(count, self._most - self._count)
        since = np.arange(self._count, self._count + count) / self._rate
        if self._jitter:
            since = np.maximum(since + self._offset(count), 0.0)
        times = self._start + since
        times = times[: int(np.searchsorted(times, until))]
        self._count += len(times)
        self._offsets = self._offsets[len(times) :]
        complete = ends or self._count == self._most
        if len(times) or complete:
            spans.append(Span(self._start, times, complete))
        if complete:
            self._start = None

    def _offset(self, count: int) -> Array:
        """How much later than due the next samples are taken [s]."""
        missing = count - len(self._offsets)
        if missing > 0:
            most = _FARTHEST / self._rate
            drawn = self._jitter * self._random.standard_normal(missing)
            self._offsets = np.append(self._offsets, np.clip(drawn, -most, most))
        return self._offsets[:count]


class LevelPassage:
    """When a sum of coordinates passes an angle, in either direction; a run may begin on it.

    Parameters
    ----------
    angle : [rad] that is passed
    columns : whole factors of coordinates by their index: 1, and -1 of what an angle is seen from
    """

    def __init__(self, angle: float, columns: Mapping[int, float]) -> None:
        self._angle, self._columns = angle, columns
        self._level: int | None = None  # whole turns beyond the angle

    def times(self, motion: Motion) -> list[float]:
        """Times [s] within a motion, which follows that of the last call."""
        curve, h = motion.curve, motion.curve.duration
        turns = np.zeros(len(curve), curve.turns.dtype)
        coefficients = np.zeros((len(curve), curve.coefficients.shape[2]))
        for i, factor in self._columns.items():
            turns += int(factor) * curve.turns[:, i]
            coefficients += factor * curve.coefficients[:, i]
        coefficients[:, 0] -= self._angle
        coefficients *= np.vander(h, coefficients.shape[1], increasing=True) / TWO_PI
        levels = turns + _floor(polyval(1.0, coefficients.T))
        found: list[tuple[int, float]] = []  # piece and fraction of it
        if self._level is None:
            first, moved = coefficients[0, 0], coefficients[0, 1:][coefficients[0, 1:] != 0.0]
            self._level = int(turns[0] + _floor(first))
            backward = len(moved) and moved[0] < 0.0  # then it passes now
            if _floor(first) != _floor(first - _TOUCH) and not backward:
                found.append((0, 0.0))
        before = np.append(self._level, levels[:-1])
        self._level = int(levels[-1])
        rates = np.abs(coefficients[:, 1:] * np.arange(1.0, coefficients.shape[1]))
        may_turn = rates[:, 1:].sum(axis=1) > rates[:, 0]
        for k in np.flatnonzero(may_turn | (levels != before)):
            passed = _find_passages(coefficients[k], int(before[k] - turns[k]), bool(may_turn[k]))
            found += [(int(k), x) for x in passed]
        return [float(curve.start[k] + (curve.start_low[k] + h[k] * x)) for k, x in found]


def _floor(turns: ArrayLike) -> NDArray[np.int64]:
    """Whole turns, a hair less than one being one."""
    return np.floor(np.asarray(turns) + 0.5 * _TOUCH).astype(np.int64)


def _find_passages(powers: Array, level: int, may_turn: bool) -> list[float]:
    """Where on [0, 1] a polynomial that begins at a level passes from one integer to the next."""
    knots = [1.0]
    if may_turn:
        rate = Polynomial(powers).deriv().convert(kind=Chebyshev, domain=[0.0, 1.0])
        turning = rate.trim(1e-16 * np.abs(rate.coef).max()).roots().real
        knots = [*np.sort(turning[(turning > 0.0) & (turning < 1.0)]), 1.0]
    begin, found = 0.0, []
    for end in knots:
        now = int(_floor(polyval(end, powers)))
        step = 1 if now > level else -1
        crossed = range(level, now, step)
        found += [_root(powers, max(n, n + step), begin, end) for n in crossed]
        level, begin = now, end
    return found


def _root(powers: Array, value: int, begin: float, end: float) -> float:
    """Where a polynomial has a value; at an end if rounding moves it out."""

    def excess(x: float) -> float:
        return float(polyval(x, powers)) - value

    first, last = excess(begin), excess(end)
    if first * last >= 0.0:
        return begin if abs(first) <= abs(last) else end
    return float(scipy.optimize.brentq(excess, begin, end, xtol=1e-300, rtol=8.9e-16))


class Conversion(NamedTuple):
    """Output of a converter."""

    samples: Array
    overloads: NDArray[np.bool_]  #: which of them were cut at the end of the range


class Digitizer:
    """Adds noise, cuts at the range and rounds to the steps of the converter."""

    def __init__(self, instrument: Instrument, name: str) -> None:
        self._noise, self._converter = instrument.noise, instrument.adc
        self._random = generator(instrument, name, 'noise')

    def convert(self, t: Array, values: Array) -> Conversion:
        """Samples taken at times `t` (N,) [s] of values (N,)."""
        noise, converter = self._noise, self._converter
        if rms := noise.rms.value:
            values = values + rms * self._random.standard_normal(len(values))
        if hum := noise.hum:
            values = values + hum.amplitude.value * np.sin(TWO_PI * hum.frequency * t)
        if converter.range is None:
            return Conversion(values, np.zeros(len(values), bool))
        limit, step = converter.range.value, converter.step
        if step:
            values = step * np.round(values / step)
        largest = limit - step
        over = (values > largest) | (values < -limit)
        return Conversion(np.clip(values, -limit, largest), over)


def generator(instrument: Instrument, name: str, purpose: str) -> np.random.Generator:
    """Random numbers of their own for every seed, sensor and purpose."""
    words = [zlib.crc32(word.encode()) for word in (name, purpose)]
    return np.random.default_rng([instrument.noise.seed, *words])
