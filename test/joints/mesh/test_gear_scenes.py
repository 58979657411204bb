"""Gears in scenes: trains, forces, phases of teeth, refusals, each by a second route."""

import math
from fractions import Fraction

import numpy as np
import pytest
from absolute import differences
from book_trains import compound_planetary, gear_box, planetary
from builders import made
from matplotlib.path import Path as Polygon
from scipy.integrate import simpson
from tooth_forces import helical
from willis import Mesh, Train

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.joints.mesh.constraint import GearMesh
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.check import check

M = 2e-3


def loaded(name, overrides=None):
    return ms.load_scene(name, overrides or {})


def end_of(machine, **span):
    return ms.simulate(machine, **(span or {'revolutions': 0.3}))


def triangle(a, b, c):
    """The corner at distances b from the origin and c from (a, 0)."""
    x = (b * b - c * c + a * a) / (2.0 * a)
    return [x, math.sqrt(b * b - x * x)]


def random_gear_box(random):
    n = {str(k): int(random.integers(18, 60)) for k in (2, 5, 8, 9)}
    total = n['2'] + n['5']
    n['7'], n['6'] = (int(random.integers(18, total - 17)) for _ in range(2))
    n['4'], n['3'] = total - n['7'], total - n['6']
    gear = int(random.integers(1, 4))
    radii = M / 2 * (n['9'] + n['4']), M / 2 * (n['8'] + n['9'])
    if sum(radii) < M / 2 * total or abs(radii[0] - radii[1]) > M / 2 * total:
        return random_gear_box(random)  # the idler does not reach both
    changes = {f'gears.g{k}.teeth': count for k, count in n.items()}
    changes['links.ground.points'] = {
        'auxiliary': [M / 2 * total, 0.0],
        'idler': triangle(M / 2 * total, *radii),
    }
    changes['joints.engaged.mesh'] = [['g7', 'g4'], ['g6', 'g3'], ['g9', 'g4']][gear - 1]
    names = {'input': '2', 'auxiliary': '5', 'idler': '9', 'output': 'out'}
    return 'gear_box', changes, gear_box(n, gear), names, {}


def random_planetary(random):
    sun, planet = int(random.integers(18, 60)), int(random.integers(22, 60))
    ring = sun + 2 * planet
    changes = {
        'gears.sun.teeth': sun,
        'gears.planet.teeth': planet,
        'gears.ring.teeth': ring,
        'links.carrier.length': M / 2 * (sun + planet),
    }
    names = {'sun': '2', 'planet': '4', 'carrier': '3'}
    return 'planetary', changes, planetary(sun, planet, ring), names, {'5': 0.0}


def random_compound(random):
    n = {str(k): int(random.integers(18, 50)) for k in (2, 3, 4, 5, 6)}
    reach = M / 2 * (n['5'] + n['6'])
    sides = M / 2 * (n['2'] + n['3']), M / 2 * (n['3'] + n['4'])
    if sum(sides) < reach or abs(sides[0] - sides[1]) > reach:
        return random_compound(random)
    if n['2'] * n['5'] == n['4'] * n['6']:
        return random_compound(random)
    changes = {f'gears.g{k}.teeth': count for k, count in n.items()}
    changes |= {
        'links.carrier.length': reach,
        'links.carrier.points.third': triangle(reach, *sides),
    }
    names = {'sun': '2', 'third': '3', 'pair': '4', 'carrier': '7'}
    return 'compound_planetary', changes, compound_planetary(n), names, {'6': 0.0}


