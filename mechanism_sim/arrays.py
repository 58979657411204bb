"""The type of arrays of numbers, rows that grow, and named tuples of arrays with K columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IndexArray = NDArray[np.intp]
Mask = NDArray[np.bool_]

Columns = TypeVar('Columns', bound=tuple[Any, ...])


def some(columns: Columns, chosen: IndexArray | slice) -> Columns:
    """Some of the columns, by the last axis of each array."""
    return type(columns)(*(x[..., chosen] for x in columns))


def joined(parts: Sequence[Columns]) -> Columns:
    """All columns of several, in turn."""
    rows = (np.concatenate(x, axis=-1) for x in zip(*parts, strict=True))
    return type(parts[0])(*rows)


class GrowingRows:
    """Rows (N, ...) put together from parts that need not be kept, in memory that grows in place.

    Joining all parts at the end would need twice the memory of the rows.
    """

    def __init__(self) -> None:
        self._rows: NDArray[Any] | None = None
        self._count = 0

    def add(self, rows: NDArray[Any]) -> None:
        """Append rows (M, ...), see `of_one_width`."""
        if self._rows is None:
            self._rows, self._count = np.array(rows, order='C'), len(rows)
            return
        if rows.shape[1:] != self._rows.shape[1:]:
            self._rows, rows = of_one_width([self.rows(), rows])
        count = self._count + len(rows)
        if count > len(self._rows):
            # an eighth more: pages are moved, not copied, and few are left over
            self._rows.resize((count + count // 8, *rows.shape[1:]), refcheck=False)
        self._rows[self._count : count] = rows
        self._count = count

    def rows(self) -> NDArray[Any]:
        """All rows so far; nothing may be appended while they are used."""
        assert self._rows is not None  # noqa: S101 - there is a first part
        self._rows.resize((self._count, *self._rows.shape[1:]), refcheck=False)
        return self._rows


def of_one_width(parts: Sequence[NDArray[Any]]) -> list[NDArray[Any]]:
    """Arrays (N, ..., d) of the largest d among them, by zeros at the ends of the others."""
    width = max(x.shape[-1] for x in parts)
    return [
        x
        if x.shape[-1] == width
        else np.pad(x, [(0, 0)] * (x.ndim - 1) + [(0, width - x.shape[-1])])
        for x in parts
    ]
