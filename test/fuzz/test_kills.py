"""A sample of `kills`: the run of four nodes that is killed while it records."""

import signal

import kills


def test_a_run_that_is_killed_leaves_no_process_and_a_bag_that_all_can_read(tmp_path, monkeypatch):
    monkeypatch.setattr(kills, 'GONE', 60.0)  # how soon is measured on a quiet machine
    monkeypatch.setattr(kills, 'LOST', 60.0)
    found = kills.kill(tmp_path, 'run', 'head', signal.SIGKILL, 0.3, 'recording')
    assert found.hit
    assert found.bags == 1
    assert not found.wrong, found
