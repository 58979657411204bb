"""Cancellation in closed forms: critical damping, resonance, repeated frequencies.

The reference is the matrix exponential in 60 digits of mpmath.
"""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from exponentials import first_difference, second_difference
from masses import MassSystem, chain
from oscillator import Oscillator
from rotors import Rotor, influence_coefficients, peak_radius
from torsional import disks
from two_masses import TwoMasses

from mechanism_sim.errors import InputError

NEARNESS = (0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3)


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(60):
        yield


def exact(M, C, K, t, start, force=None, w=0.0):
    """State (2n,) at t of M y'' + C y' + K y = Re(force e^(i w t)), rounded once."""
    n = len(M)
    size = 2 * n + 2
    A = mp.zeros(size)
    inverse = mp.matrix(M) ** -1
    for name, matrix in ((0, mp.matrix(K)), (n, mp.matrix(C))):
        product = inverse * matrix
        for i in range(n):
            for j in range(n):
                A[n + i, name + j] = -product[i, j]
    for i in range(n):
        A[i, n + i] = 1
    if force is not None:
        push = inverse * mp.matrix([mp.mpc(f) for f in force])
        for i in range(n):
            A[n + i, 2 * n], A[n + i, 2 * n + 1] = push[i].real, -push[i].imag
    A[2 * n, 2 * n + 1], A[2 * n + 1, 2 * n] = -mp.mpf(w), mp.mpf(w)
    x0 = mp.matrix([*map(mp.mpf, start), 1, 0])
    found = mp.expm(A * mp.mpf(t)) * x0
    return np.array([float(mp.re(x)) for x in found[: 2 * n]])


def of_one(o, t, start, force=None, w=0.0):
    """Solution for one oscillator, from just those numbers it is made of."""
    wn, a, m = (mp.mpf(float(x)) for x in (o.natural_frequency, o.decay_rate, o.mass))
    return exact([[m]], [[2 * a * m]], [[m * wn**2]], t, start, force, w)


def matrices(system):
    return system.mass.tolist(), system.damping.tolist(), system.stiffness.tolist()


@pytest.mark.sample(4)
@pytest.mark.parametrize('side', [-1.0, 1.0])
@pytest.mark.parametrize('near', NEARNESS)
def test_critical_damping_from_both_sides(near, side):
    o = Oscillator(3.0, 3.0 * (1.0 + side * near))
    for t in (0.01, 0.3, 1.0, 4.0, 20.0):
        for start in ((1.0, 0.0), (0.0, 1.0), (0.7, -2.0)):
            found = np.array(o.free(t, *start))
            np.testing.assert_allclose(found, of_one(o, t, start), rtol=2e-14)
        found = np.array(o.forced(t, 1.0 - 2.0j, 1.7))
        expected = of_one(o, t, (0.0, 0.0), [1.0 - 2.0j], 1.7)
        np.testing.assert_allclose(found, expected, rtol=5e-14)
    if side * near == 1e-12:  # the quotients of 6.70 and 6.71 have lost six digits there
        slow, fast = (root.real for root in o.roots)
        book = (slow * np.exp(fast) - fast * np.exp(slow)) / (slow - fast)
        assert abs(book / o.free(1.0, 1.0).displacement - 1.0) > 1e-12


@pytest.mark.sample(16)
@pytest.mark.parametrize('ratio', [0.0, 1e-14, 1e-9, 1e-4])
@pytest.mark.parametrize('near', [s * n for n in NEARNESS for s in (-1.0, 1.0)])
def test_resonance_approached(near, ratio):
    o = Oscillator.of_ratio(5.0, ratio, mass=2.0)
    w = 5.0 * (1.0 + near)
    for t in (0.05, 1.0, 30.0, 200.0):
        found = np.array(o.forced(t, -3.0j, w))
        expected = of_one(o, t, (0.0, 0.0), [-3.0j], w)
        envelope = np.array([1.0, w]) * 3.0 / 2.0 * min(t / w, t**2)
        # the phase w t itself is rounded
        assert np.abs(found - expected).max() <= 4e-16 * (4.0 + w * t) * envelope.max()
    if ratio or near:
        wn, a, x = mp.mpf(5.0), mp.mpf(float(o.decay_rate)), mp.mpf(w)
        expected = complex(1 / (2 * (wn**2 - x**2 + 2j * a * x)))
        assert abs(o.receptance(w) / expected - 1.0) < 1e-15
    else:
        assert np.isinf(o.receptance(w))


