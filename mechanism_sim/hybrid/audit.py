"""The books of a run: are gaps kept, and where did the energy go?

Both are read from the finished polynomials, independently of the event loop that made them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import RunError
from mechanism_sim.hybrid.events import Impact, StopReason
from mechanism_sim.hybrid.system import Array, Observation, System
from mechanism_sim.hybrid.tape import Motion

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_DENSE = np.linspace(0.0, 1.0, 33)
_VERY_DENSE = np.linspace(0.0, 1.0, 4097)


@dataclass(frozen=True)
class Energy:
    """Energy books of a run [J]; `residual` is what does not add up."""

    initial: float
    final: float
    drive_work: float
    dissipated: float

    @property
    def residual(self) -> float:
        """``final - initial - drive_work + dissipated``."""
        return self.final - self.initial - self.drive_work + self.dissipated


class Audit:
    """Accumulates the books of a run, batch by batch.

    Attributes
    ----------
    max_penetration : [m] deepest violation of an open gap
    max_closure_error : [m] farthest a closed gap was from zero
    min_normal_force : [N] smallest force in following; infinite without following
    """

    def __init__(self, system: System) -> None:
        self.max_penetration = 0.0
        self.max_closure_error = 0.0
        self.min_normal_force = float('inf')
        self._system = system
        self._initial: float | None = None
        self._final = 0.0
        self._drive_work = 0.0
        self._dissipated = 0.0

    @property
    def energy(self) -> Energy:
        """The energy books so far."""
        return Energy(self._initial or 0.0, self._final, self._drive_work, self._dissipated)

    def add(self, motion: Motion, impacts: list[Impact]) -> Array:
        """Enter a batch of m segments and the impacts at their ends.

        Returns
        -------
        (m,) the drive's work in each segment [J], without impulses

        Raises
        ------
        RunError
            If a gap was violated by more than rounding can explain.
        """
        work = np.zeros(len(motion))
        if len(motion):
            segments, dt = _grid(motion, np.arange(len(motion)), _NODES)
            observed = observe(self._system, motion, segments, dt)
            power = (observed.drive_torque * self._prescribed_rates(motion, segments, dt)).sum(0)
            work = motion.curve.duration * (power.reshape(-1, len(_NODES)) @ _WEIGHTS)
            self._balance(motion)
            shut = motion.closed[segments].T
            self._check_closed(observed.gap[shut], observed.normal_force[shut])
            self._check_open(motion)
        self._drive_work += float(work.sum()) + sum(i.drive_work for i in impacts)
        self._dissipated += sum(i.energy_loss for i in impacts)
        return work

    def _prescribed_rates(self, motion: Motion, segments: NDArray[np.intp], dt: Array) -> Array:
        rows = [self._system.coordinates.index(c) for c in self._system.prescribed]
        return motion.curve.at(segments, dt, 1).T[rows]

    def _balance(self, motion: Motion) -> None:
        ends = np.array([0, len(motion) - 1])
        observed = observe(
            self._system, motion, ends, np.array([0.0, motion.curve.duration[-1]])
        )
        total = observed.kinetic_energy + observed.potential_energy
        if self._initial is None:
            self._initial = float(total[0])
        self._final = float(total[1])

    def _check_closed(self, gap: Array, force: Array) -> None:
        if gap.size:
            self.max_closure_error = max(self.max_closure_error, float(np.abs(gap).max()))
            self.min_normal_force = min(self.min_normal_force, float(force.min()))

    def _check_open(self, motion: Motion) -> None:
        """Sample every open gap densely, and very densely where it may have been violated."""
        flying = np.flatnonzero(~motion.closed.all(axis=1))
        if not flying.size:
            return
        predicted = _lowest(self._sampled_gaps(motion, flying, _DENSE))
        predicted[motion.closed[flying].T] = np.inf
        doubtful = flying[predicted.min(axis=0) < 0.0]
        low = predicted.min()
        if doubtful.size:
            sampled = self._sampled_gaps(motion, doubtful, _VERY_DENSE).min(axis=-1)
            sampled[motion.closed[doubtful].T] = np.inf
            low = sampled.min()
        self.max_penetration = max(self.max_penetration, float(-low))

    def _sampled_gaps(self, motion: Motion, chosen: NDArray[np.intp], nodes: Array) -> Array:
        segments, dt = _grid(motion, chosen, nodes)
        gaps = self._system.gap_values(motion.curve.at(segments, dt).T)
        return gaps.reshape(len(self._system.gaps), len(chosen), len(nodes))

    def judge(self, rtol: float) -> None:
        """Fail if a gap was violated, or a closed one pulled, beyond the tolerance.

        Raises
        ------
        RunError
        """
        size = self._system.mechanism.size
        allowed = max(1e3 * rtol, 1e-12) * size
        if self.max_penetration > allowed:
            raise RunError(
                f'{StopReason.GAP_VIOLATED.value}: {self.max_penetration:.3g} m, allowed '
                f'{allowed:.3g} m; report this scene'
            )


def observe(system: System, motion: Motion, segments: NDArray[np.intp], dt: Array) -> Observation:
    """What follows from the motion at times `dt` (N,) after the start of `segments` (N,)."""
    rows = [system.coordinates.index(c) for c in system.prescribed]
    curve = motion.curve
    return system.observe(
        curve.at(segments, dt).T,
        curve.at(segments, dt, 1).T,
        curve.at(segments, dt, 2).T[rows],
        motion.closed[segments].T.astype(float),
    )


def _grid(
    motion: Motion, chosen: NDArray[np.intp], nodes: Array
) -> tuple[NDArray[np.intp], Array]:
    """Segment indices and times at `nodes` (on [0, 1]) of every chosen segment."""
    return np.repeat(chosen, len(nodes)), (motion.curve.duration[chosen, None] * nodes).ravel()


def _lowest(samples: Array) -> Array:
    """Minimum over the last axis of equidistant samples, foreseen by parabolas."""
    left, middle, right = samples[..., :-2], samples[..., 1:-1], samples[..., 2:]
    bend = left - 2.0 * middle + right
    slope = 0.5 * (right - left)
    inside = (bend > 0.0) & (np.abs(slope) <= bend)
    vertex = middle - 0.5 * slope**2 / np.where(inside, bend, 1.0)
    return np.asarray(np.minimum(np.where(inside, vertex, middle).min(-1), samples.min(-1)))
