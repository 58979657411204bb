"""Output of `--json` is JSON by its standard, for every command and every outcome."""

import json
from dataclasses import dataclass

import numpy as np
import pytest
from builders import PLAY
from running import run as command

from benchmarks.command import main as benchmarks
from mechanism_sim import strict_json
from mechanism_sim.cli import main
from mechanism_sim.cli.entry import make_parser
from mechanism_sim.errors import RunError
from test.grid.command import main as grid
from test.hard.command import main as hard

SHORT = ('--duration', '0.03')
LOOSE = 'four_bar_clearance'


def strict(text):
    """Parse a text as JSON without NaN."""

    def refuse(name):
        raise ValueError(name)

    return json.loads(text, parse_constant=refuse)


@pytest.fixture(scope='module')
def files(tmp_path_factory):
    """Names that commands below use, in a folder of their own."""
    folder = tmp_path_factory.mktemp('json')
    done = command(
        'run', LOOSE, '--duration', '0.42', '--record', str(folder / 'run.mcap'), '--json'
    )
    assert done.returncode == 0, done.stderr
    (folder / 'broken.mcap').write_bytes((folder / 'run.mcap').read_bytes()[:5000] + b'\xff' * 500)
    (folder / 'arm.csv').write_text('Joint,X [m],Y,Links,Ground,Input\nA,0,0,arm,x,x\nB,1,0,arm')
    (folder / 'sweep.yaml').write_text(
        'title: two speeds\nscene: four_bar_nominal\nduration: 0.02\n'
        'grid: {drive.speed: [300 rpm, 350 rpm]}\n'
    )
    return folder


# {} is the folder; what ends well, and what is refused
GOOD = {
    'new': ('{}/new',),
    'import': ('{}/arm.csv', '-o', '{}/arm.yaml'),
    'scenes': ('--schema',),
    'check': (LOOSE,),
    'quantities': (LOOSE,),
    'check --equations': ('four_bar_nominal',),
    'solve': (LOOSE, *SHORT),
    'run': (LOOSE, *SHORT),
    'bag play': ('{}/run.mcap', '--rate', '0'),
    'draw': ('four_bar_nominal', '-o', '{}/drawn.svg'),
    'cycle': ('four_bar_nominal',),
    'animate': ('four_bar_nominal', '--duration', '0.005', '-o', '{}/film.gif'),
    'report': ('{}/run.mcap', '-o', '{}/page.html'),
    'plot': ('four_bar_nominal', 'velocity.rocker', *SHORT, '-o', '{}/plot.svg'),
    'export --format foxglove': (LOOSE, '-o', '{}/layout.json'),
    'animate -o {}/run.wav': ('gear_rattle', '--duration', '0.1'),
    'bag info': ('{}/run.mcap',),
    'analyze': ('{}/run.mcap',),
    'bag recover': ('{}/run.mcap',),
    'sweep': ('{}/sweep.yaml', '-o', '{}/table.parquet', '--workers', '1'),
    'thesis contact-loss': (LOOSE,),
    'draw --profile contact': ('eccentric_cam',),
    'find --teeth': ('3.5',),
    'thesis starts': (LOOSE, '--angles', '2', '--revolutions', '0.2'),
    'statistics': (LOOSE, '--revolutions', '21', '--skip', '1'),
    'find --periodic': (LOOSE, '--transient', '3', '--longest', '1'),
    'find': (
        'slider_crank',
        '--vary',
        'links.rod.length=0.3 m:0.6 m',
        '--values',
        '2',
        '--so-that',
        'largest(position.piston) = 0.5 m',
    ),
    'find --lift-off': ('eccentric_cam',),
    'bifurcation': (
        LOOSE,
        '--vary',
        'drive.speed=300 rpm:310 rpm:2',
        '--transient',
        '1',
        '--keep',
        '2',
        '--workers',
        '1',
    ),
    'basins': (
        LOOSE,
        '--vary',
        'drive.speed=300 rpm:310 rpm:2',
        '--vary',
        f'{PLAY}.restitution=0.4:0.5:2',
        '--transient',
        '1',
        '--keep',
        '2',
        '--workers',
        '1',
    ),
    'lyapunov': (LOOSE, '--revolutions', '20', '--skip', '1'),
    'life': (
        LOOSE,
        '--set',
        f'{PLAY}.pin_radius=6 mm',
        '--set',
        f'{PLAY}.wear.width=10 mm',
        '--set',
        f'{PLAY}.wear.bushing=1e-7 mm^3/(N m)',
        '--cycles',
        '1e3',
        '--revolutions',
        '1',
        '--skip',
        '0',
    ),
    'modes': ('vibration_absorber',),
    'response': ('half_car', '--torque', 'body', '--frequencies', '1 Hz:9 Hz:3'),
    'analyze --fit restitution': ('{}/run.mcap', '--rounds', '16', '--workers', '1'),
    'export': ('four_bar_nominal', '--format', 'urdf', '-o', '{}/machine.urdf'),
}

