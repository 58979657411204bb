"""Problems that others have published with their answers, three of each kind of these cases.

Sources stand with each; figures have the digits that are printed there. Units and axes are those
of the source as far as it says.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from builders import cam_pair, made
from mcap.writer import IndexType, Writer
from rosbags.typesys import Stores, get_typestore

import mechanism_sim as ms
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import InputError
from mechanism_sim.imports import import_machine
from mechanism_sim.messages import definition
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.results.cycle import at_position, cycle

STORE = get_typestore(Stores.ROS2_JAZZY)
ARM = {
    'links': {'ground': {}, 'arm': {'length': '1 m', 'mass': '2 kg', 'inertia': '0.5 kg m^2'}},
    'joints': {'pivot': {'revolute': ['ground', 'arm']}},
}


def block(mass, axis='0 deg', joint=(), **more):
    """A block on a guide."""
    guide = {'prismatic': ['ground', 'block'], 'axis': axis, **dict(joint)}
    links = {'ground': {}, 'block': {'mass': mass}}
    return {'links': links, 'joints': {'g': guide}, **more}


def seen(solution, t, *names):
    """Quantities at instants."""
    found = solution.sample(np.atleast_1d(np.asarray(t, float)), *names)
    return [found[name] for name in names]


# --- laws of position ----------------------------------------------------------------------------


@pytest.mark.parametrize(('jerk', 'way'), [(4000, 0.5), (8000, 0.375)])
def test_a_ramp_with_a_limit_of_jerk_takes_its_way(jerk, way):
    """Industrial Monitor Direct, "Jerk-limited S-curve": 0 to 10 in/s by 200 in/s^2."""
    moves = {'speed': '10 in/s', 'acceleration': '200 in/s^2', 'jerk': f'{jerk} in/s^3',
             'steps': [{'to': '3 in'}]}  # fmt: skip
    solution = ms.simulate(
        made(block(1.0, drive={'coordinate': 'block', 'moves': moves})), duration=0.2
    )
    t = 10.0 / 200.0 + 200.0 / jerk
    x, v = seen(solution, t, 'position.block', 'velocity.block')
    assert [x[0] / 0.0254, v[0] / 0.0254] == pytest.approx([way, 10.0], rel=1e-12)


def test_a_cubic_from_rest_to_rest():
    """Robotics Stack Exchange, "Finding cubic polynomial equation for 3 joints": 1.5 to 1 m."""
    law = '1.5 - 0.015*t^2 + 0.001*t^3'
    machine = made(block(1.0, drive={'coordinate': 'block', 'position': law}))
    x, v, a = seen(ms.simulate(machine, duration=10.0), [0.0, 5.0, 10.0],
                   *(f'{k}.block' for k in ('position', 'velocity', 'acceleration')))  # fmt: skip
    assert x == pytest.approx([1.5, 1.25, 1.0], abs=1e-14)
    assert v == pytest.approx([0.0, -0.075, 0.0], abs=1e-15)
    assert a == pytest.approx([-0.03, 0.0, 0.03], abs=1e-15)


def test_a_quartic_through_a_point_on_the_way():
    """Nagarajan, Introduction to Industrial Robotics, 10.9.3: 10, 5 and 50 deg at 0, 1 and 2 s."""
    law = '(10 - 70*t^2 + 90*t^3 - 25*t^4)*1 deg'
    machine = made({**ARM, 'drive': {'coordinate': 'arm', 'position': law}})
    x, v = seen(
        ms.simulate(machine, duration=2.0), [0.0, 1.0, 2.0], 'position.arm', 'velocity.arm'
    )
    assert np.degrees(x) == pytest.approx([10.0, 5.0, 50.0], abs=1e-12)
    assert v[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-13)


# --- cams ----------------------------------------------------------------------------------------


def cam(law, speed, base, roller=None):
    """A cam under a follower that slides."""
    kind = {'follower': 'roller', 'roller': roller} if roller else {'follower': 'knife'}
    pair = {'cam': ['cam', 'follower'], 'base_radius': base, 'law': law, **kind}
    return made({
        'links': {'ground': {}, 'cam': {'mass': 1.0, 'inertia': 1.0}, 'follower': {'mass': 1.0}},
        'joints': {'a': {'revolute': ['ground', 'cam']}, 'pair': pair,
                   'g': {'prismatic': ['ground', 'follower'], 'axis': '90 deg'}},
        'drive': {'coordinate': 'cam', 'speed': speed},
    })  # fmt: skip


def rises(*parts):
    """Segments (from, to [deg], rise [mm], curve)."""
    keys = 'from', 'to', 'rise', 'curve'
    units = ' deg', ' deg', ' mm', ''
    return {'segments': [{k: f'{v}{u}' for k, v, u in zip(keys, part, units, strict=True)}
                         for part in parts]}  # fmt: skip


def test_a_tangent_cam_begins_its_lift():
    """Khurmi, Theory of Machines, ch. 20 (bissoy.com, question 375987): 187.6 m/s^2.

    Least radius 30 mm, roller 17.5 mm, lift 17.5 mm in 75 deg of ascent, 600 rpm.
    """
    c = math.cos(math.radians(75.0))
    nose = (30.0 - 47.5 * c) / (1.0 - c)  # its centre is 47.5 - nose off the axis
    law = {'tangent': {'nose': f'{nose!r} mm', 'lift': '17.5 mm'}}
    machine = cam(law, '600 rpm', '30 mm', '17.5 mm')
    shape = cam_pair(machine).cam.law
    assert shape(np.radians([0.0, 75.0, 150.0])) == pytest.approx([0.0, 0.0175, 0.0], abs=1e-15)
    first = shape(np.array([0.0]), 2)[0] * (20.0 * math.pi) ** 2
    assert first == pytest.approx(187.6, rel=1e-3)


@pytest.mark.slow
def test_a_valve_raised_and_lowered_by_harmonic_motion():
    """Khurmi's exercise (mycoursehelp.com, 67124): 0.39, 0.78 m/s; 6.17, 24.67 m/s^2.

    50 mm up in a third of a revolution, 1/12 of dwell, down in a sixth; 100 rpm.
    """
    machine = cam(rises((0, 120, 50, 'harmonic'), (150, 210, -50, 'harmonic')),
                  '100 rpm', '25 mm', '10 mm')  # fmt: skip
    ends = ms.cycle(machine, samples=36).extremes()
    speed, rate = ends['velocity.follower'], ends['acceleration.follower']
    assert [speed.greatest.value, -speed.least.value] == pytest.approx([0.39, 0.78], abs=6e-3)
    assert rate.greatest.value == pytest.approx(24.67, abs=1e-2)
    law = cam_pair(machine).cam.law
    up = law(np.array([1e-9]), 2)[0] * (100.0 * math.pi / 30.0) ** 2
    assert up == pytest.approx(6.17, abs=5e-3)


def test_a_table_of_a_cycloid():
    """Scribd 402730349, homework: 20 mm in 60 deg; lift, slope, curvature by mm and deg."""
    law = cam_pair(cam(rises((240, 300, 20, 'cycloidal'), (300, 360, -20, 'cycloidal')),
                       '1 rpm', '40 mm')).cam.law  # fmt: skip
    printed = {245: (0.075117, 0.044658, 0.017453), 255: (1.816901, 0.333333, 0.034907),
               270: (10.0, 0.666667, 0.0), 295: (19.92488, 0.044658, -0.017453),
               330: (10.0, -0.666667, 0.0), 345: (1.816901, -0.333333, 0.034907)}  # fmt: skip
    for angle, row in printed.items():
        at = np.radians([float(angle)])
        found = [1e3 * law(at, k)[0] * math.radians(1.0) ** k for k in range(3)]
        assert found == pytest.approx(row, abs=5e-6)


# --- force elements and states -------------------------------------------------------------------


def test_a_motor_reaches_a_tenth_of_a_radian_a_second():
    """Control Tutorials for MATLAB and Simulink, "DC motor speed": poles near -2 and -10 1/s.

    J = 0.01, b = 0.1, K = 0.01, R = 1, L = 0.5; at 1 V it settles to 2 % in 2.07 s.
    """
    machine = made({
        'links': {'ground': {}, 'rotor': {'mass': 1.0, 'inertia': 0.01}},
        'joints': {'o': {'revolute': ['ground', 'rotor']}},
        'states': {'current': {'start': '0 A', 'rate': '(1 - current - 0.01*rotor_rate)/0.5'}},
        'loads': {'motor': {'at': 'rotor', 'torque': '0.01*current - 0.1*rotor_rate'}},
    })  # fmt: skip
    t = np.linspace(0.0, 6.0, 6001)
    (speed,) = seen(ms.simulate(machine, duration=6.0), t, 'velocity.rotor')
    assert speed[-1] == pytest.approx(0.1, abs=2e-4)
    late = t[np.abs(speed - speed[-1]) > 0.02 * speed[-1]][-1]
    assert late == pytest.approx(2.07, abs=5e-3)


@pytest.mark.slow
def test_a_servo_leaves_the_error_that_its_gain_leaves():
    """The same tutorials, "PID controller design": m = 1, b = 10, k = 20, a step to 1.

    Without a controller 1 N moves it by 0.05; Kp = 300 leaves 300/320; with Kp = 350, Ki = 300,
    Kd = 50 there is no error.
    """
    spring = {'coordinate': 'block', 'stiffness': '20 N/m', 'damping': '10 N s/m'}
    servo = {'coordinate': 'block', 'target': '1 m'}
    gains = {'p': '350 N/m', 'i': '300 N/m/s', 'd': '50 N s/m'}
    for more, end in (
        ({'loads': {'step': {'at': 'block', 'force': [1.0, 0.0]}}}, 0.05),
        ({'servos': {'own': {**servo, 'p': '300 N/m', 'd': '10 N s/m'}}}, 300.0 / 320.0),
        ({'servos': {'own': {**servo, **gains}}}, 1.0),
    ):
        machine = made(block(1.0, springs={'s': spring}, **more))
        x = seen(ms.simulate(machine, duration=12.0), 12.0, 'position.block')[0]
        assert x == pytest.approx([end], abs=1e-4)


def test_a_bungee_jumper_stops_where_it_is_printed():
    """Jiskha 1302123574: 53 kg on a cord of 13 m and 75.1 N/m fall 35 m."""
    cord = {'between': ['ground', 'block'], 'free_length': '13 m', 'stiffness': '75.1 N/m',
            'acts': 'above'}  # fmt: skip
    scene = block(53.0, '90 deg', springs={'cord': cord}, gravity=[0.0, -9.8])
    scene['initial'] = {'position': {'block': '-1 mm'}}
    solution = ms.simulate(made(scene), duration=4.0)
    (depth,) = seen(solution, np.linspace(0.0, 4.0, 4001), 'position.block')
    assert depth.min() == pytest.approx(-35.0, abs=0.02)


# --- stops ---------------------------------------------------------------------------------------


def dropped(height, restitution):
    """A block that falls on a stop."""
    stops = {'stops': {'lower': '0 m', 'restitution': restitution}}
    scene = block(1.0, '90 deg', stops, gravity=[0.0, -9.8])
    return made(scene | {'initial': {'position': {'block': f'{height} m'}}})


def test_a_ball_bounces_thirteen_times_in_3_10_seconds():
    """Wolfram Demonstrations, "Bounce Time for a Bouncing Ball": at rest at 3.135 s."""
    solution = ms.simulate(dropped(1.5, 0.7), duration=3.2)
    assert float(solution.impacts[12].t) == pytest.approx(3.10, abs=5e-3)
    assert solution.modes[-1].mode == Mode.FOLLOWING
    assert solution.modes[-1].t == pytest.approx(3.135, abs=5e-4)


def test_a_ball_that_keeps_half_of_its_speed_rests_after_1_36_seconds():
    """Teheca 46075441: from 1 m."""
    solution = ms.simulate(dropped(1.0, 0.5), duration=1.5)
    assert solution.modes[-1].t == pytest.approx(1.36, abs=6e-3)


def test_a_bumper_car_is_compressed_by_7_7_mm():
    """Physics Forums 60053: 450 kg at 2 m/s against a wall, 3e7 N/m."""
    law = {'law': 'hertz', 'stiffness': '3e7 N/m', 'exponent': 1.0}
    stops = {'stops': {'upper': '1 m', 'restitution': 1, 'contact': law}}
    scene = block(450.0, '0 deg', stops) | {'initial': {'velocity': {'block': '2 m/s'}}}
    solution = ms.simulate(made(scene), duration=0.6)
    assert solution.impacts[0].peak_force / 3e7 == pytest.approx(7.7e-3, abs=6e-5)
    assert seen(solution, 0.6, 'velocity.block')[0] == pytest.approx([-2.0], rel=1e-9)


# --- ropes ---------------------------------------------------------------------------------------


def weights(joints, mass_a, mass_b, **links):
    """Two weights in vertical guides, 1 m apart."""
    points = {'l': [0, 0], 'r': [1, 0], 'p': [0, 3], 'o': [1, 3], 'axis': [0.5, 3]}
    guides = {f'g{x}': {'prismatic': [f'ground.{p}', x], 'axis': '90 deg'}
              for x, p in (('a', 'l'), ('b', 'r'))}  # fmt: skip
    masses = {'a': {'mass': mass_a}, 'b': {'mass': mass_b}}
    return made({
        'links': {'ground': {'points': points}, **masses, **links},
        'joints': {**guides, **joints}, 'gravity': [0.0, -9.8],
    })  # fmt: skip


def test_two_masses_over_a_pulley_without_mass():
    """Jiskha 1328980597: 2 and 4 kg; 3.27 m/s^2 and 26.1 N."""
    machine = weights({'rope': {'rope': ['a', 'ground.p', 'ground.o', 'b']}}, 2.0, 4.0)
    found = seen(ms.simulate(machine, duration=0.5), 0.2, 'acceleration.a', 'normal_force.rope')
    assert np.concatenate(found) == pytest.approx([3.27, 26.1], abs=5e-2)


def test_a_pulley_with_mass_takes_a_part_of_the_tension():
    """Tiku 8499: 2 and 4 kg, radius 0.25 m, 2.3 m/s^2 found; about 9 rad/s^2, I by both ropes."""
    inertia = (4.0 * (9.8 - 2.3) - 2.0 * (9.8 + 2.3)) * 0.25**2 / 2.3
    wheel = {'mass': 1.0, 'inertia': inertia}
    points = {'l': [0.25, 0], 'r': [0.75, 0], 'axis': [0.5, 3]}
    drum = {'radius': 0.25}
    joints = {
        'axis': {'revolute': ['ground.axis', 'wheel']},
        'ta': {'rope': ['wheel', 'a'],
               'pulleys': {'wheel': {**drum, 'passes': 'counterclockwise'}}},
        'tb': {'rope': ['wheel', 'b'], 'pulleys': {'wheel': {**drum, 'passes': 'clockwise'}}},
    }  # fmt: skip
    machine = weights(joints, 2.0, 4.0, ground={'points': points}, wheel=wheel)
    solution = ms.simulate(machine, duration=0.5)
    up, spin, ta, tb = (x[0] for x in seen(solution, 0.2, 'acceleration.a', 'acceleration.wheel',
                                           'normal_force.ta', 'normal_force.tb'))  # fmt: skip
    assert up == pytest.approx(2.3, rel=1e-9)
    assert abs(spin) == pytest.approx(9.0, abs=0.25)
    assert [ta, tb] == pytest.approx([24.2, 30.0], abs=5e-2)


def test_a_block_on_a_table_is_drawn_by_a_weight():
    """Halliday and Resnick, 5-71 (zanotowane.pl 7935): 3 kg, M = 0.34 kg; 1.0 m/s^2, 3 N."""
    points = {'p': [3.0, 0.0], 'o': [3.0, -3.0]}
    machine = made({
        'links': {'ground': {'points': points}, 'block': {'mass': 3.0}, 'w': {'mass': 0.34}},
        'joints': {'g': {'prismatic': ['ground', 'block']},
                   'h': {'prismatic': ['ground.o', 'w'], 'axis': '90 deg'},
                   'rope': {'rope': ['block', 'ground.p', 'w']}},
        'gravity': [0.0, -9.8],
    })  # fmt: skip
    found = seen(
        ms.simulate(machine, duration=0.5), 0.2, 'acceleration.block', 'normal_force.rope'
    )
    assert np.concatenate(found) == pytest.approx([1.0, 3.0], abs=2e-2)


# --- contacts ------------------------------------------------------------------------------------


def test_a_bowling_ball_slides_and_then_rolls():
    """Physics Forums 394359: 8.10 m/s, mu 0.19, radius 11 cm; 1.86 m/s^2 and 42.3 rad/s^2.

    It rolls when v = w r: after 2 v/(7 mu g), with 5/7 of the speed.
    """
    mass, r = 7.0, 0.11
    machine = made({
        'gravity': [0.0, -9.8],
        'links': {'ground': {'points': {'l': [-1.0, 0.0], 'r': [30.0, 0.0]}},
                  'ball': {'mass': mass, 'inertia': 0.4 * mass * r**2}},
        'joints': {'lane': {'contact': ['ball', 'ground.l'], 'to': 'ground.r',
                            'radii': [f'{r} m', '1 um'], 'restitution': 0,
                            'friction': {'coefficient': 0.19}}},
        'initial': {'position': {'ball.x': '0 m', 'ball.y': f'{r + 1e-6} m'},
                    'velocity': {'ball.x': '8.10 m/s'}},
    })  # fmt: skip
    solution = ms.simulate(machine, duration=2.0)
    a, spin = (x[0] for x in seen(solution, 0.5, 'acceleration.ball.x', 'acceleration.ball'))
    assert [-a, -spin] == pytest.approx([1.86, 42.3], rel=2e-3)
    assert solution.modes[-1].mode == Mode.STICKING
    assert solution.modes[-1].t == pytest.approx(2.0 * 8.10 / (7.0 * 0.19 * 9.8), rel=1e-9)
    speed = seen(solution, 1.9, 'velocity.ball.x')[0]
    assert speed == pytest.approx([8.10 * 5.0 / 7.0], rel=1e-9)


def test_a_bar_strikes_the_edge_of_a_wall():
    """Tutorbin, "The 2 pound bar": 30 ft/s, 4 ft, e = 0.3; 16.714 rad/s and 7.714 ft/s.

    It is struck 1 ft from its middle.
    """
    foot = 0.3048
    machine = made({
        'links': {'ground': {'points': {'edge': [0.0, foot]}},
                  'bar': {'mass': '2 lbm', 'inertia': f'{2 * 16 / 12} lbm ft^2',
                          'points': {'low': ['0 ft', '-2 ft'], 'high': ['0 ft', '2 ft']}}},
        'joints': {'wall': {'contact': ['ground.edge', 'bar.low'], 'to': 'bar.high',
                            'radii': ['1 mm', '1 mm'], 'restitution': 0.3}},
        'initial': {'position': {'bar.x': '0.1 m', 'bar.y': '0 m'},
                    'velocity': {'bar.x': '-30 ft/s'}},
    })  # fmt: skip
    solution = ms.simulate(machine, duration=0.02)
    assert len(solution.impacts) == 1
    speed, spin = (x[0] for x in seen(solution, 0.02, 'velocity.bar.x', 'velocity.bar'))
    assert [abs(spin), speed / foot] == pytest.approx([16.714, -7.714], abs=5e-4)


def test_a_ball_strikes_a_hanging_rod():
    """Hibbeler (BrainMass 30080): rod 6 lb, 3 ft, ball 1 lb at 50 ft/s, 2 ft down, e = 0.7.

    By angular momentum and restitution 7.73 rad/s.
    """
    machine = made({
        'links': {'ground': {'points': {'o': ['0 ft', '0 ft'], 'path': ['0 ft', '-2 ft']}},
                  'rod': {'length': '3 ft', 'mass': '6 lbm', 'inertia': '4.5 lbm ft^2',
                          'cog': '1.5 ft'},
                  'ball': {'mass': '1 lbm'}},
        'joints': {'o': {'revolute': ['ground.o', 'rod']},
                   'g': {'prismatic': ['ground.path', 'ball']},
                   'c': {'contact': ['ball', 'rod.start'], 'to': 'rod.end',
                         'radii': ['1 mm', '1 mm'], 'restitution': 0.7}},
        'initial': {'position': {'rod': '-90 deg', 'ball': '-0.1 m'},
                    'velocity': {'ball': '50 ft/s'}},
    })  # fmt: skip
    solution = ms.simulate(machine, duration=0.0068)
    assert len(solution.impacts) == 1
    assert seen(solution, 0.0068, 'velocity.rod')[0] == pytest.approx([7.73], abs=5e-3)


# --- coordinates ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('guess', 'coupler', 'rocker'),
    [([150.0, 60.0], 20.30, 57.33), ([90.0, -80.0], -60.98, -98.01)],
)
def test_both_branches_of_a_four_bar_told_by_a_point(guess, coupler, rocker):
    """Norton, Design of Machinery, example 4-1: 100, 40, 120, 80 mm, crank at 40 deg."""
    machine = made({
        'links': {'ground': {'points': {'o4': ['100 mm', '0 mm']}}, 'crank': {'length': '40 mm'},
                  'coupler': {'length': '120 mm'}, 'rocker': {'length': '80 mm'}},
        'joints': {'a': {'revolute': ['ground', 'crank']},
                   'b': {'revolute': ['crank.end', 'coupler']},
                   'c': {'revolute': ['coupler.end', 'rocker.end']},
                   'd': {'revolute': ['rocker', 'ground.o4']}},
        'guess': {'coupler.end': [f'{x} mm' for x in guess]},
        'drive': {'coordinate': 'crank', 'speed': 1.0, 'start_angle': '40 deg'},
    })  # fmt: skip
    q = dict(zip(machine.plan.ideal.coordinates, np.degrees(machine.assembly.q), strict=True))
    assert [q['coupler'], q['rocker']] == pytest.approx([coupler, rocker], abs=6e-3)


def crank_slider(crank, rod, offset, drive):
    """A slider-crank; its guide is `offset` beside the crank's axis."""
    return made({
        'links': {'ground': {'points': {'rail': [0.0, offset]}}, 'crank': {'length': crank},
                  'rod': {'length': rod}, 'block': {}},
        'joints': {'a': {'revolute': ['ground', 'crank']},
                   'b': {'revolute': ['crank.end', 'rod']},
                   'c': {'revolute': ['rod.end', 'block']},
                   's': {'prismatic': ['ground.rail', 'block']}},
        'guess': {'block': crank + rod}, 'drive': {'coordinate': 'crank', **drive},
    })  # fmt: skip


