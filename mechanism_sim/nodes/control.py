"""Control of a simulation, its links and worlds by the standard `simulation_interfaces`.

A reset is an end and a start, each acknowledged by every node, because topics are not ordered
relative to each other. A step of the clock cuts no step of the solver.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from mechanism_sim.catalogue import scene_names
from mechanism_sim.errors import InputError
from mechanism_sim.export.ideal import WORLD
from mechanism_sim.messages import MessageError, action_class, message_class, stamp
from mechanism_sim.nodes.drive import Drive
from mechanism_sim.nodes.middleware import (
    ActionServer,
    CancelResponse,
    ReentrantCallbackGroup,
)
from mechanism_sim.nodes.scene_values import SCENE, Content, next_machine
from mechanism_sim.nodes.services import SIMULATION, SLOPPY, answered, serve, uri_of
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.nodes.spawning import Spawned
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.scene.start_pose import Planar, check_start, start_values

# LoadWorld.Response
UNSUPPORTED_FORMAT, NO_RESOURCE, RESOURCE_PARSE_ERROR, UNSUPPORTED_ELEMENTS = 101, 102, 103, 106
INVALID_POSE = 101  # SetEntityState.Response
# SetSimulationState.Response; constants of a service are not in the classes made from definitions
ALREADY_IN_TARGET_STATE, STATE_TRANSITION_ERROR = 101, 102
STEPS, _HALT = 'steps', 'a pause'
ROUNDING = 1e-12
"""Relative rounding of times, of steps that end with the run, and of poses."""


class Observable(Protocol):
    """Interface of a machine's integration for its entities."""

    @property
    def begun(self) -> bool:
        """True if any motion of the run is known."""

    def observe_latest(self) -> tuple[float, Observation]:
        """The last time [s] of the known motion, and the observation of the machine then."""


class Links:
    """The links of a machine as dynamic objects, by names and filters of requests."""

    def __init__(self, node: SimulationNode) -> None:
        self._node = node
        self._result = message_class(f'{SIMULATION}/msg/Result')
        self._category = message_class(f'{SIMULATION}/msg/EntityCategory')
        self._bounds = message_class(f'{SIMULATION}/msg/Bounds')

    @property
    def names(self) -> list[str]:
        """Names of the links."""
        return [body.name for body in self._node.machine.mechanism.bodies]

    def matching(self, filters: Any, more: Sequence[str] = ()) -> list[str]:
        """Names of the links accepted by filters, then those of `more`, which are robots."""
        wanted = {category.category for category in filters.categories}
        c = self._category
        kinds = (c.CATEGORY_DYNAMIC_OBJECT, self.names), (c.CATEGORY_ROBOT, more)
        return [
            name
            for kind, names in kinds
            for name in names
            if (not wanted or kind in wanted) and re.search(filters.filter, name)
        ]

    def accepted(self, filters: Any, response: Any) -> bool:
        """True if a filter can be applied; else the response has the reason."""
        r = self._result
        if filters.tags.tags or filters.bounds.type != self._bounds.TYPE_EMPTY:
            reason = 'links have no tags and no bounds: filter by name and category'
            return _is_good(response, reason, r.RESULT_FEATURE_UNSUPPORTED)
        try:
            re.compile(filters.filter)
        except re.error as error:
            reason = f'filter {filters.filter!r} is not a regular expression: {error}'
            return _is_good(response, reason)
        return _is_good(response)

    def known(self, link: str, response: Any) -> bool:
        """True if a link exists; else the response lists the links."""
        if link in self.names:
            return _is_good(response)
        reason = f'there is no link {link!r}; known are {", ".join(self.names)}'
        return _is_good(response, reason, self._result.RESULT_NOT_FOUND)


class EntityNames:
    """Services for names and kinds of links and of spawned machines."""

    def __init__(self, drive: Drive, machines: Mapping[str, Spawned]) -> None:
        self._drive, self._machines, self._links = drive, machines, Links(drive)
        self._category = message_class(f'{SIMULATION}/msg/EntityCategory')
        answers = {'get_entities': self._list, 'get_entity_info': self._describe}
        serve(drive, SIMULATION, answers)

    def _list(self, request: Any, response: Any) -> Any:
        if self._links.accepted(request.filters, response):
            response.entities = self._links.matching(request.filters, [*self._machines])
        return response

    def _describe(self, request: Any, response: Any) -> Any:
        info = response.info
        if spawned := self._machines.get(request.entity):
            info.category.category = self._category.CATEGORY_ROBOT
            info.description = f'machine {spawned.uri}, its nodes in {spawned.namespace}'
            answered(response)
        elif self._links.known(request.entity, response):
            info.category.category = self._category.CATEGORY_DYNAMIC_OBJECT
            info.description = f'link of {self._drive.machine.name}'
        return response


