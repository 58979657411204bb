"""The value of a number of a scene for which a figure of its cycle is as wanted, or least."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.cycles.columns import unit_of
from mechanism_sim.cycles.cycle import Cycle, cycle
from mechanism_sim.errors import InputError, RunError, nearest
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene
from mechanism_sim.study.parameters import Parameter, parameters
from mechanism_sim.units import to_si

MEASURES: dict[str, Callable[[Cycle, str], float]] = {
    'highest': lambda c, n: c.extremes()[n].greatest.value,
    'lowest': lambda c, n: c.extremes()[n].least.value,
    'largest': lambda c, n: max(-c.extremes()[n].least.value, c.extremes()[n].greatest.value),
    'range': lambda c, n: c.extremes()[n].greatest.value - c.extremes()[n].least.value,
    'mean': lambda c, n: c.mean(n),
    'rms': lambda c, n: c.rms(n),
}
"""Figures of a column over a cycle; extremes are those of the motion, not of samples."""

_GOAL = re.compile(r'\s*(\w+)\s*\(\s*([\w.]+)\s*\)\s*(?:=\s*(.+?)\s*)?')
_ROUNDING = 1e-12
_JUMP = 1e-6  # of the range of the figure: what is left there beside a solution is a step


@dataclass(frozen=True)
class Goal:
    """What a figure of a cycle shall be: a value in SI units, or as small as possible (None)."""

    measure: str
    quantity: str
    wanted: str | None = None

    @property
    def name(self) -> str:
        """As it is written."""
        return f'{self.measure}({self.quantity})'


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
    """A goal as it is written: ``largest(reaction.pin.size) = 20 kN``, or without a value.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    if (so_that is None) == (minimise is None):
        raise InputError("give one of --so-that 'MEASURE(QUANTITY) = VALUE' and --minimise")
    text = so_that if so_that is not None else minimise
    match = _GOAL.fullmatch(text or '')
    if not match or match[1] not in MEASURES or (so_that is None) != (match[3] is None):
        form = 'MEASURE(QUANTITY) = VALUE' if so_that is not None else 'MEASURE(QUANTITY)'
        raise InputError(
            f"'{text}' cannot be read: write {form}, as in 'largest(drive_torque) = 20 N m'; "
            f'measures: {", ".join(MEASURES)}'
        )
    return Goal(match[1], match[2], match[3])


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
    how : arguments of `cycle`: ``duration`` [s], ``periods``, ``static``

    Raises
    ------
    InputError
        If the path, a limit or the quantity is not known, or the machine runs at no value.
    """
    path, low, high = vary
    (parameter,) = parameters(machine, [path], '', limits={path: (low, high)})
    content, count = machine.scene.model_dump(), 0
    units: list[str] = []

    def figure(place: float) -> float:
        nonlocal count
        value = parameter.value(place)
        changed = build(machine.name, check_scene(machine.name, content, {path: value}))
        one = cycle(changed, **how)
        count += 1
        progress(count)
        name = _column(one, goal.quantity)
        if name in one.unbounded and goal.measure not in ('mean', 'rms'):
            at = ', '.join(f'{x.t:.6g} s' for x in one.no_limits[:3])
            raise InputError(f'{goal.quantity} has no value at {at}, and thus no extremes')
        units.append(unit_of(one.machine, name))
        return MEASURES[goal.measure](one, name)

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


def _column(one: Cycle, quantity: str) -> str:
    """The column that a quantity names; that of its size if it is a vector."""
    known = one.table()
    if (size := f'{quantity}.size') in known:
        return size
    if quantity not in known:
        raise InputError(
            f"{one.machine.name}: a cycle has no '{quantity}'{nearest(quantity, known)}; "
            f"'mechanism-sim cycle {one.machine.name} --json' has all columns"
        )
    return quantity


def _quantity(text: str, unit: str) -> float:
    try:
        return float(to_si(text, unit))
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
