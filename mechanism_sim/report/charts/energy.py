"""The energy balance of a run, and what its solver did."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mechanism_sim.analysis.record import Record
from mechanism_sim.analysis.series import Series
from mechanism_sim.arrays import Array
from mechanism_sim.report.charts.chart import SMALL, TIME, Chart, ChartSection
from mechanism_sim.report.charts.course import ChartedRun
from mechanism_sim.report.charts.lines import OVER_TIME, panels
from mechanism_sim.report.charts.thinning import SampledLine, thinned
from mechanism_sim.report.summary import facts
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.instants import instants

_BLOCK = 2**16  # instants at once
_MOST = 2**24  # instants beside those where steps meet
_TERMS = 'energy.kinetic', 'energy.potential', 'energy.drive_work', 'energy.dissipated'


def energy(course: ChartedRun) -> ChartSection | None:
    """Kinetic and potential energy, work of the drives, what was dissipated, what is missing."""
    if not course.record.machine.physics.has_forces:
        return None
    lines = balance(course)
    terms = [
        Series.of_quantity(catalogue(course.record.machine)[name], *lines[name]) for name in _TERMS
    ]
    charts = [_chart(course, 'energy', 'Energy balance', terms)]
    text = 'Kinetic and potential energy less the work of the drives plus the dissipated energy'
    if np.isfinite(lines['missing'].values).all():
        missing = Series('missing', 'J', *lines['missing'])
        charts.append(_chart(course, 'energy-missing', 'Error of the energy balance', [missing]))
        text += ' should keep its initial value; the difference is the error of integration.'
    else:
        text += (
            ' should keep its initial value. Which of several drives does the work of an impact '
            'is not recorded, so that this cannot be checked here.'
        )
    return ChartSection('energy', 'Energy', text, tuple(charts))


def balance(course: ChartedRun) -> dict[str, SampledLine]:
    """Terms of the energy balance, and its residual ``missing`` [J], at and between steps."""
    record, window = course.record, course.run
    marks = instants(
        record.piece, window.start, window.end, 1.0 / window.longest, 2, _MOST, 0, steps=True
    )
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
    found = catalogue(record.machine).columns(_TERMS, record.piece.view(t))
    return np.array([*found.values()])


def _chart(course: ChartedRun, key: str, title: str, found: Sequence[Series]) -> Chart:
    axis = replace(TIME, low=course.run.start, high=course.run.end)
    known = [s for s in found if np.isfinite(s.values).all()]
    made = panels(known, OVER_TIME._replace(axis=axis), {})
    if len(known) == 1:
        made = [replace(panel, height=SMALL) for panel in made]
    return Chart(key, title, tuple(made), 'time')


def solver(course: ChartedRun) -> ChartSection:
    """Steps, events, errors and digest of the run as a table."""
    rows = tuple((row.label, row.text) for row in facts(course.record))
    text = (
        'Errors are evaluated on the final polynomials, independently of the solver. Runs with '
        'equal digests are identical bit by bit.'
    )
    return ChartSection('solver', 'Solver', text, (), rows)
