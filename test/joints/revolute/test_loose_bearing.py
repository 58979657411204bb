"""A pin that rolls in its bushing, and a ring that rolls on its pin, by their closed forms."""

import numpy as np
import pytest
from builders import made, without_work

import mechanism_sim as ms

PIN, CLEARANCE, MASS, INERTIA, GRAVITY = 6e-3, 2e-3, 1.5, 4e-5, 9.81


@pytest.mark.sample(1)
@pytest.mark.parametrize(('first', 'radius'), [(True, PIN), (False, PIN + CLEARANCE)])
def test_what_is_loose_rolls_as_a_pendulum(first, radius):
    """Its centre is c from the fixed one: ``c (1 + J/(m r^2)) a'' = -g sin a``, r its surface's.

    Rolling on the fixed surface it turns at ``-c a'/r`` as a pin, which rolls inside, and at
    ``c a'/r`` as a ring around.
    """
    ends = ['loose', 'ground.hole'] if first else ['ground.hole', 'loose']
    machine = made({
        'links': {'ground': {'points': {'hole': [0.0, 0.0]}},
                  'loose': {'mass': MASS, 'inertia': INERTIA}},
        'joints': {'hole': {'revolute': ends, 'clearance': {
            'radial': CLEARANCE, 'pin_radius': PIN, 'restitution': 0.0, 'friction': 'rough'}}},
        'gravity': [0.0, -GRAVITY], 'start': 'centred',
        'initial': {'velocity': {'loose.x': 0.1}},
    })  # fmt: skip
    solution = ms.simulate(machine, duration=0.1)
    t = np.linspace(solution.impacts[-1].t + 1e-3, 0.1, 40)
    seen = without_work(solution, t)
    x, y, vx, vy, ax, ay = (
        seen[f'{q}.loose.{k}'] for q in ('position', 'velocity', 'acceleration') for k in 'xy'
    )
    c = CLEARANCE
    assert np.hypot(x, y) == pytest.approx(np.full(40, c), rel=1e-9)
    rate, second = (x * vy - y * vx) / c**2, (x * ay - y * ax) / c**2
    assert np.ptp(rate) > 10.0  # it swings
    expected = -GRAVITY * (x / c) / (c * (1.0 + INERTIA / (MASS * radius**2)))
    assert second == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())
    way = -1.0 if first else 1.0
    assert seen['velocity.loose'] == pytest.approx(way * c * rate / radius, rel=1e-6, abs=1e-6)
