"""Drives by position and by speed over time, against closed forms and mechanics done by hand."""

from __future__ import annotations

import math
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
import yaml
from builders import made
from running import run_json
from scipy.integrate import solve_ivp

import mechanism_sim as ms
from mechanism_sim.analysis.open_run import open_run
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.engine.snapshot import Snapshot
from mechanism_sim.errors import InputError
from mechanism_sim.planar.drive import TWO_PI

INPUTS = Path(__file__).parent / 'inputs'
SERVO = str(INPUTS / 'position_law.yaml')
BY_POSITION = {'drive': {'position': '90 deg + 60 deg*sin(pi*t)'}}

ARM = {
    'title': 'An arm that a servo turns',
    'mechanism': 'linkage',
    'links': {'ground': {}, 'arm': {'length': '1 m', 'mass': '2 kg', 'inertia': '0.5 kg m^2'}},
    'joints': {'pivot': {'revolute': ['ground', 'arm']}},
}


def arm(duration=4.0, **drive):
    return ms.simulate(made({**ARM, 'drive': {'coordinate': 'arm', **drive}}), duration=duration)


def four_bar_torque(angle, speed, acceleration):
    """Torque on the crank of `position_law.yaml`, from its kinetic energy alone.

    d/dt (J w^2 / 2) / w = J a + J' w^2 / 2 with the inertia J(angle) that the crank feels: from
    positions of all centres of gravity in 30 digits, and their derivatives by mpmath.
    """
    g, a, b, c = (mp.mpf(x) / 1000 for x in (200, 60, 180, 100))

    def places(x):
        crank = mp.expj(x) * a
        to = g - crank
        d = abs(to)
        turn = mp.acos((b * b + d * d - c * c) / (2 * b * d))
        coupler = mp.arg(to) + turn
        rocker = mp.arg(crank + b * mp.expj(coupler) - g)
        return [
            (mp.mpf('0.1'), mp.mpf('50e-6'), crank / 2, x),
            (mp.mpf('0.2'), mp.mpf('600e-6'), crank + mp.expj(coupler) * b / 2, coupler),
            (mp.mpf('0.2'), mp.mpf('200e-6'), g + mp.expj(rocker) * c / 2, rocker),
        ]

    def inertia(x):
        total = mp.mpf(0)
        for i, (mass, own, _, _) in enumerate(places(x)):
            step = mp.mpf(10) ** -12
            (_, _, p, u), (_, _, q, v) = places(x - step)[i], places(x + step)[i]
            total += mass * abs((q - p) / (2 * step)) ** 2 + own * ((v - u) / (2 * step)) ** 2
        return total

    with mp.workdps(50):
        step, x = mp.mpf(10) ** -8, mp.mpf(angle)
        slope = (inertia(x + step) - inertia(x - step)) / (2 * step)
        return float(inertia(x) * acceleration + slope * mp.mpf(speed) ** 2 / 2)


@pytest.mark.parametrize(('overrides', 'tail'), [({}, 1e-12), (BY_POSITION, 1e-13)])
def test_a_servo_swings_a_four_bar_as_its_formula_says(overrides, tail):
    """Drake, issue 19234; angles by hand, torques from the kinetic energy."""
    solution = ms.simulate(ms.load_scene(SERVO, overrides), duration=4.0)
    t = np.linspace(0.0, 4.0, 4001)
    found = solution.sample(
        t, 'drive_torque', 'acceleration.crank', 'position.crank', 'velocity.crank'
    )
    rate = math.pi if overrides else 3.14159265
    size = math.radians(60.0) if overrides else 3.2898681337 / rate
    angle = math.pi / 2 + size * np.sin(rate * t)
    assert np.abs(found['position.crank'] - angle).max() <= tail
    assert np.abs(found['velocity.crank'] - rate * size * np.cos(rate * t)).max() <= 1e-11
    faster = -(rate**2) * size * np.sin(rate * t)
    assert np.abs(found['acceleration.crank'] - faster).max() <= 1e-10
    assert np.abs(found['acceleration.crank']).max() == pytest.approx(10.335425560, abs=1e-7)
    torque = found['drive_torque']
    assert torque.min() == pytest.approx(-0.00972, abs=5e-6)
    for k in (137, 1000, 1501, int(torque.argmin()), 3333):
        by_hand = four_bar_torque(angle[k], rate * size * math.cos(rate * t[k]), faster[k])
        assert torque[k] == pytest.approx(by_hand, abs=1e-12)


