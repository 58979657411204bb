"""Blocks of README and docs are run, and their output compared with what the pages show."""

from __future__ import annotations

import re
import shlex

import pytest
from blocks import Block, blocks, commands, compare, pages, run, words, workplace
from running import ROOT

from mechanism_sim.cli.entry import make_parser
from test.grid.command import make_parser as grid_parser
from zenoh_rclpy.commands import make_parser as zros_parser

PAGES = {page: blocks(page) for page in pages()}
EXERCISES = 'docs/exercises.md'  # a test for each chapter


def chapters(page: str) -> dict[str, list[Block]]:
    """Blocks of a page by its headings of the second level."""
    found: dict[str, list[Block]] = {}
    lines = (ROOT / page).read_text('utf-8').splitlines()
    begins = [k for k, line in enumerate(lines) if line.startswith('## ')]
    for begin, end in zip(begins, [*begins[1:], len(lines)], strict=True):
        within = [block for block in PAGES[page] if begin < block.line <= end]
        found[f'{page}: {lines[begin].removeprefix("## ")}'] = within
    assert sum(map(len, found.values())) == len(PAGES[page])
    return found


PAGES |= chapters(EXERCISES)
del PAGES[EXERCISES]
ELSEWHERE = {'docs/tutorial.md'}  # test_tutorial.py follows it word by word
NOT_RUN = [block for found in PAGES.values() for block in found if block.mark == 'not run']


SLOW = {
    'docs/exercises.md: Chapter 2: kinematics',
    'docs/exercises.md: Chapter 3: forces',
    *(
        f'docs/{page}.md'
        for page in (
            'analysis',
            'faq',
            'linkages',
            'looking',
            'mechanisms',
            'topics',
        )
    ),
    *(
        f'docs/{page}.md'
        for page in ('accuracy', 'studies', 'howto/machine_learning', 'howto/my_mechanism')
    ),
}


@pytest.mark.sample(3)
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    'page',
    [
        pytest.param(p, marks=[pytest.mark.slow] * (p in SLOW))
        for p, found in PAGES.items()
        if set(found) - set(NOT_RUN) and p not in ELSEWHERE
    ],
)
def test_what_a_page_says_can_be_run(page, tmp_path, monkeypatch):
    for name, value in workplace(tmp_path).items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(tmp_path)
    names = {'__name__': 'page'}
    for block in PAGES[page]:
        if block.mark != 'not run':
            run(block, names)


def test_few_blocks_are_not_run():
    reasons = {block.place: block.reason for block in NOT_RUN}
    for place, reason in reasons.items():
        print(f'{place}: {reason}')
    with_ros = sum(reason == 'needs ROS 2' for reason in reasons.values())
    assert len(reasons) - with_ros <= 12


@pytest.mark.parametrize('block', NOT_RUN, ids=lambda block: block.place)
def test_commands_that_are_not_run_are_understood(block: Block):
    for line, _ in commands(block):
        for command in re.split(r'&&|[;&|]', line):
            if command.strip().startswith('mechanism-sim'):
                make_parser().parse_known_args(words(command))
            elif command.strip().startswith('python -m test.grid'):
                assert not grid_parser().parse_known_args(command.split('#')[0].split()[3:])[1]
            if command.strip().startswith('zros '):
                zros_parser().parse_args(shlex.split(command)[1:])


def test_make_has_the_targets_that_pages_name():
    targets = re.findall(r'^(\w+):', (ROOT / 'Makefile').read_text('utf-8'), re.MULTILINE)
    named = re.findall(r'^make (\w+)', (ROOT / 'README.md').read_text('utf-8'), re.MULTILINE)
    assert {'run', 'test', 'docs'} <= set(named) <= set(targets)


# --- how output is compared -------------------------------------------------------------------


@pytest.mark.parametrize(
    ('shown', 'printed'),
    [
        ('a 1.25 m\n', 'a  1.25 m\n'),
        ('a 1.25 m\n', 'a 1.26 m\n'),
        ('a 1.25 m\n', 'a 1.2512 m\n'),
        ('a 2e-13 m\n', 'a 1e-13 m\n'),
        ('...\nlast 5\n', 'first\nsecond\nlast 5\n'),
        ('first\n...\n', 'first\nsecond\nlast 5\n'),
        ('first\n...\nlast 5\n', 'first\nlast 5\n'),
    ],
)
def test_output_that_is_the_same(shown, printed):
    compare(shown, printed, False, 'here')


@pytest.mark.parametrize(
    ('shown', 'printed'),
    [
        ('a 1.25 m\n', 'a 1.28 m\n'),
        ('a 1.25 m\n', 'a 1.25 mm\n'),
        ('5 impacts\n', '6 impacts\n'),
        ('first\n', 'first\nsecond\n'),
        ('...\nlast\n', 'last\nfirst\n'),
        ('first\n...\nthird\n', 'second\nthird\n'),
    ],
)
def test_output_that_is_not(shown, printed):
    with pytest.raises(AssertionError, match='does not print'):
        compare(shown, printed, False, 'here')


def test_words_are_compared_where_numbers_vary():
    compare('5 impacts at -1.5 s\n', '17 impacts at 3 s\n', True, 'here')
    with pytest.raises(AssertionError):
        compare('5 impacts\n', '5 flights\n', True, 'here')
