"""The energy balance of a run: whether gaps are kept, and where the energy went.

Both are read from the finished polynomials, independently of the event loop that made them. A run
whose gaps or energy are violated fails instead of ending with a number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array, IndexArray, Mask
from mechanism_sim.engine.dense_output import Motion, instants
from mechanism_sim.engine.events import Impact, Impacts, Mode, StopReason
from mechanism_sim.engine.physics import Physics
from mechanism_sim.errors import RunError
from mechanism_sim.numerics.polynomials import Nodes, Times
from mechanism_sim.numerics.quadrature import (
    SECOND,
    SMOOTH,
    Assumptions,
    Parts,
    integrate,
    parts_of,
)
from mechanism_sim.planar.inverse_dynamics import Account
from mechanism_sim.tolerances import TOLERANCES

_AUDIT = TOLERANCES.audit
_ROUNDING = TOLERANCES.rounding

_DENSE = np.linspace(0.0, 1.0, 17)
_DENSE_PLACES = Nodes(tuple(_DENSE.tolist()))
_BLOCK = 512  # segments at once, so that they stay in a processor's cache
_OPEN_BLOCK = 128  # the same where every segment is sampled densely


@dataclass(frozen=True)
class Energy:
    """Energy balance of a run [J]; `residual` is its violation.

    Attributes
    ----------
    error : estimated quadrature error of the sum of `drive_work` and `dissipated`
    exchanged : reference of the relative residual: magnitudes of the works of drives, loads and
        friction, and of all changes of kinetic and potential energy. It does not depend on the
        height or angle chosen as zero of a potential energy
    rounding : rounding error of the energies and their sums
    """

    initial: float
    final: float
    drive_work: float
    dissipated: float
    error: float = 0.0
    exchanged: float = 0.0
    rounding: float = 0.0

    @property
    def residual(self) -> float:
        """``final - initial - drive_work + dissipated``."""
        return self.final - self.initial - self.drive_work + self.dissipated

    @property
    def share(self) -> float:
        """Residual beyond rounding as a share of `exchanged`."""
        left = max(abs(self.residual) - self.rounding, 0.0)
        return left / self.exchanged if self.exchanged else math.inf if left else 0.0

    @property
    def caveat(self) -> str:
        """A sentence if energy is missing, or works may be off by more than what is promised."""
        if self.share * self.exchanged - self.error > _AUDIT.noticed * self.exchanged:
            return (
                f'{abs(self.residual):.2g} J are missing in the balance, {self.share:.1g} of what '
                'was exchanged: steps were too long for what happened in them; try a smaller rtol'
            )
        if self.error <= _AUDIT.promised * self.exchanged + self.rounding:
            return ''
        return (
            f'work may have an error of {self.error:.2g} J: loads or forces vary faster than steps'
        )


class Work(NamedTuple):
    """Work and energies in m segments, impacts left out [J]."""

    drive: Array  #: (m,) done by the drives
    friction: Array  #: (m,) lost in joints, contacts, dampers, or taken by loads
    error: Array  #: (m,) estimated quadrature error of both together
    gross: Array  #: (m,) sum of the magnitudes of the works of drives, joints and loads


class Audit:
    """Accumulates the energy balance of a run, batch by batch.

    Attributes
    ----------
    max_penetration : [m] deepest violation of an open gap
    max_closure_error : [m] largest distance of a closed gap from zero
    drive_work, dissipated : [J] since the start of the run
    min_normal_force : [N] smallest force in a closed gap; infinite if none was closed
    """

    def __init__(self, physics: Physics) -> None:
        self.max_penetration = 0.0
        self.max_closure_error = 0.0
        self.min_normal_force = float('inf')
        self._physics = physics
        self._largest_force = 0.0
        self._longest = 0.0  # segment so far [s]
        self._pulled = '', 0.0  # gap with the smallest force, and when [s]
        # the largest so far [W]; at rest there are none but roundings, which no halving resolves
        rounding = _ROUNDING.epsilon * physics.lifting_power
        self._powers: Array = np.full(3, rounding / TOLERANCES.quadrature.negligible)
        self._exchanged = self._swing = self._error = 0.0  # [J] by powers, by energies
        # [J] largest kinetic, potential energy; reaction at ends of batches, times the size
        self._size = [0.0, 0.0, 0.0]
        self._segments = 0
        self._fastest = 0.0  # rate of any coordinate where segments begin or end [rad/s, m/s]
        self._initial: float | None = None
        self._first = Impacts()  # before the first segment
        self._end: tuple[Motion, float] | None = None  # and what impacts make there [J]
        self._final: float | None = None  # [J] there, once it has been asked for
        self.drive_work = 0.0
        self.dissipated = 0.0

    @property
    def energy(self) -> Energy | None:
        """The energy balance so far; ``None`` where forces are not known."""
        if self._initial is None or self._end is None:
            return None
        motion, made = self._end
        if self._final is None:
            self._final = self._totals(motion, [-1])[0] + made
        # every segment rounds the state that the next one begins with: there all forces do work
        size = sum(self._size) + self._physics.lifting_energy
        rounding = _ROUNDING.epsilon * size * (_AUDIT.evaluated + self._segments)
        rounding += _AUDIT.conditioned * self._size[0]
        rounding += self._size[0] * min(
            1.0, 2.0 * _AUDIT.step_error / max(self._fastest, _ROUNDING.least)
        )
        return Energy(
            self._initial,
            self._final,
            self.drive_work,
            self.dissipated,
            self._error,
            self._exchanged + self._swing,
            rounding,
        )

    def add(self, motion: Motion, impacts: Iterable[Impact]) -> Work:
        """Enter a batch of m segments and the impacts at their ends; returns their shares."""
        impacts = Impacts.of(impacts)
        look = partial(self._look, motion)
        if self._physics.has_forces:
            every = parts_of(motion.curve)
            work, self._powers = work_in(self._physics, motion, every, self._powers, look=look)
        else:
            work = Work(*np.zeros((4, len(motion))))
            for first in range(0, len(motion), _BLOCK):
                k = np.arange(first, min(first + _BLOCK, len(motion)))
                look(self._physics.account(motion, k, SMOOTH.places), k, SMOOTH.places)
        if self._physics.has_forces:
            self._balance(motion, impacts)
        if len(motion) and self._physics.clearances:
            self._check_open(motion)
        self._physics.check_directions(motion)
        by_impact = impacts.exchange
        drive, lost = by_impact.sum(axis=0).tolist()
        self.drive_work += float(work.drive.sum()) + drive
        self.dissipated += float(work.friction.sum()) + lost
        self._exchanged += float(work.gross.sum())
        self._exchanged += float(np.abs(by_impact).sum())
        self._error += float(work.error.sum())
        self._segments += len(motion)
        if len(motion):
            curve, last = motion.curve, np.array([len(motion) - 1])
            end = curve.local(last, curve.duration[-1:], 1)
            rates = (
                np.abs(curve.coefficients[:, :, 1]).max(initial=0.0),
                np.abs(end).max(initial=0.0),
            )
            self._fastest = max(self._fastest, *map(float, rates))
        return work

    def judge(self, tolerance: float) -> None:
        """Fail if an open gap was violated by more than `tolerance` [m], or a closed one pulled.

        Or if a hundredth of the energy that was exchanged is missing in the balance: then steps
        were too long for what happened in them.
        """
        if self.max_penetration > tolerance:
            raise RunError(
                f'{StopReason.GAP_VIOLATED.value}: {self.max_penetration:.3g} m, allowed '
                f'{tolerance:.3g} m; try a smaller rtol, and report this scene'
            )
        if self.min_normal_force < -_AUDIT.pull * max(self._largest_force, _AUDIT.pull_least):
            gap, t = self._pulled
            raise RunError(
                f'{StopReason.TENSILE_CONTACT.value}: {self.min_normal_force:.3g} N in {gap} at '
                f't = {t:.6g} s; try another rtol, and report this scene'
            )
        balance = self.energy
        if balance and balance.share > _AUDIT.missing:
            raise RunError(
                f'{StopReason.ENERGY_UNBALANCED.value}: {balance.residual:.3g} J remain; try a '
                'smaller rtol, smoother formulas of loads, less friction, or springs with a '
                'free length or damping whose ends do not meet'
            )

    def _look(self, motion: Motion, account: Account, segments: IndexArray, places: Nodes) -> None:
        """Enter what must be zero, what must press, and how energies vary at some nodes."""
        self.max_closure_error = max(self.max_closure_error, account.closure_error)
        if not self._physics.has_forces:
            return
        self._look_at_forces(motion, account.normal_force, segments, places)
        for k, energy in enumerate((account.kinetic_energy, account.potential_energy)):
            in_each = energy.reshape(len(segments), -1)
            swing = float(np.abs(np.diff(in_each)).sum())
            if not math.isfinite(swing):  # a singular position
                in_each = np.nan_to_num(in_each, posinf=0.0, neginf=0.0)
                swing = float(np.abs(np.diff(in_each)).sum())
            self._swing += swing
            ends = float(in_each.min(initial=0.0)), float(in_each.max(initial=0.0))
            self._size[k] = max(self._size[k], -ends[0], ends[1])

    def _look_at_forces(
        self, motion: Motion, force: Array, segments: IndexArray, places: Nodes
    ) -> None:
        """Enter the smallest and the largest force (m, N) [N] of gaps that are closed."""
        duration = motion.curve.duration[segments]
        self._longest = max(self._longest, float(duration.max(initial=0.0)))
        closed = motion.closed_at(segments, places)
        self._largest_force = max(self._largest_force, float(force[closed].max(initial=0.0)))
        lasts = np.repeat(duration > _AUDIT.pull_lasts * self._longest, len(places))
        force = np.where(closed & lasts, force, np.inf)
        least = float(force.min(initial=np.inf))
        if least < self.min_normal_force:
            gap, k = np.unravel_index(int(force.argmin()), force.shape)
            at = float(motion.curve.start[segments[k // len(places)]])
            self.min_normal_force, self._pulled = least, (self._physics.clearances[gap], at)

    def _balance(self, motion: Motion, impacts: Impacts) -> None:
        if not len(motion):  # a batch may be no more than impacts between two segments
            if self._end is None:
                self._first = Impacts.joined([self._first, impacts])
            elif impacts:
                motion, made = self._end
                self._end, self._final = (motion, made + _gain(impacts)), None
            return
        # an impact at the very end comes after the last segment
        t, start = impacts.column('t'), motion.curve.start
        last = t > start[-1]
        if not last.any() and self._ends_in_no_time(motion):
            last = t == start[-1]
        made = _gain(impacts.where(last))
        self._end, self._final = (motion, made), None
        if self._initial is None:
            # and one at the very start before the first; both ends are seen at once
            first = Impacts.joined([self._first, impacts.where(t <= start[0])])
            begun, ended = self._totals(motion, [0, -1])
            self._initial = begun - _gain(first)
            self._final = ended + made

    def _ends_in_no_time(self, motion: Motion) -> bool:
        """True if a last segment shorter than time rounds goes on without a jump of rates.

        That is so where a step happens to end at an impact, which the next one finds at once.
        """
        curve = motion.curve
        if curve.start[-1] + curve.duration[-1] > curve.start[-1]:
            return False
        if len(motion) > 1:
            before, k = curve, len(motion) - 2
        elif self._end is not None:
            before, k = self._end[0].curve, len(self._end[0]) - 1
        else:
            return True
        at = np.array([k])
        rates = before.local(at, before.duration[at], 1)[0]
        jump = np.abs(curve.coefficients[-1, :, 1] - rates).max(initial=0.0)
        return bool(jump <= _AUDIT.jump * np.abs(rates).max(initial=0.0))

    def _totals(self, motion: Motion, ends: list[int]) -> list[float]:
        """Kinetic and potential energy [J] where a motion begins (0), and where it ends (-1)."""
        k = np.array(ends)
        seen = self._physics.observe(
            motion, k % len(motion), np.where(k < 0, motion.curve.duration[-1], 0.0)
        )
        held = np.nan_to_num(np.abs(seen.reaction), posinf=0.0)  # infinite in singular positions
        self._size[2] = max(self._size[2], float(held.max(initial=0.0)) * self._physics.size)
        found: list[float] = (seen.kinetic_energy + seen.potential_energy).tolist()
        return found

    def _check_open(self, motion: Motion) -> None:
        """Sample every open gap, and more densely where a parabola predicts a violation."""
        flying = np.flatnonzero(~motion.closed.all(axis=1))
        low, doubtful, begin = 0.0, [], []
        for first in range(0, len(flying), _OPEN_BLOCK):
            segments = flying[first : first + _OPEN_BLOCK]
            gaps = self._physics.open_gaps(motion, segments, _DENSE_PLACES)
            low = min(low, float(gaps.min()))
            foreseen = _vertices(gaps.reshape(len(gaps), len(segments), -1)).min(axis=0)
            deep = np.flatnonzero(foreseen.min(axis=1) < low - _AUDIT.depth)
            doubtful.append(segments[deep])
            begin.append(_DENSE[foreseen[deep].argmin(axis=1)])
        if any(map(len, doubtful)):
            segments, step = np.concatenate(doubtful), _DENSE[2] - _DENSE[0]
            places = np.concatenate(begin)[:, None] + step * _DENSE
            dt = motion.curve.duration[segments, None] * places
            low = min(low, float(self._physics.open_gaps(motion, segments, dt).min()))
        self.max_penetration = max(self.max_penetration, -low)


def _gain(impacts: Impacts) -> float:
    """Energy [J] of a machine that impacts make, the work of drives included."""
    return float(sum((impacts.column('drive_work') - impacts.sudden_loss).tolist()))


def recovers(motion: Motion, segments: IndexArray) -> Mask:
    """Mask of segments in which a contact without force recovers: losses are powers of depth."""
    return np.asarray((motion.modes[segments] == Mode.RECOVERING).any(axis=1))


def work_in(
    physics: Physics,
    motion: Motion,
    parts: Parts,
    largest: Array | None = None,
    in_order: bool = True,
    look: Callable[[Account, IndexArray, Nodes], None] | None = None,
) -> tuple[Work, Array]:
    """Works (m,) in parts of a motion, and the largest powers (3,) so far [W].

    What steep loads take is integrated with nodes of its own: the balance would hide a load that
    is seen or missed by the same nodes as the drive that balances it.

    Parameters
    ----------
    largest, in_order : see `mechanism_sim.numerics.quadrature.integrate`
    look : function called with every account at the nodes of whole segments
    """

    def powers(k: IndexArray, dt: Times) -> Array:
        found = physics.account(motion, k, dt)
        if look and isinstance(dt, Nodes) and dt is not SECOND.places:  # looked at already
            look(found, k, dt)
        rows = [found.drive_power, found.friction_power, found.load_power]
        if not in_order:  # works far below the energy of a motion are its rounding
            whole = np.repeat(motion.curve.duration[k], instants(dt))
            moved = np.where(np.isfinite(found.kinetic_energy), found.kinetic_energy, 0.0)
            rows.append(moved / np.maximum(whole, _ROUNDING.least))
        return np.stack([x for x in rows if x is not None])

    flags, known = recovers(motion, parts.segment), np.zeros(3) if largest is None else largest
    takes, steep = physics.takes_power, physics.steep
    count = 3 if takes and not steep else 2
    kind = Assumptions(in_order, alike=True, foretold=not steep, corners=physics.corners)
    begun = known[:count] if in_order else np.zeros(count + 1)
    own = integrate(powers, parts, flags, begun, assumed=kind)
    value, error, largest = own.value[:count], own.error[:count], own.largest[:count]
    if takes and steep:
        load = integrate(
            lambda k, dt: physics.load_power(motion, k, dt)[None],
            parts,
            flags,
            known[2:],
            own.running.max(axis=0, initial=0.0),
            Assumptions(in_order, smooth=SECOND),
        )
        value, error = np.append(value, load.value, axis=0), np.append(error, load.error, axis=0)
        largest = np.append(largest, load.largest)
    gross = np.abs(value).sum(axis=0)
    work = Work(value[0], value[1:].sum(axis=0), error.sum(axis=0), gross)
    return work, largest if takes else np.append(largest, known[2:])


def _vertices(samples: Array) -> Array:
    """Lowest values of the parabolas through three neighbouring samples of the last axis."""
    left, middle, right = samples[..., :-2], samples[..., 1:-1], samples[..., 2:]
    with np.errstate(invalid='ignore'):  # a closed gap counts as infinite
        bend = left - 2.0 * middle + right
        slope = 0.5 * (right - left)
        inside = (bend > 0.0) & (np.abs(slope) <= bend)
        vertex = middle - 0.5 * slope**2 / np.where(inside, bend, 1.0)
    return np.where(inside, vertex, middle)
