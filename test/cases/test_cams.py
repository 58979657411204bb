"""Cams as workshops describe them: by laws, shapes and measured tables, against closed forms."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from builders import cam_pair, made
from running import one_of, run

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.errors import InputError
from mechanism_sim.joints.cam.laws import check_smoothness
from mechanism_sim.joints.cam.outlines import nose_cam
from mechanism_sim.linkages.nominal import NominalRun
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.report import cycle as report
from mechanism_sim.scene.check import check

INPUTS = Path(__file__).parent / 'inputs'
SPEED = 20.0 * math.pi  # rad/s, 600 rpm
BASE, ROLLER, NOSE, LIFT = 0.025, 0.012, 0.010, 0.015
FLANK, REACH = BASE + ROLLER, NOSE + ROLLER
CENTRE = BASE + LIFT - NOSE  # of the nose, from the camshaft


def scene(law, **keys):
    """A cam at 600 rpm under a roller of 12 mm that slides; a key of None is left out."""
    contact = {
        'cam': ['cam', 'follower'], 'follower': 'roller', 'roller': '12 mm',
        'base_radius': '25 mm', 'law': law,
    } | keys  # fmt: skip
    return {
        'links': {
            'ground': {},
            'cam': {'mass': '1 kg', 'inertia': '500 kg mm^2'},
            'follower': {'mass': '1 kg'},
        },
        'joints': {
            'bearing': {'revolute': ['ground', 'cam']},
            'guide': {'prismatic': ['ground', 'follower'], 'axis': '90 deg'},
            'contact': {k: v for k, v in contact.items() if v is not None},
        },
        'drive': {'coordinate': 'cam', 'speed': '600 rpm'},
    }  # fmt: skip


def segments(*parts, **keys):
    """A law by segments (from, to [deg], rise [mm], curve)."""
    return {
        'segments': [
            {'from': f'{a} deg', 'to': f'{b} deg', 'rise': f'{rise} mm', 'curve': curve} | keys
            for a, b, rise, curve in parts
        ]
    }


def cycle(content, **how):
    return ms.cycle(made(content), samples=36, **how)


def accelerations(content):
    """Least and greatest of the follower [m/s^2]."""
    ends = cycle(content).extremes()['acceleration.follower']
    return ends.least.value, ends.greatest.value


def table():
    return yaml.safe_load((INPUTS / 'tangent_cam.yaml').read_text())


def every(content, n, **law):
    """A table thinned to n points."""
    given = content['joints']['contact']['law']
    given['points'] = given['points'][:: len(given['points']) // n]
    given.update(law)
    return content


# Tangent cam: on the flank the roller's centre is (r1 + r2)/cos off the camshaft, on the nose it
# is a slider-crank of crank d and rod r3 + r2 (Rattan, Theory of Machines, section 7.14)


def flank_acceleration(angle):
    """By the square of the speed of the cam [m/rad^2], where the angle is from the flank."""
    c = math.cos(angle)
    return FLANK * (1.0 + math.sin(angle) ** 2) / c**3


def nose_acceleration(angle):
    """Likewise, where the angle is from the middle of the nose."""
    s, c = CENTRE * math.sin(angle), CENTRE * math.cos(angle)
    q = math.sqrt(REACH**2 - s**2)
    slope = -s * c / q
    return -c + (s * s - c * c - slope**2) / q


def nose_begins():
    """Angle [rad] from the flank at which the roller comes to the nose."""
    return math.atan(math.sqrt(CENTRE**2 - (BASE - NOSE) ** 2) / FLANK)


TANGENT = {'tangent': {'nose': '10 mm', 'lift': '15 mm'}}


def test_the_accelerations_of_a_tangent_cam_are_those_of_the_closed_form():
    least, greatest = accelerations(scene(TANGENT))
    begins = nose_begins()
    right = SPEED**2 * flank_acceleration(begins)
    assert right == pytest.approx(354.49, abs=5e-3)
    assert greatest == pytest.approx(right, rel=1e-9)
    # the nose's greatest retardation is where the roller comes to it, or in its middle
    half = math.acos((BASE - NOSE) / CENTRE)
    angles = np.linspace(0.0, half - begins, 2001)
    nose = SPEED**2 * min(nose_acceleration(x) for x in angles)
    assert nose == pytest.approx(-314.67, abs=5e-3)
    assert least == pytest.approx(nose, rel=1e-9)


@pytest.mark.slow
def test_a_tangent_cam_goes_up_and_down_alike():
    swing = cycle(scene(TANGENT)).swings()['follower']
    assert swing.time_ratio == pytest.approx(1.0, abs=1e-9)
    assert (swing.rising, swing.falling) == pytest.approx((1.0 / 60.0, 1.0 / 60.0), rel=1e-9)
    assert swing.standing == pytest.approx(1.0 / 15.0, rel=1e-9)
    assert swing.ripple == 0.0


def test_a_tangent_cam_has_the_lifts_of_its_table():
    """The table of the case is rounded to 1 nm."""
    joint = cam_pair(made(scene(TANGENT)))
    given = np.loadtxt(INPUTS / 'tangent_cam_lift.csv', delimiter=',')
    lift = 1e3 * joint.cam.law(np.radians(given[:, 0]))
    assert np.abs(lift - given[:, 1]).max() <= 0.5e-6 * 1.01


@pytest.mark.parametrize(
    ('e', 'roller'),
    [(10.0, 8.0), (12.0, 0.0), pytest.param(30.0, 10.0, marks=pytest.mark.slow)],
)
def test_the_smallest_base_circle_of_an_eccentric_cam(e, roller):
    """The normal goes through the centre of the circle: the sine is the eccentricity over R."""
    kind = {'follower': 'roller', 'roller': f'{roller} mm'}
    if not roller:
        kind = {'follower': 'knife', 'roller': None}
    cam = cam_pair(made(scene({'eccentric': f'{e} mm'}, **kind))).cam
    for limit in map(math.radians, (20.0, 30.0)):
        radius = 1e-3 * (e / math.sin(limit) - e - roller)
        assert cam.smallest_base_radius(limit) == pytest.approx(radius, rel=1e-9)
    with pytest.raises(InputError, match='any base radius'):
        cam.smallest_base_radius(math.radians(89.99))


@pytest.mark.sample(1)
@pytest.mark.parametrize('limit', [25.0, 35.0])
def test_the_smallest_base_circle_of_a_tangent_cam(limit):
    """The limit is met at the end of the flank, whose length is that of a tangent."""
    slope = math.tan(math.radians(limit)) ** 2
    # lift^2 + 2 lift (base - nose) = slope (base + roller)^2
    square = (
        slope,
        2.0 * (slope * ROLLER - LIFT),
        slope * ROLLER**2 - LIFT**2 + 2.0 * LIFT * NOSE,
    )
    cam = cam_pair(made(scene(TANGENT))).cam
    found = cam.smallest_base_radius(math.radians(limit))
    assert found == pytest.approx(max(np.roots(square)), rel=1e-8)


# A cam of circular arcs under a flat face: over each arc the lift is that of its centre's height,
# so its acceleration is (centre to camshaft) cos (Rattan, section 7.15)


def test_a_cam_of_arcs_under_a_flat_face_has_the_closed_form():
    law = {'arcs': {'nose': '10 mm', 'lift': '15 mm', 'flank': '80 mm'}}
    least, greatest = accelerations(scene(law, follower='flat', roller=None))
    # on the flank it is greatest where it begins, on the nose where it is highest
    assert greatest == pytest.approx(SPEED**2 * (0.080 - BASE), rel=1e-9)
    assert least == pytest.approx(-(SPEED**2) * CENTRE, rel=1e-9)


def arc_angles(flank):
    """Half angle of action, and that of the flank alone under a flat face [rad]."""
    a, b, d = flank - BASE, flank - NOSE, CENTRE
    half = math.acos((b * b - a * a - d * d) / (2.0 * a * d))
    return half, math.asin(d * math.sin(half) / b)


def test_angles_of_action_of_a_cam_of_arcs_are_those_of_its_triangle():
    law = {'arcs': {'nose': '10 mm', 'lift': '15 mm', 'flank': '80 mm', 'at': '90 deg'}}
    joint = cam_pair(made(scene(law, follower='flat', roller=None)))
    half, flank = arc_angles(0.080)
    first, second = joint.cam.law.breaks[0], math.pi / 2.0 - half + flank
    assert first == pytest.approx(math.pi / 2.0 - half, rel=1e-12)
    assert np.abs(joint.cam.law.breaks - second).min() < 1e-12


def test_a_hollow_flank_has_the_closed_form():
    """The roller's centre goes round that of the flank, as a slider-crank of crank R + r1."""
    law = {'arcs': {'nose': '10 mm', 'lift': '15 mm', 'flank': '-200 mm'}}
    joint = cam_pair(made(scene(law)))
    away, rod = 0.200 + BASE, 0.200 - ROLLER
    x = np.radians(np.linspace(0.0, 8.0, 50))
    lift = away * np.cos(x) - np.sqrt(rod**2 - (away * np.sin(x)) ** 2) - FLANK
    assert joint.cam.law(x) == pytest.approx(lift, abs=1e-15)


