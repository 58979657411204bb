"""Nodes: the surface of rclpy's ``Node`` that the nodes of this package use."""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from mechanism_sim.messages import message_class
from mechanism_sim.middleware import wire
from mechanism_sim.middleware.arguments import parse_arguments
from mechanism_sim.middleware.callback_groups import (
    CallbackGroup,
    MutuallyExclusiveCallbackGroup,
)
from mechanism_sim.middleware.clock import Clock, ClockType, Time
from mechanism_sim.middleware.context import default_context
from mechanism_sim.middleware.inbox import Ready
from mechanism_sim.middleware.logger import Logger
from mechanism_sim.middleware.node_graph import NodeGraph
from mechanism_sim.middleware.node_parameters import NodeParameters
from mechanism_sim.middleware.parameter import Parameter
from mechanism_sim.middleware.parameter_services import publish_events, serve_parameters
from mechanism_sim.middleware.parameters import Parameters
from mechanism_sim.middleware.publisher import Publisher
from mechanism_sim.middleware.qos import (
    QoSProfile,
    as_profile,
    qos_profile_clock,
    qos_profile_rosout,
    qos_profile_services_default,
)
from mechanism_sim.middleware.qos_overrides import QoSOverridingOptions, overridden
from mechanism_sim.middleware.services import Client, Service
from mechanism_sim.middleware.subscription import Subscription
from mechanism_sim.middleware.tasks import Tasks
from mechanism_sim.middleware.timer import Timer
from mechanism_sim.middleware.warnings import Warnings

if TYPE_CHECKING:
    from mechanism_sim.middleware.executor import SingleThreadedExecutor


E = TypeVar('E', Subscription, Service, Client)


