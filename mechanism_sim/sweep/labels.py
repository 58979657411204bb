"""The swept values of runs, as columns of a table."""

from __future__ import annotations

from typing import Any

import pyarrow as pa

from mechanism_sim.sweep.plan import Plan

_TYPES = {float: pa.float64(), int: pa.int64(), str: pa.string(), bool: pa.bool_()}


def column(name: str, kind: Any, unit: str = '', meaning: str = '') -> Any:
    """A field of a table, with its unit and what it means as metadata."""
    about = {k: v for k, v in (('unit', unit), ('meaning', meaning)) if v}
    return pa.field(name, kind, metadata=about or None)


def label_columns(plan: Plan) -> list[tuple[Any, list[Any]]]:
    """The columns ``run`` and those of the swept values: fields, and a value for each run."""
    columns: list[tuple[Any, list[Any]]] = [
        (column('run', pa.int64()), [run.index for run in plan.runs])
    ]
    for name in plan.columns:
        values = [run.values[name] for run in plan.runs]
        kinds = {type(v) for v in values if v is not None}
        if len(kinds) != 1:  # several, or none
            kinds, values = {str}, [None if v is None else str(v) for v in values]
        unit = 'SI' if kinds == {float} else ''
        columns.append((column(name, _TYPES[kinds.pop()], unit), values))
    return columns
