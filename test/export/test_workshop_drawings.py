"""Drawings for the workshop, read back and measured: followers and gears roll on them."""

from __future__ import annotations

import io
import math
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from builders import made, placed

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.export import plates
from mechanism_sim.export.outline_files import to_dxf, to_svg
from mechanism_sim.joints.cam.curves import CYCLOIDAL, HALF_HARMONIC
from mechanism_sim.joints.cam.followers import FlatFaced, Translating
from mechanism_sim.joints.cam.laws import Diagram, Segment
from mechanism_sim.joints.cam.profiles import Cam
from mechanism_sim.joints.cam.sheet import cam_outline
from mechanism_sim.joints.mesh.involute import FULL_DEPTH, Gear, ToothSystem, rack_teeth
from mechanism_sim.joints.mesh.sheet import gear_outline, rack_outline
from mechanism_sim.report.profile import profile, table

SEGMENTS = [Segment(0.0, 1.8, 0.02, CYCLOIDAL), Segment(2.6, 4.7, -0.02, CYCLOIDAL)]
ROLLER = Cam(Diagram(SEGMENTS), Translating(offset=0.01, roller=0.012), 0.04)
TILTED = Cam(Diagram(SEGMENTS), FlatFaced(tilt=0.3), 0.06)
SLIDING = Cam(
    Diagram([Segment(0.0, 0.07, 0.02, CYCLOIDAL)], reciprocating=True),
    Translating(roller=0.012),
    0.03,
)


def read(outline):
    """The drawing as a program of others takes it, without a complaint."""
    ezdxf = pytest.importorskip('ezdxf')
    document = ezdxf.read(io.StringIO(to_dxf(outline)))
    assert document.units == ezdxf.units.MM
    audit = document.audit()
    assert not audit.errors
    assert not audit.fixes
    return document


def polyline(document, layer):
    """Points (2, n) in metres, and whether it is closed."""
    [line] = document.modelspace().query(f'LWPOLYLINE[layer=="{layer}"]')
    return 1e-3 * np.array(line.get_points('xy')).T, line.closed


def circles(document):
    return {c.dxf.layer: 1e-3 * c.dxf.radius for c in document.modelspace().query('CIRCLE')}


def from_segments(points, centre, closed=True):
    """Least distance of a point from a polygon's sides."""
    ends = np.roll(points, -1, axis=1) if closed else points[:, 1:]
    starts = points if closed else points[:, :-1]
    side, to = ends - starts, np.asarray(centre)[:, None] - starts
    share = np.clip((side * to).sum(axis=0) / (side * side).sum(axis=0), 0.0, 1.0)
    return np.hypot(*(to - share * side)).min()


def test_a_roller_rolls_over_the_profile_that_was_read_back():
    document = read(cam_outline(ROLLER))
    points, closed = polyline(document, 'PROFILE')
    pitch, _ = polyline(document, 'PITCH')
    assert closed
    assert circles(document) == {'BASE': pytest.approx(0.04)}
    height = math.sqrt(0.052**2 - 0.01**2)
    for angle in np.linspace(0.0, 2 * math.pi, 24):
        z = (height + float(ROLLER.law(angle)) + 0.01j) * np.exp(1j * angle)
        assert from_segments(points, (z.real, z.imag)) == pytest.approx(0.012, abs=6e-8)
        assert from_segments(pitch, (z.real, z.imag)) < 6e-8


def test_a_face_lies_on_the_profile_that_was_read_back():
    points, _ = polyline(read(cam_outline(TILTED)), 'PROFILE')
    for angle in np.linspace(0.0, 2 * math.pi, 24):
        normal = np.exp(1j * (angle + 0.3))
        height = 0.06 + float(TILTED.law(angle)) * math.cos(0.3)
        reach = (points[0] * normal.real + points[1] * normal.imag).max()
        assert reach == pytest.approx(height, abs=6e-8)


def test_a_groove_that_was_read_back_is_as_wide_as_roller_and_clearance():
    document = read(cam_outline(ROLLER, clearance=4e-4))
    inner, outer = (polyline(document, layer)[0] for layer in ('INNER', 'OUTER'))
    for point in inner.T[::150]:
        assert from_segments(outer, point) == pytest.approx(0.0244, abs=1.2e-7)
    assert not document.modelspace().query('*[layer=="PROFILE"]')


