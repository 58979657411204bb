"""Commands that list and check scenes, and derive their equations."""

from __future__ import annotations

import argparse

from mechanism_sim.catalogue import scene_rows
from mechanism_sim.cli.options import (
    Command,
    flag,
    option,
    print_either,
    print_json,
    print_result,
    read_machine,
    refuse_options,
    scene_options,
)
from mechanism_sim.packages import needed
from mechanism_sim.terminal import echo


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('scenes', _scenes, 'list the scenes of the package')
    flag(sub, '--schema', 'the keys of scenes as a JSON schema for editors, instead of the list')
    sub = command('check', _check, 'check a scene, and summarise its machine, without running it')
    scene_options(sub)
    own = command('quantities', _quantities, 'list the quantities of a machine')
    scene_options(own)
    more = sub.add_argument_group('equations')
    flag(more, '--equations', 'write the equations of motion of the machine instead')
    flag(more, '--rates', 'add the rates of closures and gaps')
    form = more.add_mutually_exclusive_group()
    flag(form, '--latex', 'print a fragment of LaTeX')
    flag(form, '--markdown', 'print Markdown')
    option(more, '-o --output', 'FILE', 'write a .tex, .md, .html or .txt file')


def _scenes(options: argparse.Namespace) -> int:
    if options.schema:
        from mechanism_sim.scene.scene_writer import json_schema  # noqa: PLC0415

        print_json(json_schema())
        return 0
    rows = scene_rows()
    width = max(len(row['name']) for row in rows)
    lines = [f'{row["name"]:{width}}  {row["title"]} ({row["level"]})' for row in rows]
    return print_either(options, rows, '\n'.join(lines))


def _quantities(options: argparse.Namespace) -> int:
    from mechanism_sim import text_table  # noqa: PLC0415
    from mechanism_sim.results.catalogue import catalogue  # noqa: PLC0415

    known = catalogue(read_machine(options, remarks=False)).values()
    data = [{'name': q.name, 'unit': q.unit, 'words': q.words} for q in known]
    rows = [('quantity', 'unit', ''), *((q.name, q.unit, q.words) for q in known)]
    return print_either(options, data, '\n'.join(text_table.lines(rows, left=3)))


def _check(options: argparse.Namespace) -> int:
    if options.equations:
        return _equations(options)
    refuse_options(options, ['rates', 'latex', 'markdown', 'output'], 'needs --equations')
    from mechanism_sim.scene.check import Report, check, render  # noqa: PLC0415

    machine = read_machine(options, remarks=False)
    if machine.scene.measures:
        from mechanism_sim.results.measures import check_measures  # noqa: PLC0415

        check_measures(machine, machine.scene.measures, f'{machine.name}: measures')
    report = check(machine)
    return print_result(options, report, Report.to_json, render, echo)


def _equations(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress  # noqa: PLC0415

    needed('sympy', 'check --equations')
    from mechanism_sim.report import typeset  # noqa: PLC0415

    if options.json:
        refuse_options(options, ['latex', 'markdown'], 'and --json exclude each other: keep one')
    machine = read_machine(options)
    with progress.busy('equations', options.json):
        setter = typeset.equations(machine, options.rates)
    if options.output:
        typeset.write(setter, options.output)
    if options.json:
        print_json(setter.to_json())
    elif options.latex or options.markdown:
        print(setter.latex() if options.latex else setter.markdown(), end='')
    elif not options.output:
        print(setter.plain())
    return 0
