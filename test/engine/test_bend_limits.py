"""Links that bend farther than the theory of small bends reaches: it is said where and when."""

from __future__ import annotations

import math
import re
import warnings

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.errors import RunError, RunWarning
from mechanism_sim.tolerances import TOLERANCES

LENGTH, SMALL = 0.3, TOLERANCES.mechanism.bends  # [m] of the rod


def at_speed(factor):
    """The elastic slider-crank, faster than it is."""
    return ms.load_scene('elastic_slider_crank', {'drive.speed': factor * 150.0})


def test_it_is_said_once_where_and_when_a_link_bends_beyond_the_theory():
    """Against the half waves that its coordinates are the amplitudes of."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter('always')
        solution = ms.simulate(at_speed(3.0), duration=0.014)
    (said,) = (str(x.message) for x in heard if issubclass(x.category, RunWarning))
    words = re.search(
        r'link rod bends by (\S+) % of its length, (\S+) m along it, at t = (\S+) s', said
    )
    share, place, t = map(float, words.groups())
    names = 'position.rod.bend1', 'position.rod.bend2'
    times = np.linspace(0.0, t, 20_001)
    q = solution.sample(times, *names)
    x = np.linspace(0.0, LENGTH, 301)
    waves = [np.sin(k * math.pi * x / LENGTH) for k in (1, 2)]
    bent = np.abs(sum(np.outer(q[n], w) for n, w in zip(names, waves, strict=True)))
    assert 100.0 * bent[-1].max() / LENGTH == pytest.approx(share, rel=2e-3)
    assert x[bent[-1].argmax()] == pytest.approx(place, abs=0.5 * LENGTH / 32)
    first = times[np.argmax(bent.max(axis=1) > SMALL * LENGTH)]
    longest = solution.motion.curve.duration.max()
    assert t - longest < first <= t


def test_nothing_is_said_of_less():
    with warnings.catch_warnings():
        warnings.simplefilter('error', RunWarning)
        ms.simulate(at_speed(1.5), duration=0.05)


def test_the_error_is_that_of_the_square():
    """17 times the square, see the two orders of joints in `test/planar/test_elastic.py`."""
    error = 17.0 * SMALL**2
    assert error == pytest.approx(TOLERANCES.mechanism.bends_error, rel=0.1)


def test_a_run_that_ends_beyond_the_theory_says_so():
    """There the equations have no mass matrix any more, and blame the position."""
    with pytest.raises(RunError, match=r'link rod bends by 26\.\d % of its length, .* beyond'):
        ms.simulate(at_speed(10.0), duration=0.01)
