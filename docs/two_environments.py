"""Compare two pages of the thesis's experiment, made in two environments.

    python docs/two_environments.py PAGE OTHER_PAGE

Every figure has to overlap with that of the other page, and no conclusion may be reversed. Those
that are decided on one page only are named. Exit code 1 if something is wrong.
"""

import re
import sys
from itertools import pairwise
from pathlib import Path

TABLE = re.compile(
    r'^<!-- experiment: ([^\n]+?) -->\n\n(.+?)\n\n<!-- /experiment -->$', re.M | re.S
)
FIGURE = re.compile(r'(-?\d[\d.]*) \+- ([\d.]+)')

Interval = tuple[float, float]


def lines(page: Path) -> list[tuple[str, str]]:
    """Names of tables, and their lines."""
    return [
        (name, line)
        for name, table in TABLE.findall(page.read_text('utf-8'))
        for line in table.splitlines()
    ]


def figures(line: str) -> list[Interval]:
    """Intervals of a line, lower and upper ends."""
    return [(float(x) - float(h), float(x) + float(h)) for x, h in FIGURE.findall(line)]


def order(before: Interval, after: Interval) -> int:
    """1 if the second lies above the first, -1 below, 0 if they overlap."""
    return (after[0] > before[1]) - (after[1] < before[0])


def main(here: Path, there: Path) -> int:
    """Print the differences, and the number of comparisons."""
    compared, wrong, undecided, conclusions, ours, theirs = 0, [], [], 0, lines(here), lines(there)
    if [name for name, _ in ours] != [name for name, _ in theirs]:
        sys.exit('the pages have other tables')
    for (table, one), (_, other) in zip(ours, theirs, strict=True):
        both = figures(one), figures(other)
        pair = f'{table}:\n  {one}\n  {other}'
        if len(both[0]) != len(both[1]) or any(map(order, *both)):
            wrong.append(pair)
        if table != 'claims':
            compared += len(both[0])
            continue
        # figures stand in pairs, the first under one condition, the second under another
        steps = list(
            zip(*([order(*x) for x in list(pairwise(f))[::2]] for f in both), strict=True)
        )
        conclusions += len(steps)
        if any(a * b < 0 for a, b in steps):
            wrong.append(pair)
        elif any(a != b for a, b in steps):
            undecided.append(pair)
    for title, found in (('wrong', wrong), ('decided on one page only', undecided)):
        print(*(f'{title}: {x}' for x in found), sep='\n', end='\n' * bool(found))
    print(f'{compared} figures and {conclusions} comparisons, {len(wrong)} lines are wrong')
    return 1 if wrong or not compared else 0


if __name__ == '__main__':
    sys.exit(main(*map(Path, sys.argv[1:])))
