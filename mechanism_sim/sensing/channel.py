"""One measured channel: from the motion of a machine to blocks of samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.modal_filter import NODES, ModalFilter, polynomials, silent
from mechanism_sim.numerics.polynomials import Nodes, exact_sum
from mechanism_sim.numerics.rational import Modes, Rational
from mechanism_sim.sensing.chain import Instrument, half_sine
from mechanism_sim.sensing.sampling import Digitizer, Sampler

BLOCK = 256
"""Samples of a block without a trigger."""


class SensorSource(Protocol):
    """Mount of an instrument: inputs of a linear system, known piece by piece."""

    inputs: int

    def through(self, chain: Rational) -> Modes:
        """The system from the inputs to what comes out of a chain behind an ideal transducer."""

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """The inputs (inputs, N) at instants as those of ``motion.curve.at(segments, dt)``."""

    def impulses(self, motion: Motion) -> Array:
        """Integrals of the inputs over the instants at which the m pieces begin (m, inputs)."""


class DirectSource:
    """A source of one input that is read as it is, and has no impulses."""

    inputs = 1

    def through(self, chain: Rational) -> Modes:
        """The system from what is read here to what comes out of a chain."""
        return chain.modes()

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """The input (1, N) at instants as those of ``motion.curve.at(segments, dt)``."""
        return np.asarray(self.reading(motion.curve.local(segments, dt).T))[None]

    def reading(self, q: Array) -> Array:
        """The input (N,) at coordinates (n, N), if it depends on these alone."""
        raise NotImplementedError

    def impulses(self, motion: Motion) -> Array:
        """None (m, 1)."""
        return np.zeros((len(motion), 1))


class Block(NamedTuple):
    """Consecutive samples; `time` [s] is when the first is due."""

    time: float
    samples: Array  #: (N,) in units of what the chain ends in
    overloads: int  #: how many of them were cut at the end of the range
    triggered: bool  #: the first is due at a trigger


class Analogue:
    """Linear system between a machine and the converter of an instrument.

    Parameters
    ----------
    source : what the instrument is mounted on
    instrument : its transducer, amplifier, integrators, filter and pulses
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
                y += response(k, dt)[:, 0]
            return y + heard(t) if heard else y

        return at


class Channel:
    """An instrument on a machine.

    Without filters, transducer or pulse the samples are the input itself, exactly, and an impact
    is too short to be seen. Else they are the exact response of the chain, which rests at the
    start of the run, to motion and impacts.

    Parameters
    ----------
    source : what it is mounted on
    instrument : the chain behind it
    name : of the sensor
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
        self._samples = np.zeros(0)
        self._overloads = np.zeros(0, bool)

    def take(self, motion: Motion) -> None:
        """Measure a piece of motion, which follows that of the last call."""
        if not len(motion):
            return
        response = self._analogue.response(motion)
        for span in self._sampler.due(motion):
            if len(span.times):
                shown = self._digitizer.convert(span.times, response(span.times))
                self._samples = np.append(self._samples, shown.samples)
                self._overloads = np.append(self._overloads, shown.overloads)
            self._record = span.start
            self._cut(span.complete)

    def blocks(self, final: bool = False) -> list[Block]:
        """The blocks that are full, or all that is left; each is given once."""
        if final:
            self._cut(complete=True)
        blocks, self._blocks = self._blocks, []
        return blocks

    def _cut(self, complete: bool) -> None:
        """Make blocks of the samples of the present record."""
        most = None if self._triggered else BLOCK
        while len(self._samples) and (complete or (most and len(self._samples) >= most)):
            block, cut = self._samples[:most], int(self._overloads[:most].sum())
            start = self._record + self._taken / self.instrument.sample_rate
            self._blocks.append(Block(start, block.copy(), cut, self._triggered))
            self._samples = self._samples[len(block) :]
            self._overloads = self._overloads[len(block) :]
            self._taken += len(block)
        if complete:
            self._taken = 0


class _Pulses:
    """Impacts that last: each is two impulses, half a period of an oscillator apart.

    The state stays at the last impulse, so that it does not depend on how the motion is cut.
    """

    def __init__(self, system: ModalFilter, duration: float) -> None:
        self._system, self._duration = system, duration
        self._last = 0.0, 0.0
        inputs = system.state.shape[1]
        self._times = np.zeros((2, 0))  # of what is still to come, and what rounding takes away
        self._sizes = np.zeros((0, inputs))

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
            return response(k, dt)[:, 0]

        return at
