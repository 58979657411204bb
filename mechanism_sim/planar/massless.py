"""Motions of a mechanism that move no mass: links of mass 0 beside others.

A direction of motion moves no mass if no centre of gravity of a link with mass moves and no link
with inertia turns. That is a matter of geometry: how large masses are does not count.
"""

from __future__ import annotations

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, Point, Vector2
from mechanism_sim.tolerances import TOLERANCES

_MECHANISM = TOLERANCES.mechanism


def inertial_motion(mechanism: Mechanism, q: Array) -> Array:
    """Jacobian (k, n) of the motion of all mass and inertia with respect to the coordinates.

    Rows are velocities of the centres of gravity of links with mass, over the mechanism's size,
    and rates of links with inertia, per coordinate [1/rad, 1/m].
    """
    index = mechanism.coordinates.index
    # a beam has mass all along
    rows = [np.eye(len(q))[index(c)] for c in mechanism.deformations]
    for body in mechanism.bodies:
        if body.mass:
            rows += [*_velocity(mechanism, q, body.name, body.cog) / mechanism.size]
        if body.inertia:
            rows.append(_spin(mechanism, body.name))
    return np.array(rows).reshape(-1, len(mechanism.coordinates))


def without_mass(motion: Array, closures: Array) -> Array:
    """Directions (n, k) that keep closures (r, n) and move nothing of `motion` (m, n)."""
    free = _null(closures, _size(closures))
    return np.asarray(free @ _null(motion @ free, _size(motion)))


def moving(mechanism: Mechanism, q: Array, direction: Array) -> list[str]:
    """The links that move along a direction (n,)."""
    found = {}
    for body in mechanism.bodies:
        ends: list[Vector2] = [(0.0, 0.0), body.cog]
        ends += [at for j in mechanism.joints for link, at in j.points if link == body.name]
        motion = [x for at in ends for x in _velocity(mechanism, q, body.name, at)]
        rates = np.array([*np.array(motion) / mechanism.size, _spin(mechanism, body.name)])
        found[body.name] = float(np.abs(rates @ direction).max())
    least = _MECHANISM.no_mass * max(found.values())  # a direction may hold [m] and [rad]
    return [name for name, rate in found.items() if rate > least]


def _velocity(mechanism: Mechanism, q: Array, link: str, at: Vector2) -> Array:
    """Velocity (2, n) [m] of a point of a link, per rate of each coordinate."""
    rigid: Point = {  # of a beam as it is when straight
        (frame, slide): d
        for (frame, slide), d in mechanism.point(link, at).items()
        if not isinstance(slide, tuple) and slide not in mechanism.deformations
    }
    n = len(q)
    velocity: Array = mechanism.trace(rigid, np.repeat(q[:, None], n, axis=1), np.eye(n))[1]
    return velocity


def _spin(mechanism: Mechanism, link: str) -> Array:
    """Rate (n,) of a link, per rate of each coordinate."""
    frame, found = mechanism.frame(link)[0], np.zeros(len(mechanism.coordinates))
    if frame != GROUND:
        found[mechanism.coordinates.index(frame)] = 1.0
    return found


def _size(rows: Array) -> float:
    """Largest singular value."""
    return float(np.linalg.norm(rows, 2)) if rows.size else 0.0


def _null(rows: Array, size: float) -> Array:
    """Orthonormal directions (n, k) in which the rows (r, n) are next to nothing beside a size."""
    if not rows.size:
        return np.eye(rows.shape[1])
    _, sizes, turned = np.linalg.svd(rows)
    return np.asarray(turned[int((sizes > _MECHANISM.no_mass * size).sum()) :].T)
