"""Films whose journal turns back: the other half begins to carry, which no series foretells."""

from __future__ import annotations

import numpy as np
import pytest
from builders import made
from numpy.polynomial.legendre import leggauss
from scipy.integrate import solve_ivp

import mechanism_sim as ms

ETA, WIDTH, RADIUS, CLEARANCE, MASS = 0.02, 0.01, 0.01, 1e-4, 2.0
SWING, FAST = 5e-5, 100.0  # of the frame [m], [1/s]

NODES, WEIGHTS = (0.5 * np.pi * x for x in leggauss(40))
COSINE = np.cos(NODES)
SQUARE = WEIGHTS * COSINE**2


def squeezed(axis: float, **contact: str) -> ms.Machine:
    """A block in a film in a frame, both on one straight way, and the frame shaken along it."""
    oil = {'law': 'film', 'viscosity': ETA, 'width': WIDTH, 'radius': RADIUS, **contact}
    pin = {'revolute': ['frame', 'block'], 'clearance': {'radial': CLEARANCE, 'contact': oil}}
    guides = {
        f'guide_{link}': {'prismatic': ['ground', link], 'axis': f'{axis} deg'}
        for link in ('frame', 'block')
    }
    return made({
        'title': 'squeezed', 'mechanism': 'linkage', 'gravity': [0.0, 0.0], 'start': 'centred',
        'links': {'frame': {'mass': 1.0}, 'block': {'mass': MASS}},
        'joints': guides | {'pin': pin},
        'drive': {'coordinate': 'frame', 'position': f'{SWING}*sin({FAST}*t)'},
    })  # fmt: skip


def film_force(e: float, v: float) -> float:
    """Force [N] on a journal at a distance e from the middle that moves away at v: by quadrature.

    ``-eta R L^3 integral of v cos^2/(c - e cos)^3`` over the half circle that it moves towards.
    """
    thin = CLEARANCE - np.copysign(1.0, v) * e * COSINE
    return -ETA * RADIUS * WIDTH**3 * v * float(SQUARE @ thin**-3)


@pytest.mark.parametrize(
    ('axis', 'contact'),
    [
        (90.0, {}), pytest.param(25.0, {}, marks=pytest.mark.slow),
        (0.0, {'supply_pressure': '1e-6 Pa'}),
    ],
)  # fmt: skip
def test_a_squeezed_film_turns_back_as_by_quadrature_and_arcs(axis, contact):
    """Before, steps went on over the turns: 0.5 % of the work was missing, and nothing said so."""
    end = 0.06

    def rates(t: float, y: np.ndarray) -> list[float]:
        x, v = y[0] - SWING * np.sin(FAST * t), y[1] - SWING * FAST * np.cos(FAST * t)
        return [y[1], film_force(x, v) / MASS]

    def turns(t: float, y: np.ndarray) -> float:
        return y[1] - SWING * FAST * np.cos(FAST * t)

    turns.terminal = True
    run = ms.simulate(squeezed(axis, **contact), duration=end)
    start = run.sample(0.0, 'position.block', 'velocity.block')
    t, y, arcs = 0.0, [start['position.block'][0], start['velocity.block'][0]], 0
    while t < end:
        arc = solve_ivp(rates, (t, end), y, 'DOP853', events=turns, rtol=1e-10, atol=1e-15)
        t, y, arcs = arc.t[-1], arc.y[:, -1], arcs + 1
        if t < end:  # just past the turn, where the rate has its new sign
            step = 1e-9
            y = y + step * np.array(rates(t + step, y))
            t += step
    assert arcs > 2
    found = run.sample(end, 'position.block', 'velocity.block')
    assert found['position.block'][0] == pytest.approx(y[0], abs=3e-8 * SWING)
    assert found['velocity.block'][0] == pytest.approx(y[1], abs=3e-8 * SWING * FAST)
    assert abs(run.energy.residual) <= 1e-10 * run.energy.exchanged


@pytest.mark.slow
def test_a_journal_that_slides_back_along_its_wall_in_supplied_oil_keeps_its_energy():
    """A case of the grid: a supply of next to nothing, where 2e-7 of the energy was missing."""
    oil = {
        'law': 'film', 'viscosity': 0.0857, 'width': 0.0273, 'radius': 0.0057,
        'roughness': 2.9e-4, 'supply_pressure': -99999.999, 'cavitation_pressure': -1e5,
    }  # fmt: skip
    play = {'radial': 5.82e-4, 'restitution': 0.05, 'friction': 0.3, 'contact': oil}
    torque = {'constant': -0.577, 'per_speed': -0.0324, 'per_angle': 0.0}
    machine = ms.load_scene('four_bar_clearance', {
        'joints.ground_crank.clearance': play, 'start': 'centred', 'gravity': [0.0, 0.0],
        'drive': {'start_angle': 0.367, 'speed': -8.25, 'flywheel': 0.0019, 'torque': torque},
    })  # fmt: skip
    energy = ms.simulate(machine, duration=0.3).energy
    assert abs(energy.residual) <= 1e-12 * energy.exchanged
