"""Links that lean out of their plane: what a scene says of them, and makes of their bodies."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

from pydantic import Field, model_validator

from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Inertia, Length, Part, si
from mechanism_sim.planar.bodies import Body, LinkExtension
from mechanism_sim.planar.mechanism import Joint, Mechanism, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.tilt import Tilt

_ROUNDING = 1e-12
_SHARE = Field(ge=0.0, lt=1.0)


class TiltPart(Part):
    """Tilt of a link out of its plane, by small rotations about its x and y axes."""

    stiffness: Annotated[float, si('N m/rad'), Field(ge=0.0, allow_inf_nan=False)]
    """Of what holds it in its plane, against rotation about either axis."""
    inertia: tuple[Inertia, Inertia] | None = None
    """Moments of inertia about the link's x and y axes through its centre of gravity."""
    thickness: Length | None = None
    """Instead of `inertia`: of a bar of square section along the link's x axis."""
    damping: Annotated[float, _SHARE] = 0.0
    """Ratio of critical damping of either rotation by itself, and of the motion along the axes."""
    axial_stiffness: Annotated[float, si('N/m'), Field(ge=0.0, allow_inf_nan=False)] = 0.0
    """Of what holds it along the axes, where a bearing of it has `clearance.axial`."""

    @model_validator(mode='after')
    def _weighed(self) -> TiltPart:
        if (self.inertia is None) == (self.thickness is None):
            raise ValueError(
                "needs either 'inertia', as [20 kg mm^2, 3000 kg mm^2], or 'thickness'"
            )
        return self


def without_mass(names: Names, link: str, rotor: LinkExtension | None) -> Body:
    """A link as it moves, whatever it weighs."""
    none, given = (0.0, 0.0), names.scene.links[link].tilt
    axial = _stiffness_along(names, link)
    tilt = Tilt(0.0, none, (0.0, 0.0, 0.0), none, axial=axial) if given else None
    return Body(link, 0.0, 0.0, none, tilt or rotor)


def _stiffness_along(names: Names, link: str) -> float | None:
    """Stiffness that holds a link along the axes [N/m]; None if no bearing lets it move there."""
    given = names.scene.links[link].tilt
    stopped = any(
        joint.clearance and joint.clearance.axial and link in dict(names.ends(name))
        for name, joint in names.scene.joints.items()
    )
    return given.axial_stiffness if given and stopped else None


def tilted(body: Body, names: Names, spin: float = 0.0) -> Body:
    """A body as its link leans.

    Parameters
    ----------
    spin : [kg m^2] of its inertia that turns in the plane, but does not lean
    """
    given, where = names.scene.links[body.name].tilt, f'links.{body.name}'
    if given is None:
        return body
    axial = _stiffness_along(names, body.name)
    if given.axial_stiffness and axial is None:
        raise InputError(
            f'{where}.tilt.axial_stiffness has no meaning where no bearing of the link has '
            "'clearance.axial': it does not move along the axes"
        )
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
    tilt = Tilt(body.mass, body.cog, moments, rigidity, given.damping, spin, axial)
    return replace(body, extension=tilt)


def check_tilts(names: Names, joints: tuple[Joint, ...]) -> None:
    """Links that lean are rigid, and have revolute joints only."""
    leaning = {x for x in names.links if names.scene.links[x].tilt}
    for link in names.links:
        if link in leaning and names.scene.links[link].elastic:
            raise InputError(
                f'links.{link} has both elastic and tilt: a link that bends in the plane stays in '
                'it here; leave one of them out'
            )
    for name, keys in names.scene.joints.items():
        if keys.clearance and keys.clearance.axial:
            ends = [link for link, _ in names.ends(name)]
            if not leaning & {*ends}:
                movable = next(x for x in ends if x != GROUND)
                raise InputError(
                    f'joints.{name}.clearance.axial: none of its links can move along the axis: '
                    f"give 'links.{movable}.tilt' to one that leans"
                )
    for joint in joints:
        for link in {joint.first, joint.second} & leaning:
            if not isinstance(joint, Revolute):
                raise InputError(
                    f'joints.{joint.name}: the link {link}, which leans, has revolute joints '
                    'only; put a rigid link between'
                )


def tilt_notes(mechanism: Mechanism) -> list[str]:
    """Natural frequencies of the links that lean, each while it rests."""
    notes = []
    for link, tilt in mechanism.having(Tilt).items():
        rates = tilt.frequencies.items()
        listed = ', '.join(f'{name} {w / (2.0 * math.pi):.6g} Hz' for name, w in rates)
        notes.append(f'{link} leans out of its plane: {listed}; exact to the first order')
    return notes
