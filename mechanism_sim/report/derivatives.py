"""Derivatives of a run in a summary and as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mechanism_sim.derivatives.flow import CHATTER
from mechanism_sim.report.sections import Section
from mechanism_sim.results.derivatives import RunDerivative
from mechanism_sim.results.measures import Measured
from mechanism_sim.strict_json import plain


def to_json(found: Mapping[str, RunDerivative], measures: Sequence[Measured]) -> dict[str, Any]:
    """The key ``derivatives``: of the final state, impacts and measures, in SI units."""
    return {
        'derivatives': {
            path: plain({
                'final': d.final,
                'impacts': [
                    {'t': float(t), 'normal_impulse': float(p)}
                    for t, p in zip(d.impacts['t'], d.impacts['normal_impulse'], strict=True)
                ],
                'measures': _by_name(d, measures),
                'limits': d.limits,
            })
            for path, d in found.items()
        }
    }  # fmt: skip


def sections(found: Mapping[str, RunDerivative], measures: Sequence[Measured]) -> list[Section]:
    """A table by path, in SI units."""
    made = []
    for path, d in found.items():
        rows = [['quantity at the end', 'derivative']]
        rows += [
            [f'{kind}.{c}', f'{x:.6g}'] for c, own in d.final.items() for kind, x in own.items()
        ]
        rows += [[name, f'{x:.6g}'] for name, x in _by_name(d, measures).items()]
        notes = [str(limit) for limit in d.limits if limit.text != CHATTER]
        if others := len(d.limits) - len(notes):
            notes.append(f'{others} ends of chatter, after which a contact counts as closed')
        made.append(Section(f'derivatives by {path} (SI units)', table=rows, notes=notes))
    return made


def _by_name(derivative: RunDerivative, measures: Sequence[Measured]) -> dict[str, float]:
    """Derivatives of measures by their names, of which several may be of one text."""
    texts = dict.fromkeys(m.text for m in measures)
    known = derivative.measures(*texts) if texts else {}
    return {m.name: known[m.text] for m in measures}
