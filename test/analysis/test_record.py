"""Bags against the runs they hold, by other readers, other formulas and other sums."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from bags import angle_at, messages_of
from builders import PLAY, ROUGH, simulated
from running import run as command

import mechanism_sim as ms
from mechanism_sim.analysis.collectors import Signal
from mechanism_sim.analysis.deviation import Deviation, alpha, deviation, ideal_machine
from mechanism_sim.analysis.record import Record, machine_of, pieces, read_record
from mechanism_sim.analysis.roses import impact_cycles, impact_rose, wear_maps
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError, RunWarning
from mechanism_sim.messages import events, message_class, serialize
from mechanism_sim.messages.segments import pack
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
from mechanism_sim.scene import scene_names
from mechanism_sim.sensing.spectra import TurnSegments, order_spectrum
from mechanism_sim.studies.run_bag import RunBag

SCENE, JOINT = 'four_bar_clearance', 'coupler_rocker'


def recorded(path, record):
    """The bag of a simulated run, without middleware."""
    solution = record.piece
    with RunBag(path, record.machine, solution.duration) as bag:
        half = len(solution.motion) // 2
        for part in (slice(None, half), slice(half, None)):
            bag.add(_cut(solution, part))
    return path


def _cut(solution, part):
    motion = solution.motion
    curve = type(motion.curve)(
        *(getattr(motion.curve, n)[part] for n in motion.curve.__match_args__)
    )
    rest = (getattr(motion, n)[part] for n in ('modes', 'approach', 'torques'))
    begin, end = curve.start[0], curve.end if part.stop is None else curve.start[-1]
    inside = [i for i in solution.impacts if (i.t > begin or part.start is None)
              and (i.t <= end or part.stop is None)]  # fmt: skip
    return replace(solution, motion=type(motion)(curve, *rest), impacts=inside, modes=[])


@pytest.fixture(scope='module')
def rough():
    """A run with friction: impacts, sliding and following."""
    return simulated('four_bar_clearance', ROUGH, revolutions=6)


@pytest.fixture(scope='module')
def bag(rough, tmp_path_factory):
    return recorded(tmp_path_factory.mktemp('bags') / 'rough.mcap', rough)


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', scene_names())
def test_the_machine_of_every_scene_comes_back_from_its_description(tmp_path, name):
    machine = ms.load_scene(name)
    path = tmp_path / f'{name}.mcap'
    with BagWriter(path) as writer:
        writer.add_topic('/scene', 'std_msgs/msg/String', Qos())
        text = message_class('std_msgs/msg/String')(data=events.describe(machine))
        writer.write('/scene', serialize(text), 0)
    found = machine_of(path)
    assert found.name == name
    assert found.scene == machine.scene
    assert found.fingerprint == machine.fingerprint


def test_a_bag_tells_what_the_run_would_have_told(rough, bag):
    found = read_record(bag)
    t = np.linspace(0.0, rough.end, 301)
    own, told = rough.piece.sample(t), found.piece.sample(t)
    assert own.keys() == told.keys()
    for name, column in own.items():
        assert told[name] == pytest.approx(column, rel=1e-12, abs=1e-12), name
    assert np.array_equal(
        found.piece.motion.curve.coefficients, rough.piece.motion.curve.coefficients
    )
    assert len(found.piece.impacts) == len(rough.piece.impacts) > 20


@pytest.mark.slow
@pytest.mark.network
def test_a_signal_that_was_not_recorded_follows_from_the_motion(tmp_path):
    path = tmp_path / 'run.mcap'
    noisy = 'sensors.rocker_accelerometer.noise.rms=0.5 m/s^2'
    done = command(
        'run', 'four_bar_clearance', '--revolutions', '3', '--record', str(path), '--set', noisy
    )
    assert done.returncode == 0, done.stderr
    found = read_record(path)
    told = found.signals['rocker_accelerometer']
    again = Record(found.machine, found.piece, {}).signal('rocker_accelerometer')
    assert np.array_equal(told.longest, again.longest)
    assert (told.starts, told.rate, told.quantity) == (again.starts, again.rate, again.quantity)


def test_roses_are_the_messages_turned_by_hand(bag):
    rose = impact_rose(read_record(bag), JOINT)
    messages, motions = messages_of(bag, '/impacts'), messages_of(bag, '/motion')
    assert rose.time.tolist() == [m.time for m in messages]
    assert (rose.pin, rose.bushing) == ('coupler', 'rocker')
    for k, m in list(enumerate(messages))[::7]:
        for angle, link in ((rose.on_pin, 'coupler'), (rose.on_bushing, 'rocker')):
            off = angle[k] - (m.normal_angle - angle_at(motions, link, m.time))
            assert math.remainder(off, math.tau) == pytest.approx(0.0, abs=1e-9)
        crank = rose.crank_angle[k] - angle_at(motions, 'crank', m.time)
        assert math.remainder(crank, math.tau) == pytest.approx(0.0, abs=1e-9)
    impulses = sorted((m.normal_impulse for m in messages), reverse=True)
    assert rose.normal_impulse[rose.largest].tolist() == impulses[:6]


def test_turns_of_impacts_are_those_of_the_summary(bag):
    record, summary = read_record(bag), analyze(bag)
    rose = impact_rose(record, JOINT)
    cycles = impact_cycles(record, rose)
    assert cycles.count.tolist() == summary.impacts.table.count[:, 0].tolist()
    assert cycles.impulse == pytest.approx(summary.impacts.table.normal_impulse[:, 0])
    mean, _, spread = cycles.means['count']
    assert (mean, spread) == pytest.approx((cycles.count.mean(), cycles.count.std(ddof=1)))
    whole = rose.normal_impulse.sum() / len(rose)
    assert cycles.means['I_n'][0] == pytest.approx(whole)
    assert summary.impacts.joints[0].I_n == pytest.approx(whole)
    for i, row in enumerate(cycles.dominant):
        own = np.sort(rose.normal_impulse[rose.turn == i])[::-1][:3]
        assert rose.normal_impulse[row[row >= 0]].tolist() == own.tolist()
    late = impact_cycles(record, impact_rose(record, JOINT, 2), 2)
    assert late.count.tolist() == cycles.count[2:].tolist()
    hardest = [d.normal_impulse for d in summary.impacts.joints[0].dominant]
    assert hardest == rose.normal_impulse[rose.largest[:3]].tolist()


def test_wear_sums_to_friction_work_and_impulses(rough):
    bushing, pin = wear_maps(rough, JOINT)
    friction = rough.piece.balance.work.friction.sum()
    impulses = sum(i.normal_impulse for i in rough.piece.impacts)
    assert friction > 1e-3
    for found in (bushing, pin):
        assert found.work.sum() == pytest.approx(friction, rel=1e-9)
        assert found.impulse.sum() == pytest.approx(impulses, rel=1e-12)
        # Coulomb: what slides rubs with mu N
        assert 0.05 * found.load_way.sum() == pytest.approx(friction, rel=1e-6)
    assert (bushing.link, pin.link) == ('rocker', 'coupler')


def test_wear_lies_where_the_force_points():
    """Without friction the force of the pin on the bushing points to the contact.

    What lies between the middles of two sectors counts at both, by how near they are.
    """
    record = simulated('four_bar_clearance', {f'{PLAY}.restitution': 0.0}, revolutions=3)
    bushing, pin = wear_maps(record, JOINT, pin_radius=0.006)
    t = np.linspace(0.0, record.end, 30_001)
    s = record.piece.sample(t)
    x, y = (s[f'reaction.{JOINT}.{axis}'] for axis in 'xy')
    force, dt = np.hypot(x, y), t[1]
    for found, link in ((bushing, 'rocker'), (pin, 'coupler')):
        place = np.angle(np.exp(1j * (np.arctan2(y, x) - s[f'position.{link}'])))
        off = np.angle(np.exp(1j * (place - found.middles[:, None]))) / np.radians(5.0)
        by_hand = np.clip(1.0 - np.abs(off), 0.0, None) @ (force * dt)
        assert found.load == pytest.approx(by_hand, abs=0.005 * by_hand.max())
    # the contact wanders with the force, and both surfaces pass it
    w1, w2 = s['velocity.coupler'], s['velocity.rocker']
    wander = np.gradient(np.unwrap(np.arctan2(y, x)), dt)
    slip = 0.006 * (w1 - w2) + 0.254e-3 * (wander - w2)
    pressed = np.convolve(force > 0.0, np.ones(3), 'same') == 3
    way = (force * np.abs(slip))[pressed].sum() * dt
    assert pin.load_way.sum() == pytest.approx(way, rel=0.01)


def test_cycle_average_of_an_ideal_machine_is_its_closed_form():
    record = simulated('four_bar_nominal', {'drive.start_angle': '50 deg'}, revolutions=4)
    turns = record.over_turns('velocity.rocker', 24)
    assert turns.values.shape == (3, 24)
    linkage, speed = record.machine.nominal.linkage, record.machine.drive.law.coefficients[1]
    _, rates, _ = linkage.motion(turns.angle, np.full(24, speed), np.zeros(24))
    assert turns.mean == pytest.approx(rates[2], abs=1e-10)
    assert turns.spread == pytest.approx(0.0, abs=1e-9)


def test_averages_are_samples(rough):
    t = rough.times_at(2 + np.arange(12) / 12)
    columns = rough.piece.sample(t)
    for name in ('energy.dissipated', 'energy.kinetic', f'normal_force.{JOINT}', 'drive_torque'):
        assert rough.over_turns(name, 12, skip=2).values[0] == pytest.approx(columns[name])


def test_average_of_a_crank_that_turns_backwards_and_speeds_up():
    profile = {'points': [['0 s', '-60 rpm'], ['4 s', '-300 rpm']]}
    record = simulated(
        'four_bar_nominal', {'drive.profile': profile, 'drive.speed': None}, revolutions=6
    )
    turns = record.over_turns('position.rocker', 36)
    assert len(turns.values) == 6
    _, rocker = record.machine.nominal.linkage.positions(-turns.angle)
    off = np.exp(1j * (turns.values - rocker))
    assert off == pytest.approx(1.0, abs=1e-10)
    # what is said of an angle is of that angle, though it was passed the other way
    _, rocker = record.machine.nominal.linkage.positions(turns.angle)
    assert np.exp(1j * (turns.mean - rocker)) == pytest.approx(1.0, abs=1e-10)
    assert turns.by_angle(turns.values[2]) == pytest.approx(turns.mean, abs=1e-10)


def test_orders_of_a_ramp_stay_lines():
    """The rocker's position is a function of the crank's angle, whatever its speed."""
    profile = {'points': [['0 s', '60 rpm'], ['8 s', '600 rpm']]}
    record = simulated(
        'four_bar_nominal', {'drive.profile': profile, 'drive.speed': None}, revolutions=40
    )
    t = np.arange(0.0, record.end, 1e-3)
    values = record.piece.sample(t, 'position.rocker')['position.rocker']
    signal = Signal('rocker', 'rocker', 'displacement', 1e3, (0.0,), (values,))
    found = order_spectrum(signal.over_turns(record.turned))
    angle = math.tau * np.arange(512) / 512
    closed = np.abs(np.fft.rfft(record.machine.nominal.linkage.positions(angle)[1])) / 256
    whole = np.abs(found.frequency - np.round(found.frequency)) < 1e-9
    orders = found.values[whole][1:8]
    assert orders == pytest.approx(closed[1:8], rel=1e-3)
    assert found.values[~whole].max() < 1e-4 * orders[0]


def test_alpha_of_a_scaled_deviation_is_the_scale(rough):
    own = deviation(rough, 'acceleration.coupler', skip=1)
    scaled = Deviation(
        own.quantity, TurnSegments(own.ideal.values + own.values / 30.0, own.own.first), own.ideal
    )
    found = alpha(own, scaled)
    assert found.rms == pytest.approx(30.0, rel=1e-9)
    assert found.spectrum == pytest.approx(30.0, rel=1e-6)
    assert found.by_order[:50] == pytest.approx(30.0, rel=1e-6)
    assert own.modified(30.0).values == pytest.approx(scaled.own.values)
    # the power of all orders is the variance
    assert own.order_power(1).sum() == pytest.approx(own.values.var(), rel=0.1)


def test_what_has_no_clearance_does_not_deviate():
    machine = ms.load_scene('four_bar_clearance')
    ideal = ideal_machine(machine)
    record = Record(ideal, ms.simulate(ideal, revolutions=3), {})
    for name in ('acceleration.coupler', 'rocker_accelerometer', 'drive_torque'):
        assert deviation(record, name).rms == pytest.approx(0.0, abs=1e-9)
    nominal = ms.load_scene('four_bar_nominal').nominal.linkage
    assert ideal.nominal.linkage == nominal


@pytest.mark.parametrize('name', ['valve_train', 'gear_rattle', 'groove_cam', 'mesh_stiffness'])
def test_every_play_can_be_taken_out(name):
    assert ms.load_scene(name).plan.clearances
    assert not ideal_machine(ms.load_scene(name)).plan.clearances


def test_a_deviation_of_a_sensor_comes_through_its_filter():
    """An ideal machine behind the same chain: what the filter does to it is no deviation."""
    chain = {f'sensors.rocker_accelerometer.{k}': v for k, v in (
        ('anti_alias.frequency', '500 Hz'), ('noise.rms', '2 m/s^2'), ('sample_rate', '5 kHz'),
    )}  # fmt: skip
    ideal = ideal_machine(ms.load_scene('four_bar_clearance'))
    scene = ms.load_scene('four_bar_clearance', chain).scene
    machine = type(ideal)(ideal.name, ideal.scene.model_copy(update={'sensors': scene.sensors}))
    record = Record(machine, ms.simulate(machine, revolutions=6), {})
    assert deviation(record, 'rocker_accelerometer').rms == pytest.approx(2.0, rel=0.1)  # splines


def test_blocks_of_a_trigger_are_turns_and_no_gaps():
    sensor = 'sensors.rocker_accelerometer'
    trigger = {f'{sensor}.trigger': {'angle': '0 deg', 'samples': 463},
               f'{sensor}.sample_rate': '2.7 kHz'}  # fmt: skip
    record = simulated(
        'four_bar_clearance', {**ROUGH, **trigger, 'drive.start_angle': '30 deg'}, revolutions=5
    )
    signal = record.signal('rocker_accelerometer')
    assert [len(run) for run in signal.runs[:4]] == [463] * 4
    turns = record.over_turns('rocker_accelerometer')
    assert turns.first.tolist() == [1, 2, 3, 4]
    assert turns.values.shape[1] == 463


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['--spectrum', 'rocker'], "no sensor 'rocker'"),
        (['--wear', 'crank_coupler'], 'such joints of four_bar_clearance: coupler_rocker'),
        (['--average', 'speed.coupler'], 'no quantity'),
        (['--skip', '9', '--orders', 'rocker_accelerometer'], 'whole turns'),
        (['--skip', '-1', '--wear', JOINT], 'at least 0'),
        (['--envelope', 'rocker_accelerometer', '--band', '500 Hz'], '500 Hz:2 kHz'),
        (['--envelope', 'rocker_accelerometer', '--band', '1 kHz:9 kHz'], 'half the sampling'),
        (['--wear', JOINT, '--pin-radius', '3 mm'], 'friction'),
        (['--against', 'nothing.mcap'], '--deviation'),
        (['--plots', 'picture.jpg'], '.png'),
    ],
)
def test_what_cannot_be_answered_is_one_sentence(bag, options, words, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(['analyze', str(bag), *options])
    assert stopped.value.code == 2
    assert words in capsys.readouterr().err


def test_a_bag_without_its_scene_or_with_a_hole(tmp_path, rough):
    with BagWriter(tmp_path / 'empty.mcap') as writer:
        writer.add_topic('/impacts', 'mechanism_sim/msg/Impact', Qos())
        writer.write('/impacts', serialize(message_class('mechanism_sim/msg/Impact')()), 0)
    with pytest.raises(InputError, match='does not hold its scene'):
        read_record(tmp_path / 'empty.mcap')
    with RunBag(tmp_path / 'hole.mcap', rough.machine, rough.end) as writer:
        writer.add(_cut(rough.piece, slice(None, 100)))
        writer.add(_cut(rough.piece, slice(200, None)))
    with pytest.raises(InputError, match='is missing'):
        read_record(tmp_path / 'hole.mcap')


def test_a_message_of_the_motion_that_somebody_sends_again_is_left_out(tmp_path, rough):
    whole, again = tmp_path / 'whole.mcap', tmp_path / 'again.mcap'
    with RunBag(whole, rough.machine, rough.end) as writer:
        for k in range(0, len(rough.piece.motion), 100):
            writer.add(_cut(rough.piece, slice(k, k + 100)))
    recorded, motions = read_bag(whole), 0
    with BagWriter(again) as writer:
        for topic in recorded.topics.values():
            writer.add_topic(topic.name, topic.type, topic.qos or Qos())
        for name, message, time in recorded.raw():
            writer.write(name, message, time)
            motions += name == '/motion'
            if name == '/motion' and motions == 1:
                first = message
            if name == '/motion' and motions == 3:
                writer.write(name, first, time)
    assert motions > 3
    with pytest.warns(RunWarning, match='left out, as if recorded twice or.* 1 of /motion'):
        found = analyze(again)
    assert found.digest == analyze(whole).digest
    with pytest.warns(RunWarning, match='are left out'):
        assert len(read_record(again).piece.motion) == len(rough.piece.motion)


def test_messages_of_a_motion_far_off_differ_by_what_their_starts_round_away(tmp_path, rough):
    near, far, kind = tmp_path / 'near.mcap', tmp_path / 'far.mcap', 'mechanism_sim/msg/Motion'
    with RunBag(near, rough.machine, rough.end) as writer:
        for k in range(0, 40, 10):
            writer.add(_cut(rough.piece, slice(k, k + 10)))
    with BagWriter(far) as writer:
        writer.add_topic('/motion', kind, Qos())
        for _, message, time in read_bag(near).messages('/motion'):
            message.start, message.start_low = np.full(len(message.start), 2.0**60), message.start
            writer.write('/motion', serialize(message), time)
    assert sum(len(piece.motion) for piece in pieces(read_bag(far))) == 40


@pytest.mark.slow
def test_the_command_line_says_the_same_in_text_json_and_pictures(bag, tmp_path, capsys):
    def said(*more):
        with pytest.raises(SystemExit) as stopped:
            main(['analyze', str(bag), *asked, *more])
        assert stopped.value.code == 0
        return capsys.readouterr().out

    asked = ['--impacts-on', JOINT, '--wear', JOINT, '--orders', 'rocker_accelerometer',
             '--deviation', 'velocity.rocker', '--against', str(bag)]  # fmt: skip
    found = json.loads(said('--json', '--plots', str(tmp_path / 'pictures')))
    details = found['details']
    assert found['impacts']['count'] == len(details['impacts'][JOINT]['rose']['time'])
    assert sum(details['wear'][JOINT]['pin']['impulse']) == pytest.approx(
        found['impacts']['normal_impulse']
    )
    assert details['deviations']['velocity.rocker']['alpha']['rms'] == 1.0
    assert sorted(p.name for p in (tmp_path / 'pictures').iterdir()) == [
        'coupler_rocker_cycles.png', 'coupler_rocker_impacts.png', 'coupler_rocker_wear.png',
        'rocker_accelerometer_orders.png', 'velocity.rocker_deviation.png',
    ]  # fmt: skip
    text = said()
    for words in ('largest', 'I_n', 'sliding work', 'alpha over four_bar_clearance: 1 by RMS'):
        assert words in text


def test_turns_of_a_drive_that_starts_from_rest_have_their_times():
    machine = ms.load_scene('belt_drive')
    record = Record(machine, ms.simulate(machine, duration=0.2), {})
    turns = np.array([0.0, 1e-6, 0.5, 2.0])
    t = record.times_at(turns)
    assert t[0] == 0.0
    np.testing.assert_allclose(record.turned(t), turns, atol=1e-12)


def test_the_summary_has_the_vibration_of_a_bag_of_a_sweep_from_its_motion(tmp_path):
    noise = 'sensors.rocker_accelerometer.noise.rms'
    run = simulated('four_bar_clearance', {noise: '1 m/s^2'}, revolutions=2)
    file, cut = tmp_path / 'run.mcap', tmp_path / 'cut.mcap'
    some = [
        replace(run.piece, motion=part, impacts=[], modes=[])
        for part in run.piece.motion.parts(40)
    ]
    with RunBag(file, run.machine, run.end) as bag, RunBag(cut, run.machine, run.end) as other:
        for k, piece in enumerate(some):
            bag.add(piece)
            if k != 2:
                other.add(piece)
    found = analyze(file)
    (sensor,) = found.vibration
    signal = np.concatenate(run.signal('rocker_accelerometer').runs)
    assert (sensor.sensor, sensor.samples) == ('rocker_accelerometer', len(signal))
    assert sensor.rms == pytest.approx(np.sqrt(np.mean(signal**2)), rel=1e-12)
    assert sensor.peak == np.abs(signal).max()
    # loads and vibration follow from the motion: they are not missing
    assert [x.split(':')[0] for x in found.absent] == [
        'no topic linkage_state', 'no topic progress',
    ]  # fmt: skip
    shorter = analyze(cut)
    assert 0 < shorter.vibration[0].samples < len(signal)
    assert shorter.absent[-1].endswith('is missing: no vibration after it')


def test_a_bag_that_is_still_being_recorded_is_not_said_to_be_cut_short(bag, tmp_path, capsys):
    path, source = tmp_path / 'now.mcap', read_bag(bag)
    with BagWriter(path) as writer:
        for topic in source.topics.values():
            writer.add_topic(topic.name, topic.type, topic.qos or Qos())
        for name, message, t in source.raw():
            writer.write(name, message, t)
        writer.flush()
        for name, *rest in (['analyze'], ['plot', 'gap', '-o', str(tmp_path / 'gap.csv')]):
            with pytest.raises(SystemExit) as ended:
                main([name, str(path), *rest])
            assert not ended.value.code
    said = capsys.readouterr()
    assert '(STILL BEING RECORDED: what could be read is analysed)' in said.out
    assert f'{path} is still being recorded; what could be read is shown' in said.err
    assert 'cut short' not in (said.out + said.err).lower()


def test_of_a_bag_with_runs_before_and_after_a_reset_the_first_is_read(tmp_path):
    """As that of ros2 bag, which knows of no runs: motion and impacts of both were one."""
    single, both = (
        recorded(tmp_path / 'one.mcap', simulated(SCENE, duration=0.1)),
        tmp_path / 'b.mcap',
    )
    source, machine = read_bag(single), ms.load_scene(SCENE)
    names = machine.physics.coordinates, machine.physics.clearances
    with BagWriter(both) as writer:
        for topic in source.topics.values():
            writer.add_topic(topic.name, topic.type, topic.qos)
        for run in (1, 2):
            begins = pack(machine.start().drain()[0], *names, 0.0, run)  # as where a run is reset
            writer.write('/motion', serialize(begins), 0)
            for topic, message, t in source.messages():
                if hasattr(message, 'run'):
                    message.run = run
                if topic == '/drive':
                    message.valid_until *= run  # the second was to last longer
                writer.write(topic, serialize(message), t)
    with pytest.warns(RunWarning, match='was reset: what follows the first run is left out'):
        found = read_record(both)
    assert found.digest() == read_record(single).digest()
    with pytest.warns(RunWarning, match='was reset'):
        told = analyze(both)
    alone = analyze(single)
    for name in ('digest', 'impacts', 'planned_end', 'start', 'end'):
        assert told.to_json()[name] == alone.to_json()[name]
    assert alone.to_json()['impacts']
