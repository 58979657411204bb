"""Curves through points given in a scene, or in a file beside it."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from mechanism_sim.arrays import Array
from mechanism_sim.catalogue import TABLE_FOLDERS
from mechanism_sim.csv_tables import assume, fits, is_like_unit, named_unit, read_csv
from mechanism_sim.errors import InputError
from mechanism_sim.keys.quantities import FROM_FILE, Part, UnitValue, si_of
from mechanism_sim.numerics.curves import Curve, Interpolation, through
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.output import path_of
from mechanism_sim.scene.drawn_edges import drawn_edges
from mechanism_sim.scene.motion_keys import PositionPart
from mechanism_sim.units import QuantityValue, counted, to_si_of, to_si_text

_ALONG = 'rad', 'm', 's', 'rad/s', 'm/s', ''
_EVEN = 0.25 * math.pi
"""Steps [rad] of positions up to which a jump by a turn is told from one that is meant."""
_VALUES = 'N', 'N m', 'Pa', ''


def _value(given: object) -> QuantityValue:
    """A value of a table, in any product of common units."""
    if isinstance(given, list | tuple) and len(given) == 2 and isinstance(given[1], str):
        given = f'{given[0]!r} {given[1]}'.strip()  # as in JSON
    try:
        return to_si_of(given, _VALUES)
    except ValueError:
        return to_si_text(given)


Along = Annotated[QuantityValue, si_of(*_ALONG)]
Value = Annotated[QuantityValue, UnitValue(_value, _VALUES, 'a quantity in any other unit')]


class TablePart(Part):
    """A curve through points; before the first and after the last its value stays."""

    of_files: ClassVar[tuple[str, ...]] = FROM_FILE

    points: list[tuple[Along, Value]] = Field(min_length=2)
    """List of [x, y], such as [20 mm, 1.5 kN], with increasing x; two of the same x are a step.
    Instead of it `file` names a file of comma-separated values beside the scene, and `columns` two
    of its columns, else the first two: its first line gives their names, with units in brackets or
    behind an underscore, as in angle_deg.
    """
    ramp: Literal['linear', 'smooth'] = 'linear'
    """Between two points; smooth has no corners, and no extremes but at points."""
    interpolation: Interpolation | None = None
    """Instead of a ramp: through all points, cubic with two continuous derivatives or quintic with
    four.
    """
    cyclic: bool = False
    """The points are those of a turn, which repeats."""
    periodic: bool = False
    """The points are those of a period of any length, which repeats."""

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
        if self.interpolation and self.ramp != 'linear':
            raise ValueError("has 'ramp' and 'interpolation': keep one")
        period = points[-1][0] - points[0][0] if self.periodic else TWO_PI
        repeats = self.cyclic or (self.periodic and period > 0.0)
        return through(points, self.interpolation or self.ramp, repeats, period)


def with_files(
    file: str,
    folder: Path,
    content: Any,
    key: str = '',
    instead: bool = False,
    replaced: Collection[str] = (),
) -> Any:
    """The keys and values of a scene with the points of the files that it names.

    Parameters
    ----------
    key : path of the content in the scene
    instead : replace present points
    replaced : paths whose values overrides will replace: no file is read for what they hold
    """
    if key[1:] in replaced:
        return content
    if isinstance(content, list):
        return [
            with_files(file, folder, x, f'{key}.{i}', instead, replaced)
            for i, x in enumerate(content)
        ]
    if not isinstance(content, dict):
        return content
    if isinstance(name := content.get('file'), str) and content.keys() <= _KEYS:
        where = f'{file}: {key[1:]}' if key else file
        # a table may have any name
        if key.endswith('.points') and key != '.tables.points' and content.keys() <= {*_OF_FILES}:
            raise InputError(f"{where}: 'file' stands in place of 'points', not in it")
        if (last := key.rpartition('.')[2]) in _FORCES:
            raise InputError(
                f"{where}: a {last} has no points: enter the file in 'tables', as {{NAME: {{file: "
                f'{name}}}}}, and write the formula NAME(t)'
            )
        made = 'edges' if name.lower().endswith('.dxf') else 'points'
        if f'{key}.file'[1:] in replaced:
            return {k: x for k, x in content.items() if k != 'file'}
        if f'{key}.{made}'[1:] in replaced:
            return {k: x for k, x in content.items() if k not in _OF_FILES}
        if made in content and not instead:
            raise InputError(f"{where}: 'file: {name}' and '{made}' exclude each other: keep one")
        rest = {k: x for k, x in content.items() if k not in (*_OF_FILES, made)}
        # what an override names is where it is given, too
        more = [Path.cwd()] if instead else []
        path, units = allowed_file(where, folder, name, more), content.get('units')
        if made == 'edges':
            return rest | {made: drawn_edges(path, where, content.get('layer'), units)}
        return rest | {made: _points_of(path, where, content, _wanted(key))}
    return {
        k: with_files(file, folder, x, f'{key}.{k}', instead, replaced) for k, x in content.items()
    }


_OF_FILES = *FROM_FILE, 'layer'
_FORCES = 'torque', 'force', 'effort'  # keys of drives and loads, which are formulas
_KEYS = {
    *_OF_FILES,
    'degree',
    'error',
    'edges',
    *TablePart.model_fields,
    *PositionPart.model_fields,
}


def _wanted(key: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """SI units in which the columns of a file may be, by the path of the key that names it.

    With an empty one they may be in others, too.
    """
    head, *path = key.strip('.').split('.')
    if head in ('drive', 'drives') and 'motor' in path:
        return ('rad/s',), ('N m',)
    if head in ('drive', 'drives'):
        return ('s',), ('rad', 'm') if 'position' in path else ('rad/s', 'm/s')
    if head == 'tables':
        return _ALONG[:-1], _VALUES
    return ('m', 'rad'), ('m', 'rad')  # of cams, which need a whole turn, and say so


_SAID = {
    's': 'seconds',
    'rad': 'SI units, an angle in rad',
    'rad/s': 'SI units, rotation in rad/s',
}
"""Assumed reading of a column without unit, by the first of its possible units."""


def _points_of(
    path: Path, where: str, keys: Mapping[str, Any], wanted: Sequence[Sequence[str]]
) -> list[list[str]]:
    """The points in two columns of a file, as text with units."""
    table, units = read_csv(path, where), keys.get('units')
    chosen = columns if (columns := keys.get('columns')) is not None else list(table.cells)[:2]
    if len(table.cells) < 2:
        raise InputError(
            f'{table.where} has one column, {", ".join(table.cells)}, where columns must be a '
            'list of two names'
        )
    for key, given in (('columns', chosen), ('units', units or ['', ''])):
        if not isinstance(given, list) or [isinstance(x, str) for x in given] != [True, True]:
            raise InputError(f'{table.where}: {key} must be a list of two names')
    found = []
    for name, asked, fitting in zip(chosen, units or ['', ''], wanted, strict=True):
        said = table.units[name] if table.column(name) is not None else ''
        if said and asked and not _alike(said, asked):
            raise InputError(
                f"{table.where}: its first line has column '{name}' in '{said}', and units in "
                f"'{asked}': keep one"
            )
        unit = asked or said or named_unit(name, fitting)
        if fitting == ('s',) and (fits(unit, 'rad') if unit else named_unit(name, ('rad',))):
            raise InputError(
                f"{table.where}: column '{name}' is an angle, but a drive follows points over "
                "time: give the times of these angles, or take a joint 'cam' with law: {file: ...}"
            )
        try:
            to_si_of(f'1 {unit}', tuple(fitting)) if '' not in fitting else _value(f'1 {unit}')
        except ValueError as error:
            raise InputError(f"{table.where}: column '{name}': {error}") from error
        if not unit and fitting[0] in _SAID:
            assume(
                f"{table.where}: column '{name}' has no unit: it is read in {_SAID[fitting[0]]}"
            )
        if not unit and '' in fitting and is_like_unit(name):
            assume(
                f"{table.where}: column '{name}' ends with no unit that is read: it is read as "
                "plain numbers; its unit can stand in brackets, or in 'units'"
            )
        found.append(unit)
    numbers = table.numbers(*chosen)
    if wanted[0] == ('s',) and 'rad' in wanted[1]:
        numbers[:, 1] = _unwrapped(numbers[:, 1], found[1], table.where)
    return [
        [f'{x!r} {unit}'.strip() for x, unit in zip(row, found, strict=True)]
        for row in numbers.tolist()
    ]


def _unwrapped(values: Array, unit: str, where: str) -> Array:
    """Positions (N,) with whole turns where measured angles jump back by one, as encoders do."""
    scale, kind = to_si_text(f'1 {unit or "rad"}')
    steps = scale * np.diff(values)
    jumps = np.abs(steps) > math.pi
    within = scale * np.ptp(values) < TWO_PI * (1.0 - 1e-9)  # a move by a whole turn is meant
    if kind != 'rad' or not within or not jumps.any() or jumps.all():
        return values
    largest = np.abs(steps[~jumps]).max()
    if largest > _EVEN or TWO_PI - np.abs(steps[jumps]).min() > 2.0 * largest:
        return values
    times = counted(int(jumps.sum()), 'time')
    assume(f'{where}: whole turns are added where angles jump by one, {times}')
    return np.unwrap(values, period=TWO_PI / scale)


def _alike(said: str, asked: str) -> bool:
    """True if two units are the same, or one of them is none."""
    try:
        return to_si_text(f'1 {said}') == to_si_text(f'1 {asked}')
    except ValueError:  # a heading may have another remark in brackets
        return True


def allowed_file(where: str, folder: Path, name: str, more: Sequence[Path] = ()) -> Path:
    """Resolved path of a file in the folder of the scene, in one of more, or in an allowed one.

    They are searched in this order; a file below none of them is refused.
    """
    others = [x for x in os.environ.get(TABLE_FOLDERS, '').split(os.pathsep) if x]
    try:
        folders = [x.resolve() for x in (folder, *more, *map(path_of, others))]
        places = [(x / path_of(name)).resolve() for x in folders]
    except RuntimeError as error:  # of pathlib, for links in a circle
        raise InputError(f"{where}: '{name}' cannot be read: its links form a circle") from error
    allowed = [x for x in places if any(x.is_relative_to(above) for above in folders)]
    if not allowed:
        raise InputError(
            f"{where}: '{name}' lies outside the folder of the scene, '{folders[0]}': put it "
            f"there, or allow its folder by --tables-from '{places[0].parent}' or {TABLE_FOLDERS}"
        )
    found = next((x for x in allowed if os.path.exists(x)), None)
    if found is None:
        looked = "' nor in '".join(dict.fromkeys(map(str, folders)))
        raise InputError(
            f"{where}: '{name}' cannot be read: there is none in '{looked}'; put it there, or say "
            f'in which folder it is by --tables-from DIR or {TABLE_FOLDERS}'
        )
    return found
