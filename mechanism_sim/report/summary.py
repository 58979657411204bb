"""Summary of a run: rows for terminal, notebook and page, and the JSON others build on."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from mechanism_sim.engine.audit import Audit
from mechanism_sim.engine.events import Impact, Mode, ModeChange, StopReason
from mechanism_sim.engine.physics import is_force_open
from mechanism_sim.engine.totals import Totals
from mechanism_sim.planar.inverse_dynamics import NoLimit
from mechanism_sim.recording.runs import realtime_factor
from mechanism_sim.report.sections import Section, SummaryRow, amount
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.quantities.motion import RATES
from mechanism_sim.results.quantity import Shown
from mechanism_sim.results.run import Solution, Stats
from mechanism_sim.results.simulate import Stream
from mechanism_sim.results.turns import ImpactAccumulator, Mean
from mechanism_sim.scene import Machine
from mechanism_sim.strict_json import plain
from mechanism_sim.units import counted, for_people, instant, written

if TYPE_CHECKING:
    from mechanism_sim.analysis.record import Record
    from mechanism_sim.analysis.summary import LoadPeak, LoadSummary

SHARE = 0.999
"""Share of the time for the load not exceeded, which stands beside the largest one."""

_BRIEF = 1.5  # times the load of that share: what is larger is a peak
_SENTENCES = 4  # number of sentences of a kind
_ROUNDING = 1e-12  # share of the greatest of its kind, as for a cycle
_COMPLIANCE = 'deflection', 'stress', 'bearing_moment', 'axial_force'

_IMPACT_KEYS = (
    't',
    'joint',
    'normal_impulse',
    'tangential_impulse',
    'approach_speed',
    'rebound_speed',
    'normal_angle',
    'energy_loss',
    'drive_impulse',
    'ends_chatter',
    'duration',
    'peak_force',
)
_TOTALS_KEYS = 'losses_of_contact', 'normal_impulse', 'largest_impulse'
_ENERGY_KEYS = 'initial', 'final', 'drive_work', 'dissipated', 'residual', 'error', 'exchanged'


def to_json(
    run: Stream,
    digest: str,
    turns: ImpactAccumulator,
    impacts: list[Impact] | None,
    modes: list[ModeChange] | None,
) -> dict[str, object]:
    """The result of `solve --json`: SI units throughout; without events, only their counts.

    Per revolution there are the means over the whole ones, null if there are less than two.
    """
    stats, energy, totals = run.stats, run.energy, run.totals
    events: dict[str, object] = {}
    if impacts is not None:
        events['impacts'] = [{k: getattr(i, k) for k in _IMPACT_KEYS} for i in impacts]
    if modes is not None:
        events['modes'] = [
            {'t': c.t, 'joint': c.joint, 'mode': c.mode.name.lower()} for c in modes
        ]
    if not turns.means:
        per_revolution = None
    else:
        per_revolution = {'revolutions': turns.means[0].revolutions} | {
            m.name: {'mean': plain(m.mean), 'half_width': plain(m.half_width)} for m in turns.means
        }
    return {
        'scene': run.machine.name,
        'level': run.machine.level.value,
        'duration': run.duration,
        **asdict(stats),
        'stop_reason': StopReason.COMPLETE.value,
        'coordinates': list(run.machine.physics.coordinates),
        'final': _final(run),
        'impact_count': totals.impacts,
        'mode_change_count': totals.mode_changes,
        **{key: getattr(totals, key) for key in _TOTALS_KEYS},
        'per_revolution': per_revolution,
        **events,
        'no_limits': no_limits_to_json(run.no_limits),
        **undetermined_to_json(run.machine),
        'max_penetration': run.max_penetration,
        'max_closure_error': run.max_closure_error,
        'energy': energy and {k: getattr(energy, k) for k in _ENERGY_KEYS},
        'digest': digest,
    }


def no_limits_to_json(found: list[NoLimit]) -> list[dict[str, object]]:
    """The instants at which forces have no limit."""
    return [
        {'t': x.t, 'drive': x.drive, 'joints': list(x.joints), 'loads': list(x.loads)}
        for x in found
    ]


def undetermined_to_json(machine: Machine) -> dict[str, list[str]]:
    """Forces that redundant constraints leave open, if any."""
    open_ = machine.physics.undetermined
    return {'undetermined': machine.nominal.undetermined_names} if open_ else {}


def describe_no_limits(machine: Machine, found: list[NoLimit]) -> Iterator[str]:
    """A sentence for each instant at which forces have no limit, of many for the first ones.

    Before them one for each joint whose motion leaves the run without forces.
    """
    if machine.physics.undetermined:
        yield machine.nominal.undetermined_text
    for joint, why in machine.without_forces.items():
        yield f'{joint}: {why}; this run is kinematics, forces are left out'
    for x in found[:_SENTENCES]:
        slides = machine.plan.main in machine.mechanism.displacements
        angle = round(math.degrees(x.drive), 6) % 360.0
        place = written(x.drive, 'm', 6) if slides else f'{angle:.6g} deg'
        why = 'tend to infinity'
        if x.rests:
            why = 'are not determined while the drive rests'
        if x.loads:
            forces = f', nor are the forces in {", ".join(x.joints)}' if x.joints else ''
            since, work = (
                ('from', 'does no work for a while') if x.rests else ('at', 'does no work')
            )
            yield (
                f'{since} {machine.plan.main} = {place}, t = {x.t:.9g} s, the unknown '
                f'{" or ".join(x.loads)} {work}: its size is not determined{forces}; '
                'they are left out'
            )
            continue
        yield (
            f'at {machine.plan.main} = {place}, t = {x.t:.9g} s, a singular position, the forces '
            f'in {", ".join(x.joints)} {why}; they are left out'
        )
    if len(found) > _SENTENCES:
        yield f'and at {len(found) - _SENTENCES} more such instants'


def _final(run: Stream) -> dict[str, Any]:
    physics = run.machine.physics
    o = run.final.observed

    def by_name(rows: np.ndarray) -> dict[str, float]:
        return {c: float(row[0]) for c, row in zip(physics.coordinates, rows, strict=True)}

    final: dict[str, Any] = {
        't': run.duration,
        'position': by_name(o.position),
        'velocity': by_name(o.velocity),
        'acceleration': by_name(o.acceleration),
    }
    if states := run.machine.plan.states:
        values = run.final.states()[:, 0].tolist()
        final['states'] = {x.label: z for x, z in zip(states, values, strict=True)}
    others: dict[str, dict[str, float]] = {}
    for quantity in catalogue(run.machine).values():
        if quantity.shown is Shown.RUN and quantity.kind in _COMPLIANCE:
            _, _, link = quantity.name.partition('.')
            others.setdefault(quantity.kind, {})[link] = float(quantity.evaluate(run.final)[0])
    final |= others
    if physics.has_forces:
        open_ = physics.undetermined
        final['reactions'] = {
            joint: plain(force[:, 0].tolist())
            for joint, force in zip(physics.joints, o.reaction, strict=True)
            if not is_force_open(open_, joint)
        }
        moments = zip(physics.joints, o.reaction_moment[:, 0].tolist(), strict=True)
        final['reaction_moments'] = {
            joint: plain(m)
            for joint, m in moments
            if m and 'moment' not in open_.get(joint, frozenset())
        }
        final['drive_torque'] = plain(float(o.drive_torque[run.machine.drive.row, 0]))
        torques = zip(physics.driven, o.drive_torque[:, 0].tolist(), strict=True)
        final['drive_torques'] = plain(dict(torques))
        loads = zip(physics.unknowns, o.load[:, 0].tolist(), strict=True)
        final['loads'] = plain(dict(loads))
    return final


def impact_rows(
    count: int, impulse: float, means: Sequence[Mean] | None, losses: int | None = None
) -> Iterator[SummaryRow]:
    """Impacts of a run, the sum of their normal impulses [N s], and means per revolution.

    Parameters
    ----------
    losses : number of losses of contact; None if not counted
    """
    yield SummaryRow('impacts', f'{count}')
    yield amount('normal impulse', impulse, 'N s')
    if means and count:
        number, each, _ = means
        unit, scale = for_people('N s', each.mean)
        over = f'95 %, over the last {number.revolutions}'
        yield SummaryRow('impacts per revolution', number.shown(), words=over)
        yield SummaryRow('normal impulse per revolution', each.shown(scale), unit)
    if losses is not None:
        yield SummaryRow('losses of contact', f'{losses}')


def energy_rows(
    initial: float, final: float, work: float, dissipated: float, missing: float, exchanged: float
) -> Iterator[SummaryRow]:
    """The balance of energy of a run [J]."""
    nothing = _ROUNDING * max(abs(initial), abs(final))
    begin, end = (x if abs(x) > nothing else 0.0 for x in (initial, final))
    yield SummaryRow('energy', f'{begin:.6g} J to {end:.6g}', 'J')
    yield amount('work of drives', work, 'J')
    yield amount('dissipated, less work of loads', dissipated, 'J')
    yield SummaryRow('energy error at the end', f'{missing:.3g}', 'J')
    yield SummaryRow('energy exchanged', f'{exchanged:.3g}', 'J')


def _figures(
    machine: Machine,
    steps: int,
    totals: Totals,
    means: Sequence[Mean] | None,
    audited: Stream | Solution | Audit,
) -> Iterator[SummaryRow]:
    """Steps, events, errors and energies of a run."""
    yield SummaryRow('steps', f'{steps}')
    loose = machine.physics.clearances
    if loose or totals.impacts:
        counted = totals.impacts, totals.normal_impulse, means, totals.losses_of_contact
        yield from impact_rows(*counted)
    if loose:
        deepest = f'{audited.max_penetration:.3g}'
        yield SummaryRow('largest penetration of an open gap', deepest, 'm')
    yield SummaryRow('largest error of a closure', f'{audited.max_closure_error:.3g}', 'm')
    e = audited.energy
    if e and math.isfinite(e.residual):
        balance = e.initial, e.final, e.drive_work, e.dissipated, e.residual, e.exchanged
        yield from energy_rows(*balance)
        yield SummaryRow('estimated error of the work', f'{e.error:.2g}', 'J')


def _costs(stats: Stats) -> Iterator[SummaryRow]:
    yield amount('compilation', stats.compile_time, 's', 3)
    yield amount('CPU time', stats.cpu_time, 's', 3)


def head(record: Record, digest: str = '', hardest: int | None = None) -> Iterator[SummaryRow]:
    """Span, model, impacts, tolerances and digest of a run.

    Parameters
    ----------
    digest : digest of the whole run, if this is a part of one
    hardest : number of impacts in the table, if not all
    """
    machine, solver = record.machine, record.machine.scene.solver
    span = f'{instant(record.start)} s to {instant(record.end)}'
    yield SummaryRow('time', span, 's', _turns_of(record))
    yield SummaryRow('model', machine.level.value)
    if machine.has_contacts:
        fewer = '' if hardest is None else f'the hardest {hardest} shown'
        yield SummaryRow('impacts', f'{len(record.piece.impacts)}', words=fewer)
    yield SummaryRow('tolerances', f'rtol {solver.rtol:g}, atol {solver.atol:g}', 'm')
    label = 'digest' if digest or record.whole is None else 'digest of this part'
    yield SummaryRow(label, digest or record.digest())


def _turns_of(record: Record) -> str:
    """Number of turns of a main drive that turns one way."""
    marks = np.append(record.piece.motion.curve.start, record.end)
    passed = np.diff(record.turned(marks))
    if not passed.sum() > 0.999 * np.abs(passed).sum():  # oscillation or translation: nan
        return ''
    turns, drive = f'{passed.sum():.6g}', record.machine.plan.main
    return f'{turns} turn{"" if turns == "1" else "s"} of {drive}'


def facts(record: Record) -> list[SummaryRow]:
    """All that is known of a run as a whole; errors are read from its motion."""
    machine, piece = record.machine, record.piece
    steps, span, totals = len(piece.motion), record.end - record.start, Totals()
    totals.add(piece.impacts, piece.modes)
    audited: Audit | Solution
    wall_time: float | None
    *known, digest = (row for row in head(record) if row.label != 'impacts')
    costs: list[SummaryRow] = []
    if isinstance(piece, Solution):
        audited, wall_time, costs = piece, piece.stats.wall_time, [*_costs(piece.stats)]
    else:
        audited, wall_time = record.audited, record.wall_time
        if wall_time:
            costs.append(SummaryRow('recorded in', f'{wall_time:.3g}', 's'))
    if factor := realtime_factor(span, wall_time):
        costs.append(SummaryRow('real-time factor', f'{factor:.3g}'))
    entered = Counter(c.mode for c in piece.modes if c.previous != Mode.UNKNOWN)
    return [
        *known,
        *_figures(machine, steps, totals, None, audited),
        *(
            SummaryRow(f'changes to {mode.name.lower().replace("_", " ")}', f'{count}')
            for mode, count in sorted(entered.items())
        ),
        amount('mean step', span / steps, 's', 4),
        amount('shortest step', float(piece.motion.curve.duration.min()), 's', 4),
        *costs,
        digest,
    ]


def sections(run: Stream, turns: ImpactAccumulator) -> Iterator[Section]:
    """A run that was streamed, and the machine at its end."""
    machine, stats = run.machine, run.stats
    rows = [
        SummaryRow('time', f'{run.duration:.9g}', 's'),
        *_figures(machine, stats.steps, run.totals, turns.means, run),
        *_costs(stats),
    ]
    notes = []
    if run.energy and run.energy.caveat:
        notes.append(f'warning: {run.energy.caveat}')
    count, made = run.totals.gains
    if count:
        notes.append(
            f"warning: {counted(count, 'impact')} created {made:.3g} J, as Newton's restitution "
            "with friction can; 'hypothesis: poisson' or 'stronge' cannot"
        )
    notes += describe_no_limits(machine, run.no_limits)
    title = f'{machine.name} ({machine.level.value}): {StopReason.COMPLETE.value}'
    yield Section(title, rows, notes=notes)
    yield from _end(run)


def _nothing(run: Stream) -> dict[str, float]:
    """Sizes below which values are zero but for rounding, by unit, at the end of a run.

    Forces, where there are but such, of the energy over the size of the machine.
    """
    physics, o, e = run.machine.physics, run.final.observed, run.energy
    size, energy = run.machine.mechanism.size, max(abs(e.initial), abs(e.final)) if e else 0.0
    greatest = {'rad': 1.0, 'm': size, 'N': energy / size, 'N m': energy}
    straight = np.array([c in physics.displacements for c in physics.coordinates], bool)
    for own, unit, length in ((~straight, 'rad', 1.0), (straight, 'm', size)):
        speed, rate = (
            float(np.abs(x[own]).max(initial=0.0)) for x in (o.velocity, o.acceleration)
        )
        greatest |= {f'{unit}/s': speed, f'{unit}/s^2': max(rate, speed**2 / length)}
    if physics.has_forces:
        for efforts, unit in ((o.reaction, 'N'), (o.reaction_moment, 'N m')):
            finite = np.abs(efforts[np.isfinite(efforts)])
            greatest[unit] = float(finite.max(initial=greatest[unit]))
    return {unit: _ROUNDING * x for unit, x in greatest.items()}


def _end(run: Stream) -> Iterator[Section]:
    """Coordinates at the end, and what joints, drives and links carry there."""
    physics, data, nothing = run.machine.physics, _final(run), _nothing(run)

    def shown(value: float, unit: str, digits: int = 9) -> str:
        value = value if abs(value) > nothing.get(unit, 0.0) else 0.0
        return f'{value:z.{digits}g}'

    rows: list[tuple[str, ...]] = [('coordinate', 'position', 'speed', 'acceleration')]
    for c in physics.coordinates:
        unit = 'm' if c in physics.displacements else 'rad'
        both = [(data[kind][c], f'{unit}{per}') for kind, per in RATES.items()]
        rows.append((c, *(f'{shown(x, u, 10)} {u}' for x, u in both)))
    yield Section(f'at the end, t = {run.duration:.9g} s', table=rows)
    if states := data.get('states'):
        units = {x.label: x.unit for x in run.machine.plan.states}
        known_states = [(name, f'{z:z.10g} {units[name]}') for name, z in states.items()]
        yield Section(table=[('state', 'value'), *known_states])
    if reactions := data.get('reactions'):
        moments = data['reaction_moments']
        carried = [('joint', 'force x', 'force y', *(['moment'] if moments else []))]
        for joint, force in reactions.items():
            cells = ['no limit' if z is None else f'{shown(z, "N")} N' for z in force]
            moment = f'{shown(moments[joint], "N m")} N m' if joint in moments else ''
            carried.append((joint, *cells, *([moment] if moments else [])))
        yield Section(table=carried)
    known = catalogue(run.machine)
    sizes = [
        (f'{kind.replace("_", " ")} of {link}', size, known[f'{kind}.{link}'].unit)
        for kind in _COMPLIANCE
        for link, size in data.get(kind, {}).items()
    ]
    for c, torque in data.get('drive_torques', {}).items():
        sort, unit = ('force', 'N') if c in physics.displacements else ('torque', 'N m')
        sizes.append((f'{sort} of the drive of {c}', torque, unit))
    loads = data.get('loads', {}).items()
    sizes += [(f'load {name}', load, physics.unknowns[name]) for name, load in loads]
    yield Section(rows=[
        SummaryRow(name, 'not determined' if size is None else shown(size, unit), unit)
        for name, size, unit in sizes
    ])  # fmt: skip


def load_rows(
    drive: str, loads: LoadSummary, levels: Mapping[str, float] | None = None
) -> list[tuple[str, ...]]:
    """Table of the largest loads, the head first.

    Parameters
    ----------
    drive : coordinate whose angle is shown
    levels : loads not exceeded in `SHARE` of the time [N, N m] by the names in `loads`
    """
    rows = [(*_row(peak), *_level(peak, levels)) for peak in loads.peaks]
    columns = 6 if any(row[4] for row in rows) else 4
    held = [f'{100.0 * SHARE:g} % of the time at most'] if levels is not None else []
    head = 'joint', 'largest', 'at [s]', drive, 'above half for', 'impulse', *held
    return [row[:columns] + row[6:] for row in (head, *rows)]


def _row(peak: LoadPeak) -> tuple[str, ...]:
    angle = '' if peak.crank_angle is None else f'{math.degrees(peak.crank_angle):.4g} deg'
    first = peak.name, written(peak.value, peak.unit), instant(peak.time, 6), angle
    if peak.duration is None or peak.impulse is None:
        return *first, '', ''
    least = '' if peak.whole else '>= '
    lasts, impulse = written(peak.duration, 's'), written(peak.impulse, f'{peak.unit} s')
    return *first, f'{least}{lasts}', f'{least}{impulse}'


def _level(peak: LoadPeak, levels: Mapping[str, float] | None) -> tuple[str, ...]:
    if levels is None:
        return ()
    return (written(levels[peak.name], peak.unit) if peak.name in levels else '',)


def peaks_of(loads: LoadSummary, levels: Mapping[str, float]) -> Iterator[str]:
    """A clause for each largest load that is but a peak: how long it lasts, what it carries."""
    for peak in (*loads.joints, loads.drive_torque, *loads.other_drives):
        unit, level = peak.unit, levels.get(peak.name, math.inf)
        if abs(peak.value) > _BRIEF * level and peak.whole and peak.duration and peak.impulse:
            yield (
                f'{peak.name}: a peak of {written(peak.duration, "s")} with '
                f'{written(peak.impulse, f"{unit} s")}, {written(abs(peak.value), unit)} high; '
                f'for {100.0 * SHARE:g} % of the time at most {written(level, unit)}'
            )
