"""Values of numbers of a scene for which figures of its cycle are as wanted, or least."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from mechanism_sim import tables
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.results.measures import Measured
from mechanism_sim.scene import Source, load_scene
from mechanism_sim.studies.goal import GREATEST, CycleTrial, Goal, read_goals
from mechanism_sim.studies.journal import Journal
from mechanism_sim.studies.optimum import Effort, Optimum, optimum
from mechanism_sim.studies.parameters import Limits, Parameter, parameters
from mechanism_sim.studies.runs import Call, FinishedRows, Row, Show, Workers, has_failed

_ROUNDING = 1e-12
_JUMP = 1e-6  # of the range of the figure: what is left there beside a solution is a step

LOCAL, GLOBAL = SEARCHES = 'local', 'global'
_HOW = {
    'maximise': None, 'samples': 17, 'search': LOCAL, 'evaluations': 400, 'file': None,
    'restart': False,
}  # fmt: skip
"""Options of a search, and what they usually are."""


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
    wanted : value of the figure; None if it was to be least, or greatest
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

    @property
    def table(self) -> list[tables.Column]:
        """The curve."""
        x, y = zip(*self.curve, strict=True)
        return [tables.Column(self.parameter.path, x, 'SI'),
                tables.Column(self.goal.name, y, self.unit)]  # fmt: skip


def find(
    scene: Source,
    vary: Mapping[str, Limits],
    so_that: str | Sequence[str] | None = None,
    *,
    minimise: str | Sequence[str] | None = None,
    subject_to: str | Sequence[str] | None = None,
    workers: Workers | None = None,
    show: Show | None = None,
    **how: Any,
) -> Finding | Optimum:
    """Vary numbers of a scene between limits until measures of its cycle are as wanted.

    With one number and one measure the measure is computed at `samples` values; every change of
    sign between neighbours is followed by Brent's method, and so is the least. Between two samples
    more may lie unseen. With several, or constraints, see `mechanism_sim.studies.optimum`.

    >>> import mechanism_sim as ms
    >>> rod = {'links.rod.length': ('0.2 m', '0.6 m')}
    >>> found = ms.find('slider_crank', rod, so_that='largest(position.piston) = 0.5 m', samples=5)
    >>> round(found.values['links.rod.length'], 9)
    0.45

    Parameters
    ----------
    vary : by dotted path the lowest and highest value, in SI units or with units; between whole
        numbers all of them; or a list of other than two values, or ``{'values': [...]}``
    so_that : ``MEASURE = VALUE``, or several of them; or
    minimise : a measure; of several a front of Pareto
    subject_to : ``MEASURE < VALUE``, also with ``<=``, ``>``, ``>=`` or ``=``, or several of them
    workers : that compute cycles; this process if not given
    show : called with the numbers of values finished and failed, of those at which it is computed
    how : ``maximise`` (a measure, or several); ``samples``, values or places that are tried first
        (17); ``search='global'``, differential evolution between all limits; ``evaluations``,
        cycles after which it ends, and so does a front (400); ``file``, a table of all that was
        tried, with a journal from which an interrupted search goes on; ``restart``, without it;
        ``duration`` and ``periods`` of `cycle`

    Returns
    -------
    Both kinds have ``values`` by path, ``measures`` and the number of ``evaluations``.
    """
    asked = {key: how.pop(key, usual) for key, usual in _HOW.items()}
    goals = read_goals(so_that, minimise, asked['maximise'], subject_to)
    machine, samples = load_scene(scene), asked['samples']
    if samples < 2:
        raise InputError('a search needs at least 2 values to begin with')
    if not vary:
        raise InputError('a search varies at least one key: there is none')
    if asked['search'] not in SEARCHES:
        raise InputError(f"search '{asked['search']}': it must be one of {', '.join(SEARCHES)}")
    varied = parameters(machine, [*vary], '', limits=dict(vary))
    trial = CycleTrial.of(machine, goals, how)
    pool, file = workers or Workers(1), asked['file']
    with ExitStack() as stack:
        rows = FinishedRows()
        if file:
            file = tables.check_file('-o', file)
            rows = stack.enter_context(
                Journal(file, trial.fingerprint, asked['restart'], 'search')
            )
        local = asked['search'] == LOCAL
        if len(varied) == len(goals) == 1 and not varied[0].choices and local:
            found: Finding | Optimum = _along(
                trial, varied[0], goals[0], samples, pool, rows, show
            )
        else:
            effort = Effort(samples, not local, asked['evaluations'])
            found = optimum(trial, varied, goals, effort, pool, rows, show)
        if file:
            tables.write(file, found.table, {'title': machine.scene.title})
    return found


def _along(
    trial: CycleTrial,
    parameter: Parameter,
    goal: Goal,
    samples: int,
    workers: Workers,
    rows: FinishedRows,
    show: Show | None,
) -> Finding:
    """All crossings of a wanted value along one parameter, or the least value."""
    sign = -1.0 if goal.kind == GREATEST else 1.0
    curve, path = _Curve(trial, parameter, sign), parameter.path
    ends = parameter.to_scale(parameter.low), parameter.to_scale(parameter.high)
    places: Array = np.linspace(ends[0], ends[1], samples)
    with workers as pool:
        tasks = [Call(f'{place!r}', curve.point, (place,)) for place in places.tolist()]
        known = pool.do(tasks, rows, show)
        tried = [known[task.key] for task in tasks]
        figures: Array = np.array([row.get('figure', math.nan) for row in tried])
        failed = tuple(
            (parameter.value(place), row['status'])
            for place, row in zip(places.tolist(), tried, strict=True)
            if has_failed(row)
        )
        if len(failed) == samples:
            why = f'no cycle between these limits of {path}: {failed[0][1]}'
            raise InputError(f'{trial.name}: {why}')
        unit = next(row['unit'] for row in tried if not has_failed(row))
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
    """The figure of a cycle over a parameter; its sign is -1 where the greatest is looked for."""

    trial: CycleTrial
    parameter: Parameter
    sign: float

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
        """Where the figure is least, or greatest, to about half of the digits of the value.

        Parameters
        ----------
        best, figure : what is known already, and holds if a cycle fails between the places
        """
        exact, count = {'xatol': 1e-8 * abs(high - low)}, 0
        with suppress(InputError, RunError):
            result = scipy.optimize.minimize_scalar(
                lambda x: self.sign * self.at(x).value, bounds=(low, high), method='bounded',
                options=exact,
            )  # fmt: skip
            count = int(result.nfev)
            if result.fun < self.sign * figure:
                best, figure = float(result.x), self.sign * float(result.fun)
        return {'value': self.parameter.value(best), 'figure': figure, 'evaluations': count}

    def searches(self, places: Array, figures: Array, wanted: float | None) -> list[Call]:
        """Searches between places: for each crossing of a value, or the extreme."""
        if wanted is not None:
            off, span = figures - wanted, float(np.nanmax(figures) - np.nanmin(figures))
            crossed = np.flatnonzero(off[:-1] * off[1:] < 0.0)
            ends = [(float(places[k]), float(places[k + 1])) for k in crossed]
            return [Call(str(x), self.crossing, (*x, wanted, span)) for x in ends]
        k = int(np.nanargmin(self.sign * figures))
        low, high = places[max(k - 1, 0)], places[min(k + 1, len(places) - 1)]
        known = map(float, (low, high, places[k], figures[k]))
        return [Call('least', self.least, tuple(known))]
