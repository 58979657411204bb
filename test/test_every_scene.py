"""Every mechanism of the package: closures, derivatives, forces, power, by a second route each."""

import numpy as np
import pytest
from absolute import differences

import mechanism_sim as ms
from mechanism_sim.planar.mechanism import Geneva, SlottedRack
from mechanism_sim.scene import Level

SCENES = [n for n in ms.scene_names() if not ms.load_scene(n).clearances]
# 6th-order central differences
FIRST = np.array([-1 / 60, 3 / 20, -3 / 4, 0.0, 3 / 4, -3 / 20, 1 / 60])
SECOND = np.array([1 / 90, -3 / 20, 3 / 2, -49 / 18, 3 / 2, -3 / 20, 1 / 90])


@pytest.fixture(scope='module')
def runs():
    return {}


def run(runs, name):
    if name not in runs:
        machine = ms.load_scene(name)
        length = {'duration': duration(machine)}
        runs[name] = machine, ms.simulate(machine, **length)
    return runs[name]


def duration(machine):
    """A cycle, or as long as the drives move, but not past where a mechanism would end."""
    law = machine.law
    if not machine.torque_driven and len(machine.laws) == 1 and not law.straight:
        return machine.period
    if not machine.torque_driven and len(machine.laws) > 1:
        return machine.laws[-1].valid_from
    return machine.scene.duration or 0.5


def spacing(machine, solution):
    """Of differences: where a motion is integrated its steps tell how sharp it is."""
    steps = solution.motion.curve.duration
    return np.median(steps) / 50.0 if machine.dynamic else solution.duration / 4000.0


def instants(machine, solution, count, margin):
    """Times away from switches, where accelerations jump."""
    t = np.linspace(margin, solution.duration - margin, count + 2)[1:-1] + 1e-3 * margin
    ends = solution.motion.curve.start[1:]
    ranges = [load.during for load in getattr(machine.scene, 'loads', {}).values()]
    if any(ranges) or any(isinstance(j, Geneva | SlottedRack) for j in machine.plan.joints):
        irregular = ends[
            np.abs(np.diff(solution.motion.curve.duration)) > 1e-9 * solution.duration
        ]
        t = np.array([x for x in t if (np.abs(irregular - x) > margin).all()])
    return t


@pytest.mark.parametrize('name', SCENES)
def test_loops_stay_closed(runs, name):
    _, solution = run(runs, name)
    assert solution.max_closure_error < 1e-12


@pytest.mark.parametrize('name', SCENES)
def test_rates_and_accelerations_are_derivatives_of_the_positions(runs, name):
    machine, solution = run(runs, name)
    h = spacing(machine, solution)
    t = instants(machine, solution, 30, 4.0 * h)
    around = [solution.samples(t + k * h).observed for k in range(-3, 4)]
    here = around[3]
    rates = sum(w * o.position for w, o in zip(FIRST, around, strict=True)) / h
    second = sum(w * o.velocity for w, o in zip(FIRST, around, strict=True)) / h
    twice = sum(w * o.position for w, o in zip(SECOND, around, strict=True)) / h**2
    fastest = np.abs(here.velocity).max()
    sharpest = max(np.abs(here.acceleration).max(), fastest / solution.duration)
    assert np.abs(rates - here.velocity).max() < 1e-7 * fastest + 1e-12
    assert np.abs(second - here.acceleration).max() < 1e-7 * sharpest + 1e-12
    # differences of second order lose more digits to rounding
    assert np.abs(twice - here.acceleration).max() < 1e-5 * sharpest + 1e-9


@pytest.mark.parametrize('name', SCENES)
def test_forces_agree_with_newton_and_euler_for_every_body(runs, name):
    machine, solution = run(runs, name)
    if machine.level is Level.KINEMATIC:
        pytest.skip('without masses there are no forces')
    t = instants(machine, solution, 12, 1e-6 * solution.duration)
    assert differences(machine, solution, t)[0].max() < 1e-9


@pytest.mark.parametrize('name', SCENES)
def test_power_of_the_drives_is_the_rate_of_energy(runs, name):
    machine, solution = run(runs, name)
    if machine.level is Level.KINEMATIC:
        pytest.skip('without masses there is no energy')
    h = spacing(machine, solution)
    t = instants(machine, solution, 30, 4.0 * h)
    around = [solution.samples(t + k * h).observed for k in range(-3, 4)]
    energies = [o.kinetic_energy + o.potential_energy for o in around]
    rate = sum(w * e for w, e in zip(FIRST, energies, strict=True)) / h
    here = around[3]
    scale = np.abs(here.drive_power).max() + np.abs(energies[3]).max() / solution.duration
    assert np.abs(here.drive_power - here.friction_power - rate).max() < 1e-7 * scale
    energy = solution.energy
    assert abs(energy.residual) < 1e-9 * max(abs(energy.initial), abs(energy.drive_work), 1e-9)
