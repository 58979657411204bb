"""The energy balance of a run, and what its solver did."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mechanism_sim.analysis.record import Record
from mechanism_sim.arrays import Array
from mechanism_sim.report.charts.chart import (
    PANEL,
    SMALL,
    TIME,
    Axis,
    Chart,
    Curve,
    Panel,
    Section,
)
from mechanism_sim.report.charts.course import Course
from mechanism_sim.report.charts.thinning import Line, thinned
from mechanism_sim.report.facts import facts

_BLOCK = 2**16  # instants at once
_TERMS = 'kinetic', 'potential', 'drive_work', 'dissipated'


def energy(course: Course) -> Section | None:
    """Kinetic and potential energy, work of the drives, what was dissipated, what is missing."""
    if not course.record.machine.physics.has_forces:
        return None
    lines = balance(course)
    charts = [_chart(course, 'energy', 'Energy balance', 'energy', {n: lines[n] for n in _TERMS})]
    text = 'Kinetic and potential energy, less what the drives put in, plus what is dissipated'
    if np.isfinite(lines['missing'].values).all():
        missing = {'missing': lines['missing']}
        title = 'What is missing in them'
        charts.append(_chart(course, 'energy-missing', title, 'missing', missing))
        text += ', should stay what it was at the start; what is missing is error of integration.'
    else:
        text += (
            ', should stay what it was at the start. Which of several drives did the work of an '
            'impact is not recorded, so that this cannot be checked here.'
        )
    return Section('energy', 'Energy', text, tuple(charts))


def balance(course: Course) -> dict[str, Line]:
    """Terms of the energy balance, and its residual ``missing`` [J], at and between steps."""
    record, window = course.record, course.run
    curve = record.piece.motion.curve
    first = int(curve.locate(np.array([window.start]))[0])
    steps = np.maximum(curve.start[first:], window.start)
    marks = np.union1d(steps, np.arange(window.start, window.end, window.longest))
    marks = np.append(marks, window.end)
    beginning = _terms(record, np.array([record.start]))[:, 0]

    def blocks() -> Iterator[tuple[Array, Array]]:
        for k in range(0, len(marks), _BLOCK):
            t = marks[k : k + _BLOCK]
            terms = _terms(record, t)
            # term by term: large energies do not hide small changes
            kinetic, potential, work, dissipated = terms - beginning[:, None]
            yield t, np.vstack([terms, kinetic + potential - work + dissipated])

    found = thinned(blocks(), len(marks), (window.start, window.end))
    return dict(zip((*_TERMS, 'missing'), found, strict=True))


def _terms(record: Record, t: Array) -> Array:
    s = record.piece.view(t)
    o = s.observed
    return np.array([o.kinetic_energy, o.potential_energy, s.drive_work, s.dissipated])


def _chart(course: Course, key: str, title: str, words: str, lines: dict[str, Line]) -> Chart:
    curves = tuple(
        Curve(*line, name.replace('_', ' '), colour=i)
        for i, (name, line) in enumerate(lines.items())
        if np.isfinite(line.values).all()
    )
    x = replace(TIME, low=course.run.start, high=course.run.end)
    height = PANEL if len(curves) > 1 else SMALL
    return Chart(key, title, (Panel(x, Axis(words, 'J'), curves, height=height),), 'time')


def solver(course: Course) -> Section:
    """Steps, events, errors and digest of the run as a table."""
    rows = tuple(facts(course.record))
    text = (
        'Errors are read from the finished polynomials, independently of the loop that made them. '
        'Runs with equal digests are equal bit by bit.'
    )
    return Section('solver', 'Solver', text, (), rows)
