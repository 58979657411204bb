"""Distances of points of a file from the path of a point of a link.

A file has columns ``x`` and ``y``, or one of another name for a coordinate, and units in its
headings. With a further column ``angle``, by which the main drive has turned since its start, or
``t``, each point belongs to an instant; without, the nearest place of the path counts. A point
whose angle is outside of a window is looked for a turn, or as many as the column is long, away: if
the path has come again by then, or that of the ideal machine does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.csv_tables import read_csv
from mechanism_sim.errors import InputError, quoted
from mechanism_sim.results.quantities.motion import RATES
from mechanism_sim.results.run import Piece
from mechanism_sim.scene import Machine
from mechanism_sim.units import read_common

_LOOKS = np.linspace(0.0, 1.0, 9)  # positions in a step between which the nearest is searched
_CANDIDATES = 3  # number of nearest positions that are each refined: paths may cross themselves
_AGAIN = 1e-6
"""Share of the size of the machine, or of a radian, within which a path has come again."""
_REFINED = 8  # steps of Newton's method from there; each doubles the digits
_TIMED = {'angle': 'rad', 't': 's'}
_ANGLES = {**_TIMED, 'orientation': 'rad'}

Values = Callable[[Array], dict[str, Array]]
"""Quantities (N,) by name at instants (N,)."""


def _slack(t: float) -> float:
    """Tolerance [s] within which two instants are the same."""
    return 1e-9 * (t + 1.0)


class TargetPath(NamedTuple):
    """Points of a file, in SI units."""

    #: (n, 2), (n, 3) with an orientation, or (n, 1) of a coordinate
    points: tuple[tuple[float, ...], ...]
    by: str  #: ``angle`` or ``t`` of each point, at `at` (n,); empty for the nearest position
    at: tuple[float, ...]


def read_path(file: Path, where: str) -> TargetPath:
    """Points of a file."""
    table = read_csv(file, where)
    timed = [c for c in table.cells if c in _TIMED][:1]
    others = [c for c in table.cells if c not in _TIMED]
    columns = ['x', 'y'] if 'x' in others or len(others) > 1 else others
    columns += [c for c in others if c == 'orientation' and c not in columns]
    found = []
    for column in [*columns, *timed]:
        unit = table.units.get(column, '') if table.column(column) else ''
        factor, si = 1.0, unit
        if unit:
            try:
                factor, si = read_common('1', unit)
            except ValueError as error:
                raise InputError(f"{table.where}: column '{column}' {error}") from error
        wanted = _ANGLES.get(column) or ('m' if column in 'xy' else si)
        if si != wanted:
            raise InputError(
                f"{table.where}: column '{column}' needs a unit of {wanted} in its heading, as in "
                f"'{column} [{'mm' if wanted == 'm' else 'deg' if wanted == 'rad' else wanted}]'"
            )
        found.append(factor * table.numbers(column)[:, 0])
    if not found or not len(found[0]):
        raise InputError(f"{table.where} needs columns x and y with units, as 'x [mm]'")
    points = zip(*(x.tolist() for x in found[: len(columns)]), strict=True)
    return TargetPath(tuple(points), ''.join(timed), tuple(found[-1].tolist() if timed else ()))


def names_of(text: str, path: TargetPath) -> tuple[str, ...]:
    """Positions, velocities and accelerations that distances of ``position.NAME`` need."""
    kind, _, rest = text.partition('.')
    if kind != 'position' or not rest:
        raise InputError(f'distance needs a position, as position.LINK.POINT, not {quoted(text)}')
    axes = ('.x', '.y') if len(path.points[0]) > 1 else ('',)
    return tuple(f'{k}.{rest}{a}' for k in RATES for a in axes)


class PathDistances:
    """Least distances (n,) of points from a path in pieces.

    Parameters
    ----------
    names : result of `names_of`
    """

    def __init__(self, machine: Machine, path: TargetPath, names: tuple[str, ...]) -> None:
        self._path, self._names = path, names
        self._points: Array = np.array(path.points)[:, :2]
        self._least = np.full(len(self._points), np.inf)
        self._at, self._periods, self._again = np.array(path.at), [math.inf], {0.0}
        alone = names[0].removeprefix('position.')
        self._turns = len(names) == len(RATES) and alone not in machine.mechanism.displacements
        self._near = _AGAIN * (1.0 if self._turns else machine.mechanism.size)
        self._moved = np.zeros(len(self._points))  # [s] by which a point was looked for elsewhere
        self._first: Array | None = None
        if path.by == 'angle':
            speed = abs(machine.drive.start[1])
            if not (machine.drive.steady and speed):
                raise InputError('distance: a column angle needs a drive at constant speed')
            turn, self._at = 2.0 * math.pi / speed, self._at / speed
            turns, again = math.ceil(np.ptp(self._at) / turn - 1e-9), machine.drive.repetition
            self._periods = [turn] if turns <= 1 else [turn, turns * turn]
            if machine.level.dynamic and again.found:  # where a path comes again only nearly
                self._again |= {n * turn for n in (1, turns) if n % again.turns == 0}

    def add(self, piece: Piece, since: float, until: float, values: Values) -> None:
        """Enter the part of a piece within a window [s]."""
        start, end = piece.motion.curve.spans(since, until)
        if not len(start):
            return
        first, last = float(start[0]), float(end[-1])
        if self._path.by:
            slack, begin = _slack(last), max(since, 0.0)
            low = begin - 1e-9 * self._periods[0]
            for period in self._periods:
                t = low + np.mod(self._at - low, period) if period < math.inf else self._at
                inside = np.flatnonzero((t >= first - slack) & (t <= last))
                if len(inside):
                    places = self._rows(values(np.clip(t[inside], first, last)))[0]
                    self._least[inside] = self._off(places, self._points[inside].T)
                    moved = np.abs(t[inside] - self._at[inside])
                    self._moved[inside] = np.where(moved > slack, period, 0.0)
            self._compare(begin, first, last, values)
            return
        looks = (start[:, None] + (end - start)[:, None] * _LOOKS).ravel()
        way = self._rows(values(looks))[0]
        squares = ((way[:, None] - self._points.T[..., None]) ** 2).sum(axis=0)
        rows = np.arange(len(squares))
        for _ in range(_CANDIDATES):
            near = squares.argmin(axis=1)
            before, after = np.maximum(near - 1, 0), np.minimum(near + 1, len(looks) - 1)
            self._refine(looks[near], looks[before], looks[after], values)
            for k in (before, near, after):
                squares[rows, k] = np.inf

    def _compare(self, begin: float, first: float, last: float, values: Values) -> None:
        """Enter the periods from an instant [s] on after which the path has come again."""
        for period in (0.0, *self._periods):
            t = np.clip([begin + period], first, last)
            if abs(t[0] - begin - period) <= _slack(last):
                place = self._rows(values(t))[0]
                self._first = place if self._first is None else self._first
                if self._off(place, self._first)[0] <= self._near:
                    self._again.add(period)

    def _off(self, places: Array, points: Array) -> Array:
        """Distances (N,) of places (d, N) from points; an angle is the same whole turns on."""
        off = places - points
        if self._turns:
            off = np.remainder(off + math.pi, 2.0 * math.pi) - math.pi
        return np.asarray(np.hypot.reduce(off, axis=0))

    def _refine(self, t: Array, low: Array, high: Array, values: Values) -> None:
        """Enter the nearest positions by Newton's method from instants (n,), between limits."""
        for _ in range(_REFINED + 1):
            place, rate, second = self._rows(values(t))
            off = place - self._points.T
            self._least = np.minimum(self._least, np.sqrt((off**2).sum(axis=0)))
            slope, square = (off * rate).sum(axis=0), (rate**2).sum(axis=0)
            bend = square + (off * second).sum(axis=0)
            bend = np.where(bend > 0.1 * square, bend, square)
            step = np.divide(slope, bend, out=np.zeros_like(t), where=bend > 0.0)
            t = np.clip(t - step, low, high)

    def _rows(self, known: dict[str, Array]) -> Array:
        """Position, velocity and acceleration (3, d, N)."""
        rows = np.array([known[name] for name in self._names])
        return rows.reshape(3, len(self._names) // 3, -1)

    def result(self, largest: bool) -> tuple[float, str]:
        """Root mean square, or the largest; not a number where some were not reached, and why."""
        found = np.isin(self._moved, list(self._again)) & np.isfinite(self._least)
        if not found.all():
            missed, of = np.flatnonzero(~found), self._path
            at, first = '', of.at[missed[0]] if of.by else 0.0
            if of.by:
                at = f't = {first:.6g} s' if of.by == 't' else f'{math.degrees(first):.6g} deg'
                at = f', the first at {at} from its start'
            return math.nan, f'the run does not come to {len(missed)} of {len(found)} points{at}'
        return float(self._least.max() if largest else math.sqrt((self._least**2).mean())), ''
