"""Tables that a scene reads from files beside it: what is read, and what is refused at once."""

from __future__ import annotations

import math
import os
import re
import subprocess

import numpy as np
import pytest
import yaml
from running import TIMEOUT, command

from mechanism_sim import documents, simulate
from mechanism_sim.catalogue import TABLE_FOLDERS
from mechanism_sim.cli import main
from mechanism_sim.csv_tables import LARGEST, MOST
from mechanism_sim.errors import InputError
from mechanism_sim.scene import load_scene

SCENE = {
    'title': 'An arm',
    'mechanism': 'linkage',
    'links': {'ground': {}, 'arm': {'length': '1 m', 'mass': '1 kg', 'inertia': '1 kg m^2'}},
    'joints': {'pivot': {'revolute': ['ground', 'arm']}},
    'drive': {'coordinate': 'arm', 'speed': '60 rpm'},
    'tables': {'load': {'file': 'load.csv'}},
}
GOOD = 'angle [deg],force [N]\n0,1\n360,2\n'


@pytest.fixture
def scene(tmp_path):
    """Writes a scene that names a file, and gives its path."""
    folder = tmp_path / 'scene'
    folder.mkdir()

    def write(name='load.csv', text=GOOD, **more):
        if text is not None:
            (folder / 'load.csv').write_bytes(text if isinstance(text, bytes) else text.encode())
        content = {**SCENE, 'tables': {'load': {'file': name, **more}}}
        (folder / 's.yaml').write_text(yaml.safe_dump(content))
        return folder / 's.yaml'

    return write


def refusal(scene):
    with pytest.raises(InputError) as error:
        load_scene(str(scene))
    assert '\n' not in str(error.value)
    return str(error.value)


def test_a_table_below_the_folder_of_the_scene_is_read(scene):
    file = scene()
    (file.parent / 'deeper').mkdir()
    (file.parent / 'deeper' / 'load.csv').write_text(GOOD)
    for name in ('load.csv', 'deeper/load.csv', 'deeper/../load.csv'):
        curve = load_scene(str(scene(name))).scene.tables['load'].curve
        assert curve is not None
    for name in (str(file.parent / 'load.csv'),):
        assert load_scene(str(scene(name))).scene.tables


@pytest.mark.parametrize('name', ['/dev/zero', '/dev/stdin', '/proc/self/environ', '/etc/passwd',
                                  '../load.csv', 'link.csv', '/dev/fd/0'])  # fmt: skip
def test_a_table_elsewhere_is_refused(name, scene, tmp_path):
    file = scene(name)
    (tmp_path / 'load.csv').write_text(GOOD)
    (file.parent / 'link.csv').symlink_to(tmp_path / 'load.csv')
    assert 'lies outside the folder of the scene' in refusal(file)


def test_a_folder_of_tables_can_be_allowed(scene, tmp_path, monkeypatch, capsys):
    """By an option, which reaches the processes of a command, or by the environment."""
    monkeypatch.setenv(TABLE_FOLDERS, '')
    (tmp_path / 'data').mkdir()
    (tmp_path / 'data' / 'x.csv').write_text(GOOD)
    file = scene('../data/x.csv')
    with pytest.raises(SystemExit) as ended:
        main(['check', str(file)])
    assert ended.value.code == 2
    assert '--tables-from' in capsys.readouterr().err
    with pytest.raises(SystemExit) as ended:
        main(['check', str(file), '--tables-from', str(tmp_path / 'data')])
    assert ended.value.code == 0
    with pytest.raises(SystemExit) as ended:
        main(['check', str(file), '--tables-from', str(tmp_path / 'date')])
    assert ended.value.code == 2
    assert 'there is no folder' in capsys.readouterr().err
    monkeypatch.setenv(TABLE_FOLDERS, f'/nowhere{os.pathsep}{tmp_path / "data"}')
    assert load_scene(str(file)).scene.tables
    monkeypatch.setenv(TABLE_FOLDERS, '/')
    assert 'not a regular file' in refusal(scene('/dev/zero'))


