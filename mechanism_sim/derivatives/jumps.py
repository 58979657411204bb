"""Derivatives across events: the reset, and the shift of its instant (saltation).

An event at ``g(x, t, p) = 0`` takes the state x to ``R(x, p)``, and the rates of the motion from
f- to f+. A change dp shifts the instant by ``dt = -(g_x dx + g_p dp)/g'``, g' along the motion
before, and what is left at a fixed time is ``R_x (dx + f- dt) + R_p dp - f+ dt`` (P. C. Mueller,
Calculation of Lyapunov exponents for dynamic systems with discontinuities, Chaos Solitons Fractals
5, 1995; R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems,
2004, ch. 7). Where rates go on without a jump, it does not matter when.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.derivatives.impulse_slopes import of_one, of_several
from mechanism_sim.derivatives.influences import NUMBERS, Influence
from mechanism_sim.derivatives.linearised import LinearEquations, Points, Selected
from mechanism_sim.hybrid.events import Impact

_ALIKE = 1e-7  # of the largest: what differs by less is equal
_SMALL = 1e-9


class NoDerivativeError(Exception):
    """An event across which there is no derivative, in words."""


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

    # --- terms --------------------------------------------------------------------------------

    def _terms(self, side: Side, chosen: Selected) -> tuple[Array, Array]:
        return self._eq.selected(side.at, chosen)

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
        none = np.zeros(x.q.shape[1])
        if np.abs(jump).max(initial=0.0) <= _SMALL * size:
            return Saltation(state, none if law is None else law, [], x.approach)
        shifts = [] if law is None else [law]
        if guards.gap.shape[1]:
            _, slopes = self._terms(before, guards)
            rates = slopes.T @ self._flow(before)
            if (np.abs(rates) <= _SMALL * np.abs(rates).max(initial=0.0)).any():
                raise NoDerivativeError('it is reached without a rate')
            shifts += [*(-(slopes.T @ self._differential(x)) / rates[:, None])]
        if not shifts:
            raise NoDerivativeError('forces jump there for no reason that has a derivative')
        for other in shifts[1:]:
            if np.abs(other - shifts[0]).max() > _ALIKE * max(np.abs(shifts).max(), 1e-300):
                raise NoDerivativeError('several events meet, whose order changes')
        dt, f = shifts[0], len(self._free)
        state[f:] -= np.outer(jump, dt)
        return Saltation(state, dt, [], x.approach)

    # --- impacts ------------------------------------------------------------------------------

    def struck(
        self, before: Side, after: Side, x: Variation, impacts: Sequence[Impact]
    ) -> Saltation:
        """Across impacts at one instant."""
        if self._system.dynamics.rubs:
            raise NoDerivativeError('friction in ideal joints takes part in the impact')
        z, flow = self._differential(x), self._flow(before)
        n = len(self._system.coordinates)
        now, dt, rows = before, None, []
        for group in _groups(impacts):
            found = self._together(now, z, flow, group, dt)
            now, z, dt, more = found
            rows += more
        assert dt is not None  # noqa: S101 - there is an impact
        off = now.at.v[:, 0] - after.at.v[:, 0]
        speed = np.abs(np.concatenate([before.at.v, after.at.v])).max()
        if np.abs(off).max() > _ALIKE * speed:
            raise NoDerivativeError('rates jump there by more than its impacts say')
        f = len(self._free)
        moved = z[self._free] - np.outer(after.at.v[self._free, 0], dt)
        faster = z[n:][self._free] - np.outer(after.rates[:f], dt)
        s = len(self._system.states)
        at = 2 * n + len(before.at.a_p)
        states = z[at : at + s] - np.outer(after.rates[f:], dt)
        return Saltation(np.concatenate([moved, faster, states]), dt, rows, x.approach)

    def _together(
        self, now: Side, z: Array, flow: Array, group: list[Impact], dt: Array | None
    ) -> tuple[Side, Array, Array, list[Array]]:
        """One blow: the side after it, total differentials, the shift, those of its log."""
        m = len(self._names)
        seen = self._none(m + self._rows)
        seen.gap[:, :m], seen.row[:, m:] = np.eye(m), np.eye(self._rows)
        values, slopes = self._terms(now, seen)
        struck = [self._names.index(i.joint) for i in group]
        touching = self._touching(now, values, struck)
        if dt is None:
            dt = self._instant(values[m:], slopes[:, :m], z, flow, struck, now)
            z = z + np.outer(flow, dt)
        own = touching + ([m + i for i in touching] if self._rows > m else [])
        n = len(own)
        A, dA = self._compliance(now, own, z)
        rate, drate = values[m:][own], slopes[:, m:][:, own].T @ z
        ends = {self._names.index(i.joint) for i in group if i.ends_chatter}
        closed = self._closed(now)
        applies = np.array([
            rate[k] < 0.0 and not closed[i] and i not in ends for k, i in enumerate(touching)
        ], dtype=float)  # fmt: skip
        e, de = (
            applies * self._e[touching],
            applies[:, None] * self._influence.restitution[touching],
        )
        mu, dmu = self._mu[touching], self._influence.friction[touching]
        x, dx = self._impulses(touching, (A, dA), (rate, drate), (e, de), (mu, dmu))
        wide = np.zeros(self._rows)
        wide[own] = x[:n]
        dwide = np.zeros((self._rows, z.shape[1]))
        dwide[own] = dx[:n]
        return self._after(now, z, dt, group, wide, dwide, (values, slopes))

    def _closed(self, side: Side) -> Array:
        flags: Array = side.at.parameters[self._system.parameters.closed, 0] > 0.0
        return flags

    def _touching(self, now: Side, values: Array, struck: list[int]) -> list[int]:
        """Gaps that take part: those of the blow, closed ones, and what is at zero."""
        near = 64.0 * np.spacing(self._system.mechanism.reach)
        closed = self._closed(now)
        return [
            i
            for i in range(len(self._names))
            if i in struck or closed[i] or abs(values[i]) <= near
        ]

    def _instant(
        self, rates: Array, slopes: Array, z: Array, flow: Array, struck: list[int], now: Side
    ) -> Array:
        """Shift (P,) of the instant at which the first gap of a blow closes."""
        closed = self._closed(now)
        open_ = [i for i in struck if not closed[i]]
        if not open_:
            raise NoDerivativeError('closed contacts are struck by none')
        along = slopes[:, open_].T @ flow
        fastest = np.abs(now.at.v).max() * self._system.mechanism.size
        if (along >= -_SMALL * fastest).any():
            raise NoDerivativeError('the contact only grazes')
        shifts = -(slopes[:, open_].T @ z) / along[:, None]
        if np.abs(shifts - shifts[0]).max() > _ALIKE * max(np.abs(shifts).max(), 1e-300):
            raise NoDerivativeError('several contacts meet, whose order changes')
        return np.asarray(shifts[0])

    def _compliance(self, now: Side, own: list[int], z: Array) -> tuple[Array, Array]:
        """Compliance (n, n) of some rows, and its differentials (n, n, P)."""
        n = len(own)
        asked = self._none(n * n)
        for k in range(n * n):
            asked.left[own[k // n], k] = asked.right[own[k % n], k] = 1.0
        values, slopes = self._terms(now, asked)
        return values.reshape(n, n), (slopes.T @ z).reshape(n, n, -1)

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
            raise NoDerivativeError('a rough contact is struck together with others')
        found = of_several(A, r, e, mu, self._laws[touching], (dA, dr, de, dmu))
        if found is None:
            raise NoDerivativeError('no impulses satisfy all contacts')
        return found

    def _after(
        self,
        now: Side,
        z: Array,
        dt: Array,
        group: list[Impact],
        x: Array,
        dx: Array,
        seen: tuple[Array, Array],
    ) -> tuple[Side, Array, Array, list[Array]]:
        """Rates after a blow of impulses x (r,), and the differentials of what its log says."""
        s, n = self._system, len(self._system.coordinates)
        m, f, p = len(self._names), len(self._free), len(s.prescribed)
        struck = [self._names.index(i.joint) for i in group]
        count = f + len(struck) * (1 + p)
        asked = self._none(count)
        asked.right[:, :f], asked.free[:, :f] = x[:, None], np.eye(f)
        for k, i in enumerate(struck):
            own = f + k * (1 + p)
            asked.angle[i, own] = 1.0
            for j in range(p):
                column = own + 1 + j
                asked.drive[j, column] = 1.0
                asked.right[i, column] = x[i]
                if self._rows > m:
                    asked.right[m + i, column] = x[m + i]
        values, slopes = self._terms(now, asked)
        moved = slopes.T @ z
        response = self._responses(now, [*np.flatnonzero(np.abs(dx).max(axis=1, initial=0.0))])
        gained, dgained = values[:f], moved[:f] + response.T @ dx
        v, dv = now.at.v.copy(), z[n : 2 * n].copy()
        v[self._free, 0] += gained
        dv[self._free] += dgained
        side = now._replace(at=now.at._replace(v=v))
        later = z.copy()
        later[n : 2 * n] = dv
        asked_rates = self._none(self._rows)
        asked_rates.row[:] = np.eye(self._rows)
        after, slopes_after = self._terms(side, asked_rates)
        dafter = slopes_after.T @ later
        before, dbefore = seen[0][m:], seen[1][:, m:].T @ z
        drives = self._drive_slopes(now, struck, dx)
        rows = []
        for k, i in enumerate(struck):
            own = f + k * (1 + p)
            rows.append(
                self._logged(
                    i, (x, dx), (before, dbefore), (after, dafter), dt, moved[own],
                    (values[own + 1 : own + 1 + p], moved[own + 1 : own + 1 + p] + drives[k]),
                    (now.at.v[s.prescribed_index, 0], z[n : 2 * n][s.prescribed_index]),
                )
            )  # fmt: skip
        return side, later, dt, rows

    def _responses(self, now: Side, rows: list[int]) -> Array:
        """Rates (r, f) of the free coordinates by unit impulses of some rows, else 0."""
        f, found = len(self._free), np.zeros((self._rows, len(self._free)))
        asked = self._none(len(rows) * f)
        for k, r in enumerate(rows):
            asked.right[r, k * f : (k + 1) * f] = 1.0
            asked.free[:, k * f : (k + 1) * f] = np.eye(f)
        if rows:
            found[rows] = self._terms(now, asked)[0].reshape(len(rows), f)
        return found

    def _drive_slopes(self, now: Side, struck: list[int], dx: Array) -> Array:
        """Differentials (k, p, P) of impulses of drives by those of impulses of the gaps."""
        m, p, both = len(self._names), len(self._system.prescribed), self._rows > len(self._names)
        found = np.zeros((len(struck), p, dx.shape[1]))
        if not p:
            return found
        for k, i in enumerate(struck):
            for r in (i, m + i) if both else (i,):
                asked = self._none(p)
                asked.right[r], asked.drive[:] = 1.0, np.eye(p)
                found[k] += np.outer(self._terms(now, asked)[0], dx[r])
        return found

    def _logged(
        self,
        i: int,
        impulse: tuple[Array, Array],
        before: tuple[Array, Array],
        after: tuple[Array, Array],
        dt: Array,
        angle: Array,
        drive: tuple[Array, Array],
        speeds: tuple[Array, Array],
    ) -> Array:
        """Differentials (len(NUMBERS), P) of the fields of an impact."""
        m, (x, dx) = len(self._names), impulse
        loss = np.zeros(len(dt))
        for r in (i, m + i) if self._rows > m else (i,):
            mean, dmean = 0.5 * (before[0][r] + after[0][r]), 0.5 * (before[1][r] + after[1][r])
            loss -= dmean * x[r] + mean * dx[r]
        tangential = dx[m + i] if self._rows > m else 0.0 * dt
        rebound = after[1][i] if after[0][i] > 0.0 else 0.0 * dt
        given, work = drive[1].sum(axis=0), drive[0] @ speeds[1] + speeds[0] @ drive[1]
        known = {
            't': dt, 'normal_angle': angle, 'approach_speed': -before[1][i],
            'rebound_speed': rebound, 'normal_impulse': dx[i], 'tangential_impulse': tangential,
            'energy_loss': loss, 'drive_impulse': given, 'drive_work': work,
        }  # fmt: skip
        return np.array([known.get(name, np.full(len(dt), np.nan)) for name in NUMBERS])


def _groups(impacts: Sequence[Impact]) -> list[list[Impact]]:
    """Impacts of one instant in their order: those of one blow together."""
    groups: list[list[Impact]] = []
    for impact in impacts:
        if groups and all(impact.joint != other.joint for other in groups[-1]):
            groups[-1].append(impact)
        else:
            groups.append([impact])
    return groups
