"""Studies of many runs, and measurements of speed."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mechanism_sim import ending, output
from mechanism_sim.cli.options import (
    Command,
    print_json,
    print_result,
    read_machine,
    scene_options,
)
from mechanism_sim.errors import InputError


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('periodic', _periodic, 'find the periodic response of a loose machine')
    scene_options(sub)
    sub.add_argument(
        '--longest',
        type=int,
        default=8,
        metavar='P',
        help='longest period to look for, in revolutions',
    )
    sub.add_argument(
        '--transient',
        type=int,
        default=60,
        metavar='N',
        help='revolutions to wait until it has settled',
    )
    sub = command('statistics', _statistics, 'figures per revolution, with confidence intervals')
    scene_options(sub)
    sub.add_argument('--revolutions', type=int, default=200, metavar='N', help='how many to run')
    sub.add_argument(
        '--skip',
        type=int,
        default=20,
        metavar='K',
        help='revolutions to leave out at the beginning',
    )
    sub = command('contact-loss', _contact_loss, 'criteria of contact loss, beside what happens')
    scene_options(sub)
    sub.add_argument('--revolutions', type=float, default=3.0, metavar='N', help='how many to run')
    sub = command('lift-off', _lift_off, 'from which speed on followers leave their cams')
    scene_options(sub)
    sub = command('starts', _starts, 'how long a seated pin follows, by start angle')
    scene_options(sub)
    sub.add_argument(
        '--angles', type=int, default=24, metavar='N', help='how many start angles around the turn'
    )
    sub.add_argument(
        '--revolutions', type=float, default=3.0, metavar='N', help='how many to run from each'
    )
    sub = command('sweep', _sweep, 'run a grid or a list of scenes and write one table')
    sub.add_argument('file', metavar='FILE', help='a sweep of the package, or a YAML file')
    sub.add_argument(
        '-o',
        '--output',
        metavar='TABLE',
        help='the table, a Parquet file; NAME.parquet if not given',
    )
    sub.add_argument(
        '--workers', type=int, metavar='N', help='processes; one for each core if not given'
    )
    sub.add_argument('--dask', metavar='ADDRESS', help='run on the cluster of this Dask scheduler')
    sub.add_argument('--bags', metavar='DIR', help='folder in which to record every run, too')
    sub.add_argument(
        '--windows',
        metavar='DIR',
        help='folder for windows of signals; TABLE.windows if not given',
    )
    sub.add_argument('--restart', action='store_true', help='forget what is computed already')
    sub.add_argument('--plot', metavar='FILE', help='draw the figures over the last swept value')
    sub.add_argument('--over', metavar='PATH', help='with --plot: over this swept value')
    sub = command('bench', _bench, 'measure speed against error beside peers, or the hard cases')
    sub.add_argument(
        'names', nargs='*', metavar='NAME',
        help='problems; scaling; loose_joints; middleware; grid; hard, or hard cases; '
        'nothing lists all',
    )  # fmt: skip
    sub.add_argument('--output', metavar='DIR', help='folder for picture, JSON and table')
    sub.add_argument(
        '--repeats', type=int, default=7, metavar='N', help='how often to repeat every run'
    )
    sub.add_argument('--methods', metavar='NAME,...', help='only these methods')
    sub.add_argument(
        '--tolerances', metavar='R,...', help='relative tolerances, instead of the usual ones'
    )
    sub.add_argument(
        '--markdown', metavar='FILE', help='write the hard cases as a page of Markdown'
    )
    sub.add_argument('--only', metavar='NAME,...', help='of the grid: these families or cases')
    sub.add_argument('--sample', type=int, metavar='N', help='of the grid: so many cases, drawn')
    sub.add_argument('--seed', type=int, metavar='K', help='of the grid: another one')
    sub.add_argument(
        '--workers', type=int, metavar='N', help='of the grid: processes; one for each core'
    )


def _periodic(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, study  # noqa: PLC0415
    from mechanism_sim.study.periodic import find_periodic  # noqa: PLC0415

    if options.longest < 1 or options.transient < 1:
        raise InputError('--longest and --transient must be at least 1')
    machine = read_machine(options)
    with progress.busy('periodic', options.json) as say:
        response = find_periodic(machine, options.longest, options.transient, progress=say)
    if options.json:
        print_json(study.periodic_json(response))
    elif response is None:
        print(
            f'no response that repeats within {options.longest} revolutions after '
            f"{options.transient}; 'mechanism-sim statistics' says what it is like in the mean"
        )
    else:
        print(study.periodic(response))
    return 0


def _statistics(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, study  # noqa: PLC0415
    from mechanism_sim.study.statistics import statistics  # noqa: PLC0415

    machine = read_machine(options)
    end = options.revolutions * machine.period
    with progress.bar('statistics', end, quiet=options.json) as show:
        found = statistics(machine, options.revolutions, options.skip, show)
    return print_result(options, found, study.statistics_json, study.statistics)


def _contact_loss(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, study  # noqa: PLC0415
    from mechanism_sim.study.losses import losses  # noqa: PLC0415

    machine = read_machine(options)
    with progress.busy('contact-loss', options.json):
        found = losses(machine, options.revolutions)
    return print_result(options, found, study.losses_json, study.losses)


def _lift_off(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, study  # noqa: PLC0415
    from mechanism_sim.study.lift_off import lift_offs  # noqa: PLC0415

    machine = read_machine(options)
    with progress.busy('lift-off', options.json) as say:
        found = lift_offs(machine, say)
    return print_result(options, found, study.lift_offs_json, study.lift_offs)


def _starts(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, study  # noqa: PLC0415
    from mechanism_sim.study.starts import starts  # noqa: PLC0415

    machine = read_machine(options)
    with progress.count('starts', max(options.angles, 1), quiet=options.json) as show:
        found = starts(machine, options.angles, options.revolutions, show)
    return print_result(options, found, study.starts_json, study.starts)


def _sweep(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.report import sweep as report  # noqa: PLC0415
    from mechanism_sim.sweep.plan import read_plan  # noqa: PLC0415
    from mechanism_sim.sweep.run import Interrupted, sweep  # noqa: PLC0415

    plan = read_plan(options.file)
    table = Path(options.output or f'{plan.name}.parquet')
    chart = report.chart_of(plan, options.plot, options.over)
    try:
        with progress.count('sweep', plan.size, quiet=options.json) as show:
            summary, rows = sweep(
                plan, table, options.workers, options.dask, options.bags, options.windows,
                options.restart, show,
            )  # fmt: skip
    except Interrupted as interrupted:
        return ending.say(str(interrupted))
    if chart:
        report.draw(chart, plan, rows)
    if options.json:
        print_json(summary)
    else:
        print(report.render(summary, plan, rows))
    return 0


def _bench(options: argparse.Namespace) -> int:
    from mechanism_sim.bench import choose  # noqa: PLC0415
    from mechanism_sim.bench.loose_joints import loose_joints, stretches  # noqa: PLC0415
    from mechanism_sim.bench.measure import machine, measure  # noqa: PLC0415
    from mechanism_sim.bench.middleware import middleware  # noqa: PLC0415
    from mechanism_sim.bench.scaling import scaling  # noqa: PLC0415
    from mechanism_sim.report import bench, progress  # noqa: PLC0415

    if not options.names:
        return print_result(options, choose.listing(), dict, bench.listing)
    problems, cases, tables = choose.choose(options.names)
    if choose.GRID in options.names:
        return _bench_grid(options)
    if cases:
        return _bench_hard(options, cases)
    methods = choose.methods(problems, options.methods)
    tolerances = choose.tolerances(options.tolerances)
    if options.repeats < 1:
        raise InputError('--repeats must be at least 1')
    here, content = machine(), bench.Pages(options.output)

    @contextmanager
    def entry() -> Iterator[Callable[[str], None]]:
        with progress.busy('bench', options.json) as say:
            yield say
        if not options.json:
            print(content.text[-1], flush=True)

    for problem in problems:
        with entry() as say:
            content.add(measure(problem, options.repeats, methods, tolerances, say), here)
    if choose.SCALING in tables:
        with entry() as say:
            content.add_scaling(scaling(say), here)
    if choose.LOOSE_JOINTS in tables:
        with entry() as say:
            costs = loose_joints(options.repeats, say)
            content.add_loose_joints(costs, here, *stretches(options.repeats, say))
    if choose.MIDDLEWARE in tables:
        with entry() as say:
            content.add_middleware(middleware(options.repeats, say), here)
    if options.json:
        print_json(content.to_json(here))
    return 1 if any(row.failure for m in content.found for row in m.rows) else 0


def _bench_hard(options: argparse.Namespace, cases: Sequence[Any]) -> int:
    from mechanism_sim.bench.hard import run  # noqa: PLC0415
    from mechanism_sim.report import hard, progress  # noqa: PLC0415

    if options.markdown and not Path(options.markdown).resolve().parent.is_dir():
        raise InputError(f'--markdown {options.markdown}: there is no such folder')
    outcomes = []
    for k, case in enumerate(cases):
        with progress.busy(f'bench: case {k + 1} of {len(cases)}', options.json) as say:
            say(case.name)
            (outcome,) = run((case,))
        outcomes.append(outcome)
        if not options.json:
            print(hard.render(outcome), flush=True)
    if options.markdown:
        output.write_text(options.markdown, hard.markdown(outcomes))
    if options.json:
        print_json(hard.to_json(outcomes))
    return 0 if all(outcome.ok for outcome in outcomes) else 1


def _bench_grid(options: argparse.Namespace) -> int:
    import os  # noqa: PLC0415

    from mechanism_sim.bench.grid import SEED, grid, run_grid, write_scenes  # noqa: PLC0415
    from mechanism_sim.report import grid as report  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415

    only = [name.strip() for name in (options.only or '').split(',') if name.strip()]
    for name in ('sample', 'workers'):
        if getattr(options, name) is not None and getattr(options, name) < 1:
            raise InputError(f'--{name} must be at least 1')
    cases = grid(SEED if options.seed is None else options.seed, only, options.sample)
    if options.output:
        write_scenes(cases, Path(options.output))
    outcomes, workers = [], options.workers or len(os.sched_getaffinity(0))
    with progress.count('bench grid', len(cases), quiet=options.json) as show:
        for outcome in run_grid(cases, min(workers, len(cases))):
            outcomes.append(outcome)
            show(len(outcomes), sum(o.ok is False for o in outcomes))
            if outcome.ok is False and not options.json:
                print(report.render(outcome), flush=True)
    if options.json:
        print_json(report.to_json(outcomes))
    else:
        print(report.summary(outcomes))
    return 0 if all(outcome.ok is not False for outcome in outcomes) else 1
