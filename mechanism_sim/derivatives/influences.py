"""Dependence of a machine on numbers of its scene: parameters, start, laws, impacts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import islice
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.derivatives.numeric_keys import NumericKey, differences
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.events import Impact
from mechanism_sim.engine.system import System
from mechanism_sim.errors import InputError
from mechanism_sim.numerics import compiled
from mechanism_sim.planar.drive import TWO_PI, DriveLaw, Law, unrolled
from mechanism_sim.scene import Machine

_Begun = tuple[tuple[int, ...], tuple[int, ...]]  # modes of contacts, rows of switches

NUMBERS = tuple(n for n in Impact._fields if n not in ('joint', 'ends_chatter'))
"""Fields of an impact that have derivatives."""


class LawTable(NamedTuple):
    """The laws of a drive in the order of time, of k numbers each.

    Numbers of a prescribed coordinate are coefficients of powers of the time since `start`.
    """

    start: Array  #: (l,) times [s] from which the laws hold
    numbers: Array  #: (l, k)


class Influence(NamedTuple):
    """Numbers of a machine that determine its runs, or their derivatives (..., P) by P keys."""

    parameters: Array  #: (n,) parameters of the equations
    start: Array  #: (w,) initial free coordinates, their rates, states of first order
    laws: list[LawTable]  #: laws of prescribed, then powered coordinates
    restitution: Array  #: (m,) coefficients of restitution of the gaps
    friction: Array  #: (m,) coefficients of friction of the gaps
    approach: Array  #: (a,) speeds of initial contact [m/s] of contacts closed at the start
    rows: list[Array]  #: (rows, symbols) values in all rows of every switch
    begun: list[set[_Begun]]  #: by key: modes and switch rows at shifted starts, if they differ


def influences(machine: Machine, keys: Sequence[NumericKey], end: float) -> Influence:
    """Derivatives (..., P) of all numbers that determine a run up to a time [s], by P keys."""
    base, columns, begun = _Parts(machine, end), [], []
    for key in keys:
        base.others = set()
        columns.append(differences(key, base.of, base.values))
        begun.append(base.others)
    return base.split(np.array(columns).reshape(len(keys), len(base.values)).T, begun)


def built_in(key: NumericKey) -> bool:
    """True if a number stands in the equations themselves, not only in their parameters."""
    some, other = (_terms(m.equations.system) for m in (key.machine, key.beside[0]))
    return not compiled.alike(some, other)


def own(machine: Machine, end: float) -> Influence:
    """The numbers themselves."""
    base = _Parts(machine, end)
    return base.split(base.values, [])


def behind(known: Influence, count: int) -> Influence:
    """Zero derivatives by `count` keys, followed by the known ones."""

    def wide(x: Array) -> Array:
        return np.pad(x, [*[(0, 0)] * (x.ndim - 1), (count, 0)])

    laws = [LawTable(*map(wide, table)) for table in known.laws]
    rows, e, mu = [wide(x) for x in known.rows], wide(known.restitution), wide(known.friction)
    parameters, start, approach = map(wide, (known.parameters, known.start, known.approach))
    begun = [*(set() for _ in range(count)), *known.begun]
    return Influence(parameters, start, laws, e, mu, approach, rows, begun)


class _Parts:
    """Numbers of a machine in one vector, and of others of the same structure."""

    def __init__(self, machine: Machine, end: float) -> None:
        plan, self._system = machine.plan, machine.equations.system
        self._driven = [*plan.prescribed, *plan.powered]
        self._laws = [plan.laws_until(c, end, None)[0] for c in self._driven]
        self._names = _names(self._system)
        self._begun: _Begun | None = None
        self._rubbing: list[float] = []
        self.others: set[_Begun] = set()
        self._shapes: list[tuple[int, ...]] = []
        self.values = self.of(machine)

    def of(self, machine: Machine) -> Array:
        """The vector of a machine."""
        system, run = machine.equations.system, machine.start()
        if _names(system) != self._names:
            return np.zeros(0)
        assert isinstance(run, EventLoop)  # noqa: S101 - its equations are integrated
        state = run.state
        turned = np.array(state.q) + 2.0 * np.pi * np.array(state.turns, dtype=float)
        scaled = [x * s.scale for x, s in zip(state.states, system.states, strict=True)]
        snapshot = run.snapshot()
        begun = snapshot.modes, snapshot.switches
        index = system.parameters  # pins whose forces turn rub on
        first, last = len(index.sides), len(index.sides) + len(index.towards)
        sides = [*snapshot.rubbing[:first], *snapshot.rubbing[last:]]
        self._begun, self._rubbing = self._begun or begun, self._rubbing or sides
        if begun != self._begun:
            self.others.add(begun)
        if sides != self._rubbing:
            raise InputError(
                f'{machine.name}: joints with friction that rest at the start slip with another '
                'value of this key: no derivative'
            )
        parts = [
            system.parameters.values,
            np.array([*turned, *state.v, *scaled]),
            *(x for table in self._tables(machine) for x in table),
            np.array([gap.restitution for gap in system.gaps]),
            np.array([g.friction if math.isfinite(g.friction) else 0.0 for g in system.gaps]),
            np.array(snapshot.approach),
            *(np.array(s.every_row) for s in system.switches),
        ]
        shapes = [x.shape for x in parts]
        self._shapes = self._shapes or shapes
        if shapes != self._shapes:
            return np.zeros(0)
        return np.concatenate([x.ravel() for x in parts])

    def _tables(self, machine: Machine) -> list[LawTable]:
        plan, tables = machine.plan, []
        for c, known in zip(self._driven, self._laws, strict=True):
            laws = [*islice(unrolled(plan.laws[c], plan.sources.get(c)), len(known))]
            rows = [_numbers(law, at) for law, at in zip(laws, known, strict=False)]
            width = max(len(row) for row in rows)
            numbers = [[*row, *[0.0] * (width - len(row))] for row in rows]
            tables.append(LawTable(np.array([law.valid_from for law in laws]), np.array(numbers)))
        return tables

    def split(self, values: Array, begun: list[set[_Begun]]) -> Influence:
        """The parts of vectors (n, ...)."""
        parts, at = [], 0
        for shape in self._shapes:
            size = int(np.prod(shape))
            parts.append(values[at : at + size].reshape(*shape, *values.shape[1:]))
            at += size
        count = 2 * len(self._driven)
        laws = [LawTable(*parts[2 + k : 4 + k]) for k in range(0, count, 2)]
        e, mu, approach, *rows = parts[2 + count :]
        return Influence(parts[0], parts[1], laws, e, mu, approach, rows, begun)


def _names(system: System) -> list[str]:
    """Names of the parameters of a run; observers add others."""
    return [*system.equations.parameters.names][: len(system.parameters.values)]


def _terms(system: System) -> list[object]:
    d = system.dynamics
    values = (jet.value for jet in d.contacts.normal)
    return [*d.stabilised.a, *d.state_rates, *values, *d.depths.values()]


def _numbers(law: Law, at: Law) -> list[float]:
    """Coefficients of a law about the time from which the law `at` holds."""
    if not isinstance(law, DriveLaw):
        return [*law.coefficients]
    turns, (angle, *rates) = law.about(Fraction(at.valid_from))
    return [angle + float(turns * TWO_PI), *rates]
