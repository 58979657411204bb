"""Tables in text files: columns by name with the units of their headings, or one sentence.

The only reader of comma-separated values. Commas, semicolons and tabs separate, or spaces where
every line has some and the first none of these, or what a first line ``sep=;`` says; lines that
begin with ``#`` are comments; a heading may have its unit in brackets, as ``angle [deg]``, after a
slash, as ``angle / deg``, or below it, in a line without numbers that stands above numbers; else
its name may end with it, as ``angle_deg``. A file without headings has the columns ``1``, ``2``
and so on. Lines of a program or an instrument may stand above the headings, if these are right
above numbers, or their units, in as many cells: it is said which line was taken. Where cells have
commas and no number has a point, they are decimal ones, unless all of them might stand before
thousands. That these do not is assumed, and said, of semicolons between cells where every number
has one comma and most are not round. Tables of electronic cams stand between lines such as
``TABLE_BEGIN`` and ``TABLE_END``, without headings, or have remarks behind their numbers. The
first sheet of an .xlsx file is read as if it were such a text; .mat, .npz and .parquet files have
vectors.
"""

from __future__ import annotations

import codecs
import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from mechanism_sim import documents, tables
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest, quoted
from mechanism_sim.terminal import print_notice
from mechanism_sim.units import common, to_si, to_si_text

LARGEST, MOST = 1 << 21, 20_000
"""Bytes and lines of a file; a pressure measured every twentieth of a degree is half of it."""

_SHOWN = 300  # characters of names in a sentence
_DECIMAL_COMMA = re.compile(r'\s*[-+]?\d*,\d+(e[-+]?\d+)?\s*', re.IGNORECASE)
_THOUSANDS = re.compile(r'\s*[-+]?[1-9]\d{0,2},\d{3}\s*')
_GROUPED = re.compile(r"\s*[-+]?\d{1,3}([., '])\d{3}(?:\1\d{3})*(?!\1)[.,]\d+\s*")
_BRACKET = re.compile(r'[^/]*[\[(]')
_FRAME = re.compile(r'\s*(?:TABLE_?(BEGIN|END)|(BEGIN|END)_?TABLE)\b', re.IGNORECASE)
_REMARK = re.compile(r'^([-+\d.,;\sEe]*\d)[;\s]+(//|#\s).*')  # behind numbers only
_EXCEL = re.compile(r'"?sep=([;,|\t])"?', re.IGNORECASE)
MISSING = '', 'nan', 'na', 'n/a', '#n/a', '-', 'null', 'none'
"""Cells that stand for a number that is not known, in any case."""
_WITH_UNIT = re.compile(r'(?:[^\s"\[(]+\s*)?[\[(][^\])]*[\])]')
_AMBIGUOUS = 't', 'in', 'min', 'bar'
"""Ends of names that mean tangential, inlet, minimum or a link as often as units.

A bar is a unit where pressures are wanted.
"""
_LONGER = 'ns', 'degree', 'degrees'  # units of names beside the common ones
_INDEX = re.compile(r'[A-Za-z]\d?')
_SHORT_END = re.compile(r'_[A-Za-z][A-Za-z0-9]{0,2}$')
_PER_SECOND = re.compile(r's([23]|\^[23]|[²³])?')
_MOVED, _FORCES, _ARMS = ('m', 'mm', 'cm', 'rad', 'mrad', 'deg'), ('N', 'kN'), ('m', 'cm', 'mm')
_MOST_AHEAD, _BODY = 200, 3
"""Lines that may stand above headings, and by how many of numbers a table is known."""
_SEPARATORS = ';\t,'  # in the order in which they are looked for: commas may be decimal ones


