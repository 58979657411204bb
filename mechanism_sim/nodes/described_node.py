"""Base of nodes with descriptions, diagnostics and parameters for operation.

Described parameters, qualities of service with overrides, timers independent of simulated
time, diagnostics.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.messages import (
    DiagnosticArray,
    DiagnosticStatus,
    FloatingPointRange,
    KeyValue,
    ParameterDescriptor,
    SetParametersResult,
    type_name,
)
from mechanism_sim.messages.own import OWN
from mechanism_sim.nodes.middleware import Clock, ClockType, Node, Parameter, QoSOverridingOptions
from mechanism_sim.nodes.qos import CLOCK, LATCHED, RESULTS

_DIAGNOSTICS_PERIOD = 1.0  # [s]
OURS = RESULTS, LATCHED, CLOCK


@dataclass
class Diagnosis:
    """State of a node: a level of ``DiagnosticStatus``, a sentence, and figures."""

    level: Any
    message: str
    values: dict[str, object]


class DescribedNode(Node):
    """A node with described parameters and diagnostics."""

    done = False  #: True if it has nothing left to do
    keeps = False  #: True if it records messages of others, even after one of them has failed

    def __init__(self, name: str, parameters: Sequence[Parameter] = ()) -> None:
        self.results: list[str] = []  #: names of published topics with results
        #: names of topics with messages of this package that it publishes or subscribes to
        self.spoken: set[str] = set()
        self.heard: list[str] = []  #: names of those to which it subscribes
        super().__init__(name, parameter_overrides=list(parameters))
        self._lists: set[str] = set()  # parameters with a text or an array of texts
        self.add_on_set_parameters_callback(self._judge_values)

    # --- parameters ---------------------------------------------------------------------------

    def declare(
        self,
        name: str,
        default: Any,
        about: str,
        within: tuple[float, float] | None = None,
        read_only: bool = False,
    ) -> Any:
        """Declare a parameter with its description and range; returns its value.

        Raises
        ------
        ParameterException
            If the value at launch is out of the range, or of another type.
        """
        descriptor = ParameterDescriptor(description=about, read_only=read_only)
        if within:
            low, high = within
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
        return self.declare_parameter(name, default, descriptor).value

    def declare_list(self, name: str, about: str, read_only: bool = False) -> None:
        """Declare a parameter that is an array of texts, or one text that lists them."""
        self._lists.add(name)
        descriptor = ParameterDescriptor(
            description=about, read_only=read_only, dynamic_typing=True
        )
        self.declare_parameter(name, '', descriptor)

    def declare_frames(self) -> None:
        """Declare the prefix of frame names; default: the namespace."""
        space = self.get_namespace().strip('/')
        prefix = f'{space}/' if space else ''
        self.declare('frame_prefix', prefix, 'Before the name of every frame', read_only=True)

    def frame(self, link: str) -> str:
        """Name of the frame of a link."""
        return f'{self.value("frame_prefix")}{link}'

    def name_strangers(self) -> None:
        """Warn of launch parameters with names similar to its own.

        Others may be for other nodes: ROS passes them to all.
        """
        own = self.list_parameters([], 0).names
        for name in self._parameter_overrides:
            if name not in own and (meant := nearest(name, own, 0.7)):
                self.get_logger().warning(f"there is no parameter '{name}'{meant}")

    def announce(self, name: str, value: float, since: float) -> None:
        """Log the time [s] from which a parameter's new value holds."""
        self.get_logger().info(f'{name} = {value:g} holds from t = {since:.9g} s on')

    def value(self, parameter: str) -> Any:
        """Value of a parameter."""
        return self.get_parameter(parameter).value

    def names(self, parameter: str) -> list[str]:
        """Names in a parameter: an array, or separated by commas."""
        given = self.value(parameter)
        parts = given.split(',') if isinstance(given, str) else given
        return [name.strip() for name in parts if name.strip()]

    def _judge_values(self, parameters: list[Parameter]) -> Any:
        """Refuse numbers that are not finite, which ranges accept, and lists not of texts."""
        result = SetParametersResult(successful=True)
        for parameter in parameters:
            name, value = parameter.name, parameter.value
            texts = [value] if isinstance(value, str) else value
            if isinstance(value, float) and not math.isfinite(value):
                result.successful, result.reason = False, f'{name} must be finite'
            elif name in self._lists and not (
                isinstance(texts, list | tuple) and all(isinstance(text, str) for text in texts)
            ):
                reason = f'{name} must be an array of texts, or one text'
                result.successful, result.reason = False, reason
        return result

    # --- endpoints ----------------------------------------------------------------------------

    def create_publisher(
        self, msg_type: type[Any], topic: str, qos_profile: Any, **how: Any
    ) -> Any:
        """Publisher on a topic.

        Parameters such as ``qos_overrides./topic.publisher.depth`` override its quality of
        service.
        """
        if qos_profile in OURS:
            how.setdefault('qos_overriding_options', QoSOverridingOptions.with_default_policies())
        publisher = super().create_publisher(msg_type, topic, copy(qos_profile), **how)
        if qos_profile is RESULTS:
            self.results.append(publisher.topic_name)
        self._note(msg_type, publisher.topic_name)
        return publisher

    def create_subscription(
        self, msg_type: type[Any], topic: str, callback: Any, qos_profile: Any, **how: Any
    ) -> Any:
        """Subscription to a topic."""
        heard = super().create_subscription(msg_type, topic, callback, qos_profile, **how)
        if self._note(msg_type, heard.topic_name):
            self.heard.append(heard.topic_name)
        return heard

    def _note(self, msg_type: type[Any], topic: str) -> bool:
        """Note a topic; True if its messages are of this package."""
        ours = type_name(msg_type).startswith(f'{OWN}/')
        if ours:
            self.spoken.add(topic)
        return ours

    def refuse_echo(self, heard: Any, publisher: Any) -> None:
        """Refuse names by which a node that answers each message would answer itself."""
        if heard.topic_name == publisher.topic_name:
            raise InputError(
                f'{self.get_name()}: it hears {heard.topic_name} and answers there, itself too: '
                'remap one of both'
            )

    def ignore(self, topic: str, reason: str) -> None:
        """Warn of an ignored message, at limited frequency."""
        self.get_logger().warning(f'ignored a message on {topic}: {reason}',
                                  throttle_duration_sec=10.0)  # fmt: skip

    def create_timer(self, *given: Any, **how: Any) -> Any:
        """Timer of wall time, even if the node's own time is simulated."""
        how.setdefault('clock', Clock(clock_type=ClockType.STEADY_TIME))
        return super().create_timer(*given, **how)

    # --- diagnostics --------------------------------------------------------------------------

    def publish_diagnostics(self) -> None:
        """Start publishing ``/diagnostics``."""
        self._diagnostics = super().create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_timer(_DIAGNOSTICS_PERIOD, self._publish_diagnostics)

    def diagnose(self) -> Diagnosis:
        """State of this node; subclasses add to it."""
        return Diagnosis(DiagnosticStatus.OK, 'running', {})

    def _publish_diagnostics(self) -> None:
        found = self.diagnose()
        status = DiagnosticStatus(
            level=found.level,
            name=self.get_fully_qualified_name().lstrip('/'),
            message=found.message,
            hardware_id=self.value('scene'),
            values=[KeyValue(key=key, value=_text(x)) for key, x in found.values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def _text(value: object) -> str:
    return f'{value:.6g}' if isinstance(value, float) else str(value)
