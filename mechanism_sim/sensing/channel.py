"""One measured channel: from the motion of a machine to its samples, when and how converted."""

from __future__ import annotations

import math
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple, Protocol

import numpy as np
import scipy
from numpy.polynomial import Chebyshev, Polynomial
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.errors import RunError, RunWarning
from mechanism_sim.numerics.modal_filter import NODES, ModalFilter, polynomials, silent
from mechanism_sim.numerics.polynomials import TWO_PI, Nodes, exact_sum, first_due
from mechanism_sim.numerics.rational import Modes, Rational
from mechanism_sim.sensing.chain import Instrument, half_sine

_TOUCH = 1e-12  # distance [turns] within which a drive is at an angle: it may rest there
_FARTHEST = 0.49  # largest jitter, in sampling periods, so that no sample overtakes another
BLOCK = 256
"""Number of samples of a block without a trigger."""
_MOST = 100_000_000  # largest number of samples of one motion: they take some gigabytes
_TOGETHER = 100_000  # samples that are computed at once


class SensorSource(Protocol):
    """Mount of an instrument: inputs of a linear system, known piece by piece."""

    inputs: int

    def through(self, chain: Rational) -> Modes:
        """The system from the inputs to the output of a chain behind an ideal transducer."""

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """The inputs (inputs, N) at instants as those of ``motion.curve.at(segments, dt)``."""

    def impulses(self, motion: Motion) -> Array:
        """Integrals of the inputs over the instants at which the m pieces begin (m, inputs)."""


class DirectSource:
    """A source of one input without dynamics or impulses."""

    inputs = 1

    def through(self, chain: Rational) -> Modes:
        """The system from the input to the output of a chain."""
        return chain.modes()

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """The input (1, N) at instants as those of ``motion.curve.at(segments, dt)``."""
        return np.asarray(self.reading(motion.curve.local(segments, dt).T))[None]

    def reading(self, q: Array) -> Array:
        """The input (N,) at coordinates (n, N), if it depends on these alone."""
        raise NotImplementedError

    def impulses(self, motion: Motion) -> Array:
        """Impulses: zero, (m, 1)."""
        return np.zeros((len(motion), 1))


class Block(NamedTuple):
    """Consecutive samples; `time` [s] is the due time of the first."""

    time: float
    samples: Array  #: (N,) samples in the unit of the chain's output
    cut: NDArray[np.bool_]  #: (N,) mask of samples clipped at full scale
    triggered: bool  #: whether the first is due at a trigger

    @property
    def overloads(self) -> int:
        """Number of samples cut at full scale."""
        return int(self.cut.sum())


class Analogue:
    """Linear system between a machine and the converter of an instrument.

    Parameters
    ----------
    source : carrier of the instrument
    instrument : transducer, amplifier, integrators, filter and pulses
    """

    def __init__(self, source: SensorSource, instrument: Instrument) -> None:
        self._source = source
        chain = instrument.transfer()
        self._filter = ModalFilter(source.through(chain))
        self._pulses: _Pulses | None = None
        if pulse := instrument.impact_pulse:
            system = ModalFilter(source.through(chain * half_sine(pulse)))
            self._pulses = _Pulses(system, pulse)
        self._last: tuple[Motion, Callable[[Array], Array]] | None = None

    def response(self, motion: Motion) -> Callable[[Array], Array]:
        """Output at times (M,) [s] within a motion, which follows that of the last call.

        The same motion may be given again, and costs nothing then.
        """
        if self._last is None or self._last[0] is not motion:
            self._last = motion, self._response(motion)
        return self._last[1]

    def numbers(self, motion: Motion) -> Array:
        """Numbers (n,) that determine the first response, for comparison with another's."""
        every = np.arange(len(motion.curve))
        inputs = self._source.read(motion, every, NODES), self._source.impulses(motion)
        pulses = [self._pulses.numbers] if self._pulses else []
        return np.concatenate([self._filter.numbers, *pulses, *(x.ravel() for x in inputs)])

    def _response(self, motion: Motion) -> Callable[[Array], Array]:
        """Output of the chain at times (M,) [s] within a motion."""
        curve, filtered, pulses = motion.curve, self._filter, self._pulses
        impulses = np.zeros((len(curve), self._source.inputs))
        if len(filtered) or pulses:
            impulses = self._source.impulses(motion)
        if len(filtered):
            every = np.arange(len(curve))
            inputs = polynomials(self._source.read(motion, every, NODES))
            steps = np.zeros_like(impulses) if pulses else impulses
            response = filtered.advance(curve.duration, inputs, steps)
        heard = pulses.take(motion, impulses) if pulses else None

        def at(t: Array) -> Array:
            k, dt = curve.find(t)
            y = np.zeros(len(t))
            if filtered.direct.any():
                y += (filtered.direct @ self._source.read(motion, k, dt))[0]
            if len(filtered):
                y += response(k, dt)[0]
            return y + heard(t) if heard else y

        return at