def test_a_sliding_cam_is_drawn_open_over_its_stroke():
    document = read(cam_outline(SLIDING))
    points, closed = polyline(document, 'PROFILE')
    base, _ = polyline(document, 'BASE')
    assert not closed
    assert points[:, [0, -1]] == pytest.approx(np.array([(0.03, 0.05), (0.0, 0.07)]), abs=1e-9)
    assert base == pytest.approx(np.array([(0.03, 0.03), (0.0, 0.07)]), abs=1e-9)
    for x in np.linspace(0.01, 0.06, 11):
        centre = 0.042 + float(SLIDING.law(x)), x
        assert from_segments(points, centre, closed=False) == pytest.approx(0.012, abs=1e-8)


def test_the_base_line_of_a_sliding_cam_lies_under_its_profile():
    """The roller of the guide at 200 mm is over the place 200 mm less the way of the wedge."""
    machine = ms.load_scene('sliding_cam')
    document = read(profile(machine, 'contact').outline)
    (base, _), (edge, _) = (polyline(document, layer) for layer in ('BASE', 'PROFILE'))
    ends = 0.2 - np.array([0.095, 0.205])
    assert base == pytest.approx(np.array([ends, (0.012, 0.012)]), abs=1e-9)
    assert edge[0, [0, -1]] == pytest.approx(ends, abs=1e-9)


def test_no_two_points_of_a_drawing_are_one_and_corners_keep_both():
    cornered = Diagram([Segment(0, 1.8, 0.02, HALF_HARMONIC), Segment(2, 4, -0.02, HALF_HARMONIC)])
    for law in (cornered, ROLLER.law):
        profile = cam_outline(Cam(law, FlatFaced(), 0.06)).edges[0].points
        steps = np.hypot(*np.diff(profile, append=profile[:, :1]))
        assert steps.min() > 1e-9
    # the contact leaps along the face where the velocity of the follower does
    leaps = np.hypot(*np.diff(cam_outline(Cam(cornered, FlatFaced(), 0.06)).edges[0].points))
    velocity = 0.02 * math.pi / 2 / np.array([1.8, 2.0])
    assert np.sort(leaps)[-2:] == pytest.approx(np.sort(velocity), rel=1e-6)


def test_the_text_holds_the_coordinates_in_full():
    """By the pairs of group codes and values, without any library."""
    pytest.importorskip('ezdxf')
    outline = cam_outline(ROLLER)
    lines = to_dxf(outline).splitlines()
    pairs = list(zip(map(int, lines[::2]), lines[1::2], strict=True))
    lines_begin = [i for i, pair in enumerate(pairs) if pair == (0, 'LWPOLYLINE')]
    start = next(i for i in lines_begin if (8, 'PROFILE') in pairs[i : i + 9])
    end = next(i for i in range(start + 1, len(pairs)) if pairs[i][0] == 0)
    x, y = ([float(v) for code, v in pairs[start:end] if code == c] for c in (10, 20))
    assert 1e-3 * np.array([x, y]) == pytest.approx(outline.edges[0].points, rel=1e-14, abs=1e-16)


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', ['valve_train', 'offset_roller_cam', 'groove_cam'])
def test_a_cam_of_a_whole_machine_is_drawn_as_closely_as_alone(name):
    """Points of the drawing lie on the profile of the cam's law to the rounding of its sides."""
    ezdxf = pytest.importorskip('ezdxf')
    machine = ms.load_scene(name)
    joint = machine.plan.ideal.joint('contact')
    lines = ezdxf.read(io.StringIO(plates.drawing(machine))).modelspace().query('LWPOLYLINE')
    drawn = [1e-3 * np.array(x.get_points('xy')).T for x in lines]
    cam, q = joint.cam, dict(zip(machine.plan.ideal.coordinates, machine.assembly.q, strict=True))
    angles = np.linspace(0.0, 2.0 * math.pi, 500)[:-1]
    walls = cam.groove(angles) if joint.grooved else (cam.at(angles).profile,)
    for wall in walls:
        exact = placed(machine, joint.first, q, joint.profile(wall))
        off = min(max(from_segments(points, p) for p in exact.T) for points in drawn)
        assert off < 6e-8


