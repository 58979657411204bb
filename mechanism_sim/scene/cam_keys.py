"""What a scene file says of a cam and its follower."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from mechanism_sim.scene.quantities import (
    Angle,
    Coefficient,
    Displacement,
    Length,
    Part,
    Position,
    Radius,
)
from mechanism_sim.scene.schema import Contact
from mechanism_sim.units import Measure, to_si_of

Way = Annotated[Measure, BeforeValidator(lambda value: to_si_of(value, ('rad', 'm')))]
"""An angle of a cam, or a displacement if it slides."""

Rise = Annotated[Measure, BeforeValidator(lambda value: to_si_of(value, ('m', 'rad')))]
"""A displacement of the follower: an angle if it swings."""

Curve = Literal[
    'cycloidal',
    'harmonic',
    'half_harmonic',
    'four_spline',
    'modified_trapezoid',
    'modified_sine',
    'polynomial_345',
    'polynomial_4567',
    'spline',
]


class SegmentPart(Part):
    """A rise, a return or, with no rise, a dwell over an interval of the cam angle.

    Of a cam that slides: of its displacement.
    """

    begin: Way = Field(alias='from')
    end: Way = Field(alias='to')
    rise: Rise
    curve: Curve = 'cycloidal'
    points: tuple[tuple[float, float], ...] = ()  #: of a spline, from [0, 0] to [1, 1]
    ends: Literal['clamped', 'natural', 'not-a-knot'] = 'clamped'  #: of a spline

    @model_validator(mode='after')
    def _points_make_a_spline(self) -> SegmentPart:
        if bool(self.points) != (self.curve == 'spline'):
            raise ValueError(
                "needs 'points' from [0, 0] to [1, 1] if its curve is a spline, and only then"
            )
        return self


class LawPart(Part):
    """The displacement of the follower over the place of the cam, in one of three ways."""

    segments: tuple[SegmentPart, ...] = ()
    points: tuple[tuple[Way, Rise], ...] = ()  #: measured
    degree: Literal[1, 3, 5, 7] = 5  #: of the spline through them
    eccentric: Length | None = None  #: a circle, so far from the camshaft

    @model_validator(mode='after')
    def _one_way(self) -> LawPart:
        if sum(map(bool, (self.segments, self.points, self.eccentric))) != 1:
            raise ValueError("needs exactly one of 'segments', 'points' and 'eccentric'")
        return self


class LiftOffPart(Part):
    """A follower that leaves the cam and strikes it again."""

    restitution: Coefficient
    hypothesis: Literal['newton', 'poisson', 'stronge'] = 'newton'
    contact: Contact | None = None


class GroovePart(Part):
    """A groove that holds the roller."""

    clearance: Displacement  #: width of the groove less the roller's diameter
    restitution: Coefficient | None = None
    hypothesis: Literal['newton', 'poisson', 'stronge'] = 'newton'
    contact: Contact | None = None


class CamKeys(Part):
    """The keys of a joint between a cam and its follower."""

    follower: Literal['knife', 'roller', 'flat'] | None = None
    base_radius: Length | None = None
    roller: Radius = 0.0  #: its radius
    tilt: Angle = 0.0  #: of a face that slides: from the motion to its normal, counterclockwise
    face: Position = 0.0  #: of a face that swings: how far beyond the line from pivot to point
    side: Literal['left', 'right'] | None = None  #: of a swinging arm, seen from the camshaft
    sense: Literal['counterclockwise', 'clockwise'] | None = None  #: in which the angle counts
    law: LawPart | None = None
    lift_off: LiftOffPart | None = None
    groove: GroovePart | None = None
