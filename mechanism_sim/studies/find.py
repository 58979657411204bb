"""The value of a number of a scene for which a figure of its cycle is as wanted, or least."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.numerics.expressions import sides
from mechanism_sim.results.cycle import cycle
from mechanism_sim.results.measure_text import Measure, read
from mechanism_sim.results.measures import Measured, Measurement
from mechanism_sim.results.time_integrals import EXACT
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene
from mechanism_sim.studies.parameters import Parameter, parameters
from mechanism_sim.studies.runs import Call, FinishedRows, Row, Show, Workers, has_failed
from mechanism_sim.units import to_si_like

_ROUNDING = 1e-12
_JUMP = 1e-6  # of the range of the figure: what is left there beside a solution is a step


@dataclass(frozen=True)
class Goal:
    """Goal for a measure of a cycle: a value, or as small as possible (None).

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
    """The value found, and the curve on the way, in SI units.

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
    workers: Workers | None = None,
    show: Show | None = None,
    **how: Any,
) -> Finding:
    """Vary a number of a scene between two limits until a figure of its cycle is as wanted.

    The figure is computed at `samples` values; every change of sign between neighbours is followed
    by Brent's method, and so is the least. Between two samples more may lie unseen.

    Parameters
    ----------
    vary : dotted path, lowest and highest value as in a scene file
    workers : that compute cycles; this process if not given
    show : called with the numbers of values finished and failed, of those at which it is computed
    how : arguments of `cycle`: ``duration`` [s], ``periods``
    """
    path, low, high = vary
    (parameter,) = parameters(machine, [path], '', limits={path: (low, high)})
    text = machine.scene.measures.get(goal.name, goal.name)
    measure, content = read(text, goal.name), machine.scene.to_document()
    curve = _Curve(machine.name, content, parameter, measure, text, how)
    ends = parameter.to_scale(parameter.low), parameter.to_scale(parameter.high)
    places: Array = np.linspace(ends[0], ends[1], samples)
    with workers or Workers(1) as pool:
        tasks = [Call(str(k), curve.point, (place,)) for k, place in enumerate(places.tolist())]
        known = pool.do(tasks, FinishedRows(), show)
        rows = [known[task.key] for task in tasks]
        figures: Array = np.array([row.get('figure', math.nan) for row in rows])
        failed = tuple(
            (parameter.value(place), row['status'])
            for place, row in zip(places.tolist(), rows, strict=True)
            if has_failed(row)
        )
        if len(failed) == samples:
            why = f'no cycle between these limits of {path}: {failed[0][1]}'
            raise InputError(f'{machine.name}: {why}')
        unit = next(row['unit'] for row in rows if not has_failed(row))
        wanted = None if goal.wanted is None else _quantity(goal.wanted, unit)
        found = [
            Found(row['value'], row['figure'], row.get('jump', False))
            for row in pool.do_all(curve.searches(places, figures, wanted))
        ]
    if wanted is not None:
        hits = np.flatnonzero(figures == wanted)
        found += [Found(parameter.value(places[k]), float(figures[k])) for k in hits]
    shown = [*zip(map(parameter.value, places), figures.tolist(), strict=True)]
    shown += [(one.value, one.figure) for one in found]
    found.sort(key=lambda one: one.value)
    return Finding(parameter, goal, unit, wanted, tuple(sorted(shown)), tuple(found), failed)


def _quantity(text: str, unit: str) -> float:
    try:
        return to_si_like(text, unit)
    except ValueError as error:
        raise InputError(f'the wanted value {text} {error}') from error


@dataclass(frozen=True)
class _Curve:
    """The figure of a cycle over a parameter."""

    name: str
    content: dict[str, Any]
    parameter: Parameter
    measure: Measure
    text: str
    how: dict[str, Any]

    def at(self, place: float) -> Measured:
        """The figure at a place on the parameter's scale."""
        values = {self.parameter.path: self.parameter.value(place)}
        machine = build(self.name, check_scene(self.name, self.content, values))
        one = cycle(machine, **self.how)
        measured = Measurement(machine, [self.measure], float(one.t[0]), float(one.t[-1]))
        measured.add(one.solution)
        (found,) = measured.found()
        if not math.isfinite(found.value):
            why = f': {found.resolution}' if found.resolution != EXACT else ''
            raise RunError(f"'{self.text}' has no finite value{why}")
        return found

    def point(self, place: float) -> Row:
        """The figure at a place, and its unit."""
        found = self.at(place)
        return {'figure': found.value, 'unit': found.unit}

    def crossing(self, low: float, high: float, wanted: float, span: float) -> Row:
        """Where the figure takes the wanted value between two places, by Brent's method.

        Parameters
        ----------
        span : of the figures of the whole curve
        """
        root = scipy.optimize.brentq(
            lambda x: self.at(x).value - wanted, low, high,
            xtol=_ROUNDING * max(abs(low), abs(high)), rtol=4 * _ROUNDING,
        )  # fmt: skip
        there = self.at(root).value
        jump = bool(abs(there - wanted) > _JUMP * span)
        return {'value': self.parameter.value(root), 'figure': there, 'jump': jump}

    def least(self, low: float, high: float, best: float, figure: float) -> Row:
        """Where the figure is least, to about half of the digits of the value.

        Parameters
        ----------
        best, figure : what is known already, and holds if a cycle fails between the places
        """
        exact = {'xatol': 1e-8 * abs(high - low)}
        with suppress(InputError, RunError):
            result = scipy.optimize.minimize_scalar(
                lambda x: self.at(x).value, bounds=(low, high), method='bounded', options=exact
            )
            if result.fun < figure:
                best, figure = float(result.x), float(result.fun)
        return {'value': self.parameter.value(best), 'figure': figure}

    def searches(self, places: Array, figures: Array, wanted: float | None) -> list[Call]:
        """Searches between places: for each crossing of a value, or the least."""
        if wanted is not None:
            off, span = figures - wanted, float(np.nanmax(figures) - np.nanmin(figures))
            crossed = np.flatnonzero(off[:-1] * off[1:] < 0.0)
            ends = [(float(places[k]), float(places[k + 1])) for k in crossed]
            return [Call(str(x), self.crossing, (*x, wanted, span)) for x in ends]
        k = int(np.nanargmin(figures))
        low, high = places[max(k - 1, 0)], places[min(k + 1, len(places) - 1)]
        known = map(float, (low, high, places[k], figures[k]))
        return [Call('least', self.least, tuple(known))]
