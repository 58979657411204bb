"""Does a machine repeat itself? The periodic response by shooting, and its Floquet multipliers.

[SB] 6.1 waits for the transients to die and calls what is left quasi-steady. Here the response is
solved for: a fixed point of the map that takes the state at one crank angle to the state p
revolutions later, by Newton's method. Impacts are part of the map.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.hybrid.event_loop import EventLoop
from mechanism_sim.hybrid.snapshot import State
from mechanism_sim.hybrid.totals import Totals
from mechanism_sim.planar.drive import TWO_PI, DriveLaw
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.results.run import Runner
from mechanism_sim.scene import Machine


@dataclass(frozen=True)
class PeriodicResponse:
    """A periodic response.

    Attributes
    ----------
    period : revolutions after which it repeats
    residual : largest change of an angle [rad], or of a rate over the crank's speed, in a period
    state : at the start angle of the crank
    impacts : in a period
    impulse : sum of their normal impulses [N s]
    multipliers : Floquet multipliers, by which a small change of the state grows in a period
    spread : largest change of a multiplier when the differences behind it are ten times smaller
    """

    period: int
    residual: float
    state: State
    impacts: int
    impulse: float
    multipliers: tuple[complex, ...]
    spread: float

    @property
    def stable(self) -> bool | None:
        """True if small changes die out; None if a multiplier is 1 but for its error."""
        largest = max(map(abs, self.multipliers), default=0.0)
        return None if abs(largest - 1.0) <= self.spread else largest < 1.0


class PoincareMap:
    """The map of a machine from one passage of its start angle to a later one."""

    def __init__(self, machine: Machine) -> None:
        law = machine.drive.law
        if not machine.drive.steady or not isinstance(law, DriveLaw) or not machine.drive.fastest:
            raise InputError(
                f'{machine.name}: a periodic response needs a crank at constant speed'
            )
        if machine.plan.states:
            raise InputError(
                f'{machine.name}: the state {machine.plan.states[0].label} of first order has no '
                'part in the section of states here: leave states out'
            )
        if not machine.has_contacts and not machine.mechanism.having(Beam):
            raise InputError(
                f'{machine.name}: without clearance every revolution is like the other'
            )
        run = machine.start()
        if not isinstance(run, EventLoop):
            raise InputError(f'{machine.name}: a compliant machine has no section of states')
        self._machine, self._run = machine, run
        self._period = machine.drive.period
        mechanism, speed = machine.mechanism, abs(law.coefficients[1])
        slides = np.array([c in mechanism.displacements for c in machine.equations.system.free])
        size = np.where(slides, mechanism.size, 1.0)  # [m] or [rad]
        self._turns = np.where(slides, 0.0, float(TWO_PI))
        self.scale = np.concatenate([size, speed * size])

    def start(self, state: State) -> State:
        """The state itself, brought into contact where it is meant to be."""
        self._run.restart(state)
        return self._run.state

    def map(
        self, state: State, revolutions: int, audited: bool = False
    ) -> tuple[State, int, float]:
        """The state later, the impacts on the way, and the sum of their impulses [N s].

        Newton's method goes by way of states that nearly penetrate: those are not audited.
        """
        run = self._run
        run.restart(replace(state, turns=(0,) * len(state.turns)))
        struck = Totals()
        for piece in Runner(self._machine, run, audited=audited).to(revolutions * self._period):
            struck.add(piece.impacts, piece.modes)
        end = run.state
        return replace(end, time=state.time), struck.impacts, struck.normal_impulse

    def difference(self, a: State, b: State) -> Array:
        """B - a, rates over the speed of the crank."""
        angle = np.array(b.q) - np.array(a.q)
        angle -= self._turns * np.round(angle / float(TWO_PI))
        return np.asarray(np.concatenate([angle, np.array(b.v) - np.array(a.v)]) / self.scale)

    def displace(self, state: State, by: Array) -> State:
        """Displace a state by a difference in the same measure."""
        f = len(state.q)
        step = by * self.scale
        return replace(
            state,
            q=tuple((np.array(state.q) + step[:f]).tolist()),
            v=tuple((np.array(state.v) + step[f:]).tolist()),
        )


def find_periodic(
    machine: Machine,
    longest: int = 8,
    transient: int = 60,
    tolerance: float = 1e-9,
    progress: Callable[[str], None] = lambda _: None,
) -> PeriodicResponse | None:
    """The periodic response that the machine settles to, if it has one.

    Parameters
    ----------
    longest : period that is looked for [revolutions]
    transient : revolutions to wait first
    tolerance : residual to reach
    progress : called with the present action

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
    period = next(p for p, r in enumerate(returns, 1) if r <= max(100.0 * best, tolerance))
    progress(f'period {period}: residual and multipliers')
    return _refine(section, visited[-1], period, tolerance)


def _refine(
    section: PoincareMap, state: State, period: int, tolerance: float
) -> PeriodicResponse | None:
    """Newton's method on what a period changes."""
    residual = np.inf
    for _ in range(12):
        state = section.start(state)
        end, impacts, impulse = section.map(state, period)
        change = section.difference(state, end)
        residual = float(np.abs(change).max())
        if residual <= tolerance or end.closed != state.closed:
            break
        basis, J = jacobian(section, state, period)
        step = np.linalg.lstsq(J - np.eye(len(J)), -basis.T @ change, rcond=None)[0]
        state = section.displace(state, basis @ step)
    if residual > tolerance:
        return None
    section.map(state, period, audited=True)
    multipliers, finer = (
        np.linalg.eigvals(jacobian(section, state, period, h)[1]) for h in (1e-6, 1e-7)
    )
    by_size = [sorted(m, key=lambda z: (-abs(z), -z.imag)) for m in (multipliers, finer)]
    # closed contacts may leave nothing free at the section: then there are no multipliers
    spread = max((abs(a - b) for a, b in zip(*by_size, strict=True)), default=0.0)
    found = tuple(complex(m) for m in by_size[0])
    return PeriodicResponse(period, residual, state, impacts, impulse, found, float(spread))


def jacobian(
    section: PoincareMap, state: State, period: int, h: float = 1e-6
) -> tuple[Array, Array]:
    """How changes of the state grow in a period, by central differences.

    A closed contact leaves fewer directions free: changes are brought back into contact before
    they are followed.

    Returns
    -------
    (2 f, r) basis of the free directions, and (r, r) the map in it
    """
    before, after = [], []
    size = 2 * len(state.q)
    for direction in np.eye(size):
        starts, ends = [], []
        for sign in (1.0, -1.0):
            start = section.start(section.displace(state, sign * h * direction))
            starts.append(start)
            ends.append(section.map(start, period)[0])
        before.append(section.difference(starts[1], starts[0]) / (2.0 * h))
        after.append(section.difference(ends[1], ends[0]) / (2.0 * h))
    D, R = np.array(before).T, np.array(after).T
    u, s, _ = np.linalg.svd(D)
    basis = u[:, : int((s > 1e-3 * s[0]).sum())]
    J = (basis.T @ R) @ np.linalg.pinv(basis.T @ D, rcond=1e-3)
    if not np.isfinite(J).all():
        raise RunError('a small change of the state leads to none at all')
    return basis, np.asarray(J)
