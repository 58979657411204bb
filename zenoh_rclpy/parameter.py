"""Parameters: a name, a type and a value."""

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Any

import numpy as np

from ros_interfaces.classes import float64_array, int64_array, message_class
from zenoh_rclpy.errors import InvalidParameterTypeException


class ParameterKind(IntEnum):
    """Types of parameters; the numbers are those of ``rcl_interfaces/msg/ParameterType``."""

    NOT_SET = 0
    BOOL = 1
    INTEGER = 2
    DOUBLE = 3
    STRING = 4
    BYTE_ARRAY = 5
    BOOL_ARRAY = 6
    INTEGER_ARRAY = 7
    DOUBLE_ARRAY = 8
    STRING_ARRAY = 9

    @classmethod
    def from_parameter_value(cls, value: Any) -> 'ParameterKind':
        """Type of a Python value; TypeError if a parameter cannot hold it."""
        if value is None:
            return cls.NOT_SET
        if type(value) in _SCALARS:
            return _SCALARS[type(value)]
        if isinstance(value, Sequence):
            if not value:
                return cls.BYTE_ARRAY  # what rclpy takes an empty list for
            kinds = {type(item) for item in value}
            if len(kinds) == 1 and (kind := kinds.pop()) in _ARRAYS:
                return _ARRAYS[kind]
        raise TypeError(f'A parameter cannot hold {value!r}')


_SCALARS = {
    bool: ParameterKind.BOOL,
    int: ParameterKind.INTEGER,
    float: ParameterKind.DOUBLE,
    str: ParameterKind.STRING,
}
_ARRAYS = {
    bytes: ParameterKind.BYTE_ARRAY,
    bool: ParameterKind.BOOL_ARRAY,
    int: ParameterKind.INTEGER_ARRAY,
    float: ParameterKind.DOUBLE_ARRAY,
    str: ParameterKind.STRING_ARRAY,
}
# Field of ParameterValue, and how its value becomes the field's; by type.
_FIELDS: dict[ParameterKind, tuple[str, Callable[[Any], Any]]] = {
    ParameterKind.BOOL: ('bool_value', bool),
    ParameterKind.INTEGER: ('integer_value', int),
    ParameterKind.DOUBLE: ('double_value', float),
    ParameterKind.STRING: ('string_value', str),
    ParameterKind.BYTE_ARRAY: (
        'byte_array_value',
        lambda value: np.frombuffer(b''.join(value), 'B'),
    ),
    ParameterKind.BOOL_ARRAY: ('bool_array_value', list),
    ParameterKind.INTEGER_ARRAY: ('integer_array_value', int64_array),
    ParameterKind.DOUBLE_ARRAY: ('double_array_value', float64_array),
    ParameterKind.STRING_ARRAY: ('string_array_value', list),
}


class Parameter:
    """A name with a value; ``type_`` follows from the value unless it is given."""

    Type = ParameterKind

    def __init__(self, name: str, type_: ParameterKind | None = None, value: Any = None) -> None:
        found = ParameterKind.from_parameter_value(value)
        empty = isinstance(value, Sequence) and not value and not isinstance(value, str)
        if type_ is not None and type_ != found and value is not None and not empty:
            raise ValueError(f'{name}={value!r} is {found.name}, not {type_.name}')
        self.name = name
        self.type_ = found if type_ is None else type_
        self.value = value

    def __repr__(self) -> str:
        return f'Parameter({self.name!r}, {self.type_.name}, {self.value!r})'

    def get_parameter_value(self) -> Any:
        """``rcl_interfaces/msg/ParameterValue``."""
        message = message_class('rcl_interfaces/msg/ParameterValue')(type=int(self.type_))
        if self.value is not None:
            field, convert = _FIELDS[self.type_]
            setattr(message, field, convert(self.value))
        return message

    def to_parameter_msg(self) -> Any:
        """``rcl_interfaces/msg/Parameter``."""
        value = self.get_parameter_value()
        return message_class('rcl_interfaces/msg/Parameter')(name=self.name, value=value)

    @classmethod
    def from_parameter_msg(cls, message: Any) -> 'Parameter':
        """Parameter of a ``rcl_interfaces/msg/Parameter``.

        Raises InvalidParameterTypeException if it is of a type that there is not.
        """
        try:
            kind = ParameterKind(message.value.type)
        except ValueError:
            reason = f'{message.name}: there is no type {message.value.type} of parameters'
            raise InvalidParameterTypeException(reason) from None
        if kind == ParameterKind.NOT_SET:
            return cls(message.name)
        value = getattr(message.value, _FIELDS[kind][0])
        if kind == ParameterKind.BYTE_ARRAY:
            value = [bytes([item]) for item in value]
        elif kind >= ParameterKind.BYTE_ARRAY:
            value = value.tolist() if isinstance(value, np.ndarray) else list(value)
        return cls(message.name, kind, value)
