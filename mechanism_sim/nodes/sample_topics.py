"""Topics of samples: each at the rate that the scene asks for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from mechanism_sim.arrays import Array
from mechanism_sim.export.ideal import WORLD
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.energy_terms import EnergyTerms
from mechanism_sim.messages import (
    BearingLoads,
    JointReactions,
    JointState,
    LinkageState,
    TFMessage,
    WrenchStamped,
)
from mechanism_sim.messages.topics import WRENCH, loaded_shafts, wrench_joints
from mechanism_sim.nodes import publications
from mechanism_sim.nodes.following import Schedule
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.results.quantity import View


class SampleTopic(NamedTuple):
    """A topic of samples: when they are due, and what writes them."""

    publisher: Any
    schedule: Schedule
    write: Callable[[View], list[bytes]]


class SampleTopics:
    """Publishes states, forces and frames at the instants at which they are due.

    Its topics are those of the node's first machine; later runs are of machines of its structure.
    """

    def __init__(self, node: SimulationNode) -> None:
        machine, self._node = node.machine, node
        kinds = {
            'joint_states': JointState,
            'linkage_state': LinkageState,
            'joint_reactions': JointReactions,
            '/tf': TFMessage,
        }
        if loaded_shafts(machine):
            kinds['bearing_loads'] = BearingLoads
        self.wrenches = wrench_joints(machine)
        kinds |= {f'{WRENCH}/{joint}': WrenchStamped for joint in self.wrenches}
        self._publishers = {
            topic: node.create_publisher(kind, topic, RESULTS) for topic, kind in kinds.items()
        }
        self.start_over()

    def start_over(self) -> None:
        """A run begins, or begins anew, of the machine that the node has now."""
        self._machine, frame, publisher = self._node.machine, self._node.frame, self._publishers
        machine, world, outputs = self._machine, frame(WORLD), self._machine.scene.outputs
        writers = [
            ('linkage_state', outputs.linkage_state, publications.linkage_states(machine, world)),
            ('joint_states', outputs.joint_states, publications.joint_states(machine.physics)),
        ]
        if machine.physics.has_forces and outputs.forces:
            write = publications.reactions(machine, world)
            writers.append(('joint_reactions', outputs.joint_reactions, write))
        if outputs.wrenches:
            writers += [
                (f'{WRENCH}/{joint}', outputs.wrenches, write)
                for joint, write in publications.wrenches(machine, frame, self.wrenches).items()
            ]
        if 'bearing_loads' in publisher:
            write = publications.bearing_loads(machine, world)
            writers.append(('bearing_loads', outputs.joint_reactions, write))
        self._topics = [
            SampleTopic(publisher[topic], Schedule(rate), write) for topic, rate, write in writers
        ]
        self._frames_due = Schedule(outputs.transforms)
        self._write_frames = publications.transforms(machine.mechanism, frame)

    def publish(self, motion: Motion, balance: EnergyTerms) -> None:
        """Publish the samples that are due before the end of a motion that follows the last."""
        curve, views = motion.curve, dict[bytes, View]()

        def view(t: Array) -> View:
            """Topics that are due at the same instants share what is computed."""
            key = t.tobytes()
            if key not in views:
                views[key] = View.at(self._machine, motion, t, balance)
            return views[key]

        for topic in self._topics:
            t = topic.schedule.due(curve.end)
            if t.size:
                self._node.send_all(topic.publisher, topic.write(view(t)))
        t = self._frames_due.due(curve.end)
        if t.size:
            k, dt = curve.find(t)
            # quaternions repeat after two turns: these keep their signs
            angles = curve.local(k, dt) + TWO_PI * (curve.turns_at(k, dt) % 2)
            self._node.send_all(self._publishers['/tf'], self._write_frames(t, angles))
