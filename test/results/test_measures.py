"""Measures: figures of a run by a second route, units, windows, and what is refused."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import scipy
from four_bars import loose

import mechanism_sim as ms
from mechanism_sim.analysis.measure import measure
from mechanism_sim.cli import main
from mechanism_sim.engine.audit import Audit
from mechanism_sim.engine.energy_terms import EnergyTerms
from mechanism_sim.errors import InputError, RunWarning
from mechanism_sim.messages import deserialize
from mechanism_sim.nodes.publications import linkage_states, reactions
from mechanism_sim.numerics.expressions import numbers
from mechanism_sim.pages.controls import controls
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.report.summary import to_json
from mechanism_sim.results.cycle import cycle
from mechanism_sim.results.measure_text import read, read_all
from mechanism_sim.results.measures import (
    EXACT,
    Measurement,
    check_measures,
    per_turn,
)
from mechanism_sim.results.ranges import LoadPeaks
from mechanism_sim.results.run import BATCH, Batch, Piece, Runner, is_loss
from mechanism_sim.results.turns import ImpactAccumulator
from mechanism_sim.scene.load import started_at
from mechanism_sim.units import alike, product, read_common

FINE = 20_001


@pytest.fixture(scope='module')
def nominal():
    machine = ms.load_scene('four_bar_nominal')
    return machine, ms.simulate(machine, revolutions=2)


@pytest.fixture(scope='module')
def rattling():
    machine = loose(0.5, 'seated')
    return machine, ms.simulate(machine, revolutions=4)


def one(pair, text, **window):
    (found,) = measure(*pair, text, **window)
    return found


def trapezoid(y, t):
    return float(((y[1:] + y[:-1]) * np.diff(t)).sum() / 2.0)


def test_figures_over_time_agree_with_fine_sampling(nominal):
    _, solution = nominal
    t = np.linspace(0.0, solution.duration, FINE)
    seen = solution.sample(
        t,
        'reaction.coupler_rocker.x',
        'reaction.coupler_rocker.y',
        'drive_torque',
        'velocity.crank',
        'position.rocker',
    )
    force = np.hypot(seen['reaction.coupler_rocker.x'], seen['reaction.coupler_rocker.y'])
    torque, speed = seen['drive_torque'], seen['velocity.crank']
    for text, expected in (
        ('largest(reaction.coupler_rocker)', force.max()),
        ('lowest(reaction.coupler_rocker)', force.min()),
        ('highest(drive_torque)', torque.max()),
        ('largest(drive_torque)', np.abs(torque).max()),
        ('range(drive_torque)', np.ptp(torque)),
        ('mean(reaction.coupler_rocker)', trapezoid(force, t) / t[-1]),
        ('rms(drive_torque)', math.sqrt(trapezoid(torque**2, t) / t[-1])),
        ('integral(abs(drive_torque * velocity.crank))', trapezoid(abs(torque * speed), t)),
        ('percentile(reaction.coupler_rocker, 90)', np.percentile(force, 90)),
        ('share(reaction.coupler_rocker > 8 N)', (force > 8.0).mean()),
        ('initial(position.rocker)', seen['position.rocker'][0]),
        ('change(position.crank)', 4.0 * math.pi),
    ):
        assert one(nominal, text).value == pytest.approx(expected, rel=1e-3, abs=1e-9), text


def test_the_largest_of_what_is_zero_has_no_sign():
    machine = ms.load_scene('four_bar_nominal', {'drive.speed': 0.0})
    found = one((machine, ms.simulate(machine, duration=0.1)), 'largest(velocity.crank)')
    assert math.copysign(1.0, found.value) == 1.0


def test_extremes_are_those_of_the_motion_to_rounding(nominal):
    """A cycle finds the same by itself; sampling gets there from below only."""
    machine, _ = nominal
    ends = cycle(machine).extremes()['reaction.coupler_rocker.size']
    found = one(nominal, 'largest(reaction.coupler_rocker)')
    assert found.value == pytest.approx(ends.greatest.value, rel=1e-11)
    assert found.resolution == EXACT


def test_energy_work_and_power_agree(rattling):
    """Three routes to the drive's work, of which one counts impacts by itself."""
    _, solution = rattling
    work = one(rattling, 'work(drive_torque)').value
    assert work == pytest.approx(solution.energy.drive_work, rel=1e-9)
    assert one(rattling, 'change(energy.drive_work)').value == pytest.approx(work, rel=1e-7)
    between = sum(i.drive_work for i in solution.impacts)
    assert one(rattling, 'integral(drive_power)').value == pytest.approx(work - between, rel=1e-9)


