"""Stops of joints, links that touch, welds: tasks of people outside, and textbook cases."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml
from bags import write_bag
from builders import made
from running import run_json
from scipy.integrate import quad, solve_ivp

import mechanism_sim as ms
from mechanism_sim.analysis.record import Record, read_record
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import InputError
from mechanism_sim.scene.validation import validate

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


@pytest.mark.parametrize('end', [0.1, 0.12, 0.2])
def test_an_impact_at_which_a_step_happens_to_end_is_in_the_balance(end):
    """The longest step is 0.1 s: the next one, of no length, finds the impact."""
    scene = case('stop')
    del scene['loads']
    scene['joints']['g']['stops'] = {'upper': '0.1 m', 'restitution': 0.6}
    run = ms.simulate(made(scene), duration=end)
    assert len(run.impacts) == 1
    assert run.energy.dissipated == pytest.approx(0.5 * (1.0 - 0.6**2), rel=1e-14)
    assert abs(run.energy.residual) < 1e-15


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


@pytest.mark.parametrize('kind', ['stop', 'disc'])
def test_a_compliant_stop_or_disc_pushes_back_by_hertz(kind):
    """Deepest (5 m v^2/(4 k))^(2/5), for 2.943 deepest/v: K. L. Johnson, Contact Mechanics."""
    m, v, k = 2.0, 1.5, 1e6
    law = {'law': 'hertz', 'stiffness': k}
    guide = {'prismatic': ['ground', 'block']}
    if kind == 'stop':
        joints = {'g': {**guide, 'stops': {'upper': '0.1 m', 'restitution': 1, 'contact': law}}}
    else:
        joints = {'g': guide, 'c': {'contact': ['block', 'ground.wall'], 'restitution': 1,
                                    'radii': ['20 mm', '30 mm'], 'compliance': law}}  # fmt: skip
    machine = made({
        'links': {'ground': {'points': {'wall': ['0.15 m', '0 m']}}, 'block': {'mass': m}},
        'joints': joints,
        'initial': {'velocity': {'block': f'{v} m/s'}},
    })  # fmt: skip
    run = ms.simulate(machine, duration=0.2)
    (hit,) = run.impacts
    deepest = (1.25 * m * v**2 / k) ** 0.4
    whole, _ = quad(lambda u: 1.0 / math.sqrt(1.0 - u**2.5), 0.0, 1.0, epsabs=1e-12)
    assert hit.peak_force == pytest.approx(k * deepest**1.5, rel=1e-9)
    assert hit.duration == pytest.approx(2.0 * whole * deepest / v, rel=1e-9)
    assert last(run)[1] == pytest.approx(-v, rel=1e-9)


@pytest.mark.parametrize(
    ('apart', 'speeds'), [(0.0, [-0.6, 0.4, 0.4, 0.4, 0.4]), (1e-6, [0.0, 0.0, 0.0, 0.0, 1.0])]
)
def test_a_row_of_balls_is_struck_as_one_or_one_by_one(apart, speeds):
    """Newton's cradle without loss: Moreau's law where balls press, else velocities change hands.

    The first comes back with 1 - 2*4/5 of its speed, which with four of 2/5 keeps the energy.
    """
    balls = [f'b{k}' for k in range(5)]
    scene = {
        'links': {'ground': {}} | {b: {'mass': 0.1} for b in balls},
        'joints': {f'g_{b}': {'prismatic': ['ground', b]} for b in balls}
        | {
            f'c{k}': {'contact': [a, b], 'radii': [0.01, 0.01], 'restitution': 1}
            for k, (a, b) in enumerate(pairwise(balls))
        },
        'initial': {
            'position': {b: k * (0.02 + apart) - 0.1 * (not k) for k, b in enumerate(balls)},
            'velocity': {'b0': 1.0},
        },
        'loads': {
            'left': {'at': 'b1', 'force': [1e-9, 0]},
            'right': {'at': 'b4', 'force': [-1e-9, 0]},
        },
    }
    run = ms.simulate(made(scene), duration=0.2)
    seen = run.sample([0.2], *(f'velocity.{b}' for b in balls))
    assert [float(x[0]) for x in seen.values()] == pytest.approx(speeds, abs=1e-7)


def test_two_blocks_meet_their_stops_at_one_instant():
    scene = {
        'links': {'ground': {}, 'a': {'mass': '1 kg'}, 'b': {'mass': '2 kg'}},
        'joints': {
            name: {'prismatic': ['ground', link], 'stops': {'upper': '0.1 m', 'restitution': e}}
            for name, link, e in (('ga', 'a', 0.5), ('gb', 'b', 0.25))
        },
        'springs': {'s': {'between': ['a', 'b'], 'stiffness': '100 N/m'}},
        'initial': {'velocity': {'a': '1 m/s', 'b': '1 m/s'}},
    }
    run = ms.simulate(made(scene), duration=0.1001)
    assert [(hit.joint, float(hit.t)) for hit in run.impacts] == [
        ('ga_upper', pytest.approx(0.1, abs=1e-15)), ('gb_upper', pytest.approx(0.1, abs=1e-15)),
    ]  # fmt: skip
    assert [hit.normal_impulse for hit in run.impacts] == pytest.approx([1.5, 2.5], rel=1e-14)


@pytest.mark.parametrize(
    ('rate', 'impacts', 'mode'), [(0.0, 0, Mode.FOLLOWING), (-1.0, 1, Mode.FREE_FLIGHT),
                                  (1.0, 0, Mode.FREE_FLIGHT)],
)  # fmt: skip
def test_a_start_at_a_stop_rests_strikes_or_leaves(rate, impacts, mode):
    machine = made({
        'gravity': [0, -G],
        'links': {'ground': {}, 'arm': {'length': '1 m', 'mass': '1 kg', 'inertia': 0.1,
                                        'cog': '0.5 m'}},
        'joints': {'p': {'revolute': ['ground', 'arm'],
                         'stops': {'lower': '-60 deg', 'restitution': 0.5}}},
        'initial': {'position': {'arm': '-60 deg'}, 'velocity': {'arm': f'{rate} rad/s'}},
    })  # fmt: skip
    run = ms.simulate(machine, duration=0.01)
    assert len(run.impacts) == impacts
    assert run.modes[-1].mode == mode
    assert last(run)[1] == pytest.approx({0.0: 0.0, -1.0: 0.5, 1.0: 1.0}[rate], abs=0.1)


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
    run = ms.simulate(made(DETENT), duration=1.5)
    y, hits = reference(1.5)
    assert len(hits) == len(run.impacts) == 2
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


# --- welds ---------------------------------------------------------------------------------------

BENT = """
gravity: [0, -9.81]
links:
  ground: {}
  a: {length: 0.5 m, mass: 1 kg, inertia: 0.02, cog: 0.25 m}
  b: {length: 0.3 m, mass: 2 kg, inertia: 0.03, cog: 0.15 m}
