"""Force elements and states of first order: tables, stops, gas, bushings, servos, hydraulics."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from builders import digest_of, made
from numpy.typing import NDArray
from running import run
from scipy.linalg import expm
from switched import switched

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.run import Solution

INPUTS = Path(__file__).parent / 'inputs'
GRAVITY = 9.81

Array = NDArray[np.float64]

ARM: dict[str, Any] = {
    'links': {
        'ground': {'points': {'top': [0.15, 0.3]}},
        'arm': {'length': 0.4, 'points': {'strut': [0.25, 0.0]}, 'mass': 10.0, 'inertia': 0.15,
                'cog': 0.3},
    },
    'joints': {'pivot': {'revolute': ['ground', 'arm']}},
    'gravity': [0.0, -GRAVITY],
}  # fmt: skip
"""An arm on a pivot, 10 kg, with a point for a strut."""
INERTIA = 0.15 + 10.0 * 0.3**2

BLOCK: dict[str, Any] = {
    'links': {'ground': {}, 'block': {'mass': 2.0, 'inertia': 0.0}},
    'joints': {'guide': {'prismatic': ['ground', 'block'], 'axis': '90 deg'}},
    'gravity': [0.0, -GRAVITY],
}
"""A block of 2 kg on a vertical guide."""


def at_end(solution: Solution, *names: str) -> Array:
    """Quantities at the end of a run."""
    found = solution.sample(np.array([solution.duration]), *names)
    return np.array([found[name][0] for name in names])


def read(name: str) -> dict[str, Any]:
    """An input."""
    content: dict[str, Any] = yaml.safe_load((INPUTS / f'{name}.yaml').read_text())
    return content


def balanced(solution: Solution) -> None:
    """Assert that all energy is accounted for."""
    energy = solution.energy
    assert energy is not None
    assert abs(energy.residual) <= 1e-11 * energy.exchanged + energy.rounding


def strut(q: float, v: float) -> tuple[float, float, float]:
    """Length of the strut of `ARM`, its rate, and its lever on the arm."""
    c, s = math.cos(q), math.sin(q)
    d = np.array([0.25 * c - 0.15, 0.25 * s - 0.3])
    length = float(np.hypot(*d))
    lever = 0.25 * (c * d[1] - s * d[0]) / length
    return length, v * lever, lever


# --- the cases -----------------------------------------------------------------------------------


def test_damper_by_a_table() -> None:
    """Drake issue 19236 (tabular damper): the value of the list of cases, by SciPy."""
    solution = ms.simulate(ms.load_scene(INPUTS / 'tabular_damper.yaml'))
    (angle,) = at_end(solution, 'position.arm')
    assert angle == pytest.approx(-0.08231263, abs=5e-9)
    balanced(solution)


def test_bump_stop_with_a_gap() -> None:
    """Strut of the same, with a stop of 20 N/mm below 230 mm, damped: it never pulls."""
    stop = {'between': ['ground.top', 'arm.strut'], 'stiffness': '20 N/mm', 'damping': '800 N s/m',
            'free_length': '230 mm', 'acts': 'below'}  # fmt: skip
    content = read('tabular_damper')
    content['springs']['stop'] = stop
    content['drive'] = {'coordinate': 'arm', 'torque': {}, 'start_angle': '-40 deg', 'speed': 16.0}
    solution = ms.simulate(made(content), duration=0.6)

    table = [(-1.0, -400.0), (-0.1, -120.0), (0.0, 0.0), (0.1, 300.0), (1.0, 1500.0)]
    x, y = np.array(table).T

    def guards(_: float, state: Array) -> list[float]:
        length, rate, _ = strut(*state)
        pushed = 2e4 * (length - 0.23) + 800.0 * rate
        return [0.23 - length, -pushed, *(rate - x)]

    def rates(_: float, state: Array, positive: Any) -> list[float]:
        q, v = state
        length, rate, lever = strut(q, v)
        row = sum(positive[2:])
        damped = y[0] if row == 0 else y[-1] if row == len(x) else y[row - 1] + (
            rate - x[row - 1]) * (y[row] - y[row - 1]) / (x[row] - x[row - 1])  # fmt: skip
        pull = 8000.0 * (length - 0.32) + damped
        if positive[0] and positive[1]:
            pull += 2e4 * (length - 0.23) + 800.0 * rate
        return [v, (-pull * lever - 10.0 * GRAVITY * 0.3 * math.cos(q)) / INERTIA]

    right = switched(rates, guards, [math.radians(-40.0), 16.0], 0.6)
    assert at_end(solution, 'position.arm', 'velocity.arm') == pytest.approx(right, abs=1e-9)
    found = solution.sample(np.linspace(0.0, 0.6, 301), 'spring.stop')
    assert found['spring.stop.length'].min() < 0.22
    assert found['spring.stop.force'].max() <= 0.0
    assert (found['spring.stop.force'][found['spring.stop.length'] > 0.23] == 0.0).all()
    balanced(solution)


def test_hydraulic_arm() -> None:
    """The pressure is the integral of where the arm is, which nothing but its weight moves."""
    solution = ms.simulate(ms.load_scene(INPUTS / 'hydraulic_arm.yaml'))

    def rates(_: float, y: Array, __: Any) -> list[float]:
        return [y[1], -120.0 * GRAVITY * 0.5 * math.cos(y[0]) / 40.0, 2e6 * (0.35 - y[0])]

    right = switched(rates, lambda *_: [], [0.0, 0.0, 2e6], 0.4, [1.0, 1.0, 1e6])
    found = at_end(solution, 'position.arm', 'velocity.arm', 'state.p0')
    assert found == pytest.approx(right, rel=1e-12)
    balanced(solution)


CYLINDER = """
title: Arm on a hydraulic cylinder with a valve
mechanism: linkage
links:
  ground: {points: {o: [0 m, 0 m], h: [0 m, -0.25 m]}}
  arm: {points: {rod: [0.25 m, 0 m]}, mass: 120 kg, inertia: 10 kg m^2, cog: 0.5 m}
