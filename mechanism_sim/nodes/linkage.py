"""The linkage: integrates the motion under the law of its drive and publishes all of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

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
from mechanism_sim.middleware import Parameter
from mechanism_sim.nodes import publications
from mechanism_sim.nodes.process import main_of
from mechanism_sim.nodes.qos import LATCHED, RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.planar.drive import DriveLaw as MotionLaw
from mechanism_sim.planar.drive import Law, TorqueLaw
from mechanism_sim.scene.machine import Run

STEPS_PER_BATCH = 256


class Linkage(SimulationNode):
    """Goes as far as the law of the drive holds; batches do not influence the motion."""

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('linkage', parameters)
        scene = self.machine.scene
        self._motion = self.create_publisher(Motion, 'motion', RESULTS)
        self._impacts = self.create_publisher(Impact, 'impacts', RESULTS)
        self._modes = self.create_publisher(ModeChange, 'mode_changes', RESULTS)
        self._states = self.create_publisher(JointState, 'joint_states', RESULTS)
        self._linkage = self.create_publisher(LinkageState, 'linkage_state', RESULTS)
        self._reactions = self.create_publisher(JointReactions, 'joint_reactions', RESULTS)
        self._transforms = self.create_publisher(TFMessage, '/tf', RESULTS)
        self._scene = self.create_publisher(String, 'scene', LATCHED)
        self._rates = {
            'joint_states': scene.outputs.joint_states,
            'linkage_state': scene.outputs.linkage_state,
            'joint_reactions': scene.outputs.joint_reactions,
            'transforms': scene.outputs.transforms,
        }
        self._next = dict.fromkeys(self._rates, 0)
        self._run: Run | None = None
        self._law_id = 0
        self._impact_count = 0
        self._physics = self.machine.physics
        self._audit = Audit(self._physics)
        self.machine.prepare()
        self.create_subscription(DriveLaw, 'drive', self.once_ready(self._follow), RESULTS)
        self.join()

    def on_ready(self) -> None:
        """Describe the scene."""
        self.send(self._scene, String(data=events.describe(self.machine)))

    def _follow(self, message: Any) -> None:
        """Advance to where the law is known to hold."""
        if self._run is None:
            self._run = self.machine.start(self._law(message))
        elif message.law_id != self._law_id:
            self._run.change_law(self._law(message))
        self._law_id = message.law_id
        while True:
            before = self._run.steps
            self._run.advance(message.valid_until, message.final, STEPS_PER_BATCH)
            self._publish(*self._run.drain())
            if self._run.steps - before < STEPS_PER_BATCH:
                break
            self.report(self._run.time)
        self.report(self._run.time, finished=message.final)
        self.done = message.final

    def _law(self, message: Any) -> Law:
        """The law of the drive that a message announces."""
        name, since = message.coordinate, message.valid_from
        coefficients = [float(c) for c in message.coefficients]
        if message.kind == DriveLaw.TORQUE:
            constant, per_angle, per_speed = coefficients
            return TorqueLaw(name, (constant, per_angle, per_speed), since)
        straight = name in self.machine.mechanism.displacements
        return MotionLaw(name, tuple(coefficients), message.reference_time, since, straight)

    def _publish(
        self, motion: MotionBatch, impacts: list[ImpactEvent], changes: list[ModeChangeEvent]
    ) -> None:
        before = self._audit.drive_work, self._audit.dissipated
        work = self._audit.add(motion, impacts)
        self._audit.judge(self.machine.allowed_penetration)
        for change in changes:
            self.send(self._modes, events.mode_change(change))
        if len(motion):
            names = (self._physics.coordinates, self._physics.clearances)
            self.send(self._motion, pack(motion.curve, motion.modes, *names))
            self._publish_samples(motion, Books(work, impacts, *before))
        for impact in impacts:
            self.send(self._impacts, events.impact(impact, self._impact_count))
            self._impact_count += 1

    def _publish_samples(self, motion: MotionBatch, books: Books) -> None:
        physics, curve = self._physics, motion.curve
        t = self._due('joint_states', curve.end)
        if t.size:
            k = curve.locate(t)
            dt = (t - curve.start[k]) - curve.start_low[k]
            for state in publications.joint_states(physics, t, physics.observe(motion, k, dt)):
                self.send(self._states, state)
        t = self._due('linkage_state', curve.end)
        if t.size:
            for message in publications.linkage_states(physics, sample(physics, motion, books, t)):
                self.send(self._linkage, message)
        t = self._due('joint_reactions', curve.end)
        if t.size and physics.has_forces and self.machine.scene.outputs.forces:
            k = curve.locate(t)
            dt = (t - curve.start[k]) - curve.start_low[k]
            for forces in publications.reactions(physics, t, physics.observe(motion, k, dt)):
                self.send(self._reactions, forces)
        t = self._due('transforms', curve.end)
        if t.size:
            for frames in publications.transforms(self.machine.mechanism, t, curve(t)):
                self.send(self._transforms, frames)

    def _due(self, topic: str, end: float) -> np.ndarray:
        """Times [s] before `end` at which the topic is due: multiples of its period."""
        rate, first = self._rates[topic], self._next[topic]
        last = max(first, int(np.ceil(end * rate)))
        t = np.arange(first, last + 1) / rate
        t = t[t < end]
        self._next[topic] = first + len(t)
        return t


def main(args: list[str] | None = None) -> None:
    """Run this node by itself."""
    main_of(Linkage, args)


if __name__ == '__main__':
    main()
