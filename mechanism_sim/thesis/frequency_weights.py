"""Noise fading: amplitudes of a signal weighted by frequency, by FFT and back ([SB] 7.2).

A weight is a function of frequency, real to attenuate, complex to invert an instrument.
Weights are multiplied with each other by `both`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError

Band = tuple[float, float]
Weight = Callable[[Array], NDArray[np.complex128] | Array]
"""From frequencies (K,) [Hz] to factors (K,)."""


def band_pass(low: float, high: float, edge: float = 0.0) -> Weight:
    """A weight of 1 from `low` to `high` [Hz] and 0 elsewhere.

    Parameters
    ----------
    edge : [Hz] width, outside of the band, of edges that fall as half a cosine; 0: abruptly
    """
    return lambda f: _inside(f, (low, high), edge)


def invert(transfer: Callable[[NDArray[np.complex128]], NDArray[np.complex128]]) -> Weight:
    """The reciprocal of an instrument's transfer function of s; zero where that is zero.

    It takes gain and delay out of a signal, and amplifies noise where the instrument is
    insensitive: to be combined with a band in which it is sensitive.
    """

    def weight(f: Array) -> NDArray[np.complex128]:
        h = transfer(np.asarray(2j * np.pi * f, np.complex128))
        return np.divide(1.0, h, out=np.zeros_like(h), where=np.abs(h) > 1e-9 * np.abs(h).max())

    return weight


def both(*weights: Weight) -> Weight:
    """The product of weights."""
    return lambda f: np.asarray(math.prod(weight(f) for weight in weights))


def _inside(f: Array, band: Band, edge: float) -> Array:
    """1 in the band, falling to 0 within `edge` of it; a limit belongs to it but for rounding."""
    low, high = band
    outside = np.maximum(np.maximum(low - f, f - high), 0.0)
    outside[outside <= 1e-9 * np.abs(f).max(initial=0.0)] = 0.0
    if edge <= 0.0:
        return np.asarray(outside == 0.0, np.float64)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.minimum(outside / edge, 1.0)))


def fade(samples: Array, sample_rate: float, weight: Weight, length: int | None = None) -> Array:
    """Samples (N,) whose amplitudes have been weighted by frequency.

    Under a rectangular window: the record in one piece, or in pieces of `length` samples side by
    side, as [SB] 7.2. [SB] says that the noise this window adds is offset on the way back. That
    holds as long as nothing is faded: a tone between two frequencies of the transform is smeared
    over all of them, and what has been smeared into the band stays.

    Parameters
    ----------
    sample_rate : [Hz]
    weight : of amplitudes by frequency
    """
    count = len(samples)
    size = length or count
    if not 1 < size <= count:
        raise InputError(f'a window of {size} samples does not fit a record of {count} samples')
    pieces = [samples[i : i + size] for i in range(0, count, size)]
    return np.concatenate([_apply_weight(piece, sample_rate, weight) for piece in pieces])


def _apply_weight(samples: Array, sample_rate: float, weight: Weight) -> Array:
    count = len(samples)
    f = np.asarray(np.fft.rfftfreq(count, 1.0 / sample_rate), np.float64)
    spectrum = np.fft.rfft(samples) * weight(f)
    return np.asarray(np.fft.irfft(spectrum, count))
