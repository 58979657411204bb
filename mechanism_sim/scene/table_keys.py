"""Curves through points that a scene gives: in it, or in a file beside it."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.numerics.curves import Curve, through
from mechanism_sim.scene.quantities import Part, si_of
from mechanism_sim.units import Measure

_ALONG = 'rad', 'm', 's', 'rad/s', 'm/s', ''
_VALUES = 'N', 'N m', ''

Along = Annotated[Measure, si_of(*_ALONG)]
Value = Annotated[Measure, si_of(*_VALUES)]


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
    """Whether the points are those of a turn, which repeats."""

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
    """The keys and values of a scene with the points of the files that it names.

    Raises
    ------
    InputError
        If a file cannot be read.
    """
    if isinstance(content, list):
        return [with_files(file, folder, x) for x in content]
    if not isinstance(content, dict):
        return content
    if isinstance(name := content.get('file'), str) and content.keys() <= _KEYS:
        if 'points' in content:
            raise InputError(f"{file}: 'file: {name}' and 'points' exclude each other: keep one")
        rest = {k: x for k, x in content.items() if k not in ('file', 'columns')}
        return rest | {'points': _points_of(file, folder / name, content.get('columns'))}
    return {k: with_files(file, folder, x) for k, x in content.items()}


_KEYS = {'file', 'columns', *TablePart.model_fields}


def _points_of(file: str, path: Path, columns: Any) -> list[list[str]]:
    """The points in two columns of a file, as text with units."""
    try:
        with path.open(newline='', encoding='utf-8-sig') as lines:
            head, *rows = [row for row in csv.reader(lines) if row]
    except (OSError, UnicodeDecodeError, csv.Error, ValueError) as error:
        reason = getattr(error, 'strerror', None) or 'it is empty, or not comma-separated text'
        raise InputError(f"{file}: '{path.name}' cannot be read: {reason}") from error
    units: Mapping[str, str] = {
        name.strip(): unit.strip(' ])')
        for name, _, unit in (text.replace('(', '[').partition('[') for text in head)
    }
    names = [*units]
    chosen = columns if columns is not None else names[:2]
    if not isinstance(chosen, list) or len(chosen) != 2:
        raise InputError(f"{file}: '{path.name}': columns must be a list of two names")
    for name in chosen:
        if name not in units:
            raise InputError(
                f"{file}: '{path.name}' has no column '{name}'{nearest(str(name), names)}; its "
                f'columns: {", ".join(names)}'
            )
    found = []
    for number, row in enumerate(rows, start=2):
        try:
            found.append([f'{float(row[names.index(n)])!r} {units[n]}'.strip() for n in chosen])
        except (ValueError, IndexError) as error:
            raise InputError(
                f"{file}: '{path.name}', line {number}: expected a number in every column"
            ) from error
    return found