def test_a_step_near_critical_damping_ends_in_a_standstill():
    """A constant force: the rate dies out to its last digit, however close the roots are."""
    for a in (3.0, 3.0 * (1 - 4e-16), 3.0 * (1 + 4e-16), 3.0 * (1 - 1e-6)):
        o = Oscillator(3.0, a)
        for t in (0.1, 2.0, 20.0, 30.0):
            found = np.array(o.forced(t, 1.0 - 2.0j, 0.0))
            expected = of_one(o, t, (0.0, 0.0), [1.0 - 2.0j])
            np.testing.assert_allclose(found, expected, rtol=1e-13)


def test_a_slowly_creeping_oscillator_keeps_its_digits():
    """Roots 16 decades apart: -a + sqrt(a^2 - wn^2) would be zero."""
    o = Oscillator(1.0, 1e8)
    slow, fast = o.roots
    assert slow.real == pytest.approx(-5e-9, rel=1e-15)
    assert fast.real == -2e8
    for t in (1.0, 1e7, 1e9):
        expected = [mp.exp(slow.real * t), slow.real * mp.exp(slow.real * t)]
        np.testing.assert_allclose(o.free(t, 1.0), np.array(expected, float), rtol=1e-14)


@pytest.mark.parametrize(
    ('stiffness', 'damping'), [(0.0, 0.0), (0.0, 2.0), (1e-18, 0.0), (1e-18, 2.0)]
)
def test_without_a_spring(stiffness, damping):
    o = Oscillator.of_coefficients(2.0, damping, stiffness)
    for t in (1e-3, 1.0, 50.0):
        for force, w in ((0.3, 0.0), (1.0 + 1.0j, 4.0)):
            found = np.array(o.forced(t, force, w, 0.5, -0.25))
            np.testing.assert_allclose(
                found, of_one(o, t, (0.5, -0.25), [force], w), rtol=1e-13, atol=1e-16
            )


@pytest.mark.parametrize('count', [12, pytest.param(300, marks=pytest.mark.slow)])
def test_divided_differences_of_close_nodes(count):
    random = np.random.default_rng(5)
    for _ in range(count):
        spread = 10.0 ** random.uniform(-16, 1)
        x = complex(-random.uniform(0, 1), random.normal())
        nodes = [x, *(x + spread * complex(*random.normal(size=2)) for _ in range(2))]
        if random.random() < 0.2:
            nodes[2] = nodes[0]
        t = random.uniform(0, 3)
        B = mp.zeros(3)
        for i in range(3):
            B[i, i] = mp.mpc(nodes[i])
        B[0, 1] = B[1, 2] = 1
        whole = mp.expm(B * mp.mpf(t))  # Opitz: the corners are the differences
        assert abs(second_difference(*nodes, t) / complex(whole[0, 2]) - 1.0) < 2e-14
        assert abs(first_difference(*nodes[:2], t) / complex(whole[0, 1]) - 1.0) < 2e-14


def test_mode_ratios_of_weakly_coupled_masses():
    """A small mass on a large one: k2 - m2 w^2 of 6.157 has no correct digit there."""
    for m2 in (1e-4, 1e-12, 1e-20):
        two = TwoMasses(1.0, m2, 1.0, 1.01 * m2)
        first, second = mp.mpf(1.0), mp.mpf(two.k2) / mp.mpf(m2)
        half = (first + mp.mpf(two.k2) + second) / 2
        root = mp.sqrt(half**2 - first * second)
        squares = [half - root, half + root]
        np.testing.assert_allclose(
            two.natural_frequencies, [float(mp.sqrt(s)) for s in squares], rtol=4e-16
        )
        expected = [float(second / (second - s)) for s in squares]
        np.testing.assert_allclose(two.mode_ratios, expected, rtol=1e-13)


@pytest.mark.sample(2)
@pytest.mark.parametrize('apart', [0.0, 1e-14, 1e-12, 1e-9, 1e-3])
def test_repeated_natural_frequencies(apart):
    """Three equal oscillators, all but uncoupled by springs, coupled by dampers."""
    C = np.array([[0.5, -0.3, 0.0], [-0.3, 0.8, -0.2], [0.0, -0.2, 0.4]])
    K = np.diag([4.0, 4.0 * (1.0 + apart), 4.0 * (1.0 - apart)])
    system = MassSystem(np.eye(3), C, K)
    if apart == 0.0:
        assert system.modes.decay_rates is not None  # found in spite of arbitrary modes
        np.testing.assert_allclose(system.modes.frequencies, 2.0, rtol=1e-15)
        np.testing.assert_allclose(
            np.sort(system.modes.decay_rates), np.linalg.eigvalsh(C) / 2, rtol=1e-14
        )
    start = [1.0, 0.0, 0.0, 0.0, 0.5, -0.5]
    for t in (0.3, 3.0, 12.0):
        found = np.ravel(system.free([t], start[:3], start[3:]))
        expected = exact(*matrices(system), t, start)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)
        found = np.ravel(system.forced([t], [0.0, 1.0, 1.0j], 2.0, start[:3], start[3:]))
        expected = exact(*matrices(system), t, start, [0.0, 1.0, 1.0j], 2.0)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