def test_events_are_counted_and_summed(rattling):
    machine, solution = rattling
    joint, T = 'coupler_rocker', machine.drive.period
    late = [i for i in solution.impacts if i.t >= 2 * T]
    for text, expected in (
        ('count(impacts.coupler_rocker)', len(solution.impacts)),
        ('count(impacts, from 2 revolutions)', len(late)),
        (f'count(impacts, from {2 * T!r} s)', len(late)),
        ('sum(impacts.energy_loss)', sum(i.energy_loss for i in solution.impacts)),
        ('largest(impacts.normal_impulse)', max(i.normal_impulse for i in solution.impacts)),
        ('count(impacts, per revolution)', len(solution.impacts) / 4.0),
        (
            'count(impacts.approach_speed > 0.1 m/s)',
            sum(i.approach_speed > 0.1 for i in solution.impacts),
        ),
    ):
        assert one(rattling, text).value == pytest.approx(expected, rel=1e-12), text
    flying = one(rattling, f'share(closed.{joint})').value
    t = np.linspace(0.0, solution.duration, FINE)
    assert flying == pytest.approx(
        solution.sample(t, f'closed.{joint}')[f'closed.{joint}'].mean(), abs=1e-3
    )


def test_pieces_of_a_run_give_what_the_whole_gives(rattling):
    machine, solution = rattling
    texts = (
        'largest(reaction.coupler_rocker)', 'rms(drive_torque, per revolution)',
        'count(impacts, from 1 revolution to 3 revolutions)', 'integral(drive_power, to 0.3 s)',
    )  # fmt: skip
    whole = measure(machine, solution, *texts)
    taken, run = Measurement(machine, texts), machine.start()
    end = solution.duration

    audit = Audit(machine.physics)
    while run.time < end:
        run.advance(end, final=True, most=37)
        motion, impacts, changes = run.drain()
        terms = EnergyTerms(audit.add(motion, impacts), impacts)
        taken.add(Piece(machine, motion, terms, impacts, changes))
    for a, b in zip(taken.found(), whole, strict=True):
        assert a.value == pytest.approx(b.value, rel=1e-10), a.text


def test_events_and_samples_of_each_turn_are_looked_at_once(rattling, monkeypatch):
    """Those of all turns at every turn cost a hundred times as much in a hundred turns."""
    machine, solution = rattling
    seen, T = [], machine.drive.period
    (name,) = machine.scene.sensors
    signal = solution.signal(name)
    struck = np.array([(i.t, i.normal_impulse) for i in solution.impacts]).T
    texts = 'sum(impacts.normal_impulse)', f'largest(sensors.{name})', 'count(losses)'

    def counted(tree, known):
        seen.extend(len(x) for x in known.values())
        return numbers(tree, known)

    monkeypatch.setattr('mechanism_sim.results.measures.numbers', counted)
    taken = Measurement(machine, per_turn(read_all([*texts], 'measures'), 0))
    taken.add(solution)
    (_, _, impulses), (_, _, peaks), (_, _, losses) = taken.found_each_turn()
    for turn in range(4):
        a, b = turn * T, (turn + 1) * T
        inside = (struck[0] >= a) & (struck[0] < b)
        assert impulses[turn] == pytest.approx(struck[1][inside].sum(), rel=1e-12)
        samples = signal[name][(signal['t'] >= a) & (signal['t'] < b)]
        assert peaks[turn] == np.abs(samples).max()
    assert losses.sum() == sum(map(is_loss, solution.modes))
    assert sum(seen) <= len(signal['t']) + len(struck[0]) + losses.sum()


def test_turns_of_a_drive_that_is_not_steady_are_found():
    """A free crank without forces keeps its speed, so its turns are known."""
    machine = ms.load_scene(
        'four_bar_governed',
        {'drive.torque.per_speed': '0 N m s/rad', 'drive.flywheel': '1000 kg m^2'},
    )
    solution = ms.simulate(machine, duration=1.3)
    found = one((machine, solution), 'change(position.crank, per revolution)')
    assert found.value == pytest.approx(2.0 * math.pi, rel=1e-9)
    until = one((machine, solution), 'change(position.crank, from 1 revolution to 3 revolutions)')
    assert until.value == pytest.approx(4.0 * math.pi, rel=1e-9)


