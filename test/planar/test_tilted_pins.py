"""Bearings whose pin and bushing are out of line, and links that lean: against closed forms."""

import math

import numpy as np
import pytest
from builders import made, without_work
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from running import run as command
from running import run_json
from scipy.linalg import expm
from scipy.optimize import brentq

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.errors import InputError
from mechanism_sim.joints.revolute.bearing_ends import seat
from mechanism_sim.messages import JointReactions, deserialize
from mechanism_sim.nodes.publications import reactions, wrenches
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
from mechanism_sim.scene.check import check

G, MASS, C, B = 9.81, 0.8, 0.2e-3, 30e-3
"""Gravity [m/s^2]; of a bob its mass [kg]; of its bearing clearance and length [m]."""

LEAN = {'inertia': [2e-4, 3e-4]}  #: [kg m^2] about x and y


def bob(clearance, tilt=None, start='seated', cog=0.0, **parts):
    """A link that hangs on a pin of its own in a bushing of the ground."""
    link = {'mass': MASS, 'inertia': 4e-4, 'cog': cog, **({'tilt': tilt} if tilt else {})}
    whole = {
        'title': 'bob', 'gravity': [0.0, -G], 'start': start,
        'links': {'bob': link},
        'joints': {'pin': {'revolute': ['bob', 'ground'], 'clearance': {
            'radial': C, 'restitution': 0.0, 'length': B, **clearance}}},
        'drive': {'coordinate': 'bob', 'torque': {}}, **parts,
    }  # fmt: skip
    return made(whole, 'bob')


def four_bar(path='coupler_rocker', tilt=None, **clearance):
    """The thesis mechanism with more keys of its clearance, and a coupler that leans."""
    given = {f'joints.{path}.clearance.{k.replace("__", ".")}': x for k, x in clearance.items()}
    given |= {f'links.coupler.tilt.{k}': x for k, x in (tilt or {}).items()}
    return ms.load_scene('four_bar_clearance', overrides=given)


def at(solution, t, *names):
    columns = without_work(solution, np.array([t]))
    return [float(columns[name][0]) for name in names]


def residual(solution):
    e = solution.energy
    return e.final - e.initial - e.drive_work + e.dissipated


# --- what stands still -----------------------------------------------------------------------


@pytest.mark.parametrize('seed', range(4))
def test_a_seat_is_the_farthest_point_that_both_ends_allow(seed):
    rng = np.random.default_rng(seed)
    off = rng.normal(size=2)
    off *= C * rng.uniform(0.05, 0.95) / np.hypot(*off)
    turns = np.linspace(0.0, 2.0 * np.pi, 20001)
    edge = C * np.array([np.cos(turns), np.sin(turns)])
    lens = np.concatenate([edge - off[:, None], edge + off[:, None]], axis=1)
    inside = np.maximum(*(np.hypot(*(lens + s * off[:, None])) for s in (1, -1))) < C + 1e-12
    for angle in rng.uniform(0.0, 2.0 * np.pi, 20):
        load = np.array([math.cos(angle), math.sin(angle)])
        found = seat(C, load, off)
        assert max(np.hypot(*(found + off)), np.hypot(*(found - off))) < C * (1.0 + 1e-12)
        short = load @ found - (load @ lens[:, inside]).max()  # of points so far apart
        assert -1e-12 < short < 2.0 * np.pi * C / len(turns)


@pytest.mark.parametrize('direction', [0.0, 180.0])
def test_a_pin_inclined_across_its_load_rests_on_both_ends(direction):
    """Both normals are at the angle asin(d/c) to the load."""
    angle = 5e-3
    leans = {'angle': angle, 'direction': math.radians(direction)}
    run = ms.simulate(bob({'misalignment': {'bushing': leans}}), duration=0.01)
    d = 0.5 * B * angle
    each = 0.5 * MASS * G * C / math.sqrt(C**2 - d**2)
    names = ('normal_force.pin_front', 'normal_force.pin_rear', 'bearing_moment.pin.y')
    front, rear, moment = at(run, 0.005, *names)
    assert (front, rear) == pytest.approx((each, each), rel=1e-10)
    # the pin, on the bushing with the force its weight: at the front it is pressed to the left
    towards = -1.0 if direction == 0.0 else 1.0
    assert moment == pytest.approx(towards * B * each * d / C, rel=1e-9)
    assert at(run, 0.005, 'bearing_moment.pin.size')[0] == pytest.approx(abs(moment))


