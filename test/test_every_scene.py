"""Every mechanism of the package: closures, derivatives, forces, power, by a second route each."""

import math

import numpy as np
import pytest
from absolute import Absolute, turned

import mechanism_sim as ms
from mechanism_sim.planar.mechanism import GROUND, Geneva, SlottedRack
from mechanism_sim.scene import Level
from mechanism_sim.scene.linkage import LinkageScene

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
        runs[name] = machine, ms.simulate(machine)
    return runs[name]


def step(solution):
    """[s] for differences: far less than a radian of the fastest link."""
    curve = solution.motion.curve
    fastest = np.abs(curve.coefficients[:, :, 1]).max()
    return min(solution.duration / 4000.0, 0.02 / fastest)


def instants(machine, solution, count, margin):
    """Times away from switches, where accelerations jump."""
    t = np.linspace(margin, solution.duration - margin, count + 2)[1:-1] + 1e-3 * margin
    loads = getattr(machine.scene, 'loads', {}).values()
    if any(j for j in machine.plan.joints if isinstance(j, Geneva | SlottedRack)) or any(
        load.during for load in loads
    ):
        changes = np.abs(np.diff(solution.motion.curve.duration))
        ends = solution.motion.curve.start[1:][changes > 1e-9 * solution.duration]
        t = np.array([x for x in t if (np.abs(ends - x) > margin).all()])
        assert len(t) > count // 2
    return t


def loads_of(scene):
    """The loads of a scene at an instant, from its text: link, point, force, torque."""

    def at(absolute, x, v, t):
        if not isinstance(scene, LinkageScene):
            return
        plan = absolute.plan

        def find(reference):
            link, _, point = reference.partition('.')
            return link, plan.points[link][point or 'start']

        def moving(link, point):
            place, J = absolute.point(x, link, point)
            return place, J @ v

        angles = {n: x[3 * i + 2] for i, n in enumerate(absolute.names)}
        rates = {n: v[3 * i + 2] for i, n in enumerate(absolute.names)}
        for s in scene.springs.values():
            (a, pa), (b, pb) = (find(p) for p in s.between)
            if (s.stiffness.unit or s.damping.unit).endswith('rad'):
                twist = angles.get(b, 0.0) - angles.get(a, 0.0) - (s.free_angle or 0.0)
                rate = rates.get(b, 0.0) - rates.get(a, 0.0)
                moment = s.stiffness.value * twist + s.damping.value * rate
                yield a, (0.0, 0.0), np.zeros(2), moment
                yield b, (0.0, 0.0), np.zeros(2), -moment
                continue
            (xa, va), (xb, vb) = moving(a, pa), moving(b, pb)
            line = xb - xa
            length = math.hypot(*line)
            unit = line / length
            stretch = length - (s.free_length or 0.0)
            pull = s.stiffness.value * stretch + s.damping.value * (unit @ (vb - va))
            yield a, pa, pull * unit, 0.0
            yield b, pb, -pull * unit, 0.0
        for load in scene.loads.values():
            link, point = find(load.at)
            if load.during:
                angle = angles[load.during.coordinate] - load.during.begin
                width = (load.during.end - load.during.begin) % (2.0 * math.pi)
                if angle % (2.0 * math.pi) > width:
                    continue
            place, rate = moving(link, point)
            known = {'t': t, 'x': place[0], 'y': place[1], 'vx': rate[0], 'vy': rate[1]}
            known |= {'sin': math.sin, 'cos': math.cos, 'exp': math.exp, 'pi': math.pi}
            known |= {'sqrt': math.sqrt, 'tanh': math.tanh, 'abs': abs, 'tan': math.tan}
            for i, c in enumerate(absolute.mechanism.coordinates):
                known[c] = absolute.q[i]
                known[f'{c}_rate'] = absolute.v[i]

            def value(part, known=known):
                return eval(part, {}, known) if isinstance(part, str) else part

            force = np.array([value(part) for part in load.force], dtype=float)
            if load.frame == 'link' and link != GROUND:
                force = turned(angles[link], force)
            yield link, point, force, float(value(load.torque))

    return at


@pytest.mark.parametrize('name', SCENES)
def test_loops_stay_closed(runs, name):
    _, solution = run(runs, name)
    assert solution.max_closure_error < 1e-12


