"""The one loop: the same motion however it is asked for, and no piece that was not audited."""

import ast
import math
from pathlib import Path

import numpy as np
import pytest
from four_bars import loose

import mechanism_sim as ms
from mechanism_sim.cli import main
from mechanism_sim.engine import audit
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.engine.physics import DynamicPhysics
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.results.measures import Measurement
from mechanism_sim.results.run import Batch, Runner, run
from mechanism_sim.results.turns import ImpactAccumulator
from mechanism_sim.studies.floquet import station
from mechanism_sim.studies.periodic import find_periodic
from mechanism_sim.studies.plan import Extent
from mechanism_sim.studies.row import SweepTask
from mechanism_sim.studies.runs import compute
from mechanism_sim.studies.statistics import statistics

PACKAGE = Path(ms.__file__).parent
ENGINES = 'engine', 'linkages'
TURNED = {'drive': {
    'coordinate': 'crank', 'torque': {'constant': 0.2, 'per_speed': -0.01}, 'speed': 20.0,
}}  # fmt: skip


def calls(method, without_arguments=False):
    """Modules beside the engines that call a method of this name."""
    found = set()
    for path in PACKAGE.rglob('*.py'):
        name = path.relative_to(PACKAGE)
        if name.parts[0] in ENGINES:
            continue
        text = path.read_text(encoding='utf-8')
        for node in ast.walk(ast.parse(text)) if method in text else ():
            called = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
            if called and node.func.attr == method and not (without_arguments and node.args):
                found.add(name.as_posix())
    return found


def test_one_module_takes_motion_from_engines_and_judges_it():
    assert calls('drain', without_arguments=True) == {'results/run.py'}
    assert calls('judge') == {'results/run.py'}


def digest_of(pieces):
    digest = MotionDigest()
    for piece in pieces:
        digest.add(piece.motion, piece.impacts)
    return digest.hexdigest()


SCENES = ('four_bar_clearance', 'four_bar_nominal', 'gear_rattle', 'pendulum')


@pytest.mark.parametrize('name', SCENES)
def test_the_motion_does_not_depend_on_how_it_is_asked_for(name):
    """Whole, in batches of steps, in batches of no time at all, up to times on the way."""
    machine = ms.load_scene(name)
    end = 0.9 * machine.drive.period if math.isfinite(machine.drive.period) else 2.0
    whole = ms.simulate(machine, duration=end)
    assert digest_of(run(machine, end)) == whole.digest()
    small = list(Runner(machine).to(end, batch=Batch(6, 3)))
    hasty = list(Runner(machine).to(end, batch=Batch(10**6, 5, longest=-1.0)))
    assert max(len(piece.motion) for piece in small) == 6
    assert max(len(piece.motion) for piece in hasty) == 5
    runner, parts = Runner(machine), []
    for until in np.linspace(0.1, 0.9, 7) * end:
        parts += runner.to(until, final=False)
        assert runner.known == until >= runner.engine.time
    parts += runner.to(end)
    assert runner.known == pytest.approx(end)
    for pieces in (small, hasty, parts):
        assert digest_of(pieces) == whole.digest()
        work = np.concatenate([piece.balance.work for piece in pieces], axis=1)
        np.testing.assert_allclose(work, whole.balance.work, rtol=1e-9, atol=1e-12)
    assert runner.audit.drive_work == pytest.approx(whole.energy.drive_work)


def test_short_pieces_may_be_audited_together(monkeypatch):
    """What is known of each in the end, and of all of them, is the same bit by bit."""
    counts, add = [], audit.Audit.add
    monkeypatch.setattr(audit.Audit, 'add', lambda self, motion, impacts: (
        counts.append(len(motion)), add(self, motion, impacts),
    )[1])  # fmt: skip
    alone, group, end = Runner(loose()), Runner(loose(), together=200), 0.3
    short = Batch(6, 3)
    known = [piece.balance for piece in alone.to(end, batch=short)]
    pieces, said, steps = len(counts), [], sum(counts)
    counts.clear()
    for number, _ in enumerate(group.to(end, batch=short)):
        said.append(group.balance() if number % 40 == 7 else None)
    said[-1] = group.balance()
    assert sum(counts) == steps
    assert len(counts) < pieces / 10
    assert all(b is None or b.after == a.after for a, b in zip(known, said, strict=True))
    assert len([b for b in said if b]) > 3
    assert group.audit.max_penetration == alone.audit.max_penetration
    ours, theirs = alone.audit.energy, group.audit.energy
    assert ours.residual == pytest.approx(theirs.residual, abs=1e-12)
    assert ours.exchanged == pytest.approx(theirs.exchanged, rel=1e-9)


