"""Outlines of gears and racks for a workshop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mechanism_sim.joints.mesh.involute import FULL_DEPTH, Gear, ToothSystem, rack_teeth
from mechanism_sim.joints.mesh.pair import Pair
from mechanism_sim.joints.sheets import Circle, Outline, Polygon

#: points of a flank, and within an arc at a tip or root: for a module of 2 mm to 0.03 um
FLANK, ARC = 160, 32


def gear_outline(gear: Gear, angle: float = 0.0) -> Outline:
    """All teeth, with the pitch, base, tip and root circles.

    The fillets that the cutter leaves at the roots are not drawn.

    Parameters
    ----------
    angle : of one of the teeth from the x axis [rad]
    """
    circles = {
        'pitch': gear.pitch_radius,
        'base': gear.base_radius,
        'tip': gear.tip_radius,
        'root': gear.root_radius,
    }
    teeth = Polygon('profile', gear.outline(FLANK, angle, ARC).T)
    return Outline((teeth,), tuple(Circle(*item) for item in circles.items()))


def rack_outline(teeth: int, module: float, system: ToothSystem = FULL_DEPTH) -> Outline:
    """The teeth of a rack towards x, its pitch line on the y axis; see `rack_teeth`."""
    points = rack_teeth(teeth, module, system).T
    line = np.array([(0.0, 0.0), points[1, [0, -1]]])
    return Outline(
        (Polygon('profile', points, closed=False),), (Polygon('pitch', line, closed=False),)
    )


def pair_outline(pair: Pair, names: tuple[str, str] = ('pinion', 'wheel')) -> Outline:
    """Two gears in mesh, the flanks on both sides as far from each other as the backlash leaves.

    The pinion's shaft is at the origin, and one of its teeth on the x axis, in a space of the
    wheel.

    Parameters
    ----------
    names : what the names of curves begin with, as in ``pinion.profile``
    """
    # the pinion is inside of an internal wheel, near the side to which its tooth points
    c, facing = (
        (-pair.centre_distance, 0.0) if pair.wheel.internal else (pair.centre_distance, math.pi)
    )
    wheel = gear_outline(pair.wheel, facing + math.pi / pair.wheel.teeth)
    return _together(
        _named(gear_outline(pair.pinion), names[0]), _shifted(_named(wheel, names[1]), c)
    )


def gear_and_rack_outline(
    gear: Gear, distance: float, names: tuple[str, str] = ('gear', 'rack')
) -> Outline:
    """A gear and a piece of its rack, as `pair_outline`; the rack is as long as the gear is wide.

    Parameters
    ----------
    distance : of the rack's pitch line from the shaft [m]
    """
    teeth = 2 * math.ceil(gear.teeth / 2.0 / math.pi) + 2
    rack = rack_outline(teeth, gear.module, gear.system)
    up = 0.5 * (teeth - 1) * gear.circular_pitch

    def turned(curve: Polygon) -> Polygon:
        x, y = curve.points
        return replace(curve, points=np.array([distance - x, up - y]))

    edges, guides = (
        tuple(turned(c) for c in group if isinstance(c, Polygon))
        for group in (rack.edges, rack.guides)
    )
    rack = _named(replace(rack, edges=edges, guides=guides, shafts=()), names[1])
    return _together(_named(gear_outline(gear), names[0]), rack)


def _named(outline: Outline, name: str) -> Outline:
    """With the name of the part before those of its curves."""
    edges = tuple(replace(part, name=f'{name}.{part.name}') for part in outline.edges)
    guides = tuple(replace(part, name=f'{name}.{part.name}') for part in outline.guides)
    return replace(outline, edges=edges, guides=guides)


def _shifted(outline: Outline, x: float) -> Outline:
    """So far along the x axis; guides are circles."""
    edges = tuple(replace(c, points=c.points + np.array([[x], [0.0]])) for c in outline.edges)
    guides = tuple(replace(c, centre=(x, 0.0)) for c in outline.guides if isinstance(c, Circle))
    return Outline(edges, guides, ((x, 0.0),))


def _together(one: Outline, two: Outline) -> Outline:
    return Outline(one.edges + two.edges, one.guides + two.guides, one.shafts + two.shafts)
