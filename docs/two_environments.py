"""Compare two pages of the thesis's experiment, made in two environments.

    python docs/two_environments.py PAGE OTHER_PAGE

Every figure has to overlap with that of the other page, and no comparison of the conclusions may
be reversed. Those that are decided on one page only are named. Exit code 1 if something is wrong.
"""

import re
import sys
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


def outcomes(line: str) -> dict[str, str]:
    """Comparisons of a conclusion, each with its outcome."""
    cell = line.strip('|').split('|')[-1].strip()
    by_outcome = (part.partition(': ') for part in cell.split('; '))
    return {where: outcome for outcome, _, all_ in by_outcome for where in all_.split(', ')}


def main(here: Path, there: Path) -> int:
    """Print the differences, and the number of comparisons."""
    compared, wrong, undecided, conclusions, ours, theirs = 0, [], [], 0, lines(here), lines(there)
    if [name for name, _ in ours] != [name for name, _ in theirs]:
        sys.exit('the pages have other tables')
    for (table, one), (_, other) in zip(ours, theirs, strict=True):
        pair = f'{table}:\n  {one}\n  {other}'
        if table != 'claims':
            both = figures(one), figures(other)
            compared += len(both[0])
            if len(both[0]) != len(both[1]) or any(map(order, *both)):
                wrong.append(pair)
        elif ': ' in one:
            ends = outcomes(one), outcomes(other)
            conclusions += len(ends[0])
            found = [{ends[0][where], ends[1].get(where)} for where in ends[0]]
            if ends[0].keys() != ends[1].keys() or {'more', 'less'} in found:
                wrong.append(pair)
            elif any(len(both) > 1 for both in found):
                undecided.append(pair)
    for title, found in (('wrong', wrong), ('decided on one page only', undecided)):
        print(*(f'{title}: {x}' for x in found), sep='\n', end='\n' * bool(found))
    print(f'{compared} figures and {conclusions} comparisons, {len(wrong)} lines are wrong')
    return 1 if wrong or not compared else 0


if __name__ == '__main__':
    sys.exit(main(*map(Path, sys.argv[1:])))
