"""The classes of all nodes, by name; each is imported alone."""

from __future__ import annotations

from pkgutil import resolve_name
from typing import Any

NODE_CLASSES = {
    'crank_drive': 'mechanism_sim.nodes.crank_drive:CrankDrive',
    'linkage': 'mechanism_sim.nodes.lifecycle:LinkageNode',
    'cam': 'mechanism_sim.nodes.lifecycle:CamNode',
    'gear_train': 'mechanism_sim.nodes.lifecycle:GearTrain',
    'geneva': 'mechanism_sim.nodes.lifecycle:GenevaNode',
    'oscillator': 'mechanism_sim.nodes.oscillator:OscillatorNode',
    'sensors': 'mechanism_sim.nodes.sensors:Sensors',
    'display': 'mechanism_sim.nodes.display:Display',
    'recorder': 'mechanism_sim.nodes.recorder:Recorder',
    'loop_relay': 'mechanism_sim.nodes.loop_relay:LoopRelay',
    'control_relay': 'mechanism_sim.nodes.control_relay:ControlRelay',
    'view': 'mechanism_sim.pages.view:ViewNode',
}

OUTSIDE = 'loop_relay', 'control_relay', 'view'
NODE_NAMES = tuple(name for name in NODE_CLASSES if name not in OUTSIDE)
"""Nodes of a run; the others are beside one, or `loop_relay` without any."""


def node_class(name: str) -> Any:
    """The class of a node, imported on request."""
    return resolve_name(NODE_CLASSES[name])
