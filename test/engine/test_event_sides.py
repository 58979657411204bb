"""An instant of change belongs to one side: what is said of it holds just after it.

At the end of a motion it is what held just before. Second route: the engine's polynomials were
made with the forces, loads, laws and modes that acted; their second derivative at the end of a
segment is the one-sided limit that a sample, which solves for all of them anew, has to meet.
"""

from __future__ import annotations

from base64 import b64decode
from functools import cache

import numpy as np
import pytest
from builders import made, without_work

import mechanism_sim as ms
from mechanism_sim.analysis.record import read_record
from mechanism_sim.messages.events import describe
from mechanism_sim.messages.segments import pack
from mechanism_sim.pages.live import Live
from mechanism_sim.studies.run_bag import RunBag

LOOSE = {'clearance': {'radial': 1e-4, 'restitution': 0.0}}
ROUGH = {'clearance': {'radial': 2e-4, 'restitution': 0.3, 'friction': 0.1, 'pin_radius': 0.005}}
RAMP = {'speed': None, 'profile': {'points': [[0.0, 30.0], [0.05, 40.0], [0.1, 20.0]]}}


def during(begin, end, force):
    part = {'coordinate': 'crank', 'from': f'{begin} deg', 'to': f'{end} deg'}
    return {'press': {'at': 'ram', 'force': [force, 0.0], 'during': part}}


def press(joint, loads, drive=None, start=0.3):
    """A press whose ram is loaded in a part of the cycle."""
    scene = {
        'title': 'press',
        'links': {
            'ground': {'points': {'O': [0, 0]}},
            'crank': {'length': 0.1, 'mass': 1.0, 'inertia': 0.01, 'cog': 0.05},
            'rod': {'length': 0.3, 'mass': 0.5, 'inertia': 0.004, 'cog': 0.15},
            'ram': {'mass': 1.0},
        },
        'joints': {
            'O': {'revolute': ['ground.O', 'crank.start']},
            'A': {'revolute': ['crank.end', 'rod.start'], **joint},
            'B': {'revolute': ['rod.end', 'ram']},
            'S': {'prismatic': ['ground', 'ram']},
        },
        'drive': {
            'coordinate': 'crank',
            'speed': '30 rad/s',
            'start_angle': start,
            **(drive or {}),
        },
        'loads': loads,
    }
    return made(scene, 'press')


MACHINES = {
    'pulled open': lambda: press(LOOSE, during(200, 300, 7500.0)),
    'pushed shut': lambda: press(LOOSE, during(np.degrees(0.3), 60, -7500.0)),
    'with friction': lambda: press(ROUGH, during(0, 180, -2000.0)),
    # the drive changes its acceleration at 0.05 s, when the crank is where the load begins
    'law and load': lambda: press(LOOSE, during(np.degrees(0.3 + 1.75), 180, 7500.0), RAMP),
    'laws': lambda: press(LOOSE, {}, RAMP),
    'free': lambda: press(ROUGH, during(0, 180, 300.0), {'torque': {}}),
    'ideal': lambda: press({}, during(200, 300, 7500.0), RAMP),
    'impacts': lambda: ms.load_scene('four_bar_clearance'),
    'dwells': lambda: ms.load_scene('film_advance'),
}


@cache
def solved(name):
    machine = MACHINES[name]()
    return machine, ms.simulate(machine, duration=0.25)


