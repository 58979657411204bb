"""One-way clutches: two links, one of which drives the other one way and is overrun.

With the rate w of the second against the first, counted in the sense in which it is driven, and
the moment M of the first on the second, a freewheel has

    w >= 0,    M >= 0,    M w = 0

a contact that bounds a rate: it closes without impact where w falls to zero, opens where M does,
and takes part in every impact. A ratchet with teeth of a pitch bounds the angle: its pawl cannot
fall back behind the last tooth that it passed, and strikes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from mechanism_sim.joints.transmission.constraint import Transmission
from mechanism_sim.numerics.symbolic import dense
from mechanism_sim.planar.frames import Frames, Jet
from mechanism_sim.planar.gaps import Wall
from mechanism_sim.planar.view import Side


@dataclass(frozen=True)
class Freewheel(Transmission):
    """A clutch between two links that transmits in one direction."""

    equations: ClassVar[int] = 0
    sides: ClassVar[tuple[Side, ...]] = ('right',)

    parts: ClassVar[str] = 'one-way clutch'

    sense: float = 1.0  #: sense of driving the second: 1 counterclockwise, -1 clockwise
    teeth: int = 0  #: number of teeth of a ratchet; 0 for a freewheel

    @property
    def coupling(self) -> None:
        """Coupling of the links: none."""


@dataclass(frozen=True)
class Overrun(Wall):
    """Lead of the second link over the first; for a freewheel only its rate."""

    def value(self, frames: Frames) -> Jet:
        """Rate without value, or travel of the pawl from the last tooth passed [m]."""
        joint = self.closure.joint
        assert isinstance(joint, Freewheel)  # noqa: S101 - it makes this gap
        (ahead,) = self.closure.values(frames)
        ahead = ahead if self.side == 'right' else -ahead
        if not joint.teeth:
            return ahead.as_rate
        size = dense(frames.parameters(f'{self.joint}.size', self.closure.mechanism.size))
        away: Jet = frames.past_tooth(self.joint, ahead / size, joint.teeth) * size
        return away

    @property
    def overlap(self) -> str:
        """The second."""
        return f'{self.closure.joint.second} back behind the tooth of {self.joint}'
