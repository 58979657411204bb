"""A sample of `kills`: the run of four nodes that is killed while it records."""

import math
import signal

import kills
import pytest

pytestmark = pytest.mark.network


@pytest.mark.slow
def test_a_run_that_is_killed_leaves_no_process_and_a_bag_that_all_can_read(tmp_path, monkeypatch):
    """Judged by the CPU time that is spent and the simulated time that is lost."""
    monkeypatch.setattr(kills, 'GONE_BY_CLOCK', math.inf)  # which a busy machine makes long
    found = kills.kill(tmp_path, 'run', 'head', signal.SIGKILL, 0.0, 'recording')
    assert found.hit
    assert found.bags == 1
    assert not found.wrong, found
