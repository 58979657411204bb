"""Parameters of a node: declared with a default, of one type for life, changed with consent."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from mechanism_sim.messages import float64_array, int64_array, message_class
from mechanism_sim.middleware.errors import (
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterNotDeclaredException,
)


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
            kinds = {type(item) for item in value}
            if len(kinds) == 1 and (kind := kinds.pop()) in _ARRAYS:
                return _ARRAYS[kind]
            if not kinds:
                return cls.BYTE_ARRAY  # what rclpy takes an empty list for
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
        """Parameter of a ``rcl_interfaces/msg/Parameter``."""
        kind = ParameterKind(message.value.type)
        if kind == ParameterKind.NOT_SET:
            return cls(message.name)
        value = getattr(message.value, _FIELDS[kind][0])
        if kind == ParameterKind.BYTE_ARRAY:
            value = [bytes([item]) for item in value]
        elif kind >= ParameterKind.BYTE_ARRAY:
            value = value.tolist() if isinstance(value, np.ndarray) else list(value)
        return cls(message.name, kind, value)


@dataclass
class _Declared:
    parameter: Parameter
    descriptor: Any


class Parameters:
    """The parameters of one node."""

    def __init__(self, node: str, overrides: Iterable[Parameter]) -> None:
        self._node = node
        self._overrides = {parameter.name: parameter for parameter in overrides}
        self._declared: dict[str, _Declared] = {}
        self._consents: list[Callable[[list[Parameter]], Any]] = []
        self._followers: list[Callable[[list[Parameter]], Any]] = []
        self._remarks: list[str] = []  # of those who consented last

    def declare(self, name: str, value: Any, descriptor: Any) -> Parameter:
        """Declare a parameter; raises InvalidParameterValueException if its value is refused."""
        if name in self._declared:
            raise ParameterAlreadyDeclaredException(f'{self._node} has declared {name!r} already')
        described = descriptor or message_class('rcl_interfaces/msg/ParameterDescriptor')()
        typed = isinstance(value, ParameterKind)
        default = Parameter(name, value if typed else None, None if typed else value)
        described.name = name
        described.type = int(default.type_)
        if default.type_ == ParameterKind.NOT_SET:
            described.dynamic_typing = True
        initial = self._overrides.get(name, default)
        declared = self._declared[name] = _Declared(default, described)
        reason = self._refusal([initial], declaring=True)
        if reason:
            del self._declared[name]
            raise InvalidParameterValueException(f'{self._node}: {name}: {reason}')
        declared.parameter = initial
        self._tell([initial])
        return initial

    def has(self, name: str) -> bool:
        """Whether a parameter is declared."""
        return name in self._declared

    def names(self) -> list[str]:
        """Names of all, in the order of their declaration."""
        return list(self._declared)

    def get(self, name: str) -> Parameter:
        """A parameter; raises ParameterNotDeclaredException."""
        return self._find(name).parameter

    def descriptor(self, name: str) -> Any:
        """``rcl_interfaces/msg/ParameterDescriptor``; raises ParameterNotDeclaredException."""
        return self._find(name).descriptor

    def set(self, parameters: list[Parameter]) -> Any:
        """Set all or none; a ``SetParametersResult`` that says why not."""
        reason, remarks = self._refusal(parameters), list(self._remarks)
        if not reason:
            for parameter in parameters:
                self._declared[parameter.name].parameter = parameter
            self._tell(parameters)
        result = message_class('rcl_interfaces/msg/SetParametersResult')
        return result(successful=not reason, reason=reason or '; '.join(remarks))

    def add_on_set_callback(self, callback: Callable[[list[Parameter]], Any]) -> None:
        """Ask before a change."""
        self._consents.insert(0, callback)

    def add_post_set_callback(self, callback: Callable[[list[Parameter]], Any]) -> None:
        """Tell after a change."""
        self._followers.append(callback)

    def _find(self, name: str) -> _Declared:
        if name not in self._declared:
            known = ', '.join(self._declared)
            raise ParameterNotDeclaredException(
                f'{self._node} has no parameter {name!r}; it has: {known}'
            )
        return self._declared[name]

    def _tell(self, parameters: list[Parameter]) -> None:
        for follow in self._followers:
            follow(parameters)

    def _refusal(self, parameters: list[Parameter], *, declaring: bool = False) -> str:
        """Why the parameters cannot be set; empty if they can."""
        for parameter in parameters:
            if parameter.name not in self._declared:
                return f'{self._node} has no parameter {parameter.name!r}'
            descriptor = self._declared[parameter.name].descriptor
            if descriptor.read_only and not declaring:
                return f'{parameter.name} is read-only'
            reason = _mismatch(parameter, descriptor) or _out_of_range(parameter, descriptor)
            if reason:
                return reason
        self._remarks.clear()
        for consent in self._consents:
            result = consent(parameters)
            if not result.successful:
                return str(result.reason) or 'refused without a reason'
            self._remarks += [result.reason] if result.reason else []
        return ''


def _mismatch(parameter: Parameter, descriptor: Any) -> str:
    kind = ParameterKind(descriptor.type)
    if descriptor.dynamic_typing or parameter.type_ == kind:
        return ''
    return f'{parameter.name}={parameter.value!r} is {parameter.type_.name}, not {kind.name}'


def _out_of_range(parameter: Parameter, descriptor: Any) -> str:
    ranges = {
        ParameterKind.INTEGER: descriptor.integer_range,
        ParameterKind.DOUBLE: descriptor.floating_point_range,
    }.get(parameter.type_, ())
    for allowed in ranges:
        if not allowed.from_value <= parameter.value <= allowed.to_value:
            return (
                f'{parameter.name}={parameter.value!r} is outside'
                f' [{allowed.from_value}, {allowed.to_value}]'
            )
    return ''
