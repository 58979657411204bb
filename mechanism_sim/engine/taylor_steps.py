"""Taylor steps up to events: taken in rows, and taken anew where an event was missed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.clock import horner
from mechanism_sim.engine.contacts import Contacts
from mechanism_sim.engine.dense_output import DenseOutput, floats
from mechanism_sim.engine.drive_laws import DriveLaws
from mechanism_sim.engine.events import Mode, drawn_in, ends_meet
from mechanism_sim.engine.integrators import Integrators
from mechanism_sim.engine.present_state import rate_of
from mechanism_sim.engine.singular import SingularPositions
from mechanism_sim.engine.step_check import StepCheck
from mechanism_sim.engine.step_rows import StepRows
from mechanism_sim.engine.thin_films import film_gone
from mechanism_sim.errors import RunError, quoted
from mechanism_sim.planar.protocols import Directed, WrappedGap
from mechanism_sim.tolerances import TOLERANCES

_SINGULAR = TOLERANCES.singular
_STEPS = TOLERANCES.steps

#: value of a guard, as integrated, below which a root may be near at any rate
_NEAR_ROOT = TOLERANCES.guards.near_root * TOLERANCES.guards.watch_scale


_UNWATCHED = (0.0, 1.0, 0.0)
_ROOT = 'where a root reaches 0 it has no slope: write sqrt(max(x, 0))'
_KEPT = 'keep it in its range, as max(x, 1e-6) does, or of rates x^2 + 1e-6'


class PendingStep(NamedTuple):
    """A step that is known but not yet part of the solution."""

    tau: float  #: [s] local time of its start
    h: float  #: [s] length
    guard: int | None  #: index of the guard that ended the step
    #: stabilisation [1/s], longest step [s] and stride [s] with which it was taken
    taken: tuple[float, float, float]
    origin: Array | None  #: state at its start before a projection, if there was one


class TaylorSteps:
    """Takes Taylor steps, each up to the first event in it.

    Parameters
    ----------
    laws, contacts, singular, output, integrators : parts of the same run
    max_step : [s] longest step
    defect : [rad/s] largest allowed change of a rate within a step by its defect
    quickest : [1/s] fastest stabilisation of gaps and loop closures

    Attributes
    ----------
    longest : [s] step
    """

    def __init__(
        self,
        laws: DriveLaws,
        contacts: Contacts,
        singular: SingularPositions,
        output: DenseOutput,
        integrators: Integrators,
        max_step: float,
        defect: float,
        quickest: float,
    ) -> None:
        self._laws, self._contacts, self._singular = laws, contacts, singular
        self._output, self._gaps, self._present = output, contacts.state, contacts.present
        self._system = system = contacts.present.system
        self._integrators = integrators
        self._ta, self._pars = integrators.main, contacts.present.pars
        self.longest, self._quickest = max_step, quickest
        self._stalled = 0
        # polynomials of what moves are known as it is
        self._check: StepCheck | None = None
        if system.steep:
            self._check = StepCheck(system, system.steep, self._ta, defect)
        width, series = self._ta.order + 1, floats(self._ta.tc)
        watch = system.width + 1  # after the state and the constant
        near = watch + len(system.guards)  # then the distance from singular positions
        self._coefficients = series[: system.width * width]
        self._guard_values = series[watch * width + 1 : near * width : width]
        self._nearness = series[near * width :] if system.relations else _UNWATCHED
        self._rows = StepRows(contacts, integrators, output, max_step, quickest, self._check)
        self._stabilisation = system.parameters.stabilisation

    def follow(
        self, tau: float, limit: float, last: int, respond: Callable[[int | None, float], None]
    ) -> tuple[float, float | None]:
        """Take steps from `tau` on: a row of them, or one that is yet to be located.

        `respond` is called with None for what is left of the event that ended a row. Returns the
        time reached, and the length of the single step.
        """
        laws, rows, lengths = self._laws, self._rows, self._output.lengths
        if laws.since >= _STEPS.row:
            laws.turn(tau)
        if self._fits_row:
            begun, stop = len(lengths), min(limit, laws.next_base, laws.next_change)
            most = min(_STEPS.row - laws.since, last - begun)
            tau = rows.take(tau, stop, most, self._singular.stride)
            laws.since += len(lengths) - begun
            if rows.ended:
                respond(None, tau)
            if rows.ended or len(lengths) - begun == most:
                return tau, None
        h = self._taken(tau, min(self.longest, self._gaps.horizon))
        rows.count(1)
        return tau, h if self._check is None else self._checked(tau, h, self._check)

    @property
    def _fits_row(self) -> bool:
        """True if the next step may be in a row: where an event is near, it must be seen there."""
        near = self._gaps.horizon < self.longest and not self._rows.resolves
        return not (near or self._system.compliant or self._goes_short())

    def _goes_short(self) -> bool:
        """True if the next step is to be of a low order."""
        return self._integrators.short and self._gaps.horizon < self.longest

    def locate(self, tau: float, h: float) -> PendingStep:
        """The pending step for one from `tau` of length `h` [s] that was just taken."""
        gaps, singular, pars = self._gaps, self._singular, self._pars
        watch, near, longest = self._guard_values, self._nearness, self.longest
        reach = min(longest, gaps.horizon)
        taken = (pars[self._stabilisation], reach, singular.stride)
        guard = self._system.fired(pars) if pars[self._system.parameters.fired] else None
        if self._system.lone:
            if watch[0] < _NEAR_ROOT:
                if watch[0] < 0.0 and not gaps.flying:
                    # it let go within the error of the last step's end
                    self._singular.return_to(tau)
                    h, guard = 0.0, 0
                else:
                    h, guard = self._look_again(tau, h, guard)
        elif self._system.compliant or (watch and min(watch) < _NEAR_ROOT):
            h, guard = self._look_again(tau, h, guard)
        crossing = None
        if near[1] + _SINGULAR.ahead * max(h, singular.stride) * near[2] < 0.0:
            h, guard, crossing = singular.approach(tau, h, guard)
        # a pole draws nearer by steps below the rounding of the time
        self._stalled = 0 if tau + h > tau or guard is not None else self._stalled + 1
        if self._stalled > (_STEPS.stalled if h > 0.0 else 0):
            raise self._breakdown(tau)
        slot = self._output.slots[len(self._output.lengths)]
        slot[:] = crossing.terms if crossing else self._coefficients
        if guard is None and (h < reach or reach == longest):
            pars[self._stabilisation] = min(1.0 / h, self._quickest)
        if reach < longest:
            gaps.horizon = math.inf
        return PendingStep(tau, h, guard, taken, crossing.origin if crossing else None)

    def _taken(self, tau: float, most: float) -> float:
        """Length of a step from `tau` of at most `most` [s], of low order where that suffices."""
        self._ta.time, h = tau, None
        if self._integrators.short and most < self.longest:
            h = self._integrators.short_step(most)
        return self._integrators.step(most) if h is None else h

    def _checked(self, tau: float, h: float, check: StepCheck) -> float:
        """Length of a step, repeated until no formula turns steep within it undetected.

        A step that ends shortly before a fault is on the same series, of less range: it is looked
        at again, for what that may hide.
        """
        while h > _STEPS.shortest * self.longest:
            sound, fault = check.reach(self._present.base.high, tau, h)
            if fault is None:
                break
            self._system.fired(self._pars)
            self._singular.return_to(tau)
            h = self._integrators.step(h * (sound or _STEPS.shorter * fault))
        else:
            if not np.isfinite(self._ta.tc[: self._system.width]).all():
                return math.nan  # a formula has no value here
        return h

    def _look_again(self, tau: float, h: float, guard: int | None) -> tuple[float, int | None]:
        """Length and guard of a step, taken anew where it missed an event.

        The search for the roots of a guard gives up where one lies much nearer to the start of a
        step than to its end, or on the point where it bisects; and the root of a step that ends
        within its own error of an impact lies just behind it.
        """
        missed, fell, until = self._missed(guard), None, math.inf
        while missed is not None and h > _STEPS.shortest * self.longest:
            if missed == fell and h == until:
                break
            when = self._time_of_fall(missed, h)
            fell, until = missed if when is not None else None, when or _STEPS.shorter * h
            self._singular.return_to(tau)
            h = self._taken(tau, until)
            guard = self._system.fired(self._pars)
            missed = self._missed(guard)
            if missed is None and guard is None and h == until:
                missed = fell  # there it is zero but for rounding; further on it was not
        return h, guard if missed is None or guard is not None else missed

    def _time_of_fall(self, guard: int, h: float) -> float | None:
        """Time of the zero crossing of a guard by its own series in a step `h` [s]; else None.

        An open gap that begins a rounding below zero and opens falls when it closes again: to come
        near that by ever shorter steps instead takes some ten of them.
        """
        series = self._ta.tc[self._system.width + 1 + guard]
        value = [k * x for k, x in enumerate(series.tolist())][1:]
        modes = self._gaps.modes
        flies = guard < len(modes) and modes[guard] == Mode.FREE_FLIGHT

        def fallen(t: float) -> bool:
            return horner(value, t) <= 0.0 and not (flies and rate_of(value, t) >= 0.0)

        if self._system.compliant or not fallen(h):
            return None
        early = _STEPS.shorter * h
        shortest = _STEPS.shortest * self.longest
        while h > shortest and fallen(early):
            h, early = early, _STEPS.shorter * early
        while early < (middle := 0.5 * (early + h)) < h:
            early, h = (early, middle) if fallen(middle) else (middle, h)
        return h

    def _missed(self, guard: int | None) -> int | None:
        """Guard that is below zero at the end of a step, other than `guard`, which ended it."""
        if guard is None or len(self._system.guards) > 1:
            return self._contacts.missed_event(guard)
        return None

    def _breakdown(self, tau: float) -> RunError:
        if self._system.relations:
            self._singular.return_to(tau)
            if self._present.singular_joints():
                return self._singular.undecided()
        self._singular.return_to(tau)
        time = self._present.base.high + tau
        free = dict(zip(self._system.free, self._present.state, strict=False))
        driven = zip(self._system.prescribed, self._present.base.laws, strict=False)
        q = free | {c: horner(law, tau) for c, law in driven}
        place = np.array([[q[c]] for c in self._system.coordinates])
        if gone := film_gone(self._system.elements, place, time):
            return gone
        # springs and ropes have no direction where their ends meet: a singularity of their formula
        size = self._system.mechanism.size
        for e in self._system.elements:
            if not (isinstance(e, Directed) and e.directed):
                continue
            if math.hypot(*e.between(place)[:, 0]) < _STEPS.meet * size:
                return ends_meet(e.name, time)
        for gap in self._system.gaps:
            if isinstance(gap, WrappedGap) and gap.lengths(place).min() < _STEPS.meet * size:
                return drawn_in(gap.name, time)
        rates = self._present.evaluate(self._system.functions.accelerations)[len(free) :]
        values = self._present.state[2 * len(self._system.free) :]
        for known, y, rate in zip(self._system.states, values, rates, strict=True):
            if not (abs(y) < _STEPS.endless and abs(rate) < _STEPS.endless**2):
                return RunError(
                    f'the state {known.label} of first order ends at t = {time:.9g} s, where it '
                    f'is {known.scale * y:.6g} and its rate {known.scale * float(rate):.6g}'
                    f'{f"; {_ROOT}" if math.isnan(rate) else ""}'
                )
        if said := self._out_of_range(time):
            return RunError(said)
        return RunError(
            f'the integration broke down at t = {time:.9g} s: the state became infinite; the '
            'mechanism may be at a singular position'
        )

    def _out_of_range(self, time: float) -> str:
        """Sentence on a formula without a value here, or right beside; empty if there is none."""
        system, present = self._system, self._present
        texts = system.equations.frames.texts
        if not texts:
            return ''
        known = [x for _, x in texts.values()]
        slopes = [sum(hy.diff(x, v) for v in hy.get_variables(x)) for x in known]
        values = system.run.compile_now([*known, *slopes])
        here = present.evaluate(values)
        moved = np.diag(_STEPS.beside * (1.0 + np.abs(present.now)))
        moved = moved[:, [*range(system.width), -1]]  # the state, and the time
        places = present.now[:, None] + np.hstack([moved, -moved])
        beside = values(np.ascontiguousarray(places))
        for k, (key, (text, _)) in enumerate(texts.items()):
            value, others = here[k], beside[k]
            ends = not np.isfinite([*others, here[len(known) + k]]).all()
            if ends and math.isfinite(value):
                said = f'is at the end of its range at t = {time:.9g} s, where it has no slope'
            elif ends or abs(value) > 2.0 * np.abs(others).min():  # a pole, but for rounding
                said = f'has no value at t = {time:.9g} s'
            else:
                continue
            hint = _ROOT if key.startswith('states:') else _KEPT
            return f'{key.replace(":", ".")}: the formula {quoted(text)} {said}; {hint}'
        return ''