def exact_place(t):
    """Angle and speed of `1 + sin(pi*t/4) + 2*pi*t` in 40 digits."""
    turn = mp.pi * t / 4
    return 1 + mp.sin(turn) + 2 * mp.pi * t, mp.pi * (2 + mp.cos(turn) / 4)


def test_laws_of_a_late_time_have_the_digits_of_an_early_one():
    """After 40,000 s: sines of the time in exact arithmetic, as of everything that turns."""
    machine = made({**ARM, 'drive': {'coordinate': 'arm', 'position': '1 + sin(pi*t/4) + 2*pi*t'}})
    source = machine.plan.sources['arm']
    for k in range(8):
        law = source._law(40_000.0 + k / 8, 0, 0.0)
        with mp.workdps(40):
            exact, rate = exact_place(mp.mpf(40_000) + mp.mpf(k) / 8)
            turns, (angle, speed, *_) = law.about(40_000 + k / 8)
            found = mp.mpf(turns) * mp.mpf(TWO_PI.numerator) / TWO_PI.denominator + angle
            assert abs(found - exact) <= 1e-14
            assert abs(speed - rate) <= 1e-13


@pytest.mark.slow
def test_ten_thousand_times_as_long_the_motion_has_the_same_digits():
    """2,000 s instead of 0.2 s of a swing."""
    machine = made({**ARM, 'drive': {'coordinate': 'arm', 'position': '1 + sin(pi*t/4)'}})
    engine = machine.start()
    for end in range(100, 2_001, 100):
        engine.advance(float(end), final=True)
        motion, *_ = engine.drain()
    curve, last = motion.curve, np.array([len(motion) - 1])
    angle, rate = (curve.local(last, curve.duration[-1:], d)[0, 0] for d in (0, 1))
    assert angle == pytest.approx(1.0 + math.sin(0.0), abs=2e-15)
    assert rate == pytest.approx(math.pi / 4, abs=1e-14)


def test_a_periodic_table_of_the_time_repeats_in_formulas_of_loads():
    """A wheel under the torque of a table of one period of 0.8 s; its speed in closed form."""
    t = np.linspace(0.0, 0.8, 65)
    points = [[f'{x!r} s', f'{2.0 + math.sin(2.0 * math.pi * x / 0.8)!r} N m'] for x in t.tolist()]
    points[-1][1] = points[0][1]
    scene = {
        **ARM,
        'drive': {'coordinate': 'arm', 'torque': {}},
        'tables': {'push': {'points': points, 'interpolation': 'quintic', 'periodic': True}},
        'loads': {'push': {'at': 'arm', 'torque': 'push(t)'}},
    }
    solution = ms.simulate(made(scene), duration=20.3)
    rate = 2.0 * math.pi / 0.8
    inertia = 0.5
    t = np.linspace(0.0, 20.3, 999)
    exact = (2.0 * t + (1.0 - np.cos(rate * t)) / rate) / inertia
    assert (
        np.abs(solution.sample(t, 'velocity.arm')['velocity.arm'] - exact).max() <= 1e-7
    )  # of the spline
    table = made(scene).scene.tables['push'].curve
    values = table(np.array([0.3, 0.3 + 0.8 * 7, -0.5]))
    assert values == pytest.approx([values[0]] * 3, abs=1e-12)


# --- a free link on a driven one -----------------------------------------------------------------

