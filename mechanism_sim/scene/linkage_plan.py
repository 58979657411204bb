"""From a linkage that is written out to its plan, refusing what does not fit together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import pairwise

import heyoka as hy

from mechanism_sim.errors import InputError
from mechanism_sim.linkages.forces import AppliedForce, CycleRange, Spring, TorsionSpring
from mechanism_sim.numerics import formula
from mechanism_sim.planar.drive import DriveLaw, Law, TorqueLaw, speed_profile
from mechanism_sim.planar.mechanism import (
    GROUND,
    Body,
    Geneva,
    Joint,
    Mechanism,
    PinInSlot,
    Prismatic,
    Revolute,
    SlottedRack,
    Vector2,
    closing_joints,
)
from mechanism_sim.planar.protocols import ForceElement
from mechanism_sim.scene.files import nearest
from mechanism_sim.scene.linkage import LinkageDrive, LinkageJoint, LinkageScene, LoadPart
from mechanism_sim.scene.plan import Plan, motor_law
from mechanism_sim.units import Measure

_BELONGS = {
    'axis': ('prismatic', 'slot'),
    'angle': ('prismatic',),
    'slots': ('geneva',),
    'pitch': ('rack',),
}
RESERVED = ('t', 'x', 'y', 'vx', 'vy', 'pi', 'now', 'watch', 'step_constant', 'run_time')


def linkage_plan(name: str, scene: LinkageScene) -> Plan:
    """The plan of a scene that names its links and joints.

    Raises
    ------
    InputError
        One sentence: where, what, what is allowed, the nearest.
    """
    return _Reader(name, scene).plan()


class _Reader:
    """Reads one scene; every refusal begins with its name."""

    def __init__(self, name: str, scene: LinkageScene) -> None:
        self._name = name
        self._scene = scene
        for link in scene.links:
            if link != GROUND and (not link.isidentifier() or link in RESERVED):
                raise InputError(
                    f"{name}: links.{link}: the name '{link}' cannot be used; names are letters, "
                    f'digits and _, but not {", ".join(RESERVED)}'
                )
        self._links = [link for link in scene.links if link != GROUND]
        if not self._links:
            raise InputError(f'{name}: links: there is no moving link; add one beside the ground')
        self._points = {link: self._points_of(link) for link in [GROUND, *self._links]}

    def plan(self) -> Plan:
        """All of it."""
        scene = self._scene
        joints = tuple(self._joint(name, j) for name, j in scene.joints.items())
        self._check_connected(joints)
        drives = self._drives()
        loose = {n: j.clearance for n, j in scene.joints.items() if j.clearance}
        straight = [c for c, d in drives.items() if self._is_straight(d)]
        closing = closing_joints(self._links, joints, (), straight)
        massless = Mechanism(tuple(Body(x, 0.0, 0.0, (0.0, 0.0)) for x in self._links),
                             joints, closing)  # fmt: skip
        self._guided = {c: massless.tree_joints[c].name for c in massless.sliding}
        bodies = self._bodies(massless, drives)
        laws: dict[str, tuple[Law, ...]] = {}
        begins: dict[str, tuple[float, float]] = {}
        for c, drive in drives.items():
            laws[c], begins[c] = self._laws(c, drive, massless)
        for name, spring in scene.springs.items():
            self._check_spring(name, spring.between, spring.stiffness, spring.damping)
        for name, load in scene.loads.items():
            self._check_load(name, load, massless)
        loads = [p.at for p in scene.masses.values()]
        return Plan(
            bodies,
            joints,
            closing,
            scene.gravity,
            {n: c for n, c in loose.items() if c},
            laws or {massless.coordinates[0]: (TorqueLaw(massless.coordinates[0]),)},
            begins,
            (
                self._values('initial.position', scene.initial.position, massless, ('rad', 'm')),
                self._values('initial.velocity', scene.initial.velocity, massless,
                             ('rad/s', 'm/s')),
            ),
            self._values('guess', scene.guess, massless, ('rad', 'm')),
            self._points,
            self._elements,
            all(
                link.mass is not None or any(p.split('.')[0] == n for p in loads)
                for n, link in scene.links.items()
                if n != GROUND
            ),
        )  # fmt: skip

    # --- links, points, joints ----------------------------------------------------------------

    def _points_of(self, link: str) -> dict[str, Vector2]:
        given = self._scene.links.get(link)
        points: dict[str, Vector2] = {'start': (0.0, 0.0)}
        if given and given.length is not None:
            points['end'] = (given.length, 0.0)
        if given:
            for name in given.points:
                if name in points:
                    raise InputError(
                        f"{self._name}: links.{link}.points.{name}: '{name}' is the link's "
                        f'{"origin" if name == "start" else "far end"} already; choose another '
                        'name'
                    )
            points |= given.points
        return points

    def _find(self, where: str, reference: str) -> tuple[str, Vector2]:
        """A link and a point in its frame, from ``LINK.POINT`` or ``LINK``."""
        link, _, point = reference.partition('.')
        if link not in self._points:
            raise InputError(
                f"{self._name}: {where}: there is no link '{link}'"
                f'{nearest(link, self._points)}; links: {", ".join(self._points)}'
            )
        points = self._points[link]
        if (point or 'start') not in points:
            raise InputError(
                f"{self._name}: {where}: the link {link} has no point '{point}'"
                f'{nearest(point, points)}; its points: {", ".join(points)}'
            )
        return link, points[point or 'start']

    def _joint(self, name: str, joint: LinkageJoint) -> Joint:
        where = f'joints.{name}'
        if not name.isidentifier():
            raise InputError(
                f"{self._name}: {where}: the name '{name}' cannot be used; names are letters, "
                'digits and _'
            )
        (a, on_a), (b, on_b) = (self._find(f'{where}.{joint.kind}', p) for p in joint.points)
        if a == b:
            raise InputError(
                f'{self._name}: {where}.{joint.kind} ties the link {a} to itself: give points of '
                'two links'
            )
        for key, kinds in _BELONGS.items():
            if getattr(joint, key) and joint.kind not in kinds:
                raise InputError(
                    f'{self._name}: {where}.{key} has no meaning in a {joint.kind} joint'
                )
        if joint.kind == 'revolute':
            return Revolute(name, a, b, on_a, on_b)
        if joint.kind == 'slot':
            return PinInSlot(name, a, b, on_a, on_b, joint.axis)
        if joint.kind == 'geneva':
            return self._geneva(name, joint, (a, on_a), (b, on_b))
        if joint.kind == 'rack':
            return self._rack(name, joint, (a, on_a), (b, on_b))
        return Prismatic(name, a, b, on_a, on_b, joint.axis, joint.angle)

    def _pivot(self, where: str, link: str) -> tuple[Vector2, Vector2]:
        """Where a link turns on the ground, in the world and in its own frame."""
        for name, joint in self._scene.joints.items():
            ends = dict(self._find(f'joints.{name}', p) for p in joint.points)
            if joint.revolute and ends.keys() == {GROUND, link}:
                return ends[GROUND], ends[link]
        raise InputError(
            f'{self._name}: {where}: {link} must turn on the ground: add a revolute joint of both'
        )

    def _geneva(
        self, name: str, joint: LinkageJoint, pin: tuple[str, Vector2], wheel: tuple[str, Vector2]
    ) -> Geneva:
        where = f'joints.{name}'
        if joint.slots is None:
            raise InputError(f"{self._name}: '{where}.slots' is missing: how many the wheel has")
        (ox, oy), on_crank = self._pivot(where, pin[0])
        (wx, wy), on_wheel = self._pivot(where, wheel[0])
        if wheel[1] != on_wheel:
            raise InputError(f'{self._name}: {where}: name the point where the wheel is pivoted')
        radius, b = math.dist(pin[1], on_crank), math.hypot(ox - wx, oy - wy)
        right = radius / math.sin(math.pi / joint.slots)
        if abs(b - right) > 1e-6 * right:
            raise InputError(
                f'{self._name}: {where}: with {joint.slots} slots and the pin {radius:.9g} m from '
                f'its centre, the centres must be {right:.9g} m apart, not {b:.9g} m: else the '
                'pin strikes the slot where it enters'
            )
        entry = right * math.cos(math.pi / joint.slots)
        towards = math.atan2(oy - wy, ox - wx)
        return Geneva(name, pin[0], wheel[0], pin[1], wheel[1], joint.slots, towards, right, entry)

    def _rack(
        self, name: str, joint: LinkageJoint, pin: tuple[str, Vector2], rack: tuple[str, Vector2]
    ) -> SlottedRack:
        where = f'joints.{name}'
        centre, on_crank = self._pivot(where, pin[0])
        guides = [
            j for n, j in self._scene.joints.items()
            if j.prismatic
            and [self._find(f'joints.{n}', p)[0] for p in j.points] == [GROUND, rack[0]]
        ]  # fmt: skip
        if not guides:
            raise InputError(
                f'{self._name}: {where}: {rack[0]} must slide on the ground: add a joint '
                f"'prismatic: [ground, {rack[0]}]'"
            )
        pitch = 2.0 * math.dist(pin[1], on_crank)
        if joint.pitch is None or abs(joint.pitch - pitch) > 1e-6 * pitch:
            raise InputError(
                f"{self._name}: '{where}.pitch' must be twice the radius of the pin's circle, "
                f'{pitch:.9g} m: else the pin strikes the slot where it enters'
            )
        return SlottedRack(name, pin[0], rack[0], pin[1], rack[1], pitch, guides[0].axis, centre)

    def _check_connected(self, joints: Iterable[Joint]) -> None:
        reached, grown = {GROUND}, True
        while grown:
            ends = [{j.first, j.second} for j in joints if {j.first, j.second} & reached]
            grown = not set().union(*ends) <= reached
            reached |= set().union(*ends)
        apart = [link for link in self._links if link not in reached]
        if apart:
            raise InputError(
                f'{self._name}: the link {apart[0]} is not connected to the ground by joints; '
                "add a joint of it under 'joints'"
            )

    def _bodies(self, tree: Mechanism, drives: Mapping[str, LinkageDrive]) -> tuple[Body, ...]:
        found = []
        for name, mass in self._scene.masses.items():
            if self._find(f'masses.{name}.at', mass.at)[0] == GROUND:
                raise InputError(
                    f'{self._name}: masses.{name}.at: a mass on the ground moves nothing'
                )
        for link in self._links:
            given = self._scene.links[link]
            cog = given.cog if isinstance(given.cog, tuple) else (given.cog, 0.0)
            turns = tree.frame(link)[0] != GROUND
            if given.mass is not None and given.inertia is None and turns:
                raise InputError(
                    f"{self._name}: 'links.{link}.inertia' is missing: the link has a mass and "
                    'turns; give its moment of inertia about the centre of gravity (0 for a point '
                    'mass)'
                )
            parts = [(given.mass or 0.0, given.inertia or 0.0, cog)]
            for name, mass in self._scene.masses.items():
                on, at = self._find(f'masses.{name}.at', mass.at)
                if on == link:
                    parts.append((mass.mass, 0.0, at))
            body = _together(link, parts)
            if link in drives:
                body = Body(link, body.mass, body.inertia + drives[link].flywheel, body.cog)
            found.append(body)
        return tuple(found)

    # --- drives -------------------------------------------------------------------------------

    def _drives(self) -> dict[str, LinkageDrive]:
        scene, found = self._scene, {}
        if scene.drive:
            default = 'crank' if 'crank' in self._links else None
            coordinate = scene.drive.coordinate or default
            if coordinate is None:
                raise InputError(
                    f"{self._name}: 'drive.coordinate' is missing: name the driven link; links: "
                    f'{", ".join(self._links)}'
                )
            found[coordinate] = scene.drive
        for coordinate, drive in scene.drives.items():
            if coordinate in found:
                raise InputError(f'{self._name}: drives.{coordinate}: it has a drive already')
            found[coordinate] = drive
        for coordinate in found:
            self._coordinate('drive.coordinate', coordinate)
        return found

    def _coordinate(self, where: str, name: str) -> str:
        if name not in self._links:
            raise InputError(
                f"{self._name}: {where}: there is no coordinate '{name}'"
                f'{nearest(name, self._links)}; coordinates are named after the moving links: '
                f'{", ".join(self._links)}'
            )
        return name

    @staticmethod
    def _is_straight(drive: LinkageDrive) -> bool:
        paces = [drive.speed, *(p for _, p in (drive.profile.points if drive.profile else []))]
        return (
            drive.start_position is not None
            or drive.force is not None
            or any(p is not None and p.unit == 'm/s' for p in paces)
        )

    def _laws(
        self, c: str, drive: LinkageDrive, tree: Mechanism
    ) -> tuple[tuple[Law, ...], tuple[float, float]]:
        where = f'{self._name}: the drive of {c}'
        straight = c in tree.displacements
        ways = [
            w for w in ('profile', 'torque', 'force', 'motor') if getattr(drive, w) is not None
        ]
        if len(ways) > 1:
            raise InputError(f'{where}: {ways[0]} and {ways[1]} exclude each other: keep one')
        if drive.profile and drive.speed is not None:
            raise InputError(
                f'{where}: speed and profile exclude each other: a profile gives every speed, the '
                'first at its first point'
            )
        wrong = {'torque', 'motor', 'start_angle'} if straight else {'force', 'start_position'}
        for key in sorted(wrong):
            if getattr(drive, key) is not None:
                raise InputError(f"{where}: '{key}' does not fit: {c} is {_kind(straight)}")
        start = drive.start_position if straight else drive.start_angle
        start = self._values('initial.position', self._scene.initial.position, tree,
                             ('rad', 'm')).get(c, start)  # fmt: skip
        value = start if start is not None else self._values(
            'guess', self._scene.guess, tree, ('rad', 'm')).get(c, 0.0)  # fmt: skip
        speed = 0.0 if drive.speed is None else self._measure(
            f'the speed of {c}', drive.speed, straight, ('rad/s', 'm/s'))  # fmt: skip
        begin = value, speed
        if drive.torque or drive.force or drive.motor:
            if drive.motor:
                if drive.motor.no_load_speed == 0.0:
                    raise InputError(f'{where}: motor.no_load_speed must not be zero')
                return (motor_law(c, drive.motor.stall_torque, drive.motor.no_load_speed),), begin
            f, t = drive.force, drive.torque
            if f:
                return (TorqueLaw(c, (f.constant, f.per_position, f.per_speed)),), begin
            assert t is not None  # noqa: S101 - one of the three is there
            return (TorqueLaw(c, (t.constant, t.per_angle, t.per_speed)),), begin
        if drive.profile:
            times = [t for t, _ in drive.profile.points]
            for before, after in pairwise(times):
                if after <= before:
                    raise InputError(
                        f'{where}: profile.points: times must rise, but {after:g} s follows '
                        f'{before:g} s'
                    )
            points = [
                (t, self._measure(f'a speed of {c}', p, straight, ('rad/s', 'm/s')))
                for t, p in drive.profile.points
            ]
            laws = speed_profile(c, value, points, drive.profile.ramp == 'smooth', straight)
            return tuple(laws), (value, points[0][1])
        if drive.speed is None:
            raise InputError(
                f"{where}: 'speed' is missing: a speed, a profile, a torque, a force or a motor "
                'moves it'
            )
        return (DriveLaw(c, (value, speed), straight=straight),), begin

    # --- values -------------------------------------------------------------------------------

    def _values(
        self, where: str, given: Mapping[str, Measure], tree: Mechanism, units: tuple[str, str]
    ) -> dict[str, float]:
        return {
            self._coordinate(where, c): self._measure(
                f'{where}.{c}', m, c in tree.displacements, units
            )
            for c, m in given.items()
        }

    def _measure(
        self, where: str, measure: Measure, straight: bool, units: tuple[str, str]
    ) -> float:
        wanted = units[straight]
        if measure.unit not in ('', wanted):
            raise InputError(
                f'{self._name}: {where} is given in {measure.unit}, but it is {_kind(straight)}, '
                f'in {wanted}'
            )
        if not math.isfinite(measure.value):
            raise InputError(f'{self._name}: {where} must be finite')
        return measure.value

    # --- forces -------------------------------------------------------------------------------

    def _check_spring(
        self, name: str, between: list[str], stiffness: Measure, damping: Measure
    ) -> None:
        ends = [self._find(f'springs.{name}.between', p)[0] for p in between]
        if ends[0] == ends[1]:
            raise InputError(f'{self._name}: springs.{name}.between names one link twice')
        kinds = {m.unit.endswith('rad') for m in (stiffness, damping) if m.unit}
        if len(kinds) != 1:
            raise InputError(
                f'{self._name}: springs.{name}: give stiffness and damping both per length '
                "('200 N/m', '5 N s/m') or both per angle ('3 N m/rad', '0.1 N m s/rad')"
            )
        spring = self._scene.springs[name]
        if kinds == {True} and spring.free_length is not None:
            raise InputError(f'{self._name}: springs.{name}: a torsion spring has a free_angle')
        if kinds == {False} and spring.free_angle is not None:
            raise InputError(f'{self._name}: springs.{name}: a straight spring has a free_length')
        if min(stiffness.value, damping.value) < 0.0:
            raise InputError(
                f'{self._name}: springs.{name}: stiffness and damping cannot be negative'
            )

    def _check_load(self, name: str, load: LoadPart, tree: Mechanism) -> None:
        where = f'loads.{name}'
        self._find(f'{where}.at', load.at)
        known = {'t', 'x', 'y', 'vx', 'vy', *self._links, *(f'{x}_rate' for x in self._links)}
        symbols = {x: hy.expression(x) for x in known}
        for part in (*load.force, load.torque):
            if isinstance(part, str):
                for used in formula.names(part) - known:
                    raise InputError(
                        f"{self._name}: {where}: the formula '{part}' names '{used}'"
                        f'{nearest(used, known)}; it may name t, x, y, vx, vy, a link, or '
                        'LINK_rate'
                    )
                try:
                    formula.expression(part, symbols)
                except ValueError as error:
                    raise InputError(f'{self._name}: {where}: {error}') from error
        if load.during:
            c = self._coordinate(f'{where}.during.coordinate', load.during.coordinate)
            if tree.frame(c) != (c, 0.0):
                raise InputError(
                    f'{self._name}: {where}.during.coordinate: {c} is a displacement; a range is '
                    'one of angles'
                )
            if abs(math.remainder(load.during.end - load.during.begin, 2.0 * math.pi)) < 1e-9:
                raise InputError(
                    f"{self._name}: {where}.during: 'from' and 'to' are the same direction; for a "
                    "load that acts in the whole cycle leave out 'during'"
                )

    def _elements(self, mechanism: Mechanism) -> list[ForceElement]:
        found: list[ForceElement] = []
        for name, s in self._scene.springs.items():
            a, b = (self._find(f'springs.{name}.between', p) for p in s.between)
            if (s.stiffness.unit or s.damping.unit).endswith('rad'):
                found.append(
                    TorsionSpring(f'springs.{name}', mechanism, a[0], b[0], s.stiffness.value,
                                  s.free_angle or 0.0, s.damping.value)
                )  # fmt: skip
            else:
                found.append(
                    Spring(f'springs.{name}', mechanism, a, b, s.stiffness.value,
                           s.free_length or 0.0, s.damping.value)
                )  # fmt: skip
        for name, load in self._scene.loads.items():
            during = None
            if load.during:
                d = load.during
                during = CycleRange(d.coordinate, d.begin, d.end)
            found.append(
                AppliedForce(
                    f'loads.{name}', mechanism, self._find(f'loads.{name}.at', load.at),
                    load.force, load.torque, load.frame == 'link', during, self._guided,
                )
            )  # fmt: skip
        return found


def _together(link: str, parts: Iterable[tuple[float, float, Vector2]]) -> Body:
    """One rigid body of several masses, by the parallel axis theorem."""
    parts = list(parts)
    mass = sum(m for m, _, _ in parts)
    if len(parts) == 1 or not mass:
        m, inertia, cog = parts[0]
        return Body(link, m, inertia, cog)
    x, y = (sum(m * at[k] for m, _, at in parts) / mass for k in (0, 1))
    inertia = sum(i + m * ((at[0] - x) ** 2 + (at[1] - y) ** 2) for m, i, at in parts)
    return Body(link, mass, inertia, (x, y))


def _kind(straight: bool) -> str:
    return 'a displacement' if straight else 'an angle'
