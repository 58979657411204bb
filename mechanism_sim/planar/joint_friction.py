"""Coulomb friction in ideal joints: journals, guides and slots that rub under their own load.

What rubs is one number T per joint, on the second-named link: a moment about the pin, or a force
along the line. While it slides ``T = -b sign(rate)``; while it sticks T is what keeps the rate at
zero, as long as ``|T| <= b``. The bound b grows with the joint's own force, which depends on T:
equations for all T at once, solved by Newton's method.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics.symbolic import Term, add, div, mul, neg
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.jet import Jet
from mechanism_sim.planar.loads import Load, Wrench, moment_of, together
from mechanism_sim.planar.mechanism import Joint, Mechanism, Prismatic
from mechanism_sim.planar.switches import Switch

Array = NDArray[np.float64]

_SHARES = (0.25, 0.5, 0.75, 1.0)  # of the friction, one after the other
_SOUND = 1e-6
"""Determinant of the equations, 1 without friction, at which it locks."""

RESOLUTION = 1e-9
"""Of the weight of all links on Earth: a smaller force in a joint is none, as far as it rubs.

It rounds the corner of ``|R|`` at zero: a bound errs by twice this, times its coefficient.
"""

STANDARD_GRAVITY = 9.80665  # m/s^2


class Pressed(NamedTuple):
    """``coefficient sqrt(components^2 + resolution^2)``, one term of a bound."""

    coefficient: Term
    components: Sequence[Term]  #: [N] linear in the joint's wrench
    resolution: Term  #: [N]


@dataclass(frozen=True)
class JointFriction(ABC):
    """Friction in an ideal joint."""

    name: str  #: of the joint
    mechanism: Mechanism
    coefficient: float  #: Coulomb's

    @property
    def joint(self) -> Joint:
        """The joint that rubs."""
        return self.mechanism.joint(self.name)

    @property
    @abstractmethod
    def words(self) -> str:
        """How it rubs, in words."""

    @abstractmethod
    def slip(self, frames: Frames) -> Jet:
        """Rate of the second-named link against the first [rad/s, m/s], with its derivatives."""

    @abstractmethod
    def loads(self, frames: Frames, T: Term) -> list[Load]:
        """What T does to both links."""

    @abstractmethod
    def wrench(self, frames: Frames, T: Term) -> Wrench:
        """The same as part of what the joint does to the second-named link."""

    @abstractmethod
    def pressed(self, frames: Frames, wrench: Wrench) -> list[Pressed]:
        """The terms of the bound of |T|, by what the joint carries without its friction."""

    @abstractmethod
    def loss(self, force: Array, moment: Array, q: Array, v: Array) -> Array:
        """Power (N,) lost to it [W].

        Parameters
        ----------
        force, moment : (2, N) [N] and (N,) [N m] of the first-named on the second-named link
        q, v : (n, N) coordinates and rates
        """

    def _number(self, frames: Frames, key: str, value: float) -> Term:
        return frames.parameters(f'{self.name}.friction.{key}', value)

    def _resolution(self, frames: Frames) -> Term:
        mass = sum(body.mass for body in self.mechanism.bodies) or 1.0
        return self._number(frames, 'resolution', RESOLUTION * mass * STANDARD_GRAVITY)


@dataclass(frozen=True)
class JournalFriction(JointFriction):
    """A pin in its bearing, R tangent to its friction circle: ``b = mu/sqrt(1 + mu^2) r |R|``.

    That is the limit of a pin with clearance that slides in its bushing under the force R, whose
    normal part is ``R/sqrt(1 + mu^2)``.
    """

    radius: float = 0.0  #: [m] of the pin

    @property
    def words(self) -> str:
        """By the radius of its friction circle."""
        circle = self.radius * self.coefficient / math.hypot(1.0, self.coefficient)
        return f'coefficient {self.coefficient:g}, friction circle of radius {1e3 * circle:.4g} mm'

    def slip(self, frames: Frames) -> Jet:
        """Of the angles."""
        j, m = self.joint, self.mechanism
        first = frames.turn(m.turns(j.first, j.on_first), f'{self.name}.friction.first')
        second = frames.turn(m.turns(j.second, j.on_second), f'{self.name}.friction.second')
        return _rate(second - first)

    def loads(self, _: Frames, T: Term) -> list[Load]:
        """A moment on each."""
        j = self.joint
        return [
            Load(f'{self.name}.friction.first', j.first, j.on_first, moment=neg(T)),
            Load(f'{self.name}.friction.second', j.second, j.on_second, moment=T),
        ]

    def wrench(self, _: Frames, T: Term) -> Wrench:
        """A moment."""
        return Wrench(None, None, T)

    def loss(self, force: Array, moment: Array, q: Array, v: Array) -> Array:
        """By the moment."""
        index, j = self.mechanism.coordinates.index, self.joint
        first, second = (
            sum((x * v[index(c)] for c, x in turns.items()), np.zeros(v.shape[1]))
            for turns in (
                self.mechanism.turns(j.first, j.on_first),
                self.mechanism.turns(j.second, j.on_second),
            )
        )
        return -moment * (second - first)

    def pressed(self, frames: Frames, wrench: Wrench) -> list[Pressed]:
        """By the size of the force."""
        arm = self.radius * self.coefficient / math.hypot(1.0, self.coefficient)
        return [
            Pressed(
                self._number(frames, 'arm', arm), (wrench.x, wrench.y), self._resolution(frames)
            )
        ]


@dataclass(frozen=True)
class LineFriction(JointFriction):
    """What slides along a straight line: a block in a guide, or a pin in a slot.

    A block of a given length L carries a moment with its ends:
    ``b = mu (|N/2 + M/L| + |N/2 - M/L|)`` with the moment M about its middle, the joint's point on
    the second-named link.
    """

    length: float = 0.0  #: [m] of a block along its guide; 0: only the force across counts

    @property
    def words(self) -> str:
        """By the angle of friction."""
        angle = math.degrees(math.atan(self.coefficient))
        ends = f', both ends of {1e3 * self.length:g} mm' if self.length else ''
        return f'coefficient {self.coefficient:g}, friction angle {angle:.4g} deg{ends}'

    @cached_property
    def _guided(self) -> bool:
        """Whether the line belongs to the first-named link; that of a slot to the second."""
        return isinstance(self.joint, Prismatic)

    def _direction(self, frames: Frames, angle: float, what: str) -> tuple[Jet, Jet]:
        joint: Any = self.joint  # both kinds have an axis
        link = joint.first if self._guided else joint.second
        return frames.position(
            self.mechanism.direction(link, joint.axis + angle), f'{self.name}.{what}'
        )

    def _along(self, frames: Frames) -> tuple[Jet, Jet]:
        return self._direction(frames, 0.0, 'along')

    def slip(self, frames: Frames) -> Jet:
        """Along the line."""
        for link, joint in self.mechanism.tree_joints.items():
            if joint.name == self.name:
                return _rate(frames.displacement(link))
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        ux, uy = self._along(frames)
        return _rate(-(ux * x + uy * y))

    def loads(self, frames: Frames, T: Term) -> list[Load]:
        """Opposite forces at the place of contact: the block's point, or the pin."""
        j, (x, y) = self.joint, self.wrench(frames, T)[:2]
        first, second = f'{self.name}.friction.first', f'{self.name}.friction.second'
        return [
            Load(first, j.first, j.on_first, (neg(x), neg(y))),
            Load(second, j.second, j.on_second, (x, y), self._moment(frames, T)),
        ]

    def _moment(self, frames: Frames, T: Term) -> Term:
        """Of the force on the second-named link about its own point; along a guide none."""
        if self._guided:
            return None
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        ux, uy = self._along(frames)
        return moment_of((x.value, y.value), (mul(T, ux.value), mul(T, uy.value)))

    def wrench(self, frames: Frames, T: Term) -> Wrench:
        """A force along the line."""
        ux, uy = self._along(frames)
        return Wrench(mul(T, ux.value), mul(T, uy.value), self._moment(frames, T))

    def loss(self, force: Array, moment: Array, q: Array, v: Array) -> Array:
        """By the force along the line."""
        j: Any = self.joint
        angle = self.mechanism.angle_all(j.first if self._guided else j.second, q) + j.axis
        way = np.array([np.cos(angle), np.sin(angle)])
        slip = self.mechanism.velocity_all(j.second, q, v, j.on_second)
        slip = slip - self.mechanism.velocity_all(j.first, q, v, j.on_first)
        lost: Array = -(way * force).sum(axis=0) * (way * slip).sum(axis=0)
        return lost

    def pressed(self, frames: Frames, wrench: Wrench) -> list[Pressed]:
        """By the force across, or by those at both ends."""
        nx, ny = self._direction(frames, 0.5 * math.pi, 'across')
        across = add(mul(wrench.x, nx.value), mul(wrench.y, ny.value))
        mu, none = self._number(frames, 'coefficient', self.coefficient), self._resolution(frames)
        if not self.length:
            return [Pressed(mu, (across,), none)]
        couple = div(wrench.moment, self._number(frames, 'length', self.length))
        half = mul(across, 0.5)
        return [Pressed(mu, (add(half, x),), none) for x in (couple, neg(couple))]