PENDULUM = {
    'title': 'A pendulum on an arm that a servo swings',
    'mechanism': 'linkage',
    'gravity': [0.0, -9.81],
    'links': {
        'ground': {},
        'arm': {'length': '0.5 m', 'mass': '1 kg', 'inertia': '0.1 kg m^2', 'cog': '0.2 m'},
        'rod': {'length': '0.8 m', 'mass': '0.7 kg', 'inertia': '0.05 kg m^2', 'cog': '0.4 m'},
    },
    'joints': {
        'pivot': {'revolute': ['ground', 'arm']},
        'pin': {'revolute': ['arm.end', 'rod']},
    },
    'guess': {'rod': '-80 deg'},
}
SWING = '-60 deg + 20 deg*sin(2*t) + 5 deg*exp(-t)*cos(7*t)'


def swing(t):
    """Angle, rate and acceleration of `SWING`."""
    d, e = math.radians(20.0), math.radians(5.0)
    z = complex(-1.0, 7.0)
    decaying = [e * (z**k * np.exp(z * t)).real for k in range(3)]
    steady = [d * np.sin(2 * t), 2 * d * np.cos(2 * t), -4 * d * np.sin(2 * t)]
    base = math.radians(-60.0), 0.0, 0.0
    return [b + s + x for b, s, x in zip(base, steady, decaying, strict=True)]


def rod_by_hand(times, law):
    """Angle of the rod: (J + m c^2) b'' = -m c (arm's acceleration across it + g cos b)."""
    m, c, inertia, length = 0.7, 0.4, 0.05, 0.5

    def rate(t, y):
        x, v, a = law(t)
        ax = length * (-a * math.sin(x) - v * v * math.cos(x))
        ay = length * (a * math.cos(x) - v * v * math.sin(x))
        b, w = y
        across = -ax * math.sin(b) + (ay + 9.81) * math.cos(b)
        return [w, -m * c * across / (inertia + m * c * c)]

    found = solve_ivp(
        rate, (0.0, times[-1]), [math.radians(-80.0), 0.0], 'DOP853', times, rtol=1e-13, atol=1e-13
    )
    return found.y[0]


def test_a_free_link_follows_a_driven_one_by_formula():
    machine = made({**PENDULUM, 'drive': {'coordinate': 'arm', 'position': SWING}})
    t = np.linspace(0.0, 6.0, 200)
    found = ms.simulate(machine, duration=6.0).sample(t, 'position.arm', 'position.rod')
    assert np.abs(found['position.arm'] - swing(t)[0]).max() <= 1e-13
    assert np.abs(found['position.rod'] - rod_by_hand(t, swing)).max() <= 1e-9


def test_a_further_drive_moves_by_formula_and_conditions():
    """A dwell between two cycloids: `drives.NAME`, with corners of the third derivative."""
    rise = '60 deg*(t/2 - sin(pi*t)/(2*pi)) if t < 2 else 60 deg'
    scene = {**PENDULUM, 'drive': {'coordinate': 'rod', 'torque': {}}}
    machine = made({**scene, 'drives': {'arm': {'position': rise}}})

    def law(t):
        if t >= 2.0:
            return math.radians(60.0), 0.0, 0.0
        size = math.radians(60.0)
        return (
            size * (t / 2 - math.sin(math.pi * t) / (2 * math.pi)),
            size * (0.5 - math.cos(math.pi * t) / 2),
            size * math.pi * math.sin(math.pi * t) / 2,
        )

    t = np.linspace(0.0, 2.0, 100)
    found = ms.simulate(machine, duration=3.0).sample(t, 'position.rod')
    assert np.abs(found['position.rod'] - rod_by_hand(t, law)).max() <= 1e-9


def table(count, last, decimals=17, law=lambda t: 90.0 + 60.0 * math.sin(math.pi * t)):
    times = [last * k / (count - 1) for k in range(count)]
    return [[f'{t!r} s', f'{law(t):.{decimals}g} deg'] for t in times]


