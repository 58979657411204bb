"""Tables in files: the ending says the format, and every column has its unit and its meaning.

Files of other programs are read, too: sheets as they are, of .mat, .npz and .parquet the longest
vectors.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from mechanism_sim import output
from mechanism_sim.errors import InputError, check_known, nearest, quoted
from mechanism_sim.packages import needed, spared
from mechanism_sim.terminal import print_notice
from mechanism_sim.units import durations

ENDINGS = '.parquet', '.csv', '.xlsx', '.mat', '.npz'

_NEEDS = {'.parquet': 'pyarrow', '.xlsx': 'openpyxl'}
_WIDEST, _MOST_ROWS = 40, 1_048_575  # of a sheet, without its heading
_NAME_OF_MATLAB = 63  # characters
_WIDE = 10  # columns a row, from which on a matrix holds its signals in rows
_FORMULA = '=', '+', '-', '@', '\t', '\r'  # what a spreadsheet computes begins so
_QUANTITY = re.compile(r'[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?( [\w/^*%°· ]+)?$', re.IGNORECASE)
_SHOWN_NAMES = 300  # characters in a sentence
_SHOWN_COLUMNS, _SHOWN_ROWS = 12, 5  # in a notebook; rows at either end
_ROW_GROUP = 1 << 16  # of Parquet


class Column(NamedTuple):
    """A column: its values (N,), numbers or texts, None where there is none."""

    name: str
    values: Sequence[Any] | NDArray[Any]
    unit: str = ''
    meaning: str = ''

    @property
    def heading(self) -> str:
        """Name and unit, as people read them and as tables of scenes are read."""
        return f'{self.name} [{self.unit}]' if self.unit else self.name


class ColumnError(InputError, KeyError):
    """Error of a column that a table does not have."""

    def __str__(self) -> str:
        return str(self.args[0])  # a `KeyError` would quote the sentence


class Table(dict[str, NDArray[Any]]):
    """Columns (N,) by name, with their units, that notebooks show in a few lines.

    Attributes
    ----------
    units : SI units by name; empty for numbers
    """

    def __init__(
        self, columns: Mapping[str, NDArray[Any]], units: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(columns)
        self.units = dict(units or {})

    def __missing__(self, name: object) -> NDArray[Any]:
        shown = ', '.join([*self][:_SHOWN_COLUMNS])
        more = f' and {len(self) - _SHOWN_COLUMNS} more' if len(self) > _SHOWN_COLUMNS else ''
        raise ColumnError(
            f'there is no column {quoted(name)}{nearest(str(name), self)}; columns: '
            f'{shown or "none"}{more}'
        )

    @classmethod
    def of(cls, columns: Sequence[Column]) -> Self:
        """Columns as arrays: of whole numbers, of others, NaN where there is none, or of texts."""
        found: dict[str, NDArray[Any]] = {
            c.name: np.array(c.values, dtype=_type_of(c.values)) for c in columns
        }
        return cls(found, {c.name: c.unit for c in columns})

    def columns(self) -> list[Column]:
        """Columns of the table as they are written."""
        return [Column(name, x, self.units.get(name, '')) for name, x in self.items()]

    def __repr__(self) -> str:
        rows = len(next(iter(self.values()), ()))
        names = ', '.join(self._headings()[:_SHOWN_COLUMNS])
        more = ', ...' if len(self) > _SHOWN_COLUMNS else ''
        return f'<Table of {rows} rows and {len(self)} columns: {names}{more}>'

    def _headings(self) -> list[str]:
        return [f'{n} [{u}]' if (u := self.units.get(n)) else n for n in self]

    def _repr_html_(self) -> str:
        """The first and the last rows of the first columns."""
        names = list(self)[:_SHOWN_COLUMNS]
        rows = len(next(iter(self.values()), ()))
        kept = range(rows)
        if rows > 2 * _SHOWN_ROWS:
            kept = [*range(_SHOWN_ROWS), *range(rows - _SHOWN_ROWS, rows)]  # type: ignore[assignment]
        head = ''.join(f'<th>{escape(h)}</th>' for h in self._headings()[:_SHOWN_COLUMNS])
        lines = [f'<tr>{head}</tr>']
        for k, row in enumerate(kept):
            if k == _SHOWN_ROWS and rows > 2 * _SHOWN_ROWS:
                lines.append(f'<tr><td colspan="{len(names)}">...</td></tr>')
            cells = ''.join(f'<td>{escape(_short(self[n][row]))}</td>' for n in names)
            lines.append(f'<tr>{cells}</tr>')
        more = len(self) - len(names)
        note = f', {more} of them not shown' if more else ''
        return f'<table>{"".join(lines)}</table><p>{rows} rows, {len(self)} columns{note}</p>'

    def to_frame(self, library: str | None = None) -> Any:
        """A data frame of ``'pandas'`` or ``'polars'``; unless told of that which is installed."""
        makers = {'pandas': self.to_pandas, 'polars': self.to_polars}
        chosen = library or ('polars' if find_spec('pandas') is None else 'pandas')
        check_known(chosen, makers, f'library is {quoted(chosen)}', 'there are:')
        return makers[chosen]()

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`; its ``attrs['units']`` are the units."""
        frame = needed('pandas').DataFrame(dict(self))
        frame.attrs['units'] = dict(self.units)
        return frame

    def to_polars(self) -> Any:
        """A `polars.DataFrame`."""
        return needed('polars').DataFrame(dict(self))


