"""Lines of a log about work that takes minutes."""

from __future__ import annotations

import re

import pytest

from mechanism_sim.report import progress


def test_the_time_left_is_by_the_pace_after_the_first_run(monkeypatch, capsys):
    """A minute of imports and compilation is no part of the pace of 9 runs of 5 s."""
    clock = [0.0]
    monkeypatch.setattr(progress.time, 'monotonic', lambda: clock[0])
    with progress.count('sweep', 10, False) as show:
        for n in range(1, 11):
            clock[0] = 60.0 + 5.0 * n
            show(n)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == 'sweep: 1 of 10'
    told = [re.fullmatch(r'sweep: (\d+) of 10, about (\d+) s left', x) for x in lines[1:]]
    assert told
    for found in told:
        assert float(found[2]) == pytest.approx(5.0 * (10 - int(found[1])))