@dataclass(frozen=True)
class CsvTable:
    """The cells of a file by column: as text, or as numbers where the file has them so.

    Attributes
    ----------
    where : begins each sentence about it: file and key that name it, and its own name
    heading : first line
    cells : texts of each column, from the first row on
    units : units by column, as in its heading; empty for none
    lines : line of the file that each row is on, or its number
    single : single numbers beside the columns, by name
    """

    where: str
    heading: str
    cells: Mapping[str, Sequence[str] | Array]
    units: Mapping[str, str]
    lines: Sequence[int]
    single: Mapping[str, float] = field(default_factory=dict)

    def column(self, name: object) -> Sequence[str] | Array:
        """Cells of a column; `InputError` names the columns there are."""
        if not isinstance(name, str) or name not in self.cells:
            raise InputError(
                f'{self.where} has no column {quoted(name)}{nearest(str(name), self.cells)}; its '
                f'columns: {", ".join(self.cells)[:_SHOWN]}'
            )
        return self.cells[name]

    def numbers(self, *names: object, gaps: bool = False) -> Array:
        """Finite numbers of columns (rows, columns), in the units of their headings.

        With gaps, what is `MISSING` is not a number.
        """
        found = np.empty((len(self.lines), len(names)))
        for j, name in enumerate(names):
            cells = self.column(name)
            if not isinstance(cells, np.ndarray):
                numbers = [
                    math.nan
                    if gaps and cell.strip().lower() in MISSING
                    else self._number(cell, name, line)
                    for line, cell in zip(self.lines, cells, strict=True)
                ]
                cells = np.array(numbers, float)
            elif not gaps and not np.isfinite(cells).all():
                self._number('nan', name, self.lines[int(np.argmin(np.isfinite(cells)))])
            found[:, j] = cells
        return found

    def is_text(self, name: object) -> bool:
        """True if no cell of a column is meant as a number, however it is written."""
        cells = self.column(name)
        return not isinstance(cells, np.ndarray) and not any(
            (_is_number(x) or _GROUPED.fullmatch(x)) and x.strip().lower() not in MISSING
            for x in cells
        )

    def rising(self, name: object, values: Array) -> None:
        """Refuse numbers of a column that do not rise from row to row."""
        for line, before, value in zip(self.lines[1:], values[:-1], values[1:], strict=True):
            if not value > before:
                raise InputError(
                    f"{self.where}, line {line}: '{name}' must increase, but {value:.15g} "
                    f'follows {before:.15g}'
                )

    def _number(self, cell: str, name: object, line: int) -> float:
        place = f"{self.where}, line {line}: expected a finite number in column '{name}'"
        if _DECIMAL_COMMA.fullmatch(cell) or _GROUPED.fullmatch(cell):
            whole, point, part = cell.strip().replace(',', '.').rpartition('.')
            plain = re.sub(r"[. ']", '', whole) + point + part
            if _THOUSANDS.fullmatch(cell):
                raise InputError(
                    f'{place}, got {quoted(cell)}, which may be {plain} or {whole}{part}: write it'
                    ' without a comma'
                )
            raise InputError(
                f'{place}, got {quoted(cell)}: write {plain}, decimal signs alike in all of the '
                'table and none before thousands'
            )
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InputError(f'{place}, got {quoted(cell)}')
        return value


@cache
def assume(what: str) -> None:
    """Report an assumption, once."""
    print_notice(what)


def named_unit(name: str, wanted: Sequence[str] = ()) -> str:
    """The unit that a name ends with, as ``angle_deg`` and ``speed_rad_s``, or is, as ``rpm``.

    Empty where there is none, or none of the `wanted` SI units fits it, of which an empty one
    stands for all but letters and those with a digit, as in ``F_A2``. A small letter
    may be an index, as in ``omega_m``: it counts only where just one unit is wanted, and that
    fits.
    """
    *others, last = name.strip().split('_')
    before = others[-1] if others else ''
    is_pressure = bool(before) and last == 'bar' and 'Pa' in wanted
    if before in _MOVED and _PER_SECOND.fullmatch(last):
        unit = f'{before}/{last}'
    elif before in _FORCES and last in _ARMS:
        unit = f'{before} {last}'
    elif (last in _AMBIGUOUS and not is_pressure) or _is_in_names(before):
        return ''
    else:
        unit = last
        if len(last) == 1 and not (others and (last.isupper() or len(wanted) == 1)):
            return ''
    if not (_is_in_names(unit) or _is_unit(unit)):
        return ''
    any_other = not wanted or ('' in wanted and not _INDEX.fullmatch(unit))
    return unit if any_other or any(fits(unit, x) for x in wanted) else ''


def is_like_unit(name: str) -> bool:
    """True if the end of a name may be meant as a unit, whether it is one, as in ``p_psi``."""
    return bool(_SHORT_END.search(name.strip()))


