"""Effects of swept values on figures: main effects, indices of Sobol, shares beyond a limit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any
from warnings import catch_warnings, filterwarnings

import numpy as np
import scipy
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.studies.design import INDICES, SIGMAS
from mechanism_sim.studies.plan import REPEAT, SweepPlan
from mechanism_sim.studies.runs import Row

_CLASSES = 8  # into which the values of a factor are put, at most
_LEAST = 5  # runs of a class


@dataclass(frozen=True)
class FactorLevel:
    """A value of a factor, or a class of values: `x` in SI units, or a text."""

    x: float | str
    mean: float
    error: float  #: standard error of the mean
    runs: int


@dataclass(frozen=True)
class Effect:
    """Effect of one factor on one measure, in the mean over all others."""

    factor: str
    measure: str
    levels: tuple[FactorLevel, ...]  #: the main effect: means at values of the factor
    effect: float  #: greatest less least of these means
    #: of the variance that the factor explains by itself: epsilon squared, the correlation ratio
    #: without what classes of so few runs explain by chance (Kelley 1935)
    share: float
    #: an effect that drawn runs exceed by chance in 5 % of designs where there is none (Tukey's
    #: range of means); None where the others have the same values in all classes, and where
    #: indices have intervals
    chance: float | None = None
    #: indices of Sobol and their 95 % intervals, of a design for them only
    first: tuple[float, float, float] | None = None
    total: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Exceedance:
    """Share of runs that exceed limits, with its 95 % interval (Clopper and Pearson)."""

    measure: str
    #: the lower and the upper limit, None if there is none
    least: float | None
    limit: float | None
    runs: int  #: number of independently drawn runs with a figure
    beyond: int
    share: float
    low: float
    high: float
    #: Cpk, how many times three standard deviations fit between the mean and the nearer limit;
    #: None if runs do not differ
    capability: float | None


def measures_of(plan: SweepPlan) -> list[str]:
    """The figures for effects: the measures, or those of a row without any."""
    return plan.measure_names or ['impulse', 'impacts', 'I_n']


def effects(plan: SweepPlan, rows: Sequence[Row]) -> list[Effect]:
    """The effect of every swept value on every measure; none of what never varies, or repeats."""
    found = []
    for measure in measures_of(plan):
        y = np.array([number(row, measure) for row in rows])
        indices = _indices(plan, y)
        for factor in (c for c in plan.columns if c != REPEAT):
            x = np.array([run.values[factor] for run in plan.runs], object)
            levels = _levels(x, y)
            if len(levels) < 2:
                continue
            means = [level.mean for level in levels]
            spread = max(means) - min(means)
            drawn = plan.design is not None and plan.design.kind != INDICES  # else rows repeat
            chance = _chance(levels, y) if drawn else None
            found.append(
                Effect(
                    factor, measure, tuple(levels), spread, _share(levels, y), chance,
                    *indices.get(factor, (None, None)),
                )
            )  # fmt: skip
    return found


_ALIKE = 1e-12  # times the largest value: runs that differ by less do not differ


def exceedances(plan: SweepPlan, rows: Sequence[Row]) -> list[Exceedance]:
    """Shares of the runs that exceed the limits, of each measure of the sweep."""
    found, independent = [], _independent(plan)
    for name, (least, limit) in plan.limits.items():
        y = np.array([number(row, name) for row in rows])[independent]
        y = y[np.isfinite(y)]
        if not len(y):
            continue
        beyond = int(((y < least) | (y > limit)).sum())
        room, spread = min(limit - y.mean(), y.mean() - least), y.std(ddof=1) if len(y) > 1 else 0
        interval = scipy.stats.binomtest(beyond, len(y)).proportion_ci()
        found.append(
            Exceedance(
                name, least if math.isfinite(least) else None,
                limit if math.isfinite(limit) else None, len(y), beyond, beyond / len(y),
                float(interval.low), float(interval.high),
                float(room / (SIGMAS * spread)) if spread > _ALIKE * np.abs(y).max() else None,
            )
        )  # fmt: skip
    return found


def _independent(plan: SweepPlan) -> NDArray[np.bool_]:
    """Runs (N,) whose values are drawn independently.

    Of a design for indices these are the points A and B: every other is A with one value of B, and
    counting it as a run of its own would make intervals too narrow by up to the root of half the
    number of pages.
    """
    k = np.arange(len(plan.runs))
    if plan.design is None or plan.design.kind != INDICES:
        return np.full(len(k), True)
    n, d = plan.design.samples, len(plan.factors)
    repeat = 1 + max(int(run.values.get(REPEAT) or 0) for run in plan.runs)
    # points follow each other within lists and grids, and each is repeated in its place
    return np.asarray(k // repeat % (n * (d + 2)) < 2 * n)


def number(row: Row, name: str) -> float:
    """A figure of a row; not a number where there is none."""
    value = row.get(name)
    return float(value) if isinstance(value, int | float) else math.nan


def _levels(x: NDArray[Any], y: Array) -> list[FactorLevel]:
    """Means of figures at each value, or in classes of equally many runs."""
    known = np.isfinite(y)
    x, y = x[known], y[known]
    values = list(dict.fromkeys(x.tolist()))
    numbers = all(isinstance(v, int | float) for v in values)
    if len(values) <= _CLASSES or not numbers:
        groups = [(v, np.flatnonzero([w == v for w in x])) for v in values]
        if numbers:
            groups.sort(key=lambda group: float(group[0]))
    else:
        count = max(2, min(_CLASSES, len(y) // _LEAST))
        order = np.argsort(x.astype(float), kind='stable')
        groups = [
            (float(x[part].astype(float).mean()), part) for part in np.array_split(order, count)
        ]
    levels = []
    for value, rows in groups:
        n = len(rows)
        error = float(y[rows].std(ddof=1) / math.sqrt(n)) if n > 1 else math.nan
        levels.append(FactorLevel(value, float(y[rows].mean()), error, n))
    return levels


def _share(levels: Sequence[FactorLevel], y: Array) -> float:
    """Epsilon squared: explained variance without what chance explains."""
    total, within = _variation(levels, y)
    n = int(np.isfinite(y).sum())
    return max(0.0, 1.0 - within * (n - 1) / total) if total else math.nan


def _variation(levels: Sequence[FactorLevel], y: Array) -> tuple[float, float]:
    """Sum of squares of figures about their mean, and variance within classes."""
    y = y[np.isfinite(y)]
    total = float(((y - y.mean()) ** 2).sum())
    if not total or len(y) <= len(levels):
        return 0.0, math.nan
    between = sum(level.runs * (level.mean - float(y.mean())) ** 2 for level in levels)
    return total, max(total - between, 0.0) / (len(y) - len(levels))


def _chance(levels: Sequence[FactorLevel], y: Array) -> float:
    """The largest range of means of classes in 95 % of designs of a factor without effect."""
    runs = [level.runs for level in levels]
    within, free = _variation(levels, y)[1], sum(runs) - len(runs)
    if not math.isfinite(within):
        return math.nan
    # classes of unequal size by the mean of their inverses (Kramer 1956)
    return _range(len(runs), free) * math.sqrt(within * float(np.mean(1.0 / np.array(runs))))


@lru_cache
def _range(classes: int, free: int) -> float:
    """Upper 5 % point of Tukey's range of a number of means, over their deviation."""
    return float(scipy.stats.studentized_range.ppf(0.95, classes, free))


def _indices(plan: SweepPlan, y: Array) -> dict[str, Any]:
    """First and total indices with their intervals, by factor."""
    if plan.design is None or plan.design.kind != INDICES or not np.isfinite(y).all():
        return {}
    n, d = plan.design.samples, len(plan.factors)
    if len(y) != n * (d + 2) or not y.std():
        return {}
    pages = y.reshape(d + 2, 1, n)
    func = {'f_A': pages[0], 'f_B': pages[1], 'f_AB': pages[2:]}
    found = scipy.stats.sobol_indices(func=func, n=n)
    with catch_warnings():
        # an index that is the same in all resamples has no interval
        for kind in (RuntimeWarning, scipy.stats.DegenerateDataWarning):
            filterwarnings('ignore', category=kind)
        spread = found.bootstrap(confidence_level=0.95, n_resamples=999)
    return {
        factor.path: tuple(
            (
                float(index.ravel()[i]),
                float(interval.confidence_interval.low.ravel()[i]),
                float(interval.confidence_interval.high.ravel()[i]),
            )
            for index, interval in (
                (found.first_order, spread.first_order),
                (found.total_order, spread.total_order),
            )
        )
        for i, factor in enumerate(plan.factors)
    }
