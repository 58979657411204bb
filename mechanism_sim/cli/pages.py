"""Commands with results for a browser."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from mechanism_sim import output
from mechanism_sim.cli.options import (
    Command,
    flag,
    measure_option,
    option,
    overrides_of,
    path_of,
    print_either,
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
        'a page that plays a run and charts it, or compares several; one HTML file',
    )
    source_options(sub)
    measure_option(sub)
    sub.add_argument(
        'beside', metavar='BAG|SCENE', nargs='*', default=[],
        help='further runs to compare with the first; --set applies to all scenes',
    )  # fmt: skip
    text = 'change a value of the last scene; a single scene is compared with its changed copy'
    several(sub, '--set-other', 'PATH=VALUE', text, 'others')
    text = 'a run of the scene for each of these values, as drive.speed=300rpm,400rpm'
    option(sub, '--compare', 'PATH=VALUES', text)
    option(sub, '-o --output', 'FILE', 'the .html file; named after the run if not given')

    sub = command('view', _view, 'a machine while it runs, in a browser, with sliders')
    scene_options(sub, 'a scene to run with it; without one it follows what runs', count='?')
    time_option(sub, '--duration', 'length of the run; 1 h if none is known')
    option(sub, '--revolutions', 'N', 'turns of the drive to run, instead', float)
    option(
        sub, '--realtime-factor', 'F',
        'simulated seconds per second; 0: as fast as possible; if not given, a turn takes some '
        'seconds',
        float,
    )  # fmt: skip
    flag(sub, '--paused', 'begin its run paused')
    option(sub, '--port', 'N', 'port of the page, 8080 if not given; 0: any free one', int)
    flag(sub, '--open', 'open a browser')
    option(sub, '--namespace', 'NS', 'namespace of the nodes that are followed')

    sub = command('edit', _edit, 'draw and edit a machine in a browser')
    sub.add_argument(
        'scene', metavar='SCENE', nargs='?',
        help='a scene of the package (a copy is edited) or a file, also one that `import` '
        'reads; a new scene if not given',
    )  # fmt: skip
    tables_option(sub)
    option(sub, '--port', 'N', 'port of the page, 8080 if not given; 0: any free one', int)
    flag(sub, '--open', 'open a browser')


def _report(options: argparse.Namespace) -> int:
    if options.beside or options.others or options.compare:
        return _compare(options)
    from mechanism_sim.pages.writing import write_page  # noqa: PLC0415
    from mechanism_sim.report import measured, progress  # noqa: PLC0415

    file = _page(options, Path(options.scene).stem)
    record, start, end = run_of(options)
    source = Path(options.scene).name if is_bag(options.scene) else ''
    digest, record = record.digest(), record.between(start, end)
    measures = read_measures(options, record.machine)
    with progress.bar('report', record.end, quiet=options.json) as show:
        size, found = write_page(record, file, source, digest, measures, show)
    data = {
        'scene': record.machine.name, 'file': str(file), 'start': record.start,
        'end': record.end, 'size': size, **measured.to_json(found),
    }  # fmt: skip
    return print_either(options, data, file)


def _page(options: argparse.Namespace, default: str) -> Path:
    """Path of the page; for a picture, an error that names the right command."""
    file = options.output or f'{default}.html'
    if Path(file).suffix in ('.pdf', '.png', '.svg'):
        other = 'plot SCENE NAME -o' if is_bag(options.scene) else 'cycle SCENE --plots'
        raise InputError(
            f'--output {file}: the ending must be .html or .htm; the charts as pictures: '
            f"'mechanism-sim {other.replace('SCENE', options.scene)} {file}'"
        )
    return output.check_path('--output', file, '.html', '.htm')


def _compare(options: argparse.Namespace) -> int:
    """The page of several runs; without `--json` the table of their differences, too."""
    refuse_options(options, ['measure'], 'does not apply to a comparison of runs')
    from mechanism_sim.analysis import comparison  # noqa: PLC0415
    from mechanism_sim.pages.writing import write_comparison  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415

    asked = _compared(options)
    stems = list(dict.fromkeys(Path(source).stem for source, _ in asked))
    default = '_'.join(stems) if len(stems) > 1 else f'{stems[0]}_variant'
    file = _page(options, default)
    only_bags = all(is_bag(source) for source, _ in asked)
    records, names = [], []
    for source, more in asked:
        run = argparse.Namespace(**{**vars(options), 'scene': source})
        own = {path_of(text) for text in more}
        run.overrides = [*(x for x in options.overrides if path_of(x) not in own), *more]
        if is_bag(source) and not only_bags:  # other options are for scenes
            run.overrides, run.rtol, run.atol = list(more), None, None
        record, start, end = run_of(run)
        records.append(record.between(start, end))
        names.append(f'{Path(source).name}{" with " if more else ""}{", ".join(more)}')
    with progress.busy('drawing charts', quiet=options.json):
        page = write_comparison(records, names, file)
    scenes = [{'path': path, 'values': values} for path, values in page.scenes.items()]
    found = comparison.to_json(page.differences)
    data = {'file': str(file), 'runs': names, 'scenes': scenes, 'differences': found}
    return print_either(
        options, data, f'{comparison.render(page.differences, page.names)}\n{file}'
    )


def _compared(options: argparse.Namespace) -> list[tuple[str, Sequence[str]]]:
    """The runs that are compared: their sources, and the overrides of each."""
    sources = [options.scene, *options.beside]
    if options.compare:
        refuse_options(options, ['set-other'], 'cannot be combined with --compare')
        path, _, values = options.compare.partition('=')
        if options.beside or not values.strip():
            raise InputError(
                f"--compare '{options.compare}': one scene, a key and its values, for example "
                'report slider_crank --compare drive.speed=300rpm,400rpm'
            )
        return [(options.scene, [f'{path}={value.strip()}']) for value in values.split(',')]
    if options.others and len(sources) == 1:
        sources.append(options.scene)
    return [*((source, ()) for source in sources[:-1]), (sources[-1], options.others)]


def _view(options: argparse.Namespace) -> int:
    from mechanism_sim.nodes.middleware import Parameter  # noqa: PLC0415
    from mechanism_sim.pages.viewing import view  # noqa: PLC0415

    given = {'port': options.port, 'open': options.open or None}
    parameters = [Parameter(name, value=x) for name, x in given.items() if x is not None]
    run = _run_arguments(options) if options.scene else []
    if not run:
        own = 'set', 'rtol', 'atol', 'duration', 'revolutions', 'realtime-factor', 'paused'
        refuse_options(options, own, 'needs a run of its own: give a SCENE')
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
        pace = visible_pace(machine, duration)
    if not 0.0 <= pace < math.inf:
        raise InputError('--realtime-factor must be 0 (no limit) or positive')
    return [
        options.scene, '--hold', '--duration', repr(duration),
        '--realtime-factor', repr(pace),
        *(part for text in overrides for part in ('--set', text)),
        *(['--paused'] if options.paused else []),
        *ros_args(options),
    ]  # fmt: skip
