"""Trials of `mechanism-sim analyze --fit`: bags of known machines, and identified values.

Records ten run-ups of the scene `bearing_run_up` as nodes, each with another restitution,
friction, clearance and noise, identifies them as the command does, and writes the table of
docs/analysis.md.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.stats import qmc

from mechanism_sim.analysis.measurements import measurements
from mechanism_sim.studies.identification import identify
from mechanism_sim.studies.parameters import OF_JOINT, parameters

FILE = Path(__file__).parent / 'pictures' / 'identification.txt'
SCENE = 'bearing_run_up'
LIMITS = {
    'restitution': ('0.2', '0.8'),
    'friction': ('0.02', '0.25'),
    'radial': ('0.1 mm', '0.4 mm'),
}
TRIALS, SEED = 10, 2026
FIRST_NOISE = 101


def truths() -> np.ndarray:
    """Restitution, friction, radial clearance [m] of the trials, spread over the box: (10, 3)."""
    unit = qmc.LatinHypercube(3, rng=SEED).random(TRIALS)
    e = 0.2 + 0.6 * unit[:, 0]
    return np.column_stack([e, 0.02 * 12.5 ** unit[:, 1], 1e-4 * 4.0 ** unit[:, 2]])


def record(file: Path, truth: np.ndarray, noise: int) -> None:
    """Run the machine as nodes and record it."""
    place = 'joints.coupler_rocker.clearance'
    values = [f'{place}.{name}={x!r}' for name, x in zip(OF_JOINT, truth.tolist(), strict=True)]
    values.append(f'sensors.rocker.noise.seed={noise}')
    given = [x for value in values for x in ('--set', value)]
    command = [sys.executable, '-m', 'mechanism_sim', 'run', SCENE, *given, '--record', str(file)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)  # noqa: S603 - our own


def main() -> None:
    """Make the table, trial by trial."""
    rows = [
        '| trial | restitution: true | found | friction: true | found | clearance: true [mm] | '
        'found [mm] | all within | window | misfit | CPU |',
        '|---|---|---|---|---|---|---|---|---|---|---|',
    ]
    within = 0
    with TemporaryDirectory() as folder:
        for k, truth in enumerate(truths()):
            bag = Path(folder) / f'{k}.mcap'
            record(bag, truth, FIRST_NOISE + k)
            signals = measurements([bag], [SCENE])
            wanted = parameters(signals[0].machine, OF_JOINT, 'rocker', limits=LIMITS)
            begin = time.process_time()
            found = identify(signals, wanted, seed=k)
            cpu = time.process_time() - begin
            cells, good = [], []
            for e, x, scale in zip(found.estimates, truth, (1.0, 1.0, 1e3), strict=True):
                good.append(e.low <= x <= e.high)
                missed = '' if good[-1] else ' (no)'
                cells += [
                    f'{scale * x:.4g}',
                    f'{scale * e.value:.4g}, {scale * e.low:.4g} to {scale * e.high:.4g}{missed}',
                ]
            within += all(good)
            verdict = (
                f'{"yes" if all(good) else "no"} | {found.window:.2g} s | {found.misfit:.2f} | '
                f'{cpu:.0f} s'
            )
            rows.append(f'| {k + 1} | {" | ".join(cells)} | {verdict} |')
            print(rows[-1], flush=True)
    rows += ['', f'All three within their limits in {within} of {TRIALS} trials.']
    print(rows[-1])
    FILE.write_text('\n'.join(rows) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
