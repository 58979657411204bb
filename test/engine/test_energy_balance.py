"""The energy balance: measured by what was exchanged, with works whose error is estimated."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from builders import made
from scipy.integrate import quad

import mechanism_sim as ms
from mechanism_sim.cli import main
from mechanism_sim.engine.audit import Audit, Energy
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import RunError
from mechanism_sim.numerics import quadrature
from mechanism_sim.tolerances import TOLERANCES
from test.grid.run import grid


def heavy_pendulum(height=0.0, angle=0.0):
    """12 t at 10 m, let go from the height of its pivot."""
    return made(
        {
            'links': {
                'ground': {'points': {'pivot': [0.0, height]}},
                'bar': {'length': '10 m', 'cog': '10 m', 'mass': '12000 kg', 'inertia': 1.0},
            },
            'joints': {'pin': {'revolute': ['ground.pivot', 'bar']}},
            'gravity': [0.0, -9.81],
            'initial': {'position': {'bar': angle}},
        }
    )


def falling_ball(height=0.0):
    """1 t in the middle of a wide bearing, which falls on its Hertzian wall and rises again."""
    contact = {'law': 'hertz', 'stiffness': 1e10}
    return made(
        {
            'links': {
                'ground': {'points': {'hole': [0.0, height]}},
                'ball': {'mass': '1000 kg', 'inertia': 1.0},
            },
            'joints': {
                'hole': {
                    'revolute': ['ground.hole', 'ball'],
                    'clearance': {'radial': '10 mm', 'restitution': 0.5, 'contact': contact},
                }
            },
            'gravity': [0.0, -9.81],
            'start': 'centred',
        }
    )


def crank(torque):
    return made(
        {
            'links': {'crank': {'length': '1 m', 'cog': 0.0, 'mass': 1.0, 'inertia': 1.0}},
            'joints': {'pin': {'revolute': ['ground', 'crank']}},
            'drive': {'speed': '20 rad/s'},
            'loads': {'l': {'at': 'crank', 'torque': torque}},
        }
    )


@pytest.mark.sample(3)
@pytest.mark.parametrize('height', [0.0, -1.0, 1e3])
@pytest.mark.parametrize(('machine', 'duration'), [(heavy_pendulum, 20.0), (falling_ball, 0.2)])
def test_where_heights_count_from_does_not_matter(machine, duration, height):
    at_zero, moved = (ms.simulate(machine(h), duration=duration).energy for h in (0.0, height))
    assert at_zero.exchanged > 50.0
    assert abs(at_zero.residual) < 1e-10 * at_zero.exchanged
    assert moved.exchanged == pytest.approx(at_zero.exchanged, rel=0.01)  # bounces differ soon
    assert abs(moved.residual) < 1e-10 * moved.exchanged + moved.rounding
    assert moved.rounding < 1e-8 * moved.exchanged


def test_a_machine_at_rest_is_not_refused_for_the_rounding_of_its_weight():
    """Nothing is exchanged, and what the height zero rounds is not nothing."""
    machine = heavy_pendulum(10.0, -0.5 * math.pi)
    run = ms.simulate(machine, duration=20.0)
    assert run.energy.exchanged < 1e-6
    assert run.energy.share < 0.01


def test_works_of_loads_are_told_with_what_is_dissipated(capsys, tmp_path):
    """A force does 1 J on a block over half a metre: that much less is dissipated."""
    file = tmp_path / 'pushed.yaml'
    file.write_text(
        'title: pushed\nmechanism: linkage\nlinks: {block: {mass: 1 kg}}\n'
        'joints: {guide: {prismatic: [ground, block]}}\ngravity: [0, 0]\n'
        f'loads: {{push: {{at: block, force: [2 N, 0]}}}}\nduration: {math.sqrt(0.5)} s\n'
    )
    with pytest.raises(SystemExit):
        main(['solve', str(file)])
    assert 'dissipated, less work of loads -1 J' in ' '.join(capsys.readouterr().out.split())


def test_what_is_missing_of_what_was_exchanged_is_refused():
    machine = heavy_pendulum()
    solution = ms.simulate(machine, duration=1.0)
    balance = Audit(machine.physics)
    balance.add(solution.motion, solution.impacts)
    balance.judge(1.0)
    balance.dissipated = 0.02 * balance.energy.exchanged
    with pytest.raises(RunError, match='J remain'):
        balance.judge(1.0)


def test_shares_of_nothing():
    assert Energy(0.0, 0.0, 0.0, 0.0).share == 0.0
    assert Energy(0.0, 1.0, 0.0, 0.0).share == math.inf
    assert Energy(0.0, 1.0, 0.0, 0.0, exchanged=100.0).share == 0.01
    assert Energy(0.0, 1.0, 0.0, 0.0, rounding=1.0).share == 0.0


def test_a_load_that_its_nodes_miss_is_missing_in_the_balance(monkeypatch):
    """Drive and load are integrated with nodes of their own, so that both errors do not cancel.

    The crank moves as without the load, and on the longer steps of that motion it is not resolved
    unless they are parted.
    """
    machine = crank('-500*exp(-((crank-2.0)/0.05)**2)')
    motion = ms.simulate(crank(0.0), revolutions=1).motion

    def balance():
        found = Audit(machine.physics)
        found.add(motion, [])
        return found

    right = balance().energy
    assert right.drive_work == pytest.approx(25.0 * math.sqrt(math.pi), rel=1e-9)
    assert abs(right.residual) <= right.error + right.rounding
    assert not right.caveat
    loose = quadrature._QUADRATURE._replace(relative=1e9, foretold=1e9)
    monkeypatch.setattr(quadrature, '_QUADRATURE', loose)
    wrong = balance().energy
    off = abs(wrong.drive_work - right.drive_work)
    assert off > 1e-6 * right.exchanged
    assert abs(wrong.residual) > 0.1 * off
    assert wrong.error > TOLERANCES.audit.promised * wrong.exchanged
    assert 'may have an error' in wrong.caveat
    with pytest.raises(RunError, match='J remain'):
        balance().judge(1.0)


@pytest.mark.parametrize('name', ['four_bar_clearance', 'slider_crank', 'valve_train', 'punch'])
def test_works_of_packaged_scenes_are_as_exact_as_promised(name):
    machine = ms.load_scene(name)
    energy = ms.simulate(machine).energy
    assert energy.error <= TOLERANCES.audit.promised * energy.exchanged
    assert not energy.caveat
    assert abs(energy.residual) <= 1e-9 * energy.exchanged


def test_works_between_any_two_instants_add_up():
    machine = ms.load_scene('punch')
    solution = ms.simulate(machine)
    at = solution.sample(
        np.linspace(0.0, solution.duration, 37),
        'energy.dissipated',
        'energy.drive_work',
        'energy.kinetic',
        'energy.potential',
    )
    balance = (
        at['energy.kinetic'] + at['energy.potential']
        - at['energy.drive_work'] + at['energy.dissipated']
    )  # fmt: skip
    assert np.ptp(balance) < 1e-9 * solution.energy.exchanged


def test_the_command_says_error_and_what_was_exchanged(capsys):
    with pytest.raises(SystemExit):
        main(['solve', 'slider_crank', '--json'])
    energy = json.loads(capsys.readouterr().out)['energy']
    assert {'initial', 'final', 'drive_work', 'dissipated', 'residual'} < energy.keys()
    assert 0.0 <= energy['error'] <= TOLERANCES.audit.promised * energy['exchanged']


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    'name', ['four_bar_clearance', 'four_bar_nominal', 'toggle_press', 'andrews_squeezer']
)
def test_what_loads_take_is_the_rest_of_what_is_lost(name):
    """The small function beside the whole one."""
    machine = ms.load_scene(name)
    motion = ms.simulate(machine, duration=0.003).motion
    k, physics = np.arange(len(motion)), machine.physics
    nodes = quadrature.SECOND.places
    whole, account = physics.observe(motion, k, nodes), physics.account(motion, k, nodes)
    taken = physics.load_power(motion, k, nodes) if physics.takes_power else 0.0
    scale = np.abs(whole.friction_power).max() + np.abs(whole.drive_power).max() + 1e-300
    np.testing.assert_allclose(
        account.friction_power + taken, whole.friction_power, rtol=0, atol=1e-12 * scale
    )
    for energy in ('kinetic_energy', 'potential_energy'):
        expected = getattr(whole, energy)
        np.testing.assert_allclose(getattr(account, energy), expected, rtol=1e-12, atol=1e-15)


CLEARANCE_WORK = '-20*exp(-((crank-1.0)/0.02)**2)'


def test_the_work_of_a_load_on_the_crank_of_a_loose_machine():
    """The crank turns at constant speed: what the load takes is an integral over its angle."""
    loads = {'l': {'at': 'crank', 'torque': CLEARANCE_WORK}}
    machine = ms.load_scene('four_bar_clearance', {'loads': loads})
    plain = ms.load_scene('four_bar_clearance')
    start, speed = machine.drive.start
    right = quad(
        lambda angle: 20.0 * math.exp(-(((angle - 1.0) / 0.02) ** 2)),
        start, start + 2.0 * math.pi, points=[1.0, 1.0 + 2.0 * math.pi], epsabs=1e-13,
    )[0]  # fmt: skip
    assert speed > 0.0
    with_load, without = (ms.simulate(m, revolutions=1).energy for m in (machine, plain))
    assert with_load.drive_work - without.drive_work == pytest.approx(right, rel=1e-8)


KINDS_OF_LOADS = {
    'a spring and its damper': ('mass_on_spring', False),
    'constant force': ('locking_pliers', False),
    'a polynomial of the motion, switched by place': ('punch', False),
    'tanh of a speed': ('hand_pump', True),
    'a film': ('bearing_run_up', False),
    'compliant contacts': ('gear_rattle', True),
    'friction that jumps, of an ideal motion': ('rubbing_compressor', True),
}


@pytest.mark.parametrize('name', KINDS_OF_LOADS)
def test_loads_that_are_not_steep_are_accounted_with_the_drive(name):
    """In one evaluation; steep ones are integrated with nodes of their own."""
    scene, steep = KINDS_OF_LOADS[name]
    asked, machine = [], ms.load_scene(scene)
    assert machine.physics.steep is steep
    load_power = machine.physics.load_power
    machine.physics.load_power = lambda *at: asked.append(at) or load_power(*at)
    duration = min(machine.scene.duration or np.inf, 0.1 * machine.drive.period, 0.05)
    assert ms.simulate(machine, duration=duration).energy.exchanged >= 0.0
    assert bool(asked) is (steep and machine.physics.takes_power)


def test_what_hardly_moves_knows_its_energy_as_a_step_does():
    """Without weight, drive or speed: 1e-33 J of kinetic energy came and went by roundings."""
    (case,) = grid(only=['four_bar_ideal_047'])
    machine = made(case.draft().scene, case.name)
    solution = ms.simulate(machine, duration=1.0)
    assert np.abs(solution.motion.curve.coefficients[:, :, 1]).max() < 1e-14
    assert solution.energy.share == 0.0
    slow = machine.scene.model_dump(by_alias=True, exclude_unset=True)
    for speed in (1e-12, 1e-9, 1e-6, 1e-3):
        slow['drive']['speed'] = speed
        moving = ms.simulate(made(slow), duration=1.0).energy
        assert moving.rounding < 3e-13 / speed * moving.initial + 2e-11 * moving.initial


def test_one_step_from_rest_is_judged_by_how_fast_it_ends():
    """Not by how fast it begins: its kinetic energy would be rounding."""
    solution = ms.simulate(heavy_pendulum(angle=0.1), duration=0.01)
    assert len(solution.motion) == 1
    kinetic = solution.sample([0.01], 'energy.kinetic')['energy.kinetic'][0]
    assert solution.energy.rounding < 1e-6 < 1e-3 * kinetic


@pytest.mark.parametrize('duration', [1e-9, 1e-6, 1e-3])
def test_an_impact_at_the_start_counts_however_soon_the_run_ends(duration):
    """The engine hands it out before the first segment, whose step is longer than the run."""
    start = {'initial.velocity.coupler': -6.2249}  # 1e-4 rad/s into the bearing
    solution = ms.simulate(ms.load_scene('bearing_run_up', start), duration=duration)
    (first, *_) = solution.impacts
    assert first.t == 0.0
    assert first.drive_work < -1e-6
    assert abs(solution.energy.residual) < 1e-14


def test_a_contact_that_would_have_to_pull_is_named():
    """Flights that are declared contacts: their forces are those that would hold the follower."""
    run = ms.simulate('valve_train', revolutions=1)  # beyond the speed of lift-off
    assert (run.motion.modes == Mode.FREE_FLIGHT).any()
    held = replace(run.motion, modes=np.full_like(run.motion.modes, Mode.FOLLOWING))
    found = Audit(run.physics)
    found.add(held, run.impacts)
    said = rf'tensile.*: {found.min_normal_force:.3g} N in contact at t = '
    with pytest.raises(RunError, match=said) as raised:
        found.judge(1e-9)
    at = float(str(raised.value).partition('t = ')[2].split()[0])
    assert found.min_normal_force < -1.0
    assert np.abs(run.motion.curve.start - at).min() <= 1e-6 * at


@pytest.mark.slow
def test_between_two_events_of_one_instant_nothing_pulls():
    """One strand of a belt lets go as the other takes up: 6e-16 s lie between, with either's rows.

    There the pull of the damper seemed to be taken by the teeth, 5 N of it.
    """
    machine = made({
        'links': {
            'ground': {'points': {'motor': [-0.4, 0.0], 'pinion': [-0.2, 0.0]}},
            'motor': {'mass': 3.0, 'inertia': 12e-4},
            'pinion_shaft': {'mass': 1.0, 'inertia': 3e-4},
            'crank': {'length': 0.1, 'mass': 2.0, 'inertia': 0.01},
            'rod': {'length': 0.3, 'mass': 1.0, 'inertia': 0.01},
            'slide': {'mass': 30.0},
        },
        'gears': {
            'pinion': {'at': 'pinion_shaft', 'teeth': 25, 'module': 4e-3},
            'wheel': {'at': 'crank', 'teeth': 75, 'module': 4e-3},
        },
        'joints': {
            'motor_shaft': {'revolute': ['ground.motor', 'motor']},
            'pinion_bearing': {'revolute': ['ground.pinion', 'pinion_shaft']},
            'belt': {'belt': ['motor', 'pinion_shaft'], 'radii': [15.9e-3, 31.8e-3],
                     'stiffness': 2e5, 'damping': 50.0},
            'ground_crank': {'revolute': ['ground', 'crank']},
            'mesh': {'mesh': ['pinion', 'wheel'],
                     'backlash': {'width': 0.15e-3, 'restitution': 0.4}},
            'cp': {'revolute': ['crank.end', 'rod']},
            'wp': {'revolute': ['rod.end', 'slide']},
            'sl': {'prismatic': ['ground', 'slide']},
        },
        'guess': {'rod': 0.0, 'slide': 0.4},
        'drive': {'coordinate': 'motor',
                  'motor': {'stall_torque': 14.0, 'no_load_speed': 157.0796}},
    })  # fmt: skip
    run = ms.simulate(machine, duration=0.7)
    lasted = run.motion.curve.duration
    assert lasted.min() < 1e-9 * lasted.max()  # there is such an instant


def test_energy_that_is_missing_beyond_rounding_is_said():
    kept = Energy(1.0, 3.0, 4.0, 2.0 + 1e-7, exchanged=4.0, rounding=1e-15)
    assert kept.residual == pytest.approx(1e-7)
    assert not kept.caveat
    lost = replace(kept, dissipated=2.0 - 1e-5)
    assert '1e-05 J are missing in the balance, 2e-06 of what was exchanged' in lost.caveat
    assert not replace(lost, rounding=1e-5).caveat
