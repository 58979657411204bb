"""Source of a displayed run: a bag, or a scene that is simulated."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from mechanism_sim.cli.options import (
    length_options,
    option,
    overrides_of,
    read_machine,
    say_turns,
    scene_options,
    skip_option,
    skipped_turns,
    time_option,
)
from mechanism_sim.errors import InputError
from mechanism_sim.recording.runs import BAG_ENDINGS, MCAP
from mechanism_sim.terminal import print_notice
from mechanism_sim.units import counted

if TYPE_CHECKING:
    from mechanism_sim.analysis.record import Record
    from mechanism_sim.recording.reader import Bag
    from mechanism_sim.scene import Machine
    from mechanism_sim.signal_files import ChannelSamples


def source_options(sub: argparse.ArgumentParser) -> None:
    """Add the options that choose a run and a part of it."""
    scene_options(sub, 'a bag (.mcap, .db3, a folder) or a scene, which is simulated', 'BAG|SCENE')
    time_option(sub, '--from', 'begin at this time', 'start')
    time_option(sub, '--to', 'end at this time', 'end')
    length_options(sub)
    skip_option(sub, 'turns begin at angle zero')
    namespace_option(sub)


def namespace_option(sub: argparse.ArgumentParser) -> None:
    """Add the option that chooses a machine of a bag."""
    option(sub, '--namespace', 'NS', 'namespace of the machine, where a bag holds several')


def is_bag(source: str) -> bool:
    """True for a bag: by its file name, its first bytes, or as a folder with such a file."""
    path = Path(source)
    if source.endswith(BAG_ENDINGS):
        return True
    try:
        if path.is_file():
            with path.open('rb') as stream:
                return stream.read(len(MCAP)) == MCAP
        return path.is_dir() and any(f.name.endswith(BAG_ENDINGS) for f in path.iterdir())
    except (OSError, ValueError):  # opening it raises the error
        return False


def refuse_overrides(options: argparse.Namespace) -> None:
    """Refuse overrides for a recorded run."""
    if overrides_of(options):
        raise InputError('a bag is shown as it was recorded: leave out --set and tolerances')


def read_run(options: argparse.Namespace) -> Record:
    """The run that a bag holds."""
    from mechanism_sim.analysis.record import read_record  # noqa: PLC0415
    from mechanism_sim.recording.reader import read_bag  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415

    refuse_overrides(options)
    with progress.share('reading', options.json) as read:
        record = read_record(read_bag(options.scene, read), options.namespace)
    warn_if_incomplete(record, options.scene)
    return record


def warn_if_incomplete(bag: Bag | Record, path: str) -> None:
    """Warn on standard error that a bag was cut short, or has no end yet."""
    if not bag.complete:
        from mechanism_sim.recording.inventory import is_being_recorded  # noqa: PLC0415

        state = 'is still being recorded' if is_being_recorded(path) else 'was cut short'
        print_notice(f'{path} {state}; what could be read is shown')


def warn_of_gaps(channels: Mapping[str, ChannelSamples], spectra: bool = True) -> None:
    """Warn on standard error of missing samples of signals, and of their effect.

    For rounded times the uncertainty of the rate is printed, too.
    """
    from mechanism_sim.signal_files import rate_text  # noqa: PLC0415

    for name, channel in channels.items():
        if spectra and channel.rate_error:
            rate = rate_text(channel.rate, channel.rate_error)
            print_notice(f'{name}: times are rounded: taken as even, at {rate} Hz')
        if channel.missing:
            longest = max(len(x) for x in channel.runs)
            said = (
                f'spectra are of the longest run of those that are there, {longest} of '
                f'{len(channel.values)}'
                if spectra
                else 'its line is broken there'
            )
            lost, are = counted(channel.missing, 'sample'), 'is' if channel.missing == 1 else 'are'
            print_notice(f'{name}: {lost} {are} missing; {said}')


def simulate_run(
    options: argparse.Namespace,
    start: float = 0.0,
    to: float | None = None,
    check: Callable[[Machine], object] | None = None,
) -> Record:
    """The run of a scene, up to a time [s], or over the requested length from `start` [s].

    Parameters
    ----------
    check : function that refuses unsuitable machines before the run
    """
    from mechanism_sim.analysis.record import Record  # noqa: PLC0415
    from mechanism_sim.report import progress  # noqa: PLC0415
    from mechanism_sim.results.simulate import simulate  # noqa: PLC0415
    from mechanism_sim.scene import run_length  # noqa: PLC0415

    if options.namespace:
        raise InputError('--namespace applies to bags')
    machine = read_machine(options)
    if check:
        check(machine)
    if to is None:
        say_turns(options, machine)
        end = start + run_length(machine, options.revolutions, options.duration)
    else:
        end = run_length(machine, None, to)
    with progress.bar('simulate', end, quiet=options.json) as show:
        return Record(machine, simulate(machine, duration=end, progress=show), {})


def run_of(
    options: argparse.Namespace, check: Callable[[Machine], object] | None = None
) -> tuple[Record, float, float]:
    """The requested run, read or simulated, and its start and end times [s].

    Parameters
    ----------
    check : check of a scene's machine, as for `simulate_run`
    """
    asked = options.end, options.duration, options.revolutions
    skip = skipped_turns(options)
    if sum(x is not None for x in asked) > 1:
        raise InputError('give only one of --to, --duration and --revolutions')
    if skip and options.start is not None:
        raise InputError('give either --from or --skip, not both')
    if not is_bag(options.scene):
        start = options.start or 0.0
        record = simulate_run(options, start, options.end, check)
        end = record.end if options.end is None else options.end
    else:
        record = read_run(options)
        start = record.start if options.start is None else options.start
        if options.revolutions is not None:
            import numpy as np  # noqa: PLC0415

            record.whole_turns()
            first, last = record.turned(np.array([start, record.end])).tolist()
            if not first + options.revolutions <= last + 1e-9:
                raise InputError(
                    f'the run makes {last - first:.6g} turns from {start:g} s on, not '
                    f'{options.revolutions:g}'
                )
            end = float(record.times_at(np.array([first + options.revolutions]))[0])
        elif options.duration is not None:
            end = start + float(options.duration)
        else:
            end = record.end if options.end is None else float(options.end)
    return record, record.begin(skip) if skip else start, end
