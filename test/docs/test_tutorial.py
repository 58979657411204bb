"""The tutorial, word by word: its commands run in order, and answer what it shows.

The motion of a worn bearing is chaotic, so that other processors have other numbers; but not any.
"""

from __future__ import annotations

import re

import pytest
from blocks import NUMBER, Block, blocks, commands, words
from running import ROOT, environment, run

BLOCKS = blocks('docs/tutorial.md')
COLUMN = r' (?P<{}>[\d.]+)[ %]* \|'
TABLE = re.compile(
    r'^\| (?P<what>[^|*]+) \|' + ''.join(map(COLUMN.format, ('good', 'worn', 'times'))),
    re.MULTILINE,
)


def alike(shown: str, said: str) -> bool:
    """True for the same words, and numbers within a factor of three.

    Lines that tell how fast it went may have any numbers.
    """
    if NUMBER.sub('#', shown).split() != NUMBER.sub('#', said).split():
        return False
    if 'real time' in shown or ' CPU' in shown:
        return True
    values = ([abs(float(x)) for x in NUMBER.findall(line)] for line in (shown, said))
    return all(a <= 3 * b and b <= 3 * a for a, b in zip(*values, strict=True))


def answer(block: Block, env: dict[str, str]) -> list[str]:
    """Lines that the commands of a block print."""
    said = []
    for command, _ in commands(block):
        args = words(command)
        assert args, command
        done = run(*args, env=env if args[0] == 'run' else None)
        assert done.returncode == 0, (command, done.stderr)
        said += done.stdout.splitlines()
    return said


@pytest.mark.network
@pytest.mark.slow
def test_every_command_answers_as_shown(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    env = environment()
    compared = 0
    for block in BLOCKS:
        if block.mark == 'not run':
            continue
        said = iter(answer(block, env))
        for shown in (block.shown or '').splitlines():
            if shown.strip() not in ('', '...'):
                assert any(alike(shown, line) for line in said), shown
                compared += 1
    assert compared >= 60
    made = {file.name for file in tmp_path.iterdir() if file.stat().st_size > 1000}
    assert {'four_bar.svg', 'good.mcap', 'worn.mcap', 'worn.html', 'hardest.svg'} <= made


def test_the_table_says_what_the_outputs_say():
    """Each of its numbers is one of an output above it, rounded, and the last is their ratio."""
    page = (ROOT / 'docs' / 'tutorial.md').read_text(encoding='utf-8')
    outputs = ''.join(block.shown or '' for block in BLOCKS)
    shown = {float(f'{float(number):.2g}') for number in NUMBER.findall(outputs)}
    rows = list(TABLE.finditer(page))
    assert len(rows) == 11
    for row in rows:
        good, worn, times = (float(row[column]) for column in ('good', 'worn', 'times'))
        assert {good, worn} <= shown, row['what']
        assert worn / good == pytest.approx(times, rel=0.05), row['what']
