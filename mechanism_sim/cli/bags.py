"""Commands on recorded runs."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from mechanism_sim.cli.options import (
    Command,
    option,
    print_either,
    print_result,
    quantity,
    rate_option,
    read_workers,
    refuse_options,
    set_option,
    several,
    skip_option,
    skipped_time,
    skipped_turns,
    time_option,
    workers_options,
)
from mechanism_sim.cli.source import namespace_option, warn_if_incomplete, warn_of_gaps
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.terminal import echo
from mechanism_sim.units import counted

if TYPE_CHECKING:
    from mechanism_sim.analysis.details import Wanted


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('bag info', _info, 'list the contents of a bag')
    sub.add_argument('bag', metavar='BAG', help='a .mcap or .db3 file, or a folder of ros2 bag')
    sub = command('bag play', _play, 'publish the messages of a bag, as its nodes did')
    sub.add_argument('bag', metavar='BAG', help='a .mcap or .db3 file, or a folder of ros2 bag')
    option(sub, '--rate', 'R', 'recorded seconds per second; 0: as fast as possible', 1.0)
    time_option(sub, '--from', 'begin at this time after the first message', default=0.0)
    time_option(sub, '--delay', 'wait before the first message', default=0.0)
    sub.add_argument(
        '--topics', nargs='+', action='extend', default=[], metavar='TOPIC', help='only these'
    )
    rate_option(sub, '--clock', 'also publish /clock if the bag has none')
    time_option(sub, '--timeout', 'longest time to wait for subscriptions', default=10.0)
    sub = command(
        'bag recover', _recover, 'close a bag whose recorder was killed, or that is damaged'
    )
    sub.add_argument('bag', metavar='BAG', help='an MCAP file, or a folder with one')
    sub = command('analyze', _analyze, 'summarise a recorded run, or identify a bearing from it')
    sub.add_argument(
        'bags',
        nargs='+',
        metavar='BAG',
        help='a .mcap or .db3 file, or a folder of ros2 bag; or a .csv, .xlsx, .mat, .wav, .uff '
        'or .tdms file of measured signals',
    )
    namespace_option(sub)
    _detail_options(sub)
    _fit_options(sub)


def _info(options: argparse.Namespace) -> int:
    from mechanism_sim.recording.inventory import BagInfo, info, render_info  # noqa: PLC0415

    return print_result(options, info(options.bag), BagInfo.to_json, render_info, echo)


def _recover(options: argparse.Namespace) -> int:
    from mechanism_sim.recording.inventory import RecoveredBag, recover, render_recovery  # noqa: PLC0415

    return print_result(options, recover(options.bag), RecoveredBag.to_json, render_recovery, echo)


_FIT = (
    'scene', 'set', 'range', 'joint', 'sensor', 'channel', 'full-scale', 'sample-rate', 'method',
    'seed', 'rounds', 'workers', 'dask',
)  # fmt: skip
_DETAILS = (
    'spectrum', 'orders', 'envelope', 'average', 'impacts-on', 'wear', 'deviation', 'against',
    'band', 'pin-radius', 'plots',
)  # fmt: skip


_MOST = 1e9  # seconds of a delay, and recorded seconds per second, at most


def _play(options: argparse.Namespace) -> int:
    for name in ('rate', 'delay'):
        if not 0.0 <= (given := getattr(options, name)) <= _MOST:
            raise InputError(f'--{name} {given:g}: from 0 to {_MOST:g}')
    if not options.timeout > 0.0:
        raise InputError('--timeout must be positive')
    from mechanism_sim.nodes.player import playable, player  # noqa: PLC0415
    from mechanism_sim.recording.reader import read_bag  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415

    bag = read_bag(options.bag)
    if not any(topic.count for topic in bag.topics.values()):
        raise InputError(f'{options.bag} holds nothing that can be played: it has no messages')
    start, length = getattr(options, 'from'), (bag.end - bag.start) / 1e9
    if not 0.0 <= start <= length:
        raise InputError(f'--from {start:g}: {options.bag} has messages from 0 to {length:g} s')
    topics = playable(bag, options.topics)
    with player(options.timeout) as node:
        time.sleep(options.delay)
        with progress.bar('play', length, quiet=options.json) as show:
            count = node.play(bag, topics, options.rate, start, options.clock, show)
    text = f'{counted(count, "message")} of {options.bag} published'
    return print_either(options, {'bag': options.bag, 'messages': count}, text)


def _analyze(options: argparse.Namespace) -> int:
    if options.fit is not None:
        refuse_options(options, _DETAILS, 'does not apply to --fit')
        return _fit(options)
    from mechanism_sim.signal_files import is_signal_file  # noqa: PLC0415

    if len(options.bags) == 1 and is_signal_file(options.bags[0]):
        return _analyze_signals(options)
    refuse_options(options, _FIT, 'needs --fit')
    if len(options.bags) > 1:
        raise InputError(f'analyze reads one bag, not {len(options.bags)}; --fit reads several')
    (options.bag,) = options.bags
    from mechanism_sim.analysis.details import Details  # noqa: PLC0415
    from mechanism_sim.analysis.summary import analyze  # noqa: PLC0415
    from mechanism_sim.recording.reader import read_bag  # noqa: PLC0415
    from mechanism_sim.report import figures, progress  # noqa: PLC0415
    from mechanism_sim.report.bag import render, render_details  # noqa: PLC0415

    plots = figures.check_picture('--plots', options.plots, True) if options.plots else None
    wanted = _wanted(options)
    if not (wanted or plots or options.against):
        what = 'a detail such as --average, or --plots: the summary covers the whole run'
        refuse_options(options, ['skip'], f'needs {what}')
    details: Details | None = None
    if wanted or plots or options.against:
        details = _details(options, wanted)
    if details and plots:
        from mechanism_sim.report.condition import charts  # noqa: PLC0415

        with progress.busy('plots', options.json):
            figures.save_all(charts(details), plots)
    if details and wanted and not options.json:
        echo(render_details(details))
        return 0
    with progress.share('reading', options.json) as read:
        summary = analyze(read_bag(options.bag, read), namespace=options.namespace)
    more = {'details': details.to_json()} if details and options.json else {}
    return print_result(options, summary, lambda found: found.to_json() | more, render, echo)


def _wanted(options: argparse.Namespace) -> Wanted:
    """Request beyond the summary."""
    from mechanism_sim.analysis.details import Wanted  # noqa: PLC0415

    skip = skipped_turns(options)
    for name, owner in (('band', 'envelope'), ('pin-radius', 'wear')):
        if not getattr(options, owner) and not options.plots:
            refuse_options(options, [name], f'needs --{owner}')
    return Wanted(
        options.spectrum, options.orders, options.envelope, options.average, options.impacts_on,
        options.wear, options.deviation, _band(options.band), skip,
        quantity('--pin-radius', options.pin_radius, 'm')[0] if options.pin_radius else None,
    )  # fmt: skip


def _analyze_signals(options: argparse.Namespace) -> int:
    """Analysis of a file of signals without a machine."""
    from mechanism_sim.analysis.details import channel_details  # noqa: PLC0415
    from mechanism_sim.report import figures  # noqa: PLC0415
    from mechanism_sim.report.bag import (  # noqa: PLC0415
        channel_figures,
        render_channels,
        render_details,
    )
    from mechanism_sim.report.condition import charts  # noqa: PLC0415
    from mechanism_sim.signal_files import read_signals  # noqa: PLC0415

    (file,) = options.bags
    refuse_options(
        options, [x for x in _FIT if x not in ('full-scale', 'sample-rate')], 'needs --fit'
    )
    others = 'skip', 'against', 'namespace', 'pin-radius'
    refuse_options(options, others, 'does not apply to a file of signals')
    plots = figures.check_picture('--plots', options.plots, True) if options.plots else None
    wanted = _wanted(options)
    channels = read_signals(file, options.full_scale or '', rate=options.sample_rate or '')
    if wanted or plots:
        warn_of_gaps(channels)
    even = [name for name, c in channels.items() if c.rate]
    drawn = wanted if wanted or not plots else replace(wanted, spectra=even, envelopes=even)
    details = channel_details(channels, drawn)
    if plots:
        figures.save_all(charts(details), plots)
    if wanted and not options.json:
        echo(render_details(details))
        return 0
    more = {'details': details.to_json()} if drawn else {}
    found = channel_figures(channels)
    return print_result(options, found, lambda x: {'channels': x} | more, render_channels)


def _fit(options: argparse.Namespace) -> int:
    from mechanism_sim.analysis.measurements import measurements  # noqa: PLC0415
    from mechanism_sim.report import progress, studies  # noqa: PLC0415
    from mechanism_sim.studies.identification import METHODS, ROUNDS, identify  # noqa: PLC0415
    from mechanism_sim.studies.parameters import OF_JOINT, parameters, read_limits  # noqa: PLC0415

    counts = options.rounds.split(',') if options.rounds else ROUNDS
    if not all(str(n).strip().isdecimal() and int(n) >= 16 for n in counts):
        raise InputError(f"--rounds '{options.rounds}': write numbers from 16 on, as 128,48,48,48")
    rounds = [int(n) for n in counts]
    workers = read_workers(options)
    if options.seed < 0:
        raise InputError('--seed must be at least 0')
    if options.method not in (None, *METHODS):
        raise InputError(
            f"--method '{options.method}'{nearest(options.method, METHODS)}: allowed are "
            f'{", ".join(METHODS)}'
        )
    with progress.busy('reading', options.json):
        signals = measurements(
            [(file, options.namespace) for file in options.bags],
            options.scenes,
            options.overrides,
            options.sensor,
            skipped_time(options),
            options.channel,
            options.full_scale or '',
            options.sample_rate or '',
        )
    first = signals[0]
    if not set(OF_JOINT) & {name.strip() for name in options.fit.split(',')}:
        refuse_options(options, ['joint'], f'needs --fit of {", ".join(OF_JOINT)}')
    wanted = parameters(
        first.machine,
        options.fit.split(','),
        first.name,
        options.joint,
        read_limits('--range', options.ranges),
    )
    with progress.count('fit', sum(rounds), quiet=options.json) as show, workers:
        found = identify(signals, wanted, options.method, options.seed, rounds, workers, show)
    return print_result(options, found, studies.fit_json, studies.fit_text)


def _details(options: argparse.Namespace, wanted: Any) -> Any:
    """Requested quantities of a bag, or all that can be drawn."""
    from mechanism_sim.analysis.details import (  # noqa: PLC0415
        channel_details,
        everything,
        find_details,
    )
    from mechanism_sim.analysis.measurements import samples_of  # noqa: PLC0415
    from mechanism_sim.analysis.open_run import Asked  # noqa: PLC0415
    from mechanism_sim.recording.reader import read_bag  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415

    if options.against and not wanted.deviations:
        raise InputError('--against needs --deviation: it compares two deviations')
    with progress.share('reading', options.json) as read:
        bags = [read_bag(x, read) for x in (options.bag, options.against) if x]
        asked, *against = (Asked(bag, namespace=options.namespace) for bag in bags)
        sensors = () if asked.messages else asked.record.sensors
        names = [x for x in (*wanted.spectra, *wanted.envelopes) if x not in sensors]
        series = {x: s for x in names if (s := asked.recorded(x))}
        channels = {x: samples_of(bags[0], s) for x, s in series.items()}
        for x, s in series.items():  # units of the joint: rotation or translation
            channels[x] = replace(channels[x], unit=s.unit or channels[x].unit)
        warn_of_gaps(channels)
        if asked.messages and channels:
            refuse_options(options, ['skip', 'against', 'pin-radius'], 'needs a run')
            return channel_details(channels, wanted)
        record, *other = (x.record for x in (asked, *against))
    for bag in bags:
        warn_if_incomplete(bag, str(bag.path))
    with progress.busy('analyze', options.json):
        chosen = wanted if wanted else everything(record, wanted)
        return find_details(record, chosen, other[0] if other else None, channels)


def _band(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    from mechanism_sim.ranges import check_order, read_range  # noqa: PLC0415

    given = read_range('--band', text, '500 Hz:2 kHz').values
    low, high = (quantity('--band', x, 'Hz')[0] for x in given)
    check_order('--band', low, high, given)
    return low, high


def _fit_options(sub: argparse.ArgumentParser) -> None:
    more = sub.add_argument_group('parameters of a machine from measured signals')
    option(
        more, '--fit', 'NAME,...',
        'instead of the summary: find these so that runs reproduce the signal of a bag, or of a '
        '.csv, .xlsx, .mat, .wav, .uff or .tdms file: some of restitution, friction, radial, '
        'noise, or dotted paths',
    )  # fmt: skip
    text = 'scene with machine and sensor, for each bag or all; that in the bag if not given'
    several(more, '--scene', 'SCENE', text, 'scenes')
    set_option(more)
    text = "range of a parameter, for example 'radial=0.1 mm:0.4 mm'; several times"
    several(more, '--range', 'NAME=LOW:HIGH', text, 'ranges')
    option(more, '--joint', 'J', 'the loose joint, where there are several')
    option(more, '--sensor', 'S', 'the sensor, where there are several; or a quantity')
    option(
        more,
        '--channel',
        'C',
        'of a file, if it is not named like its sensor or quantity; of a bag TOPIC.FIELD',
    )
    option(more, '--full-scale', 'Q', "largest number of a .wav, as '50 m/s^2'")
    option(more, '--sample-rate', 'F', "of a table without times, as '12 kHz'")
    option(
        more, '--method', 'M',
        'gauss-newton (sample by sample) or regression (features of the signal, for chaos); by '
        'itself the first, if runs follow the signal',
    )  # fmt: skip
    option(more, '--seed', 'N', 'seed of the random numbers of the search', 0)
    option(more, '--rounds', 'N,...', 'simulations in each round; 128,48,48,48 if not given')
    workers_options(more)


def _detail_options(sub: argparse.ArgumentParser) -> None:
    more = sub.add_argument_group('instead of the summary; each may be given several times')
    for name, metavar, text in (
        ('spectrum', 'SENSOR', 'power spectral density of a signal, or of TOPIC.FIELD'),
        ('orders', 'SENSOR', 'order spectrum: amplitudes at multiples of the drive speed'),
        ('envelope', 'SENSOR', 'spectrum of the squared envelope'),
        (
            'average',
            'NAME',
            'average over a turn, of a sensor or a quantity such as acceleration.LINK',
        ),
        ('impacts-on', 'JOINT', 'impacts by direction on pin and bushing, and turn by turn'),
        ('wear', 'JOINT', 'impulses and sliding by direction on pin and bushing'),
        ('deviation', 'NAME', 'deviation of a quantity from that of the ideal machine'),
    ):
        several(more, f'--{name}', metavar, text)
    how = sub.add_argument_group('how')
    option(how, '--against', 'BAG', 'divide deviations by those of this other bag')
    option(how, '--band', 'A:B', "frequency band of envelopes, as '500 Hz:2 kHz'")
    skip_option(how, "turns begin at angle zero; with --fit as '2 s'")
    text = "radius of the pin for wear, as '6 mm'; that of the scene if not given"
    option(how, '--pin-radius', 'R', text)
    option(how, '--plots', 'DIR|FILE', 'draw them: a folder, .pdf, .png or .svg')
