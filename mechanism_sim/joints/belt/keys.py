"""Belts and chains: two pulleys whose strands pull, ideal or with the stiffness of the strands."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Annotated, Any

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.joints.belt.constraint import Belt
from mechanism_sim.joints.contact_keys import ClearanceSpec, Friction
from mechanism_sim.joints.joint_keys import KINDS, Reference
from mechanism_sim.joints.transmission.keys import PhaseKeys, carrier_of
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Length, si
from mechanism_sim.planar.joint_friction import FlankFriction
from mechanism_sim.planar.mechanism import Mechanism

_LARGEST = 10_000  # of the whole numbers whose ratio the radii have


@KINDS.add('belt')
class BeltKeys(PhaseKeys):
    """A belt or a chain."""

    belt: Reference | None = None
    """Centres of the two pulleys or chain wheels."""
    radii: tuple[Length, Length] | None = None
    """Radii of the first and the second pulley, to the middle of the belt; required."""
    crossed: bool = False
    """True if the strands cross, so that the pulleys turn in opposite directions."""
    stiffness: Annotated[float, si('N/m'), Field(gt=0.0)] | None = None
    """Stiffness of each strand; without it the belt is ideal."""
    damping: Annotated[float, si('N s/m'), Field(ge=0.0)] = 0.0
    """Damping of each strand while it is taut."""
    pretension: Annotated[float, si('N'), Field(ge=0.0)] = 0.0
    """In each strand at the start, or on the mean of both where friction holds the belt; 0 for a
    chain, of which one strand pulls at a time."""
    carrier: str | None = None
    """Link that carries both shafts; the ground if not given."""

    firm = 'belts and chains have strands'
    friction_keys = ('groove', 'efficiency'), False
    friction_when_loose = True

    def read(self, names: Names, name: str) -> Belt:
        """Between two pulleys on a carrier."""
        where = f'joints.{name}'
        (a, on_a), (b, on_b) = names.ends(name)
        if self.radii is None:
            raise InputError(
                f"{where}.radii is missing: of both pulleys, such as '[40 mm, 60 mm]'"
            )
        carrier = carrier_of(names, name, self)
        (one, centre, at_one), (two, far, at_two) = (
            names.shaft(f'joints.{name}', link, carrier) for link in (a, b)
        )
        for link, own, given in ((a, at_one, on_a), (b, at_two, on_b)):
            if own != given:
                raise InputError(f'{where}.belt: name the point of {link} on which it turns')
        (r1, r2), apart = self.radii, (far[0] - centre[0], far[1] - centre[1])
        d, least = math.hypot(*apart), r1 + r2 if self.crossed else abs(r1 - r2)
        if d <= least:
            raise InputError(
                f'{where}.radii: no {"crossed " * self.crossed}belt goes round pulleys of {r1:g} '
                f'm and {r2:g} m that are {d:g} m apart: it must be more than {least:g} m'
            )
        ratio = Fraction(r1 / r2).limit_denominator(_LARGEST)
        if not self.stiffness and (
            ratio.numerator > _LARGEST or abs(ratio * Fraction(r2) / Fraction(r1) - 1) > 1e-12
        ):
            raise InputError(
                f'{where}.radii: {r1:g} m to {r2:g} m is not a ratio of whole numbers up to '
                f"{_LARGEST}: write fewer digits, or give the belt a 'stiffness'"
            )
        held = self._held()
        if held is not None and self.stiffness:
            raise InputError(f'{where}.friction: elastic strands do not slip: leave out one')
        if held is not None and not self.pretension:
            raise InputError(
                f"{where}.pretension is missing: friction depends on it: give it, as '200 N'"
            )
        for key in ('damping', 'pretension'):
            allowed = held is not None and key == 'pretension'
            if getattr(self, key) and not (self.stiffness or allowed):
                raise InputError(f"{where}.{key} needs 'stiffness': an ideal belt has none")
        return Belt(
            name, a, b, on_a, on_b, -ratio if self.crossed else ratio, self.phase, carrier,
            self.radii, centre, apart, (one, two), self.stiffness or 0.0, self.damping,
            self.pretension, held,
        )  # fmt: skip

    def _held(self) -> float | None:
        """Coefficient of friction of a belt held by it alone, reduced to flat pulleys."""
        given = self.friction
        if given is None or given.efficiency is not None:
            return None
        return given.coefficient / math.sin(0.5 * (given.groove or math.pi))

    def frictions(self, given: Friction, joint: Any, mechanism: Mechanism) -> list[FlankFriction]:
        """Friction of a chain: of its efficiency e it loses ``k = 2 (1 - e)/(1 + e)`` of the pull.

        Half of that acts on each wheel against its turning: with the pull N they have
        ``(1 + k/2) N`` and ``(1 - k/2) N``.
        """
        if given.efficiency in (None, 1.0):
            return []
        (r1, r2), s = joint.radii, joint.sense
        lost = 2.0 * (1.0 - given.efficiency) / (1.0 + given.efficiency)
        arms = 0.5 * r1, 0.5 * s * r2
        return [FlankFriction(joint.name, mechanism, lost, arms, s * r2, joint.carrier)]

    def clearance_spec(self, joint: Any) -> ClearanceSpec | None:
        """Clearance of elastic or slipping strands: of zero width; None of others."""
        soft = self.stiffness or self._held() is not None
        return ClearanceSpec(radial=0.0, restitution=0.0) if soft else None

    def mounted(self, joint: Any, start: Mapping[str, float], turned: Mapping[str, int]) -> Belt:
        """Belt at the nearest of the angles at which it fits; elastic strands count turns."""
        links = joint.first, joint.second, joint.carrier
        a, b, c = (start.get(link, 0.0) for link in links)
        one, two, three = (turned.get(link, 0) for link in links)
        step = 2.0 * math.pi / joint.ratio.denominator
        off = (b - c) - joint.phase - float(joint.ratio) * (a - c)
        phase = joint.phase + step * round(off / step)
        belt: Belt = replace(joint, phase=phase, begun=(one, two, three))
        return belt

    def notes(self, machine: Any, joint: Belt) -> list[str]:
        """The largest pull."""
        if joint.friction is None:
            return []
        wrap, ratio = math.degrees(joint.wrap), math.exp(joint.friction * joint.wrap)
        return [
            f'{joint.name}: slips beyond a ratio of tensions of {ratio:.4g}, by {wrap:.4g} deg of '
            f'contact, that is a difference of {joint.most:.6g} N'
        ]
