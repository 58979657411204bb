"""Stops of joints: a limit of an angle or a displacement is a gap, closed where it is reached.

The joint keeps its constraint, or its clearance. With the angle or displacement s of the second
link against the first and a limit at u above or l below, the gaps are ``u - s`` and ``s - l``, of
an angle at the radius where the stop is.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import heyoka as hy
from pydantic import model_validator

from mechanism_sim.errors import InputError
from mechanism_sim.joints.contact_keys import ClearanceSpec, Contact, clearance_spec_of
from mechanism_sim.joints.joint_keys import JointKeys, Joints
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import (
    AnyPosition,
    Coefficient,
    Hypothesis,
    Length,
    Part,
    Radius,
)
from mechanism_sim.keys.quantities import Friction as FrictionCoefficient
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.closures import slid
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift, wrapped
from mechanism_sim.planar.gaps import (
    BOUNDS,
    FrictionlessGap,
    MeasuredGap,
    gap_name,
    with_turning,
)
from mechanism_sim.planar.mechanism import HigherPair, Joint, Mechanism, Prismatic, Revolute
from mechanism_sim.planar.points import Vector2, rotate
from mechanism_sim.planar.protocols import MotionBound, Wrench, contact_wrench
from mechanism_sim.planar.rails import along
from mechanism_sim.planar.view import Draft


class StopsPart(Part):
    """Limits of a joint, and the impact law at them."""

    lower: AnyPosition | None = None
    """Least angle or displacement of the second link against the first; without it there is no
    stop on this side. Of a pin in a slot, of the pin from the slot's point."""
    upper: AnyPosition | None = None
    """Largest angle or displacement; one of the two is needed."""
    restitution: Coefficient = 0.0
    """Coefficient of restitution: 0 without rebound, 1 without loss."""
    hypothesis: Hypothesis = 'newton'
    """Hypothesis of restitution: ratio of velocities, impulses or energies; equal if smooth."""
    radius: Length | None = None
    """How far from the pin the stops of an angle are: gap, impulse and force are those there; 1 m
    without."""
    friction: FrictionCoefficient = 0.0
    """Coefficient of Coulomb friction at the ends of a slot, on which the pin turns."""
    pin_radius: Radius = 0.0
    """Of this pin; required with friction."""
    contact: Contact | None = None
    """A contact force law instead of rigid stops."""

    @model_validator(mode='after')
    def _somewhere(self) -> StopsPart:
        low, high = self.lower, self.upper
        if not low and not high:
            raise ValueError("needs 'lower' or 'upper', as {upper: 0.1 m, restitution: 0.6}")
        for key, limit in (('lower', low), ('upper', high)):
            if limit and not math.isfinite(limit.value):
                raise ValueError(f'has {key} = {limit.value}: it must be finite')
        if low and high and low.value >= high.value:
            raise ValueError(
                f'has lower = {low.value:g} {low.unit}, which must be less than upper = '
                f'{high.value:g} {high.unit}'
            )
        return self