joints: {o: {revolute: [ground.o, arm]}}
gravity: [0, -9.81 m/s^2]
springs:
  cylinder: {between: [ground.h, arm.rod], force: "1e3*rate - 1e-3*p0 + 6e-4*p1"}
states:
  valve: {rate: "(12*(0.1 - arm) - valve)/0.05", start: 0.3}
  p0:
    start: 27 bar
    rate: "1e9/(1e-4 + 1e-3*(cylinder.length - 0.3))*(4e-8*valve*sqrt(100e5 - p0 if valve > 0 else
           p0 - 1e5) - 1e-3*cylinder.rate)"
  p1:
    start: 10 bar
    rate: "1e9/(1e-4 + 6e-4*(0.5 - cylinder.length))*(6e-4*cylinder.rate - 4e-8*valve*sqrt(
           p1 - 1e5 if valve > 0 else 100e5 - p1))"
measures:
  highest: largest(p0)
duration: 1 s
"""
"""After `HydraulicActuatorSimple` of Exudyn (J. Gerstmayr): flow through a valve by the root of
the difference of pressures, compressed in the chambers and used up by the piston; the valve
follows the arm with a lag of 50 ms, so that its flow reverses."""


def cylinder_rates(_: float, y: Array, positive: Any) -> list[float]:
    """Of angle, speed, valve and both pressures, written out."""
    q, v, valve, p0, p1 = y
    rod = 0.25 * np.array([math.cos(q), math.sin(q)])
    d = rod - [0.0, -0.25]
    length = float(np.hypot(*d))
    rate = float(v * 0.25 * np.array([-math.sin(q), math.cos(q)]) @ d / length)
    pull = 1e3 * rate - 1e-3 * p0 + 6e-4 * p1
    torque = -pull * float(rod[0] * d[1] - rod[1] * d[0]) / length
    forth = positive[0]
    q0 = 4e-8 * valve * math.sqrt(1e7 - p0 if forth else p0 - 1e5)
    q1 = 4e-8 * valve * math.sqrt(p1 - 1e5 if forth else 1e7 - p1)
    return [
        v,
        (torque - 120.0 * GRAVITY * 0.5 * math.cos(q)) / 40.0,
        (12.0 * (0.1 - q) - valve) / 0.05,
        1e9 / (1e-4 + 1e-3 * (length - 0.3)) * (q0 - 1e-3 * rate),
        1e9 / (1e-4 + 6e-4 * (0.5 - length)) * (6e-4 * rate - q1),
    ]


def test_pressures_that_lift_an_arm() -> None:
    """Two chambers, a valve that reverses, and the piston's force on the arm."""
    solution = ms.simulate(made(CYLINDER), duration=1.0)
    size = [1.0, 1.0, 1.0, 1e5, 1e5]
    start = [0.0, 0.0, 0.3, 27e5, 10e5]
    right = switched(cylinder_rates, lambda _, y: [y[2]], start, 1.0, size)
    names = 'position.arm', 'velocity.arm', 'state.valve', 'state.p0', 'state.p1'
    assert at_end(solution, *names) / size == pytest.approx(right / size, abs=1e-9)
    assert (
        solution.sample(np.linspace(0.0, 1.0, 101), 'state.valve')['state.valve'] < -1e-3
    ).any()
    balanced(solution)


