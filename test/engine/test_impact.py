"""Impacts with friction: each law against a second route, and what each does to the energy."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from blows import ImpactLaw, energy_change, simultaneous_impact, single_impact
from enumeration import newton_impulses
from hypothesis import assume, example, given
from hypothesis import strategies as st
from running import ROOT
from scipy.integrate import solve_ivp
from scipy.optimize import nnls

import mechanism_sim as ms
from mechanism_sim.engine.contact.impact import (
    ContactImpulse,
    Hypothesis,
    jam,
)
from mechanism_sim.numerics.complementarity import Grip, solve_frictional_lcp

NEWTON, POISSON, STRONGE = Hypothesis
INF = math.inf


def blow_of(A, v, law):
    return single_impact(A[0][0], A[0][1], A[1][1], v[0], v[1], law)


def rates_after(A, v, impulses):
    return np.asarray(v) + np.asarray(A) @ np.asarray(impulses)


def kinetic(A, v):
    """Kinetic energy of the motion that the contact feels."""
    return 0.5 * v @ np.linalg.solve(A, v)


def rounding(A, v, impulses):
    """Energy that rounding of the impulses may feign."""
    P = np.abs(impulses)
    return 1e-12 * (P @ (np.abs(v) + np.abs(A) @ P) + kinetic(A, v))


def random_impacts(n, seed):
    """A (2, 2), closing rates (2,), e and mu of n single contacts."""
    rng = np.random.default_rng(seed)
    for _ in range(n):
        J = rng.normal(size=(2, 2))
        v = rng.normal(size=2)
        v[0] = -abs(v[0])
        yield J @ J.T, v, float(rng.uniform(0.0, 1.0)), float(rng.uniform(0.0, 2.0))


def random_groups(n, m, seed, columns=None, apart=0.0):
    """A (2m, 2m) and closing rates (2m,) of n groups of m contacts, and the generator.

    `columns` is the number of freedoms; `apart` makes the contacts more independent.
    """
    rng = np.random.default_rng(seed)
    for _ in range(n):
        J = rng.normal(size=(2 * m, columns or 2 * m + 1))
        v = J @ (w := rng.normal(size=J.shape[1]))
        J[:m] *= -np.sign(v[:m, None])
        A = J @ J.T
        yield A + apart * np.diag(A.diagonal()), J @ w, rng


# --- one contact: the path of the impulses ---------------------------------------------------

# Ann, Ant, Att, vn, vt, mu of every way to go
PATHS = {
    'slips through': (2.0, 0.5, 3.0, -1.0, 4.0, 0.3),
    'slips through, pressed by friction': (2.0, 0.9, 1.0, -1.0, 3.0, 0.4),
    'slips away faster': (2.0, -1.5, 2.0, -1.0, -1.0, 0.4),
    'sticks in compression': (2.0, 0.4, 3.0, -1.0, 0.5, 0.6),
    'sticks in restitution': (2.0, 0.4, 3.0, -1.0, 0.8, 0.5),
    'sticks in restitution, backwards': (2.0, -0.4, 3.0, -1.0, -0.8, 0.5),
    'turns in compression': (2.0, 1.2, 2.0, -1.0, -0.3, 0.3),
    'turns in restitution': (2.0, 1.2, 2.0, -1.0, -1.0, 0.3),
    'sticks from the start': (2.0, 0.4, 3.0, -1.0, 0.0, 0.5),
    'slips from rest': (2.0, 1.2, 2.0, -1.0, 0.0, 0.3),
    'jams': (1.0, 1.2, 2.0, -0.5, 2.0, 1.4),
    'jams backwards': (1.0, -1.2, 2.0, -0.5, -2.0, 1.4),
}


def march(Ann, Ant, Att, vn, vt, law, steps=40_000):
    """The impulses in small steps dp; friction brings vt to 0 if it can, each time."""
    start = abs(vn) + abs(vt)
    dp = 4.0 * start * (Ann + Att) / (Ann * Att - Ant * Ant) / steps
    approach, work, compression = vn, [0.0, 0.0], 0.0
    p = q = 0.0
    while True:
        recovering = vn >= 0.0
        if not recovering:
            compression = p
        e = law.restitution
        if law.hypothesis is NEWTON and vn >= -e * approach:
            break
        if law.hypothesis is POISSON and recovering and p >= (1.0 + e) * compression:
            break
        if law.hypothesis is STRONGE and recovering and work[1] >= -e * e * work[0]:
            break
        stop = -(vt + Ant * dp) / Att
        dq = max(-law.friction * dp, min(stop, law.friction * dp))
        rise = Ann * dp + Ant * dq
        work[recovering] += (vn + 0.5 * rise) * dp
        vn += rise
        vt += Ant * dp + Att * dq
        p, q = p + dp, q + dq
    return p, q, vt


@pytest.mark.parametrize('hypothesis', Hypothesis)
@pytest.mark.parametrize('e', [0.0, 0.6])
@pytest.mark.parametrize('name', PATHS)
def test_a_blow_is_the_limit_of_small_steps_of_impulse(name, e, hypothesis):
    *contact, mu = PATHS[name]
    law = ImpactLaw(e, mu, hypothesis)
    p, q, vt = march(*contact, law)
    impulse = single_impact(*contact, law)
    assert impulse.normal == pytest.approx(p, rel=2e-3)
    assert impulse.tangential == pytest.approx(q, rel=2e-3, abs=2e-3 * p)
    if abs(vt) > 1e-3:
        assert impulse.slip == np.sign(vt)
    else:
        assert impulse.slip == 0


@pytest.mark.parametrize('name', PATHS)
def test_stronges_hypothesis_is_a_stiff_spring_that_unloads_more_steeply(name):
    """In time: a spring of stiffness k loads and one of k/e^2 unloads, from the same force.

    Friction is smoothed over a thousandth of the rates. The result does not depend on k, since the
    configuration is frozen.
    """
    Ann, Ant, Att, vn, vt, mu = PATHS[name]
    e, k, width = 0.6, 1.0, 1e-3

    def until(zero, force, y):
        """Rates, depth and impulses when ``zero(y)`` is reached."""

        def motion(_, y):
            F = force(y[2])
            Q = -mu * math.tanh(y[1] / width) * F
            return [Ann * F + Ant * Q, Ant * F + Att * Q, -y[0], F, Q]

        def event(_, y):
            return zero(y)

        event.terminal = True
        run = solve_ivp(motion, (0, 1e3), y, 'LSODA', events=event, rtol=1e-9, atol=1e-12)
        return run.y[:, -1]

    y = until(lambda y: y[0], lambda x: k * x, [vn, vt, 0.0, 0.0, 0.0])
    deepest = y[2]

    def unloading(x):
        return k * deepest + k / (e * e) * (x - deepest)

    y = until(lambda y: unloading(y[2]), unloading, y)
    p, q, _ = single_impact(Ann, Ant, Att, vn, vt, ImpactLaw(e, mu, STRONGE))
    assert p == pytest.approx(y[3], rel=5e-3)
    assert q == pytest.approx(y[4], rel=5e-3, abs=5e-3 * p)


def test_the_paths_of_these_tests_are_what_they_are_called():
    for name, (Ann, Ant, Att, vn, vt, mu) in PATHS.items():
        impulse, plastic = (
            single_impact(Ann, Ant, Att, vn, vt, ImpactLaw(e, mu, POISSON)) for e in (0.6, 0.0)
        )
        if 'through' in name or 'away' in name:
            assert impulse.slip == plastic.slip == np.sign(vt)
        elif 'sticks' in name:
            assert impulse.slip == 0
            assert (plastic.slip == 0) == ('restitution' not in name)
        elif 'turns' in name:
            assert impulse.slip == -np.sign(vt)
            assert (plastic.slip == impulse.slip) == ('compression' in name)
        elif 'jams' in name:
            assert Ann < mu * np.sign(vt) * Ant
            assert impulse.slip == 0
        else:
            assert impulse.slip == 1


def test_slip_that_stops_is_by_hand():
    """Ann = Att = 1, Ant = 0, mu = 1/2, vt = 3/4: vt = 0 at p = 3/2, in restitution."""
    p, q, slip = single_impact(1.0, 0.0, 1.0, -1.0, 0.75, ImpactLaw(0.8, 0.5))
    assert (p, q, slip) == (pytest.approx(1.8), pytest.approx(-0.75), 0)


@pytest.mark.parametrize('mu', [1.4, 5.0, INF])
@pytest.mark.parametrize('sign', [-1, 1])
def test_a_jam_is_the_limit_of_an_approach_that_vanishes(mu, sign):
    Ann, Ant, Att, vt = 1.0, 1.2 * sign, 2.0, 0.7 * sign
    p, q, slip = jam(Ann, Ant, Att, vt, mu)
    assert slip == 0
    assert (p, q) == approx(single_impact(Ann, Ant, Att, -1e-13, vt, ImpactLaw(0.0, mu))[:2])
    # stuck and in touch afterwards
    assert (p, q) == approx(np.linalg.solve([[Ann, Ant], [Ant, Att]], [0.0, -vt]))
    assert q * vt < 0.0
    assert abs(q) < mu * p
    assert energy_change([0.0, vt], [0.0, 0.0], [p, q]) < 0.0


def approx(values):
    return pytest.approx(tuple(values), rel=1e-11)


@pytest.mark.parametrize(
    'contact', [(1.0, 1.2, 2.0, 0.7, 0.8), (1.0, 1.2, 2.0, -0.7, 5.0), (1.0, 1.2, 2.0, 0.0, 5.0)]
)
def test_a_contact_that_does_not_jam_gets_no_impulse(contact):
    assert jam(*contact) == ContactImpulse(0.0, 0.0, np.sign(contact[3]))


@pytest.mark.parametrize('vn', [0.0, 0.3])
@pytest.mark.parametrize('mu', [0.0, 0.5, INF])
def test_a_contact_that_does_not_close_gets_no_impulse(vn, mu):
    assert single_impact(1.0, 1.2, 2.0, vn, -2.0, ImpactLaw(0.5, mu)) == ContactImpulse(
        0.0, 0.0, -1
    )


# --- one contact: properties of random impacts -------------------------------------------------


@pytest.mark.parametrize('hypothesis', [POISSON, STRONGE])
def test_poisson_and_stronge_never_raise_the_energy(hypothesis):
    for k, (A, v, e, mu) in enumerate(random_impacts(10_000, seed=1)):
        p, q, _ = blow_of(A, v, ImpactLaw(e, mu if k % 10 else INF, hypothesis))
        assert energy_change(v, rates_after(A, v, [p, q]), [p, q]) <= rounding(A, v, [p, q])


@pytest.mark.parametrize('hypothesis', Hypothesis)
def test_every_blow_obeys_coulomb_and_ends_the_approach(hypothesis):
    for A, v, e, mu in random_impacts(10_000, seed=2):
        p, q, slip = blow_of(A, v, ImpactLaw(e, mu, hypothesis))
        vn, vt = rates_after(A, v, [p, q])
        size = np.abs(v).max() + np.abs(A).max() * (p + abs(q))
        assert p > 0.0
        assert abs(q) <= mu * p * (1.0 + 1e-14)
        assert vn >= -1e-13 * size
        assert vt * slip >= -1e-13 * size
        assert slip != 0 or abs(vt) <= 1e-13 * size
        if hypothesis is NEWTON:
            assert vn == pytest.approx(-e * v[0], abs=1e-13 * size)


@pytest.mark.parametrize('hypothesis', Hypothesis)
@pytest.mark.parametrize('mu', [0.0, 0.4, 3.0, INF])
def test_a_plastic_blow_ends_at_rest_in_the_normal_direction(hypothesis, mu):
    for A, v, _, _ in random_impacts(300, seed=3):
        p, q, slip = blow_of(A, v, ImpactLaw(0.0, mu, hypothesis))
        size = np.abs(v).max() + np.abs(A).max() * (p + abs(q))
        assert rates_after(A, v, [p, q])[0] == pytest.approx(0.0, abs=1e-13 * size)
        assert mu < INF or p == 0.0 or slip == 0


def test_newtons_hypothesis_raises_the_energy_of_a_double_pendulum():
    """Kane's paradox, in the manner of Kane and Levinson (Dynamics, 1985).

    Two uniform rods (1 m, 1 kg), 20 and 30 degrees off the vertical, strike the ground with the
    free end; e = mu = 0.7, rates -0.1 and -0.2 rad/s.
    """
    th, w = np.radians([20.0, 30.0]), np.array([-0.1, -0.2])
    c = 0.5 * math.cos(th[0] - th[1])
    M = np.array([[4.0 / 3.0, c], [c, 1.0 / 3.0]])
    J = np.array([np.sin(th), np.cos(th)])  # of the height and the place of the end
    A, v = J @ np.linalg.solve(M, J.T), J @ w
    gain = {}
    for hypothesis in Hypothesis:
        p, q, slip = blow_of(A, v, ImpactLaw(0.7, 0.7, hypothesis))
        assert slip == 0
        after = w + np.linalg.solve(M, J.T @ [p, q])
        gain[hypothesis] = (after @ M @ after) / (w @ M @ w) - 1.0
        change = energy_change(v, J @ after, [p, q])
        assert change == pytest.approx(0.5 * (after @ M @ after - w @ M @ w), rel=1e-12)
    assert gain[NEWTON] == pytest.approx(2.1115, abs=1e-4)
    assert gain[POISSON] == pytest.approx(-0.4615, abs=1e-4)
    assert gain[STRONGE] == pytest.approx(-0.4292, abs=1e-4)


def test_newtons_hypothesis_raises_the_energy_only_where_slip_stops_or_turns():
    rises = {0: 0, 1: 0}
    for A, v, e, mu in random_impacts(10_000, seed=4):
        p, q, slip = blow_of(A, v, ImpactLaw(e, mu))
        change = energy_change(v, rates_after(A, v, [p, q]), [p, q])
        D = np.linalg.det(A)
        if slip == 0:
            quadratic = (1 - e * e) * A[1, 1] * v[0] ** 2 - 2 * A[0, 1] * v[0] * v[1]
            quadratic += A[0, 0] * v[1] ** 2
            assert change == pytest.approx(
                -quadratic / (2 * D), rel=1e-6, abs=1e2 * rounding(A, v, [p, q])
            )
        if change > rounding(A, v, [p, q]):
            assert slip != np.sign(v[1])
            assert e * e > D / (A[0, 0] * A[1, 1])
            rises[abs(slip)] += 1
    assert rises[0] > 300
    assert rises[1] > 10


compliances = st.tuples(st.floats(0.1, 10.0), st.floats(-0.97, 0.97), st.floats(0.1, 10.0)).map(
    lambda x: (x[0], x[1] * math.sqrt(x[0] * x[2]), x[2])
)
approach = st.floats(-5.0, -1e-3)
tangential = st.floats(-5.0, 5.0).filter(lambda x: x == 0.0 or abs(x) > 1e-6)
laws = st.builds(
    ImpactLaw,
    st.floats(0.0, 1.0),
    st.one_of(st.floats(0.0, 3.0), st.just(INF)),
    st.sampled_from(Hypothesis),
)


@given(compliances, approach, tangential, laws)
def test_the_mirror_image_of_a_blow_is_the_blow_of_the_mirror_image(A, vn, vt, law):
    Ann, Ant, Att = A
    p, q, slip = single_impact(Ann, Ant, Att, vn, vt, law)
    assert single_impact(Ann, -Ant, Att, vn, -vt, law) == (p, -q, -slip)


@given(compliances, approach, tangential, laws, st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_a_blow_scales_with_mass_and_speed(A, vn, vt, law, mass, speed):
    p, q, _ = single_impact(*A, vn, vt, law)
    scaled = single_impact(*(a / mass for a in A), speed * vn, speed * vt, law)
    unit = mass * speed * (p + abs(q))
    assert scaled.normal == pytest.approx(mass * speed * p, rel=1e-9, abs=1e-9 * unit)
    assert scaled.tangential == pytest.approx(mass * speed * q, rel=1e-9, abs=1e-9 * unit)


@given(compliances, approach, tangential, st.floats(0.0, 1.0), st.sampled_from(Hypothesis))
def test_without_friction_all_hypotheses_are_newtons_impulses(A, vn, vt, e, hypothesis):
    Ann, Ant, Att = A
    p, q, slip = single_impact(Ann, Ant, Att, vn, vt, ImpactLaw(e, 0.0, hypothesis))
    assert p == pytest.approx(*newton_impulses([[Ann]], [vn], [e]))
    assert q == 0.0
    assert slip == np.sign(vt + Ant * p)


@given(compliances, approach, tangential, st.floats(0.0, 1.0), st.floats(0.0, 2.0))
@example((2.0, 0.5, 3.0), -1.0, 4.0, 0.5, 0.3)
def test_the_hypotheses_agree_where_slip_keeps_its_direction(A, vn, vt, e, mu):
    impacts = [
        single_impact(*A, vn, vt, ImpactLaw(e, mu, hypothesis)) for hypothesis in Hypothesis
    ]
    assume(vt != 0.0)
    assume(any(impulse.slip == np.sign(vt) for impulse in impacts))
    assert impacts[0] == impacts[1] == impacts[2]
    p = (1.0 + e) * -vn / (A[0] - mu * np.sign(vt) * A[1])
    assert impacts[0].normal == pytest.approx(p, rel=1e-14)


@given(compliances, approach, tangential, laws)
@example((1.0, -0.9, 1.0), -0.1, 2.0, ImpactLaw(0.5, INF))
@example((1.0, -0.9, 1.0), -1.0, 1.2, ImpactLaw(0.5, INF, POISSON))
@example((1.0, -0.9, 1.0), -1.0, 1.2, ImpactLaw(0.5, INF, STRONGE))
def test_rough_is_the_limit_of_much_friction(A, vn, vt, law):
    """Also where slip alone lifts the contact off, and no normal impulse is left."""
    p, q, slip = single_impact(*A, vn, vt, ImpactLaw(law.restitution, INF, law.hypothesis))
    much = single_impact(*A, vn, vt, ImpactLaw(law.restitution, 1e9, law.hypothesis))
    # works add up: an error of 1/mu in one is that of its root in an impulse
    unit = (1e-4 if law.hypothesis is STRONGE else 1e-6) * (abs(q) + p)
    assert p >= 0.0
    assert much.normal == pytest.approx(p, abs=unit)
    assert much.tangential == pytest.approx(q, abs=unit)
    assert (p == 0.0 and slip) or slip == 0 or p < unit


def test_a_rough_blow_that_lifts_off_by_friction_alone():
    Ann, Ant, Att, vn, vt = 1.0, -0.9, 1.0, -0.1, 2.0
    impulse = single_impact(Ann, Ant, Att, vn, vt, ImpactLaw(0.5, INF))
    assert impulse == (0.0, pytest.approx(-0.15 / 0.9), 1)
    assert vn + Ant * impulse.tangential == pytest.approx(0.05)


@pytest.mark.parametrize('mu', [1.0, 2.0, INF])
def test_a_wedged_contact_is_an_error(mu):
    with pytest.raises(ArithmeticError, match='wedged'):
        single_impact(1.0, 1.0, 1.0, -1.0, 0.5, ImpactLaw(0.5, mu))


def test_a_contact_that_cannot_move_sideways():
    assert single_impact(2.0, 0.0, 0.0, -1.0, 0.0, ImpactLaw(0.5, 0.3)) == (0.75, 0.0, 0)
    assert single_impact(2.0, 0.0, 0.0, -1.0, 1.0, ImpactLaw(0.5, 0.3)) == (0.75, -0.3 * 0.75, 1)


# --- [SB] 5.4: the impact of coupler and rocker ----------------------------------------------

# Table 6.1 [m, kg m^2] about the frame-side joints; point pin, rocker bushing of radius c
L2, L3, L4, C = 0.064, 0.309, 0.312, 0.000254
I3 = 2950e-6 + 0.2439 * 0.185**2
I4 = 3176e-6 + 0.2334 * 0.134**2


def thesis_impact(eta, th, w, e, mu, slip):
    """[SB] eq. 5.4-1: w3+, w4+ and the impulses F, f [N s].

    `slip` None is the rough case and all four rows count, else three with f = slip mu F. Derived
    from the moments about A and O4 and from Q' = P' - C'; subscripts 2, 3, 4 are crank, coupler
    and rocker. F presses the pin against -n, and f drags it against +t.
    """
    n2, n3, n4 = (le * math.sin(eta - a) for le, a in zip((L2, L3, L4), th, strict=True))
    t2, t3, t4 = (le * math.cos(eta - a) for le, a in zip((L2, L3, L4), th, strict=True))
    t4 += C
    w2, w3, w4 = w
    M = np.array(
        [
            [I3, 0.0, n3, t3],
            [0.0, I4, -n4, -t4],
            [n3, -n4, 0.0, 0.0],
            [t3, -t4, 0.0, 0.0],
        ]
    )
    right = np.array([I3 * w3, I4 * w4, -e * (n3 * w3 - n4 * w4) - (1.0 + e) * n2 * w2, -t2 * w2])
    if slip is None:
        return np.linalg.solve(M, right)
    M[:2, 2] += slip * mu * M[:2, 3]
    x = np.linalg.solve(M[:3, :3], right[:3])
    return np.append(x, slip * mu * x[2])


def thesis_contact(eta, th, w):
    """Jacobian (2, 2) of gap rate and slip over (w3, w4), compliance, and rates (2,)."""
    n = np.array([math.cos(eta), math.sin(eta)])
    t = np.array([-n[1], n[0]])
    across = np.array([[-math.sin(a), math.cos(a)] for a in th])  # v(th2), v(th3), v(th4)
    V = np.array([L2, L3, -L4])[:, None] * across  # Q' per rate
    rows = np.array([-V @ n, V @ t - [0.0, 0.0, C]])
    J = rows[:, 1:]
    return J, J @ np.diag([1.0 / I3, 1.0 / I4]) @ J.T, rows @ w


def thesis_cases(n=400, seed=5):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        eta, th = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.0, 2.0 * math.pi, 3)
        w = rng.normal(scale=20.0, size=3)
        J, A, v = thesis_contact(eta, th, w)
        if v[0] < 0.0:
            yield (eta, th, w), J, A, v, rng.uniform(0.0, 1.0)


def test_the_smooth_case_of_the_thesis():
    for case, J, A, v, e in thesis_cases():
        p, q, _ = blow_of(A, v, ImpactLaw(e))
        w3, w4, F, f = thesis_impact(*case, e, 0.0, 1)
        assert (p, q) == (pytest.approx(F, rel=1e-9), f)
        gained = J.T @ [p, q] / [I3, I4]
        assert case[2][1:] + gained == pytest.approx([w3, w4], rel=1e-9, abs=1e-8)


def test_the_slip_case_of_the_thesis_is_a_blow_without_change_of_slip():
    seen = 0
    for case, J, A, v, e in thesis_cases():
        p, q, slip = blow_of(A, v, ImpactLaw(e, 0.15))
        if slip != np.sign(v[1]):
            continue
        seen += 1
        w3, w4, F, f = thesis_impact(*case, e, 0.15, slip)
        assert (p, -q) == (pytest.approx(F, rel=1e-9), pytest.approx(f, rel=1e-9))
        gained = J.T @ [p, q] / [I3, I4]
        assert case[2][1:] + gained == pytest.approx([w3, w4], rel=1e-9, abs=1e-8)
    assert seen > 50


@pytest.mark.parametrize('mu', [2.0, INF])
def test_the_rough_case_of_the_thesis_is_a_blow_that_sticks(mu):
    seen = lifted = 0
    for case, J, A, v, e in thesis_cases():
        p, q, slip = blow_of(A, v, ImpactLaw(e, mu))
        w3, w4, F, f = thesis_impact(*case, e, mu, None)
        if slip:
            # where all four rows would have the bushing pull, friction alone ends the approach
            assert mu < INF or (F < 0.0 and p == 0.0)
            lifted += 1
            continue
        seen += 1
        unit = p + abs(q)
        assert (p, -q) == (pytest.approx(F, abs=1e-8 * unit), pytest.approx(f, abs=1e-8 * unit))
        gained = J.T @ [p, q] / [I3, I4]
        assert case[2][1:] + gained == pytest.approx([w3, w4], rel=1e-7, abs=1e-6)
    assert seen > 50
    assert lifted > 5


def stick_or_slip(A, v, e, mu):
    """[SB] 5.3.3: the rough case if its impulses lie in the cone, else slip to the end."""
    p, q = np.linalg.solve(A, [-(1.0 + e) * v[0], -v[1]])
    if abs(q) <= mu * p:
        return p, q
    side = -math.copysign(mu, v[1])
    p = -(1.0 + e) * v[0] / (A[0, 0] + side * A[0, 1])
    return p, side * p


def test_stick_or_slip_of_the_thesis_differs_where_slip_turns_only():
    seen = 0
    for _, _, A, v, e in thesis_cases():
        for mu in 0.1, 0.5:
            p, q, slip = blow_of(A, v, ImpactLaw(e, mu))
            if slip != -np.sign(v[1]):
                seen += 1
                thesis = stick_or_slip(A, v, e, mu)
                assert (p, q) == pytest.approx(thesis, rel=1e-9, abs=1e-9 * p)
    assert seen > 100


def test_the_example_of_the_page_where_slip_turns():
    """docs/physics.md has both rows of figures."""
    linkage = ms.load_scene('four_bar_clearance').nominal.linkage
    crank, v = math.radians(90.0), np.array([-0.1, -0.01])
    th3, th4 = (float(x[0]) for x in linkage.positions(np.array([crank])))
    A = thesis_contact(math.radians(45.0), (crank, th3, th4), np.zeros(3))[1]
    page = (ROOT / 'docs' / 'physics.md').read_text('utf-8')
    p, q, _ = blow_of(A, v, ImpactLaw(0.5, 0.1))
    for name, found in (('Routh', (p, q)), ('[SB] 5.3.3', stick_or_slip(A, v, 0.5, 0.1))):
        after = rates_after(A, v, found)
        loss = -float(np.dot(found, 0.5 * (v + after)))
        p, q = 1e3 * np.array(found)
        assert f'| {name} | {p:.3f} | {q:.3f} | {1e3 * after[1]:.1f} | {1e3 * loss:.4f} |' in page


# --- several contacts: complementarity -------------------------------------------------------


def violations(A, b, mu, x, slip=None):
    """Violation of Coulomb's law and complementarity by x, per unit of what cancels."""
    m = len(mu)
    x = np.asarray(x)
    w = A @ x + b
    unit = np.abs(A).sum(axis=1) * np.abs(x).max() + np.abs(b) + 1e-300
    r, worst = w / unit, 0.0
    scale = np.abs(x).max() + 1e-300
    for i in range(m):
        p, q, wn, wt = x[i] / scale, x[m + i] / scale, r[i], r[m + i]
        worst = max(worst, -p, -wn, min(p, abs(wn)))
        if slip is not None and slip[i]:
            worst = max(worst, abs(q + mu[i] * slip[i] * p))
        elif math.isinf(mu[i]):
            worst = max(worst, min(p, abs(wt)), min(abs(q), max(abs(wn), np.sign(q) * wt)))
        else:
            # the maximal dissipation: q is the end of the cone against wt, or wt = 0
            worst = max(worst, abs(q) - mu[i] * p)
            worst = max(worst, min(abs(wt), abs(q + mu[i] * p * np.sign(wt))))
    return worst


