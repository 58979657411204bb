"""`teeth` and `profile`: parts of machines on the command line."""

from __future__ import annotations

from fractions import Fraction
from math import prod

import pytest
from running import run, run_json


def test_teeth_are_ranked_by_their_error():
    found = run_json('teeth', '3.14159265', '--stages', '2', '--tolerance', '1e-6')
    assert found['count'] == len(found['choices']) == 36
    for choice in found['choices']:
        ratio = prod(Fraction(s['driven'], s['driver']) for s in choice['stages'])
        assert choice['exact_ratio'] == str(ratio)
        assert choice['error'] == pytest.approx(float(ratio) / 3.14159265 - 1, abs=1e-15)
    ranks = [(abs(c['error']), c['teeth']) for c in found['choices']]
    assert ranks == sorted(ranks)
    assert found['choices'][0]['exact_ratio'] == '355/113'
    shown = run('teeth', '3.14159265', '--stages', '2', '--tolerance', '1e-6').stdout.splitlines()
    assert shown[-1] == '36 trains found, the first 20 are shown'
    assert len(shown) == 22


def test_teeth_fill_a_centre_distance():
    options = ('--centre-distance', '90 mm', '--modules', '2 mm,2.5 mm')
    found = run_json('teeth', '7/2', *options)
    [choice] = found['choices']
    assert choice['stages'] == [{'driver': 20, 'driven': 70, 'module': 2e-3}]
    assert choice['error'] == 0.0
    assert '20:70 (2 mm)' in run('teeth', '7/2', *options).stdout


@pytest.mark.parametrize(
    ('args', 'says'),
    [
        (('1e400',), "'1e400' is not a ratio"),
        (('1/0',), "'1/0' is not a ratio"),
        (('3', '--teeth', '20'), 'write for example 18:120'),
        (('3', '--teeth', '3:9999'), 'the range of teeth is too wide'),
        (('3', '--stages', '99'), '99 stages are too many'),
        (('3', '--centre-distance', '60'), 'not a quantity with a unit'),
        (('3', '--centre-distance', '60 mm'), 'belong together'),
        (('3.14159265',), 'the nearest is 3.14286'),
    ],
)
def test_teeth_that_cannot_be_are_refused(args, says):
    done = run('teeth', *args)
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count('\n') == 1
