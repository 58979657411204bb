"""How a machine behaves over its parameters."""

from __future__ import annotations

import argparse
from pathlib import Path

from mechanism_sim import tables
from mechanism_sim.cli.options import (
    TABLES,
    Command,
    flag,
    option,
    print_result,
    read_machine,
    read_workers,
    scene_options,
    several,
    workers_options,
)
from mechanism_sim.errors import InputError


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command(
        'bifurcation', _bifurcation, 'periods and sections of the motion over a parameter'
    )
    scene_options(sub)
    several(sub, '--vary', 'PATH=LOW:HIGH:N', 'a key, its limits and the number of values', 'vary')
    text = "quantities of the section, as velocity.rocker; of impacts 'approach_speed'"
    several(sub, '--of', 'NAME', f'{text}; several times', 'of')
    option(sub, '--at-impacts', 'JOINT', 'sections at impacts in this joint, not once a turn')
    option(sub, '--transient', 'N', 'turns of the drive until it has settled', 60)
    option(sub, '--keep', 'N', 'turns of which sections are taken', 60)
    option(sub, '--longest', 'P', 'longest period that is looked for, in turns', 16)
    flag(sub, '--starts', "begin each value from the scene's own start, too")
    option(sub, '-o --output', 'TABLE', f'a row for each point: {TABLES}')
    option(sub, '--plot', 'FILE', 'draw the sections: .png, .svg or .pdf')
    workers_options(sub)


def _bifurcation(options: argparse.Namespace) -> int:
    from mechanism_sim.report import bifurcation as report  # noqa: PLC0415
    from mechanism_sim.report import figures, progress  # noqa: PLC0415
    from mechanism_sim.studies.bifurcation import bifurcation  # noqa: PLC0415

    if len(options.vary) > 1:
        raise InputError('--vary: bifurcation varies one key; sweep takes several')
    path, low, high, count = _varied((options.vary or [None])[0])
    picture = figures.check_picture('--plot', options.plot) if options.plot else None
    if options.output:
        tables.check_file('--output', Path(options.output))
    workers = read_workers(options)
    machine = read_machine(options)
    total = 2 + count * options.starts
    with progress.count('bifurcation', total, options.json) as show:
        found = bifurcation(
            machine, {path: (low, high, count)}, options.of, at_impacts=options.at_impacts,
            starts=options.starts, workers=workers, show=show, transient=options.transient,
            keep=options.keep, longest=options.longest,
        )  # fmt: skip
    if options.output:
        tables.write(Path(options.output), found.columns())
    if picture:
        figures.save(figures.paint(report.chart(found, machine.scene.title)), picture)
    return print_result(options, found, report.to_json, report.render)


def _varied(text: str | None) -> tuple[str, str, str, int]:
    """Path, limits and number of values of ``PATH=LOW:HIGH:N``."""
    path, _, rest = (text or '').partition('=')
    low, high, count = [*(part.strip() for part in rest.split(':')), '', '', ''][:3]
    if not (path and low and high and count.isdecimal() and rest.count(':') == 2):
        given = f" '{text}'" if text else ''
        raise InputError(
            f"--vary{given}: write PATH=LOW:HIGH:N, as 'drive.speed=100 rpm:600 rpm:51'"
        )
    return path.strip(), low, high, int(count)
