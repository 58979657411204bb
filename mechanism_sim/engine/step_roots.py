"""First fall of a guard through zero within a step, in machine code, by the bits of heyoka's.

heyoka isolates the real roots by Descartes' rule of signs and bisection (Collins, Akritas 1976),
and finds each by algorithm 748 (Alefeld, Potra, Shi 1995, ACM Trans. Math. Softw. 21:327) in the
form of Boost. The same operations in the same order give the same bits. Only how it counts signs
is its own: where rounding might decide on one, the step is left to heyoka.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.kernels import kernel

NO_FALL, UNSURE = -1.0, -2.0
"""Instead of a time: the guard does not fall; heyoka is to say so."""

_EPS = 2.0**-52
_DEEP = 16  # intervals that wait at once; more are left to heyoka
_CALLS = 51  # of a polynomial in the search for a root, besides those at the ends
_ALIKE = 2.0**-1017  # values that do not differ by more make no cubic
_LARGEST = (2.0 - 2.0**-52) * 2.0**1023
_LAST = 1.0 - 2.0**-53  # factor from an end of an interval to the number before


class RootArrays(NamedTuple):
    """Workspace of `first_fall` for series of n coefficients, all overwritten."""

    waiting: Array  #: (2 d, n) polynomials of intervals to be searched, each with its magnitudes
    ends: Array  #: (d, 2) of the intervals, in units of the step
    scaled: Array  #: (n,) the series in units of the step
    shifted: Array  #: (2, n) polynomial and magnitudes, reversed, with its origin moved by 1


def root_arrays(count: int) -> RootArrays:
    """Workspace for series of `count` coefficients."""
    return RootArrays(
        np.empty((2 * _DEEP, count)), np.empty((_DEEP, 2)), np.empty(count), np.empty((2, count))
    )


class Bracket(NamedTuple):
    """Interval around a root, with values at its ends, and the point that was an end before."""

    a: float
    b: float
    fa: float
    fb: float
    d: float
    fd: float


@kernel
def _value(p: Array, x: float) -> float:
    n = len(p)
    y = float(p[n - 1])
    for k in range(n - 2, -1, -1):
        y = p[k] + y * x
    return y


@kernel
def _slope(p: Array, x: float) -> float:
    n = len(p)
    y = p[n - 1] * float(n - 1)
    for k in range(n - 2, 0, -1):
        y = p[k] * float(k) + y * x
    return float(y)


@kernel
def _near(a: float, b: float) -> bool:
    return abs(a - b) <= 4.0 * _EPS * min(abs(a), abs(b))


@kernel
def _bracketed(p: Array, s: Bracket, c: float) -> Bracket:
    """The part of an interval with the root, cut at c or, close to an end, a little beside it."""
    tol = 2.0 * _EPS
    a, b = s.a, s.b
    if b - a < 2.0 * tol * a:
        c = a + (b - a) / 2.0
    elif c <= a + abs(a) * tol:
        c = a + abs(a) * tol
    elif c >= b - abs(b) * tol:
        c = b - abs(b) * tol
    fc = _value(p, c)
    if fc == 0.0:
        return Bracket(c, b, 0.0, s.fb, 0.0, 0.0)
    if (s.fa < 0.0) != (fc < 0.0):
        return Bracket(a, c, s.fa, fc, b, s.fb)
    return Bracket(c, b, fc, s.fb, a, s.fa)


@kernel
def _quotient(x: float, y: float, otherwise: float) -> float:
    if abs(y) < 1.0 and abs(y * _LARGEST) <= abs(x):
        return otherwise
    return x / y


@kernel
def _secant(s: Bracket) -> float:
    tol = 5.0 * _EPS
    c = s.a - (s.fa / (s.fb - s.fa)) * (s.b - s.a)
    if c <= s.a + abs(s.a) * tol or c >= s.b - abs(s.b) * tol:
        return (s.a + s.b) / 2.0
    return c


@kernel
def _quadratic(s: Bracket, steps: int) -> float:
    """Root of the parabola through three points, by Newton's method."""
    a, b = s.a, s.b
    slope = _quotient(s.fb - s.fa, b - a, _LARGEST)
    curve = _quotient(s.fd - s.fb, s.d - b, _LARGEST)
    curve = _quotient(curve - slope, s.d - a, 0.0)
    if curve == 0.0:
        return _secant(s)
    c = a if (curve > 0.0) == (s.fa > 0.0) else b
    for _ in range(steps):
        c -= _quotient(
            s.fa + (slope + curve * (c - b)) * (c - a),
            slope + curve * (2.0 * c - a - b),
            1.0 + c - a,
        )
    if c <= a or c >= b:
        return _secant(s)
    return c


@kernel
def _cubic(s: Bracket, e: float, fe: float, steps: int) -> float:
    """Root by inverse interpolation through four points, of a parabola if two values are alike."""
    a, b, fa, fb, d, fd = s
    least = min(abs(fa - fb), abs(fa - fd), abs(fa - fe), abs(fb - fd), abs(fb - fe), abs(fd - fe))
    if least < _ALIKE:
        return _quadratic(s, steps)
    q11 = (d - e) * fd / (fe - fd)
    q21 = (b - d) * fb / (fd - fb)
    q31 = (a - b) * fa / (fb - fa)
    d21 = (b - d) * fd / (fd - fb)
    d31 = (a - b) * fb / (fb - fa)
    q22 = (d21 - q11) * fb / (fe - fb)
    q32 = (d31 - q21) * fa / (fd - fa)
    d32 = (d31 - q21) * fd / (fd - fa)
    q33 = (d32 - q22) * fa / (fe - fa)
    c = q31 + q32 + q33 + a
    if c <= a or c >= b:
        return _quadratic(s, 3)
    return float(c)


