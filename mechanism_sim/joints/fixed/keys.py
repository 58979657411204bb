"""Two links that are one."""

from __future__ import annotations

from mechanism_sim.joints.joint_keys import KINDS, JointKeys, Reference
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Angle
from mechanism_sim.planar.mechanism import Weld


@KINDS.add('fixed')
class FixedKeys(JointKeys):
    """A weld."""

    fixed: Reference | None = None
    """Two points that coincide, of links that do not turn against each other: a weld."""
    angle: Angle = 0.0
    """Of the second link in the first."""

    firm = 'a weld holds'

    def read(self, names: Names, name: str) -> Weld:
        """A weld."""
        (a, on_a), (b, on_b) = names.ends(name)
        return Weld(name, a, b, on_a, on_b, self.angle)
