"""Benchmark problems: methods that answer one question, and the error of each answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pkgutil import iter_modules
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

Answer = NDArray[np.float64]
Instance = TypeVar('Instance')


class Outcome(NamedTuple):
    """Outcome of a run.

    `cpu_time` [s] is that of the timed work if another process did it, as that process reports it.
    """

    answer: Answer
    steps: int | None = None
    impacts: int | None = None
    cpu_time: float | None = None


Run = Callable[[], Callable[[], Outcome]]
"""Calling it is the timed work, from the same start every time; what it returns gives the
outcome and is not timed."""


def nothing_missing() -> str | None:
    """Check of methods that need no package but those of this one: nothing is missing."""
    return None


def missing(package: str) -> str | None:
    """Reason why a method with an optional package cannot run here; ``None`` if it can."""
    return None if find_spec(package) else f'{package} is not installed'


def run_once(work: Callable[[], Outcome]) -> Run:
    """A run of work that ends with its outcome."""

    def run() -> Callable[[], Outcome]:
        outcome = work()
        return lambda: outcome

    return run


def find_instances(package: str, kind: type[Instance]) -> list[Instance]:
    """All things of a kind in the modules of a package, in the order of their files.

    Programs and tests beside them, ``__main__`` and ``test_...``, hold none.
    """
    found: list[Instance] = []
    for module in iter_modules(import_module(package).__path__):
        if module.name.startswith(('_', 'test_')):
            continue
        content = vars(import_module(f'{package}.{module.name}'))
        found += [thing for thing in content.values() if isinstance(thing, kind)]
    return found


@dataclass(frozen=True)
class Method:
    """One way to answer.

    Attributes
    ----------
    name : such as ``'SciPy DOP853'``
    settings : tolerances, numbers of steps, stiffnesses: the accuracy asked for, coarse first
    setting : what they are, with their unit
    prepare : all that is not timed run by run, compilation included (timed apart)
    how : how it is used and tuned, one sentence
    missing : why it cannot run here; ``None`` if it can
    """

    name: str
    settings: tuple[float, ...]
    setting: str
    prepare: Callable[[float], Run]
    how: str
    missing: Callable[[], str | None] = nothing_missing


@dataclass(frozen=True)
class Problem:
    """One question.

    Attributes
    ----------
    name, title : in snake case; in words
    unit, amount : what costs are counted by, such as ``'revolution'``; units in one run
    error_unit : of `error`, such as ``'rad'``
    reference : where the right answer comes from, one sentence
    error : how wrong an answer is
    methods : this package's first, called `OURS`
    goal : the error at which methods are compared by one figure
    """

    name: str
    title: str
    unit: str
    amount: float
    error_unit: str
    reference: str
    error: Callable[[Answer], float]
    methods: tuple[Method, ...]
    goal: float = 1e-9


OURS = 'mechanism_sim'


@cache
def problems() -> dict[str, Problem]:
    """All problems of the modules in `benchmarks.problems` by name, in their order."""
    return {p.name: p for p in find_instances('benchmarks.problems', Problem)}
