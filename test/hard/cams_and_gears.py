"""Cams and gears: the edge of lift-off, chatter, breaks of laws, backlash, long trains."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np

from mechanism_sim.engine.events import Mode
from mechanism_sim.joints.cam.constraint import CamPair
from mechanism_sim.joints.cam.laws import MeasuredLaw
from mechanism_sim.joints.mesh.constraint import GearMesh
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.results.run import Solution
from mechanism_sim.results.simulate import simulate, stream
from mechanism_sim.scene import Machine, load_scene
from test.hard.bodies import relative_residual, residual
from test.hard.case import Figure, hard_case
from test.hard.singular import linkage

TURN = 2.0 * math.pi
MASS, STIFFNESS, PRELOAD, ECCENTRICITY = 0.2, 5000.0, 60.0, 5e-3
RISE, BASE = 8e-3, 20e-3
CYCLOIDAL = {
    'segments': [
        {'from': 0.0, 'to': 0.5 * math.pi, 'rise': RISE},
        {'from': 0.5 * math.pi, 'to': math.pi, 'rise': -RISE},
    ]
}


def valve(law: dict[str, Any], restitution: float = 0.3, **drive: Any) -> Machine:
    """A flat follower pressed by a spring on a cam, without weight."""
    return linkage(
        links={
            'ground': {'points': {'seat': [0, 0.1]}},
            'shaft': {'mass': 1.0, 'inertia': 1e-3},
            'valve': {'mass': MASS},
        },
        joints={
            'bearing': {'revolute': ['ground', 'shaft']},
            'guide': {'prismatic': ['ground', 'valve'], 'axis': 0.5 * math.pi, 'angle': 0.0},
            'contact': {
                'cam': ['shaft', 'valve'],
                'follower': 'flat',
                'base_radius': BASE,
                'law': law,
                'lift_off': {'restitution': restitution},
            },
        },
        springs={
            'spring': {
                'between': ['ground.seat', 'valve'],
                'stiffness': f'{STIFFNESS} N/m',
                'free_length': 0.1 - BASE + PRELOAD / STIFFNESS,
            }
        },
        drive={'coordinate': 'shaft', **drive},
        guess={'valve': BASE},
    )


@hard_case(
    'An eccentric cam a millionth slower, and a millionth faster, than the speed at which its '
    'follower just leaves it at the top: flights rise a tenth of a picometre.',
    'At the top P + 2 k e = m e w^2.',
)
def edge_of_lift_off() -> list[Figure]:
    """Flights in three turns on either side of the closed form."""
    critical = math.sqrt((PRELOAD / ECCENTRICITY + 2.0 * STIFFNESS) / MASS)
    flights = []
    for k in (-1e-6, 1e-6):
        machine = valve({'eccentric': ECCENTRICITY}, speed=critical * (1.0 + k))
        solution = simulate(machine, duration=3.0 * TURN / critical)
        flights.append(sum(m.mode == Mode.FREE_FLIGHT for m in solution.modes))
    return [
        Figure('flights just below', flights[0], 0.0),
        Figure('flights just above, less turns', flights[1] - 3, 0.0),
        Figure('penetration', solution.max_penetration, 1e-15, 'm'),
    ]


@hard_case(
    'A follower with a restitution of 0.95 just above the speed of its lift-off: some hundred and '
    'sixty bounces end in contact, twice a turn.',
    'The energy balance, and gaps from the finished polynomials.',
)
def floating_valve_that_bounces() -> list[Figure]:
    """Twenty turns."""
    machine = valve(CYCLOIDAL, 0.95, speed=155.0, start_angle=4.0)
    solution = simulate(machine, revolutions=20)
    ended = sum(m.mode == Mode.FOLLOWING and m.t > 0.0 for m in solution.modes)
    return [
        Figure('impacts', len(solution.impacts)),
        Figure('times that contact was found again, less 40', ended - 40, 0.0),
        Figure('relative energy residual',
               relative_residual(solution), 1e-12),
        Figure('penetration', solution.max_penetration, 1e-15, 'm'),
        Figure('closure error', solution.max_closure_error, 1e-15, 'm'),
    ]  # fmt: skip


@hard_case(
    'A measured law of 360 points over 1,000 turns: 360,000 rows of its table one after the '
    'other, none of which may be missed, and no more work per step than with a law of few pieces.',
    'The spline itself.',
)
def measured_law() -> list[Figure]:
    """Places at the end, drift, and cost of a step beside a cycloidal law."""
    angle = np.arange(360) * TURN / 360
    rise = 0.25 * RISE * (1.0 - np.cos(angle)) * (1.5 + 0.5 * np.sin(angle))
    points = [[float(x), float(u)] for x, u in zip(angle, rise, strict=True)]
    speed, costs, off, steps, closure = 30.0, [], 0.0, [], []
    law = MeasuredLaw(angle, rise)
    for given, turns in (({'points': points}, 1000), (CYCLOIDAL, 1000)):
        machine = valve(given, speed=speed)
        run = stream(machine, duration=turns * TURN / speed)
        for piece in run:
            closure.append(run.max_closure_error)
            if given is not CYCLOIDAL:
                c = piece.motion.curve
                seen = piece.view(c.start[::50] + 0.3 * c.duration[::50]).observed
                x = np.remainder(seen.position[0], TURN)
                off = max(off, float(np.abs(seen.position[1] - BASE - law(x)).max()))
        costs.append(run.stats.cpu_time / run.stats.steps)
        steps.append(run.stats.steps / turns)
    return [
        Figure('steps per turn, 360 points', steps[0]),
        Figure('steps per turn, cycloidal', steps[1]),
        Figure('place off the spline', off, 1e-14, 'm'),
        Figure('closure error', max(closure), 1e-15, 'm'),
        Figure('cost of a step over that with a cycloidal law', costs[0] / costs[1], 3.0),
    ]


@hard_case(
    'A cam that starts on a break of its law, turns back on another, passes both the other way, '
    'and ends standing still on the first: guards begin and end at zero.',
    'The law itself at the angle of the drive.',
)
def turning_back_on_a_break() -> list[Figure]:
    """Place and acceleration all along, with ramps that reverse at 90 and stop at 0 degrees."""
    w = 10.0
    ramp = 0.02  # [s] from w to 0 and from 0 to w
    forth = (0.5 * math.pi - 0.5 * w * ramp) / w
    times = (0.0, forth, forth + 2.0 * ramp, 2.0 * forth + 2.0 * ramp, 2.0 * forth + 3.0 * ramp)
    # back at 0 while still turning: the last ramp begins half its way before
    end = times[3] - 0.5 * ramp
    profile = [[0.0, w], [times[1], w], [times[2], -w], [end, -w], [end + ramp, 0.0]]
    machine = valve(CYCLOIDAL, profile={'points': profile}, start_angle=0.0)
    solution = simulate(machine, duration=end + 2.0 * ramp)
    t = np.linspace(0.0, solution.duration, 2001)
    seen = solution.view(t).observed
    contact = machine.mechanism.joint('contact')
    assert isinstance(contact, CamPair)
    law = contact.cam.law
    angle, rate, acceleration = seen.position[0], seen.velocity[0], seen.acceleration[0]
    place = BASE + law(angle)
    speed = law(angle, 1) * rate
    felt = law(angle, 2) * rate**2 + law(angle, 1) * acceleration
    largest = float(np.abs(felt).max())
    return [
        Figure('angle at the end', float(angle[-1]), 1e-12, 'rad'),
        Figure('place off the law', float(np.abs(seen.position[1] - place).max()), 1e-14, 'm'),
        Figure('speed off the law', float(np.abs(seen.velocity[1] - speed).max()), 1e-12, 'm/s'),
        Figure('acceleration off the law, relative',
               float(np.abs(seen.acceleration[1] - felt).max()) / largest, 1e-10),
        Figure('flights', sum(m.mode == Mode.FREE_FLIGHT for m in solution.modes), 0.0),
    ]  # fmt: skip


@hard_case(
    'Gears that rattle in a backlash of 1 um, and of 1 mm.',
    'The energy balance; within the backlash the wheel is where the ideal pair has it.',
)
def rattle_from_1_um_to_1_mm() -> list[Figure]:
    """Ten turns of the pinion each."""
    figures = []
    for name, width in (('1 um', 1e-6), ('1 mm', 1e-3)):
        machine = load_scene('gear_rattle', {'joints.mesh.backlash.width': width})
        solution = simulate(machine, revolutions=10)
        t = np.linspace(0.0, solution.duration, 2000)
        pinion, wheel = solution.view(t).observed.position
        apart = np.abs(wheel - wheel[0] + 0.5 * (pinion - pinion[0])).max() * 0.04
        figures += [
            Figure(f'impacts, {name}', len(solution.impacts)),
            Figure(f'wheel off the ideal one over half the width, {name}, less 1',
                   max(float(apart) / (0.5 * width) - 1.0, 0.0), 1e-8),
            Figure(f'relative energy residual, {name}',
                   relative_residual(solution), 1e-12),
            Figure(f'penetration, {name}', solution.max_penetration, 1e-14, 'm'),
        ]  # fmt: skip
    return figures


@hard_case(
    'Teeth of 1e9 N/m, stiffer where two pairs carry: a swing of five kilohertz whose '
    'frequency jumps about with the teeth.',
    'The energy balance; over the run the mesh turns the wheel as fast as its inertia and its '
    'brake say.',
)
def stiff_teeth() -> list[Figure]:
    """Two turns of the pinion."""
    soft = {'stiffness': 1e9, 'damping': 500.0, 'variation': 'contact_ratio'}
    machine = load_scene('mesh_stiffness', {'joints.mesh.elasticity': soft})
    solution = simulate(machine, revolutions=2)
    balance = solution.energy
    ends = solution.view(np.array([0.0, solution.duration])).observed
    turned = float(np.diff(ends.position[1])[0])
    gained = 1500e-6 * float(np.diff(ends.velocity[1])[0])
    carried = _average(solution) * solution.duration
    return [
        Figure('relative energy residual',
               residual(balance) / (balance.drive_work if balance else 1.0), 1e-11),
        Figure('moment on the wheel, relative', carried / (gained + 0.2 * turned) - 1.0, 1e-5),
        Figure('steps per turn', solution.stats.steps / 2.0),
    ]  # fmt: skip


def _average(solution: Solution) -> float:
    """Mean moment of the mesh about the wheel [N m], by many samples."""
    t = (np.arange(200_000) + 0.5) / 200_000 * solution.duration
    k = list(solution.physics.joints).index('mesh')
    return float(np.mean(solution.view(t).observed.reaction_moment[k]))


@hard_case(
    'Backlash and a loose bearing in one machine, each of which shakes the other.',
    'The energy balance, and gaps from the finished polynomials.',
)
def backlash_and_loose_bearing() -> list[Figure]:
    """Ten turns of the crank of the thesis four-bar behind a pair of gears."""
    solution = simulate(load_scene('gear_four_bar'), duration=20.0 * TURN / 73.3038)
    joints = {i.joint for i in solution.impacts}
    return [
        Figure('impacts', len(solution.impacts)),
        Figure('joints without impact', 3 - len(joints), 0.0),
        Figure('relative energy residual',
               relative_residual(solution), 1e-11),
        Figure('penetration', solution.max_penetration, 1e-13, 'm'),
        Figure('closure error', solution.max_closure_error, 1e-13, 'm'),
    ]  # fmt: skip


@hard_case(
    'A hundred thousand revolutions of a pinion of 37 teeth and a wheel of 83: the pair returns '
    'to no state before 83 turns, and no digit of the phase may get lost.',
    'N1 a1 + N2 a2 by exact arithmetic of whole turns and angles.',
)
def hundred_thousand_revolutions() -> list[Figure]:
    """Phase of the mesh, angle and speed at the end."""
    teeth, speed, turns = (37, 83), 200.0, 100_000
    machine = load_scene('gear_pair', {
        'gears.pinion.teeth': teeth[0], 'gears.wheel.teeth': teeth[1], 'loads': {},
        'links.ground.points.wheel': [sum(teeth) * 1e-3, 0.0],
        'drive': {'coordinate': 'pinion', 'speed': speed, 'torque': {}},
    })  # fmt: skip
    run = stream(machine, duration=turns * TURN / speed)
    for piece in run:
        c = piece.motion.curve
    angles = [Fraction(float(x)) for x in c.coefficients[-1, :2, 0]]
    mesh = machine.mechanism.joint('mesh')
    assert isinstance(mesh, GearMesh)
    phase = sum(n * x for n, x in zip(teeth, angles, strict=True)) - Fraction(mesh.phase)
    # whole turns of both are whole teeth, and count for nothing
    off = math.remainder(float(phase), TURN)
    end = run.final.observed
    return [
        Figure('revolutions of the wheel', abs(int(c.turns[-1, 1]))),
        Figure('phase of the teeth off', off, 1e-11, 'rad'),
        Figure('ratio of speeds, relative',
               float(end.velocity[1, 0] / end.velocity[0, 0]) * teeth[1] / teeth[0] + 1.0, 1e-14),
        Figure('speed, relative', float(end.velocity[0, 0]) / speed - 1.0, 1e-11),
    ]  # fmt: skip


@hard_case(
    'A Geneva wheel and a pair of gears on one shaft that a torque turns.',
    'The energy balance; the gear turns in its ratio, and the locked wheel stands at whole slots.',
)
def geneva_and_gears_on_one_shaft() -> list[Figure]:
    """Thirty seconds."""
    machine = load_scene('geneva', {
        'links.flywheel': {'mass': 1.0, 'inertia': 2e-3},
        'links.ground.points.fly': [-0.06, 0.0],
        'joints.fly': {'revolute': ['ground.fly', 'flywheel']},
        'gears': {'on_crank': {'at': 'crank', 'teeth': 40, 'module': 2e-3},
                  'on_fly': {'at': 'flywheel', 'teeth': 20, 'module': 2e-3}},
        'joints.mesh': {'mesh': ['on_crank', 'on_fly']},
        'drive': {'coordinate': 'crank', 'speed': 12.0, 'start_angle': math.pi,
                  'torque': {'constant': 2.0, 'per_speed': -0.15}},
    })  # fmt: skip
    solution = simulate(machine, duration=30.0)
    t = np.linspace(0.0, 30.0, 20_001)
    seen = solution.view(t).observed
    crank, wheel, fly = seen.position
    steps = (wheel - 0.75 * math.pi) / (0.5 * math.pi)
    still = np.cos(crank) < 0.5
    locked = np.abs(steps - np.round(steps))[still].max() * 0.5 * math.pi
    ratio = np.abs(fly - fly[0] + 2.0 * (crank - crank[0])).max()
    balance = solution.energy
    return [
        Figure('indexings', round(abs(float(steps[-1] - steps[0])))),
        Figure('flywheel off its ratio', float(ratio), 1e-10, 'rad'),
        Figure('how far the locked wheel is off', float(locked), 1e-12, 'rad'),
        Figure('relative energy residual',
               residual(balance) / abs(balance.drive_work if balance else 1.0), 1e-12),
    ]  # fmt: skip


@hard_case(
    'A planetary train with nothing held: sun, carrier and ring gear turn in two degrees of '
    'freedom, under torques on each.',
    "Lagrange's equations of the two, whose inertias do not change: the motion is a parabola.",
)
def planetary_with_two_freedoms() -> list[Figure]:
    """Angles and speeds after two seconds."""
    torques = {'sun': 0.4, 'carrier': -0.3, 'ring': 0.2}
    machine = load_scene('planetary', {
        'gravity': [0.0, 0.0], 'links.ring': {'mass': 2.0, 'inertia': 8e-3},
        'joints.ring_shaft': {'revolute': ['ground', 'ring']}, 'gears.ring.at': 'ring',
        'links.carrier.cog': 0.0,
        'drive': {'coordinate': 'sun', 'speed': 30.0, 'torque': {'constant': torques['sun']}},
        'initial.velocity': {'carrier': 5.0},
        'loads': {c: {'at': c, 'torque': torques[c]} for c in ('carrier', 'ring')},
    })  # fmt: skip
    solution = simulate(machine, duration=2.0)
    # by sun s and carrier c: planet p = c - (s - c), ring r = c + (p - c)/3
    rows = {'sun': (1.0, 0.0), 'carrier': (0.0, 1.0), 'planet': (-1.0, 2.0),
            'ring': (-1.0 / 3.0, 4.0 / 3.0)}  # fmt: skip
    bodies = {b.name: b.inertia for b in machine.mechanism.bodies}
    bodies['carrier'] += machine.mechanism.body('planet').mass * 0.048**2
    M = sum(J * np.outer(rows[c], rows[c]) for c, J in bodies.items())
    Q = sum(x * np.array(rows[c]) for c, x in torques.items())
    a = np.linalg.solve(M, Q)
    end = solution.view(np.array([0.0, 2.0])).observed
    names = list(machine.mechanism.coordinates)
    off = spin = 0.0
    for c, row in rows.items():
        i, w = names.index(c), np.array([30.0, 5.0])
        turned = float(np.dot(row, 2.0 * w + 2.0 * a))
        off = max(off, abs(float(np.diff(end.position[i])[0]) / turned - 1.0))
        spin = max(spin, abs(float(end.velocity[i, 1]) / float(np.dot(row, w + 2.0 * a)) - 1.0))
    return [
        Figure('degrees of freedom, less 2', machine.assembly.freedom - 2, 0.0),
        Figure('angles, relative', off, 1e-12),
        Figure('speeds, relative', spin, 1e-12),
    ]


@hard_case(
    'Teeth thrown from flank to flank without loss, far faster than a step of the free motion is '
    'long: both flanks are crossed within every step.',
    'Impacts follow each other by width over speed, exactly.',
)
def flank_to_flank() -> list[Figure]:
    """A thousand crossings of a backlash of 1 um."""
    width, relative = 1e-6, 0.5  # [m], [rad/s] of the wheel against the ideal one
    machine = load_scene('gear_rattle', {
        'loads': {}, 'joints.mesh.backlash': {'width': width, 'restitution': 1.0},
        'drive': {'coordinate': 'pinion', 'speed': 60.0},
        'initial.velocity': {'wheel': -30.0 + relative}, 'start': 'centred',
    })  # fmt: skip
    every = width / (0.04 * relative)  # along the pitch circle of the wheel
    solution = simulate(machine, duration=1000.0 * every)
    times = np.array([i.t for i in solution.impacts])
    exact = (np.arange(len(times)) + 0.5) * every
    law = machine.drive.laws[0]
    assert isinstance(law, DriveLaw)
    return [
        Figure('impacts, less 1000', len(times) - 1000, 0.0),
        Figure('times over the interval', float(np.abs(times - exact).max()) / every, 1e-8),
        Figure('impacts that lost energy',
               sum(abs(i.energy_loss) > 1e-15 for i in solution.impacts), 0.0),
        Figure('relative energy residual',
               relative_residual(solution), 1e-13),
    ]  # fmt: skip