def _is_in_names(unit: str) -> bool:
    return unit in _LONGER or (unit not in _AMBIGUOUS and bool(common(unit)))


def fits(unit: str, wanted: str) -> bool:
    """True of a unit in which a quantity of an SI unit may be given."""
    try:
        to_si(f'1 {unit}', wanted)
    except ValueError:
        return False
    return True


def _is_unit(text: str) -> bool:
    """True of a product of common units."""
    try:
        return bool(text) and bool(to_si_text(f'1 {text}'))
    except ValueError:
        return False


def read_csv(path: Path, where: str, larger: int = 1) -> CsvTable:
    """The table in a file.

    Parameters
    ----------
    where : the file and key that name it, which begin each sentence about it
    larger : factor on the limits `LARGEST` and `MOST`
    """
    where, most = f"{where}: '{path.name}'", larger * MOST
    data = documents.limited(path, larger * LARGEST, where, 'give fewer points')
    if found := _of_vectors(path, data, where, most):
        return found
    heading, rows = _rows(path, data, where)
    _check_count(len(rows) - 1, where, most)
    if all(map(_is_number, rows[0][1])):
        names, units = [str(i + 1) for i in range(len(rows[0][1]))], [''] * len(rows[0][1])
    else:
        parts = _names_and_units([cell.removeprefix("'").strip() for cell in rows[0][1]])
        names, units = [name for name, _ in parts], [unit for _, unit in parts]
        rows = rows[1:]
        if not any(units) and _are_units([row for _, row in rows[:2]]):
            units = [x.strip(' []()') for x in rows[0][1]] + [''] * (len(names) - len(rows[0][1]))
            rows = rows[1:]
    _check_names(names, where)
    for line, row in rows:
        if len(row) > len(names):
            halves = len(row) == 2 * len(names) and all(re.fullmatch(r'\s*-?\d+', x) for x in row)
            cure = ": write decimal points, not commas, or separate by ';'" if halves else ''
            raise InputError(
                f'{where}, line {line}: expected {len(names)} cells as in the first line, got '
                f'{len(row)}{cure}'
            )
    missing = [''] * len(names)  # cells of shorter rows
    columns = zip(*((row + missing)[: len(names)] for _, row in rows), strict=True)
    cells = dict(zip(names, columns if rows else missing, strict=True))
    units_of = dict(zip(names, map(_open, units), strict=True))
    return CsvTable(where, heading, cells, units_of, [n for n, _ in rows])


def _of_vectors(path: Path, data: bytes, where: str, most: int) -> CsvTable | None:
    """The table in a file of arrays; None of others."""
    columns, single = tables.vectors(path, data, where)
    if not columns:
        return None
    rows = range(1, len(columns[0].values) + 1)
    _check_count(len(rows), where, most)
    headings = [c.heading for c in columns]
    names, units = zip(*_names_and_units(headings), strict=True)
    _check_names(names, where)
    cells = dict(zip(names, (c.values for c in columns), strict=True))
    units_of = dict(zip(names, map(_open, units), strict=True))
    return CsvTable(where, ','.join(headings), cells, units_of, rows, single)


def _check_names(names: Sequence[str], where: str) -> None:
    for name in names:
        if names.count(name) > 1:
            raise InputError(f'{where} has several columns {quoted(name)}')


def _check_count(count: int, where: str, most: int) -> None:
    if count > most:
        # of a signal between others, what lies above half of their rate would be taken for less
        advice = 'take a part' if most > MOST else f'take every {math.ceil(count / most)}th'
        raise InputError(f'{where} has {count} points: allowed are {most}; {advice}')


def _open(unit: str) -> str:
    """Unit of a value; empty for ``rad or m``, of an unknown joint: in SI units it is either."""
    return '' if ' or ' in unit else unit


def _names_and_units(headings: Sequence[str]) -> list[tuple[str, str]]:
    """Names and units of columns; a unit is empty where the heading has none.

    As ``Time / ms``, which is that of ISO 80000 and DIN 1313, where none has brackets before.
    """
    slashed = not any(map(_BRACKET.match, headings))
    return [(slashed and _slashed(x)) or _bracketed(x) for x in headings]


