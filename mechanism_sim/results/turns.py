"""Turns of a coordinate: numbers and end times; means per turn, with intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.events import Impacts
from mechanism_sim.numerics.batch_means import ratio
from mechanism_sim.numerics.polynomials import TWO_PI, PiecewisePolynomial
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.results.measure_text import Bound
from mechanism_sim.results.run import Piece
from mechanism_sim.results.strokes import one_way_ends
from mechanism_sim.scene import Machine

_BISECTIONS = 60

Place = tuple[int, float]
"""Whole turns, and [rad] beside them."""


def beginning(curve: PiecewisePolynomial, column: int) -> Place:
    """Position of a coordinate where a motion begins."""
    local = curve.local(np.zeros(1, np.intp), np.zeros(1))
    return int(curve.turns[0, column]), float(local[0, column])


def turns_at(
    curve: PiecewisePolynomial,
    column: int,
    k: NDArray[np.intp],
    dt: Array,
    since: Place = (0, 0.0),
) -> Array:
    """Signed turns (N,) of a coordinate; whole ones are integers, so long runs lose no digits.

    Parameters
    ----------
    k, dt : (N,) segments, and times since they begin [s]
    since : position from which turns are counted; by default angle zero
    """
    whole = curve.turns[k, column] - since[0]
    return np.asarray(whole + (curve.local(k, dt)[:, column] - since[1]) / TWO_PI)


def impacts_by_turn(
    turn: NDArray[np.int64], impulse: Array, turns: int, joint: NDArray[np.int64] | int = 0,
    joints: int = 1,
) -> tuple[NDArray[np.int64], Array]:  # fmt: skip
    """Numbers of impacts and sums of their normal impulses [N s], each (turns, joints).

    Parameters
    ----------
    turn, joint : (n,) indices of the turn and joint of each impact
    """
    cell, size = turn * joints + joint, turns * joints
    count = np.asarray(np.bincount(cell, minlength=size), np.int64)
    total = np.asarray(np.bincount(cell, impulse, size), np.float64)
    return count.reshape(turns, joints), total.reshape(turns, joints)


class DriveTurns:
    """Times of numbers of turns of the drive, known as far as the motion is."""

    def __init__(self, machine: Machine, begin: float = -math.inf) -> None:
        """`begin` [s]: what was before counts as not seen."""
        self._first, self._drive = begin, machine.drive
        self._lawful = isinstance(machine.drive.law, DriveLaw) and not machine.drive.law.straight
        self._foretold = machine.drive.times_of(count(1)) if self._lawful else iter(())
        self._next = next(self._foretold, None)
        self._index = machine.physics.coordinates.index(machine.plan.main)
        self._start: Place | None = None
        self._piece: tuple[PiecewisePolynomial, Array, Array] | None = None
        self._parts: dict[float, float] = {}  # when turns were made that are not whole ones
        #: the start of the run, and the ends of its whole turns so far [s]
        self.edges: list[float] = []
        #: known range [s]: a resumed run begins later than its first turn
        self.begin = self.end = 0.0

    def add(self, piece: Piece) -> None:
        """Search for whole turns in the next piece."""
        curve = piece.motion.curve
        begin, self.end = float(curve.start[0]), curve.end
        if self._start is None:
            self._start, self.begin = beginning(curve, self._index), max(begin, self._first)
            self.edges = [0.0 if self._lawful else begin]
        while self._next is not None and self._next <= self.end * (1.0 + 1e-12):
            self.edges.append(min(self._next, self.end))
            self._next = next(self._foretold, None)
        if self._next is not None:
            return
        if self._lawful and self._piece is None and len(self.edges) == 1:  # it comes to rest
            self.edges = [self.begin]
        ends = one_way_ends(curve, self._index)
        self._piece = curve, ends, self._turned(curve, ends)
        while (t := self._passage(len(self.edges))) is not None:
            self.edges.append(t)

    def _passage(self, turns: float) -> float | None:
        """Time at which the drive has made so many turns [s], if that is in the last piece."""
        if self._piece is None:
            return None
        curve, ends, turned = self._piece
        later = np.flatnonzero(turned >= turns)
        if not later.size:
            return None
        low, high = (float(ends[k]) for k in (max(later[0] - 1, 0), later[0]))
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            far = self._turned(curve, np.array([middle]))[0] >= turns
            low, high = (low, middle) if far else (middle, high)
        return high

    def _turned(self, curve: PiecewisePolynomial, t: Array) -> Array:
        """Turns since the start (N,), in either direction."""
        assert self._start is not None  # noqa: S101 - set where the first motion begins
        return np.abs(turns_at(curve, self._index, *curve.find(t), self._start))

    @property
    def unseen(self) -> int:
        """Turns missing from the run, entirely or at their beginning."""
        first = self.begin - 1e-9 * self.begin
        return sum(edge < first for edge in self.edges)

    def time(self, bound: Bound) -> float:
        """A bound in seconds; infinite if it is not reached yet."""
        if not bound.revolutions:
            return bound.value
        turns = bound.value
        if turns == math.floor(turns):
            return self.edges[int(turns)] if turns < len(self.edges) else math.inf
        if turns not in self._parts:
            t = next(self._drive.times_of([turns]), None) if self._lawful else None
            t = self._passage(turns) if t is None else t  # at rest until it takes a command, say
            if t is None:
                return math.inf
            self._parts[turns] = t
        return self._parts[turns]


@dataclass(frozen=True)
class Mean:
    """A figure per revolution: its mean, and half the width of its 95 % confidence interval."""

    name: str
    unit: str
    mean: float
    half_width: float
    revolutions: int = 0  #: number of revolutions

    def shown(self, scale: float = 1.0) -> str:
        """Mean and half width times a scale as text; the mean alone if the width is unknown."""
        text = f'{scale * self.mean:.6g}'
        known = math.isfinite(self.half_width)
        return f'{text} +- {scale * self.half_width:.2g}' if known else text


def impact_means(count: Array, impulse: Array) -> tuple[Mean, Mean, Mean]:
    """Impacts and normal impulse per revolution, and impulse per impact ([SB] 7.3).

    Parameters
    ----------
    count, impulse : (n,) impacts and sums of their normal impulses [N s] in n whole revolutions
    """
    x, one, used = np.asarray(count, float), np.ones(len(count)), len(count)
    return (
        Mean('impacts', '', *ratio(x, one), used),
        Mean('impulse', 'N s', *ratio(impulse, one), used),
        Mean('I_n', 'N s', *ratio(impulse, x), used),
    )


class ImpactAccumulator:
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
        impacts = Impacts.of(piece.impacts)
        k = np.searchsorted(edges, impacts.column('t'), side='right') - 1
        impulse = impacts.column('normal_impulse')
        self._table += np.column_stack(impacts_by_turn(k, impulse, len(edges)))

    @property
    def means(self) -> tuple[Mean, Mean, Mean] | None:
        """Per whole revolution so far, see `impact_means`; None before there are two.

        Nor are there any of a machine without loose joints, or whose drive slides.
        """
        count, impulse = self._table[self._turns.unseen : -1].T
        return impact_means(count, impulse) if len(count) > 1 else None
