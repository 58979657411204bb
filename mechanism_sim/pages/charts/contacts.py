"""Loose joints: their gaps, and when they follow, fly, stick and slide."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import LINKS, colour
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.pages.charts.course import Course, Window
from mechanism_sim.pages.charts.section import Chart, Section
from mechanism_sim.pages.charts.style import MODES, MUTED, brief, chart, dash, places, written
from mechanism_sim.planar.play import joint_of_gap

_SINGLE = 400  # spells of one mode that are drawn one by one
_SHARES = 400  # bins of which the shares of modes are drawn if there are more
_SHUT = 1e-12  # [m], never opened
_BAND = 0.13  # height of the band of modes


def contacts(course: Course) -> Section | None:
    """Gap and mode of every joint with clearance."""
    gaps = gaps_of(course)
    if not gaps:
        return None
    charts = []
    for joint, names in gaps.items():
        if course.long:
            title = f'{joint}: gap over the last turns'
            charts.append(_chart(course, course.detail, joint, names, title, f'gap-{joint}'))
        title, key = f'{joint}: gap over the whole run', f'gap-{joint}-run'
        charts.append(_chart(course, course.run, joint, names, title, key))
    text = (
        'The gap is zero while the contact is closed. The band below says in which mode it is; '
        'where spells are too short to be told apart, it says which share of the time each mode '
        'has.'
    )
    return Section('contact', 'Contact', text, tuple(charts))


def gaps_of(course: Course) -> dict[str, list[str]]:
    """The gaps of each loose joint: of one with two walls there are two."""
    machine = course.record.machine
    found: dict[str, list[str]] = {}
    for name in machine.physics.clearances:
        found.setdefault(joint_of_gap(machine.mechanism, name).name, []).append(name)
    return found


def _chart(
    course: Course, window: Window, joint: str, names: list[str], title: str, key: str
) -> Chart:
    figure = chart('time [s]', 'gap [mm]', height=300 + 60 * (len(names) - 1))
    figure.update_xaxes(range=[window.start, window.end], anchor=f'y{len(names) + 1}')
    low = _BAND * len(names)
    figure.update_layout(yaxis_domain=[low + 0.05, 1.0], yaxis_rangemode='tozero')
    if max(np.abs(window.lines[f'gap.{name}'].values).max() for name in names) < _SHUT:
        figure.update_layout(yaxis_range=[0.0, 1e-3])  # do not make a picture of rounding
    number = course.record.machine.physics.joints.index(joint)
    for i, name in enumerate(names):
        line = window.lines[f'gap.{name}']
        figure.add_scatter(
            x=places(line.at), y=brief(1e3 * line.values), mode='lines', name=f'gap {name}',
            line={'color': colour(number), 'dash': dash(len(LINKS) * i), 'width': 1.2},
            hovertemplate='%{x:.6f} s<br>%{y:.5g} mm', showlegend=len(names) > 1,
        )  # fmt: skip
    for i, name in enumerate(names):
        axis = f'y{i + 2}'
        bottom = low - _BAND * (i + 1)
        figure.update_layout({
            f'yaxis{i + 2}': {
                'domain': [bottom + 0.01, bottom + _BAND], 'range': [0, 1], 'visible': False,
                'fixedrange': True, 'anchor': 'x',
            }
        })  # fmt: skip
        if len(names) > 1:
            figure.add_annotation(
                x=0.0, xref='paper', xanchor='right', xshift=-6, y=0.5, yref=axis, showarrow=False,
                text=name.removeprefix(joint)[1:], font={'size': 10, 'color': MUTED},
            )  # fmt: skip
        gap = course.record.machine.physics.clearances.index(name)
        add_band(figure, spells(window, gap), axis, first=not i)
    return Chart(key, title, written(figure), 'time', joint)


@dataclass(frozen=True)
class Spells:
    """Times (k + 1,) [s] at which one mode follows another, and the modes (k,) between them."""

    marks: Array
    modes: NDArray[np.uint8]


def spells(window: Window, gap: int) -> Spells:
    """The modes of a gap in a window, exact to the last digit: steps end where modes change."""
    motion = window.record.piece.motion
    first, last = motion.curve.locate(np.array([window.start, window.end]))
    modes = motion.modes[first : last + 1, gap]
    new = np.flatnonzero(np.diff(modes.astype(int), prepend=-1))
    starts = np.maximum(motion.curve.start[first : last + 1][new], window.start)
    return Spells(np.append(starts, window.end), modes[new])


def shares(found: Spells, edges: Array) -> dict[int, Array]:
    """Share of the time between edges (n + 1,) [s] that each mode has, (n,) by its number."""
    lasted = np.diff(found.marks)
    shared = {}
    for mode in np.unique(found.modes).tolist():
        passed = np.append(0.0, np.cumsum(np.where(found.modes == mode, lasted, 0.0)))
        shared[mode] = np.diff(np.interp(edges, found.marks, passed)) / np.diff(edges)
    return shared


def add_band(
    figure: go.Figure, found: Spells, axis: str, first: bool = True,
    words: Mapping[int, tuple[str, str]] = MODES,
) -> None:  # fmt: skip
    """Draw modes as a band: one by one, or as shares of the time if there are too many."""
    single = len(found.modes) <= _SINGLE
    for mode, x, y in _blocks(found) if single else _stacked(found):
        name, shade = words.get(mode, (f'mode {mode}', '#dfe3e8'))
        figure.add_scatter(
            x=places(x), y=brief(y), yaxis=axis, mode='lines', fill='toself', fillcolor=shade,
            line={'width': 0.6 if single else 0.0, 'color': shade}, hoverinfo='name',
            hoveron='fills', name=name, legendgroup=name, showlegend=first,
        )  # fmt: skip


def _flight_last(mode: int) -> tuple[bool, int]:
    return mode == Mode.FREE_FLIGHT, mode


def _blocks(found: Spells) -> Iterator[tuple[int, Array, Array]]:
    for mode in sorted(np.unique(found.modes).tolist(), key=_flight_last):
        own = found.modes == mode
        start, end = found.marks[:-1][own], found.marks[1:][own]
        x = np.array([start, start, end, end, np.full(len(start), np.nan)]).T.ravel()
        y = np.tile([0.0, 1.0, 1.0, 0.0, np.nan], len(start))
        yield mode, x[:-1], y[:-1]


def _stacked(found: Spells) -> Iterator[tuple[int, Array, Array]]:
    edges = np.linspace(found.marks[0], found.marks[-1], _SHARES + 1)
    below = np.zeros(_SHARES)
    shared = shares(found, edges)
    for mode in sorted(shared, key=_flight_last):
        above = below + shared[mode]
        steps = np.repeat(edges, 2)[1:-1]
        x = np.concatenate([steps, steps[::-1]])
        y = np.concatenate([np.repeat(above, 2), np.repeat(below, 2)[::-1]])
        yield mode, x, y
        below = above
