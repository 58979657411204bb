"""The N-four-bar of the IFToMM benchmark: all of its windows collapse into a line, and open again.

N windows of uniform links (1 m, 1 kg) under gravity: N + 1 rods on the ground, N bars between
their ends. As long as all rods stay parallel one coordinate says all, see `exact_n_four_bar`. Each
time they lie in a line every window could turn inside out. (M. Gonzalez, D. Dopico, U. Lugris and
J. Cuadrado, A benchmarking system for MBS simulation software, Multibody Syst. Dyn. 16:179, 2006:
a drift of 0.1 J in 10 s is what counts as solved there.)
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from mechanism_sim.arrays import Array
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from test.hard.case import Figure, hard_case
from test.hard.singular import linkage

GRAVITY = 9.81
DURATION = 10.0  # [s]


def n_four_bar(windows: int, rtol: float = 1e-10, wheel: str = '') -> Machine:
    """The mechanism, its rods upright and turning at 1 rad/s clockwise.

    Parameters
    ----------
    wheel : speed of a wheel by itself beside it; empty for none
    """
    rod = {'length': 1.0, 'mass': 1.0, 'inertia': 1.0 / 12.0, 'cog': 0.5}
    ground = {f'pivot{i}': [float(i), 0.0] for i in range(windows + 1)}
    links = {f'rod{i}': rod for i in range(windows + 1)}
    links |= {f'bar{i}': rod for i in range(windows)}
    joints = {
        f'pivot{i}': {'revolute': [f'ground.pivot{i}', f'rod{i}']} for i in range(windows + 1)
    }
    for i in range(windows):
        joints[f'left{i}'] = {'revolute': [f'rod{i}.end', f'bar{i}']}
        joints[f'right{i}'] = {'revolute': [f'bar{i}.end', f'rod{i + 1}.end']}
    if wheel:
        links['wheel'] = rod
        joints['axle'] = {'revolute': ['ground', 'wheel']}
    return linkage(
        links={'ground': {'points': ground}, **links},
        joints=joints,
        gravity=[0.0, -GRAVITY],
        drive={'coordinate': 'rod0', 'torque': {}, 'start_angle': '90 deg', 'speed': '-1 rad/s'},
        drives={'wheel': {'speed': wheel}} if wheel else {},
        guess={f'rod{i}': '90 deg' for i in range(1, windows + 1)},
        solver={'rtol': rtol},
    )


def exact_n_four_bar(windows: int, until: float) -> tuple[float, float]:
    """Angle [rad] and rate of the rods: ``((N + 1)/3 + N) w' = -((N + 1)/2 + N) g cos(angle)``."""
    k = GRAVITY * (0.5 * (windows + 1) + windows) / ((windows + 1) / 3.0 + windows)

    def rate(_: float, y: Array) -> list[float]:
        return [y[1], -k * math.cos(y[0])]

    start = [0.5 * math.pi, -1.0]
    found = solve_ivp(rate, (0.0, until), start, 'DOP853', rtol=1e-13, atol=1e-13)
    return float(found.y[0, -1]), float(found.y[1, -1])


def _figures(windows: int) -> list[Figure]:
    solution = simulate(n_four_bar(windows), duration=DURATION)
    angle, rate = exact_n_four_bar(windows, DURATION)
    end, balance = solution.sample(DURATION), solution.energy
    apart = max(
        abs(float(end[f'position.rod{i}'][0] - end['position.rod0'][0]))
        for i in range(1, windows + 1)
    )
    label = f'N = {windows}: '
    drift = balance.residual / np.ptp([balance.initial, 0.0]) if balance else math.nan
    return [
        Figure(label + 'times in a line', abs(angle) // math.pi + 1.0),
        Figure(label + 'angle after 10 s', float(end['position.rod0'][0]) - angle, 1e-8, 'rad'),
        Figure(label + 'rate after 10 s', float(end['velocity.rod0'][0]) - rate, 1e-8, 'rad/s'),
        Figure(label + 'rods from being parallel', apart, 1e-12, 'rad'),
        Figure(label + 'energy drift of the energy', drift, 1e-10),
        Figure(label + 'closure error', solution.max_closure_error, 1e-12, 'm'),
    ]


@hard_case(
    'One, two and five windows that collapse into a line ten times in ten seconds; each time each '
    'of them could turn inside out (N-four-bar of the IFToMM benchmark, 0.1 J of drift allowed).',
    'The equation of the one freedom that is left while all rods are parallel, by DOP853.',
)
def windows_in_a_line() -> list[Figure]:
    """Positions of the rods after ten seconds, for N = 1, 2, 5."""
    return [figure for windows in (1, 2, 5) for figure in _figures(windows)]


@hard_case(
    'The same with forty windows: 81 links, 40 loops that become singular at the same instant.',
    'The equation of the one freedom that is left while all rods are parallel, by DOP853.',
)
def forty_windows_in_a_line() -> list[Figure]:
    """Positions of the rods after ten seconds, for N = 40."""
    return _figures(40)
