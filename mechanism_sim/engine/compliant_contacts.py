"""Touches of compliant contacts, read from the finished polynomials of the motion."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebroots, chebval

from mechanism_sim.arrays import Array, IndexArray, some
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.events import Impact, Mode
from mechanism_sim.engine.observer import Observer
from mechanism_sim.engine.physics import DynamicPhysics
from mechanism_sim.engine.system import System
from mechanism_sim.numerics.polynomials import chebyshev_coefficients, chebyshev_nodes
from mechanism_sim.numerics.quadrature import Assumptions, integrate, parts_of
from mechanism_sim.tolerances import TOLERANCES

_COUNT = 16  # nodes in a segment, whose terms fall by a factor of ten and more
_NODES = chebyshev_nodes(_COUNT)
_TO_SERIES = chebyshev_coefficients(np.eye(_COUNT))
# integrals over [0, 1] of the Chebyshev polynomials: Fejer's quadrature
_WEIGHTS = np.array([0.0 if k % 2 else 1.0 / (1.0 - k * k) for k in range(_COUNT)])


class OngoingTouch(NamedTuple):
    """A touch in progress, up to the present; without one, `begin` is infinite."""

    begin: float = math.inf  #: [s]; minus infinity if closed from the start of the run
    approach: float = 0.0  #: closing speed at the beginning [m/s]
    angle: float = 0.0  #: [rad] of the normal at the beginning
    normal: float = 0.0  #: normal impulse so far [N s]
    tangential: float = 0.0  #: tangential impulse so far [N s]
    loss: float = 0.0  #: dissipated energy so far [J]
    peak: float = 0.0  #: largest normal force so far [N]


class Touches:
    """Gathers the touches of a run, batch by batch; independent of the batches' lengths.

    Attributes
    ----------
    present : touch in progress of every gap
    """

    def __init__(self, system: System) -> None:
        self._system = system
        self._physics = DynamicPhysics(Observer(system))
        self.restart()

    def restart(self) -> None:
        """Discard touches in progress; contacts closed next count as closed from the start."""
        self.present: tuple[OngoingTouch, ...] = (OngoingTouch(-math.inf),) * len(
            self._system.gaps
        )

    def add(self, motion: Motion) -> list[Impact]:
        """Add the next segments; returns the touches that end within them."""
        self.present, found = self.follow(motion)
        return found

    def follow(self, motion: Motion) -> tuple[tuple[OngoingTouch, ...], list[Impact]]:
        """Touches in progress at the end of the next segments, and those that end within."""
        present, found = [], []
        for gap, touch in enumerate(self.present):
            last, ended = self._follow(gap, touch, motion)
            present.append(last)
            found += ended
        return tuple(present), sorted(found, key=lambda i: i.t)

    def _follow(
        self, gap: int, touch: OngoingTouch, motion: Motion
    ) -> tuple[OngoingTouch, list[Impact]]:
        closed = motion.closed[:, gap]
        inside = np.flatnonzero(closed)
        shares = self._shares(gap, motion, inside) if len(inside) else np.zeros((4, 0))
        found, k = [], 0
        edges = [0, *(np.flatnonzero(np.diff(closed)) + 1).tolist(), len(closed)]
        for first, end in pairwise(edges):
            if first == end:
                continue
            if not closed[first]:
                if math.isfinite(touch.begin):
                    found.append(self._ended(gap, touch, motion, first))
                touch = OngoingTouch()
                continue
            if touch.begin == math.inf:
                rate, angle = self._edge(gap, motion, first)
                touch = OngoingTouch(float(motion.curve.start[first]), -rate, angle)
            count = end - first
            p, q, loss, peak = shares[:, k : k + count].tolist()
            k += count
            if touch.begin > -math.inf:
                for i in range(count):  # one by one, so that batches do not show
                    touch = touch._replace(
                        normal=touch.normal + p[i],
                        tangential=touch.tangential + q[i],
                        loss=touch.loss + loss[i],
                        peak=max(touch.peak, peak[i]),
                    )
        return touch, found

    def _edge(self, gap: int, motion: Motion, segment: int) -> tuple[float, float]:
        """Rate [m/s] of the gap where a segment begins, and the angle [rad] of its normal."""
        seen = self._physics.touch(motion, np.array([segment]), np.zeros(1))
        return float(seen.rate[gap, 0]), float(seen.normal_angle[gap, 0])

    def _ended(self, gap: int, touch: OngoingTouch, motion: Motion, segment: int) -> Impact:
        """The completed touch that ends at the start of `segment`."""
        t = float(motion.curve.start[segment])
        return Impact(
            t=t,
            joint=self._system.gaps[gap].name,
            normal_angle=touch.angle,
            approach_speed=touch.approach,
            rebound_speed=max(0.0, self._edge(gap, motion, segment)[0]),
            normal_impulse=touch.normal,
            tangential_impulse=touch.tangential,
            energy_loss=touch.loss,
            drive_impulse=0.0,
            drive_work=0.0,
            ends_chatter=False,
            duration=t - touch.begin,
            peak_force=touch.peak,
        )

    def _shares(self, gap: int, motion: Motion, segments: IndexArray) -> Array:
        """Impulses [N s], loss [J] and largest force [N] in segments: (4, N)."""
        durations = motion.curve.duration[segments]
        places = np.outer(durations, _NODES).ravel()
        seen = self._physics.touch(motion, np.repeat(segments, _COUNT), places)
        force, friction, loss = (
            x[gap].reshape(-1, _COUNT) for x in (seen.normal_force, seen.friction_force, seen.loss)
        )
        series = _summed(np.array([force, friction, loss]), _TO_SERIES)
        p, q, lost = durations * _summed(series, _WEIGHTS[:, None])[..., 0]
        recovers = np.flatnonzero(motion.modes[segments, gap] == Mode.RECOVERING)
        if len(recovers):
            parts, powers = some(parts_of(motion.curve), segments[recovers]), recovers >= 0
            lost[recovers] = integrate(
                lambda k, dt: self._physics.touch(motion, k, dt).loss[[gap]],
                parts,
                powers,
                assumed=Assumptions(in_order=False),
            ).value[0]
        return np.array([p, q, lost, _peaks(series[0])])


def _summed(values: Array, weights: Array) -> Array:
    """Values (..., n) times weights (n, m), summed in order: products round by how many rows."""
    return np.asarray(sum(values[..., k, None] * row for k, row in enumerate(weights)))


def _peaks(series: Array) -> Array:
    """Largest values on [-1, 1] of Chebyshev series (N, d + 1): at an end, or at a level point."""
    orders = np.arange(series.shape[1])
    signs, squares = (-1.0) ** orders, orders**2.0
    weights = np.array([signs, np.ones(len(orders)), -signs * squares, squares]).T
    *ends, begins, falls = _summed(series, weights).T
    peaks: Array = np.maximum(*ends)
    for k in np.flatnonzero((begins > 0.0) & (falls < 0.0)):
        roots = chebroots(chebder(series[k]))
        level = roots.real[
            (np.abs(roots.imag) < TOLERANCES.contacts.real_root) & (np.abs(roots.real) <= 1.0)
        ]
        peaks[k] = max(peaks[k], np.max(chebval(level, series[k]), initial=0.0))
    return peaks
