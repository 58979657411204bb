"""Derivatives of the impulses of an impact, by the impact's own equations.

One contact: the path of impulses of `contact.impact.impulses_of_one` on complex numbers, whose
imaginary parts are derivatives to the last digit (W. Squire, G. Trapp, SIAM Rev. 40, 1998).
Several contacts: which of them stick, slide or part is known, and what is left is linear.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.contact.impact import NEWTON, POISSON
from mechanism_sim.numerics.complementarity import (
    BACKWARD,
    FORWARD,
    OPEN,
    STICK,
    FrictionalProblem,
    solve_contacts,
)

_TINY = 1e-60


def _path(theta: Sequence[complex], hypothesis: int) -> tuple[complex, complex]:
    """Impulses of one contact: `theta` are nn, nt, tt of its compliance, rates, e, mu."""
    nn, nt, tt, vn, vt, e, mu = theta
    rebound = -e * vn
    if mu.real == 0.0 and not mu.imag:
        return -(1.0 + e) * vn / nn, 0j
    rough = mu.real == math.inf
    sticks = nt == 0.0 or rough or abs(nt.real) <= mu.real * tt.real
    slip = float(np.sign(vt.real)) or float(sticks)  # none at all ends at once, like a small one
    p, q = (0.0, -slip) if rough else (1.0, -mu * slip)
    rise, slowing = nn * p + nt * q, -slip * (nt * p + tt * q)
    # impulses until the slip has ended, if it does
    ends = slowing.real > 0.0
    length = slip * vt / slowing if slip and ends else 0.0 if not slip else math.inf
    turn = vn + rise * length if ends or not slip else math.inf
    if rise.real > 0.0 and complex(turn).real >= rebound.real:
        x = -(1.0 + e) * vn / rise
        return p * x, q * x
    on = -nt / tt if sticks else -mu * float(np.sign(nt.real))
    last = nn + nt * on
    first = p * length
    if hypothesis == NEWTON:
        more = (rebound - turn) / last
    elif complex(turn).real < 0.0:
        if hypothesis == POISSON:
            more = e * first - (1.0 + e) * turn / last
        else:
            square = e * e * (turn * turn - last * first * (vn + turn))
            more = (cmath.sqrt(square) - turn) / last
    elif hypothesis == POISSON:
        more = p * (rebound - turn) / rise
    else:
        square = turn * turn + last * p * (rebound * rebound - turn * turn) / rise
        more = (cmath.sqrt(square) - turn) / last
    return first + more, q * length + on * more


def of_one(theta: Array, slopes: Array, hypothesis: int) -> tuple[Array, Array]:
    """Impulses (2,) of one contact, and their derivatives (2, P).

    Parameters
    ----------
    theta : (7,) compliances nn, nt, tt, rates, coefficients of restitution and friction
    slopes : (7, P) derivatives of `theta`
    """
    columns = [[0.0] * 7, *np.eye(7).tolist()]
    found = [
        _path([complex(x, _TINY * dx) for x, dx in zip(theta.tolist(), column, strict=True)],
              hypothesis)
        for column in columns
    ]  # fmt: skip
    values = np.array(found).T
    return values[:, 0].real, values[:, 1:].imag / _TINY @ slopes


def of_several(
    A: Array,
    rate: Array,
    e: Array,
    mu: Array,
    hypothesis: NDArray[np.int64],
    slopes: tuple[Array, Array, Array, Array],
) -> tuple[Array, Array] | None:
    """Impulses (2m,) of m contacts, and their derivatives (2m, P); None if there are none.

    Parameters
    ----------
    A, rate, e, mu : see `contact.impact.simultaneous_impulses`
    slopes : their derivatives (..., P)
    """
    m, none, free = len(e), np.zeros(2 * len(e)), np.zeros(len(e), dtype=np.int64)
    dA, drate, de, dmu = slopes
    b, db = rate.copy(), drate.copy()
    newton = (hypothesis == NEWTON).all()
    if newton:
        b[:m] *= 1.0 + e
        db[:m] = (1.0 + e)[:, None] * drate[:m] + de * rate[:m, None]
    x, grips, found = solve_contacts(FrictionalProblem(A, b, mu, free, none))
    if not found:
        return None
    dx = _linear(A, x, mu, grips, (dA, db, dmu), none, 0.0 * db)
    if newton:
        return x, dx
    b = rate + A @ x
    db = drate + A @ dx + np.einsum('ijp,j->ip', dA, x)
    small = 1e-12 * (np.abs(rate) + np.abs(A).sum(axis=1) * np.abs(x).max())
    db[np.abs(b) <= small], b[np.abs(b) <= small] = 0.0, 0.0
    least, dleast = np.zeros(2 * m), np.zeros_like(db)
    for i in range(m):
        if hypothesis[i] == NEWTON:
            b[i] += e[i] * min(rate[i], 0.0)
            db[i] += de[i] * min(rate[i], 0.0) + e[i] * drate[i] * (rate[i] < 0.0)
        else:
            for k in (i, m + i):
                least[k], dleast[k] = e[i] * x[k], de[i] * x[k] + e[i] * dx[k]
    more, grips, found = solve_contacts(FrictionalProblem(A, b, mu, free, least))
    if not found:
        return None
    return x + more, dx + _linear(A, more, mu, grips, (dA, db, dmu), least, dleast)


def _linear(
    A: Array,
    x: Array,
    mu: Array,
    grips: NDArray[np.int64],
    slopes: tuple[Array, Array, Array],
    least: Array,
    dleast: Array,
) -> Array:
    """Derivatives (2m, P) of impulses whose grips stay as they are.

    ``A x + b`` vanishes in rows at rest, friction is ``mu`` times the normal impulse, and
    separating contacts keep their least impulse.
    """
    dA, db, dmu = slopes
    m = len(mu)
    M, right = np.eye(2 * m), dleast.copy()
    moved = db + np.einsum('ijp,j->ip', dA, x)
    for i in range(m):
        if grips[i] == OPEN:
            continue
        if x[i] > least[i]:
            M[i], right[i] = A[i], -moved[i]
        if grips[i] == STICK:
            if mu[i] > 0.0:
                M[m + i], right[m + i] = A[m + i], -moved[m + i]
        elif grips[i] in (FORWARD, BACKWARD):
            sign = 1.0 if grips[i] == FORWARD else -1.0
            M[m + i, i], right[m + i] = sign * mu[i], -sign * dmu[i] * x[i]
    return np.asarray(np.linalg.lstsq(M, right, rcond=1e-13)[0], dtype=float)
