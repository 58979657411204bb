"""What a scene file says of a cam and its follower."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from mechanism_sim.scene.contact_keys import Contact
from mechanism_sim.scene.quantities import (
    Angle,
    Coefficient,
    Displacement,
    Length,
    Part,
    Position,
    Radius,
    si_of,
)
from mechanism_sim.units import Measure

Way = Annotated[Measure, si_of('rad', 'm')]
"""An angle of a cam, or a displacement if it slides."""

Rise = Annotated[Measure, si_of('m', 'rad')]
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
    """Angle of the cam, or its displacement if it slides."""
    end: Way = Field(alias='to')
    """Likewise."""
    rise: Rise
    """Of the follower, negative for a return; 0 is a dwell."""
    curve: Curve = 'cycloidal'
    """How it gets there."""
    points: tuple[tuple[float, float], ...] = ()
    """Of a spline, from [0, 0] to [1, 1]."""
    ends: Literal['clamped', 'natural', 'not-a-knot'] = 'clamped'
    """Of a spline."""

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
    """Rises and returns, between which the follower dwells."""
    points: tuple[tuple[Way, Rise], ...] = ()
    """Instead: measured pairs of the cam's angle and the follower's displacement."""
    degree: Literal[1, 3, 5, 7] = 5
    """Of the spline through these points."""
    eccentric: Length | None = None
    """Instead: the cam is a circle, so far off the camshaft."""

    @model_validator(mode='after')
    def _one_way(self) -> LawPart:
        if sum(map(bool, (self.segments, self.points, self.eccentric))) != 1:
            raise ValueError("needs exactly one of 'segments', 'points' and 'eccentric'")
        return self


class LiftOffPart(Part):
    """A follower that leaves the cam and strikes it again."""

    restitution: Coefficient
    """Coefficient of restitution: 0 does not bounce, 1 loses nothing."""
    hypothesis: Literal['newton', 'poisson', 'stronge'] = 'newton'
    """What the coefficient relates: speeds, impulses or works."""
    contact: Contact | None = None
    """A law of force instead of a rigid contact."""


class GroovePart(Part):
    """A groove that holds the roller."""

    clearance: Displacement
    """Width of the groove less the roller's diameter; 0 for an ideal one."""
    restitution: Coefficient | None = None
    """Of both walls; required with a clearance."""
    hypothesis: Literal['newton', 'poisson', 'stronge'] = 'newton'
    """What the coefficient relates: speeds, impulses or works."""
    contact: Contact | None = None
    """A law of force instead of rigid walls."""


class CamKeys(Part):
    """The keys of a joint between a cam and its follower."""

    follower: Literal['knife', 'roller', 'flat'] | None = None
    """Its tip; required for a cam."""
    base_radius: Length | None = None
    """Of the cam's base circle, without the roller; required."""
    roller: Radius = 0.0
    """Radius of the roller; required for one."""
    tilt: Angle = 0.0
    """Of a face that slides: from the motion to its normal, counterclockwise."""
    face: Position = 0.0
    """Of a face that swings: how far beyond the line from pivot to point."""
    side: Literal['left', 'right'] | None = None
    """Where a swinging arm is, seen from the camshaft; required for one."""
    sense: Literal['counterclockwise', 'clockwise'] | None = None
    """In which the cam's angle counts; counterclockwise without it."""
    law: LawPart | None = None
    """Displacement of the follower over the angle of the cam; required."""
    lift_off: LiftOffPart | None = None
    """The follower may leave the cam and strike it again; without it the cam holds it."""
    groove: GroovePart | None = None
    """A groove holds the roller from both sides."""
