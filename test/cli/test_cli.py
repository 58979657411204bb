"""The command line: the contract of its JSON, its exit codes, one sentence for bad input."""

from __future__ import annotations

import argparse
import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from running import environment, run, run_json

import mechanism_sim as ms
from mechanism_sim.cli.entry import make_parser
from mechanism_sim.cli.options import ros_args
from mechanism_sim.cli.overview import GROUPS
from mechanism_sim.cli.source import is_bag
from mechanism_sim.errors import InputError
from zenoh_rclpy.arguments import parse_arguments

NOMINAL_AT = {
    # crank angle [deg]: th3, th4, w3, w4, a3, a4, force on the rocker [N], crank torque [N m]
    0: (
        1.031746592, 2.125711822, -7.262295975, -7.262295975, -197.6936693, 190.7571146,
        (0.236389605, -7.946370284), -0.725288922,
    ),
    90: (
        0.729165459, 2.096503057, None, None, None, None,
        (-3.368383662, -2.432377659), 0.661945992,
    ),
}  # fmt: skip


@pytest.mark.parametrize('degrees', [0, 90])
def test_solve_gives_the_known_figures_of_the_nominal_mechanism(degrees):
    th3, th4, w3, w4, a3, a4, force, torque = NOMINAL_AT[degrees]
    # A whole turn from the start angle ends at the start angle.
    result = run_json('solve', 'four_bar_nominal', '--set', f'drive.start_angle={degrees} deg')
    final = result['final']
    expected = {
        ('position', 'coupler'): th3,
        ('position', 'rocker'): th4,
        ('velocity', 'coupler'): w3,
        ('velocity', 'rocker'): w4,
        ('acceleration', 'coupler'): a3,
        ('acceleration', 'rocker'): a4,
    }
    for (kind, link), value in expected.items():
        if value is not None:
            assert final[kind][link] == pytest.approx(value, rel=1e-8)
    assert final['reactions']['coupler_rocker'] == pytest.approx(force, rel=1e-8)
    assert final['drive_torque'] == pytest.approx(torque, rel=1e-8)


def test_solve_keeps_its_contract():
    result = run_json('solve', 'four_bar_clearance', '--revolutions', '1.2')
    assert set(result) >= {
        'scene', 'level', 'duration', 'wall_time', 'cpu_time', 'steps', 'switches',
        'compile_time', 'stop_reason', 'coordinates', 'final', 'impacts', 'modes',
        'max_penetration', 'max_closure_error', 'energy',
    }  # fmt: skip
    assert result['coordinates'] == ['crank', 'coupler', 'rocker']
    assert set(result['final']) >= {
        't', 'position', 'velocity', 'acceleration', 'reactions', 'drive_torque',
    }  # fmt: skip
    assert set(result['final']['reactions']) == {
        'ground_crank', 'crank_coupler', 'coupler_rocker', 'rocker_ground',
    }  # fmt: skip
    assert set(result['impacts'][0]) >= {
        't', 'joint', 'normal_impulse', 'tangential_impulse', 'approach_speed', 'normal_angle',
        'energy_loss',
    }  # fmt: skip
    assert [m['mode'] for m in result['modes'][:3]] == ['following', 'free_flight', 'following']
    assert set(result['energy']) == {
        'initial', 'final', 'drive_work', 'dissipated', 'residual', 'error', 'exchanged',
    }  # fmt: skip
    assert abs(result['energy']['residual']) < 1e-12


@pytest.mark.optimised  # as in the other process
def test_a_process_of_its_own_says_what_this_one_does():
    args = ('solve', 'four_bar_clearance')
    apart, here = run_json(*args, env=environment()), run_json(*args)
    assert apart.keys() == here.keys()
    assert apart['digest'] == here['digest']
    refused = [run('check', 'four_bar_clearence', env=env) for env in (environment(), None)]
    assert [(r.returncode, r.stdout, r.stderr) for r in refused] == 2 * [
        (2, '', refused[0].stderr)
    ]