def edges(turned):
    """The tangent cam as it is drawn, its nose in some direction [rad], in any order."""
    outline = nose_cam(BASE, NOSE, LIFT, math.inf, turned)
    found = []
    for curve in outline.curves:
        if hasattr(curve, 'centre'):
            found.append({'arc': [*curve.centre], 'radius': abs(curve.radius),
                          'from': curve.start, 'to': curve.end})  # fmt: skip
        else:
            found.append({'line': [[*curve.start], [*curve.end]][::-1]})
    return yaml.safe_load(re.sub(r'np\.float64\(([^)]*)\)', r'\1', str(found[::-1])))


@pytest.mark.slow
@pytest.mark.parametrize('sense', one_of(2, ['clockwise', 'counterclockwise']))
def test_a_drawn_cam_lifts_as_its_drawing_turns(sense):
    """A nose at 20 deg of the drawing is under the follower, at 90 deg, at +-70 deg of the cam."""
    shape = scene({'profile': {'edges': edges(math.radians(20.0))}}, base_radius=None, sense=sense)
    machine = made(shape)
    joint = cam_pair(machine)
    known = cam_pair(made(scene(TANGENT))).cam.law
    x = np.linspace(0.0, 6.0, 200)
    sign = 1.0 if sense == 'counterclockwise' else -1.0
    assert joint.cam.base_radius == pytest.approx(BASE, rel=1e-12)
    shifted = known(x - sign * math.radians(70.0) + math.radians(60.0))
    assert joint.cam.law(x) == pytest.approx(shifted, abs=1e-14)
    assert accelerations(shape) == pytest.approx(accelerations(scene(TANGENT)), rel=1e-9)


