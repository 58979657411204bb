"""What the engine asks of a relation (bilateral) and of a gap (unilateral), and no more.

Both are functions of the coordinates, written with the poses that `Frames` gives; these carry
their derivatives along, so that Jacobian rows and curvature terms follow by themselves.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.jet import Jet

Array = NDArray[np.float64]


class Relation(Protocol):
    """A bilateral constraint of one joint: every component is kept at zero."""

    @property
    def name(self) -> str:
        """Name of the joint."""

    def values(self, frames: Frames) -> list[Jet]:
        """The components that vanish [m]."""


class Gap(Protocol):
    """A unilateral constraint: a distance that never becomes negative."""

    @property
    def name(self) -> str:
        """Name of the joint."""

    @property
    def restitution(self) -> float:
        """Coefficient of restitution, 0 to 1."""

    @property
    def friction(self) -> float:
        """Coulomb's coefficient of friction; infinite for contacts that never slip."""

    @property
    def hypothesis(self) -> str:
        """What the coefficient of restitution relates: 'newton', 'poisson' or 'stronge'."""

    def value(self, frames: Frames) -> Jet:
        """The distance [m] for small distances; smooth wherever the motion can go.

        Its Jacobian times the normal force is the generalised force of the contact.
        """

    def slip(self, frames: Frames) -> Jet:
        """Tangential velocity [m/s] of the first-named link on the second at the contact.

        Only gradient, rate and curvature are meant: it need not be the rate of anything. The
        positive direction is that of the normal turned by +90 degrees. Asked for only where there
        is friction.
        """

    def normal(self, frames: Frames) -> tuple[Jet, Jet]:
        """Unit vector along which the first-named link presses on the second, when closed."""

    def distance(self, value: Array) -> Array:
        """The distance in metres that belongs to values of `value`."""
