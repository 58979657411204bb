"""Laws of motion of a follower: its displacement over the angle of the cam ([V] 4.3).

A displacement is in metres, or in radians for a follower that oscillates. The laws of a
reciprocating cam go over its own displacement in metres, from one end of its stroke to the other;
what is said of angles holds for it. The classical curves, and splines, are functions made of
pieces, each a polynomial plus a cosine, with exact derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, TypeAlias

import numpy as np
import scipy
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.sampled import SampledPeak, acceleration_peaks, spline_through

TURN = 2.0 * math.pi
DERIVATIVES = ('displacement', 'velocity', 'acceleration', 'jerk')
_ROUNDING = 8.0 * np.finfo(float).eps  # of the greatest displacement: of values of a piece


@dataclass(frozen=True)
class LawPiece:
    """``polynomial(s) + amplitude*cos(frequency*s + phase)`` for s from 0 to `length`."""

    length: float
    polynomial: Polynomial
    amplitude: float = 0.0
    frequency: float = 1.0
    phase: float = 0.0

    def derivative(self, s: float, order: int) -> float:
        """The derivative of an order from 0 up, at s from the beginning of the piece."""
        p = self.polynomial.deriv(order) if order else self.polynomial
        turned = self.frequency * s + self.phase + order * np.pi / 2
        return float(p(s) + self.amplitude * self.frequency**order * np.cos(turned))

    def magnified(self, order: int) -> float:
        """Bound on a derivative of the polynomial, relative to its value (V. A. Markov)."""
        square, steps = self.polynomial.degree() ** 2, range(order)
        ratios = (2.0 / self.length * max(square - k**2, 0) / (2 * k + 1) for k in steps)
        return math.prod(ratios)

    def scaled(self, span: float, height: float) -> LawPiece:
        """The piece drawn `span` times as long and `height` times as high."""
        rows = enumerate(self.polynomial.coef)
        return LawPiece(
            self.length * span,
            Polynomial([height * float(c) / span**k for k, c in rows]),
            self.amplitude * height,
            self.frequency / span,
            self.phase,
        )

    def mirrored(self) -> LawPiece:
        """The piece run backwards."""
        return LawPiece(
            self.length,
            self.polynomial(Polynomial([self.length, -1.0])),
            self.amplitude,
            self.frequency,
            -self.frequency * self.length - self.phase,
        )


class Piecewise:
    """A function of pieces laid end to end.

    Parameters
    ----------
    start : start of the first piece
    pieces : pieces of positive length
    """

    def __init__(self, start: float, pieces: Sequence[LawPiece]) -> None:
        self.pieces = tuple(pieces)
        self.breaks: Array = start + np.cumsum([0.0, *(p.length for p in pieces)])
        self._waves: Array = np.array([(p.amplitude, p.frequency, p.phase) for p in pieces]).T

    @cached_property
    def _polynomials(self) -> scipy.interpolate.PPoly:
        size = max(len(p.polynomial) for p in self.pieces)
        rows = [np.pad(p.polynomial.coef, (0, size - len(p.polynomial))) for p in self.pieces]
        return scipy.interpolate.PPoly(np.array(rows).T[::-1], self.breaks)

    def __call__(self, x: ArrayLike, order: int = 0, left: bool = False) -> Array:
        """The derivative of an order from 0 up at x, in the shape of x.

        At a break it is the limit from the right, or from the left if `left`. Beyond the ends
        the outermost pieces go on.
        """
        x = np.asarray(x, dtype=float)
        last = len(self.pieces) - 1
        i = np.clip(np.searchsorted(self.breaks, x, 'left' if left else 'right') - 1, 0, last)
        s = x - self.breaks[i]
        value = np.zeros_like(s)
        for row in self._polynomials.derivative(order).c:
            value = value * s + row[i]
        amplitude, frequency, phase = self._waves[:, i]
        wave = amplitude * frequency**order * np.cos(frequency * s + phase + order * np.pi / 2)
        return np.asarray(value + wave)

    def mirrored(self) -> Piecewise:
        """The function run backwards over the same interval."""
        return Piecewise(float(self.breaks[0]), [p.mirrored() for p in reversed(self.pieces)])


def from_spline(spline: scipy.interpolate.PPoly) -> Piecewise:
    """The pieces of a polynomial spline."""
    parts = zip(np.diff(spline.x), spline.c[::-1].T, strict=True)
    return Piecewise(float(spline.x[0]), [LawPiece(float(h), Polynomial(c)) for h, c in parts])


@dataclass(frozen=True)
class Segment:
    """A rise, or a return if `rise` is negative, between two cam angles.

    Parameters
    ----------
    start, end : [rad], less than a turn apart; of a reciprocating cam [m]
    rise : [m] or [rad]; zero is a dwell
    curve : the normalised rise; a return runs it backwards
    own : True if the curve is the displacement itself, over the angle [rad]
    """

    start: float
    end: float
    rise: float
    curve: Piecewise
    own: bool = False

    def pieces(self, level: float) -> list[LawPiece]:
        """The segment from a displacement on."""
        curve = self.curve if self.own or self.rise >= 0 else self.curve.mirrored()
        foot = level if self.own else min(level, level + self.rise)
        span, height = (1.0, 1.0) if self.own else (self.end - self.start, abs(self.rise))
        raised = []
        for piece in curve.pieces:
            part = piece.scaled(span, height)
            higher = part.polynomial + Polynomial([foot])
            raised.append(
                LawPiece(part.length, higher, part.amplitude, part.frequency, part.phase)
            )
        return raised


class PiecewiseLaw:
    """A law made of pieces.

    Attributes
    ----------
    function : displacement over a turn, or the stroke of a sliding cam
    reciprocating : the cam slides
    """

    function: Piecewise
    reciprocating: bool = False

    @property
    def breaks(self) -> Array:
        """Angles (n,) where derivatives may jump, over a turn or stroke, both ends among them."""
        return self.function.breaks

    def __call__(self, angle: ArrayLike, order: int = 0, left: bool = False) -> Array:
        """The displacement (order 0) or a derivative by the angle at angles of any shape.

        At a break it is the limit from the right, or from the left if `left`.
        """
        return self.function(_within(self, angle, left), order, left)


class Diagram(PiecewiseLaw):
    """The displacement diagram of segments; between them the follower dwells.

    The lowest of the levels between segments is the zero of the displacement.

    Parameters
    ----------
    segments : segments in the order of their angles
    reciprocating : the cam slides; its stroke is from the first segment to the last, and the
        follower need not come back
    """

    def __init__(self, segments: Sequence[Segment], reciprocating: bool = False) -> None:
        if not segments:
            raise InputError('a displacement diagram needs a segment')
        rises = [s.rise for s in segments]
        if not all(math.isfinite(v) for s in segments for v in (s.start, s.end, s.rise)):
            raise InputError('angles and rises of a displacement diagram are finite numbers')
        if not reciprocating and abs(sum(rises)) > 1e-12 * max(map(abs, rises)):
            raise InputError(f'the follower does not return: its rises add up to {sum(rises):g}')
        levels = np.cumsum([0.0, *rises])
        levels -= levels.min()
        self.segments = tuple(segments)
        #: between the highest and the lowest level [m] or [rad]
        self.lift = float(levels.max())
        self.reciprocating = reciprocating
        first = segments[0].start
        last = segments[-1].end if reciprocating else first + TURN
        starts = [s.start for s in segments[1:]] + [last]
        pieces: list[LawPiece] = []
        for segment, following, low, high in zip(
            segments, starts, levels[:-1], levels[1:], strict=True
        ):
            if segment.end <= segment.start:
                raise InputError(f'the segment {self._span(segment)} has no positive length')
            dwell = following - segment.end
            if dwell < -1e-12:
                raise InputError(
                    f'the segment {self._span(segment)} overlaps the next one, which begins at '
                    f'{spelled(following, reciprocating=reciprocating)}: segments stand in the '
                    'order of their angles'
                )
            pieces += segment.pieces(float(low))
            if dwell > 1e-12:
                pieces.append(LawPiece(dwell, Polynomial([float(high)])))
        self.function = Piecewise(first, pieces)

    def _span(self, segment: Segment) -> str:
        ends = spelled(segment.start, segment.end, reciprocating=self.reciprocating)
        return f'from {ends}'


class MeasuredLaw(PiecewiseLaw):
    """The spline through measured points: periodic, or for a reciprocating cam with free ends.

    Of odd degree; the default 5 leaves the jerk smooth. Free ends are those of the spline that has
    no knot at the outermost points inside ("not-a-knot"). With an error of measurement it is the
    smoothest spline whose distance from the points has that root mean square.

    Parameters
    ----------
    angle : [rad], shape (n,), increasing, over less than a turn; n > degree; of a reciprocating
        cam [m]
    displacement : [m] or [rad], shape (n,)
    reciprocating : the cam slides; its stroke is from the first point to the last
    error : standard deviation of the displacements [m] or [rad]; 0 goes through the points

    Attributes
    ----------
    degree : as given
    """

    def __init__(
        self,
        angle: ArrayLike,
        displacement: ArrayLike,
        degree: int = 5,
        reciprocating: bool = False,
        error: float = 0.0,
    ) -> None:
        x, y = np.asarray(angle, dtype=float), np.asarray(displacement, dtype=float)
        if x.ndim != 1 or x.shape != y.shape or len(x) <= degree:
            raise InputError(
                f'a measured law of degree {degree} needs {degree + 1} angles at least, and as '
                'many displacements'
            )
        if degree < 1 or degree % 2 == 0:
            raise InputError('the degree of a measured law is odd')
        if not (np.isfinite(x).all() and np.isfinite(y).all()):
            raise InputError('measured angles and displacements are finite numbers')
        closed = not reciprocating and abs(x[-1] - x[0] - TURN) <= 1e-9
        if closed and abs(y[-1] - y[0]) <= 1e-9 * np.ptp(y):  # the first point again
            x, y = x[:-1], y[:-1]
        if not (np.diff(x) > 0).all() or (x[-1] - x[0] >= TURN and not reciprocating):
            ends = spelled(x[0], x[-1], reciprocating=reciprocating)
            bare = '; numbers without a unit are radians: beside a file write units: [deg, mm]'
            bare = bare if x[-1] - x[0] > 2.0 * TURN else ''
            raise InputError(
                'measured angles increase, and end before the turn is full, or where it is full '
                f'at the same displacement: these go from {ends}{bare}'
            )
        if not reciprocating:
            x, y = np.append(x, x[0] + TURN), np.append(y, y[0])
        self.degree, self._samples = degree, (x, y, degree, not reciprocating, error)
        self.reciprocating = reciprocating
        self.function = from_spline(spline_through(*self._samples))

    @cached_property
    def peaks(self) -> tuple[SampledPeak, SampledPeak]:
        """Least and greatest second derivative, with their errors."""
        return acceleration_peaks(*self._samples)


class _Circular:
    """Law of a cam that is a circle."""

    reciprocating: ClassVar[bool] = False

    @property
    def breaks(self) -> Array:
        """The ends of the turn only: everything is smooth."""
        return np.array([0.0, TURN])


@dataclass(frozen=True)
class Eccentric(_Circular):
    """The circular cam under a radial knife-edge follower, or the pitch circle under a roller.

    [V] 4.7, above the lowest position; at angle 0 it is half-way up. Derivatives up to the third.

    Parameters
    ----------
    radius, eccentricity : [m], the former larger
    """

    radius: float
    eccentricity: float

    def __post_init__(self) -> None:
        if not 0 < self.eccentricity < self.radius < math.inf:
            raise InputError('the eccentricity of a circular cam is positive, below its radius')

    def __call__(self, angle: ArrayLike, order: int = 0, left: bool = False) -> Array:
        """Derivative of the displacement of an order from 0 to 3, as of `Diagram`."""
        R, d, g = self.radius, self.eccentricity, np.asarray(angle, dtype=float)
        # q^2 = R^2 - d^2 cos^2 g, differentiated again and again
        q = np.sqrt(R**2 - (d * np.cos(g)) ** 2)
        q1 = 0.5 * d**2 * np.sin(2 * g) / q
        q2 = (d**2 * np.cos(2 * g) - q1**2) / q
        q3 = -(2 * d**2 * np.sin(2 * g) + 3 * q1 * q2) / q
        roots = (q - (R - d), q1, q2, q3)
        return np.asarray(d * np.sin(g + order * math.pi / 2) + roots[order])


@dataclass(frozen=True)
class Raised(_Circular):
    """The circular cam under a flat face across its motion: ``e (1 + sin(angle))``.

    Above the lowest position, as `Eccentric`; the base radius is that of the circle less e.

    Parameters
    ----------
    eccentricity : e [m]
    """

    eccentricity: float

    def __post_init__(self) -> None:
        if not 0 < self.eccentricity < math.inf:
            raise InputError('the eccentricity of a circular cam is positive')

    def __call__(self, angle: ArrayLike, order: int = 0, left: bool = False) -> Array:
        """Derivative of the displacement of any order, as of `Diagram`."""
        wave = np.sin(np.asarray(angle, dtype=float) + order * math.pi / 2)
        return np.asarray(self.eccentricity * (wave + (order == 0)))


Law: TypeAlias = PiecewiseLaw | Eccentric | Raised
"""A displacement as a function of the cam angle: periodic, unless the cam reciprocates."""


@dataclass(frozen=True)
class Jump:
    """A derivative of a law that jumps.

    Parameters
    ----------
    angle : position of the jump [rad] or [m]
    order : order of the derivative: 0 for the displacement, up to 3 for the jerk
    before, after : limits from the left and the right, by radians or metres of the cam
    reciprocating : the cam slides
    """

    angle: float
    order: int
    before: float
    after: float
    reciprocating: bool = False

    def __str__(self) -> str:
        at = spelled(self.angle, reciprocating=self.reciprocating)
        return (
            f'at {at} the {DERIVATIVES[self.order]} jumps from '
            f'{self.before:.6g} to {self.after:.6g}, by {self.after - self.before:.6g}'
        )


def check_smoothness(law: Law, order: int = 2, tolerance: float = 1e-9) -> list[Jump]:
    """Find violations of the smoothness requirements of a law ([V] 4.8), sorted by angle.

    Parameters
    ----------
    order : highest derivative that should not jump, 3 at most
    tolerance : of the greatest value of a derivative over a turn, what counts as a jump, unless
        the rounding of polynomials of high degree over short pieces is more
    """
    x = law.breaks
    # where a turn ends the next one begins; the ends of a stroke join nothing
    seam = [] if law.reciprocating else [0]
    start, end = np.append(x[seam], x[1:-1]), np.append(x[::-1][seam], x[1:-1])
    grid = np.linspace(x[0], x[-1], 1001)
    rounding = _ROUNDING * float(np.abs(law(grid)).max())
    pieces = law.function.pieces if isinstance(law, PiecewiseLaw) else ()
    jumps: list[Jump] = []
    for k in range(order + 1):
        after, before = law(start, k), law(end, k, left=True)
        greatest = max(np.abs(a).max(initial=0.0) for a in (after, before, law(grid, k)))
        blurred = rounding * max((piece.magnified(k) for piece in pieces), default=0.0)
        jumps += [
            Jump(float(start[i]), k, float(before[i]), float(after[i]), law.reciprocating)
            for i in np.flatnonzero(np.abs(after - before) > max(tolerance * greatest, blurred))
        ]
    return sorted(jumps, key=lambda j: (j.angle, j.order))


def spelled(*places: float, reciprocating: bool) -> str:
    """Text of positions of a cam: in degrees, or in millimetres if it slides."""
    numbers = (1e3 * x if reciprocating else math.degrees(x) for x in places)
    return ' to '.join(f'{x:g}' for x in numbers) + (' mm' if reciprocating else ' deg')


def _within(law: Law, angle: ArrayLike, left: bool) -> Array:
    """Angles moved into the turn that begins at the first break; from the left, its end."""
    angle, start, end = np.asarray(angle, dtype=float), law.breaks[0], law.breaks[-1]
    if law.reciprocating:
        beyond = np.maximum(start - angle, angle - end)
        if (beyond > 1e-9 * (end - start)).any():
            at = float(angle.flat[int(beyond.argmax())])
            raise InputError(
                f'{spelled(at, reciprocating=True)} lies beyond the stroke of the cam, from '
                f'{spelled(float(start), float(end), reciprocating=True)}'
            )
        return angle
    # what lies in the turn already keeps its last bit, so that it still meets the breaks
    inside = (angle >= start) & (angle <= end)
    x = np.where(inside, angle, start + np.mod(angle - start, TURN))
    return np.where(x == start, end, x) if left else np.where(x == end, start, x)
