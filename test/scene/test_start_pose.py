"""Starts told by the pose and the velocity of one link."""

from __future__ import annotations

import math

import pytest

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.scene.start_pose import Planar, check_start, pose_and_velocity, start_values


def _again(scene, pose, velocity, link):
    machine = ms.load_scene(scene)
    values = start_values(machine, link, pose, velocity)
    return ms.load_scene(scene, [f'{path}={value}' for path, value in values.items()])


@pytest.mark.parametrize('angle', [0.3, -3.0, math.pi])
def test_a_crank_is_put_at_an_angle(angle):
    asked = Planar((0.0, 0.0), angle)
    machine = _again('four_bar_clearance', asked, None, 'crank')
    check_start(machine, 'crank', asked, None)
    found, _ = pose_and_velocity(machine, 'crank')
    assert math.remainder(found.angle - angle, math.tau) == pytest.approx(0.0, abs=1e-15)


def test_a_link_stays_where_it_is_found():
    machine = ms.load_scene('slider_crank_engine')
    for link in ('crank', 'rod'):
        pose, _ = pose_and_velocity(machine, link)
        again = _again('slider_crank_engine', pose, None, link)
        check_start(again, link, pose, None)


def test_what_joints_forbid_is_refused():
    off = Planar((0.1, 0.0), 0.0)
    with pytest.raises(InputError, match='do not let crank have that pose'):
        check_start(_again('four_bar_clearance', off, None, 'crank'), 'crank', off, None)
    fast = Planar((0.0, 0.0), 1000.0)
    with pytest.raises(InputError, match='drive begins with'):
        _again('four_bar_clearance', None, fast, 'crank')


def test_a_block_is_put_where_it_is_asked():
    (x, y), angle = pose_and_velocity(ms.load_scene('vibration_absorber'), 'absorber')[0]
    pose, velocity = Planar((x + 0.002, y), angle), Planar((0.3, 0.0), 0.0)
    machine = _again('vibration_absorber', pose, velocity, 'absorber')
    check_start(machine, 'absorber', pose, velocity)


@pytest.mark.slow
def test_a_link_between_loose_bearings_lies_in_them():
    asked = Planar((0.0, 0.0), 0.3)
    machine = _again('thesis_complete', asked, None, 'crank')
    check_start(machine, 'crank', asked, None)
    off = Planar((0.01, 0.0), 0.3)
    with pytest.raises(InputError, match='do not let crank have that pose'):
        check_start(machine, 'crank', off, None)
