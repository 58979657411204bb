"""The benchmark: what is measured is right, and peers compute the same mechanism."""

from __future__ import annotations

import importlib
import json
import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from running import ROOT, run, run_json
from scipy.integrate import DOP853, solve_ivp

import mechanism_sim as ms
from benchmarks import loose_joints as loosened
from benchmarks import measure as measuring
from benchmarks import middleware as lines
from benchmarks import report
from benchmarks import scaling as sizes
from benchmarks.accelerometer_chain import SensorRun
from benchmarks.command import main
from benchmarks.four_bar import LooseFourBar, peers, reference
from benchmarks.loose_joints import Stretch, loose_joints, stretches
from benchmarks.measure import machine, measure
from benchmarks.peers import numba_dop853
from benchmarks.peers.scipy_compliant import damping_ratio
from benchmarks.problem import OURS, Method, Outcome, Problem, missing, problems
from benchmarks.problems import measured
from mechanism_sim import strict_json
from mechanism_sim.errors import RunError
from mechanism_sim.report.charts.chart import MARKERS
from mechanism_sim.sensing.channel import Channel
from test.hard.case import cases

STARTS = {
    'four_bar_clearance': ('centred', 0.5),
    'four_bar_clearance_e01': ('centred', 0.1),
    'four_bar_clearance_seated': ('seated', 0.5),
    'four_bar_clearance_e1': ('centred', 1.0, 0.5),
}


def tell(value):
    """A method that takes no time and is wrong by its setting."""

    def prepare(setting):
        return lambda: lambda: Outcome(np.array([value + setting]), steps=7)

    return prepare


def toy(*more):
    methods = (
        Method(OURS, (1e-3, 1e-6), 'rtol', tell(2.0), 'Knows the answer.'),
        Method('worse', (1e-2,), 'steps', tell(2.0), 'Nearly knows it.'),
        *more,
    )
    return Problem(
        'toy', 'A toy', 'sample', 10.0, 'rad', 'Known.', lambda x: abs(float(x[0]) - 2.0), methods
    )


def test_errors_are_those_of_the_answers():
    found = measure(toy(), repeats=2)
    assert [row.error for row in found.rows] == pytest.approx([1e-3, 1e-6, 1e-2])
    assert all(0.0 < row.fastest <= row.median for row in found.rows)
    assert all(len(row.times) == 2 and row.steps == 7 for row in found.rows)


def test_the_cheapest_setting_that_serves_is_compared():
    found = measure(toy(), repeats=1)
    coarse, fine, _ = found.rows
    coarse.times, fine.times = [1.0], [5.0]
    assert found.cheapest(OURS, 1e-2) is coarse
    assert found.cheapest(OURS, 1e-4) is fine
    assert found.cheapest(OURS, 1e-9) is fine  # the best it has
    text = '\n'.join(report.ratios(found))
    assert 'worse' in text
    assert 'its best' in text


def test_tolerances_replace_those_of_methods_with_a_tolerance_only():
    found = measure(toy(), repeats=1, tolerances=[1e-5])
    assert [(r.method.name, r.tolerance) for r in found.rows] == [(OURS, 1e-5), ('worse', 1e-2)]


def test_a_missing_package_is_one_line_and_no_row():
    absent = Method(
        'absent',
        (1.0,),
        'rtol',
        tell(0.0),
        'Not here.',
        lambda: missing('no_such_package'),
    )
    found = measure(toy(absent), repeats=1)
    assert found.skipped == {'absent': 'no_such_package is not installed'}
    assert 'absent' not in {row.method.name for row in found.rows}
    lines = report.render(found, machine()).splitlines()
    assert lines.count('absent left out: no_such_package is not installed') == 1


