"""Formulas as values of keys: how they are read, what they may name, and their units."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Annotated, Any, Protocol

import heyoka as hy
import numpy as np

from mechanism_sim.errors import InputError, nearest, quoted
from mechanism_sim.keys.names import RESERVED, Names
from mechanism_sim.keys.quantities import UnitValue
from mechanism_sim.linkages.formulas import FormulaScope
from mechanism_sim.numerics import formula
from mechanism_sim.numerics.expressions import (
    ExpressionNode,
    check_bare_numbers,
    numbers,
    parse,
    unit_hint,
    unit_of,
)
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.units import (
    QuantityValue,
    alike,
    has_decimal_comma,
    power_hint,
    to_si,
    to_si_of,
)

_OF_POINT = {'x': 'm', 'y': 'm', 'vx': 'm/s', 'vy': 'm/s'}
"""Names in formulas of loads for the point at which they act, with units."""
TIME = 't'
"""Name of the time in formulas."""
_TO_DEGREES = 12.0
"""Factor on an angle in a table's argument: ratios of gears are below, 57.3 is not."""
_OF_SPRING = {'length': 'm', 'angle': 'rad', 'rate': ''}
"""Names in formulas of springs for themselves: these are no names of states."""


class _PointsOfTable(Protocol):
    """A table of a scene, whose keys are read in a module above."""

    points: Sequence[tuple[QuantityValue, QuantityValue]]


def or_formula(*units: str) -> UnitValue:
    """A quantity, or a formula such as ``-5*vx + 3*sin(20*t)``.

    Of one of several units it is a `QuantityValue`.
    """

    def read(value: Any) -> float | QuantityValue | str:
        try:
            return to_si(value, *units) if len(units) == 1 else to_si_of(value, units)
        except ValueError as error:
            if not isinstance(value, str) or has_decimal_comma(value):
                raise
            try:
                tree = parse(value, None)
            except InputError as other:
                number = re.match(r'\s*[-+]?[\d.]+[^(*+,=^]*$', value) and ' if ' not in value
                raise (error if number else ValueError(f'cannot be read: {other}')) from other
            if all(n.kind in ('number', 'negative') for n in tree.walk()):
                raise
            return value

    return UnitValue(read, units, 'a formula')


ForceOrFormula = Annotated[float | str, or_formula('N')]
TorqueOrFormula = Annotated[float | str, or_formula('N m')]
EffortOrFormula = Annotated[QuantityValue | str, or_formula('N m', 'N')]


def _state_units(names: Names) -> dict[str, str]:
    """The states of first order of a scene in the order of their numbers, with their units."""
    return {
        state: unit
        for section in ('states', 'servos')
        for name, part in getattr(names.scene, section).items()
        for state, unit in part.states(name).items()
    }


def check_state_name(names: Names, name: str) -> None:
    """Refuse names of states that formulas know otherwise."""
    taken = {*RESERVED, *_OF_SPRING, *names.links, *(f'{x}_rate' for x in names.links)}
    if not name.isidentifier() or name in taken:
        raise InputError(
            f"states.{name}: the name '{name}' cannot be used; names are letters, digits and _, "
            f'but not {", ".join([*RESERVED, *_OF_SPRING])}, a link, or LINK_rate, which formulas '
            'name'
        )


def scope_of(names: Names, tree: Mechanism) -> Callable[[Mechanism], FormulaScope]:
    """Meanings of names in formulas, for any tree of a mechanism."""
    guided = {c: tree.tree_joints[c].name for c in tree.sliding}
    tables = {n: table.curve for n, table in names.scene.tables.items()}
    states = [*_state_units(names)]
    parts = names.scene.springs | names.scene.servos
    springs = {n: part.placed(names, n, tree) for n, part in parts.items()}
    return lambda mechanism: FormulaScope(mechanism, guided, tables, states, springs)


