"""Round numbers for drawings, and their scale bars."""

from __future__ import annotations

import math


def round_below(value: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... that is not above a positive value."""
    decade = 10.0 ** math.floor(math.log10(value))
    return max(x * decade for x in (1.0, 2.0, 5.0) if x * decade <= value)


def scale_bar(width: float) -> tuple[float, str]:
    """A round length [m] of at most a fifth of a drawing's width [m], and how it is written."""
    length = round_below(0.2 * width)
    unit, name = next(x for x in ((1.0, 'm'), (1e-3, 'mm'), (0.0, 'µm')) if length >= x[0])
    return length, f'{length / (unit or 1e-6):.3g} {name}'
