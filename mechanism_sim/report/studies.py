"""Studies as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from mechanism_sim import text_table
from mechanism_sim.report.sections import Section
from mechanism_sim.strict_json import plain
from mechanism_sim.units import counted, for_people, number, written

if TYPE_CHECKING:  # each is slow to load, and a command needs but one
    from mechanism_sim.studies.identification import IdentifiedParameter, Result
    from mechanism_sim.studies.lift_off import LiftOff
    from mechanism_sim.studies.lyapunov import Horizon, LyapunovExponents
    from mechanism_sim.studies.periodic import PeriodicResponse
    from mechanism_sim.studies.statistics import Statistics

_MEAN = 'mean', 'half_width', 'unit'
_HORIZON = 'time', 'digits', 'left', 'limit'
_STABLE = {
    True: 'stable',
    False: 'unstable',
    None: 'stability not determined: a multiplier has the size 1 within its error',
}


def periodic(response: PeriodicResponse) -> str:
    """A periodic response as text."""
    sizes = ', '.join(f'{abs(m):.4g}' for m in response.multipliers)
    unit, scale = for_people('N s', response.impulse)
    turns = 'revolution' if response.period == 1 else f'{response.period} revolutions'
    impacts = counted(response.impacts, 'impact')
    return '\n'.join(
        [
            f'repeats every {turns}, to {response.residual:.2g}; {_STABLE[response.stable]}',
            f'  {impacts}, {scale * response.impulse:.6g} {unit} in a period',
            f'  Floquet multipliers of size {sizes} (to {response.spread:.2g})'
            if sizes
            else '  no Floquet multipliers: closed contacts leave no freedom once a period',
        ]
    )


def periodic_json(response: PeriodicResponse | None) -> dict[str, object]:
    """JSON of it; a machine that does not repeat has ``period: null``."""
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
    """Means as text."""
    kept = found.revolutions - found.skipped
    lines = [f'{counted(kept, "revolution")} after {found.skipped}; a revolution:']
    for m in found.means:
        line = f'  {m.name.replace("_", " "):24} {m.mean:12.6g} +- {m.half_width:.2g} {m.unit}'
        lines.append(line.rstrip())
    lines.append(
        f'  I_n (impulse per impact) {found.I_n:12.6g} +- {found.I_n_half_width:.2g} N s'
        if math.isfinite(found.I_n)
        else '  no impacts'
    )
    if found.measures:
        lines.append('measures of each revolution, the mean of them:')
    for m in found.measures:
        unit, scale = for_people(m.unit, abs(m.mean))
        lines.append(f'  {m.name}  {m.shown(scale)} {unit}'.rstrip())
    return '\n'.join(lines)


def statistics_json(found: Statistics) -> dict[str, object]:
    """JSON of it."""
    keys = 'revolutions', 'skipped', 'I_n', 'I_n_half_width'
    rows = {'means': found.means, 'measures': found.measures}
    return {key: plain(getattr(found, key)) for key in keys} | {
        kind: {m.name: {k: plain(getattr(m, k)) for k in _MEAN} for m in means}
        for kind, means in rows.items()
    }


def lift_offs(found: Sequence[LiftOff]) -> str:
    """Results of a search for lift-off as text."""
    lines = []
    for x in found:
        where = f'at {_degrees(x.least_force_at)} of the drive'
        lines.append(f'{x.joint}: least contact force {x.least_force:.6g} N, {where}')
        if x.lift_off_speed is None or x.lift_off_at is None:
            force = 'never' if x.least_force > 0.0 else 'at any speed'
            lines.append(f'  contact is lost {force}, of the speeds that were tried')
            continue
        rpm = x.lift_off_speed * 30.0 / math.pi
        lines.append(
            f'  contact is lost from {x.lift_off_speed:.9g} rad/s ({rpm:.7g} rpm) on, first at '
            f'{_degrees(x.lift_off_at)}'
        )
    return '\n'.join(lines)


def _degrees(angle: float) -> str:
    return f'{math.degrees(angle) % 360.0:.6g} deg'


def fit_text(found: Result) -> str:
    """Format the result of a fit as text, in SI units."""
    lines = [f'{found.method}' + (f': {found.reason}' if found.reason else '')]
    lines.append(
        f'{found.simulations} simulations, {found.failed} failed; all together with 95 %:'
    )
    rows = [('parameter', 'value', 'limits', 'searched', ''), *map(_estimate, found.estimates)]
    lines += text_table.lines(rows, (0, 2, 3, 4))
    pairs = [
        (abs(found.correlation[i, j]), i, j) for i in range(len(found.estimates)) for j in range(i)
    ]
    for size, i, j in sorted(pairs, reverse=True):
        if size > 0.5:
            names = [found.estimates[k].parameter.name for k in (j, i)]
            lines.append(f'  errors of {" and ".join(names)}: correlation '
                         f'{found.correlation[i, j]:.2f}')  # fmt: skip
    for r in found.residuals:
        left = f'{100.0 * r.share:.3g} % of the signal' if math.isfinite(r.share) else 'no signal'
        lines.append(f'left of {r.name}: {written(r.rms, r.unit)} rms, {left}')
        if r.turns:
            side = 'below' if r.turns > 0 else 'above'
            lines.append(f'  it is {counted(abs(r.turns), "whole turn")} {side} the angle of the '
                         'scene: count both from one place')  # fmt: skip
    if math.isfinite(found.misfit):
        misfit = f'misfit {found.misfit:.2f} standard deviations of the noise'
        if found.method == 'regression':
            misfit += f', as much as that of {100.0 * found.likeness:.0f} % of the simulations'
        lines.append(misfit)
    if not found.plausible:
        lines.append(
            'no simulation reproduces this signal, or too little of it, or not alike all along: '
            'the machine, its chain or its noise may differ from the scene, and the values above '
            'are not reliable; other ranges (--range) or another --seed may find better ones'
        )
    return '\n'.join(lines)


def _estimate(e: IdentifiedParameter) -> tuple[str, ...]:
    """A row of the table: limits differ from the value by two digits at least."""
    p, note = e.parameter, '' if e.identified else 'not determined by the signal'
    if e.identified and not (p.low < e.low and e.high < p.high):
        note = 'at the limit of its range: widen it'
    unit, scale = (p.unit, p.scale) if p.unit else for_people(p.si, p.high)
    apart = min((x for x in (e.value - e.low, e.high - e.value) if x > 0.0), default=0.0)
    largest = max(abs(e.low), abs(e.high))
    known = apart and math.isfinite(largest)
    digits = math.floor(math.log10(largest)) - math.floor(math.log10(apart)) + 2 if known else 5
    low, value, high = (
        number(scale * x, min(max(digits, 3), 15)) for x in (e.low, e.value, e.high)
    )
    searched = f'{number(scale * p.low)} to {number(scale * p.high)}'
    return p.name, value, *(f'{x} {unit}'.rstrip() for x in (f'{low} to {high}', searched)), note


def fit_json(found: Result) -> dict[str, object]:
    """JSON of it, SI units; ``misfit`` is null where the noise is not known."""
    keys = (
        'simulations', 'failed', 'misfit', 'likeness', 'plausible', 'method', 'reason', 'window',
    )  # fmt: skip
    return {
        'parameters': {
            e.parameter.name: {
                'path': e.parameter.path,
                'value': e.value,
                'low': e.low,
                'high': e.high,
                'range': [e.parameter.low, e.parameter.high],
                'identified': e.identified,
            }
            for e in found.estimates
        },
        'correlation': plain(found.correlation.tolist()),
        **{k: plain(getattr(found, k)) for k in keys},
        'residuals': {
            r.name: {'unit': r.unit, 'rms': r.rms, 'share': plain(r.share)}
            for r in found.residuals
        },
    }


def exponents_text(found: LyapunovExponents) -> str:
    """Exponents as text, with the meaning of the largest."""
    lines = [f'{counted(found.revolutions, "revolution")} after {found.skipped}; exponents [1/s]:']
    for value, half in zip(found.values, found.half_widths, strict=True):
        lines.append(
            f'  {value:.6g} +- {half:.2g}'
            if math.isfinite(value)
            else '  minus infinity: within a turn such changes end, by contact or below rounding'
        )
    if math.isfinite(found.horizon):
        turns = found.horizon / found.period
        lines.append(
            f'chaotic: small changes grow by {math.exp(found.values[0] * found.period):.4g} a '
            f'turn; of 16 digits none is left after {turns:.3g} turns ({found.horizon:.3g} s)'
        )
    if found.undecided:
        lines.append('whether small changes grow is not decided: more revolutions tell')
    return '\n'.join(lines)


def exponents_json(found: LyapunovExponents) -> dict[str, object]:
    """JSON of it, SI units; null where an exponent, or the horizon, is infinite."""
    return {
        'revolutions': found.revolutions,
        'skipped': found.skipped,
        'exponents': [
            plain({'value': x, 'low': x - half, 'high': x + half})
            for x, half in zip(found.values, found.half_widths, strict=True)
        ],
        'horizon': plain(found.horizon),
    }


def horizon_section(found: Horizon) -> Section:
    """Valid digits of a run as text."""
    left = f'of {found.digits:.3g} digits {found.left:.2g} hold at the end'
    if math.isfinite(found.time):
        left = f'of {found.digits:.3g} digits none holds after {found.time:.4g} s'
    elif found.limit:
        left = f'of {found.digits:.3g} digits {found.left:.2g} hold at t = {found.limit.t:.4g} s'
    return Section(notes=[left, *([str(found.limit)] if found.limit else [])])


def horizon_json(found: Horizon) -> dict[str, object]:
    """JSON of it: the key ``horizon``; its time is null where digits hold to the end."""
    return {'horizon': plain({key: getattr(found, key) for key in _HORIZON})}
