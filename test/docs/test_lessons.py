"""The lessons as they are kept; the site runs them (``make docs``)."""

from __future__ import annotations

import json
import re

import pytest
from running import ROOT

LESSONS = sorted((ROOT / 'docs' / 'lessons').glob('*.ipynb'))


@pytest.mark.parametrize('file', LESSONS, ids=lambda file: file.stem)
def test_a_lesson_is_kept_without_outputs(file):
    notebook = json.loads(file.read_text(encoding='utf-8'))
    cells = notebook['cells']
    code = [cell for cell in cells if cell['cell_type'] == 'code']
    text = ''.join(line for cell in cells for line in cell['source'])
    assert (notebook['nbformat'], notebook['nbformat_minor']) == (4, 5)
    assert len({cell['id'] for cell in cells}) == len(cells) >= 10
    assert not any(cell['outputs'] or cell['execution_count'] for cell in code)
    assert 'hide-cell' in code[-1]['metadata']['tags'], 'solutions are folded'
    assert text.startswith('# ')
    for part in ('**Question.**', '## Exercises', 'assert '):
        assert part in text
    for link in re.findall(r'\]\(([^)#]+)', text):
        assert (file.parent / link).is_file(), link


def test_the_table_names_all_lessons():
    table = (ROOT / 'docs' / 'lessons' / 'README.md').read_text(encoding='utf-8')
    assert re.findall(r'\]\((\w+\.ipynb)\)', table) == [file.name for file in LESSONS]
