"""Machines added to a running simulation, which follow the time of its drive.

Each is a run of its own in a process of its own, below a namespace. It begins at time 0 and
catches up before the response: all machines of a simulation have one time, whenever they
were added, and move as they would alone.
"""

from __future__ import annotations

import math
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from typing import Any

from mechanism_sim import process_exit
from mechanism_sim.catalogue import scene_names
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.export.ideal import WORLD
from mechanism_sim.messages import (
    MessageError,
    Progress,
    TFMessage,
    TransformStamped,
    message_class,
)
from mechanism_sim.messages.part_states import integrator_of
from mechanism_sim.nodes.drive import Drive
from mechanism_sim.nodes.middleware import Future, ReentrantCallbackGroup
from mechanism_sim.nodes.partners import GONE_AFTER
from mechanism_sim.nodes.qos import LATCHED, RESULTS
from mechanism_sim.nodes.scene_values import Content
from mechanism_sim.nodes.services import SIMULATION, SLOPPY, answered, serve, uri_of

NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')
# SpawnEntity.Response and SpawnEntities.Response
NAME_NOT_UNIQUE, NAME_INVALID, UNSUPPORTED_FORMAT, NO_RESOURCE, NAMESPACE_INVALID = range(101, 106)
RESOURCE_PARSE_ERROR, INVALID_POSE, ENTITIES_SPAWN_FAILED = 106, 109, 150


class LeadingDrive:
    """The drive that a spawned machine follows, as seen by its own drive."""

    def __init__(self, node: Drive) -> None:
        about = (
            'Drive whose time this one follows, as /crank_drive; set where machines are spawned'
        )
        self.name = node.declare('leader', '', about, read_only=True)
        about = (
            'Number of its run when this machine was spawned; negative: the first that is heard'
        )
        self._first = node.declare('leader_run', -1, about, read_only=True)
        #: time up to which its law is announced [s]; infinite without a leader
        self.time = 0.0 if self.name else math.inf
        self.finished = False  #: True if it ends at `time`
        self.run = 0  #: number of its run, counted from the start of this machine
        self.followed = False  #: True while this machine restarts with it
        self._node = node
        if self.name:
            space, _, self._short = self.name.rpartition('/')
            self._topic = f'{space}/progress'
            self._missing_since: float | None = None
            # Reports of partners must be received while a callback waits for them.
            group = ReentrantCallbackGroup()
            node.create_subscription(
                Progress, self._topic, self._take, RESULTS, callback_group=group
            )
            node.create_timer(0.5, self._look)

    async def _take(self, message: Any) -> None:
        if message.node != self._short:
            return
        self._first = message.run if self._first < 0 else self._first
        self.run, self.time = message.run - self._first, message.time
        self.finished = message.finished and not message.again
        await self._node.on_leader()

    def _look(self) -> None:
        names = [p.node_name for p in self._node.get_publishers_info_by_topic(self._topic)]
        now = time.monotonic()
        if self._short in names or self.finished:
            self._missing_since = None
        elif self._missing_since is None:
            self._missing_since = now
        elif now - self._missing_since > GONE_AFTER:
            raise RunError(f"{self._node.get_name()}: '{self.name}', which it follows, is gone")


@dataclass
class Spawned:
    """A spawned machine."""

    uri: str  #: scene of the machine
    namespace: str  #: namespace of its nodes
    integrator: str
    process: subprocess.Popen[bytes]
    transform: Any
    heard: Any
    run: int = 0  #: number of the requested run
    heard_run: int = -1  #: number of its present run; -1 before its first report
    time: float = 0.0  #: time reached [s]

    @property
    def began(self) -> bool:
        """True if it is in the requested run."""
        return self.heard_run >= self.run

    def take(self, message: Any) -> None:
        """Record the progress of one of its nodes."""
        if message.node == self.integrator:
            self.heard_run, self.time = message.run, float(message.time)
        self.heard_run = max(self.heard_run, 0)