@pytest.mark.sample(1)
@pytest.mark.parametrize('make', [random_gear_box, random_planetary, random_compound])
def test_trains_turn_and_load_as_the_lists_of_their_meshes_say(make):
    """Speeds and torques of the scene against `gears.trains`, for random numbers of teeth."""
    random = np.random.default_rng(6)
    for _ in range(8):
        name, changes, train, names, held = make(random)
        machine = loaded(name, changes | {'gravity': [0.0, 0.0]})
        solution = end_of(machine)
        o = solution.view(np.array([0.4 * solution.duration])).observed
        rates = dict(zip(machine.mechanism.coordinates, o.velocity[:, 0], strict=True))
        driver, output = next(iter(names)), list(names)[-1]
        known = train.speeds({names[driver]: rates[driver], **held})
        for link, member in names.items():
            assert rates[link] == pytest.approx(known[member], rel=1e-12)
        brake = -float(machine.scene.loads[next(iter(machine.scene.loads))].torque.split('*')[0])
        torque = {names[output]: brake * -rates[output]}
        flow = train.flow({names[driver]: rates[driver], **held}, torque, [names[driver], *held])
        assert o.drive_torque[0, 0] == pytest.approx(flow.torque[names[driver]], rel=1e-10)


def test_a_differential_shares_its_torque_and_averages_its_speeds():
    teeth = {'2': 11, '3': 41, '4': 16, '5': 20, '6': 20}
    train = Train(
        teeth,
        (Mesh('2', '3', internal=True), Mesh('5', '4', '3'), Mesh('6', '4', '3', internal=True)),
        square=frozenset({'4'}),
    )
    machine = loaded('differential')
    solution = end_of(machine, duration=0.5)
    o = solution.view(np.linspace(0.1, 0.5, 5)).observed
    shaft, carrier, left, right = o.velocity
    for k in range(5):
        known = train.speeds({'2': shaft[k], '5': left[k]})
        assert carrier[k] == pytest.approx(known['3'], rel=1e-12)
        assert right[k] == pytest.approx(known['6'], rel=1e-11)
    inertia = machine.mechanism.body('left').inertia
    torques = inertia * o.acceleration[2:] + np.array([[2.0], [0.5]]) * o.velocity[2:]
    assert np.abs(torques[0] - torques[1]).max() < 1e-9 * np.abs(torques).max()
    joints = [j.name for j in machine.mechanism.joints]
    final, halved = (o.reaction_moment[joints.index(j)] for j in ('final', 'differential'))
    assert np.abs(final - torques.sum(axis=0)).max() < 1e-9 * np.abs(final).max()
    assert np.abs(halved - torques[1]).max() < 1e-9 * np.abs(halved).max()


@pytest.mark.sample(2)
@pytest.mark.parametrize('turns', [0.0, 1e5, 1e5 + 0.25])
def test_a_differential_moves_by_its_closed_form_wherever_it_starts(turns):
    """``J (l' - r') = -2 l + r/2`` with ``l + r = 2 w``: l goes to 0.4 w by exp(-1.25 t/J)."""
    machine = loaded('differential', {'drive.start_angle': f'{2.0 * math.pi * turns!r} rad'})
    t = np.linspace(0.0, 1.0, 21)
    seen = ms.simulate(machine, duration=1.0).sample(
        t, 'velocity.left', 'velocity.right', 'position.left'
    )
    w, J = 1000.0 * math.pi / 30.0 * 11.0 / 41.0, machine.mechanism.body('left').inertia
    slow, first = 0.4 * w, 268.29268 * math.pi / 30.0
    left = slow + (first - slow) * np.exp(-1.25 * t / J)
    assert seen['velocity.left'] == pytest.approx(left, rel=1e-13)
    assert seen['velocity.right'] == pytest.approx(2.0 * w - left, rel=1e-13)
    way = slow * t + (first - slow) * J / 1.25 * (1.0 - np.exp(-1.25 * t / J))
    assert seen['position.left'] - seen['position.left'][0] == pytest.approx(way, rel=1e-12)


@pytest.mark.parametrize('sense', [1.0, -1.0])
@pytest.mark.parametrize('helix', [0.0, 0.3])
def test_forces_between_teeth_are_those_of_the_book(sense, helix):
    """[V] 5.5 and 5.8: tangential, radial; pushed apart whichever flank carries."""
    c = math.cos(helix)
    changes = {'drive.speed': 60.0 * sense, 'links.ground.points.wheel': [0.06 / c, 0.0]}
    changes |= {f'gears.{g}.helix_angle': helix for g in ('pinion', 'wheel')}
    machine = loaded('gear_pair', changes)
    solution = end_of(machine)
    o = solution.view(np.array([0.01])).observed
    k = [j.name for j in machine.mechanism.joints].index('mesh')
    torque = abs(o.drive_torque[0, 0])
    force = helical(torque, 0.02 / c, math.radians(20.0), helix, 2.0).driven
    assert o.reaction[k, 1, 0] == pytest.approx(sense * force.tangential, rel=1e-12)
    assert o.reaction[k, 0, 0] == pytest.approx(force.radial, rel=1e-12)
    mesh = machine.mechanism.joint('mesh')
    assert math.tan(mesh.helix_angle) * force.tangential == pytest.approx(force.axial)