class Entities:
    """Services for states of links, at the end of the known motion.

    Without the package `simulation_interfaces` there are no services, see `SimulationControl`.
    """

    def __init__(self, node: SimulationNode, integration: Observable) -> None:
        self._node, self._integration = node, integration
        try:
            self._links = Links(node)
        except MessageError:
            return  # logged by the drive
        self._state_class = message_class(f'{SIMULATION}/msg/EntityState')
        answers = {'get_entities_states': self._list_states, 'get_entity_state': self._report}
        serve(node, SIMULATION, answers)

    def _list_states(self, request: Any, response: Any) -> Any:
        if self._links.accepted(request.filters, response) and self._begun(response):
            response.entities = self._links.matching(request.filters)
            response.states = [self._state(link) for link in response.entities]
        return response

    def _report(self, request: Any, response: Any) -> Any:
        if self._links.known(request.entity, response) and self._begun(response):
            response.state = self._state(request.entity)
        return response

    def _state(self, link: str) -> Any:
        """Pose, velocity and acceleration of a link's frame in that of the world."""
        mechanism, state = self._node.machine.mechanism, self._state_class()
        t, seen = self._integration.observe_latest()
        q, v, a = seen.local, seen.velocity, seen.acceleration
        state.header.stamp, state.header.frame_id = stamp(t), self._node.frame(WORLD)
        index, (frame, _) = mechanism.coordinates.index, mechanism.frame(link)
        pose, half = state.pose, 0.5 * float(mechanism.angle_all(link, q)[0])
        place, velocity, acceleration = mechanism.trace((link, (0.0, 0.0)), q, v, a)
        pose.position.x, pose.position.y = place[:, 0].tolist()
        pose.orientation.z, pose.orientation.w = math.sin(half), math.cos(half)
        for part, linear, angular in (
            (state.twist, velocity, v),
            (state.acceleration, acceleration, a),
        ):
            part.linear.x, part.linear.y = linear[:, 0].tolist()
            turns = frame in mechanism.coordinates
            part.angular.z = float(angular[index(frame), 0]) if turns else 0.0
        return state

    def _begun(self, response: Any) -> bool:
        if self._integration.begun:
            return True
        reason = 'the run has not begun: play or step it, or try again in a moment'
        code = message_class(f'{SIMULATION}/msg/Result').RESULT_INCORRECT_STATE
        return _is_good(response, reason, code)


def _is_good(response: Any, reason: str = '', code: int | None = None) -> bool:
    """Write the result; True for success."""
    answered(response, reason, code)
    return not reason


