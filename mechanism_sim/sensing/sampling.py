"""When an instrument samples, and what its converter makes of it."""

from __future__ import annotations

import math
import zlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.sensing.chain import Instrument, Trigger

Array = NDArray[np.float64]

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
        self._passage = Passage(self._trigger, drive) if self._trigger else None
        self._start: float | None = None if self._trigger else 0.0
        self._count = 0
        self._jitter = instrument.converter.jitter
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


class Passage:
    """When a coordinate passes an angle, in either direction.

    Parameters
    ----------
    trigger : its angle
    index : of the coordinate
    """

    def __init__(self, trigger: Trigger, index: int) -> None:
        self._angle, self._index = trigger.angle, index
        self._level: int | None = None

    def times(self, motion: Motion) -> list[float]:
        """Times [s] within a motion, which follows that of the last call."""
        curve, i = motion.curve, self._index
        every = np.arange(len(curve))
        ends = (curve.local(every, curve.duration)[:, i] - self._angle) / TWO_PI
        levels = curve.turns[:, i] + np.floor(ends).astype(np.int64)
        if self._level is None:
            begin = (curve.coefficients[0, i, 0] - self._angle) / TWO_PI
            on_it, forward = begin == math.floor(begin), curve.coefficients[0, i, 1] > 0.0
            self._level = int(curve.turns[0, i]) + math.floor(begin) - int(on_it and forward)
        before = np.append(self._level, levels[:-1])
        self._level = int(levels[-1])
        found = []
        for k in np.flatnonzero(levels != before):
            passed = max(levels[k], before[k]) - curve.turns[k, i]
            powers = curve.coefficients[k, i].copy()
            powers[0] -= self._angle + TWO_PI * passed
            found.append(curve.start[k] + (curve.start_low[k] + _root(powers, curve.duration[k])))
        return [float(t) for t in found]


def _root(powers: Array, width: float) -> float:
    """Where a polynomial passes zero on [0, width]; at an end if rounding moves it out."""

    def value(x: float) -> float:
        return float(np.polynomial.polynomial.polyval(x, powers))

    first, last = value(0.0), value(width)
    if first * last >= 0.0:
        return 0.0 if abs(first) <= abs(last) else width
    return float(brentq(value, 0.0, width, xtol=1e-300, rtol=8.9e-16))


class Converted(NamedTuple):
    """What a converter shows."""

    samples: Array
    overloads: NDArray[np.bool_]  #: which of them were cut at the end of the range


class Digitizer:
    """Adds noise, cuts at the range and rounds to the steps of the converter."""

    def __init__(self, instrument: Instrument, name: str) -> None:
        self._noise, self._converter = instrument.noise, instrument.converter
        self._random = generator(instrument, name, 'noise')

    def convert(self, t: Array, values: Array) -> Converted:
        """Samples taken at times `t` (N,) [s] of values (N,)."""
        noise, converter = self._noise, self._converter
        if noise.rms:
            values = values + noise.rms * self._random.standard_normal(len(values))
        if noise.hum:
            values = values + noise.hum.amplitude * np.sin(TWO_PI * noise.hum.frequency * t)
        limit = converter.range
        if limit is None:
            return Converted(values, np.zeros(len(values), bool))
        largest = limit
        if converter.bits is not None:
            step = 2.0 * limit / 2**converter.bits
            values = step * np.round(values / step)
            largest = limit - step
        over = (values > largest) | (values < -limit)
        return Converted(np.clip(values, -limit, largest), over)


def generator(instrument: Instrument, name: str, purpose: str) -> np.random.Generator:
    """Random numbers of their own for every seed, sensor and purpose."""
    words = [zlib.crc32(word.encode()) for word in (name, purpose)]
    return np.random.default_rng([instrument.noise.seed, *words])
