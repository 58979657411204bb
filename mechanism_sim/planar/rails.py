"""The axis of an elastic link as a rail: position of a point that slides along it when bent.

In the link's frame a point (X, Y) has its foot on the axis at the place x of the undeformed beam,

    x = X - u(X) + (Y - w) w',   away = cos(a) (Y - w(x)) + sin(a) (Y - w) w',   tan(a) = w'(x)

with the deflection w and the elongation u of `mechanism_sim.planar.elastic`: the distance from the
axis to the second order in elastic coordinates. Foreshortening would change it in the third. The
axis goes straight on beyond the ends of the beam. Derivatives by all coordinates follow, those of
the curvature of the rail among them: what slides along a bent rail is accelerated across.

Such guides close loops and never belong to the tree: what they carry turns with a cross-section,
whose angle is no coordinate.
"""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import heyoka as hy

from mechanism_sim.numerics.symbolic import dense, polynomial
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift
from mechanism_sim.planar.mechanism import Mechanism, StraightLine
from mechanism_sim.planar.points import Vector2, rotate
from mechanism_sim.tolerances import TOLERANCES

_MECHANISM = TOLERANCES.mechanism


class Foot(NamedTuple):
    """Foot of a point on a rail."""

    away: Jet  #: [m] distance of the point from the line, to the left
    cosine: Jet  #: of the rail's direction there in its link's frame, with `sine`
    sine: Jet
    way: JetPair  #: unit vector along the line, in the world
    slip: Jet  #: [m/s] velocity of the point along the rail, see `Gap.slip`

    @property
    def normal(self) -> JetPair:
        """Unit vector to the left of the line."""
        x, y = self.way
        return -y, x

    @property
    def turned(self) -> Jet:
        """Angular velocity of the rail's direction there in its link's frame [rad/s]."""
        return self.cosine.across(self.sine)


@dataclass(frozen=True)
class Rail:
    """A line along the axis of an elastic link, or beside it."""

    name: str  #: name of the joint, for parameters
    mechanism: Mechanism
    link: str
    height: float  #: [m] offset to the left of the axis
    sense: float  #: 1 along the link's x axis, -1 against it

    def foot(self, frames: Frames, point: JetPair, label: str, thick: bool = False) -> Foot:
        """Foot of a point of the world [m].

        Parameters
        ----------
        label : name of the point
        thick : True if the point may be off the axis
        """
        m, beam = self.mechanism, self.mechanism.having(Beam)[self.link]
        ux, uy = frames.position(m.direction(self.link, 0.0), f'{self.name}.rail.x')
        origin = m.point(self.link, deformed=False)
        ox, oy = frames.position(origin, f'{self.name}.rail.origin')
        x, y = point[0] - ox, point[1] - oy
        across = ux * y - uy * x
        breaks, rows = beam.axis_pieces()
        numbers, place = frames.table(f'{label}.rail', ux * x + uy * y, breaks, rows, False)
        order = len(numbers) // len(beam.names)
        shapes = [numbers[k * order : (k + 1) * order] for k in range(len(beam.names))]
        amplitudes = [frames.displacement(f'{self.link}.{name}') for name in beam.names]
        zero = Jet(None, {}, None, None)

        def bent(place: Jet) -> JetPair:
            """Deflection and slope."""
            found = zero, zero
            for q, shape in zip(amplitudes[: beam.modes], shapes, strict=False):
                f = polynomial(shape, dense(place.value), 4)
                found = found[0] + q * place.chain(*f[:3]), found[1] + q * place.chain(*f[1:])
            return found

        for q, shape in zip(amplitudes[beam.modes :], shapes[beam.modes :], strict=True):
            place = place - q * place.chain(*polynomial(shape, dense(place.value), 3))
        w, slope = bent(place)
        moved = zero
        if thick or self.height:
            moved = (across - w) * slope
            place = place + moved
            w, slope = bent(place)
        t = dense(slope.value)
        c = 1.0 / hy.sqrt(1.0 + t * t)
        cosine = slope.chain(c, -(t * c * c * c), c * c * c * (3.0 * t * t * c * c - 1.0))
        sine = slope * cosine
        away = (across - w) * cosine + sine * moved
        height = frames.parameters(f'{self.name}.rail.height', self.height)
        if height is not None:
            away = away - height
        way = ux * cosine - uy * sine, uy * cosine + ux * sine
        longer = slope.chain(1.0 / c, t * c, c * c * c)
        slip = longer.times_rate(place)
        if self.sense < 0.0:
            away, slip, way = -away, -slip, (-way[0], -way[1])
        return Foot(away, cosine, sine, way, slip)


def rail_of(mechanism: Mechanism, name: str, line: StraightLine) -> Rail | None:
    """Rail of a line along the axis of an elastic link; None for any other line.

    Any other line is straight, and goes with the cross-section at its point.
    """
    if line.link not in mechanism.having(Beam) or abs(math.sin(line.axis)) > _MECHANISM.parallel:
        return None
    return Rail(name, mechanism, line.link, line.on[1], math.copysign(1.0, math.cos(line.axis)))


def along(
    mechanism: Mechanism, frames: Frames, line: StraightLine, angle: float, label: str
) -> JetPair:
    """The unit vector at an angle [rad] to a line that is straight, in the world."""
    return frames.position(mechanism.direction(line.link, line.axis + angle, line.on), label)


def chord(mechanism: Mechanism, frames: Frames, link: str, a: Vector2, b: Vector2) -> Jet:
    """Rotation of the line between two points of an elastic link in the link's frame [rad].

    Parameters
    ----------
    a, b : [m] undeformed points in the link's frame
    """
    beam, apart = mechanism.having(Beam)[link], (b[0] - a[0], b[1] - a[1])
    there, here = beam.arms(b), beam.arms(a)
    label, none = f'links:{link}.chord:{a}:{b}', (0.0, 0.0)
    along = lift(dense(frames.parameters(f'{label}.length', math.hypot(*apart))))
    across = Jet(None, {}, None, None)
    for k, names in enumerate(dict.fromkeys((*there, *here))):
        d = [p - q for p, q in zip(there.get(names, none), here.get(names, none), strict=True)]
        x, y = rotate((d[0], d[1]), -math.atan2(apart[1], apart[0]))
        size = reduce(operator.mul, (frames.displacement(f'{link}.{name}') for name in names))
        along += size * lift(dense(frames.parameters(f'{label}.{k}.x', x)))
        across += size * lift(dense(frames.parameters(f'{label}.{k}.y', y)))
    r = 1.0 / dense(along.value)
    slope = across * along.chain(r, -(r * r), 2.0 * (r * r * r))
    t = dense(slope.value)
    less = 1.0 / (1.0 + t * t)
    return slope.chain(hy.atan(t), less, -2.0 * t * less * less)