SERVO: dict[str, Any] = {
    'links': {'ground': {}, 'arm': {'length': 0.4, 'mass': 2.0, 'inertia': 0.03, 'cog': 0.2}},
    'joints': {'o': {'revolute': ['ground', 'arm']}},
    'gravity': [0.0, -GRAVITY],
    'servos': {'hold': {'coordinate': 'arm', 'target': '60 deg', 'p': '20 N m/rad',
                        'i': '40 N m/rad/s', 'd': '2 N m s/rad', 'limit': '6 N m'}},
}  # fmt: skip


def servo_at(end: float) -> Array:
    """Angle, speed and integral of `SERVO`, from event to event."""
    target = math.radians(60.0)

    def wanted(y: Array) -> float:
        return 20.0 * (target - y[0]) - 2.0 * y[1] + 40.0 * y[2]

    def rates(_: float, y: Array, positive: Any) -> list[float]:
        effort = 6.0 if positive[0] else wanted(y) if positive[1] else -6.0
        a = (effort - 2.0 * GRAVITY * 0.2 * math.cos(y[0])) / (0.03 + 2.0 * 0.2**2)
        return [y[1], a, target - y[0] + (effort - wanted(y)) / 20.0]

    def guards(_: float, y: Array) -> list[float]:
        return [wanted(y) - 6.0, wanted(y) + 6.0]

    return switched(rates, guards, [0.0, 0.0, 0.0], end)


def test_servo_with_integrator_at_its_limit() -> None:
    """PID with tracking: it starts at its limit, and lifts the arm to its target."""
    solution = ms.simulate(made(SERVO), duration=3.0)
    found = at_end(solution, 'position.arm', 'velocity.arm', 'state.hold.integral')
    assert found == pytest.approx(servo_at(3.0), abs=1e-12)
    t = np.linspace(0.0, 3.0, 301)
    torque = solution.sample(t, 'servo.hold.torque')['servo.hold.torque']
    assert np.abs(torque).max() == pytest.approx(6.0, rel=1e-12)
    balanced(solution)


# --- more of each kind ---------------------------------------------------------------------------


def test_servo_of_a_length_follows_a_formula() -> None:
    """PD on a block that is to move as a sine: a linear equation, solved by an exponential."""
    servo = {'between': ['ground', 'block'], 'target': '0.4 + 0.1*sin(3*t)', 'p': '500 N/m',
             'target_rate': '0.3*cos(3*t)', 'd': '20 N s/m'}  # fmt: skip
    scene = BLOCK | {'servos': {'lift': servo}, 'initial': {'position': {'block': '0.3 m'}}}
    solution = ms.simulate(made(scene), duration=2.0)
    # of x, x', sin(3 t), cos(3 t), 1
    A = np.zeros((5, 5))
    A[0, 1], A[2, 3], A[3, 2] = 1.0, 3.0, -3.0
    A[1] = [-250.0, -10.0, 25.0, 3.0, 250.0 * 0.4 - GRAVITY]
    right = expm(2.0 * A) @ [0.3, 0.0, 0.0, 1.0, 1.0]
    found = at_end(solution, 'position.block', 'velocity.block')
    assert found == pytest.approx(right[:2], abs=1e-12)
    balanced(solution)


@pytest.mark.parametrize(
    ('target', 'rate', 'said'),
    [
        ('0.4 + 0.1*sin(3*t)', '0.3 m/s*cos(3 rad/s*t)', ('target_rate', 'target')),
        ('0.4 m + 0.1 m*sin(3 rad/s*t)', '0.3*cos(3*t)', ('target', 'target_rate')),
        ('0.4 m + 0.1 m*sin(3 rad/s*t)', '0.3 m/s*cos(3 rad/s*t)', ()),
        ('0.4 m + block', 'block_rate', ()),
    ],
)  # fmt: skip
def test_formulas_of_a_servo_have_units_both_or_neither(
    target: str, rate: str, said: tuple[str, ...]
) -> None:
    """What names alone have units does not contradict one that has them."""
    servo = {'between': ['ground', 'block'], 'target': target, 'target_rate': rate,
             'p': '500 N/m', 'd': '20 N s/m'}  # fmt: skip
    scene = BLOCK | {'servos': {'lift': servo}, 'initial': {'position': {'block': '0.3 m'}}}
    if not said:
        assert made(scene)
        return
    words = r'servos\.lift\.{} has units, but servos\.lift\.{} has none: give both formulas'
    with pytest.raises(InputError, match=words.format(*said)):
        made(scene)


