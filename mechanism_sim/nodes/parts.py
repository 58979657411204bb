"""Kinds of parts that have a node of their own: their joints, their topic, their readings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.messages import CamState, GearState, GenevaState, stamp
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.schedule import Schedule
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.joint_view import JointView


@dataclass(frozen=True)
class Kind:
    """A kind of parts.

    Attributes
    ----------
    topic : of its states
    message : their class; its fields are those of a reading, after header, time and joint
    """

    topic: str
    message: Any

    def joints(self, machine: Machine) -> list[HigherPair]:
        """The joints whose readings are of this kind."""
        pairs = (j for j in machine.mechanism.joints if isinstance(j, HigherPair))
        return [pair for pair in pairs if pair.node and KINDS[pair.node] is self]

    def states(
        self, machine: Machine, motion: Motion, t: NDArray[np.float64]
    ) -> list[tuple[float, str, dict[str, Any]]]:
        """Time [s], joint and fields of every state at times `t` (N,) [s] of a motion."""
        k, dt = motion.curve.find(t)
        observed, modes = machine.physics.observe(motion, k, dt), motion.modes[k].T
        columns = {}
        for joint in self.joints(machine):
            view = JointView(machine.mechanism, joint, machine.physics, observed, modes)
            columns[joint.name] = joint.reading(view)._asdict()
        return [
            (time, name, {field: column[i].item() for field, column in fields.items()})
            for i, time in enumerate(t.tolist())
            for name, fields in columns.items()
        ]


#: by the name of the node
KINDS = {
    'cam': Kind('cam_state', CamState),
    'gear_train': Kind('gear_state', GearState),
    'geneva': Kind('geneva_state', GenevaState),
}


def kinds_of(machine: Machine) -> dict[str, Kind]:
    """The kinds of parts that a machine has, by the names of their nodes."""
    return {name: kind for name, kind in KINDS.items() if kind.joints(machine)}


def integrator_of(machine: Machine) -> str:
    """Name of the node that integrates a machine.

    It is the node of a kind of parts if nothing but these closes loops, else ``linkage``.
    """
    for name, kind in kinds_of(machine).items():
        if {*machine.mechanism.cut} <= {joint.name for joint in kind.joints(machine)}:
            return name
    return 'linkage'


class States:
    """Publishes the states of all parts of one kind.

    Raises
    ------
    InputError
        If the scene of the node has none.
    """

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
