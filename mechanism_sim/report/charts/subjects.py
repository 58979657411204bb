"""All charts of a run, subject by subject; here those of loads, energy, parts and sensors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mechanism_sim.analysis.collectors import Signal
from mechanism_sim.analysis.details import ORDERS, Wanted, everything, find_details
from mechanism_sim.analysis.details import SignalSpectrum as Spectral
from mechanism_sim.analysis.published import PARTS
from mechanism_sim.analysis.record import Record
from mechanism_sim.analysis.series import Series
from mechanism_sim.analysis.summary import load_name, load_summary
from mechanism_sim.arrays import Array
from mechanism_sim.messages.part_states import kinds_of
from mechanism_sim.report.charts.chart import (
    SMALL,
    TIME,
    Axis,
    Chart,
    ChartCurve,
    ChartSection,
    Mark,
    Panel,
)
from mechanism_sim.report.charts.charted_run import ChartedRun, ChartWindow
from mechanism_sim.report.charts.curves import over_time, quantities
from mechanism_sim.report.charts.impacts import contacts, impacts
from mechanism_sim.report.charts.lines import OVER_TIME, panels
from mechanism_sim.report.charts.motion import drive, elastic, forces, guides, motion, over
from mechanism_sim.report.charts.thinning import SampledLine, thin, thinned
from mechanism_sim.report.summary import SHARE, facts, load_rows, peaks_of
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.ranges import LoadPeaks
from mechanism_sim.results.run import instants

_MARKED = 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000
_NUMBERED = 1, 10, 100, 1000
_FREQUENCY = Axis('frequency', 'Hz')
_DECADES = 1e-7  # below the highest line nothing is drawn
_BLOCK = 2**16  # instants at once
_MOST = 2**24  # instants besides the ends of steps
_TERMS = 'energy.kinetic', 'energy.potential', 'energy.drive_work', 'energy.dissipated'


def sections(record: Record, skip: int = 0) -> list[ChartSection]:
    """All that there is to see of a run, subject by subject; only what its machine has.

    However long the run, a line has no more than some 4,000 points; each keeps its extremes.

    Parameters
    ----------
    skip : whole turns of the main drive at the start that are left out
    """
    charted = ChartedRun(record, skip)
    found = (
        motion(charted),
        elastic(charted),
        loads(charted),
        forces(charted),
        drive(charted),
        contacts(charted),
        impacts(charted, skip),
        sensors(charted, skip),
        *parts(charted),
        guides(charted),
        energy(charted),
        solver(charted),
    )
    return [s for s in found if s and (s.charts or s.rows or s.table)]


def loads(charted: ChartedRun) -> ChartSection | None:
    """Largest force in each joint and torque of the drive, with durations."""
    record, run = charted.record, charted.run
    peaks = LoadPeaks(record.machine, charted.begin, shapes=True, bearings=True)
    peaks.add(record.piece.motion)

    def angle(t: float) -> float | None:
        return None if record.slides else float(record.angle(np.array([t]))[0]) % math.tau

    found = peaks.peaks()  # zero is said of the main drive alone, which is the first of drives
    machine = record.machine
    main = f'drive_torque.{machine.plan.main}'
    found = {name: peak for name, peak in found.items() if peak.value or name == main}
    known = load_summary(found, peaks.shapes(), angle, sliding=machine.physics.displacements)
    if known is None:
        return None
    levels: dict[str, float] = {}
    for name, peak in found.items():
        kind, of = load_name(name)
        line = kind if name == main else name
        if line in run.quantities:
            level = min(run.levels.reached(line, SHARE), abs(peak.value))
            drive = 'drive' if name == main else f'drive of {of}'
            levels.setdefault(drive if kind == 'drive_torque' else of, level)
    text = (
        'Forces and torques between impacts, without their impulses. The duration is the time '
        'around the largest value in which the load is above half of it, the impulse that of '
        'this time.'
    )
    notes = [f' {note}.' for note in peaks_of(known, levels)]
    table = tuple(load_rows(machine.plan.main, known, levels))
    return ChartSection('loads', 'Largest loads', text + ''.join(notes), (), table=table)


def parts(charted: ChartedRun) -> list[ChartSection]:
    """A section for each kind of parts that the machine has."""
    machine, known, found = charted.record.machine, charted.run.quantities, []
    for node, kind in kinds_of(machine).items():
        charts: list[Chart] = []
        for joint in kind.joints(machine):
            for title, fields in joint.charts.items():
                names = [f'{field}.{joint.name}' for field in fields]
                if not known.keys() >= set(names):
                    continue  # a force, where masses are not known
                key = f'{node}-{joint.name}-{next(iter(fields))}'.replace('_', '-')
                charts += quantities(charted, key, f'{joint.name}: {title}', names, joint.name)
        title = PARTS[kind.topic].title
        if charts:
            title = title[:1].upper() + title[1:]
            found.append(ChartSection(node.replace('_', '-'), title, over(charted), tuple(charts)))
    if machine.scene.oscillators:
        found.append(_oscillators(charted))
    return found


def _oscillators(charted: ChartedRun) -> ChartSection:
    charts = []
    for name in charted.record.machine.scene.oscillators:
        for title, fields in (
            ('displacement', 'xy'), ('force on the ground', ('force_x', 'force_y')),
        ):  # fmt: skip
            names = [f'oscillator.{name}.{field}' for field in fields]
            names = [x for x in names if np.any(charted.run.lines[x].values)]
            if not names:
                continue
            key = f'oscillator-{name}-{title.partition(" ")[0]}'
            charts += [
                over_time(charted, own, f'{name}: {title} over {when}', names, name, window)
                for window, when, own in charted.windows(key)
            ]
    text = (
        'Displacement of each frame from its static position, and force of its mounts on the '
        'ground without its weight.'
    )
    return ChartSection('oscillators', 'Frames on springs', text, tuple(charts))


def energy(charted: ChartedRun) -> ChartSection | None:
    """Kinetic and potential energy, work of the drives, what was dissipated, what is missing."""
    if not charted.record.machine.physics.has_forces:
        return None
    lines = balance(charted)
    terms = [
        Series.of_quantity(catalogue(charted.record.machine)[name], *lines[name])
        for name in _TERMS
    ]
    charts = [_chart(charted, 'energy', 'Energy balance', terms)]
    text = (
        'Kinetic and potential energy less the work of the drives plus the energy dissipated, '
        'less the work of loads,'
    )
    if np.isfinite(lines['missing'].values).all():
        missing = Series('missing', 'J', *lines['missing'])
        charts.append(_chart(charted, 'energy-missing', 'Error of the energy balance', [missing]))
        text += ' should keep its initial value; the difference is the error of integration.'
    else:
        text += (
            ' should keep its initial value. Which of several drives does the work of an impact '
            'is not recorded, so that this cannot be checked here.'
        )
    return ChartSection('energy', 'Energy', text, tuple(charts))


def balance(charted: ChartedRun) -> dict[str, SampledLine]:
    """Terms of the energy balance, and its residual ``missing`` [J], at and between steps."""
    record, window = charted.record, charted.run
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


def _chart(charted: ChartedRun, key: str, title: str, found: Sequence[Series]) -> Chart:
    axis = replace(TIME, low=charted.run.start, high=charted.run.end)
    known = [s for s in found if np.isfinite(s.values).all()]
    made = panels(known, OVER_TIME._replace(axis=axis), {})
    if len(known) == 1:
        made = [replace(panel, height=SMALL) for panel in made]
    return Chart(key, title, tuple(made), 'time')


def solver(charted: ChartedRun) -> ChartSection:
    """Steps, events, errors and digest of the run as a table."""
    rows = tuple((row.label, row.text) for row in facts(charted.record))
    text = (
        'Errors are evaluated on the final polynomials, independently of the solver. Runs with '
        'equal digests are identical bit by bit.'
    )
    return ChartSection('solver', 'Solver', text, (), rows)


def sensors(charted: ChartedRun, skip: int) -> ChartSection | None:
    """Signal, power spectral density, orders and envelope spectrum of every sensor."""
    record = charted.record
    names = record.sampled_sensors
    if not names:
        return None
    wanted = everything(record, Wanted(skip=skip))
    found = find_details(
        record, Wanted(wanted.spectra, wanted.orders, wanted.envelopes, skip=skip)
    )
    charts: list[Chart] = []
    for i, name in enumerate(names):
        signal = record.signal(name).since(charted.begin)
        for window, when, key in charted.windows(f'sensor-{name}'):
            charts.append(_signal(signal, window, i, f'{name} over {when}', key))
        if name in found.spectra:
            charts.append(density(name, found.spectra[name], found.drive_rate, i))
        if name in found.orders:
            charts.append(orders(name, found.orders[name], found.drive, i))
        if name in found.envelopes:
            charts.append(envelope(name, found.envelopes[name], found.drive_rate, i))
    text = 'What each sensor reads through its filter and converter.'
    if found.drive_rate:
        text += (
            f' Dotted lines mark orders: multiples of the {found.drive_rate:.5g} Hz at which the '
            f'{found.drive} turns.'
        )
    return ChartSection('sensors', 'Sensors', text, tuple(charts))


def _signal(signal: Signal, window: ChartWindow, number: int, title: str, key: str) -> Chart:
    parts: list[Array] = []
    for t, run in zip(signal.times, signal.runs, strict=True):
        inside = (t >= window.start) & (t <= window.end)
        if inside.any():
            parts += [np.full((2, 1), np.nan), np.array(thin(SampledLine(t[inside], run[inside])))]
    x, y = np.concatenate([*parts[1:], np.empty((2, 0))], axis=1)
    curve = ChartCurve(x, y, of=signal.sensor, colour=number)
    axis = replace(TIME, low=window.start, high=window.end)
    panel = Panel(axis, Axis(signal.quantity.replace('_', ' '), signal.unit), (curve,))
    return Chart(key, title, (panel,), 'time', signal.sensor)


def density(name: str, line: Spectral, rate: float | None, number: int = 0) -> Chart:
    """Power spectral density."""
    found, highest = line.spectrum, float(line.spectrum.values[1:].max(initial=0.0))
    shown = found.frequency > 0.0
    x, y = found.frequency[shown], found.values[shown]
    at, values = thin(SampledLine(np.log10(x), y), 2000)
    across = replace(_FREQUENCY, low=float(x[0]), high=float(x[-1]), log=True)
    up = Axis('power density', line.unit)
    if highest:
        up = replace(up, low=_DECADES * highest, high=3.0 * highest, log=True)
    curve = ChartCurve(10.0**at, values, of=name, colour=number)
    panel = Panel(across, up, (curve,), marks=_orders_at(rate, across))
    title = f'{name}: power spectral density'
    return Chart(f'sensor-{name}-density', title, (panel,), 'frequency', name)


def orders(name: str, line: Spectral, drive: str, number: int = 0) -> Chart:
    """Amplitudes by order of the drive."""
    axis = Axis(f'order of the {drive}', 'cycles per turn')
    panel = _amplitudes(name, line, 1.0, axis, number)
    return Chart(f'sensor-{name}-orders', f'{name}: orders', (panel,), 'frequency', name)


def envelope(name: str, line: Spectral, rate: float | None, number: int = 0) -> Chart:
    """The spectrum of the squared envelope in a band."""
    low, high = line.band or (0.0, 0.0)
    panel = _amplitudes(name, line, rate, _FREQUENCY, number)
    panel = replace(panel, marks=_orders_at(rate, panel.x))
    title = f'{name}: squared envelope from {low:.6g} Hz to {high:.6g} Hz'
    return Chart(f'sensor-{name}-envelope', title, (panel,), 'frequency', name)


def _amplitudes(name: str, line: Spectral, rate: float | None, axis: Axis, number: int) -> Panel:
    """A spectrum in which the first order lies at `rate`."""
    end, *shown = line.significant_part(rate)
    curve = ChartCurve(*thin(SampledLine(*shown)), of=name, colour=number)
    up = Axis('amplitude', line.unit, low=0.0)
    return Panel(replace(axis, low=0.0, high=end), up, (curve,))


def _orders_at(rate: float | None, axis: Axis) -> tuple[Mark, ...]:
    """Marks at orders of the drive within a range [Hz], with their numbers."""
    low, high = axis.low or 0.0, axis.high or 0.0
    fives = range(5, ORDERS + 1, 5)
    chosen, numbered = (_MARKED, _NUMBERED) if axis.log else ((1, 2, 3, 4, *fives), (1, *fives))
    return tuple(
        Mark(at, str(order) if order in numbered else '')
        for order in (chosen if rate else ())
        if low < (at := order * abs(rate or 0.0)) < high
    )
