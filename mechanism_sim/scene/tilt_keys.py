"""Links that lean out of their plane: what a scene says of them, and what it makes of a body."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from pydantic import Field, model_validator

from mechanism_sim.errors import InputError
from mechanism_sim.planar.mechanism import Body, Joint, Mechanism, Revolute
from mechanism_sim.planar.tilt import Tilt
from mechanism_sim.scene.quantities import Inertia, Length, Part, si

if TYPE_CHECKING:
    from mechanism_sim.scene.places import Places

_SHARE = Field(ge=0.0, lt=1.0)
_ROUNDING = 1e-12


class TiltPart(Part):
    """How a link leans out of its plane: by small rotations about its x and y axes."""

    stiffness: Annotated[float, si('N m/rad'), Field(ge=0.0, allow_inf_nan=False)]
    """Of what holds it in its plane, against rotation about either axis."""
    inertia: tuple[Inertia, Inertia] | None = None
    """Moments of inertia about the link's x and y axes through its centre of gravity."""
    thickness: Length | None = None
    """Instead of `inertia`: of a bar of square section along the link's x axis."""
    damping: Annotated[float, _SHARE] = 0.0
    """Ratio of critical damping of either rotation by itself."""

    @model_validator(mode='after')
    def _weighed(self) -> TiltPart:
        if (self.inertia is None) == (self.thickness is None):
            raise ValueError(
                "needs either 'inertia', as [20 kg mm^2, 3000 kg mm^2], or 'thickness'"
            )
        return self


def without_mass(link: str, given: TiltPart | None) -> Body:
    """A link as it moves, whatever it weighs."""
    none = (0.0, 0.0)
    return Body(
        link, 0.0, 0.0, none, tilt=Tilt(0.0, none, (0.0, 0.0, 0.0), none) if given else None
    )


def tilted(body: Body, given: TiltPart | None, where: str, spin: float = 0.0) -> Body:
    """A body as its link leans.

    Parameters
    ----------
    where : names the link in messages
    spin : [kg m^2] of its inertia that turns in the plane, but does not lean

    Raises
    ------
    InputError
        If it has no mass, or no body has such moments of inertia.
    """
    if given is None:
        return body
    normal = body.inertia - spin
    if not (body.mass and normal):
        raise InputError(f'{where}.tilt: a link that leans needs mass and inertia')
    if given.thickness:
        square = body.mass * given.thickness**2 / 12.0
        about = (2.0 * square, normal)
    else:
        assert given.inertia  # noqa: S101 - one of both is there
        about = given.inertia
    moments = (*about, normal)
    if max(moments) > (1.0 + _ROUNDING) * (sum(moments) - max(moments)):
        said = ', '.join(f'{x:g}' for x in moments)
        raise InputError(
            f'{where}.tilt: no body has the moments of inertia {said} kg m^2 about x, y and its '
            'normal: none may be more than the others together'
        )
    rigidity = (given.stiffness, given.stiffness)
    return replace(body, tilt=Tilt(body.mass, body.cog, moments, rigidity, given.damping, spin))


def check_tilts(places: Places, joints: tuple[Joint, ...]) -> None:
    """Links that lean are rigid, and have revolute joints only.

    Raises
    ------
    InputError
        If not.
    """
    leaning = {x for x in places.links if places.scene.links[x].tilt}
    for link in places.links:
        if link in leaning and places.scene.links[link].elastic:
            raise InputError(
                f'{places.name}: links.{link} has both elastic and tilt: a link that bends in the '
                'plane stays in it here; leave one of them out'
            )
    for joint in joints:
        for link in {joint.first, joint.second} & leaning:
            if not isinstance(joint, Revolute):
                raise InputError(
                    f'{places.name}: joints.{joint.name}: the link {link}, which leans, has '
                    'revolute joints only; put a rigid link between'
                )


def tilt_notes(mechanism: Mechanism) -> list[str]:
    """Natural frequencies of the links that lean, each while it rests."""
    notes = []
    for link in {c.partition('.')[0]: None for c in mechanism.tilts}:
        rates = mechanism.flexible[link].frequencies.items()
        listed = ', '.join(f'{name} {w / (2.0 * math.pi):.6g} Hz' for name, w in rates)
        notes.append(f'{link} leans out of its plane: {listed}; exact to the first order')
    return notes
