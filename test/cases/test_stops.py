"""Stops of joints, links that touch, welds: tasks of people outside, and textbook cases."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from builders import made
from scipy.integrate import solve_ivp

import mechanism_sim as ms
from mechanism_sim.hybrid.events import Mode

INPUTS = Path(__file__).parent / 'inputs'
G = 9.81
DETENT = """
gravity: [0, -9.81]
links:
  ground: {points: {a: [0 m, 0 m], b: [0.2 m, 0 m]}}
  lever: {length: 0.15 m, mass: 1 kg, inertia: 0.01 kg m^2, cog: 0.05 m}
  arm: {length: 0.1 m, mass: 0.2 kg, inertia: 0.001 kg m^2, cog: 0.06 m}
joints:
  a: {revolute: [ground.a, lever]}
  b: {revolute: [ground.b, arm]}
  c: {contact: [lever.end, arm.end], radii: [10 mm, 20 mm], restitution: 0.5}
springs:
  s: {between: [ground, arm], stiffness: 2 N m/rad, free_angle: 120 deg}
initial:
  position: {lever: 60 deg, arm: 120 deg}
  velocity: {lever: -3 rad/s}
"""


def case(name):
    return yaml.safe_load((INPUTS / f'{name}.yaml').read_text())


def last(solution):
    """Coordinates and rates at the end."""
    curve = solution.motion.curve
    t = np.array([curve.end])
    return np.concatenate([curve(t)[0], curve(t, 1)[0]])


# --- stops ---------------------------------------------------------------------------------------


def test_a_block_bounces_off_a_rigid_stop():
    scene = case('stop')
    del scene['loads']
    scene['joints']['g']['stops'] = {'upper': '0.1 m', 'restitution': 0.6}
    run = ms.simulate(made(scene))
    (hit,) = run.impacts
    assert float(hit.t) == pytest.approx(0.1, abs=1e-15)
    assert hit.joint == 'g_upper'
    assert hit.normal_impulse == pytest.approx(1.6, rel=1e-15)
    x, v = last(run)
    assert v == pytest.approx(-0.6, rel=1e-15)
    assert x == pytest.approx(0.1 - 0.6 * 0.4, rel=1e-14)


def test_the_scene_with_an_elastic_stop_by_a_formula_runs_as_it_is():
    _, v = last(ms.simulate(made(case('stop'))))
    assert v == pytest.approx(-0.7292476143, abs=1e-9)


def test_a_block_that_falls_on_its_stop_comes_to_rest_there():
    """Times of a bouncing ball are a geometric series, d'Alembert: t_n = t_1 (1 + 2 sum e^k)."""
    e, h = 0.5, 0.2
    machine = made({
        'gravity': [0, -G],
        'links': {'ground': {}, 'block': {'mass': '2 kg'}},
        'joints': {'g': {'prismatic': ['ground', 'block'], 'axis': '90 deg',
                         'stops': {'lower': '0 m', 'restitution': e}}},
        'initial': {'position': {'block': f'{h} m'}},
    })  # fmt: skip
    run = ms.simulate(machine, duration=2.0)
    first = math.sqrt(2.0 * h / G)
    for n, hit in enumerate(run.impacts[:6]):
        series = first * (1.0 + 2.0 * sum(e**k for k in range(1, n + 1)))
        assert float(hit.t) == pytest.approx(series, rel=1e-12)
        assert hit.normal_impulse == pytest.approx(2.0 * (1 + e) * math.sqrt(2 * G * h) * e**n)
    rest = run.modes[-1]
    assert (rest.joint, rest.mode) == ('g_lower', Mode.FOLLOWING)
    assert rest.t == pytest.approx(first * (1.0 + 2.0 * e / (1.0 - e)), abs=2e-6)
    assert last(run) == pytest.approx([0.0, 0.0], abs=1e-12)
    seen = run.sample(1.9, 'normal_force.g_lower', 'reaction.g.y', 'gap.g_lower')
    assert seen['normal_force.g_lower'] == pytest.approx([2.0 * G])
    assert seen['reaction.g.y'] == pytest.approx([2.0 * G])
    assert seen['gap.g_lower'] == pytest.approx([0.0], abs=1e-12)


