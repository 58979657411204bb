"""Coulomb friction in ideal joints, under their own load.

What rubs is one number T per joint, on the second-named link: a moment about the pin, or a force
along the line. While it slides ``T = -b sign(rate)``; while it sticks T is what keeps the rate at
zero, as long as ``|T| <= b``. The bound b grows with the joint's own force, which depends on T:
equations for all T at once, solved by Newton's method: in `engine.holding` for equations of
motion, in `solve_friction` for known motions. The derivation is in docs/physics.md.
"""

from __future__ import annotations

import math
import operator
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import Term, add, dense, div, mul, neg
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift
from mechanism_sim.planar.mechanism import HigherPair, Joint, Mechanism, Prismatic
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.planar.protocols import Load, Wrench, moment_of, together
from mechanism_sim.planar.rails import along
from mechanism_sim.planar.switches import Switch
from mechanism_sim.planar.touch import Touch
from mechanism_sim.tolerances import TOLERANCES

_JOINT_FRICTION = TOLERANCES.joint_friction
_MECHANISM = TOLERANCES.mechanism

_SHARES = (0.25, 0.5, 0.75, 1.0)  # of the friction, one after the other


_AGAINST = '; where {1} slips, it has this size and opposes the slip'

_STANDARD_GRAVITY = 9.80665  # m/s^2


class Pressed(NamedTuple):
    """``coefficient sqrt(components^2 + resolution^2)``, one term of a bound.

    With a single component whose sign is known it is linear: ``coefficient side component``. One
    of a wall is zero where its component has the other sign.
    """

    coefficient: Term
    components: Sequence[Term]  #: force components [N], linear in the joint's wrench
    resolution: Term  #: smoothing force [N]
    side: Term = None  #: sign of a single component, 1 or -1; 0 for an unloaded wall
    wall: int = 0  #: 1 or -1


@dataclass(frozen=True)
class JointFriction(ABC):
    """Friction in an ideal joint."""

    name: str  #: name of the joint
    mechanism: Mechanism
    coefficient: float  #: Coulomb's coefficient

    @property
    def joint(self) -> Joint:
        """Joint with the friction."""
        return self.mechanism.joint(self.name)

    @property
    def label(self) -> str:
        """Name of the friction, different for different walls of a joint."""
        return self.name

    @property
    @abstractmethod
    def words(self) -> str:
        """Describe the friction in words."""

    @property
    @abstractmethod
    def law(self) -> str:
        """Law that bounds it, in words; {0} is its symbol, {1} the joint."""

    @property
    def unit(self) -> str:
        """Unit of T."""
        return 'N'

    @abstractmethod
    def slip(self, frames: Frames) -> Jet:
        """Rate of the second-named link against the first [rad/s, m/s], with its derivatives."""

    @abstractmethod
    def loads(self, frames: Frames, T: Term) -> list[Load]:
        """Loads of T on both links."""

    @abstractmethod
    def wrench(self, frames: Frames, T: Term) -> Wrench:
        """Contribution of friction to the joint's wrench on the second-named link."""

    @abstractmethod
    def pressed(self, frames: Frames, wrench: Wrench) -> list[Pressed]:
        """The terms of the bound of |T|, from the joint's wrench without its friction."""

    def loss(self, force: Array, moment: Array, q: Array, v: Array) -> Array:
        """Dissipated power (N,) [W] of the friction, from the joint's force and motion.

        Parameters
        ----------
        force, moment : (2, N) [N] and (N,) [N m] of the first-named on the second-named link
        q, v : (n, N) coordinates and rates
        """
        ends = self.joint.points
        (first, first_rate), (second, second_rate) = (self.mechanism.trace(e, q, v) for e in ends)
        w1, w2 = self._rates(v)
        x, y = second - first
        slip = second_rate - (first_rate + w1 * np.array([-y, x]))
        lost: Array = -(force * slip).sum(axis=0) - moment * (w2 - w1)
        return lost

    def _rates(self, v: Array) -> Array:
        """Angular velocities (2, N) [rad/s] of both links at the joint."""
        index, none = self.mechanism.coordinates.index, np.zeros(v.shape[1])
        return np.array([
            sum((x * v[index(c)] for c, x in self.mechanism.turns(*end).items()), none)
            for end in self.joint.points
        ])  # fmt: skip

    def _number(self, frames: Frames, key: str, value: float) -> Term:
        return frames.parameters(f'{self.label}.friction.{key}', value)

    def _resolution(self, frames: Frames) -> Term:
        mass = sum(body.mass for body in self.mechanism.bodies) or 1.0
        return self._number(
            frames, 'resolution', _JOINT_FRICTION.resolution * mass * _STANDARD_GRAVITY
        )


