"""Every mechanism of the package: closures, derivatives, forces, power, by a second route each."""

import numpy as np
import pytest
from absolute import differences
from builders import read_scene

import mechanism_sim as ms
from mechanism_sim.joints.cam.constraint import CamPair
from mechanism_sim.joints.geneva.constraint import Geneva
from mechanism_sim.joints.rack.constraint import SlottedRack
from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.scene import Level, Machine
from mechanism_sim.scene.drives import is_straight
from mechanism_sim.scene.schema import AffineForce, AffineTorque, Scene
from mechanism_sim.units import QuantityValue

# unchecked: every worker collects these names, and checking all machines takes 5 s
MACHINES = [Machine(*read_scene(name)) for name in ms.scene_names()]
SCENES = [m.name for m in MACHINES if not m.plan.clearances]
# 6th-order central differences
FIRST = np.array([-1 / 60, 3 / 20, -3 / 4, 0.0, 3 / 4, -3 / 20, 1 / 60])
SECOND = np.array([1 / 90, -3 / 20, 3 / 2, -49 / 18, 3 / 2, -3 / 20, 1 / 90])


@pytest.fixture(scope='module')
def runs():
    return {}


def run(runs, name):
    if name not in runs:
        machine = ms.load_scene(name)
        runs[name] = machine, ms.simulate(machine)
    return runs[name]


def step(machine, solution):
    """[s] for differences: far less than a radian of the fastest link, or rotor's vibration."""
    curve = solution.motion.curve
    rate, change = (np.abs(curve.coefficients[:, :, k]).max(axis=0) for k in (1, 2))
    fastest = rate.max()
    if machine.mechanism.having(Rotor):
        fastest = max(fastest, (2.0 * change[rate > 0.0] / rate[rate > 0.0]).max())
    return min(solution.duration / 4000.0, 0.02 / fastest)


def instants(machine, solution, count, margin):
    """Times away from switches, where accelerations jump."""
    t = np.linspace(margin, solution.duration - margin, count + 2)[1:-1] + 1e-3 * margin
    loads = getattr(machine.scene, 'loads', {}).values()
    if any(j for j in machine.plan.joints if isinstance(j, CamPair | Geneva | SlottedRack)) or any(
        load.during for load in loads
    ):
        changes = np.abs(np.diff(solution.motion.curve.duration))
        ends = solution.motion.curve.start[1:][changes > 1e-9 * solution.duration]
        t = np.array([x for x in t if (np.abs(ends - x) > margin).all()])
        assert len(t) > count // 2
    return t


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', SCENES)
def test_loops_stay_closed(runs, name):
    _, solution = run(runs, name)
    assert solution.max_closure_error < 1e-12


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', SCENES)
def test_rates_and_accelerations_are_derivatives_of_the_positions(runs, name):
    machine, solution = run(runs, name)
    h = step(machine, solution)
    t = instants(machine, solution, 30, 4.0 * h)
    around = [solution.view(t + k * h).observed for k in range(-3, 4)]
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


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', SCENES)
def test_forces_agree_with_newton_and_euler_for_every_body(runs, name):
    machine, solution = run(runs, name)
    if machine.level is Level.KINEMATIC:
        pytest.skip('without masses there are no forces')
    if machine.mechanism.deformations:
        pytest.skip('this route has rigid bodies: test_rotors.py, test_elastic.py')
    if any(joint.friction for joint in machine.scene.joints.values()):
        pytest.skip('this route has no friction: test_joint_friction.py')
    if machine.plan.states:
        pytest.skip('this route has no states: test/cases/test_forces.py')
    t = instants(machine, solution, 12, 1e-6 * solution.duration)
    assert differences(machine, solution, t)[0].max() < 1e-9


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', SCENES)
def test_power_of_the_drives_is_the_rate_of_energy(runs, name):
    machine, solution = run(runs, name)
    if machine.level is Level.KINEMATIC:
        pytest.skip('without masses there is no energy')
    h = step(machine, solution)
    t = instants(machine, solution, 30, 4.0 * h)
    around = [solution.view(t + k * h).observed for k in range(-3, 4)]
    energies = [o.kinetic_energy + o.potential_energy for o in around]
    rate = sum(w * e for w, e in zip(FIRST, energies, strict=True)) / h
    here = around[3]
    scale = np.abs(here.drive_power).max() + np.abs(energies[3]).max() / solution.duration
    assert np.abs(here.drive_power - here.friction_power - rate).max() < 1e-7 * scale
    energy = solution.energy
    exchanged = max(map(abs, (energy.initial, energy.drive_work, energy.dissipated)))
    assert abs(energy.residual) < 1e-9 * max(exchanged, 1e-9)


