"""Nodes, publishers, subscriptions, timers, services, parameters: the used part of rclpy.

With ROS installed these are rclpy's own, see `rclpy_backend`; otherwise those of
`zenoh_rclpy`, the same surface on Zenoh, on the wire what ``rmw_zenoh_cpp`` speaks.
``MECHANISM_SIM_MIDDLEWARE=zenoh`` selects Zenoh. Nodes import from here only;
no other module of the package imports either back end.
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
    """Handler that prints notices of the back end on standard error."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print one notice."""
        print_notice(record.getMessage())


logging.getLogger('zenoh_rclpy').addHandler(_Notices())
