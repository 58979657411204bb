"""The oil film of a short journal bearing, as heyoka expressions (``hy.cfunc`` evaluates them).

Reynolds' equation for a film of thickness ``h = c - Q.n`` between a journal and a bushing that
turn at wj and wb, Q from bushing centre to journal centre, n the normal at the angle theta:

    d/dx(h^3 dp/dx) + d/dz(h^3 dp/dz) = 12 eta ((wj + wb)/2 dh/dtheta + dh/dt) = -12 eta V.n

where ``V = Q' - (wj + wb)/2 k x Q`` is the velocity of the journal centre seen in a frame that
turns with the mean of both: rotation and squeeze are one and the same (Booker 1965, J. Basic Eng.
87:537). In a short bearing oil flows along the axis alone (Ocvirk 1952, NACA TN 2808), so that
between ends at the pressure of the supply ``p = p_s + 6 eta V.n/h^3 (L^2/4 - z^2)``, wherever that
is more than the pressure p_c at which the film ruptures. With p_s = p_c (Guembel) that is the half
circle the journal moves towards.

With more, let ``G = -6 eta V.n/h^3 L^2/4`` be the suction in mid-plane on the other half. The film
is whole where ``x = G/(p_s - p_c) < 1``, elsewhere only beside ``|z| = L/2 sqrt(1 - 1/x)``. The
mean of p over the width is ``2/3 lambda G`` below p_s, where ``lambda = 1 - (1 - 1/x)^(3/2)`` for
x > 1, and 1 before, is the share of the suction that the supply holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from math import cos, factorial, pi, sin
from typing import NamedTuple, TypeVar

import heyoka as hy
import numpy as np

from mechanism_sim.numerics.symbolic import kept
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts

T = TypeVar('T')
Vector = tuple[hy.expression, hy.expression]


class FilmShape(NamedTuple):
    """Walls that are not round, at even angles from the first axis of the motion on.

    The motion is then seen along axes of a wall.
    """

    depth: list[hy.expression]  #: [m] wear depth of both walls together
    slope: list[hy.expression]  #: [m/rad] derivative of bushing's less journal's depth
    steepest: hy.expression  #: [m/rad] approximate magnitude of the largest slope
    blur: float  #: [rad] angle over which the film's rupture is smoothed


class JournalMotion(NamedTuple):
    """Motion of a journal in its bushing, in non-rotating axes, as heyoka expressions."""

    x: hy.expression  #: [m] of Q, from bushing centre to journal centre
    y: hy.expression
    vx: hy.expression  #: [m/s] of Q', the rate of Q
    vy: hy.expression
    spin_journal: hy.expression  #: wj [rad/s]
    spin_bushing: hy.expression
    share: hy.expression | float = 1.0
    """The film is as thick as at ``share Q``: of walls that give way, no thinner than where they
    touch. The force still takes power from V, whatever the share."""
    shape: FilmShape | None = None  #: shape of worn walls; None for round ones

    @property
    def squeeze(self) -> Vector:
        """V [m/s]."""
        mean = 0.5 * (self.spin_journal + self.spin_bushing)
        return self.vx + mean * self.y, self.vy - mean * self.x

    @property
    def place(self) -> Vector:
        """Q as far as it makes the film thin [m]."""
        return self.share * self.x, self.share * self.y


def _once(make: Callable[[ShortBearing, JournalMotion], T]) -> Callable[..., T]:
    """Make equal motions give the same objects: heyoka walks through others apart, each anew."""

    @wraps(make)
    def found(film: ShortBearing, motion: JournalMotion) -> T:
        walls = (*motion.shape.depth, *motion.shape.slope) if motion.shape else ()
        key = make, film, motion.shape and (motion.shape.steepest, motion.shape.blur)
        return kept(key, lambda *_: make(film, motion), *motion[:7], *walls)

    return found


@dataclass(frozen=True)
class ShortBearing:
    """A journal carried by oil. All quantities may be heyoka parameters.

    Flaws: width beyond the radius is not short, and carries less than this says. Guembel's
    condition loses oil where the film ruptures, and refills it at once. Oil neither warms nor
    thickens under pressure, walls are smooth and rigid: by itself the film carries any load and
    the journal never touches. The law holds for ``|Q| < c`` and is not a number beyond.
    """

    viscosity: float  #: eta [Pa s]
    width: float  #: L [m]
    radius: float  #: R [m] of the journal
    clearance: float  #: c [m] radial
    full: bool = False  #: True for a film without rupture, which carries suction
    supply: float = 0.0  #: [Pa] supply pressure p_s less rupture pressure p_c

    @_once
    def force(self, motion: JournalMotion) -> Vector:
        """Force of the oil on the journal [N], through its centre; the bushing takes the opposite.

        ``F = -eta R L^3 integral of (V.n) n/h^3`` over the half circle ``V.n > 0``. With
        ``Q = c (alpha along V, beta across)``, lengths in c and
        ``A = integral of 1/h = 2 Phi/s``, ``s^2 = 1 - alpha^2 - beta^2``, ``Phi`` the angle of
        ``(-alpha, s)`` (Sommerfeld's substitution), the integrals along and across V are half of
        ``d^2 A/dalpha^2`` and of ``d^2 A/dalpha dbeta``:

            r^2 (Phi (2 + cos 2 Phi) - 3/2 sin 2 Phi)/s^5
            beta r (3 (sin Phi - Phi cos Phi) - sin^3 Phi)/s^5,  r^2 = alpha^2 + s^2

        The journal drawn off the wall makes Phi small, and both brackets vanish as ``Phi^5``: they
        are summed as power series, exact all the way from 0 to pi.

        The full circle (Sommerfeld's condition) gives ``pi/s^3`` and along Q
        ``3 pi (Q.V) Q/(c^2 s^5)`` more.

        With a supply the other half pulls, see `_suction`; of worn walls see `_between`.
        """
        if motion.shape:
            fx, fy, _, _ = self._between(motion)
            return fx, fy
        ux, uy = motion.squeeze
        x, y = motion.place
        if self.full:
            s = self._thinning(x, y)
            along = 3.0 * (x * ux + y * uy) / (self.clearance * s) ** 2
            size = pi * self.viscosity * self.radius * (self.width / (self.clearance * s)) ** 3
            return -size * (ux + along * x), -size * (uy + along * y)
        speed = hy.sqrt(ux * ux + uy * uy + _CONTACTS.film_rest * _CONTACTS.film_rest)
        c = self.clearance
        alpha = (x * ux + y * uy) / (c * speed)
        beta = (y * ux - x * uy) / (c * speed)
        s = self._thinning(x, y)
        r = hy.sqrt(alpha * alpha + s * s)
        phi = hy.atan2(s, -alpha)
        steepness = (phi / s) ** 5
        along = r * r * _even_series(phi, _ALONG) * steepness
        across = beta * r * _even_series(phi, _ACROSS) * steepness
        if self.supply:
            ratio = 1.5 * self.viscosity * self.width**2 / (c**3 * self.supply) * speed
            pull = _suction(alpha, beta, s, ratio)
            along, across = along + pull[0], across + pull[1]
        scale = self.viscosity * self.radius * (self.width / c) ** 3
        return -scale * (along * ux - across * uy), -scale * (along * uy + across * ux)

    @_once
    def moments(self, motion: JournalMotion) -> Vector:
        """Moments of the oil's shear on journal and bushing [N m], about the centre of each.

        The shear at the walls is ``-h/2 dp/dx`` on both, and ``-+ eta R (wj - wb)/h``: integrated
        (the first by parts), each takes half of ``-Q x F``, and the film drags with
        ``2 pi eta L R^3 (wj - wb)/(c s)`` (Petroff's, for s = 1). The power of force and moments
        is then ``F.V`` less the drag times ``wj - wb``: never positive.
        The ruptured half is made to drag like the full one: rather too much. On worn walls the
        pressure has a moment, half of which the shear passes on.
        """
        petroff = 2.0 * pi * self.viscosity * self.width * self.radius**3 / self.clearance
        slip = motion.spin_journal - motion.spin_bushing
        if motion.shape:
            fx, fy, turning, thin = self._between(motion)
            drag = petroff * slip * thin - 0.5 * turning
        else:
            fx, fy = self.force(motion)
            drag = petroff * slip / self._thinning(*motion.place)
        couple = 0.5 * (motion.x * fy - motion.y * fx)
        return -couple - drag, -couple + drag

    def turning(self, motion: JournalMotion) -> hy.expression:
        """``(Q/c) x V + (Q/c).V`` [m/s], whose sign changes where V turns back.

        However near to zero V passes, it turns by half a turn meanwhile, and so through one of the
        directions at 45 degrees to Q in which this vanishes; along a line through the middle, or
        along a wall, one of the two parts would be nothing but rounding.
        """
        ux, uy = motion.squeeze
        x, y = motion.x / self.clearance, motion.y / self.clearance
        return x * (ux + uy) + y * (uy - ux)

    @_once
    def _between(
        self, motion: JournalMotion
    ) -> tuple[hy.expression, hy.expression, hy.expression, hy.expression]:
        """Force on the journal (x, y) and moment of the pressure between worn walls, mean of c/h.

        Depths b of the bushing and j of the journal, each turning with its own wall, make the film
        ``h = c + b + j - Q.n`` thick and add ``-(wj - wb)/2 (b' - j')`` to V.n: what is left, v,
        is positive where it presses. Then ``F = -eta R L^3 integral of v n/h^3``, and

            M = eta R L^3 integral of v (b' - j')/h^3

        is what the pressure turns both walls by, in opposite directions, so that the power of all
        is ``-eta R L^3 integral of v^2/h^3`` less that of the drag. The integrals are sums at even
        angles. The pressure ends over an angle where it ruptures (`FilmShape.blur`), so that F is
        smooth: it is within 1.5 % of the integral where walls touch, and nearer elsewhere.
        """
        shape = motion.shape
        assert shape  # noqa: S101 - given
        ux, uy = motion.squeeze
        x, y = motion.place
        half_slip = 0.5 * (motion.spin_journal - motion.spin_bushing)
        steepest, rest = shape.steepest * half_slip, _CONTACTS.film_rest
        fastest = ux * ux + uy * uy + steepest * steepest + rest * rest
        blur = shape.blur**4 * fastest * fastest
        c, step = self.clearance, 2.0 * pi / len(shape.depth)
        ratio = 1.5 * self.viscosity * self.width**2 / (c**3 * self.supply) if self.supply else 0.0
        thins: list[hy.expression] = []
        sums: tuple[list[hy.expression], ...] = [], [], []
        for k, (depth, slope) in enumerate(zip(shape.depth, shape.slope, strict=True)):
            n = cos(k * step), sin(k * step)
            thin = c / (c + depth - n[0] * x - n[1] * y)
            v = n[0] * ux + n[1] * uy - half_slip * slope
            presses = v * thin * thin * thin
            if not self.full:
                fourth = v * v * v * v
                size = hy.sqrt(hy.sqrt(fourth + blur))  # of v, rounded at its zero
                if ratio:
                    presses *= _held(0.5 * (size - v) * ratio * thin * thin * thin)
                else:  # by 3/2 the integral over the rupture is that of its sudden end
                    sharp = v * (fourth + 1.5 * blur) / (size * (fourth + blur))
                    presses *= 0.5 + 0.5 * sharp
            thins.append(thin)
            for terms, arm in zip(sums, (*n, slope), strict=True):
                terms.append(arm * presses)
        scale = step * self.viscosity * self.radius * (self.width / c) ** 3
        fx, fy, turning = (scale * hy.sum(terms) for terms in sums)
        return -fx, -fy, turning, hy.sum(thins) / len(thins)

    def _thinning(self, x: hy.expression, y: hy.expression) -> hy.expression:
        """``s = sqrt(1 - Q.Q/c^2)``."""
        return hy.sqrt(1.0 - (x * x + y * y) / (self.clearance * self.clearance))


def _suction(
    alpha: hy.expression, beta: hy.expression, s: hy.expression, ratio: hy.expression
) -> Vector:
    """Integral of ``cos chi lambda(x)/H^3 (cos chi, sin chi)`` over the half that draws.

    chi is the angle from -V, ``H = 1 + alpha cos chi + beta sin chi`` the thickness over c, and
    ``x = ratio cos chi/H^3``. In Sommerfeld's angle, of which omega is half, with

        p = (1 - alpha) cos omega,  q = s sin omega - beta cos omega,  n = s^2 (1 - alpha)
        cos chi/H = (p^2 - q^2)/n,  sin chi/H = 2 p q/n,  1/H = (p^2 + q^2)/n,  dchi/H = 2 domega/s

    Gauss's quadrature is exact to rounding while the film is whole, lambda = 1, and within 2e-3 of
    the full film's force otherwise. All weights are positive: what it holds never makes energy.
    """
    upper, lower = hy.atan2(1.0 - alpha - beta, s), hy.atan2(1.0 - alpha + beta, s)
    middle, half = 0.5 * (lower - upper), 0.5 * (lower + upper)
    n = s * s * (1.0 - alpha)
    along: list[hy.expression] = []
    across: list[hy.expression] = []
    for node, weight in zip(*_NODES, strict=True):
        omega = middle + node * half
        p = (1.0 - alpha) * hy.cos(omega)
        q = s * hy.sin(omega) - beta * hy.cos(omega)
        cosine, sine, thin = (p * p - q * q) / n, 2.0 * p * q / n, (p * p + q * q) / n
        held = weight * cosine * _held(ratio * cosine * thin * thin)
        along.append(held * cosine)
        across.append(held * sine)
    size = 2.0 * half / s
    return size * hy.sum(along), size * hy.sum(across)


def _held(x: hy.expression) -> hy.expression:
    """lambda, by a function that is smooth where the film begins to rupture.

    ``(1 + a t^4 + b t^5 + c t^6 + 4/3 t^7 + t^8)^(-1/8)``, t = 2/3 x, which has the first two
    terms of lambda for large x, ``1/t - 1/(6 t^2)``; a, b, c by least errors: it is within 0.0085.
    """
    t = (2.0 / 3.0) * x
    square = t * t
    powers = square * square * (-3.54 + t * (3.7 + t * (1.8 + t * (4.0 / 3.0 + t))))
    return 1.0 / hy.sqrt(hy.sqrt(hy.sqrt(1.0 + powers)))


_NODES = [x.tolist() for x in np.polynomial.legendre.leggauss(16)]

# Coefficients of phi^(2k-4), k = 2, 3, ..., in the brackets of the force over phi^5; at phi = pi
# the terms left out are below a rounding error.
_ALONG = [(-4.0) ** k * (2 * k - 2) / factorial(2 * k + 1) for k in range(2, 22)]
_ACROSS = [
    (-1.0) ** k * (3 ** (2 * k + 1) - 3 - 24 * k) / 4 / factorial(2 * k + 1) for k in range(2, 26)
]


def _even_series(x: hy.expression, coefficients: list[float]) -> hy.expression:
    """Sum of ``coefficients[j] x^(2 j)``, by Horner's rule."""
    square, total = x * x, coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = coefficient + square * total
    return total
