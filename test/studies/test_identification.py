"""Identification: known machines are found again, and what cannot be known is said to be so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders import read_scene
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.analysis.measurements import measurements
from mechanism_sim.errors import InputError
from mechanism_sim.messages import (
    JointState,
    SensorBlock,
    float64_array,
    message_class,
    serialize,
)
from mechanism_sim.messages.events import describe
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
from mechanism_sim.report.studies import fit_text
from mechanism_sim.results.measured import SensorRecord
from mechanism_sim.studies.identification import Identification, identify
from mechanism_sim.studies.parameters import NAMES, parameters, read_limits
from mechanism_sim.studies.runs import Workers

SCENE = 'bearing_run_up'
JOINT = 'joints.coupler_rocker.clearance'
SHORT = {'drive.profile.points': [['0 s', '450 rpm'], ['2.5 s', '700 rpm']]}
TRUTH = {f'{JOINT}.restitution': 0.4, f'{JOINT}.friction': 0.06, f'{JOINT}.radial': 0.00017}
LIMITS = {
    'restitution': ('0.2', '0.8'),
    'friction': ('0.02', '0.25'),
    'radial': ('0.1 mm', '0.4 mm'),
}


def recorded(truth, scene, count=25000, seed=77, sensor='rocker'):
    """Record of a machine with these values, taken for the machine of a scene."""
    machine = ms.load_scene(SCENE, scene)
    samples = SensorRecord(machine, sensor, 0.0, np.zeros(count)).repeat(truth, seed)
    return SensorRecord(machine, sensor, 0.0, samples)


def wanted(signal, *names, **limits):
    return parameters(signal.machine, names, signal.sensor, limits=limits)


@pytest.mark.slow
def test_clearance_is_found_and_an_idle_parameter_is_not():
    """At a prescribed speed the crank's inertia moves nothing but the torque of its drive."""
    signal = recorded(TRUTH | {f'{JOINT}.restitution': 0.5, f'{JOINT}.friction': 0.1}, SHORT)
    idle = 'links.crank.inertia'
    limits = {'radial': LIMITS['radial'], idle: ('0.001 kg m^2', '0.004 kg m^2')}
    search = Identification([signal], wanted(signal, 'radial', idle, **limits), seed=1)
    found = search.find((24, 16))
    radial, inertia = found.estimates
    assert radial.low <= 0.00017 <= radial.high
    assert radial.high - radial.low < 0.00003
    assert radial.identified
    assert not inertia.identified
    assert found.simulations == 40
    assert found.failed == 0
    assert found.plausible
    assert 'not determined by the signal' in fit_text(found)


@pytest.mark.slow
def test_a_noise_floor_that_the_scene_does_not_know_is_noticed_or_found():
    loud = {f'{JOINT}.radial': 0.00017, 'sensors.rocker.noise.rms': 20.0}
    signal = recorded(loud, SHORT)
    limits = {'radial': ('0.12 mm', '0.25 mm')}
    mistaken = Identification([signal], wanted(signal, 'radial', **limits), seed=2).find((24,))
    assert not mistaken.plausible
    assert 'not reliable' in fit_text(mistaken)
    limits['noise'] = ('2 m/s^2', '50 m/s^2')
    found = Identification([signal], wanted(signal, 'radial', 'noise', **limits), seed=2).find(
        (32,)
    )
    radial, noise = found.estimates
    assert radial.low <= 0.00017 <= radial.high
    assert noise.low <= 20.0 <= noise.high
    assert noise.high < 2.0 * noise.low
    assert found.plausible


@pytest.mark.slow
def test_a_seed_fixes_everything_and_processes_change_nothing():
    steady = {'drive': {'speed': '600 rpm'}}
    signal = recorded(TRUTH, steady, 5000)
    names = wanted(signal, *LIMITS, **LIMITS)
    with Workers(2) as both:
        alone, twice, other = (
            Identification([signal], names, seed, workers)
            for seed, workers in ((3, None), (3, both), (4, None))
        )
        first = alone.explore(alone.low, alone.high, 4)
        same = twice.explore(twice.low, twice.high, 4)
    assert np.array_equal(first.places, same.places)
    assert np.array_equal(first.features, same.features)
    assert not np.isclose(first.places, other.explore(other.low, other.high, 4).places).any()


def test_repeated_is_what_the_machine_is_heard_to_do():
    """A second route: the channel fed with the whole solution."""
    machine = ms.load_scene(SCENE, {'drive': {'speed': '600 rpm'}})
    late = SensorRecord(machine, 'rocker', 0.1234, np.zeros(2000))
    again = late.repeat({}, 1)
    channel = machine.channel('rocker')
    channel.take(ms.simulate(machine, duration=0.4).motion)
    whole = np.concatenate([block.samples for block in channel.blocks(final=True)])
    assert len(again) == 2000
    assert np.array_equal(again, whole[1234:3234])