@pytest.mark.parametrize(('direction', 'end'), [(90.0, 'rear'), (-90.0, 'front')])
def test_a_pin_inclined_along_its_load_rests_on_one_edge(direction, end):
    """The pin leans upwards towards the reader: its other end is the lower one."""
    leans = {'angle': 5e-3, 'direction': math.radians(direction)}
    run = ms.simulate(bob({'misalignment': {'pin': leans}}), duration=0.01)
    other = {'front': 'rear', 'rear': 'front'}[end]
    loaded, free = at(run, 0.005, f'normal_force.pin_{end}', f'gap.pin_{other}')
    assert loaded == pytest.approx(MASS * G, rel=1e-10)
    assert free == pytest.approx(5e-3 * B, rel=1e-9)
    sign = 1.0 if end == 'front' else -1.0  # M = r x F with F downwards
    assert at(run, 0.005, 'bearing_moment.pin.x')[0] == pytest.approx(0.5 * sign * B * MASS * G)


@pytest.mark.parametrize('along', [0.0, 4e-3, -11e-3])
def test_ends_share_a_load_beside_the_bearing_by_the_lever_rule(along):
    """The weight acts in the plane of the link, the middle of the bearing is beside it."""
    run = ms.simulate(
        bob({'along': along}, tilt={'stiffness': 0.0, **LEAN}, cog=[0.0, -0.02]), duration=1e-3
    )
    front, rear, size = at(
        run, 5e-4, 'normal_force.pin_front', 'normal_force.pin_rear', 'bearing_moment.pin.size'
    )
    weight = MASS * G
    shares = (weight * (0.5 - along / B), weight * (0.5 + along / B))
    assert (front, rear) == pytest.approx(shares, rel=1e-9)
    assert size == pytest.approx(weight * abs(along), rel=1e-9, abs=1e-12)


def test_a_bearing_beside_its_load_tilts_until_the_stiffness_carries_the_rest():
    """Beyond half its length one end alone carries: k s = weight (along - B/2), to first order."""
    along, k = 25e-3, 40.0
    run = ms.simulate(
        bob({'along': along}, tilt={'stiffness': k, 'damping': 0.9, **LEAN}, cog=[0.0, -0.02],
            solver={'rtol': 1e-9}),
        duration=0.2,
    )  # fmt: skip
    rear, front, lean = at(
        run, 0.2, 'normal_force.pin_rear', 'normal_force.pin_front', 'position.bob.tilt_y'
    )
    # the lower end above the plane carries; weight and bearing turn the link with s_y
    # its foreshortening pulls back with weight times the way to the centre of gravity
    assert front == 0.0
    assert rear == pytest.approx(MASS * G, rel=1e-6)
    expected = MASS * G * (along - 0.5 * B) / (k + 0.02 * MASS * G)
    assert lean == pytest.approx(expected, rel=1e-5)


# --- impacts at one end ----------------------------------------------------------------------


@pytest.mark.parametrize('spin', [0.4, -0.7])
def test_an_impact_at_one_end_keeps_the_books(spin):
    """A bob falls while it leans at a constant rate: time, impulse and rates in closed form."""
    e = 0.6
    machine = bob(
        {'restitution': e}, tilt={'stiffness': 0.0, **LEAN}, start='centred',
        initial={'velocity': {'bob.tilt_y': spin}},
    )  # fmt: skip
    run = ms.simulate(machine, duration=0.01)
    hit = run.impacts[0]
    half, inertia = 0.5 * B, LEAN['inertia'][0]  # leaning along y is turning about x
    rate = half * abs(spin)
    t = (math.sqrt(rate**2 + 2.0 * G * C) - rate) / G
    approach = G * t + rate
    impulse = (1.0 + e) * approach / (1.0 / MASS + half**2 / inertia)
    assert hit.joint == ('pin_rear' if spin > 0.0 else 'pin_front')
    assert hit.t == pytest.approx(t, rel=1e-12)
    assert hit.approach_speed == pytest.approx(approach, rel=1e-12)
    assert hit.rebound_speed == pytest.approx(e * approach, rel=1e-11)
    assert hit.normal_impulse == pytest.approx(impulse, rel=1e-11)
    loss = 0.5 * (1.0 - e) * approach * impulse
    assert hit.energy_loss == pytest.approx(loss, rel=1e-11)
    fall, lean = at(run, hit.t, 'velocity.bob.y', 'velocity.bob.tilt_y')
    assert fall == pytest.approx(impulse / MASS - G * t, rel=1e-9)
    turned = spin - math.copysign(half * impulse / inertia, spin)
    assert lean == pytest.approx(turned, rel=1e-9)
    assert abs(residual(run)) < 1e-14


