"""A machine without clearance for other programs: poses and solids of its links.

Trees need revolute or prismatic joints: all guides are in the tree, revolute joints close loops. A
pin in a slot becomes a light block that slides in the slot and turns on the pin.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, cycle, pairwise
from typing import Literal

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.mechanism import (
    Coupling,
    HigherPair,
    Joint,
    Mechanism,
    Prismatic,
    Revolute,
    closing_joints,
)
from mechanism_sim.planar.points import GROUND, Vector2, rotate
from mechanism_sim.scene.machine import Machine

#: tolerance of coincident points of a link, as a share of the machine's size
SAME = 1e-6

#: width of a bar, as a share of the machine's size
WIDTH = 1.0 / 30.0

#: colours of the ground and, cyclically, of links: palette safe for colour blindness (Okabe, Ito)
_COLOURS = ('0.6 0.6 0.6', '0.9 0.6 0', '0.35 0.7 0.9', '0 0.6 0.5', '0.8 0.4 0', '0 0.45 0.7')
WORLD = 'world'

#: mass of a block in a slot, and of massless links, as a share of the heaviest link's
LIGHT = 1e-4

#: radius of gyration of links without inertia, as a share of the machine's size
_COMPACT = 0.1

#: time steps per turn of the drive at its largest speed, or per run; and the longest step [s]
STEPS, LONGEST = 4000, 1e-3


def frame_of(link: str, prefix: str) -> str:
    """The frame of a link in ``/tf``; that of the ground is the world."""
    return f'{prefix}{WORLD if link == GROUND else link}'


@dataclass(frozen=True)
class Ideal:
    """The ideal mechanism of a machine, assembled at its start.

    Parameters
    ----------
    machine : the machine
    """

    machine: Machine

    @cached_property
    def mechanism(self) -> Mechanism:
        """Links with mass, blocks among them; lower pairs first, revolute joints cut."""
        plan = self.machine.plan
        bodies = [self._weighed(body) for body in plan.bodies]
        joints: list[Joint] = []
        for joint in plan.joints:
            if not in_slot(joint):
                joints.append(joint)
                continue
            assert joint.line  # noqa: S101 - checked by in_slot
            block = f'{joint.name}.block'
            bodies.append(self._weighed(Body(block, 0.0, 0.0, (0.0, 0.0))))
            joints += [
                Prismatic(f'{joint.name}.slot', joint.second, block, joint.on_second,
                          (0.0, 0.0), joint.line.axis),
                Revolute(joint.name, joint.first, block, joint.on_first, (0.0, 0.0)),
            ]  # fmt: skip
        links = [body.name for body in bodies]
        # guides of driven links come first into the tree: here all guides do
        cut = closing_joints(links, joints, (), (GROUND, *links))
        return Mechanism(tuple(bodies), tuple(joints), cut, plan.scene.gravity)

    @cached_property
    def _heaviest(self) -> float:
        return max(body.mass for body in self.machine.plan.bodies)

    def _weighed(self, body: Body) -> Body:
        """Copy of a body with a mass and an inertia, as the format requires both."""
        blank = 1.0 if body in self.machine.plan.bodies else LIGHT
        mass = body.mass or (LIGHT * self._heaviest if self._heaviest else blank)
        radius = _COMPACT * self.machine.plan.ideal.size
        return replace(body, mass=mass, inertia=body.inertia or mass * radius**2)

    @cached_property
    def poses(self) -> dict[str, Array]:
        """Poses (3,) [m, m, rad] of the links and of the ground at the start."""
        return {link: pose for link, (pose, _) in self._states.items()}

    @cached_property
    def rates(self) -> dict[str, Array]:
        """Rates (3,) [m/s, m/s, rad/s] of the poses at the start."""
        return {link: rate for link, (_, rate) in self._states.items()}

    @cached_property
    def _states(self) -> dict[str, tuple[Array, Array]]:
        tree, (q, v, *_) = self.machine.plan.ideal, self.machine.assembly
        found = {GROUND: (np.zeros(3), np.zeros(3))}
        known, rates = (dict(zip(tree.coordinates, x.tolist(), strict=True)) for x in (q, v))
        for body in tree.bodies:
            place = tree.locate(body.name, known)
            velocity = tree.trace((body.name, (0.0, 0.0)), q[:, None], v[:, None])[1, :, 0]
            turning = rates.get(tree.frame(body.name)[0], 0.0)
            angle = tree.angle(body.name, known)
            found[body.name] = np.array([*place, angle]), np.array([*velocity, turning])
        for joint in self.machine.plan.joints:
            if in_slot(joint):
                pin, velocity = _carried(*found[joint.first], joint.on_first)
                pose, rate = found[joint.second]
                block = np.array([*pin, pose[2]]), np.array([*velocity, rate[2]])
                found[f'{joint.name}.block'] = block
        return found

    def point(self, link: str, at: Vector2) -> tuple[Array, Array]:
        """Position and velocity (2,) of a point of a link at the start [m, m/s]."""
        return _carried(self.poses[link], self.rates[link], at)

    def guided(self, joint: Prismatic) -> tuple[float, float]:
        """Displacement [m] along a guide at the start, and its rate [m/s]."""
        (a, va), (b, vb) = (
            self.point(joint.first, joint.on_first),
            self.point(joint.second, joint.on_second),
        )
        way = np.array(rotate((1.0, 0.0), self.poses[joint.first][2] + joint.axis))
        return float(way @ (b - a)), float(way @ (vb - va))

    def turned(self, link: str, other: str) -> tuple[float, float]:
        """Angle [rad] of a link relative to another at the start, and its rate [rad/s]."""
        angle = self.poses[link][2] - self.poses[other][2]
        return float(angle), float(self.rates[link][2] - self.rates[other][2])

    @cached_property
    def couplings(self) -> tuple[Coupling, ...]:
        """Gears and transmissions, rigid and without backlash."""
        pairs = (j for j in self.mechanism.joints if isinstance(j, HigherPair))
        return tuple(c for joint in pairs if (c := joint.coupling))

    @property
    def closing(self) -> Iterator[Revolute]:
        """The revolute joints that close loops."""
        cut = (self.mechanism.joint(name) for name in self.mechanism.cut)
        return (j for j in cut if isinstance(j, Revolute))

    def left_out(self) -> Iterator[str]:
        """Properties that the mechanism lacks in every format, in sentences."""
        plan = self.machine.plan
        for link, own in plan.ideal.extensions.items():
            if own.flexible:
                yield f'{link}: it is rigid here, and stays in its plane'
            else:
                yield f'{link}: its shaft and supports are rigid here'
        for joint in plan.joints:
            if in_slot(joint):
                yield f'{joint.name}: a block of {LIGHT:g} of the heaviest link is in the slot'
            elif isinstance(joint, HigherPair) and not joint.coupling:
                yield f'{joint.name}: left out ({joint.parts}): {joint.second} moves without it'
                continue
            elif isinstance(joint, HigherPair) and joint.coupling and not joint.coupling.exact:
                yield f'{joint.name}: its teeth are rigid and without errors here'
            if joint.name in plan.clearances:
                yield f'{joint.name}: it has no clearance here'
            if joint.name in plan.touching:
                yield f'{joint.name}: its stops are left out'
        for friction in plan.frictions(plan.ideal):
            yield f'{friction.name}: its friction is left out'
        for name in self.mechanism.cut:
            if isinstance(self.mechanism.joint(name), Prismatic):
                yield f'{name}: left out: a guide cannot close a loop of guides'
        weightless = [body.name for body in plan.bodies if not body.mass]
        if weightless and not self._heaviest:
            yield f'{", ".join(weightless)}: without mass in the scene, 1 kg each here'
        elif weightless:
            yield f'{", ".join(weightless)}: without mass in the scene, {LIGHT:g} of the heaviest'
        points = [b for b in plan.bodies if b.mass and not b.inertia]
        turning = [b.name for b in points if plan.ideal.frame(b.name)[0] != GROUND]
        if turning:
            radius = _COMPACT * plan.ideal.size
            yield f'{", ".join(turning)}: without inertia, here with a radius of {radius:g} m'


def in_slot(joint: Joint) -> bool:
    """True for a higher pair with a pin of its first link on a line of its second."""
    return isinstance(joint, HigherPair) and joint.line is not None


def check_names(machine: Machine) -> None:
    """Refuse a link with the name of the ground in other programs."""
    if any(body.name == WORLD for body in machine.plan.bodies):
        raise InputError(
            f"{machine.name}: a link named '{WORLD}' cannot be exported, that is the ground of "
            'other programs: rename it'
        )


def way(joint: Prismatic, link: str) -> Vector2:
    """Direction of a link's motion with the joint's displacement, in the link's frame.

    The other link is at rest.
    """
    if link == joint.first:
        return rotate((-1.0, 0.0), joint.axis)
    return rotate((1.0, 0.0), joint.axis - joint.angle)


def time_step(machine: Machine) -> float:
    """Recommended step of a fixed-step integrator [s]."""
    return min(LONGEST, min(machine.drive.period, machine.scene.duration or 1.0) / STEPS)


def _carried(pose: Array, rate: Array, at: Vector2) -> tuple[Array, Array]:
    """Position and velocity (2,) [m, m/s] of a link's point, from the link's pose and rates."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = c * at[0] - s * at[1], s * at[0] + c * at[1]
    return pose[:2] + np.array([x, y]), rate[:2] + rate[2] * np.array([-y, x])


