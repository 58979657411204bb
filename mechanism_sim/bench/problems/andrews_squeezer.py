"""Andrews' squeezer mechanism of the Test Set for IVP Solvers: seven links, three closed loops."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import cos, hypot, pi, sin

import numpy as np
from scipy.integrate import solve_ivp

from mechanism_sim.bench.four_bar import reference
from mechanism_sim.bench.problem import OURS, Answer, Method, Outcome, Problem, Run
from mechanism_sim.hybrid.event_loop import EventLoop
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
    loop, state = machine.start(), machine.initial_state()
    if not isinstance(loop, EventLoop):
        raise TypeError('a torque needs equations of motion')
    order = [machine.mechanism.coordinates.index(link) for link in LINKS]

    def run() -> Callable[[], Outcome]:
        loop.restart(state)
        loop.advance(DURATION, final=True)

        def outcome() -> Outcome:
            motion, *_ = loop.drain()
            end = motion.curve(np.array([DURATION]))[0]
            return Outcome(relative_angles(end[order]), loop.steps)

        return outcome

    return run


def rates(p: Mapping[str, float], y: Answer) -> Answer:
    """Rates of the seven angles and their rates (14,): the test set's equations in index 1.

    Accelerations and multipliers solve ``M a + G^T l = f, G a = -(dG/dt) v`` together; nothing but
    the accuracy of the method keeps the loops closed.
    """
    be, th, ga, ph, de, om, ep, bep, thp, gap, php, dep, omp, epp = y.tolist()
    far4, far6 = p['e'] - p['ea'], p['zf'] - p['fa']
    m2, m4, m6 = p['m2'], p['m4'], p['m6']
    da, rr, d, ss, e, zt, zf, u = (p[k] for k in ('da', 'rr', 'd', 'ss', 'e', 'zt', 'zf', 'u'))
    A, b = np.zeros((13, 13)), np.zeros(13)
    A[0, 0] = p['m1'] * p['ra'] ** 2 + m2 * (rr**2 - 2 * da * rr * cos(th) + da**2)
    A[0, 0] += p['i1'] + p['i2']
    A[0, 1] = A[1, 0] = m2 * (da**2 - da * rr * cos(th)) + p['i2']
    A[1, 1] = m2 * da**2 + p['i2']
    A[2, 2] = p['m3'] * (p['sa'] ** 2 + p['sb'] ** 2) + p['i3']
    A[3, 3] = m4 * far4**2 + p['i4']
    A[3, 4] = A[4, 3] = m4 * (far4**2 + zt * far4 * sin(ph)) + p['i4']
    A[4, 4] = m4 * (zt**2 + 2 * zt * far4 * sin(ph) + far4**2)
    A[4, 4] += p['m5'] * (p['ta'] ** 2 + p['tb'] ** 2) + p['i4'] + p['i5']
    A[5, 5] = m6 * far6**2 + p['i6']
    A[5, 6] = A[6, 5] = m6 * (far6**2 - u * far6 * sin(om)) + p['i6']
    A[6, 6] = m6 * (far6**2 - 2 * u * far6 * sin(om) + u**2)
    A[6, 6] += p['m7'] * (p['ua'] ** 2 + p['ub'] ** 2) + p['i6'] + p['i7']
    sc, sd = p['sc'], p['sd']
    x = p['xb'] + sd * cos(ga) + sc * sin(ga) - p['xc']
    z = p['yb'] + sd * sin(ga) - sc * cos(ga) - p['yc']
    pull = -p['c0'] * (1.0 - p['l0'] / hypot(x, z))
    b[0] = p['mom'] - m2 * da * rr * thp * (thp + 2 * bep) * sin(th)
    b[1] = m2 * da * rr * bep**2 * sin(th)
    b[2] = pull * (x * (sc * cos(ga) - sd * sin(ga)) + z * (sd * cos(ga) + sc * sin(ga)))
    b[3] = m4 * zt * far4 * dep**2 * cos(ph)
    b[4] = -m4 * zt * far4 * php * (php + 2 * dep) * cos(ph)
    b[5] = -m6 * u * far6 * epp**2 * cos(om)
    b[6] = m6 * u * far6 * omp * (omp + 2 * epp) * cos(om)
    s12, c12, w12 = sin(be + th), cos(be + th), bep + thp
    s45, c45, w45 = sin(ph + de), cos(ph + de), php + dep
    s67, c67, w67 = sin(om + ep), cos(om + ep), omp + epp
    sin_be, cos_be, sin_ga, cos_ga = sin(be), cos(be), sin(ga), cos(ga)
    sin_de, cos_de, sin_ep, cos_ep = sin(de), cos(de), sin(ep), cos(ep)
    G = A[7:, :7]
    G[0::2, 0], G[1::2, 0] = -rr * sin_be + d * s12, rr * cos_be - d * c12
    G[0::2, 1], G[1::2, 1] = d * s12, -d * c12
    G[0, 2], G[1, 2] = -ss * cos_ga, -ss * sin_ga
    G[2, 3], G[3, 3] = -e * c45, -e * s45
    G[2, 4], G[3, 4] = -e * c45 + zt * sin_de, -e * s45 - zt * cos_de
    G[4, 5], G[5, 5] = zf * s67, -zf * c67
    G[4, 6], G[5, 6] = zf * s67 - u * cos_ep, -zf * c67 - u * sin_ep
    A[:7, 7:] = G.T
    b[7::2] = rr * cos_be * bep**2 - d * c12 * w12**2
    b[8::2] = rr * sin_be * bep**2 - d * s12 * w12**2
    b[7] -= ss * sin_ga * gap**2
    b[8] += ss * cos_ga * gap**2
    b[9] -= e * s45 * w45**2 + zt * cos_de * dep**2
    b[10] += e * c45 * w45**2 - zt * sin_de * dep**2
    b[11] -= zf * c67 * w67**2 + u * sin_ep * epp**2
    b[12] -= zf * s67 * w67**2 - u * cos_ep * epp**2
    return np.concatenate((y[7:], np.linalg.solve(A, b)[:7]))


def scipy(method: str) -> Callable[[float], Run]:
    """`solve_ivp` on the test set's coordinates."""

    def prepare(rtol: float) -> Run:
        given = reference('andrews_squeezer')
        p = {name: float(digits) for name, digits in given['parameters'].items()}
        start = np.array([*map(float, given['start']), *[0.0] * 7])

        def run() -> Callable[[], Outcome]:
            found = solve_ivp(
                lambda _, y: rates(p, y),
                (0.0, DURATION),
                start,
                method,
                rtol=rtol,
                atol=0.1 * rtol,
            )
            return lambda: Outcome(found.y[:7, -1], len(found.t) - 1)

        return run

    return prepare


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
        *(
            Method(
                f'SciPy {method}',
                (1e-6, 1e-8, 1e-10, 1e-12),
                'rtol',
                scipy(method),
                "`solve_ivp` on the test set's seven angles in index 1, written by hand; "
                '`numpy.linalg.solve` on 13 equations a call.',
            )
            for method in ('Radau', 'DOP853', 'LSODA')
        ),
    ),
)