# --- stops along the axis --------------------------------------------------------------------

WIDE, RADIUS, CROWN = 1e-3, 8e-3, 1e-7
"""Of stops: axial play, and of their faces radius and crown [m]."""


def falling(axial=(), tilt=None, clearance=(), **parts):
    """A bob on a pin that stands upright, seen from above: it falls away from the reader."""
    stops = {'play': WIDE, **dict(axial)}
    parts = {'start': 'centred', 'gravity': [0.0, 0.0], 'axial_gravity': -G, **parts}
    return bob(
        {'axial': stops, **dict(clearance)},
        tilt={'stiffness': 0.0, **LEAN, **(tilt or {})},
        **parts,
    )


def test_a_link_falls_between_stops_and_bounces_as_a_ball_does():
    e = 0.6
    run = ms.simulate(falling({'restitution': e}), duration=0.12)
    t = math.sqrt(2.0 * WIDE / G)
    v = G * t
    for hit in run.impacts[:6]:
        assert (hit.joint, hit.normal_angle) == ('pin_stop_rear', 0.0)
        assert (hit.t, hit.approach_speed) == pytest.approx((t, v), rel=1e-10)
        assert hit.normal_impulse == pytest.approx((1.0 + e) * v * MASS, rel=1e-10)
        v *= e
        t += 2.0 * v / G
    way, force, moment, potential = at(
        run, 0.12, 'position.bob.axial', 'axial_force.pin', 'bearing_moment.pin.size',
        'energy.potential',
    )  # fmt: skip
    assert (way, force, moment) == (-WIDE, pytest.approx(-MASS * G, rel=1e-12), 0.0)
    assert potential == pytest.approx(-MASS * G * WIDE, rel=1e-12)
    assert run.energy.dissipated == pytest.approx(MASS * G * WIDE, rel=1e-12)


@pytest.mark.parametrize(('along', 'lean'), [('x', 5e-3), ('y', -4e-3)])
@pytest.mark.parametrize('up', [1.0, -1.0])
def test_an_impact_at_the_rim_of_a_face_keeps_the_books(along, lean, up):
    """A face out of line meets the stop with its rim: time, impulse and rates in closed form."""
    e = 0.5
    run = ms.simulate(
        falling(
            {'restitution': e, 'face_radius': RADIUS, 'crown': CROWN},
            axial_gravity=up * G, initial={'position': {f'bob.tilt_{along}': lean}},
        ),
        duration=0.02,
    )  # fmt: skip
    hit = run.impacts[0]
    bulge = math.hypot(CROWN, RADIUS * lean)
    arm = RADIUS**2 * abs(lean) / bulge
    assert arm == pytest.approx(RADIUS, rel=1e-5)
    fall = WIDE - (bulge - CROWN)
    inertia = LEAN['inertia']['yx'.index(along)]  # leaning along x is turning about y
    speed = math.sqrt(2.0 * G * fall)
    impulse = (1.0 + e) * speed / (1.0 / MASS + arm**2 / inertia)
    assert hit.joint == ('pin_stop_front' if up > 0.0 else 'pin_stop_rear')
    assert hit.t == pytest.approx(math.sqrt(2.0 * fall / G), rel=1e-10)
    assert hit.normal_impulse == pytest.approx(impulse, rel=1e-10)
    assert hit.energy_loss == pytest.approx(0.5 * (1.0 - e) * speed * impulse, rel=1e-10)
    way, turn = at(run, hit.t, 'velocity.bob.axial', f'velocity.bob.tilt_{along}')
    assert way == pytest.approx(up * (speed - impulse / MASS), rel=1e-9)
    assert turn == pytest.approx(-math.copysign(arm * impulse / inertia, lean), rel=1e-9)
    assert abs(residual(run)) < 1e-15


