"""Two links that keep a ratio of angles, or of displacements, by whatever means.

Links that turn: a belt, a chain, bevel gears, a box. Links that slide in guides of the carrier: a
rope over a pulley that stays taut. With play, as dogs of coaxial shafts have, they keep it between
two stops only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from types import MappingProxyType
from typing import ClassVar

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.joints.mesh.reading import GearReading, read_ratio
from mechanism_sim.numerics.symbolic import Term, dense, mul, neg
from mechanism_sim.planar.closures import HigherClosure, gathered, slid
from mechanism_sim.planar.frames import Frames, Jet, wrapped
from mechanism_sim.planar.mechanism import Coupling, HigherPair, Mechanism, Prismatic
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.protocols import Load, Wrench
from mechanism_sim.planar.view import PairView, Side


@dataclass(frozen=True)
class Transmission(HigherPair):
    """``second = phase + ratio first``, both counted from the carrier.

    It passes on moments only: what a belt or a mesh does to the shafts is left out. Of links that
    slide it passes on forces along their guides.
    """

    sides: ClassVar[tuple[Side, ...]] = ()
    exact: ClassVar[bool] = True
    node: ClassVar[str] = 'gear_train'
    reads: ClassVar[type] = GearReading
    charts: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({
        'torques': ('first_torque', 'second_torque'),
    })  # fmt: skip
    untold: ClassVar[tuple[str, ...]] = (
        'transmission_error', 'mesh_frequency', 'tooth_force', 'tangential_force', 'radial_force',
        'axial_force',
    )  # fmt: skip

    ratio: Fraction = Fraction(1)
    phase: float = 0.0  #: angle of the second at zero of the first [rad]
    carrier: str = GROUND
    guides: tuple[Prismatic, ...] = field(default=(), kw_only=True)
    """Of first and second, if these slide."""

    def closure(self, mechanism: Mechanism) -> TransmissionClosure:
        """Closure without clearance."""
        return TransmissionClosure(self, mechanism)

    def reading(self, view: PairView) -> GearReading:
        """Motion and torques; of links that slide the forces along their guides."""
        return read_ratio(self, self.efforts(view), view)

    def efforts(self, view: PairView) -> tuple[Array, Array]:
        """Torques (N,) [N m] on both, or forces [N] along their guides.

        Both give together the power that friction takes; at rest it is not known, and left out.
        """
        second = view.moment
        if self.guides:
            guide = self.guides[1]
            way = view.turning(guide.first).position + guide.axis
            fx, fy = view.force
            second = fx * np.cos(way) + fy * np.sin(way)
            second = second if guide.second == self.second else -second
        carrier = view.turning(self.carrier).velocity
        rate = view.trajectory(self.first, self.on_first).velocity - carrier
        lost = np.divide(view.friction_loss, rate, out=np.zeros_like(rate), where=rate != 0.0)
        return -float(self.ratio) * second - lost, second

    @property
    def waves(self) -> tuple[int, int]:
        """Whole numbers p, q: ``q second - p first`` is the same after whole turns of either."""
        return -self.ratio.numerator, self.ratio.denominator

    @property
    def coupling(self) -> Coupling | None:
        """Coupling of the angles or displacements against the carrier."""
        p, q = self.waves
        first, second = self.guides or (None, None)
        return Coupling(self, self.carrier, (p / q, 1.0), (first, second), self.exact)

    @property
    def alike(self) -> tuple[str, ...]:
        """Names of both links."""
        return self.first, self.second

    def bears(self, link: str) -> bool:
        """A link that turns does so with the cross-section at its point."""
        return link in (self.first, self.second) and not self.guides


@dataclass(frozen=True)
class LooseTransmission(Transmission):
    """Transmission with backlash to either side, centred at the start."""

    sides: ClassVar[tuple[Side, ...]] = ('left', 'right')
    parts: ClassVar[str] = 'dogs between stops'
    exact: ClassVar[bool] = False  # its coupling holds on the mean only

    play: float = 0.0  #: backlash of the second to either side [rad]; [m] for sliding links

    @property
    def angular_clearance(self) -> bool:
        """True for rotating links."""
        return not self.guides


@dataclass(frozen=True)
class TransmissionClosure(HigherClosure[Transmission]):
    """Closure of a constant ratio."""

    @property
    def lever(self) -> float:
        """Metres of the row for a radian of the second link, or for a metre."""
        return 1.0 if self.joint.guides else self.mechanism.size

    def values(self, frames: Frames) -> list[Jet]:
        """Error of the second angle [rad], times the size of the mechanism [m].

        Counted without whole turns: ``wrap(q (second - phase) - p first)/q``.
        """
        joint, m = self.joint, self.mechanism
        p, q = joint.waves
        if joint.guides:
            return [self._slid(frames)]
        (_, a), (_, b), (carrier, c) = (
            m.frame(link) for link in (joint.first, joint.second, joint.carrier)
        )
        first, second = (
            m.turning(frames, link, at, f'{self.name}:{link}') for link, at in joint.points
        )
        rest = q * (b - c - joint.phase) + p * (a - c)
        u = second * float(q) + first * float(p)
        if carrier != GROUND:
            u = u - frames.angle(carrier) * float(p + q)
        constant = frames.parameters(f'{self.name}.phase', math.remainder(rest, 2.0 * math.pi))
        u = u if constant is None else u + constant
        size = dense(frames.parameters(f'{self.name}.size', m.size / q))
        return [wrapped(u, size)]

    def _slid(self, frames: Frames) -> Jet:
        """Error of the second displacement [m], of sliding links."""
        first, second = (slid(self.mechanism, frames, guide) for guide in self.joint.guides)
        return second - first * float(self.joint.ratio)

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """The moment on the second; or the forces along both guides, and on the carrier."""
        joint = self.joint
        if not joint.guides:
            lever = frames.parameters(f'{self.name}.lever', self.lever)
            return Wrench(None, None, mul(forces[0], lever))
        pushed = mul(forces[0], hy.expression(-float(joint.ratio))), forces[0]
        loads = []
        for k, guide in enumerate(joint.guides):
            way = self.mechanism.direction(guide.first, guide.axis)
            x, y = frames.position(way, f'{guide.name}.way')
            along = mul(pushed[k], x.value), mul(pushed[k], y.value)
            for (end, at), force in zip(
                guide.points, ((neg(along[0]), neg(along[1])), along), strict=True
            ):
                loads.append(Load(f'{self.name}.{k}:{end}', end, at, force))
        return gathered(joint, self.mechanism, frames, loads)
