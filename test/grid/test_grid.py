"""The grid of valid runs: a sample of it, and that it would see what it looks for."""

import os
import re

import numpy as np
import pytest
import yaml
from builders import made
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.engine import frictional_shocks
from mechanism_sim.engine.audit import Audit
from mechanism_sim.engine.contact import respond
from mechanism_sim.engine.contact.problem import Rest
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.errors import RunError
from test.grid import jams as jams_module
from test.grid.case import Draft, Family, GridCase, exchanged_energy, run_case, variant
from test.grid.command import main
from test.grid.jams import confirm_jam, confirm_straight, jams, solutions
from test.grid.joint_jams import JointForces, no_forces
from test.grid.run import FAMILIES, grid, write_scenes
from test.grid.shards import Shards

# of each family so many neighbours, whose equations have one structure: little is compiled
SAMPLE = {
    'four_bar_ideal': 3, 'four_bar_rigid': 6, 'four_bar_friction': 4, 'geneva': 2, 'slot': 2,
    'ranges': 1, 'loads': 4, 'loads_drives': 1, 'package': 6, 'cam': 2, 'train': 2,
    'train_rattle': 3, 'elastic': 1, 'rotor': 2, 'tilted': 1, 'belt': 1, 'walls_rubbing': 1,
}  # fmt: skip
# a start that parts at once, depths of minus a rounding, two ends of slip in one step, a recovery
# of one long step; refusals that came only with the run; two ends that part in one step; a table
# between two speeds, pulses that move nothing
ONCE = (
    'four_bar_compliant_066', 'four_bar_compliant_115', 'four_bar_compliant_joints_008',
    'cam_compliant_014', 'linkage_loose_020', 'linkage_loose_029', 'four_bar_friction_005',
    'tilted_024', 'loads_047', 'loads_loose_014', 'loads_loose_037',
)  # fmt: skip
CASES = [c for name, count in SAMPLE.items() for c in grid(only=[name])[:count]]
CASES += grid(only=ONCE)


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    'case',
    [pytest.param(c, marks=[pytest.mark.slow] * (k % 2), id=c.name) for k, c in enumerate(CASES)],
)
def test_a_case_comes_through(case):
    outcome = run_case(case)
    assert outcome.ok is not False, f'{outcome.kind}: {outcome.reason}'


def test_the_grid_is_large_and_of_every_kind():
    cases = grid()
    assert len(cases) >= 1000
    assert len({case.name for case in cases}) == len(cases)
    assert {case.family.name for case in cases} == {f.name for f in FAMILIES}


def test_a_case_is_the_same_in_any_part_of_the_grid():
    few = grid(sample=7)
    alone = [grid(only=[case.name])[0] for case in few]
    assert [c.draft() for c in few] == [c.draft() for c in alone]
    assert [c.name for c in grid(seed=4, sample=7)] != [c.name for c in few]
    (other,) = grid(seed=4, only=[few[0].name])
    assert other.draft() != few[0].draft()


@pytest.mark.slow
def test_the_noise_of_a_gap_does_not_rule_the_steps():
    """A rough pin that starts to roll: errors were taken back faster with every shorter step."""
    rough = {'radial': 2e-3, 'restitution': 0.05, 'friction': 'rough', 'pin_radius': 5e-3}
    scene = variant('four_bar_clearance', {
        'joints.coupler_rocker.clearance': rough, 'gravity': [0.0, 0.0],
        'drive': {'speed': -8.9, 'start_angle': 2.9},
    })  # fmt: skip
    outcome = judged(Draft(scene, revolutions=1.1))
    assert outcome.ok, outcome.reason
    assert outcome.figures['residual'] < 1e-11


def judged(draft, refusals=()):
    """The outcome of a case that is made so."""

    def make(*_):
        if isinstance(draft, Exception):
            raise draft
        return draft

    return run_case(GridCase(Family('mine', 1, make, refusals), 0, 0))


