"""Derivatives across events: the reset, and the shift of its instant (saltation).

An event at ``g(x, t, p) = 0`` takes the state x to ``R(x, p)``, and the rates of the motion from
f- to f+. A change dp shifts the instant by ``dt = -(g_x dx + g_p dp)/g'``, g' along the motion
before, and what is left at a fixed time is ``R_x (dx + f- dt) + R_p dp - f+ dt`` (P. C. Mueller,
Calculation of Lyapunov exponents for dynamic systems with discontinuities, Chaos Solitons Fractals
5, 1995; R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems,
2004, ch. 7). Where rates do not jump, the shift has no effect.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, IndexArray, Mask
from mechanism_sim.derivatives.impulse_slopes import of_one, of_several
from mechanism_sim.derivatives.influences import NUMBERS, Influence
from mechanism_sim.derivatives.joint_impulses import beside
from mechanism_sim.derivatives.linearised import LinearEquations, Points, Selected
from mechanism_sim.engine.contact.impact import Hypothesis
from mechanism_sim.engine.contact.joint_friction import (
    JointFrictionProblem,
    joint_friction_problem,
)
from mechanism_sim.engine.events import Impact, Mode

_ALIKE = 1e-7  # of the largest: what differs by less is equal
_SMALL = 1e-9
_DEPTH = 1e-12  # of the mechanism: to which places are known


class NoDerivativeError(Exception):
    """An event across which there is no derivative; the message is its reason."""


class _OrderError(NoDerivativeError):
    """Impacts that are simultaneous at these values of keys, but not at others.

    Parameters
    ----------
    shifts : (P,) derivatives of the instant [s], by index of the gap
    """

    def __init__(self, shifts: dict[int, Array]) -> None:
        super().__init__('several contacts meet, whose order changes')
        self.shifts = shifts


class Side(NamedTuple):
    """A machine on one side of N events."""

    at: Points  #: coordinates, rates and parameters
    rates: Array  #: (f + s, N) accelerations of free coordinates, rates of states
    a: Array  #: (n, N) accelerations of all coordinates

    def some(self, which: Sequence[int] | IndexArray) -> Side:
        """Some of the events."""
        at = Points(*(x[:, which] for x in self.at))
        return Side(at, self.rates[:, which], self.a[:, which])


class Variation(NamedTuple):
    """Derivatives by P keys at an instant, at fixed time; of N instants with N before them."""

    q: Array  #: (n, P) coordinates
    v: Array  #: (n, P) rates
    a_p: Array  #: (p, P) prescribed accelerations
    states: Array  #: (s, P) states of first order
    parameters: Array  #: (c, P) chosen parameters
    approach: Array  #: (a, P)


class Saltation(NamedTuple):
    """Derivatives by P keys after an event, and of its log; of N events with N before them."""

    free: Array  #: (2f + s, P) of the state after the event, at fixed time
    shift: Array  #: (P,) of the instant [s]
    impacts: list[Array]  #: (len(NUMBERS), P) of the fields of each impact
    approach: Array  #: (a, P)


class _Terms(NamedTuple):
    """N terms of contacts at a point, or at E points with E before all shapes."""

    values: Array  #: (N,) values
    slopes: Array  #: (N, z) derivatives by the z variables
    direct: Array  #: (N, P) derivatives by keys, at a fixed point and fixed parameters

    def moved(self, z: Array) -> Array:
        """Differentials (N, C) from those of the variables (z, C); the last P columns are keys."""
        found = np.asarray(self.slopes @ z)
        found[..., found.shape[-1] - self.direct.shape[-1] :] += self.direct
        return found

    def some(self, columns: Sequence[int]) -> _Terms:
        """Some of them."""
        return _Terms(*(x[:, columns] for x in self))


class Jumps:
    """Derivatives across the events of a run.

    Parameters
    ----------
    equations : linearised equations of the machine
    influence : derivatives of the machine's numbers by the keys
    """

    def __init__(self, equations: LinearEquations, influence: Influence) -> None:
        self._eq, self._influence, system = equations, influence, equations.system
        self._system = system
        self._free = [system.coordinates.index(c) for c in system.free]
        self._names = [gap.name for gap in system.gaps]
        self._e = np.array([gap.restitution for gap in system.gaps])
        self._mu = np.array([gap.friction for gap in system.gaps])
        self._laws = np.array([Hypothesis(gap.hypothesis).code for gap in system.gaps], np.int64)
        self._rows = len(system.dynamics.contacts.rows)
        self._asked: dict[tuple[int, ...], Selected] = {}

    # --- terms --------------------------------------------------------------------------------

    def _terms(self, side: Side, chosen: Selected | None) -> _Terms:
        """Chosen terms of contacts, or those of friction in ideal joints, of one event."""
        return _Terms(*(x[0] for x in self._terms_of(side, chosen)))

    def _terms_of(self, side: Side, chosen: Selected | None) -> _Terms:
        """Terms of E events."""
        eq, at = self._eq, side.at
        values, slopes, built_in = (
            eq.joint_friction(at) if chosen is None else eq.selected(at, chosen)
        )
        shape = at.q.shape[1], -1
        direct = np.zeros((len(values), self._influence.start.shape[1]))
        for column, x in built_in.items():
            direct[:, column] = x
        return _Terms(*(x.reshape(*shape, *x.shape[1:]) for x in (values, slopes.T, direct)))

    def _none(self, count: int) -> Selected:
        return Selected.none(self._eq.sizes, count)

    def _differential(self, x: Variation) -> Array:
        """Differentials (z, P) of the variables of terms."""
        none = np.zeros((*x.q.shape[:-2], 1, x.q.shape[-1]))
        return np.concatenate([x.q, x.v, x.a_p, x.states, none, x.parameters], axis=-2)

    def _flow(self, side: Side) -> Array:
        """Rates (E, z) of the variables of terms, along the motions up to E events."""
        f, c, count = len(self._free), len(self._eq.chosen), side.a.shape[1]
        none = np.zeros((c, count))
        own = [side.at.v, side.a, 0.0 * side.at.a_p, side.rates[f:], np.ones((1, count)), none]
        return np.concatenate(own).T

    # --- events without impact ----------------------------------------------------------------

    def passed(
        self, before: Side, after: Side, x: Variation, guards: Selected, law: Array | None
    ) -> Saltation:
        """Saltation across an event that leaves the state as it is.

        Parameters
        ----------
        guards : terms of the guards that may have ended the motion, one a column
        law : (P,) shift of the instant of a change of law; None if the event is none
        """
        jump = (after.rates - before.rates)[:, 0]
        size = np.abs(np.concatenate([after.rates, before.rates, before.a])).max(initial=0.0)
        size = max(size, np.abs(before.at.v).max() ** 2)
        state = np.concatenate([x.q[self._free], x.v[self._free], x.states])
        smooth = np.abs(jump).max(initial=0.0) <= _SMALL * size
        touches = self._system.compliant and guards.gap.any()
        shifts = [] if law is None else [law]
        if guards.gap.shape[1] and not (smooth and not touches):
            terms, flow = self._terms(before, guards), self._flow(before)[0]
            rates = terms.slopes @ flow
            if (np.abs(rates) <= _SMALL * np.abs(rates).max(initial=0.0)).any():
                raise NoDerivativeError('it is reached without a rate')
            shifts += [*(-terms.moved(self._differential(x)) / rates[:, None])]
        for other in shifts[1:]:
            if np.abs(other - shifts[0]).max() > _ALIKE * max(np.abs(shifts).max(), 1e-300):
                raise NoDerivativeError('several events meet, whose order changes')
        if not shifts:
            if not smooth:
                raise NoDerivativeError('forces jump there without a cause that has a derivative')
            return Saltation(state, np.zeros(x.q.shape[1]), [], x.approach)
        dt, f = shifts[0], len(self._free)
        state[f:] -= np.outer(jump, dt)
        approach = self._touched(before, after, x, guards, dt) if touches else x.approach
        return Saltation(state, dt, [], approach)

    def _touched(
        self, before: Side, after: Side, x: Variation, guards: Selected, dt: Array
    ) -> Array:
        """Derivatives of the speeds of initial contact, to which the damping refers."""
        z = self._differential(x) + np.outer(self._flow(before)[0], dt)
        found, index = x.approach.copy(), self._system.parameters.approach
        for i in np.flatnonzero(guards.gap.any(axis=1)):
            asked = self._none(1)
            asked.row[i] = 1.0
            speed = self._terms(before, asked)
            given = after.at.parameters[index[i], 0]
            if abs(given + speed.values[0]) > _ALIKE * abs(given):
                raise NoDerivativeError('a contact is set down without a speed of its own')
            found[i] = -speed.moved(z)[0]
        return found

    def check_switches(self, before: Side, after: Side, switched: Sequence[int]) -> None:
        """Refuse switches whose arguments do not clearly change sign in an impact."""
        if not switched:
            return
        asked = self._none(len(switched))
        asked.switch[[*switched], range(len(switched))] = 1.0
        old, new = (self._terms(side, asked).values for side in (before, after))
        index, small = self._system.parameters.switches, _SMALL * np.abs([old, new]).max()
        # what holds a motion leaves it at rest up to the impact
        held = [
            getattr(self._system.switches[j], 'holds', None) is not None
            and before.at.parameters[index[j][-1], 0] > 0.0
            for j in switched
        ]
        crossed = np.where(held, np.abs(new) > small, old * new < -(small**2))
        if not crossed.all():
            raise NoDerivativeError('a load switches at the same instant')

    # --- starts -------------------------------------------------------------------------------

    def begin(self, side: Side, others: Iterable[tuple[tuple[int, ...], tuple[int, ...]]]) -> None:
        """Refuse a key that changes the contacts or switch rows at the start."""
        size = max(np.abs(side.rates).max(initial=0.0), np.abs(side.at.v).max() ** 2)
        for modes, rows in others:
            if (~self._closed(side) & (np.array(modes, dtype=int) > Mode.FREE_FLIGHT)).any():
                raise NoDerivativeError('it closes a contact that is open at the start')
            pars = side.at.parameters.copy()
            index = self._system.parameters.switches
            for switch, symbols, row in zip(self._system.switches, index, rows, strict=True):
                pars[symbols, 0] = switch.values(row)
            rates = self._eq.slopes(side.at._replace(parameters=pars)).rate
            if np.abs(rates - side.rates).max(initial=0.0) > _SMALL * size:
                raise NoDerivativeError('a load begins with another part at the start')

    def seated(self, side: Side, x: Variation, key: int) -> Array:
        """Rates (f,) of free coordinates by a key, after plastic impacts of closed contacts.

        A small rate out of a contact that is pressed ends in a chatter about as short as it is
        small, whatever the restitution below 1: its impulse is that of a plastic impact.
        """
        closed, n = self._closed(side), len(x.q)
        if self._system.compliant or (self._e[closed] == 1.0).any():
            raise NoDerivativeError('it changes the contacts with which the motion begins')
        z = self._differential(x)
        _, moved, gaps = self._at_rest(side, z, side)
        if np.abs(gaps[:, key]).max() > _SMALL * np.abs(z[:n, key]).max():
            raise NoDerivativeError('it opens a contact that is closed at the start')
        return np.asarray(moved[n:][self._free, key])

    def _at_rest(self, now: Side, z: Array, flags: Side) -> tuple[Side, Array, Array]:
        """State after impulses that keep closed and sticking contacts, by `flags`, at rest.

        Gaps that close at different instants do so by plastic impacts before: their order does not
        matter, as they act along the same rows until all of them are closed.

        Returns
        -------
        The side, total differentials (z, P), and those of the gaps (m, P) before
        """
        closed, m, f = np.flatnonzero(self._closed(flags)), len(self._names), len(self._free)
        pars, index, t = flags.at.parameters[:, 0], self._system.parameters, len(closed)
        own = [*closed, *(m + closed if self._rows > m else [])]
        n, terms = len(own), self._terms(now, self._unit_terms(tuple(closed), tuple(own)))
        ends = np.cumsum([t, t, n, n * n, n * f]).tolist()
        _, _, rate, A, W, _ = np.split(terms.values, ends)
        A, W = A.reshape(n, n), W.reshape(n, f)
        held, along = [*range(t)], np.eye(n)  # rows, and lines on which impulses act
        for j, i in enumerate(self._system.dynamics.contacts.frictional):
            if i in closed:
                k = int(np.flatnonzero(closed == i)[0])
                held += [t + k] * bool(pars[index.sticks[j]] > 0.0)
                along[t + k, k] = -self._mu[i] * pars[index.slips[j]]
        normal, along = along[:, :t], along[:, held]
        z, gaps = z.copy(), terms.moved(z)[:t]
        z[self._free] -= W.T @ (normal @ _solved((A @ normal)[:t], gaps))
        _, _, drate, dA, dW, _ = np.split(terms.moved(z), ends)
        x = -_solved((A @ along)[held], rate[held])
        impulses = along @ x
        moved = drate + np.einsum('ijp,j->ip', dA.reshape(n, n, -1), impulses)
        dx = -along @ _solved((A @ along)[held], moved[held])
        v, c = now.at.v.copy(), len(self._system.coordinates)
        v[self._free, 0] += impulses @ W
        z[[c + i for i in self._free]] += W.T @ dx + np.einsum(
            'i,ijp->jp', impulses, dW.reshape(n, f, -1)
        )
        return now._replace(at=now.at._replace(v=v)), z, gaps

    # --- impacts ------------------------------------------------------------------------------

    def struck(
        self, before: Side, after: Side, x: Variation, impacts: Sequence[Impact]
    ) -> Saltation:
        """Saltation across impacts at one instant."""
        z, flow = self._differential(x)[None], self._flow(before)
        groups = _groups(impacts)
        if len(groups) == 1 < len(impacts) and self._independent(before, impacts):
            return self._apart(before, after, x, impacts)
        now, dt, rows = before, None, []
        speed = np.abs(np.concatenate([before.at.v, after.at.v])).max()
        try:
            for group in groups:
                ended = [i.joint for i in group if i.ends_chatter]
                found = self._together(now, z, flow, [i.joint for i in group], dt, ended=ended)
                now, z, dt, more = found
                rows += [row[0] for row in more]
        except _OrderError as error:
            if len(groups) > 1 or not self._closed(after)[[*error.shifts]].all():
                raise
            own = error.shifts[self._names.index(impacts[0].joint)]
            now, z, _ = self._at_rest(before, z[0] + np.outer(flow[0], own), after)
            known = [error.shifts.get(self._names.index(i.joint), own) for i in impacts]
            rows = [np.array([t, *np.full((len(NUMBERS) - 1, len(t)), np.nan)]) for t in known]
            z, dt = z[None], own[None]
        if np.abs(now.at.v - after.at.v).max() > _ALIKE * speed and any(
            i.ends_chatter for i in impacts
        ):
            now, rested, _ = self._at_rest(now, z[0], after)
            z = rested[None]
        assert dt is not None  # noqa: S101 - there is an impact
        if not _meets(now, before, after)[0]:
            raise NoDerivativeError('velocities jump there by more than its impacts account for')
        return Saltation(self._later(after, z, dt)[0], dt[0], rows, x.approach)

    def _later(self, after: Side, z: Array, dt: Array) -> Array:
        """The state (E, 2f + s, C) after events at fixed time, by differentials as they move."""
        n, f, s = len(self._system.coordinates), len(self._free), len(self._system.states)
        at, free = 2 * n + len(after.at.a_p), np.array(self._free)
        own = np.concatenate([z[:, free], z[:, n + free], z[:, at : at + s]], axis=1)
        rates = np.concatenate([after.at.v[free], after.rates[:f], after.rates[f:]]).T
        return np.asarray(own - rates[:, :, None] * dt[:, None])

    def blows(
        self, before: Side, after: Side, x: Variation, impacts: Sequence[Impact], width: int
    ) -> tuple[Mask, Saltation]:
        """Saltation across E impacts of a single contact each, others staying open or closed.

        Nearly all impacts are such ones and are processed together. The C columns of their
        variations are the state of some `width` before, then P keys. In the result the shift of
        the instant is a column of its own between them: the other columns stay of usual size,
        however slowly a contact closes.

        Returns
        -------
        Indices of these impacts, and their saltation
        """
        count, C = x.q.shape[0], x.q.shape[2]
        struck = np.array([self._names.index(i.joint) for i in impacts])
        ended = np.array([i.ends_chatter for i in impacts])
        closed = before.at.parameters[self._system.parameters.closed] > 0.0
        part = self._part(before, closed, struck)
        alone = ~closed[struck, range(count)] & ((part & ~closed).sum(axis=0) == 1)
        alone &= not self._system.dynamics.frictional_joints
        states = 2 * len(self._free) + len(self._system.states)
        state, shift = np.zeros((count, states, C + 1)), np.zeros((count, C))
        log = np.zeros((count, len(NUMBERS), C + 1))
        z, flow = self._differential(x), self._flow(before)
        wide = np.concatenate([z[..., :width], flow[..., None], z[..., width:]], axis=2)
        kinds = np.concatenate([struck[None], ended[None], part, closed])
        # impacts with the same contacts, closed or struck, have terms of one form: all at once
        for kind in np.unique(kinds[:, alone], axis=1).T:
            which = np.flatnonzero(alone & (kinds == kind[:, None]).all(axis=0))
            joint, asked = [self._names[kind[0]]], self._none(2)
            asked.gap[kind[0], 0] = asked.row[kind[0], 1] = 1.0
            over = joint if kind[1] else []
            for own in (which, *which[:, None]):  # one by one if any of them is refused
                now, moved = before.some(own), np.zeros((len(own), C + 1))
                terms, moved[:, width] = self._terms_of(now, asked), 1.0
                opening = np.einsum('enz,ez->en', terms.slopes[:, 1:], flow[own])
                try:
                    instants = self._instants(terms.some([0]), opening, z[own], flow[own], now)
                    now, later, _, rows = self._together(
                        now, wide[own], flow[own], joint, moved, ended=over
                    )
                except NoDerivativeError:
                    alone[own] = False
                    continue
                alone[own] = _meets(now, before.some(own), after.some(own))
                state[own] = self._later(after.some(own), later, moved)
                shift[own], log[own] = instants[:, 0], rows[0]
                if len(own) == len(which):
                    break
        return alone, Saltation(state, shift, [log], x.approach)

    def _independent(self, now: Side, impacts: Sequence[Impact]) -> bool:
        """True if the impacts are in open gaps without mutual influence."""
        struck = [self._names.index(i.joint) for i in impacts]
        if self._closed(now).any():
            return False
        count, m = len(struck), len(self._names)
        own = [*struck, *(m + i for i in struck if self._rows > m)]
        k = len(own)
        terms = self._terms(now, self._unit_terms(tuple(struck), tuple(own)))
        A = terms.values[2 * count + k : 2 * count + k + k * k].reshape(k, k)
        same = np.equal.outer(np.arange(k) % count, np.arange(k) % count)
        return bool((np.abs(A[~same]) <= _SMALL * np.abs(A).max()).all())

    def _apart(
        self, before: Side, after: Side, x: Variation, impacts: Sequence[Impact]
    ) -> Saltation:
        """Saltation across simultaneous impacts without mutual influence, each at its own time."""
        n, f, free = len(self._system.coordinates), len(self._free), np.array(self._free)
        z, flow = self._differential(x), self._flow(before)
        state = np.concatenate([x.q[free], x.v[free], x.states])
        first = before.rates[:, 0]
        rates, shift = first.copy(), np.zeros(z.shape[1])
        rows: list[Array] = []
        for impact in impacts:
            side, (moved,), (dt,), row = self._together(
                before, z[None], flow, [impact.joint], None, alone=True
            )
            jump = self._eq.slopes(side.at).rate[:, 0] - first
            state[:f] -= np.outer((side.at.v - before.at.v)[free, 0], dt)
            state[f : 2 * f] += moved[n + free] - z[n + free] - np.outer(first[:f], dt)
            state[f:] -= np.outer(jump, dt)
            rates, rows, shift = rates + jump, [*rows, row[0][0]], dt
        size = max(np.abs(after.rates).max(), np.abs(after.at.v).max() ** 2)
        if np.abs(rates - after.rates[:, 0]).max() > _SMALL * size:
            raise NoDerivativeError('several contacts meet, whose order matters')
        return Saltation(state, shift, rows, x.approach)

    def _together(
        self,
        now: Side,
        z: Array,
        flow: Array,
        group: Sequence[str],
        dt: Array | None,
        alone: bool = False,
        ended: Sequence[str] = (),
    ) -> tuple[Side, Array, Array, list[Array]]:
        """Saltation across one simultaneous impact of E events with the same contacts.

        Parameters
        ----------
        z : (E, z, C) differentials, whose last columns are P keys
        group : names of the joints in impact
        dt : (E, C) shifts of the instants, if known
        alone : True if no other contact takes part
        ended : names of the joints whose chatter ends

        Returns
        -------
        The side after it, total differentials, shifts, and (E, len(NUMBERS), C) by joint
        """
        struck, C = [self._names.index(i) for i in group], z.shape[2]
        touching = struck if alone else self._touching(now, struck)
        m, t, E = len(self._names), len(touching), len(z)
        own = touching + ([m + i for i in touching] if self._rows > m else [])
        terms = self._terms_of(now, self._unit_terms(tuple(touching), tuple(own)))
        closed = self._closed(now)
        # each open gap closes at its own shifted instant: the impact stays one only if all shifts
        # agree, else the order of the impacts changes with the key
        if dt is None:
            speeds = terms.values[0, 2 * t : 3 * t]
            near = speeds < -_ALIKE * np.abs(speeds).max()  # one may take all of a blow
            first = [
                k for k, i in enumerate(touching) if not closed[i] and (near[k] or i in struck)
            ]
            rates = terms.some([2 * t + k for k in first])
            opening = np.einsum('enz,ez->en', rates.slopes, flow)
            shifts = self._instants(terms.some(first), opening, z, flow, now)
            dt = shifts[:, 0]
            if np.abs(shifts - dt[:, None]).max() > _ALIKE * max(np.abs(shifts).max(), 1e-300):
                known = zip([touching[k] for k in first], shifts[0], strict=True)
                raise _OrderError(dict(known))
            # variations to the shifted instant of the impact, along the flow before it
            z = z + flow[:, :, None] * dt[:, None]
        values, moved, n, f = terms.values, terms.moved(z), len(own), len(self._free)
        # of unit impulses: rates of rows and coordinates, impulses of drives
        p = len(self._system.prescribed)
        ends = np.cumsum([t, t, n, n * n, n * f, n * p]).tolist()
        parts = [slice(a, b) for a, b in pairwise([0, *ends])]
        _, _, rate, A, W, D = (values[:, part] for part in parts)
        _, angle, drate, dA, dW, dD = (moved[:, part] for part in parts)
        A, W, D = A.reshape(E, n, n), W.reshape(E, n, f), D.reshape(E, n, p)
        dA, dW, dD = dA.reshape(E, n, n, C), dW.reshape(E, n, f, C), dD.reshape(E, n, p, C)
        # restitution acts in approaching open gaps only, and not in the last impact of a chatter
        over = [self._names.index(i) for i in ended]
        applies = np.array([not closed[i] and i not in over for i in touching])
        applies = applies & (rate[:, :t] < 0.0)
        of_keys = self._influence
        e, mu = (
            (own_[touching] * on, slopes[touching] * on[:, :, None])
            for own_, slopes, on in (
                (self._e, of_keys.restitution, applies),
                (self._mu, of_keys.friction, np.ones_like(applies)),
            )
        )  # fmt: skip

        def impulses(A: Array, dA: Array) -> tuple[Array, Array]:
            x, dx = self._impulses(touching, (A, dA), (rate, drate), e, mu)
            return x[:, :n], dx[:, :n]

        lost = np.zeros((E, C))
        if both := self._joint_friction(now, z[0], own):
            friction, slopes = both

            def of_contacts(A: Array, dA: Array) -> tuple[Array, Array]:
                x, dx = impulses(A[None], dA[None])
                return x[0], dx[0]

            found = beside(of_contacts, (A[0], dA[0]), friction, slopes)
            if found is None:
                raise NoDerivativeError('the slip of an ideal joint just ends in the impact')
            (x, dx), (share, dshare), lost_ = found
            x, dx, lost = x[None], dx[None], lost_[None]
            # friction in joints grows in proportion to the contact impulses: its effects are added
            # to the terms of unit contact impulses, so that the steps below need not know of it
            of_joints = [(friction.compliance[:n].T, slopes.compliance[:n].swapaxes(0, 1)),
                         (friction.response, slopes.response),
                         (friction.drive_response, slopes.drive_response)]  # fmt: skip
            dA, dW, dD = (
                (d + np.einsum('kip,kj->jip', w, share) + np.einsum('ki,kjp->jip', u, dshare))[
                    None
                ]
                for d, (u, w) in zip((dA[0].swapaxes(0, 1), dW[0], dD[0]), of_joints, strict=True)
            )
            A, W, D = (
                (y + share.T @ u)[None]
                for y, (u, _) in zip((A[0].T, W[0], D[0]), of_joints, strict=True)
            )
            A, dA = A.swapaxes(1, 2), dA.swapaxes(1, 2)
        else:
            x, dx = impulses(A, dA)
        # the reset ``v+ = v- + W^T x`` and its differential, by the product rule
        after = rate + np.einsum('eij,ej->ei', A, x)
        dafter = drate + np.einsum('eijc,ej->eic', dA, x) + A @ dx
        v, later, c = now.at.v.copy(), z.copy(), len(self._system.coordinates)
        v[self._free] += np.einsum('ekf,ek->fe', W, x)
        later[:, [c + i for i in self._free]] += (
            np.einsum('ek,ekfc->efc', x, dW) + W.swapaxes(1, 2) @ dx
        )
        index = self._system.prescribed_index
        turned = now.at.v[index].T, z[:, c : 2 * c][:, index]
        rows, unknown = [], np.full((E, C), np.nan)
        for i in struck:
            k = touching.index(i)
            of = [k, t + k] if n > t else [k]
            drive = np.einsum('ek,ekp->ep', x[:, of], D[:, of])
            ddrive = np.einsum('ek,ekpc->epc', x[:, of], dD[:, of])
            ddrive += D[:, of].swapaxes(1, 2) @ dx[:, of]
            mean, dmean = 0.5 * (rate + after)[:, of], 0.5 * (drate + dafter)[:, of]
            work = np.einsum('ek,ekc->ec', x[:, of], dmean)
            told = {
                't': dt,
                'normal_angle': angle[:, k],
                'approach_speed': -drate[:, k],
                'rebound_speed': dafter[:, k] * (after[:, k] > 0.0)[:, None],
                'normal_impulse': dx[:, k],
                'tangential_impulse': dx[:, of[-1]] * (n > t),
                'energy_loss': lost * (i == struck[0])
                - (work + np.einsum('ek,ekc->ec', mean, dx[:, of])),
                'drive_impulse': ddrive.sum(axis=1),
                'drive_work': np.einsum('ep,epc->ec', drive, turned[1])
                + np.einsum('ep,epc->ec', turned[0], ddrive),
            }
            rows.append(np.stack([told.get(name, unknown) for name in NUMBERS], axis=1))
        return now._replace(at=now.at._replace(v=v)), later, dt, rows

    def _joint_friction(
        self, now: Side, z: Array, own: list[int]
    ) -> tuple[JointFrictionProblem, JointFrictionProblem] | None:
        """Friction in ideal joints beside some rows of contacts, and its differentials."""
        if not self._system.dynamics.frictional_joints:
            return None
        terms, sizes = self._terms(now, None), self._system.functions.joint_friction_terms[1]
        rows, k = self._rows, len(sizes)
        kept = [*own, *range(rows, rows + k)]
        p, f = len(self._system.prescribed), len(self._free)
        found = []
        for values in (terms.values, terms.moved(z)):
            every = joint_friction_problem(values, sizes, rows, f, p)
            found.append(
                every._replace(compliance=every.compliance[kept], forces=every.forces[:, kept])
            )
        return found[0], found[1]

    def _unit_terms(self, touching: tuple[int, ...], own: tuple[int, ...]) -> Selected:
        """Terms that an impact needs: gaps, angles, rates, and those of unit impulses."""
        if own in self._asked:
            return self._asked[own]
        t, n, f, p = len(touching), len(own), len(self._free), len(self._system.prescribed)
        asked = self._none(2 * t + n * (1 + n + f + p))
        for k, i in enumerate(touching):
            asked.gap[i, k] = asked.angle[i, t + k] = 1.0
        at = 2 * t
        for k, r in enumerate(own):
            asked.row[r, at + k] = 1.0
            left, free = at + n + k * n, at + n + n * n + k * f
            drive = at + n + n * (n + f) + k * p
            asked.left[[*own], range(left, left + n)] = 1.0
            asked.free[range(f), range(free, free + f)] = 1.0
            asked.drive[range(p), range(drive, drive + p)] = 1.0
            for first, count in ((left, n), (free, f), (drive, p)):
                asked.right[r, first : first + count] = 1.0
        self._asked[own] = asked
        return asked

    def _closed(self, side: Side) -> Mask:
        return np.asarray(side.at.parameters[self._system.parameters.closed, 0] > 0.0)

    def _touching(self, now: Side, struck: list[int]) -> list[int]:
        """Gaps that take part: those of the impact, closed ones, and those at zero."""
        if len(self._names) == 1:
            return struck
        part = self._part(now.some([0]), self._closed(now)[:, None], np.array(struck[:1]))
        part[struck] = True
        return [int(i) for i in np.flatnonzero(part)]

    def _part(self, now: Side, closed: Mask, struck: IndexArray) -> Mask:
        """Mask (m, E) of the gaps in E events: in impact (E,), closed, or at zero."""
        part = closed.copy()
        if len(part) > 1:
            asked = self._none(len(self._names))
            asked.gap[:] = np.eye(len(self._names))
            near = 64.0 * np.spacing(self._system.mechanism.reach)
            part |= np.abs(self._terms_of(now, asked).values.T) <= near
        part[struck, range(len(struck))] = True
        return part

    def _instants(self, gaps: _Terms, opening: Array, z: Array, flow: Array, now: Side) -> Array:
        """Shifts (E, N, C) of the instants at which the open gaps of impacts close.

        Parameters
        ----------
        opening : (E, N) second derivatives of these gaps
        """
        if not gaps.values.shape[1]:
            raise NoDerivativeError('closed contacts take part in no impact')
        along = np.einsum('enz,ez->en', gaps.slopes, flow)
        size, fastest = self._system.mechanism.size, np.abs(now.at.v).max(axis=0)
        # not deeper than the error of a step: whether it touches at all is rounding
        grazes = along**2 <= 2.0 * opening * _DEPTH * size
        if (grazes | (along >= -_SMALL * fastest[:, None] * size)).any():
            raise NoDerivativeError('the contact only grazes')
        return np.asarray(-gaps.moved(z) / along[:, :, None])

    def _impulses(
        self,
        touching: list[int],
        compliance: tuple[Array, Array],
        rate: tuple[Array, Array],
        restitution: tuple[Array, Array],
        friction: tuple[Array, Array],
    ) -> tuple[Array, Array]:
        """Impulses (E, n) of the rows of impacts, and their differentials (E, n, C).

        Columns of `rate` are the first of the C of `compliance`, those of coefficients the last of
        `rate`; in further columns only the compliance varies.
        """
        (A, dA), (r, dr), (e, de), (mu, dmu) = compliance, rate, restitution, friction
        m, C = len(touching), dA.shape[3]
        first = min(C, dr.shape[2])
        wide = np.zeros((*dr.shape[:2], C))
        wide[:, :, :first] = dr[:, :, :first]
        coefficients = np.zeros((2, len(r), m, C))
        if C >= first == dr.shape[2]:
            coefficients[:, :, :, first - de.shape[2] : first] = de, dmu
        dr, (de, dmu) = wide, coefficients
        if r.shape[1] == m == 1:
            x = -(1.0 + e) * r / A[:, 0]
            dx = de * r[..., None] + (1.0 + e)[..., None] * dr + x[..., None] * dA[:, 0]
            return x, -dx / A[:, 0, :, None]
        found = [_of_one_blow(self._laws[touching], *known) for known in
                 zip(A, dA, r, dr, e, de, mu, dmu, strict=True)]  # fmt: skip
        x, dx = (np.array(x) for x in zip(*found, strict=True))
        return x, dx


def _meets(now: Side, before: Side, after: Side) -> Mask:
    """Mask (E,) of the events whose computed velocities agree with those of the run after them."""
    speed = np.abs(np.concatenate([before.at.v, after.at.v])).max(axis=0)
    return np.asarray(np.abs(now.at.v - after.at.v).max(axis=0) <= _ALIKE * speed)


def _of_one_blow(laws: NDArray[np.int64], *known: Array) -> tuple[Array, Array]:
    """Impulses of the rows of one impact, and their differentials."""
    (A, dA, r, dr, e, de, mu, dmu), m = known, len(laws)
    if len(r) == m:  # no friction anywhere: tangents without effect
        wide, dwide = np.zeros((2 * m, 2 * m)), np.zeros((2 * m, 2 * m, dr.shape[1]))
        wide[:m, :m], dwide[:m, :m] = A, dA
        A, dA, r = wide, dwide, np.pad(r, (0, m))
        dr = np.pad(dr, ((0, m), (0, 0)))
    if m == 1:
        theta = np.array([A[0, 0], A[0, 1], A[1, 1], r[0], r[1], e[0], mu[0]])
        slopes = np.array([dA[0, 0], dA[0, 1], dA[1, 1], dr[0], dr[1], de[0], dmu[0]])
        return of_one(theta, slopes, int(laws[0]))
    if not np.isfinite(mu).all():
        raise NoDerivativeError('a rough contact takes part in an impact with others')
    found = of_several(A, r, e, mu, laws, (dA, dr, de, dmu))
    if found is None:
        raise NoDerivativeError('no impulses satisfy all contacts')
    return found


def _solved(A: Array, b: Array) -> Array:
    """Least-squares solution of rows that may depend on each other."""
    return np.asarray(np.linalg.lstsq(A, b, rcond=1e-12)[0], dtype=float)


def _groups(impacts: Sequence[Impact]) -> list[list[Impact]]:
    """Group the impacts of one instant in their order by simultaneous impacts."""
    groups: list[list[Impact]] = []
    for impact in impacts:
        if groups and all(impact.joint != other.joint for other in groups[-1]):
            groups[-1].append(impact)
        else:
            groups.append([impact])
    return groups
