"""Motors: the torque of their shaft over its speed, on a link that they turn through a gear."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import heyoka as hy
import numpy as np

from mechanism_sim.numerics.curves import Curve
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.mechanism import Mechanism


@dataclass(frozen=True)
class PointsOfTorque:
    """A motor of which the torque is known at some speeds."""

    curve: Curve

    name = 'a motor of given torque over speed'

    def on(self, _: Mechanism) -> PointsOfTorque:
        """Itself: it knows no links."""
        return self

    @property
    def starting(self) -> float:
        """Torque at rest [N m]."""
        return float(self.curve(np.zeros(1))[0])

    def torque(self, frames: Frames, key: str, speed: hy.expression) -> hy.expression:
        """Torque [N m] at a speed [rad/s]; `key` begins the names of its parameters."""
        return frames.lookup(key, speed, self.curve.breaks, self.curve.rows, self.curve.cyclic)


@dataclass(frozen=True)
class InductionMotor:
    """An induction motor by Kloss' formula ``M = 2 M_b/(s/s_b + s_b/s)`` with the slip s.

    M. Kloss, "Drehmoment und Schlüpfung des Drehstrommotors", Archiv für Elektrotechnik 5, 1916:
    without resistance of the stator. Written without the pole at zero slip.
    """

    synchronous_speed: float  #: [rad/s], not zero
    breakdown_torque: float  #: [N m] the largest
    breakdown_slip: float  #: at which it is reached

    name = 'an induction motor'

    def on(self, _: Mechanism) -> InductionMotor:
        """Itself: it knows no links."""
        return self

    @property
    def starting(self) -> float:
        """Torque at rest [N m]."""
        return 2.0 * self.breakdown_torque / (1.0 / self.breakdown_slip + self.breakdown_slip)

    @classmethod
    def of_data_sheet(
        cls,
        synchronous_speed: float,
        rated_speed: float,
        rated_torque: float,
        breakdown_torque: float,
    ) -> InductionMotor:
        """Motor by rated and largest torque: ``s_b = s_r (m + sqrt(m^2 - 1))``, m their ratio.

        Raises
        ------
        ValueError
            If there is no such motor.
        """
        slip = 1.0 - rated_speed / synchronous_speed if synchronous_speed else 0.0
        ratio = breakdown_torque / rated_torque if rated_torque else 0.0
        if not 0.0 < slip < 1.0:
            raise ValueError(
                f'rated_speed {rated_speed:g} rad/s must be between zero and the '
                f'synchronous_speed {synchronous_speed:g} rad/s'
            )
        if rated_torque * synchronous_speed <= 0.0 or ratio <= 1.0:
            raise ValueError(
                f'breakdown_torque {breakdown_torque:g} N m must be larger than the rated_torque '
                f'{rated_torque:g} N m, both with the sign of the synchronous_speed'
            )
        critical = slip * (ratio + math.sqrt(ratio * ratio - 1.0))
        return cls(synchronous_speed, breakdown_torque, critical)

    def torque(self, frames: Frames, key: str, speed: hy.expression) -> hy.expression:
        """``2 M_b s s_b/(s^2 + s_b^2)``."""
        reserve = frames.parameters.reserve
        slip = 1.0 - speed * reserve(f'{key}.pace', 1.0 / self.synchronous_speed)
        critical = reserve(f'{key}.slip', self.breakdown_slip)
        largest = reserve(f'{key}.breakdown', self.breakdown_torque)
        return 2.0 * largest * slip * critical / (slip * slip + critical * critical)


class Characteristic(Protocol):
    """Torque of a shaft."""

    @property
    def name(self) -> str:
        """Name of the characteristic in words."""

    @property
    def starting(self) -> float:
        """Torque at rest [N m]."""

    def torque(self, frames: Frames, key: str, speed: hy.expression) -> hy.expression:
        """Torque [N m] at a speed [rad/s]; `key` begins the names of its parameters."""

    def on(self, mechanism: Mechanism) -> Characteristic:
        """Itself in another tree of the mechanism."""


@dataclass(frozen=True)
class Motor:
    """A motor that turns a link through a gear without losses."""

    coordinate: str
    characteristic: Characteristic  #: torque over speed of its shaft
    ratio: float = 1.0  #: turns of its shaft in one of the link

    @property
    def name(self) -> str:
        """Name of the motor in words, with its gear."""
        gear = '' if self.ratio == 1.0 else f' through a gear of {self.ratio:g}'
        return self.characteristic.name + gear

    def torque(self, frames: Frames) -> hy.expression:
        """Torque [N m] on the link."""
        key = f'drives:{self.coordinate}.motor'
        ratio = frames.parameters.reserve(f'{key}.ratio', self.ratio)
        speed = ratio * frames.v[self.coordinate]
        return ratio * self.characteristic.torque(frames, key, speed)