joints:
  p: {revolute: [ground, a]}
  w: {fixed: [a.end, b], angle: 90 deg}
"""


def test_two_welded_links_move_as_one_and_their_weld_carries_what_newton_says():
    """A physical pendulum of both, by SciPy; force and moment in the weld by Newton and Euler."""
    run = ms.simulate(made(BENT), duration=1.0)
    cog = np.array([(0.25 + 2.0 * 0.5) / 3.0, 2.0 * 0.15 / 3.0])
    J = 0.02 + 0.25**2 + 0.03 + 2.0 * (0.5**2 + 0.15**2)

    def turn(angle, v):
        c, s = math.cos(angle), math.sin(angle)
        return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1]])

    def rates(_, y):
        return [y[1], -3.0 * G * turn(y[0], cog)[0] / J]

    q, w = solve_ivp(rates, (0, 1.0), [0.0, 0.0], method='DOP853', rtol=1e-13, atol=1e-14).y[:, -1]
    assert last(run) == pytest.approx([q, w], abs=1e-9)
    a, arm = rates(0, [q, w])[1], turn(q, [0.0, 0.15])
    at = turn(q, [0.5, 0.15])
    force = 2.0 * (a * np.array([-at[1], at[0]]) - w**2 * at + np.array([0.0, G]))
    seen = run.sample(1.0, 'reaction.w')
    assert [*seen['reaction.w.x'], *seen['reaction.w.y']] == pytest.approx(force, abs=1e-8)
    moment = 0.03 * a + arm[0] * force[1] - arm[1] * force[0]
    assert seen['reaction.w.moment'] == pytest.approx(moment, abs=1e-8)


def test_a_weld_to_the_ground_and_a_chain_of_welds_leave_one_coordinate():
    scene = yaml.safe_load(BENT)
    scene['links'] |= {'c': {'length': '0.2 m', 'mass': '1 kg', 'inertia': 0.01}, 'wall': {}}
    scene['links']['wall'] = {'length': '1 m', 'mass': '5 kg', 'inertia': 1.0}
    scene['joints'] |= {
        'v': {'fixed': ['b.end', 'c'], 'angle': '-30 deg'},
        'u': {'fixed': ['ground', 'wall'], 'angle': '45 deg'},
    }
    machine = made(scene)
    assert machine.mechanism.coordinates == ('a',)
    place = machine.mechanism.locate('c', {'a': 0.0}, (0.2, 0.0))
    away = [0.5 + 0.2 * math.cos(math.pi / 3), 0.3 + 0.2 * math.sin(math.pi / 3)]
    assert place == pytest.approx(away, abs=1e-15)
    assert machine.mechanism.locate('wall', {'a': 0.0}, (1.0, 0.0)) == pytest.approx(
        [0.5**0.5] * 2
    )


def test_a_weld_within_a_loop_makes_a_bell_crank():
    """A four-bar with a coupler of two welded links moves as one with a single coupler."""
    straight = {
        'links': {
            'ground': {'points': {'pivot': ['0.4 m', '0 m']}},
            'crank': {'length': '0.1 m'},
            'one': {'length': '0.2 m'},
            'two': {'length': '0.15 m'},
            'rocker': {'length': '0.3 m'},
        },
        'joints': {
            'a': {'revolute': ['ground', 'crank']},
            'b': {'revolute': ['crank.end', 'one']},
            'w': {'fixed': ['one.end', 'two'], 'angle': '20 deg'},
            'c': {'revolute': ['two.end', 'rocker.end']},
            'd': {'revolute': ['rocker', 'ground.pivot']},
        },
        'drive': {'speed': '10 rad/s'},
        'guess': {'one': '50 deg', 'rocker': '100 deg'},
    }
    run = ms.simulate(made(straight), duration=0.3)
    end = 0.2 + 0.15 * np.exp(1j * math.radians(20.0))
    plain = {k: v for k, v in straight['links'].items() if k not in ('one', 'two')}
    plain['one'] = {'points': {'far': [float(end.real), float(end.imag)]}}
    joints = {k: v for k, v in straight['joints'].items() if k not in ('w', 'c')}
    joints['c'] = {'revolute': ['one.far', 'rocker.end']}
    other = ms.simulate(made({**straight, 'links': plain, 'joints': joints}), duration=0.3)
    t = np.linspace(0.0, 0.3, 7)
    for name in ('position.rocker', 'velocity.one', 'acceleration.rocker'):
        assert run.sample(t, name)[name] == pytest.approx(other.sample(t, name)[name], abs=1e-9)


# --- bags, nodes, long runs ----------------------------------------------------------------------

EVERY = """
title: Stops of every kind
mechanism: linkage
gravity: [0, -9.81]
links:
  ground: {points: {q: [0 m, -0.6 m], o: [0 m, -1 m], l: [1 m, 0.5 m], r: [2 m, 0.3 m]}}
  arm: {length: 1 m, mass: 1 kg, inertia: 0.1, cog: 0.5 m}
  tip: {length: 0.1 m, mass: 0.1 kg, inertia: 0.001}
  block: {mass: 1 kg}
  ball: {mass: 1 kg, inertia: 0.01}
