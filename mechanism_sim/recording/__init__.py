"""Bags: MCAP files of ROS 2 messages, written so that a kill cannot spoil them, read anyhow."""

from mechanism_sim.recording.inventory import (
    BagInfo,
    displacements,
    info,
    realtime_factor,
    render_info,
    scene_name,
    scene_text,
)
from mechanism_sim.recording.reader import Bag, Topic, read_bag
from mechanism_sim.recording.recover import Recovery, recover, render_recovery
from mechanism_sim.recording.rosbag2 import Qos, QosLike
from mechanism_sim.recording.writer import BagWriter

__all__ = [
    'Bag',
    'BagInfo',
    'BagWriter',
    'Qos',
    'QosLike',
    'Recovery',
    'Topic',
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
