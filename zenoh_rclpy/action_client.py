"""Action clients, with the names and the meaning of ``rclpy.action``."""

import uuid
from collections.abc import Callable
from typing import Any
from weakref import WeakValueDictionary

from ros_interfaces.classes import message_class, service_class, uint8_array
from ros_interfaces.definitions import type_name
from zenoh_rclpy import wire
from zenoh_rclpy.actions import Status
from zenoh_rclpy.callback_groups import CallbackGroup
from zenoh_rclpy.future import Future
from zenoh_rclpy.node import Node
from zenoh_rclpy.qos import QoSProfile, qos_profile_action_status_default
from zenoh_rclpy.tasks import await_or_execute


class ClientGoalHandle:
    """A goal that was sent, and what its server said to it."""

    def __init__(self, client: 'ActionClient', goal_id: Any, response: Any) -> None:
        self.goal_id = goal_id  #: ``unique_identifier_msgs/msg/UUID``
        self.accepted = bool(response.accepted)  #: whether the server accepted the goal
        self.stamp = response.stamp  #: time of acceptance
        self.status = int(
            Status.UNKNOWN
        )  #: last received status, a constant of ``action_msgs/msg/GoalStatus``
        self._client = client

    def __repr__(self) -> str:
        name = bytes(self.goal_id.uuid).hex()
        return f'ClientGoalHandle <id={name}, accepted={self.accepted}, status={self.status}>'

    def cancel_goal_async(self) -> Future:
        """Ask for the goal to be cancelled; the result is the response of ``CancelGoal``."""
        return self._client.cancel(self)

    def cancel_goal(self) -> Any:
        """``cancel_goal_async``, and wait; for another thread than the executor's."""
        return self._client.wait(self.cancel_goal_async())

    def get_result_async(self) -> Future:
        """Ask for the result; what comes has ``status`` and ``result``."""
        return self._client.result(self)

    def get_result(self) -> Any:
        """``get_result_async``, and wait; for another thread than the executor's."""
        return self._client.wait(self.get_result_async())


class ActionClient:
    """Sends goals to an action server and hears how they fare."""

    def __init__(
        self,
        node: Node,
        action_type: type[Any],
        action_name: str,
        *,
        callback_group: CallbackGroup | None = None,
        feedback_sub_qos_profile: QoSProfile = QoSProfile(depth=10),  # noqa: B008 - as of rclpy
    ) -> None:
        self._node = node
        self._type = action_type
        self._goals: WeakValueDictionary[bytes, ClientGoalHandle] = WeakValueDictionary()
        self._callbacks: dict[bytes, Callable[[Any], Any]] = {}
        parts, prefix = action_type.Impl, f'{action_name}/_action'
        self._send, self._cancel, self._result = self._clients = [
            node.create_client(kind, f'{prefix}/{name}', callback_group=callback_group)
            for kind, name in (
                (parts.SendGoalService, 'send_goal'),
                (parts.CancelGoalService, 'cancel_goal'),
                (parts.GetResultService, 'get_result'),
            )
        ]
        self._subscriptions = [
            node.create_subscription(kind, topic, callback, qos, callback_group=callback_group)
            for kind, topic, callback, qos in (
                (
                    parts.FeedbackMessage,
                    f'{prefix}/feedback',
                    self._on_feedback,
                    feedback_sub_qos_profile,
                ),
                (
                    parts.GoalStatusMessage,
                    f'{prefix}/status',
                    self._on_status,
                    qos_profile_action_status_default,
                ),
            )
        ]

    def send_goal_async(
        self,
        goal: Any,
        feedback_callback: Callable[[Any], Any] | None = None,
        goal_uuid: Any = None,
    ) -> Future:
        """Send a goal; the result is a ClientGoalHandle.

        The callback gets the feedback messages of this goal, as long as nobody has its result.
        TypeError if it is no goal of this action.
        """
        if not isinstance(goal, self._type.Goal):
            raise TypeError(f'{goal!r} is no goal of this action')
        goal_id = goal_uuid or message_class('unique_identifier_msgs/msg/UUID')(
            uuid=uint8_array(list(uuid.uuid4().bytes))
        )
        key = bytes(goal_id.uuid)
        if feedback_callback is not None:
            self._callbacks[key] = feedback_callback

        def handle(response: Any) -> ClientGoalHandle:
            made = ClientGoalHandle(self, goal_id, response)
            if made.accepted:
                self._goals[key] = made
            else:
                self._callbacks.pop(key, None)
            return made

        request = self._type.Impl.SendGoalService.Request(goal_id=goal_id, goal=goal)
        return _then(self._send.call_async(request), handle)

    def send_goal(self, goal: Any, **how: Any) -> Any:
        """Send a goal and wait for its result; for another thread than the executor's."""
        return self.wait(self.send_goal_async(goal, **how)).get_result()

    def server_is_ready(self) -> bool:
        """True if a server is there, with all that belongs to it."""
        graph = self._node.context.graph
        return all(client.service_is_ready() for client in self._clients) and all(
            graph.count(wire.PUBLISHER, s.topic_name, type_name(s.msg_type))
            for s in self._subscriptions
        )

    def wait_for_server(self, timeout_sec: float | None = None) -> bool:
        """Wait until a server is there; False if ``timeout_sec`` [s] pass first."""
        return self._node.context.graph.wait_for(self.server_is_ready, timeout_sec)

    def destroy(self) -> None:
        """Take the client off the network."""
        for client in self._clients:
            self._node.destroy_client(client)
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    # For the goal handles

    def cancel(self, handle: ClientGoalHandle) -> Future:
        """Ask for a goal to be cancelled."""
        request = service_class('action_msgs/srv/CancelGoal').Request()
        request.goal_info.goal_id = handle.goal_id
        return self._cancel.call_async(request)

    def result(self, handle: ClientGoalHandle) -> Future:
        """Ask for the result of a goal."""
        request = self._type.Impl.GetResultService.Request(goal_id=handle.goal_id)
        future = self._result.call_async(request)
        future.add_done_callback(lambda _: self._callbacks.pop(bytes(handle.goal_id.uuid), None))
        return future

    @staticmethod
    def wait(future: Future) -> Any:
        """Result of a future that an executor in another thread fulfils."""
        future.wait()
        return future.result()

    # Callbacks

    async def _on_feedback(self, message: Any) -> None:
        callback = self._callbacks.get(bytes(message.goal_id.uuid))
        if callback is not None:
            await await_or_execute(callback, message)

    def _on_status(self, message: Any) -> None:
        for status in message.status_list:
            handle = self._goals.get(bytes(status.goal_info.goal_id.uuid))
            if handle is not None:
                handle.status = status.status


def _then(future: Future, make: Callable[[Any], Any]) -> Future:
    """A future for what is made of the result of another."""
    made = Future()

    def pass_on(done: Future) -> None:
        error = done.exception()
        if error is not None:
            made.set_exception(error)
        else:
            made.set_result(make(done.result()))

    future.add_done_callback(pass_on)
    return made
