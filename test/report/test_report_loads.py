"""The table of the largest loads: peaks beside what is not exceeded for most of the time."""

from __future__ import annotations

import numpy as np
import pytest
from builders import ROUGH, simulated
from running import run as command

import mechanism_sim as ms
from mechanism_sim.analysis.summary import LoadPeak, LoadSummary
from mechanism_sim.report.charts.charted_run import ChartedRun
from mechanism_sim.report.charts.subjects import loads
from mechanism_sim.report.charts.thinning import HeldLevels
from mechanism_sim.report.summary import load_rows, peaks_of
from mechanism_sim.results.measures import Measurement
from mechanism_sim.units import written


def test_a_peak_of_microseconds_is_named_as_such():
    short = LoadPeak('pin', 12930.0, 1.5, 0.5, 3.1e-6, 0.0251, True)
    long = LoadPeak('crank_pin', 700.0, 1.5, 0.5, 0.02, 9.0, True)
    drive = LoadPeak('drive', -2.0, 1.0, 0.5, 0.5, 1.0, False, 'N m')
    summary = LoadSummary(None, (short, long), drive)
    levels = {'pin': 450.0, 'crank_pin': 650.0, 'drive': 1.9}
    assert load_rows('crank', summary, levels)[1:] == [
        ('pin', '12.93 kN', '1.5', '28.65 deg', '3.1 µs', '25.1 mN s', '450 N'),
        ('crank_pin', '700 N', '1.5', '28.65 deg', '20 ms', '9 N s', '650 N'),
        ('drive', '-2 N m', '1', '28.65 deg', '>= 0.5 s', '>= 1 N m s', '1.9 N m'),
    ]
    assert [*peaks_of(summary, levels)] == [
        'pin: a peak of 3.1 µs with 25.1 mN s, 12.93 kN high; for 99.9 % of the time at most 450 N'
    ]


def test_levels_are_those_of_the_sorted_values():
    """Of uneven samples, each of which holds for its own time, in whatever pieces they come."""
    rng = np.random.default_rng(3)
    values, time = rng.lognormal(size=(4000)) * rng.choice([-1, 1], 4000), rng.uniform(size=4000)
    found = HeldLevels(['a', 'none'])
    for part in np.array_split(np.arange(4000), 7):
        found.add('a', values[part], time[part])
    order = np.argsort(np.abs(values))
    passed = np.cumsum(time[order]) / time.sum()
    for share in (0.5, 0.9, 0.999):
        exact = np.abs(values)[order][np.searchsorted(passed, share)]
        assert exact <= found.reached('a', share) <= exact * 1.0011
    assert found.reached('none', 0.5) == 0.0


def test_a_main_drive_without_torque_is_not_told_by_the_force_of_another():
    machine = ms.load_scene({
        'title': 'Two', 'mechanism': 'linkage',
        'links': {
            'arm': {'length': '0.2 m', 'mass': '1 kg', 'inertia': '0.01 kg m^2', 'cog': '0.1 m'},
            'slide': {'mass': '2 kg'},
        },
        'joints': {'a': {'revolute': ['ground', 'arm']}, 's': {'prismatic': ['ground', 'slide']}},
        'drive': {'coordinate': 'arm', 'torque': {}, 'speed': '5 rad/s'},
        'drives': {'slide': {'speed': '0.1 m/s', 'acceleration': '3 m/s^2'}},
    })  # fmt: skip
    *_, row, other = loads(ChartedRun(simulated(machine, duration=1.0), 0)).table
    assert row[:2] == ('drive', '0 N m')
    assert other[:2] == ('drive of slide', '6 N')


@pytest.mark.slow
def test_a_moment_of_a_bearing_is_not_told_by_the_force_of_its_joint():
    """At the end of its pin it is the force by half the bushing's length, at all times."""
    record = simulated('four_bar_misaligned', revolutions=1)
    rows = {name: (largest, level) for name, largest, *_, level in loads(ChartedRun(record)).table}
    force, moment = (
        [float(text.partition(' ')[0]) for text in rows[name]]
        for name in ('coupler_rocker', 'coupler_rocker.moment')
    )
    assert rows['coupler_rocker.moment'][1].endswith(' N m')
    lever = 0.5 * record.machine.scene.joints['coupler_rocker'].clearance.length
    assert moment == pytest.approx([lever * x for x in force], rel=2e-3)


def test_loads_of_a_run_are_those_of_its_measures():
    """The largest, and percentiles by adaptive crossings of levels in the motion itself."""
    record = simulated('four_bar_clearance', ROUGH, revolutions=4)
    head, *rows = loads(ChartedRun(record, 1)).table
    assert head[-1] == '99.9 % of the time at most'
    joints = [*record.machine.physics.joints]
    assert [row[0] for row in rows] == [*joints, 'drive']
    names = [*(f'reaction.{j}.size' for j in joints), 'abs(drive_torque)']
    begin = record.begin(1)
    asked = [f'percentile({name}, 99.9)' for name in names]
    asked += [f'max({name})' for name in names]
    taken = Measurement(record.machine, asked, begin)
    taken.add(record.piece)
    exact = [m.value for m in taken.found()]
    for row, level, most in zip(rows, exact, exact[len(names) :], strict=False):
        unit = 'N m' if row[0] == 'drive' else 'N'
        assert row[1].lstrip('-') == written(most, unit)
        assert float(row[-1].split()[0]) == pytest.approx(level, rel=5e-3), row


def test_loads_of_all_drives_are_told():
    """As measures have them; it was the main drive alone."""
    record = simulated('loader', duration=0.5)
    head, *rows = loads(ChartedRun(record, 0)).table
    taken = Measurement(record.machine, [
        f'{what}(abs(drive_torque.{c}){more})' for c in ('lift_rod', 'bucket_rod')
        for what, more in (('max', ''), ('percentile', ', 99.9'))
    ])  # fmt: skip
    taken.add(record.piece)
    exact = [m.value for m in taken.found()]
    names = 'drive', 'drive of bucket_rod'
    for row, name, most, level in zip(rows[-2:], names, exact[::2], exact[1::2], strict=True):
        assert row[:2] == (name, written(most, 'N'))
        assert row[-1] == written(level, 'N')
    assert head[-1] == '99.9 % of the time at most'


def test_the_start_of_a_run_can_be_left_out(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = ms.simulate('four_bar_clearance', revolutions=2)
    end = run.motion.curve.end
    turn = end / 2.0
    skipped, later = (
        ('--revolutions', '2', '--skip', '1'),
        ('--from', f'{turn!r} s', '--to', f'{end!r}'),
    )
    for name, asked in ('a.csv', skipped), ('b.csv', later):
        done = command('plot', 'four_bar_clearance', 'drive_torque', *asked, '-o', name)
        assert done.returncode == 0, done.stderr
    one, two = (np.loadtxt(name, delimiter=',', skiprows=1) for name in ('a.csv', 'b.csv'))
    assert one[0, 0] == pytest.approx(turn, rel=1e-12)
    assert one[:, 1].max() == pytest.approx(two[:, 1].max(), rel=1e-9)
    done = command('report', 'four_bar_clearance', '--skip', '1', '--from', '0.1 s')
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    assert 'give either --from or --skip' in done.stderr