@pytest.mark.parametrize('as_drive', [False, True])
def test_motor_with_the_current_of_its_winding(as_drive: bool) -> None:
    """L di/dt = U - R i - k w and J w' = k i - b w: linear, solved by an exponential."""
    scene: dict[str, Any] = {
        'links': {'ground': {}, 'rotor': {'mass': 1.0, 'inertia': 0.02}},
        'joints': {'o': {'revolute': ['ground', 'rotor']}},
        'states': {'current': {'start': '0 A', 'rate': '(24 - 2*current - 0.5*rotor_rate)/0.1'}},
    }
    torque = '0.5*current - 0.01*rotor_rate'
    if as_drive:
        scene['drive'] = {'coordinate': 'rotor', 'torque': torque}
    else:
        scene['loads'] = {'motor': {'at': 'rotor', 'torque': torque}}
    solution = ms.simulate(made(scene), duration=1.0)
    A = np.array([[0, 1, 0, 0], [0, -0.5, 25, 0], [0, -5, -20, 240], [0, 0, 0, 0]], float)
    right = expm(A) @ [0.0, 0.0, 0.0, 1.0]
    found = at_end(solution, 'position.rotor', 'velocity.rotor', 'state.current')
    assert found == pytest.approx(right[:3], rel=1e-11)
    energy = solution.energy
    assert energy is not None
    work = energy.drive_work if as_drive else -energy.dissipated
    assert work == pytest.approx(0.5 * 0.02 * right[1] ** 2, rel=1e-10)
    balanced(solution)


def test_states_of_a_prescribed_motion() -> None:
    """Nothing is free but an integral, of which a closed form is known."""
    scene = {
        'links': {'ground': {}, 'crank': {'length': 0.1, 'mass': 1.0, 'inertia': 0.01}},
        'joints': {'o': {'revolute': ['ground', 'crank']}},
        'drive': {'coordinate': 'crank', 'speed': '3 rad/s'},
        'states': {'way': {'start': '0 m', 'rate': '0.1*sin(crank)*crank_rate'}},
    }
    solution = ms.simulate(made(scene), duration=2.0)
    assert at_end(solution, 'state.way')[0] == pytest.approx(
        0.1 * (1.0 - math.cos(6.0)), abs=1e-13
    )


def test_gas_spring() -> None:
    """A block on a gas spring: its speed by the energy of the polytrope, in closed form."""
    gas = {'force': '60 N', 'column': '200 mm', 'exponent': 1.4}
    spring = {'coordinate': 'block', 'free_length': '300 mm', 'gas': gas}
    scene = BLOCK | {'springs': {'gas': spring}, 'initial': {'position': {'block': '0.3 m'}}}
    solution = ms.simulate(made(scene), duration=0.25)
    z, v = at_end(solution, 'position.block', 'velocity.block')

    def potential(z: float) -> float:
        share = 0.2 / (0.2 + z - 0.3)
        return 60.0 * 0.2 / 0.4 * share**0.4 + 2.0 * GRAVITY * z

    assert v**2 == pytest.approx(potential(0.3) - potential(z), rel=1e-12)
    assert z > 0.5
    balanced(solution)
    assert solution.energy is not None
    assert solution.energy.dissipated == 0.0


def test_spring_by_a_table_stores_its_energy() -> None:
    """A hardening spring with preload: speed by the area below its table, in closed form."""
    points = [['-0.2 m', '-90 N'], ['-0.1 m', '-30 N'], ['0.1 m', '30 N'], ['0.2 m', '90 N']]
    spring = {'between': ['ground', 'block'], 'stiffness': 'hard', 'free_length': '0.5 m',
              'preload': '-19.62 N'}  # fmt: skip
    scene = BLOCK | {'tables': {'hard': {'points': points}}, 'springs': {'spring': spring},
                     'initial': {'position': {'block': '0.32 m'}}}  # fmt: skip
    solution = ms.simulate(made(scene), duration=0.11)
    z, v = at_end(solution, 'position.block', 'velocity.block')

    def stored(x: float) -> float:
        beyond = max(abs(x) - 0.1, 0.0)
        return 150.0 * min(abs(x), 0.1) ** 2 + 30.0 * beyond + 300.0 * beyond**2

    assert v**2 == pytest.approx(stored(0.18) - stored(z - 0.5), rel=1e-11)
    balanced(solution)
    assert solution.energy is not None
    assert solution.energy.dissipated == 0.0


def test_torsion_spring_by_a_formula() -> None:
    """A disc on a shaft that hardens with the cube of the twist: speed by its energy."""
    scene = {
        'links': {'ground': {}, 'disc': {'mass': 1.0, 'inertia': 0.02}},
        'joints': {'o': {'revolute': ['ground', 'disc']}},
        'springs': {'shaft': {'between': ['ground', 'disc'], 'torque': '2*angle + 5*angle^3'}},
        'initial': {'position': {'disc': '1.2 rad'}},
    }
    solution = ms.simulate(made(scene), duration=0.3)
    q, w = at_end(solution, 'position.disc', 'velocity.disc')

    def stored(q: float) -> float:
        return q**2 + 1.25 * q**4

    assert 0.01 * w**2 == pytest.approx(stored(1.2) - stored(q), rel=1e-11)
    balanced(solution)


