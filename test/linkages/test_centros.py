"""Instantaneous centres: by geometry, by loop closure, at infinity."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from centros import Centre, centre, centres, velocities, velocity_ratio

from mechanism_sim.joints.slot.constraint import PinInSlot
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.planar.configuration import Constraints
from mechanism_sim.planar.mechanism import Prismatic, Revolute

O = (0.0, 0.0)  # noqa: E741


def four_bar(f):
    joints = (
        Revolute('O2', 'ground', 'crank', O, O),
        Revolute('A', 'crank', 'coupler', (f.crank, 0.0), O),
        Revolute('B', 'coupler', 'rocker', (f.coupler, 0.0), (f.rocker, 0.0)),
        Revolute('O4', 'rocker', 'ground', O, (f.ground, 0.0)),
    )
    return Constraints(('crank', 'coupler', 'rocker'), joints)


def poses_of(f, th2):
    th3, th4 = f.positions(np.array(th2))
    return np.array(
        [
            [0.0, 0.0, th2],
            [f.crank * np.cos(th2), f.crank * np.sin(th2), th3],
            [f.ground, 0.0, th4],
        ]
    )


def slider_crank(crank, rod, offset, th2):
    joints = (
        Revolute('O', 'ground', 'crank', O, O),
        Revolute('A', 'crank', 'rod', (crank, 0.0), O),
        Revolute('B', 'rod', 'slider', (rod, 0.0), O),
        Prismatic('guide', 'ground', 'slider', (0.0, offset), O),
    )
    x, y = crank * np.cos(th2), crank * np.sin(th2)
    th3 = np.arcsin((offset - y) / rod)
    poses = [[0.0, 0.0, th2], [x, y, th3], [x + rod * np.cos(th3), offset, 0.0]]
    return Constraints(('crank', 'rod', 'slider'), joints), np.array(poses)


def line(p, q):
    """Homogeneous line through two homogeneous points."""
    return np.cross(p, q)


def same(p, q):
    """True if two homogeneous points are one."""
    p, q = np.array(p, float), np.array(q, float)
    return np.linalg.norm(np.cross(p, q)) < 1e-10 * np.linalg.norm(p) * np.linalg.norm(q)


LINKAGES = [
    FourBar(4.0, 1.0, 6.0, 5.0, 'crossed'), FourBar(0.387, 0.064, 0.309, 0.312),
    FourBar(1.0, 4.0, 5.0, 6.0),
]  # fmt: skip


@pytest.mark.parametrize('f', LINKAGES)
@pytest.mark.parametrize('th2', [0.3, 1.7, 4.4])
def test_the_six_centres_of_a_four_bar_by_the_theorem_of_three_centres(f, th2):
    """Four are the joints; the other two lie where the lines of the joints meet."""
    poses = poses_of(f, th2)
    found = centres(four_bar(f), poses)
    assert set(found) == {*combinations(('ground', 'crank', 'coupler', 'rocker'), 2)}
    b = poses[1, :2] + f.coupler * np.array([np.cos(poses[1, 2]), np.sin(poses[1, 2])])
    o2, a, b, o4 = (0.0, 0.0, 1.0), (*poses[1, :2], 1.0), (*b, 1.0), (f.ground, 0.0, 1.0)
    expected = {
        ('ground', 'crank'): o2,
        ('crank', 'coupler'): a,
        ('coupler', 'rocker'): b,
        ('ground', 'rocker'): o4,
        ('ground', 'coupler'): line(line(o2, a), line(o4, b)),
        ('crank', 'rocker'): line(line(o2, o4), line(a, b)),
    }
    for pair, point in expected.items():
        assert same(found[pair], point), pair


@pytest.mark.parametrize('f', LINKAGES)
def test_velocity_ratios_from_centres_are_those_of_loop_closure(f):
    for th2 in np.linspace(0.05, 6.2, 40):
        poses = poses_of(f, th2)
        found = centres(four_bar(f), poses)
        w3, w4 = f.rates(np.array(th2), np.array(1.0), poses[1, 2], poses[2, 2])
        assert velocity_ratio(found, 'coupler', 'crank') == pytest.approx(w3, rel=1e-9, abs=1e-10)
        assert velocity_ratio(found, 'rocker', 'crank') == pytest.approx(w4, rel=1e-9, abs=1e-10)
        assert velocity_ratio(found, 'crank', 'rocker') == pytest.approx(1.0 / w4, rel=1e-8)
        assert velocity_ratio(found, 'rocker', 'coupler') == pytest.approx(w4 / w3, rel=1e-8)


def test_kennedy_any_three_links_have_their_centres_in_line():
    """A six-link machine with two slides: 20 triples, several with centres at infinity."""
    th2 = 0.8
    first, poses = slider_crank(0.3, 1.1, 0.2, th2)
    b = poses[2, :2]
    rocker = np.array([2.0, -0.5, 2.0])
    end = rocker[:2] + 0.9 * np.array([np.cos(2.0), np.sin(2.0)])
    th5 = np.arctan2(*(end - b)[::-1])
    joints = (
        *first.joints,
        Revolute('B5', 'slider', 'link', O, O),
        Revolute('D', 'link', 'rocker', (float(np.hypot(*(end - b))), 0.0), (0.9, 0.0)),
        Revolute('E', 'rocker', 'ground', O, (2.0, -0.5)),
    )
    machine = Constraints((*first.links, 'link', 'rocker'), joints)
    poses = np.vstack([poses, [*b, th5], rocker])
    assert np.abs(machine.linearise(poses)[0]).max() < 1e-14
    found = centres(machine, poses)
    for i, j, k in combinations(('ground', *machine.links), 3):
        assert abs(np.linalg.det([found[i, j], found[j, k], found[i, k]])) < 1e-12
    for joint in joints:
        if isinstance(joint, Revolute):
            pair = tuple(sorted((joint.first, joint.second), key=('ground', *machine.links).index))
            link, at = (joint.first, joint.on_first)
            pose = np.zeros(3) if link == 'ground' else poses[machine.links.index(link)]
            turn = np.exp(1j * pose[2]) * complex(*at) + complex(*pose[:2])
            assert same(found[pair], (turn.real, turn.imag, 1.0))


def test_a_slider_turns_about_a_point_at_infinity_square_to_its_guide():
    machine, poses = slider_crank(1.0, 4.0, 0.5, 0.9)
    found = centres(machine, poses)
    slide = found['ground', 'slider']
    assert slide.w == 0.0
    assert abs(slide.x) < 1e-12
    assert np.isinf(slide.point).all()
    # crank and slider: where the rod's line meets the pivot's normal to the guide, [V] 2.4
    (x, y), th3 = poses[1, :2], poses[1, 2]
    point = found['crank', 'slider'].point
    assert point == pytest.approx((0.0, y - x * np.tan(th3)))
    # the slider is as fast as that point of the crank: at unit rate, the distance
    speeds = velocities(machine, poses)
    assert speeds[2, 0] / speeds[0, 2] == pytest.approx(-point[1])
    assert velocity_ratio(found, 'slider', 'crank') == pytest.approx(0.0, abs=1e-12)
    assert np.isinf(velocity_ratio(found, 'crank', 'slider'))


def test_a_parallelogram_moves_its_coupler_without_turning():
    f = FourBar(3.0, 1.0, 3.0, 1.0)
    found = centres(four_bar(f), poses_of(f, 1.1))
    coupler = found['ground', 'coupler']
    assert coupler.w == 0.0
    # at infinity along the cranks, whose motion is square to them
    assert np.tan(1.1) == pytest.approx(coupler.y / coupler.x)
    assert found['crank', 'rocker'].w == 0.0
    assert velocity_ratio(found, 'rocker', 'crank') == pytest.approx(1.0)


def test_a_pin_in_a_slot_turns_its_link_about_the_normals():
    """Scotch yoke by a slot: the yoke slides, so its centre with the ground is at infinity."""
    joints = (
        Revolute('O', 'ground', 'crank', O, O),
        PinInSlot('pin', 'crank', 'yoke', (1.0, 0.0), O, np.pi / 2.0),
        Prismatic('guide', 'ground', 'yoke', O, O),
    )
    machine = Constraints(('crank', 'yoke'), joints)
    poses = np.array([[0.0, 0.0, 0.7], [np.cos(0.7), 0.0, 0.0]])
    found = centres(machine, poses)
    assert found['ground', 'yoke'].w == 0.0
    assert found['crank', 'yoke'].point == pytest.approx((0.0, np.sin(0.7)))


def test_centres_need_one_way_to_move():
    f = LINKAGES[0]
    rigid = four_bar(f)
    poses = poses_of(f, 0.5)
    held = Constraints(
        rigid.links, (*rigid.joints, Prismatic('x', 'ground', 'crank', O, O, 0, 0.5))
    )
    with pytest.raises(ValueError, match='one way to move, but here there are 0'):
        centres(held, poses)
    loose = Constraints(rigid.links, rigid.joints[:-1])
    with pytest.raises(ValueError, match='there are 3'):
        centres(loose, poses)
    # with velocities given, any will do
    speeds = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    assert centres(loose, poses, speeds)['ground', 'rocker'].point == pytest.approx(
        (f.ground, 0.0)
    )


def test_links_that_move_as_one_have_no_centre():
    still = (np.array([1.0, 2.0, 0.3]), np.zeros(3))
    assert np.isnan(centre(still, still)).all()
    turning = (np.array([3.0, 2.0, 0.1]), np.array([0.0, 0.0, 2.0]))
    assert centre(still, turning).point == pytest.approx((3.0, 2.0))
    assert isinstance(centre(still, turning), Centre)
