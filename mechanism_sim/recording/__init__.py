"""Bags: MCAP files of ROS 2 messages, written so that a kill cannot spoil them, read anyhow."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mechanism_sim.recording.runs import realtime_factor

if TYPE_CHECKING:
    from mechanism_sim.recording.inventory import (
        BagInfo,
        displacements,
        info,
        render_info,
        scene_name,
        scene_text,
    )
    from mechanism_sim.recording.reader import Bag, BagTopic, read_bag
    from mechanism_sim.recording.recovery import RecoveredBag, recover, render_recovery
    from mechanism_sim.recording.rosbag2 import Qos, QosLike
    from mechanism_sim.recording.writer import BagWriter

__all__ = [
    'Bag',
    'BagInfo',
    'BagTopic',
    'BagWriter',
    'Qos',
    'QosLike',
    'RecoveredBag',
    'displacements',
    'info',
    'read_bag',
    'realtime_factor',
    'recover',
    'render_info',
    'render_recovery',
    'scene_name',
    'scene_text',
]

_FILES = {
    'inventory': ('BagInfo', 'displacements', 'info', 'render_info', 'scene_name', 'scene_text'),
    'reader': ('Bag', 'BagTopic', 'read_bag'),
    'recovery': ('RecoveredBag', 'recover', 'render_recovery'),
    'rosbag2': ('Qos', 'QosLike'),
    'writer': ('BagWriter',),
}


def __getattr__(name: str) -> Any:
    """Names that need the library of bags, which is imported when it is first asked for."""
    for file, names in _FILES.items():
        if name in names:
            return getattr(import_module(f'{__name__}.{file}'), name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