def at(machine, angle):
    """Quantities by name where the crank is at an angle, as `cycle --at` gives them."""
    found = cycle(machine, samples=8, start=angle)
    return at_position(machine, float(found['position.crank'][0]), found)


def test_an_offset_slider_crank_is_where_the_book_has_it():
    """Norton, example 4-2: 40, 120, offset -20 mm, crank at 60 deg; slider at 126.84 mm.

    Its angle 152.91 deg is that of the rod from the slider to the crank's pin.
    """
    machine = crank_slider(0.04, 0.12, -0.02, {'speed': 1.0, 'start_angle': '60 deg'})
    found = at(machine, '60 deg')
    assert 1e3 * found['position.block'] == pytest.approx(126.84, abs=6e-3)
    assert math.degrees(found['position.rod']) == pytest.approx(152.91 - 180.0, abs=6e-3)


def test_speeds_of_a_slider_crank_at_one_position():
    """Course Hero 6680931, Mathcad: at 45 deg and 1 rad/s, 9.744 in/s and 0.378 rad/s.

    Crank and rod follow from its figures: 10 and 20 in; the rod is at 159.295 deg.
    """
    machine = crank_slider(0.254, 0.508, 0.0, {'speed': '1 rad/s'})
    found = at(machine, '45 deg')
    assert -found['velocity.block'] / 0.0254 == pytest.approx(9.744, abs=6e-4)
    assert abs(found['velocity.rod']) == pytest.approx(0.378, abs=6e-4)
    assert math.degrees(found['position.rod']) == pytest.approx(159.295 - 180.0, abs=6e-4)