@pytest.mark.slow
def test_radii_over_the_angle_make_the_cam():
    """An eccentric circle moves a roller as a slider-crank: e cos + sqrt(R^2 - e^2 sin^2)."""
    e, rim = 5.0, 30.0

    def radius(a):
        return e * math.cos(a) + math.sqrt(rim**2 - (e * math.sin(a)) ** 2)

    points = [[f'{a} deg', f'{radius(math.radians(a)):.15g} mm'] for a in range(0, 360, 3)]
    law = {'profile': {'points': points, 'degree': 7}}
    joint = cam_pair(made(scene(law, base_radius=None)))
    x = np.linspace(0.0, 6.2, 100)
    rod = (rim + 12.0) ** 2
    right = e * np.cos(x) + np.sqrt(rod - (e * np.sin(x)) ** 2) - (rim - e + 12.0)
    assert 1e3 * joint.cam.law(x) == pytest.approx(right, abs=1e-9)
    assert joint.cam.base_radius == pytest.approx(0.025, abs=1e-12)


def test_a_supplier_s_table_of_radii_has_no_jumps_of_rounding():
    """Radii every 5 deg, rounded to 10 nm: a spline of degree 5, whose acceleration is smooth."""

    def lift(a):  # 20 mm up in 120 deg, as a cycloid, a dwell of 60 deg, and back
        x = min(a, 120.0, max(300.0 - a, 0.0)) / 120.0
        return 20.0 * (x - math.sin(2.0 * math.pi * x) / (2.0 * math.pi))

    points = [[f'{a} deg', f'{30.0 + lift(a):.5f} mm'] for a in range(0, 360, 5)]
    law = cam_pair(made(scene({'profile': {'points': points}}, base_radius=None))).cam.law
    assert [str(jump) for jump in check_smoothness(law)] == []