class Rub(NamedTuple):
    """A friction in the equations of a mechanism."""

    friction: JointFriction
    T: hy.expression  #: its symbol
    switch: Switch  #: of its slip
    slip: Jet
    loads: list[Load]

    @property
    def power_lost(self) -> Term:
        """What it dissipates [W]."""
        return neg(mul(self.T, self.slip.rate))


def rubs(frictions: Sequence[JointFriction], frames: Frames) -> list[Rub]:
    """The frictions of joints that move, each with a symbol and a switch of its own."""
    found = []
    for k, friction in enumerate(frictions):
        slip, T = friction.slip(frames), hy.make_vars(f'friction{k}')
        if slip.rate is not None:
            switch = frames.slip(f'joints:{friction.name}.friction', slip.rate)
            found.append(Rub(friction, T, switch, slip, friction.loads(frames, T)))
    return found


_LEFT, _STEPS = 1e-13, 60  # of a bound, and how often Newton's method may try


def solve_friction(
    start: Array, slopes: Array, numbers: Array, ways: Array, sizes: Sequence[Sequence[int]]
) -> tuple[Array, Array]:
    """Every T of known motions, by Newton's method, while the friction grows from none to all.

    Parameters
    ----------
    start, slopes : (c, N) and (m, c, N) [N] components of all bounds without friction, and by
        each T
    numbers : (2 p, N) coefficient and resolution of each of their p terms
    ways : (m, N) -1, 0 or 1: the sign of T
    sizes : of each friction, how many components its terms have

    Returns
    -------
    T (m, N), and where it was found (N,): elsewhere it grows beyond all bounds on the way.
    """
    m, count = ways.shape
    T, sound = np.zeros((m, count)), np.ones(count, bool)
    for share in _SHARES:
        for _ in range(_STEPS):
            b, slope = _bounds(start + np.einsum('mcn,mn->cn', slopes, T), slopes, numbers, sizes)
            left = T - share * ways * b
            matrix = np.eye(m)[:, :, None] - share * ways[:, None] * slope
            along = np.moveaxis(matrix, 2, 0)
            sound &= np.linalg.det(along) > _SOUND
            along[~sound] = np.eye(m)
            step = np.linalg.solve(along, left.T[:, :, None])[:, :, 0].T
            T = np.where(sound, T - step, 0.0)
            if (np.abs(step) <= _LEFT * b).all(axis=0)[sound].all():
                break
        else:
            sound &= (np.abs(step) <= 1e3 * _LEFT * b).all(axis=0)
    return T, sound


