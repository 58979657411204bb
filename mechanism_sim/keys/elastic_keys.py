"""Keys of an elastic link."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from mechanism_sim.keys.quantities import POSITIVE, Length, Part, Position, Time, si
from mechanism_sim.planar.beam_sections import Shape, Taper, geometry

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


class StationPart(Part):
    """The cross-section at a point of a link that tapers."""

    width: Length | None = None
    """Of a rectangle, square to the plane of the machine."""
    height: Length | None = None
    """Of a rectangle, in the plane of the machine: the way it bends."""
    diameter: Length | None = None
    """Of a circle."""

    area: Annotated[float, si('m^2'), POSITIVE] | None = None
    """Of any other section, with `second_moment`."""
    second_moment: Annotated[float, si('m^4'), POSITIVE] | None = None
    """Of any other section, for bending in the plane of the machine."""
    outer_fibre: Length | None = None
    """Largest distance from the axis in the plane, for stress, of any other section."""

    @property
    def shape(self) -> Shape:
        """Shape of the section, by its given sizes."""
        return 'circle' if self.diameter else 'rectangle' if self.width else 'any'

    @property
    def sizes(self) -> tuple[float, ...]:
        """Sizes of the section, for `mechanism_sim.planar.beam_sections.geometry`."""
        if self.shape == 'any':
            return self.area or 0.0, self.second_moment or 0.0, self.outer_fibre or 0.0
        return tuple(x for x in (self.width, self.height, self.diameter) if x)

    @property
    def given(self) -> tuple[str, ...]:
        """Given sizes by name."""
        return tuple(x for x in StationPart.model_fields if getattr(self, x) is not None)

    @model_validator(mode='after')
    def _one_shape(self) -> StationPart:
        if self.given not in (*_SHAPES, ('area', 'second_moment', 'outer_fibre')):
            raise ValueError(
                "needs either 'width' and 'height', or 'diameter', or 'area' and 'second_moment'"
            )
        return self


_SHAPES = ('width', 'height'), ('diameter',), ('area', 'second_moment')


class SectionPart(Part):
    """The cross-section: a rectangle, or a circle; or how it changes along the link."""

    width: Length | None = None
    """Of a rectangle, square to the plane of the machine."""
    height: Length | None = None
    """Of a rectangle, in the plane of the machine: the way it bends."""
    diameter: Length | None = None
    """Of a circle."""
    points: Annotated[list[tuple[Position, StationPart]], Field(min_length=2)] | None = None
    """Of a link that tapers, a list of [x, section], such as [200 mm, {diameter: 8 mm}], with
    rising x; sizes change linearly between points, and two points of the same x are a step."""

    @model_validator(mode='after')
    def _one_shape(self) -> SectionPart:
        sides = [self.width, self.height]
        given = [any(sides), bool(self.diameter), bool(self.points)]
        if sum(given) != 1 or (any(sides) and None in sides):
            raise ValueError("needs either 'width' and 'height', or 'diameter', or 'points'")
        places = [x for x, _ in self.points or ()]
        if places != sorted(places):
            raise ValueError(f'has points with x out of order: {", ".join(map(str, places))} m')
        if len({x.given for _, x in self.points or ()}) > 1:
            raise ValueError('has points given by different sizes: give the same at all of them')
        return self

    @property
    def first(self) -> StationPart:
        """The section at the start of the link."""
        if self.points:
            return self.points[0][1]
        return StationPart(width=self.width, height=self.height, diameter=self.diameter)

    def taper(self, length: float) -> Taper | None:
        """Taper of the section along a link of a length [m]; None for a uniform section."""
        if not self.points:
            return None
        found = Taper(length, self.points[0][1].shape, tuple((x, s.sizes) for x, s in self.points))
        return None if found.even else found


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
    area: Annotated[float, si('m^2'), POSITIVE] | None = None
    """Of the cross-section."""
    second_moment: Annotated[float, si('m^4'), POSITIVE] | None = None
    """Of the cross-section, for bending in the plane of the machine."""
    outer_fibre: Length | None = None
    """Largest distance from the axis in the plane, for stress; of a `section` it is known."""
    material: Literal[tuple(MATERIALS)] | None = None  # type: ignore[valid-type]
    """Whose Young's modulus and density are taken where none are given."""
    youngs_modulus: Annotated[float, si('Pa'), POSITIVE] | None = None
    """Instead of a material's."""
    density: Annotated[float, si('kg/m^3'), POSITIVE] | None = None
    """Instead of a material's."""
    modes: Annotated[int, Field(ge=1, le=8)] = 2
    """Number of bending modes."""
    stretch: Annotated[int, Field(ge=0, le=4)] = 0
    """Number of longitudinal modes; 0: it keeps its length."""
    ends: Literal['pinned', 'clamped'] = 'pinned'
    """Its angle is that of the line through start and end, or of the tangent at its start."""
    functions: Literal['modal', 'polynomial'] = 'modal'
    """Modes of the beam by itself, or the polynomials nearest to them: exact for end loads."""
    damping: Annotated[float, si(''), _SHARE] = 0.0
    """Of each mode by itself, as a ratio of critical damping."""
    rayleigh: RayleighPart = RayleighPart()
    """Damping by mass and by stiffness, beside that."""
    foreshortening: bool = True
    """True if bending shortens the distance of the ends; needed for centrifugal stiffening."""

    @model_validator(mode='after')
    def _complete(self) -> ElasticPart:
        given = [self.area, self.second_moment]
        if (None in given) == (self.section is None) or (self.section and any(given)):
            raise ValueError("needs either 'section', or 'area' and 'second_moment'")
        if self.section and self.outer_fibre:
            raise ValueError("has 'outer_fibre', which its section defines already")
        if self.material is None and self.youngs_modulus is None:
            raise ValueError("needs 'material' or 'youngs_modulus'")
        return self

    @property
    def matter(self) -> tuple[float, float | None]:
        """Young's modulus [Pa], and density [kg/m^3] if stated."""
        modulus, density = MATERIALS[self.material] if self.material else (None, None)
        modulus = self.youngs_modulus or modulus
        assert modulus  # noqa: S101 - one of them is given
        return modulus, self.density or density

    def geometry(self, length: float) -> tuple[Taper | None, float, float, float | None]:
        """Taper of a link of a length [m], None if uniform, and its mean section.

        The section is area [m^2], second moment [m^4], and largest outer fibre [m] if known.
        """
        if self.section is None:
            return None, self.area or 0.0, self.second_moment or 0.0, self.outer_fibre
        taper = self.section.taper(length)
        if taper:
            fibre = max(geometry(taper.shape, sizes)[2] for _, sizes in taper.points)
            return taper, *taper.means, fibre or None
        one = self.section.first
        area, moment, fibre = geometry(one.shape, one.sizes)
        return None, area, moment, fibre or None
