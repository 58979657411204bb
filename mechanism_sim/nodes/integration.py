"""Integration of a machine under the law of its drive, and publication of its motion.

One node integrates the whole machine: cams and gears load the crank, and divided equations would
have a coupling error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mechanism_sim.engine.audit import Work
from mechanism_sim.engine.dense_output import Motion as MotionBatch
from mechanism_sim.engine.energy_terms import EnergyTerms, work_since_start
from mechanism_sim.errors import InputError
from mechanism_sim.export.ideal import WORLD
from mechanism_sim.export.urdf import to_urdf
from mechanism_sim.messages import (
    DriveLaw,
    Impact,
    ModeChange,
    Motion,
    SceneChange,
    String,
    TFMessage,
    events,
)
from mechanism_sim.messages.segments import pack, row_names
from mechanism_sim.nodes import publications
from mechanism_sim.nodes.control import Entities
from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.publications import SampleTopics
from mechanism_sim.nodes.qos import LATCHED, RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.results.run import Batch, Piece, Runner, prepare
from mechanism_sim.scene import Machine

BATCH = Batch(steps=4096, stride=256, longest=0.05)
"""Largest contents of a message of motion: what is done once for each costs as much as some
hundred steps."""
LARGEST = 4 << 20
"""[B] of its coefficients, of a coordinate and a step some `_EACH`."""
_EACH = 8 * 20
TOGETHER = 256
"""Steps that are audited at once where messages have few."""


class MachineDescription:
    """Latched topics: the scene, the URDF and constant frames."""

    def __init__(self, node: SimulationNode, wrenches: Sequence[str]) -> None:
        self._node, self._wrenches = node, wrenches
        self._scene = node.create_publisher(String, 'scene', LATCHED)
        self._description = node.create_publisher(String, 'robot_description', LATCHED)
        self._fixed = node.create_publisher(TFMessage, '/tf_static', LATCHED) if wrenches else None

    def publish(self, machine: Machine) -> None:
        """Publish the description of the machine of a new run."""
        node = self._node
        node.send(self._scene, String(data=events.describe(machine)))
        try:
            described = to_urdf(machine, node.frame(''))
        except InputError as error:  # no URDF; the machine can run nevertheless
            node.get_logger().warning(f'no robot_description: {error}')
        else:
            node.send(self._description, String(data=described))
        if self._fixed:
            frames = publications.joint_transforms(self._wrenches, machine.mechanism, node.frame)
            node.send(self._fixed, frames)


class Integration:
    """Integration in a node, up to the end of validity of the drive's law.

    Neither batches nor the end of validity of the law influence the motion: a step
    beyond it is withheld, and samples before the end are taken from the step's first part.

    Parameters
    ----------
    also : callback with every piece of motion
    reset : callback at the start of another run
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
        self._samples = SampleTopics(node)
        self._description = MachineDescription(node, self._samples.wrenches)
        self._changes = node.create_publisher(SceneChange, 'scene_changes', RESULTS)
        self._runner: Runner | None = None
        self._restitutions = Restitutions(node, self._change)
        self._start_over()
        drive = node.create_subscription(DriveLaw, 'drive', node.once_ready(self._follow), RESULTS)
        self._drive = drive.topic_name
        self._entities = Entities(node, self)

    def begin(self) -> None:
        """Start of a run: publish descriptions of the scene and the machine."""
        self._description.publish(self._machine)

    def diagnose(self) -> dict[str, object]:
        """Statistics of the solver."""
        run = self._runner
        if run:
            run.balance()
        balance: dict[str, object] = {
            'steps': run.engine.steps if run else 0,
            'events': run.engine.events if run else 0,
            'impacts': self._impact_count,
            'largest penetration [m]': run.audit.max_penetration if run else 0.0,
            'largest closure error [m]': run.audit.max_closure_error if run else 0.0,
        }
        if run and (energy := run.audit.energy):
            balance['residual of the energy balance [J]'] = energy.residual
            balance['energy exchanged [J]'] = energy.exchanged
            balance['error of the work [J]'] = energy.error
        return balance

    @property
    def begun(self) -> bool:
        """True if any motion of the run is known."""
        return self._latest is not None

    @property
    def _known(self) -> float:
        """Time [s] up to which the motion is known."""
        return self._runner.known if self._runner else 0.0

    def observe_latest(self) -> tuple[float, Observation]:
        """The last time [s] of the known motion, and the observation of the machine then."""
        assert self._latest is not None  # noqa: S101 - callers have checked `begun`
        curve = self._latest.curve
        t = min(self._known, float(curve.end))
        return t, self._machine.physics.observe(self._latest, *curve.find(np.array([t])))

    def _take_machine(self) -> None:
        self._machine = self._node.machine
        prepare(self._machine)
        steps = LARGEST // (_EACH * len(self._machine.physics.coordinates))
        self._batch = BATCH._replace(steps=min(BATCH.steps, max(BATCH.stride, steps)))

    def _start_over(self) -> None:
        self._samples.start_over()
        self._runner = None
        self._law_id = 0
        self._published_until = 0.0  # [s] end of the published motion
        self._impact_count = 0
        self._events = events.EventWriter(self._node.frame(WORLD))
        self._latest: MotionBatch | None = None

    def _follow(self, message: Any) -> None:
        """Advance to the end of validity of the law."""
        if not self._node.partners.goes_on(message.run):
            return
        if message.run != self._node.run:
            self._node.begin_run(message.run)
            if self._machine is not self._node.machine:
                self._take_machine()
            self._start_over()
            self._restitutions.start_over()
            self._reset()
            self.begin()
        # may be a repetition, see `Drive.promise`
        known = message.law_id == self._law_id and message.valid_until <= self._known
        if known and not message.final:
            self._samples.show_again(message.valid_from)
        elif message.valid_until > 0.0:
            self._advance(message)
        else:
            none = next(Runner(self._machine, audited=False).to(0.0, batch=Batch(0, 0)))
            self._send_motion(none.motion, 0.0)
        self._node.report(self._known, finished=message.final, again=message.again)
        self._node.done = message.final and not message.again

    def _advance(self, message: Any) -> None:
        machine = self._machine
        law = events.law_of(message, machine.mechanism.displacements)
        if law.coordinate != machine.plan.main or type(law) is not type(machine.drive.law):
            self._node.ignore(self._drive, 'it is not a law of the drive of this machine')
            return
        if self._runner is None:
            started = self._machine.start(law)
            self._runner = Runner(self._machine, started, together=TOGETHER)
            for path, value in self._restitutions.changed.items():
                self._change(path, value)
        elif message.law_id != self._law_id:
            try:
                self._runner.engine.change_law(law)
            except ValueError as error:
                self._node.ignore(self._drive, str(error))
                return
        self._law_id = message.law_id
        for piece in self._runner.to(message.valid_until, final=message.final, batch=self._batch):
            self._publish(piece, self._runner)
            if self._runner.more:
                self._node.report(self._known)

    def _change(self, path: str, value: float) -> None:
        """Change a restitution for all future impacts."""
        if self._runner is not None:
            self._runner.engine.change_restitution(path.split('.')[1], value)
            self._node.send(self._changes, events.scene_change(path, value, self._known))
            self._node.announce(path, value, self._known)

    def _send_motion(self, motion: MotionBatch, end: float) -> None:
        """Publish motion that ends at `end` [s], and the time up to which it is known."""

        def make() -> list[Any]:
            names = row_names(self._machine), self._machine.physics.clearances
            return [pack(motion, *names, self._known, self._node.run, end)]

        self._node.send_all(self._motion, 1, make)
        self._published_until = self._known

    def _publish(self, piece: Piece, runner: Runner) -> None:
        engine = runner.engine
        motion, send, events = piece.motion, self._node.send_all, self._events
        send(self._modes, len(piece.modes), events.mode_changes, piece.modes)
        if len(motion) or self._known > self._published_until:
            self._send_motion(motion, engine.time)
        ahead = engine.preview(self._known)
        seen = [m for m in (motion, ahead) if m is not None and len(m)]

        def balance() -> EnergyTerms:
            known, physics = runner.balance(), self._machine.physics
            if ahead is None or not len(ahead) or not physics.has_forces:
                return known
            # no sample is after the last segment, whose work is not needed
            each = np.arange(len(ahead) - 1)
            coming = work_since_start(physics, ahead, each, ahead.curve.duration[:-1])
            none = np.zeros((len(Work._fields), 1))
            work = Work(*np.concatenate([known.work, coming, none], axis=1))
            return known._replace(work=work)

        if seen:
            self._latest = seen[-1]
            self._samples.publish(MotionBatch.joined(seen), balance)
        if len(motion):
            self._also(motion)
        impacts = piece.impacts
        send(self._impacts, len(impacts), events.impacts, impacts, self._impact_count)
        self._impact_count += len(impacts)


