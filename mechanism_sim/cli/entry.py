"""The command line: `mechanism-sim`, or `python -m mechanism_sim`."""

from __future__ import annotations

import argparse
import errno
import os
import sys
from collections.abc import Sequence
from typing import Any

from mechanism_sim import ending
from mechanism_sim.catalogue import TABLE_FOLDERS
from mechanism_sim.cli import (
    bags,
    drawings,
    first,
    machines,
    network,
    pages,
    pictures,
    runs,
    studies,
    thesis,
    vibrations,
)
from mechanism_sim.cli.options import PRINTED, print_json
from mechanism_sim.cli.overview import VERBS, Overview, render_start
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.nodes.arguments import Parser, split_ros_args
from mechanism_sim.packages import refusal
from mechanism_sim.terminal import echo, print_error

_GONE = errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO


def main(args: Sequence[str] | None = None) -> None:
    """Run a command; exit code 0 done, 1 failed run, 2 bad input, 130 interrupted."""
    parser = make_parser()
    PRINTED.clear()
    given = sys.argv[1:] if args is None else list(args)
    if '_ARGCOMPLETE' in os.environ:
        from mechanism_sim.cli.completion import complete  # noqa: PLC0415

        complete(parser, parser.leaves())
    try:
        options = _read(parser, given)
        if folders := getattr(options, 'tables_from', None):  # for the processes it starts, too
            if lost := next((x for x in folders if not os.path.isdir(x)), None):
                raise InputError(f"--tables-from: there is no folder '{lost}'")
            allowed = [os.environ.get(TABLE_FOLDERS, ''), *map(os.path.abspath, folders)]
            os.environ[TABLE_FOLDERS] = os.pathsep.join(filter(None, allowed))
        with ending.working():
            code = options.run(options)
            sys.stdout.flush()
        sys.exit(code)
    except InputError as error:
        sys.exit(_report_failure(error, 2, given))
    except RunError as error:
        sys.exit(_report_failure(error, 1, given))
    except KeyboardInterrupt:
        sys.exit(ending.report_signal())
    except BrokenPipeError:
        # Whoever read our output has had enough; Python must not complain while closing it.
        _mute()
        sys.exit(0)
    except Exception as error:
        refused = refusal(error)
        if refused is not None:
            sys.exit(_report_failure(refused, 2, given))
        if not isinstance(error, OSError) or error.errno not in _GONE:
            raise
        _mute()
        where = f"'{error.filename}'" if error.filename else 'the output'
        sys.exit(print_error(RunError(f'{where} cannot be written: {error.strerror}'), 1))


def _mute() -> None:
    """Redirect an output that is closed: Python would write to it again at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _report_failure(error: Exception, code: int, args: Sequence[str]) -> int:
    """Print an error; as JSON, too, with `--json` if nothing is printed yet."""
    if '--json' in args and 'node' not in args[:1] and not PRINTED:
        print_json({'error': str(error), 'code': code})
        sys.stdout.flush()
    return print_error(error, code)


def make_parser() -> Overview:
    """The parser of all commands; `run` of what it reads is the command's function."""
    parser = Overview(
        prog='mechanism-sim',
        description='Simulator of real (loose, rattling, vibrating) planar machines.',
    )
    parser.add_argument('--version', action='store_true', help='print the version')
    parser.set_defaults(run=_start, parser=parser)
    places = {'': parser.add_subparsers(dest='command', metavar='COMMAND', parser_class=Parser)}

    def command(name: str, run: Any, text: str) -> argparse.ArgumentParser:
        group, _, verb = name.rpartition(' ')
        if group not in places:
            of = places[''].add_parser(group, help=VERBS[group], description=VERBS[group])
            places[group] = of.add_subparsers(
                dest='verb', metavar='VERB', required=True, parser_class=Parser
            )
        # A node has options of its own, and its own help.
        sub = places[group].add_parser(verb, help=text, description=text, add_help=name != 'node')
        sub.set_defaults(run=run, parser=sub)
        if name != 'node':
            sub.add_argument('--json', action='store_true', help='JSON to standard output')
        return sub

    for module in (
        first, machines, runs, network, bags, pages, pictures, drawings, studies, thesis,
        vibrations,
    ):  # fmt: skip
        module.add(command)
    return parser


def _read(parser: Parser, args: Sequence[str]) -> argparse.Namespace:
    own, ros_args = split_ros_args(args)
    options, rest = parser.parse_known_args(own)
    if ros_args and options.command not in ('run', 'node', 'view'):
        options.parser.error('--ros-args is for the commands run, node and view')
    several = 'words' if hasattr(options, 'words') else 'what' if options.command == 'plot' else ''
    if several and not any(word.startswith('-') for word in rest):  # argparse looks in one place
        setattr(options, several, [*getattr(options, several), *rest])
        rest = []
    if rest and options.command != 'node':
        options.parser.refuse(rest)
    options.rest, options.ros_args = rest, ros_args
    return options


def _start(options: argparse.Namespace) -> int:
    if options.version:
        from mechanism_sim.catalogue import installed_version  # noqa: PLC0415

        version = installed_version()
        print(f'mechanism-sim {version}' if version else 'mechanism-sim, not installed')
    else:
        echo(render_start())
    return 0
