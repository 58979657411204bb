"""Loads with corners and steps, tables and motors: against closed forms, sums and SciPy."""

import itertools

import numpy as np
import pytest
import scipy
from builders import compilations, made, without_work

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.curves import through

MASS, RATE = 2.0, 50.0


def block(speed=1.0, tables=None, force=None, **loads):
    """A block of 2 kg on a guide."""
    scene = {
        'title': 'block',
        'links': {'block': {'mass': MASS}},
        'joints': {'guide': {'prismatic': ['ground', 'block']}},
        'tables': tables or {},
        'drive': {'coordinate': 'block', 'speed': speed, 'force': force or {}},
        'loads': {name: {'at': 'block', **load} for name, load in loads.items()},
    }
    return made(scene, 'block')


def rotor(speed=0.0, loads=None, **motor):
    """A wheel that a motor turns."""
    scene = {
        'title': 'rotor',
        'links': {'rotor': {'mass': 2.0, 'inertia': 0.05}},
        'joints': {'O': {'revolute': ['ground', 'rotor']}},
        'drive': {'coordinate': 'rotor', 'speed': speed, 'motor': motor},
        'loads': loads or {},
    }
    return made(scene, 'rotor')


def after(model, t, name='block'):
    """Place and speed at a time, and the solution."""
    solution = ms.simulate(model, duration=t)
    seen = without_work(solution, [t])
    return seen[f'position.{name}'][0], seen[f'velocity.{name}'][0], solution


@pytest.mark.parametrize(
    'force', ['-150*max(0, block)', '-150*block if block > 0 else 0', '-75*(block + abs(block))']
)
def test_a_spring_on_one_side_swings_by_two_half_periods(force):
    """Stiffness k on one side, 4 k on the other, however it is written."""
    slow, fast = np.sqrt(RATE / MASS), np.sqrt((RATE + 150.0) / MASS)
    period = np.pi / slow + np.pi / fast
    model = block(force={'per_position': -RATE}, a={'force': [force, 0]})
    place, speed, solution = after(model, 7.0 * period + np.pi / (2.0 * fast))
    assert place == pytest.approx(1.0 / fast, rel=1e-11)
    assert speed == pytest.approx(0.0, abs=1e-10)
    assert abs(solution.energy.residual) < 1e-12


def test_conditions_and_nested_corners_of_time_give_their_impulse():
    """The speed is the integral of the force, by adaptive sums between all its corners."""
    text = 'min(5, 3*t) if t < 1.2 or t > 1.5 else max(-1, press(t), 2) - 1*(t > 1.45)'
    with pytest.raises(InputError, match=r'condition|formula'):
        block(a={'force': [text, 0]}, tables={'press': {'points': [['1 s', 1], ['2 s', 2]]}})
    text = text.replace('1*(t > 1.45)', '(1 if 1.45 < t and not t >= 1.48 else 0)')
    tables = {'press': {'points': [['1.3 s', 1], ['1.4 s', 5]]}}
    _, speed, solution = after(block(a={'force': [text, 0]}, tables=tables), 2.0)

    def force(t):
        if t < 1.2 or t > 1.5:
            return min(5.0, 3.0 * t)
        step = 1.0 if 1.45 < t < 1.48 else 0.0
        return max(-1.0, np.interp(t, [1.3, 1.4], [1.0, 5.0]), 2.0) - step

    corners = [0.0, 1.2, 1.3, 1.325, 1.4, 1.45, 1.48, 1.5, 5.0 / 3.0, 2.0]
    impulse = sum(
        scipy.integrate.quad(force, a + 1e-15, b - 1e-15)[0]
        for a, b in itertools.pairwise(corners)
    )
    assert speed == pytest.approx(1.0 + impulse / MASS, rel=1e-11)
    assert abs(solution.energy.residual) < 1e-10


