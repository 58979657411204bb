"""A sample of `kills`: the run of four nodes that is killed while it records."""

import signal

from kills import kill


def test_a_run_that_is_killed_leaves_no_process_and_a_bag_that_all_can_read(tmp_path):
    found = kill(tmp_path, 'run', 'head', signal.SIGKILL, 0.3, 'recording')
    assert found.hit
    assert found.bags == 1
    assert not found.wrong, found