class Tabular:
    """Results that show themselves by the table of their columns."""

    def columns(self) -> list[Column]:
        """Columns of the table."""
        raise NotImplementedError

    def table(self) -> Table:
        """The columns as arrays."""
        return Table.of(self.columns())

    def __repr__(self) -> str:
        return f'<{type(self).__name__}: {self.table()!r}>'

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()


def _type_of(values: Sequence[Any] | NDArray[Any]) -> type:
    """The type of a column in memory: as in files, whole numbers are such if all are."""
    if any(isinstance(value, str) for value in values):
        return object
    return int if len(values) and {type(value) for value in values} == {int} else float


def _short(value: Any) -> str:
    return f'{value:.6g}' if isinstance(value, float | np.floating) else str(value)


def default_ending() -> str:
    """Parquet where its library can be used, else CSV."""
    return '.parquet' if spared('pyarrow', 'tables are written as .csv') else '.csv'


def check_file(option: str, file: Path | str, *endings: str) -> Path:
    """A file for a table, checked before anything is computed: its ending, and what it takes."""
    path = output.check_path(option, file, *(endings or ENDINGS))
    if module := _NEEDS.get(path.suffix):
        needed(module, f'{option} {file}: write .csv, for {path.suffix}')
    return path


def write(file: Path, columns: Sequence[Column], about: dict[str, str] | None = None) -> None:
    """Write columns of equal length as one file, all at once.

    Parameters
    ----------
    about : texts that belong to the whole table
    """
    with opened(file, about) as write_rows:
        write_rows(columns)


@contextmanager
def opened(
    file: Path, about: dict[str, str] | None = None
) -> Iterator[Callable[[Sequence[Column]], None]]:
    """A table that grows: called with the next rows of the same columns, and its meaning `about`.

    CSV and Parquet are written as rows come; other formats are made at the end, of all of them in
    memory. The file gets its name when it is complete, see `output.beside`.
    """
    with output.beside(file) as part:
        sink = _SINKS[file.suffix](part, about or {})
        complete = False
        try:
            yield sink.write
            complete = True
        finally:
            sink.close(complete)


class _Csv:
    def __init__(self, path: Path, _: dict[str, str]) -> None:
        self._file = path.open('w', encoding='utf-8', newline='')
        self._writer = csv.writer(self._file)

    def write(self, columns: Sequence[Column]) -> None:
        if not self._file.tell():
            self._writer.writerow([_text_cell(c.heading) for c in columns])
        self._writer.writerows(zip(*(_text_cells(c.values) for c in columns), strict=True))

    def close(self, _: bool) -> None:
        self._file.close()


