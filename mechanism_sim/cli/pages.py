"""Commands whose result is shown by a browser."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from mechanism_sim import output
from mechanism_sim.cli.options import (
    Command,
    flag,
    measure_option,
    option,
    overrides_of,
    path_of,
    print_json,
    read_machine,
    read_measures,
    refuse_options,
    ros_args,
    scene_options,
    several,
    tables_option,
    time_option,
)
from mechanism_sim.cli.source import is_bag, run_of, source_options
from mechanism_sim.errors import InputError

HOUR = 3600.0  # [s]


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command(
        'report',
        _report,
        'a page that plays a run and charts it, or compares two; one HTML file',
    )
    source_options(sub)
    measure_option(sub)
    sub.add_argument(
        'other', metavar='BAG|SCENE', nargs='?',
        help='a second run, which the first is compared with; --set is for scenes among both',
    )  # fmt: skip
    text = 'change a value of the second scene, which is the first one if not given'
    several(sub, '--set-other', 'PATH=VALUE', text, 'others')
    option(sub, '-o --output', 'FILE', 'the .html file; named after the run if not given')

    sub = command('view', _view, 'a machine while it runs, in a browser, with sliders')
    scene_options(sub, 'a scene to be run with it; without one it follows what runs', count='?')
    time_option(sub, '--duration', 'length of the run; 1 h if none is known')
    option(sub, '--revolutions', 'N', 'turns of the drive to run, instead', float)
    option(
        sub, '--realtime-factor', 'F',
        'simulated seconds in a second; 0: as fast as possible; if not given, a turn takes some '
        'seconds',
        float,
    )  # fmt: skip
    flag(sub, '--paused', 'begin its run paused')
    option(sub, '--port', 'N', 'of the page on this machine, 8080 if not given; 0: any', int)
    flag(sub, '--open', 'open a browser')
    option(sub, '--namespace', 'NS', 'namespace of the nodes that are followed')

    sub = command('edit', _edit, 'draw and change a machine by touch, in a browser')
    sub.add_argument(
        'scene', metavar='SCENE', nargs='?',
        help='a scene of the package, of which a copy is edited, a file, also one that `import` '
        'reads; without: a new one',
    )  # fmt: skip
    tables_option(sub)
    option(sub, '--port', 'N', 'of the page on this machine, 8080 if not given; 0: any', int)
    flag(sub, '--open', 'open a browser')


def _report(options: argparse.Namespace) -> int:
    if options.other or options.others:
        return _compare(options)
    from mechanism_sim.pages.writing import write_page  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415

    file = output.check_path(
        '--output', options.output or f'{Path(options.scene).stem}.html', '.html', '.htm'
    )
    record, start, end = run_of(options)
    source = Path(options.scene).name if is_bag(options.scene) else ''
    digest, record = record.digest(), record.between(start, end)
    measures = read_measures(options, record.machine)
    with progress.bar('report', record.end, quiet=options.json) as show:
        size = write_page(record, file, source, digest, measures, show)
    if options.json:
        print_json(
            {
                'scene': record.machine.name,
                'file': str(file),
                'start': record.start,
                'end': record.end,
                'size': size,
            }
        )
    else:
        print(file)
    return 0


def _compare(options: argparse.Namespace) -> int:
    """The page of two runs; for people the table of their differences too."""
    refuse_options(options, ['measure'], 'does not apply to a comparison of two runs')
    from mechanism_sim.analysis import comparison  # noqa: PLC0415
    from mechanism_sim.pages.writing import write_comparison  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415

    sources = options.scene, options.other or options.scene
    stems = [Path(source).stem for source in sources]
    default = f'{stems[0]}_variant' if stems[0] == stems[1] else '_'.join(stems)
    file = output.check_path('--output', options.output or f'{default}.html', '.html', '.htm')
    both_bags = all(map(is_bag, sources))
    records = []
    for source, more in zip(sources, ([], options.others), strict=True):
        asked = argparse.Namespace(**{**vars(options), 'scene': source})
        own = {path_of(text) for text in more}
        asked.overrides = [*(x for x in options.overrides if path_of(x) not in own), *more]
        if is_bag(source) and not both_bags:  # the others are for the scene
            asked.overrides, asked.rtol, asked.atol = more, None, None
        record, start, end = run_of(asked)
        records.append(record.between(start, end))
    names = Path(sources[0]).name, Path(sources[1]).name
    if options.others and not options.other:
        names = names[0], f'{names[1]} with {", ".join(options.others)}'
    with progress.busy('drawing charts', quiet=options.json):
        found = write_comparison((records[0], records[1]), names, file)
    if options.json:
        print_json({'file': str(file), 'runs': names, 'differences': comparison.to_json(found)})
    else:
        print(comparison.render(found, ('A', 'B')))
        print(file)
    return 0


def _view(options: argparse.Namespace) -> int:
    from mechanism_sim.nodes.middleware import Parameter  # noqa: PLC0415
    from mechanism_sim.pages.viewing import view  # noqa: PLC0415

    given = {'port': options.port, 'open': options.open or None}
    parameters = [Parameter(name, value=x) for name, x in given.items() if x is not None]
    run = _run_arguments(options) if options.scene else []
    if not run:
        own = 'set', 'rtol', 'atol', 'duration', 'revolutions', 'realtime-factor', 'paused'
        refuse_options(options, own, 'is for a run of its own: give a SCENE')
    opened = (lambda address: print_json({'address': address})) if options.json else None
    return view(parameters, run, ros_args(options), opened)


def _edit(options: argparse.Namespace) -> int:
    from mechanism_sim.editor.document import Document  # noqa: PLC0415
    from mechanism_sim.editor.serving import edit  # noqa: PLC0415

    document = Document.open(options.scene) if options.scene else Document()

    def opened(address: str) -> None:
        if options.json:
            print_json({'address': address})
        else:
            print(f'Edit: {address}', flush=True)

    return edit(document, options.port, options.open, opened)


def _run_arguments(options: argparse.Namespace) -> list[str]:
    """Arguments of `mechanism-sim run`, checked before a browser opens."""
    from mechanism_sim.pages.controls import visible_pace  # noqa: PLC0415
    from mechanism_sim.scene import run_length  # noqa: PLC0415

    machine, overrides = read_machine(options), overrides_of(options)
    known = options.duration or machine.scene.duration or HOUR
    turns = options.revolutions
    duration = run_length(machine, turns, options.duration if turns is not None else known)
    pace = options.realtime_factor
    if pace is None:
        pace = visible_pace(machine)
    if not 0.0 <= pace < math.inf:
        raise InputError('--realtime-factor must be 0 (no limit) or positive')
    return [
        options.scene, '--hold', '--duration', repr(duration),
        '--realtime-factor', repr(pace),
        *(part for text in overrides for part in ('--set', text)),
        *(['--paused'] if options.paused else []),
        *ros_args(options),
    ]  # fmt: skip
