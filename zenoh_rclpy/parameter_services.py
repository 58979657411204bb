"""The parameter services of a node, and ``/parameter_events``."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from ros_interfaces.classes import message_class, service_class, uint8_array
from zenoh_rclpy.clock import Clock
from zenoh_rclpy.errors import (
    InvalidParameterTypeException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from zenoh_rclpy.node_parameters import NodeParameters
from zenoh_rclpy.parameter import Parameter
from zenoh_rclpy.parameters import Listed, Parameters
from zenoh_rclpy.publisher import Publisher

Answer = Callable[[Any, Any], Any]


def parameter_services(node: NodeParameters) -> Iterator[tuple[type[Any], str, Answer]]:
    """The six services of ``rcl_interfaces``: class, private name, what answers."""
    answers: dict[str, Callable[[NodeParameters, Any, Any], Any]] = {
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

        yield service_class(f'rcl_interfaces/srv/{short}'), f'~/{words}', handle


def publish_events(parameters: Parameters, node: str, clock: Clock, publisher: Publisher) -> None:
    """Publish every change of the parameters of a node; `publisher` of ParameterEvent."""
    event = publisher.msg_type

    def publish(*kinds: Listed) -> None:
        new, changed, gone = ([p.to_parameter_msg() for p in listed] for listed in kinds)
        publisher.publish(
            event(
                stamp=clock.now().to_msg(),
                node=node,
                new_parameters=new,
                changed_parameters=changed,
                deleted_parameters=gone,
            )
        )

    parameters.publish = publish


# As in rclpy one name that is not declared makes the whole answer empty.


def _describe(node: NodeParameters, request: Any, response: Any) -> Any:
    if all(map(node.has_parameter, request.names)):
        response.descriptors = node.describe_parameters(request.names)
    return response


def _types(node: NodeParameters, request: Any, response: Any) -> Any:
    if all(map(node.has_parameter, request.names)):
        response.types = uint8_array(list(map(int, node.get_parameter_types(request.names))))
    return response


def _get(node: NodeParameters, request: Any, response: Any) -> Any:
    try:
        found = node.get_parameters(request.names)
    except (ParameterNotDeclaredException, ParameterUninitializedException):
        return response
    response.values = [parameter.get_parameter_value() for parameter in found]
    return response


def _list(node: NodeParameters, request: Any, response: Any) -> Any:
    response.result = node.list_parameters(request.prefixes, request.depth)
    return response


def _set(node: NodeParameters, request: Any, response: Any) -> Any:
    response.results = [_set_or_refuse(node, [message]) for message in request.parameters]
    return response


def _set_atomically(node: NodeParameters, request: Any, response: Any) -> Any:
    response.result = _set_or_refuse(node, request.parameters)
    return response


def _set_or_refuse(node: NodeParameters, messages: Iterable[Any]) -> Any:
    try:
        return node.set_parameters_atomically(map(Parameter.from_parameter_msg, messages))
    except (ParameterNotDeclaredException, InvalidParameterTypeException) as error:
        result = message_class('rcl_interfaces/msg/SetParametersResult')
        return result(successful=False, reason=str(error))
