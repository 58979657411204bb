"""Spatial robots as described by URDF, SDF and MJCF, and their planar motion."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.imports.blueprint import Blueprint, BlueprintLink, angle, named, names_of
from mechanism_sim.planar.points import GROUND, Vector2

WORLD = 'world'
KINDS = {'revolute': 'revolute', 'continuous': 'revolute', 'prismatic': 'prismatic',
         'fixed': 'fixed'}  # fmt: skip
"""Joints of a plane by the types of URDF and SDF."""

_LEFT_OUT = {'limits': 'its limits are left out: see `stops`',
             'friction': 'its friction is left out, which does not depend on its load',
             'armature': 'the inertia of its rotor is left out',
             'springdamper': 'its springdamper is left out: see `springs`'}  # fmt: skip
_ALIGNED = 1e-4  # [rad] tolerance of parallel axes: files have angles such as 1.5708
_SAME = 1e-9  # [m] tolerance of coincident points
_PLANES = {2: (0, 1), 1: (0, 2), 0: (1, 2)}  # axes of the plane, by its normal axis


@dataclass
class RobotBody:
    """A body: its frame at the start, mass, centre of gravity and central inertia in its axes.

    A `frame` has neither mass nor shape, and only connects joints.
    """

    name: str
    turn: Array = field(default_factory=lambda: np.eye(3))
    place: Array = field(default_factory=lambda: np.zeros(3))
    mass: float = 0.0
    cog: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    frame: bool = False

    def world(self, point: Array) -> Array:
        """World coordinates (3,) [m] of a point of the body."""
        return np.asarray(self.place + self.turn @ point)

    def local(self, place: Array) -> Array:
        """Coordinates (3,) [m] in the body's frame of a point of the world."""
        return np.asarray(self.turn.T @ (place - self.place))


@dataclass(frozen=True)
class RobotJoint:
    """A joint `revolute`, `prismatic`, `slot` or `fixed` at a point of both its bodies."""

    name: str
    kind: str
    parent: str
    child: str
    on_parent: Array
    on_child: Array
    axis: Array  #: (3,) direction in the frame of the child; zeros for a loop without one
    #: (3, 3) rotation of the child in the parent, for a fixed joint
    turn: Array = field(default_factory=lambda: np.eye(3))


