"""Tables in text files: as programs and people write them, and one sentence for what is none."""

from __future__ import annotations

import re

import numpy as np
import pytest
from openpyxl import Workbook

from mechanism_sim.csv_tables import LARGEST, assume, named_unit, read_csv
from mechanism_sim.errors import InputError


@pytest.fixture
def table(tmp_path):
    def read(text):
        (tmp_path / 't.csv').write_text(text, encoding='utf-8')
        return read_csv(tmp_path / 't.csv', 's.yaml: drive.position')

    return read


@pytest.mark.parametrize(
    'text',
    [
        't [s],x [mm]\n0,1\n0.5,2.25\n',
        '\ufefft (s);x (mm)\r\n0;1\r\n0.5;2.25\r\n',
        '# measured\nt [s]\tx [mm]\n0\t1\n\n0.5\t2.25\n',
        't [s], x [mm],\n0, 1,\n0.5, 2.25,\n',
        '"t [s]","x [mm]"\n0,1\n0.5,"2.25"\n',
        't [s];x [mm]\n0;1\n0,5;2,25\n',
        't [s]\tx [mm]\n0,0\t1,000\n5,0E-01\t2,25\n',
        't,x\n(s),(mm)\n\n0,1\n0.5,2.25\n',
        't;x\ns;mm\n0;1\n0,5;2,25\n',
        't (s)  x [mm]\n 0 1 \n 0.5  2.25\n',
        't x\n(s) (mm)\n0 1\n0.5 2.25\n',
        'sep=;\nt [s];x [mm]\n0;1\n0,5;2,25\n',
        '"sep=,"\n"t [s]","x [mm]"\n"0","1"\n"0.5","2.25"\n',
        't / s;x / mm\n0;1\n0,5;2,25\n',
        't / s, x / (mm)\n0,1\n0.5,2.25\n',
        '"t [s]","x [mm]"\n"0,000000","1,0"\n"0,500000","2,25"\n',
        '"t [s]","x [mm]",\n"0,000000","1,0",\n"0,500000","2,25",\n',
    ],
    ids=[
        'commas', 'semicolons', 'tabs', 'last separator', 'quotes', 'office', 'decimal commas',
        'oscilloscope', 'units below', 'spaces', 'spaces and units below', 'Excel',
        'Excel with quotes', 'slashes', 'a slash and brackets', 'decimal commas in quotes',
        'decimal commas in quotes and a last separator',
    ],
)  # fmt: skip
def test_columns_have_names_units_and_numbers(table, text):
    found = table(text)
    assert found.units == {'t': 's', 'x': 'mm'}
    assert np.array_equal(found.numbers('x', 't'), [[1.0, 0.0], [2.25, 0.5]])


PREAMBLES = {
    'LabVIEW': 'LabVIEW Measurement\nWriter_Version\t2\n***End***\n{}\n0\t1\n0.5\t2.25\n',
    'of as many cells': 'Logger\nRate\t2\nDate\t3 May\n{}\n0\t1\n0.5\t2.25\n',
    'longer lines': 'Model\tA\tB\tC\n\n{}\n0\t1\n0.5\t2.25\n',
    'decimal commas': 'Messung\n# 1\n{}\n0\t1\n0,5\t2,25\n',
}


@pytest.mark.parametrize('headings', ['t [s]\tx [mm]', 't\tx\ns\tmm', 't\tx\n(s)\t(mm)'])
@pytest.mark.parametrize('name', PREAMBLES)
def test_headings_may_stand_below_lines_of_an_instrument(table, capsys, name, headings):
    if name == 'of as many cells' and '\n' in headings:
        return  # which are the headings cannot be told: below
    assume.cache_clear()  # it is said once
    text = PREAMBLES[name].format(headings)
    found = table(text)
    assert found.units == {'t': 's', 'x': 'mm'}
    assert np.array_equal(found.numbers('t', 'x'), [[0.0, 1.0], [0.5, 2.25]])
    first = headings.partition('\n')[0]
    number = text.splitlines().index(first) + 1
    said = f"'t.csv': line {number} is taken for its headings: {first!r}"
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    'text',
    [
        'Model,TDS\nRecord Length,1000\nTIME,CH1\n0,1\n0.5,2\n',
        'Logger\nRate,2\nt,x\n(s),(mm)\n0,1\n0.5,2\n',
        'Logger\n0,1\n0.5,2\n',
        't,x\n0,1\n1,err\n2,3\n3,4\n',
    ],
    ids=['key and value', 'three lines', 'no headings', 'a word among numbers'],
)
def test_headings_that_cannot_be_told_are_not_guessed(table, capsys, text):
    assume.cache_clear()
    with pytest.raises(InputError):
        table(text).numbers('t', 'x')
    assert 'is taken for' not in capsys.readouterr().err


