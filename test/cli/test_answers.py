"""Answers of the command line: times with units, endings, ports, suggestions, logs."""

from __future__ import annotations

import itertools
import re
import socket

import pytest
from running import run, run_json

from mechanism_sim import tables
from mechanism_sim.analysis.measure import measure
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError
from mechanism_sim.pages.server import HOST, PORT, Server
from mechanism_sim.report import progress
from mechanism_sim.results.measure_text import read_all
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import load_scene


@pytest.mark.sample(2)
@pytest.mark.parametrize('command', ['solve', 'cycle', 'report', 'statistics'])
def test_durations_have_units(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = 'slider_crank' if command != 'statistics' else 'four_bar_clearance'
    length = {'statistics': '8 s'}.get(command, '100 ms')
    asked = command, scene, '--duration', length
    assert run(*asked).returncode == 0
    refused = run(*asked[:-1], '20 mm')
    assert refused.returncode == 2
    assert "'20 mm' has the unit 'mm', which is not a unit of 's'" in refused.stderr
    assert refused.stderr.count('\n') == 1


@pytest.mark.parametrize('value', ['5 kg', 'nan', 'inf', '1_0'])
@pytest.mark.parametrize(
    'command',
    [
        ('bag', 'play', 'run.mcap', '--from'),
        ('bag', 'play', 'run.mcap', '--delay'),
        ('animate', 'slider_crank', '--fps'),
        ('solve', 'slider_crank', '--duration'),
    ],
)
def test_times_and_rates_are_read_alike(command, value, capsys):
    """They have units or none, and are finite numbers: it is said of which option."""
    with pytest.raises(SystemExit) as end:
        main([*command, value])
    assert end.value.code == 2
    assert f"{command[-1]}: '{value}' " in capsys.readouterr().err


def test_a_bag_is_played_from_a_time_with_its_unit_on(capsys):
    """It is looked for only after its options are read."""
    with pytest.raises(SystemExit) as end:
        main(['bag', 'play', 'none.mcap', '--from', '50 ms', '--delay', '1 ms'])
    assert end.value.code == 2
    assert 'none.mcap does not exist' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('name', 'hint'),
    [
        ('runn.mcap', "; did you mean 'run.mcap'?"),
        ('run', "; did you mean 'run.mcap'?"),
        ('rig.csv', "; did you mean 'rig.xlsx'?"),
        ('other.mcap', ''),
        ('folder.wav', ''),
    ],
)
def test_a_file_that_is_not_there_is_told_with_the_nearest(name, hint, tmp_path, capsys):
    for there in ('run.mcap', 'rig.xlsx', 'runn.txt'):
        (tmp_path / there).touch()
    (tmp_path / 'folder.csv').mkdir()
    with pytest.raises(SystemExit) as end:
        main(['analyze', str(tmp_path / name)])
    assert end.value.code == 2
    hint = hint.replace("'r", f"'{tmp_path}/r") if name in ('run', 'rig.csv') else hint
    said = f'mechanism-sim: {tmp_path / name} does not exist{hint}\n'
    assert capsys.readouterr().err == said


def test_help_of_plots_names_every_table_they_can_be(capsys):
    with pytest.raises(SystemExit):
        main(['plot', '--help'])
    text = capsys.readouterr().out.partition('--output')[2].partition('--against')[0]
    assert all(ending in text for ending in (*tables.ENDINGS, '.svg', '.png', '.pdf'))


def test_a_time_with_a_unit_is_that_number_of_seconds():
    one, two = (run_json('solve', 'slider_crank', '--duration', x) for x in ('0.05', '50 ms'))
    assert one['digest'] == two['digest']


