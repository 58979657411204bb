"""Drawn shapes of links at the start: a drawing for DXF, plates for STL."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.export.outline_files import to_dxf
from mechanism_sim.export.shapes import PIN
from mechanism_sim.export.skeleton import Skeleton, skeleton_of
from mechanism_sim.export.triangles import triangles
from mechanism_sim.joints.sheets import Circle, Outline, Polygon
from mechanism_sim.planar.mechanism import Revolute
from mechanism_sim.scene.machine import Machine

_THICK = 0.5  # thickness of a plate, in symbols


def drawing(machine: Machine) -> str:
    """A DXF of a machine: outlines of each link on its layer, and holes at its pivots.

    Lengths are those of the machine, and cams those of `draw --profile` with no clearance of a
    groove. Teeth and circles are polygons as in pictures, 14 edges a flank and 96 a circle: within
    0.015 of a module, 0.0006 of a radius. Widths are those of pictures, too. Imported again it is
    the machine, with the masses of these plates.
    """
    skeleton, poses = _drawn(machine)
    plates = _plates(skeleton, poses, in_full=True)
    edges = [Polygon(link, curve.T) for link, group in plates for curve in group]
    holes = [
        Circle(link, 0.5 * PIN * skeleton.symbol, (float(x), float(y)))
        for joint in machine.plan.joints
        if isinstance(joint, Revolute)
        for link, at in joint.points
        for x, y in skeleton.placed(link, np.array([at]), poses)[0]
    ]
    return to_dxf(Outline(tuple(edges), tuple(dict.fromkeys(holes)), ()))


def to_stl(machine: Machine) -> str:
    """An STL of a machine in millimetres, as usual for printers: the format has no unit.

    Each link is a solid of its name; solids are stacked.
    """
    skeleton, poses = _drawn(machine)
    thick = _THICK * skeleton.symbol
    facets: dict[str, list[str]] = {}
    for link, curves in _plates(skeleton, poses):
        low = 1.5 * thick * skeleton.links.index(link) if link in skeleton.links else -1.5 * thick
        found = facets.setdefault(link, [])
        found += (_facet(1e3 * corners) for corners in _extruded(curves, low, low + thick))
    solids = (f'solid {name}\n{"".join(rows)}endsolid {name}\n' for name, rows in facets.items())
    return ''.join(solids)


def _drawn(machine: Machine) -> tuple[Skeleton, Array]:
    q = machine.assembly.q[:, None]
    skeleton = skeleton_of(machine, q, mechanism=machine.plan.ideal)
    return skeleton, skeleton.poses(q)


def _plates(
    skeleton: Skeleton, poses: Array, in_full: bool = False
) -> Iterator[tuple[str, list[Array]]]:
    """Links, and world curves (k, 2) that bound a plate; holes are clockwise.

    Parameters
    ----------
    in_full : with all points of bodies, not only those for pictures
    """
    for shape in skeleton.shapes:
        whole = (shape.edges,) if in_full and shape.edges else ()
        painted = (path.curves for path in shape.paths if path.style in ('body', 'plate'))
        for curves in whole or painted:
            yield shape.link, [skeleton.placed(shape.link, c, poses)[0] for c in curves]


def _extruded(curves: list[Array], low: float, high: float) -> Iterator[Array]:
    """Triangles (3, 3) of a plate, counterclockwise from outside."""
    for corners in triangles(curves):
        yield np.column_stack([corners, np.full(3, high)])
        yield np.column_stack([corners[::-1], np.full(3, low)])
    for curve in curves:
        for (x, y), (u, v) in zip(curve, np.roll(curve, -1, axis=0), strict=True):
            yield np.array([[x, y, low], [u, v, low], [u, v, high]])
            yield np.array([[x, y, low], [u, v, high], [x, y, high]])


def _facet(corners: Array) -> str:
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal) or 1.0
    rows = ''.join(f'    vertex {x:.9g} {y:.9g} {z:.9g}\n' for x, y, z in corners)
    head = ' '.join(f'{x:.6g}' for x in normal)
    return f'  facet normal {head}\n   outer loop\n{rows}   endloop\n  endfacet\n'