class _Parquet:
    """Gathers rows to groups that are worth their overhead."""

    def __init__(self, path: Path, about: dict[str, str]) -> None:
        self._path, self._about = path, about
        self._parts: list[Any] = []
        self._writer: Any = None

    def write(self, columns: Sequence[Column]) -> None:
        import pyarrow as pa  # noqa: PLC0415

        fields, arrays = [], []
        for c in columns:
            told = {k: v for k, v in (('unit', c.unit), ('meaning', c.meaning)) if v}
            array = pa.array(c.values, field_type(pa, c.values))
            fields.append(pa.field(c.name, array.type, metadata=told or None))
            arrays.append(array)
        self._parts.append(pa.table(arrays, schema=pa.schema(fields, self._about)))
        if sum(part.num_rows for part in self._parts) >= _ROW_GROUP:
            self._flush()

    def _flush(self) -> None:
        import pyarrow as pa  # noqa: PLC0415
        import pyarrow.parquet as pq  # noqa: PLC0415

        table = pa.concat_tables(self._parts)
        if self._writer is None:
            self._writer = pq.ParquetWriter(self._path, table.schema)
        self._writer.write_table(table)
        self._parts = []

    def close(self, complete: bool) -> None:
        if complete and self._parts:
            self._flush()
        if self._writer:
            self._writer.close()


class _Whole:
    """Formats that are made of all rows together."""

    def __init__(self, path: Path, about: dict[str, str]) -> None:
        self._path, self._about = path, about
        self._parts: list[Sequence[Column]] = []

    def write(self, columns: Sequence[Column]) -> None:
        self._parts.append(columns)

    def close(self, complete: bool) -> None:
        if not complete:
            return
        columns = self._parts[0] if self._parts else []
        if len(self._parts) > 1:
            rows = zip(*self._parts, strict=True)
            columns = [c[0]._replace(values=np.concatenate([x.values for x in c])) for c in rows]
        {'.xlsx': _xlsx, '.mat': _mat, '.npz': _npz}[self._path.suffix](
            self._path, columns, self._about
        )


_SINKS: dict[str, Callable[[Path, dict[str, str]], _Csv | _Parquet | _Whole]] = {
    **dict.fromkeys(ENDINGS, _Whole),
    '.csv': _Csv,
    '.parquet': _Parquet,
}


def field_type(pa: Any, values: Sequence[Any] | NDArray[Any]) -> Any:
    """The type of Arrow for a column: that of its values; of one without any, a number."""
    if isinstance(values, np.ndarray):
        return None
    kinds = {type(v) for v in values if v is not None}
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    if kinds <= {float, int}:
        return pa.float64()
    return pa.string()


def _text_cells(values: Sequence[Any] | NDArray[Any]) -> Iterable[Any]:
    """The cells of a column in a text."""
    if isinstance(values, np.ndarray) and values.dtype.kind in 'iuf' and np.isfinite(values).all():
        numbers: list[Any] = values.tolist()
        return numbers
    return map(_text_cell, values)


def _text_cell(value: Any) -> Any:
    """A value as a cell of a text; empty where there is not a number.

    Spreadsheets take a text that begins like a formula as one: an apostrophe says that it is none.
    """
    value = _plain(value)
    formula = isinstance(value, str) and value.startswith(_FORMULA) and not _QUANTITY.match(value)
    return f"'{value}" if formula else value


def _plain(value: Any) -> Any:
    """A value as Python has it, a text as it is; empty where there is not a number."""
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else ''
    if isinstance(value, np.generic):
        return value.item()
    return '' if value is None else value


