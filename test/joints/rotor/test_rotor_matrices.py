"""Stiffness, masses and damping of rotors, by statics of a lever and energies of a rigid body."""

import numpy as np
import pytest
import scipy
from builders import made

from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.studies.modes import modes

EXACT = {'rel': 1e-10, 'abs': 1e-13}
MASS, TURN = 8.0, 2.0 * np.pi


def rotor(**joint):
    return made({
        'links': {'disk': {'mass': MASS, 'inertia': 0.04}},
        'joints': {'shaft': {'rotor': ['ground', 'disk'], **joint}},
        'drive': {'coordinate': 'disk', 'speed': 1.0},
        'gravity': [0.0, 0.0],
    })  # fmt: skip


def springs(stiffness, along):
    return {
        name: {'stiffness': k, 'along': z}
        for name, k, z in zip(('left', 'right'), stiffness, along, strict=True)
    }


def test_a_disk_without_tilt_hangs_on_two_springs_as_on_a_lever():
    """Its weight F is shared by the lever rule; it sinks by what both supports sink."""
    (k1, k2), (z1, z2) = (3e5, 7e5), (-0.1, 0.25)
    machine = rotor(supports=springs((k1, k2), (z1, z2)))
    F = 10.0
    shares = F * z2 / (z2 - z1), -F * z1 / (z2 - z1)
    sunk = np.interp(0.0, (z1, z2), (shares[0] / k1, shares[1] / k2))
    found = [TURN * m.frequency for m in modes(machine)]
    assert found == pytest.approx([np.sqrt(F / sunk / MASS)] * 2, **EXACT)
    own = machine.mechanism.having(Rotor)['disk']
    still = np.zeros((2, 1))
    for name, share in zip(('left', 'right'), shares, strict=True):
        pull = own.support_force(name, np.array([[sunk], [0.0]]), still, np.zeros(1))
        assert pull[:, 0] == pytest.approx([-share, 0.0], **EXACT)


def test_two_disks_on_a_rigid_shaft_move_and_tilt_as_one_body():
    """By kinetic and elastic energy of displacement and tilt, in a plane along the shaft."""
    stiffness, along, z, more, tilt = (3e5, 7e5), (-0.1, 0.25), 0.18, 3.0, 0.05
    second = {'along': z, 'mass': more, 'inertia': 0.01, 'diametral_inertia': 0.02}
    machine = rotor(
        supports=springs(stiffness, along), disks={'second': second}, diametral_inertia=tilt
    )
    M = np.array([[MASS + more, more * z], [more * z, tilt + 0.02 + more * z**2]])
    K = sum(k * np.outer((1.0, x), (1.0, x)) for k, x in zip(stiffness, along, strict=True))
    plane = np.sqrt(scipy.linalg.eigvalsh(K, M))
    found = sorted(TURN * m.frequency for m in modes(machine))
    assert found == pytest.approx(np.repeat(plane, 2), **EXACT)


def test_internal_damping_of_a_shaft_that_does_not_turn_is_its_stiffness_times_a_time():
    """A ratio of ``w T/2``: the shaft's force is that of ``u + T u'``."""
    relaxation = 2e-4
    shaft = {'diameter': '20 mm', 'youngs_modulus': '210 GPa', 'relaxation': relaxation}
    ends = {'left': {'along': -0.2}, 'right': {'along': 0.4}}
    for mode in modes(rotor(supports=ends, shaft=shaft)):
        w = TURN * mode.frequency
        assert mode.damping_ratio == pytest.approx(0.5 * w * relaxation, **EXACT)
