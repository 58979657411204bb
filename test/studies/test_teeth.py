"""Numbers of teeth for a ratio, against brute force and [V] 5."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import product

import pytest

from mechanism_sim.errors import InputError
from mechanism_sim.studies.teeth import FEWEST, TrainSearch


def choose(*args, **limits):
    return TrainSearch(*args, **limits).found


@pytest.mark.parametrize('stages', [1, 2])
@pytest.mark.parametrize('distance', [None, 40e-3])
@pytest.mark.parametrize('wanted', [2.0, 1 / 3, 2.718])
def test_choice_of_teeth_against_brute_force(stages, distance, wanted):
    tolerance, modules = 0.03, (1.5e-3, 2e-3, 2.5e-3)
    counts = range(12, 31)
    pairs = [
        (a, b, m)
        for a in counts
        for b in counts
        for m in (modules if distance else (None,))
        if m is None or abs(m * (a + b) / 2 - distance) < 1e-6
    ]
    brute = {
        train
        for train in product(pairs, repeat=stages)
        if abs(math.prod(b / a for a, b, _ in train) / wanted - 1) <= tolerance
    }
    options = {'stages': stages, 'tolerance': tolerance, 'teeth': (12, 30)}
    if distance:
        options |= {'centre_distance': distance, 'modules': modules}
    if not brute:
        with pytest.raises(InputError, match='nearest'):
            choose(wanted, **options)
        return
    found = choose(wanted, **options)
    assert len(found) == len(brute)
    assert {c.stages for c in found} == brute
    ranks = [(abs(c.error), c.teeth) for c in found]
    assert ranks == sorted(ranks)
    for choice in found:
        assert choice.ratio == math.prod(
            (Fraction(b, a) for a, b, _ in choice.stages), start=Fraction(1)
        )


def test_teeth_of_problem_6():
    """[V] 5, problem 6: module 4 mm, centre distance 136 mm, 3:1."""
    (choice,) = choose(3.0, teeth=(12, 120), centre_distance=0.136, modules=(4e-3,))
    assert choice.stages == ((17, 51, 4e-3),)
    assert choice.error == 0.0
    assert choose(0.1, teeth=(18, 180))[0].stages == ((180, 18, None),)


@pytest.mark.parametrize('distance', [None, 0.136])
def test_the_pair_just_outside_is_the_least_step_away(distance):
    """Against all pairs of a wide range; [V] 5, problem 6 has 17 teeth, one less than 18."""
    modules = (4e-3, 2e-3) if distance else ()
    for ratio, teeth in ((Fraction(3), (18, 120)), (Fraction(7, 2), (20, 69)), (1, (9, 12))):
        found = TrainSearch(ratio, 1, 0.0, teeth, distance, modules).outside
        steps = {}
        for a in range(FEWEST, 2 * teeth[1] + 1):
            b = ratio * a
            fits = not distance or any(round(2 * distance / m, 6) == a + b for m in modules)
            if b.denominator == 1 and FEWEST <= b <= 2 * teeth[1] and fits:
                steps[a, int(b)] = max(teeth[0] - min(a, b), max(a, b) - teeth[1])
        outside = {pair: step for pair, step in steps.items() if step > 0}
        assert (found is None) == (not outside)
        if found:
            assert outside[found[:2]] == min(outside.values())
    if distance:
        found = TrainSearch(3, centre_distance=distance, modules=modules).outside
        assert found[:2] == (17, 51)


@pytest.mark.parametrize(
    ('ratio', 'limits', 'sentence'),
    [
        (-1.0, {}, 'a ratio must be positive'),
        (9.0, {}, 'the nearest is 6.66667'),
        (2.0, {'centre_distance': 0.1}, 'belong together'),
        (2.0, {'centre_distance': 0.1001, 'modules': (1e-3,)}, 'centre distance'),
        (2.0, {'stages': 4}, 'too many'),
        pytest.param(
            2.0, {'stages': 2, 'tolerance': 0.4, 'teeth': (18, 70)}, 'more than 100000',
            marks=pytest.mark.slow,
        ),
    ],
)  # fmt: skip
def test_searches_that_cannot_be_are_refused(ratio, limits, sentence):
    with pytest.raises(InputError, match=sentence):
        choose(ratio, **limits)