def test_angles_in_formulas_count_all_their_turns_at_every_level():
    """A spring written as a formula of the crank's angle is a drive's spring, after many turns."""
    spring = {'loads.spring': {'at': 'crank', 'torque': '-0.002*crank'}, 'gravity': [0.0, 0.0]}
    free = {'drive': {'speed': 30.0, 'torque': {}}}
    own = {'drive': {'speed': 30.0, 'torque': {'per_angle': -0.002}}, 'gravity': [0.0, 0.0]}
    written = ms.simulate(ms.load_scene('slider_crank', spring | free), duration=2.0)
    given = ms.simulate(ms.load_scene('slider_crank', own), duration=2.0)
    t = np.linspace(0.1, 1.9, 7)
    a, b = (s.view(t).observed.position for s in (written, given))
    assert np.abs(b).max() > 4.0 * np.pi
    assert np.abs(a - b).max() < 1e-9
    steady = ms.simulate(ms.load_scene('slider_crank', spring), revolutions=3)
    bare = ms.simulate(ms.load_scene('slider_crank', {'gravity': [0.0, 0.0]}), revolutions=3)
    t = np.array([2.7]) / 3.0 * steady.duration
    seen, without = (s.view(t).observed for s in (steady, bare))
    more = 0.002 * seen.position[0, 0]
    assert seen.drive_torque[0, 0] - without.drive_torque[0, 0] == pytest.approx(more, rel=1e-9)


def freed(scene):
    """The scene with its drives let go, at the speed they have at the start or a slow one."""

    def let_go(drive, straight):
        slow = QuantityValue(0.05, 'm/s') if straight else QuantityValue(1.0, 'rad/s')
        free = {'force': AffineForce()} if straight else {'torque': AffineTorque()}
        speed = {'profile': None, 'speed': slow} if drive.profile else {}
        return drive.model_copy(update=free | speed)

    if not isinstance(scene, Scene):
        return scene.model_copy(update={'drive': let_go(scene.drive, False)})
    drives = {c: let_go(d, is_straight(d)) for c, d in scene.drives.items()}
    main = scene.drive and let_go(scene.drive, is_straight(scene.drive))
    return scene.model_copy(update={'drive': main, 'drives': drives, 'duration': None})


# without asking for the level: that puts together every machine
DRIVEN = [
    m.name
    for m in MACHINES
    if not m.plan.clearances and not m.plan.powered and m.scene.outputs.forces and m.plan.weighed
]


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', DRIVEN)
def test_every_mechanism_moves_freely_as_inverse_dynamics_wants(name):
    """A free motion, looked at by inverse dynamics, asks for no drive; its energy stays."""
    machine = ms.load_scene(name)
    if machine.level is not Level.INVERSE_DYNAMICS:
        pytest.skip('its drives leave it a freedom')
    loose = Machine(name, freed(machine.scene))
    assert loose.level is Level.SMOOTH
    fastest = max(abs(rate) for _, rate in loose.plan.begins.values())
    solution = ms.simulate(loose, duration=min(0.3 / fastest, 0.1))
    energy = solution.energy
    size = max(map(abs, (energy.initial, energy.final, energy.dissipated)))
    assert abs(energy.residual) < 1e-10 * size + 1e-14
    seen = solution.view(np.linspace(0.0, solution.duration, 5)).observed
    inverse = machine.nominal.inverse_dynamics
    instants = np.linspace(0.0, solution.duration, 5)
    known = np.array([instants if x == 'time' else 0.0 * instants for x in inverse.outside])
    wanted = inverse(seen.position, seen.velocity, seen.acceleration, known.reshape(-1, 5))
    largest = max(np.abs(seen.reaction).max(), 1e-6) * max(machine.plan.ideal.size, 1.0)
    assert np.abs(wanted.drive_torque).max() < 1e-9 * largest
    assert np.abs(wanted.reaction - seen.reaction).max() < 1e-9 * largest
