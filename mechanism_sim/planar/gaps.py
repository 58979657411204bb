"""Clearance in a higher pair, such as of a pin in a slot: its walls, each a gap."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, cast

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import Term, dense, mul, neg
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift
from mechanism_sim.planar.mechanism import (
    HigherPair,
    Joint,
    Mechanism,
    PairClosure,
    Prismatic,
    Revolute,
)
from mechanism_sim.planar.points import LinkPoint
from mechanism_sim.planar.protocols import ForceLaw, Gap, Rubbing, Wrench, contact_wrench, together
from mechanism_sim.planar.view import Draft, Side


@dataclass(frozen=True, kw_only=True)
class ContactGap:
    """Behaviour of a contact, as in `Gap`."""

    restitution: float
    friction: float = 0.0
    hypothesis: str = 'newton'
    law: ForceLaw | None = None

    def draw(self, _: Draft) -> None:
        """Add what bounds the motion to a drawing: nothing, where the joint shows it."""


class RoundGap(ContactGap):
    """A gap whose value ``(|Q|^2 - R^2)/(2 R)`` [m] has no root; R is -c for a pin in a bushing.

    Where a compliant contact is deep its normal ``Q/R`` is not of length one, nor are the arms of
    its friction those of a touch.
    """

    @property
    def room(self) -> float:
        """R, twice the value that is the farthest from the contact, with its sign [m]."""
        raise NotImplementedError

    def stretch(self, value: Term) -> Term:
        """``|Q|/|R| = sqrt(1 + 2 y/R)`` of a value y, over which the value grows faster."""
        return hy.sqrt(1.0 + (2.0 / self.room) * dense(value))

    def depth(self, value: Term) -> Term:
        """``-2 y/(1 + |Q|/|R|)`` [m]: no difference of nearly equal numbers."""
        return -2.0 * dense(value) / (1.0 + dense(self.stretch(value)))

    def distance(self, value: Array) -> Array:
        """``|Q| - R`` of discs, ``c - |Q|`` of a pin in its bushing [m], of values (N,)."""
        root = np.sqrt(np.maximum(0.0, 1.0 + 2.0 * value / self.room))
        return np.asarray(2.0 * value / (1.0 + root))

    def stretched(self, frames: Frames) -> JetPair:
        """``|Q|/|R|`` of a closed compliant contact, 1 of an open one, and its inverse."""
        gap = cast(Gap, self)
        y = gap.value(frames) * frames.parameters.reserve(f'{gap.name}.closed')
        root = dense(self.stretch(y.value))
        rate = dense(y.rate) / (self.room * root)
        return Jet(root, {}, rate, None), Jet(1.0 / root, {}, -rate / (root * root), None)

    def pressing(
        self, frames: Frames, normal: JetPair, loads: tuple[Term, Term], arm: Term,
        place: JetPair | None = None,
    ) -> Wrench:  # fmt: skip
        """`contact_wrench` of loads N and T along a normal that may be stretched."""
        N, T = loads
        if self.law is not None:
            root, inverse = self.stretched(frames)
            T, arm = mul(T, inverse.value), mul(arm, root.value)
        return contact_wrench(normal, N, T, arm, place)


class MeasuredGap(ContactGap):
    """A gap whose value is the distance itself."""

    def stretch(self, value: Term) -> Term:
        """The value is the distance."""
        return hy.expression(1.0)

    def depth(self, value: Term) -> Term:
        """The value is the distance."""
        return -value

    def distance(self, value: Array) -> Array:
        """The value is the distance."""
        return value


class FrictionlessGap(MeasuredGap):
    """A gap whose force is axial or a moment, without a force in the plane."""

    def slip(self, _: Frames) -> Jet:
        """Refuse: slips exist only for gaps with friction."""
        raise NotImplementedError(f'{type(self).__name__} has no friction')

    def normal(self, _: Frames) -> JetPair:
        """Normal in the plane: zero."""
        return lift(0.0), lift(0.0)


@dataclass(frozen=True)
class Wall(MeasuredGap):
    """One wall of a higher pair with clearance.

    With the offset h of the closure, such as that of a pin from the centre line to the left of its
    slot, the gap is ``c - h`` at the left wall and ``c + h`` at the right one.
    """

    closure: PairClosure
    side: Side
    play: float  #: c [m], clearance from the position of zero offset
    touch: Rubbing | None = None  #: sliding contact of a wall with friction

    @property
    def name(self) -> str:
        """The joint's, with the side where it has two, see `wall_name`."""
        return wall_name(self.closure.mechanism, self.closure.joint, self.side)

    @property
    def joint(self) -> str:
        """Name of the joint."""
        return self.closure.name

    def value(self, frames: Frames) -> Jet:
        """``c - h`` or ``c + h`` [m]."""
        (offset,) = self.closure.values(frames)
        play = lift(dense(frames.parameters(f'{self.joint}.play', self.play)))
        return play - offset if self.side == 'left' else play + offset

    def _friction(self) -> Rubbing:
        """Friction of the wall: it presses on the second-named link against or along the row."""
        if self.touch is None:
            raise ValueError(f'{self.name} has no friction')
        return self.touch.on(-1 if self.side == 'left' else 1)

    def slip(self, frames: Frames) -> Jet:
        """Velocity of the first-named link on the second, along the wall's force turned by +90."""
        slip = self._friction().slip(frames)
        return slip if self.side == 'left' else -slip

    def engaged(self, frames: Frames) -> Term:
        """1 while the wall has friction, 0 while a frictionless part holds; None if always."""
        return self.touch.engaged(frames) if self.touch else None

    def normal(self, frames: Frames) -> JetPair:
        """Direction of the force of the wall."""
        pressed = self.wrench(frames, hy.expression(1.0), None)
        return lift(dense(pressed.x)), lift(dense(pressed.y))

    def wrench(self, frames: Frames, N: Term, T: Term) -> Wrench:
        """Wrench of the closure with the wall's force along its row, and of friction."""
        pressed = self.closure.wrench(frames, [neg(N) if self.side == 'left' else N])
        if T is None:
            return pressed
        along = T if self.side == 'left' else neg(T)
        return together(pressed, self._friction().wrench(frames, along))


