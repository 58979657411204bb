"""Values of a scene that are to be found, and within which limits they are looked for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.scene import Machine
from mechanism_sim.scene.files import check_scene

OF_JOINT = ('restitution', 'friction', 'radial')
NOISE = 'noise'
NAMES = (*OF_JOINT, NOISE)
"""Parameters that go by a short name; others by their dotted path."""

_LIMITS = {'restitution': (0.1, 0.9), 'friction': (0.02, 0.4)}
_FACTORS = {'radial': (0.4, 2.5), NOISE: (1.0 / 3.0, 3.0)}  # times what the scene says


@dataclass(frozen=True)
class Parameter:
    """A number of a scene.

    Attributes
    ----------
    name : short, or its path
    path : dotted, as in overrides
    low, high : limits within which it is looked for, in SI units
    """

    name: str
    path: str
    low: float
    high: float

    @property
    def logarithmic(self) -> bool:
        """True if ratios matter and not differences: where the limits are far apart."""
        return self.low > 0.0 and self.high >= 3.0 * self.low and self.name != 'restitution'

    def to_scale(self, value: float) -> float:
        """A value on the parameter's scale."""
        return math.log(value) if self.logarithmic else value

    def value(self, to_scale: float) -> float:
        """The value at a place on the parameter's scale, within the limits."""
        value = math.exp(to_scale) if self.logarithmic else to_scale
        return min(max(value, self.low), self.high)


def parameters(
    machine: Machine,
    names: Sequence[str],
    sensor: str,
    joint: str | None = None,
    limits: Mapping[str, tuple[str, str]] | None = None,
) -> tuple[Parameter, ...]:
    """The parameters of these names, or dotted paths.

    Parameters
    ----------
    sensor : whose ``noise`` is meant
    joint : whose restitution, friction and radial clearance are meant; not needed if one is loose
    limits : low and high, as in a scene file, by name; other parameters than those with a short
        name have none of their own
    """
    given = dict(limits or {})
    for name in given:
        if name not in names:
            raise InputError(f"there are limits of '{name}', which is not to be found")
    if len(set(names)) < len(names):
        raise InputError(f'{", ".join(names)}: every parameter is found once only')
    content = machine.scene.to_document()
    found = []
    for name in names:
        path = _path(machine, name, sensor, joint)
        if name in given:
            low, high = (_read(machine, content, path, text) for text in given[name])
        elif name in _LIMITS:
            low, high = _LIMITS[name]
        elif name in _FACTORS:
            low, high = (factor * _at(content, path) for factor in _FACTORS[name])
        else:
            raise InputError(
                f"'{name}' has no limits of its own: give --range '{name}=LOW:HIGH'; short names: "
                f'{", ".join(NAMES)}{nearest(name, NAMES)}'
            )
        if not low < high:
            raise InputError(f'the limits of {name} are {low:g} and {high:g}: the second must be '
                             'larger')  # fmt: skip
        found.append(Parameter(name, path, low, high))
    return tuple(found)


def ranges(texts: Sequence[str], key: str = '--range') -> dict[str, tuple[str, str]]:
    """Limits by name, from texts ``name=low:high`` of an option."""
    found = {}
    for text in texts:
        name, _, limits = text.partition('=')
        low, colon, high = limits.partition(':')
        if not (name and low and colon and high):
            raise InputError(f"{key} '{text}': write NAME=LOW:HIGH, as 'radial=0.1 mm:0.4 mm'")
        if name.strip() in found:
            raise InputError(f"{key}: there are two ranges of '{name.strip()}': keep one")
        found[name.strip()] = low.strip(), high.strip()
    return found


def _path(machine: Machine, name: str, sensor: str, joint: str | None) -> str:
    if name == NOISE:
        return f'sensors.{sensor}.noise.rms'
    if name not in OF_JOINT:
        return name
    loose = tuple(machine.plan.clearances)
    if joint is None and len(loose) != 1:
        raise InputError(
            f'{machine.name} has {len(loose)} loose joints'
            + (f': choose one by --joint ({", ".join(loose)})' if loose else ': nothing to find')
        )
    chosen = joint or loose[0]
    if chosen not in loose:
        raise InputError(
            f"{machine.name} has no loose joint '{chosen}'{nearest(chosen, loose)}; loose: "
            f'{", ".join(loose)}'
        )
    return f'joints.{chosen}.clearance.{name}'


def _read(machine: Machine, content: Mapping[str, Any], path: str, text: str) -> float:
    """A value in SI units, as the scene understands it."""
    scene = check_scene(machine.name, content, {path: text})
    return _at(scene.to_document(), path)


def _at(content: Mapping[str, Any], path: str) -> float:
    place: Any = content
    for part in path.split('.'):
        place = place.get(part) if isinstance(place, Mapping) else None
    value = place[0] if isinstance(place, tuple | list) and place else place
    if isinstance(value, bool) or not isinstance(value, float | int) or not math.isfinite(value):
        raise InputError(f"'{path}' is not a number of the scene")
    return float(value)
