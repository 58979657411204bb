"""Classes of messages, and their CDR.

Without ROS a class is a dataclass with slots made from the definition. A numeric array field
holds a contiguous numpy array of the exact type: what is assigned is converted, not copied if it
is one already. Set ``ROS_PYTHON_CHECK_FIELDS=1`` to have every message checked for what ROS would
refuse before it is serialised.
"""

import os
from array import array
from collections.abc import Callable
from dataclasses import field, fields, make_dataclass
from functools import cache, partial
from importlib import import_module
from keyword import iskeyword
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError

from ros_interfaces.checks import refusals
from ros_interfaces.definitions import (
    MessageError,
    defaults,
    field_descriptions,
    type_name,
    typestore,
)
from ros_interfaces.origin import ros_installed

_CHECK_FIELDS = os.environ.get('ROS_PYTHON_CHECK_FIELDS') == '1'
_ZERO = {'string': '', 'bool': False, 'float32': 0.0, 'float64': 0.0}
_DTYPES = {'byte': 'uint8', 'char': 'uint8', 'bool': 'bool'}


class CheckedBytes(bytes):
    """CDR of a good message, written and judged in this process."""


@cache
def message_class(name: str) -> type[Any]:
    """Class of the message ``pkg/msg/Name``; of a service: ``pkg/srv/Name_Request``.

    Raises MessageError if there is no such message.
    """
    if ros_installed():
        return _ros_class(name)
    descriptions = field_descriptions(name)
    explicit = defaults(name)
    arrays: dict[str, np.dtype[Any]] = {}
    members = []
    for defined, description in descriptions:
        attribute = f'{defined}_' if iskeyword(defined) else defined
        dtype = _array_type(description)
        if dtype is not None:
            arrays[attribute] = dtype
        members.append((attribute, Any, _default(description, dtype, explicit.get(defined))))
    constants = {constant: value for constant, _, value in typestore().fielddefs[name][0]}
    namespace = {**constants, '__msgtype__': name, '__eq__': _equal, '__hash__': None}
    short = name.rpartition('/')[2]
    made = make_dataclass(short, members, namespace=namespace, eq=False, slots=True)
    made.__module__ = name.rpartition('/')[0].replace('/', '.')
    made.__doc__ = f'Message {name}.'
    for attribute, dtype in arrays.items():
        setattr(made, attribute, _array_property(getattr(made, attribute), attribute, dtype))
    typestore().types[name] = made
    return made


@cache
def service_class(name: str) -> type[Any]:
    """Class of the service ``pkg/srv/Name``, with the classes ``Request`` and ``Response``."""
    if ros_installed():
        return _ros_class(name)
    parts = {part: message_class(f'{name}_{part}') for part in ('Request', 'Response')}
    short = name.rpartition('/')[2]
    return type(short, (), {**parts, '__srvtype__': name, '__doc__': f'Service {name}.'})


@cache
def action_class(name: str) -> type[Any]:
    """Class of the action ``pkg/action/Name``: its ``Goal``, ``Result``, ``Feedback``.

    As in ROS its ``Impl`` has the classes of what goes over the wire.
    """
    if ros_installed():
        return _ros_class(name)
    short = name.rpartition('/')[2]
    wire = {
        'SendGoalService': service_class(f'{name}_SendGoal'),
        'GetResultService': service_class(f'{name}_GetResult'),
        'CancelGoalService': service_class('action_msgs/srv/CancelGoal'),
        'FeedbackMessage': message_class(f'{name}_FeedbackMessage'),
        'GoalStatusMessage': message_class('action_msgs/msg/GoalStatusArray'),
    }
    parts = {part: message_class(f'{name}_{part}') for part in ('Goal', 'Result', 'Feedback')}
    inner = type('Impl', (), {**wire, '__doc__': f'What the action {name} is made of.'})
    return type(
        short, (), {**parts, 'Impl': inner, '__actiontype__': name, '__doc__': f'Action {name}.'}
    )


def serialize(message: Any) -> bytes:
    """CDR of a message: header 00 01 00 00, then XCDR1 in little-endian order.

    Raises MessageError, naming the field, if a value does not fit its definition.
    """
    if ros_installed():
        return bytes(import_module('rclpy.serialization').serialize_message(message))
    if _CHECK_FIELDS and (found := list(refusals(message))):
        raise MessageError(f'ROS would refuse {message.__msgtype__}: {"; ".join(found)}')
    try:
        return bytes(typestore().serialize_cdr(message, message.__msgtype__, little_endian=True))
    except Exception as error:
        if found := list(refusals(message)):
            text = '; '.join(found)
            raise MessageError(f'{type_name(type(message))} does not serialise: {text}') from error
        raise


