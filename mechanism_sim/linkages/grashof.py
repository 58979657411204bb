"""Grashof's criterion: full turns, swing angles and locking positions of four-bars.

The diagonal between the far ends of two neighbouring links closes a triangle with the other two
links. It is the longest or shortest where those neighbours are in line, so all limits come from
the law of cosines at the two extreme triangles, stretched and folded. Lengths are arrays of any
shape, in the order of `FourBar.lengths`: ground, crank, coupler, rocker.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.linkages.four_bar import FourBar

#: the part of all lengths together below which a difference of lengths counts as zero
TOLERANCE = 1e-12

#: names of Grashof linkages whose shortest link is ground, crank, coupler or rocker
_GRASHOF_NAMES = ('double-crank', 'crank-rocker', 'double-rocker', 'rocker-crank')


_AT = 1e-3  # [rad] nearer to a change point than this its branches are not told apart
_AHEAD = 0.05  # [rad] from there they are


class AngleRange(NamedTuple):
    """Angles [rad] from the least to the greatest."""

    least: float
    greatest: float

    @property
    def width(self) -> float:
        """Width of the range [rad]."""
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
    names = np.array(_GRASHOF_NAMES)[lengths.argmin(axis=0)]
    names = np.where(room < 0.0, 'triple-rocker', names)
    names = np.where(np.abs(room) <= TOLERANCE * total, 'change point', names)
    spare = total - 2.0 * lengths.max(axis=0)
    return np.where(spare <= TOLERANCE * total, 'no linkage', names)


def full_turns(lengths: ArrayLike) -> Mask:
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
    """Swing angle of a link between its limits [rad]; 2 pi without limits."""
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
