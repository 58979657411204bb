"""Signals of sensors: over time, and by frequency, order and frequency of shocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mechanism_sim.analysis.collectors import Signal
from mechanism_sim.analysis.details import ORDERS, Wanted, everything, find_details
from mechanism_sim.analysis.details import SignalSpectrum as Spectral
from mechanism_sim.arrays import Array
from mechanism_sim.report.charts.chart import (
    TIME,
    Axis,
    Chart,
    ChartCurve,
    ChartSection,
    Mark,
    Panel,
)
from mechanism_sim.report.charts.course import ChartedRun, ChartWindow
from mechanism_sim.report.charts.thinning import SampledLine, thin

_MARKED = 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000
_NUMBERED = 1, 10, 100, 1000
_FREQUENCY = Axis('frequency', 'Hz')
_DECADES = 1e-7  # below the highest line nothing is drawn


def sensors(course: ChartedRun, skip: int) -> ChartSection | None:
    """Signal, power spectral density, orders and envelope spectrum of every sensor."""
    record = course.record
    names = record.sampled_sensors
    if not names:
        return None
    wanted = everything(record, Wanted(skip=skip))
    found = find_details(
        record, Wanted(wanted.spectra, wanted.orders, wanted.envelopes, skip=skip)
    )
    charts: list[Chart] = []
    for i, name in enumerate(names):
        signal = record.signal(name).since(course.begin)
        for window, when, key in course.windows(f'sensor-{name}'):
            charts.append(_signal(signal, window, i, f'{name} over {when}', key))
        if name in found.spectra:
            charts.append(density(name, found.spectra[name], found.drive_rate, i))
        if name in found.orders:
            charts.append(orders(name, found.orders[name], found.drive, i))
        if name in found.envelopes:
            charts.append(envelope(name, found.envelopes[name], found.drive_rate, i))
    text = 'What each sensor reads through its filter and converter.'
    if found.drive_rate:
        text += (
            f' Dotted lines mark orders: multiples of the {found.drive_rate:.5g} Hz at which the '
            f'{found.drive} turns.'
        )
    return ChartSection('sensors', 'Sensors', text, tuple(charts))


def _signal(signal: Signal, window: ChartWindow, number: int, title: str, key: str) -> Chart:
    parts: list[Array] = []
    for t, run in zip(signal.times, signal.runs, strict=True):
        inside = (t >= window.start) & (t <= window.end)
        if inside.any():
            parts += [np.full((2, 1), np.nan), np.array(thin(SampledLine(t[inside], run[inside])))]
    x, y = np.concatenate([*parts[1:], np.empty((2, 0))], axis=1)
    curve = ChartCurve(x, y, of=signal.sensor, colour=number)
    axis = replace(TIME, low=window.start, high=window.end)
    panel = Panel(axis, Axis(signal.quantity, signal.unit), (curve,))
    return Chart(key, title, (panel,), 'time', signal.sensor)


def density(name: str, line: Spectral, rate: float | None, number: int = 0) -> Chart:
    """Power spectral density."""
    found, highest = line.spectrum, float(line.spectrum.values[1:].max(initial=0.0))
    shown = found.frequency > 0.0
    x, y = found.frequency[shown], found.values[shown]
    at, values = thin(SampledLine(np.log10(x), y), 2000)
    across = replace(_FREQUENCY, low=float(x[0]), high=float(x[-1]), log=True)
    up = Axis('power density', line.unit)
    if highest:
        up = replace(up, low=_DECADES * highest, high=3.0 * highest, log=True)
    curve = ChartCurve(10.0**at, values, of=name, colour=number)
    panel = Panel(across, up, (curve,), marks=_orders_at(rate, across))
    title = f'{name}: power spectral density'
    return Chart(f'sensor-{name}-density', title, (panel,), 'frequency', name)


def orders(name: str, line: Spectral, drive: str, number: int = 0) -> Chart:
    """Amplitudes by order of the drive."""
    axis = Axis('order', f'cycles per turn of the {drive}')
    panel = _amplitudes(name, line, 1.0, axis, number)
    return Chart(f'sensor-{name}-orders', f'{name}: orders', (panel,), 'frequency', name)


def envelope(name: str, line: Spectral, rate: float | None, number: int = 0) -> Chart:
    """The spectrum of the squared envelope in a band."""
    low, high = line.band or (0.0, 0.0)
    panel = _amplitudes(name, line, rate, _FREQUENCY, number)
    panel = replace(panel, marks=_orders_at(rate, panel.x))
    title = f'{name}: squared envelope from {low:.6g} Hz to {high:.6g} Hz'
    return Chart(f'sensor-{name}-envelope', title, (panel,), 'frequency', name)


def _amplitudes(name: str, line: Spectral, rate: float | None, axis: Axis, number: int) -> Panel:
    """A spectrum in which the first order lies at `rate`."""
    end, *shown = line.significant_part(rate)
    curve = ChartCurve(*thin(SampledLine(*shown)), of=name, colour=number)
    up = Axis('amplitude', line.unit, low=0.0)
    return Panel(replace(axis, low=0.0, high=end), up, (curve,))


def _orders_at(rate: float | None, axis: Axis) -> tuple[Mark, ...]:
    """Marks at orders of the drive within a range [Hz], with their numbers."""
    low, high = axis.low or 0.0, axis.high or 0.0
    fives = range(5, ORDERS + 1, 5)
    chosen, numbered = (_MARKED, _NUMBERED) if axis.log else ((1, 2, 3, 4, *fives), (1, *fives))
    return tuple(
        Mark(at, str(order) if order in numbered else '')
        for order in (chosen if rate else ())
        if low < (at := order * abs(rate or 0.0)) < high
    )
