"""Numbers out of bags, checked against runs whose numbers can be worked out by hand."""

from __future__ import annotations

import hashlib
import json
import math
import re
import struct
import weakref
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from bags import write_bag
from builders import simulated
from scipy import stats

import mechanism_sim as ms
from mechanism_sim.analysis.collectors import VibrationCollector
from mechanism_sim.analysis.details import Wanted, find_details
from mechanism_sim.analysis.open_run import MessageRun
from mechanism_sim.analysis.record import RecordedPiece, find_topics, read_record
from mechanism_sim.analysis.summary import Crank, _Channels, analyze
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import InputError, RunWarning
from mechanism_sim.messages import JointState, message_class, serialize
from mechanism_sim.messages.events import describe
from mechanism_sim.messages.segments import motion_of
from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.recording.inventory import info, render_info
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
from mechanism_sim.report.bag import render, render_details
from mechanism_sim.sensing.indicators import Moments
from mechanism_sim.studies.plan import Extent
from mechanism_sim.studies.row import SweepTask
from mechanism_sim.studies.run_bag import RunBag
from mechanism_sim.studies.runs import compute

# A crank at 300 rpm goes round three times in 0.6 s; a rocker swings by 1 + 2 t + 3 t^2.
SPEED, PHASE, END = 10 * math.pi, 0.25, 0.6
CUTS = (0.0, 0.1, 0.25, 0.4, END)
ROCKER = np.polynomial.Polynomial([1.0, 2.0, 3.0])
IMPACTS = (  # time, joint, normal impulse; a revolution takes 0.2 s
    (0.05, 'a', 1e-3),
    (0.15, 'b', 2e-3),
    (0.30, 'a', 4e-3),
    (0.45, 'b', 8e-3),
    (0.59, 'a', 16e-3),
)


def make(name, time, **fields):
    message = message_class(f'mechanism_sim/msg/{name}')(**fields)
    if hasattr(message, 'time'):
        message.time = time
    message.header.stamp.sec, nanosec = divmod(round(time * 1e9), 10**9)
    message.header.stamp.nanosec = nanosec
    return time, message


def segments(direction=1.0):
    """The motion, segment by segment: (start, duration, turns (2,), coefficients (2, 3))."""
    for start, end in pairwise(CUTS):
        angle = direction * (PHASE + SPEED * start)
        turns = math.floor(angle / math.tau)
        moved = ROCKER(np.polynomial.Polynomial([start, 1.0])).coef
        crank = [angle - math.tau * turns, direction * SPEED, 0.0]
        yield start, end - start, [turns, 0], [crank, list(moved)]


def motion(sizes=(2, 2), degrees=(2, 2), **options):
    """Motion messages of given sizes, their polynomials padded with zeros to given degrees."""
    todo = list(segments(**options))
    for size, degree in zip(sizes, degrees, strict=True):
        now, todo = todo[:size], todo[size:]
        start, duration, turns, powers = (np.array(column) for column in zip(*now, strict=True))
        powers = np.pad(powers, ((0, 0), (0, 0), (0, degree - 2)))
        yield make(
            'Motion',
            float(start[0]),
            coordinates=['crank', 'rocker'],
            segments=size,
            degree=degree,
            start=start,
            start_low=np.zeros(size),
            duration=duration,
            turns=turns.ravel(),
            coefficients=powers.ravel(),
            joints=['a', 'b'],
            modes=np.array([1, 2] * size, dtype=np.uint8),
        )


def impacts():
    for k, (time, joint, impulse) in enumerate(IMPACTS):
        yield make(
            'Impact',
            time,
            index=k,
            joint=joint,
            normal_impulse=impulse,
            approach_speed=0.1 * (k + 1),
            normal_angle=0.5,
            energy_loss=1e-6,
        )


def changes():
    for time, joint, mode, previous in (
        (0.0, 'a', 1, 0),
        (0.0, 'b', 2, 0),
        (0.15, 'a', 2, 1),
        (0.45, 'a', 1, 2),
    ):
        yield make('ModeChange', time, joint=joint, mode=mode, previous_mode=previous)


def reactions():
    forces = {0.1: ([3.0, 0.0], [4.0, 1.0], 2.0), 0.2: ([6.0, 0.0], [8.0, -2.0], 5.0)}
    forces[0.3] = ([0.0, 0.5], [-1.0, 0.0], -7.0)
    for time, (fx, fy, torque) in forces.items():
        names = ['ground_crank', 'crank_coupler']
        yield make(
            'JointReactions',
            time,
            joints=names,
            force_x=np.array(fx),
            force_y=np.array(fy),
            drive_torque=torque,
        )


