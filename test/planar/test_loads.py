"""Loads keep their meaning when a joint gets loose, when links turn often, and on sliders."""

import math

import numpy as np
import pytest
import scipy
from builders import compilations, made
from scipy.integrate import quad

import mechanism_sim as ms
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError, RunError


def machine(**changes):
    """A crank whose pin carries a block on a rocker."""
    scene = {
        'title': 'quick return',
        'links': {
            'ground': {'points': {'O': [0, 0], 'C': [0.3, 0]}},
            'crank': {'length': 0.1, 'mass': 1.0, 'inertia': 0.01, 'cog': 0.05},
            'block': {'mass': 0.5, 'inertia': 0.001},
            'rocker': {'length': 0.5, 'mass': 1.0, 'inertia': 0.02, 'cog': 0.2},
        },
        'joints': {
            'O': {'revolute': ['ground.O', 'crank.start']},
            'A': {'revolute': ['crank.end', 'block']},
            'C': {'revolute': ['ground.C', 'rocker.start']},
            'S': {'prismatic': ['rocker', 'block']},
        },
        'gravity': [0, -9.81],
        'drive': {'coordinate': 'crank', 'speed': '5 rad/s', 'start_angle': 1.0},
        'guess': {'rocker': '160 deg', 'block': '160 deg'},
        **changes,
    }
    return made(scene, 'test')


@pytest.mark.parametrize('loose', [False, True])
@pytest.mark.parametrize(
    ('load', 'moment'),
    [
        ({'torque': '-5*sin(block) - block_rate'}, lambda q, v: -5.0 * np.sin(q) - v),
        (
            {'torque': 5.0, 'during': {'coordinate': 'block', 'from': '165 deg', 'to': '180 deg'}},
            lambda q, _: 5.0 * ((q - np.radians(165.0)) % (2.0 * np.pi) < np.radians(15.0)),
        ),
    ],
)
def test_a_coordinate_in_a_load_is_what_it_is_without_clearance(load, moment, loose):
    """The loose joint lets a guide carry the block, whose coordinate is a displacement then."""
    joints = machine().scene.model_dump(exclude_none=True)['joints']
    if loose:
        joints['A']['clearance'] = {'radial': 1e-4, 'restitution': 0.5}
    run = machine(loads={'f': {'at': 'rocker', **load}}, joints=joints)
    assert ('block' in run.mechanism.displacements) is loose
    seen = ms.simulate(run, duration=1.25).view(np.linspace(0.1, 1.2, 30)).observed
    i = run.mechanism.coordinates.index('rocker')
    angle, rate = seen.position[i], seen.velocity[i]  # the block turns with the rocker
    expected = moment(angle, rate) * rate
    assert np.ptp(expected) > 0.5
    assert -seen.friction_power == pytest.approx(expected, abs=1e-9)


def wheel(drive, **loads):
    scene = {
        'title': 'wheel',
        'links': {'ground': {}, 'wheel': {'mass': 1.0, 'inertia': 0.01}},
        'joints': {'O': {'revolute': ['ground', 'wheel']}},
        'loads': {'f': {'at': 'wheel', **loads}},
        'drive': {'coordinate': 'wheel', 'speed': '60 rad/s', **drive},
    }
    return made(scene, 'test')


def test_angles_in_formulas_count_all_turns():
    """A formula as a spring: three turns out and back, as a sine."""
    swing = ms.simulate(wheel({'torque': {}}, torque='-0.1*wheel'), duration=3.0)
    t = np.linspace(0.0, 3.0, 31)
    w = np.sqrt(0.1 / 0.01)
    assert swing.sample(t, 'position.wheel')['position.wheel'] == pytest.approx(
        60.0 / w * np.sin(w * t), abs=1e-10
    )
    driven = ms.simulate(wheel({}, torque='-0.1*wheel'), duration=3.0)
    assert driven.sample(t, 'drive_torque')['drive_torque'] == pytest.approx(6.0 * t, abs=1e-12)


def test_a_range_must_not_be_empty():
    with pytest.raises(InputError, match="leave out 'during'"):
        wheel({}, torque=1.0, during={'coordinate': 'wheel', 'from': '10 deg', 'to': '370 deg'})


@pytest.mark.parametrize('width', [0.1, 1e-2, 1e-3, 1e-4])
def test_steep_formulas_are_not_stepped_over(width):
    """``m v' = -F tanh(v/w)``: sinh(v/w) falls as exp(-F t/(m w)), whatever w is."""
    scene = {
        'title': 'a block that friction stops',
        'links': {'block': {'mass': 2.0}},
        'joints': {'guide': {'prismatic': ['ground', 'block']}},
        'drive': {'coordinate': 'block', 'speed': '1 m/s', 'force': {}},
        'loads': {'drag': {'at': 'block', 'force': [f'-4*tanh(vx/{width})', 0]}},
    }
    block = made(scene, 'block')
    solution = ms.simulate(block, duration=1.0)
    t = np.linspace(0.0, 1.0, 101)
    # the logarithm of sinh: its argument begins at 10,000
    log = 1.0 / width + np.log1p(-np.exp(-2.0 / width)) - np.log(2.0) - 2.0 * t / width
    large = log > 30.0
    wanted = width * np.where(large, log + np.log(2.0), np.arcsinh(np.exp(np.minimum(log, 30.0))))
    assert solution.sample(t, 'velocity.block')['velocity.block'] == pytest.approx(
        wanted, abs=1e-12
    )
    assert abs(solution.energy.residual) < 1e-12


