"""Springs and dampers between two points, or, by their angles, between two links."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.joints.joint_keys import Reference
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Angle, Part, si, si_of
from mechanism_sim.linkages.forces import Spring, TorsionSpring
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import ForceElement
from mechanism_sim.scene.load_keys import LOADS, ElementKeys, Elements
from mechanism_sim.units import QuantityValue

Stiffness = Annotated[QuantityValue, si_of('N/m', 'N m/rad')]
Damping = Annotated[QuantityValue, si_of('N s/m', 'N m s/rad')]


class SpringPart(ElementKeys):
    """Between two points, or, with an angular stiffness, between two links."""

    between: Reference
    """Two points; two links for a torsion spring."""
    stiffness: Stiffness = QuantityValue(0.0, '')
    """Per length or per angle, which says what kind of spring it is."""
    damping: Damping = QuantityValue(0.0, '')
    """Per speed of the same kind."""
    free_length: Annotated[float, si('m')] | None = None
    """Where it pulls nothing; else 0."""
    free_angle: Angle | None = None
    """Where a torsion spring turns nothing; else 0."""

    def read(self, places: Names, name: str, tree: Mechanism) -> Elements:
        """A straight spring, or a torsion spring."""
        where = f'springs.{name}'
        (a, on_a), (b, on_b) = (places.find(f'springs.{name}.between', p) for p in self.between)
        stiffness, damping = self.stiffness, self.damping
        if a == b:
            raise InputError(f'{where}.between names one link twice')
        kinds = {m.unit.endswith('rad') for m in (stiffness, damping) if m.unit}
        if len(kinds) != 1:
            raise InputError(
                f"{where}: give stiffness and damping both per length ('200 N/m', '5 N s/m') or "
                "both per angle ('3 N m/rad', '0.1 N m s/rad')"
            )
        (torsional,) = kinds
        if torsional and self.free_length is not None:
            raise InputError(f'{where}: a torsion spring has a free_angle')
        if not torsional and self.free_angle is not None:
            raise InputError(f'{where}: a straight spring has a free_length')
        if min(stiffness.value, damping.value) < 0.0:
            raise InputError(f'{where}: stiffness and damping cannot be negative')

        def made(mechanism: Mechanism) -> list[ForceElement]:
            key, k, c = f'springs.{name}', stiffness.value, damping.value
            if torsional:
                return [TorsionSpring(key, mechanism, a, b, k, self.free_angle or 0.0, c)]
            free = self.free_length or 0.0
            return [Spring(key, mechanism, (a, on_a), (b, on_b), k, free, c)]

        return made


@LOADS.add('springs')
class Springs(Part):
    """The springs of a scene."""

    springs: dict[str, SpringPart] = Field({})
    """With their dampers, by name."""
