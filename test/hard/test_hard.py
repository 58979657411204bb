"""Every hard case keeps its bounds; what each is about stands in the case itself."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from running import run as command
from running import run_json

from test.hard.case import cases, run
from test.hard.command import main

SLOW = {
    'a_million_revolutions_later', 'closure_after_five_thousand_revolutions', 'cut_anywhere',
    'flywheel_and_clearance', 'forty_windows_in_a_line', 'four_loose_joints',
    'friction_in_four_joints',
    'hundred_thousand_revolutions', 'kane_in_a_bearing',
    'loss_of_contact_at_every_tolerance', 'measured_law', 'near_a_change_point',
    'near_the_change_point', 'rigid_limit_of_hertz', 'statistics_at_every_tolerance',
    'stiff_motor', 'ten_links_two_loose_joints', 'ten_thousand_revolutions',
    'ten_thousand_swings', 'thousand_indexings', 'to_the_last_bit', 'triggers_of_any_motion',
}  # fmt: skip


def marked():
    found = cases()
    assert {case.name for case in found} >= SLOW
    return [
        pytest.param(case, marks=[pytest.mark.slow] * (case.name in SLOW), id=case.name)
        for case in found
    ]


@pytest.mark.sample(8)
@pytest.mark.parametrize('case', marked())
def test_hard_case(case):
    (outcome,) = run((case,))
    assert not outcome.failure
    assert outcome.figures
    broken = [f'{f.name} = {f.value:.6g} {f.unit}, bound {f.bound:g}'
              for f in outcome.figures if not f.ok]  # fmt: skip
    assert not broken


def test_the_command(tmp_path):
    page = tmp_path / 'page.md'
    found = run_json('free_shaft', '--markdown', str(page), program=main)['cases']
    assert {row['name'] for row in found} == {'free_shaft'}
    assert all({'figure', 'bound', 'ok'} <= {*row} and row['ok'] for row in found)
    assert '## free_shaft' in page.read_text()
    for arguments, said in (
        (('free_shafts',), "did you mean 'free_shaft'"),
        (('free_shaft', '--markdown', str(tmp_path / 'no' / 'page.md')), 'no such folder'),
    ):
        done = command(*arguments, program=main)
        assert done.returncode == 2
        assert said in done.stderr


@pytest.mark.slow
def test_the_program_without_pytest(pytestconfig):
    """`python -m test.hard` finds all its modules without the paths that pytest adds."""
    environment = {k: v for k, v in os.environ.items() if k != 'PYTHONPATH'}
    done = subprocess.run(
        [sys.executable, '-m', 'test.hard', 'free_shafts'],
        cwd=pytestconfig.rootpath, env=environment, capture_output=True, text=True, check=False,
        timeout=300,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert "did you mean 'free_shaft'" in done.stderr