@pytest.mark.slow
def test_every_scene_of_the_grid_can_be_written(tmp_path):
    cases = [case for f in FAMILIES for case in grid(only=[f.name])[:: max(1, f.count // 4)]]
    write_scenes(cases, tmp_path)
    for case in cases:
        assert yaml.safe_load((tmp_path / f'{case.name}.yaml').read_text()) == case.draft().scene


@pytest.mark.slow
@pytest.mark.usefixtures('plain_kernels')
def test_a_jam_that_is_none_is_not_confirmed(monkeypatch):
    """The run is told that nothing keeps the contact; the second route finds what does."""
    machine = ms.load_scene('four_bar_clearance', {
        'joints.coupler_rocker.clearance.friction': 0.3,
    })  # fmt: skip

    def fails(*_):
        raise ArithmeticError

    with monkeypatch.context() as patched:
        unsolved = Rest(False, False, False, False, False, False, 0.0)
        patched.setattr(respond, 'come_to_rest', lambda *_: unsolved)
        patched.setattr(frictional_shocks, 'shock_contacts', fails)
        with pytest.raises(RunError, match=r'friction jams coupler_rocker at t = .* crank at'):
            ms.simulate(machine, revolutions=2.0)
        with pytest.raises(RunError) as ended:
            ms.simulate(machine, revolutions=2.0)
    assert not confirm_jam(machine, ended.value)
    monkeypatch.setattr(jams_module, 'solutions', lambda *_: iter(()))
    assert confirm_jam(machine, ended.value)


def test_what_goes_wrong_is_told_apart(monkeypatch):
    nothing = judged(ZeroDivisionError('nothing'))
    assert (nothing.ok, nothing.kind) == (False, 'exception')
    assert 'ZeroDivisionError' in nothing.reason
    scene = variant('four_bar_clearance', {'links.crank.length': 9.0})
    assert judged(Draft(scene)).kind == 'refused'
    assert judged(Draft(scene)).ok is False
    assert judged(Draft(scene), ('cannot be assembled',)).ok is None
    scene = variant('slider_crank', {})
    assert judged(Draft(scene, revolutions=1.0)).ok

    def ends(*_):
        raise RunError('it broke')

    with monkeypatch.context() as patch:
        patch.setattr(Audit, 'judge', ends)
        assert judged(Draft(scene)).kind == 'ended early'
    with monkeypatch.context() as patch:
        add = Audit.add

        def wasteful(self, motion, impacts):
            work = add(self, motion, impacts)
            self.drive_work += 1e-6
            return work

        patch.setattr(Audit, 'add', wasteful)
        assert judged(Draft(scene)).kind == 'energy'


@pytest.mark.slow
def test_what_is_exchanged_is_the_integral_of_power():
    """Of a slider-crank with a drag: the drive gives and takes, densely sampled."""
    machine = ms.load_scene('slider_crank', {
        'loads': {'drag': {'at': 'piston', 'force': ['-20*vx', 0]}},
    })  # fmt: skip
    solution = ms.simulate(machine)
    t = np.linspace(0.0, solution.duration, 200_001)
    values = solution.sample(
        t, 'energy.kinetic', 'drive_torque', 'velocity.crank', 'velocity.piston'
    )
    drive = np.abs(values['drive_torque'] * values['velocity.crank'])
    drag = 20.0 * values['velocity.piston'] ** 2
    wanted = np.trapezoid(drive + drag, t) + values['energy.kinetic'].max()
    found = exchanged_energy(solution, values['energy.kinetic'])
    # each step counts with its sum, so that a step over a change of sign counts a little less
    assert 0.98 * wanted < found < wanted * (1.0 + 1e-6)


@pytest.mark.slow
def test_the_command(tmp_path):
    names = [c.name for c in grid(only=['train'])[:2]]
    content = run_json(
        '--only', ','.join(names), '--workers', '1', '--output', str(tmp_path), program=main
    )
    assert [(c['name'], c['ok'], c['reason']) for c in content['cases']] == [
        (name, True, '') for name in names
    ]
    assert (content['runs'], content['failed'], content['drafts']) == (2, 0, 2)
    scene = tmp_path / f'{names[0]}.yaml'
    assert 'solve' in scene.read_text().splitlines()[0]
    assert yaml.safe_load(scene.read_text()) == grid(only=names[:1])[0].draft().scene
    for arguments, said in (
        (('--only', 'trian'), "did you mean 'train'"),
        (('--sample', '0'), '--sample must be at least 1'),
        (('train',), "'train' is one argument too many"),
    ):
        done = run(*arguments, program=main)
        assert done.returncode == 2
        assert said in done.stderr


def outcomes_of(shards):
    return {o.name: (o.ok, o.kind, dict(o.figures)) for o in shards.outcomes()}


@pytest.mark.slow
def test_a_process_holds_no_more_than_it_may_and_cases_do_not_depend_on_it():
    cases = grid(only=['slot'])[:3]
    one, each = Shards(cases), Shards(cases, memory=1)
    assert (
        outcomes_of(one)
        == outcomes_of(each)
        == {o.name: (True, '', dict(o.figures)) for o in map(run_case, cases)}
    )
    assert (one.ended, each.ended) == (1, 3)
    assert one.peak_memory > 2**26


@pytest.mark.slow
def test_a_process_that_dies_costs_the_case_that_it_was_at(monkeypatch, tmp_path):
    """It is started with a module that ends Python at the second case."""
    (tmp_path / 'sitecustomize.py').write_text(
        'import os, sys\n'
        'def deadly(event, arguments):\n'
        "    if event == 'resource.setrlimit':\n"
        '        deadly.count += 1\n'
        '        if deadly.count == 2:\n'
        '            os.kill(os.getpid(), 9)\n'
        'deadly.count = 0\n'
        "if 'slot_001' in sys.orig_argv:\n"
        '    sys.addaudithook(deadly)\n'
    )
    monkeypatch.setenv('PYTHONPATH', str(tmp_path), prepend=os.pathsep)
    cases = grid(only=['slot'])[:3]
    names = [case.name for case in cases]
    assert 'slot_001' in names
    shards = Shards(cases)
    found = {o.name: (o.ok, o.reason) for o in shards.outcomes()}
    dead = [name for name in names if found[name] != (True, '')]
    assert found[dead[0]] == (False, 'its process ended by SIGKILL')
    assert set(found) == set(names)


@pytest.mark.slow
def test_whoever_stops_looking_ends_all_processes():
    shards = Shards(grid(only=['slot', 'geneva']), workers=2)
    outcomes = shards.outcomes()
    assert next(outcomes).ok
    processes = [shard.process for shard in shards._running]
    outcomes.close()
    assert processes
    assert all(process.returncode == -9 for process in processes)


@pytest.mark.parametrize('friction', [0.3, 0.9])
def test_one_contact_never_jams_for_good(friction):
    """Painleve's rod: no force holds it above mu = Ann/Ant, but an impact that stops it does."""
    A, b = np.array([[1.0, 2.0], [2.0, 5.0]]), np.array([-1.0, 0.0])
    v = np.array([0.0, 1.0])
    found = list(solutions(A, b, np.array([1.0]), [friction]))
    assert len(found) == (1 if friction < 0.5 else 0)
    if found:
        normal, tangential = found[0]
        assert normal == pytest.approx(1.0 / (1.0 - 2.0 * friction))
        assert tangential == pytest.approx(-friction * normal)
    assert not jams(A, b, v, [friction])


@pytest.mark.slow
def test_joints_that_jam_beside_a_contact_have_no_forces_and_others_have():
    outcome = run_case(grid(only=['rubbing_loose_037'])[0])
    assert outcome.ok
    assert outcome.reason.startswith('jam, confirmed: friction jams coupler_left_rocker')
    scene = grid(only=['rubbing_loose_037'])[0].draft().scene
    machine = made(scene, 'wiper')
    run = machine.start()
    assert isinstance(run, EventLoop)
    run.advance(0.02, final=True)
    slip = run._gaps.terms().rate[1:] * (run.state.closed[0] > 0)
    joints = JointForces(run, machine.equations.system)
    assert not no_forces(joints, [0], slip, np.array([0.5]))


@pytest.mark.slow
def test_a_jam_is_seen_from_shortly_before_it_and_not_from_earlier(monkeypatch):
    """There forces go on; behind it, where what rested rests, they do not."""
    draft = grid(only=['rubbing_loose_040'])[0].draft()
    machine = made(draft.scene, 'wiper')
    with pytest.raises(RunError, match='friction jams coupler_left_rocker at t = ') as ended:
        ms.simulate(machine, revolutions=draft.revolutions)

    def told(earlier):
        text, at = str(ended.value), re.search(r't = (\S+) s', str(ended.value))[1]
        return RunError(text.replace(at, f'{float(at) * (1.0 - earlier):.15g}'))

    assert confirm_jam(machine, told(2e-7))
    assert not confirm_jam(machine, told(1e-6))
    assert not confirm_jam(machine, told(0.01))
    monkeypatch.setattr(jams_module, '_BEHIND', 0.0)
    assert not confirm_jam(machine, told(2e-7))


def test_a_rope_that_leaves_its_pulley_is_straight_there_and_not_before():
    """A weight that is thrown up beyond the pulley draws the rope off it."""
    draft = grid(only=['ropes_033'])[0].draft()
    machine = made(draft.scene, 'hoist')
    with pytest.raises(RunError, match='rope leaves its pulley on ground') as ended:
        ms.simulate(machine, duration=draft.duration)
    assert confirm_straight(machine, ended.value)
    earlier = re.sub(r't = \S+ s', 't = 0.4 s', str(ended.value))
    assert not confirm_straight(machine, RunError(earlier))
    assert not confirm_straight(machine, RunError('friction jams rope at t = 0.4 s'))


def test_two_contacts_that_wedge_jam():
    """No force, and no impulse, presses either contact without pressing the other in."""
    A = np.array([
        [1.0, -3.0, 0.0, 0.0], [-3.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0],
    ])  # fmt: skip
    b, v = np.array([-1.0, -1.0, 0.0, 0.0]), np.zeros(4)
    assert jams(A, b, v, [0.5, 0.5])
    assert not jams(A, -b, v, [0.5, 0.5])
    assert not jams(np.eye(4), b, v, [0.5, 0.5])
