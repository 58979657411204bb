"""What a scene file says of an elastic link."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from mechanism_sim.scene.quantities import Length, Part, Time, si

_POSITIVE = Field(gt=0.0, allow_inf_nan=False)
_SHARE = Field(ge=0.0, lt=1.0)

MATERIALS = {
    'steel': (210e9, 7850.0),
    'stainless_steel': (193e9, 8000.0),
    'cast_iron': (110e9, 7200.0),
    'aluminium': (70e9, 2700.0),
    'titanium': (114e9, 4430.0),
    'brass': (105e9, 8500.0),
}
"""Young's modulus [Pa] and density [kg/m^3], rounded as handbooks have them."""


class SectionPart(Part):
    """The cross-section: a rectangle, or a circle."""

    width: Length | None = None
    """Of a rectangle, square to the plane of the machine."""
    height: Length | None = None
    """Of a rectangle, in the plane of the machine: the way it bends."""
    diameter: Length | None = None
    """Of a circle."""

    @model_validator(mode='after')
    def _one_shape(self) -> SectionPart:
        sides = [self.width, self.height]
        if (None in sides) == (self.diameter is None) or (self.diameter and any(sides)):
            raise ValueError("needs either 'width' and 'height', or 'diameter'")
        return self


class RayleighPart(Part):
    """Rayleigh's damping: shares of mass and stiffness."""

    mass: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] = 0.0
    """Times the mass, in 1/s: damps slow modes."""
    stiffness: Time = 0.0
    """Times the stiffness: damps fast modes."""


class ElasticPart(Part):
    """A link that bends: a beam from its `start` to its `end`."""

    section: SectionPart | None = None
    """Cross-section; or its `area` and `second_moment`."""
    area: Annotated[float, si('m^2'), _POSITIVE] | None = None
    """Of the cross-section."""
    second_moment: Annotated[float, si('m^4'), _POSITIVE] | None = None
    """Of the cross-section, for bending in the plane of the machine."""
    outer_fibre: Length | None = None
    """Largest distance from the axis in the plane, for stress; of a `section` it is known."""
    material: Literal[tuple(MATERIALS)] | None = None  # type: ignore[valid-type]
    """Whose Young's modulus and density are taken where none are given."""
    youngs_modulus: Annotated[float, si('Pa'), _POSITIVE] | None = None
    """Instead of a material's."""
    density: Annotated[float, si('kg/m^3'), _POSITIVE] | None = None
    """Instead of a material's."""
    modes: Annotated[int, Field(ge=1, le=8)] = 2
    """How many shapes it bends in."""
    stretch: Annotated[int, Field(ge=0, le=4)] = 0
    """How many shapes it stretches in; 0: it keeps its length."""
    ends: Literal['pinned', 'clamped'] = 'pinned'
    """What its angle is: of the line through start and end, or of the tangent at its start."""
    functions: Literal['modal', 'polynomial'] = 'modal'
    """Modes of the beam by itself, or the polynomials nearest to them: exact for end loads."""
    damping: Annotated[float, si(''), _SHARE] = 0.0
    """Of each mode by itself, as a ratio of critical damping."""
    rayleigh: RayleighPart = RayleighPart()
    """Damping by mass and by stiffness, beside that."""
    foreshortening: bool = True
    """Whether the ends come nearer as it bends; without there is no stiffening by spin."""

    @model_validator(mode='after')
    def _complete(self) -> ElasticPart:
        given = [self.area, self.second_moment]
        if (None in given) == (self.section is None) or (self.section and any(given)):
            raise ValueError("needs either 'section', or 'area' and 'second_moment'")
        if self.section and self.outer_fibre:
            raise ValueError("has 'outer_fibre', which its section says already")
        if self.material is None and self.youngs_modulus is None:
            raise ValueError("needs 'material' or 'youngs_modulus'")
        return self

    @property
    def matter(self) -> tuple[float, float | None]:
        """Young's modulus [Pa], and density [kg/m^3] if it is said."""
        modulus, density = MATERIALS[self.material] if self.material else (None, None)
        modulus = self.youngs_modulus or modulus
        assert modulus  # noqa: S101 - one of them is given
        return modulus, self.density or density

    @property
    def geometry(self) -> tuple[float, float, float | None]:
        """Area [m^2], second moment of area [m^4], distance of the outer fibre [m] if known."""
        s = self.section
        if s is None:
            return self.area or 0.0, self.second_moment or 0.0, self.outer_fibre
        if s.diameter:
            d = s.diameter
            return 0.25 * math.pi * d**2, math.pi * d**4 / 64.0, 0.5 * d
        width, height = s.width or 0.0, s.height or 0.0
        return width * height, width * height**3 / 12.0, 0.5 * height