@pytest.mark.sample(2)
@pytest.mark.parametrize('follower', [
    {'follower': 'knife', 'roller': None},
    {'follower': 'flat', 'roller': None},
    {'follower': 'flat', 'roller': None, 'tilt': '5 deg'},
])  # fmt: skip
def test_the_profile_of_the_law_is_the_shape_that_it_came_from(follower):
    """Its points lie on the arcs, whichever follower goes over them."""
    law = {'arcs': {'nose': '10 mm', 'lift': '15 mm', 'flank': '80 mm'}}
    cam = cam_pair(made(scene(law, **follower))).cam
    points = cam.at(np.linspace(0.0, 6.2, 300)).profile
    arcs = nose_cam(BASE, NOSE, LIFT, 0.080, None).curves
    off = [np.abs(np.hypot(*(points - np.array(a.centre)[:, None])) - a.radius) for a in arcs]
    assert np.min(off, axis=0).max() < 1e-15


def swinging(law, follower):
    """As `scene`, the follower on an arm of 80 mm whose pivot is 90 mm from the camshaft."""
    content = scene(law, side='left', **follower)
    content['links']['ground'] = {'points': {'pivot': ['90 mm', '0 mm']}}
    content['links']['follower'] |= {'inertia': '2000 kg mm^2', 'length': '80 mm'}
    content['joints']['guide'] = {'revolute': ['ground.pivot', 'follower']}
    content['joints']['contact']['cam'] = ['cam', 'follower.end']
    content['guess'] = {'follower': '155 deg'}
    return content


@pytest.mark.sample(1)
@pytest.mark.parametrize('follower', [{}, {'follower': 'flat', 'roller': None, 'face': '3 mm'}])
def test_swinging_followers_get_their_law_from_a_shape(follower):
    law = {'arcs': {'nose': '10 mm', 'lift': '15 mm', 'flank': '80 mm'}}
    cam = cam_pair(made(swinging(law, follower))).cam
    points = cam.at(np.linspace(0.0, 6.2, 300)).profile
    arcs = nose_cam(BASE, NOSE, LIFT, 0.080, None).curves
    off = [np.abs(np.hypot(*(points - np.array(a.centre)[:, None])) - a.radius) for a in arcs]
    assert np.min(off, axis=0).max() < 1e-15


# Laws by segments: Norton, Design of Machinery, chapter 8; the homework is a rise of 25 mm in
# 90 deg, dwell, return in 90 deg and dwell at 30 rpm


@pytest.mark.slow
def test_strokes_of_a_4567_cam_with_dwells_take_half_a_second_each():
    content = scene(segments((0, 90, 25, 'polynomial_4567'), (180, 270, -25, 'polynomial_4567')),
                    base_radius='50 mm')  # fmt: skip
    content['drive']['speed'] = '30 rpm'
    found = cycle(content)
    swing = found.swings()['follower']
    assert (swing.rising, swing.falling) == pytest.approx((0.5, 0.5), abs=1e-9)
    assert swing.time_ratio == pytest.approx(1.0, abs=1e-9)
    assert [x.duration for x in swing.dwells] == pytest.approx([0.5, 0.5], abs=1e-9)
    assert 'up in 0.5 s and down in 0.5 s: time ratio 1; stands at' in report.render(found)


def test_constant_acceleration_has_the_least_peak():
    """4 h (speed/angle)^2, up and down (Norton, table 8-3)."""
    law = segments((0, 90, 10, 'constant_acceleration'), (180, 300, -10, 'constant_acceleration'))
    right = 4.0 * 0.010 * (SPEED / (math.pi / 2.0)) ** 2
    assert accelerations(scene(law)) == pytest.approx((-right, right), rel=1e-12)


REST = {'velocity': 0, 'acceleration': 0}


def polynomial(begin, end, rise, *conditions):
    return {'from': f'{begin} deg', 'to': f'{end} deg', 'rise': f'{rise} mm',
            'curve': 'polynomial', 'conditions': [*conditions]}  # fmt: skip