def gauss_seidel(A, b, mu, least=None, sweeps=4000):
    """A second route, where contacts are not too close: impulses projected on their sets."""
    m = len(mu)
    least = np.zeros(m) if least is None else least
    x = np.zeros(2 * m)
    for _ in range(sweeps):
        old = x.copy()
        for i in range(m):
            x[i] = max(least[i], x[i] - (A[i] @ x + b[i]) / A[i, i])
            t = m + i
            x[t] -= (A[t] @ x + b[t]) / A[t, t]
            x[t] = min(max(x[t], -mu[i] * x[i]), mu[i] * x[i])
        if np.abs(x - old).max() <= 1e-15 * (1.0 + np.abs(x).max()):
            return x
    return None


@pytest.mark.parametrize('m', [1, 2, 3, 4])
def test_impulses_obey_complementarity_and_coulomb(m):
    """At the level of rates and of accelerations alike: b is any vector."""
    for k, (A, b, rng) in enumerate(random_groups(200 if m < 4 else 40, m, seed=10 + m)):
        if k % 2:
            b[:m] *= rng.choice([-1.0, 1.0], m)
        mu = [float(x) for x in rng.choice([0.0, INF, *rng.uniform(0.0, 2.0, 4)], m)]
        x, grips = solve_frictional_lcp(A.tolist(), b.tolist(), mu)
        assert violations(A, b, mu, x) < 1e-11
        for i, grip in enumerate(grips):
            p, q, wt = x[i], x[m + i], (A @ x + b)[m + i]
            assert (grip is Grip.OPEN) == (p == 0.0 and q == 0.0)
            if grip is Grip.FORWARD:
                assert wt > 0.0
                assert q <= 0.0
            elif grip is Grip.BACKWARD:
                assert wt < 0.0
                assert q >= 0.0


