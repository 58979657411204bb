"""Two gears, or a gear and a rack, in mesh as a joint of a mechanism, rigid or elastic.

Both turn (the rack slides) on a common carrier: the ground, or the arm of a planetary train. With
the angles a of the gears against the carrier and their numbers of teeth N, counted negative for
internal teeth, the phase of the teeth is

    u = N1 a1 + N2 a2 - u0        [V] eqs. 5.61, 5.62 (Willis)

and their offset along the line of action h = m cos(phi)/2 wrap(u): how far the first gear's flank
is ahead of the middle of the play. A rack has 2 s/m for N a. The wrap takes off whole teeth, so
that h is linear and does not depend on the turns already made. u0 follows from the start: there
teeth are in the middle of the spaces.

Teeth that give way (`MeshSpring`) are a spring and a damper along the line of action, whose
stiffness changes as pairs of teeth come and go. With the way x by which a flank is pressed in

    k(u) = k0 (1 + sum_j a_j cos(j u))

where u = 0 is the middle of the part with most pairs of teeth in contact. The force follows from
the potential k(u) x^2/2: beside k x along the line of action there is the couple -k'(u) x^2/2
between first gear and carrier, without which a turning gear would gain energy from nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.joints.mesh.compliance import Elasticity
from mechanism_sim.joints.mesh.involute import rack_teeth
from mechanism_sim.joints.mesh.placement import Harmonic, PlacedMesh, Teeth
from mechanism_sim.joints.mesh.reading import GearReading, read_mesh
from mechanism_sim.linkages.springs import never_against
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.closures import HigherClosure, slid
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift, wrapped
from mechanism_sim.planar.mechanism import Bar, Coupling, Mechanism
from mechanism_sim.planar.points import GROUND, LinkPoint, Vector2, rotate
from mechanism_sim.planar.protocols import ForceElement, Load, Wrench, moment_of
from mechanism_sim.planar.touch import TurningTouch
from mechanism_sim.planar.view import Draft, PairView, ToothLoad, circle

_FLANK = 14  # points of a drawn flank, its fillet among them


@dataclass(frozen=True)
class MeshClosure(HigherClosure[PlacedMesh]):
    """Gears in mesh without backlash."""

    def places(self, frames: Frames) -> JetPair:
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
        h = wrapped(u, per)
        for e, jet in self._errors(frames):
            h = h + places[e.member].chain(*jet)
        return [h]

    def _errors(self, frames: Frames) -> list[tuple[Harmonic, tuple[Term, Term, Term]]]:
        """Harmonics of the transmission error: each with its value and two derivatives."""
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
        """Moments [N m] on first and second by the errors, beside a force along the row."""
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
        """Wrench at the pitch point, along the line of action of the flank that carries.

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


class _Flank(NamedTuple):
    """Deflection and force of one flank of the teeth."""

    share: Term  #: 1 if the flank is in contact, else 0
    pressed: Term  #: x [m]
    rate: Term  #: x' [m/s]
    force: Term  #: k x + d x' [N]
    stiffness: Term  #: k [N/m]
    slope: Term  #: dk/d a of the first gear [N/m/rad]
    sign: float  #: sign of the force along the row


