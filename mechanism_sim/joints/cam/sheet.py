"""Outlines of cams for a workshop."""

from __future__ import annotations

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.joints.cam.profiles import Cam, drawing_angles, extent
from mechanism_sim.joints.sheets import Circle, Outline, Polygon

#: points nearer than this are one [m]; both limits at a break of a law are drawn
SAME = 1e-9


def cam_outline(cam: Cam, clearance: float | None = None) -> Outline:
    """The profile of a cam at angle 0, with the pitch curve of its roller and the base circle.

    `profiles.find_flaws` and `interference.find_cut_away` say whether it can be cut.

    Parameters
    ----------
    clearance : of the roller in a groove [m], which then has both walls; None: no groove
    """
    # steps between points which keep a radius of 100 mm to 0.05 um
    at = drawing_angles(cam.law, extent(cam.law) / 3600)
    touch, closed = cam.at(at), not cam.law.reciprocating
    walls = {'profile': touch.profile}
    if clearance is not None:
        walls = dict(zip(('inner', 'outer'), cam.groove(at, clearance), strict=True))
    guides: list[Polygon | Circle] = []
    if getattr(cam.follower, 'roller', 0.0) > 0.0:
        guides.append(Polygon('pitch', _distinct(touch.pitch, closed), closed))
    if closed:
        guides.append(Circle('base', cam.base_radius))
    else:
        line = np.array([(cam.base_radius, cam.base_radius), (at[0], at[-1])])
        guides.append(Polygon('base', line, closed=False))
    edges = [Polygon(name, _distinct(wall, closed), closed) for name, wall in walls.items()]
    return Outline(tuple(edges), tuple(guides))


def _distinct(points: Array, closed: bool) -> Array:
    """Points without those that repeat the one before."""
    moved = np.hypot(*np.diff(points, prepend=points[:, -1:])) > SAME
    moved[0] |= not closed
    return points[:, moved]
