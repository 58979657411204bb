"""Summaries as data: a run has the same rows in a terminal, a notebook and on its page."""

from __future__ import annotations

import re
from html import unescape

import pytest

import mechanism_sim as ms
from mechanism_sim.analysis.record import Record
from mechanism_sim.pages.recorded import recorded
from mechanism_sim.pages.report import page
from mechanism_sim.report.rich import html as in_notebook
from mechanism_sim.report.sections import Section, SummaryRow, amount, html, text
from mechanism_sim.report.summary import facts, sections
from mechanism_sim.results.turns import ImpactAccumulator


@pytest.fixture(scope='module')
def machine():
    return ms.load_scene('four_bar_clearance')


@pytest.fixture(scope='module')
def record(machine):
    return Record(machine, ms.simulate(machine, duration=0.2), {})


def test_a_terminal_and_a_notebook_show_the_rows_of_a_run(machine, record):
    rows = {row.label: row.text for row in facts(record)}
    notebook = in_notebook(record.piece)
    for label, value in rows.items():
        assert f'<td>{label}</td><td>{value}</td>' in unescape(notebook)
    accumulator = ImpactAccumulator(machine)
    run = ms.stream(machine, duration=0.2, observers=[accumulator.add]).finish()
    lines = text(sections(run, accumulator)).splitlines()
    shown = dict(re.split(r' {2,}', line.strip(), maxsplit=1) for line in lines[1:15])
    common = shown.keys() & rows.keys() - {'time', 'compilation', 'CPU time'}
    assert {'steps', 'impacts', 'normal impulse', 'losses of contact', 'energy'} < common
    assert {label: shown[label] for label in common} == {label: rows[label] for label in common}


def test_the_header_of_a_page_has_its_rows_and_cuts_the_digest(record):
    rows = {row.label: row.text for row in facts(record)}
    shown = unescape(page(recorded(record), source='run.mcap'))
    for label in ('time', 'model', 'impacts', 'tolerances'):
        assert f'<dt>{label.capitalize()}</dt><dd>{rows[label]}</dd>' in shown
    digest = record.digest()
    assert f'<dt>Digest</dt><dd title="{digest}">{digest[:12]}…</dd>' in shown
    assert '<dt>Recorded in</dt><dd>run.mcap</dd>' in shown


def test_the_digest_of_a_part_is_not_taken_for_that_of_the_run(record):
    part = record.between(0.1, 0.15)
    rows = {row.label: row.value for row in facts(part)}
    assert rows['digest of this part'] == part.digest() != record.digest()
    assert 'digest' not in rows
    shown = unescape(page(recorded(part)))
    assert f'<dt>Digest of this part</dt><dd title="{part.digest()}">' in shown
    shown = unescape(page(recorded(part), digest=record.digest()))
    assert f'<dt>Digest</dt><dd title="{record.digest()}">' in shown


def test_sections_go_on_without_a_title_and_long_tables_end_in_notebooks():
    first = Section('one', [amount('impulse', 0.002, 'N s', words='small'), SummaryRow('n', '3')])
    more = Section(table=[('x', 'y'), ('a', 1.5)], notes=['said'])
    assert text([first, Section(), more, Section('two', notes=['so'])]).splitlines() == [
        'one', '  impulse  2 mN s (small)', '  n        3', '  x    y', '  a  1.5', 'said', '',
        'two', '  so',
    ]  # fmt: skip
    long = html([Section(table=[(f'<{k}>', k) for k in range(50)])])
    assert long.count('<tr>') == 40
    assert '&lt;0&gt;' in long
    assert '<p>and 10 more rows</p>' in long