@dataclass(frozen=True)
class MeshSpring:
    """Elastic teeth in the place of a joint, with or without backlash.

    Which flank is pressed is told by switches of the engine: the equations are smooth between
    them. The damper acts while a flank is pressed; where there is play it never makes one pull.
    """

    closure: MeshClosure
    elasticity: Elasticity
    play: float = 0.0  #: backlash to either side along the line of action [m]

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self.closure.name

    def _flanks(self, frames: Frames) -> list[_Flank]:
        e, name, p = self.elasticity, self.name, frames.parameters
        (h,) = self.closure.values(frames)
        k0 = dense(p(f'{name}.stiffness', e.stiffness))
        play, d = p(f'{name}.play', self.play), p(f'{name}.damping', e.damping)
        if play is None and not e.variation:
            force = add(mul(k0, h.value), mul(d, h.rate))
            return [_Flank(hy.expression(1.0), h.value, h.rate, force, k0, None, 1.0)]
        found: list[_Flank] = []
        for side, sign in (('left', 1.0), ('right', -1.0)):
            own = h if sign > 0.0 else -h
            x = dense(add(own.value, neg(play)))
            if play is None and found:
                share = 1.0 - found[0].share
            else:
                share = frames.switch(f'{name}.{side}', x / self.closure.joint.per_phase)
            k, slope = self._stiffness(frames, k0, sign)
            force = add(mul(k, x), mul(d, own.rate))
            if play is not None and d is not None:
                size = k0 * self.closure.joint.per_phase
                force = never_against(frames, f'{name}.{side}', 1, force, size)
            found.append(_Flank(share, x, own.rate, force, k, slope, sign))
        return found

    def _stiffness(self, frames: Frames, k0: Term, sign: float) -> tuple[Term, Term]:
        """Stiffness k and its derivative by the position of the first."""
        e, p = self.elasticity, frames.parameters
        wave = self.closure.joint.waves[0]
        turned = wave * dense(self.closure.places(frames)[0].value)
        start = p(f'{self.name}.flank.{sign:g}', sign * e.lead - e.tooth)
        u = dense(add(turned, start))
        value, slope = hy.expression(1.0), hy.expression(0.0)
        for j, size in enumerate(e.variation, 1):
            a = dense(p(f'{self.name}.variation.{j}', size))
            value += a * hy.cos(j * u)
            slope -= (j * wave) * a * hy.sin(j * u)
        return k0 * value, k0 * slope

    def _row(self, frames: Frames) -> Term:
        """Force along the row, on the first [N]."""
        return add(*(
            mul(f.share, mul(hy.expression(-f.sign), f.force)) for f in self._flanks(frames)
        ))  # fmt: skip

    def loads(self, frames: Frames) -> list[Load]:
        """Loads on both gears at their centres, and the couple on the carrier.

        The force that parts the gears is left out: it does no work.
        """
        joint, row = self.closure.joint, self._row(frames)
        second = self.closure.tangential(frames, row)
        bulge = add(*(
            mul(f.share, mul(hy.expression(-0.5), mul(f.slope, mul(f.pressed, f.pressed))))
            for f in self._flanks(frames)
        ))  # fmt: skip
        couples = self.closure.couples(frames, row)
        on_first, on_second = add(couples[0], bulge), couples[1]
        back = neg(second.x), neg(second.y)
        lever = frames.parameters(f'{self.name}.first.lever', joint.per_phase * joint.waves[0])
        turn = mul(row, lever)
        found = [
            Load(f'{self.name}.first', joint.first, joint.on_first, back, add(turn, on_first)),
            Load(f'{self.name}.second', joint.second, joint.on_second, (second.x, second.y),
                 add(second.moment, on_second)),
        ]  # fmt: skip
        if joint.carrier != GROUND:
            couple = neg(add(on_first, on_second))
            found.append(Load(f'{self.name}.carrier', joint.carrier, (0.0, 0.0), moment=couple))
        return found

    def wrench(self, frames: Frames) -> Wrench:
        """Wrench of the first on the second, with the part that parts the gears."""
        return self.closure.wrench(frames, [self._row(frames)])

    def power_lost(self, frames: Frames) -> Term:
        """Power dissipated in the flanks [W]: ``d x'^2`` of those in contact."""
        return add(*(
            mul(f.share, mul(add(f.force, neg(mul(f.stiffness, f.pressed))), f.rate))
            for f in self._flanks(frames)
        ))  # fmt: skip

    def energy(self, frames: Frames) -> Term:
        """``k x^2/2`` of the flanks that are pressed."""
        return add(*(
            mul(f.share, mul(hy.expression(0.5), mul(f.stiffness, mul(f.pressed, f.pressed))))
            for f in self._flanks(frames)
        ))  # fmt: skip


