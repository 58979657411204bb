"""Loads that are nothing when a step begins: pulses of any width, wherever they lie."""

import math

import heyoka as hy
import numpy as np
import pytest
import scipy
from builders import made

import mechanism_sim as ms
from mechanism_sim.analysis.measure import measure
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.numerics.enclosure import Enclosure, MotionSeries, reach_of
from mechanism_sim.numerics.formula import FUNCTIONS

ROOT = math.sqrt(math.pi)


def slider(*forces, speed=0.0, mass=1.0, **changes):
    """A block on a guide under forces along it."""
    scene = {
        'title': 'a block',
        'links': {'block': {'mass': mass}},
        'joints': {'guide': {'prismatic': ['ground', 'block']}},
        'drive': {'coordinate': 'block', 'speed': f'{speed} m/s', 'force': {}},
        'loads': {f'f{k}': {'at': 'block', 'force': [f, 0]} for k, f in enumerate(forces)},
        **changes,
    }
    return made(scene, 'block')


def wheel(torque, speed=20.0, inertia=0.01, **changes):
    scene = {
        'title': 'a wheel',
        'links': {'ground': {}, 'wheel': {'mass': 1.0, 'inertia': inertia}},
        'joints': {'O': {'revolute': ['ground', 'wheel']}},
        'loads': {'f': {'at': 'wheel', 'torque': torque}},
        'drive': {'coordinate': 'wheel', 'speed': f'{speed} rad/s', 'torque': {}},
        **changes,
    }
    return made(scene, 'wheel')


def last_speed(machine, duration, link='block'):
    return float(
        ms.simulate(machine, duration=duration).sample([duration], f'velocity.{link}')[
            f'velocity.{link}'
        ][0]
    )


def test_a_pulse_far_from_where_a_step_begins_moves_a_slider():
    v = last_speed(slider('5*exp(-((t-2.0)/0.001)**2)/0.001'), 4.0)
    assert v == pytest.approx(5.0 * ROOT, rel=1e-12)


PLACES = np.random.default_rng(39).uniform(0.7, 3.3, (6, 3))


