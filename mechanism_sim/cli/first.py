"""The first minutes: a scene of one's own, and a shell that completes names."""

from __future__ import annotations

import argparse

from mechanism_sim.cli.options import Command, print_json

SHELLS = 'bash', 'zsh', 'tcsh', 'fish', 'powershell'


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('completion', _completion, 'a script by which a shell completes names')
    sub.add_argument('shell', metavar='SHELL', choices=SHELLS, help=', '.join(SHELLS))


def _completion(options: argparse.Namespace) -> int:
    from argcomplete import shellcode  # noqa: PLC0415

    text = shellcode(['mechanism-sim'], shell=options.shell)
    if options.json:
        print_json({'shell': options.shell, 'script': text})
    else:
        print(text)
    return 0
