"""The energy balance of a run, and what its solver did."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mechanism_sim.analysis.record import Record
from mechanism_sim.analysis.series import Series
from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.audit import Audit
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.recording import realtime_factor
from mechanism_sim.report.charts.chart import SMALL, TIME, Chart, Section
from mechanism_sim.report.charts.course import Course
from mechanism_sim.report.charts.lines import OVER_TIME, panels
from mechanism_sim.report.charts.thinning import Line, thinned
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.solution import Solution

_BLOCK = 2**16  # instants at once
_TERMS = 'energy.kinetic', 'energy.potential', 'energy.drive_work', 'energy.dissipated'


def energy(course: Course) -> Section | None:
    """Kinetic and potential energy, work of the drives, what was dissipated, what is missing."""
    if not course.record.machine.physics.has_forces:
        return None
    lines = balance(course)
    terms = [
        Series.of_quantity(catalogue(course.record.machine)[name], *lines[name]) for name in _TERMS
    ]
    charts = [_chart(course, 'energy', 'Energy balance', terms)]
    text = 'Kinetic and potential energy, less what the drives put in, plus what is dissipated'
    if np.isfinite(lines['missing'].values).all():
        missing = Series('missing', 'J', *lines['missing'])
        charts.append(_chart(course, 'energy-missing', 'What is missing in them', [missing]))
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
    found = catalogue(record.machine).columns(_TERMS, record.piece.view(t))
    return np.array([*found.values()])


def _chart(course: Course, key: str, title: str, found: Sequence[Series]) -> Chart:
    axis = replace(TIME, low=course.run.start, high=course.run.end)
    known = [s for s in found if np.isfinite(s.values).all()]
    made = panels(known, OVER_TIME._replace(axis=axis), {})
    if len(known) == 1:
        made = [replace(panel, height=SMALL) for panel in made]
    return Chart(key, title, tuple(made), 'time')


def solver(course: Course) -> Section:
    """Steps, events, errors and digest of the run as a table."""
    rows = tuple(_rows(course.record))
    text = (
        'Errors are read from the finished polynomials, independently of the loop that made them. '
        'Runs with equal digests are equal bit by bit.'
    )
    return Section('solver', 'Solver', text, (), rows)


def _rows(record: Record) -> Iterator[tuple[str, str]]:
    machine, piece = record.machine, record.piece
    tolerances = machine.scene.solver
    steps, span = len(piece.motion), record.end - record.start
    yield 'level of mechanics', machine.level.value
    yield 'relative tolerance', f'{tolerances.rtol:g}'
    yield 'absolute tolerance', f'{tolerances.atol:g}'
    yield 'simulated time', f'{span:.9g} s'
    if record.has_turns:
        yield f'turns of the {machine.main}', f'{abs(record.rate) * span:.6g}'
    yield 'steps', f'{steps:,}'
    yield 'mean step', f'{span / steps:.4g} s'
    yield 'shortest step', f'{piece.motion.curve.duration.min():.4g} s'
    yield 'impacts', f'{len(piece.impacts):,}'
    entered = Counter(c.mode for c in piece.modes if c.previous != Mode.UNKNOWN)
    for mode, count in sorted(entered.items()):
        yield f'changes to {mode.name.lower().replace("_", " ")}', f'{count:,}'
    yield from _errors(record)
    if isinstance(piece, Solution):
        stats = piece.stats
        yield 'compilation', f'{stats.compile_time:.3g} s'
        yield 'CPU time', f'{stats.cpu_time:.3g} s'
        if stats.wall_time:
            yield 'real-time factor', f'{realtime_factor(span, stats.wall_time):.3g}'
    if factor := realtime_factor(span, record.wall_time):
        yield 'recorded in', f'{record.wall_time:.3g} s'
        yield 'real-time factor', f'{factor:.3g}'
    yield 'digest', record.digest()


def _errors(record: Record) -> Iterator[tuple[str, str]]:
    audit = record.audit or Audit(record.machine.physics)
    if record.audit is None:
        audit.add(record.piece.motion, record.piece.impacts)
    if record.machine.physics.clearances:
        yield 'largest penetration of an open gap', f'{audit.max_penetration:.3g} m'
    yield 'largest error of a closure', f'{audit.max_closure_error:.3g} m'
    if audit.energy and np.isfinite(audit.energy.residual):
        e = audit.energy
        yield 'energy missing at the end', f'{e.residual:.3g} J'
        yield 'energy exchanged', f'{e.exchanged:.3g} J'
        yield 'error of works, estimated', f'{e.error:.2g} J'
