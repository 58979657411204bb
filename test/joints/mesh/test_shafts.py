"""Teeth in space: bevel, worm and helical forces on shafts, and their bearings in balance."""

import math

import numpy as np
import pytest
from running import run
from tooth_forces import bevel, helical
from tooth_forces import worm as worm_forces

import mechanism_sim as ms
from mechanism_sim.analysis.summary import load_summary
from mechanism_sim.errors import InputError
from mechanism_sim.joints.bevel.constraint import pitch_angles
from mechanism_sim.joints.worm.constraint import WormPair
from mechanism_sim.messages import BearingLoads, deserialize
from mechanism_sim.nodes.publications import bearing_loads
from mechanism_sim.results.cycle import cycle
from mechanism_sim.results.ranges import LoadPeaks
from mechanism_sim.scene.check import check
from mechanism_sim.scene.files import check_scene

GRAVITY = 9.81
PHI = math.radians(20)


def parts(found, joint, link):
    names = ('tangential', 'radial', 'axial')
    return [float(found[f'tooth_force.{joint}.{link}.{n}'][0]) for n in names]


def in_space(components, facing, axes):
    """A tooth force as a vector: axes x, y, z of the shaft's frame are rows."""
    tangential, radial, axial = components
    c, s = math.cos(facing), math.sin(facing)
    return np.array([-s * tangential - c * radial, c * tangential - s * radial, axial]) @ axes


def frame(z, toward, facing):
    """Axes of a shaft's frame in space, in which `toward` is seen at an angle `facing`."""
    c, s = math.cos(facing), math.sin(facing)
    across = np.cross(z, toward)
    return np.array([c * toward - s * across, s * toward + c * across, z])


@pytest.mark.sample(4)
@pytest.mark.parametrize('seed', range(12))
def test_bevel_teeth_press_against_each_other_in_space(seed):
    random = np.random.default_rng(seed)
    one, two = (int(n) for n in random.integers(15, 60, 2))
    shafts = random.uniform(0.9, 1.6)
    facing = random.uniform(-3, 3, 2)
    width, module, torque = 0.01, 3e-3, random.uniform(-30, 30)
    machine = ms.load_scene('bevel_pair', {
        'joints.pair': {
            'bevel': ['pinion', 'wheel'], 'teeth': [one, two], 'module': module,
            'face_width': width, 'shaft_angle': shafts, 'facing': facing.tolist(),
        },
        'loads.brake.torque': torque,
    })  # fmt: skip
    found = cycle(machine, samples=4)
    assert found['velocity.wheel'][0] == pytest.approx(-20 * math.pi * one / two)
    # axes from the apex; the common line of the cones lies between them
    cones = pitch_angles(two / one, shafts)
    z1, z2 = np.array([0.0, 0.0, 1.0]), np.array([math.sin(shafts), 0.0, math.cos(shafts)])
    common = np.array([math.sin(cones[0]), 0.0, math.cos(cones[0])])
    forces, radii = [], []
    for z, cone, look, link, n in zip(
        (z1, z2), cones, facing, ('pinion', 'wheel'), (one, two), strict=True
    ):
        toward = (common - math.cos(cone) * z) / math.sin(cone)
        components = parts(found, 'pair', link)
        forces.append(in_space(components, look, frame(z, toward, look)))
        radii.append(module * n / 2 - width * math.sin(cone) / 2)
        assert components[0] * radii[-1] == pytest.approx(
            {'pinion': -found['drive_torque'][0], 'wheel': -torque}[link], rel=1e-9
        )
    assert forces[0] == pytest.approx(-forces[1], rel=1e-9, abs=1e-9)
    assert forces[0] @ common == pytest.approx(0.0, abs=1e-9)  # straight teeth
    book = bevel(abs(found['drive_torque'][0]), radii[0], PHI, two / one, shafts)
    for link, told in (('pinion', book.driver), ('wheel', book.driven)):
        assert np.abs(parts(found, 'pair', link)) == pytest.approx(np.array(told), rel=1e-9)
        assert min(parts(found, 'pair', link)[1:]) > 0.0  # apart, and away from the apex


