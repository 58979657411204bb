"""Parameters of a machine by least squares between a run and the samples of signals.

Where a run can be repeated, every sample counts: residuals are samples less those of a run at the
same instants, their derivatives by the parameters are exact (`results/derivatives.py`), and damped
Gauss-Newton steps within the ranges lead to a minimum. Three rules serve to reach the right one,
with valid confidence limits:

1. The first window is so short that residuals depend on parameters in one way over the whole
   range; it begins with the best of many values. Each window is twice as long as the one before,
   with what was found there: the same reason as for multiple shooting (H. G. Bock, 1983).
2. Chaos, or another order of impacts, shows as a block of residuals far above those before it.
   Such a window is refused, and the result of the one before holds.
3. Residuals of the last window that are not alike all along it are those of another minimum, or of
   another machine: the search begins again elsewhere, and if that is so from everywhere, the fit
   does not count as an explanation.

Limits are those of the information matrix (Fisher) with the variance of the residuals; correlated
ones count as fewer (their integrated autocorrelation). A range has the weight of the variance of a
uniform distribution, so that parameters that the signal does not determine keep their range.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from scipy.stats import qmc

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.results.derivatives import RunDerivative
from mechanism_sim.results.measured import Measured
from mechanism_sim.results.run import Piece
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene.build import rebuilt
from mechanism_sim.sensing.spectra import autocorrelation
from mechanism_sim.studies.parameters import Parameter

LEVEL = 0.95
"""Level of confidence, for all parameters together."""

_FIRST, _LONGER = 1.0 / 128.0, 2.0
"""Share of the signal in the first window, and growth of windows."""
_LEAST_LONGER = 1.15  # after refused windows: each growth factor is the root of the last
_ENOUGH = 0.04  # of a range: limits so close need no further impacts, which are expensive
_STEP = 0.1  # step of differences, in standard deviations
_BROAD, _DRAWS, _MORE = 0.3, 16, 2
"""Share of a range above which it is hardly known; number of draws, factor on it if unknown."""
_FEWEST = 16  # samples of a first window, for each parameter
_STARTS, _BEGUN = 32, 8  # number of trial values, and of those with iterations
_GROWN = 4  # number of these continued into longer windows
_TRIED = 3  # starting points in the next window around the estimate of the last
_RENEWED, _FALLS = 4, 0.9
"""Most refinements of a first fit, while its residuals fall at least to this share."""
_BLOCKS = 32  # number of blocks of a window's residuals
_SIGMAS = 6.0  # tolerance of mean squares of noise, in standard deviations
_OUTLIER = 8.0  # root mean squares that no sample of noise reaches
_LITTLE = 1e-3  # share of a signal: smaller residuals need not be white
_RANGE = 12.0  # information of a uniform distribution of width 1
_EDGE = 1e-9  # margin of bounds, as a share of the range
_STEPS = 10  # largest number in a window
_ROUGH, _SPARE = 0.5, 0.01
"""Excess of a sum of squares over the least, by the variance: in between, at the end."""
_GOOD, _LIKE = 0.1, 0.8
"""Shares of the predicted fall of squares: of an accepted step; for valid derivatives."""

_EXACT = 1e-9  # share of a signal: residual of an exact fit without noise


@dataclass(frozen=True, eq=False)
class WindowFit:
    """The least squares of a window."""

    place: Array  #: (k,) shares of the ranges of the parameters, on their scales
    part: float  #: share of every signal, from its first sample on
    #: residuals (M,) and derivatives (M, k) of each signal, in its unit
    residuals: list[Array]
    slopes: list[Array]

    @property
    def sizes(self) -> Array:
        """Root mean squares of the residuals of each signal."""
        spare = [max(1, len(r) - len(self.place) / len(self.residuals)) for r in self.residuals]
        return np.array([math.sqrt(r @ r / n) for r, n in zip(self.residuals, spare, strict=True)])

    @property
    def memories(self) -> Array:
        """Number of samples of each signal that count as one; 1 for white residuals."""
        return np.array([_memory(r) for r in self.residuals])

    @property
    def white(self) -> bool:
        """True if residuals are uncorrelated (von Neumann's ratio)."""
        return all(_is_white(r) for r in self.residuals)

    def widths(self, level: float = LEVEL) -> Array:
        """Widths (k,) of simultaneous confidence limits, as shares of the ranges."""
        count = len(self.place)
        spare = max(1.0, sum(len(r) for r in self.residuals) - count)
        sigmas = scipy.stats.t.isf((1.0 - level) / (2 * count), spare)
        return np.asarray(2.0 * sigmas * np.sqrt(self.covariance().diagonal()))

    def covariance(self) -> Array:
        """Covariance (k, k) of `place`."""
        information = _RANGE * np.eye(len(self.place))
        for slope, size, memory in zip(self.slopes, self.sizes, self.memories, strict=True):
            information += slope.T @ slope / max(size**2 * memory, 1e-300)
        return np.asarray(np.linalg.inv(information))


class LeastSquares:
    """Least squares of signals by parameters.

    Parameters
    ----------
    measurements : signals; those of one machine are of one run
    parameters : numbers of scenes, within their limits
    seed : seed of the values tried first
    """

    def __init__(
        self, measurements: Sequence[Measured], parameters: Sequence[Parameter], seed: int = 0
    ) -> None:
        self.measurements, self.parameters = tuple(measurements), tuple(parameters)
        self.low = np.array([p.to_scale(p.low) for p in parameters])
        self.width = np.array([p.to_scale(p.high) for p in parameters]) - self.low
        self.runs = self.failed = self.differences = 0
        self._seed, self._has_impacts = seed, False
        for p in parameters:
            if p.choices:
                raise InputError(f'{p.name} has values of a list, by which there is no derivative')

    def find(self) -> WindowFit:
        """Fit of the longest window that a run explains, else the best fit."""
        found: list[WindowFit] = []
        for first in self._begun():
            fit = self._settled(self._grow(first))
            if self.explains(fit):
                return fit
            found.append(fit)
        return max(found, key=lambda fit: (self._is_small(fit), fit.part, -self._cost(fit)))

    def explains(self, fit: WindowFit) -> bool:
        """True if residuals are white, within the scene's noise or small beside the signal.

        And uniform all along the window.
        """
        return self._is_small(fit) and all(
            _is_alike(r, max(m.noise, _LITTLE * float(np.std(m.samples))))
            for m, r in zip(self.measurements, fit.residuals, strict=True)
        )

    def _is_small(self, fit: WindowFit) -> bool:
        for m, r, size in zip(self.measurements, fit.residuals, fit.sizes, strict=True):
            allowed = 1.0 + _SIGMAS / math.sqrt(2.0 * len(r))
            signal = float(np.std(m.samples[: len(r)]))
            if not (_is_white(r) or size < allowed * m.noise or size < 0.3 * signal):
                return False
        return True

    def values(self, place: Array) -> list[float]:
        """Values of the parameters at shares of their ranges."""
        scaled = (self.low + self.width * place).tolist()
        return [p.value(x) for p, x in zip(self.parameters, scaled, strict=True)]

    @property
    def _scales(self) -> list[float]:
        """Initial scales of the residuals of signals."""
        return [m.noise or float(np.std(m.samples)) or 1.0 for m in self.measurements]

    def _first(self) -> float:
        fewest = min(len(m.samples) for m in self.measurements)
        return min(1.0, max(_FIRST, _FEWEST * (len(self.parameters) + 1) / fewest))

    def _begun(self) -> Iterator[WindowFit]:
        """Different fits of the first window: those with white residuals, then the best others."""
        part = self._first()
        known: list[WindowFit] = []
        others: list[WindowFit] = []
        for place in self._starts(part):
            fit = self._solve_anew(self._at(place, part))
            if any((np.abs(fit.place - x.place) < 0.5 * x.widths()).all() for x in known):
                continue
            known.append(fit)
            if not fit.white:
                others.append(fit)
            elif len(known) - len(others) <= _GROWN:
                yield fit
        yield from sorted(others, key=self._cost)[: max(0, _GROWN - len(known) + len(others))]

    def _solve_anew(self, fit: WindowFit) -> WindowFit:
        """Fit of a first window, repeated with the scales of its own residuals."""
        sizes = self._scales
        for _ in range(_RENEWED):
            fit = self._solve(fit, sizes)
            left = self._sizes(fit, [m.noise for m in self.measurements])
            if all(x > _FALLS * y for x, y in zip(left, sizes, strict=True)):
                break
            sizes = left
        return fit

    def _starts(self, part: float) -> list[Array]:
        """The best of many points, for the first window."""
        count, scales = len(self.parameters), self._scales
        spread = qmc.Sobol(count, rng=self._seed).random(_STARTS)
        places = np.concatenate([np.full((1, count), 0.5), spread])
        costs = [self._sum(self._residuals(place, part), scales) for place in places]
        if not np.isfinite(costs).any():
            raise RunError(f'none of {len(places)} runs with values in the ranges can be finished')
        return [places[k] for k in np.argsort(costs)[:_BEGUN] if math.isfinite(costs[k])]

    def _grow(self, fit: WindowFit) -> WindowFit:
        """Fit of the longest window whose residuals are like those of the ones before."""
        longer = _LONGER
        while fit.part < 1.0 and longer > _LEAST_LONGER:
            if self._has_impacts and fit.widths().max() < _ENOUGH:
                break
            sizes = self._sizes(fit, [m.noise for m in self.measurements])
            part = min(1.0, longer * fit.part)
            steps = np.minimum(1e-3, _STEP * np.sqrt(fit.covariance().diagonal()))
            found: list[WindowFit] = []
            for place, residuals in self._continuations(fit, part, sizes):
                try:
                    if found:  # from elsewhere, with the derivatives that are known
                        begun = WindowFit(place, part, residuals, found[0].slopes)
                        more = self._solve(begun, sizes, steps, found, fresh=False)
                    else:
                        more = self._solve(self._at(place, part, steps), sizes, steps)
                except RunError:
                    continue
                if any(more is x for x in found):
                    continue
                if self._follows(more, sizes, fit.white):
                    found.append(more)
                    # what is told for the first time may be told wrong, by another minimum
                    if not ((fit.widths() > _BROAD) & (more.widths() < 0.5 * fit.widths())).any():
                        break
            if found:
                fit = min(found, key=lambda x: self._sum(x.residuals, sizes))
            else:
                longer = math.sqrt(longer)
        return fit

    def _settled(self, fit: WindowFit) -> WindowFit:
        """Refined minimum, by the derivatives already computed.

        They do not cover a sample that passes to the other side of an impact: that is tried.
        """
        fit = self._solve(fit, self._sizes(fit), settle=True)
        if self._is_small(fit) and not self.explains(fit):
            sizes = self._sizes(fit)
            place, residuals = self._around(fit, fit.part, sizes)[0]
            if self._sum(residuals, sizes) < self._sum(fit.residuals, sizes):
                best = WindowFit(place, fit.part, residuals, fit.slopes)
                return self._solve(best, self._sizes(best), settle=True)
        return fit

    def _sizes(self, fit: WindowFit, noise: Sequence[float] = ()) -> list[float]:
        """Scales of residuals, at least the noise, and rounding for a signal without residual."""
        least = [_EXACT * scale for scale in self._scales]
        noise = noise or least
        return [max(one) for one in zip(fit.sizes.tolist(), least, noise, strict=True)]

    def _continuations(
        self, fit: WindowFit, part: float, sizes: Sequence[float]
    ) -> Iterator[tuple[Array, list[Array]]]:
        """Points from which a longer window is fitted: the last minimum, then the best around it.

        All but the first have residuals.

        The longer window may determine further parameters, and where one run has no derivatives,
        its neighbours do: points are drawn by the covariance.
        """
        yield fit.place, []
        yield from self._around(fit, part, sizes)[:_TRIED]

    def _around(
        self, fit: WindowFit, part: float, sizes: Sequence[float]
    ) -> list[tuple[Array, list[Array]]]:
        """Points drawn by the covariance of a fit, with residuals there, the best first."""
        random = np.random.default_rng(self._seed)
        unknown = fit.widths() > 1.0
        count = _DRAWS * (_MORE if unknown.any() else 1)
        places = random.multivariate_normal(fit.place, fit.covariance(), count, method='eigh')
        evenly = qmc.Sobol(len(fit.place), rng=self._seed).random(count)
        places = np.clip(np.where(unknown, evenly, places), 0.0, 1.0)
        residuals = [self._residuals(u, part) for u in places]
        order = np.argsort([self._sum(r, sizes) for r in residuals])
        return [(places[k], residuals[k]) for k in order]

    @staticmethod
    def _sum(residuals: Sequence[Array], sizes: Sequence[float]) -> float:
        return sum(float(r @ r) / s**2 for r, s in zip(residuals, sizes, strict=True))

    def _follows(self, fit: WindowFit, sizes: Sequence[float], white: bool) -> bool:
        """True if no block of residuals is larger than those of the windows before."""
        for r, size in zip(fit.residuals, sizes, strict=True):
            blocks = _blocks(r)
            largest = max(float(b @ b) / len(b) for b in blocks)
            allowed = 1.0 + _SIGMAS * math.sqrt(2.0 / len(blocks[-1]))
            if largest > size**2 * allowed * (1.0 if white else 4.0):
                return False
        return True

    def _at(self, place: Array, part: float, steps: Array | float = 1e-4) -> WindowFit:
        """Residuals of a run at a place, and their derivatives; `steps` as in `_slopes`."""
        place = np.clip(place, 0.0, 1.0)
        return WindowFit(place, part, *self._slopes(place, part, steps))

    def _solve(
        self,
        begun: WindowFit,
        sizes: Sequence[float],
        steps: Array | float = 1e-4,
        known: Sequence[WindowFit] = (),
        *,
        fresh: bool = True,
        settle: bool = False,
    ) -> WindowFit:
        """Least squares of a window from a place on, by damped steps within the ranges.

        Derivatives cost many runs, so those of a point serve while steps fulfil their prediction.

        Parameters
        ----------
        steps : (k,) steps of differences where there are no derivatives
        known : minima of this window: a point within the limits of one counts as that one
        fresh : True if the derivatives are those of the starting point
        settle : refine as far as these derivatives allow
        """

        def weighted(parts: Sequence[Array]) -> Array:
            return np.concatenate([r / s for r, s in zip(parts, sizes, strict=True)])

        limits = [0.5 * x.widths() for x in known]
        u, part, found, slopes = begun.place, begun.part, begun.residuals, begun.slopes
        r, damping, spare = weighted(found), 0.0, _SPARE if settle else _ROUGH
        q, upper = np.linalg.qr(weighted(slopes))
        for _ in range(_STEPS):
            for other, limit in zip(known, limits, strict=True):
                if (np.abs(u - other.place) < limit).all():
                    return other
            size = max(1.0, float(r @ r) / len(r))  # the signal may have more noise than is known
            step, promised = _bounded_step(u, upper, q.T @ r, damping)
            if promised < spare * size:
                break
            others = self._residuals(u + step, part)
            new = weighted(others)
            gain = (float(r @ r) - float(new @ new)) / promised if np.isfinite(new).all() else -1.0
            taken = gain > _GOOD
            if taken:
                u, r, found, damping = u + step, new, others, damping / 10.0
            if gain < _LIKE and not settle and (taken or not fresh):
                found, slopes = self._slopes(u, part, steps)
                r, fresh = weighted(found), True
                q, upper = np.linalg.qr(weighted(slopes))
            elif taken:
                fresh = False
            elif settle:
                break
            else:
                damping = max(10.0 * damping, 1e-3)
        return WindowFit(u, part, found, slopes)

    def _residuals(self, place: Array, part: float) -> list[Array]:
        """Residuals of each signal in a window; infinite if the run fails."""
        return self._of_runs(place, part, (), lambda m, run, t, y: m.of_run(run, t) - y)

    def _slopes(
        self, place: Array, part: float, steps: Array | float
    ) -> tuple[list[Array], list[Array]]:
        """Residuals and their derivatives by the place; differences where a run has none."""
        paths = [p.path for p in self.parameters]
        # derivative of the value by the position
        scales = [
            w * x if p.logarithmic else w
            for p, w, x in zip(self.parameters, self.width, self.values(place), strict=True)
        ]

        def both(m: Measured, run: Piece, t: Array, y: Array) -> Array:
            known: Mapping[str, RunDerivative] = run.derivatives  # type: ignore[attr-defined]
            slopes = [scale * m.slope(known[p], t) for p, scale in zip(paths, scales, strict=True)]
            return np.column_stack([m.of_run(run, t) - y, *slopes])

        found = self._of_runs(place, part, paths, both)
        if not all(np.isfinite(x).all() for x in found):
            return [x[:, 0] for x in found], self._differences(place, part, steps)
        return [x[:, 0] for x in found], [x[:, 1:] for x in found]

    def _differences(self, place: Array, part: float, steps: Array | float) -> list[Array]:
        """Derivatives by differences of runs, over the given `steps`."""
        slopes = []
        for way in np.diag(np.broadcast_to(steps, place.shape)):
            more, less = np.minimum(place + way, 1.0), np.maximum(place - way, 0.0)
            pairs = zip(self._residuals(more, part), self._residuals(less, part), strict=True)
            apart = float((more - less).sum())
            slopes.append([(a - b) / apart for a, b in pairs])
        found = [np.column_stack(columns) for columns in zip(*slopes, strict=True)]
        if not all(np.isfinite(x).all() for x in found):
            raise RunError('runs beside the values found so far cannot be finished')
        self.differences += 1
        return found

    def _of_runs(
        self,
        place: Array,
        part: float,
        paths: Sequence[str],
        take: Callable[[Measured, Piece, Array, Array], Array],
    ) -> list[Array]:
        """Values of each signal from its machine's run at a point up to the window's end."""
        given = {p.path: x for p, x in zip(self.parameters, self.values(place), strict=True)}
        times = [_until(m, part) for m in self.measurements]
        runs: dict[int, Piece | None] = {}
        found = []
        for m, t in zip(self.measurements, times, strict=True):
            key = id(m.machine)
            if key not in runs:
                end = max(
                    float(x[-1])
                    for o, x in zip(self.measurements, times, strict=True)
                    if o.machine is m.machine
                )
                runs[key] = self._run(m, given, end, paths)
            run = runs[key]
            y = m.samples[: len(t)]
            found.append(np.full(len(t), np.inf) if run is None else take(m, run, t, y))
        return found

    def _run(
        self, measured: Measured, given: dict[str, float], end: float, paths: Sequence[str]
    ) -> Piece | None:
        """A run with other values; None if it fails without a request for derivatives."""
        self.runs += 1
        name, content = measured.machine.name, measured.machine.scene.to_document()
        try:
            machine = rebuilt(name, content, given)
            # a run ends a little after the last sample, which rounding may put behind it
            run = simulate(machine, duration=end * (1.0 + 1e-9) + 1e-9, derivatives=paths)
        except (RunError, InputError):
            if paths:
                raise
            self.failed += 1
            return None
        self._has_impacts = bool(run.impacts)
        return run

    def _cost(self, fit: WindowFit) -> float:
        return float(sum((fit.sizes / self._scales) ** 2))


def _bounded_step(u: Array, upper: Array, r: Array, damping: float) -> tuple[Array, float]:
    """Step (k,) within the ranges, and the predicted decrease of the sum of squares.

    Parameters
    ----------
    upper, r : (k, k) and (k,) triangle of the derivatives, and residuals in its directions
    """
    damped = np.diag(np.sqrt(damping) * np.linalg.norm(upper, axis=0) + 1e-9)
    step = scipy.optimize.lsq_linear(
        np.vstack([upper, damped]), np.concatenate([-r, np.zeros(len(u))]),
        (-u - _EDGE, 1.0 - u + _EDGE),
    ).x  # fmt: skip
    step = np.clip(u + step, 0.0, 1.0) - u
    return step, float(r @ r - ((r + upper @ step) ** 2).sum())


def _until(measured: Measured, part: float) -> Array:
    """Instants of the samples in a window."""
    t = measured.times
    return t if part >= 1.0 else t[: max(2, math.ceil(part * len(t)))]


def _is_white(r: Array) -> bool:
    """True if neighbours differ as much as any two residuals; von Neumann 1941."""
    size = float(r @ r)
    ratio = float((np.diff(r) ** 2).sum()) / size if size else 2.0
    return abs(ratio - 2.0) < _SIGMAS / math.sqrt(len(r))


def _is_alike(r: Array, least: float) -> bool:
    """True if no block of residuals, and no single one, exceeds those of most blocks.

    Parameters
    ----------
    least : negligible magnitude of residuals
    """
    memory = _memory(r)
    for count in (2, _BLOCKS):  # long blocks show little, short ones what is soon over
        blocks = _blocks(r, count)
        squares = np.array([float(b @ b) / len(b) for b in blocks])
        usual = max(float(np.median(squares)), least**2)
        allowed = 1.0 + _SIGMAS * math.sqrt(2.0 * memory / len(blocks[-1]))
        if squares.max() > allowed * usual:
            return False
    return bool(np.abs(r).max() ** 2 <= _OUTLIER**2 * usual)


def _blocks(r: Array, count: int = _BLOCKS) -> list[Array]:
    """Residuals of a window in consecutive blocks."""
    return np.array_split(r, min(count, max(1, len(r) // _FEWEST)))


def _memory(r: Array) -> float:
    """Integrated autocorrelation time, up to where correlations are insignificant."""
    n, correlation = len(r), autocorrelation(r - r.mean())
    if not correlation[0] > 0.0:
        return 1.0
    correlation /= correlation[0]
    small = np.flatnonzero(correlation < 2.0 / math.sqrt(n))
    last = int(small[0]) if small.size else n
    return max(1.0, 1.0 + 2.0 * float(correlation[1:last].sum()))
