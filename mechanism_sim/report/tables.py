"""Samples of a solution as files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.solution import Solution

SUFFIXES = ('.npz', '.csv', '.parquet')


def check_output(file: str, rate: float | None) -> None:
    """Refuse what cannot be written before anything is computed.

    Raises
    ------
    InputError
    """
    path = Path(file)
    if path.suffix not in SUFFIXES:
        raise InputError(f'--output {file}: the ending must be one of {", ".join(SUFFIXES)}')
    if rate is None or rate <= 0.0:
        raise InputError('--output needs a positive --sample-rate in Hz')
    if not path.resolve().parent.is_dir():
        raise InputError(f"--output {file}: there is no directory '{path.parent}'")
    if path.exists():
        raise InputError(f'--output {file}: exists already, not overwriting')


def write(solution: Solution, file: str, rate: float) -> None:
    """Write the solution sampled at `rate` [Hz]; columns as `Solution.sample` names them."""
    count = int(np.floor(solution.duration * rate * (1.0 + 1e-12))) + 1
    columns = solution.sample(np.minimum(np.arange(count) / rate, solution.duration))
    suffix = Path(file).suffix
    if suffix == '.npz':
        np.savez(file, **dict(columns))  # type: ignore[arg-type]
    elif suffix == '.csv':
        rows = np.column_stack(list(columns.values()))
        np.savetxt(file, rows, '%.17g', ',', header=','.join(columns), comments='')
    else:
        import pyarrow as pa  # noqa: PLC0415
        import pyarrow.parquet as pq  # noqa: PLC0415

        pq.write_table(pa.table(dict(columns)), file)