def test_spring_along_a_guide_goes_through_zero() -> None:
    """Along a displacement the force changes its sign with it: an oscillator about zero."""
    spring = {'coordinate': 'block', 'stiffness': '200 N/m', 'damping': '4 N s/m'}
    scene = BLOCK | {'gravity': [0.0, 0.0], 'springs': {'spring': spring},
                     'initial': {'position': {'block': '0.1 m'}}}  # fmt: skip
    solution = ms.simulate(made(scene), duration=3.0)
    right = expm(3.0 * np.array([[0.0, 1.0], [-100.0, -2.0]])) @ [0.1, 0.0]
    found = at_end(solution, 'position.block', 'velocity.block')
    assert found == pytest.approx(right, abs=1e-13)
    balanced(solution)


@pytest.mark.slow
def test_springs_of_all_kinds_under_a_prescribed_motion() -> None:
    """The torque that a steady crank needs against them, in closed form."""
    points = {
        'damper': [['-1 m/s', '-400 N'], ['-0.1 m/s', '-120 N'], ['0 m/s', '0 N'],
                   ['0.1 m/s', '300 N'], ['1 m/s', '1500 N']],
        'hard': [['-0.2 m', '-90 N'], ['0 m', '0 N'], ['0.1 m', '30 N'], ['0.2 m', '90 N']],
    }  # fmt: skip
    line = {'between': ['ground.top', 'crank.end'], 'free_length': '0.5 m'}
    springs = {
        'strut': {**line, 'damping': 'damper', 'stiffness': 'hard', 'preload': '5 N'},
        'stop': {**line, 'free_length': '0.35 m', 'stiffness': '5 N/mm', 'damping': '20 N s/m',
                 'acts': 'below'},
        'gas': {**line, 'gas': {'force': '100 N', 'column': '0.4 m', 'exponent': 1.3}},
        'formula': {**line, 'force': '10*length^2 + 3*rate*abs(rate) + 2*strut.length'},
        'torsion': {'coordinate': 'crank', 'torque': '0.3*angle + 0.1*sin(angle)'},
    }  # fmt: skip
    scene = {
        'links': {'ground': {'points': {'top': [0.15, 0.5]}},
                  'crank': {'length': 0.25, 'mass': 2.0, 'inertia': 0.02}},
        'joints': {'o': {'revolute': ['ground', 'crank']}}, 'springs': springs,
        'tables': {name: {'points': x} for name, x in points.items()},
        'drive': {'coordinate': 'crank', 'speed': '6 rad/s'},
    }  # fmt: skip
    solution = ms.simulate(made(scene), revolutions=1)
    t = np.linspace(0.0, solution.duration, 200)[1:-1]
    seen = solution.sample(t, 'drive_torque', 'spring.stop.force')
    q = 6.0 * t
    end = 0.25 * np.array([np.cos(q), np.sin(q)])
    d = end - np.array([[0.15], [0.5]])
    length = np.hypot(*d)
    rate = (d * 1.5 * np.array([-np.sin(q), np.cos(q)])).sum(axis=0) / length
    damped = np.interp(rate, [-1.0, -0.1, 0.0, 0.1, 1.0], [-400.0, -120.0, 0.0, 300.0, 1500.0])
    pull = damped + np.interp(length - 0.5, [-0.2, 0.0, 0.1, 0.2], [-90.0, 0.0, 30.0, 90.0]) + 5.0
    pushed = 5000.0 * (length - 0.35) + 20.0 * rate
    stop = np.where((length < 0.35) & (pushed < 0.0), pushed, 0.0)
    pull += stop - 100.0 * (0.4 / (length - 0.1)) ** 1.3
    pull += 10.0 * length**2 + 3.0 * rate * np.abs(rate) + 2.0 * length
    torque = pull * (end[0] * d[1] - end[1] * d[0]) / length + 0.3 * q + 0.1 * np.sin(q)
    assert seen['drive_torque'] == pytest.approx(torque, abs=1e-10)
    assert seen['spring.stop.force'] == pytest.approx(stop, abs=1e-10)
    balanced(solution)


BUSHING: dict[str, Any] = {
    'links': {
        'ground': {},
        'arm': {'length': 0.4, 'mass': 2.0, 'inertia': 0.03, 'cog': 0.2},
        'bob': {'length': 0.3, 'mass': 1.0, 'inertia': 0.02, 'cog': 0.15},
    },
    'joints': {'o': {'revolute': ['ground', 'arm']}},
    'gravity': [0.0, -GRAVITY],
    'bushings': {
        'rubber': {
            'between': ['arm.end', 'bob.start'],
            'stiffness': {'x': '20 N/mm', 'y': '10 N/mm', 'angle': '5 N m/rad'},
            'damping': {'x': '10 N s/m', 'y': '20 N s/m', 'angle': '0.1 N m s/rad'},
        }
    },
}


