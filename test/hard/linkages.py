"""Linkages: stiff springs, intermittent motion, moving guides, many links, long runs."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ellipk

from mechanism_sim.results.simulate import simulate, stream
from mechanism_sim.scene import load_scene
from test.hard.bodies import residual
from test.hard.case import Figure, hard_case
from test.hard.singular import linkage

QUARTER = 0.5 * math.pi


@hard_case(
    'Two cars on springs of 1e6 N/m, one on a guide of the other: 250 swings of the faster mode.',
    'Two masses on two springs have two frequencies in closed form.',
)
def stiff_springs() -> list[Figure]:
    """Places after a second, and the energy balance."""
    spring = {'stiffness': '1e6 N/m', 'free_length': '1 m'}
    machine = linkage(
        links={'ground': {}, 'car': {'mass': 1.0}, 'trailer': {'mass': 2.0}},
        joints={
            'rail': {'prismatic': ['ground', 'car']},
            'tow': {'prismatic': ['car', 'trailer']},
        },
        springs={
            'buffer': {'between': ['ground', 'car'], **spring},
            'coupling': {'between': ['car', 'trailer'], **spring},
        },
        drive={'coordinate': 'car', 'force': {}, 'speed': '1 m/s', 'start_position': '1 m'},
        guess={'trailer': '1 m'},
    )
    solution = simulate(machine, duration=1.0)
    # x1'' = k (x2 - 2 x1), x2'' = k (x1 - x2)/2 from rest lengths, begun with x1' = x2' = 1 m/s
    squares, modes = np.linalg.eig(1e6 * np.array([[2.0, -1.0], [-0.5, 0.5]]))
    rates = np.sqrt(squares)
    t = np.linspace(0.9, 1.0, 500)
    shares = np.linalg.solve(modes, [1.0, 1.0]) / rates
    exact = modes @ (shares[:, None] * np.sin(np.outer(rates, t)))
    seen = solution.sample(t, 'position.car', 'position.trailer')
    car = seen['position.car'] - 1.0
    trailer = car + seen['position.trailer'] - 1.0
    off = np.abs(np.array([car, trailer]) - exact).max() / np.abs(exact).max()
    return [
        Figure('swings of the faster mode', rates.max() / (2.0 * math.pi)),
        Figure('relative difference of places', float(off), 1e-11),
        Figure('energy residual', residual(solution.energy), 1e-11, 'J'),
    ]


@hard_case(
    'A slider on an arm that turns at 10,000 rpm, on a spring that all but balances the '
    'centrifugal force: a slow swing is the difference of two large forces.',
    "In the arm's frame r'' = -(k/m - w^2) r with k/m = w^2 (1 + 1e-4); the guide bears 2 m w r', "
    "the drive 2 m w r r'.",
)
def slider_on_a_fast_arm() -> list[Figure]:
    """Place, force and torque through two of the slow swings: 200 revolutions."""
    w, mass, r0 = 10_000 * 2.0 * math.pi / 60.0, 0.5, 0.1
    excess = w * w * 1e-4
    machine = linkage(
        links={
            'ground': {},
            'arm': {'mass': 1.0, 'inertia': 0.01},
            'slider': {'mass': mass, 'inertia': 1e-3},
        },
        joints={
            'pivot': {'revolute': ['ground', 'arm']},
            'guide': {'prismatic': ['arm', 'slider']},
        },
        loads={'spring': {'at': 'slider', 'force': [f'-{mass * (w * w + excess)!r}*slider', 0],
                          'frame': 'link'}},
        drive={'coordinate': 'arm', 'speed': w},
        guess={'slider': r0},
    )  # fmt: skip
    slow = math.sqrt(excess)
    solution = simulate(machine, duration=2.0 * 2.0 * math.pi / slow)
    t = np.linspace(0.0, solution.duration, 1001)
    seen = solution.sample(
        t, 'reaction.guide.x', 'reaction.guide.y', 'position.slider', 'drive_torque'
    )
    r, rate = r0 * np.cos(slow * t), -r0 * slow * np.sin(slow * t)
    force = np.hypot(seen['reaction.guide.x'], seen['reaction.guide.y'])
    largest = 2.0 * mass * w * r0 * slow
    torque = 2.0 * mass * w * r * rate
    return [
        Figure('place over amplitude', np.abs(seen['position.slider'] - r).max() / r0, 1e-10),
        Figure('force of the guide over its largest',
               np.abs(force - np.abs(2.0 * mass * w * rate)).max() / largest, 1e-10),
        Figure('torque over its largest',
               np.abs(seen['drive_torque'] - torque).max() / np.abs(torque).max(), 1e-10),
    ]  # fmt: skip


@hard_case(
    'A Geneva wheel under a torque, 1,000 indexings: locked and moving equations take turns 2,000 '
    'times, and nothing but them holds the wheel in its place.',
    'Locked, the wheel stands at a whole number of slots; and the energy balance.',
)
def thousand_indexings() -> list[Figure]:
    """Position of the wheel, and the energy residual."""
    torque = {'constant': 2.0, 'per_speed': -0.1}
    machine = load_scene('geneva', {'drive': {'speed': 20.0, 'torque': torque,
                                              'start_angle': '180 deg'}})  # fmt: skip
    run, off, indexed, crank = stream(machine, duration=340.0), 0.0, 0.0, 0.0
    for piece in run:
        c = piece.motion.curve
        seen = piece.view(c.start + 0.5 * c.duration).observed
        crank, wheel = seen.position
        locked = np.cos(crank) < 0.5
        steps = (wheel[locked] - 0.75 * math.pi) / QUARTER
        off = max(off, float(np.abs(steps - np.round(steps)).max()) * QUARTER)
        indexed, crank = steps[-1], crank[-1]
    turns = math.floor((crank - math.pi) / (2.0 * math.pi) + 0.5)
    energy = run.energy
    lost = energy.dissipated if energy else math.nan
    return [
        Figure('indexings', abs(round(indexed))),
        Figure('indexings less revolutions', abs(round(indexed)) - turns, 1.0),
        Figure('how far the locked wheel is off', off, 1e-12, 'rad'),
        Figure('energy residual over what bearings took', residual(energy) / lost, 1e-12),
        Figure('closure error', run.max_closure_error, 1e-12, 'm'),
    ]


@hard_case(
    'Ten links in four loops, two of their joints loose.',
    'The energy balance, and gaps and loops from the finished polynomials.',
)
def ten_links_two_loose_joints() -> list[Figure]:
    """A quarter of a second of the walking leg."""
    loose = {'radial': 1e-4, 'restitution': 0.5}
    joints = 'lower_rod_strut', 'shank_foot'
    machine = load_scene('ten_links', {f'joints.{j}.clearance': loose for j in joints})
    solution = simulate(machine, revolutions=0.25)
    balance = solution.energy
    exchanged = sum(i.normal_impulse * i.approach_speed for i in solution.impacts)
    scale = exchanged + (abs(balance.initial) if balance else math.nan)
    return [
        Figure('impacts', len(solution.impacts)),
        Figure('relative energy residual', residual(balance) / scale, 1e-9),
        Figure('penetration', solution.max_penetration, 1e-12, 'm'),
        Figure('closure error', solution.max_closure_error, 1e-12, 'm'),
    ]


@hard_case(
    'A pendulum released at 150 degrees, 10,000 swings at a tolerance of 1e-12 each.',
    'The period by the complete elliptic integral, 4 K(sin(75 deg)) sqrt(I/(m g l)).',
)
def ten_thousand_swings() -> list[Figure]:
    """Growth of the amplitude's energy, and the phase after all swings."""
    amplitude, swings = math.radians(150.0), 10_000
    machine = linkage(
        links={'ground': {}, 'rod': {'mass': 1.0, 'inertia': 0.02, 'cog': 0.3}},
        joints={'pivot': {'revolute': ['ground', 'rod']}},
        gravity=[0, -9.81],
        drive={'coordinate': 'rod', 'torque': {}, 'speed': 0.0,
               'start_angle': amplitude - QUARTER},
    )  # fmt: skip
    square = 0.3 * 9.81 / (0.02 + 0.3**2)
    period = 4.0 * float(ellipk(math.sin(0.5 * amplitude) ** 2)) / math.sqrt(square)
    run = stream(machine, duration=(swings + 0.25) * period)
    for _ in run:
        pass
    end = run.final.observed
    low, rate = float(end.position[0, 0]) + QUARTER, float(end.velocity[0, 0])
    late = low / rate
    height = 0.3 * 9.81 * (1.0 - math.cos(amplitude))
    return [
        Figure('phase after all swings, in periods', late / period, 1e-8),
        Figure('energy residual over that of a swing', residual(run.energy) / height, 1e-11),
    ]


@hard_case(
    'A crank-rocker that nobody drives, 5,000 revolutions: its loop is held closed by '
    'accelerations alone, so errors of position could grow without bound.',
    'Loops from the finished polynomials; without weight and friction the kinetic energy stays.',
)
def closure_after_five_thousand_revolutions() -> list[Figure]:
    """Closure errors of the first piece and of all, and the energy."""
    machine = load_scene(
        'four_bar_crank_rocker',
        {'drive': {'coordinate': 'crank', 'speed': 60.0, 'torque': {}}, 'gravity': [0, 0]},
    )
    run, first = stream(machine, duration=530.0), 0.0
    for _ in run:
        first = first or run.max_closure_error
    turns = abs(float(run.final.observed.position[0, 0])) / (2.0 * math.pi)
    balance = run.energy
    return [
        Figure('revolutions', turns),
        Figure('closure error', run.max_closure_error, 1e-14, 'm'),
        Figure('largest closure error over that of the first piece',
               run.max_closure_error / first, 10.0),
        Figure('relative energy residual',
               residual(balance) / (balance.initial if balance else 1.0),
               5e-11),
    ]  # fmt: skip
