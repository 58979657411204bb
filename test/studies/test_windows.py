"""Windows of sweeps: what the node publishes, with the right labels, whoever interrupts."""

from __future__ import annotations

import importlib.util
import itertools
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pyarrow.dataset
import pyarrow.parquet as pq
import pytest
import yaml
from four_bars import RADIAL
from running import ROOT, command, environment, run, run_json

import mechanism_sim as ms
from mechanism_sim import process_exit
from mechanism_sim.errors import InputError, RunWarning
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.sensing.channel import Block
from mechanism_sim.studies.journal import StudyInterrupted
from mechanism_sim.studies.plan import read_plan
from mechanism_sim.studies.runs import Workers
from mechanism_sim.studies.schema import WindowsPart
from mechanism_sim.studies.sweep import run_plan
from mechanism_sim.studies.windows import Cutter, check

SENSOR = 'sensors.rocker_accelerometer'
SWEEP = f"""
scene: four_bar_clearance
set:
  {SENSOR}.transducer: {{natural_frequency: 42 kHz}}
  {SENSOR}.anti_alias: {{frequency: 4 kHz}}
  {SENSOR}.adc: {{range: 2000 m/s^2, bits: 14, jitter: 1 us}}
grid:
  {RADIAL}: [0.0254 mm, 0.1016 mm, 0.1778 mm, 0.254 mm]
  {SENSOR}.noise.rms: [0, 5 m/s^2]
windows: {{samples: 512, overlap: 0.25, per_run: 9, type: float64}}
revolutions: 4
skip: 1
"""
RUNS, MOTIONS, EACH = 8, 4, 9
FILES = [f'run_{k:05d}.parquet' for k in range(RUNS)]


def sweep_file(folder, text, name='cut.yaml'):
    file = folder / name
    file.write_text(text, encoding='utf-8')
    return str(file)


@pytest.fixture(scope='module')
def reference(tmp_path_factory):
    """The sweep by one worker: its table; its windows are beside it."""
    folder = tmp_path_factory.mktemp('windows')
    table = folder / 'one.parquet'
    args = 'sweep', sweep_file(folder, SWEEP), '-o', str(table), '--workers', '1'
    summary = run_json(*args)
    assert (summary['runs'], summary['computed'], summary['failed']) == (RUNS, MOTIONS, 0)
    assert summary['windows'] == RUNS * EACH
    return table


SMALL = f"""
scene: four_bar_clearance
set: {{{SENSOR}.adc: {{range: 2000 m/s^2, bits: 14, jitter: 1 us}}}}
grid:
  {RADIAL}: [0.0254 mm, 0.254 mm]
  {SENSOR}.noise.rms: [0, 5 m/s^2]
windows: {{samples: 256, per_run: 3, type: float64}}
revolutions: 2
skip: 1
"""


def folder_of(table):
    return table.with_suffix('.windows')


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def rows_of(table):
    return pyarrow.dataset.dataset(folder_of(table)).to_table().to_pylist()


@pytest.mark.network
@pytest.mark.slow
def test_windows_are_what_the_node_publishes(reference, tmp_path):
    """The same samples to the last bit, by messages of a run in another process."""
    rows = [row for row in rows_of(reference) if row['run'] == 5]
    bag = str(tmp_path / 'run.mcap')
    chosen = {
        RADIAL: '0.1778 mm', f'{SENSOR}.noise.rms': '5 m/s^2',
        f'{SENSOR}.noise.seed': str(rows[0]['seed']),
        f'{SENSOR}.transducer.natural_frequency': '42 kHz',
        f'{SENSOR}.anti_alias.frequency': '4 kHz',
        f'{SENSOR}.adc.range': '2000 m/s^2', f'{SENSOR}.adc.bits': '14',
        f'{SENSOR}.adc.jitter': '1 us',
    }  # fmt: skip
    sets = [word for key, value in chosen.items() for word in ('--set', f'{key}={value}')]
    args = 'run', 'four_bar_clearance', *sets, '--revolutions', '4', '--record', bag
    done = run(*args)
    assert done.returncode == 0, done.stderr
    messages = [m for _, m, _ in read_bag(bag).messages(['/accelerometer/rocker_accelerometer'])]
    signal = np.concatenate([m.samples for m in messages])
    for row in rows:
        first = round(row['start'] * 10000.0)
        assert row['start'] == first / 10000.0
        assert np.array_equal(row['signal'], signal[first : first + 512])
    assert np.std(signal) > 10.0


