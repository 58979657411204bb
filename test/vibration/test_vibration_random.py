"""1,000 random vibrating systems: closed form against the state-space solution, to 1e-10."""

from __future__ import annotations

import numpy as np
import pytest
import state_space
from excitations import PeriodicForce, base_excited, periodic_response
from masses import MassSystem, chain
from oscillator import Oscillator
from rotors import DiskRotor, Rotor, influence_coefficients
from two_masses import TwoMasses

from mechanism_sim.vibration.systems import state_matrix

#: of each kind; ten kinds
COUNT = 100
BOUND = 1e-10


def oscillator(random):
    """Any damping, critical too; frequencies and masses over four decades."""
    wn, mass = 10.0 ** random.uniform(-2, 2, 2)
    xi = random.choice([0.0, 1.0, random.uniform(0, 1), 10.0 ** random.uniform(-3, 2)])
    return Oscillator.of_ratio(wn, xi, mass)


def matrix(o):
    return state_matrix(*(np.array([[x]]) for x in (o.mass, o.damping, o.stiffness)))


def push(o, amplitude):
    return state_space.input_vector(np.array([[o.mass]]), [amplitude])


def times(random, o):
    return np.sort(random.uniform(0, 8 * o.period, 12))


def complex_number(random):
    return complex(*random.normal(size=2))


def agree(response, states):
    """Displacements and velocities, each against the greatest of its kind."""
    for found, expected in zip(response, np.split(states, 2), strict=True):
        assert np.abs(found - expected).max() <= BOUND * np.abs(expected).max()


def matrices(random, n, proportional):
    """M, C, K of n masses, far from repeated roots."""
    M = np.diag(10.0 ** random.uniform(-1, 1, n))
    B = random.normal(size=(n, n))
    K = 10.0 ** random.uniform(0, 3) * (B @ B.T + 0.1 * np.eye(n))
    if proportional:
        alpha, beta = random.uniform(0, 1, 2)
        return M, alpha * M + 0.02 * beta * K, K
    B = random.normal(size=(n, n))
    return M, random.uniform(0, 1) * B @ B.T, K


@pytest.fixture(params=range(COUNT))
def random(request):
    return np.random.default_rng(request.param)


def test_free(random):
    o = oscillator(random)
    t, start = times(random, o), random.normal(size=2) * (1.0, o.natural_frequency)
    agree(o.free(t, *start), state_space.free(matrix(o), t, start))


def test_forced_at_resonance_and_off_it(random):
    o = oscillator(random)
    t, start = times(random, o), random.normal(size=2) * (1.0, o.natural_frequency)
    force = complex_number(random) * o.stiffness
    w = o.natural_frequency * random.choice([0.0, 1.0, 1.0 + 1e-9, random.uniform(0, 3)])
    states = state_space.forced(matrix(o), t, push(o, force), [w], start)
    agree(o.forced(t, force, w, *start), states)
    if o.decay_rate > 0.0:
        steady = state_space.steady(matrix(o), push(o, force), w)
        assert abs(steady[0] / force - o.receptance(w)) <= BOUND * abs(o.receptance(w))


def test_base_excitation(random):
    o = oscillator(random)
    t, start = times(random, o), random.normal(size=2) * (1.0, o.natural_frequency)
    base, w = complex_number(random), o.natural_frequency * random.uniform(0, 3)
    # the base is a second body, so heavy that nothing moves it: it enters as acceleration
    relative_start = start - (base.real, (1j * w * base).real)
    shaken = push(o, o.mass * w**2 * base)
    states = state_space.forced(matrix(o), t, shaken, [w], relative_start)
    motion = base * np.exp(1j * w * t)
    carried = np.array([motion.real, (1j * w * motion).real])
    agree(base_excited(o, t, base, w, *start), states + carried)


def test_periodic_excitation(random):
    o = oscillator(random)
    t, start = times(random, o), random.normal(size=2) * (1.0, o.natural_frequency)
    harmonics = random.normal(size=(6, 2)) @ (1.0, 1.0j) * o.stiffness
    w = o.natural_frequency * random.uniform(0.05, 2)
    force = PeriodicForce(w, o.stiffness * random.normal(), harmonics)
    inputs = [push(o, a) for a in (force.mean, *harmonics)]
    states = state_space.forced(matrix(o), t, inputs, [0.0, *force.frequencies], start)
    agree(periodic_response(o, t, force, *start), states)