@pytest.mark.sample(1)
@pytest.mark.parametrize('law', [None, 'hunt_crossley'])
def test_a_collar_under_a_load_beside_its_axis_leans_until_moments_balance(law):
    """Of weight, face and stiffness: k s = weight (off - arm(s)); the depth is that of the law."""
    off, k = 5e-3, 50.0
    contact = {'contact': {'law': law, 'stiffness': 1e9}} if law else {}
    machine = falling(
        {'play': 1e-4, 'restitution': 0.1 if law else 0.0, 'face_radius': RADIUS, 'crown': 1e-6},
        {'stiffness': k, 'damping': 0.9}, cog=[off, 0.0], clearance=contact,
    )  # fmt: skip
    run = ms.simulate(machine, duration=0.15)
    weight = MASS * G

    def unbalanced(s):
        return k * s - weight * (off - RADIUS**2 * s / math.hypot(1e-6, RADIUS * s))

    lean = brentq(unbalanced, 1e-9, 1e-2, xtol=1e-18)
    found, force, x, y, way = at(
        run, 0.15, 'position.bob.tilt_x', 'axial_force.pin', 'bearing_moment.pin.x',
        'bearing_moment.pin.y', 'position.bob.axial',
    )  # fmt: skip
    assert found == pytest.approx(lean, rel=1e-5)
    assert force == pytest.approx(-weight, rel=1e-5)
    assert (x, y) == (0.0, pytest.approx(weight * off - k * lean, rel=1e-5))
    # the pin is the origin: it is higher by lean times the way from the centre of gravity
    depth = (weight / 1e9) ** (2.0 / 3.0) if law else 0.0
    bulge = math.hypot(1e-6, RADIUS * lean) - 1e-6
    assert way + off * lean == pytest.approx(bulge - 1e-4 - depth, rel=1e-5)
    assert abs(residual(run)) < (1e-11 if law else 1e-15)


@pytest.mark.slow
def test_stops_that_are_never_met_change_nothing_in_the_plane():
    tilt = {'stiffness': 100.0, 'thickness': '10 mm'}
    given = {'length': '20 mm', 'misalignment__pin__angle': '5 mrad'}
    one, other = (
        ms.simulate(four_bar(tilt=tilt, **given, **more), revolutions=0.3)
        for more in ({}, {'axial__play': '1 m'})
    )
    t = np.linspace(0.0, 0.05, 30)
    for name in ('position.rocker', 'position.coupler.tilt_y'):
        assert np.abs(one.sample(t, name)[name] - other.sample(t, name)[name]).max() < 1e-13


@pytest.mark.slow
def test_a_coupler_with_axial_play_rattles_between_stops():
    """It leans by its misaligned pin, and its end comes to both stops: energy stays in balance."""
    tilt = {'stiffness': 100.0, 'thickness': '10 mm', 'axial_stiffness': '2 kN/m'}
    run = ms.simulate(
        four_bar(
            tilt=tilt, length='20 mm', misalignment__pin__angle='5 mrad', axial__play='0.06 mm',
            axial__face_radius='8 mm', axial__crown='1 um', axial__restitution=0.4,
        ),
        revolutions=0.5,
    )  # fmt: skip
    assert {i.joint for i in run.impacts} >= {
        f'coupler_rocker_stop_{x}' for x in ('front', 'rear')
    }
    assert abs(run.energy.residual) < 1e-11


# --- links that lean -------------------------------------------------------------------------