@pytest.mark.slow
def test_every_row_has_the_labels_of_its_run(reference, tmp_path):
    plan = read_plan(sweep_file(tmp_path, SWEEP))
    rows = rows_of(reference)
    assert [row['run'] for row in rows] == [run for run in range(RUNS) for _ in range(EACH)]
    assert [row['window'] for row in rows] == [*range(EACH)] * RUNS
    period = plan.runs[0].scene.drive.speed.value
    for row in rows:
        made = plan.runs[row['run']]
        assert {c: row[c] for c in plan.columns} == dict(made.values)
        assert row['seed'] == made.scene.sensors['rocker_accelerometer'].noise.seed
        assert (row['sample_rate'], row['quantity']) == (10000.0, 'acceleration')
        assert row['crank_speed'] == pytest.approx(period, rel=1e-12)
        angle = row['start'] * period % (2.0 * np.pi)
        assert row['crank_angle'] == pytest.approx(angle, abs=1e-12)
        assert row['start'] >= 2.0 * np.pi / period
    starts = np.array([row['start'] for row in rows[:EACH]])
    assert np.diff(starts) == pytest.approx(384 / 10000.0)
    assert len({row['seed'] for row in rows}) == RUNS
    assert {row[RADIAL] for row in rows} == {2.54e-5, 1.016e-4, 1.778e-4, 2.54e-4}


@pytest.mark.slow
def test_runs_that_differ_in_their_sensors_share_a_motion_but_no_noise(reference):
    rows = rows_of(reference)
    quiet, loud = (np.array([r['signal'] for r in rows if r['run'] == k]) for k in (6, 7))
    noise = loud - quiet
    steps = 2.0 * 2000.0 / 2**14
    assert np.std(noise) == pytest.approx(5.0, rel=0.05)
    assert np.allclose(quiet / steps, np.round(quiet / steps))
    other = [np.array([r['signal'] for r in rows if r['run'] == k]) for k in (4, 5)]
    both = np.corrcoef(noise.ravel(), (other[1] - other[0]).ravel())[0, 1]
    assert abs(both) < 0.05


@pytest.mark.slow
def test_frames_that_differ_are_heard_on_one_motion(tmp_path):
    stiffness = 'oscillators.frame.mounts.left.stiffness'
    text = (
        'scene: four_bar_on_frame\nduration: 0.3\nwindows: {samples: 500, type: float64}\n'
        f'grid: {{{stiffness}: [[3e5, 8e5], [6e5, 8e5]]}}\n'
    )
    table = tmp_path / 't.parquet'
    plan = read_plan(sweep_file(tmp_path, text))
    assert run_plan(plan, table, workers=1)[0].computed == 1
    rows = rows_of(table)
    for made in plan.runs:
        machine = ms.load_scene('four_bar_on_frame', {stiffness: made.given[stiffness]})
        motion = ms.simulate(machine, duration=0.3).motion
        for name in machine.scene.sensors:
            channel = machine.channel(name)
            channel.take(motion)
            alone = np.concatenate([block.samples for block in channel.blocks(final=True)])
            found = [r['signal'] for r in rows if (r['run'], r['sensor']) == (made.index, name)]
            assert found
            assert np.array_equal(np.concatenate(found), alone[: len(found) * 500])
    signals = [[r['signal'] for r in rows if r['run'] == k] for k in (0, 1)]
    assert not np.array_equal(*signals)


