"""Fixtures of tests of sweeps."""

from __future__ import annotations

import pytest


@pytest.fixture
def in_this_process(monkeypatch):
    """Runs of a sweep need no processes."""
    monkeypatch.setattr(
        'mechanism_sim.studies.sweep.run_local',
        lambda tasks, _, work: (work(task) for task in tasks),
    )
