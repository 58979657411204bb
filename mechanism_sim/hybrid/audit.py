"""The energy balance of a run: whether gaps are kept, and where the energy went.

Both are read from the finished polynomials, independently of the event loop that made them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import RunError
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.events import Impact, Mode, StopReason
from mechanism_sim.hybrid.physics import Physics
from mechanism_sim.hybrid.system import Array
from mechanism_sim.numerics.polynomials import Nodes, double_exponential_nodes, gauss_nodes


class Rule(NamedTuple):
    """A quadrature over a segment."""

    places: Nodes
    weights: Array  #: (K,) of the duration

    def of(self, values: Array, duration: Array) -> Array:
        """Integrals (m,) over segments that last so long (m,), of values (m K,)."""
        found: Array = duration * (values.reshape(-1, len(self.weights)) @ self.weights)
        return found


def _rule(nodes: Array, weights: Array) -> Rule:
    return Rule(Nodes(tuple(nodes.tolist())), weights)


SMOOTH = _rule(*gauss_nodes(8))
"""Exact to rounding where a step is a third of the radius of convergence."""

RECOVERY = _rule(*double_exponential_nodes(20))
"""What a contact without force loses while it recovers is a power of its depth: it has no series
at the end, and no step is the shorter for it."""

_DENSE = np.linspace(0.0, 1.0, 17)
_DENSE_PLACES = Nodes(tuple(_DENSE.tolist()))
_BLOCK = 512  # segments at once, so that they stay in a processor's cache
_OPEN_BLOCK = 128  # the same where every segment is sampled densely
_ROUNDING = 1e-14  # [m] deeper than what is measured already: not worth a closer look

PULL = 1e-3
"""Pull in a contact relative to its largest force that a step's error may leave."""

_MISSING = 0.01  # of the largest term of the energy balance: more is no error of integration


@dataclass(frozen=True)
class Energy:
    """Energy balance of a run [J]; `residual` is what does not add up."""

    initial: float
    final: float
    drive_work: float
    dissipated: float

    @property
    def residual(self) -> float:
        """``final - initial - drive_work + dissipated``."""
        return self.final - self.initial - self.drive_work + self.dissipated


class Work(NamedTuple):
    """What happened to energy in m segments, impacts left out [J]."""

    drive: Array  #: (m,) done by the drives
    friction: Array  #: (m,) lost by sliding