def wall_name(mechanism: Mechanism, joint: HigherPair, side: Side) -> str:
    """Name of a joint's wall: ``JOINT_left``, or ``JOINT.left`` if a joint has that name."""
    return gap_name(mechanism, joint, side) if len(joint.sides) > 1 else joint.name


def gap_name(mechanism: Mechanism, joint: Joint, place: str) -> str:
    """Name of the gap at a place of a joint, such as ``front_left`` or ``lower``.

    ``JOINT_PLACE``; with a dot if another joint, or a gap of one, may be called so.
    """
    plain, longer = f'{joint.name}_{place}', f'{joint.name}_'
    others = (j.name for j in mechanism.joints if j.name.startswith(longer))
    taken = any(plain == name or plain.startswith(f'{name}_') for name in others)
    return f'{joint.name}.{place}' if taken else plain


SIDES: tuple[tuple[str, Side], ...] = (
    ('rear', 'left'), ('front', 'left'), ('rear', 'right'), ('front', 'right'),
)  # fmt: skip
"""The corners of a block in its guide, by the direction of the guide's axis."""


ENDS = 'front', 'rear'
"""Ends of a bearing along its axis: that on the reader's side, and the other."""


STOPS = 'stop_front', 'stop_rear'
"""Axial stops of a bearing, which the first link meets moving towards the reader, or back."""


BOUNDS = 'lower', 'upper'
"""Limits of the motion of a joint."""


def is_stop(joint: Joint, gap: str) -> bool:
    """True if a gap of a joint is one along its axis, or a limit of its motion."""
    return gap.removeprefix(joint.name)[1:] in (*STOPS, *BOUNDS)


def with_turning(
    slip: Jet,
    frames: Frames,
    mechanism: Mechanism,
    name: str,
    ends: Sequence[LinkPoint],
    arms: Sequence[float | Jet],
    still: Collection[str] = (),
) -> Jet:
    """Slip [m/s] of points, with the rotation of links whose surfaces lie at arms [m].

    Parameters
    ----------
    name : name of the gap
    still : coordinates taken at rest
    """
    for (link, at), arm in zip(ends, arms, strict=True):
        for c, turn in mechanism.turns(link, at).items():
            if c in still:
                continue
            if isinstance(arm, Jet):
                r, rate = (mul(hy.expression(turn), x) for x in (arm.value, arm.rate))
                slip += Jet(None, {c: r}, mul(r, frames.v[c]), mul(rate, frames.v[c]))
                continue
            r = frames.parameters(f'{name}.slip:{link}@{c}', arm * turn)
            if r is not None:
                slip += Jet(None, {c: r}, mul(r, frames.v[c]), None)
    return slip


def joint_of_gap(mechanism: Mechanism, gap: str) -> Joint:
    """The joint whose gap has that name: its own, or that of one of its walls, ends or stops.

    Raises
    ------
    KeyError
        If there is none.
    """
    for joint in mechanism.joints:
        own = [joint.name, *(gap_name(mechanism, joint, bound) for bound in BOUNDS)]
        if isinstance(joint, HigherPair):
            own += [wall_name(mechanism, joint, side) for side in joint.sides]
        if isinstance(joint, Prismatic):
            own += [gap_name(mechanism, joint, '_'.join(corner)) for corner in SIDES]
        if isinstance(joint, Revolute):
            own += [gap_name(mechanism, joint, end) for end in (*ENDS, *STOPS)]
        if gap in own:
            return joint
    raise KeyError(gap)


def gaps_of(mechanism: Mechanism, joint: str, gaps: Iterable[str]) -> list[str]:
    """Names of the gaps of a joint in the plane, out of some gaps."""
    owners = ((gap, joint_of_gap(mechanism, gap)) for gap in gaps)
    return [gap for gap, owner in owners if owner.name == joint and not is_stop(owner, gap)]


def walls(
    closure: PairClosure, play: float, pin_radius: float, friction: float, **behaviour: Any
) -> list[Wall]:
    """All walls of a higher pair; `play` [m] is the clearance from the position of zero offset."""
    own = closure.joint.rubbing_wall if friction else None
    touch = closure.joint.touch(closure.mechanism, pin_radius) if friction and not own else None
    friction *= touch.share if touch else 1.0
    kind = partial(own, pin_radius=pin_radius) if own else partial(Wall, touch=touch)
    sides = closure.joint.sides
    return [kind(closure, side, play, friction=friction, **behaviour) for side in sides]
