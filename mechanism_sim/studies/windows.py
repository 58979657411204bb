"""Windows of a sensor's signal: where they lie, and with which seed the noise is drawn."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, check_known
from mechanism_sim.numerics.polynomials import first_due
from mechanism_sim.scene import Machine
from mechanism_sim.scene.schema import Scene
from mechanism_sim.sensing.channel import Block
from mechanism_sim.studies.schema import WindowsPart


def check(windows: WindowsPart, machine: Machine, since: float, end: float) -> None:
    """Refuse what a run from `since` to `end` [s] cannot give.

    How many windows a trigger gives shows in the run only.
    """
    known = list(machine.scene.sensors)
    if not known:
        raise InputError(f'{machine.name} has no sensors to cut windows from')
    wanted = windows.per_run or 1
    for name in windows.sensors_of(machine.scene):
        wrong = f"windows: {machine.name} has no sensor '{name}'"
        check_known(name, known, wrong, 'its sensors are:')
        sensor = machine.scene.sensors[name]
        if sensor.trigger is None:
            rate = sensor.sample_rate
            # jitter may throw the last sample out of the run
            samples = first_due(end, rate) - bool(sensor.adc.jitter)
            count = (samples - windows.samples) // windows.hop + 1
            count -= -(-first_due(since, rate) // windows.hop)
            if count < wanted:
                raise InputError(
                    f"windows: sensor '{name}' gives {max(count, 0)} of {windows.samples} "
                    f'samples between {since:g} s and {end:g} s, not {wanted}: '
                    'run longer, or ask for fewer or shorter ones'
                )
        elif sensor.trigger.samples is not None and sensor.trigger.samples < windows.samples:
            raise InputError(
                f"windows: sensor '{name}' takes {sensor.trigger.samples} samples at a "
                f'trigger, so that windows of {windows.samples} do not fit'
            )


def with_seed(scene: Scene, index: int, swept: Collection[str]) -> Scene:
    """The scene with noise of its own for run number `index`.

    The seed follows from that of the scene and the number; random numbers differ between
    sensors of one seed anyway. Seeds that are `swept` stay.
    """
    sensors = dict(scene.sensors)
    for name, sensor in scene.sensors.items():
        if f'sensors.{name}.noise.seed' in swept:
            continue
        word = np.random.SeedSequence([sensor.noise.seed, index]).generate_state(1)
        noise = sensor.noise.model_copy(update={'seed': int(word[0])})
        sensors[name] = sensor.model_copy(update={'noise': noise})
    return scene.model_copy(update={'sensors': sensors})


class SampleWindow(NamedTuple):
    """Consecutive samples; `start` [s] is when the first is due."""

    start: float
    samples: Array
    overloads: int  #: number of samples clipped at full scale


class Cutter:
    """Windows cut from successive blocks of a sensor.

    A window is within one record: the whole run, or the samples after a trigger.

    Parameters
    ----------
    rate : sampling rate of the sensor [Hz]
    since : earliest start of windows [s]
    """

    def __init__(self, windows: WindowsPart, rate: float, since: float) -> None:
        self._windows, self._rate, self._since = windows, rate, since
        self._start = 0.0  # start of the record [s]
        self._index = 0  # index of the first stored sample
        self._samples: Array = np.zeros(0)
        self._cut = np.zeros(0, bool)  # True for clipped samples

    @property
    def next_start(self) -> float:
        """Bound on the starts of later windows: none begins before this time [s]."""
        return self._start + (self._index - 2) / self._rate

    def cut(self, blocks: Iterable[Block]) -> Iterator[SampleWindow]:
        """The windows that more blocks complete."""
        size, hop = self._windows.samples, self._windows.hop
        for block in blocks:
            if block.triggered:
                self._start, self._index = block.time, 0
                self._samples, self._cut = block.samples, block.cut
            else:
                self._samples = np.append(self._samples, block.samples)
                self._cut = np.append(self._cut, block.cut)
            while len(self._samples) >= size:
                start = self._start + self._index / self._rate
                if start >= self._since:
                    yield SampleWindow(start, self._samples[:size], int(self._cut[:size].sum()))
                self._samples, self._cut = self._samples[hop:], self._cut[hop:]
                self._index += hop
