"""Friction of compliant contacts as deep as their radii or clearances let them be."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mechanism_sim as ms

K, MU, PUSH = 2e5, 0.3, 200.0
MASSES, INERTIAS = (2.0, 3.0), (0.01, 0.02)


LAW = {'law': 'hertz', 'stiffness': f'{K} N/m^1.5'}


def pair(joint, places, spins, speed):
    """Two links without weight in one contact; the first comes in along x."""
    (m1, m2), (i1, i2) = MASSES, INERTIAS
    far = {'contact': ['two.p', 'ground.far'], 'radii': [1, 1], 'compliance': LAW}
    return {
        'mechanism': 'linkage',
        'links': {
            'ground': {'points': {'far': [100, 0]}},
            'one': {'mass': m1, 'inertia': i1, 'points': {'p': [0, 0]}},
            'two': {'mass': m2, 'inertia': i2, 'points': {'p': [0, 0], 'q': [0, 5]}},
        },
        'joints': {'touch': joint, 'far': far},  # never

        'gravity': [0, 0],
        'loads': {'push': {'at': 'one', 'force': [PUSH, 0]}},
        'start': 'centred',
        'initial': {
            'position': {'one.p': places, 'two.p': [0, 0]},
            'velocity': {'one.x': speed, 'one': spins[0], 'two': spins[1]},
        },
    }  # fmt: skip


def planar(kind, r1, room):
    """Rates of both links: force and friction act at one point, in opposite directions."""
    (m1, m2), (i1, i2) = MASSES, INERTIAS

    def rates(_, y):
        (x1, y1, _, x2, y2, a2), (vx1, vy1, w1, vx2, vy2, w2) = y[:6], y[6:]
        q, v = np.array([x1 - x2, y1 - y2]), np.array([vx1 - vx2, vy1 - vy2])
        if kind == 'bar':
            along = np.array([-math.sin(a2), math.cos(a2)])
            across = np.array([along[1], -along[0]])
            off = across @ q
            n, depth = across * math.copysign(1.0, off), room - abs(off)
        else:
            size = max(np.hypot(*q), 1e-12)
            n, depth = q / size, (room - size if kind == 'disc' else size - room)
        at = q + r1 * n * (-1.0 if kind != 'pin' else 1.0)  # on the first's surface, from two
        if kind == 'pin':
            n = -n  # on the first link
        force = K * max(depth, 0.0) ** 1.5
        t = np.array([-n[1], n[0]])
        arm = at - q
        first = v + w1 * np.array([-arm[1], arm[0]])
        slip = t @ (first - w2 * np.array([-at[1], at[0]]))
        f = force * n - MU * force * math.copysign(1.0, slip) * t
        return [*y[6:], (f[0] + PUSH) / m1, f[1] / m1, (arm[0] * f[1] - arm[1] * f[0]) / i1,
                *(-f / m2), -(at[0] * f[1] - at[1] * f[0]) / i2]  # fmt: skip

    return rates


@pytest.mark.parametrize(
    'kind',
    ['disc', *(pytest.param(x, marks=pytest.mark.slow) for x in ('bar', 'pin'))],
)
def test_friction_is_that_of_the_normal_force_and_acts_at_one_point(kind):
    """An independent integration; and nobody turns both links together from outside."""
    r1, r2 = 0.05, 0.03
    if kind == 'pin':
        room, start = 0.02, [0, 0]
        joint = {
            'revolute': ['one.p', 'two.p'],
            'clearance': {'radial': room, 'pin_radius': r1, 'friction': MU, 'contact': LAW,
                          'restitution': 1.0},
        }  # fmt: skip
    else:
        room, start = r1 + r2, [-0.09, 0.02 if kind == 'disc' else 0.1]
        joint = {'contact': ['one.p', 'two.p'], 'radii': [r1, r2], 'friction': {'coefficient': MU},
                 'compliance': LAW}  # fmt: skip
        if kind == 'bar':
            joint['to'] = 'two.q'
    spins, t = (60.0, -3.0 if kind == 'bar' else -20.0), 0.04 if kind == 'pin' else 0.03
    solution = ms.simulate(pair(joint, start, spins, 1.5), duration=t)
    at = solution.sample([0.0, t])
    names = [f'{x}.{link}{axis}' for x in ('position', 'velocity') for link in ('one', 'two')
             for axis in ('.x', '.y', '')]  # fmt: skip
    first, last = (np.array([at[name][k] for name in names]) for k in (0, 1))
    own = solve_ivp(planar(kind, r1, room), (0, t), first, rtol=1e-10, atol=1e-13, max_step=1e-4)
    assert last == pytest.approx(own.y[:, -1], rel=1e-6, abs=1e-7)
    assert solution.max_closure_error > 0.1 * room  # it was deep
    presses = int(np.argmax(solution.sample(own.t)['normal_force.touch']))
    rates = planar(kind, r1, room)(0.0, own.y[:, presses])
    at = solution.sample([own.t[presses]])
    load = [at[f'reaction.touch.{part}'][0] for part in ('x', 'y', 'moment')]
    inertia = [*MASSES[1:] * 2, INERTIAS[1]]
    assert load == pytest.approx(np.array(inertia) * rates[9:], rel=1e-5)
