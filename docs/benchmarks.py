"""The page of the benchmark: ``python docs/benchmarks.py [NAME...]``.

Measures the problems named, all of them and the costs by size if none is (some ten minutes), and
writes docs/benchmarks.md from what lies in docs/pictures; ``--page`` only writes. Run it on a
quiet machine.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from mechanism_sim.bench.choose import SCALING
from mechanism_sim.bench.problem import OURS, problems

HERE = Path(__file__).parent
PICTURES = HERE / 'pictures'

INTRODUCTION = f"""\
# Benchmarks

What accuracy costs, here and elsewhere, measured in one run on one machine. `mechanism-sim bench
NAME...` measures anywhere; `mechanism-sim bench` lists the problems and the peers found; `pip
install 'mechanism_sim[peers]'` installs those that are on PyPI. This page is made by
`python docs/benchmarks.py`.

* The error is that of the final answer against a reference computed by a second route: 256-bit
  power series, 50-digit Newton-Euler equations, a quadrature, flights in closed form. Its source
  stands above each table.
* CPU time is that of the process (a peer in a process of its own tells its own), per unit, without
  preparation; all methods are run in turn, repeat by repeat, so that a noisy moment hits all
  alike. Quick runs are measured in batches of 5 ms. A method that has used 3 s at a setting is
  not repeated there. The table has the fastest and the median.
* What is prepared once (compilation, building of models) is in the last column. Caches of compiled
  code are switched off for it. numba compiles at its first setting only.
* `{OURS}` records its whole motion as polynomials, and every impact with its figures; the peers
  keep no more than the final angles, or the times of impacts, need.
* Under each table: the CPU time of each method over that of `{OURS}`, both at their cheapest
  setting that reaches the error stated. A peer that does not reach it is compared at its own best
  error, which luck may flatter where errors do not fall steadily.
* The machine is named under each table. It was a shared one with other work going on: times vary
  by a third, ratios within a table by less.
"""

SIZES = """\
## Cost against size

Links: a crank and pairs of coupler and rocker, each driven by the rocker before it
(`mechanism_sim/bench/chains.py`), three revolutions; the number of links counts the ground. With
positions only, with all joint forces, by equations of motion with a free crank, and with one loose
joint at the far end. Getting ready is building and compiling its equations for the first time;
heyoka keeps the code on disk, so the next process is faster.

Loose joints: 20 revolutions of the thesis mechanism with one to four loose joints, e = 0.5; each
loose joint adds impacts that shake the others. Memory: what Python and NumPy hold at most, where
all motion is kept; that of the whole process for nodes, which keep nothing.
"""


def section(title: str, name: str, words: str) -> str:
    """A heading, the command, the picture and the table."""
    table = (PICTURES / f'{name}.txt').read_text(encoding='utf-8')
    shown = f'![{title}](pictures/{name}.svg)\n\n'
    command = f'`mechanism-sim bench {name} --output docs/pictures`'
    return f'{words}{command}\n\n{shown}```\n{table}```\n'


def page() -> str:
    """The page, of what has been measured."""
    parts = [INTRODUCTION]
    for name, problem in problems().items():
        if (PICTURES / f'{name}.txt').exists():
            how = '\n'.join(f'* {m.name}: {m.how}' for m in problem.methods)
            words = f'## {problem.title}\n\n'
            parts.append(section(problem.title, name, words) + f'\n{how}\n')
    if (PICTURES / f'{SCALING}.txt').exists():
        parts.append(section('Cost against size', SCALING, SIZES + '\n'))
    return '\n'.join(parts)


def main() -> None:
    """Measure, and write the page."""
    names = sys.argv[1:] or [*problems(), SCALING]
    if names != ['--page']:
        command = [sys.executable, '-m', 'mechanism_sim', 'bench', *names, '--output', PICTURES]
        subprocess.run(command, check=True)  # noqa: S603 - our own command
    (HERE / 'benchmarks.md').write_text(page(), encoding='utf-8')


if __name__ == '__main__':
    main()
