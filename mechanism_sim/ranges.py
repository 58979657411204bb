"""Ranges of values as people write them: ``LOW:HIGH``, ``LOW:HIGH:N`` and ``VALUE,VALUE,...``."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from mechanism_sim.errors import InputError

_BARE = re.compile(r'[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?', re.I)

_MOST_VALUES = 100_000
"""Most values of one or two ranges: scenes of so many runs take gigabytes before the first."""


class ValueRange(NamedTuple):
    """Texts of a range.

    Attributes
    ----------
    values : the lowest and the highest, or all of a list
    number : of values from the lowest to the highest, where it is asked for
    listed : True if it is a list
    """

    values: tuple[str, ...]
    number: int = 0
    listed: bool = False


def read_range(
    where: str, text: str, example: str, counted: bool = False, lists: bool = False, name: str = ''
) -> ValueRange:
    """The range in a text, refused by a sentence that begins with `where`.

    Parameters
    ----------
    counted : True if a number of values follows
    lists : True if it may be a list as well
    name : ``NAME=`` if the text has it in front; it is not read
    """
    rest = text[len(name) :] if text.startswith(name) else ''
    parts, listed = [part.strip() for part in rest.split(':')], lists and ':' not in rest
    count = parts.pop() if counted and len(parts) == 3 else '' if counted else '2'
    values = [part.strip() for part in rest.split(',')] if listed else parts
    shaped = (
        len(values) > 1 if listed else len(values) == 2 and (count.isdecimal() and len(count) < 16)
    )
    if not (shaped and all(values)):
        front = 'NAME=' if name else ''
        form = f'{front}LOW:HIGH{":N" * counted}' + f', or {front}VALUE,VALUE,...' * lists
        raise InputError(f'{where}{f" {text!r}" if text else ""}: write {form}, as {example!r}')
    check_counts(f'{where} {text!r}', [int(count)])
    bare = [x for x in values if _BARE.fullmatch(x) and float(x)]
    united = [x for x in values if x[0] in '+-.0123456789' and not _BARE.fullmatch(x)]
    if bare and united:
        raise InputError(
            f'{where} {text!r}: some values have a unit, others have none, such as {bare[0]!r}'
        )
    return ValueRange(tuple(values), int(count) * counted, listed)


def named_ranges(
    where: str, texts: Sequence[str], example: str, counted: bool = False, lists: bool = False
) -> dict[str, ValueRange]:
    """Ranges by name, from texts ``NAME=RANGE`` of an option that is given several times."""
    found: dict[str, ValueRange] = {}
    for text in texts:
        name, sign, _ = text.partition('=')
        front = name + sign if sign and name.strip() else 'NAME='
        one = read_range(where, text, example, counted, lists, front)
        if name.strip() in found:
            raise InputError(f"{where}: there are two ranges of '{name.strip()}': keep one")
        found[name.strip()] = one
    return found


def check_counts(where: str, counts: Sequence[int]) -> None:
    """Refuse numbers of values that are less than two, or too many all together."""
    if min(counts) < 2:
        raise InputError(f'{where}: the number of values must be at least 2')
    if (every := math.prod(counts)) > _MOST_VALUES:
        product = f'{" x ".join(map(str, counts))} = ' if len(counts) > 1 else ''
        raise InputError(f'{where}: {product}{every} values are too many: at most {_MOST_VALUES}')


def check_order(where: str, low: float, high: float, written: Sequence[Any]) -> None:
    """Refuse limits that are equal, or the wrong way round."""
    if not low < high:
        pair = ':'.join(x if isinstance(x, str) else f'{x:g}' for x in written)
        raise InputError(f"{where} '{pair}': the second value must be larger than the first")