@pytest.mark.parametrize('gravity', [0.0, 30.0])
def test_a_link_that_turns_and_leans_obeys_eulers_equations(gravity):
    """Of a body in a turning frame, linear in s; its centre of gravity on a circle of radius a."""
    w, a, k, about = 60.0, 0.04, 35.0, (6e-4, 9e-4)
    normal, mass = 1.2e-3, 0.5
    parts = {
        'title': 's', 'gravity': [0.0, 0.0],
        'links': {'arm': {'mass': mass, 'inertia': normal, 'cog': a,
                          'tilt': {'stiffness': k, 'inertia': list(about)}}},
        'joints': {'hub': {'revolute': ['ground', 'arm']}},
        'drive': {'coordinate': 'arm', 'speed': w},
        'initial': {'position': {'arm.tilt_x': 1e-4}, 'velocity': {'arm.tilt_y': 3e-3}},
    }  # fmt: skip
    if gravity:  # as a weight in the turning frame would: not there, so only its sign is told
        parts['links']['arm']['cog'] = -a
    run = ms.simulate(made(parts, 's'), duration=0.1)
    (x, y), gyro = about, sum(about) - normal
    stiff_x = k + (normal - x) * w**2 + mass * a**2 * w**2  # of s_x, a rotation about y
    stiff_y = k + (normal - y) * w**2
    A = np.zeros((4, 4))
    A[:2, 2:] = np.eye(2)
    A[2] = [-stiff_x / y, 0.0, 0.0, gyro * w / y]
    A[3] = [0.0, -stiff_y / x, -gyro * w / x, 0.0]
    start = np.array([1e-4, 0.0, 0.0, 3e-3])
    names = [f'{kind}.arm.tilt_{c}' for kind in ('position', 'velocity') for c in 'xy']
    for t in (0.03, 0.1):
        wanted = expm(A * t) @ start
        scale = np.array([1e-4, 1e-4, 1e-2, 1e-2])
        assert np.abs((at(run, t, *names) - wanted) / scale).max() < 1e-6
    assert abs(residual(run)) < 1e-13


def test_no_misalignment_is_the_planar_machine_to_the_bit():
    plain = ms.simulate(four_bar(), revolutions=2)
    aligned = ms.simulate(
        four_bar(length='20 mm', misalignment__pin__angle='0 rad'), revolutions=2
    )
    assert [i.t for i in plain.impacts] == [i.t for i in aligned.impacts]
    q = [
        x.sample(np.linspace(0.0, 0.3, 50), 'position.rocker')['position.rocker']
        for x in (plain, aligned)
    ]
    np.testing.assert_array_equal(*q)


@pytest.mark.slow
def test_a_link_that_could_lean_but_is_in_line_moves_as_the_planar_one():
    """Until impacts have magnified rounding; the ends share every impulse."""
    plain = ms.simulate(four_bar(), revolutions=1.05)
    leans = ms.simulate(
        four_bar(tilt={'stiffness': 500.0, 'thickness': '12 mm'}, length='20 mm'), revolutions=1.05
    )
    for one, front, rear in zip(plain.impacts[:4], *[iter(leans.impacts[:8])] * 2, strict=True):
        assert (front.t, rear.t) == pytest.approx((one.t, one.t), abs=2e-8)
        assert front.normal_impulse + rear.normal_impulse == pytest.approx(
            one.normal_impulse, rel=1e-4
        )
    q = [
        x.sample(np.linspace(0.0, 0.17, 20), 'position.rocker')['position.rocker']
        for x in (plain, leans)
    ]
    assert np.abs(q[0] - q[1]).max() < 1e-12


@pytest.mark.slow
def test_stiffer_links_come_nearer_to_those_that_stay_in_their_plane():
    """As one over the stiffness."""
    misaligned = {'length': '20 mm', 'misalignment__pin__angle': '8 mrad', 'restitution': 0.0}
    rigid = ms.simulate(four_bar(**misaligned), duration=0.02)
    t = np.linspace(0.015, 0.02, 100)
    wanted = rigid.sample(t, 'position.rocker')['position.rocker']
    off = []
    for k in (1e3, 4e3, 16e3):
        tilt = {'stiffness': k, 'thickness': '12 mm', 'damping': 0.5}
        found = ms.simulate(four_bar(tilt=tilt, **misaligned), duration=0.02)
        off.append(
            float(np.abs(found.sample(t, 'position.rocker')['position.rocker'] - wanted).max())
        )
    assert off[1] / off[0] == pytest.approx(0.25, abs=0.05)
    assert off[2] / off[1] == pytest.approx(0.25, abs=0.05)


