"""Serialised messages from arrays: where the numbers of a message are in its CDR.

Samples of one topic differ in their numbers alone. So one of them is serialised, and the others
are copies of its bytes into which columns of numbers are written.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rosbags.interfaces import Nodetype

from ros_interfaces.checks import LARGEST, rules_of
from ros_interfaces.classes import CheckedBytes, serialize
from ros_interfaces.definitions import MessageError, field_descriptions, type_name
from ros_interfaces.stamps import NANOSECONDS

_HEADER = 4  # bytes before the message, from behind which CDR counts
_CODES = {'bool': '?', 'byte': 'u1', 'char': 'u1', 'float32': '<f4', 'float64': '<f8'}


class Layout:
    """The bytes of messages that have the texts and the lengths of a given one.

    Parameters
    ----------
    message : one of them; what is not written later stays as it is here

    Attributes
    ----------
    places : path, type and offset of every number or array of numbers, in their order
    size : [bytes]

    Raises
    ------
    MessageError
        If the message does not serialise.
    """

    def __init__(self, message: Any) -> None:
        kind = type_name(type(message))
        self._data = serialize(message)
        self.size = len(self._data)
        self.places: list[tuple[str, Any, int]] = []
        self._empty: set[str] = set()  # arrays without values
        end = self._walk(message, kind, '', _HEADER)
        if not end <= len(self._data) < end + 4:
            raise MessageError(f'{kind} takes {len(self._data)} bytes instead of {end}')
        names = [name for name, _, _ in self.places]
        self._dtype = np.dtype(
            {
                'names': names,
                'formats': [dtype for _, dtype, _ in self.places],
                'offsets': [at for _, _, at in self.places],
                'itemsize': self.size,
            }
        )
        self._stamps = [name.removesuffix('.sec') for name in names if name.endswith('stamp.sec')]
        rules = rules_of(kind)
        self._judged = rules is not None
        self._unknown = rules is not None and kind in rules.unknown_as_nan

    def write(
        self, t: NDArray[np.float64] | NDArray[np.int64], columns: Mapping[str, ArrayLike]
    ) -> list[bytes]:
        """Serialised messages of N instants.

        Parameters
        ----------
        t : (N,) [s], for all stamps and the field `time`; integers are nanoseconds
        columns : by field (inner ones as ``pose.position.x`` or ``points[0].x``): its values,
            (N,) or (N, n) for an array

        Returns
        -------
        N messages, `CheckedBytes` unless there is a number among them that no machine has
        """
        size = self.size
        data = bytearray(self._data * len(t))
        rows = np.frombuffer(data, self._dtype)
        if np.issubdtype(t.dtype, np.integer):
            seconds, nanoseconds = np.divmod(t, NANOSECONDS)
        else:
            whole = np.floor(t)
            carry, nanoseconds = np.divmod(
                np.rint((t - whole) * NANOSECONDS).astype(np.int64), NANOSECONDS
            )
            seconds = whole + carry
        for stamp in self._stamps:
            rows[f'{stamp}.sec'] = seconds
            rows[f'{stamp}.nanosec'] = nanoseconds
        if any(name == 'time' for name, _, _ in self.places):
            rows['time'] = t
        good = True
        for name, values in columns.items():
            if name not in self._empty:
                rows[name] = values
                good = good and self._possible(values)
        made, all_data = CheckedBytes if good else bytes, memoryview(data)
        return [made(all_data[i : i + size]) for i in range(0, len(data), size)]

    def _possible(self, values: ArrayLike) -> bool:
        if not self._judged:
            return True
        sizes = np.abs(values)
        if self._unknown:
            sizes = sizes[~np.isnan(sizes)]
        return bool(np.max(sizes, initial=0.0) <= LARGEST)  # NaN is not

    def _walk(self, message: Any, kind: str, path: str, at: int) -> int:
        """Enter the places of the numbers of a message that begins at `at`; gives its end."""
        for field, description in field_descriptions(kind):
            at = self._step(getattr(message, field), description, f'{path}{field}', at)
        return at

    def _step(self, value: Any, description: Any, name: str, at: int) -> int:
        kind, inner = description
        if kind == Nodetype.NAME:
            return self._walk(value, inner, f'{name}.', at)
        if kind == Nodetype.BASE:
            return self._number(inner[0], '', value, name, at)
        element, _ = inner
        if kind == Nodetype.SEQUENCE:
            at = _aligned(at, 4) + 4
        if element[0] == Nodetype.BASE and element[1][0] != 'string':
            return self._number(element[1][0], (len(value),), value, name, at)
        for i, each in enumerate(value):
            at = self._step(each, element, f'{name}[{i}]', at)
        return at

    def _number(self, base: str, shape: Any, value: Any, name: str, at: int) -> int:
        """Enter one number, or an array of them; pass over a text."""
        if base == 'string':
            return _aligned(at, 4) + 4 + len(value.encode()) + 1
        scalar = np.dtype(_CODES.get(base, base))
        dtype = np.dtype((scalar, shape)) if shape else scalar
        if not dtype.itemsize:
            self._empty.add(name)
            return at
        at = _aligned(at, scalar.itemsize)
        self.places.append((name, dtype, at))
        return at + dtype.itemsize


def _aligned(at: int, size: int) -> int:
    return at + -(at - _HEADER) % size
