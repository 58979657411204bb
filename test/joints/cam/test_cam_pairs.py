"""Cams in machines: the drawn profile touches the follower, forces act there, tables of pieces."""

import math
import re

import numpy as np
import pytest
from absolute import differences
from builders import cam_pair, made, placed

import mechanism_sim as ms
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import InputError
from mechanism_sim.joints.cam import curves
from mechanism_sim.joints.cam.distance import displacement
from mechanism_sim.joints.cam.laws import Diagram, Eccentric, MeasuredLaw, Raised, Segment
from mechanism_sim.numerics.symbolic import dense
from mechanism_sim.planar.configuration import Constraints, poses
from mechanism_sim.planar.frames import Frames, Jet, Parameters
from mechanism_sim.planar.points import rotate
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.scene.check import check
from test.grid.cams import KINDS, UNFIT, cam

TURN = 2 * math.pi
SENSES = {'clockwise': -1, 'counterclockwise': 1}


def scene(kind, sense, seed=1):
    """A machine of one kind, everything else at random: the first from a seed on that fits."""
    while True:
        content = cam(np.random.default_rng(seed), kind=kind, sense=SENSES[sense])
        try:
            return made(content, kind)
        except InputError as error:
            if not any(text in str(error) for text in UNFIT):
                raise
        seed += 1


@pytest.mark.sample(2)
@pytest.mark.parametrize('sense', ['clockwise', 'counterclockwise'])
@pytest.mark.parametrize('kind', KINDS)
def test_the_drawn_profile_touches_the_follower(kind, sense):
    """The part of the profile around the contact, drawn finely, at angles all round."""
    machine = scene(kind, sense, seed=3 * list(KINDS).index(kind) + (sense == 'clockwise'))
    pair, names = cam_pair(machine), machine.plan.ideal.coordinates
    whole = pair.cam.at(np.linspace(0, TURN, 3601)).profile
    solution = ms.simulate(machine)
    t = np.linspace(0.0, solution.duration, 25)[:-1]
    for column in solution.view(t).observed.position.T:
        q = dict(zip(names, column.tolist(), strict=True))
        angle = pair.sense * machine.plan.ideal.angle('shaft', q) + pair.phase
        fine = pair.cam.at(angle + np.linspace(-1e-3, 1e-3, 401)).profile
        points = np.hstack([whole, fine])
        drawn = placed(machine, 'shaft', q, pair.profile(points))
        tip = placed(machine, 'follower', q, np.array([pair.on_second]).T)
        if kind in ('flat', 'tilted', 'swinging face'):
            normal = face_normal(machine, kind, q)
            face = normal @ tip[:, 0] + getattr(pair.cam.follower, 'face_offset', 0.0)
            gap = face - (normal @ drawn).max()
        else:
            gap = np.hypot(*(drawn - tip)).min() - pair.cam.follower.roller
        assert gap == pytest.approx(0.0, abs=2e-7 if kind == 'knife' else 1e-9)


def face_normal(machine, kind, q):
    """Out of the cam, from what the scene says of the face."""
    said = machine.scene.joints['contact']
    if kind != 'swinging face':
        axis = machine.scene.joints['guide'].axis + said.tilt
        return np.array([math.cos(axis), math.sin(axis)])
    points = machine.scene.links['follower'].points
    arm = np.subtract(points['tip'], points['pin'])
    x, y = rotate(tuple(arm), machine.plan.ideal.angle('follower', q))
    # an arm on the right of the line to its pivot turns its right side to the cam
    left = np.array([-y, x]) / math.hypot(x, y)
    return left if said.side == 'right' else -left


@pytest.mark.sample(1)
@pytest.mark.parametrize('sense', ['clockwise', 'counterclockwise'])
@pytest.mark.parametrize('kind', KINDS)
def test_forces_are_those_of_newton_and_euler_at_the_drawn_profile(kind, sense):
    machine = scene(kind, sense, seed=7)
    solution = ms.simulate(machine)
    t = np.linspace(0.03, 0.97, 17) * solution.duration
    assert differences(machine, solution, t)[0].max() < 1e-8


