"""A rigid part on springs that moves little: a machine's frame, its housing, a part of it.

Its coordinates are the place x, y of its centre of gravity and, if it has an inertia, its angle,
all from where the mounts carry it alone. A mount at r from the centre of gravity moves by ``B u``,
``B = [[1, 0, -r_y], [0, 1, r_x]]``, so that with ``k = diag(k_x, k_y)``

``K = sum B^T k B``,  ``C = sum B^T c B``,  ``M = diag(m, m, J)``.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from mechanism_sim.arrays import Array
from mechanism_sim.keys.quantities import NOT_NEGATIVE, Inertia, Mass, Part, Position, si
from mechanism_sim.planar.points import Vector2
from mechanism_sim.vibration.residues import Receptance, receptance
from mechanism_sim.vibration.systems import LinearSystem

_Stiffness = Annotated[float, si('N/m'), NOT_NEGATIVE]
_Damping = Annotated[float, si('N s/m'), NOT_NEGATIVE]
_Place = tuple[Position, Position]

_FASTEST = 1e6  # largest plausible natural frequency of a frame [Hz]


class Mount(Part):
    """Springs and dampers between a frame and the ground, along x and y."""

    at: _Place = (0.0, 0.0)
    """Position in the fixed frame."""
    stiffness: tuple[_Stiffness, _Stiffness]
    """Along x and along y."""
    damping: tuple[_Damping, _Damping] = (0.0, 0.0)
    """Along x and along y."""


class Frame(Part):
    """A rigid frame on mounts, excited by the machine."""

    mass: Mass
    """Mass of the frame."""
    inertia: Inertia | None = None
    """About its centre of gravity; without one it does not turn."""
    cog: _Place = (0.0, 0.0)
    """Centre of gravity in the fixed frame."""
    mounts: dict[str, Mount] = Field(min_length=1)
    """Springs and dampers that carry it, by name."""
    joints: list[str] | None = None
    """Joints whose forces excite it; all forces of the machine on its frame if not given."""

    @model_validator(mode='after')
    def _is_held(self) -> Frame:
        if not self.held:
            raise ValueError(
                'has mounts that do not hold it in every direction: give each direction a '
                'stiffness, and a frame that can turn two mounts apart, or leave out its inertia'
            )
        if self.frequencies[-1] > _FASTEST:
            raise ValueError(
                f'has a highest natural frequency of {self.frequencies[-1]:.3g} Hz, above '
                f'{_FASTEST:g} Hz: check mass, inertia and stiffness'
            )
        return self

    @property
    def freedom(self) -> int:
        """Number n of its coordinates: 3, or 2 if it cannot turn."""
        return 2 if self.inertia is None else 3

    @property
    def M(self) -> Array:
        """Mass matrix (n, n)."""
        return np.diag([self.mass, self.mass, self.inertia or 0.0][: self.freedom])

    @property
    def C(self) -> Array:
        """Damping matrix (n, n)."""
        return self._of_mounts([mount.damping for mount in self.mounts.values()])

    @property
    def K(self) -> Array:
        """Stiffness matrix (n, n)."""
        return self._of_mounts([mount.stiffness for mount in self.mounts.values()])

    def _of_mounts(self, values: list[Vector2]) -> Array:
        moved = [self.motion_of(mount.at) for mount in self.mounts.values()]
        return np.asarray(sum(B.T @ np.diag(k) @ B for B, k in zip(moved, values, strict=True)))

    def motion_of(self, at: Vector2) -> Array:
        """B (2, n): how a point at `at` [m] in the world moves with the coordinates."""
        x, y = at[0] - self.cog[0], at[1] - self.cog[1]
        return np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])[:, : self.freedom]

    @property
    def held(self) -> bool:
        """True if the mounts hold it in every direction."""
        scale = np.sqrt(np.diag(self.K))
        if not scale.all():
            return False
        normalised = self.K / np.outer(scale, scale)
        return bool(np.linalg.eigvalsh(normalised)[0] > 1e-9)

    @property
    def receptance(self) -> Receptance:
        """Receptance of the frame by poles and residues; the frame must be held."""
        return receptance(self.M, self.C, self.K)

    @property
    def frequencies(self) -> Array:
        """Natural frequencies without damping (n,) [Hz], the lowest first."""
        return LinearSystem(self.M, self.C, self.K).modes.frequencies / (2.0 * np.pi)
