"""The flexible slider-crank of the IVP test set, by its own matrices: a second formulation.

B. Simeon, Math. Modelling of Systems 2 (1996) 1-18; problem `crank` of the test set (Mazzia and
Magherini, Test Set for IVP Solvers, release 2.4). Coordinates are the angles of crank and rod, the
slider's place, two sine modes across the rod, and the elongations at its middle and its end.

The test set has the longitudinal mass matrix ``m (8 1; 1 2)``, without the 1/15 that the integrals
of its quadratic functions give: `PUBLISHED` is the solution with 15 times the mass along the rod.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.problem import Answer

L1, L2, M2, M3, J1 = 0.15, 0.30, 0.151104, 0.075552, 0.002727
E, SIDE, DENSITY, SPEED = 2e11, 0.008, 7870.0, 150.0
AREA = SIDE**2
J2_PUBLISHED = 0.0045339259
"""[kg m^2] With the rotary inertia of the section, which a beam of Euler and Bernoulli lacks."""

START = np.array([
    0.0, 0.0, 0.450016933, 0.0, 0.0, 0.103339863e-4, 0.169327969e-4,
    150.0, -74.9957670, -0.268938672e-5, 0.444896105, 0.463434311e-2, -0.178591076e-5,
    -0.268938672e-5,
])  # fmt: skip
"""Places and rates (14,), as published."""
END = 0.1  # [s]
PUBLISHED = np.array([
    15.0, -3.311734987910881e-1, 1.697373326718410e-1, 1.893192460247178e-4,
    2.375751865617931e-5, -5.323907988763734e-6, -8.363283141616840e-6,
])  # fmt: skip
"""Places at the end."""


def closed_start() -> Answer:
    """The start with its last digits such that the loop is closed."""
    start = START.copy()
    start[2] = L1 + L2 + start[6]
    start[8] = -L1 * SPEED / (L2 + start[6])
    start[9] = start[13]
    return start


def rates(
    inertia: float = M2 * L2**2 / 3.0, along: float = 1.0 / 15.0
) -> Callable[[float, Answer], Answer]:
    """The rates of places and rates (14,), from the equations with their constraints.

    Parameters
    ----------
    inertia : of the undeformed rod about its start [kg m^2]
    along : factor of ``m (8 1; 1 2)``
    """
    m, k, pi = DENSITY * AREA * L2, E * AREA / L2, np.pi
    M, K, B = np.zeros((3, 4, 4))
    M[0, 0] = M[1, 1] = 0.5 * m
    M[2:, 2:] = along * m * np.array([[8.0, 1.0], [1.0, 2.0]])
    K[0, 0], K[1, 1] = k * (SIDE / L2) ** 2 * pi**4 * np.array([1.0 / 24.0, 2.0 / 3.0])
    K[2:, 2:] = k / 3.0 * np.array([[16.0, -8.0], [-8.0, 7.0]])
    B[0, 2:] = -16.0 / pi**3, 8.0 / pi**3 - 1.0 / pi
    B[1, 3] = 0.5 / pi
    B = m * (B - B.T)
    along_1, across_1 = m * np.array([0.0, 0.0, 2.0 / 3.0, 1.0 / 6.0]), m * 2.0 / pi * np.eye(4)[0]
    along_x = m * L2 * np.array([0.0, 0.0, 1.0 / 3.0, 1.0 / 6.0])
    across_x = m * L2 / pi * np.array([1.0, -0.5, 0.0, 0.0])

    def rate(_: float, y: Answer) -> Answer:
        (a, b), q, (w, u), dq = y[:2], y[3:7], y[7:9], y[10:]
        s1, s2, c1, c2 = np.sin(a), np.sin(b), np.cos(a), np.cos(b)
        s, c, end = np.sin(a - b), np.cos(a - b), L2 + q[3]
        A = np.zeros((10, 10))
        A[0, 0] = J1 + M2 * L1**2
        A[0, 1] = 0.5 * L1 * L2 * M2 * c + L1 * (s * (across_1 @ q) + c * (along_1 @ q))
        A[1, 1] = inertia + q @ M @ q + 2.0 * along_x @ q
        A[2, 2] = M3
        A[0, 3:7] = L1 * (c * across_1 - s * along_1)
        A[1, 3:7] = across_x + q @ B
        A[3:7, 3:7] = M
        A[[0, 1, 6], 7] = L1 * c1, end * c2, s2
        A[[0, 1, 2, 6], 8] = L1 * s1, end * s2, 1.0, -c2
        A[0, 9] = 1.0
        A = np.triu(A) + np.triu(A, 1).T
        F = np.zeros(10)
        F[0] = -0.5 * L1 * L2 * M2 * u**2 * s
        F[0] += L1 * u**2 * (c * (across_1 @ q) - s * (along_1 @ q))
        F[0] -= 2.0 * L1 * u * (c * (along_1 @ dq) + s * (across_1 @ dq))
        F[1] = 0.5 * L1 * L2 * M2 * w**2 * s
        F[1] += L1 * w**2 * (s * (along_1 @ q) - c * (across_1 @ q))
        F[1] -= 2.0 * u * (along_x @ dq + dq @ M @ q)
        F[3:7] = u**2 * (M @ q + along_x) + L1 * w**2 * (c * along_1 + s * across_1)
        F[3:7] += 2.0 * u * (B @ dq) - K @ q
        F[7] = -(2.0 * u * c2 * dq[3] - L1 * s1 * w**2 - end * s2 * u**2)
        F[8] = -(2.0 * u * s2 * dq[3] + L1 * c1 * w**2 + end * c2 * u**2)
        return np.concatenate([y[7:], np.linalg.solve(A, F)[:7]])

    return rate
