"""Profiles of cams: followers rolled over them, other formulas, brute force."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from textbook import smallest_flat_base_radius

from mechanism_sim.errors import InputError
from mechanism_sim.export.outline_files import to_svg
from mechanism_sim.joints.cam.curves import (
    CYCLOIDAL,
    FOUR_SPLINE,
    HALF_HARMONIC,
    HARMONIC,
    POLYNOMIAL_345,
)
from mechanism_sim.joints.cam.followers import FlatFaced, Oscillating, OscillatingFlat, Translating
from mechanism_sim.joints.cam.interference import find_cut_away
from mechanism_sim.joints.cam.laws import (
    Diagram,
    Eccentric,
    MeasuredLaw,
    Segment,
    check_smoothness,
)
from mechanism_sim.joints.cam.profiles import (
    Cam,
    find_flaws,
    greatest,
    smallest_base_radius,
)
from mechanism_sim.joints.cam.sheet import cam_outline

DEG = math.pi / 180
TURN = np.linspace(0, 2 * math.pi, 721)[:-1] + 1e-3


def law(lift=0.02, curve=CYCLOIDAL):
    return Diagram(
        [Segment(0, 100 * DEG, lift, curve), Segment(150 * DEG, 270 * DEG, -lift, curve)]
    )


def stroke(lift=0.02):
    """Of a cam that slides by 0.19 m; the follower ends higher than it begins."""
    return Diagram(
        [
            Segment(-0.02, 0.0, 0.0, CYCLOIDAL),
            Segment(0.0, 0.07, lift, CYCLOIDAL),
            Segment(0.1, 0.15, -0.6 * lift, POLYNOMIAL_345),
            Segment(0.15, 0.17, 0.0, CYCLOIDAL),
        ],
        reciprocating=True,
    )


def swing(rate, change):
    """A reciprocating cam of 0.1 m under a face that swings one way."""
    x = np.linspace(0.0, 0.1, 8)
    return MeasuredLaw(x, rate * x + change * x**2, reciprocating=True)


ROLLERS = {
    'knife': (law(), Translating(), 0.04),
    'roller': (law(), Translating(roller=0.012), 0.04),
    'offset': (law(curve=POLYNOMIAL_345), Translating(offset=0.015, roller=0.012), 0.04),
    'offset the other way': (law(), Translating(offset=-0.015, roller=0.012), 0.04),
    'arm': (law(0.25), Oscillating(0.12, 0.1, roller=0.012), 0.045),
    'arm on the other side': (law(0.25), Oscillating(0.12, 0.1, roller=0.012, side=-1), 0.045),
    'sliding, knife': (stroke(), Translating(), 0.03),
    'sliding, roller': (stroke(), Translating(offset=0.005, roller=0.008), 0.03),
    'sliding, arm': (stroke(0.2), Oscillating(0.07, 0.1, roller=0.008), 0.03),
    'sliding, other arm': (stroke(0.2), Oscillating(0.07, 0.1, roller=0.008, side=-1), 0.03),
}
FACES = {
    'face': (law(0.01), FlatFaced(), 0.04),
    'tilted face': (law(0.01), FlatFaced(25 * DEG), 0.04),
    'face tilted the other way': (law(0.01), FlatFaced(-40 * DEG), 0.04),
    'swinging face': (law(0.1), OscillatingFlat(0.12), 0.04),
    'swinging face with an offset': (law(0.1), OscillatingFlat(0.12, 0.01, side=-1), 0.04),
    'sliding, swinging face': (swing(7, 20), OscillatingFlat(0.2, -0.02), 0.06),
    'sliding, falling face': (swing(-11, 20), OscillatingFlat(0.2, side=-1), 0.16),
    'sliding, face turning clockwise': (swing(7, -20), OscillatingFlat(0.2, side=-1), 0.06),
}
CAMS = {name: Cam(*parts) for name, parts in (ROLLERS | FACES).items()}


def all_along(cam, count=720):
    """Angles or displacements of the cam, none of them at a break."""
    start, end = cam.law.breaks[[0, -1]]
    return np.linspace(start, end, count + 1)[:-1] + 1e-3 * (end - start) / (2 * math.pi)


def seen_from_the_cam(points, angle, slides=False):
    """Points (2, ...) of the frame, moved by the cam's angle or way: an independent route."""
    z = points[0] + 1j * points[1]
    z = z + 1j * angle if slides else z * np.exp(1j * angle)
    return np.array([z.real, z.imag])