class StopKeys(JointKeys):
    """Joints whose motion may have limits."""

    stops: StopsPart | None = None
    """Limits of its angle or displacement, with impacts and contact there."""

    @classmethod
    def check_all(cls, names: Names, joints: Joints, closing: Collection[str]) -> None:
        """Refuse stops along a link that bends."""
        for joint in joints:
            line = joint.line
            link = names.scene.links.get(line.link) if line else None
            if line and link and link.elastic and names.scene.joints[joint.name].stops:
                raise InputError(
                    f'joints.{joint.name}.stops: {line.link} is elastic, and stops along a link '
                    'that bends are not modelled: give them to a joint of a rigid link'
                )

    def touches(self, name: str) -> ClearanceSpec | None:
        """Contacts of its stops."""
        if self.stops is None:
            return None
        given, where, turns = self.stops, f'joints.{name}.stops', self.kind == 'revolute'
        unit = 'rad' if turns else 'm'
        for key in BOUNDS:
            limit = getattr(given, key)
            if limit and limit.unit not in ('', unit):
                raise InputError(
                    f'{where}.{key} is given in {limit.unit}, but it is '
                    f'{"an angle" if turns else "a displacement"}, in {unit}'
                )
        if given.radius and not turns:
            raise InputError(f'{where}.radius is for angles: a {self.kind} joint stops in line')
        if (given.friction or given.pin_radius) and self.kind != 'slot':
            key = 'friction' if given.friction else 'pin_radius'
            raise InputError(
                f'{where}.{key} has no effect: nothing slides along the stops of a {self.kind} '
                'joint; only the pin of a slot turns on its ends'
            )
        if bool(given.friction) != bool(given.pin_radius):
            raise InputError(f"{where} needs 'friction' and 'pin_radius' together, or neither")
        if given.contact and given.contact.law == 'film':
            raise InputError(f'{where}.contact.law = film is for pins in bushings')
        return clearance_spec_of(given, 0.0)

    def describe(self, joint: Joint) -> str:
        """The limits."""
        turns, said = isinstance(joint, Revolute), []
        for side in BOUNDS:
            if limit := getattr(self.stops, side):
                x = math.degrees(limit.value) if turns else limit.value
                said.append(f'{side} stop at {x:.6g} {"deg" if turns else "m"}')
        moving, still = joint.points[::-1]
        if isinstance(joint, HigherPair):
            moving, still = still, moving
        return f'{", ".join(said)} of {moving[0]} against {still[0]}'

    def bounds(self, spec: ClearanceSpec, joint: Joint, mechanism: Mechanism) -> list[MotionBound]:
        """The gaps of its stops."""
        given = self.stops
        assert given is not None  # noqa: S101 - there is a play
        low, high = (x.value if x else None for x in (given.lower, given.upper))
        found: list[MotionBound] = []
        for side, at in zip(BOUNDS, (low, high), strict=True):
            if at is None:
                continue
            name, sign = gap_name(mechanism, joint, side), -1.0 if side == 'upper' else 1.0
            place = name, joint.name, mechanism, sign, at
            if isinstance(joint, Revolute):
                other = high if side == 'lower' else low
                stop: MotionBound = AngleStop(
                    *place, given.radius or 1.0, other, **spec.behaviour()
                )
            else:
                stop = EndStop(*place, spec.pin_radius, **spec.behaviour())
            found.append(stop)
        return found


_WALL, _BLOCK, _PIN, _HIGH = (2.0, 6.0), 1.7, 0.75, 1.8
"""Drawn stops, in symbols: from where to where along a link; off a block, off a pin; half high."""


def beside(at: Vector2, way: float, along: float, across: float) -> Vector2:
    """Point of a link at distances [m] from another along a direction [rad], and to its left."""
    x, y = rotate((along, across), way)
    return at[0] + x, at[1] + y


@dataclass(frozen=True)
class _Stop(MeasuredGap):
    """A limit of an angle or a displacement s: the gap is ``sign (s - limit)``."""

    name: str
    joint: str
    mechanism: Mechanism
    sign: float  #: 1 for a lower limit, -1 for an upper one
    limit: float  #: limit of the angle or displacement [rad, m]

    @property
    def words(self) -> str:
        """The limit, with its unit."""
        raise NotImplementedError

    @property
    def overlap(self) -> str:
        """Beyond the stop."""
        side = 'lower' if self.sign > 0.0 else 'upper'
        return f'the joint {self.joint} beyond its {side} stop at {self.words}'


@dataclass(frozen=True)
class AngleStop(FrictionlessGap, _Stop):
    """A stop of a revolute joint, at a radius r: the gap is ``r (u - s)`` or ``r (s - l)``.

    Between two stops less than a turn apart angles count from the middle, without whole turns;
    else whole turns count.
    """

    radius: float = 1.0  #: radius of the stop [m]
    other: float | None = None  #: limit on the other side [rad]

    @property
    def words(self) -> str:
        """The limit, with its unit."""
        return f'{math.degrees(self.limit):.6g} deg'

    def value(self, frames: Frames) -> Jet:
        """The distance at the radius [m]."""
        joint, m = self.mechanism.joint(self.joint), self.mechanism
        (first, a), (second, b) = (m.frame(link) for link, _ in joint.points)
        one, two = (
            m.turning(frames, link, at, f'{self.joint}:{link}') for link, at in joint.points
        )
        r = dense(frames.parameters(f'{self.name}.stop_radius', self.radius))
        if self.other is None or abs(self.other - self.limit) >= 2.0 * math.pi:
            turns = add(frames.turns(second), neg(frames.turns(first)))
            offset = frames.parameters(f'{self.joint}.stop_offset', b - a)
            angle = two - one + lift(dense(add(offset, mul(2.0 * math.pi, turns))))
            limit = lift(dense(frames.parameters(f'{self.name}.stop_at', self.limit)))
            wide: Jet = (angle - limit if self.sign > 0.0 else limit - angle) * r
            return wide
        middle, half = 0.5 * (self.other + self.limit), 0.5 * abs(self.other - self.limit)
        rest = math.remainder(b - a - middle, 2.0 * math.pi)
        off = two - one + lift(dense(frames.parameters(f'{self.joint}.stop_middle', rest)))
        off = wrapped(off, hy.expression(1.0))
        room = lift(dense(frames.parameters(f'{self.joint}.stop_half', half)))
        found: Jet = (room + off if self.sign > 0.0 else room - off) * r
        return found

    def draw(self, draft: Draft) -> None:
        """A wall along the side of the second link, where its x axis stops."""
        joint, ends = self.mechanism.joint(self.joint), _WALL[:: int(-self.sign)]
        start, end = (
            beside(joint.on_first, self.limit, x * draft.symbol, -self.sign * draft.symbol)
            for x in ends
        )
        draft.wall(joint.first, start, end)

    def wrench(self, frames: Frames, N: Term, _: Term) -> Wrench:
        """The moment on the second-named link."""
        moment = mul(frames.parameters(f'{self.name}.stop_radius', self.radius), N)
        return Wrench(None, None, moment if self.sign > 0.0 else neg(moment))