def test_a_table_is_looked_for_in_all_folders_that_of_the_scene_first(
    scene, tmp_path, monkeypatch
):
    """What a scene names by a path that leads out of a folder is not found in others."""
    (tmp_path / 'data').mkdir()
    monkeypatch.setenv(TABLE_FOLDERS, f'{tmp_path / "none"}{os.pathsep}{tmp_path / "data"}')
    file = scene(text=None)
    for folder in (file.parent, tmp_path / 'none', tmp_path / 'data'):
        assert f"'{folder}'" in refusal(file)  # it says where it looked
    (tmp_path / 'data' / 'load.csv').write_text(GOOD)
    assert load_scene(str(file)).scene.tables['load'].points[-1][1].value == 2.0
    scene(text=GOOD.replace(',2', ',3'))
    assert load_scene(str(file)).scene.tables['load'].points[-1][1].value == 3.0
    (tmp_path / 'load.csv').write_text(GOOD)
    assert 'lies outside the folder of the scene' in refusal(scene('../load.csv'))


def test_what_has_no_end_or_no_beginning_is_refused_at_once(scene):
    """In a process of its own: it would hang, or grow until nothing is left."""
    file = scene(text=None)
    os.mkfifo(file.parent / 'load.csv')
    assert 'not a regular file' in refusal(file)
    os.mkfifo(file.parent / 'pipe.yaml')
    with pytest.raises(OSError, match='not a regular file'):
        documents.bytes_of(file.parent / 'pipe.yaml', 10)
    done = subprocess.run(
        command('check', str(scene('/dev/zero', text=None)), '--tables-from', '/dev'),
        capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert 'not a regular file' in done.stderr


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        (b'x' * (LARGEST + 1), f'is larger than {LARGEST} bytes'),
        (b'a,b\n' + b'1,2\n' * (MOST + 1), f'allowed are {MOST}; take every 2th'),
        (b'', 'is empty'),
        (b'\xff\xfe\x00', 'not comma-separated text'),
        (b'PK\x03\x04\x14\x00\x08\x81\xff', 'or write it by a command with -o NAME.csv'),
        (b'a,b\n1,\x00\n', "'load.csv'"),
        (b'a,b\n1\n', 'line 2: expected a finite number'),
        (b'a,b\nx,1\n', 'line 2: expected a finite number'),
        (b'a,b\nnan,1\n1,2\n', 'line 2: expected a finite'),
        (b'a,b\n1e999,1\n1,2\n', 'line 2: expected a finite'),
        (b'"' * 200_000, "'load.csv'"),
        (b'a\n1\n', 'columns must be a list of two names'),
        (b'a [N],a [m]\n1,2\n2,3\n', "several columns 'a'"),
        (b'a [blub],b\n1,2\n2,3\n', 'blub'),
    ],
    ids=range(14),
)
def test_a_bad_table_is_a_sentence(text, said, scene):
    assert said in refusal(scene(text=text))


@pytest.mark.parametrize('columns', ['a', ['a'], ['a', 1], ['a', ['b']], {'a': 'b'}, [None, 'a']])
def test_columns_that_are_none_are_a_sentence(columns, scene):
    assert "'load.csv'" in refusal(scene(text='a [deg],b\n1,2\n2,3\n', columns=columns))


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'utf-16', 'cp1252'])
def test_a_table_is_read_as_spreadsheets_encode_it(encoding, scene):
    file = scene(text='Winkel [°];Kraft [N]\n0;1\n180;2\n360;1\n'.encode(encoding))
    assert load_scene(str(file)).scene.tables['load'].curve(np.array([math.pi])) == pytest.approx(
        2.0
    )


