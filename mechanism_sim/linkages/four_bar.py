"""The ideal four-bar linkage and slider-crank in closed form: positions, motion, limits.

Links are vectors ``l2 u(th2) + l3 u(th3) - l4 u(th4) - l1 u(0) = 0`` ([V] 2.3.1, second case: two
unknown angles). All functions are vectorised over the crank angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.arrays import Array

#: the part of all lengths together below which a difference of lengths counts as zero
TOLERANCE = 1e-12

#: what a linkage of Grashof's is called when ground, crank, coupler or rocker is its shortest link
GRASHOF_NAMES = ('double-crank', 'crank-rocker', 'double-rocker', 'rocker-crank')


_AT = 1e-3  # [rad] nearer to a change point than this its branches are not told apart
_AHEAD = 0.05  # [rad] from there they are
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
        """Of ground, crank, coupler and rocker [m]."""
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
    offset: float = 0.0  #: [m] of the slider's line to the left of the crank's pivot, along +x

    @property
    def turns(self) -> Literal['crank', 'rod', 'both', 'none']:
        """Which link makes full turns: the shorter one, if the lengths differ by the offset.

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


class AngleRange(NamedTuple):
    """Angles [rad] from the least to the greatest."""

    least: float
    greatest: float

    @property
    def width(self) -> float:
        """From end to end [rad]."""
        return self.greatest - self.least


def excess(lengths: ArrayLike) -> Array:
    """Sum of the two middle lengths less that of the shortest and the longest [m], [V] 1.2.

    Positive: some link makes full turns; zero: a change point; negative: none does. Lengths
    (4, ...) give a result (...).
    """
    a = np.sort(np.asarray(lengths, np.float64), axis=0)
    return np.asarray((a[1] + a[2]) - (a[0] + a[3]))


def classify(lengths: ArrayLike) -> NDArray[np.str_]:
    """Name of the motion of four-bars.

    Parameters
    ----------
    lengths : (4, ...) [m] of ground, crank, coupler, rocker

    Returns
    -------
    (...) ``double-crank``, ``crank-rocker``, ``double-rocker`` (its coupler makes full turns) or
    ``rocker-crank`` where Grashof's condition holds; ``triple-rocker`` where it does not;
    ``change point`` where all links can come to lie in one line; ``no linkage`` where one link is
    not shorter than the other three together.
    """
    lengths = np.asarray(lengths, np.float64)
    total, room = lengths.sum(axis=0), excess(lengths)
    names = np.array(GRASHOF_NAMES)[lengths.argmin(axis=0)]
    names = np.where(room < 0.0, 'triple-rocker', names)
    names = np.where(np.abs(room) <= TOLERANCE * total, 'change point', names)
    spare = total - 2.0 * lengths.max(axis=0)
    return np.where(spare <= TOLERANCE * total, 'no linkage', names)


def full_turns(lengths: ArrayLike) -> NDArray[np.bool_]:
    """True if crank, coupler and rocker make full turns against the ground, (3, ...).

    The shortest link of a Grashof linkage turns fully against all others, which only swing
    against one another. A change point does not count: there the linkage may go on either way,
    and no finite force holds it.
    """
    names = classify(lengths)
    turning = {'crank': 'crank-rocker', 'coupler': 'double-rocker', 'rocker': 'rocker-crank'}
    return np.array([(names == 'double-crank') | (names == own) for own in turning.values()])


def limits(fixed: ArrayLike, turning: ArrayLike, near: ArrayLike, far: ArrayLike) -> Array:
    """Between which angles a link can stand against its neighbour: of a crank, its limits.

    Parameters
    ----------
    fixed, turning : lengths [m] of two neighbours
    near, far : lengths of the links at their free ends

    Returns
    -------
    (2, ...) least and greatest absolute angle [rad] between the directions from the common joint:
    at the least the other two links are folded, at the greatest stretched. Zero and pi where that
    limits nothing. NaN where no angle can be assembled.
    """
    fixed, turning, near, far = (np.asarray(x, np.float64) for x in (fixed, turning, near, far))
    margin = TOLERANCE * (fixed + turning + near + far)
    squares, product = fixed**2 + turning**2, 2.0 * fixed * turning
    closest, widest = np.abs(fixed - turning), fixed + turning
    folded, stretched = np.abs(near - far), near + far
    cosines = np.array([(squares - folded**2) / product, (squares - stretched**2) / product])
    found = np.arccos(np.clip(cosines, -1.0, 1.0))
    found[0] = np.where(folded <= closest + margin, 0.0, found[0])
    found[1] = np.where(stretched >= widest - margin, np.pi, found[1])
    apart = (closest > stretched + margin) | (widest < folded - margin)
    return np.where(apart, np.nan, found)