def states():
    """A balance that is out by 2^-20 J at 0.2 s and by -2^-21 J at the end."""
    for time, kinetic, potential, work, dissipated in (
        (0.0, 2.0, 1.0, 0.0, 0.0),
        (0.2, 4.0, 0.5 + 2**-20, 2.0, 0.5),
        (END, 3.0, 1.0 - 2**-21, 4.0, 3.0),
    ):
        yield make(
            'LinkageState',
            time,
            kinetic_energy=kinetic,
            potential_energy=potential,
            drive_work=work,
            dissipated=dissipated,
        )


def blocks():
    """A sine of amplitude 3 over 50 whole periods, in uneven blocks, on an offset of 4."""
    signal = 4.0 + 3.0 * np.sin(math.tau * 50 * np.arange(6000) / 6000)
    first = 0
    for size in (1, 999, 0, 2000, 3000):
        values = signal[first : first + size]
        yield make(
            'SensorBlock',
            first / 10_000,
            sensor='s1',
            link='coupler',
            sample_rate=10_000.0,
            quantity='acceleration',
            unit='m/s^2',
            samples=values,
        )
        first += size


def progress(node, finished, **counts):
    return make(
        'Progress',
        END,
        node=node,
        finished=finished,
        topics=list(counts),
        counts=np.array(list(counts.values()), dtype=np.uint64),
    )


def law():
    return make('DriveLaw', 0.0, coordinate='crank', kind=1)


def whole_run(**options):
    return {
        'drive': [law()],
        'motion': list(motion(**options)),
        'impacts': list(impacts()),
        'mode_changes': list(changes()),
        'joint_reactions': list(reactions()),
        'linkage_state': list(states()),
        'sensors': list(blocks()),
        'progress': [
            progress('linkage', False, motion=1, impacts=2),
            progress('linkage', True, motion=2, impacts=7, linkage_state=3),
            progress('crank_drive', False, drive=1),
        ],
    }


def record(path, run, prefix='/'):
    """Write a run into a bag, in the order of time."""
    rows = [
        (time, f'{prefix}{name}', message) for name, part in run.items() for time, message in part
    ]
    with BagWriter(path, overwrite=True) as writer:
        for time, topic, message in sorted(rows, key=lambda row: row[0]):
            writer.add_topic(topic, type(message).__msgtype__, Qos())
            writer.write(topic, serialize(message), round(time * 1e9))
    return path


@pytest.fixture
def summary(tmp_path):
    return analyze(record(tmp_path / 'run.mcap', whole_run()))


def test_revolutions_come_from_the_motion(summary):
    assert summary.motion.crank == 'crank'
    assert summary.motion.coordinates == ('crank', 'rocker')
    assert summary.motion.revolutions == pytest.approx(3, abs=1e-12)
    assert summary.motion.mean_speed == pytest.approx(SPEED, rel=1e-12)
    assert (summary.start, summary.end) == (0.0, END)
    assert (summary.motion.segments, summary.motion.gaps) == (4, ())
    assert summary.complete
    assert summary.absent == ()


def test_impacts_are_counted_by_revolution_and_joint(summary):
    found = summary.impacts
    assert found.count == 5
    assert found.normal_impulse == pytest.approx(31e-3)
    assert found.count_per_revolution == pytest.approx(5 / 3)
    assert found.normal_impulse_per_revolution == pytest.approx(31e-3 / 3)
    assert found.table.joints == ('a', 'b')
    assert found.table.count.tolist() == [[1, 1], [1, 0], [1, 1]]
    expected = [[1e-3, 2e-3], [4e-3, 0], [16e-3, 8e-3]]
    assert found.table.normal_impulse == pytest.approx(np.array(expected))
    assert found.table.elsewhere == 0
    a, b = found.joints
    assert (a.joint, a.count, b.count) == ('a', 3, 2)
    assert a.normal_impulse == pytest.approx(21e-3)
    assert a.energy_loss == pytest.approx(3e-6)
    assert b.largest_approach_speed == pytest.approx(0.4)


