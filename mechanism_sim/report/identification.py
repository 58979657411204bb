"""What was identified, as text and as JSON."""

from __future__ import annotations

from mechanism_sim import strict_json
from mechanism_sim.studies.identification import Result

_UNLIKE = 0.01


def unlike(found: Result) -> bool:
    """Whether hardly any simulation is as far from what is expected as the signal is."""
    return found.likeness < _UNLIKE


def render(found: Result) -> str:
    """For people; in SI units."""
    lines = [f'{found.simulations} simulations, {found.failed} failed; all together with 95 %:']
    for e in found.estimates:
        note = '' if e.identified else '   the signal does not tell'
        if e.identified and not (e.parameter.low < e.low and e.high < e.parameter.high):
            note = '   at the limit of its range: widen it'
        interval = f'{e.low:.5g} to {e.high:.5g}'
        lines.append(f'  {e.parameter.name:12} {e.value:11.5g}   {interval}{note}')
    pairs = [
        (abs(found.correlation[i, j]), i, j) for i in range(len(found.estimates)) for j in range(i)
    ]
    for size, i, j in sorted(pairs, reverse=True):
        if size > 0.5:
            names = [found.estimates[k].parameter.name for k in (j, i)]
            lines.append(f'  errors of {" and ".join(names)}: correlation '
                         f'{found.correlation[i, j]:.2f}')  # fmt: skip
    lines.append(
        f'misfit {found.misfit:.2f} standard deviations, as much as that of '
        f'{100.0 * found.likeness:.0f} % of the simulations'
    )
    if unlike(found):
        lines.append(
            'no simulation is like this signal: the machine, its chain or its noise is not that '
            'of the scene, and the values above are not to be trusted'
        )
    return '\n'.join(lines)


def to_json(found: Result) -> dict[str, object]:
    """The same as JSON."""
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
        'correlation': strict_json.plain(found.correlation.tolist()),
        **{k: getattr(found, k) for k in ('simulations', 'failed', 'misfit', 'likeness')},
        'plausible': not unlike(found),
    }
