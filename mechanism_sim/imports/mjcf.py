"""MJCF of planar machines: bodies in a tree, loops by `connect`, ratios by `joint` and tendons."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.imports.blueprint import Blueprint
from mechanism_sim.imports.markup import number, numbers, parse, rotation
from mechanism_sim.imports.robot import WORLD, Robot, RobotBody, RobotJoint, add_mass

_DEEPEST = 200  # bodies in bodies
_KINDS = {'hinge': 'revolute', 'slide': 'prismatic'}


def read(path: Path, text: str, _unit: str | None) -> Blueprint:
    """The machine of an MJCF, which is in metres."""
    root = parse(path.name, text, 'mujoco')
    return _MjcfReader(root, path.stem).robot.blueprint()


class _MjcfReader:
    """Reads one file."""

    def __init__(self, root: Element, name: str) -> None:
        self._root, self.robot = root, Robot(root.get('model') or name)
        compiler = root.find('compiler')
        given = compiler.attrib if compiler is not None else {}
        self._scale = 1.0 if given.get('angle') == 'radian' else math.pi / 180.0
        self._order = given.get('eulerseq', 'xyz')
        default = root.find('default/joint')
        self._joint = dict(default.attrib) if default is not None else {}
        default = root.find('default/geom')
        self._geom = dict(default.attrib) if default is not None else {}
        self._sites: dict[str, tuple[str, Array]] = {}
        self._tendons = {
            t.get('name'): {str(j.get('joint')): number(j.get('coef')) for j in t.findall('joint')}
            for t in root.findall('tendon/fixed')
        }
        option = root.find('option')
        gravity = option.get('gravity') if option is not None else None
        self.robot.gravity = numbers(gravity or '0 0 -9.81', 3)
        world = root.find('worldbody')
        if world is None:
            raise InputError('the file has no worldbody')
        self._bodies(world, WORLD, 0)
        self._loops()
        self._springs()
        self._drives()

    def _bodies(self, element: Element, parent: str, depth: int) -> None:
        """Bodies below one, with what carries them."""
        if depth > _DEEPEST:
            raise InputError(f'bodies nested more than {_DEEPEST} deep')
        robot = self.robot
        for site in element.findall('site'):
            self._sites[str(site.get('name'))] = parent, numbers(site.get('pos'), 3)
        for k, body in enumerate(element.findall('body')):
            name = body.get('name') or f'{parent}_{k + 1}'
            above = robot.bodies[parent]
            made = robot.bodies[name] = self._body(body, name)
            made.place = above.world(numbers(body.get('pos'), 3))
            made.turn = above.turn @ self._turn(body)
            self._carry(body, parent, made)
            self._bodies(body, name, depth + 1)

    def _carry(self, body: Element, parent: str, made: RobotBody) -> None:
        """Joints of a body, with frames between several; none of a free one."""
        joints = [{**self._joint, **j.attrib} for j in body.findall('joint')]
        if body.find('freejoint') is not None or any(j.get('type') == 'free' for j in joints):
            return
        robot, holder = self.robot, parent
        if not joints:
            above = robot.bodies[parent]
            at, turn = above.local(made.place), above.turn.T @ made.turn
            robot.joints.append(
                RobotJoint(made.name, 'fixed', parent, made.name, at, np.zeros(3), _Z, turn)
            )
        for k, joint in enumerate(joints):
            kind = _KINDS.get(joint.get('type', 'hinge'))
            name = joint.get('name') or f'{made.name}_joint{k + 1}'
            if kind is None:
                raise InputError(f'{name}: joints of type {joint.get("type")} are not planar ones')
            last = k == len(joints) - 1
            child = made.name if last else f'{made.name}.{k + 1}'
            if not last:
                robot.bodies[child] = RobotBody(child, made.turn, made.place, frame=True)
            at, axis = numbers(joint.get('pos'), 3), numbers(joint.get('axis') or '0 0 1', 3)
            axis = axis / (np.linalg.norm(axis) or 1.0)
            # the coordinate of a slide is `ref` at the start
            back = axis * number(joint.get('ref')) if kind == 'prismatic' else 0.0
            there = robot.bodies[holder].local(made.world(at - back))
            robot.joints.append(RobotJoint(name, kind, holder, child, there, at, axis))
            holder = child

    def _body(self, body: Element, name: str) -> RobotBody:
        made = RobotBody(name)
        inertial = body.find('inertial')
        if inertial is None:
            for geom in body.findall('geom'):
                self._weigh({**self._geom, **geom.attrib}, made)
            return made
        made.mass, made.cog = number(inertial.get('mass')), numbers(inertial.get('pos'), 3)
        if (full := inertial.get('fullinertia')) is not None:
            xx, yy, zz, xy, xz, yz = numbers(full, 6)
            made.inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            made.inertia = np.diag(numbers(inertial.get('diaginertia'), 3))
        turn = self._turn(inertial)
        made.inertia = turn @ made.inertia @ turn.T
        return made

    def _weigh(self, geom: Mapping[str, str], body: RobotBody) -> None:
        """Add a shape to what a body weighs, as MuJoCo does where no `inertial` says it."""
        kind, sizes = geom.get('type', 'sphere'), (geom.get('size') or '').split()
        r, half = (number(sizes[k]) if k < len(sizes) else 0.0 for k in (0, 1))
        at, turn = numbers(geom.get('pos'), 3), self._turn(geom)
        if 'fromto' in geom:
            ends = numbers(geom['fromto'], 6).reshape(2, 3)
            at, way = ends.mean(axis=0), ends[1] - ends[0]
            half, axis = 0.5 * float(np.linalg.norm(way)), np.cross(_Z, way)
            turn = (
                rotation(axis, math.atan2(float(np.linalg.norm(axis)), way[2]))
                if axis.any()
                else turn
            )
        if kind == 'box':
            x, y, z = [r, half, number(sizes[2])] if 'fromto' not in geom else [r, r, half]
            volume, i = (
                8.0 * x * y * z,
                np.array([y * y + z * z, x * x + z * z, x * x + y * y]) / 3.0,
            )
        elif kind in ('sphere', 'capsule', 'cylinder'):
            half = 0.0 if kind == 'sphere' else half
            tube, ball = 2.0 * math.pi * r * r * half, 4.0 / 3.0 * math.pi * r**3
            ball = 0.0 if kind == 'cylinder' else ball
            volume, along = tube + ball, 0.5 * tube * r * r + 0.4 * ball * r * r
            across = tube * (r * r / 4.0 + half * half / 3.0) + ball * (
                0.4 * r * r + half * half + 0.75 * half * r
            )
            i = np.array([across, across, along]) / volume
        else:
            self.robot.notes.append(f'{body.name}: no mass is computed for type {kind}')
            return
        mass = number(geom.get('mass'), volume * number(geom.get('density'), 1000.0))
        add_mass(body, RobotBody('', mass=mass, inertia=mass * np.diag(i)), turn, at)

    def _turn(self, element: Element | Mapping[str, str]) -> Array:
        """Rotation (3, 3) of an element, by whichever attribute says it."""
        if (quat := element.get('quat')) is not None:
            w, *xyz = numbers(quat, 4)
            return rotation(np.array(xyz), 2.0 * math.atan2(float(np.linalg.norm(xyz)), w))
        if (given := element.get('axisangle')) is not None:
            *axis, angle = numbers(given, 4)
            return rotation(np.array(axis), self._scale * angle)
        found = np.eye(3)
        for letter, angle in zip(self._order, numbers(element.get('euler'), 3), strict=False):
            step = rotation(np.eye(3)['xyz'.index(letter.lower())], self._scale * float(angle))
            found = found @ step if letter.islower() else step @ found
        return found

    def _loops(self) -> None:
        robot = self.robot
        for k, held in enumerate(self._root.findall('equality/*')):
            name = held.get('name') or f'{held.tag}_{k + 1}'
            if held.tag == 'connect':
                (one, at), (other, there) = self._ends(held)
                robot.joints.append(RobotJoint(name, 'revolute', one, other, at, there, _NO_AXIS))
            elif held.tag == 'joint' and held.get('joint2'):
                factor = numbers(held.get('polycoef') or '0 1 0 0 0', 5)[1]
                pair = {str(held.get('joint1')): 1.0, str(held.get('joint2')): -float(factor)}
                robot.ratios[name] = pair
            elif held.tag == 'tendon' and held.get('tendon1') in self._tendons:
                robot.ratios[name] = self._tendons[held.get('tendon1')]
            else:
                robot.notes.append(f'{name}: left out: an equality of {held.tag}')

    def _ends(self, held: Element) -> Iterator[tuple[str, Array]]:
        """The bodies that a `connect` holds together, and where on each."""
        if held.get('site1'):
            yield self._sites[str(held.get('site1'))]
            yield self._sites[str(held.get('site2'))]
            return
        one, other = str(held.get('body1')), held.get('body2', WORLD)
        at = numbers(held.get('anchor'), 3)
        yield one, at
        yield other, self.robot.bodies[other].local(self.robot.bodies[one].world(at))

    def _springs(self) -> None:
        for tendon in self._root.findall('tendon/spatial'):
            sites = [self._sites.get(str(x.get('site'))) for x in tendon.findall('site')]
            ends = [end for end in sites if end]
            name, length = str(tendon.get('name')), tendon.get('springlength')
            if len(ends) != 2 or not number(tendon.get('stiffness')) or length is None:
                self.robot.notes.append(
                    f'{name}: left out: a tendon that is not a spring between two sites'
                )
                continue
            keys = {
                'stiffness': f'{number(tendon.get("stiffness"))!r} N/m',
                'free_length': f'{number(length)!r} m',
                'damping': f'{number(tendon.get("damping"))!r} N s/m',
            }
            self.robot.springs[name] = ends, keys

    def _drives(self) -> None:
        """Actuators of a speed, whose controls the first keyframe has."""
        key = self._root.find('keyframe/key')
        control = (key.get('ctrl') if key is not None else None) or ''
        values = [float(x) for x in control.split()]
        for k, actuator in enumerate(self._root.findall('actuator/*')):
            joint, name = actuator.get('joint'), actuator.get('name') or actuator.tag
            factors = {joint: 1.0} if joint else self._tendons.get(actuator.get('tendon'), {})
            if actuator.tag == 'velocity' and factors and k < len(values):
                self.robot.drives.append((factors, values[k]))
            else:
                self.robot.notes.append(f'{name}: left out: an actuator of {actuator.tag}')


_Z, _NO_AXIS = np.array([0.0, 0.0, 1.0]), np.zeros(3)
