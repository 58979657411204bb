"""Long records and parts of them: memory that grows with them, and starts far from zero."""

from __future__ import annotations

import tracemalloc
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from builders import ROUGH, made, simulated
from running import run_json

import mechanism_sim as ms
from mechanism_sim.analysis.deviation import deviation, ideal_record
from mechanism_sim.analysis.record import read_record
from mechanism_sim.analysis.series import Series, joined
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.engine.dense_output import GrowingMotion, Motion
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.errors import RunWarning
from mechanism_sim.messages import message_class, serialize
from mechanism_sim.numerics.polynomials import PiecewisePolynomial, exact_sum
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
from mechanism_sim.signal_files import read_signals
from mechanism_sim.studies.run_bag import RunBag

SENSOR, QUANTITY = 'rocker_accelerometer', 'acceleration.rocker'
YEAR = 180_000_000
"""Turns at 350 rpm."""
ENGINE = """
links:
  crank: {length: 25 mm, mass: 0.6 kg, inertia: 250 kg mm^2}
  rod: {length: 100 mm, mass: 0.15 kg, inertia: 230 kg mm^2}
  piston: {mass: 0.2 kg}
joints:
  main: {revolute: [ground, crank]}
  big_end: {revolute: [crank.end, rod]}
  small_end: {revolute: [rod.end, piston]}
  bore: {prismatic: [ground, piston], axis: 90 deg}
drive: {coordinate: crank, speed: 3000 rpm}
loads:
  gas: {at: piston, force: [0 N, "-5000*exp(6*(sin((crank - 0.3)/2) - 1))"]}
guess: {rod: 90 deg, piston: 125 mm}
duration: 0.13 s
"""


def motion(count, degree=20, first=0):
    """Segments of a millisecond with polynomials of any degree."""
    rng = np.random.default_rng(first)
    start = 1e-3 * (first + np.arange(count))
    curve = PiecewisePolynomial(
        start, 1e-20 * start, np.full(count, 1e-3), np.full((count, 3), first),
        rng.normal(size=(count, 3, degree + 1)),
    )  # fmt: skip
    modes = rng.integers(0, 3, (count, 2), np.uint8)
    return Motion(curve, modes, np.zeros((count, 0)), np.zeros((count, 1, 3)))


def peak_of(call):
    """Bytes that a call has taken at most beside what was there, and its result."""
    tracemalloc.start()
    try:
        result = call()
        return tracemalloc.get_traced_memory()[1], result
    finally:
        tracemalloc.stop()


def size(m):
    return sum(x.nbytes for x in (*m.curve.columns, *m.columns))


def test_a_motion_grows_in_the_memory_of_itself():
    """Of parts of unequal degree, too; joined at the end it would be there twice."""

    def grown(degrees):
        growing = GrowingMotion()
        for k, degree in enumerate(degrees):
            growing.add(motion(500, degree, 500 * k))
        return growing.whole()

    peak, found = peak_of(lambda: grown([20] * 40))
    assert peak < 1.4 * size(found)
    for degrees in ([20] * 40, [3, 20, 7], [5]):
        expected = Motion.joined([motion(500, d, 500 * k) for k, d in enumerate(degrees)])
        found = grown(degrees)
        pairs = zip(
            (*found.curve.columns, *found.columns), (*expected.curve.columns, *expected.columns),
            strict=True,
        )  # fmt: skip
        assert all(np.array_equal(a, b) for a, b in pairs)


def test_a_digest_takes_no_memory_of_the_whole_motion():
    whole, digests = motion(40_000), [MotionDigest(), MotionDigest()]
    peak, _ = peak_of(lambda: digests[0].add(whole, []))
    assert peak < 0.6 * size(whole)
    for part in whole.parts(7001):
        digests[1].add(part, [])
    assert digests[0].hexdigest() == digests[1].hexdigest()


def test_series_are_joined_as_by_a_dictionary_of_their_instants():
    rng = np.random.default_rng(2)
    times = [np.sort(rng.integers(0, 30, n) / 7.0) for n in (40, 25)]
    series = [Series(str(k), 'm', t, rng.normal(size=len(t))) for k, t in enumerate(times)]
    found, rows = joined(series), {}
    for s in series:
        seen = Counter()
        for t, value in zip(s.t.tolist(), s.values.tolist(), strict=True):
            rows.setdefault((t, seen[t]), {})[s.name] = value
            seen[t] += 1
    assert found['t'].tolist() == [t for t, _ in sorted(rows)]
    for name in '01':
        expected = [rows[key].get(name, np.nan) for key in sorted(rows)]
        np.testing.assert_array_equal(found[name], expected)
    again = replace(series[0], t=series[0].t[::-1])  # of one topic rows are as recorded
    assert joined([again, again])['t'].tolist() == again.t.tolist()


@pytest.fixture(scope='module')
def rough():
    return simulated('four_bar_clearance', ROUGH, revolutions=6)