def crank_turns(linkage: FourBar) -> bool:
    """True if the crank can make a full turn; at a change point it does not count."""
    return bool(full_turns(linkage.lengths)[0])


def crank_limits(linkage: FourBar) -> AngleRange:
    """Least and greatest absolute crank angle [rad]; 0 and pi for one that turns freely.

    The crank swings between a and b and, mirrored, between -b and -a: through 180 degrees if b is
    pi, through zero if a is zero.
    """
    ground, crank, coupler, rocker = linkage.lengths
    return AngleRange(*limits(ground, crank, coupler, rocker).tolist())


def rocker_limits(linkage: FourBar) -> AngleRange:
    """Least and greatest absolute rocker angle th4 [rad], as `crank_limits`."""
    ground, crank, coupler, rocker = linkage.lengths
    low, high = limits(ground, rocker, coupler, crank).tolist()
    return AngleRange(np.pi - high, np.pi - low)


def swing(limits: AngleRange) -> float:
    """How far a link goes to and fro between its limits [rad]; 2 pi if it has none."""
    least, greatest = limits
    if least == 0.0:
        return 2.0 * greatest
    return 2.0 * (np.pi - least) if greatest == np.pi else greatest - least


def change_points(linkage: FourBar) -> tuple[float, ...]:
    """Crank angles, 0 or pi, at which all links lie in one line; none but at a change point."""
    ground, crank, coupler, rocker = linkage.lengths
    margin = TOLERANCE * sum(linkage.lengths)
    spans = ((0.0, abs(ground - crank)), (np.pi, ground + crank))
    lines = (coupler + rocker, abs(coupler - rocker))
    return tuple(th2 for th2, d in spans if any(abs(d - line) <= margin for line in lines))


def beside_change_point(linkage: FourBar, th2: float, speed: float) -> float:
    """A crank angle [rad], or, at a change point, one where its branches can be told apart."""
    lines = change_points(linkage)
    near = any(abs(np.angle(np.exp(1j * (th2 - line)))) < _AT for line in lines)
    return th2 + float(np.copysign(_AHEAD, speed)) if near else th2


def dead_points(linkage: FourBar) -> tuple[float, float]:
    """Crank angles th2 [rad] at which crank and coupler are in line: stretched, folded.

    There the rocker turns round, and cannot move the crank. NaN where the linkage has none.
    """
    ground, crank, coupler, rocker = linkage.lengths
    side = 1.0 if linkage.branch == 'open' else -1.0
    found = []
    # the pin of coupler and rocker lies at `reach` along th3 from the crank's pivot
    for reach, turned in ((coupler + crank, 0.0), (coupler - crank, np.pi)):
        with np.errstate(invalid='ignore', divide='ignore'):
            cosine = np.divide(ground**2 + reach**2 - rocker**2, 2.0 * ground * reach)
            th3 = side * np.arccos(cosine)
        th2 = th3 + turned
        found.append(float(np.arctan2(np.sin(th2), np.cos(th2))))
    return found[0], found[1]


def time_ratio(linkage: FourBar) -> float:
    """Duration of the rocker's slower stroke over that of the faster one at constant crank speed.

    NaN but for a crank-rocker, whose rocker goes once to and fro in a turn of the crank.
    """
    if classify(linkage.lengths) != 'crank-rocker':
        return float('nan')
    stretched, folded = dead_points(linkage)
    stroke = (stretched - folded) % (2.0 * np.pi)
    longer = max(stroke, 2.0 * np.pi - stroke)
    return longer / (2.0 * np.pi - longer)


def transmission_range(linkage: FourBar) -> AngleRange:
    """Least and greatest transmission angle [rad] that the linkage comes to."""
    ground, crank, coupler, rocker = linkage.lengths
    return AngleRange(*limits(coupler, rocker, crank, ground).tolist())
