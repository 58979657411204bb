"""Contact of drawn flanks: involutes, cycloids, straight teeth; the positions are tried out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conjugacy import find_contacts
from scipy.interpolate import make_interp_spline
from textbook import TOOTH_SYSTEMS

from mechanism_sim.errors import InputError
from mechanism_sim.joints.mesh.involute import Gear
from mechanism_sim.joints.mesh.pair import Pair

M = 2e-3
PAIRS = {
    'nominal': Pair(Gear(20, M), Gear(31, M)),
    'farther apart': Pair(Gear(20, M), Gear(31, M), 51.9e-3),
    'shifted': Pair(Gear(14, M, shift=0.3), Gear(40, M, shift=-0.1)),
    'internal': Pair(Gear(22, M), Gear(60, M, internal=True)),
    'internal, closer': Pair(Gear(22, M), Gear(60, M, internal=True), 37.8e-3),
}


def flank(gear, points=60):
    """Without the radius at the root; of internal teeth the lower side."""
    drawn = gear.flank(points)
    if gear.internal:
        return drawn * (1.0, -1.0)
    return drawn[1:] if gear.root_radius < gear.base_radius else drawn


def rolled(radius, circle, arcs):
    """The trace of a point of a circle that rolls outside (inside: negative) on another one.

    (n, 2), from the pitch circle at angle 0 on, over the arc that was rolled off.
    """
    along, turned = arcs / radius, arcs / radius + arcs / circle
    z = (radius + circle) * np.exp(1j * along) - circle * np.exp(1j * turned)
    return np.stack([z.real, z.imag], axis=1)


def cycloids(circle):
    """The face of a pinion of 20 mm radius and the flank of a wheel of 32 mm, root to tip."""
    face = rolled(20e-3, circle, np.linspace(1e-3, 9e-3, 60)) * (1.0, -1.0)
    return face, rolled(32e-3, -circle, np.linspace(10e-3, 0.5e-3, 60))


def straight(root, tip, half_root, half_tip):
    """The straight upper flank of a tooth about the x axis [m]."""
    return np.linspace((root, half_root), (tip, half_tip), 12)


def dense(points):
    """The flank as 20,000 points, complex [m]."""
    curve = make_interp_spline(np.linspace(0.0, 1.0, len(points)), points, k=7)
    return curve(np.linspace(0.0, 1.0, 20_000)) @ (1.0, 1.0j)


@pytest.mark.parametrize('name', PAIRS)
def test_involutes_turn_about_one_point_along_the_line_of_action(name):
    pair = PAIRS[name]
    found = find_contacts(flank(pair.pinion), flank(pair.wheel), pair.centre_distance)
    assert found.deviation < 1e-11
    assert found.mean_ratio == pytest.approx(pair.ratio, rel=1e-11)
    side = -1 if pair.wheel.internal else 1
    assert found.pitch_point == pytest.approx(side * pair.pitch_radii[0], rel=1e-11)
    # the line of action, and how much of it, by the closed form
    way = found.path - [side * pair.pitch_radii[0], 0.0]
    angle = math.pi / 2 - pair.pressure_angle
    normal = np.array([math.sin(angle), -math.cos(angle)])
    assert np.abs(way @ normal).max() < 1e-11
    places = side * way @ [math.cos(angle), math.sin(angle)]
    assert places[0] == pytest.approx(pair.path.start, abs=1.5e-4)
    assert places[-1] == pytest.approx(pair.path.end, abs=1.5e-4)


def test_involutes_of_different_pressure_angles_turn_by_their_base_circles_not_their_teeth():
    one, two = Gear(20, M), Gear(31, M, TOOTH_SYSTEMS['full 25'])
    found = find_contacts(flank(one), flank(two), 51e-3)
    assert found.deviation < 1e-11
    assert found.mean_ratio == pytest.approx(-two.base_radius / one.base_radius, rel=1e-11)


@pytest.mark.parametrize('circle', [6e-3, 16e-3])
def test_cycloids_of_one_rolling_circle_are_conjugate_at_their_centre_distance_only(circle):
    """The larger circle makes the wheel's flank a straight radius, as in clocks."""
    face, inner = cycloids(circle)
    found = find_contacts(face, inner, 52e-3)
    assert len(found.ratio) > 100
    assert found.deviation < 1e-9
    assert found.mean_ratio == pytest.approx(-32 / 20, rel=1e-9)
    # the path of contact is the rolling circle
    radii = np.hypot(*(found.path - [20e-3 + circle, 0.0]).T)
    assert radii == pytest.approx(circle, rel=1e-9)
    assert find_contacts(face, inner, 52.2e-3).deviation > 1e-4