def test_a_run_goes_on_from_a_snapshot():
    machine = loose()
    first = ms.simulate(machine, revolutions=1)
    end = 2.0 * machine.drive.period
    rest = list(run(machine, end, resume=first.snapshot))
    whole = ms.simulate(machine, revolutions=2)
    assert rest[-1].motion.curve.end == whole.duration
    assert rest[-1].view(end).observed.position.tolist() == (
        whole.view(end).observed.position.tolist()
    )


def test_observers_see_every_piece_before_it_is_handed_on():
    seen = []
    for piece in Runner(loose()).to(0.1, [seen.append], batch=Batch(50, 50)):
        assert seen[-1] is piece
    assert len(seen) > 2


def test_motions_that_are_tried_have_no_balance():
    (piece,) = Runner(loose(), audited=False).to(0.05)
    assert np.isnan(piece.balance.work).all()
    assert piece.balance.work.drive.shape == (len(piece.motion),)


@pytest.fixture
def sunk(monkeypatch):
    """Gaps of all machines are said to be 1 mm less than they are."""
    gaps = DynamicPhysics.open_gaps
    monkeypatch.setattr(DynamicPhysics, 'open_gaps', lambda *at: gaps(*at) - 1e-3)


WAYS = {
    'simulate': lambda machine: ms.simulate(machine, revolutions=1),
    'stream': lambda machine: ms.stream(machine, revolutions=1).finish(),
    'run': lambda machine: list(run(machine, machine.drive.period)),
    'short pieces': lambda machine: list(
        Runner(machine, together=10**6).to(machine.drive.period, batch=Batch(6, 3))
    ),
    'statistics': lambda machine: statistics(machine, 21, 1),
    'cycle': ms.cycle,
    'measures': lambda machine: ms.measure(
        machine, ms.stream(machine, revolutions=1), 'mean(velocity.rocker)'
    ),
}


@pytest.mark.usefixtures('sunk')
@pytest.mark.parametrize('way', WAYS)
def test_a_run_that_fails_its_audit_fails_everywhere(way):
    with pytest.raises(RunError, match='violated'):
        WAYS[way](loose())


@pytest.mark.usefixtures('sunk')
def test_nobody_observes_what_fails():
    seen = []
    with pytest.raises(RunError, match='violated'):
        list(run(loose(), 0.5, [seen.append]))
    assert not seen


@pytest.mark.usefixtures('sunk')
def test_a_row_of_a_sweep_says_that_its_run_fails():
    machine = loose()
    row = compute(SweepTask('key', machine.name, machine.scene, Extent(20, None, 0))).row
    assert 'violated' in row['status']
    assert len(row) == 1


@pytest.mark.usefixtures('sunk')
def test_the_command_says_so_in_one_sentence(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['solve', 'four_bar_clearance', '--set', 'start=centred', '--json'])
    assert ended.value.code == 1
    assert 'violated' in capsys.readouterr().err


@pytest.mark.slow
def test_a_shooting_method_fails_where_it_ends(monkeypatch):
    """A turn of a machine that settles, whose balance is said to be off by as much again."""
    assert station(ms.load_scene('four_bar_nominal', TURNED), turning=True).modes
    damped = ms.load_scene('elastic_slider_crank', {'links.rod.elastic.damping': 0.05})
    strict = audit._AUDIT._replace(missing=-math.inf)
    monkeypatch.setattr(audit, '_AUDIT', strict)
    with pytest.raises(RunError, match='J remain'):
        station(ms.load_scene('four_bar_nominal', TURNED), turning=True)
    with pytest.raises(RunError, match='J remain'):
        find_periodic(damped, transient=1)


