"""Rotors out of balance: critical speeds and whirl ([V] 6.14)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from masses import MassSystem
from numpy.typing import ArrayLike, NDArray
from orbits import Orbit
from oscillator import Oscillator

from mechanism_sim.errors import InputError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Rotor:
    """One disk: rigid rotor on flexible supports, or flexible shaft on rigid ones.

    m x'' + cx x' + kx x = m e w^2 cos(w t), and y alike with the sine: [V] eqs. 6.227, 6.228 and
    6.234, 6.235. The damping is external; a synchronous whirl does not flex the shaft.

    Raises
    ------
    InputError
        If mass or stiffness are not positive, or a damping is negative.
    """

    mass: float  #: [kg]
    eccentricity: float  #: of the mass centre from the axis [m]
    stiffness: tuple[float, float]  #: along x and y, of all supports or of the shaft [N/m]
    damping: tuple[float, float] = (0.0, 0.0)  #: along x and y [N s/m]

    def __post_init__(self) -> None:
        if not min(self.mass, *self.stiffness) > 0.0 or min(self.damping) < 0.0:
            raise InputError('a rotor needs a mass and stiffnesses, and no negative damping')

    @property
    def directions(self) -> tuple[Oscillator, Oscillator]:
        """The oscillators along x and y."""
        x, y = (
            Oscillator.of_coefficients(self.mass, c, k)
            for c, k in zip(self.damping, self.stiffness, strict=True)
        )
        return x, y

    @property
    def critical_speeds(self) -> Array:
        """Speeds at which the amplitudes along x and y are greatest (2,) [rad/s].

        wn/sqrt(1 - 2 xi^2), [V] eq. 6.246; infinite where they only grow, from xi = 1/sqrt(2) on.
        """
        wn = np.array([d.natural_frequency for d in self.directions])
        peak = np.array([d.peak_frequency for d in self.directions])
        with np.errstate(divide='ignore'):
            return np.asarray(wn * (wn / peak))

    def whirl(self, speed: ArrayLike) -> Orbit:
        """Orbit of the axis at speeds [rad/s], [V] eqs. 6.229, 6.230 and 6.239 to 6.241."""
        w = np.asarray(speed, np.float64)
        push = self.mass * self.eccentricity * w**2
        x, y = self.directions
        return Orbit(push * x.receptance(w), -1j * push * y.receptance(w))

    def mass_centre(self, speed: ArrayLike) -> Orbit:
        """Orbit of the mass centre, [V] eqs. 6.232, 6.236."""
        axis = self.whirl(speed)
        return Orbit(axis.x + self.eccentricity, axis.y - 1j * self.eccentricity)

    def motion(self, t: ArrayLike, speed: float) -> Array:
        """Path of the axis (2, N) [m] at times t (N,) [s] when a rotor at rest begins to whirl.

        At t = 0 the axis rests at the origin, and the rotor turns at its constant speed [rad/s].
        """
        push = self.mass * self.eccentricity * speed**2
        x, y = self.directions
        return np.array([
            x.forced(t, push, speed).displacement,
            y.forced(t, -1j * push, speed).displacement,
        ])  # fmt: skip


def peak_radius(damping_ratio: ArrayLike) -> Array:
    """Greatest radius of whirl over the eccentricity, [V] eq. 6.247: 1/(2 xi sqrt(1 - xi^2)).

    1 from xi = 1/sqrt(2) on, where the radius only grows with speed.
    """
    xi = np.asarray(damping_ratio, np.float64)
    inside = np.minimum(xi, np.sqrt(0.5))
    with np.errstate(divide='ignore'):
        return np.asarray(0.5 / (inside * np.sqrt((1.0 - inside) * (1.0 + inside))))


@dataclass(frozen=True, eq=False)
class DiskRotor:
    """Several disks on a shaft, the same in all directions across it ([V] 6.14.4).

    M z'' + C z' + K z = M e w^2 e^(i w t), z = x + i y: [V] eqs. 6.253 to 6.266.
    """

    masses: Array  #: (n,) [kg]
    eccentricities: ComplexArray  #: (n,) [m], each with its angle: e_j e^(i gamma_j)
    stiffness: Array  #: (n, n) [N/m], the inverse of the influence coefficients
    damping: Array  #: (n, n) [N s/m]

    @cached_property
    def system(self) -> MassSystem:
        """Linear system in one plane through the axis."""
        return MassSystem(np.diag(self.masses), self.damping, self.stiffness)

    @property
    def critical_speeds(self) -> Array:
        """Natural frequencies without damping (n,) [rad/s], [V] eqs. 6.277, 6.278."""
        return self.system.modes.frequencies

    def amplitudes(self, speed: ArrayLike) -> ComplexArray:
        """Complex deflections (..., n) [m] at speeds (...) [rad/s]: each disk whirls in a circle.

        Sizes are radii; angles are those from the direction in which eccentricities are counted.
        """
        w = np.asarray(speed, np.float64)
        unbalance = np.multiply(self.masses, self.eccentricities)
        return self.system.steady(w[..., None] ** 2 * unbalance, w)

    def whirl(self, speed: float, disk: int) -> Orbit:
        """Orbit of the axis at one disk, counted from 0."""
        z = complex(self.amplitudes(speed)[disk])
        return Orbit(z, -1j * z)


def influence_coefficients(positions: ArrayLike, span: float, rigidity: float) -> Array:
    """Deflections per force (n, n) [m/N] of a beam on two simple supports.

    [V] eqs. 6.273 to 6.275, whose denominators lack the span: with a <= b

        alpha = a (L - b) (L^2 - a^2 - (L - b)^2)/(6 E I L)

    Parameters
    ----------
    positions : (n,) distances of the forces from one support [m]
    span : L between the supports [m]
    rigidity : E I of the beam [N m^2]

    Raises
    ------
    InputError
        If a position is not between the supports, or two are the same.
    """
    x = np.asarray(positions, np.float64)
    if not ((x > 0.0) & (x < span)).all() or len(np.unique(x)) < len(x) or not rigidity > 0.0:
        raise InputError('forces act between the supports of a beam, at different places')
    a, rest = np.minimum.outer(x, x), span - np.maximum.outer(x, x)
    return np.asarray(a * rest * (span**2 - a**2 - rest**2) / (6.0 * rigidity * span))
