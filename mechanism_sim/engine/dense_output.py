"""Dense output: the integrator's steps, stored until they are returned as motion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, GrowingRows, IndexArray, Mask
from mechanism_sim.engine.clock import Base
from mechanism_sim.engine.events import Mode
from mechanism_sim.engine.system import System
from mechanism_sim.memory import Reused
from mechanism_sim.numerics.polynomials import (
    Nodes,
    PiecewisePolynomial,
    Times,
    exact_sum,
    shift_powers,
)
from mechanism_sim.planar.drive import TWO_PI

_ALIKE, _TINY = 2.0**-30, 1e-300  # of the largest term of a coordinate, and least size of one
_KEYS, _REMEMBERED = 8192, 2**16  # segments that are compared at once, and with how many


@dataclass(frozen=True)
class Motion:
    """Motion of all coordinates, and the mode of every gap, on m segments."""

    curve: PiecewisePolynomial  #: the n coordinates, in the order of the mechanism
    modes: NDArray[np.uint8]  #: (m, gaps) values of `Mode`
    approach: Array  #: (m, gaps) [m/s] speeds of initial contact; rigid contacts: (m, 0)
    torques: Array  #: (m, k, 3) coefficients of the torque laws of k powered coordinates
    acting: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((0, 0), np.uint8))
    """(m, h) rows of switches of loads and frictions that depend on rates: off, on or holding;
    then 1 or 0 for the sign of each normal force with joint friction. (0, 0) if not known."""
    states: Array = field(default_factory=lambda: np.zeros((0, 0, 1)))
    """(m, k, d + 1) coefficients of k states of first order, as those of `curve`, each in its own
    unit; (0, 0, 1) without states."""

    def __len__(self) -> int:
        return len(self.curve)

    @property
    def closed(self) -> Mask:
        """Mask of the gaps that carry force, (m, gaps)."""
        return self.modes > Mode.FREE_FLIGHT

    def modes_at(self, segments: IndexArray, dt: Times) -> NDArray[np.uint8]:
        """Modes (gaps, N) at times `dt`, in the order of ``curve.at(segments, dt)``."""
        return _repeated(self.modes[segments], dt).T

    def closed_at(self, segments: IndexArray, dt: Times) -> Mask:
        """Flags (gaps, N) at times `dt`, in the order of ``curve.at(segments, dt)``."""
        return self.modes_at(segments, dt) > Mode.FREE_FLIGHT

    def approach_at(self, segments: IndexArray, dt: Times) -> Array:
        """Speeds of initial contact (gaps, N) [m/s]."""
        return _repeated(self.approach[segments], dt).T

    def torques_at(self, segments: IndexArray, dt: Times) -> Array:
        """Coefficients of the torque laws (k, 3, N)."""
        return _repeated(self.torques[segments], dt).transpose(1, 2, 0)

    @property
    def state_curve(self) -> PiecewisePolynomial:
        """The k states of first order."""
        c, powers = self.curve, self.states
        if len(powers) != len(c):
            powers = np.zeros((len(c), 0, 1))
        turns = np.zeros(powers.shape[:2], np.int64)
        return PiecewisePolynomial(c.start, c.start_low, c.duration, turns, powers)

    @property
    def rows(self) -> PiecewisePolynomial:
        """The coordinates, then the states of first order: (n + k) rows."""
        c, states = self.curve, self.states
        if not states.size:
            return c
        powers = np.zeros((len(c), c.turns.shape[1] + states.shape[1], c.coefficients.shape[2]))
        n = c.turns.shape[1]
        powers[:, :n], powers[:, n:, : states.shape[2]] = c.coefficients, states
        turns = np.pad(c.turns, ((0, 0), (0, states.shape[1])))
        return PiecewisePolynomial(c.start, c.start_low, c.duration, turns, powers)

    def alike(self, segments: IndexArray) -> IndexArray:
        """Numbers (k,) of segments (k,), equal for equal motions but for whole turns.

        Their coefficients agree on a grid, which is coarser than rounding. Of very many different
        ones, as of chaotic motions, only the first are remembered.
        """
        c = self.rows
        blocks = [segments[first : first + _KEYS] for first in range(0, len(segments), _KEYS)]
        degrees = np.arange(c.coefficients.shape[2])

        def powers(k: IndexArray) -> Array:
            return np.asarray(c.coefficients[k] * c.duration[k, None, None] ** degrees)

        sizes = np.full(c.turns.shape[1], _TINY)
        for k in blocks:
            sizes = np.maximum(sizes, np.abs(powers(k)).max(axis=(0, 2)))
        known: dict[bytes, int] = {}
        found, count = np.empty(len(segments), np.intp), 0
        for first, k in zip(range(0, len(segments), _KEYS), blocks, strict=True):
            parts = [np.round(powers(k) / sizes[:, None] / _ALIKE)]
            parts += [x[k] for x in (self.modes, self.approach, self.torques)]
            parts += [self.acting[k]] if self.acting.size else []
            keys = np.hstack([x.reshape(len(k), -1) for x in parts]) + 0.0  # no zero is negative
            for i, key in enumerate(map(np.ndarray.tobytes, keys), first):
                found[i] = known.get(key, count)
                if found[i] == count:
                    count += 1
                    if len(known) < _REMEMBERED:
                        known[key] = found[i]
        return found

    def _of_rows(self, rows: PiecewisePolynomial, kept: slice) -> Motion:
        """Motion of some segments, from their coordinates and states `rows`."""
        n = self.curve.turns.shape[1]
        turns, powers = rows.turns[:, :n], rows.coefficients[:, :n]
        curve = PiecewisePolynomial(rows.start, rows.start_low, rows.duration, turns, powers)
        acting = self.acting[kept] if self.acting.size else self.acting
        states = rows.coefficients[:, n:] if self.states.size else self.states
        return Motion(
            curve, self.modes[kept], self.approach[kept], self.torques[kept], acting, states
        )

    def between(self, start: float, end: float) -> Motion:
        """The motion from one time [s] to a later one, both within it."""
        curve = self.rows
        (first,), (into,) = curve.find(np.array([start]))
        last = int(np.searchsorted(curve.start, end)) - 1
        kept = slice(int(first), max(last, int(first)) + 1)
        starts, low = curve.start[kept].copy(), curve.start_low[kept].copy()
        duration, powers = curve.duration[kept].copy(), curve.coefficients[kept].copy()
        powers[0] = shift_powers(powers[0], np.full(powers.shape[1], into))
        starts[0], low[0], duration[0] = start, 0.0, duration[0] - into
        duration[-1] = end - starts[-1] - low[-1]
        piece = PiecewisePolynomial(starts, low, duration, curve.turns[kept], powers)
        return self._of_rows(piece, kept)

    def parts(self, most: int) -> Iterator[Motion]:
        """Consecutive parts of this motion, of at most so many segments."""
        c = self.rows
        for first in range(0, len(self), most):
            kept = slice(first, first + most)
            piece = PiecewisePolynomial(
                c.start[kept], c.start_low[kept], c.duration[kept], c.turns[kept],
                c.coefficients[kept],
            )  # fmt: skip
            yield self._of_rows(piece, kept)

    @classmethod
    def joined(cls, parts: list[Motion]) -> Motion:
        """One motion from consecutive parts; see `GrowingMotion` for very many."""
        if len(parts) == 1:
            return parts[0]
        own = zip(*(part.columns for part in parts), strict=True)
        curve = PiecewisePolynomial.joined([part.curve for part in parts])
        return cls(curve, *map(np.concatenate, own))

    @property
    def columns(self) -> tuple[NDArray[Any], ...]:
        """All fields beside `curve`."""
        return self.modes, self.approach, self.torques, self.acting, self.states


class GrowingMotion:
    """Motion joined from consecutive parts that need not be kept, see `GrowingRows`."""

    def __init__(self) -> None:
        self._rows: list[GrowingRows] = []

    def add(self, part: Motion) -> None:
        """Append the part that follows."""
        columns = *part.curve.columns, *part.columns
        self._rows = self._rows or [GrowingRows() for _ in columns]
        for rows, column in zip(self._rows, columns, strict=True):
            rows.add(column)

    def whole(self) -> Motion:
        """The motion of all parts, of which there is one at least."""
        start, low, duration, turns, powers, *others = (rows.rows() for rows in self._rows)
        return Motion(PiecewisePolynomial(start, low, duration, turns, powers), *others)


def _repeated(rows: NDArray[Any], dt: Times) -> NDArray[Any]:
    """Rows of segments, repeated for each requested instant in them."""
    each = instants(dt)
    return rows if each == 1 else np.repeat(rows, each, axis=0)


def instants(dt: Times) -> int:
    """Number of instants requested in each segment."""
    return len(dt.fractions) if isinstance(dt, Nodes) else math.prod(dt.shape[1:])


class Status(NamedTuple):
    """The contacts while a step is taken."""

    modes: tuple[int, ...]
    approach: tuple[float, ...]
    acting: tuple[int, ...] = ()  #: rows of the switches of rates, then signs of sides


BLOCK = 256
"""Number of steps in a block of memory."""
_KEPT = 2**24  # [B] of blocks that runs leave to later ones


def floats(array: Array) -> memoryview[float]:
    """A flat view, read and written as plain floats: far faster than elements of an array."""
    return array.data.cast('B').cast('d')


class DenseOutput:
    """Taylor coefficients of the steps since the last `drain`.

    A step is first written to its slot ``slots[len(lengths)]``, then entered in `taus` and
    `lengths`; the event loop does so itself, being the innermost of all loops. Memory is used
    again after every `drain`, and by the next run: fresh memory costs more than the step.

    Attributes
    ----------
    slots : views of (width) (order + 1) floats, always with room for two more steps
    taus : start of every step, since the base [s]
    lengths : length of every step [s]
    """

    _left: ClassVar[Reused[tuple[Array, list[memoryview[float]]]]] = Reused(
        lambda made: _KEPT // made[0].nbytes
    )

    def __init__(self, system: System, order: int) -> None:
        self.slots: list[memoryview[float]] = []
        self.taus: list[float] = []
        self.lengths: list[float] = []
        self._shape = (system.width, order + 1)
        self._blocks: list[Array] = []
        self._system = system
        self._bases: list[Base] = []
        self._marks: list[tuple[int, Status, int]] = []  # from which step on, which base
        self._drained = 0
        self.grow()

    @property
    def count(self) -> int:
        """Number of steps since the start."""
        return self._drained + len(self.lengths)

    @property
    def next(self) -> Array:
        """The coefficients (width, order + 1) of the step that comes after those entered."""
        return np.asarray(self.slots[len(self.lengths)]).reshape(self._shape)

    def restart(self) -> None:
        """Forget all steps and bases."""
        self.taus.clear()
        self.lengths.clear()
        self._bases.clear()
        self._marks.clear()
        self._drained = 0

    def grow(self) -> None:
        """Make room for more steps."""
        found = self._left.take(self, lambda left: left[0].shape[1:] == self._shape)
        block, slots = found or self._left.lend(self._made(), self)
        self._blocks.append(block)
        self.slots += slots

    def _made(self) -> tuple[Array, list[memoryview[float]]]:
        block = np.zeros((BLOCK, *self._shape))
        row, flat = block[0].size, floats(block)
        return block, [flat[i : i + row] for i in range(0, block.size, row)]

    def enter(self, tau: float, h: float) -> None:
        """Enter the step in the current slot."""
        self.taus.append(tau)
        self.lengths.append(h)
        self.provide()

    def add(self, taus: Array, lengths: Array, rows: Array) -> None:
        """Enter n steps.

        Parameters
        ----------
        taus, lengths : starts and lengths of these steps at least [s]
        rows : (n, width (order + 1)) coefficients
        """
        first, done = len(self.lengths), 0
        self.taus += taus[: len(rows)].tolist()
        self.lengths += lengths[: len(rows)].tolist()
        self.provide()
        while done < len(rows):
            number, at = divmod(first + done, BLOCK)
            part = rows[done : done + BLOCK - at]
            self._blocks[number].reshape(BLOCK, -1)[at : at + len(part)] = part
            done += len(part)

    def provide(self) -> None:
        """Provide room for two more steps."""
        while len(self.lengths) >= len(self.slots) - 1:
            self.grow()

    def mark(self, base: Base, status: Status, first: int | None = None) -> None:
        """Set base and status of the steps entered from now on, or of those from `first` on."""
        first = len(self.lengths) if first is None else first
        if not self._bases or base is not self._bases[-1]:
            self._bases.append(base)
        if self._marks and self._marks[-1][0] == first:
            self._marks.pop()  # no step was taken in it
        self._marks.append((first, status, len(self._bases) - 1))

    @property
    def status(self) -> Status:
        """The status of the steps entered from now on."""
        return self._marks[-1][1]

    def drain(self) -> Motion:
        """The steps since the last call as motion.

        A rate's Taylor polynomial, integrated, gives its angle one order higher than the
        integrator's own.
        """
        motion, count = self.motion(), len(self.lengths)
        # The next step may be in its slot already: it becomes the first.
        self.slots[0][:] = self.slots[count]
        self._drained += count
        self.taus.clear()
        self.lengths.clear()
        self._bases = self._bases[-1:]
        self._marks = [(0, self._marks[-1][1], 0)]
        return motion

    def peek(self, tau: float, h: float) -> Motion:
        """Beginning of the step in the current slot as motion, up to `h` [s] after its start.

        Nothing is entered. To be called after `drain`.
        """
        self.taus.append(tau)
        self.lengths.append(h)
        motion = self.motion()
        self.taus.clear()
        self.lengths.clear()
        return motion

    def motion(self) -> Motion:
        """The steps since the last `drain` as motion."""
        system, count = self._system, len(self.lengths)
        begins, status, marked = zip(*self._marks, strict=True)
        each = [end - begin for begin, end in pairwise((*begins, count))]
        f, order = len(system.free), self._shape[1]
        coefficients = np.zeros((count, len(system.coordinates), order + 1))
        states = np.zeros((count if system.states else 0, len(system.states), order))
        orders = np.arange(1.0, order + 1.0)
        for first, block in zip(range(0, count, BLOCK), self._blocks, strict=False):
            raw, into = block[: count - first], coefficients[first : first + BLOCK]
            # the series of the rate, integrated term by term: it has a degree more than that of
            # the coordinate, and its derivative is the integrated rate exactly
            for i, name in enumerate(system.free):
                c = system.coordinates.index(name)
                into[:, c, 0] = raw[:, i, 0]
                np.divide(raw[:, f + i], orders, out=into[:, c, 1:])
            for k, known in enumerate(system.states):
                states[first : first + BLOCK, k] = raw[:, 2 * f + k] * known.scale
        tau, of = np.array(self.taus), np.repeat(np.array(marked, dtype=np.intp), each)
        for p, name in enumerate(system.prescribed):
            law = np.zeros((len(self._bases), system.degree + 1))
            for row, base in zip(law, self._bases, strict=True):
                row[: len(base.laws[p])] = base.laws[p]
            law = law[of]
            coefficients[:, system.coordinates.index(name), : law.shape[1]] = shift_powers(
                law, tau
            )
        high = np.array([base.high for base in self._bases])[of]
        low = np.array([base.low for base in self._bases])[of]
        turns = [[base.turns.get(c, 0) for c in system.coordinates] for base in self._bases]
        start, start_low = exact_sum(high, low, tau)
        return Motion(
            PiecewisePolynomial(
                start,
                start_low,
                np.array(self.lengths),
                np.array(turns, dtype=np.int64)[of],
                coefficients,
            ),
            np.repeat(np.array([s.modes for s in status], np.uint8), each, axis=0),
            np.repeat(np.array([s.approach for s in status], np.float64), each, axis=0),
            self._torques(of),
            np.repeat(np.array([s.acting for s in status], np.uint8), each, axis=0),
            states,
        )

    def _torques(self, of: IndexArray) -> Array:
        """The torque laws of every step, for angles with all their turns."""
        laws = np.zeros((len(self._bases), len(self._system.powered), 3))
        for row, base in zip(laws, self._bases, strict=True):
            for k, c in enumerate(self._system.powered):
                row[k] = base.torques[k]
                if row[k, 1]:
                    row[k, 0] -= row[k, 1] * float(base.turns[c] * TWO_PI)
        return laws[of]
