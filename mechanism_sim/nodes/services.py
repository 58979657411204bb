"""Services of standard interfaces: registration at a node, and common parts of answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from mechanism_sim.messages import message_class, service_class
from mechanism_sim.nodes.middleware import Node

SIMULATION = 'simulation_interfaces'
"""The package of the standard."""

SLOPPY = 1e-3
"""Tolerance of the norm of a quaternion, as others write it with a few digits."""


def serve(
    node: Node, package: str, answers: Mapping[str, Callable[[Any, Any], Any]], **how: Any
) -> None:
    """Serve types of a package under their own names: ``GetState`` as ``get_state``.

    Parameters
    ----------
    answers : handlers by name, which may begin with ``~/``
    """
    for name, answer in answers.items():
        words = name.removeprefix('~/').split('_')
        kind = service_class(f'{package}/srv/{"".join(map(str.capitalize, words))}')
        node.create_service(kind, name, answer, **how)


def answered(response: Any, reason: str = '', code: int | None = None) -> Any:
    """A response of `SIMULATION` with its result: success without a reason."""
    result = message_class(f'{SIMULATION}/msg/Result')
    if code is None:
        code = result.RESULT_OPERATION_FAILED if reason else result.RESULT_OK
    response.result.result, response.result.error_message = code, reason
    return response


def uri_of(resource: Any, unsupported: int, missing: int) -> tuple[str, str, int | None]:
    """The scene of a resource; if there is none, the reason and its code.

    Parameters
    ----------
    unsupported, missing : codes for a text instead of a name, and for neither
    """
    if uri := resource.uri.removeprefix('file://'):
        return uri, '', None
    reason = 'uri must be the name of a scene or the path of a YAML file'
    return '', reason, unsupported if resource.resource_string else missing
