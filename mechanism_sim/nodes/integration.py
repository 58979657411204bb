"""Integrating a machine under the law of its drive, and publishing all of its motion.

One node integrates the whole machine: cams and gears load the crank, and divided equations would
have an error of coupling.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.export.ideal import WORLD
from mechanism_sim.export.urdf import to_urdf
from mechanism_sim.hybrid.audit import Work
from mechanism_sim.hybrid.dense_output import Motion as MotionBatch
from mechanism_sim.hybrid.energy_terms import EnergyTerms, work_since_start
from mechanism_sim.messages import (
    BearingLoads,
    DriveLaw,
    Impact,
    JointReactions,
    JointState,
    LinkageState,
    ModeChange,
    Motion,
    SceneChange,
    String,
    TFMessage,
    WrenchStamped,
    events,
)
from mechanism_sim.messages.segments import pack
from mechanism_sim.messages.topics import WRENCH, loaded_shafts, wrench_joints
from mechanism_sim.nodes import publications
from mechanism_sim.nodes.entities import Entities
from mechanism_sim.nodes.qos import LATCHED, RESULTS
from mechanism_sim.nodes.restitutions import Restitutions
from mechanism_sim.nodes.schedule import Schedule
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.results.run import Batch, Runner, prepare
from mechanism_sim.results.solution import Piece
from mechanism_sim.results.view import View
from mechanism_sim.scene.machine import Run

BATCH = Batch(steps=1024, stride=256, longest=0.05)
"""Largest contents of a message."""


class Integration:
    """Work of a node that integrates: it goes as far as the law of the drive holds.

    Batches do not influence the motion, nor does where the law is known to hold: a step that goes
    beyond is kept back, and samples before that are taken from its beginning.

    Parameters
    ----------
    also : called with every piece of motion
    reset : called when a run begins anew
    """

    def __init__(
        self,
        node: SimulationNode,
        also: Callable[[MotionBatch], None] = lambda _: None,
        reset: Callable[[], None] = lambda: None,
    ) -> None:
        self._node, self._also, self._reset = node, also, reset
        self._take_machine()
        self._motion = node.create_publisher(Motion, 'motion', RESULTS)
        self._impacts = node.create_publisher(Impact, 'impacts', RESULTS)
        self._modes = node.create_publisher(ModeChange, 'mode_changes', RESULTS)
        self._states = node.create_publisher(JointState, 'joint_states', RESULTS)
        self._linkage = node.create_publisher(LinkageState, 'linkage_state', RESULTS)
        self._reactions = node.create_publisher(JointReactions, 'joint_reactions', RESULTS)
        self._transforms = node.create_publisher(TFMessage, '/tf', RESULTS)
        self._loads = (
            node.create_publisher(BearingLoads, 'bearing_loads', RESULTS)
            if loaded_shafts(self._machine)
            else None
        )
        self._wrenches = {
            joint: node.create_publisher(WrenchStamped, f'{WRENCH}/{joint}', RESULTS)
            for joint in wrench_joints(self._machine)
        }
        self._scene = node.create_publisher(String, 'scene', LATCHED)
        self._description = node.create_publisher(String, 'robot_description', LATCHED)
        self._fixed = (
            node.create_publisher(TFMessage, '/tf_static', LATCHED) if self._wrenches else None
        )
        self._changes = node.create_publisher(SceneChange, 'scene_changes', RESULTS)
        self._known = 0.0
        self._restitutions = Restitutions(node, self._change)
        self._start_over()
        node.create_subscription(DriveLaw, 'drive', node.once_ready(self._follow), RESULTS)
        self._drive = node.resolve_topic_name('drive')
        self._entities = Entities(node, self)

    def begin(self) -> None:
        """A run begins: describe the scene and the machine."""
        self._node.send(self._scene, String(data=events.describe(self._machine)))
        try:
            described = to_urdf(self._machine, self._node.frame(''))
        except InputError as error:  # a tree of a machine that runs all the same
            self._node.get_logger().warning(f'no robot_description: {error}')
        else:
            self._node.send(self._description, String(data=described))
        if self._fixed:
            self._node.send(
                self._fixed,
                publications.joint_transforms(
                    self._wrenches, self._machine.mechanism, self._node.frame
                ),
            )

    def look(self) -> None:
        """Do nothing: the law of the drive limits the integration, not reports of partners."""

    def diagnose(self) -> dict[str, object]:
        """Statistics of the solver."""
        run = self._runner
        balance: dict[str, object] = {
            'steps': run.engine.steps if run else 0,
            'events': run.engine.events if run else 0,
            'impacts': self._impact_count,
            'largest penetration [m]': run.audit.max_penetration if run else 0.0,
            'largest closure error [m]': run.audit.max_closure_error if run else 0.0,
        }
        if run and (energy := run.audit.energy):
            balance['missing in the energy balance [J]'] = energy.residual
            balance['energy exchanged [J]'] = energy.exchanged
            balance['works may be off by [J]'] = energy.error
        return balance

    @property
    def begun(self) -> bool:
        """True if any motion of the run is known."""
        return self._latest is not None

    def observe_latest(self) -> tuple[float, Observation]:
        """The last time [s] up to which the motion is known, and the machine then."""
        assert self._latest is not None  # noqa: S101 - who asks has looked whether it has `begun`
        curve = self._latest.curve
        t = min(self._known, float(curve.end))
        return t, self._physics.observe(self._latest, *curve.find(np.array([t])))

    def _take_machine(self) -> None:
        self._machine = self._node.machine
        self._physics = self._machine.physics
        prepare(self._machine)

    def _start_over(self) -> None:
        outputs = self._machine.scene.outputs
        self._schedules = {
            'joint_states': Schedule(outputs.joint_states),
            'linkage_state': Schedule(outputs.linkage_state),
            'joint_reactions': Schedule(outputs.joint_reactions),
            'transforms': Schedule(outputs.transforms),
        }
        if self._loads:
            self._schedules['bearing_loads'] = Schedule(outputs.joint_reactions)
        if self._wrenches and outputs.wrenches:
            self._schedules['wrenches'] = Schedule(outputs.wrenches)
        physics, mechanism, frame = self._physics, self._machine.mechanism, self._node.frame
        self._write_states = publications.joint_states(physics)
        self._write_linkage = publications.linkage_states(self._machine, frame(WORLD))
        self._write_reactions = publications.reactions(self._machine, frame(WORLD))
        self._write_loads = publications.bearing_loads(self._machine, frame(WORLD))
        self._write_transforms = publications.transforms(mechanism, frame)
        self._write_wrench = publications.wrenches(self._machine, frame, [*self._wrenches])
        self._runner: Runner | None = None
        self._law_id = 0
        self._known = 0.0
        self._published_until = 0.0  # [s] up to which followers have been told
        self._impact_count = 0
        self._events = events.EventWriter(frame(WORLD))
        self._latest: MotionBatch | None = None

    def _follow(self, message: Any) -> None:
        """Advance to where the law is known to hold."""
        if not self._node.goes_on(message.run):
            return
        if message.run != self._node.run:
            self._node.begin_run(message.run)
            if self._machine is not self._node.machine:
                self._take_machine()
            self._start_over()
            self._restitutions.start_over()
            self._reset()
            self.begin()
        if message.valid_until > 0.0:
            self._advance(message)
        else:
            names = (self._physics.coordinates, self._physics.clearances)
            none = next(Runner(self._machine, audited=False).to(0.0, batch=Batch(0, 0)))
            self._node.send(self._motion, pack(none.motion, *names, 0.0, message.run))
        self._node.report(self._known, finished=message.final, again=message.again)
        self._node.done = message.final and not message.again

    def _advance(self, message: Any) -> None:
        machine = self._machine
        law = events.law_of(message, machine.mechanism.displacements)
        if law.coordinate != machine.plan.main or type(law) is not type(machine.drive.law):
            self._node.ignore(self._drive, 'it is no law of the drive of this machine')
            return
        if self._runner is None:
            self._runner = Runner(self._machine, self._machine.start(law))
            for path, value in self._restitutions.changed.items():
                self._change(path, value)
        elif message.law_id != self._law_id:
            try:
                self._runner.engine.change_law(law)
            except ValueError as error:
                self._node.ignore(self._drive, str(error))
                return
        self._law_id = message.law_id
        for piece in self._runner.to(message.valid_until, final=message.final, batch=BATCH):
            self._known = self._runner.known
            self._publish(piece, self._runner.engine)
            if self._runner.more:
                self._node.report(self._known)

    def _change(self, path: str, value: float) -> None:
        """Change a restitution for all impacts that are not known yet."""
        if self._runner is not None:
            self._runner.engine.change_restitution(path.split('.')[1], value)
            self._node.send(self._changes, events.scene_change(path, value, self._known))
            self._node.announce(path, value, self._known)

    def _publish(self, piece: Piece, engine: Run) -> None:
        motion, impacts, balance = piece.motion, piece.impacts, piece.balance
        self._node.send_all(self._modes, self._events.mode_changes(piece.modes))
        if len(motion) or self._known > self._published_until:
            names = (self._physics.coordinates, self._physics.clearances)
            message = pack(motion, *names, self._known, self._node.run, engine.time)
            self._node.send(self._motion, message)
            self._published_until = self._known
        ahead = engine.preview(self._known)
        seen = [m for m in (motion, ahead) if m is not None and len(m)]
        if seen:
            self._latest = seen[-1]
            if ahead is not None and len(ahead) and self._physics.has_forces:
                each = np.arange(len(ahead))
                coming = work_since_start(self._physics, ahead, each, ahead.curve.duration)
                work = Work(*np.concatenate([balance.work, coming], axis=1))
                balance = balance._replace(work=work)
            self._publish_samples(MotionBatch.joined(seen), balance)
        if len(motion):
            self._also(motion)
        self._node.send_all(self._impacts, self._events.impacts(impacts, self._impact_count))
        self._impact_count += len(impacts)

    def _publish_samples(self, motion: MotionBatch, balance: EnergyTerms) -> None:
        curve, node = motion.curve, self._node
        due = {topic: schedule.due(curve.end) for topic, schedule in self._schedules.items()}
        views: dict[bytes, View] = {}

        def view(t: Array) -> View:
            """Topics that are due at the same instants share what is computed."""
            key = t.tobytes()
            if key not in views:
                views[key] = View.at(self._machine, motion, t, balance)
            return views[key]

        if due['linkage_state'].size:
            node.send_all(self._linkage, self._write_linkage(view(due['linkage_state'])))
        if due['joint_states'].size:
            seen = view(due['joint_states'])
            node.send_all(self._states, self._write_states(seen.t, seen.observed))
        forces = self._physics.has_forces and self._machine.scene.outputs.forces
        if due['joint_reactions'].size and forces:
            node.send_all(self._reactions, self._write_reactions(view(due['joint_reactions'])))
        if 'wrenches' in due and due['wrenches'].size:
            for joint, publisher in self._wrenches.items():
                node.send_all(publisher, self._write_wrench[joint](view(due['wrenches'])))
        if self._loads and due['bearing_loads'].size:
            node.send_all(self._loads, self._write_loads(view(due['bearing_loads'])))
        t = due['transforms']
        if t.size:
            k, dt = curve.find(t)
            # quaternions repeat after two turns: these keep their signs
            angles = curve.local(k, dt) + TWO_PI * (curve.turns_at(k, dt) % 2)
            node.send_all(self._transforms, self._write_transforms(t, angles))
