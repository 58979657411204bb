"""Conclusions of [SB] on clearance, speed and restitution, compared with means over starts.

Two figures differ if their confidence intervals do not overlap; otherwise it is undecided
which is the larger. So conclusions drawn here hold for other starts and processors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from mechanism_sim.thesis.experiment import Experiment, Interval, Repeats, mm, rpm

MORE, LESS, UNDECIDED = 'more', 'less', 'not decided'
SAME = 'the same'
"""Verdict on two figures that [SB] calls equal: intervals can only speak against it."""


class Comparison(NamedTuple):
    """A figure under two conditions."""

    where: str  #: common condition of both
    ends: tuple[str, str]  #: text of the differing conditions
    expected: str  #: `MORE`, `LESS` or `SAME` from the first to the second, as in [SB]; or empty
    before: Interval
    after: Interval

    @property
    def found(self) -> str:
        """`MORE`, `LESS` or `UNDECIDED` from the first to the second."""
        if self.after.above(self.before):
            return MORE
        return LESS if self.before.above(self.after) else UNDECIDED


class Claim(NamedTuple):
    """A conclusion of [SB], and the comparisons that test it."""

    text: str  #: text of the conclusion
    figure: str  #: name of the compared figure
    scale: float  #: factor of the printed figures
    comparisons: tuple[Comparison, ...]

    @property
    def verdict(self) -> str:
        """Verdict: yes, no, partly, or undecided."""
        judged = [c for c in self.comparisons if c.expected]
        decided = [c for c in judged if c.found != UNDECIDED]
        if not decided:
            return UNDECIDED
        holds = [c.found == c.expected for c in decided]
        if any(holds) and not all(holds):
            return 'in part'
        verdict = 'yes' if holds[0] else 'no'
        return verdict if len(decided) == len(judged) else f'{verdict}, where it is decided'


class _Figure(NamedTuple):
    words: str
    scale: float
    of: Callable[[Repeats], Interval]


_COUNT = _Figure('impacts a turn', 1.0, lambda x: x.impacts('count'))
_SUM = _Figure('sum of impulses [mN s]', 1e3, lambda x: x.impacts('impulse'))
_I_N = _Figure('I_n [mN s]', 1e3, lambda x: x.impacts('I_n'))
_SHOWN = _Figure('deviation of the coupler, as shown [rad/s^2]', 1.0, lambda x: x.shown())
_MEANS = _Figure(
    'deviation of the coupler, means over 0.1 deg [rad/s^2]',
    1.0,
    lambda x: x.mean(lambda t: t.severity['coupler'].by_mesh[-1]),
)


def claims(found: Experiment) -> list[Claim]:
    """Claims with runs for them."""
    made = [*_by_restitution(found), *_by_clearance(found), *_by_speed(found), *_in_time(found)]
    return [claim for claim in made if claim.comparisons]


def _by_restitution(found: Experiment) -> Iterator[Claim]:
    """Comparisons of bearings that differ from the measured one in their restitution only."""
    own = found.bearing
    runs = [
        x
        for x in found.bearings
        if x.condition.bearing._replace(restitution=0.0) == own._replace(restitution=0.0)
    ]
    ends = [f'e = {x.condition.bearing.restitution:g}' for x in runs]
    for figure in _MEANS, _SHOWN:
        steps = _steps(figure, runs, ends, '', [LESS] * (len(runs) - 1))
        yield Claim('the deviation falls with restitution', figure.words, figure.scale, steps)


def _by_clearance(found: Experiment) -> Iterator[Claim]:
    rows = {
        speed: [x for (s, _), x in found.measured.items() if s == speed] for speed in found.speeds
    }
    for text, figure, expected in (
        ('more clearance: fewer impacts (Figure 7.10)', _COUNT, LESS),
        ('more clearance: harder impacts', _I_N, MORE),
    ):
        yield Claim(text, figure.words, figure.scale, _ends(figure, rows, _rpm, _mm, expected))
    stated: tuple[tuple[int, str, dict[int, str], str], ...] = (
        (250, 'severity rises with clearance', {}, MORE),
        (300, 'severity falls from the smallest clearance to the next, stays, and rises at the '
              'largest', {1: LESS, 2: SAME, 3: MORE}, ''),
        (350, 'severity falls slightly with clearance', {}, LESS),
    )  # fmt: skip
    for at, text, by_step, expected in stated:
        for speed, runs in rows.items():
            if round(speed * 30.0 / math.pi) != at:
                continue
            for figure in (_SUM, _SHOWN) if by_step or expected == LESS else (_SUM, _I_N, _SHOWN):
                if by_step:
                    names = [_mm(x) for x in runs]
                    wanted = [by_step.get(k, '') for k in range(1, len(runs))]
                    against = _steps(figure, runs, names, '', wanted)
                else:
                    against = _ends(figure, {speed: runs}, lambda _: '', _mm, expected)
                yield Claim(f'{at} rpm: {text}', figure.words, figure.scale, against)


def _by_speed(found: Experiment) -> Iterator[Claim]:
    rows = {
        (radial, sense): [
            x
            for (s, c), x in found.measured.items()
            if c == radial and math.copysign(1, s) == sense
        ]
        for radial in found.clearances
        for sense in (1.0, -1.0)
    }
    for text, figure, expected in (
        ('more speed: more severity', _SUM, MORE),
        ('more speed: more severity', _I_N, MORE),
        ('more speed: more severity', _SHOWN, MORE),
        ('more speed: fewer impacts (Figure 7.11)', _COUNT, LESS),
    ):
        yield Claim(text, figure.words, figure.scale, _ends(figure, rows, _mm, _rpm, expected))


def _in_time(found: Experiment) -> Iterator[Claim]:
    """Comparisons of the assumed machine's sums of impulses, from its first turns to the last."""
    spans = spans_of_turns(found)
    if len(spans) > 1 and found.assumed is not found.reference:
        ends = spans[0], spans[-1]
        before, after = (found.assumed.impacts('impulse', s) for s in ends)
        names = tuple(f'turns {a} to {b}' for a, b in ends)
        where = str(found.assumed.condition.bearing)
        step = Comparison(where, (names[0], names[1]), LESS, before, after)
        yield Claim('the first turns are the severest', _SUM.words, _SUM.scale, (step,))