@pytest.mark.parametrize('sense', ['counterclockwise', 'clockwise'])
def test_a_cam_of_a_scene_is_drawn_as_it_is_on_its_link(sense):
    """By hand: at the angle x the knife is over what lies at 90 deg -+ x of the link."""
    law = {
        'segments': [
            {'from': '0 deg', 'to': '60 deg', 'rise': '10 mm', 'curve': 'polynomial_345'},
            {'from': '60 deg', 'to': '240 deg', 'rise': '-10 mm', 'curve': 'polynomial_345'},
        ]
    }
    contact = {'cam': ['cam.eye', 'rod'], 'follower': 'knife', 'base_radius': '25 mm'}
    machine = made({
        'links': {'cam': {'points': {'eye': ['3 mm', '-4 mm']}}, 'rod': {}},
        'joints': {
            'bearing': {'revolute': ['ground', 'cam.eye']},
            'guide': {'prismatic': ['ground', 'rod'], 'axis': '90 deg'},
            'contact': {**contact, 'law': law, 'sense': sense},
        },
        'drive': {'coordinate': 'cam', 'speed': '10 rad/s'},
    })  # fmt: skip
    outline = profile(machine, 'contact').outline
    [(x, y)] = outline.shafts
    assert (x, y) == pytest.approx((3e-3, -4e-3), abs=1e-15)
    points, _ = polyline(read(outline), 'PROFILE')
    sign = 1 if sense == 'clockwise' else -1
    back = 1 - np.array([0.0, 20.0, 100.0]) / 180  # of the return, 60 to 240 deg
    lifts = np.polyval([6, -15, 10, 0, 0, 0], [0.0, 0.5, *back])
    for turned, lift in zip((0.0, 30.0, 60.0, 80.0, 160.0), lifts, strict=True):
        z = (25e-3 + 10e-3 * lift) * np.exp(1j * np.radians(90 + sign * turned))
        assert from_segments(points, (x + z.real, y + z.imag)) < 1e-8
    rows = table(machine, 'contact')
    at = np.radians(90) + sign * rows['cam']
    radii = 25e-3 + rows['displacement']
    assert rows['contact.x'] == pytest.approx(x + radii * np.cos(at), abs=1e-12)
    assert rows['contact.y'] == pytest.approx(y + radii * np.sin(at), abs=1e-12)


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('name', 'sense'),
    [
        ('offset_roller_cam', 'clockwise'),
        ('offset_roller_cam', 'counterclockwise'),
        ('oscillating_roller', None),
        ('sliding_cam', None),
    ],
)
def test_the_roller_of_a_machine_rolls_on_the_cam_that_was_drawn_for_it(name, sense):
    """Its centre, seen from the cam in positions of the machine, is a radius off the profile."""
    chosen = {'joints.contact.sense': sense} if sense else {}
    machine = ms.load_scene(name, {**chosen, 'joints.contact.lift_off': None})
    joint = machine.plan.ideal.joint('contact')
    document = read(profile(machine, 'contact').outline)
    drawn, pitch = (polyline(document, layer) for layer in ('PROFILE', 'PITCH'))
    speed = machine.drive.start[1]
    run = ms.simulate(machine, duration=2 * math.pi / abs(speed))
    for q in run.motion.curve(np.linspace(0.0, 2 * math.pi / abs(speed), 9)):
        places = dict(zip(machine.mechanism.coordinates, q, strict=True))
        away = placed(machine, joint.second, places, np.array(joint.on_second)[:, None])
        away = away - placed(machine, joint.first, places, np.zeros((2, 1)))
        a = machine.plan.ideal.angle(joint.first, places)
        centre = np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]]) @ away[:, 0]
        off = from_segments(drawn[0], centre, closed=drawn[1])
        assert off == pytest.approx(joint.cam.follower.roller, abs=1e-7)
        assert from_segments(pitch[0], centre, closed=pitch[1]) < 1e-7


