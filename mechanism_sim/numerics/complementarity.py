"""Linear complementarity for the contacts of one instant, solved by Lemke's method.

Pivoting finds solutions of singular problems (contacts that repeat each other), which Newton's
method on a projection and Gauss-Seidel do not reach to rounding. Given slips that jam in dependent
contacts may be missed (9 of 2,000 random problems); an impact without collision resolves them.

What is marked `kernel` is made of plain loops over arrays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.numerics.kernels import entry, kernel
from mechanism_sim.tolerances import TOLERANCES

_COMPLEMENTARITY = TOLERANCES.complementarity
_ROUNDING = TOLERANCES.rounding

Indices = NDArray[np.int64]

_GOLDEN = 0.6180339887498949

OPEN, STICK, FORWARD, BACKWARD = range(4)


class Grip(IntEnum):
    """State of a contact: no force, sticking, slip along or against +t."""

    OPEN = OPEN
    STICK = STICK
    FORWARD = FORWARD
    BACKWARD = BACKWARD


class FrictionalProblem(NamedTuple):
    """Normal and tangential impulses of m contacts, see `solve_frictional_lcp`."""

    A: Array  #: (2m, 2m) compliance
    b: Array  #: (2m,) rates, or accelerations, without impulses
    friction: Array  #: (m,) Coulomb's coefficients
    slip: Indices  #: (m,) sign of a given slip, 0 where it is free
    least: Array  #: (2m,) least impulses, see `solve_frictional_lcp`


@kernel
def lemke(M: Array, q: Array, cover: Array, start: int) -> tuple[Indices, bool]:
    """Complementary basis of ``w = M z + q``, ``w, z >= 0``, ``w . z = 0``, by C. E. Lemke.

    The vector `cover` > 0 times an artificial variable is added to w, which makes it positive, and
    that variable is pivoted out. Ties are broken lexicographically, so that no basis comes twice
    (R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, 4.4 and 4.9).

    Parameters
    ----------
    M : (n, n)
    q, cover : (n,)
    start : index i of a ``z_i`` exchanged with its ``w_i`` beforehand, if possible; none if -1

    Returns
    -------
    (n,) basic variables, ``w_i`` as i and ``z_i`` as n + i, and whether the artificial one left
    the basis. If M is copositive and there is a solution, it does.
    """
    n = len(q)
    # every row says: its basic variable + its entries times the nonbasic ones = the last entry
    T = np.empty((n, n + 2))
    basic, nonbasic = np.empty(n, dtype=np.int64), np.empty(n + 1, dtype=np.int64)
    place = np.empty(2 * n + 1, dtype=np.int64)  # of a variable: its column, or its row - n
    row, column = 0, n
    for i in range(n):
        for k in range(n):
            T[i, k] = -M[i, k]
        T[i, n], T[i, n + 1] = 0.0, q[i]
        basic[i], nonbasic[i] = i, n + i
        place[i], place[n + i] = i - n, i
    nonbasic[n], place[2 * n] = 2 * n, n
    if start >= 0:
        if abs(T[start, start]) < _COMPLEMENTARITY.tie:
            return basic, False
        exchange(T, start, start)
        basic[start], nonbasic[start] = n + start, start
        place[start], place[n + start] = start, start - n
    # the artificial variable enters in the row with the least ratio: then all w are positive
    first = basic.copy()
    for i in range(n):
        T[i, n] = -cover[i]
        if T[i, n + 1] / cover[i] <= T[row, n + 1] / cover[row]:
            row = i
    if T[row, n + 1] >= 0.0:
        return basic, True
    for _ in range(50 * n + 50):
        leaving, entering = basic[row], nonbasic[column]
        exchange(T, row, column)
        basic[row], nonbasic[column] = entering, leaving
        place[entering], place[leaving] = row - n, column
        if leaving == 2 * n:
            return basic, True
        # complementary pivoting: the partner of the variable that has left enters next
        column = place[leaving + n if leaving < n else leaving - n]
        row = _leaving(T, column, basic, place, first)
        if row < 0:
            break
    return basic, False


@kernel
def exchange(T: Array, row: int, column: int) -> None:
    """Exchange the basic variable of a row of a tableau (n, k) with that of a column, in place."""
    n, width = T.shape
    inverse = 1.0 / T[row, column]
    for k in range(width):
        T[row, k] *= inverse
    for i in range(n):
        factor = T[i, column]
        if i == row or factor == 0.0:
            continue
        for k in range(width):
            T[i, k] -= factor * T[row, k]
        T[i, column] = -factor * inverse
    T[row, column] = inverse


@kernel
def _leaving(T: Array, column: int, basic: Indices, place: Indices, first: Indices) -> int:
    """Row whose variable reaches zero first as that of a column grows; -1 if none does."""
    n = len(T)
    found = -1
    for i in range(n):
        if T[i, column] <= _COMPLEMENTARITY.pivot:
            continue
        if found < 0:
            found = i
            continue
        ratio, least = T[i, n + 1] / T[i, column], T[found, n + 1] / T[found, column]
        if abs(ratio - least) > _COMPLEMENTARITY.tie:
            if ratio < least:
                found = i
        elif basic[i] == 2 * n or (
            basic[found] != 2 * n and _before(T, column, place, first, i, found)
        ):
            found = i
    return found


@kernel
def _before(T: Array, column: int, place: Indices, first: Indices, i: int, k: int) -> bool:
    """True if row i of the inverse basis over its pivot is lexicographically less than row k."""
    n = len(T)
    for j in range(n):
        at = place[first[j]]
        if at >= 0:
            one, other = T[i, at] / T[i, column], T[k, at] / T[k, column]
        else:
            one = 1.0 / T[i, column] if at + n == i else 0.0
            other = 1.0 / T[k, column] if at + n == k else 0.0
        if abs(one - other) > _COMPLEMENTARITY.tie:
            return bool(one < other)
    return False


@kernel
def rates(A: Array, x: Array, b: Array) -> Array:
    """``A x + b`` (n,)."""
    n = len(b)
    w = np.empty(n)
    for i in range(n):
        w[i] = b[i]
        for k in range(len(x)):
            w[i] += A[i, k] * x[k]
    return w


@kernel
def largest(x: Array) -> float:
    """Largest size of the entries of a vector."""
    most = 0.0
    for value in x:
        most = max(most, abs(value))
    return most


@kernel
def solve(A: Array, b: Array) -> tuple[Array, bool]:
    """Solution (n,) of ``A x = b``, and whether A (n, n) is regular to rounding."""
    n = len(b)
    T, x = np.empty((n, n + 1)), np.zeros(n)
    size = 0.0
    for i in range(n):
        for k in range(n):
            T[i, k] = A[i, k]
            size = max(size, abs(T[i, k]))
        T[i, n] = b[i]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(T[i, k]) > abs(T[best, k]):
                best = i
        if not abs(T[best, k]) > _ROUNDING.value * size:
            return x, False
        for j in range(k, n + 1):
            T[k, j], T[best, j] = T[best, j], T[k, j]
        for i in range(k + 1, n):
            factor = T[i, k] / T[k, k]
            for j in range(k + 1, n + 1):
                T[i, j] -= factor * T[k, j]
    for k in range(n - 1, -1, -1):
        left = T[k, n]
        for j in range(k + 1, n):
            left -= T[k, j] * x[j]
        x[k] = left / T[k, k]
    return x, True


@kernel
def determinant(A: Array) -> float:
    """Determinant of A (n, n)."""
    T, n, found = A.copy(), len(A), 1.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(T[i, k]) > abs(T[best, k]):
                best = i
        found *= T[best, k] if best == k else -T[best, k]
        for i in range(k, n):
            if i == k and best != k:
                for j in range(k, n):
                    T[k, j], T[best, j] = T[best, j], T[k, j]
            elif i > k and T[k, k] != 0.0:
                factor = T[i, k] / T[k, k]
                for j in range(k + 1, n):
                    T[i, j] -= factor * T[k, j]
    return found


@kernel
def solve_semidefinite(A: Array, B: Array) -> Array:
    """A solution (n, k) of ``A X = B`` for symmetric positive semidefinite A.

    Diagonal pivots, largest first. Rows that depend on those before them are left out: what they
    say follows from the others, if B is consistent.
    """
    n, width = B.shape
    T, X = np.empty((n, n + width)), np.zeros((n, width))
    scale = np.empty(n)
    for i in range(n):
        scale[i] = 1.0 / math.sqrt(A[i, i]) if A[i, i] > 0.0 else 1.0
    for i in range(n):
        for k in range(n):
            T[i, k] = scale[i] * A[i, k] * scale[k]
        for k in range(width):
            T[i, n + k] = scale[i] * B[i, k]
    order, rank = _eliminate_symmetric(T)
    for step in range(rank - 1, -1, -1):
        at = order[step]
        for k in range(width):
            left = T[at, n + k]
            for later in range(step + 1, rank):
                left -= T[at, order[later]] * X[order[later], k]
            X[at, k] = left / T[at, at]
    for i in range(n):
        for k in range(width):
            X[i, k] *= scale[i]
    return X


@kernel
def _eliminate_symmetric(T: Array) -> tuple[Indices, int]:
    """Order (n,) of the diagonal pivots of a tableau (n, n + k), and how many are not zero.

    The tableau is changed in place.
    """
    n, columns = T.shape
    order, first, rank = np.arange(n), 0.0, 0
    for step in range(n):
        best = step
        for k in range(step + 1, n):
            if T[order[k], order[k]] > T[order[best], order[best]]:
                best = k
        order[step], order[best] = order[best], order[step]
        at = order[step]
        first = max(first, T[at, at])
        if not T[at, at] > _COMPLEMENTARITY.dependent * first:
            break
        rank += 1
        for k in range(step + 1, n):
            i = order[k]
            factor = T[i, at] / T[at, at]
            for j in range(columns):
                T[i, j] -= factor * T[at, j]
    return order, rank


@entry
def solve_contacts(problem: FrictionalProblem) -> tuple[Array, Indices, bool]:
    """Solution x of `solve_frictional_lcp` and the grips, as arrays, and whether one exists.

    The problem is that of D. E. Stewart and J. C. Trinkle (Int. J. Numer. Meth. Eng. 39, 1996):
    friction is a difference of two positive parts, ``q = q+ - q-``, and a further unknown is the
    slip that the cone ``q+ + q- <= mu p`` leaves. Each such row is divided by mu, which is bounded
    while pivoting; the basis found is solved anew for the exact cones.
    """
    A, b, friction, slip, least = problem
    m = len(friction)
    if m == 1 and least[0] == 0.0 and least[1] == 0.0 and friction[0] < math.inf:
        return _one(A, b, friction[0], slip[0])
    x = np.zeros(2 * m)
    grips = np.zeros(m, dtype=np.int64)
    if _is_at_rest(b, least):
        return x, grips, True
    if _pivot(problem, x, grips):
        return x, grips, True
    # beside fast slips, slow approaches drown while pivoting: then such slips are known
    given, slow = slip.copy(), b.copy()
    for i in range(m):
        if slip[i] == 0 and 0.0 < friction[i] < math.inf:
            given[i] = 1 if b[m + i] > 0.0 else -1 if b[m + i] < 0.0 else 0
        if given[i] != 0:
            slow[m + i] = 0.0
    if not _pivot(FrictionalProblem(A, slow, friction, given, least), x, grips):
        return x, grips, False
    w = rates(A, x, b)
    for i in range(m):
        if slip[i] != given[i] and given[i] * w[m + i] < 0.0:
            return x, grips, False
    return x, grips, True


@kernel
def _pivot(problem: FrictionalProblem, x: Array, grips: Indices) -> bool:
    """Enter x and grips of `solve_contacts`, found by pivoting; False if none are."""
    m = len(problem.friction)
    free, n, bounded = _free_slips(problem)
    for weakest in _COMPLEMENTARITY.weakest:
        M, q = _problem(problem, free, n, weakest)
        for k in range(_COMPLEMENTARITY.covers):
            cover = np.empty(n)
            for i in range(n):
                cover[i] = 1.0 + k * ((i + 1) * k * _GOLDEN % 1.0)
            for start in range(-1, m):
                basis, found = lemke(M, q, cover, start)
                if found and _settle(problem, free, basis, x, grips):
                    return True
            if k == 0:
                _leave_out_jammed(M, q, m)
        if not bounded:
            break
    return False


@kernel
def _is_at_rest(b: Array, least: Array) -> bool:
    """True if no contact closes, and none carries an impulse anyway."""
    m, rests = len(b) // 2, True
    for i in range(m):
        rests = rests and b[i] >= 0.0 and least[i] == 0.0 and least[m + i] == 0.0
    return rests


@kernel
def _free_slips(problem: FrictionalProblem) -> tuple[Indices, int, bool]:
    """Index (m,) of the unknowns of each contact whose slip is free, or -1.

    And the number of all unknowns, and whether a coefficient is bounded while pivoting.
    """
    A, friction, m = problem.A, problem.friction, len(problem.friction)
    free, n, bounded = np.empty(m, dtype=np.int64), m, False
    for i in range(m):
        free[i] = -1
        if friction[i] > 0.0 and problem.slip[i] == 0 and A[m + i, m + i] > 0.0:
            free[i] = n
            n += 3
            bounded = bounded or 1.0 / friction[i] < _COMPLEMENTARITY.weakest[0]
    return free, n, bounded


@kernel
def _leave_out_jammed(M: Array, q: Array, m: int) -> None:
    """Remove contacts that jam by themselves from a problem, in place."""
    for i in range(m):
        if M[i, i] <= 0.0:
            q[i] = 1.0
            for c in range(len(q)):
                M[i, c] = 1.0 if c == i else 0.0


@kernel
def _one(A: Array, b: Array, mu: float, slip: int) -> tuple[Array, Indices, bool]:
    """`solve_contacts` for one contact."""
    x = np.zeros(2)
    grip = np.zeros(1, dtype=np.int64)
    if b[0] >= 0.0:
        return x, grip, True
    if mu == 0.0 or slip or not A[1, 1] > 0.0:
        rise = A[0, 0] - mu * slip * A[0, 1]
        if not rise > 0.0:
            return x, grip, False
        x[0] = -b[0] / rise
        rate = float(slip) if slip and mu > 0.0 else A[1, 0] * x[0] + b[1]
        grip[0] = FORWARD if rate > 0.0 else BACKWARD if rate < 0.0 else STICK
        if rate != 0.0:
            x[1] = -mu * x[0] if rate > 0.0 else mu * x[0]
        return x, grip, True
    product = A[0, 0] * A[1, 1]
    det = product - A[0, 1] * A[1, 0]
    if det > _COMPLEMENTARITY.regular * product:
        x[0] = (A[0, 1] * b[1] - A[1, 1] * b[0]) / det
        x[1] = (A[1, 0] * b[0] - A[0, 0] * b[1]) / det
    else:  # if the normal impulse that stops it alone stops the slip too
        x[0] = -b[0] / A[0, 0]
        off = A[1, 0] * x[0] + b[1]
        x[1] = 0.0 if abs(off) <= _COMPLEMENTARITY.regular * abs(b[1]) else math.inf
    # sticking if its force is within the cone, else slip in the direction that is consistent
    if x[0] > 0.0 and abs(x[1]) <= mu * x[0]:
        grip[0] = STICK
        return x, grip, True
    for sign in (1, -1):
        rise = A[0, 0] - mu * sign * A[0, 1]
        if rise > 0.0:
            x[0] = -b[0] / rise
            x[1] = -mu * sign * x[0]
            if sign * (A[1, 0] * x[0] + A[1, 1] * x[1] + b[1]) >= 0.0:
                grip[0] = FORWARD if sign > 0 else BACKWARD
                return x, grip, True
    return x, grip, False


@kernel
def _problem(
    problem: FrictionalProblem, free: Indices, n: int, weakest: float
) -> tuple[Array, Array]:
    """Matrix and vector of the complementarity problem, scaled to entries of about 1.

    Its unknowns are p beyond its least for every contact, and for those whose slip is `free`, from
    that index on, ``q+``, ``q-`` and the slip that is left.
    """
    A, b, friction, slip, least = problem
    m = len(friction)
    scale, given = np.zeros(m), np.zeros(2 * m)
    for i in range(m):
        size = A[i, i] + A[m + i, m + i]
        scale[i] = 1.0 / math.sqrt(size) if size > 0.0 else 1.0
        given[i] = least[i]
        if free[i] < 0 and friction[i] > 0.0 and slip[i] != 0:
            given[m + i] = -friction[i] * slip[i] * least[i]
    w = rates(A, given, b)
    size = largest(w)
    if size == 0.0:
        size = 1.0
    M, q = np.zeros((n, n)), np.zeros(n)
    for i in range(m):
        q[i] = scale[i] * w[i] / size
        at = free[i]
        if at >= 0:
            q[at] = scale[i] * w[m + i] / size
            q[at + 1] = -q[at]
            weak = max(1.0 / friction[i], weakest)
            M[at, at + 2] = M[at + 1, at + 2] = M[at + 2, i] = 1.0
            M[at + 2, at] = M[at + 2, at + 1] = -weak
            hold = least[i] / weak if least[i] > 0.0 else abs(least[m + i])
            if friction[i] < math.inf:
                hold = friction[i] * least[i]
            q[at + 2] = hold * weak / (scale[i] * size)
        for k in range(m):
            both, to = scale[i] * scale[k], free[k]
            ray = -friction[k] * slip[k] if friction[k] > 0.0 and slip[k] != 0 else 0.0
            each = both / math.sqrt(1.0 + ray * ray)
            M[i, k] = each * (A[i, k] + ray * A[i, m + k])
            if to >= 0:
                M[i, to] = both * A[i, m + k]
                M[i, to + 1] = -M[i, to]
            if at >= 0:
                M[at, k] = each * (A[m + i, k] + ray * A[m + i, m + k])
                M[at + 1, k] = -M[at, k]
                if to >= 0:
                    M[at, to] = M[at + 1, to + 1] = both * A[m + i, m + k]
                    M[at, to + 1] = M[at + 1, to] = -M[at, to]
    return M, q


@kernel
def _settle(
    problem: FrictionalProblem, free: Indices, basis: Indices, x: Array, grips: Indices
) -> bool:
    """Enter x and grips of a basis, with the exact cones; False if they are no solution."""
    m, n = len(problem.friction), len(basis)
    inside = np.zeros(n, dtype=np.bool_)
    for i in range(n):
        if n <= basis[i] < 2 * n:
            inside[basis[i] - n] = True
    direction, sticks = _directions(problem, free, inside, grips)
    columns, rows = _columns(problem, inside, direction, sticks, x)
    k = len(rows)
    w = rates(problem.A, x, problem.b)
    left, right = np.zeros((k, k)), np.empty(k)
    for i in range(k):
        right[i] = -w[rows[i]]
        for j in range(k):
            for r in range(2 * m):
                left[i, j] += problem.A[rows[i], r] * columns[r, j]
    found, regular = solve(left, right)
    if not regular:
        return False
    for r in range(2 * m):
        for j in range(k):
            x[r] += columns[r, j] * found[j]
    return _holds(problem, inside, direction, x, grips)


@kernel
def _directions(
    problem: FrictionalProblem, free: Indices, inside: Mask, grips: Indices
) -> tuple[Indices, Mask]:
    """Signs (m,) of the slips of a basis, and which contacts stick; enters their grips.

    Parameters
    ----------
    inside : (n,) mask of the unknowns in the basis
    """
    m = len(problem.friction)
    direction, sticks = np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.bool_)
    for i in range(m):
        at, given = free[i], problem.slip[i]
        if at >= 0:
            plus, minus, slides = inside[at], inside[at + 1], inside[at + 2]
            if slides and plus != minus:
                direction[i] = -1 if plus else 1
            else:
                sticks[i] = plus or minus
            grips[i] = STICK if direction[i] == 0 else FORWARD if direction[i] > 0 else BACKWARD
        elif problem.friction[i] > 0.0 and given != 0:
            direction[i] = given
            grips[i] = FORWARD if given > 0 else BACKWARD
        else:
            grips[i] = OPEN  # as yet
    return direction, sticks


@kernel
def _columns(
    problem: FrictionalProblem,
    inside: Mask,
    direction: Indices,
    sticks: Mask,
    x: Array,
) -> tuple[Array, Indices]:
    """Columns (2m, k) of the impulses of a basis, and the rows (k,) that they keep at zero.

    Sets x to the least impulses, with the friction that they have where the contact slides.
    """
    m, k, least = len(problem.friction), 0, problem.least
    columns = np.zeros((2 * m, 2 * m))
    rows = np.zeros(2 * m, dtype=np.int64)
    for i in range(m):
        mu, sign = problem.friction[i], direction[i]
        rough = mu == math.inf
        x[i], x[m + i] = least[i], 0.0
        if sign != 0:
            x[m + i] = -sign * (abs(least[m + i]) if rough else mu * least[i])
        if inside[i]:
            if rough and sign != 0:
                columns[m + i, k] = -sign
            else:
                columns[i, k] = 1.0
                columns[m + i, k] = -mu * sign if sign != 0 else 0.0
            rows[k] = i
            k += 1
        if sticks[i]:
            columns[m + i, k] = 1.0
            rows[k] = m + i
            k += 1
    return columns, rows[:k]


@kernel
def _holds(
    problem: FrictionalProblem,
    pressed: Mask,
    direction: Indices,
    x: Array,
    grips: Indices,
) -> bool:
    """True if x obeys the laws of all contacts to rounding; x is then made exact."""
    A, b, least = problem.A, problem.b, problem.least
    m, most, limits = len(problem.friction), largest(x), _COMPLEMENTARITY
    slack = limits.exact * most
    w, size = rates(A, x, b), np.empty(2 * m)
    rounding = _ROUNDING.solved / limits.exact * largest(b)
    for r in range(2 * m):
        size[r] = abs(b[r]) + rounding
        for c in range(2 * m):
            size[r] += abs(A[r, c]) * most
    off = limits.exact * largest(size)
    for i in range(m):
        mu, p, q = problem.friction[i], x[i], x[m + i]
        if p < least[i] - slack or w[i] < -limits.exact * size[i]:
            return False
        if pressed[i] and abs(w[i]) > off:
            return False
        p = max(p, least[i]) if p > limits.impulse * most else least[i]
        if mu == math.inf:
            hold = math.inf if pressed[i] or p > 0.0 else abs(least[m + i])
            if direction[i] != 0 and direction[i] * q > slack:
                return False
        else:
            hold = mu * p
        wt, rest = w[m + i], limits.exact * size[m + i]
        if grips[i] == STICK:
            # rows of much friction were small while pivoting: what they left out moves no rate
            if abs(q) > hold + max(slack, limits.cone * largest(b) / A[m + i, m + i]):
                return False
            if (p > 0.0 or q != 0.0) and abs(wt) > off:
                return False
        elif direction[i] != 0 and problem.slip[i] == 0 and direction[i] * wt < -rest:
            return False
        grips[i], q = _exact_friction(grips[i], direction[i], q, wt, rest, mu, hold)
        if p == 0.0 and q == 0.0:
            grips[i] = OPEN
        x[i], x[m + i] = p, q
    return True


@kernel
def _exact_friction(
    grip: int, direction: int, q: float, wt: float, rest: float, mu: float, hold: float
) -> tuple[int, float]:
    """Grip and friction q of a contact that obeys Coulomb's law to rounding, within its cone.

    Parameters
    ----------
    wt, rest : tangential rate, and its rounding error
    hold : bound of q
    """
    if grip == STICK:
        return grip, max(-hold, min(q, hold))
    if direction != 0:
        return grip, q if mu == math.inf else -direction * hold
    # without friction, or it changes nothing
    if not abs(wt) > rest:
        return STICK, q
    if 0.0 < mu < math.inf:
        q = -hold if wt > 0.0 else hold
    return FORWARD if wt > 0.0 else BACKWARD, q


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
    wn = 0 also some q against the sign of wt. Of several solutions one is found.

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
    (2m,) x, and (m,) grip of each contact; one without friction slips, or sticks if wt = 0

    Raises
    ------
    ArithmeticError
        If no solution is found. There is one if A is positive definite, but for slips that are
        given and jam: for one contact ``Ann < mu slip Ant``.
    """
    m = len(friction)
    given = np.array([s or 0 for s in slip] if slip is not None else [0] * m, dtype=np.int64)
    known = np.zeros(2 * m) if least is None else np.asarray(least, dtype=float)
    problem = FrictionalProblem(
        np.ascontiguousarray(A, dtype=float),
        np.asarray(b, dtype=float),
        np.asarray(friction, dtype=float),
        given,
        known,
    )
    x, grips, found = solve_contacts(problem)
    if not found:
        raise ArithmeticError('no impulses satisfy all contacts of this instant')
    return x.tolist(), [Grip(g) for g in grips.tolist()]
