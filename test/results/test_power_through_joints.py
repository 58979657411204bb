"""Power through joints against energies of links, of which closed forms of a slider-crank tell."""

import numpy as np
import pytest

import mechanism_sim as ms

R, L, G = 0.05, 0.2, 9.81
COG, ROD, INERTIA, PISTON, SPEED = 0.07, 0.6, 2800e-6, 0.5, 20.0 * np.pi


def energies(t):
    """Of the rod, kinetic and potential, and of the piston, at times that may be complex [J]."""
    a = SPEED * t
    b = -np.arcsin(R * np.sin(a) / L)
    rate = -R * SPEED * np.cos(a) / (L * np.cos(b))
    vx = -R * SPEED * np.sin(a) - COG * rate * np.sin(b)
    vy = R * SPEED * np.cos(a) + COG * rate * np.cos(b)
    height = R * np.sin(a) + COG * np.sin(b)
    rod = 0.5 * ROD * (vx**2 + vy**2) + 0.5 * INERTIA * rate**2 + ROD * G * height
    return rod, 0.5 * PISTON * (-R * SPEED * np.sin(a) - L * rate * np.sin(b)) ** 2


def test_what_enters_a_link_and_does_not_leave_it_changes_its_energy():
    t = np.linspace(0.0, 0.1, 41)
    seen = ms.simulate('slider_crank', duration=0.1).sample(t, 'power')
    rod, piston = (x.imag / 1e-30 for x in energies(t + 1e-30j))
    size = np.abs(rod).max()
    assert seen['power.rod_piston'] == pytest.approx(piston, abs=1e-9 * size)
    assert seen['power.crank_rod'] == pytest.approx(rod + piston, abs=1e-9 * size)
    assert 'power.ground_crank' not in seen
