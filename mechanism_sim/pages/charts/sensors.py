"""Signals of sensors: over time, and by frequency, order and frequency of shocks."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from mechanism_sim.analysis.details import ORDERS, Wanted, everything, find_details
from mechanism_sim.analysis.details import Line as Spectral
from mechanism_sim.analysis.signals import Signal
from mechanism_sim.export.palette import colour
from mechanism_sim.pages.charts.course import Course
from mechanism_sim.pages.charts.section import Chart, Section
from mechanism_sim.pages.charts.style import MUTED, brief, chart, places, written
from mechanism_sim.pages.charts.thinning import Line, thin

_MARKED = 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000
_NUMBERED = 1, 10, 100, 1000
_DECADES = 1e-7  # below the highest line nothing is drawn


def sensors(course: Course, skip: int) -> Section | None:
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
        shade = colour(i)
        if course.long:
            span = course.detail.start, course.detail.end
            charts.append(_signal(signal, span, shade, f'{name}: last turns', f'sensor-{name}'))
        span = course.run.start, course.run.end
        charts.append(_signal(signal, span, shade, f'{name}: the whole run', f'sensor-{name}-run'))
        if name in found.spectra:
            charts.append(_density(name, found.spectra[name], found.drive_rate, shade))
        if name in found.orders:
            charts.append(_orders(name, found.orders[name], found.drive, shade))
        if name in found.envelopes:
            charts.append(_envelope(name, found.envelopes[name], found.drive_rate, shade))
    text = 'What each sensor reads through its filter and converter.'
    if found.drive_rate:
        text += (
            f' Dotted lines mark orders: multiples of the {found.drive_rate:.5g} Hz at which the '
            f'{found.drive} turns.'
        )
    return Section('sensors', 'Sensors', text, tuple(charts))


def _signal(signal: Signal, span: tuple[float, float], shade: str, title: str, key: str) -> Chart:
    figure = chart('time [s]', f'{signal.quantity} [{signal.unit}]', showlegend=False)
    figure.update_xaxes(range=list(span))
    for t, run in zip(signal.times, signal.runs, strict=True):
        inside = (t >= span[0]) & (t <= span[1])
        if inside.any():
            line = thin(Line(t[inside], run[inside]))
            figure.add_scatter(
                x=places(line.at), y=brief(line.values), mode='lines', name=signal.sensor,
                line={'color': shade, 'width': 1.1},
                hovertemplate=f'%{{x:.6f}} s<br>%{{y:.5g}} {signal.unit}',
            )  # fmt: skip
    return Chart(key, title, written(figure), 'time', signal.sensor)


def _density(name: str, line: Spectral, rate: float | None, shade: str) -> Chart:
    found, highest = line.spectrum, float(line.spectrum.values[1:].max(initial=0.0))
    figure = chart('frequency [Hz]', f'power density [{line.unit}]', showlegend=False)
    shown = found.frequency > 0.0
    x, y = found.frequency[shown], found.values[shown]
    low, high = np.log10([x[0], x[-1]])
    thinned = thin(Line(np.log10(x), y), 2000)
    figure.update_xaxes(type='log', range=[low, high], dtick=1, tickformat='~g')
    if highest:
        ends = np.log10([_DECADES * highest, 3.0 * highest])
        figure.update_yaxes(type='log', range=ends.tolist())
    _add(figure, Line(10.0**thinned.at, thinned.values), shade, 'Hz', line.unit)
    _mark_orders(figure, rate, 10.0**low, 10.0**high, log=True)
    title = f'{name}: power spectral density'
    return Chart(f'sensor-{name}-density', title, written(figure), 'frequency', name)


def _orders(name: str, line: Spectral, drive: str, shade: str) -> Chart:
    words = f'order [cycles per turn of the {drive}]'
    figure, _ = _amplitudes(line, 1.0, words, shade, 'per turn')
    return Chart(f'sensor-{name}-orders', f'{name}: orders', written(figure), 'frequency', name)


def _envelope(name: str, line: Spectral, rate: float | None, shade: str) -> Chart:
    low, high = line.band or (0.0, 0.0)
    figure, end = _amplitudes(line, rate, 'frequency [Hz]', shade, 'Hz')
    _mark_orders(figure, rate, 0.0, end, log=False)
    title = f'{name}: squared envelope from {low:.6g} Hz to {high:.6g} Hz'
    return Chart(f'sensor-{name}-envelope', title, written(figure), 'frequency', name)


def _amplitudes(
    line: Spectral, rate: float | None, words: str, shade: str, unit: str
) -> tuple[go.Figure, float]:
    """A spectrum over what the words say, in which the first order lies at `rate`; its end."""
    figure = chart(words, f'amplitude [{line.unit}]', showlegend=False)
    end, *shown = line.significant_part(rate)
    figure.update_xaxes(range=[0.0, end])
    figure.update_yaxes(rangemode='tozero')
    _add(figure, thin(Line(*shown)), shade, unit, line.unit)
    return figure, end


def _add(figure: go.Figure, line: Line, shade: str, x: str, y: str) -> None:
    figure.add_scatter(
        x=places(line.at), y=brief(line.values), mode='lines', line={'color': shade, 'width': 1.2},
        hovertemplate=f'%{{x:.5g}} {x}<br>%{{y:.4g}} {y}', name='',
    )  # fmt: skip


def _mark_orders(
    figure: go.Figure, rate: float | None, low: float, high: float, log: bool
) -> None:
    """Dotted lines at orders of the drive within a range [Hz], with their numbers on top."""
    if not rate:
        return
    fives = range(5, ORDERS + 1, 5)
    chosen, numbered = (_MARKED, _NUMBERED) if log else ((1, 2, 3, 4, *fives), (1, *fives))
    figure.update_layout(margin_t=24)
    for order in chosen:
        if low < (at := order * abs(rate)) < high:
            figure.add_shape(
                type='line', x0=at, x1=at, y0=0, y1=1, yref='paper', layer='below',
                line={'color': '#aab3bd', 'width': 1, 'dash': 'dot'},
            )  # fmt: skip
            if order in numbered:
                figure.add_annotation(
                    x=np.log10(at) if log else at, y=1.0, yref='paper', yanchor='bottom',
                    text=str(order), showarrow=False, font={'size': 10, 'color': MUTED},
                )  # fmt: skip
