"""Defect control: how well a step satisfies the equations of motion if formulas are steep.

The length of a Taylor step follows from its last coefficients. They say nothing of a formula that
turns steep farther on: ``tanh(v/0.01)`` is constant to rounding a few cm/s away from rest, a pulse
is zero before it begins, and a step would go on as if it were so for ever. So the polynomials are
put into the equations (defect control: Enright 1989, ACM Trans. Math. Softw. 15:13), at places so
close that enclosures of the formulas leave nothing to be found between them.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.first_look import first_look, look_first, powers_at
from mechanism_sim.engine.system import System
from mechanism_sim.numerics.complementarity import Indices
from mechanism_sim.numerics.enclosure import (
    FEW,
    NONE,
    WHOLE,
    MotionSeries,
    Reach,
    about_middle,
    doubt_of,
    reach_of,
)
from mechanism_sim.numerics.kernel_code import call_code
from mechanism_sim.numerics.kernels import BoundCall, charge, entry, foreign_code, kernel
from mechanism_sim.numerics.polynomials import chebyshev_nodes
from mechanism_sim.planar.steep_loads import ResolvedLoads, SteepLoads
from mechanism_sim.tolerances import TOLERANCES

_GUARDS = TOLERANCES.guards
_ROUNDING = TOLERANCES.rounding
_STEPS = TOLERANCES.steps

_SAVED = 3e-4  # time [s] that machine code saves where formulas are in doubt


class StepMotion(NamedTuple):
    """Sources of the variables of loads over a step, and workspace for them, the last two."""

    states: Indices  #: (v,) rows in the step's series; -1 for a variable that is no state
    sizes: Array  #: (v,) factors from the units of the states
    laws: NDArray[np.int64]  #: (v, 3) first coefficient or -1, derivative, coefficient count
    turns: Indices  #: (t,) parameters of whole turns
    symbols: Indices  #: (w,) parameters of the switches
    held: NDArray[np.int64]  #: (q, 2) index of a flag in `symbols`, parameter of its holding
    guards: int
    series: Array  #: (v, n) Taylor series of the variables, with the step as unit of time
    given: Array  #: argument of `Enclosure.doubts_at`


_NONE, _PAIRS = np.zeros(0, np.int64), np.zeros((0, 2), np.int64)
_EMPTY = np.zeros(0)
NOTHING = StepMotion(
    _NONE, _EMPTY, np.zeros((0, 3), np.int64), _NONE, _NONE, _PAIRS, 0, np.zeros((0, 0)), _EMPTY
)
"""Step motion of a machine without steep loads."""


@kernel
def see(jets: Array, parameters: Array, c: StepMotion, time: float, tau: float, h: float) -> None:
    """Write the variables of loads over a step from `tau` on; local time zero is `time` [s]."""
    count = c.series.shape[1]
    for k in range(len(c.series)):
        row, power = c.series[k], 1.0
        row[:] = 0.0
        if c.states[k] >= 0:
            own, power = jets[c.states[k]], c.sizes[k]
            for j in range(count):
                row[j] = own[j] * power
                power *= h
        elif c.laws[k, 0] >= 0:
            first, d, n = c.laws[k, 0], c.laws[k, 1], c.laws[k, 2]
            for j in range(d, n):
                row[j - d] = parameters[first + j] * (float(j) if d > 0 else 1.0)
            for i in range(n - d - 1):  # in powers of the time since `tau`
                for j in range(n - d - 2, i - 1, -1):
                    row[j] += tau * row[j + 1]
            for j in range(n - d):
                row[j] *= power
                power *= h
        else:
            row[0], row[1] = time + tau, h
    about_middle(c.series, c.given)
    fixed, last = c.given[2 * len(c.series) :], len(c.given) - 1
    for k in range(len(c.turns)):
        fixed[k] = parameters[c.turns[k]]
    fixed = fixed[len(c.turns) :]
    for k in range(len(c.symbols)):
        fixed[k] = parameters[c.symbols[k]]
    for k in range(len(c.held)):  # of a load that holds both branches count
        if parameters[c.held[k, 1]] > 0.0:
            fixed[c.held[k, 0]] = 0.5
    for k in range(c.guards):  # of these what is nothing grows with the step
        c.given[last - c.guards + k] = _STEPS.guard * h
    c.given[last] = h


@kernel
def doubts(
    address: int, jets: Array, parameters: Array, c: StepMotion, time: float, tau: float, h: float,
    doubted: Array,
) -> int:  # fmt: skip
    """`Enclosure.doubts` of a step, by the machine code of ``Enclosure.doubted``.

    Parameters
    ----------
    time, tau, h : see `StepCheck.reach`
    doubted : (2,) overwritten
    """
    see(jets, parameters, c, time, tau, h)
    call_code(address, doubted, c.given, parameters, doubted)
    return doubt_of(doubted)


@entry
def look(
    addresses: Indices, jets: Array, parameters: Array, c: StepMotion, now: Array, doubted: Array
) -> int:
    """`doubts` now; -1, once `see` has looked, if no machine code is known."""
    time, tau, h = now[0], now[1], now[2]
    if addresses[0]:
        return doubts(addresses[0], jets, parameters, c, time, tau, h, doubted)
    see(jets, parameters, c, time, tau, h)
    return -1


class StepCheck:
    """Compares accelerations and guards of a step's polynomials with those of the equations.

    Parameters
    ----------
    steep : loads that are enclosed between the instants of comparison
    limit : [rad/s] largest allowed change of a rate within a step by a defect
    """

    def __init__(
        self,
        system: System,
        steep: SteepLoads,
        integrator: hy.taylor_adaptive_dbl,
        limit: float,
    ) -> None:
        self._system, self._steep = system, steep
        size = np.where(system.angular, 1.0, system.mechanism.size)
        size = np.append(size, np.ones(len(system.states)))
        self._limit = (limit * size)[:, None]
        self._nodes = chebyshev_nodes(integrator.order + 1)
        self._resolved = ResolvedLoads(steep, self._nodes)
        self._series, self._pars = integrator.tc, integrator.pars  # as they are at any time
        self._power = np.arange(integrator.order + 1)
        f, m, width = len(system.free), len(system.guards), system.width
        self._rates, self._watch = slice(f, width), slice(width + 1, width + 1 + m)
        self.motion = _motion_of(system, steep, integrator.order + 1)
        loads = _STEPS.unfelt * limit * steep.inertia
        self._loads, ends = len(loads), len(self.motion.given) - 1
        self._scales = self.motion.given[ends - len(loads) - steep.enclosure.guards : ends]
        self._scales[: len(loads)] = loads
        self._fixed = self.motion.given[2 * len(steep.moving) + 2 * steep.timed : -1]
        self._fixed = self._fixed[: len(self._fixed) - len(self._scales)]
        self._now, doubted, self._addresses = np.zeros(4), np.zeros(2), np.zeros(1, np.int64)
        self._code: Any = None
        self._look = BoundCall(
            look, self._addresses, self._series, self._pars, self.motion, self._now, doubted
        )
        self._found = np.zeros(2)

    @property
    def address(self) -> int:
        """Address of the machine code of ``Enclosure.doubted``, 0 if it is not available."""
        if self._code is None:
            function = self._steep.enclosure.doubted
            self._code = foreign_code(function.llvm_states[0].object_code, 'cfunc') or False
            self._addresses[0] = self._code.addresses[0] if self._code else 0
        return int(self._addresses[0])

    def reach(self, time: float, tau: float, h: float) -> Reach:
        """Share of the last step over which its series satisfies the equations of motion.

        Parameters
        ----------
        time : [s] at the local time zero
        tau, h : [s] local time at the start of the step, and its length
        """
        self._now[0], self._now[1], self._now[2] = time, tau, h
        doubts = self._look()
        if doubts < 0:
            doubts = self._steep.enclosure.doubts_at(self.motion.given, self._pars)
            if look.is_compiled:
                _ = self.address
        if doubts == NONE:
            return WHOLE
        self._now[3] = doubts
        if look_first.is_compiled and self._look_first and (some := self._look_first()) >= 0:
            return Reach(*self._found.tolist()) if some else WHOLE
        charge(_SAVED)
        return self._closer_look(tau, h, doubts)

    @cached_property
    def _look_first(self) -> BoundCall | None:
        """Call of `look_first`; None if machine code is not available."""
        made = first_look(
            self._system, self._steep, self._nodes, self._limit[:, 0].copy(), self.motion.series,
            self.motion.given,
        )  # fmt: skip
        if made is None:
            return None
        self._codes = made.codes
        return BoundCall(look_first, self._series, self._pars, made.look, self._now, self._found)

    def _closer_look(self, tau: float, h: float, doubts: int) -> Reach:
        """`reach` by as many halvings as it takes."""
        enclosure = self._steep.enclosure
        motion = MotionSeries(self.motion.series, h, self._fixed, self._pars)
        grown = np.cumprod(np.where(self._power > 0, h, 1.0))
        looked: list[Array] = []

        def defect(places: Array) -> Array:
            looked.append(places)
            return self._defect(self._series[: self._watch.stop] * grown, tau, h, places)

        reach = reach_of(enclosure, motion, self._scales, defect, doubts)
        if not looked or looked[0] is FEW:
            return reach
        # of a load on what a drive moves the accelerations tell nothing
        share = self._resolved.longest(motion, looked, reach, self._scales[: self._loads] / h)
        known = 1.0 if reach.fault is None else reach.sound
        return Reach(share, share) if share < known else reach

    def _defect(self, series: Array, tau: float, h: float, places: Array) -> Array:
        """Defect of a step's series at places (N,), relative to the allowed defect.

        Without limit where a guard has fallen unseen. Operations are those of `look_first`, one
        by one: of short steps the defect is rounding.
        """
        system, width = self._system, self._rates.stop
        powers, sloping = powers_at(places, series.shape[1])
        given = np.empty((len(places), width + len(self._pars) + 1))
        given[:, :width] = _sums(series[:width], powers).T
        given[:, width:-1] = self._pars
        given[:, -1] = tau + h * places
        wanted = h * _one_by_one(system.functions.accelerations, given)
        allowed = self._limit + _ROUNDING.acceleration * np.abs(wanted)
        slopes = _sums(series[self._rates], sloping)
        found: Array = (np.abs(slopes - wanted) / allowed).max(axis=0)
        if system.guards:
            guards = _one_by_one(system.functions.watch, given)[: len(system.guards)]
            low = guards < -_STEPS.fallen
            if low.any():
                foretold = _sums(series[self._watch], sloping) / (h * _GUARDS.watch_scale)
                found[(low & (guards < foretold - _STEPS.fallen)).any(axis=0)] = np.inf
        return found


def _sums(series: Array, powers: Array) -> Array:
    """Values (r, N) of series (r, n) by powers (n, N), summed term by term in their order."""
    return np.asarray(np.add.accumulate(series[:, :, None] * powers, axis=1)[:, -1])


def _one_by_one(function: hy.cfunc_dbl, given: Array) -> Array:
    """Results (n, N) of a function of rows (N, v): of columns it has other code."""
    found = np.empty((len(given), function.nouts))
    for row, out in zip(given, found, strict=True):
        function(row, outputs=out)
    return found.T


def _motion_of(system: System, steep: SteepLoads, count: int) -> StepMotion:
    """Positions of the variables of loads in the state; `count` coefficients a series.

    It has no fewer than any law.
    """
    f, parameters = len(system.free), system.parameters
    rows = {c: (k, 1.0) for k, c in enumerate(system.free)}
    rows |= {x.label: (2 * f + k, x.scale) for k, x in enumerate(system.states)}
    moving = [(d, system.variables[i]) for d, i in steep.moving]
    own = [rows.get(c, (-1, 1.0)) for _, c in moving]
    states = [k + f * d if k >= 0 else -1 for (d, _), (k, _) in zip(moving, own, strict=True)]
    laws = np.full((len(moving) + steep.timed, 3), -1)
    for law, (d, c) in zip(laws, moving, strict=False):
        if c not in rows:
            index = parameters.laws[system.prescribed.index(c)]
            law[:] = index[0], d, len(index)
    time = [-1] * steep.timed
    symbols = np.array([i for index in parameters.switches for i in index], int)
    held = steep.held.copy()
    held[:, 1] = symbols[held[:, 1]]
    turns = np.array([parameters.outside[name] for name in steep.outside], int)
    own_symbols = symbols[steep.symbols]
    fixed = len(turns) + len(own_symbols) + len(steep.inertia) + steep.enclosure.guards
    return StepMotion(
        np.array(states + time, int),
        np.array([size for _, size in own] + [1.0] * steep.timed),
        laws, turns, own_symbols, held, steep.enclosure.guards,
        np.zeros((len(laws), count)), np.zeros(2 * len(laws) + fixed + 1),
    )  # fmt: skip