joints:
  p: {revolute: [ground, arm], stops: {lower: -60 deg, upper: 30 deg, restitution: 0.5}}
  w: {fixed: [arm.end, tip], angle: 30 deg}
  g: {prismatic: [ground.q, block], axis: 20 deg, stops: {lower: -0.1 m}}
  c: {contact: [ball, ground.l], to: ground.r, radii: [0.1 m, 0.03 m], restitution: 0.5}
initial: {position: {ball.x: 1.2 m, ball.y: 0.7 m}}
duration: 0.5 s
"""


@pytest.fixture
def every(tmp_path):
    path = tmp_path / 'every.yaml'
    path.write_text(EVERY)
    return path


@pytest.mark.slow
def test_a_bag_of_stops_and_contacts_is_read_back_as_the_run(tmp_path, every):
    run = ms.simulate(ms.load_scene(every))
    assert {hit.joint for hit in run.impacts} == {'p_lower', 'g_lower', 'c'}
    record = read_record(write_bag(tmp_path / 'run.mcap', Record(run.machine, run, {})))
    assert record.digest() == run.digest()
    names = 'gap.c', 'normal_force.g_lower', 'reaction.p.moment', 'reaction.w.moment'
    t = np.linspace(0.0, 0.5, 11)
    for name in names:
        assert record.piece.sample(t, name)[name].tolist() == run.sample(t, name)[name].tolist()


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_nodes_move_stops_and_contacts_as_the_solution_does(tmp_path, every):
    bag = tmp_path / 'nodes.mcap'
    assert run_json('run', str(every), '--record', str(bag))['code'] == 0
    assert analyze(bag).digest == run_json('solve', str(every))['digest']


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
@pytest.mark.parametrize('scene', ['detent', 'hydraulic_arm'])
def test_a_detent_and_a_hydraulic_arm_run_as_nodes_and_come_back_from_their_bags(tmp_path, scene):
    bag = tmp_path / 'nodes.mcap'
    assert run_json('run', scene, '--record', str(bag))['code'] == 0
    record, run = read_record(bag), ms.simulate(scene)
    assert analyze(bag).digest == record.digest() == run.digest()
    t = np.linspace(0.0, run.duration, 11)
    for name in ('gap.detent', 'normal_force.detent') if scene == 'detent' else ('state.pushing',):
        assert record.piece.sample(t, name)[name].tolist() == run.sample(t, name)[name].tolist()


@pytest.mark.parametrize('count', [1000, pytest.param(10_000, marks=pytest.mark.slow)])
def test_ten_thousand_bounces_between_stops_on_a_wheel_lose_no_digits(count):
    """Elastic stops, 30 deg to either side on a wheel at constant speed: a bounce takes 2 h/v."""
    h, v = math.radians(30.0), 4.0
    machine = made({
        'links': {'ground': {}, 'wheel': {'mass': '1 kg', 'inertia': 1.0},
                  'hand': {'mass': '1 kg', 'inertia': 0.1}},
        'joints': {'a': {'revolute': ['ground', 'wheel']},
                   'b': {'revolute': ['wheel', 'hand'],
                         'stops': {'lower': '-30 deg', 'upper': '30 deg', 'restitution': 1}}},
        'drive': {'coordinate': 'wheel', 'speed': '7 rad/s'},
        'initial': {'velocity': {'hand': f'{7.0 + v} rad/s'}},
    })  # fmt: skip
    run = ms.simulate(machine, duration=(2.0 * count + 0.5) * h / v)
    assert len(run.impacts) == count
    n = np.arange(count)
    at = np.array([float(hit.t) for hit in run.impacts])
    assert at == pytest.approx((2 * n + 1) * h / v, rel=1e-12)
    assert [hit.joint for hit in run.impacts[-2:]] == ['b_upper', 'b_lower']


def test_a_stop_behind_ten_thousand_turns_is_met_where_it_is():
    machine = made({
        'links': {'ground': {}, 'wheel': {'mass': '1 kg', 'inertia': 1.0}},
        'joints': {'a': {'revolute': ['ground', 'wheel'],
                         'stops': {'upper': '3600090 deg', 'restitution': 0.5}}},
        'initial': {'velocity': {'wheel': '100 rad/s'}},
    })  # fmt: skip
    (hit,) = ms.simulate(machine, duration=700.0).impacts
    assert float(hit.t) == pytest.approx((2e4 * math.pi + math.pi / 2) / 100.0, rel=1e-14)


# --- mistakes ------------------------------------------------------------------------------------

TWO_LINKS = """
links:
  ground: {points: {o: [0 m, 1 m]}}
  arm: {length: 1 m, mass: 1 kg, inertia: 0.1, cog: 0.5 m}
  block: {length: 0.1 m, mass: 1 kg, inertia: 0.1}