@dataclass(frozen=True)
class JournalFriction(JointFriction):
    """A pin in its bearing, R tangent to its friction circle: ``b = mu/sqrt(1 + mu^2) r |R|``.

    That is the limit of a pin with clearance that slides in its bushing under the force R, whose
    normal part is ``R/sqrt(1 + mu^2)``.
    """

    radius: float = 0.0  #: radius of the pin [m]

    unit = 'N m'

    @property
    def _circle(self) -> float:
        """Radius of the friction circle [m]."""
        return self.radius * self.coefficient / math.hypot(1.0, self.coefficient)

    @property
    def law(self) -> str:
        """Law of friction in words, by the force of the pin."""
        return f'|{{0}}| <= {self._circle:.6g} m times the force in {{1}}{_AGAINST}'

    @property
    def words(self) -> str:
        """Describe the friction by the radius of its friction circle."""
        circle = 1e3 * self._circle
        return f'coefficient {self.coefficient:g}, friction circle of radius {circle:.4g} mm'

    def slip(self, frames: Frames) -> Jet:
        """Relative angular velocity of the links."""
        j, m = self.joint, self.mechanism
        first = frames.turn(m.turns(j.first, j.on_first), f'{self.name}.friction.first')
        second = frames.turn(m.turns(j.second, j.on_second), f'{self.name}.friction.second')
        return (second - first).as_rate

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

    def pressed(self, frames: Frames, wrench: Wrench) -> list[Pressed]:
        """Normal force: the size of the pin's force."""
        arm = self._number(frames, 'arm', self._circle)
        return [Pressed(arm, (wrench.x, wrench.y), self._resolution(frames))]


@dataclass(frozen=True)
class LineFriction(JointFriction):
    """Friction along a straight line: of a block in a guide, or a pin in a slot.

    A block of a given length L carries a moment with its ends:
    ``b = mu (|N/2 + M/L| + |N/2 - M/L|)`` with the moment M about its middle, the joint's point on
    the second-named link.
    """

    length: float = 0.0  #: length [m] of a block along its guide; 0: no moment counts

    @property
    def law(self) -> str:
        """Law of friction in words, by the force across, or the forces at both ends."""
        ends = f' at both ends of {self.length:g} m' if self.length else ''
        return f'|{{0}}| <= {self.coefficient:g} times the force across {{1}}{ends}{_AGAINST}'

    @property
    def words(self) -> str:
        """Describe the friction by its angle."""
        angle = math.degrees(math.atan(self.coefficient))
        ends = f', both ends of {1e3 * self.length:g} mm' if self.length else ''
        return f'coefficient {self.coefficient:g}, friction angle {angle:.4g} deg{ends}'

    @cached_property
    def _guided(self) -> bool:
        """True if the line belongs to the first-named link; that of a slot to the second."""
        return isinstance(self.joint, Prismatic)

    def _direction(self, frames: Frames, angle: float, what: str) -> JetPair:
        line = self.joint.line
        assert line is not None  # noqa: S101 - something slides along it
        return along(self.mechanism, frames, line, angle, f'{self.name}.{what}')

    def _along(self, frames: Frames) -> JetPair:
        return self._direction(frames, 0.0, 'along')

    def slip(self, frames: Frames) -> Jet:
        """Slip along the line."""
        for link, joint in self.mechanism.tree_joints.items():
            if joint.name == self.name:
                return frames.displacement(link).as_rate
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        ux, uy = self._along(frames)
        return (-(ux * x + uy * y)).as_rate

    def loads(self, frames: Frames, T: Term) -> list[Load]:
        """Opposite forces at the place of contact: the block's point, or the pin."""
        j, (x, y) = self.joint, self.wrench(frames, T)[:2]
        first, second = f'{self.name}.friction.first', f'{self.name}.friction.second'
        return [
            Load(first, j.first, j.on_first, (neg(x), neg(y))),
            Load(second, j.second, j.on_second, (x, y), self._moment(frames, T)),
        ]

    def _moment(self, frames: Frames, T: Term) -> Term:
        """Moment of the force on the second-named link about its own point; none along a guide."""
        if self._guided:
            return None
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        ux, uy = self._along(frames)
        return moment_of((x.value, y.value), (mul(T, ux.value), mul(T, uy.value)))

    def wrench(self, frames: Frames, T: Term) -> Wrench:
        """A force along the line."""
        ux, uy = self._along(frames)
        return Wrench(mul(T, ux.value), mul(T, uy.value), self._moment(frames, T))

    def pressed(self, frames: Frames, wrench: Wrench) -> list[Pressed]:
        """Normal forces: the force across, or those at both ends."""
        nx, ny = self._direction(frames, 0.5 * math.pi, 'across')
        across = add(mul(wrench.x, nx.value), mul(wrench.y, ny.value))
        mu, none = self._number(frames, 'coefficient', self.coefficient), self._resolution(frames)
        if not self.length:
            return [Pressed(mu, (across,), none)]
        couple = div(wrench.moment, self._number(frames, 'length', self.length))
        half = mul(across, 0.5)
        return [Pressed(mu, (add(half, x),), none) for x in (couple, neg(couple))]


