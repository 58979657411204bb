"""A bearing whose pin or bushing is not round: where the pin's centre can be, and the gap.

Depth is measured along the radius, in the frame of the link that is worn. Seen from that link the
pin's centre can be within a closed curve, its locus: where a pin of radius rp touches a bushing
``rp + c + h(phi)``, or a pin ``rp - h(phi)`` a bushing of radius ``rp + c``. `locus` finds it for
any depth, by asking every place of the surface how far it lets the pin go. Where the pin does not
reach the bottom of a groove, two places touch at once, and the locus has a corner.

The engine needs one function that is smooth wherever the pin can be. With its place z = x + i y
from the middle of the locus, ``w = z/sqrt(|z|^2 + s^2)`` and s a part of the clearance it is

    y(z) = Re A(w) - Re B(w) |z|^2/(2 c),

A and B polynomials of degree n, fitted so that on the locus y is zero and its gradient is the unit
normal: then the row of the contact is that of the distance, and its force the normal force. Of a
circle it is ``(c^2 - |z|^2)/(2 c)``. A corner is rounded, over an angle of about 1/n.

If both surfaces are worn, both functions are added, less that of the circle of the mean depths:
these are exact, and of the rest the product of both slopes over the clearance is left out.
`WornShape.off` is how far the zero is from where the pin can be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import perm
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.frames import Frames, Jet

_Pair = tuple[Term, Term]  # real and imaginary part

LOOKS = 4096
"""Number of evenly spaced points of a surface with a depth, from angle 0 on."""
_DIRECTIONS = 512
_ROUNDS = 30
_REFINED = 9
_WINDOW = np.linspace(-1.0, 1.0, 257)
_THINNEST = 0.5  # of the roughness, that the film must be thick where the walls touch
_SLIGHT = 1e-3  # of the roughness, that harmonics of the rounder wall left out may be
_PEAK, _BLUR = 24.0, 0.2  # nodes of a thin film's pressure, and of its width that it ends over
_FARTHEST = 0.05  # of the mean clearance, that the gap may be off where they touch
_SOFT = 0.3  # s, of the least way to the locus: within it the powers of w fall off to zero


def locus(depth: Array, clearance: float, radius: float, of_pin: bool = False) -> Array:
    """Free travel of the pin's centre (512,) [m], in evenly spaced directions from angle 0 on.

    Each place of the worn surface, at phi from the direction, lets it go as far as

        (c + h) (2 i + c + h) / (a cos(phi) + sqrt(b^2 - a^2 sin(phi)^2)),

    with the pin's and the bushing's radius ``i`` and ``i + c + h`` there, a that of the worn
    surface and b the other. The least of them counts, found between places by a parabola.

    Parameters
    ----------
    depth : (4096,) wear depths [m]
    clearance : clearance without wear [m]
    radius : radius of the unworn pin [m]; 0 for a point, with the bushing as locus
    """
    phi = 2.0 * np.pi / LOOKS * np.arange(-LOOKS // 4, LOOKS // 4 + 1)
    place = LOOKS // _DIRECTIONS * np.arange(_DIRECTIONS)[:, None] + np.arange(len(phi))
    room = clearance + depth[(place - LOOKS // 4) % LOOKS]
    inner = radius + clearance - room if of_pin else np.full_like(room, radius)
    own, other = (inner, inner + room) if of_pin else (inner + room, inner)
    with np.errstate(invalid='ignore', divide='ignore'):
        root = np.sqrt(other**2 - (own * np.sin(phi)) ** 2)
        reach = room * (2.0 * inner + room) / (own * np.cos(phi) + root)
    reach[~np.isfinite(reach)] = np.inf  # the pin passes by this place
    k = np.clip(reach.argmin(axis=1), 1, len(phi) - 2)
    low, middle, high = (np.take_along_axis(reach, k[:, None] + d, 1)[:, 0] for d in (-1, 0, 1))
    with np.errstate(invalid='ignore', divide='ignore'):
        bottom = middle - (high - low) ** 2 / (8.0 * (low - 2.0 * middle + high))
    return np.where(np.isfinite(bottom) & (bottom > 0.0), bottom, middle)


class SurfaceTouch(NamedTuple):
    """A worn surface seen from its link: the measure of the gap, and its derivatives there."""

    value: Term  #: measure y of the gap [m]
    slope: _Pair  #: derivatives by x and y
    slope_rate: _Pair  #: rate of `slope`


@dataclass(frozen=True)
class WornSurface:
    """The measure of the gap between a worn surface and a round one."""

    clearance: float  #: c [m]
    centre: complex  #: origin of z, in the link's frame from the joint's point [m]
    soft: float  #: s [m]
    a: tuple[complex, ...]  #: (n + 1,) coefficients of A [m]
    b: tuple[complex, ...]  #: (n + 1,) coefficients of B
    error: float = 0.0  #: largest distance of its zero from the locus [m]
    tilt: float = 0.0  #: largest deviation of its gradient from the unit normal [rad]

    @classmethod
    def through(
        cls, reach: Array, clearance: float, degree: int, centre: complex = 0j
    ) -> WornSurface:
        """Fit a surface to a locus (m,) [m] in evenly spaced directions, by least squares."""
        m, c = len(reach), clearance
        none = (0j,) * degree
        if np.ptp(reach) <= 4.0 * np.spacing(reach.max()):  # a circle
            r = float(reach[0])
            return cls(c, 0j, _SOFT * r, (0.5 * r + 0j, *none), (c / r + 0j, *none))
        turn = _evenly(m)
        ahead, behind = ([np.roll(reach, -sign * k) for k in (1, 2)] for sign in (1, -1))
        slope = (8.0 * (ahead[0] - behind[0]) - ahead[1] + behind[1]) * m / (24.0 * np.pi)
        z, normal = reach * turn - centre, (reach - 1j * slope) * turn
        normal /= np.abs(normal)
        shell = cls(c, 0j, _SOFT * float(np.abs(z).min()), (1.0 + 0j, *none), (0j, *none))
        w, w_n = shell._turned(z), shell._turned_along(z, normal)
        k, half = np.arange(degree + 1), 0.5 * np.abs(z) ** 2 / c
        powers = w[:, None] ** k
        along = k * w[:, None] ** np.maximum(k - 1, 0) * w_n[:, None]
        inward = (z.conj() * normal).real / c
        # of unknowns A/c and B: the measure over c, and its slope along the normal
        rows = [
            [powers, -half[:, None] / c * powers],
            [c * along, -half[:, None] * along - inward[:, None] * powers],
        ]
        matrix = np.vstack([np.hstack([x for part in row for x in (part.real, -part.imag)])
                            for row in rows])  # fmt: skip
        wanted = np.concatenate([np.zeros(m), np.full(m, -1.0)])
        p, q, r, s = np.linalg.lstsq(matrix, wanted, rcond=1e-13)[0].reshape(4, degree + 1)
        q[0] = s[0] = 0.0
        found = replace(shell, a=tuple(c * (p + 1j * q)), b=tuple(r + 1j * s))
        value, gradient = found.measure(z)
        error = _farthest(value, gradient, normal)
        tilt = float(np.abs(gradient + normal).max())
        return replace(found, centre=centre, error=error, tilt=tilt)

    def _turned(self, z: ComplexArray) -> ComplexArray:
        """``w``."""
        return np.asarray(z / np.sqrt(np.abs(z) ** 2 + self.soft**2))

    def _turned_along(self, z: ComplexArray, way: ComplexArray) -> ComplexArray:
        """Derivative of w along a direction."""
        t = np.sqrt(np.abs(z) ** 2 + self.soft**2)
        return np.asarray(way / t - z * (z.conj() * way).real / t**3)

    def measure(self, z: ComplexArray) -> tuple[Array, ComplexArray]:
        """Measure y [m] at positions of the pin (N,) in the link's frame, and gradient x + i y."""
        z = z - self.centre
        w, half = self._turned(z), 0.5 * np.abs(z) ** 2 / self.clearance
        A, B = (np.polynomial.Polynomial(x) for x in (self.a, self.b))
        value = A(w).real - half * B(w).real
        slope = A.deriv()(w) - half * B.deriv()(w)
        gradient = [
            (slope * self._turned_along(z, np.full_like(z, way))).real for way in (1.0, 1j)
        ]
        return value, gradient[0] + 1j * gradient[1] - z / self.clearance * B(w).real

    def touch(self, frames: Frames, name: str, x: Jet, y: Jet) -> SurfaceTouch:
        """Measure y as an expression of the pin's position; `name` is that of parameters."""
        p, c = frames.parameters, self.clearance
        x -= dense(p.reserve(f'{name}.centre.x', self.centre.real))
        y -= dense(p.reserve(f'{name}.centre.y', self.centre.imag))
        vx, vy, x, y = x.rate, y.rate, dense(x.value), dense(y.value)
        soft = p.reserve(f'{name}.soft_square', self.soft**2)
        m = p.reserve(f'{name}.curvature', 1.0 / c)
        square = x * x + y * y
        half, sway = 0.5 * m * square, dense(add(mul(x, vx), mul(y, vy)))
        i1 = 1.0 / hy.sqrt(square + soft)
        i3 = i1 * i1 * i1
        w = x * i1, y * i1
        w_rate = tuple(
            dense(add(mul(i1, v), neg(mul(z, sway * i3)))) for v, z in ((vx, x), (vy, y))
        )
        one = hy.expression(1.0), hy.expression(0.0)
        powers = [one, w]
        while len(powers) < len(self.a):
            powers.append(product(powers[-1], w))
        series = []
        for part, numbers in (('a', self.a), ('b', self.b)):
            known = [
                (
                    p.reserve(f'{name}.{part}{k}.x', n.real),
                    p.reserve(f'{name}.{part}{k}.y', n.imag),
                )
                for k, n in enumerate(numbers)
            ]
            series.append([_series(known, powers, order) for order in range(3)])
        (A, A1, A2), (B, B1, B2) = series
        slope = tuple(f - half * g for f, g in zip(A1, B1, strict=True))  # dy/dw along A and B
        bend = tuple(f - half * g for f, g in zip(A2, B2, strict=True))
        turned = product(bend, w_rate)
        slope_rate = tuple(t - m * sway * g for t, g in zip(turned, B1, strict=True))
        # grad y = (conj(slope) i1 - z (i3 Re(slope z) + Re B m)
        z, z_rate = (x, y), (dense(vx), dense(vy))
        R = product(slope, z)[0]
        R_rate = product(slope_rate, z)[0] + product(slope, z_rate)[0]
        E = i3 * R + m * B[0]
        E_rate = i3 * R_rate - 3.0 * (i1 * i1 * i3 * sway) * R + m * product(B1, w_rate)[0]
        signs = 1.0, -1.0
        return SurfaceTouch(
            A[0] - half * B[0],
            tuple(n * i1 * f - z * E for n, f, z in zip(signs, slope, z, strict=True)),
            tuple(
                n * (i1 * f_rate - i3 * sway * f) - v * E - u * E_rate
                for n, f, f_rate, u, v in zip(signs, slope, slope_rate, z, z_rate, strict=True)
            ),
        )