def test_a_puck_rattles_between_the_ends_of_a_guide_on_a_cart():
    """Newton's restitution between two masses; the centre of gravity keeps its speed."""
    M, m, e, half, v = 3.0, 1.0, 0.8, 0.1, 1.0
    machine = made({
        'links': {'ground': {}, 'cart': {'mass': f'{M} kg'}, 'puck': {'mass': f'{m} kg'}},
        'joints': {
            'rail': {'prismatic': ['ground', 'cart']},
            'guide': {'prismatic': ['cart', 'puck'],
                      'stops': {'lower': f'{-half} m', 'upper': f'{half} m', 'restitution': e}},
        },
        'initial': {'velocity': {'puck': f'{v} m/s'}},
    })  # fmt: skip
    run = ms.simulate(machine, duration=1.0)
    t, speed, mu = half / v, v, M * m / (M + m)
    for n, hit in enumerate(run.impacts):
        assert hit.joint == ('guide_upper', 'guide_lower')[n % 2]
        assert float(hit.t) == pytest.approx(t, rel=1e-13)
        assert hit.normal_impulse == pytest.approx((1 + e) * mu * speed, rel=1e-13)
        speed *= e
        t += 2 * half / speed
    assert len(run.impacts) == 3
    cart, puck, cart_v, puck_v = last(run)
    assert M * cart_v + m * (cart_v + puck_v) == pytest.approx(m * v, rel=1e-13)
    assert M * cart + m * (cart + puck) == pytest.approx(m * v * 1.0, rel=1e-13)


def test_a_pendulum_strikes_stops_on_both_sides():
    """SciPy from one impact to the next."""
    low, high, e, J = math.radians(-100.0), math.radians(-50.0), 0.7, 0.1 + 0.25
    machine = made({
        'gravity': [0, -G],
        'links': {'ground': {}, 'arm': {'length': '1 m', 'mass': '1 kg', 'inertia': 0.1,
                                        'cog': '0.5 m'}},
        'joints': {'p': {'revolute': ['ground', 'arm'],
                         'stops': {'lower': '-100 deg', 'upper': '-50 deg', 'restitution': e,
                                   'radius': '0.3 m'}}},
        'initial': {'position': {'arm': '-70 deg'}, 'velocity': {'arm': '6 rad/s'}},
    })  # fmt: skip
    run = ms.simulate(machine, duration=2.0)

    def above(_, y):
        return high - y[0]

    def below(_, y):
        return y[0] - low

    for event in (above, below):
        event.terminal, event.direction = True, -1
    t, y, found = 0.0, np.array([math.radians(-70.0), 6.0]), []
    while t < 2.0:
        part = solve_ivp(
            lambda _, y: [y[1], -G * 0.5 * math.cos(y[0]) / J], (t, 2.0), y, method='DOP853',
            rtol=1e-13, atol=1e-14, events=[above, below],
        )  # fmt: skip
        t, y = part.t[-1], part.y[:, -1].copy()
        if part.status == 1:
            found.append((t, 'p_upper' if part.t_events[0].size else 'p_lower',
                          (1 + e) * J * abs(y[1]) / 0.3))  # fmt: skip
            y[1] *= -e
    assert [hit.joint for hit in run.impacts] == [name for _, name, _ in found]
    assert len({name for _, name, _ in found}) == 2
    for hit, (t, _, impulse) in zip(run.impacts, found, strict=True):
        assert float(hit.t) == pytest.approx(t, abs=1e-9)
        assert hit.normal_impulse == pytest.approx(impulse, rel=1e-9)
    assert last(run) == pytest.approx(y, abs=1e-9)


