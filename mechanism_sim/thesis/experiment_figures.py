"""The figures of [SB] chapters 7 and 8 from recorded runs, with their numbers there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import INK
from mechanism_sim.report.charts.chart import MARKERS, Axis, Chart, ChartCurve, Panel
from mechanism_sim.report.charts.lines import turn_of
from mechanism_sim.report.condition import rose_picture
from mechanism_sim.sensing.spectra import power
from mechanism_sim.thesis.experiment import (
    JOINT,
    CrankTurn,
    Experiment,
    Interval,
    Repeats,
    Trial,
    rpm,
)
from mechanism_sim.thesis.swing import LINKS
from mechanism_sim.units import written

# number of the colour, or colour, and number of the dashes
_STROKES: dict[str, tuple[int | str, int]] = {'measured': (3, 0), 'no clearance': (INK, 1)}
_LOOKS = dict.fromkeys(('simulated', 'simulated, modified', 'modified'), 'fine')
_ARROW = np.array([0.0, 1.0, 0.9 + 0.04j, np.nan, 1.0, 0.9 - 0.04j])
_DOMINANT, _LONGEST = 3, 0.26  # impacts, and the arrow of the largest, as a share of the frame


class _Row(NamedTuple):
    """A row of `CrankTurn.rows`."""

    place: int
    words: str
    unit: str


_ROWS = {
    ('acceleration', 'coupler'): _Row(0, 'angular acceleration of the coupler', 'rad/s^2'),
    ('acceleration', 'rocker'): _Row(1, 'angular acceleration of the rocker', 'rad/s^2'),
    ('velocity', 'coupler'): _Row(2, 'angular velocity of the coupler', 'rad/s'),
    ('velocity', 'rocker'): _Row(3, 'angular velocity of the rocker', 'rad/s'),
    ('force', 'x'): _Row(4, 'force in the loose bearing, x', 'N'),
    ('force', 'y'): _Row(5, 'force in the loose bearing, y', 'N'),
    ('torque', ''): _Row(6, 'torque of the crank', 'N m'),
}


def charts(found: Experiment) -> Iterator[Chart]:
    """The figures by key, as ``figure_7_09``; without those whose bags are missing."""
    for number, chart in _numbered(found):
        yield replace(chart, key=f'figure_{number}')


def _numbered(found: Experiment) -> Iterator[tuple[str, Chart]]:
    reference, speeds, clearances = found.reference.first, found.speeds, found.clearances
    density = power([reference.swings['coupler'].reading], reference.sample_rate)
    curve = ChartCurve(density.frequency[1:], density.values[1:])
    x = Axis('frequency', 'Hz', 0.0, float(density.frequency[-1]))
    panel = Panel(x, Axis('power density', '(m/s^2)^2/Hz', log=True), (curve,))
    title = f'sensor on the coupler, {reference.condition}'
    yield '7_08', Chart('7_08', title, (panel,), 'frequency')
    places = {place: group.first for place, group in found.measured.items()}
    for number, link, speed in zip(
        ('7_09', '7_12', '7_13', '7_14'),
        ('coupler', 'rocker', 'coupler', 'coupler'),
        (speeds[-1], speeds[-1], speeds[0], speeds[len(speeds) // 2]),
        strict=True,
    ):
        chosen = [places[speed, c] for c in clearances if (speed, c) in places]
        yield number, _measured(chosen, link, 'acceleration')
    for number, clearance in zip(
        ('7_15', '7_16', '7_17'), (clearances[-1], clearances[min(1, len(clearances) - 1)],
        clearances[0]), strict=True,
    ):  # fmt: skip
        chosen = [places[s, clearance] for s in speeds if (s, clearance) in places]
        yield number, _measured(chosen, 'coupler', 'acceleration')
    yield '7_10', _severity(found, 1, 1.0, 'clearance', 'm')
    yield '7_11', _severity(found, 0, 30.0 / math.pi, 'speed of the crank', 'rpm')
    half = min(found.bearings, key=_unlike_chapter_8).first
    shown = [(_ROWS['acceleration', 'coupler'], half.first.rows[0])]
    title = f'simulated: {half.condition}'
    yield '8_03', _beside_nominal(title, half.first, shown, 'with clearance')
    if found.assumed is not found.reference:
        simulated = found.assumed.first.first
        for number, quantity in (('8_01', 'velocity'), ('8_02', 'acceleration')):
            yield number, _superposed(found, simulated.rows, quantity, 'simulated')
        alpha = found.alpha().mean
        modified = simulated.modified(alpha)
        for number, quantity in (('8_04', 'acceleration'), ('8_06', 'velocity')):
            yield number, _superposed(found, modified, quantity, 'simulated, modified')
        shown = [(row, modified[row.place]) for row in list(_ROWS.values())[4:]]
        title = f'simulated, modified by alpha = {alpha:.3g}: {found.assumed.condition}'
        yield '8_08', _beside_nominal(title, simulated, shown, 'modified')
    yield '8_11', rose_picture(JOINT, reference.rose)
    if len(reference.rose):
        yield '8_12', _dominant(reference)


def _unlike_chapter_8(group: Repeats) -> tuple[float, float]:
    """Differences from the second bearing of [SB] 8: dry, restitution 0.5, no friction."""
    bearing = group.condition.bearing
    return bearing.viscosity + bearing.friction, abs(bearing.restitution - 0.5)


def _last_turn(trial: Trial, link: str) -> tuple[slice, Array]:
    """Samples of the last whole turn, and their crank angles [deg]."""
    sense = math.copysign(1.0, trial.condition.speed)
    angle = sense * trial.swings[link].angle
    begin = 360.0 * (math.floor(angle[-1] / 360.0 + 1e-3) - 1.0)
    chosen = slice(*np.searchsorted(angle, [begin, begin + 360.0]))
    travelled = angle[chosen] - begin
    return chosen, travelled if sense > 0.0 else 360.0 - travelled


def _measured(trials: Sequence[Trial], link: str, quantity: str) -> Chart:
    """[SB] 7.9 and 7.12 to 7.17: reconstructions of the thesis, and the ideal mechanism."""
    panels = []
    for trial in trials:
        swing = trial.swings[link]
        turn, angle = _last_turn(trial, link)
        panels.append(_panel(_ROWS[quantity, link], [
            ('measured', angle, swing.accelerations['thesis'].values[turn]),
            ('no clearance', angle, swing.nominal[0][turn]),
        ], str(trial.condition)))  # fmt: skip
    panels = [replace(p, scale='all') for p in panels]
    return Chart('', f'angular {quantity} of the {link}, measured', tuple(panels), 'angle')


def _panel(row: _Row, lines: Sequence[tuple[str, Array, Array]], title: str = '') -> Panel:
    """Lines over a turn of the crank, by label, above those of the ideal mechanism."""
    curves = [
        ChartCurve(x, y, label, '', *_STROKES.get(label, (0, 0)), look=_LOOKS.get(label, ''))
        for label, x, y in lines
    ]
    return Panel(turn_of('crank'), Axis(row.words, row.unit), tuple(curves), title)


def _severity(found: Experiment, over: int, scale: float, words: str, unit: str) -> Chart:
    """[SB] 7.10 and 7.11: over clearance (1) or speed (0), with a line per value of the other."""
    others = found.clearances if over == 0 else found.speeds
    reads: list[tuple[str, str, Callable[[Repeats], Interval]]] = [
        ('impulses a turn', 'N s', lambda x: x.impacts('impulse')),
        ('impacts a turn', '', lambda x: x.impacts('count')),
        ('impulse per impact', 'N s', lambda x: x.impacts('I_n')),
        ('deviation, coupler', 'rad/s^2', lambda x: x.shown()),
    ]
    panels: list[Panel] = []
    for label, of, read in reads:
        curves = []
        for k, other in enumerate(others):
            here = {at[over]: t for at, t in found.measured.items() if at[1 - over] == other}
            name = f'{rpm(other)} rpm' if over else written(other, 'm')
            y, half = np.array([read(group) for group in here.values()]).T
            curves.append(
                ChartCurve(
                    scale * np.array([*here]), y, '' if panels else name, '', k, k,
                    marker=MARKERS[k], error=half if np.isfinite(half).all() else None,
                )
            )  # fmt: skip
        panels.append(
            Panel(Axis(words, unit), Axis(label, of, low=0.0), tuple(curves), height=2.4)
        )
    return Chart('', str(found.bearing), tuple(panels), columns=4, width=11.0)


def _superposed(found: Experiment, rows: Array, quantity: str, name: str) -> Chart:
    """[SB] 8.1, 8.2 and 8.4 to 8.7: the assumed machine simulated, the other measured."""
    trial, first, panels = found.reference.first, found.assumed.first.first, []
    for link in LINKS:
        row = _ROWS[quantity, link]
        swing = trial.swings[link]
        turn, angle = _last_turn(trial, link)
        found_by = swing.accelerations if quantity == 'acceleration' else swing.velocities
        panels.append(_panel(row, [
            (name, first.angle, rows[row.place]),
            ('measured', angle, found_by['thesis'].values[turn]),
            ('no clearance', first.angle, first.nominal[row.place]),
        ]))  # fmt: skip
    title = f'measured: {trial.condition}; simulated: {found.assumed.condition}'
    return Chart('', title, tuple(panels), 'angle')


def _beside_nominal(
    title: str, cycle: CrankTurn, shown: Sequence[tuple[_Row, Array]], label: str
) -> Chart:
    """[SB] 8.3 and 8.8 to 8.10: rows of a cycle, and those of the ideal mechanism."""
    panels = [
        _panel(row, [(label, cycle.angle, values),
                     ('no clearance', cycle.angle, cycle.nominal[row.place])])
        for row, values in shown
    ]  # fmt: skip
    return Chart('', title, tuple(panels), 'angle')


def _dominant(trial: Trial) -> Chart:
    """[SB] 8.12: the mechanism at the largest impacts of a turn, and the impulse on its rocker."""
    rose, links, curves = trial.rose, trial.machine.nominal.linkage, []
    rows = [row[row >= 0] for row in trial.impacts.dominant if (row >= 0).any()]
    chosen = rows[-1][:_DOMINANT] if rows else rose.largest[:_DOMINANT]
    longest = rose.normal_impulse[chosen].max()
    for k, i in enumerate(chosen):
        th2 = rose.crank_angle[i : i + 1]
        th3, _ = links.positions(th2)
        crank = links.crank * np.exp(1j * th2[0])
        pin = crank + links.coupler * np.exp(1j * th3[0])
        bars = np.array([0.0, crank, pin, links.ground])
        impulse = written(rose.normal_impulse[i], 'N s', 3)
        label = f'Y{k + 1}: {impulse} at {math.degrees(th2[0]):.0f} deg'
        curves.append(ChartCurve(bars.real, bars.imag, label, '', k, k, marker='circle'))
        size = _LONGEST * links.ground * rose.normal_impulse[i] / longest
        arrow = pin + size * np.exp(1j * rose.in_world[i]) * _ARROW
        curves.append(ChartCurve(arrow.real, arrow.imag, colour=k, look='strong'))
    panel = Panel(Axis('x', 'm'), Axis('y', 'm'), tuple(curves), form='equal', height=3.6)
    return Chart('8_12', f'dominant impacts of a turn, {trial.condition}', (panel,), width=7.0)
