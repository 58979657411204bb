"""Lyapunov exponents and horizons: how fast neighbouring motions part, by exact derivatives.

G. Benettin et al., Meccanica 15 (1980) 9: directions are carried along by the derivatives of the
motion and made orthogonal again once a turn; their growth is averaged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arguments import public
from mechanism_sim.arrays import Array
from mechanism_sim.derivatives.flow import DerivativeLimit, Flows
from mechanism_sim.engine.events import Impacts
from mechanism_sim.engine.physics import DynamicPhysics
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.batch_means import BATCHES, ratio
from mechanism_sim.results.run import Solution
from mechanism_sim.scene import Machine, Source, load_scene
from mechanism_sim.studies.periodic import PoincareMap

_DIGITS = 16.0  # digits at the start of a run
_ALIGNING = 10  # number of turns until any directions have aligned with those of fastest growth
_LOST = 64.0 * float(np.finfo(float).eps)
"""Share of the largest growth in a turn, or of 1, below which a direction is rounding."""
_WINDOW = 64  # segments, after each of which errors of the steps join those of the run so far


@dataclass(frozen=True)
class LyapunovExponents:
    """The largest exponents, in falling order.

    Attributes
    ----------
    revolutions, skipped : number of revolutions averaged, and of those before
    period : period of the drive [s]
    values : [1/s]; minus infinity where a turn leaves a direction nothing at all, because a
        contact is closed, or less than roundings tell
    half_widths : half widths of their 95 % intervals [1/s]
    """

    revolutions: int
    skipped: int
    period: float
    values: tuple[float, ...]
    half_widths: tuple[float, ...]

    @property
    def horizon(self) -> float:
        """Time [s] after which no digit of a run is that of the machine; infinite if it is stable.

        A run begins with 16 digits, and loses ``exponent / ln 10`` of them in a second. Infinite,
        too, where the interval of the exponent holds zero, so that it is not decided.
        """
        largest = self.values[0]
        grows = largest - self.half_widths[0] > 0.0
        return _DIGITS * math.log(10.0) / largest if grows else math.inf

    @property
    def undecided(self) -> bool:
        """True if the interval of the largest exponent holds zero."""
        return math.isfinite(self.values[0]) and abs(self.values[0]) <= self.half_widths[0]


@public
def lyapunov(
    scene: Source,
    revolutions: int = 200,
    skip: int = 20,
    count: int = 1,
    show: Callable[[float, int], None] | None = None,
) -> LyapunovExponents:
    """The largest Lyapunov exponents of a machine under a drive at constant speed.

    >>> import mechanism_sim as ms
    >>> found = ms.lyapunov('four_bar_clearance', revolutions=20, skip=0)
    >>> len(found.values), found.revolutions
    (1, 20)

    Parameters
    ----------
    scene : all that `load_scene` takes
    revolutions, skip : number averaged, and skipped before: those for settling, and ten more
    count : number of exponents
    show : callback with the time [s] of the run so far, and 0

    Raises
    ------
    RunError
        Where derivatives do not exist, such as at a grazing contact.
    """
    machine = load_scene(scene)
    section = PoincareMap(machine)
    most = len(section.scale)
    if not 1 <= count <= most:
        raise InputError(f'{machine.name}: it has {most} exponents, not {count}')
    if skip < 0 or revolutions < BATCHES:
        raise InputError(f'exponents need at least {BATCHES} revolutions, and skip at least 0')
    state = machine.initial_state()
    if skip:
        state, _, _ = section.map(state, skip, audited=True)
    directions = np.linalg.qr(np.random.default_rng(0).standard_normal((most, count)))[0]
    growth: Array = np.empty((revolutions, count))
    for k in range(-_ALIGNING, revolutions):
        J, state = section.growth(state, 1)
        if any(state.closed) or machine.equations.system.relations:
            # what leaves closed contacts and loops is drawn back by the equations, not the machine
            free = section.directions(state)
            J = free @ (free.T @ J)
        directions, R = np.linalg.qr(J @ directions)
        if k >= 0:
            grown, lost = np.abs(np.diag(R)), _LOST * max(1.0, float(np.linalg.norm(J, 2)))
            with np.errstate(divide='ignore'):
                growth[k] = np.log(np.where(grown > lost, grown, 0.0))
        if show:
            show((skip + k + 1) * machine.drive.period, 0)
    period = machine.drive.period
    found = []
    for column in growth.T:
        if np.isfinite(column).all():
            found.append(ratio(column, np.full(revolutions, period)))
        else:
            found.append((-math.inf, 0.0))
    values, halves = zip(*found, strict=True)
    return LyapunovExponents(revolutions, skip, period, tuple(values), tuple(halves))


@dataclass(frozen=True)
class Horizon:
    """Prediction horizon of one run: the time for which its digits hold."""

    digits: float  #: digits of the steps' accuracy
    #: that hold at the end of the run, or where it is given up; of the range of its motion
    left: float
    time: float  #: [s] from which on no digit holds; infinite if some hold to the end
    limit: DerivativeLimit | None = None  #: limit of the derivatives, if they end before


def check_horizon(machine: Machine) -> None:
    """Refuse a machine whose motion is no solution of an initial value problem."""
    if not isinstance(machine.physics, DynamicPhysics):
        raise InputError(f'{machine.name}: it has no free motion, so all of its digits hold')


def horizon(run: Solution) -> Horizon:
    """Prediction horizon: growth of tolerance-sized errors along a run by exact derivatives.

    Errors E of free coordinates and rates, over the ranges of these, go on as ``J E`` from window
    to window, and steps add theirs: ``E E' = J E E' J' + rtol^2``.
    """
    machine, curve = run.machine, run.motion.curve
    check_horizon(machine)
    flows = Flows.by_state(machine, float(curve.end))
    n, free = len(curve), flows.free
    ends = [curve.local(np.arange(n), np.zeros(n), order)[:, free] for order in (0, 1)]
    if flows.system.states:
        ends.append(run.motion.states[:, :, 0])
    ranges = np.ptp(np.concatenate(ends, axis=1), axis=0)
    scale = np.where(ranges > 0.0, ranges, 1.0)
    tolerance = max(machine.scene.solver.rtol, float(np.finfo(float).eps))
    added = tolerance * np.eye(flows.count)
    errors, size, t, limit = added, tolerance, math.inf, None
    struck = Impacts.of(run.impacts)
    begun = curve.begun_by(struck.column('t'))
    for first in range(0, n - 1, _WINDOW):
        last = min(first + _WINDOW, n - 1)  # the event that begins it belongs to this window
        end = float(curve.start[last] + curve.duration[last])
        motion = run.motion.between(float(curve.start[first]), end)
        impacts = struck.where((first < begun) & (begun <= last))
        flow = flows.along(motion, impacts, np.eye(flows.count))
        if limit := next((x for x in flow.limits if x.ends), None):
            break
        q = flow.coefficients[-1, free]
        J = np.concatenate([q[:, 0], q[:, 1], flow.states[-1, :, 0]])
        grown = np.concatenate([(J * scale / scale[:, None]) @ errors, added], axis=1)
        errors = np.asarray(np.linalg.qr(grown.T, mode='r')).T  # as long as it is wide
        size = float(np.linalg.norm(errors, 2))
        if size >= 1.0:
            t = float(curve.start[last])
            break
    return Horizon(-math.log10(tolerance), max(0.0, -math.log10(size)), t, limit)
