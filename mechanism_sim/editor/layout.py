"""Poses of links while a machine is drawn, whether or not it can be assembled yet."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.editor.sketch import ORIGIN, Pose, Poses, drives_of, point
from mechanism_sim.planar.mechanism import Mechanism, Prismatic
from mechanism_sim.planar.points import GROUND, rotate
from mechanism_sim.scene.schema import Scene


def placed(scene: Scene, before: Mapping[str, Pose]) -> Poses:
    """Poses of all links, from drives, guesses and the previous picture.

    Joints are assembled from the ground outwards; loops may stay open.
    """
    given: dict[str, float] = {c: x.value for c, x in scene.rough.items()}
    for c, (_, drive) in drives_of(scene).items():
        for start in (drive.start_angle, drive.start_position):
            given |= {} if start is None else {c: start}
    found: Poses = {GROUND: ORIGIN}
    joints = [
        (joint, kind, a, b)
        for joint in scene.joints.values()
        for kind in (joint.kind,)
        if kind in ('revolute', 'prismatic')
        for a, b in [(point(scene, joint.points[0]), point(scene, joint.points[1]))]
    ]
    grown = True
    while grown:
        grown = False
        for joint, kind, one, two in joints:
            if one is None or two is None or (one[0] in found) == (two[0] in found):
                continue
            (near, _, on), (far, _, at) = (one, two) if one[0] in found else (two, one)
            old = before.get(far, ORIGIN)
            carrier, angle = found[near], given.get(far, old.angle)
            x, y = carrier.place(on)
            if kind == 'prismatic':
                sign = 1.0 if near == one[0] else -1.0
                angle = carrier.angle + sign * joint.angle
                way = rotate((1.0, 0.0), joint.axis + (carrier.angle if sign > 0.0 else angle))
                along = given.get(far, (old.x - x) * way[0] + (old.y - y) * way[1])
                x, y = x + sign * along * way[0], y + sign * along * way[1]
            dx, dy = rotate(at, angle)
            found[far], grown = Pose(x - dx, y - dy, angle), True
    for link in scene.links:
        if link not in found:
            old = before.get(link, ORIGIN)
            found[link] = Pose(old.x, old.y, given.get(link, old.angle))
    return found


def coordinates(mechanism: Mechanism, poses: Mapping[str, Pose]) -> Array:
    """Coordinates (n,) of a tree with these poses of links; deformations are 0."""
    found = []
    for name in mechanism.coordinates:
        joint = mechanism.tree_joints.get(name)
        link, _, axis = name.partition('.')
        if name in mechanism.deformations:
            found.append(0.0)
        elif axis:  # a floating link
            found.append(poses[link].place(mechanism.body(link).cog)['xy'.index(axis)])
        elif name in mechanism.displacements and isinstance(joint, Prismatic):
            a = poses[joint.first].place(joint.on_first)
            b = poses[joint.second].place(joint.on_second)
            way = rotate((1.0, 0.0), poses[joint.first].angle + joint.axis)
            found.append((b[0] - a[0]) * way[0] + (b[1] - a[1]) * way[1])
        else:
            found.append(poses[name].angle)
    return np.array(found)
