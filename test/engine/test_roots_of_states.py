"""States that a root brings to zero in a finite time: emptied tanks, pressures at end stops."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy

import mechanism_sim as ms
from mechanism_sim.errors import RunError

EMPTY = 2e-11  # of a scale of 1, which is integrated as 2


def tank(start, rate):
    """An arm at rest, and a level h [m] besides."""
    return f"""
title: tank
mechanism: linkage
links: {{arm: {{length: 1 m, mass: 1 kg, inertia: 1 kg m^2}}}}
joints: {{pivot: {{revolute: [ground, arm]}}}}
drive: {{coordinate: arm, torque: {{}}}}
states: {{h: {{start: {start}, rate: "{rate}"}}}}
"""


def level(scene, times):
    run = ms.simulate(scene, duration=float(np.max(times)))
    return run.sample(np.array(times))['state.h']


@pytest.mark.parametrize('root', ['sqrt(max(h, 0))', 'max(0, h)^0.5', 'sqrt(max(h, 0, -h))'])
def test_a_tank_runs_empty_as_torricelli_says_and_stays_so(root):
    t = np.array([0.0, 0.5, 1.9, 1.999, 2.0, 2.5, 100.0])
    left = np.maximum(1.0 - t / 2.0, 0.0) ** 2
    assert level(tank(1, f'-{root}'), t) == pytest.approx(left, abs=EMPTY)


def test_how_little_is_none_goes_by_the_scale_of_a_state():
    """``sqrt(h) = sqrt(h0) - t/2``, of levels that are 1e-12 of a unit."""
    start, t = 4e-12, np.array([0.0, 1e-6, 3e-6, 1e-5])
    scene = tank('{start: 4e-12, scale: 4e-12', '-sqrt(max(h, 0))').replace('{start: {', '{')
    left = np.maximum(math.sqrt(start) - t / 2.0, 0.0) ** 2
    assert level(scene, t) == pytest.approx(left, abs=2.0 * EMPTY * start)


def test_roots_in_loads_are_as_they_are_written():
    """The arm hangs at its centre of mass, as it is given: torque over inertia."""
    load = {'at': 'arm', 'torque': 'sqrt(max(1e-13*(t + 1), 0))*1e6'}
    scene = ms.load_scene(tank(1, '0').replace('length: 1 m', 'length: 1 m, cog: 0 m'))
    end = ms.simulate(ms.load_scene(scene, {'loads': {'push': load}}), duration=1.0)
    t = np.array([0.25, 1.0])
    expected = 1e6 * np.sqrt(1e-13 * (t + 1.0))
    assert end.sample(t)['acceleration.arm'] == pytest.approx(expected, rel=1e-9)


def test_an_empty_tank_fills_empties_and_fills_again():
    """Filling, ``t = -2 sqrt(h) - 2 ln(1 - sqrt(h))``; then as Torricelli says."""
    scene = tank(0, '(1 if t < 1 or t > 3 else 0) - sqrt(max(h, 0))')

    def filled(t):
        return scipy.optimize.brentq(
            lambda r: -2.0 * r - 2.0 * math.log1p(-r) - t, 0.0, 1.0 - 1e-9, xtol=1e-15
        )

    t = [1e-6, 1e-3, 0.1, 1.0, 1.2, 2.5, 3.1, 4.0]
    top = filled(1.0)
    expected = [filled(x) ** 2 for x in t[:4]] + [(top - 0.1) ** 2, 0.0]
    expected += [filled(x) ** 2 for x in (0.1, 1.0)]
    assert level(scene, t) == pytest.approx(expected, abs=2.0 * EMPTY)


def test_pressures_at_an_end_stop_are_those_of_the_ports():
    """Moment of the stop by hand: of both chambers on the rod, less the arm's weight."""
    at = math.radians(3.0)
    machine = ms.load_scene(
        'hydraulic_arm', {'joints.pivot.stops': {'upper': at, 'restitution': 0.2}}
    )
    seen = ms.simulate(machine, duration=1.0).sample(np.array([1.0]))
    assert seen['state.pushing'][0] == pytest.approx(100e5, rel=1e-9)
    assert seen['state.holding'][0] == pytest.approx(1e5, rel=1e-8)
    rod, base = 0.25 * np.array([math.cos(at), math.sin(at)]), np.array([0.0, -0.25])
    along = (rod - base) / np.linalg.norm(rod - base)
    force = 10e-4 * 100e5 - 6e-4 * 1e5
    moment = force * (rod[0] * along[1] - rod[1] * along[0])
    moment -= 120.0 * 9.81 * 0.5 * math.cos(at)
    assert abs(seen['reaction.pivot.moment'][0]) == pytest.approx(moment, rel=1e-6)


@pytest.mark.slow
def test_a_bare_root_that_reaches_zero_says_how_it_is_written():
    states = ms.load_scene('hydraulic_arm').scene.to_document()['states']
    bare = {
        f'states.{name}.rate': states[name]['rate'].replace('max(', '(').replace(', 0)', ')')
        for name in states if name != 'valve'
    }  # fmt: skip
    stops = {'joints.pivot.stops': {'upper': '3 deg', 'restitution': 0.2}}
    machine = ms.load_scene('hydraulic_arm', stops | bare)
    with pytest.raises(RunError, match=r'write sqrt\(max\(x, 0\)\)'):
        ms.simulate(machine, duration=1.0)