def test_means_per_revolution_have_their_intervals(summary):
    """Student's t of three turns: (2, 1, 2) impacts of 3, 4 and 24 mN s."""
    count, impulse, each = summary.impacts.means
    for found, x in ((count, [2.0, 1.0, 2.0]), (impulse, [3e-3, 4e-3, 24e-3])):
        t = 4.302652729911275  # of 2 degrees of freedom, 97.5 %
        assert found.mean == pytest.approx(np.mean(x))
        assert found.half_width == pytest.approx(t * np.std(x, ddof=1) / math.sqrt(3.0))
        assert found.revolutions == 3
    assert each.mean == pytest.approx(31e-3 / 5)
    left = np.array([3e-3, 4e-3, 24e-3]) - each.mean * np.array([2.0, 1.0, 2.0])
    width = 4.302652729911275 * math.sqrt((left**2).sum() / 2.0 / 3.0) / (5.0 / 3.0)
    assert each.half_width == pytest.approx(width)
    text = render(summary)
    rows = dict(
        re.split(r' {2,}', line.strip(), maxsplit=1)
        for line in text.split('\n\n')[1].splitlines()[1:5]
    )
    assert rows['impacts per revolution'] == '1.66667 +- 1.4 (95 %, over the last 3)'
    assert rows['normal impulse per revolution'] == '10.3333 +- 29 mN s'


def test_the_hardest_impact_is_named(summary):
    hardest = summary.impacts.dominant
    assert (hardest.time, hardest.joint) == (0.59, 'a')
    assert hardest.normal_impulse == 16e-3
    assert hardest.crank_angle == pytest.approx((PHASE + SPEED * 0.59) % math.tau, abs=1e-12)


def test_a_crank_that_turns_backwards_counts_the_same(tmp_path):
    found = analyze(record(tmp_path / 'run.mcap', whole_run(direction=-1.0)))
    assert found.motion.revolutions == pytest.approx(3, abs=1e-12)
    assert found.motion.mean_speed == pytest.approx(-SPEED, rel=1e-12)
    assert found.impacts.table.count.tolist() == [[1, 1], [1, 0], [1, 1]]


def test_shares_of_modes_are_exact(summary):
    a, b = summary.modes
    assert a.share == pytest.approx({'free_flight': 0.5, 'following': 0.5}, rel=1e-12)
    assert (a.joint, a.changes) == ('a', 2)
    assert b.share == {'following': 1.0}
    assert (b.joint, b.changes) == ('b', 0)


def test_modes_have_the_names_of_the_message():
    change = message_class('mechanism_sim/msg/ModeChange')
    assert {getattr(change, mode.name): mode for mode in Mode} == {
        mode.value: mode for mode in Mode
    }


def test_largest_forces_and_torque(summary):
    crank, coupler = summary.loads.joints
    assert (crank.name, crank.value, crank.time) == ('ground_crank', 10.0, 0.2)
    assert crank.crank_angle == pytest.approx(PHASE, abs=1e-12)
    assert (coupler.name, coupler.value, coupler.time) == ('crank_coupler', 2.0, 0.2)
    assert (summary.loads.drive_torque.value, summary.loads.drive_torque.time) == (-7.0, 0.3)
    assert summary.loads.samples == 3


def test_balance_of_energy(summary):
    energy = summary.energy
    assert (energy.initial, energy.final) == (3.0, 4.0 - 2**-21)
    assert (energy.drive_work, energy.dissipated) == (4.0, 3.0)
    assert energy.residual_at_end == -(2**-21)
    assert (energy.largest_residual, energy.largest_residual_time) == (2**-20, 0.2)
    assert energy.largest_energy == 4.0


def test_one_instant_is_no_balance_of_energy(tmp_path):
    found = analyze(record(tmp_path / 'run.mcap', {'linkage_state': list(states())[:1]}))
    assert found.energy is None
    assert found.to_json()['energy'] is None
    assert 'too few published instants, 1: no energy balance (raise outputs.' in render(found)
    assert 'energy error' not in render(found)


def test_vibration_of_a_sine(summary):
    [sensor] = summary.vibration
    assert (sensor.sensor, sensor.link, sensor.samples) == ('s1', 'coupler', 6000)
    assert sensor.rms == pytest.approx(math.sqrt(16 + 4.5), rel=1e-12)
    assert sensor.peak == pytest.approx(7.0, rel=1e-12)
    assert sensor.kurtosis == pytest.approx(1.5, rel=1e-9)
    assert sensor.missing == 0


