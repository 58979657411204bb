"""SI units of the fields of messages: of our own from the comments of their definitions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache

from rosbags.interfaces import Nodetype

from mechanism_sim.messages.own import OWN
from ros_interfaces.definitions import definition, field_descriptions

_FIELD = re.compile(r'^\w+(?:\[\])?\s+(\w+)\s*#\s*((?:\[[^]]+\](?:, | or )?)+)', re.MULTILINE)
_TURN, _RATE, _EFFORT = ('rad', 'm'), ('rad/s', 'm/s'), ('N m', 'N')

_STANDARD: dict[str, dict[str, tuple[str, ...]]] = {
    'builtin_interfaces/msg/Duration': {'sec': ('s',), 'nanosec': ('ns',)},
    'builtin_interfaces/msg/Time': {'sec': ('s',), 'nanosec': ('ns',)},
    'geometry_msgs/msg/Accel': {'linear': ('m/s^2',), 'angular': ('rad/s^2',)},
    'geometry_msgs/msg/Inertia': {'m': ('kg',), 'com': ('m',)},
    'geometry_msgs/msg/Point': dict.fromkeys('xyz', ('m',)),
    'geometry_msgs/msg/Point32': dict.fromkeys('xyz', ('m',)),
    'geometry_msgs/msg/Pose2D': {'x': ('m',), 'y': ('m',), 'theta': ('rad',)},
    'geometry_msgs/msg/Transform': {'translation': ('m',)},
    'geometry_msgs/msg/Twist': {'linear': ('m/s',), 'angular': ('rad/s',)},
    'geometry_msgs/msg/Wrench': {'force': ('N',), 'torque': ('N m',)},
    'sensor_msgs/msg/BatteryState': {
        'voltage': ('V',), 'current': ('A',), 'charge': ('A h',), 'temperature': ('deg C',),
    },
    'sensor_msgs/msg/FluidPressure': {'fluid_pressure': ('Pa',)},
    'sensor_msgs/msg/Illuminance': {'illuminance': ('lx',)},
    'sensor_msgs/msg/Imu': {'linear_acceleration': ('m/s^2',), 'angular_velocity': ('rad/s',)},
    'sensor_msgs/msg/JointState': {'position': _TURN, 'velocity': _RATE, 'effort': _EFFORT},
    'sensor_msgs/msg/LaserScan': {
        'angle_min': ('rad',), 'angle_max': ('rad',), 'angle_increment': ('rad',),
        'time_increment': ('s',), 'scan_time': ('s',), 'range_min': ('m',), 'range_max': ('m',),
        'ranges': ('m',),
    },
    'sensor_msgs/msg/MagneticField': {'magnetic_field': ('T',)},
    'sensor_msgs/msg/Range': {'range': ('m',), 'min_range': ('m',), 'max_range': ('m',)},
    'sensor_msgs/msg/Temperature': {'temperature': ('deg C',)},
}  # fmt: skip
"""Units of messages of ROS, which state them in words (REP 103), by field or part."""


@cache
def units(message: str) -> dict[str, tuple[str, ...]]:
    """The units of the fields of a message ``pkg/msg/Name`` that have one.

    Several where it depends on what the value is of: first of an angle, then of a displacement.
    """
    if message.startswith(f'{OWN}/'):
        found = _FIELD.findall(definition(message).partition('=====')[0])
        return {name: tuple(re.findall(r'\[([^]]+)\]', text)) for name, text in found}
    return _STANDARD.get(message, {})


def units_of(message: str, path: Sequence[str]) -> tuple[str, ...]:
    """The units of a field of a message, or of one below it; none if it has no unit.

    Parameters
    ----------
    path : names of fields, outermost first
    """
    if not path:
        return ()
    own, (name, *below) = units(message), path
    described = dict(field_descriptions(message)).get(name)
    if name in own or described is None:
        return own.get(name, ())
    kind, inner = described
    if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
        kind, inner = inner[0]
    return units_of(inner, below) if kind == Nodetype.NAME else ()
