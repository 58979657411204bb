"""Sample messages and their times, from samples of the engine; events: `messages.events`.

Each function returns the writer of messages of a topic: from samples of the machine at N
instants to N serialised messages.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.energy_terms import EnergyTerms
from mechanism_sim.engine.physics import Physics, known_wrench
from mechanism_sim.export.ideal import WORLD
from mechanism_sim.messages import (
    BearingLoads,
    JointReactions,
    JointState,
    LinkageState,
    TFMessage,
    TransformStamped,
    WrenchStamped,
    float64_array,
    uint8_array,
)
from mechanism_sim.messages.topics import WRENCH, topics_of, wrench_joints
from mechanism_sim.nodes.following import Schedule
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.quantities.shafts import bearing_loads as loads_of_bearings
from mechanism_sim.results.quantities.shafts import shafts_of
from mechanism_sim.results.quantity import View
from mechanism_sim.scene import Machine
from ros_interfaces.layout import Layout

_SAMPLED = 'joint_states', 'linkage_state', 'joint_reactions', '/tf', 'bearing_loads'
_ENERGIES = 'kinetic_energy', 'potential_energy', 'drive_work', 'dissipated'


def joint_states(physics: Physics) -> Callable[[View], list[bytes]]:
    """JointState messages: angles and displacements of links; efforts are those of drives."""
    names = list(physics.coordinates)
    driven, none = [names.index(c) for c in physics.driven], float64_array(np.zeros(len(names)))
    layout = Layout(JointState(name=names, position=none, velocity=none, effort=none))

    def write(view: View) -> list[bytes]:
        o = view.observed
        effort = np.zeros_like(o.position)
        effort[driven] = _torques(o)
        columns = {'position': o.position.T, 'velocity': o.velocity.T, 'effort': effort.T}
        return layout.write(view.t, columns)

    return write


def _rows(view: View, names: Sequence[str], missing: float = np.nan) -> Array:
    """Quantities (k, N) by name; `missing` for names that are not in the machine."""
    known, none = catalogue(view.machine), np.full(len(view.t), missing)
    return np.array([known[name].evaluate(view) if name in known else none for name in names])


def linkage_states(machine: Machine, world: str) -> Callable[[View], list[bytes]]:
    """LinkageState messages, in the frame of the world."""
    physics, elastic = machine.physics, [*machine.mechanism.having(Beam)]
    names, joints = list(physics.coordinates), list(physics.clearances)
    each, gap = float64_array(np.zeros(len(names))), float64_array(np.zeros(len(joints)))
    message = LinkageState(coordinates=names, joints=joints)
    message.header.frame_id = world
    message.position = message.velocity = message.acceleration = each
    message.gaps = message.normal_forces = message.friction_forces = gap
    message.modes = uint8_array(np.zeros(len(joints)))
    message.elastic_links = elastic
    message.deflections = message.stresses = float64_array(np.zeros(len(elastic)))
    layout = Layout(message)

    def write(view: View) -> list[bytes]:
        o = view.observed
        columns = {
            'position': o.position.T,
            'velocity': o.velocity.T,
            'acceleration': o.acceleration.T,
            'modes': view.modes.T,
            'gaps': o.gap.T,
            'normal_forces': o.normal_force.T,
            'friction_forces': o.friction_force.T,
            'drive_torque': _torques(o)[machine.drive.row],
            'kinetic_energy': o.kinetic_energy,
            'potential_energy': o.potential_energy,
            'drive_work': view.drive_work,
            'dissipated': view.dissipated,
        }
        if elastic:
            columns['deflections'] = _rows(view, [f'deflection.{link}' for link in elastic]).T
            columns['stresses'] = _rows(view, [f'stress.{link}' for link in elastic]).T
        if not o.drive_torque.size:  # neither torques nor energies are known
            columns |= dict.fromkeys(_ENERGIES, np.zeros(len(view.t)))
        return layout.write(view.t, columns)

    return write


def reactions(machine: Machine, world: str) -> Callable[[View], list[bytes]]:
    """JointReactions messages, in the frame of the world."""
    physics, joints = machine.physics, list(machine.physics.joints)
    none = float64_array(np.zeros(len(joints)))
    message = JointReactions(joints=joints, force_x=none, force_y=none, moment=none)
    message.loads = list(physics.unknowns)
    message.load_sizes = float64_array(np.zeros(len(message.loads)))
    if physics.tilting:
        message.force_z = message.moment_x = message.moment_y = none
    message.header.frame_id = world
    layout = Layout(message)

    def write(view: View) -> list[bytes]:
        o = view.observed
        x, y, moment = np.array([known_wrench(physics, o, j) for j in joints]).transpose(1, 2, 0)
        columns = {
            'force_x': x,
            'force_y': y,
            'moment': moment,
            'drive_torque': o.drive_torque[machine.drive.row],
        }
        if message.loads:
            columns['load_sizes'] = o.load.T
        if physics.tilting:
            columns |= {field: x.T for field, x in _out_of_plane(view, joints).items()}
        return layout.write(view.t, columns)

    return write


def _out_of_plane(view: View, joints: Sequence[str]) -> dict[str, Array]:
    """Forces and moments (j, N) in joints out of the plane; 0 in joints without them."""
    names = {'force_z': 'axial_force.{}', 'moment_x': 'bearing_moment.{}.x',
             'moment_y': 'bearing_moment.{}.y'}  # fmt: skip
    return {
        field: _rows(view, [name.format(joint) for joint in joints], 0.0)
        for field, name in names.items()
    }


def bearing_loads(machine: Machine, world: str) -> Callable[[View], list[bytes]]:
    """BearingLoads messages of every shaft, in the frame of the world."""
    layouts = {}
    for joint, names in shafts_of(machine).items():
        none = float64_array(np.zeros(len(names)))
        message = BearingLoads(joint=joint, bearings=list(names))
        message.force_x = message.force_y = message.axial_force = none
        message.header.frame_id = world
        layouts[joint] = Layout(message)

    def write(view: View) -> list[bytes]:
        return [
            data
            for joint, x in loads_of_bearings(view).items()
            for data in layouts[joint].write(
                view.t,
                {
                    'force_x': x.force[:, 0].T,
                    'force_y': x.force[:, 1].T,
                    'axial_force': x.axial.T,
                },
            )
        ]

    return write


def _torques(o: Observation) -> Array:
    """Torques (p, N) [N m, N] of the drives; 0 where forces are not computed."""
    return o.drive_torque if o.drive_torque.size else np.zeros((1, o.position.shape[1]))


def wrenches(
    machine: Machine, frame_of: Callable[[str], str], joints: Sequence[str]
) -> dict[str, Callable[[View], list[bytes]]]:
    """WrenchStamped messages by joint: of the first link on the second, in `_joint_frame`."""
    return {joint: _wrench(machine, joint, frame_of) for joint in joints}


def _wrench(
    machine: Machine, joint: str, frame_of: Callable[[str], str]
) -> Callable[[View], list[bytes]]:
    physics, mechanism = machine.physics, machine.mechanism
    message = WrenchStamped()
    message.header.frame_id = _joint_frame(joint, frame_of)
    layout, second = Layout(message), mechanism.joint(joint).second

    def write(view: View) -> list[bytes]:
        o = view.observed
        angle = mechanism.angle_all(second, o.local)
        c, s = np.cos(angle), np.sin(angle)
        x, y, moment = known_wrench(physics, o, joint)
        columns = {
            'wrench.force.x': c * x + s * y,
            'wrench.force.y': c * y - s * x,
            'wrench.torque.z': moment,
        }
        if joint in physics.tilting:
            force, x, y = (rows[0] for rows in _out_of_plane(view, [joint]).values())
            columns |= {
                'wrench.force.z': force,
                'wrench.torque.x': c * x + s * y,
                'wrench.torque.y': c * y - s * x,
            }
        return layout.write(view.t, columns)

    return write


def _joint_frame(joint: str, frame_of: Callable[[str], str]) -> str:
    """The frame of a joint: at its point on its second link, and fixed to that."""
    return frame_of(f'joint/{joint}')


def joint_transforms(
    joints: Iterable[str], mechanism: Mechanism, frame_of: Callable[[str], str]
) -> Any:
    """TFMessage of constant frames of joints in those of their second links."""
    frames = []
    for name in joints:
        joint = mechanism.joint(name)
        parent = WORLD if joint.second == GROUND else joint.second
        frame = TransformStamped(child_frame_id=_joint_frame(name, frame_of))
        frame.header.frame_id = frame_of(parent)
        frame.transform.translation.x, frame.transform.translation.y = map(float, joint.on_second)
        frames.append(frame)
    return TFMessage(transforms=frames)


def transforms(
    mechanism: Mechanism, frame_of: Callable[[str], str]
) -> Callable[[Array | NDArray[np.int64], Array], list[bytes]]:
    """TFMessages with the frame of every link in the world; angles are (N, n).

    Instants are (N,) [s], or whole nanoseconds.
    """
    links = [body.name for body in mechanism.bodies]
    frames = [TransformStamped(child_frame_id=frame_of(link)) for link in links]
    for frame in frames:
        frame.header.frame_id = frame_of(WORLD)
    layout = Layout(TFMessage(transforms=frames))

    def write(t: Array | NDArray[np.int64], angles: Array) -> list[bytes]:
        columns: dict[str, Array] = {}
        q: Any = dict(zip(mechanism.coordinates, angles.T, strict=True))
        for i, link in enumerate(links):
            x, y = mechanism.locate_all(link, angles.T)
            half = 0.5 * mechanism.angle(link, q)  # half angles at all instants
            inner = {'translation.x': x, 'translation.y': y,
                     'rotation.z': np.sin(half), 'rotation.w': np.cos(half)}  # fmt: skip
            columns |= {f'transforms[{i}].transform.{name}': v for name, v in inner.items()}
        return layout.write(t, columns)

    return write


class SampleTopic(NamedTuple):
    """A topic of samples: its schedule, its writer, and the number of messages per instant."""

    publisher: Any
    schedule: Schedule
    write: Callable[[View], list[bytes]]
    each: int


class SampleTopics:
    """Publisher of states, forces and frames at their due instants.

    Its topics are those of the node's first machine; later machines have the same structure.
    """

    def __init__(self, node: SimulationNode) -> None:
        machine, self._node = node.machine, node
        self.wrenches = wrench_joints(machine)
        self._publishers = {
            topic.name: node.create_publisher(topic.kind, topic.name, RESULTS)
            for topic in topics_of(machine)
            if topic.name in _SAMPLED or topic.kind is WrenchStamped
        }
        self.start_over()

    def start_over(self) -> None:
        """Start of a run with the node's present machine."""
        self._machine, frame, publisher = self._node.machine, self._node.frame, self._publishers
        machine, world, outputs = self._machine, frame(WORLD), self._machine.scene.outputs
        writers = [  # first the topic for which controllers wait
            ('joint_states', outputs.joint_states, joint_states(machine.physics)),
            ('linkage_state', outputs.linkage_state, linkage_states(machine, world)),
        ]
        if machine.physics.has_forces and outputs.forces:
            write = reactions(machine, world)
            writers.append(('joint_reactions', outputs.joint_reactions, write))
        if outputs.wrenches:
            writers += [
                (f'{WRENCH}/{joint}', outputs.wrenches, write)
                for joint, write in wrenches(machine, frame, self.wrenches).items()
            ]
        if 'bearing_loads' in publisher:
            write = bearing_loads(machine, world)
            writers.append(('bearing_loads', outputs.joint_reactions, write))
        shafts = len(shafts_of(machine))
        self._topics = [
            SampleTopic(
                publisher[topic], Schedule(rate), write, shafts if topic == 'bearing_loads' else 1
            )
            for topic, rate, write in writers
        ]
        self._last: list[tuple[float, Callable[[], list[bytes]]]] = []  # two last joint states
        self._frames_due = Schedule(outputs.transforms)
        self._write_frames = transforms(machine.mechanism, frame)

    def show_again(self, since: float) -> None:
        """Publish the last joint states again, for a controller that has replaced another.

        Also those of `since` [s], when the last command holds: an end that is rounded up has both.
        """
        for t, write in self._last:
            if t == self._last[-1][0] or math.isclose(t, since):
                self._node.send_all(self._topics[0].publisher, 1, write)

    def publish(self, motion: Motion, balance: Callable[[], EnergyTerms]) -> None:
        """Publish the samples due before the end of a motion that continues the last one."""
        curve, views = motion.curve, dict[bytes, View]()

        def view(t: Array) -> View:
            """Samples at times (N,) [s], shared by topics with the same instants."""
            key = t.tobytes()
            if key not in views:
                views[key] = View.at(self._machine, motion, t, balance)
            return views[key]

        def write(topic: SampleTopic, t: Array) -> list[bytes]:
            return topic.write(view(t))

        for topic in self._topics:
            t = topic.schedule.due(curve.end)
            if topic is self._topics[0]:
                self._last += [(float(x), partial(write, topic, np.array([x]))) for x in t[-2:]]
                del self._last[:-2]
            self._node.send_all(topic.publisher, len(t) * topic.each, write, topic, t)
        t = self._frames_due.due(curve.end)

        def frames() -> list[bytes]:
            k, dt = curve.find(t)
            # quaternions repeat after two turns: these keep their signs
            return self._write_frames(t, curve.local(k, dt) + TWO_PI * (curve.turns_at(k, dt) % 2))

        self._node.send_all(self._publishers['/tf'], len(t), frames)