def test_orders_are_those_of_the_samples_along_which_the_motion_is_known(tmp_path):
    """Of a recorder that came late a block of samples may begin before the motion."""
    run, late = whole_run(), whole_run()
    del run['motion'][0], late['motion'][0]
    samples = np.concatenate([block.samples for _, block in run['sensors']])
    _, block = next(blocks())
    block.time, block.samples = 0.25, samples[2500:]
    late['sensors'] = [(0.25, block)]
    (found,), (expected,) = (
        analyze(record(tmp_path / f'{k}.mcap', x)).vibration for k, x in enumerate((run, late))
    )
    assert found.samples == len(samples)
    assert found.orders
    np.testing.assert_allclose(found.orders, expected.orders, rtol=1e-12)


def test_recorded_samples_need_no_motion():
    motion, seen = simulated('four_bar_clearance', duration=0.02).piece.motion, []
    for machine in (None, ms.load_scene('four_bar_clearance')):
        channels = _Channels(machine, VibrationCollector())
        for part in (motion.between(0.0, 0.005), motion.between(0.01, 0.02)):
            channels.add(part)
        seen.append(bool(channels.lost))
    assert seen == [False, True]


def test_missing_samples_and_a_flat_signal(tmp_path):
    run = {'sensors': [block for i, block in enumerate(blocks()) if i != 3]}
    for _, block in run['sensors']:
        block.samples = np.ones(len(block.samples))
    [sensor] = analyze(record(tmp_path / 'run.mcap', run)).vibration
    assert sensor.missing == 2000
    assert (sensor.rms, sensor.kurtosis) == (1.0, None)


def test_moments_agree_with_scipy_however_the_stream_is_cut():
    x = np.random.default_rng(7).gamma(0.5, size=4001) + 1e3
    moments = Moments()
    for part in np.split(x, [1, 2, 2, 500, 3000]):
        moments.add(part)
    assert moments.rms == pytest.approx(math.sqrt(np.mean(x**2)), rel=1e-12)
    assert moments.kurtosis == pytest.approx(stats.kurtosis(x, fisher=False), rel=1e-9)


def test_losses_are_named(summary):
    ledger = summary.ledger
    accounts = {account.topic: account for account in ledger.topics}
    assert (accounts['/impacts'].sent, accounts['/impacts'].recorded) == (7, 5)
    assert accounts['/impacts'].lost == ledger.lost == 2
    assert accounts['/motion'].lost == accounts['/drive'].lost == 0
    assert (ledger.finished, ledger.unfinished) == (('linkage',), ('crank_drive',))


def test_what_a_finished_node_said_is_final(tmp_path):
    late = [progress('linkage', True, impacts=7), progress('linkage', False, impacts=2)]
    ledger = analyze(record(tmp_path / 'run.mcap', {'progress': late})).ledger
    assert (ledger.finished, ledger.topics[0].sent) == (('linkage',), 7)


def test_a_topic_that_was_never_recorded_is_a_loss(tmp_path):
    run = {'progress': [progress('cam', True, lift=10), progress('gear', True, lift=5)]}
    [account] = analyze(record(tmp_path / 'run.mcap', run)).ledger.topics
    assert (account.topic, account.sent, account.lost) == ('/lift', 15, 15)


@pytest.mark.parametrize(
    ('sizes', 'degrees'),
    [((4,), (2,)), ((1, 1, 1, 1), (2, 2, 2, 2)), ((1, 3), (2, 7)), ((3, 1), (19, 4))],
)
def test_the_digest_knows_no_batches(summary, tmp_path, sizes, degrees):
    other = record(tmp_path / 'other.mcap', whole_run(sizes=sizes, degrees=degrees))
    assert analyze(other).digest == summary.digest


def test_the_digest_is_what_it_says(summary):
    moved = hashlib.sha256()
    for start, duration, turns, powers in segments():
        moved.update(struct.pack('<3d2qq', start, 0.0, duration, *turns, 3))
        moved.update(struct.pack('<6d', *powers[0], *powers[1]) + bytes([1, 2]))
    hit = hashlib.sha256()
    for k, (time, joint, impulse) in enumerate(IMPACTS):
        hit.update(struct.pack('<q', 1) + joint.encode())
        hit.update(struct.pack('<8d', time, 0.5, 0.1 * (k + 1), 0, impulse, 0, 1e-6, 0))
    both = hashlib.sha256(b'motion' + moved.digest() + b'impacts' + hit.digest())
    assert summary.digest == both.hexdigest()


