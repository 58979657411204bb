"""Rules of style that no linter has: names and sizes of classes, docstrings, lines of mutants."""

from __future__ import annotations

import ast
import re
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from mutants import MUTANTS

ROOT = Path(__file__).parents[2]
FILES = sorted(
    path for room in ('mechanism_sim', 'zenoh_rclpy') for path in (ROOT / room).rglob('*.py')
)
FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef
MOST_METHODS, MOST_ATTRIBUTES = 25, 20
WITHOUT_SUBJECT = re.compile(r' *r?"""(How|Where|Which|Who|Why|That|Those|Its?|As|Of|So) ')


def attributes(node: ast.ClassDef) -> set[str]:
    """Fields of a class, and what its methods assign to `self`."""
    found = {
        x.target.id
        for x in node.body
        if isinstance(x, ast.AnnAssign) and isinstance(x.target, ast.Name)
    }
    stored = (x for x in ast.walk(node) if isinstance(x, ast.Attribute))
    for x in stored:
        own = isinstance(x.value, ast.Name) and x.value.id == 'self'
        if own and isinstance(x.ctx, ast.Store):
            found.add(x.attr)
    return found


# To parse all files takes seconds: those are parsed where a class may be too large by its text,
# which is that of all up to the next class beside it.
CLASS = re.compile(r'^( *)class (\w+)[:(\[]', re.M)
NAMED = re.compile(
    r'\bself\.(\w+)(?=\s*(?:=(?!=)|[-+*/%@&|^<>]{1,2}=|[:,)\]]|in\b|\n))|^\s+(\w+)\s*:', re.M
)


def may_be_large(text: str) -> bool:
    """True if a class of a file may have too many methods or attributes."""
    found = list(CLASS.finditer(text))
    for k, this in enumerate(found, 1):
        after = (x.start() for x in found[k:] if len(x[1]) <= len(this[1]))
        own = text[this.start() : next(after, len(text))]
        if len(re.findall(r'\bdef\b', own)) > MOST_METHODS:
            return True
        if len(set(NAMED.findall(own))) > MOST_ATTRIBUTES:
            return True
    return False


def test_names_of_classes_are_unique():
    own = [
        name
        for path in FILES
        if path.relative_to(ROOT).parts[0] == 'mechanism_sim'
        for _, name in CLASS.findall(path.read_text(encoding='utf-8'))
    ]
    assert len(own) > 500
    assert [name for name, count in Counter(own).items() if count > 1] == []


@pytest.mark.parametrize('words', ['What', 'Whether', 'The same'])
def test_titles_are_noun_phrases_or_imperatives(words):
    """Also of attributes and of keys: any text of several quotes that stands by itself."""
    found = [
        f'{path.relative_to(ROOT)}:{number}'
        for path in FILES
        for number, line in enumerate(path.read_text(encoding='utf-8').splitlines(), 1)
        if line.strip().removeprefix('r').startswith(f'"""{words} ')
    ]
    assert not found, f"begin them otherwise than with '{words}'"


def test_titles_have_their_subject():
    """Titles of modules, classes and functions, which readers of an index see alone."""
    found = []
    for path in FILES:
        lines = path.read_text(encoding='utf-8').splitlines()
        for before, line in pairwise([':', *lines]):
            if before.endswith(':') and WITHOUT_SUBJECT.match(line):
                found.append(f'{path.relative_to(ROOT)}: {line.strip()}')
    assert found == []


def test_classes_are_small():
    found = []
    for path in FILES:
        text = path.read_text(encoding='utf-8')
        for node in ast.walk(ast.parse(text)) if may_be_large(text) else ():
            if not isinstance(node, ast.ClassDef):
                continue
            methods = sum(isinstance(x, FUNCTIONS) for x in node.body)
            count = len(attributes(node))
            if methods > MOST_METHODS or count > MOST_ATTRIBUTES:
                found.append(f'{path.name}: {node.name}: {methods} methods, {count} attributes')
    assert found == []


def test_the_counts_see_what_is_there():
    node = ast.parse('class A:\n    x: int\n    def f(self):\n        self.y = self.z = 1').body[0]
    assert isinstance(node, ast.ClassDef)
    assert attributes(node) == {'x', 'y', 'z'}
    stored = ''.join(f'        self.x{k} = 0\n' for k in range(MOST_ATTRIBUTES))
    assert not may_be_large(f'class A:\n    def f(self):\n{stored}')
    assert may_be_large(f'class A:\n    y: int\n    def f(self):\n{stored}')
    assert may_be_large('class A:\n' + '    def f(self): ...\n' * (MOST_METHODS + 1))


def test_every_mutant_is_of_a_line_that_stands_once_in_its_file():
    """`python -m test.mutants`, which takes long and is seldom run, ends at another."""
    texts = {m: (ROOT / 'mechanism_sim' / m.file).read_text(encoding='utf-8') for m in MUTANTS}
    assert [m[:2] for m, text in texts.items() if text.count(m.right) != 1] == []
