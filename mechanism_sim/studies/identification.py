"""Parameters of a machine from signals that were measured on it.

[SB] 9.1 asks for what this answers: its simulation and its experiment differed thirtyfold, because
restitution and friction of the bearing were not known. As long as runs can be repeated, their
signals are compared sample by sample (`gauss_newton`). Where a rattling machine is chaotic from
its start on, they are compared by `features`:

1. The experiment is simulated with parameters spread evenly over a box (Sobol's sequence), each
   time with the scene's whole measurement chain and other noise.
2. A regression says which parameters belong to which features (P. Fearnhead and D. Prangle,
   Constructing summary statistics for approximate Bayesian computation, J. R. Stat. Soc. B 74
   (2012) 419); on the features of the measured signal it gives an estimate and its error, as it
   shows on simulations left out of it.
3. Around the estimate the box is drawn closer, so that it keeps all that is likely, and filled
   with new simulations (truncated prior: B. K. Miller et al., Truncated marginal neural ratio
   estimation, NeurIPS 2021), and so on. If the signal is then like no simulation in the box, the
   box has lost the truth, and what was known before holds.

The error contains chaos, noise, and jumps between responses that exist side by side, because the
simulations do. It does not contain what no simulation has: `Result.likeness` says whether the
signal is like any of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from scipy.stats import qmc

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.numerics.kernel_regression import KernelRegression
from mechanism_sim.results.measured import Measured, SensorRecord
from mechanism_sim.studies.gauss_newton import LEVEL, LeastSquares
from mechanism_sim.studies.parameters import Parameter
from mechanism_sim.studies.runs import Call, FinishedRows, Row, Show, Workers, has_failed

ROUNDS = (128, 48, 48, 48)
"""Simulations of each round; those of earlier rounds that lie in the box serve again."""
METHODS = _GAUSS_NEWTON, _REGRESSION = 'gauss-newton', 'regression'
_UNLIKE = 0.01  # share of the simulations
_KEPT = 0.99  # share of the probability inside a reduced box
_MARGIN = 1.6  # width of the box over that of this share
_NEAREST = 40  # least number of simulations for an error estimate
_MOST_FAILED = 0.25
_BESIDE = 0.5  # [rad] around whole turns
_LOST = 0.05  # likeness below which a box seems not to hold the truth any more


@dataclass(frozen=True)
class IdentifiedParameter:
    """A parameter that was looked for."""

    parameter: Parameter
    value: float  #: median of what it may be
    #: limits; all parameters together are within theirs with 95 % (Bonferroni)
    low: float
    high: float
    #: of the width that was allowed, on the parameter's scale, that the interval still has; nearly
    #: 1 of a parameter without effect on the signal
    share: float

    @property
    def identified(self) -> bool:
        """True if the signal narrows its range to less than half."""
        return self.share < 0.5


@dataclass(frozen=True)
class Residual:
    """The rest of a signal less that of a run with the values found."""

    #: name and unit of the signal
    name: str
    unit: str
    rms: float  #: root mean square, in `unit`
    share: float  #: `rms` over that of the signal about its mean, in the same window
    offset: float = 0.0  #: mean of the rest

    @property
    def turns(self) -> int:
        """Whole turns by which an angle is beside that of the run, and nothing else."""
        turns = round(self.offset / (2.0 * math.pi)) if self.unit == 'rad' else 0
        rest = math.hypot(self.offset - 2.0 * math.pi * turns, math.sqrt(
            max(0.0, self.rms**2 - self.offset**2)))  # fmt: skip
        return turns if rest < _BESIDE else 0


@dataclass(frozen=True, eq=False)
class Result:
    """The outcome."""

    estimates: tuple[IdentifiedParameter, ...]  #: in the order of the parameters
    correlation: Array  #: (k, k) of their errors
    #: numbers of runs
    simulations: int
    failed: int
    #: how far the signal, or its features by regression, are from those of a simulation with the
    #: values found, in standard deviations of the noise (root mean square); not a number where
    #: nobody says what the noise is
    misfit: float
    #: share of the simulations of the last round that are as far from what they should be; if it
    #: is nearly 0, the scene or its chain is not that of the measurement
    likeness: float
    #: chosen method, and the reason
    method: str = _REGRESSION
    reason: str = ''
    window: float = math.inf  #: duration of the compared part of the signals [s]
    residuals: tuple[Residual, ...] = ()  #: residuals of each signal, by Gauss-Newton

    @property
    def plausible(self) -> bool:
        """False if hardly any simulation is as far from what is expected as the signal is.

        Or if runs follow so little of it that a value stays open: others may be wrong then.
        """
        return self.likeness >= _UNLIKE


@dataclass(eq=False)
class Design:
    """Simulations of all rounds: parameters on their scales (n, k), features (n, p)."""

    places: Array
    features: Array

    def select(self, low: Array, high: Array) -> Design:
        """Simulations within a box."""
        inside = ((self.places >= low) & (self.places <= high)).all(axis=1)
        return Design(self.places[inside], self.features[inside])

    def join(self, other: Design) -> Design:
        """Simulations of both designs."""
        return Design(
            np.concatenate([self.places, other.places]),
            np.concatenate([self.features, other.features]),
        )


def identify(
    measurements: Sequence[Measured],
    parameters: Sequence[Parameter],
    method: str | None = None,
    seed: int = 0,
    rounds: Sequence[int] = ROUNDS,
    workers: Workers | None = None,
    show: Show | None = None,
) -> Result:
    """Values of parameters with which a machine gives the signals that were measured.

    Parameters
    ----------
    method : one of `METHODS`; without, Gauss-Newton if runs follow the signals, else regression
    seed : seed of the random numbers; equal seeds give equal values
    rounds, workers : simulations by round, and workers, of the regression
    """
    sensors = [m for m in measurements if isinstance(m, SensorRecord)]
    if method == _REGRESSION and len(sensors) < len(measurements):
        raise InputError(f'--method {_REGRESSION} reads sensors of the scene, no quantities')
    reason = ''
    if method != _REGRESSION:
        try:
            found = _by_least_squares(measurements, parameters, seed)
        except (InputError, RunError) as error:
            if method or len(sensors) < len(measurements):
                raise
            reason = f'Gauss-Newton does not apply: {error}'
        else:
            if method or found.plausible or len(sensors) < len(measurements):
                return found
            reason = f'no run follows the signal far enough, but {found.window:.3g} s'
            try:
                _check_features(sensors)
            except InputError as error:  # the present estimate is the best possible
                return replace(found, reason=f'{found.reason}; no regression: {error}')
    try:
        _check_features(sensors)
    except InputError as error:
        raise InputError(f'{reason}; {error}' if reason else str(error)) from None
    return replace(
        Identification(sensors, parameters, seed, workers, show).find(rounds), reason=reason
    )


def _check_features(sensors: Sequence[SensorRecord]) -> None:
    for m in sensors:
        m.check_features()


def _by_least_squares(
    measurements: Sequence[Measured], parameters: Sequence[Parameter], seed: int
) -> Result:
    """The result of Gauss-Newton steps; of noise by what is left."""
    noises = {f'sensors.{m.name}.noise.rms' for m in measurements}
    moved = [p for p in parameters if p.path not in noises]
    if not moved:
        raise InputError('only noise is to be found')
    search = LeastSquares(measurements, moved, seed)
    fit = search.find()
    widths = dict(zip(moved, fit.widths(1.0 - (1.0 - LEVEL) * len(moved) / len(parameters)),
                      strict=True))  # fmt: skip
    places = dict(zip(moved, fit.place, strict=True))
    estimates = []
    for p in parameters:
        if p in widths:
            half = 0.5 * widths[p] if widths[p] < 1.0 else 1.0  # if undetermined, all
            ends = places[p] - half, places[p], places[p] + half
            shares = np.clip(ends, 0.0, 1.0).tolist()
            low, value, high = map(p.at, shares)
        else:
            k = [m.name for m in measurements].index(p.path.split('.')[1])
            r, memory = fit.residuals[k], fit.memories[k]
            n, tail = len(r) / memory, (1.0 - LEVEL) / (2.0 * len(parameters))
            quantiles = scipy.stats.chi2.isf([tail, 0.5, 1.0 - tail], n)
            total = float(r @ r) / memory
            low, value, high = (min(max(math.sqrt(total / q), p.low), p.high) for q in quantiles)
        share = (p.to_scale(high) - p.to_scale(low)) / (p.to_scale(p.high) - p.to_scale(p.low))
        estimates.append(IdentifiedParameter(p, value, low, high, share))
    known = [
        float(r @ r) / len(r) / m.noise**2
        for m, r in zip(measurements, fit.residuals, strict=True)
        if m.noise and f'sensors.{m.name}.noise.rms' not in {p.path for p in parameters}
    ]
    covariance = fit.covariance()
    spread = np.sqrt(covariance.diagonal())
    correlation = np.eye(len(parameters))
    index = [k for k, p in enumerate(parameters) if p in widths]
    correlation[np.ix_(index, index)] = covariance / np.outer(spread, spread)
    whole = max(float(m.times[-1] - m.times[0]) for m in measurements)
    window = fit.part * whole
    residuals = tuple(
        Residual(
            m.name,
            m.unit,
            math.sqrt(r @ r / len(r)),
            _share(r, m.samples[: len(r)]),
            float(r.mean()),
        )
        for m, r in zip(measurements, fit.residuals, strict=True)
    )
    # a short window that leaves a value open may be that of another minimum
    sure = search.explains(fit) and (fit.part >= 1.0 or all(e.identified for e in estimates))
    return Result(
        tuple(estimates), correlation, search.runs, search.failed,
        math.sqrt(sum(known) / len(known)) if known else math.nan, float(sure), _GAUSS_NEWTON,
        _reason(fit.part, window, whole, sure), window, residuals,
    )  # fmt: skip


def _share(r: Array, samples: Array) -> float:
    """Root mean square of residuals, in that of a signal about its mean."""
    own = float(np.std(samples))
    return math.sqrt(r @ r / len(r)) / own if own else math.inf


def _reason(part: float, window: float, whole: float, sure: bool) -> str:
    """Describe the compared part of the signals, and that runs follow it, only if they do."""
    if part >= 1.0:
        return 'runs follow the whole signal' if sure else 'the whole signal was compared'
    first = f'the first {window:.4g} s of {whole:.4g} s'
    return (
        f'{first}, which runs follow, say enough or all they can'
        if sure
        else (f'{first} were compared; no run follows more')
    )


class Identification:
    """A search in progress by regression.

    Parameters
    ----------
    measurements : records of a machine under one or several drives, or by several sensors
    parameters : unknown parameters
    seed : seed of sample points and noise; equal seeds give equal numbers
    workers : processes that simulate; by default this process
    show : callback with the numbers of simulations finished and failed
    """

    def __init__(
        self,
        measurements: Sequence[SensorRecord],
        parameters: Sequence[Parameter],
        seed: int = 0,
        workers: Workers | None = None,
        show: Show | None = None,
    ) -> None:
        self.measurements, self.parameters = tuple(measurements), tuple(parameters)
        self._made = FinishedRows()
        self._workers, self._show = workers or Workers(1), show
        self._random = np.random.default_rng(seed)
        self.low = np.array([p.to_scale(p.low) for p in parameters])
        self.high = np.array([p.to_scale(p.high) for p in parameters])

    def explore(self, low: Array, high: Array, count: int) -> Design:
        """Carry out `count` simulations spread over a box on the parameters' scales."""
        sobol = qmc.Sobol(len(low), rng=self._random)
        unit = sobol.random_base2(math.ceil(math.log2(count)))[:count]
        places = low + (high - low) * unit
        seeds = self._random.integers(1 << 31, size=(count, len(self.measurements)))
        # what a machine has compiled cannot be sent to another process
        bare = tuple(replace(m, machine=replace(m.machine)) for m in self.measurements)
        first = len(self._made.rows)
        tasks = [
            Call(str(first + k), _simulate, (bare, self._overrides(place), row.tolist()))
            for k, (place, row) in enumerate(zip(places, seeds, strict=True))
        ]
        rows = self._workers.do(tasks, self._made, self._show)
        mine = [rows[task.key] for task in tasks]
        reasons = [row['status'] for row in mine if has_failed(row)]
        if len(reasons) > _MOST_FAILED * count:
            raise RunError(f'{len(reasons)} of {count} simulations failed, such as: {reasons[0]}')
        kept = [k for k, row in enumerate(mine) if not has_failed(row)]
        return Design(places[kept], np.array([mine[k]['features'] for k in kept]))

    def find(self, rounds: Sequence[int] = ROUNDS) -> Result:
        """Estimates from given numbers of simulations in each round."""
        observed = np.concatenate([m.features for m in self.measurements])
        low, high = self.low, self.high
        near = everything = self.explore(low, high, rounds[0])
        fits = _fit(near)
        found = self._outcome(near, fits, observed)
        for count in rounds[1:]:
            low, high = _closer(near, fits, observed, low, high)
            everything = everything.join(self.explore(low, high, count))
            near = everything.select(low, high)
            fits = _fit(near)
            closer = self._outcome(near, fits, observed)
            if closer.likeness < _LOST <= found.likeness:
                break
            found = closer
        return replace(found, simulations=len(self._made.rows), failed=self._made.failed)

    def _outcome(self, near: Design, fits: Sequence[KernelRegression], observed: Array) -> Result:
        """Estimates by these simulations."""
        may_be = np.column_stack([fit.left_out(observed) + fit.residuals for fit in fits])
        level = 1.0 - (1.0 - LEVEL) / len(fits)
        estimates = []
        for k, (p, fit) in enumerate(zip(self.parameters, fits, strict=True)):
            limits = np.clip(fit.interval(observed, level), self.low[k], self.high[k])
            middle = float(np.clip(np.median(may_be[:, k]), *limits))
            share = float(np.ptp(limits) / (self.high[k] - self.low[k]))
            below, above = map(p.value, limits.tolist())
            estimates.append(IdentifiedParameter(p, p.value(middle), below, above, share))
        misfit, likeness = _likeness(near, fits, observed)
        correlation = np.atleast_2d(np.corrcoef(may_be.T))
        return Result(
            tuple(estimates),
            correlation,
            len(self._made.rows),
            self._made.failed,
            misfit,
            likeness,
        )

    def _overrides(self, place: Array) -> dict[str, float]:
        pairs = zip(self.parameters, place.tolist(), strict=True)
        return {p.path: p.value(x) for p, x in pairs}


