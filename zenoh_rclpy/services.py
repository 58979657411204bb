"""Service servers and clients."""

import time
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from typing import Any

import zenoh

from ros_interfaces.classes import serialize
from ros_interfaces.definitions import MessageError, type_name
from ros_interfaces.refusals import check_message
from zenoh_rclpy import wire
from zenoh_rclpy.callback_groups import CallbackGroup
from zenoh_rclpy.callbacks import direct
from zenoh_rclpy.errors import MiddlewareError
from zenoh_rclpy.future import Future
from zenoh_rclpy.inbox import LIMIT, Inbox, Overflow
from zenoh_rclpy.node_graph import NodeGraph
from zenoh_rclpy.qos import QoSProfile
from zenoh_rclpy.tasks import await_or_execute

LONGEST = 1_000_000  # bytes of a request
PATIENCE = 3e7  # [s]: a service that answers later, and the result of an action, take their time


class Service:
    """Answers requests; the callback gets the request and an empty response and gives it back.

    What is no request gets an error for an answer, and so does one too many of those that wait.

    A coroutine function may ``await`` futures before it does; see ``callback_groups`` for what
    runs meanwhile.
    """

    def __init__(
        self,
        node: NodeGraph,
        kind: type[Any],
        name: str,
        callback: Callable[[Any, Any], Any],
        qos: QoSProfile,
        group: CallbackGroup,
    ) -> None:
        context = node.context
        self.srv_type = kind
        self.srv_name = name
        self._context = context
        self._callback = callback
        self._tasks = node.tasks
        self._warn = node.warnings.put
        self.callback_group = group
        self._key = context.key(name, type_name(kind))
        self.inbox = Inbox(context, self, LIMIT, Overflow.REFUSE, group)
        self._queryable = context.session.declare_queryable(
            self._key, direct(self._receive), complete=True
        )
        self._token = context.announce(node.token(wire.SERVICE, name, type_name(kind), qos))

    def execute(self) -> bool:
        """Begin to answer one request; False if none waits."""
        item = self.inbox.take()
        if item is None:
            return False
        self._tasks.start(self._answer(*item), self.callback_group)
        return True

    def _receive(self, query: zenoh.Query) -> None:
        """Queue a request, in Zenoh's thread, or answer with what is wrong with it."""
        try:
            asked, request = self._read(query)
            if self.inbox.put((query, asked, request)):
                return
            reason = f'{LIMIT} requests wait already'
        except MessageError as error:
            reason = str(error)
        self._context.refuse(self.srv_name, 'request', reason, self._warn)
        with query, suppress(zenoh.ZError):
            query.reply_err(reason)

    def _read(self, query: zenoh.Query) -> tuple[wire.Attachment, Any]:
        extra, payload = query.attachment, query.payload
        asked = None if extra is None else wire.parse_attachment(extra.to_bytes())
        if asked is None or payload is None:
            raise MessageError('a request of ROS has a payload and an attachment of 33 bytes')
        data = payload.to_bytes()
        if len(data) > LONGEST:
            raise MessageError(f'{len(data)} bytes are more than a request may have')
        return asked, check_message(data, self.srv_type.Request)

    async def _answer(self, query: zenoh.Query, asked: wire.Attachment, request: Any) -> None:
        with query:
            response = await await_or_execute(self._callback, request, self.srv_type.Response())
            query.reply(
                self._key,
                serialize(response),
                attachment=wire.pack_attachment(asked.sequence, time.time_ns(), asked.gid),
            )

    @property
    def service_name(self) -> str:
        """Full name."""
        return self.srv_name

    def destroy(self) -> None:
        """Take the service off the network."""
        self._context.retract(self._token)
        self.inbox.close()
        self._context.undeclare(self._queryable)


class Client:
    """Asks a service."""

    def __init__(
        self, node: NodeGraph, kind: type[Any], name: str, qos: QoSProfile, group: CallbackGroup
    ) -> None:
        context = node.context
        self.srv_type = kind
        self.srv_name = name
        self._context = context
        self._warn = node.warnings.put
        self._sequence = count(1)
        token = node.token(wire.CLIENT, name, type_name(kind), qos)
        self._gid = wire.gid(wire.token_key(context.domain, token))
        self.callback_group = group
        self.inbox = Inbox(context, self, group=group)
        self._querier = context.session.declare_querier(
            context.key(name, type_name(kind)),
            target=zenoh.QueryTarget.ALL_COMPLETE,
            timeout=PATIENCE,
            consolidation=zenoh.ConsolidationMode.NONE,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )
        self._token = context.announce(token)

    @property
    def service_name(self) -> str:
        """Full name of the service."""
        return self.srv_name

    def service_is_ready(self) -> bool:
        """True if a server has this name and type."""
        served = self._context.graph.count(wire.SERVICE, self.srv_name, type_name(self.srv_type))
        # Typed as a bool, but an object in the releases there are.
        status: Any = self._querier.matching_status
        return served > 0 and bool(getattr(status, 'matching', status))

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Wait until the service is there; False if ``timeout_sec`` [s] pass first."""
        return self._context.graph.wait_for(self.service_is_ready, timeout_sec)

    def call_async(self, request: Any) -> Future:
        """Ask; the executor that spins the node fulfils the future."""
        future = Future()
        waiting = [future]

        def answer(outcome: Any) -> None:
            with suppress(IndexError):  # only the first counts
                self.inbox.put((waiting.pop(), outcome))

        self._send_request(request, answer)
        return future

    def call(self, request: Any, timeout_sec: float | None = None) -> Any:
        """Ask and wait for the response; needs no executor here.

        Raises TimeoutError, or MiddlewareError if the service refuses or goes away.
        """
        future = Future()
        self._send_request(request, lambda outcome: _fulfil(future, outcome))
        with self._context.waits:
            if not future.wait(timeout_sec):
                raise TimeoutError(f'{self.srv_name} has not answered for {timeout_sec} s')
        return future.result()

    def execute(self) -> bool:
        """Fulfil one future; False if no reply waits."""
        item = self.inbox.take()
        if item is None:
            return False
        _fulfil(*item)
        return True

    def destroy(self) -> None:
        """Take the client off the network."""
        self._context.retract(self._token)
        self.inbox.close()
        self._context.undeclare(self._querier)

    def _send_request(self, request: Any, answer: Callable[[Any], Any]) -> None:
        """Send a request; ``answer`` gets every response, or MiddlewareError for there is none.

        What is no response is dropped: it is not from who serves this.
        """
        data = serialize(request)
        attachment = wire.pack_attachment(next(self._sequence), time.time_ns(), self._gid)

        def receive(reply: zenoh.Reply) -> None:
            try:
                answer(self._outcome(reply))
            except MessageError as error:
                self._context.refuse(self.srv_name, 'reply', str(error), self._warn)

        none = MiddlewareError(f'{self.srv_name} did not answer')
        callback = direct(receive, lambda: answer(none))
        with self._context.waits:
            self._querier.get(callback, payload=data, attachment=attachment)

    def _outcome(self, reply: zenoh.Reply) -> Any:
        """Response, or MiddlewareError; raises MessageError for what is neither."""
        if reply.ok is not None:
            return check_message(reply.ok.payload.to_bytes(), self.srv_type.Response)
        data = b'' if reply.err is None else reply.err.payload.to_bytes()
        text = data[:LONGEST].decode(errors='replace')
        return MiddlewareError(f'{self.srv_name} refused: {text}')


def _fulfil(future: Future, outcome: Any) -> None:
    if future.done():
        return
    if isinstance(outcome, MiddlewareError):
        future.set_exception(outcome)
    else:
        future.set_result(outcome)
