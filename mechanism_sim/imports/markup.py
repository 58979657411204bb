"""Untrusted XML: no entities, no includes, valid numbers."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element, ParseError, fromstring

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.packages import reason


def parse(file: str, text: str, *roots: str) -> Element:
    """The root of a document, which must be one of these elements.

    Entities could expand without bound, and read other files: a document that defines any is
    refused. External subsets of a ``<!DOCTYPE`` are not read.
    """
    if '<!ENTITY' in text:
        raise InputError(f'{file}: entities are not read: take them out')
    try:
        root = fromstring(text.encode())  # noqa: S314 - without entities
    except (ParseError, ValueError) as error:
        raise InputError(f'{file} is not XML ({reason(error)})') from error
    for element in root.iter():
        element.tag = str(element.tag).rpartition('}')[2]  # without namespaces
    if root.tag not in roots:
        raise InputError(f'{file} begins with <{root.tag}>, not with <{"> or <".join(roots)}>')
    return root


def numbers(text: str | None, count: int, default: float = 0.0) -> Array:
    """Parse `count` numbers (count,) of a text; all are `default` for an empty text."""
    if text is None or not text.strip():
        return np.full(count, default)
    try:
        found = np.array([float(x) for x in text.replace(',', ' ').split()])
    except ValueError:
        raise InputError(f"'{text.strip()}' are not numbers") from None
    if len(found) != count or not np.isfinite(found).all():
        raise InputError(f"'{text.strip()}' are not {count} finite numbers")
    return found


def number(text: str | None, default: float = 0.0) -> float:
    """A single number of a text."""
    return float(numbers(text, 1, default)[0])


def turned(roll: float, pitch: float, yaw: float) -> Array:
    """Rotation (3, 3) by angles [rad] about fixed x, y, z in this order."""
    return rotation((0, 0, 1), yaw) @ rotation((0, 1, 0), pitch) @ rotation((1, 0, 0), roll)


def by_quaternion(x: float, y: float, z: float, w: float) -> Array:
    """Rotation (3, 3) by a quaternion of any length."""
    return rotation((x, y, z), 2.0 * math.atan2(math.hypot(x, y, z), w))


def rotation(axis: Array | tuple[float, ...], angle: float) -> Array:
    """Rotation (3, 3) about an axis by an angle [rad]."""
    if not angle:
        return np.eye(3)
    if not (size := math.sqrt(float(np.dot(axis, axis)))):
        raise InputError('an axis of a rotation has no direction')
    x, y, z = np.asarray(axis, float) / size
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    along = np.outer((x, y, z), (x, y, z))
    return math.cos(angle) * (np.eye(3) - along) + along + math.sin(angle) * cross
