"""Geneva wheels, slotted racks and pins with play, against closed forms ([V] 2.6)."""

import math

import numpy as np
import pytest
from builders import made
from matplotlib.path import Path as Polygon

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.export.skeleton import skeleton_of
from mechanism_sim.planar.view import SLOT

RADIUS, SPEED = 0.05, 4.0 * math.pi


def geneva(slots, sense=1.0, distance=None, **keys):
    """A wheel whose crank starts opposite to it, in the middle of the dwell."""
    b = RADIUS / math.sin(math.pi / slots) if distance is None else distance
    content = {
        'title': 'Geneva wheel',
        'links': {
            'ground': {'points': {'centre': [b, 0.0]}},
            'crank': {'length': RADIUS, 'mass': 0.6, 'inertia': 6e-4},
            'wheel': {'mass': 0.9, 'inertia': 9e-4},
        },
        'joints': {
            'ground_crank': {'revolute': ['ground', 'crank']},
            'ground_wheel': {'revolute': ['ground.centre', 'wheel']},
            'crank_wheel': {'geneva': ['crank.end', 'wheel'], 'slots': slots},
        },
        'drive': {'speed': sense * SPEED, 'start_angle': math.pi},
        'guess': {'wheel': math.pi - math.pi / slots},
    }
    return made(content | keys, 'wheel')


def wheel_turned(slots, turned):
    """Angle of the wheel and its rates, by crank angle since the middle of the dwell.

    In the slot the wheel points at the pin: ``gamma = atan2(l sin b, 1 - l cos b)`` with the crank
    b past the line of centres and ``l = sin(pi/N)``, counted against the crank's sense.
    """
    lam = math.sin(math.pi / slots)
    whole, rest = np.divmod(turned, 2.0 * math.pi)
    b = rest - math.pi
    b_max = 0.5 * math.pi - math.pi / slots
    inside = np.abs(b) < b_max
    p, q = lam * np.cos(b) - lam**2, 1.0 - 2.0 * lam * np.cos(b) + lam**2
    gamma = np.where(inside, np.arctan2(lam * np.sin(b), 1.0 - lam * np.cos(b)),
                     np.sign(b) * math.pi / slots)  # fmt: skip
    rate = np.where(inside, p / q, 0.0)
    second = np.where(inside, -lam * np.sin(b) * (1.0 - lam**2) / q**2, 0.0)
    return (whole + 0.5) * 2.0 * math.pi / slots + gamma, rate, second


@pytest.mark.sample(3)
@pytest.mark.parametrize('sense', [1.0, -1.0])
@pytest.mark.parametrize('slots', [3, 4, 5, 6, 8, 12])
def test_the_wheel_points_at_the_pin_and_rests_between(slots, sense):
    machine = geneva(slots, sense)
    solution = ms.simulate(machine, revolutions=3)
    t = np.linspace(0.0, solution.duration, 997)[:-1]
    seen = solution.sample(t, 'acceleration.wheel', 'position.wheel', 'velocity.wheel')
    angle, rate, second = wheel_turned(slots, SPEED * t)
    start = seen['position.wheel'][0]
    assert np.abs(start - seen['position.wheel'] - sense * angle).max() < 1e-12
    assert np.abs(seen['velocity.wheel'] + sense * SPEED * rate).max() < 1e-11 * SPEED
    found = seen['acceleration.wheel']
    assert np.abs(found + sense * SPEED**2 * second).max() < 1e-9 * SPEED**2
    assert solution.max_closure_error < 1e-13
    # [V] 2.149, as it should be: the time in the slot is pi (N - 2)/(N w2)
    share = np.count_nonzero(seen['velocity.wheel']) / len(t)
    assert share == pytest.approx((slots - 2) / (2 * slots), abs=2e-2)


def test_the_locked_wheel_is_held_against_a_torque():
    loads = {'twist': {'at': 'wheel', 'torque': 0.3}}
    solution = ms.simulate(geneva(4, loads=loads), revolutions=1)
    dwell = solution.view(np.array([0.01])).observed
    wheel = [j.name for j in geneva(4).plan.joints].index('crank_wheel')
    assert dwell.reaction_moment[wheel, 0] == pytest.approx(-0.3, rel=1e-12)
    # the arc's force goes through the crank's centre: the drive feels none of it
    assert dwell.drive_torque[0, 0] == pytest.approx(0.0, abs=1e-12)
    b = RADIUS / math.sin(math.pi / 4)
    assert np.hypot(*dwell.reaction[wheel, :, 0]) == pytest.approx(0.3 / b, rel=1e-12)


