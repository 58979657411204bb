"""What ROS would refuse in a message: its C code wants a float where a definition says float64.

An ``int`` in a float field passes unnoticed here and is an error, or garbage, in rclpy.
"""

from collections.abc import Iterator
from typing import Any

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
