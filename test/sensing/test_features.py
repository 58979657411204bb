"""Features of signals whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest

from mechanism_sim.sensing.indicators import FEWEST, features

RATE = 10000.0
BANDS = slice(0, 10)
HEIGHTS = slice(10, 19)
LAGS = slice(19, 28)
EDGES = 0.5 * RATE * np.geomspace(1.0 / 256.0, 1.0, 11)


@pytest.mark.parametrize('frequency', [30.0, 100.0, 333.0, 1000.0, 2000.0, 4000.0])
def test_a_tone_is_in_its_band(frequency):
    t = np.arange(40000) / RATE
    found = features(np.sin(2.0 * np.pi * frequency * t), RATE)
    assert np.argmax(found[BANDS]) == np.searchsorted(EDGES, frequency) - 1


def test_bands_of_white_noise_hold_power_by_their_width():
    x = np.random.default_rng(1).normal(size=400000)
    power = np.exp(features(x, RATE)[BANDS])
    share = np.diff(EDGES) / (EDGES[-1] - EDGES[0])
    # the lowest bands have so few lines that their number is rounded
    assert (power / power.sum())[3:] == pytest.approx(share[3:], rel=0.1)


def test_a_stronger_signal_moves_logarithms_and_no_ratios():
    x = np.random.default_rng(2).normal(size=20000)
    more = features(7.0 * x, RATE) - features(x, RATE)
    assert more[BANDS] == pytest.approx(2.0 * np.log(7.0))
    assert more[HEIGHTS] == pytest.approx(np.log(7.0))
    assert more[LAGS] == pytest.approx(0.0, abs=1e-9)


def test_bursts_are_found_in_order_of_height():
    """Blows of 20 heights on a quiet ground: the n-th highest is the n-th blow."""
    x = np.zeros(2**14)
    sizes = np.geomspace(100.0, 1.0, 40)
    places = 200 + 400 * np.random.default_rng(3).permutation(40)
    x[places] = sizes
    heights = np.exp(features(x, RATE)[HEIGHTS])
    # a blow fills all lines from a tenth of the range on: its envelope is 0.9 of its height
    assert heights[0] == pytest.approx(0.9 * sizes[8], rel=0.1)  # the 2^14/2^11 = 8 highest above
    assert heights[1] / heights[0] == pytest.approx(sizes[13] / sizes[8], rel=0.1)


def test_ringing_that_lasts_longer_is_correlated_longer():
    rng = np.random.default_rng(4)
    blows = (rng.random(40000) < 0.002) * rng.normal(size=40000)
    t = np.arange(400) / RATE
    short, long = (
        features(np.convolve(blows, np.exp(-t / d) * np.sin(9000.0 * t))[:40000], RATE)[LAGS]
        for d in (0.5e-3, 3e-3)
    )
    assert (long[:6] > short[:6]).all()


def test_stretches_are_looked_at_apart():
    rng = np.random.default_rng(5)
    x = np.concatenate([rng.normal(size=FEWEST), 3.0 * rng.normal(size=FEWEST)])
    first, second = features(x, RATE, 2).reshape(2, -1)
    assert (second - first)[BANDS][3:] == pytest.approx(2.0 * np.log(3.0), abs=0.5)
    assert first[BANDS] == pytest.approx(features(x[:FEWEST], RATE)[BANDS])


def test_chaos_moves_features_little():
    """Two signals that share no sample, of the same statistics."""
    one, other = (features(np.random.default_rng(k).normal(size=50000), RATE) for k in (6, 7))
    assert np.abs(one - other).max() < 0.2


def test_silence_has_finite_features_and_too_little_is_refused():
    assert np.isfinite(features(np.zeros(FEWEST), RATE)).all()
    with pytest.raises(ValueError, match='too few'):
        features(np.zeros(2 * FEWEST - 1), RATE, 2)
