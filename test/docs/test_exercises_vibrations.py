"""The exercises of vibrations by a second route: closed forms, not the program's own."""

import math

import numpy as np
import pytest
import scipy
from blocks import new_scene
from rotors import Rotor, influence_coefficients, peak_radius
from running import ROOT

import mechanism_sim as ms
from mechanism_sim.studies.modes import modes
from mechanism_sim.studies.response import read_source, response
from mechanism_sim.vibration.shafts import shaft_rigidity

NAME = 'docs/exercises.md'
PAGE = (ROOT / NAME).read_text('utf-8')
M, K = 2.0, 500.0
WN = math.sqrt(K / M)


def of_books(name, *changes):
    """A scene that the page takes from docs/books."""
    assert f'docs/books/{name}.yaml' in PAGE
    return ms.load_scene(str(ROOT / 'docs' / 'books' / f'{name}.yaml'), changes)


def damping(c):
    return f'springs.spring.damping={c} N s/m'


def test_free_vibrations():
    """Problems 6.1 to 6.5, 6.9, 6.10."""
    t = np.linspace(0.0, 1.0, 21)
    x = (
        ms.simulate(new_scene(PAGE, 'free'), duration=1.0).sample(t, 'position.mass')[
            'position.mass'
        ]
        - 0.3
    )
    assert x == pytest.approx(0.01 * np.cos(WN * t), abs=1e-12)
    x = (
        ms.simulate(new_scene(PAGE, 'pushed'), duration=1.0).sample(t, 'position.mass')[
            'position.mass'
        ]
        - 0.3
    )
    assert x == pytest.approx(0.1 / WN * np.sin(WN * t), abs=1e-12)
    for change, factor in (
        ('links.mass.mass=8 kg', 0.5),
        ('springs.spring.stiffness=2000 N/m', 2),
    ):
        (mode,) = modes(new_scene(PAGE, 'free', change))
        assert mode.frequency == pytest.approx(factor * WN / (2.0 * math.pi), rel=1e-12)
    for c in (20.0, 70.0):
        (mode, *_) = modes(new_scene(PAGE, 'free', damping(c)))
        assert mode.damping_ratio == pytest.approx(c / (2.0 * math.sqrt(K * M)), rel=1e-12)
    xi = 10.0 / (2.0 * math.sqrt(K * M))
    assert f'{2.0 * math.pi * xi / math.sqrt(1.0 - xi**2):.6f}' in PAGE


def test_forced_vibrations():
    """Problems 6.6 to 6.8, 6.11, 6.12, 6.20."""
    w = 2.0 * math.pi * np.linspace(1.0, 4.0, 7)
    for c in (4.0, 20.0):
        machine = new_scene(PAGE, 'free', damping(c))
        source = read_source(machine, force='mass', direction=0.5 * math.pi)
        found = response(machine, source, ['position.mass'], w / (2.0 * math.pi))
        expected = 1.0 / (K - M * w**2 + 1j * c * w)
        assert found.amplitudes['position.mass'] == pytest.approx(expected, rel=1e-10)
    source = read_source(machine, base='base')
    found = response(machine, source, ['position.mass'], w / (2.0 * math.pi))
    moved = (K + 20.0j * w) / (K - M * w**2 + 20.0j * w)
    assert found.amplitudes['position.mass'] == pytest.approx(moved, rel=1e-10)
    # seen from the base it is a force -m y''
    assert moved - 1.0 == pytest.approx(M * w**2 / (K - M * w**2 + 20.0j * w), rel=1e-12)
    unbalance = 2.0 * 5e-3 * (20.0 * math.pi) ** 2
    turning = 20.0 * math.pi
    size = abs(unbalance / (2e4 - 22.0 * turning**2 + 100.0j * turning))
    assert f'{size:.6g}' in PAGE
    for name in ('free', 'pushed'):
        load = 'loads={force: {at: mass, force: [0, "3*sin(20*t)"]}}'
        last = ms.simulate(new_scene(PAGE, name, damping(20.0), load), duration=8.0).sample(
            8.0, 'position.mass'
        )
        steady = (-3.0j / (K - M * 400.0 + 400.0j) * np.exp(160.0j)).real
        assert last['position.mass'][0] - 0.3 == pytest.approx(steady, abs=1e-11)
    for w, size in ((10.0, 3.0), (20.0, 2.0)):
        alone = size / abs(K - M * w**2 + 4.0j * w)
        assert f'{alone:.6g}' in PAGE


