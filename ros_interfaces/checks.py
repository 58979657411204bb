"""Errors in messages: those to be sent, and those received.

What ROS would refuse: its C code wants a float where a definition says float64. An ``int`` in a
float field passes unnoticed here and is an error, or garbage, in rclpy.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from rosbags.interfaces import Nodetype

from ros_interfaces.definitions import field_descriptions, type_name

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


LARGEST, LARGEST_COEFFICIENT = 1e60, float(np.finfo(float).max)
"""Magnitudes of numbers in SI units; of powers of the time, which may be as short as 1e-16 s."""


FEW = 100  # numbers are summed faster one by one

Objection = Callable[[Any], str | None]
"""Gives the implausible part of a message as words, None if there is none."""


class Rules(NamedTuple):
    """Expectations of a package on its own messages, beyond their definitions."""

    unknown_as_nan: frozenset[str]  #: full names of messages that hold NaN for what is unknown
    contradictions: Mapping[str, Objection]  #: by full names: fields at odds


_RULES: dict[str, Rules] = {}


def add_rules(package: str, rules: Rules) -> None:
    """Judge the messages of a package by rules of its own, and their numbers as those of a thing.

    Its numbers are then finite, and below `LARGEST`.
    """
    _RULES[package] = rules
    _objections.cache_clear()
    _about_numbers.cache_clear()


def rules_of(name: str) -> Rules | None:
    """The rules for a message ``pkg/msg/Name``; None if its package has none."""
    return _RULES.get(name.partition('/')[0])


def impossible_number(message: Any) -> str | None:
    """The first field that holds a number no machine has: NaN, infinite, or beyond all bounds."""
    kind: Any = type(message)
    return _about_numbers(kind)(message)


def objection(message: Any) -> str | None:
    """The implausible part of a received message; None if there is none.

    Stamps are times. Messages of packages with rules hold numbers that a machine may have, and do
    not contradict themselves.
    """
    kind: Any = type(message)
    for find in _objections(kind):
        if found := find(message):
            return found
    return None


@cache
def _objections(kind: Any) -> tuple[Objection, ...]:
    name = type_name(kind)
    found = [*_about_stamps(name)]
    if rules := rules_of(name):
        find = _about_numbers(kind)
        found.append(
            lambda message: (
                (field := find(message))
                and f'{field} holds a number outside the range of machines'
            )
        )
        if name in rules.contradictions:
            found.append(rules.contradictions[name])
    return tuple(found)


@cache
def _about_numbers(kind: Any) -> Objection:
    """Finder of the first field of a message of this type with an impossible number."""
    name = type_name(kind)
    some, many = _numeric(name)
    rules = rules_of(name)
    unknown = rules is not None and name in rules.unknown_as_nan
    # With a name too many it gives a tuple in any case.
    numbers = attrgetter(*some, *some[:1]) if some else lambda _: ()

    def find(message: Any) -> str | None:
        # Almost always all is well, which a sum says soonest: NaN and infinity get into it.
        total = sum(map(abs, numbers(message)))
        for field in many:
            if size := len(values := getattr(message, field)):
                few = values if size < FEW else np.array([np.max(values), np.min(values)])
                total += sum(map(abs, few.tolist()))
        if total <= LARGEST:
            return None
        for field in (*some, *many):
            most = LARGEST_COEFFICIENT if field == 'coefficients' else LARGEST
            sizes = np.abs(getattr(message, field))
            if unknown:
                sizes = np.nan_to_num(sizes, nan=0.0, posinf=np.inf)
            if not np.all(sizes <= most):
                return field
        return None

    return find


def _about_stamps(name: str, path: str = '') -> Iterator[Objection]:
    """Compile a check of every ``builtin_interfaces/msg/Time`` in a message, at any depth."""
    for field, (kind, inner) in field_descriptions(name):
        many = kind in {Nodetype.ARRAY, Nodetype.SEQUENCE}
        element, inside = inner[0] if many else (kind, inner)
        if element != Nodetype.NAME:
            continue
        here, of_time = f'{path}{field}', inside == 'builtin_interfaces/msg/Time'
        if many:
            finds = (_no_time,) if of_time else _about_stamps(inside)
            yield from (_of_all(attrgetter(here), find) for find in finds)
        elif of_time:
            yield _of_one(attrgetter(here))
        else:
            yield from _about_stamps(inside, f'{here}.')


def _of_one(get: Callable[[Any], Any]) -> Objection:
    return lambda message: _no_time(get(message))


def _of_all(get: Callable[[Any], Any], find: Objection) -> Objection:
    return lambda message: next(filter(None, map(find, get(message))), None)


def _no_time(stamp: Any) -> str | None:
    if stamp.sec >= 0 and stamp.nanosec < 1_000_000_000:
        return None
    return f'{stamp.sec} s and {stamp.nanosec} ns are no time'


@cache
def _numeric(name: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Fields of one floating-point number, and of many."""
    some: list[str] = []
    many: list[str] = []
    for field, (kind, inner) in field_descriptions(name):
        listed = kind in {Nodetype.ARRAY, Nodetype.SEQUENCE}
        element = inner[0] if listed else (kind, inner)
        if element[0] == Nodetype.BASE and element[1][0].startswith('float'):
            (many if listed else some).append(field)
    return tuple(some), tuple(many)


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