def test_units_follow_from_the_expression(nominal):
    for text, unit in (
        ('largest(reaction.coupler_rocker)', 'N'),
        ('mean(drive_torque * velocity.crank)', 'W'),
        ('integral(reaction.coupler_rocker)', 'N s'),
        ('rms(reaction.coupler_rocker**2)', 'N^2'),
        ('rms(sqrt(reaction.coupler_rocker**2))', 'N'),
        ('largest(drive_torque) / largest(reaction.coupler_rocker)', 'm'),
        ('largest(velocity.crank)', 'rad/s'),
        ('largest(drive_torque) / mean(drive_torque)', ''),
        ('share(drive_torque > 0 N m)', ''),
        ('share(velocity.crank * 1 m > 2 m/s)', ''),
        ('largest(1 m/s * velocity.crank + 2 m/s^2)', 'm/s^2'),
    ):
        assert one(nominal, text).unit == unit, text
    assert product('J', 's', -1) == 'W'
    assert read_common('1', 'kN mm') == (1.0, 'N m')
    assert alike('N m', 'J')
    assert not alike('N', 'm')


def test_a_motor_is_seen_behind_its_gear():
    machine = ms.load_scene('toggle_press')
    solution = ms.simulate(machine, duration=0.02)
    torque = one((machine, solution), 'mean(drive_torque) / mean(motor.torque)').value
    speed = one((machine, solution), 'mean(motor.speed) / mean(velocity.crank)').value
    assert (torque, speed) == pytest.approx((12.5, 12.5))


def test_a_motor_beside_a_prescribed_drive_is_told_by_its_own_torque():
    bar = {'length': '0.2 m', 'mass': '1 kg', 'inertia': '0.01 kg m^2'}
    machine = ms.load_scene({
        'title': 'Two bars', 'mechanism': 'linkage', 'links': {'arm': bar, 'rod': bar},
        'joints': {'a': {'revolute': ['ground', 'arm']}, 'b': {'revolute': ['ground', 'rod']}},
        'drive': {
            'coordinate': 'arm', 'speed': '50 rad/s',
            'motor': {'stall_torque': '5 N m', 'no_load_speed': '100 rad/s'},
        },
        'drives': {'rod': {'speed': '10 rad/s', 'acceleration': '3 rad/s^2'}},
    })  # fmt: skip
    run = ms.simulate(machine, duration=0.05)
    t = np.array([0.0, 0.02, 0.05])
    found = run.sample(t, 'drive_torque', 'velocity.arm', 'drive_torque.rod', *(
        f'motor.{x}' for x in ('torque', 'speed', 'power')
    ))  # fmt: skip
    speed = found['velocity.arm']
    torque = 5.0 * (1.0 - speed / 100.0)
    assert found['drive_torque.rod'] == pytest.approx(np.full(3, 0.01 * 3.0), rel=1e-9)
    for name, known in (
        ('drive_torque', torque), ('motor.torque', torque), ('motor.speed', speed),
        ('motor.power', torque * speed),
    ):  # fmt: skip
        assert found[name] == pytest.approx(known, rel=1e-9), name
    work = one((machine, run), 'work(drive_torque)').value
    energy = 0.5 * 0.01 * (speed[-1] ** 2 - speed[0] ** 2)
    assert work == pytest.approx(energy, rel=1e-9)
    peaks = LoadPeaks(machine)
    peaks.add(run.motion)
    assert [*peaks.torques] == ['arm', 'rod']
    streamed = ms.stream(machine, duration=0.05).finish()
    final = to_json(streamed, '', ImpactAccumulator(machine), None, None)['final']
    assert final['drive_torque'] == pytest.approx(torque[-1])
    for write, kind in (
        (linkage_states(machine, 'world'), 'mechanism_sim/msg/LinkageState'),
        (reactions(machine, 'world'), 'mechanism_sim/msg/JointReactions'),
    ):
        (message,) = write(run.view(0.0))
        assert deserialize(message, kind).drive_torque == pytest.approx(2.5)


