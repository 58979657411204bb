"""Commands for the behaviour of a machine over its parameters."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from mechanism_sim import output
from mechanism_sim.cli.options import (
    TABLES,
    Command,
    flag,
    option,
    print_result,
    read_machine,
    read_workers,
    refuse_options,
    scene_options,
    several,
    workers_options,
)
from mechanism_sim.errors import InputError

if TYPE_CHECKING:
    from mechanism_sim.report.charts.chart import Chart
    from mechanism_sim.studies.continuation import ResponseBranch
    from mechanism_sim.tables import Column


def add(command: Command) -> None:
    """The commands of this file."""
    text = "quantities of the section, as velocity.rocker; of impacts 'approach_speed'"
    sub = command(
        'bifurcation', _bifurcation, 'periods and Poincaré sections of the motion over a parameter'
    )
    vary = 'a key, its limits and the number of values'
    _shared(sub, f'{vary}; two of them: which response each pair leads to')
    several(sub, '--of', 'NAME', f'{text}; several times', 'of')
    flag(sub, '--starts', "begin each value from the scene's own start, too")
    text = 'follow what repeats through folds and flips, stable or not, to where it grazes'
    flag(sub, '--continue', text)
    option(sub, '--page', 'FILE', 'page of the diagram: a slider plays the motion at each point')
    text = 'which response each start, or each pair of values, leads to'
    _shared(command('basins', _bifurcation, text), f'{vary}; two of them')


def _shared(sub: argparse.ArgumentParser, vary: str) -> None:
    """Options of responses over one key, and over two."""
    scene_options(sub)
    several(sub, '--vary', 'PATH=LOW:HIGH:N', vary, 'vary')
    option(sub, '--at-impacts', 'JOINT', 'sections at impacts in this joint, not once a turn')
    few = ' (default: 60, fewer in bifurcation of more than 100 values)'
    option(sub, '--transient', 'N', f'turns of the drive left out for settling{few}', int)
    option(sub, '--keep', 'N', f'turns in which sections are taken{few}', int)
    option(sub, '--longest', 'P', 'longest period to look for, in turns', 16)
    option(sub, '-o --output', 'TABLE', f'a row for each point: {TABLES}')
    option(sub, '--plot', 'FILE', 'draw the sections: .png, .svg or .pdf')
    workers_options(sub)


def _bifurcation(options: argparse.Namespace) -> int:
    from mechanism_sim import tables  # noqa: PLC0415
    from mechanism_sim.report import bifurcation as report  # noqa: PLC0415
    from mechanism_sim.report import figures, progress  # noqa: PLC0415
    from mechanism_sim.studies.basins import basins  # noqa: PLC0415
    from mechanism_sim.studies.bifurcation import bifurcation  # noqa: PLC0415
    from mechanism_sim.studies.continuation import branches  # noqa: PLC0415
    from mechanism_sim.studies.parameters import read_counted  # noqa: PLC0415

    vary = read_counted('--vary', options.vary or [''])
    if len(vary) > 2:
        raise InputError('--vary: give one key, or two different ones; sweep takes more')
    two = len(vary) == 2
    if options.command == 'basins' and not two:
        raise InputError('basins: --vary: give two keys; bifurcation takes one')
    if two and options.command == 'bifurcation':
        no = ['of', 'starts', 'continue', 'page']
        refuse_options(options, no, 'does not apply to two keys')
    given_page = None if two else options.page
    page = output.check_path('--page', given_page, '.html', '.htm') if given_page else None
    if options.plot:
        figures.check_picture('--plot', options.plot)
    if options.output:
        tables.check_file('--output', Path(options.output))
    workers, machine = read_workers(options), read_machine(options)
    counts = [count for *_, count in vary.values()]
    total = counts[0] if two else 2 + counts[0] * options.starts
    names = 'transient', 'keep', 'longest'
    how = {n: x for n in names if (x := getattr(options, n)) is not None}
    with progress.count('bifurcation', total, options.json) as show:
        if two:
            map_ = basins(
                machine, vary, at_impacts=options.at_impacts, workers=workers, show=show, **how
            )
            _write(options, map_.columns(), report.basins_chart(map_, machine.scene.title))
        else:
            found = bifurcation(
                machine, vary, options.of, at_impacts=options.at_impacts, starts=options.starts,
                workers=workers, show=show, **how,
            )  # fmt: skip
    if two:
        return print_result(options, map_, report.basins_json, report.basins_text)
    lines: tuple[ResponseBranch, ...] = ()
    if getattr(options, 'continue'):
        periods = len({r.period for r in found.responses if r.period})
        with progress.count('bifurcation', periods, options.json) as show:
            lines = branches(found, workers, show)
    _write(options, found.columns(), report.chart(found, machine.scene.title, lines))
    if page:
        from mechanism_sim.pages.families import bifurcation_page  # noqa: PLC0415

        with progress.busy('bifurcation', options.json) as say:
            output.write_text(page, bifurcation_page(found, lines, say))
    return print_result(options, (found, lines), report.to_json, report.render)


def _write(options: argparse.Namespace, columns: list[Column], chart: Chart) -> None:
    """Write the requested table and picture."""
    from mechanism_sim import tables  # noqa: PLC0415
    from mechanism_sim.report import figures  # noqa: PLC0415

    if options.output:
        tables.write(Path(options.output), columns)
    if options.plot:
        figures.draw(chart, Path(options.plot))