def _bracketed(heading: str) -> tuple[str, str]:
    name, _, unit = heading.replace('(', '[').partition('[')
    return name.strip(), unit.strip(' ])')


def _slashed(heading: str) -> tuple[str, str] | None:
    """Name and unit of a heading with a slash; None if the part behind it is no unit."""
    name, slash, unit = heading.partition(' / ')
    unit = unit.strip()
    if _within(unit):
        unit = unit[1:-1].strip()
    if not _is_unit(re.sub('1 */ *', '', unit)):
        return None
    return (name.strip(), unit) if slash and unit else None


def _within(unit: str) -> bool:
    """True if one pair of brackets holds all of it."""
    return unit[:1] + unit[-1:] in {'[]', '()'} and not set('[]()') & set(unit[1:-1])


def _rows(path: Path, data: bytes, where: str) -> tuple[str, list[tuple[int, list[str]]]]:
    """The first line with text, and line number and cells of each; at least one."""
    try:
        sheet = tables.as_text(path, data, where)
        text = _text(data) if sheet is None else sheet
        lines = text.splitlines()
        if '//' in text or '# ' in text:
            lines = [_REMARK.sub(r'\1', line) for line in lines]
        kept = [n for n, line in enumerate(lines) if line.strip() and not line.startswith('#')]
        framed, kept = _framed(lines, kept)
        told = _EXCEL.fullmatch(lines[kept[0]])
        kept = kept[1:] if told else kept
        known = framed or told
        if ahead := 0 if known else _headings_at([lines[n] for n in kept[:_MOST_AHEAD]]):
            kept = kept[ahead:]
            shown = quoted(lines[kept[0]].strip())
            assume(f'{where}: line {kept[0] + 1} is taken for its headings: {shown}')
        first, texts = lines[kept[0]], [lines[n] for n in kept]
        marks = told[1] if told else _SEPARATORS
        mark = next(s for s in marks if s in first or s == marks[-1])
        if not told and _are_spaced(texts, mark, first):
            # of headings a name and its unit are one cell
            texts = [line.replace('\t', ' ') for line in texts]
            mark, texts = ' ', [_WITH_UNIT.sub(r'"\g<0>"', line.strip()) for line in texts]
        if mark == ',' and all(map(_DECIMAL_COMMA.fullmatch, texts)):
            # numbers, one in a line; whole ones in two columns never begin with 0
            mark = ';' if any(re.search(r',0\d', line) for line in texts) else mark
        reader = csv.reader(texts, delimiter=mark, skipinitialspace=True)
        rows = [(kept[min(reader.line_num, len(kept)) - 1] + 1, row) for row in reader]
        if framed:  # behind its numbers stands the kind of a segment
            words = [k for k, cell in enumerate(rows[0][1]) if not _is_number(cell)]
            rows = [(n, row[: min(words, default=0) or len(row)]) for n, row in rows]
    except InputError:
        raise
    except UnicodeDecodeError as error:
        raise InputError(
            f'{where} cannot be read: it is not comma-separated text in UTF-8; save it as '
            "'CSV UTF-8', or write it by a command with -o NAME.csv"
        ) from error
    except (csv.Error, ValueError, IndexError) as error:
        reason = 'it is empty, or not comma-separated text'
        raise InputError(f'{where} cannot be read: {reason}') from error
    # a separator after the last cell, as some programs write it, makes no column
    if len(rows[0][1]) > 1 and all(row[-1:] == [''] for _, row in rows):
        rows = [(n, row[:-1]) for n, row in rows]
    # within quotes beside other commas they may part a list: in rows of numbers only they do not
    maybe = mark != ',' or all(map(_is_number, rows[-1][1]))
    cells = [cell for _, row in rows for cell in row]
    guess = _look_decimal(cells) if mark == ';' else ''
    if guess:  # values are a thousand times off where it is wrong
        read, other = _point(guess), guess.replace(',', '')
        assume(f"{where}: commas are read as decimal signs: '{guess}' is {read}, not {other}")
    # no number has a point, and not all that have a comma might be thousands
    commas = [cell for cell in cells if _DECIMAL_COMMA.fullmatch(cell)]
    pointed = any('.' in cell and _is_number(cell) for cell in cells)
    decimal = not pointed and not all(map(_THOUSANDS.fullmatch, commas))
    if guess or (maybe and decimal):
        rows = [(n, [_point(cell) for cell in row]) for n, row in rows]
    return first.strip(), rows


