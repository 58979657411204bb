"""Four-bars and slider-cranks in closed form, by themselves and as loops of a mechanism.

Links are vectors ``l2 u(th2) + l3 u(th3) - l4 u(th4) - l1 u(0) = 0`` ([V] 2.3.1, second case: two
unknown angles). All functions are vectorised over the crank angle.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mechanism_sim.arrays import Array
from mechanism_sim.planar.mechanism import Joint, Mechanism, Prismatic, Revolute
from mechanism_sim.planar.points import GROUND, Vector2, rotate

Branch = Literal['open', 'crossed']


@dataclass(frozen=True)
class FourBar:
    """Lengths between joints [m] and the branch in which the linkage is assembled."""

    ground: float
    crank: float
    coupler: float
    rocker: float
    branch: Branch = 'open'

    @property
    def lengths(self) -> tuple[float, float, float, float]:
        """Lengths of ground, crank, coupler and rocker [m]."""
        return self.ground, self.crank, self.coupler, self.rocker

    def positions(self, th2: Array) -> tuple[Array, Array]:
        """Angles th3, th4 of coupler and rocker [rad], in (-pi, pi].

        The diagonal from crank pin to rocker pivot and the two links beyond it form a triangle,
        solved by the law of cosines; the branch says on which side of the diagonal the
        coupler-rocker pin lies ([V] 2.3.1). Where the triangle cannot be closed the angles are
        NaN.
        """
        return self.close(self.ground - self.crank * np.cos(th2), -self.crank * np.sin(th2))

    def close(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Angles th3, th4 for which ``l3 u(th3) - l4 u(th4)`` is the vector (x, y) [m]."""
        d = np.hypot(x, y)
        side = 1.0 if self.branch == 'open' else -1.0
        with np.errstate(invalid='ignore', divide='ignore'):
            cosine = (d * d + self.coupler**2 - self.rocker**2) / (2.0 * d * self.coupler)
            th3 = np.arctan2(y, x) + side * np.arccos(cosine)
        th4 = np.arctan2(self.coupler * np.sin(th3) - y, self.coupler * np.cos(th3) - x)
        return np.arctan2(np.sin(th3), np.cos(th3)), th4

    def rates(self, th2: Array, w2: Array, th3: Array, th4: Array) -> tuple[Array, Array]:
        """Angular velocities w3, w4 [rad/s]: the closure differentiated once ([V] 2.4)."""
        s = np.sin(th3 - th4)
        w3 = -self.crank * w2 * np.sin(th2 - th4) / (self.coupler * s)
        w4 = self.crank * w2 * np.sin(th3 - th2) / (self.rocker * s)
        return w3, w4

    def accelerations(
        self, th2: Array, w2: Array, a2: Array, th3: Array, th4: Array, w3: Array, w4: Array
    ) -> tuple[Array, Array]:
        """Angular accelerations a3, a4 [rad/s^2]: the closure differentiated twice ([V] 2.5).

        Projected on the direction of the rocker and of the coupler, one unknown drops out each.
        """
        l2, l3, l4 = self.crank, self.coupler, self.rocker
        s = np.sin(th3 - th4)
        a3 = -(
            l2 * (a2 * np.sin(th2 - th4) + w2**2 * np.cos(th2 - th4))
            + l3 * w3**2 * np.cos(th3 - th4)
            - l4 * w4**2
        ) / (l3 * s)
        a4 = -(
            l2 * (a2 * np.sin(th2 - th3) + w2**2 * np.cos(th2 - th3))
            + l3 * w3**2
            - l4 * w4**2 * np.cos(th4 - th3)
        ) / (l4 * s)
        return a3, a4

    def motion(self, th2: Array, w2: Array, a2: Array) -> tuple[Array, Array, Array]:
        """Angles, rates and accelerations of crank, coupler, rocker, each (3, N)."""
        th3, th4 = self.positions(th2)
        w3, w4 = self.rates(th2, w2, th3, th4)
        a3, a4 = self.accelerations(th2, w2, a2, th3, th4, w3, w4)
        shape = np.shape(th2)
        rows = ((th2, th3, th4), (w2, w3, w4), (a2, a3, a4))
        angle, rate, acceleration = (
            np.array([np.broadcast_to(x, shape) for x in row]) for row in rows
        )
        return angle, rate, acceleration


