"""Loop closure of simple planar mechanisms in closed form: the five cases of [V] 2.3 to 2.5.

The vectors of a loop add up to nothing. With all that is known moved to the right side, b, two
numbers on the left are unknown ([V] 2.15):

====================================  =======================================  ==============
function                              left side                                unknown
====================================  =======================================  ==============
`close_vector` (first case)           r_j u(th_j)                              r_j, th_j
`close_length_and_angle` (second)     r_i u(th_i) + r_j u(th_j)                r_i, th_j
`close_two_lengths` (third)           r_i u(th_i) + r_j u(th_j)                r_i, r_j
`close_two_angles` (fourth)           r_i u(th_i) + r_j u(th_j)                th_i, th_j
`close_tied_directions` (fifth)       r_i u(th) + r_j u(th - gamma)            r_j, th
                                      + r_k u(th - beta)
====================================  =======================================  ==============

Everything known may move. Each function returns a `Closure`: position, rate and acceleration of
the unknowns at N instants, in one branch or both. Plane vectors are complex numbers inside.

Rates and accelerations are not those printed in [V], but the closure differentiated: with p and q,
the derivatives of the left side by the unknowns x and y, every order reads p x^(k) + q y^(k) = c,
where c is known from the orders below, and one unknown drops out by projection on the normal of
the other's direction: x^(k) = (c x q)/(p x q), y^(k) = (p x c)/(p x q). `closure_series` says
what happens where p and q are parallel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from closure_series import (
    Array,
    Complex,
    LeftSide,
    Motion,
    Quantity,
    cross,
    limit_of_rates,
    polar,
    series,
    vector_series,
)
from numpy.typing import NDArray

#: [-] the sine below which a position counts as singular. At a distance s from a dead point the
#: rates solved for are wrong by eps/s^2, and those of the dead point by s: both small at eps^(1/3)
SINGULAR = 6e-6
_EPS = float(np.finfo(np.float64).eps)
_SIDES = np.array([[1.0], [-1.0]])  # the signs of the roots in 2.31, 2.42 and 2.50


@dataclass(frozen=True)
class Closure:
    """The closed loop at N instants in B branches; angles are in (-pi, pi].

    Where the loop cannot be closed all numbers are NaN. The two branches are those with the upper
    and with the lower sign in the book's equation; one case has B = 1 where nothing can be chosen.

    `first` and `second` are the motions of the two unknowns, (B, N) each. `determinant` (B, N) is
    p x q over the lengths of p and q: the sine of the angle between the directions in which the
    two unknowns move the end of the left side (in the first case, r_j over the largest r_j). Where
    it is less than 6e-6 (in the first case, zero to rounding) the position is `singular`
    and the linear equations for the rates say nothing: a dead point, where both branches meet.
    There rates and accelerations are the limits along the motion from *later* instants, branch by
    branch, as far as they exist; the limits from earlier instants are those of the other branch.
    They do not exist, and are NaN, where b drives the loop apart at the dead point (speeds grow
    beyond all bounds, as when a piston is pushed at a steady speed through its dead point).
    Accelerations there need the third derivatives of what is known and are NaN without.
    """

    first: Motion
    second: Motion
    determinant: Array
    singular: NDArray[np.bool_]
    angular: tuple[bool, bool]  #: which of the unknowns are angles
    reach: Array  #: (2, B, N) |p| and |q|: how far the end moves by a unit of each unknown

    def follow(self, t: Array, branch: int = 0) -> tuple[Motion, Motion]:
        """The motions (N,) of the unknowns that go on smoothly through dead points.

        Parameters
        ----------
        t : ndarray, shape (N,)
            Instants [s], in order, and close enough for a parabola to tell the branches apart.
        branch : of the first instant
        """
        x = np.array([[m.value, m.rate, m.acceleration] for m in (self.first, self.second)])
        known = np.nan_to_num(x)
        angular = np.array(self.angular)
        chosen = np.full(len(t), branch)
        for k in range(1, len(t)):
            value, rate, acceleration = known[:, :, chosen[k - 1], k - 1].T
            dt = t[k] - t[k - 1]
            ahead = value + dt * (rate + 0.5 * dt * acceleration)
            off = x[:, 0, :, k] - ahead[:, None]
            off = np.where(angular[:, None], np.angle(np.exp(1j * off)), off)
            turn = dt * np.nan_to_num(x[:, 1, :, k] - (rate + dt * acceleration)[:, None])
            cost = np.sum(self.reach[:, :, k] ** 2 * (off**2 + turn**2), axis=0)
            chosen[k] = np.argmin(np.nan_to_num(cost, nan=np.inf))
        along = np.take_along_axis(x, chosen[None, None, None, :], axis=2)[:, :, 0]
        return Motion(*along[0]), Motion(*along[1])


def close_vector(b: Motion | Array) -> Closure:
    """One vector of unknown length and direction: first case ([V] 2.16, 2.27).

    Parameters
    ----------
    b : right side, shape (2, N) [m]

    Returns
    -------
    Length r_j >= 0 [m] and angle th_j [rad] in one branch. Where b vanishes the direction is that
    of b' (the limit from later instants; a vector that goes on smoothly would change the sign of
    its length).
    """
    z = vector_series(b)
    largest = float(np.nanmax(np.abs(z[0]), initial=0.0)) or 1.0
    vanishes = np.abs(z[0]) <= 4.0 * _EPS * largest
    angle = np.angle(np.where(vanishes, z[1], z[0]))
    angle = np.where(vanishes & (z[1] == 0.0), np.nan, angle)
    length = np.abs(z[0])
    p = np.exp(1j * angle)
    scale = np.full_like(length, largest)
    return _close(
        z, lambda x: polar(x[0], x[1]), (length, angle), (p, 1j * length * p),
        scale, scale, np.ones((1, 1)), (False, True), 4.0 * _EPS,
    )  # fmt: skip


def close_length_and_angle(b: Motion | Array, angle: Quantity, length: Quantity) -> Closure:
    """A length and the angle of another vector: second case ([V] 2.28 to 2.33).

    Parameters
    ----------
    b : right side, shape (2, N) [m]
    angle : th_i of the vector of unknown length [rad]
    length : r_j of the vector of unknown angle [m]

    Returns
    -------
    r_i [m], of either sign, and th_j [rad]; the branches are the signs in 2.31.
    """
    z, th, r = vector_series(b), series(angle), series(length)
    u = np.exp(1j * th[0])
    turned = np.conj(u) * z[0]
    off, size = turned.imag, np.abs(r[0])
    square = (size - off) * (size + off) / size**2
    side = _SIDES * size * _root(square, 1.0 + np.abs(z[0]) / size)
    end = u * (1j * off - side)  # r_j u(th_j)
    return _close(
        z, lambda x: polar(x[0], th) + polar(r, x[1]),
        (turned.real + side, np.angle(end * r[0])), (u, 1j * end),
        size, size + np.abs(z[0]), -_SIDES, (False, True),
    )  # fmt: skip


def close_two_lengths(b: Motion | Array, angle_i: Quantity, angle_j: Quantity) -> Closure:
    """Two lengths: third case ([V] 2.34, 2.35).

    Parameters
    ----------
    b : right side, shape (2, N) [m]
    angle_i, angle_j : of the two vectors [rad]

    Returns
    -------
    r_i, r_j [m], of either sign, in one branch. Where the two directions are parallel and b has
    the same direction, the limit follows from b': it exists if they turn at different rates.
    """
    z, th_i, th_j = vector_series(b), series(angle_i), series(angle_j)
    u_i, u_j = np.exp(1j * th_i[0]), np.exp(1j * th_j[0])
    sine = cross(u_i, u_j)
    with np.errstate(all='ignore'):
        r_i, r_j = cross(z[0], u_j) / sine, cross(u_i, z[0]) / sine
        # In line (u_j = same u_i), r_i + same r_j = u_i.b; across, what turns must make up b'.
        same = np.sign(np.real(np.conj(u_i) * u_j))
        along, across = np.conj(u_i) * z[0], np.imag(np.conj(u_i) * z[1])
        limit = (across - th_j[1] * along.real) / (th_i[1] - th_j[1])
        limit = np.where(np.abs(along.imag) < SINGULAR * np.abs(along), limit, np.nan)
        limit = np.where(np.isfinite(limit), limit, np.nan)
    parallel = np.abs(sine) < np.sqrt(_EPS)
    r_i = np.where(parallel, limit, r_i)
    r_j = np.where(parallel, same * (along.real - limit), r_j)
    one = np.ones_like(sine)
    return _close(
        z, lambda x: polar(x[0], th_i) + polar(x[1], th_j), (r_i, r_j), (u_i, u_j),
        one, np.abs(r_i) + np.abs(r_j), np.ones((1, 1)), (False, False),
    )  # fmt: skip


def close_two_angles(b: Motion | Array, length_i: Quantity, length_j: Quantity) -> Closure:
    """Two angles: fourth case ([V] 2.36 to 2.44).

    Parameters
    ----------
    b : right side, shape (2, N) [m]
    length_i, length_j : of the two vectors [m]

    Returns
    -------
    th_i, th_j [rad]; the branches are the signs of C in 2.42: in the first one the vector i lies
    clockwise of b. NaN where b = 0, which leaves the direction open.
    """
    z, r_i, r_j = vector_series(b), series(length_i), series(length_j)
    a, c, d = np.abs(r_i[0]), np.abs(r_j[0]), np.abs(z[0])
    with np.errstate(all='ignore'):
        # Heron's formula: the sine between the two, exact also where the triangle is flat
        square = (c - d + a) * (c + d - a) * (d + a - c) * (d + a + c) / (2.0 * a * c) ** 2
        sine = _root(square, (a + c + d) / np.minimum(a, c))
        along = (d - (c - a) * (c + a) / d) / 2.0
        off = _SIDES * sine * a * c / d
        to_i = z[0] / d * (along - 1j * off)
        to_j = z[0] / d * (d - along + 1j * off)
    return _close(
        z, lambda x: polar(r_i, x[0]) + polar(r_j, x[1]),
        (np.angle(to_i * r_i[0]), np.angle(to_j * r_j[0])), (1j * to_i, 1j * to_j),
        a * c, a + c, _SIDES, (True, True),
    )  # fmt: skip


def close_tied_directions(
    b: Motion | Array, length_i: Quantity, length_k: Quantity, gamma: Quantity, beta: Quantity
) -> Closure:
    """A length, and an angle to which all directions are tied: fifth case ([V] 2.45 to 2.53).

    Parameters
    ----------
    b : right side, shape (2, N) [m]
    length_i, length_k : of the vectors at th and th - beta [m]
    gamma, beta : angles by which the vectors j and k lag behind i [rad]

    Returns
    -------
    r_j [m], of either sign, and th [rad]; the branches are the signs in 2.50. NaN where b = 0.
    """
    z = vector_series(b)
    r_i, r_k, gam, bet = series(length_i), series(length_k), series(gamma), series(beta)
    d = np.abs(z[0])
    fixed = r_i[0] * np.exp(1j * gam[0]) + r_k[0] * np.exp(
        1j * (gam[0] - bet[0])
    )  # beside u(th_j)
    size = d + np.abs(r_i[0]) + np.abs(r_k[0])
    with np.errstate(all='ignore'):
        square = (d - fixed.imag) * (d + fixed.imag) / d**2
        side = _SIDES * d * _root(square, size / d)
        u_j = z[0] / d * np.conj(side + 1j * fixed.imag) / d
    return _close(
        z,
        lambda x: polar(r_i, x[1]) + polar(x[0], x[1] - gam) + polar(r_k, x[1] - bet),
        (side - fixed.real, np.angle(u_j * np.exp(1j * gam[0]))), (u_j, 1j * z[0]),
        d, size, _SIDES, (False, True),
    )  # fmt: skip


def _root(square: Array, size: Array | float) -> Array:
    """Root of the square of a sine: zero within its rounding, NaN below."""
    with np.errstate(invalid='ignore'):
        return np.sqrt(np.where(np.abs(square) < 8.0 * _EPS * size, 0.0, square))


def _close(
    b: Complex,
    left: LeftSide,
    position: tuple[Array, Array],
    columns: tuple[Complex, Complex],
    scale: Array,
    size: Array,
    side: Array,
    angular: tuple[bool, bool],
    threshold: float = SINGULAR,
) -> Closure:
    """Rates and accelerations to a position; `scale` is that of p x q, `size` that of the loop.

    `side` (B, 1) is the sign of p x q in each branch.
    """
    at = np.array(np.broadcast_arrays(*position))
    p, q = (np.broadcast_to(column, at[0].shape) for column in columns)
    x = np.zeros((2, 4, *at[0].shape))
    x[:, 0] = np.where(np.isfinite(at).all(axis=0), at, np.nan)
    with np.errstate(all='ignore'):
        d = cross(p, q)
        for order in (1, 2):
            c = b[order] - left(x)[order]
            x[:, order] = cross(c, q) / d, cross(p, c) / d
        measure = np.where(np.isnan(x[0, 0]), np.nan, d / scale)
        singular = np.abs(measure) < threshold
        if singular.any():
            limit = limit_of_rates(b, left, x[:, 0], (p, q), size, side)
            x[:, 1:3] = np.where(singular, limit, x[:, 1:3])
    first, second = (Motion(u[0], u[1], 2.0 * u[2]) for u in x)
    return Closure(first, second, measure, singular, angular, np.abs(np.array([p, q])))
