"""Ropes over pulleys, freewheels, ratchets, dogs: what holds one way, drawn at random."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from test.grid.case import Draft, Family, Random, Scene
from test.grid.four_bars import RESTITUTIONS, pick


def _scene(links: Scene, joints: Scene, **more: Any) -> Scene:
    return {
        'title': 'held one way', 'mechanism': 'linkage', 'links': links, 'joints': joints,
        'gravity': [0.0, -9.81], **more,
    }  # fmt: skip


def _weights(random: Random, k: int) -> Draft:
    """Two weights in guides at any angle, the rope over up to three points or pulleys."""
    count = 1 + k // 6 % 3
    across = np.linspace(0.0, 1.0, count + 2)[1:-1]
    points = {f'p{i}': [float(x), float(random.uniform(1.5, 2.5))] for i, x in enumerate(across)}
    over = [f'ground.p{i}' for i in range(count)]
    pulleys = {p: {'radius': float(random.uniform(0.02, 0.1))} for p in over[: k // 18 % 3]}
    lean = random.uniform(-0.3, 0.3, 2)
    links = {'ground': {'points': {**points, 'r': [1.0, 0.0]}},
             'a': {'mass': float(random.uniform(0.5, 3.0))},
             'b': {'mass': float(random.uniform(0.5, 3.0))}}  # fmt: skip
    joints = {
        'ga': {'prismatic': ['ground', 'a'], 'axis': 0.5 * math.pi + lean[0]},
        'gb': {'prismatic': ['ground.r', 'b'], 'axis': 0.5 * math.pi + lean[1]},
        'rope': {'rope': ['a', *over, 'b'], 'restitution': pick(random, RESTITUTIONS),
                 **({'pulleys': pulleys} if pulleys else {})},
    }  # fmt: skip
    rates = {'a': float(random.uniform(-0.5, 1.5)), 'b': float(random.uniform(-0.5, 1.5))}
    return Draft(_scene(links, joints, initial={'velocity': rates}), duration=0.6)


def _hanging(random: Random, k: int) -> Draft:
    """A body that hangs freely in one or two ropes, some over a pulley with a counterweight."""
    inertia = float(random.uniform(0.02, 0.2))
    off = random.uniform(-0.3, 0.3, 2).tolist()
    links: Scene = {
        'ground': {'points': {'l': [-1.0, 2.0], 'r': [1.0, 2.0], 'g': [2.0, 0.0]}},
        'w': {'mass': float(random.uniform(0.5, 3.0)), 'inertia': inertia,
              'points': {'c': off, 'd': [0.3, 0.1]}},
    }  # fmt: skip
    slack, e = float(random.uniform(0.0, 0.3)), pick(random, RESTITUTIONS)
    joints: Scene = {}
    if k % 12 < 6:
        links['a'] = {'mass': float(random.uniform(0.5, 3.0))}
        joints['ga'] = {'prismatic': ['ground.g', 'a'], 'axis': '90 deg'}
        joints['rope'] = {'rope': ['ground.l', 'w.c', 'ground.r', 'a'], 'restitution': e,
                          'pulleys': {'w.c': {'radius': 0.05}}}  # fmt: skip
        joints['rope']['length'] = 7.6 + slack
    else:
        joints['rope'] = {'rope': ['ground.l', 'w.c'], 'restitution': e, 'length': 3.2 + slack}
        joints['other'] = {'rope': ['ground.r', 'w.d'], 'restitution': 0.0, 'length': 2.8}
    joints['lift'] = {'slot': ['w', 'ground'], 'axis': '90 deg'} if k % 4 == 1 else {
        'rope': ['ground.l', 'w'], 'length': 5.0
    }  # fmt: skip
    rates = {'w': float(random.uniform(-2.0, 2.0))}
    return Draft(_scene(links, joints, initial={'velocity': rates}), duration=1.0)


def _tackle(random: Random, k: int) -> Draft:
    """A block in a guide in as many strands as 2 to 5, all from the same points."""
    strands = 2 + k // 6 % 4
    course = ['ground.top' if i % 2 == strands % 2 else 'w' for i in range(strands)]
    if course[0] == 'w':
        course = ['w', *course[1:]]
    links = {'ground': {'points': {'top': [0.05, 2.0], 'out': [0.5, 2.0], 'r': [0.5, 0.0]}},
             'w': {'mass': float(random.uniform(1.0, 8.0))},
             'a': {'mass': float(random.uniform(0.5, 3.0))}}  # fmt: skip
    joints = {'gw': {'prismatic': ['ground', 'w'], 'axis': '90 deg'},
              'ga': {'prismatic': ['ground.r', 'a'], 'axis': '90 deg'},
              'rope': {'rope': [*course, 'ground.out', 'a'],
                       'restitution': pick(random, RESTITUTIONS)}}  # fmt: skip
    rates = {'w': float(random.uniform(-0.3, 0.8)), 'a': float(random.uniform(-0.3, 0.8))}
    return Draft(_scene(links, joints, initial={'velocity': rates}), duration=0.4)


def _shafts(random: Random, k: int) -> Draft:
    """Shafts in a row, each joined to the next by a freewheel, a ratchet or dogs."""
    count = 2 + k // 6 % 3
    links: Scene = {'ground': {}}
    joints: Scene = {}
    loads: Scene = {}
    for i in range(count):
        links[f's{i}'] = {'mass': 1.0, 'inertia': float(random.uniform(0.2, 2.0))}
        joints[f'axis{i}'] = {'revolute': ['ground', f's{i}']}
        drag = float(random.uniform(0.1, 0.5))
        push = f'{random.uniform(1.0, 5.0)}*cos({random.uniform(2.0, 5.0)}*t)'
        loads[f'load{i}'] = {
            'at': f's{i}', 'torque': f'{push if i == 0 else 0.0} - {drag}*s{i}_rate'
        }  # fmt: skip
    for i in range(count - 1):
        pair, way = [f's{i}', f's{i + 1}'], pick(random, ('clockwise', 'counterclockwise'))
        e = pick(random, RESTITUTIONS)
        joints[f'own{i}'] = pick(random, (
            {'freewheel': pair, 'drives': way},
            {'ratchet': pair, 'drives': way, 'teeth': int(random.integers(3, 60)),
             'restitution': e},
            {'transmission': pair, 'ratio': pick(random, ('1', '-1/2', '3/2')),
             'backlash': {'angle': float(random.uniform(0.02, 0.4)), 'restitution': e}},
        ))  # fmt: skip
    return Draft(_scene(links, joints, loads=loads), duration=5.0)


def _slides(random: Random, k: int) -> Draft:
    """Two weights tied by a taut rope, as a ratio, with play or without."""
    links = {'ground': {'points': {'r': [1.0, 0.3]}},
             'a': {'mass': float(random.uniform(0.5, 3.0))},
             'b': {'mass': float(random.uniform(0.5, 3.0))}}  # fmt: skip
    lean = random.uniform(-1.0, 1.0, 2)
    own: Scene = {'transmission': ['a', 'b'], 'ratio': pick(random, ('-1', '-1/2', '2'))}
    if k // 6 % 2:
        own['backlash'] = {'width': 0.02, 'restitution': pick(random, RESTITUTIONS)}
    joints = {'ga': {'prismatic': ['ground', 'a'], 'axis': 0.5 * math.pi + lean[0]},
              'gb': {'prismatic': ['ground.r', 'b'], 'axis': 0.5 * math.pi + lean[1]},
              'own': own}  # fmt: skip
    loads = {'shake': {'at': 'a', 'force': [0.0, f'{random.uniform(5.0, 40.0)}*sin(9*t)']}}
    return Draft(_scene(links, joints, loads=loads), duration=1.5)


def _hoist(random: Random, k: int) -> Draft:
    """An arm that turns and pulls a weight over a pulley, driven or by a torque."""
    links = {'ground': {'points': {'p': [0.6, 1.5], 'r': [1.0, 0.0]}},
             'arm': {'length': 0.4, 'mass': 1.0, 'inertia': 0.1, 'cog': 0.2},
             'b': {'mass': float(random.uniform(0.5, 3.0))}}  # fmt: skip
    rope = {'rope': ['arm.end', 'ground.p', 'b'], 'length': 3.9,
            'restitution': pick(random, RESTITUTIONS),
            'pulleys': {'ground.p': {'radius': float(random.uniform(0.02, 0.1))}}}  # fmt: skip
    joints = {'pivot': {'revolute': ['ground', 'arm']},
              'gb': {'prismatic': ['ground.r', 'b'], 'axis': '90 deg'}, 'rope': rope}  # fmt: skip
    speed = float(random.uniform(2.0, 9.0))
    drive: Scene = {'coordinate': 'arm', 'speed': speed, 'start_angle': -2.0}
    if k // 6 % 2:
        drive = {'coordinate': 'arm', 'torque': float(random.uniform(10.0, 30.0)),
                 'start_angle': -2.0}  # fmt: skip
    return Draft(_scene(links, joints, drive=drive), duration=1.2)


def _winch(random: Random, k: int) -> Draft:
    """A drum, driven or with inertia, that lifts and lowers a weight over a pulley."""
    r, way = float(random.uniform(0.05, 0.15)), pick(random, ('clockwise', 'counterclockwise'))
    links = {'ground': {'points': {'p': [1.0, 2.0], 'r': [1.2, 0.0]}},
             'drum': {'mass': 2.0, 'inertia': float(random.uniform(0.01, 0.3))},
             'b': {'mass': float(random.uniform(0.5, 3.0))}}  # fmt: skip
    rope = {'rope': ['drum', 'ground.p', 'b'], 'restitution': pick(random, RESTITUTIONS),
            'pulleys': {'drum': {'radius': r, 'passes': way}}}  # fmt: skip
    joints = {'axis': {'revolute': ['ground', 'drum']},
              'gb': {'prismatic': ['ground.r', 'b'], 'axis': '90 deg'}, 'rope': rope}  # fmt: skip
    if k % 2:
        push = f'{random.uniform(1.0, 8.0)}*sin({random.uniform(2.0, 9.0)}*t)'
        return Draft(
            _scene(links, joints, loads={'m': {'at': 'drum', 'torque': push}}), duration=1.0
        )
    speed = float(random.uniform(-9.0, 9.0))
    return Draft(_scene(links, joints, drive={'coordinate': 'drum', 'speed': speed}), duration=1.0)


_MAKERS = _weights, _hanging, _tackle, _shafts, _slides, _hoist, _winch


def _drawn(random: Random, k: int) -> Draft:
    return _MAKERS[k % len(_MAKERS)](random, k)


FAMILIES = (Family('ropes', 60, _drawn),)
