"""Hard cases, and how all of them are run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

from benchmarks.problem import find_instances
from mechanism_sim.errors import RunError


@dataclass(frozen=True)
class Figure:
    """One number that a case measures, and the bound it must keep (``abs(value) <= bound``).

    A figure that is only reported has an infinite bound.
    """

    name: str
    value: float
    bound: float = math.inf
    unit: str = ''

    @property
    def ok(self) -> bool:
        """True if the bound is kept; a figure that is not a number never keeps it."""
        return abs(self.value) <= self.bound


@dataclass(frozen=True)
class Case:
    """A hard case.

    Attributes
    ----------
    name : short, in snake case
    hard : what is hard about it, one sentence
    truth : by which second route the truth is known, one sentence
    measure : does it
    """

    name: str
    hard: str
    truth: str
    measure: Callable[[], list[Figure]]


@dataclass(frozen=True)
class Outcome:
    """A case that was run."""

    case: Case
    figures: tuple[Figure, ...]
    cpu_time: float  #: [s]
    failure: str = ''  #: what ended it before it had its figures

    @property
    def ok(self) -> bool:
        """True if it ran to the end and every bound is kept."""
        return not self.failure and all(figure.ok for figure in self.figures)


def hard_case(hard: str, truth: str) -> Callable[[Callable[[], list[Figure]]], Case]:
    """Make a case of a function that measures; its name is that of the function."""

    def make(measure: Callable[[], list[Figure]]) -> Case:
        return Case(measure.__name__, hard, truth, measure)

    return make


@cache
def cases() -> tuple[Case, ...]:
    """All cases of the modules beside this one, in the order of their files."""
    return tuple(find_instances('test.hard', Case))


def run(chosen: tuple[Case, ...]) -> Iterator[Outcome]:
    """Run cases one after the other."""
    for case in chosen:
        began = time.process_time()
        try:
            figures, failure = tuple(case.measure()), ''
        except RunError as error:
            figures, failure = (), str(error)
        yield Outcome(case, figures, time.process_time() - began, failure)
