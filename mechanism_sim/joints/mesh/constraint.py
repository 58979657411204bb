"""Two gears, or a gear and a rack, whose teeth mesh: the relation they bring to a mechanism.

Both turn (the rack slides) on a common carrier: the ground, or the arm of a planetary train. With
the angles a of the gears against the carrier and their numbers of teeth N, counted negative for
internal teeth, the phase of the teeth is

    u = N1 a1 + N2 a2 - u0        [V] eqs. 5.61, 5.62 (Willis)

and their offset along the line of action h = m cos(phi)/2 wrap(u): how far the first gear's flank
is ahead of the middle of the play. A rack has 2 s/m for N a. The wrap takes off whole teeth, so
that h is linear and does not depend on the turns already made. u0 follows from the start: there
teeth are in the middle of the spaces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import heyoka as hy

from mechanism_sim.joints.mesh.placement import Harmonic, PlacedMesh
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.closures import HigherClosure, slid
from mechanism_sim.planar.frames import Frames, Jet, lift
from mechanism_sim.planar.points import Vector2
from mechanism_sim.planar.protocols import Wrench, moment_of


@dataclass(frozen=True)
class MeshClosure(HigherClosure[PlacedMesh]):
    """Gears in mesh without play."""

    def places(self, frames: Frames) -> tuple[Jet, Jet]:
        """Angles of the gears against the carrier [rad]; of a rack, its displacement [m]."""
        j = self.joint
        return self._place(frames, j.first, j.on_first), self._place(frames, j.second, j.on_second)

    def _place(self, frames: Frames, link: str, at: Vector2) -> Jet:
        m, guide = self.mechanism, self.joint.guide
        if guide is not None and guide.second == link:
            return slid(m, frames, guide)
        offset = m.frame(link)[1]
        carrier, carried = m.frame(self.joint.carrier)
        turned = m.turning(frames, link, at, f'{self.name}:{link}') - frames.angle(carrier)
        constant = frames.parameters(f'{self.name}.offset:{link}', offset - carried)
        return turned if constant is None else turned + constant

    def values(self, frames: Frames) -> list[Jet]:
        """Offset of the flanks along the line of action, with the transmission error [m]."""
        joint, places = self.joint, self.places(frames)
        per = dense(frames.parameters(f'{self.name}.per_phase', joint.per_phase))
        u = lift(dense(neg(frames.parameters(f'{self.name}.phase', joint.phase))))
        for place, wave in zip(places, joint.waves, strict=True):
            u = u + place * wave
        h = u.chain(per * hy.atan2(hy.sin(u.value), hy.cos(u.value)), per, None)
        for e, jet in self._errors(frames):
            h = h + places[e.member].chain(*jet)
        return [h]

    def _errors(self, frames: Frames) -> list[tuple[Harmonic, tuple[Term, Term, Term]]]:
        """Of each harmonic its value and two derivatives by its member's place."""
        found = []
        for k, e in enumerate(self.joint.errors):
            size = dense(frames.parameters(f'{self.name}.error.{k}', e.amplitude))
            start = frames.parameters(f'{self.name}.error.{k}.start', e.order * e.start)
            place = self.places(frames)[e.member]
            turn = dense(add(e.order * dense(place.value), neg(start)))
            s, c = size * hy.sin(turn), size * hy.cos(turn)
            found.append((e, (s, e.order * c, -(e.order**2 * s))))
        return found

    def couples(self, frames: Frames, force: Term) -> tuple[Term, Term]:
        """Moments [N m] on first and second that the errors add to a force along the row."""
        found: list[Term] = [None, None]
        for e, (_, slope, _) in self._errors(frames):
            found[e.member] = add(found[e.member], mul(force, slope))
        return found[0], found[1]

    def across(self, frames: Frames) -> tuple[tuple[Term, Term], tuple[Term, Term]]:
        """Unit vectors: from the first centre to the second; and 90 deg on, along the teeth."""
        n = self.mechanism.direction(self.joint.carrier, self.joint.towards)
        x, y = (jet.value for jet in frames.position(n, f'{self.name}.towards'))
        return (x, y), (neg(y), x)

    def tangential(self, frames: Frames, force: Term) -> Wrench:
        """Wrench on the second of a force along the row, without the part that parts the gears."""
        joint = self.joint
        cosine = -joint.sign * math.cos(joint.pressure_angle)
        size = mul(force, frames.parameters(f'{self.name}.tangential', cosine))
        n, t = self.across(frames)
        return self._about_second(frames, n, (mul(size, t[0]), mul(size, t[1])), force)

    def _about_second(
        self, frames: Frames, n: tuple[Term, Term], force: tuple[Term, Term], row: Term
    ) -> Wrench:
        """A force at the pitch point, about the second's centre, or the point of a rack."""
        joint = self.joint
        if joint.guide is None or joint.guide.second != joint.second:
            lever = frames.parameters(f'{self.name}.lever', joint.per_phase * joint.waves[1])
            return Wrench(*force, mul(row, lever))
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        reach = frames.parameters(f'{self.name}.reach', joint.reach)
        arm = add(x.value, mul(reach, n[0])), add(y.value, mul(reach, n[1]))
        return Wrench(*force, moment_of(arm, force))

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """At the pitch point, along the line of action of the flank that carries.

        It presses an external gear towards its own axis, an internal one away from it. For
        compiled functions only: the sign of the force has no Taylor series.
        """
        joint, row = self.joint, dense(forces[0])
        n, t = self.across(frames)
        size = hy.select(hy.gt(row, hy.expression(0.0)), row, -row)
        along = mul(row, frames.parameters(
            f'{self.name}.tangential', -joint.sign * math.cos(joint.pressure_angle)))  # fmt: skip
        apart = mul(size, frames.parameters(
            f'{self.name}.parting', joint.sign * math.sin(joint.pressure_angle)))  # fmt: skip
        force = (
            add(mul(along, t[0]), mul(apart, n[0])),
            add(mul(along, t[1]), mul(apart, n[1])),
        )
        return self._about_second(frames, n, force, row)
