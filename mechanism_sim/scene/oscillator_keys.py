"""What a scene file says of frames on springs."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from mechanism_sim.scene.quantities import Inertia, Mass, Part, Position, si

_NOT_NEGATIVE = Field(ge=0.0, allow_inf_nan=False)
_Stiffness = Annotated[float, si('N/m'), _NOT_NEGATIVE]
_Damping = Annotated[float, si('N s/m'), _NOT_NEGATIVE]
_Place = tuple[Position, Position]


class Mount(Part):
    """Springs and dampers between a frame and the ground, along x and y."""

    at: _Place = (0.0, 0.0)
    """Where it is in the world."""
    stiffness: tuple[_Stiffness, _Stiffness]
    """Along x and along y."""
    damping: tuple[_Damping, _Damping] = (0.0, 0.0)
    """Along x and along y."""


class Oscillator(Part):
    """A rigid frame on mounts that the machine shakes."""

    mass: Mass
    """How heavy the frame is."""
    inertia: Inertia | None = None
    """About its centre of gravity; without one it does not turn."""
    cog: _Place = (0.0, 0.0)
    """Centre of gravity in the world."""
    mounts: dict[str, Mount] = Field(min_length=1)
    """Springs and dampers that carry it, by name."""
    joints: list[str] | None = None
    """Whose forces shake it; without, all that the machine does."""