def roller_centre(cam, angle):
    """By complex numbers, from the description of the follower alone."""
    f, u, prime = cam.follower, cam.law(angle), cam.base_radius + cam.follower.roller
    slides = cam.law.reciprocating
    if isinstance(f, Translating):
        lowest = prime if slides else math.sqrt(prime**2 - f.offset**2)
        z = lowest + u + 1j * f.offset
    else:
        a, b = f.pivot_distance, f.arm
        cosine = (a - prime) / b if slides else (a * a + b * b - prime**2) / (2 * a * b)
        z = a - b * np.exp(1j * f.side * (math.acos(cosine) + u))
    return seen_from_the_cam(np.array([z.real, z.imag]), angle, slides)


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', ROLLERS)
def test_a_roller_rolled_over_the_drawn_profile_touches_it_everywhere(name):
    cam = CAMS[name]
    places = all_along(cam)
    drawn, radius, near_by = cam.at(places).profile, cam.follower.roller, 10 * np.diff(places[:2])
    for angle in places[::24]:
        centre = roller_centre(cam, angle)

        def distance(at, centre=centre):
            return math.hypot(*(cam.at(at).profile[:, 0] - centre))

        coarse = np.hypot(*(drawn - centre[:, None]))
        near = places[coarse.argmin()]
        if radius:
            bounds = np.clip([near - near_by, near + near_by], places[0], places[-1]).ravel()
            best = minimize_scalar(distance, bounds=bounds, options={'xatol': 1e-9})
            assert best.fun == pytest.approx(radius, abs=1e-9)
        assert distance(angle) == pytest.approx(radius, abs=1e-12)
        assert coarse.min() > radius - 1e-12


@pytest.mark.parametrize('name', FACES)
def test_a_face_swept_over_the_drawn_profile_touches_it_everywhere(name):
    cam = CAMS[name]
    f, drawn = cam.follower, cam.at(np.linspace(*cam.law.breaks[[0, -1]], 40_001)).profile
    for angle in all_along(cam)[::24]:
        if isinstance(f, FlatFaced):
            normal = np.exp(1j * f.tilt)
            height = cam.base_radius + float(cam.law(angle)) * math.cos(f.tilt)
        else:
            on_base = math.asin((cam.base_radius - f.face_offset) / f.pivot_distance)
            normal = np.exp(1j * f.side * (on_base + float(cam.law(angle)) - math.pi / 2))
            height = f.pivot_distance * normal.real + f.face_offset
        if cam.law.reciprocating:
            height += angle * normal.imag
        else:
            normal = normal * np.exp(1j * angle)
        heights = drawn[0] * normal.real + drawn[1] * normal.imag
        # between the points drawn the profile bulges by their distance squared over 8 radii
        assert heights.max() <= height + 1e-14
        assert heights.max() == pytest.approx(height, abs=1e-9)