class Channel:
    """An instrument on a machine.

    Without filters, transducer or pulse the samples are the input itself, exactly, and an impact
    is too short to be seen. Else they are the exact response of the chain, which rests at the
    start of the run, to motion and impacts.

    Parameters
    ----------
    source : carrier of the instrument
    instrument : the chain behind it
    name : name of the sensor
    drive : index of the coordinate that triggers
    beside : a channel whose analogue part this one shares, so that it is computed once; both are
        fed with the same motions
    """

    def __init__(
        self,
        source: SensorSource,
        instrument: Instrument,
        name: str,
        drive: int = 0,
        beside: Channel | None = None,
    ) -> None:
        self.name, self.instrument = name, instrument
        self._analogue: Analogue = beside._analogue if beside else Analogue(source, instrument)
        self._triggered = instrument.trigger is not None
        self._sampler = Sampler(instrument, name, drive)
        self._digitizer = Digitizer(instrument, name)
        self._blocks: list[Block] = []
        self._record = 0.0
        self._taken = 0
        self._count = self._overloads = 0  # of all samples
        self._samples = np.zeros(0)
        self._over = np.zeros(0, bool)

    def take(self, motion: Motion) -> None:
        """Measure a piece of motion, which follows that of the last call."""
        if not len(motion):
            return
        response = self._analogue.response(motion)
        for span in self._sampler.due(motion):
            if len(span.times):
                shown = self._digitizer.convert(span.times, response(span.times))
                self._samples = np.append(self._samples, shown.samples)
                self._over = np.append(self._over, shown.overloads)
                self._count += len(shown.samples)
                self._overloads += int(shown.overloads.sum())
            self._record = span.start
            self._cut(span.complete)

    def blocks(self, final: bool = False) -> list[Block]:
        """The full blocks, or all remaining ones; each is returned once."""
        if final:
            self._cut(complete=True)
        blocks, self._blocks = self._blocks, []
        return blocks

    def samples(self, final: bool = False) -> Iterator[tuple[Array, Array, NDArray[np.bool_]]]:
        """Due times [s], values and overload marks of the samples of `blocks`, (N,) each."""
        for block in self.blocks(final):
            since = np.arange(len(block.samples)) / self.instrument.sample_rate
            yield block.time + since, block.samples, block.cut

    def warn(self) -> None:
        """Warn if samples so far were clipped, which distorts figures of the signal."""
        if self._overloads and (limit := self.instrument.adc.range):
            end = f'{limit.value:g} {limit.unit}'.rstrip()
            warnings.warn(
                f'sensor {self.name}: {self._overloads} of {self._count} samples were CUT at the '
                f'end of its range, {end}',
                RunWarning,
                stacklevel=3,
            )

    def _cut(self, complete: bool) -> None:
        """Make blocks of the samples of the present record."""
        most = None if self._triggered else BLOCK
        while len(self._samples) and (complete or (most and len(self._samples) >= most)):
            block, cut = self._samples[:most], self._over[:most]
            start = self._record + self._taken / self.instrument.sample_rate
            self._blocks.append(Block(start, block.copy(), cut.copy(), self._triggered))
            self._samples = self._samples[len(block) :]
            self._over = self._over[len(block) :]
            self._taken += len(block)
        if complete:
            self._taken = 0


class _Pulses:
    """Impacts of finite duration: two impulses each, half a period of an oscillator apart.

    The state stays at the last impulse, so that it does not depend on how the motion is cut.
    """

    def __init__(self, system: ModalFilter, duration: float) -> None:
        self._system, self._duration = system, duration
        self._last = 0.0, 0.0
        inputs = system.state.shape[1]
        self._times = np.zeros((2, 0))  # of what is still to come, and what rounding takes away
        self._sizes = np.zeros((0, inputs))

    @property
    def numbers(self) -> Array:
        """Numbers (n,) that determine the response without impacts."""
        return np.append(self._system.numbers, self._duration)

    def take(self, motion: Motion, impulses: Array) -> Callable[[Array], Array]:
        """The response at times (M,) [s] within a motion with impulses (m, inputs)."""
        curve, system = motion.curve, self._system
        new = np.flatnonzero(impulses.any(axis=1))
        begin = np.array([curve.start[new], curve.start_low[new]])
        end = np.array(exact_sum(begin[0], begin[1], np.full(len(new), self._duration)))
        times = np.concatenate([self._times, begin, end], axis=1)
        sizes = np.concatenate([self._sizes, impulses[new], impulses[new]])
        order = np.lexsort((times[1], times[0]))
        times, sizes = times[:, order], sizes[order]
        due = times[0] < curve.end
        self._times, self._sizes = times[:, ~due], sizes[~due]
        starts = np.concatenate([np.array(self._last)[:, None], times[:, due]], axis=1)
        self._last = starts[0, -1], starts[1, -1]
        durations = np.append(np.diff(starts[0]) + np.diff(starts[1]), 0.0)
        still, none = silent(sizes.shape[1], len(durations))
        response = system.advance(durations, still, np.concatenate([none[:1], sizes[due]]))

        def at(t: Array) -> Array:
            k = np.searchsorted(starts[0], t, side='right') - 1
            dt = (t - starts[0, k]) - starts[1, k]
            heard: Array = response(k, dt)[0]
            return heard

        return at