def test_conditions_of_both_ends_make_the_known_polynomials():
    for known, more in (('polynomial_345', {}), ('polynomial_4567', {'jerk': 0})):
        ends = [{'at': f'{a} deg', **REST, **more} for a in (0, 90)]
        own = {
            'segments': [
                polynomial(0, 90, 10, *ends),
                *segments((180, 270, -10, known))['segments'],
            ]
        }
        law = cam_pair(made(scene(own))).cam.law
        named = segments((0, 90, 10, known), (180, 270, -10, known))
        right = cam_pair(made(scene(named))).cam.law
        x = np.linspace(0.0, 6.2, 200)
        for order, size in ((0, 0.01), (1, 0.01), (2, 0.05)):
            assert law(x, order) == pytest.approx(right(x, order), abs=1e-13 * size)


def test_a_rise_and_fall_is_one_polynomial():
    """Norton, example 8-7: 64 h (x^3 - 3 x^4 + 3 x^5 - x^6), x = angle/180 deg."""
    part = polynomial(0, 180, 0, {'at': '0 deg', **REST}, {'at': '90 deg', 'lift': '25 mm'},
                      {'at': '180 deg', **REST})  # fmt: skip
    law = cam_pair(made(scene({'segments': [part]}))).cam.law
    x = np.linspace(0.0, 1.0, 101)
    right = 64.0 * 0.025 * (x**3 - 3.0 * x**4 + 3.0 * x**5 - x**6)
    assert law(math.pi * x) == pytest.approx(right, abs=2e-15)


def test_a_polynomial_of_degree_21_meets_its_conditions():
    places = np.linspace(0.0, 180.0, 17)
    wanted = 5.0 * (1.0 - np.cos(np.radians(places)))
    inner = [{'at': f'{a} deg', 'lift': f'{y:.12g} mm'}
             for a, y in zip(places[1:-1], wanted[1:-1], strict=True)]  # fmt: skip
    ends = [
        {'at': f'{a} deg', 'velocity': 0, 'acceleration': f'{s} mm/rad^2'}
        for a, s in ((0, 5), (180, -5))
    ]
    part = polynomial(0, 180, 10, *ends, *inner)
    law = made(scene({'segments': [part, *segments((180, 360, -10, 'harmonic'))['segments']]}))
    x = np.radians(np.linspace(0.0, 180.0, 301))
    assert cam_pair(law).cam.law(x) == pytest.approx(0.005 * (1.0 - np.cos(x)), abs=1e-12)


def test_a_cam_of_dwells_only_holds_its_follower():
    found = cycle(scene({'segments': [{'from': '0 deg', 'to': '100 deg'}]}))
    swing = found.swings()['follower']
    assert (swing.size, swing.strokes, swing.standing) == (0.0, (), pytest.approx(0.1))


# Measured lifts


def told(sentence):
    """Least and greatest acceleration in a sentence, each with how far it may be off."""
    pairs = re.findall(r'(-?[0-9.]+) \(\+-([0-9.]+)\)', sentence)
    return [float(x) for pair in pairs for x in pair]


@pytest.mark.slow
def test_points_that_do_not_determine_accelerations_are_warned_of():
    """A degree apart, and rounded to 1 nm: 403.5 and -418.8 where 354.49 and -314.67 are right."""
    report_ = check(made(table()))
    (warning,) = report_.questions
    low, off, high, over = told(warning)
    assert (low, high) == pytest.approx((-418.77, 403.53), abs=0.01)
    assert low <= -314.67 <= low + off
    assert high - over <= 354.49 <= high
    assert 'do not determine' in warning
    stated = run('cycle', str(INPUTS / 'tangent_cam.yaml'))
    assert warning in stated.stderr
    assert 'time ratio 1; stands within' in stated.stdout


