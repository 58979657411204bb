"""The value of a number of a scene for which a figure of its cycle is as wanted, or least."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.results.measures import Measured
from mechanism_sim.scene import Source, load_scene
from mechanism_sim.studies.adjustment import Adjustment, adjust
from mechanism_sim.studies.goal import CycleTrial, Goal, read_goals
from mechanism_sim.studies.parameters import Parameter, parameters
from mechanism_sim.studies.runs import Call, FinishedRows, Row, Show, Workers, has_failed

_ROUNDING = 1e-12
_JUMP = 1e-6  # of the range of the figure: what is left there beside a solution is a step


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
    evaluations : cycles that were computed
    """

    parameter: Parameter
    goal: Goal
    unit: str
    wanted: float | None
    curve: tuple[tuple[float, float], ...]
    found: tuple[Found, ...]
    failed: tuple[tuple[float, str], ...]
    evaluations: int

    @property
    def values(self) -> dict[str, float]:
        """The first value found, by path; empty if there is none."""
        return {self.parameter.path: self.found[0].value} if self.found else {}

    @property
    def measures(self) -> dict[str, float]:
        """The figure there, by the name of the measure."""
        return {self.goal.name: self.found[0].figure} if self.found else {}


def find(
    scene: Source,
    vary: Mapping[str, tuple[Any, Any]],
    so_that: str | Sequence[str] | None = None,
    *,
    minimise: str | None = None,
    samples: int = 17,
    workers: Workers | None = None,
    show: Show | None = None,
    **how: Any,
) -> Finding | Adjustment:
    """Vary numbers of a scene between limits until measures of its cycle are as wanted.

    With one number and one measure the measure is computed at `samples` values; every change of
    sign between neighbours is followed by Brent's method, and so is the least. Between two samples
    more may lie unseen. With several, see `mechanism_sim.studies.adjustment`.

    >>> import mechanism_sim as ms
    >>> rod = {'links.rod.length': ('0.2 m', '0.6 m')}
    >>> found = ms.find('slider_crank', rod, so_that='largest(position.piston) = 0.5 m', samples=5)
    >>> round(found.values['links.rod.length'], 9)
    0.45

    Parameters
    ----------
    vary : lowest and highest value by dotted path, in SI units or with units
    so_that : ``MEASURE = VALUE``, or several of them; or
    minimise : a measure
    samples : values, or places, that are tried first
    workers : that compute cycles; this process if not given
    show : called with the numbers of values finished and failed, of those at which it is computed
    how : arguments of `cycle`: ``duration``, ``periods``

    Returns
    -------
    Both kinds have ``values`` by path, ``measures`` and the number of ``evaluations``.
    """
    goals, machine = read_goals(so_that, minimise), load_scene(scene)
    if samples < 2:
        raise InputError('a search needs at least 2 values to begin with')
    if not vary:
        raise InputError('a search varies at least one key: there is none')
    varied = parameters(machine, [*vary], '', limits=dict(vary))
    trial = CycleTrial.of(machine, goals, how)
    makers = workers or Workers(1)
    if len(varied) > 1 or len(goals) > 1:
        return adjust(trial, varied, goals, samples, makers, show)
    return _along(trial, varied[0], goals[0], samples, makers, show)


def _along(
    trial: CycleTrial,
    parameter: Parameter,
    goal: Goal,
    samples: int,
    workers: Workers,
    show: Show | None,
) -> Finding:
    """All crossings of a wanted value along one parameter, or the least value."""
    curve, path = _Curve(trial, parameter), parameter.path
    ends = parameter.to_scale(parameter.low), parameter.to_scale(parameter.high)
    places: Array = np.linspace(ends[0], ends[1], samples)
    with workers as pool:
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
            raise InputError(f'{trial.name}: {why}')
        unit = next(row['unit'] for row in rows if not has_failed(row))
        wanted = goal.value(unit)
        searched = list(pool.do_all(curve.searches(places, figures, wanted)))
    found = [Found(row['value'], row['figure'], row.get('jump', False)) for row in searched]
    evaluations = samples + sum(row['evaluations'] for row in searched)
    if wanted is not None:
        hits = np.flatnonzero(figures == wanted)
        found += [Found(parameter.value(places[k]), float(figures[k])) for k in hits]
    shown = [*zip(map(parameter.value, places), figures.tolist(), strict=True)]
    shown += [(one.value, one.figure) for one in found]
    found.sort(key=lambda one: one.value)
    return Finding(
        parameter, goal, unit, wanted, tuple(sorted(shown)), tuple(found), failed, evaluations
    )


@dataclass(frozen=True)
class _Curve:
    """The figure of a cycle over a parameter."""

    trial: CycleTrial
    parameter: Parameter

    def at(self, place: float) -> Measured:
        """The figure at a place on the parameter's scale."""
        return self.trial.at({self.parameter.path: self.parameter.value(place)})[0]

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
        root, way = scipy.optimize.brentq(
            lambda x: self.at(x).value - wanted, low, high,
            xtol=_ROUNDING * max(abs(low), abs(high)), rtol=4 * _ROUNDING, full_output=True,
        )  # fmt: skip
        there = self.at(root).value
        jump = bool(abs(there - wanted) > _JUMP * span)
        count = way.function_calls + 1
        value = self.parameter.value(root)
        return {'value': value, 'figure': there, 'jump': jump, 'evaluations': count}

    def least(self, low: float, high: float, best: float, figure: float) -> Row:
        """Where the figure is least, to about half of the digits of the value.

        Parameters
        ----------
        best, figure : what is known already, and holds if a cycle fails between the places
        """
        exact, count = {'xatol': 1e-8 * abs(high - low)}, 0
        with suppress(InputError, RunError):
            result = scipy.optimize.minimize_scalar(
                lambda x: self.at(x).value, bounds=(low, high), method='bounded', options=exact
            )
            count = int(result.nfev)
            if result.fun < figure:
                best, figure = float(result.x), float(result.fun)
        return {'value': self.parameter.value(best), 'figure': figure, 'evaluations': count}

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
