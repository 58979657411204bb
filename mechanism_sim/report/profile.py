"""The parts that touch in a joint of a machine: their figures, and their outlines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mechanism_sim import output
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.export.outline_files import to_dxf, to_svg
from mechanism_sim.joints.sheets import JointParts, Outline, PartFigure, Sheet
from mechanism_sim.report.sections import Section, text
from mechanism_sim.scene.machine import Machine
from mechanism_sim.tables import Table
from mechanism_sim.units import for_people

WRITERS = {'.svg': to_svg, '.dxf': to_dxf}


FRICTION = 0.05
"""Coefficient between teeth, if none is given."""


def profile(
    machine: Machine, name: str, gear: str | None = None, friction: float | None = None
) -> Sheet:
    """Figures and outline of the cam, or of the gears, of a joint; bevel and worm pairs have none.

    Speeds are those at the start of the scene.

    Parameters
    ----------
    gear : gear of a mesh, for its outline only
    friction : coefficient for the efficiency of teeth, `FRICTION` if not given
    """
    every = _parts(machine)
    if not (parts := every.get(name)):
        there = any(j.name == name for j in machine.plan.ideal.joints)
        wrong = 'has neither cam nor teeth' if there else 'does not exist'
        raise InputError(
            f"{machine.name}: the joint '{name}' {wrong}{nearest(name, every)}; joints with a cam "
            f'or teeth: {", ".join(every) or "none"}'
        )
    if friction is not None and not parts.has_friction:
        raise InputError(
            f'{machine.name}: no figure of {name} depends on friction, only those of gears in '
            'mesh and of worms do'
        )
    if gear and parts.whole:
        raise InputError(f'{machine.name}: the joint {name} has {parts.whole}')
    return parts.sheet(gear, FRICTION if friction is None else friction)


def _parts(machine: Machine) -> dict[str, JointParts]:
    """Parts that touch in joints, by joints that have such parts."""
    return {
        j.name: parts(machine, j)
        for j in machine.plan.ideal.joints
        if (parts := machine.scene.joints[j.name].kind_keys.parts)
    }


def table(machine: Machine, name: str) -> Table:
    """A cam over its turn or stroke, (N,) by name, see `joints.cam.sheet`."""
    every = _parts(machine)
    found = every[name].table() if name in every else Table({})
    if not found:
        cams = [joint for joint, parts in every.items() if parts.table()]
        raise InputError(
            f'{machine.name}: --table is for cams, and {name} has none; joints with a cam: '
            f'{", ".join(cams) or "none"}'
        )
    return found


def write(outline: Outline | None, path: Path) -> None:
    """Write an outline in the format of the file's ending."""
    if outline is None:
        raise InputError(f'--output {path}: bevel and worm pairs have no outline in the plane')
    output.write_text(path, WRITERS[path.suffix](outline))


def render(sheet: Sheet) -> str:
    """Format the sheet as text: degrees and millimetres, and a column for each gear."""
    place, scale = for_people(sheet.place_unit)
    common = [
        # extremes between breaks of a law are found to about 1e-9
        _cells(f, '' if f.at is None else f'at {scale * (round(f.at, 9) + 0.0):g} {place}')
        for f in sheet.figures
        if '.' not in f.name
    ]
    own: dict[str, dict[str, PartFigure]] = {}
    for figure in sheet.figures:
        gear, dot, name = figure.name.partition('.')
        if dot:
            own.setdefault(name, {})[gear] = figure
    gears = list(dict.fromkeys(gear for row in own.values() for gear in row))
    columns = [('', *gears, '')] if gears else []
    for name, row in own.items():
        cells = [_cells(row[gear]) if gear in row else ('',) * 3 for gear in gears]
        unit = next(iter(cell[2] for cell in cells if cell[2]), '')
        columns.append((name.replace('_', ' '), *(cell[1] for cell in cells), unit))
    sections = Section(sheet.title, **_table(common)), Section(**_table(columns))
    return text([*sections, Section(notes=sheet.remarks)])


def to_json(sheet: Sheet) -> dict[str, object]:
    """Sheet for JSON, in SI units."""
    return {
        'figures': {
            f.name: {'value': f.value, 'unit': f.unit} | ({} if f.at is None else {'at': f.at})
            for f in sheet.figures
        },
        'remarks': list(sheet.remarks),
    }


def _cells(figure: PartFigure, *more: str) -> tuple[str, ...]:
    unit, scale = for_people(figure.unit)
    return figure.name.replace('_', ' '), f'{scale * figure.value:.6g}', unit, *more


def _table(rows: Sequence[tuple[str, ...]]) -> dict[str, Any]:
    """A table with numbers to the right; units and what follows them to the left."""
    columns = enumerate(zip(*rows, strict=True))
    texts = [i for i, cells in columns if not any(cell[:1].isdecimal() for cell in cells)]
    return {'table': rows, 'left': texts}