@dataclass
class Robot:
    """Bodies, joints of the tree and of loops, and further contents of a file."""

    title: str
    bodies: dict[str, RobotBody] = field(default_factory=lambda: {WORLD: RobotBody(WORLD)})
    joints: list[RobotJoint] = field(default_factory=list)
    #: constant linear combinations of joint coordinates, by name
    ratios: dict[str, dict[str, float]] = field(default_factory=dict)
    #: constant linear combinations of angles of bodies, by name
    geared: dict[str, dict[str, float]] = field(default_factory=dict)
    #: linear combinations of joint coordinates, with their speeds [rad/s, m/s]
    drives: list[tuple[dict[str, float], float]] = field(default_factory=list)
    #: ends (body, point) and keys of the scene, by name
    springs: dict[str, tuple[list[tuple[str, Array]], dict[str, Any]]] = field(
        default_factory=dict
    )
    #: springs of linear combinations of joint coordinates by name: stiffness, damping [SI], free
    #: value less that at the start, and the only side on which they act
    twists: dict[str, tuple[dict[str, float], float, float, float, str]] = field(
        default_factory=dict
    )
    gravity: Array | None = None
    notes: list[str] = field(default_factory=list)

    def resist(self, joint: str, stiffness: float, damping: float, free: float = 0.0) -> None:
        """Add a spring and damper of a joint, free of force at `free` [rad, m] from the start."""
        if stiffness or damping:
            self.twists[f'{joint}_spring'] = {joint: 1.0}, stiffness, damping, free, ''

    def leave_out(self, joint: str, **properties: bool) -> None:
        """Note properties of a joint, of `_LEFT_OUT`, that it has in the file."""
        self.notes += [f'{joint}: {_LEFT_OUT[x]}' for x, has in properties.items() if has]

    def blueprint(self) -> Blueprint:
        """The planar machine."""
        self._merge_fixed()
        self._drop_frames()
        return _Plane(self).blueprint()

    def _merge_fixed(self) -> None:
        """Merge bodies that are fixed to each other, in the frame of the one with mass."""
        while fixed := next((j for j in self.joints if j.kind == 'fixed'), None):
            self.joints.remove(fixed)
            parent, child = self.bodies[fixed.parent], self.bodies[fixed.child]
            here = fixed.on_parent - fixed.turn @ fixed.on_child  # the child's origin
            if parent.frame and not child.frame and parent.name != WORLD:
                turn, at = fixed.turn.T, -fixed.turn.T @ here
                kept, gone = child, parent
            else:
                turn, at, kept, gone = fixed.turn, here, parent, child
            add_mass(kept, gone, turn, at)
            kept.frame &= gone.frame
            del self.bodies[gone.name]
            self.joints = [_moved(j, kept.name, gone.name, turn, at) for j in self.joints]
            self.geared = {
                name: {kept.name if b == gone.name else b: w for b, w in weights.items()}
                for name, weights in self.geared.items()
            }
            for ends, _ in self.springs.values():
                ends[:] = [
                    (kept.name, at + turn @ p) if b == gone.name else (b, p) for b, p in ends
                ]

    def _drop_frames(self) -> None:
        """Remove frames between two joints: coaxial hinges, and slides that leave a body free."""
        for name in [b.name for b in self.bodies.values() if b.frame and b.name != WORLD]:
            before = [j for j in self.joints if j.child == name]
            after = [j for j in self.joints if j.parent == name]
            if len(before) != 1 or len(after) != 1:
                continue
            (a,), (b,) = before, after
            if a.kind == b.kind == 'revolute' and np.allclose(a.on_child, b.on_parent, 0, _SAME):
                self.joints[self.joints.index(b)] = replace(
                    b, parent=a.parent, on_parent=a.on_parent
                )
                self.joints.remove(a)
                del self.bodies[name]
                self.ratios = {n: f for n, f in self.ratios.items() if a.name not in f}
            elif a.kind == b.kind == 'prismatic' and a.parent == WORLD:
                free = next((j for j in self.joints if j.parent == b.child), None)
                if free and free.kind == 'revolute' and self.bodies[b.child].frame:
                    self.joints = [j for j in self.joints if j not in (a, b, free)]
                    del self.bodies[name], self.bodies[b.child]
        if frames := [b.name for b in self.bodies.values() if b.frame and b.name != WORLD]:
            self.notes.append(f'{", ".join(frames)}: without mass, and without a shape')


def _spring(name: str) -> str:
    """The name of a spring in a scene, without the section name that exports add."""
    return named(name.removeprefix('springs.'))


def _moved(joint: RobotJoint, kept: str, gone: str, turn: Array, at: Array) -> RobotJoint:
    """A joint of a body that has been merged into another at this pose."""
    if joint.parent == gone:
        back = turn @ joint.turn
        joint = replace(joint, parent=kept, on_parent=at + turn @ joint.on_parent, turn=back)
    if joint.child == gone:
        joint = replace(
            joint, child=kept, on_child=at + turn @ joint.on_child, axis=turn @ joint.axis,
            turn=joint.turn @ turn.T,
        )  # fmt: skip
    return joint


def add_mass(kept: RobotBody, gone: RobotBody, turn: Array, at: Array) -> None:
    """Add the mass of a body at a pose in another, by the parallel axis theorem."""
    if not gone.mass:
        return
    centre, inertia, mass = at + turn @ gone.cog, turn @ gone.inertia @ turn.T, kept.mass
    both = mass + gone.mass
    middle = (mass * kept.cog + gone.mass * centre) / both if mass else centre
    kept.inertia = _about(kept.inertia, mass, kept.cog - middle) + _about(
        inertia, gone.mass, centre - middle
    )
    kept.mass, kept.cog = both, middle


def _about(inertia: Array, mass: float, off: Array) -> Array:
    return np.asarray(inertia + mass * (off @ off * np.eye(3) - np.outer(off, off)))