def boundaries(solution):
    """Ends of segments with neighbouring floats: times, and segments by the rule."""
    curve = solution.motion.curve
    start = np.unique(curve.start)[1:]
    t = np.unique([np.nextafter(start, 0.0), start, np.nextafter(start, 1.0)])
    t = np.unique(np.r_[0.0, t, solution.duration])
    segment = np.array([np.flatnonzero(curve.start <= x)[-1] for x in t])
    return t, segment


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', MACHINES)
def test_all_of_a_sample_is_of_the_side_that_the_rule_names(name):
    machine, solution = solved(name)
    curve, motion = solution.motion.curve, solution.motion
    t, k = boundaries(solution)
    assert len(t) > 30
    seen = solution.view(t)
    dt = (t - curve.start[k]) - curve.start_low[k]
    powers = dt[:, None] ** np.arange(curve.coefficients.shape[2])
    rates = curve.coefficients[k, :, 1:] * np.arange(1, curve.coefficients.shape[2])
    bends = rates[:, :, 1:] * np.arange(1, rates.shape[2])
    told = curve.duration[k] > 1e-9  # shorter pieces are fitted to too few digits to say
    velocity = np.einsum('nij,nj->in', rates, powers[:, :-1])[:, told]
    acceleration = np.einsum('nij,nj->in', bends, powers[:, :-2])[:, told]
    size = np.abs(velocity).max(axis=1, keepdims=True)
    assert (np.abs(seen.observed.velocity[:, told] - velocity) <= 1e-8 * size).all()
    size = np.abs(acceleration).max(axis=1, keepdims=True)
    assert (np.abs(seen.observed.acceleration[:, told] - acceleration) <= 1e-6 * size).all()
    assert (seen.modes == motion.modes[k].T).all()
    if machine.physics.clearances:
        force, closed = seen.observed.normal_force, seen.modes > 1
        assert closed.any()
        assert force[closed].min() >= -1e-9 * force.max()
        assert not np.abs(force[~closed]).max(initial=0.0)


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['pulled open', 'laws', 'law and load'])
def test_an_instant_of_change_differs_from_the_one_before_it(name):
    """So the rule is asked for something; there the contact is drawn open at once."""
    _, solution = solved(name)
    moment = 0.05 if 'law' in name else (np.radians(200.0) - 0.3) / 30.0
    curve = solution.motion.curve
    at = curve.start[np.abs(curve.start - moment).argmin()]
    assert at == pytest.approx(moment, abs=1e-12)
    before, now = solution.sample([np.nextafter(at, 0.0), at], 'acceleration.ram')[
        'acceleration.ram'
    ]
    assert abs(now - before) > 10.0


def test_what_begins_with_the_run_acts_from_its_first_instant_on():
    """The load begins at the very angle at which the crank starts."""
    _, solution = solved('pushed shut')
    assert solution.sample(0.0, 'normal_force.A')['normal_force.A'][0] > 4000.0
    ideal = press({}, during(np.degrees(0.3), 60, -7500.0))
    torque = ms.simulate(ideal, duration=0.01).sample([0.0, 1e-9], 'drive_torque')['drive_torque']
    assert torque[0] == pytest.approx(torque[1], rel=1e-6)


def test_an_impact_at_the_end_of_a_motion_is_not_yet_in_its_samples():
    """Its balance are those of the velocities beside them."""
    machine = ms.load_scene('four_bar_clearance', {'start': 'centred'})
    first = ms.simulate(machine, duration=0.1).impacts[0]
    solution = ms.simulate(machine, duration=first.t)
    end = solution.sample(solution.duration)
    total = [end[f'energy.{x}'][0] for x in ('kinetic', 'potential', 'drive_work', 'dissipated')]
    begin = solution.sample(0.0, 'energy.kinetic', 'energy.potential')
    start = begin['energy.kinetic'][0] + begin['energy.potential'][0]
    assert total[0] + total[1] - start == pytest.approx(total[2] - total[3], abs=1e-10)
    assert end['energy.dissipated'][0] == pytest.approx(0.0, abs=1e-15)
    assert first.energy_loss > 1e-6


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    'name',
    [
        pytest.param('pulled open', marks=pytest.mark.slow),
        'law and load', 'with friction', 'impacts',
    ],
)  # fmt: skip
def test_a_bag_says_the_same(name, tmp_path):
    """To the last bit, by a machine made anew; but for sums of the drive's work at impacts."""
    machine, solution = solved(name)
    with RunBag(tmp_path / 'run.mcap', machine, solution.duration) as bag:
        bag.add(solution)
    t, _ = boundaries(solution)
    read = read_record(tmp_path / 'run.mcap').piece
    expected, found = without_work(solution, t), without_work(read, t)
    assert len(expected) > 10
    for column in expected:
        np.testing.assert_array_equal(found[column], expected[column], err_msg=column)


def test_a_page_says_the_same_where_two_messages_meet():
    machine, solution = solved('pulled open')
    names = machine.physics.coordinates, machine.physics.clearances
    moment = (np.radians(200.0) - 0.3) / 30.0
    start = solution.motion.curve.start
    at = float(start[np.abs(start - moment).argmin()])
    live = Live(describe(machine))
    for begin, end in ((0.0, at), (at, solution.duration)):
        live.take(pack(solution.motion.between(begin, end), *names, end))
    t = np.array([np.nextafter(at, 0.0), at])
    shown = np.frombuffer(b64decode(live.frames(t)['torque']['bdata']), '<f4')
    expected = solution.sample(t, 'drive_torque')['drive_torque']
    np.testing.assert_allclose(shown, expected, rtol=1e-6)
    assert abs(expected[0] - expected[1]) > 0.01
