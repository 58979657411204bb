"""Ensembles: rows of values in, the figures of a sweep out, whoever computes them."""

from __future__ import annotations

import math

import numpy as np
import pyarrow.parquet as pq
import pytest
from four_bars import RADIAL

import mechanism_sim as ms
from mechanism_sim.errors import InputError, RunWarning
from mechanism_sim.scene.load import unit_at
from mechanism_sim.studies.plan import read_plan
from mechanism_sim.studies.row import SweepTask
from mechanism_sim.studies.runs import compute

SCENE = 'four_bar_clearance'
RESTITUTION = RADIAL.replace('radial', 'restitution')
TABLE = {
    RADIAL: ['0.1 mm', '0.2 mm', '0.254 mm'],
    RESTITUTION: [0.4, 0.5, 0.6],
    'drive.speed [rpm]': [300, 350, 250],
}
EXTENT = {'revolutions': 3, 'skip': 1}


@pytest.fixture(scope='module')
def table():
    """Figures of three machines, all columns, their runs kept."""
    return ms.ensemble(
        SCENE, TABLE, measures=['top = highest(velocity.rocker)'], keep=True, **EXTENT
    )


def swept():
    """Columns of a sweep of the same machines, by the tasks of a sweep."""
    runs = [
        {RADIAL: r, RESTITUTION: e, 'drive.speed': f'{s} rpm'}
        for r, e, s in zip(*TABLE.values(), strict=True)
    ]
    source = {'scene': SCENE, 'runs': runs, **EXTENT}
    plan = read_plan(source, ['top = highest(velocity.rocker)'])
    rows = [
        compute(SweepTask(r.key, r.name, r.scene, plan.extent, measures=r.measures)).row
        for r in plan.runs
    ]
    return plan.table(rows)


@pytest.mark.slow
def test_columns_units_and_figures_are_those_of_a_sweep(table):
    for column in swept():
        assert table.units[column.name] == column.unit
        given = np.array([np.nan if x is None else x for x in column.values])
        assert (table[column.name] == given).all() or np.isnan(given.astype(float)).all()
    assert list(table) == [c.name for c in swept()]


def test_the_run_that_is_kept_is_that_of_simulate(table):
    overrides = {RADIAL: '0.2 mm', RESTITUTION: 0.5, 'drive.speed': '350 rpm'}
    alone = ms.simulate(ms.load_scene(SCENE, overrides), revolutions=3)
    kept = table.solutions[1]
    assert kept.impacts == alone.impacts
    assert (kept.motion.curve.coefficients == alone.motion.curve.coefficients).all()


def rows_of(table):
    names = list(table)
    return [dict(zip(names, row, strict=True)) for row in zip(*table.values(), strict=True)]


def structured(table):
    names = [n for n in table if n != RADIAL]
    kinds = [(n, float) for n in names]
    return np.array([tuple(r[n] for n in names) for r in rows_of(table)], dtype=kinds)


@pytest.mark.parametrize('form', [rows_of, structured, 'pandas'])
def test_a_table_is_rows_an_array_or_a_frame(form):
    if form == 'pandas':
        form = pytest.importorskip('pandas').DataFrame
    wanted = {'columns': ['impacts', 'impulse'], 'revolutions': 1}
    values = {RADIAL: [1e-4, 2e-4], RESTITUTION: np.array([0.4, 0.6])}
    if form is structured:
        values = {RESTITUTION: values[RESTITUTION], 'drive.speed [rpm]': [300, 350]}
    one, other = (ms.ensemble(SCENE, x, **wanted) for x in (values, form(values)))
    assert list(one) == list(other)
    assert all((one[name] == other[name]).all() for name in one)
    assert 'impulse' in other.to_frame().columns


def test_only_columns_that_are_wanted_are_there(table):
    some = ms.ensemble(
        SCENE, TABLE, columns=['impacts', 'largest_impulse.coupler_rocker'], **EXTENT
    )
    assert list(some) == [
        'run', RADIAL, RESTITUTION, 'drive.speed', 'impacts', 'largest_impulse.coupler_rocker',
        'status',
    ]  # fmt: skip
    assert all((some[name] == table[name]).all() for name in some)


def test_a_row_that_fails_says_why_and_others_go_on():
    given = {'start': 'centred', 'initial.position.rocker': [2.0, 2.1257118]}
    found = ms.ensemble(SCENE, given, revolutions=1, keep=True, columns=['steps', 'digest'])
    assert 'initial.position puts the pin' in found['status'][0]
    assert found['status'][1] == 'done'
    assert np.isnan(found['steps'][0])
    assert found['digest'][0] is None
    assert found.solutions[0] is None
    assert found.solutions[1].digest() == found['digest'][1]


