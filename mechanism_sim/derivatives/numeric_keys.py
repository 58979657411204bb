"""Numbers of a scene by their paths, and how a machine depends on one of them.

The path of a key to the machine (units, assembly, initial pin positions, laws) is ordinary Python
that ends in a few numbers: runtime parameters, the state at the start, laws, coefficients of
impacts. Their derivatives are differences of third order of machines that are built anew, with
errors near 1e-12 of them: there is no motion between, which could make more of a rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mechanism_sim.arguments import listed
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError, nearest
from mechanism_sim.keys.quantities import Part
from mechanism_sim.scene import Machine, load_scene
from mechanism_sim.scene.build import build
from mechanism_sim.scene.facts import value_at
from mechanism_sim.scene.files import check_scene, content_of
from mechanism_sim.scene.schema import Scene
from mechanism_sim.units import QuantityValue

OFFSETS = (1.0, -1.0, 2.0, 0.0)  # the last is that of the machine itself
WEIGHTS = (1.0, -1.0 / 3.0, -1.0 / 6.0, -0.5)
"""Weights of values at multiples of a step: the derivative to third order, times the step."""

_STEP = 2e-4  # of the value: the third power and the rounding over it are alike
_SMALLER = 3.0
_TRIED = 6
_SILENT = {
    'title', 'description', 'duration', 'outputs', 'sensors', 'oscillators', 'measures', 'solver',
    'guess', 'tables',
}  # fmt: skip


@dataclass(frozen=True)
class NumericKey:
    """A number of a scene."""

    machine: Machine
    path: str  #: dotted, as in overrides
    value: float  #: value in SI units
    unit: str  #: unit of the value in the scene, if not given by the key
    step: float  #: [SI] step of the differences
    given: bool  #: True if the scene gives the value; else it is one of the computed start

    def at(self, value: float) -> Machine:
        """The machine with another value."""
        return load_scene(self.machine, self._changed(value))

    def _changed(self, value: float) -> dict[str, Any]:
        value = float(value)  # not as NumPy writes it
        return {self.path: f'{value!r} {self.unit}' if self.unit else value}

    @cached_property
    def beside(self) -> list[Machine]:
        """Machines with the values at `OFFSETS`, all with a valid start.

        Only the farthest is checked as a scene: those between then satisfy the checks, too.
        """
        content, name, found = content_of(self.machine.scene).data, self.machine.name, []
        for offset in OFFSETS:
            if not offset and self.given:
                found.append(self.machine)
                continue
            value = self.value + offset * self.step
            scene = check_scene(name, content, self._changed(value))
            found.append(build(name, scene) if offset == max(OFFSETS) else Machine(name, scene))
        if self.machine.level.dynamic:
            for machine in found:
                machine.initial_state()
        return found


def numeric_keys(machine: Machine, paths: str | Sequence[str]) -> list[NumericKey]:
    """The numbers of a scene by their paths; InputError for a path without a number."""
    found = []
    for path in dict.fromkeys(listed(paths, 'derivatives')):
        value, unit = _value_of(machine.scene, path)
        given = value is not None
        if not given:
            value, unit = _at_start(machine, path)
        if not _is_number(value) or isinstance(value, int):
            kind = 'a whole number' if isinstance(value, int) else 'no number'
            raise InputError(f"{machine.name}: '{path}' is {kind}, without a derivative")
        found.append(_stepped(machine, path, value, unit, given))
    return found


def _value_of(scene: Scene, path: str) -> tuple[Any, str]:
    """Value that a scene gives, its unit where the key leaves it open; None of several values."""
    value, _ = value_at(scene, path) if path.partition('.')[0] not in _SILENT else (None, '')
    if isinstance(value, QuantityValue):
        return value.value, value.unit
    if isinstance(value, tuple) and _has_unit(value):  # a formula
        return value[1], ''
    return (None, '') if isinstance(value, Part | Mapping | list | tuple) else (value, '')


def _leaves(content: Any, path: str = '') -> Iterator[str]:
    """Paths of all that a document holds; a quantity with its unit is one."""
    parts: Any = ()
    if isinstance(content, Mapping):
        parts = content.items()
    elif isinstance(content, tuple | list) and not _has_unit(content):
        parts = enumerate(content)
    elif content is not None:
        yield path
    for key, value in parts:
        yield from _leaves(value, f'{path}.{key}' if path else str(key))


def _has_unit(pair: Sequence[Any]) -> bool:
    return len(pair) == 2 and _is_number(pair[0]) and isinstance(pair[1], str)


def _is_number(x: Any) -> bool:
    return isinstance(x, float | int) and not isinstance(x, bool) and math.isfinite(x)


def _at_start(machine: Machine, path: str) -> tuple[float, str]:
    """Initial coordinate, rate or drive that the scene does not give, by its computed value."""
    begin, _, coordinate = path.rpartition('.')
    which = {'initial.position': 0, 'initial.velocity': 1}.get(begin)
    free = machine.equations.system.free if machine.level.dynamic else ()
    if which is not None and coordinate in free:
        state, i = machine.initial_state(), free.index(coordinate)
        straight = coordinate in machine.mechanism.displacements
        unit = ('m' if straight else 'rad') + ('/s' if which else '')
        return (state.q, state.v)[which][i], unit
    plan = machine.plan
    driven = plan.main if begin == 'drive' else begin.removeprefix('drives.')
    straight = driven in plan.ideal.displacements
    place = 'start_position' if straight else 'start_angle'
    if begin.startswith('drive') and coordinate == place and driven in plan.held:
        turned = 2.0 * math.pi * plan.turned.get(driven, 0)
        return plan.held[driven][0] + turned, 'm' if straight else 'rad'
    leaves = [*_leaves(machine.scene.to_document(exclude=_SILENT))]
    if own := next((x for x in leaves if x.startswith(f'{path}.')), None):
        raise InputError(
            f"{machine.name}: '{path}' holds several values: give the path of a number, as '{own}'"
        )
    known = [*leaves, *(f'initial.{x}.{c}' for x in ('position', 'velocity') for c in free)]
    raise InputError(
        f"{machine.name}: '{path}' is not a number of the scene that its motion depends "
        f'on{nearest(path, known)}'
    )


def _stepped(machine: Machine, path: str, value: float, unit: str, given: bool) -> NumericKey:
    """The key with a step at which the scene can be read on both sides."""
    step = _STEP * (abs(value) or 1.0)
    for _ in range(_TRIED):
        key = NumericKey(machine, path, value, unit, step, given)
        try:
            assert key.beside  # noqa: S101 - they can be built
        except InputError as error:
            step, why = step / _SMALLER, error
        else:
            return key
    raise InputError(
        f"{machine.name}: no derivative by '{path}' = {value:g}, for values beside it are "
        f'refused: {why}'
    )


def differences(key: NumericKey, take: Callable[[Machine], Array], base: Array) -> Array:
    """Derivative of numbers of a machine that is built, such as its parameters.

    Parameters
    ----------
    take : function that returns the numbers (n,) of a machine
    base : numbers of the machine itself
    """
    found = np.zeros_like(base)
    for weight, machine in zip(WEIGHTS[::-1], key.beside[::-1], strict=True):
        try:
            values = take(machine) if machine is not key.machine else base
        except RunError as error:
            raise InputError(
                f"{key.machine.name}: no derivative by '{key.path}': {error}"
            ) from error
        if values.shape != base.shape:
            raise InputError(
                f"{key.machine.name}: '{key.path}' changes the structure of the machine: no "
                'derivative'
            )
        if machine is key.beside[-1]:
            base = values  # what does not depend on the key is exactly alike in all of them
        found += (weight / key.step) * (values - base)
    return found