@pytest.mark.slow
def test_the_schema_says_units_and_a_reader_of_files_finds_all_of_them(reference):
    table = pq.read_table(folder_of(reference))
    assert table.num_rows == RUNS * EACH
    signal = table.schema.field('signal')
    assert (signal.type.list_size, str(signal.type.value_type)) == (512, 'double')
    assert table.schema.field('start').metadata[b'unit'] == b's'
    assert table.schema.field(RADIAL).metadata[b'unit'] == b'm'
    matrix = table['signal'].combine_chunks().flatten().to_numpy().reshape(-1, 512)
    assert matrix.shape == (RUNS * EACH, 512)
    assert np.isfinite(matrix).all()


@pytest.mark.slow
def test_float32_is_the_same_rounded(reference, tmp_path):
    text = SWEEP.replace('float64', 'float32')
    plan, table = read_plan(sweep_file(tmp_path, text)), tmp_path / 't.parquet'
    run_plan(plan, table, workers=1)
    short, full = (np.array([r['signal'] for r in rows_of(t)]) for t in (table, reference))
    assert np.array_equal(short, full.astype('float32'))


def same(table, reference):
    found, expected = contents(folder_of(table)), contents(folder_of(reference))
    assert sorted(name for name in found if not name.startswith('.')) == FILES
    assert all(found[name] == expected[name] for name in FILES)
    return table.read_bytes() == reference.read_bytes()


@pytest.mark.usefixtures('in_this_process')
def test_a_sweep_that_is_interrupted_or_loses_a_file_writes_the_same_windows(tmp_path):
    plan = read_plan(sweep_file(tmp_path, SMALL))
    one, table = tmp_path / 'one.parquet', tmp_path / 'two.parquet'
    run_plan(plan, one)

    def interrupt(*_):
        raise KeyboardInterrupt

    with pytest.raises(StudyInterrupted, match='after 1 of 2'):
        run_plan(plan, table, show=interrupt)
    assert not table.exists()
    for kept, computed in ((1, 1), (1, 1)):
        summary, _ = run_plan(plan, table)
        assert (summary.kept, summary.computed) == (kept, computed)
        assert table.read_bytes() == one.read_bytes()
        found, expected = contents(folder_of(table)), contents(folder_of(one))
        assert all(found[name] == expected[name] for name in FILES[:4])
        (folder_of(table) / FILES[3]).unlink()


@pytest.mark.usefixtures('in_this_process')
def test_windows_are_samples_of_the_channel_and_float32_is_the_same_rounded(tmp_path):
    """What nodes publish are the same samples: see the tests of nodes."""
    tables = []
    for kind in ('float64', 'float32'):
        plan = read_plan(sweep_file(tmp_path, SMALL.replace('float64', kind)))
        tables.append(tmp_path / f'{kind}.parquet')
        run_plan(plan, tables[-1])
    full, short = (np.array([r['signal'] for r in rows_of(t)]) for t in tables)
    assert np.array_equal(short, full.astype('float32'))
    name = SENSOR.partition('.')[2]
    for row in rows_of(tables[0])[-3:]:
        machine = ms.load_scene('four_bar_clearance', {
            RADIAL: '0.254 mm', f'{SENSOR}.noise': {'rms': '5 m/s^2', 'seed': row['seed']},
            f'{SENSOR}.adc': {'range': '2000 m/s^2', 'bits': 14, 'jitter': '1 us'},
        })  # fmt: skip
        channel = machine.channel(name)
        channel.take(ms.simulate(machine, revolutions=2).motion)
        signal = np.concatenate([block.samples for block in channel.blocks(final=True)])
        first = round(row['start'] * 10000.0)
        assert np.array_equal(row['signal'], signal[first : first + 256])


def test_a_run_is_not_refused_that_gives_just_as_many_windows_as_are_wanted():
    """0.07 s times 100 Hz are more than 7 in floats: windows may begin with sample 7 all the same.

    Of 20 samples those at 7 to 12 begin windows of 8.
    """
    machine = ms.load_scene('four_bar_clearance', {f'{SENSOR}.sample_rate': '100 Hz'})
    wanted = WindowsPart(samples=8, overlap=0.875, per_run=6)
    check(wanted, machine, 0.07, 0.2)
    block = Block(0.0, np.arange(20.0), np.zeros(20, bool), triggered=False)
    found = list(Cutter(wanted, 100.0, 0.07).cut([block]))
    assert [window.samples[0] for window in found] == [7.0, 8.0, 9.0, 10.0, 11.0, 12.0]
    with pytest.raises(InputError, match='gives 6 of 8 samples'):
        check(wanted.model_copy(update={'per_run': 7}), machine, 0.07, 0.2)


