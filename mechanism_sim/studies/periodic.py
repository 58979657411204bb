"""Periodic response of a machine by shooting, and its Floquet multipliers.

[SB] 6.1 waits for the transients to die and calls what is left quasi-steady. Here the response is
solved for: a fixed point of the map that takes the state at one crank angle to the state p
revolutions later, by Newton's method. Impacts are part of the map.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.derivatives.flow import Flows
from mechanism_sim.derivatives.numeric_keys import WEIGHTS, numeric_keys
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.snapshot import State
from mechanism_sim.engine.totals import Totals
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.planar.drive import TWO_PI, DriveLaw
from mechanism_sim.results.run import Piece, Runner
from mechanism_sim.scene import Machine
from mechanism_sim.scene.plan import restart


@dataclass(frozen=True)
class PeriodicResponse:
    """A periodic response."""

    period: int  #: revolutions after which it repeats
    #: largest change of an angle [rad], or of a rate over the crank's speed, in a period
    residual: float
    state: State  #: state at the start angle of the crank
    impacts: int  #: number of impacts in a period
    impulse: float  #: sum of their normal impulses [N s]
    #: Floquet multipliers, by which a small change of the state grows in a period
    multipliers: tuple[complex, ...]
    spread: float  #: largest change of a multiplier from this period to the next: their error

    @property
    def stable(self) -> bool | None:
        """True if small changes die out; None if a multiplier is 1 but for its error."""
        largest = max(map(abs, self.multipliers), default=0.0)
        return None if abs(largest - 1.0) <= self.spread else largest < 1.0


_REACHED = 1e-9  # residual of a periodic response
CLOCK = (
    "of a force that repeats let a wheel 'clock' be driven at constant speed, 2.8 rad/s, and "
    'write cos(clock) instead of cos(2.8*t)'
)
"""Advice where nothing turns steadily."""


def without_turns(way: Array, turns: Array) -> Array:
    """Changes (..., k) of coordinates less as many turns (k,) as bring them nearest to 0.

    A turn is 0 of what never comes back.
    """
    return np.asarray(way - turns * np.round(way / np.where(turns, turns, 1.0)))


def flow_at_end(motion: Motion, free: Sequence[int]) -> Array:
    """Rates and accelerations of f coordinates, and rates of the s states, where a motion ends.

    (2 f + s,), those of states of first order in their own units.
    """
    last = np.array([len(motion) - 1])
    dt = motion.curve.duration[last]
    rates, accelerations = (motion.rows.local(last, dt, k)[0] for k in (1, 2))
    n = motion.curve.turns.shape[1]
    return np.concatenate([rates[free], accelerations[free], rates[n:]])


class PoincareMap:
    """The map of a machine from one passage of its start angle to a later one.

    Parameters
    ----------
    paths : dotted, of P numbers of its scene, by which `sensitivity` has derivatives
    """

    def __init__(self, machine: Machine, paths: Sequence[str] = ()) -> None:
        law = machine.drive.law
        if not machine.drive.steady or not isinstance(law, DriveLaw) or not machine.drive.fastest:
            raise InputError(
                f'{machine.name}: a periodic response needs a crank at constant speed; {CLOCK}'
            )
        if not machine.level.dynamic or not machine.equations.system.free:
            raise InputError(f'{machine.name}: without a free motion every turn is like the other')
        run = machine.start()
        if not isinstance(run, EventLoop):
            raise InputError(f'{machine.name}: a compliant machine has no section of states')
        self._machine, self._run, self._keys = machine, run, numeric_keys(machine, paths)
        self._period = machine.drive.period
        # loads over time may repeat after several turns; laws of other drives begin at zero
        first = all(len(laws) == 1 for laws in machine.plan.laws.values())
        timed = 'time' in machine.equations.system.outside
        self._keeps_time = timed and first and not machine.plan.sources
        mechanism, speed = machine.mechanism, abs(law.coefficients[1])
        slides = np.array([c in mechanism.displacements for c in machine.equations.system.free])
        size = np.where(slides, mechanism.size, 1.0)  # [m] or [rad]
        self._turns = np.where(slides, 0.0, float(TWO_PI))
        states = [state.scale for state in machine.equations.system.states]
        #: (w,) sizes of the w numbers of a state: free coordinates, their rates, and states of
        #: first order, which a `State` has over these already
        self.scale = np.concatenate([size, speed * size, states])

    def start(self, state: State) -> State:
        """Copy of the state, projected to contact at closed gaps."""
        restart(self._machine.plan, self._run, state)
        return self._run.state

    def map(
        self, state: State, revolutions: int, audited: bool = False
    ) -> tuple[State, int, float]:
        """State after a number of turns, number of impacts, and sum of their impulses [N s].

        Newton's method goes by way of states that nearly penetrate: those are not audited.
        """
        totals = Totals()
        for piece in self.pieces(state, revolutions, audited):
            totals.add(piece.impacts, piece.modes)
        return self.state, totals.impacts, totals.normal_impulse

    def pieces(self, state: State, turns: float, audited: bool = False) -> Iterator[Piece]:
        """The motion from a state at the start angle on; then `state` is where it ends."""
        restart(self._machine.plan, self._run, replace(state, turns=(0,) * len(state.turns)))
        until = turns * self._period
        if state.time:
            # not a rounding later than the turn: what is so short has no derivatives
            exact = state.time + Fraction(turns) * Fraction(self._period)
            until = float(exact)
            until = until if until <= exact else math.nextafter(until, 0.0)
        return Runner(self._machine, self._run, audited=audited).to(until)

    @property
    def state(self) -> State:
        """The present state, as one from which turns begin."""
        state = self._run.state
        return state if self._keeps_time else replace(state, time=Fraction(0))

    def growth(self, state: State, revolutions: int) -> tuple[Array, State]:
        """The matrix of `sensitivity` (w, w), and the state later."""
        M, _, end = self.sensitivity(state, revolutions)
        return M, end

    def sensitivity(self, state: State, revolutions: int) -> tuple[Array, Array, State]:
        """Derivatives of the state later, exact through impacts, in the measure of `difference`.

        At a fixed point, ``M`` is the monodromy matrix, whose eigenvalues are the Floquet
        multipliers, and the fixed point moves by ``solve(I - M, by)`` with the keys: where an
        eigenvalue is 1 it folds. Both are of the flow from a state as it stands, whose contacts
        are stabilised; a map that brings the state into contact first moves by
        ``by + M @ seated`` with the keys.

        Returns
        -------
        M : (w, w) by the state
        by : (w, P) by the keys in SI units, at a fixed state and a crank that has turned as far
        end : the state later

        Raises
        ------
        RunError
            If there are none.
        """
        pieces = list(self.pieces(state, revolutions))
        impacts = [i for piece in pieces for i in piece.impacts]
        motion = Motion.joined([piece.motion for piece in pieces])
        J, limits = self._flows.transition(motion, impacts)
        if ends := [limit for limit in limits if limit.ends]:
            raise RunError(f'{self._machine.name}: {ends[0]}')
        w = len(self.scale)
        J[:, w:] += np.outer(flow_at_end(motion, self._flows.free), revolutions * self._longer)
        J /= self.scale[:, None]
        return J[:, :w] * self.scale, J[:, w:], self.state

    def seated(self, state: State) -> Array:
        """Derivatives (w, P) of a state that is brought into contact, in that measure."""
        found: Array = np.zeros((len(self.scale), len(self._keys)))
        begin = replace(state, turns=(0,) * len(state.turns))
        for k, key in enumerate(self._keys):
            ends = []
            for machine in key.beside:
                run = machine.start(state=begin)
                assert isinstance(run, EventLoop)  # noqa: S101 - it has a map
                q = without_turns(np.array(run.state.q) - np.array(state.q), self._turns)
                ends.append(np.concatenate([q, run.state.v, run.state.states]))
            found[:, k] = WEIGHTS @ np.array(ends) / key.step / self.scale
        return found

    @cached_property
    def _flows(self) -> Flows:
        return Flows.by_state(self._machine, 0.0, self._keys)

    @cached_property
    def _longer(self) -> Array:
        """Derivatives (P,) of the time of a revolution [s]."""
        periods = [[m.drive.period for m in key.beside] for key in self._keys]
        steps = [key.step for key in self._keys]
        return np.reshape(periods, (-1, len(WEIGHTS))) @ WEIGHTS / steps

    def directions(self, state: State, h: float = 1e-6) -> Array:
        """Basis (w, r) of the directions in which a state can change: contacts stay closed."""
        columns = []
        for direction in np.eye(len(self.scale)):
            ends = [self.start(self.displace(state, x * direction)) for x in (h, -h)]
            columns.append(self.difference(ends[1], ends[0]))
        u, s, _ = np.linalg.svd(np.array(columns).T)
        # where nothing is free, all that is left is rounding
        return np.asarray(u[:, : int((s > 1e-3 * max(s[0], h)).sum())])

    def difference(self, a: State, b: State) -> Array:
        """B - a, rates over the speed of the crank."""
        angle = without_turns(np.array(b.q) - np.array(a.q), self._turns)
        moved = np.concatenate([angle, np.array(b.v) - np.array(a.v)])
        states = np.array(b.states) - np.array(a.states)
        return np.concatenate([moved / self.scale[: len(moved)], states])

    def displace(self, state: State, by: Array) -> State:
        """Displace a state by a difference in the same measure."""
        f = len(state.q)
        step = by[: 2 * f] * self.scale[: 2 * f]
        return replace(
            state,
            q=tuple((np.array(state.q) + step[:f]).tolist()),
            v=tuple((np.array(state.v) + step[f:]).tolist()),
            states=tuple((np.array(state.states) + by[2 * f :]).tolist()),
        )


def find_periodic(
    machine: Machine,
    longest: int = 8,
    transient: int = 60,
    progress: Callable[[str], None] = lambda _: None,
) -> PeriodicResponse | None:
    """The periodic response that the machine settles to, if it has one.

    Parameters
    ----------
    longest : period that is looked for [revolutions]
    transient : revolutions to wait first
    progress : callback with the present action

    Returns
    -------
    ``None`` if the motion does not come back after the transient, or Newton's method does not end.
    """
    section = PoincareMap(machine)
    progress(f'{transient} revolutions until it has settled')
    state, _, _ = section.map(machine.initial_state(), transient)
    visited = [state]
    for n in range(longest):
        progress(f'looking for a period: {n + 1} of {longest} revolutions')
        visited.append(section.map(visited[-1], 1)[0])
    returns = [float(np.abs(section.difference(state, s)).max()) for s in visited[1:]]
    best = min(returns)
    if best > 1e-4:
        return None
    # the shortest period that comes back about as well as the best
    period = next(p for p, r in enumerate(returns, 1) if r <= max(100.0 * best, _REACHED))
    progress(f'period {period}: residual and multipliers')
    return _refine(section, visited[-1], period)


def _refine(section: PoincareMap, state: State, period: int) -> PeriodicResponse | None:
    """Newton's method on what a period changes, down to its rounding: multipliers depend on it."""
    best: tuple[float, State, int, float] | None = None
    for _ in range(12):
        state = section.start(state)
        end, impacts, impulse = section.map(state, period)
        change = section.difference(state, end)
        residual = float(np.abs(change).max())
        if best and best[0] <= _REACHED and residual > 0.5 * best[0]:
            break
        if best is None or residual < best[0]:
            best = residual, state, impacts, impulse
        if end.closed != state.closed:
            break
        basis, (J, _) = section.directions(state), section.growth(state, period)
        J = basis.T @ J @ basis
        step = np.linalg.lstsq(J - np.eye(len(J)), -basis.T @ change, rcond=None)[0]
        state = section.displace(state, basis @ step)
    if best is None or best[0] > _REACHED:
        return None
    residual, state, impacts, impulse = best
    section.map(state, period, audited=True)
    count = section.directions(state).shape[1]  # closed contacts may leave nothing free at all
    J, end = section.growth(state, period)
    again, _ = section.growth(end, period)
    by_size = [
        sorted(np.linalg.eigvals(x), key=lambda z: (-abs(z), -z.imag))[:count] for x in (J, again)
    ]
    spread = max((abs(a - b) for a, b in zip(*by_size, strict=True)), default=0.0)
    found = tuple(complex(m) for m in by_size[0])
    return PeriodicResponse(period, residual, state, impacts, impulse, found, float(spread))