@pytest.mark.parametrize('ramp', ['linear', 'smooth'])
def test_a_table_over_a_displacement_takes_the_area_below_it(ramp):
    """With a step in it, and beyond its ends: the speed follows from the work."""
    points = [(0.0, 0.0), (0.05, 2.0), (0.05, 8.0), (0.1, 4.0), (0.15, -3.0), (0.2, -3.0)]
    text = [[f'{1000 * x} mm', f'{y} N'] for x, y in points]
    tables = {'press': {'points': text, 'ramp': ramp}}
    place, speed, solution = after(block(tables=tables, a={'force': ['-press(block)', 0]}), 0.6)
    curve = through(points, ramp)
    ends = [0.0, 0.05, 0.1, 0.15, 0.2, place]
    work = sum(
        scipy.integrate.quad(lambda x: float(curve(np.array([x]))[0]), a + 1e-15, b - 1e-15)[0]
        for a, b in itertools.pairwise(ends)
    )
    assert place > 0.3
    assert 0.5 * MASS * (1.0 - speed**2) == pytest.approx(work, rel=1e-12)
    assert abs(solution.energy.residual) < 1e-13


def test_a_cyclic_table_repeats_every_turn():
    """A moment over the angle of a wheel that turns many times, both ways."""
    points = [[f'{90 * k} deg', f'{y} N m'] for k, y in enumerate((1.0, 3.0, -2.0, 0.5, 1.0))]
    scene = rotor(20.0, stall_torque=0.0, no_load_speed=1.0).scene.model_copy(
        update={'drive': None}
    )
    data = scene.model_dump(exclude_none=True) | {
        'tables': {'cam': {'points': points, 'cyclic': True, 'ramp': 'smooth'}},
        'loads': {'f': {'at': 'rotor', 'torque': 'cam(rotor)'}},
        'initial': {'velocity': {'rotor': '-60 rad/s'}},
    }
    angle, speed, _ = after(made(data, 'wheel'), 3.0, 'rotor')
    curve = through(
        [(0.5 * np.pi * k, y) for k, y in enumerate((1.0, 3.0, -2.0, 0.5, 1.0))], 'smooth', True
    )
    ends = [*np.arange(0.0, angle, -0.5 * np.pi), angle]
    work = sum(
        scipy.integrate.quad(lambda x: float(curve(np.array([x]))[0]), a, b)[0]
        for a, b in itertools.pairwise(ends)
    )
    assert angle < -12.0 * np.pi
    assert 0.5 * 0.05 * (speed**2 - 3600.0) == pytest.approx(work, rel=1e-10)


def test_a_range_of_a_displacement_and_a_direction_of_motion():
    """A block on a spring loses the same work in every crossing forwards, and none backwards."""
    during = {'coordinate': 'block', 'from': '20 mm', 'to': '80 mm', 'moving': 'forward'}
    model = block(force={'per_position': -RATE}, a={'force': ['-2 N', 0], 'during': during})
    _, _, solution = after(model, 5.0)
    speeds = ms.simulate(model, duration=5.0).sample(np.linspace(0.0, 5.0, 5001), 'position.block')
    crossings = np.count_nonzero(np.diff(np.sign(speeds['position.block'] - 0.08)) > 0)
    assert crossings == 4
    assert solution.energy.dissipated == pytest.approx(crossings * 2.0 * 0.06, rel=1e-11)


