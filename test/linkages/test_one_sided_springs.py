"""One-sided springs with dampers in machines with loops: stops that are struck, soft to hard."""

from __future__ import annotations

import numpy as np
import pytest
from builders import made

import mechanism_sim as ms


@pytest.mark.sample(2)
@pytest.mark.parametrize('stiffness', [1e4, 1e6, 1e8, 1e10])
@pytest.mark.parametrize('damping', [1e2, 1e4, 1e5])
def test_a_piston_that_strikes_a_stop_goes_on_and_is_never_held(stiffness, damping):
    """Where the damper would pull, the force is zero: no rounding turns that to and fro."""
    machine = made(
        {
            'links': {
                'ground': {'points': {'wall': [0.35, 0.0]}},
                'crank': {'length': 0.05, 'mass': 0.5, 'inertia': 1e-3},
                'rod': {'length': 0.2, 'mass': 0.3, 'inertia': 1e-3},
                'piston': {'mass': 0.4},
            },
            'joints': {
                'main': {'revolute': ['ground', 'crank']},
                'pin': {'revolute': ['crank.end', 'rod']},
                'wrist': {'revolute': ['rod.end', 'piston']},
                'guide': {'prismatic': ['ground', 'piston']},
            },
            'springs': {
                'stop': {
                    'between': ['piston', 'ground.wall'], 'free_length': 0.12,
                    'stiffness': stiffness, 'damping': damping, 'acts': 'below',
                },
            },
            'loads': {'motor': {'at': 'crank', 'torque': '3 + 4*sin(30*t)'}},
            'drive': {'coordinate': 'crank', 'torque': {}},
            'initial': {'position': {'crank': 2.0}, 'velocity': {'crank': 10.0}},
        },
        'stopped',
    )  # fmt: skip
    solution = ms.simulate(machine, duration=0.5)
    assert abs(solution.energy.residual) < 1e-9 * solution.energy.exchanged
    pull = solution.sample(np.linspace(0.0, 0.5, 5001), 'spring.stop')['spring.stop.force']
    assert pull.max() <= 0.0
    assert pull.min() < -1.0