@pytest.mark.parametrize('width', [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_no_pulse_of_time_is_missed(width):
    for place in PLACES[round(-math.log10(width)) - 1]:
        v = last_speed(slider(f'5*exp(-((t-{place})/{width})**2)/{width}'), 4.0)
        assert v == pytest.approx(5.0 * ROOT, rel=max(1e-11, 1e-15 * place / width))


@pytest.mark.parametrize('place', [0.0, 0.1, 0.2, 1.0])
def test_pulses_where_steps_begin_and_end(place):
    """The longest step is 0.1 s."""
    v = last_speed(slider(f'5*exp(-((t-{place})/1e-4)**2)/1e-4'), 1.0)
    share = 0.5 if place in (0.0, 1.0) else 1.0
    assert v == pytest.approx(share * 5.0 * ROOT, rel=1e-11)


def test_several_pulses_beside_a_large_load():
    """Two in one step, of which one takes away, under a load of 300 times their impulses."""
    v = last_speed(
        slider(
            '5*exp(-((t-2.0)/1e-3)**2)/1e-3 + 1000*sin(3*t)', '-2*exp(-((t-2.02)/1e-4)**2)/1e-4'
        ),
        4.0,
    )
    assert v == pytest.approx(3.0 * ROOT + 1000.0 / 3.0 * (1.0 - math.cos(12.0)), abs=1e-10)


def test_a_small_pulse_beside_a_large_load():
    v = last_speed(slider('1000*sin(3*t) + exp(-((t-2.02)/1e-5)**2)'), 4.0)
    assert v - 1000.0 / 3.0 * (1.0 - math.cos(12.0)) == pytest.approx(1e-5 * ROOT, abs=1e-10)


@pytest.mark.parametrize('width', [1e-1, 1e-3, 1e-5])
def test_a_pulse_of_displacement_takes_its_work(width):
    v = last_speed(slider(f'-0.25*exp(-((x-1.7)/{width})**2)/{width}', speed=1.0), 6.0)
    assert v == pytest.approx(math.sqrt(1.0 - 0.5 * ROOT), abs=1e-11)


@pytest.mark.parametrize('width', [1e-1, 1e-3, 1e-5])
def test_a_pulse_of_speed_lasts_as_long_as_its_speeds(width):
    """``v' = 1 + 100 p(v)``: the time is the integral of dv/v'."""
    v = last_speed(slider(f'1 + 100*exp(-((vx-1.7)/{width})**2)'), 4.0)
    near = [1.7 + k * width for k in (-6, -3, 0, 3, 6)]

    def slowness(u):
        return 1.0 / (1.0 + 100.0 * math.exp(-(((u - 1.7) / width) ** 2)))

    found = scipy.integrate.quad(slowness, 0.0, v, points=near, limit=500, epsabs=1e-13)[0]
    assert found == pytest.approx(4.0, abs=1e-11)


@pytest.mark.parametrize('width', [1e-1, 1e-2, 1e-4, 1e-5])
def test_a_pulse_of_torque_over_the_angle_of_a_crank(width):
    """Each turn takes ``500 w sqrt(pi)``, here of the first."""
    machine = wheel(f'-500*exp(-((wheel-2.0)/{width})**2)', inertia=10.0)
    v = last_speed(machine, 0.3, 'wheel')
    # the tail at the start, for the widest
    work = 500.0 * width * ROOT * 0.5 * (1.0 + math.erf(2.0 / width))
    assert v == pytest.approx(math.sqrt(400.0 - 2.0 * work / 10.0), abs=1e-10)


@pytest.mark.parametrize('width', [1e-2, 1e-4])
def test_a_free_pendulum_meets_a_pulse_of_its_angle(width):
    """Energy: the pulse takes its work whenever it is passed, here twice, once each way."""
    scene = {
        'title': 'a pendulum',
        'links': {'ground': {}, 'bob': {'mass': 2.0, 'inertia': 0.02, 'cog': 0.4, 'length': 0.8}},
        'joints': {'O': {'revolute': ['ground', 'bob.start']}},
        'gravity': [0, -9.81],
        'loads': {'f': {'at': 'bob', 'torque': f'exp(-((bob+1.5)/{width})**2)'}},
        'drive': {'coordinate': 'bob', 'speed': 0.0, 'start_angle': '-30 deg', 'torque': {}},
    }
    solution = ms.simulate(made(scene, 'pendulum'), duration=0.6)
    q, v = (
        float(solution.sample([0.6], f'{x}.bob')[f'{x}.bob'][0]) for x in ('position', 'velocity')
    )
    assert q < -1.6  # past the pulse, which held against it
    inertia, weight = 0.02 + 2.0 * 0.4**2, 2.0 * 9.81 * 0.4
    energy = 0.5 * inertia * v * v + weight * (math.sin(q) - math.sin(math.radians(-30.0)))
    assert energy == pytest.approx(-width * ROOT, abs=1e-12)
    assert abs(solution.energy.residual) < 1e-12


@pytest.mark.parametrize('width', [1e-2, 1e-5])
def test_a_condition_that_a_pulse_fulfils(width):
    """No series of the condition's guard foretells that it will be fulfilled for a moment."""
    v = last_speed(slider(f'{1 / width} if exp(-((t-2.003)/{width})**2) > 0.5 else 0'), 4.0)
    assert v == pytest.approx(2.0 * math.sqrt(math.log(2.0)), rel=max(1e-11, 4e-16 / width))


def test_a_pulse_moves_what_dry_friction_holds():
    """The acceleration of what rests is none whatever pulls: it is the hold that ends."""
    width, pull = 1e-3, 2000.0
    solution = ms.simulate(
        slider('-4*sign(vx)', f'{pull}*exp(-((t-2.003)/{width})**2)'), duration=4.0
    )
    begin = 2.003 - width * math.sqrt(math.log(pull / 4.0))
    impulse = 0.5 * pull * width * ROOT * (1.0 + math.erf(math.sqrt(math.log(pull / 4.0))))
    v = solution.sample([2.1], 'velocity.block')['velocity.block'][0]
    assert v == pytest.approx(impulse - 4.0 * (2.1 - begin), abs=1e-11)
    assert abs(solution.sample([4.0], 'velocity.block')['velocity.block'][0]) < 1e-10


def test_a_pulse_lifts_what_hangs_in_a_loose_pin():
    """What hangs has no acceleration whatever lifts it: it is the contact's force that ends."""
    loose = {'revolute': ['ground', 'bob.start'], 'clearance': {'radial': 0.05, 'restitution': 0}}
    scene = {
        'title': 'a pendulum that hangs in a loose pin',
        'links': {'ground': {}, 'bob': {'mass': 1.0, 'inertia': 1.0, 'cog': 0.4, 'length': 0.8}},
        'joints': {'O': loose},
        'loads': {'f': {'at': 'bob', 'force': [0, '-20 + 3000*exp(-((t-0.503)/1e-3)**2)']}},
        'drive': {'coordinate': 'bob', 'torque': {}, 'speed': 0.0, 'start_angle': '-90 deg'},
    }
    solution = ms.simulate(made(scene, 'bob'), duration=0.51)
    reach = math.sqrt(math.log(3000.0 / 20.0))
    begin, share = 0.503 - 1e-3 * reach, 0.5 * (1.0 + math.erf(reach))
    v = 3.0 * ROOT * share - 20.0 * (0.51 - begin)
    assert solution.energy.final == pytest.approx(0.5 * v * v, rel=1e-9)


@pytest.mark.parametrize('width', [1e-3, 7e-6])
def test_a_load_that_moves_nothing_is_seen(width):
    """On a crank that is driven, beside a disk that flies in its loose pin."""
    scene = {
        'title': 'a disk in a loose pin',
        'gravity': [0, 0],
        'links': {
            'ground': {},
            'crank': {'mass': 1.0, 'inertia': 0.01, 'cog': 0.0, 'length': 0.2},
            'disk': {'mass': 0.7, 'inertia': 0.01, 'cog': 0.0, 'length': 0.1},
        },
        'joints': {
            'O': {'revolute': ['ground', 'crank.start']},
            'P': {
                'revolute': ['crank.end', 'disk.start'],
                'clearance': {'radial': 0.1, 'restitution': 1.0},
            },
        },
        'loads': {'g': {'at': 'crank', 'torque': f'-5*exp(-((crank - 0.503)/{width})**2)'}},
        'drive': {'coordinate': 'crank', 'speed': '10 rad/s', 'start_angle': 0.0},
        'initial': {'position': {'disk.x': 0.2}, 'velocity': {'disk.x': -0.5, 'disk.y': 1.0}},
    }
    machine = made(scene, 'disk')
    solution = ms.simulate(machine, duration=0.09)
    assert not solution.impacts
    mean, highest = measure(machine, solution, 'mean(drive_torque)', 'highest(drive_torque)')
    assert mean.value == pytest.approx(5.0 * ROOT * width / 0.9, rel=1e-9)
    assert highest.value == pytest.approx(5.0, rel=1e-9)


@pytest.mark.parametrize('width', [1e-3, 7e-6])
def test_a_load_across_a_guide_is_seen(width):
    force = f'3*exp(-((t - 0.503)/{width})**2)'
    machine = slider('1', loads={'f': {'at': 'block', 'force': ['1', force]}})
    found = measure(machine, ms.simulate(machine, duration=1.0), 'integral(reaction.guide.y)')
    assert abs(found[0].value) == pytest.approx(3.0 * ROOT * width, rel=1e-9)


def test_a_smooth_load_of_order_500():
    """``I w w' = -a (1 + sin(500 q))``: the work of the load is what the wheel loses."""
    solution = ms.simulate(wheel('-0.1*(1+sin(500*wheel))'), duration=0.3)
    q, v = (
        float(solution.sample([0.3], f'{x}.wheel')[f'{x}.wheel'][0])
        for x in ('position', 'velocity')
    )
    work = 0.1 * (q + (1.0 - math.cos(500.0 * q)) / 500.0)
    assert 0.5 * 0.01 * (400.0 - v * v) == pytest.approx(work, rel=1e-12)


@pytest.mark.parametrize('width', [1e-2, 1e-4, 1e-6])
def test_a_pulse_of_a_table(width):
    """A table over displacement, a triangle of a width, and one of time."""
    points = [[0, 0], [1.7, 0], [1.7 + width, -0.4 / width], [1.7 + 2 * width, 0], [9, 0]]
    table = {'tables': {'pulse': {'points': points}}}
    v = last_speed(slider('pulse(x)', speed=1.0, **table), 4.0)
    assert v == pytest.approx(math.sqrt(1.0 - 0.8), rel=max(1e-11, 1e-15 / width))
    v = last_speed(slider('pulse(t)', speed=1.0, **table), 4.0)
    assert v == pytest.approx(1.0 - 0.4, rel=max(1e-11, 1e-15 / width))


@pytest.mark.parametrize('width', [1e-3, 2.4e-6, 1e-8])
def test_a_table_over_speeds_of_which_few_have_digits_is_passed(width):
    """Its corners fall between two speeds; between them the force is linear in the speed."""
    tables = {'triangle': {'points': [[-1, 0], [0, 1], [1, 0]]}}
    for place in np.random.default_rng(5).uniform(1.0, 1.4, 4):
        force = f'-1 - 0.8*triangle((vx - {place})/{width}) + (1 if x > 2 else 0)'
        v = last_speed(slider(force, speed=1.5, tables=tables), 1.0)
        within = 2.0 * width / 0.8 * math.log(1.8)
        assert v == pytest.approx(0.5 + within - 2.0 * width, rel=1e-13)


def test_a_cyclic_table_gives_its_pulse_in_every_turn():
    points = [[0, 0], [2.0, 0], [2.00005, 1e4], [2.0001, 0], [2.0 * math.pi, 0]]
    tables = {'pulse': {'points': points, 'cyclic': True}}
    solution = ms.simulate(wheel('pulse(wheel)', inertia=1.0, tables=tables), duration=3.0)
    turns = (solution.sample([3.0], 'position.wheel')['position.wheel'][0] - 2.0) // (
        2.0 * math.pi
    ) + 1.0
    v = solution.sample([3.0], 'velocity.wheel')['velocity.wheel'][0]
    assert turns > 9
    assert v == pytest.approx(math.sqrt(400.0 + 2.0 * 0.5 * turns), rel=1e-11)


def test_the_motion_does_not_depend_on_how_it_is_asked_for():
    machine = slider('5*exp(-((t-0.5)/1e-4)**2)/1e-4 + sin(40*t)', 'tanh(vx/1e-3)')

    def digest(ends, most):
        run, found = machine.start(), MotionDigest()
        for end in ends:
            while run.time < end:
                before = run.steps
                run.advance(end, most=most)
                motion, impacts, _ = run.drain()
                found.add(motion, impacts)
                if run.steps == before:
                    break
        run.advance(1.0, final=True)
        motion, impacts, _ = run.drain()
        found.add(motion, impacts)
        return found.hexdigest()

    ends = np.sort(np.random.default_rng(5).uniform(0.4, 0.6, 50))
    assert digest(ends, None) == digest([], None) == digest(ends, 3)


# --- ideal machines ------------------------------------------------------------------------------


def driven(torque, speed=20.0, **changes):
    """A crank that turns steadily under its weight and a torque."""
    scene = {
        'title': 'a crank',
        'links': {'ground': {}, 'cr': {'mass': 1.0, 'inertia': 0.01, 'cog': 0.1, 'length': 0.2}},
        'joints': {'O': {'revolute': ['ground', 'cr.start']}},
        'gravity': [0, -9.81],
        'loads': {'f': {'at': 'cr', 'torque': torque, **changes}},
        'drive': {'coordinate': 'cr', 'speed': f'{speed} rad/s'},
    }
    return made(scene, 'crank')


def figures(machine):
    """Of a turn: work of the drive, its highest torque, its root mean square."""
    run = ms.simulate(machine, revolutions=1)
    found = measure(machine, run, 'highest(drive_torque)', 'rms(drive_torque)')
    return run.energy.drive_work, *(float(x.value) for x in found)


def test_figures_of_a_crank_under_a_pulse():
    """The example of an issue; the weight's share of the mean square beside it."""
    angles = [2.0 + 0.01 * k for k in (-8, -4, -2, -1, 0, 1, 2, 4, 8)]

    def torque(q):
        return 500.0 * math.exp(-(((q - 2.0) / 0.01) ** 2)) + 0.981 * math.cos(q)

    square = scipy.integrate.quad(
        lambda q: torque(q) ** 2, 0.0, 2.0 * math.pi, points=angles, limit=500, epsrel=1e-12
    )[0]
    top = scipy.optimize.minimize_scalar(
        lambda q: -torque(q), bounds=(1.999, 2.001), method='bounded', options={'xatol': 1e-9}
    )
    work, highest, rms = figures(driven('-500*exp(-((cr-2.0)/0.01)**2)'))
    assert work == pytest.approx(5.0 * ROOT, rel=1e-9)
    assert highest == pytest.approx(-top.fun, rel=1e-10)
    assert rms == pytest.approx(math.sqrt(square / (2.0 * math.pi)), rel=1e-9)


@pytest.mark.sample(2)
@pytest.mark.parametrize('width', [1e-1, 1e-2, 1e-3, 1e-4, 1e-5])
def test_no_pulse_over_an_ideal_crank_is_missed(width):
    for place in np.random.default_rng(round(1.0 / width)).uniform(0.6, 5.6, 3):
        solution = ms.simulate(
            driven(f'-0.5*exp(-((cr-{place})/{width})**2)/{width}'), revolutions=1
        )
        assert solution.energy.drive_work == pytest.approx(0.5 * ROOT, rel=1e-9)
        assert abs(solution.energy.residual) < 1e-9


@pytest.mark.sample(2)
@pytest.mark.parametrize('width', [1e-2, 1e-4, 1e-5])
def test_pulses_along_the_way_of_an_ideal_piston(width):
    """Passed on the way out only, and one of time beside them."""
    place = f'-exp(-((x-0.22)/{width})**2)/{width}*(1 if vx > 0 else 0)'
    time = '-2*vx*exp(-((t-0.0313)/1e-5)**2)'
    loads = {
        'f': {'at': 'piston', 'force': [f'{place}', 0]},
        'g': {'at': 'piston', 'force': [time, 0]},
    }
    machine = ms.load_scene('slider_crank', {'loads': loads})
    solution = ms.simulate(machine, revolutions=1)
    v = solution.sample([0.0313], 'velocity.piston')['velocity.piston'][0]
    moved = 1e-5 * math.sqrt(math.pi)
    share = 0.5 * (math.erf(0.03 / width) + math.erf(0.07 / width))  # of its stroke
    wanted = ROOT * share + 2.0 * v * v * moved
    assert solution.energy.dissipated == pytest.approx(wanted, rel=1e-7)


@pytest.mark.sample(3)
@pytest.mark.parametrize('share', [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize('free', [False, True])
def test_a_narrow_part_of_a_turn_is_passed_in_every_turn(share, free):
    """``during`` a share of a turn: its work does not depend on where the steps are."""
    width = 2.0 * math.pi * share
    during = {'coordinate': 'cr', 'from': 2.0, 'to': 2.0 + width}
    machine = driven(-1.0 / width, during=during)
    if free:
        scene = machine.scene.model_dump(exclude_none=True, by_alias=True)
        scene['drive'] = {'coordinate': 'cr', 'speed': '20 rad/s', 'torque': {}}
        scene['links']['cr']['inertia'] = 100.0
        machine = made(scene, 'crank')
    solution = ms.simulate(machine, duration=0.9)  # not quite three turns
    # ends are located to some roundings of a step's range of angles
    assert solution.energy.dissipated == pytest.approx(3.0, rel=max(1e-9, 1e-11 / width))


def test_conditions_that_pulses_fulfil_over_an_ideal_crank():
    width = 1e-5
    load = f'{-1.0 / width} if exp(-((cr-2.003)/{width})**2) > 0.5 else 0'
    solution = ms.simulate(driven(load), revolutions=1)
    wanted = 2.0 * math.sqrt(math.log(2.0))
    assert solution.energy.drive_work == pytest.approx(wanted, rel=1e-9)


def test_the_mean_of_an_ordinary_load_of_order_60():
    solution = ms.simulate(driven('-10*(1+sin(60*cr))**2'), revolutions=1)
    assert solution.energy.drive_work == pytest.approx(15.0 * 2.0 * math.pi, rel=1e-12)


# --- enclosures ----------------------------------------------------------------------------------


def fixed(series, length=1.0):
    return MotionSeries(np.atleast_2d(series), length, np.zeros(0), np.zeros(1))


@pytest.mark.parametrize(
    'name', [*FUNCTIONS, 'square', 'cube', 'reciprocal', 'product', 'direction']
)
def test_an_enclosure_holds_all_values(name):
    x = hy.make_vars('x')
    known = {
        **FUNCTIONS,
        'square': lambda y: y**2.0 * y**4.0 * y**4.0,
        'cube': lambda y: (y * y * y) ** 3.0,
        'reciprocal': lambda y: 1.0 / (y - 0.5),
        'direction': lambda y: hy.atan2(hy.sin(y), 5.0 + y),
        'product': lambda y: hy.exp(y) * hy.sin(3.0 * y) * hy.tanh(y - 1.0),
    }
    enclosure = Enclosure([hy.expression(1.0) * known[name](1.0 * x + 0.25)], [], [x], [])
    rng = np.random.default_rng(1)
    middle = rng.uniform(-3.0, 3.0, 300)
    radius = 10.0 ** rng.uniform(-6.0, 0.0, 300)
    parts = enclosure(fixed([0.0]), np.ones(1), middle[None], radius[None])
    seen = 0
    for k, (m, r) in enumerate(zip(middle, radius, strict=True)):
        at = np.linspace(m - r, m + r, 51)[None]
        values = enclosure(fixed([0.0]), np.ones(1), at, np.zeros_like(at)).middle
        values = values[:, np.isfinite(values).all(axis=0)]
        size = parts.radius[:, k, None] * (1.0 + 1e-12) + 1e-13 * (1.0 + np.abs(values))
        assert (np.abs(values - parts.middle[:, k, None]) <= size).all()
        seen += values.size
    assert seen > 5000


def test_what_a_pole_makes_is_without_limit():
    """So that it is looked at in ever smaller parts, and found."""
    x = hy.make_vars('x')
    enclosure = Enclosure([1.0 / (x - 0.7)], [], [x], [])
    found = reach_of(enclosure, fixed([0.0, 1.0]), np.full(1, 1e-12), lambda at: np.abs(at) * 0.0)
    assert found.fault == pytest.approx(0.7, abs=1e-9)


def test_overestimation_shortens_no_step():
    """``x^2 + y^2`` of a point on a circle is a constant that no interval knows as one."""
    x, y = hy.make_vars('x', 'y')
    enclosure = Enclosure([hy.exp(-(x * x + y * y)) + hy.sqrt(x * x + y * y)], [], [x, y], [])
    power = np.arange(21)
    wave = 2.0**power / np.array([math.factorial(k) for k in power])
    motion = fixed([wave * np.cos(0.5 * np.pi * power), wave * np.sin(0.5 * np.pi * power)])
    looks = []

    def defect(at):
        looks.append(len(at))
        return np.zeros(len(at))

    assert reach_of(enclosure, motion, np.full(1, 1e-12), defect).fault is None
    assert sum(looks) < 1000


@pytest.mark.slow
@pytest.mark.parametrize('load', ['3 N', '-500*exp(-((crank - 1.7)/0.001)^2)'])
def test_laws_have_more_powers_than_few_digits_ask_for(load):
    """A formula of position is of degree 12, more than the order of steps at such tolerances."""
    scene = {
        'drive': {'position': '90 deg + 60 deg*sin(6*t)^7*exp(-t)'},
        'loads': {'p': {'at': 'piston', 'force': [load, '0 N']}},
        'joints.rod_piston.clearance': {'radial': '0.1 mm', 'restitution': 0.5},
        'start': 'seated',
    }
    found = [
        ms.simulate(
            ms.load_scene('slider_crank', scene | {'solver.rtol': rtol}), duration='0.3 s'
        ).sample(0.3, 'position.piston', 'velocity.crank')
        for rtol in (1e-4, 1e-5, 1e-11)
    ]
    for name, exact in found[-1].items():
        assert found[0][name] == pytest.approx(exact, rel=0.02, abs=3e-4)
        assert found[1][name] == pytest.approx(exact, rel=0.02, abs=3e-4)


def test_a_table_whose_row_has_the_number_of_what_holds():
    """Rows 2 of tables turned to and fro at one instant were taken for switches that hold."""
    tables = {
        'press': {'points': [['90 mm', '300 N'], ['97 mm', '100 N'], ['97.01 mm', '0 N'],
                             ['97.02 mm', '100 N'], ['110 mm', '0 N']]},
        'gas': {'points': [[0, 0], [1, 30], [2, 5], [4, 9], [math.tau, 0]],
                'interpolation': 'cubic', 'periodic': True},
    }  # fmt: skip
    drive = {
        'coordinate': 'crank', 'start_angle': '90 deg', 'speed': '300 rpm',
        'torque': {'per_speed': '-0.002 N m s/rad'}, 'flywheel': '0.01 kg m^2',
    }  # fmt: skip
    machine = ms.load_scene({
        'title': 'x', 'mechanism': 'linkage', 'gravity': [0, -9.81],
        'links': {
            'crank': {'length': '25 mm', 'cog': '-5 mm', 'mass': '0.6 kg', 'inertia': 2.5e-4},
            'rod': {'length': '100 mm', 'cog': '30 mm', 'mass': '0.15 kg', 'inertia': 2.3e-4},
            'piston': {'mass': '0.2 kg'},
        },
        'joints': {
            'a': {'revolute': ['ground', 'crank']}, 'b': {'revolute': ['crank.end', 'rod']},
            'c': {'revolute': ['rod.end', 'piston']},
            'd': {'prismatic': ['ground', 'piston'], 'axis': '90 deg'},
        },
        'guess': {'rod': '90 deg', 'piston': '125 mm'}, 'drive': drive, 'tables': tables,
        'loads': {'p': {'at': 'piston', 'force': ['0 N', '-press(piston) - gas(crank)']}},
    })  # fmt: skip
    energy = ms.simulate(machine, duration=0.8).energy
    assert abs(energy.residual) < 1e-9 * energy.exchanged
