"""Start of a machine by the pose or the velocity of one of its links."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.mechanism import Weld
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.scene.check import coordinate_starts
from mechanism_sim.scene.machine import Machine

_NEAR = 1e-6  # tolerance for rounded digits, as a share of size, turn and rates


class Planar(NamedTuple):
    """Pose of a link's frame [m, rad], or its velocity [m/s, rad/s], in the frame of the world."""

    at: Vector2
    angle: float


def pose_and_velocity(machine: Machine, link: str) -> tuple[Planar, Planar]:
    """Initial pose and velocity of a link."""
    mechanism, (q, v) = machine.mechanism, _start(machine)
    place, rate = mechanism.trace((link, (0.0, 0.0)), q, v)[:, :, 0]
    frame, _ = mechanism.frame(link)
    turning = float(v[mechanism.coordinates.index(frame), 0]) if frame != GROUND else 0.0
    angle = float(mechanism.angle_all(link, q)[0])
    return Planar((*place.tolist(),), angle), Planar((*rate.tolist(),), turning)


def start_values(
    machine: Machine, link: str, pose: Planar | None, velocity: Planar | None
) -> dict[str, str]:
    """Values of the scene, by their paths, with which `link` starts so.

    Those of the coordinate that the link has of its own: an angle, or a displacement along its
    guide. `check_start` looks whether the machine starts with them as was asked.
    """
    mechanism, (q, v) = machine.mechanism, _start(machine)
    if isinstance(carrier := mechanism.tree_joints.get(link), Weld):
        other = mechanism.parent(link)
        raise InputError(f'{link} is welded to {other} by {carrier.name}: place that')
    now, _ = pose_and_velocity(machine, link)
    values: dict[str, float] = {}
    for kind, asked in (('position', pose), ('velocity', velocity)):
        if asked is None:
            continue
        path = f'initial.{kind}.{link}'
        if link in mechanism.sliding:
            k = mechanism.coordinates.index(link)
            unit = np.zeros_like(q)
            unit[k] = 1.0
            place, way = mechanism.trace((link, (0.0, 0.0)), q, unit)[:, :, 0]
            values[path] = float(q[k, 0] + (np.array(asked.at) - place) @ way)
            if kind == 'velocity':
                others = v * (1.0 - unit)
                _, rate = mechanism.trace((link, (0.0, 0.0)), q, others)[:, :, 0]
                values[path] = float((np.array(asked.at) - rate) @ way)
            continue
        turns = round((now.angle - asked.angle) / TWO_PI) if kind == 'position' else 0
        values[path] = asked.angle + TWO_PI * turns
    units = {'position': ('rad', 'm'), 'velocity': ('rad/s', 'm/s')}
    straight = mechanism.displacements
    return {
        path: f'{value!r} {units[kind][name in straight]}'
        for path, value in values.items()
        for _, kind, name in [path.split('.', 2)]
    }


def check_start(machine: Machine, link: str, pose: Planar | None, velocity: Planar | None) -> None:
    """Refuse a machine that does not start with the requested pose of the link."""
    size, loose = machine.mechanism.size, 0.0
    found_pose, found_velocity = pose_and_velocity(machine, link)
    pace = max(math.hypot(*found_velocity.at) / size, abs(found_velocity.angle), 1.0)
    if floats := link in machine.mechanism.floating:  # bearings give its pose
        loose = 2.0 * max(spec.radial for spec in machine.plan.clearances.values())
    for what, asked, found, scale, units in (
        ('pose', pose, found_pose, 1.0, ('m', 'rad')),
        ('velocity', velocity, found_velocity, pace, ('m/s', 'rad/s')),
    ):
        if asked is None:
            continue
        off = max(0.0, math.dist(asked.at, found.at) - loose) / size
        off = 0.0 if floats and what == 'velocity' else off
        turned = asked.angle - found.angle
        turned -= TWO_PI * round(turned / TWO_PI) if what == 'pose' else 0.0
        if max(off, abs(turned)) > _NEAR * scale:
            (x, y), angle = found
            raise InputError(
                f'the joints of {machine.name} do not let {link} have that {what}: nearest it has '
                f'x {x:.9g} {units[0]}, y {y:.9g} {units[0]}, angle {angle:.9g} {units[1]}'
            )


def _start(machine: Machine) -> tuple[Array, Array]:
    """Coordinates and rates (n, 1) at the start."""
    starts = coordinate_starts(machine)
    names = machine.mechanism.coordinates
    q, v = np.array([[starts[c].value, starts[c].rate] for c in names]).T
    return q[:, None], v[:, None]
