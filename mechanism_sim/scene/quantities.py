"""Quantities that files may hold: units, bounds, and the base of all parts.

Values arrive as people write them (``64 mm``) and are kept in SI units.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from mechanism_sim.units import to_si


def si(unit: str) -> BeforeValidator:
    """Text with a unit, or a number, becomes a number in `unit`."""
    return BeforeValidator(lambda value: to_si(value, unit))


_FINITE = Field(allow_inf_nan=False)
POSITIVE = Field(gt=0.0, allow_inf_nan=False)
_NOT_NEGATIVE = Field(ge=0.0, allow_inf_nan=False)

Length = Annotated[float, si('m'), POSITIVE]
Position = Annotated[float, si('m'), _FINITE]
Mass = Annotated[float, si('kg'), POSITIVE]
Inertia = Annotated[float, si('kg m^2'), POSITIVE]
Angle = Annotated[float, si('rad'), _FINITE]
Speed = Annotated[float, si('rad/s'), _FINITE]
Acceleration = Annotated[float, si('m/s^2'), _FINITE]
AngularAcceleration = Annotated[float, si('rad/s^2'), POSITIVE]
Rate = Annotated[float, si('Hz'), POSITIVE]
Tolerance = Annotated[float, si(''), Field(ge=1e-16, le=1e-4)]
Displacement = Annotated[float, si('m'), _NOT_NEGATIVE]
Time = Annotated[float, si('s'), _NOT_NEGATIVE]
Duration = Annotated[float, si('s'), POSITIVE]
Torque = Annotated[float, si('N m'), _FINITE]
TorquePerAngle = Annotated[float, si('N m/rad'), _FINITE]
TorquePerSpeed = Annotated[float, si('N m s/rad'), _FINITE]
AddedInertia = Annotated[float, si('kg m^2'), _NOT_NEGATIVE]
Radius = Annotated[float, si('m'), _NOT_NEGATIVE]
Friction = Annotated[
    float, BeforeValidator(lambda x: float('inf') if x == 'rough' else to_si(x, '')), Field(ge=0.0)
]
"""Coulomb's coefficient, or the word ``rough`` for contacts that never slip."""
Coefficient = Annotated[float, si(''), Field(ge=0.0, le=1.0)]


Gravity = tuple[Acceleration, Acceleration]


class Part(BaseModel):
    """Base of all parts of a scene: unknown keys are refused."""

    model_config = ConfigDict(extra='forbid', frozen=True)