@pytest.mark.parametrize('m', [1, 2, 3])
def test_impulses_agree_with_projected_gauss_seidel(m):
    compared = 0
    for A, b, rng in random_groups(60, m, seed=20 + m, apart=2.0):
        mu = rng.uniform(0.0, 0.5, m)
        y = gauss_seidel(A, b, mu)
        if y is None:
            continue
        compared += 1
        x, _ = solve_frictional_lcp(A, b, mu.tolist())
        assert x == pytest.approx(y, abs=1e-9 * (1.0 + np.abs(y).max()))
    assert compared > 50


@given(compliances, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(0.0, 0.9))
def test_one_contact_that_slips_already(A, bn, bt, mu):
    """The force of a slipping contact: -bn/(Ann - mu s Ant) as long as it does not jam."""
    Ann, Ant, Att = A
    assume(bn == 0.0 or abs(bn) > 1e-6)
    for slip in (-1, 1):
        assume(Ann - mu * slip * Ant > 1e-3)
        x, (grip,) = solve_frictional_lcp([[Ann, Ant], [Ant, Att]], [bn, bt], [mu], [slip])
        p = max(0.0, -bn / (Ann - mu * slip * Ant))
        assert x == pytest.approx([p, -mu * slip * p], rel=1e-12)
        if mu > 0.0 and p > 0.0:
            assert grip is (Grip.FORWARD if slip > 0 else Grip.BACKWARD)