@pytest.mark.parametrize('name', SCENES)
def test_rates_and_accelerations_are_derivatives_of_the_positions(runs, name):
    machine, solution = run(runs, name)
    h = step(solution)
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
    plan = machine.plan
    absolute = Absolute(plan, plan.ideal, plan.prescribed)
    t = instants(machine, solution, 12, 1e-6 * solution.duration)
    seen = solution.samples(t).observed
    driven = [plan.ideal.coordinates.index(c) for c in plan.prescribed]
    powered = [plan.ideal.coordinates.index(c) for c in plan.powered]
    largest = max(np.abs(seen.reaction).max(), 1e-3)
    text = loads_of(machine.scene)
    for k, time in enumerate(t):
        absolute.q, absolute.v = seen.position[:, k], seen.velocity[:, k]
        torques = dict(zip(powered, seen.drive_torque[len(driven) :, k], strict=True))

        def loads(a, x, v, t, torques=torques):
            yield from text(a, x, v, t)
            for i, torque in torques.items():
                c = a.mechanism.coordinates[i]
                row = a.drive_row(x, c)
                # a drive's force as a generalised one: through unit loads on every body
                for n, body in enumerate(a.plan.bodies):
                    part = torque * row[3 * n : 3 * n + 3]
                    yield body.name, body.cog, part[:2], part[2]

        _, reactions, drives = absolute.solve(
            absolute.q, absolute.v, seen.acceleration[driven, k], time, loads
        )
        for j, joint in enumerate(plan.joints):
            found = [*seen.reaction[j, :, k], seen.reaction_moment[j, k]]
            size = [1.0, 1.0, plan.ideal.size]
            off = (np.array(found) - reactions[joint.name]) / size
            assert np.abs(off).max() < 1e-9 * largest, joint.name
        scale = largest * max(plan.ideal.size, 1.0)
        assert np.abs(drives - seen.drive_torque[: len(driven), k]).max(initial=0.0) < 1e-9 * scale


@pytest.mark.parametrize('name', SCENES)
def test_power_of_the_drives_is_the_rate_of_energy(runs, name):
    machine, solution = run(runs, name)
    if machine.level is Level.KINEMATIC:
        pytest.skip('without masses there is no energy')
    h = step(solution)
    t = instants(machine, solution, 30, 4.0 * h)
    around = [solution.samples(t + k * h).observed for k in range(-3, 4)]
    energies = [o.kinetic_energy + o.potential_energy for o in around]
    rate = sum(w * e for w, e in zip(FIRST, energies, strict=True)) / h
    here = around[3]
    scale = np.abs(here.drive_power).max() + np.abs(energies[3]).max() / solution.duration
    assert np.abs(here.drive_power - here.friction_power - rate).max() < 1e-7 * scale
    energy = solution.energy
    assert abs(energy.residual) < 1e-9 * max(abs(energy.initial), abs(energy.drive_work), 1e-9)


def test_angles_in_formulas_count_all_their_turns_at_every_level():
    """A spring written as a formula of the crank's angle is a drive's spring, after many turns."""
    spring = {'loads.spring': {'at': 'crank', 'torque': '-0.002*crank'}, 'gravity': [0.0, 0.0]}
    free = {'drive': {'speed': 30.0, 'torque': {}}}
    own = {'drive': {'speed': 30.0, 'torque': {'per_angle': -0.002}}, 'gravity': [0.0, 0.0]}
    written = ms.simulate(ms.load_scene('slider_crank', spring | free), duration=2.0)
    given = ms.simulate(ms.load_scene('slider_crank', own), duration=2.0)
    t = np.linspace(0.1, 1.9, 7)
    a, b = (s.samples(t).observed.position for s in (written, given))
    assert np.abs(b).max() > 4.0 * np.pi
    assert np.abs(a - b).max() < 1e-9
    steady = ms.simulate(ms.load_scene('slider_crank', spring), revolutions=3)
    bare = ms.simulate(ms.load_scene('slider_crank', {'gravity': [0.0, 0.0]}), revolutions=3)
    t = np.array([2.7]) / 3.0 * steady.duration
    seen, without = (s.samples(t).observed for s in (steady, bare))
    more = 0.002 * seen.position[0, 0]
    assert seen.drive_torque[0, 0] - without.drive_torque[0, 0] == pytest.approx(more, rel=1e-9)
