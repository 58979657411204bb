"""Examples in docstrings of public functions, run as they stand."""

from __future__ import annotations

import doctest
import importlib
import inspect
import runpy

import pytest
from running import ROOT

import mechanism_sim as ms
from mechanism_sim.pages.writing import report
from mechanism_sim.results.run import Piece

FUNCTIONS = {
    name: found
    for name in ms.__all__
    if inspect.isfunction(found := {'report': report}.get(name, getattr(ms, name)))
}


SLOW = {'branches', 'find_four_bars', 'life', 'sweep', 'lyapunov'}
"""Of what test/studies tries on lighter machines."""


@pytest.mark.sample(16)
@pytest.mark.parametrize(
    'name', [pytest.param(x, marks=[pytest.mark.slow] * (x in SLOW)) for x in FUNCTIONS]
)
def test_every_public_function_has_an_example_that_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = FUNCTIONS[name]
    space = vars(importlib.import_module(found.__module__))
    (test,) = doctest.DocTestFinder(recurse=False).find(found, name, globs=dict(space))
    assert test.examples, name
    result = doctest.DocTestRunner().run(test)
    assert result.failed == 0


@pytest.mark.parametrize('kind', [ms.Scene, Piece], ids=lambda kind: kind.__name__)
def test_examples_of_classes_run(kind):
    tests = doctest.DocTestFinder().find(kind, kind.__name__, globs={})
    tests = [test for test in tests if test.examples]
    assert tests
    assert all(doctest.DocTestRunner().run(test).failed == 0 for test in tests)


def test_editors_know_the_signatures():
    """As `python docs/signatures.py` writes them."""
    space = runpy.run_path(str(ROOT / 'docs' / 'signatures.py'))
    assert space['FILE'].read_text(encoding='utf-8') == space['text']()
