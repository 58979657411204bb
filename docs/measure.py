"""Accuracy and speed as the documentation states them: ``python docs/measure.py``.

Every run is compared with test/references, which a program that shares nothing with this one made
in 256-bit arithmetic. Times are CPU times of the best of several runs, without compilation.
"""

from __future__ import annotations

import json
import platform
import sys
from pathlib import Path

import heyoka
import numpy as np

import mechanism_sim as ms

REFERENCES = Path(__file__).parents[1] / 'test' / 'references'
RUNS = 7
FAST = 1e-3  # [m/s] impacts that every tolerance below resolves
COUNTED = 20
HEAD = (
    'start    e   rtol   revolutions  CPU/rev  steps/rev  angle error  impact times  penetration'
    '  energy residual'
)
UNITS = (
    '                                     [ms]                   [rad]           [s]          [m]'
    '              [J]'
)


def against_reference(name: str, rtol: float) -> str:
    """One line: a reference run repeated at a tolerance."""
    reference = json.loads((REFERENCES / f'four_bar_{name}.json').read_text())
    states, struck = reference['states'], reference['impacts']
    end, revolutions = float(states['t'][-1]), float(reference['revolutions'])
    start, e = name.partition('_')[0], float(reference['restitution'])
    machine = ms.load_scene(
        'four_bar_clearance',
        {
            'start': start,
            'joints.coupler_rocker.clearance.restitution': e,
            'solver.rtol': rtol,
        },
    )
    runs = [ms.simulate(machine, duration=end) for _ in range(RUNS)]
    solution = runs[0]
    cpu = min(run.stats.cpu_time for run in runs) / revolutions
    final = solution.sample(end)
    angle = max(
        abs(final[f'position.{link}'][0] - float(states[key][-1]))
        for link, key in (('coupler', 'th3'), ('rocker', 'th4'))
    )
    speeds = np.array(struck['approach_speed'], float)
    right = np.array(struck['t'], float)[speeds > FAST][:COUNTED]
    found = np.array([i.t for i in solution.impacts if i.approach_speed > FAST][:COUNTED])
    late = np.abs(found - right).max() if len(found) == len(right) else np.nan
    residual = solution.energy.residual if solution.energy else np.nan
    return (
        f'{start:8} {e:<3g} {rtol:5.0e} {revolutions:12g} {1e3 * cpu:8.2f} '
        f'{solution.stats.steps / revolutions:10.0f} {angle:12.1e} {late:13.1e} '
        f'{solution.max_penetration:12.1e} {residual:16.1e}'
    )


def nominal() -> str:
    """Errors of the ideal four-bar against 50-digit arithmetic."""
    reference = json.loads((REFERENCES / 'nominal.json').read_text())
    machine = ms.load_scene('four_bar_nominal')
    solution = ms.simulate(machine)
    angles = np.radians(np.array(reference['crank_angle'], float))
    x = solution.sample(angles / machine.scene.drive.speed)
    rows = (
        ('angles [rad]', ('position.coupler', 'position.rocker'), ('th3', 'th4')),
        (
            'bearing force [N]',
            ('reaction.coupler_rocker.x', 'reaction.coupler_rocker.y'),
            ('force_x', 'force_y'),
        ),
        ('crank torque [N m]', ('drive_torque',), ('torque',)),
    )
    lines = []
    for what, ours, theirs in rows:
        right = np.array([reference[key] for key in theirs], float)
        error = np.abs(np.array([x[key] for key in ours]) - right).max()
        lines.append(f'{what:20} {error:.1e}')
    return '\n'.join(lines)


def main() -> None:
    """Print both tables."""
    print(
        f'heyoka {heyoka.__version__}, Python {platform.python_version()}, {platform.machine()}; '
        f'best of {RUNS} runs\n'
    )
    print(f'{HEAD}\n{UNITS}')
    for name in ('centred_e05', 'centred_e01', 'seated_e05', 'centred_e1'):
        for rtol in (1e-6, 1e-8, 1e-10, 1e-12):
            print(against_reference(name, rtol))
            sys.stdout.flush()
    print(
        f'impact times: the first {COUNTED} faster than {FAST:g} m/s; nan: chatter cut among them'
    )
    print(
        'e = 1: a start 1e-16 rad off grows to 1e-4 rad in a revolution; its angle error is void'
    )
    print(f'\nideal four-bar, largest error at eight crank angles\n{nominal()}')


if __name__ == '__main__':
    main()
