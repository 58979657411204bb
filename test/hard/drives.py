"""Cranks that torques move: motors, flywheels, free cranks."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from mechanism_sim.arrays import Array
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import load_scene
from test.hard.bodies import SPEED, TURN, residual, thesis
from test.hard.case import Figure, hard_case

FLYWHEEL = {'speed': SPEED, 'torque': {'constant': 0.1}, 'flywheel': 0.01}


def _one_freedom(torque: float, flywheel: float, until: float) -> Array:
    """Angle and speed of the crank of the ideal thesis mechanism, by its reduced inertia.

    Eksergian: ``J w' + J'(th) w^2/2 + V'(th) = T`` with the kinetic energy ``J w^2/2``; J from
    the closed form of the linkage, its derivative and that of the potential by differences of
    sixth order.
    """
    machine = load_scene('four_bar_nominal')
    masses, inertias = (0.6095, 0.2439, 0.2334), (2645e-6 + flywheel, 2950e-6, 3176e-6)
    cogs = (0.009, 0.185, 0.134)

    def energies(th2: float) -> tuple[float, float]:
        q, w, _ = machine.nominal.linkage.motion(np.array(th2), np.array(1.0), np.array(0.0))
        u = np.exp(1j * q)
        pins = (0.0, 0.064 * u[0], 0.387)
        speeds = (0.0, 1j * 0.064 * u[0], 0.0)
        inertia = height = 0.0
        for i in range(3):
            velocity = speeds[i] + 1j * cogs[i] * u[i] * w[i]
            inertia += masses[i] * abs(velocity) ** 2 + inertias[i] * w[i] ** 2
            height += masses[i] * (pins[i] + cogs[i] * u[i]).imag
        return float(inertia), 9.8145 * float(height)

    def slope(th2: float) -> Array:
        h = 2e-3
        weights = ((3, 1.0), (2, -9.0), (1, 45.0))
        total = np.zeros(2)
        for k, c in weights:
            ahead, behind = energies(th2 + k * h), energies(th2 - k * h)
            total += c * (np.array(ahead) - np.array(behind))
        return total / (60.0 * h)

    def rate(_: float, y: Array) -> list[float]:
        inertia, _height = energies(y[0])
        dJ, dV = slope(y[0])
        return [y[1], (torque - dV - 0.5 * dJ * y[1] ** 2) / inertia]

    found = solve_ivp(rate, (0.0, until), [0.0, SPEED], 'DOP853', rtol=1e-11, atol=1e-11)
    return np.asarray(found.y[:, -1])


@hard_case(
    'A flywheel of 0.01 kg m^2 and a torque of 0.1 N m on the ideal mechanism, at a tolerance of '
    '1e-10: nothing holds the speed, so errors add up.',
    'The energy balance; and one equation for one freedom, by the reduced inertia, integrated by '
    'DOP853.',
)
def flywheel_and_torque() -> list[Figure]:
    """Energy residual over ten revolutions, and the crank after one of them."""
    machine = load_scene('four_bar_nominal', {'drive': FLYWHEEL, 'solver.rtol': 1e-10})
    solution = simulate(machine, duration=1.6)
    turned = float(solution.sample(1.6, 'position.crank')['position.crank'][0]) / (2.0 * math.pi)
    angle, speed = _one_freedom(0.1, 0.01, 0.2)
    at = solution.sample(0.2, 'position.crank', 'velocity.crank')
    return [
        Figure('energy residual', residual(solution.energy), 1e-9, 'J'),
        Figure('revolutions', turned),
        Figure('closure error', solution.max_closure_error, 1e-12, 'm'),
        Figure('angle after 0.2 s', float(at['position.crank'][0]) - angle, 1e-8, 'rad'),
        Figure('speed after 0.2 s', float(at['velocity.crank'][0]) - speed, 1e-7, 'rad/s'),
    ]


@hard_case(
    'The same with the loose bearing: impacts react on the crank.',
    'The energy balance: no impulse of a drive enters it, and losses are those of the impacts.',
)
def flywheel_and_clearance() -> list[Figure]:
    """Energy residual over ten revolutions at 1e-10, and that of a free crank."""
    solution = simulate(thesis(drive=FLYWHEEL, solver__rtol=1e-10), duration=1.6)
    free = simulate(thesis(drive={'speed': SPEED, 'torque': {}}), duration=1.0)
    others = free.energy
    jump = 0.0
    for i in free.impacts:
        if i.t < 1.0 - 1e-9:
            before, after = free.sample(np.array([i.t - 1e-9, i.t]), 'velocity.crank')[
                'velocity.crank'
            ]
            jump = max(jump, abs(after - before))
    return [
        Figure('energy residual', residual(solution.energy), 1e-9, 'J'),
        Figure('residual of the free crank', residual(others), 1e-11, 'J'),
        Figure('work of the free drive', others.drive_work if others else math.nan, 0.0, 'J'),
        Figure('impulses of drives', sum(abs(i.drive_impulse) for i in free.impacts), 0.0),
        Figure('largest jump of the crank speed', jump, unit='rad/s'),
    ]


@hard_case(
    'A motor line so steep that it all but prescribes the speed: a stiff term in the equations.',
    'The crank at constant speed is its limit: the difference falls as the slope grows, to the '
    'power of -1.',
)
def stiff_motor() -> list[Figure]:
    """Order of the difference from constant speed, and the energy balance, loose too."""
    fixed = simulate(load_scene('four_bar_nominal'), revolutions=0.9)
    t = np.linspace(0.1, 0.9, 200) * TURN
    reference = fixed.sample(t, 'velocity.rocker')['velocity.rocker']
    stalls, differences, largest = (1e3, 1e4, 1e5), [], 0.0
    for stall in stalls:
        drive = {
            'speed': SPEED,
            'motor': {'stall_torque': stall, 'no_load_speed': SPEED},
        }
        solution = simulate(load_scene('four_bar_nominal', {'drive': drive}), duration=0.9 * TURN)
        found = solution.sample(t, 'velocity.rocker')['velocity.rocker']
        differences.append(float(np.abs(found - reference).max()))
        loose = simulate(thesis(drive=drive), duration=2.0 * TURN)
        largest = max(largest, *(abs(residual(x.energy)) for x in (solution, loose)))
    order = float(np.polyfit(np.log(stalls), np.log(differences), 1)[0])
    return [
        Figure('order of the difference, plus 1', order + 1.0, 0.05),
        Figure('energy residual', largest, 1e-9, 'J'),
    ]
