"""The topics of a run: which there are, of what type, and how they are delivered."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

from mechanism_sim.messages import (
    BearingLoads,
    Clock,
    DriveLaw,
    Impact,
    Imu,
    JointReactions,
    JointState,
    LinkageState,
    MarkerArray,
    ModeChange,
    Motion,
    OscillatorState,
    SceneChange,
    SensorBlock,
    String,
    TFMessage,
    WrenchStamped,
)
from mechanism_sim.messages.part_states import kinds_of
from mechanism_sim.results.quantities.shafts import shafts_of
from mechanism_sim.scene import Machine

Delivery = Literal['results', 'latched', 'clock']
"""Results are never dropped; of what is latched, whoever comes late gets the last; of the clock
only the newest counts.
"""


class Topic(NamedTuple):
    """A topic by its relative name, the class of its messages, and its delivery."""

    name: str
    kind: Any
    delivery: Delivery


OSCILLATOR_STATE = 'oscillator_state'
WRENCH = 'wrench'
"""Prefix of the topics of joints, ``wrench/JOINT``."""


def wrench_joints(machine: Machine) -> tuple[str, ...]:
    """The joints whose wrenches the scene wants to be published."""
    outputs = machine.scene.outputs
    if outputs.wrenches is None or not outputs.forces or not machine.physics.has_forces:
        return ()
    return tuple(machine.physics.joints)


def loaded_shafts(machine: Machine) -> bool:
    """True if a machine has shafts whose bearings carry known forces."""
    forces = machine.scene.outputs.forces and machine.physics.has_forces
    return forces and bool(shafts_of(machine))


def topics_of(machine: Machine, display: bool = False) -> list[Topic]:
    """The topics of a run of a machine, but for ``progress``; `display`: with that node."""
    scene = machine.scene
    topics = [
        Topic('scene', String, 'latched'),
        Topic('robot_description', String, 'latched'),
        Topic('drive', DriveLaw, 'results'),
        Topic('motion', Motion, 'results'),
        Topic('impacts', Impact, 'results'),
        Topic('mode_changes', ModeChange, 'results'),
        Topic('scene_changes', SceneChange, 'results'),
        Topic('joint_states', JointState, 'results'),
        Topic('linkage_state', LinkageState, 'results'),
        Topic('joint_reactions', JointReactions, 'results'),
        Topic('/tf', TFMessage, 'results'),
        Topic('/clock', Clock, 'clock'),
    ]
    if loaded_shafts(machine):
        topics.append(Topic('bearing_loads', BearingLoads, 'results'))
    sensors = scene.sensors.items()
    topics += [Topic(f'{sensor.kind}/{name}', SensorBlock, 'results') for name, sensor in sensors]
    topics += [Topic(f'imu/{name}', Imu, 'results') for name, sensor in sensors if sensor.imu]
    topics += [Topic(k.topic, k.message, 'results') for k in kinds_of(machine).values()]
    if wrenches := wrench_joints(machine):
        topics += [Topic(f'{WRENCH}/{joint}', WrenchStamped, 'results') for joint in wrenches]
        topics.append(Topic('/tf_static', TFMessage, 'latched'))
    if scene.oscillators:
        topics.append(Topic(OSCILLATOR_STATE, OscillatorState, 'results'))
    if display:
        topics += [
            Topic('markers', MarkerArray, 'latched'),
            Topic('force_markers', MarkerArray, 'results'),
        ]
    return topics
