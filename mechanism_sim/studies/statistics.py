"""Means of a machine: impacts, impulses and losses per revolution, with confidence intervals.

Conclusions about chaotic runs are made from intervals: a single run has other figures on another
processor.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.energy_terms import work_since_start
from mechanism_sim.engine.events import Impacts
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.batch_means import BATCHES, ratio
from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.results.measure_text import Measure
from mechanism_sim.results.measures import Measurement, per_turn
from mechanism_sim.results.run import Piece, is_loss
from mechanism_sim.results.simulate import stream
from mechanism_sim.results.turns import Mean
from mechanism_sim.scene import Machine
from mechanism_sim.scene.validation import validate_loose
from mechanism_sim.studies.columns import MEANS


@dataclass(frozen=True)
class Statistics:
    """Means over the revolutions after those skipped; `I_n` is impulse per impact ([SB] 7.3)."""

    revolutions: int
    skipped: int
    means: tuple[Mean, ...]
    I_n: float
    I_n_half_width: float
    #: the mean of what each of them is in every revolution by itself
    measures: tuple[Mean, ...] = ()


class StatisticsAccumulator:
    """Figures of a run in n intervals of time, all loose joints together.

    Parameters
    ----------
    edges : (n + 1,) ends of the intervals [s], rising
    """

    def __init__(self, edges: Array) -> None:
        self.edges = edges
        #: (n, 5) impacts, sum of normal impulses [N s], losses of contact, time in flight [s],
        #: energy dissipated by impacts, friction and dampers or taken by loads [J]; flight is the
        #: mean over the loose joints
        self.table = np.zeros((len(edges) - 1, len(MEANS) - 1))

    def add(self, piece: Piece) -> None:
        """Enter the piece that follows."""
        motion, impacts = piece.motion, Impacts.of(piece.impacts)
        intervals = self._intervals(impacts.column('t'))
        np.add.at(self.table[:, 0], intervals, 1.0)
        np.add.at(self.table[:, 1], intervals, impacts.column('normal_impulse'))
        # that of a touch is part of what its steps lose
        np.add.at(self.table[:, 4], intervals, impacts.sudden_loss)
        lost = [c.t for c in piece.modes if is_loss(c)]
        np.add.at(self.table[:, 2], self._intervals(lost), 1.0)
        curve, lost_in = motion.curve, piece.balance.work.friction
        k = self._intervals(curve.start)
        cut, edge, dt = self._cuts(curve, k)
        if motion.modes.shape[1]:
            share = (~motion.closed).mean(axis=1)
            np.add.at(self.table[:, 3], k, share * curve.duration)
            self._pass_on(3, edge, share[cut] * (curve.duration[cut] - dt))
        np.add.at(self.table[:, 4], k, lost_in)
        if len(cut) and piece.machine.physics.has_forces:
            before = work_since_start(piece.machine.physics, motion, cut, dt).friction
            self._pass_on(4, edge, lost_in[cut] - before)

    def _cuts(
        self, curve: PiecewisePolynomial, k: NDArray[np.intp]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
        """Segments (C,) with an edge within them, the edge, and the time until it [s].

        Parameters
        ----------
        k : the interval (m,) in which each segment begins
        """
        ends = np.searchsorted(self.edges[:-1], curve.start + curve.duration, side='left') - 1
        more = np.maximum(ends - k, 0)
        cut = np.repeat(np.arange(len(k)), more)
        first = np.repeat(np.cumsum(more) - more, more)
        edge = np.repeat(k, more) + 1 + np.arange(len(cut)) - first
        dt = (self.edges[edge] - curve.start[cut]) - curve.start_low[cut]
        return cut, edge, np.clip(dt, 0.0, curve.duration[cut])

    def _pass_on(self, figure: int, edge: NDArray[np.intp], later: Array) -> None:
        """Count what of a segment comes after an edge in the interval that begins there."""
        np.add.at(self.table[:, figure], edge - 1, -later)
        np.add.at(self.table[:, figure], edge, later)

    def _intervals(self, t: Array | Sequence[float]) -> NDArray[np.intp]:
        k = np.searchsorted(self.edges, np.asarray(t, dtype=float), side='right') - 1
        return np.clip(k, 0, len(self.table) - 1)

    def means(self, skip: int, turned: Array | None = None) -> list[Mean]:
        """`MEANS` of the intervals after the first `skip`.

        Parameters
        ----------
        turned : revolutions of the crank in each of these; default: one
        """
        kept, width = self.table[skip:].T, np.diff(self.edges)[skip:]
        turns = np.ones(len(width)) if turned is None else turned
        sums, per = (*kept, kept[1]), (turns, turns, turns, width, turns, kept[0])
        return [
            Mean(figure.name, figure.unit, *ratio(x, n))
            for figure, x, n in zip(MEANS, sums, per, strict=True)
        ]


def statistics(
    machine: Machine,
    revolutions: int = 200,
    skip: int = 20,
    progress: Callable[[float, int], None] | None = None,
    measures: Sequence[Measure] = (),
) -> Statistics:
    """Figures per revolution of all loose joints together, and measures of every revolution.

    The confidence intervals are those of 20 batch means: right if a batch is much longer than the
    memory of the motion. Flight counts each loose joint by itself.
    """
    validate_loose(machine, 'statistics need')
    if skip < 0:
        raise InputError(f'the revolutions to leave out must be at least 0, not {skip}')
    if revolutions < skip + BATCHES:
        raise InputError(
            f'statistics need at least {BATCHES} revolutions more than the {skip} skipped'
        )
    T = machine.drive.period
    taken = Measurement(machine, per_turn(measures, skip)) if measures else None
    accumulator = StatisticsAccumulator(np.arange(revolutions + 1.0) * T)
    observers = [accumulator.add, *([taken.add] if taken else [])]
    stream(machine, duration=revolutions * T, progress=progress, observers=observers).finish()
    *means, I_n = accumulator.means(skip)
    own = tuple(
        Mean(name, unit, *ratio(x, np.ones(len(x))))
        for name, unit, x in (taken.found_each_turn() if taken else ())
    )
    return Statistics(revolutions, skip, tuple(means), I_n.mean, I_n.half_width, own)
