"""Quality of service that the user of a node may change when it starts, as in rclpy.

A publisher or subscription with such options declares read-only parameters named
``qos_overrides./topic.publisher.depth``.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from enum import IntEnum
from typing import Any

from ros_interfaces.classes import message_class
from zenoh_rclpy.errors import InvalidQosOverridesError
from zenoh_rclpy.node_parameters import NodeParameters
from zenoh_rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
)


class QoSPolicyKind(IntEnum):
    """The policies that there are here; the numbers are those of rclpy."""

    DURABILITY = 1 << 1
    RELIABILITY = 1 << 4
    HISTORY = 1 << 5
    LIFESPAN = 1 << 6
    DEPTH = 1 << 7


_ENUMS: dict[QoSPolicyKind, type[IntEnum]] = {
    QoSPolicyKind.DURABILITY: DurabilityPolicy,
    QoSPolicyKind.RELIABILITY: ReliabilityPolicy,
    QoSPolicyKind.HISTORY: HistoryPolicy,
}


class QoSOverridingOptions:
    """Policies that may be overridden; ``callback`` judges the profile that results.

    ``entity_id`` tells several endpoints of one topic apart.
    """

    def __init__(
        self,
        policy_kinds: Iterable[QoSPolicyKind],
        *,
        callback: Callable[[QoSProfile], Any] | None = None,
        entity_id: str | None = None,
    ) -> None:
        self.policy_kinds = tuple(policy_kinds)
        self.callback = callback
        self.entity_id = entity_id

    @classmethod
    def with_default_policies(
        cls,
        *,
        callback: Callable[[QoSProfile], Any] | None = None,
        entity_id: str | None = None,
    ) -> 'QoSOverridingOptions':
        """History, depth and reliability."""
        kinds = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY)
        return cls(kinds, callback=callback, entity_id=entity_id)


def overridden(
    node: NodeParameters,
    entity: str,
    topic: str,
    qos: QoSProfile,
    options: QoSOverridingOptions | None,
) -> QoSProfile:
    """Profile of an ``entity`` ('publisher' or 'subscription') after its parameters.

    Raises InvalidQosOverridesError for a value that is none, InvalidParameterTypeException for
    one of the wrong type.
    """
    if options is None:
        return qos
    suffix = '' if options.entity_id is None else f'_{options.entity_id}'
    for kind in options.policy_kinds:
        if kind == QoSPolicyKind.LIFESPAN and entity == 'subscription':
            continue
        policy = kind.name.lower()
        name = f'qos_overrides.{topic}.{entity}{suffix}.{policy}'
        if node.has_parameter(name):
            value = node.get_parameter(name).value
        else:
            descriptor = message_class('rcl_interfaces/msg/ParameterDescriptor')(
                description=f'{policy} for {entity} `{topic}` with id `{options.entity_id}`',
                read_only=True,
            )
            value = node.declare_parameter(name, _as_parameter(qos, kind), descriptor).value
        qos = replace(qos, **{policy: _of_parameter(name, kind, value)})
    if options.callback is not None:
        result = options.callback(qos)
        if not result.successful:
            raise InvalidQosOverridesError(
                f'The quality of service given for {entity} {topic} is refused: {result.reason}'
            )
    return qos


def _as_parameter(qos: QoSProfile, kind: QoSPolicyKind) -> str | int:
    value = getattr(qos, kind.name.lower())
    if kind in _ENUMS:
        return str(value.name.lower())
    return FOREVER if value is None else int(value)


def _of_parameter(name: str, kind: QoSPolicyKind, value: Any) -> Any:
    if kind in _ENUMS:
        known = _ENUMS[kind].__members__
        if value.upper() not in known:
            raise InvalidQosOverridesError(
                f'{name}={value!r} is none of {", ".join(known).lower()}'
            )
        return known[value.upper()]
    if value < 0:
        raise InvalidQosOverridesError(f'{name}={value} is negative')
    return None if kind == QoSPolicyKind.LIFESPAN and value == FOREVER else value


FOREVER = 2**63 - 1  # [ns], what rclpy makes of an infinite duration
