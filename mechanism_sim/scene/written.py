"""Parts of a scene as a file gives them: quantities with their units, and only what was set."""

from __future__ import annotations

import math
from typing import Any

import yaml

from mechanism_sim.keys.quantities import Part
from mechanism_sim.scene.facts import Facts, facts_of
from mechanism_sim.units import QuantityValue, to_si


def as_written(value: Any, facts: Facts | None = None) -> Any:
    """A part, or a value of one, as keys and values of a file that mean the same."""
    if isinstance(value, Part):
        return {
            field.alias or key: as_written(getattr(value, key), facts_of(field))
            for key, field in type(value).model_fields.items()
            if getattr(value, key) is not None
            and (key in value.model_fields_set or key == 'mechanism')  # a file must say it
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
