"""Distance of a follower from its cam, as an expression of the positions of both.

The frame is that of `followers`. With the place s of the follower (along its line [m], or the
angle of its arm or face to the line of centres [rad]) and the place ``s0 + u`` where it touches,
the distance along the normal is ``D = W (s - s0 - u) + ...`` with ``W = dD/ds``: the cosine of
the pressure angle, for a swinging follower times the arm. D vanishes exactly where the follower
touches, and its derivatives there are those of the true distance, because
``dD/dtheta + u' dD/ds = 0`` along the law. In flight D is the distance to the first order; in a
groove, where the roller has room, to the second, if the acceleration of the law does not jump. The
angle theta of a cam that slides is its displacement [m].

A law of motion made of pieces becomes a table: one row for every piece, of its polynomial about
the middle of the piece and of its wave. The equations of motion know the row of the present piece.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar, Literal, NamedTuple

import heyoka as hy
import numpy as np
from numpy.polynomial import Polynomial

from mechanism_sim.arrays import Array
from mechanism_sim.joints.cam.followers import (
    FlatFaced,
    Oscillating,
    OscillatingFlat,
    Translating,
)
from mechanism_sim.joints.cam.laws import Eccentric, Law, Piecewise, Raised
from mechanism_sim.joints.cam.profiles import Cam, drawing_angles, extent
from mechanism_sim.numerics.symbolic import dense, polynomial
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.points import Vector2, rotate
from mechanism_sim.planar.view import Side

_LONGEST = 0.5 * math.pi  # [rad] of a row: beyond, its own place would be ambiguous

_Path = tuple[JetPair, JetPair, JetPair]
NONE = Jet(None, {}, None, None)
ONE = Jet(hy.expression(1.0), {}, None, None)


@dataclass(frozen=True)
class Distance:
    """The distance of a follower from its cam."""

    name: str  #: name of the joint
    cam: Cam
    #: offset of the follower's point from its line through the camshaft, along y [m], for tilted
    #: faces
    beside: float = 0.0
    #: True if D is of second order; only for rollers and laws without jumps of acceleration, which
    #: would make D jump where the roller is off the middle
    exact: bool = False

    @property
    def swings(self) -> bool:
        """True if the follower's position is an angle."""
        return isinstance(self.cam.follower, Oscillating | OscillatingFlat)

    @property
    def slides(self) -> bool:
        """True if the cam slides."""
        return self.cam.law.reciprocating

    @property
    def lowest(self) -> float:
        """Position of the follower on the base circle, or base line [m, rad]."""
        follower, base = self.cam.follower, self.cam.base_radius
        if isinstance(follower, FlatFaced):
            return base / math.cos(follower.tilt) - self.beside * math.tan(follower.tilt)
        if isinstance(follower, Translating):
            offset = 0.0 if self.slides else follower.offset
            return math.sqrt((base + follower.roller) ** 2 - offset**2)
        if isinstance(follower, Oscillating):
            return follower.lowest(base, self.slides)
        return follower.lowest(base)

    def value(self, frames: Frames, angle: Jet, place: Jet) -> Jet:
        """D [m] at an angle [rad, m] of the cam and a position [m, rad] of the follower."""
        count = 1 if isinstance(self.cam.follower, FlatFaced) else 3 if self.exact else 2
        laws = displacement(self.cam.law, self.name, angle, frames, count)
        # the place at which the follower touches
        at = laws[0] + lift(frames.parameters(f'{self.name}.lowest', self.lowest))
        off = place - at
        if self.swings:  # of any number of turns, and nowhere zero but where the follower touches
            t = 2.0 * hy.tan(0.5 * off.value)
            slope = 1.0 + 0.25 * t * t
            off = off.chain(t, slope, 0.5 * t * slope)
        follower = self.cam.follower
        if isinstance(follower, FlatFaced):
            if not follower.tilt:
                return off
            cosine = frames.parameters(f'{self.name}.cosine', math.cos(follower.tilt))
            return off * lift(cosine)
        if isinstance(follower, OscillatingFlat):
            c, s = hy.cos(at.value), hy.sin(at.value)
            arm, turning = at.chain(c, -s, -c), laws[1] * float(follower.side)
            if not self.slides:
                a = frames.parameters(f'{self.name}.pivot_distance', follower.pivot_distance)
                arm, turning = arm * lift(a), ONE + turning
            return off * arm * _reciprocal(turning)
        path = self._path(frames, at)
        along = self._along(path, laws)
        square = along[0] * along[0] + along[1] * along[1]
        r = hy.sqrt(dense(square.value))
        speed = square.chain(r, 0.5 / r, -0.25 / (r * dense(square.value)))
        way = path[1]
        # n . dP/ds with the normal n = -(tangent turned by 90 degrees)
        across = _cross(way, along) * _reciprocal(speed)
        if not self.exact:
            return off * across
        bend = self._bend(path, along, laws, square, speed)
        return off * (across + off * bend * 0.5)

    def _path(self, frames: Frames, at: Jet) -> _Path:
        """Centre of the roller and its two derivatives by the follower's position."""
        follower, p = self.cam.follower, frames.parameters
        if isinstance(follower, Translating):
            offset = lift(p(f'{self.name}.offset', follower.offset))
            return (at, offset), (ONE, NONE), (NONE, NONE)
        assert isinstance(follower, Oscillating)  # noqa: S101 - the others have no roller
        a = lift(p(f'{self.name}.pivot_distance', follower.pivot_distance))
        b, side = lift(p(f'{self.name}.arm', follower.arm)), float(follower.side)
        c, s = hy.cos(at.value), hy.sin(at.value)
        x, y = b * at.chain(c, -s, -c), b * at.chain(s, c, -s) * side
        return (a - x, -y), (y * side, -(x * side)), (x, y)

    def _along(self, path: _Path, laws: list[Jet]) -> JetPair:
        """Velocity of the roller's centre seen from the cam, per radian or metre."""
        (x, y), way, _ = path
        if self.slides:
            return way[0] * laws[1], way[1] * laws[1] + ONE
        return way[0] * laws[1] - y, way[1] * laws[1] + x

    def _bend(self, path: _Path, along: JetPair, laws: list[Jet], square: Jet, speed: Jet) -> Jet:
        """Second derivative of D by the follower's position, from the pitch curve's curvature."""
        p, way, bent = path
        _, u1, u2 = laws
        p2 = way[0] * u2 + bent[0] * u1 * u1, way[1] * u2 + bent[1] * u1 * u1
        centripetal = (
            p2
            if self.slides
            else (
                p2[0] - way[1] * u1 * 2.0 - p[0],
                p2[1] + way[0] * u1 * 2.0 - p[1],
            )
        )
        beside = way[0] * along[0] + way[1] * along[1]
        curved = _cross(along, centripetal) * beside * beside * _reciprocal(square * square)
        return (_cross(bent, along) + curved) * _reciprocal(speed)