@pytest.mark.parametrize('hand', ['right', 'left'])
@pytest.mark.parametrize('torque', [-20.0, 7.0])
def test_worm_and_wheel_press_against_each_other_in_space(hand, torque):
    facing = np.array([0.4, -2.2])
    machine = ms.load_scene('worm_drive', {
        'joints.pair.hand': hand, 'joints.pair.facing': facing.tolist(),
        'loads.brake.torque': torque,
    })  # fmt: skip
    found = cycle(machine, samples=4)
    sign = 1 if hand == 'right' else -1
    assert found['velocity.wheel'][0] == pytest.approx(sign * 50 * math.pi / 15)
    worm = WormPair(2, 30, 0.02, math.radians(10))
    e, z1 = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    z2 = np.cross(e, z1)
    on_worm, on_wheel = parts(found, 'pair', 'worm'), parts(found, 'pair', 'wheel')
    force = in_space(on_worm, facing[0], frame(z1, e, facing[0]))
    back = in_space(on_wheel, facing[1], frame(z2, -e, facing[1]))
    assert force == pytest.approx(-back, rel=1e-9)
    # along the thread nothing is passed on without friction
    around = np.cross(z1, e)
    lead = worm.lead_angle
    thread = math.cos(lead) * around + sign * math.sin(lead) * z1
    assert force @ thread == pytest.approx(0.0, abs=1e-9)
    assert -force @ e == pytest.approx(np.linalg.norm(force) * math.sin(PHI))
    if torque * sign < 0:  # the worm drives
        told = worm_forces(worm, abs(found['drive_torque'][0]))
        assert np.abs(on_worm) == pytest.approx(np.array(told.driver), rel=1e-9)
        assert np.abs(on_wheel) == pytest.approx(np.array(told.driven), rel=1e-9)


@pytest.mark.parametrize('hand', [1, -1])
@pytest.mark.parametrize('torque', [24.0, -24.0])
def test_helical_force_is_square_to_the_tooth(hand, torque):
    helix = math.radians(15)
    found = cycle(ms.load_scene('helical_shafts', {
        'gears.pinion.helix_angle': hand * helix, 'gears.wheel.helix_angle': -hand * helix,
        'loads.brake.torque': torque,
    }), samples=4)  # fmt: skip
    on_pinion = parts(found, 'mesh', 'pinion')
    force = in_space(on_pinion, 0.0, np.eye(3))
    along = np.array([0.0, hand * math.sin(helix), math.cos(helix)])  # a right hand advances
    assert force @ along == pytest.approx(0.0, abs=1e-9)
    radius = 20 * 2.5e-3 / math.cos(helix) / 2
    told = helical(abs(torque) / 2, radius, PHI, helix, 2.0)
    assert np.abs(on_pinion) == pytest.approx(np.array(told.driver), rel=1e-9)
    assert parts(found, 'mesh', 'wheel')[2] == pytest.approx(-on_pinion[2])


COUNTERSHAFT = """
title: Helical wheel and bevel pinion on one shaft
mechanism: linkage
links:
  ground: {points: {shaft: [77.6457135307562 mm, 0 mm], output: [300 mm, 0 mm]}}
  motor: {mass: 0.8 kg, inertia: 200 kg mm^2}
  shaft: {mass: 3 kg, inertia: 3000 kg mm^2, cog: 2 mm}
  output: {mass: 2 kg, inertia: 3000 kg mm^2}
gears:
  pinion: {at: motor, teeth: 20, module: 2.5 mm, helix_angle: 15 deg, along: 12 mm}
  wheel: {at: shaft, teeth: 40, module: 2.5 mm, helix_angle: -15 deg, along: -7 mm}
joints:
  motor_shaft: {revolute: [ground, motor]}
  counter: {revolute: [ground.shaft, shaft], bearings: {a: -40 mm, b: 60 mm}, locating: b}
  output_shaft: {revolute: [output, ground.output], bearings: {a: 30 mm, b: 90 mm}, locating: a}
  mesh: {mesh: [pinion, wheel]}
  pair: {bevel: [shaft, output], teeth: [18, 40], module: 3 mm, face_width: 18 mm,
         facing: [70 deg, -20 deg], along: [85 mm, 0 mm]}
gravity: [0, -9.81 m/s^2]
drive: {coordinate: motor, speed: 600 rpm}
loads:
  brake: {at: output, torque: "-2*output_rate"}
"""


