"""Ropes, freewheels, ratchets and dogs, against closed forms and event-driven references."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from builders import made
from event_solution import Machine, Wall, apart, solve
from running import run, run_json
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import mechanism_sim as ms
from mechanism_sim.analysis.open_run import open_run
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import InputError, RunError

INPUTS = Path(__file__).parent / 'inputs'
G = 9.81
TWO = {'ground': {}, 'hub': {'mass': 1.0, 'inertia': 1.0}, 'wheel': {'mass': 1.0, 'inertia': 2.0}}
AXES = {'h': {'revolute': ['ground', 'hub']}, 'w': {'revolute': ['ground', 'wheel']}}
MOTOR = {'motor': {'at': 'hub', 'torque': '5*cos(3*t)'},
         'drag': {'at': 'wheel', 'torque': '-0.2*wheel_rate'}}  # fmt: skip


def weights(rope, a=1.0, b=2.0, **more):
    """Two weights in vertical guides, 1 m apart, and a rope between them."""
    above = {'l': [0.0, 0.0], 'r': [1.0, 0.0], 'p': [0.0, 3.0], 'o': [1.0, 3.0], 'm': [0.2, 3.0]}
    return made({
        'links': {'ground': {'points': above}, 'a': {'mass': a}, 'b': {'mass': b}},
        'joints': {'ga': {'prismatic': ['ground.l', 'a'], 'axis': '90 deg'},
                   'gb': {'prismatic': ['ground.r', 'b'], 'axis': '90 deg'}, 'rope': rope},
        'gravity': [0.0, -G], **more,
    })  # fmt: skip


def shafts(joint, **more):
    """A hub and a wheel on one axis, with a joint between them."""
    return made({'links': TWO, 'joints': {**AXES, 'own': joint}, 'gravity': [0.0, 0.0], **more})


def final(solution, *coordinates):
    """Places and rates at the end."""
    seen = solution.sample(np.array([solution.duration]), 'position', 'velocity')
    return [float(seen[f'{k}.{c}'][0]) for k in ('position', 'velocity') for c in coordinates]


# --- the cases ---------------------------------------------------------------------------------


def test_a_rope_over_a_pulley_may_be_written_as_a_transmission():
    found = run_json('solve', str(INPUTS / 'rope.yaml'))['final']
    assert found['acceleration']['a'] == pytest.approx(G / 3.0, rel=1e-13)
    assert found['reactions']['rope'] == pytest.approx([0.0, 4.0 / 3.0 * G], rel=1e-13)
    assert found['position']['b'] == pytest.approx(-G / 6.0, rel=1e-13)


@pytest.mark.parametrize('over', [['ground.p', 'ground.o'], ['ground.m']])
def test_a_rope_is_taut_between_two_weights(over):
    solution = ms.simulate(weights({'rope': ['a', *over, 'b']}), duration=0.5)
    o = solution.sample(np.array([0.25]), 'acceleration.a', 'normal_force.rope')
    if len(over) == 2:  # its strands are vertical
        assert o['acceleration.a'] == pytest.approx(G / 3.0, rel=1e-12)
        assert o['normal_force.rope'] == pytest.approx(4.0 / 3.0 * G, rel=1e-12)
    assert not solution.impacts
    assert abs(solution.energy.residual) < 1e-13


def test_a_heavy_weight_that_is_lifted_slackens_the_rope():
    """Both fall freely until the rope tightens, again and again: then it pulls.

    Every flight of the gap v t - g t^2 lasts e times as long as the one before. The rope pulls
    both weights up alike, so m_a v_a - m_b v_b never feels it.
    """
    v, e, a, b, end = 1.0, 0.3, 1.0, 2.0, 0.5
    rope = {'rope': ['a', 'ground.p', 'ground.o', 'b'], 'restitution': e}
    solution = ms.simulate(
        weights(rope, initial={'velocity': {'b': v}}), duration=end,
    )  # fmt: skip
    first, second, third = solution.impacts[:3]
    assert [first.t, second.t - first.t, third.t - second.t] == pytest.approx(
        [v / G, e * v / G, e**2 * v / G], rel=1e-11
    )
    assert first.normal_impulse == pytest.approx((1.0 + e) * v * a * b / (a + b), rel=1e-12)
    rests = [c.t for c in solution.modes if c.mode == Mode.FOLLOWING]
    assert rests == pytest.approx([v / G / (1.0 - e)], rel=1e-5)  # what is left is 1e-12 high
    speed = ((b - a) * G * end - b * v) / (a + b)
    place = (0.5 * (b - a) * G * end**2 - b * v * end) / (a + b)
    assert final(solution, 'a', 'b') == pytest.approx([place, -place, speed, -speed], abs=1e-9)


@pytest.mark.slow
def test_a_freewheel_by_a_formula_and_by_name_is_the_same():
    by_formula = run_json('solve', str(INPUTS / 'freewheel.yaml'))['final']['position']
    assert by_formula == pytest.approx({'hub': -11.6048389, 'wheel': 3.91282397}, abs=1e-7)
    solution = ms.simulate(shafts({'freewheel': ['hub', 'wheel']}, loads=MOTOR), duration=10.0)
    hub, wheel = final(solution, 'hub', 'wheel')[:2]
    assert [hub, wheel] == pytest.approx(pulsating(10.0)[:2], abs=1e-10)
    assert by_formula == pytest.approx({'hub': hub, 'wheel': wheel}, abs=1e-9)
    assert not solution.impacts


def pulsating(duration):
    """Angles and rates of hub and wheel: engaged while the clutch presses, else free."""

    def rate(engaged):
        def of(t, y):
            motor, drag = 5.0 * math.cos(3.0 * t), -0.2 * y[3]
            a = [(motor + drag) / 3.0] * 2 if engaged else [motor, 0.5 * drag]
            return [y[2], y[3], *a]

        return of

    def presses(t, y):  # moment on the wheel while engaged
        return 2.0 * (5.0 * math.cos(3.0 * t) - 0.2 * y[3]) / 3.0 + 0.2 * y[3]

    def ahead(_, y):
        return y[3] - y[2]

    t, y, engaged = 0.0, np.zeros(4), True
    while t < duration:
        event = presses if engaged else ahead
        event.terminal, event.direction = True, -1.0
        part = solve_ivp(rate(engaged), (t, duration), y, 'DOP853', events=event, rtol=1e-13,
                         atol=1e-15, first_step=1e-3)  # fmt: skip
        t, y = part.t[-1], part.y[:, -1]
        if not engaged and t < duration:
            y[2] = y[3]
        engaged = not engaged
    return y


# --- ropes -------------------------------------------------------------------------------------


def test_a_rope_with_oblique_strands_tightens_as_by_another_integrator():
    e, height = 0.6, 3.0
    legs = 0.2, 0.8

    def wall(q):
        return length - sum(np.hypot(x, height - y) for x, y in zip(legs, q, strict=True))

    def row(q):
        return np.array([(height - y) / np.hypot(x, height - y)
                         for x, y in zip(legs, q, strict=True)])  # fmt: skip

    def bend(q, v):
        return sum(-x**2 * w**2 / np.hypot(x, height - y) ** 3
                   for x, y, w in zip(legs, q, v, strict=True))  # fmt: skip

    length = sum(math.hypot(x, height) for x in legs)
    machine = Machine((1.0, 2.0), lambda _t, q, _v: -G + 0.0 * q,
                      (Wall('rope', wall, row, bend),), e, 0.02)  # fmt: skip
    reference = solve(machine, [0.0, 0.0], [0.0, 1.5], 1.0)
    rope = {'rope': ['a', 'ground.m', 'b'], 'restitution': e}
    solution = ms.simulate(weights(rope, initial={'velocity': {'b': 1.5}}), duration=1.0)
    times, impulses = apart(reference, solution.impacts, {'rope': 'rope'}, 1e-4)
    assert times < 1e-11
    assert impulses < 1e-10
    assert final(solution, 'a', 'b') == pytest.approx(reference.sample([1.0])[:, 0], abs=1e-9)


def test_a_rope_around_a_moving_pulley_halves_the_force():
    """All strands vertical: w (2 kg a_w) = 2 T - m_w g, m_a 2 a_w = m_a g - T."""
    points = {'l': [0.0, 0.0], 'g': [0.1, 0.0], 'p': [0.3, 4.0], 'r': [0.4, 0.0]}
    machine = made({
        'links': {'ground': {'points': points}, 'a': {'mass': 1.5}, 'w': {'mass': 2.0}},
        'joints': {'ga': {'prismatic': ['ground.r', 'a'], 'axis': '90 deg'},
                   'gw': {'prismatic': ['ground.g', 'w'], 'axis': '90 deg'},
                   'rope': {'rope': ['ground.top', 'w', 'ground.p', 'a'],
                            'pulleys': {'w': {'radius': 0.1}, 'ground.p': {'radius': 0.1}}}},
        'gravity': [0.0, -G],
    } | {'links': {'ground': {'points': {**points, 'top': [0.0, 4.0]}}, 'a': {'mass': 1.5},
                   'w': {'mass': 2.0}}})  # fmt: skip
    assert machine.mechanism.joint('rope').length == pytest.approx(4.0 * 3 + 0.2 * math.pi)
    solution = ms.simulate(machine, duration=1.0)
    up = G * (2.0 * 1.5 - 2.0) / (2.0 + 4.0 * 1.5)
    assert final(solution, 'w', 'a') == pytest.approx([0.5 * up, -up, up, -2.0 * up], rel=1e-12)
    tension = 1.5 * (G - 2.0 * up)
    seen = solution.sample(
        np.array([0.5]), 'normal_force.rope', 'reaction.rope.y', 'reaction.gw.x', 'reaction.ga.x'
    )
    assert seen['normal_force.rope'] == pytest.approx(tension, rel=1e-12)
    # the wrench of w's strands, and the guide that carries nothing
    assert seen['reaction.rope.y'] == pytest.approx(tension, rel=1e-12)
    assert [seen['reaction.gw.x'], seen['reaction.ga.x']] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_a_ball_on_a_string_winds_on_a_peg():
    """Along an involute it moves at l t' across the string, of which l = l0 + R t is free.

    So (l^2 t')' = l R t'^2 - g l sin(t), with the angle t of the string from the vertical.
    """
    R, free, start = 0.1, 1.0, math.radians(-60.0)

    def place(t):
        length = free + R * (t - start)
        return (R * np.cos(t) + length * np.sin(t), R * np.sin(t) - length * np.cos(t))

    def rate(_, y):
        t, w = y
        length = free + R * (t - start)
        return [w, -(R * w * w + G * np.sin(t)) / length]

    end = solve_ivp(rate, (0.0, 1.2), [start, 0.0], 'DOP853', rtol=1e-13, atol=1e-15).y[:, -1]
    x, y = place(start)
    machine = made({
        'links': {'ground': {'points': {'peg': [0.0, 0.0], 'nail': [-1.0, -0.3]}},
                  'ball': {'mass': 0.7, 'inertia': 1.0}},
        'joints': {'string': {'rope': ['ground.nail', 'ground.peg', 'ball'],
                              'pulleys': {'ground.peg': {'radius': R, 'passes': 'clockwise'}}}},
        'initial': {'position': {'ball.x': f'{x} m', 'ball.y': f'{y} m'}},
        'gravity': [0.0, -G],
    })  # fmt: skip
    solution = ms.simulate(machine, duration=1.2)
    assert final(solution, 'ball.x', 'ball.y')[:2] == pytest.approx(place(end[0]), abs=1e-10)


@pytest.mark.parametrize('first', [True, False])
def test_a_weight_unwinds_a_drum(first):
    """m a = m g - T and I a/r = T r; the drum begins after 7 turns and makes as many back."""
    mass, inertia, r, t = 2.0, 0.05, 0.1, 1.8
    course, way = ['drum', 'b'], 'clockwise'
    if not first:
        course, way = course[::-1], 'counterclockwise'
    machine = made({
        'links': {'ground': {'points': {'c': [0.0, 1.0], 'g': [r, 0.0]}},
                  'drum': {'mass': 1.0, 'inertia': inertia}, 'b': {'mass': mass}},
        'joints': {'axis': {'revolute': ['ground.c', 'drum']},
                   'guide': {'prismatic': ['ground.g', 'b'], 'axis': '90 deg'},
                   'own': {'rope': course, 'pulleys': {'drum': {'radius': r, 'passes': way}}}},
        'initial': {'position': {'drum': 14.0 * math.pi + 0.3}}, 'gravity': [0.0, -G],
    })  # fmt: skip
    a = mass * G / (mass + inertia / r**2)
    solution = ms.simulate(machine, duration=t)
    turned = final(solution, 'drum')[0] - (14.0 * math.pi + 0.3)
    assert final(solution, 'b') == pytest.approx([-0.5 * a * t**2, -a * t], rel=1e-12)
    assert turned == pytest.approx(-0.5 * a * t**2 / r, rel=1e-12)
    assert turned < -14.0 * math.pi
    seen = solution.sample(np.array([t]), 'normal_force.own', 'reaction.axis.y')
    assert seen['normal_force.own'] == pytest.approx(mass * (G - a), rel=1e-12)
    assert seen['reaction.axis.y'] == pytest.approx(G + mass * (G - a), rel=1e-12)


def test_an_elastic_rope_stretches_as_a_spring_that_only_pulls():
    """A jump: a free fall, then a swing about the place of rest, while the rope is taut."""
    mass, k, h = 70.0, 900.0, 20.0
    joint = {'rope': ['ground.top', 'a'], 'length': h,
             'compliance': {'law': 'hertz', 'stiffness': k, 'exponent': 1.0}}  # fmt: skip
    machine = made({
        'links': {'ground': {'points': {'top': [0.0, 0.0]}}, 'a': {'mass': mass}},
        'joints': {'ga': {'prismatic': ['ground', 'a'], 'axis': '90 deg'}, 'own': joint},
        'initial': {'position': {'a': '-0.001 m'}}, 'gravity': [0.0, -G],
    })  # fmt: skip
    falls = math.sqrt(2.0 * (h - 0.001) / G)
    w, v = math.sqrt(k / mass), math.sqrt(2.0 * G * (h - 0.001))
    late, rest = 0.4, mass * G / k
    down = rest - rest * math.cos(w * late) + v / w * math.sin(w * late)
    t = falls + late
    solution = ms.simulate(machine, duration=t)
    assert final(solution, 'a')[0] == pytest.approx(-h - down, rel=1e-10)
    assert solution.sample(np.array([t]), 'normal_force.own')['normal_force.own'] == pytest.approx(
        k * down, rel=1e-9
    )


# --- freewheels, ratchets and dogs ---------------------------------------------------------------


def test_an_impact_goes_through_a_freewheel_one_way():
    """Dogs strike a middle shaft, which takes the wheel along forwards and leaves it backwards."""
    for way in (1.0, -1.0):
        machine = made({
            'links': {**TWO, 'middle': {'mass': 1.0, 'inertia': 0.5}},
            'joints': {**AXES, 'm': {'revolute': ['ground', 'middle']},
                       'dogs': {'transmission': ['hub', 'middle'], 'ratio': 1,
                                'backlash': {'angle': '20 deg', 'restitution': 0.4}},
                       'own': {'freewheel': ['middle', 'wheel']}},
            'initial': {'velocity': {'hub': f'{way} rad/s', 'middle': 0.0}}, 'gravity': [0.0, 0.0],
        })  # fmt: skip
        solution = ms.simulate(machine, duration=0.2)
        driven = 2.5 if way > 0.0 else 0.5
        impulse = 1.4 * driven / (1.0 + driven)
        t = math.radians(10.0)
        assert [i.joint for i in solution.impacts if i.approach_speed > 1e-9] == [
            f'dogs_{"right" if way > 0.0 else "left"}'
        ]
        assert solution.impacts[0].t == pytest.approx(t, rel=1e-12)
        rates = final(solution, 'hub', 'middle', 'wheel')[3:]
        after = [way * (1.0 - impulse), way * impulse / driven, way * impulse / driven]
        after[2] *= way > 0.0
        assert rates == pytest.approx(after, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize('ratio', [1, '-1/2'])
def test_dogs_strike_their_stops_as_by_another_integrator(ratio):
    half, e = math.radians(6.0), 0.5
    r = -0.5 if ratio == '-1/2' else 1.0
    ones = np.array([-r, 1.0])

    def stop(name, side):
        return Wall(name, lambda q: half + side * (ones @ q),
                    lambda q: (side * ones)[(...,) + (None,) * (np.ndim(q) - 1)] + 0.0 * q,
                    lambda q, _v: 0.0 * q[0])  # fmt: skip

    def falls(t, q, v):
        return np.array([5.0 * np.cos(3.0 * t) + 0.0 * q[0], -0.1 * v[1]])

    walls = stop('left', -1.0), stop('right', 1.0)
    reference = solve(Machine((1.0, 2.0), falls, walls, e, 0.02), [0.0, 0.0], [0.0, 0.0], 3.0)
    play = {'angle': '12 deg', 'restitution': e}
    joint = {'transmission': ['hub', 'wheel'], 'ratio': ratio, 'backlash': play}
    solution = ms.simulate(shafts(joint, loads=MOTOR), duration=3.0)
    names = {'left': 'own_left', 'right': 'own_right'}
    times, impulses = apart(reference, solution.impacts, names, 1e-3)
    assert times < 1e-10
    assert impulses < 1e-9
    assert final(solution, 'hub', 'wheel') == pytest.approx(
        reference.sample([3.0])[:, 0], abs=1e-9
    )  # fmt: skip


TEETH, STROKE, WAVE, TURNED = 24, 2.0, 7.0, 7e-4  # [rad/s], [rad/s], [kg m^2] of the wheel


def indexed(brake, restitution):
    """A wheel with a brake, which a pawl that swings to and fro takes along."""
    return ms.simulate(
        made({
            'links': {'ground': {'points': {'m': [-0.12, 0.0]}},
                      'motor': {'mass': 0.4, 'inertia': 3e-4},
                      'crank': {'mass': 0.6, 'inertia': TURNED}},
            'joints': {'m': {'revolute': ['ground.m', 'motor']},
                       'c': {'revolute': ['ground', 'crank']},
                       'own': {'ratchet': ['motor', 'crank'], 'teeth': TEETH,
                               'restitution': restitution}},
            'drive': {'coordinate': 'motor', 'speed': f'{STROKE}*sin({WAVE}*t)'},
            'loads': {'brake': {'at': 'crank', 'torque': f'-{brake}*sign(crank_rate)'}},
            'gravity': [0.0, 0.0],
        }),
        duration=16.0 * 2.0 * math.pi / WAVE,
    )  # fmt: skip


def indexed_by_phases(brake, until):
    """Angle of the wheel [rad], from one change to the next: taken along, braked, at rest."""
    pitch, back = 2.0 * math.pi / TEETH, brake / TURNED
    period = 2.0 * math.pi / WAVE
    slows = math.acos(max(-back / (STROKE * WAVE), -1.0)) / WAVE  # faster than the brake does

    def pawl(t):
        return STROKE / WAVE * (1.0 - math.cos(WAVE * t))

    def before(t, leaves, ahead):
        """Of a wheel that left the pawl, which was so far behind, and is braked until it rests."""
        speed = STROKE * math.sin(WAVE * leaves)
        u = min(t - leaves, speed / back)
        return pawl(leaves) - pawl(t) + ahead + speed * u - 0.5 * back * u * u

    ahead, t = 0.0, 0.0  # of the wheel, while the pawl takes it along
    while t < until:
        leaves = max(t, period * math.floor(t / period) + slows)
        turns = period * math.ceil(leaves / period)  # there the pawl is farthest behind
        known = leaves, ahead
        ahead = pitch * math.floor(before(turns, *known) / pitch)
        t = brentq(
            lambda s, known, ahead: before(s, *known) - ahead,
            turns, turns + 0.5 * period, args=(known, ahead), xtol=1e-15,
        )  # fmt: skip
    return pawl(until) + before(until, *known)


@pytest.mark.sample(1)
@pytest.mark.parametrize('brake', [0.05, 0.002])
def test_a_ratchet_takes_a_braked_wheel_on_by_whole_teeth(brake):
    """Pawl and brake let go together where they stand still, or the wheel flies ahead."""
    solution = indexed(brake, 0.0)
    ends = 2.0 * math.pi / WAVE * np.arange(1, 17)
    expected = [indexed_by_phases(brake, t) for t in ends]
    seen = solution.sample(ends, 'position.crank')['position.crank']
    assert seen == pytest.approx(expected, abs=1e-9)
    assert abs(solution.energy.residual) < 1e-13


@pytest.mark.slow
def test_a_ratchet_without_loss_bounces_to_the_standstill_of_its_pawl():
    """There the brake undoes bounces by less than places are known."""
    solution = indexed(0.05, 1.0)
    angles = solution.sample(np.linspace(0.0, 14.3, 500), 'position.crank')['position.crank']
    assert (np.diff(angles) > -1e-11).all()
    assert abs(solution.energy.residual) < 1e-12
    assert sum(i.energy_loss for i in solution.impacts) == pytest.approx(0.0, abs=1e-12)


def test_a_ratchet_falls_back_to_its_tooth_and_strikes_it():
    """The wheel is thrown ahead and pulled back: it stops at the last tooth that it passed."""
    e, teeth, speed, back = 0.4, 24, 3.0, 2.0
    pitch = 2.0 * math.pi / teeth
    loads = {'spring': {'at': 'wheel', 'torque': -2.0 * back}}
    joint = {'ratchet': ['pawl', 'wheel'], 'teeth': teeth, 'restitution': e}
    machine = made({
        'links': {'ground': {}, 'wheel': TWO['wheel'], 'pawl': {'mass': 1.0, 'inertia': 1e6}},
        'joints': {'w': AXES['w'], 'h': {'revolute': ['ground', 'pawl']}, 'own': joint},
        'initial': {'velocity': {'wheel': f'{speed} rad/s'}}, 'loads': loads,
        'drives': {'pawl': {'speed': 0.0}}, 'gravity': [0.0, 0.0],
    })  # fmt: skip
    solution = ms.simulate(machine, duration=6.0)
    top = speed**2 / (2.0 * back)
    tooth = pitch * math.floor(top / pitch)
    drop = top - tooth
    hit = math.sqrt(2.0 * back * drop)
    first = solution.impacts[0]
    assert first.t == pytest.approx(speed / back + hit / back, rel=1e-11)
    assert first.normal_impulse * machine.mechanism.size == pytest.approx(
        2.0 * (1.0 + e) * hit, rel=1e-10
    )
    assert final(solution, 'wheel') == pytest.approx([tooth, 0.0], abs=1e-12)


@pytest.mark.slow
def test_a_ratchet_of_fine_teeth_is_a_freewheel():
    fine = {'ratchet': ['hub', 'wheel'], 'teeth': 10_000}
    solution = ms.simulate(shafts(fine, loads=MOTOR), duration=3.0)
    assert final(solution, 'hub', 'wheel')[:2] == pytest.approx(pulsating(3.0)[:2], abs=2e-3)


# --- as nodes, bags, long, and mistaken ----------------------------------------------------------

PUMP = """
title: A pump's rope
mechanism: linkage
links:
  ground: {points: {l: [0 m, 0 m], p: [0.1 m, 2 m], r: [0.3 m, 0 m]}}
  arm: {length: 0.5 m, mass: 1 kg, inertia: 0.1 kg m^2}
  hub: {mass: 1 kg, inertia: 0.2 kg m^2}
  b: {mass: 2 kg}
joints:
  pivot: {revolute: [ground, arm]}
  axis: {revolute: [ground, hub]}
  gb: {prismatic: [ground.r, b], axis: 90 deg}
  rope: {rope: [arm.end, ground.p, b], restitution: 0.4, pulleys: {ground.p: {radius: 50 mm}}}
  sprag: {freewheel: [arm, hub]}
  pawl: {ratchet: [ground, hub], teeth: 30, restitution: 0.2}
loads: {push: {at: arm, torque: "15*sin(9*t)"}, back: {at: hub, torque: -9 N m}}
gravity: [0, -9.81 m/s^2]
duration: 1 s
"""


@pytest.mark.slow
@pytest.mark.network
def test_ropes_and_freewheels_run_as_nodes_to_the_bit(tmp_path):
    scene, bag = tmp_path / 'pump.yaml', tmp_path / 'pump.mcap'
    scene.write_text(PUMP)
    done = run('run', str(scene), '--record', str(bag))
    assert done.returncode == 0, done.stderr
    alone = ms.simulate(ms.load_scene(str(scene)))
    assert analyze(bag).digest == alone.digest()
    assert {c.joint for c in alone.modes if c.t} == {'rope', 'pawl', 'sprag'}
    again = open_run(bag)
    t = np.linspace(0.0, 1.0, 41)
    names = 'gap.rope', 'normal_force.rope', 'reaction.pivot.x', 'second_torque.sprag'
    one, two = (x.sample(t, *names) for x in (alone, again.piece))
    assert all(np.array_equal(one[name], two[name]) for name in one)


@pytest.mark.slow
def test_a_freewheel_goes_on_for_ten_thousand_swings():
    """When the first have died away each is as the one before."""
    machine, period = shafts({'freewheel': ['hub', 'wheel']}, loads=MOTOR), 2.0 * math.pi / 3.0
    late = ms.simulate(machine, duration=10_000 * period)
    ends = np.array([9998.0, 9999.0]) * period
    before, after = late.sample(ends, 'velocity.wheel')['velocity.wheel']
    assert after == pytest.approx(before, rel=1e-10)
    assert abs(late.energy.residual) < 1e-9 * late.energy.exchanged


def test_a_freewheel_between_driven_links_is_refused():
    driven = {'hub': {'speed': 2.0}, 'wheel': {'speed': 1.0}}
    with pytest.raises(
        InputError, match='own holds one way, but drives and closed loops determine all'
    ):
        ms.simulate(shafts({'freewheel': ['hub', 'wheel']}, drives=driven), duration=1.0)


SLIDERS = {'links': {'ground': {'points': {'p': [0.0, 1.0]}}, 'a': {'mass': 1.0}},
           'joints': {'ga': {'prismatic': ['ground', 'a'], 'axis': '90 deg'}}}  # fmt: skip


@pytest.mark.parametrize(
    ('joint', 'said'),
    [
        ({'rope': ['a']}, 'it must have 2 entries'),
        ({'rope': ['a', 'ground.q']}, "joints.own.rope: the link ground has no point 'q'"),
        ({'rope': ['ground', 'ground.p']}, 'has points of ground only: name those of two links'),
        ({'rope': ['a', 'ground.p', 'ground.p']}, 'goes from ground.p to ground.p, which are one'),
        ({'rope': ['a', 'ground.p'], 'length': 0.5},
         'the start puts the points of own beyond its length, by 0.5 m'),
        ({'rope': ['a', 'ground.p'], 'length': '-1 m'}, 'length = .-1 m. is out of bounds'),
        ({'rope': ['a', 'ground.p'], 'pulleys': {'ground.q': {'radius': 0.1}}},
         r'pulleys.ground.q: the rope has no such point.*; its points: a, ground.p'),
        ({'rope': ['a', 'ground.p'], 'pulleys': {'ground.p': {'radius': 0.1}}},
         'passes is missing: how the rope goes round the drum'),
        ({'rope': ['a', 'ground.p'], 'clearance': {'radial': 1e-3, 'restitution': 0}},
         'it has no play: give its length'),
        ({'rope': ['a', 'ground.p'], 'restitution': 2}, 'must be at most 1'),
        ({'freewheel': ['a', 'ground'], 'drives': 'forwards'}, "allowed: 'counterclockwise' or"),
        ({'freewheel': ['a', 'ground'], 'teeth': 12}, 'no meaning in a freewheel joint'),
        ({'ratchet': ['a', 'wheel']}, 'own.teeth is missing: how many on a turn, such as 24'),
        ({'ratchet': ['hub', 'wheel'], 'teeth': 2}, 'must be one number of at least 3'),
        ({'ratchet': ['hub', 'wheel'], 'teeth': [20, 40]}, 'must be one number of at least 3'),
        ({'transmission': ['a', 'wheel'], 'ratio': 2}, 'a slides on ground, but wheel does not'),
        ({'transmission': ['hub', 'wheel'], 'ratio': 1, 'backlash': {'width': '1 mm'}},
         'backlash.width has no meaning between links that turn'),
        ({'transmission': ['hub', 'wheel'], 'ratio': 1, 'backlash': {'restitution': 0}},
         "backlash.angle is missing: how far the second link can turn from stop to stop"),
        ({'transmission': ['hub', 'wheel'], 'ratio': 1, 'backlash': {'angle': '3 deg'}},
         'backlash.restitution is missing'),
    ],
)  # fmt: skip
def test_mistakes_are_told_in_one_sentence(joint, said):
    links = {**SLIDERS['links'], **{k: TWO[k] for k in ('hub', 'wheel')}}

    def start():
        joints = {**AXES, **SLIDERS['joints'], 'own': joint}
        made({'links': links, 'gravity': [0.0, -G], 'joints': joints}).initial_state()

    with pytest.raises(InputError, match=said):
        start()


def test_a_rope_that_is_straight_has_left_its_pulley():
    """A block rises at 1 m/s with a pulley of 50 mm under which a rope goes, taut or slack.

    Its ends are 2 m high: the rope is straight where the middle of the pulley is at 2.05 m.
    """
    ground = {'l': [-1.0, 2.0], 'r': [1.0, 2.0], 'g': [2.0, 0.0]}
    tackle = {
        'title': 'tackle', 'gravity': [0.0, -9.81],
        'links': {'ground': {'points': ground}, 'block': {'mass': 1.0}, 'weight': {'mass': 1.0}},
        'joints': {'guide': {'prismatic': ['ground', 'block'], 'axis': '90 deg'},
                   'shaft': {'prismatic': ['ground.g', 'weight'], 'axis': '90 deg'},
                   'rope': {'rope': ['ground.l', 'block', 'ground.r', 'weight'],
                            'pulleys': {'block': {'radius': 0.05}}}},
        'drive': {'coordinate': 'block', 'speed': 1.0},
        'initial': {'position': {'block': 1.0}},
    }  # fmt: skip
    for length in (None, 10.0):
        tackle['joints']['rope']['length'] = length
        machine = made(tackle, 'tackle')
        assert ms.simulate(machine, duration=1.0499).max_penetration < 1e-12
        said = r'rope leaves its pulley on block, point 2 of rope, after t = (\S+) s: '
        with pytest.raises(RunError, match=said) as error:
            ms.simulate(machine, duration=1.2)
        assert 0.99 < float(re.search(said, str(error.value))[1]) <= 1.05


@pytest.mark.sample(1)
@pytest.mark.parametrize(('ring', 'at'), [([1.0, 0.0], 1.0), (None, 5.0)])
def test_a_stretch_that_is_drawn_in_has_no_length(ring, at):
    """A drum of 100 mm that turns once a second winds a load up to a ring, or to itself."""
    x = 1.0 if ring else 0.1
    winch = {
        'title': 'winch', 'gravity': [0.0, -9.81],
        'links': {'ground': {'points': {'drum': [0.0, 0.0], 'ring': [x, 0.0]}},
                  'drum': {'mass': 1.0, 'inertia': 0.01}, 'load': {'mass': 2.0}},
        'joints': {'d': {'revolute': ['ground.drum', 'drum']},
                   'g': {'prismatic': ['ground.ring', 'load'], 'axis': '-90 deg'},
                   'rope': {'rope': ['drum', *(['ground.ring'] if ring else []), 'load'],
                            'pulleys': {'drum': {'radius': 0.1, 'passes': 'clockwise'}}}},
        'drive': {'coordinate': 'drum', 'speed': 2.0 * math.pi},
        'initial': {'position': {'load': at}},
    }  # fmt: skip
    end = at / (0.2 * math.pi)
    machine = made(winch, 'winch')
    assert ms.simulate(machine, duration=0.999 * end).duration < end
    for later in (1.001, 3.0):  # also where the integration breaks down beyond
        with pytest.raises(RunError, match='rope has a stretch without length at t = ') as error:
            ms.simulate(machine, duration=later * end)
        told = float(re.search(r'at t = (\S+) s', str(error.value))[1])
        assert told == pytest.approx(end, rel=1e-7)


def test_two_ratchets_that_block_a_drive_are_named():
    """One takes the shaft along, the other holds it; a third has no part in it."""
    shafts = ('a', 'b', 'c')
    scene = {
        'mechanism': 'linkage',
        'links': {x: {'mass': 1, 'inertia': 0.01} for x in shafts},
        'joints': {
            **{f'shaft_{x}': {'revolute': ['ground', x]} for x in shafts},
            'takes': {'ratchet': ['a', 'b'], 'teeth': 24},
            'holds': {'ratchet': ['b', 'ground'], 'teeth': 24},
            'idles': {'ratchet': ['c', 'b'], 'teeth': 7},
        },
        'gravity': [0, 0],
        'drive': {'coordinate': 'a', 'speed': '2 rad/s'},
        'initial': {'position': {'c': -0.1}},
    }
    with pytest.raises(RunError, match=r'at t = 0 s .*: takes, holds bear against'):
        ms.simulate(scene, duration=1.0)
