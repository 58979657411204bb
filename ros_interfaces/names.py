"""Names of nodes, topics and services, resolved as ROS does.

Source: the design article "Topic and Service Names" (design.ros2.org).
"""

import re

_TOKEN = re.compile(r'[A-Za-z_]\w*', re.ASCII)


class InvalidNameError(ValueError):
    """A name is not a ROS name."""


def resolve_namespace(namespace: str) -> str:
    """Namespace with a leading slash and none at its end; '/' for the root."""
    parts = [part for part in namespace.split('/') if part]
    for part in parts:
        _check(part, namespace, 'namespace')
    return '/' + '/'.join(parts)


def check_node_name(name: str) -> str:
    """The name itself, if it is one of a node."""
    _check(name, name, 'node name')
    return name


def full_node_name(namespace: str, node: str) -> str:
    """'/ns/node', or '/node' in the root."""
    return f'{namespace.rstrip("/")}/{node}'


def resolve(name: str, namespace: str, node: str) -> str:
    """Fully qualified name of a topic or service, given relative, absolute or private ('~')."""
    if name == '~' or name.startswith('~/'):
        full = full_node_name(namespace, node) + name[1:]
    elif name.startswith('/'):
        full = name
    else:
        full = f'{namespace.rstrip("/")}/{name}'
    for part in full.split('/')[1:]:
        _check(part, name, 'topic or service name')
    return full


def _check(part: str, name: str, kind: str) -> None:
    if not _TOKEN.fullmatch(part):
        raise InvalidNameError(
            f'{name!r} is no {kind}: between slashes stand letters, digits and underscores,'
            ' no digit first'
        )
