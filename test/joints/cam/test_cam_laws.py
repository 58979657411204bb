"""Laws of motion of cams against the book, the literature, differences and quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from textbook import normalised

from mechanism_sim.errors import InputError
from mechanism_sim.joints.cam import curves
from mechanism_sim.joints.cam.laws import (
    Diagram,
    Eccentric,
    MeasuredLaw,
    Segment,
    check_smoothness,
)

PI = math.pi
CURVES = {
    name: getattr(curves, name)
    for name in (
        'CYCLOIDAL',
        'HARMONIC',
        'HALF_HARMONIC',
        'FOUR_SPLINE',
        'MODIFIED_TRAPEZOID',
        'MODIFIED_SINE',
        'POLYNOMIAL_345',
        'POLYNOMIAL_4567',
    )
} | {'SPLINE': curves.spline_curve([0, 0.2, 0.5, 0.7, 1], [0, 0.1, 0.45, 0.8, 1])}

#: the central difference of the first derivative with an error of the eighth order
EIGHTH = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


def diagram(curve, lift=0.4):
    """The segments of [V] figure 4.13."""
    return Diagram(
        [Segment(0, PI / 2, lift, curve), Segment(5 * PI / 4, 7 * PI / 4, -lift, curve)]
    )


def away_from_breaks(law, distance):
    x = np.linspace(law.breaks[0], law.breaks[-1], 400)
    return x[np.abs(x[:, None] - law.breaks).min(axis=1) > distance]


LAWS = {name: diagram(curve) for name, curve in CURVES.items()} | {
    'eccentric': Eccentric(4.0, 1.0),
    'measured': MeasuredLaw(np.linspace(0.3, 6.2, 24), np.sin(np.linspace(0.3, 6.2, 24)) ** 2),
}


@pytest.mark.parametrize('name', LAWS)
def test_derivatives_are_those_of_differences_of_the_eighth_order(name):
    law, h = LAWS[name], 2e-3
    x = away_from_breaks(law, 4 * h)
    for order in range(3):
        near = law(x[:, None] + h * np.arange(-4, 5), order)
        exact = law(x, order + 1)
        assert near @ EIGHTH / h == pytest.approx(exact, rel=1e-7, abs=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize('name', CURVES)
def test_curves_rise_from_0_to_1_and_are_the_integrals_of_their_derivatives(name):
    curve = CURVES[name]
    assert curve([0.0, 1.0]) == pytest.approx([0, 1], abs=1e-14)
    for order in (1, 2, 3):
        for a, b in zip(curve.breaks[:-1], curve.breaks[1:], strict=True):
            area = quad(lambda x, k=order: float(curve(x, k)), a, b, epsabs=1e-12)[0]
            rise = curve(b, order - 1, left=True) - curve(a, order - 1)
            assert area == pytest.approx(rise, abs=1e-10)


def test_numbers_of_the_book():
    """[V] 4.4.3 and 4.4.5."""
    cycloid, harmonic, spline = (
        diagram(CURVES[n], lift=2.5) for n in ('CYCLOIDAL', 'HARMONIC', 'FOUR_SPLINE')
    )
    quarter, half = PI / 8, PI / 4
    assert normalised(cycloid, quarter) == pytest.approx(0.0908451, abs=5e-8)
    assert normalised(harmonic, quarter) == pytest.approx(0.146447, abs=5e-7)
    assert normalised(spline, quarter) == pytest.approx(0.0625)
    assert normalised(cycloid, quarter, 2) == pytest.approx(6.28319, abs=5e-6)
    assert normalised(harmonic, quarter, 2) == pytest.approx(3.48943, abs=5e-6)
    assert normalised(cycloid, half, 1) == pytest.approx(2)
    assert normalised(harmonic, half, 1) == pytest.approx(PI / 2)
    # 4.62 and 4.63 take half the angle
    assert normalised(spline, half, 1) / 2 == pytest.approx(1.5)
    assert normalised(spline, np.nextafter(half, 0), 2) / 4 == pytest.approx(3)
    assert normalised(spline, half, 2) / 4 == pytest.approx(-3)


def test_normalised_returns_are_rises_run_backwards():
    """[V] 4.24 to 4.26, for a curve that is not its own mirror image."""
    law, x = diagram(CURVES['SPLINE']), np.linspace(0.01, 0.99, 50)
    for order in range(4):
        rise = normalised(law, x * PI / 2, order)
        back = normalised(law, 7 * PI / 4 - x * PI / 2, order)
        assert rise == pytest.approx(CURVES['SPLINE'](x, order), abs=1e-9)
        assert back == pytest.approx(rise, abs=1e-9)
    assert normalised(law, [2.0, 6.0]) == pytest.approx([1, 0])
    assert normalised(law, [2.0, 6.0], 1) == pytest.approx([0, 0])


@pytest.mark.parametrize(
    ('name', 'peaks'),
    [
        ('CYCLOIDAL', (2, 2 * PI, 4 * PI**2)),
        ('HARMONIC', (PI / 2, PI**2 / 2, PI**3 / 2)),
        ('HALF_HARMONIC', (PI / 2, PI**2 / 4, PI**3 / 8)),
        ('FOUR_SPLINE', (3, 12, 24)),
        ('MODIFIED_TRAPEZOID', (2, 8 * PI / (2 + PI), 32 * PI**2 / (2 + PI))),
        ('MODIFIED_SINE', (1.7596, 5.52796, 69.4664)),
        ('POLYNOMIAL_345', (15 / 8, 10 / math.sqrt(3), 60)),
        ('POLYNOMIAL_4567', (2.1875, 84 * math.sqrt(5) / 25, 52.5)),
    ],
)
def test_peaks_are_those_of_the_literature(name, peaks):
    x = np.linspace(0, 1, 100_001)
    found = [np.abs(CURVES[name](x, k)).max() for k in (1, 2, 3)]
    assert found == pytest.approx(peaks, rel=1e-5)


def test_the_four_splines_solve_the_sixteen_conditions_of_the_book():
    """[V] 4.38 to 4.41 for a quick rise and the same of a slow return, as a linear system."""
    lift, spans = 0.03, [(0.2, 1.1), (2.0, 4.9)]
    law = Diagram(
        [
            Segment(start, end, rise, CURVES['FOUR_SPLINE'])
            for (start, end), rise in zip(spans, (lift, -lift), strict=True)
        ]
    )

    def row(x, order):
        return [math.perm(k, order) * x ** (k - order) if k >= order else 0.0 for k in range(4)]

    for (start, end), levels in zip(spans, ((0.0, lift), (lift, 0.0)), strict=True):
        middle = 0.5 * (start + end)
        for outer, level in zip((start, end), levels, strict=True):
            rows = [row(outer, 0), row(outer, 1), row(outer, 2), row(middle, 0)]
            cubic = np.linalg.solve(rows, [level, 0.0, 0.0, 0.5 * lift])
            x = np.linspace(outer, middle, 21)[1:-1]
            for order in range(4):
                wanted = [np.dot(row(a, order), cubic) for a in x]
                assert law(x, order) == pytest.approx(wanted, abs=1e-11)


def test_laws_of_a_sliding_cam_go_from_one_end_of_its_stroke_to_the_other():
    curve = CURVES['HARMONIC']
    law = Diagram(
        [Segment(0.01, 0.03, 0.005, curve), Segment(0.05, 0.06, -0.002, curve)], reciprocating=True
    )
    assert law([0.01, 0.03, 0.05, 0.06]) == pytest.approx([0, 0.005, 0.005, 0.003])
    assert law(0.06, 2, left=True) == pytest.approx(0.001 * (PI / 0.01) ** 2)
    # what jumps inside the stroke only
    jumps = [str(j) for j in check_smoothness(law)]
    assert [j[: j.index(' from')] for j in jumps] == [
        'at 30 mm the acceleration jumps',
        'at 50 mm the acceleration jumps',
    ]
    with pytest.raises(InputError, match='65 mm lies beyond the stroke of the cam, from 10 to 60'):
        law([0.02, 0.065])
    with pytest.raises(InputError, match=r'segment from 10 to 30 mm overlaps .* begins at 20 mm'):
        Diagram([Segment(0.01, 0.03, 1, curve), Segment(0.02, 0.04, 1, curve)], reciprocating=True)
    x = np.linspace(0, 9, 12)  # longer than a turn is
    measured, at = MeasuredLaw(x, np.cos(x), degree=3, reciprocating=True), np.linspace(0, 9, 77)
    assert measured(at) == pytest.approx(CubicSpline(x, np.cos(x))(at), abs=1e-12)
    assert check_smoothness(measured, 2) == []


def test_the_eccentric_is_a_slider_crank():
    """[V] 4.7: the loop of eccentricity, radius and displacement is closed."""
    law, angle = Eccentric(4.0, 1.0), np.linspace(-7, 7, 101)
    height = 3.0 + law(angle)
    assert np.hypot(-np.cos(angle), height - np.sin(angle)) == pytest.approx(4.0)
    assert [law(-PI / 2), law(PI / 2)] == pytest.approx([0, 2])
    assert check_smoothness(law, 3) == []


def test_splines_are_those_of_scipy_with_the_ends_asked_for():
    x, y, at = [0, 0.3, 0.6, 1], [0, 0.2, 0.9, 1], np.linspace(0, 1, 77)
    for ends in ('natural', 'clamped', 'not-a-knot', ((2, 0.0), (1, 0.5))):
        curve, other = curves.spline_curve(x, y, ends), CubicSpline(x, y, bc_type=ends)
        for order in range(3):
            assert curve(at, order) == pytest.approx(other(at, order), abs=1e-12)
    assert curve(1.0, 1, left=True) == pytest.approx(0.5)


def test_a_measured_law_goes_through_its_points_and_is_smooth():
    truth = diagram(CURVES['POLYNOMIAL_4567'])
    x = np.linspace(0, 2 * PI, 181)[:-1]
    law = MeasuredLaw(x, truth(x))
    assert law(x) == pytest.approx(truth(x), abs=1e-14)
    assert check_smoothness(law, 3) == []
    between = x + PI / 180
    for order, error in ((0, 1e-6), (1, 1e-4), (2, 1e-2)):
        exact = truth(between, order)
        assert law(between, order) == pytest.approx(exact, abs=error * np.abs(exact).max())


@pytest.mark.parametrize(
    ('name', 'said'),
    [
        ('CYCLOIDAL', []),
        ('MODIFIED_TRAPEZOID', []),
        ('POLYNOMIAL_345', []),
        (
            'HARMONIC',
            [
                'at 0 deg the acceleration jumps from 0 to 0.8, by 0.8',
                'at 90 deg the acceleration jumps from -0.8 to 0, by 0.8',
                'at 225 deg the acceleration jumps from 0 to -0.8, by -0.8',
                'at 315 deg the acceleration jumps from 0.8 to 0, by -0.8',
            ],
        ),
        (
            'FOUR_SPLINE',
            [
                'at 45 deg the acceleration jumps from 1.94537 to -1.94537, by -3.89073',
                'at 270 deg the acceleration jumps from -1.94537 to 1.94537, by 3.89073',
            ],
        ),
    ],
)
def test_jumps_are_named_with_their_angle_and_derivative(name, said):
    assert [str(jump) for jump in check_smoothness(diagram(CURVES[name]))] == said


def test_the_jerk_is_looked_at_if_asked_for():
    assert {j.order for j in check_smoothness(diagram(CURVES['CYCLOIDAL']), 3)} == {3}
    assert check_smoothness(diagram(CURVES['POLYNOMIAL_4567']), 3) == []
    velocity = [j for j in check_smoothness(diagram(CURVES['HALF_HARMONIC'])) if j.order == 1]
    assert [math.degrees(j.angle) for j in velocity] == pytest.approx([90, 225])


@given(
    st.lists(st.tuples(st.floats(0.2, 1), st.floats(0, 1), st.integers(-9, 9)), min_size=2),
    st.floats(-7, 7),
    st.integers(0, 8),
)
def test_any_segments_make_a_periodic_law_of_the_levels_given(parts, first, which):
    curve = list(CURVES.values())[which]
    turn = sum(a + b for a, b, _ in parts) * 1.01
    rises = [r for *_, r in parts]
    rises[-1] -= sum(rises)
    starts, segments = first, []
    for (span, dwell, _), rise in zip(parts, rises, strict=True):
        end = starts + span * 2 * PI / turn
        segments.append(Segment(starts, end, rise, curve))
        starts = end + dwell * 2 * PI / turn
    law = Diagram(segments)
    assert not [j for j in check_smoothness(law, 1, 1e-7) if which != 2 or j.order == 0]
    for segment in segments:
        rise = law(segment.end, 0, left=True) - law(segment.start)
        assert rise == pytest.approx(segment.rise, abs=1e-12)
    x = np.linspace(first, first + 2 * PI, 50)[1:-1]
    assert law(x + 4 * PI) == pytest.approx(law(x), abs=1e-9)
    levels = [law(s.start) for s in segments]
    assert min(levels) == pytest.approx(0, abs=1e-12)
    assert law.lift == pytest.approx(max(levels))


RISE = Segment(0, 2, 1, CURVES['HARMONIC'])


@pytest.mark.parametrize(
    ('segments', 'said'),
    [
        ([], 'needs a segment'),
        ([RISE], 'does not return: its rises add up to 1'),
        ([RISE, Segment(1.5, 3, -1, RISE.curve)], 'overlaps the next one, which begins at 85.94'),
        ([RISE, Segment(4, 7, -1, RISE.curve)], 'overlaps the next one, which begins at 360 deg'),
        ([RISE, Segment(4, 3, -1, RISE.curve)], 'from 229.183 to 171.887 deg has no positive'),
        ([RISE, Segment(4, math.inf, -1, RISE.curve)], 'finite'),
    ],
)
def test_segments_that_make_no_diagram_are_refused(segments, said):
    with pytest.raises(InputError, match=said):
        Diagram(segments)


def test_points_that_make_no_law_are_refused():
    with pytest.raises(InputError, match='increase'):
        MeasuredLaw([0, 1, 2, 2, 3, 4], np.zeros(6))
    with pytest.raises(InputError, match='6 angles at least'):
        MeasuredLaw([0, 1, 2], np.zeros(3))
    with pytest.raises(InputError, match='is odd'):
        MeasuredLaw(np.arange(6.0), np.zeros(6), degree=4)
    with pytest.raises(InputError, match=r'from \(0, 0\) to \(1, 1\)'):
        curves.spline_curve([0, 1], [0, 2])
    with pytest.raises(InputError, match='places of a spline increase'):
        curves.spline_curve([0, 0.7, 0.5, 1], [0, 0.2, 0.4, 1])
    with pytest.raises(InputError, match='eccentricity'):
        Eccentric(1.0, 2.0)
