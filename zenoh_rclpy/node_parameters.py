"""Parameters of a node: the surface of rclpy."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from ros_interfaces.classes import message_class
from zenoh_rclpy.parameter import Parameter, ParameterKind
from zenoh_rclpy.parameters import Parameters

RECURSIVE = 0  # ListParameters.Request.DEPTH_RECURSIVE

Listed = list[Parameter]


class NodeParameters:
    """Parameters of a node.

    What is not declared raises ParameterNotDeclaredException; what is refused when it is set is
    told in a ``rcl_interfaces/msg/SetParametersResult`` with a reason.
    """

    _parameters: Parameters

    def declare_parameter(
        self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter:
        """Declare a parameter with its default, or its type; overrides replace the default.

        Raises ParameterAlreadyDeclaredException, InvalidParameterTypeException or
        InvalidParameterValueException.
        """
        return self._parameters.declare(name, value, descriptor, ignore_override)

    def declare_parameters(
        self,
        namespace: str,
        parameters: Sequence[tuple[Any, ...]],
        ignore_override: bool = False,
    ) -> Listed:
        """Declare parameters given as (name,), (name, value) or (name, value, descriptor)."""
        prefix = f'{namespace}.' if namespace else ''
        return [
            self.declare_parameter(prefix + name, value, descriptor, ignore_override)
            for name, value, descriptor, *_ in ((*given, None, None) for given in parameters)
        ]

    def undeclare_parameter(self, name: str) -> None:
        """Forget a parameter; ParameterImmutableException if it is read-only."""
        self._parameters.undeclare(name)

    def has_parameter(self, name: str) -> bool:
        """True if the parameter is declared."""
        return self._parameters.has(name)

    def get_parameter(self, name: str) -> Parameter:
        """A parameter; ParameterUninitializedException if it has a type but no value."""
        return self._parameters.get(name)

    def get_parameters(self, names: Iterable[str]) -> Listed:
        """Several parameters."""
        return [self._parameters.get(name) for name in names]

    def get_parameter_or(self, name: str, alternative_value: Parameter | None = None) -> Parameter:
        """A parameter, or an alternative if it is not declared or has no value."""
        if self.has_parameter(name):
            found = self._parameters.find(name).parameter
            if found.type_ != ParameterKind.NOT_SET:
                return found
        return alternative_value or Parameter(name)

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Any]:
        """Parameters below a prefix, by the rest of their names."""
        start = f'{prefix}.' if prefix else ''
        return {
            name.removeprefix(start): self._parameters.find(name).parameter
            for name in self._parameters.names()
            if name.startswith(start)
        }

    def get_parameter_type(self, name: str) -> ParameterKind:
        """Type of a parameter."""
        return self._parameters.find(name).parameter.type_

    def get_parameter_types(self, names: Iterable[str]) -> list[ParameterKind]:
        """Types of several parameters."""
        return [self.get_parameter_type(name) for name in names]

    def describe_parameter(self, name: str) -> Any:
        """``rcl_interfaces/msg/ParameterDescriptor`` of a parameter."""
        return self._parameters.find(name).descriptor

    def describe_parameters(self, names: Iterable[str]) -> list[Any]:
        """Descriptors of several parameters."""
        return [self.describe_parameter(name) for name in names]

    def list_parameters(self, prefixes: Sequence[str], depth: int) -> Any:
        """``ListParametersResult``: what is at or below prefixes, at most so deep (0: at all)."""
        names = [
            name
            for name in self._parameters.names()
            if any(_within(name, prefix, depth) for prefix in prefixes or [''])
        ]
        above = dict.fromkeys(name.rpartition('.')[0] for name in names if '.' in name)
        result = message_class('rcl_interfaces/msg/ListParametersResult')
        return result(names=names, prefixes=list(above))

    def set_parameters(self, parameter_list: Iterable[Parameter]) -> list[Any]:
        """Set parameters one by one; a result for each."""
        return [self._parameters.set([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(self, parameter_list: Iterable[Parameter]) -> Any:
        """Set all of the parameters or none."""
        return self._parameters.set(list(parameter_list))

    def add_pre_set_parameters_callback(self, callback: Callable[[Listed], Listed]) -> None:
        """Change what is to be set: the callback gives back the parameters to set instead."""
        self._parameters.before.insert(0, callback)

    def add_on_set_parameters_callback(self, callback: Callable[[Listed], Any]) -> None:
        """Add a callback that accepts or refuses: it returns a SetParametersResult."""
        self._parameters.consents.insert(0, callback)

    def add_post_set_parameters_callback(self, callback: Callable[[Listed], Any]) -> None:
        """Add a callback that gets the parameters that were set."""
        self._parameters.after.insert(0, callback)

    def remove_pre_set_parameters_callback(self, callback: Callable[[Listed], Listed]) -> None:
        """Remove a callback; ValueError if it was not added."""
        self._parameters.before.remove(callback)

    def remove_on_set_parameters_callback(self, callback: Callable[[Listed], Any]) -> None:
        """Remove a callback; ValueError if it was not added."""
        self._parameters.consents.remove(callback)

    def remove_post_set_parameters_callback(self, callback: Callable[[Listed], Any]) -> None:
        """Remove a callback; ValueError if it was not added."""
        self._parameters.after.remove(callback)


def _within(name: str, prefix: str, depth: int) -> bool:
    """True if a dotted name is at or below a prefix, at most ``depth`` levels deep."""
    if prefix and name != prefix and not name.startswith(f'{prefix}.'):
        return False
    below = name[len(prefix) :].strip('.')
    return depth == RECURSIVE or below.count('.') < depth
