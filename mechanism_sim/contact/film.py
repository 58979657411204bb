"""The oil film of a short journal bearing, as heyoka expressions (``hy.cfunc`` evaluates them).

Reynolds' equation for a film of thickness ``h = c - Q.n`` between a journal and a bushing that
turn at wj and wb, Q from bushing centre to journal centre, n the normal at the angle theta:

    d/dx(h^3 dp/dx) + d/dz(h^3 dp/dz) = 12 eta ((wj + wb)/2 dh/dtheta + dh/dt) = -12 eta V.n

where ``V = Q' - (wj + wb)/2 k x Q`` is the velocity of the journal centre seen in a frame that
turns with the mean of both: rotation and squeeze are one and the same (Booker 1965, J. Basic Eng.
87:537). In a short bearing oil flows along the axis alone (Ocvirk 1952, NACA TN 2808), so that
``p = 6 eta V.n/h^3 (L^2/4 - z^2)``, wherever that is positive (Guembel): the half circle the
journal moves towards.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial, pi

import heyoka as hy

REST = 1e-12
"""Speed [m/s] below which V has no direction: at V = 0 the film's slope in V is not unique."""


@dataclass(frozen=True)
class ShortBearing:
    """A journal carried by oil. All quantities may be heyoka parameters.

    The arguments of both methods are heyoka expressions: Q = (x, y) [m] from bushing centre to
    journal centre, its rate (vx, vy) [m/s] in axes that do not turn, and both spins [rad/s].

    Flaws: width beyond the radius is not short, and carries less than this says. Guembel's
    condition loses oil where the film ruptures, and refills it at once. Oil neither warms nor
    thickens under pressure, walls are smooth and rigid: by itself the film carries any load and
    the journal never touches. The law holds for ``|Q| < c`` and is not a number beyond.
    """

    viscosity: float  #: eta [Pa s]
    width: float  #: L [m]
    radius: float  #: R [m] of the journal
    clearance: float  #: c [m] radial
    full: bool = False  #: whether the supply keeps it from rupturing: pressures below it pull

    def force(
        self,
        x: hy.expression,
        y: hy.expression,
        vx: hy.expression,
        vy: hy.expression,
        spin_journal: hy.expression,
        spin_bushing: hy.expression,
        share: hy.expression | float = 1.0,
    ) -> tuple[hy.expression, hy.expression]:
        """Force of the oil on the journal [N], through its centre; the bushing takes the opposite.

        The film is as thick as at ``share Q``: of walls that give way, no thinner than where they
        touch. The force still takes power from V, whatever the share.

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
        """
        ux, uy = _squeeze(x, y, vx, vy, spin_journal, spin_bushing)
        x, y = share * x, share * y
        if self.full:
            s = self._thinning(x, y)
            along = 3.0 * (x * ux + y * uy) / (self.clearance * s) ** 2
            size = pi * self.viscosity * self.radius * (self.width / (self.clearance * s)) ** 3
            return -size * (ux + along * x), -size * (uy + along * y)
        speed = hy.sqrt(ux * ux + uy * uy + REST * REST)
        c = self.clearance
        alpha = (x * ux + y * uy) / (c * speed)
        beta = (y * ux - x * uy) / (c * speed)
        s = self._thinning(x, y)
        r = hy.sqrt(alpha * alpha + s * s)
        phi = hy.atan2(s, -alpha)
        steepness = (phi / s) ** 5
        along = r * r * _even_series(phi, _ALONG) * steepness
        across = beta * r * _even_series(phi, _ACROSS) * steepness
        scale = self.viscosity * self.radius * (self.width / c) ** 3
        return -scale * (along * ux - across * uy), -scale * (along * uy + across * ux)

    def moments(
        self,
        x: hy.expression,
        y: hy.expression,
        vx: hy.expression,
        vy: hy.expression,
        spin_journal: hy.expression,
        spin_bushing: hy.expression,
        share: hy.expression | float = 1.0,
    ) -> tuple[hy.expression, hy.expression]:
        """Moments of the oil's shear on journal and bushing [N m], about the centre of each.

        The shear at the walls is ``-h/2 dp/dx`` on both, and ``-+ eta R (wj - wb)/h``: integrated
        (the first by parts), each takes half of ``-Q x F``, and the film drags with
        ``2 pi eta L R^3 (wj - wb)/(c s)`` (Petroff's, for s = 1). The power of force and moments
        is then ``F.V`` less the drag times ``wj - wb``: never positive.
        The ruptured half is made to drag like the full one: rather too much.
        """
        fx, fy = self.force(x, y, vx, vy, spin_journal, spin_bushing, share)
        couple = 0.5 * (x * fy - y * fx)
        petroff = 2.0 * pi * self.viscosity * self.width * self.radius**3 / self.clearance
        drag = petroff * (spin_journal - spin_bushing) / self._thinning(share * x, share * y)
        return -couple - drag, -couple + drag

    def across(
        self,
        x: hy.expression,
        y: hy.expression,
        vx: hy.expression,
        vy: hy.expression,
        spin_journal: hy.expression,
        spin_bushing: hy.expression,
    ) -> hy.expression:
        """``(Q/c) x V`` [m/s]: to which side of Q the journal moves."""
        ux, uy = _squeeze(x, y, vx, vy, spin_journal, spin_bushing)
        return (x * uy - y * ux) / self.clearance

    def _thinning(self, x: hy.expression, y: hy.expression) -> hy.expression:
        """``s = sqrt(1 - Q.Q/c^2)``."""
        return hy.sqrt(1.0 - (x * x + y * y) / (self.clearance * self.clearance))


def _squeeze(
    x: hy.expression,
    y: hy.expression,
    vx: hy.expression,
    vy: hy.expression,
    spin_journal: hy.expression,
    spin_bushing: hy.expression,
) -> tuple[hy.expression, hy.expression]:
    """V [m/s]."""
    mean = 0.5 * (spin_journal + spin_bushing)
    return vx + mean * y, vy - mean * x


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
