"""Commands on recorded runs."""

from __future__ import annotations

import argparse
import os
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mechanism_sim import output
from mechanism_sim.cli.options import (
    Command,
    length_options,
    option,
    print_result,
    quantity,
    refuse_options,
    scene_options,
)
from mechanism_sim.cli.source import (
    is_bag,
    namespace_option,
    read_run,
    simulate_run,
    warn_if_incomplete,
)
from mechanism_sim.errors import InputError
from mechanism_sim.terminal import echo

if TYPE_CHECKING:
    from mechanism_sim.analysis.record import Record


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('info', _info, 'list what a bag holds')
    sub.add_argument('bag', metavar='BAG', help='an MCAP file, or a folder of ros2 bag')
    sub = command('recover', _recover, 'close a bag whose recorder was killed')
    sub.add_argument('bag', metavar='BAG', help='an MCAP file, or a folder of ros2 bag')
    sub = command('analyze', _analyze, 'summarise a recorded run')
    sub.add_argument('bag', metavar='BAG', help='an MCAP file, or a folder of ros2 bag')
    namespace_option(sub)
    _detail_options(sub)
    sub = command('sound', _sound, 'what the impacts of a run sound like, as a WAV file')
    scene_options(sub, 'a scene, or a bag (.mcap) of a run', 'SCENE|BAG')
    length_options(sub)
    namespace_option(sub)
    option(sub, '-o --output', 'FILE', 'the .wav file; SCENE.wav if not given')
    option(sub, '--distance', 'R', 'of the listener from the machine', '1 m')
    option(sub, '--direction', 'ANGLE', 'in which the listener is, from the x axis', '0 deg')
    option(sub, '--pulse', 'T', "how long impacts last, as '0.1 ms'")
    option(sub, '--slow', 'N', 'play N times slower', 1.0)
    sub = command('identify', _identify, "fit a bearing's parameters to an accelerometer's signal")
    sub.add_argument('bags', nargs='+', metavar='BAG', help='recorded, or made of a measurement')
    sub.add_argument(
        '--scene', action='append', default=[], metavar='SCENE', dest='scenes',
        help='machine and sensor, one for each bag or one for all; those in the bag if not given',
    )  # fmt: skip
    sub.add_argument(
        '--set', action='append', default=[], metavar='PATH=VALUE', dest='overrides',
        help='change a value of the scenes',
    )  # fmt: skip
    option(
        sub,
        '--fit',
        'NAME,...',
        'what is to be found: some of these, noise, or dotted paths',
        'restitution,friction,radial',
    )
    sub.add_argument(
        '--range', action='append', default=[], metavar='NAME=LOW:HIGH', dest='ranges',
        help="where it is looked for, for example 'radial=0.1 mm:0.4 mm'",
    )  # fmt: skip
    option(sub, '--joint', 'J', 'the loose joint, where there are several')
    option(sub, '--sensor', 'S', 'the sensor, where there are several')
    option(sub, '--skip', 'S', 'seconds to leave out at the beginning', 0.0)
    option(sub, '--seed', 'N', 'of the random numbers of the search', 0)
    option(sub, '--rounds', 'N,...', 'simulations in each round; 128,48,48,48 if not given')
    option(sub, '--workers', 'N', 'processes; one for each core if not given', int)


def _info(options: argparse.Namespace) -> int:
    from mechanism_sim.recording import BagInfo, info, render_info  # noqa: PLC0415

    return print_result(options, info(options.bag), BagInfo.to_json, render_info, echo)


def _recover(options: argparse.Namespace) -> int:
    from mechanism_sim.recording import Recovery, recover, render_recovery  # noqa: PLC0415

    return print_result(options, recover(options.bag), Recovery.to_json, render_recovery, echo)


def _analyze(options: argparse.Namespace) -> int:
    from mechanism_sim.analysis import analyze, render  # noqa: PLC0415
    from mechanism_sim.analysis.details import Details, Wanted  # noqa: PLC0415
    from mechanism_sim.analysis.render_details import render_details  # noqa: PLC0415
    from mechanism_sim.recording import read_bag  # noqa: PLC0415
    from mechanism_sim.report import figures, progress  # noqa: PLC0415

    if options.skip < 0:
        raise InputError('--skip must be at least 0')
    for name, owner in (('band', 'envelope'), ('pin-radius', 'wear')):
        if not getattr(options, owner) and not options.plots:
            refuse_options(options, [name], f'goes with --{owner}: it is about that')
    plots = figures.check_picture('--plots', options.plots, True) if options.plots else None
    wanted = Wanted(
        options.spectrum, options.orders, options.envelope, options.average, options.impacts_on,
        options.wear, options.deviation, _band(options.band), options.skip,
        quantity('--pin-radius', options.pin_radius, 'm')[0] if options.pin_radius else None,
    )  # fmt: skip
    if not (wanted or plots or options.against):
        what = 'a detail such as --average, or with --plots: the summary is of the whole run'
        refuse_options(options, ['skip'], f'goes with {what}')
    details: Details | None = None
    if wanted or plots or options.against:
        details = _details(options, wanted)
    if details and plots:
        from mechanism_sim.report.condition import draw  # noqa: PLC0415

        with progress.busy('plots', options.json):
            figures.save_all(draw(details), plots)
    if details and wanted and not options.json:
        echo(render_details(details))
        return 0
    with progress.share('reading', options.json) as read:
        summary = analyze(read_bag(options.bag, read), namespace=options.namespace)
    more = {'details': details.to_json()} if details and options.json else {}
    return print_result(options, summary, lambda found: found.to_json() | more, render, echo)


