"""Gears with backlash, a sprung follower on its cam, a roller in a groove: equations and data.

Each is written down for itself, in SI units, with formulas for what can be had in closed form;
`event_solution` moves them. Data stand here so that scenes can be given the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from event_solution import Machine, Wall
from scipy.optimize import minimize_scalar


@dataclass(frozen=True)
class GearRattle:
    """Two external gears on fixed shafts, angles counterclockwise, in mid-play at angles 0.

    Gear 1 has a constant speed, with a ripple ``ripple sin(frequency t)``; or, with an inertia, a
    motor drives it. On gear 2 acts, counterclockwise, the torque
    ``load + swing sin(frequency t) - drag w2``. Along the line of action, with base radii b,
    x = b1 th1 + b2 th2 is how far gear 1 is ahead, from -j/2 (coast flanks) to j/2 (drive flanks).
    """

    teeth: tuple[int, int] = (20, 40)
    module: float = 2e-3
    pressure_angle: float = math.radians(20)
    play: float = 0.1e-3  #: [m] along the pitch circles
    restitution: float = 0.5
    speed: float = 50.0  #: [rad/s] of gear 1
    ripple: float = 0.0  #: [rad/s]
    wheel_inertia: float = 2e-3  #: [kg m^2]
    load: float = 0.5  #: [N m]
    swing: float = 1.5  #: [N m]
    frequency: float = 100.0  #: [rad/s], two cycles a turn of gear 1
    drag: float = 0.0  #: [N m s/rad]
    pinion_inertia: float = math.inf  #: [kg m^2]; finite: a motor drives
    stall_torque: float = 0.0  #: [N m]
    no_load_speed: float = math.inf  #: [rad/s]

    @property
    def base_radii(self):
        """[m]."""
        return tuple(n * self.module * math.cos(self.pressure_angle) / 2 for n in self.teeth)

    @property
    def normal_play(self):
        """[m] along the line of action."""
        return self.play * math.cos(self.pressure_angle)

    @property
    def start(self):
        """Angles and rates: in mid-play, without relative speed."""
        return (0.0, 0.0), (self.speed, -self.speed * self.teeth[0] / self.teeth[1])

    def acceleration(self, t, _, v):
        """Of both gears without contact."""
        phase = self.frequency * t
        if math.isinf(self.pinion_inertia):
            first = self.ripple * self.frequency * np.cos(phase)
        else:
            first = self.stall_torque * (1 - v[0] / self.no_load_speed) / self.pinion_inertia
        torque = self.load + self.swing * np.sin(phase) - self.drag * v[1]
        return np.array([first + 0.0 * t, torque / self.wheel_inertia])

    @property
    def machine(self):
        """For `event_solution`."""
        b, half = np.array(self.base_radii), self.normal_play / 2

        def wall(name, sign):
            return Wall(
                name,
                lambda q: half - sign * (b[0] * q[0] + b[1] * q[1]),
                lambda q: -sign * np.multiply.outer(b, np.ones(q.shape[1:])),
                lambda _, v: 0.0 * v[0],
            )

        return Machine(
            (self.pinion_inertia, self.wheel_inertia),
            self.acceleration,
            (wall('drive', 1.0), wall('coast', -1.0)),
            self.restitution,
            2 * math.pi / self.frequency / 50,
        )

    def mesh_force(self, t):
        """[N] along the line of action without play, for a prescribed pinion and no drag."""
        (b1, b2), (first, second) = self.base_radii, self.acceleration(t, None, self.start[1])
        return (b1 * first + b2 * second) * self.wheel_inertia / b2**2


class EccentricLaw:
    """A circle under a flat face: u = e (1 + sin x), half-way up at x = 0."""

    def __init__(self, eccentricity):
        self.eccentricity = eccentricity
        self.breaks = ()

    def __call__(self, x, order=0):
        return self.eccentricity * ((order == 0) + np.sin(x + order * math.pi / 2))


class CycloidalLaw:
    """Rise from x = 0 on, dwell and return; the acceleration is continuous."""

    def __init__(self, lift, rise, dwell, back):
        self.lift, self.rise, self.dwell, self.back = lift, rise, dwell, back
        self.breaks = (0.0, rise, rise + dwell, rise + dwell + back)

    def __call__(self, x, order=0):
        x = np.mod(x, 2 * math.pi)
        up, down = x / self.rise, (self.breaks[3] - x) / self.back
        first = x < self.breaks[2]
        s, scale = np.where(first, up, down), np.where(first, 1 / self.rise, -1 / self.back)
        s, scale = np.clip(s, 0.0, 1.0), self.lift * scale**order
        turn = 2 * math.pi
        shape = (
            lambda s: s - np.sin(turn * s) / turn,
            lambda s: 1 - np.cos(turn * s),
            lambda s: turn * np.sin(turn * s),
        )[order]
        return scale * shape(s)


@dataclass(frozen=True)
class SprungFollower:
    """A translating follower pressed on a cam by a spring with preload.

    The cam has a constant speed; or, with an inertia, a motor drives it.

    m u'' = -k u - c u' - P + force; P is the preload at u = 0, with weight and other loads. A flat
    face under any law; a knife or a roller too, since the gap u - s(x) vanishes where they touch,
    and the restitution of rates in this direction and along the normal is the same.
    """

    law: object = EccentricLaw(5e-3)
    mass: float = 0.2  #: [kg]
    stiffness: float = 4000.0  #: [N/m]
    preload: float = 30.0  #: [N]
    damping: float = 0.0  #: [N s/m]
    speed: float = 300.0  #: [rad/s] of the cam
    restitution: float = 0.3
    cam_inertia: float = math.inf  #: [kg m^2]; finite: a motor drives, for laws without breaks
    stall_torque: float = 0.0  #: [N m]
    no_load_speed: float = math.inf  #: [rad/s]

    def acceleration(self, _, q, v):
        """Of cam and follower without contact."""
        torque = self.stall_torque * (1 - v[0] / self.no_load_speed)
        push = self.stiffness * q[1] + self.damping * v[1] + self.preload
        return np.array([torque / self.cam_inertia, -push / self.mass])

    def machine(self, turns):
        """For `event_solution`, from x = 0 on."""
        law = self.law
        wall = Wall(
            'cam',
            lambda q: q[1] - law(q[0]),
            lambda q: np.array([-law(q[0], 1), 1.0 + 0.0 * q[1]]),
            lambda q, v: -law(q[0], 2) * v[0] ** 2,
        )
        stops = [(b + 2 * math.pi * n) / self.speed for n in range(turns) for b in law.breaks]
        return Machine(
            (self.cam_inertia, self.mass),
            self.acceleration,
            (wall,),
            self.restitution,
            2 * math.pi / self.speed / 50,
            tuple(stops),
        )

    @property
    def start(self):
        """In contact at cam angle 0."""
        return (0.0, float(self.law(0.0))), (self.speed, self.speed * float(self.law(0.0, 1)))

    def contact_force(self, x, speed=None):
        """[N] along the follower's direction while in contact, at cam angles."""
        w = self.speed if speed is None else speed
        u, u1, u2 = (self.law(x, k) for k in range(3))
        return self.mass * w**2 * u2 + self.damping * w * u1 + self.stiffness * u + self.preload

    @property
    def lift_off_speed(self):
        """[rad/s] at which contact with an eccentric is lost somewhere first, in closed form.

        With u = e (1 + sin x) the least force is P + k e - e |k - m w^2 + i c w|; it vanishes at
        m^2 W^2 - (2 k m - c^2) W = (P/e + k)^2 - k^2, W = w^2. Without damping this is
        w^2 = (P/e + 2 k)/m, and contact is lost at the top.
        """
        m, k, c = self.mass, self.stiffness, self.damping
        half, right = k * m - c**2 / 2, (self.preload / self.law.eccentricity + k) ** 2 - k**2
        return math.sqrt((half + math.sqrt(half**2 + m**2 * right)) / m**2)

    @property
    def lift_off_angle(self):
        """[rad] where contact with an eccentric is lost at that speed."""
        w = self.lift_off_speed
        return math.atan2(self.mass * w**2 - self.stiffness, -self.damping * w)

    def least_lift_off_speed(self, samples=4001):
        """[rad/s] and angle of lift-off for any law: the least speed over x that ends the force.

        At each x the force is a quadratic in the speed.
        """

        def speed(x):
            u, u1, u2 = (self.law(x, k) for k in range(3))
            a, b, c = self.mass * u2, self.damping * u1, self.stiffness * u + self.preload
            with np.errstate(invalid='ignore', divide='ignore'):
                root = np.sqrt(b * b - 4 * a * c)
                # the positive root is small over large where a < 0 or b < 0
                found = np.array([2 * c / (-b + root), 2 * c / (-b - root)])
            return np.min(np.where(found > 0.0, found, np.inf), axis=0)

        x = np.linspace(0, 2 * math.pi, samples)
        best, step = x[np.argmin(speed(x))], x[1]
        found = minimize_scalar(
            speed, bounds=(best - step, best + step), method='bounded', options={'xatol': 1e-10}
        )
        return float(found.fun), float(found.x)

    def energy(self, q, v):
        """[J] of follower and spring."""
        u = q[1]
        return self.mass * v[1] ** 2 / 2 + self.stiffness * u**2 / 2 + self.preload * u