# --- imports -------------------------------------------------------------------------------------

LINK = '<link name="{}"><inertial><mass value="1"/><inertia izz="0.01"/></inertial></link>'


def robot(folder, name, *joints):
    """A URDF of links a to c on a base, without origins of their inertias, and its machine."""
    text = f'<robot name="{name}"><link name="base"/>' + ''.join(map(LINK.format, 'abc'))
    file = folder / f'{name}.urdf'
    file.write_text(text + ''.join(joints) + '</robot>')
    found = import_machine(file, overrides={'drive.coordinate': 'a', 'drive.speed': '0.3 rad/s'})
    return found, made({**found.data})


def hinge(name, parent, child, axis=1, mimic=''):
    """A hinge about the normal of the plane, 0.1 m along its parent."""
    return (
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0 0"/><axis xyz="0 0 {axis}"/>{mimic}</joint>'
    )


def mimic(joint, multiplier, offset=0.0):
    """A joint that follows another."""
    return f'<mimic joint="{joint}" multiplier="{multiplier}" offset="{offset}"/>'


def test_a_joint_may_mimic_one_that_mimics_another(tmp_path):
    """ros/robot_model pull request 177: factors multiply, and offsets go through the chain."""
    _, machine = robot(
        tmp_path, 'chain', hinge('ja', 'base', 'a'),
        hinge('jb', 'base', 'b', mimic=mimic('ja', 0.5, 0.2)),
        hinge('jc', 'base', 'c', mimic=mimic('jb', -3.0, 0.1)),
    )  # fmt: skip
    a, b, c = seen(ms.simulate(machine, duration=1.0), [0.0, 1.0],
                   *(f'position.{x}' for x in 'abc'))  # fmt: skip
    assert np.diff(b) == pytest.approx(0.5 * np.diff(a), abs=1e-13)
    assert np.diff(c) == pytest.approx(-1.5 * np.diff(a), abs=1e-13)
    assert c - (0.1 - 3.0 * b) == pytest.approx([0.0, 0.0], abs=1e-12)
    ends = [('ja', 'a', 'jb'), ('jb', 'b', 'ja')]
    circle = [hinge(joint, 'base', link, mimic=mimic(other, 1)) for joint, link, other in ends]
    with pytest.raises(InputError, match='ja: joints that mimic each other in a circle have no'):
        robot(tmp_path, 'circle', *circle, hinge('jc', 'base', 'c'))


