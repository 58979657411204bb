"""Followers that leave their cams, by SciPy and events of our own, held against formulas."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from builders import made
from event_solution import Machine, Wall, apart, solve
from rattling import CycloidalLaw, EccentricLaw, GrooveCam, SprungFollower

import mechanism_sim as ms
from mechanism_sim.engine.events import Mode
from mechanism_sim.studies.lift_off import lift_offs
from test.grid.case import variant

TURN = 2 * math.pi
CYCLOIDAL = CycloidalLaw(8e-3, 1.2, 0.5, 1.4)
FOLLOWERS = {
    'eccentric': SprungFollower(),
    'damped': SprungFollower(damping=20.0),
    'damped beyond its critical value': SprungFollower(damping=70.0, speed=400.0),
    'cycloidal': SprungFollower(CYCLOIDAL, damping=10.0, speed=110.0),
}
MOTOR = SprungFollower(cam_inertia=4e-3, stall_torque=20.0, no_load_speed=320.0, damping=5.0)
SLOW = {'cycloidal', 'damped beyond its critical value'}
followers = pytest.mark.parametrize(
    'name', [pytest.param(x, marks=[pytest.mark.slow] * (x in SLOW)) for x in FOLLOWERS]
)


def run(follower, turns):
    """From contact at cam angle 0."""
    machine = follower.machine(turns)
    return solve(machine, *follower.start, turns * TURN / follower.speed, machine.walls[0])


@cache
def bouncing(name):
    return run(FOLLOWERS[name], 4)


@pytest.mark.parametrize('damping', [0.0, 1.0, 20.0, 56.0, 70.0])
def test_lift_off_speed_of_an_eccentric_in_closed_form(damping):
    follower = SprungFollower(damping=damping)
    w, at = follower.lift_off_speed, follower.lift_off_angle
    x = np.linspace(0, TURN, 100_001)
    size = follower.preload
    assert follower.contact_force(at, w) == pytest.approx(0.0, abs=1e-13 * size)
    assert follower.contact_force(x, w).min() > -1e-13 * size
    assert follower.contact_force(x, w * (1 - 1e-6)).min() > 0.0
    other, there = follower.least_lift_off_speed()
    assert other == pytest.approx(w, rel=1e-14)
    assert there == pytest.approx(at, abs=1e-7)


def test_without_damping_contact_is_lost_at_the_top():
    f = SprungFollower()
    e = f.law.eccentricity
    assert f.lift_off_speed == pytest.approx(
        math.sqrt((f.preload / e + 2 * f.stiffness) / f.mass), rel=1e-15
    )
    assert f.lift_off_angle == pytest.approx(math.pi / 2, rel=1e-15)


@followers
def test_contact_is_lost_from_the_lift_off_speed_on(name):
    follower = FOLLOWERS[name]
    critical, x = follower.least_lift_off_speed()
    slower, faster = (replace(follower, speed=critical * (1 + k)) for k in (-1e-6, 1e-6))
    assert run(slower, 2).changes == []
    motion = run(faster, 1)
    assert motion.changes[0].t * faster.speed == pytest.approx(x % TURN, abs=0.01)


@followers
def test_energy_closes_through_bounces(name):
    follower, motion = FOLLOWERS[name], bouncing(name)
    ends = motion.sample([0.0, motion.steps[-1].end])
    before, after = (follower.energy(*np.split(y, 2)) for y in ends.T)
    damped = motion.integral(lambda _t, _q, v, *_: follower.damping * v[1] ** 2)
    gained = motion.drive_work(0) - motion.loss - damped
    assert motion.loss > 1e-3
    assert after - before == pytest.approx(gained, abs=1e-12)


def test_a_torque_starts_a_cam_from_rest():
    scene = variant('offset_roller_cam', {
        'drive': {'coordinate': 'cam', 'speed': 0, 'start_angle': 2.5, 'torque': {'constant': 2}},
    })  # fmt: skip
    solution = ms.simulate(made(scene, 'cam'), duration=0.01)
    x = solution.sample(np.array([0.0, 0.01]), 'velocity.cam', 'position.cam')
    assert abs(solution.energy.residual) < 1e-12
    assert x['velocity.cam'][1] * np.ptp(x['position.cam']) > 0.0 == x['velocity.cam'][0]


def test_energy_closes_where_the_cam_is_driven_by_a_motor():
    """Each bounce changes the speed of the cam; in contact the follower stays on it."""
    follower = MOTOR
    motion = run(follower, 4)
    ends = motion.sample([0.0, motion.steps[-1].end])
    before, after = (
        follower.energy(*np.split(y, 2)) + follower.cam_inertia * y[2] ** 2 / 2 for y in ends.T
    )

    def power(t, q, v, *_):
        pull = follower.cam_inertia * follower.acceleration(t, q, v)[0]
        return pull * v[0] - follower.damping * v[1] ** 2

    assert len(motion.impacts) > 8
    assert after - before == pytest.approx(motion.integral(power) - motion.loss, abs=1e-11)
    (wall,) = motion.machine.walls
    for step in motion.steps:
        q = step.dense(np.linspace(step.start, step.end, 7))[:2]
        assert wall.value(q).min() > -1e-14
        assert step.wall is None or wall.value(q).max() < 1e-14
    times = [i.t for i in motion.impacts]
    impact = motion.impacts[0]
    x, _, w, v = motion.sample([times[0] - 1e-12])[:, 0]
    slope = float(follower.law(x, 1))
    assert slope * w - v == pytest.approx(impact.approach, rel=1e-8)
    mass = 1 / (1 / follower.mass + slope**2 / follower.cam_inertia)
    assert impact.impulse == pytest.approx(1.3 * mass * impact.approach, rel=1e-10)


@followers
def test_release_is_where_the_force_in_contact_falls_through_zero(name):
    follower, motion = FOLLOWERS[name], bouncing(name)
    released = [c.t for c in motion.changes if not c.touches]
    assert released
    for t in released:
        assert follower.contact_force(t * follower.speed) == pytest.approx(0.0, abs=1e-9)
        assert follower.contact_force((t - 1e-6) * follower.speed) > 0.0


@followers
def test_flights_are_those_of_a_damped_oscillator(name):
    """Exponentials of the two roots; between impacts, too, nothing is passed through."""
    follower, motion = FOLLOWERS[name], bouncing(name)
    m, c, k = follower.mass, follower.damping, follower.stiffness
    root = np.sqrt(complex(c * c - 4 * m * k))
    r1, r2 = (-c + root) / (2 * m), (-c - root) / (2 * m)
    rest = -follower.preload / k
    starts = [
        *((i.t, i.approach) for i in motion.impacts),
        *((c.t, 0.0) for c in motion.changes if not c.touches),
    ]
    touched = {c.t for c in motion.changes if c.touches}
    flights = 0
    for impact in motion.impacts:
        since, approach = max(s for s in starts if s[0] < impact.t)
        x = since * follower.speed
        assert since not in touched
        u = float(follower.law(x))
        v = follower.speed * float(follower.law(x, 1)) + follower.restitution * approach
        a = (v - r2 * (u - rest)) / (r1 - r2)
        b = (r1 * (u - rest) - v) / (r1 - r2)
        t = np.linspace(since, impact.t, 101)
        first, second = a * np.exp(r1 * (t - since)), b * np.exp(r2 * (t - since))
        gap = (first + second).real + rest - follower.law(t * follower.speed)
        assert gap.min() > -1e-15
        assert gap[-1] == pytest.approx(0.0, abs=1e-15)
        speed = (r1 * first + r2 * second).real[-1]
        wall = follower.speed * float(follower.law(impact.t * follower.speed, 1))
        assert wall - speed == pytest.approx(impact.approach, abs=1e-10)
        e = 0.0 if impact.t in touched else follower.restitution
        assert impact.loss == pytest.approx(m * impact.approach**2 / 2 * (1 - e * e), rel=1e-12)
        flights += 1
    assert flights > 8


def test_elastic_bounces_on_a_cam_without_lift_repeat():
    follower = SprungFollower(EccentricLaw(0.0), restitution=1.0)
    m, k, v = follower.mass, follower.stiffness, 0.3
    motion = solve(follower.machine(1), (0.0, 0.0), (follower.speed, v), 0.05)
    # about -P/k the flight is a harmonic arc
    w = math.sqrt(k / m)
    between = 2 / w * math.atan(v * m * w / follower.preload)
    assert len(motion.impacts) == math.floor(0.05 / between)
    for n, impact in enumerate(motion.impacts):
        assert impact.t == pytest.approx((n + 1) * between, abs=1e-13)
        assert impact.approach == pytest.approx(v, rel=1e-12)
        assert impact.loss == 0.0


def test_laws_have_the_derivatives_they_say():
    h = 1e-5
    x = np.linspace(0.01, TURN - 0.01, 200)
    for law in (EccentricLaw(5e-3), CYCLOIDAL):
        x = x[[np.abs(v - np.array([*law.breaks, -1.0])).min() > 2 * h for v in x]]
        for k in (0, 1):
            slope = (law(x + h, k) - law(x - h, k)) / (2 * h)
            assert slope == pytest.approx(law(x, k + 1), abs=1e-9)


# a groove

GROOVE = GrooveCam()


@cache
def groove_motion(clearance=GROOVE.clearance):
    cam = replace(GROOVE, clearance=clearance)
    return solve(cam.machine, *cam.start, 4 * TURN / cam.speed)


def test_walls_of_a_groove_are_as_far_from_the_roller_as_they_say():
    """Points of the equidistants about the drawn centre line, and finite differences."""
    cam, h = GROOVE, 1e-5
    x, y, v = 0.7, 0.046, np.array([120.0, 1.3])
    circle = np.exp(1j * np.linspace(0, TURN, 200_001))
    centre = cam.eccentricity * np.exp(1j * x)
    for wall, side in zip(cam.machine.walls, (-1, 1), strict=True):
        drawn = centre + (cam.radius + side * cam.clearance / 2) * circle
        distance = np.abs(drawn - 1j * y).min()
        q = np.array([x, y])
        assert abs(float(wall.value(q))) == pytest.approx(distance, abs=1e-9)
        ahead, behind = wall.value(q + h * v / 100), wall.value(q - h * v / 100)
        assert (ahead - behind) / (2 * h / 100) == pytest.approx(wall.row(q) @ v, rel=1e-7)
        bent = (ahead - 2 * wall.value(q) + behind) / (h / 100) ** 2
        assert bent == pytest.approx(float(wall.bend(q, v)), rel=1e-3)


@pytest.mark.slow
def test_the_roller_strikes_both_walls_and_energy_closes():
    cam, motion = GROOVE, groove_motion()
    assert {i.wall for i in motion.impacts if i.t > TURN / cam.speed} == {'inner', 'outer'}
    start, end = motion.sample([0.0, motion.steps[-1].end]).T
    energy = [cam.mass * y[3] ** 2 / 2 + cam.load * y[1] for y in (start, end)]
    assert energy[1] - energy[0] == pytest.approx(motion.drive_work(0) - motion.loss, abs=1e-12)
    t = np.linspace(0, motion.steps[-1].end, 5000)
    q = motion.sample(t)[:2]
    assert min(wall.value(q).min() for wall in cam.machine.walls) > -1e-13


def test_flights_in_a_groove_are_parabolas():
    cam, motion = GROOVE, groove_motion()
    flights = [s for s in motion.steps if s.wall is None]
    for step in flights:
        t = step.end - step.start
        y0, v0 = step.dense(step.start)[[1, 3]]
        y, v = step.dense(step.end)[[1, 3]]
        assert y == pytest.approx(y0 + v0 * t - cam.load / cam.mass * t * t / 2, abs=1e-15)
        assert v == pytest.approx(v0 - cam.load / cam.mass * t, abs=1e-12)


@pytest.mark.slow
def test_without_clearance_the_ideal_groove_comes_back():
    """Seated on one wall until the force ends; the clearance is crossed as t^3."""
    cam = GROOVE
    e, w = cam.eccentricity, cam.speed
    t = np.linspace(TURN / w, 4 * TURN / w, 400)
    root = np.sqrt(cam.radius**2 - (e * np.cos(w * t)) ** 2)
    ideal = e * w * np.cos(w * t) + e**2 * w * np.sin(w * t) * np.cos(w * t) / root
    fastest = []
    for clearance in (1e-5, 1e-6, 1e-7):
        motion = groove_motion(clearance)
        fastest.append(max(i.approach for i in motion.impacts if i.t > TURN / w))
        assert np.abs(motion.sample(t)[3] - ideal).max() < 1.2 * fastest[-1]
    assert np.array(fastest[:-1]) / fastest[1:] == pytest.approx(10 ** (2 / 3), rel=0.05)


@pytest.mark.slow
def test_a_small_error_of_the_start_shrinks_in_the_groove():
    cam = GROOVE
    (x, y), v = cam.start
    other = solve(cam.machine, (x, y + 1e-9), v, 4 * TURN / cam.speed)
    first, second = (
        np.array([i.t for i in m.impacts if i.approach > 1e-3]) for m in (groove_motion(), other)
    )
    assert 0.0 < abs(first[0] - second[0]) < 1e-7
    assert np.abs(first - second)[first > 3 * TURN / cam.speed].max() < 1e-10


# what the engine can do already: a yoke with play, as a groove without pressure angle


@pytest.mark.parametrize('restitution', [0.3, pytest.param(0.6, marks=pytest.mark.slow)])
def test_a_loose_scotch_yoke_is_the_engines(restitution):
    radius, mass, pull, play = 0.05, 1.5, 12.0, 1e-4
    scene = ms.load_scene(
        'scotch_yoke',
        {
            'joints.crank_yoke.clearance': {'radial': play, 'restitution': restitution},
            'loads': {'pull': {'at': 'yoke', 'force': [-pull, 0]}},
        },
    )
    solution = ms.simulate(scene, revolutions=4)

    def wall(name, sign):
        return Wall(
            name,
            lambda q: play + sign * (q[1] - radius * np.cos(q[0])),
            lambda q: sign * np.array([radius * np.sin(q[0]), 1.0 + 0.0 * q[1]]),
            lambda q, v: sign * radius * np.cos(q[0]) * v[0] ** 2,
        )

    def acceleration(_t, q, _v):
        return np.array([0.0, -pull / mass]).reshape(2, *(1,) * (q.ndim - 1)) + 0.0 * q

    machine = Machine(
        (math.inf, mass), acceleration, (wall('near', 1.0), wall('far', -1.0)), restitution, 4e-3
    )
    w = 10 * math.pi
    motion = solve(machine, (0.0, radius), (w, 0.0), solution.duration)
    names = {'near': 'crank_yoke_right', 'far': 'crank_yoke_left'}
    times, impulses = apart(motion, solution.impacts, names, 1e-4)
    assert times < 1e-10
    assert impulses < 1e-8
    here = [c.t for c in motion.changes if not c.touches]
    there = [m.t for m in solution.modes if m.t > 0.0 and m.mode == Mode.FREE_FLIGHT]
    assert there == pytest.approx(here, abs=1e-12)


# the engine, held against these


def scene_of(follower, **more):
    """The scene of the sprung follower with other data."""
    law, base = follower.law, 30e-3
    said = {'eccentric': 5e-3}
    if isinstance(law, CycloidalLaw):
        base = 50e-3
        down = law.rise + law.dwell
        said = {
            'segments': [
                {'from': 0.0, 'to': law.rise, 'rise': law.lift},
                {'from': down, 'to': down + law.back, 'rise': -law.lift},
            ]
        }
    pressed = follower.preload / follower.stiffness
    return ms.load_scene(
        'eccentric_cam',
        {
            'joints.contact.law': said,
            'joints.contact.base_radius': base,
            'joints.contact.lift_off.restitution': follower.restitution,
            'links.ground.points.seat': [0.0, 0.1375],
            'links.follower.mass': follower.mass,
            'springs.spring.free_length': 0.1375 - base + pressed,
            'springs.spring.damping': f'{follower.damping!r} N s/m',
            'drive.speed': follower.speed,
            **more,
        },
    )


@followers
def test_the_engine_bounces_as_the_second_route(name):
    follower, motion = FOLLOWERS[name], bouncing(name)
    solution = ms.simulate(scene_of(follower), revolutions=4)
    times, impulses = apart(motion, solution.impacts, {'cam': 'contact'}, 1e-3)
    assert times < 1e-9
    assert impulses < 1e-7
    assert abs(solution.energy.residual) < 1e-12
    assert solution.max_penetration < 1e-15
    here = [c.t for c in motion.changes if not c.touches]
    there = [m.t for m in solution.modes if m.t > 0.0 and m.mode == Mode.FREE_FLIGHT]
    assert there == pytest.approx(here, abs=1e-10)


@pytest.mark.slow
def test_the_engine_bounces_alike_where_a_motor_drives():
    follower = MOTOR
    w, v0 = follower.no_load_speed, follower.speed
    motor = {'stall_torque': follower.stall_torque, 'no_load_speed': w}
    machine = scene_of(
        follower,
        **{'links.cam.inertia': follower.cam_inertia, 'links.cam.cog': 0.0, 'drive.motor': motor},
    )
    motion = run(follower, 4)
    solution = ms.simulate(machine, duration=4 * TURN / v0)
    times, impulses = apart(motion, solution.impacts, {'cam': 'contact'}, 1e-3)
    assert times < 1e-9
    assert impulses < 1e-6
    assert abs(solution.energy.residual) < 1e-11


def leaves(follower):
    """True if a run of the engine loses contact."""
    modes = ms.simulate(scene_of(follower), revolutions=2).modes
    return any(m.mode == Mode.FREE_FLIGHT for m in modes)


@pytest.mark.slow
@pytest.mark.parametrize('damping', [20.0, pytest.param(0.0, marks=pytest.mark.slow)])
def test_lift_off_speed_found_by_runs_is_that_of_the_closed_form(damping):
    follower = SprungFollower(damping=damping)
    exact = follower.lift_off_speed
    low, high = 0.99 * exact, 1.01 * exact
    while high - low > 2e-7 * exact:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if leaves(replace(follower, speed=middle)) else (middle, high)
    assert 0.5 * (low + high) == pytest.approx(exact, rel=1e-6)


@followers
def test_lift_off_speed_from_ideal_forces_is_that_of_the_formula(name):
    follower = FOLLOWERS[name]
    (found,) = lift_offs(scene_of(follower))
    exact, x = follower.least_lift_off_speed()
    assert found.lift_off_speed == pytest.approx(exact, rel=1e-12)
    assert found.lift_off_at % TURN == pytest.approx(x % TURN, abs=1e-6)
    grid = np.linspace(0, TURN, 200_001)
    assert found.least_force == pytest.approx(follower.contact_force(grid).min(), abs=1e-6)


@pytest.mark.sample(1)
@pytest.mark.parametrize('clearance', [0.1e-3, 0.3e-3])
def test_the_engine_rattles_in_a_groove_as_the_second_route(clearance):
    """The exact distance of the walls here, to the second order in the play there."""
    cam = replace(GROOVE, clearance=clearance)
    motion = groove_motion(clearance)
    machine = ms.load_scene('groove_cam', {'joints.contact.groove.clearance': clearance})
    solution = ms.simulate(machine, duration=motion.steps[-1].end)
    names = {'inner': 'contact_right', 'outer': 'contact_left'}
    times, impulses = apart(motion, solution.impacts, names, 1e-4)
    third = (clearance / 2) ** 3 / cam.radius**2
    assert times < 1e-9 + third / 1e-2
    assert impulses < 1e-5
    assert abs(solution.energy.residual) < 1e-12


@pytest.mark.sample(1)
@pytest.mark.parametrize('law', ['hertz', 'hunt_crossley'])
def test_a_stiff_contact_comes_near_the_rigid_one(law):
    """Seated at its static depth; where contact is lost first differs by the time of an impact."""
    contact = {'law': law, 'stiffness': 1e12}
    soft = ms.simulate(
        ms.load_scene('eccentric_cam', {'joints.contact.lift_off.contact': contact}),
        duration=0.006,
    )
    rigid = ms.simulate(ms.load_scene('eccentric_cam'), duration=0.006)
    first = [
        next(m.t for m in s.modes if m.t > 0.0 and m.mode == Mode.FREE_FLIGHT)
        for s in (soft, rigid)
    ]
    assert first[0] == pytest.approx(first[1], rel=1e-2)
    assert abs(soft.energy.residual) < 1e-9


# where the law of a cam goes on with another acceleration


def test_contact_is_lost_where_the_acceleration_jumps_and_that_is_told_once():
    """From a dwell into a harmonic return that is steeper than the spring can follow."""
    rise = {'from': '0 deg', 'to': '110 deg', 'rise': '8 mm', 'curve': 'cycloidal'}
    back = {'from': '120 deg', 'to': '200 deg', 'rise': '-8 mm', 'curve': 'harmonic'}
    changes = {'joints.contact.law': {'segments': [rise, back]}, 'drive.start_angle': '250 deg'}
    solution = ms.simulate(ms.load_scene('valve_train', changes), revolutions=1)
    first, lost, again = solution.modes
    assert [first.mode, lost.mode, again.mode] == [
        Mode.FOLLOWING, Mode.FREE_FLIGHT, Mode.FOLLOWING,
    ]  # fmt: skip
    assert lost.t == pytest.approx(230 / 360 / 60, abs=1e-14)
    assert solution.impacts[0].t > lost.t + 1e-3
    assert solution.energy.residual == pytest.approx(0.0, abs=1e-11)


@pytest.mark.parametrize('times', [2.0**-12, 2.0**12])
def test_a_valve_train_of_any_size_bounces_alike(times):
    # no point of a link says how large it is, only the cam
    def overrides(x):
        return {
            'links.ground.points.seat': [0.0, 0.078 * x],
            'links.camshaft.inertia': 6e-5 * x * x,
            'joints.contact.base_radius': 0.018 * x,
            'joints.contact.law.segments.0.rise': f'{0.008 * x!r} m',
            'joints.contact.law.segments.1.rise': f'{-0.008 * x!r} m',
            'springs.spring.free_length': 0.07 * x,
            'gravity': [0.0, -9.81 * x],
        }

    one, other = (
        ms.simulate(ms.load_scene('valve_train', overrides(x)), duration=0.04)
        for x in (1.0, times)
    )
    assert len(other.impacts) == len(one.impacts) > 20
    largest = max(x.normal_impulse for x in one.impacts)
    for a, b in zip(one.impacts, other.impacts, strict=True):
        assert b.t == pytest.approx(a.t, rel=1e-9)
        assert b.normal_impulse / times == pytest.approx(a.normal_impulse, abs=1e-8 * largest)