def bag(path, signal):
    """A bag of somebody else's: nothing but the samples of an accelerometer."""
    with BagWriter(path) as writer:
        topic, kind = '/accelerometer/rocker', 'mechanism_sim/msg/SensorBlock'
        writer.add_topic(topic, kind, Qos('reliable', 'volatile', 'keep_all', 0))
        for k in range(0, len(signal.samples), 500):
            block = SensorBlock(
                time=k / 1e4, sensor='rocker', link='rocker', sample_rate=1e4,
                quantity='acceleration', unit='m/s^2',
                samples=float64_array(signal.samples[k : k + 500]),
            )  # fmt: skip
            writer.write(topic, serialize(block), round(k * 1e5))
    return str(path)


@pytest.mark.slow
def test_the_command_takes_bags_of_several_speeds(tmp_path):
    bags, scenes = [], []
    for speed in (500, 650):
        signal = recorded(TRUTH, {'drive': {'speed': f'{speed} rpm'}}, 8000)
        bags.append(bag(tmp_path / f'{speed}.mcap', signal))
        scene = tmp_path / f'{speed}.yaml'
        scene.write_text(_yaml(speed), encoding='utf-8')
        scenes += ['--scene', str(scene)]
    options = [x for name, (a, b) in LIMITS.items() for x in ('--range', f'{name}={a}:{b}')]
    found = run_json(
        'analyze', *bags, '--fit', 'restitution,friction,radial', *scenes, *options,
        '--rounds', '32,16', '--seed', '1', '--workers', '1', '--method', 'regression',
    )  # fmt: skip
    assert found['simulations'] == 48
    assert found['plausible']
    for path, value in TRUTH.items():
        one = found['parameters'][path.rpartition('.')[2]]
        assert one['path'] == path
        assert one['low'] <= value <= one['high']


def _yaml(speed):
    """The scene with a steady drive, as a file."""
    import yaml  # noqa: PLC0415

    _, scene = read_scene(SCENE, {'drive': {'speed': f'{speed} rpm'}})
    content = scene.model_dump(mode='json', exclude_none=True)
    return yaml.safe_dump(content)


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        ({}, 'does not hold its scene'),
        ({'overrides': ['drive.speed=1 rad/s']}, '--set needs --scene'),
        ({'scenes': [SCENE], 'sensor': 'roker'}, "no sensor 'roker'; did you mean 'rocker'"),
        ({'scenes': ['four_bar_clearance']}, "no sensor 'rocker'"),
        (
            {'scenes': [SCENE], 'overrides': ['sensors.rocker.sample_rate=9 kHz']},
            'at 10000 Hz, but bearing_run_up has acceleration at 9000 Hz',
        ),
        ({'scenes': [SCENE, SCENE]}, 'one --scene'),
        ({'scenes': [SCENE], 'skip': 9.0}, 'no samples after 9 s'),
    ],
)
def test_signals_that_cannot_be_identified_are_refused(tmp_path, options, words):
    signal = recorded({}, {'drive': {'speed': '600 rpm'}}, 5000)
    with pytest.raises(InputError) as caught:
        measurements([bag(tmp_path / 'a.mcap', signal)], **options)
    assert words in str(caught.value)


@pytest.mark.usefixtures('in_this_process')
def test_a_machine_of_a_bag_with_two_is_identified_by_its_namespace(tmp_path):
    """`--fit` asked for a namespace, and refused it."""
    path, home = tmp_path / 'both.mcap', {'/left': 1.0, '/right': 2.0}
    text = message_class('std_msgs/msg/String')(data=describe(ms.load_scene(SCENE)))
    with BagWriter(path) as writer:
        for name, size in home.items():
            block = SensorBlock(
                sensor='rocker', link='rocker', sample_rate=1e4, quantity='acceleration',
                unit='m/s^2', samples=float64_array(np.full(16, size)),
            )  # fmt: skip
            states = JointState(name=['crank_joint'], position=[size])
            for topic, message in {
                'scene': text, 'motion': None, 'accelerometer/rocker': block,
                'joint_states': states,
            }.items():  # fmt: skip
                kind = message.__msgtype__ if message else 'mechanism_sim/msg/Motion'
                writer.add_topic(f'{name}/{topic}', kind, Qos())
                if message:
                    writer.write(f'{name}/{topic}', serialize(message), 0)
            states.header.stamp.sec = 1
            writer.write(f'{name}/joint_states', serialize(states), 10**9)
    for name, size in home.items():
        (found,) = measurements([(path, name)])
        assert found.samples.tolist() == [size] * 16
        of = {'sensor': 'position.crank', 'channel': 'position.crank_joint'}
        (found,) = measurements([(path, name)], **of)
        assert found.samples.tolist() == [size] * 2
    for how in ({}, {'sensor': 'position.crank', 'channel': '/right/joint_states.position'}):
        with pytest.raises(InputError, match=r'several machines \(/left, /right\): choose a'):
            measurements([path], **how)
    done = run('analyze', str(path), '--fit', 'radial', '--namespace', 'rigth')
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    assert 'no machine in namespace rigth; it has /left, /right' in done.stderr


