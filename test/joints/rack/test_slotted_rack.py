"""A slotted rack that stands anywhere, against the closed form of its motion and of its push."""

import math

import numpy as np
import pytest
from builders import without_work

import mechanism_sim as ms

RADIUS, SPEED, MASS = 0.04, 2.0 * math.pi, 1.2


def test_a_rack_may_stand_anywhere():
    """It moves by ``r (1 - cos)`` in the half turn in which the pin is on its right."""
    axis = 2.2
    c, s = math.cos(axis), math.sin(axis)
    x, y = 0.3, -0.2
    below = [x + 0.06 * s, y - 0.06 * c]
    machine = ms.load_scene('linear_intermittent', {
        'links.ground': {'points': {'crank': [x, y], 'guide': below}},
        'joints.ground_crank.revolute': ['ground.crank', 'crank'],
        'joints.rack_ground': {
            'prismatic': ['ground.guide', 'rack'], 'axis': axis, 'angle': axis,
        },
        'drive.start_angle': axis + 0.5 * math.pi, 'gravity': [0.0, 0.0],
    })  # fmt: skip
    solution = ms.simulate(machine, revolutions=1)
    t = np.linspace(0.0, solution.duration, 99)[1:-1]
    seen = without_work(solution, t)
    turned = SPEED * t - 0.5 * math.pi  # since the pin has entered
    moving = (turned > 0.0) & (turned < math.pi)
    moved = RADIUS * np.where(moving, 1.0 - np.cos(turned), np.where(turned > 0.0, 2.0, 0.0))
    assert seen['position.rack'] == pytest.approx(moved - RADIUS, abs=1e-14)
    push = MASS * RADIUS * SPEED**2 * np.where(moving, np.cos(turned), 0.0)
    force = [seen[f'reaction.crank_rack.{k}'] for k in 'xy']
    assert force == pytest.approx(np.outer((c, s), push), abs=1e-12)
    effort = solution.sample(t, 'driven_effort.crank_rack')['driven_effort.crank_rack']
    assert effort == pytest.approx(push, abs=1e-12)
