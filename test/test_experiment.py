"""The thesis's experiment on two small bags: what is measured, what is true, and the command."""

from __future__ import annotations

import json

import numpy as np
import pytest
from matplotlib.figure import Figure
from running import run

import mechanism_sim as ms
from mechanism_sim.analysis.experiment import JOINT, Experiment, bags_of, read_experiment
from mechanism_sim.errors import InputError
from mechanism_sim.report import experiment_figures
from mechanism_sim.report.experiment import render, tables, to_json
from mechanism_sim.report.experiment_figures import draw
from mechanism_sim.scene import Level
from mechanism_sim.sensing.angular_acceleration import TurningLink
from mechanism_sim.sensing.chain import Amplifier, AntiAlias, Instrument
from mechanism_sim.sensing.channel import Channel
from mechanism_sim.sensing.point import PointOnLink
from mechanism_sim.sweep.plan import Extent, read_plan
from mechanism_sim.sweep.row import DONE, Task, compute

TURNS = 6
MESH = 0.1


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Runs of the sweep of the package with a restitution of a half and of 1, six turns each."""
    folder = tmp_path_factory.mktemp('bags')
    plan = read_plan('thesis_measurement')
    assert len(plan.runs) == 19
    for n in (11, 12):
        chosen = plan.runs[n]
        bag = folder / f'run_{n:05d}.mcap'
        row = compute(Task('', chosen.name, chosen.scene, Extent(TURNS, None, 0), bag)).row
        assert row['status'] == DONE
    return folder


@pytest.fixture(scope='module')
def found(bags):
    return read_experiment(bags_of(bags), skip=2)


def simulated(trial):
    machine = ms.load_scene(
        'four_bar_clearance',
        {
            'drive.speed': '350 rpm',
            f'joints.{JOINT}.clearance.restitution': trial.condition.restitution,
        },
    )
    return ms.simulate(machine, revolutions=TURNS)


def test_conditions_come_from_the_bags(found):
    assert [t.condition.restitution for t in found.trials] == [0.5, 1.0]
    assert found.bearing == (0.5, 0.0)
    assert found.reference is found.trials[0]
    assert found.assumed is found.trials[1]
    assert found.reference.turns == (2, TURNS)
    assert found.reference.at_first == (1, 5)


def test_truth_and_severity_are_those_of_the_simulation(found):
    """A second route: the motion simulated anew, sampled and differentiated here."""
    trial = found.assumed
    solution = simulated(trial)
    linkage = trial.machine.linkage
    for link, swing in trial.swings.items():
        own = solution.sample(swing.t)
        truth = own[f'acceleration.{link}']
        assert swing.accelerations['thesis'].truth == pytest.approx(truth, rel=1e-6, abs=1e-3)
        t = np.arange(round(4 * 360 / MESH) + 1) * np.radians(MESH) / (350 * np.pi / 30)
        t += 2 * 2 * np.pi / (350 * np.pi / 30)
        t[-1] = min(t[-1], solution.duration)
        own = solution.sample(t)
        w2 = own['velocity.crank']
        row = ('crank', 'coupler', 'rocker').index(link)
        ideal = linkage.motion(own['position.crank'], w2, 0.0 * t)[1][row]
        steps = np.diff(own[f'velocity.{link}'] - ideal) / np.diff(t)
        assert swing.severity.by_mesh[1] == pytest.approx(np.sqrt(np.mean(steps**2)), rel=1e-6)


def test_shown_is_what_an_instrument_without_noise_gives(found):
    """Two sensors whose readings differ by the angular acceleration alone; chains are linear."""
    instrument = Instrument(2700.0, amplifier=Amplifier(2.0, 1, 1000.0, 2),
                            anti_alias=AntiAlias(1000.0, 8))  # fmt: skip
    solution = simulated(found.reference)
    mechanism = found.reference.machine.mechanism
    heard = []
    for source in (
        PointOnLink(mechanism, 'coupler', 0.309, 'across'),
        PointOnLink(mechanism, 'coupler', 0.109, 'across'),
        TurningLink(mechanism, 'coupler'),
    ):
        channel = Channel(source, instrument, 'x')
        channel.take(solution.motion)
        heard.append(np.concatenate([block.samples for block in channel.blocks(final=True)]))
    assert (heard[0] - heard[1]) / 0.2 == pytest.approx(heard[2], abs=1e-7 * heard[2].max())


def test_better_methods_are_better(found):
    for link, swing in found.reference.swings.items():
        shown = {n: e.error_of_shown.relative for n, e in swing.accelerations.items()}
        assert shown['undone'] < 0.02
        assert shown['undone'] < shown['corrected'] <= shown['thesis'], link
        velocity = {n: e.error.relative for n, e in swing.velocities.items()}
        assert velocity['spectrum'] < 0.05 < velocity['closed'] < velocity['thesis'], link
    two = found.reference.swings['coupler'].accelerations['two'].error_of_shown.relative
    assert two < 0.1 * found.reference.swings['coupler'].accelerations['thesis'].error_of_shown[2]


def test_modified_responses_have_the_deviation_over_alpha(found):
    cycle = found.assumed.first
    off = cycle.modified(found.alpha) - cycle.nominal
    assert off * found.alpha == pytest.approx(cycle.rows - cycle.nominal, rel=1e-9)


def test_a_turn_holds_all_of_its_impulses(found):
    """The mean over the turn of what is drawn, against the balance of momentum of the rocker."""
    trial = found.assumed
    cycle, machine = trial.first, trial.machine
    links = machine.scene.links
    width = 2.0 * np.pi / trial.condition.speed / len(cycle.angle)
    solution = simulated(trial)
    turn = trial.at_first[0]
    t = np.array([turn, turn + 1]) * 2.0 * np.pi / trial.condition.speed
    gained = np.diff(solution.sample(t)['velocity.rocker'])[0]
    inertia = links['rocker'].inertia + links['rocker'].mass * links['rocker'].cog ** 2
    middle = (turn + (np.arange(len(cycle.angle)) + 0.5) / len(cycle.angle)) * t[0] / turn
    th4 = solution.sample(middle)['position.rocker']
    fx, fy = cycle.force
    turning = links['rocker'].length * (np.cos(th4) * fy - np.sin(th4) * fx)
    weight = -9.8145 * links['rocker'].mass * links['rocker'].cog * np.cos(th4)
    impulse = width * np.sum(turning + weight)
    assert impulse == pytest.approx(inertia * gained, abs=2e-3 * width * np.abs(turning).sum())


def test_tables_have_a_row_for_every_run(found):
    by_title = {table.title: table for table in tables(found)}
    assert len(by_title) == 11
    errors = [t for title, t in by_title.items() if title.startswith('Angular')]
    assert len(errors) == 8
    assert all(len(t.rows) == 1 and len(t.rows[0]) == len(t.columns) for t in errors)
    assert 'alpha = ' in render(found)


def test_figures_are_those_of_the_thesis(found):
    names = sorted(draw(found))
    assert names == [
        f'figure_{n}'
        for n in ('7_08', '7_09', '7_10', '7_11', '7_12', '7_13', '7_14', '7_15', '7_16', '7_17',
                  '8_01', '8_02', '8_03', '8_04', '8_06', '8_08', '8_11', '8_12')
    ]  # fmt: skip


def test_a_machine_that_is_compared_with_no_other_has_no_alpha(found):
    alone = Experiment(found.trials[:1])
    assert 'no alpha' in render(alone)
    assert to_json(alone)['alpha'] is None
    assert sorted(draw(alone))[-3:] == ['figure_8_03', 'figure_8_11', 'figure_8_12']


def test_the_command_writes_its_figures_and_prints_tables(bags, tmp_path, monkeypatch):
    """All figures are drawn by other tests; here a command is to write them."""
    monkeypatch.setattr(
        experiment_figures, 'draw', lambda _: {n: Figure() for n in ('figure_1', 'figure_2')}
    )
    done = run('experiment', str(bags), '-o', str(tmp_path / 'figures'), '--skip', '3', '--json')
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert [t['restitution'] for t in told['trials']] == [0.5, 1.0]
    assert told['trials'][0]['turns'] == [3, TURNS]
    written = {file.stem for file in (tmp_path / 'figures').glob('*.png')}
    assert written == {'figure_1', 'figure_2'}


@pytest.mark.deep
def test_the_command_writes_figures_and_prints_tables(bags, tmp_path):
    done = run('experiment', str(bags), '-o', str(tmp_path / 'figures'), '--skip', '3', '--json')
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert [t['restitution'] for t in told['trials']] == [0.5, 1.0]
    assert told['trials'][0]['turns'] == [3, TURNS]
    assert len(list((tmp_path / 'figures').glob('figure_*.png'))) == 18


def test_what_is_no_such_experiment_is_refused(bags, tmp_path):
    with pytest.raises(InputError, match='has no bags'):
        bags_of(tmp_path)
    bag = bags_of(bags)[0]
    with pytest.raises(InputError, match='are those of run_00011'):
        read_experiment([bag, bag], skip=4)
    with pytest.raises(InputError, match='whole turns'):
        read_experiment([bag], skip=9)
    nominal, unmeasured = (
        ms.load_scene(name) for name in ('four_bar_nominal', 'four_bar_clearance')
    )
    assert nominal.level is Level.INVERSE_DYNAMICS
    for machine, said in ((nominal, 'has clearance'), (unmeasured, 'across the coupler')):
        file = tmp_path / f'{machine.name}.mcap'
        compute(Task('', machine.name, machine.scene, Extent(3, None, 0), file))
        with pytest.raises(InputError, match=said):
            read_experiment([file], skip=1)
