"""Compiled code that is kept: damaged, on a full disk, in a folder of others; runs never end."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
from contextlib import contextmanager, suppress
from pathlib import Path

import heyoka
import pytest
from running import TIMEOUT

from mechanism_sim.engine.contact.respond import resolve
from mechanism_sim.numerics import code_cache, kernels
from mechanism_sim.numerics.modal_filter import pass_through

PROGRAM = """
import sys
import numpy as np
import heyoka as hy
from mechanism_sim.numerics import compiled, kernels, machine_code

@kernels.kernel
def double(x):
    return 2.0 * x

@kernels.entry
def total(x):
    found = 0.0
    for k in range(len(x)):
        found += double(x[k])
    return found

made = []
object_of = machine_code._object
machine_code._object = lambda text: made.append(text) or object_of(text)
kernels.compile_kernels()
print(total(np.arange(5.0)), total(np.arange(3)))
x, v = hy.make_vars('x', 'v')
f = compiled.function([x * hy.sin(v), v + 1.0], [x, v])
print(f([2.0, 0.5]).tolist())
print(total.run is not total.function, len(made))
"""
RIGHT = ['20.0 6.0', '[0.958851077208406, 1.5]']


@pytest.fixture(scope='module', autouse=True)
def program(tmp_path_factory):
    """The program, at one place."""
    global FILE  # noqa: PLW0603
    FILE = tmp_path_factory.mktemp('program') / 'program.py'
    FILE.write_text(PROGRAM)
    return FILE


def run(folder, **more):
    """The program with a folder for its code; its lines and what it complains of."""
    done = subprocess.run(
        [sys.executable, str(FILE)], env={**os.environ, 'HEYOKA_CACHE_DIR': str(folder), **more},
        capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[:2] == RIGHT
    return lines[2], done.stderr


@pytest.fixture(scope='module')
def kept(program, tmp_path_factory):  # noqa: ARG001
    """A folder with code, which a second run uses."""
    folder = tmp_path_factory.mktemp('cache') / 'kept'
    assert run(folder) == ('True 2', '')
    assert run(folder) == ('True 0', '')
    return folder


def test_code_of_events_is_only_cheap_where_some_is_kept(tmp_path, monkeypatch):
    """That of signals is no reason to expect it."""
    monkeypatch.setattr(kernels, '_folder', lambda: tmp_path)
    price = kernels._price.__wrapped__
    assert price() == kernels.COMPILING
    (tmp_path / f'{pass_through.__name__}-0123.o').touch()
    assert price() == kernels.COMPILING
    (tmp_path / f'{resolve.__name__}-0123.o').touch()
    assert price() == kernels.LOADING


def damage(dice, file):
    """Cut a file, overwrite a part of it, or turn bits over."""
    data = bytearray(file.read_bytes())
    size = len(data)
    kinds = ['cut', 'zero', 'other', 'empty', 'gone']
    if file.suffix != '.db':  # in which heyoka finds no bit of code that was turned over
        kinds += ['bit', 'bytes']
    kind = dice.choice(kinds)
    if kind == 'cut':
        del data[dice.randrange(size) :]
    elif kind == 'zero':
        at = dice.randrange(size)
        data[at : at + 4096] = bytes(min(4096, size - at))
    elif kind == 'bit':
        data[dice.randrange(size)] ^= 1 << dice.randrange(8)
    elif kind == 'bytes':
        for _ in range(50):
            data[dice.randrange(size)] = dice.randrange(256)
    elif kind == 'other':
        data = bytearray(dice.randbytes(5000))
    elif kind == 'empty':
        data.clear()
    if kind == 'gone':
        file.unlink()
    else:
        file.write_bytes(data)
    return kind


@pytest.mark.slow
@pytest.mark.parametrize('seed', [
    0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 200))
])  # fmt: skip
def test_damaged_code_is_made_anew(seed, kept, tmp_path):
    """Whatever is wrong with its files, the program computes the same; the next is quick."""
    folder = tmp_path / 'cache'
    shutil.copytree(kept, folder)
    dice = random.Random(seed)
    files = sorted(x for x in folder.rglob('*') if x.is_file())
    for file in dice.sample(files, dice.randrange(1, len(files) + 1)):
        damage(dice, file)
    compiled, said = run(folder)
    assert compiled.startswith('True')
    assert said == ''
    assert run(folder) == ('True 0', '')


@contextmanager
def small_disk(folder, size, *options):
    """A file system of some bytes, mounted at a folder; only root can do so."""
    folder.mkdir(exist_ok=True)
    options = ','.join([f'size={size}', 'mode=0700', *options])
    command = ['mount', '-t', 'tmpfs', '-o', options, 'tmpfs', str(folder)]
    done = subprocess.run(command, check=False, capture_output=True)
    if done.returncode:
        pytest.skip('nothing can be mounted here')
    try:
        yield folder
    finally:
        subprocess.run(['umount', '-l', str(folder)], check=True)


@pytest.mark.sample(1)
@pytest.mark.parametrize('disk', [
    'full', 'none',
    *(pytest.param(x, marks=pytest.mark.slow) for x in ('small', 'read-only', 'file')),
])  # fmt: skip
def test_without_room_for_code_a_run_goes_on(disk, tmp_path):
    folder = tmp_path / 'cache'
    if disk == 'none':
        assert run(folder / 'under' / 'nothing', HEYOKA_CACHE_DIR='/proc/none')[0] == 'True 2'
        return
    if disk == 'file':
        folder.write_text('')
        assert run(folder)[0] == 'True 2'
        return
    with small_disk(folder, '200k', *(['ro'] if disk == 'read-only' else [])):
        if disk == 'full':
            with suppress(OSError):
                (folder / 'fill').write_bytes(bytes(300_000))
        compiled, said = run(folder)
    assert compiled == 'True 2'
    assert said == ''


def test_code_of_others_is_not_read(tmp_path, monkeypatch):
    """A folder that others own or may write to, or whose place they decide, keeps nothing."""
    own = tmp_path / 'own'
    own.mkdir(mode=0o700)
    assert code_cache.belongs_to_nobody_else(own)
    for mode in (0o702, 0o777, 0o1777):
        own.chmod(mode)
        assert not code_cache.belongs_to_nobody_else(own)
    below = own / 'below'
    below.mkdir(mode=0o700)
    own.chmod(0o1777)
    assert code_cache.belongs_to_nobody_else(below)  # sticky, as /tmp
    own.chmod(0o777)
    assert not code_cache.belongs_to_nobody_else(below)
    own.chmod(0o700)
    monkeypatch.setattr(code_cache.os, 'geteuid', lambda: 4711)
    assert not code_cache.belongs_to_nobody_else(below)
    assert not code_cache.belongs_to_nobody_else(tmp_path / 'missing')


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can give folders away')
def test_the_cache_of_somebody_else_is_left_alone(program, tmp_path):
    """XDG_CACHE_HOME may point anywhere: a pickle there is not opened, and one line says so."""
    foreign = tmp_path / 'foreign'
    (foreign / 'mechanism_sim').mkdir(parents=True)
    for path in (foreign, foreign / 'mechanism_sim'):
        os.chown(path, 12345, 12345)
    before = sorted(foreign.rglob('*'))
    env = {**os.environ, 'XDG_CACHE_HOME': str(foreign)}
    env.pop('HEYOKA_CACHE_DIR', None)
    done = subprocess.run([sys.executable, str(program)], env=env, capture_output=True, text=True,
                          timeout=TIMEOUT, check=False)  # fmt: skip
    assert done.stdout.splitlines() == [*RIGHT, 'True 2'], done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith('mechanism-sim: compiled code is not cached: others own')
    assert sorted(foreign.rglob('*')) == before


def test_a_folder_of_ours_that_was_open_to_others_is_emptied_and_closed(tmp_path):
    folder = tmp_path / 'home' / 'mechanism_sim'
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    (folder / 'kernels-0123').mkdir()
    (folder / 'kernels-0123' / 'planted.o').write_bytes(b'cos\nsystem\n')
    (folder / 'cache.db').write_bytes(b'planted')
    env = {**os.environ, 'XDG_CACHE_HOME': str(tmp_path / 'home')}
    env.pop('HEYOKA_CACHE_DIR', None)
    code = 'from mechanism_sim.numerics import code_cache; print(code_cache.folder())'
    done = subprocess.run([sys.executable, '-c', code], env=env, capture_output=True, text=True,
                          timeout=TIMEOUT, check=True)  # fmt: skip
    assert Path(done.stdout.strip()) == folder.resolve()
    assert list(folder.iterdir()) == []
    assert folder.stat().st_mode & 0o777 == 0o700


def test_code_is_made_by_all_threads_and_evaluated_by_one():
    # another thread, woken for some microseconds, would spin for a millisecond after each call
    known = code_cache.compiled(heyoka.get_nthreads)
    assert (known, heyoka.get_nthreads()) == (len(os.sched_getaffinity(0)), 1)
