"""Scenes of machines whose links and shafts do not give way."""

from __future__ import annotations

from typing import Any

from mechanism_sim.joints.contact_keys import in_plane
from mechanism_sim.planar.configuration import converted
from mechanism_sim.scene.assembly import Assembly
from mechanism_sim.scene.elastic_links import stiffened
from mechanism_sim.scene.plan import ScenePlan
from mechanism_sim.scene.schema import JointPart, Scene
from mechanism_sim.units import QuantityValue


def rigid_scene(plan: ScenePlan, assembly: Assembly) -> Scene:
    """A scene with elastic links made rigid, and shafts that do not give way.

    It starts where that of `plan` does, assembled so, although guides carry some links now.
    """
    ideal, scene = plan.ideal, plan.scene
    guides = [ideal.joint(j) for j in plan.bending]
    carried = {link for j in guides for link in (j.first, j.second)}
    initial = {
        kind: {
            c: x
            for c, x in getattr(scene.initial, kind).items()
            if c not in ideal.deformations and not (carried and (c in carried or '.' in c))
        }
        for kind in ('position', 'velocity')
    }
    changed: dict[str, Any] = {
        'links': {name: stiffened(link) for name, link in scene.links.items()},
        'joints': {
            name: JointPart.model_validate({'revolute': j.points})
            if j.kind_keys.gives_way
            else j.model_copy(update={'clearance': in_plane(j.clearance)})
            for name, j in scene.joints.items()
        },
        'initial': scene.initial.model_copy(update=initial),
    }
    if not carried:
        return scene.model_copy(update=changed)
    tree = ScenePlan(scene.model_copy(update=changed | {'guess': {}})).ideal
    q, _ = converted(ideal, tree, assembly.q, assembly.v)
    guess = {
        c: QuantityValue(x, 'm' if c in tree.displacements else 'rad')
        for c, x in zip(tree.coordinates, q.tolist(), strict=True)
    }
    return scene.model_copy(update=changed | {'guess': guess})
