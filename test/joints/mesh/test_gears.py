"""Involute gears: what the formulas say against drawn teeth that turn on each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from absolute import turned
from scipy.integrate import quad
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq, root
from textbook import TOOTH_SYSTEMS

from mechanism_sim.errors import InputError
from mechanism_sim.joints.mesh.involute import (
    FULL_DEPTH,
    Gear,
    inv,
    inverse_inv,
    least_teeth,
    transverse,
)
from mechanism_sim.joints.mesh.pair import Pair, path_with_rack

M = 2e-3
STUB = TOOTH_SYSTEMS['stub 20']
NOMINAL = Pair(Gear(20, M), Gear(31, M))
SHIFTED = Pair(Gear(14, M, shift=0.3), Gear(40, M, shift=-0.1))
PAIRS = {
    'nominal': NOMINAL,
    'farther apart': Pair(Gear(20, M), Gear(31, M), NOMINAL.centre_distance + 0.3e-3),
    'shifted': SHIFTED,
    '25 deg': Pair(Gear(18, M, TOOTH_SYSTEMS['full 25']), Gear(18, M, TOOTH_SYSTEMS['full 25'])),
    'internal': Pair(Gear(22, M), Gear(60, M, internal=True)),
    'internal, shifted': Pair(Gear(20, M, shift=0.2), Gear(65, M, shift=0.5, internal=True)),
    'internal, closer': Pair(Gear(22, M), Gear(60, M, internal=True), 37.9e-3),
}
pairs = pytest.mark.parametrize('pair', PAIRS.values(), ids=PAIRS)


class DrawnFlank:
    """A smooth curve through the drawn involute, in units of the module, from root to tip."""

    def __init__(self, gear):
        points = gear.flank(60) / gear.module
        if not gear.internal and gear.root_radius < gear.base_radius:
            points = points[1:]  # the radius at the root
        if gear.internal:
            points = points * (1.0, -1.0)  # its lower flank meets the pinion's upper one
        # points are equally spaced in what the involute is smooth in, down to the base circle
        self.curve = make_interp_spline(np.linspace(0.0, 1.0, len(points)), points, k=7)
        self.slope = self.curve.derivative()

    def at(self, radius):
        """Parameter where the flank crosses a circle."""
        return brentq(lambda u: np.hypot(*self.curve(u)) - radius, 0.0, 1.0, xtol=1e-15)


class Mated:
    """Drawn flanks of a pair, the pinion at the origin, the pitch point on the x axis."""

    def __init__(self, pair):
        self.pair = pair
        self.one, self.two = DrawnFlank(pair.pinion), DrawnFlank(pair.wheel)
        self.half_turn = 0.0 if pair.wheel.internal else math.pi
        side = -1 if pair.wheel.internal else 1
        self.centre = np.array([side * pair.centre_distance / M, 0.0])
        self.radii = np.array(pair.pitch_radii) / M
        u, v = self.one.at(self.radii[0]), self.two.at(self.radii[1])
        angles = [math.atan2(*f.curve(w)[::-1]) for f, w in ((self.one, u), (self.two, v))]
        self.start = np.array([u, v, -angles[0], -angles[1]])

    def residual(self, u, v, first, second):
        """Distance of two points of the flanks, and the sine between their tangents."""
        second = second + self.half_turn
        p = turned(first, self.one.curve(u)) - turned(second, self.two.curve(v)) - self.centre
        a, b = turned(first, self.one.slope(u)), turned(second, self.two.slope(v))
        return [*p, (a[0] * b[1] - a[1] * b[0]) / np.hypot(*a) / np.hypot(*b)]

    def contact(self, held, value):
        """Touching flanks (u, v, angles) while one of the four has a value, by continuation."""
        now = self.start.copy()
        free = [i for i in range(4) if i != held]
        for part in np.linspace(now[held], value, 6)[1:]:

            def equations(x, part=part):
                return self.residual(*np.insert(x, held, part))

            solution = root(equations, now[free], tol=1e-14)
            assert np.abs(solution.fun).max() < 1e-12
            now = np.insert(solution.x, held, part)
        return now

    def pitch_point(self, u, first):
        """Intersection of the common normal with the line of centres."""
        point, along = turned(first, self.one.curve(u)), turned(first, self.one.slope(u))
        return point[0] + point[1] * along[1] / along[0]


@pairs
def test_common_normal_passes_the_pitch_point_and_the_ratio_is_constant(pair):
    """Kennedy's theorem on drawn teeth; for a changed centre distance too."""
    mated = Mated(pair)
    roll = np.array(pair.path) / pair.pinion.base_radius
    for part in np.linspace(0.95 * roll[0], 0.95 * roll[1], 8):
        u, _, first, second = mated.contact(2, mated.start[2] + part)
        assert mated.pitch_point(u, first) == pytest.approx(mated.radii[0], abs=1e-9)
        turn = (second - mated.start[3]) * pair.ratio
        assert turn == pytest.approx(part, abs=1e-9)


