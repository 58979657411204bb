"""The command line ``zros``: nodes, topics, parameters, services and actions of what runs.

The words are those of ``ros2``; every verb has ``--json`` and ``--timeout``.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from statistics import fmean, pstdev
from typing import TYPE_CHECKING, Any, NoReturn

from ros_interfaces.streams import mute_output

if TYPE_CHECKING:
    from zenoh_rclpy.command_node import CommandNode

Act = Callable[['CommandNode', argparse.Namespace], int | None]
"""Action of a verb on the network; returns its exit code if it is not 0."""

_SUCCEEDED = 4  # action_msgs/msg/GoalStatus
_LONGEST = 128  # elements of an array that are shown
_TOLD = 1.0  # [s] between lines of a rate


class Parser(argparse.ArgumentParser):
    """Says in one sentence what is wrong with a command line; takes no abbreviations."""

    def __init__(self, **more: Any) -> None:
        super().__init__(**more, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        """Refuse the command line: raises argparse.ArgumentTypeError."""
        context = self.prog.partition(' ')[2]
        raise argparse.ArgumentTypeError(f'{context}: {message}' if context else message)


def make_parser() -> argparse.ArgumentParser:
    """The parser; `act` of what it reads is what is to be done."""
    parser = Parser(
        prog='zros', description='Nodes, topics, parameters, services and actions of what runs.'
    )
    groups = parser.add_subparsers(dest='group', metavar='GROUP', required=True)
    common = Parser(add_help=False)
    common.add_argument('--json', action='store_true', help='JSON to standard output')
    common.add_argument(
        '--timeout', metavar='S', type=_positive,
        help='wait at most so long until what is asked for is there (default: 10.0); for '
        'answers and messages, without end unless it is given',
    )  # fmt: skip

    def group(name: str, text: str) -> Callable[..., argparse.ArgumentParser]:
        verbs = groups.add_parser(name, help=text, description=text).add_subparsers(
            dest='verb', metavar='VERB', required=True
        )

        def verb(name: str, act: Act, text: str, *words: str) -> argparse.ArgumentParser:
            sub = verbs.add_parser(name, help=text, description=text, parents=[common])
            sub.set_defaults(act=act)
            for word in words:
                optional = word.startswith('[')
                plain = word.strip('[]')
                count = '?' if optional else None
                sub.add_argument(plain.lower(), metavar=plain, nargs=count)
            return sub

        return verb

    verb = group('node', 'list and inspect nodes')
    verb('list', lambda n, o: _print_names(o, n.nodes()), 'nodes')
    verb('info', _node_info, 'topics and services of a node', 'NODE')
    _add_topic(group('topic', 'list, echo, inspect and publish on topics'))
    verb = group('param', 'list, get, set, describe and dump parameters')
    verb('list', _param_list, 'parameters of a node, or of all', '[NODE]')
    verb('get', _param_get, 'the value of a parameter', 'NODE', 'NAME')
    verb('describe', _param_describe, 'what a parameter is', 'NODE', 'NAME')
    verb('set', _param_set, 'give a parameter a value', 'NODE', 'NAME', 'VALUE')
    verb('dump', _param_dump, 'all values of a node, as a file for --params-file', 'NODE')
    verb = group('service', 'list and call services')
    _types(verb('list', lambda n, o: _list(o, n.services()), 'services'))
    verb('call', _call, "call a service with VALUES as '{steps: 100}'",
         'SERVICE', '[TYPE]', '[VALUES]')  # fmt: skip
    verb = group('action', 'list actions, and send them goals')
    verb('list', lambda n, o: _print_names(o, n.actions()), 'actions')
    sub = verb('send_goal', _send_goal, "send a goal with VALUES as '{steps: 10}'",
               'ACTION', 'TYPE', '[VALUES]')  # fmt: skip
    sub.add_argument('-f', '--feedback', action='store_true', help='print what comes meanwhile')
    return parser


def _add_topic(verb: Callable[..., argparse.ArgumentParser]) -> None:
    _types(verb('list', lambda n, o: _list(o, n.topics()), 'topics'))
    info = verb('info', _info, 'who publishes and subscribes', 'TOPIC')
    info.add_argument('-v', '--verbose', action='store_true', help='quality of service, too')
    verb('type', lambda n, o: _print_names(o, n.endpoints(o.topic).types), 'its type', 'TOPIC')
    echo = verb('echo', _echo, 'print messages of a topic', 'TOPIC', '[TYPE]')
    hz = verb('hz', _hz, 'how often messages come, each second until it is ended', 'TOPIC')
    bw = verb('bw', _bw, 'how many bytes come, each second until it is ended', 'TOPIC')
    pub = verb('pub', _pub, "publish VALUES as '{data: 0.5}'", 'TOPIC', 'TYPE', '[VALUES]')
    for sub in (echo, pub):
        only = sub.add_mutually_exclusive_group()
        only.add_argument(
            '--once', action='store_const', const=1, dest='count', help='one message'
        )
        only.add_argument('--count', metavar='N', type=_number, help='so many messages')
    for sub in (echo, hz, bw):
        sub.add_argument('--duration', metavar='S', type=float, help='end after so many seconds')
    echo.add_argument('--field', metavar='PATH', help="only this, as 'a.b' or 'position.0'")
    echo.add_argument(
        '--full', action='store_true', help=f'arrays whole, not their first {_LONGEST} elements'
    )
    for sub in (hz, bw):
        sub.add_argument(
            '--window', metavar='N', type=lambda text: _number(text, 2), default=10_000,
            help='figures of the last N messages (default: %(default)s)',
        )  # fmt: skip
    pub.add_argument('--rate', metavar='HZ', type=_positive, default=1.0, help='messages a second')


def _types(sub: argparse.ArgumentParser) -> None:
    sub.add_argument('-t', '--types', action='store_true', help='types, too')


def _positive(text: str) -> float:
    with suppress(ValueError):
        if (value := float(text)) > 0.0:
            return value
    raise argparse.ArgumentTypeError(f"'{text}' is no positive number")


def _number(text: str, least: int = 1) -> int:
    with suppress(ValueError):
        if (value := int(text)) >= least:
            return value
    raise argparse.ArgumentTypeError(f"'{text}' is not a number from {least} on")


def main(args: list[str] | None = None) -> int:
    """Run a command; exit code 0 done, 1 failed, 2 bad input, 130 interrupted."""
    given = sys.argv[1:] if args is None else args
    code, error = 0, ''
    try:
        code, error = _run(given)
        if error and '--json' in given and code != 130:
            _print_json({'error': error, 'code': code})
        sys.stdout.flush()
    except OSError as failure:
        mute_output()
        # A pipe is closed when whoever read it has had enough. What was wrong before is said.
        if not error and not isinstance(failure, BrokenPipeError):
            code, error = 1, f'the output cannot be written: {failure.strerror or failure}'
    if error:
        print(f'zros: {error}', file=sys.stderr, flush=True)
    return code


def _run(given: list[str]) -> tuple[int, str]:
    """Exit code of a command, and in one sentence what is wrong."""
    try:
        options = make_parser().parse_args(given)
        # not for --help
        from zenoh_rclpy.command_node import PATIENCE, command_node  # noqa: PLC0415

        with command_node(options.timeout or PATIENCE) as node:
            node.bounded = options.timeout is not None
            return int(options.act(node, options) or 0), ''
    except SystemExit as ended:  # after --help
        return int(ended.code or 0), ''
    except (ValueError, ImportError, argparse.ArgumentTypeError) as error:
        return 2, str(error)
    except KeyboardInterrupt:
        return 130, 'interrupted'
    except Exception as error:
        if type(error).__name__ == 'ExternalShutdownException':  # of rclpy, or of this package
            return 130, 'interrupted'
        if isinstance(error, RuntimeError):
            return 1, str(error)
        raise


# topics


def _list(options: argparse.Namespace, known: list[tuple[str, list[str]]]) -> None:
    if options.json:
        _print_json([{'name': name, 'types': types} for name, types in known])
        return
    for name, types in known:
        print(f'{name} [{", ".join(types)}]' if options.types else name)


def _info(node: CommandNode, options: argparse.Namespace) -> None:
    found = node.endpoints(options.topic)

    def named(info: Any) -> str:
        name = _full(info)
        return f'{name} ({_quality(info.qos_profile)})' if options.verbose else name

    def names(infos: list[Any]) -> list[str]:
        return sorted(map(named, infos))

    publishers, subscriptions = names(found.publishers), names(found.subscriptions)
    unfit = [
        f'{_full(sub)} asks for more {less} than {_full(pub)} offers: over DDS it hears nothing'
        for pub in found.publishers
        for sub in found.subscriptions
        if (less := _less(pub.qos_profile, sub.qos_profile))
    ]
    if options.json:
        about = {'name': found.name, 'types': found.types, 'unfit': unfit}
        _print_json({**about, 'publishers': publishers, 'subscriptions': subscriptions})
        return
    print(f'{found.name} [{", ".join(found.types)}]')
    print(f'  published by {", ".join(publishers) or "nobody"}')
    print(f'  subscribed by {", ".join(subscriptions) or "nobody"}')
    for said in unfit:
        print(f'  {said}')


def _full(info: Any) -> str:
    """Name of the node of an endpoint, with its namespace."""
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'


def _less(offered: Any, asked: Any) -> str:
    """Policies of which a publisher offers less than a subscription asks for; empty if none.

    Over Zenoh messages come all the same, but for those before a late subscription.
    """
    strong = {'reliability': 'RELIABLE', 'durability': 'TRANSIENT_LOCAL'}
    return ' and '.join(
        policy
        for policy, most in strong.items()
        if getattr(asked, policy).name == most != getattr(offered, policy).name
    )


def _quality(qos: Any) -> str:
    """A profile in words, as `keep_last 10`."""
    words = [policy.name.lower() for policy in (qos.reliability, qos.durability, qos.history)]
    return ', '.join(words) + (f' {qos.depth}' if words[2] == 'keep_last' else '')


def _echo(node: CommandNode, options: argparse.Namespace) -> None:
    from ros_interfaces.plain import field  # noqa: PLC0415

    end = None if options.duration is None else time.monotonic() + options.duration
    count = 0

    def heard(message: Any) -> bool:
        nonlocal count
        count += 1
        _print(options, field(message, options.field) if options.field else message, '---')
        return bool(count == options.count)

    wanted = (options.count or 1) if options.timeout else 0
    node.listen(options.topic, heard, options.type, end, wanted)


def _hz(node: CommandNode, options: argparse.Namespace) -> None:
    _watch(node, options, _rate)


def _bw(node: CommandNode, options: argparse.Namespace) -> None:
    _watch(node, options, _bandwidth)


def _watch(
    node: CommandNode,
    options: argparse.Namespace,
    figures: Callable[[list[float], list[int]], tuple[dict[str, float], str]],
) -> None:
    """Print figures of the times [s] and sizes of messages, each second and at the end."""
    end = None if options.duration is None else time.monotonic() + options.duration
    told = time.monotonic()
    arrivals: list[tuple[float, int]] = []

    def show() -> None:
        times, sizes = map(list, zip(*arrivals, strict=True))
        values, text = figures(times, sizes)
        if options.json:
            _print_json(values)
        else:
            print(text, flush=True)

    def over() -> bool:
        nonlocal told
        del arrivals[: -options.window]
        now = time.monotonic()
        ended = end is not None and now > end
        if now >= told + _TOLD and not options.json and not ended:
            if len(arrivals) > 1 and arrivals[-1][0] > told:
                show()
            else:
                print('no new messages', flush=True)
            told = now
        return ended

    try:
        node.arrivals(options.topic, arrivals, over, 2 if options.timeout else 0)
    finally:  # a signal does not lose what was measured
        if len(arrivals) > 1:
            show()
    if len(arrivals) < 2:
        count = 'no message' if not arrivals else 'one message'
        raise ValueError(f'{options.topic}: {count} came, which has no rate')


def _rate(times: list[float], _: list[int]) -> tuple[dict[str, float], str]:
    """Rate of messages: figures and a sentence."""
    gaps = [after - before for before, after in pairwise(times)]
    figures = {
        'rate': 1.0 / fmean(gaps), 'least': min(gaps), 'greatest': max(gaps),
        'deviation': pstdev(gaps), 'messages': float(len(times)),
    }  # fmt: skip
    return figures, (
        f'{figures["rate"]:.3f} messages a second; between them {min(gaps):.6f} to '
        f'{max(gaps):.6f} s, deviation {figures["deviation"]:.6f} s, of {len(times)} messages'
    )


def _bandwidth(times: list[float], sizes: list[int]) -> tuple[dict[str, float], str]:
    """Rate of bytes: figures and a sentence."""
    figures = {
        'rate': sum(sizes[1:]) / (times[-1] - times[0]), 'least': float(min(sizes)),
        'greatest': float(max(sizes)), 'mean': fmean(sizes), 'messages': float(len(sizes)),
    }  # fmt: skip
    return figures, (
        f'{figures["rate"]:.6g} bytes a second; messages of {min(sizes)} to {max(sizes)} bytes, '
        f'mean {figures["mean"]:.6g}, of {len(sizes)} messages'
    )


def _pub(node: CommandNode, options: argparse.Namespace) -> None:
    def show() -> None:
        topic = options.topic
        text = json.dumps({'published': topic}) if options.json else f'published on {topic}'
        print(text, flush=True)

    values = _values(options.values)
    node.publish(options.topic, options.type, values, options.count, options.rate, show)


# nodes and parameters


def _node_info(node: CommandNode, options: argparse.Namespace) -> None:
    found = node.of_node(options.node)
    if options.json:
        _print_json(
            {k: [{'name': n, 'types': types} for n, types in known] for k, known in found.items()}
        )
        return
    for kind, known in found.items():
        print(f'{kind}:')
        for name, types in known:
            print(f'  {name} [{", ".join(types)}]')


def _param_list(node: CommandNode, options: argparse.Namespace) -> None:
    names = [options.node] if options.node else node.nodes('list_parameters')
    found = {name: node.parameter_names(name) for name in names}
    if options.json:
        _print_json(found)
        return
    for name, parameters in found.items():
        if not options.node:
            print(f'{name}:')
        for parameter in parameters:
            print(f'{"" if options.node else "  "}{parameter}')


def _param_get(node: CommandNode, options: argparse.Namespace) -> None:
    from ros_interfaces.plain import to_plain  # noqa: PLC0415

    value = to_plain(node.parameter(options.node, options.name), finite=options.json)
    if options.json:
        _print_json(value)
    else:
        print(value)


def _param_describe(node: CommandNode, options: argparse.Namespace) -> None:
    _print(options, node.describe(options.node, options.name), '')


def _param_dump(node: CommandNode, options: argparse.Namespace) -> None:
    from ros_interfaces.plain import to_plain  # noqa: PLC0415
    from zenoh_rclpy.command_node import absolute  # noqa: PLC0415
    from zenoh_rclpy.parameter_files import write_parameters  # noqa: PLC0415

    found = node.parameters(options.node, node.parameter_names(options.node))
    values = {k: to_plain(v, finite=options.json) for k, v in found.items() if _is_in_files(v)}
    if options.json:
        _print_json(values)
    else:
        print(write_parameters(absolute(options.node), values), end='')


def _is_in_files(value: Any) -> bool:
    """False of what a file has no words for: not set, bytes, and arrays without a type."""
    if isinstance(value, str | int | float):
        return True
    return value is not None and len(value) > 0 and not isinstance(value[0], bytes)


def _param_set(node: CommandNode, options: argparse.Namespace) -> None:
    from zenoh_rclpy.parameter_files import parse_value  # noqa: PLC0415

    owner, name = options.node, options.name
    node.set_parameter(owner, name, _typed(options.value, parse_value))
    value = node.parameter(owner, name)
    if options.json:
        _print_json({'node': owner, 'parameter': name, 'value': value})
    else:
        print(f'{owner}: {name} = {value}')


# services and actions


def _call(node: CommandNode, options: argparse.Namespace) -> int:
    from zenoh_rclpy.command_node import refusal  # noqa: PLC0415

    kind, values = options.type, options.values
    if kind is not None and values is None and ('/' not in kind or kind.lstrip()[:1] == '{'):
        kind, values = None, kind  # the type may be left out
    answer = node.call(options.service, kind, _values(values))
    _print(options, answer, '')
    return 1 if refusal(answer) else 0


def _send_goal(node: CommandNode, options: argparse.Namespace) -> int:
    meanwhile = (lambda m: _print(options, m, '---')) if options.feedback else None
    values = _values(options.values)
    found = node.send_goal(options.action, options.type, values, meanwhile)
    _print(options, found.result, '')
    return 0 if found.status == _SUCCEEDED else 1


# values and output


def _values(text: str | None) -> Any:
    """A typed value, in the YAML of ROS; None if nothing was typed."""
    from zenoh_rclpy.parameter_files import parse  # noqa: PLC0415

    return None if text is None else _typed(text, parse)


def _typed(text: str, read: Callable[[str], Any]) -> Any:
    """A typed text, read so; errors name it."""
    try:
        return read(text)
    except ValueError as error:
        raise ValueError(f"'{text}': {error}") from error


def _print(options: argparse.Namespace, message: Any, mark: str) -> None:
    """A message or a part of one: as YAML, or as a line of JSON."""
    from ros_interfaces.plain import to_plain  # noqa: PLC0415

    if options.json:
        print(json.dumps(to_plain(message, finite=True), allow_nan=False), flush=True)
        return
    import yaml  # noqa: PLC0415

    plain = to_plain(message, None if getattr(options, 'full', False) else _LONGEST)
    dumped = yaml.safe_dump(plain, sort_keys=False, allow_unicode=True).removesuffix('...\n')
    text = f'{plain}\n' if isinstance(plain, str) else dumped  # as it is, such as a URDF
    print(f'{text}{mark}'.rstrip('\n'), flush=True)


def _print_names(options: argparse.Namespace, names: list[str]) -> None:
    if options.json:
        _print_json(names)
    elif names:
        print('\n'.join(names))


def _print_json(data: object) -> None:
    print(json.dumps(data, indent=2), flush=True)