def test_the_digest_sees_every_bit():
    def digest(**changed):
        fields = {
            'start': np.array([0.0, 1.0]),
            'start_low': np.zeros(2),
            'duration': np.ones(2),
            'turns': np.array([[1], [2]]),
            'coefficients': np.array([[[0.5, 1.0]], [[0.25, 0.0]]]),
            'modes': np.array([[1], [2]]),
        }
        made = MotionDigest()
        made.add_segments(**{**fields, **changed})
        made.add_impact('a', [1.0] * 8)
        return made.hexdigest()

    def segments_digest(name, value):
        return digest(**{name: value})

    seen = {
        digest(),
        segments_digest('start', np.array([0.0, np.nextafter(1.0, 2.0)])),
        segments_digest('start_low', np.array([0.0, 1e-300])),
        segments_digest('duration', np.array([1.0, np.nextafter(1.0, 0.0)])),
        segments_digest('turns', np.array([[1], [3]])),
        segments_digest('coefficients', np.array([[[0.5, 1.0]], [[0.25, 5e-324]]])),
        segments_digest('modes', np.array([[1], [1]])),
    }
    assert len(seen) == 7
    assert digest(modes=np.empty((2, 0))) not in seen
    assert MotionDigest().hexdigest() not in seen
    hits = [('b', [1.0] * 8)]
    hits += [
        ('a', [np.nextafter(1.0, 2.0) if i == k else 1.0 for i in range(8)]) for k in range(8)
    ]
    for hit in hits:
        made = MotionDigest()
        made.add_impact(*hit)
        seen.add(made.hexdigest())
    assert len(seen) == 7 + len(hits)


def crank_of(messages, driven='crank'):
    found = Crank(driven, ())
    for message in messages:
        names = tuple(message.coordinates), tuple(message.joints)
        found.add(RecordedPiece(*names, motion_of(message)))
    return found


def test_a_recorded_crank_keeps_no_messages_in_memory():
    message = next(message for _, message in motion())
    piece, stores = motion_of(message), []

    def view(x):
        store = np.stack([x, x])  # the bytes of a message, of which its arrays are views
        stores.append(weakref.ref(store))
        return store[0]

    curve = PiecewisePolynomial(*(view(getattr(piece.curve, f.name)) for f in fields(piece.curve)))
    names = tuple(message.coordinates), tuple(message.joints)
    found = Crank('crank', ())
    found.add(RecordedPiece(*names, replace(piece, curve=curve)))
    del curve
    assert [store() for store in stores] == [None] * 5
    assert found.turned(np.array([0.0])) == pytest.approx(0.0)


def test_recorded_motion_is_evaluated_exactly():
    pieces = [motion_of(message) for _, message in motion()]
    found = PiecewisePolynomial.joined([piece.curve for piece in pieces])
    t = np.linspace(0, END, 1001)
    assert found(t)[:, 0] == pytest.approx(PHASE + SPEED * t, abs=1e-12)
    assert found(t)[:, 1] == pytest.approx(ROCKER(t), abs=1e-13)
    assert found(t, 1)[:, 0] == pytest.approx(np.full(1001, SPEED), abs=1e-12)
    assert found(t, 1)[:, 1] == pytest.approx(ROCKER.deriv()(t), abs=1e-12)
    assert found(t, 2) == pytest.approx(np.tile([0.0, 6.0], (1001, 1)), abs=1e-12)
    crank = crank_of(message for _, message in motion())
    assert crank.turned(t) == pytest.approx(5 * t, abs=1e-14)
    only = crank_of((message for _, message in motion(degrees=(2, 9))), 'rocker')
    assert np.array_equal(only.curve(t)[:, 0], found(t)[:, 1])
    assert np.concatenate([piece.modes for piece in pieces]).tolist() == [[1, 2]] * 4


def test_a_million_revolutions_lose_no_digits():
    _, message = next(motion(sizes=(1,), degrees=(2,)))
    _, later = next(motion(sizes=(1,), degrees=(2,)))
    later.start, later.turns = np.array([2e5]), np.array([10**6, 0])
    found = crank_of([message, later])
    turned = found.turned(np.array([2e5 + 2**-10]))[0]
    assert turned - 10**6 == pytest.approx(5 * 2**-10, abs=2e-10)  # one ulp of a million
    assert found.summary().gaps == ((0.1, 2e5),)


