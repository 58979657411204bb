"""Belts and chains: statics of strands, vibrations in closed form, SciPy where one is slack."""

from __future__ import annotations

import numpy as np
import pytest
from absolute import cross
from builders import made, without_work
from scipy.integrate import solve_ivp

import mechanism_sim as ms
from mechanism_sim.engine.events import StopReason
from mechanism_sim.errors import InputError
from mechanism_sim.export.skeleton import skeleton_of
from mechanism_sim.scene.check import check

J1, J2, R1, R2, K = 0.003, 0.08, 0.04, 0.1, 5e4
CENTRES = np.array([0.4, 0.1])


def drive(belt=(), **more):
    """Two rotors without friction, of which the first may be driven."""
    data = {
        'title': 'belt',
        'links': {
            'ground': {'points': {'far': [0.4, 0.1]}},
            'a': {'mass': 1, 'inertia': J1},
            'b': {'mass': 1, 'inertia': J2},
        },
        'joints': {
            'one': {'revolute': ['ground', 'a']},
            'two': {'revolute': ['ground.far', 'b']},
            'belt': {'belt': ['a', 'b'], 'radii': [R1, R2], **dict(belt)},
        },
        'drive': {'coordinate': 'a', 'torque': {}},
        **more,
    }
    return made(data, 'belt')


def strands(crossed):
    """Points on both pulleys where the strands touch, by the angle of the tangent."""
    d, s = np.hypot(*CENTRES), -1.0 if crossed else 1.0
    u = CENTRES / d
    found = []
    for side in (1.0, -1.0):
        turn = side * np.arccos((R1 - s * R2) / d)
        c, sn = np.cos(turn), np.sin(turn)
        n = np.array([c * u[0] - sn * u[1], sn * u[0] + c * u[1]])
        found.append((R1 * n, CENTRES + s * R2 * n))
    return found


@pytest.mark.sample(2)
@pytest.mark.parametrize('crossed', [False, True])
@pytest.mark.parametrize('stiff', [False, True])
def test_the_strands_balance_on_both_pulleys(crossed, stiff):
    given = {'stiffness': K, 'pretension': 300.0} if stiff else {}
    machine = drive(
        {'crossed': crossed, **given}, drive={'coordinate': 'a', 'torque': {'constant': 3}},
        loads={'brake': {'at': 'b', 'torque': '-0.2*b_rate'}}, duration=0.3,
    )  # fmt: skip
    x = without_work(ms.simulate(machine), np.array([0.011, 0.07, 0.29]))
    force = np.array([x[f'reaction.belt.{axis}'] for axis in 'xy'])
    moment = x['reaction.belt.moment']
    for k in range(3):
        # tensions that give the moment and, with the pretension, the force
        (p1, p2), (q1, q2) = strands(crossed)
        ways = [(b - a) / np.hypot(*(b - a)) for a, b in ((p1, p2), (q1, q2))]
        levers = [-cross(at - CENTRES, t) for at, t in zip((p2, q2), ways, strict=True)]
        both = np.linalg.solve([levers, [1.0, 1.0]], [moment[k], 600.0 if stiff else 0.0])
        assert force[:, k] == pytest.approx(-both[0] * ways[0] - both[1] * ways[1], abs=1e-9)
        on_first = sum(t * cross(at, way) for t, at, way in zip(both, (p1, q1), ways, strict=True))
        accelerated = x['acceleration.a'][k] * J1 - 3.0
        assert on_first == pytest.approx(accelerated, abs=1e-9)
    assert x['reaction.one.x'] == pytest.approx(x['reaction.belt.x'], abs=1e-9)