def test_three_decimals_of_every_number_are_no_thousands(table, capsys):
    """Which is said, as it may be wrong: beside semicolons, where most are not round."""
    found = table('x [mm];y [mm];of\n90,000;80,123;a\n-87,588;85,130;b\n;1,250;c\n1,3;\n')
    assert found.numbers('y', gaps=True)[2, 0] == 1.25
    assert not capsys.readouterr().err  # 1,3 is no thousand
    for _ in range(2):
        found = table('x [mm];y [mm];of\n90,000;80,123;a\n-87,588;85,130;b\n')
        assert found.numbers('x', 'y').tolist() == [[90.0, 80.123], [-87.588, 85.13]]
    assert capsys.readouterr().err == (
        "mechanism-sim: s.yaml: drive.position: 't.csv': commas are read as decimal signs: "
        "'80,123' is 80.123, not 80123\n"
    )


@pytest.mark.parametrize(
    ('headings', 'units'),
    [
        ('t [s];a / b;a / c', {'t': 's', 'a / b': '', 'a / c': ''}),
        ('t;input / output [V]', {'t': '', 'input / output': 'V'}),
        ('left / right;ratio in / out', {'left / right': '', 'ratio in / out': ''}),
        ('speed / m / s;n / 1/min', {'speed': 'm / s', 'n': '1/min'}),
    ],
)
def test_what_stands_behind_a_slash_is_a_unit_if_it_can_be(table, headings, units):
    assert table(f'{headings}\n{";".join("1" for _ in units)}\n').units == units


def test_decimal_commas_of_one_column_are_no_two_columns(table):
    """Of 1,0368 there were a 1 and a 368."""
    assert table('1,0368\n-0,5\n2,4649\n').numbers('1').ravel().tolist() == [1.0368, -0.5, 2.4649]
    assert table('1,10\n2,20\n').numbers('1', '2').tolist() == [[1.0, 10.0], [2.0, 20.0]]
    assert [*table('1,01,5\n2,02,5\n').cells] == ['1', '2', '3']


def test_a_file_without_headings_keeps_its_first_row(table):
    found = table('0.0,0.5\n1.0,2\n')
    assert (list(found.cells), found.lines) == (['1', '2'], [1, 2])
    assert np.array_equal(found.numbers('1', '2'), [[0.0, 0.5], [1.0, 2.0]])


@pytest.mark.parametrize(
    'text',
    [
        'CYCLIC;YES;\nTABLE_BEGIN;;\n0;0;SPLINE\n90.5;50;SPLINE\n360;-2.5;SPLINE\nTABLE_END;;\n',
        '0,0 0,0 // point 1\n90,5\t50,0 // point 2\n360,0   -2,5\n',
        'Tablename = A  # name\nLines = 3\nBegintable  # begin\n0 0   # Master[0] Slave[0]\n'
        '90.5  50\n360 -2.5\nEndTable  # end\n',
    ],
    ids=['rows of an editor of cams', 'remarks and decimal commas', 'between lines'],
)
def test_tables_of_electronic_cams_have_columns_by_number(table, text):
    found = table(text)
    assert list(found.cells) == ['1', '2']
    assert found.numbers('1', '2').tolist() == [[0.0, 0.0], [90.5, 50.0], [360.0, -2.5]]


def test_what_looks_like_a_remark_in_a_cell_is_none(table):
    with pytest.raises(InputError, match="got '#N/A'"):
        table('t\tx\n0\t1\n1\t#N/A\n').numbers('t', 'x')


def test_a_remark_stands_behind_numbers_only(table):
    found = table('t,run 1 # a,y\n0,wet 2 // b,5\n1,dry 1 // c,6\n')
    assert list(found.cells) == ['t', 'run 1 # a', 'y']
    assert found.numbers('y').T.tolist() == [[5.0, 6.0]]


def test_commas_behind_spaces_are_no_decimal_signs(table):
    found = table('0   ,1\n12  ,25\n')
    assert found.numbers('1', '2').tolist() == [[0.0, 1.0], [12.0, 25.0]]


def test_a_table_of_a_cam_may_have_headings(table):
    found = table('TABLE_BEGIN\nmaster;slave;kind\n0;0;SPLINE\n1;2;SPLINE\nTABLE_END\n')
    assert found.numbers('master', 'slave').tolist() == [[0.0, 0.0], [1.0, 2.0]]


def test_names_of_vectors_have_units_and_stand_once(tmp_path):
    """As data frames have them that were read from .csv."""
    file = tmp_path / 'x.npz'
    np.savez(file, **{'t [s]': np.arange(3.0), 'x [mm]': np.arange(3.0) ** 2})
    found = read_csv(file, 'table')
    assert found.units == {'t': 's', 'x': 'mm'}
    assert found.numbers('x').T.tolist() == [[0.0, 1.0, 4.0]]
    np.savez(file, **{'x [N]': np.arange(3.0), 'x [mm]': np.arange(3.0)})
    with pytest.raises(InputError, match="has several columns 'x'"):
        read_csv(file, 'table')