class _Plane:
    """The plane in which a robot moves, and its contents."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        hinges = [j for j in robot.joints if j.kind == 'revolute' and j.axis.any()]
        ways = {j.name: robot.bodies[j.child].turn @ j.axis for j in robot.joints}
        if hinges:
            normal, which = ways[hinges[0].name], f'in which {hinges[0].name} turns'
        else:  # guides only: their plane, preferably that of x and y
            if not any(j.kind == 'prismatic' for j in robot.joints):
                raise InputError('there is no revolute joint: this is not a planar machine')
            off = np.abs([*ways.values()]).max(axis=0)
            normal, which = np.eye(3)[2 - int(off[::-1].argmin())], 'along which all others slide'
        across = int(np.abs(normal).argmax())
        self._first, self._second = _PLANES[across]
        self._normal = np.cross(*np.eye(3)[[self._first, self._second]])
        for j in robot.joints:
            off = math.hypot(*np.delete(ways[j.name], across))
            if j.kind != 'revolute':
                off = abs(float(ways[j.name][across]))
            if off > _ALIGNED:
                raise InputError(
                    f'{j.name}: its axis does not fit a plane of two of the axes {which}: only '
                    'planar machines can be imported'
                )
        self._ways = ways

    def blueprint(self) -> Blueprint:
        """The machine."""
        robot = self._robot
        made = Blueprint(robot.title, notes=robot.notes)
        moving = {name: body for name, body in robot.bodies.items() if name != WORLD}
        self._names = names_of(moving, 'links') | {WORLD: GROUND}
        massive = any(body.mass for body in moving.values())
        for name, body in moving.items():
            made.links[self._names[name]] = own = BlueprintLink(
                (*self._flat(body.place), self._angle(body))
            )
            if massive:
                across = body.turn.T @ self._normal
                own.keys = {
                    'mass': f'{body.mass!r} kg',
                    'inertia': f'{float(across @ body.inertia @ across)!r} kg m^2',
                    'cog': made.vector(self._on(body, body.cog)),
                }
        for joint in robot.joints:
            self._join(made, joint)
        for name, factors in robot.ratios.items():
            self._ratio(made, name, self._weights(factors))
        for name, weights in robot.geared.items():
            self._ratio(made, name, weights)
        for name, (factors, *law, side) in robot.twists.items():
            self._twist(made, name, factors, law, side)
        for name, (ends, keys) in robot.springs.items():
            between = []
            for k, (holder, at) in enumerate(ends, 1):
                link, point = self._names[holder], f'{named(name)}_{k}'
                made.links[link].points[point] = self._on(robot.bodies[holder], at)
                between.append(made.reference(link, point))
            made.keys.setdefault('springs', {})[_spring(name)] = {'between': between, **keys}
        if robot.gravity is not None:
            flat = self._flat(robot.gravity)
            made.keys['gravity'] = [f'{x!r} m/s^2' for x in flat]
        for factors, speed in robot.drives:
            self._drive(made, factors, speed)
        return made

    def _flat(self, place: Array) -> Vector2:
        return float(place[self._first]), float(place[self._second])

    def _lies(self, body: RobotBody) -> bool:
        """True if the plane's normal is the same in the body's axes and in the world's."""
        return bool(np.abs(body.turn @ self._normal - self._normal).max() < _ALIGNED)

    def _angle(self, body: RobotBody) -> float:
        """Angle of the frame of a body's link [rad]: its own, or the world's at the start."""
        if not self._lies(body):
            return 0.0
        x, y = self._flat(body.turn[:, self._first])
        return math.atan2(y, x)

    def _on(self, body: RobotBody, point: Array) -> Vector2:
        """A point in the frame of its link."""
        return self._flat(point if self._lies(body) else body.turn @ point)

    def _join(self, made: Blueprint, joint: RobotJoint) -> None:
        bodies = self._robot.bodies
        ends = self._names[joint.parent], self._names[joint.child]
        name = named(joint.name)
        name = '_'.join(ends) if name in made.links else name
        points = (joint.parent, joint.on_parent), (joint.child, joint.on_child)
        for link, (body, at) in zip(ends, points, strict=True):
            made.links[link].points[name] = self._on(bodies[body], at)
        more: dict[str, float] = {}
        if joint.kind == 'slot':  # slot of the child, along its axis; pin of the parent
            x, y = self._flat(joint.axis)
            more = {'axis': math.atan2(y, x)}
        elif joint.kind == 'prismatic':
            x, y = self._flat(self._ways[joint.name])
            one, other = (made.links[link].pose[2] for link in ends)
            more = {'axis': math.atan2(y, x) - one, 'angle': other - one}
        keys: dict[str, Any] = {k: angle(v) for k, v in more.items() if angle(v) != angle(0.0)}
        made.join(name, joint.kind, *((link, name) for link in ends), **keys)

    def _weights(self, factors: Mapping[str, float]) -> dict[str, float]:
        """Factors of angles of bodies in a sum of joint coordinates; empty if a joint slides."""
        joints = {j.name: j for j in self._robot.joints}
        found: dict[str, float] = {}
        for name, factor in factors.items():
            joint = joints.get(name)
            if joint is None or joint.kind != 'revolute':
                return {}
            sign = float(np.sign(self._ways[name] @ self._normal))
            for body, side in ((joint.child, sign), (joint.parent, -sign)):
                found[body] = found.get(body, 0.0) + side * factor
        return found

    def _ratio(self, made: Blueprint, name: str, weights: Mapping[str, float]) -> None:
        """Add a constant sum of angles as a ratio of two of them, relative to their carrier."""
        moving = {b: w for b, w in weights.items() if abs(w) > 1e-12 and b != WORLD}
        carrier = WORLD
        if len(moving) == 3 and abs(sum(moving.values())) < 1e-9:
            parents = {j.parent for j in self._robot.joints}
            carrier = next((b for b in moving if b in parents), WORLD)
        pair = [b for b in moving if b != carrier]
        if len(pair) != 2:
            made.notes.append(f'{name}: left out: it is not a ratio of the angles of two links')
            return
        exact = -moving[pair[0]] / moving[pair[1]]
        ratio = Fraction(exact).limit_denominator(1000)
        if abs(float(ratio) - exact) > 1e-9:
            made.notes.append(f'{name}: its ratio {exact!r} is rounded to {ratio}')
        turned = {b: made.links[self._names[b]].pose[2] for b in (*pair, carrier)}
        first, second = (turned[b] - turned[carrier] for b in pair)
        keys: dict[str, Any] = {
            'ratio': str(ratio),
            'phase': angle(second - float(ratio) * first),
        }
        if carrier != WORLD:
            keys['carrier'] = self._names[carrier]
        made.join(name, 'transmission', *((self._names[b], '') for b in pair), **keys)

    def _twist(
        self,
        made: Blueprint,
        name: str,
        factors: Mapping[str, float],
        law: Sequence[float],
        side: str,
    ) -> None:
        """Add a spring of a sum of joint coordinates: between two links, or along a guide."""
        stiffness, damping, off = law
        weights = {b: w for b, w in self._weights(factors).items() if abs(w) > 1e-12}
        slides = [j for j in self._robot.joints if [j.name] == [*factors] and not weights]
        if slides and slides[0].kind == 'prismatic':
            link, (w,) = self._names[slides[0].child], factors.values()
            guide = next(
                n for n, j in made.joints.items() if j.get('prismatic', '  ')[1][0] == link
            )
            place: dict[str, Any] = {'coordinate': link}
            free = {'free_length': made.length(made.displacement(guide) + off / w)}
            units = 'N/m', 'N s/m'
            side = {'above': 'below', 'below': 'above'}.get(side, '') if w < 0.0 else side
        elif len(weights) == 2 and abs(sum(weights.values())) < 1e-9:
            ends = sorted(weights, key=lambda body: weights[body])
            one, other = (self._names[body] for body in ends)
            w, place = weights[ends[1]], {'between': [one, other]}
            apart = made.links[other].pose[2] - made.links[one].pose[2]
            free = {'free_angle': angle(apart + off / w)}
            units = 'N m/rad', 'N m s/rad'
        else:
            made.notes.append(f'{name}: left out: it is not a spring between two links')
            return
        laws = zip(('stiffness', 'damping'), (stiffness, damping), units, strict=True)
        keys = {key: f'{x * w**2!r} {unit}' for key, x, unit in laws if x}
        made.keys.setdefault('springs', {})[_spring(name)] = {
            **place, **keys, **(free if stiffness else {}), **({'acts': side} if side else {}),
        }  # fmt: skip

    def _drive(self, made: Blueprint, factors: Mapping[str, float], speed: float) -> None:
        """Add a drive by the speed of a sum of joint coordinates: that of a link on the ground."""
        weights = {b: w for b, w in self._weights(factors).items() if w and b != WORLD}
        guide = next((j for j in self._robot.joints if [j.name] == [*factors]), None)
        if len(weights) == 1:
            ((body, weight),) = weights.items()
            start = angle(made.links[self._names[body]].pose[2])
            keys = {'speed': f'{speed / weight!r} rad/s', 'start_angle': start}
        elif guide and guide.kind == 'prismatic':
            body, keys = guide.child, {'speed': f'{speed * factors[guide.name]!r} m/s'}
        else:
            made.notes.append(
                f'the drive of {", ".join(factors)} is left out: it does not drive a single link'
            )
            return
        made.drive(self._names[body], **keys)
