"""A machine that can run: its starts, its runs, what measures it."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Protocol

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.event_loop import EventLoop
from mechanism_sim.hybrid.events import Impact, ModeChange
from mechanism_sim.hybrid.snapshot import Snapshot, State
from mechanism_sim.planar.drive import Law
from mechanism_sim.planar.impulses import JointImpulses
from mechanism_sim.scene.dynamic_model import DynamicModel
from mechanism_sim.scene.initial_conditions import initial_state
from mechanism_sim.scene.instruments import channel, inertial_unit
from mechanism_sim.scene.oscillators import check_impulses, forces_on, joint_impulses, read_frame
from mechanism_sim.sensing.channel import Channel
from mechanism_sim.sensing.imu import InertialUnit
from mechanism_sim.vibration.frame import Frame
from mechanism_sim.vibration.shaken_frame import ShakenFrame
from mechanism_sim.vibration.shaking import Forces


class Run(Protocol):
    """A machine in motion: the event loop, or closed-form pieces."""

    events: int

    @property
    def steps(self) -> int:
        """Number of pieces of motion so far."""

    @property
    def time(self) -> float:
        """Time [s] up to which the motion is known."""

    def advance(self, until: float, final: bool = False, most: int | None = None) -> None:
        """Go on to `until` [s]."""

    def change_law(self, law: Law) -> None:
        """Announce another law of the drive."""

    def preview(self, until: float) -> Motion | None:
        """What is known beyond `time` of a motion up to `until` [s]."""

    def change_restitution(self, joint: str, restitution: float) -> None:
        """Let impacts of a joint have another coefficient from now on. KeyError: it has none."""

    def snapshot(self) -> Snapshot:
        """All that is needed to go on from here, bit by bit."""

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from there."""

    def drain(self) -> tuple[Motion, list[Impact], list[ModeChange]]:
        """Motion and events since the last call."""


class Machine(DynamicModel):
    """The mechanism of a scene, ready to run.

    What it is comes in layers, each with what the one below it lacks: as it is planned, assembled,
    and compiled.

    Attributes
    ----------
    name : of the scene
    scene : its content, in SI units
    """

    def oscillator(self, name: str) -> ShakenFrame:
        """A frame of the scene on its springs, at the start of a run.

        ``machine.oscillator('frame').take(solution.motion)`` gives its motion, a function of time;
        `take` may also be called with the motion of one `Piece` after the other.
        """
        return ShakenFrame(*self.shaken_frame(name))

    def shaken_frame(self, name: str) -> tuple[Frame, Forces]:
        """A frame on springs, and the forces of the machine on it; raises as `oscillator`."""
        return read_frame(self, name), forces_on(self, name)

    def check_impulses(self) -> None:
        """Refuse what `joint_impulses` cannot tell."""
        check_impulses(self)

    def joint_impulses(self) -> JointImpulses:
        """The impulses in all joints, from steps of the velocities."""
        return joint_impulses(self)

    def start(self, law: Law | None = None) -> Run:
        """A new run of the machine, under the scene's laws or another of its main drive."""
        laws = {**self.plan.laws, **({} if law is None else {self.main: (law,)})}
        system_order = [*self.plan.prescribed, *self.plan.powered]
        first = [laws[c][0] for c in system_order]
        run: Run
        if self.dynamic:
            solver = self.scene.solver
            run = EventLoop(
                self.system,
                first,
                self.initial_state(),
                solver.rtol,
                solver.atol,
                min(self.period / 8.0, 0.1),
                compact=self._large,
                fastest=self.fastest,
            )
        else:
            run = self.nominal(first, loads=True)
        for later in sorted(
            (x for c in system_order for x in laws[c][1:]), key=lambda x: x.valid_from
        ):
            run.change_law(later)
        return run

    def snapshot(self, run: Run) -> Snapshot:
        """What it takes for another run of this machine to go on where this one stands."""
        return replace(run.snapshot(), machine=self.fingerprint)

    def resume(self, snapshot: Snapshot) -> Run:
        """A run that goes on where another of this machine stood, bit by bit."""
        if snapshot.machine != self.fingerprint:
            raise InputError(
                f'the snapshot is of another machine than {self.name}: give the same scene with '
                'the same overrides'
            )
        run = self.start()
        run.restore(snapshot)
        return run

    def initial_state(self) -> State:
        """Where the equations of motion start (`mechanism_sim.scene.initial_conditions`)."""
        return self._initial_state

    @cached_property
    def _initial_state(self) -> State:
        return initial_state(self)

    @cached_property
    def ways(self) -> set[object]:
        """Of the drives, those that were tried and found free, see `mechanism_sim.scene.way`."""
        return set()

    def channel(self, name: str, beside: Channel | None = None) -> Channel:
        """The measured channel of a sensor, to be fed with motion from the start of a run on.

        It may share the analogue part of a channel `beside` it, fed with the same motions, that
        differs in sampling, converter and noise only.

        Raises
        ------
        KeyError
            If there is no such sensor.
        """
        return channel(self, name, beside)

    def inertial_unit(self, name: str) -> InertialUnit:
        """The inertial unit in the place of a sensor, to be fed likewise.

        Raises
        ------
        KeyError
            If there is no such sensor.
        """
        return inertial_unit(self, name)
