"""The drive of the crank: publishes the law of the crank's motion, and paces the run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from mechanism_sim.messages import Clock, DiagnosticStatus, DriveLaw, service_class, stamp
from mechanism_sim.messages.events import drive_law
from mechanism_sim.nodes.commands import DriveCommands
from mechanism_sim.nodes.control import SimulationControl
from mechanism_sim.nodes.described_node import Diagnosis
from mechanism_sim.nodes.drive import Drive
from mechanism_sim.nodes.middleware import Client, Future, Parameter, ReentrantCallbackGroup
from mechanism_sim.nodes.pace import AHEAD, BEHIND, Pace
from mechanism_sim.nodes.qos import CLOCK, RESULTS
from mechanism_sim.nodes.scene_values import OVERRIDES, SCENE, Content
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.nodes.spawning import LeadingDrive, Spawning


class CrankDrive(Drive):
    """Announces the law of the crank ahead of the slowest partner, by credit.

    A law and not samples, which would bring a delay of a tick; credit and not a common clock, so
    that a slow node delays the run and loses nothing.

    It is the simulator of the standard `simulation_interfaces`, see `SimulationControl`, and takes
    commands, see `DriveCommands`. Parameters of the node, besides those of every node: ``lead``
    [s], how far the law is announced ahead of the slowest partner; ``realtime_factor``, simulated
    seconds per second, 0 for as fast as possible (otherwise the lead is at most `AHEAD` of wall
    time, and a longer delay is not caught up); ``paused``, to begin so; ``hold``, to pause at the
    end of the run instead of ending; ``step_size`` [s]; ``publish_clock``; ``leader``, see
    `LeadingDrive`.
    """

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('crank_drive', parameters)
        for name, default, about, within in (
            ('lead', 3.0, 'How far ahead the law is announced [s]', (1e-6, 1e6)),
            ('realtime_factor', 0.0, 'Simulated seconds per second; 0: no limit', (0.0, 1e6)),
            ('step_size', 1e-3, 'Length of a step of the paused simulation [s]', (1e-9, 1e3)),
        ):
            self.declare(name, default, about, within)
        self.declare('hold', False, 'Pause at the end of the run', read_only=True)
        paused = self.declare('paused', False, 'Begin the run paused', read_only=True)
        alone = self.get_namespace() == '/'
        self.declare('publish_clock', alone, 'Publish the time on /clock', read_only=True)
        self.announced = 0.0
        self.playing = not paused
        self.final = False
        self._over = False
        self._quitting = False
        self._goal = 0.0  # [s] to which a paused simulation may go
        self._waiting: list[tuple[float, Future]] = []
        self._ending: Future | None = None  # done when partners have finished before another run
        self._take_laws()
        self._pace = Pace()
        self._leader = LeadingDrive(self)
        self._drive = self.create_publisher(DriveLaw, 'drive', RESULTS)
        if self.value('publish_clock'):
            self._clock_publisher = self.create_publisher(Clock, '/clock', CLOCK)
        self._commands = DriveCommands(self)
        self.spawning: Spawning = Spawning(self)
        self.control = SimulationControl(self)
        self._content_of_partners = ContentPropagation(self)
        self.join()

    # --- the laws -----------------------------------------------------------------------------

    @property
    def law(self) -> Any:
        """The law that holds where it is announced to."""
        return self._laws[self._law]

    def _take_laws(self) -> None:
        """Begin with the laws of the scene."""
        self._laws, self._law = list(self.machine.drive.laws), 0
        self._source = self.machine.drive.source

    def take_over(self, laws: Sequence[Any]) -> None:
        """Let other laws take over, the first at `announced`."""
        self._source = None
        self._laws[self._law + 1 :] = laws
        self.extend()

    # --- time ---------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time [s] up to which all partners have come."""
        return min(self.partners.time, self.spawning.time, self.announced)

    @property
    def due(self) -> bool:
        """True if time is to go on: all partners have come to where the law is announced to."""
        at, wanted = self.announced, self.playing or self.announced < self._goal
        return self.ready and not self.final and wanted and self.time >= at < self._leader.time

    def play(self) -> None:
        """Let time go on by itself."""
        self.playing = True
        self._pace.restart(self.announced)
        self.extend()

    def pause(self) -> None:
        """Stop where the law is announced to; who waits for more waits for that."""
        self.playing = False
        self._goal = self.announced
        self._waiting = [(min(goal, self._goal), future) for goal, future in self._waiting]

    async def arrive(self, goal: float) -> bool:
        """Let a paused simulation go on to `goal` [s], and wait until all partners are there.

        False if it was paused again before.
        """
        goal = min(goal, self.duration)
        self._goal = max(self._goal, goal)
        self.extend()
        await self._all_at(goal)
        return self.announced >= goal

    async def _all_at(self, goal: float) -> None:
        """Wait until all partners are in this run, and there."""
        there: Future = Future()
        self._waiting.append((goal, there))
        self._look_who_waits()
        await there

    async def start_over(self) -> str:
        """Begin a new run at time 0, once what was announced of this one is done.

        Gives back why not, if a partner does not take the values of the scene that are asked for.
        """
        playing = self.playing
        self.pause()
        if reason := await self._content_of_partners.propagate():
            if playing:
                self.play()
            return reason
        self.promise(self.announced, final=True, again=True)
        self._ending = Future()
        self.report(self.announced, finished=True, again=True)
        self._look_who_waits()
        await self._ending
        self.begin_run(self.run + 1)
        self.spawning.begin_run()
        self.announced = self._goal = 0.0
        self._take_laws()
        self._commands.begin()
        self.promise(0.0)
        self.report(0.0)
        await self._all_at(0.0)
        self._publish_clock()
        if playing:
            self.play()
        return ''

    def quit(self) -> None:
        """End the run where the law is announced to."""
        self._quitting = True
        self.extend()

    def on_ready(self) -> None:
        """Start the clock and give the first credit."""
        self._pace.restart(0.0)
        self._commands.begin()
        self.create_timer(0.01, self._tick)
        if self._leader.name:
            self.report(0.0)  # it is there, and waits to hear how far that is
        self._tick()

    def on_progress(self, message: Any) -> None:
        """Extend the law if a partner has progressed."""
        self.extend()
        self._commands.look()
        self._look_who_waits()

    async def on_leader(self) -> None:
        """Go on as far as the drive that this one follows, or begin anew with it."""
        leader = self._leader
        if self.ready and not leader.followed and leader.run > self.run:
            leader.followed = True
            await self.start_over()
            leader.followed = False
        self.extend()

    def on_spawned(self) -> None:
        """Extend the law if a machine that follows this one has gone on, or ended."""
        self.extend()
        self._look_who_waits()

    def _look_who_waits(self) -> None:
        if self._ending and not self._ending.done() and self.partners.finished:
            self._ending.set_result(None)
        if not (self.partners.began and self.spawning.began):
            return
        there = [w for w in self._waiting if w[0] <= self.time]
        self._waiting = [w for w in self._waiting if w[0] > self.time]
        for _, future in there:
            future.set_result(None)

    def _tick(self) -> None:
        final = self.final
        self.extend()
        self._publish_clock()  # to the end, which the recorder waits for
        if not final:
            return
        # Who waits for the end of the run gets an answer first, in the time between two ticks.
        self.done = self._over and not self.control.busy and not self.spawning.machines
        self._over = self.partners.finished

    def _publish_clock(self) -> None:
        if self.value('publish_clock'):
            self._clock_publisher.publish(Clock(clock=stamp(self.time)))

    @property
    def _given(self) -> float:
        """Time [s] to which commands, and the drive that this one follows, let it go."""
        return min(self._commands.horizon, self._leader.time)

    def extend(self) -> None:
        """Announce the law for as long as the slowest partner, the pace and commands allow."""
        if self.final or not self.ready:
            return
        if self._leader.finished and self.announced >= self._leader.time:
            self._quitting = True
        end = self.duration
        # up to which the law may be announced now [s]
        lead, factor = self.value('lead'), self.value('realtime_factor')
        if factor > 0.0:
            # with a pace, partners are not let fall far behind: they would rush to make up for it
            lead = min(lead, AHEAD * factor)
        slowest = min(self.partners.time, self.spawning.time)
        horizon = min(slowest + lead, self.duration, self._given)
        if not self.playing:
            horizon = min(horizon, self._goal)
        elif factor > 0.0:
            horizon = min(horizon, self._pace.due(factor, self.announced) + lead)
        stays = self.value('hold') or self._leader.name  # who follows ends when its leader does
        final = self._quitting or (horizon >= end and not stays)
        # a message that extends the law by less is not worth while
        worthwhile = self.announced + 0.25 * lead
        if self._quitting:
            horizon = self.announced
        elif horizon <= self.announced or (
            self.playing and horizon < min(end, self._given, worthwhile)
        ):
            return
        self.final = final
        while True:
            # the laws behind the present one, as far as they are known; one at least if any comes
            if self._source and self._law + 1 == len(self._laws):
                following = self._source.after(self.law)
                self._laws += [following] if following else []
            later = self._laws[self._law + 1 :]
            change = later[0].valid_from if later else math.inf
            last = final and horizon <= change
            if last or min(horizon, change) > max(self.announced, self.law.valid_from):
                self.promise(min(horizon, change), last)
            if horizon <= change:
                break
            self._law += 1
        self.announced = horizon
        if self.value('hold') and horizon >= end:
            self.pause()
        self.report(horizon, finished=final)

    def promise(self, until: float, final: bool = False, again: bool = False) -> None:
        """Announce that the present law holds until then [s]; `final`, and that the run ends."""
        number = self._law + 1
        message = drive_law(self.law, number, until, final, self.announced, self.run, again)
        self.send(self._drive, message)

    # --- record of deliveries -------------------------------------------------------------------

    def diagnose(self) -> Diagnosis:
        """Diagnose the rate at which time passes, beside the real-time factor asked for."""
        found, asked = super().diagnose(), self.value('realtime_factor')
        if self.ready and not self.done:
            achieved = self._pace.measure_factor(self.time)
            found.message = 'playing' if self.playing else 'paused'
            found.values |= {
                'announced [s]': self.announced,
                'real-time factor': achieved,
                'real-time factor asked for': asked,
            }
            if self.playing and asked > 0.0 and achieved < BEHIND * asked:
                found.level = DiagnosticStatus.WARN
                found.message = f'{achieved:.3g} times real time instead of {asked:g}'
                self.get_logger().warning(found.message, throttle_duration_sec=60.0)
        return found