def _evenly(count: int) -> ComplexArray:
    """Unit vectors in evenly spaced directions, from that of x on."""
    return np.asarray(np.exp(2j * np.pi / count * np.arange(count)))


def _farthest(value: Array, gradient: ComplexArray, way: ComplexArray) -> float:
    """Largest first-order distance of zeros of a function from points (N,) along unit vectors."""
    return float(np.abs(value / (gradient * way.conj()).real).max())


def product(f: _Pair, g: _Pair) -> _Pair:
    """Product of two complex numbers."""
    return f[0] * g[0] - f[1] * g[1], f[0] * g[1] + f[1] * g[0]


def _series(known: list[_Pair], powers: list[_Pair], order: int) -> _Pair:
    """A derivative of a polynomial with complex coefficients: products with numbers are cheap."""
    real, imaginary = [], []
    for k in range(order, len(known)):
        scale, (u, v) = float(perm(k, order)), powers[k - order]
        a, b = known[k]
        real += [a * (scale * u), -(b * (scale * v))]
        imaginary += [a * (scale * v), b * (scale * u)]
    return hy.sum(real), hy.sum(imaginary)


@dataclass(frozen=True)
class WornShape:
    """A pin and a bushing of which one or both are worn, each seen from its own link.

    `ways` are unit vectors (numbers or (N,)) along the axes of the links whose surfaces are worn,
    as complex numbers, the pin's first.
    """

    mean: float  #: clearance with the mean depths of both [m]
    #: worn surfaces, each beside the other with its mean depth
    pin: WornSurface | None
    bushing: WornSurface | None
    widest: float = 0.0  #: twice the largest value of the gap [m]; for a circle its clearance
    off: float = 0.0  #: largest error of the gap in contact [m]

    @property
    def surfaces(self) -> list[WornSurface]:
        """The worn surfaces."""
        return [surface for surface in (self.pin, self.bushing) if surface is not None]

    def measure(self, z: ComplexArray, ways: Sequence[Any]) -> tuple[Array, ComplexArray]:
        """The gap [m] at positions of the pin (N,), and its gradient; `ways` of the worn links."""
        value, gradient = np.zeros(len(z)), np.zeros(len(z), complex)
        for surface, way in zip(self.surfaces, ways, strict=True):
            own = surface.measure(z * np.conj(way))
            value, gradient = value + own[0], gradient + own[1] * way
        if len(self.surfaces) == 2:
            value = value - 0.5 * (self.mean - np.abs(z) ** 2 / self.mean)
            gradient = gradient + z / self.mean
        return value, gradient

    def _edge(self, turn: ComplexArray, ways: Sequence[Any]) -> ComplexArray:
        """Positions (N,) of zero gap in directions (N,) from the middle."""
        out = np.full(len(turn), self.mean)
        for _ in range(_ROUNDS):
            value, gradient = self.measure(out * turn, ways)
            step = value / (gradient * turn.conj()).real
            out = out - step
            if np.abs(step).max() <= 4.0 * np.spacing(self.mean):
                break
        return np.asarray(out * turn)

    def seat(self, force: Array, angles: Sequence[float]) -> Array:
        """Rest position of the pin under a force (2,) [m], both parts turned by angles."""
        known = zip((self.pin, self.bushing), angles, strict=True)
        ways = [np.exp(1j * angle) for surface, angle in known if surface is not None]
        push = complex(*force) / float(np.hypot(*force))
        middle, half, best = 0.0, 1.5, 0j
        for refined in range(_REFINED):
            edge = self._edge(push * np.exp(1j * (middle + half * _WINDOW)), ways)
            normal = -self.measure(edge, ways)[1] * np.conj(push)
            off = np.abs(normal.imag / normal.real) if refined else -(edge * np.conj(push)).real
            k = int(
                off.argmin()
            )  # the farthest along the force, then where the normal is along it
            middle, half, best = middle + half * float(_WINDOW[k]), half / 64.0, edge[k]
        return np.array([best.real, best.imag])

    def inside(self, relative: float) -> tuple[float, float]:
        """The least of the gap well inside its edge, and the largest [m], by the links' turn."""
        turn = _evenly(72)
        ways = [np.exp(1j * relative), 1.0][2 - len(self.surfaces) :]
        edge = self._edge(turn, ways)
        values = self.measure((np.linspace(0.0, 0.95, 20)[:, None] * edge).ravel(), ways)[0]
        return float(values.min()), float(values.max())


