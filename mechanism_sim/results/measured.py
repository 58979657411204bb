"""Signals measured on a machine, and those of runs with other values at the same instants."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.derivatives import RunDerivative
from mechanism_sim.results.run import Piece, run
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import rebuilt
from mechanism_sim.sensing.chain import QUANTITIES
from mechanism_sim.sensing.channel import Analogue
from mechanism_sim.sensing.indicators import FEWEST, features

_STRETCHES = 6  # number of parts of a signal with features of their own, where the speed changes


@dataclass(frozen=True, eq=False)
class SensorRecord:
    """The signal of a sensor of a machine in one experiment."""

    #: with drive and measuring chain; values of parameters to be found do not matter
    machine: Machine
    sensor: str  #: name of a sensor of the scene
    start: float  #: time of the first sample, after the start of the run [s]
    samples: Array  #: (N,) output of the chain, without gaps
    #: (N,) times [s] of samples that are not taken at the sensor's rate
    instants: Array | None = None

    @property
    def name(self) -> str:
        """Name of the sensor."""
        return self.sensor

    @property
    def unit(self) -> str:
        """SI unit of the samples."""
        return QUANTITIES[self.machine.scene.sensors[self.sensor].measures]

    @property
    def times(self) -> Array:
        """Times of the samples (N,) [s]."""
        if self.instants is not None:
            return self.instants
        return self.start + np.arange(len(self.samples)) / self.rate

    @property
    def noise(self) -> float:
        """Standard deviation of the chain's noise by the scene."""
        chain = self.machine.scene.sensors[self.sensor].chain()
        hum = chain.noise.hum.amplitude.value if chain.noise.hum else 0.0
        return math.sqrt(chain.noise.rms.value**2 + hum**2 / 2.0 + chain.adc.step**2 / 12.0)

    def of_run(self, run: Piece, t: Array) -> Array:
        """Samples (M,) of a run from its start on at times [s], without noise and converter."""
        return self._analogue(run).response(run.motion)(t)

    def slope(self, run: RunDerivative, t: Array) -> Array:
        """Derivative (M,) of `of_run`."""

        def seen(piece: Piece) -> Array:
            return self._analogue(piece).numbers(piece.motion)

        return run.of(lambda piece: self.of_run(piece, t), seen)

    def _analogue(self, run: Piece) -> Analogue:
        keys = run.machine.scene.sensors[self.sensor]
        return Analogue(keys.source(run.machine), keys.chain())

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]."""
        return float(self.machine.scene.sensors[self.sensor].sample_rate)

    @property
    def steady(self) -> bool:
        """True if the main drive has one speed."""
        return self.machine.drive.steady and not self.machine.torque_driven

    def check_features(self) -> None:
        """Refuse signals without features: too short, or not sampled evenly."""
        needed = FEWEST * (1 if self.steady else _STRETCHES)
        if len(self.samples) < needed or self.instants is not None:
            count = f'{len(self.samples)} samples of {self.sensor}'
            why = f'are too few: {needed} are needed'
            raise InputError(
                f'{count} {why if self.instants is None else "are not evenly spaced"} to compare '
                'features of a signal'
            )

    @property
    def features(self) -> Array:
        """Features of the samples."""
        return self.features_of(self.samples)

    def features_of(self, samples: Array) -> Array:
        """Features of other samples of the same experiment."""
        return features(samples, self.rate, 1 if self.steady else _STRETCHES)

    def repeat(self, overrides: dict[str, float], seed: int) -> Array:
        """Samples (N,) of the same experiment on a machine with other values and other noise."""
        given = overrides | {f'sensors.{self.sensor}.noise.seed': seed}
        machine = rebuilt(self.machine.name, self.machine.scene.to_document(), given)
        wanted = len(self.samples)
        end = self.start + (wanted + 1) / self.rate
        channel, blocks = machine.channel(self.sensor), []
        for piece in run(machine, end):
            channel.take(piece.motion)
            blocks += channel.blocks(final=False)
        blocks += channel.blocks(final=True)
        first = self.start - 0.5 / self.rate
        parts = []
        for block in blocks:
            early = max(0, math.ceil((first - block.time) * self.rate))
            parts.append(block.samples[early:])
        return np.concatenate(parts)[:wanted]


@dataclass(frozen=True, eq=False)
class QuantityRecord:
    """A quantity of the catalogue as it was measured, by whatever means."""

    machine: Machine
    name: str  #: name of the quantity
    times: Array  #: (N,) rising times [s] after the start of the run
    samples: Array  #: (N,) values in SI units
    noise = 0.0  #: unknown

    @property
    def unit(self) -> str:
        """SI unit of the samples."""
        return catalogue(self.machine)[self.name].unit

    def of_run(self, run: Piece, t: Array) -> Array:
        """The quantity (M,) at times [s] of a run."""
        return np.asarray(run.sample(t, self.name)[self.name], dtype=float)

    def slope(self, run: RunDerivative, t: Array) -> Array:
        """Derivative (M,) of `of_run`."""
        return np.asarray(run.sample(t, self.name)[self.name], dtype=float)


Measured = SensorRecord | QuantityRecord
