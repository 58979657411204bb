"""Accelerometers: the acceleration of a point of a link, or of a frame on springs."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from mechanism_sim.errors import InputError
from mechanism_sim.keys.quantities import Offset, UnitValue
from mechanism_sim.scene.frame_forces import forces_on
from mechanism_sim.scene.sensor_keys import SENSORS, OnLinkKeys, ShockKeys, check_link
from mechanism_sim.sensing.chain import Integrator, Transducer
from mechanism_sim.sensing.channel import SensorSource
from mechanism_sim.sensing.frame_point import PointOnFrame
from mechanism_sim.sensing.point import PointOnLink
from mechanism_sim.units import to_si

_WORDS = 'along or across'


def _axis(value: Any) -> float | str:
    """An axis as scenes have it, ``along``, ``across`` or an angle; it in words, or in radians."""
    if value in _WORDS.split(' or '):
        return str(value)
    if isinstance(value, str) and not any(map(str.isdigit, value)):
        raise ValueError("is no axis; allowed: 'along' or 'across', or an angle, as '30 deg'")
    return to_si(value, 'rad')


@SENSORS.add('accelerometer')
class AccelerometerKeys(OnLinkKeys, ShockKeys):
    """An accelerometer and its measurement chain."""

    at: Offset = 0.0
    """From the link's origin: along the link, as [x, y] in its frame, or a point of it by name."""
    axis: Annotated[float | Literal['along', 'across'], UnitValue(_axis, ('rad',), _WORDS)] = (
        'across'
    )
    """Direction of its reading: along the link, 90 degrees counterclockwise from that, or another
    angle from the link's x axis."""
    instrument: str | None = None
    """A preset; keys given here replace its parts."""
    gravity: bool = False
    """True if it senses acceleration less that of gravity."""
    transducer: Transducer = Transducer()
    """The seismic mass."""
    quantity: Literal['acceleration', 'velocity', 'displacement'] = 'acceleration'
    """Quantity of the samples: integrated never, once or twice."""
    integrator: Integrator | None = None
    """The integrating circuit; only where something is integrated."""
    imu: bool = False
    """True to publish it as sensor_msgs/Imu, too."""

    def _at(self) -> tuple[float, float]:
        return self.at if isinstance(self.at, tuple) else (self.at, 0.0)

    def source(self, machine: Any) -> SensorSource:
        """A point of a link, or of a frame on springs."""
        mechanism, across, link = machine.mechanism, self.transducer.transverse, str(self.link)
        if link in machine.scene.oscillators:
            frame, forces = machine.frame(link), forces_on(machine, link)
            gravity = mechanism.gravity if self.gravity else (0.0, 0.0)
            return PointOnFrame(frame, forces, self._at(), self.axis, gravity, across)
        return PointOnLink(mechanism, link, self._at(), self.axis, self.gravity, across)

    def place(self, machine: Any) -> str:
        """Place of the sensor in words: link or frame, and axis."""
        x, y = self._at()
        at = f'({x:g}, {y:g}) m' if y else f'{x:g} m'
        turned = '' if isinstance(self.axis, str) else f'{math.degrees(self.axis):g} deg to '
        if self.link in machine.plan.links:
            way = f'{turned or self.axis} the link'.replace('  ', ' ')
            return f'on the {self.link}, {at} from its origin, {way}'
        way = f'{turned}x' if turned else f'along {"x" if self.axis == "along" else "y"}'
        return f'on the oscillator {self.link}, at {at}, {way}'

    def check(self, machine: Any, where: str) -> None:
        """Refuse one far off its link, and a frame as what an inertial unit is on."""
        check_link(machine, where, self.link, machine.scene.oscillators)
        if self.imu and self.link in machine.scene.oscillators:
            raise InputError(
                f'{where}.imu is for sensors on links; {self.link} is a frame on springs'
            )
        away, size = math.hypot(*self._at()), machine.mechanism.size
        if self.link in machine.plan.links and away > 10.0 * size:
            raise InputError(
                f'{where}.at = {away:g} m lies far off the {self.link} (the longest link has '
                f'{size:g} m)'
            )