def outlines(machine, mesh, q):
    """Outlines of the teeth of both in the world (n, 2) at coordinates by name."""
    found = []
    for teeth, link, at in zip(
        mesh.wheels, (mesh.first, mesh.second), (mesh.on_first, mesh.on_second), strict=True
    ):
        turn = 0.0 if link == GROUND else machine.mechanism.angle(link, q)
        c, s = math.cos(turn), math.sin(turn)
        place = np.array(machine.mechanism.locate(link, q, at))
        found.append(teeth.gear.outline(41, teeth.tooth) @ [[c, s], [-s, c]] + place)
    return found


def off(points, outline):
    """Distances (n,) of points from a closed line."""
    a, b = outline, np.roll(outline, -1, axis=0)
    along = b - a
    share = ((points[:, None] - a) * along).sum(axis=2) / (along**2).sum(axis=1)
    foot = a + np.clip(share, 0.0, 1.0)[:, :, None] * along
    return np.hypot(*(foot - points[:, None]).transpose(2, 0, 1)).min(axis=1)


@pytest.mark.slow
@pytest.mark.sample(1)
@pytest.mark.parametrize(
    'name',
    [
        'gear_pair',
        'planetary',
        *(pytest.param(n, marks=pytest.mark.slow) for n in ('gear_box', 'compound_planetary')),
    ],
)
def test_drawn_teeth_touch_and_do_not_overlap_while_they_turn(name):
    """Flanks are drawn as chords: they miss the involute by less than a micrometre."""
    machine = loaded(name)
    solution = end_of(machine, duration=0.03)
    q = solution.view(np.array([0.0, 0.011, 0.03])).observed.position
    for mesh in (j for j in machine.mechanism.joints if isinstance(j, GearMesh)):
        for k in range(3):
            known = dict(zip(machine.mechanism.coordinates, q[:, k], strict=True))
            one, two = outlines(machine, mesh, known)
            within = Polygon(two).contains_points(one) ^ mesh.wheels[1].gear.internal
            apart = off(one, two)
            assert apart[within].max(initial=0.0) < 1e-6
            assert apart.min() < 1e-6


def test_a_pair_at_a_larger_distance_turns_alike_and_presses_steeper():
    distance = 0.0605
    width = {'restitution': 0.5}
    machine = loaded(
        'gear_pair',
        {'links.ground.points.wheel': [distance, 0.0], 'joints.mesh.backlash': width},
    )
    mesh = machine.mechanism.joint('mesh')
    steep = math.acos(0.06 * math.cos(math.radians(20.0)) / distance)
    assert mesh.pressure_angle == pytest.approx(steep, rel=1e-12)
    inv = math.tan(steep) - steep - math.tan(math.radians(20.0)) + math.radians(20.0)
    play = 0.5 * 2.0 * distance * inv * math.cos(steep)
    assert machine.plan.clearances['mesh'].radial == pytest.approx(play, rel=1e-9)
    with pytest.raises(InputError, match=r'take a centre distance of 0\.06 m, or give them'):
        loaded('gear_pair', {'links.ground.points.wheel': [distance, 0.0]})


