"""Gears in motion: rattle against another integrator, elastic teeth, long runs."""

import math

import geared_four_bar
import numpy as np
import pytest
from builders import without_work
from event_solution import apart, solve
from rattling import GearRattle
from scipy.integrate import quad, solve_ivp

import mechanism_sim as ms
from mechanism_sim.engine.events import Mode
from mechanism_sim.joints.mesh.compliance import middle, touching
from mechanism_sim.joints.mesh.pair import Path

MOTOR = {'pinion_inertia': 1e-3, 'stall_torque': 5.0, 'no_load_speed': 52.0}
CYCLE = 2.0 * math.pi / 100.0
WALLS = {'drive': 'mesh_left', 'coast': 'mesh_right'}
BASE = 1e-3 * math.cos(math.radians(20.0))  # [m] base radius by number of teeth, module 2 mm
WHEEL = 1500e-6  # [kg m^2]


def scene(gears, **more):
    """The scene `gear_rattle` with the data of the other solution."""
    load, swing, drag = gears.load, gears.swing, gears.drag
    changes = {
        'drive.speed': gears.speed,
        'joints.mesh.backlash.width': gears.play,
        'joints.mesh.backlash.restitution': gears.restitution,
        'links.wheel.inertia': gears.wheel_inertia,
        'loads.shaking.torque': f'{load!r} + {swing!r}*sin({gears.frequency!r}*t)'
        f' - {drag!r}*wheel_rate',
    }
    if math.isfinite(gears.pinion_inertia):
        changes['links.pinion.inertia'] = gears.pinion_inertia
        changes['drive.motor'] = {
            'stall_torque': gears.stall_torque,
            'no_load_speed': gears.no_load_speed,
        }
    return ms.load_scene('gear_rattle', changes | more)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    'gears',
    [
        GearRattle(),
        GearRattle(load=0.2, restitution=0.7),
        GearRattle(**MOTOR, drag=1e-3),
        GearRattle(teeth=(20, 40), load=-0.5, swing=1.2, restitution=0.0),
    ],
    ids=['load', 'hard', 'motor', 'dead'],
)
def test_rattle_agrees_with_another_integrator(gears):
    """All impacts faster than 1 mm/s: order, flank, time and impulse; both balance close."""
    other = solve(gears.machine, *gears.start, 4.0 * CYCLE)
    solution = ms.simulate(scene(gears), duration=4.0 * CYCLE)
    times, impulses = apart(other, solution.impacts, WALLS, 1e-3)
    assert times < 1e-9
    assert impulses < 1e-9
    assert abs(solution.energy.residual) < 1e-12
    seated = [c.t for c in other.changes if c.touches]
    follows = [m.t for m in solution.modes if m.mode == Mode.FOLLOWING and m.t > 0.0]
    assert len(follows) == len(seated)


@pytest.mark.slow
def test_a_geared_loose_four_bar_agrees_with_another_integrator():
    """A revolution of the crank: teeth on both flanks and the pin, against SciPy."""
    machine, span = ms.load_scene('gear_four_bar'), 0.17
    start = machine.initial_state()
    order = [machine.equations.system.free.index(c) for c in ('crank', 'coupler', 'rocker')]
    pin = [geared_four_bar.NAMES.index('coupler_rocker')]
    q, v = np.array(start.q)[order], np.array(start.v)[order]
    impacts, state = geared_four_bar.solve(q, v, pin, span)
    here = [i for i in ms.simulate(machine, duration=span).impacts if i.approach_speed > 1e-3]
    there = [i for i in impacts if i[2] > 1e-3]
    assert [i.joint for i in here] == [i[1] for i in there]
    assert {i.joint for i in here} == {'mesh_left', 'mesh_right'}
    assert max(abs(a.t - b[0]) for a, b in zip(here, there, strict=True)) < 1e-9
    assert max(abs(a.normal_impulse - b[3]) for a, b in zip(here, there, strict=True)) < 1e-9
    o = ms.simulate(machine, duration=span).view(np.array([span])).observed
    assert np.abs(o.position[1:, 0] - state[:3]).max() < 1e-10
    assert np.abs(o.velocity[1:, 0] - state[3:]).max() < 1e-8


def test_modes_are_drive_crossing_and_coast():
    """On the left the pinion drives; the force in contact is that of the ideal pair."""
    gears = GearRattle()
    solution = ms.simulate(scene(gears), duration=4.0 * CYCLE)
    t = np.linspace(2.0 * CYCLE, 4.0 * CYCLE, 400)
    at = without_work(solution, t)
    left, right = (at[f'normal_force.mesh_{side}'] for side in ('left', 'right'))
    assert left.max() > 10.0
    assert right.max() > 10.0
    assert (left * right == 0.0).all()
    wanted = np.array([gears.mesh_force(x) for x in t])
    resting = left + right > 0.0
    assert resting.any()
    assert np.abs((left - right - wanted)[resting]).max() < 1e-9
    play = at['gap.mesh_left'] + at['gap.mesh_right']
    assert np.abs(play - gears.normal_play).max() < 1e-15


