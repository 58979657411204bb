"""Figures of a signal that depend on a machine's state and hardly on its chaos.

A rattling machine is chaotic: no instant of its signal comes back in another run. What does is how
much power there is in a band, how high the n-th highest burst is, how fast bursts die out. All
scales follow the number of samples and the sampling rate, so that the figures say the same of any
instrument; all figures are logarithms or ratios, whose spread is the same for weak and strong
signals.
"""

from __future__ import annotations

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.sensing.spectra import envelope, power

FEWEST = 4096
"""Fewest samples of a stretch."""
_SEGMENT = 2048  # samples of a segment of the spectrum
_BANDS = np.geomspace(1.0 / 256.0, 1.0, 11)  # edges, over half of the sampling rate
_ENVELOPE = 0.1  # from where on the envelope is taken, over half of the sampling rate
_HIGHEST = np.geomspace(2.0**-11, 2.0**-4, 9)  # which bursts, in order of height, over samples
_LAGS = (3, 5, 8, 12, 20, 30, 50, 80, 120)  # samples


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
    rate : [Hz] of sampling
    stretches : equal parts that the signal is cut into: more than one where the speed changes

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
    lines = np.abs(np.fft.rfft(level, 2 * len(level))) ** 2
    correlation = np.fft.irfft(lines)
    highest = heights[rank] if len(heights) else np.zeros(len(rank))
    ratios = correlation[list(_LAGS)] / max(correlation[0], np.finfo(float).tiny)
    return np.concatenate([_log(bands), _log(highest), ratios])


def _log(values: Array) -> Array:
    """Logarithms; a signal of zeros has finite ones, too."""
    return np.asarray(np.log(np.maximum(values, 1e-100)))