@pytest.mark.parametrize('slots', [3, 8])
def test_a_drawn_wheel_leaves_room_for_the_pin_and_for_the_disc_that_holds_it(slots):
    """Both turned by the closed form; no edge of the slots is nearer to the pin than its sides."""
    machine = geneva(slots)
    skeleton = skeleton_of(machine, machine.assembly.q[:, None])
    wheel, disc = (
        next(s.paths[0].curves[0] for s in skeleton.shapes if (s.kind, s.link) == ('wheel', link))
        @ (1.0, 1.0j)
        for link in ('wheel', 'crank')
    )
    turned, nearest = np.linspace(0.0, 2.0 * math.pi, 121), []
    for crank, gamma in zip(math.pi + turned, wheel_turned(slots, turned)[0], strict=True):
        around = wheel * np.exp(1j * (machine.assembly.q[1] - gamma))
        around += RADIUS / math.sin(math.pi / slots)
        pin, arc = RADIUS * np.exp(1j * crank), disc * np.exp(1j * crank)
        one, two = (Polygon(np.array([x.real, x.imag]).T) for x in (around, arc))
        assert not one.contains_points([(pin.real, pin.imag), *two.vertices]).any()
        assert not two.contains_points(one.vertices).any()
        nearest.append(np.abs(around - pin).min())
        if pin.real < 0.0:  # far from the wheel, which the disc holds
            assert np.abs(around[:, None] - arc).min() < 0.02 * RADIUS
    assert min(nearest) == pytest.approx(SLOT * skeleton.symbol, rel=1e-3)


def play(c, e=0.3):
    joints = geneva(4).scene.model_dump(exclude_unset=True)['joints']
    joints['crank_wheel']['clearance'] = {'radial': c, 'restitution': e}
    return geneva(4, joints=joints)


@pytest.mark.slow
def test_a_wheel_with_play_rattles_between_its_walls_and_the_ideal_one_comes_back():
    ideal = ms.simulate(geneva(4), revolutions=1.5).view(np.array([0.72])).observed
    off = []
    for c in (1e-4, 1e-5, 1e-6):
        solution = ms.simulate(play(c), revolutions=1.5)
        assert {i.joint for i in solution.impacts} == {'crank_wheel_left', 'crank_wheel_right'}
        assert solution.max_penetration < 1e-15
        assert abs(solution.energy.residual) < 1e-12 * solution.energy.drive_work
        seen = solution.view(np.array([0.72])).observed
        off.append(np.abs(seen.position - ideal.position)[1, 0])
        assert seen.gap.min(initial=1.0) > -1e-15
        assert seen.gap.sum(axis=0) == pytest.approx(2.0 * c, rel=1e-9)  # two walls
    assert off[0] < 1.2e-4 / (RADIUS * math.cos(math.pi / 4))
    assert off[1] < 0.11 * off[0]
    assert off[2] < 0.11 * off[1]


@pytest.mark.slow
def test_impacts_of_the_wheel_obey_newtons_law_of_restitution():
    solution = ms.simulate(play(1e-4, 0.4), revolutions=1)
    bounces = [i for i in solution.impacts if not i.ends_chatter]
    assert len(bounces) > 5
    for i in bounces:
        assert i.rebound_speed == pytest.approx(0.4 * i.approach_speed, rel=1e-9, abs=1e-12)


def test_a_slotted_rack_moves_by_two_radii_in_half_a_turn():
    solution = ms.simulate(ms.load_scene('linear_intermittent'), revolutions=2)
    t = np.linspace(0.0, solution.duration, 801)[:-1]
    seen = solution.sample(t, 'position.crank', 'position.rack', 'velocity.rack', 'drive_torque')
    theta, r, w = seen['position.crank'], 0.04, 2.0 * math.pi
    whole, rest = np.divmod(theta - math.pi, 2.0 * math.pi)
    moving = rest < math.pi
    x = (2.0 * (whole + 1.0) * r) - r + r * np.where(moving, 1.0 - np.cos(rest), 2.0)
    assert np.abs(seen['position.rack'] - (x - x[0] + seen['position.rack'][0])).max() < 1e-14
    rate = np.where(moving, r * w * np.sin(rest), 0.0)
    assert np.abs(seen['velocity.rack'] - rate).max() < 1e-13
    # a Scotch yoke while it moves: the drive bears m x'' x'
    push = 1.2 * np.where(moving, r * w**2 * np.cos(rest), 0.0) * rate
    assert np.abs(seen['drive_torque'] * w - push).max() < 1e-12


