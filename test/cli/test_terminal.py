"""Output to a terminal beside the results, progress and colours, and to nothing else."""

from __future__ import annotations

import io
import os
import re
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread

import pytest
from bags import write_bag
from builders import simulated
from running import Program, run

from benchmarks.command import main as benchmarks
from benchmarks.problem import OURS
from mechanism_sim.cli import main
from mechanism_sim.cli.outcome import carry_out
from mechanism_sim.errors import RunWarning
from test.grid.command import main as grid
from test.hard.command import main as hard


@contextmanager
def terminal(*names: str) -> Iterator[io.BytesIO]:
    """A pseudo-terminal in the place of standard streams; what is written to it, once closed."""
    master, slave = os.openpty()
    seen = io.BytesIO()

    def read() -> None:
        try:
            while piece := os.read(master, 4096):
                seen.write(piece)
        except OSError:  # Linux says so when the other end is closed
            pass

    reader = Thread(target=read)
    reader.start()
    streams = {name: getattr(sys, name) for name in names}
    line = os.fdopen(slave, 'w', encoding='utf-8')
    try:
        for name in names:
            setattr(sys, name, line)
        yield seen
    finally:
        for name, stream in streams.items():
            setattr(sys, name, stream)
        line.close()
        reader.join()
        os.close(master)


def at_a_terminal(
    *args: str, streams: tuple[str, ...] = ('stderr',), program: Program = main
) -> str:
    """Output at a terminal of a command that ends well."""
    with terminal(*streams) as seen, pytest.raises(SystemExit) as ended:
        program(args)
    assert ended.value.code == 0
    return seen.getvalue().decode()


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    file = tmp_path_factory.mktemp('terminal') / 'run.mcap'
    return str(write_bag(file, simulated('four_bar_measured', revolutions=2)))


@pytest.fixture(autouse=True)
def plain_terminal(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('TERM', 'xterm')
    monkeypatch.setenv('COLUMNS', '100')
    for name in ('NO_COLOR', 'FORCE_COLOR'):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    ('command', 'shown'),
    [
        ('solve four_bar_clearance --revolutions 20', ['reading the scene', 'solve', 'preparing']),
        ('check punch', ['reading the scene']),
        ('cycle punch', ['reading the scene', 'cycle']),
        ('draw punch', ['draw']),
        ('export punch --format rviz', ['export']),
        ('check punch --equations', ['equations']),
        (
            'find four_bar_clearance --periodic --longest 2',
            ['looking for a period: 2 of 2 revolutions'],
        ),
        ('statistics four_bar_clearance --revolutions 40', ['statistics', 'impacts']),
        ('thesis starts four_bar_clearance --angles 2', ['starts', '2/2']),
        ('thesis contact-loss four_bar_clearance', ['contact-loss']),
        ('find valve_train --lift-off', ['find', 'contact']),
        ('analyze BAG', ['reading', '100%']),
        ('analyze BAG --impacts-on coupler_rocker', ['reading', 'analyze']),
        ('animate BAG -o rattle.wav', ['sound', 'impacts']),
        ('plot BAG position.crank', ['plot', '100%']),
    ],
)
def test_long_work_says_what_it_does_to_a_terminal_only(command, shown, bag, capsys):
    args = [bag if word == 'BAG' else word for word in command.split()]
    seen = at_a_terminal(*args)
    results = capsys.readouterr().out
    assert results
    assert '\x1b' not in results
    for words in shown:
        assert words in re.sub(r'\x1b\[[0-9;?]*[A-Za-z]', '', seen)
    assert seen.rstrip().endswith('\x1b[2K')  # and goes away


@pytest.mark.slow
@pytest.mark.parametrize(
    ('program', 'args', 'shown'),
    [
        (hard, ['bouncing_tolerances'], ['hard: case 1 of 1']),
        (grid, ['--only', 'slot_001,geneva_001', '--workers', '1'], ['grid', '2/2']),
        (benchmarks, ['torque_crank', '--methods', OURS, '--repeats', '1'], ['benchmarks']),
    ],
)
def test_other_programs_say_what_they_do_to_a_terminal_only(program, args, shown, capsys):
    seen = at_a_terminal(*args, program=program)
    assert '\x1b' not in capsys.readouterr().out
    for words in shown:
        assert words in re.sub(r'\x1b\[[0-9;?]*[A-Za-z]', '', seen)
    assert seen.rstrip().endswith('\x1b[2K')


RED, BOLD, END = '\x1b[1;31m', '\x1b[1m', '\x1b[0m'


@pytest.mark.sample(3)
@pytest.mark.network
@pytest.mark.parametrize(
    ('command', 'heading'),
    [
        ('', 'More'),
        ('check punch', 'level'),
        ('solve punch', 'punch (inverse dynamics)'),
        ('bag info BAG', 'scene'),
        ('analyze BAG', 'impacts'),
        ('analyze BAG --impacts-on coupler_rocker', 'impacts in coupler_rocker'),
    ],
)
def test_results_are_in_colours_on_a_terminal_and_the_same_words(command, heading, bag):
    args = [bag if word == 'BAG' else word for word in command.split()]
    seen = at_a_terminal(*args, streams=('stdout',))
    assert f'{BOLD}{heading}{END}' in seen
    plain = run(*args).stdout
    shown = re.sub(r'\x1b\[[0-9;]*m', '', seen).replace('\r\n', '\n')
    if command.startswith('solve'):  # says how long it took
        long = r' +[\d.e-]+ [mµn]?s\b'
        plain, shown = (re.sub(long, ' so long', text) for text in (plain, shown))
    assert shown == plain


def test_colours_are_for_who_wants_them(monkeypatch):
    args = ('bag', 'info', 'missing.mcap')
    with terminal('stderr') as seen, pytest.raises(SystemExit):
        main(args)
    coloured = seen.getvalue().decode().rstrip()
    plain = run(*args).stderr
    assert coloured.startswith(f'{RED}mechanism-sim:{END} ')
    assert re.sub(r'\x1b\[[0-9;]*m', '', coloured) == plain.rstrip()
    assert '\x1b' not in plain
    monkeypatch.setenv('FORCE_COLOR', '1')
    assert run(*args).stderr.rstrip() == coloured
    assert '\x1b' in run('check', 'punch').stdout
    assert '\x1b' not in run('check', 'punch', '--json').stdout
    monkeypatch.setenv('NO_COLOR', '1')
    assert run(*args).stderr == plain
    assert '\x1b' not in at_a_terminal('check', 'punch', streams=('stdout',))


def test_a_warning_about_a_run_is_one_sentence(capsys, monkeypatch):
    """Without the line of code that it comes from; other warnings are shown as ever."""
    shown = []
    monkeypatch.setattr(warnings, 'showwarning', lambda message, *_, **__: shown.append(message))

    def work() -> int:
        warnings.warn('it takes long', RunWarning, stacklevel=1)
        warnings.warn('it divides by zero', RuntimeWarning, stacklevel=1)
        return 0

    with pytest.raises(SystemExit):
        carry_out(work, [])
    assert capsys.readouterr().err == 'mechanism-sim: it takes long\n'
    assert [str(message) for message in shown] == ['it divides by zero']