def _cross(a: JetPair, b: JetPair) -> Jet:
    return a[0] * b[1] - a[1] * b[0]


def _reciprocal(x: Jet) -> Jet:
    r = 1.0 / dense(x.value)
    return x.chain(r, -(r * r), 2.0 * (r * r * r))


class Rows(NamedTuple):
    """The pieces of a function as a table.

    Parameters
    ----------
    breaks : (k + 1,) [rad] or [m]
    values : (k, n) the coefficients of the polynomial about the middle of the row, in rising
        order; with waves anywhere also amplitude, frequency and phase there
    terms : number of coefficients among the values
    """

    breaks: Array
    values: Array
    terms: int


@lru_cache(maxsize=16)
def rows_of(function: Piecewise) -> Rows:
    """The rows of a function of pieces; pieces longer than a right angle make several."""
    terms = max(len(p.polynomial) for p in function.pieces)
    waves = any(p.amplitude for p in function.pieces)
    breaks, values = [float(function.breaks[0])], []
    for piece, start in zip(function.pieces, function.breaks.tolist(), strict=False):
        count = math.ceil(piece.length / _LONGEST - 1e-9)
        for i in range(count):
            breaks.append(start + (i + 1) / count * piece.length)
            # a piece as a function of the way from `middle`
            middle = (i + 0.5) / count * piece.length
            coefficients = piece.polynomial(Polynomial([middle, 1.0])).coef.tolist()
            phase = math.remainder(piece.frequency * middle + piece.phase, 2.0 * math.pi)
            padded = [*coefficients, *[0.0] * (terms - len(coefficients))]
            row = [*padded, piece.amplitude, piece.frequency, phase]
            values.append(row if waves else row[:terms])
    breaks[-1] = float(function.breaks[-1])
    return Rows(np.array(breaks), np.array(values), terms)


def displacement(law: Law, name: str, angle: Jet, frames: Frames, count: int = 2) -> list[Jet]:
    """The displacement of a law and its derivatives by the cam angle, `count` in all.

    Parameters
    ----------
    name : name of the table in `frames`
    angle : angle of the cam [rad], with any number of turns, or displacement of a sliding cam [m]
    """
    x = dense(angle.value)
    if isinstance(law, Eccentric):
        found = _eccentric(law, x)
    elif isinstance(law, Raised):
        found = [law.eccentricity * hy.sin(x + 0.5 * math.pi * k) for k in range(count + 2)]
        found[0] = found[0] + law.eccentricity
    elif isinstance(function := getattr(law, 'function', None), Piecewise):
        rows = rows_of(function)
        periodic = not law.reciprocating
        numbers, angle = frames.table(name, angle, rows.breaks, rows.values, periodic)
        found = _piece(numbers, rows.terms, dense(angle.value), count + 2)
    else:
        raise TypeError(f'no expression of {type(law).__name__}')
    return [angle.chain(*found[k : k + 3]) for k in range(count)]


