from __future__ import annotations

import math

from builders import made

import mechanism_sim as ms
from mechanism_sim.thesis.starts import starts

SCENE = """
links:
  crank: {length: 64 mm, mass: 0.6 kg, inertia: 2645 kg mm^2}
  rod: {length: 300 mm, cog: 150 mm, mass: 0.24 kg, inertia: 2950 kg mm^2}
  weight: {mass: 1 kg}
joints:
  pivot: {revolute: [ground, crank]}
  pin: {revolute: [crank.end, rod], clearance: {radial: 0.254 mm, restitution: 0.5}}
  hinge: {revolute: [rod.end, weight]}
  guide: {prismatic: [ground, weight], angle: -90 deg, stops: {upper: 1 m, restitution: 0.3}}
drive: {coordinate: crank, speed: 30 rpm}
gravity: [0 m/s^2, -9.81 m/s^2]
"""


def test_a_stop_that_is_open_at_the_start_is_no_lost_contact():
    """The weight of what hangs on the pin of a slow crank keeps it on its bushing."""
    (found,) = starts(made(SCENE), 1, 0.05)
    assert math.isinf(found.followed)


def test_where_nothing_presses_a_cam_is_not_followed_from_the_start_on():
    """Beyond 45.6 degrees, where it is lost by those that come from before."""
    before, there, beyond = starts(ms.load_scene('eccentric_cam'), 8, 0.01)[:3]
    assert math.isinf(before.followed)
    assert 0.0 < there.followed < 0.01
    assert beyond.followed == 0.0


def test_gears_that_begin_between_their_flanks_follow_none():
    assert starts(ms.load_scene('gear_four_bar'), 1, 0.01)[0].followed == 0.0
