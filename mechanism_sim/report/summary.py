"""A solution in a few lines, or as the JSON others build on."""

from __future__ import annotations

import numpy as np

from mechanism_sim.hybrid.events import Impact, gains
from mechanism_sim.hybrid.solution import Solution

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
)


def to_json(solution: Solution) -> dict[str, object]:
    """The result of `solve --json`: SI units throughout."""
    stats, energy = solution.stats, solution.energy
    return {
        'scene': solution.scene,
        'level': solution.level,
        'duration': solution.duration,
        'wall_time': stats.wall_time,
        'cpu_time': stats.cpu_time,
        'compile_time': stats.compile_time,
        'steps': stats.steps,
        'switches': stats.switches,
        'stop_reason': solution.stop_reason.value,
        'coordinates': list(solution.physics.coordinates),
        'final': _final(solution),
        'impacts': [_impact(impact) for impact in solution.impacts],
        'modes': [
            {'t': c.t, 'joint': c.joint, 'mode': c.mode.name.lower()} for c in solution.modes
        ],
        'max_penetration': solution.max_penetration,
        'max_closure_error': solution.max_closure_error,
        'energy': None
        if energy is None
        else {
            'initial': energy.initial,
            'final': energy.final,
            'drive_work': energy.drive_work,
            'dissipated': energy.dissipated,
            'residual': energy.residual,
        },
        'digest': solution.digest(),
    }


def _impact(impact: Impact) -> dict[str, object]:
    return {key: getattr(impact, key) for key in _IMPACT_KEYS}


def _final(solution: Solution) -> dict[str, object]:
    physics = solution.physics
    o = solution.samples(solution.duration).observed

    def by_name(rows: np.ndarray) -> dict[str, float]:
        return {c: float(row[0]) for c, row in zip(physics.coordinates, rows, strict=True)}

    final: dict[str, object] = {
        't': solution.duration,
        'position': by_name(o.position),
        'velocity': by_name(o.velocity),
        'acceleration': by_name(o.acceleration),
    }
    if physics.has_forces:
        final['reactions'] = {
            joint: [float(x) for x in force[:, 0]]
            for joint, force in zip(physics.joints, o.reaction, strict=True)
        }
        final['drive_torque'] = float(o.drive_torque.sum())
    return final


def render(solution: Solution) -> str:
    """A solution for people."""
    stats, data = solution.stats, _final(solution)
    lines = [
        f'{solution.scene} ({solution.level}): {solution.duration:.9g} s in {stats.steps} steps, '
        f'{stats.cpu_time * 1e3:.1f} ms CPU, compiled in {stats.compile_time * 1e3:.0f} ms; '
        f'{solution.stop_reason.value}'
    ]
    if solution.physics.clearances:
        impulse = sum(impact.normal_impulse for impact in solution.impacts)
        losses = sum(c.previous > 1 and c.mode == 1 for c in solution.modes)
        lines.append(
            f'  {len(solution.impacts)} impacts, normal impulse {impulse * 1e3:.6g} mN s, '
            f'{losses} losses of contact'
        )
        made = [gain for gain in gains(solution.impacts) if gain > 1e-15]
        if made:
            lines.append(
                f'  warning: {len(made)} impacts created {sum(made):.3g} J, '
                "as Newton's restitution with friction can; 'hypothesis: poisson' or 'stronge' "
                'cannot'
            )
    if solution.energy:
        e = solution.energy
        lines.append(
            f'  energy {e.initial:.6g} J to {e.final:.6g} J, drive work {e.drive_work:.6g} J, '
            f'dissipated {e.dissipated:.6g} J, residual {e.residual:.2g} J'
        )
    lines.append(
        f'  largest penetration {solution.max_penetration:.2g} m, closure error '
        f'{solution.max_closure_error:.2g} m'
    )
    lines.append(f'  at the end, t = {solution.duration:.9g} s')
    for c in solution.physics.coordinates:
        q, v, a = (data[k][c] for k in ('position', 'velocity', 'acceleration'))  # type: ignore[index]
        unit = 'm' if '.' in c else 'rad'
        lines.append(f'    {c:9} {q:16.10g} {unit} {v:16.10g} {unit}/s {a:16.10g} {unit}/s^2')
    for joint, (x, y) in data.get('reactions', {}).items():  # type: ignore[attr-defined]
        lines.append(f'    {joint:16} {x:14.9g} {y:14.9g} N')
    if 'drive_torque' in data:
        lines.append(f'    drive torque     {data["drive_torque"]:14.9g} N m')
    return '\n'.join(lines)