def test_a_main_drive_among_drives_is_one_like_any_other():
    """Its motor, its slider on a page and its start angle were those of the key `drive` only."""
    arm = {'length': '0.2 m', 'mass': '1 kg', 'inertia': '0.01 kg m^2'}

    def driven(**keys):
        return ms.load_scene({
            'title': 'An arm', 'mechanism': 'linkage', 'links': {'arm': arm},
            'joints': {'a': {'revolute': ['ground', 'arm']}}, 'drives': {'arm': keys},
        })  # fmt: skip

    motor = driven(speed='50 rad/s', motor={'stall_torque': '5 N m', 'no_load_speed': '1 krad/s'})
    run = ms.simulate(motor, duration=0.01)
    (torque,) = run.sample(0.0, 'motor.torque')['motor.torque']
    assert torque == pytest.approx(5.0 * 0.95)
    steady = driven(speed='60 rpm')
    assert 'drives.arm.speed' in controls(steady)
    assert started_at(steady, 0.5).drive.start == pytest.approx((0.5, 2.0 * math.pi))


@pytest.mark.parametrize('drive', [{'acceleration': '10 rad/s^2'}, {'torque': '0.3 N m'}])
def test_parts_of_turns_are_where_the_drive_comes_to_them_however_a_run_is_cut(drive):
    """They were taken to pass evenly, and were not known before their turn was over."""
    arm = {'length': '0.2 m', 'mass': '1 kg', 'inertia': '0.01 kg m^2'}
    machine = ms.load_scene({
        'title': 'An arm', 'mechanism': 'linkage', 'links': {'arm': arm},
        'joints': {'a': {'revolute': ['ground', 'arm']}}, 'drive': {'coordinate': 'arm', **drive},
    })  # fmt: skip
    texts = [
        'initial(position.arm, from 0.5 revolutions)', 'final(position.arm, to 1.5 revolutions)',
        'integral(velocity.arm, from 0.5 revolutions to 1.25 revolutions)',
        'initial(position.arm, from 900 revolutions)',
    ]  # fmt: skip
    for batch in (BATCH, Batch(2, 2)):
        taken = Measurement(machine, texts)
        for piece in Runner(machine).to(2.0, batch=batch):
            taken.add(piece)
        first, last, way, none = (m.value for m in taken.found())
        assert (first, last, way) == pytest.approx((math.pi, 3.0 * math.pi, 1.5 * math.pi))
        assert math.isnan(none)


def test_a_turn_that_is_made_just_before_the_drive_turns_back_is_seen():
    """It goes back by 1/(2 pi) of a turn, and passes 0.157 of it twice between steps before."""
    arm = {'length': '0.2 m', 'mass': '1 kg', 'inertia': '0.01 kg m^2'}
    machine = ms.load_scene({
        'title': 'An arm', 'mechanism': 'linkage', 'links': {'arm': arm},
        'joints': {'a': {'revolute': ['ground', 'arm']}},
        'drive': {'coordinate': 'arm', 'torque': {'constant': '0.5 N m'}, 'speed': '-10 rad/s'},
    })  # fmt: skip
    run = ms.simulate(machine, duration=1.0)
    for part, sign in ((0.157, -1.0), (0.159, -1.0), (0.16, 1.0)):
        found = one((machine, run), f'initial(position.arm, from {part} revolutions)').value
        assert found == pytest.approx(sign * part * math.tau), part


def test_parts_of_turns_of_a_drive_that_rests_until_it_is_commanded_are_those_of_its_motion():
    machine = ms.load_scene({
        'title': 'An arm', 'mechanism': 'linkage', 'links': {'arm': {'length': '0.2 m'}},
        'joints': {'a': {'revolute': ['ground', 'arm']}},
        'drive': {
            'coordinate': 'arm', 'speed': '0 rpm',
            'commands': {'acceleration': '10 rad/s^2', 'fastest': '300 rpm'},
        },
    })  # fmt: skip
    parts = [0.5, 1.0, 1.5]
    taken = Measurement(machine, [f'initial(position.arm, from {x} revolutions)' for x in parts])
    for piece in Runner(machine, machine.start(DriveLaw('arm', (0.0, math.tau)))).to(1.7):
        taken.add(piece)
    assert [x.value / math.tau for x in taken.found()] == pytest.approx(parts)