class Restitutions:
    """A parameter ``joints.NAME.clearance.restitution`` for every rigid contact of the scene.

    Parameters
    ----------
    change : function that changes a restitution by path
    """

    def __init__(self, node: SimulationNode, change: Callable[[str, float], None]) -> None:
        self.changed: dict[str, float] = {}  #: values that differ from the scene, by path
        self._change = change
        self._node = node
        self._scene = self._of_scene()
        about = 'Coefficient of restitution, of all impacts from the time of the change on'
        self._launched = {
            path: node.declare(path, value, about, (0.0, 1.0))
            for path, value in self._scene.items()
        }
        self.start_over()
        if self._scene:
            node.add_post_set_parameters_callback(self._take)

    def start_over(self) -> None:
        """Reset to the values at launch, or to changed ones of the scene, for a new run."""
        before, self._scene = self._scene, self._of_scene()
        for path, value in self._scene.items():
            if value != before[path]:
                self._launched[path] = value
        moved = [p for p, value in self._launched.items() if self._node.value(p) != value]
        self.changed = {p: x for p, x in self._launched.items() if x != self._scene[p]}
        self._node.set_parameters([Parameter(p, value=self._launched[p]) for p in moved])

    def _of_scene(self) -> dict[str, float]:
        return {
            f'joints.{name}.clearance.restitution': play.restitution
            for name, play in self._node.machine.plan.rigid.items()
            if play.wall == 'rigid'
        }

    def _take(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name in self._scene:
                value = float(parameter.value)
                if value != self._scene[parameter.name]:
                    self.changed[parameter.name] = value
                else:
                    self.changed.pop(parameter.name, None)
                self._change(parameter.name, value)