@pytest.mark.slow
def test_two_workers_write_the_same_files_and_a_lost_one_is_made_again(reference, tmp_path):
    plan, table = read_plan(sweep_file(tmp_path, SWEEP)), tmp_path / 'one.parquet'
    run_plan(plan, table, workers=2)
    assert same(table, reference)
    (folder_of(table) / FILES[3]).unlink()
    summary, _ = run_plan(plan, table, workers=1)
    assert (summary.kept, summary.computed) == (MOTIONS - 1, 1)
    assert same(table, reference)


@pytest.mark.slow
def test_a_killed_sweep_goes_on_and_writes_the_same_files(reference, tmp_path):
    file, table = sweep_file(tmp_path, SWEEP), tmp_path / 'one.parquet'
    journal = tmp_path / 'one.parquet.journal'
    process = subprocess.Popen(
        command('sweep', file, '-o', str(table), '--workers', '1'),
        env=process_exit.owned(environment()), start_new_session=True,
    )  # fmt: skip
    while not journal.exists() or journal.read_bytes().count(b'\n') < 3:
        assert process.poll() is None
        time.sleep(0.002)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    kept = journal.read_bytes().count(b'\n') - 1
    assert not table.exists()
    summary, _ = run_plan(read_plan(file), table, workers=1)
    assert (summary.kept, summary.computed) == (kept, MOTIONS - kept)
    assert same(table, reference)


@pytest.mark.usefixtures('in_this_process')
def test_a_trigger_begins_records_that_windows_do_not_leave(tmp_path):
    text = (
        'scene: four_bar_clearance\n'
        f'set: {{{SENSOR}.trigger: {{angle: 90 deg, samples: 1500}}}}\n'
        'windows: {samples: 700, per_run: 6, type: float64}\nrevolutions: 4\n'
    )
    table = tmp_path / 't.parquet'
    run_plan(read_plan(sweep_file(tmp_path, text)), table, workers=1)
    rows = rows_of(table)
    machine = ms.load_scene('four_bar_clearance', {f'{SENSOR}.trigger': {'angle': '90 deg'}})
    period = machine.drive.period
    assert [row['start'] for row in rows] == pytest.approx(
        [(0.25 + k) * period + shift for k in range(3) for shift in (0.0, 0.07)]
    )
    assert [row['crank_angle'] for row in rows[::2]] == pytest.approx([0.5 * np.pi] * 3)
    solution = ms.simulate(machine, revolutions=4)
    for row in rows:  # an ideal sensor reads the motion itself
        t = row['start'] + np.arange(700) / 10000.0
        at = solution.sample(t, 'acceleration.rocker')
        truth = 0.2 * at['acceleration.rocker']
        assert row['signal'] == pytest.approx(truth, abs=1e-6 * np.abs(truth).max())


@pytest.mark.usefixtures('in_this_process')
def test_a_run_with_too_few_triggers_fails_and_leaves_no_file(tmp_path):
    text = (
        'scene: four_bar_clearance\nrevolutions: 3\n'
        f'set: {{{SENSOR}.trigger: {{angle: 90 deg, samples: 1500}}}}\n'
        'windows: {samples: 700, per_run: 60}\n'
    )
    table = tmp_path / 't.parquet'
    folder_of(table).mkdir()
    (folder_of(table) / 'run_00000.parquet').write_bytes(b'of an earlier time')
    plan = read_plan(sweep_file(tmp_path, text))
    with pytest.raises(InputError, match='is not of this sweep'):
        run_plan(plan, table, workers=1)
    summary, rows = run_plan(plan, table, workers=1, restart=True)
    assert (summary.failed, summary.windows) == (1, 0)
    assert 'gave 5 windows, not 60' in rows[0]['status']
    assert not list(folder_of(table).iterdir())


