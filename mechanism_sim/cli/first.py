"""The first minutes: a scene of one's own, and a shell that completes names."""

from __future__ import annotations

import argparse
import shlex

from mechanism_sim.cli.options import Command, print_json

SHELLS = 'bash', 'zsh', 'tcsh', 'fish', 'powershell'

HOW = (
    'In ~/.bashrc or ~/.zshrc: eval "$(mechanism-sim completion bash)" (or zsh). In fish: '
    'mechanism-sim completion fish | source. In PowerShell: mechanism-sim completion powershell | '
    'Out-String | Invoke-Expression.'
)
"""How the script is used."""


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('new', _new, 'write a scene of your own, with comments, from one that exists')
    sub.add_argument('name', metavar='NAME', help='of the scene; the file is NAME.yaml')
    sub.add_argument(
        '--from', default='four_bar', metavar='SCENE', dest='scene',
        help='the scene to begin with: four_bar, linkage, one of the package, or a YAML file',
    )  # fmt: skip
    sub.add_argument(
        '--set', action='append', default=[], metavar='PATH=VALUE', dest='overrides',
        help="change a value of the scene, for example 'drive.speed=300 rpm'; several times",
    )  # fmt: skip
    sub = command('completion', _completion, 'a script by which a shell completes names')
    sub.add_argument('shell', metavar='SHELL', choices=SHELLS, help='one of ' + ', '.join(SHELLS))
    sub.epilog = HOW


def _new(options: argparse.Namespace) -> int:
    from mechanism_sim.scene.new_scene import TEMPLATES, new_scene  # noqa: PLC0415

    source = TEMPLATES.get(options.scene, options.scene)
    file = new_scene(options.name, source, options.overrides)
    if options.json:
        print_json({'file': str(file), 'from': source})
        return 0
    print(f'{file} is a copy of {source}, with comments. Next:')
    for command in ('check', 'draw', 'solve'):
        print(f'  mechanism-sim {command} {shlex.quote(str(file))}')
    return 0


def _completion(options: argparse.Namespace) -> int:
    from argcomplete.shell_integration import shellcode  # noqa: PLC0415

    text = shellcode(['mechanism-sim'], shell=options.shell)
    if options.json:
        print_json({'shell': options.shell, 'script': text})
    else:
        print(text)
    return 0
