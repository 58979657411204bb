"""Studies of many runs."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from mechanism_sim.cli.options import (
    Command,
    flag,
    length_options,
    measure_option,
    option,
    print_either,
    print_result,
    quantity,
    read_machine,
    read_measures,
    read_workers,
    refuse_options,
    say_turns,
    scene_options,
    several,
    skip_option,
    skipped_turns,
    tables_option,
    time_option,
    turns_of,
    workers_options,
)
from mechanism_sim.errors import InputError

if TYPE_CHECKING:
    from mechanism_sim.scene import Machine
    from mechanism_sim.studies.plan import SweepPlan


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('statistics', _statistics, 'means per revolution, with confidence intervals')
    scene_options(sub)
    length_options(sub, '200 if not given')
    skip_option(sub, '20 if not given')
    measure_option(sub)
    text = (
        'instead: N largest Lyapunov exponents, over turns behind those left out, and how long '
        'digits of a run are significant'
    )
    option(sub, '--exponents', 'N', text, int)
    sub = command('lyapunov', _exponents, 'how fast neighbouring motions part, with intervals')
    scene_options(sub)
    length_options(sub, 'behind those left out, 200 if not given')
    skip_option(sub, '20 if not given')
    option(sub, '--exponents', 'N', 'number of the largest Lyapunov exponents', 1)
    sub = command('find', _find, 'find values of keys that give wanted values of measures')
    scene_options(sub, count='?')
    text = 'a key and the limits of its value, or PATH=VALUE,VALUE,...; several times'
    several(sub, '--vary', 'PATH=LOW:HIGH', text, 'vary')
    text = "wanted value of a measure, as 'largest(reaction.ram_pin) = 20 kN'; several times"
    several(sub, '--so-that', 'GOAL', text, 'so_that')
    text = "instead: a measure to minimise, as 'rms(drive_torque)'; several times: a front"
    several(sub, '--minimise', 'MEASURE', text)
    several(sub, '--maximise', 'MEASURE', 'a measure to maximise; several times')
    text = "a constraint, as 'largest(reaction.ram_pin) < 12 kN'; several times"
    several(sub, '--subject-to', 'GOAL', text, 'subject_to')
    option(sub, '--values', 'N', 'number of values of the curve, or to try at first', 17)
    text = 'length of a cycle; without it the turns of the drive that bring all again'
    time_option(sub, '--duration', text)
    option(sub, '--revolutions', 'N', 'length of a cycle in whole turns of a steady drive', int)
    text = 'local: from the best of the values tried; global: by differential evolution'
    sub.add_argument('--search', choices=('local', 'global'), default='local', help=text)
    text = 'differences of cycles, the faster way; or exact ones, where there are some'
    kinds = 'differences', 'exact'
    sub.add_argument('--gradients', choices=kinds, default=kinds[0], help=text)
    text = 'largest number of cycles computed by a global search, or for a front'
    option(sub, '--evaluations', 'N', text, 400)
    text = 'the scene (.yaml), a table of the designs tried, the curve or the front; several times'
    several(sub, '-o --output', 'FILE', text)
    flag(sub, '--restart', 'with a table: discard what was computed before')
    workers_options(sub, '1')
    flag(sub, '--lift-off', 'instead: the speed from which followers lift off their cams')
    flag(sub, '--periodic', 'instead: the periodic response of the machine, and its stability')
    option(sub, '--longest', 'P', 'with --periodic: longest period, in revolutions', 8)
    option(sub, '--transient', 'N', 'with --periodic: revolutions left out for settling', 60)
    text = "instead: four-bars for a path ('x [mm]', 'y [mm]') or a body ('orientation [deg]' too)"
    option(sub, '--path', 'FILE.csv', text)
    text = 'with --path: least transmission angle'
    option(sub, '--transmission', 'ANGLE', text, '20 deg')
    _teeth_options(sub)
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
    workers_options(sub)
    option(sub, '--bags', 'DIR', 'also record every run, in this folder')
    option(sub, '--windows', 'DIR', 'folder for windows of signals; TABLE.windows if not given')
    flag(sub, '--restart', 'discard what was computed before')
    option(sub, '--plot', 'FILE', 'draw the measures over the last swept value')
    option(sub, '--over', 'PATH', 'with --plot and --plots: over this swept value')
    option(sub, '--effects', 'FILE', 'draw the main effects of swept values on measures')
    flag(sub, '--first-order', "instead: shares of variance and worst case of the tolerances in "
         "'vary', by one run with derivatives, and runs that say if that is enough")  # fmt: skip
    option(sub, '--plots', 'PLACE', 'draw all charts: these, tornados and response surfaces; to a '
           'folder, a .pdf, or NAME.svg for NAME_*.svg')  # fmt: skip
    option(sub, '--pareto', 'A,B', 'with --plots: Pareto front of two measures, each minimised, '
           'or maximised as -A')  # fmt: skip


def _periodic(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, studies  # noqa: PLC0415
    from mechanism_sim.studies.periodic import find_periodic  # noqa: PLC0415

    if options.longest < 1 or options.transient < 1:
        raise InputError('--longest and --transient must be at least 1')
    machine = read_machine(options)
    with progress.busy('periodic', options.json) as say:
        response = find_periodic(machine, options.longest, options.transient, progress=say)
    text = (
        f'no response that repeats within {options.longest} revolutions after '
        f"{options.transient}; 'mechanism-sim statistics' gives its means"
    )
    return print_either(
        options, studies.periodic_json(response), studies.periodic(response) if response else text
    )


def _statistics(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, studies  # noqa: PLC0415
    from mechanism_sim.studies.statistics import statistics  # noqa: PLC0415

    if options.exponents is not None:
        refuse_options(options, ['measure'], 'does not apply to --exponents')
        return _exponents(options)
    machine, turns, skip = _turning(options)
    with progress.bar('statistics', turns * machine.drive.period, quiet=options.json) as show:
        found = statistics(machine, turns, skip, show, read_measures(options, machine))
    return print_result(options, found, studies.statistics_json, studies.statistics)


def _turning(options: argparse.Namespace) -> tuple[Machine, int, int]:
    """A machine, the number of turns of its run, and of those to leave out."""
    machine = read_machine(options)
    turns = math.floor(turns_of(options, machine, 200) * (1.0 + 1e-12))
    return machine, turns, skipped_turns(options, 20)


def _exponents(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, studies  # noqa: PLC0415
    from mechanism_sim.studies.lyapunov import lyapunov  # noqa: PLC0415

    machine, turns, skip = _turning(options)
    length = (skip + turns) * machine.drive.period
    with progress.bar('exponents', length, quiet=options.json) as show:
        found = lyapunov(machine, turns, skip, options.exponents, show)
    return print_result(options, found, studies.exponents_json, studies.exponents_text)


def _lift_off(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, studies  # noqa: PLC0415
    from mechanism_sim.studies.lift_off import lift_offs  # noqa: PLC0415

    machine = read_machine(options)
    with progress.busy('find', options.json) as say:
        found = lift_offs(machine, say)
    return print_result(options, found, list, studies.lift_offs)


_SEARCH = (
    'vary', 'so-that', 'minimise', 'maximise', 'subject-to', 'values', 'duration', 'revolutions',
    'search', 'evaluations', 'gradients', 'output', 'restart', 'workers', 'dask',
)  # fmt: skip
_PERIODIC = 'periodic', 'longest', 'transient'
_SCENE = 'set', 'tables-from', 'rtol', 'atol'
_TEETH = 'stages', 'tolerance', 'teeth-range', 'centre-distance', 'modules'


def _find(options: argparse.Namespace) -> int:
    """Search for a value of a key, a speed of lift-off, a periodic response, or teeth."""
    if options.path is not None:
        others = ['lift-off', *_PERIODIC, *_SEARCH, *_SCENE, *_TEETH, 'teeth']
        others = [x for x in others if x not in ('output', 'tables-from')]
        refuse_options(options, others, 'does not apply to --path')
        return _path(options)
    if options.teeth is not None:
        own = 'needs a scene, and --teeth takes none'
        refuse_options(options, ['lift-off', *_PERIODIC, *_SEARCH, *_SCENE], own)
        if options.scene is not None:
            raise InputError(f"find --teeth takes no scene, but '{options.scene}' was given")
        return _teeth(options)
    refuse_options(options, _TEETH, 'needs --teeth')
    refuse_options(options, ['transmission'], 'needs --path')
    if options.scene is None:
        raise InputError('find: SCENE is missing; see --help')
    if options.periodic:
        refuse_options(options, ['lift-off', *_SEARCH], 'does not apply to --periodic')
        return _periodic(options)
    refuse_options(options, _PERIODIC, 'needs --periodic')
    if options.lift_off:
        refuse_options(options, _SEARCH, 'does not apply to --lift-off')
        return _lift_off(options)
    return _find_value(options)


def _find_value(options: argparse.Namespace) -> int:
    from mechanism_sim.output import write_text  # noqa: PLC0415
    from mechanism_sim.report import figures, found, progress  # noqa: PLC0415
    from mechanism_sim.scene import load_scene  # noqa: PLC0415
    from mechanism_sim.studies.find import find  # noqa: PLC0415
    from mechanism_sim.studies.goal import read_goals  # noqa: PLC0415
    from mechanism_sim.studies.parameters import read_limits  # noqa: PLC0415

    goals = read_goals(options.so_that, options.minimise, options.maximise, options.subject_to)
    vary = read_limits('--vary', options.vary or [''], lists=True)
    scene, table, picture = _outputs(options)
    front = len(options.minimise) + len(options.maximise) > 1
    if picture and not front and (len(vary) > 1 or len(goals) > 1):
        raise InputError('--output: a picture is the curve of one key and one goal, or a front')
    if options.restart and not table:
        raise InputError('--restart needs a table, -o FILE.csv, and its journal')
    if options.values < 2 or options.evaluations < 1:
        raise InputError('--values must be at least 2, --evaluations at least 1')
    workers = read_workers(options, 1)
    machine = read_machine(options)
    say_turns(options, machine, of_cycle=True)
    evolves = front or options.search == 'global'
    total = options.evaluations if evolves else options.values
    with progress.count('find', total, options.json) as show:
        result = find(
            machine, vary, options.so_that, minimise=options.minimise,
            maximise=options.maximise, subject_to=options.subject_to, samples=options.values,
            search=options.search, evaluations=options.evaluations, gradients=options.gradients,
            file=table, restart=options.restart, workers=workers, show=show,
            duration=options.duration,
            **({} if options.revolutions is None else {'periods': options.revolutions}),
        )  # fmt: skip
    if scene and result.values:
        write_text(scene, load_scene(machine, result.values).scene.to_yaml())
    if picture:
        figures.draw(found.chart(result, machine.scene.title), picture)
    print_result(options, result, found.to_json, found.text)
    return 0 if result.successful else 1


def _path(options: argparse.Namespace) -> int:
    from mechanism_sim.output import write_text  # noqa: PLC0415
    from mechanism_sim.report import found  # noqa: PLC0415
    from mechanism_sim.scene import load_scene  # noqa: PLC0415
    from mechanism_sim.scene.table_keys import allowed_file  # noqa: PLC0415
    from mechanism_sim.studies.four_bars import find_four_bars  # noqa: PLC0415
    from mechanism_sim.terminal import print_notice  # noqa: PLC0415

    if options.scene is not None:
        raise InputError(f"find --path takes no scene, but '{options.scene}' was given")
    scene, *others = _outputs(options)
    if any(others):
        raise InputError('--output: find --path writes a scene, NAME.yaml')
    least = quantity('--transmission', options.transmission, 'rad')[0]
    if scene:  # which measures the distance from the file
        allowed_file('--path', Path.cwd(), options.path)
    designs = find_four_bars(options.path, least)
    if scene:
        assumed = designs[0].ASSUMED
        write_text(
            scene, f'# {assumed}\n{load_scene(designs[0].scene(options.path)).scene.to_yaml()}'
        )
        print_notice(f'{scene}: {assumed}')
    return print_result(options, designs, found.four_bars_json, found.four_bars_text)


def _outputs(options: argparse.Namespace) -> tuple[Path | None, Path | None, Path | None]:
    """Files for the scene, the table and the picture, by their endings."""
    from mechanism_sim import tables  # noqa: PLC0415
    from mechanism_sim.output import check_path  # noqa: PLC0415
    from mechanism_sim.report import figures  # noqa: PLC0415

    found: dict[int, Path] = {}
    for file in options.output:
        ending = Path(file).suffix
        if ending in ('.yaml', '.yml'):
            kind, path = 0, check_path('--output', file, ending, new=True)
        elif ending in tables.ENDINGS:
            kind, path = 1, tables.check_file('--output', file)
        elif ending in figures.SUFFIXES:
            kind, path = 2, figures.check_picture('--output', file)
        else:
            raise InputError(
                f'--output {file}: the ending must be .yaml for a scene, '
                f'{", ".join(tables.ENDINGS)} for a table, or {", ".join(figures.SUFFIXES)} for a '
                'picture'
            )
        if kind in found:
            raise InputError(f"--output: '{found[kind]}' and '{file}' are of one kind: keep one")
        found[kind] = path
    return found.get(0), found.get(1), found.get(2)


def _teeth_options(sub: argparse.ArgumentParser) -> None:
    more = sub.add_argument_group('numbers of teeth, without a scene')
    option(more, '--teeth', 'RATIO', "ratio of speeds, without sign, as 3.5 or '7/2'")
    option(more, '--stages', 'N', 'number of pairs of gears in series', 1)
    option(more, '--tolerance', 'X', 'largest relative error of the ratio', 0.0)
    option(more, '--teeth-range', 'A:B', 'least and largest number of teeth of a gear', '18:120')
    option(more, '--centre-distance', 'C', "of every stage, as '60 mm'; with --modules")
    option(more, '--modules', 'M,...', "modules to choose from, as '2 mm,2.5 mm'")


def _teeth(options: argparse.Namespace) -> int:
    from mechanism_sim.ranges import read_range  # noqa: PLC0415
    from mechanism_sim.report import teeth  # noqa: PLC0415
    from mechanism_sim.studies.teeth import TrainSearch, ratio_of  # noqa: PLC0415

    fewest, most = read_range('--teeth-range', options.teeth_range, '18:120').values
    if not (fewest.isdecimal() and most.isdecimal()):
        raise InputError(f"--teeth-range '{options.teeth_range}': both must be whole numbers")
    count = int(fewest), int(most)
    distance = (
        quantity('--centre-distance', options.centre_distance, 'm')[0]
        if options.centre_distance
        else None
    )
    listed = options.modules.split(',') if options.modules else ()
    modules = [quantity('--modules', m, 'm')[0] for m in listed]
    search = TrainSearch(
        ratio_of(options.teeth), options.stages, options.tolerance, count, distance, modules
    )
    return print_result(options, search, teeth.to_json, teeth.render)


def _sweep(options: argparse.Namespace) -> int:
    from mechanism_sim.report import figures, progress  # noqa: PLC0415
    from mechanism_sim.report import sweep as report  # noqa: PLC0415
    from mechanism_sim.report.sweep import SweepCharts  # noqa: PLC0415
    from mechanism_sim.studies.plan import read_plan  # noqa: PLC0415
    from mechanism_sim.studies.sweep import run_plan  # noqa: PLC0415
    from mechanism_sim.tables import check_file, default_ending  # noqa: PLC0415

    if options.output:  # the plan of many runs takes its time
        check_file('-o', options.output)
    with progress.busy('checking', options.json) as say:
        plan = read_plan(options.file, options.measures, say)
    if options.first_order:
        return _first_order(options, plan)
    table = Path(options.output or f'{plan.name}{default_ending()}')
    if options.over and not (options.plot or options.plots):
        raise InputError('--over needs --plot FILE or --plots PLACE')
    for name in ('plot', 'effects', 'plots'):
        file = getattr(options, name)
        report.check_charts(plan, file, None if name == 'effects' else options.over, f'--{name}')
    pareto = [x for x in (options.pareto or '').split(',') if x]
    if pareto and (len(pareto) != 2 or not options.plots):
        raise InputError("--pareto 'A,B' are two measures, with --plots PLACE")
    with progress.count('sweep', plan.size, quiet=options.json) as show:
        summary, rows = run_plan(
            plan, table, options.workers, options.dask, options.bags, options.windows,
            options.restart, show,
        )  # fmt: skip
    if options.plot or options.effects or options.plots:
        drawn = SweepCharts(plan, rows)
        if options.plot:
            figures.draw(drawn.over(options.over), Path(options.plot))
        if options.effects:
            figures.draw(drawn.effects(), Path(options.effects))
        if options.plots:
            figures.save_all(drawn.charts(options.over, pareto), Path(options.plots))
    return print_result(
        options, summary, lambda x: report.to_json(x, plan, rows),
        lambda x: report.render(x, plan, rows),
    )  # fmt: skip


def _first_order(options: argparse.Namespace, plan: SweepPlan) -> int:
    """Tolerances to first order, with their table and tornados."""
    from mechanism_sim import tables  # noqa: PLC0415
    from mechanism_sim.report import figures, progress  # noqa: PLC0415
    from mechanism_sim.report import sweep as report  # noqa: PLC0415
    from mechanism_sim.report.sweep import SweepCharts  # noqa: PLC0415
    from mechanism_sim.studies.tolerances import first_order  # noqa: PLC0415

    others = 'plot', 'over', 'effects', 'bags', 'windows', 'restart', 'pareto'
    refuse_options(options, others, 'does not apply to --first-order')
    report.check_charts(plan, options.plots, None, '--plots')
    table = Path(options.output) if options.output else None
    count = 1 + 2 * len(plan.factors) + 2 * len(plan.measures)
    workers = read_workers(options)
    with progress.count('sweep', count, quiet=options.json) as show, workers:
        found = first_order(plan, workers, show)
    if table:
        tables.write(table, report.first_order_table(found), {'sweep': plan.name})
    if options.plots:
        drawn = SweepCharts(found.plan, found.rows, found.effects)
        figures.save_all(drawn.tornados(), Path(options.plots))
    return print_result(options, found, report.first_order_json, report.first_order)
