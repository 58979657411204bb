"""Switches of loads, tables and friction in ideal joints: their rows, and motions they hold."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mechanism_sim.engine.contact.problem import ContactProblem
from mechanism_sim.engine.holding_impulse import ImpulseWork, stop
from mechanism_sim.engine.present_state import PresentState, rate_of
from mechanism_sim.errors import RunError
from mechanism_sim.planar.switches import HOLDS, Switch, by_level
from mechanism_sim.tolerances import TOLERANCES

_JOINT_FRICTION = TOLERANCES.joint_friction
_SWITCHES = TOLERANCES.switches


class Switching:
    """Rows of the switches at the present state, and signs of normal forces with friction.

    A row is the part of its range in which a switch is: a load's side, a table's interval.

    Parameters
    ----------
    present : the integrator's state
    problem : contacts, some of which may have friction in a part of their cycle only
    """

    def __init__(self, present: PresentState, problem: ContactProblem) -> None:
        self._now, self._system = present, present.system
        self._functions = present.system.functions
        self._holding = present.system.set_valued.holding
        self._index = present.system.parameters
        self._pars, self._friction = present.pars, problem.friction
        system, gaps = present.system, present.system.gaps
        flags = {s.flag: k for k, s in enumerate(system.switches) if isinstance(s, Switch)}
        #: by gap, parameter of the flag of its friction, and coefficient of friction
        self._engaged = {
            i: (system.parameters.switches[flags[flag]][0], gaps[i].friction)
            for i, flag in system.dynamics.contacts.engaged.items()
        }
        closed = () if system.compliant else system.parameters.closed
        self._kept = (*closed, *system.parameters.sticks)  # flags of what contacts hold
        self._turns: dict[int, tuple[float, int]] = {}  # when they last did, how often in a row
        self._turned: dict[int, tuple[float, int]] = {}  # at which place they last did, which row

    @property
    def rows(self) -> tuple[int, ...]:
        """The present rows."""
        return self._now.rows

    @property
    def sides(self) -> tuple[float, ...]:
        """Signs of the normal forces of joints with friction."""
        return tuple(self._pars[i] for i in self._index.sides)

    @sides.setter
    def sides(self, signs: Sequence[float]) -> None:
        self._now.set(self._index.sides, signs)

    def set_rows(self, rows: tuple[int, ...]) -> None:
        """Set the rows of the switches, and with them which contacts have friction."""
        self._now.rows = rows
        switches = self._system.switches
        for s, index, row in zip(switches, self._index.switches, rows, strict=True):
            self._now.set(index, s.values(row))
        for i, (flag, friction) in self._engaged.items():
            self._friction[i] = friction if self._pars[flag] > 0.0 else _JOINT_FRICTION.idle

    def find_rows(self) -> None:
        """Set the rows as the present state has them."""
        for _ in by_level(self._system.switches):  # until each row follows from those before it
            places = zip(self._system.switches, self.places(), strict=True)
            self.set_rows(tuple(s.row_at(x) for s, x in places))

    def turn_over(self, switch: int) -> None:
        """Set a switch to the row that follows the present one.

        A switch released at this very instant does not hold again: with a part within rounding of
        0 or 1 it would alternate without end. Its function is set to zero by an impulse instead.
        """
        since, rows = self._turns.get(switch, (math.nan, 0))[0], self.rows
        self._count_turns(switch)
        after = self._row_after(switch)
        again = since == self._now.time and self._turned[switch][1] == HOLDS
        # tables have a row of that number, too
        if again and after == HOLDS and switch in self._holding:
            stop(self._now, [switch], self.places())
            return
        self._turned[switch] = self.places()[switch], rows[switch]
        self._set_row(switch, after)
        self._let_go()  # what it may have left without any force

    def pass_edges(self) -> None:
        """Set the next row of switches at their edge now, whose guards would fall too late.

        So a load that begins with the run, or with a law, acts from its first instant on.
        """
        tau, before = float(self._now.integrator.time), self.rows
        rates = [
            *self._now.v,
            *(rate_of(law, tau) for law in self._now.base.laws),
        ]
        fastest = max(map(abs, rates), default=0.0)
        if not (before and fastest):
            return

        def seen() -> list[float]:
            guards = self._now.evaluate(self._functions.watch)[: len(self._system.guards)]
            found: list[float] = guards[-len(before) :].tolist()
            return found

        guards = seen()  # what holds goes on, if it can under the present law, too
        own = {k: HOLDS if guards[k] > 0.0 else self._row_after(k) for k in self._held}
        places = self.places(0.5 * _SWITCHES.margin / fastest)
        rows = [s.row_at(x) for s, x in zip(self._system.switches, places, strict=True)]
        self.set_rows(tuple(rows))
        known = enumerate(zip(before, rows, seen(), strict=True))
        passed = (own.get(k, new if guard > 0.0 else old) for k, (old, new, guard) in known)
        self.set_rows(tuple(passed))
        self._let_go()

    def places(self, ahead: float = 0.0) -> list[float]:
        """Values of the switches' arguments, `ahead` [s] after the present."""
        seen = self._now.evaluate(self._functions.watch, ahead)
        places: list[float] = seen[len(seen) - len(self.rows) :].tolist()
        return places

    def _row_after(self, switch: int) -> int:
        """Row of a switch that follows the present one.

        Raises
        ------
        RunError
            If there is none.
        """
        known, row, place = (
            self._system.switches[switch],
            self.rows[switch],
            self.places()[switch],
        )
        if switch in self._holding:
            held = self._holding[switch].holding(row, self._rates_of(switch), place)
            if held is not None:
                return held
        try:
            return known.row_after(row, place)
        except RunError as error:
            raise RunError(f'{error} (t = {self._now.time:.9g} s)') from error

    def leads_back(self, switch: int | None) -> bool:
        """True if a switch would return to the row just left, at the same position.

        Over a row that is narrow beside its distance from zero, places are known to their
        roundings only: it may have been left before its end in these digits.
        """
        if switch is None or switch not in self._turned:
            return False
        place, row = self._turned[switch]
        held = switch in self._holding and HOLDS in (row, self.rows[switch])
        if held or self.places()[switch] != place:
            return False
        return self._row_after(switch) == row

    def _rates_of(self, switch: int) -> list[float]:
        """Rates of a switch's function, and its part, as `Switch.holding` takes them."""
        system = self._system
        own = [*self._holding].index(switch)
        function, kept = self._functions.holding_rates, self._now.parameters.copy()
        part = float(self._now.evaluate(function)[len(self._holding) + own])
        seen = []
        for others in (True, False):
            for k, index in enumerate(system.parameters.switches):
                if k in self._holding and (k == switch or not others):
                    self._pars[index[1]] = 0.0
            if not others:
                self._now.set(self._kept, [0.0] * len(self._kept))
            for flag in (0.0, 1.0):
                self._pars[system.parameters.switches[switch][0]] = flag
                seen.append(float(self._now.evaluate(function)[own]))
        self._now.parameters[:] = kept
        return [*seen, part]

    @property
    def rubbing(self) -> tuple[float, ...]:
        """Signs of normal forces, directions of pin forces, signs of slips, of joint friction."""
        return tuple(self._pars[i] for i in self._rubbing_index)

    @rubbing.setter
    def rubbing(self, values: Sequence[float]) -> None:
        self._now.set(self._rubbing_index, values)

    @property
    def _rubbing_index(self) -> tuple[int, ...]:
        known = self._system
        return (*known.parameters.sides, *known.parameters.towards, *known.parameters.slips)

    def hold_or_slide(self, slipping: Sequence[int]) -> None:
        """Set friction at rest to holding, or to act against the impending motion."""
        places = self.places()
        for k in slipping:
            row, rates = self.rows[k], self._rates_of(k)
            after = self._holding[k].holding(row, rates, places[k])
            if after is None and abs(places[k]) <= _SWITCHES.rest:
                after = int(rates[0] + rates[1] > 0.0)
            if after not in (None, row):
                self._set_row(k, after)
                self.update_sides()

    def update_sides(self) -> None:
        """Update the signs of normal forces of joints with friction to the present forces."""
        for _ in self._index.sides:
            pressed = self._now.evaluate(self._functions.pressing).tolist()
            signs = tuple(math.copysign(1.0, x) for x in pressed)
            if signs == self.sides:
                break
            self.sides = signs

    def update_pin_direction(self, pin: int) -> None:
        """Update the direction of the force of a pin with friction."""
        x, y = self._now.evaluate(self._functions.pin_forces)[2 * pin : 2 * pin + 2].tolist()
        if size := math.hypot(x, y):
            self._now.set(self._index.towards[2 * pin : 2 * pin + 2], (x / size, y / size))

    @property
    def _held(self) -> list[int]:
        """The switches that hold now."""
        return [k for k in self._holding if self.rows[k] == HOLDS]

    def freeze(self) -> bool:
        """Fix the flags of holding switches at their present parts; True if any switch holds."""
        held = self._held
        if held:
            parts = self._now.evaluate(self._functions.holding_rates)[len(self._holding) :]
            own = dict(zip(self._holding, parts.tolist(), strict=True))
            for k in held:
                self._pars[self._index.switches[k][0]] = own[k]
        return bool(held)

    def release(self) -> ImpulseWork:
        """End the holding of switches whose function an impact changed, or contacts now hold.

        A motion that would stop again within a rounding of the position is stopped at once by an
        impulse: contacts that part by roundings would otherwise restart it without end.

        Returns
        -------
        Impulse, work and loss of that stop.
        """
        self._let_go()
        places = self.places()
        moved = [k for k in self._held if abs(places[k]) > _SWITCHES.rest]
        near, slow = 2.0 * self._now.system.rounding, []
        for k in moved:
            below, above, *_ = self._rates_of(k)
            if places[k] ** 2 < near * (-above if places[k] > 0.0 else below):
                slow.append(k)
        for k in moved:
            if k not in slow:
                self._set_row(k, int(places[k] > 0.0))
        return stop(self._now, slow, places) if slow else ImpulseWork()

    def _let_go(self) -> None:
        """End the holding of switches that are `idle`."""
        while (k := self.idle()) is not None:
            place = self.places()[k]
            side = place if abs(place) > _SWITCHES.rest else self._rates_of(k)[0]
            self._set_row(k, int(side > 0.0))

    def idle(self) -> int | None:
        """Switch whose part is not determined: others hold without it, or it has no force."""
        seen = {k: self._rates_of(k) for k in self._held}
        # those without a force come first: what others do cannot be solved for beside them
        forceful = sorted(seen, key=lambda k: self._holding[k].steps(seen[k]))
        return next((k for k in forceful if not self._holding[k].acts(seen[k])), None)

    def _set_row(self, switch: int, row: int) -> None:
        """Set the row of one switch."""
        self.set_rows((*self.rows[:switch], row, *self.rows[switch + 1 :]))

    def _count_turns(self, switch: int) -> None:
        """Refuse a switch that changes rows again and again within a very short time."""
        since, count = self._turns.get(switch, (-math.inf, 0))
        count = 1 if self._now.time - since > _SWITCHES.again else count + 1
        self._turns[switch] = self._now.time, count
        if count > _SWITCHES.turns:
            name = [*self._system.equations.frames.switches][switch]
            load = '.'.join(name.replace(':', '.', 1).split('.')[:2])
            raise RunError(
                f'{load} switches again and again at t = {self._now.time:.9g} s: a force that '
                'steps against the motion (sign, or a condition on a rate) would hold it at '
                'rest; write a steep function instead, such as tanh(vx/0.001)'
            )


def jammed_joints(now: PresentState) -> RunError:
    """The error of friction in ideal joints that no finite forces overcome."""
    joints = dict.fromkeys(joint.friction.name for joint in now.system.dynamics.frictional_joints)
    return RunError(
        f'friction jams at t = {now.time:.9g} s{now.where}: in {", ".join(joints)} no finite '
        'forces can continue the motion; reduce the coefficient of friction or the radius'
    )
