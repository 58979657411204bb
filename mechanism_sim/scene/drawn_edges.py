"""Lines and arcs of a drawing in a DXF, as keys of the profile of a cam."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mechanism_sim.errors import InputError, check_known
from mechanism_sim.packages import needed

DXF_UNITS = {1: 'inch', 2: 'ft', 4: 'mm', 5: 'cm', 6: 'm'}
"""Units of lengths by $INSUNITS of a DXF."""


def drawn_edges(path: Path, where: str, layer: str | None, unit: str | None) -> list[Any]:
    """The edges of a drawing, or of one of its layers, with units.

    Parameters
    ----------
    where : the file and key that name it, which begin each sentence about it
    unit : unit of lengths, if not that of the drawing
    """
    where = f"{where}: '{path.name}'"
    ezdxf = needed('ezdxf', 'profiles from drawings')
    try:
        document = ezdxf.readfile(path)
        parts = [x for entity in document.modelspace() for x in simple_entities(entity)]
    except (OSError, ezdxf.DXFError) as error:
        raise InputError(f'{where} cannot be read as DXF: {error}') from error
    unit = unit or DXF_UNITS.get(document.units)
    if unit is None:
        raise InputError(f"{where} does not state its unit: add 'units: mm'")
    layers = dict.fromkeys(str(x.dxf.layer) for x in parts)
    if layer is None and len(layers) > 1:
        raise InputError(
            f"{where} has edges on several layers: name one as 'layer': {', '.join(layers)}"
        )
    if layer is not None:
        check_known(layer, layers, f"{where} has no edges on a layer '{layer}'", 'its layers:')
    chosen = [x for x in parts if layer in (None, str(x.dxf.layer))]
    if other := next((x.dxftype() for x in chosen if x.dxftype() not in _KEYS), None):
        raise InputError(
            f'{where} has a {other}: a profile is of lines, arcs, circles and polylines'
        )
    return [_KEYS[x.dxftype()](x.dxf, unit) for x in chosen]


def simple_entities(entity: Any) -> Iterator[Any]:
    """An entity of a drawing in a DXF that is no text; of a polyline its lines and arcs."""
    if entity.dxftype() in ('LWPOLYLINE', 'POLYLINE'):
        yield from entity.virtual_entities()
    elif entity.dxftype() not in ('TEXT', 'MTEXT', 'DIMENSION', 'POINT', 'HATCH'):
        yield entity


def _point(at: Any, unit: str) -> list[str]:
    return [f'{x!r} {unit}' for x in (float(at.x), float(at.y))]


def _line(dxf: Any, unit: str) -> dict[str, Any]:
    return {'line': [_point(dxf.start, unit), _point(dxf.end, unit)]}


def _circle(dxf: Any, unit: str) -> dict[str, Any]:
    return {'arc': _point(dxf.center, unit), 'radius': f'{float(dxf.radius)!r} {unit}'}


def _arc(dxf: Any, unit: str) -> dict[str, Any]:
    begin, end = (f'{float(x)!r} deg' for x in (dxf.start_angle, dxf.end_angle))
    return _circle(dxf, unit) | {'from': begin, 'to': end}


_KEYS = {'LINE': _line, 'ARC': _arc, 'CIRCLE': _circle}
