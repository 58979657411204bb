"""Derivatives through impacts against differences in 80 bits of equations of their own."""

from __future__ import annotations

import numpy as np
import pytest

import mechanism_sim as ms
from test.builders import PLAY
from test.routes.long_double import F, LooseFourBar

PATHS = {
    'radial': f'{PLAY}.radial',
    'restitution': f'{PLAY}.restitution',
    'friction': f'{PLAY}.friction',
    'speed': 'drive.speed',
    'coupler_mass': 'links.coupler.mass',
    'coupler': 'links.coupler.length',
    'rocker_inertia': 'links.rocker.inertia',
}
SMOOTH = LooseFourBar(restitution=F('0.9'))
ROUGH = LooseFourBar(restitution=F('0.8'), friction=F('0.2'), pin_radius=F('0.006'))
END = {'smooth': '0.02834', 'rough': '0.0179'}
"""[s] Between the 20th impact and the next."""


def _scene(known: LooseFourBar) -> ms.Machine:
    return ms.load_scene(
        'four_bar_clearance',
        {
            f'{PLAY}.restitution': float(known.restitution),
            f'{PLAY}.friction': float(known.friction),
            f'{PLAY}.pin_radius': float(known.pin_radius),
            'start': 'centred',
        },
    )


@pytest.mark.parametrize(
    ('kind', 'names'),
    [
        ('smooth', ['radial', 'coupler']),
        ('rough', ['friction', 'restitution']),
        pytest.param('smooth', list(PATHS), marks=pytest.mark.slow),
        pytest.param('rough', list(PATHS), marks=pytest.mark.slow),
    ],
)
def test_twenty_impacts_have_the_derivatives_of_80_bits(kind: str, names: list[str]) -> None:
    known = {'smooth': SMOOTH, 'rough': ROUGH}[kind]
    names = [n for n in names if getattr(known, n)]
    end = F(END[kind])
    run = ms.simulate(_scene(known), duration=float(end), derivatives=[PATHS[n] for n in names])
    assert len(run.impacts) == 20
    for name in names:
        wanted = known.slope(name, 20, end, F('1e-5')).astype(float)
        found = run.derivatives[PATHS[name]]
        final = found.final
        parts = (
            (found.impacts['t'], wanted[:20]),
            (found.impacts['normal_impulse'], wanted[20:40]),
            ([final[c]['position'] for c in ('coupler', 'rocker')], wanted[40:42]),
            ([final[c]['velocity'] for c in ('coupler', 'rocker')], wanted[42:]),
        )
        for own, other in parts:
            assert np.abs(own - other).max() < 1e-8 * np.abs(other).max(), name
        assert not found.limits