@pytest.mark.parametrize(('pretension', 'pulling'), [(100.0, 2), (0.0, 1)])
def test_rotors_swing_against_each_other_as_their_strands_let_them(pretension, pulling):
    machine = drive(
        {'stiffness': K, 'pretension': pretension}, duration=0.05,
        initial={'velocity': {'a': 0.5, 'b': 0}},
    )  # fmt: skip
    solution = ms.simulate(machine)
    assert solution.stop_reason is StopReason.COMPLETE
    t = np.linspace(0.0, 0.05, 501)
    omega = np.sqrt(pulling * K * (R1**2 / J1 + R2**2 / J2))
    x = solution.sample(t, 'position.a', 'position.b')
    stretch = R1 * x['position.a'] - R2 * x['position.b']
    assert stretch == pytest.approx(0.5 * R1 / omega * np.sin(omega * t), abs=1e-14)


@pytest.mark.sample(1)
@pytest.mark.parametrize('damping', [40.0, 400.0])
def test_a_strand_that_goes_slack_against_scipy(damping):
    """Its damper never makes it push: where that would, it pulls with nothing."""
    machine = drive(
        {'stiffness': K, 'damping': damping, 'pretension': 50.0},
        duration=0.05,
        initial={'velocity': {'a': 30, 'b': 0}},
        loads={'w': {'at': 'a', 'torque': '9*cos(400*t)'}},
    )
    solution = ms.simulate(machine)
    least = []

    def rate(t, y):
        x, w = R1 * y[0] - R2 * y[1], R1 * y[2] - R2 * y[3]
        taut = [50.0 + K * s * x for s in (1.0, -1.0)]
        both = [(p + damping * s * w) * (p > 0.0) for s, p in zip((1.0, -1.0), taut, strict=True)]
        least.append(min(both))
        pull = max(both[0], 0.0) - max(both[1], 0.0)
        return [y[2], y[3], (9.0 * np.cos(400.0 * t) - R1 * pull) / J1, R2 * pull / J2]

    found = solve_ivp(
        rate, (0.0, 0.05), [0.0, 0.0, 30.0, 0.0], 'DOP853', rtol=1e-12, atol=1e-14, max_step=1e-5
    )
    x = solution.sample(np.array([0.05]))
    assert x['position.a'][0] == pytest.approx(found.y[0, -1], abs=1e-7)
    assert x['velocity.b'][0] == pytest.approx(found.y[3, -1], abs=1e-5)
    assert min(least) < -10.0  # it would have pushed
    assert solution.stats.switches > 3
    assert abs(solution.energy.residual) < 1e-9


def test_a_stiff_belt_tends_to_the_ideal_one():
    loads = {'brake': {'at': 'b', 'torque': '-0.2*b_rate'}}
    moved = {
        'drive': {'coordinate': 'a', 'torque': {'constant': 1}},
        'loads': loads,
        'duration': 1,
    }
    ideal = ms.simulate(drive(**moved)).sample(np.array([1.0]), 'position.b')
    off = []
    for k in (1e4, 1e6):
        given = {'stiffness': k, 'pretension': 1000, 'damping': 100.0}
        x = ms.simulate(drive(given, **moved)).sample(np.array([1.0]), 'position.b')
        off.append(abs(x['position.b'][0] - ideal['position.b'][0]))
    assert off[1] < 0.02 * off[0] < 1e-3