class Spawning:
    """Services of `simulation_interfaces` that spawn and delete machines."""

    def __init__(self, drive: Drive) -> None:
        self._drive, self.machines = drive, dict[str, Spawned]()
        self._waiting: list[tuple[str, float, Future]] = []
        if drive.value('leader'):
            return
        try:
            self._result = message_class(f'{SIMULATION}/msg/Result')
        except MessageError:
            return  # logged by `SimulationControl`
        answers = {
            'get_spawnables': self._list,
            'spawn_entity': self._spawn,
            'spawn_entities': self._spawn_all,
            'delete_entity': self._delete,
        }
        serve(drive, SIMULATION, answers, callback_group=ReentrantCallbackGroup())
        self._places = drive.create_publisher(TFMessage, '/tf_static', LATCHED)
        drive.create_timer(0.1, self._look)

    # --- interface of the drive -------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time [s] reached by all; infinite if there are none."""
        known = (machine.time if machine.began else 0.0 for machine in self.machines.values())
        return min(known, default=math.inf)

    @property
    def began(self) -> bool:
        """True if all are in the requested run."""
        return all(machine.began for machine in self.machines.values())

    def begin_run(self) -> None:
        """Expect another run of all."""
        for machine in self.machines.values():
            machine.run += 1

    async def clear(self) -> None:
        """Delete all."""
        for name in list(self.machines):
            await self._remove(name)

    # --- services ----------------------------------------------------------------------------

    def _list(self, _request: Any, response: Any) -> Any:
        kind = message_class(f'{SIMULATION}/msg/Spawnable')
        for name in scene_names():
            found = kind()
            getattr(found, 'entity_resource', found).uri = name  # before release 2: its own
            response.spawnables.append(found)
        return answered(response)

    async def _spawn(self, request: Any, response: Any) -> Any:
        code, reason, name = await self._add(request)
        response.entity_name = name
        return answered(response, reason, code)

    async def _spawn_all(self, request: Any, response: Any) -> Any:
        kind = message_class(f'{SIMULATION}/msg/SpawnResult')
        for asked in request.spawn_requests:
            response.results.append(await self._spawn(asked, kind()))
        failed = [r.result.error_message for r in response.results if r.result.error_message]
        code = ENTITIES_SPAWN_FAILED if failed else None
        return answered(response, '; '.join(failed), code)

    async def _delete(self, request: Any, response: Any) -> Any:
        if request.entity not in self.machines:
            known = ', '.join(self.machines) or 'none'
            reason = f'there is no spawned machine {request.entity!r}; there are {known}'
            return answered(response, reason, self._result.RESULT_NOT_FOUND)
        await self._remove(request.entity)
        return answered(response)

    # --- machines ----------------------------------------------------------------------------

    async def _add(self, request: Any) -> tuple[int | None, str, str]:
        """Add a machine: code and reason of a refusal, and its name."""
        drive = self._drive
        resource = getattr(request, 'entity_resource', request)
        uri, reason, code = uri_of(resource, UNSUPPORTED_FORMAT, NO_RESOURCE)
        if reason:
            return code, reason, ''
        await drive.until_ready()
        if drive.final:
            reason = f'the run ends by itself at {drive.announced:.9g} s: start it with hold'
            return self._result.RESULT_INCORRECT_STATE, reason, ''
        try:
            machine = Content(uri, '').load()
        except InputError as error:
            return RESOURCE_PARSE_ERROR, str(error), ''
        taken = {*self.machines, *(body.name for body in drive.machine.mechanism.bodies)}
        first = name = request.name or machine.name
        number = 1
        while name in taken:
            if request.name and not request.allow_renaming:
                return NAME_NOT_UNIQUE, f'there is {name!r} already', ''
            number += 1
            name = f'{first}_{number}'
        below = request.entity_namespace.strip('/') or name
        if not NAME.fullmatch(name):
            return NAME_INVALID, f'{name!r} is no name: letters, digits and _ only', ''
        used = {machine.namespace for machine in self.machines.values()}
        space = f'{drive.get_namespace().rstrip("/")}/{below}'
        if not all(map(NAME.fullmatch, below.split('/'))) or space in used:
            return NAMESPACE_INVALID, f'{below!r} is no namespace, or has a machine already', ''
        transform, reason = self._placed(request.initial_pose, below)
        if reason:
            return INVALID_POSE, reason, ''
        self._start(name, uri, space, integrator_of(machine), transform)
        there: Future = Future()
        self._waiting.append((name, drive.announced, there))
        if not await there:
            return self._result.RESULT_OPERATION_FAILED, f'{name!r} has ended: see its log', ''
        return None, '', name

    def _placed(self, pose: Any, below: str) -> tuple[Any, str]:
        """Transform of the world of a machine, or the reason of a refusal."""
        drive, found = self._drive, TransformStamped()
        world = drive.frame(WORLD)
        found.header.frame_id = pose.header.frame_id or world
        found.child_frame_id = drive.frame(f'{below}/{WORLD}')
        at, turn = found.transform.translation, pose.pose.orientation
        at.x, at.y, at.z = pose.pose.position.x, pose.pose.position.y, pose.pose.position.z
        found.transform.rotation = turn
        good = abs(math.hypot(turn.x, turn.y, turn.z, turn.w) - 1.0) <= SLOPPY
        return found, '' if good else 'the orientation is no unit quaternion'

    def _start(self, name: str, uri: str, space: str, integrator: str, transform: Any) -> None:
        drive = self._drive
        command = [
            sys.executable, '-m', 'mechanism_sim', 'run', uri, '--namespace', space,
            '--duration', repr(drive.duration),
            '--ros-args', '-p', f'leader:={drive.get_fully_qualified_name()}',
            # The leader may begin another run before this machine hears it.
            '-p', f'leader_run:={drive.run}',
        ]  # fmt: skip
        process = process_exit.start(command, stdout=subprocess.DEVNULL)

        def take(message: Any) -> None:
            if name in self.machines:
                self.machines[name].take(message)
                drive.on_spawned()

        heard = drive.create_subscription(Progress, f'{space}/progress', take, RESULTS)
        self.machines[name] = Spawned(uri, space, integrator, process, transform, heard)
        self._publish_places()

    async def _remove(self, name: str) -> None:
        """End a machine, and wait until it has ended."""
        machine = self.machines[name]
        machine.process.send_signal(signal.SIGTERM)
        gone: Future = Future()
        self._waiting.append((name, math.inf, gone))
        await gone

    def _look(self) -> None:
        """Remove machines that have ended, and notify pending requests."""
        for name, machine in list(self.machines.items()):
            if machine.process.poll() is not None:
                self._drive.destroy_subscription(machine.heard)
                del self.machines[name]
                self._publish_places()
                self._drive.on_spawned()
        if not self.began or self.time < self._drive.announced:
            # Late nodes have not received the progress of the drive.
            self._drive.report(self._drive.announced)
        left = []
        for name, goal, future in self._waiting:
            found = self.machines.get(name)
            if found is None or (found.began and found.time >= goal):
                future.set_result(found is not None)
            else:
                left.append((name, goal, future))
        self._waiting = left

    def _publish_places(self) -> None:
        placed = [machine.transform for machine in self.machines.values()]
        self._places.publish(TFMessage(transforms=placed))
