"""A slider with play in its guide: the benchmark of Flores, Leine and Glocker (2010)."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from builders import made, without_work
from four_bars import reference

import mechanism_sim as ms
from mechanism_sim.engine.audit import Audit
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.observer import Observer
from mechanism_sim.engine.physics import DynamicPhysics
from mechanism_sim.engine.snapshot import State
from mechanism_sim.engine.system import System
from mechanism_sim.joints.prismatic.contact import corners
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.mechanism import Mechanism, Prismatic, Revolute
from mechanism_sim.planar.points import GROUND
from test.grid.case import variant

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
        Prismatic('guide', GROUND, 'slider', O, O),
    )
    mechanism = Mechanism(bodies, joints, ('guide',), (0.0, -p['g']))
    size = 2.0 * p['a'], 2.0 * p['b']
    gaps = [
        *corners(mechanism, 'guide', size, p['c'], restitution=p['e'], friction=run['friction'])
    ]
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
    pytest.param('flores', 0.105, 1e-11, marks=pytest.mark.slow),
    ('flores_frictionless', 0.105, 1e-11),
    pytest.param('tilted', 0.105, 1e-11, marks=pytest.mark.slow),
    ('driven_tilted', 0.0845, 1e-11),
    ('rocking', 0.0027, 1e-12),
]


@pytest.mark.sample(1)
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


def test_the_scene_is_the_benchmark():
    solution = ms.simulate(ms.load_scene('slider_with_play'))
    states = reference('slider_crank_guide')['runs']['flores']['states']
    seen = solution.sample(states['t'], 'position')
    for i, link in enumerate(('crank', 'rod', 'slider')):
        error = np.abs(seen[f'position.{link}'] - states[f'th{i + 1}'])
        assert error.max() < 1e-11, link


def turned(angle, at):
    """The scene, as it stands elsewhere: its frame, guide and weight turned by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return variant('slider_with_play', {
        'links.ground': {'points': {'there': list(at)}},
        'joints.ground_crank.revolute': ['ground.there', 'crank'],
        'joints.guide.prismatic': ['ground.there', 'slider'],
        'joints.guide.axis': angle, 'joints.guide.angle': angle - 0.4,
        'gravity': [9.81 * s, -9.81 * c], 'guess.rod': angle,
        'initial.position.crank': angle, 'initial.velocity.crank': 150.0,
    })  # fmt: skip


@pytest.mark.slow
def test_a_guide_may_lie_anywhere():
    """And the block's frame may be turned in it."""
    angle, t = 2.2, np.linspace(0.0, 0.02, 21)
    there = made(turned(angle, (0.3, -0.2)), 'there')
    seen, here = (
        ms.simulate(there, duration=0.02),
        ms.simulate(ms.load_scene('slider_with_play'), duration=0.02),
    )
    a, b = (x.sample(t, 'position', 'reaction.guide') for x in (seen, here))
    for link, off in (('crank', angle), ('rod', angle), ('slider', angle - 0.4)):
        assert a[f'position.{link}'] == pytest.approx(b[f'position.{link}'] + off, abs=1e-9)
    assert len(seen.impacts) == len(here.impacts) > 20
    force = [x['reaction.guide.x'] + 1j * x['reaction.guide.y'] for x in (a, b)]
    assert force[0] == pytest.approx(np.exp(1j * angle) * force[1], abs=1e-5)


@pytest.mark.slow
def test_a_guide_that_turns():
    """A block in the guide of a rotating link, against the same by polar coordinates.

    Pressed on one wall by Coriolis' force, it slides outwards: r'' = w^2 r - 2 mu w r'.
    """
    mu, w, play = 0.2, 10.0, 1e-3
    scene = {
        'title': 'arm',
        'links': {'arm': {'length': 1.0, 'mass': 1.0, 'inertia': 0.1},
                  'block': {'mass': 0.5, 'inertia': 1e-3}},
        'joints': {'pivot': {'revolute': ['ground', 'arm']},
                   'guide': {'prismatic': ['arm', 'block'], 'clearance': {
                       'radial': play, 'length': 0.04, 'height': 0.02, 'restitution': 0.0,
                       'friction': mu}}},
        'drive': {'coordinate': 'arm', 'speed': w}, 'guess': {'block': 0.1}, 'start': 'centred',
    }  # fmt: skip
    solution = ms.simulate(made(scene, 'arm'), duration=0.2)
    t = np.linspace(0.05, 0.2, 16)
    seen = without_work(solution, t)
    x, y = (seen[f'position.block.{axis}'] for axis in 'xy')
    along = x * np.cos(w * t) + y * np.sin(w * t)
    across = -x * np.sin(w * t) + y * np.cos(w * t)
    assert across == pytest.approx(np.full(16, -play), abs=1e-12)
    rate = np.gradient(along, t)
    grows = w * (np.hypot(1.0, mu) - mu)  # the root of s^2 + 2 mu w s = w^2
    falls = -w * (np.hypot(1.0, mu) + mu)
    one, two = np.exp(np.outer(t, [grows, falls])).T
    # friction of the centrifugal force's own offset adds a constant: r0 = mu play
    terms = np.linalg.lstsq(np.column_stack([one, two, np.ones(16)]), along, rcond=None)
    assert np.abs(np.column_stack([one, two, np.ones(16)]) @ terms[0] - along).max() < 1e-9
    assert rate[-1] > 0.0
    assert abs(solution.energy.residual) < 1e-11


@pytest.mark.parametrize('scene', ['dump_truck', 'loader'])
def test_a_driven_slider_may_stand_first_in_its_guide(scene):
    """From a rod its cylinder lies the other way: the same machine, and the same motion."""
    machine = ms.load_scene(scene)
    guides = {j.name: j for j in machine.mechanism.joints if isinstance(j, Prismatic)}
    turned = ms.load_scene(
        scene,
        {
            f'joints.{name}': {'prismatic': [j.second, j.first], 'axis': np.pi}
            for name, j in guides.items()
        },
    )
    assert machine.plan.laws.keys() == turned.plan.laws.keys()
    names = [
        f'{kind}.{j.second}' for j in guides.values() for kind in ('position', 'acceleration')
    ]
    names += [f'drive_torque.{j.second}' for j in guides.values()]
    first, second = (
        ms.simulate(m).sample(np.linspace(0.0, 0.7, 8), *names) for m in (machine, turned)
    )
    for name in names:
        assert second[name] == pytest.approx(first[name], rel=1e-9, abs=1e-9)
