"""What a scene file says of gears and how they mesh."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from mechanism_sim.scene.quantities import Angle, Coefficient, Displacement, Length, Part
from mechanism_sim.scene.schema import Contact
from mechanism_sim.units import to_si


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
_Stiffness = Annotated[float, BeforeValidator(lambda x: to_si(x, 'N/m')), Field(gt=0.0)]
_Damping = Annotated[float, BeforeValidator(lambda x: to_si(x, 'N s/m')), Field(ge=0.0)]
_Height = Annotated[float, BeforeValidator(lambda x: to_si(x, '')), Field(gt=0.0, le=2.0)]
_Shift = Annotated[float, BeforeValidator(lambda x: to_si(x, '')), Field(ge=-5.0, le=5.0)]
Ratio = Annotated[str, BeforeValidator(_fraction)]


class GearPart(Part):
    """An involute gear, or a rack, that is fixed to a link; heights in modules."""

    at: str  #: its centre; a point of a rack's pitch line
    module: Length  #: in the plane normal to the teeth
    teeth: Annotated[int, Field(ge=3, le=MOST_TEETH)] | None = None
    pressure_angle: Angle = math.radians(20.0)  #: in the plane normal to the teeth
    addendum: _Height = 1.0
    dedendum: _Height = 1.25
    shift: _Shift = 0.0
    helix_angle: Angle = 0.0
    internal: bool = False
    rack: bool = False


class BacklashPart(Part):
    """Free way of the teeth, and what happens at its ends."""

    width: Length | None = None  #: along the working pitch circle; else what the centres leave
    restitution: Coefficient | None = None
    hypothesis: Literal['newton', 'poisson', 'stronge'] = 'newton'
    contact: Contact | None = None


class ElasticityPart(Part):
    """Stiffness and damping of the teeth along the line of action."""

    stiffness: _Stiffness
    damping: _Damping = 0.0
    variation: _Variation = ()


class ErrorPart(Part):
    """Transmission error along the line of action, zero at the start."""

    amplitude: Displacement = 0.0
    order: Annotated[int, Field(ge=1, le=100)] = 1  #: of the tooth frequency
    eccentricity: tuple[Displacement, Displacement] = (0.0, 0.0)  #: once a turn of each


class GearKeys(Part):
    """The keys of a joint between two gears, or of a transmission by other means."""

    backlash: BacklashPart | None = None
    elasticity: ElasticityPart | None = None
    error: ErrorPart | None = None
    ratio: Ratio | None = None  #: of a transmission: speed of the second over the first
    carrier: str | None = None  #: of a transmission, from which angles count; else the ground
