"""Cut-off of Zeno chatter: when the impacts of a contact are no longer resolved."""

from __future__ import annotations

from mechanism_sim.numerics.kernels import kernel
from mechanism_sim.tolerances import TOLERANCES

_CHATTER = TOLERANCES.chatter


class ChatterRule:
    """Criterion that ends Zeno chatter and lets the contact follow.

    A contact that bounces with rebound speed v against a steady approach d rises to
    ``h = v^2/(2 d)``; all bounces still to come displace the rest of the mechanism by about
    ``2 h/(1 - e)``. The sequence is ended, with an impact that takes all of the approach speed, as
    soon as ``h <= max(r L (1 - e), atol (1 - e), 8 eps R)``, L being the size of the mechanism, R
    how far its places are from the origin if that is more, and r a hundredth of rtol (which makes
    what is left out as small as the errors of steps are), but not below 1e-12 unless rtol is: what
    is left out is below the tolerance, and a rise that double precision cannot resolve is never
    asked for; nor one that would not get clear of the depth to which a step's error let the impact
    come too late.

    Where e is one, or nearly, flights do not shorten, and there is no sequence: a contact that
    bounces on for ever displaces the rest by no more than h, on the average by two thirds of it.
    It follows as soon as h is below some hundreds of roundings, 1e-12 of the size.

    Heights and not speeds, so that there is no constant to tune for another machine.

    Attributes
    ----------
    allowed, resolved : [m] rises that may be left out, and that can be told from rounding
    """

    def __init__(self, rtol: float, atol: float, size: float, reach: float = 0.0) -> None:
        self.allowed = max(max(_CHATTER.step_error * rtol, min(rtol, _CHATTER.least)) * size, atol)
        self.resolved = TOLERANCES.rounding.sum * max(size, reach)

    def ends(
        self, rebound: float, free_acceleration: float, restitution: float, depth: float = 0.0
    ) -> bool:
        """True if a rebound of this speed [m/s] under this gap acceleration [m/s^2] is the end.

        `depth` [m] is how far the gap is violated already.
        """
        rise = left_out(self.allowed, self.resolved, restitution)
        return ends(rise, rebound, free_acceleration, depth)


@kernel
def left_out(allowed: float, resolved: float, restitution: float) -> float:
    """Rise [m] below which the impacts of a chatter are left out, see `ChatterRule`."""
    lost = 1.0 - restitution
    least = resolved if lost > _CHATTER.elastic else _CHATTER.roundings * resolved
    return max(allowed * lost, least)


@kernel
def ends(rise: float, rebound: float, acceleration: float, depth: float) -> bool:
    """True if a rebound [m/s] rises by no more than `rise`, or not clear of a `depth` [m]."""
    height = max(rise, 2.0 * depth)
    return acceleration < 0.0 and rebound * rebound <= -2.0 * acceleration * height


@kernel
def remaining_time(rebound: float, acceleration: float, restitution: float) -> float:
    """Duration of the remaining chatter [s] after a rebound [m/s] at a constant acceleration.

    Flights of ``2 v/|d|``, each shorter than the one before by the factor e.
    """
    if rebound <= 0.0 or acceleration >= 0.0 or restitution >= 1.0:  # no approach but rounding
        return 0.0
    return -2.0 * rebound / (acceleration * (1.0 - restitution))
