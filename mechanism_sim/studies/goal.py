"""Goals for measures of a cycle, and cycles of a scene in which numbers are changed."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from mechanism_sim.arguments import listed
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.numerics.expressions import sides
from mechanism_sim.results.cycle import cycle, cycle_window, measures_of
from mechanism_sim.results.measure_accumulators import EXACT
from mechanism_sim.results.measure_text import Measure, read
from mechanism_sim.results.measures import Measured, Measurement
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import rebuilt
from mechanism_sim.units import to_si_like

LEAST, GREATEST, EQUAL, _BELOW, _ABOVE = 'least', 'greatest', '=', '<', '>'
_SIGNS = {'=': EQUAL, '<': _BELOW, '<=': _BELOW, '>': _ABOVE, '>=': _ABOVE}
_TURNED = {EQUAL: EQUAL, _BELOW: _ABOVE, _ABOVE: _BELOW}
_BOUND = "MEASURE < VALUE, as in 'largest(reaction.pin) < 12 kN', with <, <=, >, >= or ="


class Goal(NamedTuple):
    """Goal for a measure of a cycle."""

    name: str  #: the measure as it is written, or its name in the scene
    kind: str  #: least, greatest, or how it compares with `wanted`: ``=``, ``<``, ``>``
    wanted: str = ''  #: target value, or limit

    @property
    def is_extreme(self) -> bool:
        """True if the measure is to be least or greatest."""
        return self.kind in (LEAST, GREATEST)

    @property
    def sign(self) -> float:
        """Factor of the minimised quantity: the measure, or its excess over the limit."""
        return -1.0 if self.kind in (GREATEST, _ABOVE) else 1.0

    @property
    def text(self) -> str:
        """The goal as it may be written."""
        return f'{self.name} {self.kind} {self.wanted}' if self.wanted else self.name

    def value(self, unit: str) -> float | None:
        """The wanted value, or the limit, in the SI unit of the measure."""
        if not self.wanted:
            return None
        try:
            return to_si_like(self.wanted, unit)
        except ValueError as error:
            raise InputError(f'the wanted value {self.wanted} {error}') from error


def read_goals(
    so_that: str | Sequence[str] | None = None,
    minimise: str | Sequence[str] | None = None,
    maximise: str | Sequence[str] | None = None,
    subject_to: str | Sequence[str] | None = None,
) -> tuple[Goal, ...]:
    """Goals as they are written: ``largest(reaction.pin) = 20 kN``, or one without a value."""
    wanted = [_wanted(text) for text in listed(so_that, 'so_that')]
    extremes = [Goal(text.strip(), LEAST) for text in listed(minimise, 'minimise')]
    extremes += [Goal(text.strip(), GREATEST) for text in listed(maximise, 'maximise')]
    if bool(wanted) == bool(extremes):
        raise InputError(
            "give one of --so-that 'MEASURE = VALUE' and --minimise or --maximise MEASURE"
        )
    for goals in (wanted, extremes):
        names = [goal.name for goal in goals]
        if len(set(names)) < len(names):
            raise InputError(f'{", ".join(names)}: every measure has one wanted value')
    limits = listed(subject_to, 'subject_to')
    bounds = (read_bound(text, f"'{text}' cannot be read: write {_BOUND}") for text in limits)
    return (*wanted, *extremes, *bounds)


def _wanted(text: str) -> Goal:
    both = sides(text)
    if not both or not all(both) or '(' in both[2]:
        raise InputError(
            f"'{text}' cannot be read: write MEASURE = VALUE, as in "
            "'largest(drive_torque) = 20 N m'"
        )
    return Goal(both[0], EQUAL, both[2])


def read_bound(text: str, refusal: str) -> Goal:
    """A condition, with the measure on its left side; of two measures their difference.

    Parameters
    ----------
    refusal : the sentence for a text that is none
    """
    both = sides(text, *_SIGNS)
    if not both or not all(both):
        raise InputError(refusal)
    left, kind, right = both[0], _SIGNS[both[1]], both[2]
    if '(' not in left and ('(' in right or left[0] in '+-.0123456789'):
        left, kind, right = right, _TURNED[kind], left
    if '(' in right:
        left, right = f'{left} - ({right})', '0'
    return Goal(left, kind, right)


@dataclass(frozen=True)
class CycleTrial:
    """Cycles of a scene in which numbers are changed; it can be sent to other processes."""

    name: str
    content: dict[str, Any]  #: keys and values of the scene, as in a file
    measures: tuple[Measure, ...]
    how: dict[str, Any]  #: arguments of `cycle`

    @classmethod
    def of(cls, machine: Machine, goals: Sequence[Goal], how: dict[str, Any]) -> CycleTrial:
        """Trials of a machine for goals, which may go by names of the scene's own measures."""
        texts = [machine.scene.measures.get(goal.name, goal.name) for goal in goals]
        measures = tuple(read(t, goal.name) for t, goal in zip(texts, goals, strict=True))
        Measurement(machine, measures)  # a name that is none is refused before anything runs
        return cls(machine.name, machine.scene.to_document(), measures, how)

    @property
    def fingerprint(self) -> str:
        """Fingerprint of the computation, in a few letters."""
        texts = [[m.text, [f.path for f in m.figures]] for m in self.measures]
        content = json.dumps([self.content, texts, self.how], sort_keys=True, default=str)
        return hashlib.sha256(content.encode()).hexdigest()[:16]

    def at(self, values: Mapping[str, Any]) -> list[Measured]:
        """The measures of a cycle with these values by path, in SI units.

        Raises
        ------
        RunError
            Also if a measure has no finite value.
        """
        machine = rebuilt(self.name, self.content, values)
        found = measures_of(cycle(machine, **self.how), list(self.measures), silent=True)
        for measured in found:
            if not math.isfinite(measured.value):
                why = f': {measured.resolution}' if measured.resolution != EXACT else ''
                raise RunError(f"'{measured.text}' has no finite value{why}")
        return found

    def slopes(self, values: Mapping[str, Any], paths: Sequence[str]) -> list[list[float]]:
        """Derivatives of the measures by numbers of the scene, from one run, in SI units.

        Raises
        ------
        InputError
            If there are none by one of the numbers, or the motion follows from its drives: then
            differences of runs are as good, and take fewer of them.
        RunError
            If there are none at these values.
        """
        machine = rebuilt(self.name, self.content, values)
        machine, begin, end = cycle_window(machine, **self.how)
        if not machine.level.dynamic:
            raise InputError(f'{machine.name}: its motion follows from its drives')
        run = simulate(machine, duration=end, derivatives=paths)
        texts = dict.fromkeys(m.text for m in self.measures)
        window = begin, math.inf
        found = {path: run.derivatives[path].measures(*texts, window=window) for path in paths}
        slopes = [[found[path][m.text] for path in paths] for m in self.measures]
        if not all(math.isfinite(x) for row in slopes for x in row):
            ends = [d.end for d in run.derivatives.values() if d.end]
            raise RunError(f'no derivatives: {ends[0] if ends else "they are not finite"}')
        return slopes