def test_transmission_errors_shift_the_wheel():
    """Ideal teeth: theta2 = -(N1 theta1 + e/A)/N2, with e of tooth and shaft frequency."""
    error = {'amplitude': 20e-6, 'order': 2, 'eccentricity': [30e-6, 0.0]}
    machine = loaded('gear_pair', {'joints.mesh.error': error})
    solution = end_of(machine, revolutions=1)
    o = solution.view(np.linspace(0.0, solution.duration, 50)).observed
    pinion, wheel = o.position
    e = 20e-6 * np.sin(40.0 * pinion) + 30e-6 * np.sin(pinion)
    base = 0.04 * math.cos(math.radians(20.0))
    assert np.abs(wheel + 0.5 * pinion + e / base).max() < 1e-14
    rate = 20e-6 * 40.0 * np.cos(40.0 * pinion) + 30e-6 * np.cos(pinion)
    assert np.abs(o.velocity[1] / o.velocity[0] + 0.5 + rate / base).max() < 1e-12


ERRORS = {'amplitude': '20 um', 'order': 2, 'eccentricity': ['10 um', '15 um']}
PLAY = {'joints.mesh.backlash': {'width': '0.1 mm', 'restitution': 0.4}}


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('scene', 'overrides'),
    [
        ('gear_pair', {}),
        ('gear_pair', PLAY),
        ('mesh_stiffness', {}),
        ('mesh_stiffness', {'joints.mesh.backlash': None}),
    ],
    ids=['rigid', 'rigid with play', 'elastic with play', 'elastic'],
)
def test_torques_of_teeth_with_errors_accelerate_the_shafts(scene, overrides):
    """Euler's law of either shaft, with its drive and its brake."""
    machine = loaded(scene, {'joints.mesh.error': ERRORS, **overrides})
    t, names = np.linspace(1e-4, 0.02, 101), ('pinion', 'wheel')
    run = ms.simulate(machine, duration=0.02)
    seen = run.sample(t, *(f'{n}_torque.mesh' for n in ('first', 'second')), 'drive_torque',
                      *(f'acceleration.{n}' for n in names), 'velocity.wheel')  # fmt: skip
    needed = [machine.mechanism.body(n).inertia * seen[f'acceleration.{n}'] for n in names]
    given = seen['drive_torque'], -0.2 * seen['velocity.wheel']
    for which, need, other in zip(('first', 'second'), needed, given, strict=True):
        size = np.abs(other).max()
        assert seen[f'{which}_torque.mesh'] == pytest.approx(need - other, abs=1e-11 * size)


@pytest.mark.parametrize(
    ('scene', 'overrides'),
    [('gear_pair', {}), ('mesh_stiffness', {'joints.mesh.elasticity.damping': 0.0})],
)
def test_friction_of_teeth_with_errors_is_what_the_brake_does_not_take(scene, overrides):
    """Couples of errors, and elastic teeth, take power and give it back: it is not lost."""
    rubbing = {'joints.mesh.error': ERRORS, 'joints.mesh.friction': {'coefficient': 0.1}}
    run = ms.simulate(loaded(scene, rubbing | overrides), duration=0.002)
    t = np.linspace(0.0, 0.002, 4001)
    seen = run.sample(t, 'friction_loss.mesh', 'velocity.wheel')
    lost = np.diff(run.view(t[[0, -1]]).dissipated) - simpson(0.2 * seen['velocity.wheel'] ** 2, t)
    assert lost > 0.0
    assert simpson(seen['friction_loss.mesh'], t) == pytest.approx(lost, rel=1e-6)


RUBBING = {'joints.pair.friction': {'coefficient': 0.1}}
CHAIN = {'joints.belt': {'belt': ['motor', 'fan'], 'radii': [0.04, 0.1],
                         'friction': {'efficiency': 0.95}}}  # fmt: skip


