"""Whether a step satisfies the equations of motion all the way, where formulas may be steep.

The length of a Taylor step follows from its last coefficients. They say nothing of a formula that
turns steep farther on: ``tanh(v/0.01)`` is constant to rounding a few cm/s away from rest, and a
step that begins there would go on as if it were for ever. So the polynomials are put into the
equations (defect control: Enright 1989, ACM Trans. Math. Softw. 15:13).
"""

from __future__ import annotations

import heyoka as hy
import numpy as np

from mechanism_sim.hybrid.system import System

_PLACES = np.array([0.25, 0.5, 0.75, 1.0])  # of a step
_ROUNDING = 1e-9  # of an acceleration: what is smaller is no defect


class StepCheck:
    """Compares accelerations of a step's polynomials with those of the equations.

    Parameters
    ----------
    limit : [rad/s] change of a rate within a step that a defect may make
    """

    def __init__(self, system: System, integrator: hy.taylor_adaptive_dbl, limit: float) -> None:
        self._accelerations, self._ta = system.accelerations, integrator
        f = len(system.free)
        size = np.where(system.angular, 1.0, system.mechanism.size)
        self._limit = (limit * size)[:, None]
        self._rates = slice(f, 2 * f)
        power = np.arange(integrator.order + 1)
        self._values = _PLACES ** power[:, None]
        self._slopes = power[:, None] * _PLACES ** np.maximum(power - 1, 0)[:, None]
        self._inputs = np.empty((2 * f + len(integrator.pars) + 1, len(_PLACES)))

    def holds(self, tau: float, h: float) -> bool:
        """Whether the last step, from `tau` on and `h` long, is one of the equations' motion."""
        ta, rates, given = self._ta, self._rates, self._inputs
        scaled = ta.tc[: rates.stop] * h ** np.arange(ta.order + 1)
        given[: rates.stop] = scaled @ self._values
        given[rates.stop : -1] = ta.pars[:, None]
        given[-1] = tau + h * _PLACES
        wanted = h * self._accelerations(given)
        defect = np.abs(scaled[rates] @ self._slopes - wanted)
        return bool((defect <= self._limit + _ROUNDING * np.abs(wanted)).all())