@pytest.mark.parametrize(('crossed', 'groove'), [(False, None), (True, 0.7)])
def test_a_belt_holds_up_to_eulers_ratio_of_tensions_and_slips_at_it(crossed, groove):
    mu, mean, s = 0.25, 150.0, -1.0 if crossed else 1.0
    ends = strands(crossed)
    free = 2.0 * np.arccos((R1 - s * R2) / np.hypot(*CENTRES))  # of the first pulley's rim
    wrap = 2.0 * np.pi - free if crossed else min(free, 2.0 * np.pi - free)
    ratio = np.exp((mu / np.sin(0.5 * groove) if groove else mu) * wrap)
    most = 2.0 * mean * (ratio - 1.0) / (ratio + 1.0)
    torque = most * (R1 + J1 * R2**2 / (J2 * R1))  # that the second needs so much to keep up
    friction = {'coefficient': mu, **({'groove': groove} if groove else {})}
    t = np.array([0.0, 0.06, 0.1])
    for share in (0.999, 1.001):
        machine = drive(
            {'crossed': crossed, 'pretension': mean, 'friction': friction}, duration=0.1,
            drive={'coordinate': 'a', 'torque': {'constant': share * torque}},
        )  # fmt: skip
        solution = ms.simulate(machine)
        x = solution.sample(
            t, 'velocity.a', 'velocity.b', 'acceleration.b', 'reaction.belt.x', 'reaction.belt.y'
        )
        slip = R1 * x['velocity.a'] - s * R2 * x['velocity.b']
        pull = min(share, 1.0) * most
        assert s * R2 * x['acceleration.b'] == pytest.approx(pull * R2**2 / J2, rel=1e-12)
        gained = R1 * (share * torque - R1 * pull) / J1 - pull * R2**2 / J2
        assert slip == pytest.approx(gained * t, abs=1e-12)
        assert solution.energy.dissipated == pytest.approx(
            pull * 0.5 * gained * t[-1] ** 2, abs=1e-12
        )
        ways = [(q - p) / np.hypot(*(q - p)) for p, q in ends]
        force = [x['reaction.belt.x'][1], x['reaction.belt.y'][1]]
        tensions = np.linalg.solve(-np.transpose(ways), force)
        assert tensions.sum() == pytest.approx(2.0 * mean)
        if share > 1.0:
            assert tensions.max() / tensions.min() == pytest.approx(ratio, rel=1e-12)


def test_a_belt_that_slipped_holds_again():
    """A pulley that spins is caught: what it has too much goes into slip, at a constant pull."""
    friction, w = {'coefficient': 0.3}, 50.0
    machine = drive(
        {'pretension': 100, 'friction': friction}, duration=0.1,
        initial={'velocity': {'a': w, 'b': 0}},
    )  # fmt: skip
    solution = ms.simulate(machine)
    most = machine.mechanism.joint('belt').most
    stops = R1 * w / (most * (R1**2 / J1 + R2**2 / J2))
    x = solution.sample(np.array([0.5 * stops, 1.001 * stops, 0.1]), 'velocity.a', 'velocity.b')
    slip = R1 * x['velocity.a'] - R2 * x['velocity.b']
    assert slip == pytest.approx([0.5 * R1 * w, 0.0, 0.0], abs=1e-9)
    assert x['velocity.b'][2] == pytest.approx(most * R2 / J2 * stops, rel=1e-12)
    assert solution.energy.dissipated == pytest.approx(0.5 * most * R1 * w * stops, rel=1e-12)
    assert 'slips beyond a ratio of tensions' in ' '.join(check(machine).notes)


@pytest.mark.sample(2)
@pytest.mark.parametrize('crossed', [False, True])
@pytest.mark.parametrize(('driven', 'braked'), ['ab', 'ba'])
def test_a_chain_is_as_efficient_as_it_is_said_to_be(crossed, driven, braked):
    machine = drive(
        {'crossed': crossed, 'friction': {'efficiency': 0.93}},
        drive={'coordinate': driven, 'speed': 20},
        loads={'brake': {'at': braked, 'torque': f'-0.2*{braked}_rate'}},
    )
    cycle = ms.cycle(machine)
    assert cycle.efficiency == pytest.approx(0.93, rel=1e-12)
    loss = cycle['drive_power'] - 0.2 * cycle[f'velocity.{braked}'] ** 2
    assert cycle['friction_loss.belt'] == pytest.approx(loss, rel=1e-12)


