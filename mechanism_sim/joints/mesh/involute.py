"""Involute spur gears: radii, tooth thickness, undercut, drawn teeth ([V] 5.3 to 5.7).

A helical gear is the same in its transverse plane; see `transverse`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError


@dataclass(frozen=True)
class ToothSystem:
    """Shape of the rack that generates the teeth; heights in modules."""

    pressure_angle: float  #: [rad]
    addendum: float = 1.0
    dedendum: float = 1.25

    def __post_init__(self) -> None:
        if not 0.0 < self.pressure_angle < math.pi / 4:
            raise InputError('a pressure angle lies between 0 and 45 deg')
        if not 0.0 < self.addendum <= self.dedendum:
            raise InputError('an addendum is positive and no longer than the dedendum')


FULL_DEPTH = ToothSystem(math.radians(20))


def inv(angle: float) -> float:
    """Involute function tan psi - psi [rad], [V] eq. 5.15; by its series where that cancels."""
    if abs(angle) < 0.01:
        square = angle * angle
        return angle * square * (1 / 3 + square * (2 / 15 + square * (17 / 315)))
    return math.tan(angle) - angle


def inverse_inv(value: float) -> float:
    """Angle psi [rad] between 0 and pi/2 with tan psi - psi = value.

    Newton's method from above: the function is convex, so it does not overshoot.
    """
    if not 0.0 <= value < math.inf:
        raise InputError('the involute function is not negative')
    if value == 0.0:
        return 0.0
    angle = min(math.cbrt(3.0 * value), math.atan(value + math.pi / 2))
    for _ in range(100):
        lower = angle - (inv(angle) - value) / math.tan(angle) ** 2
        if lower >= angle:
            break
        angle = lower
    return angle


def rounded_up(shift: float) -> float:
    """Profile shift rounded up to four digits."""
    return math.ceil(shift * 1e4 - 1e-6) / 1e4


def least_teeth(system: ToothSystem = FULL_DEPTH) -> int:
    """Fewest teeth that a rack cuts without undercut: 2 k/sin^2 phi, [V] eq. 5.30."""
    return math.ceil(2.0 * system.addendum / math.sin(system.pressure_angle) ** 2)


def transverse(normal_pressure_angle: float, helix_angle: float) -> float:
    """Pressure angle [rad] of a helical gear in its plane of rotation: tan = tan phi_n/cos psi.

    The module there is the normal module over cos psi.
    """
    return math.atan2(math.tan(normal_pressure_angle), math.cos(helix_angle))


@dataclass(frozen=True)
class Gear:
    """A spur gear cut by a rack; an internal one has the spaces of the external one as teeth.

    Parameters
    ----------
    teeth : N
    module : m [m]
    system : shape of the rack
    shift : profile shift outwards, in modules
    internal : True if teeth point inwards
    """

    teeth: int
    module: float
    system: ToothSystem = FULL_DEPTH
    shift: float = 0.0
    internal: bool = False

    def __post_init__(self) -> None:
        if self.teeth < 3:
            raise InputError(f'a gear has three teeth or more, not {self.teeth}')
        if not (0.0 < self.module < math.inf and math.isfinite(self.shift)):
            raise InputError('a module is positive, and a profile shift finite')
        name = f'{"internal " if self.internal else ""}gear of {self.teeth} teeth'
        if self.internal:
            if self.tip_radius < self.base_radius:
                raise InputError(f'the {name} has tips inside its base circle')
        elif self.undercut and not self.form_radius < self.tip_radius:
            raise InputError(
                f'the {name} is undercut to its tips: it needs a larger profile shift, or more '
                f'teeth; {least_teeth(self.system)} are free of undercut'
            )
        if not (self.root_radius > 0.0 and self.tip_thickness > 0.0):
            raise InputError(f'the {name} has pointed teeth')

    @property
    def pitch_radius(self) -> float:
        """Radius of the circle on which the rack rolls: m N/2 [m], [V] eq. 5.26."""
        return self.module * self.teeth / 2.0

    @property
    def base_radius(self) -> float:
        """r_p cos phi [m], [V] eq. 5.10."""
        return self.pitch_radius * math.cos(self.system.pressure_angle)

    @property
    def tip_radius(self) -> float:
        """Radius of the addendum circle [m]."""
        height = self.shift + (-1 if self.internal else 1) * self.system.addendum
        return self.pitch_radius + height * self.module

    @property
    def root_radius(self) -> float:
        """Radius of the dedendum circle [m]."""
        depth = -self.shift + (-1 if self.internal else 1) * self.system.dedendum
        return self.pitch_radius - depth * self.module

    @property
    def circular_pitch(self) -> float:
        """Circular pitch pi m along the pitch circle [m], [V] eq. 5.25."""
        return math.pi * self.module

    @property
    def base_pitch(self) -> float:
        """Base pitch, along the base circle and along the line of action [m]."""
        return self.circular_pitch * math.cos(self.system.pressure_angle)

    @property
    def least_shift(self) -> float:
        """Profile shift below which the rack undercuts: k - N sin^2 phi/2, from [V] eq. 5.29."""
        return self.system.addendum - self.teeth * math.sin(self.system.pressure_angle) ** 2 / 2

    @property
    def undercut(self) -> bool:
        """True if the rack cuts a part of the involutes away."""
        return not self.internal and self.shift < self.least_shift - 1e-12

    @property
    def form_radius(self) -> float:
        """Radius [m] at which the involute begins: the base circle, or above it by undercut.

        There the fillet of the rack's rounded corner crosses it, see `undercut.Fillet`.
        """
        return Fillet.of(self).end if self.undercut else self.base_radius

    def profile_angle(self, radius: float) -> float:
        """Angle psi [rad] between involute and radius: cos psi = r_b/r, [V] eq. 5.16."""
        if radius < self.base_radius * (1.0 - 1e-15):
            raise InputError('there is no involute inside the base circle')
        return math.atan2(self.tangent(radius), self.base_radius)

    def tangent(self, radius: float) -> float:
        """Length [m] from the base circle along its tangent to a radius: radius of curvature."""
        b = self.base_radius
        return math.sqrt(max((radius - b) * (radius + b), 0.0))

    def half_angle(self, radius: float) -> float:
        """Half the angle [rad] that a tooth takes at a radius [m], [V] eqs. 5.19, 5.21."""
        pressure = self.system.pressure_angle
        side = -1.0 if self.internal else 1.0
        at_pitch = (math.pi / 2 + side * 2 * self.shift * math.tan(pressure)) / self.teeth
        return at_pitch + side * (inv(pressure) - inv(self.profile_angle(radius)))

    def thickness(self, radius: float) -> float:
        """Thickness of a tooth [m] along the circle of a radius [m]."""
        return 2.0 * radius * self.half_angle(radius)

    @property
    def tip_thickness(self) -> float:
        """Thickness at the addendum circle [m]."""
        return self.thickness(self.tip_radius)

    def flank(self, points: int = 25, fillet: bool = False) -> Array:
        """Upper flank of the tooth about the x axis, root to tip: x, y [m], (points, 2).

        Involute, and inside the base circle a radius ([V] 5.7). [V] eqs. 5.17 to 5.19.

        Parameters
        ----------
        fillet : the root as the rack's rounded corner cuts it, which undercut teeth always have;
            internal teeth, which no rack cuts, have none
        """
        b, root, tip = self.form_radius, self.root_radius, self.tip_radius
        if self.undercut or (fillet and not self.internal):
            cut = Fillet.of(self)
            radii = np.linspace(cut.end, tip, points - points // 2 + 1)[1:]
            angles = np.array([self.half_angle(r) for r in radii])
            involute = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
            return np.concatenate([cut.points(points // 2), involute])
        inner, outer = sorted((max(b, root), tip))
        radial = root < b
        # equal steps along the base circle's tangent
        steps = np.linspace(self.tangent(inner), self.tangent(outer), points - radial)
        radii = np.hypot(b, steps)
        angles = np.array([self.half_angle(r) for r in radii])
        if radial:
            radii, angles = np.append(root, radii), np.append(angles[0], angles)
        if self.internal:
            radii, angles = radii[::-1], angles[::-1]
        return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)

    def outline(
        self, points: int = 25, angle: float = 0.0, arc: int = 0, fillet: bool = False
    ) -> Array:
        """All teeth, counterclockwise, one of them at an angle [rad]: x, y [m], (n, 2).

        Tips and roots have `arc` points between flanks, n = 2 N (points + arc); without, they are
        straight lines. `fillet` is as in `flank`.
        """
        flank = self.flank(points, fillet) @ (1.0, 1.0j)
        inside = np.linspace(-1.0, 1.0, arc + 2)[1:-1]
        half_space, half_tip = math.pi / self.teeth - np.angle(flank[0]), np.angle(flank[-1])
        tip = abs(flank[-1]) * np.exp(1j * half_tip * inside)
        root = abs(flank[0]) * np.exp(1j * (math.pi / self.teeth + half_space * inside))
        tooth = np.concatenate([flank.conj(), tip, flank[::-1], root])
        turns = np.exp(1j * (angle + 2.0 * math.pi * np.arange(self.teeth) / self.teeth))
        ring = np.outer(turns, tooth).ravel()
        return np.stack([ring.real, ring.imag], axis=1)


@dataclass(frozen=True)
class Fillet:
    """The root of a tooth as the rounded corner of the rack cuts it.

    The straight flank of the rack ends an addendum off its middle line; an arc of radius
    ``rho = (dedendum - addendum) m/(1 - sin phi)`` touches it there, and the bottom of the rack.
    Where the arc touches the gear its normal goes through the pitch point: with the arc's centre
    c below the pitch line and x beside the pitch point, at distance l, the point is
    ``(x, -c)(1 + rho/l)``, seen from the gear turned by the way of the rack over r_p.

    Parameters
    ----------
    gear : external gear
    radius : rho [m]
    depth : c [m]
    beside : distance of the arc's centre from the middle of the rack's tooth [m]
    """

    gear: Gear
    radius: float
    depth: float
    beside: float

    @classmethod
    def of(cls, gear: Gear) -> Fillet:
        """Fillet of a gear."""
        system, m, phi = gear.system, gear.module, gear.system.pressure_angle
        radius = (system.dedendum - system.addendum) * m / (1.0 - math.sin(phi))
        half = math.pi * m / 4.0 - system.addendum * m * math.tan(phi)
        depth = (system.dedendum - gear.shift) * m - radius
        return cls(gear, radius, depth, half - radius * math.cos(phi))

    def at(self, x: float) -> tuple[float, float]:
        """Radius [m], and angle [rad] from the middle of the space, at an arc's centre x [m]."""
        r = self.gear.pitch_radius
        grown = 1.0 + self.radius / math.hypot(x, self.depth)
        px, py = x * grown, r - self.depth * grown
        return math.hypot(px, py), math.atan2(px, py) - (x - self.beside) / r

    @property
    def last(self) -> float:
        """Position x [m] at which the arc of the rack ends and its flank begins."""
        return self.depth / math.tan(self.gear.system.pressure_angle)

    @property
    def crossing(self) -> float:
        """Position x [m] at which the fillet touches the involute, or crosses it by undercut.

        Without undercut the arc goes over into the flank of the rack, and the fillet into the
        involute, without a corner.
        """
        if not self.gear.undercut:
            return self.last
        base, space = self.gear.base_radius, math.pi / self.gear.teeth

        def inside(x: float) -> float:
            radius, angle = self.at(x)
            return angle - space + self.gear.half_angle(max(radius, base))

        if self.at(self.last)[0] <= base:  # no more than rounding is cut
            return self.last
        # it comes up inside the involute and has left it where the arc ends
        first = scipy.optimize.brentq(lambda x: self.at(x)[0] - base, 0.0, self.last)
        if inside(first) <= 0.0:
            return float(first)
        return float(scipy.optimize.brentq(inside, first, self.last, xtol=1e-15))

    @property
    def end(self) -> float:
        """Radius [m] at the end of the fillet."""
        return self.at(self.crossing)[0]

    def points(self, count: int) -> Array:
        """Upper side of a tooth about the x axis, root to crossing, (count, 2) [m]."""
        space = math.pi / self.gear.teeth
        places = [self.at(x) for x in np.linspace(0.0, self.crossing, count).tolist()]
        turned = [(r, space - angle) for r, angle in places]
        return np.array([(r * math.cos(a), r * math.sin(a)) for r, a in turned])


def rack_teeth(teeth: int, module: float, system: ToothSystem = FULL_DEPTH) -> Array:
    """Teeth of a rack towards x, counterclockwise, from y = 0 upwards: x, y [m], (4 teeth, 2).

    The pitch line is the y axis; the first tooth is about the x axis. [V] figure 5.11.
    """
    slope = math.tan(system.pressure_angle)
    if teeth < 1 or not 0.0 < module < math.inf:
        raise InputError('a rack has a tooth or more, and a positive module')
    if math.pi / 4 <= system.dedendum * slope:
        raise InputError('a rack with this dedendum has no space between its teeth')
    x = module * np.array([-system.dedendum, system.addendum, system.addendum, -system.dedendum])
    half = math.pi * module / 4.0 - x * slope
    y = half * (-1.0, -1.0, 1.0, 1.0)
    places = math.pi * module * np.arange(teeth)
    return np.stack([np.tile(x, teeth), (places[:, None] + y).ravel()], axis=1)
