"""Studies as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mechanism_sim.strict_json import plain
from mechanism_sim.studies.lift_off import LiftOff
from mechanism_sim.studies.periodic import Response
from mechanism_sim.studies.statistics import Statistics
from mechanism_sim.units import for_people

_STABLE = {
    True: 'stable',
    False: 'unstable',
    None: 'stable or not is not known: a multiplier has the size 1 but for its error',
}


def periodic(response: Response) -> str:
    """A periodic response for people."""
    sizes = ', '.join(f'{abs(m):.4g}' for m in response.multipliers)
    unit, scale = for_people('N s', response.impulse)
    return '\n'.join(
        [
            f'repeats every {response.period} revolutions, to {response.residual:.2g}; '
            f'{_STABLE[response.stable]}',
            f'  {response.impacts} impacts, {scale * response.impulse:.6g} {unit} in a period',
            f'  Floquet multipliers of size {sizes} (to {response.spread:.2g})'
            if sizes
            else '  no Floquet multipliers: closed contacts leave nothing free once a period',
        ]
    )


def periodic_json(response: Response | None) -> dict[str, object]:
    """The same as JSON; a machine that does not repeat has ``period: null``."""
    if response is None:
        return {'period': None}
    keys = 'period', 'residual', 'stable', 'impacts', 'impulse'
    return {key: getattr(response, key) for key in keys} | {
        'position': list(response.state.q),
        'velocity': list(response.state.v),
        'multipliers': [[m.real, m.imag] for m in response.multipliers],
        'spread': response.spread,
    }


def statistics(found: Statistics) -> str:
    """Means for people."""
    kept = found.revolutions - found.skipped
    lines = [f'{kept} revolutions after {found.skipped}; a revolution:']
    for m in found.means:
        line = f'  {m.name.replace("_", " "):18} {m.mean:12.6g} +- {m.half_width:.2g} {m.unit}'
        lines.append(line.rstrip())
    lines.append(
        f'  I_n (impulse per impact) {found.I_n:.6g} +- {found.I_n_half_width:.2g} N s'
        if math.isfinite(found.I_n)
        else '  no impacts'
    )
    for m in found.measures:
        unit, scale = for_people(m.unit, abs(m.mean))
        lines.append(f'  {m.name}  {m.shown(scale)} {unit}'.rstrip())
    return '\n'.join(lines)


def statistics_json(found: Statistics) -> dict[str, object]:
    """The same as JSON."""
    keys = 'revolutions', 'skipped', 'I_n', 'I_n_half_width'
    return {key: plain(getattr(found, key)) for key in keys} | {
        'means': {
            m.name.replace(' ', '_'): {'mean': m.mean, 'half_width': m.half_width, 'unit': m.unit}
            for m in found.means
        },
        'measures': {
            m.name: {'mean': plain(m.mean), 'half_width': plain(m.half_width), 'unit': m.unit}
            for m in found.measures
        },
    }


def lift_offs(found: Sequence[LiftOff]) -> str:
    """As text."""
    lines = []
    for x in found:
        where = f'at {math.degrees(x.least.angle) % 360.0:.6g} deg of the drive'
        lines.append(f'{x.joint}: least contact force {x.least.force:.6g} N, {where}')
        if x.speed is None or x.begin is None:
            force = 'never' if x.least.force > 0.0 else 'at any speed'
            lines.append(f'  contact is lost {force}, of the speeds that were tried')
            continue
        rpm = x.speed * 30.0 / math.pi
        at = math.degrees(x.begin.angle) % 360.0
        lines.append(
            f'  contact is lost from {x.speed:.9g} rad/s ({rpm:.7g} rpm) on, first at {at:.6g} deg'
        )
    return '\n'.join(lines)


def lift_offs_json(found: Sequence[LiftOff]) -> list[dict[str, object]]:
    """As plain dictionaries, in SI units."""
    return [
        {
            'joint': x.joint,
            'least_force': x.least.force,
            'least_force_at': x.least.angle,
            'lift_off_speed': x.speed,
            'lift_off_at': x.begin.angle if x.begin else None,
        }
        for x in found
    ]