def test_sensors_are_measured_by_their_samples():
    machine = loose(0.5, 'seated')
    solution = ms.simulate(machine, revolutions=1)
    (name,) = machine.scene.sensors
    channel = machine.channel(name)
    channel.take(solution.motion)
    samples = np.concatenate([b.samples for b in channel.blocks(final=True)])
    found = one((machine, solution), f'rms(sensors.{name})')
    assert found.value == pytest.approx(math.sqrt((samples**2).mean()))
    assert found.unit == 'm/s^2'
    assert found.resolution == f'of {len(samples)} samples at 10000 Hz'
    for text, value in (
        ('kurtosis', scipy.stats.kurtosis(samples, fisher=False)),
        ('skewness', scipy.stats.skew(samples)),
        ('crest', np.abs(samples).max() / math.sqrt((samples**2).mean())),
        ('crest_factor', np.abs(samples).max() / math.sqrt((samples**2).mean())),
    ):
        found = one((machine, solution), f'{text}(sensors.{name})')
        assert found.value == pytest.approx(value, rel=1e-12)
        assert found.unit == ''


def test_what_is_made_of_samples_that_were_cut_says_so():
    machine = ms.load_scene(
        'four_bar_clearance', {'sensors.rocker_accelerometer.adc.range': '20 m/s^2'}
    )
    name, solution = 'sensors.rocker_accelerometer', ms.simulate(machine, revolutions=1)
    warned = pytest.warns(RunWarning, match=r'samples were CUT at the end of its range, 20 m/s\^2')
    with warned:
        read = solution.to_frame(name)['rocker_accelerometer']
    cut = int((np.abs(read) == 20.0).sum())
    assert cut > 100
    with warned:
        signal, count = measure(machine, solution, f'kurtosis({name})', f'sum({name}.overloads)')
    assert signal.resolution.endswith(f', {cut} of them CUT at the end of the range')
    assert (count.value, count.unit) == (cut, '')


def test_a_frame_has_the_samples_of_sensors_beside_quantities_at_their_instants():
    machine = loose(0.5, 'seated')
    solution = ms.simulate(machine, revolutions=1)
    (name,) = machine.scene.sensors
    channel = machine.channel(name)
    channel.take(solution.motion)
    blocks = channel.blocks(final=True)
    frame = solution.to_frame(name, 'position.crank')
    assert list(frame.columns) == ['t', name, 'position.crank']
    assert np.array_equal(frame[name], np.concatenate([b.samples for b in blocks]))
    assert np.allclose(frame['t'], np.arange(len(frame)) / 1e4, rtol=0.0, atol=1e-12)
    crank = solution.sample(frame['t'], 'position.crank')['position.crank']
    assert np.array_equal(frame['position.crank'], crank)
    assert frame.attrs['units'][name] == 'm/s^2'
    assert np.array_equal(solution.to_frame([f'sensors.{name}'])[name], frame[name])
    # a run that was opened has all that a solution has, and a part of it the samples of the whole
    record = ms.open_run(solution)
    assert ms.open_run(record) is record
    again = record.to_frame(name, 'position.crank')
    assert np.array_equal(again[name], frame[name])
    assert np.allclose(again, frame, rtol=1e-12, atol=1e-12)
    part = record.between(0.1 * record.end, 0.2 * record.end).to_frame(name)
    inside = (frame['t'] >= 0.1 * record.end) & (frame['t'] <= 0.2 * record.end)
    assert np.array_equal(part[name], frame[name][inside])
    assert np.array_equal(
        record.sample([0.1], 'gap').popitem()[1], solution.sample(0.1, 'gap').popitem()[1]
    )
    sensor = machine.scene.to_document()['sensors'][name]
    named = loose(0.5, 'seated', sensors__drive_torque=sensor, sensors__t=sensor)
    both = ms.simulate(named, duration=0.01).to_frame(
        'sensors.drive_torque', 'drive_torque', 'sensors.t'
    )
    assert list(both.columns) == ['t', 'sensors.drive_torque', 'sensors.t', 'drive_torque']
    assert not np.allclose(both['sensors.drive_torque'], both['drive_torque'])
    text = 'rms(drive_torque)'
    assert (
        ms.measure(record, text) == ms.measure(solution, text) == [one((machine, solution), text)]
    )
    with pytest.raises(InputError, match='give a solution before it'):
        ms.measure(machine, text)
    for names, how, said in (
        ([name], {'rate': '1 kHz'}, 'rate of its own'),
        (['sensors.nobody'], {}, f'it has: {name}'),
    ):
        with pytest.raises(InputError, match=said):
            solution.to_frame(*names, **how)


