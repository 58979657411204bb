"""Samples of a run as files, written while it runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Self

import numpy as np

from mechanism_sim import output, tables
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.results.run import Piece

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq


def check_output(file: str, option: str = '--output') -> None:
    """Refuse what cannot be written before anything is computed."""
    tables.check_file(option, file)


def check_rate(rate: float | None) -> float:
    """The rate of samples [Hz], refused unless it is positive."""
    if rate is None or not 0.0 < rate < math.inf:
        raise InputError('--output needs a positive --sample-rate in Hz')
    return rate


def write(
    file: str, columns: Mapping[str, Array], units: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Write columns (N,) of equal length as one table, see `check_output`.

    Parameters
    ----------
    units : SI units by name, which go into the file where its format has a place for them
    """
    table, complete = _Table(Path(file), units), False
    try:
        table.write(dict(columns))
        complete = True
    finally:
        table.close(complete)


class Writer:
    """Writes the pieces of a run, sampled at an even rate.

    Columns are those of `Solution.sample`. CSV and Parquet are written as the run goes on, others
    at the end: they need all samples in memory. The file gets its name when it is complete; a run
    that fails leaves none.

    Parameters
    ----------
    file : to write, see `check_output`
    rate : [Hz]
    """

    def __init__(self, file: str, rate: float) -> None:
        self._units: dict[str, str] = {}
        self._table, self._rate = _Table(Path(file), self._units), rate
        self._piece: Piece | None = None
        self._count = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        complete = False
        try:
            if kind is None and self._piece:
                end = self._piece.motion.curve.end
                last = int(np.floor(end * self._rate * (1.0 + 1e-12)))
                self._write(self._piece, np.minimum(self._times(last + 1), end))
            complete = kind is None
        finally:
            self._table.close(complete)

    def add(self, piece: Piece) -> None:
        """Write the piece before, up to where this one begins: there this one's values hold."""
        if not len(piece.motion):
            return
        begin = float(piece.motion.curve.start[0])
        if self._piece:
            times = self._times(int(np.ceil(begin * self._rate)) + 1)
            self._write(self._piece, times[times < begin])
        else:
            self._count = int(np.ceil(begin * self._rate))
        self._piece = piece

    def _times(self, before: int) -> Array:
        return np.arange(self._count, before) / self._rate

    def _write(self, piece: Piece, t: Array) -> None:
        if t.size:
            self._count += len(t)
            columns = piece.sample(t)
            self._units.update(columns.units)
            self._table.write(dict(columns))


class _Table:
    """A table under another name until it is complete."""

    def __init__(self, file: Path, units: Mapping[str, str]) -> None:
        self._file = file
        self._place = output.beside(file)
        part = self._place.__enter__()
        with output.errors_as_sentences(file):
            self._sink = _SINKS.get(file.suffix, _Whole)(part, units)

    def write(self, columns: dict[str, Array]) -> None:
        with output.errors_as_sentences(self._file):
            self._sink.write(columns)

    def close(self, complete: bool) -> None:
        failed: BaseException | None = None if complete else RunError('it is not complete')
        try:
            with output.errors_as_sentences(self._file):
                self._sink.close()
        except BaseException as error:
            failed = error
            raise
        finally:
            self._place.__exit__(type(failed) if failed else None, failed, None)


class _Whole:
    """Formats that are written at the end."""

    def __init__(self, path: Path, units: Mapping[str, str]) -> None:
        self._path, self._units = path, units
        self._parts: list[dict[str, Array]] = []

    def write(self, columns: dict[str, Array]) -> None:
        self._parts.append(columns)

    def close(self) -> None:
        names = self._parts[0] if self._parts else {}
        columns = [
            tables.Column(n, np.concatenate([p[n] for p in self._parts]), self._units.get(n, ''))
            for n in names
        ]
        tables.write_part(self._path, columns)


class _Csv:
    def __init__(self, path: Path, units: Mapping[str, str]) -> None:
        self._file, self._units = path.open('w', encoding='utf-8'), units

    def write(self, columns: dict[str, Array]) -> None:
        heads = [tables.Column(n, x, self._units.get(n, '')).heading for n, x in columns.items()]
        names = ','.join(map(tables.text_cell, heads)) if self._file.tell() == 0 else ''
        rows = np.column_stack(list(columns.values()))
        np.savetxt(self._file, rows, '%.17g', ',', header=names, comments='')

    def close(self) -> None:
        self._file.close()


class _Parquet:
    """Gathers rows to groups that are worth their overhead."""

    def __init__(self, path: Path, units: Mapping[str, str]) -> None:
        import pyarrow as pa  # noqa: PLC0415
        import pyarrow.parquet as pq  # noqa: PLC0415

        self._pa, self._pq = pa, pq
        self._path, self._units = path, units
        self._parts: list[pa.Table] = []
        self._rows = 0
        self._writer: pq.ParquetWriter | None = None

    def write(self, columns: dict[str, Array]) -> None:
        fields = [
            self._pa.field(n, self._pa.float64(), metadata={'unit': u} if u else None)
            for n, u in ((name, self._units.get(name, '')) for name in columns)
        ]
        self._parts.append(self._pa.table(columns, schema=self._pa.schema(fields)))
        self._rows += len(columns['t'])
        if self._rows >= _ROW_GROUP:
            self._flush()

    def _flush(self) -> None:
        table = self._pa.concat_tables(self._parts)
        if self._writer is None:
            self._writer = self._pq.ParquetWriter(self._path, table.schema)
        self._writer.write_table(table)
        self._parts, self._rows = [], 0

    def close(self) -> None:
        if self._parts:
            self._flush()
        if self._writer:
            self._writer.close()


_SINKS: dict[str, Callable[[Path, Mapping[str, str]], _Whole | _Csv | _Parquet]] = {
    '.csv': _Csv,
    '.parquet': _Parquet,
}
_ROW_GROUP = 1 << 16