def test_a_method_that_fails_says_so():
    def breaks(_):
        raise RunError('it fell over')

    found = measure(toy(Method('broken', (1.0,), 'rtol', breaks, 'Breaks.')), repeats=2)
    row = found.rows[-1]
    assert row.failure == 'it fell over'
    assert math.isnan(row.fastest)
    assert 'broken at 1 failed: it fell over' in report.render(found, machine())
    content = json.dumps(report.to_json([found], machine()), allow_nan=False)
    assert json.loads(content)['rows'][-1]['error'] is None


def test_a_peer_in_another_process_tells_its_own_time():
    def prepare(_):
        return lambda: lambda: Outcome(np.array([2.0]), cpu_time=30.0)

    found = measure(toy(Method('far', (1.0,), 'steps', prepare, 'Elsewhere.')), repeats=3)
    assert found.rows[-1].fastest == pytest.approx(3.0)
    assert len(found.rows[-1].times) == 1  # beyond the budget
    assert measuring.BUDGET < 30.0


@pytest.mark.parametrize('name', STARTS)
def test_errors_of_the_loose_four_bar_are_those_of_its_final_angles(name):
    problem, four_bar = problems()[name], LooseFourBar.thesis(*STARTS[name])
    right = np.array(four_bar.final)
    assert problem.error(right) == 0.0
    assert problem.error(right + np.array([3e-7, -8e-7])) == pytest.approx(8e-7)
    assert problem.methods[0].name == OURS
    assert four_bar.duration * four_bar.crank_speed == pytest.approx(2 * math.pi * problem.amount)


# numba takes ten seconds to compile the loop of a problem, which runs for milliseconds
COMPILED = pytest.mark.parametrize('compiled', [False, pytest.param(True, marks=pytest.mark.slow)])


@pytest.mark.sample(1)
@COMPILED
@pytest.mark.parametrize('name', STARTS)
def test_methods_with_events_agree_with_the_reference(name, compiled):
    """Every start and restitution; the elastic one is chaotic: 1e-16 rad grows to 1e-9 rad."""
    wanted = {OURS, 'bare heyoka loop', 'SciPy DOP853', 'SciPy DOP853 tuned'}
    if compiled:
        wanted = {'numba DOP853 loop'}
    for method in problems()[name].methods:
        if method.name not in wanted or method.missing():
            continue
        outcome = method.prepare(1e-11)()()
        bound = 2e-8 if name.endswith('e1') else 1e-8
        assert problems()[name].error(outcome.answer) < bound, method.name


@COMPILED
@pytest.mark.parametrize('name', ['valve_train', 'gear_rattle'])
def test_impacts_of_valves_and_gears_are_those_of_the_closed_form(name, compiled):
    problem = problems()[name]
    for method in problem.methods:
        if method.missing() or compiled != ('numba' in method.name):
            continue
        outcome = method.prepare(1e-10)()()
        assert problem.error(outcome.answer) < 1e-11, method.name
        assert problem.error(outcome.answer + 1e-7) == pytest.approx(1e-7, rel=1e-3)
        assert math.isnan(problem.error(outcome.answer[1:]))


def test_a_run_can_be_repeated():
    for method in problems()['four_bar_clearance_e01'].methods:
        if method.name in {OURS, 'bare heyoka loop', 'SciPy DOP853 tuned'}:
            work = method.prepare(1e-8)
            first, second = work()(), work()()
            assert np.array_equal(first.answer, second.answer), method.name


def test_peers_know_their_names_and_settings():
    names = [peer.name for peer in peers()]
    assert len(set(names)) == len(names)
    assert all(peer.settings and peer.how.endswith('.') for peer in peers())


