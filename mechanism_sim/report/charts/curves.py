"""Quantities over the angle of the drive, turn upon turn, or over time where it makes no turns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from mechanism_sim.analysis.series import Series
from mechanism_sim.arrays import Array
from mechanism_sim.report.charts.chart import Chart, Over
from mechanism_sim.report.charts.course import Course, Window
from mechanism_sim.report.charts.lines import OVER_TIME, Abscissa, Drawn, columns, panels


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


_ROUNDING = {'m': 1e-12, 'rad': 1e-12, 'N': 1e-9, 'N m': 1e-10}


def quantities(
    course: Course, key: str, title: str, curves: list[Curve], words: str, unit: str,
    joint: str = '', run: bool = False,
) -> list[Chart]:  # fmt: skip
    """Quantities in one unit over the drive, and over a long run; none if all are rounding."""
    values = [course.run.lines[c.column].values for c in curves]
    if not any(np.abs(x).max() > _ROUNDING.get(unit, 0.0) for x in values):
        return []
    found = [over_drive(course, key, title, curves, words, unit, joint)]
    if run and course.turns and course.long:
        title = f'{title} over the whole run'
        found.append(over_time(course, f'{key}-run', title, curves, words, unit, joint))
    return found


def over_drive(
    course: Course, key: str, title: str, curves: list[Curve], words: str, unit: str,
    joint: str = '',
) -> Chart:  # fmt: skip
    """Quantities in one unit over the angle of the drive in its last turns, their ideal beneath.

    Over time, and all over the run, if the drive makes no turns.
    """
    return _chart(course, key, title, curves, words, unit, joint, course.detail, course.over)


def over_time(
    course: Course, key: str, title: str, curves: list[Curve], words: str, unit: str,
    joint: str = '', window: Window | None = None,
) -> Chart:  # fmt: skip
    """Quantities in one unit over time: of all the run, or of a window of it."""
    window = window or course.run
    if window is course.run and course.long:
        # in a long run each covers what is drawn before it: the largest come first
        lines = window.lines
        known = [c for c in curves if c.column in lines]
        curves = sorted(known, key=lambda c: -np.abs(lines[c.column].values).max())
    return _chart(course, key, title, curves, words, unit, joint, window, OVER_TIME)


def _chart(
    course: Course, key: str, title: str, curves: list[Curve], words: str, unit: str, joint: str,
    window: Window, over: Abscissa,
) -> Chart:  # fmt: skip
    found = list(_drawn(window, curves, unit, course.run.reach if over.turns else {}))
    if over.turns == bool(course.turns) and course.ideal is not None:
        found += _drawn(course.ideal, curves, unit, {}, ideal=True)
    inside = (course.struck >= window.start) & (course.struck <= window.end)
    if not over.turns:
        over = over._replace(axis=replace(over.axis, low=window.start, high=window.end))
    made = panels(found, over, words, unit, course.struck[inside])
    axis: Over = 'angle' if over.turns else 'time'
    return Chart(key, title, tuple(made), axis, joint, columns(made))


def _drawn(
    window: Window, curves: list[Curve], unit: str, reach: Mapping[str, Array],
    ideal: bool = False,
) -> Iterator[Drawn]:  # fmt: skip
    for c in curves:
        if c.column in window.lines:
            s = Series(c.column, unit, *window.lines[c.column], ideal=ideal)
            yield Drawn(s, c.label, c.number, reach=reach.get(c.column))
