"""Topics, parameters, services, actions and bags of a run, with ROS and without."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from mechanism_sim.cli.options import Command, flag, option, print_json, refuse_options
from mechanism_sim.errors import InputError, nearest

if TYPE_CHECKING:
    from mechanism_sim.nodes.command_node import CommandNode

    Verb = Callable[[CommandNode, argparse.Namespace, list[str]], int]

_SUCCEEDED = 4  # action_msgs/msg/GoalStatus
_LONGEST = 128  # elements of an array that are shown


_OF_VERBS = {
    'types': ('list',),
    'once': ('echo', 'pub'),
    'count': ('echo', 'pub'),
    'field': ('echo',),
    'full': ('echo',),
    'duration': ('echo', 'hz'),
    'window': ('hz',),
    'rate': ('pub', 'play'),
    'feedback': ('send_goal',),
}
"""Verbs to which options apply that are not of all verbs of their command."""


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('topic', _topic, 'list, echo, inspect and publish on topics of what runs')
    _verbs(
        sub,
        "list; info, echo or hz TOPIC; pub TOPIC TYPE VALUES, with values as '{data: 0.5}'",
    )
    flag(sub, '--types', 'of list: types, too')
    flag(sub, '--once', 'of echo and pub: one message')
    option(sub, '--count', 'N', 'of echo and pub: so many messages', int)
    option(sub, '--field', 'PATH', "of echo: only this, as 'state.state' or 'position.0'")
    flag(sub, '--full', f'of echo: arrays whole, not their first {_LONGEST} elements')
    option(sub, '--rate', 'HZ', 'of pub: messages a second', 1.0)
    option(sub, '--duration', 'S', 'of echo and hz: end after so many seconds', float)
    option(sub, '--window', 'N', 'of hz: messages that count', 10_000)
    _patience(sub)
    sub = command('param', _param, 'list, get, set and describe parameters of what runs')
    _verbs(sub, 'list [NODE]; get or describe NODE NAME; set NODE NAME VALUE')
    _patience(sub)
    sub = command('service', _service, 'list and call services of what runs')
    _verbs(sub, "list; call SERVICE [TYPE] [VALUES], with values as '{steps: 100}'")
    flag(sub, '--types', 'of list: types, too')
    _patience(sub)
    sub = command('action', _action, 'list actions of what runs, and send them goals')
    _verbs(sub, "list; send_goal ACTION TYPE VALUES, with values as '{steps: 10}'")
    flag(sub, '-f --feedback', 'of send_goal: print what comes meanwhile')
    _patience(sub)
    sub = command('bag', _bag, 'replay a bag: publish what it holds, as its nodes did')
    _verbs(sub, 'play BAG')
    option(sub, '--rate', 'R', 'recorded seconds in a second; 0: as fast as possible', 1.0)
    option(sub, '--from', 'S', 'begin so long after the first message', 0.0)
    option(sub, '--delay', 'S', 'wait before the first message', 0.0)
    sub.add_argument(
        '--topics', nargs='+', action='extend', default=[], metavar='TOPIC', help='only these'
    )
    option(sub, '--clock', 'HZ', 'publish /clock, too, if the bag has none', float)
    _patience(sub)


def _verbs(sub: argparse.ArgumentParser, text: str) -> None:
    sub.add_argument('words', nargs='+', metavar='VERB', help=text)


def _patience(sub: argparse.ArgumentParser) -> None:
    option(sub, '--timeout', 'S', 'wait at most so long for what is asked for', 10.0)


def _run(options: argparse.Namespace, verbs: dict[str, tuple[int, int, str, Any]]) -> int:
    """Run a verb: least and most words after it, its form, and what does it."""
    name, *words = options.words
    if name not in verbs:
        raise InputError(
            f"{options.command} has no '{name}'{nearest(name, verbs)}; it has {', '.join(verbs)}"
        )
    least, most, form, act = verbs[name]
    if not least <= len(words) <= most:
        raise InputError(f'write {options.command} {name} {form}'.rstrip())
    for given, owners in _OF_VERBS.items():
        if given in vars(options) and name not in owners:
            own = ' and '.join(owner for owner in owners if owner in verbs)
            reason = f'does not apply to {options.command} {name}: it is of {own}'
            refuse_options(options, [given], reason)
    if not options.timeout > 0.0:
        raise InputError('--timeout must be positive')
    from mechanism_sim.nodes.command_node import command_node  # noqa: PLC0415

    with command_node(options.timeout) as node:
        return int(act(node, options, words) or 0)


def _topic(options: argparse.Namespace) -> int:
    if options.count is not None and options.count < 1:
        raise InputError('--count must be at least 1')
    if not options.rate > 0.0:
        raise InputError('--rate must be positive')
    if options.once:
        refuse_options(options, ['count'], 'and --once exclude each other: keep one')
    return _run(
        options,
        {
            'list': (0, 0, '', lambda n, o, _: _list(o, n.topics())),
            'info': (1, 1, 'TOPIC', _info),
            'echo': (1, 2, 'TOPIC [TYPE]', _echo),
            'hz': (1, 1, 'TOPIC', _hz),
            'pub': (2, 3, 'TOPIC TYPE [VALUES]', _pub),
        },
    )


def _param(options: argparse.Namespace) -> int:
    return _run(
        options,
        {
            'list': (0, 1, '[NODE]', _param_list),
            'get': (2, 2, 'NODE NAME', _param_get),
            'describe': (2, 2, 'NODE NAME', _param_describe),
            'set': (3, 3, 'NODE NAME VALUE', _param_set),
        },
    )


def _service(options: argparse.Namespace) -> int:
    return _run(
        options,
        {
            'list': (0, 0, '', lambda n, o, _: _list(o, n.services())),
            'call': (1, 3, 'SERVICE [TYPE] [VALUES]', _call),
        },
    )


def _action(options: argparse.Namespace) -> int:
    def listed(node: CommandNode, o: argparse.Namespace, _: list[str]) -> int:
        names = node.actions()
        if o.json:
            print_json(names)
        else:
            print('\n'.join(names))
        return 0

    return _run(
        options,
        {
            'list': (0, 0, '', listed),
            'send_goal': (2, 3, 'ACTION TYPE [VALUES]', _send_goal),
        },
    )


def _bag(options: argparse.Namespace) -> int:
    if options.rate < 0.0 or options.delay < 0.0:
        raise InputError('--rate and --delay must not be negative')
    return _run(options, {'play': (1, 1, 'BAG', _play)})


def _list(options: argparse.Namespace, known: list[tuple[str, list[str]]]) -> int:
    if options.json:
        print_json([{'name': name, 'types': types} for name, types in known])
        return 0
    for name, types in known:
        print(f'{name} [{", ".join(types)}]' if options.types else name)
    return 0


def _info(node: CommandNode, options: argparse.Namespace, words: list[str]) -> int:
    found = node.endpoints(words[0])

    def names(infos: list[Any]) -> list[str]:
        return sorted(f'{i.node_namespace.rstrip("/")}/{i.node_name}' for i in infos)

    publishers, subscriptions = names(found.publishers), names(found.subscriptions)
    if options.json:
        print_json(
            {
                'name': found.name,
                'types': found.types,
                'publishers': publishers,
                'subscriptions': subscriptions,
            }
        )
        return 0
    print(f'{found.name} [{", ".join(found.types)}]')
    print(f'  published by {", ".join(publishers) or "nobody"}')
    print(f'  subscribed by {", ".join(subscriptions) or "nobody"}')
    return 0


def _echo(node: CommandNode, options: argparse.Namespace, words: list[str]) -> int:
    from mechanism_sim.messages.plain import field  # noqa: PLC0415

    wanted = 1 if options.once else options.count
    end = None if options.duration is None else time.monotonic() + options.duration
    count = 0

    def heard(message: Any) -> bool:
        nonlocal count
        count += 1
        _print(options, field(message, options.field) if options.field else message, '---')
        return count == wanted

    node.listen(words[0], heard, words[1] if len(words) > 1 else None, end=end)
    return 0


def _hz(node: CommandNode, options: argparse.Namespace, words: list[str]) -> int:
    import numpy as np  # noqa: PLC0415

    end = None if options.duration is None else time.monotonic() + options.duration

    def over(times: list[float]) -> bool:
        del times[: -options.window]
        return end is not None and time.monotonic() > end

    times = node.rates(words[0], over)
    gaps = np.diff(times)
    if not len(gaps):
        raise InputError(f'{words[0]}: {len(times)} messages came, which have no rate')
    figures = {
        'rate': 1.0 / gaps.mean(), 'least': gaps.min(), 'greatest': gaps.max(),
        'deviation': gaps.std(), 'messages': len(times),
    }  # fmt: skip
    if options.json:
        print_json({k: float(v) for k, v in figures.items()})
    else:
        print(
            f'{figures["rate"]:.3f} messages a second; between them {gaps.min():.6f} to '
            f'{gaps.max():.6f} s, deviation {gaps.std():.6f} s, of {len(times)} messages'
        )
    return 0


def _pub(node: CommandNode, options: argparse.Namespace, words: list[str]) -> int:
    count = 1 if options.once else options.count

    def show() -> None:
        if not options.json:
            print(f'published on {words[0]}', flush=True)

    node.publish(words[0], words[1], _values(words[2:]), count or sys.maxsize, options.rate, show)
    return 0


def _param_list(node: CommandNode, options: argparse.Namespace, words: list[str]) -> int:
    names = words or node.nodes()
    found = {name: node.parameter_names(name) for name in names}
    if options.json:
        print_json(found)
        return 0
    for name, parameters in found.items():
        if not words:
            print(f'{name}:')
        for parameter in parameters:
            print(f'{"" if words else "  "}{parameter}')
    return 0


def _param_get(node: CommandNode, options: argparse.Namespace, words: list[str]) -> int:
    from mechanism_sim.messages.plain import to_plain  # noqa: PLC0415

    value = node.parameter(*words)
    if options.json:
        print_json(to_plain(value))
    else:
        print(to_plain(value))
    return 0


def _param_describe(node: CommandNode, options: argparse.Namespace, words: list[str]) -> int:
    _print(options, node.describe(*words), '')
    return 0


def _param_set(node: CommandNode, options: argparse.Namespace, words: list[str]) -> int:
    owner, name, text = words
    node.set_parameter(owner, name, _value(text))
    if options.json:
        print_json({'node': owner, 'parameter': name, 'value': node.parameter(owner, name)})
    else:
        print(f'{owner}: {name} = {node.parameter(owner, name)}')
    return 0


def _call(node: CommandNode, options: argparse.Namespace, words: list[str]) -> int:
    service, *rest = words
    kind = (
        rest.pop(0) if rest and '/' in rest[0] and not rest[0].lstrip().startswith('{') else None
    )
    from mechanism_sim.nodes.command_node import refusal  # noqa: PLC0415

    answer = node.call(service, kind, _values(rest))
    _print(options, answer, '')
    return 1 if refusal(answer) else 0


def _send_goal(node: CommandNode, options: argparse.Namespace, words: list[str]) -> int:
    action, kind, *rest = words
    meanwhile = (lambda m: _print(options, m, '---')) if options.feedback else None
    found = node.send_goal(action, kind, _values(rest), meanwhile)
    _print(options, found.result, '')
    return 0 if found.status == _SUCCEEDED else 1


def _play(node: CommandNode, options: argparse.Namespace, words: list[str]) -> int:
    from mechanism_sim.recording import read_bag  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415

    bag = read_bag(words[0])
    if not any(topic.count for topic in bag.topics.values()):
        raise InputError(f'{words[0]} holds nothing that can be played: it has no messages')
    time.sleep(options.delay)
    with progress.bar('play', (bag.end - bag.start) / 1e9, quiet=options.json) as show:
        count = node.play(
            bag, options.topics, options.rate, getattr(options, 'from'), options.clock, show
        )
    if options.json:
        print_json({'bag': words[0], 'messages': count})
    else:
        print(f'{count} messages of {words[0]} published')
    return 0


def _values(words: list[str]) -> Any:
    return _value(words[0]) if words else None


def _value(text: str) -> Any:
    from mechanism_sim import documents  # noqa: PLC0415

    try:
        return documents.parse(text)
    except documents.DocumentError as error:
        raise InputError(f"'{text}' is no YAML: {error}") from error


def _print(options: argparse.Namespace, message: Any, mark: str) -> None:
    """A message or a part of one: as YAML, or as a line of JSON."""
    from mechanism_sim import strict_json  # noqa: PLC0415
    from mechanism_sim.messages.plain import to_plain  # noqa: PLC0415

    if options.json:
        print(strict_json.dumps(strict_json.plain(to_plain(message))), flush=True)
        return
    import yaml  # noqa: PLC0415

    plain = to_plain(message, None if getattr(options, 'full', False) else _LONGEST)
    text = yaml.safe_dump(plain, sort_keys=False, allow_unicode=True).removesuffix('...\n')
    print(f'{text}{mark}'.rstrip('\n'), flush=True)
