"""The accelerometers of a scene: measure the published motion, in blocks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.messages import AccelerometerBlock, float64_array, stamp
from mechanism_sim.middleware import Parameter
from mechanism_sim.nodes.following import Following
from mechanism_sim.nodes.process import main_of
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.scene import Machine


class _Sensor:
    """One sensor: its channel, and what its messages say beside the samples."""

    def __init__(self, machine: Machine, name: str) -> None:
        self._name, self._scene = name, machine.scene.sensors[name]
        self._channel = machine.channel(name)

    def take(self, motion: Motion) -> None:
        """Measure a piece of motion."""
        self._channel.take(motion)

    def messages(self, final: bool) -> list[Any]:
        """The blocks that are full, or all that is left."""
        scene, found = self._scene, []
        for block in self._channel.blocks(final):
            message = AccelerometerBlock(
                time=block.time,
                sensor=self._name,
                link=scene.link,
                sample_rate=scene.sample_rate,
                triggered=block.triggered,
                overloads=block.overloads,
            )
            setattr(message, scene.quantity, float64_array(block.samples))
            message.header.stamp = stamp(block.time)
            message.header.frame_id = scene.link
            found.append(message)
        return found


class Accelerometer(SimulationNode):
    """Publishes every sensor of the scene on ``accelerometer/NAME``."""

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('accelerometer', parameters)
        self._sensors = [
            (
                _Sensor(self.machine, name),
                self.create_publisher(AccelerometerBlock, f'accelerometer/{name}', RESULTS),
            )
            for name in self.machine.scene.sensors
        ]
        self._following = Following(self, self._take, self._rest)
        self.join()

    def on_progress(self, message: Any) -> None:
        """The last report of who publishes the motion says how much there is to sample."""
        self._following.look()

    def _take(self, motion: Motion) -> None:
        for sensor, _ in self._sensors:
            sensor.take(motion)
        self._send(final=False)

    def _rest(self) -> None:
        self._send(final=True)

    def _send(self, final: bool) -> None:
        for sensor, publisher in self._sensors:
            for message in sensor.messages(final):
                self.send(publisher, message)


def main(args: list[str] | None = None) -> None:
    """Run this node by itself."""
    main_of(Accelerometer, args)


if __name__ == '__main__':
    main()
