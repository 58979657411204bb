"""JSON as its standard has it: no NaN, no infinity, in what is written and what is read."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, fields, is_dataclass
from enum import Enum
from fractions import Fraction
from pathlib import PurePath
from typing import Any

from mechanism_sim.errors import RunError


def dumps(data: object, indent: int | None = None) -> str:
    """The text of a result; NumPy's numbers and arrays, data classes and paths are known.

    Raises
    ------
    RunError
        If a number is not finite: which.
    """
    try:
        return json.dumps(data, indent=indent, allow_nan=False, default=_as_builtin)
    except ValueError as error:
        where = _not_finite(data)
        if where is None:
            raise
        raise RunError(f'the result has a number that is not finite: {where}') from error


def plain(value: Any) -> Any:
    """Data classes and arrays as dictionaries, lists, texts and numbers; null if not finite."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value.tolist() if hasattr(value, 'tolist') else value


def loads(text: str | bytes) -> Any:
    """Value of a text.

    Raises
    ------
    ValueError
        If it is no JSON, holds NaN or infinity, or is nested too deep.
    """
    try:
        return json.loads(text, parse_constant=_refuse, parse_float=_finite)
    except RecursionError:
        raise ValueError('it is nested too deep') from None


def _as_builtin(value: Any) -> Any:
    if hasattr(value, 'tolist'):  # of NumPy, whose import costs a tenth of a second
        return value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, PurePath | Fraction):
        return str(value)
    if isinstance(value, set | frozenset):
        return sorted(value)
    raise TypeError(f'{type(value).__name__} has no form in JSON')


def _refuse(name: str) -> float:
    raise ValueError(f'{name} is not a number')


def _finite(text: str) -> float:
    value = float(text)
    if math.isinf(value):
        raise ValueError(f'{text} is not a number that can be held')
    return value


def _not_finite(data: Any, where: str = '') -> str | None:
    """Path and value of the first number in data that is not finite; None if all are finite."""
    if isinstance(data, float):
        return None if math.isfinite(data) else f'{where or "it"} is {data}'
    if isinstance(data, Mapping):
        parts = [(f'{where}.{key}' if where else str(key), x) for key, x in data.items()]
    elif isinstance(data, list | tuple):
        parts = [(f'{where}[{i}]', x) for i, x in enumerate(data)]
    elif hasattr(data, 'tolist') or is_dataclass(data):
        return _not_finite(_as_builtin(data), where)
    else:
        return None
    return next((found for name, x in parts if (found := _not_finite(x, name))), None)
