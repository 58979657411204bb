"""Every kind of sensor against what the motion, sampled by itself, says that it must read."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.scene.sensors import SENSORS

SCENE = 'watched_compressor'
JOINT = 'rod_piston'


@pytest.fixture(scope='module')
def machine():
    return ms.load_scene(SCENE)


@pytest.fixture(scope='module')
def solution(machine):
    found = ms.simulate(machine, revolutions=3)
    assert len(found.impacts) > 20
    return found


def samples(machine, name, *motions):
    channel = machine.channel(name)
    for motion in motions:
        channel.take(motion)
    return np.concatenate([block.samples for block in channel.blocks(final=True)])


def changed(values):
    return ms.load_scene(SCENE, {f'sensors.{key}': value for key, value in values.items()})


def instants(machine, name, read):
    return np.arange(len(read)) / machine.scene.sensors[name].sample_rate


def test_the_scene_has_every_kind(machine):
    kinds = {s.kind for s in machine.scene.sensors.values()}
    assert kinds | {'strain_gauge'} == set(SENSORS)  # that is for elastic links only


@pytest.mark.slow
def test_what_is_read_does_not_depend_on_how_the_motion_comes(machine, solution):
    end, cut = solution.motion.curve.end, 0.0371
    parts = solution.motion.between(0.0, cut), solution.motion.between(cut, end)
    for name, sensor in machine.scene.sensors.items():
        whole, again = samples(machine, name, solution.motion), samples(machine, name, *parts)
        step = 2.0 * sensor.adc.range.value / 2**sensor.adc.bits if sensor.adc.bits else 0.0
        scale = np.abs(whole).max()
        np.testing.assert_allclose(again, whole, atol=step + 1e-9 * scale, err_msg=name)


# --- encoder ------------------------------------------------------------------------------------


def counted(angle, zero, lines):
    return np.floor((angle - zero) / (math.tau / (4 * lines)))


@pytest.mark.parametrize('begin', [30.0, 100.0, -20.0])
def test_an_encoder_counts_from_its_index_once_that_has_passed(begin):
    machine = ms.load_scene(
        'slider_crank',
        {
            'drive.start_angle': f'{begin} deg',
            'sensors.e': {'kind': 'encoder', 'link': 'crank', 'lines': 360, 'index': '90 deg'},
        },
    )
    read = samples(machine, 'e', ms.simulate(machine, revolutions=2.2).motion)
    t = instants(machine, 'e', read)
    angle = math.radians(begin) + 20.0 * math.pi * t
    index = math.pi / 2 if begin < 90.0 else math.pi / 2 + math.tau
    zero = np.where(angle < index, math.radians(begin), index)
    counts = read / (math.tau / 1440)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    steady = np.abs(np.remainder((angle - zero) / (math.tau / 1440) + 0.5, 1.0) - 0.5) > 1e-6
    assert steady.mean() > 0.9
    np.testing.assert_array_equal(np.round(counts)[steady], counted(angle, zero, 360)[steady])


def test_an_encoder_on_a_moving_link_counts_the_angle_between_both(solution):
    machine = changed({'e': {'kind': 'encoder', 'link': 'rod', 'relative_to': 'crank'}})
    read = samples(machine, 'e', solution.motion)
    at = solution.sample(instants(machine, 'e', read), 'position.rod', 'position.crank')
    between = at['position.rod'] - at['position.crank']
    slack = between - between[0] - read
    assert (slack > -1e-9).all()
    assert (slack < math.tau / 4096 + 1e-9).all()
    assert read[-1] < -math.tau  # backwards, without end


# --- tachometer ---------------------------------------------------------------------------------


@pytest.mark.parametrize('pulses', [1, 7])
def test_a_tachometer_reads_the_mean_speed_between_its_last_two_pulses(pulses):
    """A crank that speeds up: the angle is known, and with it when marks passed."""
    rate, begin = 40.0, 0.25  # [rad/s^2], [rad]: the first mark has passed
    sensor = {'kind': 'tachometer', 'link': 'crank', 'pulses': pulses, 'sample_rate': '3 kHz'}
    machine = ms.load_scene(
        'slider_crank',
        {
            'sensors.speed': sensor,
            'drive': {'coordinate': 'crank', 'start_angle': begin,
                      'profile': {'points': [[0.0, 0.0], [1.5, 1.5 * rate]]}},
        },
    )  # fmt: skip
    solution = ms.simulate(machine, duration=1.5)
    read = samples(machine, 'speed', solution.motion)
    t = instants(machine, 'speed', read)
    step = math.tau / pulses
    last = np.floor((begin + 0.5 * rate * t**2) / step)  # number of the last mark
    passed, before = (np.sqrt(np.maximum((n * step - begin) / (0.5 * rate), 0.0))
                      for n in (last, last - 1.0))  # fmt: skip
    known = last >= 2.0
    right = step / np.maximum(passed - before, t - passed, where=known, out=np.ones_like(t))
    np.testing.assert_allclose(read[known], right[known], rtol=1e-9)
    assert not read[~known].any()
    assert known.mean() > 0.4


def test_a_tachometer_of_a_link_that_stops_falls_as_time_goes_on():
    machine = ms.load_scene('slider_crank', {
        'drive': {'coordinate': 'crank', 'profile': {'points': [[0.0, 40.0], [0.5, 0.0]]}},
        'sensors.speed': {'kind': 'tachometer', 'link': 'crank', 'pulses': 4},
    })  # fmt: skip
    read = samples(machine, 'speed', ms.simulate(machine, duration=2.0).motion)
    t = instants(machine, 'speed', read)
    # it stops after 10 rad, six quarters of a turn: of 40 (0.5 - t)^2 rad so much is left then
    passed = 0.5 - math.sqrt((10.0 - 3.0 * math.pi) / 40.0)
    late = t > passed + 0.2
    assert late.sum() > 1000
    np.testing.assert_allclose(read[late], 0.5 * math.pi / (t[late] - passed), rtol=1e-9)


# --- draw-wire sensor -----------------------------------------------------------------------


def test_a_draw_wireentiometer_reads_the_distance_that_the_law_of_cosines_gives():
    """From a point of the ground above the crankshaft to the crank's end; behind a low-pass."""
    run = ms.simulate(ms.load_scene('slider_crank', {
        'links.ground.points.above': [0.0, 0.3],
        'sensors.ideal': {'kind': 'draw_wire', 'between': ['ground.above', 'crank.end'],
                          'sample_rate': '50 kHz'},
        'sensors.slow': {'kind': 'draw_wire', 'between': ['crank.end', 'ground.above'],
                         'sample_rate': '50 kHz',
                         'amplifier': {'low_pass': '200 Hz', 'low_pass_order': 1}},
    }), revolutions=3)  # fmt: skip
    ideal, slow = run.signal('ideal'), run.signal('slow')
    angle = 20.0 * math.pi * np.asarray(ideal['t'])
    length = np.sqrt(0.05**2 + 0.3**2 - 2.0 * 0.05 * 0.3 * np.sin(angle))
    np.testing.assert_allclose(ideal['ideal'], length, rtol=1e-10)
    assert ideal.units['ideal'] == 'm'
    w, h = math.tau * 200.0, 1.0 / 50e3  # bilinear, from rest
    b, a = [w * h, w * h], [2.0 + w * h, w * h - 2.0]
    away = slow['slow'][500:] - lfilter(b, a, length)[500:]  # 12 time constants on
    np.testing.assert_allclose(away, 0.0, atol=1e-6)