@pytest.mark.slow
def test_the_numba_loop_counts_the_impacts_of_the_reference():
    pytest.importorskip('numba')
    from benchmarks.kernels.loose_four_bar import revolve  # noqa: PLC0415

    for name in ('centred_e05', 'centred_e01', 'seated_e05', 'centred_e1'):
        start, e = name.split('_')
        four_bar = LooseFourBar.thesis(start, {'e05': 0.5, 'e01': 0.1, 'e1': 1.0}[e])
        struck = reference(f'four_bar_{name}')['impacts']
        right = np.array(struck['t'], float)
        fast = np.array(struck['approach_speed'], float) > 1e-3
        if e == 'e1':  # chaotic: the first half of the revolution only
            fast &= right < 0.5 * four_bar.duration
        p, state = numba_dop853.constants(four_bar), numba_dop853.initial(four_bar)
        times = np.zeros(256)
        *_, count = revolve(p, state, four_bar.seated, four_bar.duration, 1e-13, times)
        found = times[:count]
        late = [np.abs(found - t).min() for t in right[fast][:40]]
        assert max(late) < 1e-8, name


@pytest.mark.slow
def test_dop853_of_the_kernels_is_that_of_scipy():
    numba = pytest.importorskip('numba')
    from benchmarks.kernels import dop853  # noqa: PLC0415

    @numba.njit(error_model='numpy')
    def pendulum(t, y, p, out):
        out[0], out[1] = y[1], -p * np.sin(y[0]) + np.cos(t)
        return y[0]

    h, y = 0.3, np.array([1.0, 0.5])
    theirs = DOP853(
        lambda t, y: (y[1], -2.0 * np.sin(y[0]) + np.cos(t)), 0.0, y, h, rtol=1, atol=1,
        first_step=h,
    )  # fmt: skip
    theirs.step()
    step, densify, dense = dop853.stepper(pendulum, 2)
    K, F = np.empty((dop853.ROWS, 2)), np.empty((7, 2))
    new, between = np.empty(2), np.empty(2)
    pendulum(0.0, y, 2.0, K[0])
    error, low, high, _ = step(0.0, y, h, K, 2.0, 1.0, np.ones(2), new)
    assert new == pytest.approx(theirs.y, abs=1e-15)
    assert 0.0 < error < 1e-6
    assert 1.0 < low < high
    densify(0.0, y, h, K, 2.0, new, F)
    output = theirs.dense_output()
    for x in (0.1, 0.5, 0.9):
        dense(y, F, x, between)
        assert between == pytest.approx(output(x * h), abs=1e-15)


@pytest.mark.parametrize('e', [0.2, 0.5, 0.9])
def test_a_damped_spring_gives_back_the_restitution(e):
    ratio = damping_ratio(e)

    def force(_, y):
        return -y[0] - 2.0 * ratio * y[1]

    def ends(t, y):
        return y[0] + 2.0 * ratio * y[1] if t > 0.1 else 1.0

    ends.terminal = True
    out = solve_ivp(lambda t, y: (y[1], force(t, y)), (0.0, 9.0), (0.0, 1.0), events=ends,
                    rtol=1e-10, atol=1e-12, max_step=0.05)  # fmt: skip
    assert -out.y[1, -1] == pytest.approx(e, abs=1e-8)


def test_methods_without_events_agree_with_their_references():
    for name, bound in (('four_bar_nominal', 1e-12), ('torque_crank', 1e-8)):
        problem = problems()[name]
        ours = next(method for method in problem.methods if method.name == OURS)
        outcome = ours.prepare(ours.settings[-1])()()
        assert problem.error(outcome.answer) < bound
        assert problem.error(outcome.answer + 1e-3) == pytest.approx(1e-3, rel=1e-2)


@pytest.mark.slow
def test_the_nominal_mechanism_and_the_driven_crank_agree_with_their_references():
    for name, bound in (('four_bar_nominal', 1e-12), ('torque_crank', 1e-8)):
        problem = problems()[name]
        for method in problem.methods:
            if method.name == 'SciPy RK45':
                continue
            outcome = method.prepare(method.settings[-1])()()
            assert problem.error(outcome.answer) < bound, (name, method.name)
            assert problem.error(outcome.answer + 1e-3) == pytest.approx(1e-3, rel=1e-2)