@pytest.mark.sample(3)
@pytest.mark.parametrize('kind', KINDS)
def test_row_of_the_poses_is_the_derivative_of_what_it_leaves(kind):
    machine = scene(kind, 'clockwise', seed=3)
    ideal = machine.plan.ideal
    q = dict(zip(ideal.coordinates, machine.assembly.q.tolist(), strict=True))
    at, h = poses(ideal, q), 1e-6
    constraints = Constraints.of(ideal)
    residual, J = constraints.linearise(at)
    assert np.abs(residual).max() < 1e-12
    for k, shift in enumerate(np.eye(at.size)):
        ahead, behind = (
            constraints.linearise(at + s * h * shift.reshape(at.shape))[0] for s in (1, -1)
        )
        assert (ahead - behind) / (2 * h) == pytest.approx(J[:, k], abs=1e-8)


# tables


def laws():
    x = np.arange(36) / 36 * TURN
    rises = [
        Segment(0.3, 1.5, 8e-3, curves.CYCLOIDAL),
        Segment(2.0, 3.0, -3e-3, curves.POLYNOMIAL_4567),
        Segment(3.0, 5.1, -5e-3, curves.MODIFIED_TRAPEZOID),
    ]
    return {
        'segments': Diagram(rises),
        'measured': MeasuredLaw(x, 4e-3 * (1 - np.cos(x)) + 1e-3 * np.sin(2 * x)),
        'eccentric': Eccentric(0.04, 0.01),
        'raised': Raised(0.01),
    }


@pytest.mark.parametrize('name', laws())
def test_expressions_of_a_law_are_the_law(name):
    law = laws()[name]
    frames = Frames(('cam',), Parameters())
    q = frames.q['cam']
    jets = displacement(law, 'law', Jet(q, {'cam': 1.0}, frames.v['cam'], None), frames, 2)
    terms = [[x for jet in jets for x in (jet.value, jet.gradient['cam'], dense(jet.curvature))]]
    x = np.random.default_rng(2).uniform(-40.0, 40.0, 300)
    u, u1, u2, v, v1, v2 = SwitchedFunction(frames, terms, [q, frames.v['cam']])(
        np.array([x, 1.0 + 0 * x])
    )[0]
    expected = [law(x, k) for k in range(4)]
    for found, order in ((u, 0), (u1, 1), (u2, 2), (v, 1), (v1, 2), (v2, 3)):
        size = np.abs(expected[order]).max()
        assert np.abs(found - expected[order]).max() < 1e-12 * size * (30 if order == 3 else 1)


def follower_on(law, drive, **more):
    """A spring-loaded roller on a cam of this law, and how far it is from it over a run."""
    overrides = {'joints.contact.law': law, 'drive': {'coordinate': 'cam', **drive}, **more}
    return ms.load_scene('measured_cam', overrides)


def measured(count):
    x = np.arange(count) / count * TURN
    u = 4e-3 * (1 - np.cos(x)) + 1e-3 * np.sin(2 * x + 0.3)
    return {'points': np.column_stack([x, u]).tolist()}


QUARTERS = {
    'segments': [
        {'from': 0.0, 'to': '90 deg', 'rise': '9 mm'},
        {'from': '90 deg', 'to': '180 deg', 'rise': 0.0},
        {'from': '180 deg', 'to': '270 deg', 'rise': '-9 mm'},
    ]
}
DRIVES = {
    'forwards': {'speed': 30.0},
    'backwards': {'speed': -30.0},
    'free': {'torque': {}, 'speed': 25.0},
    'there and back': {'profile': {'points': [[0.0, 30.0], [0.4, -30.0], [1.0, 30.0]]}},
}


