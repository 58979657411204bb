"""SDF of planar machines: links by their poses, all joints, gearboxes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.imports.blueprint import Blueprint
from mechanism_sim.imports.markup import by_quaternion, number, numbers, parse, turned
from mechanism_sim.imports.robot import KINDS, Robot, RobotBody, RobotJoint


def read(path: Path, text: str, _unit: str | None) -> Blueprint:
    """The machine of the single model of an SDF file, in metres."""
    root = parse(path.name, text, 'sdf')
    models = list(root.iter('model'))
    if len(models) != 1:
        raise InputError(f'{path.name} has {len(models)} models: it must be one')
    (model,) = models
    robot = Robot(model.get('name') or path.stem)
    if (world := root.find('world')) is not None:
        if world.find('gravity') is None:
            robot.notes.append(f'the world has no gravity in the file: {_GRAVITY} m/s^2 by SDF')
        robot.gravity = numbers(_text(world, 'gravity') or _GRAVITY, 3)
    robot.notes += [
        f'{x.findtext("uri")}: left out: an included model' for x in root.iter('include')
    ]
    frames = SdfFrames(model, root.get('version', ''))
    for link in model.findall('link'):
        body = _body(link)
        if link.find('inertial') is None:
            robot.notes.append(f'{body.name}: it has no <inertial>: 1 kg and 1 kg m^2 by SDF')
        body.turn, body.place = frames.pose(body.name)
        robot.bodies[body.name] = body
    for joint in model.findall('joint'):
        join(robot, joint, frames)
    return robot.blueprint()


class SdfFrames:
    """World poses of links, joints and frames of a model by name."""

    def __init__(self, model: Element, version: str = '') -> None:
        if (other := _relative(model)) not in ('', 'world') or model.get('placement_frame'):
            other = other or str(model.get('placement_frame'))
            raise InputError(f"the pose of the model is that of '{other}': move the model itself")
        self.old = version in ('1.0', '1.2', '1.3', '1.4')  # axes in the frame of the model
        self._poses = {'world': (np.eye(3), np.zeros(3)), '__model__': _pose(model)}
        self._parts = {str(x.get('name')): x for x in model if x.tag in _FRAMES}
        self._begun: set[str] = set()

    def pose(self, name: str) -> tuple[Array, Array]:
        """Rotation (3, 3) and position (3,) [m] in the world."""
        if name not in self._poses:
            part = self._parts.get(name)
            if part is None or name in self._begun:
                why = 'there is no such frame' if part is None else 'its pose relates to itself'
                raise InputError(f"'{name}': {why}")
            self._begun.add(name)
            turn, place = self.pose(_relative(part) or self._above(part))
            own, at = _pose(part)
            self._poses[name] = turn @ own, place + turn @ at
        return self._poses[name]

    def link(self, name: str) -> str:
        """The link to which a frame is attached."""
        part = self._parts.get(name)
        return name if part is None or part.tag == 'link' else self.link(self._above(part))

    @staticmethod
    def _above(part: Element) -> str:
        """The default reference frame of a pose."""
        if part.tag == 'joint':
            return _text(part, 'child')
        return (part.get('attached_to') if part.tag == 'frame' else '') or '__model__'


_GRAVITY = '0 0 -9.8'
_FRAMES = 'link', 'joint', 'frame'
_ENDLESS, _NO_LIMIT = 1e15, ('', 'inf', 'infinity')  # infinite limits


def join(robot: Robot, joint: Element, frames: SdfFrames | None = None) -> None:
    """Add a joint between bodies at their start poses."""
    name, kind = str(joint.get('name')), str(joint.get('type'))
    ends = [_text(joint, side) for side in ('parent', 'child')]
    parent, child = (robot.bodies.get(frames.link(x) if frames else x) for x in ends)
    if parent is None or child is None:
        raise InputError(f'{name}: its parent or its child is not a link of the model')
    if kind == 'gearbox':  # child = -ratio parent, both against the body of reference
        ratio = number(_text(joint, 'gearbox_ratio'), 1.0)
        carrier = _text(joint, 'gearbox_reference_body')
        weights = {parent.name: ratio, child.name: 1.0}
        weights[carrier] = weights.get(carrier, 0.0) - ratio - 1.0
        robot.geared[name] = weights
        return
    if kind not in KINDS:
        raise InputError(f'{name}: joints of type {kind} are not planar ones')
    turn, at = _pose(joint)
    if frames and (_relative(joint) or child.name != ends[1]):
        turn, at = frames.pose(name)
        turn, at = child.turn.T @ turn, child.local(at)
    axis, given = numbers(_text(joint, 'axis/xyz') or '0 0 1', 3), joint.find('axis/xyz')
    base = given.get('expressed_in', '') if given is not None else ''
    if frames and (frames.old or _text(joint, 'axis/use_parent_model_frame') in ('1', 'true')):
        base = '__model__'
    axis = (child.turn.T @ frames.pose(base)[0] if frames and base else turn) @ axis
    axis = axis / (np.linalg.norm(axis) or 1.0)
    if KINDS[kind] != 'fixed':
        dynamics, limit = 'axis/dynamics/', 'axis/limit/'
        k, c, free = (
            number(_text(joint, dynamics + x))
            for x in ('spring_stiffness', 'damping', 'spring_reference')
        )
        robot.resist(name, k, c, free)
        reach = [_text(joint, limit + x).lower().lstrip('+-') for x in ('lower', 'upper')]
        robot.leave_out(
            name,
            limits=any(number(x) < _ENDLESS for x in reach if x not in _NO_LIMIT),
            friction=number(_text(joint, dynamics + 'friction')) > 0.0,
        )
    if (mimic := joint.find('axis/mimic')) is not None:
        factor, leader = number(_text(mimic, 'multiplier'), 1.0), str(mimic.get('joint'))
        robot.ratios[name] = {name: 1.0, leader: -factor}
        if any(number(_text(mimic, x)) for x in ('offset', 'reference')):
            robot.notes.append(f'{name}: it follows {leader} from where both are at the start')
    there, turn = parent.local(child.world(at)), parent.turn.T @ child.turn
    robot.joints.append(
        RobotJoint(name, KINDS[kind], parent.name, child.name, there, at, axis, turn)
    )


def inertia_of(part: Callable[[str], str | None], diagonal: float = 0.0) -> Array:
    """The inertia (3, 3) of its six parts; on the diagonal `diagonal` for those without a text."""
    xx, yy, zz = (number(part(f'i{axes}'), diagonal) for axes in ('xx', 'yy', 'zz'))
    xy, xz, yz = (number(part(f'i{axes}')) for axes in ('xy', 'xz', 'yz'))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _body(link: Element) -> RobotBody:
    """A link; missing mass and moments of inertia are 1."""
    body = RobotBody(str(link.get('name')))
    given = link.find('inertial')
    given = Element('inertial') if given is None else given
    turn, body.cog = _pose(given)
    body.mass = number(_text(given, 'mass'), 1.0)
    inertia = inertia_of(lambda k: _text(given, f'inertia/{k}'), 1.0)
    body.inertia = turn @ inertia @ turn.T
    return body


def _pose(element: Element) -> tuple[Array, Array]:
    """Rotation (3, 3) and position (3,) [m] in the reference frame."""
    pose, text = element.find('pose'), _text(element, 'pose')
    if pose is not None and pose.get('rotation_format') == 'quat_xyzw' and text:
        found = numbers(text, 7)
        return by_quaternion(*found[3:].tolist()), found[:3]
    values = numbers(text, 6)
    degrees = pose is not None and pose.get('degrees') in ('1', 'true')
    return turned(*(np.radians(values[3:]) if degrees else values[3:])), np.asarray(values[:3])


def _relative(element: Element) -> str:
    """The reference frame of a pose, if stated; before version 1.7 by another name."""
    pose = element.find('pose')
    return '' if pose is None else pose.get('relative_to', pose.get('frame', ''))


def _text(element: Element, path: str) -> str:
    return (element.findtext(path) or '').strip()
