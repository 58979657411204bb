"""Refusals of imports in one sentence."""

from __future__ import annotations

from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from running import run

from mechanism_sim.errors import InputError
from mechanism_sim.imports import import_machine
from mechanism_sim.imports.formats import READERS
from mechanism_sim.scene.files import find_scene

INPUTS = Path(__file__).parents[1] / 'cases/inputs'
URDF = '<robot name="r"><link name="a"/><link name="b"/>{}</robot>'
HINGE = (
    '<joint name="h" type="{}"><parent link="a"/><child link="{}"/><axis xyz="{}"/></joint>'
)  # fmt: skip
SDF = '<sdf version="1.9"><model name="m"><link name="a">{}</link></model></sdf>'
MJCF = '<mujoco><worldbody><body name="a"><joint {}/></body></worldbody>{}</mujoco>'
DOCTYPE = """<?xml version="1.0" encoding="utf-8" standalone="no"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN"
  "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd">
"""
BOMB = '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>' + URDF.format('')


@pytest.mark.parametrize(
    ('name', 'text', 'words'),
    [
        ('m.step', '', '.step is not a format that can be imported'),
        ('m.csv', '', 'cannot be read: it is empty'),
        ('m.csv', 'name,a,b\n', 'there is no column x, y, links'),
        ('m.csv', 'joint,x,y,links\nA,0,0,ab\n', "the unit is missing: write 'X [mm]'"),
        ('m.csv', 'joint,x [mm],y,links\nA,0,o,ab\n', "a finite number in column 'y', got 'o'"),
        ('m.csv', 'joint,x [mm],y,links\nA,0,0,ab\nA,1,0,ab cd\n', 'have the name A'),
        ('m.csv', 'joint,x [mm],y,links\nA,0,0,ab\nB,1,0,ab\n', 'no joint connects two links'),
        ('m.csv', 'joint,x [mm],y,links,type\nA,0,0,ab cd,Q\n', "joint A is of type 'Q', not R"),
        ('m.csv', 'joint,x [paces],y,links\nA,0,0,ground b\nB,1,1,b c\n', 'paces'),
        ('m.csv', 'joint,x [mm],y,links\nA,1e999,0,a b\n', "in column 'x', got '1e999'"),
        ('m.json', '{"joints": [', 'does not match its ending'),
        ('m.csv', 'joint,x [mm],y [paces],links\nA,0,0,ab\n', "column y has the unknown unit"),
        ('m.json', '[1, 2]', 'm.json has no joints and links, as mechanisms of pylinkage have'),
        ('m.json', '{"name": "old", "joints": []}', 'write those by its mechanism_to_json'),
        ('m.json', '[' * 100000, 'does not match its ending'),
        ('m.json', '{"joints": [{"name": "A"}], "links": []}', "KeyError: 'id'"),
        ('m.urdf', '<robot', 'm.urdf is not XML'),
        ('m.urdf', '<sdf/>', 'begins with <sdf>, not with <robot>'),
        ('m.urdf', BOMB, 'entities are not read: take them out'),
        ('m.svg', DOCTYPE + '<svg/>', 'there is no closed curve in the drawing'),
        ('m.svg', DOCTYPE + '<svg>&a;</svg>', 'm.svg is not XML (ParseError: undefined entity'),
        ('m.urdf', URDF.format(''), 'there must be one link that no joint carries'),
        ('m.urdf', URDF.format(HINGE.format('ball', 'b', '0 0 1')), 'joints of type ball are not'),
        ('m.urdf', URDF.format(HINGE.format('revolute', 'c', '0 0 1')), 'there must be one link'),
        ('m.urdf', URDF.format(HINGE.format('revolute', 'b', '0 0')), "'0 0' are not 3 finite"),
        ('m.urdf', URDF.format(HINGE.format('revolute', 'b', '0 1 1')), 'only planar machines'),
        ('m.urdf', URDF.format(HINGE.format('fixed', 'b', '0 0 1')), 'there is no revolute joint'),
        ('m.sdf', '<sdf/>', 'm.sdf has 0 models: it must be one'),
        ('m.sdf', SDF.format('<pose relative_to="f"/>'), "'f': there is no such frame"),
        ('m.sdf', SDF.format('<pose relative_to="a"/>'), "'a': its pose relates to itself"),
        ('m.xml', '<mujoco/>', 'the file has no worldbody'),
        ('m.xml', MJCF.format('type="ball"', ''), 'joints of type ball are not planar'),
        ('m.xml', MJCF.format('axis="1 0 z"', ''), "'1 0 z' are not numbers"),
        ('m.xml', MJCF.format('/><geom size="1" axisangle="0 0 0 1"', ''), 'has no direction'),
        ('m.xml', MJCF.format('/><geom size="1" xyaxes="1 0 0 2 0 0"', ''), 'not two directions'),
        ('m.xml', MJCF.format('class="c"', ''), "there is no default class 'c'"),
        ('m.xml', MJCF.format('/><geom type="box"', ''), 'a: a shape of type box has no size'),
        ('m.svg', '<svg/>', 'there is no closed curve in the drawing'),
        ('m.svg', '<svg><path d="M 0 0 L 1"/></svg>', 'ends within a command'),
        (
            'm.svg',
            '<svg><g transform="skewZ(3)"/></svg>',
            "'skewZ(3)' is not a supported transformation",
        ),
        ('m.dxf', 'nonsense', 'cannot be read as DXF'),
    ],
)  # fmt: skip
def test_what_cannot_be_imported_is_said(tmp_path, name, text, words):
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(InputError) as raised:
        import_machine(file)
    assert words in str(raised.value)
    assert '\n' not in str(raised.value)