def test_few_samples_have_no_features():
    signal = recorded({}, {'drive': {'speed': '600 rpm'}}, 2000)
    with pytest.raises(InputError, match='2000 samples of rocker are too few: 4096 are needed'):
        identify([signal], wanted(signal, 'radial'), 'regression')


@pytest.mark.slow
def test_a_signal_too_short_for_features_keeps_what_is_found_sample_by_sample():
    """Of another machine, so that no run follows: it had ended with a refusal by the other way."""
    signal = recorded({}, {'drive': {'speed': '600 rpm'}}, 200)
    noise = 100.0 * np.cumsum(np.random.default_rng(2).standard_normal(200))
    other = replace(signal, samples=noise)
    found = identify([other], wanted(other, 'radial'))
    assert found.method == 'gauss-newton'
    assert not found.plausible
    assert '200 samples of rocker are too few' in found.reason
    text = fit_text(found)
    for words in ('not reliable', '--range', '--seed', '0.08 to 0.5 mm'):
        assert words in text


@pytest.mark.usefixtures('in_this_process')
def test_the_command_refuses_in_one_sentence(tmp_path):
    done = run('analyze', str(tmp_path / 'none.mcap'), '--fit', 'radial', '--rounds', '8')
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1
    assert '--rounds' in done.stderr


def test_gaps_are_refused(tmp_path):
    signal = recorded({}, {'drive': {'speed': '600 rpm'}}, 5000)
    path = tmp_path / 'gap.mcap'
    with BagWriter(path) as writer:
        topic, kind = '/accelerometer/rocker', 'mechanism_sim/msg/SensorBlock'
        writer.add_topic(topic, kind, Qos('reliable', 'volatile', 'keep_all', 0))
        for k in (0, 3000):
            block = SensorBlock(
                time=k / 1e4, sensor='rocker', link='rocker', sample_rate=1e4,
                quantity='acceleration', unit='m/s^2',
                samples=float64_array(signal.samples[k : k + 2000]),
            )  # fmt: skip
            writer.write(topic, serialize(block), round(k * 1e5))
    with pytest.raises(InputError, match='gaps'):
        measurements([path], [SCENE])


@pytest.mark.parametrize(
    ('names', 'limits', 'words'),
    [
        (('radius',), {}, "no limits of its own.*did you mean 'radial'"),
        (('radial', 'radial'), {}, 'name every parameter once'),
        (('radial',), {'friction': ('0', '1')}, 'not varied'),
        (('radial',), {'radial': ('0.4 mm', '0.1 mm')}, 'must be larger'),
        (('radial',), {'radial': ('1 kg', '2 kg')}, 'kg'),
        (('title',), {'title': ('a', 'b')}, 'not a number'),
    ],
)
def test_wrong_parameters_are_refused(names, limits, words):
    machine = ms.load_scene(SCENE)
    with pytest.raises(InputError, match=words):
        parameters(machine, names, 'rocker', limits=limits)


def test_joints_and_noise_must_be_there():
    machine = ms.load_scene(SCENE)
    with pytest.raises(InputError, match=r"did you mean 'coupler_rocker'"):
        parameters(machine, ['radial'], 'rocker', 'coupler_roker')
    ideal = ms.load_scene('four_bar_nominal')
    with pytest.raises(InputError, match='nothing to find'):
        parameters(ideal, ['radial'], 'rocker')
    silent = ms.load_scene(SCENE, {'sensors.rocker.noise.rms': 0.0})
    with pytest.raises(InputError, match='must be larger'):
        parameters(silent, ['noise'], 'rocker')
    with pytest.raises(InputError, match='--range'):
        read_limits('--range', ['radial=0.1 mm'])
    assert [p.name for p in parameters(machine, NAMES, 'rocker')] == list(NAMES)
