"""Fields of the messages of parts: ``python docs/messages.py`` writes them to ``msg/``.

They are those of the readings of their joints, in their order. The purpose of a message, the
numbers of its modes and the comment beside a field are kept; a new field has its unit and words.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy as np

from mechanism_sim.joints.cam.reading import CamReading
from mechanism_sim.joints.geneva.constraint import GenevaReading
from mechanism_sim.joints.mesh.reading import GearReading

ROOT = Path(__file__).parents[1]
READINGS = {'CamState': CamReading, 'GearState': GearReading, 'GenevaState': GenevaReading}
BEFORE = (
    ('std_msgs/Header header', 'stamp: time, rounded to nanoseconds'),
    ('float64 time', '[s]'),
    ('string joint', ''),
)
TYPES = {np.float64: 'float64', np.uint8: 'uint8', np.bool_: 'bool'}


def fields(reading: type) -> list[tuple[str, str]]:
    """Type and name of every field, with a comment of its unit and words."""
    found = [*BEFORE]
    for name, hint in get_type_hints(reading, include_extras=True).items():
        array, comment = hint, ''
        if get_origin(hint) is Annotated:
            array, told = get_args(hint)
            words = told.words.format(first='the first link', second='the second link')
            comment = ' '.join([' or '.join(f'[{u}]' for u in told.units if u), words])
        found.append((f'{TYPES[_scalar(array)]} {name}', comment.strip()))
    return found


def _scalar(array: Any) -> type:
    """Type of the numbers of an array's annotation: ``ndarray[Any, dtype[T]]``."""
    kind: type = get_args(get_args(array)[1])[0]
    return kind


def text(name: str) -> str:
    """The file of a message, with the fields of its reading."""
    old = (ROOT / 'msg' / f'{name}.msg').read_text(encoding='utf-8')
    head, body = re.split(r'^(?=std_msgs/Header)', old, flags=re.MULTILINE)
    kept = dict(re.findall(r'^(\S+ \S+)(?: +# (.*))?$', body, flags=re.MULTILINE))
    lines = [(field, kept.get(field, comment)) for field, comment in fields(READINGS[name])]
    width = max(len(field) for field, _ in lines)
    return head + ''.join(
        f'{field:{width}}  # {comment}\n' if comment else f'{field}\n' for field, comment in lines
    )


if __name__ == '__main__':
    for name in READINGS:
        (ROOT / 'msg' / f'{name}.msg').write_text(text(name), encoding='utf-8')
