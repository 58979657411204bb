"""Where message classes and middleware come from: the one place that decides."""

import os
from functools import cache
from importlib.util import find_spec

VARIABLE = 'MECHANISM_SIM_MIDDLEWARE'


@cache
def ros_installed() -> bool:
    """Whether to take messages and nodes from ROS.

    True if rclpy and this package's own messages built for it can be imported, unless
    ``MECHANISM_SIM_MIDDLEWARE=zenoh`` is set.
    """
    if os.environ.get(VARIABLE) == 'zenoh':
        return False
    return find_spec('rclpy') is not None and find_spec('mechanism_sim.msg') is not None