@pytest.mark.sample(1)
@pytest.mark.parametrize('internal', [False, True])
def test_teeth_that_were_read_back_are_as_thick_as_they_should_be(internal):
    gear = Gear(31, 2.5e-3, shift=0.2, internal=internal)
    document = read(gear_outline(gear))
    points, closed = polyline(document, 'PROFILE')
    z, (name, radius) = points[0] + 1j * points[1], ('PITCH', gear.pitch_radius)
    assert closed
    assert circles(document) == {
        name: pytest.approx(radius),
        'BASE': pytest.approx(gear.base_radius),
        'TIP': pytest.approx(gear.tip_radius),
        'ROOT': pytest.approx(gear.root_radius),
    }
    # where the polygon goes through the pitch circle, by the intersections of its sides
    r, after = np.abs(z), np.roll(z, -1)
    cut = np.flatnonzero((r - radius) * (np.abs(after) - radius) < 0)
    share = (radius - r[cut]) / (np.abs(after[cut]) - r[cut])
    angles = np.sort(np.angle(z[cut] + share * (after[cut] - z[cut])))
    assert len(cut) == 2 * gear.teeth
    tooth = 2 * angles[angles > 0][0]  # about the x axis
    assert tooth * radius == pytest.approx(gear.thickness(radius), abs=1e-7)
    # tips and roots are arcs: no point of any side is further in or out
    sides = np.abs(0.5 * (z + after))
    low, high = sorted((gear.tip_radius, gear.root_radius))
    assert sides.min() > low - 5e-8
    assert sides.max() < high + 1e-12
    assert np.abs(sides - gear.tip_radius).min() < 5e-8


def test_a_gear_rolls_between_the_teeth_of_its_rack():
    """Without backlash: at no place do they overlap, on both sides they touch."""
    gear = Gear(22, 2e-3)
    points, closed = polyline(read(rack_outline(1, 2e-3)), 'PROFILE')
    assert not closed
    (x1, x0), (y1, y0) = points[:, 2:]  # the tip and the root of the upper flank
    pitch = math.pi * 2e-3
    for moved in np.linspace(0.0, pitch, 13):
        teeth = gear.outline(200, math.pi + math.pi / 22 - moved / gear.pitch_radius, arc=32).T
        x, y = teeth[0] + gear.pitch_radius, teeth[1] - moved
        aside, deep = (y + pitch / 2) % pitch - pitch / 2, (x < x1) & (x > x0)
        room = np.abs(aside) - np.interp(x, (x0, x1), (y0, y1))
        for flank in (aside > 0, aside < 0):
            assert -1e-12 < room[deep & flank].min() < 1e-7
    assert rack_teeth(3, 2e-3)[::4, 1] == pytest.approx(pitch * np.arange(3) - y0)


def test_gears_are_drawn_as_svg_too():
    gear = Gear(24, 3e-3)
    root = ElementTree.fromstring(to_svg(gear_outline(gear)))
    shapes = {e.get('id'): e for e in root.iter() if e.get('id')}
    assert set(shapes) == {'profile', 'pitch', 'base', 'tip', 'root', 'shaft'}
    assert float(shapes['pitch'].get('r')) == pytest.approx(36.0)
    x, y = np.array([p.split(',') for p in shapes['profile'].get('d')[1:-1].split('L')], float).T
    assert np.hypot(x, y).max() == pytest.approx(39.0, abs=1e-5)
    assert float(root.get('width').removesuffix('mm')) == pytest.approx(2 * 39.0 + 10.0, abs=1e-3)
    rack = ElementTree.fromstring(to_svg(rack_outline(4, 3e-3)))
    [line] = [e.get('d') for e in rack.iter() if e.get('id') == 'profile']
    assert line.count('L') == 15
    assert not line.endswith('Z')


def test_what_cannot_be_drawn_is_refused(monkeypatch):
    with pytest.raises(InputError, match='a tooth or more'):
        rack_outline(0, 2e-3)
    with pytest.raises(InputError, match='no space between its teeth'):
        rack_outline(3, 2e-3, ToothSystem(FULL_DEPTH.pressure_angle, 1.0, 2.2))
    with pytest.raises(InputError, match='needs a follower with a roller'):
        cam_outline(TILTED, clearance=1e-4)
    monkeypatch.setitem(sys.modules, 'ezdxf', None)
    with pytest.raises(InputError, match=r"pip install 'mechanism_sim\[dxf\]'"):
        to_dxf(cam_outline(TILTED))
