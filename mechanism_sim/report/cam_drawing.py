"""Profiles of cams as SVG, in true size."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.cams.profiles import Cam, drawing_angles

Array = NDArray[np.float64]

#: [mm]
MARGIN = 5.0
LINE = 0.25


def cam_svg(cam: Cam, clearance: float | None = None, step: float = math.radians(0.1)) -> str:
    """The profile, the pitch curve and the base circle at cam angle 0, in millimetres.

    Curves are drawn as polygons; a step of 0.1 deg keeps a radius of 100 mm to 0.05 um.

    Parameters
    ----------
    clearance : of the roller in a groove [m], which then has both walls; None: no groove
    step : cam angle between the points of curves [rad]
    """
    angles = drawing_angles(cam.law, step)
    touch = cam.at(angles)
    curves = {'profile': touch.profile}
    if clearance is not None:
        curves = dict(zip(('inner', 'outer'), cam.groove(angles, clearance), strict=True))
    size = 1e3 * max(float(np.hypot(*c).max()) for c in (*curves.values(), touch.pitch)) + MARGIN
    root = ElementTree.Element(
        'svg',
        xmlns='http://www.w3.org/2000/svg',
        width=f'{2 * size:.3f}mm',
        height=f'{2 * size:.3f}mm',
        viewBox=f'{-size:.3f} {-size:.3f} {2 * size:.3f} {2 * size:.3f}',
    )
    lines = ElementTree.SubElement(root, 'g', {'fill': 'none', 'stroke': 'black'})
    thin = {'stroke-width': f'{LINE / 2}', 'stroke-dasharray': '2 1'}
    for name, curve in curves.items():
        attributes = {'id': name, 'd': _path(curve), 'stroke-width': f'{LINE}'}
        ElementTree.SubElement(lines, 'path', attributes)
    ElementTree.SubElement(lines, 'path', {'id': 'pitch', 'd': _path(touch.pitch), **thin})
    base = f'{1e3 * cam.base_radius:.6f}'
    ElementTree.SubElement(lines, 'circle', {'id': 'base', 'r': base, **thin})
    cross = {'id': 'camshaft', 'd': 'M-3,0L3,0M0,-3L0,3', 'stroke-width': f'{LINE / 2}'}
    ElementTree.SubElement(lines, 'path', cross)
    return ElementTree.tostring(root, encoding='unicode')


def _path(curve: Array) -> str:
    """A closed polygon; the picture's y axis points down."""
    return 'M' + 'L'.join(f'{1e3 * x:.6f},{-1e3 * y:.6f}' for x, y in curve.T) + 'Z'