class Span(NamedTuple):
    """Consecutive samples of a record; a record begins at a trigger, or with the run."""

    start: float  #: start of the record [s]
    times: Array  #: due times of the samples [s]
    complete: bool  #: whether no sample of this record will follow


class Sampler:
    """The sampling instants of an instrument, as far as the motion is known.

    Parameters
    ----------
    instrument : sampling rate, trigger and jitter
    name : name of the sensor; with the seed of the noise it determines the jitter
    drive : index of the coordinate that triggers
    """

    def __init__(self, instrument: Instrument, name: str, drive: int = 0) -> None:
        self._name, self._rate, self._trigger = name, instrument.sample_rate, instrument.trigger
        self._passage = LevelPassage(self._trigger.angle, {drive: 1.0}) if self._trigger else None
        self._start: float | None = None  # of the record
        self._begun = self._trigger is not None
        self._count = 0
        self._jitter = instrument.adc.jitter
        self._random = generator(instrument, name, 'jitter')
        self._offsets = np.zeros(0)  # drawn, and not yet used

    def due(self, motion: Motion) -> Iterator[Span]:
        """Samples due within a motion, which follows that of the last call.

        They are due at multiples of their interval from time 0 on, wherever the first motion
        begins: a record may be a part of a longer one.
        """
        if not self._begun:
            first = float(motion.curve.start[0])
            self._start, self._begun = first_due(first, self._rate) / self._rate, True
        triggers = self._passage.times(motion) if self._passage else []
        for trigger in triggers:
            yield from self._sample(trigger, ends=self._most is None)
            if self._start is None:
                self._start, self._count = trigger, 0
        yield from self._sample(motion.curve.end, ends=False)

    @property
    def _most(self) -> int | None:
        return self._trigger.samples if self._trigger else None

    def _sample(self, until: float, ends: bool) -> Iterator[Span]:
        """Sample the present record up to a time [s], which may be its end."""
        more = True
        while self._start is not None and more:
            left = max(0, math.ceil((until - self._start) * self._rate) + 1 - self._count)
            if self._most is not None:
                left = min(left, self._most - self._count)
            if left > _MOST:
                raise RunError(
                    f'sensor {self._name}: {left:.3g} samples up to t = {until:.6g} s at once, of '
                    f'which {_MOST:.0e} can be held: lower its sample_rate, or end the run before'
                )
            count = min(left, _TOGETHER)
            since = np.arange(self._count, self._count + count) / self._rate
            if self._jitter:
                since = np.maximum(since + self._offset(count), 0.0)
            times = self._start + since
            times = times[: int(np.searchsorted(times, until))]
            self._count += len(times)
            self._offsets = self._offsets[len(times) :]
            more = len(times) == count < left
            complete = (ends and not more) or self._count == self._most
            if len(times) or complete:
                yield Span(self._start, times, complete)
            if complete:
                self._start = None

    def _offset(self, count: int) -> Array:
        """Delays of the next samples after their due times [s]."""
        missing = count - len(self._offsets)
        if missing > 0:
            most = _FARTHEST / self._rate
            drawn = self._jitter * self._random.standard_normal(missing)
            self._offsets = np.append(self._offsets, np.clip(drawn, -most, most))
        return self._offsets[:count]


class LevelPassage:
    """Passages of a sum of coordinates through an angle, in either direction.

    Parameters
    ----------
    angle : angle of the passages [rad]
    columns : integer factors of coordinates by their index: 1, and -1 for a reference link
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
    """Positions in [0, 1] at which a polynomial passes from one integer to the next."""
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
    """Position at which a polynomial has a value; an end if rounding moves it out."""

    def excess(x: float) -> float:
        return float(polyval(x, powers)) - value

    first, last = excess(begin), excess(end)
    if first * last >= 0.0:
        return begin if abs(first) <= abs(last) else end
    return float(scipy.optimize.brentq(excess, begin, end, xtol=1e-300, rtol=8.9e-16))


class Conversion(NamedTuple):
    """Output of a converter."""

    samples: Array
    overloads: NDArray[np.bool_]  #: mask of samples clipped at full scale


class Digitizer:
    """Adds noise, clips at full scale and rounds to the steps of the converter."""

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
    """Random generator for a seed, a sensor and a purpose."""
    words = [zlib.crc32(word.encode()) for word in (name, purpose)]
    return np.random.default_rng([instrument.noise.seed, *words])
