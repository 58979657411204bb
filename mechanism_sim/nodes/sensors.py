"""The sensors of a scene, which measure the published motion in blocks."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.messages import Imu, SensorBlock, float64_array
from mechanism_sim.nodes.following import MotionFollower
from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.scene import Machine
from ros_interfaces.layout import Layout


class _Sensor:
    """A sensor: its channel, and the fields of its messages beside the samples."""

    def __init__(self, machine: Machine, name: str, frame: str) -> None:
        sensor = machine.scene.sensors[name]
        self._message = SensorBlock(
            sensor=name, link=sensor.carrier(machine), quantity=sensor.measures, unit=sensor.unit,
            sample_rate=sensor.sample_rate,
        )  # fmt: skip
        self._message.header.frame_id = frame
        self._layouts: dict[int, Layout] = {}
        self._channel = machine.channel(name)

    def take(self, motion: Motion) -> None:
        """Measure a piece of motion."""
        self._channel.take(motion)

    def messages(self, final: bool) -> list[bytes]:
        """Messages of full blocks, or of all remaining samples."""
        found: list[bytes] = []
        for size, group in groupby(self._channel.blocks(final), lambda block: len(block.samples)):
            blocks = list(group)
            columns: dict[str, ArrayLike] = {
                'triggered': [block.triggered for block in blocks],
                'overloads': [block.overloads for block in blocks],
                'samples': [block.samples for block in blocks],
            }
            t = np.array([block.time for block in blocks])
            found += self._layout(size).write(t, columns)
        return found

    def _layout(self, size: int) -> Layout:
        """Layout of a message with a block of `size` samples, cached by size."""
        if size not in self._layouts:
            self._message.samples = float64_array(np.zeros(size))
            self._layouts = {size: Layout(self._message)}
        return self._layouts[size]


_EXACT = 1e-9
"""Variance of exact values: the least that robot_localization takes. Zeros would mean unknown."""


class _Unit:
    """A sensor as an inertial unit, by the conventions of REP-145."""

    def __init__(self, machine: Machine, name: str, frame: str) -> None:
        scene = machine.scene.sensors[name]
        self._unit = scene.inertial_unit(machine, name)
        chain = scene.chain()
        variance = chain.noise.rms.value**2 + chain.adc.step**2 / 12.0
        noisy, exact = (
            float64_array(np.diag(np.maximum(v, _EXACT)))
            for v in ([variance, variance, 0.0], [0.0] * 3)
        )
        message = Imu(
            orientation_covariance=exact, angular_velocity_covariance=exact,
            linear_acceleration_covariance=noisy,
        )  # fmt: skip
        message.header.frame_id = frame
        self._layout = Layout(message)

    def take(self, motion: Motion) -> None:
        """Measure a piece of motion."""
        self._unit.take(motion)

    def messages(self, final: bool) -> list[bytes]:
        """Readings of full blocks, or of all remaining samples."""
        found: list[bytes] = []
        for readings in self._unit.readings(final):
            t, acceleration, angle, rate = readings
            columns = {
                'orientation.z': np.sin(0.5 * angle),
                'orientation.w': np.cos(0.5 * angle),
                'angular_velocity.z': rate,
                'linear_acceleration.x': acceleration[:, 0],
                'linear_acceleration.y': acceleration[:, 1],
            }
            found += self._layout.write(t, columns)
        return found


class Sensors(SimulationNode):
    """Node that publishes each sensor on ``KIND/NAME``, and if requested on ``imu/NAME``."""

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('sensors', parameters)
        self._outlets = {}
        for name, scene in self.machine.scene.sensors.items():
            blocks = self.create_publisher(SensorBlock, f'{scene.kind}/{name}', RESULTS)
            imu = self.create_publisher(Imu, f'imu/{name}', RESULTS) if scene.imu else None
            self._outlets[name] = blocks, imu
        self._start_over()
        MotionFollower(self, self._take, self._rest, self._start_over)
        self.join()

    def _start_over(self) -> None:
        self._sensors: list[tuple[_Sensor | _Unit, Any]] = []
        for name, (blocks, imu) in self._outlets.items():
            frame = self.frame(self.machine.scene.sensors[name].carrier(self.machine))
            self._sensors.append((_Sensor(self.machine, name, frame), blocks))
            if imu:
                self._sensors.append((_Unit(self.machine, name, frame), imu))

    def _take(self, motion: Motion) -> None:
        for sensor, _ in self._sensors:
            sensor.take(motion)
        self._send(final=False)

    def _rest(self) -> None:
        self._send(final=True)

    def _send(self, final: bool) -> None:
        for sensor, publisher in self._sensors:
            messages = sensor.messages(final)
            self.send_all(publisher, len(messages), list, messages)
