"""The tutorial, word by word: its commands run in order, and answer what it shows."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from running import environment, run

PAGE = (Path(__file__).parents[1] / 'docs' / 'tutorial.md').read_text(encoding='utf-8')
BLOCK = re.compile(
    r'(?P<not_run><!-- not run: .+? -->\n)?^```(?P<kind>\w+)\n(?P<text>.*?)^```$',
    re.DOTALL | re.MULTILINE,
)
NUMBER = re.compile(r'(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.]*[a-z_])')
VALUE = r' (?P<{}>[\d.]+)[ %]* \|'
TABLE = re.compile(
    r'^\| (?P<what>[^|*]+) \|' + ''.join(map(VALUE.format, ('good', 'worn', 'times'))),
    re.MULTILINE,
)


def commands(text: str) -> list[list[str]]:
    lines = text.replace('\\\n', ' ').splitlines()
    return [shlex.split(line) for line in lines]


def numbers(text: str) -> list[float]:
    return [float(number) for number in NUMBER.findall(text)]


def alike(shown: str, said: str) -> bool:
    """The same words, and numbers within a factor of three: the motion is chaotic.

    Lines that tell how fast it went may have any numbers.
    """
    if NUMBER.sub('#', shown).split() != NUMBER.sub('#', said).split():
        return False
    pairs = zip(numbers(shown), numbers(said), strict=True)
    return (
        'real time' in shown
        or ' CPU' in shown
        or all(abs(a) <= 3 * abs(b) and abs(b) <= 3 * abs(a) for a, b in pairs)
    )


def test_every_command_answers_as_shown(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    env = environment()
    said: list[str] = []
    ran = compared = 0
    for block in BLOCK.finditer(PAGE):
        if block['not_run']:
            continue
        if block['kind'] == 'sh':
            said = []
            for name, *args in commands(block['text']):
                assert name == 'mechanism-sim'
                done = run(*args, env=env if args[0] == 'run' else None)
                assert done.returncode == 0, (args, done.stderr)
                said += done.stdout.splitlines()
                ran += 1
        else:
            assert block['kind'] == 'text'
            answers = iter(said)
            for shown in block['text'].splitlines():
                if shown != '...':
                    assert any(alike(shown, answer) for answer in answers), shown
                    compared += 1
    assert ran >= 10
    assert compared >= 50
    for file in re.findall(r'-o (\S+)|--record (\S+)', PAGE):
        assert (tmp_path / ''.join(file)).stat().st_size > 1000


def test_the_table_says_what_the_outputs_say():
    """Each of its numbers is one of an output above it, rounded, and the last is their ratio."""
    outputs = ''.join(block['text'] for block in BLOCK.finditer(PAGE) if block['kind'] == 'text')
    shown = numbers(outputs)
    rows = list(TABLE.finditer(PAGE))
    assert len(rows) == 11
    for row in rows:
        good, worn, times = (float(row[column]) for column in ('good', 'worn', 'times'))
        for value in good, worn:
            assert value in [float(f'{number:.2g}') for number in shown], row['what']
        assert worn / good == pytest.approx(times, rel=0.05), row['what']