def test_lost_motion_is_a_gap_and_not_an_invention(tmp_path):
    run = whole_run(sizes=(1, 2, 1), degrees=(2, 2, 2))
    del run['motion'][1]
    path = record(tmp_path / 'run.mcap', run)
    found = analyze(path)
    assert found.motion.gaps == ((0.1, 0.4),)
    assert found.motion.revolutions == pytest.approx(3, abs=1e-12)
    assert found.impacts.table.count.tolist() == [[1, 0], [0, 0], [1, 1]]
    assert found.impacts.table.elsewhere == 2
    assert found.loads.drive_torque.crank_angle is None
    assert 'MISSING' in render(found)
    crank = crank_of(message for _, message, _ in read_bag(path).messages('/motion'))
    turned = crank.turned(np.array([0.05, 0.2, 0.5, 0.7]))
    assert np.isfinite(turned).tolist() == [True, False, True, False]
    assert crank.angle(0.2) is None


def test_contradictory_motion_is_refused():
    _, message = next(motion())
    message.segments = 3
    with pytest.raises(InputError, match='contradicts its own counts'):
        crank_of([message])
    assert crank_of([]).summary() is None
    (_, message), (_, other) = motion()
    other.coordinates = ['crank', 'slider']
    with pytest.raises(InputError, match='change during the recording'):
        crank_of([message, other])


def test_a_scene_that_makes_another_machine_gives_no_loads_of_the_motion(tmp_path):
    scene = message_class('std_msgs/msg/String')(data=describe(ms.load_scene('four_bar_nominal')))
    found = analyze(record(tmp_path / 'run.mcap', whole_run() | {'scene': [(0.0, scene)]}))
    assert found.motion.revolutions == pytest.approx(3, abs=1e-12)
    assert found.loads.samples == 3
    assert [line for line in found.absent if 'recorded by another version' in line]


@pytest.mark.parametrize('kept', whole_run())
def test_every_part_stands_alone(tmp_path, kept):
    found = analyze(record(tmp_path / 'run.mcap', {kept: whole_run()[kept]}))
    part = {'mode_changes': 'modes', 'joint_reactions': 'loads', 'linkage_state': 'energy'}
    part |= {'sensors': 'vibration', 'progress': 'ledger'}
    own = part.get(kept, kept)
    for name in ('motion', 'impacts', 'modes', 'loads', 'energy', 'vibration', 'ledger'):
        assert (getattr(found, name) is not None) == (name == own)
    assert any('no topic' in line for line in found.absent)
    json.dumps(found.to_json(), allow_nan=False)
    assert 'not in this bag' in render(found)


def test_a_cut_bag_is_analysed_as_far_as_it_goes(tmp_path):
    whole = record(tmp_path / 'run.mcap', whole_run()).read_bytes()
    cut, analysed = tmp_path / 'cut.mcap', 0
    for size in range(8, len(whole), 499):
        cut.write_bytes(whole[:size])
        if not any(topic.count for topic in read_bag(cut).topics.values()):
            with pytest.raises(InputError, match='holds no message'):
                analyze(cut)
            continue
        found, analysed = analyze(cut), analysed + 1
        assert not found.complete
        assert 'CUT SHORT' in render(found)
    assert analysed > 3


@pytest.mark.parametrize('share', [1.0, 0.5])
def test_a_run_that_ended_before_its_end_is_told_from_a_whole_one(tmp_path, share):
    """Its file is complete, its motion is not what was asked for."""
    solution = ms.simulate('four_bar_nominal', duration=0.05)
    planned = solution.duration / share
    with RunBag(tmp_path / 'run.mcap', solution.machine, planned) as bag:
        bag.add(solution)
    found = analyze(tmp_path / 'run.mcap')
    assert (found.complete, found.planned_end) == (True, planned)
    said = [line for line in render(found).splitlines() if 'ENDED EARLY' in line]
    assert len(said) == found.ended_early == (share < 1.0)
    assert not said or said[0].endswith('(ENDED EARLY: it was to last until 0.1 s)')


