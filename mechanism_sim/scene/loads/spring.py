"""Springs and dampers between two points, by their angles between two links, or along a guide."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from mechanism_sim.errors import InputError, check_known
from mechanism_sim.joints.joint_keys import Reference
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import POSITIVE, Angle, Length, Part, UnitValue, si, si_of
from mechanism_sim.linkages.springs import (
    Elongation,
    GasColumn,
    GuidedSpring,
    Spring,
    SpringLaw,
    TorsionSpring,
)
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.formula_keys import (
    ForceOrFormula,
    TorqueOrFormula,
    check_formula,
    scope_of,
)
from mechanism_sim.scene.load_keys import LOADS, ElementKeys, Elements
from mechanism_sim.units import QuantityValue, to_si_of


def _or_table(*units: str) -> UnitValue:
    """A quantity, or the name of a table."""

    def read(value: Any) -> QuantityValue | str:
        if isinstance(value, str) and value.isidentifier():
            return value
        if isinstance(value, dict):
            raise ValueError(
                "is neither a quantity nor the name of a table: write a table under 'tables', and "
                'its name here'
            )
        return to_si_of(value, units)

    return UnitValue(read, units, 'the name of a table')


Stiffness = Annotated[QuantityValue | str, _or_table('N/m', 'N m/rad')]
Damping = Annotated[QuantityValue | str, _or_table('N s/m', 'N m s/rad')]
_Preload = Annotated[QuantityValue, si_of('N', 'N m')]

_NONE = SpringLaw()
Placing = Callable[[Mechanism], Elongation]
"""Function from a tree of the mechanism to an element between two of its links."""

_SIDES = {'both': 0, 'above': 1, 'below': -1}


class GasPart(Part):
    """Gas behind a piston, with a polytropic force."""

    force: Annotated[float, si('N'), POSITIVE]
    """Force at the free length."""
    column: Length
    """Height of the gas at the free length; at so much less length there is no room for it."""
    exponent: Annotated[float, si(''), POSITIVE] = 1.0
    """Polytropic exponent: 1 for slow changes, 1.4 for fast ones of nitrogen or air."""


class SpringPart(ElementKeys):
    """Between two points, or, with an angular stiffness, between two links."""

    section: ClassVar[str] = 'springs'

    between: Reference | None = None
    """Two points; two links for a torsion spring."""
    coordinate: str | None = None
    """Instead of two points a link, on whose displacement in its guide, or angle, it acts."""
    stiffness: Stiffness = QuantityValue(0.0, '')
    """Per length or per angle, which says what kind of spring it is; or a table of force over
    elongation."""
    damping: Damping = QuantityValue(0.0, '')
    """Per speed of the same kind; or a table of force over the rate of the length."""
    free_length: Annotated[float, si('m')] | None = None
    """Length without force; 0 if not given."""
    free_angle: Angle | None = None
    """Angle of a torsion spring without torque; 0 if not given."""
    preload: _Preload = QuantityValue(0.0, '')
    """Force or torque at its free length or angle, positive if it pulls."""
    gas: GasPart | None = None
    """A gas spring, in compression."""
    force: ForceOrFormula = 0.0
    """With which it pulls besides: a formula of `length`, `rate`, t, links, states."""
    torque: TorqueOrFormula = 0.0
    """Of a torsion spring likewise, of `angle` and `rate`: it turns the second link back."""
    acts: Literal['both', 'above', 'below'] = 'both'
    """Above or below its free length or angle only, and never against that: a bump stop acts
    below, a check strap above."""

    other_words: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(('k', 'rate'), "'stiffness'"),
        'c': "'damping'",
    }

    @model_validator(mode='after')
    def _one_place(self) -> SpringPart:
        if (self.between is None) == (self.coordinate is None):
            raise ValueError("needs one of: 'between' with two points, 'coordinate' with a link")
        return self

    def read(self, places: Names, name: str, tree: Mechanism) -> Elements:
        """A straight spring, a torsion spring, or one along a guide."""
        where = f'{self.section}.{name}'
        torsional = self._is_torsional(places, where, tree)
        if torsional and self.free_length is not None:
            raise InputError(f'{where}: a torsion spring has a free_angle')
        if not torsional and self.free_angle is not None:
            raise InputError(f'{where}: a straight spring has a free_length')
        for quantity in (self.stiffness, self.damping):
            if not isinstance(quantity, str) and quantity.value < 0.0:
                raise InputError(f'{where}: stiffness and damping cannot be negative')
        law, scope = self._law(places, where, torsional, tree), scope_of(places, tree)
        placed = self.placed(places, name, tree)
        return lambda mechanism: [replace(placed(mechanism), law=law(scope(mechanism)))]

    def placed(self, places: Names, name: str, tree: Mechanism) -> Placing:
        """Maker of its element, as yet without force."""
        where, free = f'{self.section}.{name}', self.free_length or 0.0
        own = [places.find(f'{where}.between', p) for p in self.between or []]
        if own and own[0][0] == own[1][0]:
            raise InputError(f'{where}.between names one link twice')
        if self._is_torsional(places, where, tree):
            a, b = [link for link, _ in own] or [GROUND, str(self.coordinate)]
            return lambda m: TorsionSpring(where, m, _NONE, a, b, self.free_angle or 0.0)
        if self.coordinate:
            joint = tree.tree_joints[self.coordinate]
            a_end, b_end = joint.points
            return lambda m: GuidedSpring(where, m, _NONE, a_end, b_end, free, joint.name)
        first, second = own
        return lambda m: Spring(where, m, _NONE, first, second, free)

    def measures(self, places: Names, name: str, tree: Mechanism) -> dict[str, str]:
        """Names behind its own in formulas, with units."""
        if self._is_torsional(places, f'{self.section}.{name}', tree):
            return {'angle': 'rad', 'rate': 'rad/s'}
        return {'length': 'm', 'rate': 'm/s'}

    def _is_torsional(self, places: Names, where: str, tree: Mechanism) -> bool:
        """True if its quantities are per angle; refuses what does not say, and mixtures."""
        units = [
            x.unit for x in (self.stiffness, self.damping, self.preload) if not isinstance(x, str)
        ]
        kinds = {unit == 'N m' or unit.endswith('rad') for unit in units if unit}
        if self.coordinate:
            kinds.add(
                places.coordinate(f'{where}.coordinate', self.coordinate) not in tree.sliding
            )
        for key, along in (('stiffness', ('m', 'rad')), ('damping', ('m/s', 'rad/s'))):
            named = getattr(self, key)
            if not isinstance(named, str):
                continue
            tables = places.scene.tables
            wrong = f"{where}.{key}: there is no table '{named}'"
            check_known(named, tables, wrong, 'tables:')
            x, y = (m.unit for m in tables[named].points[0])
            if x not in ('', *along) or tables[named].curve.cyclic:
                raise InputError(
                    f'{where}.{key}: the table {named} must be over {along[0]} or {along[1]}, and '
                    'not cyclic'
                )
            if y not in ('', 'N', 'N m'):
                raise InputError(
                    f'{where}.{key}: the values of the table {named} must be in N or N m, not in '
                    f'{y}'
                )
            kinds |= {x == along[1]} if x else set()
            kinds |= {y == 'N m'} if y else set()
        kinds |= {True} if self.torque else set()
        kinds |= {False} if self.force or self.gas else set()
        if not kinds:  # numbers without units, as searches and sweeps give them
            kinds |= {False} if self.free_length is not None else set()
            kinds |= {True} if self.free_angle is not None else set()
        if len(kinds) != 1:
            raise InputError(
                f"{where}: give stiffness and damping both per length ('200 N/m', '5 N s/m') or "
                "both per angle ('3 N m/rad', '0.1 N m s/rad')"
            )
        return kinds.pop()

    def _law(self, places: Names, where: str, torsional: bool, tree: Mechanism) -> Any:
        """Maker of its law for the meanings of names in one tree."""
        tables = places.scene.tables
        stiffness, damping = (
            tables[x].curve if isinstance(x, str) else x.value
            for x in (self.stiffness, self.damping)
        )
        given, preload = self.torque if torsional else self.force, self.preload.value
        if isinstance(given, str):
            own = (
                {'angle': 'rad', 'rate': 'rad/s'} if torsional else {'length': 'm', 'rate': 'm/s'}
            )
            key, unit = ('torque', 'N m') if torsional else ('force', 'N')
            check_formula(places, f'{where}.{key}', given, unit, tree, own)
        else:
            preload, given = preload + given, ''
        g = self.gas
        gas = GasColumn(g.force, g.column, g.exponent) if g else None
        side = _SIDES[self.acts]
        return lambda scope: SpringLaw(stiffness, damping, preload, gas, side, given, scope)


@LOADS.add('springs')
class Springs(Part):
    """The springs of a scene."""

    springs: dict[str, SpringPart] = Field({})
    """With their dampers, by name."""
