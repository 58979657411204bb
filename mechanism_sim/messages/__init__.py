"""Message classes: those of ROS where it is installed, the same made from definitions elsewhere.

``from mechanism_sim.messages import Impact, JointState`` gives a class that is constructed by
keywords (``Impact(time=0.1, joint='a')``), has the constants of its definition as class attributes
and their defaults elsewhere. Any other message, service or action:
``message_class('pkg/msg/Name')``, ``service_class``, ``action_class``.

What nodes do the same way on both back ends: assign arrays through ``float64_array`` and its
sisters, read them through ``numpy.asarray``, treat received arrays as read-only, give ``byte``
fields the constants of their message only.
"""

from typing import Any

from mechanism_sim.messages import own
from mechanism_sim.messages.own import OWN, message_folder, own_messages
from ros_interfaces.checks import objection
from ros_interfaces.classes import (
    CheckedBytes,
    action_class,
    deserialize,
    float64_array,
    int64_array,
    message_class,
    serialize,
    service_class,
    uint8_array,
    uint64_array,
)
from ros_interfaces.definitions import (
    PUBLIC,
    MessageError,
    define,
    define_action,
    define_service,
    definition,
    service_type_hash,
    type_hash,
    type_name,
)
from ros_interfaces.origin import ros_installed
from ros_interfaces.stamps import seconds, stamp

own.add()

__all__ = [
    'CheckedBytes',
    'MessageError',
    'action_class',
    'define',
    'define_action',
    'define_service',
    'definition',
    'deserialize',
    'float64_array',
    'int64_array',
    'message_class',
    'message_folder',
    'objection',
    'own_messages',
    'ros_installed',
    'seconds',
    'serialize',
    'service_class',
    'service_type_hash',
    'stamp',
    'type_hash',
    'type_name',
    'uint8_array',
    'uint64_array',
]


def __getattr__(name: str) -> Any:
    """Message, service and action classes by their short names, made when first asked for."""
    package = PUBLIC.get(name)
    if package is None and name[:1].isupper() and name in own_messages():
        package = f'{OWN}/msg'
    if package is None:
        raise AttributeError(f'module {__name__!r} has no message {name!r}')
    makers = {'msg': message_class, 'srv': service_class, 'action': action_class}
    make = makers[package.rpartition('/')[2]]
    value = globals()[name] = make(f'{package}/{name}')
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *PUBLIC, *own_messages()})
