"""The accelerometers of a scene: sample the published motion, in blocks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.messages import AccelerometerBlock, float64_array, stamp
from mechanism_sim.middleware import Parameter
from mechanism_sim.nodes.following import Following
from mechanism_sim.nodes.process import main_of
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.linkage import LinkageSensor
from mechanism_sim.scene.schema import Accelerometer as AccelerometerScene
from mechanism_sim.sensing.accelerometer import IdealAccelerometer

BLOCK = 256  # samples


class _Sensor:
    """One sensor: its instrument, and the samples that do not fill a block yet."""

    def __init__(
        self, mechanism: Mechanism, name: str, scene: AccelerometerScene | LinkageSensor
    ) -> None:
        self.name, self.link, self.rate = name, scene.link, scene.sample_rate
        self._instrument = IdealAccelerometer(mechanism, scene.link, scene.at, scene.axis)
        self._samples = np.zeros(0)
        self._first = 0

    def take(self, curve: PiecewisePolynomial) -> None:
        """Sample a piece of motion at the multiples of the sampling period within it."""
        first = self._first + len(self._samples)
        t = np.arange(first, int(np.ceil(curve.end * self.rate)) + 1) / self.rate
        t = t[t < curve.end]
        if t.size:
            self._samples = np.append(self._samples, self._instrument.read(curve, t))

    def blocks(self, all_of_it: bool) -> list[Any]:
        """The blocks that are full, or all that is left."""
        messages = []
        while len(self._samples) >= BLOCK or (all_of_it and len(self._samples)):
            start = self._first / self.rate
            message = AccelerometerBlock(
                time=start,
                sensor=self.name,
                link=self.link,
                sample_rate=self.rate,
                acceleration=float64_array(self._samples[:BLOCK].copy()),
            )
            message.header.stamp = stamp(start)
            message.header.frame_id = self.link
            messages.append(message)
            self._first += len(message.acceleration)
            self._samples = self._samples[BLOCK:]
        return messages


class Accelerometer(SimulationNode):
    """Publishes every sensor of the scene on ``accelerometer/NAME``."""

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('accelerometer', parameters)
        mechanism = self.machine.mechanism
        self._sensors = [
            (
                _Sensor(mechanism, name, scene),
                self.create_publisher(AccelerometerBlock, f'accelerometer/{name}', RESULTS),
            )
            for name, scene in self.machine.scene.sensors.items()
        ]
        self._following = Following(self, self._take, self._rest)
        self.join()

    def on_progress(self, message: Any) -> None:
        """The last report of who publishes the motion says how much there is to sample."""
        self._following.look()

    def _take(self, motion: Motion) -> None:
        for sensor, publisher in self._sensors:
            sensor.take(motion.curve)
            for block in sensor.blocks(all_of_it=False):
                self.send(publisher, block)

    def _rest(self) -> None:
        for sensor, publisher in self._sensors:
            for block in sensor.blocks(all_of_it=True):
                self.send(publisher, block)


def main(args: list[str] | None = None) -> None:
    """Run this node by itself."""
    main_of(Accelerometer, args)


if __name__ == '__main__':
    main()
