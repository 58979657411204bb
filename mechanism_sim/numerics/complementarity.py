"""Linear complementarity for the few contacts of one instant."""

from __future__ import annotations

from itertools import combinations

import numpy as np


def solve_lcp(A: list[list[float]], b: list[float]) -> list[float]:
    """Find ``x >= 0`` with ``A x + b >= 0`` and ``x . (A x + b) = 0``.

    Parameters
    ----------
    A : (m, m), symmetric positive semidefinite
    b : (m,)

    Returns
    -------
    (m,) a solution with the fewest positive components

    Raises
    ------
    ArithmeticError
        If there is none to rounding.
    """
    m = len(b)
    if m == 1:
        return [max(0.0, -b[0] / A[0][0])]
    matrix, vector = np.array(A), np.array(b)
    scale = max(float(np.abs(vector).max()), 1e-300)
    for size in range(m + 1):
        for active in combinations(range(m), size):
            x = np.zeros(m)
            if active:
                rows = list(active)
                try:
                    x[rows] = np.linalg.solve(matrix[np.ix_(rows, rows)], -vector[rows])
                except np.linalg.LinAlgError:
                    continue
            if (x >= 0.0).all() and (matrix @ x + vector >= -1e-12 * scale).all():
                return list(map(float, x))
    raise ArithmeticError('no impulses satisfy all contacts of this instant')