def test_the_pin_of_a_slot_strikes_its_end_and_rubs_on_it():
    """Impulses: (1 + e) m v along the slot, mu of it on the rim of the pin."""
    m, J, r, mu, e, spin = 1.0, 0.01, 0.01, 0.3, 0.5, 5.0
    machine = made({
        'links': {'ground': {'points': {'o': ['0 m', '0 m']}}, 'pin': {'mass': m, 'inertia': J}},
        'joints': {'s': {'slot': ['pin', 'ground.o'],
                         'stops': {'upper': '0.1 m', 'restitution': e, 'friction': mu,
                                   'pin_radius': r}}},
        'initial': {'velocity': {'pin.x': '1 m/s', 'pin': f'{spin} rad/s'}},
    })  # fmt: skip
    run = ms.simulate(machine, duration=0.5)
    (hit,) = run.impacts
    assert hit.normal_impulse == pytest.approx((1 + e) * m)
    after = dict(zip(run.machine.mechanism.coordinates, last(run)[3:], strict=True))
    assert after['pin.x'] == pytest.approx(-e, rel=1e-13)
    assert after['pin'] == pytest.approx(spin - mu * hit.normal_impulse * r / J, rel=1e-13)


# --- links that touch ----------------------------------------------------------------------------


def test_the_detent_is_taken_as_it_is_written():
    machine = made(case('detent'))
    run = ms.simulate(machine)
    assert not run.impacts
    assert last(run) == pytest.approx([0.0] * 4, abs=0.0)


def reference(until):
    """Two levers, one on a torsion spring, whose round ends strike: SciPy between impacts."""
    e, one, two, R = 0.5, 0.15, 0.1, 0.03
    J = np.array([0.01 + 0.05**2, 0.001 + 0.2 * 0.06**2])

    def ends(y):
        (c1, c2), (s1, s2) = np.cos(y[:2]), np.sin(y[:2])
        apart = np.array([one * c1 - 0.2 - two * c2, one * s1 - two * s2])
        return apart, np.array([[-one * s1, two * s2], [one * c1, -two * c2]])

    def rates(_, y):
        turning = np.array(
            [
                -G * 0.05 * math.cos(y[0]),
                -0.2 * G * 0.06 * math.cos(y[1]) - 2.0 * (y[1] - 2.0 * np.pi / 3.0),
            ]
        )
        return [*y[2:], *(turning / J)]  # fmt: skip

    def gap(_, y):
        return np.hypot(*ends(y)[0]) - R

    gap.terminal, gap.direction = True, -1
    t, y, hits = 0.0, np.array([np.pi / 3.0, 2.0 * np.pi / 3.0, -3.0, 0.0]), []
    while t < until:
        part = solve_ivp(rates, (t, until), y, method='DOP853', rtol=1e-13, atol=1e-14,
                         events=gap, max_step=0.02)  # fmt: skip
        t, y = part.t[-1], part.y[:, -1].copy()
        if part.status == 1:
            apart, slopes = ends(y)
            row = apart @ slopes / np.hypot(*apart)
            impulse = -(1 + e) * (row @ y[2:]) / (row @ (row / J))
            y[2:] += row / J * impulse
            hits.append((t, impulse))
    return y, hits


def test_two_levers_with_round_ends_strike_as_in_a_second_route():
    run = ms.simulate(made(DETENT), duration=0.3)
    y, hits = reference(0.3)
    assert len(hits) == len(run.impacts) >= 1
    for hit, (t, impulse) in zip(run.impacts, hits, strict=True):
        assert float(hit.t) == pytest.approx(t, abs=1e-9)
        assert hit.normal_impulse == pytest.approx(impulse, rel=1e-9)
    assert last(run) == pytest.approx(y, abs=1e-9)


BALL = """
gravity: [0, -9.81]
links:
  ground: {points: {l: [0 m, 0 m], r: [1 m, 0 m]}}
  ball: {mass: 1 kg, inertia: 0.004 kg m^2}
joints:
  c: {contact: [ball, ground.l], to: ground.r, radii: [0.1 m, 0.01 m], restitution: 0.5}
"""


