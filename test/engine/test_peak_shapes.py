"""Durations and impulses of peaks of loads: pulses of known shape."""

import itertools
import math

import numpy as np
import pytest
from builders import made
from running import run, run_json
from scipy.special import erf

import mechanism_sim as ms
from mechanism_sim.analysis.summary import load_summary
from mechanism_sim.numerics.extremes import ExtremeSearch
from mechanism_sim.results.ranges import LoadPeaks, QuantityRanges

SPEED = 40.0


def wheel(torque, **more):
    """A link that a drive turns at a steady speed against a torque: that is the drive's, too."""
    return made({
        'title': 'Wheel',
        'links': {'wheel': {'mass': 1.0, 'inertia': 0.1}},
        'joints': {'shaft': {'revolute': ['ground', 'wheel']}},
        'loads': {'brake': {'at': 'wheel', 'torque': torque}},
        'drive': {'coordinate': 'wheel', 'speed': SPEED, 'start_angle': 0.0},
        'gravity': [0.0, 0.0], **more,
    }, 'wheel')  # fmt: skip


@pytest.mark.parametrize('width', [pytest.param(5e-3, marks=pytest.mark.slow), 0.03])
def test_a_pulse_lasts_as_long_as_it_is_wide(width):
    """A bell curve: of microseconds at this speed, and of a millisecond."""
    machine = wheel(f'-500*exp(-((wheel-2.0)/{width})**2)')
    shape = ms.cycle(machine, samples=36).peaks()['drive_torque']
    time, half = width / SPEED, math.sqrt(math.log(2.0))
    assert shape.whole
    assert (shape.begin, shape.end) == pytest.approx(
        (2.0 / SPEED - half * time, 2.0 / SPEED + half * time), abs=1e-8 * time + 1e-16
    )
    assert shape.duration == pytest.approx(2.0 * half * time, rel=1e-8)
    assert shape.impulse == pytest.approx(500.0 * time * math.sqrt(math.pi) * erf(half), rel=1e-8)


def test_a_step_begins_and_ends_at_once():
    points = [[0, 2], [90, 2], [90, 7], [91, 7], [91, 2], [360, 2]]
    table = {'points': [[f'{a} deg', f'{m} N m'] for a, m in points], 'cyclic': True}
    machine = wheel('-step(wheel)', tables={'step': table})
    shape = ms.cycle(machine, samples=36).peaks()['drive_torque']
    time = np.radians(1.0) / SPEED
    assert shape.whole
    assert shape.duration == pytest.approx(time, rel=1e-9)
    assert shape.impulse == pytest.approx(7.0 * time, rel=1e-9)


def test_a_load_that_stays_is_longer_than_the_run():
    shape = ms.cycle(wheel('-5-0.1*sin(wheel)'), samples=36).peaks()['drive_torque']
    assert not shape.whole
    assert shape.duration == pytest.approx(2.0 * math.pi / SPEED, rel=1e-12)


def test_a_peak_between_batches_is_one():
    """The run in pieces that end within the pulse, as the messages of a bag do."""
    machine = wheel('-500*exp(-((wheel-2.0)/0.05)**2)')
    motion = ms.simulate(machine, duration=0.1).motion
    peaks = LoadPeaks(machine, shapes=True)
    times = [0.0, 0.03, 0.0495, 0.0498, 0.0502, 0.051, 0.07, 0.1]
    for a, b in itertools.pairwise(times):
        peaks.add(motion.between(a, b))
    shape = peaks.shapes()['drive_torque.wheel']
    time, half = 0.05 / SPEED, math.sqrt(math.log(2.0))
    assert shape.whole
    assert shape.duration == pytest.approx(2.0 * half * time, rel=1e-8)


def test_peaks_of_a_motion_have_their_duration():
    """As `cycle` has them; the summary of a bag is made of the same."""
    machine = ms.load_scene('punch')
    peaks = LoadPeaks(machine, shapes=True, bearings=True)
    for piece in ms.stream(machine, duration=0.5):
        peaks.add(piece.motion)
    loads = load_summary(peaks.peaks(), peaks.shapes(), lambda _: None)
    found = ms.cycle(machine, samples=36).peaks()
    for peak in (*loads.joints, loads.drive_torque):
        name = f'reaction.{peak.name}.size' if peak.name != 'drive' else 'drive_torque'
        assert peak.whole
        assert peak.duration == pytest.approx(found[name].duration, rel=1e-6)
        assert peak.impulse == pytest.approx(found[name].impulse, rel=1e-6)