def test_without_backlash_the_ideal_pair_comes_back():
    """The wheel's speed is off by no more than the hardest impact, which falls as j^(2/3)."""
    gears = GearRattle()
    t = np.linspace(CYCLE, 3.0 * CYCLE, 300)
    hardest = []
    for play in (1e-5, 1e-6, 1e-7):
        machine = scene(gears, **{'joints.mesh.backlash.width': play})
        solution = ms.simulate(machine, duration=3.0 * CYCLE)
        rate = solution.view(t).observed.velocity[1]
        hardest.append(max(i.approach_speed for i in solution.impacts if i.t > CYCLE))
        off = np.abs(rate + 0.5 * gears.speed).max()
        assert off < 1.1 * hardest[-1] / (gears.teeth[1] * BASE)
    assert np.array(hardest[:-1]) / hardest[1:] == pytest.approx(10.0 ** (2.0 / 3.0), rel=0.05)


def elastic(changes=(), **keys):
    """The pair of `gear_pair` with elastic teeth."""
    mesh = {'mesh': ['pinion', 'wheel'], **keys}
    return ms.load_scene('gear_pair', {'joints.mesh': mesh, 'solver.rtol': 1e-13} | dict(changes))


def test_the_number_of_touching_teeth_is_a_fourier_series():
    """Coefficients against quadrature of the counted pairs; the mean is the contact ratio."""
    pitch, path = 5.9e-3, Path(-4.7e-3, 5.1e-3)

    def pairs(u):
        place = pitch * u / (2.0 * math.pi)
        return sum(path.start <= place + k * pitch <= path.end for k in range(-4, 5))

    centre, ratio = middle(path, pitch), (path.end - path.start) / pitch
    jumps = [
        float(np.remainder(2.0 * math.pi * x / pitch - centre + math.pi, 2.0 * math.pi) - math.pi)
        for x in path
    ]
    mean = quad(lambda u: pairs(u + centre), -math.pi, math.pi, points=jumps)[0] / (2.0 * math.pi)
    assert mean == pytest.approx(ratio, rel=1e-8)
    for j, a in enumerate(touching(path, pitch, 4), 1):
        wave = quad(
            lambda u, j=j: pairs(u + centre) * math.cos(j * u), -math.pi, math.pi, points=jumps
        )[0]
        smooth = math.sin(math.pi * j / 5) / (math.pi * j / 5)
        assert a == pytest.approx(wave / math.pi / mean * smooth, rel=1e-7)


@pytest.mark.sample(1)
@pytest.mark.parametrize('d', [300.0, 3000.0])
def test_elastic_teeth_follow_their_equation(d):
    """Stiffness of the first flank, damping, error: SciPy on the one equation.

    With x = A (N1 th1 + N2 th2) + e the wheel has I th2'' = -(k x + d x') b2 - brake; the phase is
    zero where a contact is in the middle of the most pairs. A damper makes no flank pull.
    """
    k0, a, size, order = 1e8, (0.3, 0.1), 3e-6, 1
    pulls = []
    towards = 0.3  # [rad] of the wheel's centre from the pinion's
    machine = elastic(
        {'links.ground.points.wheel': [0.06 * math.cos(towards), 0.06 * math.sin(towards)]},
        elasticity={'stiffness': k0, 'damping': d, 'variation': list(a)},
        error={'amplitude': size, 'order': order},
        backlash={'width': 1e-4},
    )
    mesh = machine.mechanism.joint('mesh')
    pinion = mesh.wheels[0].gear
    # a tooth of the pinion is on the line of centres there; its flank is half a tooth ahead
    pair = Path(*_path(machine))
    lead = 20.0 * pinion.half_angle(pinion.pitch_radius) - middle(pair, pinion.base_pitch)
    w, c = 2.0 * math.pi * 10.0, 5e-5 * math.cos(math.radians(20.0))

    def rate(t, y):
        th1 = w * t
        h = BASE * (20.0 * th1 + 40.0 * y[0]) + size * math.sin(order * 20.0 * th1)
        dh = BASE * (20.0 * w + 40.0 * y[1]) + size * order * 20.0 * w * math.cos(20.0 * th1)
        force = 0.0
        for sign in (1.0, -1.0):
            x = sign * h - c
            u = sign * 20.0 * (th1 - towards) + lead
            k = k0 * (1.0 + a[0] * math.cos(u) + a[1] * math.cos(2.0 * u))
            if x > 0.0:
                force -= sign * max(k * x + sign * d * dh, 0.0)
                pulls.append(k * x + sign * d * dh < -1.0)
        return [y[1], (force * 40.0 * BASE - 0.2 * y[1]) / WHEEL]

    span = 0.008
    other = solve_ivp(
        rate,
        (0.0, span),
        [0.0, -0.5 * w * (1.0 + size * order / BASE)],
        'DOP853',
        rtol=1e-12,
        atol=1e-15,
        max_step=2e-6,
    )
    o = ms.simulate(machine, duration=span).view(np.array([span])).observed
    assert o.position[1, 0] == pytest.approx(other.y[0, -1], abs=2e-9)
    assert o.velocity[1, 0] == pytest.approx(other.y[1, -1], rel=1e-5)
    assert any(pulls)


