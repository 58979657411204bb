"""Checks of serialised messages by comparison with one that was checked before.

Samples of one topic differ in their numbers alone. Where all else in a message's bytes is as in
one that was decoded and found good, only its numbers have to be looked at.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Callable
from operator import itemgetter
from typing import Any

import numpy as np

from ros_interfaces.checks import FEW, LARGEST, rules_of
from ros_interfaces.definitions import type_name
from ros_interfaces.layout import Layout
from ros_interfaces.stamps import NANOSECONDS

MOST = 8  # of one length


class SimilarMessages:
    """Valid messages of one type: others are valid if they differ from one in numbers alone."""

    def __init__(self, kind: type[Any]) -> None:
        name = type_name(kind)
        rules = rules_of(name)
        self._judged = rules is not None
        # What else has to be looked at is looked at in the message; where NaN is allowed, too.
        self._able = rules is None or name not in rules.contradictions
        self._known: defaultdict[int, list[Callable[[bytes], bool]]] = defaultdict(list)

    def __contains__(self, data: bytes) -> bool:
        """Whether bytes are certainly a good message; if not, they may be one nevertheless."""
        return any(like(data) for like in self._known.get(len(data), ()))

    def add(self, message: Any, data: bytes) -> None:
        """Remember a message that is good."""
        if self._able and len(self._known) < MOST and len(self._known[len(data)]) < MOST:
            layout = Layout(message)
            if layout.size <= len(data) < layout.size + 4:  # DDS fills up to multiples of 4
                self._known[len(data)].append(_compile_check(layout, data, self._judged))


def _compile_check(layout: Layout, data: bytes, judged: bool) -> Callable[[bytes], bool]:
    """Compile a check: bytes of this length differ from `data` in plausible numbers alone."""
    codes, at = ['<'], 0
    same: list[int] = []
    numbers: list[int] = []
    stamps: list[int] = []
    many: list[tuple[int, int]] = []
    count = 0
    for name, dtype, begin in [*layout.places, ('', np.dtype('V0'), len(data))]:
        if begin > at:
            codes.append(f'{begin - at}s')
            same.append(count)
            count += 1
        length = dtype.itemsize // 8
        if name.endswith('stamp.sec'):
            codes.append('iI')
            stamps.append(count)
            count += 2
        elif judged and dtype.base == np.float64 and length < FEW:
            codes.append(f'{length}d')
            numbers += range(count, count + length)
            count += length
        elif dtype.itemsize and not name.endswith('stamp.nanosec'):
            if judged and dtype.base == np.float64:
                many.append((begin, length))
            codes.append(f'{dtype.itemsize}x')
        at = begin + dtype.itemsize
    unpack = struct.Struct(''.join(codes)).unpack
    # With one more they give a tuple in any case.
    texts, few = itemgetter(*same, same[0]), itemgetter(*numbers, *(numbers[:1] or same[:1]))
    wanted = texts(unpack(data))
    every = slice(None) if numbers else slice(0)

    def like(other: bytes) -> bool:
        values = unpack(other)
        if texts(values) != wanted:
            return False
        for i in stamps:
            if values[i] < 0 or values[i + 1] >= NANOSECONDS:
                return False
        total = sum(map(abs, few(values)[every]))
        for begin, length in many:
            array = np.frombuffer(other, '<f8', length, begin)
            total += abs(float(array.max())) + abs(float(array.min()))
        return bool(total <= LARGEST)

    return like
