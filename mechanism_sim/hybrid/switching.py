"""The integrator's present state, and what switches: loads, tables, friction in ideal joints."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import RunError
from mechanism_sim.hybrid.clock import Base, horner
from mechanism_sim.hybrid.dense_output import floats
from mechanism_sim.hybrid.system import System
from mechanism_sim.planar.switches import HOLDS, REST, SWITCH_MARGIN

_STILL_TURNING, _MOST_TURNS = 1e-6, 1000  # [s] between turns of a switch, so many times in a row


class Switching(ABC):
    """What of a system changes from part to part of its motion, contacts left aside.

    Attributes
    ----------
    switches : the present rows
    """

    def __init__(self, system: System, integrator: hy.taylor_adaptive_dbl, base: Base) -> None:
        self.base = base
        self._system = system
        self._ta = integrator
        self._f = len(system.free)
        self._state = floats(integrator.state)[: 2 * self._f]
        self._parameters = integrator.pars
        self._pars = floats(self._parameters)
        self._now = np.empty(2 * self._f + len(self._pars) + 1)
        now = floats(self._now)
        self._now_state, self._now_pars = now[: 2 * self._f], now[2 * self._f : -1]
        self._x = integrator.state[: 2 * self._f]
        self._rounding = 2.0 * float(np.spacing(system.mechanism.reach))
        self.switches: tuple[int, ...] = (0,) * len(system.switches)
        self._turns: dict[int, tuple[float, int]] = {}  # when they last did, how often in a row
        self._turned: dict[int, tuple[float, int]] = {}  # at which place they last did, which row

    @abstractmethod
    def project(self) -> None:
        """Bring loops and closed contacts to zero in value and rate."""

    @abstractmethod
    def _set_status(self) -> None:
        """Let what holds now be known."""

    @property
    def sides(self) -> tuple[float, ...]:
        """Signs of what presses on lines that rub."""
        return tuple(self._pars[i] for i in self._system.side_index)

    @sides.setter
    def sides(self, signs: Sequence[float]) -> None:
        self._set(self._system.side_index, signs)
        self._set_status()

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self.base.at(float(self._ta.time))

    def _set(self, index: Sequence[int], values: Sequence[float]) -> None:
        for i, value in zip(index, values, strict=True):
            self._pars[i] = value

    def _at_present(
        self, function: hy.cfunc_dbl, ahead: float = 0.0, out: Array | None = None
    ) -> Array:
        """A function of the system, now, or where it is a very short time `ahead` [s]."""
        self._now_state[:], self._now_pars[:] = self._state, self._pars
        self._now[-1] = self._ta.time + ahead
        if ahead:
            self._now[: self._f] += ahead * self._now[self._f : 2 * self._f]
        values: Array = function(self._now, outputs=out)
        return values

    def set_switches(self, rows: tuple[int, ...] | None = None) -> None:
        """Set the rows of the switches to given ones, or as the present state has them."""
        switches = self._system.switches
        if rows is None:
            for _ in range(self._system.switch_levels):
                places = zip(switches, self._places(), strict=True)
                self.set_switches(tuple(s.row_at(x) for s, x in places))
            return
        self.switches = rows
        for s, index, row in zip(switches, self._system.switch_index, rows, strict=True):
            self._set(index, s.values(row))
        if self._system.holding:
            self._set_status()

    def pass_edges(self) -> None:
        """Let switches turn over that are at their edge now, where their guards fall too late.

        So what begins with the run, or with a law, holds from its first instant on.
        """
        tau, before = float(self._ta.time), self.switches
        rates = [*self._state[self._f :], *(rate_of(law, tau) for law in self.base.laws)]
        fastest = max(map(abs, rates), default=0.0)
        if not (before and fastest):
            return
        places = self._places(0.5 * SWITCH_MARGIN / fastest)
        rows = [s.row_at(x) for s, x in zip(self._system.switches, places, strict=True)]
        self.set_switches(tuple(rows))
        guards = self._at_present(self._system.watch)[: len(self._system.guards)][-len(rows) :]
        known = zip(before, rows, guards.tolist(), strict=True)
        self.set_switches(tuple(new if guard > 0.0 else old for old, new, guard in known))

    def _places(self, ahead: float = 0.0) -> list[float]:
        """Where the switches are."""
        seen = self._at_present(self._system.watch, ahead)
        places: list[float] = seen[len(seen) - len(self.switches) :].tolist()
        return places

    @property
    def _where(self) -> str:
        """The angle of the first drive, for messages."""
        system = self._system
        for c, law in zip(system.prescribed, self.base.laws, strict=False):
            if c not in system.mechanism.displacements:
                angle = math.degrees(horner(law, self._ta.time)) % 360.0
                return f', {c} at {angle:.6g} deg'
        return ''

    def _row_after(self, switch: int) -> int:
        """The row of a switch that follows on the present one.

        Raises
        ------
        RunError
            If there is none.
        """
        known, row, place = (
            self._system.switches[switch],
            self.switches[switch],
            self._places()[switch],
        )
        if switch in self._system.holding:
            held = self._system.holding[switch].holding(row, self._rates_of(switch), place)
            if held is not None:
                return held
        try:
            return known.row_after(row, place)
        except RunError as error:
            raise RunError(f'{error} (t = {self.time:.9g} s)') from error

    def _leads_back(self, switch: int | None) -> bool:
        """Whether a switch fell to the row it has just left, at the very place where it left it.

        Over a row that is narrow beside its distance from zero, places are known to their
        roundings only: it may have been left before its end in these digits.
        """
        if switch is None or switch not in self._turned:
            return False
        place, row = self._turned[switch]
        held = switch in self._system.holding and HOLDS in (row, self.switches[switch])
        if held or self._places()[switch] != place:
            return False
        return self._row_after(switch) == row

    def _rates_of(self, switch: int) -> list[float]:
        """What `Switch.holding` asks for of a switch of rates."""
        system = self._system
        own = [*system.holding].index(switch)
        function, kept = system.holding_rates, self._parameters.copy()
        part = float(self._at_present(function)[len(system.holding) + own])
        seen = []
        for others in (True, False):
            for k, index in enumerate(system.switch_index):
                if k in system.holding and (k == switch or not others):
                    self._pars[index[1]] = 0.0
            for flag in (0.0, 1.0):
                self._pars[system.switch_index[switch][0]] = flag
                seen.append(float(self._at_present(function)[own]))
        self._parameters[:] = kept
        return [*seen, part]

    def _rubbed_fast(self) -> RunError:
        joints = dict.fromkeys(rub.friction.name for rub in self._system.dynamics.rubs)
        return RunError(
            f'friction jams at t = {self.time:.9g} s{self._where}: in {", ".join(joints)} no '
            'finite forces let the motion go on; a smaller coefficient or radius runs'
        )

    @property
    def rubbing(self) -> tuple[float, ...]:
        """Signs of what presses on lines that rub, where forces of pins point, signs of slips."""
        return tuple(self._pars[i] for i in self._rubbing_index)

    @rubbing.setter
    def rubbing(self, values: Sequence[float]) -> None:
        self._set(self._rubbing_index, values)
        self._set_status()

    @property
    def _rubbing_index(self) -> tuple[int, ...]:
        known = self._system
        return (*known.side_index, *known.towards_index, *known.slip_index)

    def _hold_still(self, slipping: Sequence[int]) -> None:
        """Let friction that is at rest hold, or act against where it goes: before it moves."""
        places = self._places()
        for k in slipping:
            row, rates = self.switches[k], self._rates_of(k)
            after = self._system.holding[k].holding(row, rates, places[k])
            if after is None and abs(places[k]) <= REST:
                after = int(rates[0] + rates[1] > 0.0)
            if after not in (None, row):
                self.set_switches((*self.switches[:k], after, *self.switches[k + 1 :]))
                self._press_sides()

    def _press_sides(self) -> None:
        """Let the signs of what presses on lines that rub be those of its present forces."""
        for _ in self._system.side_index:
            pressed = self._at_present(self._system.pressing).tolist()
            signs = tuple(math.copysign(1.0, x) for x in pressed)
            if signs == self.sides:
                break
            self.sides = signs

    def _follow_pin(self, pin: int) -> None:
        """Note where the force of a pin that rubs points now."""
        x, y = self._at_present(self._system.pin_forces)[2 * pin : 2 * pin + 2].tolist()
        if size := math.hypot(x, y):
            self._set(self._system.towards_index[2 * pin : 2 * pin + 2], (x / size, y / size))

    def _freeze(self, held: Sequence[int]) -> None:
        """Let contacts be resolved under the parts of switches that hold now."""
        parts = self._at_present(self._system.holding_rates)[len(self._system.holding) :].tolist()
        for k, part in zip(self._system.holding, parts, strict=True):
            if k in held:
                self._pars[self._system.switch_index[k][0]] = part

    def _release(self) -> None:
        """Let switches hold no more what an impact has moved.

        What they would stop again within a rounding of the place is stopped now: contacts that
        part by roundings fall back as fast, and would move it for ever.
        """
        places, rows = self._places(), list(self.switches)
        moved = [k for k in self._system.holding if rows[k] == HOLDS and abs(places[k]) > REST]
        if not moved:
            return
        slow = [k for k in moved if places[k] ** 2 < 2.0 * self._rounding * self._stops(k, places)]
        for k in moved:
            if k not in slow:
                rows[k] = int(places[k] > 0.0)
        self.set_switches(tuple(rows))
        if slow:
            self._stop(slow)

    def _stops(self, switch: int, places: Sequence[float]) -> float:
        """How fast the function of a switch comes back to zero where it acts, 0 if it does not."""
        below, above, *_ = self._rates_of(switch)
        return max(0.0, -above if places[switch] > 0.0 else below)

    def _stop(self, held: Sequence[int]) -> None:
        """Bring the functions of switches that hold to zero by an impulse of what holds them."""
        kept, system, f = self._parameters.copy(), self._system, self._f
        functions = [[*system.holding].index(k) for k in held]

        def seen(acting: int | None) -> tuple[Array, Array]:
            for k in held:
                self._set(system.switch_index[k], (float(k == acting), 0.0))
            rates = self._at_present(system.holding_rates)[functions]
            return rates, self._at_present(system.accelerations).copy()

        still, a = seen(None)
        ways = [seen(k) for k in held]
        self._parameters[:] = kept
        places = np.array(self._places())[list(held)]
        steps = np.column_stack([rates - still for rates, _ in ways])
        shares = np.linalg.lstsq(steps, -places)[0]
        for x, (_, way) in zip(shares.tolist(), ways, strict=True):
            self._x[f:] += x * (way - a)
        self.project()

    def _count_turns(self, switch: int) -> None:
        """Refuse a switch that turns over again and again at one place.

        Raises
        ------
        RunError
        """
        since, count = self._turns.get(switch, (-math.inf, 0))
        count = 1 if self.time - since > _STILL_TURNING else count + 1
        self._turns[switch] = self.time, count
        if count > _MOST_TURNS:
            name = [*self._system.equations.frames.switches][switch]
            load = '.'.join(name.replace(':', '.', 1).split('.')[:2])
            raise RunError(
                f'{load} turns over again and again at t = {self.time:.9g} s: a force that steps '
                'against the motion (sign, or a condition on a rate) would hold it at rest; write '
                'a steep function instead, such as tanh(vx/0.001)'
            )


def rate_of(law: Sequence[float], tau: float) -> float:
    """Rate [rad/s] of a law's polynomial at local time tau [s]."""
    rate = 0.0
    for k in range(len(law) - 1, 0, -1):
        rate = rate * tau + k * law[k]
    return rate
