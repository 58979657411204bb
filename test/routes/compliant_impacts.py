"""Free impacts under compliant laws in closed form: depth, restitution, duration."""

from __future__ import annotations

from math import gamma, inf, log1p, pi, sqrt

from mechanism_sim.engine.contact.compliant import CompliantLaw, Hertz


def _work(damping: float, u: float) -> float:
    """Integral of ``x/(1 + a x)`` from 0 to u: ``(a u - log(1 + a u))/a^2``."""
    z = damping * u
    if z <= -1.0:
        return inf
    if abs(z) < 0.1:  # the difference cancels
        return u * u * sum((-z) ** k / (k + 2) for k in range(16))
    return (z - log1p(z)) / damping**2


def impact_depth(law: CompliantLaw, mass: float, approach: float) -> float:
    """Deepest point d [m] of a free impact at speed v0 [m/s], m [kg] the mass the contact feels.

    ``m u' = -N`` separated in u = delta'/v0 and delta:
    ``K d^(n+1)/(n+1) = m v0^2 integral of u/(1 + a u), u = 0..1``.
    """
    order = law.exponent + 1.0
    energy = mass * approach**2 * _work(law.damping, 1.0)
    return float((order * energy / law.stiffness) ** (1.0 / order))


def true_restitution(law: CompliantLaw) -> float:
    """Rebound speed over approach speed of a free impact, whatever its mass and speed.

    The depth gained from u = 1 to 0 is lost from 0 to -e:
    ``a (1 + e) = log((1 + a)/(1 - a e))``.
    """
    a = float(law.damping)
    gained = _work(a, 1.0)
    low, high = 0.0, 1.0 / max(1.0, a)
    for _ in range(60):
        e = 0.5 * (low + high)
        low, high = (e, high) if _work(a, -e) < gained else (low, e)
    return high


def impact_duration(law: Hertz, mass: float, approach: float) -> float:
    """Duration of a free impact without damping [s].

    ``2 d/v0`` times the integral of ``1/sqrt(1 - x^(n+1))``, x = 0..1 (Johnson 11.4);
    ``2.9433 d/v0`` for n = 3/2.
    """
    k = 1.0 / (law.exponent + 1.0)
    shape = sqrt(pi) * gamma(1.0 + k) / gamma(0.5 + k)
    return 2.0 * shape * impact_depth(law, mass, approach) / approach
