"""Arguments that ROS understands: what stands between ``--ros-args`` and ``--`` on a command line.

The meaning is that of ``rcl`` (``arguments.c``, ``remap.c``): ``-r from:=to``, ``-p name:=value``,
``--params-file``, ``--log-level``, ``--enable-`` and ``--disable-rosout-logs`` and
``-stdout-logs``; rules may be meant for one node only (``node:from:=to``).
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ros_interfaces import names
from zenoh_rclpy.errors import InvalidArgumentsError
from zenoh_rclpy.logger import LoggingSeverity
from zenoh_rclpy.parameter_files import parse_value, read_parameters

BEGIN, END = '--ros-args', '--'
ALL_NODES = '/**'
_REMAP = re.compile(r'(?:([A-Za-z_]\w*):(?![/=]))?((?:ros(?:topic|service)://)?[^:=]+):=(.+)')
_PARAMETER = re.compile(r'(?:([/\w]+):)?([^:=*]+):=(.*)', re.DOTALL)
_NODE = '__node', '__name'  # in rules for names of nodes
_LOGS = ('rosout-logs', 'stdout-logs', 'external-lib-logs')


class Remap(NamedTuple):
    """A rule for names: of one node if it is given."""

    node: str | None
    old: str
    new: str


@dataclass
class Arguments:
    """The ROS arguments of a command line, for the nodes of a process."""

    remaps: list[Remap] = field(default_factory=list)
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)  #: by pattern of nodes
    levels: dict[str, LoggingSeverity] = field(default_factory=dict)  #: by logger, '' for all
    logs: dict[str, bool] = field(default_factory=lambda: dict.fromkeys(_LOGS, True))

    def after(self, others: 'Arguments') -> 'Arguments':
        """Combine these arguments with others; these have priority."""
        parameters = {node: dict(values) for node, values in others.parameters.items()}
        for node, values in self.parameters.items():
            parameters.setdefault(node, {}).update(values)
        logs = {kind: self.logs[kind] and others.logs[kind] for kind in _LOGS}
        levels = others.levels | self.levels
        return Arguments(self.remaps + others.remaps, parameters, levels, logs)

    def node_name(self, name: str) -> str:
        """Name of a node after ``-r __node:=name``."""
        return self._special(_NODE, name) or name

    def namespace(self, node: str) -> str | None:
        """Namespace that ``-r __ns:=/namespace`` gives to a node."""
        return self._special(('__ns',), node)

    def remap(self, full: str, namespace: str, node: str, kind: str) -> str:
        """Full name of a ``kind`` ('topic' or 'service') after the rules."""
        for rule in self.remaps:
            scheme, separator, old = rule.old.rpartition('://')
            meant = not separator or scheme == f'ros{kind}'
            if rule.node not in {None, node} or not meant or old.startswith('__'):
                continue
            if names.resolve(old, namespace, node) == full:
                return names.resolve(rule.new, namespace, node)
        return full

    def parameters_of(self, full_name: str) -> dict[str, Any]:
        """Parameters of a node, by name."""
        found: dict[str, Any] = {}
        for pattern, values in self.parameters.items():
            # '/*' is any one name, '/**' any number of them.
            expression = re.escape(f'/{pattern.removeprefix("/")}')
            expression = expression.replace(r'/\*\*', r'(/\w+)*').replace(r'/\*', r'/\w+')
            if re.fullmatch(expression, full_name):
                found |= values
        return found

    def level(self, logger: str) -> LoggingSeverity:
        """Level of a logger: its own, that of the nearest above it, or that of all."""
        while logger and logger not in self.levels:
            logger = logger.rpartition('.')[0]
        return self.levels.get(logger, LoggingSeverity.INFO)

    def _special(self, olds: Iterable[str], node: str) -> str | None:
        rules = (r.new for r in self.remaps if r.old in olds and r.node in {None, node})
        return next(rules, None)


def remove_ros_args(args: Sequence[str]) -> list[str]:
    """A command line without the arguments of ROS; MiddlewareError if one of them is wrong."""
    parse_arguments(args)
    return [argument for argument, ros in _split(args) if not ros]


def parse_arguments(args: Iterable[str]) -> Arguments:
    """The arguments of ROS on a command line; MiddlewareError if one of them is wrong."""
    found = Arguments()
    rest = iter([argument for argument, ros in _split(args) if ros])
    for flag in rest:
        if flag in {BEGIN, END}:
            continue
        kind = flag.removeprefix('--enable-').removeprefix('--disable-')
        if kind in _LOGS:
            found.logs[kind] = flag.startswith('--enable-')
            continue
        if flag not in _READERS:
            raise InvalidArgumentsError(f'{BEGIN}: {flag!r} is none of {", ".join(_READERS)}')
        value = next(rest, None)
        if value is None:
            raise InvalidArgumentsError(f'{BEGIN}: after {flag} a value is missing')
        _READERS[flag](found, value)
    return found


def _split(args: Iterable[str]) -> Iterator[tuple[str, bool]]:
    """Every argument, and whether it is for ROS."""
    ros = False
    for argument in args:
        ros = ros or argument == BEGIN
        yield argument, ros
        ros = ros and argument != END


def _read_remap(found: Arguments, text: str) -> None:
    rule = _REMAP.fullmatch(text)
    if rule is None:
        raise InvalidArgumentsError(f'{BEGIN} -r {text}: a rule for names reads old:=new')
    remap = Remap(*rule.groups())
    try:
        if remap.old == '__ns':
            names.resolve_namespace(remap.new)
        elif remap.old in _NODE:
            names.check_node_name(remap.new)
        else:
            names.resolve(remap.new, '/', 'node')
    except names.InvalidNameError as error:
        raise InvalidArgumentsError(f'{BEGIN} -r {text}: {error}') from error
    found.remaps.append(remap)


def _read_parameter(found: Arguments, text: str) -> None:
    rule = _PARAMETER.fullmatch(text)
    if rule is None:
        raise InvalidArgumentsError(f'{BEGIN} -p {text}: a parameter is set by name:=value')
    node, name, value = rule.groups()
    try:
        parsed = parse_value(value)
    except ValueError as error:
        raise InvalidArgumentsError(f'{BEGIN} -p {text}: {error}') from error
    found.parameters.setdefault(node or ALL_NODES, {})[name] = parsed


def _read_file(found: Arguments, path: str) -> None:
    try:
        for node, values in read_parameters(path):
            found.parameters.setdefault(node, {}).update(values)
    except (OSError, ValueError) as error:
        raise InvalidArgumentsError(f'{BEGIN} --params-file {path}: {error}') from error


def _read_level(found: Arguments, text: str) -> None:
    logger, _, level = text.rpartition(':=')
    if level.upper() not in LoggingSeverity.__members__:
        known = ', '.join(LoggingSeverity.__members__).lower()
        raise InvalidArgumentsError(f'{BEGIN} --log-level {text}: {level!r} is none of {known}')
    found.levels[logger] = LoggingSeverity[level.upper()]


_READERS = {
    '-r': _read_remap,
    '--remap': _read_remap,
    '-p': _read_parameter,
    '--param': _read_parameter,
    '--params-file': _read_file,
    '--log-level': _read_level,
}