@pytest.mark.slow
def test_one_problem_as_json_and_files(tmp_path):
    content = run_json(
        'torque_crank', '--methods', 'mechanism_sim', '--tolerances', '1e-4,1e-9',
        '--repeats', '1', '--output', str(tmp_path), program=main,
    )  # fmt: skip
    rows = content['rows']
    assert [(r['method'], r['tolerance']) for r in rows] == [(OURS, 1e-4), (OURS, 1e-9)]
    assert {row['unit'] for row in rows} == {'simulated second'}
    assert all(row['cpu_per_unit'] > 0.0 and row['repeats'] == 1 for row in rows)
    assert rows[1]['error'] < 1e-9 < rows[0]['error']
    assert content['machine']['processor']
    assert json.loads((tmp_path / 'torque_crank.json').read_text())['rows']
    assert (tmp_path / 'torque_crank.txt').read_text().startswith('torque_crank')
    assert ET.parse(tmp_path / 'torque_crank.svg').getroot().tag.endswith('svg')


@pytest.mark.slow
def test_problems_as_json_and_files(tmp_path):
    content = run_json(
        'torque_crank', 'four_bar_nominal', '--methods', 'mechanism_sim,SciPy LSODA',
        '--tolerances', '1e-6,1e-9', '--repeats', '2', '--output', str(tmp_path),
        program=main,
    )  # fmt: skip
    rows = content['rows']
    assert all(
        set(row) >= {'method', 'tolerance', 'cpu_per_unit', 'error', 'unit'} for row in rows
    )
    assert [(r['method'], r['tolerance']) for r in rows[:4]] == [
        ('mechanism_sim', 1e-6), ('mechanism_sim', 1e-9),
        ('SciPy LSODA', 1e-6), ('SciPy LSODA', 1e-9),
    ]  # fmt: skip
    assert {row['unit'] for row in rows} == {'simulated second', 'sample'}
    assert all(row['cpu_per_unit'] > 0.0 and row['repeats'] == 2 for row in rows)
    assert rows[1]['error'] < 1e-9 < rows[0]['error']
    assert content['machine']['processor']
    for name in ('torque_crank', 'four_bar_nominal'):
        assert json.loads((tmp_path / f'{name}.json').read_text())['rows']
        assert 'cheapest setting' in (tmp_path / f'{name}.txt').read_text() or 'nominal' in name
        assert ET.parse(tmp_path / f'{name}.svg').getroot().tag.endswith('svg')


@pytest.mark.slow
def test_costs_by_size(monkeypatch):
    """One point or two of every family in this process; those with nodes are measured alike."""
    monkeypatch.setattr(sizes, 'RATES', (1e3,))
    monkeypatch.setattr(sizes, 'SENSORS', ())
    monkeypatch.setattr(sizes, 'LENGTHS', (1, 8))
    monkeypatch.setattr(sizes, 'STREAMED', (1,))
    monkeypatch.setattr(sizes, 'DYADS', (1, 2))
    monkeypatch.setattr(sizes, 'TURNS', 0.2)
    monkeypatch.setattr(sizes, 'MODES', (1,))
    monkeypatch.setattr(sizes, 'LOOSE', sizes.LOOSE[:2])
    said = []
    costs = sizes.scaling(said.append)
    links = [c for c in costs if c.family.startswith('links')]
    assert [c.size for c in links] == [4, 6] * 8
    assert sum(c.family.endswith('getting ready') for c in links) == 8
    others = costs[len(links) :]
    assert [c.size for c in others] == [1, 1, 2, 1e3, 1, 8, 1]
    assert len(said) == len(costs)
    assert all(c.cpu_per_unit > 0.0 for c in costs)
    assert {c.unit for c in others} == {'revolution'}
    short, long = (c.peak_memory for c in others[4:6])
    assert 1e4 < short < long  # motion is kept
    text = report.render_scaling(costs, machine())
    assert all(c.family in text for c in costs)
    assert json.loads(json.dumps(strict_json.plain(costs)))[0]['size'] == 4


