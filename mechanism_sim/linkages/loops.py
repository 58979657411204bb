"""Four-bars and slider-cranks within a mechanism: its loops of four links, by their dimensions."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise, permutations

import numpy as np
from numpy.typing import ArrayLike

from mechanism_sim.arrays import Array
from mechanism_sim.linkages.four_bar import Branch, FourBar, SliderCrank
from mechanism_sim.planar.mechanism import Joint, Mechanism, Prismatic, Revolute
from mechanism_sim.planar.points import GROUND, Vector2, rotate


@dataclass(frozen=True)
class FourBarLoop:
    """A four-bar within a mechanism, whose links may lie in their frames as they like.

    Attributes
    ----------
    linkage : lengths and branch
    links : names of crank, coupler and rocker
    turned : their angles in the linkage less those of their frames [rad]
    """

    linkage: FourBar
    links: tuple[str, str, str]
    turned: tuple[float, float, float]

    def on(self, branch: Branch) -> FourBarLoop:
        """Its loop on a branch."""
        return replace(self, linkage=replace(self.linkage, branch=branch))

    def positions(self, crank: ArrayLike) -> tuple[Array, Array]:
        """Angles of the frames of coupler and rocker, by that of the crank [rad]."""
        th3, th4 = self.linkage.positions(np.asarray(crank) + self.turned[0])
        return th3 - self.turned[1], th4 - self.turned[2]

    def motion(self, crank: Array, rate: Array, acceleration: Array) -> tuple[Array, Array, Array]:
        """Angles of the frames, rates and accelerations of crank, coupler, rocker, each (3, N)."""
        q, v, a = self.linkage.motion(crank + self.turned[0], rate, acceleration)
        q -= np.reshape(self.turned, (3,) + (1,) * (q.ndim - 1))
        q[0] = crank
        return q, v, a


Loop = tuple[tuple[str, str, str], tuple[Joint, Joint, Joint, Joint]]


def four_bars(
    mechanism: Mechanism, driven: Collection[str] = ()
) -> dict[tuple[str, str, str], FourBar]:
    """Loops of four revolute joints through the ground: crank, coupler, rocker and their lengths.

    The crank is a `driven` link if one of the two on the ground is, else the first of `bodies`.
    The branch is not told: every linkage is given in the open one.
    """
    found = {}
    for links, joints in _loops(mechanism, driven):
        if all(isinstance(j, Revolute) for j in joints):
            # every link lies between two joints of the loop, the ground between last and first
            sides = zip((GROUND, *links), (joints[-1], *joints[:-1]), joints, strict=True)
            ground, crank, coupler, rocker = (
                math.dist(_end(a, link), _end(b, link)) for link, a, b in sides
            )
            if min(ground, crank, coupler, rocker) > 0.0:
                found[links] = FourBar(ground, crank, coupler, rocker)
    return found


def whole_four_bar(mechanism: Mechanism, crank: str) -> FourBarLoop | None:
    """The loop of a mechanism that is a four-bar and nothing else; None if it is not.

    Parameters
    ----------
    mechanism : without clearance
    crank : the link that is to be its crank
    """
    if len(mechanism.bodies) != 3 or len(mechanism.joints) != 4:
        return None
    for links, joints in _loops(mechanism, [crank]):
        if links[0] != crank or not all(isinstance(j, Revolute) for j in joints):
            continue
        ends = zip((GROUND, *links), (joints[3], *joints[:3]), joints, strict=True)
        frame, first, second, last = ((_end(a, x), _end(b, x)) for x, a, b in ends)
        # the book's way round: from the ground's first joint to its last, and up the rocker
        sides = [complex(*b) - complex(*a) for a, b in (frame[::-1], first, second, last[::-1])]
        if all(sides):
            lengths, angles = np.abs(sides).tolist(), np.angle(sides)
            return FourBarLoop(FourBar(*lengths), links, tuple(angles[1:] - angles[0]))
    return None


def slider_cranks(
    mechanism: Mechanism, driven: Collection[str] = ()
) -> dict[tuple[str, str, str], SliderCrank]:
    """Loops of three revolute joints and a guide on the ground: crank, rod, slider, dimensions.

    The crank turns on the ground, whichever link is driven.
    """
    found = {}
    for links, joints in _loops(mechanism, driven):
        for (crank, rod, slider), (pivot, pin, end, guide) in (
            (links, joints), (links[::-1], joints[::-1])
        ):  # fmt: skip
            turning = all(isinstance(j, Revolute) for j in (pivot, pin, end))
            if not turning or not isinstance(guide, Prismatic):
                continue
            lengths = (
                math.dist(_end(pivot, crank), _end(pin, crank)),
                math.dist(_end(pin, rod), _end(end, rod)),
            )
            if min(lengths) > 0.0:
                offset = _offset(guide, _end(end, slider), _end(pivot, GROUND))
                found[crank, rod, slider] = SliderCrank(*lengths, offset)
    return found


def _loops(mechanism: Mechanism, driven: Collection[str]) -> Iterator[Loop]:
    """Every loop of the ground and three links, one way round."""
    order = [body.name for body in mechanism.bodies]
    order.sort(key=lambda link: link not in driven)
    for links in permutations(order, 3):
        if order.index(links[0]) > order.index(links[2]):
            continue
        ring = (GROUND, *links, GROUND)
        between = [
            [j for j in mechanism.joints if {j.first, j.second} == {a, b}]
            for a, b in pairwise(ring)
        ]
        if all(len(js) == 1 for js in between):
            a, b, c, d = (js[0] for js in between)
            yield links, (a, b, c, d)


def _end(joint: Joint, link: str) -> Vector2:
    """Where a joint is on a link [m]."""
    return joint.on_first if joint.first == link else joint.on_second


def _offset(guide: Prismatic, pin: Vector2, pivot: Vector2) -> float:
    """How far the pin of a slider runs to the left of the pivot, along the guide's axis [m]."""
    if guide.first == GROUND:
        turned, axis = guide.angle, guide.axis
    else:
        turned, axis = -guide.angle, guide.axis - guide.angle
    slider = _end(guide, guide.second if guide.first == GROUND else guide.first)
    arm = rotate((pin[0] - slider[0], pin[1] - slider[1]), turned)
    away = np.array(_end(guide, GROUND)) + arm - pivot
    return float(away @ (-math.sin(axis), math.cos(axis)))
