"""Elastic links: a beam that bends, and stretches on request, in a floating frame of reference.

The point of a link's axis that lay at x before is, in the link's frame,

    (x + u - s, w)   with   w = sum_i phi_i(x) q_i,   u = sum_k psi_k(x) p_k,
    s = 1/2 int_0^x w'^2 dx.

The beam is Euler's and Bernoulli's: cross-sections stay plane and square to the axis, turn by w',
and have no rotary inertia. The foreshortening s makes the axis keep its length where it does not
stretch. It is of second order, but the axial force does work on it: a beam that spins up is
stiffened by it, one under thrust softened until it buckles (Kane, Ryan and Banerjee, J. Guidance
10 (1987) 139-151; [Sh] A. A. Shabana, Dynamics of Multibody Systems, 4th ed., ch. 5). Kinetic
energy counts up to second order in the elastic coordinates and their rates together, strain energy
too: to that order the equations are exact for the shapes that are taken. Of higher orders the
foreshortening knows only a part, and they take twice the time with three modes.

Reference conditions say where the frame lies in the beam: `pinned`, its x axis through both ends
of the axis, which do not move across; or `clamped`, its x axis tangent to the axis where that
starts. Stretch is zero where the axis starts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations_with_replacement, pairwise
from typing import Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import Legendre, legendre

from mechanism_sim.arrays import Array
from mechanism_sim.planar.beam_sections import Taper, nodes
from mechanism_sim.planar.bodies import Arms, Body, LinkExtension
from mechanism_sim.planar.points import Point, Vector2
from mechanism_sim.tolerances import TOLERANCES

Ends: TypeAlias = Literal['pinned', 'clamped']
Functions: TypeAlias = Literal['modal', 'polynomial']
Way: TypeAlias = Literal['pinned', 'clamped', 'fixed']
"""Reference conditions of bending, and that of stretch."""
_ROUNDING = TOLERANCES.rounding
_SECTIONS = 41
_FITTED = 16  # number of coefficients of a polynomial that is a half wave of a beam to rounding


def shapes(
    way: Way, functions: Functions, count: int, taper: Taper | None, t: Array, derivative: int
) -> Array:
    """Shapes or their derivatives at positions t (...,) from 0 to 1: (count, ...)."""
    if not count:
        return np.zeros((0, *np.shape(t)))
    if taper:
        return tapered(way, functions, count, taper).at(t, derivative)
    if functions == 'polynomial' or way == 'fixed':
        return np.asarray(legendre.legval(2.0 * t - 1.0, _ritz(way, count, derivative)))
    order = np.arange(1, count + 1).reshape(-1, *[1] * np.ndim(t))
    if way == 'pinned':
        k = np.pi * order
        # whole and half multiples of pi exactly: at the ends there is no deflection
        quarters = 2.0 * order * t + derivative
        found = np.sin(0.5 * np.pi * (quarters % 4.0))
        return np.asarray(k**derivative * np.where(quarters % 2.0 == 0.0, 0.0, found))
    return np.array([_cantilever(i, t, derivative) for i in range(count)]).reshape(
        count, *np.shape(t)
    )


def _cantilever(i: int, t: Array, derivative: int) -> Array:
    """``1/2 (cosh kt - cos kt - r (sinh kt - sin kt))`` with ``cos k cosh k = -1``."""
    k = (i + 0.5) * math.pi
    for _ in range(8):
        k += (math.cos(k) + 1.0 / math.cosh(k)) / (math.sin(k) + math.tanh(k) / math.cosh(k))
    wide = math.sinh(k) + math.sin(k)
    r = (math.cosh(k) + math.cos(k)) / wide
    rising = (math.sin(k) - math.cos(k) - math.exp(-k)) / wide  # 1 - r without its rounding
    phase = 0.5 * math.pi * derivative
    found = 0.5 * (rising * np.exp(k * t) + (-1.0) ** derivative * (1.0 + r) * np.exp(-k * t))
    found += -np.cos(k * t + phase) + r * np.sin(k * t + phase)
    return np.asarray(np.where((t == 0.0) & (derivative < 2), 0.0, 0.5 * k**derivative * found))


_T = Legendre([0.5, 0.5], domain=[0.0, 1.0])
_FACTORS = {'pinned': _T * (1.0 - _T), 'clamped': _T * _T, 'fixed': _T}
"""Polynomials on 0 to 1 that satisfy reference conditions; `fixed` is that of stretch."""


@lru_cache
def _ritz(ends: str, count: int, derivative: int) -> Array:
    """The modes of a beam of length 1 in polynomials ``factor * (degree < count)``.

    Returns
    -------
    Coefficients (degree + 1, count) of Legendre's polynomials on 0 to 1.
    """
    factor, order = _FACTORS[ends], 1 if ends == 'fixed' else 2
    basis = [factor * Legendre.basis(k, domain=[0.0, 1.0]) for k in range(count)]
    places, weights = gauss(count + 6)
    nodes, weights = 0.5 * (1.0 + places), 0.5 * weights
    values = np.array([b(nodes) for b in basis])
    bends = np.array([b.deriv(order)(nodes) for b in basis])
    half = np.linalg.inv(np.linalg.cholesky((values * weights) @ values.T))
    _, vectors = np.linalg.eigh(half @ ((bends * weights) @ bends.T) @ half.T)
    shares = vectors.T @ half
    # of the size of the modes: mean square 1/2, that of a cantilever 1/4; they begin upwards
    shares *= math.sqrt(0.25 if ends == 'clamped' else 0.5)
    first = np.array([b.deriv(2 if ends == 'clamped' else 1)(0.0) for b in basis])
    shares *= np.sign(shares @ first)[:, None]
    some = [np.asarray(b.deriv(derivative).coef if derivative else b.coef, float) for b in basis]
    longest = max(map(len, some))
    padded = np.array([np.pad(x, (0, longest - len(x))) for x in some])
    return np.asarray(padded.T @ shares.T)


@lru_cache
def gauss(count: int) -> tuple[Array, Array]:
    """Nodes and weights (count,) of Gauss' quadrature from -1 to 1."""
    return legendre.leggauss(count)


