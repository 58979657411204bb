"""Divided differences of the exponential, the terms of responses of linear systems.

With the roots r of its characteristic equation, an oscillator answers to a blow with the divided
difference of e^(x t) over r0, r1, and to a force e^(s t) with that over r0, r1, s. Where nodes
coincide (critical damping, resonance) these are the limits, and near them they lose no digits, as
the quotients of [V] eqs. 6.46 and 6.62 do.

The method, a series for close nodes and the recurrence over the farthest for others, is that of
McCurdy, Ng and Parlett, Math. Comp. 43 (1984).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

ComplexArray = NDArray[np.complex128]

#: the terms left out are below 1e-17 for nodes whose distances times t are less than one
TERMS = 18


def first_difference(x0: ArrayLike, x1: ArrayLike, t: ArrayLike) -> ComplexArray:
    """(e^(x0 t) - e^(x1 t))/(x0 - x1) [s]; t e^(x0 t) where both nodes are the same.

    Parameters
    ----------
    x0, x1 : nodes [1/s], complex
    t : times [s], not negative; all are broadcast
    """
    x0, x1, t = _broadcast(x0, x1, t)
    swap = x1.real > x0.real  # so that nothing overflows
    x0, x1 = np.where(swap, x1, x0), np.where(swap, x0, x1)
    z = (x1 - x0) * t
    small = z == 0.0
    mean = np.where(small, 1.0, np.expm1(z) / np.where(small, 1.0, z))
    return np.asarray(t * np.exp(x0 * t) * mean)


def second_difference(x0: ArrayLike, x1: ArrayLike, x2: ArrayLike, t: ArrayLike) -> ComplexArray:
    """Divided difference of e^(x t) over three nodes [s^2]; t^2/2 e^(x0 t) where all are equal.

    Parameters
    ----------
    x0, x1, x2 : nodes [1/s], complex
    t : times [s], not negative; all are broadcast
    """
    x0, x1, x2, t = _broadcast(x0, x1, x2, t)
    gaps = np.abs([x0 - x1, x1 - x2, x2 - x0])
    widest = gaps.argmax(axis=0)
    # the middle node is the one opposite to the widest gap
    a, b, c = (np.choose(widest, nodes) for nodes in ((x0, x1, x2), (x2, x0, x1), (x1, x2, x0)))
    gap = a - c
    far = np.abs(gap * t) >= 1.0
    apart = (first_difference(a, b, t) - first_difference(b, c, t)) / np.where(far, gap, 1.0)
    return np.where(far, apart, _close(a, b, c, np.where(far, 0.0, t)))


def _close(x0: ComplexArray, x1: ComplexArray, x2: ComplexArray, t: ComplexArray) -> ComplexArray:
    """The series in the complete symmetric polynomials of the nodes about their mean."""
    mean = (x0 + x1 + x2) / 3.0
    d0, d1, d2 = (x0 - mean) * t, (x1 - mean) * t, (x2 - mean) * t
    e2, e3 = d0 * d1 + d1 * d2 + d2 * d0, d0 * d1 * d2
    h = [np.ones_like(mean), np.zeros_like(mean), -e2]
    total, factor = 0.5 * h[0], 0.5
    for k in range(1, TERMS):
        factor /= k + 2
        if k > 2:
            h.append(e3 * h[k - 3] - e2 * h[k - 2])
        total = total + factor * h[k]
    return np.asarray(t**2 * np.exp(mean * t) * total)


def _broadcast(*values: ArrayLike) -> list[ComplexArray]:
    return [np.array(v) for v in np.broadcast_arrays(*(np.asarray(v, complex) for v in values))]
