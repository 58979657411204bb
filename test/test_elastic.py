"""Elastic links: against closed forms of beams, and against other formulations."""

import numpy as np
import pytest

from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.linearisation import Linearisation
from mechanism_sim.planar.mechanism import Body, Mechanism
from mechanism_sim.scene.build import build
from mechanism_sim.scene.schema import Scene
from mechanism_sim.study.modes import linearised, modes, natural_modes

TURN = 2.0 * np.pi
L, EI, EA, RHO = 0.4, 12.0, 5e6, 0.3
"""Length [m], stiffnesses [N m^2], [N] and mass per length [kg/m] of a beam."""

SECTION = {'youngs_modulus': 1e11, 'second_moment': EI / 1e11, 'area': EA / 1e11,
           'density': RHO / (EA / 1e11)}  # fmt: skip
PINNED = np.pi * np.arange(1, 9)
CLAMPED = np.array([1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349])
FREE = np.array([4.7300407449, 7.8532046241, 10.9956078380])
"""Roots ``k L`` of the frequency equations of uniform beams (e.g. [V] and any handbook)."""


def scene(**parts):
    whole = {'title': 's', 'mechanism': 'linkage', 'gravity': [0.0, 0.0], **parts}
    return build('s', Scene.model_validate(whole))


def hertz(roots):
    return roots**2 * np.sqrt(EI / RHO) / L**2 / TURN


def arm(speed=0.0, gravity=(0.0, 0.0), loads=None, **elastic):
    """A beam clamped to a hub that turns steadily."""
    rotor = {'length': L, 'elastic': {**SECTION, 'ends': 'clamped', **elastic}}
    return scene(
        links={'arm': rotor},
        joints={'hub': {'revolute': ['ground', 'arm']}},
        drive={'coordinate': 'arm', 'speed': speed},
        gravity=list(gravity),
        **({'loads': loads} if loads else {}),
    )


def column(thrust=0.0, **elastic):
    """A beam between a held crank and a slider in line with it, under a force along it."""
    return scene(
        links={
            'crank': {'length': 0.1, 'mass': 1.0, 'inertia': 0.01},
            'rod': {'length': L, 'elastic': {**SECTION, **elastic}},
            'slider': {'mass': 0.2},
        },
        joints={
            'a': {'revolute': ['ground', 'crank']},
            'b': {'revolute': ['crank.end', 'rod']},
            'c': {'revolute': ['rod.end', 'slider']},
            'd': {'prismatic': ['ground', 'slider']},
        },
        loads={'thrust': {'force': [-thrust, 0.0], 'at': 'slider'}},
        drive={'coordinate': 'crank', 'speed': 0.0},
        guess={'slider': 0.1 + L},
    )


def frequencies(machine):
    return np.array([mode.frequency for mode in modes(machine)])


def test_natural_frequencies_of_pinned_and_clamped_beams():
    assert frequencies(column(modes=3)) == pytest.approx(hertz(PINNED[:3]), rel=1e-10)
    assert frequencies(arm(modes=4)) == pytest.approx(hertz(CLAMPED), rel=1e-9)
    # polynomials come from above, and converge fast (Ritz)
    for machine, roots in ((column, PINNED), (arm, CLAMPED)):
        few, more = (
            frequencies(machine(functions='polynomial', modes=n))[:2] / hertz(roots[:2]) - 1.0
            for n in (3, 6)
        )
        assert (few > 0.0).all()
        assert (np.abs(more) < [1e-6, 1e-3]).all()
        assert (more < few).all()


def test_a_free_beam_vibrates_as_it_should():
    beam = Beam(L, EI, EA, RHO, 1e11, modes=8, functions='polynomial')
    body = Body('bar', RHO * L, RHO * L**3 / 12.0, (L / 2, 0.0), beam)
    found = Linearisation(Mechanism((body,), (), ()), [], [])
    at = found.point(np.zeros(11), np.zeros(11))
    linear = found(at)
    f = [f for f, _, _ in natural_modes(linear.M, linear.C, linear.K)]
    assert f[:3] == pytest.approx(np.zeros(3), abs=1e-3)
    assert np.array(f[3:5]) == pytest.approx(hertz(FREE[:2]), rel=1e-4)


