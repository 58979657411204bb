"""States of first order: pressures, currents, integrals, which have a rate but no inertia."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Part, UnitValue
from mechanism_sim.linkages.formulas import FormulaState
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.formula_keys import check_formula, check_state_name, scope_of
from mechanism_sim.scene.load_keys import LOADS, ElementKeys, Elements
from mechanism_sim.units import QuantityValue, product, to_si_of, to_si_text

_UNITS = (
    'Pa',
    'm',
    'm/s',
    'rad',
    'rad/s',
    'N',
    'N m',
    'm^3',
    'kg',
    'A',
    'V',
    'K',
    'W',
    'Hz',
    's',
    '',
)
_LARGE = {'Pa': 1e5}  # sizes that matter, of quantities whose unit is far from what machines have


def _any(value: Any) -> QuantityValue:
    """A quantity of any unit."""
    if isinstance(value, list | tuple):  # as JSON has it, in an SI unit
        value = ' '.join(map(str, value))
    try:
        return to_si_of(value, _UNITS)
    except ValueError:
        return to_si_text(value)


_AnyQuantity = Annotated[QuantityValue, UnitValue(_any, ('Pa', 'A', ''), 'any other unit')]


class StatePart(ElementKeys):
    """A variable with a rate: a pressure, a current, an integral."""

    start: _AnyQuantity = QuantityValue(0.0, '')
    """At t = 0, as 20 bar. Its unit is that of the state, also in formulas with units."""
    rate: str
    """A formula of its rate, as "(20 bar - p)/2 s"; of t, links, LINK_rate and states."""
    scale: _AnyQuantity | None = None
    """Scale to which its errors are relative; else the start, at least 1 bar of a
    pressure and 1 in SI units of anything else."""

    def states(self, name: str) -> dict[str, str]:
        """Value with its unit."""
        return {name: self.start.unit}

    def read(self, places: Names, name: str, tree: Mechanism) -> Elements:
        """The state."""
        where, (start, unit) = f'states.{name}', self.start
        check_state_name(places, name)
        scale = self.scale
        if scale and scale.unit not in ('', unit):
            raise InputError(f'{where}.scale is in {scale.unit}, but start in {unit or "no unit"}')
        size = scale.value if scale else max(abs(start), _LARGE.get(unit, 1.0))
        if not (math.isfinite(start) and 0.0 < size < math.inf):
            raise InputError(f'{where} needs a finite start, and a scale above 0')
        check_formula(places, f'{where}.rate', self.rate, product(unit, 's', -1), tree, {})
        return formula_state(places, tree, name, unit, start, size, self.rate)


def formula_state(
    places: Names, tree: Mechanism, name: str, unit: str, start: float, size: float, rate: str
) -> Elements:
    """Maker of a state whose errors are relative to a `size`."""
    scope, scale = scope_of(places, tree), 2.0 ** math.frexp(size)[1]
    name = f'states.{name}'
    return lambda mechanism: [FormulaState(name, unit, start, scale, rate, scope(mechanism))]


@LOADS.add('states')
class FirstOrderStates(Part):
    """The states of first order of a scene."""

    states: dict[str, StatePart] = Field({})
    """Of first order: what has a rate but no inertia, by the names by which formulas know them."""
