"""Loads on a mechanism: points of action, and generalised forces."""

from __future__ import annotations

from collections.abc import Iterable

from mechanism_sim.numerics.symbolic import Term, add, mul
from mechanism_sim.planar.frames import Frames, JetPair
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.protocols import Load


def located(load: Load, frames: Frames, mechanism: Mechanism) -> JetPair:
    """World components of the point where a load acts [m]."""
    return frames.position(mechanism.point(load.link, load.at), load.name)


def generalised(loads: Iterable[Load], frames: Frames, mechanism: Mechanism) -> dict[str, Term]:
    """Generalised forces by coordinate, [N m] for angles and [N] for displacements.

    The virtual work of the loads, ``F.dp + M dtheta``.
    """
    found: dict[str, Term] = {}
    for load in loads:
        if load.link == GROUND:
            continue
        for jet, force in zip(located(load, frames, mechanism), load.force, strict=True):
            for c, slope in jet.gradient.items():
                found[c] = add(found.get(c), mul(force, slope))
        for c, slope in mechanism.turns(load.link, load.at).items():
            share = frames.parameters(f'{load.name}.turn@{c}', slope)
            moment = load.moment if slope == 1.0 else mul(share, load.moment)
            found[c] = add(found.get(c), moment)
    return {c: term for c, term in found.items() if term is not None}