@pytest.mark.parametrize('name', CAMS)
def test_normal_and_curvature_are_those_of_the_drawn_profile(name):
    cam, x = CAMS[name], all_along(CAMS[name])
    h = 1e-3 * (x[-1] - x[0]) / (2 * math.pi) if cam.law.reciprocating else 1e-4
    x = x[np.abs(x[:, None] - cam.law.breaks).min(axis=1) > 5 * h]
    profile = [cam.at(x + k * h).profile for k in range(-2, 3)]
    first = (profile[0] - 8 * profile[1] + 8 * profile[3] - profile[4]) / (12 * h)
    second = (-profile[0] + 16 * profile[1] - 30 * profile[2] + 16 * profile[3] - profile[4]) / (
        12 * h * h
    )
    touch = cam.at(x)
    along = np.hypot(*first)
    assert (touch.normal * first).sum(axis=0) / along == pytest.approx(0 * x, abs=1e-9)
    curvature = (first[0] * second[1] - first[1] * second[0]) / along**3
    # a face may pass over the profile clockwise
    curvature *= np.sign(touch.normal[0] * first[1] - touch.normal[1] * first[0])
    # the straight parts of a sliding cam have an infinite radius
    assert curvature == pytest.approx(1 / touch.curvature_radius, rel=2e-5, abs=1e-6)


@pytest.mark.parametrize('name', CAMS)
def test_sliding_is_how_fast_the_follower_passes_the_cam(name):
    """A point fixed to the follower at the contact, followed in the cam's frame."""
    cam, f, x = CAMS[name], CAMS[name].follower, all_along(CAMS[name])[::7]
    slides, h = cam.law.reciprocating, 1e-5 * (x[-1] - x[0]) / (2 * math.pi)
    touch = cam.at(x)
    contact = seen_from_the_cam(touch.profile, -x, slides)

    def carried(step):
        u = cam.law(x + step) - cam.law(x)
        if isinstance(f, (Translating, FlatFaced)):
            moved = contact + np.array([u, 0 * u])
        else:
            z = (contact[0] + 1j * contact[1] - f.pivot_distance) * np.exp(1j * f.side * u)
            moved = np.array([f.pivot_distance + z.real, z.imag])
        return seen_from_the_cam(moved, x + step, slides)

    velocity = (carried(h) - carried(-h)) / (2 * h)
    tangent = np.array([-touch.normal[1], touch.normal[0]])
    speed = (velocity * tangent).sum(axis=0)
    assert speed == pytest.approx(touch.sliding, rel=1e-7, abs=1e-8)
    assert (velocity * touch.normal).sum(axis=0) == pytest.approx(0 * x, abs=1e-8)


def test_a_sliding_cam_is_a_disk_of_infinite_radius():
    roller = Translating(roller=0.008)

    def parts(scale):
        return [
            Segment(0.0, 0.07 * scale, 0.02, CYCLOIDAL),
            Segment(0.1 * scale, 0.15 * scale, -0.02, POLYNOMIAL_345),
        ]

    x = np.linspace(0.001, 0.149, 100)
    exact = Cam(Diagram(parts(1.0), reciprocating=True), roller, 0.03).at(x)
    errors = []
    for radius in (1e2, 1e3, 1e4):
        disk = Cam(Diagram(parts(1 / radius)), roller, radius).at(x / radius)
        found = (
            disk.profile - [[radius - 0.03], [0.0]],
            disk.pressure_angle,
            disk.sliding / radius,
            disk.curvature,
        )
        limits = (exact.profile, exact.pressure_angle, exact.sliding, exact.curvature)
        errors.append(
            [np.abs(a - b).max() / np.abs(b).max() for a, b in zip(found, limits, strict=True)]
        )
    first, second, third = np.array(errors)
    assert first == pytest.approx(10 * second, rel=0.05)
    assert second == pytest.approx(10 * third, rel=0.05)
    assert third.max() < 1e-4


