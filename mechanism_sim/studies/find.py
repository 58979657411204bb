"""The value of a number of a scene for which a figure of its cycle is as wanted, or least."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.numerics.expressions import sides
from mechanism_sim.results.cycle import cycle
from mechanism_sim.results.measure_text import read
from mechanism_sim.results.measures import Measurement
from mechanism_sim.results.time_integrals import EXACT
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene
from mechanism_sim.studies.parameters import Parameter, parameters
from mechanism_sim.units import to_si_like

_ROUNDING = 1e-12
_JUMP = 1e-6  # of the range of the figure: what is left there beside a solution is a step


@dataclass(frozen=True)
class Goal:
    """What a measure of a cycle shall be: a value, or as small as possible (None).

    Attributes
    ----------
    name : the measure as it is written, or its name in the scene
    """

    name: str
    wanted: str | None = None


@dataclass(frozen=True)
class Found:
    """A value of the parameter, and the figure there; `jump`: it steps across the goal."""

    value: float
    figure: float
    jump: bool = False


@dataclass(frozen=True)
class Finding:
    """What was found, and the curve on the way, in SI units.

    Attributes
    ----------
    parameter, goal : what was varied, and for what
    unit : of the figure
    wanted : value of the figure; None if it was to be least
    curve : (value, figure) in the order of values, not a number where there is none
    found : every crossing of the wanted value that the curve shows, or the least
    failed : values at which the machine cannot be or run, and why
    """

    parameter: Parameter
    goal: Goal
    unit: str
    wanted: float | None
    curve: tuple[tuple[float, float], ...]
    found: tuple[Found, ...]
    failed: tuple[tuple[float, str], ...]


def read_goal(so_that: str | None, minimise: str | None) -> Goal:
    """A goal as it is written: ``largest(reaction.pin) = 20 kN``, or without a value."""
    if (so_that is None) == (minimise is None):
        raise InputError("give one of --so-that 'MEASURE = VALUE' and --minimise")
    if so_that is None:
        return Goal(str(minimise).strip())
    found = sides(so_that)
    if not found or not all(found) or '(' in found[1]:
        raise InputError(
            f"'{so_that}' cannot be read: write MEASURE = VALUE, as in "
            "'largest(drive_torque) = 20 N m'"
        )
    return Goal(*found)


def find(
    machine: Machine,
    vary: tuple[str, str, str],
    goal: Goal,
    samples: int = 17,
    progress: Callable[[int], Any] = lambda _: None,
    **how: Any,
) -> Finding:
    """Vary a number of a scene between two limits until a figure of its cycle is as wanted.

    The figure is computed at `samples` values; every change of sign between neighbours is followed
    by Brent's method, and so is the least. Between two samples more may lie unseen.

    Parameters
    ----------
    vary : dotted path, lowest and highest value as in a scene file
    progress : told the number of cycles so far
    how : arguments of `cycle`: ``duration`` [s], ``periods``
    """
    path, low, high = vary
    (parameter,) = parameters(machine, [path], '', limits={path: (low, high)})
    content, count = machine.scene.to_document(), 0
    units: list[str] = []
    text = machine.scene.measures.get(goal.name, goal.name)
    taken = read(text, goal.name)

    def figure(place: float) -> float:
        nonlocal count
        value = parameter.value(place)
        changed = build(machine.name, check_scene(machine.name, content, {path: value}))
        one = cycle(changed, **how)
        count += 1
        progress(count)
        limits = float(one.t[0]), float(one.t[-1])
        measured = Measurement(changed, [taken], *limits)
        measured.add(one.solution)
        (found,) = measured.found()
        units.append(found.unit)
        if not math.isfinite(found.value):
            why = f': {found.resolution}' if found.resolution != EXACT else ''
            raise RunError(f"'{text}' has no finite value{why}")
        return found.value

    ends = parameter.to_scale(parameter.low), parameter.to_scale(parameter.high)
    places: Array = np.linspace(ends[0], ends[1], samples)
    figures, failed = np.full(samples, np.nan), []
    for k, place in enumerate(places):
        try:
            figures[k] = figure(place)
        except (InputError, RunError) as error:
            failed.append((parameter.value(place), str(error)))
    if not np.isfinite(figures).any():
        raise InputError(
            f'{machine.name}: no cycle between these limits of {path}: {failed[0][1]}'
        )
    unit = units[0]
    wanted = None if goal.wanted is None else _quantity(goal.wanted, unit)
    found = (
        _crossings(figure, parameter, places, figures, wanted)
        if wanted is not None
        else [_least(figure, parameter, places, figures)]
    )
    curve = [*zip(map(parameter.value, places), figures.tolist(), strict=True)]
    curve += [(one.value, one.figure) for one in found]
    return Finding(
        parameter, goal, unit, wanted, tuple(sorted(curve)), tuple(found), tuple(failed)
    )


def _quantity(text: str, unit: str) -> float:
    try:
        return to_si_like(text, unit)
    except ValueError as error:
        raise InputError(f'the wanted value {text} {error}') from error


def _crossings(
    figure: Callable[[float], float],
    parameter: Parameter,
    places: Array,
    figures: Array,
    wanted: float,
) -> list[Found]:
    """Where the figure takes the wanted value."""
    off = figures - wanted
    span = np.nanmax(figures) - np.nanmin(figures)
    found = [
        Found(parameter.value(places[k]), float(figures[k])) for k in np.flatnonzero(off == 0.0)
    ]
    for k in np.flatnonzero(off[:-1] * off[1:] < 0.0):
        root = scipy.optimize.brentq(
            lambda x: figure(x) - wanted, places[k], places[k + 1],
            xtol=_ROUNDING * max(abs(places[k]), abs(places[k + 1])), rtol=4 * _ROUNDING,
        )  # fmt: skip
        there = figure(root)
        found.append(Found(parameter.value(root), there, bool(abs(there - wanted) > _JUMP * span)))
    return sorted(found, key=lambda one: one.value)


def _least(
    figure: Callable[[float], float],
    parameter: Parameter,
    places: Array,
    figures: Array,
) -> Found:
    """Where the figure is least, to about half of the digits of the value."""
    k = int(np.nanargmin(figures))
    ends = places[max(k - 1, 0)], places[min(k + 1, len(places) - 1)]
    best = Found(parameter.value(places[k]), float(figures[k]))
    try:
        exact = {'xatol': 1e-8 * abs(ends[1] - ends[0])}
        result = scipy.optimize.minimize_scalar(
            figure, bounds=ends, method='bounded', options=exact
        )
    except (InputError, RunError):
        return best
    if result.fun < best.figure:
        return Found(parameter.value(float(result.x)), float(result.fun))
    return best


def within_limits(finding: Finding) -> tuple[float, float]:
    """The least and the greatest figure that the curve shows."""
    figures: Sequence[float] = [y for _, y in finding.curve if np.isfinite(y)]
    return min(figures), max(figures)
