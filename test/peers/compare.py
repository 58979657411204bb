"""CPU time per revolution of this package and of the SciPy event loop beside it, in one run.

`python test/peers/compare.py` runs the centred start with e = 0.5 over one revolution, the two in
turn, and prints for each tolerance minimum and median of their CPU times, the ratio of the minima,
and the error of the final angles against the reference in 256-bit arithmetic. The time is that of
the event loop, compilation apart; both loops keep what they need to answer at any instant.
"""

from __future__ import annotations

import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy_event_loop

import mechanism_sim as ms

REPEATS = 9
REFERENCE = Path(__file__).parents[1] / 'references' / 'four_bar_centred_e05.json'


def cpu_time(work: Callable[[], object]) -> float:
    """CPU time [ms] of a call."""
    began = time.process_time()
    work()
    return 1e3 * (time.process_time() - began)


def main() -> None:
    """Print the table."""
    states = json.loads(REFERENCE.read_text())['states']
    final = np.array([float(states['th3'][-1]), float(states['th4'][-1])])
    print('rtol    | this: min, median [ms], error | SciPy: min, median [ms], error | ratio')
    for rtol in (1e-6, 1e-8, 1e-10, 1e-12):
        machine = ms.load_scene('four_bar_clearance', {'start': 'centred', 'solver.rtol': rtol})
        machine.prepare()
        ours, theirs = [], []
        for _ in range(REPEATS):
            run = machine.start()
            end = machine.period
            ours.append(cpu_time(lambda run=run, end=end: run.advance(end, final=True)))
            results: list[scipy_event_loop.Result] = []
            theirs.append(
                cpu_time(
                    lambda results=results, rtol=rtol: results.append(
                        scipy_event_loop.simulate(0.5, 1.0, rtol, 'centred')
                    )
                )
            )
        motion, _, _ = run.drain()
        last = motion.curve(np.array([motion.curve.end]))[0, 1:]
        errors = [np.abs(x - final).max() for x in (last, np.array(results[0].final[1:3]))]
        print(
            f'{rtol:7.0e} | {min(ours):7.3f} {statistics.median(ours):7.3f} {errors[0]:9.1e} | '
            f'{min(theirs):8.2f} {statistics.median(theirs):8.2f} {errors[1]:9.1e} | '
            f'{min(theirs) / min(ours):5.1f}'
        )


if __name__ == '__main__':
    main()
