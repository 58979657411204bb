"""Contacts of one instant solved by trying every combination: the second route of the tests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


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
    largest = max(map(abs, b))
    for rtol in (1e-12, 1e-8):
        for size in range(m + 1):
            for active in combinations(range(m), size):
                x = [0.0] * m
                part = _solve([[A[i][k] for k in active] for i in active], [-b[i] for i in active])
                if part is None or min(part, default=0.0) < 0.0:
                    continue
                for i, force in zip(active, part, strict=True):
                    x[i] = force
                if all(
                    sum([a * y for a, y in zip(row, x, strict=True)]) + free
                    >= -rtol * (sum([abs(a) * y for a, y in zip(row, x, strict=True)]) + largest)
                    for row, free in zip(A, b, strict=True)
                ):
                    return x
    raise ArithmeticError('no impulses satisfy all contacts of this instant')


def _solve(A: list[list[float]], b: list[float]) -> list[float] | None:
    """Solution of ``A x = b``, ``None`` if A is singular.

    For two or three rows plain floats are much faster than NumPy.
    """
    n = len(b)
    rows = [[*row, right] for row, right in zip(A, b, strict=True)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        if rows[k][k] == 0.0:
            return None
        for row in rows[k + 1 :]:
            factor = row[k] / rows[k][k]
            for j in range(k, n + 1):
                row[j] -= factor * rows[k][j]
    x = [0.0] * n
    for k in reversed(range(n)):
        known = sum([rows[k][j] * x[j] for j in range(k + 1, n)])
        x[k] = (rows[k][n] - known) / rows[k][k]
    return x


class Grip(Enum):
    """State of a contact: no force, or sticking, or slip along or against +t."""

    OPEN = 'open'
    STICK = 'stick'
    FORWARD = 'slip+'
    BACKWARD = 'slip-'


def solve_frictional_lcp(
    A: ArrayLike,
    b: ArrayLike,
    friction: Sequence[float],
    slip: Sequence[int | None] | None = None,
    least: Sequence[float] | None = None,
) -> tuple[list[float], list[Grip]]:
    """Impulses of m planar contacts with Coulomb friction, or forces if b are accelerations.

    Find ``x = (p, q)``, all normals first, with ``w = A x + b`` such that for every contact

    - ``p >= least``, ``wn >= 0`` and ``(p - least) wn = 0``;
    - it sticks, ``wt = 0`` and ``|q| <= mu p``, or slips, ``q = -mu sign(wt) p``.

    ``mu = inf`` is the limit of a large mu: ``wt = 0`` with any q if p > 0; where p = 0 and
    wn = 0 also some q against the sign of wt.

    All combinations are tried: 4 states of a contact, 2 of one that is frictionless or whose slip
    is given, 6 (or 2) of one with a least impulse. Several solutions may exist; the one with the
    fewest contacts pressed beyond their least impulse is returned, among these the one with the
    fewest that slip, and then the first in the order open, stick, slip+, slip-.

    Parameters
    ----------
    A : (2m, 2m), symmetric positive semidefinite
    b : (2m,)
    friction : (m,) Coulomb's coefficients mu; tangential rows of a frictionless contact may be 0
    slip : (m,) -1 or +1 where the contact slips already, so that ``q = -mu slip p`` whatever wt
        becomes; 0 or None where it is free to choose
    least : (2m,) normal impulses that there are in any case, 0 by default; of its tangential half
        only the sizes for rough contacts with p = 0 matter: so much friction can hold there

    Returns
    -------
    (2m,) x, and (m,) what each contact does; one without friction slips, or sticks if wt = 0

    Raises
    ------
    ArithmeticError
        If there is no solution to rounding. If A is positive definite that takes slips that are
        given and jam: for one contact ``Ann < mu slip Ant``.
    """
    m = len(friction)
    matrix, vector = np.array(A, dtype=float), np.array(b, dtype=float)
    slip = [0] * m if slip is None else slip
    least = [0.0] * (2 * m) if least is None else least
    if not any(friction):
        p, normals = np.array(least[:m], dtype=float), matrix[:m, :m]
        p += solve_lcp(normals.tolist(), (normals @ p + vector[:m]).tolist())
        wt = matrix[m:, :m] @ p + vector[m:]
        grips = [_grip(_SMOOTH, p[i], 0.0, wt[i]) for i in range(m)]
        return [*p.tolist(), *[0.0] * m], grips
    menus = [_states(friction[i], slip[i], least[i], abs(least[m + i])) for i in range(m)]
    tries = sorted(product(*menus), key=_preference)
    for rtol in (1e-12, 1e-8):
        for states in tries:
            x = _settle(matrix, vector, states, rtol)
            if x is not None:
                wt = (matrix @ x + vector)[m:]
                return x.tolist(), [_grip(s, x[i], x[m + i], wt[i]) for i, s in enumerate(states)]
    raise ArithmeticError('no impulses with friction satisfy all contacts of this instant')


class _State(NamedTuple):
    """Possible state of one contact. Its load is p, or |q| of a rough one that slips."""

    grip: Grip | None  # None: frictionless, slips as it likes
    ray: tuple[float, float]  # p and q per unit of load
    least: float  # load
    pressed: bool  # loaded beyond its least, so that wn = 0
    hold: tuple[float, float]  # if it sticks, |q| is at most the first times p plus the second
    direction: int  # sign that wt must have, 0 for any


_SMOOTH = _State(None, (1.0, 0.0), 0.0, True, (0.0, 0.0), 0)


def _states(mu: float, slip: int | None, p: float, q: float) -> list[_State]:
    """States in the order of preference of a contact with these least impulses."""
    rough = mu == math.inf
    loaded = p > 0.0 or (rough and q > 0.0)
    states = [] if loaded else [_State(Grip.OPEN, (1.0, 0.0), 0.0, False, (0.0, 0.0), 0)]
    for pressed in (False, True) if loaded else (True,):
        if mu == 0.0:
            states.append(_State(None, (1.0, 0.0), p, pressed, (0.0, 0.0), 0))
            continue
        if not slip:
            hold = (0.0, math.inf if pressed or p > 0.0 else q) if rough else (mu, 0.0)
            states.append(_State(Grip.STICK, (1.0, 0.0), p, pressed, hold, 0))
        for sign in (slip,) if slip else (1, -1):
            grip, direction = Grip.FORWARD if sign > 0 else Grip.BACKWARD, 0 if slip else sign
            if not rough:
                ray = (1.0, -mu * sign)
                states.append(_State(grip, ray, p, pressed, (0.0, 0.0), direction))
            elif p == 0.0:
                ray = (0.0, -float(sign))
                states.append(_State(grip, ray, q, pressed, (0.0, 0.0), direction))
    return states


def _grip(state: _State, p: float, q: float, wt: float) -> Grip:
    if p == 0.0 and q == 0.0:
        return Grip.OPEN
    if state.grip is not None:
        return state.grip
    return Grip.FORWARD if wt > 0.0 else Grip.BACKWARD if wt < 0.0 else Grip.STICK


def _preference(states: tuple[_State, ...]) -> tuple[int, int]:
    slipping = (Grip.FORWARD, Grip.BACKWARD)
    return sum(s.pressed for s in states), sum(s.grip in slipping for s in states)


def _settle(
    A: NDArray[np.float64], b: NDArray[np.float64], states: tuple[_State, ...], rtol: float
) -> NDArray[np.float64] | None:
    """The impulses (2m,) if every contact can do what is supposed, or None."""
    m = len(states)
    x = np.zeros(2 * m)
    columns, rows = [], []
    for i, s in enumerate(states):
        ray = np.zeros(2 * m)
        ray[[i, m + i]] = s.ray
        if s.pressed:
            columns.append(ray)
            rows.append(i)
        else:
            x += s.least * ray
        if s.grip is Grip.STICK:
            columns.append(np.eye(2 * m)[m + i])
            rows.append(m + i)
    if rows:
        basis = np.array(columns).T
        # least squares: friction may be redundant, with many contacts or rows of 0
        x += basis @ np.linalg.lstsq((A @ basis)[rows], -(A @ x + b)[rows], rcond=1e-13)[0]
    w = A @ x + b
    size = np.abs(A).sum(axis=1) * np.abs(x).max() + np.abs(b)  # of what cancels in w
    if rows and np.abs(w[rows]).max() > 1e-9 * size.max():
        return None
    slack = rtol * float(np.abs(x).max())
    for i, s in enumerate(states):
        p, q = float(x[i]), float(x[m + i])
        found = p if s.ray[0] else q * s.ray[1]
        load = max(found, s.least)
        hold = s.hold[0] * load + s.hold[1]
        if (
            found < s.least - slack
            or (s.grip is Grip.STICK and abs(q) > hold + slack)
            or (not s.pressed and w[i] < -rtol * size[i])
            or s.direction * w[m + i] < -rtol * size[m + i]
        ):
            return None
        x[i], x[m + i] = load * s.ray[0], load * s.ray[1]
        if s.grip is Grip.STICK:
            x[m + i] = max(-hold, min(q, hold))
    return x


def newton_impulses(
    compliance: list[list[float]], approach: Sequence[float], restitution: Sequence[float]
) -> list[float]:
    """Normal impulses of the m contacts that touch at one instant [N s].

    Newton's hypothesis in the form of a complementarity: each contact ends with at least
    ``-e`` times its approach rate, and carries an impulse only if with exactly that. For a
    single contact it is ``(1 + e) m_eff v`` ([SB] 5.1).

    Parameters
    ----------
    compliance : (m, m) gap rates per unit impulse [1/kg]
    approach : (m,) gap rates before [m/s], negative when closing
    restitution : (m,)
    """
    b = [(1.0 + e) * rate for e, rate in zip(restitution, approach, strict=True)]
    return solve_lcp(compliance, b)