@pytest.mark.parametrize(
    ('degree', 'step'), [(5, 5), pytest.param(3, 2, marks=pytest.mark.slow), (7, 5)]
)
def test_points_of_a_smooth_law_determine_its_accelerations(degree, step):
    """4-5-6-7: 7.5132 h (speed/angle)^2, which lies in the range that is told."""
    u = [35, -84, 70, -20]
    rise = np.polynomial.Polynomial([0, 0, 0, 0, *u])

    def lift(a):
        return 10.0 * float(rise(min(a / 90.0, 1.0)) - rise(min(max(a - 180.0, 0.0) / 90.0, 1.0)))

    points = [[f'{a} deg', f'{lift(a):.6f} mm'] for a in range(0, 360, step)]
    found = check(made(scene({'points': points, 'degree': degree})))
    assert found.questions == []
    (note,) = (x for x in found.notes if 'by its points' in x)
    low, off, high, over = told(note)
    t = np.linspace(0.0, 1.0, 4001)
    right = 0.010 * rise.deriv(2)(t).max() * (SPEED / (math.pi / 2.0)) ** 2
    assert abs(low + right) <= off < 0.1 * right
    assert abs(high - right) <= over < 0.1 * right


@pytest.mark.slow
@pytest.mark.parametrize('seed', one_of(3, range(3)))
def test_an_error_of_measurement_is_smoothed_away(seed):
    """5 um of noise: a profile through the points would be undercut."""
    random, content = np.random.default_rng(seed), table()
    law = content['joints']['contact']['law']
    law['points'] = [
        [a, f'{float(y.split()[0]) + random.normal(0.0, 5e-3):.6f} mm'] for a, y in law['points']
    ]
    law['degree'] = 5
    with pytest.raises(InputError, match='undercut'):
        made(content)
    law['error'] = '5 um'
    machine = made(content)
    cam = cam_pair(machine).cam.law
    x, y = (np.array(z) for z in zip(*law['points'], strict=True))
    x = np.radians([float(a.split()[0]) for a in x])
    y = np.array([1e-3 * float(b.split()[0]) for b in y])
    assert np.sqrt(np.mean((cam(x) - y) ** 2)) == pytest.approx(5e-6, rel=1e-6)
    (low, high), square = cam.peaks, SPEED**2
    assert abs(square * low.value + 314.67) < 3.0 * square * low.off < 150.0
    assert abs(square * high.value - 354.49) < 3.0 * square * high.off < 150.0


# Laws from files


def written(folder, law, **keys):
    """A scene in a file."""
    content = {'title': 'Cam', 'mechanism': 'linkage', **scene(law, **keys)}
    path = folder / 'cam.yaml'
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path


@pytest.mark.sample(1)
@pytest.mark.parametrize('heading', [True, False])
def test_a_table_in_a_file_makes_the_motion_of_one_in_the_scene(tmp_path, heading):
    """The committed table goes from 0 to 360 deg and has no heading."""
    text = (INPUTS / 'tangent_cam_lift.csv').read_text()
    law = {'file': 'lift.csv', 'degree': 3, 'units': ['deg', 'mm']}
    if heading:
        text = f'cam [deg],other,lift [mm]\n{text}'.replace('0000,', '0000,7,')
        law = {'file': 'lift.csv', 'degree': 3, 'columns': ['cam', 'lift']}
    (tmp_path / 'lift.csv').write_text(text)
    given = ms.simulate(ms.load_scene(written(tmp_path, law)), duration=0.01)
    assert given.digest() == ms.simulate(made(table()), duration=0.01).digest()


def drawing(path, layers=('0',), units=4):
    """The tangent cam in a DXF [mm], as lines and arcs, or a circle of 1 mm on other layers."""
    ezdxf = pytest.importorskip('ezdxf')
    document = ezdxf.new()
    document.units = units
    space = document.modelspace()
    for edge in edges(math.radians(20.0)):
        if 'line' in edge:
            space.add_line(*(1e3 * np.array(edge['line'])))
        else:
            ends = (math.degrees(edge[k]) for k in ('from', 'to'))
            space.add_arc(1e3 * np.array(edge['arc']), 1e3 * edge['radius'], *ends)
    for layer in layers[1:]:
        space.add_circle((0, 0), 1.0, {'layer': layer})
    document.saveas(path)


@pytest.mark.slow
def test_a_drawing_makes_the_cam_that_it_shows(tmp_path):
    """As LINE and ARC; the vertices of polylines are tried where drawings are imported."""
    drawing(tmp_path / 'cam.dxf', ('0', 'bore'))
    law = {'profile': {'file': 'cam.dxf', 'layer': '0'}}
    machine = ms.load_scene(written(tmp_path, law, base_radius=None))
    ends = ms.cycle(machine, samples=36).extremes()['acceleration.follower']
    right = accelerations(scene(TANGENT))
    assert (ends.least.value, ends.greatest.value) == pytest.approx(right, rel=1e-9)


