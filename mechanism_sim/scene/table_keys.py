"""Curves through points that a scene gives: in it, or in a file beside it."""

from __future__ import annotations

import csv
import math
import os
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from mechanism_sim import documents
from mechanism_sim.catalogue import TABLE_FOLDERS
from mechanism_sim.errors import InputError, nearest, quoted
from mechanism_sim.keys.quantities import Part, si_of
from mechanism_sim.numerics.curves import Curve, through
from mechanism_sim.units import QuantityValue

_ALONG = 'rad', 'm', 's', 'rad/s', 'm/s', ''
_VALUES = 'N', 'N m', ''

Along = Annotated[QuantityValue, si_of(*_ALONG)]
Value = Annotated[QuantityValue, si_of(*_VALUES)]


class TablePart(Part):
    """A curve through points; before the first and after the last its value stays."""

    points: list[tuple[Along, Value]] = Field(min_length=2)
    """List of [x, y], such as [20 mm, 1.5 kN], with rising x; two points of the same x are a step.
    Instead of it `file` names a file of comma-separated values beside the scene, and `columns` two
    of its columns, else the first two: its first line gives their names, with units in brackets.
    """
    ramp: Literal['linear', 'smooth'] = 'linear'
    """Between two points; smooth has no corners."""
    cyclic: bool = False
    """The points are those of a turn, which repeats."""

    @model_validator(mode='after')
    def _is_curve(self) -> TablePart:
        for column in zip(*self.points, strict=True):
            units = {m.unit for m in column}
            if len(units) > 1:
                names = ' and '.join(sorted(unit or 'no unit' for unit in units))
                raise ValueError(f'has points in {names}: give all in the same kind of unit')
            if not all(math.isfinite(m.value) for m in column):
                raise ValueError('has points that are not finite')
        self.curve  # noqa: B018 - refuses what is none
        return self

    @property
    def curve(self) -> Curve:
        """The curve in SI units."""
        points = [(x.value, y.value) for x, y in self.points]
        return through(points, self.ramp, self.cyclic)


def with_files(file: str, folder: Path, content: Any) -> Any:
    """The keys and values of a scene with the points of the files that it names."""
    if isinstance(content, list):
        return [with_files(file, folder, x) for x in content]
    if not isinstance(content, dict):
        return content
    if isinstance(name := content.get('file'), str) and content.keys() <= _KEYS:
        if 'points' in content:
            raise InputError(f"{file}: 'file: {name}' and 'points' exclude each other: keep one")
        rest = {k: x for k, x in content.items() if k not in ('file', 'columns')}
        return rest | {'points': _points_of(file, folder, name, content.get('columns'))}
    return {k: with_files(file, folder, x) for k, x in content.items()}


_KEYS = {'file', 'columns', *TablePart.model_fields}


_LINE = 300  # characters of names in a sentence

LARGEST, MOST = 1 << 21, 20_000
"""Bytes and lines of a file; a pressure measured every twentieth of a degree is half of it."""


def _points_of(file: str, folder: Path, name: str, columns: Any) -> list[list[str]]:
    """The points in two columns of a file, as text with units."""
    path = folder / name
    try:
        data = documents.bytes_of(_allowed(file, folder, name), LARGEST)
        if len(data) > LARGEST:
            raise InputError(
                f"{file}: '{path.name}' is larger than {LARGEST} bytes: give fewer points"
            )
        lines = data.decode('utf-8-sig').splitlines()
        head, *rows = [row for row in csv.reader(lines) if row]
    except InputError:
        raise
    except (OSError, UnicodeDecodeError, csv.Error, ValueError) as error:
        reason = getattr(error, 'strerror', None) or 'it is empty, or not comma-separated text'
        raise InputError(f"{file}: '{path.name}' cannot be read: {reason}") from error
    if len(rows) > MOST:
        raise InputError(
            f"{file}: '{path.name}' has {len(rows)} points: allowed are {MOST}; take every "
            f'{math.ceil(len(rows) / MOST)}th'
        )
    parts = [text.removeprefix("'").replace('(', '[').partition('[') for text in head]
    names = [name.strip() for name, _, _ in parts]
    units = {name: unit.strip(' ])') for name, (_, _, unit) in zip(names, parts, strict=True)}
    chosen = columns if columns is not None else names[:2]
    if not isinstance(chosen, list) or len(chosen) != 2:
        raise InputError(f"{file}: '{path.name}': columns must be a list of two names")
    for column in chosen:
        if not isinstance(column, str) or column not in units:
            raise InputError(
                f"{file}: '{path.name}' has no column {quoted(column)}"
                f'{nearest(str(column), names)}; its columns: {", ".join(names)[:_LINE]}'
            )
        if names.count(column) > 1:
            raise InputError(f"{file}: '{path.name}' has several columns {quoted(column)}")
    found = []
    for number, row in enumerate(rows, start=2):
        try:
            values = [float(row[names.index(name)]) for name in chosen]
            if not all(map(math.isfinite, values)):
                raise ValueError
            found.append(
                [f'{x!r} {units[n]}'.strip() for x, n in zip(values, chosen, strict=True)]
            )
        except (ValueError, IndexError) as error:
            raise InputError(
                f"{file}: '{path.name}', line {number}: expected a finite number in both columns"
            ) from error
    return found


def _allowed(file: str, folder: Path, name: str) -> Path:
    """Where a file is, with all links followed: below the folder of the scene, or one allowed."""
    others = [x for x in os.environ.get(TABLE_FOLDERS, '').split(os.pathsep) if x]
    try:
        found = (folder / name).resolve()
        folders = [folder.resolve(), *(Path(x).resolve() for x in others)]
    except RuntimeError as error:  # of pathlib, for links in a circle
        raise InputError(f"{file}: '{name}' cannot be read: its links form a circle") from error
    if not any(found.is_relative_to(x) for x in folders):
        raise InputError(
            f"{file}: '{name}' lies outside the folder of the scene, '{folders[0]}': put it "
            f"there, or allow its folder by --tables-from '{found.parent}' or {TABLE_FOLDERS}"
        )
    return found
