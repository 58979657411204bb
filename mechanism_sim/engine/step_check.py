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
from numpy.polynomial import polynomial

from mechanism_sim.arrays import Array
from mechanism_sim.engine.system import System
from mechanism_sim.numerics.enclosure import FEW, MotionSeries, Reach, reach_of
from mechanism_sim.numerics.polynomials import chebyshev_nodes, shift_powers
from mechanism_sim.planar.steep_loads import ResolvedLoads, SteepLoads
from mechanism_sim.tolerances import TOLERANCES

_GUARDS = TOLERANCES.guards
_ROUNDING = TOLERANCES.rounding
_STEPS = TOLERANCES.steps

_NOTHING = np.zeros(0)


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
        self._system, self._steep = system, steep
        size = np.where(system.angular, 1.0, system.mechanism.size)
        size = np.append(size, np.ones(len(system.states)))
        self._limit = (limit * size)[:, None]
        loads, guards = _STEPS.unfelt * limit * steep.inertia, steep.enclosure.guards
        self._scales = np.append(loads, np.zeros(guards))
        self._count = len(loads)
        self._resolved = ResolvedLoads(steep, chebyshev_nodes(integrator.order + 1))
        self._near = self._scales[len(loads) :]  # of guards: it grows with the step
        self._series, self._pars = integrator.tc, integrator.pars  # as they are at any time
        self._power = np.arange(integrator.order + 1)
        f, m, width = len(system.free), len(system.guards), system.width
        self._rates, self._watch = slice(f, width), slice(width + 1, width + 1 + m)
        self._guards = m
        turns = [system.parameters.outside[name] for name in steep.outside]
        self._turns = np.array(turns, int)
        self._symbols = np.array([i for index in system.parameters.switches for i in index], int)
        # rows of the series that loads depend on, and of those which laws give their coefficients
        names = [system.variables[i] for _, i in steep.moving]
        free = {c: k for k, c in enumerate(system.free)}
        free |= {x.label: 2 * f + k for k, x in enumerate(system.states)}
        scales = {x.label: x.scale for x in system.states}
        orders = [d for d, _ in steep.moving]
        known = list(zip(orders, names, strict=True))
        self._own = [k for k, (_, c) in enumerate(known) if c in free]
        self._states = np.array([free[c] + f * d for d, c in known if c in free], int)
        sizes = [scales.get(c, 1.0) for c in names if c in free]
        self._sizes = np.array(sizes).reshape(-1, 1)
        self._laws = [
            (k, d, system.parameters.laws[system.prescribed.index(c)])
            for k, (d, c) in enumerate(known)
            if c not in free
        ]
        self._few = self._powers(FEW)

    def reach(self, time: float, tau: float, h: float) -> Reach:
        """How far the last step is one of the equations' motion, as a share of it.

        Parameters
        ----------
        time : [s] at the local time zero
        tau, h : [s] local time at the start of the step, and its length
        """
        pars, steep = self._pars, self._steep
        grown = h**self._power
        fixed = _NOTHING
        if len(self._turns) or len(steep.symbols):
            fixed = np.concatenate([pars[self._turns], steep.switched(pars[self._symbols])])
        course = MotionSeries(self._moving(grown, time + tau, tau, h), h, fixed, pars)
        self._near[:] = _STEPS.guard * h

        looked: list[Array] = []

        def defect(places: Array) -> Array:
            looked.append(places)
            return self._defect(self._series[: self._watch.stop] * grown, tau, h, places)

        reach = reach_of(steep.enclosure, course, self._scales, defect)
        if not looked or looked[0] is FEW:
            return reach
        # of a load on what a drive moves the accelerations tell nothing
        share = self._resolved.longest(course, looked, reach, self._scales[: self._count] / h)
        known = 1.0 if reach.fault is None else reach.sound
        return Reach(share, share) if share < known else reach

    def _powers(self, places: Array) -> tuple[Array, Array]:
        """Matrices from coefficients to values at places (N,), and to slopes: (n, N) each."""
        powers = places ** self._power[:, None]
        return powers, self._power[:, None] * powers / places

    def _defect(self, series: Array, tau: float, h: float, places: Array) -> Array:
        """How far at places (N,) of a step the equations are off its series, of what is allowed.

        Without limit where a guard has fallen unseen.
        """
        system, width = self._system, self._rates.stop
        powers, sloping = self._few if places is FEW else self._powers(places)
        given = np.empty((width + len(self._pars) + 1, len(places)))
        given[:width] = series[:width] @ powers
        given[width:-1] = self._pars[:, None]
        given[-1] = tau + h * places
        wanted = h * system.functions.accelerations(given)
        allowed = self._limit + _ROUNDING.acceleration * np.abs(wanted)
        slopes = series[self._rates] @ sloping
        found: Array = (np.abs(slopes - wanted) / allowed).max(axis=0)
        if self._guards:
            guards = system.functions.watch(given)[: self._guards]
            low = guards < -_STEPS.fallen
            if low.any():
                foretold = series[self._watch] @ sloping / (h * _GUARDS.watch_scale)
                found[(low & (guards < foretold - _STEPS.fallen)).any(axis=0)] = np.inf
        return found

    def _moving(self, grown: Array, time: float, tau: float, h: float) -> Array:
        """Series (v, n) of what loads depend on: of laws those that the integrator has, too.

        Parameters
        ----------
        grown : (n,) powers of `h`
        """
        own: Array = self._series.take(self._states, axis=0) * grown
        if self._system.states:
            own *= self._sizes
        if not (self._laws or self._steep.timed):
            return own
        found = np.zeros((len(self._steep.moving) + self._steep.timed, len(grown)))
        found[self._own] = own
        for k, derivative, index in self._laws:
            law = polynomial.polyder(self._pars[index], derivative)
            local = shift_powers(law[None], np.array([tau]))[0]
            found[k, : len(local)] = local * grown[: len(local)]
        if self._steep.timed:
            found[-1, :2] = time, h
        return found
