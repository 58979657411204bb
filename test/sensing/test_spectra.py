"""Spectra, envelopes, orders and indicators against closed forms, Parseval, and SciPy."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest
from scipy import interpolate, signal, stats

from mechanism_sim.sensing.indicators import Moments, indicators
from mechanism_sim.sensing.spectra import (
    LineSpectrum,
    TurnSegments,
    amplitude,
    at_equal_angles,
    band_share,
    envelope,
    envelope_spectrum,
    order_spectrum,
    power,
    quickly_transformed,
    severity,
    severity_spectrum,
    shock_band,
    spectral_kurtosis,
)

RATE = 2000.0


def noise(count, seed=1):
    return np.random.default_rng(seed).normal(size=count)


def sine(frequency, count, phase=0.4, size=1.0):
    return size * np.sin(math.tau * frequency * np.arange(count) / RATE + phase)


def shocks(count, every, ring, decay=200.0):
    """Decaying oscillations at `ring` Hz, one every so many samples."""
    x = np.zeros(count)
    t = np.arange(count) / RATE
    for k in range(0, count, every):
        since = t[k:] - t[k]
        x[k:] += np.exp(-decay * since) * np.sin(math.tau * ring * since)
    return x


@pytest.mark.parametrize('count', [1000, 1001])
def test_power_of_one_segment_sums_to_the_variance(count):
    x = noise(count)
    found = power([x], RATE, count, 'boxcar')
    assert found.values.sum() * found.step == pytest.approx(x.var(), rel=1e-12)


@pytest.mark.parametrize('place', [0.1, 0.5, 0.9])
def test_severity_weighs_a_shock_alike_wherever_it_is(place):
    """By the transform of all; one window over all had 0.17 or 1.63 of it."""
    x = np.zeros(12_000)
    first = round(place * len(x))
    x[first : first + 500] = shocks(500, 500, 120.0, 60.0)
    lines = np.fft.rfft(x)
    f = np.arange(len(lines)) * RATE / len(x)
    inside = (f >= 10.0) & (f <= 1000.0)
    speeds = lines[inside] / (2.0 * np.pi * f[inside])
    expected = math.sqrt(2.0 * np.sum(np.abs(speeds) ** 2)) / len(x)
    assert severity(severity_spectrum([x], RATE)) == pytest.approx(expected, rel=0.3)


def test_severity_of_a_tone_is_its_velocity():
    for frequency in (13.0, 25.0, 100.3, 777.7):
        found = severity(severity_spectrum([sine(frequency, 12_000)], RATE))
        assert found == pytest.approx(math.sqrt(0.5) / (math.tau * frequency), rel=3e-3)


def test_power_of_noise_is_flat_and_of_the_right_height():
    found = power([noise(50_000), noise(70_000, 2)], RATE, 512)
    assert found.values[2:-2].mean() == pytest.approx(2.0 / RATE, rel=0.01)
    assert found.values[2:-2].std() < 0.15 * 2.0 / RATE  # 1/sqrt(468 segments), twice


def test_runs_are_averaged_by_the_segments_they_hold():
    """A long run and a short one give what SciPy gives of their segments taken one by one."""
    runs, n = [noise(4096), noise(1024, 2), noise(100, 3)], 512
    cut = [x[k : k + n] for x in runs for k in range(0, len(x) - n + 1, n // 2)]
    mean = np.concatenate(runs).mean()
    lines = [signal.periodogram(x - mean, RATE, 'hann', detrend=False)[1] for x in cut]
    assert power(runs, RATE, n).values == pytest.approx(np.mean(lines, axis=0), rel=1e-12)


def test_segments_of_little_more_than_a_period_hold_the_power_of_a_sine():
    """Each less its own mean had 9 % too much of the root."""
    x = 5.0 + sine(5.0, 8000)  # of 400 samples; segments of 512
    found = power([x], RATE)
    assert found.step == pytest.approx(RATE / 512)
    assert found.values.sum() * found.step == pytest.approx(0.5, rel=0.01)


@pytest.mark.parametrize('window', ['boxcar', 'hann', 'flattop'])
@pytest.mark.parametrize('count', [2000, 2001])
def test_a_sine_on_a_line_shows_its_amplitude_under_any_window(window, count):
    x = 3.0 + sine(100 * RATE / count, count, size=2.5)
    found = amplitude(x, RATE, window)
    assert found.values[100] == pytest.approx(2.5, rel=1e-9)
    assert found.values[0] == pytest.approx(3.0, rel=1e-9)
    assert found.frequency[100] == pytest.approx(100 * RATE / count)


def test_amplitude_at_half_the_sampling_rate():
    assert amplitude(np.tile([1.0, -1.0], 8), RATE).values[-1] == pytest.approx(1.0)


def test_strongest_are_local_peaks_in_falling_order():
    found = LineSpectrum(np.arange(7.0), np.array([9.0, 1.0, 3.0, 2.0, 1.0, 4.0, 5.0]))
    assert found.strongest(5) == [(6.0, 5.0), (2.0, 3.0)]


def test_the_first_line_is_a_peak_whatever_the_mean():
    """Of one whole turn order 1 is the first line: its neighbour below is the mean, no order."""
    angle = math.tau * np.arange(360) / 360
    for mean in (0.0, 1e3):
        turn = mean + 5.0 * np.sin(angle + 0.3) + 2.0 * np.cos(2.0 * angle)
        one = order_spectrum(TurnSegments(turn[None], np.array([0])))
        assert dict(one.strongest(2)) == pytest.approx({1.0: 5.0, 2.0: 2.0}, rel=1e-9)
        two = order_spectrum(TurnSegments(np.array([turn, turn]), np.array([0, 1])))
        assert dict(two.strongest(2)) == pytest.approx({1.0: 5.0, 2.0: 2.0}, rel=1e-9)


def test_the_strongest_line_of_power_may_be_the_first():
    """Of a tone of one period a segment the first line holds most (Hann: 4 of 6 parts)."""
    found = power([sine(RATE / 256, 4096)], RATE, 256)
    assert found.strongest(1)[0] == (found.frequency[1], found.values.max())


@pytest.mark.parametrize(
    ('values', 'peaks'),
    [
        ([0.0, 2.0, 2.0, 2.0], []),  # level
        ([9.0, 1.0, 2.0, 3.0], [3.0]),  # rising from the first line on
        ([0.0, 3.0, 3.0, 3.0, 1.0, 2.0], [2.0, 5.0]),  # the middle of a flat peak at the end
        ([5.0], []),
    ],
)
def test_peaks_at_the_ends_of_a_spectrum(values, peaks):
    found = LineSpectrum(np.arange(float(len(values))), np.array(values))
    assert [f for f, _ in found.strongest(5)] == peaks


def test_envelope_of_a_modulated_tone_is_the_modulation():
    t = np.arange(4000) / RATE
    shape = 1.0 + 0.6 * np.cos(math.tau * 20.0 * t)
    x = shape * np.sin(math.tau * 500.0 * t)
    assert envelope(x, RATE, (300.0, 700.0)) == pytest.approx(shape, abs=1e-12)
    assert envelope(x, RATE) == pytest.approx(np.abs(signal.hilbert(x)), abs=1e-12)
    # (1 + m cos)^2 = 1 + m^2/2 + 2 m cos + m^2/2 cos(2 ..)
    found = envelope_spectrum(x, RATE, (300.0, 700.0), 'boxcar')
    peaks = dict(found.strongest(2))
    assert peaks == pytest.approx({20.0: 1.2, 40.0: 0.18}, rel=1e-9)


def test_envelope_finds_the_rate_of_shocks_under_a_stronger_tone_and_noise():
    x = shocks(40_000, 160, 700.0) + 0.2 * noise(40_000) + sine(60.0, 40_000, size=5.0)
    band = shock_band(x, RATE)
    assert band[0] < 700.0 < band[1]
    assert band[0] > 60.0
    lines = sorted(f for f, _ in envelope_spectrum(x, RATE, band).strongest(4))
    assert lines == pytest.approx([12.5, 25.0, 37.5, 50.0], abs=0.06)


def test_a_band_holds_the_orders_of_a_shaft_that_is_known():
    """A train of shocks that skips a sample once: to long segments that is the one event."""
    x = np.roll(shocks(40_000, 80, 500.0), 20)
    x[20_000:] = x[19_999:-1]
    x += 0.05 * noise(40_000)
    low, high = shock_band(x, RATE)
    assert high - low < 4 * 25.0
    band = shock_band(x, RATE, turn=80 / RATE)
    assert band[1] - band[0] >= 16 * 25.0
    assert band[0] < 500.0 <= band[1]
    lines = sorted(f for f, _ in envelope_spectrum(x, RATE, band).strongest(3))
    assert lines == pytest.approx([25.0, 50.0, 75.0], abs=0.06)


def test_a_band_of_rounding_is_not_that_of_shocks():
    """A carrier of 200 Hz that swells at 7 Hz, with twelve digits as in a file."""
    t = np.arange(20_000) / RATE
    swell = 1.0 + 0.5 * np.cos(math.tau * 7.0 * t)
    x = np.array([float(f'{v:.12g}') for v in swell * np.cos(math.tau * 200.0 * t)])
    band = shock_band(x, RATE)
    assert band[0] < 200.0 < band[1]
    assert band_share(x, RATE, band) == pytest.approx(1.0, abs=1e-3)
    assert envelope_spectrum(x, RATE, band).strongest(1)[0][0] == pytest.approx(7.0, abs=0.1)
    assert band_share(x, RATE, (250.0, 0.5 * RATE)) < 1e-20


def test_spectral_kurtosis_of_noise_sines_and_shocks():
    of_noise = spectral_kurtosis(noise(100_000), RATE, 64).values
    assert np.abs(of_noise).max() < 0.2
    assert of_noise[1:-1].mean() == pytest.approx(0.0, abs=0.02)
    assert spectral_kurtosis(sine(500.0, 10_000), RATE, 64).values[16] == pytest.approx(-1.0)
    of_shocks = spectral_kurtosis(shocks(40_000, 400, 700.0, 400.0) + 0.01 * noise(40_000), RATE)
    at = int(np.argmax(of_shocks.values))
    assert of_shocks.frequency[at] == pytest.approx(700.0, abs=150.0)
    assert of_shocks.values[at] > 1.0


def test_indicators_are_those_of_scipy_and_of_a_sine():
    x = noise(999) ** 3
    found = indicators(x)
    assert found.kurtosis == pytest.approx(stats.kurtosis(x, fisher=False), rel=1e-12)
    assert found.skewness == pytest.approx(stats.skew(x), rel=1e-12)
    assert found.clearance == pytest.approx(
        np.abs(x).max() / np.mean(np.sqrt(np.abs(x))) ** 2, rel=1e-12
    )
    tone = indicators(sine(1.0, 200_000, 0.0))
    assert tone.crest == pytest.approx(math.sqrt(2.0), rel=1e-6)
    assert tone.kurtosis == pytest.approx(1.5, rel=1e-9)
    assert tone.shape == pytest.approx(math.pi / (2.0 * math.sqrt(2.0)), rel=1e-6)
    assert tone.impulse == pytest.approx(math.pi / 2.0, rel=1e-6)
    # (mean sqrt|sin|)^2 = (Gamma(3/4) / (sqrt(pi) Gamma(5/4)))^2
    mean_root = math.gamma(0.75) / (math.sqrt(math.pi) * math.gamma(1.25))
    assert tone.clearance == pytest.approx(mean_root**-2, rel=1e-4)


def test_indicators_do_not_depend_on_blocks():
    x = noise(5000) + 3.0
    moments = Moments()
    for block in np.split(x, [1, 10, 10, 777, 4999]):
        moments.add(block)
    whole, pieces = vars(indicators(x)), vars(moments.indicators())
    assert pieces == pytest.approx(whole, rel=1e-10)


def test_indicators_of_signals_that_say_nothing():
    still = indicators(np.full(10, 2.0))
    assert (still.rms, still.peak, still.crest) == (2.0, 2.0, 1.0)
    assert still.kurtosis is still.skewness is None
    silent = indicators(np.zeros(10))
    assert silent.crest is silent.shape is silent.impulse is silent.clearance is None
    with pytest.raises(ValueError, match='without samples'):
        indicators([])


def ramp(seconds=10.0):
    """Turns of a shaft that goes from 2 to 12 turns a second, at the sampling times."""
    t = np.arange(int(seconds * RATE)) / RATE
    return 2.0 * t + 0.5 * t**2


def test_an_order_stays_a_line_while_the_speed_changes():
    turned = ramp()
    x = np.cos(math.tau * 8.0 * turned + 0.3) + 0.5 * np.cos(math.tau * 2.5 * turned)
    turns = at_equal_angles([turned], [x])
    assert turns.values.shape[0] == 70 - 1  # at 69.99... turns it ends
    found = order_spectrum(TurnSegments(turns.values[:68], turns.first[:68]))
    lines = dict(found.strongest(2))
    assert lines == pytest.approx({8.0: 1.0, 2.5: 0.5}, rel=1e-4)
    off = (np.abs(found.frequency - 8.0) > 1e-9) & (np.abs(found.frequency - 2.5) > 1e-9)
    assert found.values[off].max() < 1e-3
    assert amplitude(x, RATE).values.max() < 0.2  # over frequency it is smeared


def test_the_average_keeps_what_repeats_and_the_residual_has_the_rest():
    turned = ramp()
    repeats = np.cos(math.tau * 3.0 * turned)
    turns = at_equal_angles([turned], [repeats + 0.1 * noise(len(turned))], 128)
    assert turns.mean == pytest.approx(np.cos(3.0 * turns.angle), abs=0.1)
    assert np.std(turns.mean - np.cos(3.0 * turns.angle)) < 0.02
    assert turns.residual.mean(axis=0) == pytest.approx(0.0, abs=1e-12)
    assert turns.spread.mean() == pytest.approx(0.1, rel=0.15)


def test_runs_with_gaps_between_keep_their_turns_apart():
    turned = ramp()
    x = np.sin(math.tau * turned)
    halves = [slice(0, 9000), slice(9500, None)]
    turns = at_equal_angles([turned[h] for h in halves], [x[h] for h in halves], 64)
    assert [len(s) for s in turns.series()] == [64 * k for k in (19, 49)]
    assert turns.values == pytest.approx(
        np.tile(np.sin(turns.angle), (len(turns.values), 1)), abs=1e-6
    )


def test_a_record_of_one_turn_from_a_trigger_is_a_turn():
    """As long as the turn, less one sample: the angle of its end is that of the next start."""
    turned = 3.0 + np.arange(400) / 400.0
    turns = at_equal_angles([turned], [np.sin(math.tau * turned)])
    assert turns.values.shape == (1, 400)
    assert turns.first.tolist() == [3]


def test_a_shaft_that_turns_back_has_no_orders():
    with pytest.raises(ValueError, match='turns back'):
        at_equal_angles([np.array([0.0, 1.0, 0.5])], [np.zeros(3)])
    with pytest.raises(ValueError, match='no whole turn'):
        at_equal_angles([np.linspace(0.1, 1.05, 90)], [np.zeros(90)])


@pytest.mark.parametrize('segment', [None, 1000, 4097])
def test_segments_of_a_long_signal_are_those_of_the_whole(segment):
    """As many as there are, by SciPy in one go; they are transformed block by block."""
    x = noise(2**18 + 70_001)
    length = segment or 2 ** int(math.log2(len(x) / 8 + 1))
    expected = signal.welch(x - x.mean(), RATE, 'hann', length, detrend=False)[1]
    assert power([x], RATE, segment).values == pytest.approx(expected, rel=1e-12)


def test_a_long_signal_over_the_angle_is_one_spline():
    """The same as of all samples at once, in a sixth of its memory."""
    t = np.arange(2**18 + 2**17 + 31) / RATE
    turned, x = 10.0 * t + 0.3 * np.sin(t), np.cumsum(noise(len(t)))
    tracemalloc.start()
    found = at_equal_angles([turned], [x], 100)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 120 * len(t)
    grid = np.add.outer(found.first, np.arange(100) / 100.0).ravel()
    expected = interpolate.make_interp_spline(turned, x, k=5)(grid)
    assert found.values.ravel() == pytest.approx(expected, abs=1e-11 * np.abs(x).max())


def test_a_long_signal_loses_few_samples_to_be_transformed_quickly():
    for count in (2**18 + 1, 300_007, 5_142_859, 2 * 4_999_999):
        kept = left = len(quickly_transformed(np.zeros(count)))
        for prime in (2, 3, 5, 7, 11):
            while left % prime == 0:
                left //= prime
        assert (left, 0.993 * count < kept <= count) == (1, True)
    assert len(quickly_transformed(np.zeros(262_139))) == 262_139


def test_turns_are_taken_together_where_a_multiple_of_them_is_over():
    values = np.arange(14.0).reshape(7, 2)
    found = TurnSegments(values, np.array([1, 2, 3, 4, 6, 8, 9])).together(2)
    assert found is not None
    assert found.first.tolist() == [2, 8]
    assert found.values.tolist() == [[2, 3, 4, 5], [10, 11, 12, 13]]
    assert found.angle == pytest.approx(np.arange(4) * math.pi)
    assert [len(x) for x in found.series()] == [4, 4]
    assert TurnSegments(values[:1], np.array([2])).together(2) is None