@dataclass(frozen=True)
class GearMesh(PlacedMesh):
    """Teeth in mesh, with or without backlash, rigid or elastic."""

    parts: ClassVar[str] = 'teeth with backlash'
    node: ClassVar[str] = 'gear_train'
    reads: ClassVar[type] = GearReading
    charts: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({
        'transmission error': ('transmission_error',), 'tooth force': ('tooth_force',),
    })  # fmt: skip

    def closure(self, mechanism: Mechanism) -> MeshClosure:
        """Closure without clearance."""
        return MeshClosure(self, mechanism)

    def touch(self, mechanism: Mechanism, radius: float = 0.0) -> TurningTouch:
        """Flanks, on the mean of their path."""
        name, share = f'{self.name}.friction', self.friction_share
        return TurningTouch(self.closure(mechanism), name, self.sliding_arm, share)

    @property
    def coupling(self) -> Coupling:
        """Coupling of the links, exact for rigid teeth without errors."""
        first, second = (self.per_phase * wave for wave in self.waves)
        rack = self.guide if self.is_rack(self.second) else None
        true = not (self.elastic or self.errors)
        return Coupling(self, self.carrier, (first, second), (None, rack), true)

    @property
    def pitches(self) -> Mapping[str, float]:
        """Pitch of the teeth of a rack [m], by link."""
        members = zip((self.first, self.second), self.waves, strict=True)
        return {link: 2.0 * math.pi / abs(wave) for link, wave in members if self.is_rack(link)}

    @property
    def elastic(self) -> bool:
        """True if the teeth are elastic."""
        return self.elasticity is not None

    @property
    def preloaded(self) -> bool:
        """True if elastic teeth have no backlash."""
        return self.elastic and not self.play

    def elements(self, mechanism: Mechanism) -> list[ForceElement]:
        """The spring of elastic teeth."""
        if self.elasticity is None:
            return []
        return [MeshSpring(self.closure(mechanism), self.elasticity, self.play)]

    def reading(self, view: PairView) -> GearReading:
        """Motion, transmission error and forces."""
        return read_mesh(self, view)

    @property
    def toothed(self) -> tuple[str, ...]:
        """Names of both links, without a rack."""
        return tuple(link for link in self.links if not self.is_rack(link))

    def tooth_loads(self, view: PairView) -> Sequence[ToothLoad]:
        """Tooth loads at the pitch point, axial forces by the hand of the teeth.

        Along right-handed teeth one advances as one turns counterclockwise, so that a tangential
        force F on the first comes with ``-F tan(psi)`` along its shaft.
        """
        towards = view.turning(self.carrier).position + self.towards
        x, y = np.cos(towards), np.sin(towards)
        fx, fy = view.force
        axial = math.tan(self.helix_angle) * self.hand * (x * fy - y * fx)
        centre = view.place(self.first, self.on_first)
        point = centre + self.reach * np.array([x, y])
        force = np.array([fx, fy, -axial])
        found = []
        for sign, (link, at), along in zip(
            (-1.0, 1.0), self.points, self.along,
            strict=True,
        ):  # fmt: skip
            if not self.is_rack(link):
                arm = point - view.place(link, at)
                arm = np.array([*arm, np.full(view.count, along)])
                found.append(ToothLoad(link, sign * force, arm, True))
        return found

    def draw(self, draft: Draft) -> None:
        """The gears of a mesh, each drawn once."""
        sides = self.points
        for teeth, (link, at) in zip(self.wheels, sides, strict=True):
            if not draft.first(teeth.name):
                continue
            if teeth.rack:
                draft.add('wheel', link, self._straight_teeth(draft, teeth) + at)
                continue
            gear = teeth.gear
            curves = [gear.outline(_FLANK, teeth.tooth, arc=2, fillet=True) + at]
            if gear.internal:  # a ring around its teeth
                rim = gear.root_radius + 2.0 * gear.module
                curves.append(circle(rim, at))
            draft.add('wheel', link, *curves, size=gear.tip_radius)

    def _straight_teeth(self, draft: Draft, teeth: Teeth) -> Array:
        """Outline of a rack with enough teeth for the motion, (k, 2) in its link's frame [m]."""
        guide, gear = self.guide, teeth.gear
        assert guide is not None  # noqa: S101 - on which it slides
        towards = self.towards + math.pi - guide.angle
        out, along = (np.array(rotate((1.0, 0.0), towards + a)) for a in (0.0, 0.5 * math.pi))
        way = rotate((1.0, 0.0), guide.axis - guide.angle)
        first = teeth.tooth * float(along @ way)
        runner = draft.within(self.second, (self.first, self.on_first))
        pitch = gear.circular_pitch
        visited = (along @ (runner - np.array(self.on_second)[:, None]) - first) / pitch
        low, high = math.floor(visited.min()) - 3, math.ceil(visited.max()) + 3
        x, y = rack_teeth(high - low + 1, gear.module, gear.system).T
        back = -(gear.system.dedendum + 2.0) * gear.module
        x, y = np.append(x, [back, back]), np.append(y, [y[-1], y[0]]) + first + low * pitch
        return np.array(self.on_second) + np.outer(x, out) + np.outer(y, along)

    def discs(self) -> Sequence[tuple[LinkPoint, float]]:
        """Gears by their pitch circles; no racks."""
        sides = self.points
        wheels = zip(self.wheels, sides, strict=True)
        return [(side, teeth.gear.pitch_radius) for teeth, side in wheels if not teeth.rack]

    def bars(self) -> Sequence[Bar]:
        """Bar of a rack, as long as the gear's circumference."""
        if self.guide is None:
            return ()
        axis, turned = self.guide.axis, self.guide.angle
        long = 2.0 * math.pi * self.reach
        return [Bar(self.points[1], long, axis - turned, self.towards - turned)]

    def places(self, tree: Mechanism, q: Mapping[str, float]) -> tuple[float, float]:
        """Angles [rad] against the carrier, of a rack the displacement [m], at coordinates."""
        found = []
        for link in self.links:
            if self.is_rack(link) and self.guide:
                g = self.guide
                a, b = tree.locate(g.first, q, g.on_first), tree.locate(link, q, g.on_second)
                way = tree.angle(g.first, q) + g.axis
                found.append((b[0] - a[0]) * math.cos(way) + (b[1] - a[1]) * math.sin(way))
            else:
                found.append(tree.angle(link, q) - tree.angle(self.carrier, q))
        return found[0], found[1]

    def bears(self, link: str) -> bool:
        """A gear turns with the cross-section at its centre."""
        return link in self.links and not self.is_rack(link)