@pytest.mark.sample(7)
@pytest.mark.parametrize(('law', 'said'), [
    ({'file': 'lift.csv'}, 'a unit are radians: beside a file write units: [deg, mm]'),
    ({'file': 'lift.csv', 'units': 'deg'}, 'units must be a list of two names'),
    ({'file': 'lift.csv', 'columns': ['1', 'lift']}, "no column 'lift'"),
    ({'file': 'lost.csv'}, "'lost.csv' cannot be read"),
    ({'profile': {'file': 'cam.dxf'}}, "does not state its unit: add 'units: mm'"),
    ({'profile': {'file': 'cam.dxf', 'units': 'mm'}}, "name one as 'layer': 0, bore"),
    ({'profile': {'file': 'cam.dxf', 'units': 'mm', 'layer': 'bohr'}}, "did you mean 'bore'"),
    ({'profile': {'file': 'lift.dxf'}}, 'cannot be read as DXF'),
])  # fmt: skip
def test_mistakes_in_files_are_answered_by_one_sentence(tmp_path, law, said):
    text = (INPUTS / 'tangent_cam_lift.csv').read_text()
    for name in ('lift.csv', 'lift.dxf'):
        (tmp_path / name).write_text(text)
    drawing(tmp_path / 'cam.dxf', ('0', 'bore'), units=0)
    done = run('check', str(written(tmp_path, law)))
    assert done.returncode == 2
    assert said in done.stderr
    assert 'contact' in done.stderr
    assert done.stderr.count('\n') == 1


# Nodes and bags


@pytest.mark.slow
@pytest.mark.network
def test_nodes_and_bags_have_the_motion_of_a_long_table(tmp_path):
    """Of an ideal cam, whose rows are found together, and of one that the follower may leave."""
    for name, keys in (('ideal', {}), ('loose', {'lift_off': {'restitution': 0.3}})):
        content = {'title': name, 'gravity': [0.0, -200.0], **table()}
        content['joints']['contact'].update(keys)
        file, bag = tmp_path / f'{name}.yaml', tmp_path / f'{name}.mcap'
        file.write_text(yaml.safe_dump(content, sort_keys=False))
        alone = ms.simulate(ms.load_scene(file), duration=0.25)
        done = run('run', str(file), '--duration', '0.25', '--record', str(bag))
        assert done.returncode == 0, done.stderr
        assert analyze(bag).digest == alone.digest()
        again, t = ms.open_run(bag), np.linspace(0.0, 0.25, 26)
        wanted = ['position.follower', 'contact_force.contact']
        columns, right = again.columns(wanted, t), ms.open_run(alone).columns(wanted, t)
        assert all((columns[n] == right[n]).all() for n in wanted)


# What long tables cost


def test_360_points_take_no_more_pieces_of_work_than_36(monkeypatch):
    """Pieces of the motion are as many as rows; the closures are solved for many at a time."""
    count, solve = [0], Kinematics.positions

    def positions(self, *args, **how):
        count[0] += 1
        return solve(self, *args, **how)

    machines = [made(every(table(), n)) for n in (36, 360)]
    monkeypatch.setattr(Kinematics, 'positions', positions)
    calls = []
    for machine in machines:
        ms.simulate(machine, duration=0.1)
        calls.append(count[0])
        count[0] = 0
    assert calls[1] < calls[0]


@pytest.mark.sample(1)
@pytest.mark.parametrize('drive', [
    {'coordinate': 'cam', 'speed': '600 rpm'},
    {'coordinate': 'cam',
     'profile': {'points': [[0.0, 0.0], [0.1, 60.0], [0.2, -60.0], [0.3, 5.0]]}},
])  # fmt: skip
@pytest.mark.parametrize('keys', [{}, {'sense': 'clockwise', 'phase': '20 deg'}])
def test_rows_found_together_are_those_found_one_by_one(monkeypatch, drive, keys):
    content = table()
    content['drive'] = drive
    content['joints']['contact'].update(keys)
    machine, t = made(content), np.linspace(0.0, 0.3, 3001)
    whole = ms.simulate(machine, duration=0.3)
    part = ms.simulate(machine, duration=0.11).motion.curve
    same = len(part.start) - 1
    assert (whole.motion.curve.coefficients[:same] == part.coefficients[:same]).all()
    assert (whole.motion.curve.duration[:same] == part.duration[:same]).all()
    monkeypatch.setattr(NominalRun, '_add_rows', lambda *_: False)
    single = ms.simulate(made(content), duration=0.3)
    for order, size in ((0, 1e-14), (1, 1e-11), (2, 1e-7)):
        a, b = (x.motion.curve(t, order) for x in (whole, single))
        assert np.abs(a - b).max() <= size * max(np.abs(a).max(), 1.0)