@pytest.mark.parametrize(('how', 'error'), [('cubic', 3e-3), ('quintic', 2e-6)])
def test_a_periodic_table_is_the_motion_for_ever(how, error):
    """Splines of a sine, 40 points a period: their errors, and no others after a day."""
    points = table(41, 2.0)
    points[-1][1] = points[0][1]
    position = {'points': points, 'interpolation': how, 'periodic': True}
    machine = made({**ARM, 'drive': {'coordinate': 'arm', 'position': position}})
    found = ms.simulate(machine, duration=9.0)
    t = np.linspace(0.0, 9.0, 1001)
    a = found.sample(t, 'acceleration.arm')['acceleration.arm']
    exact = -(math.pi**2) * math.radians(60.0) * np.sin(math.pi * t)
    assert np.abs(a - exact).max() <= error * 10.3354
    source, places = machine.plan.sources['arm'], []
    for cycle in (0, 43_200):
        law = source._law(cycle, 7, source._starts[7] + cycle * source._period)
        places.append(law.about(source._starts[7] + cycle * source._period))
    assert places[0] == places[1]


def test_a_periodic_table_may_turn_on():
    """A crank that turns once a second, with a swing beside it: whole turns are counted."""
    points = table(65, 1.0, law=lambda t: 360.0 * t + 10.0 * math.sin(2.0 * math.pi * t))
    position = {'points': points, 'interpolation': 'quintic', 'periodic': True}
    found = arm(position=position, duration=7.25).sample(np.array([7.25]), 'position.arm')
    exact = 2.0 * math.pi * 7.25 + math.radians(10.0)
    assert found['position.arm'][0] == pytest.approx(exact, abs=1e-9)


def test_speeds_by_a_spline_have_the_accelerations_of_what_they_sample():
    """161 points of a sine: by `ramp: smooth` the largest acceleration is 1.5 times as large."""
    points = [[f'{t!r} s', f'{3.2898681337 * math.cos(math.pi * t)!r} rad/s']
              for t in np.linspace(0.0, 4.0, 161).tolist()]  # fmt: skip
    t = np.linspace(0.0, 4.0, 4001)
    largest = {}
    for key, value in (('interpolation', 'cubic'), ('interpolation', 'quintic'),
                       ('ramp', 'smooth')):  # fmt: skip
        speed = {'points': points, key: value}
        found = arm(speed=speed, start_angle='90 deg').sample(t, 'acceleration.arm')
        largest[value] = np.abs(found['acceleration.arm']).max()
    assert largest['cubic'] == pytest.approx(10.33542556, rel=1e-4)
    assert largest['quintic'] == pytest.approx(10.33542556, rel=1e-6)
    assert largest['smooth'] == pytest.approx(1.5 * 10.33542556, rel=5e-3)


# --- moves ---------------------------------------------------------------------------------------

MOVES = {'speed': '2 rad/s', 'acceleration': '8 rad/s^2', 'jerk': '80 rad/s^3'}