def test_dry_friction_by_its_sign_sticks_and_slips():
    """``m v' = F sin(w t) - R sign(v)`` from rest, each slip in closed form."""
    F, w, R = 8.0, 3.0, 5.0
    model = block(0.0, a={'force': ['8*sin(3*t) - 5*sign(vx)', 0]})
    begin = np.arcsin(R / F) / w

    def speed(t):
        return (F / w * (np.cos(w * begin) - np.cos(w * t)) - R * (t - begin)) / MASS

    end = scipy.optimize.brentq(speed, begin + 0.5, begin + 1.0, xtol=1e-15)
    assert F * abs(np.sin(w * end)) < R  # so that it sticks
    way = (
        F / w * np.cos(w * begin) * (end - begin)
        - F / w**2 * (np.sin(w * end) - np.sin(w * begin))
        - 0.5 * R * (end - begin) ** 2
    ) / MASS
    half = np.pi / w
    solution = ms.simulate(model, duration=6.0)
    times = [begin, end, begin + half, end + half, begin + 2.0 * half, end + 4.0 * half]
    seen = solution.sample(times, 'position.block')
    assert seen['position.block'] == pytest.approx([0, way, way, 0, 0, way], abs=1e-11)
    stuck = solution.view(np.linspace(end + 1e-6, begin + half - 1e-6, 20)).observed
    assert np.abs(stuck.velocity).max() < 1e-11
    assert np.abs(stuck.acceleration).max() < 1e-9
    assert abs(solution.energy.residual) < 1e-13


def test_two_blocks_that_rub_on_each_other_and_on_the_ground():
    """Both hold at once: then they rest until the pull is larger than what the ground holds."""
    scene = {
        'title': 'blocks',
        'links': {'lower': {'mass': 3.0}, 'upper': {'mass': 1.0}},
        'joints': {
            'a': {'prismatic': ['ground', 'lower']},
            'b': {'prismatic': ['ground', 'upper']},
        },
        'loads': {
            'ground': {'at': 'lower', 'force': ['-4*sign(lower_rate)', 0]},
            'pull': {'at': 'upper', 'force': ['3*t', 0]},
            'between': {
                'at': 'upper',
                'force': ['-6*sign(upper_rate - lower_rate)', 0],
                'reaction': 'lower',
            },
        },
    }
    model = made(scene, 'blocks')
    solution = ms.simulate(model, duration=4.0)
    seen = solution.sample([4 / 3, 2.0, 2.5, 4.0], 'velocity.upper', 'velocity.lower')
    # from 4/3 s on both go together, (3 t - 4)/4, until 1 (3 t - 4)/4 = 3 t - 6: t = 20/9 s
    apart = 20.0 / 9.0
    together = lambda t: (1.5 * (t**2 - 16 / 9) - 4 * (t - 4 / 3)) / 4  # noqa: E731
    upper = lambda t: together(apart) + 1.5 * (t**2 - apart**2) - 6 * (t - apart)  # noqa: E731
    lower = lambda t: together(apart) + 2 / 3 * (t - apart)  # noqa: E731
    assert seen['velocity.upper'] == pytest.approx(
        [0.0, together(2.0), upper(2.5), upper(4.0)], abs=1e-10
    )
    assert seen['velocity.lower'] == pytest.approx(
        [0.0, together(2.0), lower(2.5), lower(4.0)], abs=1e-10
    )
    assert abs(solution.energy.residual) < 1e-11


def test_a_motor_of_two_points_is_the_straight_line():
    law = {'stall_torque': '20 N m', 'no_load_speed': '150 rad/s', 'ratio': 2.0, 'inertia': 0.01}
    points = [['-150 rad/s', '40 N m'], ['300 rad/s', '-20 N m']]
    straight, by_points = (
        ms.simulate(rotor(**m, loads={'b': {'at': 'rotor', 'torque': '-3 N m'}}), duration=0.7)
        for m in (law, {**law, 'stall_torque': None, 'no_load_speed': None,
                        'curve': {'points': points}})
    )  # fmt: skip
    times = np.linspace(0.0, 0.7, 50)
    one, two = straight.sample(times), by_points.sample(times)
    for name in ('position.rotor', 'velocity.rotor', 'drive_torque'):
        assert two[name] == pytest.approx(one[name], rel=1e-12, abs=1e-11)
    assert by_points.energy.drive_work == pytest.approx(straight.energy.drive_work, rel=1e-12)
    # (J + i^2 J_m) w' = i T (1 - i w/w0) - 3
    J, damping = 0.05 + 4 * 0.01, 4 * 20.0 / 150.0
    exact = (40.0 - 3.0) / damping * -np.expm1(-damping / J * times)
    assert one['velocity.rotor'] == pytest.approx(exact, rel=1e-11)


