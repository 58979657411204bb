"""Cams by their profiles: edges and splines that close, and the law that a follower gets of them.

The frame is that of `touch`: the follower goes round the profile counterclockwise. An edge is a
curve of a parameter t, with its outward normal; `CamOutline.law` finds for each t the cam angle at
which the follower touches there and where the follower is then, and makes polynomials of it.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import scipy
from numpy.polynomial import Polynomial

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.joints.cam.followers import FlatFaced, Follower, OscillatingFlat
from mechanism_sim.joints.cam.laws import TURN, LawPiece, Piecewise, PiecewiseLaw
from mechanism_sim.joints.cam.touch import turned
from mechanism_sim.numerics.polynomials import chebyshev_coefficients, chebyshev_nodes, fit_powers
from mechanism_sim.planar.points import Vector2

_NODES = chebyshev_nodes(13)
_TAIL = 1e-14  # of the greatest displacement: last terms of a polynomial that is the law
_STALLED = 1e3  # times that
_ROUNDS = 12  # in which parts are halved
_WIDEST = 0.5  # [rad] of the first parts
_LOOKS = np.linspace(0.0, 1.0, 17)  # of a part at which its cam angle must grow
_BISECTIONS = 54
_MEET = 1e-6  # of the size: by so much ends of edges may miss each other
_CORNER = 1e-4  # [rad]: a larger change of direction between edges is a corner


class OutlineCurve(Protocol):
    """A part of a profile."""

    @property
    def breaks(self) -> Array:
        """Values (k + 1,) of t between which it is smooth."""
        ...

    def at(self, t: Array) -> tuple[Array, Array]:
        """Points and outward normals (2, N)."""


@dataclass(frozen=True)
class Line:
    """Straight line from one point to another [m], the cam on the left."""

    start: Vector2
    end: Vector2

    @property
    def breaks(self) -> Array:
        """Values of the share of the length."""
        return np.array([0.0, 1.0])

    def at(self, t: Array) -> tuple[Array, Array]:
        """Points and outward normals (2, N)."""
        a, way = np.array(self.start)[:, None], np.subtract(self.end, self.start)[:, None]
        normal = -turned(way) / np.hypot(*way)
        return a + t * way, np.repeat(normal, len(t), axis=1)


@dataclass(frozen=True)
class Arc:
    """Arc about a centre [m], from one angle of its outward normal to another [rad].

    The radius of a hollow arc is negative, and its angles fall.
    """

    centre: Vector2
    radius: float
    start: float
    end: float

    @property
    def breaks(self) -> Array:
        """Values of the angle from its beginning."""
        return np.array([0.0, self.end - self.start])

    def at(self, t: Array) -> tuple[Array, Array]:
        """Points and outward normals (2, N)."""
        # by the chord from its beginning: a centre far away costs no digits
        begin = np.array([np.cos(self.start), np.sin(self.start)])[:, None]
        chord, middle = 2.0 * self.radius * np.sin(0.5 * t), self.start + 0.5 * t
        point = np.array(self.centre)[:, None] + self.radius * begin
        normal = np.array([np.cos(self.start + t), np.sin(self.start + t)])
        return point + chord * np.array([-np.sin(middle), np.cos(middle)]), normal


class Radii:
    """Radii over the angle, by a function of pieces [m]."""

    def __init__(self, function: Piecewise) -> None:
        self.breaks, self._radius = function.breaks, function

    def at(self, t: Array) -> tuple[Array, Array]:
        """Points and outward normals (2, N)."""
        out = np.array([np.cos(t), np.sin(t)])
        r, slope = self._radius(t), self._radius(t, 1)
        tangent = slope * out + r * turned(out)
        return r * out, -turned(tangent) / np.hypot(*tangent)


class OutlineLaw(PiecewiseLaw):
    """The law of a profile: polynomials in the cam angle, to rounding."""

    def __init__(self, function: Piecewise) -> None:
        self.function = function


class CamOutline:
    """A closed profile around the camshaft.

    Parameters
    ----------
    curves : curves in counterclockwise order, each from the end of the one before
    """

    def __init__(self, curves: Sequence[OutlineCurve]) -> None:
        self.curves = curves
        ends = [
            [x[:, 0] for x in curve.at(curve.breaks[[k]])] for curve in curves for k in (0, -1)
        ]
        self.size = max(float(np.hypot(*point)) for point, _ in ends)
        for (a, m), (b, n) in zip(ends[1::2], [*ends[2::2], ends[0]], strict=True):
            place = f'({1e3 * a[0]:.6g}, {1e3 * a[1]:.6g}) mm'
            if np.hypot(*(b - a)) > _MEET * self.size:
                raise InputError(
                    f'the profile does not close: an edge ends at {place}, and no other begins'
                )
            if abs(m[0] * n[1] - m[1] * n[0]) > _CORNER or m @ n < 0.0:
                raise InputError(f'the profile has a corner at {place}: round it by an arc')

    @property
    def base_radius(self) -> float:
        """The least distance from the camshaft [m]."""
        nearest = []
        for curve in self.curves:
            t = np.linspace(curve.breaks[:-1], curve.breaks[1:], 65).T
            away = np.hypot(*curve.at(t.ravel())[0]).reshape(t.shape)
            for k, j in enumerate(away.argmin(axis=1)):
                span = t[k, max(j - 1, 0)], t[k, min(j + 1, 64)]
                found = scipy.optimize.minimize_scalar(
                    lambda x, curve=curve: float(np.hypot(*curve.at(np.array([x]))[0])[0]),
                    bounds=span, method='bounded', options={'xatol': 1e-9 * (span[1] - span[0])},
                )  # fmt: skip
                nearest += [float(found.fun), float(away[k, j])]
        return min(nearest)

    def law(self, follower: Follower, base_radius: float) -> OutlineLaw:
        """Law of a follower on the profile, zero on the base circle [m]."""
        looks = [np.linspace(c.breaks[0], c.breaks[-1], 65) for c in self.curves]
        lift = max(
            float(np.abs(follower.place(*c.at(t), base_radius)[1]).max())
            for c, t in zip(self.curves, looks, strict=True)
        )
        # what rounding leaves of a base circle has no last terms that fall
        rest = _TAIL * max(lift, 0.01 * self.size)
        pieces: list[LawPiece] = []
        first = at = math.nan
        for curve in self.curves:
            if isinstance(curve, Line) and isinstance(follower, FlatFaced | OscillatingFlat):
                continue  # a face lies on all of it at one angle
            begin, rows = _fitted(curve, follower, base_radius, rest)
            if math.isnan(first):
                first = at = begin
            for length, powers in rows:
                pieces.append(LawPiece(length, Polynomial(powers)))
                at += length
        if abs(at - first - TURN) > 1e-3:
            raise InputError(
                f'the follower goes round {math.degrees(at - first):.6g} deg of the profile, not '
                'a whole turn: the profile goes once round the camshaft, counterclockwise'
            )
        share = TURN / (at - first)  # ends of edges miss each other by rounding
        return OutlineLaw(Piecewise(first, _joined([p.scaled(share, 1.0) for p in pieces])))


def _fitted(
    curve: OutlineCurve, follower: Follower, base_radius: float, rest: float
) -> tuple[float, list[tuple[float, Array]]]:
    """Cam angle where a curve begins [rad]; widths and coefficients of the polynomials along it.

    Parameters
    ----------
    rest : largest last terms [m] or [rad]

    Raises
    ------
    InputError
        If the cam angle does not grow along it.
    """

    def place(t: Array) -> tuple[Array, Array]:
        angle, u = follower.place(*curve.at(t.ravel()), base_radius)
        return angle.reshape(t.shape), u.reshape(t.shape)

    # so many parts of each interval that none takes long
    looks = curve.breaks[:-1, None] + np.diff(curve.breaks)[:, None] * _LOOKS
    angle, _ = place(looks)
    wide = np.abs(np.unwrap(angle, axis=1)[:, -1] - angle[:, 0])
    counts = np.ceil(wide / _WIDEST).astype(int).clip(1)
    t = np.concatenate(
        [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(
            curve.breaks[:-1], curve.breaks[1:], counts, strict=True)]
    )  # fmt: skip
    low, high = t, np.append(t[1:], curve.breaks[-1])
    begin = float(place(low[:1])[0][0])
    done: list[tuple[float, float, Array]] = []  # t, width, coefficients
    before = np.full(len(low), np.inf)  # last terms of what parts are halves of
    for _ in range(_ROUNDS):
        looks = low[:, None] + (high - low)[:, None] * _LOOKS
        angle, _ = place(looks)
        back = np.remainder(np.diff(angle, axis=1) + math.pi, TURN) - math.pi <= 0.0
        if back.any():
            worst = float(np.degrees(angle[:, 1:][back][0])) % 360.0
            raise InputError(
                f'the follower cannot touch all of the profile: near {worst:.4g} deg it is too '
                'concave'
            )
        first = angle[:, :1]
        width = np.remainder(angle[:, -1] - angle[:, 0], TURN)
        a, b = np.repeat(low[:, None], len(_NODES), 1), np.repeat(high[:, None], len(_NODES), 1)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (a + b)
            since = np.remainder(place(middle)[0] - first + math.pi, TURN) - math.pi
            over = since > width[:, None] * _NODES
            a, b = np.where(over, a, middle), np.where(over, middle, b)
        _, values = place(0.5 * (a + b))
        tail = np.abs(chebyshev_coefficients(values))[:, -2:].max(axis=1)
        # terms that halving does not lessen are rounding
        good = (tail <= rest) | ((tail > 0.1 * before) & (tail <= _STALLED * rest))
        powers = [fit_powers(v[None], float(h))[0] for v, h in zip(values, width, strict=True)]
        done += [(low[k], float(width[k]), powers[k]) for k in np.flatnonzero(good)]
        low, high, before = low[~good], high[~good], np.tile(tail[~good], 2)
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        if not len(low):
            break
    else:
        raise InputError('the profile is too uneven to be followed: give a smoother one')
    done.sort(key=lambda row: row[0], reverse=bool(curve.breaks[-1] < curve.breaks[0]))
    return begin, [(width, row) for _, width, row in done]


def _joined(pieces: list[LawPiece]) -> list[LawPiece]:
    """Pieces without gaps: each is tilted by the rounding errors at its ends."""
    starts = [p.derivative(0.0, 0) for p in pieces]
    ends = [p.derivative(p.length, 0) for p in pieces]
    joints = [0.5 * (a + b) for a, b in zip(starts, [ends[-1], *ends[:-1]], strict=True)]
    found = []
    for k, piece in enumerate(pieces):
        low, high = joints[k] - starts[k], joints[(k + 1) % len(pieces)] - ends[k]
        tilt = Polynomial([low, (high - low) / piece.length])
        found.append(LawPiece(piece.length, piece.polynomial + tilt))
    return found


def nose_cam(base: float, nose: float, lift: float, flank: float, at: float | None) -> CamOutline:
    """The profile of a base circle and a round nose with flanks between them.

    The nose's centre is ``d = base + lift - nose`` off the camshaft. A flank of radius F touches
    both circles; its triangle of centres has the sides ``F - base``, ``d`` and ``F - nose``.

    Parameters
    ----------
    base, nose : radii [m]
    flank : radius of the flanks [m], negative if hollow; infinite for lines (a tangent cam)
    at : direction of the nose [rad]; by default the rise begins at zero
    """
    d = base + lift - nose
    if not 0.0 < nose < base + 0.5 * lift or d <= 0.0:
        raise InputError(
            f'a nose radius of {1e3 * nose:g} mm does not fit a base circle of {1e3 * base:g} mm '
            f'and a lift of {1e3 * lift:g} mm: make it smaller'
        )
    if math.isinf(flank):
        cosine = (base - nose) / d
    else:
        cosine = ((flank - nose) ** 2 - (flank - base) ** 2 - d**2) / (2.0 * (flank - base) * d)
    if not -1.0 < cosine < 1.0:
        raise InputError(
            f'flanks of {1e3 * flank:g} mm do not touch both a base circle of {1e3 * base:g} mm '
            f'and a nose radius of {1e3 * nose:g} mm that lifts by {1e3 * lift:g} mm'
        )
    half = math.acos(cosine)
    middle = half if at is None else at
    centre = d * math.cos(middle), d * math.sin(middle)

    def on(angle: float, radius: float) -> Vector2:
        return radius * math.cos(angle), radius * math.sin(angle)

    first: OutlineCurve
    last: OutlineCurve
    up, down = middle - half, middle + half
    if math.isinf(flank):
        tips = [(centre[0] + x, centre[1] + y) for x, y in (on(up, nose), on(down, nose))]
        turn = up, down
        first, last = Line(on(up, base), tips[0]), Line(tips[1], on(down, base))
    else:
        a, b = on(up, base - flank), on(down, base - flank)
        # outward normals where flank and nose touch
        away = [
            math.atan2(centre[1] - y, centre[0] - x) + (math.pi if flank < nose else 0.0)
            for x, y in (a, b)
        ]
        turn = (
            up + math.remainder(away[0] - up, TURN),
            down + math.remainder(away[1] - down, TURN),
        )
        first, last = Arc(a, flank, up, turn[0]), Arc(b, flank, turn[1], down)
    rest = Arc((0.0, 0.0), base, down, up + TURN)
    return CamOutline([first, Arc(centre, nose, *turn), last, rest])


class Edge(NamedTuple):
    """A line, or an arc about a centre, in the complex plane [m]; either way round."""

    start: complex
    end: complex
    centre: complex | None = None
    sweep: float = 0.0  #: angle of an arc [rad], positive counterclockwise

    @classmethod
    def arc(cls, centre: complex, radius: float, begin: float, end: float) -> Edge:
        """The arc that goes counterclockwise from one angle to another [rad]."""
        sweep = (end - begin) % TURN or TURN
        a, b = (centre + radius * cmath.exp(1j * x) for x in (begin, begin + sweep))
        return cls(a, b, centre, sweep)

    def moved(self, origin: complex, angle: float, mirrored: bool) -> Edge:
        """Edge seen from an origin, turned by an angle, then mirrored at the real axis."""
        turn = cmath.exp(1j * angle)

        def place(z: complex) -> complex:
            z = (z - origin) * turn
            return z.conjugate() if mirrored else z

        centre = None if self.centre is None else place(self.centre)
        return Edge(
            place(self.start), place(self.end), centre, -self.sweep if mirrored else self.sweep
        )

    def reversed(self) -> Edge:
        """Edge traversed in the opposite direction."""
        return Edge(self.end, self.start, self.centre, -self.sweep)

    @property
    def area(self) -> float:
        """Twice the area between it and the origin [m^2], positive counterclockwise."""
        if self.centre is None:
            return (self.start.conjugate() * self.end).imag
        chord = (self.centre.conjugate() * (self.end - self.start)).imag
        return chord + abs(self.start - self.centre) ** 2 * self.sweep

    @property
    def curve(self) -> OutlineCurve:
        """A part of a profile that is gone round counterclockwise."""
        if self.centre is None:
            return Line((self.start.real, self.start.imag), (self.end.real, self.end.imag))
        hollow, away = self.sweep < 0.0, self.start - self.centre
        begin = cmath.phase(away) + (math.pi if hollow else 0.0)
        radius = -abs(away) if hollow else abs(away)
        return Arc((self.centre.real, self.centre.imag), radius, begin, begin + self.sweep)


def edge_cam(edges: Sequence[Edge]) -> CamOutline:
    """Profile from edges in any order and direction."""
    size = max(abs(z) for edge in edges for z in (edge.start, edge.end))
    rest, chain = list(edges[1:]), [edges[0]]
    while rest:
        end = chain[-1].end
        off, k, back = min(
            (abs(z - end), k, back)
            for k, edge in enumerate(rest)
            for back, z in enumerate((edge.start, edge.end))
        )
        if off > _MEET * size:
            raise InputError(
                f'the edge that ends at ({1e3 * end.real:.6g}, {1e3 * end.imag:.6g}) mm from the '
                'camshaft meets no other one: edges of a profile close'
            )
        edge = rest.pop(k)
        chain.append(edge.reversed() if back else edge)
    if sum(edge.area for edge in chain) < 0.0:
        chain = [edge.reversed() for edge in reversed(chain)]
    return CamOutline([edge.curve for edge in chain])