def test_whole_numbers_are_such_in_memory_as_in_files(tmp_path):
    """Unless one is missing."""
    runs = {'scene': SCENE, 'revolutions': 1, 'grid': {'drive.speed': [30, 31]}}
    found = ms.sweep(runs, tmp_path / 'table.parquet')
    kept = pq.read_table(tmp_path / 'table.parquet').to_pandas()
    assert found['run'].dtype == found['steps'].dtype == np.int64
    for name, values in found.items():
        assert values.dtype == object or values.dtype == kept[name].dtype, name
    assert ms.ensemble(SCENE, {'drive.speed': [30, 31]}, 1).to_frame().run.dtype == np.int64


@pytest.mark.parametrize(
    ('given', 'said'),
    [
        ({'drive.speed': []}, 'no rows'),
        ({'drive.sped': [30]}, "run 0 .*unknown key 'drive.sped'; did you mean 'speed'"),
        ({'drive.speed': [30, float('nan')]}, r'run 1 .*drive.speed = nan must be finite'),
        ({'drive.speed': [30, 31], RADIAL: [1e-4]}, 'columns must be of equal length'),
        ({'drive.speed [rmp]': [30]}, 'rmp'),
        ([30.0], 'row 0 is 30.0'),
        (30.0, 'row 0 is 30.0'),
    ],
)
def test_a_wrong_table_is_refused_in_one_sentence(given, said):
    with pytest.raises(InputError, match=said) as refused:
        ms.ensemble(SCENE, given, revolutions=1)
    assert '\n' not in str(refused.value)


@pytest.mark.parametrize(
    ('how', 'said'),
    [
        ({'columns': ['impact']}, "there is no 'impact'; did you mean 'impacts'"),
        ({'keep': True, 'workers': 2}, 'workers=1'),
        ({'duration': '1 s'}, "either 'revolutions' or 'duration'"),
        ({'skip': 1}, 'skip = 1'),
    ],
)
def test_options_that_cannot_be_are_refused(how, said):
    with pytest.raises(InputError, match=said):
        ms.ensemble(SCENE, {'drive.speed': [30]}, **{'revolutions': 1, **how})


@pytest.mark.slow
def test_rows_are_the_same_by_any_number_of_workers(table):
    measures = ['top = highest(velocity.rocker)']
    both = ms.ensemble(SCENE, TABLE, measures=measures, workers=2, **EXTENT)
    for name, values in table.items():
        assert np.array_equal(values, both[name], equal_nan=values.dtype == float), name


def test_rows_do_not_depend_on_those_before_them(table):
    other = ms.ensemble('slider_crank', {'drive.speed [rpm]': [60]}, revolutions=1)
    assert other['status'].tolist() == ['done']
    last = {path: values[-1:] for path, values in TABLE.items()}
    alone = ms.ensemble(SCENE, last, **EXTENT)  # in memory that runs of both machines have left
    assert alone['digest'][0] == table['digest'][2]
    assert alone['largest_force'][0] == table['largest_force'][2]


def test_numbers_without_a_unit_have_that_of_their_key():
    """Also where the scene does not give the key, or its unit depends on what it belongs to."""
    machine = ms.load_scene('planetary')
    units = {
        'links.sun.mass': 'kg', 'gears.sun.module': 'm', 'gears.sun.teeth': '',
        'drive.speed': 'rad/s', 'drive.start_angle': 'rad', 'links.carrier.cog': 'm',
        'gravity.1': 'm/s^2', 'links.no': '',
    }  # fmt: skip
    assert {path: unit_at(machine.scene, path) for path in units} == units
    table = ms.ensemble('pendulum', {'links.bar.mass': [1.0, 1.5]}, duration=0.1, columns=())
    assert table.units['links.bar.mass'] == 'kg'
    table = ms.ensemble('pendulum', {'gravity.1': [-9.81, -1.6]}, duration=0.1, columns=())
    assert (table['gravity.1'].tolist(), table.units['gravity.1']) == ([-9.81, -1.6], 'm/s^2')


def test_two_columns_of_one_value_are_refused():
    twice = {'drive.speed': ['300 rpm'], 'drive.speed [rpm]': [30]}
    with pytest.raises(InputError, match=r"two columns of 'drive\.speed': keep one"):
        ms.ensemble('slider_crank', twice, revolutions=1)


