"""Transmission angles between two links of two joints each."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.planar.mechanism import Joint, Prismatic, Revolute
from mechanism_sim.planar.points import GROUND, LinkPoint
from mechanism_sim.results.quantities.motion import tracks
from mechanism_sim.results.quantity import Quantity, Shown, View
from mechanism_sim.scene import Machine


def of_transmission(machine: Machine) -> Iterator[Quantity]:
    """``transmission_angle.JOINT`` of pins between two links that have one more joint each.

    The angle between both links, 0 to 90 deg; of a slider it is that to the normal of its guide
    (Alt 1932; Balli and Chand, Mech. Mach. Theory 37 (2002) 175-195).
    """
    joints = machine.plan.joints
    for joint in joints:
        if isinstance(joint, Revolute) and GROUND not in (joint.first, joint.second):
            lines = [_line(joints, joint, link) for link in (joint.first, joint.second)]
            if all(lines):
                yield Quantity(
                    f'transmission_angle.{joint.name}', 'rad',
                    f'transmission angle in {joint.name}', joint.name,
                    _angle(machine, [place for line in lines for place in line]), Shown.ASKED,
                )  # fmt: skip


def _line(joints: tuple[Joint, ...], pin: Revolute, link: str) -> tuple[LinkPoint, ...]:
    """Two points of the line of a link from a pin to its only other joint, if it has one only."""
    others = [x for x in joints if link in (x.first, x.second) and x is not pin]
    if len(others) != 1:
        return ()
    (other,) = others
    if isinstance(other, Prismatic):
        (x, y), axis = other.on_first, other.axis
        normal = x - float(np.sin(axis)), y + float(np.cos(axis))
        return (other.first, other.on_first), (other.first, normal)
    if not isinstance(other, Revolute):
        return ()
    ends = [x.on(link) for x in (pin, other)]
    return ((link, ends[0]), (link, ends[1])) if ends[0] != ends[1] else ()


def _angle(machine: Machine, places: list[LinkPoint]) -> Callable[[View], Array]:
    track = tracks(machine.mechanism, places)

    def angle(view: View) -> Array:
        a, b, c, d = track(view)[:, 0]
        (x, y), (u, v) = b - a, d - c
        return np.asarray(np.arctan2(np.abs(x * v - y * u), np.abs(x * u + y * v)))

    return angle