def test_a_slip_that_is_given_stays_while_others_choose():
    for A, b, rng in random_groups(200, 3, seed=31, apart=1.0):
        mu = rng.uniform(0.0, 0.15, 3)
        slip = [1, 0, -1]
        x, _ = solve_frictional_lcp(A, b, mu.tolist(), slip)
        assert violations(A, b, mu, x, slip) < 1e-11


def test_a_jam_has_no_finite_force():
    A, b = [[1.0, 1.2], [1.2, 2.0]], [-1.0, 0.3]
    with pytest.raises(ArithmeticError, match='no impulses'):
        solve_frictional_lcp(A, b, [1.0], [1])
    assert solve_frictional_lcp(A, b, [1.0], [-1])[0] == approx([1.0 / 2.2, 1.0 / 2.2])


def test_of_several_solutions_the_fewest_contacts_carry_force():
    """Painleve's other paradox: pressed apart (bn > 0), yet slip could jam it."""
    A = [[1.0, 1.2], [1.2, 2.0]]
    x, grips = solve_frictional_lcp(A, [0.5, 1.0], [1.0], [1])
    assert (x, grips) == ([0.0, 0.0], [Grip.OPEN])
    assert violations(np.array(A), np.array([0.5, 1.0]), [1.0], [2.5, -2.5], [1]) < 1e-15


