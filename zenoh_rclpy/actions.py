"""Action servers, with the names and the meaning of ``rclpy.action``.

An action is three services and two topics below ``NAME/_action``: ``send_goal``, ``cancel_goal``,
``get_result``, ``feedback``, ``status``. Source: the design article "Actions" (design.ros2.org);
states and their changes as in ``rcl_action``.
"""

import time
import traceback
from collections.abc import Callable
from enum import Enum, IntEnum
from typing import Any

from ros_interfaces.classes import message_class
from zenoh_rclpy.callback_groups import CallbackGroup, ReentrantCallbackGroup
from zenoh_rclpy.clock import Time
from zenoh_rclpy.errors import MiddlewareError
from zenoh_rclpy.future import Future
from zenoh_rclpy.node import Node
from zenoh_rclpy.qos import QoSProfile, qos_profile_action_status_default
from zenoh_rclpy.tasks import await_or_execute

ANYONE = bytes(16)  # the goal id of a request to cancel that names none


class Status(IntEnum):
    """Status of a goal; the numbers are those of ``action_msgs/msg/GoalStatus``."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


_NEXT = {
    Status.ACCEPTED: (Status.EXECUTING, Status.CANCELING),
    Status.EXECUTING: (Status.CANCELING, Status.SUCCEEDED, Status.ABORTED),
    Status.CANCELING: (Status.SUCCEEDED, Status.CANCELED, Status.ABORTED),
}


class GoalResponse(Enum):
    """Answer of a goal callback."""

    REJECT = 1
    ACCEPT = 2


class CancelResponse(Enum):
    """Answer of a cancel callback."""

    REJECT = 1
    ACCEPT = 2


class ServerGoalHandle:
    """A goal that a server has accepted, in the hands of the callbacks that work on it."""

    def __init__(self, server: 'ActionServer', info: Any, request: Any) -> None:
        self.request = request  #: the goal message
        self.status = Status.ACCEPTED  #: a constant of ``action_msgs/msg/GoalStatus``
        self.info = info
        self.response = Future()
        self.ended: float | None = None
        self._server = server

    @property
    def goal_id(self) -> Any:
        """``unique_identifier_msgs/msg/UUID``."""
        return self.info.goal_id

    @property
    def is_active(self) -> bool:
        """True if the goal has not come to an end."""
        return self.status in _NEXT

    @property
    def is_cancelable(self) -> bool:
        """True if the goal has neither ended nor been asked to end."""
        return self.status in {Status.ACCEPTED, Status.EXECUTING}

    @property
    def is_cancel_requested(self) -> bool:
        """True if a client asked to cancel the goal, and the cancel callback accepted."""
        return self.status == Status.CANCELING

    def execute(self, execute_callback: Callable[..., Any] | None = None) -> None:
        """Have the goal executed, by the server's callback unless another is given."""
        if not self.is_cancel_requested:
            self.change(Status.EXECUTING)
        self._server.run(self, execute_callback)

    def publish_feedback(self, feedback: Any) -> None:
        """Publish a feedback message of the action; TypeError if it is none."""
        self._server.publish_feedback(self, feedback)

    def succeed(self) -> None:
        """The goal is reached."""
        self.change(Status.SUCCEEDED)

    def abort(self) -> None:
        """The goal cannot be reached."""
        self.change(Status.ABORTED)

    def canceled(self) -> None:
        """The goal was given up, as a client asked."""
        self.change(Status.CANCELED)

    def change(self, status: Status) -> None:
        """Go over to a status; MiddlewareError if none leads there from the present one."""
        if status not in _NEXT.get(self.status, ()):
            raise MiddlewareError(
                f'{self._server.action_name}: a goal that is {self.status.name} cannot become'
                f' {status.name}'
            )
        self.status = status
        if not self.is_active:
            self.ended = time.monotonic()
        self._server.publish_status()