def test_scenes_as_json():
    scenes = run_json('scenes')
    assert [s['name'] for s in scenes] == ms.scene_names()
    assert {s['name']: s['level'] for s in scenes}.items() >= {
        'four_bar_clearance': 'nonsmooth dynamics',
        'four_bar_crossed': 'kinematic',
        'four_bar_nominal': 'inverse dynamics',
        'slider_crank_engine': 'smooth dynamics',
    }.items()


@pytest.mark.parametrize(
    ('args', 'words'),
    [
        (('solve', 'four_bar_clearence'), ['four_bar_clearence', "'four_bar_clearance'"]),
        (('solve', 'four_bar_nominal', '--set', 'drive.sped=3'), ['drive.sped', "'speed'"]),
        (('solve', 'four_bar_nominal', '--set', 'drive.speed=3 kg'), ['drive.speed', '350 rpm']),
        (('solve', 'four_bar_nominal', '--revolutions', '-1'), ['positive', '-1']),
        (
            ('solve', 'four_bar_nominal', '--revolutions', '1', '--duration', '1'),
            ['revolutions', 'duration', 'not both'],
        ),
        (('solve', 'four_bar_nominal', '--output', 'x.txt', '--sample-rate', '9'), ['.npz']),
        (('check', 'no/such/file.yaml'), ['no/such/file.yaml']),
        (('bag', 'info', 'missing.mcap'), ['missing.mcap']),
        (('analyze', 'missing.mcap'), ['missing.mcap']),
        (('node', 'linkages'), ["'linkage'"]),
        (('run', 'four_bar_nominal', '--realtime-factor', '-1'), ['--realtime-factor']),
    ],
)
def test_bad_input_gets_one_sentence_and_code_2(args, words):
    done = run(*args, refused=True)
    assert done.returncode == 2
    assert done.stdout == ''
    assert len(done.stderr.strip().splitlines()) == 1
    for word in words:
        assert word in done.stderr
    assert 'Traceback' not in done.stderr


@pytest.mark.parametrize(
    ('line', 'said'),
    [
        ('run slider_crank --overwrite', '--overwrite needs --record'),
        ('report slider_crank -o x.pdf', 'mechanism-sim cycle slider_crank --plots x.pdf'),
        ('check slider_crank --equations --json --latex', '--latex and --json exclude each other'),
        ('analyze x.mcap --band 1:2', '--band needs --envelope'),
        ('analyze x.mcap --pin-radius 1', '--pin-radius needs --wear'),
        ('analyze x.mcap --skip 3', '--skip needs a detail'),
        ('animate x.mcap -o x.wav --duration 0', 'the length does not apply to a bag'),
        ('report slider_crank --set-other drive.speed=3 --measure rms(drive_torque)',
         '--measure does not apply to a comparison'),
        ('view --realtime-factor 2', '--realtime-factor needs a run of its own'),
        ('plot slider_crank --ideal', '--ideal needs the name of a quantity'),
        # before anything is run: a run of this length would not end
        ('plot slider_crank velocity.crank --against velocity.crnk --revolutions 1e12',
         "no quantity 'velocity.crnk'; did you mean 'velocity.crank'?"),
        ('plot slider_crank velocity.crnk --revolutions 1e12', "did you mean 'velocity.crank'?"),
        ('draw valve_train --profile contact --friction 0.1',
         'no figure of contact depends on friction'),
        ('draw worm_drive --profile pair --gear x', 'no outline in the plane'),
        ('draw slider_crank --magnify 3', '--magnify does not apply: slider_crank has no elastic'),
        ('draw gear_pair --gear wheel', '--gear needs --profile'),
        ('draw gear_pair --profile mesh --positions 3', '--positions does not apply to --profile'),
        ('check slider_crank --latex', '--latex needs --equations'),
        ('find slider_crank --stages 2', '--stages needs --teeth'),
        ('find --teeth 3 --values 5', '--values needs a scene'),
        ('find slider_crank --teeth 3', "takes no scene, but 'slider_crank' was given"),
        ('find --lift-off', 'SCENE is missing'),
        ('find valve_train --lift-off --values 5', '--values does not apply to --lift-off'),
        ('analyze x.mcap --seed 3', '--seed needs --fit'),
        ('analyze x.mcap y.mcap', 'analyze reads one bag, not 2'),
        ('analyze x.mcap --fit radial --wear J', '--wear does not apply to --fit'),
        ('analyze x.mcap --fit radial --skip 3', "--skip '3' is not a quantity with a unit"),
        ('statistics slider_crank --skip 2s', "--skip '2s': write a whole number of turns"),
        ('animate slider_crank -o x.wav --fps 5', '--fps applies to a film'),
        ('animate slider_crank --pulse 1', '--pulse applies to a sound'),
        ('export slider_crank --format urdf --namespace a', '--namespace applies to --format'),
        ('cycle four_bar_crossed --local', 'its level has no forces'),
        ('run slider_crank --ros-args -r __node:=a', '-r __node:=a: nodes of a run find each'),
        ('run slider_crank --ros-args --remap linkage:__name:=a', '-r linkage:__name:=a: nodes'),
        ('run slider_crank --ros-args -r linkage:__ns:=/a', 'the namespace of all, by __ns:='),
        ('run slider_crank --namespace 1a --plan', "--namespace: '1a' is no namespace: between"),
        ('run slider_crank --plan --ros-args -r drive:=1a', "-r drive:=1a: '1a' is no topic"),
    ],
)  # fmt: skip
def test_an_option_that_does_not_apply_is_refused(line, said):
    done = run(*line.split(), refused=True)
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    assert said in done.stderr


