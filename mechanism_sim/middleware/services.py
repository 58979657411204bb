"""Service servers and clients."""

import time
from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING, Any

import zenoh

from mechanism_sim.messages import MessageError, deserialize, serialize, type_name
from mechanism_sim.middleware import wire
from mechanism_sim.middleware.callback_groups import CallbackGroup
from mechanism_sim.middleware.callbacks import direct
from mechanism_sim.middleware.errors import MiddlewareError
from mechanism_sim.middleware.future import Future
from mechanism_sim.middleware.inbox import Inbox
from mechanism_sim.middleware.qos import QoSProfile
from mechanism_sim.middleware.tasks import await_or_execute

if TYPE_CHECKING:
    from mechanism_sim.middleware.node import Node

PATIENCE = 3e7  # [s]: a service that answers later, and the result of an action, take their time


class Service:
    """Answers requests; the callback gets the request and an empty response and gives it back.

    A coroutine function may ``await`` futures before it does; see ``callback_groups`` for what
    runs meanwhile.
    """

    def __init__(
        self,
        node: 'Node',
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
        self.callback_group = group
        self._key = context.key(name, type_name(kind))
        self.inbox = Inbox(context, self, group=group)
        self._queryable = context.session.declare_queryable(
            self._key, direct(self.inbox.put), complete=True
        )
        self._token = context.announce(node.token(wire.SERVICE, name, type_name(kind), qos))

    def execute(self) -> bool:
        """Begin to answer one request; False if none waits."""
        query: zenoh.Query | None = self.inbox.take()
        if query is None:
            return False
        self._tasks.start(self._answer(query), self.callback_group)
        return True

    async def _answer(self, query: zenoh.Query) -> None:
        with query:
            attachment = query.attachment
            asked = None if attachment is None else wire.parse_attachment(attachment.to_bytes())
            if asked is None or query.payload is None:
                query.reply_err('A request of ROS has a payload and an attachment of 33 bytes')
                return
            try:
                request = deserialize(query.payload.to_bytes(), self.srv_type.Request)
            except MessageError as error:
                query.reply_err(str(error))
                return
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
        self, node: 'Node', kind: type[Any], name: str, qos: QoSProfile, group: CallbackGroup
    ) -> None:
        context = node.context
        self.srv_type = kind
        self.srv_name = name
        self._context = context
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
        """Whether somebody serves this name with this type."""
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
        self._ask(request, lambda answer: self.inbox.put((future, answer)))
        return future

    def call(self, request: Any, timeout_sec: float | None = None) -> Any:
        """Ask and wait for the response; needs no executor here.

        Raises TimeoutError, or MiddlewareError if the service refuses or goes away.
        """
        future = Future()
        self._ask(request, lambda answer: self._fulfil(future, answer))
        with self._context.waits:
            if not future.wait(timeout_sec):
                raise TimeoutError(f'{self.srv_name} has not answered for {timeout_sec} s')
        return future.result()

    def execute(self) -> bool:
        """Fulfil one future; False if no reply waits."""
        item = self.inbox.take()
        if item is None:
            return False
        self._fulfil(*item)
        return True

    def destroy(self) -> None:
        """Take the client off the network."""
        self._context.retract(self._token)
        self.inbox.close()
        self._context.undeclare(self._querier)

    def _ask(self, request: Any, answered: Callable[[zenoh.Reply | None], Any]) -> None:
        """Send a request; ``answered`` gets every reply, and None when no more will come."""
        data = serialize(request)
        attachment = wire.pack_attachment(next(self._sequence), time.time_ns(), self._gid)
        callback = direct(answered, lambda: answered(None))
        with self._context.waits:
            self._querier.get(callback, payload=data, attachment=attachment)

    def _fulfil(self, future: Future, answer: zenoh.Reply | None) -> None:
        if future.done():
            return
        if answer is None:
            future.set_exception(MiddlewareError(f'{self.srv_name} did not answer'))
        elif answer.ok is not None:
            try:
                response = deserialize(answer.ok.payload.to_bytes(), self.srv_type.Response)
            except MessageError as error:
                future.set_exception(error)
            else:
                future.set_result(response)
        else:
            text = '' if answer.err is None else answer.err.payload.to_bytes().decode()
            future.set_exception(MiddlewareError(f'{self.srv_name} refused: {text}'))
