"""Passing singular positions of ideal mechanisms, where closures depend on each other.

There ``G M^-1 G^T`` has no inverse, but the motion is analytic: what grows beyond bounds near the
position are errors of rounding. A step that begins well before it therefore leads beyond it, on
that part of its Taylor polynomial which rounding has not spoilt.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import polynomial

from mechanism_sim.arrays import Array
from mechanism_sim.engine.contacts import Contacts
from mechanism_sim.engine.dense_output import floats
from mechanism_sim.engine.integrators import Integrators
from mechanism_sim.engine.system import System
from mechanism_sim.errors import RunError
from mechanism_sim.numerics.polynomials import shift_powers
from mechanism_sim.tolerances import TOLERANCES

_GUARDS = TOLERANCES.guards
_SINGULAR = TOLERANCES.singular


_PLACES = np.linspace(0.0, 1.0, 65)
_SOON = _PLACES[1] * 2.0 ** np.arange(-20.0, 0.0)


def time_of_touch(distance: Array, within: float) -> float | None:
    """Time at which a polynomial (p,), positive at 0, touches zero in (0, within] [s]; or None."""
    distance = distance.copy()
    truncate(distance[None], within, distance[:1])
    slope = polynomial.polyder(distance)
    bend = polynomial.polyder(slope)
    t = float(within * _PLACES[np.argmin(polynomial.polyval(within * _PLACES, distance))])
    for _ in range(6):
        curvature = float(polynomial.polyval(t, bend))
        if not curvature > 0.0:
            return None
        t -= float(polynomial.polyval(t, slope)) / curvature
    if not 0.0 < t <= within:
        return None
    return t if polynomial.polyval(t, distance) < _SINGULAR.touches * distance[0] else None


def truncate(coefficients: Array, h: float, scale: Array) -> float:
    """Set to zero the terms of Taylor polynomials that rounding has spoilt.

    Terms become smaller up to where rounding takes over; the sum ends there.

    Parameters
    ----------
    coefficients : (r, p) of r functions of time, by powers; changed
    h : up to which the polynomials are to serve [s]
    scale : (r,) sizes of the functions

    Returns
    -------
    The error relative to `scale`: the size of the first two terms left out.
    """
    terms = np.abs(coefficients / scale[:, None]).max(axis=0) * h ** np.arange(len(coefficients.T))
    pairs = terms[1:-1] + terms[2:]  # every second term may vanish
    last = int(np.argmin(np.where(np.isfinite(pairs), pairs, np.inf)))
    coefficients[:, last + 1 :] = 0.0
    return float(pairs[last])


_Beyond: TypeAlias = 'tuple[float, int | None, memoryview[float]]'
"""Length [s] of a step across, the guard that ended it, and its coefficients."""


class Crossing(NamedTuple):
    """A step across a singular position."""

    terms: memoryview[float]  #: its coefficients
    origin: Array  #: the state at its start, before it was projected


class SingularPositions:
    """Detection of singular positions ahead of an integrator, and their crossing.

    Parameters
    ----------
    system : of equations with closures
    integrators : of that system
    contacts : of the same run
    index : of the state whose derivative is the distance from singular positions

    Attributes
    ----------
    stride : length of regular steps [s], not of those that events or singular positions cut short
    """

    def __init__(
        self, system: System, integrators: Integrators, contacts: Contacts, index: int
    ) -> None:
        self._system = system
        self._ta, self._step = integrators.main, integrators.step
        self._contacts, self._present = contacts, contacts.present
        self._index = index
        self._widest = 0.0
        self.stride = 0.0
        size = system.mechanism.size
        self._scale = np.array([1.0 if angular else size for angular in system.angular])
        #: of rates, then of states of first order
        self._scales = np.append(self._scale, np.ones(len(system.states)))

    def approach(
        self, tau: float, h: float, guard: int | None
    ) -> tuple[float, int | None, Crossing | None]:
        """End the last step before a singular position, or lead it beyond.

        Parameters
        ----------
        tau, h, guard : start and length [s] of the step, and the guard that ended it

        Returns
        -------
        Length and guard of the step that is to be taken, and what it is if it leads across.

        Raises
        ------
        RunError
            If the way beyond is not decided.
        """
        self.stride = stride = max(h, _SINGULAR.slower * self.stride)
        zone = _SINGULAR.zone * stride
        integrated = self._ta.tc[self._index]
        distance = integrated[1:] * np.arange(1.0, len(integrated)) / _GUARDS.watch_scale
        self._widest = max(self._widest, distance[0])
        if -2.0 * distance[0] < _SINGULAR.tangent * (stride + zone) * distance[1]:
            return h, guard, None
        touch = time_of_touch(distance, stride + zone)
        narrow = distance[0] < _SINGULAR.narrow * self._widest
        if touch is not None and touch > 1.25 * zone:
            if touch - zone < h:
                self.return_to(tau)
                h = self._step(touch - zone)
                guard = self._system.fired(self._ta.pars)
        elif touch is not None:
            origin = self._ta.tc[: self._system.width, 0].copy()
            crossed = self._cross(tau, touch)
            if crossed is not None:
                h, guard, terms = crossed
                return h, guard, Crossing(terms, origin)
            if not narrow:  # where the motion is fast, nearer by
                self._ta.state[: len(origin)] = origin
                h = self._step(min(h, 0.5 * touch))
                return h, self._system.fired(self._ta.pars), None
        if narrow:
            raise self.undecided()
        return h, guard, None

    def is_within(self, distance: float) -> bool:
        """True if the present position is so near to a singular one."""
        return bool(self._system.relations) and bool(self._present.singular_joints(distance))

    def begin(self) -> tuple[float, int | None, Crossing]:
        """Take the first step from a singular position.

        It is the end of a step across the position, which begins a little before it with the
        coordinates and rates from which its polynomial leads through those of the start.

        Returns
        -------
        Its length [s], the guard that ended it, and the step.

        Raises
        ------
        RunError
            If the rates do not decide how the motion goes on.
        """
        ta, f, width = self._ta, len(self._system.free), self._system.width
        state, now = ta.state[:width], ta.time
        start = state.copy()
        wanted = start[: 2 * f].reshape(2, f)
        speed = float((np.abs(wanted[1]) / self._scale).max())
        before = _SINGULAR.first / speed if speed else math.inf
        while speed and before > _SINGULAR.first * 0.01 / speed:
            try:
                from_there = self._origin(start, before, now)
                crossed = self._cross(now - before, before, since=before)
            except np.linalg.LinAlgError:
                crossed = None
            if crossed is None:
                before *= 0.5
                continue
            h, guard, terms = crossed
            series = np.asarray(terms).reshape(width, -1)
            series = shift_powers(series, np.full(width, before))
            reached = series[: 2 * f, 0].reshape(2, f) - wanted
            if from_there and np.abs(reached / self._scale).max() <= _SINGULAR.start * max(
                speed, 1.0
            ):
                return h - before, guard, Crossing(floats(series), start)
            before *= 0.5
        state[:], ta.time = start, now
        raise self.undecided()

    def _origin(self, start: Array, before: float, now: float) -> bool:
        """Set the state a little earlier from which a motion passes one (width,) of now."""
        ta, f, width = self._ta, len(self._system.free), self._system.width
        wanted, others = start[: 2 * f].reshape(2, f), start[2 * f :].copy()
        guess = np.array([wanted[0] - before * wanted[1], wanted[1]])
        for _ in range(_SINGULAR.start_rounds):
            ta.state[:width] = [*guess.ravel(), *others]
            ta.time = now - before
            for _ in range(2):
                self._present.project()
            guess = ta.state[: 2 * f].reshape(2, f).copy()
            self._step(before)
            series = ta.tc[:width].copy()
            self.return_to(now - before)
            if not np.isfinite(series).all():
                return False
            truncate(series[f:], _SINGULAR.beyond * before, self._scales)
            series[:f, 1:] = series[f : 2 * f, :-1] / np.arange(1.0, series.shape[1])
            missed = polynomial.polyval(before, series.T) - start
            off, others = missed[: 2 * f].reshape(2, f), others - missed[2 * f :]
            if (np.abs(off) / self._scale).max() <= _SINGULAR.start_newton * (
                1.0 + np.abs(wanted[1]).max()
            ):
                break
            guess -= np.array([off[0] - before * off[1], off[1]])
        return True

    def return_to(self, tau: float) -> None:
        """Undo the last step, which began at `tau`."""
        self._ta.state[:] = self._ta.tc[:, 0]
        self._ta.time = tau
        if self._system.guards:
            self._ta.reset_cooldowns()

    def _cross(
        self, tau: float, touch: float, since: float = 0.0
    ) -> tuple[float, int | None, memoryview[float]] | None:
        """Take a step across a singular position at `touch` [s] from its start.

        Events count that come later than `since` [s].
        """
        h = _SINGULAR.beyond * touch
        ta, system, f = self._ta, self._system, len(self._system.free)
        state, index = ta.state[: system.width], system.parameters.stabilisation
        self.return_to(tau)
        for _ in range(2):  # the rates are projected where the coordinates were before
            self._present.project()
        alpha, ta.pars[index] = ta.pars[index], 0.0
        self._step(h)
        ta.pars[index], ta.pars[system.parameters.fired] = alpha, 0.0
        series = ta.tc[: system.width].copy()
        speed = float((np.abs(series[f : 2 * f, 0]) / self._scale).max())
        error = truncate(series[f:], h, self._scales)
        if not error <= _SINGULAR.decided * speed:
            self.return_to(tau)
            return None
        series[:f, 1:] = series[f : 2 * f, :-1] / np.arange(1.0, series.shape[1])

        def go_to(s: float) -> None:
            state[:] = polynomial.polyval(s, series.T)
            ta.time = tau + s

        end, guard = self._first_event(go_to, h, touch, since) if system.guards else (h, None)
        go_to(end)
        if guard is None:
            self._present.project()
        if system.guards:
            ta.reset_cooldowns()
        return end, guard, floats(series)

    def _first_event(
        self, go_to: Callable[[float], None], h: float, touch: float, since: float
    ) -> tuple[float, int | None]:
        """The first guard beyond its fall along a step across a position, and when [s]."""
        places = h * np.concatenate([_SOON, _PLACES[1:]])
        before = since
        # nearer to the position forces are not known
        for s in places[(places > since) & (np.abs(places - touch) > _SINGULAR.blind * h)]:
            go_to(s)
            guard = self._contacts.missed_event()
            if guard is not None:
                return self._bisect(go_to, before, float(s))
            before = float(s)
        return h, None

    def _bisect(
        self, go_to: Callable[[float], None], low: float, high: float
    ) -> tuple[float, int | None]:
        for _ in range(60):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            go_to(middle)
            low, high = (middle, high) if self._contacts.missed_event() is None else (low, middle)
        go_to(high)
        return high, self._contacts.missed_event()

    def undecided(self) -> RunError:
        """Error of a singular position with two continuations at the present state."""
        joints = self._present.singular_joints()
        named = [j for j in self._system.mechanism.joints if j.name in joints]
        links = sorted({link for j in named for link in (j.first, j.second)})
        said = ', '.join(links) or 'its links'
        return RunError(
            f'at t = {self._present.time:.9g} s the mechanism is at a singular position, where '
            f'{said} can continue in more than one way, and it is undetermined which: change a '
            'length, the start or the drive a little'
        )