@dataclass(frozen=True)
class Solid:
    """A box or a cylinder on a link, its axis square to the plane.

    Parameters
    ----------
    link : link that carries it, or the ground
    kind : shape of the solid
    size : lengths along x, y, z of a box; radius and length of a cylinder [m]
    at : centre in the link's frame [m]; z only separates links in views
    turn : rotation of a box about z [rad]
    colour : red, green and blue of the link
    """

    link: str
    kind: Literal['box', 'cylinder']
    size: tuple[float, ...]
    at: tuple[float, float, float]
    turn: float = 0.0
    colour: str = ''


def solids(machine: Machine) -> list[Solid]:
    """Solids of the ground and of all links.

    Links are bars between their joints, in layers; revolute joints are pins, sliders blocks on
    rails as long as the machine's size about the start position; gears, cams
    and Geneva wheels are discs: a gear of its pitch radius, a cam of its base circle, a Geneva
    wheel up to the ends of its slots.
    """
    ideal = Ideal(machine)
    mechanism = ideal.mechanism
    thick = WIDTH * mechanism.size
    layers = {GROUND: 0.0} | {
        body.name: (k + 1) * 0.5 * thick for k, body in enumerate(mechanism.bodies)
    }
    found: list[Solid] = []
    for link, layer in layers.items():
        if link == GROUND:
            continue
        # bars from each corner to the next
        corners = _corners(mechanism.joints, link)
        for a, b in pairwise([*corners, *(corners[:1] if len(corners) > 2 else [])]):
            length = math.dist(a, b)
            if length > SAME * thick / WIDTH:
                x, y = (float(c) for c in 0.5 * (a + b))
                turn = math.atan2(b[1] - a[1], b[0] - a[0])
                size = (length, thick, 0.4 * thick)
                found.append(Solid(link, 'box', size, (x, y, layer), turn))
    for joint in mechanism.joints:
        low, high = sorted((layers[joint.first], layers[joint.second]))
        if isinstance(joint, Revolute):
            height, middle = high - low + thick, 0.5 * (low + high)
            pin = (0.4 * thick, height)
            found.append(Solid(joint.first, 'cylinder', pin, (*joint.on_first, middle)))
        elif isinstance(joint, Prismatic):
            found += _guide(joint, layers, thick, mechanism.size, ideal.guided(joint)[0])
        else:
            found += _discs(joint, layers, thick)
    colours = dict(zip(layers, chain(_COLOURS, cycle(_COLOURS[1:])), strict=False))
    # a gear in two meshes is one disc
    return [replace(solid, colour=colours[solid.link]) for solid in dict.fromkeys(found)]


