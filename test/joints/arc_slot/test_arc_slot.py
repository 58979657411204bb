"""A pin in an arc slot against the equations of two pendulums that keep a distance."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mechanism_sim as ms
from test.builders import made

G = 9.81
LENGTH, MASS, INERTIA = 0.1, 0.8, 2e-3  # of the crank, with its centre of gravity in the pivot
CENTRE, RADIUS = np.array([0.12, 0.03]), 0.15  # of the slot, on the arm
COG, ARM_MASS, ARM_INERTIA = 0.08, 1.5, 6e-3
PIVOT = np.array([0.2, 0.0])
ACROSS = np.array([[0.0, -1.0], [1.0, 0.0]])


def turned(angle, v):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1]])


def distance(q):
    """From the slot's centre to the pin, and the derivatives of their positions."""
    pin, centre = turned(q[0], (LENGTH, 0.0)), turned(q[1], CENTRE)
    return pin - PIVOT - centre, np.array([ACROSS @ pin, -ACROSS @ centre]).T


def motion(_, state):
    return np.concatenate([state[2:], solved(state)[:2]])


def solved(state):
    """Accelerations, and the multiplier of (Q.Q - R^2)/2."""
    q, v = state[:2], state[2:]
    Q, D = distance(q)
    row = Q @ D
    bend = np.array([-turned(q[0], (LENGTH, 0.0)), turned(q[1], CENTRE)]).T @ v**2
    inertia = np.array([INERTIA, ARM_INERTIA + ARM_MASS * COG**2])
    moment = np.array([0.0, -ARM_MASS * G * COG * np.cos(q[1])])
    matrix = np.block([[np.diag(inertia), -row[:, None]], [row[None], np.zeros((1, 1))]])
    gamma = -((D @ v) @ (D @ v) + Q @ bend)
    return np.linalg.solve(matrix, [*moment, gamma])


def machine(**joint):
    return made({
        'gravity': [0.0, -G],
        'links': {
            'ground': {'points': {'pivot': [*map(float, PIVOT)]}},
            'crank': {'length': LENGTH, 'mass': MASS, 'inertia': INERTIA, 'cog': 0.0},
            'arm': {'points': {'centre': [*map(float, CENTRE)]}, 'cog': COG, 'mass': ARM_MASS,
                    'inertia': ARM_INERTIA},
        },
        'joints': {
            'ground_crank': {'revolute': ['ground', 'crank']},
            'ground_arm': {'revolute': ['ground.pivot', 'arm']},
            'pin': {'arc_slot': ['crank.end', 'arm.centre'], 'radius': RADIUS, **joint},
        },
        'initial': {'position': {'crank': '100 deg'}}, 'guess': {'arm': '120 deg'},
    })  # fmt: skip


def test_it_moves_and_transmits_as_the_equations_of_two_pendulums_say():
    run = ms.simulate(machine(), duration=0.8)
    t = np.linspace(0.0, 0.8, 17)
    seen = run.sample(t)
    start = [seen[f'position.{link}'][0] for link in ('crank', 'arm')]
    assert np.hypot(*distance(np.array(start))[0]) == pytest.approx(RADIUS, abs=1e-12)
    own = solve_ivp(motion, (0.0, 0.8), [*start, 0.0, 0.0], 'DOP853', t, rtol=1e-12, atol=1e-13)
    assert np.ptp(own.y[1]) > 0.3
    for i, link in enumerate(('crank', 'arm')):
        assert seen[f'position.{link}'] == pytest.approx(own.y[i], abs=1e-8)
        assert seen[f'velocity.{link}'] == pytest.approx(own.y[2 + i], abs=1e-7)
    for k, state in enumerate(own.y.T):
        force = -solved(state)[2] * distance(state[:2])[0]
        pushed = [seen[f'reaction.pin.{axis}'][k] for axis in ('x', 'y')]
        assert pushed == pytest.approx(force, abs=1e-6)


def test_friction_at_the_pin_takes_its_force_times_its_slip_along_the_arc():
    run = ms.simulate(machine(friction={'coefficient': 0.1}), duration=0.3)
    h, t = 1e-6, np.array([0.12, 0.17, 0.22])
    before, now, after = (run.sample(t + k * h) for k in (-1, 0, 1))
    lost = (after['energy.dissipated'] - before['energy.dissipated']) / (2.0 * h)
    for k in range(len(t)):
        q = np.array([now['position.crank'][k], now['position.arm'][k]])
        v = np.array([now['velocity.crank'][k], now['velocity.arm'][k]])
        Q, D = distance(q)
        slip = (ACROSS @ Q / RADIUS) @ (D @ v - v[1] * ACROSS @ Q)
        force = np.array([now[f'reaction.pin.{axis}'][k] for axis in ('x', 'y')])
        pressed = abs(force @ Q) / RADIUS
        assert lost[k] == pytest.approx(0.1 * pressed * abs(slip), rel=1e-6)


def test_a_loose_pin_stays_within_its_play_of_the_arc():
    loose = machine(clearance={'radial': 1e-3, 'restitution': 0.5})
    run = ms.simulate(loose, duration=0.5)
    seen = run.sample(np.linspace(0.0, 0.5, 400))
    away = [
        np.hypot(*distance(np.array(q))[0]) - RADIUS
        for q in zip(seen['position.crank'], seen['position.arm'], strict=True)
    ]
    assert 0.9e-3 < np.abs(away).max() < 1e-3 + 1e-9


def test_without_a_radius_it_is_refused():
    with pytest.raises(ms.InputError, match=r"joints\.pin\.radius is missing.*'80 mm'"):
        machine(radius=None)


def test_a_key_of_another_kind_is_refused_with_the_article_of_its_name():
    with pytest.raises(ms.InputError, match='ratio has no meaning in an arc_slot joint'):
        machine(ratio='1/2')
