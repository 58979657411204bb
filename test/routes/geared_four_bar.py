"""A pinion, backlash, and the loose four-bar it drives, by SciPy: the second route.

Lagrange's equations of crank, coupler and rocker written out; DOP853 from event to event, found
on Chebyshev interpolants of steps; impacts by trying which contacts take impulses.
"""

import math
from itertools import chain, combinations

import numpy as np
from event_solution import LOWEST_BOUNCE, falls
from scipy.integrate import DOP853

L1, L2, L3, L4 = 0.387, 0.064, 0.309, 0.312
MASS, COG = (0.6095, 0.2439, 0.2334), (0.009, 0.185, 0.134)
INERTIA = (2645e-6, 2950e-6, 3176e-6)
GRAVITY = 9.8145
BASE = 1e-3 * math.cos(math.radians(20.0))  # [m] radius of a base circle by tooth
TEETH = 20, 40
PINION = -73.3038  # [rad/s]
CLEARANCE, PLAY = 0.254e-3, 0.5 * 0.1e-3 * math.cos(math.radians(20.0))
NAMES = 'mesh_left', 'mesh_right', 'coupler_rocker'
RESTITUTION = 0.5


def dynamics(q, v):
    """Mass matrix (3, 3), and what is left of the equations (3,) without contacts."""
    a, b = COG[0], COG[1]
    m = MASS[1] * L2 * b
    c, s = math.cos(q[0] - q[1]), math.sin(q[0] - q[1])
    M = np.diag([
        INERTIA[0] + MASS[0] * a**2 + MASS[1] * L2**2,
        INERTIA[1] + MASS[1] * b**2,
        INERTIA[2] + MASS[2] * COG[2] ** 2,
    ])  # fmt: skip
    M[0, 1] = M[1, 0] = m * c
    levers = np.array([MASS[0] * a + MASS[1] * L2, MASS[1] * b, MASS[2] * COG[2]])
    Q = -GRAVITY * levers * np.cos(q)
    Q[0] -= m * s * v[1] ** 2
    Q[1] += m * s * v[0] ** 2
    return M, Q


def gaps(t, q, v):
    """Gaps (3,), their rates, their rows (3, 3) on the coordinates, and J' v (3,)."""
    h = BASE * (TEETH[0] * PINION * t + TEETH[1] * q[0])
    dh = BASE * (TEETH[0] * PINION + TEETH[1] * v[0])
    arms = np.array([L2, L3, -L4])
    u, w = np.array([np.cos(q), np.sin(q)]), np.array([-np.sin(q), np.cos(q)])
    Q, V = u @ arms - (L1, 0.0), w @ (arms * v)
    r = math.hypot(*Q)
    n = Q / r
    across = V - (n @ V) * n
    J = np.zeros((3, 3))
    J[0, 0], J[1, 0] = -BASE * TEETH[1], BASE * TEETH[1]
    J[2] = -(n @ w) * arms
    bend = np.array([0.0, 0.0, (n @ u) @ (arms * v**2) - across @ across / r])
    return np.array([PLAY - h, PLAY + h, CLEARANCE - r]), np.array([-dh, dh, -n @ V]), J, bend


def motion(t, y, closed):
    """Accelerations (3,), and the forces (3,) of the closed gaps."""
    q, v = y[:3], y[3:]
    M, Q = dynamics(q, v)
    a, N = np.linalg.solve(M, Q), np.zeros(3)
    if closed:
        _, _, J, bend = gaps(t, q, v)
        G = J[list(closed)]
        W = np.linalg.solve(M, G.T)
        force = np.linalg.solve(G @ W, -(G @ a + bend[list(closed)]))
        N[list(closed)] = force
        a = a + W @ force
    return a, N


def strike(t, y, closed, hit):
    """Rates after an impact, the impulses, and which of the gaps in touch take some."""
    q, v = y[:3], y[3:]
    M, _ = dynamics(q, v)
    _, rate, J, _ = gaps(t, q, v)
    touching = [*closed, hit]
    wanted = {i: -RESTITUTION * rate[i] if i == hit else 0.0 for i in touching}
    subsets = chain.from_iterable(combinations(touching, k) for k in range(len(touching), 0, -1))
    for pushed in subsets:
        G = J[list(pushed)]
        W = np.linalg.solve(M, G.T)
        impulse = np.linalg.solve(G @ W, np.array([wanted[i] - rate[i] for i in pushed]))
        after = rate + J @ W @ impulse
        if (impulse >= 0.0).all() and all(after[i] >= wanted[i] - 1e-15 for i in touching):
            return v + W @ impulse, dict(zip(pushed, impulse.tolist(), strict=True))
    raise RuntimeError('no impulses fit')


def solve(q, v, closed, duration, rtol=1e-12):
    """Impacts (time, gap, approach [m/s], impulse) and the state at the end."""
    t, y, closed, impacts = 0.0, np.concatenate([q, v]), tuple(closed), []
    longest = 0.002
    while t < duration:
        solver = DOP853(
            lambda t, y, c=closed: np.concatenate([y[3:], motion(t, y, c)[0]]), t, y, duration,
            rtol=rtol, atol=1e-16, max_step=longest,
        )  # fmt: skip
        while solver.status == 'running':
            solver.step()
            dense, begin, end = solver.dense_output(), solver.t_old, solver.t
            found = []
            for i in range(3):

                def guard(times, i=i, dense=dense, closed=closed):
                    states = [(s, dense(s)) for s in np.atleast_1d(times)]
                    if i in closed:
                        return np.array([motion(s, z, closed)[1][i] for s, z in states])
                    return np.array([gaps(s, z[:3], z[3:])[0][i] for s, z in states])

                later = begin + 1e-13 if begin == t else begin
                found += [(s, i) for s, _ in falls(guard, later, end)]
            t, y = end, solver.y
            if found:
                t, i = min(found)
                y = dense(t)
                break
        else:
            continue
        if i in closed:
            closed = tuple(k for k in closed if k != i)
            continue
        approach = -gaps(t, y[:3], y[3:])[1][i]
        y[3:], impulses = strike(t, y, closed, i)
        impacts += [(t, NAMES[k], approach if k == i else 0.0, p) for k, p in impulses.items()]
        closed = tuple(k for k in closed if k in impulses)
        _, rate, J, bend = gaps(t, y[:3], y[3:])
        pull = -(J @ motion(t, y, closed)[0] + bend)[i]
        if pull > 0.0 and 0.5 * rate[i] ** 2 / pull < LOWEST_BOUNCE:
            M, _ = dynamics(y[:3], y[3:])
            G = J[[*closed, i]]
            W = np.linalg.solve(M, G.T)
            y[3:] -= W @ np.linalg.solve(G @ W, rate[[*closed, i]])
            closed = (*closed, i)
    return impacts, y
