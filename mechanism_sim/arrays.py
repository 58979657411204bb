"""The type of arrays of numbers, and named tuples of arrays with a column for each of K things."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

Columns = TypeVar('Columns', bound=tuple[Any, ...])


def some(columns: Columns, chosen: NDArray[np.intp] | slice) -> Columns:
    """Some of the columns, by the last axis of each array."""
    return type(columns)(*(x[..., chosen] for x in columns))


def joined(parts: Sequence[Columns]) -> Columns:
    """All columns of several, in turn."""
    rows = (np.concatenate(x, axis=-1) for x in zip(*parts, strict=True))
    return type(parts[0])(*rows)
