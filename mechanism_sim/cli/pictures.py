"""Films, sounds and plots of runs, recorded in a bag or simulated here."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mechanism_sim import output
from mechanism_sim.cli.options import (
    TABLES,
    Command,
    flag,
    look_options,
    option,
    print_either,
    print_result,
    quantity,
    rate_option,
    refuse_options,
    several,
)
from mechanism_sim.cli.source import (
    is_bag,
    read_run,
    refuse_overrides,
    run_of,
    simulate_run,
    source_options,
    warn_if_incomplete,
    warn_of_gaps,
)
from mechanism_sim.errors import InputError, check_known
from mechanism_sim.recording.runs import BAG_ENDINGS
from mechanism_sim.terminal import print_notice

if TYPE_CHECKING:
    from mechanism_sim.analysis.open_run import Asked, AskedSignals
    from mechanism_sim.analysis.series import Series
    from mechanism_sim.planar.mechanism import Mechanism
    from mechanism_sim.recording.reader import Bag
    from mechanism_sim.report.charts.lines import Abscissa
    from mechanism_sim.scene import Machine


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command(
        'animate', _animate, 'a film of a run, or its sound: MP4, GIF, SVG frames or WAV'
    )
    source_options(sub)
    option(sub, '-o --output', 'FILE|DIR', '.mp4, .gif, .svg to be numbered, or a folder for '
        'SVG frames; .wav: the sound of impacts; SCENE.mp4 if not given')  # fmt: skip
    rate_option(sub, '--fps', 'frames a second', '25 Hz')
    option(
        sub, '--realtime-factor', 'F',
        'simulated seconds per second; if not given, a turn of the drive takes 3 s, less than a '
        'turn 6 s, and a sound lasts as long as the run',
        float,
    )  # fmt: skip
    option(sub, '--size', 'PIXELS', "number of pixels of the longer side, or '1280x720'")
    glass = sub.add_mutually_exclusive_group()
    option(glass, '--lens', 'JOINT', 'the joint with clearance that is magnified', '')
    glass.add_argument('--no-lens', action='store_const', const=None, dest='lens', help='no lens')
    flag(sub, '--forces', 'draw forces as arrows at the joints')
    look_options(sub, 'none')
    heard = sub.add_argument_group('of a sound')
    option(heard, '--distance', 'R', 'distance of the listener from the machine', '1 m')
    option(heard, '--direction', 'ANGLE', "direction of the listener, as '90 deg'; 0 if not given")
    option(heard, '--pulse', 'T', "duration of an impact, as '0.1 ms'")
    sub = command(
        'plot',
        _plot,
        'plot quantities of a run over time, the angle of the drive or another quantity',
    )
    source_options(sub)
    sub.add_argument(
        'what', nargs='*', default=[], metavar='WHAT',
        help='TOPIC.FIELD of a bag, a quantity such as normal_force.JOINT, or a channel of a '
        '.csv, .xlsx, .mat, .wav, .uff or .tdms file; without any, all there are; before them '
        'further recorded runs',
    )  # fmt: skip
    several(
        sub, '-o --output', 'FILE',
        f'a .svg, .png or .pdf file for the plot, {TABLES} for the numbers; may be given for '
        'both; SCENE_plot.svg if not given',
    )  # fmt: skip
    option(
        sub, '--against', 'angle|NAME',
        'the angle of the main drive, or another WHAT, instead of the time; the direction of a '
        'vector makes a polar chart', 'time',
    )  # fmt: skip
    flag(sub, '--ideal', 'also draw the same machine with ideal joints')
    option(sub, '--full-scale', 'Q', "largest number of a .wav, as '50 m/s^2'")
    option(sub, '--sample-rate', 'F', "of a table without times, as '12 kHz'")
    flag(sub, '--charts', 'WHAT are charts of the report, as forces or impacts; without any, all: '
         'to a folder, a .pdf, or files as FILE_CHART.svg')  # fmt: skip


_SEEN = 'fps', 'size', 'lens', 'forces', 'path', 'labels'
_HEARD = 'distance', 'direction', 'pulse'


def _animate(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.report.screen import FilmParts  # noqa: PLC0415
    from mechanism_sim.report.video import Target, film  # noqa: PLC0415

    if Path(options.output or '').suffix == '.wav':
        refuse_options(options, _SEEN, 'applies to a film, not to a .wav file')
        return _sound(options)
    refuse_options(options, _HEARD, 'applies to a sound: write to a .wav file')
    target = Target(options.output or f'{Path(options.scene).stem}.mp4')
    size = _size(options.size) if options.size else None
    record, start, end = run_of(options)
    chosen = film(record, target, start, end, options.fps, options.realtime_factor)
    shown = FilmParts(options.lens, options.forces, options.path, options.labels)
    with progress.count('animate', len(chosen.t), quiet=options.json) as show:
        files, (width, height) = chosen.write(shown, size, show)
    data = {
        'scene': record.machine.name, 'files': [str(file) for file in files],
        'frames': len(chosen.t), 'fps': chosen.fps, 'start': chosen.start,
        'end': chosen.end, 'speed': chosen.speed, 'width': width, 'height': height,
    }  # fmt: skip
    where = f'{files[0]} to {files[-1].name}' if len(files) > 1 else files[0]
    text = (
        f'{where}: {len(chosen.t)} frames of {width} by {height} pixels, '
        f'{len(chosen.t) / chosen.fps:.3g} s at {chosen.fps:g} a second\n'
        f'from {chosen.start:.6g} s to {chosen.end:.6g} s of a run of {record.end:.6g} s, '
        f'at {chosen.speed:.3g} times real time'
    )
    return print_either(options, data, text)


def _sound(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, sound  # noqa: PLC0415
    from mechanism_sim.sensing.sound import Listener, strikes  # noqa: PLC0415

    refuse_options(
        options, ['from', 'to', 'skip'], 'does not apply to a sound, which covers the whole run'
    )
    listener = Listener(
        quantity('--distance', options.distance, 'm')[0],
        quantity('--direction', options.direction or '0 deg', 'rad')[0],
    )
    pulse = None if options.pulse is None else quantity('--pulse', options.pulse, 's')[0]
    pace = 1.0 if options.realtime_factor is None else options.realtime_factor
    file = output.check_path('--output', options.output, '.wav')
    if is_bag(options.scene):
        if options.duration is not None or options.revolutions is not None:
            raise InputError('the length does not apply to a bag: it is played as it was recorded')
        record = read_run(options)
    else:
        record = simulate_run(options)
    machine, run = record.machine, record.piece
    with progress.busy('sound', options.json) as say:
        say(f'of {len(run.impacts)} impacts')
        train = strikes(machine.mechanism, run.motion, run.impacts)
        written = sound.write(train, run.motion.curve.end, file, listener, pulse, pace)
    return print_result(options, written, asdict, sound.render)


def _plot(options: argparse.Namespace) -> int:
    from mechanism_sim.analysis.open_run import Asked  # noqa: PLC0415
    from mechanism_sim.recording.reader import read_bag  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.signal_files import is_signal_file  # noqa: PLC0415

    if any(map(_is_recorded, options.what)) or is_signal_file(options.scene):
        return _plot_recorded(options)
    refuse_options(options, ['full-scale', 'sample-rate'], 'applies to a file of signals')
    if options.charts:
        refuse_options(options, ['against', 'ideal'], 'does not apply to --charts')
        return _charts(options)
    if not options.what:
        reason = 'needs the name of a quantity; without one all that can be plotted is listed'
        refuse_options(options, ['output', 'against', 'ideal'], reason)
    _check_files(options)
    if options.ideal and options.against not in ('time', 'angle'):
        raise InputError('--ideal is drawn over time or --against angle: the ideal machine has '
                         f'its own {options.against}')  # fmt: skip
    in_bag, record = is_bag(options.scene), None
    start, end = options.start, options.end
    if not in_bag or any(
        x is not None for x in (options.duration, options.revolutions, options.skip)
    ):
        record, start, end = run_of(options, partial(_check_names, options))
    else:
        refuse_overrides(options)
    with progress.share('plot', options.json) as read:
        bag = read_bag(options.scene, read) if in_bag else None
        if bag and record is None:
            warn_if_incomplete(bag, options.scene)
        asked = Asked(bag, record, options.namespace)
        series = asked.series(options.what, start, end) if options.what else []
        if series and options.ideal:
            from mechanism_sim.analysis.deviation import ideal_record  # noqa: PLC0415

            beside = Asked(None, ideal_record(asked.record), options.namespace)
            # Both at the union of their instants, so that each row of a table is complete.
            known = {*beside.record.piece.catalogue, *beside.record.sensors}
            if not (names := [s.name for s in series if s.name in known]):
                raise InputError(f'--ideal: without clearance there is no {options.what[0]}')
            below = beside.series(names, start, end, series)
            series = asked.series(options.what, start, end, below)
            series = [*(replace(s, ideal=True) for s in below), *series]
    if not options.what:
        return _list(options, asked, bag)
    title = Path(options.scene).name if bag else asked.record.machine.scene.title
    titled = title, _over(options, asked, series)
    return _write(options, series, titled, asked.marks(start, end), asked.in_rows(series))


def _over(
    options: argparse.Namespace, asked: Asked | AskedSignals, series: list[Series]
) -> Abscissa:
    """The requested abscissa."""
    from mechanism_sim.analysis.open_run import Asked  # noqa: PLC0415
    from mechanism_sim.report.charts.lines import (  # noqa: PLC0415
        OVER_TIME,
        against,
        against_recorded,
    )

    if options.against == 'time':
        return OVER_TIME
    if given := asked.recorded(options.against):
        return against_recorded(given, series)
    assert isinstance(asked, Asked)  # noqa: S101 - signals know what is recorded only
    return against(asked.record.piece, options.against)


def _is_recorded(name: str) -> bool:
    """True if the ending is that of a bag or of a file of signals."""
    from mechanism_sim.signal_files import is_signal_file  # noqa: PLC0415

    return name.endswith(BAG_ENDINGS) or is_signal_file(name)


def _plot_recorded(options: argparse.Namespace) -> int:
    """A file of signals, or several recorded runs, each line with the name of its file."""
    from mechanism_sim.analysis.open_run import Asked, AskedSignals  # noqa: PLC0415
    from mechanism_sim.recording.reader import read_bag  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.report.charts.lines import OVER_TIME  # noqa: PLC0415
    from mechanism_sim.signal_files import is_signal_file  # noqa: PLC0415

    runs = list(dict.fromkeys([options.scene, *filter(_is_recorded, options.what)]))
    names, single = [name for name in options.what if name not in runs], len(runs) == 1
    others = 'charts', 'ideal', 'duration', 'revolutions', 'skip', 'set'
    what = 'a file of signals' if single else 'several runs in one plot'
    more = 'namespace' if single else 'against'
    refuse_options(options, [*others, more], f'does not apply to {what}')
    if names:
        _check_files(options)
    elif single:
        refuse_options(options, ['output', 'against'], 'needs the name of a channel')
    else:
        raise InputError(f'plot: name what of {", ".join(runs)} is to be plotted')
    # names need no scale
    scales = options.full_scale or '', bool(names), options.sample_rate or ''
    series: list[Series] = []
    in_rows: list[Series] = []
    for run in runs:
        if not (_is_recorded(run) or is_bag(run)):
            raise InputError(f"'{run}' is not recorded: plot shows several runs of files only")
        with progress.share('plot', options.json) as read:
            asked: Asked | AskedSignals
            if is_signal_file(run):
                asked = AskedSignals(run, *scales)
            else:
                bag = read_bag(run, read)
                warn_if_incomplete(bag, run)
                asked = Asked(bag, namespace=options.namespace)
            if not names:
                return _list(options, asked, None)
            found = asked.series(names, options.start, options.end)
        rows, label = found, '' if single else run
        if isinstance(asked, AskedSignals):
            gaps = {replace(s, run=label).line: asked.channels[s.name] for s in found}
            warn_of_gaps(gaps, spectra=False)
            rows = asked.in_rows(found)
        series += [replace(s, run=label) for s in found]
        in_rows += [replace(s, run=label) for s in rows]
    over = _over(options, asked, series) if single else OVER_TIME
    title = Path(options.scene).name if single else ', '.join(names)
    return _write(options, series, (title, over), (None, []), in_rows)


def _check_files(options: argparse.Namespace) -> tuple[list[str], list[str], list[Any]]:
    """All output files, tables and pictures; InputError if one cannot be written."""
    from mechanism_sim import tables  # noqa: PLC0415
    from mechanism_sim.report import figures  # noqa: PLC0415

    files = options.output or [f'{Path(options.scene).stem}_plot.svg']
    numbers = [file for file in files if Path(file).suffix in tables.ENDINGS]
    for file in numbers:
        tables.check_file('--output', file)
    pictures = [
        figures.check_picture('--output', f, numbers=tables.ENDINGS)
        for f in files
        if f not in numbers
    ]
    return files, numbers, pictures


def _write(
    options: argparse.Namespace,
    series: list[Series],
    titled: tuple[str, Abscissa],
    marks: tuple[Mechanism | None, list[float]],
    in_rows: list[Series] | None = None,
) -> int:
    """Write series as numbers and pictures, with a title, over an abscissa, impacts marked.

    Tables have the series `in_rows` instead, if given.
    """
    from mechanism_sim import tables  # noqa: PLC0415
    from mechanism_sim.report import figures  # noqa: PLC0415
    from mechanism_sim.report.charts.lines import chart, in_si  # noqa: PLC0415

    files, numbers, pictures = _check_files(options)
    if numbers:
        from mechanism_sim.analysis.series import joined  # noqa: PLC0415

        columns, over = joined(series if in_rows is None else in_rows), titled[1]
        if options.against != 'time':
            t, name = columns['t'], over.of or options.against
            size = in_si(over.axis.unit)  # charts have degrees, tables radians
            columns = tables.Table(
                {'t': t, name: size.value * over.at(t), **columns},
                {**columns.units, name: size.unit},
            )
        for file in numbers:
            tables.write(Path(file), columns.columns())
    if pictures:
        from mechanism_sim.export import palette  # noqa: PLC0415
        from mechanism_sim.report import lines  # noqa: PLC0415

        mechanism, impact_times = marks
        own = palette.numbers(mechanism) if mechanism else {}
        drawn = lines.draw(chart(series, *titled, own, impact_times))
        for picture in pictures:
            figures.save(drawn, picture)
    rows = [{'name': s.line, 'unit': s.unit, 'samples': s.known, 'ideal': s.ideal} for s in series]
    return print_either(options, {'files': files, 'series': rows}, '\n'.join(files))


def _check_names(options: argparse.Namespace, machine: Machine) -> None:
    """Refuse names that are not in the machine."""
    from mechanism_sim.report.charts.lines import check_abscissa  # noqa: PLC0415
    from mechanism_sim.results.catalogue import catalogue  # noqa: PLC0415

    check_abscissa(machine, options.against)
    catalogue(machine).choose(name for name in options.what if name not in machine.scene.sensors)


def _charts(options: argparse.Namespace) -> int:
    """Charts of the run's page, as pictures."""
    from mechanism_sim.report import figures, progress  # noqa: PLC0415
    from mechanism_sim.report.charts.subjects import sections  # noqa: PLC0415

    if len(options.output) > 1:
        raise InputError('--charts writes to one --output: a folder, a .pdf, .svg or .png')
    place, *_ = options.output or [f'{Path(options.scene).stem}_charts']
    path = figures.check_picture('--output', place, folder_too=True)
    record, start, end = run_of(options)
    with progress.busy('drawing charts', quiet=options.json):
        known = {c.key: c for s in sections(record.between(start, end)) for c in s.charts}
        for name in options.what:
            check_known(name, known, f"the report has no chart '{name}'", 'its charts:')
        charts = [known[name] for name in options.what or known]
        files = [str(file) for file in figures.save_all(charts, path)]
    return print_either(options, {'files': files}, '\n'.join(files))


def _list(options: argparse.Namespace, asked: Asked | AskedSignals, bag: Bag | None) -> int:
    """All that can be plotted."""
    names = list(asked.names())
    if bag and not names:
        raise InputError(f'{bag.path} holds nothing that can be plotted: {bag.contents()}')
    if bag and (left_out := bag.unreadable()):
        print_notice(f'topics that cannot be read are left out: {", ".join(left_out)}')
    data = [{'name': name, 'unit': unit} for name, unit in names]
    width = max((len(name) for name, _ in names), default=0)
    lines = [f'{name:{width}}  {unit}'.rstrip() for name, unit in names]
    return print_either(options, data, '\n'.join(lines))


def _size(text: str) -> int | tuple[int, int]:
    width, cross, height = text.partition('x')
    if not width.isdecimal() or not int(width) or (cross and not height.isdecimal()):
        raise InputError(f"--size '{text}': write for example 960 or 1280x720")
    return (int(width), int(height)) if cross else int(width)
