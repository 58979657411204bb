"""A bearing whose pin and bushing are out of line: it touches at its ends.

Pin and bushing are circles in the two end planes of the bearing: exact to the first order in the
inclinations, which are of the size of clearance over length. For larger ones see F. Marques,
F. Isaac, N. Dourado and P. Flores, An enhanced formulation to model spatial revolute joints with
radial and axial clearances, Mechanism and Machine Theory 116 (2017) 123-144.

A bearing may have stops along its axis, too, see `AxialStop`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import ClassVar

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.joints.revolute.bearing import BearingClearance
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.frames import Frames, Jet, lift
from mechanism_sim.planar.gaps import ENDS, FrictionlessGap, gap_name
from mechanism_sim.planar.mechanism import Mechanism, Revolute
from mechanism_sim.planar.points import GROUND, Point, Vector2
from mechanism_sim.planar.protocols import Wrench, moment_of


@dataclass(frozen=True)
class BearingEnd(BearingClearance):
    """An end of a bearing, see there; Q is that of its plane."""

    bearing: str = ''  #: name of the joint
    pin: Vector2 = (0.0, 0.0)  #: offset of the pin's axis from the joint's point [m]
    bushing: Vector2 = (0.0, 0.0)  #: offset of the bushing's axis from the joint's point [m]
    height: float = 0.0  #: height above the plane of the links [m]
    reach: float = 0.0  #: height above the middle of the bearing [m]

    thrust: ClassVar[float] = 0.0
    softness: ClassVar[float] = 1e-9
    """Two ends that stick in links that do not lean hold the same, giving way so little."""

    @property
    def joint(self) -> str:
        """Name of the joint."""
        return self.bearing

    @property
    def apart(self) -> Point:
        """Vector from the bushing's axis to the pin's, in the plane of this end."""
        return self.mechanism.separation(self.bearing, self.pin, self.bushing, self.height)

    def wrench(self, frames: Frames, N: Term, T: Term) -> Wrench:
        """Wrench on the bushing's link, about the joint's point, as far as it is in the plane."""
        pressed = super().wrench(frames, N, T)
        off = self.mechanism.offset(
            self.mechanism.joint(self.bearing).second, self.bushing, self.height
        )
        x, y = frames.position(off, f'{self.name}.bushing')
        turning = moment_of((x.value, y.value), (pressed.x, pressed.y))
        return pressed._replace(moment=add(pressed.moment, turning))

    def moment(self, q: Array, N: Array, T: Array) -> Array:
        """Moment (2, N) [N m] on the bushing about the bearing's middle, square to its axis.

        Parameters
        ----------
        q : (n, N) coordinates
        N, T : (N,) normal and friction force [N]
        """
        x, y = self.mechanism.trace(self.apart, q)[0]
        size = np.hypot(x, y)
        x, y = (np.divide(a, size, out=np.zeros_like(a), where=size > 0.0) for a in (x, y))
        return self.reach * np.array([T * x - N * y, N * x + T * y])


def bearing_ends(
    gap: BearingClearance, length: float, pin: Vector2, bushing: Vector2, along: float = 0.0
) -> Iterator[BearingEnd]:
    """The gaps at both ends of a bearing whose pin and bushing are out of line.

    Exact to the first order in the inclinations: pin and bushing are circles in the end planes.

    Parameters
    ----------
    gap : gap of the aligned bearing; its contact law is that of each end
    length : length of the bearing [m]
    pin, bushing : inclinations of the axes [rad], the way each leans towards the reader, in the
        frame of its link
    along : height of its middle above the plane of the links [m]; matters for tilting links
    """
    joint, m = gap.mechanism.joint(gap.name), gap.mechanism
    assert isinstance(joint, Revolute)  # noqa: S101 - a bearing is
    known = {field.name: getattr(gap, field.name) for field in fields(gap)}
    for end, reach in zip(ENDS, (0.5 * length, -0.5 * length), strict=True):
        on_pin, on_bushing = ((reach * x, reach * y) for x, y in (pin, bushing))
        known['name'] = gap_name(m, joint, end)
        yield BearingEnd(
            **known, bearing=joint.name, pin=on_pin, bushing=on_bushing, height=along + reach,
            reach=reach,
        )  # fmt: skip


@dataclass(frozen=True)
class AxialStop(FrictionlessGap):
    """A face at an end of a bearing, on which the collar of the first link comes to rest.

    With the way z of the first link against the second along the axis, and the inclination s of
    one face against the other, the gap is ``play -+ z - (sqrt(k^2 + r^2 s.s) - k)``: that of half
    an ellipsoid of radius r and height k on a plane. With ``r |s|`` well above k it touches at its
    rim, the gap is ``play -+ z - r |s|``; in line it touches in the middle.
    """

    name: str
    joint: str
    mechanism: Mechanism
    thrust: float  #: 1 for the stop of the first link's motion towards the reader, else -1
    play: float  #: axial clearance from the middle [m]
    radius: float = 0.0  #: radius r [m]; 0 for a face without moment
    crown: float = 0.0  #: height k of the face's middle above its rim [m]
    pin: Vector2 = (0.0, 0.0)  #: [rad] inclination by manufacture, in the frame of its link
    bushing: Vector2 = (0.0, 0.0)  #: [rad]

    @property
    def _ends(self) -> tuple[tuple[str, Vector2, float], tuple[str, Vector2, float]]:
        joint = self.mechanism.joint(self.joint)
        return (joint.first, joint.on_first, 1.0), (joint.second, joint.on_second, -1.0)

    @property
    def _inclination(self) -> Point:
        """Inclination of the first link's face against the second's; empty if it has no effect."""
        known = self.mechanism.inclination(self.joint, self.pin, self.bushing)
        return known if self.radius else {}

    def value(self, frames: Frames) -> Jet:
        """The distance of the faces [m]."""
        gap = lift(dense(frames.parameters(f'{self.name}.play', self.play)))
        for link, at, sign in self._ends:
            for c, slope in self.mechanism.rise(link, at).items():
                way = frames.parameters(f'{self.name}.way:{c}', -self.thrust * sign * slope)
                if way is not None:
                    gap += frames.displacement(c) * way
        if not self._inclination:
            return gap
        x, y = frames.position(self._inclination, f'{self.name}.face')
        square = dense(frames.parameters(f'{self.name}.face_square', self.radius**2))
        crown = dense(frames.parameters(f'{self.name}.crown', self.crown))
        half = x.half_square() + y.half_square()
        if half.value is None:
            return gap
        inner = 2.0 * square * half.value
        root = hy.sqrt(crown * crown + inner)
        return gap - half.chain(
            inner / (root + crown), square / root, -square * square / (root * root * root)
        )

    def wrench(self, frames: Frames, N: Term, _: Term) -> Wrench:
        """A moment in the plane is left where faces are out of line by manufacture."""
        turning = self.value(frames).gradient if self._inclination else {}
        moment: Term = None
        for link, _at, sign in reversed(self._ends):  # on the second link, or minus on the first
            frame = self.mechanism.frame(link)[0]
            if frame != GROUND and moment is None:
                moment = mul(N, turning.get(frame))
                moment = neg(moment) if sign > 0.0 else moment
        return Wrench(None, None, moment)

    def moment(self, q: Array, N: Array, _: Array) -> Array:
        """Moment (2, N) [N m] on the second link about the bearing's middle, see `BearingEnd`."""
        x, y = self.mechanism.trace(self._inclination, q)[0]
        root = np.sqrt(self.crown**2 + self.radius**2 * (x * x + y * y))
        arm = np.divide(self.radius**2, root, out=np.zeros_like(root), where=root > 0.0)
        return np.asarray(N * arm * np.array([-y, x]))


def seat(clearance: float, towards: Array, off: Array) -> Array:
    """Rest position of a loaded pin in a bushing whose axis is not in line.

    The lens that two circles have in common: on the arc of an end, or in the corner of both.

    Parameters
    ----------
    clearance : radial clearance [m]
    towards : (2,) unit vector of the load on the pin
    off : (2,) vector from bushing's to pin's axis at the front end [m], concentric in the middle

    Returns
    -------
    Vector from the bushing's centre to the pin's in the middle of the bearing (2,) [m].
    """
    along = float(towards @ off)
    square = float(off @ off)
    if abs(along) * clearance >= square:
        return np.asarray(clearance * towards - math.copysign(1.0, along) * off)
    across = np.array([-off[1], off[0]])
    side = math.sqrt((clearance**2 - square) / square)
    return np.asarray(math.copysign(side, float(towards @ across)) * across)