class Node(NodeGraph, NodeParameters):
    """A node: publishers, subscriptions, timers, services and parameters under one name.

    Raises InvalidNameError for a name that is none, MiddlewareError without ``init``.
    """

    def __init__(
        self,
        node_name: str,
        *,
        cli_args: Sequence[str] | None = None,
        namespace: str | None = None,
        use_global_arguments: bool = True,
        enable_rosout: bool = True,
        start_parameter_services: bool = True,
        parameter_overrides: Iterable[Parameter] | None = None,
    ) -> None:
        context = default_context()
        arguments = parse_arguments(cli_args or ())
        if use_global_arguments:
            arguments = arguments.after(context.arguments)
        super().__init__(context, node_name, namespace or '', arguments)
        self.executor: SingleThreadedExecutor | None = None
        self.timers: list[Timer] = []
        self._id = self.context.next_id()
        self.default_callback_group: CallbackGroup = MutuallyExclusiveCallbackGroup()
        self.tasks = Tasks(self.context)
        self._entities: list[Publisher | Subscription | Service | Client | Tasks | Warnings] = []
        self._entities.append(self.tasks)
        self._ready: Ready | None = None
        self._clock = Clock(clock_type=ClockType.ROS_TIME)
        self._clock_subscription: Subscription | None = None
        self._token = self.context.announce(self._describe(wire.NODE, self._id))
        rosout = None
        if enable_rosout and arguments.logs['rosout-logs']:
            log = message_class('rcl_interfaces/msg/Log')
            rosout = self.create_publisher(log, '/rosout', qos_profile_rosout).publish
        full_name = self.get_fully_qualified_name()
        logger_name = full_name.lstrip('/').replace('/', '.')
        self._logger = Logger(logger_name, rosout, arguments.logs['stdout-logs'])
        self._logger.set_level(arguments.level(logger_name))
        self.warnings = Warnings(self.context, self._logger)
        self._entities.append(self.warnings)
        given = [Parameter(n, value=v) for n, v in arguments.parameters_of(full_name).items()]
        self._parameters = Parameters(full_name, [*given, *(parameter_overrides or ())])
        publish_events(self, self._parameters)
        self.add_post_set_parameters_callback(self._follow_sim_time)
        self.declare_parameter('use_sim_time', False)
        if start_parameter_services:
            serve_parameters(self)

    # Endpoints

    def create_publisher(
        self,
        msg_type: type[Any],
        topic: str,
        qos_profile: QoSProfile | int,
        *,
        qos_overriding_options: QoSOverridingOptions | None = None,
    ) -> Publisher:
        """Publisher on a topic."""
        name, qos = self.resolve_topic_name(topic), as_profile(qos_profile)
        qos = overridden(self, 'publisher', name, qos, qos_overriding_options)
        publisher = Publisher(self, msg_type, name, qos)
        self._entities.append(publisher)
        return publisher

    def create_subscription(
        self,
        msg_type: type[Any],
        topic: str,
        callback: Callable[..., Any],
        qos_profile: QoSProfile | int,
        *,
        callback_group: CallbackGroup | None = None,
        qos_overriding_options: QoSOverridingOptions | None = None,
        raw: bool = False,
    ) -> Subscription:
        """Subscription to a topic; see Subscription for what the callback gets."""
        group = callback_group or self.default_callback_group
        name, qos = self.resolve_topic_name(topic), as_profile(qos_profile)
        qos = overridden(self, 'subscription', name, qos, qos_overriding_options)
        return self._add(Subscription(self, msg_type, name, callback, qos, raw, group))

    def create_service(
        self,
        srv_type: type[Any],
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> Service:
        """Service; the callback gets request and response, and gives back the response."""
        group = callback_group or self.default_callback_group
        name = self.resolve_service_name(srv_name)
        return self._add(Service(self, srv_type, name, callback, qos_profile, group))

    def create_client(
        self,
        srv_type: type[Any],
        srv_name: str,
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> Client:
        """Client of a service."""
        group = callback_group or self.default_callback_group
        name = self.resolve_service_name(srv_name)
        return self._add(Client(self, srv_type, name, qos_profile, group))

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[[], Any],
        callback_group: CallbackGroup | None = None,
        clock: Clock | None = None,
        autostart: bool = True,
    ) -> Timer:
        """Timer on the clock of the node, or on another."""
        group = callback_group or self.default_callback_group
        timer = Timer(
            timer_period_sec, self.tasks.plain(callback, group), clock or self._clock, group
        )
        if not autostart:
            timer.cancel()
        self.timers.append(timer)
        if self.executor is not None:
            self.executor.wake()
        return timer

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """Take a publisher off the network; False if it is not of this node."""
        return self._destroy(publisher)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """Take a subscription off the network; False if it is not of this node."""
        return self._destroy(subscription)

    def destroy_service(self, service: Service) -> bool:
        """Take a service off the network; False if it is not of this node."""
        return self._destroy(service)

    def destroy_client(self, client: Client) -> bool:
        """Take a client off the network; False if it is not of this node."""
        return self._destroy(client)

    def destroy_timer(self, timer: Timer) -> bool:
        """Stop a timer for good; False if it is not of this node."""
        if timer not in self.timers:
            return False
        timer.cancel()
        self.timers.remove(timer)
        return True

    def destroy_node(self) -> None:
        """Take the node and all that belongs to it off the network."""
        if self.executor is not None:
            self.executor.remove_node(self)
        self.timers.clear()
        for entity in reversed(self._entities):
            entity.destroy()
        self._entities.clear()
        self.context.retract(self._token)

    # Clock, log

    def get_clock(self) -> Clock:
        """Clock of the node, simulated if its parameter ``use_sim_time`` is true."""
        return self._clock

    def get_logger(self) -> Logger:
        """Logger of the node."""
        return self._logger

    # For the rest of this room

    def attach(self, ready: Ready | None) -> None:
        """Report what arrives to this ready queue."""
        self._ready = ready
        for entity in self._entities:
            if not isinstance(entity, Publisher):
                entity.inbox.attach(ready)

    def token(self, kind: str, name: str, type_name: str, qos: QoSProfile) -> wire.Token:
        """Token for a new endpoint of this node."""
        described = self._describe(kind, self.context.next_id())
        hashed = self.context.hash_of(type_name)
        return described._replace(name=name, type=type_name, hash=hashed, qos=qos)

    def _describe(self, kind: str, entity_id: int) -> wire.Token:
        session = self.context.zid
        return wire.Token(session, self._id, entity_id, kind, self._namespace, self._name)

    def _add(self, entity: E) -> E:
        entity.inbox.attach(self._ready)
        self._entities.append(entity)
        return entity

    def _destroy(self, entity: Publisher | Subscription | Service | Client) -> bool:
        if entity not in self._entities:
            return False
        self._entities.remove(entity)
        entity.destroy()
        return True

    def _follow_sim_time(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name != 'use_sim_time':
                continue
            if parameter.value and self._clock_subscription is None:
                self._clock.simulated = Time()
                clock = message_class('rosgraph_msgs/msg/Clock')
                self._clock_subscription = self.create_subscription(
                    clock, '/clock', self._on_clock, qos_profile_clock
                )
            elif not parameter.value and self._clock_subscription is not None:
                self.destroy_subscription(self._clock_subscription)
                self._clock_subscription = None
                self._clock.simulated = None

    def _on_clock(self, message: Any) -> None:
        self._clock.simulated = Time.from_msg(message.clock)
