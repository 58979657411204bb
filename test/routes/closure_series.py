"""Plane vectors that move, as Taylor series in time, and their rates at a dead point.

A series is an array whose first axis holds the coefficients of 1, t, t^2, t^3: the value, the
rate, half the acceleration, a sixth of its rate. The closure of a loop is then one equation for
each order, linear in the coefficients of that order.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
LeftSide = Callable[[Array], Complex]  # (2, 4, B, N) of the unknowns to (4, B, N)

_ORDERS = 4
_OPEN = 1e-4  # [-] part of the speed that a dead point may leave over and still count as passed


class Motion(NamedTuple):
    """A length [m], an angle [rad] or a vector (2, N) [m] over N instants, with its derivatives.

    `jerk`, the third derivative, is needed for accelerations at singular positions only.
    """

    value: Array
    rate: Array
    acceleration: Array
    jerk: Array | None = None


Quantity = Motion | ArrayLike  # what is not a motion stands still


def series(quantity: Quantity) -> Array:
    """Coefficients, shape (4, 1, N); an unknown third derivative is NaN."""
    return _coefficients(_moving(quantity), np.dtype(np.float64))


def vector_series(vector: Motion | Array) -> Complex:
    """Coefficients, shape (4, 1, N), of a vector of shape (2, N) as complex numbers."""
    parts = [None if x is None else np.asarray(x) for x in _moving(vector)]
    x, y, z, jerk = (None if w is None else w[0] + 1j * w[1] for w in parts)
    return _coefficients(Motion(x, y, z, jerk), np.dtype(np.complex128))  # type: ignore[arg-type]


def _moving(quantity: Quantity) -> Motion:
    if isinstance(quantity, Motion):
        return quantity
    value = np.asarray(quantity, dtype=np.float64)
    return Motion(value, *(np.zeros_like(value) for _ in range(3)))


def _coefficients(motion: Motion, dtype: np.dtype[Any]) -> NDArray[Any]:
    value, rate, acceleration, jerk = motion
    parts = (value, rate, np.asarray(acceleration) / 2.0, np.nan if jerk is None else jerk / 6.0)
    return np.array(np.broadcast_arrays(*np.atleast_1d(*parts)), dtype=dtype)[:, None]


def polar(length: Array, angle: Array) -> Complex:
    """Coefficients of the vector ``length u(angle)``.

    The unit vector e obeys e' = i angle' e, so k e_k = i sum_m m angle_m e_(k-m); and the product
    of two series is Cauchy's.
    """
    e = [np.exp(1j * angle[0])]
    for k in range(1, _ORDERS):
        e.append(1j / k * sum(m * angle[m] * e[k - m] for m in range(1, k + 1)))
    return np.array([sum(length[m] * e[k - m] for m in range(k + 1)) for k in range(_ORDERS)])


def cross(a: Complex, b: Complex) -> Array:
    """The number ax by - ay bx."""
    return np.imag(np.conj(a) * b)


def dot(a: Complex, b: Complex) -> Array:
    """The number ax bx + ay by."""
    return np.real(np.conj(a) * b)


def limit_of_rates(
    b: Complex,
    left: LeftSide,
    position: Array,
    columns: tuple[Complex, Complex],
    size: Array,
    side: Array,
) -> Array:
    """Rates and halved accelerations, shape (2, 2, B, N), where p and q are parallel.

    This is L'Hopital's rule, order by order. With p, q along t and n square to t, the first order
    gives ``p x' + q y' = c`` along t only, and something that b must obey across it: n.c = 0. So
    the rates are known up to ``lambda (q.t, -p.t)``. Across t, the second order holds neither x''
    nor y'', and is a quadratic equation for lambda: two motions pass through the point. Its
    derivative by lambda is the rate of p x q, hence the root in which p x q gets the sign of the
    branch, `side` (B, 1), afterwards. The third order likewise ends the accelerations.

    NaN where n.c is not zero (no speed is finite), where the roots are complex (the position
    stands alone), and for accelerations where the roots coincide. `size` is that of the loop [m].
    """
    p, q = columns
    t = p / np.abs(p)
    null = np.array([dot(t, q), -np.abs(p)])
    x = np.zeros((2, _ORDERS, *position.shape[1:]))
    x[:, 0] = position

    def left_over(order: int) -> Complex:
        rest: Complex = b[order] - left(x)[order]
        return rest

    def across(order: int, part: Array | float) -> Array:
        held = x[:, order].copy()
        x[:, order] += part * null
        value = cross(t, left_over(order + 1))
        x[:, order] = held
        return value

    resting = left(x)
    speed = np.abs(b[1]) + np.abs(resting[1])
    speed = speed + np.sqrt(size * (np.abs(b[2]) + np.abs(resting[2])))
    passes = np.abs(cross(t, left_over(1))) <= _OPEN * speed
    x[0, 1] = dot(t, left_over(1)) / np.abs(p)

    # The quadratic in lambda/unit, from three of its values.
    arm = np.abs(p * null[0])
    unit = speed / np.where(arm > 1e-9 * size, arm, size)
    unit = np.where(unit > 0.0, unit, 1.0)
    none, more, less = across(1, 0.0), across(1, unit), across(1, -unit)
    second, first = (more + less) / 2.0 - none, (more - less) / 2.0
    scale = np.abs(second) + np.abs(first) + np.abs(none)
    bent = np.abs(second) > 1e-9 * scale
    discriminant = first**2 - 4.0 * second * none
    discriminant = np.where(np.abs(discriminant) < 1e-12 * scale**2, 0.0, discriminant)
    root = np.sqrt(discriminant) * np.where(bent, side, np.sign(first))
    small = bent & (first * root <= 0.0)  # which of two forms adds and does not cancel
    x[:, 1] += (
        unit
        * null
        * np.where(small, (root - first) / (2.0 * second), -2.0 * none / (first + root))
    )

    x[0, 2] = dot(t, left_over(2)) / np.abs(p)
    none = across(2, 0.0)
    slope = np.where(root == 0.0, np.nan, across(2, unit**2) - none)
    x[:, 2] -= unit**2 * null * none / slope
    return np.where(passes, x[:, 1:3], np.nan)
