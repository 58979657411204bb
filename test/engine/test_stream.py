"""Runs in pieces: the same to the last bit as whole ones, in memory that does not grow."""

from __future__ import annotations

import gc
import subprocess
import sys
import weakref

import numpy as np
import pyarrow.parquet as pq
import pytest
from four_bars import as_bytes, loose
from running import TIMEOUT, run, run_json

import mechanism_sim as ms
from mechanism_sim import tables
from mechanism_sim.engine import audit
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.engine.events import Impact, Mode, ModeChange, gains
from mechanism_sim.engine.totals import Totals
from mechanism_sim.errors import InputError
from mechanism_sim.memory import Reused
from mechanism_sim.numerics.polynomials import Nodes, gauss_nodes
from mechanism_sim.report.samples import SampleWriter
from mechanism_sim.results import run as runs

REVOLUTIONS = 25.3


@pytest.fixture(scope='module', autouse=True)
def short_pieces():
    """Many pieces of a short run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runs, 'BATCH', runs.Batch(1024, 1024))
        yield


@pytest.fixture(scope='module')
def machine():
    return loose(0.5, 'seated')


@pytest.fixture(scope='module')
def whole(machine):
    return ms.simulate(machine, revolutions=REVOLUTIONS)


@pytest.fixture(scope='module')
def stream(machine):
    return ms.stream(machine, revolutions=REVOLUTIONS)


@pytest.fixture(scope='module')
def pieces(stream):
    return list(stream)


# --- pieces are the whole -----------------------------------------------------------------------


@pytest.mark.slow
def test_pieces_joined_are_the_solution(whole, stream, pieces):
    assert len(pieces) > 4
    assert as_bytes(Motion.joined([p.motion for p in pieces])) == as_bytes(whole.motion)
    assert [i for p in pieces for i in p.impacts] == whole.impacts
    assert [c for p in pieces for c in p.modes] == whole.modes
    assert (stream.energy, stream.snapshot) == (whole.energy, whole.snapshot)
    digest = MotionDigest()
    for piece in pieces:
        digest.add(piece.motion, piece.impacts)
    assert digest.hexdigest() == whole.digest()


@pytest.mark.slow
@pytest.mark.usefixtures('pieces')
def test_totals_are_those_of_the_lists(whole, stream):
    totals = stream.totals
    assert totals.impacts == len(whole.impacts) > 500
    assert totals.mode_changes == len(whole.modes)
    assert totals.losses_of_contact == sum(c.mode is Mode.FREE_FLIGHT for c in whole.modes[1:])
    impulses = [i.normal_impulse for i in whole.impacts]
    assert totals.normal_impulse == pytest.approx(sum(impulses), rel=1e-13)
    assert totals.largest_impulse == max(impulses)
    assert totals.gains == (0, 0.0)


def test_totals_count_contacts_that_strike_together_as_one_wherever_batches_end():
    def impact(t, loss):
        return Impact(t, 'pin', 0.0, 1.0, 0.5, 1.0, 0.0, loss, 0.0, 0.0, ends_chatter=False)

    impacts = [impact(*x) for x in ((1.0, -2.0), (1.0, 3.0), (2.0, -1.0), (3.0, -2.0), (3.0, 1.5))]
    expected = [gain for gain in gains(impacts) if gain > 0.0]
    assert expected == [1.0, 0.5]
    for cut in range(len(impacts) + 1):
        totals = Totals()
        totals.add(impacts[:cut], [ModeChange(0.0, 'pin', Mode.FOLLOWING, Mode.UNKNOWN)])
        totals.add(impacts[cut:], [])
        assert totals.gains == (2, 1.5)
        assert totals.losses_of_contact == 0


@pytest.mark.parametrize('size', [1e-20, 1.0, 1e12])
def test_gains_are_told_from_rounding_in_machines_of_any_size(size):
    def gained(share):
        totals = Totals()
        args = (1.0, 'pin', 0.0, 1.0, 0.5, size, 0.0, -share * size, 0.0, 0.0)
        totals.add([Impact(*args, ends_chatter=False)], [])
        return totals.gains

    assert gained(1e-6) == (1, 1e-6 * size)
    assert gained(1e-15) == (0, 0.0)


def test_a_piece_can_be_sampled_like_the_whole(whole, pieces):
    for piece in pieces[1::2]:
        c = piece.motion.curve
        t = np.linspace(c.start[0], np.nextafter(c.end, 0.0), 50)
        expected = whole.sample(t)
        for name, column in piece.sample(t).items():
            scale = np.abs(expected[name]).max() + 1e-3
            assert np.abs(column - expected[name]).max() < 1e-12 * scale, name


def test_a_stream_goes_on_where_another_stopped(machine, whole):
    before = ms.stream(machine, revolutions=7.7)
    for _ in before:
        pass
    after = ms.stream(machine, revolutions=REVOLUTIONS, resume=before.snapshot)
    motion = Motion.joined([p.motion for p in after])
    at = whole.motion.curve.locate(motion.curve.start[:1])[0]
    assert as_bytes(motion)[4] == whole.motion.curve.coefficients[at:].tobytes()
    assert after.duration == whole.duration


def test_a_run_is_the_same_whoever_used_its_integrator_before(machine):
    """One that was left in the middle of a flight, at another speed of the drive or its own."""
    whole = ms.simulate(machine, revolutions=0.6)
    for left in (machine, ms.load_scene(machine.scene, {'drive.speed': '500 rpm'})):
        run = left.start()
        run.advance(0.0123, final=True)
        used = run._ta
        del run
        again = machine.start()
        assert again._ta is used
        again.advance(0.0234, final=True)
        del again
        assert ms.simulate(machine, revolutions=0.6).digest() == whole.digest()
    both = machine.start(), machine.start()
    assert both[0]._ta is not both[1]._ta


@pytest.mark.parametrize('length', [{'revolutions': -1.0}, {'revolutions': 1.0, 'duration': 1.0}])
def test_a_length_that_means_nothing_is_refused_before_anything_runs(machine, length):
    with pytest.raises(InputError):
        ms.stream(machine, **length)


# --- energy balance ---------------------------------------------------------------------------


SCENES = {
    'rebounds': (lambda: loose(1.0, 'centred'), 3.0),
    'seated': (lambda: loose(0.5, 'seated'), 3.0),
    'coarse': (lambda: loose(0.5, 'seated', solver__rtol=1e-7), 3.0),
    'ideal': (lambda: ms.load_scene('four_bar_nominal'), 1.0),
    'hertz': (
        lambda: loose(
            0.5,
            'seated',
            joints__coupler_rocker__clearance__contact={'law': 'hertz', 'stiffness': 1e10},
        ),
        0.5,
    ),
}


@pytest.mark.parametrize('name', SCENES)
def test_works_are_off_by_no_more_than_they_say(name):
    """Beside forty nodes a step; from twenty these differ by rounding."""
    make, revolutions = SCENES[name]
    machine = make()
    s = ms.simulate(machine, revolutions=revolutions)
    work = audit.Audit(machine.physics).add(s.motion, s.impacts)
    steady = np.flatnonzero(~audit.recovers(s.motion, np.arange(len(s.motion))))

    def drive_work(count):
        nodes, weights = gauss_nodes(count)
        seen = machine.physics.account(s.motion, steady, Nodes(tuple(nodes.tolist())))
        powers = seen.drive_power.reshape(-1, count)
        return s.motion.curve.duration[steady] * (powers @ weights)

    exact = drive_work(40)
    rounding = np.abs(drive_work(20) - exact).max() + 1e-14 * np.abs(exact)
    off = np.abs(work.drive[steady] - exact)
    assert (off <= work.error[steady] + 3.0 * rounding).all()
    assert work.error.sum() <= audit._AUDIT.promised * s.energy.exchanged


def test_books_are_what_the_observation_says(whole, machine):
    """The small function of the energy balance beside the whole one, at every eleventh step."""
    segments = np.arange(0, len(whole.motion), 11)
    places = Nodes((0.1, 0.7))
    seen = machine.physics.observe(whole.motion, segments, places)
    account = machine.physics.account(whole.motion, segments, places)
    for name in ('normal_force', 'drive_power', 'friction_power'):
        expected = getattr(seen, name)
        scale = np.abs(expected).max() + 1e-3
        np.testing.assert_allclose(getattr(account, name), expected, rtol=0, atol=1e-13 * scale)
    closed = whole.motion.closed_at(segments, places)
    assert account.closure_error == pytest.approx(np.abs(seen.gap[closed]).max(), abs=1e-15)


def test_angles_of_the_books_do_not_lose_digits_to_whole_turns(machine, whole):
    """A million turns later the powers are the same."""
    motion = whole.motion
    c = motion.curve
    later = type(c)(c.start, c.start_low, c.duration, c.turns + 1_000_000, c.coefficients)
    moved = Motion(later, motion.modes, motion.approach, motion.torques)
    here, there = (audit.Audit(machine.physics) for _ in range(2))
    for book, run_of in ((here, motion), (there, moved)):
        book.add(run_of, whole.impacts)
    assert (here.energy, here.max_closure_error) == (there.energy, there.max_closure_error)


# --- files --------------------------------------------------------------------------------------


@pytest.mark.parametrize('rate', [1000.0, 733.0])
@pytest.mark.parametrize('suffix', ['npz', 'csv', 'parquet'])
def test_samples_written_in_pieces_are_those_of_the_whole(
    tmp_path, whole, pieces, suffix, rate, monkeypatch
):
    monkeypatch.setattr(tables, '_ROW_GROUP', 1000)
    file = tmp_path / f'samples.{suffix}'
    with SampleWriter(str(file), rate) as writer:
        for piece in pieces:
            writer.add(piece)
            assert not file.exists()
    if suffix == 'npz':
        columns = dict(np.load(file))
    elif suffix == 'csv':
        heads = file.read_text().splitlines()[0].split(',')
        assert heads[0] == 't [s]'
        names = [head.partition(' [')[0] for head in heads]
        columns = dict(zip(names, np.loadtxt(file, delimiter=',', skiprows=1).T, strict=True))
    else:
        columns = {name: np.array(x) for name, x in pq.read_table(file).to_pydict().items()}
        assert pq.ParquetFile(file).num_row_groups > 2
    t = np.arange(int(whole.duration * rate) + 1) / rate
    expected = whole.sample(t)
    assert list(columns) == list(expected)
    np.testing.assert_array_equal(columns['t'], t)
    for name, column in columns.items():
        scale = np.abs(expected[name]).max() + 1e-3
        assert np.abs(column - expected[name]).max() < 1e-12 * scale, name
    assert [f.name for f in tmp_path.iterdir()] == [file.name]


def test_a_run_that_fails_leaves_no_file(tmp_path, pieces):
    def fail():
        with SampleWriter(str(tmp_path / 'samples.csv'), 1000.0) as writer:
            writer.add(pieces[0])
            writer.add(pieces[1])
            raise InputError('enough')

    with pytest.raises(InputError, match='enough'):
        fail()
    assert list(tmp_path.iterdir()) == []


# --- the command line ---------------------------------------------------------------------------


def test_json_without_events_says_the_same_but_for_the_lists():
    args = ('solve', 'four_bar_clearance', '--revolutions', '12')
    full, short = run_json(*args), run_json(*args, '--no-events')
    assert set(full) - set(short) == {'impacts', 'modes'}
    assert (short['impact_count'], short['mode_change_count']) == (
        len(full['impacts']),
        len(full['modes']),
    )
    assert short['normal_impulse'] == pytest.approx(
        sum(i['normal_impulse'] for i in full['impacts'])
    )
    for key in ('digest', 'final', 'energy', 'steps'):
        assert short[key] == full[key]


def test_no_events_without_json_is_refused():
    done = run('solve', 'four_bar_nominal', '--no-events')
    assert done.returncode == 2
    assert '--json' in done.stderr


MEASURE = """
import resource, sys
import mechanism_sim as ms
run = ms.stream(ms.load_scene('four_bar_clearance'), revolutions=1500)
peak = {}
for piece in run:
    turns = int(piece.motion.curve.end / run.machine.drive.period)
    peak[turns // 300] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(peak[0], peak[4])
"""


def test_a_piece_is_forgotten_once_the_next_is_there():
    pieces = ms.stream(ms.load_scene('four_bar_clearance'), revolutions=20)
    last, seen = None, 0
    for piece in pieces:
        if last is not None:
            if last() is not None:  # the collector takes 50 ms in a process of many tests
                gc.collect()
            assert last() is None
        last, seen = weakref.ref(piece.motion), seen + 1
        del piece
    assert seen > 3


@pytest.mark.slow
def test_memory_does_not_grow_with_the_run():
    """Of the motion of 1,200 more revolutions, 200 MB, nothing is left."""
    done = subprocess.run(
        [sys.executable, '-c', MEASURE], capture_output=True, text=True, check=True,
        timeout=TIMEOUT,
    )  # fmt: skip
    early, late = map(int, done.stdout.split())
    assert late - early < 8_000  # kB


def test_no_ctrl_c_is_lost_as_a_run_goes(machine):
    """Where Python swallows exceptions, nothing runs that a signal could interrupt."""
    run = machine.start()
    run.advance(0.01)
    run.drain()
    gone, called = weakref.ref(run), []
    gc.collect()
    gc.disable()  # it may call what is not of this run
    sys.setprofile(lambda frame, event, _: event == 'call' and called.append(frame.f_code.co_name))
    del run
    sys.setprofile(None)
    gc.enable()
    assert gone() is None
    assert not called


class Owner:
    """Somebody who has a thing for a while."""


def test_a_thing_is_used_again_by_the_next_who_asks_when_its_owner_is_gone():
    things, first, second = Reused(lambda _: 2), Owner(), Owner()
    assert things.take(first) is None
    assert things.lend('a', first) == 'a'
    assert things.take(second) is None
    things.lend('b', second)
    things.lend('c', third := Owner())  # of two kept at most
    del first, third
    assert things.take(second) == 'a'
    assert things.take(second) is None


def test_a_thing_that_does_not_fit_is_let_go():
    things = Reused(lambda _: 2)
    things.lend('a', Owner())
    assert things.take(owner := Owner(), lambda thing: thing == 'b') is None
    assert things.take(owner) is None
