"""Coefficients of restitution as parameters of a node, to be changed while the machine runs."""

from __future__ import annotations

from collections.abc import Callable

from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.simulation_node import SimulationNode


class Restitutions:
    """A parameter ``joints.NAME.clearance.restitution`` for every rigid contact of the scene.

    Parameters
    ----------
    change : changes one, by its path

    Attributes
    ----------
    changed : those that differ from the scene, by their paths
    """

    def __init__(self, node: SimulationNode, change: Callable[[str, float], None]) -> None:
        self.changed: dict[str, float] = {}
        self._change = change
        self._node = node
        self._scene = self._of_scene()
        about = 'Coefficient of restitution, of all impacts from the time of the change on'
        self._launched = {
            path: node.declare(path, value, about, (0.0, 1.0))
            for path, value in self._scene.items()
        }
        self.start_over()
        if self._scene:
            node.add_post_set_parameters_callback(self._take)

    def start_over(self) -> None:
        """A run begins anew: with the values it was launched with, or others of the scene."""
        before, self._scene = self._scene, self._of_scene()
        for path, value in self._scene.items():
            if value != before[path]:
                self._launched[path] = value
        moved = [p for p, value in self._launched.items() if self._node.value(p) != value]
        self.changed = {p: x for p, x in self._launched.items() if x != self._scene[p]}
        self._node.set_parameters([Parameter(p, value=self._launched[p]) for p in moved])

    def _of_scene(self) -> dict[str, float]:
        return {
            f'joints.{name}.clearance.restitution': play.restitution
            for name, play in self._node.machine.plan.rigid.items()
            if play.wall == 'rigid'
        }

    def _take(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name in self._scene:
                value = float(parameter.value)
                if value != self._scene[parameter.name]:
                    self.changed[parameter.name] = value
                else:
                    self.changed.pop(parameter.name, None)
                self._change(parameter.name, value)