def test_derivatives_of_measures_go_by_their_names():
    """Also if two of them are of one text."""
    text = 'range(position.piston)'
    asked = 'solve', 'slider_crank', '--revolutions', '1', '--set', f'measures.stroke={text}'
    told = run_json(*asked, '--derivatives', 'links.crank.length', '--measure', text)
    found = told['derivatives']['links.crank.length']['measures']
    assert [*found] == [*told['measures']] == ['stroke', text]
    assert found['stroke'] == found[text] == pytest.approx(2.0)
    scene = load_scene('slider_crank', {'measures': {'a': text, 'b': text}})
    solution = simulate(scene, revolutions=1, derivatives='links.crank.length')
    one, two = (m.derivatives for m in measure(solution))
    assert one == two == pytest.approx({'links.crank.length': 2.0})


def test_a_force_that_is_nothing_has_no_sign():
    told = run('solve', 'gear_rattle', '--revolutions', '3').stdout
    assert re.search(r'^  wheel_shaft +0 N +0 N$', told, re.MULTILINE)
    assert ' -0 ' not in told


def test_what_rounding_leaves_of_zero_is_shown_as_zero():
    """A Geneva wheel that rests carries nothing; JSON has what is computed."""
    free = 'drive={coordinate: crank, torque: {constant: 1}, speed: 120 rpm, start_angle: 180 deg}'
    asked = 'solve', 'geneva', '--duration', '0.5', '--set', free, '--set', 'gravity=[0, 0]'
    told = run(*asked).stdout.partition('at the end')[2]
    assert re.search(r'^  ground_crank +0 N +0 N$', told, re.MULTILINE)
    assert not re.search(r'e-[2-9]\d', told)
    reactions = run_json(*asked)['final']['reactions'].values()
    assert any(0.0 < abs(x) < 1e-20 for force in reactions for x in force)


def test_all_endings_are_told(tmp_path):
    done = run('plot', 'slider_crank', 'drive_torque', '-o', str(tmp_path / 'a.jpg'))
    assert done.returncode == 2
    for ending in ('.png', '.svg', '.pdf', '.csv', '.npz', '.parquet'):
        assert ending in done.stderr


@pytest.mark.parametrize(
    ('text', 'name'),
    [('maxx(drive_torque)', 'max'), ('maxx(drive_torque, from 1 s)', 'max'),
     ('largst(reaction.pin)', 'largest'), ('averag(drive_torque)', 'average')],
)  # fmt: skip
def test_what_is_suggested_is_accepted(text, name):
    with pytest.raises(InputError, match=f"did you mean '{name}'"):
        read_all([text], 'x')
    wrong = text.partition('(')[0]
    assert read_all([text.replace(wrong, name, 1)], 'x')


def test_a_port_that_is_in_use_is_told_alike(monkeypatch, capsys):
    """One that was asked for is refused; in place of the usual one another is chosen, and said."""
    taken = socket.create_server((HOST, 0))
    port = taken.getsockname()[1]
    for name in ('edit', 'view'):
        with pytest.raises(InputError) as refused:
            Server({}, port, list, print, name=name)
        said = f'{name}: port {port} of {HOST} is taken: choose another; 0 is any free'
        assert str(refused.value) == said
    monkeypatch.setattr('mechanism_sim.pages.server.PORT', port)
    server = Server({}, None, list, print)
    server.close()
    assert server.port not in (port, 0)
    assert f'port {port} is taken: another was chosen' in capsys.readouterr().err
    taken.close()
    assert PORT == 8080


def test_logs_have_a_line_now_and_then_and_no_carriage_returns(monkeypatch, capsys):
    times = itertools.count(0.0, 7.0)
    monkeypatch.setattr('time.monotonic', lambda: next(times))
    with progress.count('sweep', 20, quiet=False) as show:
        for k in range(20):
            show(k + 1, int(k > 9))
    said = capsys.readouterr().err
    lines = said.splitlines()
    assert '\r' not in said
    assert 3 <= len(lines) <= 6
    assert lines[0] == 'sweep: 5 of 20, about 105 s left'
    assert ', 1 failed, ' in lines[-1]
    with progress.count('sweep', 20, quiet=True) as show:
        for k in range(20):
            show(k + 1, 0)
    assert capsys.readouterr().err == ''