def spans_of_turns(found: Experiment) -> list[tuple[int, int]]:
    """Turns 0 to 1, 1 to 2, 2 to 4, 4 to 8, ... from the first impact, to the end of all runs."""
    count = min(x.turns_since_first for x in (*found.assumed.trials, *found.reference.trials))
    edges = [0, 1]
    while edges[-1] < count:
        edges.append(min(2 * edges[-1], count))
    return list(pairwise(edges))


def _rpm(x: Repeats) -> str:
    return f'{rpm(x.condition.speed)} rpm'


def _mm(x: Repeats) -> str:
    return f'{mm(x.condition.radial)} mm'


def _ends(
    figure: _Figure,
    rows: Mapping[Any, list[Repeats]],
    where: Callable[[Repeats], str],
    name: Callable[[Repeats], str],
    expected: str,
) -> tuple[Comparison, ...]:
    """Comparison of the first run of each row with its last."""
    return tuple(
        Comparison(
            where(runs[0]), (name(runs[0]), name(runs[-1])), expected, figure.of(runs[0]),
            figure.of(runs[-1]),
        )
        for runs in rows.values()
        if len(runs) > 1
    )  # fmt: skip


def _steps(
    figure: _Figure, runs: Sequence[Repeats], names: Sequence[str], where: str,
    expected: Sequence[str],
) -> tuple[Comparison, ...]:  # fmt: skip
    """Comparison of each run with the next."""
    values = [figure.of(x) for x in runs]
    return tuple(
        Comparison(where, ends, wanted, *pair)
        for ends, wanted, pair in zip(pairwise(names), expected, pairwise(values), strict=False)
    )