def test_a_ball_bounces_on_a_bar():
    """A geometric series again; nothing holds the ball but the bar."""
    place = {'ball.x': '0.2 m', 'ball.y': '0.3 m'}
    run = ms.simulate(made(BALL, **{'initial.position': place}), duration=0.45)
    first, speed = math.sqrt(2 * 0.19 / G), math.sqrt(2 * 0.19 * G)
    assert [float(hit.t) for hit in run.impacts] == pytest.approx([first, 2 * first], rel=1e-12)
    assert [hit.normal_impulse for hit in run.impacts] == pytest.approx(
        [1.5 * speed, 0.75 * speed]
    )


@pytest.mark.parametrize('mu', [0.6, 0.1])
def test_a_ball_rolls_or_slides_down_a_bar(mu):
    """Rolling: g sin a/(1 + J/(m r^2)) if friction lasts; sliding: g (sin a - mu cos a)."""
    a, r, J = math.radians(30.0), 0.1, 0.004
    beside = 0.11
    start = (0.2 * math.cos(a) + beside * math.sin(a), -0.2 * math.sin(a) + beside * math.cos(a))
    end = [f'{math.cos(a)} m', f'{-math.sin(a)} m']
    machine = made(
        BALL,
        **{
            'links.ground.points.r': end,
            'joints.c.friction': {'coefficient': mu},
            'initial.position': {'ball.x': f'{start[0]!r} m', 'ball.y': f'{start[1]!r} m'},
        },
    )
    run = ms.simulate(machine, duration=0.4)
    rolls = G * math.sin(a) / (1.0 + J / r**2)
    stuck = G * math.sin(a) - rolls <= mu * G * math.cos(a)
    faster = rolls if stuck else G * (math.sin(a) - mu * math.cos(a))
    spin = -rolls / r if stuck else -mu * G * math.cos(a) * r / J
    way = 0.5 * faster * 0.4**2
    found = dict(zip(run.machine.mechanism.coordinates, last(run)[:3], strict=True))
    assert found['ball'] == pytest.approx(0.5 * spin * 0.4**2, rel=1e-9)
    assert found['ball.x'] == pytest.approx(start[0] + way * math.cos(a), abs=1e-9)
    assert found['ball.y'] == pytest.approx(start[1] - way * math.sin(a), abs=1e-9)
    assert run.modes[-1].mode == (Mode.STICKING if stuck else Mode.SLIDING_FORWARD)


def test_a_ball_leaves_the_round_end_of_a_bar_where_nothing_presses():
    """Around the end v^2 = v0^2 + 2 g R (1 - cos a); the force is zero at v^2 = g R cos a."""
    R, v0 = 0.11, 0.5
    machine = made(
        BALL,
        **{
            'initial.position': {'ball.x': '0.9 m', 'ball.y': f'{R} m'},
            'initial.velocity': {'ball.x': f'{v0} m/s'},
        },
    )
    run = ms.simulate(machine, duration=0.5)
    cosine = (v0**2 + 2 * G * R) / (3 * G * R)
    off = run.modes[-1]
    assert off.mode == Mode.FREE_FLIGHT
    around = solve_ivp(
        lambda _, y: [y[1], G / R * math.sin(y[0])], (0.0, 1.0), [0.0, v0 / R], method='DOP853',
        rtol=1e-13, atol=1e-15, events=lambda _, y: math.cos(y[0]) - cosine,
    )  # fmt: skip
    assert off.t == pytest.approx(0.1 / v0 + around.t_events[0][0], abs=1e-9)
    place = dict(
        zip(run.machine.mechanism.coordinates, run.motion.curve(np.array([off.t]))[0], strict=True)
    )
    assert place['ball.y'] == pytest.approx(R * cosine, abs=1e-9)
    assert place['ball.x'] == pytest.approx(1.0 + R * math.sqrt(1 - cosine**2), abs=1e-9)
