"""Noise fading: amplitudes of a signal weighted by frequency, by FFT and back ([SB] 7.2).

A weight is a function of frequency, real to attenuate, complex to invert an instrument.
Weights are multiplied with each other by `both`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError

Band = tuple[float, float]
Weight = Callable[[Array], NDArray[np.complex128] | Array]
"""From frequencies (K,) [Hz] to factors (K,)."""

_OVERLAP = 4  # windows over every sample: enough for all that are not narrower than Blackman's


def band_pass(low: float, high: float, edge: float = 0.0) -> Weight:
    """A weight of 1 from `low` to `high` [Hz] and 0 elsewhere.

    Parameters
    ----------
    edge : [Hz] width, outside of the band, of edges that fall as half a cosine; 0: abruptly
    """
    return lambda f: _inside(f, (low, high), edge)


def attenuate(bands: Sequence[Band], to: float = 0.0, edge: float = 0.0) -> Weight:
    """A weight of `to` in the bands [Hz] and 1 elsewhere; `edge` as for `band_pass`."""

    def weight(f: Array) -> Array:
        inside = np.max([np.zeros_like(f), *(_inside(f, band, edge) for band in bands)], axis=0)
        return np.asarray(1.0 - (1.0 - to) * inside)

    return weight


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


def fade(
    samples: Array,
    sample_rate: float,
    weight: Weight,
    window: str | tuple[str, float] = 'boxcar',
    length: int | None = None,
) -> Array:
    """Samples (N,) whose amplitudes have been weighted by frequency.

    A rectangular window takes the record in one piece, or in pieces of `length` side by side, as
    [SB] 7.2. [SB] says that the noise this window adds is offset on the way back. That holds as
    long as nothing is faded: a tone between two frequencies of the transform is smeared over all
    of them, and what has been smeared into the band stays. Other windows overlap four times, and
    their dual windows put the signal together (`scipy.signal.ShortTimeFFT`); the record is
    continued by its reflection at both ends, next to which they are less exact.

    Parameters
    ----------
    sample_rate : [Hz]
    weight : of amplitudes by frequency
    window : its name, and parameter if it has one, as for `scipy.signal.get_window`
    length : of the window, in samples; all of the record for a rectangular window, else an eighth
        of it
    """
    count = len(samples)
    rectangular = window == 'boxcar'
    size = length or (count if rectangular else max(16, count // 8))
    if not 1 < size <= count:
        raise InputError(f'a window of {size} samples does not fit a record of {count} samples')
    if rectangular:
        pieces = [samples[i : i + size] for i in range(0, count, size)]
        return np.concatenate([_apply_weight(piece, sample_rate, weight) for piece in pieces])
    try:
        shape = signal.get_window(window, size)
    except ValueError as error:
        raise InputError(f"window '{window}': {error}") from error
    transform = signal.ShortTimeFFT(shape, max(1, size // _OVERLAP), sample_rate)
    spectra = transform.stft(samples, padding='even') * np.asarray(weight(transform.f))[:, None]
    return np.asarray(transform.istft(spectra, k1=count))


def _apply_weight(samples: Array, sample_rate: float, weight: Weight) -> Array:
    count = len(samples)
    f = np.asarray(np.fft.rfftfreq(count, 1.0 / sample_rate), np.float64)
    spectrum = np.fft.rfft(samples) * weight(f)
    return np.asarray(np.fft.irfft(spectrum, count))


def noise_floor(samples: Array, sample_rate: float, length: int = 256) -> float:
    """One-sided power spectral density of the white noise in a signal [unit^2/Hz].

    The median over all frequencies of Welch's estimate with medians of its segments (B. Allen et
    al., FINDCHIRP, Phys. Rev. D 85, 122006, appendix B): right as long as the signal itself fills
    less than half of the frequencies, too high otherwise.
    """
    return float(np.median(_density(samples, sample_rate, length)[1]))


def band_above_noise(
    samples: Array, sample_rate: float, factor: float = 4.0, length: int = 256
) -> Band:
    """From zero to the highest frequency [Hz] whose power is `factor` times the noise floor.

    A band for `band_pass`; of a signal that is nothing but noise it is empty (0, 0).
    """
    f, density = _density(samples, sample_rate, length)
    loud = f[density > factor * np.median(density)]
    return 0.0, float(loud[-1]) if len(loud) else 0.0


def _density(samples: Array, sample_rate: float, length: int) -> tuple[Array, Array]:
    size = min(length, len(samples))
    f, density = signal.welch(samples, sample_rate, 'hann', size, average='median')
    return f[1:-1], density[1:-1]  # mean and Nyquist frequency have half of the noise