def test_units_that_contradict_those_of_the_file_are_refused(scene):
    for units in (['degree', 'N'], ['', 'N']):
        curve = load_scene(str(scene(units=units))).scene.tables['load'].curve
        assert curve(np.array([math.pi])) == pytest.approx(1.5)
    assert "column 'force' in 'N', and units in 'kN'" in refusal(scene(units=['deg', 'kN']))
    file = scene()
    named = file.read_text().replace('load:', 'points:').replace('load(', 'points(')
    file.write_text(named)
    assert load_scene(str(file)).scene.tables['points']
    content = SCENE | {'tables': {'load': {'points': {'file': 'load.csv'}}}}
    with pytest.raises(InputError, match="in place of 'points'"):
        load_scene(content)


POINTS = [['0 deg', '3 N'], ['360 deg', '3 N']]


@pytest.mark.parametrize(
    'override',
    [
        {'tables.load.file': 'other.csv'},
        {'tables.load': {'file': 'other.csv'}},
        {'tables.load': {'points': POINTS}},
        {'tables.load.points': POINTS},
    ],
)
def test_a_file_that_an_override_replaces_is_not_read(override, scene):
    file = scene('missing.csv')
    (file.parent / 'other.csv').write_text(GOOD.replace(',2', ',3').replace(',1', ',3'))
    with pytest.raises(InputError, match=r'missing\.csv'):
        load_scene(str(file))
    assert load_scene(str(file), override).scene.tables['load'].curve(
        np.array([1.0])
    ) == pytest.approx(3.0)


def test_a_table_as_we_write_it_is_read_again(scene):
    """A heading that a spreadsheet would compute is marked, and read without its mark."""
    assert load_scene(str(scene(text="'=a [deg],b [N]\n0,1\n360,2\n", columns=['=a', 'b'])))


def curve_of(file):
    return load_scene(str(file)).scene.tables['load'].curve


def test_units_may_be_behind_names_of_columns(scene, capsys):
    """As ``time_ms`` is read; what the scene says goes before it."""
    text = 'angle_deg,force_kN\n0,0\n180,1.5\n360,0\n'
    assert curve_of(scene(text=text, periodic=True))(np.array([math.pi])) == pytest.approx(1500.0)
    assert curve_of(scene(text=text, units=['rad', 'N']))(np.array([180.0])) == pytest.approx(1.5)
    motor = {'coordinate': 'arm', 'motor': {'curve': {'file': 'load.csv'}}}
    file = scene(text='rpm,torque_Nm\n0,12\n1500,0\n')
    content = yaml.safe_load(file.read_text()) | {'tables': {}, 'drive': motor}
    file.write_text(yaml.safe_dump(content))
    (_, (last, _)) = load_scene(str(file)).scene.drive.motor.curve.points
    assert last.value == pytest.approx(50.0 * math.pi)
    assert not capsys.readouterr().err


def test_a_table_may_be_called_as_a_part_of_a_machine(scene, capsys):
    file = scene(text='angle_deg,torque_Nm\n0,0\n90,1\n360,0\n', periodic=True)
    content = yaml.safe_load(file.read_text())
    for name in ('motor', 'drive'):
        file.write_text(yaml.safe_dump(content | {'tables': {name: content['tables']['load']}}))
        curve = load_scene(str(file)).scene.tables[name].curve
        assert curve(np.array([0.5 * math.pi])) == pytest.approx(1.0)
    assert not capsys.readouterr().err


def test_places_without_a_unit_are_told(scene, capsys):
    assert curve_of(scene(text='angle,force\n0,0\n1,1.5\n2,0\n'))
    said = capsys.readouterr().err
    assert said.endswith("column 'angle' has no unit: it is read in SI units, an angle in rad\n")
    assert said.count('\n') == 1  # of forces nobody asks: they are in N


@pytest.mark.parametrize(
    ('heading', 'value'), [('p_bar', 2e5), ('p_MPa', 2e6), ('x_mm', 2e-3), ('force_N', 2.0)]
)
def test_values_have_the_unit_behind_their_name(scene, capsys, heading, value):
    """In it they are in formulas; gas(t)*0.005 of a heading p_bar gave 0.02 N for 2000 N."""
    file = scene(text=f'angle_deg,{heading}\n0,2\n360,2\n')
    assert curve_of(file)(np.array([1.0])) == pytest.approx(value)
    assert not capsys.readouterr().err


