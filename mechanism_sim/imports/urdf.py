"""URDF of planar machines: trees of joints, and loops as this package and URDF+ write them.

A `loop` has a predecessor and a successor with their origins, a `state` the coordinates at the
start; other readers ignore both.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.imports.blueprint import Blueprint
from mechanism_sim.imports.markup import number, numbers, parse, rotation, turned
from mechanism_sim.imports.robot import KINDS, WORLD, Robot, RobotBody, RobotJoint
from mechanism_sim.imports.sdf import inertia_of, join


def read(path: Path, text: str, _unit: str | None) -> Blueprint:
    """The machine of a URDF file, in metres."""
    root = parse(path.name, text, 'robot')
    robot = Robot(root.get('name') or path.stem)
    for link in root.findall('link'):
        robot.bodies[_name(link)] = _body(link)
    carried = {_end(joint, 'child') for joint in root.findall('joint')}
    roots = [name for name in robot.bodies if name not in carried and name != WORLD]
    if WORLD not in {_name(link) for link in root.findall('link')}:
        if len(roots) != 1:
            raise InputError(f'{path.name}: there must be one link that no joint carries')
        robot.joints.append(_fixed('base', WORLD, roots[0]))
    state = _positions(root)
    known = {WORLD, *roots}
    waiting = root.findall('joint')
    while waiting:
        ready = [joint for joint in waiting if _end(joint, 'parent') in known]
        if not ready:
            raise InputError(f'{path.name}: {_name(waiting[0])} is connected to no link')
        for joint in ready:
            waiting.remove(joint)
            known.add(_end(joint, 'child'))
            _carry(robot, joint, state)
    for loop in root.findall('loop'):
        ends = [loop.find(side) for side in ('predecessor', 'successor')]
        (one, at), (other, there) = (
            (str(end.get('link')), _origin(end)[1]) for end in ends if end is not None
        )
        axis = numbers(_find(loop, 'axis', 'xyz'), 3) if loop.find('axis') is not None else _Z
        kind = {**KINDS, 'slot': 'slot'}.get(loop.get('type', 'revolute'), 'revolute')
        robot.joints.append(RobotJoint(_name(loop), kind, one, other, at, there, axis))
    for joint in root.findall('gazebo/joint'):  # as in Gazebo's tutorial on loops
        join(robot, joint)
    for held in root.findall('coupling'):
        ratio = number(_find(held, 'ratio', 'value'), 1.0)
        one, other, carrier = (_end(held, x) for x in ('predecessor', 'successor', 'reference'))
        weights = robot.geared[_name(held)] = {one: -ratio, other: 1.0}
        weights[carrier] = weights.get(carrier, 0.0) + ratio - 1.0
    return robot.blueprint()


_Z = np.array([0.0, 0.0, 1.0])
_ENDLESS = 1e12  # [N] limit in exports for guides without limits


def _positions(root: Element) -> dict[str, float]:
    """Positions of all joints at the start [rad, m]; mimic joints may form a chain."""
    state = {x.get('joint'): number(x.get('position')) for x in root.findall('state/joint_state')}
    joints = {_name(joint): joint for joint in root.findall('joint')}

    def position(name: str, followers: tuple[str, ...] = ()) -> float:
        if name in followers:
            raise InputError(f'{name}: joints that mimic each other in a circle have no position')
        mimic = joints[name].find('mimic') if name in joints else None
        if mimic is None:
            return state.get(name, 0.0)
        leader = position(str(mimic.get('joint')), (*followers, name))
        return number(mimic.get('multiplier'), 1.0) * leader + number(mimic.get('offset'))

    return {name: position(name) for name in joints}


def _carry(robot: Robot, joint: Element, state: dict[str, float]) -> None:
    """Add a joint, and the pose of the link that it carries."""
    name, kind = _name(joint), KINDS.get(joint.get('type', ''))
    parent, child = (robot.bodies[_end(joint, side)] for side in ('parent', 'child'))
    if kind is None:
        raise InputError(f'{name}: joints of type {joint.get("type")} are not planar ones')
    turn, at = _origin(joint)
    axis = numbers(_find(joint, 'axis', 'xyz') or '1 0 0', 3)
    axis /= np.linalg.norm(axis) or 1.0
    mimic, value = joint.find('mimic'), state[name]
    robot.resist(name, 0.0, number(_find(joint, 'dynamics', 'damping')))
    effort = number(_find(joint, 'limit', 'effort'))  # the only limit of a continuous joint
    robot.leave_out(
        name,
        limits=joint.get('type') in ('revolute', 'prismatic') and effort < _ENDLESS,
        friction=number(_find(joint, 'dynamics', 'friction')) > 0.0,
    )
    if mimic is not None:
        factor = number(mimic.get('multiplier'), 1.0)
        robot.ratios[name] = {name: 1.0, str(mimic.get('joint')): -factor}
    child.turn, child.place = parent.turn @ turn, parent.world(at)
    if kind == 'revolute':
        child.turn = child.turn @ rotation(axis, value)
    elif kind == 'prismatic':
        child.place = child.place + child.turn @ axis * value
    robot.joints.append(
        RobotJoint(name, kind, parent.name, child.name, at, np.zeros(3), axis, turn)
    )


def _body(link: Element) -> RobotBody:
    body = RobotBody(_name(link))
    body.frame = not any(link.find(x) is not None for x in ('inertial', 'visual', 'collision'))
    if (given := link.find('inertial')) is not None:
        turn, body.cog = _origin(given)
        body.mass = number(_find(given, 'mass', 'value'))
        body.inertia = turn @ inertia_of(lambda k: _find(given, 'inertia', k)) @ turn.T
    return body


def _fixed(name: str, parent: str, child: str) -> RobotJoint:
    return RobotJoint(name, 'fixed', parent, child, np.zeros(3), np.zeros(3), _Z)


def _origin(element: Element) -> tuple[Array, Array]:
    """Rotation (3, 3) and position (3,) [m] of an origin."""
    turn = turned(*numbers(_find(element, 'origin', 'rpy'), 3))
    return turn, numbers(_find(element, 'origin', 'xyz'), 3)


def _find(element: Element, child: str, key: str) -> str | None:
    found = element.find(child)
    return None if found is None else found.get(key)


def _name(element: Element) -> str:
    name = element.get('name')
    if not name:
        raise InputError(f'a <{element.tag}> has no name')
    return name


def _end(joint: Element, side: str) -> str:
    name = _find(joint, side, 'link')
    if not name:
        raise InputError(f'{_name(joint)}: <{side}> is missing')
    return name