def test_pressure_angles_by_the_formulas_of_the_books():
    for name in ('knife', 'roller', 'offset', 'offset the other way'):
        cam = CAMS[name]
        f, u, u1 = cam.follower, cam.law(TURN), cam.law(TURN, 1)
        height = math.sqrt((cam.base_radius + f.roller) ** 2 - f.offset**2) + u
        expected = np.arctan((f.offset - u1) / height)
        assert cam.at(TURN).pressure_angle == pytest.approx(expected, abs=1e-13)
    for name in ('arm', 'arm on the other side'):
        cam = CAMS[name]
        f, a, b = cam.follower, cam.follower.pivot_distance, cam.follower.arm
        psi = f.lowest(cam.base_radius) + cam.law(TURN)
        above = a * np.cos(psi) - b * (1 + f.side * cam.law(TURN, 1))
        expected = np.arctan(f.side * above / (a * np.sin(psi)))
        assert cam.at(TURN).pressure_angle == pytest.approx(expected, abs=1e-13)
    assert CAMS['face'].at(TURN).pressure_angle == pytest.approx(0 * TURN, abs=1e-15)
    assert CAMS['tilted face'].at(TURN).pressure_angle == pytest.approx(0 * TURN + 25 * DEG)
    sliding = CAMS['sliding, roller']
    x = all_along(sliding)
    assert sliding.at(x).pressure_angle == pytest.approx(-np.arctan(sliding.law(x, 1)), abs=1e-13)
    assert CAMS['swinging face'].at(TURN).pressure_angle == pytest.approx(0 * TURN, abs=1e-13)


@pytest.mark.parametrize('name', CAMS)
def test_pressure_angles_are_what_virtual_power_says(name):
    """A unit force along the normal does the work of its moment, or its push, on the cam."""
    cam, f, x = CAMS[name], CAMS[name].follower, all_along(CAMS[name])
    touch, slides = cam.at(x), cam.law.reciprocating
    arm = seen_from_the_cam(touch.pitch, -x, slides)
    force = touch.normal if slides else seen_from_the_cam(touch.normal, -x)
    moment = -force[1] if slides else force[0] * arm[1] - force[1] * arm[0]
    lever = 1.0
    if not isinstance(f, (Translating, FlatFaced)):
        lever = np.hypot(arm[0] - f.pivot_distance, arm[1])
    work = np.cos(touch.pressure_angle) * lever * cam.law(x, 1)
    assert work == pytest.approx(moment * 1.0, abs=1e-14)


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('follower', 'lift', 'limit'),
    [
        (Translating(roller=0.01), 0.02, 25),
        (Translating(offset=0.006, roller=0.01), 0.02, 25),
        (Translating(offset=-0.006), 0.02, 30),
        (Oscillating(0.12, 0.1, roller=0.012), 0.25, 40),
        (Oscillating(0.12, 0.1, roller=0.012, side=-1), 0.25, 38),
    ],
)
@pytest.mark.parametrize('curve', [CYCLOIDAL, FOUR_SPLINE])
def test_the_smallest_base_circle_by_brute_force(follower, lift, limit, curve):
    motion, dense = law(lift, curve), np.linspace(0, 2 * math.pi, 20_001)
    radius = smallest_base_radius(motion, follower, limit * DEG)

    def largest(r):
        return np.abs(follower.touch(motion, r, dense).pressure_angle).max()

    fits = np.array([largest(r) <= limit * DEG for r in radius * np.linspace(0.6, 1.02, 43)])
    assert fits.tolist() == [False] * 41 + [True] * 2 or fits.tolist() == [False] * 40 + [True] * 3
    assert Cam(motion, follower, radius).largest_pressure_angle == pytest.approx(
        limit * DEG, rel=1e-9
    )


def test_the_place_of_an_extreme_is_known_and_that_of_a_constant_is_none():
    """Closed forms where values near the top differ by rounding only: as x^2, x^3 and x^4."""
    diagram = law()
    turn = diagram.breaks[-1] - diagram.breaks[0]
    for power in (2, 3, 4):
        at, top = greatest(diagram, lambda x, p=power: 3.0 - np.abs(np.sin(0.5 * (x - 1.1))) ** p)
        assert (at, top) == (pytest.approx(1.1, abs=1e-7), 3.0)
    begin, end = diagram.breaks[1:3]
    assert end - begin < turn
    for power in (2, 3, 4):  # a break is met exactly
        at, _ = greatest(diagram, lambda x, p=power: -(np.abs(np.sin(0.5 * (x - begin))) ** p))
        assert at == begin
    flat = greatest(diagram, lambda x: np.where((x > begin) & (x < end), 1.0, 0.5))
    assert flat == (begin, 1.0)
    assert greatest(diagram, lambda x: 0.035 * (np.sin(x) ** 2 + np.cos(x) ** 2))[0] is None


