"""What ROS would refuse in a message: its C code wants a float where a definition says float64.

An ``int`` in a float field passes unnoticed here and is an error, or garbage, in rclpy.
"""

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from mechanism_sim.messages.definitions import field_descriptions

_PYTHON = {'string': str, 'bool': bool, 'float32': float, 'float64': float}


def refusals(message: Any, path: str = '') -> Iterator[str]:
    """One sentence for every field whose value does not fit its definition."""
    for field, (kind, inner) in field_descriptions(message.__msgtype__):
        here = f'{path}{field}'
        value: Any = getattr(message, field, None)
        if kind in {Nodetype.BASE, Nodetype.NAME}:
            yield from _refusals_of_one(value, kind, inner, here)
            continue
        (element_kind, element), length = inner
        numeric = element_kind == Nodetype.BASE and element[0] != 'string'
        if kind == Nodetype.ARRAY and len(value) != length:
            yield f'{here} has {len(value)} values, not {length}'
        elif kind == Nodetype.SEQUENCE and length and len(value) > length:
            yield f'{here} has {len(value)} values, at most {length} are allowed'
        elif not numeric:
            for index, item in enumerate(value):
                yield from _refusals_of_one(item, element_kind, element, f'{here}[{index}]')


UNKNOWN_AS_NAN = frozenset(
    f'mechanism_sim/msg/{name}' for name in ('CamState', 'GearState', 'GenevaState')
)
"""Messages that say NaN of what is not known."""

LARGEST, LARGEST_COEFFICIENT = 1e60, float(np.finfo(float).max)
"""Magnitudes of numbers in SI units; of powers of the time, which may be as short as 1e-16 s."""


def impossible_number(message: Any) -> str | None:
    """The first field that holds a number no machine has: NaN, infinite, or beyond all bounds."""
    kind = message.__msgtype__
    for field in _numeric(kind):
        most = LARGEST_COEFFICIENT if field == 'coefficients' else LARGEST
        sizes = np.abs(getattr(message, field))
        if kind in UNKNOWN_AS_NAN:
            sizes = np.nan_to_num(sizes, nan=0.0, posinf=np.inf)
        if not np.all(sizes <= most):
            return field
    return None


@cache
def _numeric(name: str) -> tuple[str, ...]:
    """Fields of floating-point numbers, one or many."""
    found = []
    for field, (kind, inner) in field_descriptions(name):
        element = inner[0] if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE} else (kind, inner)
        if element[0] == Nodetype.BASE and element[1][0].startswith('float'):
            found.append(field)
    return tuple(found)


def _refusals_of_one(value: Any, kind: Nodetype, inner: Any, here: str) -> Iterator[str]:
    if kind == Nodetype.NAME:
        if getattr(value, '__msgtype__', None) != inner:
            yield f'{here} is {type(value).__name__}, not {inner}'
        else:
            yield from refusals(value, f'{here}.')
        return
    base = inner[0]
    wanted: type[Any] = _PYTHON.get(base, int)
    if not isinstance(value, wanted) or (wanted is int and isinstance(value, bool)):
        yield f'{here} is {type(value).__name__} {value!r}, not {wanted.__name__}'
    elif wanted is int:
        bits = 8 if base in {'byte', 'char'} else int(base.lstrip('uint'))
        signed = base.startswith('int')
        low, high = (-(1 << bits - 1), 1 << bits - 1) if signed else (0, 1 << bits)
        if not low <= value < high:
            yield f'{here} = {value} does not fit {base}'
