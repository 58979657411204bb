"""An experiment with one sensor: its signal, and that of a machine with other values."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.results.run import run
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene
from mechanism_sim.sensing.indicators import features

STRETCHES = 6
"""Parts of a signal that are looked at apart, where the speed changes."""


@dataclass(frozen=True, eq=False)
class SensorRecord:
    """The signal of a sensor of a machine in one experiment.

    Attributes
    ----------
    machine : with its drive and its chain; the values of parameters to be found do not matter
    sensor : a name of the scene
    start : of the first sample, after the start of the run [s]
    samples : (N,) as the chain gives them, without a gap
    """

    machine: Machine
    sensor: str
    start: float
    samples: Array

    @property
    def rate(self) -> float:
        """Of sampling [Hz]."""
        return float(self.machine.scene.sensors[self.sensor].sample_rate)

    @property
    def steady(self) -> bool:
        """True if the main drive has one speed."""
        return self.machine.drive.steady and not self.machine.torque_driven

    @property
    def features(self) -> Array:
        """Of the samples."""
        return self.features_of(self.samples)

    def features_of(self, samples: Array) -> Array:
        """Of other samples of the same experiment."""
        return features(samples, self.rate, 1 if self.steady else STRETCHES)

    def repeat(self, overrides: dict[str, float], seed: int) -> Array:
        """Samples (N,) of the same experiment on a machine with other values and other noise."""
        given = overrides | {f'sensors.{self.sensor}.noise.seed': seed}
        content = self.machine.scene.to_document()
        machine = build(self.machine.name, check_scene(self.machine.name, content, given))
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
