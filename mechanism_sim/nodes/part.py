"""Nodes that integrate: the linkage, and those of the parts of one kind, such as all cams."""

from __future__ import annotations

from collections.abc import Sequence

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.messages import stamp
from mechanism_sim.messages.part_states import KINDS, integrator_of, kinds_of
from mechanism_sim.nodes.described_node import Diagnosis
from mechanism_sim.nodes.following import MotionFollower, Schedule
from mechanism_sim.nodes.integration import Integration
from mechanism_sim.nodes.lifecycle import IntegratingNode
from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode


class PartNode(IntegratingNode):
    """Publishes the states of its parts, of a motion that it integrates itself or follows.

    It follows if ``linkage`` is among its partners. Without, it is the integrator of the run and
    publishes all that ``linkage`` would.
    """

    kind: str  #: of the parts, and the name of the node

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__(self.kind, parameters)

    def make_endpoints(self) -> None:
        """Publish the states, and all that integration gives if this node does that."""
        states = States(self, self.kind)
        role = MotionFollower if 'linkage' in self.partners.names else Integration
        self._role: MotionFollower | Integration = role(
            self, states.publish, reset=states.start_over
        )

    def on_ready(self) -> None:
        """All partners are there."""
        self._role.begin()

    def diagnose(self) -> Diagnosis:
        """Statistics of the solver, if this node has one."""
        found = super().diagnose()
        if self.ready and isinstance(self._role, Integration):
            found.values |= self._role.diagnose()
        return found


class LinkageNode(PartNode):
    """Integrates the machine and publishes its motion, forces and events, and no states."""

    kind = 'linkage'

    def make_endpoints(self) -> None:
        """Publish all that integration gives."""
        self._role = Integration(self)


class CamNode(PartNode):
    """Publishes ``cam_state`` of every cam and its follower."""

    kind = 'cam'


class GearTrain(PartNode):
    """Publishes ``gear_state`` of every pair of gears."""

    kind = 'gear_train'


class GenevaNode(PartNode):
    """Publishes ``geneva_state`` of every Geneva wheel and slotted rack."""

    kind = 'geneva'


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
