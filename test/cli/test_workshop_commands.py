"""`teeth` and `profile`: parts of machines on the command line."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from fractions import Fraction
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.path import Path as Polygon
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.cli import main
from mechanism_sim.joints.mesh.involute import Gear
from mechanism_sim.joints.mesh.pair import Pair
from mechanism_sim.joints.mesh.sheet import gear_and_rack_outline, pair_outline
from mechanism_sim.report.profile import profile, render, to_json


def refusal(capsys, *args):
    """The one sentence that a command answers bad input with."""
    with pytest.raises(SystemExit) as left:
        main(args)
    assert left.value.code == 2
    told = capsys.readouterr().err
    assert told.count('\n') == 1
    return told


def test_teeth_are_ranked_by_their_error():
    found = run_json('find', '--teeth', '3.14159265', '--stages', '2', '--tolerance', '1e-6')
    assert found['count'] == len(found['choices']) == 36
    for choice in found['choices']:
        ratio = math.prod(Fraction(s['driven'], s['driver']) for s in choice['stages'])
        assert choice['exact_ratio'] == str(ratio)
        assert choice['error'] == pytest.approx(float(ratio) / 3.14159265 - 1, abs=1e-15)
    ranks = [(abs(c['error']), c['teeth']) for c in found['choices']]
    assert ranks == sorted(ranks)
    assert found['choices'][0]['exact_ratio'] == '355/113'
    shown = run(
        'find', '--teeth', '3.14159265', '--stages', '2', '--tolerance', '1e-6'
    ).stdout.splitlines()
    assert shown[-2:] == [
        '36 trains found, the first 20 are shown',
        'searched: 18 to 120 teeth a gear, 2 stages, errors of 1e-06 of the ratio',
    ]
    assert len(shown) == 23


def test_teeth_fill_a_centre_distance():
    options = ('--centre-distance', '90 mm', '--modules', '2 mm,2.5 mm')
    found = run_json('find', '--teeth', '7/2', *options)
    [choice] = found['choices']
    assert choice['stages'] == [{'driver': 20, 'driven': 70, 'module': 2e-3}]
    assert choice['error'] == 0.0
    assert '20:70 (2 mm)' in run('find', '--teeth', '7/2', *options).stdout
    assert found['just_outside'] == {'driver': 16, 'driven': 56, 'module': 2.5e-3}


@pytest.mark.parametrize(
    ('args', 'says'),
    [
        (('1e400',), "'1e400' is not a ratio"),
        (('1/0',), "'1/0' is not a ratio"),
        (('3', '--teeth-range', '20'), "write LOW:HIGH, as '18:120'"),
        (('3', '--teeth-range', '3:9999'), 'the range of teeth is too wide'),
        (('3', '--stages', '99'), '99 stages are too many'),
        (('3', '--centre-distance', '60'), 'not a quantity with a unit'),
        (('3', '--centre-distance', '60 mm'), 'belong together'),
        (('3.14159265',), 'the nearest is 3.14286'),
        (('3', '--centre-distance', '136 mm', '--modules', '4 mm'), 'just outside: 17:51 (4 mm)'),
    ],
)
def test_teeth_that_cannot_be_are_refused(args, says, capsys):
    assert says in refusal(capsys, 'find', '--teeth', *args)


def figures(*args):
    """Of `profile`, by name: value in SI units."""
    found = run_json('draw', args[0], '--profile', *args[1:])
    return {name: f['value'] for name, f in found['figures'].items()}, found


def polygons(file):
    """Closed polylines of a DXF file, as a program of others reads them: by layer, (n, 2) [m]."""
    ezdxf = pytest.importorskip('ezdxf')
    document = ezdxf.readfile(file)
    audit = document.audit()
    assert not audit.errors
    assert not audit.fixes
    assert document.units == ezdxf.units.MM
    lines = document.modelspace().query('LWPOLYLINE')
    return document, {x.dxf.layer: 1e-3 * np.array(x.get_points('xy')) for x in lines}


@pytest.mark.slow
def test_a_cam_of_a_scene_in_figures_and_as_a_drawing(tmp_path):
    pytest.importorskip('ezdxf')
    file = tmp_path / 'cam.dxf'
    found, whole = figures('valve_train', 'contact', '-o', str(file))
    assert whole['file'] == str(file)
    # a flat face, by closed forms ([V] 4.6)
    speed, half = 120 * math.pi, math.pi / 2
    x = np.linspace(0.0, 1.0, 20_001)
    lift = 8e-3 * (x - np.sin(2 * math.pi * x) / (2 * math.pi))
    bend = 8e-3 * 2 * math.pi / half**2 * np.sin(2 * math.pi * x)
    radii = 18e-3 + lift + bend
    assert found == {
        'base_radius': 18e-3,
        'lift': pytest.approx(8e-3),
        'largest_pressure_angle': pytest.approx(0.0, abs=1e-12),
        'smallest_radius_of_curvature': pytest.approx(radii.min(), rel=1e-6),
        'cam_speed': pytest.approx(speed),
        'largest_sliding_velocity': pytest.approx(speed * 26e-3),
        'largest_contact_velocity': pytest.approx(speed * radii.max(), rel=1e-6),
    }
    at = whole['figures']['smallest_radius_of_curvature']['at']
    assert min(at, math.pi - at) == pytest.approx(half * x[radii.argmin()], abs=1e-3)
    assert ['jerk' in remark for remark in whole['remarks']] == [True] * 3
    _, lines = polygons(file)
    radii = np.hypot(*lines['PROFILE'].T)
    assert (radii.min(), radii.max()) == (pytest.approx(18e-3), pytest.approx(26e-3))
    shown = render(profile(ms.load_scene('valve_train'), 'contact'))
    assert 'largest sliding velocity      9.80177  m/s    at 90 deg' in shown


GROOVE = """
title: Groove
mechanism: linkage
links:
  ground: {points: {pivot: [80 mm, 0 mm]}}
  camshaft: {mass: 1 kg, inertia: 500 kg mm^2}
  lever: {length: 70 mm, mass: 0.2 kg, inertia: 90 kg mm^2, cog: 35 mm}