def test_moves_keep_their_limits_and_take_the_time_of_the_closed_form():
    """Biagiotti and Melchiorri, section 3.4: T = D/v + v/a + a/j where all limits are reached."""
    steps = [{'to': '90 deg'}, {'dwell': '0.5 s'}, {'by': '-30 deg', 'jerk': '200 rad/s^3'},
             {'dwell': '0.1 s'}, {'to': '90.5 deg', 'speed': '0.3 rad/s'}]  # fmt: skip
    machine = made({**ARM, 'drive': {'coordinate': 'arm', 'moves': {**MOVES, 'steps': steps}}})
    full = math.radians(90.0) / 2.0 + 2.0 / 8.0 + 8.0 / 80.0
    ends = [law.valid_from for law in machine.drive.laws if law.degree == 1]
    assert ends[0] == pytest.approx(full, abs=1e-12)
    way = math.radians(30.0)  # speed is not reached: T = a/j + sqrt((a/j)^2 + 4 D/a)
    quick = 8.0 / 200.0 + math.sqrt((8.0 / 200.0) ** 2 + 4.0 * way / 8.0)
    assert ends[1] == pytest.approx(full + 0.5 + quick, abs=1e-12)
    slow = math.radians(30.5) / 0.3 + 2.0 * math.sqrt(0.3 / 80.0)  # nor is the acceleration
    assert ends[2] == pytest.approx(full + 0.5 + quick + 0.1 + slow, abs=1e-12)
    end = ends[-1] + 0.5
    t = np.linspace(0.0, end, 20_001)
    found = ms.simulate(machine, duration=end).sample(t)
    x, v, a = (found[f'{name}.arm'] for name in ('position', 'velocity', 'acceleration'))
    assert np.abs(v).max() == pytest.approx(2.0, abs=1e-9)
    assert np.abs(a).max() == pytest.approx(8.0, abs=1e-9)
    assert np.abs(np.diff(a) / np.diff(t)).max() <= 200.0 + 1e-6
    assert x[np.searchsorted(t, full + 0.25)] == pytest.approx(math.radians(90.0), abs=1e-14)
    assert (x[-1], v[-1], a[-1]) == pytest.approx((math.radians(90.5), 0.0, 0.0), abs=1e-14)


def test_moves_repeat_and_turn_on():
    moves = {**MOVES, 'steps': [{'by': '120 deg'}, {'dwell': '0.25 s'}] * 3, 'repeat': True}
    machine = made({**ARM, 'drive': {'coordinate': 'arm', 'moves': moves}})
    one = math.radians(120.0) / 2.0 + 2.0 / 8.0 + 8.0 / 80.0 + 0.25
    found = ms.simulate(machine, duration=7.0 * one).sample(
        np.array([7.0 * one - 0.1]), 'position.arm'
    )
    assert found['position.arm'][0] == pytest.approx(7.0 * math.radians(120.0), abs=1e-12)


def test_an_acceleration_is_a_key():
    found = arm(speed='1 rad/s', acceleration='3 rad/s^2', start_angle='10 deg', duration=2.0)
    last = found.sample(np.array([2.0]), 'position.arm', 'velocity.arm')
    exact = math.radians(10.0) + 2.0 + 6.0
    assert last['position.arm'][0] == pytest.approx(exact, abs=1e-13)
    assert last['velocity.arm'][0] == pytest.approx(7.0, abs=1e-13)


@pytest.mark.parametrize(
    'text', ['60 mm*sin(2*pi*t/(2 s))', '0.06*sin(pi*t)', '0.06*sin(t*pi/1 s)']
)
def test_a_block_slides_by_a_formula_with_units_or_without(text):
    scene = {
        'links': {'ground': {}, 'block': {'mass': '2 kg', 'inertia': '0.1 kg m^2'}},
        'joints': {'guide': {'prismatic': ['ground', 'block']}},
        'drive': {'coordinate': 'block', 'position': text},
    }
    t = np.linspace(0.0, 4.0, 401)
    found = ms.simulate(made(scene), duration=4.0).sample(t, 'position.block', 'drive_torque')
    assert np.abs(found['position.block'] - 0.06 * np.sin(math.pi * t)).max() <= 1e-15
    assert np.abs(found['drive_torque'] + 0.12 * math.pi**2 * np.sin(math.pi * t)).max() <= 1e-12


# --- files, nodes, bags --------------------------------------------------------------------------

LOOSE = {'joints.coupler_rocker.clearance': {'radial': '0.2 mm', 'restitution': 0.3}}


