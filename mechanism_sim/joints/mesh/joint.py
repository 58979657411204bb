"""Gears, or a gear and a rack, in mesh as a joint of a mechanism."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.joints.mesh.constraint import MeshClosure, MeshSpring
from mechanism_sim.joints.mesh.involute import rack_teeth
from mechanism_sim.joints.mesh.placement import PlacedMesh, Teeth
from mechanism_sim.joints.mesh.reading import GearReading, read_mesh
from mechanism_sim.planar.mechanism import Bar, Coupling, Mechanism
from mechanism_sim.planar.points import LinkPoint, rotate
from mechanism_sim.planar.protocols import ForceElement
from mechanism_sim.planar.touch import TurningTouch
from mechanism_sim.planar.view import Draft, PairView, ToothLoad, circle

_FLANK = 14  # points of a drawn flank, its fillet among them


@dataclass(frozen=True)
class GearMesh(PlacedMesh):
    """Teeth in mesh, with play or without, rigid or elastic."""

    parts: ClassVar[str] = 'teeth with backlash'
    node: ClassVar[str] = 'gear_train'
    reads: ClassVar[type] = GearReading
    charts: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({
        'transmission error': ('transmission_error',), 'tooth force': ('tooth_force',),
    })  # fmt: skip

    def closure(self, mechanism: Mechanism) -> MeshClosure:
        """Without play."""
        return MeshClosure(self, mechanism)

    def touch(self, mechanism: Mechanism, radius: float = 0.0) -> TurningTouch:
        """Flanks, on the mean of their path."""
        return TurningTouch(self.closure(mechanism), f'{self.name}.friction', self.sliding_arm)

    @property
    def coupling(self) -> Coupling:
        """Of rigid and true teeth."""
        first, second = (self.per_phase * wave for wave in self.waves)
        rack = self.guide if self.is_rack(self.second) else None
        true = not (self.elastic or self.errors)
        return Coupling(self, self.carrier, (first, second), (None, rack), true)

    @property
    def elastic(self) -> bool:
        """True if its teeth give way."""
        return self.elasticity is not None

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
        """All but a rack."""
        return tuple(link for link in self.links if not self.is_rack(link))

    def tooth_loads(self, view: PairView) -> Sequence[ToothLoad]:
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
        sides = self.points
        wheels = zip(self.wheels, sides, strict=True)
        return [(side, teeth.gear.pitch_radius) for teeth, side in wheels if not teeth.rack]

    def bars(self) -> Sequence[Bar]:
        """A rack, as long as the gear is round."""
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
