"""Linkages at and near singular positions: dead points, toggles, change points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from mechanism_sim.arrays import Array
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import build
from mechanism_sim.scene.schema import Scene
from test.hard.bodies import residual
from test.hard.case import Figure, hard_case

EPS = float(np.finfo(float).eps)
CRANK, ROD = 0.05, 0.2  # [m] of the slider-crank
ARM = 0.3  # [m] of the toggle


def linkage(**content: Any) -> Machine:
    """The machine of a scene written here."""
    scene = {'title': 'a hard case', 'mechanism': 'linkage', **content}
    return build('hard case', Scene.model_validate(scene))


def _engine(force: str, **drive: Any) -> Machine:
    """A slider-crank whose piston a force pushes; rod and piston have mass, the crank inertia."""
    return linkage(
        links={
            'ground': {},
            'crank': {'length': CRANK, 'mass': 1.0, 'inertia': 0.01},
            'rod': {'length': ROD, 'mass': 0.5, 'inertia': 0.002, 'cog': 0.07},
            'piston': {'mass': 0.8},
        },
        joints={
            'main': {'revolute': ['ground', 'crank']},
            'crank_pin': {'revolute': ['crank.end', 'rod']},
            'piston_pin': {'revolute': ['rod.end', 'piston']},
            'cylinder': {'prismatic': ['ground', 'piston']},
        },
        loads={'gas': {'at': 'piston', 'force': [force, 0]}},
        drive={'coordinate': 'crank', **drive},
        guess={'piston': CRANK + ROD},
    )


def _engine_at(angle: float, speed: float, until: float) -> tuple[float, float]:
    """Angle and speed of the crank under ``-20 x' - 200 sin(angle)`` at the piston.

    One equation for one freedom: ``J w' + J' w^2/2 = F x'(angle)`` by the reduced inertia J in
    closed form, whose derivative is a complex step.
    """

    def pieces(th: complex) -> tuple[complex, complex]:
        """Reduced inertia and dx/dth."""
        s = CRANK * np.sin(th)
        phi = -np.arcsin(s / ROD)
        turn = -CRANK * np.cos(th) / (ROD * np.cos(phi))
        dx = -s - ROD * np.sin(phi) * turn
        gx = -s - 0.07 * np.sin(phi) * turn
        gy = CRANK * np.cos(th) + 0.07 * np.cos(phi) * turn
        return 0.01 + 0.5 * (gx * gx + gy * gy) + 0.002 * turn * turn + 0.8 * dx * dx, dx

    def rate(_: float, y: Array) -> list[float]:
        J, dx = pieces(y[0] + 1e-30j)
        force = -20.0 * dx.real * y[1] - 200.0 * math.sin(y[0])
        return [y[1], (force * dx.real - 0.5 * J.imag / 1e-30 * y[1] ** 2) / J.real]

    found = solve_ivp(rate, (0.0, until), [angle, speed], 'DOP853', rtol=1e-13, atol=1e-13)
    return float(found.y[0, -1]), float(found.y[1, -1])


@hard_case(
    'A piston drives its crank through forty dead points: there it cannot move it at all, only '
    'inertia does.',
    'The energy balance; and one equation for one freedom, by the reduced inertia, integrated by '
    'DOP853.',
)
def through_dead_points() -> list[Figure]:
    """Closures, energy, and where the crank is after a second."""
    machine = _engine('-20*vx - 200*sin(crank)', torque={}, speed=30.0, start_angle=0.3)
    solution = simulate(machine, duration=1.0)
    angle, speed = _engine_at(0.3, 30.0, 1.0)
    end = solution.sample(1.0, 'position.crank', 'velocity.crank')
    return [
        Figure('dead points passed', abs(angle) // math.pi),
        Figure('angle after 1 s', float(end['position.crank'][0]) - angle, 1e-9, 'rad'),
        Figure('speed after 1 s', float(end['velocity.crank'][0]) - speed, 1e-8, 'rad/s'),
        Figure('energy residual', residual(solution.energy), 1e-11, 'J'),
        Figure('closure error', solution.max_closure_error, 1e-14, 'm'),
    ]


@hard_case(
    'A toggle of two equal arms, closed by its slider to an angle of 1e-2 to 1e-7 from the line: '
    'its rates grow beyond all bounds, and digits are lost in proportion.',
    "Closed forms: x = 2 l cos(angle), so angle' = -x'/(2 l sin(angle)). Rounding of x by half a "
    'unit explains an error of eps cot(angle)^2 of the rate: figures are in that unit.',
)
def toggle_near_its_dead_point() -> list[Figure]:
    """Errors of rate, and of the holding force, over what rounding of the stroke explains."""
    rates, forces = [], []
    for angle in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        x = 2.0 * ARM * math.cos(angle)
        machine = linkage(
            links={
                'ground': {},
                'arm': {'length': ARM, 'mass': 1.0, 'inertia': 0.01},
                'link': {'length': ARM, 'mass': 1.0, 'inertia': 0.01},
                'slider': {'mass': 1.0},
            },
            joints={
                'O': {'revolute': ['ground', 'arm']},
                'A': {'revolute': ['arm.end', 'link']},
                'B': {'revolute': ['link.end', 'slider']},
                'guide': {'prismatic': ['ground', 'slider']},
            },
            loads={'press': {'at': 'arm.end', 'force': [0, 1.0]}},
            drive={'coordinate': 'slider', 'speed': '-1e-20 m/s', 'start_position': x},
            guess={'arm': 1.5 * angle, 'link': -1.5 * angle},
        )
        q = machine.assembly.q[:, None]
        explained = EPS / math.tan(angle) ** 2
        v = machine.plan.kinematics(['slider']).rates(q, np.array([[1.0]]))
        exact = -1.0 / (2.0 * ARM * math.sin(angle))
        rates.append(abs(float(v[0, 0]) / exact - 1.0) / explained)
        zero = np.zeros_like(q)
        torque = float(machine.nominal.inverse_dynamics(q, zero, zero).drive_torque[0, 0])
        # the slider carries half of the load over the slope of the arms
        forces.append(abs(torque * 2.0 * math.tan(angle) - 1.0) / explained)
    return [
        Figure('rate over what rounding explains', max(rates), 4.0),
        Figure('force over what rounding explains', max(forces), 4.0),
    ]


@hard_case(
    'A parallelogram whose rocker is 1e-2 to 1e-7 too long: at the change points two ways to go '
    'on come as near as the root of that, and following must not jump from one to the other.',
    'The closed form of the four-bar, which knows its branch.',
)
def near_the_change_point() -> list[Figure]:
    """Two revolutions by Newton's method beside the closed form; the exact parallelogram, too."""
    largest, closure = 0.0, 0.0
    for k in range(2, 8):
        solution, lengths = _parallelogram(10.0**-k)
        t = np.linspace(0.0, 2.0, 2001)
        seen = solution.sample(t)
        coupler, rocker = FourBar(*lengths, 'open').positions(seen['position.crank'])
        for name, exact in (('coupler', coupler), ('rocker', rocker)):
            off = np.exp(1j * seen[f'position.{name}']) - np.exp(1j * exact)
            # across the change point an angle is known to the root of rounding only
            largest = max(largest, float(np.abs(off).max()) * 10.0 ** (-k / 2.0))
        closure = max(closure, solution.max_closure_error)
    seen = _parallelogram(0.0)[0].sample(np.linspace(0.0, 2.0, 2001))
    exact_off = float(np.abs(seen['position.rocker'] - seen['position.crank']).max())
    return [
        Figure('difference of directions times root of the misfit', largest, 1e-12),
        Figure('closure error', closure, 1e-14, 'm'),
        Figure('exact parallelogram: rocker less crank', exact_off, 1e-9, 'rad'),
    ]


def _parallelogram(short: float) -> tuple[Any, tuple[float, float, float, float]]:
    """Two revolutions, and ground, crank, coupler, rocker [m]."""
    lengths = 0.3, 0.1, 0.3, 0.1 * (1.0 + short)
    machine = linkage(
        links={
            'ground': {'length': lengths[0]},
            'crank': {'length': lengths[1]},
            'coupler': {'length': lengths[2]},
            'rocker': {'length': lengths[3]},
        },
        joints={
            'O': {'revolute': ['ground', 'crank']},
            'A': {'revolute': ['crank.end', 'coupler']},
            'B': {'revolute': ['coupler.end', 'rocker.end']},
            'C': {'revolute': ['rocker', 'ground.end']},
        },
        drive={'coordinate': 'crank', 'speed': '60 rpm', 'start_angle': '60 deg'},
        guess={'coupler': 0, 'rocker': '60 deg'},
    )
    return simulate(machine, duration=2.0), lengths
