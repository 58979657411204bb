"""Every linkage that comes as a scene: loops, rates, forces and energy by routes of their own."""

from __future__ import annotations

import numpy as np
import pytest
from linkages import cycle, duration, free_bodies, opened

import mechanism_sim as ms
from mechanism_sim.scene.files import read_scene, scene_names

SCENES = [name for name in scene_names() if read_scene(name)[1].mechanism == 'linkage']


@pytest.mark.parametrize('name', SCENES)
def test_loops_stay_closed_and_energy_balances(name):
    machine, _, seen, solution = cycle(name)
    for joint in machine.mechanism.joints:
        assert opened(machine, seen, joint).max() < 1e-12, joint.name
    energy = solution.energy
    scale = np.abs([energy.initial, energy.final, energy.drive_work, energy.dissipated]).max()
    assert abs(energy.residual) < 1e-9 * scale


@pytest.mark.parametrize('name', SCENES)
def test_forces_are_those_of_free_bodies(name):
    machine, t, seen, _ = cycle(name, 40)
    t, seen = t[1:-1], {k: x[1:-1] for k, x in seen.items()}  # a load may begin with the turn
    forces, efforts = free_bodies(machine, seen, t)
    names = [j.name for j in machine.mechanism.joints]
    mine = np.array([seen[f'reaction.{j}.x'] + 1j * seen[f'reaction.{j}.y'] for j in names]).T
    assert np.abs(mine - forces).max() < 1e-9 * np.abs(forces).max()
    if efforts.shape[1] and machine.main not in machine.mechanism.displacements:
        assert np.abs(seen['drive_torque'] - efforts[:, 0]).max() < 1e-9 * np.abs(efforts).max()


@pytest.mark.parametrize('name', SCENES)
def test_rates_and_accelerations_are_derivatives(name):
    """By differences of sixth order, away from corners of a drive's profile."""
    machine = ms.load_scene(name)
    solution = ms.simulate(machine, duration=duration(machine))
    h = 1e-3 * solution.duration
    t = solution.duration * np.array([0.113, 0.317, 0.477, 0.629, 0.871])
    around = [solution.sample(t + k * h) for k in range(-3, 4)]
    for c in machine.mechanism.coordinates:
        for order, low, high in ((1, 'position', 'velocity'), (2, 'velocity', 'acceleration')):
            x = [seen[f'{low}.{c}'] for seen in around]
            slope = (45.0 * (x[4] - x[2]) - 9.0 * (x[5] - x[1]) + (x[6] - x[0])) / (60.0 * h)
            right = around[3][f'{high}.{c}']
            least = 1e-3 / solution.duration**order  # of links that do not turn
            scale = max(np.abs(right).max(), np.abs(x).max() / solution.duration, least)
            assert np.abs(slope - right).max() < 1e-7 * scale, (c, high)
