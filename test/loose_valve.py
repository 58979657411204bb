"""A valve that may lift off its cam, whose start is forgotten where it rides on it."""

from __future__ import annotations

from builders import made

MASS, RISE, BEGINS, PRELOAD = 0.2, 0.006, 80.0, 0.03
"""[kg], [m] of the cam, the degrees of its rise, [m] by which the spring is compressed at rest."""


def valve(rpm: float):
    """The machine at a speed of its camshaft."""
    segment = {'curve': 'cycloidal'}
    law = [
        {'from': 0, 'to': f'{BEGINS} deg', 'rise': RISE, **segment},
        {'from': '90 deg', 'to': '170 deg', 'rise': -RISE, **segment},
    ]
    joints = {
        'bearing': {'revolute': ['ground', 'shaft']},
        'guide': {'prismatic': ['ground', 'valve'], 'axis': '90 deg'},
        'contact': {
            'cam': ['shaft', 'valve'], 'follower': 'flat', 'base_radius': 0.02,
            'law': {'segments': law}, 'lift_off': {'restitution': 0.4},
        },
    }  # fmt: skip
    spring = {'between': ['ground.seat', 'valve'], 'stiffness': 3e3, 'free_length': 0.07 + PRELOAD}
    scene = {
        'links': {
            'ground': {'points': {'seat': [0.0, 0.09]}},
            'shaft': {'mass': 1.0, 'inertia': 3e-4},
            'valve': {'mass': MASS},
        },
        'joints': joints,
        'gravity': [0.0, -9.81],
        'drive': {'coordinate': 'shaft', 'speed': f'{rpm} rpm'},
        'springs': {'s': spring},
    }
    return made(scene, 'valve')
