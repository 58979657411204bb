"""The command line: `mechanism-sim`, or `python -m mechanism_sim`."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from typing import Any

from mechanism_sim.cli import bags, drawings, machines, pictures, runs, studies
from mechanism_sim.cli.options import tell
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.nodes.arguments import split_ros_args


def main(args: Sequence[str] | None = None) -> None:
    """Run a command; exit code 0 done, 1 failed run, 2 bad input."""
    parser = _parser()
    own, ros_args = split_ros_args(sys.argv[1:] if args is None else args)
    options, rest = parser.parse_known_args(own)
    if ros_args and options.command not in ('run', 'node'):
        options.parser.error('--ros-args is for the commands run and node')
    if options.command == 'plot' and not any(word.startswith('-') for word in rest):
        options.what, rest = [*options.what, *rest], []  # argparse looks for them in one place
    if rest and options.command != 'node':
        options.parser.error(f'unrecognized arguments: {" ".join(rest)}')
    if options.command is None:
        parser.print_help()
        sys.exit(0)
    options.rest, options.ros_args = rest, ros_args
    try:
        code = options.run(options)
        sys.stdout.flush()
        sys.exit(code)
    except InputError as error:
        sys.exit(tell(error, 2))
    except RunError as error:
        sys.exit(tell(error, 1))
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # Whoever read our output has had enough; Python must not complain while closing it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='mechanism-sim',
        description='Simulator of real (loose, rattling, vibrating) planar machines.',
        epilog='Try: mechanism-sim run four_bar_clearance --revolutions 10 --record run.mcap',
    )
    commands = parser.add_subparsers(dest='command', metavar='COMMAND')

    def command(name: str, run: Any, text: str) -> argparse.ArgumentParser:
        # A node has options of its own, and its own help.
        sub = commands.add_parser(
            name, help=text, description=text, allow_abbrev=False, add_help=name != 'node'
        )
        sub.set_defaults(run=run, parser=sub)
        if name != 'node':
            sub.add_argument('--json', action='store_true', help='JSON to standard output')
        return sub

    for module in (machines, runs, bags, pictures, drawings, studies):
        module.add(command)
    return parser
