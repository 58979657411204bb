"""Rules of style that no linter has: names of classes, their size, first words of docstrings."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted(
    path for room in ('mechanism_sim', 'zenoh_rclpy') for path in (ROOT / room).rglob('*.py')
)
FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef
MOST_METHODS, MOST_ATTRIBUTES = 25, 20


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


@pytest.fixture(scope='module')
def classes():
    """Files and classes: trees of all files are a million objects, too many for other tests."""
    return [
        (path.relative_to(ROOT), node)
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
        if isinstance(node, ast.ClassDef)
    ]


def test_names_of_classes_are_unique(classes):
    own = [node.name for path, node in classes if path.parts[0] == 'mechanism_sim']
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
    assert found == []


def test_classes_are_small(classes):
    found = []
    for path, node in classes:
        methods = sum(isinstance(x, FUNCTIONS) for x in node.body)
        count = len(attributes(node))
        if methods > MOST_METHODS or count > MOST_ATTRIBUTES:
            found.append(f'{path}: {node.name}: {methods} methods, {count} attributes')
    assert found == []


def test_the_counts_see_what_is_there():
    node = ast.parse('class A:\n    x: int\n    def f(self):\n        self.y = self.z = 1').body[0]
    assert isinstance(node, ast.ClassDef)
    assert attributes(node) == {'x', 'y', 'z'}
