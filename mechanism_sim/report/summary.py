"""A finished run in a few lines, or as the JSON others build on."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mechanism_sim import text_table
from mechanism_sim.hybrid.events import Impact, ModeChange, StopReason
from mechanism_sim.planar.inverse_dynamics import NoLimit
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.means import ImpactTally
from mechanism_sim.results.quantity import Shown
from mechanism_sim.results.simulate import Stream
from mechanism_sim.scene.machine import Machine
from mechanism_sim.strict_json import plain

_SENTENCES = 4  # of what repeats
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
_STATS_KEYS = 'wall_time', 'cpu_time', 'compile_time', 'steps', 'switches'
_TOTALS_KEYS = 'losses_of_contact', 'normal_impulse', 'largest_impulse'
_ENERGY_KEYS = 'initial', 'final', 'drive_work', 'dissipated', 'residual', 'error', 'exchanged'


def to_json(
    run: Stream,
    digest: str,
    turns: ImpactTally,
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
    return {
        'scene': run.machine.name,
        'level': run.machine.level.value,
        'duration': run.duration,
        **{key: getattr(stats, key) for key in _STATS_KEYS},
        'stop_reason': StopReason.COMPLETE.value,
        'coordinates': list(run.machine.physics.coordinates),
        'final': _final(run),
        'impact_count': totals.impacts,
        'mode_change_count': totals.mode_changes,
        **{key: getattr(totals, key) for key in _TOTALS_KEYS},
        'per_revolution': _per_revolution(turns),
        **events,
        'no_limits': no_limits_to_json(run.no_limits),
        'max_penetration': run.max_penetration,
        'max_closure_error': run.max_closure_error,
        'energy': energy and {k: getattr(energy, k) for k in _ENERGY_KEYS},
        'digest': digest,
    }


def _per_revolution(turns: ImpactTally) -> dict[str, object] | None:
    if not turns.means:
        return None
    return {'revolutions': turns.means[0].revolutions} | {
        m.name: {'mean': plain(m.mean), 'half_width': plain(m.half_width)} for m in turns.means
    }


def no_limits_to_json(found: list[NoLimit]) -> list[dict[str, object]]:
    """The instants at which forces have no limit."""
    return [
        {'t': x.t, 'drive': x.drive, 'joints': list(x.joints), 'loads': list(x.loads)}
        for x in found
    ]


def describe_no_limits(machine: Machine, found: list[NoLimit]) -> Iterator[str]:
    """A sentence for each instant at which forces have no limit, of many for the first ones.

    Before them one for each joint whose motion leaves the run without forces.
    """
    for joint, why in machine.without_forces.items():
        yield f'{joint}: {why}; this run is kinematics, forces are left out'
    for x in found[:_SENTENCES]:
        slides = machine.main in machine.mechanism.displacements
        angle = round(math.degrees(x.drive), 6) % 360.0
        place = f'{1e3 * x.drive:.6g} mm' if slides else f'{angle:.6g} deg'
        why = 'have no limit: they grow beyond all bounds'
        if x.rests:
            why = 'are not determined while the drive rests'
        if x.loads:
            forces = f', nor are the forces in {", ".join(x.joints)}' if x.joints else ''
            since, work = (
                ('from', 'does no work for a while') if x.rests else ('at', 'does no work')
            )
            yield (
                f'{since} {machine.main} = {place}, t = {x.t:.9g} s, the unknown '
                f'{" or ".join(x.loads)} {work}: its size is not determined{forces}; '
                'they are left out'
            )
            continue
        yield (
            f'at {machine.main} = {place}, t = {x.t:.9g} s, a singular position, the forces in '
            f'{", ".join(x.joints)} {why}; they are left out'
        )
    if len(found) > _SENTENCES:
        yield f'and at {len(found) - _SENTENCES} more such instants'


def _final(run: Stream) -> dict[str, object]:
    physics = run.machine.physics
    o = run.final.observed

    def by_name(rows: np.ndarray) -> dict[str, float]:
        return {c: float(row[0]) for c, row in zip(physics.coordinates, rows, strict=True)}

    final: dict[str, object] = {
        't': run.duration,
        'position': by_name(o.position),
        'velocity': by_name(o.velocity),
        'acceleration': by_name(o.acceleration),
    }
    others: dict[str, dict[str, float]] = {}
    for quantity in catalogue(run.machine).values():
        if quantity.shown is Shown.RUN and quantity.kind in _COMPLIANCE:
            _, _, link = quantity.name.partition('.')
            others.setdefault(quantity.kind, {})[link] = float(quantity.evaluate(run.final)[0])
    final |= others
    if physics.has_forces:
        final['reactions'] = {
            joint: plain(force[:, 0].tolist())
            for joint, force in zip(physics.joints, o.reaction, strict=True)
        }
        moments = zip(physics.joints, o.reaction_moment[:, 0].tolist(), strict=True)
        final['reaction_moments'] = {joint: plain(m) for joint, m in moments if m}
        final['drive_torque'] = plain(float(o.drive_torque[0, 0]))
        torques = zip(physics.driven, o.drive_torque[:, 0].tolist(), strict=True)
        final['drive_torques'] = plain(dict(torques))
        loads = zip(physics.unknowns, o.load[:, 0].tolist(), strict=True)
        final['loads'] = plain(dict(loads))
    return final


def render(run: Stream, turns: ImpactTally) -> str:
    """A run for people."""
    stats, data = run.stats, _final(run)
    lines = [
        f'{run.machine.name} ({run.machine.level.value}): {run.duration:.9g} s in '
        f'{stats.steps} steps, {stats.cpu_time * 1e3:.1f} ms CPU, '
        f'compiled in {stats.compile_time * 1e3:.0f} ms; {StopReason.COMPLETE.value}'
    ]
    totals = run.totals
    if run.machine.physics.clearances:
        unit, scale = ('N s', 1.0) if totals.normal_impulse >= 1.0 else ('mN s', 1e3)
        lines.append(
            f'  {totals.impacts} impacts, normal impulse {scale * totals.normal_impulse:.6g} '
            f'{unit}, {totals.losses_of_contact} losses of contact'
        )
        if turns.means and totals.impacts:
            number, impulse, _ = turns.means
            lines.append(
                f'  per revolution {number.shown()} impacts, {impulse.shown(scale)} {unit} '
                f'(95 %, over the last {number.revolutions})'
            )
        count, made = totals.gains
        if count:
            lines.append(
                f'  warning: {count} impacts created {made:.3g} J, '
                "as Newton's restitution with friction can; 'hypothesis: poisson' or 'stronge' "
                'cannot'
            )
    if run.energy:
        e = run.energy
        lines.append(
            f'  energy {e.initial:.6g} J to {e.final:.6g} J, drive work {e.drive_work:.6g} J, '
            f'dissipated {e.dissipated:.6g} J, residual {e.residual:.2g} J of {e.exchanged:.3g} J '
            'exchanged'
        )
        if e.doubt:
            lines.append(f'  warning: {e.doubt}')
    lines.append(
        f'  largest penetration {run.max_penetration:.2g} m, closure error '
        f'{run.max_closure_error:.2g} m'
    )
    lines += [f'  {line}' for line in describe_no_limits(run.machine, run.no_limits)]
    lines.append(f'  at the end, t = {run.duration:.9g} s')
    rows: list[tuple[str, ...]] = [('coordinate', 'position', 'speed', 'acceleration')]
    for c in run.machine.physics.coordinates:
        unit = 'm' if c in run.machine.physics.displacements else 'rad'
        moving = zip(('position', 'velocity', 'acceleration'), ('', '/s', '/s^2'), strict=True)
        rows.append((c, *(f'{data[k][c]:.10g} {unit}{per}' for k, per in moving)))  # type: ignore[index]
    lines += text_table.lines(rows, indent='    ')
    stresses: dict[str, float] = data.get('stress', {})  # type: ignore[assignment]
    for link, deflection in data.get('deflection', {}).items():  # type: ignore[attr-defined]
        stress = f', stress {stresses[link]:.9g} Pa' if link in stresses else ''
        lines.append(f'    {link:9} deflection {deflection:.9g} m{stress}')
    moments: dict[str, float] = data.get('reaction_moments', {})  # type: ignore[assignment]
    carried: list[tuple[str, ...]] = [
        ('joint', 'force x', 'force y', *(['moment'] if moments else []))
    ]
    for joint, force in data.get('reactions', {}).items():  # type: ignore[attr-defined]
        cells = ['no limit' if z is None else f'{z:.9g} N' for z in force]
        moment = f'{moments[joint]:.9g} N m' if joint in moments else ''
        carried.append((joint, *cells, *([moment] if moments else [])))
    if len(carried) > 1:
        lines += text_table.lines(carried, indent='    ')
    for name, moment in data.get('bearing_moment', {}).items():  # type: ignore[attr-defined]
        lines.append(f'    moment {name} {moment:14.9g} N m')
    for name, force in data.get('axial_force', {}).items():  # type: ignore[attr-defined]
        lines.append(f'    force along the axis of {name} {force:14.9g} N')
    torques: dict[str, float | None] = data.get('drive_torques', {})  # type: ignore[assignment]
    for c, torque in torques.items():
        straight = c in run.machine.physics.displacements
        of = f' of {c}' if len(torques) > 1 else ''
        kind, unit = ('force ', 'N') if straight else ('torque', 'N m')
        size = 'not determined' if torque is None else f'{torque:14.9g}'
        lines.append(f'    drive {kind}{of}     {size} {unit}')
    loads: dict[str, float | None] = data.get('loads', {})  # type: ignore[assignment]
    for name, load in loads.items():
        size = 'not determined' if load is None else f'{load:14.9g}'
        lines.append(f'    load {name}     {size} {run.machine.physics.unknowns[name]}')
    return '\n'.join(lines)