@pytest.mark.sample(4)
@pytest.mark.parametrize('seed', range(10))
def test_all_forces_on_a_shaft_are_in_balance_in_space(tmp_path, seed):
    """Teeth, bearings, weight and inertia of an unbalanced shaft, by d'Alembert."""
    random = np.random.default_rng(seed)
    path = tmp_path / 'counter.yaml'
    path.write_text(COUNTERSHAFT)
    ends = dict(zip('ab', random.uniform(-0.1, 0.1, 2).tolist(), strict=True))
    places = random.uniform(-0.1, 0.1, 2).tolist()
    facing = random.uniform(-3, 3, 2)
    found = cycle(ms.load_scene(str(path), {
        'joints.counter.bearings': ends, 'gears.wheel.along': places[0],
        'joints.pair.along': [places[1], 0.0], 'joints.pair.facing': facing.tolist(),
    }), samples=36)  # fmt: skip
    count = len(found.t)
    angle, w = found['position.shaft'], found['velocity.shaft']
    force, moment = np.zeros((3, count)), np.zeros((3, count))

    def add(f, at):
        nonlocal force, moment
        force, moment = force + f, moment + np.cross(at, f, axis=0)

    def toothed(joint, radius, look, z):
        t, r, a = (
            found[f'tooth_force.{joint}.shaft.{n}'] for n in ('tangential', 'radial', 'axial')
        )
        c, s = math.cos(look), math.sin(look)
        at = np.tile([[radius * c], [radius * s], [z]], count)
        add(np.array([-s * t - c * r, c * t - s * r, a]), at)

    toothed('mesh', 40 * 2.5e-3 / math.cos(math.radians(15)) / 2, math.pi, places[0])
    cone = pitch_angles(40 / 18)[0]
    toothed('pair', 0.027 - 0.009 * math.sin(cone), facing[0], places[1])
    for name, z in ends.items():
        head = f'bearing_force.counter.{name}'
        axial = found.table().get(f'{head}.axial', np.zeros(count))
        at = np.tile([[0.0], [0.0], [z]], count)
        add(np.array([found[f'{head}.x'], found[f'{head}.y'], axial]), at)
        assert found[f'{head}.size'] == pytest.approx(np.hypot(*found_xy(found, head)))
    cog = 2e-3 * np.array([np.cos(angle), np.sin(angle), 0 * angle])
    add(np.array([0 * angle, 0 * angle - 3 * GRAVITY, 0 * angle]) + 3 * w**2 * cog, cog)
    size = max(np.abs(found[f'bearing_force.counter.{n}.size']).max() for n in 'ab')
    assert force == pytest.approx(0.0, abs=1e-9 * size)
    assert moment == pytest.approx(0.0, abs=1e-9 * size)
    # of the second-named ground it is the first-named link that turns
    on_output = np.array(parts(found, 'pair', 'output'))
    both = sum(np.array(found_xy(found, f'bearing_force.output_shaft.{n}'))[:, 0] for n in 'ab')
    c, s = math.cos(facing[1]), math.sin(facing[1])
    teeth = np.array([[-s, -c], [c, -s]]) @ on_output[:2]
    assert both == pytest.approx(-teeth + [0.0, 2 * GRAVITY], rel=1e-9, abs=1e-9)
    assert found['bearing_force.output_shaft.a.axial'][0] == pytest.approx(-on_output[2])


def test_a_message_says_what_the_bearings_of_each_shaft_carry():
    """Both together the reaction of the plane; along the shaft opposite forces on both gears."""
    machine = ms.load_scene('helical_shafts')
    t = np.array([0.01, 0.02])
    seen = ms.simulate(machine, duration=0.03).view(t)
    write = bearing_loads(machine, 'world')
    messages = [deserialize(x, BearingLoads) for x in write(seen)]
    assert [(m.joint, m.time) for m in messages] == [
        (joint, x) for joint in ('pinion_shaft', 'wheel_shaft') for x in t
    ]
    for m in messages:
        k = machine.physics.joints.index(m.joint)
        x, y = seen.observed.reaction[k][:, t.tolist().index(m.time)]
        assert [sum(m.force_x), sum(m.force_y)] == pytest.approx([x, y], rel=1e-12)
        assert m.bearings == ['left', 'right']
    axial = np.array([m.axial_force for m in messages])
    assert (axial[:2, 1] == 0.0).all()
    assert (axial[2:, 0] == 0.0).all()
    assert axial[:2, 0] == pytest.approx(-axial[2:, 1], rel=1e-12)


def found_xy(found, head):
    return found[f'{head}.x'], found[f'{head}.y']