@pytest.mark.parametrize('width', [0.1, 1e-3])
def test_friction_by_an_arc_tangent_takes_the_time_that_its_integral_says(width):
    """``m v' = -F (2/pi) atan(v/w)``: ``dt = -m dv/F``, over the share of F."""
    scene = {
        'links': {'block': {'mass': 2.0}},
        'joints': {'guide': {'prismatic': ['ground', 'block']}},
        'drive': {'coordinate': 'block', 'speed': '1 m/s', 'force': {}},
        'loads': {'drag': {'at': 'block', 'force': [f'-8/pi*atan(vx/{width})', 0]}},
    }
    solution = ms.simulate(made(scene), duration=0.5)
    t = np.linspace(0.1, 0.5, 5)
    for end, v in zip(t, solution.sample(t, 'velocity.block')['velocity.block'], strict=True):
        spent, _ = quad(
            lambda x: 2.0 * np.pi / 8.0 * np.exp(x) / np.arctan(np.exp(x) / width),
            np.log(v), 0.0, epsabs=0.0, epsrel=1e-12, limit=200,
        )  # fmt: skip
        assert spent == pytest.approx(end, rel=1e-11)
    assert abs(solution.energy.residual) < 1e-12


def test_a_step_in_a_machine_keeps_the_books():
    """Dry friction of a piston at each of its dead points, written as a tanh."""
    rub = {'loads': {'rub': {'at': 'piston', 'force': ['-50*tanh(vx/1e-3)', 0]}}}
    free = {'drive': {'speed': 60.0, 'torque': {}}}
    solution = ms.simulate(ms.load_scene('slider_crank', rub | free), duration=0.5)
    assert solution.energy.dissipated > 1.0
    assert abs(solution.energy.residual) < 1e-11 * solution.energy.dissipated


def test_another_number_in_a_formula_compiles_nothing_anew():
    """A wheel that is braked, against the exponential that solves it."""
    misses = []
    for c, a, b in (('0.106', '0.3', '0.7'), ('0.107', '0.4', '0.6')):
        load = f'-{c}*wheel_rate*({a} + {b})'
        solution = ms.simulate(wheel({'torque': {}}, torque=load), duration=0.2)
        wanted = 60.0 * np.exp(-float(c) / 0.01 * 0.2)
        assert solution.sample([0.2], 'velocity.wheel')['velocity.wheel'] == pytest.approx(
            [wanted], rel=1e-12
        )
        misses.append(compilations())
    assert misses[0] == misses[1]
    ms.simulate(wheel({'torque': {}}, torque='-0.001*wheel_rate**3'), duration=0.2)
    cube = compilations()
    ms.simulate(wheel({'torque': {}}, torque='-0.001*wheel_rate**4'), duration=0.2)
    assert compilations() > cube > misses[1]  # exponents shape the expression


@pytest.mark.slow
def test_a_formula_may_have_units_and_pi():
    """The same load, written in three ways."""
    texts = (
        '3*sin(2*pi*20*t + 0.5235987755982988) - 0.02*wheel_rate',
        '3*sin(2*pi*20*t + 30 deg) - 0.02*wheel_rate',
        '3 N m*sin(30 deg + 2*pi*20 Hz*t) - 20 N mm s/rad*wheel_rate',
    )
    ends = []
    for text in texts:
        model = ms.load_scene('gear_rattle', {'loads.shaking.torque': text})
        ends.append(
            ms.simulate(model, duration=0.05).sample([0.05], 'velocity.wheel')['velocity.wheel'][0]
        )
    assert ends == pytest.approx([ends[0]] * 3, rel=1e-9)


@pytest.mark.parametrize(
    ('torque', 'said'),
    [
        ('3 N*sin(wheel)', 'is in N, not in N m'),
        ('3 N m*sin(t)', 'needs a plain number, not one in s'),
        ('2 N m*wheel_rate', 'is in W, not in N m'),
        ('300/min', "names 'min', a unit"),
        ('2*pi t', "'t' cannot stand behind 'pi'"),
        ('3 kg', 'is not a unit of'),
        ('(t > 2)*3', 'the condition .* is not a value'),
    ],
)
def test_a_load_of_another_unit_is_refused(torque, said):
    with pytest.raises(InputError, match=said):
        ms.load_scene('gear_rattle', {'loads.shaking.torque': torque})