def test_the_axis_of_a_driver_and_the_factors_of_its_followers_turn_together(tmp_path):
    """jsk-ros-pkg/solidworks_urdf_exporter2 pull request 101: q' = -q, M' = -M are one motion."""
    places = []
    for sign in (1, -1):
        _, machine = robot(
            tmp_path, f'flip{sign}', hinge('ja', 'base', 'a', sign),
            hinge('jb', 'base', 'b', mimic=mimic('ja', 0.7 * sign)), hinge('jc', 'b', 'c', -1),
        )  # fmt: skip
        names = 'position.a', 'position.b'
        places.append(np.concatenate(seen(ms.simulate(machine, duration=1.0), 1.0, *names)))
    assert places[0] == pytest.approx(places[1], abs=1e-13)


def test_an_inertia_without_an_origin_is_at_that_of_the_link(tmp_path):
    """Genesis-Embodied-AI/genesis-world pull request 2499."""
    found, machine = robot(tmp_path, 'bare', *(hinge(f'j{x}', 'base', x) for x in 'abc'))
    body = machine.mechanism.body('a')
    assert (body.mass, body.inertia, body.cog) == (1.0, 0.01, (0.0, 0.0))
    assert not [note for note in found.notes if 'inertia' in note]


# --- bags of others ------------------------------------------------------------------------------