@pytest.mark.parametrize('address', [
    'https://app.pmksplus.com/', 'https://app.pmksplus.com/?0P.TY', 'https://x.org/?j=A,1&l=',
    'https://x.org/?0P.TY.K,0.901.MA,A,0,0,0..YRAB,AB..',
])  # fmt: skip
def test_other_addresses_are_refused(address):
    with pytest.raises(InputError, match=r'not an address of a mechanism of PMKS\+|no joint'):
        import_machine(address)


def test_files_that_are_too_large_or_no_files_are_refused(tmp_path):
    with pytest.raises(InputError, match='cannot be read: No such file'):
        import_machine(tmp_path / 'none.csv')
    (tmp_path / 'folder.csv').mkdir()
    with pytest.raises(InputError, match='cannot be read: Is a directory'):
        import_machine(tmp_path / 'folder.csv')
    large = tmp_path / 'large.urdf'
    with large.open('wb') as file:
        file.truncate((1 << 24) + 1)
    with pytest.raises(InputError, match='is larger than 16777216 bytes'):
        import_machine(large)
    (tmp_path / 'bytes.csv').write_bytes(b'\xff\xfe\x00')
    with pytest.raises(InputError, match='not text in UTF-8'):
        import_machine(tmp_path / 'bytes.csv')


@pytest.mark.parametrize('ending', ['urdf', 'sdf', 'xml', 'dxf', 'csv', 'json', 'svg'])
def test_damaged_files_are_read_or_refused_in_one_sentence(tmp_path, ending):
    """Bytes changed, lost and repeated at random; nothing but a refusal comes of it."""
    original, rng, said = intact(tmp_path, ending), np.random.default_rng(45), []
    for _ in range(25):
        data = bytearray(original)
        for k in rng.integers(0, len(data) - 20, 3).tolist():
            change = rng.integers(0, 3)
            if change == 0:
                data[k] = int(rng.integers(32, 127))
            elif change == 1:
                del data[k : k + 7]
            else:
                data[k:k] = data[k : k + 9]
        file = tmp_path / f'damaged.{ending}'
        file.write_bytes(bytes(data))
        try:
            import_machine(file, thickness='5 mm' if ending in {'dxf', 'svg'} else None)
        except InputError as error:
            said.append(str(error))
    assert said
    assert not any('\n' in sentence for sentence in said)


def intact(folder, ending):
    """A good file of a format."""
    if ending in {'csv', 'json', 'svg'}:
        name = {'csv': 'joints_six_bar.csv', 'json': 'import/pylinkage_fourbar.json'}.get(ending)
        return (INPUTS / name).read_bytes() if name else SVG
    file = folder / f'intact.{ending}'
    done = run('export', 'four_bar_nominal', '-o', str(file))
    assert done.returncode == 0, done.stderr
    return file.read_bytes()


SVG = b"""<svg xmlns="http://www.w3.org/2000/svg" width="30cm" viewBox="0 0 300 200">
<g id="ground"><circle cx="50" cy="150" r="5"/></g><g id="arm"><circle cx="50" cy="150" r="4"/>
<path d="M60 150V100a10 10 0 0 0-20 0v50A10 10 0 0 0 60 150Z" transform="translate(0,1)"/></g>
<g id="dot"><polygon points="0,0 10,0 10,10"/><rect x="5" y="1" width="2" height="3"/></g></svg>"""


