"""Contact transitions at an event: impact, sticking, sliding, separation.

One set of equations with a flag for each gap serves every pattern of contact: the pattern changes
by parameters, and nothing is compiled at an event. Compliant contacts run by the same flags: with
an event at the touch all pieces are smooth, where friction smoothed over a slip would be stiff.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import product
from time import perf_counter

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.contact.chatter import ChatterRule, remaining_time
from mechanism_sim.contact.impact import ContactImpulse, Hypothesis, jam_margin, shock, stop_slide
from mechanism_sim.contact.problem import (
    FLIES,
    FOLLOWS,
    GAP,
    LOSS,
    NORMAL,
    RECOVERS,
    ROUGH,
    SLIDES_BACKWARD,
    SLIDES_FORWARD,
    STICKS,
    TANGENTIAL,
    ContactProblem,
    Limits,
    Mask,
    enter,
    horizon_of,
    impact_now,
    problem_of,
    push,
    release,
    rest_now,
    slip_of,
)
from mechanism_sim.contact.rubbing import loss, rubs_of, with_friction
from mechanism_sim.errors import RunError
from mechanism_sim.hybrid.clock import Base
from mechanism_sim.hybrid.dense_output import Status, floats
from mechanism_sim.hybrid.events import ImpactLog, Mode, ModeChange
from mechanism_sim.hybrid.switching import Switching, rate_of
from mechanism_sim.hybrid.system import FORCE_SCALE, JAMMED, SLIP_SCALE, Guard, System
from mechanism_sim.numerics.complementarity import Indices
from mechanism_sim.numerics.kernels import charge, kernel
from mechanism_sim.planar.switches import HOLDS, Switch

_SLIDING = {1: Mode.SLIDING_FORWARD, 0: Mode.STICKING, -1: Mode.SLIDING_BACKWARD}
_SIGNS = {int(mode): sign for sign, mode in _SLIDING.items()}
INSIDE = 1e-13  # [m] depth at which a compliant contact begins: its force has no series at zero
_SET_DOWN = 0.01  # of the speed that its load makes: what touches slower is loaded from rest
_BEYOND = 1e3  # times the rounding of a guard: more did not fall at the same instant
_ROUNDING_FORCE = 1e-9  # [N] by which rounding may leave a contact outside of its friction cone

_IDLE = 1e-30  # coefficient of what slides without friction for a while

_MOST_TRIED = 4  # gaps at rest whose modes are all tried
_TINY_SHARE = 1e-9  # of the accelerations: rounding
_WITHIN_BOUND = 1e-9  # of the bound of friction, by which it stays within where a slip is held

_RUBBED, _MOST_RUBBED = 1e-13, 200  # of impulses that friction in ideal joints changes
_ROUGHLY_RUBBED = 1e-9  # the same, where rounding goes on turning a slip over


class Contacts(Switching):
    """The gaps of a system at the integrator's present state, and what became of them.

    Attributes
    ----------
    modes : of every gap
    flying : whether any gap is open
    impacts, mode_changes : the events so far
    horizon : [s] longest next step: a root much nearer to its start than to its end gets lost
    """

    def __init__(
        self,
        system: System,
        integrator: hy.taylor_adaptive_dbl,
        rule: ChatterRule,
        base: Base,
        rtol: float,
        speed: float,
    ) -> None:
        super().__init__(system, integrator, base)
        self.mode_changes: list[ModeChange] = []
        self.horizon = float('inf')
        self._rule = rule
        gaps = system.gaps
        self._names = [gap.name for gap in gaps]
        self.impacts = ImpactLog(self._names)
        m = len(gaps)
        self._arrays = (
            np.zeros(system.contact_layout.size),
            system.contact_layout,
            np.array([[g.restitution for g in gaps], [g.friction for g in gaps]], dtype=float),
            np.zeros(m, dtype=np.bool_),
            np.array([Hypothesis(gap.hypothesis).code for gap in gaps], dtype=np.int64),
        )
        self._problem = problem_of(*self._arrays)
        flags = {s.flag: k for k, s in enumerate(system.switches) if isinstance(s, Switch)}
        self._engaged = {
            i: system.switch_index[flags[flag]][0] for i, flag in system.dynamics.engaged.items()
        }
        self._modes = np.zeros(m, dtype=np.int64)
        self._touched, self._resting, self._begins, self._drawn = np.zeros((4, m), dtype=np.bool_)
        self._none = np.zeros(m, dtype=np.int64)
        self._flags = np.full((4, m), -1)
        self._flags[0] = system.flag_index
        self._flags[1, system.dynamics.frictional] = system.stick_index
        self._flags[2, system.dynamics.frictional] = system.slip_index
        self._flags[3, : len(system.presses_index)] = system.presses_index
        self._touching = 4.0 * self._rounding
        self._tie = max(self._touching, min(rtol, 1e-9) * system.mechanism.size)
        self._slowest = 1e-6 * speed  # [m/s] to which the damping of a touch may refer
        self._bare = 1e3 * float(np.spacing(speed))
        self._still = max(1e-12, 0.01 * rtol) * speed
        self._limits = Limits(
            self._touching, self._tie, self._bare, self._still, rule.allowed, rule.resolved
        )
        if system.margin_index is not None:
            self._pars[system.margin_index] = self._bare
        self._floor = [
            0.0 if not guard.friction else -max(SLIP_SCALE * self._still,
                                                FORCE_SCALE * _ROUNDING_FORCE)
            for guard in system.guards
        ]  # fmt: skip
        self.approach = (1.0,) * len(system.approach_index)
        self.set_modes((int(Mode.FREE_FLIGHT),) * m)

    def change_restitution(self, joint: str, restitution: float) -> None:
        """Let impacts in all gaps of a joint have another coefficient.

        Raises
        ------
        KeyError
            If the joint has no gap.
        """
        own = [i for i, gap in enumerate(self._system.gaps) if gap.joint == joint]
        for i in own:
            self._problem.restitution[i] = restitution
        if not own:
            raise KeyError(joint)

    def set_switches(self, rows: tuple[int, ...] | None = None) -> None:
        """Set the rows of the switches, and which contacts rub by them."""
        super().set_switches(rows)
        for i, flag in self._engaged.items():
            rubs = self._pars[flag] > 0.0
            self._problem.friction[i] = self._system.gaps[i].friction if rubs else _IDLE

    def set_modes(self, modes: tuple[int, ...], approach: tuple[float, ...] | None = None) -> None:
        """Set the modes that hold from now on, and the speeds of first touches [m/s]."""
        if approach is not None:
            self.approach = approach
            self._set(self._system.approach_index, approach)
        self._modes[:] = modes
        np.greater(self._modes, Mode.FREE_FLIGHT, out=self._problem.closed)
        self._set_flags(False)
        self._adopt()

    def _adopt(self) -> None:
        """Let what the array of modes says be known."""
        self.modes = tuple(self._modes.tolist())
        self._set_status()
        self.flying = int(Mode.FREE_FLIGHT) in self.modes
        known = self._system
        smooth = not (known.frictional or known.compliant or known.dynamics.rubs)
        self._flies_free = smooth and not self._problem.closed.any()

    def _set_status(self) -> None:
        acting = tuple(self.switches[k] for k in self._system.holding)
        acting += tuple(int(side > 0.0) for side in self.sides)
        self.status = Status(self.modes, self.approach, acting)

    def _set_flags(self, begins: bool) -> None:
        """Tell the equations the modes; of contacts that begin to slide, that they stick."""
        held = self._begins if begins else self._problem.closed[:0]
        write_flags(self._modes, held, self._flags, self._parameters)

    @property
    def _jumps(self) -> bool:
        """Whether a closed gap moves, more than by a step's error."""
        count, seen = len(self._floor), self._at_present(self._system.watch).tolist()
        rates = zip(self.modes, seen[count:], strict=False)
        return any(abs(x) > self._still for mode, x in rates if mode > Mode.FREE_FLIGHT)

    def closed(self, gap: int) -> bool:
        """Whether a gap carries force."""
        return self.modes[gap] > Mode.FREE_FLIGHT

    def start(self, closed: Sequence[bool]) -> None:
        """Begin a run: some gaps are closed by decree, those that touch are resolved."""
        if self.switches:
            self.set_switches()
            self.pass_edges()
        if self._system.slipping:
            self.sides = (1.0,) * len(self._system.side_index)
            if not self.modes:
                self._begin_to_rub()
        self.set_modes((int(Mode.FREE_FLIGHT),) * len(closed))
        if any(closed):
            terms = self.terms()
            self.set_modes(
                tuple(
                    int(self._mode_of_closed(terms, i)) if shut else mode
                    for i, (shut, mode) in enumerate(zip(closed, self.modes, strict=True))
                )
            )
        if any(closed) and self._system.compliant:
            self._seat()
        if any(closed) or self._system.relations:
            self.project()
        self.settle()
        if self.modes and self._system.slipping:
            self._begin_to_rub()
        self.mode_changes = [
            ModeChange(self.time, name, Mode(mode), Mode.UNKNOWN)
            for name, mode in zip(self._names, self.modes, strict=True)
        ]

    def settle(self) -> None:
        """Resolve the gaps that touch without an event having said so."""
        if not self.modes:
            return
        if self._system.compliant:
            self._respond_to_missed()
            return
        terms = self.terms()
        for i, (value, rate) in enumerate(zip(terms.value, terms.rate, strict=False)):
            # as good as resting is what would rise no farther than rounding reaches
            stays = rate <= 0.0 or self._rule.ends(rate, terms.acceleration[i], 1.0, -value)
            if self.closed(i) or (value <= self._touching and stays):
                self._collide(i)
                return

    def handle(self, guard: int) -> None:
        """A guard fell through zero."""
        found = self._system.guards[guard]
        flies = self._flies_free and found.gap >= 0
        if flies and self._bounce(found.gap):
            if self._system.holding:
                self._release()
            if len(self._floor) == len(self.modes):
                return
        else:
            began = perf_counter()
            self._respond(found)
            charge(perf_counter() - began)
        if len(self._floor) > 1:
            self._respond_to_missed()

    def _respond_to_missed(self) -> None:
        for _ in self._floor:
            guard = self.missed_event()
            if guard is None:
                break
            self._respond(self._system.guards[guard])

    def _respond(self, guard: Guard) -> None:
        held = [k for k in self._system.holding if self.switches[k] == HOLDS]
        if held:
            self._freeze(held)
        self._resolve(guard)
        if held and guard.switch is None:
            self._release()

    def _resolve(self, guard: Guard) -> None:
        gap, before = guard.gap, self.modes
        if guard == Guard(-1, 0):
            raise self._rubbed_fast()
        if guard.pin is not None:
            self._follow_pin(guard.pin)
            return
        if guard.side is not None:
            index = self._system.side_index[guard.side]
            self._pars[index] = -self._pars[index]
            self._set_status()
            return
        if guard.switch is not None:
            k, rows = guard.switch, self.switches
            self._count_turns(k)
            after = self._row_after(k)
            self._turned[k] = self._places()[k], rows[k]
            self.set_switches((*rows[:k], after, *rows[k + 1 :]))
            if self._system.relations and not self.singular_joints():
                self.project()  # another closure may hold from now on
            if any(self.closed(i) for i in range(len(before))):
                steps = self._system.frictional or self._system.dynamics.rubs
                if steps or self._jumps:  # a gap may close faster from now on
                    self.settle()
                else:
                    self.project()
        elif self._system.compliant:
            if not guard.friction or self._leaves(gap):
                self._touch(gap)
            elif self.modes[gap] == Mode.STICKING:
                # corners that stick to one wall together may creep meanwhile
                way = self._slip(self.terms(), gap) or -guard.friction
                self._change(gap, _SLIDING[way])
            else:
                self._change(gap, Mode.STICKING)
                self.project()
        elif not guard.friction:
            if not self.closed(gap):
                self._collide(gap)
                return
            self._change(gap, Mode.FREE_FLIGHT)
            self._separate([gap])
        else:
            at = self._problem.closed.copy()
            closed = _chosen(at)
            if self.modes[gap] == Mode.STICKING:
                self._change(gap, _SLIDING[-guard.friction])
                slip = [_SIGNS.get(self.modes[i], 0) for i in closed]
                if not self._jammed(closed, slip):
                    self._record_modes(before)
                    return
                self.set_modes(before)
                self._rest(at, at, given={gap: -guard.friction})
            elif guard.friction < 0:
                if not self._slip(self.terms(), gap):  # nothing to be stopped: it lifts off
                    self._change(gap, Mode.FREE_FLIGHT)
                    self._separate([gap])
                    self._record_modes(before)
                    return
                self._rest(self._mask(self._stop_slide(closed, gap)), at)
            else:
                self._rest(at, at)
                if self.modes == before:
                    self._hold_slip(gap)
            return
        self._record_modes(before)

    def _hold_slip(self, gap: int) -> None:
        """Let a slip count as none that has ended and goes nowhere, for other contacts hold it.

        Where two corners of a block rest on one line, the friction of one may be at its bound
        while the other sticks: then its slip is zero but for rounding, which would fall through
        zero for ever. A hair within the bound, friction has no slip to watch.
        """
        c, m = self._problem, len(self.modes)
        least = _TINY_SHARE * float(np.abs(c.free_acceleration).max(initial=0.0))
        if abs(c.acceleration[m + gap]) <= least:
            self._pars[self._flags[2, gap]] *= 1.0 - _WITHIN_BOUND

    def _begin_to_rub(self) -> None:
        """Note what presses on ideal joints that rub, and what holds there."""
        self._press_sides()
        for k in range(len(self._system.towards_index) // 2):
            self._follow_pin(k)
        self._hold_still(self._system.slipping)
        self._respond_to_missed()

    def missed_event(self, seen_now: int | None = None) -> int | None:
        """A guard which is past zero already: the integrator would never see it fall.

        That happens where a step ends within its error of an event. Beside the guard that is
        `seen_now`, others count only beyond what falls at the same instant.
        """
        seen = self._at_present(self._system.watch).tolist()
        modes = self.modes
        if self._system.lone:  # one gap without friction, the common case
            fell = seen[0] <= 0.0 and (modes[0] > 1 or seen[1] < 0.0)  # 1: free flight
            return 0 if fell and seen_now is None else None
        count = len(self._floor)
        margin = 0.0 if seen_now is None else self._touching
        if self._system.compliant:  # both factors of its guard may have fallen in one step
            for i, value in enumerate(seen[count + len(modes) : count + 2 * len(modes)]):
                # what parts from a depth of roundings is through before the next step can tell
                ended = value > margin - (self._touching if seen[count + i] > self._still else 0.0)
                if modes[i] > 1 and ended and i != seen_now:
                    return i
        if min(seen[:count]) > 0.0:
            return None
        for i, (x, floor) in enumerate(zip(seen, self._floor, strict=False)):
            if i < len(modes) and modes[i] == 1:
                if x <= -margin and seen[count + i] < 0.0 and i != seen_now:
                    return i
                continue
            beyond = x <= (floor if seen_now is None else _BEYOND * (floor - margin))
            if beyond and i != seen_now and not self._leads_back(self._system.guards[i].switch):
                return i
        return None

    def _seat(self) -> None:
        """Let compliant contacts that the start presses be damped as their load asks for.

        Those that part faster than they press recover.
        """
        terms, speeds = self.terms(), list(self.approach)
        for i, (gap, value) in enumerate(zip(self._system.gaps, terms.value, strict=True)):
            if self.closed(i) and gap.law is not None:
                depth = max(0.0, -float(gap.distance(np.array(value))))
                speed = gap.law.loading_speed(depth, 1.0 / terms.compliance[i][i])
                speeds[i] = max(speed, self._slowest)
        self.set_modes(self.modes, tuple(speeds))
        relief = self.terms().relief
        self.set_modes(
            tuple(
                int(Mode.RECOVERING) if self.closed(i) and relief[i] < 0.0 else mode
                for i, mode in enumerate(self.modes)
            )
        )

    def _touch(self, gap: int) -> None:
        """A compliant contact begins, or ends: a hair beyond zero, at the speed it has.

        Or it stops to press, or begins to do so again, while the links overlap.
        """
        terms, joint = self.terms(), self._system.gaps[gap]
        law = joint.law
        if law is None:
            raise ValueError('a compliant contact has a law')
        speeds, opens = list(self.approach), self.closed(gap)
        if opens:
            # the guard is a product: the factor whose zero is nearer in time has fallen
            depth = -float(joint.distance(np.array(terms.value[gap])))
            change = law.damping * abs(terms.acceleration[gap])
            if depth > INSIDE and abs(terms.relief[gap] * terms.rate[gap]) < depth * change:
                recovers = self.modes[gap] == Mode.RECOVERING
                self._change(
                    gap, self._mode_of_closed(terms, gap) if recovers else Mode.RECOVERING
                )
                return
        else:
            mass = 1.0 / terms.compliance[gap][gap]
            load = max(0.0, -terms.acceleration[gap] * mass)
            own, rate = law.loading_speed(law.resting_depth(load), mass), -terms.rate[gap]
            speeds[gap] = max(rate if rate > _SET_DOWN * own else own, self._slowest)
        mode = int(Mode.FREE_FLIGHT if opens else self._mode_of_closed(terms, gap))
        self.set_modes((*self.modes[:gap], mode, *self.modes[gap + 1 :]), tuple(speeds))
        target = self._rounding if opens else -INSIDE
        shift = (target - terms.value[gap]) / terms.compliance[gap][gap]
        for k, w in enumerate(terms.response[gap]):
            self._state[k] += w * shift

    def _leaves(self, gap: int) -> bool:
        """Whether a compliant contact is about to open: its force and friction are nothing."""
        terms = self.terms()
        depth = -float(self._system.gaps[gap].distance(np.array(terms.value[gap])))
        return depth <= INSIDE and terms.rate[gap] > 0.0

    def _change(self, gap: int, mode: Mode) -> None:
        self.set_modes((*self.modes[:gap], int(mode), *self.modes[gap + 1 :]))

    def terms(self) -> ContactProblem:
        """The gaps at the present state, until asked again."""
        self._at_present(self._system.contact_function, out=self._arrays[0])
        return self._problem

    def singular_joints(self, distance: float = 1e-6) -> list[str]:
        """The joints whose closures depend on those before them, to the root of a distance."""
        frames = self._system.equations.frames
        joints = [r.name for r in self._system.relations for _ in r.values(frames)]
        seen = self._at_present(self._system.projection)[2 * self._f :]
        near = [joint for joint, x in zip(joints, seen, strict=True) if not x > distance]
        return [*dict.fromkeys(near)]

    def project(self) -> None:
        """Bring loops and closed contacts to zero in value and rate."""
        f = self._f
        self._state[:] = floats(self._at_present(self._system.projection))[: 2 * f]
        if self._system.frictional and any(mode > Mode.FREE_FLIGHT for mode in self.modes):
            # what moved positions by a rounding turned the normals of fine clearances
            again = floats(self._at_present(self._system.projection))
            self._state[f:] = again[f : 2 * f]

    # --- impacts ------------------------------------------------------------------------------

    def _collide(self, gap: int) -> None:
        """Impact in `gap` and in all others that touch; then those at rest are sorted out."""
        log = self.impacts
        log.reserve(len(self.modes))
        self._at_present(self._system.contact_function, out=self._arrays[0])
        rubbed = self._rub(gap) if self._system.dynamics.rubs else 0.0
        first = log.count
        done = impact_now(
            *self._arrays,
            self._limits,
            gap,
            self.time,
            self._drive_rates,
            self._x[self._f :],
            log.rows,
            log.count,
            self._touched,
            self._resting,
        )
        if not done.found:
            raise ArithmeticError('no impulses satisfy all contacts of this instant')
        log.count = done.entered
        if rubbed and log.count > first:
            log.rows[first, LOSS] += rubbed
        self.horizon = min(self.horizon, done.horizon)
        if done.rests:
            self._rest(self._resting, self._touched)

    def _rub(self, gap: int) -> float:
        """Let an impact that is about to be feel the friction that it makes in ideal joints.

        Returns what that dissipates [J].
        """
        system, plain, m = self._system, self._arrays[0].copy(), len(self.modes)
        function, sizes = system.rub_function
        layout = system.contact_layout
        rubs = rubs_of(self._at_present(function), sizes, *layout[1:4])
        rows, T, lost = np.empty((m, len(self.impacts.rows[0]))), np.zeros(len(sizes)), 0.0
        before = np.zeros(layout.rows)
        for _ in range(_MOST_RUBBED):
            done = impact_now(
                *self._arrays, self._limits, gap, self.time, self._drive_rates,
                self._x[self._f :].copy(), rows, 0, self._touched, self._resting,
            )  # fmt: skip
            x = np.zeros(layout.rows)
            for row in rows[: done.entered]:
                x[int(row[GAP])] = row[NORMAL]
                x[m + int(row[GAP]) :: m] = row[TANGENTIAL]
            if not x.any():
                break
            lost = loss(rubs, x, T)
            if (left := np.abs(x - before).max() / np.abs(x).max()) <= _RUBBED:
                break
            self._arrays[0][:], before = plain, x
            T = with_friction(self._problem, rubs, x, T)
        else:
            if left > _ROUGHLY_RUBBED:
                raise self._rubbed_fast()
        return lost

    @property
    def _drive_rates(self) -> Array:
        """Of the drives that hold their law (p,) [rad/s]."""
        tau = self._ta.time
        return np.array([rate_of(law, tau) for law in self.base.laws])

    def _bounce(self, i: int) -> bool:
        """Impact of a gap without friction while all fly: `_collide` without its bookkeeping.

        False, and nothing is done, if another gap might touch at the same instant.
        """
        f, m, e = self._f, len(self.modes), float(self._problem.restitution[i])
        terms = self._at_present(self._system.contact_function).tolist()
        if m > 1 and any(x <= self._tie and k != i for k, x in enumerate(terms[:m])):
            return False
        # as `problem_of` tells them apart
        value, rate, acceleration = terms[i], min(terms[m + i], 0.0), terms[3 * m + i]
        response = 4 * m + i * f
        compliance = 4 * m + m * f + i * (m + 1)
        drive, driven = 4 * m + m * (f + m), len(self.base.laws)
        stop = self._rule.ends(-e * rate, acceleration, e, -value)
        after = 0.0 if stop else -e * rate
        p = (after - rate) / terms[compliance]
        if p > 0.0:
            for k in range(f):
                self._state[f + k] += terms[response + k] * p
            impulse = work = 0.0
            for k, law in enumerate(self.base.laws):
                x = terms[drive + i * driven + k] * p
                impulse += x
                work += x * rate_of(law, self._ta.time)
            left = remaining_time(-e * rate, acceleration, e) if stop else 0.0
            angle = terms[drive + m * driven + i]
            loss = -0.5 * (rate + after) * p
            self.impacts.enter(
                (self.time, i, angle, -rate, after, p, 0.0, loss, impulse, work, stop, left)
            )
        self._expect_return(after, acceleration)
        if after <= -1e-9 * rate:
            only = self._mask([i])
            self._rest(only, only)
        return True

    def _expect_return(self, rebound: float, acceleration: float) -> None:
        """Let the next step be no longer than flights that fall back steadily allow."""
        self.horizon = min(self.horizon, horizon_of(rebound, acceleration))

    # --- contacts that stay -------------------------------------------------------------------

    def _rest(
        self,
        resting: Mask,
        touching: Mask,
        jams: int = 6,
        given: Mapping[int, int] | None = None,
    ) -> None:
        """Of the contacts without normal speed, those that are pressed together stay closed.

        Where no force can keep a contact that slides, friction jams it: an impact without
        collision stops its sliding first. Contacts that are about to slide have their signs in
        `given`.
        """
        before, log, slips = self.modes, self.impacts, self._none
        if given:
            slips = np.zeros_like(slips)
            for i, sign in given.items():
                slips[i] = sign
        booked = log.count and log.last_time == self.time
        booked = booked and (len(before) > 1 or self._system.frictional)
        self._at_present(self._system.contact_function, out=self._arrays[0])
        if self._system.dynamics.rubs and not self._foresee_rest(resting, touching, slips):
            self._feel(self._modes)
            self._jam(resting, touching, jams, given)
            return
        rest = rest_now(
            *self._arrays,
            self._limits,
            resting,
            touching,
            slips,
            self._drive_rates,
            log.rows[log.count - booked : log.count],
            self._modes,
            self._begins,
            self._drawn,
        )
        if not rest.solved:
            self._set_flags(False)
            self._jam(resting, touching, jams, given)
            return
        self.horizon = min(self.horizon, rest.horizon)
        if rest.changed:
            self._adopt()
            self._record_modes(before)
        if rest.changed or rest.begins:
            self._set_flags(rest.begins)
        if rest.off or rest.begins or self._system.relations:
            self.project()
        if rest.begins:  # to slide, from a slip of exactly zero
            self._set_flags(False)
        if rest.parts:
            self._separate(_chosen(resting & ~self._problem.closed))
        if rest.draws:
            drawn = self._drawn.copy()
            self._rest(resting | drawn, touching | drawn, jams)

    def _jam(
        self, resting: Mask, touching: Mask, jams: int, given: Mapping[int, int] | None
    ) -> None:
        """No forces keep contacts at rest: those that gave way need not, by rounding."""
        if given:
            self._rest(resting, touching, jams)
        else:
            self._unjam(resting, touching, jams)

    def _foresee_rest(self, resting: Mask, touching: Mask, slips: Indices) -> bool:
        """Let friction in ideal joints be that of the modes that come of it, if there are any."""
        modes, closed = self._modes.copy(), self._problem.closed.copy()
        masks = np.zeros((2, len(modes)), dtype=np.bool_)
        terms, layout, laws, _, hypothesis = self._arrays
        seen: set[bytes] = set()
        while modes.tobytes() not in seen:
            seen.add(modes.tobytes())
            rest = rest_now(
                terms, layout, laws, closed, hypothesis, self._limits, resting, touching, slips,
                self._drive_rates, self.impacts.rows[:0], modes, *masks,
            )  # fmt: skip
            if not (rest.solved and rest.changed):
                return True
            self._feel(modes)
        # each of these modes makes a friction under which others follow: some go with their own
        known = resting.sum() <= _MOST_TRIED
        for tried in self._possible(resting, slips) if known else ():
            self._feel(tried)
            if self._agrees(tried, resting):
                return True
        return not known

    def _feel(self, modes: Indices) -> None:
        """Let friction in ideal joints, and the terms of contacts, be those of some modes."""
        write_flags(modes, self._begins[:0], self._flags, self._parameters)
        self._press_sides()
        self._at_present(self._system.contact_function, out=self._arrays[0])

    def _possible(self, resting: Mask, slips: Indices) -> Iterator[Indices]:
        """Modes (m,) of all gaps, of those at rest all that their slips allow."""
        gaps = _chosen(resting)
        choices: list[tuple[int, ...]] = []
        for i in gaps:
            way = int(slips[i]) or self._slip(self._problem, i)
            if not self._problem.friction[i]:
                choices.append((FOLLOWS, FLIES))
            elif way:
                choices.append((SLIDES_FORWARD if way > 0 else SLIDES_BACKWARD, FLIES))
            else:
                choices.append((STICKS, SLIDES_FORWARD, SLIDES_BACKWARD, FLIES))
        for chosen in product(*choices):
            modes = self._modes.copy()
            modes[gaps] = chosen
            yield modes

    def _agrees(self, modes: Indices, resting: Mask) -> bool:
        """Whether gaps at rest go on in the modes whose friction is felt."""
        m, c = len(modes), self._problem
        seen = self._at_present(self._system.watch)
        if any(seen[k] <= 0.0 for k, guard in enumerate(self._system.guards)
               if guard == Guard(-1, 0)):  # fmt: skip
            return False
        for i in _chosen(resting):
            least = -_TINY_SHARE * np.abs(c.free_acceleration).max(initial=0.0)
            if modes[i] == FLIES:
                if c.acceleration[i] < least:
                    return False
                continue
            way = {SLIDES_FORWARD: 1.0, SLIDES_BACKWARD: -1.0}.get(int(modes[i]), 0.0)
            if way and not self._slip(c, i) and way * c.acceleration[m + i] < least:
                return False
            for k, guard in enumerate(self._system.guards):
                slides = way and guard.friction > 0
                if guard.gap == i and not slides and seen[k] < min(self._floor[k], 0.0):
                    return False
        return True

    def _unjam(self, resting: Mask, touching: Mask, jams: int) -> None:
        """Let an impact without collision end a slide that no force can keep."""
        terms, names = self._problem, [self._names[i] for i in _chosen(resting)]
        near = touching | (np.abs(terms.value) <= self._touching)
        try:
            if not jams:
                raise ArithmeticError('friction jams again and again')
            rest = self._shock(terms, _chosen(near), _chosen(resting))
        except ArithmeticError as error:
            raise RunError(
                f'friction jams {", ".join(names)} at t = '
                f'{self.time:.12g} s{self._where}: neither forces nor finite impulses within '
                'the cones of friction keep the contacts; use less friction'
            ) from error
        self._rest(self._mask(rest), near, jams - 1)

    def _mask(self, gaps: Sequence[int]) -> Mask:
        """Flags (m,) of some gaps."""
        mask = np.zeros(len(self._modes), dtype=np.bool_)
        mask[gaps] = True
        return mask

    def _slip(self, terms: ContactProblem, gap: int) -> int:
        """Which way a contact with friction slides, 0 if not at all."""
        return int(slip_of(terms, gap, self._still))

    def _mode_of_closed(self, terms: ContactProblem, gap: int) -> Mode:
        """Of a gap that is closed from now on."""
        return _SLIDING[self._slip(terms, gap)] if terms.friction[gap] else Mode.FOLLOWING

    def _shock(
        self,
        terms: ContactProblem,
        gaps: Sequence[int],
        resting: Sequence[int],
        jammed: int | None = None,
    ) -> list[int]:
        """An impact without collision: friction stops or turns the sliding of contacts that jam.

        Returns those which rest after it.

        Raises
        ------
        ArithmeticError
            If nothing slides, or no finite impulses keep the contacts.
        """
        rows, A, friction = self._frictional(terms, gaps)
        rates = terms.rate[rows]
        before = [
            0.0 if r in resting or abs(x) <= self._still else x
            for r, x in zip(rows, rates.tolist(), strict=True)
        ]
        friction = [math.inf if i == jammed else mu for i, mu in zip(gaps, friction, strict=True)]
        impulses = shock(A, before, terms.free_acceleration[rows], friction)
        after = self._free(terms, gaps, impulses)
        return [
            i
            for k, i in enumerate(gaps)
            if after[k] <= max(self._still, rates[k] * (1.0 + 1e-6) if i in resting else 0.0)
        ]

    def _stop_slide(self, closed: list[int], gap: int) -> list[int]:
        """The impact without collision of closed contacts when the sliding of `gap` jams.

        Returns those which rest after it.
        """
        terms = self.terms()
        rows, A, friction = self._frictional(terms, closed)
        slip = [_SIGNS.get(self.modes[i], 0) for i in closed]
        try:
            impulses = stop_slide(A, terms.rate[rows], friction, slip)
        except ArithmeticError:
            with suppress(ArithmeticError):  # or else sliding goes on, or ends in `_rest`
                return self._shock(terms, closed, closed, gap)
        else:
            self._free(terms, closed, impulses)
        return closed

    def _jammed(self, closed: Sequence[int], slip: Sequence[int]) -> bool:
        """Whether closed contacts could not slide like this."""
        _, A, friction = self._frictional(self.terms(), closed)
        return jam_margin(A, friction, slip) <= JAMMED

    def _frictional(
        self, terms: ContactProblem, gaps: Sequence[int]
    ) -> tuple[list[int], Array, list[float]]:
        """Rows of gaps, rates of these per unit impulse, and coefficients of friction."""
        rows = [*gaps, *(len(self.modes) + i for i in gaps)]
        friction = np.minimum(terms.friction[gaps], ROUGH).tolist()
        return rows, terms.compliance[np.ix_(rows, rows)], friction

    def _free(
        self, terms: ContactProblem, gaps: Sequence[int], impulses: Sequence[ContactImpulse]
    ) -> Array:
        """Apply and enter an impact without collision; the rates of all rows after it."""
        rows, A, _ = self._frictional(terms, gaps)
        rates, n, log = terms.rate[rows], len(gaps), self.impacts
        after = rates + A @ [*(b.normal for b in impulses), *(b.tangential for b in impulses)]
        log.reserve(n)
        for k, (i, (p, q, _slip)) in enumerate(zip(gaps, impulses, strict=True)):
            if p or q:
                push(terms, i, p, q, self._x[self._f :])
                pair, row = [k, n + k], log.rows[log.count]
                drives = self._drive_rates
                enter(terms, i, p, q, rates[pair], after[pair], True, self.time, drives, row)
                log.count += 1
        return after

    def _separate(self, gaps: Sequence[int]) -> None:
        """Start the flight of gaps a few roundings inside, at rest in the normal direction.

        A flight that started on the wrong side of zero would never be seen to end. Other open
        gaps that touch at rest are moved along, lest they are pushed out.
        """
        for roundings in (1.0, 2.0, 4.0, 8.0):
            terms = self.terms()
            if roundings > 1.0 and all(terms.value[i] > 0.0 for i in gaps):
                return
            moved = list(gaps)
            if len(self.modes) > 1:
                moved += [
                    i
                    for i, value in enumerate(terms.value.tolist())
                    if not self.closed(i)
                    and i not in moved
                    and abs(value) <= self._touching
                    and abs(terms.rate[i]) <= self._bare
                ]
            release(terms, self._mask(moved), roundings * self._rounding, self._x)

    def _record_modes(self, before: tuple[int, ...]) -> None:
        for name, old, new in zip(self._names, before, self.modes, strict=True):
            if old != new:
                self.mode_changes.append(ModeChange(self.time, name, Mode(new), Mode(old)))


def _chosen(mask: Mask) -> list[int]:
    """Indices of what is set."""
    found: list[int] = mask.nonzero()[0].tolist()
    return found


@kernel
def write_flags(
    modes: Indices, sticking: Mask, places: NDArray[np.int64], parameters: Array
) -> None:
    """The flags closed, sticks, slips and presses of modes, in their places (4, m) if not -1.

    Those set in `sticking` (m,), or of none (0,), count as if they stuck.
    """
    for i in range(len(modes)):
        mode = STICKS if len(sticking) and sticking[i] else modes[i]
        slip = 1.0 if mode == SLIDES_FORWARD else -1.0 if mode == SLIDES_BACKWARD else 0.0
        for k in range(4):
            if places[k, i] >= 0:
                parameters[places[k, i]] = (
                    (1.0 if mode > FLIES else 0.0) if k == 0
                    else (1.0 if mode == STICKS else 0.0) if k == 1
                    else slip if k == 2
                    else (1.0 if FLIES < mode < RECOVERS else 0.0)
                )  # fmt: skip