joints:
  bearing: {revolute: [ground, camshaft]}
  pivot: {revolute: [ground.pivot, lever.start]}
  contact:
    cam: [camshaft, lever.end]
    follower: roller
    roller: 8 mm
    side: left
    base_radius: 35 mm
    groove: {clearance: CLEARANCE, restitution: 0.2}
    law:
      segments:
        - {from: 20 deg, to: 140 deg, rise: 15 deg, curve: modified_sine}
        - {from: 200 deg, to: 300 deg, rise: -15 deg, curve: modified_sine}
drive: {coordinate: camshaft, speed: 60 rpm}
"""


@pytest.mark.sample(1)
@pytest.mark.parametrize('clearance', [0.0, 0.2])
def test_a_groove_for_a_swinging_roller(clearance, tmp_path):
    file = tmp_path / 'groove.yaml'
    file.write_text(GROOVE.replace('CLEARANCE', f'{clearance} mm'), encoding='utf-8')
    sheet = profile(ms.load_scene(str(file)), 'contact')
    found = {f.name: f for f in sheet.figures}
    assert found['lift'].value == pytest.approx(math.radians(15))
    assert found['lift'].unit == 'rad'
    assert found['largest_rolling_velocity'].unit == 'm/s'
    assert {e.name for e in sheet.outline.edges} == {'inner', 'outer'}
    inner, outer = (e.points for e in sheet.outline.edges)
    apart = np.hypot(*(outer[:, ::400, None] - inner[:, None])).min(axis=1)
    assert apart == pytest.approx(16e-3 + 1e-3 * clearance, rel=1e-5)
    # that base radius has the limit as its largest pressure angle
    proposed = found['base_radius_for_30_deg'].value
    cam = ms.load_scene(str(file)).plan.ideal.joint('contact').cam
    assert replace(cam, base_radius=proposed).largest_pressure_angle == pytest.approx(
        math.radians(30), rel=1e-6
    )


@pytest.mark.slow
def test_gears_of_a_scene_in_figures_and_as_a_drawing(tmp_path):
    pytest.importorskip('ezdxf')
    file = tmp_path / 'gears.dxf'
    found, _ = figures('gear_pair', 'mesh', '-o', str(file), '--friction', '0.1')
    assert found['tooth_frequency'] == pytest.approx(200.0)  # 20 teeth at 600 rpm
    assert found['contact_ratio'] == pytest.approx(1.635, abs=1e-3)
    assert found['ratio'] == -2.0
    assert found['wheel.root_radius'] == pytest.approx(37.5e-3)
    assert found['pinion.least_teeth'] == 18
    halved = to_json(profile(ms.load_scene('gear_pair'), 'mesh'))['figures']['efficiency']
    assert 1 - found['efficiency'] == pytest.approx(2 * (1 - halved['value']))
    document, lines = polygons(file)
    assert set(lines) == {'PINION.PROFILE', 'WHEEL.PROFILE'}
    centres = {c.dxf.layer: 1e-3 * c.dxf.center.x for c in document.modelspace().query('CIRCLE')}
    assert centres['WHEEL.TIP'] == pytest.approx(60e-3)
    assert centres['PINION.TIP'] == 0.0
    one, two = lines['PINION.PROFILE'], lines['WHEEL.PROFILE']
    assert overlap(one, two) < 1e-7
    assert overlap(one, turned(two, (60e-3, 0.0), 2e-5)) > 1e-7


def test_one_gear_is_drawn_by_itself(tmp_path):
    file = tmp_path / 'wheel.svg'
    done = run('draw', 'gear_pair', '--profile', 'mesh', '--gear', 'wheel', '-o', str(file))
    assert done.returncode == 0
    assert re.search(r'pitch radius +20 +40  mm\n', done.stdout)
    shapes = [e.get('id') for e in ElementTree.parse(file).iter() if e.get('id')]
    assert shapes == ['profile', 'pitch', 'base', 'tip', 'root', 'shaft']


def turned(points, centre, angle):
    """Points (n, 2) about a centre."""
    z = (points - centre) @ (1.0, 1.0j) * np.exp(1j * angle)
    return np.stack([z.real, z.imag], axis=1) + centre


def overlap(one, two, hole=False):
    """Largest depth of a polygon's corners in another one, or outside of a hole [m]."""
    inside = Polygon([*two, two[0]]).contains_points(one)
    side, depth = np.roll(two, -1, axis=0) - two, 0.0
    for point in one[inside != hole]:
        share = np.clip(((point - two) * side).sum(axis=1) / (side**2).sum(axis=1), 0.0, 1.0)
        depth = max(depth, np.hypot(*(point - two - share[:, None] * side).T).min())
    return depth


