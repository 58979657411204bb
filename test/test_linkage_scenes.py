"""Every linkage that comes as a scene: loops, rates, forces and energy by routes of their own."""

from __future__ import annotations

import numpy as np
import pytest
from linkages import cycle, duration, free_bodies, opened

import mechanism_sim as ms
from mechanism_sim.planar.mechanism import PinInSlot, Prismatic, Revolute
from mechanism_sim.scene.files import read_scene, scene_names

PLAIN = Revolute, Prismatic, PinInSlot


def plain(name):
    """Whether a scene is a linkage that stays one: nothing in it is loose or switches over."""
    if read_scene(name)[1].mechanism != 'linkage':
        return False
    machine = ms.load_scene(name)
    joints = machine.mechanism.joints
    return not machine.clearances and all(isinstance(j, PLAIN) for j in joints)


SCENES = [name for name in scene_names() if plain(name)]


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
    forces, moments, efforts = free_bodies(machine, seen, t)
    joints = machine.mechanism.joints
    mine = np.array(
        [seen[f'reaction.{j.name}.x'] + 1j * seen[f'reaction.{j.name}.y'] for j in joints]
    )
    assert np.abs(mine.T - forces).max() < 1e-9 * np.abs(forces).max()
    guides = [j.name for j in joints if isinstance(j, Prismatic)]
    for guide, right in zip(guides, moments.T, strict=True):
        moment = seen.get(f'reaction.{guide}.moment', 0.0)
        assert np.abs(moment - right).max() < 1e-9 * machine.mechanism.size * np.abs(forces).max()
    for i, (c, right) in enumerate(zip(machine.plan.prescribed, efforts.T, strict=True)):
        effort = seen[f'drive_torque.{c}' if i else 'drive_torque']
        assert np.abs(effort - right).max() < 1e-9 * np.abs(efforts).max(), c


@pytest.mark.parametrize('name', SCENES)
def test_rates_and_accelerations_are_derivatives(name):
    """By differences of sixth order, away from corners of a drive's profile."""
    machine = ms.load_scene(name)
    solution = ms.simulate(machine, duration=duration(machine))
    t = solution.duration * np.array([0.113, 0.317, 0.477, 0.629, 0.871])
    coordinates = machine.mechanism.coordinates
    turning = [c for c in coordinates if c not in machine.mechanism.displacements]
    seen = solution.sample(t)
    fastest = max(np.abs(seen[f'velocity.{c}']).max() for c in turning)
    h = min(1e-3 * solution.duration, 0.02 / fastest)
    around = [solution.sample(t + k * h) for k in range(-3, 4)]
    for c in coordinates:
        for order, low, high in ((1, 'position', 'velocity'), (2, 'velocity', 'acceleration')):
            x = [seen[f'{low}.{c}'] for seen in around]
            slope = (45.0 * (x[4] - x[2]) - 9.0 * (x[5] - x[1]) + (x[6] - x[0])) / (60.0 * h)
            right = around[3][f'{high}.{c}']
            least = 1e-3 / solution.duration**order  # of links that do not turn
            scale = max(np.abs(right).max(), np.abs(x).max() / solution.duration, least)
            assert np.abs(slope - right).max() < 1e-7 * scale, (c, high)