def test_means_and_measures_of_a_resumed_run_are_of_what_it_saw():
    """Turns before the snapshot counted as turns without impacts."""
    machine = loose()
    first = ms.simulate(machine, revolutions=3)
    figures = Measurement(machine, ['rms(drive_torque)'])
    accumulator, struck = ImpactAccumulator(machine), 0
    for piece in run(machine, 6.0 * machine.drive.period, resume=first.snapshot):
        accumulator.add(piece)
        figures.add(piece)
        struck += len(piece.impacts)
    impacts, *_ = accumulator.means
    assert impacts.revolutions == 3
    assert impacts.mean == struck / 3
    (torque,) = figures.found()
    assert 's on, where what was run begins' in torque.resolution


def test_revolutions_may_be_written():
    assert ms.simulate('slider_crank', revolutions='2').duration == (
        ms.simulate('slider_crank', revolutions=2).duration
    )
    with pytest.raises(InputError, match="revolutions = 'two' is not a number"):
        ms.simulate('slider_crank', revolutions='two')


@pytest.mark.slow
def test_a_stream_that_was_interrupted_amid_a_piece_does_not_go_on():
    """What of the piece was counted nobody knows; after a break between pieces it goes on."""
    machine = ms.load_scene('four_bar_clearance')
    whole = ms.stream(machine, revolutions=50).finish()
    run = ms.stream(machine, revolutions=50)
    for _ in run:
        break
    assert vars(run.finish().totals) == vars(whole.totals)

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    run = ms.stream(machine, revolutions=50, progress=interrupt)
    with pytest.raises(KeyboardInterrupt):
        run.finish()
    with pytest.raises(RunError, match='interrupted amid a piece'):
        run.finish()


@pytest.mark.parametrize('run', [ms.simulate, ms.cycle, ms.stream])
def test_a_run_that_no_computer_ends_is_refused(run):
    """A turn at such a speed takes longer than the universe is old, in steps of 0.1 s."""
    machine = ms.load_scene('four_bar_clearance', {'drive.speed': '1e-18 rpm'})
    with pytest.raises(InputError, match=r'four_bar_clearance: 6e\+19 s take more than 1e\+11'):
        list(run(machine, **({} if run is ms.cycle else {'revolutions': 1})))


def test_times_may_be_what_an_analyst_has():
    """Numbers, texts with units, time differences; none at all give an empty table."""
    solution = ms.simulate('slider_crank', duration='0.1 s')
    known = solution.sample([0.02, 0.1], 'position.crank')['position.crank']
    for t in (['20 ms', '0.1 s'], np.array([20, 100], 'm8[ms]'), ['20 ms', 0.1]):
        assert np.array_equal(solution.sample(t, 'position.crank')['position.crank'], known)
    empty, full = solution.sample([]), solution.sample(0.1)
    assert (list(empty), empty.units) == (list(full), full.units)
    assert {len(x) for x in empty.values()} == {0}
    for wrong in ([True], [None], np.array(['2020-01-01'], 'M8[s]'), ['1 kg'], [[0.1], [0.05]]):
        with pytest.raises(ms.InputError, match=r'^t[ :]'):
            solution.sample(wrong)
    with pytest.raises(ms.InputError, match='an array of shape'):
        ms.cycle('slider_crank').at(np.zeros((2, 2)))


def test_a_column_that_is_none_is_answered_by_the_nearest():
    sample = ms.simulate('pendulum', duration='0.1 s').sample([0.0])
    link = ms.load_scene('pendulum').plan.links[0]
    with pytest.raises(KeyError) as refused:
        sample[f'positon.{link}']
    assert f"did you mean 'position.{link}'?" in str(refused.value)
    assert sample.get('positon') is None


@pytest.mark.parametrize('name', ['four_bar_clearance', 'gear_rattle', 'whole_machine'])
def test_no_bit_of_a_sample_depends_on_how_many_are_asked_for(name):
    """Bags of one run, whose messages come in batches, are then alike, and like its solution."""
    solution = ms.simulate(name, duration='0.1 s')
    t = np.linspace(0.0, 0.1, 41)
    together = solution.sample(t)
    for each in (1, 3, 7):
        parts = [solution.sample(t[k : k + each]) for k in range(0, len(t), each)]
        for column, values in together.items():
            assert np.array_equal(values, np.concatenate([p[column] for p in parts])), column