@pytest.mark.sample(2)
@pytest.mark.parametrize('law', [QUARTERS, measured(120)], ids=['4 rows', '120 rows'])
@pytest.mark.parametrize('drive', DRIVES)
@pytest.mark.parametrize('lift_off', [None, {'restitution': 0.2}], ids=['ideal', 'open'])
def test_a_follower_keeps_to_its_law_through_all_rows(law, drive, lift_off):
    machine = follower_on(law, DRIVES[drive], **{'joints.contact.lift_off': lift_off})
    solution = ms.simulate(machine, duration=0.6)
    assert not [m for m in solution.modes if m.mode == Mode.FREE_FLIGHT]
    t = np.linspace(0.0, 0.6, 1201)
    o, pair = solution.view(t).observed, cam_pair(machine)
    (x, y), (w, v), (alpha, a) = o.position, o.velocity, o.acceleration
    u, u1, u2 = (pair.cam.law(x, k) for k in range(3))
    assert np.abs(y - pair.distance.lowest - u).max() < 1e-15
    assert np.abs(v - u1 * w).max() < 1e-13
    # at a break the acceleration is that of one of both sides
    off = np.abs(a - u1 * alpha - u2 * w**2)
    assert np.sort(off)[: -len(t) // 50].max() < 1e-10
    assert abs(solution.energy.residual) < 1e-12


@pytest.mark.sample(1)
@pytest.mark.parametrize('towards', [1.0, -1.0])
def test_runs_begin_and_turn_back_exactly_on_a_break(towards):
    """From 90 deg, where two rows meet; and with a speed that is zero when the cam is there."""
    start = {'speed': 20.0 * towards, 'start_angle': '90 deg'}
    machine = follower_on(QUARTERS, start, **{'joints.contact.lift_off': {'restitution': 0.0}})
    solution = ms.simulate(machine, duration=0.5)
    # parabola: angle = +-(20 t - 25 t^2), back at t = 0.8, highest at 0.4 with 4 rad
    back = {'profile': {'points': [[0.0, 20.0 * towards], [0.8, -20.0 * towards]]}}
    back['start_angle'] = 0.5 * math.pi - 4.0 * towards
    other = follower_on(QUARTERS, back, **{'joints.contact.lift_off': {'restitution': 0.0}})
    returned = ms.simulate(other, duration=0.8)
    for run in (solution, returned):
        o, pair = run.view(np.linspace(0.0, run.duration, 401)).observed, cam_pair(machine)
        x, y = o.position
        assert np.abs(y - pair.distance.lowest - pair.cam.law(x)).max() < 1e-15
        assert abs(run.energy.residual) < 1e-12
    assert returned.view(np.array([0.4])).observed.position[0, 0] == pytest.approx(
        0.5 * math.pi, abs=1e-14
    )


def test_a_step_costs_the_same_whatever_the_number_of_rows():
    sizes = []
    for count in (8, 360):
        machine = follower_on(measured(count), {'torque': {}, 'speed': 25.0})
        integrator = machine.equations.system.integrator(1e-12, compact=True)
        sizes.append(len(integrator.decomposition))
    assert sizes[0] == sizes[1]


def test_a_run_goes_on_from_a_snapshot_within_a_row():
    machine = follower_on(
        measured(60), {'speed': 30.0}, **{'joints.contact.lift_off.restitution': 0.3}
    )
    whole, first = machine.start(), machine.start()
    whole.advance(0.5, final=True)
    first.advance(0.2)
    second = machine.resume(machine.snapshot(first))
    second.advance(0.5, final=True)
    assert second.state == whole.state


# what is refused, and what is noted


@pytest.mark.parametrize(
    ('overrides', 'words'),
    [
        ({'joints.contact.base_radius': None}, "'base_radius' is missing"),
        ({'joints.contact.law': None}, "'law' is missing"),
        ({'joints.contact.base_radius': '8 mm'}, 'undercut'),
        ({'joints.contact.follower': 'roler'}, "did you mean 'roller'"),
        ({'joints.contact.follower': 'roller'}, "'roller' is missing: the radius"),
        ({'joints.contact.side': 'left'}, 'side has no meaning for a flat follower that slides'),
        ({'joints.contact.groove': {'clearance': 0}}, 'exclude each other'),
        ({'joints.contact.clearance': {'radial': 1e-4, 'restitution': 0.1}}, 'clearance'),
        ({'joints.contact.pitch': '3 mm'}, 'pitch has no meaning in a cam joint'),
        (
            {'joints.contact.law': {'segments': [{'from': 1, 'to': 2, 'rise': '5 mm'}]}},
            'the follower does not return',
        ),
        (
            {
                'joints.contact.law': {
                    'segments': [
                        {'from': '0 deg', 'to': '90 deg', 'rise': '5 mm'},
                        {'from': '80 deg', 'to': '180 deg', 'rise': '-5 mm'},
                    ]
                }
            },
            'from 0 to 90 deg overlaps the next one, which begins at 80 deg',
        ),
        (
            {
                'joints.contact.law': {
                    'segments': [{'from': '300 deg', 'to': '20 deg', 'rise': '5 mm'}]
                }
            },
            'count on, to 380 deg',
        ),
        (
            {
                'joints.contact.law': {
                    'segments': [
                        {
                            'from': '0 deg',
                            'to': '90 deg',
                            'rise': '5 mm',
                            'curve': 'half_harmonic',
                        },
                        {'from': '90 deg', 'to': '180 deg', 'rise': '-5 mm'},
                    ]
                }
            },
            'at 90 deg the velocity jumps',
        ),
        (
            {'joints.contact.law': {'segments': [{'from': 0, 'to': 1, 'rise': '5 deg'}]}},
            'but it is a displacement, in m',
        ),
    ],
)
def test_what_no_follower_can_do_is_refused_by_name(overrides, words):
    with pytest.raises(InputError) as caught:
        ms.load_scene('valve_train', overrides)
    assert words in str(caught.value)
    assert str(caught.value).startswith('valve_train')


def test_check_names_jumps_and_contacts_that_could_pull():
    law = [
        {'from': '0 deg', 'to': '90 deg', 'rise': '5 mm', 'curve': 'harmonic'},
        {'from': '90 deg', 'to': '180 deg', 'rise': '-5 mm'},
    ]
    machine = ms.load_scene(
        'valve_train', {'joints.contact.lift_off': None, 'joints.contact.law': {'segments': law}}
    )
    notes = check(machine).notes
    assert any('at 0 deg the acceleration jumps' in note for note in notes)
    assert any('the cam pulls its follower' in note for note in notes)


@pytest.mark.parametrize('axis', [90.0, -90.0, 0.0, 180.0, 30.0])
@pytest.mark.parametrize(('sense', 'phase'), [(1, 0.0), (1, 25.0), (-1, 25.0)])
def test_an_eccentric_is_a_disc_about_the_point_that_check_names(axis, sense, phase):
    """A face along the disc is as high as its centre is along the guide."""
    machine = ms.load_scene('eccentric_cam', {
        'joints.guide.axis': math.radians(axis), 'joints.contact.phase': math.radians(phase),
        'joints.contact.lift_off': None, 'drive.speed': 10.0, 'springs': None,
        'joints.contact.sense': 'counterclockwise' if sense > 0 else 'clockwise',
    })  # fmt: skip
    (note,) = (n for n in check(machine).notes if 'centre of the circle' in n)
    x, y = map(float, re.search(r'at \[(.*) mm, (.*) mm\] of cam', note).groups())
    assert math.hypot(x, y) == pytest.approx(5.0, rel=1e-5)
    t = np.linspace(0.0, TURN / 10.0, 21)
    seen = ms.simulate(machine, revolutions=1).sample(t, 'lift.contact')['lift.contact']
    centre = (x + 1j * y) * np.exp(1j * (10.0 * t - math.radians(axis)))
    assert 1e3 * seen - 5.0 == pytest.approx(centre.real, abs=1e-5)


def test_a_phase_turns_the_disc_to_the_centre_of_mass_of_its_scene():
    changes = {'joints.guide.axis': math.radians(30.0), 'joints.contact.phase': math.radians(60.0)}
    for given in ({}, changes):
        notes = check(ms.load_scene('eccentric_cam', given)).notes
        assert 'contact: centre of the circle at [5 mm, 0 mm] of cam' in notes