@pytest.mark.parametrize(
    ('J', 'b', 'preferred', 'other'),
    [
        pytest.param(
            [[0, 2, 0, -2], [0, 2, 0, -1], [-1, -2, 1, -1], [-2, 0, 0, 0]],
            [-2, -2, 3, 0],
            (['OPEN', 'STICK'], [0, 2 / 5, 0, 0]),
            (['FORWARD', 'OPEN'], [1 / 6, 0, -1 / 3, 0]),
            id='the second sticks or the first slips',
        ),
        pytest.param(
            [[0, 1, -2, 0], [2, 0, -1, 0], [1, -2, 1, -2], [0, -1, 0, 0]],
            [0, -1, -3, 2],
            (['STICK', 'OPEN'], [6 / 17, 0, 15 / 34, 0]),
            (['OPEN', 'FORWARD'], [0, 1 / 5, 0, -1 / 5]),
            id='the first sticks or the second slips',
        ),
        pytest.param(
            [[1, 1, 0, 2], [-1, -1, 1, 0], [0, 0, 1, 1], [1, 0, -2, 0]],
            [-1, 2, 2, -2],
            (['FORWARD', 'OPEN'], [1 / 2, 0, -1, 0]),
            (['STICK', 'STICK'], [15, 12, -29, -7]),
            id='one slips or both stick',
        ),
    ],
)
def test_of_several_solutions_one_is_found(J, b, preferred, other):
    A, b, mu = np.array(J) @ np.array(J).T, np.array(b, dtype=float), [2.0, 1.0]
    assert violations(A, b, mu, preferred[1]) < 1e-15
    assert violations(A, b, mu, other[1]) < 1e-15
    x, grips = solve_frictional_lcp(A, b, mu)
    names, right = min((preferred, other), key=lambda known: abs(x[0] - known[1][0]))
    assert x == pytest.approx(right, abs=1e-13 * np.abs(right).max())
    assert [grip.name for grip in grips] == names