def test_two_masses_and_shafts():
    """Problems 6.13 to 6.17."""
    stiffness = np.array([[500.0, -200.0], [-200.0, 600.0]])
    squares, shapes = scipy.linalg.eigh(stiffness, np.diag([1.0, 2.0]))
    found = modes(of_books('two_masses'))
    for mode, square, shape in zip(found, squares, shapes.T, strict=True):
        assert mode.frequency == pytest.approx(math.sqrt(square) / (2.0 * math.pi), rel=1e-10)
        assert f'{mode.frequency:.6g}' in PAGE
        ratio = mode.shape['two'] / mode.shape['one']
        assert ratio == pytest.approx(shape[1] / shape[0], rel=1e-9)
    C = np.array([[6.0, 0.0], [0.0, 0.0]])
    mass = np.diag([1.0, 2.0])
    state = np.block([[np.zeros((2, 2)), np.eye(2)],
                      [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, C)]])  # fmt: skip
    roots, vectors = np.linalg.eig(state)
    damped = modes(of_books('two_masses', 'springs.first.damping=6 N s/m'))
    for mode in damped:
        k = int(np.argmin(np.abs(np.abs(roots) - 2.0 * math.pi * mode.frequency)))
        assert abs(roots[k]) == pytest.approx(2.0 * math.pi * mode.frequency, rel=1e-9)
        ratio = vectors[1, k] / vectors[0, k]
        given = mode.shape['two'] / mode.shape['one']
        assert min(abs(given - ratio), abs(given - ratio.conjugate())) < 1e-9
        assert abs(ratio.imag) > 1e-3
    J, S = np.diag([0.05, 0.03]), np.array([[1300.0, -500.0], [-500.0, 500.0]])
    expected = np.sqrt(scipy.linalg.eigh(S, J, eigvals_only=True)) / (2.0 * math.pi)
    undamped = {'springs.front.damping': '0 N m s/rad', 'springs.rear.damping': '0 N m s/rad'}
    found = [m.frequency for m in modes(ms.load_scene('torsional_shaft', undamped))]
    assert found == pytest.approx(expected, rel=1e-9)


def test_rotors():
    """Problems 6.18, 6.19."""
    w = 30.0 * math.pi
    push = 10.0 * 1e-3 * w**2
    x = push / abs(25e3 - 10.0 * w**2 + 50.0j * w)
    y = push / abs(49e3 - 10.0 * w**2 + 60.0j * w)
    assert f'{x:.6g}' in PAGE
    assert f'{y:.6g}' in PAGE
    for xi in (0.05, 0.1, 0.2):
        d = 2.0 * xi * math.sqrt(4e4 * 10.0)
        speed = np.linspace(55.0, 80.0, 100001)
        radius = speed**2 / np.abs(4e3 - speed**2 + 1j * d / 10.0 * speed)
        assert float(peak_radius(xi)) == pytest.approx(radius.max(), rel=1e-8)
        best = Rotor(10.0, 1e-3, (4e4, 4e4), (d, d)).critical_speeds[0]
        assert best == pytest.approx(speed[radius.argmax()], abs=1e-3)


def test_a_vehicle_on_a_rough_road():
    """Exercise 6.1: three equations in matrices."""
    machine = of_books('vehicle')
    mass = np.diag([40.0, 350.0, 75.0])

    def row(tyre, suspension, seat):
        return np.array([[tyre + suspension, -suspension, 0.0],
                         [-suspension, suspension + seat, -seat], [0.0, -seat, seat]])  # fmt: skip

    stiffness, damper = row(180e3, 20e3, 15e3), row(50.0, 1500.0, 300.0)
    f = np.linspace(10.0, 110.0, 11) / 3.6 / 5.0
    source = read_source(machine, base='road')
    found = response(machine, source, ['position.passenger'], f).amplitudes['position.passenger']
    for k, w in enumerate(2.0 * math.pi * f):
        push = np.array([180e3 + 50.0j * w, 0.0, 0.0])
        x = np.linalg.solve(stiffness + 1j * w * damper - w**2 * mass, push)
        assert found[k] == pytest.approx(x[2], rel=1e-9)


def test_the_diameter_of_a_shaft_with_two_gears():
    """Exercise 6.2: deflections by integrating the bending moment twice."""
    at, L, d = (0.040, 0.130), 0.165, 0.02
    rigidity = 2.0e11 * math.pi * d**4 / 64.0
    z = np.linspace(0.0, L, 20001)
    alpha = np.empty((2, 2))
    for j, b in enumerate(at):
        moment = np.where(z < b, z * (L - b) / L, b * (L - z) / L)
        slope = scipy.integrate.cumulative_simpson(moment / rigidity, x=z, initial=0.0)
        bent = scipy.integrate.cumulative_simpson(slope, x=z, initial=0.0)
        alpha[:, j] = np.interp(at, z, bent[-1] * z / L - bent)
    assert alpha == pytest.approx(
        influence_coefficients(at, L, shaft_rigidity(2.0e11, d)), rel=1e-6
    )
    squares = 1.0 / np.sort(np.linalg.eigvals(alpha @ np.diag([1.3, 0.7])))[::-1]
    f = np.sqrt(squares) / (2.0 * math.pi)
    low, high = 2000.0 / 60.0 * 25.0, 3000.0 / 60.0 * 30.0
    assert f[0] < low  # 20 mm: between both
    assert f[1] > high
    for bound, one in ((high, f[1]), (low, f[0]), (high, f[0])):
        assert f'{1e3 * d * math.sqrt(bound / one):.3f}' in PAGE
