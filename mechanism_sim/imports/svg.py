"""Curves of an SVG as polygons, y upwards."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from xml.etree.ElementTree import Element

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, quoted
from mechanism_sim.imports.blueprint import unit_of
from mechanism_sim.imports.markup import number, numbers, parse

_STEPS = np.linspace(0.0, 1.0, 257)[1:]  # parameters of points of a curve
_NUMBER = re.compile(r'[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?')
_TOKEN = re.compile(rf'[\s,]*(?:([MmLlHhVvCcSsQqTtAaZz])|({_NUMBER.pattern}))')
_FLAG = re.compile(r'[\s,]*()([01])')
_COUNTS = {'m': 2, 'l': 2, 'h': 1, 'v': 1, 'c': 6, 's': 4, 'q': 4, 't': 2, 'a': 7, 'z': 0}
_SMOOTH = {'s': ('c', 's'), 't': ('q', 't')}  # curves that continue the previous tangent
_LENGTH = re.compile(r'\s*([\d.eE+-]+)\s*(mm|cm|in|px|pt)?\s*')
_PAPER = {'mm': 1.0, 'cm': 10.0, 'in': 25.4, 'pt': 25.4 / 72.0}  # [mm]
_PIXEL = 25.4 / 96.0  # [mm]
_DEEPEST, _MOST = 100, 100_000  # nested groups; shapes and groups, clones included

Found = tuple[str, Array, tuple[float, float] | None, float, bool]
"""Layer, points (n, 2), centre and radius of a circle, and True if it is closed."""


def curves(file: str, text: str, told: str | None) -> tuple[str, list[Found]]:
    """Unit of lengths, and the curves of a drawing.

    Parameters
    ----------
    told : unit of user lengths of a drawing without a size on paper; else 96 pixels an inch
    """
    root = parse(file, text, 'svg')
    sizes = [_LENGTH.fullmatch(root.get(key) or '') for key in ('width', 'height')]
    stated = next((size[2] for size in sizes if size and size[2] in _PAPER), '')
    unit_of(file, stated, told)
    unit, (x, y) = (told, (1.0, 1.0)) if told and not stated else ('mm', _scales(root, sizes))
    frame, known = np.diag([x, -y, 1.0]), {x.get('id', ''): x for x in root.iter() if x.get('id')}
    return unit, list(_walk(root, frame, '', 0, known, iter(range(_MOST))))


def _scales(root: Element, sizes: list[re.Match[str] | None]) -> tuple[float, float]:
    """Lengths [mm] of a user unit, across and upwards (SVG 1.1, 7.8).

    Parameters
    ----------
    sizes : width and height as stated, and their units
    """
    box = numbers(root.get('viewBox'), 4)[2:].tolist()
    found = [
        float(size[1]) * _PAPER.get(size[2], _PIXEL) / own
        for size, own in zip(sizes, box, strict=True)
        if size and own
    ]
    fit = (root.get('preserveAspectRatio') or '').split()
    if not found:
        return _PIXEL, _PIXEL
    if 'none' in fit:
        return found[0], found[-1]
    scale = max(found) if 'slice' in fit else min(found)
    return scale, scale


_HIDDEN = re.compile(r'(?:^|[;:\s])display\s*:\s*none|(?:^|[;:\s])visibility\s*:\s*hidden')
"""Attributes or styles of what no viewer shows."""


def _walk(
    elements: Iterable[Element],
    frame: Array,
    layer: str,
    depth: int,
    known: Mapping[str, Element],
    budget: Iterator[int],
) -> Iterator[Found]:
    """Curves of visible elements; `known` are all elements by id, to which clones refer."""
    if depth > _DEEPEST:
        raise InputError(f'groups nested more than {_DEEPEST} deep')
    for child in elements:
        if _HIDDEN.search(';'.join(f'{key}:{value}' for key, value in child.attrib.items())):
            continue
        if next(budget, None) is None:
            raise InputError(f'the drawing has more than {_MOST} shapes with those of its clones')
        own = frame @ _transform(child.get('transform') or '')
        name = next((v for k, v in child.attrib.items() if k.endswith('label')), child.get('id'))
        if child.tag in ('g', 'svg', 'a'):
            yield from _walk(child, own, name or layer, depth + 1, known, budget)
            continue
        if child.tag == 'use':  # a clone has the name of its own group
            link = next((v for k, v in child.attrib.items() if k.endswith('href')), '')
            if (target := known.get(link.removeprefix('#'))) is None:
                raise InputError(f'the clone of {quoted(link)} has no original in the drawing')
            own = own @ _moved(_own(child.get('x')), _own(child.get('y')))
            parts: Iterable[Element] = [target]
            if target.tag in ('g', 'svg', 'symbol'):
                parts, own = target, own @ _transform(target.get('transform') or '')
            yield from _walk(parts, own, layer or name or '', depth + 1, known, budget)
            continue
        where = layer or name or 'link'
        if child.tag in ('circle', 'ellipse'):
            yield _round(child, own, where)
            continue
        for points, closed in _shapes(child):
            yield where, points @ own[:2, :2].T + own[:2, 2], None, 0.0, closed


def _round(element: Element, frame: Array, layer: str) -> Found:
    get = element.get
    at = frame @ [_own(get('cx')), _own(get('cy')), 1.0]
    radii = [_own(get(key) or get('r')) for key in ('rx', 'ry')]
    angle = 2.0 * math.pi * _STEPS
    ring = np.array([radii[0] * np.cos(angle), radii[1] * np.sin(angle)])
    points = (frame[:2, :2] @ ring).T + at[:2]
    radius = math.sqrt(abs(np.linalg.det(frame[:2, :2])) * radii[0] * radii[1])
    is_round = np.ptp(np.hypot(*(points - at[:2]).T)) < 1e-9 * radius
    return layer, points, (float(at[0]), float(at[1])) if is_round else None, radius, True


def _own(text: str | None) -> float:
    """A length of a shape, in user units of the drawing."""
    own = (text or '').strip()
    if own and not _NUMBER.fullmatch(own):
        raise InputError(f"'{own}' is the length of a shape: give a number without % or unit")
    return number(own)


def _shapes(element: Element) -> Iterator[tuple[Array, bool]]:
    """Curves of a shape, each with True if it is closed by itself."""
    get = element.get
    if element.tag == 'rect':
        yield _rectangle(element), True
    elif element.tag == 'line':
        ends = [_own(get(key)) for key in ('x1', 'y1', 'x2', 'y2')]
        yield np.array(ends).reshape(-1, 2), False
    elif element.tag in ('polygon', 'polyline'):
        found = [float(v) for v in _NUMBER.findall(get('points') or '')]
        points = np.array(found[: len(found) // 2 * 2]).reshape(-1, 2)
        yield points, element.tag == 'polygon'
    elif element.tag == 'path':
        for part in _paths(get('d') or ''):
            yield np.array([[p.real, p.imag] for p in part]), part[0] == part[-1]


def _rectangle(element: Element) -> Array:
    """The four sides, with corners rounded by quarters of ellipses."""
    x, y, w, h = (_own(element.get(key)) for key in ('x', 'y', 'width', 'height'))
    radii = [element.get(key, 'auto') for key in ('rx', 'ry')]
    own = [r for r in radii if r != 'auto']  # a missing radius equals the other
    rx, ry = (_own(r if r != 'auto' else own[0] if own else '0') for r in radii)
    rx, ry = (min(max(rx, 0.0), 0.5 * w), min(max(ry, 0.0), 0.5 * h))
    if not rx or not ry:
        return np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])
    right, low = x + w, y + h
    sides = [
        (complex(x + rx, y), complex(right - rx, y)),
        (complex(right, y + ry), complex(right, low - ry)),
        (complex(right - rx, low), complex(x + rx, low)),
        (complex(x, low - ry), complex(x, y + ry)),
    ]
    points = []
    for (_, end), (begin, _) in pairwise([*sides, sides[0]]):
        points += [end, *_arc(end, begin, [rx, ry, 0.0, 0.0, 1.0])]
    return np.array([[p.real, p.imag] for p in points])


def _paths(text: str) -> Iterator[list[complex]]:
    """Subpaths of the data of a path; closed ones end at their first point."""
    place, before = 0j, ''
    points: list[complex] = []
    handle = 0j  # for a smooth curve after one of the same kind
    for command, values in _commands(text):
        kind, last = command.lower(), before
        before = kind
        base = place if command.islower() else 0j
        if kind == 'z':
            yield [*points, points[0]]
            place = points[0]
            points = [place]
            continue
        if kind == 'a':
            end = base + complex(*values[5:])
            points += _arc(place, end, values)
        elif kind in 'hv':
            part = values[0]
            end = complex(part + base.real, place.imag) if kind == 'h' else complex(
                place.real, part + base.imag)  # fmt: skip
            points.append(end)
        else:
            given = [base + complex(*values[i : i + 2]) for i in range(0, len(values), 2)]
            if kind in _SMOOTH:
                given.insert(0, 2.0 * place - handle if last in _SMOOTH[kind] else place)
            end = given[-1]
            handle = given[-2] if len(given) > 1 else end
            if kind == 'm':
                if len(points) > 1:
                    yield points
                points = [end]
            else:
                points += _bezier([place, *given])
        place = end
    if len(points) > 1:
        yield points


def _commands(text: str) -> Iterator[tuple[str, list[float]]]:
    """Commands of the data of a path, each with its numbers; a flag of an arc is one digit."""
    text, at, command = text.strip(), 0, ''
    if text and text[0] not in 'Mm':
        raise InputError(f"the path '{text[:40]}' does not begin with M")
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found and found[1]:
            command, at = found[1], found.end()
        elif not found or command in ('', 'Z', 'z'):
            raise InputError(f"the path '{text[:40]}' cannot be read")
        values: list[float] = []
        while len(values) < _COUNTS[command.lower()]:
            flag = command in 'Aa' and len(values) in (3, 4)
            found = (_FLAG if flag else _TOKEN).match(text, at)
            if not found or not found[2]:
                raise InputError(f"the path '{text[:40]}' ends within a command")
            values.append(float(found[2]))
            at = found.end()
        yield command, values
        command = {'m': 'l', 'M': 'L'}.get(command, command)  # lines may follow without a letter


def _bezier(control: list[complex]) -> list[complex]:
    """Points of a curve after its first, by de Casteljau."""
    if len(control) == 2:
        return control[1:]
    rows = [np.full(len(_STEPS), c) for c in control]
    while len(rows) > 1:
        rows = [a + (b - a) * _STEPS for a, b in pairwise(rows)]
    return [complex(p) for p in rows[0]]


def _arc(start: complex, end: complex, values: list[float]) -> list[complex]:
    """Points of an elliptic arc after its first (SVG 1.1, F.6)."""
    rx, ry, turn, large, sweep = (abs(values[0]), abs(values[1]), *values[2:5])
    if not rx or not ry or start == end:
        return [end]
    spin = complex(math.cos(math.radians(turn)), math.sin(math.radians(turn)))
    half = 0.5 * (start - end) / spin
    unit = complex(half.real / rx, half.imag / ry)
    grow = max(1.0, abs(unit))
    unit /= grow
    off = math.sqrt(max(0.0, 1.0 / abs(unit) ** 2 - 1.0)) * (-1.0 if large == sweep else 1.0)
    middle = complex(off * unit.imag, -off * unit.real)
    first = math.atan2((unit - middle).imag, (unit - middle).real)
    last = math.atan2((-unit - middle).imag, (-unit - middle).real)
    way = (last - first) % (2.0 * math.pi) - (0.0 if sweep else 2.0 * math.pi)
    angles = first + way * _STEPS
    ring = grow * (rx * (np.cos(angles) + middle.real) + 1j * ry * (np.sin(angles) + middle.imag))
    return [complex(p) for p in 0.5 * (start + end) + ring * spin]


def _moved(x: float, y: float) -> Array:
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def _transform(text: str) -> Array:
    """The matrix (3, 3) of a list of transformations."""
    found = np.eye(3)
    for name, given in re.findall(r'(\w+)\s*\(([^)]*)\)', text):
        v = [float(x) for x in _NUMBER.findall(given)]
        step = np.eye(3)
        if name == 'matrix' and len(v) == 6:
            step[:2] = np.reshape(v, (3, 2)).T
        elif name == 'translate' and v:
            step = _moved(v[0], v[1] if len(v) > 1 else 0.0)
        elif name == 'scale' and v:
            step = np.diag([v[0], v[-1], 1.0])
        elif name == 'rotate' and v:
            x, y = v[1:3] if len(v) > 2 else (0.0, 0.0)
            c, s = math.cos(math.radians(v[0])), math.sin(math.radians(v[0]))
            step[:2, :2] = [[c, -s], [s, c]]
            step = _moved(x, y) @ step @ _moved(-x, -y)
        elif name in ('skewX', 'skewY') and len(v) == 1:
            step[(0, 1) if name == 'skewX' else (1, 0)] = math.tan(math.radians(v[0]))
        else:
            raise InputError(f"'{name}({given})' is not a supported transformation")
        found = found @ step
    return found
