"""The first minutes: a scene of one's own, and a shell that completes names."""

from __future__ import annotations

import argparse
import shlex

from mechanism_sim.cli.options import Command, print_json, set_option

SHELLS = 'bash', 'zsh', 'tcsh', 'fish', 'powershell'


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('new', _new, 'write a scene of your own, with comments, from one that exists')
    sub.add_argument('name', metavar='NAME', help='of the scene; the file is NAME.yaml')
    sub.add_argument(
        '--from', default='four_bar', metavar='SCENE', dest='scene',
        help='the scene to begin with: four_bar, linkage, one of the package, or a YAML file',
    )  # fmt: skip
    set_option(sub)


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


def completion_script(shell: str) -> str:
    """The script by which a shell completes names of the command line."""
    from argcomplete.shell_integration import shellcode  # noqa: PLC0415

    return str(shellcode(['mechanism-sim'], shell=shell))