def test_a_long_table_has_the_same_digits_ten_thousand_turns_on():
    """The drive starts so many turns on; whole turns are counted apart."""
    found = []
    for turns in (0, 10_000):
        content = every(table(), 120)
        content['drive']['start_angle'] = f'{360 * turns} deg'
        found.append(ms.simulate(made(content), duration=0.1).motion.curve)
    t = np.linspace(0.0, 0.1, 400)
    first, last = (curve(t)[:, 1] for curve in found)
    assert np.abs(first - last).max() < 1e-13  # 62,832 rad, as they are read, round to 7e-12


@pytest.mark.slow
def test_a_long_table_has_the_same_digits_after_a_minute():
    """600 turns: the lifts are those of the first, but for the rounding of the angle."""
    machine = made(every(table(), 72))
    first = ms.simulate(machine, duration=0.1).motion.curve
    pieces = list(ms.stream(machine, duration=60.0))
    last = [p.motion.curve for p in pieces if float(p.motion.curve.end) > 59.9]
    assert last
    for curve in last:  # wherever pieces begin
        t = np.linspace(max(59.9, float(curve.start[0])), float(curve.end), 100)
        again = np.minimum(t - 59.9, 0.1)  # of its turn
        assert np.abs(first(again)[:, 1] - curve(t)[:, 1]).max() < 1e-13


HOLLOW = {'arcs': {'nose': '10 mm', 'lift': '15 mm', 'flank': '-30 mm'}}
TWO = [['0 deg', '0 mm'], ['90 deg', '5 mm']]


def one(**condition):
    return {'segments': [polynomial(0, 90, 10, condition)]}


WRONG = [
    ({'tangent': {'nose': '60 mm', 'lift': '15 mm'}}, {}, 'a nose radius of 60 mm does not fit'),
    ({'arcs': {'nose': '10 mm', 'lift': '15 mm', 'flank': '26 mm'}}, {}, 'do not touch both'),
    ({'tangent': {'nose': '10 mm'}}, {}, "'joints.contact.law.tangent.lift' is missing"),
    ({**TANGENT, 'eccentric': '5 mm'}, {}, "exactly one of 'segments', 'points'"),
    (TANGENT, {'base_radius': None}, "'base_radius' is missing"),
    (HOLLOW, {'roller': '40 mm'}, 'too concave'),
    ({'profile': {'edges': edges(0.0)[:3]}}, {'base_radius': None}, 'meets no other'),
    ({'profile': {'edges': [{'line': [[0, 0], [1, 1]], 'arc': [0, 0]}]}}, {}, "either 'line'"),
    ({'profile': {'edges': edges(0.0)}}, {'base_radius': '24 mm'}, 'base_radius = 0.024 m is not'),
    ({'segments': [polynomial(0, 90, 10)]}, {}, "needs 'conditions'"),
    (one(at='100 deg', velocity=0), {}, 'lies beyond its segment'),
    (one(at='90 deg', lift='9 mm'), {}, 'contradicts the 0.01'),
    (one(at='0 deg', velocity='5 kg'), {}, 'velocity'),
    ({'points': TWO, 'error': '-1 um', 'degree': 1}, {}, 'law.error'),
]  # fmt: skip


@pytest.mark.parametrize(('law', 'keys', 'said'), WRONG)
def test_mistakes_are_answered_by_one_sentence(law, keys, said):
    with pytest.raises(InputError) as error:
        made(scene(law, **keys))
    text = str(error.value)
    assert said in text
    assert 'contact' in text
    assert '\n' not in text
