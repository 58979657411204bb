"""However long: the last of many revolutions is as the first, in every level and node."""

from __future__ import annotations

import pytest
from far_from_start import far_from_start
from running import run_json

import mechanism_sim as ms
from mechanism_sim.analysis import analyze
from mechanism_sim.hybrid.audit import Audit
from mechanism_sim.hybrid.digest import MotionDigest

ENDED_EARLY = (
    'gear_box', 'gear_pair', 'quick_return', 'geneva', 'ten_links', 'rack_and_pinion',
    'linear_intermittent', 'worm_drive', 'planetary', 'compound_planetary', 'helical_shafts',
    'rotary_engine', 'constant_velocity_slider',
)  # fmt: skip
"""After 17 to 400 revolutions, for closures were not closed to less than angles round."""

CUT = 'geneva', 'quick_return', 'measured_cam', 'linear_intermittent', 'offset_roller_cam'
"""Where switches cut pieces short: of these a preview had more than one."""


@pytest.mark.parametrize('name', ENDED_EARLY)
def test_loops_close_after_days_and_many_turns(name):
    machine = ms.load_scene(name)
    run = far_from_start(machine)
    run.advance(run.time + 2.5 * machine.period, final=True)
    motion, *_ = run.drain()
    audit = Audit(machine.physics)
    audit.add(motion, [])
    assert audit.max_closure_error < 1e-14


@pytest.mark.parametrize('name', ['gear_pair', 'rack_and_pinion'])
def test_many_revolutions_come_to_their_end(name):
    run = ms.stream(ms.load_scene(name), revolutions=60)
    pieces = sum(len(piece.motion) for piece in run)
    assert 16 * 60 <= pieces <= 16 * 60 + 2
    assert run.max_closure_error < 1e-13


@pytest.mark.parametrize('name', CUT)
def test_a_run_in_small_parts_has_the_pieces_of_one_at_once(name):
    """Nodes advance as far as the law is known, and look ahead for their samples."""
    machine, digests = ms.load_scene(name), []
    end = 1.3 * machine.period
    for parts in (1, 7, 61):
        run, digest = machine.start(), MotionDigest()
        for k in range(1, parts + 1):
            until = end if k == parts else end * k / parts
            run.advance(until, final=k == parts)
            motion, impacts, _ = run.drain()
            digest.add(motion, impacts)
            ahead = run.preview(until)
            if ahead is not None:
                assert ahead.curve.start[0] == run.time
                assert ahead.curve.end == pytest.approx(until, rel=1e-15)
        digests.append(digest.hexdigest())
    assert len({*digests}) == 1


@pytest.mark.parametrize(
    'name', [CUT[0], *(pytest.param(x, marks=pytest.mark.deep) for x in CUT[1:])]
)
def test_nodes_in_their_own_time_move_as_one_run_does(name, tmp_path):
    bag, period = tmp_path / 'run.mcap', ms.load_scene(name).period
    args = '--duration', str(1.3 * period)
    pace = str(4.0 * period)  # so that it takes a third of a second
    run_json('run', name, *args, '--record', str(bag), '--realtime-factor', pace)
    assert analyze(bag).digest == run_json('solve', name, *args)['digest']
