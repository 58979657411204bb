"""States of parts that have a node of their own: their joints, their topic, their readings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.messages import CamState, GearState, GenevaState
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.results.quantity import View
from mechanism_sim.scene import Machine


@dataclass(frozen=True)
class Kind:
    """A kind of parts."""

    topic: str  #: topic of its states
    message: Any  #: their class; its fields are those of a reading, after header, time and joint

    def joints(self, machine: Machine) -> list[HigherPair]:
        """The joints whose readings are of this kind."""
        pairs = (j for j in machine.mechanism.joints if isinstance(j, HigherPair))
        return [pair for pair in pairs if pair.node and KINDS[pair.node] is self]

    def states(
        self, machine: Machine, motion: Motion, t: NDArray[np.float64]
    ) -> list[tuple[float, str, dict[str, Any]]]:
        """Time [s], joint and fields of every state at times `t` (N,) [s] of a motion."""
        view = View.at(machine, motion, t)
        columns = {joint.name: view.readings(joint) for joint in self.joints(machine)}
        return [
            (time, name, {field: column[i].item() for field, column in fields.items()})
            for i, time in enumerate(t.tolist())
            for name, fields in columns.items()
        ]


#: by the name of the node
KINDS = {
    'cam': Kind('cam_state', CamState),
    'gear_train': Kind('gear_state', GearState),
    'geneva': Kind('geneva_state', GenevaState),
}


def kinds_of(machine: Machine) -> dict[str, Kind]:
    """The kinds of parts that a machine has, by the names of their nodes."""
    return {name: kind for name, kind in KINDS.items() if kind.joints(machine)}


def integrator_of(machine: Machine) -> str:
    """Name of the node that integrates a machine.

    It is the node of a kind of parts if nothing but these closes loops, else ``linkage``.
    """
    for name, kind in kinds_of(machine).items():
        if {*machine.mechanism.cut} <= {joint.name for joint in kind.joints(machine)}:
            return name
    return 'linkage'