def test_texts_of_measures_come_one_by_one_in_lists_and_by_name():
    run = ms.simulate('slider_crank', revolutions=1)
    one_text, two = 'rms(drive_torque)', 'range(position.piston)'
    both = ms.measure(run, one_text, two)
    assert [m.text for m in both] == [one_text, two]
    for given in ([one_text, two], (one_text, two)):
        assert ms.measure(run, given) == both
        assert ms.measure(run.machine, run, given) == both
    named = ms.measure(run, {'size': one_text, 'stroke': two})
    assert [(m.name, m.value) for m in named] == [
        ('size', both[0].value), ('stroke', both[1].value)
    ]  # fmt: skip
    assert ms.measure(run, []) == []
    for wrong, said in (
        ([one_text, 3.0], 'measures: 3.0 is not a text'),
        (3.0, 'measures = 3.0 is neither a text nor a list of texts'),
    ):
        with pytest.raises(InputError, match=said):
            ms.measure(run, wrong)
    with pytest.raises(InputError, match='give a solution before it'):
        ms.measure(run.machine, [one_text])


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('largest(reaction.couper_rocker)', "did you mean 'reaction.coupler_rocker'"),
        ('larges(drive_torque)', "did you mean 'largest'"),
        ('drive_torque', "write for example 'largest"),
        ('largest(drive_torque + position.rocker)', 'the units differ in kind'),
        ('largest(drive_torque) + largest(position.rocker)', 'the units differ in kind'),
        ('share(velocity.crank * 1 m/s > 10 g)', 'standard gravity is g_0'),
        ('rms(drive_torque, from 2)', 'needs a unit'),
        ('rms(drive_torque, from 2 m)', "not a unit of 's'"),
        ('rms(drive_torque, from 2 s to 300 ms)', 'ends before it begins'),
        ('mean(drive_torque, from 2 rev to 2 rev)', 'ends before it begins'),
        ('rms(drive_torque, per second)', 'per revolution only'),
        ('rms(drive_torque, speed=3)', 'each once'),
        ('rms(drive_torque, from 1 s, from 2 s)', 'each once'),
        ('count(drive_torque)', 'must be of events'),
        ('integral(impacts)', 'events have'),
        ('largest(impacts.pin)', 'loose joints: none'),
        ('rms(sensors.here)', 'has no sensor'),
        ('percentile(drive_torque, 101)', 'from 0 to 100'),
        ('work(position.rocker)', 'it applies to drive_torque'),
        ('largest(motor.torque)', 'is not a motor'),
        ('largest(', 'never closed'),
        ('largest(drive_torque[0])', 'is not made of'),
        ('__import__("os").system("true")', 'is no'),
        ('3', 'has no measure'),
        ('max(abs(drive_torque), 3 N m)', "write for example 'largest"),
        ('rms(max(drive_torque))', "of a whole run and cannot stand in 'rms'"),
        ('largest(drive_torque) / (300/min)', 'a unit: it stands behind its number'),
        ('count(impacts.approach_speed > 3 N)', 'the units differ in kind'),
        ('largest(3)', 'names no quantity'),
    ],
)  # fmt: skip
def test_what_cannot_be_measured_is_refused_in_one_sentence(nominal, text, said):
    with pytest.raises(InputError, match=said) as refused:
        measure(*nominal, text)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    ('window', 'said'),
    [
        ('from 1 h', 'before the window begins'),
        ('from 500 revolutions', 'before the window begins'),
        ('to 1 h', 'up to the end of the run'),
        ('from 1 revolutions to 500 revolutions', 'up to the end of the run'),
        ('to 1 revolutions', ''),
    ],
)
def test_a_window_that_the_run_does_not_reach_says_so(nominal, rattling, window, said):
    for figure in ('mean(drive_torque, WINDOW)', 'count(modes.coupler_rocker, WINDOW)'):
        machine, run = nominal if 'torque' in figure else rattling
        found = measure(machine, run, figure.replace('WINDOW', window))[0]
        assert said in found.resolution
        assert bool(said) == ('the run' in found.resolution)


