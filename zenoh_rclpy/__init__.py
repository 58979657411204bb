"""rclpy's interface on eclipse-zenoh: nodes of ROS 2 without ROS, on the wire of rmw_zenoh.

``from zenoh_rclpy import Node, QoSProfile, init, spin``: the names of rclpy are all here, and
those of some of its modules in modules called alike. `surface` lists them; it is loaded when the
first is asked for, so that the command ``zros`` also runs where rclpy is and Zenoh is not. The
README beside this file says what is there.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from zenoh_rclpy.surface import *  # noqa: F403 - all of it, which it lists


def __getattr__(name: str) -> Any:
    """Names of the surface."""
    # a module of ours, which is asked for before it is imported, is none of the names
    if (name.startswith('__') and name != '__all__') or find_spec(f'{__name__}.{name}'):
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module('zenoh_rclpy.surface'), name)
