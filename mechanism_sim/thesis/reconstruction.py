"""Reconstruction of the links' angular motion from accelerometer readings ([SB] 7.2).

Readings are in the direction `across` of a scene's sensors: along v(angle) = (-sin, cos), which is
counterclockwise. Arrays are (N,) over time, SI units and radians.

Noise fading: amplitudes of a signal weighted by frequency, by FFT and back. A weight is a function
of frequency, real for attenuation, complex for inverting an instrument; `both` multiplies weights.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, signal

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError

_Band = tuple[float, float]
Weight = Callable[[Array], NDArray[np.complex128] | Array]
"""Weight: a function from frequencies (K,) [Hz] to factors (K,)."""


def crank_pin(
    length: float, angle: Array, speed: Array | float, rate: Array | float = 0.0
) -> Array:
    """Acceleration (2, N) [m/s^2] of the end of a crank: ``l2 (a2 v(th2) - w2^2 u(th2))``.

    Parameters
    ----------
    length : l2 [m]
    angle, speed, rate : th2 [rad], w2 [rad/s], a2 [rad/s^2]
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = np.array([-sine, cosine])
    return np.asarray(length * (rate * turned - speed**2 * np.array([cosine, sine])))


def angular_acceleration(
    reading: Array,
    at: float,
    angle: Array | float = 0.0,
    joint: Array | None = None,
    gravity: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """Angular acceleration (N,) [rad/s^2] of a link from the reading of one accelerometer.

    The reading is ``v . (joint'' - gravity) + at angle''``, v being the axis of the sensor. For
    the coupler, with the crank pin as joint, this is [SB] eq. 7.2.1-6
    ``a3 = (l2 w2^2 sin(th2 - th3) - a_t)/l3``, where a_t counts clockwise (eq. 7.2.1-5), and which
    leaves out the crank's own acceleration ``- l2 a2 cos(th2 - th3)/l3``. For the rocker, whose
    joint rests, it is eq. 7.2.2-1.

    Parameters
    ----------
    reading : (N,) [m/s^2]
    at : distance of the sensor from the joint [m]
    angle : angle of the link [rad]: that of the ideal mechanism as in [SB], or better
    joint : (2, N) acceleration of the joint from which `at` counts [m/s^2]; default: at rest
    gravity : gravity [m/s^2] for instruments that read acceleration minus gravity; else 0
    """
    if at == 0.0:
        raise InputError('a sensor in the joint of its link does not sense its rotation')
    ax, ay = np.zeros((2, 1)) if joint is None else joint
    carried = -np.sin(angle) * (ax - gravity[0]) + np.cos(angle) * (ay - gravity[1])
    return np.asarray((reading - carried) / at)


def by_two(first: Array, second: Array, at_first: float, at_second: float) -> Array:
    """Angular acceleration (N,) [rad/s^2] of a link from two transverse sensors on it.

    The common terms, motion of the joint and gravity, cancel: neither the crank nor the
    angle of the link is needed.

    Parameters
    ----------
    first, second : readings (N,) [m/s^2]
    at_first, at_second : distances from the joint [m], on a line through it
    """
    if at_first == at_second:
        raise InputError('two sensors at the same place of a link give no angular acceleration')
    return np.asarray((first - second) / (at_first - at_second))


def by_trapezoids(rate: Array, sample_rate: float, start: float = 0.0) -> Array:
    """Integral (N,) of samples by the trapezoidal rule ([SB] eq. 7.2.1-8) from a value `start`.

    It drifts: an offset of the samples increases with time, and noise makes a random walk.
    """
    return np.asarray(start + integrate.cumulative_trapezoid(rate, dx=1 / sample_rate, initial=0))


def by_whole_cycles(rate: Array, sample_rate: float, mean: float = 0.0) -> Array:
    """Integral (N,) of a record of whole cycles of a periodic motion.

    The derivative of a periodic angular velocity has zero mean, so
    the mean is removed beforehand. The constant follows from the mean of the velocity: zero for
    a rocking link.
    """
    found = by_trapezoids(rate - rate.mean(), sample_rate)
    return np.asarray(found - found.mean() + mean)


def by_spectrum(rate: Array, sample_rate: float, low: float = 0.0, mean: float = 0.0) -> Array:
    """Integral by FFT, amplitudes over ``i omega``: (N,), without any phase error.

    Exact for a record of whole cycles that holds no frequency from half the sampling rate on.

    Parameters
    ----------
    low : lower limit of frequencies [Hz], against drift
    mean : mean of the result
    """
    f = np.fft.rfftfreq(len(rate), 1.0 / sample_rate)
    spectrum = np.fft.rfft(rate)
    keep = (f > 0.0) & (f >= low)
    spectrum[keep] /= 2j * np.pi * f[keep]
    spectrum[~keep] = 0.0
    return np.asarray(np.fft.irfft(spectrum, len(rate)) + mean)


def by_filter(
    rate: Array, sample_rate: float, low: float, order: int = 2, mean: float = 0.0
) -> Array:
    """Integral by trapezoids and a Butterworth high-pass run forward and backward: (N,).

    For records that are not whole cycles. Both directions together cancel its phase and square its
    gain; within a few periods of `low` from both ends it is less exact.

    Parameters
    ----------
    low : corner frequency [Hz], well below that of the crank
    order : order of the filter in each direction
    """
    if not 0.0 < low < 0.5 * sample_rate:
        raise InputError(
            f'the corner of a high-pass must be above 0 and below half the sampling rate '
            f'({0.5 * sample_rate:g} Hz): {low:g} Hz is not'
        )
    sections = signal.butter(order, low, 'highpass', fs=sample_rate, output='sos')
    integral = by_trapezoids(rate - rate.mean(), sample_rate)
    length = min(len(rate) - 1, round(3.0 * sample_rate / low))
    # an even reflection keeps the mean; the usual odd one would look like a step to a high-pass
    found = signal.sosfiltfilt(sections, integral - integral.mean(), padtype='even', padlen=length)
    return np.asarray(found + mean)


class Error(NamedTuple):
    """Error of an estimate."""

    #: of the error, in the unit of the signals
    rms: float
    largest: float
    relative: float  #: rms of the error over that of the truth


def error(estimate: Array, truth: Array) -> Error:
    """The error of samples (N,) whose truth (N,) is known."""
    off = estimate - truth
    rms = float(np.sqrt(np.mean(off**2)))
    scale = float(np.sqrt(np.mean(truth**2)))
    return Error(rms, float(np.abs(off).max()), rms / scale if scale else np.inf)


def band_pass(low: float, high: float, edge: float = 0.0) -> Weight:
    """A weight of 1 from `low` to `high` [Hz] and 0 elsewhere.

    Parameters
    ----------
    edge : width [Hz] of half-cosine edges outside of the band; 0 for abrupt ones
    """

    def weight(f: Array) -> Array:
        # limits belong to the band, up to rounding
        outside = np.maximum(np.maximum(low - f, f - high), 0.0)
        outside[outside <= 1e-9 * np.abs(f).max(initial=0.0)] = 0.0
        if edge <= 0.0:
            return np.asarray(outside == 0.0, np.float64)
        return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.minimum(outside / edge, 1.0)))

    return weight