def _corners(joints: tuple[Joint, ...], link: str) -> Array:
    """Joints of a link (k, 2) [m], in the order of angles about their centre."""
    at = [j.on_first for j in joints if j.first == link]
    at += [j.on_second for j in joints if j.second == link]
    x = np.array(at or [(0.0, 0.0)])
    around = x - x.mean(axis=0)
    return np.asarray(x[np.argsort(np.arctan2(around[:, 1], around[:, 0]), kind='stable')])


def _guide(
    joint: Prismatic, layers: dict[str, float], thick: float, size: float, start: float
) -> Iterator[Solid]:
    """A block on `second`, a rail on `first`."""
    block = (2.4 * thick, 1.6 * thick, 0.8 * thick)
    at = (*joint.on_second, layers[joint.second])
    yield Solid(joint.second, 'box', block, at, joint.axis - joint.angle)
    rail = (size, 0.3 * thick, 0.3 * thick)
    way = rotate((start, 0.0), joint.axis)
    middle = joint.on_first[0] + way[0], joint.on_first[1] + way[1], layers[joint.first]
    yield Solid(joint.first, 'box', rail, middle, joint.axis)


def _discs(joint: Joint, layers: dict[str, float], thick: float) -> Iterator[Solid]:
    """Discs and bars of a higher pair."""
    if not isinstance(joint, HigherPair):
        return
    for (link, at), radius in joint.discs():
        yield Solid(link, 'cylinder', (radius, 0.5 * thick), (*at, layers[link]))
    for (link, at), long, axis, back in joint.bars():
        x, y = rotate((0.5 * thick, 0.0), back)
        place = (at[0] + x, at[1] + y, layers[link])
        yield Solid(link, 'box', (long, thick, 0.5 * thick), place, axis)
