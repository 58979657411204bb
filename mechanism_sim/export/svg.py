"""Outlines as SVG, in true size."""

from __future__ import annotations

from xml.etree import ElementTree

from mechanism_sim.export.outlines import Circle, Outline, Polygon

#: [mm]
MARGIN = 5.0
LINE = 0.25
CROSS = 3.0


def to_svg(outline: Outline) -> str:
    """The outline in millimetres: edges drawn through, guides dashed, a cross at each shaft.

    Elements have the names of the curves as their ids. Curves are polygons.
    """
    low, high = 1e3 * outline.box
    left, top = low[0] - MARGIN, -high[1] - MARGIN  # the picture's y axis points down
    width, height = high - low + 2.0 * MARGIN
    root = ElementTree.Element(
        'svg',
        xmlns='http://www.w3.org/2000/svg',
        width=f'{width:.3f}mm',
        height=f'{height:.3f}mm',
        viewBox=f'{left:.3f} {top:.3f} {width:.3f} {height:.3f}',
    )
    lines = ElementTree.SubElement(root, 'g', {'fill': 'none', 'stroke': 'black'})
    thin = {'stroke-width': f'{LINE / 2}', 'stroke-dasharray': '2 1'}
    for edge in outline.edges:
        _draw(lines, edge, {'stroke-width': f'{LINE}'})
    for guide in outline.guides:
        _draw(lines, guide, thin)
    crosses = (_cross(1e3 * x, -1e3 * y) for x, y in outline.shafts)
    shaft = {'id': 'shaft', 'd': ''.join(crosses)}
    ElementTree.SubElement(lines, 'path', {**shaft, 'stroke-width': f'{LINE / 2}'})
    return ElementTree.tostring(root, encoding='unicode')


def _draw(parent: ElementTree.Element, part: Polygon | Circle, style: dict[str, str]) -> None:
    if isinstance(part, Circle):
        x, y = part.centre
        shape = {'id': part.name, 'r': f'{1e3 * part.radius:.6f}'}
        if (x, y) != (0.0, 0.0):
            shape |= {'cx': f'{1e3 * x:.6f}', 'cy': f'{-1e3 * y:.6f}'}
        ElementTree.SubElement(parent, 'circle', {**shape, **style})
    else:
        ElementTree.SubElement(parent, 'path', {'id': part.name, 'd': _path(part), **style})


def _cross(x: float, y: float) -> str:
    return f'M{x - CROSS:g},{y:g}h{2 * CROSS:g}M{x:g},{y - CROSS:g}v{2 * CROSS:g}'


def _path(curve: Polygon) -> str:
    points = 'L'.join(f'{1e3 * x:.6f},{-1e3 * y:.6f}' for x, y in curve.points.T)
    return f'M{points}{"Z" if curve.closed else ""}'
