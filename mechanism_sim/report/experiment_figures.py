"""The figures of [SB] chapters 7 and 8, made from recorded runs; each under its number there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import cycle as endless
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mechanism_sim.analysis.angular_reconstruction import LINKS
from mechanism_sim.analysis.experiment import JOINT, Cycle, Experiment, Trial
from mechanism_sim.arrays import Array
from mechanism_sim.report.condition import rose_picture
from mechanism_sim.report.figures import over_turn, titled
from mechanism_sim.sensing.spectra import power

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NOMINAL: dict[str, Any] = {'color': '0.05', 'lw': 1.5, 'ls': (0, (4, 1.5))}
_MEASURED: dict[str, Any] = {'color': '0.35', 'lw': 0.8}
_SIMULATED: dict[str, Any] = {'color': '0.65', 'lw': 0.7}
_LINES = ('o', '-'), ('s', '--'), ('^', '-.'), ('D', ':')
_DOMINANT = 3
_UNITS = {'acceleration': 'rad/s$^2$', 'velocity': 'rad/s'}


class _Row(NamedTuple):
    """A row of `Cycle.rows`."""

    place: int
    words: str
    unit: str


_ROWS = {
    ('acceleration', 'coupler'): _Row(0, 'angular acceleration of the coupler', 'rad/s$^2$'),
    ('acceleration', 'rocker'): _Row(1, 'angular acceleration of the rocker', 'rad/s$^2$'),
    ('velocity', 'coupler'): _Row(2, 'angular velocity of the coupler', 'rad/s'),
    ('velocity', 'rocker'): _Row(3, 'angular velocity of the rocker', 'rad/s'),
    ('force', 'x'): _Row(4, 'force in the loose bearing, x', 'N'),
    ('force', 'y'): _Row(5, 'force in the loose bearing, y', 'N'),
    ('torque', ''): _Row(6, 'torque of the crank', 'N m'),
}


def draw(found: Experiment) -> dict[str, Figure]:
    """The figures by name, as ``figure_7_09``; those that need bags that are missing are not."""
    return {f'figure_{number}': figure for number, figure in _figures(found)}


def _figures(found: Experiment) -> Iterator[tuple[str, Figure]]:
    reference, speeds, clearances = found.reference, found.speeds, found.clearances
    yield '7_08', _spectrum(reference)
    places = found.measured
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
    yield '7_10', _severity(found, 1, 1e3, 'clearance [mm]')
    yield '7_11', _severity(found, 0, 30.0 / math.pi, 'speed of the crank [rpm]')
    half = min(found.bearings, key=lambda x: abs(x.condition.restitution - 0.5))
    yield '8_03', _simulated(half)
    if found.assumed is not reference:
        simulated = found.assumed.first
        for number, quantity in (('8_01', 'velocity'), ('8_02', 'acceleration')):
            yield number, _superposed(found, simulated.rows, quantity, 'simulated')
        modified = simulated.modified(found.alpha)
        for number, quantity in (('8_04', 'acceleration'), ('8_06', 'velocity')):
            yield number, _superposed(found, modified, quantity, 'simulated, modified')
        yield '8_08', _forces(found, modified)
    yield '8_11', rose_picture(JOINT, reference.rose)
    if len(reference.rose):
        yield '8_12', _dominant(reference)


def _condition(trial: Trial) -> str:
    c = trial.condition
    return (
        f'{c.speed * 30.0 / math.pi:.0f} rpm, clearance {1e3 * c.radial:.4g} mm, '
        f'restitution {c.restitution:g}, friction {c.friction:g}'
    )


def _last_turn(trial: Trial, link: str) -> tuple[slice, Array]:
    """Samples of the last whole turn, and the crank's angle at them [deg]."""
    angle = trial.swings[link].angle
    begin = 360.0 * (math.floor(angle[-1] / 360.0 + 1e-3) - 1.0)
    chosen = slice(*np.searchsorted(angle, [begin, begin + 360.0]))
    return chosen, angle[chosen] - begin