@pytest.mark.parametrize('width', [1e-2, 1e-3, 1e-4, 1e-6])
def test_a_measure_sees_what_its_text_makes_narrow(width):
    machine = ms.load_scene('four_bar_nominal')
    run = ms.simulate(machine, revolutions=1)
    T = run.duration
    away, u = f'((t - {0.5 * T!r} s)/({width} s))', 0.5 * T / width

    def area(x):
        return x * math.atan(x) - 0.5 * math.log1p(x * x)

    known = {
        f'integral(exp(-{away}**2))': math.sqrt(math.pi) * width * math.erf(u),
        f'mean(exp(-{away}**2))': math.sqrt(math.pi) * width * math.erf(u) / T,
        f'rms(1/(1 + {away}**2))': math.sqrt((math.atan(u) + u / (1.0 + u * u)) * width / T),
        f'integral(1 - tanh({away})**2)': 2.0 * width * math.tanh(u),
        f'integral(atan({away} + {u / 3.0!r}))': width
        * (area(4.0 * u / 3.0) - area(2.0 * u / 3.0)),
        f'share(exp(-{away}**2) > 0.5)': 2.0 * width * math.sqrt(math.log(2.0)) / T,
        f'highest(exp(-{away}**2))': 1.0,
        f'percentile(1/(1 + {away}**2), 50)': 1.0 / (1.0 + 0.25 * u * u),
    }

    found = measure(machine, run, *known)
    for m, (text, value) in zip(found, known.items(), strict=True):
        assert m.value == pytest.approx(value, rel=1e-9 + 1e-15 / width), text
        assert m.resolution == EXACT, text


def test_a_tangent_near_its_pole_is_seen_beside_what_is_larger():
    """W tan(pi/2 - W - u^2) is a pulse of height 1 and of the width sqrt(W)."""
    machine = ms.load_scene('four_bar_nominal')
    run = ms.simulate(machine, revolutions=1)
    W, T = 1e-12, run.duration
    u = f'((t - {0.3712345 * T!r} s)/({T!r} s))'
    found = one((machine, run), f'mean(1 + {W}*tan({math.pi / 2!r} - {W} - {u}**2))')
    assert found.value - 1.0 == pytest.approx(math.pi * math.sqrt(W), rel=1e-3)


@pytest.mark.parametrize('stiffness', [9.0, 37.0, 123.0])
def test_corners_of_a_text_are_where_intervals_end(stiffness):
    """A mass on a spring, 20 periods: corners lie anywhere in steps, also near their ends."""
    scene = f"""
title: A mass on a spring
mechanism: linkage
links: {{m: {{mass: 1 kg}}}}
joints: {{g: {{prismatic: [ground, m], axis: 0 deg}}}}
gravity: [0, 0]
springs: {{s: {{coordinate: m, stiffness: {stiffness} N/m}}}}
initial: {{position: {{m: 0.3 m}}}}
"""
    w, x = math.sqrt(stiffness), 0.3
    run = ms.simulate(scene, duration=20.0 * 2.0 * math.pi / w)
    for text, expected in {
        'integral(abs(velocity.m))': 80.0 * x,
        'integral(max(velocity.m, 0 m/s))': 40.0 * x,
        'integral(velocity.m if velocity.m > 0 m/s else 0 m/s)': 40.0 * x,
        'mean(sign(velocity.m) * velocity.m)': 2.0 * x * w / math.pi,
        'mean(abs(abs(position.m) - 0.15 m))': (
            2.0 * x / math.pi * (math.sqrt(3.0) - 1.0 - math.pi / 12.0)
        ),
        'rms(min(position.m, 0 m))': 0.5 * x,
    }.items():
        found = one((run.machine, run), text)
        assert found.value == pytest.approx(expected, rel=1e-11), text
        assert found.resolution == EXACT


@pytest.mark.parametrize(
    ('name', 'same'),
    [('max', 'highest'), ('greatest', 'highest'), ('min', 'lowest'), ('least', 'lowest'),
     ('average', 'mean')],
)  # fmt: skip
def test_other_names_of_figures_are_understood(nominal, name, same):
    other = one(nominal, f'{name}(drive_torque, from 0.1 s)')
    assert other[1:3] == one(nominal, f'{same}(drive_torque, from 0.1 s)')[1:3]
    assert one(nominal, f'max({name}(drive_torque), 1 kN m)').value == 1000.0