def _sound(options: argparse.Namespace) -> int:
    from mechanism_sim.report import progress, sound  # noqa: PLC0415
    from mechanism_sim.sensing.sound import Listener, strikes  # noqa: PLC0415

    listener = Listener(
        quantity('--distance', options.distance, 'm')[0],
        quantity('--direction', options.direction, 'rad')[0],
    )
    pulse = None if options.pulse is None else quantity('--pulse', options.pulse, 's')[0]
    file = output.check_path(
        '--output', options.output or f'{Path(options.scene).stem}.wav', '.wav'
    )
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
        written = sound.write(train, run.motion.curve.end, file, listener, pulse, options.slow)
    return print_result(options, written, asdict, sound.render)


def _identify(options: argparse.Namespace) -> int:
    from mechanism_sim.analysis.measurements import measurements  # noqa: PLC0415
    from mechanism_sim.report import identification as report  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.study.identification import ROUNDS, Identification  # noqa: PLC0415
    from mechanism_sim.study.parameters import OF_JOINT, parameters, ranges  # noqa: PLC0415

    counts = options.rounds.split(',') if options.rounds else ROUNDS
    if not all(str(n).strip().isdecimal() and int(n) >= 16 for n in counts):
        raise InputError(f"--rounds '{options.rounds}': write numbers from 16 on, as 128,48,48,48")
    rounds = [int(n) for n in counts]
    workers = os.cpu_count() or 1 if options.workers is None else options.workers
    if workers < 1 or options.seed < 0:
        raise InputError('--workers must be at least 1, --seed at least 0')
    with progress.busy('reading', options.json):
        signals = measurements(
            options.bags, options.scenes, options.overrides, options.sensor, options.skip
        )
    first = signals[0]
    if not set(OF_JOINT) & {name.strip() for name in options.fit.split(',')}:
        refuse_options(options, ['joint'], f'goes with --fit of {", ".join(OF_JOINT)}')
    wanted = parameters(
        first.machine, options.fit.split(','), first.sensor, options.joint, ranges(options.ranges)
    )
    with progress.count('identify', sum(rounds), quiet=options.json) as show:
        found = Identification(signals, wanted, options.seed, workers, show).find(rounds)
    return print_result(options, found, report.to_json, report.render)


def _details(options: argparse.Namespace, wanted: Any) -> Any:
    """What is asked of a bag, or everything that can be drawn."""
    from mechanism_sim.analysis.details import everything, find_details  # noqa: PLC0415
    from mechanism_sim.analysis.record import read_record  # noqa: PLC0415
    from mechanism_sim.recording import read_bag  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415

    def record_of(bag: str) -> Record:
        with progress.share('reading', options.json) as read:
            record = read_record(read_bag(bag, read), options.namespace)
        warn_if_incomplete(record, bag)
        return record

    if options.against and not wanted.deviations:
        raise InputError('--against goes with --deviation: it compares two deviations')
    record = record_of(options.bag)
    against = record_of(options.against) if options.against else None
    with progress.busy('analyze', options.json):
        return find_details(record, wanted if wanted else everything(record, wanted), against)


def _band(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    low, colon, high = text.partition(':')
    if not colon:
        raise InputError(f"--band '{text}': write for example '500 Hz:2 kHz'")
    return quantity('--band', low, 'Hz')[0], quantity('--band', high, 'Hz')[0]


def _detail_options(sub: argparse.ArgumentParser) -> None:
    more = sub.add_argument_group('instead of the summary; each may be given several times')
    for name, metavar, text in (
        ('spectrum', 'SENSOR', 'power spectral density of its signal'),
        ('orders', 'SENSOR', 'amplitudes over multiples of the speed of the drive'),
        ('envelope', 'SENSOR', 'spectrum of the squared envelope'),
        (
            'average',
            'NAME',
            'over a turn of the drive: of a sensor, or a quantity such as acceleration.LINK',
        ),
        ('impacts-on', 'JOINT', 'by direction on pin and bushing, and turn by turn'),
        ('wear', 'JOINT', 'impulses and sliding by direction on pin and bushing'),
        ('deviation', 'NAME', 'of this quantity from that of the machine without clearance'),
    ):
        more.add_argument(f'--{name}', action='append', default=[], metavar=metavar, help=text)
    how = sub.add_argument_group('how')
    option(how, '--against', 'BAG', 'divide deviations by those of this other bag')
    option(how, '--band', 'A:B', "frequencies of envelopes, as '500 Hz:2 kHz'")
    option(how, '--skip', 'N', 'whole turns to leave out at the beginning', 0)
    option(how, '--pin-radius', 'R', "for wear, as '6 mm'; that of the scene if not given")
    option(how, '--plots', 'DIR|FILE', 'draw them: a folder, .pdf, .png or .svg')