def deserialize(data: bytes | bytearray | memoryview, kind: type[Any] | str) -> Any:
    """Message of a class or type name from CDR; its numeric arrays are read-only.

    Raises MessageError if the bytes are not such a message.
    """
    cls = message_class(kind) if isinstance(kind, str) else kind
    try:
        if ros_installed():
            return import_module('rclpy.serialization').deserialize_message(bytes(data), cls)
        return typestore().deserialize_cdr(bytes(data), cls.__msgtype__)
    # Whoever sent them: rclpy has no exception of its own for bytes that are no message.
    except (SerdeError, ValueError, RuntimeError, OverflowError, MemoryError) as error:
        raise MessageError(f'{len(data)} bytes are no {type_name(cls)}: {error}') from error


def _typed_array(dtype: str, code: str, values: ArrayLike) -> Any:
    """Values of an array field, in the form the setters of the message classes take."""
    flat: NDArray[Any] = _flat(values, np.dtype(dtype))
    return array(code, flat.tobytes()) if ros_installed() else flat


def _flat(values: ArrayLike, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Values as a flat array of a type; what is one already is not touched."""
    if isinstance(values, np.ndarray) and values.ndim == 1 and values.dtype == dtype:
        return values if values.flags.c_contiguous else values.copy()
    return np.ascontiguousarray(values, dtype).reshape(-1)


float64_array = partial(_typed_array, 'float64', 'd')
int64_array = partial(_typed_array, 'int64', 'q')
uint64_array = partial(_typed_array, 'uint64', 'Q')
uint8_array = partial(_typed_array, 'uint8', 'B')


def _ros_class(name: str) -> type[Any]:
    package, kind, short = name.split('/')
    outer, _, part = short.partition('_')
    try:
        found = getattr(import_module(f'{package}.{kind}'), outer if part else short)
    except Exception as error:  # whatever a package that was built for another version raises
        raise MessageError(f'Message {name!r} is not installed: {error}') from error
    chosen: type[Any] = getattr(found, part) if part else found
    return chosen


def _array_type(description: Any) -> np.dtype[Any] | None:
    """Element type of a numeric array field, None for every other field."""
    kind, inner = description
    if kind not in {Nodetype.ARRAY, Nodetype.SEQUENCE} or inner[0][0] != Nodetype.BASE:
        return None
    base = inner[0][1][0]
    return None if base == 'string' else np.dtype(_DTYPES.get(base, base))


def _default(description: Any, dtype: np.dtype[Any] | None, explicit: Any) -> Any:
    """Dataclass field with the default that ROS gives it."""
    kind, inner = description
    if kind == Nodetype.BASE:
        return field(default=_ZERO.get(inner[0], 0) if explicit is None else explicit)
    if kind == Nodetype.NAME:
        return field(default_factory=message_class(inner))
    length = inner[1] if kind == Nodetype.ARRAY else 0
    if dtype is not None:
        start = np.zeros(length, dtype) if explicit is None else np.array(explicit, dtype)
        # An empty array has nothing to change, so that all may share one.
        return field(default_factory=start.copy if len(start) else lambda: start)
    if inner[0][0] == Nodetype.NAME:
        element = message_class(inner[0][1])
        return field(default_factory=lambda: [element() for _ in range(length)])
    texts = [''] * length if explicit is None else list(explicit)
    return field(default_factory=texts.copy)


def _array_property(slot: Any, name: str, dtype: np.dtype[Any]) -> property:
    """Property over a slot that turns what is assigned into a flat array of the exact type."""
    put: Callable[[Any, Any], None] = slot.__set__
    whole = dtype.kind in 'iu'

    def store(message: Any, values: ArrayLike) -> None:
        found = np.asarray(values)
        if whole and found.dtype.kind == 'f' and found.size:
            raise TypeError(f'{name} holds {dtype} values, not {found.dtype}')
        put(message, _flat(found, dtype))

    return property(slot.__get__, store)


def _equal(self: Any, other: Any) -> Any:
    if type(self) is not type(other):
        return NotImplemented
    pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
    return all(np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b for a, b in pairs)