@pairs
def test_contact_ratio_is_the_turn_from_tip_to_tip_in_pitches(pair):
    mated = Mated(pair)
    # the drawn internal flank runs from its root outside to its tip inside
    begins, ends = mated.contact(1, 1.0)[2], mated.contact(0, 1.0)[2]
    assert pair.contact_ratio == pytest.approx(
        (ends - begins) * pair.pinion.teeth / (2 * math.pi), abs=1e-9
    )
    assert pair.contact_ratio > 1.0


@pytest.mark.parametrize('name', ['nominal', 'farther apart', 'shifted', '25 deg'])
def test_backlash_is_what_the_drawn_teeth_leave(name):
    """A tooth of the pinion on the line of centres is touched on both sides."""
    pair = PAIRS[name]
    wheel = pair.wheel
    between = 2 * abs(Mated(pair).contact(2, 0.0)[3])
    play = (2 * math.pi / wheel.teeth - between) * pair.pitch_radii[1]
    assert pair.backlash == pytest.approx(play, abs=1e-9 * M)
    assert pair.backlash == pytest.approx(0.0, abs=1e-12) or name == 'farther apart'


@pytest.mark.parametrize('name', PAIRS)
def test_thickness_is_that_of_the_drawn_tooth(name):
    for gear in (PAIRS[name].pinion, PAIRS[name].wheel):
        flank = DrawnFlank(gear)
        low, high = sorted((max(gear.root_radius, gear.base_radius), gear.tip_radius))
        for radius in np.linspace(low, high, 5)[1:-1]:
            x, y = flank.curve(flank.at(radius / M))
            drawn = 2 * radius * abs(math.atan2(y, x))
            assert gear.thickness(radius) == pytest.approx(drawn, rel=1e-9)


@pytest.mark.parametrize('shift', [-0.2, 0.0, 0.35])
def test_tooth_is_the_envelope_of_its_rack(shift):
    """[V] Figure 5.11: the flank touches the rack where the normal passes the pitch point."""
    gear = Gear(26, M, shift=shift)
    r, slope = gear.pitch_radius, math.tan(gear.system.pressure_angle)
    for turn in np.linspace(-0.35, 0.1, 10):
        # the rack's flank is x + slope y = level, its reference line x = r + shift m
        offset = r * turn + math.pi * M / 4 + (r + shift * M) * slope
        way = (offset - r * slope) / (1 + slope**2)
        point = turned(-turn, np.array([r + slope * way, way]))
        assert math.atan2(point[1], point[0]) == pytest.approx(
            gear.half_angle(np.hypot(*point)), abs=1e-12
        )


def test_gear_and_space_fill_the_pitch_circle():
    gear = Gear(30, M)
    assert gear.thickness(gear.pitch_radius) == pytest.approx(gear.circular_pitch / 2, rel=1e-15)
    ring, cut = Gear(40, M, shift=0.4, internal=True), Gear(40, M, shift=0.4)
    for radius in (39.8e-3, 41e-3):
        both = ring.thickness(radius) + cut.thickness(radius)
        assert both == pytest.approx(2 * math.pi * radius / 40, rel=1e-14)


def test_outline_closes_around_the_gear():
    gear = Gear(25, M)
    ring = gear.outline(12, angle=0.1) @ (1.0, 1.0j)
    assert ring.size == 25 * 24
    steps = np.angle(np.roll(ring, -1) / ring)
    assert steps.sum() == pytest.approx(2 * math.pi)
    assert np.abs(ring).max() == pytest.approx(gear.tip_radius)
    assert np.abs(ring).min() == pytest.approx(gear.root_radius)


def test_numbers_of_the_book():
    """[V] 5.7, table 5.1 and eq. 5.30."""
    assert (least_teeth(FULL_DEPTH), least_teeth(STUB)) == (18, 14)
    assert len(TOOTH_SYSTEMS) == 7
    assert (STUB.addendum, STUB.dedendum) == (0.8, 1.0)
    gear = Gear(18, M)
    assert gear.pitch_radius == pytest.approx(18e-3)
    assert gear.tip_radius == pytest.approx(20e-3)
    assert gear.root_radius == pytest.approx(15.5e-3)
    assert gear.base_radius == pytest.approx(18e-3 * math.cos(math.radians(20)))


