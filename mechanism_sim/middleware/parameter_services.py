"""The parameter services of a node, and ``/parameter_events``."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from mechanism_sim.messages import message_class, service_class, uint8_array
from mechanism_sim.middleware.parameters import Parameter, Parameters
from mechanism_sim.middleware.qos import qos_profile_parameters

if TYPE_CHECKING:
    from mechanism_sim.middleware.node import Node

RECURSIVE = 0  # ListParameters.Request.DEPTH_RECURSIVE


def serve_parameters(node: 'Node', parameters: Parameters) -> None:
    """Serve the six services of ``rcl_interfaces`` and publish every change."""
    answers: dict[str, Callable[[Parameters, Any, Any], Any]] = {
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
            return answer(parameters, request, response)

        node.create_service(
            service_class(f'rcl_interfaces/srv/{short}'),
            f'~/{words}',
            handle,
            qos_profile=qos_profile_parameters,
        )
    _publish_events(node, parameters)


def _publish_events(node: 'Node', parameters: Parameters) -> None:
    event = message_class('rcl_interfaces/msg/ParameterEvent')
    publisher = node.create_publisher(event, '/parameter_events', qos_profile_parameters)
    known: set[str] = set()

    def publish(changed: list[Parameter]) -> None:
        fresh = [parameter for parameter in changed if parameter.name not in known]
        known.update(parameter.name for parameter in fresh)
        publisher.publish(
            event(
                stamp=node.get_clock().now().to_msg(),
                node=node.get_fully_qualified_name(),
                new_parameters=[parameter.to_parameter_msg() for parameter in fresh],
                changed_parameters=[
                    parameter.to_parameter_msg() for parameter in changed if parameter not in fresh
                ],
            )
        )

    parameters.add_post_set_callback(publish)


def _describe(parameters: Parameters, request: Any, response: Any) -> Any:
    empty = message_class('rcl_interfaces/msg/ParameterDescriptor')
    response.descriptors = [
        parameters.descriptor(name) if parameters.has(name) else empty(name=name)
        for name in request.names
    ]
    return response


def _types(parameters: Parameters, request: Any, response: Any) -> Any:
    response.types = uint8_array([int(_find(parameters, name).type_) for name in request.names])
    return response


def _get(parameters: Parameters, request: Any, response: Any) -> Any:
    found = [_find(parameters, name) for name in request.names]
    response.values = [parameter.get_parameter_value() for parameter in found]
    return response


def _list(parameters: Parameters, request: Any, response: Any) -> Any:
    names = [
        name
        for name in parameters.names()
        if any(_within(name, prefix, request.depth) for prefix in request.prefixes or [''])
    ]
    response.result.names = names
    response.result.prefixes = sorted({n.rpartition('.')[0] for n in names if '.' in n})
    return response


def _set(parameters: Parameters, request: Any, response: Any) -> Any:
    response.results = [
        parameters.set([Parameter.from_parameter_msg(message)]) for message in request.parameters
    ]
    return response


def _set_atomically(parameters: Parameters, request: Any, response: Any) -> Any:
    response.result = parameters.set(
        [Parameter.from_parameter_msg(message) for message in request.parameters]
    )
    return response


def _find(parameters: Parameters, name: str) -> Parameter:
    """The parameter, or one that is not set: what ROS answers for one it does not know."""
    return parameters.get(name) if parameters.has(name) else Parameter(name)


def _within(name: str, prefix: str, depth: int) -> bool:
    """Whether a dotted name is at or below a prefix, at most ``depth`` levels deep."""
    if prefix and name != prefix and not name.startswith(f'{prefix}.'):
        return False
    below = name[len(prefix) :].strip('.')
    return depth == RECURSIVE or below.count('.') < depth