def test_windows_and_names_are_read():
    m = read('rms(motor.torque, from 300 ms to 2 s) / 2')
    (figure,) = m.figures
    assert (figure.since, figure.until) == ((0.3, False), (2.0, False))
    assert read('count(impacts.pin, per revolution)').figures[0].per_revolution
    assert read('percentile(x, 95, from 3 rev)').figures[0].percent == 95


def test_a_scene_names_its_measures_and_moves_as_before(nominal, capsys):
    plain, solution = nominal
    texts = {'peak': 'largest(reaction.coupler_rocker)', 'half': 'rms(drive_torque)/2'}
    named = {'measures': texts}
    machine = ms.load_scene('four_bar_nominal', named)
    assert machine.fingerprint == plain.fingerprint
    found = measure(machine, solution)
    assert [(m.name, m.unit) for m in found] == [('peak', 'N'), ('half', 'N m')]
    given = ['--set', 'measures.peak=largest(reaction.coupler_rocker)', '--measure', 'peak']
    given += ['--measure', 'b = mean(drive_torque)', '--json']
    with pytest.raises(SystemExit):
        main(['solve', 'four_bar_nominal', *given])
    seen = json.loads(capsys.readouterr().out)['measures']
    assert list(seen) == ['peak', 'b']
    assert seen['peak']['value'] == pytest.approx(13.8987, rel=1e-5)
    assert seen['peak']['resolution'] == EXACT
    for override, said in (
        ({'measures': {'peak': 'largest(x)'}}, "there is no quantity 'x'"),
        ({'measures': {'peak': 'large(x)'}}, "measures.peak: 'large' in"),
        (
            {
                'measures': {'x': 'rms(tip)'},
                'sensors': {'tip': {'link': 'rocker', 'sample_rate': '1 kHz'}},
            },
            "in measures its samples are 'sensors.tip'",
        ),
    ):
        bad = ms.load_scene('four_bar_nominal', override)
        with pytest.raises(InputError, match=said):
            check_measures(bad, bad.scene.measures, 'measures')


WORDS = (
    'largest', 'rms', 'count', 'percentile', 'work', 'min', 'abs', 'sqrt', 'hypot', '_quantity',
    '_0', 'drive_torque', 'reaction.coupler_rocker', 'impacts', 'impacts.t', 'sensors.x',
    'motor.torque', 'pi', '(', ')', '(', ')', ',', '+', '-', '*', '/', '**', '<', '>=', ' if ',
    ' else ', ' and ', 'not ', '=', '2', '0', '1e400', '3 N', '2 s', '5 kN mm', ', from 2 s',
    ', to 1 revolution', ', per revolution', ' from ', "'a'", '[0]', 'lambda: ', '\\n', 'é',
)  # fmt: skip


def test_any_text_is_a_measure_or_refused(nominal):
    """Random words, many of them nearly right: no other exception gets out."""
    random = np.random.default_rng(3)
    kept, refused = 0, []
    for _ in range(4000):
        text = ''.join(random.choice(WORDS, random.integers(1, 9)))
        if random.random() < 0.7:
            text = f'{random.choice(WORDS[:10])}({text})'
        try:
            taken = read(text)
            kept += 1
            if kept <= 15:
                measure(*nominal, taken.text)
        except InputError as error:
            refused.append(str(error))
    assert kept > 15
    assert all(len(said.splitlines()) == 1 for said in refused)


HUGE = '1' + '0' * 400


@pytest.mark.parametrize(
    'text',
    [
        f'largest(reaction.ground_crank) * {HUGE}',
        f'largest(reaction.ground_crank * {HUGE})',
        f'largest(reaction.ground_crank + {HUGE} N)',
        f'largest(reaction.ground_crank, from {HUGE} s)',
        f'largest(reaction.ground_crank, from {HUGE} revolutions)',
        f'largest(reaction.ground_crank, per {HUGE})',
        f'percentile(reaction.ground_crank, {HUGE})',
        f'largest(reaction.ground_crank)^{HUGE}',
        'largest(reaction.ground_crank) * 1e400',
        HUGE,
    ],
    ids=range(10),
)
def test_a_number_that_no_computer_holds_is_a_sentence(text, nominal):
    machine, run = nominal
    with pytest.raises(InputError) as error:
        measure(machine, run, text)
    assert '\n' not in str(error.value)
