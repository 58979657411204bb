"""A loose gear between the flanks of one that swings: its motion from impact to impact is exact.

K. Karagiannis and F. Pfeiffer, Nonlinear Dynamics 2 (1991) 367; S. L. T. de Souza and I. L.
Caldas, Chaos, Solitons and Fractals 19 (2004) 171. Along the flanks the driving gear moves by
``s = A sin(w t)``, and the loose one slows down: ``x = x0 + v0 (1 - exp(-b t))/b``. It strikes
where ``x - s`` is half of the backlash to either side; an impact takes changes by its saltation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy

STROKE, HALF, MASS, DRAG = 0.01, 0.008, 0.5, 0.4  # [m], [m], [kg], [N s/m]

RATTLE = f"""
title: A loose gear, along the flanks of the one that drives it
mechanism: linkage
gravity: [0, 0]
links:
  crank: {{length: {STROKE}, mass: 1, cog: 0, inertia: 1}}
  driver: {{mass: 1, points: {{middle: [0, 0]}}}}
  gear: {{mass: {MASS}}}
joints:
  shaft: {{revolute: [ground, crank]}}
  guide: {{prismatic: [ground, driver], axis: 90 deg}}
  yoke: {{slot: [crank.end, driver], axis: 0 deg}}
  flanks: {{prismatic: [driver, gear], axis: 90 deg,
    stops: {{lower: -{HALF}, upper: {HALF}, restitution: RESTITUTION}}}}
springs:
  drag: {{between: [ground, gear], stiffness: 0 N/m, damping: {DRAG} N s/m, free_length: 0}}
drive: {{coordinate: crank, speed: SPEED}}
initial: {{position: {{gear: 0.001}}, velocity: {{gear: 0.02}}}}
"""


def rattle(speed: float, e: float) -> str:
    """The scene at a speed of the crank [rad/s]."""
    return RATTLE.replace('SPEED', repr(speed)).replace('RESTITUTION', repr(e))


class Flight(NamedTuple):
    """A state: time [s], position and rate of the gear [m, m/s], and its matrix (2, 2)."""

    t: float
    x: float
    v: float
    J: np.ndarray


class ExactRattle:
    """The motion from impact to impact, with what becomes of small changes."""

    def __init__(self, speed: float, e: float) -> None:
        self.w, self.e, self.b = speed, e, DRAG / MASS
        self.impacts = 0
        driver = STROKE * speed
        self.now = Flight(0.0, 0.001, 0.02 + driver, np.eye(2))

    def _flown(self, h: float) -> tuple[float, float]:
        left = math.exp(-self.b * h)
        return self.now.x + self.now.v * (1.0 - left) / self.b, self.now.v * left

    def _off(self, h: float) -> float:
        return self._flown(h)[0] - STROKE * math.sin(self.w * (self.now.t + h))

    def to(self, t: float) -> np.ndarray:
        """Go on to a time; the matrix since the last call."""
        while (h := self._next(t - self.now.t)) is not None:
            self._strike(h)
        self._fly(t - self.now.t)
        J, self.now = self.now.J, self.now._replace(J=np.eye(2))
        return J

    def _fly(self, h: float) -> None:
        left = math.exp(-self.b * h)
        x, v = self._flown(h)
        flow = np.array([[1.0, (1.0 - left) / self.b], [0.0, left]])
        self.now = Flight(self.now.t + h, x, v, flow @ self.now.J)

    def _next(self, most: float) -> float | None:
        """Time of the next impact, if within a time."""
        step = 0.002 / self.w
        h = 1e-9 / self.w  # away from the flank that it has just left
        while h < most:
            on = min(h + step, most)
            if abs(self._off(on)) > HALF:
                return float(
                    scipy.optimize.brentq(lambda z: abs(self._off(z)) - HALF, h, on, xtol=1e-16)
                )
            h = on
        return None

    def _strike(self, h: float) -> None:
        self._fly(h)
        t, x, v, J = self.now
        wall = STROKE * self.w * math.cos(self.w * t)
        pull = -STROKE * self.w**2 * math.sin(self.w * t)  # of the wall
        u, after = v - wall, wall - self.e * (v - wall)
        # the instant moves by -dx/u, in which both motions and the wall's go on
        turned = (1.0 + self.e) * pull + self.b * (after + self.e * v)
        S = np.array([[-self.e, 0.0], [-turned / u, -self.e]])
        self.now = Flight(t, x, after, S @ J)
        self.impacts += 1

    def growths(self, turns: int) -> np.ndarray:
        """Logarithms (turns, 2) of how directions grow in each turn; rates are over w."""
        Q, found, scale = np.eye(2), [], np.array([1.0, self.w])
        T = 2.0 * math.pi / self.w
        for k in range(turns):
            J = self.to((k + 1) * T) * scale / scale[:, None]
            Q, R = np.linalg.qr(J @ Q)
            found.append(np.log(np.abs(np.diag(R))))
        return np.array(found)
