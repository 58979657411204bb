"""Readers of the file formats of other programs, and the scenes that they make."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mechanism_sim import documents
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.imports import joint_table, mjcf, outlines, pylinkage, sdf, urdf
from mechanism_sim.imports.blueprint import Blueprint, named, to_yaml
from mechanism_sim.keys.names import scene_errors
from mechanism_sim.packages import reason
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene, overridden

LARGEST = 1 << 24
"""Bytes of a file."""

Reader = Callable[[Path, str, str | None], Blueprint]

READERS: dict[str, Reader] = {
    '.csv': joint_table.read_table,
    '.json': pylinkage.read,
    '.dxf': outlines.read_dxf,
    '.sdf': sdf.read,
    '.svg': outlines.read_svg,
    '.urdf': urdf.read,
    '.xml': mjcf.read,
}
"""Readers by ending: of the path, the text, and the unit of lengths, if it is told."""

_METRIC = '.sdf', '.urdf', '.xml'  # formats whose lengths are in metres

_ADDRESSES = 'http://', 'https://'


@dataclass(frozen=True)
class Imported:
    """A scene from another program's file."""

    name: str  #: name of the scene
    data: Mapping[str, Any]  #: keys and values of the scene
    text: str  #: text of the scene as a YAML file
    notes: tuple[str, ...]  #: sentences on changed or missing contents of the file


def is_importable(source: str) -> bool:
    """True for addresses, and for files with the ending of a supported format."""
    return source.startswith(_ADDRESSES) or Path(source).suffix.lower() in READERS


def import_machine(
    source: Path | str,
    unit: str | None = None,
    overrides: Mapping[str, Any] | Iterable[str] = (),
    thickness: str | None = None,
    density: str = '7850 kg/m^3',
) -> Imported:
    """The scene of a planar machine in a file of another program, or in an address of PMKS+.

    Parameters
    ----------
    unit : unit of lengths, if the file does not state it, as 'mm'
    thickness, density : of drawn links, for their masses, as '5 mm', '7850 kg/m^3'
    overrides : keys missing in the file, as ``drive.speed=60 rpm``
    """
    name = str(source)
    if name.startswith(_ADDRESSES):
        stem, made = 'pmks', joint_table.read_address(name, unit)
    else:
        path = Path(source)
        ending = path.suffix.lower()
        if ending not in READERS:
            if ending in ('.yaml', '.yml'):
                raise InputError(f"'{name}' is a scene: check, solve and cycle read it as it is")
            raise InputError(
                f"'{name}': {ending or 'no ending'} is not a format that can be "
                f'imported{nearest(ending, READERS)}; those are {", ".join(READERS)}, and '
                'addresses of PMKS+ in quotes'
            )
        if unit and ending in _METRIC:
            raise InputError(f"'{name}' is in metres, as all {ending[1:]}: --unit does not apply")
        stem, made = path.stem, _read(READERS[ending], path, unit)
    outlines.weigh(made, thickness, density)
    with scene_errors(stem):
        data = overridden(stem, made.scene(), overrides)
    notes = list(made.notes)
    if 'drive' not in data:
        notes.append("the file defines no drive: --set 'drive.speed=60 rpm' adds one to the crank")
    if (
        thickness is None
        and 'gravity' not in data
        and any(isinstance(link, dict) and 'mass' in link for link in data['links'].values())
    ):
        notes.append(
            "the file has no gravity: --set 'gravity=[0 m/s^2, -9.81 m/s^2]' adds it where y is up"
        )
    try:
        build(stem, check_scene(stem, data))
    except InputError as error:  # written nevertheless, to be corrected by hand
        notes.append(str(error))
    return Imported(named(stem), data, to_yaml(data), tuple(notes))


def _read(reader: Reader, path: Path, unit: str | None) -> Blueprint:
    data = documents.limited(path, LARGEST, f"'{path}'", 'no machine needs as much')
    try:
        text = data.decode('utf-8-sig')
    except UnicodeDecodeError:
        raise InputError(f"'{path}' cannot be read: it is not text in UTF-8") from None
    try:
        return reader(path, text, unit)
    except InputError:
        raise
    except (ArithmeticError, AttributeError, LookupError, RecursionError, StopIteration, TypeError,
            ValueError) as error:  # fmt: skip
        raise InputError(f'{path.name} does not match its ending ({reason(error)})') from error