@pytest.mark.slow
def test_a_limit_that_no_base_circle_keeps_is_refused():
    with pytest.raises(InputError, match='within 10 deg'):
        smallest_base_radius(law(0.4), Oscillating(0.12, 0.1), 10 * DEG)
    for radius in np.linspace(0.021, 0.21, 25):
        assert Cam(law(0.4), Oscillating(0.12, 0.1), radius).largest_pressure_angle > 10 * DEG
    with pytest.raises(InputError, match='between 0 and 90 deg'):
        smallest_base_radius(law(), Translating(), 2.0)


def test_undercut_begins_where_the_pitch_curve_is_as_sharp_as_the_roller():
    motion = law()
    knife = Cam(motion, Translating(), 0.03)
    sharpest = np.nanmax(knife.at(np.linspace(0, 2 * math.pi, 100_001)).curvature)
    # the same pitch curve for every roller: base and roller radius add up
    for share, count in ((0.99, 0), (1.01, 1)):
        radius = share / sharpest
        cam = Cam(motion, Translating(roller=radius), 0.03 - radius)
        flaws = find_flaws(cam)
        assert len(flaws) == count
        least = cam.at(np.linspace(0, 2 * math.pi, 20_001))
        bulging = least.curvature_radius[least.curvature > 0].min()
        assert (bulging < 0) == bool(count)
    assert flaws[0].kind == 'undercut'
    assert flaws[0].start <= flaws[0].worst <= flaws[0].end
    assert str(flaws[0]).startswith('the inner profile is undercut from ')


@pytest.mark.parametrize('name', CAMS)
def test_nothing_of_a_sound_profile_is_cut_away(name):
    assert find_flaws(CAMS[name]) == []
    assert find_cut_away(CAMS[name]) == []


@pytest.mark.parametrize(
    ('follower', 'base'), [(Translating(roller=0.045), 0.002), (FlatFaced(), 0.02)]
)
def test_more_of_an_undercut_profile_is_lost_than_its_curvature_shows(follower, base):
    motion = law(0.03)
    cam = Cam(motion, follower, base)
    found, flaws = find_cut_away(cam), find_flaws(cam)
    assert flaws
    for flaw in flaws:
        assert any(i.start < flaw.start and flaw.end < i.end for i in found)
    # by brute force: the point of contact at its worst, against all positions of the follower
    worst = max(found, key=lambda i: i.depth)
    x = np.linspace(0, 2 * math.pi, 100_001)
    point = cam.at(worst.worst).profile
    if isinstance(follower, FlatFaced):
        depth = (point[0] * np.cos(x) + point[1] * np.sin(x) - base - motion(x)).max()
    else:
        depth = follower.roller - np.hypot(*(roller_centre(cam, x) - point)).min()
    assert worst.depth == pytest.approx(depth, rel=1e-3)
    assert 'the profile is cut away by the follower' in str(worst)


def test_a_corner_of_the_law_cuts_the_profile_of_a_roller():
    """As [V] A.5 would, were its roller put on the equidistant curve."""
    motion = law(0.02, HALF_HARMONIC)
    cam = Cam(motion, Translating(roller=0.012), 0.04)
    assert find_flaws(cam) == []
    corners = [j.angle for j in check_smoothness(motion) if j.order == 1]
    found = find_cut_away(cam)
    assert len(found) == len(corners)
    for part, corner in zip(found, corners, strict=True):
        assert part.start < corner < part.end
    assert find_cut_away(Cam(motion, Translating(), 0.04)) == []


