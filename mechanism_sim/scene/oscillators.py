"""Frames on springs that a machine shakes: what a scene file says of them, and what they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.keys.quantities import NOT_NEGATIVE, Inertia, Mass, Part, Position, si
from mechanism_sim.vibration import frame
from mechanism_sim.vibration.frame import Frame

_Stiffness = Annotated[float, si('N/m'), NOT_NEGATIVE]
_Damping = Annotated[float, si('N s/m'), NOT_NEGATIVE]
_Place = tuple[Position, Position]

_FASTEST = 1e6
"""[Hz] Natural frequencies beyond it are those of no frame."""


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


def read_frame(oscillators: Mapping[str, Oscillator], name: str) -> Frame:
    """A frame of a scene."""
    if name not in oscillators:
        known = ', '.join(oscillators) or 'none'
        raise InputError(
            f"there is no oscillator '{name}'{nearest(name, oscillators)}; oscillators: {known}"
        )
    part, where = oscillators[name], f'oscillators.{name}'
    mounts = tuple(frame.Mount(m.at, m.stiffness, m.damping) for m in part.mounts.values())
    found = Frame(part.mass, part.inertia, part.cog, mounts)
    if not found.held:
        raise InputError(
            f'{where}.mounts do not hold it in every direction: give each direction a stiffness, '
            'and a frame that can turn two mounts apart, or leave out its inertia'
        )
    if found.frequencies[-1] > _FASTEST:
        raise InputError(
            f'{where}: its highest natural frequency of {found.frequencies[-1]:.3g} Hz is above '
            f'{_FASTEST:g} Hz: check mass, inertia and stiffness'
        )
    return found