@pytest.mark.parametrize('formula', ['sqrt(crank_rate-100)', 'log(t-0.1)', 'sqrt(0.3-t)'])
@pytest.mark.parametrize('command', ['solve', 'cycle'])
def test_a_formula_out_of_its_range_ends_in_a_sentence_without_free_coordinates(
    capsys, formula, command
):
    load = f'loads={{cutting: {{at: ram, force: ["{formula}", 0 N]}}}}'
    with pytest.raises(SystemExit) as ended:
        main([command, 'quick_return', '--set', load])
    said = capsys.readouterr()
    assert ended.value.code == 1
    assert 'a formula leaves its range at t = ' in said.err
    assert 'see loads.cutting' in said.err
    assert said.err.count('\n') == 1


def on_spring(free_length, damping, start):
    """A block whose spring hangs on the middle of its guide."""
    scene = {
        'title': 'made', 'gravity': [0.0, 0.0],
        'links': {'block': {'mass': 1.0}}, 'joints': {'guide': {'prismatic': ['ground', 'block']}},
        'springs': {'s': {'between': ['ground', 'block'], 'stiffness': '100 N/m',
                          'free_length': free_length, 'damping': f'{damping} N s/m'}},
        'initial': {'position': {'block': start}},
    }  # fmt: skip
    return made(scene, 'made')


def test_ends_of_a_spring_that_is_nothing_long_may_meet():
    for start in (0.1, 0.0):
        solution = ms.simulate(on_spring(0.0, 0.0, start), duration=1.0)
        seen = solution.sample(np.array([1.0]), 'position.block')['position.block']
        assert seen[0] == pytest.approx(start * math.cos(10.0), abs=1e-11)
    seen = ms.simulate(on_spring(0.0, 1.0, 0.1), duration=1.0).sample(np.array([1.0]))
    way = math.sqrt(100.0 - 0.25)  # damped by 1/2 a second: along its line it may pass, too
    passed = 0.1 * math.exp(-0.5) * (math.cos(way) + 0.5 / way * math.sin(way))
    assert seen['position.block'][0] == pytest.approx(passed, abs=1e-11)
    for length, damping in ((0.2, 0.0), (0.0, 1.0)):
        with pytest.raises(RunError, match=r'the ends of springs\.s meet at t = 0 s'):
            ms.simulate(on_spring(length, damping, 0.0), duration=1.0)
    meet = math.acos(-3.0 / 7.0) / 10.0
    with pytest.raises(RunError, match=rf'the ends of springs\.s meet at t = {meet:.9g} s'):
        ms.simulate(on_spring(0.03, 0.0, 0.1), duration=1.0)


@pytest.mark.parametrize('beside', [3e-3, 1e-3, 1e-4])
def test_ends_of_a_spring_may_pass_beside_each_other(beside):
    """Of a crank that is prescribed no spring shortens a step, in which its line turns far round.

    A pendulum beside it makes the machine one whose motion is integrated.
    """
    machine = made(
        {
            'gravity': [0.0, -9.81],
            'links': {
                'ground': {'points': {'anchor': [0.05 + beside, 0.0], 'hang': [0.5, 0.0]}},
                'crank': {'length': 0.05, 'mass': 1.0, 'inertia': 1e-3},
                'pendulum': {'length': 0.5, 'mass': 1.0, 'inertia': 0.1},
            },
            'joints': {
                'pivot': {'revolute': ['ground', 'crank']},
                'pin': {'revolute': ['ground.hang', 'pendulum']},
            },
            'drive': {'coordinate': 'crank', 'speed': '61.7 rpm'},
            'springs': {
                's': {
                    'between': ['ground.anchor', 'crank.end'],
                    'stiffness': 100.0,
                    'free_length': 0.1,
                }
            },
        },
        'beside',
    )
    solution = ms.simulate(machine, duration=2.0)
    assert abs(solution.energy.residual) < 1e-9


@pytest.mark.parametrize('power', ['1.3', '(-1/2)', '5', '0'])
def test_gas_is_compressed_by_a_power_of_its_volume(power):
    """Kinetic energy is the area below the polytrope, by quadrature."""
    machine = ms.load_scene({
        'mechanism': 'linkage', 'title': 'gas spring',
        'links': {'ground': {}, 'piston': {'mass': '2 kg'}},
        'joints': {'bore': {'prismatic': ['ground', 'piston'], 'axis': 0}},
        'initial': {'velocity': {'piston': '1 m/s'}},
        'loads': {'gas': {'at': 'piston', 'force': [
            f'-200 N*((100 mm/(100 mm - piston))^{power} - 1)', 0]}},
    })  # fmt: skip
    seen = ms.simulate(machine, duration=0.05).sample([0.01, 0.03, 0.05])
    n = eval(power)
    for x, v in zip(seen['position.piston'], seen['velocity.piston'], strict=True):
        area = scipy.integrate.quad(lambda s: 200.0 * ((0.1 / (0.1 - s)) ** n - 1.0), 0.0, x)[0]
        assert v**2 == pytest.approx(1.0 - area, abs=1e-13)
