"""Long tables of measurements: made from docs/pictures when the site is built."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from benchmarks import pages
from test.hard import report as hard
from test.hard.case import Figure, Outcome, cases

DOCS = Path(__file__).parents[1]
HARD = DOCS / 'pictures' / 'hard_cases.json'


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx: the tables are appended to their pages."""
    app.connect('source-read', _append)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _append(_app: Any, page: str, source: list[str]) -> None:
    if page == 'docs/benchmarks':
        source[0] += '\n' + pages.page()
    elif page == 'docs/hard_cases':
        source[0] += hard_cases()


def hard_cases() -> str:
    """Every hard case with its figures, as `python -m test.hard --json` gave them."""
    rows = json.loads(HARD.read_text(encoding='utf-8'))['cases']
    outcomes = []
    for case in cases():
        figures = [
            Figure(
                row['measured'],
                math.nan if row['figure'] is None else row['figure'],
                math.inf if row['bound'] is None else row['bound'],
                row['unit'],
            )
            for row in rows
            if row['name'] == case.name
        ]
        outcomes.append(Outcome(case, tuple(figures), 0.0))
    return '\n' + hard.markdown(outcomes).partition('\n\n')[2].partition('\n\n')[2]
