"""A rigid part on springs that moves little: a machine's frame, its housing, a part of it.

Its coordinates are the place x, y of its centre of gravity and, if it has an inertia, its angle,
all from where the mounts carry it alone. A mount at r from the centre of gravity moves by ``B u``,
``B = [[1, 0, -r_y], [0, 1, r_x]]``, so that with ``k = diag(k_x, k_y)``

``K = sum B^T k B``,  ``C = sum B^T c B``,  ``M = diag(m, m, J)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.planar.points import Vector2
from mechanism_sim.vibration.residues import Receptance, receptance
from mechanism_sim.vibration.systems import System


@dataclass(frozen=True)
class Mount:
    """Springs and dampers between a frame and the ground."""

    at: Vector2  #: [m] in the world
    stiffness: Vector2  #: along x and y [N/m]
    damping: Vector2 = (0.0, 0.0)  #: likewise [N s/m]


@dataclass(frozen=True)
class Frame:
    """A rigid part on mounts."""

    mass: float  #: [kg]
    inertia: float | None  #: [kg m^2] about the centre of gravity; None if it cannot turn
    cog: Vector2  #: [m] in the world
    mounts: tuple[Mount, ...]

    @property
    def freedom(self) -> int:
        """Number n of its coordinates: 3, or 2 if it cannot turn."""
        return 2 if self.inertia is None else 3

    @cached_property
    def M(self) -> Array:
        """Mass matrix (n, n)."""
        return np.diag([self.mass, self.mass, self.inertia or 0.0][: self.freedom])

    @cached_property
    def C(self) -> Array:
        """Damping matrix (n, n)."""
        return self._of_mounts([mount.damping for mount in self.mounts])

    @cached_property
    def K(self) -> Array:
        """Stiffness matrix (n, n)."""
        return self._of_mounts([mount.stiffness for mount in self.mounts])

    def _of_mounts(self, values: list[Vector2]) -> Array:
        moved = [self.motion_of(mount.at) for mount in self.mounts]
        return np.asarray(sum(B.T @ np.diag(k) @ B for B, k in zip(moved, values, strict=True)))

    def motion_of(self, at: Vector2) -> Array:
        """B (2, n): how a point at `at` [m] in the world moves with the coordinates."""
        x, y = at[0] - self.cog[0], at[1] - self.cog[1]
        return np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])[:, : self.freedom]

    @cached_property
    def held(self) -> bool:
        """True if the mounts hold it in every direction."""
        scale = np.sqrt(np.diag(self.K))
        if not scale.all():
            return False
        normalised = self.K / np.outer(scale, scale)
        return bool(np.linalg.eigvalsh(normalised)[0] > 1e-9)

    @cached_property
    def receptance(self) -> Receptance:
        """Its poles and residues; it must be held."""
        return receptance(self.M, self.C, self.K)

    @cached_property
    def frequencies(self) -> Array:
        """Natural frequencies without damping (n,) [Hz], the lowest first."""
        return System(self.M, self.C, self.K).modes.frequencies / (2.0 * np.pi)
