"""Which link of a slider-crank turns fully, how far its slider goes, and where it locks.

The crank turns about the origin; its rod moves a slider along the line y = offset. For the
slider's joint on the side of positive x

    x = crank cos(th2) + sqrt(rod^2 - (offset - crank sin(th2))^2)

[V] 2.3.3, whose slider-crank has no offset.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class SliderCrank:
    """Dimensions of an offset slider-crank."""

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