@pytest.mark.parametrize(
    ('scene', 'joint', 'overrides'),
    [
        ('bevel_pair', 'pair', RUBBING),
        ('worm_drive', 'pair', RUBBING),
        ('worm_drive', 'pair', RUBBING | {'drive.speed': '-1500 rpm'}),
        ('worm_drive', 'pair', RUBBING | {'joints.pair.hand': 'left'}),
        ('worm_drive', 'pair', RUBBING | {
            'drive': {'coordinate': 'worm', 'torque': {'constant': '3 N m'}}}),
        ('belt_drive', 'belt', CHAIN),
    ],
)  # fmt: skip
def test_torques_of_pairs_with_friction_accelerate_the_shafts(scene, joint, overrides):
    """Euler's law of the first shaft with its drive: friction adds to what the second takes."""
    machine = loaded(scene, overrides)
    first, t = machine.mechanism.joint(joint).first, np.linspace(1e-3, 0.02, 21)
    asked = f'first_torque.{joint}', f'acceleration.{first}', 'drive_torque'
    seen = ms.simulate(machine, duration=0.02).sample(t, *asked)
    torque, change, drive = (seen[name] for name in asked)
    needed = machine.mechanism.body(first).inertia * change
    assert torque == pytest.approx(needed - drive, abs=1e-10 * np.abs(drive).max())


def test_at_rest_the_friction_of_a_pair_is_left_out():
    """Self-locking teeth hold the load; what is left of the speed by rounding has no sign."""
    drive = {'coordinate': 'worm', 'speed': '100 rpm', 'torque': {'constant': '0.1 N m'}}
    locking = {'joints.pair.friction': {'coefficient': 0.3}, 'drive': drive}
    run = ms.simulate(loaded('worm_drive', locking), duration=0.1)
    names = 'first_torque.pair', 'second_torque.pair', 'velocity.worm', 'friction_loss.pair'
    seen = run.sample(np.linspace(0.05, 0.1, 11), *names, 'axial_force.pair')
    assert np.abs(seen['velocity.worm']).max() < 1e-9
    assert seen['first_torque.pair'] == pytest.approx(-seen['second_torque.pair'] / 15.0)
    assert not seen['friction_loss.pair'].any()
    assert seen['axial_force.pair'] == pytest.approx(seen['first_torque.pair'] / 0.01)


def test_two_planets_fit_only_where_their_teeth_find_spaces():
    def scene(angle):
        at = 0.048 * np.array([math.cos(angle), math.sin(angle)])
        return {
            'links.carrier.points.other': at.tolist(),
            'links.other': {'mass': 0.4, 'inertia': 130e-6},
            'gears.other': {'at': 'other', 'teeth': 24, 'module': M},
            'joints.other_pin': {'revolute': ['carrier.other', 'other']},
            'joints.sun_other': {'mesh': ['sun', 'other']},
            'joints.other_ring': {'mesh': ['other', 'ring']},
        }

    # 24 + 72 teeth: the angle must be a multiple of 360/96 deg
    machine = loaded('planetary', scene(2.0 * math.pi / 3.0))
    teeth = {'reaction.sun_planet', 'reaction.other_ring', 'reaction.sun_other'}
    pins = {'reaction.planet_pin', 'reaction.other_pin', 'reaction.sun_shaft'}
    assert teeth | pins <= {*machine.nominal.undetermined_names}
    run = ms.simulate(machine, duration=0.01)
    every = run.sample(np.linspace(0.0, 0.01, 5), *run.catalogue)
    assert not [name for name in every if name.startswith(('reaction.', 'tooth_force.'))]
    assert all(np.isfinite(column).all() for column in every.values())
    with pytest.raises(InputError, match='not determined, for 1 of the closure equations'):
        run.sample(0.0, 'tooth_force.sun_planet.sun.radial')
    assert loaded('planetary', scene(math.radians(75.0)) | {'outputs.forces': False})
    with pytest.raises(InputError, match=r'cannot be assembled: .* 0\.4 pitches off'):
        loaded('planetary', scene(math.radians(76.5)))
    soft = {'elasticity': {'stiffness': 1e8, 'damping': 100.0}}
    elastic = scene(2.0 * math.pi / 3.0)
    for j in ('sun_planet', 'planet_ring', 'sun_other', 'other_ring'):
        elastic[f'joints.{j}'] = {
            'mesh': elastic.get(f'joints.{j}', {}).get('mesh', j.split('_')),
            **soft,
        }
    machine = loaded('planetary', elastic | {'gravity': [0.0, 0.0]})
    o = end_of(machine, duration=0.02).view(np.array([0.02])).observed
    joints = [j.name for j in machine.mechanism.joints]
    one, two = (
        np.hypot(*o.reaction[joints.index(j), :, 0]) for j in ('planet_ring', 'other_ring')
    )
    assert one > 100.0
    assert one == pytest.approx(two, rel=1e-6)