@pytest.mark.slow
def test_ends_change_places_when_the_misalignment_is_turned_over():
    length = {'length': '20 mm', 'misalignment__pin__angle': '5 mrad'}
    one, other = (
        ms.simulate(four_bar(**length, misalignment__pin__direction=angle), revolutions=1)
        for angle in ('30 deg', '210 deg')
    )
    swapped = {'coupler_rocker_front': 'coupler_rocker_rear'}
    swapped |= {b: a for a, b in swapped.items()}
    assert len(one.impacts) > 5
    for a, b in zip(one.impacts[:6], other.impacts[:6], strict=True):
        assert (swapped[a.joint], a.t) == (b.joint, pytest.approx(b.t, rel=1e-9))


@pytest.mark.slow
def test_the_stiffness_of_a_compliant_bearing_is_that_of_both_ends():
    """In line both are pressed alike: the sum is the planar law."""
    law = {'contact__law': 'hunt_crossley', 'contact__stiffness': 1e9}
    plain = ms.simulate(four_bar(**law), duration=0.02)
    tilt = {'stiffness': 500.0, 'thickness': '12 mm'}
    ends = ms.simulate(four_bar(tilt=tilt, length='20 mm', **law), duration=0.02)
    (whole,) = at(plain, 0.02, 'normal_force.coupler_rocker')
    halves = at(ends, 0.02, *(f'normal_force.coupler_rocker_{end}' for end in ('front', 'rear')))
    assert halves == pytest.approx([0.5 * whole] * 2, rel=1e-6)


# --- what is said and refused ----------------------------------------------------------------


def test_check_tells_how_much_room_is_left_and_how_fast_links_lean():
    given = {'length': B, 'misalignment': {'pin': {'angle': 4e-3}}}
    notes = ' '.join(check(bob(given, tilt={'stiffness': 50.0, **LEAN})).notes)
    assert 'pin inclined by 0.004 rad, room for 0.01333 rad' in notes
    assert f'tilt_y {math.sqrt(50.0 / LEAN["inertia"][0]) / (2.0 * math.pi):.6g} Hz' in notes
    assert 'its length has no effect' in ' '.join(check(bob({})).notes)


@pytest.mark.parametrize(
    ('keys', 'said'),
    [
        ({'misalignment': {'pin': {'angle': 2.0 * C / B}}}, 'a pin has room up to 0.01333 rad'),
        ({'misalignment': {'pin': {'angle': 8e-3}, 'bushing': {'angle': 6e-3}}}, 'by 0.014 rad'),
        ({'misalignment': {'pin': {'angle': 1e-3}}, 'length': None}, "needs 'length'"),
        ({'along': 1e-3, 'length': None}, "needs 'length'"),
        ({'height': 1e-3}, 'height'),
        ({'axial': {'play': 1e-3}}, "none of its links can move along the axis: give 'links.bob"),
        ({'axial': {'play': 1e-3, 'crown': 1e-6}}, "needs 'face_radius' and 'crown' together"),
        ({'axial': {'play': 0.0}}, 'play = 0.0 is out of bounds: it must be more than 0'),
    ],
)
def test_bearings_that_cannot_be_are_refused(keys, said):
    with pytest.raises(ValueError, match=said):
        bob(keys)


def test_the_largest_misalignment_that_has_room_runs():
    run = ms.simulate(
        bob({'misalignment': {'pin': {'angle': (2.0 - 1e-4) * C / B}}}), duration=0.01
    )
    assert abs(residual(run)) < 1e-12


def test_a_start_beyond_a_stop_is_refused():
    machine = falling(initial={'position': {'bob.axial': 1.1 * WIDE}})
    with pytest.raises(InputError, match='into each other at pin_stop_front: give more axial'):
        ms.simulate(machine, duration=1e-3)


