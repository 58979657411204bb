"""A loose pin's place in its bushing, and pins and rings that roll, by their closed forms."""

import heyoka as hy
import numpy as np
import pytest
from builders import made, without_work
from mpmath import mp, mpf

import mechanism_sim as ms
from mechanism_sim.joints.revolute.bearing import BearingClearance

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


def test_depth_and_distance_of_a_measure_are_those_of_the_pins_place():
    """``|Q| - c`` in 40 digits, from deep in the wall to a picometre beside it and far from it."""
    c, y = 2e-4, hy.make_vars('y')
    mechanism = ms.load_scene('four_bar_clearance').mechanism
    bearing = BearingClearance('coupler_rocker', mechanism, c, restitution=0.5)
    depth = hy.cfunc([bearing.depth(y)], vars=[y])
    with mp.workdps(40):
        deep = [mpf(x) for x in ('2e-5', '1e-12', '0', '-1e-12', '-1e-4')]
        measures = [float((mpf(c) ** 2 - (mpf(c) + x) ** 2) / (2 * mpf(c))) for x in deep]
    exact = pytest.approx(np.array(deep, float), rel=1e-15, abs=0.0)
    assert depth([measures])[0] == exact
    assert -bearing.distance(np.array(measures)) == exact
