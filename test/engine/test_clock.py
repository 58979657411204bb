"""Whole turns of angles, and bases from which a long run counts."""

from __future__ import annotations

import mpmath
import pytest

from mechanism_sim.engine.clock import take_off_turns


@pytest.mark.parametrize('angle', [0.0, 0.3, -0.3, 6.3, -6.3, 62_831.9, -1e9, 7.25e12])
def test_an_angle_is_its_whole_turns_and_a_rest_below_one(angle):
    """To the last bit of the rest, by 60 digits, however many turns there are."""
    whole, rest = take_off_turns(angle)
    with mpmath.workdps(60):
        left = mpmath.mpf(angle) - whole * 2 * mpmath.pi
        assert rest == float(left)
        assert abs(left) < 2 * mpmath.pi
    assert rest * angle >= 0.0
