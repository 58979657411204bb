"""A machine with a worn pin, compared with the drawn one."""

from __future__ import annotations

from mechanism_sim.editor.rounding import rounded
from mechanism_sim.editor.sketch import PLAY, Edit, Grid, Sketch
from mechanism_sim.scene.schema import Scene

LEAST, MOST = 1e-6, 1e-2
"""[m] of a radial clearance."""

GRID = Grid(1e-3, 'mm')
"""Grid of the masses that are added to a loose machine without masses."""


def joints(scene: Scene) -> dict[str, float | None]:
    """Radial clearance [m] by pin that may wear; None for ideal ones."""
    return {
        name: joint.clearance.radial if joint.clearance else None
        for name, joint in scene.joints.items()
        if joint.kind == 'revolute' and not joint.stops
    }


def edits(sketch: Sketch, joint: str, radial: float) -> list[Edit]:
    """Edits for a clearance of a pin, and for masses that links need in free flight."""
    text = rounded(radial, 1e-7, 'mm')
    path = 'joints', joint, 'clearance'
    if sketch.scene.joints[joint].clearance:
        return [Edit((*path, 'radial'), text)]
    return [Edit(path, {**PLAY, 'radial': text}), *sketch.masses()]