OTHERS = {
    'straight against involute': (
        straight(18e-3, 22e-3, 2.1e-3, 0.9e-3), flank(Gear(31, M)), 51e-3, False,
    ),
    'straight teeth': (
        straight(18e-3, 22e-3, 2.1e-3, 0.9e-3), straight(29e-3, 33e-3, 2.1e-3, 0.9e-3),
        51e-3, True,
    ),
}  # fmt: skip


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', OTHERS)
def test_other_flanks_are_not_conjugate_and_their_ratio_is_that_of_their_angles(name):
    """Kennedy's theorem itself: by the angles of positions in contact, one after the other."""
    first, second, distance, edges = OTHERS[name]
    found = find_contacts(first, second, distance, 2001, edges)
    assert found.deviation > 2e-3
    smooth = slice(None)
    if edges:  # the longest run in which one and the same edge touches
        kinks = np.flatnonzero(np.abs(np.diff(found.ratio, 2)) > 1e-4)
        runs = np.split(np.arange(len(found.ratio)), kinks + 1)
        smooth = max(runs, key=len)[3:-3]
    one, two, ratio = found.first[smooth], found.second[smooth], found.ratio[smooth]
    assert len(one) > 50
    slopes = np.gradient(two, one, edge_order=2)
    assert (slopes * ratio)[2:-2] == pytest.approx(1.0, abs=2e-5)


@pytest.mark.parametrize('name', [*PAIRS, *OTHERS])
def test_in_the_positions_found_flanks_touch_and_do_not_overlap(name):
    """By the angles of both flanks at equal distances from the second centre."""
    if name in PAIRS:
        pair, edges = PAIRS[name], False
        first, second, distance = flank(pair.pinion), flank(pair.wheel), pair.centre_distance
    else:
        first, second, distance, edges = OTHERS[name]
    found = find_contacts(first, second, distance, 40, edges)
    z1, z2 = (dense(f) for f in (first, second))
    outwards = 1 if abs(z2[-1]) > abs(z2[0]) else -1
    for one, two in zip(found.first, found.second, strict=True):
        seen = (z1 * np.exp(1j * one) - distance) * np.exp(-1j * two)
        inside = (abs(seen) > min(abs(z2))) & (abs(seen) < max(abs(z2)))
        partner = np.interp(abs(seen), abs(z2)[::outwards], np.angle(z2)[::outwards])
        gaps = outwards * abs(seen) * (np.angle(seen) - partner)
        assert gaps[inside].min() == pytest.approx(0.0, abs=2e-7 if edges else 2e-8)


def test_what_never_touches_is_refused():
    first, second = flank(Gear(20, M)), flank(Gear(31, M))
    with pytest.raises(InputError, match=r'never touch at a centre distance of 60 mm'):
        find_contacts(first, second, 60e-3, edges=True)
    a, b, distance, _ = OTHERS['straight teeth']
    with pytest.raises(InputError, match='never touch but with their edges'):
        find_contacts(a, b, distance)
    with pytest.raises(InputError, match='a centre distance is positive'):
        find_contacts(first, second, 0.0)
    with pytest.raises(InputError, match='four points or more'):
        find_contacts(first[:3], second, 51e-3)
    with pytest.raises(InputError, match='lie on each other'):
        find_contacts(first[[1, 1, 1, 1]], second, 51e-3)