@dataclass(frozen=True)
class EndStop(_Stop):
    """An end of a guide, which a block meets, or of a slot, which its pin meets and rolls on."""

    pin_radius: float = 0.0  #: radius of a pin with friction [m]

    @property
    def words(self) -> str:
        """The limit, with its unit."""
        return f'{self.limit:.6g} m'

    def draw(self, draft: Draft) -> None:
        """A wall across the guide or slot, off the middle by as much as is drawn of what stops."""
        joint = self.mechanism.joint(self.joint)
        line, reach = joint.line, _BLOCK if isinstance(joint, Prismatic) else _PIN
        assert line is not None  # noqa: S101 - it has one
        at, high = self.limit - self.sign * reach * draft.symbol, self.sign * _HIGH * draft.symbol
        start, end = (beside(line.on, line.axis, at, x) for x in (-high, high))
        draft.wall(line.link, start, end)

    def _axis(self, frames: Frames, angle: float, label: str) -> JetPair:
        line = self.mechanism.joint(self.joint).line
        assert line is not None  # noqa: S101 - it has one
        return along(self.mechanism, frames, line, angle, f'{self.joint}.{label}')

    @property
    def _way(self) -> float:
        """1 if s is the displacement of the first link in the second, as of a pin in its slot."""
        return 1.0 if isinstance(self.mechanism.joint(self.joint), HigherPair) else -1.0

    def value(self, frames: Frames) -> Jet:
        """The distance from the end [m]."""
        joint, m = self.mechanism.joint(self.joint), self.mechanism
        limit = lift(dense(frames.parameters(f'{self.name}.stop_at', self.limit)))
        if isinstance(joint, Prismatic):
            way = slid(m, frames, joint)
        else:
            ux, uy = self._axis(frames, 0.0, 'way')
            x, y = frames.position(m.separation(self.joint), self.joint)
            way = ux * x + uy * y
        return way - limit if self.sign > 0.0 else limit - way

    def normal(self, frames: Frames) -> JetPair:
        """Direction of the guide or slot, towards the end that presses on the second link."""
        ux, uy = self._axis(frames, 0.0, 'way')
        sign = -self._way * self.sign
        return ux * sign, uy * sign

    def slip(self, frames: Frames) -> Jet:
        """Velocity of the pin's surface along the end of the slot, which is across the slot."""
        nx, ny = self._axis(frames, 0.5 * math.pi, 'normal')
        x, y = frames.position(self.mechanism.separation(self.joint), self.joint)
        across = (nx * x + ny * y) * (-self._way * self.sign)
        ends = self.mechanism.joint(self.joint).points
        arms = self.pin_radius, -self.pin_radius
        return with_turning(across.as_rate, frames, self.mechanism, self.name, ends, arms)

    def wrench(self, frames: Frames, N: Term, T: Term) -> Wrench:
        """Wrench on the second-named link, at the contact."""
        place = frames.position(self.mechanism.separation(self.joint), self.joint)
        arm = frames.parameters(f'{self.name}.pin_radius', self.pin_radius)
        pin = place if self._way > 0.0 else None
        return contact_wrench(self.normal(frames), N, T, arm, pin)