@dataclass(frozen=True)
class SliderCrank:
    """Dimensions of an offset slider-crank.

    The crank turns about the origin; its rod moves a slider along the line y = offset, [V] 2.3.3.
    For the slider's joint on the side of positive x

        x = crank cos(th2) + sqrt(rod^2 - (offset - crank sin(th2))^2)
    """

    crank: float  #: [m]
    rod: float  #: [m]
    offset: float = 0.0  #: offset of the slider's line to the left of the crank's pivot [m]

    @property
    def turns(self) -> Literal['crank', 'rod', 'both', 'none']:
        """Links that make full turns: the shorter one, if the lengths differ by the offset.

        ``both``: crank and rod are equal and the slider's line passes the pivot. There, and where
        the difference is just the offset, the linkage has a change point.
        """
        spare = abs(self.rod - self.crank) - abs(self.offset)
        if spare < -1e-12 * (self.rod + self.crank + abs(self.offset)):
            return 'none'
        if self.rod == self.crank:
            return 'both'
        return 'crank' if self.crank < self.rod else 'rod'

    def crank_limits(self) -> tuple[float, float]:
        """Least and greatest sine of the crank angle at which the rod reaches the line.

        -1 and 1 for a crank that turns freely. Where the rod only just reaches, it is square to
        the line. NaN if it never reaches.
        """
        low, high = ((self.offset + side * self.rod) / self.crank for side in (-1.0, 1.0))
        if low > 1.0 or high < -1.0:
            return float('nan'), float('nan')
        return max(low, -1.0), min(high, 1.0)

    def dead_points(self) -> tuple[float, float]:
        """Crank angles [rad] at which crank and rod are in line: stretched, folded.

        There the slider turns round, and cannot move the crank. NaN where there is none.
        """
        with np.errstate(invalid='ignore', divide='ignore'):
            stretched = np.arcsin(np.divide(self.offset, self.rod + self.crank))
            folded = np.pi + np.arcsin(np.divide(self.offset, self.rod - self.crank))
        return float(stretched), float(folded)

    @property
    def stroke(self) -> float:
        """Distance of the slider's dead points [m]; NaN unless the crank makes full turns."""
        if self.turns != 'crank':
            return float('nan')
        far, near = (
            np.sqrt((self.rod + side * self.crank) ** 2 - self.offset**2) for side in (1.0, -1.0)
        )
        return float(far - near)

    @property
    def time_ratio(self) -> float:
        """Duration of the slower stroke over that of the faster one at constant crank speed."""
        if self.turns != 'crank':
            return float('nan')
        stretched, folded = self.dead_points()
        longer = np.pi + abs(folded - stretched - np.pi)
        return float(longer / (2.0 * np.pi - longer))

    def transmission_range(self) -> tuple[float, float]:
        """Least and greatest transmission angle [rad] that the linkage comes to."""
        low, high = ((self.offset - self.crank * sine) / self.rod for sine in self.crank_limits())
        least, greatest = np.arccos(np.clip([low, high], -1.0, 1.0)).tolist()
        return least, greatest


@dataclass(frozen=True)
class FourBarLoop:
    """A four-bar within a mechanism, whose links may lie in their frames as they like."""

    linkage: FourBar  #: lengths and branch
    links: tuple[str, str, str]  #: names of crank, coupler and rocker
    turned: tuple[float, float, float]  #: angles in the linkage less those of their frames [rad]

    def on(self, branch: Branch) -> FourBarLoop:
        """Loop on another branch."""
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
                math.dist(a.on(link), b.on(link)) for link, a, b in sides
            )
            if min(ground, crank, coupler, rocker) > 0.0:
                found[links] = FourBar(ground, crank, coupler, rocker)
    return found


def whole_four_bar(mechanism: Mechanism, crank: str) -> FourBarLoop | None:
    """The loop of a mechanism that is a four-bar and nothing else; None if it is not.

    Parameters
    ----------
    mechanism : mechanism without clearance
    crank : link that must be its crank
    """
    if len(mechanism.bodies) != 3 or len(mechanism.joints) != 4:
        return None
    for links, joints in _loops(mechanism, [crank]):
        if links[0] != crank or not all(isinstance(j, Revolute) for j in joints):
            continue
        ends = zip((GROUND, *links), (joints[3], *joints[:3]), joints, strict=True)
        frame, first, second, last = ((a.on(x), b.on(x)) for x, a, b in ends)
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
                math.dist(pivot.on(crank), pin.on(crank)),
                math.dist(pin.on(rod), end.on(rod)),
            )
            if min(lengths) > 0.0:
                offset = _offset(guide, end.on(slider), pivot.on(GROUND))
                found[crank, rod, slider] = SliderCrank(*lengths, offset)
    return found


def _loops(mechanism: Mechanism, driven: Collection[str]) -> Iterator[Loop]:
    """Every loop of the ground and three links, one way round."""
    order = [body.name for body in mechanism.bodies]
    order.sort(key=lambda link: link not in driven)
    pairs = Counter(frozenset((j.first, j.second)) for j in mechanism.joints)
    only = {p: j for j in mechanism.joints if pairs[p := frozenset((j.first, j.second))] == 1}

    def beside(link: str, places: Iterable[int]) -> list[tuple[int, Joint]]:
        """Links that a single joint joins to one, by their place in the order."""
        met = ((k, only.get(frozenset((link, order[k])))) for k in places)
        return [(k, joint) for k, joint in met if joint is not None]

    every = range(len(order))
    for k, a in beside(GROUND, every):
        for m, b in beside(order[k], every):
            for n, d in beside(GROUND, every[k + 1 :]):
                c = only.get(frozenset((order[m], order[n])))
                if c is not None:
                    yield (order[k], order[m], order[n]), (a, b, c, d)


def _offset(guide: Prismatic, pin: Vector2, pivot: Vector2) -> float:
    """Offset of the slider pin's line to the left of the pivot, along the guide's axis [m]."""
    if guide.first == GROUND:
        turned, axis = guide.angle, guide.axis
    else:
        turned, axis = -guide.angle, guide.axis - guide.angle
    slider = guide.across(GROUND)[1][1]
    arm = rotate((pin[0] - slider[0], pin[1] - slider[1]), turned)
    away = np.array(guide.on(GROUND)) + arm - pivot
    return float(away @ (-math.sin(axis), math.cos(axis)))
