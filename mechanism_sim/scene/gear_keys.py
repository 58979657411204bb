"""What a scene file says of gears and how they mesh."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from mechanism_sim.scene.contact_keys import Contact
from mechanism_sim.scene.quantities import (
    Angle,
    Coefficient,
    Displacement,
    Length,
    Part,
    Quantity,
    si,
)


def _fraction(value: Any) -> str:
    """A ratio of whole numbers, such as ``1/2``."""
    try:
        ratio = Fraction(str(value).replace(' ', ''))
    except (ValueError, ZeroDivisionError) as error:
        raise ValueError("is not a ratio of whole numbers: write for example '1/2'") from error
    if not ratio or ratio.denominator > MOST_TEETH or abs(ratio.numerator) > MOST_TEETH:
        raise ValueError(
            f"is not a ratio of whole numbers from 1 to {MOST_TEETH}: write for example '1/2'"
        )
    return str(ratio)


MOST_TEETH = 100_000


def _shares(value: Any) -> Any:
    """Of the harmonics of a stiffness, or ``contact_ratio``."""
    numbers = isinstance(value, list | tuple) and all(isinstance(x, float | int) for x in value)
    if not numbers and value != 'contact_ratio':
        raise ValueError("must be 'contact_ratio' or a list of numbers such as [0.2, 0.1]")
    return value


_Variation = Annotated[tuple[float, ...] | Literal['contact_ratio'], BeforeValidator(_shares)]
_Stiffness = Annotated[float, si('N/m'), Field(gt=0.0)]
_Damping = Annotated[float, si('N s/m'), Field(ge=0.0)]
_Height = Annotated[float, si(''), Field(gt=0.0, le=2.0)]
_Shift = Annotated[float, si(''), Field(ge=-5.0, le=5.0)]
Ratio = Annotated[str, Quantity(_fraction, ('',))]


class GearPart(Part):
    """An involute gear, or a rack, that is fixed to a link; heights in modules."""

    at: str
    """LINK or LINK.POINT: its centre; a point of a rack's pitch line."""
    module: Length
    """In the plane normal to the teeth."""
    teeth: Annotated[int, Field(ge=3, le=MOST_TEETH)] | None = None
    """How many; not for racks."""
    pressure_angle: Angle = math.radians(20.0)
    """In the plane normal to the teeth."""
    addendum: _Height = 1.0
    """Height of the teeth above the pitch circle, in modules."""
    dedendum: _Height = 1.25
    """Depth of the gaps below the pitch circle, in modules."""
    shift: _Shift = 0.0
    """Profile shift, in modules."""
    helix_angle: Angle = 0.0
    """Of helical gears, equal for both."""
    internal: bool = False
    """Whether the teeth point inwards."""
    rack: bool = False
    """Whether it is straight."""


class BacklashPart(Part):
    """Free way of the teeth, and what happens at its ends."""

    width: Length | None = None
    """Free way along the working pitch circle; else what the centre distance leaves."""
    restitution: Coefficient | None = None
    """Coefficient of restitution: 0 does not bounce, 1 loses nothing."""
    hypothesis: Literal['newton', 'poisson', 'stronge'] = 'newton'
    """What the coefficient relates: speeds, impulses or works."""
    contact: Contact | None = None
    """A law of force instead of rigid teeth."""


class ElasticityPart(Part):
    """Stiffness and damping of the teeth along the line of action."""

    stiffness: _Stiffness
    """Along the line of action."""
    damping: _Damping = 0.0
    """Along the line of action."""
    variation: _Variation = ()
    """Harmonics of the tooth frequency over the mean, or `contact_ratio`."""


class ErrorPart(Part):
    """Transmission error along the line of action, zero at the start."""

    amplitude: Displacement = 0.0
    """Of a harmonic of the tooth frequency."""
    order: Annotated[int, Field(ge=1, le=100)] = 1
    """Which harmonic it is."""
    eccentricity: tuple[Displacement, Displacement] = (0.0, 0.0)
    """Of both gears: an error once a turn of each."""


class GearKeys(Part):
    """The keys of a joint between two gears, or of a transmission by other means."""

    backlash: BacklashPart | None = None
    """Free way of the teeth; without it they never part."""
    elasticity: ElasticityPart | None = None
    """Teeth that give way."""
    error: ErrorPart | None = None
    """Transmission error along the line of action, zero at the start."""
    ratio: Ratio | None = None
    """Of a transmission, required: speed of the second over the first, as -3/7."""
    carrier: str | None = None
    """Of a transmission: the link from which angles count; else the ground."""
