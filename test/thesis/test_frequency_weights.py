"""Noise fading: what stays, what goes, and what a window does to it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from mechanism_sim.errors import InputError
from mechanism_sim.thesis.reconstruction import (
    band_pass,
    both,
    fade,
    invert,
)

RATE = 2700.0
T = np.arange(2700) / RATE


def tone(frequency, amplitude=1.0, phase=0.3):
    return amplitude * np.sin(2.0 * np.pi * frequency * T + phase)


def test_a_tone_in_the_band_stays_and_one_outside_goes():
    """Both are whole numbers of periods long, so the rectangular window does not smear them."""
    found = fade(tone(50.0) + tone(400.0), RATE, band_pass(50.0, 399.0))
    assert np.abs(found - tone(50.0)).max() < 1e-12


def test_edges_fall_as_half_a_cosine():
    weight = band_pass(100.0, 200.0, edge=40.0)
    f = np.array([50.0, 60.0, 80.0, 100.0, 150.0, 200.0, 210.0, 220.0, 240.0, 300.0])
    fall = 0.5 + 0.5 * np.cos(np.pi * 10.0 / 40.0)
    assert weight(f) == pytest.approx([0, 0, 0.5, 1, 1, 1, fall, 0.5, 0, 0], abs=1e-12)


def test_what_a_rectangular_window_smears_into_the_band_stays():
    """[SB] 7.2 says that its noise is offset on the way back: not when something was faded."""
    kept = fade(tone(1000.37), RATE, band_pass(0.0, 900.0))
    assert np.sqrt(np.mean(kept[400:-400] ** 2)) > 1e-4


@pytest.mark.parametrize('length', [None, 256, 333])
def test_where_nothing_is_faded_the_signal_stays(length):
    x = np.random.default_rng(1).normal(size=len(T))
    assert np.abs(fade(x, RATE, band_pass(0.0, RATE), length) - x).max() < 1e-12


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


@pytest.mark.parametrize('length', [1, 5000])
def test_windows_that_cannot_be_are_refused(length):
    with pytest.raises(InputError, match=f'a window of {length} samples does not fit a record'):
        fade(tone(50.0), RATE, band_pass(0.0, 100.0), length)
