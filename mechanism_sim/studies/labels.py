"""The swept values of runs, as columns of a table."""

from __future__ import annotations

from typing import Any

from mechanism_sim.studies.plan import Plan
from mechanism_sim.tables import Column


def label_columns(plan: Plan) -> list[Column]:
    """The columns ``run`` and those of the swept values, a value for each run.

    The unit of a number that is written without one is ``SI``.
    """
    columns = [Column('run', [run.index for run in plan.runs])]
    for name in plan.columns:
        values: list[Any] = [run.values[name] for run in plan.runs]
        kinds = {type(v) for v in values if v is not None}
        if len(kinds) != 1:  # several, or none
            kinds, values = {str}, [None if v is None else str(v) for v in values]
        unit = plan.units.get(name, 'SI') if kinds == {float} else ''
        columns.append(Column(name, values, unit))
    return columns
