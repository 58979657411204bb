"""Links of mass 0 beside others: lumped masses."""

import math

import numpy as np
import pytest
import scipy
from builders import made, without_work

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.scene import scene_names
from mechanism_sim.studies.modes import modes

G, L, R = 9.81, 0.2, 0.05


def lumped(links, joints, **more):
    scene = {'title': 'lumped', 'links': links, 'joints': joints, **more}
    return made(scene, 'lumped')


def test_a_point_mass_on_a_rod_swings_with_the_period_of_the_elliptic_integral():
    begin = math.radians(60.0)
    machine = lumped(
        {'rod': {'length': L, 'mass': 0}},
        {'O': {'revolute': ['ground', 'rod']}},
        masses={'bob': {'at': 'rod.end', 'mass': 3.0}},
        gravity=[0, -G],
        initial={'position': {'rod': begin - 0.5 * math.pi}},
    )
    period = 4.0 * math.sqrt(L / G) * float(scipy.special.ellipk(math.sin(0.5 * begin) ** 2))
    seen = ms.simulate(machine, duration=period).view([0.5 * period, period]).observed
    expected = [-begin - 0.5 * math.pi, begin - 0.5 * math.pi]
    assert seen.position[0] == pytest.approx(expected, abs=1e-11)
    # at its ends the rod pulls the bob with the weight's part along it
    assert np.hypot(*seen.reaction[0]) == pytest.approx(3.0 * G * math.cos(begin), rel=1e-9)


def slider_crank(**masses):
    """Crank with a flywheel, rod and piston under a weight; moved by nothing."""
    return lumped(
        {
            'crank': {'length': R, 'mass': 0, 'inertia': 2e-3},
            'rod': {'length': L, 'mass': 0},
            'piston': {'mass': 1.5, **masses},
        },
        {
            'A': {'revolute': ['ground', 'crank']},
            'B': {'revolute': ['crank.end', 'rod']},
            'C': {'revolute': ['rod.end', 'piston']},
            'D': {'prismatic': ['ground', 'piston'], 'axis': '90 deg'},
        },
        drive={'coordinate': 'crank', 'start_angle': 0.3, 'speed': 25.0, 'torque': {}},
        guess={'rod': 1.5, 'piston': L},
        gravity=[0, -G],
    )


def test_a_massless_rod_takes_force_along_itself_only_and_energy_gives_the_speed():
    """[V] 3.3, case 3; and ``(J + m s'^2) w^2/2 + m g s`` is constant."""
    machine = slider_crank()
    solution = ms.simulate(machine, duration=1.0)
    seen = without_work(solution, np.linspace(0.0, 1.0, 200))
    th, w = seen['position.crank'], seen['velocity.crank']
    c = np.sqrt(L**2 - (R * np.cos(th)) ** 2)
    s, slope = R * np.sin(th) + c, R * np.cos(th) + R**2 * np.sin(th) * np.cos(th) / c
    energy = 0.5 * (2e-3 + 1.5 * slope**2) * w**2 + 1.5 * G * s
    assert energy == pytest.approx(energy[0], rel=1e-11)
    along = np.arctan2(c, -R * np.cos(th))
    for joint in 'BC':
        across = seen[f'reaction.{joint}.y'] * np.cos(along)
        across -= seen[f'reaction.{joint}.x'] * np.sin(along)
        assert across == pytest.approx(0.0, abs=1e-10 * np.abs(seen[f'reaction.{joint}.y']).max())
    assert seen['position.rod'] == pytest.approx(along, abs=1e-12)
    # what the rod carries is what accelerates the piston
    up = seen['reaction.C.y'] - 1.5 * G
    assert up == pytest.approx(1.5 * seen['acceleration.piston'], abs=1e-9)
    assert abs(solution.energy.residual) < 1e-12


def test_a_machine_without_any_mass_is_statics():
    """The drive supplies what the load takes, at every instant."""
    masses = {f'links.{x}.mass': 0 for x in ('crank', 'rod', 'piston')}
    inertia = {f'links.{x}.inertia': 0 for x in ('crank', 'rod')}
    load = {'loads.work': {'at': 'piston', 'force': ['-400 N', '0 N']}}
    found = ms.cycle(ms.load_scene('slider_crank', masses | inertia | load), 36)
    power = -400.0 * found['velocity.piston']
    assert found['drive_torque'] * found['velocity.crank'] == pytest.approx(-power, abs=1e-9)
    assert not any('mass_centre' in name for name in found.table())


def test_half_a_car_has_the_modes_of_its_two_equations():
    """[V] 6.13 about the equilibrium, springs level: the guide carries nothing."""
    level = {'springs.front.damping': '0 N s/m', 'springs.rear.damping': '0 N s/m'}
    machine = ms.load_scene('half_car', level | {'gravity': [0, 0], 'initial.position': {},
                                                 'guess.guide': '600 mm'})  # fmt: skip
    k1, k2, a, b = 22e3, 20e3, 1.3, 1.6
    K = np.array([[k1 + k2, k1 * a - k2 * b], [k1 * a - k2 * b, k1 * a**2 + k2 * b**2]])
    expected = np.sqrt(scipy.linalg.eigh(K, np.diag([700.0, 1200.0]), eigvals_only=True))
    found = [m.frequency for m in modes(machine)]
    assert found == pytest.approx(expected / (2.0 * math.pi), rel=1e-9)


