"""Errors in messages: those to be sent, and those received.

What ROS would refuse: its C code wants a float where a definition says float64. An ``int`` in a
float field passes unnoticed here and is an error, or garbage, in rclpy.
"""

from collections.abc import Callable, Iterator
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from mechanism_sim.messages.definitions import OWN, field_descriptions, type_name

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
    f'mechanism_sim/msg/{name}'
    for name in ('BearingLoads', 'CamState', 'GearState', 'GenevaState', 'JointReactions')
)
"""Messages that hold NaN for what is unknown."""

LARGEST, LARGEST_COEFFICIENT = 1e60, float(np.finfo(float).max)
"""Magnitudes of numbers in SI units; of powers of the time, which may be as short as 1e-16 s."""


LATEST = 2.0**31
"""[s] A stamp holds no more."""

_LAST_MODE = 6  # RECOVERING, of ModeChange
FEW = 100  # numbers are summed faster one by one

Objection = Callable[[Any], str | None]


def impossible_number(message: Any) -> str | None:
    """The first field that holds a number no machine has: NaN, infinite, or beyond all bounds."""
    kind: Any = type(message)
    return _about_numbers(kind)(message)


def objection(message: Any) -> str | None:
    """The implausible part of a received message; None if there is none.

    Stamps are times. Messages of this package hold numbers that a machine may have, as many as
    they say, and times that a stamp may hold.
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
    if name.startswith(f'{OWN}/msg/'):
        find = _about_numbers(kind)
        found.append(
            lambda message: (
                (field := find(message)) and f'{field} holds a number that no machine has'
            )
        )
        found += [find for own, find in CONTRADICTIONS.items() if name == f'{OWN}/msg/{own}']
    return tuple(found)


@cache
def _about_numbers(kind: Any) -> Objection:
    """What gives the first field of a message of this type with an impossible number."""
    name = type_name(kind)
    some, many = _numeric(name)
    unknown = name in UNKNOWN_AS_NAN
    # With a name too many it gives a tuple in any case.
    numbers = attrgetter(*some, *some[:1]) if some else lambda _: ()

    def find(message: Any) -> str | None:
        # Almost always all is well, which a sum says soonest: NaN and infinity get into it.
        total = sum(map(abs, numbers(message)))
        for field in many:
            if size := len(values := getattr(message, field)):
                few = values if size < FEW else np.array([np.max(values), np.min(values)])
                total += sum(map(abs, few.tolist()))
        if total <= LARGEST and not unknown:
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


def _about_progress(message: Any) -> str | None:
    if len(message.topics) != len(message.counts):
        return f'it has {len(message.topics)} topics, but {len(message.counts)} counts'
    return _beyond(message, 'time')


def _about_law(message: Any) -> str | None:
    kind, count = message.kind, len(message.coefficients)
    if kind not in {message.PRESCRIBED, message.TORQUE}:
        return f'there is no kind {kind} of laws'
    if count != 3 if kind == message.TORQUE else not count:
        return f'a law of kind {kind} has not {count} coefficients'
    return _beyond(message, 'valid_from', 'valid_until')


def _about_motion(message: Any) -> str | None:
    m, n, r = message.segments, len(message.coordinates), len(message.joints)
    for field, count in (
        ('start', m),
        ('start_low', m),
        ('duration', m),
        ('turns', m * n),
        ('coefficients', m * n * (message.degree + 1)),
        ('modes', m * r),
    ):
        if len(getattr(message, field)) != count:
            return f'it has {len(getattr(message, field))} values of {field}, not {count}'
    for field, each in (('approach_speeds', m), ('torque_laws', 3 * m), ('load_switches', m)):
        if len(values := getattr(message, field)) % max(each, 1) or (len(values) and not m):
            return f'it has {len(values)} values of {field} for {m} segments'
    start, duration = np.asarray(message.start), np.asarray(message.duration)
    if len(message.modes) and np.max(message.modes) > _LAST_MODE:
        return f'there is no mode {np.max(message.modes)} of contact'
    if m and (duration.min() < 0.0 or start[0] < 0.0 or (start[1:] < start[:-1]).any()):
        return 'its segments do not follow each other'
    return _beyond(message, 'known_until')


def _beyond(message: Any, *fields: str) -> str | None:
    for field in fields:
        if not 0.0 <= getattr(message, field) < LATEST:
            return f'{field} = {getattr(message, field):g} s is no time of a run'
    return None


CONTRADICTIONS = {
    'Progress': _about_progress,
    'DriveLaw': _about_law,
    'Motion': _about_motion,
}


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