class ContentPropagation:
    """Hands the drive's scene to its partners, before a run that has another than the last."""

    def __init__(self, drive: SimulationNode) -> None:
        self._drive, self._run_with = drive, Content.of(drive)
        self._kind = service_class('rcl_interfaces/srv/SetParametersAtomically')
        group = ReentrantCallbackGroup()  # who asks for a reset is in a callback that waits
        self._clients: dict[str, Client] = {
            name: drive.create_client(
                self._kind, f'{name}/set_parameters_atomically', callback_group=group
            )
            for name in drive.partners.names
        }
        drive.add_post_set_parameters_callback(self._announce)

    async def propagate(self) -> str:
        """Give all partners the values for the next run; why it cannot be, empty if it is done.

        If one refuses, all have those of the present run again.
        """
        asked = Content.of(self._drive)
        if asked == self._run_with:
            return ''
        for n, (name, client) in enumerate(self._clients.items()):
            if reason := await self._set(client, asked):
                for _, earlier in list(self._clients.items())[:n]:
                    await self._set(earlier, self._run_with)
                return f"'{name}' cannot begin a run with other values of the scene: {reason}"
        self._run_with = asked
        return ''

    async def _set(self, client: Client, content: Content) -> str:
        if not client.service_is_ready():
            return f'the service {client.service_name} is not available'
        parameters = [parameter.to_parameter_msg() for parameter in content.parameters()]
        answer: Any = await client.call_async(self._kind.Request(parameters=parameters))
        return '' if answer.result.successful else str(answer.result.reason)

    def _announce(self, parameters: list[Parameter]) -> None:
        if {SCENE, OVERRIDES} & {parameter.name for parameter in parameters}:
            asked = Content.of(self._drive)
            values = ', '.join(asked.lines) or 'no overrides'
            self._drive.get_logger().info(
                f'{asked.scene} ({values}) applies from the next reset on'
            )
