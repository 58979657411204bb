"""Values of several numbers of a scene for which measures of its cycle are as wanted, or least.

Places are tried that fill the space between all limits evenly. From the best of them SciPy goes
on: by least squares for wanted values; by the simplex of Nelder and Mead for the least value,
which measures that have corners do not mislead; under constraints by SLSQP, and from there by
COBYQA, which does without differences. Slopes are exact where the motion is integrated and has
derivatives: then SLSQP comes first without constraints, too, and where it ends at an optimum
nothing follows. The result is a local optimum. Lists of values, and a
search everywhere, take differential evolution before. Several measures that are to be least have a
front.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.studies.front import evolve, undominated
from mechanism_sim.studies.goal import Goal
from mechanism_sim.studies.parameters import Parameter
from mechanism_sim.studies.trials import HELD, Aims, Trials
from mechanism_sim.tables import Column

_REACHED = 1e-9  # share of the range of a measure within which a goal is reached
_STARTS = 3  # best places from which a search goes on until one has reached the goals
_ENDED = 1e-8  # share of the limits within which a search does not distinguish places
_AT_END = 1e-6  # share of the limits within which values of least squares are at a limit
_ACTIVE, _FLAT = 1e-7, 1e-5  # distance from a limit that is none, and slope of a cost that is none


class Held(NamedTuple):
    """A constraint at the values found.

    Attributes
    ----------
    text : text as written
    value, limit : value and limit of its measure, in `unit`
    holds, active : True if the limit holds, and if it is reached
    """

    text: str
    value: float
    limit: float
    unit: str
    holds: bool
    active: bool


class FoundDesign(NamedTuple):
    """Values by path, and the measures there by name, in SI units."""

    values: dict[str, Any]
    measures: dict[str, float]


@dataclass(frozen=True)
class Optimum:
    """Values of several parameters, and the measures there, in SI units.

    Attributes
    ----------
    values : values by path
    measures, units, wanted : by name of the measure; wanted is None if it was to be least
    constraints : constraints at these values
    reached : True if all constraints hold and all measures are as wanted, or the least that were
        found between the places
    evaluations : cycles that were computed, or taken from a journal
    gradients : ``exact``, of variational equations; ``differences`` of cycles, and then `refused`
        says why not exact; or ``none``, as none were needed
    failed : values by path at which the machine cannot be or run, and why
    front : designs of which none is better in one measure without being worse in another, where
        several were to be least; `values` are then those nearest to the least of all
    table : all that was tried
    """

    parameters: tuple[Parameter, ...]
    goals: tuple[Goal, ...]
    values: dict[str, Any]
    measures: dict[str, float]
    units: dict[str, str]
    wanted: dict[str, float | None]
    constraints: tuple[Held, ...]
    reached: bool
    evaluations: int
    gradients: str
    refused: str
    failed: tuple[tuple[dict[str, Any], str], ...]
    front: tuple[FoundDesign, ...]
    table: list[Column]

    @property
    def successful(self) -> bool:
        """True if all wanted values are reached, and constraints hold."""
        wanted = any(x is not None for x in self.wanted.values())
        return all(c.holds for c in self.constraints) and (self.reached or not wanted)

    @property
    def ends(self) -> list[str]:
        """Paths whose values are at one of their limits."""
        found = []
        for p in self.parameters:
            value, span = self.values[p.path], 1e-6 * (p.high - p.low)
            if not p.choices and min(value - p.low, p.high - value) < span:
                found.append(p.path)
        return found


class Budget(NamedTuple):
    """Budget of an optimisation."""

    samples: int  #: places that are tried first; at least designs of a generation of a front
    everywhere: bool  #: search between all limits by differential evolution
    evaluations: int  #: cycles after which evolutions end


class _Search:
    """Searches that go on from places; they remember the best place of all."""

    def __init__(self, trials: Trials, aims: Aims, places: Array, figures: Array) -> None:
        self.trials, self.aims = trials, aims
        self.free = [k for k, p in enumerate(trials.parameters) if not p.choices]
        self.order = aims.order(figures)
        self.keep(places, figures, int(self.order[0]))

    @property
    def reached(self) -> bool:
        """True if all constraints hold and all targets are met."""
        missed = bool(self.aims.targets) and self.aims.costs(self.figures)[0, 0] > _REACHED
        return not missed and not self.aims.excess(self.figures)[0]

    def keep(self, places: Array, figures: Array, k: int) -> None:
        """Take one of some places as the best."""
        self.place, self.figures = places[k], figures[[k]]

    def at(self, places: Array) -> Array:
        """The measures (N, M) at places; the best is kept."""
        figures = self.trials.at(places)
        both = np.vstack([self.figures, figures])
        self.keep(np.vstack([self.place, places]), both, int(self.aims.order(both)[0]))
        return figures

    def run(self, places: Array, figures: Array, budget: Budget) -> None:
        """Search on from places, of which measures are known."""
        if budget.everywhere or len(self.free) < len(self.trials.parameters):
            for place in self.everywhere(places, budget.evaluations)[:_STARTS]:
                self.descend(place)
        else:
            count = _STARTS if self.aims.targets or self.aims.bounds else 1
            for k in self.order[:count]:
                if np.isfinite(figures[k]).all() and not (self.aims.targets and self.reached):
                    self.descend(places[k])
        if self.free and self.aims.bounds and not (self.aims.targets and self.reached):
            problem, x = _Problem(self, self.place), self.place[self.free]
            if not problem.is_stationary(x):
                problem.cornered(x)

    def descend(self, start: Array) -> None:
        """Search on from a place, without change of values that are of lists."""
        problem, x = _Problem(self, start), start[self.free]
        if not self.free:
            return
        if self.aims.targets:
            problem.least_squares(x)
        elif self.aims.bounds:
            problem.smooth(x)
        elif self.trials.exact(start, self.free) is None:
            problem.simplex(x)
        else:
            problem.smooth(x)
            x = self.place[self.free]
            if not problem.is_stationary(x):
                problem.simplex(x)

    def everywhere(self, first: Array, evaluations: int) -> list[Array]:
        """Search between all limits by differential evolution from places; the best there."""
        generations = max(1, evaluations // len(first) - 1)

        def merit(places: Array) -> Array:
            figures = self.at(places.T)
            cost, excess = self.aims.costs(figures)[:, 0], self.aims.excess(figures)
            return np.where(excess > 0.0, 1e3 + excess, cost)  # Deb: feasible is better

        result = scipy.optimize.differential_evolution(
            merit, [(0.0, 1.0)] * first.shape[1], init=first, maxiter=generations, rng=1,
            vectorized=True, updating='deferred', polish=False, tol=_REACHED,
        )  # fmt: skip
        places = result.population[np.argsort(result.population_energies)]
        lists = [p for p in self.trials.parameters if p.choices]
        values = [self.trials.values(place) for place in places]
        told = [str([one[p.path] for p in lists]) for one in values]
        return [places[told.index(one)] for one in dict.fromkeys(told)]


class _Problem:
    """Functions of the free coordinates (F,) for SciPy, at fixed values of the others."""

    def __init__(self, search: _Search, place: Array) -> None:
        self._search, self._aims, self._place = search, search.aims, place.copy()

    def _whole(self, x: Array) -> Array:
        """The place with these free coordinates."""
        place = self._place.copy()
        place[self._search.free] = np.clip(x, 0.0, 1.0)
        return place

    def _scaled(self, x: Array) -> Array:
        return self._aims.scaled(self._search.at(self._whole(x)[None])[0])

    def _slopes(self, x: Array) -> Array:
        """Derivatives (M, F) of what `_scaled` returns."""
        aims = self._aims
        slopes = self._search.trials.slopes(self._whole(x), self._search.free)
        return slopes * (aims.signs / aims.scales)[:, None]

    def _cost(self, x: Array) -> float:
        off = self._scaled(x)
        if self._aims.extremes:
            return float(off[self._aims.extremes[0]])
        return float((off[self._aims.targets] ** 2).sum())

    def _cost_slopes(self, x: Array) -> Array:
        slopes = self._slopes(x)
        if self._aims.extremes:
            return np.asarray(slopes[self._aims.extremes[0]])
        targets = self._aims.targets
        return np.asarray(2.0 * self._scaled(x)[targets] @ slopes[targets])

    def least_squares(self, x: Array) -> None:
        """Distances from targets, and by how much constraints are exceeded, to zero."""
        kept = [*self._aims.targets, *self._aims.bounds]
        above = np.isin(kept, np.array(self._aims.bounds, int)[~self._aims.equal])

        def rest(x: Array) -> Array:
            off = self._scaled(x)[kept]
            return np.where(above, np.maximum(off, 0.0), off)

        def slopes(x: Array) -> Array:
            held = above & (self._scaled(x)[kept] <= 0.0)
            return np.where(held[:, None], 0.0, self._slopes(x)[kept])

        def solve(x: Array, free: NDArray[np.bool_]) -> Array:
            def whole(y: Array) -> Array:
                found = x.copy()
                found[free] = y
                return found

            y = scipy.optimize.least_squares(
                lambda y: rest(whole(y)), np.clip(x[free], 1e-9, 1.0 - 1e-9),
                lambda y: slopes(whole(y))[:, free], bounds=(0.0, 1.0),
                xtol=1e-14, ftol=1e-15, gtol=1e-15, max_nfev=60,
            ).x  # fmt: skip
            return whole(y)

        with suppress(ValueError):  # of SciPy, where all about a place has no value
            found = solve(x, np.full(len(x), True))
            free = np.abs(found - np.round(found)) > _AT_END
            if not self._search.reached and not free.all():
                found = np.where(free, found, np.round(found))  # SciPy stays within the limits
                rest(found if not free.any() else solve(found, free))

    def simplex(self, x: Array) -> None:
        """The least value without constraints, by the simplex of Nelder and Mead."""
        steps = np.diag(np.where(x < 0.5, 0.1, -0.1))
        scipy.optimize.minimize(
            self._cost, x, method='Nelder-Mead', bounds=[(0.0, 1.0)] * len(x),
            options={'initial_simplex': np.vstack([x, x + steps]), 'xatol': _ENDED,
                     'fatol': 1e-13, 'maxfev': 300 * len(x)},
        )  # fmt: skip

    def smooth(self, x: Array) -> None:
        """The least value under constraints where all is smooth, by sequential programming."""
        aims, constraints = self._aims, []
        bounds = np.array(aims.bounds)
        for kind, k in (('eq', bounds[aims.equal]), ('ineq', bounds[~aims.equal])):
            if len(k):
                constraints.append({
                    'type': kind, 'fun': lambda x, k=k: -self._scaled(x)[k],
                    'jac': lambda x, k=k: -self._slopes(x)[k],
                })  # fmt: skip
        with suppress(ValueError):  # of SciPy, where all about a place has no value
            exact = self._search.trials.exact(self._whole(x), self._search.free) is not None
            scipy.optimize.minimize(
                self._cost, x, jac=self._cost_slopes, method='SLSQP', constraints=constraints,
                bounds=[(0.0, 1.0)] * len(x),
                options={'maxiter': 30, 'ftol': 1e-13 if exact else 1e-9},
            )  # fmt: skip

    def is_stationary(self, x: Array) -> bool:
        """True if exact slopes show an optimum: no way down that keeps what is at its limit.

        The slope of the cost is then opposite to a sum of those of constraints at their limits,
        with factors that are not negative (Karush, Kuhn and Tucker); at a corner it is not.
        """
        aims, trials = self._aims, self._search.trials
        if trials.exact(self._whole(x), self._search.free) is None or aims.targets:
            return False
        off, slopes, bounds = self._scaled(x), self._slopes(x), np.array(aims.bounds, int)
        equal, others = bounds[aims.equal], bounds[~aims.equal]
        edge = np.eye(len(x))
        active = [slopes[others[off[others] > -_ACTIVE]], slopes[equal], -slopes[equal],
                  -edge[x < _ACTIVE], edge[x > 1.0 - _ACTIVE]]  # fmt: skip
        held, down = np.vstack(active).T, -self._cost_slopes(x)
        if held.size:  # nnls of SciPy ends the process where there are no columns
            factors = scipy.optimize.lsq_linear(held, down, (0.0, np.inf), method='bvls').x
            down = down - held @ factors
        return bool(np.linalg.norm(down) < _FLAT)

    def cornered(self, x: Array) -> None:
        """The least value under constraints by quadratic models of values alone."""
        bounds, low = self._aims.bounds, np.where(self._aims.equal, 0.0, -np.inf)
        scipy.optimize.minimize(
            self._cost, x, method='COBYQA', bounds=scipy.optimize.Bounds(0.0 * x, 0.0 * x + 1.0),
            constraints=scipy.optimize.NonlinearConstraint(
                lambda x: self._scaled(x)[bounds], low, 0.0
            ),
            options={'initial_tr_radius': 0.05, 'final_tr_radius': _ENDED, 'maxfev': 100 * len(x),
                     'scale': False},
        )  # fmt: skip


def optimum(trials: Trials, budget: Budget) -> Optimum:
    """Vary several numbers of a scene between their limits until measures are as wanted."""
    parameters, goals = trials.parameters, trials.goals
    evolved = round(1.5 * budget.evaluations**0.5) * (sum(g.is_extreme for g in goals) > 1)
    places = trials.spread(max(budget.samples, evolved))
    figures = trials.start(places)
    limits = [goal.value(unit) for goal, unit in zip(goals, trials.units, strict=True)]
    aims = Aims(goals, np.array([x or 0.0 for x in limits]), figures)
    front: list[int] = []
    if len(aims.extremes) > 1:
        count = 0 if trials.whole else max(1, budget.evaluations // len(places) - 1)
        places, figures = evolve(
            lambda x: (f := trials.at(x), aims.costs(f), aims.excess(f)), places, count
        )
        costs = aims.costs(figures)
        front = undominated(costs, aims.excess(figures))
    search = _Search(trials, aims, places, figures)
    if front:
        low, high = costs[front].min(axis=0), costs[front].max(axis=0)
        near = (((costs[front] - low) / np.where(high > low, high - low, 1.0)) ** 2).sum(axis=1)
        search.keep(places, figures, front[int(np.argmin(near))])
    elif not trials.whole:
        search.run(places, figures, budget)
    names = [goal.name for goal in goals]

    def design(place: Array, x: Array) -> FoundDesign:
        return FoundDesign(trials.values(place), dict(zip(names, x.tolist(), strict=True)))

    best, off = design(search.place, search.figures[0]), aims.scaled(search.figures[0])
    over = np.where(aims.equal, np.abs(off[aims.bounds]), off[aims.bounds])
    held = tuple(
        Held(goals[k].text, float(search.figures[0, k]), float(limits[k] or 0.0), trials.units[k],
             bool(o <= 2.0 * HELD), bool(abs(o) < 1e-6))
        for k, o in zip(aims.bounds, over, strict=True)
    )  # fmt: skip
    aimed = [*aims.targets, *aims.extremes]
    return Optimum(
        parameters, goals, best.values,
        {names[k]: best.measures[names[k]] for k in aimed},
        {names[k]: trials.units[k] for k in aimed},
        {names[k]: limits[k] for k in aimed},
        held, search.reached, trials.evaluations, trials.gradients, trials.refused,
        tuple(trials.failed),
        tuple(design(places[k], figures[k]) for k in front), trials.columns(),
    )  # fmt: skip
