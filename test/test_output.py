"""Full disks, folders that nobody may write to, and readers that have had enough."""

import contextlib
import os
import resource
import subprocess
import sys

import pytest
from running import run as command

from mechanism_sim import output
from mechanism_sim.cli import main
from mechanism_sim.errors import RunError

SHORT = ('--duration', '0.03')

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
    'equations': ('equations', 'four_bar_nominal', '-o', '{}.md'),
    'draw': ('draw', 'four_bar_nominal', '-o', '{}.svg'),
    'png': ('draw', 'four_bar_nominal', '-o', '{}.png'),
    'pdf': ('draw', 'four_bar_nominal', '-o', '{}.pdf'),
    'cycle': ('cycle', 'four_bar_nominal', '--output', '{}.csv'),
    'animate': ('animate', 'four_bar_nominal', '--duration', '0.005', '-o', '{}.gif'),
    'report': ('report', 'four_bar_nominal', *SHORT, '-o', '{}.html'),
    'plot': ('plot', 'four_bar_nominal', 'velocity.rocker', *SHORT, '-o', '{}.svg'),
    'layout': ('layout', 'four_bar_nominal', '--for', 'foxglove', '-o', '{}.json'),
    'sound': ('sound', 'gear_rattle', '--duration', '0.1', '-o', '{}.wav'),
    'profile': ('profile', 'eccentric_cam', 'contact', '-o', '{}.svg'),
    'urdf': ('export', 'four_bar_nominal', '--format', 'urdf', '-o', '{}.urdf'),
    'mjcf': ('export', 'four_bar_nominal', '--format', 'mjcf', '-o', '{}.xml'),
    'sdf': ('export', 'four_bar_nominal', '--format', 'sdf', '-o', '{}.sdf'),
    'dxf': ('profile', 'eccentric_cam', 'contact', '-o', '{}.dxf'),
    'mp4': ('animate', 'four_bar_nominal', '--duration', '0.005', '-o', '{}.mp4'),
    'analyze': ('analyze', '{bag}', '--plots', '{}.svg'),
    'sweep': ('sweep', '{sweep}', '-o', '{}.parquet', '--workers', '1'),
}  # fmt: skip


@contextlib.contextmanager
def full_disk(left):
    """No file of this process grows beyond so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    sys.dont_write_bytecode = True  # Python keeps a module of which only a part was written
    resource.setrlimit(resource.RLIMIT_FSIZE, (left, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        sys.dont_write_bytecode = False


@pytest.fixture(scope='module')
def given(tmp_path_factory):
    """Files that some of them read."""
    folder = tmp_path_factory.mktemp('given')
    found = {'bag': folder / 'run.mcap', 'sweep': folder / 'sweep.yaml'}
    found['sweep'].write_text(
        'title: one speed\nscene: four_bar_nominal\nduration: 0.02\nset: {drive.speed: 300 rpm}\n'
    )
    done = command('run', 'four_bar_clearance', *SHORT, '--record', str(found['bag']))
    assert done.returncode == 0, done.stderr
    return found


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


@pytest.mark.parametrize('options', [(), ('--json',)])
def test_an_output_that_is_full_is_said(options):
    with open('/dev/full', 'wb') as full:
        done = subprocess.run(
            [sys.executable, '-m', 'mechanism_sim', 'check', 'four_bar_nominal', *options],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr == (
        'mechanism-sim: the output cannot be written: No space left on device\n'
    )


def test_a_reader_that_has_had_enough_is_no_failure():
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, 'wb') as gone:
        done = subprocess.run(
            [sys.executable, '-m', 'mechanism_sim', 'check', 'four_bar_nominal', '--json'],
            stdout=gone, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, '')