LOOSE = ('four_bar_clearance', 1, 0.2), ('slider_crank_engine', 2, 0.02)


@pytest.mark.parametrize('runs', [LOOSE[:1], pytest.param(LOOSE, marks=pytest.mark.slow)])
def test_costs_of_loose_joints(runs):
    said: list[str] = []
    costs = loose_joints(1, said.append, runs)
    assert [(c.machine, c.loose, c.friction) for c in costs] == [
        (*run[:2], friction) for run in runs for friction in (False, True)
    ]
    assert len(said) == 4 * len(runs)  # once to compile, once to measure
    assert all(c.cpu > 0.0 and c.cpu_per_event == c.cpu / max(c.events, 1.0) for c in costs)
    solution = ms.simulate(ms.load_scene('four_bar_clearance'), duration=0.4 * math.pi / 36.6519)
    assert costs[0].steps == pytest.approx(solution.stats.steps / 0.2)
    assert costs[0].impacts == pytest.approx(len(solution.impacts) / 0.2)
    text = report.render_loose_joints(costs)
    assert text.count('mu 0.1') == len(runs)


INSTALLED = [pair for pair in loosened.PEERS if not pair[0].missing()]


def error_of_peer(name, stretch, setting):
    """Error [m] of a peer at a setting, skipped where it is not installed."""
    prepare = {peer.name: prepare for peer, prepare, _ in INSTALLED}.get(name)
    if prepare is None:
        pytest.skip(f'{name} is not installed')
    return stretch.error(prepare(stretch.tree, stretch.end, setting)()().answer)


@pytest.mark.parametrize(
    ('name', 'setting', 'error'),
    [('Exudyn', 1e8, 1.6e-4), ('Exudyn', 1e9, 4.1e-5), ('MuJoCo', 5e3, 1.4e-4),
     ('MuJoCo', 20e3, 1.9e-5), ('MuJoCo', 80e3, 1.1e-5)],
)  # fmt: skip
def test_builders_of_any_machine_err_on_the_thesis_as_models_written_for_it(name, setting, error):
    """Errors [rad] of a revolution by a model of this mechanism alone, of the same contacts."""
    peer = next(peer for peer in peers() if peer.name == name)
    if peer.missing():
        pytest.skip(peer.missing())
    bar = LooseFourBar.thesis()
    assert bar.error(peer.prepare(bar, setting)()().answer) == pytest.approx(error, rel=0.15)


TWO_LOOSE = Stretch('four_bar_clearance', 2)
ENGINE = Stretch('slider_crank_engine', 3)
RUBBING = Stretch('four_bar_clearance', 4, friction=True)
CLOSED_LOOPS = Stretch('ten_links', 4)


@pytest.mark.parametrize(
    ('name', 'stretch', 'coarse', 'fine', 'gain', 'bound'),
    [
        ('Exudyn', TWO_LOOSE, 1e8, 1e13, 100.0, 2e-7),
        ('MuJoCo', TWO_LOOSE, 20e3, 500e3, 5.0, 1e-6),
        ('Exudyn', ENGINE, 1e8, 1e13, 100.0, 1e-6),
        ('MuJoCo', ENGINE, 20e3, 500e3, 10.0, 3e-7),
        ('Exudyn', RUBBING, 1e8, 1e12, 30.0, 5e-7),
        pytest.param('Exudyn', CLOSED_LOOPS, 1e6, 1e8, 10.0, 3e-6, marks=pytest.mark.slow),
        pytest.param('MuJoCo', CLOSED_LOOPS, 4e3, 500e3, 10.0, 1e-6, marks=pytest.mark.slow),
    ],
)
def test_peers_on_several_loose_joints_come_closer_with_stiffer_contacts_or_shorter_steps(
    name, stretch, coarse, fine, gain, bound
):
    far, near = (error_of_peer(name, stretch, setting) for setting in (coarse, fine))
    assert far > gain * near
    assert near < bound
    assert len({impact.joint for impact in stretch.reference.impacts}) > 1