@pytest.mark.parametrize('heading', ['p_psi', 'p_in', 'p_N_mm2', 'F_A'])
def test_values_that_are_plain_beside_what_may_be_a_unit_are_told(scene, capsys, heading):
    text = f'angle_deg,{heading}\n0,2\n360,2\n'
    assert curve_of(scene(text=text, units=['deg', 'kN']))(np.array([1.0])) == pytest.approx(
        2000.0
    )
    assert not capsys.readouterr().err
    assert curve_of(scene(text=text))(np.array([1.0])) == pytest.approx(2.0)
    said = f"column '{heading}' ends with no unit that is read: it is read as plain numbers"
    assert said in capsys.readouterr().err


def test_places_that_are_evidently_degrees_are_no_radians(scene):
    file = scene(text='angle,force\n0,0\n180,1500\n360,0\n')
    bare = yaml.safe_load(file.read_text())
    said = "reads the places of tables.load, 0 to 360 without a unit, in rad: write '360 deg'"
    push = {'loads': {'push': {'at': 'arm.end', 'torque': 'load(arm) * 1'}}}
    file.write_text(yaml.safe_dump(bare | push))
    assert said in refusal(file)
    for right in ('load(arm*180/pi)', 'load(57.3*arm)', 'load(t)', 'load(arm_rate)'):
        push['loads']['push']['torque'] = right
        file.write_text(yaml.safe_dump(bare | push))
        assert load_scene(str(file))


@pytest.mark.parametrize(
    ('heading', 'value'), [('p [bar]', '55'), ('p [MPa]', '5.5'), ('p [N/cm^2]', '550')]
)
def test_pressures_of_an_indicator_diagram_act_by_an_area(scene, heading, value):
    loads = {'gas': {'at': 'arm.end', 'force': [0, 'load(arm)*2 cm^2 - 100 N']}}
    path = scene(text=f'angle [deg],{heading}\n0,{value}\n360,{value}\n', periodic=True)
    run = simulate(load_scene(str(path), {'loads': loads}), revolutions=0.25)
    torque = run.sample(0.0, 'drive_torque')['drive_torque'][0]
    assert torque == pytest.approx(-1000.0 * 1.0, rel=1e-9)  # 5.5 MPa on 2 cm^2, less 100 N


@pytest.mark.parametrize(
    ('force', 'words'),
    [
        ('load(arm)*2e-4', 'is in Pa, not in N'),
        ('(load(arm) - 1)*2 cm^2', 'has no unit beside what is in Pa'),
    ],
)
def test_pressures_want_units_beside_them(scene, force, words):
    path = scene(text='angle [deg],p [bar]\n0,1\n360,1\n')
    loads = {'gas': {'at': 'arm.end', 'force': [0, force]}}
    with pytest.raises(InputError, match=re.escape(words)):
        load_scene(str(path), {'loads': loads}).plan  # noqa: B018


def test_a_unit_that_is_none_is_told_by_its_column(scene):
    said = refusal(scene(text='angle [deg],p [furlong]\n0,1\n360,1\n'))
    assert "'load.csv': column 'p': 'furlong' is not" in said
    assert 'points.0' not in said


