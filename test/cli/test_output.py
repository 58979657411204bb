"""Full disks, folders that nobody may write to, and readers that have had enough."""

import csv
import json
import os
import stat
import subprocess
import sys

import numpy as np
import openpyxl
import pytest
from bags import write_bag
from builders import simulated
from running import full_disk

from mechanism_sim import output, tables
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError, RunError

LENGTH = 0.03
SHORT = '--duration', str(LENGTH)

KEPT = {'run': ['out.mcap'], 'sweep': ['out.parquet.journal']}
"""What is readable as far as it came, and gone on from."""

# commands that write, {} is the file
WRITING = {
    'new': ('new', '{}.yaml'),
    'csv': ('solve', 'four_bar_nominal', *SHORT, '--sample-rate', '1e4', '--output', '{}.csv'),
    'npz': ('solve', 'four_bar_nominal', *SHORT, '--sample-rate', '1e4', '--output', '{}.npz'),
    'parquet': (
        'solve', 'four_bar_nominal', *SHORT, '--sample-rate', '1e4', '--output', '{}.parquet',
    ),
    'save': ('solve', 'four_bar_clearance', *SHORT, '--save', '{}.json'),
    'run': ('run', 'four_bar_nominal', *SHORT, '--record', '{}.mcap'),
    'equations': ('check', 'four_bar_nominal', '--equations', '-o', '{}.md'),
    'draw': ('draw', 'four_bar_nominal', '-o', '{}.svg'),
    'png': ('draw', 'four_bar_nominal', '-o', '{}.png'),
    'pdf': ('draw', 'four_bar_nominal', '-o', '{}.pdf'),
    'cycle': ('cycle', 'four_bar_nominal', '--output', '{}.csv'),
    'animate': ('animate', 'four_bar_nominal', '--duration', '0.005', '-o', '{}.gif'),
    'report': ('report', 'four_bar_nominal', *SHORT, '-o', '{}.html'),
    'plot': ('plot', 'four_bar_nominal', 'velocity.rocker', *SHORT, '-o', '{}.svg'),
    'layout': ('export', 'four_bar_nominal', '--format', 'foxglove', '-o', '{}.json'),
    'sound': ('animate', 'gear_rattle', '--duration', '0.1', '-o', '{}.wav'),
    'profile': ('draw', 'eccentric_cam', '--profile', 'contact', '-o', '{}.svg'),
    'urdf': ('export', 'four_bar_nominal', '--format', 'urdf', '-o', '{}.urdf'),
    'mjcf': ('export', 'four_bar_nominal', '--format', 'mjcf', '-o', '{}.xml'),
    'sdf': ('export', 'four_bar_nominal', '--format', 'sdf', '-o', '{}.sdf'),
    'dxf': ('draw', 'eccentric_cam', '--profile', 'contact', '-o', '{}.dxf'),
    'mp4': ('animate', 'four_bar_nominal', '--duration', '0.005', '-o', '{}.mp4'),
    'analyze': ('analyze', '{bag}', '--plots', '{}.svg'),
    'sweep': ('sweep', '{sweep}', '-o', '{}.parquet', '--workers', '1'),
}  # fmt: skip


@pytest.fixture(scope='module')
def given(tmp_path_factory):
    """Files that some of them read."""
    folder = tmp_path_factory.mktemp('given')
    found = {'bag': folder / 'run.mcap', 'sweep': folder / 'sweep.yaml'}
    found['sweep'].write_text(
        'title: one speed\nscene: four_bar_nominal\nduration: 0.02\nset: {drive.speed: 300 rpm}\n'
    )
    write_bag(found['bag'], simulated('four_bar_clearance', duration=LENGTH))
    return found


@pytest.mark.network
@pytest.mark.sample(2)
@pytest.mark.parametrize('name', WRITING)
def test_a_full_disk_ends_in_a_sentence_and_leaves_nothing(capsys, given, tmp_path, name):
    args = [a.format(tmp_path / 'out', **given) for a in WRITING[name]]
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended, full_disk(400):
        main(args)
    said = capsys.readouterr().err
    assert ended.value.code == 1, said
    assert 'cannot be written' in said or 'ffmpeg failed to write' in said
    assert len([line for line in said.splitlines() if '/out' in line]) == 1
    assert [path.name for path in tmp_path.iterdir()] == KEPT.get(name, [])


@pytest.mark.network
@pytest.mark.sample(3)
@pytest.mark.skipif(not os.path.isdir('/sys'), reason='needs a folder that nobody may write to')
@pytest.mark.parametrize('name', WRITING)
def test_a_read_only_folder_ends_in_a_sentence(capsys, given, name):
    args = [a.format('/sys/out', **given) for a in WRITING[name]]
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main(args)
    said = capsys.readouterr().err
    assert ended.value.code == 2, said
    assert len([line for line in said.splitlines() if '/sys/out' in line]) == 1


