"""Noise fading: what stays, what goes, and what a window does to it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from mechanism_sim.errors import InputError
from mechanism_sim.thesis.frequency_weights import (
    attenuate,
    band_above_noise,
    band_pass,
    both,
    fade,
    invert,
    noise_floor,
)

RATE = 2700.0
T = np.arange(2700) / RATE
WINDOWS = ['hann', 'hamming', 'blackman', 'flattop', ('kaiser', 8.6)]


def tone(frequency, amplitude=1.0, phase=0.3):
    return amplitude * np.sin(2.0 * np.pi * frequency * T + phase)


def test_a_tone_in_the_band_stays_and_one_outside_goes():
    """Both are whole numbers of periods long, so the rectangular window does not smear them."""
    found = fade(tone(50.0) + tone(60.0), RATE, attenuate([(59.0, 61.0)]))
    assert np.abs(found - tone(50.0)).max() < 1e-12
    found = fade(tone(50.0) + tone(400.0), RATE, band_pass(50.0, 399.0))
    assert np.abs(found - tone(50.0)).max() < 1e-12


def test_frequency_weights_to_a_tenth_leaves_a_tenth():
    found = fade(tone(60.0), RATE, attenuate([(55.0, 65.0)], to=0.1))
    assert np.abs(found - tone(60.0, 0.1)).max() < 1e-12


def test_edges_fall_as_half_a_cosine():
    weight = band_pass(100.0, 200.0, edge=40.0)
    f = np.array([50.0, 60.0, 80.0, 100.0, 150.0, 200.0, 210.0, 220.0, 240.0, 300.0])
    fall = 0.5 + 0.5 * np.cos(np.pi * 10.0 / 40.0)
    assert weight(f) == pytest.approx([0, 0, 0.5, 1, 1, 1, fall, 0.5, 0, 0], abs=1e-12)


@pytest.mark.parametrize('window', WINDOWS)
@pytest.mark.parametrize('length', [None, 256, 333])
def test_windows_add_up_to_the_signal(window, length):
    """Windows and their duals have constant overlap-add, at the ends of the record too."""
    x = np.random.default_rng(1).normal(size=len(T))
    assert np.abs(fade(x, RATE, band_pass(0.0, RATE), window, length) - x).max() < 1e-12


def test_the_overlap_is_one_that_scipy_calls_constant():
    assert all(signal.check_COLA(w, 256, 192) for w in ('hann', 'hamming', 'blackman'))


@pytest.mark.parametrize('window', ['hann', 'blackman', ('kaiser', 12.0)])
def test_overlapping_windows_leave_a_tone_in_the_band_alone(window):
    """As far as the skirts of the window reach into what is faded."""
    kept = fade(tone(301.3), RATE, band_pass(0.0, 700.0), window, 300)
    inner = slice(300, -300)
    leak = {'hann': 3e-5, 'blackman': 2e-6}.get(window, 1e-6)
    assert np.abs(kept - tone(301.3))[inner].max() < leak


def test_what_a_rectangular_window_smears_into_the_band_stays():
    """[SB] 7.2 says that its noise is offset on the way back: not when something was faded."""
    off = tone(1000.37)
    left = {
        window: np.sqrt(np.mean(fade(off, RATE, band_pass(0.0, 900.0), window)[400:-400] ** 2))
        for window in ('boxcar', ('kaiser', 14.0))
    }
    assert left['boxcar'] > 1e-4
    assert left['kaiser', 14.0] < 1e-7


def test_undoing_takes_gain_and_delay_of_a_filter_out():
    b, a = signal.butter(4, 2.0 * np.pi * 1000.0, analog=True)

    def transfer(s):
        return np.polyval(b, s) / np.polyval(a, s)

    h = transfer(2j * np.pi * np.array([300.0, 800.0]))
    read = sum(
        tone(f, abs(x), np.angle(x)) for f, x in zip((300.0, 800.0), h, strict=True)
    )  # fmt: skip
    truth = tone(300.0, phase=0.0) + tone(800.0, phase=0.0)
    found = fade(read, RATE, both(invert(transfer), band_pass(0.0, 1000.0)))
    assert np.abs(found - truth).max() < 1e-11


def test_the_noise_floor_is_that_of_the_noise_beside_tones():
    noise = 0.2 * np.random.default_rng(2).normal(size=27000)
    t = np.arange(27000) / RATE
    x = noise + 5.0 * np.sin(2.0 * np.pi * 60.0 * t) + 2.0 * np.sin(2.0 * np.pi * 180.0 * t)
    assert noise_floor(x, RATE) == pytest.approx(0.04 / (0.5 * RATE), rel=0.1)
    low, high = band_above_noise(x, RATE)
    assert low == 0.0
    assert 180.0 <= high < 230.0
    assert band_above_noise(noise, RATE) == (0.0, 0.0)


@pytest.mark.parametrize(
    ('window', 'length', 'said'),
    [
        ('hann', 5000, 'does not fit a record of 2700'),
        ('boxcar', 1, 'a window of 1 samples'),
        ('haan', 256, "window 'haan'"),
    ],
)
def test_windows_that_cannot_be_are_refused(window, length, said):
    with pytest.raises(InputError, match=said):
        fade(tone(50.0), RATE, band_pass(0.0, 100.0), window, length)
