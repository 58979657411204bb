"""Two links whose angles keep a ratio, by whatever means: a belt, a chain, bevel gears, a box."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType
from typing import ClassVar

import heyoka as hy

from mechanism_sim.joints.mesh.reading import GearReading, read_ratio
from mechanism_sim.numerics.symbolic import Term, dense, mul
from mechanism_sim.planar.closures import HigherClosure
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.jet import Jet
from mechanism_sim.planar.loads import Wrench
from mechanism_sim.planar.mechanism import Coupling, HigherPair, Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.view import PairView, Side


@dataclass(frozen=True)
class Transmission(HigherPair):
    """``second = phase + ratio first``, both angles counted from the carrier.

    It passes on moments only: what a belt or a mesh does to the shafts is left out.
    """

    sides: ClassVar[tuple[Side, ...]] = ()
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
    phase: float = 0.0  #: [rad]
    carrier: str = GROUND

    def closure(self, mechanism: Mechanism) -> TransmissionClosure:
        """Without play."""
        return TransmissionClosure(self, mechanism)

    def reading(self, view: PairView) -> GearReading:
        """Motion and torques."""
        return read_ratio(self, float(self.ratio), view)

    @property
    def waves(self) -> tuple[int, int]:
        """Whole numbers p, q: ``q second - p first`` is the same after whole turns of either."""
        return -self.ratio.numerator, self.ratio.denominator

    @property
    def coupling(self) -> Coupling:
        """Of the angles against the carrier."""
        p, q = self.waves
        return Coupling(self, self.carrier, (p / q, 1.0))

    def bears(self, link: str) -> bool:
        """A link that turns does so with the cross-section at its point."""
        return link in (self.first, self.second)


@dataclass(frozen=True)
class TransmissionClosure(HigherClosure[Transmission]):
    """A ratio that is kept."""

    def values(self, frames: Frames) -> list[Jet]:
        """How far the second is off [rad], times the size of the mechanism [m].

        Counted without whole turns: ``wrap(q (second - phase) - p first)/q``.
        """
        joint, m = self.joint, self.mechanism
        p, q = joint.waves
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
        return [u.chain(size * hy.atan2(hy.sin(u.value), hy.cos(u.value)), size, None)]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """The moment on the second."""
        return Wrench(
            None,
            None,
            mul(forces[0], frames.parameters(f'{self.name}.lever', self.mechanism.size)),
        )
