"""A quantity that can be asked of a machine in motion by its name."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum

from mechanism_sim.arrays import Array
from mechanism_sim.results.view import View

PARTS = 'x', 'y', 'size', 'direction', 'moment', 'along', 'across', 'axial'
"""Of a vector, as the last word of a name."""


class Shown(IntEnum):
    """In which tables a quantity stands unasked."""

    ASKED = 0  #: in none
    CYCLE = 1  #: in those of a cycle
    PARTS = 2  #: also in charts and measures of a bag: contacts, teeth, bearings, elastic links
    RUN = 3  #: also in those of a run, `Piece.sample`


@dataclass(frozen=True, eq=False)
class Quantity:
    """A quantity of a machine.

    Attributes
    ----------
    name : ``KIND``, ``KIND.OF`` or ``KIND.OF.PART``
    unit : SI; empty for a number
    words : what it is, as a title of a chart has it
    of : the coordinate, joint, link or point; empty of the whole machine
    evaluate : its values (N,) in a view of N instants
    shown : in which tables it stands unasked
    part : of a vector: one of `PARTS`, else empty
    counted : whether it is a state or a number of something, which has no extremes
    difference : whether it is one of lengths as large as the machine, with their rounding
    cumulative : whether it is a sum over the motion so far, which costs eight times the rest
    """

    name: str
    unit: str
    words: str
    of: str
    evaluate: Callable[[View], Array]
    shown: Shown = Shown.RUN
    part: str = ''
    counted: bool = False
    difference: bool = False
    cumulative: bool = False

    @property
    def kind(self) -> str:
        """The first part of its name."""
        return self.name.partition('.')[0]

    @property
    def title(self) -> str:
        """Its words without what it is of, and without ``x`` or ``y``: for the axis of a chart."""
        words = self.words.removesuffix(f', {self.part}')
        return re.sub(rf' (of|in|on) {re.escape(self.of)}(?![\w.])', '', words, count=1)

    @property
    def has_extremes(self) -> bool:
        """True if its least and greatest values make sense."""
        return not self.counted and self.part != 'direction'


def vector(
    name: str,
    unit: str,
    words: str,
    of: str,
    evaluate: Callable[[View], Array],
    shown: Shown = Shown.RUN,
) -> Iterator[Quantity]:
    """Components ``.x`` and ``.y`` of a vector, of which `evaluate` gives (2, N)."""
    yield Quantity(
        f'{name}.x', unit, f'{words}, x', of, lambda view: evaluate(view)[0], shown, 'x'
    )
    yield Quantity(
        f'{name}.y', unit, f'{words}, y', of, lambda view: evaluate(view)[1], shown, 'y'
    )