@pytest.mark.slow
def test_the_example_learns_from_motions_it_was_not_asked_about(tmp_path):
    model_selection = pytest.importorskip('sklearn.model_selection')
    root = ROOT
    spec = importlib.util.spec_from_file_location('c', root / 'docs' / 'classify_clearance.py')
    sys.modules['c'] = example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    text = yaml.safe_load((root / 'config/sweeps/bearing_wear.yaml').read_text(encoding='utf-8'))
    text['grid'] |= {
        'drive.speed': ['300 rpm'], RADIAL: ['0.0254 mm', '0.254 mm'],
        f'{SENSOR}.noise.rms': ['1 m/s^2', '3 m/s^2'],
    }  # fmt: skip
    text |= {'windows': {'samples': 1024, 'per_run': 20}, 'duration': 2.5, 'skip': 0.4}
    table = tmp_path / 't.parquet'
    run_plan(read_plan(sweep_file(tmp_path, yaml.safe_dump(text))), table, workers=1)
    data = example.read(str(folder_of(table)))
    rows = rows_of(table)
    assert [data.clearances[k] for k in data.label] == [row[RADIAL] for row in rows]
    assert len(np.unique(data.motion)) == 8
    assert len(np.unique(data.run)) == 16
    signals = np.array([row['signal'] for row in rows])
    assert np.exp(data.figures[:, 0]) == pytest.approx(signals.std(axis=1))
    assert example.read(str(folder_of(table)), 4).figures == pytest.approx(data.figures[::4])
    folds = model_selection.GroupKFold(4).split(data.figures, data.label, data.motion)
    asked, said = example.predict(data, folds)
    assert np.sort(asked).tolist() == list(range(320))
    assert (said == data.label[asked]).mean() > 0.9
    assert example.vote(data, asked, said) == 1.0


def test_a_cutter_gives_the_same_windows_however_the_signal_comes():
    rng = np.random.default_rng(1)
    x = rng.standard_normal(1000)
    windows = WindowsPart(samples=64, overlap=0.375, type='float64')
    edges = [0, *np.sort(rng.choice(np.arange(1, 1000), 20, replace=False)), 1000]
    over = np.abs(x) > 1.5
    blocks = [Block(a / 100.0, x[a:b], over[a:b], False) for a, b in itertools.pairwise(edges)]
    found = list(Cutter(windows, 100.0, 1.0).cut(blocks))
    firsts = [k for k in range(0, 1000 - 63, 40) if k / 100.0 >= 1.0]
    assert [w.start for w in found] == [k / 100.0 for k in firsts]
    assert all(
        np.array_equal(w.samples, x[k : k + 64]) for w, k in zip(found, firsts, strict=True)
    )
    assert [w.overloads for w in found] == [int(over[k : k + 64].sum()) for k in firsts]


PROBED = """
scene: four_bar_clearance
set:
  sensors.open: {link: rocker, at: 100 mm}
grid: {sensors.rocker_accelerometer.adc: [{}, {range: 20 m/s^2}]}
windows: {samples: 256, per_run: 2, type: float64}
revolutions: 1
"""
CUT = f'sum({SENSOR}.overloads)'


def test_samples_cut_at_the_range_are_counted_in_windows_and_table_and_warned_of(tmp_path):
    table = tmp_path / 'cut.parquet'
    plan = read_plan(sweep_file(tmp_path, PROBED))
    with pytest.warns(RunWarning, match='were CUT .* in 1 of 2 runs, .* of them in run 1'):
        _, rows = run_plan(plan, table, Workers(1))
    seen = [[], []]
    for row in rows_of(table):
        probed = row['run'] == 1 and row['sensor'] == 'rocker_accelerometer'
        cut = int((np.abs(row['signal']) == 20.0).sum()) if probed else None
        assert row['overloads'] == cut
        seen[row['run']].append(cut or 0)
    assert [row.get(CUT) for row in rows] == [None, sum(seen[1])]
    assert sum(seen[1]) > 100
    assert pq.read_table(table)[CUT].to_pylist() == [None, sum(seen[1])]


