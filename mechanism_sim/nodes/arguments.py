"""Arguments of a command line that are meant for ROS."""

from __future__ import annotations

from collections.abc import Sequence


def split_ros_args(args: Sequence[str]) -> tuple[list[str], list[str]]:
    """Arguments for us and for ROS: from ``--ros-args`` on, up to ``--`` if there is one."""
    own: list[str] = []
    ros: list[str] = []
    to: list[str] | None = None
    for arg in args:
        to = ros if arg == '--ros-args' else to
        (own if to is None else to).append(arg)
        to = None if arg == '--' else to
    return [arg for arg in own if arg != '--' or not ros], ros