@pytest.mark.parametrize('system', TOOTH_SYSTEMS.values(), ids=TOOTH_SYSTEMS)
def test_undercut_begins_where_the_rack_reaches_past_the_base_circle(system):
    least = least_teeth(system)
    assert Gear(least - 1, M, system).undercut
    gear = Gear(least, M, system)
    assert path_with_rack(gear).start >= -gear.base_radius * math.tan(system.pressure_angle)
    shift = system.addendum - (least - 1) * math.sin(system.pressure_angle) ** 2 / 2
    gear = Gear(least - 1, M, system, shift)
    reach = gear.base_radius * math.tan(system.pressure_angle)
    assert path_with_rack(gear).start == pytest.approx(-reach, rel=1e-12)


def test_a_rack_is_a_wheel_without_end():
    pinion = Gear(24, M)
    ratios = [Pair(pinion, Gear(n, M)).contact_ratio for n in (10**4, 10**5, 10**6)]
    start, end = path_with_rack(pinion)
    errors = (end - start) / pinion.base_pitch - np.array(ratios)
    np.testing.assert_allclose(errors[:-1] / errors[1:], 10.0, rtol=0.02)


def test_centre_distance_is_where_backlash_ends():
    random = np.random.default_rng(5)
    for _ in range(50):
        internal = bool(random.integers(2))
        one = Gear(int(random.integers(18, 40)), M, shift=random.uniform(0.0, 0.4))
        two = Gear(int(random.integers(60, 99)), M, shift=random.uniform(0.3, 0.6),
                   internal=internal)  # fmt: skip
        pair = Pair(one, two)
        side = -1 if internal else 1

        def free(distance, one=one, two=two, side=side):
            cosine = (two.base_radius + side * one.base_radius) / distance
            r1, r2 = one.base_radius / cosine, two.base_radius / cosine
            return 2 * math.pi * r1 / one.teeth - one.thickness(r1) - two.thickness(r2)

        tight = brentq(free, 0.99 * pair.centre_distance, 1.01 * pair.centre_distance, xtol=1e-16)
        assert pair.centre_distance == pytest.approx(tight, rel=1e-12)
        assert Pair(one, two, tight + side * 1e-5).backlash > 0.0
        with pytest.raises(InputError, match='jam'):
            Pair(one, two, tight - side * 1e-5)


@pytest.mark.parametrize('name', ['nominal', 'shifted', 'internal', '25 deg'])
def test_efficiency_is_the_mean_over_the_path_of_contact(name):
    """Moments of normal force and friction about both axes, integrated along the path."""
    pair = PAIRS[name]
    one, two = pair.pinion, pair.wheel
    side = -1 if two.internal else 1
    pitch = one.base_pitch
    start, end = pair.path
    reach = [g.base_radius * math.tan(pair.pressure_angle) for g in (one, two)]

    def torques(s, mu):
        """Of the pinion and on the wheel per unit of normal force; friction turns at s = 0."""
        mu = math.copysign(mu, s)
        first = one.base_radius + mu * (reach[0] + s)
        second = two.base_radius + mu * (reach[1] - side * s)
        return first, second

    def loss(mu):
        """Of power, at constant torque, averaged over a base pitch."""

        def at(s):
            touching = [s + k * pitch for k in range(-2, 3) if start <= s + k * pitch <= end]
            both = np.sum([torques(x, mu) for x in touching], axis=0)
            return both[1] / both[0] * one.base_radius / two.base_radius

        breaks = sorted({(x - start) % pitch + start for x in (0.0, end)})
        return 1.0 - quad(at, start, start + pitch, points=breaks, epsabs=1e-13)[0] / pitch

    errors = [abs(loss(mu) - (1.0 - pair.efficiency(mu))) for mu in (1e-2, 1e-3)]
    assert errors[1] < 1e-5 * 0.2
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.1)
    assert pair.efficiency(0.0) == 1.0


def test_efficiency_with_two_pairs_of_teeth_at_most_in_closed_form():
    """Loss pi mu (1/N2 + 1/N3) (1 - e + e1^2 + e2^2), with the parts e1, e2 of the ratio e."""
    e1, e2 = np.array([-NOMINAL.path.start, NOMINAL.path.end]) / NOMINAL.pinion.base_pitch
    loss = math.pi * 0.05 * (1 / 20 + 1 / 31) * (1 - e1 - e2 + e1**2 + e2**2)
    assert NOMINAL.efficiency(0.05) == pytest.approx(1 - loss, rel=1e-14)


