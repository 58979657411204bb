"""Chapter 5 of [V]: as printed it fails, as corrected it holds by a second route."""

from __future__ import annotations

import math

import numpy as np
import pint
import pytest
from book_trains import gear_box
from textbook import TOOTH_SYSTEMS
from willis import Mesh, Train

from mechanism_sim.joints.mesh.involute import Gear, inv
from mechanism_sim.joints.mesh.pair import Pair
from mechanism_sim.joints.worm.constraint import WormPair

M = 2e-3


def test_v_5_14_torque_times_speed_is_power():
    units = pint.UnitRegistry()
    product = units.Quantity(3.0, 'N m') * units.Quantity(2.0, 'rad/s')
    assert product.check('[power]')
    assert not product.check('[energy]')


def test_v_5_21_angle_of_the_tooth_not_of_the_pitch():
    """The angle gamma_p of 5.21 against a rack that is rolled over the gear."""
    teeth, phi = 30, math.radians(20)
    r = M * teeth / 2
    # space of the rack, pi m/2 wide at the pitch line: its flank's contact after a turn
    turn = -0.1
    way = (r * turn + math.pi * M / 4) * math.cos(phi) ** 2
    x, y = r + math.tan(phi) * way, way
    radius, half = math.hypot(x, y), math.atan2(y, x) - turn
    involutes = inv(phi) - inv(math.acos(r * math.cos(phi) / radius))
    pitch, tooth = 2 * math.pi / teeth, math.pi / teeth
    assert half == pytest.approx(tooth / 2 + involutes, abs=1e-14)
    assert abs(half - (pitch / 2 + involutes)) > 0.05  # teeth without spaces between them
    # and the teeth follow one another at the pitch angle, called gamma_p too
    ring = Gear(teeth, M).outline(10) @ (1.0, 1.0j)
    assert np.angle(ring[20] / ring[0]) == pytest.approx(pitch)


def test_v_5_24_pitch_radii_from_base_radii():
    """5.10: the base radius is the smaller one; the cosine drops out of the ratio."""
    gear = Gear(20, M)
    cosine = math.cos(gear.system.pressure_angle)
    assert gear.base_radius / cosine == pytest.approx(gear.pitch_radius, rel=1e-15)
    assert gear.base_radius * cosine < 0.9 * gear.pitch_radius


def test_v_5_7_teeth_are_higher_than_the_gap_of_the_base_circles():
    """What ends between the base circles is the path of contact, not the tooth."""
    pair = Pair(Gear(20, M), Gear(31, M))
    gap = pair.centre_distance - pair.pinion.base_radius - pair.wheel.base_radius
    assert pair.pinion.tip_radius - pair.pinion.root_radius > 1.4 * gap
    tangent = pair.centre_distance * math.sin(pair.pressure_angle)
    assert pair.path.end - pair.path.start < tangent


def test_v_table_5_1_dedenda():
    """Both dedenda belong to all three angles; one row each would leave three numbers over."""
    full = [s for name, s in TOOTH_SYSTEMS.items() if name.startswith('full')]
    found = sorted((round(math.degrees(s.pressure_angle), 9), s.dedendum) for s in full)
    assert found == [(a, d) for a in (20, 22.5, 25) for d in (1.25, 1.35)]
    for system in full:  # the tips do not touch the roots with either
        pair = Pair(Gear(24, M, system), Gear(30, M, system))
        assert min(pair.clearances) == pytest.approx((system.dedendum - 1) * M)


def test_v_5_44_lead_angle():
    """A point on the thread, followed for a turn; as printed it is not even a number."""
    d2, lead = 0.02, 0.011
    angle = math.atan(lead / (math.pi * d2))
    worm = WormPair(2, 30, d2, angle)
    turn = np.linspace(0, 2 * math.pi, 100_001)
    helix = np.stack([np.cos(turn) * d2 / 2, np.sin(turn) * d2 / 2, lead * turn / (2 * math.pi)])
    step = np.diff(helix, axis=1)
    slopes = np.arctan2(step[2], np.hypot(step[0], step[1]))
    np.testing.assert_allclose(slopes, worm.lead_angle, rtol=1e-8)
    assert worm.lead == pytest.approx(lead)
    assert abs(math.atan(1 / (math.pi * d2)) - angle) > 1.0
    # in other units the printed one is another angle
    assert abs(math.atan(1 / (math.pi * d2)) - math.atan(1 / (math.pi * d2 * 1e3))) > 1.0


def test_v_5_52_sign_of_the_ratio_of_a_pair():
    """With signed speeds the minus contradicts 5.54 and 5.57 for an odd number of pairs."""
    pair = Train({'driving': 20, 'driven': 50}, (Mesh('driving', 'driven'),))
    w = pair.speeds({'driving': 3.0})
    assert w['driven'] / w['driving'] == pytest.approx(-20 / 50)
    box = {'2': 20, '5': 40, '7': 18, '4': 42, '6': 28, '3': 32, '8': 19, '9': 21}
    w = gear_box(box, 3).speeds({'2': 1.0})
    pairs = ('2', '5'), ('8', '9'), ('9', '4')
    right = math.prod(w[b] / w[a] for a, b in pairs)
    printed = math.prod(-w[b] / w[a] for a, b in pairs)
    assert right == pytest.approx(w['4'] / w['2'])
    assert printed == pytest.approx(-w['4'] / w['2'])


def test_v_5_8_4_a_steep_worm_can_be_driven():
    worm = WormPair(4, 40, 0.05, math.radians(25))
    assert worm.efficiency(0.05, wheel_drives=True) > 0.8
    assert not worm.self_locking(0.05)
    assert WormPair(1, 40, 0.05, math.radians(2)).self_locking(0.05)
