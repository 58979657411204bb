"""Play of a pin in a slot: two walls, each a gap. Geneva wheels and slotted racks have it too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics.symbolic import Term, dense, neg
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.jet import Jet, lift
from mechanism_sim.planar.loads import Wrench
from mechanism_sim.planar.protocols import ForceLaw, Relation

Array = NDArray[np.float64]


_SIDES: tuple[Literal['left', 'right'], ...] = ('left', 'right')


class Slotted(Relation, Protocol):
    """A closure of one row: how far the pin is off the slot's centre line."""

    def normal(self, frames: Frames) -> tuple[Jet, Jet]:
        """Unit vector across the slot, on the pin's side for a positive offset."""


@dataclass(frozen=True)
class SlotWall:
    """One wall of a slot with play, at a distance from where the pin's centre may go.

    With the offset h of the pin from the centre line, to the left of the slot's direction, the gap
    is ``c - h`` at the left wall and ``c + h`` at the right one.
    """

    closure: Slotted
    side: Literal['left', 'right']
    play: float  #: [m] c, half of what the pin can move across the slot
    restitution: float
    friction: float = 0.0
    hypothesis: str = 'newton'
    law: ForceLaw | None = None
    creep_speed: float = 1e-3  #: [m/s]

    @property
    def name(self) -> str:
        """The joint's, with the side."""
        return f'{self.closure.name}_{self.side}'

    @property
    def joint(self) -> str:
        """Name of the joint."""
        return self.closure.name

    def value(self, frames: Frames) -> Jet:
        """``c - h`` or ``c + h`` [m]."""
        (offset,) = self.closure.values(frames)
        play = lift(dense(frames.parameters(f'{self.joint}.play', self.play)))
        return play - offset if self.side == 'left' else play + offset

    def slip(self, frames: Frames) -> Jet:
        """There is no friction here.

        Raises
        ------
        NotImplementedError
        """
        raise NotImplementedError('walls of slots are without friction')

    def normal(self, frames: Frames) -> tuple[Jet, Jet]:
        """Towards the wall."""
        x, y = self.closure.normal(frames)
        return (x, y) if self.side == 'left' else (-x, -y)

    def wrench(self, frames: Frames, N: Term, _: Term) -> Wrench:
        """What the closure would do with the wall's force along its row."""
        return self.closure.wrench(frames, [neg(N) if self.side == 'left' else N])

    def stretch(self, value: Term) -> Term:
        """The value is the distance."""
        return hy.expression(1.0)

    def depth(self, value: Term) -> Term:
        """The value is the distance."""
        return -value

    def distance(self, value: Array) -> Array:
        """The value is the distance."""
        return value


def walls(closure: Slotted, play: float, restitution: float) -> list[SlotWall]:
    """Both walls of a slot; `play` [m] is half of what the pin can move across it."""
    return [SlotWall(closure, side, play, restitution) for side in _SIDES]