def test_bushing_on_a_turning_arm() -> None:
    """A second pendulum hangs on rubber alone: Newton's and Euler's equations of both, by hand."""
    solution = ms.simulate(made(BUSHING), duration=1.0)

    def turned(angle: float, x: float) -> Array:
        return x * np.array([math.cos(angle), math.sin(angle)])

    def cross(a: Array, b: Array) -> float:
        return float(a[0] * b[1] - a[1] * b[0])

    def rates(_: float, y: Array, __: Any) -> list[float]:
        a, b, *place, va, vb, vx, vy = y
        normal = np.array([[0.0, -1.0], [1.0, 0.0]])
        R = np.array([turned(a, 1.0), normal @ turned(a, 1.0)])
        end, arm = turned(a, 0.4), turned(b, -0.15)
        away = place + arm - end
        rate = np.array([vx, vy]) + vb * normal @ arm - va * normal @ end - va * normal @ away
        force = -R.T @ ([20e3, 10e3] * (R @ away) + [10.0, 20.0] * (R @ rate))
        moment = -5.0 * (b - a) - 0.1 * (vb - va)
        weight = np.array([0.0, -GRAVITY])
        on_arm = cross(end + away, -force) - moment + cross(turned(a, 0.2), 2.0 * weight)
        return [va, vb, vx, vy, on_arm / (0.03 + 2.0 * 0.2**2),
                (cross(arm, force) + moment) / 0.02, *(force + weight)]  # fmt: skip

    start = [0.0, 0.0, 0.55, 0.0, 0.0, 0.0, 0.0, 0.0]
    right = switched(rates, lambda *_: [], start, 1.0)
    names = [f'position.{c}' for c in ('arm', 'bob', 'bob.x', 'bob.y')]
    assert at_end(solution, *names) == pytest.approx(right[:4], abs=1e-11)
    balanced(solution)


@pytest.mark.parametrize('angle', [30.0, 0.0])
def test_states_beside_singular_positions(angle: float) -> None:
    """A parallelogram turns steadily through its change points, or starts in one: integrals."""
    link = {'mass': 1.0, 'inertia': 0.01, 'cog': 0.1, 'length': 0.2}
    scene = {
        'links': {
            'ground': {'points': {'b': [0.5, 0.0]}}, 'crank': link, 'rocker': link,
            'coupler': {'mass': 1.0, 'inertia': 0.01, 'cog': 0.25, 'length': 0.5},
        },
        'joints': {
            'a': {'revolute': ['ground', 'crank']}, 'b': {'revolute': ['rocker', 'ground.b']},
            'c': {'revolute': ['crank.end', 'coupler']},
            'd': {'revolute': ['coupler.end', 'rocker.end']},
        },
        'drive': {'coordinate': 'crank', 'torque': {}, 'speed': '5 rad/s',
                  'start_angle': f'{angle} deg'},
        'guess': {'rocker': f'{angle} deg', 'coupler': '0 deg'},
        'states': {'z': {'rate': 'sin(crank) + t'},
                   'p': {'start': '3 bar', 'rate': '1e5*crank_rate'}},
    }  # fmt: skip
    solution, start = ms.simulate(made(scene), duration=2.0), math.radians(angle)
    z, p = at_end(solution, 'state.z', 'state.p')
    assert z == pytest.approx((math.cos(start) - math.cos(start + 10.0)) / 5.0 + 2.0, abs=1e-11)
    assert p == pytest.approx(3e5 + 1e6, rel=1e-12)


# --- long runs, snapshots, mistakes --------------------------------------------------------------


@pytest.mark.parametrize('long', [2_000.0, pytest.param(20_000.0, marks=pytest.mark.slow)])
def test_ten_thousand_times_as_long(long: float) -> None:
    """A filter behind a steady crank: after 20,000 s as exact as after 2 s."""
    scene = {
        'links': {'ground': {}, 'crank': {'length': 0.1, 'mass': 1.0, 'inertia': 0.01}},
        'joints': {'o': {'revolute': ['ground', 'crank']}},
        'drive': {'coordinate': 'crank', 'speed': '2 rad/s'},
        'states': {'u': {'rate': '(sin(crank) - u)/0.5'}},
    }
    machine = made(scene)
    for end in (2.0, long):
        run = ms.stream(machine, duration=end)
        for _ in run:
            pass
        phase = math.remainder(2.0 * end, 2.0 * math.pi)
        right = 0.5 * (math.sin(phase) - math.cos(phase)) + 0.5 * math.exp(-end / 0.5)
        assert run.final.states()[0, 0] == pytest.approx(right, abs=2e-11)


