"""Frequency content of a signal: power, amplitudes, envelopes, spectral kurtosis; orders.

Sources: P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE
Trans. Audio Electroacoust. 15 (1967) 70; R. B. Randall and J. Antoni, Rolling element bearing
diagnostics - a tutorial, Mech. Syst. Signal Process. 25 (2011) 485, for the envelope; J. Antoni,
The spectral kurtosis, ibid. 20 (2006) 282.

Of orders: K. R. Fyfe and E. D. S. Munck, Analysis of computed order tracking, Mech.
Syst. Signal Process. 11 (1997) 187; synchronous averages: P. D. McFadden, A revised model for the
extraction of periodic waveforms by time domain averaging, ibid. 1 (1987) 83. Here the angle is
known at every sample, so that nothing is assumed of the motion between pulses of a tacho. Samples
are interpolated by splines: band-limited interpolation fails where signals jump.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from mechanism_sim.arrays import Array

_DEGREE = 5
_MOST = 4096  # samples a turn, unless told
_SHORTEST = 256  # samples of a segment, unless told or fewer
_FAINT = 1e-3  # of the mean density of power: what rounding may have, and no resonance
_FEWEST = 16  # segments of which a kurtosis is worth looking at
_AT_ONCE = 2**18  # samples of segments or splines, which fit into a cache
_BESIDE = 64  # samples on each side of those of a spline that are its margin


@dataclass(frozen=True, eq=False)
class LineSpectrum:
    """Values (F,) at rising frequencies (F,) [Hz], or orders [1/turn], evenly spaced from 0."""

    frequency: Array
    values: Array

    @property
    def step(self) -> float:
        """Distance of two lines [Hz]."""
        return float(self.frequency[1]) if len(self.frequency) > 1 else 0.0

    def strongest(self, count: int) -> list[tuple[float, float]]:
        """The highest local peaks as (frequency, value), in falling order; 0 Hz left out."""
        peaks = self._peaks()
        chosen = peaks[np.argsort(self.values[peaks])[::-1][:count]]
        return [(float(self.frequency[k]), float(self.values[k])) for k in chosen]

    def _peaks(self) -> NDArray[np.int64]:
        """Indices of lines that top their neighbours.

        The first line above 0 and the last are peaks if they top their one neighbour; a spectrum
        that is level has none.
        """
        # both ends beside the lowest of all lines: each is a peak if it rises above its neighbour,
        # and the first is not measured by the mean at 0, which is no part of an oscillation
        floor = self.values[1:].min() if len(self.values) > 1 else 0.0
        around = np.concatenate([[floor], self.values[1:], [floor]])
        # the middle of a flat peak counts, as in `scipy.signal`, whose import takes half a second
        last = np.flatnonzero(np.diff(around))
        first, last = np.append(0, last + 1), np.append(last, len(around) - 1)
        level = around[first]
        top = 1 + np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:]))
        return np.asarray((first[top] + last[top]) // 2)


class OrderSpectrum(LineSpectrum):
    """Amplitudes over orders; of a single turn each line is an order, with none in between."""

    def _peaks(self) -> NDArray[np.int64]:
        if self.step < 1.0:
            return super()._peaks()
        return 1 + np.flatnonzero(self.values[1:] > 0.0)


def power(
    signals: Sequence[Array], rate: float, segment: int | None = None, window: str = 'hann'
) -> LineSpectrum:
    """One-sided power spectral density by Welch's method, [unit^2/Hz].

    Mean of the periodograms of segments that overlap by half, the mean of all samples taken off:
    that of each segment would be part of an oscillation of which it holds few periods. Summed
    over the lines it is the variance: exactly that of a single segment under a window 'boxcar',
    in the mean otherwise.

    Parameters
    ----------
    signals : runs of samples without a gap, (N,) each; one that is shorter than a segment is left
        out
    rate : [Hz] of sampling
    segment : samples of each segment; by default the power of two of which 8 to 16 fit into all
        runs together, but at least 256, and no more than the longest run has
    """
    longest, total = max(map(len, signals)), sum(map(len, signals))
    length = min(segment or max(_SHORTEST, 2 ** int(math.log2(total / 8 + 1))), longest)
    sums, weight = np.zeros(length // 2 + 1), 0
    mean = math.fsum(float(np.sum(x)) for x in signals) / total
    hop = length - length // 2
    most = max(1, (_AT_ONCE - length) // hop) * hop  # between the first and the last of a block
    for x in signals:
        for first in range(0, len(x) - length + 1, most + hop):
            some = x[first : first + most + length] - mean
            count = 1 + (len(some) - length) // hop
            sums += count * scipy.signal.welch(some, rate, window, length, detrend=False)[1]
            weight += count
    return LineSpectrum(_lines(length, rate), sums / weight)


def quickly_transformed(x: Array) -> Array:
    """A long signal (N,), shortened at its end to a length with a fast transform.

    Of a quarter of a million samples none are left out, of more 0.7 % at most: lengths with large
    prime factors take five times as long, and as much memory.
    """
    return x[: scipy.fft.prev_fast_len(len(x))] if len(x) > _AT_ONCE else x


def severity_spectrum(signals: Sequence[Array], rate: float) -> LineSpectrum:
    """Power spectral density for the severity of a signal that is not periodic in turns.

    Of segments of a second, whose lines resolve 10 Hz: one window over all of a longer signal
    would leave out shocks at its ends, and weigh those in its middle more than once.
    """
    return power(signals, rate, max(1, round(rate)))


def severity(acceleration: LineSpectrum) -> float:
    """Severity of vibration: rms [m/s] of the velocity from 10 Hz to 1 kHz.

    By the power spectral density of an acceleration [(m/s^2)^2/Hz]; ISO 20816-1:2016, 4.3.
    """
    f = acceleration.frequency
    inside = (f >= 10.0) & (f <= 1000.0)
    speed = acceleration.values[inside] * acceleration.step / (2.0 * np.pi * f[inside]) ** 2
    return math.sqrt(speed.sum())


def autocorrelation(x: Array) -> Array:
    """Sums (N,) of products of samples (N,) so many places apart, those beyond the end being 0."""
    lines = np.abs(np.fft.rfft(x, 2 * len(x))) ** 2
    return np.asarray(np.fft.irfft(lines)[: len(x)])


def _lines(length: int, rate: float) -> Array:
    """Frequencies [Hz] of the transform of so many real samples."""
    return np.asarray(np.arange(length // 2 + 1) * (rate / length))


def amplitude(x: Array, rate: float, window: str = 'boxcar') -> LineSpectrum:
    """Amplitudes of the sines that make up a signal (N,), in its unit; the mean at 0.

    Scaled by the mean of the window, so that a sine on a line shows its amplitude under any. With
    whole periods in the signal a 'boxcar' has no leakage; otherwise take 'hann', or 'flattop'
    where amplitudes matter more than frequencies.
    """
    w = np.ones(len(x)) if window == 'boxcar' else scipy.signal.get_window(window, len(x))
    values = np.abs(np.fft.rfft(w * x)) * (2.0 / w.sum())
    values[0] *= 0.5
    if len(x) % 2 == 0:
        values[-1] *= 0.5
    return LineSpectrum(_lines(len(x), rate), values)


def envelope(x: Array, rate: float, band: tuple[float, float] | None = None) -> Array:
    """Envelope (N,) of a signal (N,) in a band [Hz]: magnitude of its analytic signal there.

    The lines of the band, doubled, are transformed back alone: an ideal band-pass filter and
    Hilbert's transform in one (Randall and Antoni, 2011, sect. 5.1).
    """
    low, high = band or (0.0, 0.5 * rate)
    lines = 2.0 * np.fft.rfft(x)
    frequency = _lines(len(x), rate)
    # the lines at 0 and at half the rate are real: they have no envelope
    inside = (frequency > 0.0) & (np.arange(len(lines)) < 0.5 * len(x))
    lines[~(inside & (frequency >= low) & (frequency <= high))] = 0.0
    return np.asarray(np.abs(np.fft.ifft(lines, len(x))))


def envelope_spectrum(
    x: Array, rate: float, band: tuple[float, float] | None = None, window: str = 'hann'
) -> LineSpectrum:
    """Amplitude spectrum of the squared envelope in a band [Hz], its mean taken off, [unit^2].

    Squared, because a root would add harmonics that are not in the signal (Randall and Antoni).
    """
    squared = envelope(x, rate, band) ** 2
    return amplitude(squared - squared.mean(), rate, window)


def spectral_kurtosis(x: Array, rate: float, segment: int = 128) -> LineSpectrum:
    """Kurtosis of the complex envelope at every frequency: ``<|X|^4> / <|X|^2>^2 - 2``.

    X is the Fourier transform of Hann-windowed segments that overlap by three quarters. 0 for
    Gaussian noise, -1 for sines, above 0 where shocks are (Antoni, 2006, eqs. 11 and 28). Without
    meaning, and set to 0, at the ends of the frequency scale, where X is real.

    Parameters
    ----------
    segment : samples of a segment: shorter than the time between shocks, longer than the ringing
    """
    window = scipy.signal.get_window('hann', segment)
    cut = np.lib.stride_tricks.sliding_window_view(x, segment)[:: max(1, segment // 4)]
    sums = np.zeros((2, segment // 2 + 1))
    rows = max(1, _AT_ONCE // segment)
    for first in range(0, len(cut), rows):
        square = np.abs(np.fft.rfft(window * cut[first : first + rows], axis=1)) ** 2
        sums += (square**2).sum(axis=0), square.sum(axis=0)
    fourth, second = sums / len(cut)
    values = np.full(len(second), 2.0)
    values = np.divide(fourth, second**2, out=values, where=second**2 > 0.0) - 2.0
    values[[0, -1]] = 0.0
    return LineSpectrum(_lines(segment, rate), values)


def shock_band(x: Array, rate: float, turn: float = math.inf) -> tuple[float, float]:
    """The band [Hz] of the largest spectral kurtosis of a signal (N,), from its kurtogram.

    Of all frequencies and segments of 16, 32, ... samples, at least 16 of them in the signal, the
    pair of the largest spectral kurtosis; the band is as wide as the main lobe of the Hann window
    (Antoni, 2006, sect. 4). Frequencies of hardly any power are left out: that may be rounding.

    Parameters
    ----------
    turn : [s] of a shaft whose orders the envelope is to have: segments are at most a quarter of
        it, since those that are longer than the time between shocks see single events alone
    """
    best, band = -np.inf, (0.0, 0.5 * rate)
    if not len(x) or not np.ptp(x):
        return band
    held = np.cumsum(np.abs(np.fft.rfft(x - x.mean())) ** 2)
    segment = 16
    while segment * _FEWEST <= len(x) and segment <= max(16.0, 0.25 * turn * rate):
        found = spectral_kurtosis(x, rate, segment)
        half = 2.0 * rate / segment
        ends = np.add.outer([-0.25 * half, 0.25 * half], found.frequency) * (len(x) / rate)
        low, high = held[np.clip(ends.astype(int), 0, len(held) - 1)]
        faint = high - low <= _FAINT * held[-1] * 2.0 / segment
        values = np.where(faint, -np.inf, found.values)
        k = int(np.argmax(values[1:-1])) + 1
        if values[k] > best:
            middle = found.frequency[k]
            best, band = values[k], (max(0.0, middle - half), min(middle + half, rate / 2))
        segment *= 2
    return float(band[0]), float(band[1])


def band_share(x: Array, rate: float, band: tuple[float, float]) -> float:
    """Share of the power of a signal (N,) about its mean that is in a band [Hz]."""
    power, f = np.abs(np.fft.rfft(x - x.mean())) ** 2, _lines(len(x), rate)
    whole = float(power.sum())
    return float(power[(f >= band[0]) & (f <= band[1])].sum()) / whole if whole else 0.0


@dataclass(frozen=True, eq=False)
class TurnSegments:
    """A signal at n angles equally spaced in each of K whole turns, or of K times r turns."""

    #: (K, n) in the order of time; row k holds the angles ``2 pi r j / n`` from turn
    #: ``first[k]`` on, or ``-2 pi r j / n`` of a shaft that turns backwards
    values: Array
    #: (K,) whole turns before each row; rows that follow each other are neighbours in time where
    #: they rise by r
    first: NDArray[np.int64]
    backwards: bool = False  #: True if the shaft rotates clockwise
    turns: int = 1  #: r

    @property
    def angle(self) -> Array:
        """The angles (n,) [rad], rising."""
        n = self.values.shape[1]
        return np.asarray(2.0 * np.pi * self.turns * np.arange(n) / n)

    def together(self, turns: int) -> TurnSegments | None:
        """Rows of several turns each instead of one; None if there are none.

        They begin where a multiple of so many turns is over, as of a machine that is as before
        after several turns only.
        """
        begins = np.flatnonzero(self.first % turns == 0)
        begins = begins[begins + turns <= len(self.first)]
        whole = self.first[begins + turns - 1] - self.first[begins] == turns - 1
        if not whole.any():
            return None
        rows = begins[whole][:, None] + np.arange(turns)
        values = self.values[rows].reshape(len(rows), -1)
        return TurnSegments(values, self.first[rows[:, 0]], self.backwards, turns)

    def by_angle(self, turn: Array) -> Array:
        """Values of a turn (n,), which are in the order of time, in that of `angle`."""
        return np.roll(turn[::-1], 1) if self.backwards else turn

    @property
    def mean(self) -> Array:
        """Synchronous average (n,) over `angle`: the part that repeats every turn."""
        return self.by_angle(self.values.mean(axis=0))

    @property
    def spread(self) -> Array:
        """Standard deviation (n,) of the turns about their average; nan of a single turn."""
        if len(self.values) < 2:
            return np.full(self.values.shape[1], np.nan)
        return self.by_angle(self.values.std(axis=0, ddof=1))

    @property
    def text(self) -> str:
        """Number of turns as text, as '30 turns' or '15 times 2 turns'."""
        count = len(self.values)
        return f'{count} times {self.turns} turns' if self.turns > 1 else f'{count} turns'

    @property
    def residual(self) -> Array:
        """Residual (K, n) without the average: the part that does not repeat."""
        return np.asarray(self.values - self.values.mean(axis=0))

    def series(self) -> list[Array]:
        """Consecutive turns, joined: (k n,) each."""
        cuts = np.flatnonzero(np.diff(self.first) != self.turns) + 1
        return [rows.ravel() for rows in np.split(self.values, cuts)]


def at_equal_angles(
    turned: Sequence[Array], values: Sequence[Array], per_turn: int | None = None
) -> TurnSegments:
    """A signal at equal angles of a shaft, by splines of degree 5 through its samples.

    The splines follow what lies well below half the sampling rate: at a quarter of the rate their
    error is 0.3 % of an amplitude, at an eighth 0.002 %, and more by the ends of a run only.

    Parameters
    ----------
    turned : revolutions of the shaft at the samples of runs without a gap, (N,) each, rising
    values : samples of the runs, (N,) each
    per_turn : number of angles in a turn; by default the number of samples in the slowest turn

    Raises
    ------
    ValueError
        If the shaft turns back, or no whole turn is covered.
    """
    if any(np.any(np.diff(run) <= 0.0) for run in turned):
        raise ValueError('the shaft stops or turns back: orders need a speed of one sign')
    n = per_turn or _per_turn(turned)
    rows, first = [], []
    for run, x in zip(turned, values, strict=True):
        if len(run) <= _DEGREE:
            continue
        begin, end = math.ceil(run[0] - 1e-9), math.floor(run[-1] + 1.0 / n + 1e-9)
        if end <= begin:
            continue
        grid = np.arange(begin * n, end * n) / n
        rows.append(_interpolated(run, x, grid).reshape(-1, n))
        first.append(np.arange(begin, end))
    if not rows:
        raise ValueError('the signal covers no whole turn')
    return TurnSegments(np.concatenate(rows), np.concatenate(first))


def _interpolated(at: Array, x: Array, grid: Array) -> Array:
    """Values on a rising grid of the spline through samples (N,), some of them at once.

    Beyond `_BESIDE` samples beside a place none counts any more: of a sample so far off less than
    1e-23 is left.
    """
    values = np.empty(len(grid))
    cuts = np.arange(0, max(1, len(at) - _BESIDE), _AT_ONCE)
    places = [0, *np.searchsorted(grid, at[cuts[1:]]), len(grid)]
    for first, a, b in zip(cuts, places, places[1:], strict=False):
        near = slice(max(0, first - _BESIDE), first + _AT_ONCE + _BESIDE)
        spline = scipy.interpolate.make_interp_spline(at[near], x[near], k=_DEGREE)
        values[a:b] = spline(grid[a:b])
    return values


def _per_turn(turned: Sequence[Array]) -> int:
    step = min((float(np.diff(run).min()) for run in turned if len(run) > 1), default=1.0)
    return int(min(max(math.ceil((1.0 - 1e-9) / step), 8), _MOST))


def order_spectrum(turns: TurnSegments) -> OrderSpectrum:
    """Amplitudes over orders, the `frequency` being in cycles a turn; of the longest series.

    Over whole turns an order that is a whole number leaks nowhere, however the speed varies; that
    is why the window is none.
    """
    longest = max(turns.series(), key=len)
    return OrderSpectrum(**vars(amplitude(longest, float(turns.values.shape[1]), 'boxcar')))
