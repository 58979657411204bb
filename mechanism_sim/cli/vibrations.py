"""Modes and steady responses of a scene."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mechanism_sim.cli.options import (
    Command,
    Result,
    flag,
    option,
    print_result,
    quantity,
    read_machine,
    scene_options,
)
from mechanism_sim.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from mechanism_sim.arrays import Array


def add(command: Command) -> None:
    """The commands of this file."""
    sub = command('modes', _modes, 'natural frequencies, damping ratios and mode shapes')
    scene_options(sub)
    option(sub, '--along', 'N', 'modes with the drive held at N angles of a turn', int)
    option(sub, '--speeds', 'A:B:N', "modes over N speeds of the drive, as '0 rpm:3000 rpm:31'")
    text = 'modes about the steady rotation under its torque, even if it could rest'
    flag(sub, '--turning', text)
    option(sub, '-o --output', 'FILE', 'draw the shapes, or the frequencies over angle or speed')
    sub = command('response', _response, 'steady response to a harmonic force or base motion')
    scene_options(sub)
    sub.add_argument(
        'quantities', nargs='*', default=[], metavar='QUANTITY',
        help='as position.mass or reaction.ground_mass.x; all positions if none is given',
    )  # fmt: skip
    option(sub, '--force', 'LINK.POINT', 'a force of amplitude 1 N at this point')
    option(sub, '--direction', 'ANGLE', "direction of the force in the fixed frame, as '90 deg'")
    option(sub, '--torque', 'LINK', 'a moment of amplitude 1 N m on this link')
    option(sub, '--base', 'COORDINATE', 'an amplitude of 1 m or 1 rad of this driven coordinate')
    option(sub, '--frequencies', 'A:B:N', "first, last and number, as '1 Hz:20 Hz:39'")
    option(sub, '--speed', 'S', "speed of the drive, as '900 rpm'; it is at rest if not given")
    option(sub, '--harmonics', 'N', 'instead: N harmonics under drives and loads', int)
    option(sub, '--period', 'T', "with --harmonics: as '0.1 s'; a turn of the drive if not given")
    option(sub, '--speeds', 'A:B:N', 'instead: the first harmonic over N speeds of the drive')
    option(sub, '-o --output', 'FILE', 'draw it')


def _picture(options: argparse.Namespace) -> Path | None:
    """Path of the picture, checked before the computation; None if none is requested."""
    from mechanism_sim.report.figures import check_picture  # noqa: PLC0415

    return check_picture('--output', options.output) if options.output else None


def _draw(
    file: Path | None, chart: Callable[[Result, str], Any], found: Result, title: str
) -> None:
    """Draw a result, if requested."""
    from mechanism_sim.report import figures  # noqa: PLC0415

    if file:
        figures.draw(chart(found, title), file)


def _span(name: str, text: str, unit: str) -> Array:
    """Equidistant values from ``A:B:N``."""
    import numpy as np  # noqa: PLC0415

    from mechanism_sim.ranges import check_order, read_range  # noqa: PLC0415

    example = {'Hz': '1 Hz:20 Hz:39', 'rad/s': '0 rpm:3000 rpm:31'}[unit]
    given = read_range(name, text, example, counted=True)
    low, high = (quantity(name, x, unit)[0] for x in given.values)
    check_order(name, low, high, given.values)
    return np.linspace(low, high, given.number)


def _modes(options: argparse.Namespace) -> int:
    from mechanism_sim.report import vibrations as report  # noqa: PLC0415
    from mechanism_sim.studies import floquet  # noqa: PLC0415
    from mechanism_sim.studies import modes as study  # noqa: PLC0415

    if (options.along is not None) + bool(options.speeds) + options.turning > 1:
        raise InputError('give one of --along, --speeds and --turning')
    file = _picture(options)
    speeds = _span('--speeds', options.speeds, 'rad/s') if options.speeds else None
    machine = read_machine(options)
    if speeds is not None:
        stations = study.campbell(machine, speeds)
        critical = study.critical_speeds(machine, stations)
        table = report.ModeTable(machine.name, stations, 'speed', machine.plan.main, critical)
    elif options.along is not None:
        stations = study.along(machine, options.along)
        table = report.ModeTable(machine.name, stations, 'angle', machine.plan.main)
    else:
        found = floquet.station(machine, options.turning)
        table = report.ModeTable(machine.name, [found], main=machine.plan.main)
    _draw(file, report.modes_chart, table, machine.scene.title)
    return print_result(options, table, report.modes_json, report.modes_text)


def _response(options: argparse.Namespace) -> int:
    from mechanism_sim.report import vibrations as report  # noqa: PLC0415
    from mechanism_sim.studies.harmonics import harmonics, unbalance_response  # noqa: PLC0415
    from mechanism_sim.studies.response import read_source, response  # noqa: PLC0415

    file = _picture(options)
    forced = [
        options.force, options.direction, options.torque, options.base, options.frequencies,
        options.speed,
    ]  # fmt: skip
    if options.speeds is not None:
        if any(x is not None for x in (*forced, options.harmonics, options.period)):
            raise InputError('--speeds takes no source, --frequencies or --harmonics')
        speeds = _span('--speeds', options.speeds, 'rad/s')
        machine = read_machine(options)
        turned = unbalance_response(machine, options.quantities, speeds)
        _draw(file, report.response_chart, turned, machine.scene.title)
        return print_result(options, turned, report.response_json, report.response_text)
    if options.harmonics is not None:
        if any(x is not None for x in forced):
            raise InputError('--harmonics takes no source and no --frequencies')
        period = quantity('--period', options.period, 's')[0] if options.period else None
        machine = read_machine(options)
        series = harmonics(machine, options.quantities, options.harmonics, period)
        _draw(file, report.harmonics_chart, series, machine.scene.title)
        return print_result(options, series, report.harmonics_json, report.harmonics_text)
    if options.period is not None:
        raise InputError('--period needs --harmonics')
    if not options.frequencies:
        raise InputError("give --frequencies, as '1 Hz:20 Hz:39', --harmonics or --speeds")
    frequency = _span('--frequencies', options.frequencies, 'Hz')
    direction = None
    if options.direction is not None:
        direction = quantity('--direction', options.direction, 'rad')[0]
    speed = quantity('--speed', options.speed, 'rad/s')[0] if options.speed else 0.0
    machine = read_machine(options)
    source = read_source(machine, options.force, direction, options.torque, options.base)
    found = response(machine, source, options.quantities, frequency, speed)
    _draw(file, report.response_chart, found, machine.scene.title)
    return print_result(options, found, report.response_json, report.response_text)
