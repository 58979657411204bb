"""The signals of sensors, put together from their blocks."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.chain import QUANTITIES
from mechanism_sim.sensing.spectra import TurnSegments, at_equal_angles


@dataclass(frozen=True, eq=False)
class Signal:
    """Samples of one sensor, in runs of samples without a gap.

    Attributes
    ----------
    quantity : one of `QUANTITIES`
    rate : [Hz]
    starts : of the first sample of each run [s]
    runs : the samples (N,) of each
    """

    sensor: str
    link: str
    quantity: str
    rate: float
    starts: tuple[float, ...]
    runs: tuple[Array, ...]

    @property
    def unit(self) -> str:
        """Of the samples."""
        return QUANTITIES[self.quantity]

    @property
    def times(self) -> list[Array]:
        """When the samples of each run were due [s]."""
        pairs = zip(self.starts, self.runs, strict=True)
        return [start + np.arange(len(run)) / self.rate for start, run in pairs]

    @property
    def longest(self) -> Array:
        """The run with the most samples; the first of them if there are several."""
        return max(self.runs, key=len)

    def since(self, t: float) -> Signal:
        """The samples from a time [s] on."""
        found = self.between(t, np.inf)
        if found is None:
            raise InputError(f'sensor {self.sensor} has no samples after {t:.6g} s')
        return found

    def between(self, start: float, end: float) -> Signal | None:
        """The samples from one time [s] to another; None if there are none."""
        found = []
        for begin, t, run in zip(self.starts, self.times, self.runs, strict=True):
            # a sample that is due at the start but for rounding is due there
            first, last = np.searchsorted(t, [start - 1e-6 / self.rate, end])
            if first < last:
                found.append((begin + float(first) / self.rate, run[first:last]))
        if not found:
            return None
        starts, runs = zip(*found, strict=True)
        return replace(self, starts=starts, runs=runs)

    def over_turns(
        self, turned: Callable[[Array], Array], per_turn: int | None = None
    ) -> TurnSegments | None:
        """The signal over the angle of a shaft; None if it has no whole turn, or turns back.

        Parameters
        ----------
        turned : revolutions of the shaft by times (N,) [s]; nan where they are not known
        per_turn : angles in a turn, see `at_equal_angles`
        """
        angles = [turned(t) for t in self.times]
        known = [k for k, run in enumerate(angles) if np.isfinite(run).all()]
        try:
            return at_equal_angles(
                [angles[k] for k in known], [self.runs[k] for k in known], per_turn
            )
        except ValueError:
            return None


class SignalCollector:
    """Puts the signal of one sensor together from its blocks.

    Parameters
    ----------
    most : samples to keep; older ones are forgotten when there are more
    """

    def __init__(self, most: int | None = None) -> None:
        self.missing = 0  #: samples between blocks that should meet and do not
        self._most = most
        self._about: tuple[str, str, str, float] | None = None
        self._blocks: deque[tuple[float, bool, Array]] = deque()  # start, begins a run, samples
        self._kept = 0
        self._due: float | None = None

    def add(self, message: Any) -> Array:
        """Add the SensorBlock that follows, and return its samples (N,)."""
        samples = np.asarray(message.samples, np.float64)
        about = message.sensor, message.link, message.quantity, float(message.sample_rate)
        self.add_samples(about, float(message.time), samples, bool(message.triggered))
        return samples

    def add_samples(
        self, about: tuple[str, str, str, float], time: float, samples: Array, triggered: bool
    ) -> None:
        """Add samples (N,) from a time [s] on, `about` being sensor, link, quantity and rate."""
        if not len(samples):
            return
        rate = about[3]
        late = 0 if self._due is None else round((time - self._due) * rate)
        if not triggered:
            self.missing += max(0, late)
        apart = self._due is None or late != 0 or triggered
        self._about, self._due = about, time + len(samples) / rate
        self._blocks.append((time, apart, samples))
        self._kept += len(samples)
        while self._most and self._kept - len(self._blocks[0][2]) >= self._most:
            self._kept -= len(self._blocks.popleft()[2])

    def signal(self) -> Signal | None:
        """The signal so far; None without a sample."""
        if self._about is None:
            return None
        starts: list[float] = []
        runs: list[list[Array]] = []
        for time, apart, values in self._blocks:
            if apart or not runs:
                starts.append(time)
                runs.append([])
            runs[-1].append(values)
        return Signal(*self._about, tuple(starts), tuple(map(np.concatenate, runs)))


class SignalCollectors(dict[str, SignalCollector]):
    """Signals of several sensors by name."""

    def add(self, message: Any) -> None:
        """Add the SensorBlock that follows, of any of them."""
        self.setdefault(message.sensor, SignalCollector()).add(message)

    def signals(self) -> dict[str, Signal]:
        """Those that have samples, in alphabetical order."""
        return {name: s for name, c in sorted(self.items()) if (s := c.signal())}


def measured(machine: Machine, motion: Motion, sensor: str) -> Signal:
    """The signal of a sensor of the scene, computed from a motion from the start of a run on.

    It is what the node `sensors` publishes, to the last bit.
    """
    scene, channel = machine.scene.sensors[sensor], machine.channel(sensor)
    collector = SignalCollector()
    channel.take(motion)
    for block in channel.blocks(final=True):
        about = sensor, scene.carrier(machine), scene.measures, scene.sample_rate
        collector.add_samples(about, block.time, block.samples, block.triggered)
    signal = collector.signal()
    if signal is None:
        raise InputError(f'sensor {sensor} takes no sample in this run')
    return signal
