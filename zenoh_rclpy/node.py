"""Nodes: the surface of rclpy's ``Node``."""

from collections.abc import Callable, Iterable, Sequence
from threading import Event
from typing import Any, Protocol, TypeVar

from ros_interfaces.classes import message_class
from zenoh_rclpy import wire
from zenoh_rclpy.arguments import parse_arguments
from zenoh_rclpy.callback_groups import (
    CallbackGroup,
    MutuallyExclusiveCallbackGroup,
)
from zenoh_rclpy.clock import Clock, ClockType, Time
from zenoh_rclpy.context import default_context
from zenoh_rclpy.inbox import Ready
from zenoh_rclpy.logger import Logger
from zenoh_rclpy.node_graph import NodeGraph
from zenoh_rclpy.node_parameters import NodeParameters
from zenoh_rclpy.parameter import Parameter
from zenoh_rclpy.parameter_services import parameter_services, publish_events
from zenoh_rclpy.parameters import Parameters
from zenoh_rclpy.publisher import Publisher
from zenoh_rclpy.qos import (
    QoSProfile,
    as_profile,
    qos_profile_clock,
    qos_profile_parameters,
    qos_profile_rosout,
    qos_profile_services_default,
)
from zenoh_rclpy.qos_overrides import QoSOverridingOptions, overridden
from zenoh_rclpy.services import Client, Service
from zenoh_rclpy.subscription import Subscription
from zenoh_rclpy.tasks import Tasks
from zenoh_rclpy.timer import Rate, Timer
from zenoh_rclpy.warnings import Warnings

E = TypeVar('E', Subscription, Service, Client)


class Executor(Protocol):
    """Interface of an executor for the nodes that it runs."""

    def wake(self) -> None:
        """Look for work."""

    def remove_node(self, node: Any) -> None:
        """Let a node go."""


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
        self.executor: Executor | None = None
        self.timers: list[Timer] = []
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
        given += parameter_overrides or ()
        self._parameter_overrides = {parameter.name: parameter for parameter in given}
        self._parameters = Parameters(full_name, given)
        events = self.create_publisher(
            message_class('rcl_interfaces/msg/ParameterEvent'),
            '/parameter_events',
            qos_profile_parameters,
        )
        publish_events(self._parameters, full_name, self._clock, events)
        self.add_post_set_parameters_callback(self._follow_sim_time)
        self.declare_parameter('use_sim_time', False)
        if start_parameter_services:
            for kind, name, answer in parameter_services(self):
                self.create_service(kind, name, answer, qos_profile=qos_profile_parameters)

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

    def create_rate(self, frequency: float, clock: Clock | None = None) -> Rate:
        """Rate [Hz] for the loop of a thread, while another spins the node."""
        if not frequency > 0.0:
            raise ValueError(f'The frequency of a rate is {frequency} Hz; it must be positive')
        beat = Event()
        return Rate(self.create_timer(1.0 / frequency, beat.set, clock=clock), beat)

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

    def destroy_rate(self, rate: Rate) -> bool:
        """Stop a rate for good; False if it is not of this node."""
        return self.destroy_timer(rate.timer)

    def destroy_node(self) -> None:
        """Take the node and all that belongs to it off the network."""
        if self.executor is not None:
            self.executor.remove_node(self)
        for timer in list(self.timers):
            self.destroy_timer(timer)
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

    # For the rest of this package

    def attach(self, ready: Ready | None) -> None:
        """Report what arrives to this ready queue."""
        self._ready = ready
        for entity in self._entities:
            if not isinstance(entity, Publisher):
                entity.inbox.attach(ready)

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