def bag_of(path, topics, index=True):
    """An MCAP of messages (topic, type, message) of ROS, one a second, with or without indexes."""
    with path.open('wb') as stream:
        kinds = IndexType.ALL if index else IndexType.NONE
        writer = Writer(stream, index_types=kinds, use_summary_offsets=index,
                        repeat_channels=index, use_statistics=index)  # fmt: skip
        writer.start(profile='ros2')
        channels = {}
        for k, (topic, kind, message) in enumerate(topics):
            if topic not in channels:
                schema = writer.register_schema(kind, 'ros2msg', definition(kind).encode())
                channels[topic] = writer.register_channel(topic, 'cdr', schema)
            data = bytes(STORE.serialize_cdr(message, kind))
            writer.add_message(channels[topic], k * 10**9, data, k * 10**9)
        writer.finish()
    return path


def number(topic, value):
    """A message of a number."""
    kind = 'std_msgs/msg/Float64'
    return topic, kind, STORE.types[kind](data=float(value))


def test_a_file_without_indexes_is_read(tmp_path):
    """facontidavide/cloudini issue 15: a restored file that nothing could play."""
    path = bag_of(tmp_path / 'restored.mcap', [number('/x', k * k) for k in range(5)], index=False)
    found = ms.open_run(path).columns(['/x.data'], np.array([3.0, 3.5]))['/x.data']
    assert found == pytest.approx([9.0, 12.5], abs=1e-12)