def test_an_induction_motor_runs_up_by_its_data_sheet():
    """Time from rest to a speed is the integral of J/M; the largest torque is the breakdown's."""
    sheet = {
        'synchronous_speed': '1500 rpm',
        'rated_speed': '1430 rpm',
        'rated_torque': '26.7 N m',
        'breakdown_torque': '75 N m',
    }
    model = rotor(induction=sheet, ratio=-3.0)
    solution = ms.simulate(model, duration=1.0)
    seen = solution.sample(np.linspace(0.0, 1.0, 1001), 'velocity.rotor', 'drive_torque')
    w0, wr = (n * np.pi / 30 for n in (1500.0, 1430.0))
    s_r, m = 1 - wr / w0, 75.0 / 26.7
    s_b = s_r * (m + np.sqrt(m * m - 1.0))

    def torque(w):
        s = 1.0 - w / w0
        return 0.0 if s == 0.0 else 2.0 * 75.0 / (s / s_b + s_b / s)

    assert torque(wr) == pytest.approx(26.7, rel=1e-12)
    assert seen['velocity.rotor'][-1] == pytest.approx(-w0 / 3.0, rel=1e-9)
    for t in (0.01, 0.02, 0.03):
        w = -3.0 * solution.sample([t], 'velocity.rotor')['velocity.rotor'][0]
        time = scipy.integrate.quad(lambda x: 0.05 / (9.0 * torque(x)), 0.0, w)[0]
        assert time == pytest.approx(t, rel=1e-10)
    assert np.abs(seen['drive_torque']).max() <= 3.0 * 75.0
    kinetic = 0.5 * 0.05 * seen['velocity.rotor'][-1] ** 2
    assert solution.energy.drive_work == pytest.approx(kinetic, rel=1e-10)


@pytest.mark.slow
def test_a_driven_machine_has_its_stepped_loads_to_carry():
    """Virtual power, in inverse dynamics and with ideal joints under equations of motion."""
    loads = {
        'a': {
            'at': 'piston',
            'force': ['-2000*max(0, piston - 0.1) if piston_rate > 0 else -50*abs(vx)', 0],
        },
        'b': {'at': 'crank', 'torque': 'min(3, 100*t)'},
    }
    solution = ms.simulate(ms.load_scene('slider_crank', {'loads': loads}), revolutions=2)
    seen = solution.sample(
        t := np.linspace(0.0, 0.19, 301),
        'position.piston',
        'velocity.piston',
        'velocity.crank',
        'drive_torque',
    )
    bare = ms.simulate(ms.load_scene('slider_crank'), revolutions=2).sample(t, 'drive_torque')
    place, v = seen['position.piston'], seen['velocity.piston']
    force = np.where(v > 0.0, -2000.0 * np.maximum(0.0, place - 0.1), -50.0 * np.abs(v))
    wanted = -force * v / seen['velocity.crank'] - np.minimum(3.0, 100.0 * t)
    assert np.ptp(wanted) > 5.0
    assert seen['drive_torque'] - bare['drive_torque'] == pytest.approx(wanted, abs=1e-11)


@pytest.mark.slow
def test_a_toggle_press_works_on_its_workpiece():
    """Ram and workpiece hold each other at the dead point, while two pins rattle."""
    solution = ms.simulate(ms.load_scene('toggle_press'), duration=0.3)
    energy = solution.energy
    assert abs(energy.residual) < 1e-10 * energy.drive_work
    # what the workpiece takes of one stroke is the area below its table, but for the last 0.1 mm
    area = 2.0 * 52.5 + 4.0 * 28.5
    tight = ms.load_scene('toggle_press', {
        'joints.knee_pin.clearance': None, 'joints.ram_pin.clearance': None})  # fmt: skip
    ideal = ms.simulate(tight, duration=0.3)
    lowest = ideal.sample(np.linspace(0.0, 0.3, 3001), 'position.ram')['position.ram'].min()
    curve = through([(0.0, 60e3), (2e-3, 45e3), (6e-3, 12e3), (6e-3, 0.0)])
    left = scipy.integrate.quad(lambda x: float(curve(np.array([x]))[0]), 0.0, lowest)[0]
    assert ideal.energy.dissipated == pytest.approx(area - left, rel=1e-6)
    loose = solution.sample(np.linspace(0.0, 0.3, 3001), 'position.ram')['position.ram'].min()
    above = scipy.integrate.quad(lambda x: float(curve(np.array([x]))[0]), 0.0, loose)[0]
    assert len(solution.impacts) > 20
    assert energy.dissipated > area - above > ideal.energy.dissipated - 10.0


