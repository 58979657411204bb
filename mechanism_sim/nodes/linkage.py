"""The linkage: integrates the motion under the law of its drive and publishes all of it."""

from __future__ import annotations

from collections.abc import Sequence

from mechanism_sim.nodes.described_node import Diagnosis
from mechanism_sim.nodes.integration import Integration
from mechanism_sim.nodes.lifecycle import IntegratingNode
from mechanism_sim.nodes.middleware import Parameter


class LinkageNode(IntegratingNode):
    """Integrates the machine and publishes its motion, forces and events."""

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('linkage', parameters)

    def make_endpoints(self) -> None:
        """Publish all that integration gives."""
        self._integration = Integration(self)

    def on_ready(self) -> None:
        """Describe the scene."""
        self._integration.begin()

    def diagnose(self) -> Diagnosis:
        """Statistics of the solver."""
        found = super().diagnose()
        if self.ready:
            found.values |= self._integration.diagnose()
        return found