M = 2e-3
RING = Gear(60, M, internal=True)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    'pair',
    [
        Pair(Gear(20, M), Gear(31, M)),
        Pair(Gear(21, M), Gear(30, M), 51.3e-3),
        Pair(Gear(22, M), RING),
        Pair(Gear(21, M), RING, 38.7e-3),
    ],
    ids=['tight', 'apart', 'internal', 'internal, closer'],
)
def test_gears_are_drawn_in_the_middle_of_their_backlash(pair):
    edges = {e.name: e.points.T for e in pair_outline(pair).edges}
    one, two = edges['pinion.profile'], edges['wheel.profile']
    side = -1 if pair.wheel.internal else 1
    centre = np.array([side * pair.centre_distance, 0.0])
    free = 0.5 * pair.backlash / pair.pitch_radii[1]

    for sense in (-1, 1):
        for angle, least, most in ((free, 0.0, 1e-7), (free + 2e-5, 1e-7, 1e-5)):
            wheel = turned(two, centre, sense * angle)
            # the spaces of a ring have to hold the teeth
            assert least <= overlap(one, wheel, hole=pair.wheel.internal) < most


@pytest.mark.parametrize('distance', [22e-3, 22.2e-3])
def test_a_gear_is_drawn_between_the_teeth_of_its_rack(distance):
    gear = Gear(22, M)
    edges = {e.name: e.points.T for e in gear_and_rack_outline(gear, distance).edges}
    rack = edges['rack.profile']
    body = np.concatenate([rack, [[0.1, rack[-1, 1]], [0.1, rack[0, 1]]]])
    free = (distance - 22e-3) * math.tan(math.radians(20.0))
    for sense in (-1.0, 1.0):
        assert overlap(edges['gear.profile'], body + np.array([0.0, sense * free])) < 1e-7
        assert overlap(edges['gear.profile'], body + np.array([0.0, sense * (free + 1e-6)])) > 5e-7