@pytest.mark.slow
def test_impacts_of_roundings_do_not_move_what_is_held():
    """Ram and workpiece rest, two pins part by roundings and fall back: this went on for ever."""
    worn = ms.load_scene('toggle_press', {
        'joints.knee_pin.clearance.radial': 9.737248314506945e-05,
        'joints.ram_pin.clearance.radial': 3.529398806561235e-05,
        'joints.ram_pin.clearance.restitution': 0.3522399503528758,
        'drive.flywheel': 6.545576514018945, 'links.ram.mass': 30.56822349146756,
        'solver.rtol': 1e-9,
    })  # fmt: skip
    solution = ms.simulate(worn, duration=0.29)
    assert abs(solution.energy.residual) < 1e-8 * solution.energy.drive_work


@pytest.mark.slow
def test_what_lets_go_by_roundings_does_not_hold_again_at_that_instant():
    """A closed pin moves by 5e-14 m when the ram is let go: too much for 7.5 kN/mm to be sure."""
    solution = ms.simulate('toggle_press', duration=3.5)  # it ended at 3.2375 s
    assert abs(solution.energy.residual) < 1e-9 * solution.energy.drive_work


def test_another_number_of_a_load_compiles_nothing():
    """Forces that were zero, points of tables, ends of ranges, data of motors."""

    def run(number, end, points):
        tables = {'press': {'points': points}}
        during = {'coordinate': 'block', 'from': f'{end} mm', 'to': '80 mm'}
        ms.simulate(
            block(
                tables=tables,
                a={'force': [f'-press(block) - {number}*vx', 0], 'torque': 0.0},
                b={'force': [number, 3.0], 'during': during},
            ),
            duration=0.1,
        )
        return compilations()

    first = run(0.0, 20, [['0 mm', 0], ['50 mm', 2]])
    assert run(1.0, 0, [['0 mm', 0], ['10 mm', 1], ['10 mm', 3], ['50 mm', 2]]) == first
    sheet = {'synchronous_speed': 150, 'rated_speed': 140, 'rated_torque': 10,
             'breakdown_torque': 20}  # fmt: skip
    ms.simulate(rotor(induction=sheet), duration=0.1)
    before = compilations()
    ms.simulate(rotor(induction=sheet | {'rated_speed': 145}, ratio=2.0), duration=0.1)
    assert compilations() == before


def test_tables_come_from_files_beside_the_scene(tmp_path):
    (tmp_path / 'press.csv').write_text('note,stroke [mm],force (kN)\na,0,0\nb,50,0.002\n')
    text = """
title: block
mechanism: linkage
links: {block: {mass: 2 kg}}
joints: {guide: {prismatic: [ground, block]}}
drive: {coordinate: block, speed: 1 m/s, force: {}}
loads: {a: {at: block, force: ['-press(block)', 0 N]}}
tables: {press: {file: press.csv, columns: [stroke, force]}}
"""
    scene = tmp_path / 'block.yaml'
    scene.write_text(text)
    by_file = ms.simulate(ms.load_scene(str(scene)), duration=0.2).sample([0.2], 'velocity.block')
    tables = {'press': {'points': [[0.0, 0.0], [0.05, 2.0]]}}
    given = ms.simulate(block(tables=tables, a={'force': ['-press(block)', 0]}), duration=0.2)
    assert by_file['velocity.block'] == given.sample([0.2], 'velocity.block')['velocity.block']
    for columns, found in (
        ('[stroke, x]', "no column 'x'"),
        ('[stroke, note]', 'a finite number'),
    ):
        scene.write_text(text.replace('[stroke, force]', columns))
        with pytest.raises(InputError, match=found):
            ms.load_scene(str(scene))
    scene.write_text(text.replace('press.csv', 'other.csv'))
    with pytest.raises(InputError, match=r"'other.csv' cannot be read"):
        ms.load_scene(str(scene))