@dataclass(frozen=True)
class GrooveCam:
    """A radial roller in an eccentric circular groove, with clearance.

    The groove's centre line is a circle of the radius R whose centre is at e (cos x, sin x) when
    the cam has turned by x; the roller's centre moves along the y axis, upwards. Walls touch it at
    the distances R -+ c/2 from the circle's centre, exactly. A spring and a load may act.
    """

    radius: float = 40e-3  #: [m]
    eccentricity: float = 10e-3  #: [m]
    clearance: float = 0.1e-3  #: [m]
    mass: float = 0.3  #: [kg]
    load: float = 20.0  #: [N] inwards
    speed: float = 120.0  #: [rad/s] of the cam
    restitution: float = 0.3

    def acceleration(self, _, q, v):
        """Of cam and follower without contact."""
        return np.array([0.0 * q[0], 0.0 * v[1] - self.load / self.mass])

    @property
    def machine(self):
        """For `event_solution`."""
        e = self.eccentricity

        def distance(q):
            return np.hypot(e * np.cos(q[0]), q[1] - e * np.sin(q[0]))

        def row(q):
            # D^2 = e^2 - 2 e y sin x + y^2
            slopes = np.array([-e * q[1] * np.cos(q[0]), q[1] - e * np.sin(q[0])])
            return slopes / distance(q)

        def bend(q, v):
            x, y = q
            square = e * y * np.sin(x) * v[0] ** 2 - 2 * e * np.cos(x) * v[0] * v[1] + v[1] ** 2
            return (square - (row(q) * v).sum(axis=0) ** 2) / distance(q)

        def wall(name, side, at):
            return Wall(
                name,
                lambda q: side * (distance(q) - at),
                lambda q: side * row(q),
                lambda q, v: side * bend(q, v),
            )

        half = self.clearance / 2
        return Machine(
            (math.inf, self.mass),
            self.acceleration,
            (wall('inner', 1.0, self.radius - half), wall('outer', -1.0, self.radius + half)),
            self.restitution,
            2 * math.pi / self.speed / 50,
        )

    @property
    def start(self):
        """In the middle of the groove at cam angle 0, without speed across it."""
        e = self.eccentricity
        y = math.sqrt(self.radius**2 - e**2)
        return (0.0, y), (self.speed, e * self.speed)
