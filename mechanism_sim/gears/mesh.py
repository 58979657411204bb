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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.gears.compliance import Elasticity, MeshSpring
from mechanism_sim.gears.involute import Gear, rack_teeth
from mechanism_sim.gears.reading import GearReading, read_mesh
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.closures import HigherClosure
from mechanism_sim.planar.configuration import off_line, turned
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.jet import Jet, lift
from mechanism_sim.planar.loads import Wrench, moment_of
from mechanism_sim.planar.mechanism import Equation, HigherPair, Mechanism, Pose, Prismatic
from mechanism_sim.planar.points import LinkPoint, Vector2, rotate
from mechanism_sim.planar.protocols import ForceElement
from mechanism_sim.planar.touch import TurningTouch
from mechanism_sim.planar.view import Array, Charted, Draft, ToothLoad, View, circle

_FLANK = 14  # points of a drawn flank, its fillet among them


class Teeth(NamedTuple):
    """A gear as it stands on its link, or a rack that it could mesh with."""

    name: str
    gear: Gear
    rack: bool = False
    tooth: float = 0.0  #: [rad] where its link's frame has a tooth; of a rack [m] along the guide


@dataclass(frozen=True)
class Harmonic:
    """A part of the transmission error: ``amplitude sin(order (a - start))``.

    `member` says whose angle (or, of a rack, displacement) a against the carrier counts: 0 of
    the first, 1 of the second.
    """

    member: int
    order: float  #: per radian, or per metre
    amplitude: float  #: [m] along the line of action
    start: float = 0.0  #: [rad, m]