def test_costs_beside_peers(monkeypatch):
    if not INSTALLED:
        pytest.skip('neither exudyn nor mujoco is installed')
    few = {'Exudyn': (1e8, 1e9, 1e10), 'MuJoCo': (4e3, 20e3, 100e3)}
    monkeypatch.setattr(
        loosened, 'PEERS', [(peer, prepare, few[peer.name]) for peer, prepare, _ in INSTALLED]
    )
    monkeypatch.setattr(loosened, 'LIMIT', 1e-9)  # nothing is tried thrice
    costs, skipped = stretches(1, runs=(('four_bar_clearance', 1, 1.0),))
    assert not skipped
    names = [OURS, *(peer.name for peer, *_ in INSTALLED)]
    assert [(c.method, c.friction) for c in costs] == [
        (n, f) for f in (False, True) for n in names
    ]
    assert all(c.error < 1e-12 for c in costs if c.method == OURS)
    for c in costs:
        if c.method == 'MuJoCo' and c.friction:
            assert 'friction' in c.failure
            assert math.isnan(c.error)
        else:
            assert c.cpu > 0.0
            assert c.limited == (c.method != OURS)
    text = report.render_stretches(costs)
    assert text.count('four_bar_clearance') == 2
    assert ('MuJoCo, 1 of 2: ' in text) == ('MuJoCo' in names)


def test_no_run_beside_peers_that_are_not_installed(monkeypatch):
    why = 'it is not installed'
    gone = [(replace(peer, missing=lambda: why), *more) for peer, *more in loosened.PEERS]
    monkeypatch.setattr(loosened, 'PEERS', gone)
    monkeypatch.setattr(loosened, 'Stretch', None)
    assert stretches(1) == ([], {peer.name: why for peer, *_ in gone})
    pages = report.Pages(None)
    pages.add_loose_joints((), machine(), *stretches(1))
    assert 'MuJoCo left out: it is not installed' in pages.text[0]
    assert pages.to_json(machine())['stretches'] == []


@pytest.mark.slow
def test_nodes_on_a_middleware(monkeypatch, tmp_path):
    """One measurement of each kind between real processes."""
    monkeypatch.setattr(lines, 'backends', lambda: ['zenoh'])
    monkeypatch.setattr(lines, 'BURSTS', {'Motion': 40})
    monkeypatch.setattr(lines, 'ROUNDS', 20)
    monkeypatch.setattr(lines, 'CREDITS', 20)
    monkeypatch.setattr(lines, 'REVOLUTIONS', (1, 2))
    monkeypatch.setattr(lines, 'ARRANGEMENTS', {'recorded': ('--record',)})
    said = []
    figures = lines.middleware(1, said.append)
    pages = report.Pages(str(tmp_path))
    pages.add_middleware(figures, machine())
    rows = pages.to_json(machine())['rows']
    keys = {'problem', 'method', 'tolerance', 'cpu_per_unit', 'error', 'error_unit', 'unit'}
    assert all(set(row) >= keys for row in rows)
    assert json.loads((tmp_path / 'middleware.json').read_text())['rows'] == rows
    stream, there_and_back, credit, alone, nodes = rows
    assert stream['size'] > 30_000
    assert 0.0 < stream['rate'] <= stream['fastest']
    assert 0.0 < there_and_back['median'] <= there_and_back['p99']
    assert 0.0 < credit['alone'] < credit['median']
    assert {row['error'] for row in (stream, there_and_back, credit, nodes)} == {0}
    assert (alone['sent'], alone['error']) == (0, None)
    assert nodes['sent'] > 50
    assert len(nodes['digest']) == 64
    assert nodes['digest'] == alone['digest']
    assert said[-1] == 'middleware: recorded, on zenoh'
    text = (tmp_path / 'middleware.txt').read_text()
    assert text.startswith(pages.text[0])
    assert nodes['digest'][:8] in text


