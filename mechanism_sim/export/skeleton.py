"""Schematic drawing of a mechanism as in textbooks: shapes from points of links."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, get_args

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.export.bending import bendings, round_below, scale_bar
from mechanism_sim.export.ideal import way as slides
from mechanism_sim.export.shapes import BOX, Shape, inside
from mechanism_sim.joints.contact_keys import Clearance, ClearanceSpec
from mechanism_sim.joints.joint_keys import bounds_of
from mechanism_sim.linkages.springs import Spring
from mechanism_sim.planar.configuration import Poses
from mechanism_sim.planar.drive import DriveLaw, Law
from mechanism_sim.planar.mechanism import HigherPair, Mechanism, Prismatic, Revolute
from mechanism_sim.planar.points import GROUND, LinkPoint, Vector2, rotate
from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.planar.view import Kind, circle, complex_of, points_of
from mechanism_sim.scene import Machine

_MOUNT = 9.0  # length of the springs of a frame, in symbols
_BODIES: tuple[Kind, ...] = 'wheel', 'cam', 'slider'
_NEAR = 0.8  # a centre of gravity nearer to a joint is not marked, in symbols
_SWAY = 2.0  # drawn amplitude of a frame on springs, approximately, in symbols


class Mounted(NamedTuple):
    """A frame on springs."""

    cog: Vector2  #: centre of gravity at rest [m]
    springs: range  #: indices of its springs


class String(NamedTuple):
    """A straight line between points of two links, see `Draft.string`."""

    ends: tuple[LinkPoint, LinkPoint]
    radii: tuple[float, float]  #: radii of the discs [m]


class Skeleton:
    """Drawing of a mechanism over its coordinates q.

    Rails and slots are as long as the motion needs.

    Parameters
    ----------
    q : (n, N) coordinates
    points : points of links without joints, by name; links extend to them, and they are marked
    springs : both ends of each spring
    clearances : clearance by loose joint, whose bushing, or block between walls, is drawn
    drives : sign of the initial sense of motion by driven coordinate
    magnified : magnification of deformations of elastic links; 0 for a visible one
    size : size for the scale of symbols, if not that of the mechanism [m]

    Attributes
    ----------
    size : extent of joints, cams and the longest link [m]
    symbol : size of a joint, a sixtieth of `size` [m]
    shapes : shapes in the order of painting
    springs : both ends of each spring, painted before all shapes as `shapes.coil`
    strings : straight lines between links, painted before all shapes
    links : names of the moving links, in the order of poses
    corners : points up to which each link extends [m]
    mounts : frames on springs by name
    sways : magnification of the motion by name of a swaying frame
    bendings : deformation fields by elastic link
    """

    def __init__(
        self,
        mechanism: Mechanism,
        q: Array,
        points: Mapping[str, LinkPoint] | None = None,
        springs: Iterable[tuple[LinkPoint, LinkPoint]] = (),
        clearances: Mapping[str, ClearanceSpec] | None = None,
        drives: Mapping[str, float] | None = None,
        magnified: float = 0.0,
        size: float = 0.0,
    ) -> None:
        self.mechanism, self._clearances = mechanism, clearances or {}
        self.links = [body.name for body in mechanism.bodies]
        self.springs = list(springs)
        self._poses = Poses(mechanism, q)
        joints = mechanism.joints
        places = [x for j in joints for x in j.points]
        pairs = [j for j in joints if isinstance(j, HigherPair)]
        places += [end for ends in self.springs for end in ends]
        places += [place for pair in pairs for place in pair.covered()]
        covered = [self._poses.at(place) for place in places]
        for place, radius in (disc for pair in pairs for disc in pair.discs()):
            middle = self._poses.at(place)
            covered += [middle - radius, middle + radius]
        covered += [
            self._poses.at((j.second, j.on_second)) + side * mechanism.body(j.second).disk_radius
            for j in joints
            if j.second in mechanism.having(Rotor)
            for side in (-1.0, 1.0)
        ]
        widest = max(float(np.ptp(covered, axis=(0, 2)).max()), mechanism.longest)
        self.size = size or widest or 1.0
        self.symbol = self.size / 60.0
        self.bendings = bendings(mechanism, q, self.size, magnified)
        self.corners: dict[str, list[Vector2]] = {link: [] for link in self.links}
        self._rails: list[tuple[str, Vector2, Vector2]] = []
        self._bodied: set[str] = set()
        self._drawn: set[str] = set()
        self._hands = 0
        self.shapes: list[Shape] = []
        self.strings: list[String] = []
        for joint in joints:
            if isinstance(joint, Revolute):
                self._revolute(joint)
            elif isinstance(joint, Prismatic):
                self._prismatic(joint)
            else:
                joint.draw(self)
        for place in (end for ends in self.springs for end in ends):
            self._support(place)
            self.reach(place)
        self.mounts: dict[str, Mounted] = {}
        self.sways: dict[str, float] = {}
        bases = {(j.first, j.on_first) for j in joints if isinstance(j, Prismatic)}
        self._mark(points or {}, [x for x in places if x not in bases])
        for link in self.links:
            self._link(link)
        for coordinate, sense in (drives or {}).items():
            self._arrow(coordinate, sense, places)
        self.shapes.sort(key=_order)

    def mount(self, name: str, corners: list[Vector2], springs: list[Vector2]) -> None:
        """Add a frame on springs, which carries the ground.

        Parameters
        ----------
        corners : points [m] up to which it extends, its centre of gravity last
        springs : points [m] that are on springs
        """
        first = len(self.springs)
        self.mounts[name] = Mounted(corners[-1], range(first, first + len(springs)))
        self.add('frame', GROUND, np.array(corners + springs), label=name)
        for x, y in springs:
            foot = GROUND, (x, y - _MOUNT * self.symbol)
            self.springs.append(((GROUND, (x, y)), foot))
            self._support(foot)
        self.shapes.sort(key=_order)

    def poses(self, q: Array) -> Array:
        """Origins [m] and angles [rad] of the frames of the moving links, (N, L, 3 + M).

        The last M columns are elastic coordinates [m] of each link, padded by zeros.
        """
        at = self.mechanism
        most = max((len(x.beam.names) for x in self.bendings.values()), default=0)
        found = np.zeros((q.shape[1], len(self.links), 3 + most))
        for i, link in enumerate(self.links):
            own = at.amplitudes(link) if link in self.bendings else []  # rotors are drawn rigid
            found[:, i, :2] = at.locate_all(link, q).T
            found[:, i, 2] = at.angle_all(link, q)
            found[:, i, 3 : 3 + len(own)] = q[own].T
        return found

    def deformed(self, link: str, points: Array, pose: Array) -> Array:
        """Drawn points (k, 2) [m] of a link in its frame at a pose (L, 3 + M)."""
        return self.bent(link, points, pose[None])[0] if link in self.bendings else points

    def bent(self, link: str, points: Array, poses: Array) -> Array:
        """Deformed points (N, k, 2) [m] of an elastic link in its frame."""
        bending = self.bendings[link]
        last = 3 + len(bending.beam.names)
        return bending.moved(points, poses[:, self.links.index(link), 3:last])

    def magnify(self, sway: Array) -> None:
        """Set magnifications of frames on springs from their sway (N, F, 3) [m, rad] in a run."""
        for k, name in enumerate(self.mounts):
            largest = float(np.abs(sway[:, k, :2]).max(initial=0.0))
            if largest > 1e-9 * self.size:
                self.sways[name] = max(1.0, round_below(_SWAY * self.symbol / largest))

    def swayed(self, points: Array, frame: str, sway: Array) -> Array:
        """Positions (N, k, 2) [m] of points (k, 2) [m] of a frame on springs.

        Parameters
        ----------
        sway : (N, F, 3) magnified displacements of all frames [m, rad]
        """
        x, y, angle = sway[:, list(self.mounts).index(frame)].T
        cog, c, s = np.array(self.mounts[frame].cog), np.cos(angle), np.sin(angle)
        turned = (points - cog) @ np.array([[c, s], [-s, c]]).transpose(2, 0, 1)
        return np.asarray(turned + cog + np.stack([x, y], axis=1)[:, None])

    def coiled(self, poses: Array, sway: Array) -> Array:
        """Ends (springs, N, 2, 2) [m] of all springs at N poses and sways."""
        found = [
            [self.placed(link, np.array([at]), poses)[:, 0] for link, at in ends]
            for ends in self.springs
        ]
        for name, (_, springs) in self.mounts.items():
            for k in springs:
                found[k][0] = self.swayed(np.array([self.springs[k][0][1]]), name, sway)[:, 0]
        return np.array(found).reshape(len(found), 2, len(poses), 2).swapaxes(1, 2)

    def string(self, ends: tuple[LinkPoint, LinkPoint], radii: tuple[float, float]) -> None:
        """Add a straight line between two links, see `Draft`."""
        self.strings.append(String(ends, radii))
        for place in (place for place, radius in zip(ends, radii, strict=True) if not radius):
            self._support(place)

    def placed(self, link: str, points: Array, poses: Array) -> Array:
        """World coordinates (N, k, 2) [m] of points (k, 2) [m] of a link."""
        if link not in self.links:
            return np.broadcast_to(points, (len(poses), *np.shape(points)))
        x, y, angle = poses[:, self.links.index(link), :3].T
        c, s = np.cos(angle), np.sin(angle)
        if link in self.bendings:
            points = self.bent(link, points, poses)
        turned = points @ np.array([[c, s], [-s, c]]).transpose(2, 0, 1)
        return np.asarray(turned + np.stack([x, y], axis=1)[:, None])

    def _revolute(self, joint: Revolute) -> None:
        sides = joint.points
        for side in sides:
            self.reach(side)
            self._support(side)
        if joint.name in self._clearances:
            self.add('bushing', joint.second, np.array([joint.on_second]))
        if joint.second in self.mechanism.having(Rotor):
            radius = self.mechanism.body(joint.second).disk_radius
            notch = _plus(joint.on_second, (0.85 * radius, 0.0))
            rim = np.vstack([[notch], circle(radius, joint.on_second)[1:]])
            self.add('wheel', joint.second, rim, size=radius)
        pin = sides[0] if joint.name in self._clearances or sides[0][0] == GROUND else sides[1]
        self.add('pin', pin[0], np.array([pin[1]]), label=joint.name)

    def _support(self, place: LinkPoint) -> None:
        if place[0] == GROUND and self.first(f'support {place}'):
            self.add('support', GROUND, np.array([place[1]]))

    def _prismatic(self, joint: Prismatic) -> None:
        """A box on `second`, on a rail of `first`; a loose block between walls, true to scale."""
        runner = self._poses.within(joint.first, (joint.second, joint.on_second))
        length, width = (self.symbol * x for x in BOX)
        base = joint.first, joint.on_first
        clearance = self._clearances.get(joint.name)
        if isinstance(clearance, Clearance) and clearance.length and clearance.height:
            length, width, play = 0.5 * clearance.length, 0.5 * clearance.height, clearance.radial
            for side, label in ((1.0, 'left wall'), (-1.0, 'right wall')):
                off = rotate((0.0, side * (width + play)), joint.axis)
                wall = base[0], _plus(base[1], off)
                self.rail('rail', wall, joint.axis, runner + np.array(off)[:, None], length, label)
        else:
            self.rail('rail', base, joint.axis, runner)
        corners = ((-length, -width), (length, -width), (length, width), (-length, width))
        turn = joint.axis - joint.angle
        box = np.array([_plus(joint.on_second, rotate(c, turn)) for c in corners])
        self.add('slider', joint.second, box, label=joint.name)
        self._bodied.add(joint.second)
        self.reach((joint.second, joint.on_second))

    def at(self, place: LinkPoint) -> Array:
        """World coordinates (2, N) [m] of a point of a link."""
        return self._poses.at(place)

    def within(self, link: str, place: LinkPoint) -> Array:
        """Coordinates (2, N) [m] of a point of any link in the frame of `link`."""
        return self._poses.within(link, place)

    def turned(self, link: str) -> float:
        """Angle of a link in the world at the first instant [rad]."""
        ux, uy = self._poses.along[link][:, 0]
        return float(np.arctan2(uy, ux))

    def first(self, name: str) -> bool:
        """True if nothing of that name has been drawn yet."""
        known = name in self._drawn
        self._drawn.add(name)
        return not known

    def add(
        self, kind: Kind, link: str, *curves: Array, label: str = '', size: float = 0.0
    ) -> None:
        """Add a shape; wheels and cams are bodies of their links."""
        number = self.links.index(link) if link in self.links else -1
        bends = link in self.bendings
        self.shapes.append(Shape(kind, link, curves, self.symbol, label, size, number, bends))
        if kind in ('wheel', 'cam'):
            self._bodied.add(link)

    def pin(self, place: LinkPoint, label: str) -> None:
        """Add a pin, up to which its link extends."""
        self.add('pin', place[0], np.array([place[1]]), label=label)
        self.reach(place)

    def reach(self, place: LinkPoint) -> None:
        """Extend the outline of a link to a point; the ground has no outline."""
        link, at = place
        if link != GROUND:
            self.corners[link].append(at)

    def rail(
        self, kind: Kind, place: LinkPoint, axis: float, runner: Array, half: float = 0.0,
        label: str = '',
    ) -> None:  # fmt: skip
        """Add a line of a link along the path (2, N) [m] of the runner, in the link's frame.

        Parameters
        ----------
        half : half length of the runner [m]
        label : side of the runner for a wall
        """
        link, base = place
        way = rotate((1.0, 0.0), axis)
        along = way @ (runner - np.array(base)[:, None])
        spare = half + 2.5 * self.symbol
        ends = float(along.min()) - spare, float(along.max()) + spare
        start, end = (_plus(base, (s * way[0], s * way[1])) for s in ends)
        self.add(kind, link, np.array([start, end]), label=label)
        if link != GROUND:
            self._rails.append((link, start, end))

    def wall(self, link: str, start: Vector2, end: Vector2) -> None:
        """Add a wall of a link, solid to the left of the direction from start to end [m]."""
        self.add('rail', link, np.array([start, end]), label='left wall')

    def _mark(self, points: Mapping[str, LinkPoint], known: Sequence[LinkPoint]) -> None:
        """Draw points without joints, and centres of gravity away from joints."""
        for place in points.values():
            self.reach(place)
            if place not in known and self.first(f'point {place}'):
                self.add('point', place[0], np.array([place[1]]))
        near = _NEAR * self.symbol
        for body in self.mechanism.bodies:
            there = [at for link, at in (*known, *points.values()) if link == body.name]
            if body.mass and min(math.dist(at, body.cog) for at in there or [body.cog]) > near:
                self.reach((body.name, body.cog))
                self.add('cog', body.name, np.array([body.cog]))

    def _link(self, link: str) -> None:
        """Draw a link through its points, up to the nearest points of its rails.

        The first curve has the corners of a plate, or the ends of a bar; a second one the rest.
        """
        corners = [*self.corners[link]]
        for owner, start, end in self._rails:
            if owner == link:
                corners.append(_nearest(start, end, corners))
        cog, hand = self.mechanism.body(link).cog, 0.0
        if len(set(corners)) == 1 and link not in self._bodied:
            corners.append(cog)  # a pendulum
            if math.dist(corners[0], cog) < 0.5 * self.symbol:  # a rotor: its hand shows rotation
                self._hands += 1
                hand = 6.0 * self._hands * self.symbol  # shorter hands on top of longer ones
                corners[-1] = corners[0][0] + hand, corners[0][1]
        distinct: list[Vector2] = []
        for corner in corners or [cog]:
            if all(math.dist(corner, other) > 1e-9 for other in distinct):
                distinct.append(corner)
        at = np.array(distinct)
        if link in self._bodied and _covered(self, link, at):
            at = at[:1]
        first = _corners(at, self.symbol)
        rest = np.delete(at, first, axis=0)
        self.add('link', link, at[first], *([rest] if len(rest) else []), label=link, size=hand)

    def _arrow(self, drive: str, sense: float, places: Sequence[LinkPoint]) -> None:
        """Draw the arrow of a drive beside its joint, on the link that holds it."""
        joint = self.mechanism.tree_joints.get(drive)
        if not isinstance(joint, Prismatic):
            pins = (j for j in self.mechanism.joints if isinstance(j, Revolute))
            turned = (j for j in pins if drive in (j.first, j.second))
            joint = min(turned, key=lambda j: GROUND not in (j.first, j.second), default=None)
        if joint is None or not sense:
            return
        here, (holder, there) = joint.across(drive)
        if isinstance(joint, Prismatic):
            beside = self._poses.within(holder, here)[:, 0]
            way = -math.copysign(1.0, sense) * np.array(slides(joint, holder))
            at = beside + 2.4 * self.symbol * np.array([-abs(way[1]), abs(way[0])])
            label = 'straight'
        else:
            at, label = np.array(there), 'arc' if sense > 0.0 else 'clockwise'
            way = at - np.mean([x for link, x in places if link == holder], axis=0)
            way = np.array([way[0] or -1.0, abs(way[1])])  # supports are below
        self.add('drive', holder, np.array([at, at + way]), label=label)


def skeleton_of(
    machine: Machine,
    q: Array,
    magnified: float = 0.0,
    mechanism: Mechanism | None = None,
    size: float = 0.0,
) -> Skeleton:
    """The skeleton of a machine with its springs, named points, loose joints, drive and frames.

    Parameters
    ----------
    q : (n, N) coordinates of the machine's mechanism, or of `mechanism`
    size : size for the scale of symbols, if not that of the machine [m]
    """
    mechanism = mechanism or machine.mechanism
    elements = machine.plan.elements(mechanism)
    springs = [(e.first, e.second) for e in elements if isinstance(e, Spring)]
    points = {
        f'{link}.{name}': (link, at)
        for link, named in machine.plan.points.items()
        for name, at in named.items()
        if name != 'start' or 'end' in named
    }
    ground = [at for j in mechanism.joints for link, at in j.points if link == GROUND]
    drives = {coordinate: _sense(laws[0]) for coordinate, laws in machine.plan.laws.items()}
    drives |= {
        motor.coordinate: motor.ratio * motor.characteristic.starting
        for motor in machine.plan.motors
    }
    clearances = machine.plan.clearances
    found = Skeleton(mechanism, q, points, springs, clearances, drives, magnified, size)
    for gap in bounds_of(machine.scene.joints, mechanism, machine.plan.touching):
        gap.draw(found)
    found.shapes.sort(key=_order)
    for name, part in machine.scene.oscillators.items():
        found.mount(name, [*ground, part.cog], [mount.at for mount in part.mounts.values()])
    return found


def _covered(skeleton: Skeleton, link: str, points: Array) -> bool:
    """True if wheels or sliders of a link cover all of some points (k, 2) of it."""
    shown = [s.hull for s in skeleton.shapes if s.link == link and s.kind in _BODIES]
    return all(any(inside(hull, at, 0.5 * skeleton.symbol) for hull in shown) for at in points)


def _order(shape: Shape) -> tuple[int, float]:
    """Sort key for the order in which shapes are painted."""
    return get_args(Kind).index(shape.kind), -shape.size


def _sense(law: Law) -> float:
    """Value with the sign of the first prescribed motion, or of the torque or force."""
    begun = law.coefficients[1:] if isinstance(law, DriveLaw) else law.coefficients
    return next((c for c in begun if c), 0.0)


def strung(skeleton: Skeleton, poses: Array) -> Array:
    """Ends (strings, N, 2, 2) [m] of all strings at N poses: tangents of their discs."""
    found = []
    for ends, (r1, r2) in skeleton.strings:
        one, two = (skeleton.placed(link, np.array([at]), poses)[:, 0] for link, at in ends)
        way = complex_of(two - one)
        # way = (l + i (r2 - r1)) d with the direction d
        off = r2 - r1
        length = np.sqrt(np.maximum(np.abs(way) ** 2 - off**2, 0.0))
        left = 1j * way / np.where(way == 0.0, 1.0, length + 1j * off)
        found.append([one - points_of(r1 * left), two - points_of(r2 * left)])
    return np.array(found).reshape(len(found), 2, len(poses), 2).swapaxes(1, 2)


def scale_of(skeleton: Skeleton, width: float) -> tuple[float, str]:
    """A round length [m] for a drawing of a width [m]; its text, with magnifications."""
    length, text = scale_bar(width)
    bent, swayed = (x.magnified for x in skeleton.bendings.values()), skeleton.sways.values()
    for what, factors in (('bending', bent), ('sway', swayed)):
        for factor in sorted(set(factors)):
            text += f'; {what} '
            text += 'to scale' if factor == 1.0 else f'{factor:.4g} times larger'
    return length, text


def bounds(skeleton: Skeleton, poses: Array) -> tuple[Array, Array]:
    """The lower left and upper right corner (2,) [m], with room for labels.

    Parameters
    ----------
    poses : (N, L, 3 + M) poses in the picture
    """
    placed = [skeleton.placed(s.link, s.hull, poses).reshape(-1, 2) for s in skeleton.shapes]
    everything = np.concatenate(placed)
    low, high = everything.min(axis=0), everything.max(axis=0)
    room = 2.5 * skeleton.symbol
    centre = 0.5 * (low + high)
    half = np.maximum(0.5 * (high - low) + room, 18.0 * skeleton.symbol)
    return centre - half, centre + half


def _plus(a: Vector2, b: Vector2) -> Vector2:
    return a[0] + b[0], a[1] + b[1]


def _nearest(start: Vector2, end: Vector2, others: Sequence[Vector2]) -> Vector2:
    """The point of a segment nearest to the centroid of other points."""
    if not others:
        return 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
    x, y = (sum(each) / len(others) for each in zip(*others, strict=True))
    dx, dy = end[0] - start[0], end[1] - start[1]
    share = ((x - start[0]) * dx + (y - start[1]) * dy) / (dx * dx + dy * dy)
    share = min(max(share, 0.0), 1.0)
    return start[0] + share * dx, start[1] + share * dy


def _corners(points: Array, thin: float) -> list[int]:
    """Indices of the corners of a plate around all points (k, 2).

    For points nearly on a line, those of both ends.
    """
    if len(points) < 3:
        return list(range(len(points)))
    at = points - points.mean(axis=0)
    _, _, (along, across) = np.linalg.svd(at, full_matrices=False)
    if np.ptp(at @ across) < thin:
        place = at @ along
        return [int(place.argmin()), int(place.argmax())]
    found: list[int] = scipy.spatial.ConvexHull(points).vertices.tolist()
    return found