def check_formula(
    places: Names,
    where: str,
    text: str,
    unit: str | None,
    tree: Mechanism,
    own: Mapping[str, str] = _OF_POINT,
) -> None:
    """Refuse a formula that names or calls what is not known, or that is not in `unit`.

    Without any unit in its text but of angles all is taken to be in SI units.

    Parameters
    ----------
    unit : required unit; None for any
    own : local names with their units
    """
    states = _state_units(places)
    units: dict[str, str | None] = {x: of or None for x, of in states.items()}
    units |= {TIME: 's', **own}
    for spring, part in (places.scene.springs | places.scene.servos).items():
        units |= {f'{spring}.{x}': of for x, of in part.measures(places, spring, tree).items()}
    for link in places.links:
        units[link] = of = 'm' if link in tree.sliding else 'rad'
        units[f'{link}_rate'] = f'{of}/s'
    tables = places.scene.tables
    try:
        root = formula.read(text, tables)
        for node in root.walk():
            if {x.kind for x in node.walk()}.isdisjoint({'name'}) and not _has_value(node, tables):
                raise InputError(f'{quoted(node.text)} in the formula {quoted(text)} has no value')
        springs = [x for x in units if '.' in x and x not in states]
        for other in root.names:
            if other not in units:
                raise InputError(
                    f"the formula {quoted(text)} names '{other}'"
                    f'{unit_hint(other) or nearest(other, units)}; it may name '
                    f'{", ".join(["t", *own, *states, *springs, "a link"])}, or LINK_rate'
                )
            if other.endswith('_rate') and {other, other.removesuffix('_rate')} <= {*places.links}:
                raise InputError(
                    f"'{other}' in the formula {quoted(text)} may be the link {other} or the rate "
                    f'of {other.removesuffix("_rate")}; call one of the links otherwise'
                )
        symbols = {x: hy.expression(x) for x in units}
        _refuse_degrees(root, tables, [x for x in places.links if x not in tree.sliding])
        formula.expression(text, formula.Words(symbols, tables=dict.fromkeys(tables, lambda x: x)))
        named = {n.name for n in root.walk() if n.kind == 'call'}
        read = [table.points[0][1].unit for name, table in tables.items() if name in named]
        given = [n.unit or '' for n in root.walk()]
        # degrees are plain numbers; of forces in tables all may be in SI units, pressures say more
        if not all(alike(x, '') for x in given) or not {*read} <= {'N', 'N m', ''}:
            units |= {f'{n}()': table.points[0][1].unit or None for n, table in tables.items()}
            _check_units(root, units, text, unit, _starts(places, [*root.names, where]))
    except InputError as error:
        raise InputError(f'{where}: {error}') from error


def table_calls(
    root: ExpressionNode, tables: Collection[str], links: Collection[str]
) -> Iterator[tuple[ExpressionNode, dict[str, float]]]:
    """Calls of tables in a formula at sums of angles, with the factors of each link.

    Parameters
    ----------
    links : rotating links; the time may be one
    """
    for node in root.walk():
        if node.kind == 'call' and node.name in tables:
            found = formula.coefficients(node.args[0], links)
            if found and all(abs(n) < _TO_DEGREES or x == TIME for x, n in found.items()):
                yield node, found


def _refuse_degrees(
    root: ExpressionNode, tables: Mapping[str, _PointsOfTable], links: Collection[str]
) -> None:
    """Refuse bare places of a table, whole quarters of a turn in degrees, that are read in rad."""
    for node, _ in table_calls(root, tables, links):
        (first, _), *_, (last, _) = tables[node.name].points
        span = last.value - first.value
        if not last.unit and span > 2.0 * TWO_PI and not span % 90.0:
            raise InputError(
                f'{node.text} reads the places of tables.{node.name}, {first.value:g} to '
                f"{last.value:g} without a unit, in rad: write '{last.value:g} deg', or "
                f"'{last.value:g} rad' if they are, in the heading of a file 'angle [deg]'"
            )


def _has_value(node: ExpressionNode, tables: Collection[str]) -> bool:
    """False of a part that names nothing and is infinite or undefined, as ``1/0``."""
    called = {x.name for x in node.walk() if x.kind == 'call'}
    return not called.isdisjoint(tables) or bool(np.isfinite(numbers(node, {})))


def _starts(places: Names, named: Collection[str]) -> str:
    """Units by their starts of the states that a formula names, or whose rate it is."""
    return ''.join(
        f'; states.{name}.start is {f"in {unit}" if unit else "a plain number"}'
        for name, part in places.scene.states.items()
        for unit in [part.start.unit]
        if (unit and name in named) or f'states.{name}.rate' in named
    )


def _check_units(
    root: ExpressionNode, units: Mapping[str, str | None], text: str, unit: str | None, said: str
) -> None:
    """Refuse a formula whose units contradict each other or the wanted one, and `said` why."""
    try:
        found = unit_of(root, units, text)
        check_bare_numbers(root, units, text)
    except InputError as error:
        raise InputError(f'{error}{said}') from error
    if unit is not None and found is not None and not alike(found, unit):
        said = f'{power_hint(text)}{said}'
        raise InputError(f'{quoted(text)} is in {found or "no unit"}, not in {unit}{said}')
