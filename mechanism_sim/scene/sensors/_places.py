"""The angle of a link on another, which encoders and tachometers read."""

from __future__ import annotations

from typing import Any, ClassVar

from mechanism_sim.errors import InputError
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.sensor_keys import OnLinkKeys


def angle_between(
    mechanism: Mechanism, link: str, relative_to: str
) -> tuple[dict[int, float], float]:
    """The angle of a link on another: coordinates' factors by index, and what is added [rad]."""
    columns, added = {}, 0.0
    for sign, name in ((1.0, link), (-1.0, relative_to)):
        frame, offset = mechanism.frame(name)
        added += sign * offset
        if frame != GROUND:
            columns[mechanism.coordinates.index(frame)] = sign
    return columns, added


class BetweenKeys(OnLinkKeys):
    """A sensor of the angle between two links."""

    relative_to: str = GROUND
    """The link that carries its head."""

    #: with that angle, in words
    does: ClassVar[str]

    def check(self, machine: Any, where: str) -> None:
        """Refuse links that do not turn on each other."""
        super().check(machine, where)
        known = [GROUND, *machine.plan.links]
        if self.relative_to not in known:
            raise InputError(
                f"{where}.relative_to: there is no link '{self.relative_to}'; links: "
                f'{", ".join(known)}'
            )
        frames = [machine.mechanism.frame(x)[0] for x in (self.link, self.relative_to)]
        if frames[0] == frames[1]:
            raise InputError(
                f'{where}: {self.link} does not turn on {self.relative_to}: {self.does} the angle '
                'between two links'
            )
