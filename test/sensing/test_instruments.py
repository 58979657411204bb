"""Instruments of scenes: presets, inertial units, what nodes publish, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from running import environment, run

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.sensing.presets import PRESETS

SCENE = 'four_bar_measured'


@pytest.mark.parametrize('preset', PRESETS)
def test_a_preset_is_an_instrument_of_which_parts_can_be_changed(preset):
    sensor = {'link': 'rocker', 'instrument': preset, 'amplifier': {'low_pass': '3 kHz'}}
    machine = ms.load_scene('four_bar_clearance', {'sensors.x': sensor})
    whole, ours = PRESETS[preset], machine.scene.sensors['x']
    assert ours.amplifier.low_pass == 3000.0
    if 'high_pass' in whole['amplifier']:
        assert f'{ours.amplifier.high_pass:g} Hz' == whole['amplifier']['high_pass']
    chain = machine.channel('x').instrument
    assert chain.transducer.natural_frequency > 4e4
    middle = chain.transfer()(2j * np.pi * 100.0)
    assert abs(middle) == pytest.approx(1.0, abs=2e-3)  # in the pass band it reads acceleration


def test_the_chain_of_the_thesis_loses_3_db_at_its_corners():
    """Type 2635: 2 Hz (6 dB an octave) to 1 kHz (12 dB an octave)."""
    chain = ms.load_scene(SCENE).channel('coupler').instrument.transfer()
    decibels = 20.0 * np.log10(np.abs(chain(2j * np.pi * np.array([2.0, 1e3, 1e-3, 1e4, 2e4]))))
    assert decibels[:2] == pytest.approx([-3.01, -3.01], abs=0.01)
    assert decibels[2] == pytest.approx(20.0 * np.log10(1e-3 / 2.0), abs=0.01)
    assert decibels[3] - decibels[4] == pytest.approx(12.0, abs=2.0)  # nearing the resonance


@pytest.mark.parametrize(
    ('scene', 'sensor'),
    [
        ('four_bar_clearance', {'link': 'rocker', 'at': '150 mm', 'impact_pulse': '0.1 ms'}),
        ('four_bar_clearance', {'link': 'rocker', 'at': '150 mm', 'gravity': True}),
        ('gear_housing', {'link': 'housing', 'at': ['20 mm', '-10 mm'], 'gravity': True}),
    ],
)
def test_an_axis_at_an_angle_reads_its_parts_along_and_across(scene, sensor):
    axes = {'x': 'along', 'y': 'across', 'w': '30 deg', 'back': '-90 deg'}
    rate = {'sample_rate': '5 kHz'}
    machine = ms.load_scene(
        scene, {f'sensors.{name}': {**sensor, **rate, 'axis': axis} for name, axis in axes.items()}
    )
    solution = ms.simulate(machine, duration=0.1)
    read = {name: solution.signal(name)[name] for name in axes}
    turned = np.sqrt(0.75) * read['x'] + 0.5 * read['y']
    size = np.abs(turned).max()
    assert size > 0.1
    assert read['w'] == pytest.approx(turned, abs=1e-12 * size)
    assert read['back'] == pytest.approx(-read['y'], abs=1e-12 * size)


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Bags of a run in one process, and with a process for each node."""
    folder = tmp_path_factory.mktemp('bags')
    options = ['--revolutions', '2', '--set', 'sensors.rocker.imu=true']
    for name, processes in (('one', []), ('many', ['--processes'])):
        done = run(
            'run', SCENE, *options, *processes, '--record', str(folder / f'{name}.mcap'),
            env=environment(),
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    return [read_bag(folder / f'{name}.mcap') for name in ('one', 'many')]


@pytest.mark.network
@pytest.mark.slow
def test_blocks_are_those_of_the_channel_in_one_process_and_in_many(bags):
    machine = ms.load_scene(SCENE)
    solution = ms.simulate(machine, revolutions=2)
    for name, sensor in machine.scene.sensors.items():
        channel = machine.channel(name)
        channel.take(solution.motion)
        blocks = channel.blocks(final=True)
        for bag in bags:
            messages = [m for _, m, _ in bag.messages(f'/accelerometer/{name}')]
            assert len(messages) == len(blocks) > 1
            for message, block in zip(messages, blocks, strict=True):
                assert (message.quantity, message.unit) == (sensor.measures, sensor.unit)
                assert np.array_equal(message.samples, block.samples)
                assert (message.time, message.overloads, message.triggered) == (
                    block.time, block.overloads, block.triggered,
                )  # fmt: skip


@pytest.mark.network
@pytest.mark.slow
def test_an_inertial_unit_feels_gravity_and_knows_its_attitude(bags):
    machine = ms.load_scene(SCENE)
    solution = ms.simulate(machine, revolutions=2)
    for bag in bags:
        messages = [m for _, m, _ in bag.messages('/imu/rocker')]
        blocks = [m for _, m, _ in bag.messages('/accelerometer/rocker')]
        across = np.concatenate([m.samples for m in blocks])
        assert np.array_equal([m.linear_acceleration.y for m in messages], across)
        t = np.concatenate([b.time + np.arange(len(b.samples)) / 2700.0 for b in blocks])
        seen = solution.sample(t, 'velocity.rocker', 'position.rocker')
        turned = np.array([(m.orientation.w + 1j * m.orientation.z) ** 2 for m in messages])
        assert np.abs(turned - np.exp(1j * seen['position.rocker'])).max() < 1e-12
        rate = np.array([m.angular_velocity.z for m in messages])
        assert np.abs(rate - seen['velocity.rocker']).max() < 1e-9
        first, step = messages[0], 1024.0 / 2**12
        for covariance, variance in (
            (first.linear_acceleration_covariance, 0.09 + step**2 / 12.0),
            (first.angular_velocity_covariance, 1e-9), (first.orientation_covariance, 1e-9),
        ):  # fmt: skip
            wanted = np.diag([variance, variance, 1e-9])  # all zeros would mean unknown
            assert covariance.reshape(3, 3) == pytest.approx(wanted)


def test_at_rest_an_inertial_unit_reads_upwards():
    machine = ms.load_scene(
        'pendulum',
        {
            'initial.position.bar': '-90 deg',
            'sensors.x': {'link': 'bar', 'at': '100 mm', 'imu': True},
        },
    )
    unit = machine.scene.sensors['x'].inertial_unit(machine, 'x')
    unit.take(ms.simulate(machine, duration=0.1).motion)
    read = unit.readings(final=True)
    assert read
    for readings in read:
        x, y = readings.acceleration.T
        c, s = np.cos(readings.angle), np.sin(readings.angle)
        felt = np.stack([c * x - s * y, s * x + c * y])
        gravity = np.array(machine.scene.gravity)
        assert np.abs(felt + gravity[:, None]).max() < 1e-9 * np.abs(gravity).max()


@pytest.mark.parametrize(
    ('overrides', 'said'),
    [
        ({'coupler.instrument': 'bk4370'}, "unknown instrument 'bk4370': known are adxl1005, bk"),
        ({'coupler.transducer.damping': 1}, "'sensors.coupler.transducer.damping'; did you mean"),
        ({'coupler.quantity': 'velocity'}, 'has adc.range in m/s^2, but its quantity is velocity'),
        ({'velocity.quantity': 'acceleration'}, "has an integrator, but 'quantity' is accel"),
        (
            {'velocity.imu': True},
            "has 'imu' for accelerations, but measures velocity",
        ),
        ({'coupler.adc.range': None}, 'has adc.bits without adc.range'),
        ({'coupler.adc.range': '3 m'}, 'has adc.range in m, but its quantity is acceleration'),
        ({'coupler.adc.jitter': '0.1 ms'}, 'at most a tenth of the sampling period'),
        ({'coupler.adc.bits': 33}, 'it must be at most 32'),
        ({'coupler.noise.rms': '-1 m/s^2'}, 'must be at least 0 and finite'),
        ({'coupler.noise.seed': 1.5}, 'it must be a whole number'),
        ({'coupler.trigger.samples': 0}, 'it must be at least 1'),
        ({'coupler.amplifier.low_pass': '0 Hz'}, 'it must be more than 0'),
        ({'coupler.amplifier.low_pass': '350 rpm'}, "which is not a unit of 'Hz'"),
        ({'coupler.amplifier.low_pass_order': 13}, 'it must be at most 12'),
        (
            {'coupler.anti_alias': {'order': 8}},
            "'sensors.coupler.anti_alias.frequency' is missing",
        ),
        ({'coupler.impact_pulse': '0 s'}, 'it must be more than 0'),
        ({'coupler.axis': 'up'}, "allowed: 'along' or 'across'"),
        ({'coupler.link': 'cuopler'}, "did you mean 'coupler'?"),
    ],
)
def test_what_no_instrument_can_be_is_refused_by_name(overrides, said):
    with pytest.raises(InputError) as caught:
        ms.load_scene(SCENE, {f'sensors.{key}': value for key, value in overrides.items()})
    assert said in str(caught.value)
    assert '\n' not in str(caught.value)