def test_what_is_no_table_of_vectors_is_told_as_of_text(tmp_path):
    """Too large before it is read; an empty sheet; no file at all."""
    np.savez(tmp_path / 'x.npz', x=np.zeros(LARGEST // 8 + 1))
    Workbook().save(tmp_path / 'x.xlsx')
    (tmp_path / 'x.mat').mkdir()
    for ending, words in (
        ('npz', f'is larger than {LARGEST} bytes: give fewer points'),
        ('xlsx', 'cannot be read: it is empty'),
        ('mat', 'cannot be read: Is a directory'),
    ):
        with pytest.raises(InputError, match=re.escape(words)):
            read_csv(tmp_path / f'x.{ending}', 'table')


def test_a_unit_of_a_joint_that_slides_or_turns_is_left_open(table):
    assert table('t [s],x [rad or m]\n0,1\n').units == {'t': 's', 'x': ''}


def test_cells_may_be_text(table):
    found = table('joint,x\nA,-3.74\nB,\n')
    assert found.column('joint') == ('A', 'B')
    with pytest.raises(InputError, match="line 3: expected a finite number in column 'x', got ''"):
        found.numbers('x')
    assert table('joint,x,links\nA,1,"1,2"\n').column('links') == ('1,2',)
    words = table('joint,type,x\nA,pin,\nB,slot,2\n')  # no units: they would be above numbers
    assert (words.column('joint'), words.units['joint']) == (('A', 'B'), '')
    assert table('gas pressure\n1\n2\n').column('gas pressure') == ('1', '2')


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('t;x\n0;1,5\n0.5;2\n', "line 2: expected a finite number in column 'x', got '1,5': wr"),
        ('t;x\n0;1,500\n1;12,750', "line 2: expected a finite number in column 'x', got '1,500'"),
        ('t;x\n0,000;1.500,5\n', "'1.500,5': write 1500.5, decimal signs alike in all of the"),
        ("t;x\n0.5;1'000'500.25\n", 'write 1000500.25'),
        ('t,x\n0,5,1,5\n', 'line 2: expected 2 cells as in the first line, got 4: write decimal'),
        ('t;x\n1,500;2,700\n', "'1,500', which may be 1.500 or 1500: write it without a comma"),
        ('t;x\n1;1,512\n', 'which may be 1.512 or 1512'),
        ('t\tx\n1,512\t2,714\n', 'which may be 1.512 or 1512'),
        ('0;1,5\n1;2.5\n', "column '2', got '1,5': write 1.5"),
        ('t,x\n0,nan\n', "line 2: expected a finite number in column 'x', got 'nan'"),
        ('t,y\n0,1\n', "has no column 'x'; its columns: t, y"),
        ('t,x\n0,1\n1,2\n1,3\n', "line 4: 't' must increase, but 1 follows 1"),
        ('t,x,x\n0,1,2\n', "has several columns 'x'"),
        ('', 'cannot be read: it is empty'),
        ('# nothing\n', 'cannot be read: it is empty'),
    ],
    ids=range(15),
)
def test_mistakes_are_a_sentence_with_file_and_line(table, text, said):
    def all_of_it():
        found = table(text)
        names = ['1', '2'] if '1' in found.cells else ['t', 'x']
        found.rising('t', found.numbers(*names)[:, 0])

    with pytest.raises(InputError) as error:
        all_of_it()
    assert str(error.value).startswith("s.yaml: drive.position: 't.csv'")
    assert said in str(error.value)


@pytest.mark.parametrize(
    ('name', 'wanted', 'unit'),
    [
        ('angle_deg', ('rad', 'm'), 'deg'),
        ('rpm', ('rad/s',), 'rpm'),
        ('force_N', (), 'N'),
        ('speed_rad_s', (), 'rad/s'),
        ('acc_m_s2', ('m/s^2',), 'm/s2'),
        ('M_kN_m', ('N m',), 'kN m'),
        ('torque_Nm', (), 'Nm'),
        ('acc_g', ('m/s^2',), 'g'),
        ('rig/rod_mm', ('m',), 'mm'),
        ('stamp_ns', ('s',), 'ns'),
        ('force_mm', ('N', 'N m'), ''),  # fits not
        ('omega_m', ('rad', 'm', 's'), ''),  # the motor's
        ('p_bar', ('N', 'Pa', ''), 'bar'),
        ('p_bar', ('N',), ''),  # of a link
        ('x_mm', ('N', 'Pa', ''), 'mm'),
        ('F_A', ('N', 'Pa', ''), ''),  # at A
        ('F_m2', ('N', 'Pa', ''), ''),  # of a second mass
        ('v_m_s', ('N', 'Pa', ''), 'm/s'),
        ('p_psi', ('N', 'Pa', ''), ''),
        ('acc_g', (), ''),
        ('p_in', ('m',), ''),
        ('force_min', (), ''),
        ('impulse_N_s', (), ''),
        ('t', ('s',), ''),
        ('channel_2', (), ''),
        ('N', ('N',), ''),
        ('', (), ''),
    ],
)
def test_a_name_may_end_with_a_unit(name, wanted, unit):
    assert named_unit(name, wanted) == unit
