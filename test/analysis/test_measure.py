"""Measures of runs from every source, and of scenes beside runs of other machines."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy
from bags import write_bag

import mechanism_sim as ms
from mechanism_sim.analysis.record import Record
from mechanism_sim.errors import InputError

TEXT = 'rms(drive_torque)'
FILTERED = {'kind': 'accelerometer', 'link': 'rod', 'sample_rate': '10 kHz',
            'anti_alias': {'frequency': '40 Hz', 'order': 4}}  # fmt: skip


def test_measures_are_of_a_run_from_any_source(tmp_path):
    run = ms.simulate('slider_crank', revolutions=1)
    bag = write_bag(tmp_path / 'run.mcap', Record(run.machine, run, {}))
    (given,) = ms.measure(run, TEXT)
    for source in (ms.open_run(run), bag, str(bag), ms.open_run(bag), ms.cycle('slider_crank'),
                   ms.stream('slider_crank', revolutions=1)):  # fmt: skip
        (found,) = ms.measure(source, TEXT)
        assert found.value == pytest.approx(given.value, rel=1e-12)
        assert found.unit == 'N m'
    assert ms.measure('slider_crank', run, TEXT) == ms.measure(run.machine, [run], TEXT) == [given]
    assert ms.measure(run, TEXT, since=None, until=None) == [given]
    assert {**ms.measure(run, TEXT, until='50 ms')[0]._asdict()} == {
        **ms.measure(run, 'rms(drive_torque, to 50 ms)')[0]._asdict(), 'name': TEXT, 'text': TEXT,
    }  # fmt: skip


def test_measures_of_a_cycle_are_without_the_run_before_it():
    """From 90 deg on, by Simpson's rule over its samples; and of static forces."""
    cycle = ms.cycle('slider_crank', start='90 deg', duration='40 ms', samples=2000)
    assert cycle.t[0] == pytest.approx(0.025)
    mean, late = ms.measure(cycle, 'mean(position.piston)', 'mean(position.piston, from 45 ms)')
    assert mean.value == pytest.approx(
        scipy.integrate.simpson(cycle['position.piston'], x=cycle.t) / 0.04, rel=1e-9
    )
    after = cycle.t >= 0.045 - 1e-9
    assert late.value == pytest.approx(
        scipy.integrate.simpson(cycle['position.piston'][after], x=cycle.t[after]) / 0.02, rel=1e-9
    )
    assert ms.measure(cycle, 'mean(position.piston)', since='45 ms')[0].value == late.value
    for static in (False, True):
        one = ms.cycle('slider_crank', static=static)
        (largest,) = ms.measure(one, 'highest(drive_torque)')
        assert largest.value == pytest.approx(
            one.extremes()['drive_torque'].greatest.value, rel=1e-9
        )


@pytest.mark.parametrize(('begin', 'end'), [(0.05, 0.1), (0.02, 0.05)])
def test_sensors_of_a_part_of_a_run_went_by_all_of_it(begin, end):
    """Their filters know what was before: the samples are those of the whole run."""
    machine = ms.load_scene('slider_crank', {'sensors': {'a': FILTERED}})
    record = ms.open_run(ms.simulate(machine, duration='0.1 s'))
    part, count = ms.measure(record.between(begin, end), 'rms(sensors.a)', 'count(sensors.a)')
    (whole,) = ms.measure(record, f'rms(sensors.a, from {begin} s, to {end} s)')
    assert part.value == pytest.approx(whole.value, rel=1e-12)
    rate = machine.scene.sensors['a'].sample_rate
    assert count.value == pytest.approx((end - begin) * rate, abs=1.0)


@pytest.mark.parametrize(
    ('given', 'said'),
    [
        (('slider_crank', TEXT), "'rms(drive_torque)' is of a run: give a solution before it"),
        (('slider_crank',), "'a measure' is of a run: give a solution before it"),
        (
            ('pendulum', 'RUN', 'mean(energy.kinetic)'),
            'the run is not one of <Machine pendulum: Pendulum>',
        ),
        (({'drive.speed': 1.0}, 'RUN', TEXT), 'slider_crank: Slider-crank, the crank drives> or '),
        (('RUN', TEXT, 3), 'measures = 3 is neither a text nor a list of texts'),
        (('bag.mcap', TEXT), 'bag.mcap does not exist'),
    ],
)
def test_what_is_no_run_of_the_machine_is_refused(given, said):
    run = ms.simulate('slider_crank', revolutions=1)
    first, *texts = (run if x == 'RUN' else x for x in given)
    first = ms.load_scene('slider_crank', first) if isinstance(first, dict) else first
    with pytest.raises(InputError) as caught:
        ms.measure(first, *texts)
    assert said in str(caught.value)


def test_a_window_is_made_of_numbers():
    run = ms.simulate('slider_crank', revolutions=1)
    for name in ('since', 'until'):
        with pytest.raises(InputError, match=f'{name} = nan is not a number'):
            ms.measure(run, TEXT, **{name: math.nan})
    assert ms.measure(run, TEXT, until=math.inf) == ms.measure(run, TEXT)
    assert ms.measure(run, TEXT, since=np.timedelta64(50, 'ms')) == ms.measure(
        run, TEXT, since='50 ms'
    )