@dataclass(frozen=True)
class GearMesh(HigherPair):
    """Teeth of `first` and `second` in mesh, `on_first` and `on_second` their centres.

    For a rack, which is the second, `on_second` is a point of its pitch line. On the left side
    the first gear, turning counterclockwise, drives.
    """

    parts: ClassVar[str] = 'teeth with backlash'
    node: ClassVar[str] = 'gear_train'

    carrier: str
    waves: tuple[float, float]  #: N of each, negative for internal teeth; of a rack [1/m]
    base_pitch: float  #: [m]
    pressure_angle: float  #: [rad] working
    towards: float  #: [rad] from the first centre to the second, in the carrier's frame
    reach: float  #: [m] from the first centre to the pitch point in that direction
    facing: tuple[float, float] = (0.0, 0.0)
    """Where each has its angle zero on the line of centres: angle against the carrier [rad]; of a
    rack the displacement [m] with `on_second` there."""
    guide: Prismatic | None = None  #: along which a rack slides on the carrier
    bearings: tuple[str, ...] = ()  #: shafts between gears and carrier, and the guide
    wheels: tuple[Teeth, ...] = ()
    contact_ratio: float = math.nan
    sliding_arm: float = 0.0  #: [m] mean distance of contact from the pitch point
    helix_angle: float = 0.0  #: [rad] on the working pitch circles
    hand: int = 1  #: of the first: 1 right, -1 left
    along: tuple[float, float] = (0.0, 0.0)  #: [m] where both lie on their shafts
    phase: float = 0.0  #: u0 [rad]
    errors: tuple[Harmonic, ...] = ()
    play: float = 0.0  #: [m] along the line of action, to either side
    elasticity: Elasticity | None = None

    def closure(self, mechanism: Mechanism) -> MeshClosure:
        """Without play."""
        return MeshClosure(self, mechanism)

    def touch(self, mechanism: Mechanism, radius: float = 0.0) -> TurningTouch:
        """Flanks, on the mean of their path."""
        return TurningTouch(self.closure(mechanism), f'{self.name}.friction', self.sliding_arm)

    @property
    def elastic(self) -> bool:
        """Whether its teeth give way."""
        return self.elasticity is not None

    def elements(self, mechanism: Mechanism) -> list[ForceElement]:
        """The spring of elastic teeth."""
        if self.elasticity is None:
            return []
        return [MeshSpring(self.closure(mechanism), self.elasticity, self.play)]

    def reading(self, view: View) -> GearReading:
        """Motion, transmission error and forces."""
        return read_mesh(self, view)

    def tooth_loads(self, view: View) -> Sequence[ToothLoad]:
        """At the pitch point; axial against the tangential force of right-handed teeth.

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
            (-1.0, 1.0), ((self.first, self.on_first), (self.second, self.on_second)), self.along,
            strict=True,
        ):  # fmt: skip
            if not self._rack(link):
                arm = point - view.place(link, at)
                arm = np.array([*arm, np.full(view.count, along)])
                found.append(ToothLoad(link, sign * force, arm, True))
        return found

    def charts(self, *, slides: bool) -> Sequence[Charted]:
        """Transmission error and tooth force."""
        force = {'tooth_force': 'tooth force'}
        return (
            Charted('transmission error', {'transmission_error': 'error'}, 'error', 'm'),
            Charted('tooth force', force, 'force', 'N', force=True),
        )

    def draw(self, draft: Draft) -> None:
        """The gears of a mesh, each drawn once."""
        sides = (self.first, self.on_first), (self.second, self.on_second)
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
        """Of a rack, as many as the motion needs, with its back (k, 2) in its link's frame."""
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
        sides = (self.first, self.on_first), (self.second, self.on_second)
        wheels = zip(self.wheels, sides, strict=True)
        return [(side, teeth.gear.pitch_radius) for teeth, side in wheels if not teeth.rack]

    @property
    def ends(self) -> tuple[str, str]:
        """The two links."""
        return self.first, self.second

    @property
    def per_phase(self) -> float:
        """Way along the line of action by phase of the teeth [m/rad]."""
        return self.base_pitch / (2.0 * math.pi)

    @property
    def sign(self) -> float:
        """-1 if one of the two has internal teeth, else 1."""
        teeth = [w for w, link in zip(self.waves, self.ends, strict=True) if not self._rack(link)]
        return -1.0 if min(teeth) < 0.0 else 1.0

    def _rack(self, link: str) -> bool:
        return self.guide is not None and self.guide.second == link

    def places(self, tree: Mechanism, q: Mapping[str, float]) -> tuple[float, float]:
        """Angles [rad] against the carrier, of a rack the displacement [m], at coordinates."""
        found = []
        for link in self.ends:
            if self._rack(link) and self.guide:
                g = self.guide
                a, b = tree.locate(g.first, q, g.on_first), tree.locate(link, q, g.on_second)
                way = tree.angle(g.first, q) + g.axis
                found.append((b[0] - a[0]) * math.cos(way) + (b[1] - a[1]) * math.sin(way))
            else:
                found.append(tree.angle(link, q) - tree.angle(self.carrier, q))
        return found[0], found[1]

    def bears(self, link: str) -> bool:
        """A gear turns with the cross-section at its centre."""
        return link in self.ends and not self._rack(link)

    def equation(self, pose: Callable[[str], Pose]) -> Equation:
        """The offset [m] at the poses of links; errors of the teeth count too."""
        carrier = pose(self.carrier)
        u, by = -self.phase, {self.first: np.zeros(3), self.second: np.zeros(3)}
        by.setdefault(self.carrier, np.zeros(3))
        slopes, values = [], []
        for link, wave in zip(self.ends, self.waves, strict=True):
            if self._rack(link) and self.guide:
                g = self.guide
                on, p = turned(carrier, g.on_first), turned(pose(link), g.on_second)
                value, by_carrier, by_link = off_line(carrier, g.axis - 0.5 * math.pi, on, p)
            else:
                value, by_link = pose(link)[2] - carrier[2], np.array([0.0, 0.0, 1.0])
                by_carrier = -by_link
            u += wave * value
            values.append(value)
            slopes.append((link, self.per_phase * wave, by_link, by_carrier))
        h = self.per_phase * math.remainder(u, 2.0 * math.pi)
        for member, (link, slope, by_link, by_carrier) in enumerate(slopes):
            for e in (e for e in self.errors if e.member == member):
                turn = e.order * (values[member] - e.start)
                h += e.amplitude * math.sin(turn)
                slope += e.order * e.amplitude * math.cos(turn)  # noqa: PLW2901 - of this row
            by[link] = by[link] + slope * by_link
            by[self.carrier] = by[self.carrier] + slope * by_carrier
        return h, by


@dataclass(frozen=True)
class MeshClosure(HigherClosure[GearMesh]):
    """Gears in mesh without play."""

    def places(self, frames: Frames) -> tuple[Jet, Jet]:
        """Angles of the gears against the carrier [rad]; of a rack, its displacement [m]."""
        j = self.joint
        return self._place(frames, j.first, j.on_first), self._place(frames, j.second, j.on_second)

    def _place(self, frames: Frames, link: str, at: Vector2) -> Jet:
        m, guide = self.mechanism, self.joint.guide
        if guide is not None and guide.second == link:
            if m.tree_joints.get(link) == guide:
                return frames.displacement(link)
            x, y = frames.position(m.separation(guide.name), guide.name)
            ux, uy = frames.position(m.direction(guide.first, guide.axis), f'{guide.name}.way')
            return -(x * ux + y * uy)
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
        """What a force along the row does to the second, without what parts the gears."""
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
