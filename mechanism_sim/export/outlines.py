"""What a workshop cuts, and the lines that go with it, of cams and gears."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.cams.profiles import Cam, drawing_angles, extent
from mechanism_sim.gears.involute import FULL_DEPTH, Gear, ToothSystem, rack_teeth

Array = NDArray[np.float64]

#: points nearer than this are one [m]; both limits at a break of a law are drawn
SAME = 1e-9

#: points of a flank, and within an arc at a tip or root: for a module of 2 mm to 0.03 um
FLANK, ARC = 160, 32


@dataclass(frozen=True)
class Curve:
    """A polygon.

    Parameters
    ----------
    name : what it is; its layer
    points : (2, n) [m]
    closed : the last point is joined to the first
    """

    name: str
    points: Array
    closed: bool = True


@dataclass(frozen=True)
class Circle:
    """A circle about the origin.

    Parameters
    ----------
    name : what it is; its layer
    radius : [m]
    """

    name: str
    radius: float


@dataclass(frozen=True)
class Outline:
    """A part seen along its shaft, which is at the origin.

    Parameters
    ----------
    edges : what is cut
    guides : lines of thought: pitch curves, base circles
    """

    edges: tuple[Curve, ...]
    guides: tuple[Curve | Circle, ...]

    @property
    def box(self) -> Array:
        """Lower left and upper right corner, the origin being inside, (2, 2) [m]."""
        corners = [np.zeros((2, 1))]
        for part in (*self.edges, *self.guides):
            if isinstance(part, Circle):
                corners.append(part.radius * np.array([[-1.0, 1.0], [-1.0, 1.0]]))
            else:
                corners.append(part.points)
        everything = np.concatenate(corners, axis=1)
        return np.array([everything.min(axis=1), everything.max(axis=1)])


def cam_outline(cam: Cam, clearance: float | None = None, step: float | None = None) -> Outline:
    """The profile of a cam at angle 0, with the pitch curve of its roller and the base circle.

    `profiles.find_flaws` and `interference.find_cut_away` say whether it can be cut.

    Parameters
    ----------
    clearance : of the roller in a groove [m], which then has both walls; None: no groove
    step : between the points of curves [rad] or [m]; without it a 3600th of the turn or stroke,
        which keeps a radius of 100 mm to 0.05 um

    Raises
    ------
    InputError
        If a groove is wanted, and the follower has no roller.
    """
    at = drawing_angles(cam.law, step or extent(cam.law) / 3600)
    touch, closed = cam.at(at), not cam.law.reciprocating
    walls = {'profile': touch.profile}
    if clearance is not None:
        walls = dict(zip(('inner', 'outer'), cam.groove(at, clearance), strict=True))
    guides: list[Curve | Circle] = []
    if getattr(cam.follower, 'roller', 0.0) > 0.0:
        guides.append(Curve('pitch', _distinct(touch.pitch, closed), closed))
    if closed:
        guides.append(Circle('base', cam.base_radius))
    else:
        line = np.array([(cam.base_radius, cam.base_radius), (at[0], at[-1])])
        guides.append(Curve('base', line, closed=False))
    edges = [Curve(name, _distinct(wall, closed), closed) for name, wall in walls.items()]
    return Outline(tuple(edges), tuple(guides))


def gear_outline(gear: Gear) -> Outline:
    """All teeth, one of them on the x axis, with the pitch, base, tip and root circles.

    The fillets that the cutter leaves at the roots are not drawn.
    """
    circles = {
        'pitch': gear.pitch_radius,
        'base': gear.base_radius,
        'tip': gear.tip_radius,
        'root': gear.root_radius,
    }
    teeth = Curve('profile', gear.outline(FLANK, arc=ARC).T)
    return Outline((teeth,), tuple(Circle(*item) for item in circles.items()))


def rack_outline(teeth: int, module: float, system: ToothSystem = FULL_DEPTH) -> Outline:
    """The teeth of a rack towards x, its pitch line on the y axis; see `rack_teeth`."""
    points = rack_teeth(teeth, module, system).T
    line = np.array([(0.0, 0.0), points[1, [0, -1]]])
    return Outline(
        (Curve('profile', points, closed=False),), (Curve('pitch', line, closed=False),)
    )


def _distinct(points: Array, closed: bool) -> Array:
    """Points without those that repeat the one before."""
    moved = np.hypot(*np.diff(points, prepend=points[:, -1:])) > SAME
    moved[0] |= not closed
    return points[:, moved]
