"""Commands for a start: a new scene, import from another program, completion of names."""

from __future__ import annotations

import argparse
import shlex

from mechanism_sim import output
from mechanism_sim.cli.options import Command, option, print_either, set_option
from mechanism_sim.terminal import print_notice

SHELLS = 'bash', 'zsh', 'tcsh', 'fish', 'powershell'


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('new', _new, 'write a new scene, with comments, from an existing one')
    sub.add_argument('name', metavar='NAME', help='name of the scene; the file is NAME.yaml')
    sub.add_argument(
        '--from', default='four_bar', metavar='SCENE', dest='scene',
        help='the scene to begin with: four_bar, linkage, one of the package, or a YAML file',
    )  # fmt: skip
    set_option(sub)
    sub = command('import', _import, 'a scene from the file of another program')
    sub.add_argument(
        'file', metavar='FILE',
        help='joint coordinates as .csv, a .json of pylinkage, .urdf, .sdf, .xml of MuJoCo, '
        'outlines as .dxf or .svg, an address of PMKS+ in quotes',
    )  # fmt: skip
    option(sub, '-o --output', 'SCENE', 'the .yaml file; standard output if not given')
    option(sub, '--unit', 'U', 'unit of lengths, if the file does not state it, as mm')
    option(
        sub, '--thickness', 'T', 'thickness of links given by outlines, for their masses, as 5 mm'
    )
    text = 'density of links given by outlines; steel if not given'
    option(sub, '--density', 'RHO', text, '7850 kg/m^3')
    set_option(sub)


def _import(options: argparse.Namespace) -> int:
    from mechanism_sim.imports import import_machine  # noqa: PLC0415

    file = options.output and output.check_path(
        '--output', options.output, '.yaml', '.yml', new=True
    )
    found = import_machine(
        options.file, options.unit, options.overrides, options.thickness, options.density
    )
    for sentence in found.notes:
        print_notice(sentence)
    if file:
        output.write_text(file, found.text)
    where = {'file': options.output} if file else {'text': found.text}
    data = {'from': options.file, 'notes': list(found.notes), **where}
    return print_either(options, data, file or found.text.rstrip())


def _new(options: argparse.Namespace) -> int:
    from mechanism_sim.scene.scene_writer import TEMPLATES, new_scene  # noqa: PLC0415

    source = TEMPLATES.get(options.scene, options.scene)
    file = new_scene(options.name, source, options.overrides)
    next_ = [f'  mechanism-sim {x} {shlex.quote(str(file))}' for x in ('check', 'draw', 'solve')]
    text = '\n'.join([f'{file} is a copy of {source}, with comments. Next:', *next_])
    return print_either(options, {'file': str(file), 'from': source}, text)


def completion_script(shell: str) -> str:
    """The script by which a shell completes names of the command line."""
    from argcomplete.shell_integration import shellcode  # noqa: PLC0415

    return str(shellcode(['mechanism-sim'], shell=shell))
