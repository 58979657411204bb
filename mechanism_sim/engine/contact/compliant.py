"""Compliant contact: the normal force as a law of depth and rate (friction: `engine/dynamics`).

Every law is arithmetic on what it is given: numbers, arrays (elementwise) and heyoka expressions
all serve, for the parameters too, so that a parameter of a compiled scene may take their place.

The contact is closed and ``depth > 0``. An impact that nothing else disturbs never pulls, but
bodies torn apart faster than ``approach/damping`` would be held back: there the contact carries no
force (`CompliantLaw.relief`). The force is not clipped, since it would have no Taylor series where
the clip sets in: an event separates the two cases. Nor has ``depth^(3/2)`` a series at zero: a
Taylor integration begins a little inside, 1e-15 m for one of order 20, lest coefficients overflow.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple, TypeAlias

Quantity: TypeAlias = Any
"""A number, an array, or a heyoka expression; heyoka itself is not typed."""


class CompliantLaw(ABC):
    """Common form of the laws: ``N = K delta^n (1 + a delta'/v0)``, a their damping.

    Flaws of the form itself: the contact ends without a dent, at depth zero; and the damping
    remembers the speed v0 of the first touch as long as the contact lasts. A contact that begins
    at no speed at all has no damping defined: its v0 is its `loading_speed`.

    Attributes
    ----------
    stiffness : K [N/m^n]
    exponent : n, 3/2 after Hertz
    """

    stiffness: Quantity
    exponent: Quantity

    @property
    @abstractmethod
    def damping(self) -> Quantity:
        """The dimensionless a; the hysteresis damping factor of the literature is ``a K/v0``."""

    def normal_force(self, depth: Quantity, rate: Quantity, approach: Quantity) -> Quantity:
        """Normal force on the bodies, repulsive [N].

        Parameters
        ----------
        depth : delta > 0 [m]
        rate : delta' [m/s], positive when closing
        approach : v0 > 0 [m/s], the rate at the beginning of this contact
        """
        return self.stiffness * depth**self.exponent * (self.relief(rate, approach) / approach)

    def relief(self, rate: Quantity, approach: Quantity) -> Quantity:
        """Rate ``v0 + a delta'`` of the sign of the force [m/s]: negative if tensile.

        The bodies then part faster than the material recovers, and no longer press. It comes back
        to depth zero in the meantime, and what it had stored is lost; pressed again before, it
        carries force as soon as ``v0 + a delta'`` is positive. That makes the force continuous,
        and the power lost, ``-K delta^n delta'`` without force, is positive.
        """
        return approach + self.damping * rate

    def resting_depth(self, load: float) -> float:
        """``(F/K)^(1/n)`` [m], under a load [N] that rests."""
        return float((load / self.stiffness) ** (1.0 / self.exponent))

    def loading_speed(self, depth: float, mass: float) -> float:
        """Largest closing speed [m/s] under a load put on at rest, without damping.

        ``v^2 = 2 n/(n + 1) K delta^(n+1)/m`` where the load is passed, delta [m] being the depth
        that carries it at rest and m [kg] the mass the contact feels. The laws reckon their loss
        along the motion without damping, whose largest speed v0 is. So a contact without impact,
        loaded from rest, has this speed for v0: about its resting depth the damping ratio is
        ``a sqrt((n + 1)/8)/n``, whatever the load, K and m.
        """
        n = self.exponent
        energy = self.stiffness * depth ** (n + 1.0)
        return float(sqrt(2.0 * n / (n + 1.0) * energy / mass))

    def elastic_energy(self, depth: Quantity) -> Quantity:
        """``K delta^(n+1)/(n+1)`` [J]; its derivative by depth is the force at rate zero.

        The power lost is what the force does beyond it, ``K delta^n a delta'^2/v0``.
        """
        order = self.exponent + 1.0
        return self.stiffness / order * depth**order


@dataclass(frozen=True)
class Hertz(CompliantLaw):
    """``N = K delta^(3/2)`` (Hertz 1882; Johnson, Contact Mechanics, eq. 4.23).

    Flaw: it loses nothing, and holds for a patch small against both radii, pressed slowly. The
    patch of a pin in a close-fitting bushing is not small.
    """

    stiffness: Quantity  #: [N/m^n]
    exponent: Quantity = 1.5

    damping = 0.0

    def normal_force(self, depth: Quantity, rate: Quantity, approach: Quantity) -> Quantity:
        """``K delta^n`` [N]; rate and approach do not matter."""
        return self.stiffness * depth**self.exponent

    def relief(self, rate: Quantity, approach: Quantity) -> Quantity:
        """Rate ``v0`` of the sign of the force [m/s]: it never becomes tensile."""
        return approach


@dataclass(frozen=True)
class _Restoring(CompliantLaw):
    """A law whose damping follows from a coefficient of restitution."""

    stiffness: Quantity  #: [N/m^n]
    restitution: Quantity
    exponent: Quantity = 1.5


class HuntCrossley(_Restoring):
    """``a = 3 (1 - e)/2`` (Hunt, Crossley 1975, J. Appl. Mech. 42:440).

    The loss is reckoned along the motion without damping, and ``1 - e^2`` taken for ``2 (1 - e)``.
    Flaw: true for e near 1 only; bodies meant to rebound with 0.5 do so with 0.66, and none with
    less than 0.49.
    """

    @property
    def damping(self) -> Quantity:
        """``3 (1 - e)/2``."""
        return 1.5 * (1.0 - self.restitution)


class LankaraniNikravesh(_Restoring):
    """``a = 3 (1 - e^2)/4`` (Lankarani, Nikravesh 1990, J. Mech. Des. 112:369).

    The loss ``m v0^2 (1 - e^2)/2`` is met by the damping along the motion without damping.
    Flaw: true for e near 1 only; bodies meant to rebound with 0.5 do so with 0.73, and none with
    less than 0.66.
    """

    @property
    def damping(self) -> Quantity:
        """``3 (1 - e^2)/4``."""
        return 0.75 * (1.0 - self.restitution * self.restitution)


class Flores(_Restoring):
    """``a = 8 (1 - e)/(5 e)`` (Flores, Machado, Silva, Martins 2011, Multibody Syst. Dyn. 25:357).

    Closing at ``v0 sqrt(1 - (delta/d)^2)``, d the deepest, and opening at e times that, the
    damping takes ``a K d^(5/2)/4`` and e times as much, out of ``m v0^2/2 = K d^(5/2) (2/5 +
    a/4)``. The figures 8 and 5 belong to the exponent 3/2; ``0 < e <= 1``.
    Flaw: that motion is assumed. A rebound falls short of e everywhere, by less than 0.05: by
    ``(1 - e)/15`` near 1, where the older laws are right, and by ``3 e/8`` near 0, where the
    force is nearly all damping.
    """

    @property
    def damping(self) -> Quantity:
        """``8 (1 - e)/(5 e)``."""
        return 1.6 * (1.0 - self.restitution) / self.restitution


class Material(NamedTuple):
    """An isotropic elastic body."""

    young: float  #: E [Pa]
    poisson: float  #: nu


def hertz_stiffness(radius: float, first: Material, second: Material) -> float:
    """``K = 4/3 E sqrt(R)`` of two balls, ``1/E = sum of (1 - nu^2)/E_i`` [N/m^1.5].

    Hertz (Johnson eq. 4.23). Flaw: it is of a patch that is small against both radii.

    Parameters
    ----------
    radius : R, ``1/R = 1/R1 + 1/R2``, a hollow one negative [m]
    """
    compliance = sum((1.0 - m.poisson**2) / m.young for m in (first, second))
    return 4.0 / 3.0 / compliance * sqrt(radius)


def socket_stiffness(
    pin_radius: float, clearance: float, pin: Material, bushing: Material
) -> float:
    """K of ``N = K delta^(3/2)`` for a sphere in a spherical socket [N/m^1.5].

    Hertz (Johnson eq. 4.23): ``K = 4/3 E sqrt(R)`` with ``1/E = sum of (1 - nu^2)/E_i`` and the
    relative curvature ``1/R = 1/Rp - 1/Rb = c/(Rp Rb)``. With ``s = (1 - nu^2)/(pi E)`` it reads
    ``4/(3 pi (s1 + s2)) sqrt(Rp Rb/(Rb - Rp))`` (Goldsmith 1960; Lankarani, Nikravesh 1990); with
    the pi left out of s it must be left out of the factor too.

    Flaw: a pin in a bushing is a cylinder, loaded along its width, which this K does not know; its
    line contact has no power law. And it grows without bound as the clearance closes, where the
    patch is no longer small: keep ``delta`` well below c.

    Parameters
    ----------
    pin_radius : Rp [m]
    clearance : c = Rb - Rp > 0, radial [m]
    """
    return hertz_stiffness(pin_radius * (pin_radius + clearance) / clearance, pin, bushing)