@kernel
def _found(s: Bracket) -> bool:
    return s.fa == 0.0 or _near(s.a, s.b)


@kernel
def root_between(p: Array, a: float, b: float) -> float:
    """Root of a polynomial between a and b, whose values have opposite signs; else `UNSURE`.

    Parameters
    ----------
    p : (n,) coefficients, the constant first
    """
    s = Bracket(a, b, _value(p, a), _value(p, b), 1e5, 1e5)
    if not (s.fa * s.fb < 0.0) or _near(a, b):
        return UNSURE
    s = _bracketed(p, s, _secant(s))
    left = _CALLS - 1
    e, fe = 1e5, 1e5
    if not _found(s):
        e, fe = s.d, s.fd
        s = _bracketed(p, s, _quadratic(s, 2))
        left -= 1
    for _ in range(_CALLS):
        if left == 0 or _found(s):
            break
        width = s.b - s.a
        c = _cubic(s, e, fe, 2)
        e, fe = s.d, s.fd
        s = _bracketed(p, s, c)
        left -= 1
        if left == 0 or _found(s):
            break
        s = _bracketed(p, s, _cubic(s, e, fe, 3))
        left -= 1
        if left == 0 or _found(s):
            break
        u, fu = (s.a, s.fa) if abs(s.fa) < abs(s.fb) else (s.b, s.fb)
        c = u - 2.0 * (fu / (s.fb - s.fa)) * (s.b - s.a)
        if abs(c - u) > (s.b - s.a) / 2.0:
            c = s.a + (s.b - s.a) / 2.0
        e, fe = s.d, s.fd
        s = _bracketed(p, s, c)
        left -= 1
        if left == 0 or _found(s) or s.b - s.a < 0.5 * width:
            continue
        e, fe = s.d, s.fd
        s = _bracketed(p, s, s.a + (s.b - s.a) / 2.0)
        left -= 1
    if left <= 0:
        return UNSURE
    end = s.a if s.fa == 0.0 or s.fb != 0.0 else s.b
    other = s.a if s.fa == 0.0 else s.b
    return end / 2.0 + other / 2.0


@kernel
def shift(p: Array) -> None:
    """Replace the coefficients (n,) of p(x) by those of p(x + 1)."""
    n = len(p)
    for i in range(n - 1):
        for k in range(n - 2, i - 1, -1):
            p[k] += p[k + 1]


@kernel
def _count_roots(p: Array, sizes: Array, moved: int, shifted: Array) -> int:
    """Sign changes of the Bernstein coefficients on (0, 1), -1 where rounding decides.

    Parameters
    ----------
    p, sizes : (n,) coefficients, and the magnitudes of what they are sums of
    moved : how often the origin was moved before: 0 if the constant is exact
    shifted : (2, n) overwritten
    """
    n = len(p)
    for k in range(n):
        shifted[0, k], shifted[1, k] = p[n - 1 - k], sizes[n - 1 - k]
    shift(shifted[0])
    shift(shifted[1])
    rounding = (moved + 1) * (2 * n + 2) * _EPS
    last, changes, doubtful = 0, 0, False
    for k in range(n):
        x = shifted[0, k]
        if abs(x) > (0.0 if k == n - 1 and moved == 0 else rounding * shifted[1, k]):
            sign = 1 if x > 0.0 else -1
            if sign == last and doubtful:
                return -1
            changes += last == -sign
            last, doubtful = sign, False
        elif last == 0 or k == n - 1:
            return -1
        else:
            doubtful = True
    return changes


@kernel
def _split(work: RootArrays, at: int) -> None:
    """Replace a waiting interval by its halves, the upper one last."""
    n = len(work.scaled)
    for row in range(2):
        p, upper, factor = work.waiting[2 * at + row], work.waiting[2 * at + 2 + row], 1.0
        for k in range(n - 1, -1, -1):
            p[k] *= factor
            factor *= 2.0
        upper[:] = p
        shift(upper)
    low, high = work.ends[at, 0], work.ends[at, 1]
    middle = low / 2.0 + high / 2.0
    work.ends[at, 1] = work.ends[at + 1, 0] = middle
    work.ends[at + 1, 1] = high


@kernel
def first_fall(guard: Array, h: float, work: RootArrays) -> float:
    """Time [s] at which a guard first falls through zero in a step; or `NO_FALL`, `UNSURE`.

    Parameters
    ----------
    guard : (n,) Taylor coefficients
    h : [s] length of the step
    """
    n, power, total = len(guard), 1.0, 0.0
    for k in range(n):
        x = guard[k] * power
        work.scaled[k] = work.waiting[0, k] = x
        work.waiting[1, k] = abs(x)
        total += abs(x)
        power *= h
    if not total < math.inf:
        return UNSURE
    work.ends[0, 0], work.ends[0, 1] = 0.0, 1.0
    first, count = math.inf, 1
    for _ in range(8 * _DEEP):
        if count == 0:
            return first if first < math.inf else NO_FALL
        count -= 1
        low, high = work.ends[count, 0], work.ends[count, 1]
        p, sizes = work.waiting[2 * count], work.waiting[2 * count + 1]
        # each half but the first is a sum from there: their number bounds its roundings
        moved = 0 if low == 0.0 else _DEEP
        changes = _count_roots(p, sizes, moved, work.shifted)
        if changes < 0 or p[0] == 0.0:
            return UNSURE
        if changes > 1:
            if count + 2 > _DEEP:
                return UNSURE
            _split(work, count)
            count += 2
        if changes == 1:
            root = root_between(work.scaled, low, high * _LAST)
            when = root * h
            if root < 0.0 or not when < h:
                return UNSURE
            if _slope(guard, when) < 0.0:
                if when == first:
                    return UNSURE
                first = min(first, when)
    return UNSURE
