"""Curves that points of the coupler of a four-bar trace ([V] 2.3.7), and who else traces them.

With a coupler point at m from the crank pin and n from the rocker pin (complex, in the coupler's
frame), z in the plane and the ground l1,

    2 Re(conj(z) m e^(i th3)) = |z|^2 + |m|^2 - l2^2
    2 Re((conj(z) - l1) n e^(i th3)) = |z - l1|^2 + |n|^2 - l4^2

Both are linear in cosine and sine of th3, whose squares add to one: a curve of the sixth degree.
Two other four-bars trace it too (Roberts, Chebyshev).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.grashof import crank_limits
from mechanism_sim.planar.points import Vector2

Array = NDArray[np.float64]


def coupler_point(linkage: FourBar, point: Vector2, th2: Array) -> Array:
    """Places (2, N) [m] of a point of the coupler at crank angles (N,) [rad], [V] 2.69.

    Parameters
    ----------
    point : [m] in the coupler's frame, x from crank pin to rocker pin
    """
    th3, _ = linkage.positions(th2)
    cosine, sine = np.cos(th3), np.sin(th3)
    x, y = point
    return np.array(
        [
            linkage.crank * np.cos(th2) + cosine * x - sine * y,
            linkage.crank * np.sin(th2) + sine * x + cosine * y,
        ]
    )


def coupler_curve(
    linkage: FourBar, point: Vector2, samples: int = 361, below: bool = False
) -> Array:
    """The closed curve (2, N) [m] that a point of the coupler traces.

    Over a turn of the crank; where it cannot turn, from limit to limit and, in the other branch,
    back, closely spaced at the limits, where the point is fast for the crank. A crank with limits
    on both sides has two circuits: `below` takes that of crank angles below zero.
    """
    least, greatest = crank_limits(linkage)
    phase = np.linspace(0.0, 2.0 * np.pi, samples)
    if (least, greatest) == (0.0, np.pi):
        return coupler_point(linkage, point, phase)
    if greatest == np.pi:
        greatest = 2.0 * np.pi - least
    elif least == 0.0:
        least = -greatest
    # a little inside of the limits, where rounding could leave the triangle open
    middle, half = 0.5 * (least + greatest), 0.5 * (greatest - least) * (1.0 - 1e-14)
    th2 = (middle - half * np.cos(phase)) * (-1.0 if below else 1.0)
    other = replace(linkage, branch='crossed' if linkage.branch == 'open' else 'open')
    forth, back = (coupler_point(f, point, th2) for f in (linkage, other))
    return np.where(phase <= np.pi, forth, back)


@dataclass(frozen=True)
class Cognate:
    """A four-bar somewhere in the plane, with a point of its coupler."""

    linkage: FourBar
    point: Vector2  #: [m] in the coupler's frame
    pivot: Vector2  #: [m] of the crank
    angle: float  #: [rad] from crank pivot to rocker pivot

    def trace(self, th2: Array) -> Array:
        """Places (2, N) [m] of the point at crank angles (N,) [rad] from the line of pivots."""
        x, y = coupler_point(self.linkage, self.point, th2)
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        px, py = self.pivot
        return np.array([px + cosine * x - sine * y, py + sine * x + cosine * y])


def cognates(linkage: FourBar, point: Vector2) -> tuple[Cognate, Cognate]:
    """The two other four-bars that trace the same coupler curve (Roberts, Chebyshev).

    In complex numbers the coupler point lies at the part `shape` of the coupler. Parallelograms
    to the crank, or to the rocker, lead to the cognates: the linkage scaled and turned by `shape`
    about the crank's pivot with crank and coupler exchanged, and by ``shape - 1`` about the
    rocker's with coupler, rocker and crank for crank, coupler and rocker. The cranks of both turn
    as the coupler does, from their own lines of pivots, the couplers as crank and rocker.

    Both are given in the open branch. Which branch follows the linkage can change where their
    crank has a limit; both branches together trace the whole curve.

    Raises
    ------
    ValueError
        If the point is a joint of the coupler: it traces a circle.
    """
    ground, crank, coupler, rocker = linkage.lengths
    shape = complex(*point) / coupler
    if shape in (0.0, 1.0):
        raise ValueError('the point is a joint of the coupler: it traces a circle')
    return (
        _cognate(shape, (ground, coupler, crank, rocker), crank / shape, 0.0),
        _cognate(shape - 1.0, (ground, coupler, rocker, crank), rocker / (1.0 - shape), ground),
    )


def _cognate(
    factor: complex, lengths: tuple[float, float, float, float], point: complex, pivot: float
) -> Cognate:
    """A linkage of lengths and a point of its coupler, scaled; its pivot on the old ground."""
    scale = abs(factor)
    ground, crank, coupler, rocker = (scale * x for x in lengths)
    return Cognate(
        FourBar(ground, crank, coupler, rocker),
        (scale * point.real, scale * point.imag),
        (pivot, 0.0),
        float(np.angle(factor)),
    )