@pytest.mark.sample(40)
def test_two_masses(random):
    m1, m2, k1, k2 = 10.0 ** random.uniform(-1, 1, 4)
    two = TwoMasses(m1, m2, k1, k2)
    system = two.system
    t = np.sort(random.uniform(0, 50, 12))
    start = random.normal(size=4)
    states = state_space.free(system.state_matrix, t, start)
    found = two.free_undamped(t, start[:2], start[2:])
    assert np.abs(found - states[:2]).max() <= BOUND * np.abs(states[:2]).max()
    c1, c2 = random.uniform(0.01, 2, 2)
    damped, w = TwoMasses(m1, m2, k1, k2, c1, c2), random.uniform(0, 5)
    p = random.normal(size=4) @ np.kron(np.eye(2), [[1], [1j]])
    b = state_space.input_vector(damped.system.mass, p)
    steady = state_space.steady(damped.system.state_matrix, b, w)[:2]
    assert np.abs(damped.steady(w, *p) - steady).max() <= BOUND * np.abs(steady).max()
    found, expected = np.sort_complex(damped.roots), np.linalg.eigvals(damped.system.state_matrix)
    assert np.abs(found - np.sort_complex(expected)).max() < 1e-7  # double roots are not excluded


@pytest.mark.sample(40)
def test_modes_with_proportional_damping(random):
    n = int(random.integers(2, 9))
    system = MassSystem(*matrices(random, n, proportional=True))
    assert system.modes.decay_rates is not None
    t = np.sort(random.uniform(0, 60 / system.modes.frequencies[-1], 12))
    start, force = random.normal(size=(2, n)), random.normal(size=(n, 2)) @ (1.0, 1.0j)
    w = random.choice([0.0, system.modes.frequencies[0], system.modes.frequencies[-1] * 0.9])
    states = state_space.free(system.state_matrix, t, start.ravel())
    agree(system.free(t, *start), states)
    b = state_space.input_vector(system.mass, force)
    states = state_space.forced(system.state_matrix, t, b, [w], start.ravel())
    agree(system.forced(t, force, w, *start), states)


@pytest.mark.sample(40)
def test_modes_with_any_damping(random):
    n = int(random.integers(2, 9))
    system = MassSystem(*matrices(random, n, proportional=False))
    assert system.modes.decay_rates is None
    t = np.sort(random.uniform(0, 60 / system.modes.frequencies[-1], 12))
    start = random.normal(size=(2, n))
    states = state_space.free(system.state_matrix, t, start.ravel())
    agree(system.damped_modes.free(t, *start), states)
    force, w = random.normal(size=(n, 2)) @ (1.0, 1.0j), random.uniform(0, 30)
    b = state_space.input_vector(system.mass, force)
    steady = state_space.steady(system.state_matrix, b, w)[:n]
    assert np.abs(system.steady(force, w) - steady).max() <= BOUND * np.abs(steady).max()


def test_chains_with_dampers_like_springs(random):
    n = int(random.integers(1, 12))
    m, k = 10.0 ** random.uniform(-1, 1, n), 10.0 ** random.uniform(0, 2, n + random.integers(2))
    k[0] *= random.choice([0.0, 1.0])  # free at one end, or held
    system = chain(m, k, k * random.choice([0.0, 1e-2]))
    t = np.sort(random.uniform(0, 5, 12))
    start = random.normal(size=(2, n))
    agree(system.free(t, *start), state_space.free(system.state_matrix, t, start.ravel()))


@pytest.mark.sample(40)
def test_rotors(random):
    mass, e, kx, ky, cx, cy = 10.0 ** random.uniform(-1, 1, 6)
    rotor = Rotor(mass, e, (kx, ky), (cx, cy))
    w = rotor.directions[0].natural_frequency * random.choice([1.0, random.uniform(0, 3)])
    t = np.sort(random.uniform(0, 40 / w, 12))
    M, C, K = mass * np.eye(2), np.diag([cx, cy]), np.diag([kx, ky])
    A = state_matrix(M, C, K)
    b = state_space.input_vector(M, mass * e * w**2 * np.array([1, -1j]))
    path = state_space.forced(A, t, b, [w], np.zeros(4))[:2]
    assert np.abs(rotor.motion(t, w) - path).max() <= BOUND * np.abs(path).max()
    steady = state_space.steady(A, b, w)[:2]
    orbit = (steady[:, None] * np.exp(1j * w * t)).real
    assert np.abs(rotor.whirl(w).points(w * t) - orbit).max() <= BOUND * np.abs(steady).max()


def test_rotors_with_disks(random):
    n = int(random.integers(2, 5))
    places = np.cumsum(random.uniform(0.2, 0.6, n))
    K = np.linalg.inv(influence_coefficients(places, places[-1] + 0.3, 6e4))
    masses, B = random.uniform(5, 30, n), random.normal(size=(n, n))
    e = 1e-5 * (random.normal(size=(n, 2)) @ (1.0, 1.0j))
    rotor = DiskRotor(masses, e, K, 1e2 * B @ B.T)
    w = random.choice([*rotor.critical_speeds, random.uniform(10, 1000)])
    A = state_matrix(np.diag(masses), rotor.damping, K)
    b = state_space.input_vector(np.diag(masses), masses * e * w**2)
    steady = state_space.steady(A, b, w)[:n]
    assert np.abs(rotor.amplitudes(w) - steady).max() <= BOUND * np.abs(steady).max()