def invert(transfer: Callable[[NDArray[np.complex128]], NDArray[np.complex128]]) -> Weight:
    """The reciprocal of an instrument's transfer function of s; zero where that is zero.

    It removes gain and delay from a signal, and amplifies noise where the instrument is
    insensitive: to be combined with a band in which it is sensitive.
    """

    def weight(f: Array) -> NDArray[np.complex128]:
        h = transfer(np.asarray(2j * np.pi * f, np.complex128))
        return np.divide(1.0, h, out=np.zeros_like(h), where=np.abs(h) > 1e-9 * np.abs(h).max())

    return weight


def both(*weights: Weight) -> Weight:
    """The product of weights."""
    return lambda f: np.asarray(math.prod(weight(f) for weight in weights))


def fade(samples: Array, sample_rate: float, weight: Weight, length: int | None = None) -> Array:
    """Samples (N,) with amplitudes weighted by frequency.

    Under a rectangular window: the whole record, or adjacent parts of `length` samples,
    as in [SB] 7.2. [SB] states that the noise of this window is cancelled by the inverse. That
    holds without fading only: a tone between two frequencies of the transform leaks
    into all of them, and leakage into the band remains.

    Parameters
    ----------
    sample_rate : [Hz]
    weight : weight of amplitudes by frequency
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
