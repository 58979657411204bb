"""The command line: `mechanism-sim`, or `python -m mechanism_sim`."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from functools import cache
from typing import Any

from mechanism_sim.catalogue import TABLE_FOLDERS
from mechanism_sim.cli import (
    bags,
    drawings,
    first,
    lives,
    machines,
    pages,
    pictures,
    responses,
    runs,
    studies,
    thesis,
    vibrations,
)
from mechanism_sim.cli.outcome import carry_out
from mechanism_sim.cli.overview import VERBS, Overview, render_start
from mechanism_sim.errors import InputError
from mechanism_sim.nodes.arguments import Parser, split_ros_args
from mechanism_sim.terminal import echo


def main(args: Sequence[str] | None = None) -> None:
    """Run a command; exit code 0 done, 1 failed run, 2 bad input, 130 interrupted."""
    parser = make_parser()
    given = sys.argv[1:] if args is None else list(args)
    if '_ARGCOMPLETE' in os.environ:
        from mechanism_sim.cli.completion import complete  # noqa: PLC0415

        complete(parser, parser.leaves())
    carry_out(lambda: _command(parser, given), given)


def _command(parser: Overview, given: Sequence[str]) -> int:
    """Read a command line and carry it out; returns the exit code."""
    own, ros_args = split_ros_args(given)
    options, rest = parser.parse_known_args(own)
    if options.command:  # options of the program itself, without a command
        refuse = ('version', options.version), ('completion', options.completion)
        for name in (name for name, was_given in refuse if was_given):
            parser.error(f"--{name} takes no command, but '{options.command}' was given")
    if ros_args and options.command not in ('run', 'node', 'view'):
        options.parser.error('--ros-args is for the commands run, node and view')
    if options.command == 'plot' and not any(word.startswith('-') for word in rest):
        options.what = [*options.what, *rest]  # argparse looks in one place only
        rest = []
    if rest and options.command != 'node':
        options.parser.refuse(rest)
    options.rest, options.ros_args = rest, ros_args
    if folders := getattr(options, 'tables_from', None):  # also for child processes
        if lost := next((x for x in folders if not os.path.isdir(x)), None):
            raise InputError(f"--tables-from: there is no folder '{lost}'")
        allowed = [os.environ.get(TABLE_FOLDERS, ''), *map(os.path.abspath, folders)]
        os.environ[TABLE_FOLDERS] = os.pathsep.join(filter(None, allowed))
    code: int = options.run(options)
    return code


@cache
def make_parser() -> Overview:
    """The parser of all commands; `run` of what it reads is the command's function."""
    parser = Overview(
        prog='mechanism-sim',
        description='Simulator of planar machines with clearance, impacts and vibration.',
    )
    parser.add_argument('--version', action='store_true', help='print the version')
    parser.add_argument(
        '--completion', metavar='SHELL', choices=first.SHELLS,
        help='print the script for completion of names in a shell: ' + ', '.join(first.SHELLS),
    )  # fmt: skip
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
        first, machines, runs, bags, pages, pictures, drawings, studies, responses, lives,
        thesis, vibrations,
    ):  # fmt: skip
        module.add(command)
    return parser


def _start(options: argparse.Namespace) -> int:
    if options.version:
        from mechanism_sim.catalogue import installed_version  # noqa: PLC0415

        version = installed_version()
        print(f'mechanism-sim {version}' if version else 'mechanism-sim, not installed')
    elif options.completion:
        print(first.completion_script(options.completion))
    else:
        echo(render_start())
    return 0
