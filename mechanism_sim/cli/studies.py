"""Studies of many runs, and measurements of speed."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mechanism_sim import ending, output
from mechanism_sim.cli.options import (
    Command,
    flag,
    length_options,
    measure_option,
    option,
    print_json,
    print_result,
    read_machine,
    read_measures,
    refuse_options,
    scene_options,
    tables_option,
    turns_of,
)
from mechanism_sim.errors import InputError


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('periodic', _periodic, 'find the periodic response of a machine')
    scene_options(sub)
    option(sub, '--longest', 'P', 'longest period to look for, in revolutions', 8)
    option(sub, '--transient', 'N', 'revolutions to wait until it has settled', 60)
    sub = command('statistics', _statistics, 'figures per revolution, with confidence intervals')
    scene_options(sub)
    length_options(sub, '200 if not given')
    option(sub, '--skip', 'K', 'revolutions to leave out at the beginning', 20)
    measure_option(sub)
    sub = command('lift-off', _lift_off, 'from which speed on followers leave their cams')
    scene_options(sub)
    sub = command('find', _find, 'find the value of a key for which a figure is as wanted')
    scene_options(sub)
    option(sub, '--vary', 'PATH=LOW:HIGH', 'the key, and between which values to look')
    option(sub, '--so-that', 'GOAL', "as 'largest(reaction.ram_pin) = 20 kN'")
    option(sub, '--minimise', 'MEASURE', "instead: as 'rms(drive_torque)'")
    option(sub, '--samples', 'N', 'values at which the curve is computed', 17)
    option(
        sub, '--duration', 'S', 'length of a cycle; a turn of a steady drive if not given', float
    )
    option(sub, '--revolutions', 'N', 'length of a cycle in whole turns of a steady drive', int)
    option(sub, '-o --output', 'FILE', 'draw the curve')
    sub = command('sweep', _sweep, 'run a grid or a list of scenes and write one table')
    sub.add_argument('file', metavar='FILE', help='a sweep of the package, or a YAML file')
    option(
        sub,
        '-o --output',
        'TABLE',
        'the table, a .parquet, .csv, .xlsx, .mat or .npz file; NAME.parquet if not given, or '
        'NAME.csv without pyarrow',
    )
    measure_option(sub)
    tables_option(sub)
    option(sub, '--workers', 'N', 'processes; one for each core if not given', int)
    option(sub, '--dask', 'ADDRESS', 'run on the cluster of this Dask scheduler')
    option(sub, '--bags', 'DIR', 'folder in which to record every run, too')
    option(sub, '--windows', 'DIR', 'folder for windows of signals; TABLE.windows if not given')
    flag(sub, '--restart', 'forget what is computed already')
    option(sub, '--plot', 'FILE', 'draw the figures over the last swept value')
    option(sub, '--over', 'PATH', 'with --plot: over this swept value')
    option(sub, '--effects', 'FILE', 'draw the main effects of swept values on measures')
    sub = command('bench', _bench, 'measure speed against error beside peers, or the hard cases')
    sub.add_argument(
        'names', nargs='*', metavar='NAME',
        help='problems; scaling; loose_joints; middleware; grid; hard, or hard cases; '
        'nothing lists all',
    )  # fmt: skip
    option(sub, '-o --output', 'DIR', 'folder for picture, JSON and table')
    option(sub, '--repeats', 'N', 'how often to repeat every run', 7)
    option(sub, '--methods', 'NAME,...', 'only these methods')
    option(sub, '--tolerances', 'R,...', 'relative tolerances, instead of the usual ones')
    option(sub, '--markdown', 'FILE', 'write the hard cases as a page of Markdown')
    option(sub, '--only', 'NAME,...', 'of the grid: these families or cases')
    option(sub, '--sample', 'N', 'of the grid: so many cases, drawn', int)
    option(sub, '--seed', 'K', 'of the grid: another one', int)
    option(sub, '--workers', 'N', 'of the grid: processes; one for each core', int)


_BENCH_OPTIONS = {
    'output': ('problems', 'grid'),
    **dict.fromkeys(('repeats', 'methods', 'tolerances'), ('problems',)),
    'markdown': ('hard',),
    **dict.fromkeys(('only', 'sample', 'seed', 'workers'), ('grid',)),
}
"""To which kinds of names the options of `bench` apply."""


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
            f"{options.transient}; 'mechanism-sim statistics' gives its means"
        )
    else:
        print(study.periodic(response))
    return 0


def _statistics(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, study  # noqa: PLC0415
    from mechanism_sim.study.statistics import statistics  # noqa: PLC0415

    machine = read_machine(options)
    turns = math.floor(turns_of(options, machine, 200) * (1.0 + 1e-12))
    with progress.bar('statistics', turns * machine.period, quiet=options.json) as show:
        found = statistics(machine, turns, options.skip, show, read_measures(options, machine))
    return print_result(options, found, study.statistics_json, study.statistics)


def _lift_off(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, study  # noqa: PLC0415
    from mechanism_sim.study.lift_off import lift_offs  # noqa: PLC0415

    machine = read_machine(options)
    with progress.busy('lift-off', options.json) as say:
        found = lift_offs(machine, say)
    return print_result(options, found, study.lift_offs_json, study.lift_offs)


def _find(options: argparse.Namespace) -> int:
    from mechanism_sim.report import figures, progress  # noqa: PLC0415
    from mechanism_sim.report import find as report  # noqa: PLC0415
    from mechanism_sim.study.find import find, read_goal  # noqa: PLC0415
    from mechanism_sim.study.parameters import ranges  # noqa: PLC0415

    goal = read_goal(options.so_that, options.minimise)
    file = figures.check_picture('--output', options.output) if options.output else None
    if options.samples < 2:
        raise InputError('--samples must be at least 2')
    ((path, limits),) = ranges([options.vary or ''], '--vary').items()
    machine = read_machine(options)
    with progress.busy('find', options.json) as say:
        finding = find(
            machine, (path, *limits), goal, options.samples, lambda n: say(f'{n} cycles'),
            duration=options.duration,
            **({} if options.revolutions is None else {'periods': options.revolutions}),
        )  # fmt: skip
    if file:
        figures.save(figures.paint(report.chart(finding, machine.scene.title)), file)
    return print_result(options, finding, report.to_json, report.text)


def _sweep(options: argparse.Namespace) -> int:
    from mechanism_sim.report import figures, progress  # noqa: PLC0415
    from mechanism_sim.report import sweep as report  # noqa: PLC0415
    from mechanism_sim.sweep.plan import read_plan  # noqa: PLC0415
    from mechanism_sim.sweep.run import SweepInterrupted, sweep  # noqa: PLC0415
    from mechanism_sim.tables import default_ending  # noqa: PLC0415

    if options.effects:
        figures.check_picture('--effects', options.effects)
    with progress.busy('checking', options.json) as say:
        plan = read_plan(options.file, options.measures, say)
    table = Path(options.output or f'{plan.name}{default_ending()}')
    asked = report.chart_of(plan, options.plot, options.over)
    try:
        with progress.count('sweep', plan.size, quiet=options.json) as show:
            summary, rows = sweep(
                plan, table, options.workers, options.dask, options.bags, options.windows,
                options.restart, show,
            )  # fmt: skip
    except SweepInterrupted as interrupted:
        return ending.report_signal(str(interrupted))
    if asked:
        figures.save(figures.paint(report.sweep_chart(asked, plan, rows)), asked.file)
    if options.effects:
        found = figures.paint(report.effects_chart(plan, rows))
        figures.save(found, Path(options.effects))
    if options.json:
        print_json(report.to_json(summary, plan, rows))
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
        refuse_options(options, _BENCH_OPTIONS, 'needs names of what is measured')
        return print_result(options, choose.listing(), dict, bench.listing)
    problems, cases, tables = choose.choose(options.names)
    kind = 'grid' if choose.GRID in options.names else 'hard' if cases else 'problems'
    for name, kinds in _BENCH_OPTIONS.items():
        if kind not in kinds:
            reason = (
                f'does not apply to {" ".join(options.names)}: it is for {" and ".join(kinds)}'
            )
            refuse_options(options, [name], reason)
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