@dataclass(frozen=True)
class TeethFriction(JournalFriction):
    """Friction of sliding teeth: mean loss, by the mean distance from the pitch point.

    They slide at that distance times the rate of one gear against the other. The bound is
    ``mu arm N`` of the force N normal to the teeth, with `radius` as the arm.
    """

    share: float = 1.0  #: ratio of N to the force along the line of action in the plane

    @property
    def law(self) -> str:
        """Law of friction in words, by the force normal to the teeth."""
        arm = self.coefficient * self.radius
        return f'|{{0}}| <= {arm:.6g} m times the force normal to the teeth of {{1}}{_AGAINST}'

    @property
    def words(self) -> str:
        """Describe the friction by the mean distance of contact from the pitch point."""
        arm = f'{1e3 * self.radius:.4g} mm'
        return f'coefficient {self.coefficient:g}, contact {arm} from the pitch point on the mean'

    def loss(self, force: Array, moment: Array, q: Array, v: Array) -> Array:
        """``mu arm N`` times the rate of one gear against the other [W].

        The force and the moment take other power: of errors, and of teeth that give way.
        """
        w1, w2 = self._rates(v)
        arm = self.coefficient * self.share * self.radius
        return np.asarray(arm * np.hypot(*force) * np.abs(w2 - w1))

    def pressed(self, frames: Frames, wrench: Wrench) -> list[Pressed]:
        """Normal force: the tangential force, of opposite sign where the other flanks bear."""
        joint = self.joint
        if not isinstance(joint, HigherPair):
            raise TypeError(f'{self.name} is no higher pair')
        closure = joint.closure(self.mechanism)
        one, other = (closure.wrench(frames, [hy.expression(x)]) for x in (1.0, -1.0))
        x, y = add(one.x, neg(other.x)), add(one.y, neg(other.y))  # 2 cos(pressure angle) long
        square = add(mul(x, x), mul(y, y))
        tangential = div(mul(_along(wrench, x, y), 2.0), square)
        arm = self._number(frames, 'arm', self.coefficient * self.share * self.radius)
        return [Pressed(arm, (tangential,), self._resolution(frames))]


@dataclass(frozen=True)
class FlankFriction(JointFriction):
    """Flanks of gears on crossing shafts, by moments: ``b = mu N`` of the force N across them.

    They slide at ``a1 w1 + a2 w2`` with the rates of both links against their carrier.
    """

    arms: tuple[float, float] = (0.0, 0.0)  #: [m] a1 and a2
    lever: float = 1.0  #: lever arm of N about the second shaft [m]
    carrier: str = GROUND

    @property
    def law(self) -> str:
        """Law of friction in words, by the force across the flanks."""
        return f'|{{0}}| <= {self.coefficient:g} times the force across the flanks{_AGAINST}'

    @property
    def words(self) -> str:
        """Describe the friction by its coefficient."""
        return f'coefficient {self.coefficient:g}, at the pitch point'

    @property
    def _ends(self) -> list[tuple[str, str, Vector2, float]]:
        """Ends on which its moments act: a name, the link and its point, and the arm [m]."""
        j, (one, two) = self.joint, self.arms
        ends = [('first', j.first, j.on_first, one), ('second', j.second, j.on_second, two)]
        fixed = self.carrier == GROUND
        return ends if fixed else [*ends, ('carrier', self.carrier, (0.0, 0.0), -one - two)]

    def slip(self, frames: Frames) -> Jet:
        """Slip along the flanks [m/s]."""
        slips = (
            frames.turn(self.mechanism.turns(link, at), f'{self.name}.friction.{which}')
            * lift(dense(self._number(frames, f'arm.{which}', arm)))
            for which, link, at, arm in self._ends
        )
        return reduce(operator.add, slips).as_rate

    def loads(self, frames: Frames, T: Term) -> list[Load]:
        """A moment on each link, and the remaining moment on the carrier."""
        return [
            Load(f'{self.name}.friction.{which}', link, at,
                 moment=mul(T, self._number(frames, f'arm.{which}', arm)))
            for which, link, at, arm in self._ends
        ]  # fmt: skip

    def wrench(self, frames: Frames, T: Term) -> Wrench:
        """A moment."""
        return Wrench(None, None, self.loads(frames, T)[1].moment)

    def loss(self, force: Array, moment: Array, q: Array, v: Array) -> Array:
        """``mu N`` times the slip, with N of the moment on the second that both make [W]."""
        index = self.mechanism.coordinates.index
        slip = np.zeros(q.shape[1])
        for _, link, at, arm in self._ends:
            for c, turn in self.mechanism.turns(link, at).items():
                slip = slip + arm * turn * v[index(c)]
        rest = TOLERANCES.switches.rest * self.mechanism.size
        slip[np.abs(slip) <= rest] = 0.0  # held, by less than mu N
        against = self.coefficient * self.arms[1] * np.sign(slip) * np.sign(moment * self.lever)
        return np.asarray(self.coefficient * np.abs(moment / (self.lever - against) * slip))

    def pressed(self, frames: Frames, wrench: Wrench) -> list[Pressed]:
        """Normal force, from the moment on the second."""
        force = div(wrench.moment, self._number(frames, 'lever', self.lever))
        mu = self._number(frames, 'coefficient', self.coefficient)
        return [Pressed(mu, (force,), self._resolution(frames))]