def test_damped_modes_that_coincide_are_refused_where_they_cannot_be_summed():
    """Critical damping of each mode: the exponentials do not span, the limits do."""
    two = chain([1.0, 1.0], [1.0, 1.0])
    modes = two.modes
    C = modes.shapes @ np.diag(2.0 * modes.frequencies) @ modes.shapes.T
    system = MassSystem(two.mass, C, two.stiffness)
    t, start = 2.0, [1.0, 0.0, 0.0, -0.5]
    found = np.ravel(system.free([t], start[:2], start[2:]))
    np.testing.assert_allclose(found, exact(*matrices(system), t, start), rtol=1e-13)
    with pytest.raises(InputError, match=r'System\.free'):
        system.damped_modes.free([t], start[:2], start[2:])


@pytest.mark.parametrize('damping', [0.0, 0.3])
def test_rigid_body_modes(damping):
    """Disks on a free shaft turn for ever, and its mean angle is just start plus rate times t."""
    inertias, stiffnesses = [3.0, 1.0, 2.0], [50.0, 20.0]
    system = disks(inertias, stiffnesses, [damping * k / 50.0 for k in stiffnesses])
    assert system.modes.frequencies[0] == 0.0
    assert system.modes.decay_rates[0] == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(system.modes.shapes[:, 0], 1 / np.sqrt(6.0), rtol=1e-14)
    start = np.array([0.1, -0.2, 0.3, 1.0, 2.0, -1.0])
    for t in (0.5, 20.0, 1e4):
        found = system.free([t], start[:3], start[3:])
        mean = np.average([start[:3] + start[3:] * t], axis=1, weights=inertias)
        np.testing.assert_allclose(
            np.average(found.displacement, axis=0, weights=inertias), mean, rtol=1e-12
        )
        if t < 100:
            expected = exact(*matrices(system), t, start)
            np.testing.assert_allclose(np.ravel(found), expected, rtol=1e-12, atol=1e-13)
    pushed = system.forced([4.0], [1.0, 1.0, 1.0], 0.0, np.zeros(3), np.zeros(3))
    assert inertias @ pushed.velocity[:, 0] == pytest.approx(12.0, rel=1e-13)


def test_what_cannot_be_is_refused():
    for wrong in (
        lambda: Oscillator(-1.0),
        lambda: Oscillator(1.0, float('nan')),
        lambda: Oscillator(1.0, 0.0, 0.0),
        lambda: Oscillator.of_coefficients(0.0, 1.0, 1.0),
        lambda: Oscillator.of_coefficients(1.0, 1.0, -1.0),
        lambda: TwoMasses(1.0, 0.0, 1.0, 1.0),
        lambda: Rotor(1.0, 1e-3, (1.0, 0.0)),
        lambda: MassSystem(np.eye(2), np.zeros((2, 2)), np.zeros((3, 3))),
        lambda: MassSystem(np.eye(2), np.zeros((2, 2)), np.diag([1.0, -1.0])),
        lambda: MassSystem(np.diag([1.0, 0.0]), np.zeros((2, 2)), np.eye(2)),
        lambda: MassSystem(np.eye(2), np.zeros((2, 2)), np.array([[1.0, 0.5], [0.0, 1.0]])),
        lambda: chain([1.0, 1.0], [1.0]),
        lambda: chain([1.0, 1.0], [1.0, -1.0]),
        lambda: chain([1.0, 1.0], [1.0, 1.0], [1.0, 1.0, 1.0]),
        lambda: influence_coefficients([0.1, 0.1], 1.0, 1.0),
        lambda: influence_coefficients([0.1, 1.2], 1.0, 1.0),
    ):
        with pytest.raises(InputError):
            wrong()


def test_peaks_at_the_border_of_having_one():
    assert peak_radius(0.8) == 1.0
    assert np.isinf(peak_radius(0.0))
    creeping = Oscillator.of_ratio(2.0, 0.9)
    assert creeping.peak_frequency == 0.0
    assert creeping.peak_receptance == pytest.approx(0.25)
    assert np.isinf(Rotor(1.0, 1e-3, (4.0, 4.0), (3.6, 3.6)).critical_speeds).all()
