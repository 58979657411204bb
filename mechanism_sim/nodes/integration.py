"""Integrating a machine under the law of its drive, and publishing all of its motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mechanism_sim.hybrid.audit import Audit
from mechanism_sim.hybrid.events import Impact as ImpactEvent
from mechanism_sim.hybrid.events import ModeChange as ModeChangeEvent
from mechanism_sim.hybrid.sampling import Books, sample
from mechanism_sim.hybrid.tape import Motion as MotionBatch
from mechanism_sim.messages import (
    DriveLaw,
    Impact,
    JointReactions,
    JointState,
    LinkageState,
    ModeChange,
    Motion,
    String,
    TFMessage,
    events,
)
from mechanism_sim.messages.segments import pack
from mechanism_sim.nodes import publications
from mechanism_sim.nodes.qos import LATCHED, RESULTS
from mechanism_sim.nodes.schedule import Schedule
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.planar.drive import DriveLaw as MotionLaw
from mechanism_sim.planar.drive import Law, TorqueLaw
from mechanism_sim.scene.machine import Run

STEPS_PER_BATCH = 256


class Integration:
    """What a node does that integrates: it goes as far as the law of the drive holds.

    Batches do not influence the motion.

    Parameters
    ----------
    also : called with every piece of motion
    """

    def __init__(
        self, node: SimulationNode, also: Callable[[MotionBatch], None] = lambda _: None
    ) -> None:
        self._node, self._also = node, also
        self._machine = node.machine
        scene = self._machine.scene
        self._motion = node.create_publisher(Motion, 'motion', RESULTS)
        self._impacts = node.create_publisher(Impact, 'impacts', RESULTS)
        self._modes = node.create_publisher(ModeChange, 'mode_changes', RESULTS)
        self._states = node.create_publisher(JointState, 'joint_states', RESULTS)
        self._linkage = node.create_publisher(LinkageState, 'linkage_state', RESULTS)
        self._reactions = node.create_publisher(JointReactions, 'joint_reactions', RESULTS)
        self._transforms = node.create_publisher(TFMessage, '/tf', RESULTS)
        self._scene = node.create_publisher(String, 'scene', LATCHED)
        self._schedules = {
            'joint_states': Schedule(scene.outputs.joint_states),
            'linkage_state': Schedule(scene.outputs.linkage_state),
            'joint_reactions': Schedule(scene.outputs.joint_reactions),
            'transforms': Schedule(scene.outputs.transforms),
        }
        self._run: Run | None = None
        self._law_id = 0
        self._impact_count = 0
        self._physics = self._machine.physics
        self._audit = Audit(self._physics)
        self._machine.prepare()
        node.create_subscription(DriveLaw, 'drive', node.once_ready(self._follow), RESULTS)

    def begin(self) -> None:
        """All partners are there: describe the scene."""
        self._node.send(self._scene, String(data=events.describe(self._machine)))

    def look(self) -> None:
        """What partners report does not matter here: the law of the drive says how far to go."""

    def _follow(self, message: Any) -> None:
        """Advance to where the law is known to hold."""
        if self._run is None:
            self._run = self._machine.start(self._law(message))
        elif message.law_id != self._law_id:
            self._run.change_law(self._law(message))
        self._law_id = message.law_id
        while True:
            before = self._run.steps
            self._run.advance(message.valid_until, message.final, STEPS_PER_BATCH)
            self._publish(*self._run.drain())
            if self._run.steps - before < STEPS_PER_BATCH:
                break
            self._node.report(self._run.time)
        self._node.report(self._run.time, finished=message.final)
        self._node.done = message.final

    def _law(self, message: Any) -> Law:
        """The law of the drive that a message announces."""
        name, since = message.coordinate, message.valid_from
        coefficients = [float(c) for c in message.coefficients]
        if message.kind == DriveLaw.TORQUE:
            constant, per_angle, per_speed = coefficients
            return TorqueLaw(name, (constant, per_angle, per_speed), since)
        straight = name in self._machine.mechanism.displacements
        return MotionLaw(name, tuple(coefficients), message.reference_time, since, straight)

    def _publish(
        self, motion: MotionBatch, impacts: list[ImpactEvent], changes: list[ModeChangeEvent]
    ) -> None:
        before = self._audit.drive_work, self._audit.dissipated
        work = self._audit.add(motion, impacts)
        self._audit.judge(self._machine.allowed_penetration)
        for change in changes:
            self._node.send(self._modes, events.mode_change(change))
        if len(motion):
            names = (self._physics.coordinates, self._physics.clearances)
            self._node.send(self._motion, pack(motion, *names))
            self._publish_samples(motion, Books(work, impacts, *before))
            self._also(motion)
        for impact in impacts:
            self._node.send(self._impacts, events.impact(impact, self._impact_count))
            self._impact_count += 1

    def _publish_samples(self, motion: MotionBatch, books: Books) -> None:
        physics, curve = self._physics, motion.curve
        t = self._schedules['joint_states'].due(curve.end)
        if t.size:
            seen = physics.observe(motion, *curve.find(t))
            for state in publications.joint_states(physics, t, seen):
                self._node.send(self._states, state)
        t = self._schedules['linkage_state'].due(curve.end)
        if t.size:
            for message in publications.linkage_states(physics, sample(physics, motion, books, t)):
                self._node.send(self._linkage, message)
        t = self._schedules['joint_reactions'].due(curve.end)
        if t.size and physics.has_forces and self._machine.scene.outputs.forces:
            seen = physics.observe(motion, *curve.find(t))
            for forces in publications.reactions(physics, t, seen):
                self._node.send(self._reactions, forces)
        t = self._schedules['transforms'].due(curve.end)
        if t.size:
            for frames in publications.transforms(self._machine.mechanism, t, curve(t)):
                self._node.send(self._transforms, frames)