# the good end of one is in test_experiment.py; the others want somebody who looks on
ONLY_BAD = {'edit', 'thesis experiment', 'view'}

BAD = {
    **dict.fromkeys((*GOOD, *ONLY_BAD), ('no_such_thing',)),
    'scenes': ('--no-such-option',),
    'new': ('{}/new', '--from', 'no_such_thing'),
    'bag info': ('{}/broken.mcap', '--no-such-option'),
    'analyze': ('{}/run.mcap', '--skip', '-1'),
    'solve': (LOOSE, '--set', 'drive.speed=.nan'),
    'analyze --fit restitution': ('{}/broken.mcap', '--fit', 'x'),
    'find --teeth': ('-1',),
}


def test_every_command_is_tried():
    commands = set(make_parser().leaves()) - {'node'}  # which has no --json
    tried = {name.partition(' -')[0] for name in GOOD}  # some by several of their options
    assert not commands - tried - ONLY_BAD, 'add these to GOOD, with arguments'
    assert commands == tried | ONLY_BAD
    assert set(GOOD) | ONLY_BAD == set(BAD)


def run(capsys, files, name, args):
    with pytest.raises(SystemExit) as ended:
        main([*(str(a).format(files) for a in (*name.split(), *args)), '--json'])
    return ended.value.code, capsys.readouterr()


@pytest.mark.network
@pytest.mark.sample(5)
@pytest.mark.parametrize('name', sorted(GOOD))
def test_results_are_strict_json(capsys, files, name):
    code, said = run(capsys, files, name, GOOD[name])
    assert code == 0, said.err
    strict(said.out)


@pytest.mark.network
@pytest.mark.parametrize('name', sorted(BAD))
def test_refusals_are_strict_json(capsys, files, name):
    code, said = run(capsys, files, name, BAD[name])
    assert code == 2, said.err
    found = strict(said.out)
    assert found['code'] == 2
    assert said.err == f'mechanism-sim: {found["error"]}\n'


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('program', 'good'),
    [
        (benchmarks, ()),
        pytest.param(hard, ('critical_damping', 'free_shaft'), marks=pytest.mark.slow),
        (grid, ('--only', 'slot_001,geneva_001', '--workers', '1')),
    ],
)
def test_other_programs_print_strict_json(capsys, program, good):
    def said(*args):
        with pytest.raises(SystemExit) as ended:
            program([*args, '--json'])
        return ended.value.code, capsys.readouterr()

    code, found = said(*good)
    assert code == 0, found.err
    assert strict(found.out)
    code, found = said('--no-such-option')
    assert (code, strict(found.out)['code']) == (2, 2)


def test_what_numpy_computes_is_written():
    @dataclass
    class Outcome:
        ok: object
        figure: object

    data = [Outcome(np.bool_(True), np.float64(0.5)), {'n': np.int64(3), 'x': np.eye(2)}]
    found = strict(strict_json.dumps(data))
    assert found == [{'ok': True, 'figure': 0.5}, {'n': 3, 'x': [[1.0, 0.0], [0.0, 1.0]]}]


@pytest.mark.parametrize('bad', [float('nan'), np.float64('inf'), np.array([1.0, -np.inf])])
def test_what_is_not_finite_is_no_result(bad):
    with pytest.raises(RunError, match=r'not finite: final\.rocker.* is '):
        strict_json.dumps({'final': {'rocker': bad}})


@pytest.mark.parametrize('text', ['NaN', '[Infinity]', '1e999', '[' * 100_000, '{'])
def test_what_is_not_json_is_not_read(text):
    with pytest.raises(ValueError, match=r'number|deep|Expecting'):
        strict_json.loads(text)


def test_a_snapshot_with_another_digit_is_refused(tmp_path, capsys):
    file = tmp_path / 'end.json'
    with pytest.raises(SystemExit) as ended:
        main(['solve', LOOSE, *SHORT, '--save', str(file)])
    assert ended.value.code == 0
    file.write_text(file.read_text().replace('0x1.', '0x1.1', 1))
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main(['solve', LOOSE, '--duration', '0.04', '--resume', str(file), '--json'])
    said = capsys.readouterr()
    assert ended.value.code == 2
    assert 'it was damaged or changed' in strict(said.out)['error']
