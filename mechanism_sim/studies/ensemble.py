"""Many runs of one scene that differ in values: a table of parameters in, one of figures out."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mechanism_sim.arguments import check_options, listed, public
from mechanism_sim.errors import InputError, check_known
from mechanism_sim.results.run import Solution
from mechanism_sim.scene import Source
from mechanism_sim.studies.plan import SweepPlan, measure_name, read_plan
from mechanism_sim.studies.row import SOLUTION, SweepTask
from mechanism_sim.studies.runs import FinishedRows, Row, Show, Workers
from mechanism_sim.tables import Table
from mechanism_sim.units import parted

_HEADING = re.compile(r'(.+?)\s*\[([^\[\]]+)\]$')
_ALWAYS = 'run', 'status'
_EMPTY = 'ensemble: parameters: the table has no rows'
_TWICE = "ensemble: parameters: there are two columns of '{}': keep one"


class Ensemble(Table):
    """A table of runs.

    Attributes
    ----------
    solutions : solutions of the runs in order, if kept; None for a failed one
    """

    solutions: Sequence[Solution | None] = ()


@public
def ensemble(
    scene: Source,
    parameters: Any,
    revolutions: int | None = None,
    duration: float | str | None = None,
    *,
    skip: float | str = 0,
    measures: str | Sequence[str] = (),
    columns: str | Sequence[str] | None = None,
    keep: bool = False,
    **how: Any,
) -> Ensemble:
    """Run a scene once for every row of a table of its values; a row of figures for each.

    Names, units and figures are those of `sweep`. A run that fails has a row that is empty but for
    ``status``.

    >>> import mechanism_sim as ms
    >>> found = ms.ensemble('slider_crank', {'drive.speed [rpm]': [60, 120]}, revolutions=1,
    ...                     measures=['top = highest(velocity.piston)'])
    >>> round(float(found['top'][1] / found['top'][0]), 9)
    2.0

    Parameters
    ----------
    scene : all that `load_scene` takes
    parameters : values by dotted path, a row for each run: a dictionary of columns, a list of
        dictionaries, a data frame or a structured array. Numbers are in SI units, or in that
        behind the name, as ``'drive.speed [rpm]'``; texts have units. The path ``title`` labels
        rows
    revolutions : revolutions of the crank in every run, or
    duration : [s], or with its unit
    skip : revolutions, or a time, of which no figures are made
    measures : ``NAME = TEXT`` or ``TEXT``
    columns : requested figures; default: all of a sweep; others are not computed
    keep : True if ``solutions`` of the table are the whole runs, polynomials and events; by one
        worker only
    how : ``workers``, processes: one by default, or None for one for each core, in a script only
        below ``if __name__ == '__main__':``; ``dask``, address of a scheduler, whose workers run
        it instead; ``show``, called with the number of finished runs, and of those that failed
    """
    how = check_options(ensemble, how, _done)
    if keep and (how.get('workers', 1) != 1 or how.get('dask')):
        raise InputError('ensemble: keep: whole runs stay in this process: give workers=1')
    length = {'revolutions': revolutions, 'duration': duration}
    given: dict[str, Any] = {k: v for k, v in length.items() if v is not None}
    given |= {'runs': _rows(parameters), 'skip': skip}
    plan = read_plan(given, measures, scene=scene, called='ensemble')
    wanted = _wanted(plan, columns)
    tasks = {
        run.key: SweepTask(
            run.key,
            run.name,
            run.scene,
            plan.extent,
            measures=tuple(m for m in run.measures if wanted is None or measure_name(m) in wanted),
            wanted=wanted,
            keep=keep,
            refused=run.refused,
        )
        for run in plan.runs
    }
    rows = _done([*tasks.values()], **how)
    ordered = [rows[run.key] for run in plan.runs]
    plan.warn(ordered)
    known = plan.table(ordered)
    if wanted is not None:
        labels = {*_ALWAYS, *plan.columns}
        known = [c for c in known if c.name in wanted or c.name in labels]
    table = Ensemble.of(known)
    if keep:
        table.solutions = [row.get(SOLUTION) for row in ordered]
    return table


def _done(
    tasks: Sequence[SweepTask],
    workers: int | None = 1,
    dask: str | None = None,
    show: Show | None = None,
) -> dict[str, Row]:
    """Rows by the keys of their tasks."""
    with Workers(workers, dask) as makers:
        return makers.do(tasks, FinishedRows(), show)


def _wanted(plan: SweepPlan, columns: str | Sequence[str] | None) -> frozenset[str] | None:
    """Columns to be computed: the requested ones and measures; all if None."""
    if columns is None:
        return None
    columns, labels = listed(columns, 'columns'), {*_ALWAYS, *plan.columns}
    known = [c.name for c in plan.table([]) if c.name not in labels]
    for name in columns:
        check_known(name, known, f"ensemble: columns: there is no '{name}'", 'columns:')
    return frozenset([*columns, *plan.measure_names])


def _rows(parameters: Any) -> list[dict[str, Any]]:
    """Overrides of each run, from any kind of table."""
    columns = parameters
    if names := getattr(getattr(parameters, 'dtype', None), 'names', None):
        columns = {name: parameters[name] for name in names}
    elif not isinstance(parameters, Mapping) and hasattr(parameters, 'columns'):  # a data frame
        names = [str(name) for name in parameters.columns]
        if twice := next((name for name in names if names.count(name) > 1), ''):
            raise InputError(_TWICE.format(twice))
        columns = {name: parameters[name].to_list() for name in parameters.columns}
        if not columns:
            raise InputError(_EMPTY)
    if isinstance(columns, Mapping):
        rows = _by_rows(columns)
    elif isinstance(columns, Iterable) and not isinstance(columns, str):
        rows = [*columns]
    else:
        rows = [columns]
    if not rows:
        raise InputError(_EMPTY)
    for k, row in enumerate(rows):
        if not isinstance(row, Mapping):
            raise InputError(
                f'ensemble: parameters: row {k} is {row!r}, not values by dotted path: give a '
                'dictionary of columns, a list of dictionaries, or a data frame'
            )
    return [_overrides(row) for row in rows]


def _overrides(row: Mapping[str, Any]) -> dict[str, Any]:
    """Values of a run by path; refused if there are two of one."""
    found: dict[str, Any] = {}
    for name, x in row.items():
        path, value = _value(str(name), x)
        if path in found:
            raise InputError(_TWICE.format(path))
        found[path] = value
    return found


def _by_rows(columns: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of columns; a single value holds in all of them."""
    several = {
        name: list(x)
        for name, x in columns.items()  # a text is one value, and so is an array without axes
        if hasattr(x, '__len__') and getattr(x, 'ndim', 1) > 0 and not isinstance(x, str | Mapping)
    }
    sizes = {name: len(x) for name, x in several.items()}
    if len({*sizes.values()}) > 1:
        said = ', '.join(f'{name} has {n}' for name, n in sizes.items())
        raise InputError(f'ensemble: parameters: columns must be of equal length, but {said}')
    count = next(iter(sizes.values()), 1)
    every = {name: several.get(name, [x] * count) for name, x in columns.items()}
    return [{name: x[k] for name, x in every.items()} for k in range(count)]


def _value(name: str, x: Any) -> tuple[str, Any]:
    """Path and value of a cell; the unit in a heading goes with its numbers."""
    plain = x.item() if isinstance(x, np.generic) else x
    found = _HEADING.match(name)
    if found is None:
        return name, plain
    if isinstance(plain, float) and math.isnan(plain):  # as data frames have it
        raise InputError(f"ensemble: parameters: a cell of '{name}' is empty")
    path, unit = found.groups()
    if isinstance(plain, int | float) and not isinstance(plain, bool):
        plain = repr(plain)
    # numbers may be texts, as in rows of `csv.DictReader`
    bare = isinstance(plain, str) and (parted(plain) or ('', plain))[1] == ''
    return path, f'{plain} {unit}' if bare else plain