@dataclass(frozen=True, eq=False)
class FilmProfile:
    """Depths ``Re sum of c_k exp(i k phi)`` of worn walls with oil between them [m]."""

    place: int  #: link of reference, 0 the pin's or 1 the bushing's: that of the less round wall
    own: ComplexArray  #: (n + 1,) c_k of the reference wall, with the mean depth of both
    other: ComplexArray  #: (m,) significant c_1, c_2, ... of the other wall
    count: int  #: number of even angles at which the film is evaluated
    blur: float  #: angle over which the rupture is smoothed [rad]

    @classmethod
    def of(
        cls, shape: WornShape, depths: tuple[Array, Array], clearance: float, roughness: float,
        degree: int,
    ) -> FilmProfile:  # fmt: skip
        """Profile of a film by depths at 4096 places on bushing and pin.

        Raises
        ------
        ValueError
            One sentence: where walls touch no film is left.
        """
        bushing, pin = (2.0 / LOOKS * np.fft.rfft(x)[: degree + 1] for x in depths)
        bushing[0], pin[0] = 0.5 * (bushing[0] + pin[0]), 0.0
        least, k = np.inf, np.arange(degree + 1)
        turn = _evenly(_DIRECTIONS)
        for way in np.exp(1j * np.linspace(0.0, 6.0, 7 if shape.pin else 1)):
            worn = (turn[:, None] ** k * (bushing + pin * way**-k)).real.sum(axis=1)
            known = zip((shape.pin, shape.bushing), (way, 1.0), strict=True)
            edge = shape._edge(turn, [x for surface, x in known if surface is not None])
            apart = clearance + worn - (edge[:, None] * turn.conj()).real
            least = min(least, float(apart.min()))
        if least < _THINNEST * roughness:
            raise ValueError(
                f'has a profile and a film, of which {least:.3g} m would be left where the walls '
                f'touch, needed are {_THINNEST * roughness:.3g} m: more harmonics follow its '
                'grooves better'
            )
        rest = [np.cumsum(np.abs(c[:0:-1]))[::-1] for c in (pin, bushing)]  # sizes from c_k on
        place = int(rest[0][0] <= rest[1][0])
        own, other = (pin, bushing)[place], (bushing, pin)[place]
        own[0] = bushing[0]
        kept = int((rest[1 - place] > _SLIGHT * roughness).sum())
        wide = float(np.sqrt(2.0 * roughness / clearance))  # [rad] of the pressure of a thin film
        count = max(3 * degree, int(np.ceil(_PEAK / wide)))
        return cls(place, own, other[1 : kept + 1], count, _BLUR * wide)

    def along(self) -> tuple[Array, Array]:
        """The own wall's depths at these angles (count,), and their slopes."""
        k, angle = np.arange(len(self.own)), 2.0 * np.pi / self.count * np.arange(self.count)
        terms = np.exp(1j * angle[:, None] * k) * self.own
        return terms.real.sum(axis=1), (1j * k * terms).real.sum(axis=1)

    @property
    def steepest(self) -> float:
        """Estimate of the largest slope [m]: twice the root mean square of both walls."""
        both = self.own[1:], self.other
        squares = sum(float((np.abs(np.arange(1, len(c) + 1) * c) ** 2).sum()) for c in both)
        return math.sqrt(2.0 * squares)


