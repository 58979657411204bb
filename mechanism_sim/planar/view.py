"""Views of a machine for a kind of joint: for readings, drawings and charts.

A joint tells in its own file what there is to read of it, what it looks like and which of its
readings are worth a chart; sensors, nodes, drawings and pages only ask.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, Protocol, TypeAlias

import numpy as np

from mechanism_sim.arrays import Array, ComplexArray, Mask
from mechanism_sim.planar.points import LinkPoint, Vector2

Kind = Literal[
    'frame', 'belt', 'wheel', 'cam', 'rail', 'support', 'link', 'slot', 'slider', 'bushing', 'pin',
    'cog', 'point', 'drive',
]  # fmt: skip
"""Kinds of shapes, in the order in which they are painted."""
Side: TypeAlias = Literal['left', 'right']
"""Side of a higher pair's closure on which there is a wall."""


class Trajectory(NamedTuple):
    """An angle or a displacement at N instants, with its rates."""

    position: Array  #: (N,) [rad] without the whole turns of `turned`, or [m]
    velocity: Array  #: (N,) [rad/s] or [m/s]
    acceleration: Array  #: (N,) [rad/s^2] or [m/s^2]
    turned: Array  #: (N,) [rad] whole turns, kept apart so that no digits are lost

    @property
    def total(self) -> Array:
        """Position (N,) with all its turns [rad] or [m]."""
        return self.position + self.turned


class Told:
    """Annotation of a field of a reading as quantity ``FIELD.JOINT``.

    Parameters
    ----------
    units : SI units; two, rad and m in this order, for a link that rotates or slides
    words : description of the quantity
    slides : link that decides between two units: ``first`` or ``second``
    difference : True if it is a difference of lengths of the machine's size, with their rounding
    repeats : True if coordinates contain the same information
    """

    def __init__(
        self,
        units: str,
        words: str,
        slides: str = 'second',
        *,
        difference: bool = False,
        repeats: bool = False,
    ) -> None:
        self.units = tuple(units.split(' or '))
        self.words, self.slides = words, slides
        self.difference, self.repeats = difference, repeats


class ToothLoad(NamedTuple):
    """A force on a shaft where teeth touch, in space; N instants."""

    link: str  #: link that rotates with the shaft
    force: Array  #: (3, N) [N] along x and y of the world, and along the shaft towards the reader
    arm: Array  #: (3, N) [m] from the middle of the shaft, in the plane of the machine
    in_plane: bool  #: whether planar reactions already contain its x and y

    @property
    def components(self) -> dict[str, Array]:
        """Tangential, counterclockwise about the shaft; radial, towards it; axial [N]."""
        x, y = self.arm[:2] / np.hypot(*self.arm[:2])
        fx, fy, axial = self.force
        return dict(zip(TOOTH_PARTS, (x * fy - y * fx, -(x * fx + y * fy), axial), strict=True))


TOOTH_PARTS = 'tangential', 'radial', 'axial'
"""Components of a `ToothLoad`."""


class PairView(Protocol):
    """A joint at N instants of a machine."""

    def trajectory(self, link: str, at: Vector2 | None = None) -> Trajectory:
        """Trajectory of a link: its displacement if a guide carries it, else its angle."""

    def turning(self, link: str, at: Vector2 | None = None) -> Trajectory:
        """Angle of a link in the world, with its rates; of an elastic one at a point of it."""

    def chord(self, link: str, a: Vector2, b: Vector2) -> Trajectory:
        """Rotation of a link by the line from one point of it to another."""

    def place(self, link: str, at: Vector2) -> Array:
        """World coordinates (2, N) [m] of a point of a link."""

    def path(self, link: str, at: Vector2) -> Array:
        """A point of a link in the world with its velocity and acceleration, (3, 2, N) [m, s]."""

    @property
    def count(self) -> int:
        """Number N of instants."""

    @property
    def force(self) -> Array:
        """Force (2, N) [N] of the first-named on the second-named link; NaN if not known."""

    @property
    def moment(self) -> Array:
        """Moment (N,) [N m] of the first-named link, about the joint's point on the second."""

    @property
    def friction_loss(self) -> Array:
        """Power (N,) lost to friction in the ideal joint [W]."""

    def moment_on_first(self, centre: Array) -> Array:
        """Moment (N,) [N m] of the second-named on the first-named link, about points (2, N)."""

    def gap(self, side: Side | None = None) -> tuple[Array, Mask] | None:
        """Distance (N,) [m] and closed mask (N,) of the joint's gap at a side."""


SLOT = 0.75
"""Half width of a drawn slot, in units of the drawing's symbols."""


def complex_of(points: Array) -> ComplexArray:
    """Points (..., 2) as complex numbers."""
    return np.asarray(points @ (1.0, 1.0j))


def points_of(numbers: ComplexArray) -> Array:
    """Complex numbers as points (..., 2)."""
    return np.stack([numbers.real, numbers.imag], axis=-1)


def circle(radius: float, centre: Vector2 | Array = (0.0, 0.0), points: int = 96) -> Array:
    """A closed curve (points, 2) [m] to be drawn, the first point not repeated."""
    turn = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)
    return np.asarray(centre) + radius * points_of(np.exp(1j * turn))


class Draft(Protocol):
    """A drawing of a mechanism at N instants of its motion, to which joints add their shapes."""

    symbol: float
    """Size of a joint [m]."""

    def at(self, place: LinkPoint) -> Array:
        """A point of a link in the world (2, N) [m]."""

    def within(self, link: str, place: LinkPoint) -> Array:
        """A point of any link in the frame of this one (2, N) [m]."""

    def turned(self, link: str) -> float:
        """Angle of a link in the world at the first instant [rad]."""

    def add(self, kind: Kind, link: str, *curves: Array, size: float = 0.0) -> None:
        """A shape of a link, which gives it a body; of wheels the largest are painted first.

        Wheels, cams and sliders are painted as their curves are; of other kinds curves are what
        their builder in `export.shapes` makes a shape of, such as the ends of a straight slot.

        Parameters
        ----------
        curves : (k, 2) [m] each, in the frame of the link, closed; points within two are a hole
        """

    def pin(self, place: LinkPoint, label: str) -> None:
        """A pin, to which its link reaches."""

    def reach(self, place: LinkPoint) -> None:
        """Extend the outline of a link to a point."""

    def rail(self, kind: Kind, place: LinkPoint, axis: float, runner: Array) -> None:
        """Line of a link, long enough for points (2, N) sliding on it, in the link's frame."""

    def wall(self, link: str, start: Vector2, end: Vector2) -> None:
        """A wall of a link, solid to the left of the way from start to end [m]."""

    def string(self, ends: tuple[LinkPoint, LinkPoint], radii: tuple[float, float]) -> None:
        """A straight line from a point of a link to one of another, at any pose.

        Parameters
        ----------
        radii : [m] radii of discs tangent there, positive for discs on its left
        """

    def first(self, name: str) -> bool:
        """True if nothing of that name has been drawn yet."""
