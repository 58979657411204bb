"""Runs of any machine repeated in 80 bits, along the sequence of events that is known of it.

The machine's own equations in flight and contact, integrated by heyoka's series for `long double`.
Which guard ends each part of the motion is known from the run; where it does, Newton's method says
here, and Newton's law what an impact of one contact does. Numbers of the machine (parameters,
start, laws, rows of tables) may be moved along a direction, so that differences of such runs are
derivatives of the motion: no variational equations, and nothing of the jumps of `derivatives`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

import mechanism_sim as ms
from mechanism_sim.derivatives.influences import Influence, own
from mechanism_sim.derivatives.linearised import LinearEquations
from mechanism_sim.derivatives.numeric_keys import NumericKey, numeric_keys
from mechanism_sim.engine.events import Mode
from mechanism_sim.numerics.symbolic import dense
from mechanism_sim.planar.switches import Switch

F = np.longdouble
TURN = 8 * np.arctan(F(1))
STEPS, CLOSE = 8, F('1e-11')  # of Newton's method for an instant [s]
INSIDE = F('1e-13')  # [s] at which a compliant contact ends: its force has no series there
BEFORE = F('2e-6')  # [s] from which the end of one is looked for
OFFSETS = ((1, F(3) / 4), (2, -F(3) / 20), (3, F(1) / 60))
"""Of differences of sixth order."""


def newton_impulses(A: Any, rates: Any, e: Any, mu: Any) -> np.ndarray:
    """Normal and tangential impulse of one contact by Newton's law with dry friction.

    Parameters
    ----------
    A : (2, 2) compliance
    rates : normal and tangential, before
    e, mu : coefficients of restitution and friction
    """
    vn, vt = rates
    slip, rebound = np.sign(vt), -e * vn
    first = np.array([F(1), -mu * slip])  # impulses while it slips as it does
    rise = A @ first
    x = first * ((rebound - vn) / rise[0])
    if mu and slip * (vt + A[1] @ x) < 0:  # it has stopped before: it sticks, or slips back
        x = first * (-vt / rise[1])
        rough = abs(A[0, 1]) <= mu * A[1, 1]
        last = np.array([F(1), -A[0, 1] / A[1, 1] if rough else -mu * np.sign(A[0, 1])])
        x = x + last * ((rebound - vn - A[0] @ x) / (A[0] @ last))
    return x


class _Part(NamedTuple):
    """Part of a motion with one set of flags."""

    segment: int  #: the first
    last: int
    end: Any  #: [s] in the run
    struck: list[int]  #: gaps that an impact ends it by
    touched: list[int]  #: compliant gaps that close at its end
    released: list[int]  #: and that carry force until they open then
    stuck: list[int]  #: rows whose slip ends then
    switched: list[int]  #: switches that change then
    law: tuple[int, int] | None  #: drive, and its law that begins then


class Repeated:
    """A run of a machine, to be repeated with other numbers.

    Parameters
    ----------
    run : of which nothing is used but when which event happens
    """

    def __init__(self, machine: ms.Machine, run: ms.Solution, end: float) -> None:
        self._machine, self._run, self._end = machine, run, end
        self._system = system = machine.physics.system  # type: ignore[union-attr]
        self._numbers = own(machine, end)
        self._known = LinearEquations(machine.physics, [])  # type: ignore[arg-type]
        f, s, run_ = len(system.free), len(system.states), system.run
        d, self._m, self._rows = (
            system.dynamics,
            len(system.gaps),
            len(system.dynamics.contacts.rows),
        )
        names = system.equations.frames
        state = [*(names.q[c] for c in system.free), *(names.v[c] for c in system.free),
                 *run_.scaled_states]  # fmt: skip
        rates = run_.driven(run_.acted([*d.stabilised.a, *run_.state_rates]))
        flows = [*state[f : 2 * f], *rates]
        self._integrator = hy.taylor_adaptive(
            list(zip(state, flows, strict=True)), np.zeros(2 * f + s, F),
            fp_type=F, compact_mode=True,
        )  # fmt: skip
        unit = d.reduced.contacts
        switched = [x.inside if isinstance(x, Switch) else x.guard for x in system.switches]
        terms = run_.driven([
            *(dense(jet.value) for jet in d.contacts.normal),
            *(dense(jet.rate) for jet in d.contacts.rows),
            *switched,
            *(dense(x) for line in unit.compliance for x in line),
            *(dense(x) for line in unit.response for x in line),
        ])  # fmt: skip
        now = hy.make_vars('now')
        terms, flows = (list(hy.subs(x, {hy.time: now})) for x in (terms, flows))
        watched = terms[: self._m + self._rows + len(switched)]
        pairs = [*zip([*state, now], [*flows, hy.expression(1.0)], strict=True)]
        speeds = [hy.sum([hy.diff(g, x) * rate for x, rate in pairs]) for g in watched]
        none = [hy.expression(0.0)]  # nobody asks for it
        function = hy.cfunc([*terms, *speeds] or none, vars=[*state, now], fp_type=F,
                            compact_mode=True)  # fmt: skip
        self._terms, self._count, self._all = function, len(watched), len(terms)
        self._parts = self._sequence()

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the coordinates with which states begin, before their rates."""
        return self._system.free

    # --- the sequence -------------------------------------------------------------------------

    def _flags(self, k: int) -> np.ndarray:
        at = self._known.points(self._run.motion, np.array([k]), np.zeros(1), damped=False)
        return at.parameters[:, 0]

    def _laws_at(self, t: float) -> list[int]:
        return [max(int(np.searchsorted(x.start, t + 1e-12, side='right')) - 1, 0)
                for x in self._numbers.laws]  # fmt: skip

    def _sequence(self) -> list[_Part]:
        motion, curve, index = self._run.motion, self._run.motion.curve, self._system.parameters
        powered = {i for symbols in index.torques for i in symbols}
        kept = [
            i for i in range(len(index.values)) if i not in powered and i != index.stabilisation
        ]
        names = [gap.name for gap in self._system.gaps]
        ends = [k for k in range(len(motion)) if curve.start[k] + curve.duration[k] < self._end]
        found: list[_Part] = []
        first, before = 0, self._flags(0)
        struck = {}
        for impact in self._run.impacts:
            if impact.duration:
                continue
            k = int(np.abs(curve.start - impact.t).argmin())
            struck.setdefault(k, []).append(names.index(impact.joint))
        for k in ends:
            now, was = self._flags(k + 1), before
            old, new = motion.modes[k], motion.modes[k + 1]
            t = float(curve.start[k + 1])
            laws = [i for i in range(len(self._numbers.laws))
                    if self._laws_at(t)[i] != self._laws_at(float(curve.start[k]))[i]]  # fmt: skip
            same = (now[kept] == was[kept]).all() and (curve.turns[k] == curve.turns[k + 1]).all()
            if same and k + 1 not in struck and not laws:
                continue
            slid = np.isin(old, (Mode.SLIDING_FORWARD, Mode.SLIDING_BACKWARD))
            free, closed = old == Mode.FREE_FLIGHT, new > Mode.FREE_FLIGHT
            closed_before, soft = old > Mode.FREE_FLIGHT, self._system.compliant
            found.append(_Part(
                first, k, F(t), struck.get(k + 1, []),
                [int(i) for i in np.flatnonzero(free & closed & soft)],
                [int(i) for i in np.flatnonzero(
                    closed_before & (new == Mode.FREE_FLIGHT) & (old != Mode.RECOVERING) & soft
                )],
                [self._m + int(i) for i in np.flatnonzero(slid & (old != new) & closed)],
                [j for j, own_ in enumerate(index.switches) if (now[own_] != was[own_]).any()],
                (laws[0], self._laws_at(t)[laws[0]]) if laws else None,
            ))  # fmt: skip
            first, before = k + 1, now
        found.append(_Part(first, len(motion) - 1, F(self._end), [], [], [], [], [], None))
        return found

    # --- runs ---------------------------------------------------------------------------------

    def state(self, direction: Influence, scale: Any) -> np.ndarray:
        """Free coordinates, rates, states at the end, with numbers moved along a direction."""
        system, index, motion = self._system, self._system.parameters, self._run.motion
        base, f, p = self._numbers, len(self._system.free), len(self._system.prescribed)

        def moved(x: np.ndarray, dx: np.ndarray) -> np.ndarray:
            return np.asarray(x, F) + scale * np.asarray(dx, F)

        values = moved(base.parameters, direction.parameters)
        laws = [(moved(a.start, b.start), moved(a.numbers, b.numbers))
                for a, b in zip(base.laws, direction.laws, strict=True)]  # fmt: skip
        rows = [moved(a, b) for a, b in zip(base.rows, direction.rows, strict=True)]
        e, mu = (
            moved(getattr(base, n), getattr(direction, n)) for n in ('restitution', 'friction')
        )
        approach = moved(base.approach, direction.approach)
        ta = self._integrator
        ta.time, own_ = F(0), moved(base.start, direction.start)
        own_[2 * f :] /= np.array([s.scale for s in system.states], F)
        turns = np.zeros(len(system.coordinates))
        free = [system.coordinates.index(c) for c in system.free]
        ta.state[:] = own_
        for part in self._parts:
            k = part.segment
            ta.state[:f] -= TURN * (motion.curve.turns[k] - turns)[free]
            turns = motion.curve.turns[k]
            flags = self._flags(k)
            flags[index.stabilisation] = 0.0
            pars = np.asarray(flags, F) + (values - np.asarray(base.parameters, F))
            if index.approach:
                pars[index.approach] = approach
            for symbols, table, numbers in zip(index.switches, base.rows, rows, strict=True):
                if len(table):
                    pars[symbols] = numbers[np.abs(table - flags[symbols]).max(axis=1).argmin()]
            now = float(motion.curve.start[k])
            for n, (which, (starts, numbers)) in enumerate(
                zip(self._laws_at(now), laws, strict=True)
            ):
                row = numbers[which].copy()
                if n < p:
                    row[0] -= TURN * turns[system.prescribed_index[n]]
                    pars[index.laws[n]] = _about_zero(row, starts[which])[: len(index.laws[n])]
                else:
                    row[0] += row[1] * TURN * turns[system.driven_index[n]]
                    pars[index.torques[n - p]] = row
            beside = self._known.points(motion, np.array([k]), np.zeros(1)).outside[:, 0]
            for name, x in zip(self._known.outside, beside, strict=True):
                if name in index.outside:
                    pars[index.outside[name]] = 0 if name == 'time' else x
            ta.pars[:], self._pars = pars[: len(ta.pars)], pars
            self._end_of(part, laws)
            at = self._at()
            for i in part.touched:
                approach[i] = -at[self._m + i]
            if part.touched:
                ta.state[:f] += self._step_before(part.last + 1)[free]
            if part.struck:
                self._strike(part.struck, at, e, mu)
        return np.array(ta.state)

    def _step_before(self, k: int) -> np.ndarray:
        """By how much coordinates step where a segment begins.

        A compliant contact begins at a depth of a hair, for its force has no series at none. It is
        the same hair for numbers beside.
        """
        curve, before = self._run.motion.curve, np.array([k - 1])
        return np.asarray(
            curve.coefficients[k, :, 0] - curve.local(before, curve.duration[before])[0]
        )

    def _at(self) -> np.ndarray:
        ta = self._integrator
        found: np.ndarray = self._terms(
            np.append(ta.state, F(ta.time)), pars=self._pars[: self._terms.nparams]
        )
        return found

    def _end_of(self, part: _Part, laws: list[Any]) -> None:
        """Integrate to where the part ends."""
        ta = self._integrator
        if part.law:
            ta.propagate_until(laws[part.law[0]][0][part.law[1]])
            return
        early = min(BEFORE, (part.end - F(ta.time)) / 8) if part.released else F(0)
        ta.propagate_until(part.end - early)
        m, rows = self._m, self._rows
        columns = [*part.struck, *part.touched, *part.released, *(m + r for r in part.stuck),
                   *(m + rows + j for j in part.switched)]  # fmt: skip
        if not columns:
            return
        for _ in range(STEPS):
            at = self._at()
            step = -at[columns[0]] / at[self._all + columns[0]] - INSIDE * bool(part.released)
            ta.propagate_for(step)
            if abs(step) < CLOSE:  # then the next is a rounding
                return
        raise AssertionError(f'no event near {part.end} s')

    def _strike(self, struck: list[int], at: np.ndarray, e: np.ndarray, mu: np.ndarray) -> None:
        f, R, m = len(self._system.free), self._rows, self._m
        (i,) = struck
        own_ = [i, m + i] if m < R else [i]
        offset = self._count
        A = at[offset : offset + R * R].reshape(R, R)[np.ix_(own_, own_)]
        W = at[offset + R * R : offset + R * R + R * f].reshape(R, f)[own_]
        rates = at[m:][own_]
        if len(own_) == 1:
            x = -(1 + e[i]) * rates / A[0]
        else:
            x = newton_impulses(A, rates, e[i], mu[i])
        self._integrator.state[f : 2 * f] += x @ W

    def derivative(self, path: str, steps: Sequence[str] = ('1e-5', '3e-6', '1e-6')) -> np.ndarray:
        """Of the state at the end by a number of the scene, by differences of sixth order.

        Parameters
        ----------
        steps : relative; the second of those two serves whose differences are the most alike
        """
        (key,) = numeric_keys(self._machine, [path])
        direction, size = self.direction(key), F(key.value) or F(1)
        found = []
        for step in steps:
            h = F(step) * size
            pairs = [(self.state(direction, k * h), self.state(direction, -k * h), w)
                     for k, w in OFFSETS]  # fmt: skip
            found.append(sum(w * (more - less) for more, less, w in pairs) / h)
        apart = [np.abs(b - a).max() for a, b in pairwise(found)]
        return np.asarray(found[int(np.argmin(apart)) + 1])

    def direction(self, key: NumericKey) -> Influence:
        """Derivatives of the numbers, by differences of sixth order of machines built anew."""
        h = 1e-3 * abs(key.value or 1.0)
        near = {k: own(key.at(key.value + k * h), self._end) for k in range(-3, 4) if k}

        def slope(take: Any) -> Any:
            return sum(float(w) * (take(near[k]) - take(near[-k])) for k, w in OFFSETS) / h

        laws = [
            type(x)(slope(lambda o, j=j: o.laws[j].start), slope(lambda o, j=j: o.laws[j].numbers))
            for j, x in enumerate(self._numbers.laws)
        ]
        rows = [slope(lambda o, j=j: o.rows[j]) for j in range(len(self._numbers.rows))]
        parameters, start, e, mu, approach = (
            slope(lambda o, n=n: getattr(o, n))
            for n in ('parameters', 'start', 'restitution', 'friction', 'approach')
        )
        return Influence(parameters, start, laws, e, mu, approach, rows, [])


def _about_zero(row: np.ndarray, start: Any) -> np.ndarray:
    """Coefficients of a polynomial of the time since `start` by those of time."""
    found = np.zeros_like(row)
    for c in row[::-1]:
        found = np.concatenate([[F(0)], found[:-1]]) - start * found
        found[0] += c
    return found
