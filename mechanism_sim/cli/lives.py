"""Command for the change of a machine over many cycles."""

from __future__ import annotations

import argparse
from pathlib import Path

from mechanism_sim import output
from mechanism_sim.cli.options import (
    TABLES,
    Command,
    flag,
    measure_option,
    option,
    print_result,
    read_machine,
    scene_options,
)
from mechanism_sim.errors import InputError


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('life', _life, 'wear of bearings over many cycles, and their life')
    scene_options(sub)
    text = "end of life, as 'clearance > 0.5 mm', 'depth.JOINT > 20 um', or a measure and a limit"
    option(sub, '--until', 'CONDITION', text)
    option(sub, '--cycles', 'N', 'largest number of turns of the drive', '1e7')
    option(sub, '--tolerance', 'X', 'relative error allowed in the growth in a step', 0.02)
    option(sub, '--revolutions', 'N', 'turns of each run that are evaluated', 40)
    option(sub, '--skip', 'N', 'turns of each run before these, in which it settles', 10)
    measure_option(sub)
    option(
        sub,
        '-o --output',
        'TABLE',
        f'a row for each stage: {TABLES}; an existing one is continued',
    )
    flag(sub, '--restart', 'discard what was computed before')
    option(sub, '--plot', 'FILE', 'draw clearances and profiles over the cycles')
    option(sub, '--page', 'FILE', 'page with a slider that plays the machine along its life')
    option(sub, '--scenes', 'DIR', 'folder for the scene of every stage')
    option(sub, '--bags', 'DIR', 'folder for a recorded run of every stage')


def _life(options: argparse.Namespace) -> int:
    from mechanism_sim import tables  # noqa: PLC0415
    from mechanism_sim.report import figures, progress  # noqa: PLC0415
    from mechanism_sim.report import life as report  # noqa: PLC0415
    from mechanism_sim.studies.life import life  # noqa: PLC0415

    page = output.check_path('--page', options.page, '.html', '.htm') if options.page else None
    picture = figures.check_picture('--plot', options.plot) if options.plot else None
    table = tables.check_file('--output', Path(options.output)) if options.output else None
    folders = {
        name: output.make_folder(Path(given), f'--{name} ') if given else None
        for name, given in (('scenes', options.scenes), ('bags', options.bags))
    }
    try:
        cycles = float(options.cycles)
    except ValueError as error:
        raise InputError(f"--cycles '{options.cycles}': write a number, as 1e7") from error
    if options.restart and not table:
        raise InputError('--restart needs --output')
    machine = read_machine(options)
    with progress.busy('life', options.json) as say:
        found = life(
            machine, options.until or '', cycles=cycles, measures=options.measures, table=table,
            restart=options.restart, bags=folders['bags'], show=say, tolerance=options.tolerance,
            revolutions=options.revolutions, skip=options.skip,
        )  # fmt: skip
    if table:
        tables.write(table, found.columns())
    if picture:
        figures.draw(report.chart(found, machine.scene.title), picture)
    if page:
        from mechanism_sim.pages.families import life_page  # noqa: PLC0415

        with progress.busy('life', options.json) as say:
            output.write_text(page, life_page(found, say))
    if folder := folders['scenes']:
        for k, stage in enumerate(found.stages):
            output.write_text(folder / f'stage_{k:02d}.yaml', report.scene_text(found, stage))
    return print_result(options, found, report.to_json, report.render)