def test_the_report_tells_tooth_frequencies():
    notes = check(loaded('planetary')).notes
    # seen from the carrier the sun turns with ring/(sun + ring) of its speed
    frequency = 24 * 20.0 * 72 / 96
    assert any(f'tooth frequency {frequency:g} Hz' in note for note in notes)


@pytest.mark.parametrize(
    ('scene', 'changes', 'said'),
    [
        ('gear_pair', {'gears.pinion.teeth': 42}, 'the teeth of pinion and wheel jam'),
        ('gear_pair', {'gears.pinion.teeth': 2}, 'must be at least 3'),
        ('gear_pair', {'gears.pinion.module': 3e-3}, 'modules are 3 mm and 2 mm'),
        ('gear_pair', {'gears.wheel.pressure_angle': '25 deg'}, 'angles are 20 deg and 25 deg'),
        ('gear_pair', {'gears.wheel.helix_angle': '15 deg'}, 'equal helix angles'),
        ('gear_pair', {'links.ground.points.wheel': [0.05, 0.0]}, 'without backlash it is 0.06 m'),
        ('gear_pair', {'joints.mesh.mesh': ['pinion', 'wheels']}, "did you mean 'wheel'"),
        ('gear_pair', {'joints.mesh.backlash': {'width': 1e-4}}, 'restitution.* is missing'),
        ('gear_pair', {'joints.mesh.backlash': {'restitution': 0.5}}, 'leaves no play'),
        ('gear_pair', {'joints.mesh.clearance': {'radial': 1e-4, 'restitution': 0.5}}, 'backlash'),
        ('gear_pair', {'joints.wheel_shaft.clearance': {'radial': 1e-4, 'restitution': 0.5}},
         'the shaft of wheel has a clearance'),
        ('gear_pair', {'joints.mesh.elasticity': {'stiffness': 1e8, 'variation': [1.5]}},
         'becomes negative'),
        ('gear_pair', {'gears.wheel.teeth': None}, "a gear has 'teeth'"),
        ('gear_pair', {'joints.pinion_shaft.ratio': '1/2'}, 'ratio has no meaning in a revolute'),
        ('planetary', {'joints.sun_planet.mesh': ['sun', 'ring']}, 'no common carrier'),
        ('planetary', {'gears.planet.teeth': 23}, 'the teeth have a backlash'),
        ('rack_and_pinion', {'joints.mesh.mesh': ['rack', 'pinion']}, 'name the gear first'),
        ('rack_and_pinion', {'links.ground.points.guide': [0.0, -0.019]}, 'is 0.019 m from the'),
        ('rack_and_pinion', {'gears.rack.teeth': 12}, "a rack has no 'teeth'"),
        ('differential', {'joints.final.ratio': 'fast'}, 'not a ratio of whole numbers'),
        ('differential', {'joints.final.ratio': None}, 'ratio is missing'),
        ('differential', {'joints.final.carrier': 'shaft'}, 'carries the transmission'),
        ('gear_box', {'joints.second': {'mesh': ['g9', 'g4']}},
         'cannot be assembled|too many|cannot move'),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_by_name(scene, changes, said):
    with pytest.raises(InputError, match=said):
        check(loaded(scene, changes))


def test_meshes_that_contradict_each_other_lock():
    """Two pairs of different ratio between the same shafts."""
    more = {
        'gears.small': {'at': 'pinion', 'teeth': 30, 'module': M},
        'gears.large': {'at': 'wheel', 'teeth': 30, 'module': M},
        'joints.second': {'mesh': ['small', 'large']},
    }
    with pytest.raises(InputError, match=r'drives .* too many|cannot move|cannot be assembled'):
        loaded('gear_pair', more)


def test_a_belt_turns_the_camshaft_at_half_speed():
    content = {
        'title': 'belt',
        'links': {
            'ground': {'points': {'cam': [0.0, 0.2]}},
            'crank': {'mass': 1.0, 'inertia': 1e-3},
            'camshaft': {'mass': 1.0, 'inertia': 2e-3},
        },
        'joints': {
            'crank_bearing': {'revolute': ['ground', 'crank']},
            'cam_bearing': {'revolute': ['ground.cam', 'camshaft']},
            'belt': {'transmission': ['crank', 'camshaft'], 'ratio': '1/2', 'phase': '20 deg'},
        },
        'drive': {'speed': 10.0, 'torque': {'constant': 3.0}},
    }
    machine = made(content, 'belt')
    assert machine.mechanism.joint('belt').ratio == Fraction(1, 2)
    solution = ms.simulate(machine, duration=3.0)
    o = solution.view(np.linspace(0.0, 3.0, 9)).observed
    crank, camshaft = o.position
    off = camshaft - math.radians(20.0) - 0.5 * crank
    assert np.abs(np.remainder(off + 1.0, math.pi) - 1.0).max() < 1e-11
    # J = J1 + J2/4
    assert o.acceleration[0] == pytest.approx(3.0 / 1.5e-3, rel=1e-12)
    joints = [j.name for j in machine.mechanism.joints]
    assert o.reaction_moment[joints.index('belt')] == pytest.approx(2e-3 * 1e3, rel=1e-9)


WATT = {
    'title': 'Sun and planet of Watt',
    'mechanism': 'linkage',
    'links': {
        'ground': {'points': {'rocker': [0.35, 0.05]}},
        'sun': {'mass': 2.0, 'inertia': 4e-3, 'cog': [0.003, 0.001]},
        'crank': {'length': 0.08, 'mass': 0.7, 'inertia': 6e-4, 'cog': 0.03},
        'rod': {'length': 0.33, 'mass': 0.9, 'inertia': 8e-3, 'cog': [0.16, 0.01]},
        'rocker': {'length': 0.2, 'mass': 0.5, 'inertia': 2e-3, 'cog': 0.1},
    },
    'gears': {
        'sun': {'at': 'sun', 'teeth': 40, 'module': M},
        'planet': {'at': 'rod', 'teeth': 40, 'module': M},
    },
    'joints': {
        'sun_shaft': {'revolute': ['ground', 'sun']},
        'crank_shaft': {'revolute': ['ground', 'crank']},
        'crank_rod': {'revolute': ['crank.end', 'rod']},
        'rod_rocker': {'revolute': ['rod.end', 'rocker.end']},
        'ground_rocker': {'revolute': ['ground.rocker', 'rocker']},
        'mesh': {'mesh': ['planet', 'sun']},
    },
    'gravity': [0.0, -9.81],
    'guess': {'rod': 0.6, 'rocker': 1.5},
    'drive': {'speed': 5.0, 'start_angle': 0.3},
}

ARM = {
    'title': 'A rack on a turning arm, moved by a planet that rolls on a fixed gear',
    'mechanism': 'linkage',
    'links': {
        'ground': {},
        'arm': {'length': 0.06, 'mass': 1.0, 'inertia': 2e-3, 'cog': 0.02},
        'planet': {'mass': 0.4, 'inertia': 1e-4, 'cog': [0.002, 0.0]},
        'rack': {'mass': 0.6, 'inertia': 3e-3, 'cog': [0.01, -0.02]},
    },
    'gears': {
        'fixed': {'at': 'ground', 'teeth': 36, 'module': M},
        'planet': {'at': 'planet', 'teeth': 24, 'module': M},
        'rack': {'at': 'rack', 'module': M, 'rack': True},
    },
    'joints': {
        'shaft': {'revolute': ['ground', 'arm']},
        'pin': {'revolute': ['arm.end', 'planet']},
        'slide': {'prismatic': ['arm.outside', 'rack'], 'axis': 1.9, 'angle': 0.4},
        'rolling': {'mesh': ['planet', 'fixed']},
        'pushing': {'mesh': ['planet', 'rack']},
    },
    'gravity': [0.0, -9.81],
    'drive': {'coordinate': 'arm', 'speed': 4.0},
}
# the pitch line passes the planet at its pitch radius, to the right of the guide's direction
ARM['links']['arm']['points'] = {'outside': [0.06 + 0.024 * math.sin(1.9), -0.024 * math.cos(1.9)]}


@pytest.mark.parametrize('content', [WATT, ARM], ids=['watt', 'arm'])
@pytest.mark.parametrize(
    'free',
    [pytest.param(False, id='driven'), pytest.param(True, marks=pytest.mark.slow, id='free')],
)
def test_gears_on_moving_carriers_agree_with_newton_and_euler(content, free):
    if free:
        content = content | {'drive': content['drive'] | {'torque': {'constant': 0.4}}}
    machine = made(content, 'geared')
    solution = ms.simulate(machine, duration=0.9)
    assert solution.max_closure_error < 1e-13
    assert abs(solution.energy.residual) < 1e-11
    off, _ = differences(machine, solution, np.linspace(0.05, 0.85, 9))
    assert off.max() < 1e-10


def test_wheels_of_watt_turn_twice_a_stroke():
    """The planet does not turn in the mean, so that the sun turns twice as fast as the crank."""
    machine = made(WATT, 'watt')
    solution = ms.simulate(machine, revolutions=3)
    q = solution.view(np.array([0.0, solution.duration])).observed.position
    turned = dict(zip(machine.mechanism.coordinates, q[:, 1] - q[:, 0], strict=True))
    assert turned['crank'] == pytest.approx(6.0 * math.pi, rel=1e-12)
    assert turned['sun'] == pytest.approx(12.0 * math.pi, rel=1e-12)
    assert turned['rod'] == pytest.approx(0.0, abs=1e-12)


def test_gears_on_all_pivots_of_a_loop_are_refused():
    """Forces of a cut shaft would not be known; ratios instead of the last mesh are all right."""

    def pivot(*ends):
        return {'revolute': list(ends)}

    gears = {f'g{k}': {'mass': 1.0, 'inertia': 1e-3} for k in range(4)}
    content = {
        'title': 'geared four-bar',
        'links': {
            'ground': {'points': {'right': [0.21, 0.0]}},
            'crank': {'length': 0.1, 'mass': 1.0, 'inertia': 1e-3},
            'coupler': {'length': 0.2, 'mass': 1.0, 'inertia': 3e-3},
            'rocker': {'length': 0.11, 'mass': 1.0, 'inertia': 1e-3},
            **gears,
        },
        'gears': {
            'a': {'at': 'g0', 'teeth': 40, 'module': M},
            'b': {'at': 'g1', 'teeth': 60, 'module': M},
            'c': {'at': 'g1', 'teeth': 90, 'module': M},
            'd': {'at': 'g2', 'teeth': 110, 'module': M},
            'e': {'at': 'g2', 'teeth': 50, 'module': M},
            'f': {'at': 'g3', 'teeth': 60, 'module': M},
        },
        'joints': {
            'j0': pivot('ground', 'crank'),
            'j1': pivot('crank.end', 'coupler'),
            'j2': pivot('coupler.end', 'rocker.end'),
            'j3': pivot('ground.right', 'rocker'),
            'g0': pivot('ground', 'g0'),
            'g1': pivot('crank.end', 'g1'),
            'g2': pivot('coupler.end', 'g2'),
            'g3': pivot('ground.right', 'g3'),
            'm0': {'mesh': ['a', 'b']},
            'm1': {'mesh': ['c', 'd']},
            'm2': {'mesh': ['e', 'f']},
        },
        'drives': {'crank': {'speed': 3.0, 'start_angle': 1.0}, 'g0': {'speed': 8.0}},
        'guess': {'coupler': 0.0, 'rocker': 1.0},
    }
    with pytest.raises(InputError, match='the shafts of gears form a closed loop'):
        made(content, 'geared')
    ratio = {'transmission': ['g2', 'g3'], 'ratio': '-5/6', 'carrier': 'rocker'}
    content['joints']['m2'] = ratio
    machine = made(content, 'geared')
    solution = ms.simulate(machine, duration=0.3)
    assert differences(machine, solution, np.array([0.1, 0.2]))[0].max() < 1e-10
