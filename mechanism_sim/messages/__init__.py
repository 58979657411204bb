"""Message classes: those of ROS where it is installed, the same made from definitions elsewhere.

``from mechanism_sim.messages import Impact, JointState`` gives a class that is constructed by
keywords (``Impact(time=0.1, joint='a')``), has the constants of its definition as class attributes
and their defaults elsewhere. Any other message or service: ``message_class('pkg/msg/Name')``.

What nodes do the same way on both back ends: assign arrays through ``float64_array`` and its
sisters, read them through ``numpy.asarray``, treat received arrays as read-only, give ``byte``
fields the constants of their message only.
"""

from typing import Any

from mechanism_sim.messages.classes import (
    deserialize,
    float64_array,
    int64_array,
    message_class,
    serialize,
    service_class,
    type_name,
    uint8_array,
    uint64_array,
)
from mechanism_sim.messages.definitions import (
    OWN,
    PUBLIC,
    MessageError,
    define,
    define_service,
    definition,
    message_folder,
    own_messages,
    service_type_hash,
    type_hash,
)
from mechanism_sim.messages.origin import ros_installed
from mechanism_sim.messages.stamps import seconds, stamp

__all__ = [
    'MessageError',
    'define',
    'define_service',
    'definition',
    'deserialize',
    'float64_array',
    'int64_array',
    'message_class',
    'message_folder',
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
    """Message and service classes by their short names, made when first asked for."""
    package = PUBLIC.get(name)
    if package is None and name[:1].isupper() and name in own_messages():
        package = f'{OWN}/msg'
    if package is None:
        raise AttributeError(f'module {__name__!r} has no message {name!r}')
    make = service_class if package.endswith('/srv') else message_class
    value = globals()[name] = make(f'{package}/{name}')
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *PUBLIC, *own_messages()})
