"""A block on a spring that strikes a wall once a turn: its responses in closed form.

S. W. Shaw and P. J. Holmes, A periodically forced piecewise linear oscillator, J. Sound Vib. 90
(1983) 129. Between impacts the motion is ``x(t) = Re X exp(i(w t + p)) + h(t)``, h free and
damped. That h(0) and h(T) fit one impact at the wall with speed u makes X and u a quadratic
equation; an impact takes changes of the state by its saltation matrix, h' by exp(A T).
"""

from __future__ import annotations

import numpy as np
import scipy

STROKE, WALL, E, MASS, STIFFNESS, DAMPING = 0.01, -0.02, 0.8, 1.0, 100.0, 1.0

OSCILLATOR = f"""
title: A block on a spring that strikes a wall
mechanism: linkage
gravity: [0, 0]
links:
  crank: {{length: {STROKE}, mass: 1, cog: 0, inertia: 1}}
  table: {{mass: 1, points: {{middle: [0, 0]}}}}
  block: {{mass: {MASS}}}
joints:
  shaft: {{revolute: [ground, crank]}}
  guide: {{prismatic: [ground, table], axis: 90 deg}}
  yoke: {{slot: [crank.end, table], axis: 0 deg}}
  wall: {{prismatic: [ground, block], axis: 90 deg, stops: {{lower: {WALL}, restitution: {E}}}}}
springs:
  spring: {{
    between: [table, block], stiffness: {STIFFNESS} N/m, damping: {DAMPING} N s/m, free_length: 0}}
drive: {{coordinate: crank, speed: 12}}
initial: {{position: {{block: 0.03}}}}
"""


def forced(w: float) -> complex:
    """The phasor [m] of the motion without impacts."""
    k = STIFFNESS + 1j * w * DAMPING
    return STROKE * k / (STIFFNESS - MASS * w**2 + 1j * w * DAMPING)


def strikes(w: float) -> list[tuple[float, np.ndarray]]:
    """Speeds of the impact [m/s] at a speed of the crank, and the multipliers of each response."""
    T, X = 2.0 * np.pi / w, abs(forced(w))
    A = np.array([[0.0, 1.0], [-STIFFNESS / MASS, -DAMPING / MASS]])
    P = scipy.linalg.expm(A * T)
    # P (a, E u - b) = (a, -u - b) with x'- = -u: of a = WALL - xp and b = xp', for u = 1
    M = np.array([[P[0, 0] - 1.0, -P[0, 1]], [P[1, 0], 1.0 - P[1, 1]]])
    a, b = np.linalg.solve(M, [-E * P[0, 1], -1.0 - E * P[1, 1]])
    found = []
    for root in np.roots([a**2 + (b / w) ** 2, -2.0 * WALL * a, WALL**2 - X**2]):
        if abs(root.imag) < 1e-12 and root.real > 0.0:
            u, before = float(root.real), -float(root.real)
            xp, vp = WALL - a * u, b * u
            force = -(w**2) * xp - A[1, 0] * xp - A[1, 1] * vp  # of the table, over the mass
            pull = [A[1, 0] * WALL + A[1, 1] * v + force for v in (before, -E * before)]
            S = np.array([[-E, 0.0], [(pull[1] + E * pull[0]) / before, -E]])
            found.append((u, np.linalg.eigvals(P @ S)))
    return sorted(found, key=lambda x: x[0])


def discriminant(w: float) -> float:
    """Zero where two responses meet, over the square of the wall's distance."""
    T, X = 2.0 * np.pi / w, abs(forced(w))
    P = scipy.linalg.expm(np.array([[0.0, 1.0], [-STIFFNESS / MASS, -DAMPING / MASS]]) * T)
    M = np.array([[P[0, 0] - 1.0, -P[0, 1]], [P[1, 0], 1.0 - P[1, 1]]])
    a, b = np.linalg.solve(M, [-E * P[0, 1], -1.0 - E * P[1, 1]])
    return float((WALL * a) ** 2 - (a**2 + (b / w) ** 2) * (WALL**2 - X**2)) / WALL**2
