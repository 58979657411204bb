"""Pace of simulated time, by a clock that is set here."""

from __future__ import annotations

import pytest

from mechanism_sim.nodes import pace as pacing
from mechanism_sim.nodes.pace import Pace


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(pacing.time, 'monotonic', lambda: now[0])
    return now


def test_a_factor_is_measured_over_seconds_only(clock):
    """Soon after a start partners have reached nothing yet, which is no slow run."""
    pace = Pace()
    pace.restart(0.0)
    clock[0] += 0.02
    assert pace.measure_factor(0.0) is None
    clock[0] += 2.98
    assert pace.measure_factor(3.1) == pytest.approx(3.1 / 3.0)
    clock[0] += 0.5  # that of before, until there is more
    assert pace.measure_factor(3.1) == pytest.approx(3.1 / 3.0)
    clock[0] += 1.5
    assert pace.measure_factor(4.1) == pytest.approx(0.5)


def test_a_factor_is_measured_from_the_time_at_which_another_was_asked_for(clock):
    pace = Pace()
    pace.restart(0.0)
    assert pace.due(0.01, 0.0) == 0.0
    clock[0] += 10.0
    assert pace.measure_factor(0.1) == pytest.approx(0.01)
    clock[0] += 1.0
    assert pace.due(100.0, 0.11) == pytest.approx(0.11)
    clock[0] += 1.0
    assert pace.measure_factor(100.0) is None
    clock[0] += 1.0
    assert pace.measure_factor(200.11) == pytest.approx(100.0)
