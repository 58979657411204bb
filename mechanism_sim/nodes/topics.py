"""The topics of a run: which there are, of what type, how reliable."""

from __future__ import annotations

from typing import Any, NamedTuple

from mechanism_sim.cycles.shafts import shafts_of
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
from mechanism_sim.nodes.middleware import QoSProfile
from mechanism_sim.nodes.oscillator import TOPIC as OSCILLATOR_STATE
from mechanism_sim.nodes.parts import kinds_of
from mechanism_sim.nodes.qos import CLOCK, LATCHED, RESULTS
from mechanism_sim.scene import Machine


class Topic(NamedTuple):
    """A topic by its relative name, the class of its messages, and its quality of service."""

    name: str
    kind: Any
    qos: QoSProfile


WRENCH = 'wrench'
"""Of the topics of joints, ``wrench/JOINT``."""


def wrench_joints(machine: Machine) -> tuple[str, ...]:
    """The joints whose wrenches the scene wants to be published."""
    outputs = machine.scene.outputs
    if outputs.wrenches is None or not outputs.forces or not machine.physics.has_forces:
        return ()
    return tuple(machine.physics.joints)


def loaded_shafts(machine: Machine) -> bool:
    """Whether a machine has shafts whose bearings carry known forces."""
    forces = machine.scene.outputs.forces and machine.physics.has_forces
    return forces and bool(shafts_of(machine))


def topics_of(machine: Machine, display: bool = False) -> list[Topic]:
    """The topics of a run of a machine, but for ``progress``; `display`: with that node."""
    scene = machine.scene
    topics = [
        Topic('scene', String, LATCHED),
        Topic('robot_description', String, LATCHED),
        Topic('drive', DriveLaw, RESULTS),
        Topic('motion', Motion, RESULTS),
        Topic('impacts', Impact, RESULTS),
        Topic('mode_changes', ModeChange, RESULTS),
        Topic('scene_changes', SceneChange, RESULTS),
        Topic('joint_states', JointState, RESULTS),
        Topic('linkage_state', LinkageState, RESULTS),
        Topic('joint_reactions', JointReactions, RESULTS),
        Topic('/tf', TFMessage, RESULTS),
        Topic('/clock', Clock, CLOCK),
    ]
    if loaded_shafts(machine):
        topics.append(Topic('bearing_loads', BearingLoads, RESULTS))
    sensors = scene.sensors.items()
    topics += [Topic(f'{sensor.kind}/{name}', SensorBlock, RESULTS) for name, sensor in sensors]
    topics += [Topic(f'imu/{name}', Imu, RESULTS) for name, sensor in sensors if sensor.imu]
    topics += [Topic(k.topic, k.message, RESULTS) for k in kinds_of(machine).values()]
    topics += [Topic(f'{WRENCH}/{j}', WrenchStamped, RESULTS) for j in wrench_joints(machine)]
    if scene.oscillators:
        topics.append(Topic(OSCILLATOR_STATE, OscillatorState, RESULTS))
    if display:
        topics += [
            Topic('markers', MarkerArray, LATCHED),
            Topic('force_markers', MarkerArray, RESULTS),
        ]
    return topics