def _framed(lines: Sequence[str], kept: list[int]) -> tuple[bool, list[int]]:
    """True of a table between lines that mark its ends, and the lines of it."""
    marks = [(n, found) for n in kept if (found := _FRAME.match(lines[n]))]
    begin = next((n for n, found in marks if 'BEGIN' in found[0].upper()), None)
    if begin is None:
        return False, kept
    end = next((n for n, _ in marks if n > begin), len(lines))
    return True, [n for n in kept if begin < n < end]


def _are_spaced(lines: Sequence[str], mark: str, first: str) -> bool:
    """True if spaces part the cells of all lines, commas none."""
    if mark not in first:
        return all(' ' in line.strip() for line in lines)
    # with decimal commas; a cell that begins with one stands behind a separator
    cells = (line.split() for line in lines)
    return mark == ',' and all(
        len(x) > 1 and all(_is_number(y) and y[0] != ',' for y in x) for x in cells
    )


def _headings_at(lines: Sequence[str]) -> int:
    """Index of the line of headings below lines of a program or an instrument.

    Right above numbers, or above their units, in as many cells as these have. 0 if they are the
    first line, or if several might be them.
    """
    for mark in _SEPARATORS:
        rows = [*csv.reader(lines, delimiter=mark, skipinitialspace=True, quoting=csv.QUOTE_NONE)]
        k = next((k for k in range(len(rows)) if _are_numbers(rows[k : k + _BODY])), 0)
        if not k:
            continue
        alike = [len(row) == len(rows[k]) for row in rows[:k]]
        first = k - next((n for n, same in enumerate(reversed(alike)) if not same), k)
        above = rows[first:k]  # of as many cells
        if not first and k <= 2:  # headings and units, whatever these look like
            return 0
        units = [x.strip(' "') for row in above[1:] for x in row if x.strip()]
        whole = bool(units) and all(_within(x) or _is_unit(x) for x in units)
        if len(above) == 1 or (len(above) == 2 and whole):
            return first
        named = above and any(name and unit for name, unit in _names_and_units(above[-1]))
        return k - 1 if named else 0
    return 0


def _are_numbers(rows: Sequence[Sequence[str]]) -> bool:
    """True if rows are of equal length, two at least, and of numbers."""
    known = all(_is_number(x) or x.strip().lower() in MISSING for row in rows for x in row)
    numbers = all(any(map(_is_number, row)) for row in rows)
    return known and numbers and len({len(row) for row in rows}) == 1 and len(rows[0]) > 1


def _text(data: bytes) -> str:
    """The text of a file in UTF-8, or as programs of offices write it where asked for less."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode('utf-16')
    try:
        return data.decode('utf-8-sig')
    except UnicodeDecodeError:
        if b'\0' in data:
            raise
        return data.decode('cp1252')


def _look_decimal(cells: Sequence[str]) -> str:
    """One of the numbers if all might have commas before thousands, but hardly do.

    Of thousands some would be below 1000, without a comma, or most of them round.
    """
    numbers = [x.strip() for x in cells if _is_number(x) and x.strip().lower() not in MISSING]
    fine = [x for x in numbers if not x.endswith('00')]
    alike = all(map(_THOUSANDS.fullmatch, numbers))
    return fine[0] if alike and 2 * len(fine) > len(numbers) else ''


def _point(cell: str) -> str:
    """A number with a point instead of a comma; other cells as they are."""
    return cell.replace(',', '.') if _DECIMAL_COMMA.fullmatch(cell) else cell


def _are_units(rows: Sequence[Sequence[str]]) -> bool:
    """True if the first of two rows holds no number, and words above numbers of the second."""
    if len(rows) < 2 or any(map(_is_number, rows[0])):
        return False
    pairs = zip(*rows, strict=False)
    return any(x.strip().lower() not in MISSING and _is_number(y) for x, y in pairs)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return bool(_DECIMAL_COMMA.fullmatch(cell))
    return True
