"""The four-bar as a scene writes it in short: links and joints have names, and a branch.

What it says is expanded to a linkage that is written out before anything else reads it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from mechanism_sim.joints.contact_keys import Clearance
from mechanism_sim.keys.quantities import Length, Part
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.grashof import beside_change_point
from mechanism_sim.scene.schema import (
    LOAD_SECTIONS,
    AnyScene,
    DrivePart,
    InitialPart,
    LinkPart,
    PointMass,
    SensorPart,
)
from mechanism_sim.units import QuantityValue

JOINTS = {
    'ground_crank': ['ground', 'crank'],
    'crank_coupler': ['crank.end', 'coupler'],
    'coupler_rocker': ['coupler.end', 'rocker.end'],
    'rocker_ground': ['rocker', 'ground.end'],
}
"""The points that its joints connect."""


class Ground(Part):
    """The frame: the distance of its two joints."""

    length: Length
    """Distance of the two joints of the frame."""


class Link(LinkPart):
    """A link between two joints; mass properties only where forces are wanted."""

    length: Length
    """Distance of the link's two joints."""

    @model_validator(mode='after')
    def _weighed(self) -> Link:
        given = self.model_fields_set
        missing = [part for part in ('mass', 'inertia', 'cog') if part not in given]
        if missing and not self.elastic and given & {'mass', 'inertia'}:
            raise ValueError(
                f'needs {" and ".join(map(repr, missing))} too: forces, torques and clearances '
                'need the mass, inertia and cog of every moving link'
            )
        return self


class FourBarLinks(Part):
    """The links of a four-bar."""

    ground: Ground
    """The frame."""
    crank: Link
    """The driven link, from ground_crank to crank_coupler."""
    coupler: Link
    """From crank_coupler to coupler_rocker."""
    rocker: Link
    """From rocker_ground to coupler_rocker."""


class Pin(Part):
    """Keys that distinguish a joint from an ideal one."""

    clearance: Clearance | None = None
    """Pin on the first-named link, bushing on the second-named; without it the joint is ideal."""


class FourBarJoints(Part):
    """The joints of a four-bar."""

    ground_crank: Pin = Pin()
    """The crank's bearing in the frame."""
    crank_coupler: Pin = Pin()
    """The crank pin."""
    coupler_rocker: Pin = Pin()
    """The pin between coupler and rocker."""
    rocker_ground: Pin = Pin()
    """The rocker's bearing in the frame."""


class FourBarKeys(AnyScene):
    """Keys of a four-bar, but for its loads."""

    mechanism: Literal['four_bar'] = 'four_bar'
    """A template: links and joints have these names."""
    branch: Literal['open', 'crossed'] = 'open'
    """Where the coupler-rocker joint lies, seen from crank pin to rocker pivot; open: left."""
    links: FourBarLinks
    """Lengths and masses."""
    joints: FourBarJoints = FourBarJoints()
    """Those that are not ideal."""
    masses: dict[str, PointMass] = {}
    """Point masses that links carry, by name."""
    drive: DrivePart
    """Motion of the crank: by a speed, a profile, a torque or a motor."""
    initial: InitialPart = InitialPart()
    """Coordinates of a loose machine whose initial values differ from those of `start`."""
    sensors: dict[str, SensorPart] = Field({})
    """Accelerometers, encoders and others, by name."""


class FourBarScene(*LOAD_SECTIONS, FourBarKeys):  # type: ignore[misc]
    """A scene from the four-bar template."""

    @model_validator(mode='after')
    def _driven_by_its_crank(self) -> FourBarScene:
        if self.drive.coordinate not in (None, 'crank'):
            raise ValueError(
                f"drive.coordinate = '{self.drive.coordinate}' is not possible; allowed: 'crank' "
                "(another link drives where the linkage is written out, 'mechanism: linkage')"
            )
        return self


def expanded(scene: FourBarScene, content: Mapping[str, Any]) -> dict[str, Any]:
    """The keys and values of the linkage that a four-bar stands for.

    Parameters
    ----------
    scene, content : the four-bar, checked and as it was given
    """
    given, drive = content.get('joints') or {}, scene.drive
    driven = {key: x for key, x in content['drive'].items() if x is not None}
    said = scene.initial.position.get('crank')
    speed, start = 0.0, drive.start_angle or 0.0
    if isinstance(said, QuantityValue):
        start = said.value
    if drive.position:
        start, speed = drive.position.at_start
    elif isinstance(drive.speed, QuantityValue):
        speed = drive.speed.value
    l = scene.links  # noqa: E741
    linkage = FourBar(
        l.ground.length, l.crank.length, l.coupler.length, l.rocker.length, scene.branch
    )
    angle = beside_change_point(linkage, start, speed)
    th3, th4 = (float(x) for x in linkage.positions(np.array(angle)))
    written = {
        'joints': {n: {'revolute': ends, **(given.get(n) or {})} for n, ends in JOINTS.items()},
        'drive': {'coordinate': 'crank'}
        | ({} if drive.position else {'start_angle': 0.0})
        | driven,
        # where it cannot be assembled there is nothing to be near to
        'guess': {} if np.isnan(th3) else {'coupler': th3, 'rocker': th4},
    }
    return {k: x for k, x in content.items() if k != 'branch'} | {'mechanism': 'linkage'} | written
