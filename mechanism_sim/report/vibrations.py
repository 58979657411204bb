"""Modes and responses of a scene: as text, as JSON, as pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim import text_table
from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.export.palette import GROUND, INK, LINKS
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.report.charts.chart import SMALL, Axis, Chart, ChartCurve, Mark, Panel, whole
from mechanism_sim.report.charts.lines import colours
from mechanism_sim.strict_json import plain
from mechanism_sim.studies.harmonics import Harmonics
from mechanism_sim.studies.modes import CriticalSpeed, NormalMode, Station
from mechanism_sim.studies.response import FrequencyResponse

_UNDAMPED = 1e-9  # damping ratio up to which there is none but for rounding
_SHOWN = 1e-6  # share of the largest amplitude: an error visible in six digits
_PEAKLESS = 0.5**0.5  # above it the response to an unbalance has no peak


class ModeTable(NamedTuple):
    """The modes at one place, or at several."""

    scene: str  #: name of the scene
    stations: Sequence[Station]  #: a single one about rest, several over angles or speeds
    over: str | None = None  #: 'angle' or 'speed'; None about rest
    main: str = ''  #: coordinate of the drive
    #: speeds at which a natural frequency is that of the rotation
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
        found['critical_damping_ratios'] = [x.damping_ratio for x in table.critical]
        if any(x.whirl is not None for x in table.critical):
            found['critical_whirl'] = [x.whirl for x in table.critical]
    return found


def _mode(mode: NormalMode) -> dict[str, Any]:
    return {
        'frequency': mode.frequency,
        'damping_ratio': mode.damping_ratio,
        'damped_frequency': mode.damped_frequency,
        'oscillates': mode.oscillates,
        'time_constants': list(mode.time_constants),
        'shape': {name: z.real for name, z in mode.shape.items()},
        'shape_imaginary': {name: z.imag for name, z in mode.shape.items()},
        **({} if mode.whirl is None else {'whirl': mode.whirl}),
    }


def _way(whirl: float | None) -> str:
    """Sense of a whirl: with the rotation or against it; empty for a straight motion."""
    return '' if whirl is None or abs(whirl) < 1e-6 else ' forward' if whirl > 0.0 else ' backward'


def modes_text(table: ModeTable) -> str:
    """Format modes as text."""
    if table.over is None:
        modes = table.stations[0].modes
        names = list(dict.fromkeys(name for mode in modes for name in mode.shape))
        head = ['mode', *(str(k + 1) for k in range(len(modes)))]
        ratios = [m.damping_ratio for m in modes]
        # none of a real root alone, 0 of a rigid-body mode
        alone = [len(m.roots) == 1 and bool(m.time_constants) for m in modes]
        natural = ['-' if x else f'{m.frequency:.6g}' for x, m in zip(alone, modes, strict=True)]
        rows: list[list[str]] = [
            head,
            ['natural frequency [Hz]', *natural],
            ['damping ratio', *('-' if x is None else f'{x:.6g}' for x in ratios)],
            ['damped frequency [Hz]', *(f'{m.damped_frequency:.6g}' for m in modes)],
        ]
        if any(m.time_constants for m in modes):
            rows.append(['time constant [s]', *map(_time_constants, modes)])
        if any(_way(m.whirl) for m in modes):
            rows.append(['whirl', *(_way(m.whirl).strip() or '-' for m in modes)])
        rows += [[name, *(_amplitude(m.shape.get(name)) for m in modes)] for name in names]
        lines = text_table.lines(rows, indent='')
        if speed := table.stations[0].speed:
            lines.append(f'its torque keeps {table.main} turning at {speed:.9g} rad/s')
        if faded := table.stations[0].faded:
            lines.append(f'{faded} more decay within a turn')
        return '\n'.join(lines)
    unit = 'rad/s' if table.over == 'speed' else 'rad'
    most = max(len(s.oscillating) for s in table.stations)
    rows = [[f'{table.over} of {table.main} [{unit}]', *(f'{k + 1} [Hz]' for k in range(most))]]
    for s in table.stations:
        shown = [f'{m.frequency:.6g}{_way(m.whirl)}' for m in s.oscillating]
        rows.append([f'{table.abscissa(s):.6g}', *shown, *[''] * (most - len(shown))])
    lines = text_table.lines(rows, indent='')
    still = [len(s.modes) - len(s.oscillating) for s in table.stations]
    if any(still):
        few, many = min(still), max(still)
        count = f'{many}' if few == many else f'{few} to {many}'
        lines.append(f'{count} more {"does" if many == 1 else "do"} not oscillate')
    if table.critical:
        speeds = ', '.join(map(_critical, table.critical))
        lines.append(f'critical speeds [rad/s]: {speeds}')
    return '\n'.join(lines)


def _time_constants(mode: NormalMode) -> str:
    """Time constants of one or two real roots, with a mark on motions that grow."""
    shown = [f'{abs(x):.6g}{" (grows)" if x < 0.0 else ""}' for x in mode.time_constants]
    return ' and '.join(shown) or '-'


def _critical(critical: CriticalSpeed) -> str:
    """A critical speed, and the damping of its mode if it has any."""
    ratio = critical.damping_ratio
    damped = f' (damping ratio {ratio:.4g})' if abs(ratio) > _UNDAMPED else ''
    if ratio > _PEAKLESS:
        damped = f' (damping ratio {ratio:.4g}: no resonance)'
    return f'{critical.speed:.9g}{_way(critical.whirl)}{damped}'


def _amplitude(z: complex | None) -> str:
    """Amplitude of a shape: a number, or size and phase where the parts do not move in step."""
    if z is None:
        return '-'
    if abs(z.imag) <= 1e-9:
        return f'{z.real if abs(z.real) > 1e-12 else 0.0:.4g}'
    return f'{abs(z):.4g} at {np.degrees(np.angle(z)):.1f} deg'


def modes_chart(table: ModeTable, title: str) -> Chart:
    """Mode shapes as stems; frequencies over angle or speed, with the line of the rotation."""
    if table.over is None:
        panels = tuple(map(_shape, table.stations[0].modes))
        return Chart('modes', title, panels)
    x = np.array([table.abscissa(s) for s in table.stations])
    count = min(len(s.oscillating) for s in table.stations)
    curves = [
        ChartCurve(
            x, np.array([s.oscillating[k].frequency for s in table.stations]), f'mode {k + 1}',
            colour=k, dash=k // len(LINKS),
        )
        for k in range(count)
    ]  # fmt: skip
    if table.over == 'speed':
        curves.append(ChartCurve(x, np.abs(x) / TWO_PI, 'rotation', colour=GROUND, look='fine'))
        w = np.array([critical.speed for critical in table.critical], np.float64)
        curves.append(
            ChartCurve(w, np.abs(w) / TWO_PI, 'critical speed', '', INK, form='dots',
                  marker='circle-open')
        )  # fmt: skip
    axis = Axis(f'{table.over} of {table.main}', 'rad/s' if table.over == 'speed' else 'rad')
    panel = Panel(axis, Axis('natural frequency', 'Hz'), tuple(curves), height=2.4)
    return Chart('frequencies', title, (panel,))


def _shape(mode: NormalMode) -> Panel:
    """A mode shape: real parts, and imaginary ones where the parts do not move in step."""
    places = np.arange(len(mode.shape), dtype=np.float64)
    z = np.array([*mode.shape.values()])
    curves = [ChartCurve(places, z.real, 'now', form='stems', marker='circle')]
    if np.abs(z.imag).max() > 1e-9:
        curves.append(ChartCurve(places, z.imag, 'a quarter period later', '', 1, form='stems',
                            marker='circle-open'))  # fmt: skip
    head = f'{mode.frequency:.4g} Hz'
    if mode.damping_ratio is not None:
        head += f', damping ratio {mode.damping_ratio:.3g}'
    elif mode.time_constants:
        head = f'time constant {_time_constants(mode)} s'
    x = Axis('coordinate', low=-0.5, high=len(places) - 0.5, names=tuple(mode.shape))
    return Panel(x, Axis('shape'), tuple(curves), head, height=SMALL, marks=(Mark(0.0, '', True),))


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
    """Format a response: a row for each frequency, and peaks narrower than the steps."""
    units = {name: _per(found, name) for name in found.amplitudes}
    rows = _amplitude_rows(found.frequency, found.amplitudes, units)
    lines = text_table.lines(rows, indent='')
    lines += [
        f'{name}: peaks near {", ".join(f"{f:.4g}" for f in at)} Hz are narrower than the steps: '
        'take finer ones there; without damping they have no height'
        for name, at in found.unresolved.items()
    ]
    if not found.source.unit:
        lines.append(f'{found.source.name}; phases before cos(w t), from its start at t = 0')
    return '\n'.join(lines)


def _amplitude_rows(
    frequency: Array, amplitudes: Mapping[str, ComplexArray], units: Mapping[str, str]
) -> list[list[str]]:
    """A head, then a row for each frequency: size and phase of each amplitude."""
    rows = [['frequency [Hz]']]
    rows[0] += [x for name in amplitudes for x in (f'{name} [{units[name]}]', 'phase [deg]')]
    for k, f in enumerate(frequency):
        shown = ((f'{abs(z[k]):.6g}', f'{np.degrees(np.angle(z[k])):.4g}')
                 for z in amplitudes.values())  # fmt: skip
        rows.append([f'{f:.6g}', *(x for pair in shown for x in pair)])
    return rows


def _per(found: FrequencyResponse, name: str) -> str:
    """Unit of an amplitude per unit of the source."""
    unit, source = found.units[name], found.source.unit
    return unit if not source else '1' if unit == source else f'{unit} per {source}'


def response_chart(found: FrequencyResponse, title: str) -> Chart:
    """Amplitudes, logarithmic, above phases; each unit has a panel of its own."""
    shades = dict(zip(found.amplitudes, colours(found.amplitudes, {}), strict=True))
    x = Axis(f'frequency of {found.source.name}', 'Hz')
    panels, names = [], list(found.amplitudes)
    for unit in dict.fromkeys(_per(found, name) for name in names):
        sizes = {n: np.abs(found.amplitudes[n]) for n in names if _per(found, n) == unit}
        log = all((y > 0.0).any() for y in sizes.values())
        curves = tuple(ChartCurve(found.frequency, y, n, n, shades[n]) for n, y in sizes.items())
        head = next(iter(sizes)) if len(sizes) == 1 else ''
        panels.append(Panel(x, Axis('amplitude', unit, log=log), curves, head))
    phases = tuple(
        ChartCurve(found.frequency, np.degrees(np.unwrap(np.angle(z))), name, name, shades[name])
        for name, z in found.amplitudes.items()
    )
    return Chart('response', title, (*panels, Panel(x, Axis('phase', 'deg'), phases)), 'frequency')


def harmonics_json(found: Harmonics) -> dict[str, Any]:
    """SI units, frequencies in Hz, phases in rad."""
    first, *_ = found.series.values()
    return {
        'period': found.period,
        'frequency': first.frequencies / (2.0 * np.pi),
        'mean': {name: s.mean for name, s in found.series.items()},
        'amplitude': {name: np.abs(s.amplitudes) for name, s in found.series.items()},
        'phase': {name: np.angle(s.amplitudes) for name, s in found.series.items()},
        'error': {name: s.error for name, s in found.series.items()},
        'remainder': {name: plain(s.rest) for name, s in found.series.items()},
        'units': found.units,
    }


def harmonics_text(found: Harmonics) -> str:
    """Format harmonics: a row for each."""
    first, *_ = found.series.values()
    amplitudes = {name: s.amplitudes for name, s in found.series.items()}
    head, *rows = _amplitude_rows(first.frequencies / (2.0 * np.pi), amplitudes, found.units)
    means = [x for s in found.series.values() for x in (f'{s.mean:.6g}', '')]
    rest = [x for s in found.series.values() for x in (_rest(s.rest), 'rms')]
    rows = [
        ['harmonic', *head],
        ['mean', '', *means],
        *([str(k), *row] for k, row in enumerate(rows, 1)),
        [f'above {len(rows)}', '', *rest],
    ]
    lines = text_table.lines(rows, indent='')
    lines += [
        f'{name}: amplitudes may be off by {s.error:.2g} {found.units[name]}'
        for name, s in found.series.items()
        if s.error > _SHOWN * np.abs(s.amplitudes).max(initial=0.0)
    ]
    return '\n'.join(lines)


def _rest(rest: float) -> str:
    """Root mean square of the harmonics that are not shown, at most."""
    return '0' if rest == 0.0 else f'<= {rest:.3g}' if np.isfinite(rest) else 'no bound'


def harmonics_chart(found: Harmonics, title: str) -> Chart:
    """Amplitudes of the harmonics as stems."""
    panels = []
    for k, (name, s) in enumerate(found.series.items()):
        number = np.arange(1.0, len(s.amplitudes) + 1.0)
        x = Axis(f'harmonic of {1.0 / found.period:.6g} Hz', every=whole(len(number)))
        curve = ChartCurve(
            number, np.abs(s.amplitudes), name, name, k, form='stems', marker='circle'
        )
        y = Axis('amplitude', found.units[name], low=0.0)
        panels.append(Panel(x, y, (curve,), name, height=SMALL + 0.3))
    return Chart('harmonics', title, tuple(panels), 'frequency')
