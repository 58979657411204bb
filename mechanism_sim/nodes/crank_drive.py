"""The drive of the crank, which publishes its law of motion and paces the run."""

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
    """Node that announces the law of the crank ahead of the slowest partner, by credit.

    A law avoids the delay of a tick that samples have; credit instead of a common clock, so
    that a slow node delays the run without loss.

    It is a simulator of the standard `simulation_interfaces`, see `SimulationControl`, and takes
    commands, see `DriveCommands`. Parameters of the node, besides those of every node: ``lead``
    [s], by which the law is announced ahead of the slowest partner; ``realtime_factor``, simulated
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
        self._goal = 0.0  # [s] to which a paused simulation may advance
        self._waiting: list[tuple[float, Future]] = []
        self._ending: Future | None = None  # set when partners have finished before another run
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
        """The law at the time `announced`."""
        return self._laws[self._law]

    def _take_laws(self) -> None:
        """Begin with the laws of the scene."""
        self._laws, self._law = list(self.machine.drive.laws), 0
        self._source = self.machine.drive.source

    def take_over(self, laws: Sequence[Any]) -> None:
        """Replace the law by others, the first from `announced` on."""
        self._source = None
        self._laws[self._law + 1 :] = laws
        self.extend()

    # --- time ---------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time [s] reached by all partners."""
        return min(self.partners.time, self.spawning.time, self.announced)

    @property
    def due(self) -> bool:
        """True if all partners have reached `announced`, so that time must advance."""
        at, wanted = self.announced, self.playing or self.announced < self._goal
        return self.ready and not self.final and wanted and self.time >= at < self._leader.time

    def play(self) -> None:
        """Advance time continuously."""
        self.playing = True
        self._pace.restart(self.announced)
        self.extend()

    def pause(self) -> None:
        """Stop at `announced`; pending `arrive` calls then wait for that time."""
        self.playing = False
        self._goal = self.announced
        self._waiting = [(min(goal, self._goal), future) for goal, future in self._waiting]

    async def arrive(self, goal: float) -> bool:
        """Advance a paused simulation to `goal` [s], and wait for all partners.

        False if it was paused before.
        """
        goal = min(goal, self.duration)
        self._goal = max(self._goal, goal)
        self.extend()
        await self._all_at(goal)
        return self.announced >= goal

    async def _all_at(self, goal: float) -> None:
        """Wait until all partners have reached a time of this run."""
        there: Future = Future()
        self._waiting.append((goal, there))
        self._look_who_waits()
        await there

    async def start_over(self) -> str:
        """Begin a new run at time 0, after this one has been completed up to `announced`.

        Returns the reason of a refusal, if a partner rejects the requested values of the scene.
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
        """End the run at `announced`."""
        self._quitting = True
        self.extend()

    def on_ready(self) -> None:
        """Start the clock and give the first credit."""
        if self.value('publish_clock'):
            self._look_for_clocks()
        self._pace.restart(0.0)
        self._commands.begin()
        self.create_timer(0.01, self._tick)
        if self._leader.name:
            self.report(0.0)  # announces itself to the leader
        self._tick()

    def on_progress(self, message: Any) -> None:
        """Extend the law if a partner has progressed."""
        self.extend()
        self._commands.look()
        self._look_who_waits()

    async def on_leader(self) -> None:
        """Advance as far as the drive that this one follows, or restart with it."""
        leader = self._leader
        if self.ready and not leader.followed and leader.run > self.run:
            leader.followed = True
            await self.start_over()
            leader.followed = False
        self.extend()

    def on_spawned(self) -> None:
        """Extend the law after progress or end of a machine that follows this one."""
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
        self._publish_clock()  # up to the end, for which the recorder waits
        if not final:
            return
        # Requests that wait for the end of the run are answered first, between two ticks.
        self.done = self._over and not self.control.busy and not self.spawning.machines
        self._over = self.partners.finished

    def _look_for_clocks(self) -> None:
        """Warn of other nodes that publish the time: who hears /clock takes each as its own."""
        publishers = self.get_publishers_info_by_topic('/clock')
        names = {f'{x.node_namespace.rstrip("/")}/{x.node_name}' for x in publishers}
        if others := names - {self.get_fully_qualified_name()}:
            self.get_logger().warning(
                f'{", ".join(sorted(others))} publishes /clock, too: nodes with use_sim_time hear '
                'several times in turn; leave publish_clock to one'
            )

    def _publish_clock(self) -> None:
        if self.value('publish_clock'):
            self._clock_publisher.publish(Clock(clock=stamp(self.time)))

    @property
    def _given(self) -> float:
        """Time [s] up to which commands and a followed drive allow to advance."""
        return min(self._commands.horizon, self._leader.time)

    def extend(self) -> None:
        """Announce the law as far as the slowest partner, the pace and commands allow."""
        if self.final or not self.ready:
            return
        if self._leader.finished and self.announced >= self._leader.time:
            self._quitting = True
        end = self.duration
        # time up to which the law may be announced now [s]
        lead, factor = self.value('lead'), self.value('realtime_factor')
        if factor > 0.0:
            # with a pace, partners must not fall far behind, or they would catch up too fast
            lead = min(lead, AHEAD * factor)
        slowest = min(self.partners.time, self.spawning.time)
        horizon = min(slowest + lead, self.duration, self._given)
        if not self.playing:
            horizon = min(horizon, self._goal)
        elif factor > 0.0:
            horizon = min(horizon, self._pace.due(factor, self.announced) + lead)
        stays = self.value('hold') or self._leader.name  # a follower ends with its leader
        final = self._quitting or (horizon >= end and not stays)
        # smaller extensions are not worth a message
        worthwhile = self.announced + 0.25 * lead
        if self._quitting:
            horizon = self.announced
        elif horizon <= self.announced or (
            self.playing and horizon < min(end, self._given, worthwhile)
        ):
            return
        self.final = final
        while True:
            # known laws after the present one; at least one if there is any
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
        """Announce that the present law holds until a time [s]; `final`: the run ends then."""
        number = self._law + 1
        message = drive_law(self.law, number, until, final, self.announced, self.run, again)
        self.send(self._drive, message)

    # --- record of deliveries -------------------------------------------------------------------

    def diagnose(self) -> Diagnosis:
        """Diagnosis: rate of simulated time, and the requested real-time factor."""
        found, asked = super().diagnose(), self.value('realtime_factor')
        if self.ready and not self.done:
            achieved = self._pace.measure_factor(self.time)
            found.message = 'playing' if self.playing else 'paused'
            found.values |= {
                'announced [s]': self.announced,
                'real-time factor': 'not measured yet' if achieved is None else achieved,
                'real-time factor asked for': asked,
            }
            if self.playing and asked > 0.0 and achieved is not None and achieved < BEHIND * asked:
                found.level = DiagnosticStatus.WARN
                found.message = f'{achieved:.3g} times real time instead of {asked:g}'
                self.get_logger().warning(found.message, throttle_duration_sec=60.0)
        return found


class ContentPropagation:
    """Propagation of the drive's scene to its partners, before a run with another scene."""

    def __init__(self, drive: SimulationNode) -> None:
        self._drive, self._run_with = drive, Content.of(drive)
        self._kind = service_class('rcl_interfaces/srv/SetParametersAtomically')
        group = ReentrantCallbackGroup()  # a reset is requested in a callback that waits
        self._clients: dict[str, Client] = {
            name: drive.create_client(
                self._kind, f'{name}/set_parameters_atomically', callback_group=group
            )
            for name in drive.partners.names
        }
        drive.add_post_set_parameters_callback(self._announce)

    async def propagate(self) -> str:
        """Set the values of the next run in all partners; returns the reason of a refusal, or ''.

        After a refusal all are reset to those of the present run.
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