def test_what_an_instrument_shows_agrees_with_power_series_of_its_state_equations():
    run = SensorRun(2)
    channel = Channel(run.source(), run.instrument, 'x')
    channel.take(run.motion)
    found = np.concatenate([block.samples for block in channel.blocks(final=True)])
    assert len(run.impacts[0]) > 10
    assert run.error(found) < 1e-12 * np.abs(run.reference).max()
    assert run.error(found + 1e-3) == pytest.approx(1e-3, rel=1e-6)


def test_a_filter_of_scipy_comes_near_to_what_the_instrument_shows(monkeypatch):
    monkeypatch.setattr(measured, 'RUN', SensorRun(1))
    largest = np.abs(measured.RUN.reference).max()
    for prepare, factor, bound in (
        (measured.ours, 1.0, 1e-12), (partial(measured.run_sosfilt, True), 16.0, 0.05),
    ):  # fmt: skip
        assert measured.RUN.error(prepare(factor)()().answer) < bound * largest


@pytest.mark.slow
def test_filters_of_scipy_come_near_to_what_the_instrument_shows(monkeypatch):
    monkeypatch.setattr(measured, 'RUN', SensorRun(2))
    largest = np.abs(measured.RUN.reference).max()
    for prepare, factor, bound in (
        (measured.ours, 1.0, 1e-12),
        (partial(measured.run_sosfilt, True), 16.0, 0.05),
        (measured.run_lsim, 16.0, 0.05),
        (measured.run_solve_ivp, 1e-3, 1e-4),
    ):
        samples = prepare(factor)()().answer
        assert measured.RUN.error(samples) < bound * largest


def test_no_two_methods_look_alike_in_a_picture():
    most = max(len(problem.methods) for problem in problems().values())
    assert most <= len(set(MARKERS))


def test_without_a_name_there_is_a_list_of_what_can_be_measured():
    listed = run_json(program=main)['problems']
    assert {p['name'] for p in listed} >= {*STARTS, 'four_bar_nominal', 'torque_crank'}
    text = run(program=main).stdout
    assert 'four_bar_clearance' in text
    assert 'scaling' in text
    assert 'middleware' in text


def test_every_hard_case_is_in_the_site_with_figures_that_keep_their_bounds(monkeypatch):
    docs = ROOT / 'docs'
    monkeypatch.syspath_prepend(str(docs / 'site'))
    site = importlib.import_module('measurements')
    lines = site.hard_cases().splitlines()
    shown = [line.removeprefix('## ') for line in lines if line.startswith('## ')]
    assert shown == [case.name for case in cases()]
    for case in cases():
        assert {case.hard, f'*Truth:* {case.truth}'} <= {*lines}
    rows = json.loads(site.HARD.read_text(encoding='utf-8'))['cases']
    assert {row['name'] for row in rows} == set(shown)
    assert all(row['bound'] is None or abs(row['figure']) <= row['bound'] for row in rows)


@pytest.mark.parametrize(
    ('args', 'words'),
    [
        (('four_bar_clearence',), ["'four_bar_clearance'"]),
        (('torque_crank', '--methods', 'SciPy LSODE'), ["'SciPy LSODA'"]),
        (('torque_crank', '--tolerances', '1e-6,tight'), ["'tight'", 'between 0 and 1']),
        (('torque_crank', '--repeats', '0'), ['--repeats']),
        (('torque_crank', 'hard'), ["'hard' is not a benchmark", 'python -m test.hard']),
        (('grid',), ['python -m test.grid']),
        (('--repeats', '3'), ['--repeats needs names']),
    ],
)
def test_bad_input_gets_one_sentence_and_code_2(args, words):
    done = run(*args, program=main)
    assert done.returncode == 2
    assert done.stdout == ''
    assert len(done.stderr.strip().splitlines()) == 1
    for word in words:
        assert word in done.stderr