@pytest.mark.parametrize(
    ('name', 'moved', 'off', 'starts'),
    [('geneva', 'wheel', math.pi / 4.0, ('180 deg', '20 deg')),
     ('linear_intermittent', 'rack', 0.04, ('90 deg', '250 deg'))],
)  # fmt: skip
def test_links_that_are_half_a_slot_off_close_their_loop_but_do_not_face(name, moved, off, starts):
    for start in starts:  # locked, and in a slot
        machine = ms.load_scene(name, {'drive.start_angle': start})
        kinematics = machine.plan.kinematics(machine.plan.prescribed)
        both = np.repeat(machine.assembly.q[:, None], 2, axis=1)
        both[kinematics.coordinates.index(moved), 1] += off
        assert np.abs(kinematics.closure(both)[0]).max() < 1e-15
        assert kinematics.faces(both).tolist() == [True, False]


@pytest.mark.parametrize(
    ('keys', 'words'),
    [
        ({'distance': 0.08}, ['0.0707106781', '0.08']),
        ({'joints': {'ground_crank': {'revolute': ['ground', 'crank']},
                     'ground_wheel': {'revolute': ['ground.centre', 'wheel']},
                     'crank_wheel': {'geneva': ['crank.end', 'wheel']}}}, ["slots' is missing"]),
        ({'joints': {'ground_crank': {'revolute': ['ground', 'crank']},
                     'crank_wheel': {'geneva': ['crank.end', 'wheel'], 'slots': 4}}},
         ['wheel must turn on the ground']),
    ],
)  # fmt: skip
def test_a_wheel_that_cannot_work_is_refused(keys, words):
    with pytest.raises(InputError) as refusal:
        geneva(4, **keys)
    for word in words:
        assert word in str(refusal.value)


def test_a_rack_of_another_pitch_is_refused():
    with pytest.raises(InputError, match='twice the radius'):
        ms.load_scene('linear_intermittent', {'joints.crank_rack.pitch': '70 mm'})


def test_a_scotch_yoke_with_play_comes_back_to_the_ideal_one():
    """The plain slot: walls half a millimetre, then a hundredth of it, from the pin."""
    ideal = ms.simulate(ms.load_scene('scotch_yoke'), revolutions=1)
    joint = next(n for n, j in ms.load_scene('scotch_yoke').scene.joints.items() if j.slot)
    t = np.array([0.83]) * ideal.duration
    wanted = ideal.view(t).observed.position
    off = []
    for c in (5e-4, 5e-6):
        loose = {f'joints.{joint}.clearance': {'radial': c, 'restitution': 0.2}}
        solution = ms.simulate(ms.load_scene('scotch_yoke', loose), revolutions=1)
        energy = solution.energy
        assert solution.impacts
        assert abs(energy.residual) < 1e-11 * max(energy.drive_work, energy.initial)
        off.append(np.abs(solution.view(t).observed.position - wanted).max())
    assert off[0] < 5.1e-4
    assert off[1] < 5.1e-6


@pytest.mark.parametrize('off', [4e-7, -4e-7])
def test_centres_of_few_digits_let_dwell_and_stroke_meet(off):
    """A millionth is let pass: the pin enters where the wheel waits for it, to rounding."""
    b = RADIUS / math.sin(math.pi / 8) * (1.0 + off)
    solution = ms.simulate(geneva(8, distance=b), revolutions=1)
    t = np.linspace(0.0, solution.duration, 2003)
    turned = solution.sample(t, 'position.wheel')['position.wheel']
    assert np.abs(turned[0] - turned - wheel_turned(8, SPEED * t)[0]).max() < 1e-12
    assert solution.max_closure_error < 1e-13


def test_long_equations_are_compiled_as_compact_code():
    """Few unknowns, but walls and stops that rub: optimised, their code takes 40 s to make."""
    loose = {'radial': '0.1 mm', 'restitution': 0.3, 'friction': 0.1, 'pin_radius': '5 mm'}
    machine = geneva(4)
    assert not machine.equations.compact
    assert ms.load_scene(machine, {'joints.crank_wheel.clearance': loose}).equations.compact
