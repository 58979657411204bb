"""From the clearances of a scene to gaps and films of the engine."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mechanism_sim.contact.compliant import Flores, Hertz, HuntCrossley, LankaraniNikravesh
from mechanism_sim.contact.film import ShortBearing
from mechanism_sim.linkages.bearing import BearingClearance, FilmBearing
from mechanism_sim.linkages.guide import corners
from mechanism_sim.linkages.slot import PinInSlot, SlotWall
from mechanism_sim.planar.mechanism import HigherPair, Mechanism, Prismatic
from mechanism_sim.planar.play import walls
from mechanism_sim.planar.protocols import ForceElement, ForceLaw, Gap
from mechanism_sim.scene.contact_keys import Clearance, Play


def gaps_and_films(
    mechanism: Mechanism, clearances: Mapping[str, Play]
) -> tuple[list[Gap], list[ForceElement]]:
    """The gaps of loose joints, and what those have instead that are elastic or full of oil."""
    gaps: list[Gap] = []
    films: list[ForceElement] = []
    for name, c in clearances.items():
        film = oil_film(c)
        joint = mechanism.joint(name)
        if isinstance(joint, HigherPair):
            films += joint.elements(mechanism)
            if not joint.elastic:
                closure, law = joint.closure(mechanism), force_law(c)
                if isinstance(joint, PinInSlot) and c.friction:
                    gaps += [
                        SlotWall(closure, side, c.radial, c.restitution, c.friction,
                                 c.hypothesis, law, c.pin_radius)
                        for side in joint.sides
                    ]  # fmt: skip
                else:
                    gaps += walls(closure, c.radial, c.restitution, c.hypothesis, law)
        elif isinstance(joint, Prismatic) and isinstance(c, Clearance):
            gaps += corners(
                mechanism, name, c.length or 0.0, c.height or 0.0, c.radial, c.restitution,
                c.friction, c.hypothesis, force_law(c),
            )  # fmt: skip
        elif film:
            films.append(FilmBearing(name, mechanism, film))
        else:
            gaps.append(
                BearingClearance(
                    name, mechanism, c.radial, c.restitution, c.friction, c.hypothesis,
                    c.pin_radius, force_law(c),
                )
            )  # fmt: skip
    return gaps, films


def oil_film(clearance: Play) -> ShortBearing | None:
    """The film of a lubricated bearing; ``None`` for a dry one."""
    contact = clearance.contact
    if contact is None or contact.law != 'film':
        return None
    given = (contact.viscosity, contact.width, contact.radius)
    viscosity, width, radius = (value or 0.0 for value in given)  # checked to be there
    return ShortBearing(viscosity, width, radius, clearance.radial)


def force_law(clearance: Play) -> ForceLaw | None:
    """The law of a compliant contact; ``None`` for a rigid one."""
    contact, e = clearance.contact, clearance.restitution
    if contact is None or contact.law == 'film' or contact.stiffness is None:
        return None
    if contact.law == 'hertz':
        return Hertz(contact.stiffness, contact.exponent)
    laws: dict[str, Callable[[float, float, float], ForceLaw]] = {
        'hunt_crossley': HuntCrossley,
        'lankarani_nikravesh': LankaraniNikravesh,
        'flores': Flores,
    }
    return laws[contact.law](contact.stiffness, e, contact.exponent)
