"""Goals for measures of a cycle, and cycles of a scene in which numbers are changed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.numerics.expressions import sides
from mechanism_sim.results.cycle import cycle
from mechanism_sim.results.measure_text import Measure, read
from mechanism_sim.results.measures import Measured, Measurement
from mechanism_sim.results.time_integrals import EXACT
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene
from mechanism_sim.units import to_si_like


class Goal(NamedTuple):
    """Goal for a measure of a cycle: a value, or as small as possible (None).

    Attributes
    ----------
    name : the measure as it is written, or its name in the scene
    """

    name: str
    wanted: str | None = None

    def value(self, unit: str) -> float | None:
        """The wanted value in the SI unit of the measure."""
        if self.wanted is None:
            return None
        try:
            return to_si_like(self.wanted, unit)
        except ValueError as error:
            raise InputError(f'the wanted value {self.wanted} {error}') from error


def read_goals(so_that: str | Sequence[str] | None, minimise: str | None) -> tuple[Goal, ...]:
    """Goals as they are written: ``largest(reaction.pin) = 20 kN``, or one without a value."""
    texts = [so_that] if isinstance(so_that, str) else list(so_that or ())
    if bool(texts) == (minimise is not None):
        raise InputError("give one of --so-that 'MEASURE = VALUE' and --minimise")
    if minimise is not None:
        return (Goal(minimise.strip()),)
    found = []
    for text in texts:
        both = sides(text)
        if not both or not all(both) or '(' in both[1]:
            raise InputError(
                f"'{text}' cannot be read: write MEASURE = VALUE, as in "
                "'largest(drive_torque) = 20 N m'"
            )
        found.append(Goal(*both))
    names = [goal.name for goal in found]
    if len(set(names)) < len(names):
        raise InputError(f'{", ".join(names)}: every measure has one wanted value')
    return tuple(found)


@dataclass(frozen=True)
class CycleTrial:
    """Cycles of a scene in which numbers are changed; it can be sent to other processes.

    Attributes
    ----------
    content : of the scene, as a file gives it
    how : arguments of `cycle`
    """

    name: str
    content: dict[str, Any]
    measures: tuple[Measure, ...]
    how: dict[str, Any]

    @classmethod
    def of(cls, machine: Machine, goals: Sequence[Goal], how: dict[str, Any]) -> CycleTrial:
        """Trials of a machine for goals, which may go by names of the scene's own measures."""
        texts = [machine.scene.measures.get(goal.name, goal.name) for goal in goals]
        measures = tuple(read(t, goal.name) for t, goal in zip(texts, goals, strict=True))
        return cls(machine.name, machine.scene.to_document(), measures, how)

    def at(self, values: Mapping[str, float]) -> list[Measured]:
        """The measures of a cycle with these values by path, in SI units.

        Raises
        ------
        RunError
            Also if a measure has no finite value.
        """
        machine = build(self.name, check_scene(self.name, self.content, values))
        one = cycle(machine, **self.how)
        taken = Measurement(machine, list(self.measures), float(one.t[0]), float(one.t[-1]))
        taken.add(one.solution)
        found = taken.found()
        for measured in found:
            if not math.isfinite(measured.value):
                why = f': {measured.resolution}' if measured.resolution != EXACT else ''
                raise RunError(f"'{measured.text}' has no finite value{why}")
        return found