def test_stretch_has_the_frequencies_of_a_rod():
    machine = arm(modes=1, stretch=4)
    speed = np.sqrt(EA / RHO)
    exact = (2.0 * np.arange(1, 3) - 1.0) / 4.0 * speed / L
    found = frequencies(machine)
    axial = [found[np.abs(found / f - 1.0).argmin()] for f in exact]
    assert np.array(axial) == pytest.approx(exact, rel=3e-3)


def test_polynomials_bend_under_an_end_load_as_statics_says():
    F = 3.0
    machine = arm(functions='polynomial', modes=2, loads={
        'end': {'force': [0.0, -F], 'at': 'arm.end'}
    })  # fmt: skip
    at = linearised(machine).at
    beam = machine.mechanism.beams['arm']
    q = at.q[1:]
    assert beam.deflection(L) @ q == pytest.approx(-F * L**3 / (3.0 * EI), rel=2e-3)
    x = np.linspace(0.0, L, 5)
    exact = -F * x**2 * (3.0 * L - x) / (6.0 * EI)
    assert q @ beam.deflection(x) == pytest.approx(exact, rel=2e-3, abs=1e-15)
    # what is left is the foreshortening's work, of third order
    small = arm(functions='polynomial', modes=2, loads={
        'end': {'force': [0.0, -F * 1e-3], 'at': 'arm.end'}
    })  # fmt: skip
    q = linearised(small).at.q[1:]
    assert beam.deflection(L) @ q == pytest.approx(-1e-3 * F * L**3 / (3.0 * EI), rel=1e-8)


def test_modes_bend_under_weight_as_statics_says():
    machine = arm(modes=4, gravity=(0.0, -9.81))
    beam = machine.mechanism.beams['arm']
    tip = beam.deflection(L) @ linearised(machine).at.q[1:]
    assert tip == pytest.approx(-RHO * 9.81 * L**4 / (8.0 * EI), rel=1e-4)


def test_thrust_softens_a_beam_until_it_buckles():
    """Euler: ``w^2 = w0^2 (1 - P/P_cr)`` of the first mode, ``P_cr = pi^2 EI/L^2``."""
    critical = np.pi**2 * EI / L**2
    for share in (-2.0, 0.3, 0.9):
        found = frequencies(column(share * critical, modes=1))
        assert found[0] == pytest.approx(hertz(PINNED[0]) * np.sqrt(1.0 - share), rel=1e-9)
    stiff = frequencies(column(0.9 * critical, modes=1, foreshortening=False))
    assert stiff[0] == pytest.approx(hertz(PINNED[0]), rel=1e-9)


@pytest.mark.parametrize(('spin', 'root'), [(1.0, 3.6816), (3.0, 4.7973), (10.0, 11.2023)])
def test_a_turning_beam_is_stiffened(spin, root):
    """Wright, Smith, Thresher and Wang (1982): out of the plane; in it less the spin's square."""
    unit = np.sqrt(EI / RHO) / L**2
    machine = arm(spin * unit, functions='polynomial', modes=6)
    found = TURN * frequencies_turning(machine)[0] / unit
    assert found == pytest.approx(np.sqrt(root**2 - spin**2), rel=1e-4)


def frequencies_turning(machine):
    speed = machine.law.coefficients[1]
    derivatives = linearised(machine).derivatives
    n = len(derivatives.coordinates)
    v = np.zeros(n)
    v[0] = speed
    linear = derivatives(derivatives.point(np.zeros(n), v))
    free = derivatives.free
    M, C, K = (x[np.ix_(free, free)] for x in (linear.M, linear.C, linear.K))
    return [f for f, _, _ in natural_modes(M, C, K)]


def test_damping_is_what_is_asked_for():
    found = modes(column(modes=2, damping=0.03))
    assert [mode.damping_ratio for mode in found] == pytest.approx([0.03, 0.03])
    a, b = 4.0, 2e-5
    found = modes(column(modes=2, rayleigh={'mass': a, 'stiffness': b}))
    for mode in found:
        w = TURN * mode.frequency
        assert mode.damping_ratio == pytest.approx(0.5 * (a / w + b * w))
