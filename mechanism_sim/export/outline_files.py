"""Outlines in true size: as SVG, and as DXF [mm] with each curve on a layer of its own."""

from __future__ import annotations

import re
from io import StringIO
from xml.etree import ElementTree

from mechanism_sim.joints.sheets import Circle, Outline, Polygon
from mechanism_sim.packages import needed

#: margin of the picture, width of a line, half length of a line of a shaft's mark [mm]
MARGIN, LINE, _CROSS = 5.0, 0.25, 3.0


def to_dxf(outline: Outline) -> str:
    """The text of a DXF file (release 2010) with the outline.

    Edges and guides are polylines and circles on layers named after them, in capitals; guides are
    dashed. The layer SHAFT has two lines that cross at every shaft.
    """
    ezdxf = needed('ezdxf', 'drawings as DXF')
    document = ezdxf.new('R2010', setup=['linetypes'], units=ezdxf.units.MM)
    space = document.modelspace()
    for parts, linetype in ((outline.edges, 'CONTINUOUS'), (outline.guides, 'DASHED')):
        for part in parts:
            if not document.layers.has_entry(_layer(part)):
                document.layers.add(_layer(part), linetype=linetype)
            layer = {'layer': _layer(part)}
            if isinstance(part, Circle):
                centre = 1e3 * part.centre[0], 1e3 * part.centre[1]
                space.add_circle(centre, 1e3 * part.radius, dxfattribs=layer)
            else:
                space.add_lwpolyline(1e3 * part.points.T, close=part.closed, dxfattribs=layer)
    document.layers.add('SHAFT')
    for place in outline.shafts:
        u, v = (1e3 * c for c in place)
        for x, y in ((_CROSS, 0.0), (0.0, _CROSS)):
            space.add_line((u - x, v - y), (u + x, v + y), dxfattribs={'layer': 'SHAFT'})
    text = StringIO()
    document.write(text)
    return text.getvalue()


def _layer(part: Polygon | Circle) -> str:
    """Name of the layer of a part, without characters that DXF forbids."""
    return re.sub(r'[<>/\\":;?*|=`]', '_', part.name.upper())


def to_svg(outline: Outline) -> str:
    """The outline in millimetres: edges solid, guides dashed, a cross at each shaft.

    Ids of elements are the names of the curves. Curves are polygons.
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
    centres = ((1e3 * x, -1e3 * y) for x, y in outline.shafts)
    crosses = (
        f'M{x - _CROSS:g},{y:g}h{2 * _CROSS:g}M{x:g},{y - _CROSS:g}v{2 * _CROSS:g}'
        for x, y in centres
    )
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
        points = 'L'.join(f'{1e3 * x:.6f},{-1e3 * y:.6f}' for x, y in part.points.T)
        drawn = {'id': part.name, 'd': f'M{points}{"Z" if part.closed else ""}'}
        ElementTree.SubElement(parent, 'path', {**drawn, **style})
