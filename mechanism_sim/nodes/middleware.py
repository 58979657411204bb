"""Nodes, publishers, subscriptions, timers, services and parameters: the part of rclpy we use.

Where ROS is installed these are rclpy's own, see `rclpy_backend`; elsewhere those of
`zenoh_rclpy`, the same surface on Zenoh, on the wire what ``rmw_zenoh_cpp`` speaks.
``MECHANISM_SIM_MIDDLEWARE=zenoh`` takes Zenoh in any case. Nodes import from here and never know;
no other module of the package imports the one or the other.
"""

import logging
from typing import TYPE_CHECKING

from mechanism_sim.messages import ros_installed
from mechanism_sim.terminal import print_notice

if TYPE_CHECKING or not ros_installed():
    from zenoh_rclpy.surface import *  # noqa: F403 - all of it, which each back end lists
    from zenoh_rclpy.surface import __all__ as _names
else:
    from mechanism_sim.nodes.rclpy_backend import *  # noqa: F403
    from mechanism_sim.nodes.rclpy_backend import __all__ as _names

__all__ = [*_names, 'backend']  # noqa: PLE0604


def backend() -> str:
    """'rclpy' or 'zenoh'."""
    return 'rclpy' if ros_installed() else 'zenoh'


class _Notices(logging.Handler):
    """Print notices of the back end on standard error, as this program."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print one notice."""
        print_notice(record.getMessage())


logging.getLogger('zenoh_rclpy').addHandler(_Notices())
