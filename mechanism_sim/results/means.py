"""Means per revolution with their confidence intervals, and those of impacts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.batch_means import batches, ratio
from mechanism_sim.results.solution import Piece
from mechanism_sim.results.turns import DriveTurns, impacts_by_turn
from mechanism_sim.scene import Machine


@dataclass(frozen=True)
class Mean:
    """A figure per revolution: its mean, and half the width of its 95 % confidence interval."""

    name: str
    unit: str
    mean: float
    half_width: float
    revolutions: int = 0  #: of which it is, the last ones

    def shown(self, scale: float = 1.0) -> str:
        """Both for people, times a scale; the mean alone where the width is not known."""
        text = f'{scale * self.mean:.6g}'
        known = math.isfinite(self.half_width)
        return f'{text} +- {scale * self.half_width:.2g}' if known else text


def impact_means(count: Array, impulse: Array) -> tuple[Mean, Mean, Mean]:
    """Impacts and normal impulse per revolution, and impulse per impact ([SB] 7.3).

    Parameters
    ----------
    count, impulse : (n,) impacts and sums of their normal impulses [N s] in n whole revolutions
    """
    x, one, used = np.asarray(count, float), np.ones(len(count)), math.prod(batches(len(count)))
    return (
        Mean('impacts', '', *ratio(x, one), used),
        Mean('impulse', 'N s', *ratio(impulse, one), used),
        Mean('I_n', 'N s', *ratio(impulse, x), used),
    )


class ImpactTally:
    """Impacts of all loose joints in each revolution of a run that comes in pieces."""

    def __init__(self, machine: Machine) -> None:
        straight = machine.plan.main in machine.mechanism.displacements
        self._loose = machine.has_contacts and not straight
        self._turns = DriveTurns(machine)
        self._table = np.zeros((0, 2))

    def add(self, piece: Piece) -> None:
        """Enter the piece that follows."""
        if not (self._loose and len(piece.motion)):
            return
        self._turns.add(piece)
        edges = self._turns.edges
        more = np.zeros((len(edges) - len(self._table), 2))  # the last one is not over yet
        self._table = np.concatenate([self._table, more])
        t, impulse = np.array([(i.t, i.normal_impulse) for i in piece.impacts]).reshape(-1, 2).T
        k = np.searchsorted(edges, t, side='right') - 1
        self._table += np.column_stack(impacts_by_turn(k, impulse, len(edges)))

    @property
    def means(self) -> tuple[Mean, Mean, Mean] | None:
        """Per whole revolution so far, see `impact_means`; None before there are two.

        Nor are there any of a machine without loose joints, or whose drive slides.
        """
        count, impulse = self._table[:-1].T
        return impact_means(count, impulse) if len(count) > 1 else None