def _bounds(
    components: Array, slopes: Array, numbers: Array, sizes: Sequence[Sequence[int]]
) -> tuple[Array, Array]:
    """Bounds (m, N), and their derivatives (m, m, N) by each T."""
    m, _, count = slopes.shape
    bound, slope = np.zeros((m, count)), np.zeros((m, m, count))
    i = p = 0
    for k, terms in enumerate(sizes):
        for size in terms:
            own = slice(i, i + size)
            coefficient, resolution = numbers[2 * p], numbers[2 * p + 1]
            root = np.sqrt((components[own] ** 2).sum(axis=0) + resolution**2)
            bound[k] += coefficient * root
            slope[k] += coefficient * (components[own] * slopes[:, own]).sum(axis=1) / root
            i, p = own.stop, p + 1
    return bound, slope


def with_friction(
    rubs: Sequence[Rub], reactions: Mapping[str, Wrench], frames: Frames
) -> dict[str, Wrench]:
    """The wrenches of all joints, with what rubs in them."""
    found = dict(reactions)
    for rub in rubs:
        name = rub.friction.name
        found[name] = together(found[name], rub.friction.wrench(frames, rub.T))
    return found


def _rate(jet: Jet) -> Jet:
    """Only the rate of a function and its derivatives."""
    return Jet(None, jet.gradient, jet.rate, jet.curvature)