@dataclass(frozen=True)
class ContactFriction(JointFriction):
    """A pin in a slot that opens, a knife or a flat face or a roller on a cam: ``b = mu N``.

    A roller turns on its pin: what acts at its rim is less, as the pin's radius is than its own.
    In a groove it touches one wall or the other: each has a friction of its own.
    """

    touch: Touch
    wall: int = 0  #: 1 or -1: carries forces of this sign only, along the row of the pair

    @property
    def law(self) -> str:
        """Law of friction in words, by the normal force."""
        mu, where = self.coefficient * self.touch.share, ' on this wall' if self.wall else ''
        return f'|{{0}}| <= {mu:.6g} times the normal force in {{1}}{where}{_AGAINST}'

    @property
    def words(self) -> str:
        """Describe the friction by its coefficient at the contact."""
        share = self.touch.share
        rolls = f', {share:.4g} of it at the rim of the roller' if share != 1.0 else ''
        return f'coefficient {self.coefficient:g}{rolls}'

    @property
    def label(self) -> str:
        """Name of the friction with its wall."""
        return f'{self.name}.{"outer" if self.wall > 0 else "inner"}' if self.wall else self.name

    def slip(self, frames: Frames) -> Jet:
        """Slip along the normal turned by +90 degrees."""
        return self.touch.slip(frames)

    def loads(self, frames: Frames, T: Term) -> list[Load]:
        """Opposite forces at the contact."""
        return self.touch.loads(frames, T)

    def wrench(self, frames: Frames, T: Term) -> Wrench:
        """A force at the contact."""
        return self.touch.wrench(frames, T)

    def pressed(self, frames: Frames, wrench: Wrench) -> list[Pressed]:
        """Normal force of the contact."""
        normal, _ = self.touch.contact(frames)
        mu = self._number(frames, 'coefficient', self.coefficient * self.touch.share)
        mu = mul(mu, engaged) if (engaged := self.touch.engaged(frames)) is not None else mu
        return [Pressed(mu, (_along(wrench, *normal),), self._resolution(frames), wall=self.wall)]


def _along(wrench: Wrench, nx: Term, ny: Term) -> Term:
    return add(mul(wrench.x, nx), mul(wrench.y, ny))


class FrictionalJoint(NamedTuple):
    """A friction in the equations of a mechanism."""

    friction: JointFriction
    T: hy.expression  #: symbol of T
    switch: Switch  #: switch of the slip's sign
    slip: Jet
    loads: list[Load]

    @property
    def power_lost(self) -> Term:
        """Dissipated power [W]."""
        return neg(mul(self.T, self.slip.rate))


def frictional_joints(frictions: Sequence[JointFriction], frames: Frames) -> list[FrictionalJoint]:
    """The frictions of joints that move, each with a symbol and a switch of its own."""
    found = []
    for k, friction in enumerate(frictions):
        slip, T = friction.slip(frames), hy.make_vars(f'friction{k}')
        if slip.rate is not None:
            switch = frames.slip(f'joints:{friction.label}.friction', slip.rate)
            found.append(FrictionalJoint(friction, T, switch, slip, friction.loads(frames, T)))
    return found


