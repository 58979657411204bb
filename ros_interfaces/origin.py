"""Choice of the origin of message classes and nodes: ROS, or Python alone."""

import os
from functools import cache
from importlib.util import find_spec

VARIABLE = 'MECHANISM_SIM_MIDDLEWARE'
_required: list[str] = []


def require(package: str) -> None:
    """Take ROS only if the messages of this package are built for it, too."""
    _required.append(package)
    ros_installed.cache_clear()


@cache
def ros_installed() -> bool:
    """Whether to take messages and nodes from ROS.

    True if rclpy and the required packages of messages can be imported, unless
    ``MECHANISM_SIM_MIDDLEWARE=zenoh`` is set.
    """
    if os.environ.get(VARIABLE) == 'zenoh':
        return False
    needed = 'rclpy', *(f'{package}.msg' for package in _required)
    return all(find_spec(module) is not None for module in needed)