# --- gyroscope ----------------------------------------------------------------------------------


def test_an_ideal_gyroscope_reads_the_rate_and_its_filter_is_that_of_the_book(solution):
    machine = changed({
        'ideal': {'kind': 'gyroscope', 'link': 'rod', 'sample_rate': '400 kHz'},
        'slow': {'kind': 'gyroscope', 'link': 'rod', 'sample_rate': '400 kHz',
                 'amplifier': {'low_pass': '1 kHz', 'low_pass_order': 1}},
    })  # fmt: skip
    rate = samples(machine, 'ideal', solution.motion)
    at = solution.sample(instants(machine, 'ideal', rate), 'velocity.rod')
    np.testing.assert_allclose(rate, at['velocity.rod'], rtol=1e-12, atol=1e-9)
    slow = samples(machine, 'slow', solution.motion)
    decay = math.exp(-math.tau * 1e3 / 4e5)  # the exact response to steps between samples
    middle = 0.5 * (rate[1:] + rate[:-1])
    coarse = np.append(0.0, lfilter([1.0 - decay], [1.0, -decay], middle))
    # where an impact falls between two samples, half a step is missing for that long
    assert np.abs(slow - coarse).max() < 0.01 * np.ptp(rate)
    assert np.abs(slow - rate).max() > 0.1 * np.ptp(rate)


# --- displacement probes ------------------------------------------------------------------------


def test_two_probes_see_where_the_pin_is_in_its_bushing(machine, solution):
    x, y = (samples(machine, name, solution.motion) for name in ('probe_x', 'probe_y'))
    at = solution.sample(instants(machine, 'probe_x', x))
    gap = at[f'gap.{JOINT}']
    np.testing.assert_allclose(np.hypot(x, y), 1e-4 - gap, atol=1e-12)
    angle = at['position.rod']
    pin = 0.05 * np.cos(at['position.crank']) + 0.2 * np.cos(angle)
    np.testing.assert_allclose(x, pin - at['position.piston'], atol=1e-12)


# --- load cell ----------------------------------------------------------------------------------


def test_a_load_cell_reads_the_reaction_along_the_link(solution):
    machine = changed({'f': {'kind': 'load_cell', 'joint': 'crank_rod', 'direction': '30 deg'}})
    read = samples(machine, 'f', solution.motion)
    at = solution.sample(
        instants(machine, 'f', read),
        'position.rod',
        'reaction.crank_rod.x',
        'reaction.crank_rod.y',
    )
    way = at['position.rod'] + math.radians(30.0)
    force = at['reaction.crank_rod.x'] * np.cos(way) + at['reaction.crank_rod.y'] * np.sin(way)
    np.testing.assert_allclose(read, force, rtol=1e-9, atol=1e-6)


