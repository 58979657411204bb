"""The contact solver against trying every combination, on random and on degenerate problems."""

import math

import numpy as np
import pytest
from enumeration import solve_frictional_lcp as by_enumeration

from mechanism_sim.numerics.complementarity import (
    FrictionalProblem,
    lemke,
    solve,
    solve_contacts,
    solve_frictional_lcp,
    solve_semidefinite,
)

KINDS = 'independent', 'dependent', 'doubled', 'whole numbers', 'one freedom'


def problem(rng, m, kind):
    """Contacts of bodies with unit masses: A = J J^T, and rates that some motion has."""
    freedoms = int(rng.integers(1, 2 * m + 3)) if kind == 'dependent' else 2 * m + 2
    J = rng.normal(size=(2 * m, 1 if kind == 'one freedom' else freedoms))
    if kind == 'doubled' and m > 1:
        J[m // 2], J[m + m // 2] = J[0], J[m]
    v = rng.normal(size=J.shape[1])
    if kind == 'whole numbers':
        J = rng.integers(-2, 3, size=J.shape).astype(float)
        v = rng.integers(-2, 3, size=v.shape).astype(float)
    mu = rng.choice([0.0, 0.1, 0.3, 1.0, 3.0, 100.0, 1e4, math.inf], size=m)
    return J @ J.T, J @ v, mu


def residual(A, b, mu, x):
    """Violation of the laws of all contacts by x, relative to what cancels."""
    m, w = len(mu), A @ x + b
    force = np.abs(x).max() + 1e-300
    size = (np.abs(A).sum(axis=1) * force + np.abs(b)).max() + 1e-300
    off = []
    for i in range(m):
        p, q, wn, wt = x[i] / force, x[m + i] / force, w[i] / size, w[m + i] / size
        off += [-p, -wn, min(p, wn)]
        if math.isinf(mu[i]):
            off += [min(p, abs(wt)), q * wt]
        else:
            off += [(abs(q) - mu[i] * p) / (1.0 + mu[i]), q * wt]
            off += [min((mu[i] * p - abs(q)) / (1.0 + mu[i]), abs(wt))]
    return max(off)


def check(count, most, seed):
    rng = np.random.default_rng(seed)
    compared = 0
    for n in range(count):
        kind = KINDS[n % len(KINDS)]
        m = int(rng.integers(1, most + 1))
        A, b, mu = problem(rng, m, kind)
        x, grips, found = solve_contacts(
            FrictionalProblem(A, b, mu, np.zeros(m, np.int64), np.zeros(2 * m))
        )
        assert found, (n, kind, m)
        assert residual(A, b, mu, x) < 1e-9, (n, kind, m)
        assert ((grips == 0) == ((x[:m] == 0.0) & (x[m:] == 0.0))).all()
        if kind == 'independent' and m <= 2 and mu.max() < 1.0:  # then there is one solution
            assert x == pytest.approx(by_enumeration(A, b, mu.tolist())[0], abs=1e-11)
            compared += 1
    assert compared > count // 200


def test_random_and_degenerate_problems_are_all_solved():
    check(400, 5, seed=1)


def test_a_slow_approach_beside_fast_slips_is_stopped():
    """Of a chain of light links, which slide on whatever such an impact does."""
    for seed in range(300):
        rng = np.random.default_rng(seed)
        m = int(rng.integers(2, 5))
        J = np.zeros((2 * m, 3 * m + 3))
        for i in range(m):
            angle = rng.uniform(0.0, 2.0 * math.pi)
            normal = np.array([math.cos(angle), math.sin(angle)])
            for r, along in ((i, normal), (m + i, normal[::-1] * (-1.0, 1.0))):
                J[r, 3 * i : 3 * i + 6] = [*-along, -rng.normal(), *along, rng.normal()]
        A, b = 15.0**2 * J @ J.T, np.concatenate([np.zeros(m), rng.normal(size=m)])
        struck = int(rng.integers(m))
        b[struck] = -(10.0 ** rng.uniform(-13.0, -9.0))
        none = np.zeros(m, np.int64), np.zeros(2 * m)
        x, _, found = solve_contacts(FrictionalProblem(A, b, np.full(m, 0.1), *none))
        assert found, seed
        p, w = x[:m], A @ x + b
        left = 1e-9 * abs(b[struck]) + 1e-12 * np.abs(b).max()
        assert p.min() >= 0.0
        assert w[:m].min() > -left, seed
        assert np.abs(w[:m][p > 0.0]).max(initial=0.0) < left, seed
        assert (w[m:] * b[m:] > 0.0).all(), seed
        if abs(b[struck]) > left:
            np.testing.assert_allclose(x[m:], -0.1 * np.sign(b[m:]) * p, atol=1e-12 * p.max())
        if abs(b[struck]) > 2.0 * left:
            assert p[struck] > 0.0


@pytest.mark.slow
def test_ten_thousand_problems_of_up_to_twenty_contacts_are_all_solved(compiled_kernels):
    compiled_kernels()
    check(10_000, 20, seed=2)


def test_slips_that_are_given_and_least_impulses_are_solved_as_by_enumeration():
    rng = np.random.default_rng(3)
    for n in range(150):
        m = int(rng.integers(1, 4))
        A, b, _ = problem(rng, m, 'independent')
        mu = rng.uniform(0.0, 0.3, m)
        slip, least = [0] * m, np.zeros(2 * m)
        if n % 2:
            slip = rng.integers(-1, 2, m).tolist()
        else:
            least[:m] = rng.uniform(0.0, 0.2, m)
        x, _ = solve_frictional_lcp(A, b, mu.tolist(), slip, least.tolist())
        expected, _ = by_enumeration(A, b, mu.tolist(), slip, least.tolist())
        assert x == pytest.approx(expected, abs=1e-10), n


def test_frictionless_contacts_are_as_by_enumeration_also_if_they_repeat_each_other():
    rng = np.random.default_rng(4)
    for _ in range(100):
        J = rng.normal(size=(5, 4))
        J[4] = J[0] + J[1]
        A, b = J @ J.T, J @ rng.normal(size=4)
        whole = np.pad(A, (0, 5)), np.pad(b, (0, 5)), [0.0] * 5
        x, other = (route(*whole)[0][:5] for route in (solve_frictional_lcp, by_enumeration))
        assert A @ x == pytest.approx(A @ other, abs=1e-9)  # the motion is the same


def test_lemke_exchanges_lexicographically_where_all_ratios_are_equal():
    """The corners of a cube: every ratio of the first test is the same."""
    n = 6
    M, q = np.eye(n) + 1.0, -np.ones(n)
    basis, found = lemke(M, q, np.ones(n), -1)
    assert found
    assert sorted(basis.tolist()) == list(range(n, 2 * n))


def test_linear_equations():
    rng = np.random.default_rng(5)
    for n in (1, 2, 5):
        A, b = rng.normal(size=(n, n)), rng.normal(size=n)
        x, regular = solve(A, b)
        assert regular
        assert x == pytest.approx(np.linalg.solve(A, b), rel=1e-9)
        assert not solve(np.outer(b, b) if n > 1 else np.zeros((1, 1)), b)[1]
        J = rng.normal(size=(n + 2, n))  # rank n of n + 2
        B = J @ rng.normal(size=(n, 2))
        X = solve_semidefinite(J @ J.T, B)
        np.testing.assert_allclose(J @ J.T @ X, B, atol=1e-9)


def test_compiled_kernels_give_the_same_bits(compiled_kernels):
    rng = np.random.default_rng(6)
    problems = [problem(rng, m, kind) for m in (1, 2, 4) for kind in KINDS]
    given = [(np.zeros(len(mu), np.int64), np.zeros(2 * len(mu))) for *_, mu in problems]
    plain = [
        solve_contacts.function(FrictionalProblem(*p, *g))
        for p, g in zip(problems, given, strict=True)
    ]
    compiled_kernels()
    assert solve_contacts.run is not solve_contacts.function
    for p, g, (x, grips, found) in zip(problems, given, plain, strict=True):
        again = solve_contacts(FrictionalProblem(*p, *g))
        assert again[0].tobytes() == x.tobytes()
        assert (again[1] == grips).all()
        assert again[2] == found