@pytest.mark.parametrize(
    ('key', 'value', 'found'),
    [
        ('tables', {'p': {'points': [['1 mm', 1], ['0 mm', 1]]}}, 'of increasing x'),
        ('tables', {'p': {'points': [['1 mm', 1], ['1 s', 1]]}}, 'same kind of unit'),
        ('tables', {'p': {'points': [[0, 1], [1, 2]], 'cyclic': True}}, 'span a turn'),
        ('tables', {'p': {'points': [[1, 1], [1, 2]]}}, 'one step'),
        ('loads', {'a': {'at': 'piston', 'force': ['max(1)', 0]}}, 'at least two'),
        ('loads', {'a': {'at': 'piston', 'force': ['abs(1, 2)', 0]}}, 'one argument'),
        ('loads', {'a': {'at': 'piston', 'force': ['presss(1)', 0]}}, 'not a function'),
        ('loads', {'a': {'at': 'piston', 'force': ['1 if t == 2 else 0', 0]}}, 'made of < and >'),
        ('loads', {'a': {'at': 'piston', 'during': {'coordinate': 'piston'}}}, "'moving'"),
        (
            'loads',
            {'a': {'at': 'piston', 'during': {'coordinate': 'piston', 'from': '2 m', 'to': 1}}},
            'must be less than',
        ),
        (
            'loads',
            {'a': {'at': 'piston', 'during': {'coordinate': 'crank', 'from': '2 deg'}}},
            "both 'from' and 'to'",
        ),
        ('drive.motor', {'stall_torque': 1}, 'needs one of'),
        ('drive.motor', {'curve': {'points': [['1 mm', 1], ['2 mm', 0]]}}, 'not of speeds'),
        (
            'drive.motor',
            {'induction': {'synchronous_speed': 1, 'rated_speed': 2, 'rated_torque': 1,
                           'breakdown_torque': 2}},
            'between zero and',
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_with_tables_formulas_and_motors_is_said(key, value, found):
    with pytest.raises(InputError, match=found):
        ms.load_scene('slider_crank', {key: value})


@pytest.mark.slow
def test_what_holds_two_rates_at_once_is_shown_as_it_acts():
    """What holds the crank turns the piston: iteration for the one and the other never ends."""
    machine = ms.load_scene('slider_crank', {
        'joints.rod_piston.clearance': {'radial': 1e-5, 'restitution': 0.3},
        'drive': {
            'coordinate': 'crank', 'speed': 0.0, 'start_angle': -1.3579206, 'flywheel': 0.004557,
            'torque': {'constant': 0.66173, 'per_speed': -0.012627},
        },
        'loads': {
            'late': {'at': 'rod', 'torque': '1 if t > 0.03 and not crank_rate < 0 else -0.5'},
            'rub': {'at': 'piston', 'force': ['-39.227*sign(vx)', 0.0]},
        },
    })  # fmt: skip
    solution = ms.simulate(machine, duration=0.4)
    seen = solution.sample(np.array([0.1, 0.2, 0.4]), 'velocity.crank', 'acceleration.crank')
    assert np.abs(seen['velocity.crank']).max() < 1e-11  # held
    assert np.abs(seen['acceleration.crank']).max() < 1e-9
    exchanged = abs(solution.energy.drive_work) + solution.energy.dissipated
    assert abs(solution.energy.residual) < 1e-10 * exchanged