def _path(machine):
    from mechanism_sim.joints.mesh.pair import Pair  # noqa: PLC0415

    return Pair(*(t.gear for t in machine.mechanism.joint('mesh').wheels)).path


@pytest.mark.sample(1)
@pytest.mark.parametrize('play', [{}, {'backlash': {'width': '50 um'}}], ids=['tight', 'loose'])
def test_energy_of_elastic_teeth_stays_while_their_stiffness_changes(play):
    """Without damping and drive nothing is lost: the couple of the changing stiffness counts."""
    keys = {'stiffness': 2e7, 'variation': 'contact_ratio'}
    machine = ms.load_scene(
        'gear_pair',
        {
            'joints.mesh': {'mesh': ['pinion', 'wheel'], 'elasticity': keys, **play},
            'drive': {'coordinate': 'pinion', 'speed': 60.0, 'torque': {}},
            'initial': {'velocity': {'wheel': -29.0}},
            'loads': {},
            'duration': 0.05,
        },
    )
    solution = ms.simulate(machine, duration=0.05)
    assert abs(solution.energy.residual) < 1e-11 * solution.energy.initial
    assert solution.energy.dissipated == 0.0
    at = solution.view(np.linspace(0.0, 0.05, 200)).observed
    total = at.kinetic_energy + at.potential_energy
    assert np.abs(total - total[0]).max() < 1e-11 * total[0]
    assert at.potential_energy.max() > 1e-4


def test_energy_stays_in_elastic_teeth_on_a_moving_carrier():
    """All free: the carrier takes its part of every couple."""
    soft = {'stiffness': 1e7, 'variation': 'contact_ratio'}
    error = {'amplitude': 3e-6, 'eccentricity': [5e-6, 8e-6]}
    machine = ms.load_scene(
        'planetary',
        {
            'joints.sun_planet': {'mesh': ['sun', 'planet'], 'elasticity': soft, 'error': error},
            'joints.planet_ring': {'mesh': ['planet', 'ring'], 'elasticity': soft},
            'drive': {'coordinate': 'sun', 'speed': 120.0, 'torque': {}},
            'initial.velocity': {'carrier': 28.0},
            'loads': {},
            'gravity': [0.0, -9.81],
        },
    )
    solution = ms.simulate(machine, duration=0.02)
    assert solution.energy.dissipated == 0.0
    assert abs(solution.energy.residual) < 1e-11 * solution.energy.initial
    at = solution.view(np.linspace(0.0, 0.02, 100)).observed
    assert np.ptp(at.kinetic_energy + at.potential_energy) < 1e-10 * solution.energy.initial
    assert np.ptp(at.kinetic_energy) > 1e-3 * solution.energy.initial


def test_stiff_teeth_come_near_to_rigid_ones():
    """Static compression F/k of a constant load."""
    machine = elastic(elasticity={'stiffness': 1e9, 'damping': 2e4})
    o = ms.simulate(machine, duration=0.05).view(np.array([0.05])).observed
    force = abs(0.2 * o.velocity[1, 0]) / (40.0 * BASE)
    compressed = BASE * (20.0 * o.position[0, 0] + 40.0 * o.position[1, 0])
    assert compressed == pytest.approx(force / 1e9, rel=1e-6)


@pytest.mark.parametrize(
    ('play', 'turns'),
    [
        pytest.param({}, 100_000, marks=pytest.mark.slow),
        pytest.param({'width': '0.1 mm'}, 10_000, marks=pytest.mark.slow),
        ({'width': '0.1 mm'}, 1000),
    ],
)
def test_teeth_stay_in_mesh_over_many_turns(play, turns):
    """No whole turn is lost, no drift gathers; with play the teeth rest on one flank."""
    torque = 1e-6 if play else 0.0
    free = {'drive': {'coordinate': 'pinion', 'speed': 6000.0, 'torque': {'constant': torque}}}
    if play:
        free['joints.mesh.backlash'] = play | {'restitution': 0.0}
    machine = ms.load_scene('gear_pair', free | {'loads': {}})
    run = ms.stream(machine, duration=turns * 2.0 * math.pi / 6000.0)
    for _ in run:
        pass
    pinion, wheel = run.final.observed.position[:, 0]
    assert pinion == pytest.approx(2.0 * math.pi * turns, rel=1e-5 if play else 1e-12)
    ahead = 20.0 * BASE * (pinion + 2.0 * wheel)
    pressed = machine.plan.clearances['mesh'].radial if play else 0.0
    assert ahead == pytest.approx(pressed, abs=1e-11)  # rounding of the angle with all its turns
    assert run.max_closure_error < 1e-15
