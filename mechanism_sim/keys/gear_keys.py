"""Keys of a gear that a link carries."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from mechanism_sim.keys.quantities import Angle, Length, Part, Position, si

MOST_TEETH = 100_000
_Height = Annotated[float, si(''), Field(gt=0.0, le=2.0)]
_Shift = Annotated[float, si(''), Field(ge=-5.0, le=5.0)]


class GearPart(Part):
    """An involute gear, or a rack, that is fixed to a link; heights in modules."""

    at: str
    """LINK or LINK.POINT: its centre; a point of a rack's pitch line."""
    module: Length
    """In the plane normal to the teeth."""
    teeth: Annotated[int, Field(ge=3, le=MOST_TEETH)] | None = None
    """Number of teeth; not for racks."""
    pressure_angle: Angle = math.radians(20.0)
    """In the plane normal to the teeth."""
    addendum: _Height = 1.0
    """Height of the teeth above the pitch circle, in modules."""
    dedendum: _Height = 1.25
    """Depth of the gaps below the pitch circle, in modules."""
    shift: _Shift = 0.0
    """Profile shift, in modules."""
    helix_angle: Angle = 0.0
    """Of helical gears, equal for both; negative: left-handed, as the first of a pair decides."""
    along: Position = 0.0
    """Where it lies along its shaft, from the plane of the machine towards the reader."""
    internal: bool = False
    """True if the teeth point inwards."""
    rack: bool = False
    """True if it is straight."""