@pytest.mark.slow
def test_impacts_reach_a_load_cell_as_their_impulses(solution):
    """A slow filter shows ``omega_c`` times the impulse at once: in the pin from the impacts."""
    corner = 20.0
    machine = changed({
        f'way{k}': {'kind': 'load_cell', 'joint': JOINT, 'direction': f'{90 * k} deg',
                    'sample_rate': '2 MHz', 'amplifier': {'low_pass': corner,
                                                          'low_pass_order': 1}}
        for k in (0, 1)
    })  # fmt: skip
    motion = solution.motion.between(0.0, solution.impacts[8].t + 1e-4)
    both = np.array([samples(machine, f'way{k}', motion) for k in (0, 1)])
    t = instants(machine, 'way0', both[0])
    for impact in solution.impacts[:8]:
        k = int(np.searchsorted(t, impact.t))
        if (
            np.min(np.abs(np.array([i.t for i in solution.impacts if i is not impact]) - impact.t))
            < 2e-6
        ):
            continue
        jump = (both[:, k] - both[:, k - 1]) / (math.tau * corner)
        n = np.array([math.cos(impact.normal_angle), math.sin(impact.normal_angle)])
        along, across = jump @ n, jump @ np.array([-n[1], n[0]])
        # the bushing is pushed outwards; forces between two samples are small beside impulses
        assert along == pytest.approx(impact.normal_impulse, rel=0.02, abs=5e-4)
        assert abs(across) == pytest.approx(abs(impact.tangential_impulse), rel=0.02, abs=5e-4)


@pytest.mark.parametrize('sensor', [{'at': 'rod.end'}, {'link': 'rod', 'at': 'end'}])
def test_a_sensor_sits_at_a_point_by_its_name(sensor):
    length = float(ms.load_scene('watched_compressor').scene.links['rod'].length)
    there = changed({'s': {'link': 'rod', 'at': length}})
    assert changed({'s': sensor}).scene.sensors == there.scene.sensors


def test_a_sensor_at_a_link_sits_at_its_origin():
    """As loads do."""
    origin = changed({'s': {'link': 'rod', 'at': 0.0}}).scene.sensors
    assert changed({'s': {'at': 'rod'}}).scene.sensors == origin
    assert changed({'s': {'link': 'rod', 'at': 'rod'}}).scene.sensors == origin


# --- what cannot be -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('sensor', 'said'),
    [
        ({'kind': 'encodr', 'link': 'rod'}, ["unknown kind 'encodr'", "mean 'encoder'?"]),
        ({'kind': 'encoder'}, ["'sensors.s.link' is missing"]),
        ({'kind': 'encoder', 'link': 'piston'}, ['does not turn on ground']),
        ({'kind': 'encoder', 'link': 'rod', 'relative_to': 'rodd'}, ["no link 'rodd'"]),
        ({'kind': 'encoder', 'link': 'rod', 'gravity': True}, ["'gravity'", 'no meaning']),
        ({'kind': 'draw_wire'}, ['sensors.s.between']),
        ({'kind': 'draw_wire', 'between': ['rod', 'rod.end']}, ['both points are of rod']),
        ({'kind': 'draw_wire', 'between': ['rod', 'rod.x']}, ['sensors.s.between', "'x'"]),
        ({'kind': 'gyroscope', 'link': 'ground'}, ["no moving link 'ground'"]),
        ({'kind': 'gyroscope', 'link': 'rod', 'adc': {'range': '2 m'}}, ['give it in rad/s']),
        ({'kind': 'displacement_probe', 'joint': 'crank_rod'}, ['not a joint with a pin', JOINT]),
        ({'kind': 'load_cell', 'joint': 'crank_rot'}, ["mean 'crank_rod'?"]),
        ({'joint': 'crank_rod', 'link': 'rod'}, ["'joint'", 'no meaning']),
        ({'at': 'rod.edn'}, ["sensors.s.at = 'rod.edn'", "mean 'rod.end'?"]),
        ({'link': 'crank', 'at': 'rod.end'}, ["not a point of the sensor's link"]),
        ({'link': 'crank', 'at': 'rod'}, ["not a point of the sensor's link"]),
        ({'link': 'rod', 'at': [1.0, 'x']}, ["write for example '64 mm'"]),
        ({'link': 'rod', 'at': [1.0, 2.0, 3.0]}, ['a pair [x, y]']),
        ({'link': 'rod', 'at': math.nan}, ['must be finite']),
    ],
)  # fmt: skip
def test_sensors_that_cannot_be_are_refused(sensor, said):
    with pytest.raises(InputError) as refused:
        changed({'s': sensor})
    for part in said:
        assert part in str(refused.value)


def test_a_load_cell_needs_forces():
    with pytest.raises(InputError, match=r"'outputs\.forces: true'"):
        ms.load_scene(
            'slider_crank',
            {'outputs.forces': False, 'sensors.f': {'kind': 'load_cell', 'joint': 'crank_rod'}},
        )