def test_under_a_face_the_smallest_base_circle_just_has_a_cusp():
    motion = law(0.03)
    x = np.linspace(0, 2 * math.pi, 200_001)
    radius = smallest_flat_base_radius(motion)
    assert radius == pytest.approx(-(motion(x) + motion(x, 2)).min(), rel=1e-8)
    assert [f.kind for f in find_flaws(Cam(motion, FlatFaced(), radius))] == ['cusp']
    assert find_flaws(Cam(motion, FlatFaced(), 1.01 * radius)) == []
    assert {f.kind for f in find_flaws(Cam(motion, FlatFaced(), 0.9 * radius))} == {'undercut'}
    assert smallest_flat_base_radius(motion, 0.01) == pytest.approx(radius + 0.01)
    tilted = smallest_flat_base_radius(motion, tilt=0.5)
    assert [f.kind for f in find_flaws(Cam(motion, FlatFaced(0.5), tilted))] == ['cusp']
    assert find_flaws(Cam(motion, FlatFaced(0.5), 1.01 * tilted)) == []


def test_under_a_face_an_eccentric_moves_harmonically():
    """Its profile comes back from the harmonic law: a circle about a point of the cam."""
    motion = Diagram(
        [Segment(0, math.pi, 0.02, HARMONIC), Segment(math.pi, 2 * math.pi, -0.02, HARMONIC)]
    )
    touch = Cam(motion, FlatFaced(), 0.03).at(TURN)
    assert np.hypot(touch.profile[0] + 0.01, touch.profile[1]) == pytest.approx(0.04, rel=1e-12)
    assert touch.curvature_radius == pytest.approx(0.04, rel=1e-12)


def test_under_a_roller_the_eccentric_is_a_circle():
    roller = 0.01
    cam = Cam(Eccentric(0.04, 0.012), Translating(roller=roller), 0.028 - roller)
    touch = cam.at(TURN)
    # the cam's centre: the highest place is at a quarter of a turn
    assert np.hypot(touch.profile[0], touch.profile[1] - 0.012) == pytest.approx(0.04 - roller)
    assert touch.curvature_radius == pytest.approx(0.04 - roller, rel=1e-12)


def test_a_groove_holds_the_roller_with_its_clearance():
    cam, clearance = CAMS['offset'], 4e-4
    inner, outer = cam.groove(TURN, clearance)
    centre, radius = roller_centre(cam, TURN), cam.follower.roller
    for wall in (inner, outer):
        assert np.hypot(*(wall - centre)) == pytest.approx(radius + clearance / 2)
    assert (np.hypot(*outer) > np.hypot(*inner)).all()
    assert find_flaws(cam, clearance) == []
    quick = Diagram([Segment(0, 0.6, 0.02, CYCLOIDAL), Segment(3, 5, -0.02, CYCLOIDAL)])
    hollow = Cam(quick, Translating(roller=0.02), 0.02)
    assert {f.wall for f in find_flaws(hollow, clearance)} == {'inner', 'outer'}
    at = np.linspace(0, 0.6, 2001)
    wall = hollow.groove(at, clearance)[1]
    backwards = (np.diff(wall) * np.diff(hollow.at(at).pitch)).sum(axis=0) < 0
    outer = next(f for f in find_flaws(hollow, clearance) if f.wall == 'outer')
    assert at[:-1][backwards][[0, -1]] == pytest.approx([outer.start, outer.end], abs=0.005)
    with pytest.raises(InputError, match='needs a follower with a roller'):
        CAMS['knife'].groove(TURN)