def test_namespaces_are_matched_and_told_apart(tmp_path, summary):
    path = record(tmp_path / 'named.mcap', whole_run(), prefix='/plant/left/')
    found = analyze(path)
    assert found.digest == summary.digest
    assert found.ledger.lost == 2
    assert analyze(path, namespace='/plant').digest == summary.digest
    with pytest.raises(InputError, match='has no machine in namespace /right'):
        analyze(path, namespace='/right')

    both = whole_run()
    run = {f'left/{name}': part for name, part in both.items()}
    run |= {f'right/{name}': part for name, part in whole_run(direction=-1.0).items()}
    path = record(tmp_path / 'both.mcap', run)
    with pytest.raises(InputError, match=r'several machines \(/left, /right\): choose a'):
        analyze(path)
    assert analyze(path, namespace='/left').digest == summary.digest
    assert analyze(path, namespace='/right/').motion.mean_speed < 0


def each_twice(rows):
    return [row for row in rows for _ in range(2)]


def one_after_the_other(rows):
    return [*rows, *rows]


def by_topic_at_each_time(rows):
    return sorted(each_twice(rows), key=lambda row: (row[2], row[0]))


@pytest.mark.parametrize('twice', [each_twice, one_after_the_other, by_topic_at_each_time])
def test_a_bag_that_was_merged_of_two_of_one_run_is_that_run(twice, tmp_path):
    """As of two recorders: impacts, samples and published instants counted twice."""
    single, merged = record(tmp_path / 'run.mcap', whole_run()), tmp_path / 'merged.mcap'
    source = read_bag(single)
    with BagWriter(merged) as writer:
        for topic in source.topics.values():
            writer.add_topic(topic.name, topic.type, topic.qos)
        for row in twice([*source.raw()]):
            writer.write(*row)
    with pytest.warns(RunWarning, match='left out, as if recorded twice') as warned:
        told = analyze(merged).to_json()
    assert '5 of /impacts' in str(warned[0].message)
    expected = analyze(single).to_json()
    for name in expected.keys() - {'bag', 'ledger'}:
        assert told[name] == expected[name], name
    lost = {x['topic']: x['lost'] for x in told['ledger']['topics']}
    assert lost == {x['topic']: x['lost'] for x in expected['ledger']['topics']}
    assert lost['/impacts'] == 2


def test_the_impacts_of_a_remapped_topic_belong_to_the_run(tmp_path, summary):
    run = whole_run()
    run['shop/hits'] = run.pop('impacts')
    found = analyze(record(tmp_path / 'remapped.mcap', run))
    assert (found.impacts.count, found.digest) == (len(IMPACTS), summary.digest)
    assert not any('impacts' in said for said in found.absent)


@pytest.mark.slow
def test_machines_of_a_bag_have_their_own_scenes_and_sensors(tmp_path):
    """One slides by a piston, in no namespace; the other turns, in one below."""
    scenes = {'': 'slider_crank_piston_driven', '/left': 'four_bar_nominal'}
    both = tmp_path / 'both.mcap'
    with BagWriter(both) as writer:
        for home, scene in scenes.items():
            single = read_bag(
                write_bag(tmp_path / f'{scene}.mcap', simulated(scene, duration=0.02))
            )
            for topic in single.topics.values():
                writer.add_topic(home + topic.name, topic.type, topic.qos or Qos())
            for name, message, time in single.raw():
                writer.write(home + name, message, time)
            state, main = f'{home}/joint_states', ms.load_scene(scene).plan.main
            writer.add_topic(state, JointState.__msgtype__, Qos())
            writer.write(state, serialize(JointState(name=[main], position=[0.0])), 0)
    assert info(both).scenes == {home or '/': scene for home, scene in scenes.items()}
    said = f'scene:      {scenes[""]} in /, {scenes["/left"]} in /left'
    assert said in render_info(info(both))
    for home, scene in (('/', scenes['']), ('left', scenes['/left']), ('/left', scenes['/left'])):
        alone = analyze(tmp_path / f'{scene}.mcap')
        found, expected = analyze(both, namespace=home).to_json(), alone.to_json()
        for part in found.keys() - {'bag', 'ledger'}:
            assert found[part] == expected[part], part
    run = MessageRun(read_bag(both))
    assert run.one('/left/joint_states.position[crank]').unit == 'rad'
    assert run.one('/joint_states.position[piston]').unit == 'm'
    for read in (analyze, ms.open_run):
        with pytest.raises(InputError, match="in namespace lef; did you mean '/left'"):
            read(both, namespace='lef')