@pytest.fixture(scope='module')
def bags(rough, tmp_path_factory):
    """The run, and the same one after a year of whole turns of the crank."""
    folder, piece = tmp_path_factory.mktemp('far'), rough.piece
    later = YEAR * rough.machine.drive.period
    c, crank = piece.motion.curve, piece.physics.coordinates.index('crank')
    start, low = exact_sum(np.full(len(c), later), c.start_low, c.start)
    turns = c.turns + YEAR * (np.arange(c.turns.shape[1]) == crank)
    moved = replace(
        piece,
        motion=replace(piece.motion, curve=replace(c, start=start, start_low=low, turns=turns)),
        impacts=[i._replace(t=i.t + later) for i in piece.impacts],
        modes=[m._replace(t=m.t + later) for m in piece.modes],
    )
    for name, run in (('near', piece), ('far', moved)):
        with RunBag(folder / f'{name}.mcap', rough.machine, run.motion.curve.end) as bag:
            bag.add(run)
    return folder / 'near.mcap', folder / 'far.mcap'


def test_a_year_later_all_is_as_at_the_start(bags):
    """Times are off by their rounding, 4 ns; sensors are sampled in another phase."""
    near, far = map(read_record, bags)
    one, other = map(analyze, bags)
    assert (other.impacts.count, other.loads.joints[0].name) == (
        one.impacts.count, one.loads.joints[0].name,
    )  # fmt: skip
    for a, b in zip(one.loads.joints, other.loads.joints, strict=True):
        assert b.value == pytest.approx(a.value, rel=1e-6)
    assert other.motion.revolutions == pytest.approx(6.0, abs=1e-9)
    assert other.vibration[0].rms == pytest.approx(one.vibration[0].rms, rel=5e-3)
    signal = far.signal(SENSOR)
    assert far.start <= signal.starts[0] < far.start + 1.001 / signal.rate
    assert signal.starts[0] * signal.rate == pytest.approx(round(signal.starts[0] * signal.rate))
    assert far.over_turns(SENSOR).first.tolist() == list(range(YEAR + 1, YEAR + 6))
    assert deviation(far, QUANTITY).rms == pytest.approx(deviation(near, QUANTITY).rms, rel=1e-6)


def test_the_ideal_machine_does_not_run_a_year_to_be_there(bags):
    far = read_record(bags[1])
    ideal = ideal_record(far)
    assert far.start - 2.01 * far.machine.drive.period < ideal.start < far.start
    t = np.linspace(far.start, far.end, 50)
    crank = far.machine.physics.coordinates.index('crank')
    own, told = (x.piece.motion.curve(t)[:, crank] for x in (far, ideal))
    # the period is rounded, and so is each time
    assert own - told == pytest.approx(0.0, abs=1e-6)


def test_impacts_whose_motion_is_lost_are_told_and_left_out(tmp_path, rough):
    middle = np.median([i.t for i in rough.piece.impacts])
    first = next(rough.piece.motion.parts(int(np.sum(rough.piece.motion.curve.start < middle))))
    file = tmp_path / 'lost.mcap'
    with RunBag(file, rough.machine, rough.end) as bag:
        bag.add(replace(rough.piece, motion=first))
    with pytest.warns(RunWarning, match='are left out, before or after it'):
        record = read_record(file)
    end = first.curve.end
    assert len(record.piece.impacts) == sum(i.t <= end for i in rough.piece.impacts)


def test_averages_of_a_four_stroke_engine_are_over_two_turns(tmp_path):
    """All repeats then; over single turns working and idle strokes would be averaged."""
    machine, file = made(ENGINE), tmp_path / 'engine.mcap'
    with RunBag(file, machine, 0.13) as bag:
        bag.add(ms.simulate(machine))
    name = 'reaction.big_end.size'
    found = run_json('analyze', str(file), '--average', name)['details']['averages'][name]
    assert (found['turns'], found['repetition'], len(found['mean'])) == (6, 2, 720)
    assert found['angle'][-1] == pytest.approx(2.0 * np.pi * (2.0 - 1.0 / 360.0))
    assert max(found['spread']) < 1e-6 * max(found['mean'])
    t = np.array(found['angle']) / machine.drive.start[1] + 2.0 * machine.drive.period
    expected = ms.simulate(machine).sample(t, name)[name]
    assert found['mean'] == pytest.approx(expected, rel=1e-9)
    torque = {'drive.torque': {'per_speed': '-0.02 N m s/rad'}}
    assert made(ENGINE, **torque).drive.repetition.turns == 2


def test_joint_states_alone_are_told_with_their_units(tmp_path):
    file, kind = tmp_path / 'states.mcap', 'sensor_msgs/msg/JointState'
    with BagWriter(file) as writer:
        writer.add_topic('/joint_states', kind, Qos())
        for k in range(64):
            message = message_class(kind)(name=['arm'], position=np.array([np.sin(0.5 * k)]))
            message.header.stamp.nanosec = 10**7 * k
            writer.write('/joint_states', serialize(message), 10**7 * k)
    (field,) = run_json('analyze', str(file))['fields']
    assert (field['quantity'], field['unit']) == ('/joint_states.position[arm]', 'rad or m')
    spectra = run_json('analyze', str(file), '--spectrum', 'position.arm')['details']['spectra']
    (found,) = spectra.values()
    assert (found['unit'], found['signal_unit']) == ('(rad or m)^2/Hz', 'rad or m')


def test_an_npz_of_objects_is_refused_in_a_sentence_of_its_own(tmp_path):
    file = tmp_path / 'objects.npz'
    np.savez(file, t=np.arange(3.0), a=np.array([{}, 1, 2], dtype=object))
    with pytest.raises(ms.InputError, match=r"array 'a' holds objects of Python: save numbers"):
        read_signals(file)