def test_studies_read_a_chain_with_an_efficiency_again():
    """They write the machine out; torques on both wheels of the pull and its loss tell rates."""
    torques = np.array([1.0, 3.0])
    machine = drive({'friction': {'efficiency': 0.93}}, drive={'coordinate': 'a', 'torque': {}})
    values = {'drive.torque.constant': torques}
    found = ms.ensemble(machine, values, duration=0.1, measures=['final(velocity.a)'])
    k = 0.07 / 1.93
    pull = J2 * (R1 / R2) / R2 / (1.0 - k)  # for each rad/s^2 of the first
    exact = 0.1 * torques / (J1 + (1.0 + k) * pull * R1)
    assert found['final(velocity.a)'] == pytest.approx(exact, rel=1e-12)


def test_an_arm_that_carries_pulleys_takes_no_moment():
    """As the strands balance on their pulleys, what turns the arm is the drive alone."""
    data = {
        'joints': {
            'pivot': {'revolute': ['ground', 'arm']},
            'one': {'revolute': ['arm', 'a']},
            'two': {'revolute': ['arm.end', 'b']},
            'belt': {'belt': ['a', 'b'], 'radii': [R1, R2], 'carrier': 'arm', 'stiffness': K,
                     'pretension': 10},
        },
        'links': {
            'arm': {'length': 0.5, 'mass': 1, 'inertia': 0.1},
            'a': {'mass': 1, 'inertia': J1},
            'b': {'mass': 1, 'inertia': J2},
        },
        'drive': {'coordinate': 'arm', 'torque': {}},
        'initial': {'velocity': {'arm': 3, 'a': 20, 'b': -7}},
        'duration': 0.5,
    }  # fmt: skip
    x = ms.simulate(drive(**data)).sample(
        np.linspace(0.0, 0.5, 20), 'velocity.b', 'velocity.arm', 'velocity.a'
    )
    spin = 0.1 + 1.0 * 0.5**2  # the second rotor goes round with the arm
    spin = spin * x['velocity.arm'] + J1 * x['velocity.a'] + J2 * x['velocity.b']
    assert spin == pytest.approx(spin[0], rel=1e-11)


@pytest.mark.parametrize('crossed', [False, True])
def test_drawn_strands_touch_their_pulleys(crossed):
    machine = drive({'crossed': crossed})
    shapes = skeleton_of(machine, machine.assembly.q[:, None]).shapes
    ends = [s.outline for s in shapes if s.kind == 'belt']
    assert len(ends) == 2
    for start, end in ends:
        way = (end - start) / np.hypot(*(end - start))
        for centre, radius, at in ((np.zeros(2), R1, start), (CENTRES, R2, end)):
            assert np.hypot(*(at - centre)) == pytest.approx(radius, rel=1e-14)
            assert abs(cross(way, centre - start)) == pytest.approx(radius, rel=1e-13)


@pytest.mark.parametrize(
    ('belt', 'said'),
    [
        ({'radii': None}, 'joints.belt.radii is missing'),
        ({'radii': [0.5, 0.05]}, 'no belt goes round pulleys'),
        ({'radii': [0.3, 0.2], 'crossed': True}, 'no crossed belt goes round'),
        ({'radii': [0.0412345671, 0.1]}, 'not a ratio of whole numbers up to 10000'),
        ({'pretension': 5}, "pretension needs 'stiffness'"),
        ({'friction': {'coefficient': 0.3}}, 'pretension is missing'),
        ({'friction': {'coefficient': 0.3}, 'stiffness': 1e4, 'pretension': 9}, 'do not slip'),
        ({'friction': {'coefficient': 0.3, 'efficiency': 0.9}}, "of a chain its 'efficiency'"),
        ({'friction': {'groove': 0.6}}, "needs a 'coefficient'"),
        ({'friction': {'coefficient': 0.3, 'radius': 0.1}, 'pretension': 9}, 'radius has no mea'),
        ({'carrier': 'a'}, 'a carries the belt'),
        ({'clearance': {'radial': 1e-3, 'restitution': 0}}, 'belts and chains have strands'),
        ({'ratio': '1/2'}, 'ratio has no meaning in a belt joint'),
    ],
)
def test_what_is_no_belt_is_refused(belt, said):
    with pytest.raises(InputError, match=said):
        drive(belt)