def _spectrum(trial: Trial) -> Figure:
    """[SB] 7.8."""
    swing = trial.swings['coupler']
    found = power([swing.reading], trial.sample_rate)
    figure = titled(f'sensor on the coupler, {_condition(trial)}', height=3.2)
    axes = figure.subplots()
    axes.semilogy(found.frequency[1:], found.values[1:], color='0.1', lw=0.9)
    axes.set_xlim(0.0, found.frequency[-1])
    axes.set(xlabel='frequency [Hz]', ylabel='power spectral density [(m/s$^2$)$^2$/Hz]')
    return figure


def _measured(trials: Sequence[Trial], link: str, quantity: str) -> Figure:
    """[SB] 7.9 and 7.12 to 7.17: as the thesis reconstructs it, and the ideal mechanism."""
    figure = titled(f'angular {quantity} of the {link}, measured', 7.0, 0.4 + 2.1 * len(trials))
    panels = figure.subplots(len(trials), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, trial in zip(panels, trials, strict=True):
        swing = trial.swings[link]
        turn, angle = _last_turn(trial, link)
        axes.plot(angle, swing.accelerations['thesis'].values[turn], label='measured', **_MEASURED)
        axes.plot(angle, swing.nominal[0][turn], label='no clearance', **_NOMINAL)
        axes.set_title(_condition(trial), fontsize=8.0)
        axes.set_ylabel(f'[{_UNITS[quantity]}]')
    over_turn(panels[-1], 'crank')
    panels[0].set_xlabel('')
    panels[0].legend(frameon=False, fontsize=7.5, ncols=2)
    return figure


def _severity(found: Experiment, over: int, scale: float, words: str) -> Figure:
    """[SB] 7.10 and 7.11: over clearance (1) or speed (0), a line for each of the other."""
    figure = titled(f'restitution {found.bearing[0]:g}, friction {found.bearing[1]:g}', 11.0, 3.2)
    panels = figure.subplots(1, 4)
    others = found.clearances if over == 0 else found.speeds
    reads: list[tuple[str, Callable[[Trial], float]]] = [
        ('sum of impulses a turn [mN s]', lambda t: 1e3 * t.impacts.means['impulse'][0]),
        ('impacts a turn', lambda t: t.impacts.means['count'][0]),
        ('$I_n$ [mN s]', lambda t: 1e3 * t.impacts.means['I_n'][0]),
        ('deviation shown, coupler [rad/s$^2$]', lambda t: t.swings['coupler'].severity.heard),
    ]
    for axes, (label, read) in zip(panels, reads, strict=True):
        for k, (other, (marker, line)) in enumerate(zip(others, endless(_LINES))):
            here = {at[over]: t for at, t in found.measured.items() if at[1 - over] == other}
            shade = f'{0.6 * k / max(1, len(others) - 1):.2f}'
            name = f'{other * 30.0 / math.pi:.0f} rpm' if over else f'{1e3 * other:.4g} mm'
            axes.plot(
                [scale * x for x in here], [read(t) for t in here.values()], color=shade,
                marker=marker, ls=line, ms=4.0, lw=1.0, label=name,
            )  # fmt: skip
        axes.set(ylabel=label, xlabel=words)
        axes.set_ylim(bottom=0.0)
    handles = panels[0].get_legend_handles_labels()
    figure.legend(*handles, loc='outside lower center', ncols=4, frameon=False)
    return figure


def _superposed(found: Experiment, rows: Array, quantity: str, name: str) -> Figure:
    """[SB] 8.1, 8.2 and 8.4 to 8.7: the assumed machine simulated, the other measured."""
    trial = found.reference
    figure = titled(
        f'measured: {_condition(trial)}\nsimulated: {_condition(found.assumed)}', 7.0, 5.2
    )
    panels = figure.subplots(2, 1, sharex=True)
    for axes, link in zip(panels, LINKS, strict=True):
        row = _ROWS[quantity, link]
        swing = trial.swings[link]
        turn, angle = _last_turn(trial, link)
        found_by = swing.accelerations if quantity == 'acceleration' else swing.velocities
        axes.plot(found.assumed.first.angle, rows[row.place], label=name, **_SIMULATED)
        axes.plot(angle, found_by['thesis'].values[turn], label='measured', **_MEASURED)
        axes.plot(
            found.assumed.first.angle, found.assumed.first.nominal[row.place],
            label='no clearance', **_NOMINAL,
        )  # fmt: skip
        axes.set_ylabel(f'{row.words}\n[{row.unit}]', fontsize=8.0)
    over_turn(panels[-1], 'crank')
    panels[0].legend(frameon=False, fontsize=7.5, ncols=3)
    return figure


def _beside_nominal(
    title: str, height: float, cycle: Cycle, shown: Sequence[tuple[_Row, Array]], label: str
) -> Figure:
    """[SB] 8.3 and 8.8 to 8.10: rows of a cycle, and what the ideal mechanism has for them."""
    figure = titled(title, height=height)
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (row, values) in zip(panels, shown, strict=True):
        axes.plot(cycle.angle, values, label=label, **_MEASURED)
        axes.plot(cycle.angle, cycle.nominal[row.place], label='no clearance', **_NOMINAL)
        axes.set_ylabel(f'{row.words}\n[{row.unit}]', fontsize=8.0)
    over_turn(panels[-1], 'crank')
    panels[0].legend(frameon=False, fontsize=7.5, ncols=2)
    return figure


def _simulated(trial: Trial) -> Figure:
    cycle = trial.first
    shown = [(_ROWS['acceleration', 'coupler'], cycle.rows[0])]
    return _beside_nominal(f'simulated: {_condition(trial)}', 3.2, cycle, shown, 'with clearance')


def _forces(found: Experiment, modified: Array) -> Figure:
    title = f'simulated, modified by alpha = {found.alpha:.3g}: {_condition(found.assumed)}'
    shown = [(row, modified[row.place]) for row in list(_ROWS.values())[4:]]
    return _beside_nominal(title, 6.5, found.assumed.first, shown, 'modified')


def _dominant(trial: Trial) -> Figure:
    """[SB] 8.12: the mechanism at the largest impacts of a turn, and the impulse on its rocker."""
    rose, links = trial.rose, trial.machine.linkage
    rows = [row[row >= 0] for row in trial.impacts.dominant if (row >= 0).any()]
    chosen = rows[-1][:_DOMINANT] if rows else rose.largest[:_DOMINANT]
    figure = titled(f'dominant impacts of a turn, {_condition(trial)}', 7.0, 4.2)
    axes = figure.subplots()
    axes.set_aspect('equal')
    longest = rose.normal_impulse[chosen].max()
    for k, (i, (_, line)) in enumerate(zip(chosen, endless(_LINES))):
        th2 = rose.crank_angle[i : i + 1]
        th3, _ = links.positions(th2)
        crank = links.crank * np.array([np.cos(th2), np.sin(th2)])[:, 0]
        pin = crank + links.coupler * np.array([np.cos(th3), np.sin(th3)])[:, 0]
        bars = 1e3 * np.array([[0.0, 0.0], crank, pin, [links.ground, 0.0]])
        shade = f'{0.2 * k:.1f}'
        label = (
            f'$Y_{k + 1}$: {1e3 * rose.normal_impulse[i]:.3g} mN s '
            f'at {math.degrees(th2[0]):.0f} deg'
        )
        axes.plot(*bars.T, marker='o', ms=3.5, color=shade, ls=line, lw=1.1, label=label)
        size = 100.0 * rose.normal_impulse[i] / longest
        tip = 1e3 * pin + size * np.array([np.cos(rose.in_world[i]), np.sin(rose.in_world[i])])
        axes.annotate(
            '', tuple(tip), tuple(1e3 * pin), arrowprops={'arrowstyle': '-|>', 'color': shade}
        )
        axes.update_datalim([tuple(tip)])  # annotations do not count by themselves
    axes.legend(frameon=False, fontsize=7.5, loc='upper left')
    axes.set(xlabel='x [mm]', ylabel='y [mm]')
    axes.margins(0.08)
    return figure