class Worlds:
    """Services for scenes, and for changing that of the run.

    A scene can be loaded if the nodes of the run support it, and a link can be moved at
    the start. The change holds from time 0 of a new run, which begins stopped.
    """

    def __init__(self, drive: Drive, control: SimulationControl) -> None:
        self._drive, self._control = drive, control
        self._result = message_class(f'{SIMULATION}/msg/Result')
        self._world = message_class(f'{SIMULATION}/msg/WorldResource')
        answers = {
            'get_available_worlds': self._list,
            'get_current_world': self._report,
            'load_world': self._load,
            'set_entity_state': self._place,
        }
        serve(drive, SIMULATION, answers, callback_group=ReentrantCallbackGroup())

    def _list(self, request: Any, response: Any) -> Any:
        if request.filter.tags:
            reason = 'scenes have no tags: leave the filter empty'
            return answered(response, reason, self._result.RESULT_FEATURE_UNSUPPORTED)
        response.worlds = [self._describe(name) for name in scene_names()]
        return answered(response)

    def _report(self, _request: Any, response: Any) -> Any:
        response.world = self._describe(self._drive.value(SCENE), self._drive.machine.name)
        return answered(response)

    async def _load(self, request: Any, response: Any) -> Any:
        drive, control = self._drive, self._control
        resource = getattr(request, 'world_resource', request)  # before release 2: in the request
        uri, reason, code = uri_of(resource, UNSUPPORTED_FORMAT, NO_RESOURCE)
        if reason:
            return answered(response, reason, code)
        if reason := await control.refusal():
            return answered(response, reason)
        asked = Content(uri, '')
        try:
            asked.load()
        except InputError as error:
            return answered(response, str(error), RESOURCE_PARSE_ERROR)
        try:
            next_machine(drive.machine, asked)
        except InputError as error:
            return answered(response, str(error), UNSUPPORTED_ELEMENTS)
        if not (reason := await self._begin(asked, spawned=True)):
            response.world = self._describe(uri, drive.machine.name)
        return answered(response, reason)

    async def _place(self, request: Any, response: Any) -> Any:
        """Start the next run with a link in a pose, and with a velocity."""
        drive, control, link = self._drive, self._control, request.entity
        if not Links(drive).known(link, response):
            return response
        if getattr(request, 'set_acceleration', False):
            reason = 'accelerations follow from forces: set pose and twist only'
            return answered(response, reason, self._result.RESULT_FEATURE_UNSUPPORTED)
        if reason := await control.refusal():
            return answered(response, reason)
        if drive.playing or drive.announced > 0.0:
            reason = 'links are set at the start of a run only: stop first (state 0)'
            return answered(response, reason, self._result.RESULT_INCORRECT_STATE)
        state = request.state
        if (frame := state.header.frame_id) not in ('', drive.frame(WORLD)):
            reason = f'frame {frame!r}: states are taken in {drive.frame(WORLD)!r}'
            return answered(response, reason, INVALID_POSE)
        pose = velocity = None
        try:
            if getattr(request, 'set_pose', True):  # before release 2 all is set
                pose = _planar_pose(state.pose)
            if getattr(request, 'set_twist', True):
                velocity = _planar_velocity(state.twist)
            before = Content.of(drive)
            values = start_values(drive.machine, link, pose, velocity)
            lines = [line for line in before.lines if line.partition('=')[0] not in values]
            lines += [f'{path}={value}' for path, value in values.items()]
            asked = Content(before.scene, '\n'.join(lines))
            check_start(next_machine(drive.machine, asked), link, pose, velocity)
        except InputError as error:
            return answered(response, str(error), INVALID_POSE)
        return answered(response, await self._begin(asked) if asked != before else '')

    async def _begin(self, content: Content, spawned: bool = False) -> str:
        """Begin a stopped run of other content; returns the reason of a refusal, or ''.

        Parameters
        ----------
        spawned : delete spawned machines
        """
        drive, control, before = self._drive, self._control, Content.of(self._drive)
        self._set(content)
        drive.pause()
        reason = await control.alone('another scene', control.begin_anew(spawned))
        if reason:
            self._set(before)
        else:
            control.stopped = True
        return str(reason)

    def _set(self, content: Content) -> None:
        self._drive.set_parameters_atomically(content.parameters())

    def _describe(self, uri: str, name: str = '') -> Any:
        world = self._world(name=name or uri)
        world.world_resource.uri = uri
        return world


def _planar_pose(pose: Any) -> Planar:
    place, turn = pose.position, pose.orientation
    norm = math.hypot(turn.x, turn.y, turn.z, turn.w)
    if place.z or max(abs(turn.x), abs(turn.y)) > ROUNDING or abs(norm - 1.0) > SLOPPY:
        raise InputError('links move in the plane z = 0, and turn about z: a unit quaternion')
    return Planar((place.x, place.y), 2.0 * math.atan2(turn.z, turn.w))


def _planar_velocity(twist: Any) -> Planar:
    linear, angular = twist.linear, twist.angular
    if linear.z or angular.x or angular.y:
        raise InputError('links move in the plane z = 0, and turn about z')
    return Planar((linear.x, linear.y), angular.z)


