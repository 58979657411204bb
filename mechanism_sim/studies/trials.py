"""Cycles of a scene at many places between the limits of its parameters, each computed once."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.studies.goal import EQUAL, CycleTrial, Goal
from mechanism_sim.studies.parameters import Parameter
from mechanism_sim.studies.runs import Call, FinishedRows, Row, Show, Workers, has_failed
from mechanism_sim.tables import Column

EXACT, DIFFERENCES, NONE = 'exact', 'differences', 'none'
_STEP = 1e-7  # step of differences, as part of the limits: the root of the error of measures
_AWAY = 1e6  # distance from a goal, in ranges of a measure, assumed where a machine cannot run
_WHOLE = 1000  # combinations of values of lists that are tried one and all
HELD = 1e-9
"""Share of the size of a limit by which an excess is rounding."""


def _row(trial: CycleTrial, values: dict[str, Any]) -> Row:
    found = trial.at(values)
    return {
        'figures': [x.value for x in found],
        'units': [x.unit for x in found],
        'rounding': [x.rounding for x in found],
    }


def _slopes_row(trial: CycleTrial, values: dict[str, Any], paths: list[str]) -> Row:
    try:
        return {'slopes': trial.slopes(values, paths)}
    except InputError as error:  # at these values as at all others
        return {'refused': str(error)}


class Trials:
    """Measures of cycles at places (N, n) of the unit cube, and how they compare with goals.

    A search that is begun anew takes the same way. So rows of a journal serve one that goes on.

    Parameters
    ----------
    pool : within its block
    rows : rows computed already
    """

    def __init__(
        self,
        trial: CycleTrial,
        parameters: Sequence[Parameter],
        goals: Sequence[Goal],
        pool: Workers,
        rows: FinishedRows,
        show: Show | None = None,
    ) -> None:
        self.parameters, self.goals = tuple(parameters), tuple(goals)
        self._trial, self._pool, self._rows, self._show = trial, pool, rows, show
        self.tried: dict[str, dict[str, Any]] = {}  #: values by path, by the key of the row
        self.units: list[str] = []  #: units of the measures, known after the start
        self.gradients = NONE  #: method of slopes so far: `EXACT`, `DIFFERENCES` or `NONE`
        self.refused = ''  #: reason for missing exact ones, if requested
        self.never = False  #: True if there are none anywhere
        self._sloped: set[str] = set()
        self._counts = [len(p.choices) for p in parameters]
        #: try all combinations of lists of values first
        self.whole = 0 < math.prod(self._counts) <= _WHOLE

    def values(self, place: Array) -> dict[str, Any]:
        """Values by path at a place."""
        pairs = zip(self.parameters, place.tolist(), strict=True)
        return {p.path: p.at(x) for p, x in pairs}

    def at(self, places: Array) -> Array:
        """The measures (N, M) at places, NaN where the machine cannot be or run."""
        values = [self.values(place) for place in places]
        keys = [json.dumps([*one.values()]) for one in values]
        self.tried.update(zip(keys, values, strict=True))
        new = {k: v for k, v in zip(keys, values, strict=True) if k not in self._rows.rows}
        tasks = [Call(k, _row, (self._trial, v)) for k, v in new.items()]
        rows = self._pool.do(tasks, self._rows, self._show)
        none = [math.nan] * len(self.goals)
        return np.array([rows[k].get('figures', none) for k in keys], dtype=float)

    @property
    def evaluations(self) -> int:
        """Cycles that were computed, or taken from a journal."""
        return len(self.tried) + len(self._sloped)

    def slopes(self, place: Array, free: Sequence[int]) -> Array:
        """Derivatives (M, F) of the measures in some coordinates of a place."""
        if (exact := self.exact(place, free)) is not None:
            self.gradients = EXACT if self.gradients == NONE else self.gradients
            return exact
        self.gradients = DIFFERENCES
        steps = np.where(place > 0.5, -_STEP, _STEP)
        others = np.tile(place, (len(free), 1))
        others[range(len(free)), free] += steps[free]
        figures = self.at(np.vstack([place, others]))
        slopes = (figures[1:] - figures[0]).T / steps[free]
        return np.ascontiguousarray(np.nan_to_num(slopes, nan=0.0))  # SLSQP reads no strides

    def exact(self, place: Array, free: Sequence[int]) -> Array | None:
        """Slopes of variational equations, from one run; none where they are refused."""
        if self.never:
            return None
        values, some = self.values(place), [self.parameters[k] for k in free]
        key = json.dumps(['slopes', *values.values()])
        task = Call(key, _slopes_row, (self._trial, values, [p.path for p in some]))
        row = self._pool.do([task], self._rows, self._show)[key]
        if 'slopes' not in row:
            self.never = 'refused' in row
            self._sloped |= set() if self.never else {key}
            self.refused = self.refused or str(row.get('refused', row['status']))
            return None
        self._sloped.add(key)
        widths = [p.slope(x) for p, x in zip(some, place[list(free)].tolist(), strict=True)]
        return np.ascontiguousarray(np.array(row['slopes']) * widths)

    def figure(self, place: float) -> float:
        """The first measure at a place on the only parameter; raises what a cycle raises."""
        value = float(self.at(np.array([[place]]))[0, 0])
        if math.isnan(value):
            raise RunError(self._rows.rows[json.dumps([self.parameters[0].at(place)])]['status'])
        return value

    def off(self, place: float, wanted: float) -> float:
        """Difference of the first measure at a place from a value; 0 within rounding."""
        off = self.figure(place) - wanted
        key = json.dumps([self.parameters[0].at(place)])
        rounding = self._rows.rows[key].get('rounding', [0.0])[0]  # none in older journals
        return off if abs(off) > rounding else 0.0

    def spread(self, samples: int) -> Array:
        """Places (N, n) that fill the cube evenly.

        All combinations where there are only lists of values, and not too many of them.
        """
        count = len(self.parameters)
        if self.whole:
            middles = [(np.arange(k) + 0.5) / k for k in self._counts]
            return np.stack(np.meshgrid(*middles, indexing='ij'), -1).reshape(-1, count)
        cube = scipy.stats.qmc.Halton(count, rng=np.random.default_rng(1))
        return np.asarray(cube.random(samples))

    def start(self, places: Array) -> Array:
        """The measures (N, M) at the first places, and what is known from them."""
        figures = self.at(places)
        rows = [(values, self._rows.rows[key]) for key, values in self.tried.items()]
        self.failed = [(values, row['status']) for values, row in rows if has_failed(row)]
        if len(self.failed) == len(rows):
            raise InputError(
                f'{self._trial.name}: no cycle at any of {len(rows)} places: {self.failed[0][1]}'
            )
        self.units = next(row['units'] for _, row in rows if not has_failed(row))
        return figures

    def columns(self) -> list[Column]:
        """A table of what was tried, in its order."""
        rows = [self._rows.rows[key] for key in self.tried]
        columns = [
            Column(p.path, [values[p.path] for values in self.tried.values()], p.si)
            for p in self.parameters
        ]
        seen = {}
        for k, (goal, unit) in enumerate(zip(self.goals, self.units, strict=True)):
            figures = [None if has_failed(row) else row['figures'][k] for row in rows]
            seen[goal.name] = Column(goal.name, figures, unit)
        return [*columns, *seen.values(), Column('status', [row['status'] for row in rows])]


class Aims:
    """Goals as numbers: what is to be small, and what must not be above 0.

    Parameters
    ----------
    limits : (M,) values that are wanted, and limits
    figures : (N, M) of which the spans scale what is compared
    """

    def __init__(self, goals: Sequence[Goal], limits: Array, figures: Array) -> None:
        kinds = [goal.kind for goal in goals]
        self.extremes = [k for k, goal in enumerate(goals) if goal.is_extreme]
        equal = [k for k, kind in enumerate(kinds) if kind == EQUAL]
        self.targets = [] if self.extremes else equal
        aims = {*self.extremes, *self.targets}
        self.bounds = [k for k in range(len(kinds)) if k not in aims]
        self.equal = np.isin(self.bounds, equal)
        self.limits, self.signs = limits, np.array([goal.sign for goal in goals])
        with np.errstate(all='ignore'):
            span = np.nanmax(figures, axis=0) - np.nanmin(figures, axis=0)
            largest = np.nanmax(np.abs(figures), axis=0)
        span = np.where(span > 1e-12 * largest, span, np.where(largest > 0.0, largest, 1.0))
        self.scales = np.where((limits != 0.0) & np.isin(range(len(kinds)), self.bounds),
                               np.abs(limits), span)  # fmt: skip

    def scaled(self, figures: Array) -> Array:
        """All measures (..., M) less their limits, with the sign and size of what is compared."""
        off = self.signs * (figures - self.limits) / self.scales
        return np.where(np.isfinite(off), off, _AWAY)

    def costs(self, figures: Array) -> Array:
        """Values (N, K) that are to be small: each extreme, or the largest miss of a target."""
        off = self.scaled(figures)
        if self.extremes:
            return off[:, self.extremes]
        return np.asarray(np.abs(off[:, self.targets]).max(axis=1, keepdims=True))

    def excess(self, figures: Array) -> Array:
        """Largest violation (N,) of a constraint, 0 where all hold."""
        off = self.scaled(figures)[:, self.bounds]
        off = np.where(self.equal, np.abs(off) - HELD, off)
        worst = off.max(axis=1, initial=0.0)
        return np.where(worst > HELD, worst, 0.0)

    def order(self, figures: Array) -> NDArray[np.intp]:
        """The rows (N,) from the best to the worst: runs, constraints, then the cost."""
        cost, failed = self.costs(figures).sum(axis=1), ~np.isfinite(figures).all(axis=1)
        return np.lexsort((cost, self.excess(figures), failed))