def test_bodies_within_bodies_have_an_end(tmp_path):
    deep = '<body>' * 2000 + '</body>' * 2000
    (tmp_path / 'm.xml').write_text(f'<mujoco><worldbody>{deep}</worldbody></mujoco>')
    with pytest.raises(InputError, match='more than 200 deep'):
        import_machine(tmp_path / 'm.xml')


def test_units_of_columns_and_of_the_option(tmp_path):
    file = tmp_path / 'm.csv'
    file.write_text('Point,X (in),Y (in),Links,Ground\nA,0,0,ground a,\nB,1,0,a b\nC,3,1,b,x\n')
    assert import_machine(file).data['links']['a']['points'] == {'B': ['1.0 in', '0.0 in']}
    assert import_machine(file, unit='inch').text == import_machine(file).text
    file.write_text(file.read_text().replace(' (in)', ''))
    assert import_machine(file, unit='mm').data['links']['a']['points'] == {
        'B': ['1.0 mm', '0.0 mm']
    }


PLATE = """<svg width="{}" viewBox="0 0 300 200"><g id="ground"><circle r="5"/></g>
<g id="arm"><circle r="5"/><circle r="4"/></g></svg>"""


def dxf(units):
    """A plate with a hole, in a unit by its number."""
    ezdxf = pytest.importorskip('ezdxf')
    document = ezdxf.new('R2010', units=units)
    for layer, radius in (('ground', 1.0), ('arm', 1.0), ('arm', 5.0)):
        document.modelspace().add_circle((0.0, 0.0), radius, dxfattribs={'layer': layer})
    stream = StringIO()
    document.write(stream)
    return stream.getvalue()


STATED = {
    'm.csv': lambda: 'Joint,X [mm],Y,Links\nA,0,0,ground a\nB,1,0,a\n',
    'y.csv': lambda: 'Joint,X,Y [mm],Links\nA,0,0,ground a\nB,1,0,a\n',
    'm.dxf': lambda: dxf(4),
    'm.svg': lambda: PLATE.format('300mm'),
}


@pytest.mark.parametrize('name', STATED)
def test_a_unit_against_that_of_the_file_is_refused(tmp_path, name):
    """It went before what the file says, without a word; lengths were ten times too large."""
    file = tmp_path / name
    file.write_text(STATED[name]())
    assert import_machine(file, unit='millimetre').data == import_machine(file).data
    with pytest.raises(InputError, match=r'states lengths in mm: --unit cm contradicts it$'):
        import_machine(file, unit='cm')
    with pytest.raises(InputError, match=r"--unit has the unknown unit 'paces'"):
        import_machine(file, unit='paces')


def test_a_unit_against_that_of_an_address_is_refused():
    address = 'https://x.org/?j=A,0,0,ground%7Ca,R,t,0%0AB,1,0,a,R,f,0&s=10,false,false,{}'
    inches = import_machine(address.format('in'), unit='inch').data
    assert inches['links']['a']['points'] == {'B': ['1.0 in', '0.0 in']}
    assert import_machine(address.format(''), unit='mm').data['links']['a'] == {
        'points': {'B': ['1.0 mm', '0.0 mm']}
    }
    with pytest.raises(InputError, match='the address states lengths in in: --unit mm contra'):
        import_machine(address.format('in'), unit='mm')


def test_a_unit_is_that_of_a_drawing_that_states_none(tmp_path):
    """A DXF without one, and an SVG in pixels or without a size: their numbers in that unit."""
    (tmp_path / 'm.dxf').write_text(dxf(0))
    (tmp_path / 'm.svg').write_text(PLATE.format('600px'))
    mass = {
        name: [float(import_machine(tmp_path / name, unit, thickness='5 mm').data['links']['arm']
                     ['mass'].split()[0]) for unit in ('mm', 'inch')]
        for name in ('m.dxf', 'm.svg')
    }  # fmt: skip
    assert mass['m.dxf'][0] == pytest.approx(24.0 * np.pi * 1e-6 * 5e-3 * 7850.0, rel=1e-12)
    assert mass['m.svg'][0] == pytest.approx(9.0 * np.pi * 1e-6 * 5e-3 * 7850.0, rel=1e-12)
    for small, large in mass.values():
        assert large == pytest.approx(25.4**2 * small, rel=1e-12)


