"""Condition indicators of a signal, whole or by blocks; features that chaos hardly changes.

Sources: R. B. Randall, Vibration-based Condition Monitoring, Wiley, for RMS, peak, crest factor,
kurtosis and skewness; W. Caesarendra and T. Tjahjowidodo, A review of feature extraction methods
in vibration-based condition monitoring, Machines 5 (2017) 21, for shape, impulse and clearance
factor.

Features: a rattling machine is chaotic, no instant of its signal comes back in another run. What
does is how much power there is in a band, how high the n-th highest burst is, how fast bursts die
out. All scales follow the number of samples and the sampling rate, so that the figures say the
same of any instrument; all are logarithms or ratios, whose spread is the same for weak and strong
signals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mechanism_sim.arrays import Array
from mechanism_sim.sensing.spectra import autocorrelation, envelope, power

FEWEST = 4096
"""Least number of samples of a stretch."""
_SEGMENT = 2048  # samples of a segment of the spectrum
_BANDS = np.geomspace(1.0 / 256.0, 1.0, 11)  # edges, over half of the sampling rate
_ENVELOPE = 0.1  # from where on the envelope is taken, over half of the sampling rate
_HIGHEST = np.geomspace(2.0**-11, 2.0**-4, 9)  # which bursts, in order of height, over samples
_LAGS = (3, 5, 8, 12, 20, 30, 50, 80, 120)  # samples


@dataclass(frozen=True)
class Indicators:
    """Statistics of N samples x; ``None`` where undefined for a constant signal.

    What is about zero counts a constant part of the signal, such as gravity; what is about the
    mean does not.
    """

    samples: int  #: N
    #: ``sum(x)/N``, ``sqrt(sum(x^2)/N)``, ``max |x|``, in units of x
    mean: float
    rms: float
    peak: float
    crest: float | None  #: peak / rms; sqrt(2) for a sine
    #: fourth central moment over the squared variance: 3 for Gaussian noise, 1.5 for a sine, more
    #: the more a signal consists of shocks
    kurtosis: float | None
    #: third central moment over the 3/2th power of the variance: 0 if symmetric
    skewness: float | None
    shape: float | None  #: rms / mean |x|; pi / (2 sqrt(2)) for a sine
    impulse: float | None  #: peak / mean |x|; pi / 2 for a sine
    #: peak / (mean sqrt |x|)^2: like the crest factor, with less weight on the peaks in its
    #: denominator
    clearance: float | None


class Moments:
    """Moments of a stream, block by block.

    Source: P. Pebay, Formulas for robust, one-pass parallel computation of covariances and
    arbitrary-order statistical moments, SAND2008-6212, eqs. 2.1 and 3.1 for p = 2, 3, 4.
    """

    def __init__(self) -> None:
        self.count = 0
        self.mean = self.m2 = self.m3 = self.m4 = 0.0
        self.peak = self._sum = self._roots = 0.0

    def add(self, values: ArrayLike) -> None:
        """Take in a block of samples, shape (N,)."""
        x = np.asarray(values, np.float64)
        nb, na = len(x), self.count
        if not nb:
            return
        mean = float(np.mean(x))
        d = x - mean
        squares = d * d
        b2, b3, b4 = (float(np.sum(p)) for p in (squares, squares * d, squares * squares))
        a2, a3, n, delta = self.m2, self.m3, na + nb, mean - self.mean
        self.m4 += (
            b4
            + delta**4 * na * nb * (na * na - na * nb + nb * nb) / n**3
            + 6 * delta**2 * (na * na * b2 + nb * nb * a2) / n**2
            + 4 * delta * (na * b3 - nb * a3) / n
        )
        self.m3 += b3 + delta**3 * na * nb * (na - nb) / n**2 + 3 * delta * (na * b2 - nb * a2) / n
        self.m2 += b2 + delta**2 * na * nb / n
        self.mean += delta * nb / n
        self.count = n
        size = np.abs(x)
        self.peak = max(self.peak, float(size.max()))
        self._sum += float(size.sum())
        self._roots += float(np.sqrt(size).sum())

    @property
    def rms(self) -> float:
        """Root of the mean square, about zero."""
        return math.sqrt(self.m2 / self.count + self.mean**2)

    @property
    def _changes(self) -> bool:
        """True if the variance is more than rounding."""
        return self.m2 > self.count * (1e-14 * self.mean) ** 2

    @property
    def kurtosis(self) -> float | None:
        """Kurtosis; None where the variance is rounding only."""
        return self.count * self.m4 / self.m2**2 if self._changes else None

    @property
    def skewness(self) -> float | None:
        """Skewness; None where the variance is rounding only."""
        return math.sqrt(self.count) * self.m3 / self.m2**1.5 if self._changes else None

    def indicators(self) -> Indicators:
        """Indicators of the samples so far; at least one."""
        n, rms, peak = self.count, self.rms, self.peak
        per = None if peak == 0.0 else n / self._sum
        return Indicators(
            samples=n,
            mean=self.mean,
            rms=rms,
            peak=peak,
            crest=peak / rms if peak else None,
            kurtosis=self.kurtosis,
            skewness=self.skewness,
            shape=rms * per if per else None,
            impulse=peak * per if per else None,
            clearance=peak * (n / self._roots) ** 2 if peak else None,
        )


def indicators(signal: ArrayLike) -> Indicators:
    """Indicators of a signal (N,).

    Raises
    ------
    ValueError
        For a signal without samples.
    """
    moments = Moments()
    moments.add(signal)
    if not moments.count:
        raise ValueError('a signal without samples has no indicators')
    return moments.indicators()


def features(x: Array, rate: float, stretches: int = 1) -> Array:
    """Figures of a signal, stretch by stretch.

    Of each stretch:

    * the power in ten bands, each 1.74 times as wide as the one below, up to half of the sampling
      rate;
    * the heights of the bursts: peaks of the envelope above a tenth of half of the sampling rate,
      the n-th highest for nine n from 1/2048 to 1/16 of the number of samples. A bearing that
      gives back little has few impacts after each other, and its bursts fall off quickly with n;
    * how long bursts last: the autocorrelation of the logarithm of the envelope at nine lags.

    Parameters
    ----------
    x : (N,) samples
    rate : sampling rate [Hz]
    stretches : number of equal parts of the signal: more than one where the speed changes

    Returns
    -------
    (28 stretches,) logarithms (of squared and plain units of `x`) and ratios

    Raises
    ------
    ValueError
        If a stretch is shorter than `FEWEST` samples.
    """
    size = len(x) // stretches
    if size < FEWEST:
        raise ValueError(f'{size} samples are too few: {FEWEST} are needed')
    nyquist = 0.5 * rate
    bursts = envelope(x, rate, (_ENVELOPE * nyquist, nyquist))
    parts = [slice(k * size, (k + 1) * size) for k in range(stretches)]
    return np.concatenate([_of_stretch(x[part], bursts[part]) for part in parts])


def _of_stretch(x: Array, bursts: Array) -> Array:
    spectrum = power([x], 2.0, _SEGMENT)
    edges = np.searchsorted(spectrum.frequency, _BANDS)
    bands = np.add.reduceat(spectrum.values[: edges[-1] + 1], edges[:-1])
    heights = np.sort(bursts[scipy.signal.find_peaks(bursts)[0]])[::-1]
    rank = np.minimum((_HIGHEST * len(x)).astype(int), max(len(heights) - 1, 0))
    level = _log(bursts)
    level -= level.mean()
    correlation = autocorrelation(level)
    highest = heights[rank] if len(heights) else np.zeros(len(rank))
    ratios = correlation[list(_LAGS)] / max(correlation[0], np.finfo(float).tiny)
    return np.concatenate([_log(bands), _log(highest), ratios])


def _log(values: Array) -> Array:
    """Logarithms; a signal of zeros has finite ones, too."""
    return np.asarray(np.log(np.maximum(values, 1e-100)))