def test_redundant_contacts_and_rows_of_zeros():
    """Two contacts of one particle, and one that cannot move sideways."""
    J = np.array([[0.0, 1.0], [0.0, 1.0], [1.0, 0.0], [1.0, 0.0]])
    A, b = J @ J.T, J @ [0.1, -1.0]
    x, _ = solve_frictional_lcp(A, b, [0.4, 0.4])
    assert violations(A, b, [0.4, 0.4], x) < 1e-14
    assert A @ x + b == pytest.approx(0.0, abs=1e-15)
    x, grips = solve_frictional_lcp([[2.0, 0.0], [0.0, 0.0]], [-1.0, 0.0], [0.3])
    assert (x, grips) == ([pytest.approx(0.5), 0.0], [Grip.STICK])


def test_problems_on_the_border_of_two_states_have_a_solution_to_rounding():
    """Small whole numbers: forces that just vanish, friction just enough to stick."""
    rng = np.random.default_rng(33)
    for _ in range(2000):
        J = rng.integers(-2, 3, size=(4, 4)).astype(float)
        if abs(np.linalg.det(J)) < 0.5:
            continue
        A, b = J @ J.T, rng.integers(-2, 3, size=4).astype(float)
        x, _ = solve_frictional_lcp(A, b, [1.0, 1.0])
        assert violations(A, b, [1.0, 1.0], x) < 1e-11


def test_a_force_that_vanishes_may_come_out_negative_by_rounding():
    """The first contact slips on the verge of a jam, Ann = mu Ant; the second just touches."""
    J = np.array([[-2, 1, 2, -1], [-1, -1, 0, 2], [-2, 2, 1, -2], [-2, -1, 2, 0]])
    A, b = J @ J.T, np.array([0.0, -1.0, 2.0, 1.0])
    x, _ = solve_frictional_lcp(A, b, [1.0, 1.0], [1, 1])
    assert x == pytest.approx([1 / 3, 0.0, -1 / 3, 0.0], abs=1e-14)
    assert min(x[:2]) >= 0.0
    # rough, and the same of a force that would hold at p = 0
    J = np.array([[-2, 0, 2, 2], [1, -2, 0, -1], [1, 0, 0, 1], [1, 0, -2, 1]])
    A, b = J @ J.T, np.array([-2.0, 0.0, -1.0, 1.0])
    x, _ = solve_frictional_lcp(A, b, [INF, INF])
    assert violations(A, b, [INF, INF], x) < 1e-14
    assert min(x[:2]) >= 0.0


