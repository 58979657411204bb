"""Tolerances to first order: one run with derivatives instead of a design of runs.

The variance of a measure is the sum of (slope times deviation) squared (RSS), its worst case the
sum of |slope| times the largest departure. Both are right as long as measures are straight over
the tolerances: runs at both ends of each factor and in the worst corners say if they are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import rebuilt
from mechanism_sim.studies.design import SIGMAS
from mechanism_sim.studies.effects import Effect, FactorLevel, number
from mechanism_sim.studies.plan import SweepPlan
from mechanism_sim.studies.row import SweepTask
from mechanism_sim.studies.runs import DONE, FinishedRows, Row, Show, Workers

BENT = 0.1
"""Relative deviation of a measure from a straight line beyond which first order fails."""
_TAIL = 0.00135  # share of a normal distribution beyond three deviations


@dataclass(frozen=True)
class Contribution:
    """Effect of a factor on a measure, in SI units."""

    factor: str
    slope: float  #: derivative of the measure by the factor
    deviation: float  #: standard deviation of the measure by this factor alone
    share: float  #: share of the measure's variance
    #: changes of the measure in full runs with the factor at its lower and upper end
    low: float
    high: float
    bent: float  #: largest departure of both from the slope


@dataclass(frozen=True)
class ToleranceStack:
    """A measure and its tolerance."""

    measure: str
    unit: str
    nominal: float  #: value with all factors at their means
    deviation: float  #: standard deviation to first order, of independent factors
    #: lowest and highest value if all factors are at their ends, to first order
    worst: tuple[float, float]
    corners: tuple[float, float]  #: the same as full runs have it
    contributions: tuple[Contribution, ...]
    bent: float  #: largest departure of a full run from first order, over three deviations

    @property
    def enough(self) -> bool:
        """True if the measure is straight over the tolerances."""
        return self.bent < BENT


@dataclass(frozen=True)
class FirstOrder:
    """Tolerances of all measures, and the number of their runs."""

    stacks: tuple[ToleranceStack, ...]
    runs: int
    plan: SweepPlan  #: plan with the nominal run only

    @property
    def rows(self) -> list[Row]:
        """Rows of the nominal run."""
        return [{s.measure: s.nominal for s in self.stacks} | {'status': DONE}]

    @property
    def effects(self) -> list[Effect]:
        """Effects of each factor from its lower to its upper end, as full runs have them."""
        found = []
        for s in self.stacks:
            for c, f in zip(s.contributions, self.plan.factors, strict=True):
                ends = zip(_ends(f.distribution), (c.low, c.high), strict=True)
                levels = tuple(FactorLevel(x, s.nominal + y, 0.0, 1) for x, y in ends)
                found.append(Effect(c.factor, s.measure, levels, abs(c.high - c.low), c.share))
        return found


def first_order(
    plan: SweepPlan, workers: Workers | None = None, show: Show | None = None
) -> FirstOrder:
    """Tolerances of the measures of a sweep whose factors are those of `vary`."""
    paths = [f.path for f in plan.factors]
    if not paths or list(plan.columns) != paths or plan.windows:
        raise InputError(
            f"{plan.name}: --first-order is of the tolerances in 'vary': without 'grid', 'runs', "
            "'repeat' and 'windows'"
        )
    if not plan.measures:
        raise InputError(f"{plan.name}: --first-order needs 'measures', or --measure")
    means = [float(f.distribution.mean()) for f in plan.factors]
    ends = np.array([_ends(f.distribution) for f in plan.factors])
    run = _run(plan, means)
    edges, skipped = plan.extent.edges(run)
    solution = simulate(run, duration=edges[-1], derivatives=paths)
    window = float(edges[skipped]), math.inf
    found = [solution.derivatives[p].measures(*plan.measures, window=window) for p in paths]
    names = plan.measure_names
    slopes = np.array([[one[n] for one in found] for n in names])
    if not np.isfinite(slopes).all():
        limits = [str(x) for p in paths for x in solution.derivatives[p].limits if x.ends]
        raise InputError(
            f'{plan.name}: a measure has no derivative by a factor'
            + (f' ({limits[0]})' if limits else '')
            + ': leave out --first-order'
        )
    around = [list(means)]  # then at both ends of each factor
    for k, pair in enumerate(ends.tolist()):
        around += [[*means[:k], x, *means[k + 1 :]] for x in pair]
    rows = FinishedRows()
    with workers or Workers(1) as makers:
        values = _measured(plan, around, makers, rows, show)
        for k in range(len(paths)):
            # turns of another drive end at other instants, of which derivatives at fixed times
            # know nothing: the runs at both ends do
            low, high = 1 + 2 * k, 2 + 2 * k
            others = plan.extent.edges(_run(plan, around[high]))[0]
            if not np.allclose(others, edges, rtol=1e-9, atol=0.0):
                slopes[:, k] = (values[:, high] - values[:, low]) / (ends[k, 1] - ends[k, 0])
        worst = [
            np.where(rises == high, ends[:, 1], ends[:, 0]).tolist()
            for rises in slopes > 0.0
            for high in (0, 1)
        ]
        corners = _measured(plan, worst, makers, rows, show).reshape(len(names), len(names), 2)
    deviations = np.array([float(f.distribution.std()) for f in plan.factors])
    units = {c.name: c.unit for c in plan.measured}
    stacks = [
        _stack(n, units.get(n, ''), paths, slope, deviations, ends - np.array(means)[:, None],
               y, corners[k, k])
        for k, (n, slope, y) in enumerate(zip(names, slopes, values, strict=True))
    ]  # fmt: skip
    nominal = replace(plan.runs[0], scene=run.scene, values=dict(zip(paths, means, strict=True)))
    return FirstOrder(tuple(stacks), 1 + len(rows.rows), replace(plan, runs=(nominal,)))


def _measured(
    plan: SweepPlan,
    places: Sequence[Sequence[float]],
    makers: Workers,
    rows: FinishedRows,
    show: Show | None,
) -> Array:
    """Measures (M, P) of runs with values of the factors at P places; runs already made count."""
    names, tasks = plan.measure_names, dict[str, SweepTask]()
    for place in places:
        run = _run(plan, place)
        tasks[str(place)] = SweepTask(
            str(place), run.name, run.scene, plan.extent, None, (), plan.measures, frozenset(names)
        )
    makers.do_all([*tasks.values()], show, rows)
    return np.array([[number(rows.rows[str(p)], name) for p in places] for name in names])


def _stack(
    name: str,
    unit: str,
    paths: Sequence[str],
    slopes: Array,
    deviations: Array,
    departures: Array,
    values: Array,
    corners: Array,
) -> ToleranceStack:
    """A measure by its derivatives, and its `values`: nominal, then low and high by factor."""
    nominal, own = float(values[0]), np.abs(slopes * deviations)
    total = float(np.sqrt((own**2).sum()))
    changes = values[1:].reshape(-1, 2) - nominal
    straight = slopes[:, None] * departures
    bent = np.abs(changes - straight).max(axis=1)
    worst = nominal + straight.min(axis=1).sum(), nominal + straight.max(axis=1).sum()
    off = max(float(bent.max()), float(np.abs(corners - np.array(worst)).max()))
    scale = SIGMAS * total
    rounding = 1e-9 * max(abs(nominal), float(np.abs(values).max()))
    parts = [
        Contribution(path, float(s), float(d), float(d / total) ** 2 if total else 0.0,
                     float(low), float(high), float(b))
        for path, s, d, (low, high), b in zip(paths, slopes, own, changes, bent, strict=True)
    ]  # fmt: skip
    return ToleranceStack(
        name, unit, nominal, total, (float(worst[0]), float(worst[1])),
        (float(corners[0]), float(corners[1])), tuple(parts),
        off / scale if scale > rounding else (math.inf if off > rounding else 0.0),
    )  # fmt: skip


def _ends(distribution: Any) -> tuple[float, float]:
    """The ends of a distribution, three deviations of a normal one."""
    low, high = distribution.support()
    if math.isfinite(low) and math.isfinite(high):
        return float(low), float(high)
    low, high = distribution.ppf([_TAIL, 1.0 - _TAIL])
    return float(low), float(high)


def _run(plan: SweepPlan, values: Sequence[float]) -> Machine:
    """The machine with these values of the factors."""
    one = plan.runs[0]
    given = dict(zip((f.path for f in plan.factors), values, strict=True))
    return rebuilt(one.name, one.scene.to_document(), given)
