"""A cam and its follower as a joint of a mechanism: the relation, or the gap, and its force.

The cam turns or slides on the ground; the follower slides or swings on the ground. A cam that the
follower may leave is `CamPair`; one whose groove holds the roller on both sides is `GroovePair`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.joints.cam.distance import PlacedCam
from mechanism_sim.joints.cam.followers import FlatFaced, Oscillating, OscillatingFlat
from mechanism_sim.joints.cam.profiles import distinct, outline_angles
from mechanism_sim.joints.cam.reading import CamReading, read_cam
from mechanism_sim.numerics.symbolic import Term, add, dense, div, mul, neg
from mechanism_sim.planar.closures import HigherClosure
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, LinkPoint, Vector2, rotate
from mechanism_sim.planar.protocols import Wrench, moment_of
from mechanism_sim.planar.rails import chord
from mechanism_sim.planar.touch import Touch
from mechanism_sim.planar.view import Draft, PairView, Side, circle

_FACE = 0.5  # thickness of a face, in units of the drawing's symbols
_TIP = 1.5  # length of a knife's edge


@dataclass(frozen=True)
class CamPair(PlacedCam):
    """A cam that the follower may leave."""

    parts: ClassVar[str] = 'follower on its cam'
    node: ClassVar[str] = 'cam'
    reads: ClassVar[type] = CamReading
    charts: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {
            'lift': ('lift', 'follower_position'),
            'contact force': ('contact_force',),
            'torque on the cam': ('cam_torque',),
            'spin of the roller': ('roller_speed',),
        }
    )

    def reading(self, view: PairView) -> CamReading:
        """Cam, follower, gap and contact force."""
        return read_cam(self, view)

    def slides(self, link: str, mechanism: Mechanism) -> bool:
        """True if the law counts displacements: of the cam, or of the follower."""
        return self.distance.slides if link == self.first else not self.distance.swings

    def draw(self, draft: Draft) -> None:
        """A cam, and what touches it of its follower."""
        draft.add('cam', self.first, *_cam_outlines(self))
        outline = _follower_outline(self, draft.turned(self.second), draft.symbol)
        draft.add('cam', self.second, outline)
        draft.reach((self.second, self.on_second))

    def covered(self) -> Sequence[LinkPoint]:
        """Points of the cam's edges."""
        return [
            (self.first, (float(x), float(y)))
            for edge in _cam_outlines(self)
            for x, y in edge[:: len(edge) // 12 or 1]
        ]

    def discs(self) -> Sequence[tuple[LinkPoint, float]]:
        """The base circle, and the roller."""
        found = [((self.first, self.on_first), self.cam.base_radius)]
        roller = getattr(self.cam.follower, 'roller', 0.0)
        return [*found, ((self.second, self.on_second), roller)] if roller > 0.0 else found

    def bears(self, link: str) -> bool:
        """A cam turns with the cross-section at its axis, a roller is at a point of its arm."""
        if link == self.first:
            return not self.distance.slides
        return isinstance(self.cam.follower, Oscillating)

    @property
    def without_forces(self) -> str:
        """Describe the jumps of the follower's velocity, which need infinite forces."""
        jumps = self.cam.corners
        more = f', and {len(jumps) - 1} more' if jumps[1:] else ''
        return f'law: {jumps[0]}{more}: no finite force gives this motion' if jumps else ''

    def closure(self, mechanism: Mechanism) -> CamClosure:
        """Closure of contact without clearance."""
        return CamClosure(self, mechanism)

    def touch(self, mechanism: Mechanism, radius: float = 0.0) -> Touch:
        """Contact off the roller's centre, on a pin of that radius, or off a face's pivot."""
        follower, name = self.cam.follower, f'{self.name}.friction'
        roller = getattr(follower, 'roller', 0.0)
        share = radius / roller if roller else 1.0
        offset = follower.face_offset if isinstance(follower, OscillatingFlat) else -roller
        return Touch(self.closure(mechanism), name, offset, share=share)


@dataclass(frozen=True)
class GroovePair(CamPair):
    """A cam with a groove that guides the roller, with or without clearance between its walls."""

    sides: ClassVar[tuple[Side, ...]] = ('left', 'right')
    parts: ClassVar[str] = 'roller between the walls of a groove'
    grooved: ClassVar[bool] = True


@dataclass(frozen=True)
class CamClosure(HigherClosure[CamPair]):
    """The follower touches the cam: their `Distance` along the normal is zero.

    Its gradient in contact is that of the true distance, so the force along it is the true normal
    force. What it does to the follower is the force that has the same power: through the centre
    of the roller, or across the face at the point where it touches.
    """

    def values(self, frames: Frames) -> list[Jet]:
        """The distance [m]."""
        distance = self.joint.distance
        return [distance.value(frames, self._angle(frames), self._place(frames))]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """The cam pushes the follower out, by torques about the camshaft and the pivot.

        Both follow from the power of the force along the row; together with the point or the
        direction of the force they determine it. On a cam that slides it is the force along its
        way instead of the torque about the camshaft.
        """
        joint, force = self.joint, forces[0]
        follower, mirror = joint.cam.follower, float(joint.mirror)
        angle, place = self._angle(frames), self._place(frames)
        off = joint.distance.value(frames, _alone(angle, 'cam'), _alone(place, 'follower'))
        by_cam = mul(force, off.gradient.get('cam'))
        about_shaft = mul(by_cam, hy.expression(-float(joint.sense)))
        along = mul(force, off.gradient.get('follower'))
        rx, ry = (
            jet.value
            for jet in self._from_camshaft(frames, joint.second, joint.on_second, 'follower')
        )
        x: Term = along
        y: Term = by_cam
        if isinstance(follower, Oscillating | OscillatingFlat):
            about_pivot = mul(along, hy.expression(float(joint.swing)))
            a = frames.parameters(f'{self.name}.pivot_distance', follower.pivot_distance)
            if joint.distance.slides:
                about_shaft = add(about_pivot, mul(mul(a, y), hy.expression(mirror)))
            else:
                y = div(mul(add(about_shaft, neg(about_pivot)), hy.expression(mirror)), a)
        if isinstance(follower, FlatFaced):
            y = mul(x, frames.parameters(f'{self.name}.slope', math.tan(follower.tilt)))
        elif isinstance(follower, OscillatingFlat):
            c, s = hy.cos(place.value), hy.sin(place.value)
            x = -(float(follower.side) * y * s / c)
        elif isinstance(follower, Oscillating):
            x = add(mul(rx, y), mul(about_shaft, hy.expression(-mirror))) / ry
        elif not joint.distance.slides:
            y = add(mul(about_shaft, hy.expression(mirror)), mul(ry, x)) / rx
        cx, cy, sx, sy = (jet.value for jet in self._axes(frames))
        wx, wy = add(mul(x, cx), mul(y, sx)), add(mul(x, cy), mul(y, sy))
        if isinstance(follower, FlatFaced | OscillatingFlat):
            off_point = mul(moment_of((rx, ry), (x, y)), hy.expression(-mirror))
            return Wrench(wx, wy, add(about_shaft, off_point))
        return Wrench(wx, wy)

    def _angle(self, frames: Frames) -> Jet:
        """Angle of the cam [rad], or its displacement [m]."""
        joint = self.joint
        if joint.distance.slides:
            return -self._from_camshaft(frames, joint.first, joint.on_first, 'cam')[1]
        m, label = self.mechanism, f'{self.name}:{joint.first}'
        offset = m.frame(joint.first)[1]
        start = frames.parameters(f'{self.name}.phase', joint.sense * offset + joint.phase)
        turned = m.turning(frames, joint.first, joint.on_first, label)
        return turned * float(joint.sense) + lift(start)

    def _place(self, frames: Frames) -> Jet:
        """Position of the follower: from the camshaft [m], or from the line of centres [rad]."""
        joint = self.joint
        if not joint.distance.swings:
            return self._from_camshaft(frames, joint.second, joint.on_second, 'follower')[0]
        frame, offset = self.mechanism.frame(joint.second)
        sign = float(joint.swing)
        start = sign * (offset + joint.arm_angle - joint.direction - math.pi)
        known = frames.parameters(f'{self.name}.place', math.remainder(start, 2.0 * math.pi))
        turned = frames.angle(frame)
        if joint.second in self.mechanism.having(Beam):
            turned += chord(self.mechanism, frames, joint.second, joint.pivot, joint.on_second)
        return turned * sign + lift(known)

    def _from_camshaft(self, frames: Frames, link: str, at: Vector2, label: str) -> JetPair:
        """Vector from the camshaft to a point of a link, in the frame of `followers` [m]."""
        px, py = frames.position(self.mechanism.point(link, at), f'{self.name}.{label}')
        ox, oy = frames.position({(GROUND, None): self.joint.centre}, f'{self.name}.centre')
        x, y = px - ox, py - oy
        cx, cy, sx, sy = self._axes(frames)
        return x * cx + y * cy, x * sx + y * sy

    def _axes(self, frames: Frames) -> list[Jet]:
        """Components of the frame's axes in the world: of x, then of y."""
        joint = self.joint
        given = [*joint.world((1.0, 0.0)), *joint.world((0.0, 1.0))]
        terms = [
            hy.expression(v) if abs(v) == 1.0 else frames.parameters(f'{self.name}.axis.{k}', v)
            for k, v in enumerate(given)
        ]
        return [lift(term) for term in terms]


def _alone(x: Jet, name: str) -> Jet:
    """The value as a coordinate of its own, for partial derivatives."""
    return Jet(dense(x.value), {name: hy.expression(1.0)}, None, None)


def _cam_outlines(joint: PlacedCam) -> list[Array]:
    """The cam (k, 2) [m], from its edge inwards: a groove has a rim and two walls.

    A cam that slides is a bar from its base line on; a groove in it is what lies between bars.
    """
    cam, angles = joint.cam, outline_angles(joint.cam.law)
    walls = cam.groove(angles) if joint.grooved else (cam.at(angles).profile,)
    edges = list(walls[::-1])
    if joint.distance.slides:
        backs = 0.0, walls[-1][0].max() + cam.base_radius
        edges = [_bar(wall, back) for wall, back in zip(walls, backs, strict=False)]
    elif joint.grooved:
        rim = 1.12 * float(np.hypot(*walls[-1]).max())
        edges = [rim * np.array([np.cos(angles), np.sin(angles)]), *edges]
    return [joint.profile(distinct(edge, closed=True)).T for edge in edges]


def _bar(edge: Array, back: float) -> Array:
    """Closed behind an edge (2, N), at a height."""
    return np.column_stack([edge, (back, edge[1, -1]), (back, edge[1, 0])])


def _follower_outline(joint: PlacedCam, angle: float, symbol: float) -> Array:
    """Roller, edge or face, on the follower's link, (k, 2) [m].

    Parameters
    ----------
    angle : angle of the follower's link in the world at some instant [rad]
    symbol : size of the drawing's symbols [m]
    """
    follower = joint.cam.follower
    if isinstance(follower, FlatFaced | OscillatingFlat):
        angles = outline_angles(joint.cam.law)
        if isinstance(follower, FlatFaced):  # the contact wanders by u' along the face
            reach, behind = joint.cam.law(angles, 1), -1.0
            turn = joint.direction + joint.mirror * follower.tilt + 0.5 * math.pi - angle
        else:
            reach, behind = joint.cam.at(angles).sliding, -float(joint.swing)
            turn = joint.arm_angle
        half = float(np.abs(reach).max()) + 0.3 * joint.cam.base_radius
        thick = behind * _FACE * symbol
        corners = np.array([(-half, 0.0), (half, 0.0), (half, thick), (-half, thick)]).T
    elif follower.roller > 0.0:
        return circle(follower.roller, joint.on_second)
    else:
        size = _TIP * symbol
        corners = np.array([(0.0, 0.0), (size, -0.3 * size), (size, 0.3 * size)]).T
        turn = joint.direction - angle
        if joint.distance.swings:
            turn = joint.arm_angle + math.pi
    c, s = rotate((1.0, 0.0), turn)
    return np.asarray(joint.on_second + corners.T @ [[c, s], [-s, c]])
