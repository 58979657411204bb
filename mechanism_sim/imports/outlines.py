"""Links from outlines in drawings, DXF and SVG: holes are joints, areas give masses.

A layer, or a group of an SVG, is a link; the layer `ground` has the pivots. Coincident holes
of two links are a joint.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.export.shapes import encloses
from mechanism_sim.imports import svg
from mechanism_sim.imports.blueprint import Blueprint, BlueprintLink, names_of, unit_of
from mechanism_sim.packages import needed, reason
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.drawn_edges import DXF_UNITS, simple_entities
from mechanism_sim.units import counted, to_si

_FINE = 1e-7  # tolerance of polygons and of joined ends, as a share of the drawing's size
_SAME = 1e-6  # tolerance of coincident holes, as a share of the drawing's size
_CURVES = 'LINE', 'ARC', 'CIRCLE', 'ELLIPSE', 'SPLINE'
_MOST = 100_000  # entities of a drawing
_GROUNDS = 'ground', 'frame', 'base'


class DrawnCurve(NamedTuple):
    """A curve on a layer: its points (n, 2), and centre and radius of a circle."""

    layer: str
    points: Array
    centre: tuple[float, float] | None = None
    radius: float = 0.0
    closed: bool = True


class DrawnArea(NamedTuple):
    """Area, its centroid (2,), and polar second moment about the origin."""

    size: float
    centre: Array
    polar: float


def read_dxf(path: Path, text: str, unit: str | None) -> Blueprint:
    """The links of a DXF."""
    ezdxf = needed('ezdxf', 'drawings as DXF')
    try:
        document = ezdxf.read(StringIO(text))
        layers = {x.dxf.name.casefold(): x for x in document.layers}
        frozen = {name for name, layer in layers.items() if layer.is_frozen()}
        entities = (x for e in document.modelspace() for x in _parts(e, frozen))
        found = list(islice(entities, _MOST + 1))
        if len(found) > _MOST:
            raise InputError(
                f'{path.name} has more than {_MOST} entities with those of its blocks'
            )
        off = {name for name, layer in layers.items() if layer.is_off()}
        names = {name: layer.dxf.name for name, layer in layers.items()}
        parts = [
            (names.setdefault(n.casefold(), n), x)
            for n, x in found
            if n.casefold() not in off and x.dxftype() in _CURVES
        ]
        size = float(max((np.ptp(_points(e, 1.0), axis=0).max() for _, e in parts), default=1.0))
        drawn = [(part, _points(part[1], _FINE * size)) for part in parts]
    except ezdxf.DXFError as error:
        raise InputError(f'{path.name} cannot be read as DXF ({reason(error)})') from error
    curves: list[DrawnCurve] = []
    for (layer, entity), points in drawn:
        if entity.dxftype() == 'CIRCLE':
            middle = entity.ocs().to_wcs(entity.dxf.center)
            centre = (float(middle.x), float(middle.y))
            curves.append(DrawnCurve(layer, points, centre, float(entity.dxf.radius)))
        else:
            curves.append(DrawnCurve(layer, points, closed=False))
    unit = unit_of(path.name, DXF_UNITS.get(document.units, ''), unit)
    return blueprint(path.stem, unit, curves)


def _parts(entity: Any, frozen: set[str], above: str = '0') -> Iterator[tuple[str, Any]]:
    """Visible parts of an entity with their layers; 0 in a block is the layer of its reference.

    A reference on a frozen layer has none; if its layer is off, parts on other layers are shown.
    """
    layer = above if entity.dxf.layer == '0' else str(entity.dxf.layer)
    if entity.dxf.invisible or layer.casefold() in frozen:
        return
    if entity.dxftype() == 'INSERT':
        yield layer, entity
        for block in entity.multi_insert() if entity.mcount > 1 else (entity,):
            for part in block.virtual_entities():
                yield from _parts(part, frozen, layer)
    else:
        yield from ((layer, part) for part in simple_entities(entity))


def _points(entity: Any, near: float) -> Array:
    """Points (n, 2) of an entity, whose chords are within a distance of it."""
    line = entity.dxftype() == 'LINE'
    found = (entity.dxf.start, entity.dxf.end) if line else entity.flattening(near)
    return np.array([[p.x, p.y] for p in found])


def read_svg(path: Path, text: str, unit: str | None) -> Blueprint:
    """The links of an SVG, whose groups are named by their ids."""
    given, found = svg.curves(path.name, text, unit)
    return blueprint(path.stem, given, [DrawnCurve(*curve) for curve in found])


def blueprint(title: str, unit: str, drawn: Sequence[DrawnCurve]) -> Blueprint:
    """The machine of the curves of a drawing; links have outlines, but no masses yet."""
    if not unit:
        raise InputError(f'{title}: the drawing does not state its unit: give --unit mm')
    made = Blueprint(title, unit)
    drawn = _chained([c for c in drawn if c.points.size and np.ptp(c.points, axis=0).any()])
    curves = [curve for curve in drawn if curve.closed]
    layers = list(dict.fromkeys(curve.layer for curve in curves))
    if not curves:
        raise InputError(f'{title}: there is no closed curve in the drawing')
    moving = {x: x.lower() if x.isupper() else x for x in layers if x.lower() not in _GROUNDS}
    if not moving:
        raise InputError(f'{title}: there is no link: closed curves are on {layers[0]} alone')
    named = names_of(moving.values(), 'links')
    names = {layer: named[x] for layer, x in moving.items()}
    everything = np.concatenate([curve.points for curve in curves])
    size = float(np.ptp(everything, axis=0).max())
    holes: list[tuple[str, str, tuple[float, float]]] = []
    for layer in layers:
        own = [curve for curve in curves if curve.layer == layer]
        link = names.get(layer, GROUND)
        outer = max(own, key=lambda curve: abs(_area(curve).size))
        inner = [c for c in own if c is not outer] if link != GROUND else own
        round_ = [c.centre for c in inner if c.centre]
        centre = (0.0, 0.0) if link == GROUND else (*round_, outer.centre or (0.0, 0.0))[0]
        part = made.links.setdefault(link, BlueprintLink((*centre, 0.0)))
        for k, at in enumerate(round_):
            part.points[f'hole_{k + 1}'] = part.local(at)
            holes.append((link, f'hole_{k + 1}', at))
        if link != GROUND:
            loose = [curve for curve in drawn if curve.layer == layer and not curve.closed]
            made.notes += _loose(f'{title}: {layer}', unit, [outer, *inner], loose)
            if stray := next((curve for curve in inner if not _within(outer, curve)), None):
                x, y = _middle(stray)
                raise InputError(
                    f'{title}: {layer} has two outlines: the one around ({x:.6g}, {y:.6g}) {unit} '
                    'is not within the largest; a link is one plate with its holes'
                )
            made.outlines[link] = [
                _area(outer),
                *(_area(c)._replace(size=-_area(c).size) for c in inner),
            ]
    made.notes += [
        f'{layer}: left out: no curve on it is closed'
        for layer in dict.fromkeys(curve.layer for curve in drawn)
        if layer not in layers
    ]
    while holes:  # the first link at a position carries the others
        (one, a, at), *others = holes
        here = [hole for hole in others if math.dist(at, hole[2]) < _SAME * size]
        holes = [hole for hole in others if hole not in here]
        for other, b, _ in here:
            if other != one:
                made.join(f'{one}_{other}', 'revolute', (one, a), (other, b))
    return made


def _within(outer: DrawnCurve, curve: DrawnCurve) -> bool:
    """True if a curve is inside a closed one, or touches it from inside."""
    points, middle = curve.points[:: len(curve.points) // 64 + 1], _middle(curve)
    return all(encloses(outer.points, p) for p in middle + (1.0 - _SAME) * (points - middle))


def _middle(curve: DrawnCurve) -> Array:
    return np.array(0.5 * (curve.points.min(axis=0) + curve.points.max(axis=0)))


def _loose(
    where: str, unit: str, own: Sequence[DrawnCurve], loose: Sequence[DrawnCurve]
) -> Iterator[str]:
    """A note of open curves, on a layer whose largest closed curve is its outline.

    It is the outline if all other closed curves are inside it, or if the open ones are too or
    pass through it. Concentric circles may be a hole of an outline that does not close: they
    are an outline only if no open curve surrounds them.

    Parameters
    ----------
    own : closed curves of the layer, the largest first
    """
    if not loose:
        return
    outer, inner = own[0], own[1:]
    low, high = outer.points.min(axis=0), outer.points.max(axis=0)
    near = 0.5 * float((high - low).min())
    middle = _middle(outer)
    beside = [curve for curve in loose if _apart(curve.points, middle) > near]
    around = np.concatenate([outer.points[:0], *(curve.points for curve in beside)])
    if all(_within(outer, curve) for curve in inner):
        about_one = all(math.dist(_middle(curve), middle) < _SAME * near for curve in inner)
        sides = [(around < low).any(axis=0), (around > high).any(axis=0)]
        beyond = about_one and np.all(sides)
    else:
        beyond = ((around < low) | (around > high)).any()
    if not beyond:
        yield f'{where}: left out: {counted(len(loose), "open curve")}'
        return
    ends = np.concatenate([curve.points[[0, -1]] for curve in beside])
    gaps = np.hypot(*(ends[:, None] - ends).T)
    np.fill_diagonal(gaps, np.inf)
    k = int(gaps.argmin()) // len(ends)
    x, y = ends[k]
    raise InputError(
        f'{where}: its outline does not close: there is a gap of {gaps.min():.3g} {unit} at '
        f'({x:.6g}, {y:.6g}) {unit}'
    )


def _apart(points: Array, place: Array) -> float:
    """Distance of a position (2,) from lines between points (n, 2)."""
    begin, way = points[:-1], np.diff(points, axis=0)
    square = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
    along = np.clip(((place - begin) * way).sum(axis=1) / square, 0.0, 1.0)
    return float(np.hypot(*(begin + along[:, None] * way - place).T).min())


def weigh(made: Blueprint, thickness: str | None, density: str) -> None:
    """Give links the masses of plates with their outlines."""
    if not made.outlines:
        if thickness:
            raise InputError('--thickness is for drawings: this file gives the masses of links')
        return
    if thickness is None:
        made.notes.append('links have no mass: give --thickness')
        return
    metre = to_si(f'1 {made.unit}', 'm')
    plate = to_si(thickness, 'm') * to_si(density, 'kg/m^3') * metre**2
    for link, parts in made.outlines.items():
        size = math.fsum(part.size for part in parts)
        if size <= 0.0:
            raise InputError(f'{link}: its holes are larger than its outline')
        centre = sum(part.size * part.centre for part in parts) / size
        polar = math.fsum(math.copysign(part.polar, part.size) for part in parts)
        around = (polar - size * float(centre @ centre)) * metre**2
        at = made.links[link].local((float(centre[0]), float(centre[1])))
        made.links[link].keys = {
            'mass': f'{plate * size!r} kg', 'inertia': f'{plate * around!r} kg m^2',
            'cog': made.vector(at),
        }  # fmt: skip


def _area(curve: DrawnCurve) -> DrawnArea:
    if curve.centre:
        size, middle = math.pi * curve.radius**2, np.array(curve.centre)
        return DrawnArea(size, middle, size * (0.5 * curve.radius**2 + float(middle @ middle)))
    (x, y), (u, v) = curve.points.T, np.roll(curve.points, -1, axis=0).T
    cross = x * v - u * y
    size = 0.5 * float(cross.sum())
    if not size:
        raise InputError(f'a closed curve of {curve.layer} has no area')
    centre = np.array([((x + u) * cross).sum(), ((y + v) * cross).sum()]) / (6.0 * size)
    polar = float((cross * (x * x + x * u + u * u + y * y + y * v + v * v)).sum()) / 12.0
    return DrawnArea(abs(size), centre, math.copysign(polar, 1.0))


def _chained(curves: Sequence[DrawnCurve]) -> list[DrawnCurve]:
    """Closed curves, and on each layer the chains of open ones, which may be closed."""
    pieces: dict[str, list[Array]] = {}
    for curve in curves:
        if not curve.closed:
            pieces.setdefault(curve.layer, []).append(curve.points)
    near = 10.0 * _FINE * max((float(np.ptp(c.points, axis=0).max()) for c in curves), default=0.0)
    chains = (chain for layer, own in pieces.items() for chain in _chains(layer, own, near))
    return [*(curve for curve in curves if curve.closed), *chains]


def _chains(layer: str, pieces: list[Array], near: float) -> Iterator[DrawnCurve]:
    """Chains of curves that are connected at their ends."""
    left = list(pieces)
    while left:
        chain, turned = left.pop(0), False
        while not (closed := np.abs(chain[0] - chain[-1]).max() <= near):
            for k, piece in enumerate(left):
                ahead = piece if np.abs(piece[0] - chain[-1]).max() <= near else piece[::-1]
                if np.abs(ahead[0] - chain[-1]).max() <= near:
                    chain = np.concatenate([chain, ahead[1:]])
                    del left[k]
                    break
            else:
                if turned:
                    break
                chain, turned = chain[::-1], True  # curves at its start
        yield DrawnCurve(layer, chain[:-1] if closed else chain, closed=bool(closed))
