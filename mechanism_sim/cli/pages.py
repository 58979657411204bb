"""What a browser shows."""

from __future__ import annotations

import argparse
from pathlib import Path

from mechanism_sim.cli.options import (
    Command,
    length_options,
    overrides_of,
    print_json,
    scene_options,
)
from mechanism_sim.errors import InputError


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('report', _report, 'a page that plays a run and charts it, in one HTML file')
    scene_options(sub, 'a bag of a run, or a scene to be run')
    length_options(sub)
    sub.add_argument('-o', '--output', metavar='FILE', help='.html; named after the run if not')
    sub.add_argument('--namespace', help='of the machine, where a bag holds several')
    sub.add_argument('--from', type=float, metavar='S', dest='start', help='begin at, in seconds')
    sub.add_argument('--to', type=float, metavar='S', dest='end', help='end at, in seconds')


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
    if bag.suffix == '.mcap' or any(bag.glob('*.mcap')):
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
