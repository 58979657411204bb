"""The links of a machine as entities of `simulation_interfaces`: their names, poses and motion."""

from __future__ import annotations

import math
import re
from typing import Any, Protocol

from mechanism_sim.export.ideal import WORLD
from mechanism_sim.messages import MessageError, message_class, service_class, stamp
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.planar.inverse_dynamics import Observation

PACKAGE = 'simulation_interfaces'


class Observable(Protocol):
    """The integration of a machine, as far as its entities look at it."""

    @property
    def begun(self) -> bool:
        """True if any motion of the run is known."""

    def observe_latest(self) -> tuple[float, Observation]:
        """The last time [s] up to which the motion is known, and the machine then."""


class Entities:
    """Serves names and states of the links, at the time up to which the motion is known.

    Every link is a dynamic object; without the package `simulation_interfaces` there are no
    services, see `Control`.
    """

    def __init__(self, node: SimulationNode, integration: Observable) -> None:
        self._node, self._integration = node, integration
        try:
            self._result = message_class(f'{PACKAGE}/msg/Result')
        except MessageError:
            return  # the drive says so
        self._category = message_class(f'{PACKAGE}/msg/EntityCategory')
        self._bounds = message_class(f'{PACKAGE}/msg/Bounds')
        self._state_class = message_class(f'{PACKAGE}/msg/EntityState')
        for short, name, answer in (
            ('GetEntities', 'get_entities', self._list),
            ('GetEntitiesStates', 'get_entities_states', self._list_states),
            ('GetEntityInfo', 'get_entity_info', self._describe),
            ('GetEntityState', 'get_entity_state', self._report),
        ):
            node.create_service(service_class(f'{PACKAGE}/srv/{short}'), name, answer)

    @property
    def _links(self) -> list[str]:
        return [body.name for body in self._node.machine.mechanism.bodies]

    def _list(self, request: Any, response: Any) -> Any:
        if self._accepted(request.filters, response):
            response.entities = self._matching(request.filters)
        return response

    def _list_states(self, request: Any, response: Any) -> Any:
        if self._accepted(request.filters, response) and self._begun(response):
            response.entities = self._matching(request.filters)
            response.states = [self._state(link) for link in response.entities]
        return response

    def _describe(self, request: Any, response: Any) -> Any:
        if self._known(request.entity, response):
            response.info.category.category = self._category.CATEGORY_DYNAMIC_OBJECT
            response.info.description = f'link of {self._node.machine.name}'
        return response

    def _report(self, request: Any, response: Any) -> Any:
        if self._known(request.entity, response) and self._begun(response):
            response.state = self._state(request.entity)
        return response

    def _matching(self, filters: Any) -> list[str]:
        wanted = {category.category for category in filters.categories}
        if wanted and self._category.CATEGORY_DYNAMIC_OBJECT not in wanted:
            return []
        return [link for link in self._links if re.search(filters.filter, link)]

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

    # --- what they have in common -------------------------------------------------------------

    def _accepted(self, filters: Any, response: Any) -> bool:
        r = self._result
        if filters.tags.tags or filters.bounds.type != self._bounds.TYPE_EMPTY:
            reason = 'links have no tags and no bounds: filter by name and category'
            return _answer(response, r.RESULT_FEATURE_UNSUPPORTED, reason)
        try:
            re.compile(filters.filter)
        except re.error as error:
            reason = f'filter {filters.filter!r} is not a regular expression: {error}'
            return _answer(response, r.RESULT_OPERATION_FAILED, reason)
        return _answer(response, r.RESULT_OK)

    def _known(self, link: str, response: Any) -> bool:
        if link in self._links:
            return _answer(response, self._result.RESULT_OK)
        reason = f'there is no link {link!r}; known are {", ".join(self._links)}'
        return _answer(response, self._result.RESULT_NOT_FOUND, reason)

    def _begun(self, response: Any) -> bool:
        if self._integration.begun:
            return True
        reason = 'the run has not begun: try again in a moment'
        return _answer(response, self._result.RESULT_INCORRECT_STATE, reason)


def _answer(response: Any, code: int, reason: str = '') -> bool:
    """Write the result; whether it is good."""
    response.result.result, response.result.error_message = code, reason
    return not reason
