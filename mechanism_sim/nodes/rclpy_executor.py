"""An executor of rclpy that keeps its wait set, and calls plain callbacks without tasks.

For each turn of callbacks rclpy makes a wait set of all entities, which the middleware attaches
one by one, and for each callback a task that wakes the executor twice more. That costs more than
most callbacks. Subscriptions and timers with plain callbacks, nearly all that happens in a run,
are served here, and services and clients in turn with them: rclpy serves ready entities kind by
kind, one at a time, and services come after all timers and subscriptions, which on a busy machine
is never. Other entities are left to rclpy. Importing this raises ImportError if rclpy lacks the
private parts used here; rclpy's own executor is equivalent.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from functools import partial
from inspect import iscoroutinefunction
from typing import Any

import rclpy.executors
from rclpy.event_handler import EventHandler
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.waitable import NumberOfEntities

_PARTS = {'_context', '_guard', '_is_shutdown', '_sigint_gc', '_tasks'}
if not {*rclpy.executors.Executor.__init__.__code__.co_names} >= _PARTS:
    raise ImportError('this rclpy has an executor of another kind')
if not {'_make_handler', '_take_service', '_take_client'} <= {*dir(rclpy.executors.Executor)}:
    raise ImportError('this rclpy has an executor of another kind')

_ABANDONED = rclpy_implementation.InvalidHandle
_POLL, LOOK = 0.005, 0.5
"""[s] between two looks at coroutines that wait; at events, such as an unfit quality of service,
of which rclpy has two for each endpoint."""


class SingleThreadedExecutor(rclpy.executors.SingleThreadedExecutor):  # type: ignore[misc]
    """Executor of callbacks in the thread that calls ``spin`` or ``spin_once``."""

    def __init__(self) -> None:
        super().__init__()
        self._changed = True
        self._next_look = 0.0
        self._due: deque[tuple[Callable[[Any], None], Any]] = deque()

    def wake(self) -> None:
        """Update the entities after one has been added or removed."""
        self._changed = True
        super().wake()

    def add_node(self, node: Any) -> bool:
        """Add a node; False if it has been added already."""
        self._changed = True
        return bool(super().add_node(node))

    def remove_node(self, node: Any) -> None:
        """Remove a node."""
        super().remove_node(node)
        self._changed = True
        self._due.clear()  # due entities will be found again

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run one callback, if one is due within ``timeout_sec`` or `LOOK` [s]."""
        if not self._due and not self._is_shutdown:
            waiting = any(not task.done() for task, *_ in self._tasks)
            left = LOOK if timeout_sec is None or timeout_sec < 0.0 else timeout_sec
            others = self._wait(min(left, _POLL if waiting else LOOK))
            if waiting or others or time.monotonic() > self._next_look:
                self._next_look = time.monotonic() + LOOK
                super().spin_once(0.0)
        if self._due:
            run, entity = self._due.popleft()
            if not entity._executor_event and entity.callback_group.can_execute(entity):
                run(entity)

    def _wait(self, seconds: float) -> bool:
        """Wait until an entity is due; True if it is left to rclpy."""
        if self._changed:
            self._gather()
        found = self._wait_set
        found.clear_entities()
        free: dict[Any, bool] = {}  # True by group whose callbacks may run
        for entity, add, handle in self._entities:
            group = entity.callback_group
            if group not in free:
                free[group] = group.can_execute(entity)
            if free[group] and not entity._executor_event:
                add(handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(found)
        for guard in self._guards:
            found.add_guard_condition(guard)
        found.wait(int(1e9 * seconds))
        if not self._context.ok():
            raise ExternalShutdownException
        others = any(waitable.is_ready(found) for waitable in self._waitables)
        for kind in ('timer', 'subscription', 'client', 'service', 'guard_condition'):
            for pointer in found.get_ready_entities(kind):
                if pointer in self._plain:
                    self._due.append(self._plain[pointer])
                else:
                    others = True
        return others

    def _gather(self) -> None:
        """Make a wait set for the present entities."""
        self._changed = False
        nodes = self.get_nodes()
        timers, subscriptions, clients, services, waitables, guards = (
            [entity for node in nodes for entity in getattr(node, kind)]
            for kind in ('timers', 'subscriptions', 'clients', 'services', 'waitables', 'guards')
        )
        self._waitables = [w for w in waitables if not isinstance(w, EventHandler)]
        self._guards = [g.handle for g in (*guards, self._guard, self._sigint_gc)]
        more = sum((w.get_num_entities() for w in self._waitables), NumberOfEntities())
        found = self._wait_set = rclpy_implementation.WaitSet(
            len(subscriptions) + more.num_subscriptions,
            len(self._guards) + more.num_guard_conditions,
            len(timers) + more.num_timers,
            len(clients) + more.num_clients,
            len(services) + more.num_services,
            more.num_events,
            self._context.handle,
        )
        self._entities = [
            (entity, add, entity.handle)
            for add, entities in (
                (found.add_timer, timers),
                (found.add_subscription, subscriptions),
                (found.add_client, clients),
                (found.add_service, services),
            )
            for entity in entities
        ]
        self._plain = {
            entity.handle.pointer: (run, entity)
            for run, entities in ((_call_timer, timers), (_call_subscription, subscriptions))
            for entity in entities
            if not iscoroutinefunction(entity.callback)
        }
        self._plain |= {
            entity.handle.pointer: (partial(self._hand_over, node, take), entity)
            for node in nodes
            for take, entities in (
                (self._take_service, node.services),
                (self._take_client, node.clients),
            )
            for entity in entities
        }

    def _hand_over(self, node: Any, take: Callable[[Any], Any], entity: Any) -> None:
        """Let rclpy take a request or a response and call its handler."""
        handler = self._make_handler(entity, node, take)
        handler()
        if handler.exception() is not None:
            raise handler.exception()


def _call_timer(timer: Any) -> None:
    try:
        with timer.handle:
            if not timer.handle.is_timer_ready():
                return
            timer.handle.call_timer()
    except _ABANDONED:
        return
    timer.callback()


def _call_subscription(subscription: Any) -> None:
    try:
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
    except _ABANDONED:
        return
    if taken is not None:
        subscription.callback(taken[0])
