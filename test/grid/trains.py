"""Random gear trains: gears on the ground, on links that turn, inside of others.

From a shaft on the ground a chain of gears grows; each next one is pivoted on the ground or on a
carrier, at a random distance and in a random direction, with external or internal teeth.
"""

from __future__ import annotations

import math
from functools import partial

from test.grid.case import Draft, Family, Random, Scene, rotate, variant
from test.grid.four_bars import LAWS, RESTITUTIONS, RIGID, decades, drive, pick

MODULE = 2e-3


def train(random: Random, kind: str = 'ideal') -> Scene:
    """A scene as a dictionary.

    `kind` is 'ideal'; 'loose' gives one mesh a backlash, 'soft' makes one elastic.
    """
    carried = random.random() < 0.5
    carrier = 'arm' if carried else 'ground'
    links: Scene = {'ground': {'points': {}}}
    joints: Scene = {}
    gears: Scene = {}
    loads: Scene = {}
    if carried:
        links['arm'] = {'points': {}, **body(random)}
        joints['arm_shaft'] = {'revolute': ['ground', 'arm']}
    start = rotate(float(random.uniform(-3.0, 3.0)), (random.uniform(0.0, 0.05) * carried, 0.0))
    if carried:
        start = 0.0 * start  # the sun turns about the shaft of the arm
    centres = [start]
    helix = float(random.uniform(-0.4, 0.4)) * (random.random() < 0.3)
    teeth = [int(random.integers(18, 50))]
    count = int(random.integers(2, 5))
    inside = [False] * count
    for i in range(count):
        links[f'l{i}'] = body(random)
    for i in range(1, count):
        n = int(random.integers(18, 50))
        internal = i == count - 1 and random.random() < 0.4
        reach = (teeth[-1] + n) / 2.0
        if internal:
            n = teeth[-1] + int(random.integers(15, 40))
            reach = (n - teeth[-1]) / 2.0
        inside[i] = internal
        way = float(random.uniform(-3.0, 3.0))
        reach *= MODULE / math.cos(helix)
        centres.append(centres[-1] + rotate(way, (reach, 0.0)))
        teeth.append(n)
    for i, at in enumerate(centres):
        links[carrier]['points'][f'c{i}'] = at.tolist()
        on = 'ground' if i == 0 and carried else f'{carrier}.c{i}'
        joints[f'shaft{i}'] = {'revolute': [on, f'l{i}']}
        gears[f'g{i}'] = {
            'at': f'l{i}', 'teeth': teeth[i], 'module': MODULE, 'internal': inside[i],
            'helix_angle': helix if i % 2 else -helix,
        }  # fmt: skip
        if i:
            pair = [f'g{i - 1}', f'g{i}']
            random.shuffle(pair)
            joints[f'mesh{i}'] = {'mesh': pair}
        loads[f'load{i}'] = {
            'at': f'l{i}',
            'torque': f'{random.uniform(-2.0, 2.0)}*sin({random.uniform(20.0, 90.0)}*t)'
            f' - {random.uniform(0.0, 0.05)}*l{i}_rate',
        }
    if carried:
        loads['arm'] = {'at': 'arm', 'torque': f'-{random.uniform(0.0, 0.2)}*arm_rate'}
    chosen = joints[f'mesh{int(random.integers(1, count))}']
    if kind != 'ideal':
        width = float(10.0 ** random.uniform(-6.0, -3.5))
        chosen['backlash'] = {'width': width}
        if kind == 'loose':
            chosen['backlash']['restitution'] = float(random.choice([0.0, 0.3, 0.6, 0.9]))
        else:
            chosen['elasticity'] = {
                'stiffness': float(10.0 ** random.uniform(5.0, 7.0)),
                'damping': float(random.uniform(0.0, 100.0)),
                'variation': ['contact_ratio', [0.2, 0.1]][int(random.integers(2))],
            }
        if random.random() < 0.3:
            chosen['error'] = {'amplitude': 1e-6, 'eccentricity': [5e-6, 3e-6]}
    drives: Scene = {
        'l0': {'speed': float(random.choice([1.0, -1.0]) * random.uniform(10.0, 60.0))}
    }
    if random.random() < 0.4:
        drives['l0']['torque'] = {'constant': 1.0, 'per_speed': -0.02}
    if carried and random.random() < 0.6:
        drives['arm'] = {'speed': float(random.uniform(-20.0, 20.0))}
        if 'torque' in drives['l0']:
            drives['arm']['torque'] = {'constant': -0.3, 'per_speed': -0.05}
    return {
        'title': 'by chance', 'mechanism': 'linkage', 'links': links, 'joints': joints,
        'gears': gears, 'loads': loads, 'drives': drives,
        'gravity': random.uniform(-10.0, 10.0, 2).tolist(),
    }  # fmt: skip


def body(random: Random) -> Scene:
    """Mass properties of a link."""
    return {
        'mass': float(random.uniform(0.2, 2.0)),
        'inertia': float(random.uniform(1e-4, 2e-3)),
        'cog': random.uniform(-0.01, 0.01, 2).tolist(),
    }


def _draft_train(kind: str, duration: float, random: Random, _k: int) -> Draft:
    return Draft(train(random, kind), duration=duration)


def _compliant(random: Random, k: int) -> Draft:
    scene = train(random, 'loose')
    for joint in scene['joints'].values():
        if 'backlash' in joint:
            joint['backlash']['restitution'] = max(joint['backlash']['restitution'], 0.3)
            joint['backlash']['contact'] = {
                'law': LAWS[k % 4],
                'stiffness': decades(random, 6.0, 9.0),
                'exponent': 1.5,
            }
    return Draft(scene, duration=0.1)


def _rattle(random: Random, k: int) -> Draft:
    """A pinion at any speed, a wheel that is shaken: backlash of 1 um to 1 mm."""
    keys, extent = drive(random, ('constant', 'ramp', 'smooth', 'torque')[k % 4], (0.7, 2.3))
    torque = f'{random.uniform(0.5, 4.0)}*sin({random.uniform(50.0, 300.0)}*t) - 0.02*wheel_rate'
    backlash = {'width': decades(random, -6.0, -3.0), 'restitution': pick(random, RESTITUTIONS),
                'hypothesis': pick(random, RIGID)}  # fmt: skip
    return Draft(
        variant('gear_rattle', {
            'drive': {'coordinate': 'pinion', **keys}, 'joints.mesh.backlash': backlash,
            'loads.shaking.torque': torque,
        }),
        **extent,
    )  # fmt: skip


UNFIT = ('reach inside the base circle',)  # internal gears of too few teeth

FAMILIES = (
    Family('train', 32, partial(_draft_train, 'ideal', 0.2), UNFIT),
    Family('train_backlash', 32, partial(_draft_train, 'loose', 0.2), UNFIT),
    Family('train_rattle', 40, _rattle, (), 4),
    Family('train_elastic', 24, partial(_draft_train, 'soft', 0.1), UNFIT),
    Family('train_compliant', 16, _compliant, UNFIT),
)
