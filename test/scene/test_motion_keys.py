"""Mistakes in keys of motions over time: one sentence with key, value, and what is allowed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import made
from scipy.interpolate import CubicSpline

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.scene.check import check

SCENE = {
    'links': {'ground': {}, 'arm': {'length': '1 m'}, 'block': {}},
    'joints': {
        'pivot': {'revolute': ['ground', 'arm']},
        'guide': {'prismatic': ['ground', 'block']},
    },
}
ARM = {
    'links': {'arm': {'length': '1 m'}},
    'joints': {'pivot': {'revolute': ['ground', 'arm']}},
}
POINTS = [['0 s', '0 deg'], ['1 s', '50 deg'], ['2 s', '0 deg']]
LIMITS = {'speed': '2 rad/s', 'acceleration': '8 rad/s^2'}


def refusal(drive):
    with pytest.raises(InputError) as error:
        made(
            {
                **SCENE,
                'drive': {'coordinate': 'arm', **drive},
                'drives': {'block': {'speed': '0 m/s'}},
            }
        )
    assert '\n' not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    ('drive', 'said'),
    [
        ({'position': 'sin(omega*t)'}, ["drive.position", "'omega'", 'it may name the time t']),
        ({'position': '90 deg + 60 mm*sin(t)'}, ['drive.position', 'the units differ in kind']),
        ({'position': '60 mm*sin(pi*t)'}, ['is in m', 'arm turns', 'give it in rad']),
        ({'position': 'floor(t)'}, ["calls 'floor'", 'not a function of formulas of motions']),
        ({'position': '2*lift(t)'}, ["calls 'lift'", "stand here themselves, as 'points' or"]),
        ({'position': 'sinn(t)'}, ["calls 'sinn'; did you mean 'sin'?"]),
        ({'position': 'STEP(t, 0, 0, 1, 2)'}, ["calls 'STEP'; here that is 'points' with 'ends:"]),
        ({'position': '30d*t'}, ["'d' behind 30", "is not a unit; here that is 'deg'"]),
        ({'speed': '60 rpm + 3'}, ['drive.speed cannot be read: 3 in', 'write 3 rad/s']),
        ({'speed': '60 rpm*t/(1 s) + 3'}, ['3 in', 'beside what is in rad/s: write 3 rad/s']),
        ({'speed': 'if(t < 1, 2, 3)'}, ["'if' cannot stand", "write 'A if X > Y else B'"]),
        ({'position': 'abs(t - 1)'}, ['drive.position jumps in place or speed at t = 1 s']),
        ({'position': 'sqrt(t)'}, ['drive.position', 'no derivative at t = 0 s']),
        ({'position': '1/(t - 2)'}, ['drive.position', 'no value or no derivative at t = 2 s']),
        ({'position': {'points': POINTS, 'interpolation': 'linear'}},
         ['drive.position', 'linear interpolation of positions', 'choose cubic or quintic']),
        ({'position': {'points': POINTS, 'interpolation': 'qubic'}},
         ["drive.position.interpolation = 'qubic'", "did you mean 'cubic'", "'quintic'"]),
        ({'position': {'points': POINTS, 'interpolation': 'quintic'}}, ['3 points', 'needs 6']),
        ({'position': {'points': POINTS[::-1]}}, ['times must increase, but 1 s follows 2 s']),
        ({'position': {'points': [*POINTS, ['3 s', '5 deg']], 'periodic': True}},
         ['is periodic, but begins at 0 and ends at 0.0872665 rad', 'whole turns further']),
        ({'position': {'points': [['0 s', '0 mm'], ['1 s', '1 deg']]}}, ['in m and in rad']),
        ({'position': {'points': POINTS, 'formula': 't'}}, ["both of 'formula' and 'points'"]),
        ({'position': {}}, ["none of 'formula' and 'points'"]),
        ({'position': {'formula': 't', 'periodic': True}}, ["a formula and 'periodic'"]),
        ({'position': 't', 'speed': '3 rad/s'}, ['drive.speed and drive.position exclude']),
        ({'position': 't', 'moves': {**LIMITS, 'steps': [{'to': 0}]}}, ['exclude each other']),
        ({'position': 't', 'start_angle': '3 deg'}, ["leave out 'start_angle'"]),
        ({'position': 't', 'commands': {'acceleration': '1 rad/s^2', 'fastest': '9 rad/s'}},
         ['drive.commands', 'given over time']),
        ({'speed': '3*cos(x)'}, ["drive.speed = '3*cos(x)'"]),
        ({'speed': '3 mm/s*cos(t)'}, ['drive.speed is in m/s', 'arm turns']),
        ({'speed': '3*sign(t - 1)'}, ['drive.speed jumps in place or speed at t = 1 s']),
        ({'speed': {'points': [['0 s', 1], ['1 s', 2]], 'periodic': True}},
         ['is periodic, but begins at 1 and ends at 2']),
        ({'speed': {'points': [['0 s', 1]], 'ramp': 'smooth', 'interpolation': 'cubic'}},
         ["'ramp' and 'interpolation': keep one"]),
        ({'speed': '3 rad/s', 'acceleration': '5 m/s^2'}, ['drive.acceleration', 'm/s^2']),
        ({'moves': {**LIMITS, 'steps': []}}, ['drive.moves.steps', 'must not be empty']),
        ({'moves': {**LIMITS, 'steps': [{'to': '3 deg', 'by': '3 deg'}]}}, ["one of 'to', 'by'"]),
        ({'moves': {'steps': [{'to': 1}], 'speed': 1}}, ["'drive.moves.acceleration' is missing"]),
        ({'moves': {**LIMITS, 'speed': '-2 rad/s', 'steps': [{'to': 1}]}},
         ['drive.moves.speed', 'more than 0']),
        ({'moves': {**LIMITS, 'jerk': '5 rad/s^2', 'steps': [{'to': 1}]}},
         ['drive.moves.jerk', "not a unit of 'rad/s^3'"]),
        ({'moves': {**LIMITS, 'steps': [{'to': '30 mm'}]}},
         ['drive.moves.steps.0.to is given in m', 'an angle, in rad']),
        ({'moves': {**LIMITS, 'steps': [{'to': '30 deg'}], 'repeat': True}},
         ['drive.moves.repeat', 'end where they begin']),
        ({'moves': {**LIMITS, 'steps': [{'dwell': '-1 s'}]}}, ['drive.moves.steps.0.dwell']),
        ({'swing': {'period': '1 s'}}, ["'swing' is for a machine with a single drive, 'drive'"]),
        ({'swing': {}}, ["'drive.swing.period' is missing"]),
        ({'position': {'points': POINTS[:1]}}, ['drive.position.points', '2']),
        ({'position': {'points': [*POINTS[:2], ['2 s', '0 deg']], 'ends': 'rest',
                       'periodic': True}}, ["is periodic and has 'ends: rest': keep one"]),
        ({'position': {'points': POINTS[:2], 'interpolation': 'linear', 'ends': 'rest'}},
         ["drive.position has 'ends: rest', which applies to points with cubic or quintic"]),
        ({'speed': {'points': [['0 s', '0 rpm'], ['1 s', '60 rpm']], 'ends': 'rest'}},
         ["drive.speed has 'ends: rest', which applies to points with cubic or quintic"]),
    ],
    ids=range(47),
)  # fmt: skip
def test_a_mistake_is_a_sentence(drive, said):
    text = refusal(drive)
    for part in said:
        assert part in text, text


@pytest.mark.parametrize('unit', ['m', 'mm', pytest.param('km', marks=pytest.mark.slow)])
def test_moves_by_decimals_come_back_and_just_reach_their_speed(unit):
    """0.1 + 0.2 - 0.3 is not 0, and 0.2 to and fro takes full speed for no time but rounding."""
    scale = {'m': 1.0, 'mm': 1e-3, 'km': 1e3}[unit]
    steps = [{'by': f'{x} {unit}'} for x in (0.1, 0.2, -0.3)]
    limits = {'speed': f'1 {unit}/s', 'acceleration': f'5 {unit}/s^2'}
    run = made({
        'links': {'block': {'mass': 1.0}},
        'joints': {'guide': {'prismatic': ['ground', 'block']}},
        'drive': {'coordinate': 'block', 'moves': {**limits, 'repeat': True, 'steps': steps}},
    })  # fmt: skip
    ends = np.cumsum([2.0 * math.sqrt(0.1 / 5.0), 2.0 * math.sqrt(0.2 / 5.0), 0.3 + 0.2])
    at = [*ends, ends[1] + 0.1, *(ends + ends[-1])]
    seen = ms.simulate(run, duration=2.5).sample(at, 'position.block')['position.block']
    turned = [0.1, 0.3, 0.0, 0.3 - 0.5 * 5.0 * 0.1**2, 0.1, 0.3, 0.0]
    assert seen == pytest.approx(scale * np.array(turned), abs=1e-12 * scale)


@pytest.mark.parametrize('begin', [0.0, 0.1])
@pytest.mark.parametrize('how', [{}, {'ramp': 'smooth'}, {'interpolation': 'cubic'}])
def test_periodic_speeds_go_on_by_any_way_in_a_period(how, begin):
    t, speeds = [0.0, 0.1, 0.3, 0.4], [20.0, 25.0, 17.0, 20.0]
    points = [[f'{begin + x!r} s', f'{w} rad/s'] for x, w in zip(t, speeds, strict=True)]
    course = {'points': points, 'periodic': True, **how}
    drive = {'coordinate': 'arm', 'start_angle': '30 deg', 'speed': course}
    drive = made({**SCENE, 'drive': drive, 'drives': {'block': {'speed': '0 m/s'}}}).drive
    spline = CubicSpline(t, speeds, bc_type='periodic')
    way = spline.integrate(0.0, 0.4) if 'interpolation' in how else np.trapezoid(speeds, t)
    assert drive.start == pytest.approx((math.pi / 6.0, speeds[0] if not begin else speeds[2]))
    near, late = (
        drive.source.after(replace(drive.law, valid_from=x)) for x in (0.05, 1e5 * 0.4 + 0.05)
    )
    gone = (late.turns - near.turns) * 2.0 * math.pi + late.coefficients[0] - near.coefficients[0]
    assert late.valid_from - near.valid_from == pytest.approx(4e4, abs=1e-9)
    assert gone == pytest.approx(1e5 * way, rel=1e-14)
    assert late.coefficients[1:] == pytest.approx(near.coefficients[1:], rel=1e-9, abs=1e-7)


def test_the_second_shaft_of_a_hookes_joint_by_a_formula():
    """``tan(b) = tan(a)/cos(angle)`` between the shafts; its formula turns on with the first."""
    k, angle = math.tan(math.radians(15.0)) ** 2, math.radians(30.0)
    ahead = f'arctan({k!r}*sin(20 rad/s*t)/(1 - {k!r}*cos(20 rad/s*t)))'
    drive = {'coordinate': 'arm', 'position': f'10 rad/s*t + {ahead}'}
    run = ms.simulate(made(ARM, drive=drive), duration=2.0)
    t = np.linspace(0.0, 2.0, 23)
    at = run.sample(t, 'position.arm', 'velocity.arm')
    turned = np.unwrap(np.arctan2(np.sin(10.0 * t), math.cos(angle) * np.cos(10.0 * t)))
    assert at['position.arm'] == pytest.approx(turned, abs=1e-14)
    rate = 10.0 * math.cos(angle) / (1.0 - (math.sin(angle) * np.cos(10.0 * t)) ** 2)
    assert at['velocity.arm'] == pytest.approx(rate, rel=1e-13)


@pytest.mark.parametrize(
    ('how', 'largest'), [('cubic', 6.0), ('quintic', 10.0 / math.sqrt(3.0))]
)  # fmt: skip
def test_two_points_at_rest_are_the_step_of_other_programs(how, largest):
    """90 deg in 2 s by 3 x^2 - 2 x^3, or 10 x^3 - 15 x^4 + 6 x^5: peaks are both of these."""
    points = [['0 s', '0 deg'], ['2 s', '90 deg']]
    course = {'points': points, 'interpolation': how, 'ends': 'rest'}
    machine = made({**ARM, 'drive': {'coordinate': 'arm', 'position': course}})
    right = largest * 0.5 * math.pi / 4.0
    notes = '\n'.join(check(machine).notes)
    assert f'largest acceleration {right:.6g} rad/s^2' in notes
    assert f'by its points -{right:.6g} (+-' in notes


def test_points_at_rest_are_judged_by_the_spline_that_is_driven():
    """The peaks of the points are those of the motion, not those of a spline with free ends."""
    t = np.arange(41) / 20.0
    lean = 30.0 * (1.0 - np.cos(math.pi * t)) + 5.0 * t
    points = [[f'{x} s', f'{y} deg'] for x, y in zip(t, lean, strict=True)]
    course = {'points': points, 'ends': 'rest'}
    report = check(made({**ARM, 'drive': {'coordinate': 'arm', 'position': course}}))
    known = np.radians(CubicSpline(t, lean, bc_type='clamped')(t, 2))
    said = next(x for x in (*report.notes, *report.questions) if 'by its points' in x)
    assert f'points {known.min():.6g} (' in said
    assert f' {known.max():.6g} (' in said