# --- several contacts: laws ------------------------------------------------------------------


def group(A, v, laws):
    """Impulses (2m,) and the slips of `simultaneous_impact`."""
    impacts = simultaneous_impact(A.tolist(), list(v), laws)
    x = [impulse.normal for impulse in impacts] + [impulse.tangential for impulse in impacts]
    return np.array(x), [impulse.slip for impulse in impacts]


@pytest.mark.parametrize('m', [1, 2, 3])
def test_frictionless_contacts_of_newton_are_newton_impulses(m):
    for A, v, rng in random_groups(50, m, seed=40 + m):
        e = rng.uniform(0.0, 1.0, m)
        x, slip = group(A, v, [ImpactLaw(float(e_i)) for e_i in e])
        expected = newton_impulses(A[:m, :m].tolist(), v[:m].tolist(), e.tolist())
        assert x[:m] == pytest.approx(expected, abs=1e-12 * max(expected, default=0.0))
        assert not x[m:].any()
        assert slip == np.sign(rates_after(A, v, x)[m:]).tolist()
        A[m:], A[:, m:] = 0.0, 0.0  # what is not asked for need not be there
        assert (group(A, v, [ImpactLaw(float(e_i)) for e_i in e])[0] == x).all()


def test_the_general_route_without_friction_is_newton_impulses_too():
    for A, v, rng in random_groups(100, 3, seed=44):
        e = rng.uniform(0.0, 1.0, 3)
        b = np.append((1.0 + e) * v[:3], v[3:])
        x, _ = solve_frictional_lcp(A, b, [0.0] * 3)
        expected = newton_impulses(A[:3, :3].tolist(), v[:3].tolist(), e.tolist())
        assert x == pytest.approx([*expected, 0.0, 0.0, 0.0], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize('hypothesis', Hypothesis)
def test_contacts_that_do_not_feel_each_other_strike_one_by_one(hypothesis):
    """As long as slip does not change; there the forms agree with the path of a single one."""
    single = [(2.0, 0.5, 3.0, -1.0, 4.0, 0.3), (2.0, -1.5, 2.0, -1.0, -1.0, 0.4)]
    laws = [ImpactLaw(0.6, c[5], hypothesis) for c in single]
    A, v = np.zeros((4, 4)), np.zeros(4)
    for i, (Ann, Ant, Att, vn, vt, _) in enumerate(single):
        A[i, i], A[i, 2 + i], A[2 + i, i], A[2 + i, 2 + i] = Ann, Ant, Ant, Att
        v[i], v[2 + i] = vn, vt
    x, slip = group(A, v, laws)
    for i, contact in enumerate(single):
        p, q, s = single_impact(*contact[:5], laws[i])
        assert (x[i], x[2 + i]) == (pytest.approx(p), pytest.approx(q))
        assert slip[i] == s


def test_one_rough_contact_of_newton_is_a_strike():
    for A, v, e, _ in random_impacts(500, seed=45):
        law = ImpactLaw(e, INF)
        x, (slip,) = group(A, v, [law])
        p, q, s = blow_of(A, v, law)
        unit = 1e-9 * (p + abs(q))
        assert x == pytest.approx([p, q], abs=unit)
        assert slip == s


@pytest.mark.parametrize('hypothesis', Hypothesis)
def test_rough_groups_are_the_limit_of_much_friction(hypothesis):
    unequal = 0
    for A, v, rng in random_groups(100, 2, seed=46):
        e = float(rng.uniform())
        x, much = (group(A, v, [ImpactLaw(e, mu, hypothesis)] * 2)[0] for mu in (INF, 1e7))
        # there may be several solutions; nearly always it is the same
        unequal += not np.allclose(x, much, rtol=0.0, atol=1e-4 * np.abs(x).max())
    assert unequal <= 5


def test_frictionless_expansion_is_a_projection():
    """Glocker and Pfeiffer's second phase minimises the energy over p >= e pc."""
    for A, v, rng in random_groups(100, 3, seed=47):
        e = rng.uniform(0.0, 1.0, 3)
        R = np.linalg.cholesky(A[:3, :3]).T
        pc = nnls(R, -np.linalg.solve(R.T, v[:3]))[0]
        vc = v[:3] + A[:3, :3] @ pc
        more = nnls(R, -np.linalg.solve(R.T, vc) - R @ (e * pc))[0]
        x, _ = group(A, v, [ImpactLaw(float(e_i), 0.0, POISSON) for e_i in e])
        assert x[:3] == pytest.approx((1.0 + e) * pc + more, rel=1e-7, abs=1e-7)


def test_the_phases_with_friction_agree_with_projected_gauss_seidel():
    compared = 0
    for A, v, rng in random_groups(40, 2, seed=48, apart=2.0):
        e, mu = rng.uniform(0.0, 1.0, 2), rng.uniform(0.0, 0.5, 2)
        xc = gauss_seidel(A, v, mu)
        xe = None if xc is None else gauss_seidel(A, v + A @ xc, mu, e * xc[:2])
        if xe is None:
            continue
        compared += 1
        laws = [ImpactLaw(float(a), float(b), POISSON) for a, b in zip(e, mu, strict=True)]
        assert group(A, v, laws)[0] == pytest.approx(xc + xe, rel=1e-8, abs=1e-8)
    assert compared > 30


@pytest.mark.parametrize('hypothesis', [POISSON, STRONGE])
def test_a_row_of_balls_in_two_phases(hypothesis):
    """Three equal balls, the last two at rest in touch, e = 1: the first is thrown back."""
    J = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]])
    A = np.zeros((4, 4))
    A[:2, :2] = J @ J.T
    v = np.append(J @ [1.0, 0.0, 0.0], [0.0, 0.0])
    x, _ = group(A, v, [ImpactLaw(1.0, 0.0, hypothesis)] * 2)
    assert [1.0, 0.0, 0.0] + J.T @ x[:2] == pytest.approx([-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0])
    same = newton_impulses(A[:2, :2].tolist(), v[:2].tolist(), [1.0, 1.0])
    assert x[:2] == pytest.approx(same)


