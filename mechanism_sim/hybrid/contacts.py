"""What an event does to the contacts: who strikes, who follows, who lets go."""

from __future__ import annotations

from collections.abc import Sequence

import heyoka as hy
import numpy as np

from mechanism_sim.contact.restitution import ChatterRule, newton_impulses
from mechanism_sim.hybrid.clock import Base
from mechanism_sim.hybrid.events import Impact, Mode, ModeChange
from mechanism_sim.hybrid.system import ContactTerms, System
from mechanism_sim.numerics.complementarity import solve_lcp

_MODES = (Mode.FREE_FLIGHT, Mode.FOLLOWING)


class Contacts:
    """The gaps of a system at the integrator's present state, and what became of them.

    Attributes
    ----------
    closed : of every gap, whether it carries force
    impacts, mode_changes : the events so far
    horizon : [s] longest next step: a root much nearer to its start than to its end gets lost
    """

    def __init__(
        self, system: System, integrator: hy.taylor_adaptive_dbl, rule: ChatterRule, base: Base
    ) -> None:
        self.closed: tuple[bool, ...] = (False,) * len(system.gaps)
        self.impacts: list[Impact] = []
        self.mode_changes: list[ModeChange] = []
        self.base = base
        self.horizon = float('inf')
        self._system = system
        self._ta = integrator
        self._f = len(system.free)
        self._state, self._pars = integrator.state[: 2 * self._f], integrator.pars
        self._terms_function = system.contact_function
        self._projection = system.projection
        self._terms_pars = self._pars[: system.contact_function.nparams]
        self._projection_pars = self._pars[: system.projection.nparams]
        self._rule = rule
        self._restitution = [gap.restitution for gap in system.gaps]
        self._names = [gap.name for gap in system.gaps]
        self._rounding = 2.0 * float(np.spacing(system.mechanism.size))
        self._touching = 4.0 * self._rounding  # gaps smaller than this [m] count as closed

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self.base.at(float(self._ta.time))

    def start(self, closed: Sequence[bool]) -> None:
        """Begin a run: some gaps are closed by decree, those that touch are resolved."""
        self.close(tuple(closed))
        for gap, shut in zip(self._system.gaps, closed, strict=True):
            mode = _MODES[shut]
            self.mode_changes.append(ModeChange(self.time, gap.name, mode, Mode.UNKNOWN))
        self.settle()

    def settle(self) -> None:
        """Resolve the gaps that touch without an event having said so."""
        for i in range(len(self.closed)):
            terms = self._terms()
            near, rate = terms.value[i] <= self._touching, terms.rate[i]
            # as good as resting is what would rise no farther than rounding reaches
            stays = rate <= 0.0 or self._rule.ends(
                rate, terms.free_acceleration[i], 1.0, -terms.value[i]
            )
            if self.closed[i] or (near and stays):
                self._collide(i)

    def handle(self, gap: int) -> None:
        """A guard fell through zero: an open gap touches, or a closed one lets go."""
        self._respond(gap)
        if len(self.closed) > 1:
            for _ in self.closed:
                other = self.fallen()
                if other is None:
                    break
                self._respond(other)

    def _respond(self, gap: int) -> None:
        if self.closed[gap]:
            before = self.closed
            self.close(tuple(c and i != gap for i, c in enumerate(before)))
            self._separate(gap)
            self._record_modes(before)
        else:
            self._collide(gap)

    def fallen(self) -> int | None:
        """An open gap which is past zero and closing: no guard would ever see it.

        That happens where a step ends within its error of an impact.
        """
        if all(self.closed):
            return None
        terms = self._terms()
        for i, (value, rate) in enumerate(zip(terms.value, terms.rate, strict=True)):
            if not self.closed[i] and value <= 0.0 and rate < 0.0:
                return i
        return None

    def close(self, closed: tuple[bool, ...]) -> None:
        """Set which gaps carry force from now on."""
        self.closed = closed
        self._pars[self._system.flag_index] = closed

    def _terms(self) -> ContactTerms:
        out = self._terms_function(self._state, pars=self._terms_pars, time=self._ta.time)
        return self._system.contact_terms(out.tolist())

    def _collide(self, gap: int) -> None:
        """Impact in `gap` and in all others that touch; then those at rest are sorted out."""
        terms = self._terms()
        if len(self.closed) == 1 and not self.closed[0]:
            self._bounce(terms, gap)
            return
        touching = [
            i
            for i, value in enumerate(terms.value)
            if i == gap or self.closed[i] or abs(value) <= self._touching
        ]
        if len(touching) == 1 and not self.closed[gap]:
            self._bounce(terms, gap)
            return
        rate = [min(terms.rate[i], 0.0) for i in touching]
        A = [[terms.compliance[i][k] for k in touching] for i in touching]
        e = [0.0 if self.closed[i] else self._restitution[i] for i in touching]
        ended = [
            self._rule.ends(-e_i * r, terms.free_acceleration[i], e_i, -terms.value[i])
            for i, e_i, r in zip(touching, e, rate, strict=True)
        ]
        e = [0.0 if stop else e_i for e_i, stop in zip(e, ended, strict=True)]
        impulses = newton_impulses(A, rate, e)
        after = [
            r + sum([a * p for a, p in zip(row, impulses, strict=True)])
            for r, row in zip(rate, A, strict=True)
        ]
        resting = []
        for i, p, r, r_after, stop in zip(touching, impulses, rate, after, ended, strict=True):
            if p > 0.0:
                self._push(terms, i, p)
                if i != gap or not self.closed[i]:
                    self._record_impact(terms, i, p, r, r_after, stop)
            # neither does one rest less that would rise no farther than rounding reaches
            low = self._rule.ends(r_after, terms.free_acceleration[i], 1.0, -terms.value[i])
            self._expect_return(r_after, terms.free_acceleration[i])
            if low or r_after <= -1e-9 * r:
                resting.append(i)
        if resting or any(self.closed[i] for i in touching):
            self._rest(resting, touching)

    def _bounce(self, terms: ContactTerms, gap: int) -> None:
        """Impact in one gap alone, the common case: `_collide` without its bookkeeping."""
        rate, e = min(terms.rate[gap], 0.0), self._restitution[gap]
        stop = self._rule.ends(-e * rate, terms.free_acceleration[gap], e, -terms.value[gap])
        after = 0.0 if stop else -e * rate
        impulse = (after - rate) / terms.compliance[gap][gap]
        if impulse > 0.0:
            self._push(terms, gap, impulse)
            self._record_impact(terms, gap, impulse, rate, after, stop)
        self._expect_return(after, terms.free_acceleration[gap])
        if after <= -1e-9 * rate:
            self._rest([gap], [gap])

    def _expect_return(self, rebound: float, acceleration: float) -> None:
        """Let the next step be no longer than 100 flights that fall back steadily.

        A number off the powers of two, at which the search for roots bisects.
        """
        if rebound > 0.0 and acceleration < 0.0:
            self.horizon = min(self.horizon, -200.0 * rebound / acceleration)

    def _rest(self, resting: list[int], touching: list[int]) -> None:
        """Of the contacts without normal speed, those that are pressed together stay closed."""
        before = self.closed
        terms = self._terms()
        A = [[terms.compliance[i][k] for k in resting] for i in resting]
        forces = solve_lcp(A, [terms.free_acceleration[i] for i in resting]) if resting else []
        pressed = {i for i, force in zip(resting, forces, strict=True) if force > 0.0}
        self.close(tuple(i in pressed if i in touching else c for i, c in enumerate(before)))
        self._state[:] = self._projection(
            self._state, pars=self._projection_pars, time=self._ta.time
        )
        for i in resting:
            if i not in pressed:
                self._separate(i)
        self._record_modes(before)

    def _separate(self, gap: int) -> None:
        """Start the flight a few roundings inside, at rest in the normal direction.

        A flight that started on the wrong side of zero would never be seen to end.
        """
        x, f = self._state, self._f
        for roundings in (1.0, 2.0, 4.0, 8.0):
            terms = self._terms()
            if terms.value[gap] > 0.0 and roundings > 1.0:
                return
            scale = 1.0 / terms.compliance[gap][gap]
            shift = (roundings * self._rounding - terms.value[gap]) * scale
            kick = -terms.rate[gap] * scale
            for k, w in enumerate(terms.response[gap]):
                x[k] += w * shift
                x[f + k] += w * kick

    def _push(self, terms: ContactTerms, gap: int, impulse: float) -> None:
        x, f = self._state, self._f
        for k, w in enumerate(terms.response[gap]):
            x[f + k] += w * impulse

    def _record_impact(
        self, terms: ContactTerms, i: int, p: float, rate: float, after: float, stop: bool
    ) -> None:
        tau = self._ta.time
        angular = work = 0.0
        for response, law in zip(terms.drive_response[i], self.base.laws, strict=True):
            angular += response * p
            work += response * p * rate_of(law, tau)
        self.impacts.append(
            Impact(
                self.time,
                self._names[i],
                terms.normal_angle[i],
                -rate,
                after if after > 0.0 else 0.0,
                p,
                0.0,
                -0.5 * (rate + after) * p,
                angular,
                work,
                stop,
            )
        )

    def _record_modes(self, before: tuple[bool, ...]) -> None:
        for gap, old, new in zip(self._system.gaps, before, self.closed, strict=True):
            if old != new:
                self.mode_changes.append(ModeChange(self.time, gap.name, _MODES[new], _MODES[old]))


def rate_of(law: Sequence[float], tau: float) -> float:
    """Rate [rad/s] of a law's polynomial at local time tau [s]."""
    rate = 0.0
    for k in range(len(law) - 1, 0, -1):
        rate = rate * tau + k * law[k]
    return rate