def test_columns_of_other_units_lists_and_inputs_are_read(tmp_path):
    """A five-bar: y in inches beside x in millimetres, links in quotes, two drives."""
    file = tmp_path / 'm.csv'
    file.write_text(
        'Joint,X [mm],Y [in],Links,Ground,Input,Mass [kg]\nA,0,0,a,x,x,1\nB,0,2,"a,b",,,\n'
        'C,50,4,"b, c",,,\nD,90,2,c d,,,\nE,90,0,d,x,x,\n'
    )
    found = import_machine(file)
    assert [*found.data['links']] == ['ground', 'a', 'b', 'c', 'd']
    assert found.data['links']['a']['points'] == {'B': ['50.8 mm', '0.0 mm']}
    assert found.data['drive']['coordinate'] == 'a'
    assert [*found.data['drives']] == ['d']
    assert found.notes == ('column Mass is left out',)


@pytest.mark.parametrize('ending', ['urdf', 'sdf', 'xml'])
def test_a_unit_for_what_is_in_metres_is_refused(tmp_path, ending):
    file = tmp_path / f'm.{ending}'
    file.touch()
    with pytest.raises(InputError, match=r'is in metres.*--unit does not apply'):
        import_machine(file, unit='mm')


def test_a_mark_that_is_neither_yes_nor_no_is_named(tmp_path):
    file = tmp_path / 'm.csv'
    file.write_text('Joint,X [m],Y [m],Links,Ground\nA,0,0,a,Y\nB,1,0,a b,no\nC,3,1,b,ja\n')
    with pytest.raises(InputError, match="line 4: Ground = 'ja': yes or no"):
        import_machine(file)


def test_types_of_joints_may_be_words(tmp_path):
    file = tmp_path / 'slider.csv'
    rows = 'Joint,X [m],Y,Links,Type,Ground,Input\nA,0,0,crank,{},x,x\nB,1,0,crank rod,{},,\n'
    letters, words = (
        (file.write_text((rows + 'C,3,0,rod block,{},,\nD,3,0,block,{},x,\n').format(*kinds)),
         import_machine(file).text)[1]
        for kinds in (('R', 'R', 'R', 'P'), ('Revolute', 'pin', '', 'prismatic'))
    )  # fmt: skip
    assert words == letters


def test_a_file_without_gravity_says_so(tmp_path):
    """Masses swung as if they had no weight, without a word."""
    file = tmp_path / 'arm.urdf'
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    mass = f'<inertial><mass value="2"/>{inertia}</inertial>'
    text = URDF.format(HINGE.format('continuous', 'b', '0 0 1'))
    file.write_text(text.replace('<link name="b"/>', f'<link name="b">{mass}</link>'))
    assert mass in file.read_text()
    (said,) = [x for x in import_machine(file).notes if 'gravity' in x]
    override = {'gravity': ['0 m/s^2', '-9.81 m/s^2']}
    assert '--set' in said
    assert not any('gravity' in x for x in import_machine(file, overrides=override).notes)


LEFT_OUT = {
    'j: its limits': 'range="-1 1"',
    'j: its friction is left out': 'frictionloss="0.1"',
    'j: the inertia of its rotor': 'armature="0.5"',
}


@pytest.mark.parametrize('words', LEFT_OUT)
def test_properties_of_joints_that_are_left_out_have_a_note(tmp_path, words):
    file = tmp_path / 'm.xml'
    for given, count in ((LEFT_OUT[words], 1), ('', 0)):
        file.write_text(MJCF.format(f'name="j" {given}', ''))
        assert sum(words in note for note in import_machine(file).notes) == count


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('<include file="more.xml"/>', 'more.xml: left out: an included file'),
        ('<compiler boundmass="1"/>', 'boundmass of the compiler is left out'),
        ('<keyframe><key qvel="1"/></keyframe>', 'rates of the keyframe are left out'),
        ('<worldbody><body><geom type="mesh" mass="2"/></body></worldbody>', 'its mass of 2 kg'),
        ('<worldbody><replicate/></worldbody>', 'replicate: left out: <replicate>'),
    ],
)
def test_parts_of_an_mjcf_that_are_left_out_have_a_note(tmp_path, text, words):
    file = tmp_path / 'm.xml'
    file.write_text(MJCF.format('name="j"', text))
    assert any(words in note for note in import_machine(file).notes)


@pytest.mark.parametrize('ending', sorted({*READERS} - {'.json'}))  # YAML may be JSON
def test_a_file_of_another_program_is_no_scene_and_the_command_that_takes_it_is_named(
    tmp_path, ending
):
    file = tmp_path / f'm{ending}'
    file.write_text(MJCF.format('name="j"', ''))
    with pytest.raises(InputError, match=r'not a scene: .*mechanism-sim import'):
        find_scene(str(file))