@pytest.mark.parametrize('left', ['/left', ''])
def test_sensors_of_two_machines_are_not_one_signal(left, tmp_path):
    """Of a bag with nothing else, as `ros2 bag record` makes it, the samples were mixed.

    A machine in no namespace could not be chosen.
    """
    path, sensor = tmp_path / 'sensors.mcap', 'accelerometer/rocker'
    with BagWriter(path) as writer:
        for topic in (f'{left}/{sensor}', f'/right/{sensor}', '/right/accelerometer/crank'):
            _, block = make('SensorBlock', 0.0, sensor=topic.rpartition('/')[2])
            writer.add_topic(topic, block.__msgtype__, Qos())
            writer.write(topic, serialize(block), 0)
    bag = read_bag(path)
    with pytest.raises(InputError, match=rf'several machines \({left or "/"}, /right\): choose a'):
        find_topics(bag)
    found = find_topics(bag, 'right')['sensors']
    assert found == ('/right/accelerometer/crank', f'/right/{sensor}')
    assert find_topics(bag, left or '/')['sensors'] == (f'{left}/{sensor}',)


def test_text_and_json_say_the_same(summary):
    data = json.loads(json.dumps(summary.to_json(), allow_nan=False))
    assert data['impacts']['table']['count'] == [[1, 1], [1, 0], [1, 1]]
    assert data['impacts']['dominant']['joint'] == 'a'
    assert data['modes'][0]['share']['following'] == pytest.approx(0.5)
    assert data['ledger']['lost'] == 2
    assert data['energy']['largest_residual'] == 2**-20
    text = render(summary)
    for part in (
        '3 revolutions, 300 rpm',
        'impacts                        5',
        'hardest impact in a: 0.016',
        '2 of 13 are LOST',
    ):
        assert part in text
    assert summary.digest in text
    assert max(map(len, text.splitlines()[1:])) < 100


def test_a_long_table_leaves_its_middle_out(tmp_path):
    later = []
    for k in range(40):
        time, message = next(motion(sizes=(1,), degrees=(2,)))
        message.start = message.start + 0.1 * k
        message.turns, message.coefficients = (
            np.array([k // 2, 0]),
            message.coefficients + np.array([math.pi * (k % 2), 0, 0, 0, 0, 0]),
        )
        later.append((time + 0.1 * k, message))
    hits = [
        make('Impact', 0.2 * k + 0.05, index=k, joint='a', normal_impulse=1.0) for k in range(20)
    ]
    found = analyze(record(tmp_path / 'run.mcap', {'motion': later, 'impacts': hits}))
    assert found.impacts.table.count.tolist() == [[1]] * 20
    lines = render(found).splitlines()
    assert '  ...' in lines
    assert sum(line.split()[1:] == ['1', '1'] for line in lines) == 12


@pytest.mark.slow
def test_angles_are_of_the_named_drive(tmp_path):
    """The motor of this machine turns twice as fast as its crank; the angle is the motor's."""
    machine = ms.load_scene('whole_machine')
    bag = tmp_path / 'whole.mcap'
    compute(SweepTask('', machine.name, machine.scene, Extent(None, 0.15, 0.0), bag))
    found = analyze(bag)
    text = render(found)
    hardest = max(
        (d for j in found.impacts.joints for d in j.dominant), key=lambda d: d.normal_impulse
    )
    solution = ms.simulate(machine, duration=0.15)
    own = solution.sample(np.array([hardest.time]))
    motor, crank = (np.degrees(own[f'position.{x}'][0]) % 360.0 for x in ('motor', 'crank'))
    assert abs(motor - crank) > 1.0
    assert found.motion.crank == 'motor'
    assert f', motor at {motor:.4g} deg, ' in text
    assert 'crank at' not in text
    (head,) = (line for line in text.splitlines() if 'largest' in line and 'at [s]' in line)
    assert head.split()[:5] == ['joint', 'largest', 'at', '[s]', 'motor']


def test_impacts_by_direction_name_the_drive(tmp_path):
    machine = ms.load_scene('whole_machine')
    bag = tmp_path / 'whole.mcap'
    compute(SweepTask('', machine.name, machine.scene, Extent(None, 0.15, 0.0), bag))
    text = render_details(find_details(read_record(bag), Wanted(impacts=['coupler_rocker'])))
    assert 'motor [deg]' in text
    assert 'drive [deg]' not in text
