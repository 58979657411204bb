"""CPU time per revolution of this package and of the SciPy event loop beside it, in one run.

`python test/peers/compare.py` runs the centred start with e = 0.5 over one revolution, in turn by
this package, by `scipy_event_loop.py` as it is, tuned down to plain floats in its right-hand side,
and by the same with NumPy's functions there, as most code for SciPy is written. It prints the
minimum and median CPU times in milliseconds, the errors of the final angles against the reference
in 256-bit arithmetic, and the ratios of the minima. Compilation counts apart; all loops keep what
they need to answer at any instant.
"""

from __future__ import annotations

import importlib.util
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from types import ModuleType

import numpy as np

import mechanism_sim as ms

REPEATS = 15
HERE = Path(__file__).parent
REFERENCE = HERE.parent / 'references' / 'four_bar_centred_e05.json'


Run = Callable[[], Callable[[], np.ndarray]]
"""Does the work that is timed; what it gives then answers for the final angles."""


def cpu_times(prepare: Callable[[], Run]) -> tuple[list[float], np.ndarray]:
    """CPU times [ms] of the runs, and the final angles of the last."""
    times = []
    for run in [prepare() for _ in range(REPEATS)]:
        began = time.process_time()
        answer = run()
        times.append(1e3 * (time.process_time() - began))
    return times, answer()


def peer(numpy_functions: bool) -> ModuleType:
    """The SciPy event loop, as it is or with the functions of NumPy."""
    spec = importlib.util.spec_from_file_location('peer', HERE / 'scipy_event_loop.py')
    if spec is None or spec.loader is None:
        raise FileNotFoundError(HERE / 'scipy_event_loop.py')
    module = importlib.util.module_from_spec(spec)

    sys.modules['peer'] = module  # its dataclasses look there
    spec.loader.exec_module(module)
    if numpy_functions:
        for name, function in (
            ('sin', np.sin),
            ('cos', np.cos),
            ('hypot', np.hypot),
            ('atan2', np.arctan2),
            ('acos', np.arccos),
        ):
            setattr(module, name, function)
    return module


def ours(rtol: float) -> Callable[[], Run]:
    """One revolution by this package."""
    machine = ms.load_scene('four_bar_clearance', {'start': 'centred', 'solver.rtol': rtol})
    machine.prepare()

    def prepare() -> Run:
        loop = machine.start()  # compiles

        def run() -> Callable[[], np.ndarray]:
            loop.advance(machine.period, final=True)
            return lambda: loop.drain()[0].curve(np.array([machine.period]))[0, 1:]

        return run

    return prepare


def theirs(module: ModuleType, rtol: float) -> Callable[[], Run]:
    """One revolution by the SciPy event loop."""

    def run() -> Callable[[], np.ndarray]:
        result = module.simulate(0.5, 1.0, rtol, 'centred')
        return lambda: np.array(result.final[1:3])

    return lambda: run


def main() -> None:
    """Print the table."""
    states = json.loads(REFERENCE.read_text())['states']
    final = np.array([float(states['th3'][-1]), float(states['th4'][-1])])
    tuned, plain = peer(numpy_functions=False), peer(numpy_functions=True)
    print('rtol  |   this package: min, median, error |     SciPy: min, median, error |'
          ' SciPy with NumPy functions |  ratios')  # fmt: skip
    for rtol in (1e-6, 1e-8, 1e-10, 1e-12):
        columns, fastest = [], []
        for method in (ours(rtol), theirs(tuned, rtol), theirs(plain, rtol)):
            times, angles = cpu_times(method)
            fastest.append(min(times))
            error = np.abs(angles - final).max()
            columns.append(f'{min(times):9.3f} {median(times):9.3f} {error:8.1e}')
        ratios = ' '.join(f'{slow / fastest[0]:5.1f}' for slow in fastest[1:])
        print(f'{rtol:5.0e} | {" | ".join(columns)} | {ratios}')


if __name__ == '__main__':
    main()