def test_keys_without_effect_and_odd_units_are_said_beside_the_result():
    """Not by `check`, whose report has them."""
    odd = '--rtol', '1e-9', '--set', 'start=centred', '--set', 'gravity=[0, -9814 m/s^2]'
    done = run('solve', 'slider_crank', *odd, '--json')
    assert done.returncode == 0
    assert json.loads(done.stdout)['scene'] == 'slider_crank'
    solver, start = 'solver.rtol has no effect', "start = 'centred' has no effect"
    for said in (solver, start, 'on Earth it is 9.81 m/s^2: is the unit right?'):
        assert 'mechanism-sim: slider_crank: ' in done.stderr
        assert said in done.stderr
    report = run('check', 'slider_crank', *odd)
    assert report.stderr == ''
    assert solver in report.stdout
    assert start in report.stdout


def test_no_option_takes_the_last_of_two_values_in_silence():
    """Every option of every command that takes a value takes one, or collects all of them."""
    tried = 0
    for sub in make_parser().leaves().values():
        for action in sub._actions:
            if not action.option_strings or action.nargs == 0:
                continue
            values = action.choices or [{int: '1', None: 'x'}.get(action.type, '1.5')]
            given = [action.option_strings[-1], values[0]]
            words = [w for a in sub._get_positional_actions() for w in (a.choices or ['x'])[:1]]
            if isinstance(action, argparse._AppendAction):
                found, _ = sub.parse_known_args([*words, *given, *given])
                assert len(getattr(found, action.dest)) == 2
                continue
            with pytest.raises(InputError, match='takes one value, but'):
                sub.parse_known_args([*words, *given, *given])
            sub.parse_known_args([*words, *given])  # the next command line is another
            tried += 1
    assert tried > 100


@pytest.mark.slow
def test_two_ranges_of_find_are_both_varied():
    ranges = '--vary', 'drive.speed=10:20', '--vary', 'links.crank.length=10 mm:20 mm'
    found = run_json('find', 'slider_crank', *ranges, '--minimise', 'rms(drive_torque)')
    # the slowest and the shortest crank accelerate the piston least
    assert found['values'] == pytest.approx({'drive.speed': 10.0, 'links.crank.length': 0.01})


