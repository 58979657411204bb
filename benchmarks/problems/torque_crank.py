"""The thesis mechanism with ideal bearings, its crank moved by a constant torque."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, sin, sqrt

from benchmarks.four_bar import LooseFourBar, reference
from benchmarks.integration import event_loop, positions, run_solve_ivp, solve_ivp_methods
from benchmarks.problem import OURS, Answer, Method, Problem, Run
from mechanism_sim.scene import load_scene

TORQUE, DURATION = 0.1, 0.5  #: [N m], [s]: about three revolutions


def error(answer: Answer) -> float:
    """Error of the final angle of the crank (1,) [rad]."""
    return float(abs(answer[0] - float(reference('torque_crank')['th2'])))


def ours(rtol: float) -> Run:
    """Equations of motion with a closed loop, as `simulate` integrates them."""
    drive = {'speed': LooseFourBar.thesis().crank_speed, 'torque': {'constant': TORQUE}}
    machine = load_scene('four_bar_nominal', {'drive': drive, 'solver.rtol': rtol})
    at_end = positions(DURATION)
    return event_loop(machine, DURATION, lambda *run: at_end(*run)[:1])


def rates(f: LooseFourBar) -> Callable[[float, Answer], tuple[float, float]]:
    """Rates of (th2, w2): the one coordinate, by virtual power."""

    def rate(_: float, y: Answer) -> tuple[float, float]:
        th2, w = y.tolist()
        s2, c2 = sin(th2), cos(th2)
        x, z = f.ground - f.crank * c2, -f.crank * s2
        d = x * x + z * z
        m = f.coupler**2 - f.rocker**2 + d
        area = sqrt(4.0 * f.coupler**2 * d - m * m)
        c3, s3 = (m * x - area * z) / (2 * f.coupler * d), (m * z + area * x) / (2 * f.coupler * d)
        c4, s4 = (f.coupler * c3 - x) / f.rocker, (f.coupler * s3 - z) / f.rocker
        S = c3 * s4 - s3 * c4
        r3 = f.crank * (s2 * c4 - c2 * s4) / (f.coupler * S)
        r4 = f.crank * (s2 * c3 - c2 * s3) / (f.rocker * S)
        # accelerations that remain without angular acceleration of the crank, over w^2
        px = f.crank * c2 + f.coupler * r3 * r3 * c3 - f.rocker * r4 * r4 * c4
        pz = f.crank * s2 + f.coupler * r3 * r3 * s3 - f.rocker * r4 * r4 * s4
        b3, b4 = (px * c4 + pz * s4) / (f.coupler * S), (px * c3 + pz * s3) / (f.rocker * S)
        a = f.coupler_cog
        vx, vz = -f.crank * s2 - a * r3 * s3, f.crank * c2 + a * r3 * c3
        bx = -f.crank * c2 - a * (b3 * s3 + r3 * r3 * c3)
        bz = -f.crank * s2 + a * (b3 * c3 - r3 * r3 * s3)
        I2 = f.crank_inertia + f.crank_mass * f.crank_cog**2
        _, I4 = f.inertias
        J = I2 + f.coupler_mass * (vx * vx + vz * vz) + f.coupler_inertia * r3 * r3 + I4 * r4 * r4
        bias = f.coupler_mass * (vx * bx + vz * bz) + f.coupler_inertia * r3 * b3 + I4 * r4 * b4
        weight = f.gravity * (
            f.crank_mass * f.crank_cog * c2
            + f.coupler_mass * vz
            + f.rocker_mass * f.rocker_cog * r4 * c4
        )
        return w, (TORQUE - weight - bias * w * w) / J

    return rate


def scipy(method: str, rtol: float) -> Run:
    """`solve_ivp` on the one coordinate."""
    f = LooseFourBar.thesis()
    return run_solve_ivp(rates(f), [f.crank_angle, f.crank_speed], DURATION, method, rtol, 1)


PROBLEM = Problem(
    'torque_crank',
    'Ideal four-bar, its crank moved by a torque of 0.1 N m, 0.5 s',
    'simulated second',
    DURATION,
    'rad',
    'Final crank angle from the energy integral by quadrature in 40 digits '
    '(test/references/make_torque_crank.py).',
    error,
    (
        Method(
            OURS,
            (1e-6, 1e-8, 1e-10, 1e-12),
            'rtol',
            ours,
            'The event loop of `simulate`: three coordinates, the closed loop as a constraint.',
        ),
        *solve_ivp_methods(
            scipy,
            ('RK45', 'DOP853', 'LSODA'),
            '`solve_ivp` on the crank angle alone, everything else eliminated by hand, plain '
            'floats.',
        ),
    ),
)
