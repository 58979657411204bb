"""Values of a scene that are to be found, and within which limits they are looked for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mechanism_sim.arguments import as_annotated, listed
from mechanism_sim.errors import InputError, check_known, nearest, quoted
from mechanism_sim.ranges import check_order, named_ranges
from mechanism_sim.scene import Machine
from mechanism_sim.scene.facts import value_at
from mechanism_sim.scene.files import check_scene
from mechanism_sim.scene.load import unit_at
from mechanism_sim.scene.schema import Scene
from mechanism_sim.units import QuantityValue, parted, plain

OF_JOINT = ('restitution', 'friction', 'radial')
NOISE = 'noise'
NAMES = (*OF_JOINT, NOISE)
"""Parameters that go by a short name; others by their dotted path."""

Limits = Sequence[Any] | Mapping[str, Sequence[Any]]
"""Lowest and highest value, or a list of other than two, or ``{'values': [...]}``."""

Vary = Mapping[str, tuple[Any, Any, int] | str] | Sequence[str] | str
"""Lowest and highest value and their number by path, or as text."""

_LIMITS = {'restitution': (0.1, 0.9), 'friction': (0.02, 0.4)}
_FACTORS = {'radial': (0.4, 2.5), NOISE: (1.0 / 3.0, 3.0)}  # times the value of the scene


@dataclass(frozen=True)
class Parameter:
    """A number of a scene."""

    name: str  #: short, or its path
    path: str  #: dotted, as in overrides
    #: limits within which it is looked for, in SI units
    low: float
    high: float
    #: the values of one that takes no others, in their order; its limits are 0 and 1
    choices: tuple[Any, ...] = ()
    #: unit of its limits as written, and value in it of 1 in SI units
    unit: str = ''
    scale: float = 1.0
    si: str = ''  #: SI unit

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

    def at(self, share: float) -> Any:
        """The value at a share of its range on its scale, 0 to 1."""
        if self.choices:
            return self.choices[min(int(share * len(self.choices)), len(self.choices) - 1)]
        low, high = self.to_scale(self.low), self.to_scale(self.high)
        return self.value((1.0 - share) * low + share * high)  # exact at both ends

    def slope(self, share: float) -> float:
        """Derivative of `at`."""
        span = self.to_scale(self.high) - self.to_scale(self.low)
        return span * float(self.at(share)) if self.logarithmic else span


def parameters(
    machine: Machine,
    names: Sequence[str],
    sensor: str,
    joint: str | None = None,
    limits: Mapping[str, Limits] | None = None,
) -> tuple[Parameter, ...]:
    """The parameters of these names, or dotted paths.

    Parameters
    ----------
    sensor : sensor of the ``noise``
    joint : whose restitution, friction and radial clearance are meant; not needed if one is loose
    limits : low and high, as in a scene file, or a list of values, by name; other parameters than
        those with a short name have none of their own
    """
    given = dict(limits or {})
    for name in given:
        if name not in names:
            raise InputError(f"there are limits of '{name}', which is not varied")
    if len(set(names)) < len(names):
        raise InputError(f'{", ".join(names)}: name every parameter once')
    content = machine.scene.to_document()
    found = []
    for name in names:
        path = _path(machine, name, sensor, joint)
        si = unit_at(machine.scene, path)
        if name in given and (choices := _choices(machine, content, path, given[name])):
            texts = _listed(given[name])
            alike = len(texts) == len(choices) and all(isinstance(x, float) for x in choices)
            unit, scale = _written(texts, choices) if alike else ('', 1.0)
            found.append(Parameter(name, path, 0.0, 1.0, choices, unit, scale, si))
            continue
        if name in given:
            low, high = (_read(machine, content, path, text) for text in given[name])
        elif name in _LIMITS:
            low, high = _LIMITS[name]
        elif name in _FACTORS:
            low, high = (factor * _at(machine.scene, path) for factor in _FACTORS[name])
        else:
            raise InputError(
                f"'{name}' has no limits of its own: give --range '{name}=LOW:HIGH'; short names: "
                f'{", ".join(NAMES)}{nearest(name, NAMES)}'
            )
        written: Any = given.get(name, (low, high))
        check_order(f'the limits of {name},', low, high, written)
        unit, scale = _written(written[::-1], (high, low))
        found.append(Parameter(name, path, low, high, (), unit, scale, si))
    return tuple(found)


def read_limits(
    where: str, vary: Mapping[str, Any] | Sequence[str] | str, lists: bool = False
) -> dict[str, Limits]:
    """Limits by name, from texts ``NAME=LOW:HIGH``, or by name as texts, pairs or lists.

    Parameters
    ----------
    lists : True if it may also be ``NAME=VALUE,VALUE,...``
    """
    found: dict[str, Limits] = {}
    pairs = vary.items() if isinstance(vary, Mapping) else ()
    texts = listed(() if isinstance(vary, Mapping) else vary, where)
    for name, given in ((name, plain(given)) for name, given in pairs):
        if isinstance(given, str):
            texts.append(f'{name}={given}')
        elif isinstance(given, Mapping) and [*given] == ['values']:
            found[name] = {'values': [*given['values']]}
        elif isinstance(given, Sequence) and len(given) > 1:
            found[name] = given
        else:
            raise InputError(
                f"{where}: {name} = {given!r}: write 'LOW:HIGH', (LOW, HIGH) or a list of values"
            )
    example = 'links.crank.length=40 mm:60 mm' if lists else 'radial=0.1 mm:0.4 mm'
    for name, one in named_ranges(where, texts, example, lists=lists).items():
        found[name] = {'values': one.values} if one.listed else one.values
    return found


def read_counted(where: str, vary: Vary) -> dict[str, tuple[Any, Any, int]]:
    """Limits and number of values by path, from texts ``PATH=LOW:HIGH:N``, or by path."""
    example = 'drive.speed=100 rpm:600 rpm:51'
    if not isinstance(vary, Mapping):
        ranges = named_ranges(where, listed(vary, where), example, True)
        return {path: (*one.values, one.number) for path, one in ranges.items()}  # type: ignore[misc]
    found: dict[str, tuple[Any, Any, int]] = {}
    for path, given in vary.items():
        several = plain(given)
        if isinstance(several, str):
            found |= read_counted(where, f'{path}={several}')
        elif isinstance(several, list | tuple) and len(several) == 3:
            low, high, count = several
            found[path] = low, high, as_annotated(f'{where}: {path}: number', count, 'int')
        else:
            raise InputError(
                f"{where}: {path} = {quoted(given)}: write (LOW, HIGH, NUMBER) or 'LOW:HIGH:N'"
            )
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
    check_known(chosen, loose, f"{machine.name} has no loose joint '{chosen}'", 'loose:')
    return f'joints.{chosen}.clearance.{name}'


def _listed(given: Limits) -> list[Any]:
    return [*(given['values'] if isinstance(given, Mapping) else given)]


def _choices(
    machine: Machine, content: Mapping[str, Any], path: str, given: Limits
) -> tuple[Any, ...]:
    """The values of a list as the scene has them, whole numbers between limits, or none."""
    listed = _listed(given)
    understood = [_value(check_scene(machine.name, content, {path: x}), path) for x in listed]
    if isinstance(given, Mapping) or len(listed) != 2:
        if len(listed) < 2:
            raise InputError(f'the values of {path}: there must be at least two')
        numbers = (bool, int, float, str)
        pairs = zip(understood, listed, strict=True)
        return tuple(dict.fromkeys(x if isinstance(x, numbers) else text for x, text in pairs))
    if all(isinstance(x, int) and not isinstance(x, bool) for x in understood):
        low, high = understood
        return tuple(range(low, high + 1)) if low < high else ()
    return ()


def _written(limits: Any, values: Sequence[float]) -> tuple[str, float]:
    """The unit in which limits are written, and by what SI values are multiplied for it."""
    for limit, value in zip(limits, values, strict=True):
        number, unit = parted(str(limit)) or ('', '')
        if unit and value:
            return unit, float(number) / value
    return '', 1.0


def _read(machine: Machine, content: Mapping[str, Any], path: str, text: Any) -> float:
    """A value in SI units, as the scene understands it."""
    return _at(check_scene(machine.name, content, {path: text}), path)


def _value(scene: Scene, path: str) -> Any:
    """Number of a quantity, or the first coordinate of a point."""
    place, _ = value_at(scene, path)
    if isinstance(place, QuantityValue):
        return place.value
    return place[0] if isinstance(place, tuple | list) and place else place


def _at(scene: Scene, path: str) -> float:
    value = _value(scene, path)
    if isinstance(value, bool) or not isinstance(value, float | int) or not math.isfinite(value):
        raise InputError(f"'{path}' is not a number of the scene")
    return float(value)
