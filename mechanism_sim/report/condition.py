"""Pictures of what a bag tells: spectra, averages, impacts and wear on pin and bushing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from mechanism_sim.analysis.details import Average, Beside, Details, Line, Struck
from mechanism_sim.analysis.roses import Rose
from mechanism_sim.analysis.wear import WearMap
from mechanism_sim.report.cycle import for_people
from mechanism_sim.report.figures import few_ticks, over_turn, titled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DECADES = 1e-6  # below the highest line nothing is drawn


def draw(details: Details) -> dict[str, Figure]:
    """The pictures of what was asked of a bag, by name."""
    return dict(_figures(details))


def _figures(details: Details) -> Iterator[tuple[str, Figure]]:
    for name, line in details.spectra.items():
        yield f'{name}_spectrum', _spectrum(name, line)
    for name, line in details.orders.items():
        yield f'{name}_orders', _orders(name, line, details.drive)
    for name, line in details.envelopes.items():
        yield f'{name}_envelope', _envelope(name, line, details.drive_rate)
    for name, average in details.averages.items():
        yield f'{name}_average', _average(name, average, details.drive)
    for name, struck in details.impacts.items():
        yield f'{name}_impacts', rose_picture(name, struck.rose)
        if struck.cycles is not None:
            yield f'{name}_cycles', _cycles(name, struck, details.drive)
    for name, maps in details.wear.items():
        yield f'{name}_wear', _wear(name, *maps)
    for name, beside in details.deviations.items():
        yield f'{name}_deviation', _deviation(name, beside, details.drive)


def _spectrum(name: str, line: Line) -> Figure:
    figure = titled(f'power spectral density of {name}')
    axes, s = figure.subplots(), line.spectrum
    axes.plot(s.frequency[1:], s.values[1:], color='0.1', lw=0.9)
    axes.set_xlim(0.0, s.frequency[-1])
    if highest := s.values[1:].max():
        axes.set_yscale('log')
        axes.set_ylim(bottom=_DECADES * highest)
    axes.set(xlabel='frequency [Hz]', ylabel=f'[{line.unit}]')
    return figure


def _orders(name: str, line: Line, drive: str) -> Figure:
    words = f'order [cycles per turn of the {drive}]'
    return _amplitudes(f'order spectrum of {name}', line, 1.0, words)


def _envelope(name: str, line: Line, drive_rate: float | None) -> Figure:
    low, high = line.band or (0.0, 0.0)
    title = f'squared envelope of {name} from {low:.4g} Hz to {high:.4g} Hz'
    return _amplitudes(title, line, drive_rate, 'frequency [Hz]')


def _amplitudes(title: str, line: Line, rate: float | None, words: str) -> Figure:
    """A spectrum over what the words say, in which the first order lies at `rate`."""
    figure = titled(title)
    axes, (end, *shown) = figure.subplots(), line.significant_part(rate)
    axes.plot(*shown, color='0.1', lw=0.9)
    axes.set_xlim(0.0, end)
    axes.set_ylim(bottom=0.0)
    axes.set(xlabel=words, ylabel=f'amplitude [{line.unit}]')
    return figure


def _average(name: str, average: Average, drive: str) -> Figure:
    turns = average.turns
    figure = titled(f'{name}: average of {len(turns.values)} turns, and their standard deviation')
    axes = figure.subplots()
    unit, scale = for_people(average.unit)
    angle, mean, spread = np.degrees(turns.angle), scale * turns.mean, scale * turns.spread
    axes.fill_between(angle, mean - spread, mean + spread, color='0.85', lw=0.0)
    axes.plot(angle, mean, color='0.1', lw=0.9)
    over_turn(axes, drive)
    axes.set_ylabel(f'[{unit}]')
    return figure


def _polar(figure: Figure, count: int) -> list[Any]:
    found = figure.subplots(1, count, subplot_kw={'projection': 'polar'}, squeeze=False)[0]
    for axes in found:
        axes.set_rlabel_position(22.5)
        few_ticks(axes)
    return list(found)


def rose_picture(name: str, rose: Rose) -> Figure:
    """[SB] 8.11: every impact a line towards the place struck, the six largest marked."""
    figure = titled(f'impacts in {name} [N s]', 7.0, 4.0)
    parts = (
        (f'pin, seen from the {rose.pin}', rose.on_pin),
        (f'bushing, seen from the {rose.bushing}', rose.on_bushing),
    )
    for axes, (title, angle) in zip(_polar(figure, 2), parts, strict=True):
        rays = np.array([rose.normal_impulse * k for k in (0.0, 1.0, np.nan)])
        axes.plot(
            np.tile(angle, (3, 1)).T.ravel(), rays.T.ravel(), color='0.55', lw=0.6, rasterized=True
        )
        for i, k in enumerate(rose.largest, 1):
            axes.plot([angle[k]] * 2, [0.0, rose.normal_impulse[k]], color='0.1', lw=1.3)
            axes.annotate(f'Y{i}', (angle[k], 1.04 * rose.normal_impulse[k]), fontsize=7.0)
        axes.set_title(title, fontsize=9.0)
        axes.set_ylim(0.0, 1.15 * rose.normal_impulse.max(initial=0.0) or 1.0)
    return figure


def _cycles(name: str, struck: Struck, drive: str) -> Figure:
    """[SB] 8.12 and 7.10: the dominant impacts by angle of the drive, and sums turn by turn."""
    rose, cycles = struck.rose, struck.cycles
    assert cycles is not None  # noqa: S101 - asked before
    figure = titled(f'impacts in {name}, turn by turn', 7.0, 6.4)
    above, *below = figure.subplots(3, 1, height_ratios=(2, 1, 1))
    above.plot(
        np.degrees(rose.crank_angle), 1e3 * rose.normal_impulse, '.', color='0.7', ms=3.0,
        rasterized=True,
    )  # fmt: skip
    marks = ('first', 'o', '0.1'), ('second', 's', '0.35'), ('third', '^', '0.55')
    for (label, mark, shade), column in zip(marks, cycles.dominant.T, strict=True):
        k = column[column >= 0]
        above.plot(
            np.degrees(rose.crank_angle[k]), 1e3 * rose.normal_impulse[k], mark, color=shade,
            ms=4.0, label=f'{label} of its turn',
        )  # fmt: skip
    over_turn(above, drive)
    above.set_ylabel('impulse [mN s]')
    above.legend(frameon=False, fontsize=7.5, ncols=3)
    turn = cycles.first + np.arange(len(cycles.count))
    for axes, x, words in zip(
        below, (cycles.impulse, cycles.I_n), ('sum of impulses', '$I_n$'), strict=True
    ):
        axes.step(turn, 1e3 * x, where='mid', color='0.1', lw=1.1)
        axes.set_ylabel(f'{words} [mN s]')
        axes.set_ylim(bottom=0.0)
        axes.xaxis.get_major_locator().set_params(integer=True)
    below[-1].set_xlabel(f'turn of the {drive}')
    return figure


def _wear(name: str, bushing: WearMap, pin: WearMap) -> Figure:
    figure = titled(f'wear in {name}, by direction', 9.5, 6.6)
    rows: Any = figure.subfigures(2, 1)
    for row, part, wear in zip(rows, ('bushing', 'pin'), (bushing, pin), strict=True):
        sums = (
            ('impulses of impacts [N s]', wear.impulse),
            ('normal force times way slid [N m]', wear.load_way),
            ('work of friction [J]', wear.work),
        )
        shown = [(title, x) for title, x in sums if x.any()] or [sums[0]]
        for axes, (title, x) in zip(_polar(row, len(shown)), shown, strict=True):
            axes.fill(np.repeat(wear.edges, 2)[1:-1], np.repeat(x, 2), color='0.45', lw=0.0)
            axes.set_title(f'{part} on {wear.link}\n{title}', fontsize=8.0)
    return figure


def _deviation(name: str, beside: Beside, drive: str) -> Figure:
    own, ideal = beside.deviation.own, beside.deviation.ideal
    figure = titled(f'{name} beside the ideal machine')
    axes = figure.subplots()
    unit, scale = for_people(beside.unit)
    angle = np.degrees(own.angle)
    axes.plot(angle, scale * own.values[-1], color='0.5', lw=0.7, label='the last turn')
    axes.plot(angle, scale * ideal.values[-1], color='0.1', lw=1.3, label='ideal')
    over_turn(axes, drive)
    axes.set_ylabel(f'[{unit}]')
    axes.legend(frameon=False, fontsize=7.5, ncols=2)
    return figure