@pytest.mark.parametrize(('unit', 'turn'), [('rad or m', 2.0 * math.pi), ('deg', 360.0)])
def test_positions_that_jump_by_a_turn_go_on(tmp_path, unit, turn):
    """As encoders and joint states have them; a step that may be meant stays."""
    angles = np.arange(40) * 0.03 * turn
    wrapped = (angles + 0.5 * turn) % turn - 0.5 * turn
    lines = [f'{0.01 * k:.9g},{x!r}' for k, x in enumerate(wrapped.tolist())]
    way = tmp_path / 'way.csv'
    way.write_text('\n'.join([f't [s],position.arm [{unit}]', *lines]))
    position = {'file': 'way.csv', 'interpolation': 'cubic'}
    content = {**SCENE, 'tables': {}, 'drive': {'coordinate': 'arm', 'position': position}}
    (tmp_path / 's.yaml').write_text(yaml.safe_dump(content))
    points = load_scene(str(tmp_path / 's.yaml')).scene.drive.position.points
    found = np.array([x.value for _, x in points])
    assert found == pytest.approx(angles * 2.0 * math.pi / turn, abs=1e-12)
    way.write_text(f't [s],x [{unit}]\n0,0\n1,{2.0 * turn}\n2,{2.1 * turn}\n3,0\n')
    points = load_scene(str(tmp_path / 's.yaml')).scene.drive.position.points
    assert points[1][1].value == pytest.approx(4.0 * math.pi)


@pytest.mark.parametrize('heading', ['angle [deg]', 'angle_deg'])
def test_a_cam_table_is_no_law_over_time(tmp_path, heading):
    """A turn of 360 deg was one of 360 s."""
    (tmp_path / 'cam.csv').write_text(f'{heading},lift [mm]\n0,0\n120,5\n240,3\n360,0\n')
    content = {
        **SCENE,
        'tables': {},
        'drive': {'coordinate': 'arm', 'position': {'file': 'cam.csv'}},
    }
    (tmp_path / 's.yaml').write_text(yaml.safe_dump(content))
    with pytest.raises(
        InputError, match=r"column 'angle.*' is an angle, .* a joint 'cam' with law"
    ):
        load_scene(str(tmp_path / 's.yaml'))


def test_files_of_overrides_are_in_the_current_folder_too(tmp_path, monkeypatch):
    """Those of the package's scenes had to lie in its own folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'speed.csv').write_text('t [s],speed [rpm]\n0,300\n1,300\n')
    given = {'drive.speed': {'file': 'speed.csv'}}
    slow = load_scene('slider_crank', given).drive.start[1]
    assert slow == pytest.approx(10.0 * math.pi)
    assert load_scene('slider_crank', 'drive.speed={file: speed.csv}').drive.start[1] == slow
    scenes = tmp_path / 'scenes'
    scenes.mkdir()
    (scenes / 'own.yaml').write_text(load_scene('slider_crank').scene.to_yaml())
    (scenes / 'speed.csv').write_text('t [s],speed [rpm]\n0,600\n1,600\n')
    fast = load_scene('scenes/own.yaml', given).drive.start[1]  # that of the scene comes first
    assert fast == pytest.approx(20.0 * math.pi)
    for name, said in (
        ('no.csv', f"there is none in '{scenes}' nor in '{tmp_path}'; put it there, or say in"),
        ('/etc/passwd', 'lies outside the folder of the scene'),
    ):
        with pytest.raises(InputError, match=re.escape(said)):
            load_scene('scenes/own.yaml', {'drive.speed': {'file': name}})


@pytest.mark.parametrize('key', ['torque', 'force', 'effort'])
def test_a_file_of_forces_is_a_table(key, tmp_path, monkeypatch):
    """It was read as one of speeds."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'load.csv').write_text('t [s],M [Nm]\n0,2\n1,2\n')
    with pytest.raises(InputError, match=rf"a {key} has no points: enter the file in 'tables'"):
        load_scene('slider_crank', {'drive': {'speed': 1.0, key: {'file': 'load.csv'}}})
    tables = {'tables': {'load': {'file': 'load.csv'}}}
    drive = {'coordinate': 'crank', 'torque': 'load(t)'}
    assert load_scene('slider_crank', {**tables, 'drive': drive}).plan.main == 'crank'


def test_a_file_of_one_column_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.savez(tmp_path / 'speed.npz', speed=[1.0, 2.0], fs=1000.0)
    with pytest.raises(InputError, match='has one column, speed, where columns must be a list'):
        load_scene('slider_crank', {'drive.speed': {'file': 'speed.npz'}})
