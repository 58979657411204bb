"""Fixtures of tests of sweeps."""

from __future__ import annotations

import pytest
import running

from mechanism_sim.studies.runs import compute


@pytest.fixture
def in_this_process(monkeypatch):
    """Runs of a sweep need no processes."""
    monkeypatch.setattr(
        'mechanism_sim.studies.runs.Workers._in_processes', lambda _, tasks: map(compute, tasks)
    )
    monkeypatch.setattr(running, 'workers_apart', False)