@pytest.mark.parametrize(
    ('scene', 'joint'),
    [
        ('planetary', 'planet_ring'),
        ('rack_and_pinion', 'mesh'),
        ('gear_rattle', 'mesh'),
        ('mesh_stiffness', 'mesh'),
        ('gear_four_bar', 'mesh'),
    ],
)
def test_every_kind_of_mesh_has_a_profile(scene, joint):
    machine = ms.load_scene(scene)
    sheet = profile(machine, joint)
    found = {f.name: f.value for f in sheet.figures}
    assert found['contact_ratio'] > 1.0
    assert found['tooth_frequency'] > 0.0
    assert len(sheet.outline.edges) == 2
    assert found.get('backlash_of_the_scene', 0.1e-3) == pytest.approx(0.1e-3, rel=0.5)


def test_helical_gears_are_larger_in_their_plane_of_rotation():
    slope = math.cos(math.radians(20))
    changes = {
        'gears.pinion.helix_angle': '20 deg',
        'gears.wheel.helix_angle': '-20 deg',
        'links.ground.points.wheel': [f'{60 / slope} mm', '0 mm'],
    }
    sheet = profile(ms.load_scene('gear_pair', overrides=changes), 'mesh')
    found = {f.name: f.value for f in sheet.figures}
    assert found['module'] == M
    assert found['transverse_module'] == pytest.approx(M / slope)
    assert found['pinion.tip_radius'] == pytest.approx(20e-3 / slope + M)
    assert math.tan(found['pressure_angle']) == pytest.approx(math.tan(math.radians(20)) / slope)
    assert np.hypot(*sheet.outline.edges[0].points).max() == pytest.approx(20e-3 / slope + M)


@pytest.mark.parametrize(
    ('args', 'says'),
    [
        (('gear_pair', 'mess'), "did you mean 'mesh'"),
        (('gear_pair', 'pinion_shaft'), 'has neither cam nor teeth; joints with a cam or teeth'),
        (('gear_pair', 'mesh', '--gear', 'wheels'), "no gear 'wheels'"),
        (('gear_pair', 'mesh', '--friction', '-1'), 'friction is not negative'),
        (('gear_pair', 'mesh', '-o', 'a.pdf'), 'the ending must be .svg or .dxf'),
        (('gear_pair', 'mesh', '-o', '/nowhere/a.svg'), "there is no directory '/nowhere'"),
        (('valve_train', 'contact', '--gear', 'cam'), 'has a cam, no gears'),
        (('four_bar_nominal', 'coupler_rocker'), 'joints with a cam or teeth: none'),
    ],
)
def test_profiles_that_cannot_be_are_refused(args, says, capsys):
    assert says in refusal(capsys, 'draw', args[0], '--profile', *args[1:])