class SimulationControl:
    """Services for features, state, steps and reset of a run, for the node that drives it.

    Without the package `simulation_interfaces` of ROS these services are missing, with a log
    entry.
    """

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        self.busy = ''  #: name of the present operation, such as steps or a reset; else empty
        self.stopped = False  #: True if a request has paused the run at time 0
        if drive.value('leader'):
            return  # a spawned machine follows the simulation
        try:
            self._features = message_class(f'{SIMULATION}/msg/SimulatorFeatures')
        except MessageError as error:
            drive.get_logger().warning(f'no services to control the simulation: {error}')
            return
        self._result = message_class(f'{SIMULATION}/msg/Result')
        self._state = message_class(f'{SIMULATION}/msg/SimulationState')
        self._origin, self._steps = 0.0, 0
        # Reports of partners must be received while a callback waits for them.
        group = ReentrantCallbackGroup()
        answers = {
            'get_simulator_features': self._report_features,
            'get_simulation_state': self._report_state,
            'set_simulation_state': self._set_state,
            'step_simulation': self._step,
            'reset_simulation': self._reset,
        }
        serve(drive, SIMULATION, answers, callback_group=group)
        self._action = ActionServer(
            drive,
            action_class(f'{SIMULATION}/action/SimulateSteps'),
            'simulate_steps',
            self._simulate_steps,
            callback_group=group,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )
        self._more = Worlds(drive, self), EntityNames(drive, drive.spawning.machines)

    # --- services -----------------------------------------------------------------------------

    def _report_features(self, _request: Any, response: Any) -> Any:
        f = self._features
        response.features.features = [
            f.SPAWNING, f.DELETING, f.SPAWNABLES, f.SPAWNING_ENTITIES, f.SIMULATION_RESET,
            f.SIMULATION_RESET_TIME, f.SIMULATION_RESET_STATE, f.SIMULATION_RESET_SPAWNED,
            f.SIMULATION_STATE_GETTING, f.SIMULATION_STATE_SETTING, f.SIMULATION_STATE_PAUSE,
            f.ENTITY_CATEGORIES, f.ENTITY_STATE_GETTING, f.ENTITY_STATE_SETTING,
            f.ENTITY_INFO_GETTING,
            f.WORLD_LOADING, f.WORLD_INFO_GETTING, f.AVAILABLE_WORLDS,
            f.STEP_SIMULATION_SINGLE, f.STEP_SIMULATION_MULTIPLE, f.STEP_SIMULATION_ACTION,
        ]  # fmt: skip
        response.features.custom_info = (
            f'mechanism_sim; a step is the parameter step_size of '
            f'{self._drive.get_fully_qualified_name()}; a reset resets time and state, and '
            'its parameter overrides gives the values of the scene'
        )
        return response

    def _report_state(self, _request: Any, response: Any) -> Any:
        s = self._state
        if self._drive.playing:
            response.state.state = s.STATE_PLAYING
        else:
            response.state.state = s.STATE_STOPPED if self.stopped else s.STATE_PAUSED
        return answered(response)

    async def _set_state(self, request: Any, response: Any) -> Any:
        """Play, pause, stop (pause and reset) or quit; the response waits for all partners."""
        s, drive, asked = self._state, self._drive, request.state.state
        if asked == s.STATE_QUITTING and drive.final:
            return answered(response)
        ending = asked in (s.STATE_PAUSED, s.STATE_QUITTING)
        if reason := await self.refusal(during_steps=ending):
            return answered(response, reason)
        if self.busy:  # steps of an action are announced one by one: stop them
            self.busy = _HALT
        if asked == s.STATE_PLAYING:
            if drive.playing:
                return self._already(response, 'playing')
            if drive.announced >= drive.duration:
                reason = f'the run is at its end, at {drive.duration:.9g} s: reset it first'
                return answered(response, reason, STATE_TRANSITION_ERROR)
            self.stopped = False
            drive.play()
        elif asked == s.STATE_PAUSED:
            if not drive.playing and not self.stopped and not self.busy:
                return self._already(response, 'paused')
            self.stopped = False
            drive.pause()
            if drive.announced:  # else no run is announced, and partners are at its start
                await drive.arrive(drive.announced)
        elif asked == s.STATE_STOPPED:
            if self.stopped:
                return self._already(response, 'stopped')
            drive.pause()
            if reason := await self.alone('a reset', drive.start_over()):
                return answered(response, reason)
            self.stopped = True
        elif asked == s.STATE_QUITTING:
            drive.pause()
            drive.quit()
        else:
            reason = (
                f'state {asked} cannot be set; known are stopped ({s.STATE_STOPPED}), playing '
                f'({s.STATE_PLAYING}), paused ({s.STATE_PAUSED}), quitting ({s.STATE_QUITTING})'
            )
            return answered(response, reason, self._result.RESULT_FEATURE_UNSUPPORTED)
        return answered(response)

    async def _step(self, request: Any, response: Any) -> Any:
        """Steps of a paused simulation; the response follows their completion."""
        steps = int(request.steps)
        if reason := await self.refusal() or self._no_steps(steps):
            return answered(response, reason)
        return answered(response, await self.alone(STEPS, self._go(steps)))

    async def _reset(self, request: Any, response: Any) -> Any:
        """Reset to time 0, in a new run; the recorded run remains in its bag."""
        scope, both, spawned = int(request.scope) or 255, 3, 4  # SCOPE_TIME and SCOPE_STATE
        if scope & both not in (0, both) or not scope & (both | spawned):
            reason = (
                f'scope {scope}: time and state are reset together only; use 0, {both}, {spawned} '
                'or 255'
            )
            return answered(response, reason, self._result.RESULT_FEATURE_UNSUPPORTED)
        if reason := await self.refusal():
            return answered(response, reason)
        work = self.begin_anew(bool(scope & spawned), bool(scope & both))
        return answered(response, await self.alone('a reset', work))

    async def _simulate_steps(self, goal: Any) -> Any:
        """Steps one by one, with feedback after each."""
        steps = int(goal.request.steps)
        result = action_class(f'{SIMULATION}/action/SimulateSteps').Result()
        if not (reason := await self.refusal() or self._no_steps(steps)):
            reason = await self.alone(STEPS, self._go_singly(goal, steps))
        if not reason:
            goal.succeed()
        elif goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        return answered(result, reason)

    async def _go_singly(self, goal: Any, steps: int) -> str:
        """Carry out the steps of a goal one by one; returns the reason of a failure, or ''."""
        kind = action_class(f'{SIMULATION}/action/SimulateSteps')
        for done in range(1, steps + 1):
            if goal.is_cancel_requested:
                return f'cancelled after {done - 1} steps'
            if reason := await self._go(1):
                return reason
            feedback = kind.Feedback(completed_steps=done, remaining_steps=steps - done)
            goal.publish_feedback(feedback)
        return ''

    # --- common parts -------------------------------------------------------------------------

    async def _go(self, steps: int) -> str:
        """Carry out a number of steps on a grid that begins where the simulation was paused.

        Returns the reason of a failure, or ''. Its times are products, not sums: a
        hundred steps of 1 ms end at 0.1 s.
        """
        drive, size = self._drive, self._drive.value('step_size')
        if self.busy == _HALT:
            return f'paused meanwhile, at {drive.announced:.9g} s'
        if drive.announced != self._origin + self._steps * size:
            self._origin, self._steps = drive.announced, 0
        self._steps += steps
        self.stopped = False
        if await drive.arrive(self._origin + self._steps * size):
            return ''
        return f'paused meanwhile, at {drive.announced:.9g} s'

    async def begin_anew(self, spawned: bool, both: bool = True) -> str:
        """Delete spawned machines, and begin a new run; returns the reason of a refusal, or ''."""
        if spawned:
            await self._drive.spawning.clear()
        return await self._drive.start_over() if both else ''

    async def alone(self, what: str, work: Any) -> Any:
        """Await uninterruptible work; `what` is its name for the refusal of other requests."""
        self.busy = what
        try:
            return await work
        finally:
            self.busy = ''

    async def refusal(self, during_steps: bool = False) -> str:
        """Reason to refuse requests, once all nodes are present; else empty."""
        await self._drive.until_ready()
        if self._drive.final:
            return (
                f'the run ends by itself at {self._drive.announced:.9g} s, up to which the law '
                'of its drive is announced; start it with hold to operate it after its end'
            )
        if self.busy and not (during_steps and self.busy in (STEPS, _HALT)):
            return f'{self.busy} under way: wait for the end'
        return ''

    def _no_steps(self, steps: int) -> str:
        drive = self._drive
        if drive.playing:
            return 'the simulation is playing: pause it first (set_simulation_state)'
        end = drive.announced + steps * drive.value('step_size')
        if end > drive.duration * (1.0 + ROUNDING):
            return f'{steps} steps end at {end:.9g} s, the run at {drive.duration:.9g} s already'
        return ''

    def _already(self, response: Any, state: str) -> Any:
        return answered(response, f'it is {state} already', ALREADY_IN_TARGET_STATE)