@pytest.mark.slow
@pytest.mark.network
@pytest.mark.parametrize(
    'drive',
    [
        'position: "90 deg + 10 deg*sin(pi*t)"',
        pytest.param('position: {file: way.csv, interpolation: quintic}', marks=pytest.mark.slow),
    ],
)
def test_nodes_follow_as_the_solution_does_and_the_bag_is_readable_alone(drive, tmp_path):
    (tmp_path / 'scene').mkdir()
    file = tmp_path / 'scene' / 'servo.yaml'
    kept = [line for line in Path(SERVO).read_text().splitlines() if not line.startswith('drive')]
    file.write_text('\n'.join([*kept, f'drive: {{{drive}}}']))
    rows = [f'{0.05 * k!r},{90.0 + 10.0 * math.sin(0.05 * math.pi * k)!r}' for k in range(61)]
    (file.parent / 'way.csv').write_text('\n'.join(['t [s],crank [deg]', *rows]))
    clearance = 'joints.coupler_rocker.clearance={radial: 0.2 mm, restitution: 0.3}'
    args = ['--duration', '2.5', '--set', clearance]
    alone = run_json('solve', str(file), *args)
    bag = tmp_path / 'run.mcap'
    assert run_json('run', str(file), *args, '--record', str(bag))['code'] == 0
    for each in (*file.parent.iterdir(),):
        each.unlink()
    assert analyze(bag).digest == alone['digest']
    motion = open_run(bag)
    assert motion.machine.scene.drive.position is not None


# --- between limits ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('file', 'low', 'high', 'margin'),
    [
        # the line of the ground joints is at -148.3246 deg: 144.005 to either side of it
        ('double_rocker', -292.3296, -4.3196, None),
        ('six_bar', 67.2836, 78.2542, 0.5),
    ],
)
def test_a_drive_swings_between_the_limits_of_its_linkage(file, low, high, margin):
    """PMKSWeb, issues 91 and 92; the limits from the README of these cases."""
    scene = yaml.safe_load((INPUTS / f'{file}.yaml').read_text())
    swing = {'period': '2 s'} | ({} if margin is None else {'margin': f'{margin} deg'})
    scene['drive'] = {k: v for k, v in scene['drive'].items() if k != 'speed'} | {'swing': swing}
    machine = made(scene)
    found = ms.simulate(machine, duration=2.0).sample(np.linspace(0.0, 2.0, 2001))
    angle = np.degrees(found[f'position.{machine.plan.main}'])
    aside = 0.01 * (high - low) if margin is None else margin
    assert (angle.min(), angle.max()) == pytest.approx((low + aside, high - aside), abs=2e-3)
    with pytest.raises(InputError, match=r'drive.swing and drive.position exclude each other'):
        made(scene, **{'drive.position': 't'})
    with pytest.raises(InputError, match=r'starts at .* rad, which is not between'):
        made(scene, **{'drive.swing.margin': f'{0.499 * (high - low)} deg'})


def test_what_turns_round_does_not_swing():
    scene = {**ARM, 'drive': {'coordinate': 'arm', 'swing': {'period': '1 s'}}}
    with pytest.raises(InputError, match='arm has no limits on both sides to swing between'):
        made(scene)


@pytest.mark.parametrize(
    'drive',
    [
        {'position': SWING},
        {'moves': {**MOVES, 'repeat': True, 'steps': [{'to': '40 deg'}, {'to': 0}]}},
    ],
    ids=['formula', 'moves'],
)
def test_a_run_that_pauses_goes_on_bit_by_bit(drive, tmp_path):
    machine = made({**PENDULUM, 'drive': {'coordinate': 'arm', **drive}})

    def advance(run, until, digest):
        run.advance(until)
        motion, impacts, _ = run.drain()
        digest.add(motion, impacts)
        return run

    whole, parts = MotionDigest(), MotionDigest()
    advance(machine.start(), 12.0, whole)
    machine.snapshot(advance(machine.start(), 7.3, parts)).save(tmp_path / 'pause.json')
    again = made({**PENDULUM, 'drive': {'coordinate': 'arm', **drive}})
    advance(again.resume(Snapshot.load(tmp_path / 'pause.json')), 12.0, parts)
    assert parts.hexdigest() == whole.hexdigest()
