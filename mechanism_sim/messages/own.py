"""The messages of this package: names, definitions and allowed values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ros_interfaces.checks import Rules, add_rules
from ros_interfaces.definitions import MessageError, definition_folder, messages_of
from ros_interfaces.origin import require

OWN = 'mechanism_sim'

_LATEST = 2.0**31  # [s] A stamp holds no more

_LAST_MODE = 6  # RECOVERING, of ModeChange


def message_folder() -> Path:
    """Folder of the definitions."""
    folder = definition_folder(OWN)
    if folder is None:
        raise MessageError(
            'the message definitions are neither beside the package nor in share/mechanism_sim/msg'
        )
    return folder


def own_messages() -> tuple[str, ...]:
    """Names of the messages, in alphabetical order."""
    return messages_of(OWN)


def add() -> None:
    """Have classes and checks of messages know of these."""
    require(OWN)
    unknown = frozenset(f'{OWN}/msg/{name}' for name in _UNKNOWN_AS_NAN)
    add_rules(OWN, Rules(unknown, {f'{OWN}/msg/{x}': find for x, find in _CONTRADICTIONS.items()}))


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
        if not 0.0 <= getattr(message, field) < _LATEST:
            return f'{field} = {getattr(message, field):g} s is not a time of a run'
    return None


_UNKNOWN_AS_NAN = 'BearingLoads', 'CamState', 'GearState', 'GenevaState', 'JointReactions'
"""Messages that hold NaN for what is unknown."""

_CONTRADICTIONS = {
    'Progress': _about_progress,
    'DriveLaw': _about_law,
    'Motion': _about_motion,
}
"""Checks of fields that belong together, by message."""
