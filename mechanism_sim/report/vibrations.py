"""Modes and responses of a scene: as text, as JSON, as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim import text_table
from mechanism_sim.report.figures import strokes, titled
from mechanism_sim.study.harmonics import Harmonics
from mechanism_sim.study.modes import CriticalSpeed, Mode, Station
from mechanism_sim.study.response import FrequencyResponse


class ModeTable(NamedTuple):
    """The modes at one place, or at several.

    Attributes
    ----------
    scene : its name
    stations : one about rest, several over angles or speeds
    over : 'angle' or 'speed'; None about rest
    main : coordinate of the drive
    critical : speeds at which a natural frequency is that of the rotation
    """

    scene: str
    stations: Sequence[Station]
    over: str | None = None
    main: str = ''
    critical: Sequence[CriticalSpeed] = ()

    def abscissa(self, station: Station) -> float:
        """Speed [rad/s] or angle [rad] of the drive."""
        return station.speed if self.over == 'speed' else station.position[self.main]


def modes_json(table: ModeTable) -> dict[str, Any]:
    """SI units, frequencies in Hz."""
    if table.over is None:
        (only,) = table.stations
        turning = {'speed': only.speed, 'faded': only.faded} if only.speed else {}
        return {'scene': table.scene, **turning, 'modes': [_mode(m) for m in only.modes]}
    found: dict[str, Any] = {
        'scene': table.scene,
        'over': table.over,
        'stations': [
            {
                table.over: table.abscissa(s),
                'position': s.position,
                'modes': [_mode(m) for m in s.modes],
            }
            for s in table.stations
        ],
    }
    if table.over == 'speed':
        found['critical_speeds'] = [x.speed for x in table.critical]
        if any(x.whirl is not None for x in table.critical):
            found['critical_whirl'] = [x.whirl for x in table.critical]
    return found


def _mode(mode: Mode) -> dict[str, Any]:
    return {
        'frequency': mode.frequency,
        'damping_ratio': mode.damping_ratio,
        'damped_frequency': mode.damped_frequency,
        'shape': {name: z.real for name, z in mode.shape.items()},
        'shape_imaginary': {name: z.imag for name, z in mode.shape.items()},
        **({} if mode.whirl is None else {'whirl': mode.whirl}),
    }


def _way(whirl: float | None) -> str:
    """Of a whirl: with the rotation, against it; nothing where the axis goes to and fro."""
    return '' if whirl is None or abs(whirl) < 1e-6 else ' forward' if whirl > 0.0 else ' backward'


def modes_text(table: ModeTable) -> str:
    """For people."""
    if table.over is None:
        modes = table.stations[0].modes
        names = list(dict.fromkeys(name for mode in modes for name in mode.shape))
        head = ['mode', *(str(k + 1) for k in range(len(modes)))]
        rows: list[list[str]] = [
            head,
            ['natural frequency [Hz]', *(f'{m.frequency:.6g}' for m in modes)],
            ['damping ratio', *(f'{m.damping_ratio:.6g}' for m in modes)],
            ['damped frequency [Hz]', *(f'{m.damped_frequency:.6g}' for m in modes)],
        ]
        if any(_way(m.whirl) for m in modes):
            rows.append(['whirl', *(_way(m.whirl).strip() or '-' for m in modes)])
        rows += [[name, *(_amplitude(m.shape.get(name)) for m in modes)] for name in names]
        lines = text_table.lines(rows, indent='')
        if speed := table.stations[0].speed:
            lines.append(f'its torque keeps {table.main} turning at {speed:.9g} rad/s')
        if faded := table.stations[0].faded:
            lines.append(f'{faded} more die out within a turn')
        return '\n'.join(lines)
    unit = 'rad/s' if table.over == 'speed' else 'rad'
    most = max(len(s.modes) for s in table.stations)
    rows = [[f'{table.over} of {table.main} [{unit}]', *(f'{k + 1} [Hz]' for k in range(most))]]
    for s in table.stations:
        shown = [f'{m.frequency:.6g}{_way(m.whirl)}' for m in s.modes]
        rows.append([f'{table.abscissa(s):.6g}', *shown, *[''] * (most - len(shown))])
    lines = text_table.lines(rows, indent='')
    if table.critical:
        speeds = ', '.join(f'{x.speed:.9g}{_way(x.whirl)}' for x in table.critical)
        lines.append(f'critical speeds [rad/s]: {speeds}')
    return '\n'.join(lines)


def _amplitude(z: complex | None) -> str:
    """Of a shape: a number, or size and phase where the parts do not move in step."""
    if z is None:
        return '-'
    if abs(z.imag) <= 1e-9:
        return f'{z.real if abs(z.real) > 1e-12 else 0.0:.4g}'
    return f'{abs(z):.4g} at {np.degrees(np.angle(z)):.1f} deg'


def modes_picture(table: ModeTable, title: str) -> Any:
    """Mode shapes as bars; frequencies over angle or speed, with the line of the rotation."""
    if table.over is None:
        modes = table.stations[0].modes
        figure = titled(title, height=0.8 + 1.3 * len(modes))
        for axes, mode in zip(
            np.ravel(figure.subplots(len(modes), 1, sharex=True)), modes, strict=True
        ):
            names = list(mode.shape)
            places = range(len(names))
            axes.bar(places, [z.real for z in mode.shape.values()], 0.5, color='0.4')
            if any(abs(z.imag) > 1e-9 for z in mode.shape.values()):
                parts = [z.imag for z in mode.shape.values()]
                axes.bar(places, parts, 0.2, color='0.8', label='a quarter period later')
                axes.legend()
            axes.axhline(0.0, color='k', lw=0.6)
            axes.set_xticks(list(places), names)
            axes.set_ylabel(f'{mode.frequency:.4g} Hz\nratio {mode.damping_ratio:.3g}')
        return figure
    figure = titled(title)
    axes = figure.subplots()
    x = [table.abscissa(s) for s in table.stations]
    count = min(len(s.modes) for s in table.stations)
    for k, stroke in enumerate(strokes(map(str, range(count)))):
        axes.plot(x, [s.modes[k].frequency for s in table.stations], label=f'{k + 1}', **stroke)
    if table.over == 'speed':
        axes.plot(x, np.abs(x) / (2.0 * np.pi), color='0.6', lw=0.6, label='rotation')
        for w, _ in table.critical:
            axes.plot([w], [abs(w) / (2.0 * np.pi)], 'o', color='k', mfc='none')
    axes.legend()
    axes.set_xlabel(
        f'{table.over} of {table.main} [{"rad/s" if table.over == "speed" else "rad"}]'
    )
    axes.set_ylabel('natural frequency [Hz]')
    return figure


def response_json(found: FrequencyResponse) -> dict[str, Any]:
    """SI units, frequencies in Hz, phases in rad; amplitudes per unit of the source."""
    return {
        'source': found.source.name,
        'source_unit': found.source.unit,
        'frequency': found.frequency,
        'amplitude': {name: np.abs(z) for name, z in found.amplitudes.items()},
        'phase': {name: np.angle(z) for name, z in found.amplitudes.items()},
        'units': found.units,
    }


def response_text(found: FrequencyResponse) -> str:
    """For people: a row for each frequency."""
    head = ['frequency [Hz]']
    for name in found.amplitudes:
        head += [f'{name} [{_per(found, name)}]', 'phase [deg]']
    rows = [head]
    for k, f in enumerate(found.frequency):
        row = [f'{f:.6g}']
        for z in found.amplitudes.values():
            row += [f'{abs(z[k]):.6g}', f'{np.degrees(np.angle(z[k])):.4g}']
        rows.append(row)
    return '\n'.join(text_table.lines(rows, indent=''))


def _per(found: FrequencyResponse, name: str) -> str:
    """Unit of an amplitude per unit of the source."""
    unit, source = found.units[name], found.source.unit
    return unit if not source else '1' if unit == source else f'{unit} per {source}'


def response_picture(found: FrequencyResponse, title: str) -> Any:
    """Amplitudes, logarithmic, above phases; each unit has a row of its own."""
    units = list(dict.fromkeys(_per(found, name) for name in found.amplitudes))
    figure = titled(title, height=1.4 + 1.6 * len(units))
    rows = np.ravel(figure.subplots(len(units) + 1, 1, sharex=True))
    lines = strokes(found.amplitudes)
    for (name, z), stroke in zip(found.amplitudes.items(), lines, strict=True):
        axes = rows[units.index(_per(found, name))]
        axes.plot(found.frequency, np.abs(z), label=name, **stroke)
        rows[-1].plot(found.frequency, np.degrees(np.unwrap(np.angle(z))), **stroke)
    for axes, unit in zip(rows, units, strict=False):
        if all((line.get_ydata() > 0.0).any() for line in axes.get_lines()):
            axes.set_yscale('log')
        axes.set_ylabel(f'[{unit}]')
        axes.legend()
    rows[-1].set_ylabel('phase [deg]')
    rows[-1].set_xlabel(f'frequency of {found.source.name} [Hz]')
    return figure


def harmonics_json(found: Harmonics) -> dict[str, Any]:
    """SI units, frequencies in Hz, phases in rad."""
    frequency = next(iter(found.series.values())).frequencies / (2.0 * np.pi)
    return {
        'period': found.period,
        'frequency': frequency,
        'mean': {name: s.mean for name, s in found.series.items()},
        'amplitude': {name: np.abs(s.amplitudes) for name, s in found.series.items()},
        'phase': {name: np.angle(s.amplitudes) for name, s in found.series.items()},
        'units': found.units,
    }


def harmonics_text(found: Harmonics) -> str:
    """For people: a row for each harmonic."""
    head = ['harmonic', 'frequency [Hz]']
    for name in found.series:
        head += [f'{name} [{found.units[name]}]', 'phase [deg]']
    rows = [head, ['mean', '', *(x for s in found.series.values() for x in (f'{s.mean:.6g}', ''))]]
    first = next(iter(found.series.values()))
    for k, w in enumerate(first.frequencies):
        row = [str(k + 1), f'{w / (2.0 * np.pi):.6g}']
        for s in found.series.values():
            z = s.amplitudes[k]
            row += [f'{abs(z):.6g}', f'{np.degrees(np.angle(z)):.4g}']
        rows.append(row)
    return '\n'.join(text_table.lines(rows, indent=''))


def harmonics_picture(found: Harmonics, title: str) -> Any:
    """Amplitudes of the harmonics as stems."""
    figure = titled(title, height=1.0 + 1.5 * len(found.series))
    rows = np.ravel(figure.subplots(len(found.series), 1, sharex=True))
    for axes, (name, s) in zip(rows, found.series.items(), strict=True):
        axes.bar(np.arange(1, len(s.amplitudes) + 1), np.abs(s.amplitudes), 0.3, color='0.4')
        axes.set_ylabel(f'{name} [{found.units[name]}]')
    rows[-1].xaxis.get_major_locator().set_params(integer=True)
    rows[-1].set_xlabel(f'harmonic of {1.0 / found.period:.6g} Hz')
    return figure
