"""Grashof's rule, limits and dead points, against linkages that are moved and looked at."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar
from textbook import slider_position, slider_transmission_angle, transmission_angle

from mechanism_sim.linkages.four_bar import FourBar, SliderCrank
from mechanism_sim.linkages.grashof import (
    change_points,
    classify,
    crank_limits,
    crank_turns,
    dead_points,
    excess,
    full_turns,
    limits,
    rocker_limits,
    swing,
    time_ratio,
    transmission_range,
)

COUNT = 10_000


def drawn_at_random(count, seed=11):
    """Four joints in the plane, and so linkages that can be assembled: (4, count) complex."""
    random = np.random.default_rng(seed)
    return random.standard_normal((4, count)) + 1j * random.standard_normal((4, count))


def lengths_of(joints):
    """Ground, crank, coupler, rocker between crank pivot, crank pin, rocker pin, rocker pivot."""
    o2, a, b, o4 = joints
    return np.abs([o4 - o2, a - o2, b - a, b - o4])


def closes(lengths, th2):
    """True if circles about crank pin and rocker pivot meet."""
    ground, crank, coupler, rocker = lengths
    d = np.abs(ground - crank * np.exp(1j * th2))
    return (d <= coupler + rocker) & (coupler <= d + rocker) & (rocker <= d + coupler)


def ends_of_motion(lengths, start):
    """Crank angles up to which a linkage can be turned from `start`, back and forth; (2, N).

    Steps of half a degree that come by 0 and pi, then bisection; a full turn ends at start + 2 pi.
    """
    found = []
    for direction in (-1.0, 1.0):
        reached, stuck = start.copy(), np.zeros(start.shape, dtype=bool)
        beyond = start.copy()
        grid = np.floor(direction * start * 360.0 / np.pi) * direction * np.pi / 360.0
        for k in range(1, 721):
            beyond = np.where(stuck, beyond, grid + direction * k * np.pi / 360.0)
            stuck |= ~closes(lengths, beyond)
            reached = np.where(stuck, reached, beyond)
            if stuck.all():
                break
        inside, outside = reached, beyond
        for _ in range(60):
            middle = 0.5 * (inside + outside)
            good = closes(lengths, middle)
            inside, outside = np.where(good, middle, inside), np.where(good, outside, middle)
        found.append(np.where(stuck, inside, start + direction * 2.0 * np.pi))
    return found


def winding(z):
    """Turns that vectors make over a closed path (N, path)."""
    steps = np.angle(z[:, 1:] / z[:, :-1])
    assert np.abs(steps).max() < 2.5
    return (steps.sum(axis=1) / (2.0 * np.pi)).round().astype(int)


def turns_by_motion(joints, samples=1001):
    """Full turns of crank, coupler, rocker against the ground while a linkage runs its circuit.

    Where the crank turns fully, one turn on the side of the diagonal on which it was drawn; else
    from end to end, and back with the pin on the other side.
    """
    lengths = lengths_of(joints)
    ground, crank, coupler, rocker = (x[:, None] for x in lengths)
    o2, a, b, o4 = joints
    base = (o4 - o2) / np.abs(o4 - o2)
    drawn, pin = (a - o2) / base, (b - o2) / base
    start = np.angle(drawn)
    low, high = ends_of_motion(lengths, start)
    full = high - low > 2.0 * np.pi
    side = np.sign(((lengths[0] - drawn).conj() * (pin - drawn)).imag)
    phase = np.linspace(0.0, 2.0 * np.pi, samples)
    # slow about 0 and pi, where the diagonal is the longest or shortest
    round_ = phase - 0.5 * np.sin(2.0 * phase)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    fro = middle[:, None] - half[:, None] * np.cos(phase)
    th2 = np.where(full[:, None], round_, fro)
    flip = np.where(full[:, None] | (phase < np.pi), 1.0, -1.0)
    pin_a = crank * np.exp(1j * th2)
    diagonal = ground - pin_a
    d = np.abs(diagonal)
    cosine = np.clip((d**2 + coupler**2 - rocker**2) / (2.0 * d * coupler), -1.0, 1.0)
    arm = coupler * diagonal / d * np.exp(1j * side[:, None] * flip * np.arccos(cosine))
    return np.array([winding(z) for z in (pin_a, arm, pin_a + arm - ground)]) != 0


@pytest.mark.parametrize('count', [500, pytest.param(COUNT, marks=pytest.mark.slow)])
def test_random_four_bars_move_as_they_are_classified(count):
    joints = drawn_at_random(count)
    lengths = lengths_of(joints)
    nearest = (np.abs(excess(lengths)) / lengths.sum(axis=0)).min()
    assert nearest < 0.1 / count  # some nearly change
    blocks = np.array_split(np.arange(count), count // 250)
    moved = np.concatenate([turns_by_motion(joints[:, b]) for b in blocks], axis=1)
    assert (moved == full_turns(lengths)).all()
    as_moved = {
        'double-crank': (True, True, True),
        'crank-rocker': (True, False, False),
        'double-rocker': (False, True, False),
        'rocker-crank': (False, False, True),
        'triple-rocker': (False, False, False),
    }
    names = classify(lengths)
    assert {*names} == {*as_moved}
    for name, turns in as_moved.items():
        of_it = names == name
        assert (moved[:, of_it] == np.array(turns)[:, None]).all()
        assert of_it.sum() > 0.03 * count


def test_neighbours_turn_fully_against_each_other_as_their_triangles_show():
    """Every hinge of every linkage swept over the circle: the shortest link turns at both ends."""
    lengths = lengths_of(drawn_at_random(COUNT, 12))
    th = np.linspace(0.0, 2.0 * np.pi, 73)[:, None]
    order = (0, 1, 2, 3)  # round the loop: ground, crank, coupler, rocker
    for i in order:
        one, other, near, far = (lengths[[*order, *order][i + k]] for k in range(4))
        swept = closes((one, other, near, far), th).all(axis=0)
        hinge = limits(one, other, near, far)
        np.testing.assert_array_equal(swept, (hinge[0] == 0.0) & (hinge[1] == np.pi))
        shortest = lengths.argmin(axis=0)
        grashof = excess(lengths) > 0.0
        at_hinge = (shortest == i) | (shortest == (i + 1) % 4)
        np.testing.assert_array_equal(swept, grashof & at_hinge)


def test_limits_of_crank_and_rocker_are_where_the_motion_ends():
    joints = drawn_at_random(2000, 13)
    lengths = lengths_of(joints)
    o2, a, b, o4 = joints
    # the rocker seen from its pivot is the crank of the linkage seen in a mirror
    ways = (
        (lengths, np.angle((a - o2) / (o4 - o2)), crank_limits, 0.0),
        (lengths[[0, 3, 2, 1]], np.angle((b - o4) / (o2 - o4)), rocker_limits, np.pi),
    )
    for own, start, function, zero in ways:
        low, high = ends_of_motion(own, start)
        for k in range(2000):
            found = function(FourBar(*lengths[:, k]))
            least, greatest = sorted(abs(zero - x) for x in found)
            reached = high[k] - low[k]
            if reached > 2.0 * np.pi:
                assert (least, greatest) == (0.0, np.pi)
                continue
            if least == 0.0:
                expected = (-greatest, greatest)
            elif greatest == np.pi:
                expected = (least, 2.0 * np.pi - least)
            else:
                expected = (least, greatest) if np.sin(start[k]) > 0 else (-greatest, -least)
            shift = 2.0 * np.pi * round((0.5 * (low[k] + high[k] - sum(expected))) / (2.0 * np.pi))
            assert low[k] - shift == pytest.approx(expected[0], abs=1e-6)
            assert high[k] - shift == pytest.approx(expected[1], abs=1e-6)
            assert swing(found) == pytest.approx(reached, abs=2e-6)


def test_figure_1_15_one_chain_and_its_four_inversions():
    """The loop s-p-q-l of 1, 3.5, 4 and 5, lengths chosen so that s + l < p + q."""
    loop = [1.0, 3.5, 4.0, 5.0]
    found = {}
    for i, frame in enumerate(loop):
        ground, crank, coupler, rocker = loop[i:] + loop[:i]
        found[frame] = str(classify([ground, crank, coupler, rocker]))
        mirrored = str(classify([ground, rocker, coupler, crank]))
        swapped = {'crank-rocker': 'rocker-crank', 'rocker-crank': 'crank-rocker'}
        assert mirrored == swapped.get(found[frame], found[frame])
    assert found[1.0] == 'double-crank'
    assert found[4.0] == 'double-rocker'
    assert {found[3.5], found[5.0]} == {'crank-rocker', 'rocker-crank'}


@pytest.mark.parametrize(
    ('lengths', 'name', 'lines'),
    [
        ((4.0, 1.0, 6.0, 5.0), 'crank-rocker', ()),  # [V] 2.3.7 and A.4.2
        ((4.0, 1.0, 7.0, 3.0), 'triple-rocker', ()),  # [V] Figure 2.11
        ((1.0, 4.0, 5.0, 6.0), 'double-crank', ()),
        ((4.0, 5.0, 6.0, 1.0), 'rocker-crank', ()),
        ((4.0, 5.0, 1.0, 6.0), 'double-rocker', ()),
        ((0.3, 0.1, 0.3, 0.1), 'change point', (0.0, np.pi)),  # parallelogram
        ((2.0, 2.0, 1.0, 1.0), 'change point', (0.0,)),  # kite
        ((1.0, 2.0, 2.0, 1.0), 'change point', (0.0, np.pi)),
        ((1.0, 1.0, 1.0, 1.0), 'change point', (0.0, np.pi)),  # rhombus
        ((0.5, 0.1, 0.2, 0.4), 'change point', (np.pi,)),
        ((4.0, 1.0, 5.0, 2.0), 'change point', (0.0,)),
        ((1.0, 9.0, 1.0, 1.0), 'no linkage', ()),
        ((3.0, 1.0, 1.0, 1.0), 'no linkage', (0.0,)),  # a line that cannot move
    ],
)
def test_classes_and_change_points(lengths, name, lines):
    f = FourBar(*lengths)
    assert classify(lengths) == name
    if name != 'no linkage':
        assert change_points(f) == lines
    assert crank_turns(f) == (name in ('crank-rocker', 'double-crank'))
    turning = {'double-crank': 3, 'crank-rocker': 1, 'double-rocker': 1, 'rocker-crank': 1}
    assert sum(full_turns(lengths)) == turning.get(name, 0)


def test_a_change_point_is_crossed_by_either_branch():
    """At the crank angle that is named both branches meet, and nowhere else."""
    for lengths in permutations((0.5, 0.1, 0.2, 0.4)):
        f = FourBar(*lengths)
        assert classify(lengths) == 'change point'
        low, high = crank_limits(f)
        th2 = np.linspace(low, high, 1001)
        with np.errstate(invalid='ignore'):
            bent = np.sin(transmission_angle(f, th2))
        (at,) = change_points(f)
        assert np.sin(transmission_angle(f, np.array(at))) == pytest.approx(0.0, abs=1e-7)
        assert (bent[1:-1] > 1e-4).all()


def test_figure_2_11_limits_of_the_triple_rocker():
    """The book says from pi/2 to 3 pi/2; the crank goes a little further."""
    low, high = crank_limits(FourBar(4.0, 1.0, 7.0, 3.0))
    assert low == pytest.approx(np.arccos(1.0 / 8.0))
    assert np.degrees(low) == pytest.approx(82.8192, abs=1e-4)
    assert high == np.pi


def test_problem_2_17_double_rocker():
    """Ground 10, arms 7, coupler 1 cm: the coupler can turn, and arm 1 rocks by 16.43 deg."""
    f = FourBar(0.10, 0.07, 0.01, 0.07)
    assert classify(f.lengths) == 'double-rocker'
    low, high = crank_limits(f)
    # triangles of 10, 7 and 7 - 1, or 7 + 1
    assert np.cos(low) == pytest.approx((100.0 + 49.0 - 36.0) / 140.0)
    assert np.cos(high) == pytest.approx((100.0 + 49.0 - 64.0) / 140.0)
    assert np.degrees(swing(crank_limits(f))) == pytest.approx(16.4345, abs=1e-4)


SIDES = st.floats(0.1, 1.0)


def as_drawn(a, b, c, d):
    """Lengths of three sides of a quadrilateral and of the fourth, which closes them."""
    return FourBar(abs(a + b * np.exp(1j * d) + c * np.exp(2.1j * d)), a, b, c)


@given(SIDES, SIDES, SIDES, st.floats(0.2, 2.8), st.sampled_from(['open', 'crossed']))
def test_dead_points_are_where_the_rocker_turns_round(a, b, c, bend, branch):
    f = FourBar(*as_drawn(a, b, c, bend).lengths, branch)
    ground, crank, coupler, rocker = f.lengths
    for th2, folded in zip(dead_points(f), (False, True), strict=True):
        reach = abs(coupler - crank) if folded else coupler + crank
        triangle = ground <= reach + rocker and reach <= ground + rocker
        triangle = triangle and rocker <= ground + reach
        if np.isnan(th2):
            assert not triangle or reach < 1e-9
            continue
        assert triangle
        th3, th4 = f.positions(np.array(th2))
        if abs(np.sin(th3 - th4)) < 1e-3:
            continue  # the crank locks here too
        assert np.cos(th3 - th2) == pytest.approx(-1.0 if folded else 1.0, abs=1e-9)
        _, w4 = f.rates(np.array(th2), np.array(1.0), th3, th4)
        assert abs(w4) < 1e-5 * crank / rocker / abs(np.sin(th3 - th4))


@pytest.mark.parametrize('branch', ['open', 'crossed'])
def test_time_ratio_and_swing_of_the_books_crank_rocker_by_its_motion(branch):
    f = FourBar(4.0, 1.0, 6.0, 5.0, branch)
    th2 = np.linspace(0.0, 2.0 * np.pi, 100_001)
    th4 = np.unwrap(f.positions(th2)[1])
    low, high = th4.min(), th4.max()
    assert swing(rocker_limits(f)) == pytest.approx(high - low, abs=1e-8)
    forward = (th2[th4.argmax()] - th2[th4.argmin()]) % (2.0 * np.pi)
    longer = max(forward, 2.0 * np.pi - forward)
    assert time_ratio(f) == pytest.approx(longer / (2.0 * np.pi - longer), abs=1e-4)
    assert sorted(np.mod(dead_points(f), 2.0 * np.pi)) == pytest.approx(
        sorted(th2[[th4.argmin(), th4.argmax()]]), abs=1e-4
    )


def test_only_a_crank_rocker_has_a_time_ratio():
    assert np.isnan(time_ratio(FourBar(1.0, 4.0, 5.0, 6.0)))
    assert time_ratio(FourBar(np.sqrt(17.0), 1.0, 4.0, np.sqrt(2.0))) > 1.0
    # dead points half a turn apart: (b + a)^2 + (b - a)^2 belong to one chord of the rocker
    g, a, c = 2.0, 0.4, 1.0
    b = np.sqrt(g**2 + a**2 - c**2)
    assert time_ratio(FourBar(g, a, b, c)) == pytest.approx(1.0, abs=1e-12)


def test_transmission_angle_is_the_angle_between_coupler_and_rocker():
    lengths = lengths_of(drawn_at_random(500, 14))
    for k in range(500):
        f = FourBar(*lengths[:, k])
        low, high = crank_limits(f)
        th2 = np.linspace(low, high, 2001)
        if not crank_turns(f):
            th2 = np.clip(th2, low + 1e-12, high - 1e-12)
        th3, th4 = f.positions(th2)
        angle = np.abs(np.angle(np.exp(1j * (th3 - th4))))  # from B: to A is -u3, to O4 is -u4
        mu = transmission_angle(f, th2)
        good = np.isfinite(mu) & np.isfinite(th3)
        assert good[1:-1].all()
        assert np.abs(mu - angle)[good].max() < 1e-6
        least, greatest = transmission_range(f)
        assert np.nanmin(mu) == pytest.approx(least, abs=2e-5)
        assert np.nanmax(mu) == pytest.approx(greatest, abs=2e-5)


# --- slider-crank -------------------------------------------------------------------------------


@given(st.floats(0.1, 2.0), st.floats(0.1, 2.0), st.floats(-1.5, 1.5))
def test_slider_cranks_turn_and_end_where_their_motion_does(crank, rod, offset):
    s = SliderCrank(crank, rod, offset)
    th2 = np.linspace(-np.pi, np.pi, 721)
    reached = np.isfinite(slider_position(s, th2))
    spare = abs(rod - crank) - abs(offset)
    if abs(spare) > 1e-9:
        assert (s.turns == 'crank') == reached.all()
    low, high = s.crank_limits()
    if np.isnan(low):
        assert not reached.any()
        return
    sine = np.sin(th2)
    inside = (sine > low + 1e-9) & (sine < high - 1e-9)
    assert reached[inside].all()
    assert not reached[(sine < low - 1e-9) | (sine > high + 1e-9)].any()
    angles = slider_transmission_angle(s, np.arcsin(np.linspace(low, high, 101)))[1:-1]
    least, greatest = s.transmission_range()
    assert least <= angles.min() + 1e-7
    assert greatest >= angles.max() - 1e-7
    # the rod swept instead of the crank: the same linkage with the two exchanged
    swept = np.isfinite(slider_position(SliderCrank(rod, crank, offset), th2)).all()
    if abs(spare) > 1e-9:
        assert (s.turns == 'rod') == swept


@given(st.floats(0.1, 1.0), st.floats(0.1, 3.0), st.floats(-0.95, 0.95))
def test_stroke_and_time_ratio_of_a_slider_crank_by_its_motion(crank, longer, part):
    rod = crank + longer
    s = SliderCrank(crank, rod, part * longer)
    th2 = np.linspace(0.0, 2.0 * np.pi, 2001)
    x = slider_position(s, th2)

    def extreme(sign, near):
        found = minimize_scalar(
            lambda t: sign * slider_position(s, t), bounds=(near - 0.01, near + 0.01),
            method='bounded', options={'xatol': 1e-11},
        )  # fmt: skip
        return found.x, float(slider_position(s, found.x))

    (far_at, far), (near_at, near) = extreme(-1.0, th2[x.argmax()]), extreme(1.0, th2[x.argmin()])
    assert s.stroke == pytest.approx(far - near, abs=1e-9)
    stretched, folded = s.dead_points()
    for found, seen in ((stretched, far_at), (folded, near_at)):
        assert np.exp(1j * found) == pytest.approx(np.exp(1j * seen), abs=1e-4)
    stroke = (near_at - far_at) % (2.0 * np.pi)
    slower = max(stroke, 2.0 * np.pi - stroke)
    assert s.time_ratio == pytest.approx(slower / (2.0 * np.pi - slower), abs=1e-3)


def test_slider_crank_of_the_book():
    """[V] 2.3.3: r3/r2 = 4, in line: stroke of two cranks, dead points at 0 and pi."""
    s = SliderCrank(1.0, 4.0)
    assert s.turns == 'crank'
    assert s.stroke == pytest.approx(2.0)
    assert s.dead_points() == pytest.approx((0.0, np.pi))
    assert s.time_ratio == pytest.approx(1.0)
    # rod square to the slider's line at most by asin(r2/r3)
    assert np.pi / 2.0 - s.transmission_range()[0] == pytest.approx(np.arcsin(0.25))
    at = brentq(lambda t: float(slider_transmission_angle(s, t)) - np.pi / 2.0, -0.5, 0.6)
    assert at == pytest.approx(0.0, abs=1e-12)


def test_slider_cranks_that_do_not_turn():
    assert SliderCrank(1.0, 1.2, 0.5).turns == 'none'
    assert SliderCrank(2.0, 1.2, 0.5).turns == 'rod'
    assert SliderCrank(1.0, 1.0).turns == 'both'
    assert np.isnan(SliderCrank(1.0, 1.2, 0.5).stroke)
    assert np.isnan(SliderCrank(0.1, 0.2, 0.5).crank_limits()).all()