class Pieces(NamedTuple):
    """Polynomials from break to break on 0 to 1."""

    breaks: Array  #: (k + 1,)
    #: (k, degree + 1, count) of Legendre's polynomials from each break to the next
    coefficients: Array

    @property
    def order(self) -> int:
        """Number of coefficients of each polynomial: its degree and one."""
        return int(self.coefficients.shape[1])

    def at(self, t: Array, derivative: int) -> Array:
        """Values or derivatives of the functions at positions t (...,) in 0 to 1: (count, ...)."""
        t = np.asarray(t, float)
        i = np.clip(np.searchsorted(self.breaks, t, 'right') - 1, 0, len(self.coefficients) - 1)
        start, wide = self.breaks[i], np.diff(self.breaks)
        s = 2.0 * (t - start) / wide[i] - 1.0
        found = np.zeros((self.coefficients.shape[2], *t.shape))
        for k, own in enumerate(self.coefficients):
            scaled = legendre.legder(own, derivative) * (2.0 / wide[k]) ** derivative
            found = np.where(i == k, legendre.legval(s, scaled), found)
        return found


_EXTRA = 12
"""Degrees beyond the number of modes: the last one is then exact to some 1e-9 of its frequency."""


@lru_cache
def tapered(way: Way, functions: Functions, count: int, taper: Taper) -> Pieces:
    """The modes of a beam that tapers, by the method of Ritz.

    Modes are sought among polynomials of a high degree in every interval where the sections
    change evenly, smooth at its ends but for curvature (of stretch, for slope), so that steps and
    corners of the sections cost no accuracy; or among those of the least degree along all.
    """
    order = 1 if way == 'fixed' else 2
    between = taper.breaks / taper.length
    many = len(between) - 1
    if functions == 'polynomial' or way == 'fixed':
        breaks, degree = np.array([0.0, 1.0]), count + (0 if way == 'fixed' else 1)
    else:
        breaks, degree = between, -(-(count + _EXTRA) // many) + 4
    basis = _smooth(way, breaks, degree, order)
    t, weights = nodes(between, degree + 3, 1.0)
    area, moment = taper.shares(t * taper.length)
    values, bends = basis.at(t, 0), basis.at(t, order)
    mass = (values * weights * area) @ values.T
    stiff = (bends * weights * (area if way == 'fixed' else moment)) @ bends.T
    half = np.linalg.inv(np.linalg.cholesky(mass))
    _, vectors = np.linalg.eigh(half @ stiff @ half.T)
    shares = (vectors.T @ half)[:count]
    # of the size of the modes of an even beam, which begin upwards
    shares *= math.sqrt(0.25 if way == 'clamped' else 0.5)
    first = basis.at(np.array(0.0), 2 if way == 'clamped' else 1)
    shares *= np.sign(shares @ first)[:, None]
    return Pieces(breaks, basis.coefficients @ shares.T)


def _smooth(way: Way, breaks: Array, degree: int, order: int) -> Pieces:
    """All polynomials between breaks that satisfy reference conditions.

    They have `order` derivatives, the value among them, that do not jump.
    """
    many, n = len(breaks) - 1, degree + 1
    single = np.eye(n)
    rows = []

    def ends(k: int, side: float, derivative: int) -> Array:
        row = np.zeros((many, n))
        scale = (2.0 / (breaks[k + 1] - breaks[k])) ** derivative
        row[k] = scale * legendre.legval(side, legendre.legder(single, derivative))
        return row.ravel()

    rows = [ends(0, -1.0, d) for d in range(2 if way == 'clamped' else 1)]
    if way == 'pinned':
        rows.append(ends(many - 1, 1.0, 0))
    for k in range(many - 1):
        for d in range(order):
            scale = (breaks[k + 1] - breaks[k]) ** d
            rows.append(scale * (ends(k, 1.0, d) - ends(k + 1, -1.0, d)))
    kept = np.array(rows)
    _, _, vectors = np.linalg.svd(kept)
    return Pieces(breaks, vectors[len(kept) :].T.reshape(many, n, -1))


@dataclass(frozen=True)
class Damping:
    """Viscous damping of the modes of a beam by itself.

    A mode of mass m and angular frequency w is damped by ``2 ratio m w + mass m + stiffness m
    w^2``: by a ratio of critical damping, and by Rayleigh's two shares.
    """

    ratio: float = 0.0
    mass: float = 0.0  #: [1/s] mass-proportional coefficient
    stiffness: float = 0.0  #: [s] stiffness-proportional coefficient


class AxisPieces(NamedTuple):
    """All shapes as polynomials of the position along the axis, from break to break."""

    breaks: Array  #: (k + 3,) [m] with the ends of the beam, and infinity beyond both
    #: (k + 2, n * (degree + 1)) coefficients of rising powers [1/m^j], coordinate by coordinate,
    #: of the position from the middle of each piece; beyond the beam from its end
    rows: Array


@dataclass(frozen=True)
class Beam(LinkExtension):
    """Elastic part of a link: its axis runs from the link's origin along its x axis.

    Coordinates are the amplitudes [m] of shape functions that are modes of the beam by itself
    under its reference conditions, or the nearest to them in polynomials of the least degree
    (Ritz): orthogonal to each other in mass and stiffness, of the size of ``sin(i pi x/L)``.

    Attributes
    ----------
    modes, stretch : numbers of bending modes, and of modes of stretch (always polynomials)
    shortens : True if there is foreshortening; without it the beam is that of linear textbooks
    lumps : masses [kg] carried by the beam, with their points [m] in the link's frame
    spin : moment of inertia [kg m^2] that turns with the link's frame beside beam and lumps
    fibre : largest distance [m] of the outer fibres from the axis, if known
    taper : variation of the section along the beam; stiffnesses and density are then means
    """

    length: float  #: [m]
    bending_stiffness: float  #: [N m^2] Young's modulus times second moment of area
    axial_stiffness: float  #: [N] Young's modulus times area
    density: float  #: [kg/m] mass per length
    youngs_modulus: float  #: [Pa]
    modes: int
    stretch: int = 0
    ends: Ends = 'pinned'
    functions: Functions = 'modal'
    damping: Damping = Damping()
    shortens: bool = True
    lumps: tuple[tuple[float, Vector2], ...] = ()
    spin: float = 0.0
    fibre: float | None = None
    taper: Taper | None = None

    bends: ClassVar[bool] = True

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates: ``bend1``, ..., ``stretch1``, ..., in this order."""
        bends = (f'bend{i + 1}' for i in range(self.modes))
        return (*bends, *(f'stretch{k + 1}' for k in range(self.stretch)))

    @property
    def mass(self) -> float:
        """Mass of the beam without lumps [kg]."""
        return self.density * self.length

    def deflection(self, x: float | Array, derivative: int = 0) -> Array:
        """Functions phi_i or their derivatives by x at positions x (...,) [m]: (modes, ...)."""
        t, way = np.asarray(x) / self.length, self.ends
        found = shapes(way, self.functions, self.modes, self.taper, t, derivative)
        return found / self.length**derivative

    def axis_pieces(self) -> AxisPieces:
        """All shapes as piecewise polynomials: exact for polynomials, else to rounding."""
        L, order = self.length, _FITTED
        if self.taper:
            own = tapered(self.ends, self.functions, self.modes, self.taper)
            breaks, order = own.breaks * L, own.order
        elif self.functions == 'polynomial':
            breaks, order = np.array([0.0, L]), self.modes + 2
        else:  # a half wave each
            breaks = np.linspace(0.0, L, self.modes + 1)
        order = max(order, self.stretch + 1)
        s, weights = gauss(order)
        fit = legendre.legvander(s, order - 1) * weights[:, None] * (np.arange(order) + 0.5)
        rows = np.zeros((len(breaks) + 1, len(self.names), order))
        for k, (a, b) in enumerate(pairwise(breaks.tolist()), start=1):
            x = 0.5 * (a + b) + 0.5 * (b - a) * s
            values = np.concatenate([self.deflection(x), self.elongation(x)]) @ fit
            powers = np.array(
                [np.pad(p, (0, order - len(p))) for p in map(legendre.leg2poly, values)]
            )
            rows[k] = powers * (2.0 / (b - a)) ** np.arange(order)
        for k, end in ((0, 0.0), (-1, L)):
            rows[k, :, 0] = np.concatenate([self.deflection(end), self.elongation(end)])
            rows[k, : self.modes, 1] = self.deflection(end, 1)
        return AxisPieces(np.array([-np.inf, *breaks, np.inf]), rows.reshape(len(rows), -1))

    def elongation(self, x: float | Array, derivative: int = 0) -> Array:
        """Functions psi_k or their derivatives by x at positions x (...,) [m]: (stretch, ...)."""
        t = np.asarray(x) / self.length
        found = shapes('fixed', 'polynomial', self.stretch, self.taper, t, derivative)
        return found / self.length**derivative

    def outer_fibre(self, x: float | Array) -> Any:
        """Distance [m] of the outer fibres from the axis at positions x (...,) [m], if known."""
        return self.taper.geometry(x)[2] if self.taper and self.fibre else self.fibre

    def _nodes(self, end: float) -> tuple[Array, Array]:
        """Nodes (N,) and weights (N,) [m] of Gauss' quadrature from 0 to `end`."""
        if self.taper:
            order = tapered(self.ends, self.functions, self.modes, self.taper).order
            return self.taper.nodes(max(order, self.stretch + 1) + 2, end)
        places, weights = gauss(12 + 4 * (self.modes + self.stretch))
        return 0.5 * end * (1.0 + places), 0.5 * end * weights

    def foreshortening(self, x: float) -> Array:
        """``int_0^x phi_i' phi_j' dx`` (modes, modes) [1/m]; s is half its quadratic form."""
        places, weights = self._nodes(x)
        slopes = self.deflection(places, 1)
        return np.asarray((slopes * weights) @ slopes.T)

    def arms(self, at: Vector2) -> Arms:
        """Displacement of a point of the link in its frame: vectors by products of coordinates.

        A point beside the axis moves with its cross-section, one beyond the beam with its end.

        Parameters
        ----------
        at : [m] undeformed point in the link's frame
        """
        x = min(max(at[0], 0.0), self.length)
        beyond, y = at[0] - x, at[1]
        w, slope = self.deflection(x), self.deflection(x, 1)
        found: Arms = {}
        for i in range(self.modes):
            turned = float(slope[i])
            found[self.names[i],] = (-y * turned, float(w[i]) + beyond * turned)
        for name, u in zip(self.names[self.modes :], self.elongation(x), strict=True):
            found[name,] = (float(u), 0.0)
        if self.shortens:
            H = self.foreshortening(x)
            for i, j in combinations_with_replacement(range(self.modes), 2):
                half, both = -0.5 if i == j else -1.0, float(slope[i] * slope[j])
                along, across = float(H[i, j]) + beyond * both, y * both
                found[self.names[i], self.names[j]] = (half * along, half * across)
        for names, d in found.items():
            least = _ROUNDING.value * self.length ** (1 - len(names))
            found[names] = (d[0] if abs(d[0]) > least else 0.0, d[1] if abs(d[1]) > least else 0.0)
        return {names: d for names, d in found.items() if d != (0.0, 0.0)}

    def turned(self, at: Vector2, v: Vector2) -> Arms:
        """Change of a vector that is fixed to the cross-section at a point, like `arms`."""
        slope = self.slopes(at)
        found: Arms = {(name,): (-x * v[1], x * v[0]) for name, x in slope.items()}
        if self.shortens:
            for (i, x), (j, y) in combinations_with_replacement(slope.items(), 2):
                share = (-0.5 if i == j else -1.0) * x * y
                found[i, j] = (share * v[0], share * v[1])
        return found

    def slopes(self, at: Vector2) -> dict[str, float]:
        """Rotation of a cross-section per coordinate [rad/m]."""
        slope = self.deflection(min(max(at[0], 0.0), self.length), 1).tolist()
        return {name: x for name, x in zip(self.names, slope, strict=False) if x}

    def strain(self, x: float | Array, y: float) -> Array:
        """Strain at positions x (...,) [m] and y [m] off the axis, by coordinate: (n, ...) [1/m].

        ``u' - y w''``: fibres at positive y are compressed where the link bends towards them.
        """
        return np.concatenate([-y * self.deflection(x, 2), self.elongation(x, 1)])

    def sag(self, q: Array) -> Array:
        """Deflection (N,) [m] across the link's x axis at mid-length, of deformations (n, N)."""
        middle = self.deflection(0.5 * self.length)
        return np.asarray(middle @ q[: self.modes])

    def largest_stress(self, q: Array) -> Array:
        """The largest size (N,) [Pa] at the outer fibres, in steps of a fortieth of the length.

        Stress of bending, and of stretch where the beam has coordinates for it.
        """
        sections = np.linspace(0.0, self.length, _SECTIONS)
        bent = self.deflection(sections, 2).T @ q[: self.modes]
        drawn = self.elongation(sections, 1).T @ q[self.modes :]
        fibre = np.reshape(self.outer_fibre(sections), (-1, 1))
        strain = np.abs(drawn) + fibre * np.abs(bent)
        return np.asarray(self.youngs_modulus * strain.max(axis=0))

    def _shares(self, x: Array) -> tuple[Any, Any]:
        """Area and second moment over their means at positions x (N,) [m]."""
        return self.taper.shares(x) if self.taper else (1.0, 1.0)

    @cached_property
    def particles(self) -> tuple[tuple[float, Vector2], ...]:
        """Masses [kg] and their points [m] that stand for the beam in integrals; then the lumps.

        Gauss' quadrature: integrals of products of shape functions are exact but for rounding.
        """
        places, weights = self._nodes(self.length)
        mass = (self.density * self._shares(places)[0] * weights).tolist()
        return (*((m, (x, 0.0)) for m, x in zip(mass, places.tolist(), strict=True)), *self.lumps)

    def masses(self, body: Body, place: Callable[..., Point]) -> list[tuple[float, Point]]:
        """Point masses of the quadrature, and the lumped masses [kg]."""
        return [(mass, place(at)) for mass, at in self.particles]

    def spin_of(self, body: Body) -> float:
        """Inertia that turns with the link's frame [kg m^2]."""
        return self.spin

    @cached_property
    def _modal(self) -> tuple[Array, Array]:
        """Mass [kg] and stiffness [N/m] (n,) of each coordinate of the beam by itself."""
        places, weights = self._nodes(self.length)
        mass, stiffness = [], []
        area, moment = self._shares(places)
        for shape, order, size, share in (
            (self.deflection, 2, self.bending_stiffness, moment),
            (self.elongation, 1, self.axial_stiffness, area),
        ):
            mass += (self.density * (shape(places) ** 2 @ (area * weights))).tolist()
            stiffness += (size * (shape(places, order) ** 2 @ (share * weights))).tolist()
        return np.array(mass), np.array(stiffness)

    @property
    def frequencies(self) -> dict[str, float]:
        """Natural angular frequency [rad/s] of each coordinate of the beam by itself."""
        mass, stiffness = self._modal
        return dict(zip(self.names, np.sqrt(stiffness / mass).tolist(), strict=True))

    @property
    def springs(self) -> dict[str, tuple[float, float]]:
        """Stiffness [N/m] and damping [N s/m] of each coordinate."""
        (mass, stiffness), d = self._modal, self.damping
        found = 2.0 * d.ratio * np.sqrt(mass * stiffness) + d.mass * mass + d.stiffness * stiffness
        pairs = zip(stiffness.tolist(), found.tolist(), strict=True)
        return dict(zip(self.names, pairs, strict=True))
