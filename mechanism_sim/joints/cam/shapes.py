"""Shapes of a cam and its follower in a drawing of a mechanism."""

from __future__ import annotations

import math

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.joints.cam.followers import FlatFaced, OscillatingFlat
from mechanism_sim.joints.cam.placement import PlacedCam
from mechanism_sim.joints.cam.profiles import drawing_angles, extent
from mechanism_sim.planar.points import rotate
from mechanism_sim.planar.view import circle

_PARTS = 720  # of a turn or stroke
_FACE = 0.5  # thickness of a face, in units of the drawing's symbols
_TIP = 1.5  # length of a knife's edge


def cam_outlines(joint: PlacedCam) -> list[Array]:
    """The cam (k, 2) [m], from its edge inwards: a groove has a rim and two walls.

    A cam that slides is a bar from its base line on; a groove in it is what lies between bars.
    """
    angles = _angles(joint)
    if joint.distance.slides:
        edges = [_bar(joint.cam.at(angles).profile, 0.0)]
        if joint.grooved:
            inner, outer = joint.cam.groove(angles)
            edges = [_bar(inner, 0.0), _bar(outer, outer[0].max() + joint.cam.base_radius)]
    elif not joint.grooved:
        edges = [joint.cam.at(angles).profile]
    else:
        inner, outer = joint.cam.groove(angles)
        rim = 1.12 * float(np.hypot(*outer).max())
        edges = [rim * np.array([np.cos(angles), np.sin(angles)]), outer, inner]
    return [joint.profile(edge).T for edge in edges]


def _angles(joint: PlacedCam) -> Array:
    law = joint.cam.law
    return drawing_angles(law, extent(law) / _PARTS)


def _bar(edge: Array, back: float) -> Array:
    """Closed behind an edge (2, N), at a height."""
    return np.column_stack([edge, (back, edge[1, -1]), (back, edge[1, 0])])


def follower_outline(joint: PlacedCam, angle: float, symbol: float) -> Array:
    """Roller, edge or face, on the follower's link, (k, 2) [m].

    Parameters
    ----------
    angle : of the follower's link in the world at some instant [rad]
    symbol : size of the drawing's symbols [m]
    """
    follower = joint.cam.follower
    if isinstance(follower, FlatFaced | OscillatingFlat):
        angles = _angles(joint)
        if isinstance(follower, FlatFaced):  # the contact wanders by u' along the face
            reach, behind = joint.cam.law(angles, 1), -1.0
            turn = joint.direction + joint.mirror * follower.tilt + 0.5 * math.pi - angle
        else:
            reach, behind = joint.cam.at(angles).sliding, -float(joint.swing)
            turn = joint.arm_angle
        half = float(np.abs(reach).max()) + 0.3 * joint.cam.base_radius
        thick = behind * _FACE * symbol
        corners = np.array([(-half, 0.0), (half, 0.0), (half, thick), (-half, thick)]).T
    elif follower.roller > 0.0:
        return circle(follower.roller, joint.on_second)
    else:
        size = _TIP * symbol
        corners = np.array([(0.0, 0.0), (size, -0.3 * size), (size, 0.3 * size)]).T
        turn = joint.direction - angle
        if joint.distance.swings:
            turn = joint.arm_angle + math.pi
    c, s = rotate((1.0, 0.0), turn)
    return np.asarray(joint.on_second + corners.T @ [[c, s], [-s, c]])