@pytest.mark.slow
def test_a_servo_follows_ten_thousand_times_as_long() -> None:
    """A sine, after 20,000 s with the lag of the linear equation that it has after 20 s."""
    servo = {'between': ['ground', 'block'], 'target': '0.4 + 0.1*sin(3*t)', 'p': '500 N/m',
             'i': '800 N/m/s', 'd': '20 N s/m'}  # fmt: skip
    start = {'position': {'block': '0.3 m'}}
    machine = made(BLOCK | {'servos': {'lift': servo}, 'initial': start})
    z = 3j  # m z^2 X = (p + i/z)(0.1 - X) - d z X
    lag = 0.1 * (500.0 + 800.0 / z) / (2.0 * z**2 + 500.0 + 800.0 / z + 20.0 * z)
    for end in (20.0, 20_000.0):
        run = ms.stream(machine, duration=end).finish()
        (place,) = catalogue(machine).columns(['position.block'], run.final)['position.block']
        turned = math.remainder(3.0 * end, 2.0 * math.pi)
        assert place == pytest.approx(0.4 + (lag * np.exp(1j * turned)).imag, abs=1e-9)


def test_a_pulse_of_a_thousandth_of_a_turn_beside_new_elements() -> None:
    """A wheel gains the pulse's work each turn; a stop, a rope, a servo and a state act beside."""
    width, torque, inertia, speed = 0.001 * 2.0 * math.pi, 50.0, 2.0, 10.0
    begin = math.radians(200.0)
    scene = {
        'gravity': [0.0, -GRAVITY],
        'links': {
            'ground': {'points': {'p': [3.0, 9.0], 'q': [3.2, 9.0], 'g': [3.0, 0.0],
                                  'h': [3.2, 0.0], 's': [2.0, 0.0], 'w': [1.0, 0.0]}},
            'wheel': {'mass': 1.0, 'inertia': inertia}, 'block': {'mass': 2.0},
            'a': {'mass': 1.0}, 'b': {'mass': 1.2}, 'held': {'mass': 1.0},
        },
        'joints': {
            'w': {'revolute': ['ground.w', 'wheel']},
            's': {'prismatic': ['ground.s', 'block'], 'axis': '90 deg',
                  'stops': {'lower': '0 m', 'restitution': 0.6}},
            'ga': {'prismatic': ['ground.g', 'a'], 'axis': '90 deg'},
            'gb': {'prismatic': ['ground.h', 'b'], 'axis': '90 deg'},
            'rope': {'rope': ['a', 'ground.p', 'ground.q', 'b'], 'restitution': 0.3},
            'c': {'prismatic': ['ground', 'held']},
        },
        'states': {'pushed': {'start': '0 J', 'rate': 'wheel_rate*push(wheel)'}},
        'tables': {'push': {'cyclic': True, 'points': [
            ['0 rad', 0], [f'{begin!r} rad', 0], [f'{begin!r} rad', torque],
            [f'{begin + width!r} rad', torque], [f'{begin + width!r} rad', 0],
            ['360 deg', 0]]}},
        'servos': {'own': {'coordinate': 'held', 'target': '0.1*sin(5*t)', 'p': '200 N/m',
                           'd': '10 N s/m'}},
        'loads': {'push': {'at': 'wheel', 'torque': torque, 'during': {
            'coordinate': 'wheel', 'from': f'{begin!r} rad', 'to': f'{begin + width!r} rad'}}},
        'initial': {'position': {'block': '0.5 m'},
                    'velocity': {'wheel': f'{speed} rad/s', 'b': '1 m/s'}},
    }  # fmt: skip
    solution = ms.simulate(made(scene), duration=3.0)
    turn, rate, pushed = at_end(solution, 'position.wheel', 'velocity.wheel', 'state.pushed')
    pulses = math.floor((turn - begin) / (2.0 * math.pi)) + 1
    assert pulses >= 4
    assert 0.5 * inertia * (rate**2 - speed**2) == pytest.approx(
        pulses * torque * width, rel=1e-10
    )
    assert pushed == pytest.approx(pulses * torque * width, rel=1e-10)
    assert {hit.joint for hit in solution.impacts} == {'s_lower', 'rope'}
    balanced(solution)


def test_a_snapshot_holds_states() -> None:
    """A run that pauses goes on bit by bit, states included."""
    machine = made(CYLINDER)
    whole = ms.simulate(machine, duration=0.6)
    engine = machine.start()
    engine.advance(0.3)
    motion, impacts, _ = engine.drain()
    kept = machine.snapshot(engine)
    resumed = machine.resume(kept)
    resumed.advance(0.6, final=True)
    later, more, _ = resumed.drain()
    digest = MotionDigest()
    digest.add(motion, impacts)
    digest.add(later, more)
    assert digest.hexdigest() == whole.digest()


