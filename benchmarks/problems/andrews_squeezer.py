"""Andrews' squeezer mechanism of the Test Set for IVP Solvers: seven links, three closed loops."""

from __future__ import annotations

from math import pi

import numpy as np

from benchmarks.four_bar import reference
from benchmarks.integration import event_loop, positions, run_solve_ivp, solve_ivp_methods
from benchmarks.problem import (
    OURS,
    Answer,
    Method,
    Outcome,
    Problem,
    Run,
    missing,
    run_once,
)
from benchmarks.squeezer import Squeezer, rates
from mechanism_sim.scene import load_scene

ANGLES = ('beta', 'Theta', 'gamma', 'phi', 'delta', 'Omega', 'epsilon')
LINKS = ('K1', 'K2', 'K3', 'K4', 'K5', 'K6', 'K7')
DURATION = 0.03  #: [s]


def error(answer: Answer) -> float:
    """Largest error of the seven final angles (7,) [rad]."""
    right = reference('andrews_squeezer')
    return float(np.abs(answer - np.array([float(right[name]) for name in ANGLES])).max())


def relative_angles(q: Answer) -> Answer:
    """The test set's angles (7,) from absolute angles (7,) of the links of the scene [rad]."""
    k1, k2, k3, k4, k5, k6, k7 = q
    delta, epsilon = k5, k7 + pi / 2
    return np.array(
        [k1, k2 - k1 - pi, k3 + pi / 2, k4 + pi / 2 - delta, delta, k6 - epsilon, epsilon]
    )


def ours(rtol: float) -> Run:
    """Equations of motion with three closed loops, as `simulate` integrates them."""
    machine = load_scene('andrews_squeezer', {'solver.rtol': rtol})
    order, at_end = [machine.mechanism.coordinates.index(k) for k in LINKS], positions(DURATION)
    return event_loop(machine, DURATION, lambda *run: relative_angles(at_end(*run)[order]))


def load_problem() -> tuple[Squeezer, Answer]:
    """The mechanism, and its angles and rates at the start (14,)."""
    content = reference('andrews_squeezer')
    start = np.array([*map(float, content['start']), *[0.0] * 7])
    parameters = {name: float(content['parameters'][name]) for name in Squeezer._fields}
    return Squeezer(**parameters), start


def run_numba(rtol: float) -> Run:
    """DOP853 on the same equations, all of it compiled by numba."""
    from benchmarks.kernels.squeezer import integrate  # noqa: PLC0415

    p, start = load_problem()
    integrate(p, start, 1e-9, rtol)

    def work() -> Outcome:
        end, steps = integrate(p, start, DURATION, rtol)
        return Outcome(end[:7], steps)

    return run_once(work)


def scipy(method: str, rtol: float) -> Run:
    """`solve_ivp` on the test set's coordinates."""
    p, start = load_problem()

    def rate(t: float, y: Answer) -> Answer:
        out = np.empty(14)
        rates(t, y, p, out)
        return out

    return run_solve_ivp(rate, start, DURATION, method, rtol, 7)


PROBLEM = Problem(
    'andrews_squeezer',
    "Andrews' squeezer mechanism of the IVP test set, 30 ms",
    'run',
    1.0,
    'rad',
    'Final angles from the energy integral by quadrature in 40 digits '
    '(test/references/make_andrews_squeezer.py).',
    error,
    (
        Method(
            OURS,
            (1e-4, 1e-6, 1e-8, 1e-10, 1e-12),
            'rtol',
            ours,
            'The event loop of `simulate`: seven coordinates, three closed loops as constraints, '
            'from the scene file.',
        ),
        *solve_ivp_methods(
            scipy,
            ('Radau', 'DOP853', 'LSODA'),
            "`solve_ivp` on the test set's seven angles in index 1, written by hand; "
            '`numpy.linalg.solve` on 13 equations a call.',
        ),
        Method(
            'numba DOP853 loop',
            (1e-6, 1e-8, 1e-10, 1e-12),
            'rtol',
            run_numba,
            'The same equations and DOP853 compiled as one function; nothing is kept but the end.',
            lambda: missing('numba'),
        ),
    ),
)
