"""Derivatives across events: the reset, and the shift of its instant (saltation).

An event at ``g(x, t, p) = 0`` takes the state x to ``R(x, p)``, and the rates of the motion from
f- to f+. A change dp shifts the instant by ``dt = -(g_x dx + g_p dp)/g'``, g' along the motion
before, and what is left at a fixed time is ``R_x (dx + f- dt) + R_p dp - f+ dt`` (P. C. Mueller,
Calculation of Lyapunov exponents for dynamic systems with discontinuities, Chaos Solitons Fractals
5, 1995; R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems,
2004, ch. 7). Where rates go on without a jump, it does not matter when.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.contact.rubbing import Rubs, rubs_of
from mechanism_sim.derivatives.impulse_slopes import of_one, of_several
from mechanism_sim.derivatives.influences import NUMBERS, Influence
from mechanism_sim.derivatives.joint_impulses import beside
from mechanism_sim.derivatives.linearised import LinearEquations, Points, Selected
from mechanism_sim.hybrid.events import Impact, Mode

_ALIKE = 1e-7  # of the largest: what differs by less is equal
_SMALL = 1e-9
_DEPTH = 1e-12  # of the mechanism: to which places are known


class NoDerivativeError(Exception):
    """An event across which there is no derivative, in words."""


class _OrderError(NoDerivativeError):
    """Contacts that meet at one instant, and not at one for other values.

    Parameters
    ----------
    shifts : (P,) of the instants [s] of each by its number
    """

    def __init__(self, shifts: dict[int, Array]) -> None:
        super().__init__('several contacts meet, whose order changes')
        self.shifts = shifts


class Side(NamedTuple):
    """A machine on one side of an event.

    Attributes
    ----------
    at : coordinates, flags
    rates : (f + s,) accelerations of free coordinates, rates of states
    a : (n,) accelerations of all coordinates
    """

    at: Points
    rates: Array
    a: Array


class Variation(NamedTuple):
    """Derivatives by P keys at an instant, at fixed time."""

    q: Array  #: (n, P)
    v: Array  #: (n, P)
    a_p: Array  #: (p, P)
    states: Array  #: (s, P)
    parameters: Array  #: (c, P)
    approach: Array  #: (a, P)


class Saltation(NamedTuple):
    """Derivatives by P keys after an event, and those of its log."""

    free: Array  #: (2f + s, P) of the state after it, at fixed time
    shift: Array  #: (P,) of its instant [s]
    impacts: list[Array]  #: (len(NUMBERS), P) of each impact
    approach: Array  #: (a, P)


class _Terms(NamedTuple):
    """N terms of contacts at a point."""

    values: Array  #: (N,)
    slopes: Array  #: (z, N)
    direct: Array  #: (N, P) derivatives by keys, at a fixed point and fixed parameters

    def moved(self, z: Array) -> Array:
        """Differentials (N, P), by those of the point (z, P)."""
        return np.asarray(self.slopes.T @ z + self.direct)

    def some(self, columns: Sequence[int]) -> _Terms:
        """Some of them."""
        return _Terms(self.values[columns], self.slopes[:, columns], self.direct[columns])


class Jumps:
    """Derivatives across the events of a run.

    Parameters
    ----------
    equations : of the machine
    influence : of the keys
    """

    def __init__(self, equations: LinearEquations, influence: Influence) -> None:
        self._eq, self._influence, system = equations, influence, equations.system
        self._system = system
        self._free = [system.coordinates.index(c) for c in system.free]
        self._names = [gap.name for gap in system.gaps]
        self._e = np.array([gap.restitution for gap in system.gaps])
        self._mu = np.array([gap.friction for gap in system.gaps])
        codes = {'newton': 0, 'poisson': 1, 'stronge': 2}
        self._laws = np.array([codes[str(getattr(g.hypothesis, 'value', g.hypothesis))]
                               for g in system.gaps], dtype=np.int64)  # fmt: skip
        self._rows = len(system.dynamics.contacts.rows)
        self._asked: dict[tuple[int, ...], Selected] = {}

    # --- terms --------------------------------------------------------------------------------

    def _terms(self, side: Side, chosen: Selected | None) -> _Terms:
        """Chosen terms of contacts, or those of friction in ideal joints."""
        eq, at = self._eq, side.at
        values, slopes, built_in = eq.rubs(at) if chosen is None else eq.selected(at, chosen)
        direct = np.zeros((len(values), self._influence.start.shape[1]))
        for column, x in built_in.items():
            direct[:, column] = x
        return _Terms(values, slopes, direct)

    def _none(self, count: int) -> Selected:
        return Selected.none(self._eq.sizes, count)

    def _differential(self, x: Variation, time: bool = False) -> Array:
        """Of what terms depend on (z, P)."""
        none = np.full((1, x.q.shape[1]), float(time))
        return np.concatenate([x.q, x.v, x.a_p, x.states, none, x.parameters])

    def _flow(self, side: Side) -> Array:
        """Rates (z,) of what terms depend on, along the motion."""
        f, c = len(self._free), len(self._eq.chosen)
        own = [side.at.v[:, 0], side.a, np.zeros(len(side.at.a_p)), side.rates[f:], [1.0]]
        return np.concatenate([*own, np.zeros(c)])

    # --- events without impact ----------------------------------------------------------------

    def passed(
        self, before: Side, after: Side, x: Variation, guards: Selected, law: Array | None
    ) -> Saltation:
        """Across an event that leaves the state as it is.

        Parameters
        ----------
        guards : what may have ended the motion before, each in a column
        law : (P,) shift of the instant at which a law takes over, if one does
        """
        jump = after.rates - before.rates
        size = np.abs(np.concatenate([after.rates, before.rates, before.a])).max(initial=0.0)
        size = max(size, np.abs(before.at.v).max() ** 2)
        state = np.concatenate([x.q[self._free], x.v[self._free], x.states])
        smooth = np.abs(jump).max(initial=0.0) <= _SMALL * size
        touches = self._system.compliant and guards.gap.any()
        shifts = [] if law is None else [law]
        if guards.gap.shape[1] and not (smooth and not touches):
            terms, flow = self._terms(before, guards), self._flow(before)
            rates = terms.slopes.T @ flow
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
        """Derivatives of the speeds to which the damping of touches refers."""
        z = self._differential(x) + np.outer(self._flow(before), dt)
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
        """Refuse switches of rates that an impact does not take clear across their zeros."""
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
        """Refuse other starts by their modes and rows, if they make another beginning of this."""
        size = max(np.abs(side.rates).max(initial=0.0), np.abs(side.at.v).max() ** 2)
        for modes, rows in others:
            if (~self._closed(side) & (np.array(modes, dtype=int) > Mode.FREE_FLIGHT)).any():
                raise NoDerivativeError('it closes a contact that is open at the start')
            pars = side.at.parameters.copy()
            index = self._system.parameters.switches
            for switch, symbols, row in zip(self._system.switches, index, rows, strict=True):
                pars[symbols, 0] = switch.values(row)
            rates = self._eq.slopes(side.at._replace(parameters=pars)).rate[:, 0]
            if np.abs(rates - side.rates).max(initial=0.0) > _SMALL * size:
                raise NoDerivativeError('a load begins with another part at the start')

    def seated(self, side: Side, x: Variation, key: int) -> Array:
        """Rates (f,) of free coordinates by a key, after blows that keep closed contacts closed.

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
        """The machine after impulses that keep at rest what is closed or sticks by `flags`.

        Gaps that differ are closed by plastic blows before: their order does not matter, for in
        any order they act along the same lines until all of them are closed.

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
        """Across impacts at one instant."""
        z, flow = self._differential(x), self._flow(before)
        n, groups = len(self._system.coordinates), _groups(impacts)
        if len(groups) == 1 < len(impacts) and self._independent(before, impacts):
            return self._apart(before, after, x, impacts)
        now, dt, rows = before, None, []
        speed = np.abs(np.concatenate([before.at.v, after.at.v])).max()
        try:
            for group in groups:
                found = self._together(now, z, flow, group, dt)
                now, z, dt, more = found
                rows += more
        except _OrderError as error:
            if len(groups) > 1 or not self._closed(after)[[*error.shifts]].all():
                raise
            dt = error.shifts[self._names.index(impacts[0].joint)]
            now, z, _ = self._at_rest(before, z + np.outer(flow, dt), after)
            known = [error.shifts.get(self._names.index(i.joint), dt) for i in impacts]
            rows = [np.array([t, *np.full((len(NUMBERS) - 1, len(t)), np.nan)]) for t in known]
        if np.abs(now.at.v[:, 0] - after.at.v[:, 0]).max() > _ALIKE * speed and any(
            i.ends_chatter for i in impacts
        ):
            now, z, _ = self._at_rest(now, z, after)
        assert dt is not None  # noqa: S101 - there is an impact
        off = now.at.v[:, 0] - after.at.v[:, 0]
        if np.abs(off).max() > _ALIKE * speed:
            raise NoDerivativeError('velocities jump there by more than its impacts account for')
        f = len(self._free)
        moved = z[self._free] - np.outer(after.at.v[self._free, 0], dt)
        faster = z[n:][self._free] - np.outer(after.rates[:f], dt)
        s = len(self._system.states)
        at = 2 * n + len(before.at.a_p)
        states = z[at : at + s] - np.outer(after.rates[f:], dt)
        return Saltation(np.concatenate([moved, faster, states]), dt, rows, x.approach)

    def _independent(self, now: Side, impacts: Sequence[Impact]) -> bool:
        """True if open gaps are struck that do not feel each other."""
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
        """Across impacts at one instant that do not feel each other, each at its own."""
        n, f, free = len(self._system.coordinates), len(self._free), np.array(self._free)
        z, flow = self._differential(x), self._flow(before)
        state = np.concatenate([x.q[free], x.v[free], x.states])
        rates, shift = before.rates.copy(), np.zeros(z.shape[1])
        rows: list[Array] = []
        for impact in impacts:
            side, moved, dt, row = self._together(before, z, flow, [impact], None, alone=True)
            jump = self._eq.slopes(side.at).rate[:, 0] - before.rates
            state[:f] -= np.outer((side.at.v - before.at.v)[free, 0], dt)
            state[f : 2 * f] += moved[n + free] - z[n + free] - np.outer(before.rates[:f], dt)
            state[f:] -= np.outer(jump, dt)
            rates, rows, shift = rates + jump, rows + row, dt
        size = max(np.abs(after.rates).max(), np.abs(after.at.v).max() ** 2)
        if np.abs(rates - after.rates).max() > _SMALL * size:
            raise NoDerivativeError('several contacts meet, whose order matters')
        return Saltation(state, shift, rows, x.approach)

    def _together(
        self,
        now: Side,
        z: Array,
        flow: Array,
        group: list[Impact],
        dt: Array | None,
        alone: bool = False,
    ) -> tuple[Side, Array, Array, list[Array]]:
        """One blow: the side after it, total differentials, the shift, those of its log."""
        struck = [self._names.index(i.joint) for i in group]
        touching = struck if alone else self._touching(now, struck)
        m, t = len(self._names), len(touching)
        own = touching + ([m + i for i in touching] if self._rows > m else [])
        terms = self._terms(now, self._unit_terms(tuple(touching), tuple(own)))
        if dt is None:
            closed = self._closed(now)
            speeds = terms.values[2 * t : 3 * t]
            near = speeds < -_ALIKE * np.abs(speeds).max()  # one may take all of a blow
            first = [
                k for k, i in enumerate(touching) if not closed[i] and (near[k] or i in struck)
            ]
            rates = terms.some([2 * t + k for k in first])
            shifts = self._instants(terms.some(first), rates.slopes.T @ flow, z, flow, now)
            dt = shifts[0]
            if np.abs(shifts - dt).max() > _ALIKE * max(np.abs(shifts).max(), 1e-300):
                raise _OrderError(dict(zip([touching[k] for k in first], shifts, strict=True)))
            z = z + np.outer(flow, dt)
        values, moved, n, f = terms.values, terms.moved(z), len(own), len(self._free)
        # of unit impulses: rates of rows and coordinates, impulses of drives
        ends = np.cumsum([t, t, n, n * n, n * f]).tolist()
        (_, _, rate, A, W, D), (_, angle, drate, dA, dW, dD) = (
            np.split(x, ends) for x in (values, moved)
        )
        A, dA = A.reshape(n, n), dA.reshape(n, n, -1)
        W, D = W.reshape(n, f), D.reshape(n, len(self._system.prescribed))
        ended = {self._names.index(i.joint) for i in group if i.ends_chatter}
        closed = self._closed(now)
        applies = np.array([
            rate[k] < 0.0 and not closed[i] and i not in ended for k, i in enumerate(touching)
        ], dtype=float)  # fmt: skip
        e = applies * self._e[touching], applies[:, None] * self._influence.restitution[touching]
        mu = self._mu[touching], self._influence.friction[touching]

        def impulses(A: Array, dA: Array) -> tuple[Array, Array]:
            more = [(0, 0), (0, dA.shape[2] - len(dt))]
            wide = [
                (x, np.pad(dx, more) if dA.shape[2] else np.zeros((len(x), 0)))
                for x, dx in ((rate, drate), e, mu)
            ]
            x, dx = self._impulses(touching, (A, dA), *wide)
            return x[:n], dx[:n]

        dW, dD, lost = dW.reshape(n, f, len(dt)), dD.reshape(*D.shape, len(dt)), 0.0 * dt
        if rubs := self._rubs(now, z, own):
            own_rubs, slopes = rubs
            found = beside(impulses, (A, dA), own_rubs, slopes)
            if found is None:
                raise NoDerivativeError('the slip of an ideal joint just ends in the impact')
            (x, dx), (share, dshare), lost = found
            of_joints = [(own_rubs.compliance[:n].T, slopes.compliance[:n].swapaxes(0, 1)),
                         (own_rubs.response, slopes.response),
                         (own_rubs.drive_response, slopes.drive_response)]  # fmt: skip
            dA, dW, dD = (
                own_ + np.einsum('kip,kj->jip', d, share) + np.einsum('ki,kjp->jip', u, dshare)
                for own_, (u, d) in zip((dA.swapaxes(0, 1), dW, dD), of_joints, strict=True)
            )
            A, W, D = (y + share.T @ u for y, (u, _) in zip((A.T, W, D), of_joints, strict=True))
            A, dA = A.T, dA.swapaxes(0, 1)
        else:
            x, dx = impulses(A, dA)
        after, dafter = rate + A @ x, drate + np.einsum('ijp,j->ip', dA, x) + A @ dx
        v, later, c = now.at.v.copy(), z.copy(), len(self._system.coordinates)
        v[self._free, 0] += x @ W
        later[[c + i for i in self._free]] += np.einsum('i,ijp->jp', x, dW) + W.T @ dx
        index = self._system.prescribed_index
        turned = now.at.v[index, 0], z[c : 2 * c][index]
        rows, unknown = [], np.full(len(dt), np.nan)
        for i in struck:
            k = touching.index(i)
            of = [k, t + k] if n > t else [k]
            drive = x[of] @ D[of], np.einsum(
                'i,ijp->jp', x[of], dD[of]
            ) + D[of].T @ dx[of]  # fmt: skip
            mean, dmean = 0.5 * (rate + after)[of], 0.5 * (drate + dafter)[of]
            known = {
                't': dt,
                'normal_angle': angle[k],
                'approach_speed': -drate[k],
                'rebound_speed': dafter[k] * (after[k] > 0.0),
                'normal_impulse': dx[k],
                'tangential_impulse': dx[of[-1]] * (n > t),
                'energy_loss': lost * (i == struck[0]) - (x[of] @ dmean + mean @ dx[of]),
                'drive_impulse': drive[1].sum(axis=0),
                'drive_work': drive[0] @ turned[1] + turned[0] @ drive[1],
            }
            rows.append(np.array([known.get(name, unknown) for name in NUMBERS]))
        return now._replace(at=now.at._replace(v=v)), later, dt, rows

    def _rubs(self, now: Side, z: Array, own: list[int]) -> tuple[Rubs, Rubs] | None:
        """Friction in ideal joints beside some rows of contacts, and its differentials."""
        if not self._system.dynamics.rubs:
            return None
        terms, sizes = self._terms(now, None), self._system.functions.rub_terms[1]
        rows, k = self._rows, len(sizes)
        kept = [*own, *range(rows, rows + k)]
        p, f = len(self._system.prescribed), len(self._free)
        found = []
        for values in (terms.values, terms.moved(z)):
            every = rubs_of(values, sizes, rows, f, p)
            found.append(
                every._replace(compliance=every.compliance[kept], forces=every.forces[:, kept])
            )
        return found[0], found[1]

    def _unit_terms(self, touching: tuple[int, ...], own: tuple[int, ...]) -> Selected:
        """Terms that a blow asks for: gaps, angles, rates, and those of unit impulses."""
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

    def _closed(self, side: Side) -> NDArray[np.bool_]:
        return np.asarray(side.at.parameters[self._system.parameters.closed, 0] > 0.0)

    def _touching(self, now: Side, struck: list[int]) -> list[int]:
        """Gaps that take part: those of the blow, closed ones, and what is at zero."""
        if len(self._names) == 1:
            return struck
        asked = self._none(len(self._names))
        asked.gap[:] = np.eye(len(self._names))
        near = 64.0 * np.spacing(self._system.mechanism.reach)
        part = self._closed(now) | (np.abs(self._terms(now, asked).values) <= near)
        part[struck] = True
        return [int(i) for i in np.flatnonzero(part)]

    def _instants(self, gaps: _Terms, opening: Array, z: Array, flow: Array, now: Side) -> Array:
        """Shifts (N, P) of the instants at which the open gaps of a blow close.

        Parameters
        ----------
        opening : second derivatives of these gaps
        """
        if not len(gaps.values):
            raise NoDerivativeError('closed contacts take part in no impact')
        along, size = gaps.slopes.T @ flow, self._system.mechanism.size
        # not deeper than the error of a step: whether it touches at all is rounding
        grazes = along**2 <= 2.0 * opening * _DEPTH * size
        if (grazes | (along >= -_SMALL * np.abs(now.at.v).max() * size)).any():
            raise NoDerivativeError('the contact only grazes')
        return np.asarray(-gaps.moved(z) / along[:, None])

    def _impulses(
        self,
        touching: list[int],
        compliance: tuple[Array, Array],
        rate: tuple[Array, Array],
        restitution: tuple[Array, Array],
        friction: tuple[Array, Array],
    ) -> tuple[Array, Array]:
        """Impulses of the rows of a blow, and their differentials."""
        (A, dA), (r, dr), m = compliance, rate, len(touching)
        if len(r) == m == 1:
            (e, de), x = restitution, -(1.0 + restitution[0]) * r / A[0]
            return x, -(de * r + (1.0 + e) * dr + x * dA[0]) / A[0, 0]
        if len(r) == m:  # no friction anywhere: tangents without effect
            wide, dwide = np.zeros((2 * m, 2 * m)), np.zeros((2 * m, 2 * m, dr.shape[1]))
            wide[:m, :m], dwide[:m, :m] = A, dA
            A, dA, r = wide, dwide, np.pad(r, (0, m))
            dr = np.pad(dr, ((0, m), (0, 0)))
        (e, de), (mu, dmu) = restitution, friction
        if m == 1:
            theta = np.array([A[0, 0], A[0, 1], A[1, 1], r[0], r[1], e[0], mu[0]])
            slopes = np.array([dA[0, 0], dA[0, 1], dA[1, 1], dr[0], dr[1], de[0], dmu[0]])
            return of_one(theta, slopes, int(self._laws[touching[0]]))
        if not np.isfinite(mu).all():
            raise NoDerivativeError('a rough contact takes part in an impact with others')
        found = of_several(A, r, e, mu, self._laws[touching], (dA, dr, de, dmu))
        if found is None:
            raise NoDerivativeError('no impulses satisfy all contacts')
        return found


def _solved(A: Array, b: Array) -> Array:
    """Of rows that may depend on each other."""
    return np.asarray(np.linalg.lstsq(A, b, rcond=1e-12)[0], dtype=float)


def _groups(impacts: Sequence[Impact]) -> list[list[Impact]]:
    """Impacts of one instant in their order: those of one blow together."""
    groups: list[list[Impact]] = []
    for impact in impacts:
        if groups and all(impact.joint != other.joint for other in groups[-1]):
            groups[-1].append(impact)
        else:
            groups.append([impact])
    return groups
