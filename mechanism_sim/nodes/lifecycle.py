"""Nodes that integrate whole machines or parts; managed ones with states of lifecycle_msgs."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.errors import InputError
from mechanism_sim.messages import message_class, service_class, stamp
from mechanism_sim.messages.part_states import KINDS, integrator_of, kinds_of
from mechanism_sim.nodes.described_node import Diagnosis
from mechanism_sim.nodes.following import MotionFollower, Schedule
from mechanism_sim.nodes.integration import Integration
from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.services import serve
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.results.run import prepare

PACKAGE = 'lifecycle_msgs'
_UNCONFIGURED, _INACTIVE, ACTIVE, _FINALIZED = 1, 2, 3, 4
STATES = {
    0: 'unknown', _UNCONFIGURED: 'unconfigured', _INACTIVE: 'inactive', ACTIVE: 'active',
    _FINALIZED: 'finalized',
}  # fmt: skip
"""Labels of the primary states by their numbers in lifecycle_msgs/State."""


class Transition(NamedTuple):
    """A requestable transition, by its number in lifecycle_msgs/Transition."""

    number: int
    label: str
    start: int
    goal: int


_TRANSITIONS = (
    Transition(1, 'configure', _UNCONFIGURED, _INACTIVE),
    Transition(2, 'cleanup', _INACTIVE, _UNCONFIGURED),
    Transition(3, 'activate', _INACTIVE, ACTIVE),
    Transition(4, 'deactivate', ACTIVE, _INACTIVE),
    Transition(5, 'shutdown', _UNCONFIGURED, _FINALIZED),
    Transition(6, 'shutdown', _INACTIVE, _FINALIZED),
    Transition(7, 'shutdown', ACTIVE, _FINALIZED),
)


class IntegratingNode(SimulationNode):
    """A node that joins its run at once or, with the parameter ``lifecycle``, on activation.

    A managed node starts unconfigured. `configure` makes the machine of the scene; the first
    `activate` joins the run; `deactivate` queues messages, which stops the time of the whole
    run; `cleanup`, before joining the run, discards the machine; `shutdown` ends the node.
    """

    def __init__(self, name: str, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__(name, parameters)
        about = 'Managed by lifecycle_msgs: wait to be configured and activated'
        self._joined = False
        if self.declare('lifecycle', False, about, read_only=True):
            self.active = False
            self._managed = Lifecycle(self)
        else:
            self._join_run()

    def make_endpoints(self) -> None:
        """Make publishers and subscriptions, the results first."""
        raise NotImplementedError

    def _join_run(self) -> None:
        self._joined = True
        self.make_endpoints()
        self.join()

    def configure(self) -> str:
        """Make the machine of the scene; returns the reason of a failure, or an empty text."""
        try:
            self.forget_machine()
            prepare(self.machine)
        except InputError as error:
            return str(error)
        return ''

    def activate(self) -> str:
        """Join the run, or continue it."""
        self.active = True
        if not self._joined:
            self._join_run()
        elif self.ready:
            self._take_early()
        return ''

    def deactivate(self) -> str:
        """Queue received messages."""
        self.active = False
        return ''

    def cleanup(self) -> str:
        """Discard the machine; returns the reason of a refusal if the run is joined."""
        return 'it has joined its run: activate it again, or shut it down' if self._joined else ''

    def finish(self) -> str:
        """End."""
        self.done = True
        return ''


class Lifecycle:
    """The services and the topic of a managed node."""

    def __init__(self, node: IntegratingNode) -> None:
        self._node, self._now = node, _UNCONFIGURED
        self._do: dict[str, Callable[[], str]] = {
            'configure': node.configure,
            'cleanup': node.cleanup,
            'activate': node.activate,
            'deactivate': node.deactivate,
            'shutdown': node.finish,
        }
        self._state, self._transition, self._description, self._event = (
            message_class(f'{PACKAGE}/msg/{name}')
            for name in ('State', 'Transition', 'TransitionDescription', 'TransitionEvent')
        )
        self._events = node.create_publisher(self._event, '~/transition_event', RESULTS)
        answers = {
            '~/change_state': self._change,
            '~/get_state': self._report,
            '~/get_available_states': self._list_states,
            '~/get_available_transitions': self._list_possible,
        }
        serve(node, PACKAGE, answers)
        kind = service_class(f'{PACKAGE}/srv/GetAvailableTransitions')
        node.create_service(kind, '~/get_transition_graph', self._list_all)

    def _change(self, request: Any, response: Any) -> Any:
        asked = request.transition
        found = [
            t
            for t in _TRANSITIONS
            if t.start == self._now and (t.label == asked.label or t.number == asked.id)
        ]
        if not found:
            possible = (
                ', '.join(t.label for t in _TRANSITIONS if t.start == self._now) or 'nothing'
            )
            reason = f'{STATES[self._now]}: possible are {possible}'
        else:
            reason = self._do[found[0].label]()
        response.success = not reason
        if reason:
            label = asked.label or asked.id
            self._node.get_logger().error(f'transition {label!r} is refused: {reason}')
            return response
        (transition,) = found
        self._events.publish(
            self._event(
                timestamp=time.time_ns(),
                transition=self._transition(id=transition.number, label=transition.label),
                start_state=self._of(transition.start),
                goal_state=self._of(transition.goal),
            )
        )
        self._now = transition.goal
        return response

    def _of(self, number: int) -> Any:
        return self._state(id=number, label=STATES[number])

    def _report(self, _request: Any, response: Any) -> Any:
        response.current_state = self._of(self._now)
        return response

    def _list_states(self, _request: Any, response: Any) -> Any:
        response.available_states = [self._of(number) for number in STATES]
        return response

    def _list_possible(self, _request: Any, response: Any) -> Any:
        return self._list(response, [t for t in _TRANSITIONS if t.start == self._now])

    def _list_all(self, _request: Any, response: Any) -> Any:
        return self._list(response, _TRANSITIONS)

    def _list(self, response: Any, transitions: Sequence[Transition]) -> Any:
        response.available_transitions = [
            self._description(
                transition=self._transition(id=t.number, label=t.label),
                start_state=self._of(t.start),
                goal_state=self._of(t.goal),
            )
            for t in transitions
        ]
        return response


class PartNode(IntegratingNode):
    """Node for the states of its parts, from its own integration or a followed motion.

    It follows ``linkage`` if that is a partner. Otherwise it is the integrator of the run and
    publishes all that ``linkage`` would.
    """

    kind: str  #: kind of the parts, and name of the node

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__(self.kind, parameters)

    def make_endpoints(self) -> None:
        """Publishers of states, and of all results of integration if this node integrates."""
        states = States(self, self.kind)
        role = MotionFollower if 'linkage' in self.partners.names else Integration
        self._role: MotionFollower | Integration = role(
            self, states.publish, reset=states.start_over
        )

    def on_ready(self) -> None:
        """Start of the work, once all partners are present."""
        self._role.begin()

    def diagnose(self) -> Diagnosis:
        """Statistics of the solver, if this node has one."""
        found = super().diagnose()
        if self.ready and isinstance(self._role, Integration):
            found.values |= self._role.diagnose()
        return found


class LinkageNode(PartNode):
    """Node that integrates the machine and publishes motion, forces and events, but no states."""

    kind = 'linkage'

    def make_endpoints(self) -> None:
        """Publishers of all results of integration."""
        self._role = Integration(self)


class CamNode(PartNode):
    """Node that publishes ``cam_state`` of every cam and its follower."""

    kind = 'cam'


class GearTrain(PartNode):
    """Node that publishes ``gear_state`` of every pair of gears."""

    kind = 'gear_train'


class GenevaNode(PartNode):
    """Node that publishes ``geneva_state`` of every Geneva wheel and slotted rack."""

    kind = 'geneva'


class States:
    """Publisher of the states of all parts of a kind."""

    def __init__(self, node: SimulationNode, name: str) -> None:
        machine = node.machine
        if name not in kinds_of(machine):
            raise InputError(
                f"{machine.name} has nothing for the node '{name}'; it needs "
                f"'{integrator_of(machine)}'"
            )
        self._kind = KINDS[name]
        self._node = node
        self._publisher = node.create_publisher(self._kind.message, self._kind.topic, RESULTS)
        self.start_over()

    def start_over(self) -> None:
        """Start of another run."""
        self._schedule = Schedule(self._node.machine.scene.outputs.part_states)

    def publish(self, motion: Motion) -> None:
        """Publish the states due in a piece of motion."""
        t = self._schedule.due(motion.curve.end)
        if not t.size:
            return
        for at, joint, fields in self._kind.states(self._node.machine, motion, t):
            message = self._kind.message(time=at, joint=joint, **fields)
            message.header.stamp = stamp(at)
            self._node.send(self._publisher, message)