BEAD = """
title: A bead in oil, thrown at a stop beside a crank that turns
mechanism: linkage
links:
  crank: {length: 10 mm, mass: 0.1 kg, inertia: 1e-5 kg m^2}
  bead: {mass: 1 kg}
joints:
  gc: {revolute: [ground, crank]}
  guide: {prismatic: [ground, bead], axis: 0 deg, stops: {upper: 5 m, restitution: 0}}
gravity: [0, 0]
drive: {coordinate: crank, speed: 20 rad/s}
loads: {damper: {at: bead, force: [-0.5*vx, 0]}}
initial: {velocity: {bead: 4 m/s}}
"""


@pytest.mark.parametrize(('since', 'until'), [(0.25, 0.4), (0.27, 0.281), (0.55, 1.0)])
def test_windows_that_end_within_steps_hold_what_is_lost_in_them(since, until):
    """Energy of the bead: ``8 J exp(-t / 1 s)``; steps are 39 ms long."""
    found = ms.ensemble(BEAD, {'links.bead.mass': ['1 kg']}, duration=until, skip=f'{since} s')
    lost = 8.0 * (np.exp(-since) - np.exp(-until))
    assert found['dissipated'][0] * found['revolutions'][0] == pytest.approx(lost, rel=1e-12)


@pytest.mark.parametrize(('since', 'until'), [(0.25, 0.4), (0.28, 0.36)])
def test_windows_that_end_within_steps_hold_the_flight_in_them(since, until):
    """Pushed with 20 N it comes to a stop 1 m ahead after ``sqrt(0.1) s``, and stays there."""
    pushed = {
        'joints.guide.stops.upper': '1 m', 'loads.damper.force': [20.0, 0.0],
        'initial.velocity.bead': '0 m/s',
    }  # fmt: skip
    machine = ms.load_scene(BEAD, pushed)
    found = ms.ensemble(machine, {'links.bead.mass': ['1 kg']}, duration=until, skip=f'{since} s')
    share = (np.sqrt(0.1) - since) / (until - since)
    assert found['share_of_flight'][0] == pytest.approx(share, rel=1e-12)


@pytest.mark.parametrize(
    ('given', 'said'),
    [
        (
            [['drive.speed [rpm]'] * 2, [[300, 310]]],
            "two columns of 'drive.speed \\[rpm\\]': keep",
        ),
        ([['drive.speed [rpm]'], [[300], [np.nan]]], "a cell of 'drive.speed \\[rpm\\]' is empty"),
    ],
)
def test_cells_of_a_data_frame_that_are_none_are_refused(given, said):
    frame = pytest.importorskip('pandas').DataFrame(given[1], columns=given[0])
    with pytest.raises(InputError, match=said):
        ms.ensemble(SCENE, frame, **EXTENT)


def test_samples_that_were_cut_are_counted_for_each_run():
    name = 'sensors.rocker_accelerometer'
    with pytest.warns(RunWarning, match='were CUT at the end of its range in 1 of 2 runs'):
        found = ms.ensemble(SCENE, {f'{name}.adc': [{}, {'range': '20 m/s^2'}]}, revolutions=1)
    free, cut = found[f'sum({name}.overloads)']
    assert np.isnan(free)
    assert cut > 100


def test_texts_have_the_unit_of_their_heading():
    """Of files that are read as text, as by `csv.DictReader`: 60 rpm were taken as 60 rad/s."""
    rows = [{'drive.speed [rpm]': x, 'start': 'seated'} for x in ('60', ' 1e2 ', '120 rpm', 60)]
    found = ms.ensemble(SCENE, rows, revolutions=1, columns=[])
    assert found['drive.speed'] == pytest.approx(np.array([60, 100, 120, 60]) * math.pi / 30.0)
    assert found['start'].tolist() == ['seated'] * 4


def test_errors_name_the_machine_and_empty_frames_have_no_rows():
    pandas = pytest.importorskip('pandas')
    machine = ms.load_scene('slider_crank')
    with pytest.raises(InputError, match=r"slider_crank: unknown key 'drive.sped'"):
        ms.ensemble(machine, {'drive.sped': [1.0]}, revolutions=1)
    for frame in (pandas.DataFrame(), pandas.DataFrame({'drive.speed': []})):
        with pytest.raises(InputError, match='the table has no rows'):
            ms.ensemble(machine, frame, revolutions=1)