def _piece(
    numbers: tuple[hy.expression, ...], terms: int, x: hy.expression, orders: int
) -> list[hy.expression]:
    """Polynomial and wave, and derivatives, by Horner."""
    found = polynomial(numbers[:terms], x, orders)
    if len(numbers) > terms:
        amplitude, frequency, phase = numbers[terms:]
        turned = frequency * x + phase
        wave = [amplitude * hy.cos(turned), -(amplitude * frequency * hy.sin(turned))]
        for k in range(2, orders):
            wave.append(-(frequency * frequency * wave[k - 2]))
        found = [p + w for p, w in zip(found, wave, strict=False)]
    return found


def _eccentric(law: Eccentric, angle: hy.expression) -> list[hy.expression]:
    """Derivatives of `Eccentric` as expressions: ``q^2 = R^2 - d^2 cos^2`` differentiated."""
    R, d = law.radius, law.eccentricity
    c, s = d * hy.cos(angle), d * hy.sin(angle)
    q = hy.sqrt(R * R - c * c)
    sine, cosine = 2.0 * c * s, c * c - s * s
    q1 = 0.5 * sine / q
    q2 = (cosine - q1 * q1) / q
    q3 = -(2.0 * sine + 3.0 * q1 * q2) / q
    q4 = -(4.0 * cosine + 4.0 * q1 * q3 + 3.0 * q2 * q2) / q
    return [s + q - (R - d), c + q1, q2 - s, q3 - c, q4 + s]


@dataclass(frozen=True)
class PlacedCam(HigherPair):
    """Placement of a cam on `first` and a follower on `second`.

    `on_first` is the camshaft's axis, `on_second` the centre of the roller, the tip of the knife
    or a point of the face. The frame of `followers` has its origin on the axis and its x axis
    along `direction`; the cam angle is ``sense * angle of first + phase``.

    A cam that slides keeps the cam angle 0. What its law goes over is how far it has slid along
    the negative y axis; `on_first` is the point that is then in the origin, abreast of the pivot
    of a swinging follower.
    """

    cam: Cam
    centre: Vector2  #: position of the camshaft, or of a sliding cam's origin, in the world [m]
    direction: float  #: direction of the rise, or from the camshaft to the pivot [rad]
    sense: Literal[1, -1] = 1  #: 1 if the cam angle grows with the angle of `first`
    phase: float = 0.0  #: [rad]
    arm: Vector2 = (1.0, 0.0)
    """From the pivot of a swinging follower to its point [m], in its own frame."""
    beside: float = 0.0  #: offset of the point of a face from the line through the camshaft [m]

    exact: bool = False  #: whether distances are of second order, as for grooves with clearance

    sides: ClassVar[tuple[Side, ...]] = ('right',)
    grooved: ClassVar[bool] = False

    @cached_property
    def extent(self) -> float:
        """Largest distance of the profile from the camshaft, or a sliding cam's origin [m]."""
        law = self.cam.law
        return float(np.hypot(*self.cam.at(drawing_angles(law, extent(law) / 360)).profile).max())

    @property
    def arm_angle(self) -> float:
        """Angle of the arm or face of a swinging follower, in its own frame [rad]."""
        return math.atan2(*self.arm[::-1])

    @property
    def pivot(self) -> Vector2:
        """Pivot of a swinging follower, in its own frame [m]."""
        return self.on_second[0] - self.arm[0], self.on_second[1] - self.arm[1]

    @cached_property
    def distance(self) -> Distance:
        """Distance of the follower from the cam."""
        return Distance(self.name, self.cam, self.beside, self.exact)

    @property
    def mirror(self) -> int:
        """-1 if the frame of `followers`, in which cams rotate clockwise, is mirrored; else 1."""
        return -self.sense

    @property
    def swing(self) -> int:
        """1 if a swinging follower's position grows with counterclockwise rotation, else -1."""
        side: int = getattr(self.cam.follower, 'side', 1)
        return self.mirror * side

    def world(self, vector: Vector2) -> Vector2:
        """A vector of the frame of `followers` in the world."""
        return rotate((vector[0], self.mirror * vector[1]), self.direction)

    def profile(self, points: Array) -> Array:
        """Points (2, N) of the profile from the frame of `Cam`, in that of `first` [m]."""
        x, y = points
        angle = self.direction + self.sense * self.phase
        c, s = math.cos(angle), math.sin(angle)
        y = self.mirror * y
        placed: Array = np.array([c * x - s * y, s * x + c * y])
        placed += np.array(self.on_first)[:, None]
        return placed