SCENE = 'scene: four_bar_clearance\nrevolutions: 2\n'


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('windows: {sensors: [rocker_acelerometer]}', "did you mean 'rocker_accelerometer'"),
        ('windows: {samples: 1}', 'at least 2'),
        ('windows: {overlap: 1}', 'less than 1'),
        ('windows: {per_run: 0}', 'at least 1'),
        ('windows: {type: int8}', "allowed: 'float32' or 'float64'"),
        ('windows: {sample: 3}', "unknown key 'windows.sample'; did you mean"),
        ('windows: {samples: 100, per_run: 40}', 'gives 34 of 100 samples between 0 s'),
        ('skip: 1\nwindows: {samples: 2000}', 'gives 0 of 2000 samples between 0.17'),
        (f'set: {{{SENSOR}.trigger: {{samples: 99}}}}\nwindows: {{samples: 100}}', 'do not fit'),
    ],
)  # fmt: skip
def test_windows_that_cannot_be_are_refused_before_anything_runs(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        read_plan(sweep_file(tmp_path, SCENE + text + '\n'))


@pytest.mark.parametrize('ending', ['.npz', '.csv'])
def test_windows_are_not_put_into_a_folder_that_is_called_a_table(tmp_path, ending):
    plan = read_plan(sweep_file(tmp_path, SCENE + 'windows: {samples: 100}\n'))
    folder = tmp_path / f'a{ending}'
    with pytest.raises(InputError, match=f"Parquet files in a folder: .* without '{ending}'"):
        run_plan(plan, tmp_path / 't.csv', Workers(1), windows=str(folder))
    assert not folder.exists()


@pytest.mark.slow
def test_folders_that_would_mix_data_sets_are_refused(reference, tmp_path):
    file, table = sweep_file(tmp_path, SCENE + 'windows: {samples: 100}\n'), tmp_path / 't.parquet'
    args = 'sweep', file, '-o', str(table), '--windows'
    env = environment()
    bare = sweep_file(tmp_path, SCENE, 'bare.yaml')
    (tmp_path / 'file').write_text('', encoding='utf-8')
    for words, said in (
        ((*args, str(folder_of(reference))), 'is not of this sweep'),
        ((*args, str(tmp_path / 'file')), 'cannot be made'),
        (('sweep', bare, '-o', str(table), '--windows', 'w'), "has no key 'windows'"),
    ):
        done = run(*words, env=env)
        assert done.returncode == 2, done.stderr
        assert said in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    'workers', [(), pytest.param(('1', '2'), marks=pytest.mark.slow)], ids=['read', 'written']
)
def test_the_data_set_has_twenty_machines_and_the_same_bytes_for_any_workers(tmp_path, workers):
    """Two of its motions, shorter; as many windows as it says in all."""
    text = (ROOT / 'config/sweeps/loose_machines.yaml').read_text(encoding='utf-8')
    content = yaml.safe_load(text)
    runs, speeds = content['runs'], content['grid']['drive.speed']
    assert len(runs) * len(speeds) * content['windows']['per_run'] == 100_000
    assert len({run['title'] for run in runs}) == 20
    assert {len({r['description'] for r in runs if r['title'] == t['title']}) for t in runs} == {5}
    content['runs'], content['grid']['drive.speed'] = [runs[3], runs[8]], speeds[:1]
    content['windows']['per_run'], content['duration'], content['skip'] = 2, '0.5 s', '0.2 s'
    file, bytes_of = sweep_file(tmp_path, yaml.safe_dump(content), 'loose_machines.yaml'), []
    assert len(read_plan(file).runs) == 2
    for count in workers:
        table = tmp_path / f'{count}.parquet'
        run_json('sweep', file, '-o', str(table), '--workers', count)
        bytes_of.append(contents(folder_of(table)))
        assert len(bytes_of[0]) == 2
        assert bytes_of[0] == bytes_of[-1]
