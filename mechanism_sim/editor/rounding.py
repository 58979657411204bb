"""Numbers as written in a scene: rounded to visible precision, in the unit in use."""

from __future__ import annotations

import math
from typing import Any

from mechanism_sim.planar.points import Vector2
from mechanism_sim.units import parted, to_si

_LENGTHS = 'mm', 'm', 'cm', 'um', 'inch', 'in'


def unit_of(content: Any) -> str:
    """The unit of lengths that a scene uses first; mm if none."""
    if isinstance(content, dict):
        content = [*content.values()]
    if isinstance(content, list):
        return next((u for x in content if (u := unit_of(x)) != ''), '')
    _, unit = parted(str(content)) or ('', '')
    return unit if unit in _LENGTHS else ''


def rounded(value: float, step: float, unit: str, si: str = 'm') -> str:
    """A value [SI] to a multiple of a step [SI] with a unit, as ``64.3 mm``."""
    size = to_si(f'1 {unit}', si)
    digits = max(0, -math.floor(math.log10(step / size) + 1e-9))
    number = round(round(value / step) * step / size, digits)
    text = f'{number + 0.0:.{digits}f}'
    return f'{text.rstrip("0").rstrip(".") if digits else text} {unit}'


def place(at: Vector2, step: float, unit: str) -> list[str]:
    """Texts of both coordinates of a point [m]."""
    return [rounded(x, step, unit) for x in at]


def degrees(angle: float, digits: int = 1) -> str:
    """An angle [rad] in (-180, 180] degrees."""
    found = round(math.degrees(math.remainder(angle, 2.0 * math.pi)), digits) + 0.0
    return f'{found:g} deg'


def exactly(value: float, unit: str) -> str:
    """A length [m] that must match others, to ten digits, with a unit."""
    return f'{value / to_si(f"1 {unit}", "m"):.10g} {unit}'