@pytest.mark.parametrize('name', ['offset', 'arm', 'swinging face'])
def test_the_picture_has_the_size_of_the_cam(name):
    cam = CAMS[name]
    root = ElementTree.fromstring(to_svg(cam_outline(cam)))
    assert root.get('width').endswith('mm')
    box = [float(v) for v in root.get('viewBox').split()]
    assert box[2:] == [float(root.get(k).removesuffix('mm')) for k in ('width', 'height')]
    [path] = [e for e in root.iter() if e.get('id') == 'profile']
    x, y = np.array([pair.split(',') for pair in path.get('d')[1:-1].split('L')], float).T * 1e-3
    # the picture's y axis points down
    nearest = [np.hypot(x - a, -y - b).min() for a, b in cam.at(TURN).profile.T]
    assert max(nearest) < 1e-4
    assert [box[0], box[1]] <= [1e3 * x.min(), 1e3 * y.min()]
    if isinstance(cam.follower, Translating):
        centre = roller_centre(cam, 0.7)
        reach = np.hypot(x - centre[0], -y - centre[1]).min()
        assert reach == pytest.approx(cam.follower.roller, abs=1e-7)


def test_a_picture_of_a_groove_has_both_walls():
    root = ElementTree.fromstring(to_svg(cam_outline(CAMS['roller'], clearance=1e-3)))
    assert {'inner', 'outer', 'pitch'} <= {e.get('id') for e in root.iter()}


def test_flaws_of_a_sliding_cam_are_named_in_millimetres():
    motion = stroke()
    sharp = Cam(motion, Translating(roller=0.05), 0.03)
    flaws, found = find_flaws(sharp, 1e-3), find_cut_away(sharp)
    assert {f.wall for f in flaws} == {'inner', 'outer'}
    inner = next(f for f in flaws if f.wall == 'inner')
    x = np.linspace(-0.0199, 0.1699, 20_001)
    way = np.diff(sharp.at(x).profile[1])
    # the profile runs backwards where it is undercut
    assert any(inner.start < at < inner.end for at in x[:-1][way < 0])
    assert str(inner).startswith('the inner profile is undercut from ')
    assert str(inner).endswith(f'mm, most at {1e3 * inner.worst:g} mm')
    assert found[0].start < inner.start < inner.end < found[0].end
    assert ' mm the profile is cut away by the follower' in str(found[0])


SUNK = MeasuredLaw(np.arange(8) * math.pi / 4, 0.02 * np.sin(np.arange(8) * math.pi / 4))


@pytest.mark.parametrize(
    ('make', 'said'),
    [
        (lambda: Cam(law(), Translating(offset=0.05), 0.04), 'offset of 0.05 m misses the base'),
        (lambda: Cam(law(), Translating(roller=-0.05), 0.04), 'not negative'),
        (lambda: Cam(law(), Translating(), -0.04), 'a base radius is positive'),
        (lambda: Cam(law(), Oscillating(0.2, 0.1), 0.04), 'does not reach the base circle'),
        (lambda: Cam(law(), OscillatingFlat(0.03), 0.04), 'too near'),
        (lambda: Cam(law(3.2), Oscillating(0.12, 0.1), 0.04), 'past the line of centres'),
        (lambda: Cam(SUNK, Translating(), 0.01), 'below the camshaft'),
        (lambda: Cam(SUNK, FlatFaced(), 0.01), 'below the camshaft'),
        (lambda: Cam(law(2.0), OscillatingFlat(0.3), 0.04), 'faster than the cam turns'),
        (lambda: FlatFaced(1.6), 'tilted by less than 90 deg'),
        (lambda: Cam(stroke(), FlatFaced(0.3), 0.04), 'does not turn one way all along'),
        (lambda: Cam(stroke(), OscillatingFlat(0.2), 0.04), 'does not turn one way all along'),
        (lambda: CAMS['sliding, knife'].at(0.2), r'200 mm lies beyond .* from -20 to 170 mm'),
        (lambda: smallest_base_radius(stroke(), Translating(), 0.5), 'has no base circle'),
    ],
)
def test_what_does_not_fit_is_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()