def _xlsx(path: Path, columns: Sequence[Column], about: dict[str, str]) -> None:
    """A sheet with the table, and one that says what its columns are."""
    from openpyxl import Workbook  # noqa: PLC0415
    from openpyxl.styles import Alignment, Font  # noqa: PLC0415

    rows = len(columns[0].values) if columns else 0
    if rows > _MOST_ROWS:
        raise InputError(
            f"'{path.name}': a sheet holds {_MOST_ROWS} rows, and these are {rows}: write "
            '.parquet or .csv instead'
        )
    book = Workbook()
    sheet = book.active
    sheet.title = 'table'
    _append(sheet, [c.heading for c in columns])
    for row in zip(*(map(_plain, c.values) for c in columns), strict=True):
        _append(sheet, [None if cell == '' else cell for cell in row])
    sheet.freeze_panes = 'B2'
    named = book.create_sheet('columns')
    _append(named, ['column', 'unit', 'meaning'])
    for c in columns:
        _append(named, [c.name, c.unit, c.meaning])
    for key, text in about.items():
        _append(named, [key, '', text])
    for each in (sheet, named):
        for cell in each[1]:
            cell.font, cell.alignment = Font(bold=True), Alignment(wrap_text=True, vertical='top')
        for cells in each.columns:
            longest = max(len(str(cell.value)) for cell in cells[:50] if cell.value is not None)
            width = longest if each is named else min(longest, 14 + len(str(cells[0].value)) // 3)
            each.column_dimensions[cells[0].column_letter].width = min(width + 2, _WIDEST)
    book.save(path)


def _append(sheet: Any, row: list[Any]) -> None:
    """A row of a sheet, in which no text is a formula."""
    for cell, value in enumerate(row):
        if isinstance(value, str):  # characters that no sheet can hold
            row[cell] = re.sub(r'[\x00-\x08\x0b\x0c\x0e-\x1f]', '\ufffd', value)
    sheet.append(row)
    if any(isinstance(value, str) and value.startswith(('=', '#')) for value in row):
        for cell in sheet[sheet.max_row]:
            cell.data_type = 's' if isinstance(cell.value, str) else cell.data_type


def _mat(path: Path, columns: Sequence[Column], _: dict[str, str]) -> None:
    """A variable for each column, and structures with the units and the names of all."""
    import scipy  # noqa: PLC0415

    names = _identifiers([c.name for c in columns])
    data: dict[str, Any] = {}
    for name, c in zip(names, columns, strict=True):
        numbers = all(v is None or isinstance(v, int | float | np.number) for v in c.values)
        data[name] = (
            np.array([np.nan if v is None else v for v in c.values], float)[:, None]
            if numbers
            else np.array([str(_plain(v)) for v in c.values], object)[:, None]
        )
    data['units'] = dict(zip(names, [c.unit for c in columns], strict=True))
    data['names'] = dict(zip(names, [c.name for c in columns], strict=True))
    scipy.io.savemat(path, data, appendmat=False, long_field_names=True, oned_as='column')


def _identifiers(names: Sequence[str]) -> list[str]:
    """Names as MATLAB allows them: letters, digits and underscores, each once."""
    found: list[str] = []
    for name in names:
        plain = re.sub(r'\W+', '_', name).strip('_')[:_NAME_OF_MATLAB]
        plain = plain if plain[:1].isalpha() else f'x_{plain}'[:_NAME_OF_MATLAB]
        number, one = 2, plain
        while one in found or one in ('units', 'names'):
            one = f'{plain[: _NAME_OF_MATLAB - 3]}_{number}'
            number += 1
        found.append(one)
    return found


def _npz(path: Path, columns: Sequence[Column], _: dict[str, str]) -> None:
    with path.open('wb') as file:  # savez adds an ending to a name
        np.savez(file, **{c.name: np.asarray(c.values) for c in columns})  # type: ignore[arg-type]


def as_text(path: Path, data: bytes, where: str) -> str | None:
    """The first sheet of an .xlsx file as comma-separated text; None of other endings.

    Parameters
    ----------
    data : all of the file
    where : begins the sentence about a file that cannot be read
    """
    if path.suffix.lower() != '.xlsx':
        return None
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    rows = _read(_of_xlsx, path, data, where)
    writer.writerows([' '.join(str(_plain(x)).split()) for x in row] for row in rows)
    return text.getvalue()


def vectors(path: Path, data: bytes, where: str) -> tuple[list[Column], dict[str, float]]:
    """Columns of a .mat, .npz or .parquet file, arrays of numbers or texts; none of others.

    Of vectors of several lengths those that are as long as the longest; and single numbers.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        return [], {}
    found = _read(reader, path, data, where)
    plain = [c for c in found if c.values.ndim == 1 and c.values.dtype.kind in 'biufUOMm']
    longest = max((len(c.values) for c in plain), default=0)
    others = {
        'vectors of other lengths': [c for c in plain if 1 < len(c.values) < longest],
        'complex numbers': [c for c in found if c.values.dtype.kind == 'c'],
        'arrays of several dimensions': [c for c in found if c.values.ndim > 1],
    }
    for what, columns in others.items():
        if columns:
            names = ', '.join(c.name for c in columns)[:_SHOWN_NAMES]
            print_notice(f'{where}: {what} are left out: {names}')
    if not longest:
        raise InputError(f'{where} has no vector of numbers')
    single = (c for c in found if c.values.size == 1 and c.values.dtype.kind in 'iuf')
    columns = [
        c._replace(values=_cells(c.values), unit='s' if c.values.dtype.kind == 'm' else c.unit)
        for c in plain
        if len(c.values) == longest
    ]
    return columns, {c.name: float(c.values.item()) for c in single}


def _cells(values: NDArray[Any]) -> NDArray[Any] | list[str]:
    if values.dtype.kind in 'biuf':
        return values.astype(float)
    if values.dtype.kind == 'm':  # durations
        return np.asarray(durations(values))
    if values.dtype.kind == 'M':
        values = values.astype('M8[us]')  # of finer ones Python has plain numbers
    return [str(_plain(x)) for x in values]


def _read(
    reader: Callable[[BinaryIO], Sequence[Any]], path: Path, data: bytes, where: str
) -> Sequence[Any]:
    """Columns by a reader; its errors become one sentence."""
    if module := _NEEDS.get(path.suffix.lower()):
        needed(module, f'{where}: export it as .csv, for {path.suffix}')
    try:
        return reader(io.BytesIO(data))
    except Exception as error:  # libraries raise whatever a broken file leads to
        told = str(error).partition('\n')[0] or type(error).__name__
        cure = ": write it by save(..., '-v7')" if 'HDF reader' in told else ''
        raise InputError(f'{where} cannot be read: {told}{cure}') from error


def _of_xlsx(file: BinaryIO) -> Sequence[Any]:
    """Rows of the first sheet, of formulas their values."""
    from openpyxl import load_workbook  # noqa: PLC0415

    book = load_workbook(file, read_only=True, data_only=True)
    rows: list[Sequence[Any]] = list(book.worksheets[0].iter_rows(values_only=True))
    book.close()
    used = max((k for row in rows for k, x in enumerate(row) if x is not None), default=0)
    return [row[: used + 1] for row in rows]


def _of_mat(file: BinaryIO) -> Sequence[Column]:
    """Vectors, those of structures by ``STRUCTURE.FIELD``, and columns of matrices by a number.

    Structures in a row have a number, too, as ``X.2.Data``. Of matrices that are far wider than
    high these are the rows.
    """
    import scipy  # noqa: PLC0415

    data = scipy.io.loadmat(file, simplify_cells=True)
    data = {k: x for k, x in data.items() if not k.startswith('__')}
    own = isinstance(data.get('units'), dict) and isinstance(data.get('names'), dict)
    units, names = (data.pop('units'), data.pop('names')) if own else ({}, {})
    found = []
    while data:
        name, value = next(iter(data.items()))
        del data[name]
        if isinstance(value, dict):
            data = {f'{name}.{k}': x for k, x in value.items()} | data
            continue
        values, unit = np.asarray(value), units.get(name)
        if values.dtype.kind == 'O' and all(isinstance(x, dict) for x in values.flat):
            data = {f'{name}.{k}': x for k, x in enumerate(values.flat, 1)} | data
            continue
        wide = values.ndim == 2 and values.shape[1] > _WIDE * values.shape[0]
        parts = values if wide else values.T if values.ndim == 2 else [values]
        for k, one in enumerate(parts, 1):
            shown = names.get(name, name if len(parts) == 1 else f'{name}.{k}')
            # of an empty text it gives an empty array
            found.append(Column(shown, one, unit if isinstance(unit, str) else ''))
    return found


def _of_npz(file: BinaryIO) -> Sequence[Column]:
    def values(name: str) -> NDArray[Any]:
        try:
            return np.asarray(data[name])
        except ValueError as error:
            if 'pickle' not in str(error):
                raise
            raise ValueError(
                f"its array '{name}' holds objects of Python: save numbers, as by .astype(float)"
            ) from error

    with np.load(file) as data:
        return [Column(name, values(name)) for name in data.files]


def _of_parquet(file: BinaryIO) -> Sequence[Column]:
    import pyarrow.parquet as pq  # noqa: PLC0415

    table = pq.read_table(file)
    units = [(f.metadata or {}).get(b'unit', b'').decode() for f in table.schema]
    return [
        Column(name, table[name].to_numpy(zero_copy_only=False), unit)
        for name, unit in zip(table.column_names, units, strict=True)
    ]


_READERS: Mapping[str, Callable[[BinaryIO], Sequence[Column]]] = {
    '.mat': _of_mat,
    '.npz': _of_npz,
    '.parquet': _of_parquet,
}