LOOSE = {'radial': 1e-4, 'restitution': 0.5}
DOUBLE = {'links.first.mass': 0, 'links.first.inertia': 0}


@pytest.mark.parametrize(
    ('scene', 'changes', 'links', 'key'),
    [
        ('slider_crank', {'joints.crank_rod.clearance': LOOSE}, ['rod'], 'rod'),
        ('half_car', {'links.body.mass': 0, 'links.body.inertia': 0}, ['guide', 'body'], ''),
        ('four_bar_clearance', {'links.rocker.mass': 0, 'links.rocker.inertia': 0}, ['rocker'],
         'rocker'),
        ('four_bar_clearance', {f'links.{x}.{k}': 0 for x in ('coupler', 'rocker')
                                for k in ('mass', 'inertia')}, ['coupler', 'rocker'], ''),
        ('torsional_shaft', {'links.second.mass': 0, 'links.second.inertia': 0}, ['second'],
         'second'),
    ],
)  # fmt: skip
def test_links_that_move_without_mass_are_named(scene, changes, links, key):
    if scene == 'slider_crank':
        changes = changes | {'links.rod.mass': 0, 'links.rod.inertia': 0}
    with pytest.raises(InputError, match='without moving any mass') as refused:
        ms.load_scene(scene, changes)
    said = str(refused.value)
    names = said.partition(': ')[2].partition(' can move')[0].split(' and ')
    assert set(names) <= set(links)
    assert f"'links.{key or names[0]}.mass'" in said


def test_a_mass_on_two_massless_rods_is_free_in_the_plane_until_they_are_in_line():
    rods = {n: {'length': x, 'mass': 0} for n, x in (('one', 0.3), ('two', 0.4))}
    joints = {'O': {'revolute': ['ground', 'one']}, 'A': {'revolute': ['one.end', 'two']}}
    more = {
        'masses': {'ball': {'at': 'two.end', 'mass': 2.0}},
        'gravity': [0, -G],
        'drive': {'coordinate': 'one', 'start_angle': -0.4, 'torque': {}},
    }
    machine = lumped(rods, joints, initial={'position': {'two': 1.2}}, **more)
    t = 0.1
    seen = ms.simulate(machine, duration=t).view(t).observed
    place = machine.mechanism.locate_all('two', seen.position, (0.4, 0.0))[:, 0]
    start = machine.mechanism.locate('two', {'one': -0.4, 'two': 1.2}, (0.4, 0.0))
    # nothing holds the ball: it falls
    assert place == pytest.approx([start[0], start[1] - 0.5 * G * t**2], abs=1e-12)
    with pytest.raises(InputError, match='without moving any mass'):
        lumped(rods, joints, initial={'position': {'two': -0.4}}, **more)


QUICK = 'catapult', 'half_car', 'rotor_on_supports', 'vibration_absorber'


def lightened(name, seed):
    """A scene, some links of which have no mass: its energy residual, or None if it is refused."""
    rng = np.random.default_rng(seed)
    machine = ms.load_scene(name)
    links = [n for n in machine.plan.links if machine.scene.links[n].mass is not None]
    chosen = [n for n in links if rng.random() < 0.5]
    changes = {f'links.{n}.{key}': 0 for n in chosen for key in ('mass', 'inertia')}
    try:
        machine = ms.load_scene(name, changes)
    except InputError as error:
        known = (
            'without moving any mass', 'not determined', 'fit no beam with masses',
            'a link that leans needs mass',
        )  # fmt: skip
        if not any(x in str(error) for x in known):
            raise
        return None
    duration = min(machine.scene.duration or machine.drive.period, 1.0)
    solution = ms.simulate(machine, duration=duration)
    if solution.energy is None:
        return None
    e = solution.energy
    # a machine may begin and end at a dead point, with no energy but what went to and fro
    size = max(map(abs, (e.initial, e.final, e.drive_work, e.dissipated, e.exchanged)))
    seen = solution.sample(np.linspace(0.0, duration, 9))
    assert all(np.isfinite(x).all() for n, x in seen.items() if n.startswith('acceleration'))
    return abs(e.residual) / max(size, 1e-6)


@pytest.mark.parametrize('name', QUICK)
def test_random_links_without_mass(name):
    found = [lightened(name, seed) for seed in range(3)]
    assert all(x is None or x < 1e-10 for x in found)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize('name', [n for n in scene_names() if n != 'whole_machine'])
def test_random_links_without_mass_in_every_scene(name):
    found = [lightened(name, seed) for seed in range(3)]
    assert all(x is None or x < 1e-9 for x in found)