@lru_cache(maxsize=64)
def worn_shape(
    clearance: float, radius: float, depths: tuple[bytes, bytes], degree: int
) -> WornShape:
    """Shape of a bearing by depths at 4096 places on bushing and pin [m], as bytes of arrays.

    Raises
    ------
    ValueError
        One sentence: of depths that leave no room, or of a groove that the pin cannot follow.
    """
    c, rp = clearance, radius
    bushing, pin = (np.frombuffer(given) for given in depths)
    if pin.any() and pin.max() >= rp:
        raise ValueError(f"has a worn pin: its 'pin_radius' must be more than {pin.max():g} m")
    if (least := float(min(bushing.min(), pin.min()))) <= -0.5 * c:
        raise ValueError(f'has a profile with a depth of {least:g} m, which leaves no room')
    of_bushing, of_pin = float(bushing.mean()), float(pin.mean())
    mean = c + of_bushing + of_pin
    both = bool(np.ptp(bushing) and np.ptp(pin))
    on_bushing = on_pin = None
    if np.ptp(bushing) or not np.ptp(pin):
        reach = locus(bushing, c + of_pin, rp - of_pin if rp else 0.0)
        on_bushing = WornSurface.through(reach, mean, degree, 0j if both else _middle(reach))
    if np.ptp(pin):
        reach = locus(pin, c + of_bushing, rp, of_pin=True)
        on_pin = WornSurface.through(reach, mean, degree, 0j if both else _middle(reach))
    found = WornShape(mean, on_pin, on_bushing)
    error = (
        _error_of_both(found, clearance, radius, bushing, pin) if both else found.surfaces[0].error
    )
    least_inside, most = np.transpose([found.inside(x) for x in np.linspace(0.0, 6.0, 7)])
    if not error <= _FARTHEST * mean or not least_inside.min() > 0.0:
        why = (
            'of a pin and a bushing that are both worn, one must be nearly round'
            if both
            else 'its grooves are too narrow for the pin; more harmonics approximate it better'
        )
        raise ValueError(
            f'has a profile that is off by {error:.3g} m where pin and bushing touch, allowed are '
            f'{_FARTHEST * mean:.3g} m: {why}'
        )
    return replace(found, widest=2.0 * max(0.5 * mean, *most), off=error)


def _middle(reach: Array) -> complex:
    """The middle of a locus (m,) [m] along its longest radius: narrow ones are fitted best so."""
    z = reach * _evenly(len(reach))
    way = z[int(reach.argmax())] / float(reach.max())
    along = (z * np.conj(way)).real
    return complex(0.5 * (along.max() + along.min()) * way)


def _error_of_both(
    shape: WornShape, clearance: float, radius: float, bushing: Array, pin: Array
) -> float:
    """Largest distance of the zero of both functions' sum from the true locus of the pin [m]."""
    turn, found = _evenly(_DIRECTIONS), 0.0
    for shift in range(0, LOOKS, LOOKS // 16):
        reach = locus(bushing + np.roll(pin, shift), clearance, radius)
        ways = np.exp(2j * np.pi / LOOKS * shift), 1.0
        value, gradient = shape.measure(reach * turn, ways)
        found = max(found, _farthest(value, gradient, turn))
    return found