def test_what_only_the_first_part_of_a_split_bag_has_is_of_the_whole(tmp_path):
    """ros-tooling/rosbag2_storage_mcap issue 75: later parts do not repeat latched topics."""
    text = 'std_msgs/msg/String'
    latched = '/robot_description', text, STORE.types[text](data='<robot/>')
    bag_of(tmp_path / 'run_0.mcap', [latched, number('/x', 1.0)])
    bag_of(tmp_path / 'run_1.mcap', [number('/x', 2.0)] * 3)
    bag = read_bag(tmp_path)
    assert [m.data for _, m, _ in bag.messages('/robot_description')] == ['<robot/>']
    assert len(list(bag.messages('/x'))) == 4


def test_a_file_by_the_type_and_definition_that_it_has_itself(tmp_path):
    """PlotJuggler issue 878, "No parser available for encoding cdr nor ros2msg"."""
    kind = 'geometry_msgs/msg/Vector3'
    vector = STORE.types[kind]
    path = bag_of(
        tmp_path / 'converted.mcap',
        [('/v', kind, vector(x=1.0 * k, y=-2.0 * k, z=0.5)) for k in range(4)],
    )
    found = ms.open_run(path).columns(['/v.x', '/v.y'], np.array([1.5]))
    assert [found['/v.x'][0], found['/v.y'][0]] == pytest.approx([1.5, -3.0], abs=1e-12)