@pytest.mark.slow
@pytest.mark.network
@pytest.mark.usefixtures('network')
@pytest.mark.parametrize('scene', ['hydraulic', pytest.param('servo', marks=pytest.mark.slow)])
def test_nodes_publish_the_same_motion(scene: str, tmp_path: Path) -> None:
    """Nodes and recorder: the digest of the bag, and the states that are read back from it."""
    content = yaml.safe_load(CYLINDER) if scene == 'hydraulic' else SERVO
    file, bag = tmp_path / f'{scene}.yaml', tmp_path / 'run.mcap'
    file.write_text(yaml.safe_dump({'title': scene, 'mechanism': 'linkage', **content}))
    done = run('run', str(file), '--duration', '0.5', '--record', str(bag))
    assert done.returncode == 0, done.stderr
    assert analyze(bag).digest == digest_of(str(file), (), 0.5)
    again, solution = ms.open_run(bag), ms.simulate(ms.load_scene(file), duration=0.5)
    t = np.linspace(0.0, 0.5, 11)
    columns = again.columns(['state'], t)
    assert columns
    for name, values in columns.items():
        assert (values == solution.sample(t, name)[name]).all()


MISTAKES = [
    ({'states': {'p': {'start': '20 bar', 'rate': '(supply - p)/2'}}}, "names 'supply'"),
    ({'states': {'p': {'start': '20 bar', 'rate': '3 N'}}}, 'not in Pa/s'),
    ({'states': {'block': {'rate': '1'}}}, "the name 'block' cannot be used"),
    ({'states': {'p': {'start': '20 bear', 'rate': '1'}}}, "'20 bear'"),
    ({'states': {'p': {'start': '20 bar', 'rate': '1', 'scale': '3 A'}}}, 'scale is in A'),
    ({'springs': {'s': {'coordinate': 'block', 'damping': 'oil'}}}, "no table 'oil'"),
    ({'springs': {'s': {'stiffness': '3 N/m'}}}, "'between' with two points, 'coordinate'"),
    ({'springs': {'s': {'coordinate': 'blok', 'stiffness': '3 N/m'}}}, "no coordinate 'blok'"),
    ({'springs': {'s': {'coordinate': 'block', 'force': '2*lenght'}}}, "names 'lenght'"),
    ({'springs': {'s': {'coordinate': 'block', 'stiffness': '3 N/m', 'acts': 'over'}}}, 'acts'),
    ({'springs': {'s': {'coordinate': 'block', 'stiffness': '3 N m/rad'}}}, 'both per length'),
    ({'servos': {'s': {'coordinate': 'block', 'target': '1 m', 'p': 3}}}, 'p needs its unit'),
    ({'servos': {'s': {'coordinate': 'block', 'target': '1 m', 'p': '3 N/m', 'limit': '2 N m'}}},
     'limit is in N m, but p in N/m'),
    ({'servos': {'s': {'coordinate': 'block', 'target': '1 m', 'p': '-3 N/m'}}},
     'p must be above 0'),
    ({'bushings': {'b': {'between': ['block', 'block'], 'stiffness': {'x': 1}}}},
     'one link twice'),
    ({'bushings': {'b': {'between': ['ground', 'block'], 'stiffness': {'z': 1}}}},
     "'bushings.b.stiffness.z'"),
]  # fmt: skip


@pytest.mark.parametrize('rate', ['z*z', 'sqrt(0.5 - z)', '1/(t - 1)'])
def test_states_that_end(rate: str) -> None:
    """A run ends with a sentence where a state goes to infinity, or its rate has no value."""
    with pytest.raises(RunError, match='the state z of first order ends at t = '):
        ms.simulate(made(BLOCK | {'states': {'z': {'start': 1.0, 'rate': rate}}}), duration=2.0)


@pytest.mark.parametrize(('part', 'said'), MISTAKES)
def test_mistakes(part: dict[str, Any], said: str) -> None:
    """Each is answered by one sentence that names key, value and what is allowed."""
    with pytest.raises(InputError) as caught:
        made(BLOCK | part)
    assert said in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    'more', [{}, {'i': '5 N m/rad/s', 'd': '0.4 N m s/rad', 'limit': '2 N m'}]
)
def test_a_target_of_a_servo_with_units_is_that_in_si(more):
    """Then its gains have theirs, too."""
    ends = []
    for target, rate in (('1 + t', '1'), ('1 rad + 60 deg/s*t*3/pi', '1 rad/s')):
        servo = {'between': ['ground', 'a'], 'target': target, 'target_rate': rate} | more
        content = {
            'mechanism': 'linkage',
            'links': {'a': {'mass': 2.0, 'inertia': 0.1}},
            'joints': {'b': {'revolute': ['ground', 'a']}},
            'servos': {'s': servo | {'p': '8 N m/rad'}},
        }
        ends.append(ms.simulate(content, duration=0.5).sample([0.5], 'position.a')['position.a'])
    assert ends[0] == pytest.approx(ends[1], rel=1e-14)
    assert abs(ends[0]) > 0.1