class Audit:
    """Accumulates the energy balance of a run, batch by batch.

    Attributes
    ----------
    max_penetration : [m] deepest violation of an open gap
    max_closure_error : [m] farthest a closed gap was from zero
    drive_work, dissipated : [J] so far
    min_normal_force : [N] smallest force in following; infinite without following
    """

    def __init__(self, physics: Physics) -> None:
        self.max_penetration = 0.0
        self.max_closure_error = 0.0
        self.min_normal_force = float('inf')
        self._physics = physics
        self._largest_force = 0.0
        self._initial: float | None = None
        self._end: tuple[Motion, float] | None = None  # and what impacts make there [J]
        self.drive_work = 0.0
        self.dissipated = 0.0

    @property
    def energy(self) -> Energy | None:
        """The energy balance so far; ``None`` where forces are not known."""
        if self._initial is None or self._end is None:
            return None
        motion, made = self._end
        final = self._total(motion, len(motion) - 1, float(motion.curve.duration[-1])) + made
        return Energy(self._initial, final, self.drive_work, self.dissipated)

    def add(self, motion: Motion, impacts: Sequence[Impact]) -> Work:
        """Enter a batch of m segments and the impacts at their ends; returns their shares."""
        work = Work(np.zeros(len(motion)), np.zeros(len(motion)))
        for first in range(0, len(motion), _BLOCK):
            self._enter(motion, np.arange(first, min(first + _BLOCK, len(motion))), work)
        if len(motion) and self._physics.has_forces:
            self._balance(motion, impacts)
        if len(motion) and self._physics.clearances:
            self._check_open(motion)
        self.drive_work += float(work.drive.sum()) + sum(i.drive_work for i in impacts)
        self.dissipated += float(work.friction.sum()) + sum(i.sudden_loss for i in impacts)
        return work

    def judge(self, tolerance: float) -> None:
        """Fail if an open gap was violated by more than `tolerance` [m], or a closed one pulled.

        Or if a hundredth of the energy is missing in the balance: then steps were too long for
        what happened in them.

        Raises
        ------
        RunError
        """
        if self.max_penetration > tolerance:
            raise RunError(
                f'{StopReason.GAP_VIOLATED.value}: {self.max_penetration:.3g} m, allowed '
                f'{tolerance:.3g} m; try a smaller rtol, and report this scene'
            )
        if self.min_normal_force < -PULL * max(self._largest_force, 1e-12):
            raise RunError(
                f'{StopReason.TENSILE_CONTACT.value}: {self.min_normal_force:.3g} N; try a '
                'smaller rtol, and report this scene'
            )
        balance = self.energy
        if balance and abs(balance.residual) > _MISSING * max(
            1e-9,
            *map(abs, (balance.initial, balance.final, balance.drive_work, balance.dissipated)),
        ):
            raise RunError(
                f'{StopReason.ENERGY_UNBALANCED.value}: {balance.residual:.3g} J missing; try a '
                'smaller rtol, smoother formulas of loads, less friction, or springs with a free '
                'length or damping whose ends do not meet'
            )

    def _enter(self, motion: Motion, segments: NDArray[np.intp], work: Work) -> None:
        """Enter some of the segments, and their shares in `work`."""
        for rule, which in rules(motion, segments):
            own = segments[which]
            account = self._physics.account(motion, own, rule.places)
            self.max_closure_error = max(self.max_closure_error, account.closure_error)
            if not self._physics.has_forces:
                continue
            for share, power in zip(
                work, (account.drive_power, account.friction_power), strict=True
            ):
                share[own] = rule.of(power, motion.curve.duration[own])
            force = account.normal_force[motion.closed_at(own, rule.places)]
            self.min_normal_force = min(self.min_normal_force, float(force.min(initial=np.inf)))
            self._largest_force = max(self._largest_force, float(force.max(initial=0.0)))

    def _balance(self, motion: Motion, impacts: Sequence[Impact]) -> None:
        if self._initial is None:
            # an impact at the very start comes before the first segment
            first = [i for i in impacts if i.t <= motion.curve.start[0]]
            made = sum(i.sudden_loss - i.drive_work for i in first)
            self._initial = self._total(motion, 0, 0.0) + made
        # and one at the very end after the last
        last = [i for i in impacts if i.t > motion.curve.start[-1]]
        self._end = motion, sum(i.drive_work - i.sudden_loss for i in last)

    def _total(self, motion: Motion, segment: int, dt: float) -> float:
        """Kinetic and potential energy [J]."""
        seen = self._physics.observe(motion, np.array([segment]), np.array([dt]))
        return float(seen.kinetic_energy[0] + seen.potential_energy[0])

    def _check_open(self, motion: Motion) -> None:
        """Sample every open gap, and again more densely where a parabola foresees a violation."""
        flying = np.flatnonzero(~motion.closed.all(axis=1))
        low, doubtful, begin = 0.0, [], []
        for first in range(0, len(flying), _OPEN_BLOCK):
            segments = flying[first : first + _OPEN_BLOCK]
            gaps = self._physics.open_gaps(motion, segments, _DENSE_PLACES)
            low = min(low, float(gaps.min()))
            foreseen = _vertices(gaps.reshape(len(gaps), len(segments), -1)).min(axis=0)
            deep = np.flatnonzero(foreseen.min(axis=1) < low - _ROUNDING)
            doubtful.append(segments[deep])
            begin.append(_DENSE[foreseen[deep].argmin(axis=1)])
        if any(map(len, doubtful)):
            segments, step = np.concatenate(doubtful), _DENSE[2] - _DENSE[0]
            places = np.concatenate(begin)[:, None] + step * _DENSE
            dt = motion.curve.duration[segments, None] * places
            low = min(low, float(self._physics.open_gaps(motion, segments, dt).min()))
        self.max_penetration = max(self.max_penetration, -low)


def rules(motion: Motion, segments: NDArray[np.intp]) -> Iterator[tuple[Rule, NDArray[np.intp]]]:
    """Quadratures, and which of the segments each is for."""
    recovers = (motion.modes[segments] == Mode.RECOVERING).any(axis=1)
    for rule, which in ((SMOOTH, ~recovers), (RECOVERY, recovers)):
        if which.any():
            yield rule, np.flatnonzero(which)


def _vertices(samples: Array) -> Array:
    """Lowest values of the parabolas through three neighbouring samples of the last axis."""
    left, middle, right = samples[..., :-2], samples[..., 1:-1], samples[..., 2:]
    with np.errstate(invalid='ignore'):  # a closed gap counts as infinite
        bend = left - 2.0 * middle + right
        slope = 0.5 * (right - left)
        inside = (bend > 0.0) & (np.abs(slope) <= bend)
        vertex = middle - 0.5 * slope**2 / np.where(inside, bend, 1.0)
    return np.where(inside, vertex, middle)