@pytest.mark.slow
@pytest.mark.network
def test_a_bag_is_never_overwritten_without_being_told(tmp_path):
    bag = tmp_path / 'run.mcap'
    bag.write_bytes(b'precious')
    refused = run('run', 'four_bar_nominal', '--record', str(bag), refused=True)
    assert refused.returncode == 2
    assert '--overwrite' in refused.stderr
    assert bag.read_bytes() == b'precious'
    done = run(
        'run', 'four_bar_nominal', '--duration', '0.02', '--record', str(bag), '--overwrite'
    )
    assert done.returncode == 0, done.stderr
    assert bag.stat().st_size > 1000


@pytest.mark.parametrize('suffix', ['npz', 'csv', 'parquet'])
def test_samples_as_files(tmp_path, suffix):
    file = tmp_path / f'samples.{suffix}'
    run_json('solve', 'four_bar_clearance', '--sample-rate', '1000', '--output', str(file))
    if suffix == 'npz':
        columns = dict(np.load(file))
    elif suffix == 'csv':
        names = [head.partition(' [')[0] for head in file.read_text().splitlines()[0].split(',')]
        columns = dict(zip(names, np.loadtxt(file, delimiter=',', skiprows=1).T, strict=True))
    else:
        columns = {name: np.array(x) for name, x in pq.read_table(file).to_pydict().items()}
    assert len(columns['t']) == 172
    assert np.abs(columns['position.crank'] - 36.6519 * columns['t']).max() < 1e-12
    assert (columns['gap.coupler_rocker'] > -1e-12).all()


@pytest.mark.slow
@pytest.mark.network
def test_info_and_analyze_as_json(tmp_path):
    bag = tmp_path / 'run.mcap'
    run_json('run', 'four_bar_clearance', '--revolutions', '2', '--record', str(bag))
    found = json.loads(run('bag', 'info', str(bag), '--json').stdout)
    assert found['scene'] == 'four_bar_clearance'
    assert found['complete'] is True
    summary = json.loads(run('analyze', str(bag), '--json').stdout)
    assert summary['impacts']['count'] == 72
    assert summary['motion']['revolutions'] == pytest.approx(2.0, abs=1e-12)
    text = run('analyze', str(bag)).stdout
    for word in ('revolution', 'following', 'energy', 'impulse', 'digest'):
        assert word in text


OTHERWISE = {
    '--from': {'new'},  # the scene that is copied; elsewhere the time at which something begins
    **{flag: {'find', 'plot'} for flag in ('-o', '--output')},  # a picture and numbers
    '--path': {'find'},  # the points that a path is to pass; elsewhere a point whose path is drawn
}
"""Options that mean something else in these commands."""


def test_an_option_is_the_same_in_every_command():
    kinds = {}
    for name, command in make_parser().leaves().items():
        for action in command._actions:
            for flag in action.option_strings:
                if name not in OTHERWISE.get(flag, ()):
                    found = action.nargs, type(action).__name__
                    kinds.setdefault(flag, {})[name] = found
    assert {flag: k for flag, k in kinds.items() if len(set(k.values())) > 1} == {}


def test_the_first_level_can_be_remembered():
    assert len(sum(GROUPS.values(), ())) <= 24


def test_parameters_of_one_node_reach_it_below_a_namespace():
    given = ['--ros-args', '-p', 'crank_drive:lead:=0.5', '-p', 'use_sim_time:=true']
    for space in ('left', '/cell/one'):
        options = argparse.Namespace(ros_args=given, namespace=space)
        found = parse_arguments(ros_args(options))
        here = space.strip('/')
        assert found.parameters_of(f'/{here}/crank_drive') == {'lead': 0.5, 'use_sim_time': True}
        assert found.parameters_of(f'/{here}/linkage') == {'use_sim_time': True}


def test_a_bag_is_one_by_its_ending_or_its_beginning(tmp_path):
    """`run --record x.bag` was read by `analyze`, and was a scene that is no text for `plot`."""
    bag, scene = tmp_path / 'x.bag', tmp_path / 'x.yaml'
    bag.write_bytes(b'\x89MCAP0\r\n')
    scene.write_text('title: x\n', encoding='utf-8')
    assert [is_bag(str(x)) for x in (bag, scene, tmp_path, 'slider_crank', 'no.mcap')] == [
        True, False, False, False, True,
    ]  # fmt: skip