def test_the_summary_of_loads_has_the_efforts_of_all_drives():
    """A force and a torque: of a table that is lifted and of what turns on it."""
    machine = made({
        'mechanism': 'linkage',
        'gravity': [0, '-10 m/s^2'],
        'links': {'table': {'mass': '2 kg'}, 'arm': {'length': '0.5 m', 'cog': '0.2 m',
                                                     'mass': '3 kg', 'inertia': '0 kg m^2'}},
        'joints': {'guide': {'prismatic': ['ground', 'table'], 'axis': '90 deg'},
                   'pin': {'revolute': ['table', 'arm']}},
        'drive': {'coordinate': 'arm', 'speed': '0.1 rad/s'},
        'drives': {'table': {'speed': '1 m/s'}},
    })  # fmt: skip
    peaks = LoadPeaks(machine)
    for piece in ms.stream(machine, duration=0.5):
        peaks.add(piece.motion)
    sliding = machine.physics.displacements
    found = load_summary(peaks.peaks(), {}, lambda _: None, sliding=sliding)
    (table,), arm = found.other_drives, found.drive_torque
    assert [(x.name, x.unit) for x in (arm, table)] == [('drive', 'N m'), ('drive of table', 'N')]
    assert arm.value == pytest.approx(3.0 * 10.0 * 0.2, rel=1e-12)
    assert table.value == pytest.approx(50.0, rel=1e-12)
    assert found.peaks == (*found.joints, arm, table)


@pytest.fixture
def looks(monkeypatch):
    """Instants at which ranges of quantities were evaluated."""
    seen, evaluate = [], QuantityRanges._values

    def counted(self, motion, k, dt):
        found = evaluate(self, motion, k, dt)
        seen.append(found.shape[1])
        return found

    monkeypatch.setattr(QuantityRanges, '_values', counted)
    return seen


def test_a_load_that_grows_costs_no_more_in_batches(looks):
    """It is largest at the end of each, and above half of that for half of the run."""
    machine = wheel('-5-20*t')
    motion = ms.simulate(machine, duration=6.0).motion
    found = []
    for most in (1, len(motion)):
        looks.clear()
        peaks = LoadPeaks(machine, shapes=True)
        for part in motion.parts(most):
            peaks.add(part)
        shape = peaks.shapes()['drive_torque.wheel']
        found.append((sum(looks), peaks.peaks()))
        assert not shape.whole
        assert shape.end == pytest.approx(6.0, rel=1e-12)
    (each, peaks), (at_once, same) = found
    assert len(motion) > 500
    assert peaks == same
    assert each <= 2 * at_once


def test_rounding_of_a_rack_far_from_its_start_is_not_searched(looks):
    """Its transmission error is nothing but the rounding of a displacement that grows."""
    motion = ms.simulate('rack_and_pinion', revolutions=80).motion
    peaks = LoadPeaks(ms.load_scene('rack_and_pinion'), others=['transmission_error.mesh'])
    for part in motion.parts(64):
        peaks.add(part)
    low, high = peaks.ends()['transmission_error.mesh']
    assert max(-low.value, high.value) < 1e-14
    assert sum(looks) < 40 * len(motion)


def test_a_measure_of_nothing_but_rounding_is_not_searched(monkeypatch):
    looked, examine = [], ExtremeSearch._examine

    def counted(self, functions, x):
        looked.append(len(x.a))
        return examine(self, functions, x)

    monkeypatch.setattr(ExtremeSearch, '_examine', counted)
    figures = {'measures': ['e = largest(transmission_error.mesh)'], 'columns': []}
    found = ms.ensemble('rack_and_pinion', {'drive.speed': ['60 rpm']}, revolutions=20, **figures)
    assert float(found['e'][0]) < 1e-14
    assert sum(looked) < 1000


@pytest.mark.network
@pytest.mark.slow
def test_peaks_are_told_with_their_duration(tmp_path):
    bag = tmp_path / 'run.mcap'
    assert run('run', 'punch', '--record', str(bag)).returncode == 0
    loads = run_json('analyze', str(bag))['loads']
    found = run_json('cycle', 'punch', '--duration', '0.5')['peaks']
    for peak in [*loads['joints'], loads['drive_torque']]:
        name = f'reaction.{peak["name"]}.size' if peak['name'] != 'drive' else 'drive_torque'
        assert peak['whole']
        assert peak['duration'] == pytest.approx(found[name]['duration'], rel=1e-6)
        assert peak['impulse'] == pytest.approx(found[name]['impulse'], rel=1e-6)
    assert 'above half for' in run('analyze', str(bag)).stdout
    line = f'drive_torque is above half of its peak for {found["drive_torque"]["duration"]:.4g} s'
    assert line in run('cycle', 'punch').stdout
