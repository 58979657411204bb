"""From the clearances of a scene to gaps and films of the engine."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from mechanism_sim.contact.compliant import Flores, Hertz, HuntCrossley, LankaraniNikravesh
from mechanism_sim.contact.film import ShortBearing
from mechanism_sim.joints.contact_keys import AxialPlay, Clearance, Misalignment, Play
from mechanism_sim.joints.prismatic.contact import corners
from mechanism_sim.joints.revolute.bearing import BearingClearance, FilmBearing
from mechanism_sim.joints.revolute.bearing_ends import axial_stops, bearing_ends
from mechanism_sim.planar.mechanism import HigherPair, Mechanism, Prismatic
from mechanism_sim.planar.play import walls
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.planar.protocols import ForceElement, ForceLaw, Gap

_IN_LINE = 1e-5


def gaps_and_films(
    mechanism: Mechanism, clearances: Mapping[str, Play]
) -> tuple[list[Gap], list[ForceElement]]:
    """The gaps of loose joints, and what those have instead that are elastic or full of oil."""
    gaps: list[Gap] = []
    films: list[ForceElement] = []
    for name, c in clearances.items():
        joint = mechanism.joint(name)
        if isinstance(joint, HigherPair):
            films += joint.elements(mechanism)
            if not joint.elastic:
                gaps += walls(
                    joint.closure(mechanism), c.radial, c.restitution, c.friction, c.hypothesis,
                    force_law(c), c.pin_radius,
                )  # fmt: skip
        elif isinstance(joint, Prismatic) and isinstance(c, Clearance):
            gaps += corners(
                mechanism, name, c.length or 0.0, c.height or 0.0, c.radial, c.restitution,
                c.friction, c.hypothesis, force_law(c),
            )  # fmt: skip
        else:
            reach, arm = c.radial, c.pin_radius
            if film := oil_film(c):
                arm = film.radius
                reach -= (c.contact and c.contact.roughness) or 0.0
                films.append(
                    FilmBearing(name, mechanism, film, reach if c.wall else 0.0, c.wall == 'soft')
                )
            if c.wall:
                leans = leaning(mechanism, name, c)
                gap = BearingClearance(
                    name, mechanism, reach, c.restitution, c.friction, c.hypothesis, arm,
                    force_law(c, 0.5 if leans else 1.0),
                )  # fmt: skip
                gaps += bearing_ends(gap, *leans) if leans else [gap]
            if isinstance(c, Clearance) and c.axial:
                gaps += stops(mechanism, name, c, c.axial)
    return gaps, films


def stops(mechanism: Mechanism, joint: str, c: Clearance, axial: AxialPlay) -> Iterable[Gap]:
    """Those along the axis of a bearing."""
    e = c.restitution if axial.restitution is None else axial.restitution
    pin, bushing = inclinations(c)
    return axial_stops(
        mechanism, joint, axial.play, restitution=e, hypothesis=c.hypothesis,
        law=force_law(c.model_copy(update={'restitution': e})), radius=axial.face_radius or 0.0,
        crown=axial.crown or 0.0, pin=pin, bushing=bushing,
    )  # fmt: skip


def inclinations(clearance: Clearance) -> tuple[Vector2, Vector2]:
    """Of pin and bushing by manufacture [rad]."""
    given = clearance.misalignment or Misalignment()
    pin, bushing = (x.inclination if x else (0.0, 0.0) for x in (given.pin, given.bushing))
    return pin, bushing


def oil_film(clearance: Play) -> ShortBearing | None:
    """The film of a lubricated bearing; ``None`` for a dry one."""
    contact = clearance.contact
    if contact is None or contact.law != 'film':
        return None
    given = (contact.viscosity, contact.width, contact.radius)
    viscosity, width, radius = (value or 0.0 for value in given)  # checked to be there
    full = contact.cavitation == 'none'
    supply = contact.supply_pressure - contact.cavitation_pressure
    return ShortBearing(viscosity, width, radius, clearance.radial, full, supply)


class Leaning(NamedTuple):
    """A bearing whose ends differ, see `bearing_ends`."""

    length: float  #: [m]
    pin: Vector2  #: [rad] inclination by manufacture
    bushing: Vector2  #: [rad]
    along: float  #: [m]


def leaning(mechanism: Mechanism, joint: str, clearance: Play) -> Leaning | None:
    """How the axes of a bearing lean against each other; None if its ends do not differ.

    Within a hundred thousandth of the clearance at its ends they count as in line.
    """
    if not isinstance(clearance, Clearance) or not clearance.length:
        return None
    length, (pin, bushing) = clearance.length, inclinations(clearance)
    off = 0.5 * length * (math.hypot(*pin) + math.hypot(*bushing))
    ends = (mechanism.joint(joint).first, mechanism.joint(joint).second)
    leans = any(mechanism.body(link).tilt for link in ends if link != GROUND)
    if not leans and off <= _IN_LINE * clearance.radial:
        return None
    return Leaning(length, pin, bushing, clearance.along)


def force_law(clearance: Play, share: float = 1.0) -> ForceLaw | None:
    """The law of a compliant contact with a share of the stiffness; ``None`` for a rigid one."""
    contact, e = clearance.contact, clearance.restitution
    if contact is None or contact.stiffness is None:
        return None
    if contact.law in ('hertz', 'film'):
        return Hertz(share * contact.stiffness, contact.exponent)
    laws: dict[str, Callable[[float, float, float], ForceLaw]] = {
        'hunt_crossley': HuntCrossley,
        'lankarani_nikravesh': LankaraniNikravesh,
        'flores': Flores,
    }
    return laws[contact.law](share * contact.stiffness, e, contact.exponent)
