"""The integrator's state at the present instant, and functions of the system there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.clock import Base, horner
from mechanism_sim.engine.contact.problem import Instant
from mechanism_sim.engine.dense_output import floats
from mechanism_sim.engine.system import System
from mechanism_sim.numerics.kernels import kernel
from mechanism_sim.tolerances import TOLERANCES


class PresentState:
    """Free coordinates, rates, runtime parameters and time of an integrator.

    Attributes
    ----------
    base : instant from which the integrator counts time and turns
    x : free coordinates and their rates (2f,), a view of the integrator's
    state : `x`, then the states of first order, read and written as plain floats
    parameters : runtime parameters, a view of the integrator's; `pars` gives them as floats
    now : the argument of functions of the system: state, runtime parameters and time
    rows : present rows of the switches, set by `Switching`
    """

    def __init__(self, system: System, integrator: hy.taylor_adaptive_dbl, base: Base) -> None:
        self.system, self.base = system, base
        self.integrator = integrator
        self.free = len(system.free)
        self.x = integrator.state[: 2 * self.free]
        self.state = floats(integrator.state)[: system.width]
        self.parameters = integrator.pars
        self.pars = floats(self.parameters)
        self.rows: tuple[int, ...] = (0,) * len(system.switches)
        watched = len(system.guards) + 2 * len(system.gaps) + len(system.switches)
        #: largest number of outputs of ``watch`` and ``projection``
        self.seen = max(watched, 2 * self.free + len(system.equations.relation_jets))
        self.now = np.empty(system.width + len(self.pars) + 1)
        now = self._now = floats(self.now)
        self._now_state, self._now_pars = now[: system.width], now[system.width : -1]

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self.base.at(float(self.integrator.time))

    @property
    def v(self) -> Array:
        """Rates of the free coordinates (f,), a view of the integrator's."""
        rates: Array = self.x[self.free :]
        return rates

    @property
    def drive_rates(self) -> Array:
        """Rates of the drives that hold their law (p,) [rad/s]."""
        tau = self.integrator.time
        return np.array([rate_of(law, tau) for law in self.base.laws])

    def instant(self) -> Instant:
        """The present instant for an impact, which changes the integrator's own rates."""
        return Instant(self.time, self.drive_rates, self.v)

    @property
    def where(self) -> str:
        """Text for messages with the angle of the first drive."""
        for c, law in zip(self.system.prescribed, self.base.laws, strict=False):
            if c not in self.system.mechanism.displacements:
                angle = math.degrees(horner(law, self.integrator.time)) % 360.0
                return f', {c} at {angle:.6g} deg'
        return ''

    def set(self, index: Sequence[int], values: Sequence[float]) -> None:
        """Set runtime parameters."""
        for i, value in zip(index, values, strict=True):
            self.pars[i] = value

    def evaluate(
        self, function: hy.cfunc_dbl, ahead: float = 0.0, out: Array | None = None
    ) -> Array:
        """Evaluate a function of the system now, or at a linear forecast `ahead` [s]."""
        self._now_state[:], self._now_pars[:] = self.state, self.pars
        self._now[-1] = self.integrator.time + ahead
        if ahead:
            self.now[: self.free] += ahead * self.now[self.free : 2 * self.free]
        values: Array = function(self.now, outputs=out)
        return values

    def set_time(self) -> None:
        """Set the time in `now`, for functions that are called elsewhere."""
        self._now[-1] = self.integrator.time

    def project(self) -> None:
        """Bring loops and closed contacts to zero in value and rate."""
        f, system = self.free, self.system
        self.state[: 2 * f] = floats(self.evaluate(system.functions.projection))[: 2 * f]
        if system.frictional and any(self.pars[i] for i in system.parameters.closed):
            # what moved positions by a rounding turned the normals of fine clearances
            again = floats(self.evaluate(system.functions.projection))
            self.state[f : 2 * f] = again[f : 2 * f]

    def singular_joints(self, distance: float = TOLERANCES.singular.named) -> list[str]:
        """Joints with closures that depend on those before, with the roots of their distances."""
        seen = self.evaluate(self.system.functions.projection)[2 * self.free :]
        near = [joint for joint, x in zip(self._closed, seen, strict=True) if not x > distance]
        return [*dict.fromkeys(near)]

    @cached_property
    def _closed(self) -> list[str]:
        """The joint of every equation of closures, whose expressions take long to make."""
        frames = self.system.equations.frames
        return [r.name for r in self.system.relations for _ in r.values(frames)]


@kernel
def rate_of(law: Sequence[float] | Array, tau: float) -> float:
    """Rate [rad/s] of a law's polynomial at local time tau [s]."""
    rate = 0.0
    for k in range(len(law) - 1, 0, -1):
        rate = rate * tau + k * law[k]
    return float(rate)