def _fit(design: Design) -> list[KernelRegression]:
    return [KernelRegression(design.features, column) for column in design.places.T]


def _predict(
    design: Design, fits: Sequence[KernelRegression], observed: Array
) -> tuple[Array, Array]:
    """Predicted places of the simulations (n, k), each left out, and of the signal (k,)."""
    told = design.places - np.array([fit.residuals for fit in fits]).T
    return told, np.array([np.median(fit.left_out(observed)) for fit in fits])


def _closer(
    design: Design, fits: Sequence[KernelRegression], observed: Array, low: Array, high: Array
) -> tuple[Array, Array]:
    """The box that holds what is likely, within the one before.

    How much the features tell is another thing in another corner of the box, so the errors of
    those simulations count that seem to be nearest.
    """
    told, here = _predict(design, fits, observed)
    apart = (((told - here) / told.std(axis=0)) ** 2).sum(axis=1)
    nearest = np.argsort(apart)[: max(_NEAREST, len(told) // 3)]
    limits = np.array([fit.interval(observed, _KEPT, nearest) for fit in fits]).T
    middle, half = limits.mean(axis=0), 0.5 * _MARGIN * np.ptp(limits, axis=0)
    # where the regression points out of the box, its edge is as near as one can come
    middle = np.clip(middle, low, high)
    return np.maximum(low, middle - half), np.minimum(high, middle + half)


def _likeness(
    near: Design, fits: Sequence[KernelRegression], observed: Array
) -> tuple[float, float]:
    """Misfit of the observed features, and the share of simulations with a larger one.

    Features are a parabola of what is predicted from them, plus what scatters. Each simulation is
    treated as the measurement is: by regressions without it.
    """
    told, here = _predict(near, fits, observed)
    middle, scale = told.mean(axis=0), told.std(axis=0)

    def terms(places: Array) -> Array:
        z = (places - middle) / scale
        pairs = [z[:, i] * z[:, j] for i in range(z.shape[1]) for j in range(i + 1)]
        return np.column_stack([np.ones(len(z)), z, *pairs])

    inverse = np.linalg.pinv(terms(told))
    leverage = np.einsum('ij,ji->i', terms(told), inverse)
    off = near.features - terms(told) @ (inverse @ near.features)
    off /= np.maximum(1.0 - leverage, 1e-3)[:, None]
    spread = np.sqrt((off**2).mean(axis=0))
    spread[spread == 0.0] = math.inf
    mine = observed - terms(here[None])[0] @ (inverse @ near.features)
    misfit = float(np.sqrt(((mine / spread) ** 2).mean()))
    return misfit, float((np.sqrt(((off / spread) ** 2).mean(axis=1)) >= misfit).mean())


def _simulate(
    measurements: Sequence[SensorRecord], overrides: dict[str, float], seeds: Sequence[int]
) -> Row:
    """Features of all measurements made again with the same values."""
    pairs = zip(measurements, seeds, strict=True)
    found = [m.features_of(m.repeat(overrides, seed)) for m, seed in pairs]
    return {'features': np.concatenate(found).tolist()}