class ActionServer:
    """Accepts goals, executes them, and keeps their results for ``result_timeout`` [s].

    The execute callback gets a ServerGoalHandle and gives back a result; it may be a coroutine
    function, and then goals are executed side by side. Without a cancel callback no goal is
    cancelled, as in rclpy.
    """

    def __init__(
        self,
        node: Node,
        action_type: type[Any],
        action_name: str,
        execute_callback: Callable[[ServerGoalHandle], Any],
        *,
        callback_group: CallbackGroup | None = None,
        goal_callback: Callable[[Any], Any] = lambda _: GoalResponse.ACCEPT,
        handle_accepted_callback: Callable[[ServerGoalHandle], Any] = ServerGoalHandle.execute,
        cancel_callback: Callable[[ServerGoalHandle], Any] = lambda _: CancelResponse.REJECT,
        result_timeout: float = 900,
    ) -> None:
        self.action_type = action_type
        self.action_name = action_name
        self._node = node
        self._execute, self._accepted = execute_callback, handle_accepted_callback
        self._wanted, self._unwanted = goal_callback, cancel_callback
        self._timeout = result_timeout
        self._goals: dict[bytes, ServerGoalHandle] = {}
        self._logger = node.get_logger().get_child('action_server')
        parts, prefix = action_type.Impl, f'{action_name}/_action'
        waiting = ReentrantCallbackGroup()
        self._services = [
            node.create_service(kind, f'{prefix}/{name}', callback, callback_group=group)
            for kind, name, callback, group in (
                (parts.SendGoalService, 'send_goal', self._on_goal, callback_group),
                (parts.CancelGoalService, 'cancel_goal', self._on_cancel, callback_group),
                (parts.GetResultService, 'get_result', self._on_result, waiting),
            )
        ]
        self._feedback = node.create_publisher(
            parts.FeedbackMessage, f'{prefix}/feedback', QoSProfile(depth=10)
        )
        self._status = node.create_publisher(
            parts.GoalStatusMessage, f'{prefix}/status', qos_profile_action_status_default
        )

    def destroy(self) -> None:
        """Take the server off the network."""
        for service in self._services:
            self._node.destroy_service(service)
        for publisher in (self._feedback, self._status):
            self._node.destroy_publisher(publisher)

    # For the goal handles

    def run(self, handle: ServerGoalHandle, callback: Callable[..., Any] | None) -> None:
        """Execute a goal when what is going on now is done."""
        self._node.tasks.soon(self._run(handle, callback or self._execute))

    def publish_feedback(self, handle: ServerGoalHandle, feedback: Any) -> None:
        """Publish feedback on a goal."""
        if not isinstance(feedback, self.action_type.Feedback):
            raise TypeError(f'{self.action_name}: {feedback!r} is no feedback of this action')
        kind = self.action_type.Impl.FeedbackMessage
        self._feedback.publish(kind(goal_id=handle.goal_id, feedback=feedback))

    def publish_status(self) -> None:
        """Publish the status of all goals."""
        status = message_class('action_msgs/msg/GoalStatus')
        goals = [status(goal_info=goal.info, status=goal.status) for goal in self._goals.values()]
        self._status.publish(message_class('action_msgs/msg/GoalStatusArray')(status_list=goals))

    # Callbacks

    async def _on_goal(self, request: Any, response: Any) -> Any:
        self._forget()
        if bytes(request.goal_id.uuid) in self._goals:
            return response
        answer = await await_or_execute(self._wanted, request.goal)
        if not isinstance(answer, GoalResponse):
            self._logger.warning(f'The goal callback answered {answer!r}: the goal is rejected')
        if answer is GoalResponse.ACCEPT:
            stamp = self._node.get_clock().now().to_msg()
            info = message_class('action_msgs/msg/GoalInfo')(goal_id=request.goal_id, stamp=stamp)
            handle = ServerGoalHandle(self, info, request.goal)
            self._goals[bytes(request.goal_id.uuid)] = handle
            response.accepted, response.stamp = True, stamp
            # Soon, not now: the client hears first that its goal is accepted.
            self._node.tasks.soon(await_or_execute(self._accepted, handle))
        return response

    async def _run(self, handle: ServerGoalHandle, callback: Callable[..., Any]) -> None:
        try:
            result = await await_or_execute(callback, handle)
            if not isinstance(result, self.action_type.Result):
                raise TypeError(f'{result!r} is no result of this action')
        except Exception as error:
            result = self.action_type.Result()
            self._logger.error(f'Error raised in execute callback: {error}')
            traceback.print_exc()
        if handle.is_active:
            self._logger.warning(
                f'{self.action_name}: the execute callback left the goal'
                f' {handle.status.name}, which is taken for aborted'
            )
            handle.abort()
        response = self.action_type.Impl.GetResultService.Response
        handle.response.set_result(response(status=handle.status, result=result))

    async def _on_result(self, request: Any, response: Any) -> Any:
        handle = self._goals.get(bytes(request.goal_id.uuid))
        return response if handle is None else await handle.response

    async def _on_cancel(self, request: Any, response: Any) -> Any:
        info = request.goal_info
        meant = self._goals_to_cancel(info)
        active = [handle for handle in meant if handle.is_cancelable]
        for handle in active:
            answer = await await_or_execute(self._unwanted, handle)
            if answer is CancelResponse.ACCEPT and handle.is_cancelable:
                handle.change(Status.CANCELING)
                response.goals_canceling.append(handle.info)
        if active and not response.goals_canceling:
            response.return_code = response.ERROR_REJECTED
        elif not active and bytes(info.goal_id.uuid) != ANYONE and not _has_stamp(info):
            terminated, unknown = response.ERROR_GOAL_TERMINATED, response.ERROR_UNKNOWN_GOAL_ID
            response.return_code = terminated if meant else unknown
        return response

    def _goals_to_cancel(self, info: Any) -> list[ServerGoalHandle]:
        """Goals that a request to cancel means: one, those up to a time, or all."""
        goal_id, until = bytes(info.goal_id.uuid), Time.from_msg(info.stamp)
        if not _has_stamp(info):
            return [h for key, h in self._goals.items() if goal_id in {key, ANYONE}]
        return [
            handle
            for key, handle in self._goals.items()
            if key == goal_id or Time.from_msg(handle.info.stamp) <= until
        ]

    def _forget(self) -> None:
        """Drop results that were kept for long enough; for ever if the time-out is negative."""
        now = time.monotonic()
        for key, handle in list(self._goals.items()):
            if handle.ended is not None and 0 <= self._timeout < now - handle.ended:
                del self._goals[key]


def _has_stamp(info: Any) -> bool:
    return Time.from_msg(info.stamp) > Time()
