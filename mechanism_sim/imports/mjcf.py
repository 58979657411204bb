"""MJCF of planar machines: bodies in a tree, loops by `connect`, ratios by `joint` and tendons."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.imports.blueprint import Blueprint
from mechanism_sim.imports.markup import by_quaternion, number, numbers, parse, rotation
from mechanism_sim.imports.robot import WORLD, Robot, RobotBody, RobotJoint, add_mass

_DEEPEST = 200  # depth of nested bodies
_KINDS = {'hinge': 'revolute', 'slide': 'prismatic'}
_MADE = 'attach', 'composite', 'flexcomp', 'replicate'  # elements that MuJoCo expands to bodies
_UNREAD = 'balanceinertia', 'boundinertia', 'boundmass', 'coordinate', 'inertiagrouprange'

_Defaults = dict[str, dict[str, str]]  # attributes by kind of element


class _Held(NamedTuple):
    """Class of default values, and pose, of elements in a body or in a frame of it."""

    childclass: str
    turn: Array = np.eye(3)
    at: Array = np.zeros(3)


def read(path: Path, text: str, _unit: str | None) -> Blueprint:
    """The machine of an MJCF file, in metres."""
    root = parse(path.name, text, 'mujoco')
    return _MjcfReader(root, path.stem).robot.blueprint()


class _MjcfReader:
    """Reader of a file."""

    def __init__(self, root: Element, name: str) -> None:
        self._root, self.robot = root, Robot(root.get('model') or name)
        compiler, option = self._section('compiler'), self._section('option')
        self._scale = 1.0 if compiler.get('angle') == 'radian' else math.pi / 180.0
        self._order = compiler.get('eulerseq', 'xyz')
        self._weighed = compiler.get('inertiafromgeom', 'auto')
        self._classes: dict[str, _Defaults] = {'': {}}
        for default in root.findall('default'):
            self._classes[''] = self._define(default, self._classes[''])
        self._sites: dict[str, tuple[str, Array]] = {}
        self._moving: dict[str, float] = {}  # `ref` by joint, in the order of MuJoCo
        self._joints: dict[str, dict[str, str]] = {}
        self._tendons = {
            t.get('name'): {str(j.get('joint')): number(j.get('coef')) for j in t.findall('joint')}
            for t in root.findall('tendon/fixed')
        }
        still = root.find('option/flag[@gravity="disable"]') is not None
        self.robot.gravity = numbers('0 0 0' if still else option.get('gravity', '0 0 -9.81'), 3)
        if root.find('worldbody') is None:
            raise InputError('the file has no worldbody')
        for world in root.findall('worldbody'):
            self._bodies(world, WORLD, '', 0)
        total = number(compiler.get('settotalmass'), -1.0)
        # total mass of all bodies; values that are not positive have no effect
        mass = sum(body.mass for body in self.robot.bodies.values())
        for body in self.robot.bodies.values() if total > 0.0 < mass else ():
            body.mass, body.inertia = body.mass * total / mass, body.inertia * (total / mass)
        tree = [*self.robot.joints]
        self._loops()
        self._springs(self._start(tree))
        self._drives()
        self._tell(compiler)

    def _section(self, tag: str) -> dict[str, str]:
        """Attributes of a section, which may be repeated."""
        return {k: v for part in self._root.findall(tag) for k, v in part.attrib.items()}

    def _define(self, default: Element, above: _Defaults) -> _Defaults:
        """Attributes of a class by kind of element, nested classes included."""
        own = {x.tag: {**above.get(x.tag, {}), **x.attrib} for x in default}
        found = self._classes[default.get('class', 'main')] = above | own
        for nested in default.findall('default'):
            self._define(nested, found)
        return found

    def _given(self, element: Element, childclass: str = '', kind: str = '') -> dict[str, str]:
        """Attributes of an element, with defaults of its class or of the nearest `childclass`.

        Parameters
        ----------
        kind : kind of its default values, if not its tag
        """
        name = element.get('class', childclass)
        if name not in self._classes:
            raise InputError(f"there is no default class '{name}'")
        return {**self._classes[name].get(kind or element.tag, {}), **element.attrib}

    def _parts(self, element: Element, held: _Held) -> Iterator[tuple[Element, _Held]]:
        """Elements of a body, with class and pose of their `frame`."""
        for child in element:
            if child.tag == 'frame':
                yield from self._parts(child, self._placed(child.attrib, held, child))
            else:
                yield child, held

    def _placed(
        self, given: Mapping[str, str], held: _Held, element: Element | None = None
    ) -> _Held:
        """Pose of a part of a body with the given pose."""
        childclass = held.childclass if element is None else element.get('childclass')
        at = held.at + held.turn @ numbers(given.get('pos'), 3)
        return _Held(childclass or held.childclass, held.turn @ self._turn(given), at)

    def _bodies(self, element: Element, parent: str, childclass: str, depth: int) -> None:
        """Child bodies, with the joints that carry them."""
        if depth > _DEEPEST:
            raise InputError(f'bodies nested more than {_DEEPEST} deep')
        robot, count = self.robot, 0
        for part, held in self._parts(element, _Held(childclass)):
            if part.tag == 'site':
                place = self._placed(self._given(part, held.childclass), held)
                self._sites[str(part.get('name'))] = parent, place.at
            elif part.tag in _MADE:
                robot.notes.append(f'{part.get("name") or part.tag}: left out: <{part.tag}>')
            elif part.tag == 'body':
                count += 1
                name = part.get('name') or f'{parent}_{count}'
                above, own = robot.bodies[parent], self._placed(part.attrib, held, part)
                made = robot.bodies[name] = self._body(part, name, own.childclass)
                made.place, made.turn = above.world(own.at), above.turn @ own.turn
                self._carry(part, parent, made, own.childclass)
                self._bodies(part, name, own.childclass, depth + 1)

    def _carry(self, body: Element, parent: str, made: RobotBody, childclass: str) -> None:
        """Joints of a body, with frames between several; none for a free body."""
        parts = self._parts(body, _Held(childclass))
        found = [
            ({'type': 'free'} if x.tag == 'freejoint' else self._given(x, held.childclass), held)
            for x, held in parts
            if x.tag in ('joint', 'freejoint')
        ]
        if any(given.get('type') == 'free' for given, _ in found):
            self._moving[made.name] = math.nan
            return
        robot, holder = self.robot, parent
        if not found:
            above = robot.bodies[parent]
            at, turn = above.local(made.place), above.turn.T @ made.turn
            robot.joints.append(
                RobotJoint(made.name, 'fixed', parent, made.name, at, np.zeros(3), _Z, turn)
            )
        for k, (joint, held) in enumerate(found):
            kind = _KINDS.get(joint.get('type', 'hinge'))
            name = joint.get('name') or f'{made.name}_joint{k + 1}'
            if kind is None:
                raise InputError(f'{name}: joints of type {joint.get("type")} are not planar ones')
            last = k == len(found) - 1
            child = made.name if last else f'{made.name}.{k + 1}'
            if not last:
                robot.bodies[child] = RobotBody(child, made.turn, made.place, frame=True)
            at = held.at + held.turn @ numbers(joint.get('pos'), 3)
            axis = held.turn @ numbers(joint.get('axis') or '0 0 1', 3)
            axis = axis / (np.linalg.norm(axis) or 1.0)
            ref = number(joint.get('ref')) * (self._scale if kind == 'revolute' else 1.0)
            # the coordinate of a slide equals `ref` at the start
            back = axis * ref if kind == 'prismatic' else 0.0
            there = robot.bodies[holder].local(made.world(at - back))
            robot.joints.append(RobotJoint(name, kind, holder, child, there, at, axis))
            self._moving[name], self._joints[name] = ref, joint
            holder = child

    def _body(self, body: Element, name: str, childclass: str) -> RobotBody:
        made = RobotBody(name)
        if number(body.get('gravcomp')):
            self.robot.notes.append(f'{name}: left out: gravcomp, a force against its weight')
        inertial = body.find('inertial')
        if self._weighed == 'true' or (inertial is None and self._weighed != 'false'):
            for part, held in self._parts(body, _Held(childclass)):
                if part.tag == 'geom':
                    self._weigh(self._given(part, held.childclass), made, held)
        elif inertial is not None:
            made.mass, made.cog = number(inertial.get('mass')), numbers(inertial.get('pos'), 3)
            if (full := inertial.get('fullinertia')) is not None:
                xx, yy, zz, xy, xz, yz = numbers(full, 6)
                made.inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            else:
                made.inertia = np.diag(numbers(inertial.get('diaginertia'), 3))
            turn = self._turn(inertial)
            made.inertia = turn @ made.inertia @ turn.T
        return made

    def _weigh(self, geom: Mapping[str, str], body: RobotBody, held: _Held) -> None:
        """Add the mass of a shape to a body, as MuJoCo does for bodies without `inertial`."""
        kind, sizes = geom.get('type', 'sphere'), (geom.get('size') or '').split()
        r, half, third = (number(sizes[k]) if k < len(sizes) else 0.0 for k in (0, 1, 2))
        if kind in ('plane', 'hfield'):
            return  # without mass
        if 'fromto' in geom:
            ends = numbers(geom['fromto'], 6).reshape(2, 3)
            way = ends[1] - ends[0]
            half = 0.5 * float(np.linalg.norm(way))
            half, third = (r, half) if kind in ('box', 'ellipsoid') else (half, third)
            turn, at = held.turn @ _upright(way), held.at + held.turn @ ends.mean(axis=0)
        else:
            _, turn, at = self._placed(geom, held)
        if kind in ('box', 'ellipsoid'):
            share, part = (8.0, 3.0) if kind == 'box' else (4.0 / 3.0 * math.pi, 5.0)
            x, y, z = r, half, third
            volume = share * x * y * z
            i = np.array([y * y + z * z, x * x + z * z, x * x + y * y]) / part
        elif kind in ('sphere', 'capsule', 'cylinder'):
            half = 0.0 if kind == 'sphere' else half
            tube, ball = 2.0 * math.pi * r * r * half, 4.0 / 3.0 * math.pi * r**3
            ball = 0.0 if kind == 'cylinder' else ball
            volume, along = tube + ball, 0.5 * tube * r * r + 0.4 * ball * r * r
            across = tube * (r * r / 4.0 + half * half / 3.0) + ball * (
                0.4 * r * r + half * half + 0.75 * half * r
            )
            i = np.array([across, across, along]) / (volume or 1.0)
        else:
            mass = f'its mass of {geom["mass"]} kg' if 'mass' in geom else 'the mass'
            self.robot.notes.append(f'{body.name}: {mass} is left out: a shape of type {kind}')
            return
        if not volume > 0.0:
            raise InputError(f'{body.name}: a shape of type {kind} has no size')
        if geom.get('shellinertia') == 'true':
            self.robot.notes.append(f'{body.name}: a shell is weighed as if it were solid')
        given = number(geom.get('mass'), volume * number(geom.get('density'), 1000.0))
        add_mass(body, RobotBody('', mass=given, inertia=given * np.diag(i)), turn, at)

    def _turn(self, element: Element | Mapping[str, str]) -> Array:
        """Rotation (3, 3) of an element, from any of its attributes for it."""
        if (quat := element.get('quat')) is not None:
            w, x, y, z = numbers(quat, 4).tolist()
            return by_quaternion(x, y, z, w)
        if (given := element.get('axisangle')) is not None:
            *axis, angle = numbers(given, 4)
            return rotation(np.array(axis), self._scale * angle)
        if (given := element.get('xyaxes')) is not None:
            x, y = numbers(given, 6).reshape(2, 3)
            if not np.cross(x, y).any():
                raise InputError(f"xyaxes '{given}' are not two directions")
            x = x / np.linalg.norm(x)
            y = y - (x @ y) * x
            y = y / np.linalg.norm(y)
            return np.column_stack([x, y, np.cross(x, y)])
        if (given := element.get('zaxis')) is not None:
            return _upright(numbers(given, 3))
        found = np.eye(3)
        for letter, angle in zip(self._order, numbers(element.get('euler'), 3), strict=False):
            step = rotation(np.eye(3)['xyz'.index(letter.lower())], self._scale * float(angle))
            found = found @ step if letter.islower() else step @ found
        return found

    def _start(self, tree: Sequence[RobotJoint]) -> dict[str, float]:
        """Coordinates of all joints at the start, from the first keyframe."""
        key, start = self._root.find('keyframe/key'), self._moving
        if key is None or not key.get('qpos'):
            return start
        if any(map(math.isnan, start.values())):
            self.robot.notes.append('positions of the keyframe are left out: a body is free')
            return start
        given = numbers(key.get('qpos'), len(start)).tolist()
        bodies, values = self.robot.bodies, dict(zip(start, given, strict=True))
        for joint in tree:
            if not (by := values.get(joint.name, 0.0) - start.get(joint.name, 0.0)):
                continue
            child, carried = bodies[joint.child], [joint.child]
            for other in tree:  # bodies come before their children
                carried += [other.child] if other.parent in carried else []
            way, pin = child.turn @ joint.axis, child.world(joint.on_child)
            turns = joint.kind == 'revolute'
            turn, to = (rotation(way, by), pin) if turns else (np.eye(3), pin + by * way)
            for body in [bodies[name] for name in carried]:
                body.turn, body.place = turn @ body.turn, to + turn @ (body.place - pin)
        return values

    def _loops(self) -> None:
        robot = self.robot
        for k, element in enumerate(self._root.findall('equality/*')):
            name = element.get('name') or f'{element.tag}_{k + 1}'
            held = self._given(element, kind='equality')
            if held.get('active') == 'false':
                robot.notes.append(f'{name}: left out: an equality that is not active')
            elif element.tag == 'connect':
                (one, at), (other, there) = self._ends(held)
                robot.joints.append(RobotJoint(name, 'revolute', one, other, at, there, _NO_AXIS))
            elif terms := self._sums(element.tag, held):
                self._hold(name, terms, numbers(held.get('polycoef') or '0 1 0 0 0', 5).tolist())
            else:
                robot.notes.append(f'{name}: left out: an equality of {element.tag}')

    def _sums(self, kind: str, held: Mapping[str, str]) -> list[dict[str, float]]:
        """Two sums of joint coordinates, the first constrained to a function of the second.

        The second is empty if the first is constant; the list is empty for other equalities.
        """
        ends = [held.get(f'{kind}{k}') for k in (1, 2)]
        if kind == 'joint' and all(ends):
            return [{str(end): 1.0} for end in ends]
        if kind == 'tendon' and ends[0] in self._tendons and ends[1] in (None, *self._tendons):
            return [self._tendons.get(end, {}) for end in ends]
        return []

    def _hold(self, name: str, terms: list[dict[str, float]], coefficients: list[float]) -> None:
        """Constrain the first sum to a linear polynomial of the second."""
        constant, factor, *curved = coefficients
        one, other = terms
        if other and any(curved):
            self.robot.notes.append(f'{name}: left out: a ratio that is a polynomial')
            return
        if constant:
            self.robot.notes.append(
                f'{name}: its constant {constant!r} is left out: it holds what is at the start'
            )
        both = dict(one)
        for joint, coefficient in other.items():
            both[joint] = both.get(joint, 0.0) - factor * coefficient
        self.robot.ratios[name] = both

    def _ends(self, held: Mapping[str, str]) -> Iterator[tuple[str, Array]]:
        """The bodies that a `connect` joins, with its point on each."""
        if held.get('site1'):
            yield self._sites[str(held.get('site1'))]
            yield self._sites[str(held.get('site2'))]
            return
        one, other = str(held.get('body1')), held.get('body2', WORLD)
        at = numbers(held.get('anchor'), 3)
        yield one, at
        yield other, self.robot.bodies[other].local(self.robot.bodies[one].world(at))

    def _springs(self, start: Mapping[str, float]) -> None:
        """Springs and dampers of joints, and of tendons."""
        for name, joint in self._joints.items():
            law = number(joint.get('stiffness')), number(joint.get('damping'))
            free = number(joint.get('springref'))
            free *= self._scale if joint.get('type', 'hinge') == 'hinge' else 1.0
            self.robot.resist(name, *law, free - start[name])
        for tendon in self._root.findall('tendon/*'):
            given = self._given(tendon, kind='tendon')
            name, length = str(given.get('name')), given.get('springlength') or '-1'
            stiffness, damping = (number(given.get(x)) for x in ('stiffness', 'damping'))
            low, *more = numbers(length, min(len(length.split()), 2)).tolist()
            sites = [self._sites.get(str(x.get('site'))) for x in tendon.findall('site')]
            ends, acts = [end for end in sites if end], bool(stiffness or damping)
            if tendon.tag == 'spatial' and not (acts and len(ends) == 2):
                self.robot.notes.append(
                    f'{name}: left out: a tendon that is not a spring between two sites'
                )
            elif stiffness and {low, *more} == {-1.0}:
                self.robot.notes.append(f'{name}: left out: a spring without springlength')
            elif tendon.tag == 'spatial':
                for part, k, d, free, side in _laws(name, stiffness, damping, low, more):
                    keys = {
                        'stiffness': f'{k!r} N/m', 'free_length': f'{max(free, 0.0)!r} m',
                        'damping': f'{d!r} N s/m',
                    }  # fmt: skip
                    if not (side == 'below' and free <= 0.0):  # lengths are not negative
                        self.robot.springs[part] = [*ends], keys | ({'acts': side} if side else {})
            elif acts:
                factors = self._tendons[tendon.get('name')]
                now = sum(f * start.get(joint, 0.0) for joint, f in factors.items())
                for part, k, d, free, side in _laws(name, stiffness, damping, low, more):
                    self.robot.twists[part] = factors, k, d, free - now, side

    def _drives(self) -> None:
        """Speed actuators, with controls of the first keyframe."""
        key = self._root.find('keyframe/key')
        control = (key.get('ctrl') if key is not None else None) or ''
        values = [number(x) for x in control.split()]
        for k, actuator in enumerate(self._root.findall('actuator/*')):
            given = self._given(actuator)
            joint, name = given.get('joint'), given.get('name') or actuator.tag
            factors = {joint: 1.0} if joint else self._tendons.get(given.get('tendon'), {})
            gear = number((given.get('gear') or '1').split()[0])
            if actuator.tag == 'velocity' and factors and k < len(values) and gear:
                self.robot.drives.append((factors, values[k] / gear))
            else:
                self.robot.notes.append(f'{name}: left out: an actuator of {actuator.tag}')

    def _tell(self, compiler: Mapping[str, str]) -> None:
        """Note further contents of the file that a scene cannot have."""
        robot = self.robot
        robot.notes += [
            f'{x.get("file")}: left out: an included file' for x in self._root.iter('include')
        ]
        robot.notes += [f'{key} of the compiler is left out' for key in _UNREAD if key in compiler]
        medium = [x for x in ('density', 'viscosity') if number(self._section('option').get(x))]
        robot.notes += [f'{key} of the medium is left out' for key in medium]
        driven = {joint for factors, _ in robot.drives for joint in factors}
        for name, joint in self._joints.items():
            robot.leave_out(
                name,
                limits='range' in joint and joint.get('limited') != 'false',
                friction=number(joint.get('frictionloss')) > 0.0,
                armature=number(joint.get('armature')) > 0.0 and name not in driven,
                springdamper=bool(numbers(joint.get('springdamper'), 2).all()),
            )
        for tendon in self._root.findall('tendon/*'):
            given = self._given(tendon, kind='tendon')
            robot.leave_out(
                str(tendon.get('name')),
                limits='range' in given and given.get('limited') != 'false',
                friction=number(given.get('frictionloss')) > 0.0,
            )
        key = self._root.find('keyframe/key')
        rates = (key.get('qvel') if key is not None else None) or ''
        if rates.strip(' 0.') and not driven:
            robot.notes.append('rates of the keyframe are left out: see `initial`')


def _laws(
    name: str, stiffness: float, damping: float, low: float, high: Sequence[float]
) -> Iterator[tuple[str, float, float, float, str]]:
    """Springs and dampers of a tendon: name, stiffness, damping, free length, acting side.

    Between two different lengths only the damper has a force.
    """
    if not stiffness or [low] * len(high) == [*high]:
        yield name, stiffness, damping, low, ''
        return
    if damping:
        yield name, 0.0, damping, 0.0, ''
    yield f'{name}_shorter', stiffness, 0.0, low, 'below'
    yield f'{name}_longer', stiffness, 0.0, high[0], 'above'


def _upright(way: Array) -> Array:
    """The smallest rotation (3, 3) of the z axis to a direction."""
    axis = np.cross(_Z, way)
    size = float(np.linalg.norm(axis))
    return rotation(axis if size else np.eye(3)[0], math.atan2(size, way[2]))


_Z, _NO_AXIS = np.array([0.0, 0.0, 1.0]), np.zeros(3)
