"""What a browser shows."""

from __future__ import annotations

import argparse
from pathlib import Path

from mechanism_sim.cli.options import (
    Command,
    length_options,
    overrides_of,
    print_json,
    ros_args,
    scene_options,
)
from mechanism_sim.errors import InputError

HOUR = 3600.0  # [s]


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('report', _report, 'a page that plays a run and charts it, in one HTML file')
    scene_options(sub, 'a bag of a run, or a scene to be run')
    length_options(sub)
    sub.add_argument('-o', '--output', metavar='FILE', help='.html; named after the run if not')
    sub.add_argument('--namespace', help='of the machine, where a bag holds several')
    sub.add_argument('--from', type=float, metavar='S', dest='start', help='begin at, in seconds')
    sub.add_argument('--to', type=float, metavar='S', dest='end', help='end at, in seconds')

    sub = command('view', _view, 'a machine while it runs, in a browser, with sliders')
    scene_options(sub, 'a scene to be run with it; without one it follows what runs', count='?')
    sub.add_argument(
        '--duration', type=float, metavar='S', help='of its run; 1 h if none is known'
    )
    sub.add_argument('--realtime-factor', type=float, default=1.0, metavar='F', help='0: no limit')
    sub.add_argument('--paused', action='store_true', help='begin its run paused')
    sub.add_argument('--port', type=int, help='of the page on this machine, 8080; 0: any')
    sub.add_argument('--open', action='store_true', help='open a browser')
    sub.add_argument('--namespace', metavar='NS', help='of the nodes that are followed')


def _report(options: argparse.Namespace) -> int:
    from mechanism_sim.analysis.record import Record, read_record  # noqa: PLC0415
    from mechanism_sim.pages import report  # noqa: PLC0415
    from mechanism_sim.pages.charts import sections  # noqa: PLC0415
    from mechanism_sim.pages.recorded import recorded  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.scene import load_scene, simulate, span  # noqa: PLC0415

    file = report.check_file(options.output or f'{Path(options.scene).stem}.html')
    bag = Path(options.scene)
    source = ''
    if bag.suffix == '.mcap' or bag.is_dir():
        if overrides_of(options) or options.duration or options.revolutions:
            raise InputError('a bag is shown as it was recorded: leave out --set and lengths')
        record = read_record(bag, options.namespace)
        source = bag.name
    else:
        if options.namespace:
            raise InputError('--namespace is for bags of several machines')
        machine = load_scene(options.scene, overrides_of(options))
        end = span(machine, options.revolutions, options.duration)
        with progress.bar('run', end, quiet=options.json) as show:
            record = Record(machine, simulate(machine, duration=end, progress=show), {})
    digest = record.digest()
    record = record.between(options.start, options.end)
    with progress.bar('report', record.end, quiet=options.json) as show:
        shown = recorded(record, show)
    with progress.busy('drawing charts', quiet=options.json):
        parts = sections(record)
    text = report.page(shown, parts, source, digest)
    report.write(text, file)
    if options.json:
        print_json(
            {
                'scene': record.machine.name,
                'file': str(file),
                'start': record.start,
                'end': record.end,
                'size': len(text.encode()),
            }
        )
    else:
        print(file)
    return 0


def _view(options: argparse.Namespace) -> int:
    from mechanism_sim.middleware import Parameter  # noqa: PLC0415
    from mechanism_sim.pages.view import view  # noqa: PLC0415

    given = {'port': options.port, 'open': options.open or None}
    parameters = [Parameter(name, value=x) for name, x in given.items() if x is not None]
    run = _run_to_be_viewed(options) if options.scene else []
    if not run and (overrides_of(options) or options.duration or options.paused):
        raise InputError('--set, --duration and --paused are for a run of its own: give a SCENE')
    opened = (lambda address: print_json({'address': address})) if options.json else None
    return view(parameters, run, ros_args(options), opened)


def _run_to_be_viewed(options: argparse.Namespace) -> list[str]:
    """What `mechanism-sim run` is given, checked before a browser opens."""
    from mechanism_sim.scene import load_scene, span  # noqa: PLC0415

    overrides = overrides_of(options)
    machine = load_scene(options.scene, overrides)
    duration = span(machine, None, options.duration or machine.scene.duration or HOUR)
    if options.realtime_factor < 0.0:
        raise InputError('--realtime-factor must be 0 (no limit) or positive')
    return [
        options.scene, '--hold', '--duration', repr(duration),
        '--realtime-factor', repr(options.realtime_factor),
        *(part for text in overrides for part in ('--set', text)),
        *(['--paused'] if options.paused else []),
        *ros_args(options),
    ]  # fmt: skip
