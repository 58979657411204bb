"""Outlines as DXF for the workshop: millimetres, true size, each curve on a layer of its own."""

from __future__ import annotations

import re
from io import StringIO

from mechanism_sim.export.outlines import Circle, Outline, Polygon
from mechanism_sim.packages import needed

#: half the length of a line of the mark at the shaft [mm]
CROSS = 3.0


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
        for x, y in ((CROSS, 0.0), (0.0, CROSS)):
            space.add_line((u - x, v - y), (u + x, v + y), dxfattribs={'layer': 'SHAFT'})
    text = StringIO()
    document.write(text)
    return text.getvalue()


def _layer(part: Polygon | Circle) -> str:
    """Named after the part; some characters may not be in it."""
    return re.sub(r'[<>/\\":;?*|=`]', '_', part.name.upper())
