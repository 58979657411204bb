"""Publication of the states of all parts of one kind, as a part of a node."""

from __future__ import annotations

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.messages import stamp
from mechanism_sim.messages.part_states import KINDS, integrator_of, kinds_of
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.schedule import Schedule
from mechanism_sim.nodes.simulation_node import SimulationNode


class States:
    """Publishes the states of all parts of one kind."""

    def __init__(self, node: SimulationNode, name: str) -> None:
        machine = node.machine
        if name not in kinds_of(machine):
            raise InputError(
                f"{machine.name} has nothing for the node '{name}'; it needs "
                f"'{integrator_of(machine)}'"
            )
        self._kind = KINDS[name]
        self._node = node
        self._publisher = node.create_publisher(self._kind.message, self._kind.topic, RESULTS)
        self.start_over()

    def start_over(self) -> None:
        """A run begins anew."""
        self._schedule = Schedule(self._node.machine.scene.outputs.part_states)

    def publish(self, motion: Motion) -> None:
        """The states that are due in a piece of motion."""
        t = self._schedule.due(motion.curve.end)
        if not t.size:
            return
        for time, joint, fields in self._kind.states(self._node.machine, motion, t):
            message = self._kind.message(time=time, joint=joint, **fields)
            message.header.stamp = stamp(time)
            self._node.send(self._publisher, message)
