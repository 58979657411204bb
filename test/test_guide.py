"""A slider with play in its guide: the benchmark of Flores, Leine and Glocker (2010)."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from four_bars import reference

from mechanism_sim.hybrid.audit import Audit
from mechanism_sim.hybrid.event_loop import EventLoop
from mechanism_sim.hybrid.observer import Observer
from mechanism_sim.hybrid.physics import DynamicPhysics
from mechanism_sim.hybrid.snapshot import State
from mechanism_sim.hybrid.system import System
from mechanism_sim.linkages.guide import corners
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.mechanism import GROUND, Body, Mechanism, Revolute

O = (0.0, 0.0)  # noqa: E741


def slider_crank(name):
    """The benchmark as a run of the engine, ready to go."""
    ref = reference('slider_crank_guide')
    p, run = ref['parameters'], ref['runs'][name]
    bodies = (
        Body('crank', p['m1'], p['J1'], (p['l1'] / 2.0, 0.0)),
        Body('rod', p['m2'], p['J2'], (p['l2'] / 2.0, 0.0)),
        Body('slider', p['m3'], p['J3'], O),
    )
    joints = (
        Revolute('ground_crank', GROUND, 'crank', O, O),
        Revolute('crank_rod', 'crank', 'rod', (p['l1'], 0.0), O),
        Revolute('rod_slider', 'rod', 'slider', (p['l2'], 0.0), O),
    )
    mechanism = Mechanism(bodies, joints, (), (0.0, -p['g']))
    gaps = corners(mechanism, 'slider', O, p['a'], p['b'], p['c'], p['e'], run['friction'])
    q, v = (tuple(map(float, run['start'][x])) for x in ('th', 'w'))
    if run['crank'] == 'free':
        system, laws = System(mechanism, gaps, (), 1), []
    else:
        system = System(mechanism, gaps, ('crank',), 1)
        laws, q, v = [DriveLaw('crank', (q[0], v[0]))], q[1:], v[1:]
    state = State(Fraction(0), (0,) * len(q), q, v, (False,) * 4)
    run = EventLoop(system, laws, state, 1e-12, 0.0, 1e-3, compact=True, fastest=150.0)
    return run, DynamicPhysics(Observer(system))


#: name, until [s], allowed difference of angles [rad]; modes of the reference begin with the last
#: impact of a chatter that it cuts at 1e-6 m/s, which moves states by 1e-13
RUNS = [
    pytest.param('flores', 0.105, 1e-11, marks=pytest.mark.deep),
    ('flores_frictionless', 0.105, 1e-11),
    pytest.param('tilted', 0.105, 1e-11, marks=pytest.mark.deep),
    ('driven_tilted', 0.0845, 1e-11),
    ('rocking', 0.0027, 1e-12),
]


@pytest.mark.parametrize(('name', 'until', 'allowed'), RUNS)
def test_the_slider_moves_as_in_nine_cartesian_coordinates(name, until, allowed):
    run, physics = slider_crank(name)
    run.advance(until, final=True)
    motion, impacts, _ = run.drain()
    ref = reference('slider_crank_guide')['runs'][name]
    states = ref['states']
    t = states['t']
    t = t[t <= until]
    q = motion.curve(t)
    for i in range(3):
        error = np.abs(q[:, i] - states[f'th{i + 1}'][: len(t)])
        assert error.max() < allowed, i
    audit = Audit(physics)
    audit.add(motion, impacts)
    assert audit.max_penetration < 1e-12
    assert abs(audit.energy.residual) < 1e-11
    assert all(i.energy_loss > -1e-12 for i in impacts)