def test_what_was_there_stays_when_the_disk_is_full(tmp_path):
    file = tmp_path / 'page.html'
    file.write_text('before')
    with pytest.raises(RunError, match='cannot be written'), full_disk(10):
        output.write_text(file, 'x' * 1000)
    assert file.read_text() == 'before'
    assert [path.name for path in tmp_path.iterdir()] == ['page.html']


def test_devices_are_written_themselves():
    output.write_text('/dev/null', 'x')
    with pytest.raises(RunError, match="'/dev/full' cannot be written: No space left"):
        output.write_text('/dev/full', 'x')


CHECK = 'check', 'four_bar_nominal'
FULL = 'the output cannot be written: No space left on device'


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('words', 'code', 'said'),
    [
        (('scenes',), 1, FULL),
        pytest.param(CHECK, 1, FULL, marks=pytest.mark.slow),
        (('--help',), 1, FULL),
        pytest.param((*CHECK, '--json'), 1, FULL, marks=pytest.mark.slow),
        (('check', 'nosuch', '--json'), 2, "there is no scene 'nosuch'"),
    ],
)
def test_an_output_that_is_full_is_said(words, code, said):
    with open('/dev/full', 'wb') as full:
        done = subprocess.run(
            [sys.executable, '-m', 'mechanism_sim', *words],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == code
    assert done.stderr.startswith(f'mechanism-sim: {said}')
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.slow
def test_what_is_said_beside_a_result_ends_nothing_where_it_cannot_be_written(tmp_path):
    """Notes of an import ended it where standard error was full, and errors had another code."""
    file, table = tmp_path / 'x.yaml', tmp_path / 'x.csv'
    table.write_text('Joint,X [mm],Y [mm],Links,Ground,Input\nA,0,0,a,yes,no\nB,9,0,a|b,no,no\n')
    for words, code in (
        (('import', str(table), '-o', str(file)), 0), (('check', 'nosuch'), 2),
    ):  # fmt: skip
        with open('/dev/full', 'wb') as full:
            done = subprocess.run(
                [sys.executable, '-m', 'mechanism_sim', *words],
                stdout=subprocess.PIPE, stderr=full, check=False,
            )  # fmt: skip
        assert done.returncode == code
    assert file.read_text(encoding='utf-8').startswith('title:')


@pytest.mark.slow
@pytest.mark.parametrize('closed', ['>&-', '<&- >&- 2>&-'])
def test_an_output_that_is_closed_is_nobodys(tmp_path, closed):
    """As with ``> /dev/null``: files that are opened do not take its place."""
    file = tmp_path / 'x.json'
    call = f'{sys.executable} -m mechanism_sim'
    words = f'{call} export four_bar_nominal --format foxglove -o {file} {closed}'
    done = subprocess.run(words, shell=True, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, '')
    assert json.loads(file.read_text(encoding='utf-8'))


@pytest.mark.slow
def test_an_output_without_umlauts_gets_them_written_out():
    plain = os.environ | {'PYTHONIOENCODING': 'ascii'}
    words = [sys.executable, '-m', 'mechanism_sim', *CHECK, '--set', 'title=Größe']
    done = subprocess.run(words, env=plain, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.startswith('four_bar_nominal: Gr\\xf6\\xdfe\n')


@pytest.mark.parametrize(
    ('words', 'code', 'said'), [(('scenes',), 0, ''), (('check', 'x'), 2, "no scene 'x'")]
)
def test_a_reader_that_has_had_enough_is_no_failure(words, code, said):
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, 'wb') as gone:
        done = subprocess.run(
            [sys.executable, '-m', 'mechanism_sim', *words, '--json'],
            stdout=gone, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert (done.returncode, len(done.stderr.splitlines())) == (code, bool(said))
    assert said in done.stderr


# --- saving in place of what is there -------------------------------------------------------


def test_what_is_saved_keeps_mode_owner_and_links(tmp_path):
    """A file with a mode, one with two names and one behind a link stay what they are."""
    file, name, link = tmp_path / 'a.yaml', tmp_path / 'b.yaml', tmp_path / 'c.yaml'
    file.write_text('before, and longer than what comes')
    file.chmod(0o640)
    output.write_text(file, 'after')
    assert (file.read_text(), stat.S_IMODE(file.stat().st_mode)) == ('after', 0o640)
    name.hardlink_to(file)
    link.symlink_to(file)
    output.write_text(link, 'again')
    assert link.is_symlink()
    assert [x.read_text() for x in (file, name, link)] == ['again'] * 3
    assert file.samefile(name)
    output.write_text(name, 'much longer than it was')
    assert file.read_text() == 'much longer than it was'
    assert sorted(x.name for x in tmp_path.iterdir()) == ['a.yaml', 'b.yaml', 'c.yaml']


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can give files away')
def test_what_is_saved_keeps_the_owner(tmp_path):
    file = tmp_path / 'a.yaml'
    file.write_text('before')
    os.chown(file, 12345, 54321)
    output.write_text(file, 'after')
    found = file.stat()
    assert (found.st_uid, found.st_gid, file.read_text()) == (12345, 54321, 'after')


def test_no_planted_file_is_followed(tmp_path, monkeypatch):
    """Whoever guesses the name of the temporary file gets no other file overwritten by it."""
    victim = tmp_path / 'victim'
    victim.write_text('precious')
    monkeypatch.setattr(output.secrets, 'token_hex', lambda _: 'guessed')
    for plant in ('symlink_to', 'hardlink_to'):
        planted = tmp_path / '.a.guessed.part.yaml'
        getattr(planted, plant)(victim)
        with pytest.raises(InputError, match='File exists'):
            output.write_text(tmp_path / 'a.yaml', 'after')
        assert victim.read_text() == 'precious'
        planted.unlink()
    assert not (tmp_path / 'a.yaml').exists()


def test_a_pipe_that_nobody_reads_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / 'pipe.yaml')
    with pytest.raises(InputError, match='it is not a file'):
        output.write_text(tmp_path / 'pipe.yaml', 'after', devices=False)


@pytest.mark.parametrize('kind', ['new', 'there', 'two names'])
def test_a_full_disk_costs_nothing_of_what_was_there(kind, tmp_path):
    file = tmp_path / 'a.yaml'
    if kind != 'new':
        file.write_text('before')
    if kind == 'two names':
        (tmp_path / 'b').hardlink_to(file)
    with full_disk(4096), pytest.raises(RunError, match='cannot be written'):
        output.write_text(file, 'x' * 10_000)
    assert [x.read_text() for x in tmp_path.iterdir()] == {
        'new': [], 'there': ['before'], 'two names': ['before'] * 2
    }[kind]  # fmt: skip


@pytest.mark.parametrize('length', [252, 255, 256, 4096])
def test_a_long_name_is_written_or_a_sentence(length, tmp_path):
    file = tmp_path / ('a' * (length - 5) + '.yaml')
    if length <= 255:
        output.write_text(file, 'after')
        assert file.read_text() == 'after'
    else:
        with pytest.raises(InputError, match='File name too long'):
            output.write_text(file, 'after')
    assert len(list(tmp_path.iterdir())) == (length <= 255)


def test_a_circle_of_links_is_a_sentence(tmp_path):
    (tmp_path / 'a.yaml').symlink_to(tmp_path / 'b.yaml')
    (tmp_path / 'b.yaml').symlink_to(tmp_path / 'a.yaml')
    with pytest.raises(InputError, match='symbolic links'):
        output.write_text(tmp_path / 'a.yaml', 'after')


# --- cells that a spreadsheet would compute -------------------------------------------------

FORMULAS = ['=1+1', '+1+cmd|x', '-2+3', '@SUM(A1)', '\t=1', '\r=1']


def test_no_text_of_a_table_is_a_formula(tmp_path):
    """Names, units and values that begin like formulas are texts; numbers stay numbers."""
    texts = [*FORMULAS, '-10 deg', '-1e-3', 'plain']
    columns = [
        tables.Column('=HYPERLINK("x")', texts, meaning='=2+2'),
        tables.Column('value', np.linspace(-1.0, 1.0, len(texts)), '@N'),
    ]
    tables.write(tmp_path / 't.csv', columns, {'=key': '=about'})
    with (tmp_path / 't.csv').open(newline='') as file:
        heading, *rows = csv.reader(file)
    assert heading == ['\'=HYPERLINK("x")', 'value [@N]']
    assert [row[0] for row in rows] == [f"'{x}" for x in FORMULAS] + texts[len(FORMULAS) :]
    assert float(rows[0][1]) == -1.0
    tables.write(tmp_path / 't.xlsx', columns, {'=key': '=about'})
    book = openpyxl.load_workbook(tmp_path / 't.xlsx')
    cells = [
        cell for sheet in book for row in sheet.rows for cell in row if cell.value is not None
    ]
    assert {cell.data_type for cell in cells} == {'s', 'n'}
    assert [cell.value for cell in book['table']['A']][1:] == [
        x.replace('\r', '\n') for x in texts
    ]
    assert book['table']['B2'].value == -1.0
