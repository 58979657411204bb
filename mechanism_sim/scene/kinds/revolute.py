"""Revolute joints: a pin in a bushing."""

from __future__ import annotations

from mechanism_sim.planar.mechanism import Revolute
from mechanism_sim.scene.joint_keys import JointKeys, JointKind, Names, Reference, register


class RevoluteKeys(JointKeys):
    """A pin."""

    revolute: Reference | None = None
    """A pin: two points that coincide."""


def _read(places: Names, name: str, joint: RevoluteKeys) -> Revolute:
    (a, on_a), (b, on_b) = places.ends(name, joint)
    return Revolute(name, a, b, on_a, on_b)


register(JointKind('revolute', RevoluteKeys, _read))
