"""The frames on springs of a machine."""

from __future__ import annotations

from collections.abc import Sequence

from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.errors import InputError
from mechanism_sim.messages import OscillatorState, stamp
from mechanism_sim.messages.topics import OSCILLATOR_STATE
from mechanism_sim.nodes.following import MotionFollower, Schedule
from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.vibration.shaken_frame import FrameStates

FIELDS = (
    ('x', 'y', 'angle'),
    ('velocity_x', 'velocity_y', 'angular_velocity'),
    ('acceleration_x', 'acceleration_y', 'angular_acceleration'),
    ('force_x', 'force_y', 'moment'),
    ('mount_force_x', 'mount_force_y', 'mount_moment'),
)
"""Fields of the message, in the order of `FrameStates` and of its rows."""


def fields(states: FrameStates, i: int) -> dict[str, float]:
    """The fields of the message at instant i."""
    return {
        name: value
        for names, rows in zip(FIELDS, states, strict=True)
        for name, value in zip(names, [*rows[:, i].tolist(), 0.0], strict=False)
    }


class OscillatorNode(SimulationNode):
    """Node that publishes ``oscillator_state`` of every frame, from a followed motion."""

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('oscillator', parameters)
        machine = self.machine
        if not machine.scene.oscillators:
            raise InputError(
                f"{machine.name} has nothing for the node 'oscillator': it needs 'oscillators'"
            )
        self._states = self.create_publisher(OscillatorState, OSCILLATOR_STATE, RESULTS)
        self._start_over()
        MotionFollower(self, self._take, reset=self._start_over)
        self.join()

    def _start_over(self) -> None:
        scene = self.machine.scene
        self._frames = {name: self.machine.oscillator(name) for name in scene.oscillators}
        self._schedule = Schedule(scene.outputs.part_states)

    def _take(self, motion: Motion) -> None:
        t = self._schedule.due(motion.curve.end)
        moved = {name: frame.take(motion) for name, frame in self._frames.items()}
        states = {name: frame(t) for name, frame in moved.items()}
        for i, time in enumerate(t.tolist()):
            for name, known in states.items():
                message = OscillatorState(time=time, oscillator=name, **fields(known, i))
                message.header.stamp = stamp(time)
                self.send(self._states, message)