@pytest.mark.parametrize(
    ('tilt', 'said'),
    [
        ({'inertia': [1e-5, 1e-5]}, 'no body has the moments of inertia'),
        ({'thickness': 0.5}, 'no body has the moments of inertia'),
        ({**LEAN, 'axial_stiffness': 1e3}, 'it does not move along the axes'),
    ],
)
def test_links_that_cannot_be_are_refused(tilt, said):
    with pytest.raises(InputError, match=said):
        _ = bob({}, tilt={'stiffness': 1.0, **tilt}).system


# --- messages --------------------------------------------------------------------------------


def test_a_foreign_reader_finds_the_moments_on_joint_reactions(tmp_path):
    """As columns of samples have them; in the frame of the bushing's link on wrenches."""
    machine = four_bar(length='20 mm', misalignment__pin__angle='5 mrad')
    t = np.array([0.01, 0.02, 0.03])
    solution = ms.simulate(machine, duration=0.04)
    columns, view = without_work(solution, t), solution.view(t)
    path = tmp_path / 'moments.mcap'
    joint, physics = 'coupler_rocker', machine.physics
    wrench = wrenches(machine, lambda name: name, [joint])[joint]
    published = ('/joint_reactions', reactions(machine, 'world')), ('/wrench', wrench)
    with BagWriter(path) as bag:
        bag.add_topic('/joint_reactions', 'mechanism_sim/msg/JointReactions', Qos())
        bag.add_topic('/wrench', 'geometry_msgs/msg/WrenchStamped', Qos())
        for topic, write in published:
            for data, time in zip(write(view), t, strict=True):
                bag.write(topic, data, int(1e9 * time))
    with path.open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        said: dict[str, list] = {'/joint_reactions': [], '/wrench': []}
        for _, channel, _, message in reader.iter_decoded_messages():
            said[channel.topic].append(message)
    k = physics.joints.index(joint)
    for j, message in enumerate(said['/joint_reactions']):
        moment = [columns[f'bearing_moment.{joint}.{axis}'][j] for axis in 'xy']
        assert [message.moment_x[k], message.moment_y[k]] == moment
        assert len(message.moment_x) == len(message.joints) == len(message.force_z)
        torque = said['/wrench'][j].wrench.torque
        turned = complex(torque.x, torque.y) * np.exp(1j * columns['position.rocker'][j])
        assert turned == pytest.approx(complex(*moment), rel=1e-12)
    assert np.hypot(*moment) > 0.01
    summary = analyze(path)
    largest = columns[f'bearing_moment.{joint}.size'].max()
    assert [(p.name, p.value) for p in summary.loads.moments] == [
        (f'{joint}.moment', pytest.approx(largest, rel=1e-15))
    ]


def test_bearings_in_line_add_nothing_to_messages():
    machine = four_bar()
    (data,) = reactions(machine, 'world')(ms.simulate(machine, duration=0.01).view(0.005))
    message = deserialize(data, JointReactions)
    assert [len(x) for x in (message.moment_x, message.moment_y, message.force_z)] == [0, 0, 0]


@pytest.mark.network
@pytest.mark.slow
def test_nodes_publish_bearing_moments_and_bags_give_them_back(tmp_path):
    bag = tmp_path / 'run.mcap'
    run_json('run', 'four_bar_misaligned', '--revolutions', '0.5', '--record', str(bag))
    summary = analyze(bag)
    solved = ms.simulate(ms.load_scene('four_bar_misaligned'), revolutions=0.5)
    assert summary.digest == solved.digest()
    (peak,) = summary.loads.moments
    name = 'bearing_moment.coupler_rocker.size'
    assert solved.sample(np.array([peak.time]), name)[name][0] == pytest.approx(
        peak.value, rel=1e-9
    )
    messages = [m for _, m, _ in read_bag(bag).messages('/joint_reactions')]
    k = list(messages[0].joints).index('coupler_rocker')
    for m in messages:
        assert np.hypot(m.moment_x[k], m.moment_y[k]) <= peak.value
    done = command('plot', str(bag), name, '-o', str(tmp_path / 'x.svg'))
    assert done.returncode == 0, done.stderr
