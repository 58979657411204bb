"""The vibration library against energy, geometry and solutions in pieces."""

from __future__ import annotations

import doctest

import numpy as np
import pytest
import state_space
from damping import logarithmic_decrement
from excitations import PeriodicForce, periodic_response, series_of
from masses import MassSystem, chain
from orbits import Orbit
from oscillator import Oscillator
from rotors import DiskRotor, Rotor, influence_coefficients
from running import ROOT
from scipy.integrate import solve_ivp
from torsional import (
    disk_inertia,
    disks,
    in_series,
    referred,
    shaft_stiffness,
)

from mechanism_sim.errors import InputError
from mechanism_sim.vibration.shafts import shaft_rigidity
from mechanism_sim.vibration.systems import state_matrix


def test_state_space_against_an_integrator():
    """The other route of the other tests, once against SciPy's."""
    M, C, K = np.diag([1.0, 2.0]), np.array([[0.3, -0.1], [-0.1, 0.2]]), np.diag([4.0, 9.0])
    A, force, w = state_matrix(M, C, K), np.array([1.0 + 2.0j, -1.0j]), 1.7
    b, start, t = state_space.input_vector(M, force), [1.0, -1.0, 0.5, 0.0], np.linspace(0, 9, 7)
    found = solve_ivp(
        lambda t, x: A @ x + (b * np.exp(1j * w * t)).real,
        (0, 9), start, t_eval=t, method='DOP853', rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    np.testing.assert_allclose(
        state_space.forced(A, t, b, [w], start), found.y, rtol=1e-9, atol=1e-10
    )


def test_energy_of_a_free_vibration_goes_into_the_damper():
    o = Oscillator.of_coefficients(2.0, 0.7, 30.0)
    t = np.linspace(0.0, 6.0, 4001)
    y, v = o.free(t, 0.3, -1.0)
    energy = o.stiffness * y**2 / 2 + o.mass * v**2 / 2
    nodes, weights = np.polynomial.legendre.leggauss(60)
    v = o.free(3.0 * (1 + nodes), 0.3, -1.0).velocity
    assert energy[0] - energy[-1] == pytest.approx(3.0 * weights @ (o.damping * v**2), rel=1e-12)
    assert (np.diff(energy) <= 0.0).all()


def test_many_oscillators_at_once():
    wn, t = np.array([[1.0], [2.0], [3.0]]), np.linspace(0, 5, 6)
    many = Oscillator(wn, np.array([[0.0], [2.0], [5.0]]))
    for row, each in zip(many.free(t, 1.0, 0.5).displacement, many.natural_frequency, strict=True):
        one = Oscillator(each[0], {1.0: 0.0, 2.0: 2.0, 3.0: 5.0}[each[0]])
        np.testing.assert_array_equal(row, one.free(t, 1.0, 0.5).displacement)


def test_transmissibility_meets_at_the_root_of_two():
    """All dampings pass the same there; below more damping isolates, above it harms."""
    many = Oscillator(3.0, 3.0 * np.array([0.05, 0.2, 1.0, 4.0]))
    at, below, above = (abs(many.transmissibility(3.0 * r)) for r in (np.sqrt(2), 1.0, 3.0))
    np.testing.assert_allclose(at, 1.0, rtol=1e-14)
    assert (np.diff(below) < 0).all()
    assert (np.diff(above) > 0).all()


def test_fourier_series_of_a_square_wave():
    series = series_of(lambda t: np.where(t < 1.0, 3.0, -1.0), 2.0, 9, [1.0])
    j = np.arange(1, 10)
    assert series.mean == pytest.approx(1.0, abs=1e-14)
    expected = np.where(j % 2, -1j * 8.0 / (np.pi * j), 0.0)
    np.testing.assert_allclose(series.amplitudes, expected, atol=1e-13)


def test_fourier_series_of_itself():
    wave = PeriodicForce(2 * np.pi / 3.0, 0.4, np.array([1.0 - 2.0j, 0.0, 0.5j]))
    again = series_of(wave, 3.0, 3)
    assert again.mean == pytest.approx(0.4)
    assert again.frequency == wave.frequency
    np.testing.assert_allclose(again.amplitudes, wave.amplitudes, atol=1e-14)
    assert again.rest < 1e-13
    less = series_of(wave, 3.0, 2)
    assert less.rest == pytest.approx(np.sqrt(0.125), rel=1e-12)
    for wrong in ({'period': 0.0}, {'breaks': [2.0]}):
        with pytest.raises(InputError):
            series_of(np.cos, **{'period': 1.0, 'harmonics': 3, **wrong})


def test_steady_response_to_a_square_wave():
    """Solved in pieces of constant force; the harmonics fall as the third power."""
    o = Oscillator.of_coefficients(1.5, 0.4, 20.0)
    A = state_matrix(*(np.array([[x]]) for x in (o.mass, o.damping, o.stiffness)))
    half, force = 0.9, 2.0
    # symmetry: after half a period the state is reversed, -x = R x + s
    rest = np.array([force / o.stiffness, 0.0])
    R = np.column_stack([state_space.free(A, half, e)[:, 0] for e in np.eye(2)])
    start = np.linalg.solve(-np.eye(2) - R, rest - R @ rest)
    t = np.linspace(0.0, half, 20)
    exact = rest[0] + state_space.free(A, t, start - rest)[0]
    series = series_of(lambda t: np.where(t < half, force, -force), 2 * half, 400, [half])
    np.testing.assert_allclose(series.passed(o.receptance)(t), exact, atol=1e-7)
    late = periodic_response(o, t + 200 * half, series).displacement
    np.testing.assert_allclose(late, series.passed(o.receptance)(t), atol=1e-12)


def test_decrement_of_noisy_maxima():
    """The fit over all maxima is nearer than that of the first two."""
    random, o = np.random.default_rng(1), Oscillator.of_ratio(1.0, 0.01)
    peaks = np.exp(-o.decay_rate * 2 * np.pi / o.damped_frequency * np.arange(30))
    noisy = peaks * (1 + 0.02 * random.normal(size=30))
    right = logarithmic_decrement(peaks)
    assert abs(logarithmic_decrement(noisy) - right) < abs(
        logarithmic_decrement(noisy[:2]) - right
    )
    assert logarithmic_decrement(noisy) == pytest.approx(right, rel=0.02)
    for wrong in ([1.0], [1.0, 0.0]):
        with pytest.raises(InputError):
            logarithmic_decrement(wrong)


def test_matrices_of_a_row():
    """Against the potential energy of its springs, with a spring behind the last mass too."""
    k, y = np.array([2.0, 3.0, 5.0, 7.0]), np.array([0.3, -0.2, 0.4])
    system = chain([1.0, 2.0, 3.0], k, 0.1)
    ends = np.concatenate([[0.0], y, [0.0]])
    assert y @ system.stiffness @ y == pytest.approx(k @ np.diff(ends) ** 2)
    assert y @ system.damping @ y == pytest.approx(0.1 * np.sum(np.diff(ends) ** 2))
    np.testing.assert_array_equal(np.diag(system.mass), [1.0, 2.0, 3.0])
    short = chain([1.0, 2.0, 3.0], k[:3])
    np.testing.assert_array_equal(
        short.stiffness, [[5.0, -3.0, 0.0], [-3.0, 8.0, -5.0], [0.0, -5.0, 5.0]]
    )


def test_long_rows_are_waves():
    """n equal masses between walls: 2 sqrt(k/m) sin(j pi/(2 (n + 1)))."""
    n = 40
    system = chain(np.ones(n), np.full(n + 1, 9.0))
    expected = 6.0 * np.sin(np.arange(1, n + 1) * np.pi / (2 * (n + 1)))
    np.testing.assert_allclose(system.modes.frequencies, expected, rtol=1e-12)
    shapes = system.modes.shapes
    np.testing.assert_allclose(shapes.T @ system.mass @ shapes, np.eye(n), atol=1e-13)
    shape = shapes[:, 4] / np.abs(shapes[:, 4]).max()
    wave = np.sin(5 * np.pi * np.arange(1, n + 1) / (n + 1))
    np.testing.assert_allclose(np.abs(shape), np.abs(wave) / np.abs(wave).max(), atol=1e-12)


def test_frequency_response_is_symmetric_and_made_of_modes():
    """Receptance as a sum over modes (proportional damping) against the inverse impedance."""
    system = chain([1.0, 2.0, 1.5], [10.0, 20.0, 5.0], [0.1, 0.2, 0.05])
    modes, w = system.modes, np.array([0.3, 2.0, 7.0])
    assert modes.decay_rates is not None
    receptances = Oscillator(modes.frequencies[:, None], modes.decay_rates[:, None]).receptance(w)
    made = np.einsum('ij,jw,kj->wik', modes.shapes, receptances, modes.shapes)
    found = system.receptance(w)
    np.testing.assert_allclose(found, made, rtol=1e-12)
    np.testing.assert_allclose(found, found.transpose(0, 2, 1), rtol=1e-13)
    np.testing.assert_allclose(
        found @ system.impedance(w), np.tile(np.eye(3), (3, 1, 1)), atol=1e-13
    )


def test_a_tuned_mass_stills_the_first_one():
    """At its own frequency the added mass takes all of the motion."""
    system = chain([10.0, 1.0], [1000.0, 100.0])
    first, second = system.steady([5.0, 0.0], 10.0)
    assert abs(first) < 1e-16
    assert second == pytest.approx(-5.0 / 100.0)


def test_two_disks_on_a_free_shaft():
    J1, J2, k = 0.3, 0.2, 500.0
    frequencies = disks([J1, J2], [k]).modes.frequencies
    np.testing.assert_allclose(frequencies, [0.0, np.sqrt(k * (1 / J1 + 1 / J2))], rtol=1e-14)


def test_shafts_joined_by_gears():
    """Referred to the first shaft, against the energies of both, the gears' angle eliminated."""
    J1, J2, k1, k2, n = 0.3, 0.2, 500.0, 300.0, 2.5
    found = disks([J1, referred(J2, n)], [in_series(k1, referred(k2, n))]).modes.frequencies[1]
    stretch = np.array([[1.0, 0.0, -1.0], [0.0, -1.0, n]])  # of both shafts by (th1, th2, gear)
    K = stretch.T @ np.diag([k1, k2]) @ stretch
    K = K[:2, :2] - np.outer(K[:2, 2], K[2, :2]) / K[2, 2]
    assert found == pytest.approx(MassSystem(np.diag([J1, J2]), 0 * K, K).modes.frequencies[1])


def test_shafts_and_disks():
    """Rings add up: a hollow shaft and its core, side by side, are the solid one."""
    solid, hollow = shaft_stiffness(8e10, 0.5, 0.04), shaft_stiffness(8e10, 0.5, 0.04, 0.03)
    assert hollow + shaft_stiffness(8e10, 0.5, 0.03) == pytest.approx(solid)
    r = (np.arange(1000) + 0.5) / 1000 * 0.1
    assert disk_inertia(3.0, 0.2) == pytest.approx(3.0 * np.average(r**2, weights=r), rel=1e-6)


def curve(orbit, n=20_000):
    return orbit.points(np.linspace(0.0, 2 * np.pi, n, endpoint=False))


def test_orbits_are_ellipses_with_these_axes():
    random = np.random.default_rng(3)
    for _ in range(50):
        orbit = Orbit(*(random.normal(size=(2, 2)) @ (1.0, 1.0j)))
        x, y = curve(orbit)
        radius = np.hypot(x, y)
        a, b = orbit.semi_axes
        assert radius.max() == pytest.approx(a, rel=1e-6)
        assert radius.min() == pytest.approx(abs(b), rel=1e-4, abs=1e-3)
        area = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2  # positive counterclockwise
        assert area == pytest.approx(np.pi * a * b, rel=1e-6)
        end = np.array([np.cos(orbit.inclination), np.sin(orbit.inclination)])
        assert np.abs(end @ [x, y]).max() == pytest.approx(a, rel=1e-6)


def test_between_two_critical_speeds_a_rotor_whirls_backward():
    """Unequal stiffness: an ellipse, forward below and above, backward in between."""
    rotor = Rotor(2.0, 1e-3, (200.0, 450.0))
    np.testing.assert_allclose(rotor.critical_speeds, [10.0, 15.0])
    orbit = rotor.whirl(np.array([5.0, 9.9, 10.1, 12.0, 14.9, 15.1, 40.0]))
    a, b = orbit.semi_axes
    np.testing.assert_array_equal(np.sign(b), [1, 1, -1, -1, -1, 1, 1])
    assert (a > np.abs(b)).all()
    np.testing.assert_allclose(orbit.inclination[0], 0.0, atol=1e-12)  # softer along x
    centre = rotor.mass_centre(1e4)
    assert np.abs(curve(centre)).max() < 1e-8  # turns about its mass centre


def test_equal_stiffness_makes_circles():
    rotor = Rotor(2.0, 1e-3, (200.0, 200.0), (1.0, 1.0))
    orbit = rotor.whirl(8.0)
    x, y = curve(orbit, 100)
    np.testing.assert_allclose(np.hypot(x, y), orbit.semi_axes[0], rtol=1e-13)
    assert orbit.inclination == 0.0


def test_a_rotor_from_rest_ends_in_its_orbit():
    rotor = Rotor(2.0, 1e-3, (200.0, 450.0), (2.0, 3.0))
    assert np.abs(rotor.motion(np.zeros(1), 11.0)).max() == 0.0
    t = 80.0 + np.linspace(0.0, 1.0, 30)
    np.testing.assert_allclose(
        rotor.motion(t, 11.0), rotor.whirl(11.0).points(11.0 * t), atol=1e-12
    )


def test_the_two_disks_of_the_book():
    """Figure 6.36: two peaks at the critical speeds; disks together at first, then opposed."""
    places, span = np.array([0.325, 0.675]), 1.2
    K = np.linalg.inv(influence_coefficients(places, span, shaft_rigidity(200e9, 0.05)))
    masses = np.full(2, 7860 * np.pi * 0.25**2 / 4 * 0.05)
    first = DiskRotor(masses, np.zeros(2), K, np.zeros((2, 2))).critical_speeds[0]
    damping = np.full((2, 2), 0.02 * masses[0] * first / np.pi)
    rotor = DiskRotor(masses, np.array([35e-6, 46e-6]), K, damping)
    w = np.linspace(1.0, 1500.0, 150_000)
    z = rotor.amplitudes(w)
    radius = np.abs(z[:, 0])
    peaks = w[1:-1][(radius[1:-1] > radius[:-2]) & (radius[1:-1] > radius[2:])]
    np.testing.assert_allclose(peaks, rotor.critical_speeds, rtol=1e-3)
    apart = np.abs(np.angle(z[:, 0] / z[:, 1]))
    assert apart[w < 200].max() < 0.01
    assert abs(np.interp(rotor.critical_speeds[1], w, apart) - np.pi) < 0.01
    orbit = rotor.whirl(500.0, 1)
    assert orbit.semi_axes[0] == pytest.approx(abs(rotor.amplitudes(500.0)[1]))
    assert orbit.semi_axes[1] == pytest.approx(orbit.semi_axes[0])  # a circle, forward


def test_influence_coefficients_of_many_loads_make_the_beam():
    """Equal loads close together bend it as an even load does: 5 q L^4/(384 E I) in the middle."""
    n = 401
    x = (np.arange(n) + 0.5) / n * 2.0
    deflection = influence_coefficients(x, 2.0, 30.0) @ np.full(n, 2.0 / n)
    assert deflection[n // 2] == pytest.approx(5 * 2.0**4 / (384 * 30.0), rel=1e-4)


def test_the_examples_of_the_documentation():
    page = ROOT / 'docs' / 'vibration.md'
    text = page.read_text(encoding='utf-8').replace('```', '')  # fences would count as output
    examples = doctest.DocTestParser().get_doctest(text, {}, page.name, str(page), 0)
    assert doctest.DocTestRunner().run(examples) == (0, len(examples.examples))
    assert len(examples.examples) > 20
