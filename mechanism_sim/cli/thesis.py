"""The thesis's experiment, its criteria of contact loss, and its search for a start."""

from __future__ import annotations

import argparse
from pathlib import Path

from mechanism_sim import output
from mechanism_sim.cli.options import (
    Command,
    length_options,
    option,
    print_result,
    read_machine,
    read_workers,
    scene_options,
    skip_option,
    skipped_turns,
    turns_of,
    workers_options,
)


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('thesis experiment', _experiment, 'figures and tables from bags of a sweep')
    sub.add_argument(
        'folders', nargs='+', metavar='DIR', help='folders of bags, as sweep --bags writes them'
    )
    option(sub, '-o --output', 'DIR|FILE', 'draw the figures: a folder, .pdf or .svg')
    option(sub, '--page', 'FILE.md', 'renew the tables of a page between its marks')
    skip_option(sub, 'the first half if not given')
    sub = command(
        'thesis contact-loss', _contact_loss, 'criteria of contact loss, beside simulated losses'
    )
    scene_options(sub)
    length_options(sub, '3 if not given')
    sub = command('thesis starts', _starts, 'how long a seated pin keeps contact, by start angle')
    scene_options(sub)
    option(sub, '--angles', 'N', 'number of start angles in a turn', 24)
    length_options(sub, '3 if not given')
    workers_options(sub, '1')


def _experiment(options: argparse.Namespace) -> int:
    from mechanism_sim.report import figures, progress  # noqa: PLC0415
    from mechanism_sim.thesis import experiment_tables as report  # noqa: PLC0415
    from mechanism_sim.thesis.experiment import (  # noqa: PLC0415
        bags_of,
        read_experiment,
        with_limits,
        with_orders,
    )

    skip = None if options.skip is None else skipped_turns(options)
    place = figures.check_picture('--output', options.output, True) if options.output else None
    page = report.read_page('--page', options.page) if options.page else None
    bags = bags_of([Path(folder) for folder in options.folders])
    with progress.count('experiment', len(bags), quiet=options.json) as show:
        found = with_orders(with_limits(read_experiment(bags, skip, show)))
    if page:
        file, text = page
        output.write_text(file, report.renewed(text, found))
    if place:
        from mechanism_sim.thesis.experiment_figures import charts  # noqa: PLC0415

        figures.save_all(charts(found), place)
    return print_result(options, found, report.to_json, report.render)


def _contact_loss(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.thesis.contact_loss import losses, render, to_json  # noqa: PLC0415

    machine = read_machine(options)
    with progress.busy('contact-loss', options.json):
        found = losses(machine, turns_of(options, machine, 3.0))
    return print_result(options, found, to_json, render)


def _starts(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.thesis.starts import render, starts, to_json  # noqa: PLC0415

    machine = read_machine(options)
    with progress.count('starts', max(options.angles, 1), quiet=options.json) as show:
        turns = turns_of(options, machine, 3.0)
        found = starts(machine, options.angles, turns, read_workers(options, 1), show)
    return print_result(options, found, to_json, render)