def solve_friction(
    start: Array,
    slopes: Array,
    numbers: Array,
    ways: Array,
    sizes: Sequence[Sequence[tuple[int, int]]],
) -> tuple[Array, Array]:
    """Every T of known motions, by Newton's method, while the friction grows from none to all.

    Parameters
    ----------
    start, slopes : (c, N) and (m, c, N) [N] components of all bounds without friction, and by
        each T
    numbers : (2 p, N) coefficient and resolution of each of the bounds' p terms
    ways : (m, N) sign of T: -1, 0 or 1
    sizes : by friction, numbers of components of its terms, and their walls

    Returns
    -------
    T (m, N), and mask (N,) of its validity: elsewhere T grows beyond all bounds.
    """
    m, count = ways.shape
    T, sound = np.zeros((m, count)), np.ones(count, bool)
    most = np.zeros((m, count))  # forces that cancel are known to the rounding of what they were
    # bounds that grow by less than half of what the T grow by leave one solution
    mild = (_growth(slopes, numbers, sizes) < 0.5).all()
    for share in _SHARES[-1:] if mild else _SHARES:
        # of friction that goes on to grow one more iteration is the first of the next share
        settled = _MECHANISM.friction_settled ** (1.0 if share == 1.0 else 0.5)
        for _ in range(_MECHANISM.friction_newton):
            b, slope = _bounds(start + np.einsum('mcn,mn->cn', slopes, T), slopes, numbers, sizes)
            left = T - share * ways * b
            matrix = np.eye(m)[:, :, None] - share * ways[:, None] * slope
            along = np.moveaxis(matrix, 2, 0)
            sound &= np.linalg.det(along) > _JOINT_FRICTION.locked
            along[~sound] = np.eye(m)
            step = np.linalg.solve(along, left.T[:, :, None])[:, :, 0].T
            T = np.where(sound, T - step, 0.0)
            most = np.maximum(most, b)
            if (np.abs(step) <= settled * most).all(axis=0)[sound].all():
                break
        else:
            sound &= (np.abs(step) <= 1e3 * settled * most).all(axis=0)
    return T, sound


def _growth(slopes: Array, numbers: Array, sizes: Sequence[Sequence[tuple[int, int]]]) -> Array:
    """Upper bound (N,) of the spectral radius of the largest slopes of the bounds by each T."""
    m, _, count = slopes.shape
    most = np.zeros((count, m, m))
    i = p = 0
    for k, terms in enumerate(sizes):
        for size, _ in terms:
            sizes_of_slopes = np.linalg.norm(slopes[:, i : i + size], axis=1)
            most[:, k] += (numbers[2 * p] * sizes_of_slopes).T
            i, p = i + size, p + 1
    eighth = np.linalg.matrix_power(most, 8)
    return np.asarray(eighth.sum(axis=2).max(axis=1, initial=0.0) ** 0.125)


def _bounds(
    components: Array, slopes: Array, numbers: Array, sizes: Sequence[Sequence[tuple[int, int]]]
) -> tuple[Array, Array]:
    """Bounds (m, N), and their derivatives (m, m, N) by each T."""
    m, _, count = slopes.shape
    bound, slope = np.zeros((m, count)), np.zeros((m, m, count))
    i = p = 0
    for k, terms in enumerate(sizes):
        for size, wall in terms:
            own = range(i, i + size)  # two at most: sums of rows are quicker than over an axis
            coefficient, resolution = numbers[2 * p], numbers[2 * p + 1]
            root = np.sqrt(sum(components[c] ** 2 for c in own) + resolution**2)
            along = [components[c] / root for c in own]
            if wall:  # the mean of |N| and +-N
                off, both = wall * components[i] < 0.0, root + np.abs(components[i])
                half = 0.5 * np.where(off, resolution**2 / both, both)
                root, along = half, [wall * half / root]
            bound[k] += coefficient * root
            slope[k] += coefficient * sum(
                x * slopes[:, c] for x, c in zip(along, own, strict=True)
            )
            i, p = own.stop, p + 1
    return bound, slope


def with_friction(
    frictional_joints: Sequence[FrictionalJoint], reactions: Mapping[str, Wrench], frames: Frames
) -> dict[str, Wrench]:
    """Wrenches of all joints, with their friction."""
    found = dict(reactions)
    for joint in frictional_joints:
        name = joint.friction.name
        found[name] = together(found[name], joint.friction.wrench(frames, joint.T))
    return found
