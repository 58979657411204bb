"""Quantities over the angle of the drive, turn upon turn, or over time where it makes no turns."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import colour
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.pages.charts.course import Course, Window
from mechanism_sim.pages.charts.section import Chart
from mechanism_sim.pages.charts.style import brief, chart, dash, pale, places, written
from mechanism_sim.pages.charts.thinning import Line
from mechanism_sim.report.cycle import for_people
from mechanism_sim.units import typeset


@dataclass(frozen=True)
class Curve:
    """A quantity as it is drawn.

    Attributes
    ----------
    column : its name among the lines of a window
    label : in the legend
    number : of its colour
    """

    column: str
    label: str
    number: int


_SLACK = 1e-9  # [turns]
_ROUNDING = {'m': 1e-12, 'rad': 1e-12, 'N': 1e-9, 'N m': 1e-10}


def above_rounding(course: Course, curves: list[Curve], unit: str) -> bool:
    """Whether any of these quantities is more than zero but for rounding."""
    values = [course.run.lines[c.column].values for c in curves]
    return any(np.abs(x).max() > _ROUNDING.get(unit, 0.0) for x in values)


def axis_title(words: str, unit: str) -> str:
    """What is on an axis, with the unit in which people read it."""
    return f'{words} [{typeset(for_people(unit)[0])}]'.strip()


def over_drive(
    course: Course, key: str, title: str, curves: list[Curve], words: str, unit: str,
    joint: str = '',
) -> Chart:  # fmt: skip
    """Quantities in one unit over the angle of the drive in its last turns, their ideal beneath.

    Over time, and all over the run, if the drive makes no turns.
    """
    if course.turns is None:
        return over_time(course, key, title, curves, words, unit, joint)
    main = course.record.machine.main
    figure = chart(f'angle of the {main} [deg]', axis_title(words, unit))
    figure.update_xaxes(range=[0, 360], dtick=45)
    first, last = course.turns
    offsets: dict[str, float] = {}
    drawn = [c for c in curves if c.column in course.detail.lines]
    for c in drawn:
        line = course.detail.lines[c.column]
        at = course.record.turned(line.at)
        if unit == 'rad':
            start = float(line.values[np.searchsorted(at, last - 1.0 - _SLACK)])
            offsets[c.column] = start - TWO_PI * round(start / TWO_PI)
        for turn in _counted(first, last):
            _turn(figure, c, line, at, turn, unit, offsets.get(c.column), last)
    if course.ideal is not None:
        _add_ideal(figure, course.ideal, drawn, unit, offsets, last)
    _finish(figure, drawn)
    return Chart(key, title, written(figure), 'angle', joint)


def _counted(first: float, last: float) -> range:
    """The turns from angle zero on of which there is something between two places [turns]."""
    return range(math.floor(first + _SLACK), math.ceil(last - _SLACK))


def _turn(
    figure: go.Figure, c: Curve, line: Line, at: Array, turn: int, unit: str,
    offset: float | None, last: float,
) -> None:  # fmt: skip
    """One turn of a quantity, or the part that there is of it; faint if it is not the last."""
    newest = turn + 1 > last - 1.0 + _SLACK
    inside = (at >= turn - _SLACK) & (at <= turn + 1 + _SLACK)
    values = _wrapped(line.values[inside], offset)
    shown, scale = for_people(unit)
    figure.add_scatter(
        x=brief(360.0 * (at[inside] - turn)),
        y=brief(scale * values),
        customdata=places(line.at[inside]),
        mode='lines',
        name=c.label,
        legendgroup=c.column,
        showlegend=turn == _counted(turn, last)[-1],
        line={'color': colour(c.number), 'dash': dash(c.number), 'width': 1.5 if newest else 1.0},
        opacity=1.0 if newest else 0.45,
        hovertemplate=f'%{{x:.2f}} deg<br>%{{y:.5g}} {shown}<br>%{{customdata:.6f}} s',
    )


def _wrapped(values: Array, offset: float | None) -> Array:
    """Angles less the whole turns that bring their first one nearest to an offset [rad]."""
    if offset is None or not len(values):
        return values
    return np.asarray(values - TWO_PI * round((values[0] - offset) / TWO_PI))


def _add_ideal(
    figure: go.Figure, ideal: Window, drawn: list[Curve], unit: str,
    offsets: Mapping[str, float], last: float,
) -> None:  # fmt: skip
    scale = for_people(unit)[1]
    beneath = []
    known = [c for c in drawn if c.column in ideal.lines]
    for c, turn in product(known, _counted(last - 1.0, last)):
        line = ideal.lines[c.column]
        at = ideal.record.turned(line.at)
        inside = (at >= turn - _SLACK) & (at <= turn + 1 + _SLACK)
        x = 360.0 * (at[inside] - turn)
        values = _wrapped(line.values[inside], offsets.get(c.column))
        beneath.append(_ideal(c, brief(x), brief(scale * values)))
    _underlay(figure, beneath)


def _ideal(c: Curve, x: NDArray[Any], y: NDArray[Any]) -> go.Scatter:
    line = {'color': pale(colour(c.number)), 'width': 6}
    return go.Scatter(
        x=x, y=y, mode='lines', line=line, legendgroup=c.column, showlegend=False,
        hoverinfo='skip', name=f'{c.label}, ideal',
    )  # fmt: skip


def _underlay(figure: go.Figure, beneath: list[go.Scatter]) -> None:
    """Put traces under those that are there, with one entry in the legend."""
    if beneath:
        above = figure.data
        figure.data = ()
        figure.add_traces([*beneath, *above])
        figure.add_scatter(
            x=[None], y=[None], mode='lines', name='ideal machine', legendgroup='ideal machine',
            line={'color': 'rgba(90,100,110,0.3)', 'width': 6},
        )  # fmt: skip


def over_time(
    course: Course, key: str, title: str, curves: list[Curve], words: str, unit: str,
    joint: str = '', window: Window | None = None,
) -> Chart:  # fmt: skip
    """Quantities in one unit over time: of all the run, or of a window of it."""
    window = window or course.run
    shown, scale = for_people(unit)
    figure = chart('time [s]', axis_title(words, unit))
    figure.update_xaxes(range=[window.start, window.end])
    lines = {c: window.lines[c.column] for c in curves if c.column in window.lines}
    # in a long run each covers what is drawn before it: the largest come first
    drawn = sorted(lines, key=lambda c: -np.abs(lines[c].values).max())
    for c in drawn if window is course.run and course.long else lines:
        line = lines[c]
        figure.add_scatter(
            x=places(line.at),
            y=brief(scale * line.values),
            mode='lines',
            name=c.label,
            legendgroup=c.column,
            line={'color': colour(c.number), 'dash': dash(c.number), 'width': 1.2},
            hovertemplate=f'%{{x:.6f}} s<br>%{{y:.5g}} {shown}',
        )
    if course.turns is None and course.ideal is not None:
        known = [c for c in drawn if c.column in course.ideal.lines]
        beneath = [(c, course.ideal.lines[c.column]) for c in known]
        _underlay(
            figure,
            [_ideal(c, places(x.at), brief(scale * x.values)) for c, x in beneath],
        )
    _finish(figure, drawn)
    return Chart(key, title, written(figure), 'time', joint)


def _finish(figure: go.Figure, drawn: list[Curve]) -> None:
    figure.update_layout(height=290 + 9 * len(drawn))  # a legend of many takes its room
    if len(drawn) == 1 and len(figure.data) == 1:
        figure.update_layout(showlegend=False)
