"""Pictures of a machine's condition from a bag: spectra, averages, impacts, wear."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mechanism_sim.analysis.details import Average, Beside, Details, ImpactDetails
from mechanism_sim.analysis.roses import Rose, WearMap
from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import GROUND
from mechanism_sim.report.charts.chart import SMALL, Axis, Chart, ChartCurve, Panel, joined, whole
from mechanism_sim.report.charts.impacts import rose_chart, wear_chart
from mechanism_sim.report.charts.lines import turn_of
from mechanism_sim.report.charts.subjects import density, envelope, orders
from mechanism_sim.sensing.spectra import TurnSegments

_SUMS = {
    'impulse': ('impulses of impacts', 'N s'),
    'load_way': ('normal force times sliding distance', 'N m'),
    'work': ('work of friction', 'J'),
}


def charts(details: Details) -> Iterator[Chart]:
    """The charts of the results requested of a bag, by name."""
    for name, chart in _named(details):
        yield replace(chart, key=name)


def _named(details: Details) -> Iterator[tuple[str, Chart]]:
    rate, drive = details.drive_rate, details.drive
    for name, line in details.spectra.items():
        yield f'{name}_spectrum', density(name, line, rate)
    for name, line in details.orders.items():
        yield f'{name}_orders', orders(name, line, drive)
    for name, line in details.envelopes.items():
        yield f'{name}_envelope', envelope(name, line, rate)
    for name, average in details.averages.items():
        yield f'{name}_average', _average(name, average, drive)
    for name, hits in details.impacts.items():
        yield f'{name}_impacts', rose_picture(name, hits.rose)
        if hits.cycles is not None:
            yield f'{name}_cycles', _cycles(name, hits, drive)
    for name, maps in details.wear.items():
        yield f'{name}_wear', _wear(name, *maps)
    for name, beside in details.deviations.items():
        yield f'{name}_deviation', _deviation(name, beside, drive)


def _average(name: str, average: Average, drive: str) -> Chart:
    turns = average.turns
    angle, mean, spread = np.degrees(turns.angle), turns.mean, turns.spread
    curves = (
        ChartCurve(angle, mean + spread, 'standard deviation', name, form='area', look='range',
              low=mean - spread),
        ChartCurve(angle, mean, f'mean of {turns.text}', name),
    )  # fmt: skip
    panel = Panel(turn_of(drive, turns.turns), Axis(name.replace('_', ' '), average.unit), curves)
    return Chart('average', f'{name}, turn by turn', (panel,), 'angle', name)


def rose_picture(name: str, rose: Rose) -> Chart:
    """[SB] 8.11: every impact as a line towards its contact point, the six largest marked."""
    found = [rose_chart(rose, on_pin, name, 0) for on_pin in (True, False)]
    short = [replace(c, title=c.title.removeprefix(f'{rose.joint}: ')) for c in found]
    return joined(f'impacts in {name}', short, 2)


def _cycles(name: str, hits: ImpactDetails, drive: str) -> Chart:
    """[SB] 8.12 and 7.10: the dominant impacts by angle of the drive, and sums turn by turn."""
    rose, cycles = hits.rose, hits.cycles
    assert cycles is not None  # noqa: S101 - asked before
    angle, impulse = np.degrees(rose.crank_angle), rose.normal_impulse
    curves = [
        ChartCurve(angle, impulse, colour=GROUND, form='dots', look='fine', marker='circle-open')
    ]
    marks = ('first', 'circle'), ('second', 'square'), ('third', 'triangle-up')
    for n, ((label, mark), column) in enumerate(zip(marks, cycles.dominant.T, strict=True)):
        k = column[column >= 0]
        curves.append(
            ChartCurve(
                angle[k], impulse[k], f'{label} of its turn', '', n, form='dots', marker=mark
            )
        )
    turn = (cycles.first + np.arange(len(cycles.count))).astype(float)
    x = Axis(f'turn of the {drive}', '', every=whole(len(turn)))
    panels = [Panel(turn_of(drive), Axis('normal impulse', 'N s', low=0.0), tuple(curves))]
    for sums, words in (cycles.impulse, 'sum of impulses'), (cycles.I_n, 'impulse per impact'):
        curve = ChartCurve(turn, sums, words, form='steps')
        panels.append(Panel(x, Axis(words, 'N s', low=0.0), (curve,), height=SMALL))
    return Chart('cycles', f'impacts in {name}, turn by turn', tuple(panels), 'angle', name)


def _wear(name: str, bushing: WearMap, pin: WearMap) -> Chart:
    kept = [k for k in _SUMS if any(getattr(m, k).any() for m in (bushing, pin))] or ['impulse']
    found = [
        wear_chart(
            '', f'{part} on {wear.link}:\n{_SUMS[k][0]}', wear.edges, getattr(wear, k),
            _SUMS[k][1], name, 0,
        )
        for part, wear in (('bushing', bushing), ('pin', pin))
        for k in kept
    ]  # fmt: skip
    return joined(f'wear in {name}, by direction', found, len(kept))


def _deviation(name: str, beside: Beside, drive: str) -> Chart:
    own, ideal = beside.deviation.own, beside.deviation.ideal
    angle = np.degrees(own.angle)

    def last(turns: TurnSegments) -> Array:
        return turns.by_angle(turns.values[-1])

    curves = (
        ChartCurve(angle, last(own), 'the last turn', name),
        ChartCurve(angle, last(ideal), 'ideal machine', name, GROUND, look='ideal'),
    )
    panel = Panel(turn_of(drive), Axis(name.replace('_', ' '), beside.unit), curves[::-1])
    return Chart('deviation', f'{name} beside the ideal machine', (panel,), 'angle', name)
