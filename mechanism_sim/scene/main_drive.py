"""The main drive of a machine, whose revolutions count: its laws, its speed and its period."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice, takewhile

from mechanism_sim.errors import InputError
from mechanism_sim.planar.drive import DriveLaw, Law, largest_speed, time_of_angle
from mechanism_sim.planar.endless_laws import LawSource, unrolled
from mechanism_sim.scene.plan import ScenePlan
from mechanism_sim.scene.schema import Commands


@dataclass(frozen=True)
class MainDrive:
    """The drive of the coordinate `ScenePlan.main`; lengths and speeds in m if it slides."""

    plan: ScenePlan

    @property
    def laws(self) -> tuple[Law, ...]:
        """Its laws, in the order in which they take over."""
        return self.plan.laws[self.plan.main]

    @property
    def law(self) -> Law:
        """The first of its laws."""
        return self.laws[0]

    @property
    def source(self) -> LawSource | None:
        """Source of the laws behind the last one."""
        return self.plan.sources.get(self.plan.main)

    @property
    def start(self) -> tuple[float, float]:
        """Angle [rad] and speed [rad/s] at time zero."""
        return self.plan.begins.get(self.plan.main, (0.0, 0.0))

    @property
    def commands(self) -> Commands | None:
        """Commands of speed that it takes, if any."""
        return drive.commands if (drive := self.plan.scene.drive) else None

    @property
    def fastest(self) -> float:
        """Largest speed that is known beforehand [rad/s]."""
        commanded = self.commands.fastest if self.commands else 0.0
        return max(abs(self.start[1]), largest_speed(self.laws), commanded)

    @property
    def period(self) -> float:
        """Duration of a revolution at the largest speed [s]; infinite for a drive at rest."""
        mechanism = self.plan.loose
        straight = self.plan.main in mechanism.displacements
        fastest = self.fastest / (mechanism.size if straight else 1.0)
        return 2.0 * math.pi / fastest if fastest else math.inf

    @property
    def steady(self) -> bool:
        """True if it is prescribed one constant speed for ever."""
        return len(self.laws) == 1 and isinstance(self.law, DriveLaw) and self.law.degree <= 1

    def laws_until(self, end: float) -> list[Law]:
        """The laws that take over before a time [s], and the first in any case."""
        later = islice(unrolled(self.laws, self.source), 1, None)
        return [self.law, *takewhile(lambda law: law.valid_from < end, later)]

    def time_of(self, revolutions: float) -> float:
        """When it has turned so far [s]."""
        main, cure = self.plan.main, "--duration, or 'duration' in the scene"
        if not isinstance(self.law, DriveLaw):
            raise InputError(
                f'how fast {main} turns is not known beforehand: give a duration in seconds, '
                f'not revolutions: {cure}'
            )
        if self.law.straight:
            raise InputError(
                f'{main} moves in a straight line: it makes no revolutions: give a duration in '
                f'seconds: {cure}'
            )
        t = time_of_angle(unrolled(self.laws, self.source), 2.0 * math.pi * revolutions)
        if t is None:
            raise InputError(
                f'{main} is at rest: give a duration in seconds, not revolutions: {cure}'
            )
        return t
