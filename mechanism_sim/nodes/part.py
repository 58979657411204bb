"""Nodes of the parts of one kind, such as all cams of a machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mechanism_sim.nodes.described_node import Diagnosis
from mechanism_sim.nodes.following import MotionFollower
from mechanism_sim.nodes.integration import Integration
from mechanism_sim.nodes.lifecycle import IntegratingNode
from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.parts import States


class PartNode(IntegratingNode):
    """Publishes the states of its parts, of a motion that it integrates itself or follows.

    It follows if ``linkage`` is among its partners. Without, it is the integrator of the run and
    publishes all that ``linkage`` would.
    """

    kind: str  #: of the parts, and the name of the node

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__(self.kind, parameters)

    def make_endpoints(self) -> None:
        """Publish the states, and all that integration gives if this node does that."""
        states = States(self, self.kind)
        role = MotionFollower if 'linkage' in self.partners.names else Integration
        self._role: MotionFollower | Integration = role(
            self, states.publish, reset=states.start_over
        )

    def on_ready(self) -> None:
        """All partners are there."""
        self._role.begin()

    def on_progress(self, message: Any) -> None:
        """Check whether all motion has come."""
        self._role.look()

    def diagnose(self) -> Diagnosis:
        """Statistics of the solver, if this node has one."""
        found = super().diagnose()
        if self.ready and isinstance(self._role, Integration):
            found.values |= self._role.diagnose()
        return found


class CamNode(PartNode):
    """Publishes ``cam_state`` of every cam and its follower."""

    kind = 'cam'


class GearTrain(PartNode):
    """Publishes ``gear_state`` of every pair of gears."""

    kind = 'gear_train'


class GenevaNode(PartNode):
    """Publishes ``geneva_state`` of every Geneva wheel and slotted rack."""

    kind = 'geneva'