joints:
  p: {revolute: [ground, arm]}
  g: {prismatic: [ground.o, block]}
"""
DISCS = {'contact': ['arm.end', 'block'], 'radii': ['10 mm', '10 mm']}
HELD = {'fixed': ['arm.end', 'block']}


@pytest.mark.parametrize(
    ('given', 'said'),
    [
        ({'joints.p.stops': {'restitution': 0.5}}, "joints.p.stops needs 'lower' or 'upper'"),
        (
            {'joints.g.stops': {'lower': '1 m', 'upper': '0 m'}},
            'joints.g.stops has lower = 1 m, which must be less than upper = 0 m',
        ),
        (
            {'joints.g.stops': {'upper': '30 deg'}},
            'joints.g.stops.upper is given in rad, but it is a displacement, in m',
        ),
        (
            {'joints.p.stops': {'upper': '30 deg', 'friction': 0.2}},
            'joints.p.stops.friction has no effect: nothing slides along the stops of a revolute',
        ),
        (
            {'joints.g.stops': {'upper': '30 mm', 'radius': '10 mm'}},
            'joints.g.stops.radius is for angles: a prismatic joint stops in line',
        ),
        ({'joints.p.stops': {'uper': '30 deg'}}, "'joints.p.stops.uper'; did you mean 'upper'?"),
        (
            {'joints.p.stops': {'upper': '30 deg', 'restitution': 1.5}},
            'joints.p.stops.restitution = 1.5 is out of bounds: it must be at most 1',
        ),
        (
            {'joints.p.stops': {'upper': '-30 deg'}},
            'the start puts the joint p beyond its upper stop at -30 deg, by 0.523599 m',
        ),
        (
            {'joints.p.stops': {'upper': '80 deg'}, 'drive': {'coordinate': 'arm', 'speed': 1.0}},
            'the drive takes the joint p beyond its upper stop at 80 deg, before t = 1.39',
        ),
        (
            {'joints.p.stops': {'upper': '30 deg', 'contact': {'law': 'hertz'}}},
            "joints.p.stops.contact: 'stiffness' is missing: the law hertz needs it",
        ),
        ({'joints.c': {'contact': ['arm.end', 'block']}}, 'joints.c.radii is missing'),
        ({'joints.c': {**DISCS, 'to': 'arm'}}, 'joints.c.to = arm must be another point of block'),
        (
            {'joints.c': {**DISCS, 'radii': ['1 m', '1 m']}},
            'the start puts arm into block in the contact c, by 0.585786 m',
        ),
        (
            {'joints.c': {**DISCS, 'clearance': {'radial': '1 mm', 'restitution': 0.5}}},
            'joints.c cannot have a clearance: links in contact separate by themselves',
        ),
        (
            {
                'joints.c': {**DISCS, 'compliance': {'law': 'hertz', 'stiffness': 1e6}},
                'joints.p.stops': {'upper': '30 deg'},
            },
            'either all loose joints and stops are compliant or none is',
        ),
        ({'joints.g': HELD, 'guess': {'block': 0.1}}, 'guess.block: block is welded and moves'),
        (
            {'joints.g': HELD, 'drive': {'coordinate': 'block', 'speed': 1.0}},
            'block is welded and moves with arm: name that',
        ),
        (
            {'joints.g': HELD, 'joints.p': {'fixed': ['ground', 'arm']}},
            'all links are welded to the ground: nothing can move',
        ),
    ],
)
def test_a_mistake_is_answered_by_a_sentence(given, said):
    scene = yaml.safe_load(TWO_LINKS)
    for path, value in given.items():
        *parts, key = path.split('.')
        place = scene
        for part in parts:
            place = place[part]
        place[key] = value
    with pytest.raises(InputError) as refused:
        validate(made(scene), 1.5)
    assert said in str(refused.value)
