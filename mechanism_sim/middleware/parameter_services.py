"""The parameter services of a node, and ``/parameter_events``."""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from mechanism_sim.messages import message_class, service_class, uint8_array
from mechanism_sim.middleware.errors import (
    InvalidParameterTypeException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from mechanism_sim.middleware.parameter import Parameter
from mechanism_sim.middleware.parameters import Listed, Parameters
from mechanism_sim.middleware.qos import qos_profile_parameters

if TYPE_CHECKING:
    from mechanism_sim.middleware.node import Node


def serve_parameters(node: 'Node') -> None:
    """Serve the six services of ``rcl_interfaces``."""
    answers: dict[str, Callable[[Node, Any, Any], Any]] = {
        'DescribeParameters': _describe,
        'GetParameterTypes': _types,
        'GetParameters': _get,
        'ListParameters': _list,
        'SetParameters': _set,
        'SetParametersAtomically': _set_atomically,
    }
    for short, answer in answers.items():
        words = ''.join('_' + c.lower() if c.isupper() else c for c in short).lstrip('_')

        def handle(request: Any, response: Any, answer: Any = answer) -> Any:
            return answer(node, request, response)

        node.create_service(
            service_class(f'rcl_interfaces/srv/{short}'),
            f'~/{words}',
            handle,
            qos_profile=qos_profile_parameters,
        )


def publish_events(node: 'Node', parameters: Parameters) -> None:
    """Publish every change on ``/parameter_events``."""
    event = message_class('rcl_interfaces/msg/ParameterEvent')
    publisher = node.create_publisher(event, '/parameter_events', qos_profile_parameters)

    def publish(*kinds: Listed) -> None:
        new, changed, gone = ([p.to_parameter_msg() for p in listed] for listed in kinds)
        publisher.publish(
            event(
                stamp=node.get_clock().now().to_msg(),
                node=node.get_fully_qualified_name(),
                new_parameters=new,
                changed_parameters=changed,
                deleted_parameters=gone,
            )
        )

    parameters.publish = publish


# As in rclpy one name that is not declared makes the whole answer empty.


def _describe(node: 'Node', request: Any, response: Any) -> Any:
    if all(map(node.has_parameter, request.names)):
        response.descriptors = node.describe_parameters(request.names)
    return response


def _types(node: 'Node', request: Any, response: Any) -> Any:
    if all(map(node.has_parameter, request.names)):
        response.types = uint8_array(list(map(int, node.get_parameter_types(request.names))))
    return response


def _get(node: 'Node', request: Any, response: Any) -> Any:
    try:
        found = node.get_parameters(request.names)
    except (ParameterNotDeclaredException, ParameterUninitializedException):
        return response
    response.values = [parameter.get_parameter_value() for parameter in found]
    return response


def _list(node: 'Node', request: Any, response: Any) -> Any:
    response.result = node.list_parameters(request.prefixes, request.depth)
    return response


def _set(node: 'Node', request: Any, response: Any) -> Any:
    response.results = [_set_or_refuse(node, [message]) for message in request.parameters]
    return response


def _set_atomically(node: 'Node', request: Any, response: Any) -> Any:
    response.result = _set_or_refuse(node, request.parameters)
    return response


def _set_or_refuse(node: 'Node', messages: Iterable[Any]) -> Any:
    try:
        return node.set_parameters_atomically(map(Parameter.from_parameter_msg, messages))
    except (ParameterNotDeclaredException, InvalidParameterTypeException) as error:
        result = message_class('rcl_interfaces/msg/SetParametersResult')
        return result(successful=False, reason=str(error))
