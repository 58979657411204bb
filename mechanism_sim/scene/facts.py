"""Facts of a key by its schema: unit, bounds, choices; parts as files give them, with units."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

import yaml
from pydantic.fields import FieldInfo

from mechanism_sim.keys.quantities import Part, UnitValue
from mechanism_sim.units import QuantityValue, to_si

COMPONENTS = 'x', 'y'
"""Last words of paths of one of both numbers of a point or vector."""

_BOUNDS = {'gt': '>', 'ge': '>=', 'lt': '<', 'le': '<='}


class Facts(NamedTuple):
    """Facts about one key."""

    part: type[Part] | None  #: the kind of part it holds, if it holds parts
    many: Literal['', 'list', 'dict']  #: ``list`` or ``dict`` by name, if there are several
    named: bool  #: True if it holds values by name
    quantities: tuple[UnitValue, ...]  #: quantities of its numbers, in order
    bounds: tuple[str, ...]  #: bounds in words
    choices: tuple[str, ...]  #: allowed values, if few

    def render(self) -> str:
        """Unit, bounds and choices, as in ``m, > 0``; empty without any."""
        units = dict.fromkeys(' or '.join(filter(None, q.units)) for q in self.quantities)
        text = ', '.join([*filter(None, units), *self.bounds])
        others = list(dict.fromkeys(q.other for q in self.quantities if q.other))
        *most, last = self.choices or others or ['']
        choices = f'{", ".join(most)} or {last}' if most else last if others else ''
        return f'{text} or {choices}' if text and choices else text or choices


def facts_of(field: FieldInfo) -> Facts:
    """Unit, bounds and choices of a field of a schema."""
    kinds, notes = [], []
    for kind, note in _walk(field.annotation, field.metadata):
        kinds.append(kind)
        notes.append(note)
    parts = [k for k in kinds if isinstance(k, type) and issubclass(k, Part)]
    several = {list, tuple, dict} & set(kinds)
    bounds = {
        sign: f'{getattr(note, name):g}'
        for note in notes
        for name, sign in _BOUNDS.items()
        if getattr(note, name, None) is not None and not several
    }
    whole = ['whole number'] if int in kinds and not several else []
    choices = [str(value) for k in kinds if get_origin(k) is Literal for value in get_args(k)]
    return Facts(
        parts[0] if parts else None,
        '' if not (parts and several) else 'dict' if dict in several else 'list',
        dict in several,
        tuple(note for note in notes if isinstance(note, UnitValue)),
        (*whole, *_range(bounds)),
        (*choices, *(['true', 'false'] if bool in kinds else [])),
    )


def value_at(scene: Part, path: str) -> tuple[Any, str]:
    """Value at a dotted path of a scene, None where there is none, and its SI unit.

    That is empty of a plain number, and where the place decides which of several it is in.
    """
    value, units = units_at(scene, path)
    return value, units[0] if len(units) == 1 else ''


def units_at(scene: Part, path: str) -> tuple[Any, tuple[str, ...]]:
    """Value at a dotted path of a scene, and the SI units of which it has one."""
    value: Any = scene
    units: tuple[str, ...] = ()
    for name in path.split('.'):
        if isinstance(value, Part):
            keys = {field.alias or key: key for key, field in type(value).model_fields.items()}
            key = keys.get(name, name)
            if key not in type(value).model_fields:
                return None, ()
            known = facts_of(type(value).model_fields[key]).quantities
            units = tuple(dict.fromkeys(unit for note in known for unit in note.units))
            value = getattr(value, key)
        elif isinstance(value, Mapping):
            value = value.get(name)
        elif isinstance(value, list | tuple) and name in COMPONENTS[: len(value)]:
            value = value[COMPONENTS.index(name)]
        elif isinstance(value, list | tuple) and name.isdecimal() and int(name) < len(value):
            value = value[int(name)]
        else:
            return None, ()
    return value, (value.unit,) if isinstance(value, QuantityValue) and value.unit else units


def _range(bounds: Mapping[str, str]) -> list[str]:
    """Bounds in words."""
    if bounds.keys() == {'>=', '<='}:
        return [f'{bounds[">="]} to {bounds["<="]}']
    return [f'{sign} {bound}' for sign, bound in bounds.items()]


def _walk(kind: Any, notes: Iterable[Any] = ()) -> Iterator[tuple[Any, Any]]:
    """All types within a type, and what is noted on them."""
    for note in notes:
        if isinstance(note, FieldInfo):
            yield from ((None, inner) for inner in note.metadata)
        else:
            yield None, note
    if get_origin(kind) is Annotated:
        inner, *more = get_args(kind)
        yield from _walk(inner, more)
    elif get_origin(kind) is Literal:
        yield kind, None
    else:
        yield get_origin(kind) or kind, None
        for inner in get_args(kind):
            yield from _walk(inner)


def as_written(value: Any, facts: Facts | None = None, every: bool = False) -> Any:
    """A part, or a value of one, as keys and values of a file that mean the same.

    Parameters
    ----------
    every : write keys with default values, too
    """
    if isinstance(value, Part):
        return {
            field.alias or key: as_written(getattr(value, key), facts_of(field), every)
            for key, field in type(value).model_fields.items()
            if getattr(value, key) is not None
            and (every or key in value.model_fields_set or key == 'mechanism')  # a file must
        }
    if isinstance(value, QuantityValue):
        return quantity(value.value, value.unit)
    if isinstance(value, dict):
        return {key: as_written(item, facts) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_written(item, facts) for item in value]
    if not isinstance(value, float):
        return value
    units = {unit for q in facts.quantities for unit in q.units} if facts else set()
    others = {q.other for q in facts.quantities} if facts else set()
    if math.isinf(value) and 'rough' in others:
        return 'rough'
    return quantity(value, units.pop() if len(units) == 1 else '')


def quantity(value: float, unit: str) -> Any:
    """A number with its unit, in degrees if that is the same number."""
    degrees = f'{math.degrees(value):g} deg'
    if unit == 'rad' and value and to_si(degrees, 'rad') == value:
        return degrees
    short = f'{value:g}' if float(f'{value:g}') == value else repr(value)
    if unit:
        return f'{short} {unit}'
    return int(short) if short.lstrip('-').isdecimal() else value


def yaml_text(part: Part) -> str:
    """A part as YAML, its small lists and parts in one line each."""
    return yaml.safe_dump(
        as_written(part), sort_keys=False, default_flow_style=None, width=99, allow_unicode=True
    )
