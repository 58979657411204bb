"""Sweeps: the plan, the rows, and the same table whatever computes it or interrupts it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
import running
from four_bars import RADIAL, loose
from running import ROOT, TIMEOUT, command, environment, run, run_json

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.batch_means import ratio
from mechanism_sim.studies.columns import FIGURES, own_columns
from mechanism_sim.studies.journal import StudyInterrupted
from mechanism_sim.studies.parameters import parameters
from mechanism_sim.studies.plan import Extent, read_plan
from mechanism_sim.studies.row import SweepTask
from mechanism_sim.studies.runs import DONE, compute
from mechanism_sim.studies.statistics import statistics
from mechanism_sim.studies.sweep import run_plan

SWEEP = f"""
scene: four_bar_clearance
set: {{drive.speed: 350 rpm}}
grid:
  {RADIAL}: [0.0254 mm, 0.254 mm]
  drive.start_angle: [0 deg, 90 deg, 180 deg, 270 deg]
  start: [seated, centred]
revolutions: 3
skip: 1
"""
RUNS = 16
SMALL = """
scene: four_bar_clearance
grid: {drive.start_angle: [0 deg, 90 deg, 180 deg, 270 deg]}
revolutions: 1
"""


def sweep_file(folder: Path, text: str, name: str = 'small.yaml') -> Path:
    file = folder / name
    file.write_text(text, encoding='utf-8')
    return file


def plan_of(folder: Path, text: str):
    return read_plan(str(sweep_file(folder, text)))


@pytest.fixture(scope='module')
def reference(tmp_path_factory):
    """The sweep by one worker, without interruption: its table and its folder."""
    folder = tmp_path_factory.mktemp('reference')
    file, table = sweep_file(folder, SWEEP), folder / 'one.parquet'
    summary = run_json('sweep', str(file), '-o', str(table), '--workers', '1')
    assert (summary['runs'], summary['failed'], summary['computed']) == (RUNS, 0, RUNS)
    return table


def keys_of(journal: Path):
    """Keys of the whole lines of a journal after its head."""
    lines = journal.read_bytes().split(b'\n')[:-1] if journal.exists() else []
    return [json.loads(line)['key'] for line in lines[1:]]


# --- the plan -----------------------------------------------------------------------------------


def test_a_grid_is_the_product_of_its_values_and_the_last_varies_fastest(tmp_path):
    plan = plan_of(tmp_path, SWEEP)
    assert plan.columns == (RADIAL, 'drive.start_angle', 'start')
    assert len(plan.runs) == RUNS
    assert [dict(r.values) for r in plan.runs[:3]] == [
        {RADIAL: 2.54e-5, 'drive.start_angle': 0.0, 'start': 'seated'},
        {RADIAL: 2.54e-5, 'drive.start_angle': 0.0, 'start': 'centred'},
        {RADIAL: 2.54e-5, 'drive.start_angle': np.pi / 2, 'start': 'seated'},
    ]
    assert all(r.scene.drive.speed.value == pytest.approx(350 * np.pi / 30) for r in plan.runs)
    assert len({r.key for r in plan.runs}) == RUNS


def test_listed_runs_are_combined_with_the_grid_and_repeated_from_nudged_starts(tmp_path):
    plan = plan_of(
        tmp_path,
        'runs:\n- {scene: four_bar_nominal}\n- {scene: four_bar_clearance, start: centred}\n'
        'grid: {drive.speed: [300 rpm, 350 rpm]}\nrepeat: 3\nnudge: 1e-3\nrevolutions: 2\n',
    )
    assert plan.columns == ('scene', 'start', 'drive.speed', 'repeat')
    assert [r.values['repeat'] for r in plan.runs] == [0, 1, 2] * 4
    assert [r.values['scene'] for r in plan.runs] == ['four_bar_nominal'] * 6 + [
        'four_bar_clearance'
    ] * 6
    assert [r.scene.drive.start_angle for r in plan.runs[6:9]] == [0.0, 1e-3, 2e-3]
    assert plan.runs[0].values['start'] == 'seated'  # what the scene says where a run says nothing


def test_what_one_run_sets_stays_in_that_run(tmp_path):
    plan = plan_of(
        tmp_path,
        'scene: four_bar_clearance\nrevolutions: 1\n'
        'set: {joints.coupler_rocker.clearance: {radial: 1 mm, restitution: 0.5}}\n'
        f'runs:\n- {{{RADIAL}: 2 mm}}\n- {{start: centred}}\n',
    )
    assert [run.values[RADIAL] for run in plan.runs] == [2e-3, 1e-3]


def test_a_scene_beside_the_sweep_file_is_found_from_anywhere(tmp_path, monkeypatch):
    scene = ROOT / 'config' / 'four_bar_nominal.yaml'
    (tmp_path / 'mine.yaml').write_text(scene.read_text(encoding='utf-8'), encoding='utf-8')
    file = sweep_file(tmp_path, 'scene: mine.yaml\nrevolutions: 1\n')
    monkeypatch.chdir('/')
    (only,) = read_plan(str(file)).runs
    assert only.name == 'mine'


def test_the_sweep_of_the_thesis_is_found_by_name():
    plan = read_plan('thesis_experiment')
    assert len(plan.runs) == 12
    speeds = {r.values['drive.speed'] for r in plan.runs}
    assert sorted(speeds) == pytest.approx([n * np.pi / 30 for n in (250, 300, 350)])


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('gird: {drive.speed: [1]}', "unknown key 'gird'; did you mean 'grid'?"),
        ('grid: {drive.sped: [1]}', r"run 0 \(drive.sped = 1\): .*did you mean 'speed'"),
        ('grid: {drive.speed: [1, 2 mm]}', r'run 1 \(drive.speed = 2 mm\): .*2 mm'),
        ('grid: {drive.speed: 1}', 'must be a list'),
        ('grid: {drive.speed: []}', 'must not be empty'),
        ('set: {drive.speed: 1}\ngrid: {drive.speed: [1]}', "both 'set' and 'grid'"),
        ('grid: {links.crank.length: [1 m, 2 m]}', r'run 0 .*cannot'),
        ('runs: [3]', 'must be a list of names'),
        ('skip: 3', 'less than 3'),
        ('skip: 0.5', 'whole number'),
        ('skip: 1 s', 'plain number'),
        ('duration: 1 s', "either 'revolutions' or 'duration'"),
        ('repeat: 0', 'at least 1'),
        ('duration: 0', 'more than 0'),
        ('set: {drive: {torque: {constant: 1}, speed: 1}}', 'duration'),
        ('grid: {scene: [four_bar_clearense]}', "did you mean 'four_bar_clearance'"),
    ],
)
def test_bad_sweeps_are_refused_before_anything_runs(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        plan_of(tmp_path, f'scene: four_bar_clearance\nrevolutions: 3\n{text}\n')


def test_a_key_that_is_not_known_is_named_before_a_length_that_is_missing(tmp_path):
    for key, said in (
        ('drive.sped', "did you mean 'speed'"),
        ('drive.speed', r"^\w+.yaml: the length of the runs is missing: give 'revolutions' or"),
    ):
        with pytest.raises(InputError, match=said):
            plan_of(tmp_path, f'scene: four_bar_clearance\ngrid: {{{key}: [1]}}\n')


@pytest.mark.slow
def test_bad_input_ends_with_two_and_one_sentence(tmp_path, reference):
    env = {**environment(), 'DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT': '500ms'}
    bad = sweep_file(tmp_path, 'revolutions: 3\n')
    other = sweep_file(tmp_path, SWEEP.replace('5', '6'), 'other.yaml')
    fresh = str(tmp_path / 't.parquet')
    for args, said in (
        ((str(bad),), "'scene' is missing"),
        ((str(other), '-o', str(reference)), 'is of another sweep'),
        ((str(other), '-o', fresh, '--workers', '0'), 'at least 1'),
        ((str(other), '-o', fresh, '--dask', 'tcp://127.0.0.1:1'), 'no Dask scheduler'),
        ((str(other), '-o', fresh, '--plot', 'x.svg', '--over', 'start'), 'a number'),
    ):
        done = run('sweep', *args, env=env)
        assert done.returncode == 2, done.stderr
        assert said in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.usefixtures('in_this_process')
def test_bad_input_is_refused_in_one_sentence(tmp_path):
    text = SMALL.replace('revolutions: 1', 'revolutions: 2')
    table = tmp_path / 'one.parquet'
    run_plan(plan_of(tmp_path, SMALL), table)
    for act, said in (
        (lambda: plan_of(tmp_path, 'revolutions: 3\n'), "'scene' is missing"),
        (lambda: run_plan(plan_of(tmp_path, text), table), 'is of another sweep'),
        (lambda: run_plan(plan_of(tmp_path, text), tmp_path / 't.parquet', 0), 'at least 1'),
    ):
        with pytest.raises(InputError, match=said) as refused:
            act()
        assert len(str(refused.value).splitlines()) == 1


@pytest.mark.usefixtures('in_this_process')
def test_a_sweep_goes_on_with_runs_that_are_added_before_and_between(tmp_path):
    """By what its rows follow from, not by their numbers: one run is new, and the table is whole.

    A sweep that has not all of them is another one.
    """

    def of(*speeds):
        grid = ', '.join(f'{speed} rpm' for speed in speeds)
        text = f'scene: four_bar_nominal\nrevolutions: 1\ngrid: {{drive.speed: [{grid}]}}\n'
        return plan_of(tmp_path, text)

    table, fresh = tmp_path / 'grown.csv', tmp_path / 'fresh.csv'
    run_plan(of(300, 340), table)
    grown, _ = run_plan(of(280, 300, 320, 340), table)
    run_plan(of(280, 300, 320, 340), fresh)
    assert (grown.computed, grown.kept, grown.failed) == (2, 2, 0)
    assert table.read_text(encoding='utf-8') == fresh.read_text(encoding='utf-8')
    with pytest.raises(InputError, match='is of another sweep'):
        run_plan(of(280, 300, 360), table)
    with pytest.raises(InputError, match='is of another sweep'):
        run_plan(of(280, 300, 320, 340, 360), table, bags=str(tmp_path / 'bags'))


# --- a row --------------------------------------------------------------------------------------


def row_of(machine, extent, bag=None):
    return compute(SweepTask('key', machine.name, machine.scene, extent, bag)).row


@pytest.mark.slow
def test_a_row_says_what_the_solution_says():
    """A second route: the whole motion kept in memory, and sampled."""
    machine = loose(0.5, 'seated')
    row = row_of(machine, Extent(12, None, 4))
    solution = ms.simulate(machine, revolutions=12)
    T = machine.drive.period
    later = [i for i in solution.impacts if i.t >= 4 * T]
    impulse = sum(i.normal_impulse for i in later)
    assert row['impacts'] * 8 == pytest.approx(len(later)) == row['impacts.coupler_rocker']
    units = {c.name: c.unit for c in (*FIGURES, *own_columns(machine))}
    assert (units['impacts'], units['impacts.coupler_rocker']) == ('1/rev', '')
    assert row['impulse'] * 8 == pytest.approx(impulse)
    assert row['I_n'] == pytest.approx(impulse / len(later))
    assert row['dissipated'] * 8 == pytest.approx(sum(i.energy_loss for i in later))
    assert row['largest_impulse'] == max(i.normal_impulse for i in later)
    assert row['energy_residual'] == pytest.approx(solution.energy.residual, abs=1e-15)
    assert (row['steps'], row['digest']) == (solution.stats.steps, solution.digest())
    t = np.linspace(4 * T, 12 * T, 40001)
    at = solution.sample(t)
    joints = ('ground_crank', 'crank_coupler', 'coupler_rocker', 'rocker_ground')
    force = max(np.hypot(at[f'reaction.{j}.x'], at[f'reaction.{j}.y']).max() for j in joints)
    assert row['largest_force'] == pytest.approx(force, rel=0.02)
    assert row['share_of_flight'] == pytest.approx(
        np.mean(1.0 - at['closed.coupler_rocker']), abs=5e-3
    )


def test_what_friction_takes_is_dissipated_too():
    clearance = 'joints.coupler_rocker.clearance'
    friction = {f'{clearance}.friction': 0.1, f'{clearance}.pin_radius': '5 mm'}
    machine = ms.load_scene('four_bar_clearance', {'drive.speed': '450 rpm', **friction})
    row, solution = row_of(machine, Extent(4, None, 0)), ms.simulate(machine, revolutions=4)
    lost = sum(i.energy_loss for i in solution.impacts)
    assert row['dissipated'] * 4 == pytest.approx(solution.energy.dissipated)
    assert solution.energy.dissipated > 1.1 * lost


@pytest.mark.slow
def test_a_row_and_the_study_agree_on_means_and_intervals():
    machine = loose(0.5, 'seated')
    row, found = row_of(machine, Extent(24, None, 4)), statistics(machine, 24, 4)
    for mean in found.means:
        name = mean.name.replace(' ', '_')
        assert row[name] == pytest.approx(mean.mean)
        assert row[f'{name}_half_width'] == pytest.approx(mean.half_width)
    assert (row['I_n'], row['I_n_half_width']) == pytest.approx((found.I_n, found.I_n_half_width))


def test_intervals_of_ratios_cover_the_truth_nineteen_times_in_twenty():
    rng = np.random.default_rng(4)
    inside = 0
    for _ in range(2000):
        per = rng.gamma(9.0, 1.0, 200)
        x = 0.7 * per + rng.normal(0.0, 1.0, 200)
        mean, half = ratio(x, per)
        inside += abs(mean - 0.7) <= half
    assert inside / 2000 == pytest.approx(0.95, abs=0.02)


def test_a_torque_driven_run_counts_the_revolutions_it_makes():
    overrides = {'drive.torque': {'constant': 0.05}, 'drive.start_angle': 0.3}
    machine = ms.load_scene('four_bar_clearance', overrides)
    row = row_of(machine, Extent(None, 0.6, 0.2))
    solution = ms.simulate(machine, duration=0.6)
    crank = solution.sample([0.2, 0.6], 'position.crank')['position.crank']
    turned = float(np.diff(crank)[0]) / (2.0 * np.pi)
    assert row['revolutions'] == pytest.approx(turned)
    later = [i for i in solution.impacts if i.t >= 0.2]
    assert row['impacts'] == pytest.approx(len(later) / turned)
    assert row['digest'] == solution.digest()


def test_figures_that_do_not_exist_are_empty():
    row = row_of(ms.load_scene('four_bar_crossed'), Extent(1, None, 0))
    assert row['status'] == DONE
    assert row['impacts'] == 0.0
    assert row['I_n'] is row['largest_force'] is row['energy_residual'] is None
    assert row['impacts_half_width'] is None


# --- the table ----------------------------------------------------------------------------------


@pytest.mark.optimised  # as in the other processes
def test_the_table_has_a_row_for_each_run_in_the_order_of_the_plan(reference, tmp_path):
    table = pq.read_table(reference)
    plan = plan_of(tmp_path, SWEEP)
    assert table.column('run').to_pylist() == list(range(RUNS))
    for column in plan.columns:
        assert table.column(column).to_pylist() == [r.values[column] for r in plan.runs]
    assert table.schema.field('impulse').metadata[b'unit'] == b'N s'
    assert not [name for name in table.column_names if 'time' in name or 'cpu' in name]
    row = table.to_pylist()[6]
    r = plan.runs[6]
    machine = ms.load_scene(
        'four_bar_clearance', {'drive.speed': '350 rpm', **{k: r.given[k] for k in plan.columns}}
    )
    assert row['digest'] == ms.simulate(machine, revolutions=3).digest()


def test_two_workers_write_the_same_table_and_a_second_call_computes_nothing(
    reference, tmp_path, monkeypatch
):
    file, table = sweep_file(tmp_path, SWEEP), tmp_path / 'two.parquet'
    first = run_json('sweep', str(file), '-o', str(table), '--workers', '2')
    assert first['computed'] == RUNS
    assert table.read_bytes() == reference.read_bytes()
    monkeypatch.setattr(running, 'workers_apart', False)  # there is nothing to do for them
    again = run_json('sweep', str(file), '-o', str(table), '--plot', str(tmp_path / 'p.svg'),
                     '--over', 'drive.start_angle')  # fmt: skip
    assert (again['computed'], again['kept']) == (0, RUNS)
    assert table.read_bytes() == reference.read_bytes()
    assert len(set(keys_of(tmp_path / 'two.parquet.journal'))) == RUNS
    assert 'drive start angle [deg]' in (tmp_path / 'p.svg').read_text(encoding='utf-8')


def in_session(session: int) -> list[int]:
    """Processes of a session that still run."""
    found = []
    for stat in Path('/proc').glob('[0-9]*/stat'):
        try:
            fields = stat.read_text(encoding='utf-8').rpartition(')')[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != 'Z':
            found.append(int(stat.parent.name))
    return found


@pytest.mark.slow
@pytest.mark.parametrize('how', ['kill all', 'kill the parent', 'Ctrl-C'])
def test_a_sweep_that_was_ended_goes_on_and_writes_the_same_table(reference, tmp_path, how):
    file, table = sweep_file(tmp_path, SWEEP), tmp_path / 'again.parquet'
    journal = tmp_path / 'again.parquet.journal'
    args = ('sweep', str(file), '-o', str(table))
    process = subprocess.Popen(
        command(*args, '--workers', '2'), env=environment(), stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    while len(keys_of(journal)) < 2:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.002)
    if how == 'kill the parent':
        process.kill()
    else:
        os.killpg(process.pid, signal.SIGKILL if how == 'kill all' else signal.SIGINT)
    _, said = process.communicate(timeout=TIMEOUT)
    if how == 'Ctrl-C':
        assert process.returncode == 130
        assert 'the same command goes on from there' in said
        assert len(said.strip().splitlines()) == 1, said
    deadline = time.monotonic() + TIMEOUT
    while in_session(process.pid):
        assert time.monotonic() < deadline, 'worker processes are left behind'
        time.sleep(0.05)
    kept = keys_of(journal)
    assert 2 <= len(kept) < RUNS
    assert not table.exists()
    with journal.open('ab') as torn:  # as if the power had failed in the middle of a line
        torn.write(b'{"key": "12')
    summary = run_json(*args, '--workers', '1')
    assert (summary['kept'], summary['computed']) == (len(kept), RUNS - len(kept))
    assert table.read_bytes() == reference.read_bytes()
    keys = keys_of(journal)
    assert keys[: len(kept)] == kept
    assert len(keys) == len(set(keys)) == RUNS


@pytest.mark.usefixtures('in_this_process')
def test_a_sweep_that_is_interrupted_goes_on_and_writes_the_same_table(tmp_path):
    plan, one, table = plan_of(tmp_path, SMALL), tmp_path / '1.parquet', tmp_path / '2.parquet'
    run_plan(plan, one)
    journal = tmp_path / '2.parquet.journal'

    def interrupt(finished, _):
        if finished == 2:
            raise KeyboardInterrupt

    with pytest.raises(
        StudyInterrupted, match=r'after 2 of 4 .* the same command goes on from there'
    ):
        run_plan(plan, table, show=interrupt)
    kept = keys_of(journal)
    assert len(kept) == 2
    assert not table.exists()
    with journal.open('ab') as torn:  # as if the power had failed in the middle of a line
        torn.write(b'{"key": "12')
    summary, _ = run_plan(plan, table)
    assert (summary.kept, summary.computed) == (2, 2)
    assert table.read_bytes() == one.read_bytes()
    keys = keys_of(journal)
    assert keys[:2] == kept
    assert len(keys) == len(set(keys)) == 4


@pytest.mark.usefixtures('in_this_process')
def test_what_a_cluster_computes_makes_the_same_table(monkeypatch, tmp_path):
    """A scheduler that works in this process and returns the last run first."""
    plan, one, table = plan_of(tmp_path, SMALL), tmp_path / '1.parquet', tmp_path / '2.parquet'
    asked = []

    class Client:
        def __init__(self, address):
            asked.append(address)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def submit(self, work, task, pure):
            assert not pure
            return SimpleNamespace(result=lambda: work(task), release=lambda: None)

    cluster = SimpleNamespace(
        Client=Client, as_completed=reversed, KilledWorker=OSError, CancelledError=OSError
    )
    monkeypatch.setitem(sys.modules, 'distributed', cluster)
    assert run_plan(plan, table, dask='tcp://here')[0].computed == 4
    assert asked == ['tcp://here']
    run_plan(plan, one)
    assert table.read_bytes() == one.read_bytes()


@pytest.mark.slow
def test_a_dask_cluster_writes_the_same_table(reference, tmp_path):
    distributed = pytest.importorskip('distributed')
    file, table = sweep_file(tmp_path, SWEEP), tmp_path / 'dask.parquet'
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        args = ('sweep', str(file), '-o', str(table), '--dask', cluster.scheduler_address)
        assert run_json(*args)['computed'] == RUNS
    assert table.read_bytes() == reference.read_bytes()


def test_swept_parts_and_missing_values_have_their_place_in_the_table(tmp_path):
    text = (
        'scene: four_bar_clearance\nrevolutions: 1\ngrid:\n'
        '  joints.coupler_rocker.clearance: [null, {radial: 0.1 mm, restitution: 0.5}]\n'
        '  joints.coupler_rocker.clearance.friction: [0.1, rough]\n'
    )
    plan = plan_of(tmp_path, text.replace('[null, {', '[{restitution: 1, radial: 1 mm}, {'))
    plan.write(tmp_path / 't.parquet', [{'status': DONE}] * 4)
    table = pq.read_table(tmp_path / 't.parquet')
    parts = table.column('joints.coupler_rocker.clearance').to_pylist()
    assert [json.loads(part)['radial'] for part in parts] == [1e-3, 1e-3, 1e-4, 1e-4]
    friction = table.column('joints.coupler_rocker.clearance.friction').to_pylist()
    assert friction == [0.1, np.inf, 0.1, np.inf]
    without = plan_of(tmp_path, text.rpartition('  joints')[0])
    without.write(tmp_path / 't.parquet', [{'status': DONE}] * 2)
    parts = pq.read_table(tmp_path / 't.parquet').column('joints.coupler_rocker.clearance')
    assert parts.to_pylist()[0] is None


@pytest.mark.usefixtures('in_this_process')
def test_a_bag_that_cannot_be_written_ends_the_sweep_but_fails_no_run(tmp_path):
    text = 'scene: four_bar_nominal\nrevolutions: 1\nbags: true\n'
    file, table = sweep_file(tmp_path, text), tmp_path / 't.parquet'
    (tmp_path / 't.bags' / 'run_00000.mcap').mkdir(parents=True)
    done = run('sweep', str(file), '-o', str(table))
    assert done.returncode == 1
    assert 'is a directory' in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not keys_of(tmp_path / 't.parquet.journal')


@pytest.mark.slow
def test_a_run_that_fails_keeps_the_others(tmp_path):
    text = (
        'scene: four_bar_clearance\nset: {start: centred}\nrevolutions: 1\nbags: true\n'
        'grid: {initial.position.rocker: [2.1257118, 2.0, 2.1257119]}\n'
    )
    table = tmp_path / 't.parquet'
    done = run('sweep', str(sweep_file(tmp_path, text)), '-o', str(table), '--workers', '1')
    assert done.returncode == 0, done.stderr
    assert 'run 1 failed' in done.stdout
    good, bad, also = pq.read_table(table).to_pylist()
    assert good['status'] == also['status'] == DONE
    assert 'initial.position puts the pin' in bad['status']
    assert bad['impacts'] is bad['digest'] is None
    bag = run_json('analyze', str(tmp_path / 't.bags' / 'run_00000.mcap'))
    assert bag['digest'] == good['digest']


@pytest.mark.usefixtures('in_this_process')
def test_of_two_runs_the_one_that_fails_keeps_the_other(tmp_path):
    text = (
        'scene: four_bar_clearance\nset: {start: centred}\nrevolutions: 1\nbags: true\n'
        'grid: {initial.position.rocker: [2.0, 2.1257118]}\n'
    )
    summary, (bad, good) = run_plan(plan_of(tmp_path, text), tmp_path / 't.parquet')
    assert summary.failed == 1
    assert good['status'] == DONE
    assert 'initial.position puts the pin' in bad['status']
    assert 'digest' not in bad or bad['digest'] is None
    assert analyze(tmp_path / 't.bags' / 'run_00001.mcap').digest == good['digest']


@pytest.mark.slow
def test_a_plain_script_sweeps_by_one_worker_which_is_this_process(tmp_path):
    # a process of its own would read the script again, and begin the sweep there
    script = tmp_path / 'script.py'
    script.write_text(
        'import mechanism_sim as ms\n'
        "grid = {'drive.speed': ['60 rpm', '120 rpm']}\n"
        "plan = {'revolutions': 1, 'grid': grid}\n"
        "found = ms.sweep(plan, 'table.csv', scene='slider_crank')\n"
        "print(len(found['drive.speed']))\n"
    )
    done = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True,
                          timeout=TIMEOUT, check=False)  # fmt: skip
    assert (done.stdout, done.returncode) == ('2\n', 0), done.stderr


@pytest.mark.slow
def test_several_workers_in_a_script_without_a_guard_are_refused_at_once(tmp_path):
    script = tmp_path / 'script.py'
    script.write_text(
        'import mechanism_sim as ms\n'
        "grid = {'drive.speed': ['60 rpm', '120 rpm']}\n"
        "ms.sweep({'revolutions': 1, 'grid': grid}, scene='slider_crank', workers=2)\n"
    )
    done = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True,
                          timeout=TIMEOUT, check=False)  # fmt: skip
    assert "below if __name__ == '__main__':" in done.stderr.splitlines()[-1]
    assert done.stderr.count('Traceback') == 1  # no worker has begun


def test_windows_without_a_place_are_refused():
    plan = {'revolutions': 1, 'windows': {'samples': 64}, 'grid': {'drive.speed': ['300 rpm']}}
    with pytest.raises(InputError, match='the sweep has windows: give windows='):
        ms.sweep(plan, scene='four_bar_clearance')


def test_values_at_which_a_machine_cannot_turn_are_rows_with_their_reason(tmp_path):
    grid = {'links.rod.length': ['0.2 m', '0.03 m', '0.15 m']}
    plan = {'scene': 'slider_crank', 'revolutions': 1, 'grid': grid, 'measures': {'top': TOP}}
    file = tmp_path / 'rods.csv'
    for _ in range(2):  # made, and from its journal
        found = ms.sweep(plan, file)
        assert found['status'][[0, 2]].tolist() == ['done', 'done']
        assert 'cannot follow its drive' in found['status'][1]
        assert np.isfinite(found['top']).tolist() == [True, False, True]
    same = ms.ensemble(
        'slider_crank', {'links.rod.length': [0.2, 0.03]}, revolutions=1, measures=[f'top = {TOP}']
    )
    assert same['status'][1] == found['status'][1]


def test_values_with_one_of_several_units_are_numbers_too():
    grid = {'links.coupler.length': ['20 mm', '401 mm'], 'drive.speed': ['0 rpm', '60 rpm']}
    found = ms.sweep({'scene': 'four_bar_nominal', 'revolutions': 1, 'grid': grid})
    assert [status == 'done' for status in found['status']] == [False, False, False, True]
    assert 'cannot make a full turn' in found['status'][1]


@pytest.mark.parametrize(
    ('scene', 'path', 'values', 'unit'),
    [
        ('slider_crank', 'drive.speed', [10, 20.5], 'rad/s'),
        ('slider_crank', 'drive.speed', [0, '60 rpm'], 'rad/s'),
        ('loader', 'drives.lift_rod.speed', [0.1, 0.2], 'm/s'),
        ('mass_on_spring', 'initial.position.mass', [0.1, 0.2], 'm'),
    ],
)
def test_plain_numbers_have_the_unit_that_their_place_takes(scene, path, values, unit):
    """350 of a speed is 350 rad/s, which the table did not say."""
    found = ms.sweep({'scene': scene, 'duration': '0.1 s', 'grid': {path: values}})
    assert found.units[path] == unit
    (one,) = parameters(ms.load_scene(scene), [path], '', None, limits={path: (0.1, 0.2)})
    assert one.si == unit


TOP = 'highest(velocity.piston)'


@pytest.mark.parametrize(
    ('grid', 'said'),
    [
        ({'links.rod.length': ['0.2 m', '0.2 mn']}, 'run 1'),
        ({'drive.coordinate': ['crank', 'crunk']}, 'run 1'),
        ({'links.rod.length': ['0.02 m', '0.03 m']}, 'run 0'),  # none can turn
        ({'scene': ['slider_crank', 'four_bar_nominal'], 'links.crank.length': ['0.9 m']}, 'run'),
    ],
)
def test_slips_are_no_rows_and_a_sweep_that_cannot_be_is_refused(grid, said):
    with pytest.raises(InputError, match=said):
        ms.sweep({'revolutions': 1, 'scene': 'slider_crank'} | {'grid': grid})


def test_a_clearance_of_zero_is_an_ideal_joint_in_the_same_table(tmp_path):
    """Its label is a number, and columns of those that are loose are there, whichever is first."""
    restitution = RADIAL.replace('radial', 'restitution')
    grid = {RADIAL: ['0 mm', '0.2 mm'], restitution: [0.4, 0.6]}
    found = ms.sweep({'grid': grid, 'revolutions': 1}, tmp_path / 'a.csv', scene=loose(0.5))
    assert found[RADIAL].tolist() == [0.0, 0.0, 2e-4, 2e-4]
    assert found.units[RADIAL] == 'm'
    assert found[restitution].tolist() == [0.4, 0.6, 0.4, 0.6]
    ideal = ms.ensemble(ms.load_scene(loose(0.5), {'joints.coupler_rocker.clearance': None}),
                        {'drive.start_angle': [0.0]}, revolutions=1)  # fmt: skip
    for name in ('largest_force', 'digest'):
        first, second, third, _ = found[name]
        assert first == second == ideal[name][0] != third
    assert np.isnan(found['impacts.coupler_rocker']).tolist() == [True, True, False, False]
    bare = ms.ensemble(loose(0.5), {RADIAL: [0, 2e-4]}, revolutions=1, columns=['digest'])
    assert bare.units[RADIAL] == 'm'
    assert bare['digest'][0] == found['digest'][0] != bare['digest'][1]


@pytest.mark.slow
def test_scenes_of_every_form_stand_in_sweeps(tmp_path, monkeypatch):
    """As all of Python's functions take them; of one name each has a name of its own."""
    monkeypatch.chdir(tmp_path)
    slow, fast = (ms.load_scene('slider_crank', {'drive.speed': x}) for x in (1.0, 2.0))
    Path('own.yaml').write_text(fast.scene.to_yaml(), encoding='utf-8')
    top = ['top = highest(velocity.piston)']
    first, second = (ms.measure(ms.simulate(x, revolutions=1), top)[0].value for x in (slow, fast))
    length = {'revolutions': 1}
    for form in (slow, slow.scene, slow.scene.to_document(), slow.scene.to_yaml()):
        table = ms.sweep({**length, 'scene': form, 'runs': [{}]}, measures=top)
        assert table['top'].tolist() == [first]
    scenes = ['slider_crank', slow, fast, Path('own.yaml'), slow]
    table = ms.sweep({**length, 'grid': {'scene': scenes}}, measures=top)
    names = ['slider_crank', 'slider_crank_2', 'slider_crank_3', 'own', 'slider_crank_2']
    assert table['scene'].tolist() == names
    assert table['top'][1:].tolist() == [first, second, second, first]
    listed = [{'scene': fast}, {'scene': slow.scene}, {'scene': fast, 'drive.speed': 1.0}]
    table = ms.sweep({**length, 'runs': listed}, measures=top)
    assert table['scene'].tolist() == ['slider_crank', 'scene', 'slider_crank']
    assert table['top'].tolist() == [second, first, first]
    with pytest.raises(InputError, match="the sweep has a 'scene' of its own"):
        ms.sweep({**length, 'scene': slow}, scene=slow)
    with pytest.raises(InputError, match=r'sweep: scene = 3: it must be text'):
        ms.sweep({**length, 'scene': 3})


def test_a_table_that_cannot_be_written_is_refused_before_the_plan_is_made(tmp_path, monkeypatch):
    """The plan of thousands of runs takes its time."""

    monkeypatch.setattr('mechanism_sim.studies.sweep.read_plan', None)
    for file, said in (('a.doc', 'the ending must be'), ('no/a.csv', 'there is no directory')):
        with pytest.raises(InputError, match=said):
            ms.sweep('thesis', tmp_path / file)
    monkeypatch.setattr('mechanism_sim.studies.plan.read_plan', None)
    with pytest.raises(SystemExit) as ended:
        main(['sweep', 'thesis', '-o', 'a.doc', '--json'])
    assert ended.value.code == 2
