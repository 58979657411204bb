"""SDF of planar machines: links by their poses, all joints, gearboxes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.imports.blueprint import Blueprint
from mechanism_sim.imports.markup import number, numbers, parse, turned
from mechanism_sim.imports.robot import KINDS, Robot, RobotBody, RobotJoint


def read(path: Path, text: str, _unit: str | None) -> Blueprint:
    """The machine of the one model of an SDF, which is in metres."""
    root = parse(path.name, text, 'sdf')
    models = list(root.iter('model'))
    if len(models) != 1:
        raise InputError(f'{path.name} has {len(models)} models: it must be one')
    (model,) = models
    robot = Robot(model.get('name') or path.stem)
    gravity = root.find('world/gravity')
    if gravity is not None:
        robot.gravity = numbers(gravity.text, 3)
    base = _pose(model)
    frames = {'': base, '__model__': base}
    waiting = model.findall('link')
    while waiting:
        ready = [link for link in waiting if _relative(link) in frames]
        if not ready:
            raise InputError(f'{path.name}: the pose of {waiting[0].get("name")} has no link')
        for link in ready:
            waiting.remove(link)
            body = _body(link)
            turn, place = frames[_relative(link)]
            own, at = _pose(link)
            body.turn, body.place = turn @ own, place + turn @ at
            robot.bodies[body.name], frames[body.name] = body, (body.turn, body.place)
    for joint in model.findall('joint'):
        join(robot, joint)
    return robot.blueprint()


def join(robot: Robot, joint: Element) -> None:
    """Add a joint between bodies that are where they are at the start."""
    name, kind = str(joint.get('name')), str(joint.get('type'))
    parent, child = (robot.bodies.get(_text(joint, side)) for side in ('parent', 'child'))
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
    axis = turn @ numbers(_text(joint, 'axis/xyz') or '0 0 1', 3)
    there = parent.local(child.world(at))
    robot.joints.append(
        RobotJoint(
            name,
            KINDS[kind],
            parent.name,
            child.name,
            there,
            at,
            axis,
            parent.turn.T @ child.turn,
        )
    )


def inertia_of(part: Callable[[str], str | None], diagonal: float = 0.0) -> Array:
    """The inertia (3, 3) of its six parts; on the diagonal `diagonal` for those without a text."""
    xx, yy, zz = (number(part(f'i{axes}'), diagonal) for axes in ('xx', 'yy', 'zz'))
    xy, xz, yz = (number(part(f'i{axes}')) for axes in ('xy', 'xz', 'yz'))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _body(link: Element) -> RobotBody:
    body = RobotBody(str(link.get('name')))
    body.frame = not any(link.find(x) is not None for x in ('inertial', 'visual', 'collision'))
    if (given := link.find('inertial')) is not None:
        turn, body.cog = _pose(given)
        body.mass = number(_text(given, 'mass'), 1.0)
        inertia = inertia_of(lambda k: _text(given, f'inertia/{k}'), 1.0)
        body.inertia = turn @ inertia @ turn.T
    return body


def _pose(element: Element) -> tuple[Array, Array]:
    """Rotation (3, 3) and place (3,)."""
    pose = numbers(_text(element, 'pose'), 6)
    return turned(*pose[3:]), np.asarray(pose[:3])


def _relative(link: Element) -> str:
    pose = link.find('pose')
    return '' if pose is None else pose.get('relative_to', '')


def _text(element: Element, path: str) -> str:
    return (element.findtext(path) or '').strip()
