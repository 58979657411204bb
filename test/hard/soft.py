"""Contacts that give way: stiff equations whose limit is the rigid model."""

from __future__ import annotations

import numpy as np

from mechanism_sim.results.simulate import simulate
from test.hard.bodies import TURN, residual, thesis
from test.hard.case import Figure, hard_case


@hard_case(
    'Hertz contact of 1e8 to 1e14 N/m^1.5: from soft to stiffer than any bearing.',
    'The rigid model is the limit; in following all that differs is in proportion to the static '
    'depth (F/K)^(2/3).',
)
def rigid_limit_of_hertz() -> list[Figure]:
    """Exponent with which the difference falls, and the energy balance."""
    t = np.linspace(0.05, 0.499, 300) * TURN
    rigid = simulate(thesis(), revolutions=0.5).sample(t, 'position.rocker')['position.rocker']
    stiffness = 10.0 ** np.arange(8, 15)
    differences, largest = [], 0.0
    for K in stiffness:
        law = {'law': 'hertz', 'stiffness': float(K)}
        machine = thesis(joints__coupler_rocker__clearance__contact=law)
        soft = simulate(machine, revolutions=0.5)
        away = soft.sample(t, 'position.rocker')['position.rocker'] - rigid
        differences.append(float(np.abs(away).max()))
        largest = max(largest, abs(residual(soft.energy)))
    slopes = np.diff(np.log(differences)) / np.diff(np.log(stiffness))
    return [
        Figure(
            'exponent plus 2/3, the largest over the decades', np.abs(slopes + 2 / 3).max(), 0.01
        ),
        Figure('difference at 1e14', differences[-1], 1e-8, 'rad'),
        Figure('energy residual', largest, 1e-9, 'J'),
    ]