def test_newtons_contact_among_poissons_keeps_its_ratio_of_rates():
    for A, v, rng in random_groups(200, 2, seed=49):
        laws = [ImpactLaw(0.6, 0.3), ImpactLaw(0.4, float(rng.uniform()), POISSON)]
        x, _ = group(A, v, laws)
        after = rates_after(A, v, x)
        assert after[0] >= -0.6 * v[0] - 1e-11
        assert after[1] >= -1e-11
        assert (np.abs(x[2:]) <= [0.3 * x[0] + 1e-12, laws[1].friction * x[1] + 1e-12]).all()


def gain(A, v, x):
    """Relative change of energy, checked against the difference of energies."""
    after = rates_after(A, v, x)
    change, before = energy_change(v, after, x), kinetic(A, v)
    assert change == pytest.approx(kinetic(A, after) - before, rel=1e-5, abs=1e-7 * before)
    return change / before


@pytest.mark.parametrize(
    ('hypothesis', 'same', 'frictions'),
    [
        (NEWTON, False, [0.0]),
        (POISSON, False, [0.0]),
        (POISSON, True, [0.0, 0.3, 1.5, INF]),
    ],
)
def test_groups_that_never_raise_the_energy(hypothesis, same, frictions):
    for m in (2, 3):
        for A, v, rng in random_groups(200, m, seed=50 + m):
            e = np.full(m, rng.uniform()) if same else rng.uniform(0.0, 1.0, m)
            laws = [ImpactLaw(float(e_i), float(rng.choice(frictions)), hypothesis) for e_i in e]
            x, _ = group(A, v, laws)
            change = energy_change(v, rates_after(A, v, x), x)
            assert change <= 10.0 * rounding(A, v, x)


@pytest.mark.parametrize('hypothesis', Hypothesis)
def test_plastic_groups_never_raise_the_energy(hypothesis):
    for A, v, rng in random_groups(200, 2, seed=55):
        laws = [ImpactLaw(0.0, float(rng.choice([0.3, 1.5, INF])), hypothesis) for _ in range(2)]
        x, _ = group(A, v, laws)
        assert energy_change(v, rates_after(A, v, x), x) <= 10.0 * rounding(A, v, x)


def test_groups_that_raise_the_energy():
    """Friction in Moreau's form; e that differs with a contact that separates; e with friction."""
    A, v = np.array([[1.0, 1.5], [1.5, 2.5]]), np.array([-1.0, -1.5])
    x, slip = group(A, v, [ImpactLaw(0.5, 1.0)])
    assert slip == [0]
    # (1 - 1/4) 5/2 - 2 (3/2)(3/2) + 9/4 = -3/8, 2 D = 1/2; energy before 1/2
    assert gain(A, v, x) == pytest.approx(1.5)

    J = np.array([[2.0, 1.0], [-2.0, -2.0]])
    A = np.zeros((4, 4))
    A[:2, :2] = J @ J.T
    v = np.array([-2.0, 2.0, 0.0, 0.0])
    x, _ = group(A, v, [ImpactLaw(1.0), ImpactLaw(0.0)])
    assert x[:2] == pytest.approx([5.0, 3.5])
    assert gain(A[:2, :2], v[:2], x[:2]) == pytest.approx(7.0)

    J = np.array([[-1, 0, -1, -2], [-1, -2, 0, 2], [0, 1, 0, -1], [-2, -2, -1, -1]])
    A, v = J @ J.T, -np.ones(4)
    x, _ = group(A, v, [ImpactLaw(1.0, 1.0, POISSON), ImpactLaw(0.0, 1.0, POISSON)])
    assert gain(A, v, x) == pytest.approx(5.865, abs=1e-3)


@pytest.mark.slow
def test_moreaus_form_may_have_no_solution_where_bodies_are_wedged():
    """Three freedoms, four rows: e asks for rates that the bodies cannot have together."""
    wedged = 0
    for A, v, rng in random_groups(300, 2, seed=56, columns=3):
        mu = float(rng.uniform(0.5, 2.0))
        group(A, v, [ImpactLaw(0.8, mu, POISSON)] * 2)
        group(A, v, [ImpactLaw(0.0, mu)] * 2)
        group(A, v, [ImpactLaw(0.8)] * 2)
        try:
            group(A, v, [ImpactLaw(0.8, mu)] * 2)
        except ArithmeticError:
            wedged += 1
    assert 0 < wedged < 100


def test_a_group_shows_no_slip_where_it_sticks():
    A, v = np.diag([1.0, 1.0, 3.0, 7.0]), np.array([-1.0, -1.0, 0.1, -0.3])
    for hypothesis in Hypothesis:
        assert group(A, v, [ImpactLaw(0.3, 0.9, hypothesis)] * 2)[1] == [0, 0]


def test_energy_change_is_exact_for_any_impulses():
    rng = np.random.default_rng(60)
    M = np.diag([1.0, 2.0, 0.5])
    J, w, x = rng.normal(size=(4, 3)), rng.normal(size=3), rng.normal(size=4)
    after = w + np.linalg.solve(M, J.T @ x)
    change = 0.5 * (after @ M @ after - w @ M @ w)
    assert energy_change(J @ w, J @ after, x) == pytest.approx(change, rel=1e-12)


def test_more_restitution_means_more_impulse():
    for contact in PATHS.values():
        for hypothesis in Hypothesis:
            p = [
                single_impact(*contact[:5], ImpactLaw(e, contact[5], hypothesis)).normal
                for e in np.linspace(0.0, 1.0, 201).tolist()
            ]
            assert all(a < b for a, b in pairwise(p))
            assert max(b - a for a, b in pairwise(p)) < 0.05 * p[-1]
