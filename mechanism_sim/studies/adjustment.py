"""Values of several numbers of a scene for which measures of its cycle are as wanted, or least.

Places are tried that fill the space between all limits evenly. From the best of them SciPy goes
on: by least squares for wanted values, by the simplex of Nelder and Mead for the least one, which
measures that have corners do not mislead. The result is a local optimum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.studies.goal import CycleTrial, Goal
from mechanism_sim.studies.parameters import Parameter
from mechanism_sim.studies.runs import Call, FinishedRows, Row, Show, Workers, has_failed

_REACHED = 1e-9
"""Of the range of a measure: what is left there is reached."""
_STARTS = 3
"""Best places from which a search goes on until one has reached the goals."""
_AWAY = 1e6
"""Of the range of a measure, where a machine cannot run."""
_STEP = 1e-7
"""Of differences, as part of the limits: the root of the error of measures."""


@dataclass(frozen=True)
class Adjustment:
    """Values of several parameters, and the measures there, in SI units.

    Attributes
    ----------
    values : by path
    measures, units, wanted : by name of the measure; wanted is None if it was to be least
    reached : True if all measures are as wanted, or the least one was found between the places
    evaluations : cycles that were computed
    failed : values by path at which the machine cannot be or run, and why
    """

    parameters: tuple[Parameter, ...]
    values: dict[str, float]
    measures: dict[str, float]
    units: dict[str, str]
    wanted: dict[str, float | None]
    reached: bool
    evaluations: int
    failed: tuple[tuple[dict[str, float], str], ...]

    @property
    def ends(self) -> list[str]:
        """Paths whose values are at one of their limits."""
        span = {p.path: 1e-6 * (p.high - p.low) for p in self.parameters}
        return [
            p.path
            for p in self.parameters
            if min(self.values[p.path] - p.low, p.high - self.values[p.path]) < span[p.path]
        ]


class _Search:
    """Places in the unit cube moved to [1, 2], so that differences have one size."""

    def __init__(
        self, trial: CycleTrial, parameters: Sequence[Parameter], wanted: Array | None, span: Array
    ) -> None:
        self.trial, self.parameters, self.wanted, self.span = trial, parameters, wanted, span
        self.evaluations, self.best, self.least = 0, np.zeros(0), math.inf
        self.figures: list[float] = []

    def cost(self, place: Array) -> Array:
        """Distances of the measures from what is wanted (M,), or the measure to be least (1,)."""
        self.evaluations += 1
        try:
            found = [x.value for x in self.trial.at(values_at(self.parameters, place))]
        except (InputError, RunError):
            return np.full(len(self.span), _AWAY)
        off = (np.array(found) - (0.0 if self.wanted is None else self.wanted)) / self.span
        size = float(off[0] if self.wanted is None else np.abs(off).max())
        if size < self.least:
            self.best, self.least, self.figures = place.copy(), size, found
        return off

    def descend(self, start: Array) -> None:
        """Search on from a place."""
        if self.wanted is not None:
            scipy.optimize.least_squares(
                self.cost, np.clip(start, 1.0 + 1e-9, 2.0 - 1e-9), bounds=(1.0, 2.0),
                diff_step=_STEP, xtol=1e-14, ftol=1e-15, gtol=1e-15, max_nfev=60,
            )  # fmt: skip
            return
        steps = np.diag(np.where(start < 1.5, 0.1, -0.1))
        scipy.optimize.minimize(
            lambda x: float(self.cost(x)[0]), start, method='Nelder-Mead',
            bounds=[(1.0, 2.0)] * len(start),
            options={'initial_simplex': np.vstack([start, start + steps]), 'xatol': 1e-8,
                     'fatol': 1e-13, 'maxfev': 300 * len(start)},
        )  # fmt: skip


def values_at(parameters: Sequence[Parameter], place: Array) -> dict[str, float]:
    """Values by path at a place in the cube [1, 2]."""
    found = {}
    for parameter, x in zip(parameters, (place - 1.0).tolist(), strict=True):
        low, high = parameter.to_scale(parameter.low), parameter.to_scale(parameter.high)
        found[parameter.path] = parameter.value(low + x * (high - low))
    return found


def _row(trial: CycleTrial, values: dict[str, float]) -> Row:
    found = trial.at(values)
    return {'figures': [x.value for x in found], 'units': [x.unit for x in found]}


def adjust(
    trial: CycleTrial,
    parameters: tuple[Parameter, ...],
    goals: Sequence[Goal],
    samples: int,
    workers: Workers,
    show: Show | None = None,
) -> Adjustment:
    """Vary several numbers of a scene between their limits until measures are as wanted.

    Parameters
    ----------
    samples : places that are tried first
    """
    cube = scipy.stats.qmc.Halton(len(parameters), rng=np.random.default_rng(1))
    places: Array = 1.0 + cube.random(samples)
    values = [values_at(parameters, place) for place in places]
    tasks = [Call(str(k), _row, (trial, one)) for k, one in enumerate(values)]
    with workers as pool:
        known = pool.do(tasks, FinishedRows(), show)
    rows = [known[task.key] for task in tasks]
    failed = tuple(
        (one, row['status']) for one, row in zip(values, rows, strict=True) if has_failed(row)
    )
    if len(failed) == samples:
        raise InputError(f'{trial.name}: no cycle at any of {samples} places: {failed[0][1]}')
    units = next(row['units'] for row in rows if not has_failed(row))
    texts = [goal.value(unit) for goal, unit in zip(goals, units, strict=True)]
    wanted = None if texts[0] is None else np.array(texts, dtype=float)
    figures = np.array([row.get('figures', [math.nan] * len(goals)) for row in rows])
    span = np.nanmax(figures, axis=0) - np.nanmin(figures, axis=0)
    largest = np.nanmax(np.abs(figures), axis=0)
    span = np.where(span > 1e-12 * largest, span, np.where(largest > 0.0, largest, 1.0))
    search = _Search(trial, parameters, wanted, span)
    off = np.abs(figures - wanted) if wanted is not None else figures
    order = np.argsort((off / span).max(axis=1))  # places without a value come last
    for k in order[: _STARTS if wanted is not None else 1]:
        if not has_failed(rows[k]) and (wanted is None or search.least > _REACHED):
            with suppress(ValueError):  # of SciPy, where all about a place has no value
                search.descend(places[k])
    names = [goal.name for goal in goals]
    return Adjustment(
        parameters,
        values_at(parameters, search.best),
        dict(zip(names, search.figures, strict=True)),
        dict(zip(names, units, strict=True)),
        dict(zip(names, texts, strict=True)),
        wanted is None or search.least <= _REACHED,
        samples + search.evaluations,
        failed,
    )
