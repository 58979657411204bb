"""Parameters of a node: declared with a default, of one type for life, changed with consent.

Behaviour as in rclpy's ``node.py``.
"""

from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import dataclass
from math import isclose
from typing import Any

from ros_interfaces.classes import message_class
from zenoh_rclpy.errors import (
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from zenoh_rclpy.parameter import Parameter, ParameterKind

TOLERANCE = 1e-6  # relative, of values at the edges and on the steps of a range

Listed = list[Parameter]


@dataclass
class Declaration:
    """A parameter and its ``rcl_interfaces/msg/ParameterDescriptor``."""

    parameter: Parameter
    descriptor: Any


class Parameters:
    """The parameters of one node."""

    def __init__(self, node: str, overrides: Iterable[Parameter]) -> None:
        #: callbacks, newest first: may change what is set; accept or refuse; get what was set
        self.before: list[Callable[[Listed], Listed]] = []
        self.consents: list[Callable[[Listed], Any]] = []
        self.after: list[Callable[[Listed], Any]] = []
        #: called with new, changed and deleted parameters
        self.publish: Callable[[Listed, Listed, Listed], Any] = lambda *_: None
        self._node = node
        self._overrides = {parameter.name: parameter for parameter in overrides}
        self._declared: dict[str, Declaration] = {}

    def declare(
        self, name: str, value: Any, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter:
        """Declare a parameter; raises a ParameterException or ValueError if it is refused."""
        if not name:
            raise InvalidParameterException(f'{self._node}: a parameter has a name')
        if name in self._declared:
            raise ParameterAlreadyDeclaredException(f'{self._node} has declared {name!r} already')
        described = copy(descriptor or message_class('rcl_interfaces/msg/ParameterDescriptor')())
        typed = isinstance(value, ParameterKind)
        default = Parameter(name, value if typed else None, None if typed else value)
        described.name = name
        described.type = int(default.type_)
        if value is None and descriptor is None:
            described.dynamic_typing = True
        if default.type_ == ParameterKind.NOT_SET and (typed or not described.dynamic_typing):
            raise ValueError(f'{self._node}: {name} has neither a type nor a default')
        if typed and described.dynamic_typing:
            raise ValueError(f'{self._node}: {name} has a type, or one that may change; not both')
        if typed:
            default = Parameter(name)
        overridden = name in self._overrides and not ignore_override
        initial = self._overrides[name] if overridden else default
        missing = initial.type_ == ParameterKind.NOT_SET
        if not missing and (reason := _mismatch(initial, described)):
            raise InvalidParameterTypeException(f'{self._node}: {reason}')
        reason = _out_of_range(initial, described) or self._objection([initial])
        if reason:
            raise InvalidParameterValueException(f'{self._node}: {name}: {reason}')
        self._declared[name] = Declaration(initial, described)
        self._notify([initial], [initial], [], [])
        return initial

    def undeclare(self, name: str) -> None:
        """Forget a parameter; ParameterImmutableException if it is read-only."""
        if self.find(name).descriptor.read_only:
            raise ParameterImmutableException(f'{self._node}: {name} is read-only')
        del self._declared[name]

    def has(self, name: str) -> bool:
        """True if a parameter is declared."""
        return name in self._declared

    def names(self) -> list[str]:
        """Names of all, in the order of their declaration."""
        return list(self._declared)

    def get(self, name: str) -> Parameter:
        """A parameter; raises a ParameterException if it is not declared or has no value."""
        found = self.find(name)
        unset = found.parameter.type_ == ParameterKind.NOT_SET
        if unset and not found.descriptor.dynamic_typing:
            raise ParameterUninitializedException(f'{self._node}: {name} was given no value')
        return found.parameter

    def find(self, name: str) -> Declaration:
        """A parameter with its descriptor; raises ParameterNotDeclaredException."""
        if name not in self._declared:
            known = ', '.join(self._declared)
            raise ParameterNotDeclaredException(
                f'{self._node} has no parameter {name!r}; it has: {known}'
            )
        return self._declared[name]

    def set(self, parameters: Listed) -> Any:
        """Set all or none; a ``SetParametersResult`` that says why not.

        Raises ParameterNotDeclaredException.
        """
        result = message_class('rcl_interfaces/msg/SetParametersResult')
        if self.before:
            parameters = [made for change in self.before for made in change(parameters)]
            if not parameters:
                return result(successful=False, reason='No parameter is left to be set')
        for parameter in parameters:
            self.find(parameter.name)
        reason = next(filter(None, map(self._refusal, parameters)), '')
        reason = reason or self._objection(parameters)
        if reason:
            return result(successful=False, reason=reason)
        new: Listed = []
        changed: Listed = []
        gone: Listed = []
        for parameter in parameters:
            known = self._declared.get(parameter.name)
            if known is None:  # named twice, and gone
                continue
            if parameter.type_ == ParameterKind.NOT_SET:
                gone.append(parameter)
                del self._declared[parameter.name]
                continue
            fresh = known.parameter.type_ == ParameterKind.NOT_SET
            (new if fresh else changed).append(parameter)
            known.descriptor.type = int(parameter.type_)
            known.parameter = parameter
        self._notify(parameters, new, changed, gone)
        return result(successful=True)

    def _notify(self, parameters: Listed, new: Listed, changed: Listed, gone: Listed) -> None:
        self.publish(new, changed, gone)
        for follow in self.after:
            follow(parameters)

    def _objection(self, parameters: Listed) -> str:
        """Reason of the node against it; empty if it agrees."""
        for consent in self.consents:
            result = consent(parameters)
            if not result.successful:
                return str(result.reason) or 'refused without a reason'
        return ''

    def _refusal(self, parameter: Parameter) -> str:
        """Reason why the parameter cannot be set; empty if it can."""
        descriptor = self._declared[parameter.name].descriptor
        if descriptor.read_only:
            return f'{parameter.name} is read-only'
        return _mismatch(parameter, descriptor) or _out_of_range(parameter, descriptor)


def _mismatch(parameter: Parameter, descriptor: Any) -> str:
    kind = ParameterKind(descriptor.type)
    if descriptor.dynamic_typing or parameter.type_ == kind:
        return ''
    return f'{parameter.name}={parameter.value!r} is {parameter.type_.name}, not {kind.name}'


def _out_of_range(parameter: Parameter, descriptor: Any) -> str:
    whole = parameter.type_ == ParameterKind.INTEGER
    ranges = descriptor.integer_range if whole else descriptor.floating_point_range
    if parameter.type_ not in {ParameterKind.INTEGER, ParameterKind.DOUBLE} or not ranges:
        return ''
    low, high = sorted((ranges[0].from_value, ranges[0].to_value))
    step, value = ranges[0].step, parameter.value

    def same(one: float, other: float) -> bool:
        return one == other if whole else isclose(one, other, rel_tol=TOLERANCE)

    reason = ''
    if not (low < value < high or same(value, low) or same(value, high)):
        reason = f'{parameter.name}={value!r} is outside [{low}, {high}]'
    elif (
        step
        and not same(value, high)
        and not same(low + round((value - low) / step) * step, value)
    ):
        reason = f'{parameter.name}={value!r} is no step of {step} from {low} on'
    if reason and descriptor.additional_constraints:
        reason += f'; {descriptor.additional_constraints}'
    return reason
