"""Bars, pins, blocks and discs: what a machine's links look like in viewers of other programs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.export.ideal import Ideal
from mechanism_sim.planar.mechanism import HigherPair, Joint, Prismatic, Revolute
from mechanism_sim.planar.points import GROUND, rotate
from mechanism_sim.scene.machine import Machine

#: points of a link nearer than this are one, as a share of the machine's size
SAME = 1e-6

#: of a bar, as a share of the machine's size
WIDTH = 1.0 / 30.0

#: of the ground, and of links in turn: a palette that the colour-blind can tell apart (Okabe, Ito)
COLOURS = ('0.6 0.6 0.6', '0.9 0.6 0', '0.35 0.7 0.9', '0 0.6 0.5', '0.8 0.4 0', '0 0.45 0.7')


@dataclass(frozen=True)
class Solid:
    """A box or a cylinder on a link, its axis square to the plane.

    Parameters
    ----------
    link : that carries it, or the ground
    kind : what it is
    size : lengths along x, y, z of a box; radius and length of a cylinder [m]
    at : its middle in the link's frame [m]; z is only for the eye, links lie side by side
    turn : of a box about z [rad]
    """

    link: str
    kind: Literal['box', 'cylinder']
    size: tuple[float, ...]
    at: tuple[float, float, float]
    turn: float = 0.0


def solids(machine: Machine) -> list[Solid]:
    """Solids of the ground and of all links.

    Links are bars between their joints, in layers; revolute joints pins, sliders blocks on their
    rails, which are as long as the machine is large around where the sliders start; gears, cams
    and Geneva wheels are discs: a gear of its pitch radius, a cam of its base circle, a Geneva
    wheel as far as its slots reach.
    """
    ideal = Ideal(machine)
    mechanism = ideal.mechanism
    thick = WIDTH * mechanism.size
    layers = {GROUND: 0.0} | {
        body.name: (k + 1) * 0.5 * thick for k, body in enumerate(mechanism.bodies)
    }
    found: list[Solid] = []
    for link, layer in layers.items():
        if link != GROUND:
            found += _bars(link, _corners(mechanism.joints, link), layer, thick)
    for joint in mechanism.joints:
        low, high = sorted((layers[joint.first], layers[joint.second]))
        if isinstance(joint, Revolute):
            height, middle = high - low + thick, 0.5 * (low + high)
            size = (0.4 * thick, height)
            found.append(Solid(joint.first, 'cylinder', size, (*joint.on_first, middle)))
        elif isinstance(joint, Prismatic):
            found += _guide(joint, layers, thick, mechanism.size, ideal.guided(joint)[0])
        else:
            found += _discs(joint, layers, thick)
    return list(dict.fromkeys(found))  # a gear in two meshes is one disc


def _corners(joints: tuple[Joint, ...], link: str) -> Array:
    """The joints of a link (k, 2) [m], in the order in which they lie around their middle."""
    at = [j.on_first for j in joints if j.first == link]
    at += [j.on_second for j in joints if j.second == link]
    x = np.array(at or [(0.0, 0.0)])
    around = x - x.mean(axis=0)
    return np.asarray(x[np.argsort(np.arctan2(around[:, 1], around[:, 0]), kind='stable')])


def _bars(link: str, corners: Array, layer: float, thick: float) -> Iterator[Solid]:
    """From each corner to the next."""
    ends = [*corners, *(corners[:1] if len(corners) > 2 else [])]
    for a, b in pairwise(ends):
        length = math.dist(a, b)
        if length > SAME * thick / WIDTH:
            x, y = (float(c) for c in 0.5 * (a + b))
            turn = math.atan2(b[1] - a[1], b[0] - a[0])
            yield Solid(link, 'box', (length, thick, 0.4 * thick), (x, y, layer), turn)


def _guide(
    joint: Prismatic, layers: dict[str, float], thick: float, size: float, start: float
) -> Iterator[Solid]:
    """A block on `second`, a rail on `first`."""
    block = (2.4 * thick, 1.6 * thick, 0.8 * thick)
    at = (*joint.on_second, layers[joint.second])
    yield Solid(joint.second, 'box', block, at, joint.axis - joint.angle)
    rail = (size, 0.3 * thick, 0.3 * thick)
    way = rotate((start, 0.0), joint.axis)
    middle = joint.on_first[0] + way[0], joint.on_first[1] + way[1], layers[joint.first]
    yield Solid(joint.first, 'box', rail, middle, joint.axis)


def _discs(joint: Joint, layers: dict[str, float], thick: float) -> Iterator[Solid]:
    """Discs and bars of a higher pair."""
    if not isinstance(joint, HigherPair):
        return
    for (link, at), radius in joint.discs():
        yield Solid(link, 'cylinder', (radius, 0.5 * thick), (*at, layers[link]))
    for (link, at), long, axis, back in joint.bars():
        x, y = rotate((0.5 * thick, 0.0), back)
        place = (at[0] + x, at[1] + y, layers[link])
        yield Solid(link, 'box', (long, thick, 0.5 * thick), place, axis)
