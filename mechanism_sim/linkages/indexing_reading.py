"""What there is to read of an intermittent drive: a Geneva wheel or a slotted rack."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.planar.view import Array, Charted, View

if TYPE_CHECKING:
    from mechanism_sim.linkages.indexing import Geneva, SlottedRack


class GenevaReading(NamedTuple):
    """An intermittent drive at N instants; forces are NaN where masses are not known."""

    engaged: NDArray[np.bool_]  #: (N,) whether the pin is in a slot
    driver_angle: Array  #: (N,) [rad] of the link with the pin
    driver_speed: Array  #: (N,) [rad/s]
    driver_acceleration: Array  #: (N,) [rad/s^2]
    driven_position: Array  #: (N,) [rad] of a wheel, [m] of a rack
    driven_velocity: Array  #: (N,) [rad/s] or [m/s]
    driven_acceleration: Array  #: (N,) [rad/s^2] or [m/s^2]
    force_x: Array  #: (N,) [N] of the driver on the driven link
    force_y: Array  #: (N,) [N]
    driven_effort: Array  #: (N,) [N m] on a wheel about its centre, [N] on a rack along its guide
    driver_torque: Array  #: (N,) [N m] on the driver about its centre


def read_wheel(joint: Geneva, view: View) -> GenevaReading:
    """A Geneva wheel: its pin is in a slot while nearer to the centre than the slots' mouths."""
    centre = view.place(joint.second, joint.on_second)
    x, y = view.place(joint.first, joint.on_first) - centre
    engaged = x * x + y * y < joint.entry**2
    way = joint.distance * np.array([[math.cos(joint.towards)], [math.sin(joint.towards)]])
    return _reading(joint, view, engaged, centre + way, view.moment)


def read_rack(joint: SlottedRack, view: View) -> GenevaReading:
    """A slotted rack: its pin moves it on the right of the axis through the crank's centre."""
    c, s = math.cos(joint.axis), math.sin(joint.axis)
    centre = np.array(joint.centre)[:, None]
    x, y = view.place(joint.first, joint.on_first) - centre
    fx, fy = view.force
    return _reading(joint, view, y * c - x * s < 0.0, centre, c * fx + s * fy)


def _reading(
    joint: Geneva | SlottedRack,
    view: View,
    engaged: NDArray[np.bool_],
    centre: Array,
    effort: Array,
) -> GenevaReading:
    driver, driven = view.turning(joint.first), view.course(joint.second)
    (fx, fy), torque = view.force, view.moment_on_first(centre)
    return GenevaReading(engaged, *driver, *driven, fx, fy, effort, torque)


def driven_charts(*, slides: bool) -> tuple[Charted, ...]:
    """Which readings are worth a chart, of a rack that slides or a wheel."""
    unit, effort = ('m', 'force') if slides else ('rad', 'torque')
    return (
        Charted('velocity of what is driven', {'driven_velocity': 'driven'}, 'velocity',
                f'{unit}/s'),
        Charted('its acceleration', {'driven_acceleration': 'driven'}, 'acceleration',
                f'{unit}/s^2'),
        Charted(f'{effort} on what is driven', {'driven_effort': 'driven'}, effort,
                'N' if slides else 'N m', force=True),
    )  # fmt: skip