@pytest.mark.sample(1)
@pytest.mark.parametrize('system', ['full 20', 'full 25', 'stub 20'])
def test_tips_of_internal_gears_meet_where_the_drawn_teeth_overlap(system):
    system, n = TOOTH_SYSTEMS[system], 40
    pinion = Gear(n, M, system)
    drawn = pinion.outline(30) @ (1.0, 1.0j)
    verdicts = set()
    for more in range(3, 13):
        wheel = Gear(n + more, M, system, internal=True)
        deepest = 0.0
        # a space of the wheel and a tooth of the pinion on the line of centres, then a pitch on
        for turn in np.linspace(0.0, 2 * math.pi / n, 60):
            at = drawn * np.exp(1j * turn) + more * M / 2
            at = at[np.abs(at) > wheel.tip_radius]
            tooth = 2 * math.pi / wheel.teeth
            angle = np.angle(at) - turn * n / wheel.teeth - tooth / 2
            off = np.abs((angle + tooth / 2) % tooth - tooth / 2)
            halves = [wheel.half_angle(r) for r in np.abs(at)]
            deepest = max(deepest, *((halves - off) * np.abs(at)))
        if overlap := deepest > 1e-7 * M:
            with pytest.raises(InputError, match='meet on their way out'):
                Pair(pinion, wheel)
        else:
            Pair(pinion, wheel)
        verdicts.add(overlap)
    assert verdicts == {True, False}


def test_inverse_of_the_involute_function():
    for angle in (1e-8, 1e-3, 0.0099, 0.0101, 0.3, 1.0, 1.5):
        assert inverse_inv(inv(angle)) == pytest.approx(angle, rel=1e-11)
    assert inverse_inv(0.0) == 0.0


def test_transverse_plane_of_a_helical_gear():
    """A rack's flank, cut normal to the teeth and across the axis."""
    phi, psi = math.radians(20), math.radians(30)
    # normal of the flank: tooth line (axial cos psi, tangential sin psi), height along z
    along = np.array([math.cos(psi), math.sin(psi), 0.0])
    across = np.array([-math.sin(psi), math.cos(psi), 0.0])
    normal = math.cos(phi) * across - math.sin(phi) * np.array([0.0, 0.0, 1.0])
    assert normal @ along == pytest.approx(0.0, abs=1e-15)
    assert transverse(phi, psi) == pytest.approx(math.atan(-normal[2] / normal[1]), rel=1e-14)


@pytest.mark.parametrize(
    ('make', 'sentence'),
    [
        (
            lambda: Pair(Gear(6, M), Gear(60, M)),
            r'undercut up to a profile shift of 0\.6491.*; take more teeth',
        ),
        (lambda: Pair(Gear(8, M), Gear(40, M)), r'; shifts of 0\.5321 and -0\.5321 such modules'),
        (lambda: Pair(Gear(8, M), Gear(16, M)), r'; shifts of 0\.5321 and 0\.0642 .* centre dist'),
        (lambda: Pair(Gear(8, M, shift=-0.1), Gear(8, M, shift=-0.3)), 'take larger ones'),
        (lambda: Gear(2, M), 'three teeth'),
        (lambda: Gear(20, -M), 'module is positive'),
        (lambda: Gear(10, M, shift=1.2), 'pointed'),
        (lambda: Gear(20, M, internal=True), 'tips inside its base circle'),
        (lambda: Pair(Gear(20, M), Gear(30, 2.5e-3)), 'do not mesh'),
        (lambda: Pair(Gear(20, M), Gear(30, M, TOOTH_SYSTEMS['full 25'])), 'pressure angles'),
        (lambda: Pair(Gear(60, M), Gear(60, M, internal=True)), 'more teeth'),
        (lambda: Pair(Gear(60, M, internal=True), Gear(60, M)), 'external teeth'),
        (lambda: Pair(Gear(20, M), Gear(30, M), 0.05 - 1e-5), 'jam'),
        (lambda: Pair(Gear(20, M), Gear(30, M), 0.03), 'no common tangent'),
        (lambda: Pair(Gear(20, M), Gear(30, M), 0.0525), 'separates before the next one engages'),
        (lambda: Pair(Gear(18, M), Gear(40, M, internal=True)), 'reach inside the base circle'),
        (lambda: inverse_inv(-1.0), 'not negative'),
        (lambda: NOMINAL.efficiency(-0.1), 'not negative'),
        (lambda: Gear(20, M).profile_angle(0.01), 'inside the base circle'),
    ],
)
def test_wrong_gears_are_refused_by_name(make, sentence):
    with pytest.raises(InputError, match=sentence):
        make()