# --- Python --------------------------------------------------------------------------------------


def test_where_a_piston_is_fastest():
    """Quarter Mile forum 7907: rod 6.024 in, stroke 3.307 in, 6000 rpm.

    Fastest at t = 0.002100653404 s, where the crank is at 75.6 deg: 1078 in/s.
    """
    inch = 0.0254
    machine = crank_slider(0.5 * 3.307 * inch, 6.024 * inch, 0.0, {'speed': '6000 rpm'})
    ends = ms.cycle(machine, samples=72).extremes()['velocity.block']
    assert ends.least.t == pytest.approx(0.002100653404, abs=1e-12)
    assert -ends.least.value / inch == pytest.approx(1078.0, abs=0.5)
    assert math.degrees(ends.least.t * 200.0 * math.pi) == pytest.approx(75.6, abs=0.05)


@pytest.mark.parametrize(('amplitude', 'ratio'), [(60, 1.0732), (90, 1.1803)])
def test_the_period_of_a_large_swing(amplitude, ratio):
    """scipython.com, P7.7 (60 deg, 1 m); ratios to small swings in tables of physics."""
    bob = ms.LinkPart(length=1.0, mass=1.0, inertia=0.0, cog=1.0)
    scene = ms.Scene(
        title='A pendulum', links={'bob': bob}, gravity=[0.0, -9.81],
        joints={'o': ms.JointPart(revolute=['ground', 'bob'])},
        initial={'position': {'bob': f'{amplitude - 90} deg'}},
    )  # fmt: skip
    period = ratio * 2.0 * math.pi / math.sqrt(9.81)
    frame = ms.simulate(scene, duration=1.1 * period).to_frame('velocity.bob', rate='10 kHz')
    t, rate = (frame[x].to_numpy() for x in ('t', 'velocity.bob'))
    turns = t[1:][np.diff(np.sign(rate)) != 0]
    assert turns[turns > 0.6 * period][0] == pytest.approx(period, rel=1e-4)


def test_the_stiffness_of_a_bungee_cord_is_found():
    """Jiskha 1302123574 the other way round: 75.1 N/m, that a fall of 35 m ends."""
    cord = {'between': ['ground', 'block'], 'free_length': '13 m', 'stiffness': '60 N/m',
            'acts': 'above'}  # fmt: skip
    scene = block(53.0, '90 deg', springs={'cord': cord}, gravity=[0.0, -9.8])
    scene |= {'title': 'A jump', 'mechanism': 'linkage',
              'initial': {'position': {'block': '-1 mm'}}}  # fmt: skip
    found = ms.find(scene, {'springs.cord.stiffness': ('60 N/m', '90 N/m')},
                    'lowest(position.block) = -35 m', samples=3, duration='4 s')  # fmt: skip
    assert found.values['springs.cord.stiffness'] == pytest.approx(75.1, abs=0.06)