def test_the_largest_loads_of_bearings_are_those_of_the_motion(tmp_path):
    path = tmp_path / 'counter.yaml'
    path.write_text(COUNTERSHAFT)
    found = cycle(ms.load_scene(str(path)))
    collector = LoadPeaks(found.machine, bearings=True)
    collector.add(found.solution.motion)
    loads = load_summary(collector.peaks(), {}, lambda _: None)
    peaks = {p.name: p for p in loads.joints}
    assert not loads.moments
    assert list(peaks)[len(found.machine.physics.joints) :] == [
        *('counter.a', 'counter.b', 'counter.b.axial'),
        *('output_shaft.a', 'output_shaft.b', 'output_shaft.a.axial'),
    ]
    ends = found.extremes()
    for name in ('counter.a', 'counter.b'):
        column = ends[f'bearing_force.{name}.size']
        assert peaks[name].value == pytest.approx(column.greatest.value, rel=1e-12)
    axial = ends['bearing_force.counter.b.axial']
    assert abs(peaks['counter.b.axial'].value) == pytest.approx(
        max(abs(axial.least.value), abs(axial.greatest.value))
    )
    assert 'counter.a' in {n.partition('.')[2].removesuffix('.size') for n in ends}


def test_a_scene_with_shafts_is_read_back_as_written():
    for name in ('bevel_pair', 'worm_drive', 'helical_shafts'):
        machine = ms.load_scene(name)
        again = check_scene(name, machine.scene.model_dump(by_alias=True), {})
        assert again == machine.scene


@pytest.mark.parametrize(('scene', 'changes', 'said'), [
    ('bevel_pair', {'joints.pair.module': None}, 'pair.module is missing: a bevel pair'),
    ('bevel_pair', {'joints.pair.teeth': None}, 'pair.teeth is missing'),
    ('bevel_pair', {'joints.pair.teeth': [0, 3]}, 'must be at least 1'),
    ('bevel_pair', {'joints.pair.face_width': '80 mm'}, 'must be less than .* from back to apex'),
    ('bevel_pair', {'joints.pair.shaft_angle': '180 deg'}, 'between 0 and 180 deg'),
    ('bevel_pair', {'joints.pair.shaft_angle': '170 deg'}, 'no cone'),
    ('bevel_pair', {'joints.pair.pressure_angle': '50 deg'}, 'between 0 and 45 deg'),
    ('bevel_pair', {'joints.pair.carrier': 'wheel'}, 'carries the bevel'),
    ('bevel_pair', {'joints.pair.lead_angle': '5 deg'}, 'no meaning in a bevel joint'),
    ('worm_drive', {'joints.pair.lead_angle': '90 deg'}, 'lead_angle must lie between'),
    ('worm_drive', {'joints.pair.diameter': None}, 'pair.diameter is missing: a worm pair'),
    ('worm_drive', {'joints.pair.hand': 'both'}, "allowed: 'left' or 'right'"),
    ('worm_drive', {'joints.pair.clearance': {'radial': 1e-4, 'restitution': 0}},
     'is not modelled'),
    ('worm_drive', {'joints.worm_shaft.locating': 'middle'}, 'locating names one of them: left'),
    ('worm_drive', {'joints.worm_shaft.bearings': {'a': 0.0}}, 'two bearings, at different'),
    ('worm_drive', {'joints.worm_shaft.bearings': {'a': 0.0, 'b': 0.0}}, 'at different places'),
    ('worm_drive', {'joints.worm_shaft.bearings': None}, "'bearings' and 'locating' belong"),
    ('worm_drive', {'joints.worm_shaft.clearance': {'radial': 1e-4, 'restitution': 0}},
     'bearings of a shaft are ideal'),
])  # fmt: skip
def test_wrong_shafts_are_refused_in_one_sentence(scene, changes, said):
    with pytest.raises(InputError, match=said):
        check(ms.load_scene(scene, changes))


def test_figures_of_bevel_and_worm():
    """[V] chapter 5, problem 15: 30 teeth, 52.9 mm, a helix of 10 degrees, 36.4 mm."""
    shown = run('draw', 'worm_drive', '--profile', 'pair').stdout
    for text in ('ratio                          15', '52.8981  mm', '36.449  mm', '10  deg'):
        assert text in shown
    assert (
        'self-locking'
        in run('draw', 'worm_drive', '--profile', 'pair', '--friction', '0.2').stdout
    )
    assert (
        'pitch angle  26.5651  63.4349  deg'
        in run('draw', 'bevel_pair', '--profile', 'pair').stdout
    )
    assert run('draw', 'bevel_pair', '--profile', 'pair', '-o', 'x.svg').returncode == 2
