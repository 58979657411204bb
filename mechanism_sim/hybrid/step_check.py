"""How far a step satisfies the equations of motion, where formulas may be steep.

The length of a Taylor step follows from its last coefficients. They say nothing of a formula that
turns steep farther on: ``tanh(v/0.01)`` is constant to rounding a few cm/s away from rest, a pulse
is zero before it begins, and a step would go on as if it were so for ever. So the polynomials are
put into the equations (defect control: Enright 1989, ACM Trans. Math. Softw. 15:13), at places so
close that enclosures of the formulas leave nothing to be found between them.
"""

from __future__ import annotations

import heyoka as hy
import numpy as np

from mechanism_sim.hybrid.system import WATCH_SCALE, Array, System
from mechanism_sim.numerics.enclosure import Course, Reach, reach_of
from mechanism_sim.planar.steep_loads import SteepLoads

_ROUNDING = 1e-9  # of an acceleration: what is smaller is no defect
_FALLEN = 1e-10  # of a guard: more below zero, and below its own series, it has fallen unseen
_NEAR = 1e-12  # of a guard, times the share of a step: less changes no event
_FELT = 1e-4  # of the limit: a change of a rate that nothing needs to find


class StepCheck:
    """Compares accelerations and guards of a step's polynomials with those of the equations.

    Parameters
    ----------
    steep : the loads that are enclosed between the places that are compared
    limit : [rad/s] change of a rate within a step that a defect may make
    """

    def __init__(
        self,
        system: System,
        steep: SteepLoads,
        integrator: hy.taylor_adaptive_dbl,
        limit: float,
    ) -> None:
        self._system, self._steep, self._ta = system, steep, integrator
        size = np.where(system.angular, 1.0, system.mechanism.size)
        self._limit = (limit * size)[:, None]
        self._scales = _FELT * limit * steep.inertia
        self._power = np.arange(integrator.order + 1)
        f, m = len(system.free), len(system.guards)
        self._rates, self._watch = slice(f, 2 * f), slice(2 * f + 1, 2 * f + 1 + m)
        self._guards = m
        self._turns = [system.outside_index[system.outside.index(name)] for name in steep.outside]
        self._symbols = [i for index in system.switch_index for i in index]

    def reach(self, time: float, tau: float, h: float) -> Reach:
        """How far the last step is one of the equations' motion, as a share of it.

        Parameters
        ----------
        time : [s] at the local time zero
        tau, h : [s] local time at the start of the step, and its length
        """
        ta, pars, steep = self._ta, self._ta.pars, self._steep
        every = ta.tc * h**self._power
        course = Course(
            self._moving(every, time + tau, tau, h),
            h,
            steep.fixed(pars[self._turns], pars[self._symbols]),
            pars,
        )

        def defect(places: Array, _: Array) -> Array:
            return self._defect(every, tau, h, places)

        guards = np.full(steep.enclosure.guards, _NEAR * h)
        return reach_of(steep.enclosure, course, np.append(self._scales, guards), defect)

    def _defect(self, series: Array, tau: float, h: float, places: Array) -> Array:
        """How far at places (N,) of a step the equations are off its series, of what is allowed.

        Without limit where a guard has fallen unseen.
        """
        system, ta, power = self._system, self._ta, self._power
        count, f = len(places), self._rates.start
        powers = places ** power[:, None]
        given = np.empty((2 * f + len(ta.pars) + 1, count))
        given[: 2 * f] = series[: 2 * f] @ powers
        given[2 * f : -1] = ta.pars[:, None]
        given[-1] = tau + h * places
        slopes = (series[:, 1:] * power[1:]) @ powers[:-1]
        wanted = h * system.accelerations(given)
        allowed = self._limit + _ROUNDING * np.abs(wanted)
        found = (np.abs(slopes[self._rates] - wanted) / allowed).max(axis=0)
        if self._guards:
            guards = system.watch(given)[: self._guards]
            foretold = slopes[self._watch] / (h * WATCH_SCALE)
            fell = (guards < np.minimum(foretold, 0.0) - _FALLEN).any(axis=0)
            found[fell] = np.inf
        return np.asarray(found)

    def _moving(self, series: Array, time: float, tau: float, h: float) -> Array:
        """Series (v, n) of what loads depend on: of laws those that the integrator has, too."""
        system, f = self._system, self._rates.start
        found = np.zeros((len(self._steep.moving) + self._steep.timed, len(self._power)))
        for row, (derivative, i) in zip(found, self._steep.moving, strict=False):
            c = system.coordinates[i]
            if c in system.free:
                row[:] = series[system.free.index(c) + derivative * f]
                continue
            law = self._ta.pars[system.law_index[system.prescribed.index(c)]]
            local = np.polynomial.Polynomial(law).deriv(derivative)
            here = local(np.polynomial.Polynomial([tau, h]))
            row[: len(here.coef)] = here.coef
        if self._steep.timed:
            found[-1, :2] = time, h
        return found
